//! Compressible gases.

use super::animated::{AnimatedVector, Component};
use super::grids::GridBox;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A compressible gas in a box: p = sound_speed² (rho - density).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Compressible {
    /// Name in frames and pictures.
    pub name: String,
    /// The `compressible` system that steps it. Default: the first one.
    #[serde(default)]
    pub system: Option<String>,
    /// Box and cells.
    #[serde(rename = "box")]
    pub grid: GridBox,
    /// Speed of sound.
    #[schemars(extend("x-unit" = "m/s", "exclusiveMinimum" = 0.0))]
    pub sound_speed: f64,
    /// Density at zero pressure.
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub density: f64,
    /// Dynamic viscosity.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "Pa s"))]
    pub viscosity: f64,
    /// Initial density, a number or a formula of x, y, z. Default: `density`.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m³"))]
    pub initial_density: Option<Component>,
    /// Initial velocity; may be a formula of x, y, z.
    #[serde(default = "rest")]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: AnimatedVector,
    /// Periodic axes; all other sides are frictionless walls.
    #[serde(default)]
    pub periodic: [bool; 3],
}

fn rest() -> AnimatedVector {
    [0.0; 3].into()
}
