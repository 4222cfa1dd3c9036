//! Values that change in time: a constant, a formula, or keyframes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A number that may change in time: `1.5`, `"0.2*sin(t)"` or `{ keys = [[0, 1], [2, 3]] }`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Animated {
    /// A constant.
    Value(f64),
    /// A formula.
    Formula(#[schemars(extend("x-meaning" = "a formula"))] String),
    /// Keyframes.
    Keys(Keys),
}

/// A vector that may change in time: `[1, 0, "sin(t)"]`, `"[1, 0, sin(t)]"` or `{ keys = [[0, 1, 0, 0], [2, 3, 0, 0]] }`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum AnimatedVector {
    /// Component by component.
    Components([Component; 3]),
    /// A formula of three components.
    Formula(#[schemars(extend("x-meaning" = "a formula"))] String),
    /// Keyframes.
    Keys(VectorKeys),
}

/// A number, or a formula that gives one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Component {
    /// A constant.
    Value(f64),
    /// A formula.
    Formula(#[schemars(extend("x-meaning" = "a formula"))] String),
}

/// Values at given times; constant before the first and after the last.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-meaning" = "keyframes"))]
pub struct Keys {
    /// Pairs of time and value; times must increase.
    #[schemars(length(min = 1), extend("x-unit" = "s, then the unit of the value"))]
    pub keys: Vec<[f64; 2]>,
    /// Interpolation between the keys.
    #[serde(default)]
    pub interpolation: Interpolation,
}

/// Vectors at given times; constant before the first and after the last.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-meaning" = "keyframes"))]
pub struct VectorKeys {
    /// Time, then three components; times must increase.
    #[schemars(length(min = 1), extend("x-unit" = "s, then the unit of the value"))]
    pub keys: Vec<[f64; 4]>,
    /// Interpolation between the keys.
    #[serde(default)]
    pub interpolation: Interpolation,
}

/// Interpolation between keyframes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Piecewise linear.
    #[default]
    Linear,
    /// Piecewise cubic with continuous slope, without overshoot.
    Smooth,
    /// The value of the previous key.
    Step,
}

impl From<f64> for Animated {
    fn from(value: f64) -> Self {
        Self::Value(value)
    }
}

impl From<[f64; 3]> for AnimatedVector {
    fn from(value: [f64; 3]) -> Self {
        Self::Components(value.map(Component::Value))
    }
}

impl Animated {
    /// The value, if it never changes.
    pub fn constant(&self) -> Option<f64> {
        if let Self::Value(value) = self { Some(*value) } else { None }
    }
}

impl AnimatedVector {
    /// The vector, if no component is a formula and there are no keyframes.
    pub fn constant(&self) -> Option<[f64; 3]> {
        match self {
            Self::Components([Component::Value(x), Component::Value(y), Component::Value(z)]) => Some([*x, *y, *z]),
            _ => None,
        }
    }
}
