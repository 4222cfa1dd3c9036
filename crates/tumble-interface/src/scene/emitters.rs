//! Particles that are born and die.

use super::{Animated, AnimatedVector, MeshFile, MeshRef, Shape};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A source of particles. They are born at times within a frame, have a lifetime, and get ids that are never reused.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Emitter {
    /// Name of the particles in frames.
    pub name: String,
    /// System that moves them. Default: the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// Source of the particles.
    pub from: Source,
    /// Particles per second; for a source of particles, children of each per second.
    #[serde(default = "nothing")]
    #[schemars(extend("x-unit" = "1/s", "minimum" = 0.0))]
    pub rate: Animated,
    /// Particles born at once; for a source of particles, `count` children of each when it dies or bounces.
    #[serde(default)]
    pub burst: Vec<Burst>,
    /// Start of the rate.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub start: f64,
    /// End of the rate. Default: never.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub end: Option<f64>,
    /// Irregularity of birth times: 0 is regular, 1 draws each at random within its exchange interval. The number of births per interval is
    /// unchanged.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub jitter: f64,
    /// Displacement of the source from the position given by `from`.
    #[serde(default = "origin")]
    #[schemars(extend("x-unit" = "m"))]
    pub path: AnimatedVector,
    /// Initial velocity of all particles.
    #[serde(default = "origin")]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: AnimatedVector,
    /// Speed along `direction`, added to `velocity`, of those born at a time.
    #[serde(default = "nothing")]
    #[schemars(extend("x-unit" = "m/s"))]
    pub speed: Animated,
    /// Random variation of the speed, between speed (1 - this) and speed (1 + this).
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub speed_spread: f64,
    /// Direction of the speed, of any length. Default: the normal of the source, or up if it has none.
    #[serde(default)]
    pub direction: Option<[f64; 3]>,
    /// Half-angle of the cone of directions, uniform over its solid angle, 0 to 180; 180 is all directions.
    #[serde(default = "nothing")]
    #[schemars(extend("x-unit" = "°", "minimum" = 0.0, "maximum" = 180.0))]
    pub cone: Animated,
    /// Fraction of the velocity of the parent, or of the moving source, that a particle inherits.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1"))]
    pub inherit: f64,
    /// Age at which particles die, of those born at a time; > 0. Default: never.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0.0))]
    pub lifetime: Option<Animated>,
    /// Random variation of the lifetime, between lifetime (1 - this) and lifetime (1 + this).
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub lifetime_spread: f64,
    /// Further causes of death; any one suffices.
    #[serde(default)]
    pub kill: Vec<Kill>,
    /// Mass of each particle.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "kg", "exclusiveMinimum" = 0.0))]
    pub mass: f64,
    /// Random variation of the mass, between mass (1 - this) and mass (1 + this).
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1", "exclusiveMaximum" = 1.0))]
    pub mass_spread: f64,
    /// Electric charge of each particle.
    #[serde(default)]
    #[schemars(extend("x-unit" = "C"))]
    pub charge: f64,
    /// Radius in pictures, of those born at a time; > 0.
    #[serde(default = "centimetre")]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: Animated,
    /// Random variation of the radius, between radius (1 - this) and radius (1 + this).
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1", "exclusiveMaximum" = 1.0))]
    pub radius_spread: f64,
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB), of those born at a time.
    #[serde(default)]
    pub color: Option<AnimatedVector>,
    /// Each particle has a random colour between `color` and this one, of those born at a time.
    #[serde(default)]
    pub color_to: Option<AnimatedVector>,
    /// Colour at the end of life, of those born at a time; needs a `lifetime`.
    #[serde(default)]
    pub color_end: Option<AnimatedVector>,
    /// Duration of the trail drawn behind each particle in pictures.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub trail: f64,
    /// Custom values per particle, written to frames: `columns = { heat = { from = 300, to = 400 } }`.
    #[serde(default)]
    pub columns: BTreeMap<String, Between>,
    /// Maximum number of living particles. Default: unlimited.
    #[serde(default)]
    #[schemars(range(min = 1))]
    pub most: Option<u32>,
    /// Behaviour at that maximum.
    #[serde(default)]
    pub when_full: WhenFull,
}

