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
    /// Position of the centre of mass of each body; with `arrange`, of the first, unless that says otherwise.
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
    /// Largest moment against rolling, over the normal force and the height of the centre of mass over the contact. A ball or cylinder rests on slopes up
    /// to that tangent; a steel ball on steel has 0.001, a ball on grass 0.05. Of two bodies that touch, the larger moment holds.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub rolling_friction: f64,
    /// Speed after a bounce over speed before. Of two surfaces that touch, the larger one holds.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub restitution: f64,
    /// Sleep of bodies that have come to rest: they stand still, and cost nothing, until something touches or pushes them. What joints hold stays awake.
    #[serde(default)]
    pub sleeping: bool,
    /// Birth of the bodies during the run; none is there at the start.
    #[serde(default)]
    pub emit: Option<BodyEmit>,
    /// Pieces into which they break. Default: they never break.
    #[serde(default)]
    pub fracture: Option<Fracture>,
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// Birth of bodies during the run. A body is born where it touches neither bodies nor colliders; until there is room, it waits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyEmit {
    /// Bodies per second.
    #[schemars(range(max = 1e6), extend("x-unit" = "1/s", "exclusiveMinimum" = 0.0))]
    pub rate: f64,
    /// Bodies in all, at most.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub count: u32,
    /// Start of the rate.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub start: f64,
    /// End of the rate. Default: never. Bodies that wait then are still born.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub end: Option<f64>,
    /// Region in which their centres of mass are born.
    pub from: BirthRegion,
    /// Initial velocity.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: [f64; 3],
    /// Initial angular velocity, along the axis by the right-hand rule.
    #[serde(default)]
    #[schemars(extend("x-unit" = "rad/s"))]
    pub spin: [f64; 3],
    /// Rotation of each at random, all being equally likely, instead of `rotate`.
    #[serde(default)]
    pub random_turns: bool,
}

/// A region of which all points are equally likely.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BirthRegion {
    /// A point.
    Point {
        /// Its position.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        at: [f64; 3],
    },
    /// A disk.
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
    /// A ball.
    Sphere {
        /// Its centre.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Its radius.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
    },
    /// A box. An edge may be 0: a rectangle or a line.
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
}

/// How a body breaks: it consists of pieces that are glued together, and a face between two of them breaks where the tension in it exceeds the
/// strength. Its shape is `box`, `hull`, `mesh` or `voussoir`. In frames and pictures its pieces are objects: `NAME.1`, `NAME.2` and so on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fracture {
    /// Number of pieces: the Voronoi cells of random points in the body.
    #[serde(default)]
    #[schemars(range(min = 2, max = 1000))]
    pub pieces: Option<u32>,
    /// Points, in the axes of the shape, whose Voronoi cells are the pieces, instead of random ones.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub sites: Vec<[f64; 3]>,
    /// Tensile strength. Concrete has some 3e6 Pa, dry mortar 2e5 Pa.
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0.0))]
    pub strength: f64,
    /// Seed of the points; the name of the body and the seed of the scene count, too.
    #[serde(default)]
    pub seed: u32,
    /// A point of the body, in the axes of its shape, towards which pieces get smaller. Default: they are alike everywhere.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub around: Option<[f64; 3]>,
}

impl Fracture {
    /// How many pieces there are.
    fn count(&self) -> usize {
        self.pieces.map_or(self.sites.len(), |pieces| pieces as usize)
    }
}

fn up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
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
    /// A stone of an arch: the part of a ring about y between two planes through its axis, with flat faces. The arrangement `arch` makes an arch of it.
    Voussoir {
        /// Mean radius of the arch.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
        /// Thickness of the arch, below twice its mean radius.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        thickness: f64,
        /// Width of the arch along y.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        width: f64,
        /// Stones of the arch.
        #[schemars(range(min = 3, max = 10_000))]
        stones: u32,
        /// Angle that all of them span.
        #[serde(default = "half_turn")]
        #[schemars(range(max = 360.0), extend("x-unit" = "°", "exclusiveMinimum" = 0.0))]
        span: f64,
    },
    /// The convex hull of a mesh from a file; pictures show the mesh itself.
    Mesh(MeshFile),
    /// A closed mesh from a file as it is, with its hollows: a ring, a cup, a hook. Rigid bodies and colliders meet it as convex parts, which are found
    /// when the run starts.
    Concave {
        /// The mesh.
        mesh: MeshFile,
        /// The part of the mesh's volume by which all parts together may exceed it: less takes more parts, and more time.
        #[serde(default = "close")]
        #[schemars(range(max = 1.0), extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
        tolerance: f64,
        /// Parts at most, whatever the tolerance.
        #[serde(default = "many")]
        #[schemars(range(min = 1, max = 1000))]
        most: u32,
    },
    /// Several shapes that are one body. Its mass, centre of mass and moments of inertia are those of all parts; where they overlap, each counts.
    Compound {
        /// The parts.
        #[schemars(length(min = 1))]
        parts: Vec<BodyPart>,
    },
}

