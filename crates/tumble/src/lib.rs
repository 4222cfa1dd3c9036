//! tumble: a physical-simulation engine for computer animation and for learning it.
//!
//! A [`Scene`](tumble_interface::Scene) goes in, [`Frame`](tumble_interface::Frame)s come out; between them stands a
//! [`Simulation`](scene::Simulation). No files, no clock, no GPU here. Modules import only those above them in this list;
//! `tests/layers.rs` enforces it.

pub mod math;
pub mod geometry;
pub mod linalg;
pub mod reference;
pub mod state;
pub mod elements;
pub mod forces;
pub mod integrators;
pub mod exchange;
pub mod system;
pub mod systems;
pub mod world;
pub mod recipes;
pub mod scene;
