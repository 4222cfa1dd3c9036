//! Scene: words in, checked; mesh files read.

use crate::arguments::{path_of, text};
use crate::errors::{self, scene_error};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple, PyType};
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tumble_interface::scene::{Content, MeshRef, Precision, Shape};
use tumble_interface::tree::{Node, Value};
use tumble_interface::{Assets, Issue, Mesh, SceneError};
use tumble_io::assets::{File, Files, fabric_of, mesh_of};

/// A checked scene: what is there, how it moves, what is written out.
#[pyclass(frozen, skip_from_py_object, module = "tumble")]
#[derive(Clone)]
pub struct Scene {
    /// Resolved.
    pub scene: tumble_interface::Scene,
    pub assets: Assets,
    pub folder: PathBuf,
    /// The tree as it was given, for overrides and for the lines of issues.
    node: Node,
    /// What overrode its keys; nodes that the k-th has made are on line `SET + k`.
    sets: Vec<String>,
    /// Its frames before anything was overridden.
    frames: u64,
}

/// Lines from here on are no lines.
const SET: usize = usize::MAX / 2;

impl Scene {
    /// The scene of a tree.
    fn checked(node: &Node, folder: PathBuf, sets: Vec<String>, frames: Option<u64>) -> Result<Self, SceneError> {
        let mut scene = tumble_interface::Scene::from_tree(node)?;
        move_meshes(&mut scene, &folder)?;
        let assets = tumble_io::assets::assets(&mut scene, &mut Folder(&folder))?;
        let frames = frames.unwrap_or(u64::from(scene.time.frames));
        Ok(Self { scene: tumble::scene::resolve(scene), assets, folder, node: node.clone(), sets, frames })
    }

    /// The tree with keys overridden; raises all that is wrong with either. `sets` has overridden keys of it before.
    fn overridden(
        py: Python<'_>,
        mut node: Node,
        folder: PathBuf,
        mut sets: Vec<String>,
        more: Vec<String>,
        frames: Option<u64>,
    ) -> PyResult<Self> {
        let mut issues = Vec::new();
        for assignment in more {
            let path = assignment.split('=').next().unwrap_or_default().trim().to_string();
            let (there, line) = (known(&node, &path), SET + sets.len());
            match tumble::scene::set_text(&mut node, &assignment) {
                Ok(()) => mark(&mut node, &path, there, line),
                Err(error) => issues.extend(error.issues.into_iter().map(|issue| Issue { line: Some(line), ..issue })),
            }
            sets.push(assignment);
        }
        match py.detach(|| Self::checked(&node, folder, sets.clone(), frames)) {
            Ok(scene) if issues.is_empty() => return Ok(scene),
            Ok(_) => {}
            Err(error) => issues.extend(error.issues),
        }
        Err(blamed(py, &node, &sets, SceneError { issues }))
    }

    /// The error with the lines of its places.
    pub fn error(&self, py: Python<'_>, error: SceneError) -> PyErr {
        blamed(py, &self.node, &self.sets, error)
    }
}

/// Gives each collider whose mesh is an animated USD file the meshes of all its frames, and each character of one its figure.
fn move_meshes(scene: &mut tumble_interface::Scene, folder: &Path) -> Result<(), SceneError> {
    if !scene.mesh_files_mut().iter().any(|file| is_usd(Path::new(file.path))) {
        return Ok(());
    }
    let span = scene.frame_time() * f64::from(scene.time.frames);
    // OpenUSD is a library of Python.
    let moved = Python::attach(|py| -> PyResult<Vec<(usize, Shape)>> {
        let colliders = pythonize::pythonize(py, &scene.collider)?;
        let moved = py.import("tumble.usd")?.call_method1("moved", (colliders, folder.to_path_buf(), span))?;
        Ok(pythonize::depythonize(&moved)?)
    });
    let moved = moved.map_err(|e| SceneError::one("collider", Python::attach(|py| e.value(py).to_string())))?;
    for (k, shape) in moved {
        if let Some(collider) = scene.collider.get_mut(k) {
            collider.shape = shape;
        }
    }
    Ok(())
}

