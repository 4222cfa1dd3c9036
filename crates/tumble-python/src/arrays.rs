//! Columns as NumPy arrays.

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use tumble_interface::{Column, Data};

/// object -> column -> array, of shape (n,) or (n, width), on a grid of its points along each axis instead of n.
pub fn columns<'py>(py: Python<'py>, columns: Vec<Column>) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for column in columns {
        let array = match column.data {
            Data::F32(data) => shaped(PyArray1::from_vec(py, data), column.width, &column.points)?,
            Data::F64(data) => shaped(PyArray1::from_vec(py, data), column.width, &column.points)?,
            Data::U32(data) => shaped(PyArray1::from_vec(py, data), column.width, &column.points)?,
        };
        table(&all, &column.object)?.set_item(column.name, array)?;
    }
    Ok(all)
}

/// object -> column -> unit.
pub fn units<'py>(py: Python<'py>, columns: &[Column]) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for column in columns {
        table(&all, &column.object)?.set_item(&column.name, column.unit)?;
    }
    Ok(all)
}

fn table<'py>(all: &Bound<'py, PyDict>, object: &str) -> PyResult<Bound<'py, PyDict>> {
    if let Some(found) = all.get_item(object)? {
        return Ok(found.cast_into::<PyDict>()?);
    }
    let new = PyDict::new(all.py());
    all.set_item(object, &new)?;
    Ok(new)
}

fn shaped<'py, T: numpy::Element>(array: Bound<'py, PyArray1<T>>, width: usize, points: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    let width = (width > 1).then_some(width);
    if points.is_empty() {
        let Some(width) = width else { return Ok(array.into_any()) };
        let rows = array.len()? / width;
        return Ok(array.reshape([rows, width])?.into_any());
    }
    // The first axis is the fastest in memory, but the numbers of a row stay together.
    let shape: Vec<usize> = points.iter().rev().copied().chain(width).collect();
    let mut axes: Vec<usize> = (0..points.len()).rev().collect();
    axes.extend(width.map(|_| points.len()));
    Ok(array.reshape(shape)?.permute(Some(axes))?.into_any())
}
