//! Structures of masses and links. Stiffness is given so that it does not depend on how finely an
//! object is divided: k_s = modulus x (length, area or volume that the link stands for) / l0².

use super::fabrics::FabricWords;
use super::surfaces::{Fluid, Inflation, Membrane, ShapeMatching, Tear};
use super::{MeshFile, items_above_zero};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Free masses, and springs between chosen ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Particles {
    /// Name in frames.
    pub name: String,
    /// System that moves it; without it, the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// Where the masses start; this or `cloud`.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub position: Vec<[f64; 3]>,
    /// Masses at random places; this or `position`.
    #[serde(default)]
    pub cloud: Option<Cloud>,
    /// How fast they start: one velocity each, or a single one for all.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: Vec<[f64; 3]>,
    /// Mass of each, or a single one for all.
    #[serde(default = "one_each")]
    #[schemars(length(min = 1), transform = items_above_zero, extend("x-unit" = "kg"))]
    pub mass: Vec<f64>,
    /// Electric charge of each, or a single one for all.
    #[serde(default)]
    #[schemars(extend("x-unit" = "C"))]
    pub charge: Vec<f64>,
    /// Masses that stay where they are.
    #[serde(default)]
    pub pin: Vec<Pin>,
    /// Springs between them.
    #[serde(default)]
    pub spring: Vec<Spring>,
    /// Makes it a liquid that fills boxes at the start, instead of `position`, `cloud` and `mass`. Position-based dynamics only.
    #[serde(default)]
    pub fluid: Option<Fluid>,
    /// Keeps the whole in shape. Position-based dynamics only.
    #[serde(default)]
    pub shape_matching: Option<ShapeMatching>,
    /// Radius in pictures.
    #[serde(default = "centimetre")]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// How much of the way behind each is drawn in pictures.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub trail: f64,
    /// Red, green and blue in pictures, 0 to 1, in linear light (a half is sRGB's 188 of 255).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// Masses at random places, the same for the same seed and name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cloud {
    /// How many.
    #[schemars(range(min = 1, max = 100_000_000))]
    pub count: u32,
    /// The middle.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// Edges of the box, or diameters of the sphere; zero along one axis makes it flat.
    #[schemars(inner(range(min = 0.0)), extend("x-unit" = "m"))]
    pub size: [f64; 3],
    /// What is filled.
    #[serde(default)]
    pub shape: CloudShape,
    /// Speed into directions drawn at random, in the plane of a flat cloud; it adds to `velocity`.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "m/s"))]
    pub speed: f64,
}

/// What a cloud fills.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CloudShape {
    /// A box.
    #[default]
    Box,
    /// A ball, or what a ball becomes with three different diameters.
    Sphere,
}

/// A spring between two masses of one object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spring {
    /// Indices of the two masses.
    pub between: [u32; 2],
    /// Spring constant k_s.
    #[schemars(range(min = 0.0), extend("x-unit" = "N/m"))]
    pub stiffness: f64,
    /// Rest length; 0 makes f = k_s (b - a); without it, the distance at the start.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
    pub rest_length: Option<f64>,
    /// Internal damping: force along the spring per speed of lengthening.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N s/m"))]
    pub damping: f64,
    /// Stiffening: force k_s r (1 + hardening (r / l0)²) at the extension r.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub hardening: f64,
    /// Pulls but does not push, like a thread.
    #[serde(default)]
    pub tension_only: bool,
    /// Breaks for good when |r| / l0 exceeds this.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub break_strain: Option<f64>,
}

/// Stars, placed at random and set going so that they hold together under the gravitation of the scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Galaxy {
    /// Name in frames; with the scene's seed, the key of its random numbers.
    pub name: String,
    /// System that moves it; without it, the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// How the stars lie.
    #[serde(default)]
    pub profile: Profile,
    /// Count of stars.
    #[serde(default = "many")]
    #[schemars(range(min = 1, max = 100_000_000))]
    pub stars: u32,
    /// Mass of all stars together.
    #[schemars(extend("x-unit" = "kg", "exclusiveMinimum" = 0.0))]
    pub mass: f64,
    /// Scale length: of the disk's exponential, or a of Plummer's sphere.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub length: f64,
    /// Height z0 of the disk over its scale length; its density is in proportion to sech²(z/z0).
    #[serde(default = "tenth")]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub thickness: f64,
    /// Toomre's Q: speeds at random, in units of those at which a disk just does not fall apart into lumps.
    #[serde(default = "stable")]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub toomre: f64,
    /// Dark matter round the stars of a disk; it is one mass more, the last one.
    #[serde(default)]
    pub halo: Option<Halo>,
    /// Where its centre starts.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// How fast its centre starts.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: [f64; 3],
    /// Turned about x, y and z, in this order; a disk lies in the plane of x and y before.
    #[serde(default)]
    #[schemars(extend("x-unit" = "degree"))]
    pub rotate: [f64; 3],
    /// Turns clockwise as seen from above, before `rotate`.
    #[serde(default)]
    pub clockwise: bool,
    /// Radius of a star in pictures.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// How much of the way behind each is drawn in pictures.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub trail: f64,
    /// Red, green and blue in pictures, 0 to 1, in linear light (a half is sRGB's 188 of 255).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// How the stars of a galaxy lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Profile {
    /// A disk whose density falls exponentially, turning almost in circles.
    #[default]
    Disk,
    /// Plummer's sphere in equilibrium.
    Plummer,
}

