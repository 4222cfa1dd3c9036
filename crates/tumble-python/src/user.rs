//! Forces and integrators written in Python. They get and give arrays of shape n x 3.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::sync::{Arc, Mutex};
use tumble_interface::engine::{Acceleration, UserForce, UserIntegrator};

/// The last exception of a custom function: the cause of the StepError that follows.
#[derive(Clone, Default)]
pub struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
    /// Takes it out.
    pub fn take(&self) -> Option<PyErr> {
        self.0.lock().ok()?.take()
    }

    /// Keeps the error, and says who failed and how.
    fn keep(&self, py: Python<'_>, who: &str, function: &Bound<'_, PyAny>, error: PyErr) -> String {
        let function = name_of(function);
        let kind = error.get_type(py).name().map_or_else(|_| "error".into(), |n| n.to_string());
        let text = format!("the user's {who} {function} failed: {kind}: {}", error.value(py));
        if let Ok(mut raised) = self.0.lock() {
            *raised = Some(error);
        }
        text
    }
}

/// The name of a function, or of the class of what is called like one.
pub fn name_of(function: &Bound<'_, PyAny>) -> String {
    let own = function.getattr("__name__").and_then(|n| n.extract::<String>());
    own.unwrap_or_else(|_| function.get_type().name().map_or_else(|_| "without a name".into(), |n| n.to_string()))
}

/// force(t, x, v, mass) -> n x 3, and jacobian(t, x, v, mass) -> n x 3 x 3, or two of these.
pub struct Force(pub Py<PyAny>, pub Option<Py<PyAny>>, pub Raised);

/// step(t, h, x, v, acceleration) -> (x, v).
pub struct Integrator(pub Py<PyAny>, pub Raised);

fn array<'py>(py: Python<'py>, flat: &[f64]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_slice(py, flat).reshape([flat.len() / 3, 3])
}

/// The numbers of anything like an n x 3 array.
fn numbers(value: &Bound<'_, PyAny>, n: usize, what: &str) -> PyResult<Vec<f64>> {
    use pyo3::exceptions::{PyTypeError, PyValueError};
    let py = value.py();
    if value.is_none() {
        return Err(PyTypeError::new_err(format!("{what} is None, expected an array of shape ({n}, 3); is a return missing?")));
    }
    let array = py.import("numpy")?.call_method1("ascontiguousarray", (value, "float64"))?;
    let array = array.cast_into::<numpy::PyArrayDyn<f64>>()?;
    if array.shape() != [n, 3] {
        return Err(PyValueError::new_err(format!("{what} has shape {:?}, expected ({n}, 3)", array.shape())));
    }
    Ok(array.to_vec()?)
}

/// The numbers of anything like an n x 3 x 3 array.
fn matrices(value: &Bound<'_, PyAny>, n: usize) -> PyResult<Vec<[f64; 9]>> {
    use pyo3::exceptions::PyValueError;
    let py = value.py();
    let array = py.import("numpy")?.call_method1("ascontiguousarray", (value, "float64"))?;
    let array = array.cast_into::<numpy::PyArrayDyn<f64>>()?;
    if array.shape() != [n, 3, 3] {
        let message = format!(
            "what it returned has shape {:?}, expected ({n}, 3, 3), or a pair of these: by position and by velocity",
            array.shape()
        );
        return Err(PyValueError::new_err(message));
    }
    let flat: Vec<f64> = array.to_vec()?;
    if let Some(i) = flat.iter().position(|number| !number.is_finite()) {
        return Err(PyValueError::new_err(format!("what it returned is {} for particle {}, expected finite numbers", flat[i], i / 9)));
    }
    Ok(flat.as_chunks().0.to_vec())
}

impl UserForce for Force {
    fn force(&mut self, t: f64, x: &[f64], v: &[f64], mass: &[f64], force: &mut [f64]) -> Result<(), String> {
        Python::attach(|py| {
            let call = || -> PyResult<Vec<f64>> {
                let result = self.0.bind(py).call1((t, array(py, x)?, array(py, v)?, PyArray1::from_slice(py, mass)))?;
                let values = numbers(&result, mass.len(), "what it returned")?;
                let bad = values.iter().position(|f| !f.is_finite());
                // If the state itself has blown up, the report of the engine is more informative.
                if let Some(i) = bad.filter(|_| x.iter().chain(v).all(|y| y.is_finite())) {
                    let text = format!("what it returned is {} for particle {}, expected finite numbers", values[i], i / 3);
                    return Err(pyo3::exceptions::PyValueError::new_err(text));
                }
                Ok(values)
            };
            let values = call().map_err(|e| self.2.keep(py, "force", self.0.bind(py), e))?;
            force.iter_mut().zip(values).for_each(|(f, v)| *f += v);
            Ok(())
        })
    }

