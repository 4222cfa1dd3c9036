//! Flocks by Vicsek's model.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Vicsek's model, in a periodic square around the origin. Needs `dimension = 2`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Vicsek {
    /// Side of the periodic square.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub side: f64,
    /// Distance within which directions are averaged, at most half the side.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// Speed of all particles. Their velocities give the initial directions. Default: random directions.
    #[schemars(range(min = 0.0), extend("x-unit" = "m/s"))]
    pub speed: f64,
    /// Width of the noise interval around the mean direction; at 2 pi directions are completely random.
    #[schemars(range(min = 0.0), extend("x-unit" = "rad"))]
    pub noise: f64,
}
