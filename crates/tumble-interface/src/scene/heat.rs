//! Bodies that conduct heat.

use super::animated::{Animated, Component};
use super::grids::GridBox;
use super::shapes::Shape;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A body in a box that conducts heat: density c T' = div(k grad T) + sources.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Heat {
    /// Name in frames and pictures.
    pub name: String,
    /// The `heat` system that steps it. Default: the first one.
    #[serde(default)]
    pub system: Option<String>,
    /// Box and cells.
    #[serde(rename = "box")]
    pub grid: GridBox,
    /// Conductivity k.
    #[schemars(extend("x-unit" = "W/(m K)", "exclusiveMinimum" = 0.0))]
    pub conductivity: f64,
    /// Density.
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub density: f64,
    /// Specific heat capacity c.
    #[schemars(extend("x-unit" = "J/(kg K)", "exclusiveMinimum" = 0.0))]
    pub heat_capacity: f64,
    /// Initial temperature, a number or a formula of x, y, z.
    #[schemars(extend("x-unit" = "K"))]
    pub temperature: Component,
    /// Time integration scheme.
    #[serde(default)]
    pub scheme: HeatScheme,
    /// Boundary conditions. A side that is not given is insulated.
    #[serde(default)]
    pub sides: HeatSides,
    /// Periodic axes.
    #[serde(default)]
    pub periodic: [bool; 3],
    /// Regions of other materials, or holes; where they overlap the last one applies.
    #[serde(default)]
    pub region: Vec<HeatRegion>,
    /// Heat sources.
    #[serde(default)]
    pub source: Vec<HeatSource>,
    /// Residual at which the linear solver of the implicit schemes stops, relative to the initial one. Default: 1e-5 (single), 1e-11 (double).
    #[serde(default)]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0))]
    pub tolerance: Option<f64>,
}

/// Time integration scheme of the diffusion equation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HeatScheme {
    /// Forward Euler. Order 1; steps are at most dx²/(2 d kappa), with kappa = k/(density c) in d dimensions: longer ones are an error, and 0.7 of
    /// this limit is the default without `substeps` and `step`.
    Explicit,
    /// Backward Euler. Order 1; stable for every step, without new extrema.
    #[default]
    Implicit,
    /// Crank-Nicolson (trapezoidal rule). Order 2; stable for every step, but with large steps jumps oscillate for long.
    Trapezoid,
    /// Cosine series: exact in time, and in space for resolved modes. For insulated boxes of one material whose cell counts are products of 2, 3 and
    /// 5.
    Spectral,
}

/// Boundary conditions of a box.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HeatSides {
    /// The side of the smallest x.
    pub x_low: Option<HeatSide>,
    /// The side of the largest x.
    pub x_high: Option<HeatSide>,
    /// The side of the smallest y.
    pub y_low: Option<HeatSide>,
    /// The side of the largest y.
    pub y_high: Option<HeatSide>,
    /// The side of the smallest z.
    pub z_low: Option<HeatSide>,
    /// The side of the largest z.
    pub z_high: Option<HeatSide>,
}

impl HeatSides {
    /// The sides with their keys.
    pub fn all(&self) -> [(&'static str, &Option<HeatSide>); 6] {
        [
            ("x_low", &self.x_low),
            ("x_high", &self.x_high),
            ("y_low", &self.y_low),
            ("y_high", &self.y_high),
            ("z_low", &self.z_low),
            ("z_high", &self.z_high),
        ]
    }
}

/// Boundary condition: `{ temperature = 300 }` fixes the temperature, `{ flux = 100 }` supplies heat, and `{ temperature = 300, coefficient = 10 }`
/// cools by a fluid, optionally with an additional flux.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HeatSide {
    /// Temperature of the surface or, with a coefficient, of the adjacent fluid.
    #[schemars(extend("x-unit" = "K"))]
    pub temperature: Option<Animated>,
    /// Heat transfer coefficient of the adjacent fluid.
    #[schemars(extend("x-unit" = "W/(m² K)", "exclusiveMinimum" = 0.0))]
    pub coefficient: Option<f64>,
    /// Heat that enters through the surface.
    #[schemars(extend("x-unit" = "W/m²"))]
    pub flux: Option<Animated>,
}

/// A region of another material, or a hole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeatRegion {
    /// Shape of the region: it contains the cells whose centres are inside. Not a mesh.
    pub shape: Shape,
    /// Conductivity. Default: that of the body.
    #[serde(default)]
    #[schemars(extend("x-unit" = "W/(m K)", "exclusiveMinimum" = 0.0))]
    pub conductivity: Option<f64>,
    /// Density. Default: that of the body.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub density: Option<f64>,
    /// Specific heat capacity. Default: that of the body.
    #[serde(default)]
    #[schemars(extend("x-unit" = "J/(kg K)", "exclusiveMinimum" = 0.0))]
    pub heat_capacity: Option<f64>,
    /// Initial temperature, a number or a formula of x, y, z. Default: that of the body.
    #[serde(default)]
    #[schemars(extend("x-unit" = "K"))]
    pub temperature: Option<Component>,
    /// Makes the region a hole in the body, with this boundary condition on its surface; `{}` insulates.
    #[serde(default)]
    pub hole: Option<HeatSide>,
}

/// A heat source in a body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeatSource {
    /// Shape of the source: it contains the cells whose centres are inside. Not a mesh. Default: all cells.
    #[serde(default)]
    pub shape: Option<Shape>,
    /// Power per volume.
    #[schemars(extend("x-unit" = "W/m³"))]
    pub power: Animated,
    /// Spatial factor on the power: a formula of x, y, z.
    #[serde(default = "everywhere")]
    #[schemars(extend("x-unit" = "1"))]
    pub profile: Component,
}

fn everywhere() -> Component {
    Component::Value(1.0)
}
