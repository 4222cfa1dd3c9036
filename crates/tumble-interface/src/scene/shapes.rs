//! Solid shapes and meshes from files.

use super::{Animated, items_above_zero};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A solid that masses cannot enter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Collider {
    /// Name in frames and pictures.
    pub name: String,
    /// Its shape.
    pub shape: Shape,
    /// Distance kept between masses and the surface.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
    pub thickness: f64,
    /// Kinetic friction coefficient (Coulomb); may change in time.
    #[serde(default = "smooth")]
    #[schemars(extend("x-unit" = "1"))]
    pub friction: Animated,
    /// Static friction coefficient, at least `friction`. Default: equal to `friction`.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1"))]
    pub friction_static: Option<Animated>,
    /// Speed after a bounce over speed before.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub restitution: f64,
    /// Inverted: a container that keeps masses inside. Not for planes and shells.
    #[serde(default)]
    pub inside: bool,
    /// Whether its edges and corners collide with soft surfaces and curves, too, in systems with `self_contact`: for sharp solids, or ones thinner
    /// than the mesh spacing of soft objects. The distance kept is then its `thickness`, at least 0.6 of that of `self_contact`; edges have no
    /// restitution. Not for planes, and not in 2D scenes.
    #[serde(default)]
    pub edges: bool,
    /// Velocity of the surface, as of a conveyor belt; the shape does not move with it, but its rotation rotates this velocity.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub belt: [f64; 3],
    /// Rigid motion. Default: none.
    #[serde(default)]
    pub motion: Option<Motion>,
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

fn smooth() -> Animated {
    0.0.into()
}

/// A rigid motion: along keyframes, then at constant velocity and spin. Without keyframes, the solid is at the position of its shape at t = 0.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Motion {
    /// Velocity of the pivot.
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: [f64; 3],
    /// Angular velocity about the pivot, along the axis by the right-hand rule.
    #[schemars(extend("x-unit" = "rad/s"))]
    pub spin: [f64; 3],
    /// Centre of rotation for spin and keyframes, in the position without motion.
    #[schemars(extend("x-unit" = "m"))]
    pub pivot: [f64; 3],
    /// Poses at increasing times; constant before the first and after the last.
    pub keys: Vec<Pose>,
    /// Interpolation between keyframes.
    pub interpolation: Pace,
    /// Size relative to that of the shape, about the pivot; > 0. A sphere, box, capsule or lathe of another size is the mesh that pictures show. Between
    /// its keys, or from frame to frame of a formula or smooth keys, it changes at a constant rate. Default: 1.
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub scale: Option<Animated>,
}

/// A keyframe of a motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// When.
    #[schemars(extend("x-unit" = "s"))]
    pub time: f64,
    /// Translation relative to the shape's position.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub translate: [f64; 3],
    /// Rotation about x, then y, then z. The rotation to the next keyframe takes the shorter arc, below 180°.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
}

/// Interpolation between keyframes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pace {
    /// Constant velocity from one to the next.
    #[default]
    Linear,
    /// Eased from rest to rest: s² (3 - 2 s).
    Smooth,
}

/// A solid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// A ball.
    Sphere {
        /// Its centre.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Its radius.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
    },
    /// A box, axis-aligned unless rotated.
    Box {
        /// Its centre.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Its edges.
        #[schemars(transform = items_above_zero, extend("x-unit" = "m"))]
        size: [f64; 3],
        /// Rotation about x, then y, then z.
        #[serde(default)]
        #[schemars(extend("x-unit" = "°"))]
        rotate: [f64; 3],
    },
    /// Everything below a plane.
    Plane {
        /// A point of the plane.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        point: [f64; 3],
        /// Direction out of the solid, of any length.
        normal: [f64; 3],
    },
    /// Everything below a height.
    Floor {
        /// Height of the floor.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        height: f64,
    },
    /// A cylinder with round ends: all points closer than its radius to a segment.
    Capsule {
        /// One end of the segment.
        #[schemars(extend("x-unit" = "m"))]
        from: [f64; 3],
        /// The other end.
        #[schemars(extend("x-unit" = "m"))]
        to: [f64; 3],
        /// Its radius.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
    },
    /// A solid of revolution about an axis along z: funnels, bowls, vases, cones.
    Lathe {
        /// Point of the axis with z = 0 in `profile`.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Corners of half the cross-section, in order: distance from the axis and height of each.
        #[schemars(length(min = 3), extend("x-unit" = "m"))]
        profile: Vec<[f64; 2]>,
        /// Number of flat sides around the axis.
        #[serde(default = "around")]
        #[schemars(range(min = 3, max = 1000))]
        sides: u32,
    },
    /// A triangle mesh from a file.
    Mesh(MeshFile),
    /// A triangle mesh with moving vertices, from one file per keyframe.
    AnimatedMesh(MeshFrames),
    /// A skinned figure from a glTF file, animated by one of its clips.
    Character(Figure),
    /// A generated figure: an artist's mannequin that stands, walks, twirls or dances. It faces -y, its left is +x, its soles are at z = 0.
    Mannequin(Mannequin),
}

fn around() -> u32 {
    64
}

