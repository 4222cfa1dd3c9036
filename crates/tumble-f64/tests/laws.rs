//! The verification tests in double precision of forces, elements, integrators, and fields on grids, in one program:
//! many small ones take minutes to link. Those of structures, cloth, hair, rods, solids, contact and particles are in `verification.rs`; two
//! programs keep both cores busy. Those that compile kernels of the engine for themselves are in `kernels.rs`.
//!
//! `cargo test --release -p tumble-verification --test laws heat::` runs one file of them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

mod common;

mod advection;
mod air;
mod bodies;
mod compressible;
mod conservation;
mod coupling;
mod crowd_journeys;
mod crowd_links;
mod crowd_models;
mod crowd_smoke;
mod crowds;
mod damping;
mod densities;
mod electrostatics;
mod fire;
mod flock;
mod forces;
mod galaxy;
mod gas;
mod gravitation;
mod heat;
mod immersed;
mod integrators_order;
mod integrators_oscillator;
mod liquid;
mod liquid_bodies;
mod liquid_flow;
mod neighbours;
mod operators;
mod projections;
mod reflection;
mod rimea;
mod rocks;
mod shape_contact;
mod sheets;
mod single_steps;
mod solids;
mod stability_estimate;
mod thin_walls;
mod transport;
mod whitewater;
