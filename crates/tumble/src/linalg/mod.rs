//! L1: linear solvers. Each has parameters, an info with iterations and residual, and no hidden failure.

pub mod blocks;
pub mod cholesky;
pub mod pcg;
pub mod poisson;
