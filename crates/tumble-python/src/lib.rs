//! The binding: Scene, World, Frame -> NumPy, and the error tree. No physics.

mod arguments;
mod arrays;
mod errors;
mod fields;
mod plan;
mod projection;
mod scene;
mod user;
mod vdb;
mod world;

use pyo3::prelude::*;

#[pymodule]
mod _engine {
    use super::{PyResult, errors};
    use pyo3::prelude::{Bound, PyAny, PyModule, PyModuleMethods, Python, pyfunction};

    #[pymodule_export]
    use super::fields::{
        Field, Grid, advect, average, curl, diffuse, diffusion_limit, directional, divergence, gradient, laplacian, sample,
    };
    #[pymodule_export]
    use super::plan::{check_plan, plan, repair_plan};
    #[pymodule_export]
    use super::projection::{Projection, project};
    #[pymodule_export]
    use super::scene::{Scene, load_fabric, load_mesh, looks, repair_mesh, sights};
    #[pymodule_export]
    use super::vdb::write_vdb;
    #[pymodule_export]
    use super::world::World;

    /// What the engine says of its numbers, each described once; see `tumble.measures`.
    #[pyfunction]
    fn tables(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        let mut tables = tumble_interface::measures::tables();
        tables["methods"] = serde_json::json!(tumble::scene::facts());
        Ok(pythonize::pythonize(py, &tables)?)
    }

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("version", env!("CARGO_PKG_VERSION"))?;
        module.add("commit", option_env!("TUMBLE_COMMIT"))?;
        // To compare with the engine of browsers, whose registers are half as wide.
        if std::env::var("TUMBLE_REGISTERS").is_ok_and(|bits| bits == "256") {
            tumble::math::simd::hold_to(tumble::math::simd::Level::Avx2);
            tumble_f64::math::simd::hold_to(tumble_f64::math::simd::Level::Avx2);
        }
        module.add("instructions", tumble::math::simd::widest().name())?;
        errors::add(module)
    }
}

/// The clock of nobody: lets the interpreter look for Ctrl-C.
fn interrupted() -> Option<PyErr> {
    Python::attach(|py| py.check_signals().err())
}
