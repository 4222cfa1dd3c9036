//! The binding for browsers: a scene as text in, columns out as typed arrays, everything else as JSON. No physics.

mod arrays;
mod failure;
mod load;

#[cfg(not(feature = "double"))]
use tumble as engine;
#[cfg(feature = "double")]
use tumble_f64 as engine;

use engine::scene::hand::{self, Hand, Held};
use failure::Failure;
use load::Loaded;
use serde::Serialize;
use tumble_interface::SceneError;
use tumble_interface::engine::Engine;
use tumble_interface::tree::Node;
use wasm_bindgen::prelude::*;

/// Results as JSON, or errors.
type Answer<T> = Result<T, JsValue>;

#[wasm_bindgen]
extern "C" {
    /// The browser's clock [ms].
    #[wasm_bindgen(js_namespace = performance)]
    fn now() -> f64;
}

/// Keeps what a panic says where the worker finds it; the module is dead after one.
#[wasm_bindgen(start)]
fn start() {
    std::panic::set_hook(Box::new(|panic| {
        let _ = js_sys::Reflect::set(&js_sys::global(), &"tumblePanic".into(), &panic.to_string().into());
    }));
}

/// Version of the engine.
#[wasm_bindgen]
pub fn version() -> String {
    env!("CARGO_PKG_VERSION").into()
}

/// JSON Schema of scenes; units are under "x-unit".
#[wasm_bindgen]
pub fn schema() -> String {
    tumble_interface::Scene::schema().to_string()
}

/// `single` or `double`: which of the two modules a scene needs. Of a scene with faults `single`, which tells them.
#[wasm_bindgen]
pub fn precision(toml: &str, overrides: Vec<String>) -> String {
    let asked = load::tree(toml, &overrides).ok().and_then(|node| node.text("precision").map(str::to_string));
    asked.filter(|precision| precision == "double").unwrap_or_else(|| "single".into())
}

/// A scene in motion.
#[wasm_bindgen]
pub struct World {
    loaded: Loaded,
    hand: Hand,
}

#[wasm_bindgen]
impl World {
    /// Checks and builds a scene; `files` holds its meshes, path -> Uint8Array. Throws a failure as JSON.
    #[wasm_bindgen(constructor)]
    pub fn new(toml: &str, overrides: Vec<String>, files: &js_sys::Map) -> Answer<World> {
        let mut meshes = Vec::new();
        for entry in files.entries() {
            let Ok(pair) = entry else { continue };
            let pair = js_sys::Array::from(&pair);
            if let (Some(path), Ok(bytes)) = (pair.get(0).as_string(), pair.get(1).dyn_into::<js_sys::Uint8Array>()) {
                meshes.push((path, bytes.to_vec()));
            }
        }
        let loaded = Loaded::new(toml, &overrides, meshes).map_err(thrown)?;
        Ok(World { loaded, hand: Hand::default() })
    }

    /// JSON of `SceneInfo`, without the topology.
    pub fn info(&self) -> String {
        json(&self.loaded.info())
    }

    /// object -> column -> { data, width, points, unit } of what does not change.
    pub fn topology(&self) -> js_sys::Object {
        arrays::columns(self.loaded.world.topology())
    }

    /// The named columns now.
    pub fn columns(&self, names: Vec<String>) -> js_sys::Object {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        arrays::columns(self.loaded.world.frame(&names).columns)
    }

    /// Simulates a frame; JSON of its report. Throws a failure as JSON, also when it takes longer than `limit` [ms]; the world then stands
    /// at its last good frame.
    pub fn step(&mut self, limit: f64) -> Answer<String> {
        let end = now() + limit;
        match self.loaded.world.step(&|| now() < end) {
            Ok(Some(mut report)) => {
                report.trials.truncate(MOST_TRIALS);
                Ok(json(&report))
            }
            Ok(None) => Err(thrown(Failure::limit(format!(
                "a frame takes longer than {:.0} s here; take fewer sub-steps, a larger step or a lower resolution, or run the scene with `tumble run`",
                limit / 1000.0
            )))),
            Err(error) => Err(thrown(Failure::step(&error))),
        }
    }

    /// Looks at the named columns after so many sub-steps of the next frame, without going there; `null` where the frame has no more.
    /// { columns, about: JSON of system, step [s], time [s] and ledger }. Throws a failure as JSON.
    pub fn inside(&mut self, substeps: f64, names: Vec<String>, limit: f64) -> Answer<Option<js_sys::Object>> {
        let end = now() + limit;
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        match self.loaded.world.inside(substeps.max(1.0) as u64, &names, &|| now() < end) {
            Ok(Some(inside)) => {
                let about = serde_json::json!({
                    "system": inside.system,
                    "step": inside.step,
                    "time": inside.frame.time,
                    "ledger": inside.ledger,
                });
                Ok(Some(arrays::with_columns(inside.frame.columns, &about.to_string())))
            }
            Ok(None) => Ok(None),
            Err(error) => Err(thrown(Failure::step(&error))),
        }
    }