/// What is wrong with a text that is no TOML or JSON, in words for those who wrote it, and the line.
fn unread(text: &str, is_json: bool, mut error: SceneError) -> SceneError {
    for issue in &mut error.issues {
        let Some(line) = issue.line else { continue };
        let said = issue.message.clone();
        let of = |words: &[&str]| words.iter().any(|word| said.contains(word));
        let what = match (is_json, of(&["EOF"]), of(&["duplicate key"]), of(&["unclosed"]), of(&["must be quoted"])) {
            (true, true, ..) => "the file ends before everything that was opened with {, [ or \" is closed".into(),
            (true, ..) => {
                "this cannot be read as JSON: keys and text stand in double quotes, parts are separated by single commas".to_string()
            }
            (_, _, true, ..) => "this key stands here for the second time; leave one of both out".into(),
            (_, _, _, true, _) => "what is opened here with [, { or a quotation mark is not closed".into(),
            (.., true) => "text stands in quotation marks: \"text\"; only numbers, true and false do without".into(),
            _ => "this cannot be read as TOML, which is key = value, [table] and [[item of a list]]".into(),
        };
        let shown = text.lines().nth(line.saturating_sub(1)).map(str::trim).filter(|shown| !shown.is_empty());
        let shown = shown.map(|shown| format!(": {}", shown.chars().take(80).collect::<String>())).unwrap_or_default();
        *issue = Issue::on(Some(line), "", format!("{what}{shown}"));
    }
    error
}

/// The error with the lines of its places, or with the overrides that stand there.
fn blamed(py: Python<'_>, node: &Node, sets: &[String], mut error: SceneError) -> PyErr {
    second_of_a_name(node, &mut error.issues);
    let issues = node.located(error).issues.into_iter().map(|issue| match issue.line.and_then(|line| line.checked_sub(SET)) {
        Some(k) => (Issue { line: None, ..issue }, sets.get(k).map(String::as_str)),
        None => (issue, None),
    });
    errors::of_overrides(py, &issues.collect::<Vec<_>>())
}

/// Puts what is wrong with a name that is there already on the line of the later one: a path alone leads to the first.
fn second_of_a_name(node: &Node, issues: &mut [Issue]) {
    let mut seen: Vec<String> = Vec::new();
    let all: Vec<String> = issues.iter().filter(|issue| issue.message.contains("has this name")).map(|issue| issue.path.clone()).collect();
    for issue in issues.iter_mut().filter(|issue| issue.message.contains("has this name")) {
        let Some((kind, name)) = issue.path.strip_suffix("\".name").and_then(|path| path.split_once(" \"")) else { continue };
        let Some(Node { value: Value::List(items), .. }) = node.entry(kind) else { continue };
        let lines: Vec<_> = items.iter().filter(|n| n.text("name") == Some(name)).map(|n| n.entry("name").and_then(|n| n.line)).collect();
        let count = |paths: &[String]| paths.iter().filter(|path| **path == issue.path).count();
        let at = (lines.len() + count(&seen)).checked_sub(count(&all));
        issue.line = at.and_then(|at| lines.get(at).copied().flatten());
        seen.push(issue.path.clone());
    }
}

/// The node under a key, or the item of a list by its name or number, as `Node::set` finds it.
fn step<'a>(node: &'a mut Node, key: &str) -> Option<&'a mut Node> {
    match &mut node.value {
        Value::Table(entries) => entries.iter_mut().find(|(k, _)| k == key).map(|(_, n)| n),
        Value::List(items) => {
            let named = items.iter().position(|n| n.text("name") == Some(key)).or_else(|| key.parse().ok());
            let i = named.or_else(|| items.iter().position(|n| key == "main" && n.entry("name").is_none()))?;
            items.get_mut(i)
        }
        _ => None,
    }
}

/// How many of the keys of a path are there.
fn known(node: &Node, path: &str) -> usize {
    let mut node = node.clone();
    let mut at = &mut node;
    for (n, key) in path.split('.').enumerate() {
        match step(at, key) {
            Some(next) => at = next,
            None => return n,
        }
    }
    path.split('.').count()
}

/// Puts what an override has made, below the keys that were there before, on a line.
fn mark(node: &mut Node, path: &str, known: usize, line: usize) {
    let mut at = node;
    let last = path.split('.').count() - 1;
    for (n, key) in path.split('.').enumerate() {
        let Some(next) = step(at, key) else { return };
        at = next;
        if n >= known.min(last) {
            return whole(at, line);
        }
    }
}

