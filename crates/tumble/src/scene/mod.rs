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
mod plausible;
mod simulation;

pub use memory::memory;
pub use simulation::Simulation;
pub use tumble_interface::Assets;
