//! Hair: strands on a surface.

use super::MeshFile;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Strands on a surface, each a rod clamped at its root. The groomed shape is the rest shape.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hair {
    /// Name in frames; with the scene's seed, it determines the random numbers.
    pub name: String,
    /// System that moves it. Default: the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// Collider on which the hair grows and with which its roots move. Alternative: `mesh`; `guides` need neither.
    #[serde(default)]
    pub on: Option<String>,
    /// Bone that the roots follow, if `on` is a mannequin or a character: hair on its head, with `above`, follows `head`. Default: each root follows
    /// its point on the surface.
    #[serde(default)]
    pub bone: Option<String>,
    /// Mesh on which the hair grows; its roots are fixed. Alternative: `on`.
    #[serde(default)]
    pub mesh: Option<MeshFile>,
    /// Strands from a file of curves, a groom. Excludes what strands are otherwise made by: `count`, `per_area`, `above`, `length`, `spread`, `lean`,
    /// `curl` and `clump`.
    #[serde(default)]
    pub guides: Option<Guides>,
    /// Number of strands. Alternative: `per_area`.
    #[serde(default)]
    #[schemars(range(min = 1, max = 10_000_000))]
    pub count: Option<u32>,
    /// Strands per area. Alternative: `count`.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1/m²", "exclusiveMinimum" = 0.0))]
    pub per_area: Option<f64>,
    /// Minimum height of roots.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub above: Option<f64>,
    /// Length of a strand; needed without `guides`.
    #[serde(default)]
    #[schemars(range(min = 1e-6, max = 1000.0), extend("x-unit" = "m"))]
    pub length: Option<f64>,
    /// Largest fraction by which a strand is shortened at random.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.95), extend("x-unit" = "1"))]
    pub spread: f64,
    /// Segments per strand; there is one more mass.
    #[serde(default = "sixteen")]
    #[schemars(range(min = 1, max = 10_000))]
    pub segments: u32,
    /// Vector added to the unit normal of the surface to give the growth direction.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1"))]
    pub lean: [f64; 3],
    /// Curls strands into helices.
    #[serde(default)]
    pub curl: Option<Curl>,
    /// Gathers strands into clumps.
    #[serde(default)]
    pub clump: Option<Clump>,
    /// Radius of a strand.
    #[serde(default = "fifty_micrometres")]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// Mass per volume.
    #[serde(default = "keratin")]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub density: f64,
    /// Young's modulus.
    #[serde(default = "stiff")]
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0.0))]
    pub young: f64,
    /// Poisson's ratio.
    #[serde(default = "half_way")]
    #[schemars(range(min = 0.0, max = 0.5), extend("x-unit" = "1"))]
    pub poisson: f64,
    /// Damping as a time: damping = time x stiffness.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub damping: f64,
    /// Interaction between strands. Default: none.
    #[serde(default)]
    pub collisions: Option<HairCollisions>,
    /// Strands in pictures and exports per simulated strand, interpolated between nearest neighbours.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 1000))]
    pub render: u32,
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// Strands as they were groomed: curves of a file, the polylines (`l`) of an OBJ, or outside the browser the `BasisCurves` of USD; scaled, rotated,
/// then translated. Each is a strand that begins at its root. With `on`, they lie as on the collider before its motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Guides {
    /// File, relative to the scene file.
    pub path: String,
    /// Hash of the file's content. Default: any content is accepted.
    #[serde(default)]
    pub hash: Option<String>,
    /// Scale factor.
    #[serde(default = "single")]
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
}

/// The helix of a strand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Curl {
    /// Radius of the helix.
    #[schemars(range(min = 1e-6, max = 1000.0), extend("x-unit" = "m"))]
    pub radius: f64,
    /// Height of one turn; 0 is a ring.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
    pub pitch: f64,
}

/// Strands gathered into clumps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Clump {
    /// Number of clumps; the first strands are their centres.
    #[schemars(range(min = 1, max = 10_000_000))]
    pub count: u32,
    /// Fraction of the distance to the clump's centre by which tips are moved; roots stay.
    #[serde(default = "half")]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub strength: f64,
}

/// Strand interaction as a continuum: mass and velocity on a grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HairCollisions {
    /// Spacing of the grid.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub cell: f64,
    /// Rate at which velocities approach those of the surrounding hair.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
    pub friction: f64,
    /// Pressure at twice the rest density: p = pressure (density/rest density - 1), zero below rest density. Sub-steps must be well below cell
    /// sqrt(rest density/pressure).
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "Pa"))]
    pub pressure: f64,
    /// Hair density, as mass per volume of the grid, above which there is pressure. Default: the initial mean where there is hair.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub rest_density: Option<f64>,
}

fn single() -> f64 {
    1.0
}

fn one() -> u32 {
    1
}

fn sixteen() -> u32 {
    16
}

fn half() -> f64 {
    0.5
}

fn fifty_micrometres() -> f64 {
    5e-5
}

fn keratin() -> f64 {
    1300.0
}

fn stiff() -> f64 {
    3e9
}

fn half_way() -> f64 {
    0.45
}