/// Puts a node and all below it on a line.
fn whole(node: &mut Node, line: usize) {
    node.line = Some(line);
    match &mut node.value {
        Value::List(items) => items.iter_mut().for_each(|n| whole(n, line)),
        Value::Table(entries) => entries.iter_mut().for_each(|(_, n)| whole(n, line)),
        _ => {}
    }
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (tree, folder=None))]
    fn new(py: Python<'_>, tree: &Bound<'_, PyAny>, folder: Option<PathBuf>) -> PyResult<Self> {
        let node = to_node(tree, "", 0).map_err(|e| scene_error(py, &e))?;
        Self::overridden(py, node, folder.unwrap_or_default(), Vec::new(), Vec::new(), None)
    }

    /// Reads a .toml or .json file, or a scene that comes with tumble, by its name: "rope". `set` overrides keys:
    /// "time.fps=30", "sheet.flag.size=[1, 2]". Raises SceneError.
    #[staticmethod]
    #[pyo3(signature = (path, set=Vec::new()))]
    fn load(py: Python<'_>, path: PathBuf, set: Vec<String>) -> PyResult<Self> {
        let path: PathBuf =
            if path.is_file() { path } else { py.import("tumble.bundled")?.call_method1("scene_file", (path,))?.extract()? };
        let text = std::fs::read_to_string(&path).map_err(|e| scene_error(py, &SceneError::one("", errors::file_error(&path, &e))))?;
        let is_json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        let node = if is_json { Node::from_json(&text) } else { Node::from_toml(&text) };
        let node = node.map_err(|e| scene_error(py, &unread(&text, is_json, e)))?;
        // An error there is told with those of the overrides.
        let frames = tumble_interface::Scene::from_tree(&node).ok().map(|scene| u64::from(scene.time.frames));
        Self::overridden(py, node, path.parent().map(Path::to_path_buf).unwrap_or_default(), Vec::new(), set, frames)
    }

    /// A copy with keys overridden, as in `load`. Raises SceneError.
    #[pyo3(signature = (*overrides))]
    fn replace(&self, py: Python<'_>, overrides: Vec<String>) -> PyResult<Self> {
        Self::overridden(py, self.node.clone(), self.folder.clone(), self.sets.clone(), overrides, Some(self.frames))
    }

    /// The resolved scene: every default written out, systems included, mesh files with the hash of their content.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize::pythonize(py, &self.scene.to_json())?)
    }

    /// An upper estimate of the bytes that its world takes. Above `world.memory_limit` it is refused.
    #[getter]
    fn memory(&self) -> f64 {
        match self.scene.precision {
            Precision::Single => tumble::scene::memory(&self.scene, &self.assets),
            Precision::Double => tumble_f64::scene::memory(&self.scene, &self.assets),
        }
    }

    /// Folder in which mesh files are looked for.
    #[getter]
    fn folder(&self) -> String {
        self.folder.display().to_string()
    }

    /// The mesh files that it names: place of the name in the resolved scene, its line or None, and the path as it stands
    /// there, FILE/CODE.usd for a frame of an animated USD file. Files of figures and of guides are left out.
    #[getter]
    fn mesh_files(&self) -> Vec<(String, Option<usize>, String)> {
        let mut scene = self.scene.clone();
        let files = scene.mesh_files_mut();
        let place = |file: &MeshRef<'_>| (format!("{}.path", file.place), file.path.to_string());
        let places = files.iter().filter(|file| file.content == Content::Mesh).map(place);
        places.map(|(place, path)| (place.clone(), self.node.line_of(&place).filter(|line| *line < SET), path)).collect()
    }

    /// Its frames before any were overridden: what its expectations at the end are meant for.
    #[getter]
    fn whole_frames(&self) -> u64 {
        self.frames
    }

    /// JSON Schema of a scene; units are under "x-unit".
    #[staticmethod]
    fn schema(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        Ok(pythonize::pythonize(py, &tumble_interface::Scene::schema())?)
    }

    fn __repr__(&self) -> String {
        format!("Scene(title={:?})", self.scene.title)
    }

    /// Equal scenes have the same words, defaults written out, and meshes with the same content.
    fn __eq__(&self, other: &Self) -> bool {
        self.scene.to_json() == other.scene.to_json()
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = std::hash::DefaultHasher::new();
        (&self.scene.title, self.scene.seed, self.scene.time.frames).hash(&mut hasher);
        hasher.finish()
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyType>, (Bound<'py, PyAny>, String))> {
        let scene = slf.get();
        Ok((slf.get_type(), (scene.to_dict(slf.py())?, scene.folder())))
    }
}

/// Deepest nesting that is read.
const DEPTH: usize = 80;