/// A halo: a mass that is spread out as Plummer's sphere, and moves as one body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Halo {
    /// Its mass.
    #[schemars(extend("x-unit" = "kg", "exclusiveMinimum" = 0.0))]
    pub mass: f64,
    /// Its radius b: 35 % of the mass are within.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
}

/// A chain of masses between two points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rope {
    /// Name in frames.
    pub name: String,
    /// System that moves it; without it, the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// Where it starts.
    #[schemars(extend("x-unit" = "m"))]
    pub from: [f64; 3],
    /// Where it ends.
    #[schemars(extend("x-unit" = "m"))]
    pub to: [f64; 3],
    /// Rest length; without it, the distance between the ends. A longer rope starts as a circular arc hanging down.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub length: Option<f64>,
    /// Straight pieces; there is one mass more.
    #[schemars(range(min = 1, max = 1_000_000_000))]
    pub segments: u32,
    /// Mass per length.
    #[serde(default = "tenth")]
    #[schemars(extend("x-unit" = "kg/m", "exclusiveMinimum" = 0.0))]
    pub density: f64,
    /// Spring families, modulus in N: `structural` between neighbours, `bend` between next-nearest ones. Not with `rod`.
    /// Without it, structural 1000.
    #[serde(default)]
    pub links: Option<Links>,
    /// Makes it a rod with orientation frames, which bends and twists.
    #[serde(default)]
    pub rod: Option<Rod>,
    /// Masses that stay where they are: `"start"`, `"end"`, `"vertex 3"`. A pinned end of a rod is clamped.
    #[serde(default)]
    pub pin: Vec<Pin>,
    /// Radius in pictures.
    #[serde(default = "centimetre")]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// Red, green and blue in pictures, 0 to 1, in linear light (a half is sRGB's 188 of 255).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// Elastic moduli of a rod.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rod {
    /// Stretching stiffness E A.
    #[schemars(extend("x-unit" = "N", "exclusiveMinimum" = 0.0))]
    pub stretch: f64,
    /// Shearing stiffness k G A; without it, that of stretching.
    #[serde(default)]
    #[schemars(extend("x-unit" = "N", "exclusiveMinimum" = 0.0))]
    pub shear: Option<f64>,
    /// Bending stiffness E I.
    #[schemars(range(min = 0.0), extend("x-unit" = "N m²"))]
    pub bend: f64,
    /// Bending stiffness towards `side`, as of a flat strip in its own plane; without it, `bend` in all directions.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m²"))]
    pub bend_side: Option<f64>,
    /// Direction in which `bend_side` resists: the width of a flat strip at its start, made perpendicular to the rod. Without it, horizontal, so
    /// that a strip lies flat, and along y where the rod starts vertically.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1"))]
    pub side: Option<[f64; 3]>,
    /// Twisting stiffness G J; without it, that of bending.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m²"))]
    pub twist: Option<f64>,
    /// Rotational inertia per length, the same about every axis; without it, that of a round wire of the picture radius.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg m", "exclusiveMinimum" = 0.0))]
    pub inertia: Option<f64>,
    /// Damping of all, as a time: damping = time x stiffness.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub damping: f64,
    /// A segment breaks for good when its length is off by more than this share; only in position-based systems.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub break_strain: Option<f64>,
}

