//! L3: the verbs on grids, and between grids and particles. One code for two and three dimensions: what a plane does not have is left out of sums over axes.
//!
//! Fields know their places and what is beyond their walls; an operator refuses fields at other places. The caller owns the
//! results. Sums have a fixed order and every row is worked out for itself: the same bits on any number of threads and any width
//! of registers.

pub mod advect;
pub mod differences;
pub mod diffuse;
pub mod sample;
mod stencil;
mod transfer;
mod transport;

pub use advect::{Advection, Trace, advect, advect_vectors};
pub use differences::{average, curl, directional, divergence, gradient, laplacian, upwind, vector_laplacian};
pub use diffuse::{diffuse, diffuse_step, diffusion_limit};
pub use sample::{Interpolation, sample};
pub use stencil::{each_row, each_row_of, ghosted};
pub use transfer::{Nodes, Spot, Transfer};
pub use transport::transport;
