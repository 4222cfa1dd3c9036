//! Hair: strands that are planted on a surface.

use super::MeshFile;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Strands planted on a surface, each a rod that is clamped at its root. They are at rest as they are groomed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hair {
    /// Name in frames; with the scene's seed, the key of its random numbers.
    pub name: String,
    /// System that moves it; without it, the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// Collider on whose surface it grows, and with which its roots move. This or `mesh`.
    #[serde(default)]
    pub on: Option<String>,
    /// Which bone carries the roots, where `on` is a mannequin or a character: hair on its head, with `above`, follows `head`. Without it,
    /// each root follows its place on the surface.
    #[serde(default)]
    pub bone: Option<String>,
    /// Mesh on which it grows; its roots stay. This or `on`.
    #[serde(default)]
    pub mesh: Option<MeshFile>,
    /// Count of strands. This or `per_area`.
    #[serde(default)]
    #[schemars(range(min = 1, max = 10_000_000))]
    pub count: Option<u32>,
    /// Strands per area. This or `count`.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1/m²", "exclusiveMinimum" = 0.0))]
    pub per_area: Option<f64>,
    /// Only where a root is above this height.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub above: Option<f64>,
    /// Length of a strand.
    #[schemars(range(min = 1e-6, max = 1000.0), extend("x-unit" = "m"))]
    pub length: f64,
    /// By what share of it a strand may be shorter, at random.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.95), extend("x-unit" = "1"))]
    pub spread: f64,
    /// Straight pieces of a strand; there is one mass more.
    #[serde(default = "sixteen")]
    #[schemars(range(min = 1, max = 10_000))]
    pub segments: u32,
    /// Added to the normal of the surface, which has length 1, for the direction in which strands grow.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1"))]
    pub lean: [f64; 3],
    /// Turns strands into spirals.
    #[serde(default)]
    pub curl: Option<Curl>,
    /// Draws strands together.
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
    /// How strands act on each other; without it, they do not.
    #[serde(default)]
    pub collisions: Option<HairCollisions>,
    /// Strands in pictures and exports for each one that is simulated, between its nearest neighbours.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 1000))]
    pub render: u32,
    /// Red, green and blue in pictures, 0 to 1, in linear light (a half is sRGB's 188 of 255).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// The spiral that a strand is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Curl {
    /// Radius of the spiral.
    #[schemars(range(min = 1e-6, max = 1000.0), extend("x-unit" = "m"))]
    pub radius: f64,
    /// Height of a turn; 0 is a ring.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
    pub pitch: f64,
}

/// Strands that are drawn together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Clump {
    /// Count of clumps: the first strands are their middles.
    #[schemars(range(min = 1, max = 10_000_000))]
    pub count: u32,
    /// Share of the way to the middle that the tips are drawn; the root is not.
    #[serde(default = "half")]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub strength: f64,
}

/// Strands as a continuum: their mass and velocity on a grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HairCollisions {
    /// Spacing of the grid.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub cell: f64,
    /// Rate at which velocities go over to those of the hair around.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
    pub friction: f64,
    /// Pressure at twice the rest density: p = pressure (density/rest density - 1), none below. Sub-steps must be well below
    /// cell sqrt(rest density/pressure).
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "Pa"))]
    pub pressure: f64,
    /// Density of the hair, as mass per volume of the grid, above which it pushes; without it, the mean where hair is at the start.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub rest_density: Option<f64>,
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