/// A rectangle of masses and links.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sheet {
    /// Name in frames.
    pub name: String,
    /// System that moves it; without it, the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// Lengths of its sides.
    #[schemars(transform = items_above_zero, extend("x-unit" = "m"))]
    pub size: [f64; 2],
    /// Masses along each side.
    #[schemars(inner(range(min = 2, max = 1_000_000_000)))]
    pub resolution: [u32; 2],
    /// Its middle.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// Turn about x, then y, then z, from lying flat in the plane z = 0.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
    /// Mass per area. Without it, that of the fabric, or 0.2.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m²", "exclusiveMinimum" = 0.0))]
    pub density: Option<f64>,
    /// Spring families, modulus in N/m. Without it, structural 500, shear 200 and bend 10.
    #[serde(default)]
    pub links: Option<Links>,
    /// Dihedral bending stiffness between neighbouring triangles.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m"))]
    pub hinge: f64,
    /// The same beside it as of a plate, alike in all directions; quadratic in the positions and cheaper than hinges, and exact where nothing is
    /// stretched.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m"))]
    pub isometric: f64,
    /// Resistance against stretch as of a woven membrane; links are then left out unless they are given.
    #[serde(default)]
    pub membrane: Option<Membrane>,
    /// Measured fabric, by the name of a shipped one or the path of its record: stretch, bending and, unless given, density. Links are then left
    /// out unless they are given.
    #[serde(default)]
    pub fabric: Option<FabricWords>,
    /// How it tears; without it, it does not.
    #[serde(default)]
    pub tear: Option<Tear>,
    /// Stiffness of each triangle against changes of its area: tension over relative change.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N/m"))]
    pub area: f64,
    /// Masses that stay where they are: `"corner 0 0"`, `"vertex 3 4"`, `"edge x-"`.
    #[serde(default)]
    pub pin: Vec<Pin>,
    /// Red, green and blue in pictures, 0 to 1, in linear light (a half is sRGB's 188 of 255).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// A box of masses and links, or of tetrahedra.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// Name in frames.
    pub name: String,
    /// System that moves it; without it, the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// Lengths of its edges.
    #[schemars(transform = items_above_zero, extend("x-unit" = "m"))]
    pub size: [f64; 3],
    /// Masses along each edge.
    #[schemars(inner(range(min = 2, max = 1_000_000_000)))]
    pub resolution: [u32; 3],
    /// Its middle.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// Turn about x, then y, then z.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
    /// Mass per volume.
    #[serde(default = "thousand")]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub density: f64,
    /// Spring families, modulus in Pa. Not with `material`.
    #[serde(default)]
    pub links: Option<Links>,
    /// Fills it with elastic tetrahedra.
    #[serde(default)]
    pub material: Option<Material>,
    /// Keeps the whole in shape. Position-based dynamics only.
    #[serde(default)]
    pub shape_matching: Option<ShapeMatching>,
    /// Masses that stay where they are: `"corner 0 0 0"`, `"vertex 1 2 3"`, `"face z-"`.
    #[serde(default)]
    pub pin: Vec<Pin>,
    /// Red, green and blue in pictures, 0 to 1, in linear light (a half is sRGB's 188 of 255).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// A stable Neo-Hookean solid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Young's modulus.
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0.0))]
    pub young: f64,
    /// Poisson's ratio.
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0, "exclusiveMaximum" = 0.5))]
    pub poisson: f64,
    /// Damping as a time: damping = time x stiffness.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub damping: f64,
}

/// Masses at the vertices of a mesh, springs along its edges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Net {
    /// Name in frames.
    pub name: String,
    /// System that moves it; without it, the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// The mesh.
    pub mesh: MeshFile,
    /// The texture coordinates of the mesh are the flat pattern that it is made from: where nothing is strained, and the direction of the warp,
    /// along u. Without it, nothing is strained at the start.
    #[serde(default)]
    pub pattern: Option<Pattern>,
    /// Mass per area. Without it, that of the fabric, or 0.2.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m²", "exclusiveMinimum" = 0.0))]
    pub density: Option<f64>,
    /// Spring families, modulus in N/m: `structural` along edges, `bend` across them. Without it, structural 500 and bend 10.
    #[serde(default)]
    pub links: Option<Links>,
    /// Dihedral bending stiffness between neighbouring triangles.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m"))]
    pub hinge: f64,
    /// The same beside it, quadratic in the positions and flat at rest, whatever the shape of the mesh: cheaper than a hinge, and equal to it where
    /// nothing is stretched.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m"))]
    pub isometric: f64,
    /// Resistance against stretch as of a woven membrane; links are then left out unless they are given.
    #[serde(default)]
    pub membrane: Option<Membrane>,
    /// Measured fabric, by the name of a shipped one or the path of its record: stretch, bending and, unless given, density. Links are then left
    /// out unless they are given.
    #[serde(default)]
    pub fabric: Option<FabricWords>,
    /// How it tears; without it, it does not.
    #[serde(default)]
    pub tear: Option<Tear>,
    /// Stiffness of each triangle against changes of its area: tension over relative change.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N/m"))]
    pub area: f64,
    /// Volume and pressure of what it encloses; the mesh must be closed. Position-based dynamics only.
    #[serde(default)]
    pub pressure: Option<Inflation>,
    /// Keeps the whole in shape; links are then left out unless they are given. Position-based dynamics only.
    #[serde(default)]
    pub shape_matching: Option<ShapeMatching>,
    /// Masses that stay where they are: `"vertex 3"`, or all within a radius of a point.
    #[serde(default)]
    pub pin: Vec<Pin>,
    /// Red, green and blue in pictures, 0 to 1, in linear light (a half is sRGB's 188 of 255).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// Texture coordinates as flat panels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pattern {
    /// Length of one unit of texture coordinates.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub scale: f64,
}

