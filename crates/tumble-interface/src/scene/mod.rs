//! The scene: every key of a scene file, with unit, default and range. These structs are the schema; JSON Schema, the reference page and the Python
//! stubs are generated from them.

mod animated;
mod cloth;
mod compressible;
mod crowd;
mod emitters;
mod fabrics;
mod forces;
mod gas;
mod grains;
mod grids;
mod hair;
mod heat;
mod joints;
mod links;
mod liquid;
mod objects;
mod output;
mod rigid;
mod shapes;
mod structures;
mod surfaces;
mod systems;
mod vicsek;

pub use animated::{Animated, AnimatedVector, Component, Interpolation, Keys, VectorKeys};
pub use cloth::{Cloth, Dress, Panel, Seam, Side};
pub use compressible::Compressible;
pub use crowd::{Choice, Crowd, FloorLink, Gate, Plan, Preset, Ramp, Stairs, Steering, Walking, Waypoint, corners, floor};
pub use emitters::{Between, Burst, Cause, Emit, Emitter, Event, Kill, Source, WhenFull};
pub use fabrics::{FabricRef, FabricUse, FabricWords};
pub use forces::{Anchor, Field, Force, Goal};
pub use gas::{
    Advections, Carriage, Densities, ExcessFlow, Fire, Gas, GasSide, GasSides, GasSource, GridInterpolation, Order, PathTrace, Pressure,
    PressureMethod, Smoke, Solid, Temperature, Viscous,
};
pub use grains::{FillShape, GrainClump, GrainFill, GrainScheme, Grains, Granular, NormalLaw};
pub use grids::GridBox;
pub use hair::{Clump, Curl, Guides, Hair, HairCollisions};
pub use heat::{Heat, HeatRegion, HeatScheme, HeatSide, HeatSides, HeatSource};
pub use joints::{Joint, JointKind, JointMotor};
pub use links::{Diagonals, Follow, Link, LinkSettings, Links, Load, Pin, Place, PointMass, Region, Within};
pub use liquid::{Liquid, LiquidDrain, LiquidFill, LiquidInflow, LiquidPressure, LiquidTransfer, LiquidWhitewater};
pub use objects::{KINDS, Object};
pub use output::{Camera, Expect, Look, Output, Probe};
pub use rigid::{Arrange, BirthRegion, Body, BodyEmit, BodyPart, BodyShape, Fracture, Rigid};
pub use shapes::{Collider, Content, Figure, Mannequin, MeshFile, MeshFrame, MeshFrames, MeshRef, Motion, Moves, Pace, Pose, Shape};
pub use structures::{Block, Cloud, CloudShape, Galaxy, Halo, Material, Net, Particles, Pattern, Profile, Rod, Rope, Sheet, Spring};
pub use surfaces::{Fill, Fluid, Inflation, Membrane, ShapeMatching, Tear, Weak};
pub use systems::{Adaptive, Hessian, Integrator, Linear, Method, OnFailure, PositionBased, Projection, SelfContact, Solver, System};
pub use vicsek::Vicsek;

