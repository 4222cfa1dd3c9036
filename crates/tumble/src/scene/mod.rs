//! L8: from a scene to a simulation.

mod build;
mod checks;
mod coupling;
mod cures;
mod gas;
pub mod hand;
mod hints;
mod laws;
mod memory;
mod simulation;

pub use memory::memory;
pub use simulation::Simulation;

use std::collections::HashMap;
use std::sync::Arc;
use tumble_interface::Mesh;

/// The meshes that a scene names, by path, as they stand in their files.
pub type Assets = Arc<HashMap<String, Mesh>>;
