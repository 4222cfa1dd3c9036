//! Forces, velocity fields and anchors.

use super::{Animated, AnimatedVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A force on every mass of the `dynamics` systems, or of the objects in `on`, or between all of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Force {
    /// Viscous and quadratic damping f = -(k_d + c |v|) v.
    Drag {
        /// k_d of each mass; may change in time.
        #[serde(default = "nothing")]
        #[schemars(extend("x-unit" = "N s/m"))]
        coefficient: Animated,
        /// k_d per kilogram: independent of the resolution of an object.
        #[serde(default = "nothing")]
        #[schemars(extend("x-unit" = "1/s"))]
        rate: Animated,
        /// c, the coefficient of the squared speed.
        #[serde(default = "nothing")]
        #[schemars(extend("x-unit" = "kg/m"))]
        quadratic: Animated,
        /// Names of objects. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// Drag in moving air: f = -(k_d + c |v - u|) (v - u).
    Wind {
        /// k_d of each mass; may change in time.
        #[serde(default = "nothing")]
        #[schemars(extend("x-unit" = "N s/m"))]
        coefficient: Animated,
        /// k_d per kilogram.
        #[serde(default = "nothing")]
        #[schemars(extend("x-unit" = "1/s"))]
        rate: Animated,
        /// c, the coefficient of the squared relative speed.
        #[serde(default = "nothing")]
        #[schemars(extend("x-unit" = "kg/m"))]
        quadratic: Animated,
        /// Velocity fields of the air; they are summed.
        air: Vec<Field>,
        /// Names of objects. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// Air on the triangles of sheets, nets and cloth, and on the pieces of ropes and hair: drag along the relative velocity, lift normal to it, friction along the surface, F = rho/2 A
    /// (C_D |s| w + C_L (s |w| n - s²/|w| w) + C_F |w| (w - s n)), w = u - v, s = w . n.
    Air {
        /// rho.
        #[serde(default = "air_density")]
        #[schemars(range(min = 0.0), extend("x-unit" = "kg/m³"))]
        density: f64,
        /// C_D, for the projected area; of threads, for the length across the air times the diameter, twice the radius. Hair in a breeze has 5.
        /// In two dimensions, too, a thread is as wide as its diameter, where a `gas.sheet` is a metre wide.
        #[serde(default = "plate")]
        #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
        drag: f64,
        /// C_L: the lift is C_L sin a cos a at the angle of attack a. Equal to `drag`, it is that of a plate that deflects the air.
        #[serde(default = "plate")]
        #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
        lift: f64,
        /// C_F, for both faces together.
        #[serde(default = "skin")]
        #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
        friction: f64,
        /// Velocity fields of the air; they are summed. Default: air at rest.
        #[serde(default)]
        wind: Vec<Field>,
        /// Names of objects. Default: all that have triangles or are threads.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// Attraction to a point, f = -m gm d / r^(power + 1) with r² = |d|² + softening². A negative gm repels.
    Attraction {
        /// The point; may change in time.
        #[serde(default = "origin")]
        #[schemars(extend("x-unit" = "m"))]
        center: AnimatedVector,
        /// Strength: with power 2 the gravitational parameter G M; may change in time.
        #[schemars(extend("x-unit" = "m³/s²"))]
        gm: Animated,
        /// The force falls with this power of the distance: 2 gravity, 1 a line, 0 constant, -1 a spring. The unit of gm is m^(power + 1)/s².
        #[serde(default = "two")]
        #[schemars(range(min = -4.0, max = 12.0), extend("x-unit" = "1"))]
        power: f64,
        /// Softening length, which removes the singularity.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
        softening: f64,
        /// Distance at which the force has faded to zero. Default: unlimited.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: Option<f64>,
        /// Names of objects. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// Newton's gravitation between all masses of the same system, F = G m1 m2 / d².
    Gravitation {
        /// G.
        #[serde(default = "newton")]
        #[schemars(extend("x-unit" = "N m²/kg²"))]
        constant: f64,
        /// Softening length s: 1/d² becomes d/(d² + s²)^(3/2).
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
        softening: f64,
        /// Names of objects that attract each other. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// Lennard-Jones potential: E = 4 epsilon ((sigma/r)^12 - (sigma/r)^6) for each pair.
    LennardJones {
        /// Depth of the potential well.
        #[schemars(range(min = 0.0), extend("x-unit" = "J"))]
        epsilon: f64,
        /// Distance at which the energy is zero.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        sigma: f64,
        /// Cut-off distance, with zero energy. Default: 2.5 sigma.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        cutoff: Option<f64>,
        /// Whether the force, too, vanishes at the cut-off; otherwise it jumps there.
        #[serde(default = "yes")]
        smooth: bool,
        /// Names of objects. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
        /// Names of objects that act on those in `on`, without reaction. Default: objects in `on` act on each other.
        #[serde(default)]
        from: Option<Vec<String>>,
    },
    /// Repulsion of masses closer than a distance, f = k (d - r)^p for each pair.
    Repulsion {
        /// k.
        #[schemars(range(min = 0.0), extend("x-unit" = "N/m^exponent"))]
        stiffness: f64,
        /// d.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        distance: f64,
        /// p.
        #[serde(default = "linear")]
        #[schemars(range(min = 1, max = 4))]
        exponent: u8,
        /// Names of objects. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
        /// Names of objects that act on those in `on`, without reaction. Default: objects in `on` act on each other.
        #[serde(default)]
        from: Option<Vec<String>>,
    },
    /// Attraction of neighbours: zero at zero distance and beyond the radius, largest at 0.45 of it.
    Cohesion {
        /// The largest force of a pair.
        #[schemars(range(min = 0.0), extend("x-unit" = "N"))]
        strength: f64,
        /// Neighbour distance.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
        /// Names of objects. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
        /// Names of objects that act on those in `on`, without reaction. Default: objects in `on` act on each other.
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
        /// Only along the line between the two, which conserves angular momentum, too.
        #[serde(default)]
        central: bool,
        /// Names of objects. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
        /// Names of objects that act on those in `on`, without reaction. Default: objects in `on` act on each other.
        #[serde(default)]
        from: Option<Vec<String>>,
    },
    /// A flock: each member steers by its neighbours, keeps a speed, seeks goals, avoids colliders and flees from predators.
    Flock {
        /// Distance of sight.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
        /// Number of nearest neighbours considered; starlings use 7. Default: all within the radius.
        #[serde(default)]
        #[schemars(range(min = 1, max = 1000))]
        nearest: Option<u32>,
        /// Field of view around the direction of motion; 360 is unlimited.
        #[serde(default = "full_turn")]
        #[schemars(range(min = 1.0, max = 360.0), extend("x-unit" = "°"))]
        view: f64,
        /// Acceleration towards the centre of the neighbours, per metre of distance.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "1/s²"))]
        cohesion: f64,
        /// Rate of adaptation to the neighbours' velocity.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
        alignment: f64,
        /// Acceleration away from each neighbour closer than `spacing`.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m/s²"))]
        separation: f64,
        /// Preferred distance. Default: half the radius.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        spacing: Option<f64>,
        /// Cruising speed; 0 is no propulsion.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m/s"))]
        speed: f64,
        /// Rate of approach to the cruising speed.
        #[serde(default = "rate")]
        #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
        propulsion: f64,
        /// Limit of the acceleration. Default: none.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m/s²", "exclusiveMinimum" = 0.0))]
        max_acceleration: Option<f64>,
        /// Points that attract.
        #[serde(default)]
        goal: Vec<Goal>,
        /// Acceleration away from colliders closer than `clearance`; 0 is no avoidance.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m/s²"))]
        avoidance: f64,
        /// Distance kept from colliders. Default: the radius.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        clearance: Option<f64>,
        /// Names of objects that are predators of the flock.
        #[serde(default)]
        predators: Vec<String>,
        /// Acceleration away from predators closer than `fear_radius`.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m/s²"))]
        fear: f64,
        /// Distance at which predators are noticed. Default: three times the radius.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        fear_radius: Option<f64>,
        /// Acceleration of predators towards the prey.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m/s²"))]
        chase: f64,
        /// Cruising speed of predators. Default: that of the flock.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m/s"))]
        predator_speed: Option<f64>,
        /// Names of objects. Default: all but the predators.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// Coulomb's force between all charged masses of the same system, F = k q1 q2 / d²: like charges repel.
    Electrostatics {
        /// k.
        #[serde(default = "coulomb")]
        #[schemars(extend("x-unit" = "N m²/C²"))]
        constant: f64,
        /// Softening length s: 1/d² becomes d/(d² + s²)^(3/2).
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
        softening: f64,
        /// Names of objects whose charges interact. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// An acceleration in addition to gravity: uniform, time-dependent, or a formula of t, x, y, z, vx, vy, vz.
    Acceleration {
        /// The acceleration.
        #[schemars(extend("x-unit" = "m/s²"))]
        value: AnimatedVector,
        /// Names of objects. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// A magnetic field: f = q v x B on charged particles.
    Magnetic {
        /// B: uniform, time-dependent, or a formula of t, x, y, z.
        #[schemars(extend("x-unit" = "T"))]
        field: AnimatedVector,
        /// Names of objects. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// An electric field: f = q E on charged particles.
    Electric {
        /// E: uniform, time-dependent, or a formula of t, x, y, z.
        #[schemars(extend("x-unit" = "V/m"))]
        field: AnimatedVector,
        /// Names of objects. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// A vortex: acceleration around, towards and along an axis, largest around it at the core radius c and falling as 1/r outside. It accelerates
    /// without limit: add drag, or use a `vortex` in the air of a `wind`.
    Vortex {
        /// A point of the axis; may change in time.
        #[serde(default = "origin")]
        #[schemars(extend("x-unit" = "m"))]
        center: AnimatedVector,
        /// Direction of the axis, of any length.
        #[serde(default = "up")]
        axis: [f64; 3],
        /// Core radius c.
        #[serde(default = "one")]
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        core: f64,
        /// Largest acceleration around the axis, at r = c; counter-clockwise seen from the tip of the axis.
        #[schemars(extend("x-unit" = "m/s²"))]
        swirl: Animated,
        /// Largest acceleration towards the axis, at r = c.
        #[serde(default = "nothing")]
        #[schemars(extend("x-unit" = "m/s²"))]
        inward: Animated,
        /// Largest acceleration along the axis, at r = 0.
        #[serde(default = "nothing")]
        #[schemars(extend("x-unit" = "m/s²"))]
        lift: Animated,
        /// Names of objects. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// Random, divergence-free acceleration: curl noise.
    Turbulence {
        /// Root mean square.
        #[schemars(extend("x-unit" = "m/s²"))]
        strength: Animated,
        /// Size of the largest swirls.
        #[serde(default = "one")]
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        scale: f64,
        /// Number of swirl sizes, each half as large as the one before.
        #[serde(default = "three")]
        #[schemars(range(min = 1, max = 12))]
        octaves: u32,
        /// Strength of each size relative to the one before.
        #[serde(default = "half")]
        #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
        roughness: f64,
        /// Rate of change in time.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
        rate: f64,
        /// Selects the random field, together with the seed of the scene.
        #[serde(default)]
        seed: u32,
        /// Names of objects. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
    /// Thrust along the direction of motion: f = (thrust + m (speed - |v|)/time) v/|v|; zero at rest.
    Propulsion {
        /// Constant thrust; negative brakes.
        #[serde(default = "nothing")]
        #[schemars(extend("x-unit" = "N"))]
        thrust: Animated,
        /// Desired speed. Default: thrust alone.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m/s"))]
        speed: Option<Animated>,
        /// Time in which the difference from the desired speed falls to 1/e.
        #[serde(default = "one")]
        #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0.0))]
        time: f64,
        /// Names of objects. Default: all.
        #[serde(default)]
        on: Option<Vec<String>>,
    },
}

/// A point that attracts a flock.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// The point.
    #[schemars(extend("x-unit" = "m"))]
    pub point: [f64; 3],
    /// Acceleration towards it at large distance.
    #[schemars(extend("x-unit" = "m/s²"))]
    pub strength: f64,
}

/// A velocity field; the fields of a scene are summed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Field {
    /// The velocity of a gas.
    Gas {
        /// Name of the gas.
        of: String,
    },
    /// The same velocity everywhere.
    Uniform {
        /// The velocity; may change in time.
        #[schemars(extend("x-unit" = "m/s"))]
        velocity: AnimatedVector,
    },
    /// Rotation about an axis: u = rate axis x (x - center). Exact paths are circles.
    Swirl {
        /// A point of the axis.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Direction of the axis, of any length.
        #[serde(default = "up")]
        axis: [f64; 3],
        /// Angular velocity; may change in time.
        #[schemars(extend("x-unit" = "rad/s"))]
        rate: Animated,
    },
    /// Flow into a point: u = -rate (x - center). Exact paths decay without passing the centre.
    Sink {
        /// The point.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Decay rate; negative makes a source. May change in time.
        #[schemars(extend("x-unit" = "1/s"))]
        rate: Animated,
    },
    /// A vortex that rotates rigidly in its core and as 1/r outside, with an inflow and an updraft.
    Vortex {
        /// A point of the axis; may change in time.
        #[serde(default = "origin")]
        #[schemars(extend("x-unit" = "m"))]
        center: AnimatedVector,
        /// Direction of the axis, of any length.
        #[serde(default = "up")]
        axis: [f64; 3],
        /// Core radius c.
        #[serde(default = "one")]
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        core: f64,
        /// Largest velocity around the axis, at r = c.
        #[schemars(extend("x-unit" = "m/s"))]
        swirl: Animated,
        /// Largest velocity towards the axis, at r = c.
        #[serde(default = "nothing")]
        #[schemars(extend("x-unit" = "m/s"))]
        inward: Animated,
        /// Largest velocity along the axis, at r = 0.
        #[serde(default = "nothing")]
        #[schemars(extend("x-unit" = "m/s"))]
        lift: Animated,
    },
    /// Random, divergence-free flow: curl noise.
    Turbulence {
        /// Root mean square of the velocity.
        #[schemars(extend("x-unit" = "m/s"))]
        strength: Animated,
        /// Size of the largest swirls.
        #[serde(default = "one")]
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        scale: f64,
        /// Number of swirl sizes, each half as large as the one before.
        #[serde(default = "three")]
        #[schemars(range(min = 1, max = 12))]
        octaves: u32,
        /// Strength of each size relative to the one before.
        #[serde(default = "half")]
        #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
        roughness: f64,
        /// Rate of change in time.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
        rate: f64,
        /// Selects the random field, together with the seed of the scene.
        #[serde(default)]
        seed: u32,
    },
    /// A formula of t, x, y, z.
    Formula {
        /// The velocity.
        #[schemars(extend("x-unit" = "m/s"))]
        velocity: AnimatedVector,
    },
}

/// A spring between two masses of any objects, possibly in different systems, or between a mass and a rigid body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Anchor {
    /// Name in reports.
    pub name: String,
    /// The two masses, as `"object index"`; one of them may be a rigid body.
    pub between: [String; 2],
    /// Where it holds the rigid body, a place in the world at the start. Default: its centre of mass.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub at: Option<[f64; 3]>,
    /// Spring constant; may change in time.
    #[schemars(extend("x-unit" = "N/m"))]
    pub stiffness: Animated,
    /// Damping along the spring.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N s/m"))]
    pub damping: f64,
    /// Rest length; may change in time, as that of a winch or a muscle. Default: the initial distance.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub rest_length: Option<Animated>,
}

fn air_density() -> f64 {
    1.2
}

fn plate() -> f64 {
    1.2
}

fn skin() -> f64 {
    0.01
}

fn coulomb() -> f64 {
    8.987_551_792_3e9
}

fn newton() -> f64 {
    6.67428e-11
}

fn origin() -> AnimatedVector {
    [0.0; 3].into()
}

fn nothing() -> Animated {
    0.0.into()
}

fn half() -> f64 {
    0.5
}

fn one() -> f64 {
    1.0
}

fn two() -> f64 {
    2.0
}

fn three() -> u32 {
    3
}

fn yes() -> bool {
    true
}

fn linear() -> u8 {
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

impl Force {
    /// The objects on which it acts; `None` for all.
    pub fn on(&self) -> Option<&Vec<String>> {
        match self {
            Self::Drag { on, .. }
            | Self::Wind { on, .. }
            | Self::Air { on, .. }
            | Self::Attraction { on, .. }
            | Self::Gravitation { on, .. }
            | Self::Electrostatics { on, .. }
            | Self::LennardJones { on, .. }
            | Self::Repulsion { on, .. }
            | Self::Cohesion { on, .. }
            | Self::Viscosity { on, .. }
            | Self::Flock { on, .. }
            | Self::Acceleration { on, .. }
            | Self::Magnetic { on, .. }
            | Self::Electric { on, .. }
            | Self::Vortex { on, .. }
            | Self::Turbulence { on, .. }
            | Self::Propulsion { on, .. } => on.as_ref(),
        }
    }
}
