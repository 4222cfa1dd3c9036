//! Errors that stop a step of a fluid.

use crate::linalg::poisson::Fault;
use crate::state::GridError;

/// Errors that stop a step.
#[derive(Debug)]
pub enum Failure {
    /// Fields that do not fit: no scene reaches this.
    Grid(GridError),
    /// The pressure cannot be found.
    Pressure(Fault),
    /// The pressure was not found well enough.
    Unconverged {
        /// Iterations made.
        iterations: usize,
        /// |div u| dx over the fastest velocity.
        reached: f64,
        /// The requested value.
        asked: f64,
    },
}

impl From<GridError> for Failure {
    fn from(error: GridError) -> Self {
        Self::Grid(error)
    }
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Grid(error) => error.fmt(f),
            Self::Pressure(fault) => fault.fmt(f),
            Self::Unconverged { iterations, reached, asked } => write!(
                f,
                "the pressure solver stopped after {iterations} iterations at |div u| dx/|u| = {reached:.2e}, asked for {asked:.2e}; raise \
                 pressure.iterations or pressure.tolerance, or set pressure.on_failure = \"warn\""
            ),
        }
    }
}