/// The tree of a dict. NumPy arrays and numbers are lists and numbers, too.
fn to_node(value: &Bound<'_, PyAny>, path: &str, depth: usize) -> Result<Node, SceneError> {
    let wrong = |message: String| SceneError::one(path, message);
    if depth > DEPTH {
        return Err(wrong("nested too deeply to be a scene".into()));
    }
    let value_of = if value.is_none() {
        Value::Null
    } else if let Ok(b) = value.cast::<PyBool>() {
        Value::Bool(b.is_true())
    } else if let Ok(text) = value.cast::<PyString>() {
        Value::Text(text.to_string())
    } else if value.is_instance_of::<PyInt>() {
        value.extract::<i64>().map_or_else(|_| Value::Float(value.extract().unwrap_or(f64::INFINITY)), Value::Int)
    } else if value.is_instance_of::<PyFloat>() {
        Value::Float(value.extract().unwrap_or(f64::NAN))
    } else if let Ok(table) = value.cast::<PyDict>() {
        let mut entries = Vec::new();
        for (key, below) in table {
            let key: String = key.extract().map_err(|_| wrong(format!("the key {key} is no string")))?;
            let node = to_node(&below, &if path.is_empty() { key.clone() } else { format!("{path}.{key}") }, depth + 1)?;
            entries.push((key, node));
        }
        Value::Table(entries)
    } else if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        let mut items = Vec::new();
        for (i, below) in value.try_iter().into_iter().flatten().enumerate() {
            let below = below.map_err(|e| wrong(e.to_string()))?;
            items.push(to_node(&below, &format!("{path}[{i}]"), depth + 1)?);
        }
        Value::List(items)
    } else if let Some(path) = path_of(value) {
        Value::Text(path)
    } else if let Ok(list) = value.call_method0("tolist") {
        return to_node(&list, path, depth + 1);
    } else {
        let kind = value.get_type().name().map_or_else(|_| "value".into(), |n| n.to_string());
        return Err(wrong(format!("a {kind}, expected a dict, a list, a string, a number or a boolean")));
    };
    Ok(value_of.into())
}

/// How the objects of a scene are drawn, in the order of their columns, and the ends of anchors; see `tumble.looks`. None of its files is read.
#[pyfunction]
pub fn looks<'py>(py: Python<'py>, tree: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let scene = to_node(tree, "", 0).and_then(|node| tumble_interface::Scene::from_tree(&node));
    let scene = scene.map_err(|e| scene_error(py, &e))?;
    Ok(pythonize::pythonize(py, &tumble::scene::looks(&scene))?)
}

/// The camera of a scene, given as its table, at each time [s]: positions n x 3 [m] and points that it looks at n x 3 [m], where the scene says
/// them, and angles of view n [°].
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn sights<'py>(
    py: Python<'py>,
    camera: &Bound<'_, PyAny>,
    times: Vec<f64>,
) -> PyResult<(Option<Bound<'py, PyArray2<f64>>>, Option<Bound<'py, PyArray2<f64>>>, Bound<'py, PyArray1<f64>>)> {
    let words = pythonize::depythonize(camera).map_err(|e| scene_error(py, &SceneError::one("camera", e.to_string())))?;
    let camera = tumble::scene::Camera::new(&words).map_err(|e| scene_error(py, &e))?;
    let all: Vec<_> = times.into_iter().map(|t| camera.at(t)).collect();
    let points = |of: fn(&tumble::scene::Sight) -> Option<[f64; 3]>| {
        let points: Option<Vec<[f64; 3]>> = all.iter().map(of).collect();
        points.map(|points| PyArray1::from_vec(py, points.concat()).reshape([all.len(), 3])).transpose()
    };
    let angles = all.iter().map(|sight| sight.view_angle).collect();
    Ok((points(|sight| sight.position)?, points(|sight| sight.target)?, PyArray1::from_vec(py, angles)))
}

/// Suffixes of files that OpenUSD reads.
const USD: [&str; 4] = ["usd", "usda", "usdc", "usdz"];

fn is_usd(path: &Path) -> bool {
    path.extension().is_some_and(|e| USD.iter().any(|usd| e.eq_ignore_ascii_case(usd)))
}

/// What a function of `tumble.usd` makes of a file.
fn as_text(function: &str, file: &Path) -> PyResult<String> {
    Python::attach(|py| py.import("tumble.usd")?.call_method1(function, (file,))?.extract())
}

/// Files below a folder.
struct Folder<'a>(&'a Path);

