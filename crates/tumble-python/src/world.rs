//! World: a scene in motion.

use crate::arguments::{unknown, whole};
use crate::arrays;
use crate::errors::{ExportError, scene_error, step_error};
use crate::scene::Scene;
use crate::user;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList, PyType};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use tumble_interface::check::suggestion;
use tumble_interface::columns::COLUMNS;
use tumble_interface::engine::{Engine, StepReport};
use tumble_interface::scene::{Precision, Shape};
use tumble_interface::{Column, Issue, SceneError, StepError};

/// How often a long call looks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// A scene in motion.
#[pyclass(module = "tumble")]
pub struct World {
    scene: Py<Scene>,
    engine: Box<dyn Engine + Sync>,
    pool: Option<Arc<rayon::ThreadPool>>,
    threads: Option<usize>,
    /// Custom functions, in the order in which they were added.
    custom: Vec<Custom>,
    /// Exceptions of those.
    raised: user::Raised,
    /// What solvers failed to solve so far.
    unsolved: Unsolved,
    /// Whether an explosion is an error.
    stops: bool,
}

/// A force or an integrator of a user, which no file holds.
struct Custom {
    integrator: bool,
    system: String,
    function: Py<PyAny>,
    /// Of a force, what tells its derivatives.
    jacobian: Option<Py<PyAny>>,
}

impl Custom {
    fn what(&self) -> &'static str {
        if self.integrator { "integrator" } else { "force" }
    }

    /// As in a checkpoint.
    fn told(&self, py: Python<'_>) -> Told {
        let name = |f: &Py<PyAny>| user::name_of(f.bind(py));
        let (what, system, jacobian) = (self.what().into(), self.system.clone(), self.jacobian.as_ref().map(name));
        Told { what, system, name: name(&self.function), jacobian }
    }
}

/// What is said of a custom function where the function itself cannot be.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
struct Told {
    what: String,
    system: String,
    name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    jacobian: Option<String>,
}

impl std::fmt::Display for Told {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the {} {} on system \"{}\"", self.what, self.name, self.system)?;
        self.jacobian.iter().try_for_each(|jacobian| write!(f, " with jacobian {jacobian}"))
    }
}

/// Those of `all` that are not among `others`, in words.
fn lacking(all: &[Told], others: &[Told]) -> String {
    let mut others = others.to_vec();
    let missing = all.iter().filter(|told| match others.iter().position(|other| other == *told) {
        Some(i) => {
            others.swap_remove(i);
            false
        }
        None => true,
    });
    missing.map(Told::to_string).collect::<Vec<_>>().join(" and ")
}

/// Steps, those of them whose solver missed its tolerance, and the largest residual of those.
#[derive(Clone, Copy, Default)]
struct Unsolved {
    steps: u64,
    unconverged: u64,
    residual: f64,
}

/// Works without the interpreter, on the world's threads; Ctrl-C makes `go_on` say no and is raised.
fn work<T: Send>(
    py: Python<'_>,
    pool: Option<&Arc<rayon::ThreadPool>>,
    task: impl FnOnce(&(dyn Fn() -> bool + Sync)) -> T + Send,
) -> PyResult<T> {
    work_until(py, pool, None, task)
}

