//! Scene: words in, checked; mesh files read.

use crate::errors::{self, scene_error};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use tumble_interface::scene::{FabricRef, MeshRef, Precision};
use tumble_interface::tree::{Node, Value};
use tumble_interface::{Assets, Character, Fabric, Issue, Mesh, SceneError};
use tumble_io::Format;
use twox_hash::XxHash3_64;

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
            let assets = load_assets(&mut scene, &folder)?;
            let assets = Assets::new(assets.meshes, assets.characters).with_fabrics(load_fabrics(&mut scene, &folder)?);
            Ok(Self { scene: tumble::scene::resolve(scene), assets, folder, node: node.clone() })
        });
        result.map_err(|e| scene_error(py, &with_lines(e, &node)))
    }

    /// The error with the lines of its places.
    pub fn error(&self, py: Python<'_>, error: SceneError) -> PyErr {
        scene_error(py, &with_lines(error, &self.node))
    }
}

fn with_lines(mut error: SceneError, node: &Node) -> SceneError {
    for issue in &mut error.issues {
        issue.line = issue.line.or_else(|| node.line_of(&issue.path));
    }
    error.issues.sort_by_key(|issue| issue.line);
    error
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

/// The files that a scene names, by path.
#[derive(Default)]
struct Files {
    meshes: HashMap<String, Mesh>,
    characters: HashMap<String, Character>,
}

/// Reads every mesh file that the scene names, once, and notes the hash of its content.
fn load_assets(scene: &mut tumble_interface::Scene, folder: &Path) -> Result<Files, SceneError> {
    let (mut assets, mut hashes, mut issues) = (Files::default(), HashMap::new(), Vec::new());
    for file in scene.mesh_files_mut() {
        let (place, path) = (&file.place, folder.join(file.path));
        let known = if file.skinned { assets.characters.contains_key(file.path) } else { assets.meshes.contains_key(file.path) };
        if !known {
            let read = if file.skinned {
                read_character(&path).map(|(character, hash)| {
                    assets.characters.insert(file.path.to_string(), character);
                    hash
                })
            } else {
                read_mesh(&path).map(|(mesh, hash)| {
                    assets.meshes.insert(file.path.to_string(), mesh);
                    hash
                })
            };
            match read {
                Ok(hash) => drop(hashes.insert(file.path.to_string(), hash)),
                Err(message) => {
                    issues.push(Issue::new(format!("{place}.path"), message));
                    continue;
                }
            }
        }
        let found = hashes.get(file.path).cloned();
        if file.hash.is_some() && *file.hash != found {
            let message =
                format!("the content of \"{}\" has changed since this scene was resolved; restore the file, or leave out hash", file.path);
            issues.push(Issue::new(format!("{place}.hash"), message));
        }
        *file.hash = found;
    }
    if issues.is_empty() { Ok(assets) } else { Err(SceneError { issues }) }
}

/// Reads every record that the scene names, once, and notes the hash of its content.
fn load_fabrics(scene: &mut tumble_interface::Scene, folder: &Path) -> Result<HashMap<String, Fabric>, SceneError> {
    let (mut fabrics, mut issues) = (HashMap::new(), Vec::new());
    for FabricRef { place, words } in scene.fabrics_mut() {
        let key = words.key().to_string();
        let read = match words.choice() {
            Err(message) => Err((String::new(), message)),
            Ok(None) => tumble_io::shipped(&key).map(|fabric| (fabric, None)).map_err(|e| (words.name_key().into(), e)),
            Ok(Some(path)) => read_fabric(&folder.join(path)).map(|(fabric, hash)| (fabric, Some(hash))).map_err(|e| (".path".into(), e)),
        };
        match read {
            Ok((fabric, found)) => {
                if let Some(hash) = words.hash_mut() {
                    if hash.is_some() && *hash != found {
                        let message = format!(
                            "the content of \"{key}\" has changed since this scene was resolved; restore the file, or leave out hash"
                        );
                        issues.push(Issue::new(format!("{place}.hash"), message));
                    }
                    *hash = found;
                }
                fabrics.insert(key, fabric);
            }
            Err((below, message)) => issues.push(Issue::new(format!("{place}{below}"), message)),
        }
    }
    if issues.is_empty() { Ok(fabrics) } else { Err(SceneError { issues }) }
}

fn read_fabric(path: &Path) -> Result<(Fabric, String), String> {
    let Some(json) = tumble_io::record_is_json(&path.to_string_lossy()) else {
        return Err(format!("\"{}\" has none of the suffixes .toml, .json", path.display()));
    };
    let bytes = std::fs::read(path).map_err(|e| errors::file_error(path, &e))?;
    let fabric = tumble_io::fabric(&bytes, json).map_err(|e| format!("\"{}\": {e}", path.display()))?;
    Ok((fabric, format!("{:016x}", XxHash3_64::oneshot(&bytes))))
}

/// The record of a shipped fabric, or of a file, as a dict: name, composition, source, density, stretching and bending.
#[pyfunction]
pub fn load_fabric<'py>(py: Python<'py>, fabric: &str) -> PyResult<Bound<'py, PyDict>> {
    let read = match tumble_io::record_is_json(fabric) {
        Some(_) => read_fabric(Path::new(fabric)).map(|(fabric, _)| fabric),
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

/// Suffixes of files that OpenUSD reads.
const USD: [&str; 4] = ["usd", "usda", "usdc", "usdz"];

fn read_mesh(path: &Path) -> Result<(Mesh, String), String> {
    let is_usd = path.extension().is_some_and(|e| USD.iter().any(|usd| e.eq_ignore_ascii_case(usd)));
    let format = if is_usd { Some(Format::Obj) } else { Format::from_path(&path.to_string_lossy()) };
    let Some(format) = format else {
        return Err(format!("\"{}\" has none of the suffixes .obj, .ply, .stl, .glb, .usd, .usda, .usdc, .usdz", path.display()));
    };
    let bytes = std::fs::read(path).map_err(|e| errors::file_error(path, &e))?;
    let hash = format!("{:016x}", XxHash3_64::oneshot(&bytes));
    let named = |e: String| format!("\"{}\": {e}", path.display());
    if !is_usd {
        return Ok((tumble_io::mesh(&bytes, format).map_err(named)?, hash));
    }
    // OpenUSD is a library of Python.
    let text = Python::attach(|py| -> PyResult<String> { py.import("tumble.usd")?.call_method1("as_obj", (path,))?.extract() });
    let text = text.map_err(|e| named(Python::attach(|py| e.value(py).to_string())))?;
    let mesh = tumble_io::mesh(text.as_bytes(), format).map_err(|e| named(e.replacen("OBJ", "USD", 1)))?;
    Ok((mesh, hash))
}

fn read_character(path: &Path) -> Result<(Character, String), String> {
    let bytes = std::fs::read(path).map_err(|e| errors::file_error(path, &e))?;
    let character = tumble_io::character(&bytes).map_err(|e| format!("\"{}\": {e}", path.display()))?;
    Ok((character, format!("{:016x}", XxHash3_64::oneshot(&bytes))))
}

/// Vertices n x 3 and triangles m x 3 of a mesh file.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn load_mesh(py: Python<'_>, path: PathBuf) -> PyResult<(Bound<'_, PyArray2<f64>>, Bound<'_, PyArray2<u32>>)> {
    let (mesh, _) = read_mesh(&path).map_err(|e| scene_error(py, &SceneError::one("", e)))?;
    let (n, m) = (mesh.vertices.len(), mesh.triangles.len());
    let vertices = PyArray1::from_vec(py, mesh.vertices.concat()).reshape([n, 3])?;
    Ok((vertices, PyArray1::from_vec(py, mesh.triangles.concat()).reshape([m, 3])?))
}

/// The mesh of a file mended, as the text of an OBJ file, or None if nothing had to be done; counts of vertices welded, triangles repeated,
/// degenerate and turned, edges split, vertices unused, and of edges that are still open or odd. Raises SceneError if it cannot be read or nothing is left.
#[pyfunction]
pub fn repair_mesh(py: Python<'_>, path: PathBuf) -> PyResult<(Option<String>, Bound<'_, PyDict>)> {
    let wrong = |e: String| scene_error(py, &SceneError::one("", e));
    let (mesh, _) = read_mesh(&path).map_err(wrong)?;
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
