//! Solid shapes and meshes from files.

use super::items_above_zero;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A solid thing that masses cannot enter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Collider {
    /// Name in frames and pictures.
    pub name: String,
    /// Its shape.
    pub shape: Shape,
    /// Masses are kept this far from the surface.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
    pub thickness: f64,
    /// Coulomb friction coefficient of what slides.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub friction: f64,
    /// Coulomb friction coefficient of what rests, at least `friction`; without it, the same.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub friction_static: Option<f64>,
    /// Speed after a bounce over speed before.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub restitution: f64,
    /// Turned inside out: a container that keeps masses in. Not for planes and shells.
    #[serde(default)]
    pub inside: bool,
    /// Whether its edges and corners meet those of soft surfaces and curves, too, in systems with `self_contact`: for what is sharp, or
    /// thinner than the mesh of what falls on it. All then keep off it by its `thickness`, at least 0.6 of that of `self_contact`; edges do
    /// not bounce. Neither for planes nor in scenes of two dimensions.
    #[serde(default)]
    pub edges: bool,
    /// Velocity of the surface itself, as of a conveyor belt; the shape stays, and turns this along when it turns.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub belt: [f64; 3],
    /// How it moves, as a rigid whole; without it, it stays.
    #[serde(default)]
    pub motion: Option<Motion>,
    /// Red, green and blue in pictures, 0 to 1, in linear light (a half is sRGB's 188 of 255).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// A rigid motion: along keyframes, then on at constant velocity and spin. At t = 0, without keyframes, the thing is where
/// its shape says.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Motion {
    /// Velocity of the pivot.
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: [f64; 3],
    /// Angular velocity about the pivot: its direction is the axis, after the right hand.
    #[schemars(extend("x-unit" = "rad/s"))]
    pub spin: [f64; 3],
    /// The point about which spin and keyframes turn, where it is without motion.
    #[schemars(extend("x-unit" = "m"))]
    pub pivot: [f64; 3],
    /// Places at rising times; before the first and after the last it stays.
    pub keys: Vec<Pose>,
    /// What happens between keyframes.
    pub interpolation: Pace,
}

/// A keyframe of a motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// When.
    #[schemars(extend("x-unit" = "s"))]
    pub time: f64,
    /// Movement away from where the shape says.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub translate: [f64; 3],
    /// Turn about x, then y, then z. The way to the next keyframe is the shorter one: below 180°.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
}

/// What happens between keyframes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pace {
    /// Constant velocity from one to the next.
    #[default]
    Linear,
    /// From rest to rest: s² (3 - 2 s) of the way.
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
    /// A box with edges along the axes, turned if asked.
    Box {
        /// Its centre.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Its edges.
        #[schemars(transform = items_above_zero, extend("x-unit" = "m"))]
        size: [f64; 3],
        /// Turn about x, then y, then z.
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
    /// A cylinder with round ends: everything closer than its radius to a segment.
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
        /// Where the axis has z = 0.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Corners of half the cut through it, in order around: distance from the axis and height of each.
        #[schemars(length(min = 3), extend("x-unit" = "m"))]
        profile: Vec<[f64; 2]>,
        /// Flat sides around.
        #[serde(default = "around")]
        #[schemars(range(min = 3, max = 1000))]
        sides: u32,
    },
    /// A triangle mesh from a file.
    Mesh(MeshFile),
    /// A triangle mesh whose vertices move, from a file for each of some times.
    AnimatedMesh(MeshFrames),
    /// A skinned figure from a glTF file that one of its clips moves.
    Character(Figure),
    /// A figure that is made here: an artist's mannequin that stands, walks, twirls or dances. It looks along -y, its left is +x, its
    /// soles are at z = 0.
    Mannequin(Mannequin),
}

fn around() -> u32 {
    64
}

