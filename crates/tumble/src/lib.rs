//! tumble: a physical-simulation engine for computer animation and for learning it.
pub mod elements;
pub mod geometry;
pub mod math;
pub mod integrators;
pub mod linalg;
pub mod exchange;
pub mod forces;
pub mod state;
pub mod system;
pub mod systems;
pub mod world;