    /// Frames simulated so far.
    pub fn index(&self) -> f64 {
        self.loaded.world.frame_index() as f64
    }

    /// Simulated time [s].
    pub fn time(&self) -> f64 {
        self.loaded.world.time()
    }

    /// The scene's camera at a time [s]: JSON of position, target and angle of view, each as far as the scene says it; `null` if it stands.
    pub fn sight(&self, time: f64) -> String {
        json(&self.loaded.sight(time))
    }

    /// The ledger now, as JSON.
    pub fn ledger(&self) -> String {
        json(&self.loaded.world.ledger())
    }

    /// Hash of everything that the next step depends on.
    pub fn hash(&self) -> String {
        format!("{:016x}", self.loaded.world.hash())
    }

    /// Everything that the next step depends on.
    pub fn save(&self) -> Vec<u8> {
        self.loaded.world.save(&[])
    }

    /// Goes to a state of this scene, where nothing is held.
    pub fn restore(&mut self, bytes: &[u8]) -> Answer<()> {
        if self.hand.is_known() {
            // A force once added stays, and masses that feel one are stepped in another order: a world without it is made.
            self.loaded = self.loaded.again().map_err(thrown)?;
            self.hand = Hand::default();
        }
        self.loaded.world.restore(bytes).map_err(|e| self.loaded.wrong(e))
    }

    /// Overrides a value, given as JSON, and goes on from the state as it is; `false` if the state does not fit the changed scene, which
    /// then stands at its start.
    pub fn set(&mut self, path: &str, value: &str) -> Answer<bool> {
        let value: serde_json::Value =
            serde_json::from_str(value).map_err(|e| thrown(SceneError::one(path, format!("no value: {e}")).into()))?;
        let mut changed = self.loaded.changed(path, Node::from_value(&value)).map_err(thrown)?;
        let fits = changed.clock() == self.loaded.clock() && changed.world.restore(&self.loaded.world.save(&[])).is_ok();
        // The same value is no change: the world goes on as it would have, bit by bit.
        if fits && !changed.is_same_scene(&self.loaded) {
            changed.world.reconsider();
        }
        self.loaded = changed;
        self.hand = Hand::default();
        Ok(fits)
    }

    /// The stability estimates, as JSON, of those systems for which they are made within `limit` [ms].
    pub fn stability(&mut self, limit: f64) -> String {
        let end = now() + limit;
        json(&self.loaded.world.stability(&|| now() < end))
    }

    /// After a failed step: changes that were tried from the last good frame, as JSON. Ends after `limit` [ms].
    pub fn cures(&mut self, limit: f64) -> String {
        let end = now() + limit;
        json(&self.loaded.world.cures(&|| now() < end))
    }

    /// Pulls a mass, and those around it, to a point with a spring [N/m].
    pub fn grab(&mut self, object: &str, row: usize, target: Vec<f64>, stiffness: Option<f64>) -> Answer<()> {
        let target = point("target", &target)?;
        if self.hand.drag(object, row, target) {
            return Ok(());
        }
        let end = now() + GRAB_LIMIT;
        let (system, held) =
            Held::new(&mut self.loaded.world, object, row, target, stiffness, &|| now() < end).map_err(|e| self.loaded.wrong(e))?;
        if self.hand.take(&system, held) {
            self.loaded.world.add_force(&system, self.hand.force(&system)).map_err(|e| self.loaded.wrong(e))?;
        }
        Ok(())
    }

    /// Lets go.
    pub fn release(&mut self) {
        self.hand.release();
    }

    /// Adds to the velocity [m/s] and the density [kg/m³] of a gas around a point, falling off as a Gaussian of `radius` [m].
    pub fn stir(&mut self, gas: &str, position: Vec<f64>, velocity: Vec<f64>, radius: f64, density: f64) -> Answer<()> {
        let (position, velocity) = (point("position", &position)?, point("velocity", &velocity)?);
        hand::stir(&mut self.loaded.world, gas, position, velocity, radius, density).map_err(|e| self.loaded.wrong(e))
    }
}

/// Milliseconds for the estimate of how stiff a hand may be.
const GRAB_LIMIT: f64 = 1000.0;

/// Tried steps of adaptive integrators that go out.
const MOST_TRIALS: usize = 4096;

fn point(what: &str, numbers: &[f64]) -> Answer<[f64; 3]> {
    match numbers {
        [x, y, z] if numbers.iter().all(|x| x.is_finite()) => Ok([*x, *y, *z]),
        _ => Err(thrown(SceneError::one(what, "expected three finite numbers").into())),
    }
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_else(|_| "null".into())
}

fn thrown(failure: Failure) -> JsValue {
    json(&failure).into()
}
