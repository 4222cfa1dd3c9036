//! From text and bytes to a world, within what a browser can hold.

use crate::engine::scene::{Camera, Sight, Simulation, looks, memory, resolve, set, set_text};
use crate::failure::Failure;
use serde::Serialize;
use std::collections::HashMap;
use std::sync::Arc;
use tumble_interface::engine::Engine;
use tumble_interface::tree::Node;
use tumble_interface::{Scene, SceneError};
use tumble_io::assets::{File, Files, assets};

/// Longest text of a scene [bytes].
const MOST_TEXT: usize = 8 << 20;
/// All meshes of a scene together [bytes].
const MOST_FILES: usize = 64 << 20;
/// Largest estimate of the memory of a scene [GiB]: a module can have four, and memory once taken is not given back.
const MOST_MEMORY: f64 = 1.5;

/// Most colliders: each is drawn by itself.
const MOST_COLLIDERS: usize = 2000;
/// Most mistakes that are told of.
const MOST_ISSUES: usize = 1000;

/// A scene, as it was given and as it moves.
pub struct Loaded {
    pub world: Simulation,
    node: Node,
    scene: Scene,
    camera: Camera,
    files: Given,
    memory: f64,
}

/// The files of a page.
type Given = Arc<HashMap<String, Arc<File>>>;

/// Those that a scene asks for, and which it misses.
struct Page {
    files: Given,
    missing: Vec<String>,
}

impl Files for Page {
    const RESTORE: &'static str = "give the old file";

    fn open(&mut self, path: &str) -> Result<Arc<File>, String> {
        self.files.get(path).cloned().ok_or_else(|| {
            self.missing.push(path.into());
            format!("there is no file \"{path}\"; drop it on the page")
        })
    }
}

/// The tree of a scene, in TOML or JSON, with its overrides.
pub fn tree(text: &str, overrides: &[String]) -> Result<Node, SceneError> {
    let mut node = if text.trim_start().starts_with('{') { Node::from_json(text)? } else { Node::from_toml(text)? };
    overrides.iter().try_for_each(|assignment| set_text(&mut node, assignment))?;
    Ok(node)
}

impl Loaded {
    pub fn new(toml: &str, overrides: &[String], files: Vec<(String, Vec<u8>)>) -> Result<Self, Failure> {
        if toml.len() > MOST_TEXT {
            let size = toml.len() >> 20;
            return Err(Failure::limit(format!("the text of the scene has {size} MiB, the limit here is {} MiB", MOST_TEXT >> 20)));
        }
        let size: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
        if size > MOST_FILES {
            return Err(Failure::limit(format!("the meshes have {} MiB, the limit here is {} MiB", size >> 20, MOST_FILES >> 20)));
        }
        let mut given = HashMap::new();
        for (path, bytes) in files {
            let file = File::new(&path, bytes);
            file.check(&path).map_err(|message| SceneError::one("", message))?;
            given.insert(path, Arc::new(file));
        }
        Self::build(tree(toml, overrides)?, Arc::new(given))
    }

    /// The same with another value at a path.
    pub fn changed(&self, path: &str, value: Node) -> Result<Self, Failure> {
        let mut node = self.node.clone();
        set(&mut node, path, value)?;
        Self::build(node, self.files.clone())
    }

    /// The same at its start.
    pub fn again(&self) -> Result<Self, Failure> {
        Self::build(self.node.clone(), self.files.clone())
    }

    fn build(node: Node, files: Given) -> Result<Self, Failure> {
        let lines = |error: SceneError| -> Failure { with_lines(error, &node).into() };
        let mut scene = Scene::from_tree(&node).map_err(lines)?;
        let colliders = scene.collider.len();
        if colliders > MOST_COLLIDERS {
            return Err(Failure::limit(format!(
                "the scene has {colliders} colliders, the limit in a browser is {MOST_COLLIDERS}; make one mesh of them, or run it with `tumble run`"
            )));
        }
        let mut page = Page { files, missing: Vec::new() };
        let assets = assets(&mut scene, &mut page).map_err(|error| lines(error).missing(page.missing))?;
        let scene = resolve(scene);
        let bytes = memory(&scene, &assets);
        let gibibytes = bytes / 1024.0_f64.powi(3);
        if gibibytes > MOST_MEMORY {
            return Err(Failure::limit(format!(
                "the scene needs about {gibibytes:.1} GiB, the limit in a browser is {MOST_MEMORY} GiB; lower a resolution, a count, a rate or a lifetime, or run it with `tumble run`"
            )));
        }
        let world = Simulation::new(scene.clone(), assets).map_err(lines)?;
        let camera = Camera::new(&scene.camera).map_err(lines)?;
        Ok(Self { world, node, scene, camera, files: page.files, memory: bytes })
    }

    /// Whether both are of scenes that say the same, defaults written out.
    pub fn is_same_scene(&self, other: &Self) -> bool {
        self.scene.to_json() == other.scene.to_json()
    }

    /// Duration of a frame and its number of exchanges.
    pub fn clock(&self) -> (f64, u32) {
        (self.scene.time.fps, self.scene.exchanges())
    }

    /// The camera at a time [s], if it moves.
    pub fn sight(&self, time: f64) -> Option<Sight> {
        (!self.camera.stands()).then(|| self.camera.at(time))
    }

    /// An error as it is thrown, with its lines.
    pub fn wrong(&self, error: SceneError) -> wasm_bindgen::JsValue {
        crate::thrown(with_lines(error, &self.node).into())
    }

    /// JSON of `SceneInfo`.
    pub fn info(&self) -> impl Serialize + '_ {
        let objects = self.scene.objects().into_iter();
        let objects = objects.map(|o| Object { name: o.name.into(), kind: o.kind, system: o.system.map(Into::into) });
        let colliders = self.scene.collider.iter().map(|c| Object { name: c.name.clone(), kind: "collider", system: None });
        let systems = self.scene.system.iter().map(|plan| System {
            name: plan.name.clone(),
            method: plan.method.name(),
            integrator: plan.integrator.name(),
        });
        Info {
            title: &self.scene.title,
            fps: self.scene.time.fps,
            frames: self.scene.time.frames,
            dt: self.scene.frame_time(),
            dimension: self.scene.dimension,
            plane: &self.scene.plane,
            precision: &self.scene.precision,
            objects: objects.chain(colliders).collect(),
            systems: systems.collect(),
            columns: &self.scene.output.columns,
            scene: self.scene.to_json(),
            warnings: self.world.warnings(),
            looks: looks(&self.scene),
            hash: format!("{:016x}", self.world.hash()),
            memory: self.memory,
        }
    }
}

#[derive(Serialize)]
struct Object {
    name: String,
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    system: Option<String>,
}

#[derive(Serialize)]
struct System {
    name: String,
    method: &'static str,
    integrator: &'static str,
}

#[derive(Serialize)]
struct Info<'a> {
    title: &'a str,
    fps: f64,
    frames: u32,
    dt: f64,
    dimension: u8,
    plane: &'a tumble_interface::scene::Plane,
    precision: &'a tumble_interface::scene::Precision,
    objects: Vec<Object>,
    systems: Vec<System>,
    columns: &'a [String],
    scene: serde_json::Value,
    warnings: &'a [tumble_interface::Warning],
    looks: tumble_interface::looks::Looks,
    hash: String,
    memory: f64,
}

fn with_lines(error: SceneError, node: &Node) -> SceneError {
    let mut error = node.located(error);
    // Nobody reads more, and texts of hostile scenes have millions.
    error.issues.truncate(MOST_ISSUES);
    error
}