impl Files for Folder<'_> {
    const RESTORE: &'static str = "restore the file";
    const CONVERTED: &'static [&'static str] = &USD;

    fn open(&mut self, path: &str) -> Result<Arc<File>, String> {
        let whole = self.0.join(path);
        let figure = whole.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb"));
        // Below the name of a USD file are its frames, walk.usda/24.usda, and its figure, walk.usda/figure.glb.
        let home = whole.parent().filter(|home| (figure || is_usd(&whole)) && is_usd(home) && home.is_file());
        let stored = home.unwrap_or(&whole);
        let bytes = std::fs::read(stored).map_err(|e| errors::file_error(stored, &e))?;
        let file = File::new(path, bytes);
        if !is_usd(stored) {
            return Ok(Arc::new(file));
        }
        let told = |e: PyErr| format!("\"{}\": {}", stored.display(), Python::attach(|py| e.value(py).to_string()));
        if figure {
            let glb = Python::attach(|py| -> PyResult<Vec<u8>> {
                py.import("tumble.usd")?.call_method1("as_glb", (stored.to_path_buf(),))?.extract()
            });
            return Ok(Arc::new(file.figure(glb.map_err(told)?)));
        }
        Ok(Arc::new(file.converted("USD", as_text("as_obj", &whole).map_err(told)?)))
    }

    fn open_curves(&mut self, path: &str) -> Result<Arc<File>, String> {
        let whole = self.0.join(path);
        let bytes = std::fs::read(&whole).map_err(|e| errors::file_error(&whole, &e))?;
        let file = File::new(path, bytes);
        if !is_usd(&whole) {
            return Ok(Arc::new(file));
        }
        let told = |e: PyErr| format!("\"{}\": {}", whole.display(), Python::attach(|py| e.value(py).to_string()));
        Ok(Arc::new(file.converted("USD", as_text("as_curves", &whole).map_err(told)?)))
    }

    fn shown(&self, path: &str) -> String {
        self.0.join(path).display().to_string()
    }
}

/// The record of a shipped fabric, or of a file, as a dict: name, composition, source, density, stretching and bending.
#[pyfunction]
pub fn load_fabric(py: Python<'_>, fabric: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let fabric = text(py, &fabric)?;
    let read = match tumble_io::record_is_json(fabric) {
        Some(_) => fabric_of(&mut Folder(Path::new("")), fabric).map(|(fabric, _)| fabric),
        None => tumble_io::shipped(fabric),
    };
    let record = read.map_err(|e| scene_error(py, &SceneError::one("", e)))?;
    let dict = PyDict::new(py);
    dict.set_item("name", record.name)?;
    dict.set_item("composition", record.composition)?;
    dict.set_item("source", record.source)?;
    dict.set_item("density", record.density)?;
    dict.set_item("stretching", record.stretching.map(Vec::from).to_vec())?;
    dict.set_item("bending", record.bending.map(Vec::from).to_vec())?;
    Ok(dict)
}

/// The mesh of a file.
fn read_mesh(py: Python<'_>, path: &Path) -> PyResult<Mesh> {
    let read = mesh_of(&mut Folder(Path::new("")), text(py, path)?);
    read.map(|(mesh, _)| mesh).map_err(|e| scene_error(py, &SceneError::one("", e)))
}

/// Vertices n x 3 and triangles m x 3 of a mesh file.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn load_mesh(py: Python<'_>, path: PathBuf) -> PyResult<(Bound<'_, PyArray2<f64>>, Bound<'_, PyArray2<u32>>)> {
    let mesh = read_mesh(py, &path)?;
    let (n, m) = (mesh.vertices.len(), mesh.triangles.len());
    let vertices = PyArray1::from_vec(py, mesh.vertices.concat()).reshape([n, 3])?;
    Ok((vertices, PyArray1::from_vec(py, mesh.triangles.concat()).reshape([m, 3])?))
}

/// The mesh of a file mended, as the text of an OBJ file, or None if nothing had to be done; counts of vertices welded, triangles repeated,
/// degenerate and turned, edges split, vertices unused, and of edges that are still open or odd. Raises SceneError if it cannot be read or nothing is left.
#[pyfunction]
pub fn repair_mesh(py: Python<'_>, path: PathBuf) -> PyResult<(Option<String>, Bound<'_, PyDict>)> {
    let wrong = |e: String| scene_error(py, &SceneError::one("", e));
    let mesh = read_mesh(py, &path)?;
    let (mended, done, left) = py.detach(|| {
        let (mended, done) = tumble_io::repair(&mesh);
        let left = mended.defects();
        (mended, done, left)
    });
    if mended.triangles.is_empty() {
        return Err(wrong(format!("\"{}\": no triangle has an area; export the mesh again", path.display())));
    }
    let counts = PyDict::new(py);
    for (name, n) in [
        ("welded", done.welded),
        ("repeated", done.repeated),
        ("degenerate", done.degenerate),
        ("turned", done.turned),
        ("split", done.split),
        ("unused", done.unused),
        ("open", left.open_edges),
        ("odd", left.bad_edges),
    ] {
        counts.set_item(name, n)?;
    }
    Ok(((!done.is_none()).then(|| tumble_io::obj(&mended)), counts))
}