impl BodyShape {
    /// The meshes from files in it, each with its key.
    pub fn mesh_files_mut(&mut self) -> Vec<(String, &mut MeshFile)> {
        match self {
            Self::Mesh(mesh) => vec![(".mesh".into(), mesh)],
            Self::Concave { mesh, .. } => vec![(".concave.mesh".into(), mesh)],
            Self::Compound { parts } => {
                let files = parts.iter_mut().enumerate().flat_map(|(i, part)| {
                    let files = part.shape.mesh_files_mut().into_iter();
                    files.map(move |(key, mesh)| (format!(".compound.parts[{i}].shape{key}"), mesh))
                });
                files.collect()
            }
            _ => Vec::new(),
        }
    }
}

/// A part of a body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyPart {
    /// Its shape.
    pub shape: BodyShape,
    /// Where the origin of its shape is in the axes of the body: the middle of a ball, box, capsule, cylinder or cone.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub position: [f64; 3],
    /// Rotation about x, then y, then z.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
    /// Its density. Default: that of the body.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub density: Option<f64>,
}

fn close() -> f64 {
    0.03
}

fn many() -> u32 {
    32
}

fn half_turn() -> f64 {
    180.0
}

impl Body {
    /// How many bodies there are, at most.
    pub fn count(&self) -> f64 {
        if let Some(emit) = &self.emit {
            return f64::from(emit.count);
        }
        match (&self.arrange, &self.shape) {
            (Some(Arrange::Arch {}), BodyShape::Voussoir { stones, .. }) => f64::from(*stones),
            (Some(arrange), _) => arrange.count(),
            (None, _) => self.position.len() as f64,
        }
    }

    /// Pieces of each body.
    pub fn pieces(&self) -> usize {
        self.fracture.as_ref().map_or(1, Fracture::count)
    }

    /// Names of its objects in frames: its own, or those of its pieces.
    pub fn parts(&self) -> Vec<String> {
        match &self.fracture {
            Some(fracture) => (1..=fracture.count()).map(|k| format!("{}.{k}", self.name)).collect(),
            None => vec![self.name.clone()],
        }
    }
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
    /// One after the other, each turned about the way to it, as the links of a chain are; a `[[joint]]` with `chain = true` joins neighbours.
    Chain {
        /// How many.
        #[schemars(range(min = 1, max = 1_000_000))]
        count: u32,
        /// From each to the next.
        #[schemars(extend("x-unit" = "m"))]
        step: [f64; 3],
        /// Turn of each from the one before, about `step`.
        #[serde(default = "quarter_turn")]
        #[schemars(extend("x-unit" = "°"))]
        twist: f64,
    },
    /// The stones of an arch, of shape `voussoir`, side by side in the plane of x and z from left to right. `position` is the centre of its circle,
    /// `rotate` turns the arch as a whole.
    Arch {},
    /// Strewn at random in a box about `position`, without touching; determined by seed and name. All turns are as likely, unless `rotate` is given.
    Scatter {
        /// How many.
        #[schemars(range(min = 1, max = 1_000_000))]
        count: u32,
        /// Edges of the box, in which they are as a whole.
        #[schemars(transform = items_above_zero, extend("x-unit" = "m"))]
        size: [f64; 3],
    },
}

fn quarter_turn() -> f64 {
    90.0
}

impl Arrange {
    /// How many bodies there are, unless their shape says it.
    fn count(&self) -> f64 {
        match self {
            Self::Row { count, .. } | Self::Stack { count } | Self::Chain { count, .. } | Self::Scatter { count, .. } => f64::from(*count),
            Self::Wall { columns, rows } => f64::from(*columns) * f64::from(*rows),
            Self::Arch {} => 1.0,
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
