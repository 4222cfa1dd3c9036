//! Forces, velocity fields and anchors.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A force on every mass of the `dynamics` systems, or of the objects in `on`, or between all of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Force {
    /// Viscous damping f = -k_d v.
    Drag {
        /// k_d, for each mass.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "N s/m"))]
        coefficient: f64,
        /// k_d per kilogram: independent of how finely an object is divided.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
        rate: f64,
        /// Names of objects; without it, all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// Attraction to a fixed point, f = -m gm d / |d|³.
    Attraction {
        /// The point.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Gravitational parameter G M.
        #[schemars(extend("x-unit" = "m³/s²"))]
        gm: f64,
        /// Names of objects; without it, all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// Newton's gravitation of every mass on every other of the same system, F = G m1 m2 / d².
    Gravitation {
        /// G.
        #[serde(default = "newton")]
        #[schemars(extend("x-unit" = "N m²/kg²"))]
        constant: f64,
        /// Softening length s: 1/d² becomes d/(d² + s²)^(3/2).
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
        softening: f64,
        /// Names of objects that pull each other; without it, all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// Coulomb's force between all charged masses of the same system, F = k q1 q2 / d²: like charges push each other.
    Electrostatics {
        /// k.
        #[serde(default = "coulomb")]
        #[schemars(extend("x-unit" = "N m²/C²"))]
        constant: f64,
        /// Softening length s: 1/d² becomes d/(d² + s²)^(3/2).
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
        softening: f64,
        /// Names of objects whose charges feel each other; without it, all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// A uniform acceleration beside the world's gravity.
    Acceleration {
        /// The acceleration.
        #[schemars(extend("x-unit" = "m/s²"))]
        value: [f64; 3],
        /// Names of objects; without it, all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
}

/// A velocity field; the fields of a scene add up.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Field {
    /// The same velocity everywhere.
    Uniform {
        /// The velocity.
        #[schemars(extend("x-unit" = "m/s"))]
        velocity: [f64; 3],
    },
    /// Turning about an axis: u = rate axis x (x - center). Exact paths are circles.
    Swirl {
        /// A point of the axis.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Direction of the axis, of any length.
        #[serde(default = "up")]
        axis: [f64; 3],
        /// Angular velocity.
        #[schemars(extend("x-unit" = "rad/s"))]
        rate: f64,
    },
    /// Flow into a point: u = -rate (x - center). Exact paths decay without passing the centre.
    Sink {
        /// The point.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Decay rate; negative makes a source.
        #[schemars(extend("x-unit" = "1/s"))]
        rate: f64,
    },
}

/// A spring between two masses of any objects, also of different systems.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Anchor {
    /// Name in reports.
    pub name: String,
    /// The two masses, as `"object index"`.
    pub between: [String; 2],
    /// Spring constant.
    #[schemars(range(min = 0.0), extend("x-unit" = "N/m"))]
    pub stiffness: f64,
    /// Damping along the spring.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N s/m"))]
    pub damping: f64,
    /// Rest length; without it, the distance at the start.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
    pub rest_length: Option<f64>,
}

fn coulomb() -> f64 {
    8.987_551_792_3e9
}

fn newton() -> f64 {
    6.67428e-11
}

fn up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}