/// A skinned, animated figure from a GLB or glTF file. Between frames of `rate` its vertices move straight.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Figure {
    /// File, relative to the scene file.
    pub path: String,
    /// Hash of the file's content; without it, any content will do.
    #[serde(default)]
    pub hash: Option<String>,
    /// Name of the movement; without it, the first of the file.
    #[serde(default)]
    pub clip: Option<String>,
    /// Whether the clip starts again after its end; else the figure stays in its last pose.
    #[serde(default = "yes")]
    pub repeat: bool,
    /// Factor on the size.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub scale: f64,
    /// Turn about x, then y, then z. Without it the y axis of the file, up in glTF, becomes the z axis: [90, 0, 0].
    #[serde(default = "upright")]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
    /// Movement after scaling and turning.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub translate: [f64; 3],
    /// When the movement begins; before, the figure is in its pose without clips.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub start: f64,
    /// Time for the way from that pose into the movement. 0 is at once.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub settle: f64,
    /// Frames a second into which the movement is divided for collisions.
    #[serde(default = "sixty")]
    #[schemars(range(min = 1.0, max = 1000.0), extend("x-unit" = "1/s"))]
    pub rate: f64,
    /// Treat the surface as a shell without an inside; for figures that are not closed (needs a thickness).
    #[serde(default)]
    pub shell: bool,
}

/// A mannequin. Its bones, which pins follow: `hips`, `spine`, `chest`, `neck`, `head`; on its left `shoulder_l`, `upper_arm_l`, `forearm_l`,
/// `hand_l`, `thigh_l`, `shin_l`, `foot_l`, `toes_l`; and on its right the same with `_r`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Mannequin {
    /// What it does.
    pub motion: Moves,
    /// Its height.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub height: f64,
    /// Factor on the pace of its movement.
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub pace: f64,
    /// Whether a walk goes forward; else it is one on the spot.
    pub travel: bool,
    /// Turn about x, then y, then z.
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
    /// Movement after turning.
    #[schemars(extend("x-unit" = "m"))]
    pub translate: [f64; 3],
    /// When the movement begins; before, the mannequin stands with its arms held out downwards at 45°.
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub start: f64,
    /// Time for the way from that pose into the movement. 0 is at once.
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub settle: f64,
    /// Frames a second into which the movement is divided for collisions.
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

/// What a mannequin does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Moves {
    /// It stays in the pose in which it is dressed.
    Bind,
    /// It stands at ease and breathes.
    #[default]
    Stand,
    /// It walks, a step of 0.55 m in 0.55 s at a height of 1.7 m.
    Walk,
    /// It turns about the vertical on the balls of its feet, arms held out, once in 1.6 s.
    Twirl,
    /// Steps to the side, swaying hips and arms, and a twirl, again every 8 s.
    Dance,
}

/// A mesh for each of some times, linear in time between them. All have the same triangles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshFrames {
    /// The meshes, at rising times; before the first and after the last nothing moves.
    pub frames: Vec<MeshFrame>,
    /// Factor on the size.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub scale: f64,
    /// Turn about x, then y, then z.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
    /// Movement after scaling and turning.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub translate: [f64; 3],
    /// Treat the mesh as a shell without an inside; for meshes that are not closed (needs a thickness).
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
    /// Hash of the file's content; without it, any content will do.
    #[serde(default)]
    pub hash: Option<String>,
}

/// A file that a scene names: its place in the scene, its path, and the hash of its content.
#[derive(Debug)]
pub struct MeshRef<'a> {
    /// Whether it is a character, and not a mesh alone.
    pub skinned: bool,
    /// Place in the scene, for messages.
    pub place: String,
    /// File, relative to the scene file.
    pub path: &'a str,
    /// Hash of the file's content.
    pub hash: &'a mut Option<String>,
}

/// A triangle mesh from an OBJ, PLY, STL or GLB file, or outside the browser from USD, placed in the world: scaled, turned, then moved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshFile {
    /// File, relative to the scene file.
    pub path: String,
    /// Hash of the file's content; without it, any content will do.
    #[serde(default)]
    pub hash: Option<String>,
    /// Factor on the size.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub scale: f64,
    /// Turn about x, then y, then z.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
    /// Movement after scaling and turning.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub translate: [f64; 3],
    /// Cells of the signed-distance grid along the longest side (colliders only).
    #[serde(default = "ninety_six")]
    #[schemars(range(min = 8, max = 512))]
    pub resolution: u32,
    /// Treat the mesh as a shell without an inside; for meshes that are not closed (colliders only; needs a thickness).
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
