//! Boxes of cells, for the methods that work on grids.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A box of cubic cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridBox {
    /// Side lengths; in a 2D scene the one normal to the plane is ignored. Each is rounded to whole cells.
    #[schemars(inner(range(min = 1e-9)), extend("x-unit" = "m"))]
    pub size: [f64; 3],
    /// Centre.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// Cells along its longest side.
    #[schemars(range(min = 1, max = 1_048_576))]
    pub resolution: u32,
}