/// Source of the particles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Source {
    /// A point.
    Point {
        /// Its position.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        at: [f64; 3],
    },
    /// A polyline, uniform along its length.
    Curve {
        /// The points.
        #[schemars(length(min = 2), extend("x-unit" = "m"))]
        points: Vec<[f64; 3]>,
    },
    /// A disk, uniform over its area.
    Disk {
        /// Its centre.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Its normal, of any length.
        #[serde(default = "up")]
        normal: [f64; 3],
        /// Its radius.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
    },
    /// A ball, uniform over its volume or its surface; in a scene of dimension 2 its points are projected onto the plane.
    Sphere {
        /// Its centre.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Its radius.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
        /// On the surface only.
        #[serde(default)]
        surface: bool,
    },
    /// A box, uniform over its volume. An edge may be 0: a rectangle or a line.
    Box {
        /// Its centre.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Its edges.
        #[schemars(inner(range(min = 0.0)), extend("x-unit" = "m"))]
        size: [f64; 3],
        /// Rotation about x, then y, then z.
        #[serde(default)]
        #[schemars(extend("x-unit" = "°"))]
        rotate: [f64; 3],
    },
    /// The triangles of a mesh, uniform over their area.
    MeshSurface(MeshFile),
    /// The interior of a closed mesh, uniform over its volume.
    MeshVolume(MeshFile),
    /// Other emitted particles: `rate` creates children while the parent lives, `burst` when it dies or each time it bounces. For bursts the parents may
    /// be in another system that comes before that of the children.
    Particles {
        /// Name of the emitter of the parents.
        of: String,
        /// Event that triggers a `burst`.
        #[serde(default)]
        at: Event,
        /// Causes of death that trigger one. Default: all.
        #[serde(default)]
        cause: Vec<Cause>,
    },
}

impl Source {
    /// Its mesh, if it has one; `place` is its own in the scene.
    pub(super) fn mesh_mut(&mut self, place: &str) -> Option<MeshRef<'_>> {
        match self {
            Self::MeshSurface(mesh) => Some(MeshRef::mesh(format!("{place}.mesh_surface"), mesh)),
            Self::MeshVolume(mesh) => Some(MeshRef::mesh(format!("{place}.mesh_volume"), mesh)),
            _ => None,
        }
    }
}

/// Event in the life of a parent that triggers a burst of children.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// Its death; children continue its motion unless they have a direction.
    #[default]
    Death,
    /// Each impact on a collider faster than the speed gained from gravity in two steps: a splash. Children leave along the surface normal unless
    /// they have a direction.
    Bounce,
}

/// Cause of death of a particle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Its age.
    Lifetime,
    /// The rule `inside`.
    Inside,
    /// The rule `outside`.
    Outside,
    /// The rule `near_collider`.
    NearCollider,
    /// The rule `slower_than`.
    SlowerThan,
    /// The rule `faster_than`.
    FasterThan,
    /// It was the oldest and was replaced (`when_full = "replace_oldest"`).
    Replaced,
}

/// Objects that come in over time, such as grains that are poured. They are born evenly, each where and when there is room for it: those without
/// wait, and none is lost.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Emit {
    /// Source: their centres are born in it. Not `particles`.
    pub from: Source,
    /// Births per second.
    #[schemars(extend("x-unit" = "1/s", "exclusiveMinimum" = 0.0))]
    pub rate: f64,
    /// Births in all, at most.
    #[schemars(range(min = 1, max = 100_000_000))]
    pub count: u32,
    /// Start of the births.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub start: f64,
    /// End of the rate; those that wait are still born later. Default: never.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub end: Option<f64>,
    /// Velocity at birth.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: [f64; 3],
}

/// Particles born at once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Burst {
    /// Time; not for children, which are born when the parent dies or bounces.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub time: f64,
    /// Count.
    pub count: u32,
}

/// A rule by which particles die, checked at the end of each exchange interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Kill {
    /// Inside a solid: `{ inside = { sphere = { radius = 1.0 } } }`; a floor is everything below it.
    Inside(Shape),
    /// Outside a solid.
    Outside(Shape),
    /// Nearer to a collider than this.
    NearCollider(#[schemars(range(min = 0.0), extend("x-unit" = "m"))] f64),
    /// Slower than this.
    SlowerThan(#[schemars(range(min = 0.0), extend("x-unit" = "m/s"))] f64),
    /// Faster than this.
    FasterThan(#[schemars(range(min = 0.0), extend("x-unit" = "m/s"))] f64),
}

/// A uniform random number between two bounds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Between {
    /// Lower bound.
    pub from: f64,
    /// Upper bound. Default: the lower bound.
    #[serde(default)]
    pub to: Option<f64>,
}

/// Behaviour of an emitter at its maximum number of particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WhenFull {
    /// Births pause until particles have died.
    #[default]
    Wait,
    /// The oldest die as new ones are born, and may have children as they do.
    ReplaceOldest,
    /// The run ends with an error.
    Error,
}

fn nothing() -> Animated {
    0.0.into()
}

fn origin() -> AnimatedVector {
    [0.0; 3].into()
}

fn one() -> f64 {
    1.0
}

fn centimetre() -> Animated {
    0.01.into()
}

fn up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}