/// A skinned, animated figure from a GLB or glTF file. Its vertices move linearly between frames of `rate`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Figure {
    /// File, relative to the scene file.
    pub path: String,
    /// Hash of the file's content. Default: any content is accepted.
    #[serde(default)]
    pub hash: Option<String>,
    /// Name of the animation clip. Default: the first in the file.
    #[serde(default)]
    pub clip: Option<String>,
    /// Whether the clip repeats; otherwise the figure stays in its last pose.
    #[serde(default = "yes")]
    pub repeat: bool,
    /// Scale factor.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub scale: f64,
    /// Rotation about x, then y, then z. The default [90, 0, 0] turns the y axis of the file, up in glTF, into the z axis.
    #[serde(default = "upright")]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
    /// Translation after scaling and rotation.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub translate: [f64; 3],
    /// Start of the motion; before, the figure is in its pose without clips.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub start: f64,
    /// Duration of the transition from that pose into the motion. 0 is immediate.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub settle: f64,
    /// Keyframes per second of the motion for collisions.
    #[serde(default = "sixty")]
    #[schemars(range(min = 1.0, max = 1000.0), extend("x-unit" = "1/s"))]
    pub rate: f64,
    /// Treats the surface as a shell without an inside; for figures that are not closed (needs a thickness).
    #[serde(default)]
    pub shell: bool,
}

/// A mannequin. Its bones, which pins can follow: `hips`, `spine`, `chest`, `neck`, `head`; on its left `shoulder_l`, `upper_arm_l`, `forearm_l`,
/// `hand_l`, `thigh_l`, `shin_l`, `foot_l`, `toes_l`; on its right the same with `_r`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Mannequin {
    /// Its motion.
    pub motion: Moves,
    /// Its height.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub height: f64,
    /// Speed factor of its motion.
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub pace: f64,
    /// Whether a walk moves forward; otherwise it is on the spot.
    pub travel: bool,
    /// Rotation about x, then y, then z.
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
    /// Translation after rotation.
    #[schemars(extend("x-unit" = "m"))]
    pub translate: [f64; 3],
    /// Start of the motion; before, the mannequin stands with its arms held out downwards at 45°.
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub start: f64,
    /// Duration of the transition from that pose into the motion. 0 is immediate.
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub settle: f64,
    /// Keyframes per second of the motion for collisions.
    #[schemars(range(min = 1.0, max = 1000.0), extend("x-unit" = "1/s"))]
    pub rate: f64,
}

impl Default for Mannequin {
    fn default() -> Self {
        Self {
            motion: Moves::default(),
            height: 1.7,
            pace: 1.0,
            travel: false,
            rotate: [0.0; 3],
            translate: [0.0; 3],
            start: 0.0,
            settle: 1.0,
            rate: 60.0,
        }
    }
}

/// Motion of a mannequin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Moves {
    /// It stays in the dressing pose.
    Bind,
    /// It stands at ease and breathes.
    #[default]
    Stand,
    /// It walks, with steps of 0.55 m in 0.55 s at a height of 1.7 m.
    Walk,
    /// It turns about the vertical on the balls of its feet, arms held out, once in 1.6 s.
    Twirl,
    /// Steps to the side, swaying hips and arms, and a twirl, again every 8 s.
    Dance,
}

/// Meshes at given times, linearly interpolated. All have the same triangles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshFrames {
    /// The meshes, at increasing times; constant before the first and after the last.
    pub frames: Vec<MeshFrame>,
    /// Scale factor.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub scale: f64,
    /// Rotation about x, then y, then z.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
    /// Translation after scaling and rotation.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub translate: [f64; 3],
    /// Treats the mesh as a shell without an inside; for meshes that are not closed (needs a thickness).
    #[serde(default)]
    pub shell: bool,
}

/// The shape of an animated mesh at one time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshFrame {
    /// When.
    #[schemars(extend("x-unit" = "s"))]
    pub time: f64,
    /// File, relative to the scene file.
    pub path: String,
    /// Hash of the file's content. Default: any content is accepted.
    #[serde(default)]
    pub hash: Option<String>,
}

/// What a scene wants of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Content {
    /// Triangles.
    Mesh,
    /// A skinned figure.
    Character,
    /// Curves: guides of hair.
    Curves,
}

/// A reference to a file: its place in the scene, its path, and the hash of its content.
#[derive(Debug)]
pub struct MeshRef<'a> {
    /// What is read of it.
    pub content: Content,
    /// Place in the scene, for messages.
    pub place: String,
    /// File, relative to the scene file.
    pub path: &'a str,
    /// Hash of the file's content.
    pub hash: &'a mut Option<String>,
}

impl<'a> MeshRef<'a> {
    /// A mesh that is named at a place of the scene.
    pub(super) fn mesh(place: String, file: &'a mut MeshFile) -> Self {
        Self { content: Content::Mesh, place, path: &file.path, hash: &mut file.hash }
    }
}

/// A triangle mesh from an OBJ, PLY, STL or GLB file (y up becomes z up in GLB), or outside the browser from USD; scaled, rotated, then translated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshFile {
    /// File, relative to the scene file.
    pub path: String,
    /// Hash of the file's content. Default: any content is accepted.
    #[serde(default)]
    pub hash: Option<String>,
    /// Scale factor.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub scale: f64,
    /// Rotation about x, then y, then z.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
    /// Translation after scaling and rotation.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub translate: [f64; 3],
    /// Cells of the signed-distance grid along the longest side (colliders only).
    #[serde(default = "ninety_six")]
    #[schemars(range(min = 8, max = 512))]
    pub resolution: u32,
    /// Treats the mesh as a shell without an inside; for meshes that are not closed (colliders only; needs a thickness).
    #[serde(default)]
    pub shell: bool,
}

fn one() -> f64 {
    1.0
}

fn sixty() -> f64 {
    60.0
}

fn upright() -> [f64; 3] {
    [90.0, 0.0, 0.0]
}

fn yes() -> bool {
    true
}

fn ninety_six() -> u32 {
    96
}
