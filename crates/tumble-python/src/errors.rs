//! TumbleError > SceneError, StepError, ExportError.

use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use pyo3::{create_exception, types::PyModule};
use tumble_interface::error::{Breakdown, Issue};

create_exception!(tumble, TumbleError, PyException, "Anything that tumble reports.");
create_exception!(tumble, SceneError, TumbleError, "The input is wrong. Its text names every place and its cure; `issues` lists them.");
create_exception!(
    tumble,
    StepError,
    TumbleError,
    "The simulation failed; the world stands at its last good frame. `report` has the figures."
);
create_exception!(tumble, ExportError, TumbleError, "A result could not be written or drawn.");

pub fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("TumbleError", py.get_type::<TumbleError>())?;
    module.add("SceneError", py.get_type::<SceneError>())?;
    module.add("StepError", py.get_type::<StepError>())?;
    module.add("ExportError", py.get_type::<ExportError>())
}

/// A SceneError with its list of issues.
pub fn scene_error(py: Python<'_>, error: &tumble_interface::SceneError) -> PyErr {
    let exception = SceneError::new_err(error.to_string());
    match pythonize::pythonize(py, &error.issues).map_err(PyErr::from).and_then(|issues| exception.value(py).setattr("issues", issues)) {
        Ok(()) => exception,
        Err(other) => other,
    }
}

/// A SceneError with the words that overrode a key in the place of a line, where they are to blame: `set` in its issues. Those of the
/// scene come first.
pub fn of_overrides(py: Python<'_>, issues: &[(Issue, Option<&str>)]) -> PyErr {
    let lines = issues.iter().map(|(issue, set)| set.map_or_else(|| issue.to_string(), |set| format!("set {set}: {issue}")));
    let exception = SceneError::new_err(lines.collect::<Vec<_>>().join("\n"));
    let fill = || -> PyResult<()> {
        let list = PyList::empty(py);
        for (issue, set) in issues {
            let entry = pythonize::pythonize(py, issue)?.cast_into::<PyDict>()?;
            if let Some(set) = set {
                entry.set_item("set", set)?;
            }
            list.append(entry)?;
        }
        exception.value(py).setattr("issues", list)
    };
    fill().err().unwrap_or(exception)
}

/// A StepError with its report.
pub fn step_error(py: Python<'_>, error: &tumble_interface::StepError) -> PyErr {
    use tumble_interface::StepError as E;
    let exception = StepError::new_err(error.to_string());
    let fill = || -> PyResult<()> {
        let report = PyDict::new(py);
        let broken = |kind: &str, b: &Breakdown| -> PyResult<()> {
            report.set_item("kind", kind)?;
            report.set_item("system", &b.system)?;
            report.set_item("object", &b.object)?;
            report.set_item("column", &b.column)?;
            report.set_item("index", b.index)?;
            report.set_item("id", b.id)?;
            report.set_item("time", b.time)?;
            report.set_item("integrator", &b.integrator)?;
            report.set_item("step", b.step)?;
            report.set_item("stable_step", b.stable_step)?;
            report.set_item("energy_ratio", b.energy_ratio)?;
            report.set_item("cause", &b.cause)
        };
        match error {
            E::NotFinite(b) => broken("not_finite", b)?,
            E::Exploded(b) => broken("exploded", b)?,
            E::Solve { system, time, iterations, residual, tolerance } => {
                report.set_item("kind", "solve")?;
                report.set_item("system", system)?;
                report.set_item("time", time)?;
                report.set_item("iterations", iterations)?;
                report.set_item("residual", residual)?;
                report.set_item("tolerance", tolerance)?;
            }
            E::StepTooSmall { system, time, step } => {
                report.set_item("kind", "step_too_small")?;
                report.set_item("system", system)?;
                report.set_item("time", time)?;
                report.set_item("step", step)?;
            }
            E::Capacity { system, time, what } => {
                report.set_item("kind", "capacity")?;
                report.set_item("system", system)?;
                report.set_item("time", time)?;
                report.set_item("message", what)?;
            }
            E::User(message) => {
                report.set_item("kind", "user")?;
                report.set_item("message", message)?;
            }
        }
        exception.value(py).setattr("report", report)
    };
    match fill() {
        Ok(()) => exception,
        Err(other) => other,
    }
}

/// Error of a file.
pub fn file_error(path: &std::path::Path, error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => format!("there is no file \"{}\"", path.display()),
        _ => format!("\"{}\" cannot be read: {error}", path.display()),
    }
}
