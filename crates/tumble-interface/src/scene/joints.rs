//! Joints between rigid bodies.

use super::Animated;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Holds a rigid body to another one, or to the world.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Name in frames and reports.
    pub name: String,
    /// The system of its bodies. Default: the first of method `rigid`.
    #[serde(default)]
    pub system: Option<String>,
    /// The body and the one that it is held to, as `"object index"`; the index of a single body may be left out. One alone is held to the world.
    #[schemars(length(min = 1, max = 2))]
    pub between: Vec<String>,
    /// Instead of one joint, one between each body of the object in `between` and the next, which counts as the first of the two.
    #[serde(default)]
    pub chain: bool,
    /// What it leaves free.
    pub kind: JointKind,
    /// Where in the world it is at the start. Default: the centre of mass of the first body, of chains the middle between neighbours.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub at: Option<[f64; 3]>,
    /// Whether its two bodies touch each other, too.
    #[serde(default)]
    pub collide: bool,
    /// Force beyond which it breaks. A blow counts by its impulse over the sub-step.
    #[serde(default)]
    #[schemars(extend("x-unit" = "N", "exclusiveMinimum" = 0.0))]
    pub break_force: Option<f64>,
    /// Torque beyond which it breaks, about the point `at`; not of kinds that turn freely.
    #[serde(default)]
    #[schemars(extend("x-unit" = "N m", "exclusiveMinimum" = 0.0))]
    pub break_torque: Option<f64>,
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// What a joint leaves free.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum JointKind {
    /// Nothing.
    Fixed {},
    /// Every turn about a point.
    Ball {},
    /// Turns about an axis. The angle is 0 at the start, and grows by the right-hand rule as the first body turns against the second.
    Hinge {
        /// The axis at the start.
        axis: [f64; 3],
        /// The least and the greatest angle, from -3.1 to 3.1.
        #[serde(default)]
        #[schemars(extend("x-unit" = "rad"))]
        limits: Option<[f64; 2]>,
        /// What turns it.
        #[serde(default)]
        motor: Option<JointMotor>,
    },
    /// Sliding along an axis. The position is 0 at the start, and grows as the first body moves along the axis.
    Slider {
        /// The axis at the start.
        axis: [f64; 3],
        /// The least and the greatest position.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        limits: Option<[f64; 2]>,
        /// What moves it.
        #[serde(default)]
        motor: Option<JointMotor>,
    },
    /// Everything, up to a distance from the point `at` of the first body.
    Rope {
        /// The other end at the start, on the second body or the world. Default: the centre of mass of the second body.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        to: Option<[f64; 3]>,
        /// Its length. Default: the distance at the start.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        length: Option<f64>,
    },
    /// Everything; a spring pulls at the point `at` of the first body.
    Spring {
        /// The other end at the start, on the second body or the world. Default: the centre of mass of the second body.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        to: Option<[f64; 3]>,
        /// Spring constant.
        #[schemars(range(min = 0.0), extend("x-unit" = "N/m"))]
        stiffness: f64,
        /// Damping along it.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "N s/m"))]
        damping: f64,
        /// Rest length. Default: the distance at the start.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
        length: Option<f64>,
    },
}

/// What drives a hinge or a slider: a speed or a target.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum JointMotor {
    /// It keeps a speed.
    Speed {
        /// The speed; may change in time.
        #[schemars(extend("x-unit" = "rad/s or m/s"))]
        value: Animated,
        /// Its largest torque or force. Default: as much as it takes, though limits and ropes are stronger; contacts give way to it.
        #[serde(default)]
        #[schemars(extend("x-unit" = "N m or N", "exclusiveMinimum" = 0.0))]
        strength: Option<f64>,
    },
    /// It pulls to an angle or a position as a spring does.
    Target {
        /// The angle, from -3.1 to 3.1, or the position; may change in time.
        #[serde(default = "zero")]
        #[schemars(extend("x-unit" = "rad or m"))]
        value: Animated,
        /// Torque or force for each unit that it is off.
        #[schemars(range(min = 0.0), extend("x-unit" = "N m/rad or N/m"))]
        stiffness: f64,
        /// Torque or force for each unit of speed.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "N m s/rad or N s/m"))]
        damping: f64,
        /// Its largest torque or force. Default: as much as it takes.
        #[serde(default)]
        #[schemars(extend("x-unit" = "N m or N", "exclusiveMinimum" = 0.0))]
        strength: Option<f64>,
    },
}

fn zero() -> Animated {
    0.0.into()
}
