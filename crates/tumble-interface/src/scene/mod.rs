//! The scene: every word that a scene file may hold, with unit, default and range. These structs are the
//! schema; JSON Schema, the reference page and the Python stubs are generated from them.

mod animated;
mod cloth;
mod compressible;
mod emitters;
mod fabrics;
mod forces;
mod gas;
mod grids;
mod hair;
mod heat;
mod objects;
mod output;
mod shapes;
mod structures;
mod surfaces;
mod systems;
mod vicsek;

pub use animated::{Animated, AnimatedVector, Component, Interpolation, Keys, VectorKeys};
pub use cloth::{Cloth, Dress, Panel, Seam, Side};
pub use compressible::Compressible;
pub use emitters::{Between, Burst, Cause, Emitter, Event, Kill, Source, WhenFull};
pub use fabrics::{FabricRef, FabricUse, FabricWords};
pub use forces::{Anchor, Field, Force, Goal};
pub use gas::{
    Advections, Carriage, Densities, ExcessFlow, Fire, Gas, GasSide, GasSides, GasSource, GridInterpolation, Order, PathTrace, Pressure,
    PressureMethod, Smoke, Solid, Temperature, Viscous,
};
pub use grids::GridBox;
pub use hair::{Clump, Curl, Hair, HairCollisions};
pub use heat::{Heat, HeatRegion, HeatScheme, HeatSide, HeatSides, HeatSource};
pub use objects::{KINDS, Object};
pub use output::{Camera, Expect, Look, Output, Probe};
pub use shapes::{Collider, Figure, Mannequin, MeshFile, MeshFrame, MeshFrames, MeshRef, Motion, Moves, Pace, Pose, Shape};
pub use structures::{
    Block, Cloud, CloudShape, Diagonals, Follow, Galaxy, Halo, Link, LinkSettings, Links, Material, Net, Particles, Pattern, Pin, Profile,
    Region, Rod, Rope, Sheet, Spring,
};
pub use surfaces::{Fill, Fluid, Inflation, Membrane, ShapeMatching, Tear, Weak};
pub use systems::{Adaptive, Hessian, Integrator, Linear, Method, OnFailure, PositionBased, Projection, SelfContact, Solver, System};
pub use vicsek::Vicsek;

use crate::check::check;
use crate::error::{Issue, SceneError};
use crate::tree::{Node, TOO_DEEP};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// A whole simulation: what is there, how it moves, what is written out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Version of the scene language; this is 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// One line for people.
    #[serde(default)]
    pub title: String,
    /// Seed of every random number.
    #[serde(default)]
    pub seed: u32,
    /// Scalar type of the engine.
    #[serde(default)]
    pub precision: Precision,
    /// What may differ from machine to machine.
    #[serde(default)]
    pub bits: Bits,
    /// 2 keeps everything in `plane`; 3 is space.
    #[serde(default = "three")]
    #[schemars(range(min = 2, max = 3))]
    pub dimension: u8,
    /// The plane of a two-dimensional scene.
    #[serde(default)]
    pub plane: Plane,
    /// Frames and their rate.
    #[serde(default)]
    pub time: Time,
    /// What acts everywhere.
    #[serde(default)]
    pub world: WorldSettings,
    /// Numerical methods; without any, each method that objects need has one system, named `main` (`dynamics`) or as the method.
    #[serde(default)]
    pub system: Vec<System>,
    /// Free masses and springs between them, listed one by one.
    #[serde(default)]
    pub particles: Vec<Particles>,
    /// Sources of particles that are born and die.
    #[serde(default)]
    pub emitter: Vec<Emitter>,
    /// Chains of springs, or rods.
    #[serde(default)]
    pub rope: Vec<Rope>,
    /// Strands planted on surfaces.
    #[serde(default)]
    pub hair: Vec<Hair>,
    /// Lattices of springs in a rectangle.
    #[serde(default)]
    pub sheet: Vec<Sheet>,
    /// Lattices of springs, or tetrahedra, in a box.
    #[serde(default)]
    pub block: Vec<Block>,
    /// Springs along the edges of any mesh.
    #[serde(default)]
    pub net: Vec<Net>,
    /// Cloth cut from panels and sewn.
    #[serde(default)]
    pub cloth: Vec<Cloth>,
    /// Stars, placed at random and set going so that they hold together; needs a force of gravitation.
    #[serde(default)]
    pub galaxy: Vec<Galaxy>,
    /// Bodies that conduct heat.
    #[serde(default)]
    pub heat: Vec<Heat>,
    /// Gases that sound runs through.
    #[serde(default)]
    pub compressible: Vec<Compressible>,
    /// Fluids that fill a box, moved by systems of method `gas`.
    #[serde(default)]
    pub gas: Vec<Gas>,
    /// Forces on the masses of `dynamics` systems.
    #[serde(default)]
    pub force: Vec<Force>,
    /// Velocity fields that carry the particles of `tracers` systems.
    #[serde(default)]
    pub field: Vec<Field>,
    /// Solid things that masses cannot enter.
    #[serde(default)]
    pub collider: Vec<Collider>,
    /// Springs between objects, also of different systems.
    #[serde(default)]
    pub anchor: Vec<Anchor>,
    /// What a run writes.
    #[serde(default)]
    pub output: Output,
    /// From where pictures are taken.
    #[serde(default)]
    pub camera: Camera,
    /// Bounds that a run must keep; a run that breaks one ends with exit code 1.
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
    /// 64-bit numbers: for orders of convergence and long orbits.
    Double,
}

