//! Arrays on grids to the bytes of a VDB file.

use crate::errors::ExportError;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use tumble_io::{Class, Volume, vdb};

/// One grid of the file, as the dict says.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Given<'py> {
    name: String,
    unit: String,
    class: String,
    values: PyReadonlyArray1<'py, f32>,
    width: usize,
    points: [usize; 3],
    corner: [i32; 3],
    spacing: f64,
    origin: [f64; 3],
    background: f32,
    tolerance: Option<f32>,
    half: bool,
}

/// The bytes of a VDB file. Each volume is a dict: name, unit, class ("unknown", "fog volume", "level set" or "staggered"), values (float32,
/// x fastest, those of a vector together), width, points, corner, spacing [m], origin [m], background, tolerance, half.
/// Raises ExportError.
#[pyfunction]
pub fn write_vdb<'py>(py: Python<'py>, volumes: Vec<Bound<'py, PyDict>>, zip: bool) -> PyResult<Bound<'py, PyBytes>> {
    let given = volumes.iter().map(|v| v.extract::<Given<'py>>()).collect::<PyResult<Vec<_>>>()?;
    let volumes = given
        .iter()
        .map(|g| {
            Ok(Volume {
                name: &g.name,
                unit: &g.unit,
                class: Class::named(&g.class).ok_or_else(|| ExportError::new_err(format!("no class \"{}\" of volumes", g.class)))?,
                values: g.values.as_slice()?,
                width: g.width,
                points: g.points,
                corner: g.corner,
                spacing: g.spacing,
                origin: g.origin,
                background: g.background,
                tolerance: g.tolerance,
                half: g.half,
            })
        })
        .collect::<PyResult<Vec<_>>>()?;
    let bytes = py.detach(|| vdb(&volumes, zip)).map_err(ExportError::new_err)?;
    Ok(PyBytes::new(py, &bytes))
}
