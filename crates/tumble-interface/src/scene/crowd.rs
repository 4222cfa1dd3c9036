//! Crowds, and the plans of the floors on which they walk.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The plan of a floor at z = 0, on which people of a `crowd` walk. A scene with a crowd has one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Name in frames and pictures.
    pub name: String,
    /// The system that it belongs to. Default: the first of method `crowd`.
    #[serde(default)]
    pub system: Option<String>,
    /// Metres in a unit of its coordinates: 0.001 for a plan in millimetres. Holds for walls, doors and exits.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub scale: f64,
    /// Walls, each a line through points x, y; a wall that ends where it begins is an outline. Walls have no thickness; bodies keep off them by their
    /// radius.
    #[schemars(extend("x-unit" = "m"))]
    pub walls: Vec<Vec<[f64; 2]>>,
    /// Lines across openings, where crossings are counted.
    #[serde(default)]
    pub door: Vec<Gate>,
    /// Lines that people leave by.
    #[serde(default)]
    pub exit: Vec<Gate>,
    /// Red, green and blue of walls in pictures, 0 to 1, in linear light.
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// A line from one jamb of an opening to the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gate {
    /// Name, of which a plan has each once.
    pub name: String,
    /// One jamb, x and y.
    #[schemars(extend("x-unit" = "m"))]
    pub from: [f64; 2],
    /// The other.
    #[schemars(extend("x-unit" = "m"))]
    pub to: [f64; 2],
}

/// People who walk to an exit and leave, moved by systems of method `crowd`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Crowd {
    /// Name in frames and pictures.
    pub name: String,
    /// The system that moves them. Default: the first of method `crowd`.
    #[serde(default)]
    pub system: Option<String>,
    /// Where they are at the start: two corners of a rectangle, or the corners of a polygon, x and y.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub area: Vec<[f64; 2]>,
    /// How many there are. Alternatives: `density`, `position`.
    #[serde(default)]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub count: Option<u32>,
    /// How many there are on an area.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1/m²", "exclusiveMinimum" = 0.0))]
    pub density: Option<f64>,
    /// Initial positions, x and y, instead of an area.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub position: Vec<[f64; 2]>,
    /// Names of exits that they may take; they take the nearest, by the length of the way. Default: all.
    #[serde(default)]
    pub exit: Vec<String>,
    /// Radius of a body; the mean if they differ. Bodies never overlap.
    #[serde(default = "radius")]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.05, "maximum" = 1.0))]
    pub radius: f64,
    /// How far radii differ from that, at most, as a part of it: they are uniformly distributed.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.5), extend("x-unit" = "1"))]
    pub radius_spread: f64,
    /// Mean desired speed.
    #[serde(default = "speed")]
    #[schemars(extend("x-unit" = "m/s", "exclusiveMinimum" = 0.0, "maximum" = 10.0))]
    pub speed: f64,
    /// Standard deviation of desired speeds, which are normally distributed, cut at two of it and at a tenth of the mean.
    #[serde(default = "deviation")]
    #[schemars(range(min = 0.0), extend("x-unit" = "m/s"))]
    pub speed_deviation: f64,
    /// When the first of them may start.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub reaction: f64,
    /// How much later the last may: reaction times are uniformly distributed.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub reaction_spread: f64,
    /// How long people leave a trail behind them in pictures.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub trail: f64,
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

impl Crowd {
    /// The corners of its area; of a rectangle all four.
    pub fn polygon(&self) -> Vec<[f64; 2]> {
        match self.area[..] {
            [[a, b], [c, d]] => vec![[a, b], [c, b], [c, d], [a, d]],
            _ => self.area.clone(),
        }
    }

    /// Area of that polygon [m²].
    pub fn floor(&self) -> f64 {
        let p = self.polygon();
        let turn = |i: usize| p[i][0] * p[(i + 1) % p.len()][1] - p[i][1] * p[(i + 1) % p.len()][0];
        0.5 * (0..p.len()).map(turn).sum::<f64>().abs()
    }

    /// How many people there are.
    pub fn people(&self) -> f64 {
        let by_density = self.density.map_or(0.0, |density| (density * self.floor()).round());
        self.position.len() as f64 + self.count.map_or(by_density, f64::from)
    }
}

/// Settings of the `crowd` method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Walking {
    /// Time gap that people keep to who is ahead: the slope of distance over speed.
    #[schemars(range(min = 0.1, max = 10.0), extend("x-unit" = "s"))]
    pub time_gap: f64,
    /// Distance between bodies at which people stand.
    #[schemars(range(min = 0.0, max = 2.0), extend("x-unit" = "m"))]
    pub buffer: f64,
}

impl Default for Walking {
    fn default() -> Self {
        Self { time_gap: 0.65, buffer: 0.04 }
    }
}

fn one() -> f64 {
    1.0
}

fn radius() -> f64 {
    0.18
}

fn speed() -> f64 {
    1.34
}

fn deviation() -> f64 {
    0.26
}
