//! tumble: a physical-simulation engine for computer animation and for learning it.
//!
//! A [`Scene`](tumble_interface::Scene) goes in, [`Frame`](tumble_interface::Frame)s come out; between them stands a
//! [`Simulation`](scene::Simulation). No files, no clock, no GPU here. Layers, each importing only those before it (`tests/layers.rs`
//! enforces it): math, geometry, linalg, reference, state, operators, elements, forces, integrators, exchange, fluids, system, pool,
//! systems, world, recipes, scene.

// One source for two scalars: what converts in one engine is idle in the other.
#![cfg_attr(feature = "double", allow(clippy::useless_conversion, clippy::unnecessary_cast))]

pub mod elements;
pub mod exchange;
pub mod fluids;
pub mod forces;
pub mod geometry;
pub mod integrators;
pub mod linalg;
pub mod math;
pub mod operators;
pub mod pool;
pub mod recipes;
pub mod reference;
pub mod scene;
pub mod state;
pub mod system;
pub mod systems;
pub mod world;
