//! Floor plans: drawings read, checked and mended.

use crate::errors::{file_error, scene_error};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;
use tumble_interface::SceneError;
use tumble_io::plan::{Floor, Format, Kind, Options, UNITS, lint, read, repair};

fn wrong(py: Python<'_>, text: String) -> PyErr {
    scene_error(py, &SceneError::one("", text))
}

/// The plan that a drawing shows, as a dict: unit (name and metres, or None), scale [m per unit], origin, walls, doors, exits, starts, stairs, layers and faults
/// as `tumble_io::plan::Plan` has them, in units of the file; span of its walls, and likely: the units in which it is the size of a building.
///
/// `source` is a path, or bytes; `suffix` is dxf, svg, geojson or wkt. `layers` are pairs of a kind and the name of a layer. Raises SceneError.
#[pyfunction]
#[pyo3(signature = (source, suffix, scale = None, layers = None))]
pub fn plan<'py>(
    py: Python<'py>,
    source: &Bound<'py, PyAny>,
    suffix: &str,
    scale: Option<f64>,
    layers: Option<Vec<(String, String)>>,
) -> PyResult<Bound<'py, PyAny>> {
    let suffixes = || Format::ALL.map(Format::suffix).join(", ");
    let format =
        Format::named(suffix).ok_or_else(|| wrong(py, format!("no plans in files of suffix {suffix:?}, expected {}", suffixes())))?;
    let kind = |name: &str| {
        let kinds = || Kind::ALL.map(Kind::name).join(", ");
        Kind::named(name).ok_or_else(|| wrong(py, format!("{name:?} is no kind of layers, expected one of {}", kinds())))
    };
    let layers = layers.unwrap_or_default().into_iter().map(|(name, layer)| Ok((kind(&name)?, layer))).collect::<PyResult<Vec<_>>>()?;
    let options = Options { scale, layers };
    let bytes = match source.cast::<PyBytes>() {
        Ok(bytes) => bytes.as_bytes().to_vec(),
        Err(_) => {
            let path: PathBuf = source.extract()?;
            py.detach(|| std::fs::read(&path)).map_err(|error| wrong(py, file_error(&path, &error)))?
        }
    };
    let found = py.detach(|| read(&bytes, format, &options)).map_err(|text| wrong(py, text))?;
    let dict = pythonize::pythonize(py, &found)?.cast_into::<PyDict>()?;
    let likely: Vec<&str> = UNITS.iter().filter(|unit| found.is_plausible(unit.1)).map(|unit| unit.0).collect();
    dict.set_item("span", found.span())?;
    dict.set_item("plausible", found.is_plausible(found.scale))?;
    dict.set_item("likely", likely)?;
    Ok(dict.into_any())
}

/// What is wrong with a floor: a list of dicts with kind, fatal, places [m], text, cure, and by ("repair" or "drawing"). `floor` is a dict in metres: walls, door
/// and exit (name, from, to), start (name, points, people, exit) and radius.
#[pyfunction]
pub fn check_plan<'py>(py: Python<'py>, floor: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let floor: Floor = pythonize::depythonize(floor)?;
    let found = py.detach(|| lint(&floor));
    Ok(pythonize::pythonize(py, &found)?)
}

/// A floor as of `check_plan`, mended, and what was done, a list of dicts as there.
#[pyfunction]
pub fn repair_plan<'py>(py: Python<'py>, floor: &Bound<'py, PyAny>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let floor: Floor = pythonize::depythonize(floor)?;
    let (mended, done) = py.detach(|| repair(&floor));
    Ok((pythonize::pythonize(py, &mended)?, pythonize::pythonize(py, &done)?))
}
