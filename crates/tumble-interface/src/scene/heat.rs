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
    /// The `heat` system that steps it; without it, the first one.
    #[serde(default)]
    pub system: Option<String>,
    /// Its box and cells.
    #[serde(rename = "box")]
    pub grid: GridBox,
    /// Conductivity k.
    #[schemars(extend("x-unit" = "W/(m K)", "exclusiveMinimum" = 0.0))]
    pub conductivity: f64,
    /// Density.
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub density: f64,
    /// Heat capacity c of a mass.
    #[schemars(extend("x-unit" = "J/(kg K)", "exclusiveMinimum" = 0.0))]
    pub heat_capacity: f64,
    /// Temperature at the start: a number or a formula of x, y, z.
    #[schemars(extend("x-unit" = "K"))]
    pub temperature: Component,
    /// How time is stepped.
    #[serde(default)]
    pub scheme: HeatScheme,
    /// What is beyond its sides. A side without words is insulated.
    #[serde(default)]
    pub sides: HeatSides,
    /// Axes along which the last cell borders on the first.
    #[serde(default)]
    pub periodic: [bool; 3],
    /// Parts of other materials, or holes; of several at one place the last counts.
    #[serde(default)]
    pub region: Vec<HeatRegion>,
    /// Heat that arises inside.
    #[serde(default)]
    pub source: Vec<HeatSource>,
    /// Residual at which the linear solver of the implicit schemes stops, relative to the first. Default 1e-5 (single),
    /// 1e-11 (double).
    #[serde(default)]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0))]
    pub tolerance: Option<f64>,
}

/// How the diffusion equation is stepped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HeatScheme {
    /// Forward Euler. Order 1; no step longer than dx²/(2 d kappa), with kappa = k/(density c) in d dimensions: without
    /// `substeps` and `step` as many as 0.7 of that asks for, and a longer one is refused.
    Explicit,
    /// Backward Euler. Order 1; every step is stable and makes no new extremes.
    #[default]
    Implicit,
    /// Crank and Nicolson's trapezoid. Order 2; every step is stable, but jumps swing for long after large ones.
    Trapezoid,
    /// Cosine series: exact in time, and in space for what they can show. For insulated boxes of one material, whose
    /// counts of cells are products of 2, 3 and 5.
    Spectral,
}

/// What is beyond the sides of a box.
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
    /// The sides with their words.
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

/// What a surface borders on: `{ temperature = 300 }` holds it at a temperature, `{ flux = 100 }` lets heat in, and
/// `{ temperature = 300, coefficient = 10 }` cools it by a fluid, with a flux besides if there is one.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HeatSide {
    /// Temperature of the surface, or, with a coefficient, of what flows along it.
    #[schemars(extend("x-unit" = "K"))]
    pub temperature: Option<Animated>,
    /// Heat that passes from what flows along the surface, for each kelvin of difference.
    #[schemars(extend("x-unit" = "W/(m² K)", "exclusiveMinimum" = 0.0))]
    pub coefficient: Option<f64>,
    /// Heat that enters through the surface.
    #[schemars(extend("x-unit" = "W/m²"))]
    pub flux: Option<Animated>,
}

/// A part of another material, or a hole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeatRegion {
    /// The cells whose middle is in it; no mesh.
    pub shape: Shape,
    /// Conductivity, if another.
    #[serde(default)]
    #[schemars(extend("x-unit" = "W/(m K)", "exclusiveMinimum" = 0.0))]
    pub conductivity: Option<f64>,
    /// Density, if another.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub density: Option<f64>,
    /// Heat capacity of a mass, if another.
    #[serde(default)]
    #[schemars(extend("x-unit" = "J/(kg K)", "exclusiveMinimum" = 0.0))]
    pub heat_capacity: Option<f64>,
    /// Temperature at the start, if another: a number or a formula of x, y, z.
    #[serde(default)]
    #[schemars(extend("x-unit" = "K"))]
    pub temperature: Option<Component>,
    /// With it the region is a hole, no part of the body, and this is what the surface around it borders on; `{}`
    /// insulates.
    #[serde(default)]
    pub hole: Option<HeatSide>,
}

/// Heat that arises in a body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeatSource {
    /// The cells whose middle is in it, no mesh; without it, all.
    #[serde(default)]
    pub shape: Option<Shape>,
    /// Power of a volume.
    #[schemars(extend("x-unit" = "W/m³"))]
    pub power: Animated,
    /// What the power is multiplied by from place to place: a formula of x, y, z.
    #[serde(default = "everywhere")]
    #[schemars(extend("x-unit" = "1"))]
    pub profile: Component,
}

fn everywhere() -> Component {
    Component::Value(1.0)
}
