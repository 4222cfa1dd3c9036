//! Rigid bodies.

use super::{MeshFile, items_above_zero};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Rigid bodies of one shape, moved by systems of method `rigid`. Those of a system meet each other and colliders.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Name in frames and pictures.
    pub name: String,
    /// The system that moves them. Default: the first of method `rigid`.
    #[serde(default)]
    pub system: Option<String>,
    /// Their shape. Whatever its origin, their positions are those of the centre of mass.
    pub shape: BodyShape,
    /// Position of the centre of mass of each body; with `arrange`, of the first.
    #[serde(default = "origin")]
    #[schemars(length(min = 1), extend("x-unit" = "m"))]
    pub position: Vec<[f64; 3]>,
    /// Copies of the one body at `position`.
    #[serde(default)]
    pub arrange: Option<Arrange>,
    /// Rotation about x, then y, then z: one for all bodies, or one each.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: Vec<[f64; 3]>,
    /// Initial velocity of the centre of mass: one for all bodies, or one each.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: Vec<[f64; 3]>,
    /// Initial angular velocity, along the axis by the right-hand rule: one for all bodies, or one each.
    #[serde(default)]
    #[schemars(extend("x-unit" = "rad/s"))]
    pub angular_velocity: Vec<[f64; 3]>,
    /// Density. Default: 1000 kg/m³, unless `mass` is given.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub density: Option<f64>,
    /// Mass of each body, instead of a density.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg", "exclusiveMinimum" = 0.0))]
    pub mass: Option<f64>,
    /// Principal moments of inertia about x, y and z of the shape. Default: those of a solid of uniform density.
    #[serde(default)]
    #[schemars(transform = items_above_zero, extend("x-unit" = "kg m²"))]
    pub inertia: Option<[f64; 3]>,
    /// Distance kept between the surface and masses of other systems: cloth, ropes, particles. Bodies and colliders touch without it.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
    pub thickness: f64,
    /// Kinetic friction coefficient (Coulomb). Of two surfaces that touch, the larger coefficient holds.
    #[serde(default = "rough")]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub friction: f64,
    /// Static friction coefficient, at least `friction`. Default: equal to `friction`.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub friction_static: Option<f64>,
    /// Speed after a bounce over speed before. Of two surfaces that touch, the larger one holds.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub restitution: f64,
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

fn origin() -> Vec<[f64; 3]> {
    vec![[0.0; 3]]
}

fn rough() -> f64 {
    0.5
}

/// The shape of a rigid body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BodyShape {
    /// A ball.
    Sphere {
        /// Its radius.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
    },
    /// A box.
    Box {
        /// Its edges.
        #[schemars(transform = items_above_zero, extend("x-unit" = "m"))]
        size: [f64; 3],
    },
    /// A cylinder along z with round ends.
    Capsule {
        /// Its radius.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
        /// Distance between the centres of its ends.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        length: f64,
    },
    /// A cylinder along z.
    Cylinder {
        /// Its radius.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
        /// Its height.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        height: f64,
    },
    /// A cone along z, with the tip up.
    Cone {
        /// Radius of its base.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
        /// Its height.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        height: f64,
    },
    /// The convex hull of points.
    Hull {
        /// The points.
        #[schemars(length(min = 4), extend("x-unit" = "m"))]
        points: Vec<[f64; 3]>,
    },
    /// The convex hull of a mesh from a file; pictures show the mesh itself.
    Mesh(MeshFile),
}

/// Copies of a body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Arrange {
    /// One after the other.
    Row {
        /// How many.
        #[schemars(range(min = 1, max = 1_000_000))]
        count: u32,
        /// From each to the next.
        #[schemars(extend("x-unit" = "m"))]
        step: [f64; 3],
    },
    /// One on top of the other.
    Stack {
        /// How many.
        #[schemars(range(min = 1, max = 100_000))]
        count: u32,
    },
    /// Bricks in the plane of x and z, every second course shifted by half a brick.
    Wall {
        /// Bricks of a course.
        #[schemars(range(min = 1, max = 100_000))]
        columns: u32,
        /// Courses.
        #[schemars(range(min = 1, max = 100_000))]
        rows: u32,
    },
}

impl Arrange {
    /// How many bodies there are.
    pub fn count(&self) -> f64 {
        match self {
            Self::Row { count, .. } | Self::Stack { count } => f64::from(*count),
            Self::Wall { columns, rows } => f64::from(*columns) * f64::from(*rows),
        }
    }
}

/// Settings of the `rigid` method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Rigid {
    /// Passes over all contacts in a sub-step, before and after bodies move: more for high piles, and for heavy bodies on light ones.
    #[schemars(range(min = 1, max = 10_000))]
    pub iterations: u32,
}

impl Default for Rigid {
    fn default() -> Self {
        Self { iterations: 8 }
    }
}
