//! World: a scene in motion.

use crate::arrays;
use crate::errors::{ExportError, scene_error, step_error};
use crate::scene::Scene;
use crate::user;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;
use tumble_interface::engine::{Engine, StepReport};
use tumble_interface::scene::Precision;
use tumble_interface::{Column, SceneError, StepError};

/// How often a long call looks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// A scene in motion.
#[pyclass(module = "tumble")]
pub struct World {
    scene: Py<Scene>,
    engine: Box<dyn Engine + Sync>,
    pool: Option<Arc<rayon::ThreadPool>>,
    /// Exceptions of custom functions.
    raised: user::Raised,
}

/// Works without the interpreter, on the world's threads; Ctrl-C makes `go_on` say no and is raised.
fn work<T: Send>(
    py: Python<'_>,
    pool: Option<&Arc<rayon::ThreadPool>>,
    task: impl FnOnce(&(dyn Fn() -> bool + Sync)) -> T + Send,
) -> PyResult<T> {
    let stop = AtomicBool::new(false);
    let go_on = || !stop.load(Ordering::Relaxed);
    let (result, interrupt) = py.detach(|| {
        std::thread::scope(|scope| {
            let (sender, receiver) = channel();
            let go_on = &go_on;
            scope.spawn(move || {
                let result = match pool {
                    Some(pool) => pool.install(|| task(go_on)),
                    None => task(go_on),
                };
                let _ = sender.send(result);
            });
            let mut interrupt = None;
            loop {
                match receiver.recv_timeout(LOOK) {
                    Ok(result) => return (Some(result), interrupt),
                    Err(RecvTimeoutError::Timeout) if interrupt.is_none() => {
                        interrupt = crate::interrupted();
                        stop.store(interrupt.is_some(), Ordering::Relaxed);
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => return (None, interrupt),
                }
            }
        })
    });
    match (result, interrupt) {
        (_, Some(interrupt)) => Err(interrupt),
        (Some(result), None) => Ok(result),
        (None, None) => Err(pyo3::exceptions::PyRuntimeError::new_err("the engine's thread ended without a result")),
    }
}

fn thread_pool(py: Python<'_>, threads: Option<usize>) -> PyResult<Option<Arc<rayon::ThreadPool>>> {
    let Some(threads) = threads else { return Ok(None) };
    if !(1..=1024).contains(&threads) {
        return Err(scene_error(py, &SceneError::one("threads", format!("{threads}, expected >= 1 and <= 1024"))));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| scene_error(py, &SceneError::one("threads", format!("{threads} threads cannot be started: {e}"))))?;
    Ok(Some(Arc::new(pool)))
}

fn build(py: Python<'_>, scene: &Scene, pool: Option<&Arc<rayon::ThreadPool>>) -> PyResult<Box<dyn Engine + Sync>> {
    let (words, assets) = (scene.scene.clone(), scene.assets.clone());
    let built = work(py, pool, |_| -> Result<Box<dyn Engine + Sync>, SceneError> {
        Ok(match words.precision {
            Precision::Single => Box::new(tumble::scene::Simulation::new(words, assets)?),
            Precision::Double => Box::new(tumble_f64::scene::Simulation::new(words, assets)?),
        })
    })?;
    built.map_err(|e| scene.error(py, e))
}

impl World {
    /// The system of that name, or the first.
    fn system(&self, name: Option<String>) -> String {
        name.unwrap_or_else(|| self.engine.systems().into_iter().next().unwrap_or_default())
    }

    fn output_columns(&self, py: Python<'_>) -> Vec<Column> {
        let scene = self.scene.bind(py).get();
        let names: Vec<&str> = scene.scene.output.columns.iter().map(String::as_str).collect();
        self.engine.frame(&names).columns
    }
}

#[pymethods]
impl World {
    #[new]
    #[pyo3(signature = (scene, threads=None))]
    fn new(py: Python<'_>, scene: &Bound<'_, PyAny>, threads: Option<usize>) -> PyResult<Self> {
        let scene: Py<Scene> = match scene.cast::<Scene>() {
            Ok(scene) => scene.clone().unbind(),
            Err(_) => py.get_type::<Scene>().call1((scene,))?.cast_into::<Scene>()?.unbind(),
        };
        let pool = thread_pool(py, threads)?;
        let engine = build(py, scene.bind(py).get(), pool.as_ref())?;
        Ok(Self { scene, engine, pool, raised: user::Raised::default() })
    }

    #[getter]
    fn scene(&self, py: Python<'_>) -> Py<Scene> {
        self.scene.clone_ref(py)
    }

    /// Simulated time [s].
    #[getter]
    fn time(&self) -> f64 {
        self.engine.time()
    }

    /// Frames simulated so far.
    #[getter]
    fn frame_index(&self) -> u64 {
        self.engine.frame_index()
    }

    /// Names of the systems.
    #[getter]
    fn systems(&self) -> Vec<String> {
        self.engine.systems()
    }

    /// Warnings about the scene: code (as listed in docs/warnings.md), path and message of each.
    #[getter]
    fn warnings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize::pythonize(py, self.engine.warnings())?)
    }

    /// Simulates frames; returns what they took. Releases the GIL; Ctrl-C goes back to the last frame and raises
    /// KeyboardInterrupt. Raises StepError.
    #[pyo3(signature = (frames=1))]
    fn step<'py>(&mut self, py: Python<'py>, frames: u64) -> PyResult<Bound<'py, PyAny>> {
        let mut total = StepReport::default();
        for _ in 0..frames {
            let (engine, pool) = (&mut self.engine, self.pool.as_ref());
            match work(py, pool, |go_on| engine.step(go_on))? {
                Ok(Some(report)) => total.add_interval(&report),
                Ok(None) => {}
                Err(error) => {
                    let exception = step_error(py, &error);
                    // A user's function may have caught what another raised, and gone on.
                    let raised = self.raised.take();
                    if matches!(error, StepError::User(_)) {
                        exception.set_cause(py, raised);
                    }
                    return Err(exception);
                }
            }
        }
        Ok(pythonize::pythonize(py, &total)?)
    }

    /// The columns that the scene's `output.columns` names, of every object that has them.
    #[getter]
    fn frame<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        arrays::columns(py, self.output_columns(py))
    }

    /// The named columns, of every object that has them; `tumble.columns.COLUMNS` describes each.
    #[pyo3(signature = (*names))]
    fn columns<'py>(&self, py: Python<'py>, names: Vec<String>) -> PyResult<Bound<'py, PyDict>> {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        arrays::columns(py, self.engine.frame(&names).columns)
    }

    /// The named columns after so many sub-steps of the next frame, all systems in turn; the world itself stays where it
    /// is. Systems whose turn has not come are still at the start of their interval. Returns (columns, about) with about:
    /// system and step [s] of the last sub-step, time [s], ledger; None where the frame has no more sub-steps. Raises
    /// StepError for a sub-step that breaks.
    #[pyo3(signature = (substeps, *names))]
    fn inside<'py>(
        &mut self,
        py: Python<'py>,
        substeps: u64,
        names: Vec<String>,
    ) -> PyResult<Option<(Bound<'py, PyDict>, Bound<'py, PyDict>)>> {
        if substeps == 0 {
            return Err(scene_error(py, &SceneError::one("substeps", "0, expected >= 1")));
        }
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let (engine, pool) = (&mut self.engine, self.pool.as_ref());
        let seen = work(py, pool, |go_on| engine.inside(substeps, &names, go_on))?;
        let Some(inside) = seen.map_err(|error| step_error(py, &error))? else { return Ok(None) };
        let about = PyDict::new(py);
        about.set_item("system", &inside.system)?;
        about.set_item("step", inside.step)?;
        about.set_item("time", inside.frame.time)?;
        about.set_item("ledger", pythonize::pythonize(py, &inside.ledger)?)?;
        Ok(Some((arrays::columns(py, inside.frame.columns)?, about)))
    }

    /// Units of all columns: object -> column -> SI unit.
    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let mut all = self.output_columns(py);
        all.extend(self.engine.topology());
        arrays::units(py, &all)
    }

    /// Constant columns; `tumble.columns.COLUMNS` describes each. Of moving colliders frames hold translation and turn,
    /// x = turn p + translation, or position of vertices that move by themselves.
    #[getter]
    fn topology<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        arrays::columns(py, self.engine.topology())
    }

    /// The ledger, now; `tumble.measures.LEDGER` describes each number.
    #[getter]
    fn ledger<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (engine, pool) = (&self.engine, self.pool.as_ref());
        let ledger = work(py, pool, |_| engine.ledger())?;
        Ok(pythonize::pythonize(py, &ledger)?)
    }

    /// Breakdown of the ledger, and the places of its worst numbers: `systems` as (name, ledger), `shares` with system,
    /// object and ledger, `worst` with measure (a number of the ledger), value, object, other, particles, id, cell. For the
    /// moment when a bound is broken: it takes longer than the ledger.
    fn account<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (engine, pool) = (&self.engine, self.pool.as_ref());
        let account = work(py, pool, |_| engine.account())?;
        Ok(pythonize::pythonize(py, &account)?)
    }

    /// Hash of everything that the next step depends on, 16 hexadecimal digits.
    fn hash(&self) -> String {
        format!("{:016x}", self.engine.hash())
    }

    /// Writes a checkpoint (safetensors, the scene inside). Raises ExportError, whose cause is the system's OSError.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let scene = self.scene.bind(py).get();
        // One text: several would be written in no fixed order.
        let folder = scene.folder.display().to_string();
        let about = serde_json::json!({ "version": env!("CARGO_PKG_VERSION"), "scene": scene.scene.to_json(), "folder": folder });
        let bytes = self.engine.save(&[("tumble", &about.to_string())]);
        py.detach(|| std::fs::write(&path, bytes)).map_err(|e| {
            let error = ExportError::new_err(format!("\"{}\" cannot be written: {e}", path.display()));
            // The system's number, from which Python knows its kind.
            error.set_cause(py, Some(pyo3::exceptions::PyOSError::new_err((e.raw_os_error(), e.to_string()))));
            error
        })
    }

    /// The world of a checkpoint. Raises SceneError.
    #[staticmethod]
    #[pyo3(signature = (path, threads=None))]
    fn restore(py: Python<'_>, path: PathBuf, threads: Option<usize>) -> PyResult<Self> {
        let bytes = read(py, &path)?;
        let about = tumble::world::about(&bytes).unwrap_or_default();
        let about: Option<serde_json::Value> = about.get("tumble").and_then(|text| serde_json::from_str(text).ok());
        let Some((scene, folder)) = about.as_ref().and_then(|about| Some((about.get("scene")?, about.get("folder")?.as_str()?))) else {
            return Err(scene_error(py, &SceneError::one("", format!("\"{}\" is no checkpoint", path.display()))));
        };
        let scene = py.get_type::<Scene>().call1((pythonize::pythonize(py, scene)?, folder))?;
        let mut world = Self::new(py, &scene, threads)?;
        world.engine.restore(&bytes).map_err(|e| scene_error(py, &e))?;
        Ok(world)
    }

    /// Goes to a checkpoint of the same scene. Raises SceneError; the world then stays as it was.
    fn load(&mut self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let bytes = read(py, &path)?;
        self.engine.restore(&bytes).map_err(|e| scene_error(py, &e))
    }

    /// After the state of another scene was loaded: what was chosen from that scene, as how many sub-steps an interval
    /// gets and what energies are measured against, is chosen anew from the state as it is now.
    fn reconsider(&mut self) {
        self.engine.reconsider();
    }

    /// For each system, from its stiffest mode as it is now: system, integrator, step [s], frequency [rad/s], damping,
    /// damping_max [1/s], culprit (object, index), limits (integrator, stable [s], usable [s]).
    fn stability<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (engine, pool) = (&mut self.engine, self.pool.as_ref());
        let all = work(py, pool, |go_on| engine.stability(go_on))?;
        Ok(pythonize::pythonize(py, &all)?)
    }

    /// After a StepError: changes that were tried from the last good frame: set, survived, energy_ratio.
    fn cures<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (engine, pool) = (&mut self.engine, self.pool.as_ref());
        let all = work(py, pool, |go_on| engine.cures(go_on))?;
        Ok(pythonize::pythonize(py, &all)?)
    }

    /// Adds a force: force(t, x, v, mass) -> n x 3 [N], from x [m] and v [m/s], n x 3, and mass [kg], n.
    #[pyo3(signature = (force, system=None))]
    fn add_force(&mut self, py: Python<'_>, force: Py<PyAny>, system: Option<String>) -> PyResult<()> {
        callable(py, &force, "force")?;
        let system = self.system(system);
        self.engine.add_force(&system, Box::new(user::Force(force, self.raised.clone()))).map_err(|e| scene_error(py, &e))
    }

    /// Steps with step(t, h, x, v, acceleration) -> (x, v), where acceleration(t, x, v) -> n x 3 [m/s²].
    #[pyo3(signature = (step, system=None))]
    fn set_integrator(&mut self, py: Python<'_>, step: Py<PyAny>, system: Option<String>) -> PyResult<()> {
        callable(py, &step, "step")?;
        let system = self.system(system);
        self.engine.replace_integrator(&system, Box::new(user::Integrator(step, self.raised.clone()))).map_err(|e| scene_error(py, &e))
    }

    /// Sets position [m] or velocity [m/s], n x 3, of an object. Raises SceneError.
    fn write(&mut self, py: Python<'_>, object: &str, column: &str, values: &Bound<'_, PyAny>) -> PyResult<()> {
        let array = py.import("numpy")?.call_method1("ascontiguousarray", (values, "float64"))?;
        let values: Vec<f64> = array.call_method0("ravel")?.extract()?;
        self.engine.write(object, column, &values).map_err(|e| scene_error(py, &e))
    }

    fn __repr__(&self) -> String {
        format!("World(frame={}, time={})", self.engine.frame_index(), self.engine.time())
    }
}

fn callable(py: Python<'_>, value: &Py<PyAny>, what: &str) -> PyResult<()> {
    if value.bind(py).is_callable() {
        return Ok(());
    }
    Err(pyo3::exceptions::PyTypeError::new_err(format!("{what} must be callable")))
}

fn read(py: Python<'_>, path: &std::path::Path) -> PyResult<Vec<u8>> {
    std::fs::read(path).map_err(|e| scene_error(py, &SceneError::one("", crate::errors::file_error(path, &e))))
}
