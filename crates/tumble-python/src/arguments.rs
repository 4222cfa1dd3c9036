//! Arguments that are checked before they are used.

use crate::errors::scene_error;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use tumble_interface::SceneError;
use tumble_interface::check::suggestion;

/// A whole number, one of Python or of NumPy, from `least` to `most`; the error names the argument.
pub fn whole(value: &Bound<'_, PyAny>, name: &str, least: u64, most: u64) -> PyResult<u64> {
    let number = value.call_method0("__index__").and_then(|n| n.extract::<u64>()).ok();
    number.filter(|n| (least..=most).contains(n)).ok_or_else(|| {
        let shown = value.repr().map_or_else(|_| "that".into(), |text| text.to_string());
        let most = if most == u64::MAX { String::new() } else { format!(" and <= {most}") };
        scene_error(value.py(), &SceneError::one(name, format!("{shown}, expected a whole number >= {least}{most}")))
    })
}

/// The same as a count of things in memory.
pub fn count(value: &Bound<'_, PyAny>, name: &str, least: u64) -> PyResult<usize> {
    whole(value, name, least, u64::from(u32::MAX)).map(|n| n as usize)
}

/// The text of a path.
pub fn text<'a>(py: Python<'_>, path: &'a Path) -> PyResult<&'a str> {
    path.to_str().ok_or_else(|| {
        let message = format!("\"{}\" is no name in UTF-8; rename the file", path.display());
        scene_error(py, &SceneError::one("", message))
    })
}

/// The text of an object of `pathlib`.
pub fn path_of(value: &Bound<'_, PyAny>) -> Option<String> {
    let path = value.hasattr("__fspath__").ok().filter(|has| *has).and_then(|_| value.extract::<PathBuf>().ok())?;
    Some(path.to_str()?.to_string())
}

/// What is wrong with a name that is none of those known, with the nearest.
pub fn unknown(what: &str, name: &str, known: &[&str]) -> String {
    let list: Vec<String> = known.iter().map(|k| format!("\"{k}\"")).collect();
    format!("{what}: \"{name}\", expected one of {}{}", list.join(", "), suggestion(name, known.iter().copied()))
}