/// What may differ from machine to machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Bits {
    /// Nothing: the same scene gives the same bits on every machine.
    #[default]
    Portable,
    /// Forces between all masses use the fastest arithmetic of the machine (fused, estimated roots): the same bits on any
    /// count of threads and after restoring, on machines with the same instructions.
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
    /// Exchanges between systems per frame.
    #[schemars(range(min = 1, max = 100_000))]
    pub exchanges: u32,
}

impl Default for Time {
    fn default() -> Self {
        Self { fps: 24.0, frames: 120, exchanges: 1 }
    }
}

/// What acts everywhere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WorldSettings {
    /// Gravity, z up.
    #[schemars(extend("x-unit" = "m/s²"))]
    pub gravity: [f64; 3],
    /// A scene that would need more memory than this is refused before any is taken.
    #[schemars(extend("x-unit" = "GiB", "exclusiveMinimum" = 0.0))]
    pub memory_limit: f64,
}

impl Default for WorldSettings {
    fn default() -> Self {
        Self { gravity: [0.0, 0.0, -9.8], memory_limit: 8.0 }
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

    /// Checks a tree and gives it meaning. Reports everything wrong with the words, types, units and ranges at once;
    /// what depends on several values together (a pin on a missing corner) is checked when the world is built.
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

    /// The scene as JSON, every default written out.
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

    /// Records of fabrics that the scene names, in order of appearance.
    pub fn fabrics_mut(&mut self) -> Vec<FabricRef<'_>> {
        let sheets = self.sheet.iter_mut().map(|o| ("sheet", &o.name, &mut o.fabric));
        let nets = self.net.iter_mut().map(|o| ("net", &o.name, &mut o.fabric));
        let cloths = self.cloth.iter_mut().map(|o| ("cloth", &o.name, &mut o.fabric));
        let all = sheets.chain(nets).chain(cloths);
        all.filter_map(|(kind, name, words)| Some(FabricRef { place: format!("{kind} \"{name}\".fabric"), words: words.as_mut()? }))
            .collect()
    }

    /// Meshes and characters that the scene names, in order of appearance.
    pub fn mesh_files_mut(&mut self) -> Vec<MeshRef<'_>> {
        fn one(place: String, file: &mut MeshFile) -> MeshRef<'_> {
            MeshRef { skinned: false, place, path: &file.path, hash: &mut file.hash }
        }
        let mut all: Vec<MeshRef<'_>> = Vec::new();
        all.extend(self.net.iter_mut().map(|n| one(format!("net \"{}\".mesh", n.name), &mut n.mesh)));
        for Hair { name, mesh, .. } in &mut self.hair {
            all.extend(mesh.as_mut().map(|mesh| one(format!("hair \"{name}\".mesh"), mesh)));
        }
        for thing in &mut self.collider {
            let place = format!("collider \"{}\".shape", thing.name);
            match &mut thing.shape {
                Shape::Mesh(mesh) => all.push(one(format!("{place}.mesh"), mesh)),
                Shape::AnimatedMesh(mesh) => {
                    let frames = mesh.frames.iter_mut().enumerate();
                    all.extend(frames.map(|(i, f)| MeshRef {
                        skinned: false,
                        place: format!("{place}.animated_mesh.frames[{i}]"),
                        path: &f.path,
                        hash: &mut f.hash,
                    }));
                }
                Shape::Character(file) => {
                    all.push(MeshRef { skinned: true, place: format!("{place}.character"), path: &file.path, hash: &mut file.hash });
                }
                _ => {}
            }
        }
        for Emitter { name, from, kill, .. } in &mut self.emitter {
            match from {
                Source::MeshSurface(mesh) => all.push(one(format!("emitter \"{name}\".from.mesh_surface"), mesh)),
                Source::MeshVolume(mesh) => all.push(one(format!("emitter \"{name}\".from.mesh_volume"), mesh)),
                _ => {}
            }
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
