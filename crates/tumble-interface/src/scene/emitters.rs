//! Particles that are born and die.

use super::{Animated, AnimatedVector, MeshFile, Shape};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A source of particles. They are born at moments within a frame, live for a while, and have ids that are never used
/// again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Emitter {
    /// Name of the particles in frames.
    pub name: String,
    /// System that moves them; without it, the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// Where they are born.
    pub from: Source,
    /// Particles a second; from other particles, children of each a second.
    #[serde(default = "nothing")]
    #[schemars(extend("x-unit" = "1/s"))]
    pub rate: Animated,
    /// Particles born at once; from other particles, `count` children of each when it dies, or bounces.
    #[serde(default)]
    pub burst: Vec<Burst>,
    /// When the rate begins.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub start: f64,
    /// When the rate ends; without it, never.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub end: Option<f64>,
    /// How irregular the moments of birth are: 0 is a metronome, 1 draws each anywhere in its exchange interval. The
    /// number born in an interval is the same.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub jitter: f64,
    /// Way of the source from where `from` puts it.
    #[serde(default = "origin")]
    #[schemars(extend("x-unit" = "m"))]
    pub path: AnimatedVector,
    /// Velocity that all of them get.
    #[serde(default = "origin")]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: AnimatedVector,
    /// Speed along `direction`, added to `velocity`.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub speed: f64,
    /// Random part of the speed: it lies between speed (1 - this) and speed (1 + this).
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub speed_spread: f64,
    /// Direction of the speed, of any length; without it, out of the source: its normal, or up where it has none.
    #[serde(default)]
    pub direction: Option<[f64; 3]>,
    /// Half the angle of the cone in which directions lie, evenly over its solid angle; 180 is every direction.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 180.0), extend("x-unit" = "°"))]
    pub cone: f64,
    /// Share of the velocity of the parent, or of the moving source, that a particle gets.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1"))]
    pub inherit: f64,
    /// Age at which they die; without it, they live on.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0.0))]
    pub lifetime: Option<f64>,
    /// Random part of the lifetime: it lies between lifetime (1 - this) and lifetime (1 + this).
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub lifetime_spread: f64,
    /// What else they die of; any one is enough.
    #[serde(default)]
    pub kill: Vec<Kill>,
    /// Mass of each.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "kg", "exclusiveMinimum" = 0.0))]
    pub mass: f64,
    /// Random part of the mass: it lies between mass (1 - this) and mass (1 + this).
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1", "exclusiveMaximum" = 1.0))]
    pub mass_spread: f64,
    /// Electric charge of each.
    #[serde(default)]
    #[schemars(extend("x-unit" = "C"))]
    pub charge: f64,
    /// Radius in pictures.
    #[serde(default = "centimetre")]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// Random part of the radius: it lies between radius (1 - this) and radius (1 + this).
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1", "exclusiveMaximum" = 1.0))]
    pub radius_spread: f64,
    /// Red, green and blue in pictures, 0 to 1, in linear light (a half is sRGB's 188 of 255).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
    /// Each particle has a colour between `color` and this one.
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color_to: Option<[f64; 3]>,
    /// Colour that it has faded to at the end of its life; needs a `lifetime`.
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color_end: Option<[f64; 3]>,
    /// How much of the way behind each is drawn in pictures.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub trail: f64,
    /// Numbers of your own that each particle carries and frames hold: `columns = { heat = { from = 300, to = 400 } }`.
    #[serde(default)]
    pub columns: BTreeMap<String, Between>,
    /// Particles alive at most; without it, as many as are born.
    #[serde(default)]
    #[schemars(range(min = 1))]
    pub most: Option<u32>,
    /// What happens when there are as many as that.
    #[serde(default)]
    pub when_full: WhenFull,
}

/// Where particles are born.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Source {
    /// A point.
    Point {
        /// Where it is.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        at: [f64; 3],
    },
    /// Straight pieces between points, evenly along their length.
    Curve {
        /// The points.
        #[schemars(length(min = 2), extend("x-unit" = "m"))]
        points: Vec<[f64; 3]>,
    },
    /// A round disk, evenly over its area.
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
    /// A ball, evenly over its volume, or its surface; in a scene of dimension 2 its points are put onto the plane.
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
    /// A box, evenly over its volume. An edge may be 0: a wall or a line.
    Box {
        /// Its centre.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Its edges.
        #[schemars(inner(range(min = 0.0)), extend("x-unit" = "m"))]
        size: [f64; 3],
        /// Turn about x, then y, then z.
        #[serde(default)]
        #[schemars(extend("x-unit" = "°"))]
        rotate: [f64; 3],
    },
    /// The triangles of a mesh, evenly over their area.
    MeshSurface(MeshFile),
    /// The inside of a closed mesh, evenly over its volume.
    MeshVolume(MeshFile),
    /// Other emitted particles: `rate` makes children while the parent lives, `burst` when it dies, or each time it bounces.
    Particles {
        /// Name of the emitter of the parents.
        of: String,
        /// What makes a `burst`.
        #[serde(default)]
        at: Event,
        /// Deaths that make one; without any, all do.
        #[serde(default)]
        cause: Vec<Cause>,
    },
}

/// What in the life of a parent makes a burst of children.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// Its death; children fly on as it did, unless they have a direction.
    #[default]
    Death,
    /// Each impact on a collider that is faster than what gravity gives in two steps: a splash. Children fly off the surface,
    /// unless they have a direction.
    Bounce,
}

/// What a particle dies of.
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
    /// It was the oldest, and made room where `when_full` is `replace_oldest`.
    Replaced,
}

/// Particles born at once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Burst {
    /// When; not for children, which are born when the parent dies or bounces.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub time: f64,
    /// How many.
    pub count: u32,
}

/// A rule by which particles die, looked at when an exchange interval ends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Kill {
    /// In a solid: `{ inside = { sphere = { radius = 1.0 } } }`; a floor is everything below it.
    Inside(Shape),
    /// Out of a solid.
    Outside(Shape),
    /// Nearer to a collider than this.
    NearCollider(#[schemars(range(min = 0.0), extend("x-unit" = "m"))] f64),
    /// Slower than this.
    SlowerThan(#[schemars(range(min = 0.0), extend("x-unit" = "m/s"))] f64),
    /// Faster than this.
    FasterThan(#[schemars(range(min = 0.0), extend("x-unit" = "m/s"))] f64),
}

/// A number drawn evenly between two.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Between {
    /// The smallest.
    pub from: f64,
    /// The largest; without it, all are the same.
    #[serde(default)]
    pub to: Option<f64>,
}

/// What happens when an emitter has as many particles as it may.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WhenFull {
    /// No more are born until some have died.
    #[default]
    Wait,
    /// The oldest die as others are born, and may bear children as they do.
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

fn centimetre() -> f64 {
    0.01
}

fn up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}