use crate::check::check;
use crate::error::{Issue, SceneError};
use crate::tree::{Node, TOO_DEEP};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// A complete simulation: objects, methods and output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Version of the scene language; this is 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// One-line title.
    #[serde(default)]
    pub title: String,
    /// Seed of all random numbers.
    #[serde(default)]
    pub seed: u32,
    /// Scalar type of the engine.
    #[serde(default)]
    pub precision: Precision,
    /// Scope of bit-identity.
    #[serde(default)]
    pub bits: Bits,
    /// 2 restricts everything to `plane`; 3 is full 3D.
    #[serde(default = "three")]
    #[schemars(range(min = 2, max = 3))]
    pub dimension: u8,
    /// The plane of a two-dimensional scene.
    #[serde(default)]
    pub plane: Plane,
    /// Frames and their rate.
    #[serde(default)]
    pub time: Time,
    /// Global settings.
    #[serde(default)]
    pub world: WorldSettings,
    /// Numerical methods. Default: one system for each method that the objects need, named `main` (`dynamics`) or after the method.
    #[serde(default)]
    pub system: Vec<System>,
    /// Individually listed masses and springs between them.
    #[serde(default)]
    pub particles: Vec<Particles>,
    /// Sources of particles that are born and die.
    #[serde(default)]
    pub emitter: Vec<Emitter>,
    /// Chains of springs, or rods.
    #[serde(default)]
    pub rope: Vec<Rope>,
    /// Strands on surfaces.
    #[serde(default)]
    pub hair: Vec<Hair>,
    /// Rectangular lattices of springs.
    #[serde(default)]
    pub sheet: Vec<Sheet>,
    /// Box-shaped lattices of springs, or of tetrahedra.
    #[serde(default)]
    pub block: Vec<Block>,
    /// Springs along the edges of any mesh.
    #[serde(default)]
    pub net: Vec<Net>,
    /// Cloth cut from panels and sewn.
    #[serde(default)]
    pub cloth: Vec<Cloth>,
    /// Stars at random positions, in dynamical equilibrium; needs a force of gravitation.
    #[serde(default)]
    pub galaxy: Vec<Galaxy>,
    /// Rigid bodies, moved by systems of method `rigid`.
    #[serde(default)]
    pub body: Vec<Body>,
    /// What holds rigid bodies to each other and to the world.
    #[serde(default)]
    pub joint: Vec<Joint>,
    /// Grains, moved by systems of method `grains`.
    #[serde(default)]
    pub grains: Vec<Grains>,
    /// Plans of floors for crowds.
    #[serde(default)]
    pub plan: Vec<Plan>,
    /// People, moved by systems of method `crowd`.
    #[serde(default)]
    pub crowd: Vec<Crowd>,
    /// Bodies that conduct heat.
    #[serde(default)]
    pub heat: Vec<Heat>,
    /// Compressible gases.
    #[serde(default)]
    pub compressible: Vec<Compressible>,
    /// Fluids that fill a box, moved by systems of method `gas`.
    #[serde(default)]
    pub gas: Vec<Gas>,
    /// Liquids with a free surface, moved by systems of method `liquid`.
    #[serde(default)]
    pub liquid: Vec<Liquid>,
    /// Forces on the masses of `dynamics` systems.
    #[serde(default)]
    pub force: Vec<Force>,
    /// Velocity fields that advect the particles of `tracers` systems.
    #[serde(default)]
    pub field: Vec<Field>,
    /// Solids that masses cannot enter.
    #[serde(default)]
    pub collider: Vec<Collider>,
    /// Springs between objects, possibly in different systems.
    #[serde(default)]
    pub anchor: Vec<Anchor>,
    /// Output of a run.
    #[serde(default)]
    pub output: Output,
    /// Camera of pictures.
    #[serde(default)]
    pub camera: Camera,
    /// Bounds that a run must keep; violating one ends the run with exit code 1.
    #[serde(default)]
    pub expect: Expect,
}

/// Scalar type of the engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// 32-bit numbers: fast, seven digits.
    #[default]
    Single,
    /// 64-bit numbers: for convergence studies and long orbits.
    Double,
}

/// Scope of bit-identity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Bits {
    /// Nothing: the same scene gives the same bits on every machine.
    #[default]
    Portable,
    /// Forces between all masses use the fastest arithmetic of the machine (fused, estimated roots): the same bits for any number of threads and
    /// after a restore, on machines with the same instruction set.
    Native,
}

/// The plane of a two-dimensional scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Plane {
    /// Seen from above.
    Xy,
    /// Seen from the front: gravity acts.
    #[default]
    Xz,
}

/// Frames and their rate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Time {
    /// Frames per second.
    #[schemars(extend("x-unit" = "1/s", "exclusiveMinimum" = 0.0))]
    pub fps: f64,
    /// Frames to simulate after the first.
    #[schemars(range(min = 1, max = 100_000_000))]
    pub frames: u32,
    /// Exchanges between systems per frame. Default: 1; where masses and rigid bodies touch, 240 a second.
    #[schemars(range(min = 1, max = 100_000))]
    pub exchanges: Option<u32>,
}

