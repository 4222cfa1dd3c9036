//! The verification tests in double precision, in one program: many small ones take minutes to link.
//!
//! `cargo test --release -p tumble-f64 --test verification hair::` runs one file of them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

mod common;

mod advection;
mod air;
mod bodies;
mod broken;
mod character;
mod cloth;
mod compressible;
mod conservation;
mod contact;
mod contact_sweep;
mod converged;
mod coupling;
mod damping;
mod densities;
mod draping;
mod electrostatics;
mod elements;
mod emission;
mod events;
mod fabrics;
mod fire;
mod flock;
mod forces;
mod free_bodies;
mod galaxy;
mod gas;
mod gravitation;
mod hair;
mod hand;
mod heat;
mod integrators_order;
mod integrators_oscillator;
mod layers;
mod liquids;
mod mesh_contact;
mod neighbours;
mod operators;
mod pattern;
mod pinned_velocity;
mod position_based;
mod position_based_scenes;
mod pressure;
mod projections;
mod rod_loops;
mod rods_and_emitters;
mod rods_position_based;
mod sheets;
mod shells;
mod single_steps;
mod solid_edges;
mod solids;
mod stability_estimate;
mod statics;
mod surfaces;
mod tear;
mod tied_shapes;
mod trails;
