//! Values that change in time: a constant, a formula, or keyframes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A number that may change in time: `1.5`, `"0.2*sin(t)"` or `{ keys = [[0, 1], [2, 3]] }`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Animated {
    /// The same at all times.
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
    /// The same at all times.
    Value(f64),
    /// A formula.
    Formula(#[schemars(extend("x-meaning" = "a formula"))] String),
}

/// Values at some times; the first holds before them, the last after them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-meaning" = "keyframes"))]
pub struct Keys {
    /// Pairs of a time and the value there; times ascend.
    #[schemars(length(min = 1), extend("x-unit" = "s, then the unit of the value"))]
    pub keys: Vec<[f64; 2]>,
    /// What lies between them.
    #[serde(default)]
    pub interpolation: Interpolation,
}

/// Vectors at some times; the first holds before them, the last after them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-meaning" = "keyframes"))]
pub struct VectorKeys {
    /// A time, then the three components there; times ascend.
    #[schemars(length(min = 1), extend("x-unit" = "s, then the unit of the value"))]
    pub keys: Vec<[f64; 4]>,
    /// What lies between them.
    #[serde(default)]
    pub interpolation: Interpolation,
}

/// What lies between keyframes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Straight lines.
    #[default]
    Linear,
    /// Cubics that meet with the same slope and never overshoot a key.
    Smooth,
    /// The value of the last key.
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
