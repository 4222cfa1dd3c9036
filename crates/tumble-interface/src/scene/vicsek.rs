//! Flocks of the model of Vicsek.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The model of Vicsek, in a square around the origin that repeats itself. Needs `dimension = 2`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Vicsek {
    /// Side of the square. Who leaves it comes in at the other side.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub side: f64,
    /// Distance within which directions are averaged, at most half the side.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// Speed of all. Velocities of the particles give directions; without them directions are random.
    #[schemars(range(min = 0.0), extend("x-unit" = "m/s"))]
    pub speed: f64,
    /// Width of the interval of errors around the mean direction; 2 pi leaves nothing but chance.
    #[schemars(range(min = 0.0), extend("x-unit" = "rad"))]
    pub noise: f64,
}