/// The same, until a time, after which it raises TimeoutError.
fn work_until<T: Send>(
    py: Python<'_>,
    pool: Option<&Arc<rayon::ThreadPool>>,
    end: Option<Instant>,
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
                        let late = end.is_some_and(|end| Instant::now() > end);
                        let late = late.then(|| pyo3::exceptions::PyTimeoutError::new_err("the time allowed was over"));
                        interrupt = crate::interrupted().or(late);
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

/// So many seconds from now; `None` for ever.
fn end_after(patience: Option<f64>) -> Option<Instant> {
    Instant::now().checked_add(Duration::try_from_secs_f64(patience?.max(0.0)).ok()?)
}

fn thread_pool(py: Python<'_>, threads: Option<usize>) -> PyResult<Option<Arc<rayon::ThreadPool>>> {
    let Some(threads) = threads else { return Ok(None) };
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

    fn told(&self, py: Python<'_>) -> Vec<Told> {
        self.custom.iter().map(|custom| custom.told(py)).collect()
    }

    /// Refuses a checkpoint of a world with other custom functions.
    fn fits(&self, py: Python<'_>, path: &std::path::Path, about: Option<&serde_json::Value>, cure: &str) -> PyResult<()> {
        let theirs = about.and_then(|about| serde_json::from_value::<Vec<Told>>(about.get("custom")?.clone()).ok()).unwrap_or_default();
        let ours = self.told(py);
        let wrong = |message: String| Err(scene_error(py, &SceneError::one("", format!("\"{}\" {message}", path.display()))));
        match (lacking(&theirs, &ours), lacking(&ours, &theirs)) {
            (missing, _) if !missing.is_empty() => wrong(format!("is of a world with {missing}, which no file holds: {cure}")),
            (_, more) if !more.is_empty() => wrong(format!("is of a world without {more}, which this one has")),
            _ => Ok(()),
        }
    }

    /// Refuses names of columns that neither the engine nor a user has given to any.
    fn know(&self, py: Python<'_>, names: &[&str]) -> PyResult<()> {
        let emitters = &self.scene.bind(py).get().scene.emitter;
        let own = emitters.iter().flat_map(|emitter| emitter.columns.keys().map(String::as_str));
        let known: Vec<&str> = COLUMNS.iter().filter(|c| c.in_frames).map(|c| c.name).chain(own).collect();
        let unknown = names.iter().filter(|name| !known.contains(*name));
        let issues = unknown.map(|name| {
            let constant = COLUMNS.iter().any(|c| c.name == *name);
            let hint = suggestion(name, known.iter().copied());
            let list = if hint.is_empty() { format!("; there are {}", known.join(", ")) } else { hint };
            let cure = if constant { "; it does not change, topology has it".into() } else { list };
            Issue::new("columns", format!("no column \"{name}\" in frames{cure}"))
        });
        let issues: Vec<Issue> = issues.collect();
        if issues.is_empty() { Ok(()) } else { Err(scene_error(py, &SceneError { issues })) }
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
    fn new(py: Python<'_>, scene: &Bound<'_, PyAny>, threads: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let threads = threads.map(|n| whole(n, "threads", 1, 1024)).transpose()?.map(|n| n as usize);
        let scene: Py<Scene> = match scene.cast::<Scene>() {
            Ok(scene) => scene.clone().unbind(),
            Err(_) => py.get_type::<Scene>().call1((scene,))?.cast_into::<Scene>()?.unbind(),
        };
        let pool = thread_pool(py, threads)?;
        let engine = build(py, scene.bind(py).get(), pool.as_ref())?;
        let raised = user::Raised::default();
        Ok(Self { scene, engine, pool, threads, custom: Vec::new(), raised, unsolved: Unsolved::default(), stops: true })
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

    /// Warnings about the scene, its USD files, and solvers that missed their tolerance so far: code (as listed in
    /// docs/warnings.md), path and message of each.
    #[getter]
    fn warnings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let warnings = pythonize::pythonize(py, self.engine.warnings())?.cast_into::<PyList>()?;
        let colliders = self.scene.bind(py).get().scene.collider.iter();
        let figures = colliders.filter_map(|collider| match &collider.shape {
            Shape::Character(figure) => Some((format!("collider \"{}\".shape.character.path", collider.name), figure.path.clone())),
            _ => None,
        });
        let figures: Vec<(String, String)> = figures.collect();
        let hair = self.scene.bind(py).get().scene.hair.iter();
        let guides = hair.filter_map(|h| Some((format!("hair \"{}\".guides.path", h.name), h.guides.as_ref()?.path.clone())));
        let guides: Vec<(String, String)> = guides.collect();
        let files = py.import("tumble.doubts")?.call_method1("of_files", (self.scene.clone_ref(py), figures, guides))?;
        warnings.call_method1("extend", (files,))?;
        let Unsolved { steps, unconverged, residual } = self.unsolved;
        if unconverged > 0 {
            let one = PyDict::new(py);
            one.set_item("code", "unconverged")?;
            one.set_item("path", "")?;
            let text = format!(
                "{unconverged} of {steps} steps stopped before Newton's method converged, at a residual of up to {residual:.1e} of the \
                 first: raise solver.newton_iterations, or take a smaller step"
            );
            one.set_item("message", text)?;
            warnings.append(one)?;
        }
        Ok(warnings)
    }

    /// Custom forces and integrators, in the order in which they were added: what ("force" or "integrator"), system,
    /// name.
    #[getter]
    fn custom<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize::pythonize(py, &self.told(py))?)
    }

    /// Simulates frames; returns what they took. Releases the GIL; Ctrl-C goes back to the last frame and raises
    /// KeyboardInterrupt, as does TimeoutError after `patience` [s]. Raises StepError.
    #[pyo3(signature = (frames=None, patience=None), text_signature = "($self, frames=1, patience=None)")]
    fn step<'py>(&mut self, py: Python<'py>, frames: Option<&Bound<'py, PyAny>>, patience: Option<f64>) -> PyResult<Bound<'py, PyAny>> {
        let frames = frames.map_or(Ok(1), |n| whole(n, "frames", 0, u64::MAX))?;
        let end = end_after(patience);
        let mut total = StepReport::default();
        for _ in 0..frames {
            let (engine, pool) = (&mut self.engine, self.pool.as_ref());
            match work_until(py, pool, end, |go_on| engine.step(go_on))? {
                Ok(Some(report)) => {
                    self.unsolved.add(&report);
                    total.add_interval(&report);
                }
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

    /// The named columns, of every object that has them; `tumble.columns.COLUMNS` describes each. Raises SceneError for
    /// a name that no column has.
    #[pyo3(signature = (*names))]
    fn columns<'py>(&self, py: Python<'py>, names: Vec<String>) -> PyResult<Bound<'py, PyDict>> {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        self.know(py, &names)?;
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
        substeps: &Bound<'py, PyAny>,
        names: Vec<String>,
    ) -> PyResult<Option<(Bound<'py, PyDict>, Bound<'py, PyDict>)>> {
        let substeps = whole(substeps, "substeps", 1, u64::MAX)?;
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        self.know(py, &names)?;
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
        let about = serde_json::json!({ "version": env!("CARGO_PKG_VERSION"), "scene": scene.scene.to_json(), "folder": folder, "custom": self.told(py) });
        let bytes = self.engine.save(&[("tumble", &about.to_string())]);
        py.detach(|| std::fs::write(&path, bytes)).map_err(|e| {
            let error = ExportError::new_err(format!("\"{}\" cannot be written: {e}", path.display()));
            // The system's number, from which Python knows its kind.
            error.set_cause(py, Some(pyo3::exceptions::PyOSError::new_err((e.raw_os_error(), e.to_string()))));
            error
        })
    }

    /// The world of a checkpoint. Custom forces and integrators are in no file: `prepare`, called with the world, adds
    /// them again. Raises SceneError, also where they are not those of the world that was saved.
    #[staticmethod]
    #[pyo3(signature = (path, threads=None, prepare=None))]
    fn restore(
        py: Python<'_>,
        path: PathBuf,
        threads: Option<&Bound<'_, PyAny>>,
        prepare: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Py<Self>> {
        let bytes = read(py, &path)?;
        let about = about(&bytes);
        let Some((scene, folder)) = about.as_ref().and_then(|about| Some((about.get("scene")?, about.get("folder")?.as_str()?))) else {
            return Err(scene_error(py, &SceneError::one("", format!("\"{}\" is no checkpoint", path.display()))));
        };
        let scene = py.get_type::<Scene>().call1((pythonize::pythonize(py, scene)?, folder))?;
        let world = Py::new(py, Self::new(py, &scene, threads)?)?;
        if let Some(prepare) = prepare {
            prepare.call1((&world,))?;
        }
        let mut own = world.bind(py).try_borrow_mut()?;
        own.fits(py, &path, about.as_ref(), "World.restore(path, prepare=lambda world: world.add_force(...)) adds it again")?;
        own.engine.restore(&bytes).map_err(|e| scene_error(py, &e))?;
        drop(own);
        Ok(world)
    }

    /// Goes to a checkpoint of the same scene, with the same custom forces and integrators, or with `others` as well.
    /// Raises SceneError; the world then stays as it was.
    #[pyo3(signature = (path, others=false))]
    fn load(&mut self, py: Python<'_>, path: PathBuf, others: bool) -> PyResult<()> {
        let bytes = read(py, &path)?;
        if !others {
            self.fits(py, &path, about(&bytes).as_ref(), "add it to this world before")?;
        }
        self.engine.restore(&bytes).map_err(|e| scene_error(py, &e))
    }

    /// Whether a step whose energy has grown beyond a thousand times its scale raises StepError, which is the default. With
    /// False the world goes on, to show the explosion, until a number is not finite.
    #[getter]
    fn stop_on_explosion(&self) -> bool {
        self.stops
    }

    #[setter]
    fn set_stop_on_explosion(&mut self, stop: bool) {
        self.stops = stop;
        self.engine.stop_on_explosion(stop);
    }

    /// After the state of another scene was loaded: what was chosen from that scene, as how many sub-steps an interval
    /// gets and what energies are measured against, is chosen anew from the state as it is now.
    fn reconsider(&mut self) {
        self.engine.reconsider();
    }

    /// For each system, from its stiffest mode as it is now: system, integrator, step [s], frequency [rad/s], damping,
    /// damping_max [1/s], culprit (object, index), limits (integrator, stable [s], usable [s]). Raises TimeoutError after
    /// `patience` [s].
    #[pyo3(signature = (patience=None))]
    fn stability<'py>(&mut self, py: Python<'py>, patience: Option<f64>) -> PyResult<Bound<'py, PyAny>> {
        let (engine, pool) = (&mut self.engine, self.pool.as_ref());
        let all = work_until(py, pool, end_after(patience), |go_on| engine.stability(go_on))?;
        Ok(pythonize::pythonize(py, &all)?)
    }

    /// After a StepError: changes that were tried from the last good frame: set, survived, energy_ratio.
    fn cures<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (engine, pool) = (&mut self.engine, self.pool.as_ref());
        let all = work(py, pool, |go_on| engine.cures(go_on))?;
        Ok(pythonize::pythonize(py, &all)?)
    }

    /// Adds a force: force(t, x, v, mass) -> n x 3 [N], from x [m] and v [m/s], n x 3, and mass [kg], n. Without
    /// `system`, to the first. `jacobian(t, x, v, mass)` gives implicit integrators the derivatives of the force on each
    /// mass by its own position, n x 3 x 3 [N/m], or a pair: these and those by its velocity [N s/m]. Raises SceneError.
    #[pyo3(signature = (force, system=None, jacobian=None))]
    fn add_force(&mut self, py: Python<'_>, force: Py<PyAny>, system: Option<String>, jacobian: Option<Py<PyAny>>) -> PyResult<()> {
        callable(py, &force, "force")?;
        if let Some(jacobian) = &jacobian {
            callable(py, jacobian, "jacobian")?;
        }
        let system = self.system(system);
        let added = Box::new(user::Force(force.clone_ref(py), jacobian.as_ref().map(|j| j.clone_ref(py)), self.raised.clone()));
        self.engine.add_force(&system, added).map_err(|e| scene_error(py, &e))?;
        self.custom.push(Custom { integrator: false, system, function: force, jacobian });
        Ok(())
    }

    /// Steps with step(t, h, x, v, acceleration) -> (x, v), where acceleration(t, x, v) -> n x 3 [m/s²]. Without
    /// `system`, the first. Raises SceneError.
    #[pyo3(signature = (step, system=None))]
    fn set_integrator(&mut self, py: Python<'_>, step: Py<PyAny>, system: Option<String>) -> PyResult<()> {
        callable(py, &step, "step")?;
        let system = self.system(system);
        let own = Box::new(user::Integrator(step.clone_ref(py), self.raised.clone()));
        self.engine.replace_integrator(&system, own).map_err(|e| scene_error(py, &e))?;
        self.custom.retain(|other| !(other.integrator && other.system == system));
        self.custom.push(Custom { integrator: true, system, function: step, jacobian: None });
        Ok(())
    }

    /// Sets position [m] or velocity [m/s], n x 3, of an object. Raises SceneError.
    fn write(&mut self, py: Python<'_>, object: &str, column: &str, values: &Bound<'_, PyAny>) -> PyResult<()> {
        let wrong = |message: String| scene_error(py, &SceneError::one("", message));
        let columns = self.engine.frame(&["position", "velocity"]).columns;
        let mut objects: Vec<&str> = columns.iter().map(|c| c.object.as_str()).collect();
        objects.dedup();
        if !objects.contains(&object) {
            return Err(wrong(unknown("object", object, &objects)));
        }
        if !["position", "velocity"].contains(&column) {
            return Err(wrong(unknown("column", column, &["position", "velocity"])));
        }
        let array = py.import("numpy")?.call_method1("ascontiguousarray", (values, "float64"));
        let array = array.map_err(|e| wrong(format!("{object}.{column}: {}, expected three numbers for each mass", e.value(py))))?;
        let values: Vec<f64> = array.call_method0("ravel")?.extract()?;
        self.engine.write(object, column, &values).map_err(|e| scene_error(py, &e))
    }

    fn __repr__(&self) -> String {
        format!("World(frame={}, time={})", self.engine.frame_index(), self.engine.time())
    }

    /// Equal worlds have equal scenes and states, and the same custom functions: they go on alike.
    fn __eq__(&self, py: Python<'_>, other: PyRef<'_, Self>) -> bool {
        let alike = |(a, b): (&Py<PyAny>, &Py<PyAny>)| a.is(b);
        let same = |(a, b): (&Custom, &Custom)| {
            let jacobians = a.jacobian.is_some() == b.jacobian.is_some() && a.jacobian.iter().zip(&b.jacobian).all(alike);
            a.integrator == b.integrator && a.system == b.system && a.function.is(&b.function) && jacobians
        };
        self.engine.hash() == other.engine.hash()
            && self.scene.bind(py).get().scene.to_json() == other.scene.bind(py).get().scene.to_json()
            && self.custom.len() == other.custom.len()
            && self.custom.iter().zip(&other.custom).all(same)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyType>, (Py<Scene>, Option<usize>), State<'py>)> {
        let (py, world) = (slf.py(), slf.borrow());
        let own = |f: &Py<PyAny>| f.clone_ref(py);
        let functions =
            world.custom.iter().map(|c| (c.integrator, c.system.clone(), own(&c.function), c.jacobian.as_ref().map(own))).collect();
        let Unsolved { steps, unconverged, residual } = world.unsolved;
        let state = (PyBytes::new(py, &world.engine.save(&[])), functions, (steps, unconverged, residual));
        Ok((slf.get_type(), (world.scene.clone_ref(py), world.threads), state))
    }

    fn __setstate__(&mut self, py: Python<'_>, state: State<'_>) -> PyResult<()> {
        let (bytes, functions, (steps, unconverged, residual)) = state;
        for (integrator, system, function, jacobian) in functions {
            match integrator {
                true => self.set_integrator(py, function, Some(system))?,
                false => self.add_force(py, function, Some(system), jacobian)?,
            }
        }
        self.unsolved = Unsolved { steps, unconverged, residual };
        self.engine.restore(bytes.as_bytes()).map_err(|e| scene_error(py, &e))
    }
}

/// What a copy of a world begins with: its state, its custom functions, and what was not solved.
type State<'py> = (Bound<'py, PyBytes>, Vec<(bool, String, Py<PyAny>, Option<Py<PyAny>>)>, (u64, u64, f64));

impl Unsolved {
    fn add(&mut self, report: &StepReport) {
        self.steps += report.steps;
        self.unconverged += report.unconverged;
        self.residual = report.residual.map_or(self.residual, |residual| self.residual.max(residual));
    }
}

/// What a checkpoint says of the world that wrote it.
fn about(bytes: &[u8]) -> Option<serde_json::Value> {
    tumble::world::about(bytes)?.get("tumble").and_then(|text| serde_json::from_str(text).ok())
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