impl Default for Time {
    fn default() -> Self {
        Self { fps: 24.0, frames: 120, exchanges: None }
    }
}

/// Global settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WorldSettings {
    /// Gravity, z up; may change in time.
    #[schemars(extend("x-unit" = "m/s²"))]
    pub gravity: AnimatedVector,
    /// Memory limit: a scene that needs more is refused before allocation.
    #[schemars(extend("x-unit" = "GiB", "exclusiveMinimum" = 0.0))]
    pub memory_limit: f64,
    /// Repeats every exchange interval until its systems agree about the impulses between them. Default: each interval is taken once, and
    /// systems feel each other's reactions up to an interval late.
    pub coupling: Option<Coupling>,
}

impl Default for WorldSettings {
    fn default() -> Self {
        Self { gravity: [0.0, 0.0, -9.8].into(), memory_limit: 8.0, coupling: None }
    }
}

/// Repetition of exchange intervals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Coupling {
    /// Most passes through an interval.
    #[schemars(range(min = 2, max = 1000))]
    pub iterations: u32,
    /// Change of the impulses on a system from pass to pass, relative to them, at which systems agree.
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0, "maximum" = 1.0))]
    pub tolerance: f64,
}

impl Default for Coupling {
    fn default() -> Self {
        Self { iterations: 20, tolerance: 1e-3 }
    }
}

fn three() -> u8 {
    3
}

/// Every item of the list is > 0.
fn items_above_zero(schema: &mut schemars::Schema) {
    if let Some(items) = schema.get_mut("items").and_then(|i| i.as_object_mut()) {
        items.insert("exclusiveMinimum".into(), 0.0.into());
    }
}