/// Families of links. A family that is left out is not there.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Links {
    /// Between nearest neighbours.
    pub structural: Option<Link>,
    /// Along diagonals.
    pub shear: Option<Link>,
    /// Between next-nearest neighbours (skip one); a fiftieth of the structural modulus is a good start.
    pub bend: Option<Link>,
    /// One diagonal of each cell, or both.
    pub diagonals: Diagonals,
}

/// Which diagonals the shear family has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Diagonals {
    /// One of each cell: stiffer one way than the other.
    One,
    /// Both.
    #[default]
    Both,
}

/// A link family: its modulus alone, or all its settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Link {
    /// Modulus: N for a rope, N/m for a sheet, Pa for a block.
    Modulus(#[schemars(range(min = 0.0), extend("x-unit" = "N, N/m or Pa"))] f64),
    /// All settings.
    Settings(LinkSettings),
}

impl Link {
    /// All settings, defaults filled in.
    pub fn settings(&self) -> LinkSettings {
        match self {
            Self::Modulus(modulus) => LinkSettings { modulus: *modulus, ..LinkSettings::default() },
            Self::Settings(settings) => settings.clone(),
        }
    }
}

/// Settings of a link family.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinkSettings {
    /// Elastic modulus: N for a rope, N/m for a sheet, Pa for a block.
    #[schemars(range(min = 0.0), extend("x-unit" = "N, N/m or Pa"))]
    pub modulus: f64,
    /// Internal damping along the link: N s for a rope, N s/m for a sheet, Pa s for a block.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "modulus x s"))]
    pub damping: f64,
    /// Stiffening: force k_s r (1 + hardening (r / l0)²) at the extension r.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub hardening: f64,
    /// Pulls but does not push, like a thread.
    #[serde(default)]
    pub tension_only: bool,
    /// Breaks for good when |r| / l0 exceeds this.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub break_strain: Option<f64>,
}

/// Masses that stay where they are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Pin {
    /// In words: `"all"`, `"start"`, `"corner 0 1"`, `"vertex 3 4"`, `"edge x-"`, `"face z+"`.
    Words(String),
    /// All within a radius of a point, or in words with what they follow.
    Region(Region),
}

/// What pinned masses follow, as if they were part of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Follow {
    /// Name of a collider.
    pub collider: String,
    /// Which of its bones: one of a mannequin, or the name of a joint in the file of a character. Without it, the nearest place of
    /// a surface that moves by itself, or else the collider as a rigid whole.
    #[serde(default)]
    pub bone: Option<String>,
}

/// All masses within a radius of a point at the start, or those that words name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// The point.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub center: Option<[f64; 3]>,
    /// The radius.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: Option<f64>,
    /// The words instead of a point and a radius: `"edge y+"`.
    #[serde(default)]
    pub which: Option<String>,
    /// What they follow; without it, they stay where they are.
    #[serde(default)]
    pub follow: Option<Follow>,
}

pub(super) fn rope_links() -> Links {
    Links { structural: Some(Link::Settings(LinkSettings { modulus: 1000.0, ..LinkSettings::default() })), ..Links::default() }
}

pub(super) fn sheet_links() -> Links {
    let family = |modulus| Some(Link::Settings(LinkSettings { modulus, ..LinkSettings::default() }));
    Links { structural: family(500.0), shear: family(200.0), bend: family(10.0), diagonals: Diagonals::Both }
}

pub(super) fn net_links() -> Links {
    Links { shear: None, ..sheet_links() }
}

fn one_each() -> Vec<f64> {
    vec![1.0]
}

fn centimetre() -> f64 {
    0.01
}

fn tenth() -> f64 {
    0.1
}

fn thousand() -> f64 {
    1000.0
}

fn many() -> u32 {
    16_384
}

fn stable() -> f64 {
    1.5
}
