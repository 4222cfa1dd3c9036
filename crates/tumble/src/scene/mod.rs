//! L8: from a scene to a simulation.

mod build;
mod camera;
mod checks;
mod coincident;
mod coupling;
mod cures;
mod far;
mod grids;
pub mod hand;
mod hints;
mod laws;
mod locking;
mod looks;
mod memory;
mod methods;
mod overrides;
mod plausible;
mod simulation;

pub use camera::{Camera, Sight};
pub use looks::looks;
pub use memory::memory;
pub use methods::{facts, resolve};
pub use overrides::{set, set_text};
pub use simulation::Simulation;
pub use tumble_interface::Assets;