impl Scene {
    /// The JSON Schema (draft 2020-12) of a scene, with units as `x-unit`.
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(Scene).into()
    }

    /// Checks and interprets a tree. Reports all errors of keys, types, units and ranges at once; conditions on several values (a pin on a missing
    /// corner) are checked when the world is built.
    pub fn from_tree(tree: &Node) -> Result<Scene, SceneError> {
        if tree.too_deep() {
            return Err(SceneError::one("", TOO_DEEP));
        }
        static SCHEMA: LazyLock<serde_json::Value> = LazyLock::new(Scene::schema);
        let issues = check(tree, &SCHEMA);
        if !issues.is_empty() {
            return Err(SceneError { issues });
        }
        let unreadable = |message: String| SceneError { issues: vec![Issue::new("", message)] };
        let json = tree.to_json().ok_or_else(|| unreadable("a number is not finite".into()))?;
        serde_json::from_value(json).map_err(|e| unreadable(e.to_string()))
    }

    /// Reads a scene from TOML text.
    pub fn from_toml(text: &str) -> Result<Scene, SceneError> {
        Self::from_tree(&Node::from_toml(text)?)
    }

    /// The scene as JSON, with all defaults filled in.
    pub fn to_json(&self) -> serde_json::Value {
        let mut full = self.clone();
        full.rope.iter_mut().filter(|o| o.rod.is_none()).for_each(|o| o.links = Some(o.links()));
        full.sheet.iter_mut().for_each(|o| o.links = Some(o.links()));
        full.net.iter_mut().for_each(|o| o.links = Some(o.links()));
        full.cloth.iter_mut().for_each(|o| o.links = Some(o.links()));
        serde_json::to_value(full).unwrap_or_default()
    }

    /// Duration of one frame [s].
    pub fn frame_time(&self) -> f64 {
        1.0 / self.time.fps
    }

    /// Exchanges between systems per frame, in a resolved scene.
    pub fn exchanges(&self) -> u32 {
        self.time.exchanges.unwrap_or(1)
    }

    /// Time from one exchange to the next [s].
    pub fn interval(&self) -> f64 {
        self.frame_time() / f64::from(self.exchanges())
    }

    /// References to fabric records, in order of appearance.
    pub fn fabrics_mut(&mut self) -> Vec<FabricRef<'_>> {
        let sheets = self.sheet.iter_mut().map(|o| ("sheet", &o.name, &mut o.fabric));
        let nets = self.net.iter_mut().map(|o| ("net", &o.name, &mut o.fabric));
        let cloths = self.cloth.iter_mut().map(|o| ("cloth", &o.name, &mut o.fabric));
        let all = sheets.chain(nets).chain(cloths);
        all.filter_map(|(kind, name, words)| Some(FabricRef { place: format!("{kind} \"{name}\".fabric"), words: words.as_mut()? }))
            .collect()
    }

    /// References to meshes, characters and guides, in order of appearance.
    pub fn mesh_files_mut(&mut self) -> Vec<MeshRef<'_>> {
        let one = MeshRef::mesh;
        let mut all: Vec<MeshRef<'_>> = Vec::new();
        all.extend(self.net.iter_mut().map(|n| one(format!("net \"{}\".mesh", n.name), &mut n.mesh)));
        for Hair { name, mesh, guides, .. } in &mut self.hair {
            all.extend(mesh.as_mut().map(|mesh| one(format!("hair \"{name}\".mesh"), mesh)));
            all.extend(guides.as_mut().map(|g| MeshRef {
                content: Content::Curves,
                place: format!("hair \"{name}\".guides"),
                path: &g.path,
                hash: &mut g.hash,
            }));
        }
        for Body { name, shape, .. } in &mut self.body {
            let files = shape.mesh_files_mut().into_iter();
            all.extend(files.map(|(key, mesh)| one(format!("body \"{name}\".shape{key}"), mesh)));
        }
        for Grains { name, fill, emit, .. } in &mut self.grains {
            for (k, fill) in fill.iter_mut().enumerate() {
                if let Some(Shape::Mesh(mesh)) = &mut fill.within {
                    all.push(one(format!("grains \"{name}\".fill[{k}].within.mesh"), mesh));
                }
            }
            all.extend(emit.as_mut().and_then(|emit| emit.from.mesh_mut(&format!("grains \"{name}\".emit.from"))));
        }
        for Liquid { name, fill, .. } in &mut self.liquid {
            for (k, fill) in fill.iter_mut().enumerate() {
                if let Shape::Mesh(mesh) = &mut fill.shape {
                    all.push(one(format!("liquid \"{name}\".fill[{k}].shape.mesh"), mesh));
                }
            }
        }
        for thing in &mut self.collider {
            let place = format!("collider \"{}\".shape", thing.name);
            match &mut thing.shape {
                Shape::Mesh(mesh) => all.push(one(format!("{place}.mesh"), mesh)),
                Shape::AnimatedMesh(mesh) => {
                    let frames = mesh.frames.iter_mut().enumerate();
                    all.extend(frames.map(|(i, f)| MeshRef {
                        content: Content::Mesh,
                        place: format!("{place}.animated_mesh.frames[{i}]"),
                        path: &f.path,
                        hash: &mut f.hash,
                    }));
                }
                Shape::Character(file) => {
                    all.push(MeshRef {
                        content: Content::Character,
                        place: format!("{place}.character"),
                        path: &file.path,
                        hash: &mut file.hash,
                    });
                }
                _ => {}
            }
        }
        for Emitter { name, from, kill, .. } in &mut self.emitter {
            all.extend(from.mesh_mut(&format!("emitter \"{name}\".from")));
            for (i, rule) in kill.iter_mut().enumerate() {
                match rule {
                    Kill::Inside(Shape::Mesh(mesh)) => all.push(one(format!("emitter \"{name}\".kill[{i}].inside.mesh"), mesh)),
                    Kill::Outside(Shape::Mesh(mesh)) => all.push(one(format!("emitter \"{name}\".kill[{i}].outside.mesh"), mesh)),
                    _ => {}
                }
            }
        }
        all
    }
}
