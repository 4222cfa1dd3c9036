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
    /// Molecules of Lennard-Jones: E = 4 epsilon ((sigma/r)^12 - (sigma/r)^6) for each pair.
    LennardJones {
        /// Depth of the well.
        #[schemars(range(min = 0.0), extend("x-unit" = "J"))]
        epsilon: f64,
        /// Distance at which the energy is zero.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        sigma: f64,
        /// Distance at which it ends, with zero energy; without it, 2.5 sigma.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        cutoff: Option<f64>,
        /// Whether the force, too, ends with zero; else it jumps there.
        #[serde(default = "yes")]
        smooth: bool,
        /// Names of objects; without it, all.
        #[serde(default)]
        on: Option<Vec<String>>,
        /// Names of objects that those of `on` feel, and which need not feel them; without it, those of `on` feel each other.
        #[serde(default)]
        from: Option<Vec<String>>,
    },
    /// Pushes masses apart that are closer than a distance, f = k (d - r)^p for each pair.
    Repulsion {
        /// k.
        #[schemars(range(min = 0.0), extend("x-unit" = "N/m^exponent"))]
        stiffness: f64,
        /// d.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        distance: f64,
        /// p.
        #[serde(default = "one")]
        #[schemars(range(min = 1, max = 4))]
        exponent: u8,
        /// Names of objects; without it, all.
        #[serde(default)]
        on: Option<Vec<String>>,
        /// Names of objects that those of `on` feel, and which need not feel them; without it, those of `on` feel each other.
        #[serde(default)]
        from: Option<Vec<String>>,
    },
    /// Pulls neighbours together: zero in the same place and from the radius on, largest at 0.45 of it.
    Cohesion {
        /// The largest force of a pair.
        #[schemars(range(min = 0.0), extend("x-unit" = "N"))]
        strength: f64,
        /// Distance up to which masses are neighbours.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
        /// Names of objects; without it, all.
        #[serde(default)]
        on: Option<Vec<String>>,
        /// Names of objects that those of `on` feel, and which need not feel them; without it, those of `on` feel each other.
        #[serde(default)]
        from: Option<Vec<String>>,
    },
    /// Friction between neighbours, f = c (1 - r²/R²)² (v2 - v1) for each pair.
    Viscosity {
        /// c.
        #[schemars(range(min = 0.0), extend("x-unit" = "N s/m"))]
        coefficient: f64,
        /// R.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
        /// Only along the line between the two, which keeps angular momentum, too.
        #[serde(default)]
        central: bool,
        /// Names of objects; without it, all.
        #[serde(default)]
        on: Option<Vec<String>>,
        /// Names of objects that those of `on` feel, and which need not feel them; without it, those of `on` feel each other.
        #[serde(default)]
        from: Option<Vec<String>>,
    },
    /// A flock: each steers by its neighbours, keeps a speed, seeks goals, shuns colliders and flees from predators.
    Flock {
        /// Distance up to which others are seen.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
        /// Heeds only so many, the nearest, as starlings do with 7; without it, all within the radius.
        #[serde(default)]
        #[schemars(range(min = 1, max = 1000))]
        nearest: Option<u32>,
        /// Field of view around the direction of motion; 360 sees all around.
        #[serde(default = "full_turn")]
        #[schemars(range(min = 1.0, max = 360.0), extend("x-unit" = "°"))]
        view: f64,
        /// Towards the centre of the neighbours, per metre of the way.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "1/s²"))]
        cohesion: f64,
        /// Rate at which the neighbours' velocity is taken up.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
        alignment: f64,
        /// Away from each neighbour that is closer than `spacing`.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m/s²"))]
        separation: f64,
        /// Distance that is kept; without it, half the radius.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        spacing: Option<f64>,
        /// Cruising speed; 0 drives nobody.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m/s"))]
        speed: f64,
        /// Rate at which the cruising speed is taken up.
        #[serde(default = "rate")]
        #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
        propulsion: f64,
        /// Bound of the acceleration; without it, none.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m/s²", "exclusiveMinimum" = 0.0))]
        max_acceleration: Option<f64>,
        /// Places that attract.
        #[serde(default)]
        goal: Vec<Goal>,
        /// Away from colliders that are closer than `clearance`; 0 shuns none.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m/s²"))]
        avoidance: f64,
        /// Distance that is kept from colliders; without it, the radius.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        clearance: Option<f64>,
        /// Names of objects that hunt the flock.
        #[serde(default)]
        predators: Vec<String>,
        /// Away from predators that are closer than `fear_radius`.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m/s²"))]
        fear: f64,
        /// Distance at which predators are noticed; without it, three times the radius.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        fear_radius: Option<f64>,
        /// Of predators, towards the prey.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m/s²"))]
        chase: f64,
        /// Cruising speed of predators; without it, that of the flock.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m/s"))]
        predator_speed: Option<f64>,
        /// Names of objects; without it, all but the predators.
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

/// A place that attracts a flock.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// The place.
    #[schemars(extend("x-unit" = "m"))]
    pub point: [f64; 3],
    /// Acceleration towards it from afar.
    #[schemars(extend("x-unit" = "m/s²"))]
    pub strength: f64,
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

fn newton() -> f64 {
    6.67428e-11
}

fn yes() -> bool {
    true
}

fn one() -> u8 {
    1
}

fn full_turn() -> f64 {
    360.0
}

fn rate() -> f64 {
    1.0
}

fn up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}
