//! Scene: words in, checked; mesh files read.

use crate::errors::{self, scene_error};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tumble_interface::scene::{MeshRef, Precision};
use tumble_interface::tree::{Node, Value};
use tumble_interface::{Assets, Mesh, SceneError};
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
}

impl Scene {
    fn from_node(py: Python<'_>, node: Node, folder: PathBuf) -> PyResult<Self> {
        let result = py.detach(|| -> Result<Self, SceneError> {
            let mut scene = tumble_interface::Scene::from_tree(&node)?;
            let assets = tumble_io::assets::assets(&mut scene, &mut Folder(&folder))?;
            Ok(Self { scene: tumble::scene::resolve(scene), assets, folder, node: node.clone() })
        });
        result.map_err(|e| scene_error(py, &node.located(e)))
    }

    /// The error with the lines of its places.
    pub fn error(&self, py: Python<'_>, error: SceneError) -> PyErr {
        scene_error(py, &self.node.located(error))
    }
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (tree, folder=None))]
    fn new(py: Python<'_>, tree: &Bound<'_, PyAny>, folder: Option<PathBuf>) -> PyResult<Self> {
        let node = to_node(tree, "", 0).map_err(|e| scene_error(py, &e))?;
        Self::from_node(py, node, folder.unwrap_or_default())
    }

    /// Reads a .toml or .json file. `set` overrides keys: "time.fps=30", "sheet.flag.size=[1, 2]". Raises SceneError.
    #[staticmethod]
    #[pyo3(signature = (path, set=Vec::new()))]
    fn load(py: Python<'_>, path: PathBuf, set: Vec<String>) -> PyResult<Self> {
        let text = std::fs::read_to_string(&path).map_err(|e| scene_error(py, &SceneError::one("", errors::file_error(&path, &e))))?;
        let is_json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        let node = if is_json { Node::from_json(&text) } else { Node::from_toml(&text) };
        let mut node = node.map_err(|e| scene_error(py, &e))?;
        for assignment in set {
            tumble::scene::set_text(&mut node, &assignment).map_err(|e| scene_error(py, &e))?;
        }
        Self::from_node(py, node, path.parent().map(Path::to_path_buf).unwrap_or_default())
    }

    /// A copy with keys overridden, as in `load`. Raises SceneError.
    #[pyo3(signature = (*overrides))]
    fn replace(&self, py: Python<'_>, overrides: Vec<String>) -> PyResult<Self> {
        let mut node = self.node.clone();
        for assignment in overrides {
            tumble::scene::set_text(&mut node, &assignment).map_err(|e| scene_error(py, &e))?;
        }
        Self::from_node(py, node, self.folder.clone())
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

    /// The mesh files that it names: place of the name in the scene, its line or None, and the path as it stands there.
    /// Files of figures are left out.
    #[getter]
    fn mesh_files(&self) -> Vec<(String, Option<usize>, String)> {
        let mut scene = self.scene.clone();
        let files = scene.mesh_files_mut();
        let place = |file: &MeshRef<'_>| (format!("{}.path", file.place), file.path.to_string());
        let places = files.iter().filter(|file| !file.skinned).map(place);
        places.map(|(place, path)| (place.clone(), self.node.line_of(&place), path)).collect()
    }

    /// JSON Schema of a scene; units are under "x-unit".
    #[staticmethod]
    fn schema(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        Ok(pythonize::pythonize(py, &tumble_interface::Scene::schema())?)
    }

    fn __repr__(&self) -> String {
        format!("Scene(title={:?})", self.scene.title)
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

/// Suffixes of files that OpenUSD reads.
const USD: [&str; 4] = ["usd", "usda", "usdc", "usdz"];

/// Files below a folder.
struct Folder<'a>(&'a Path);

impl Files for Folder<'_> {
    const RESTORE: &'static str = "restore the file";
    const CONVERTED: &'static [&'static str] = &USD;

    fn open(&mut self, path: &str) -> Result<Arc<File>, String> {
        let whole = self.0.join(path);
        let bytes = std::fs::read(&whole).map_err(|e| errors::file_error(&whole, &e))?;
        let file = File::new(path, bytes);
        if !whole.extension().is_some_and(|e| USD.iter().any(|usd| e.eq_ignore_ascii_case(usd))) {
            return Ok(Arc::new(file));
        }
        // OpenUSD is a library of Python.
        let text = Python::attach(|py| -> PyResult<String> { py.import("tumble.usd")?.call_method1("as_obj", (&whole,))?.extract() });
        let text = text.map_err(|e| format!("\"{}\": {}", whole.display(), Python::attach(|py| e.value(py).to_string())))?;
        Ok(Arc::new(file.converted("USD", text)))
    }

    fn shown(&self, path: &str) -> String {
        self.0.join(path).display().to_string()
    }
}

/// The record of a shipped fabric, or of a file, as a dict: name, composition, source, density, stretching and bending.
#[pyfunction]
pub fn load_fabric<'py>(py: Python<'py>, fabric: &str) -> PyResult<Bound<'py, PyDict>> {
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
    let name = path.to_str().ok_or_else(|| format!("\"{}\" is no name in UTF-8; rename the file", path.display()));
    let read = name.and_then(|name| mesh_of(&mut Folder(Path::new("")), name));
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
