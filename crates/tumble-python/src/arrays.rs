//! Columns as NumPy arrays.

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use tumble_interface::{Column, Data};

/// object -> column -> array, of shape (n,) or (n, width).
pub fn columns<'py>(py: Python<'py>, columns: Vec<Column>) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for column in columns {
        let array = match column.data {
            Data::F32(data) => shaped(PyArray1::from_vec(py, data), column.width)?,
            Data::F64(data) => shaped(PyArray1::from_vec(py, data), column.width)?,
            Data::U32(data) => shaped(PyArray1::from_vec(py, data), column.width)?,
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

fn shaped<'py, T: numpy::Element>(array: Bound<'py, PyArray1<T>>, width: usize) -> PyResult<Bound<'py, PyAny>> {
    if width == 1 {
        return Ok(array.into_any());
    }
    let rows = array.len()? / width;
    Ok(array.reshape([rows, width])?.into_any())
}