    fn jacobian(&mut self, t: f64, x: &[f64], v: &[f64], mass: &[f64]) -> Result<Option<Vec<[[f64; 9]; 2]>>, String> {
        let Some(function) = &self.1 else { return Ok(None) };
        Python::attach(|py| {
            let call = || -> PyResult<Vec<[[f64; 9]; 2]>> {
                let result = function.bind(py).call1((t, array(py, x)?, array(py, v)?, PyArray1::from_slice(py, mass)))?;
                let n = mass.len();
                let [by_x, by_v] = match result.cast::<pyo3::types::PyTuple>() {
                    Ok(both) if both.len() == 2 => [matrices(&both.get_item(0)?, n)?, matrices(&both.get_item(1)?, n)?],
                    _ => [matrices(&result, n)?, vec![[0.0; 9]; n]],
                };
                Ok(by_x.into_iter().zip(by_v).map(|(k, d)| [k, d]).collect())
            };
            call().map(Some).map_err(|e| self.2.keep(py, "jacobian", function.bind(py), e))
        })
    }
}

/// The acceleration as a Python callable, valid only within the step that it was made for.
#[pyclass]
struct Rate {
    /// Asks with (t, x, v); the engine answers on the other side.
    ask: std::sync::Mutex<Option<Borrowed>>,
}

/// A borrowed acceleration. It never outlives the step: `Integrator::step` takes it back before it returns.
struct Borrowed(*mut Acceleration<'static>);

// SAFETY: the closure behind the pointer is Send, and the mutex around it gives one thread at a time access.
unsafe impl Send for Borrowed {}

#[pymethods]
impl Rate {
    fn __call__<'py>(&self, py: Python<'py>, t: f64, x: &Bound<'py, PyAny>, v: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        use pyo3::exceptions::{PyRuntimeError, PyValueError};
        let n = x.len()?;
        let (x, v) = (numbers(x, n, "x")?, numbers(v, n, "v")?);
        let mut guard = self.ask.lock().map_err(|_| PyRuntimeError::new_err("acceleration was called while it failed"))?;
        let Some(borrowed) = guard.as_mut() else {
            return Err(PyRuntimeError::new_err("acceleration can be called only within the step it was given to"));
        };
        // SAFETY: the pointer is taken back before the closure ends, and the lock is held while it is used.
        let acceleration = unsafe { &mut *borrowed.0 };
        let a = acceleration(t, &x, &v).map_err(PyValueError::new_err)?;
        array(py, &a)
    }
}

impl UserIntegrator for Integrator {
    fn step(&mut self, t: f64, h: f64, x: &mut [f64], v: &mut [f64], acceleration: &mut Acceleration<'_>) -> Result<(), String> {
        Python::attach(|py| {
            let mut call = || -> PyResult<(Vec<f64>, Vec<f64>)> {
                let pointer: *mut Acceleration<'_> = acceleration;
                // SAFETY: only the lifetime is changed; the pointer is taken back below, before the borrow ends.
                let pointer: *mut Acceleration<'static> = unsafe { std::mem::transmute(pointer) };
                let rate = Bound::new(py, Rate { ask: std::sync::Mutex::new(Some(Borrowed(pointer))) })?;
                let result = self.0.bind(py).call1((t, h, array(py, x)?, array(py, v)?, &rate));
                if let Ok(mut ask) = rate.borrow().ask.lock() {
                    *ask = None;
                }
                let pair = result?;
                let both: Vec<Bound<'_, PyAny>> = pair.try_iter().and_then(Iterator::collect).unwrap_or_default();
                let [x1, v1] = &both[..] else {
                    let kind = pair.get_type().name().map_or_else(|_| "value".into(), |n| n.to_string());
                    return Err(pyo3::exceptions::PyTypeError::new_err(format!("it returned a {kind}, expected (x, v)")));
                };
                Ok((numbers(x1, x.len() / 3, "x")?, numbers(v1, v.len() / 3, "v")?))
            };
            let (x1, v1) = call().map_err(|e| self.1.keep(py, "integrator", self.0.bind(py), e))?;
            x.copy_from_slice(&x1);
            v.copy_from_slice(&v1);
            Ok(())
        })
    }
}
