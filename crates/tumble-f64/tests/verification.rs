//! The verification tests in double precision of structures, cloth, hair, rods, solids, contact and particles, in one program:
//! many small ones take minutes to link. Those of forces, elements, integrators, and fields on grids are in `laws.rs`; two programs keep both cores busy.
//!
//! `cargo test --release -p tumble-verification --test verification hair::` runs one file of them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

mod common;

mod afloat;
mod animated;
mod arranged;
mod bending;
mod births;
mod broken;
mod chains;
mod character;
mod clamps;
mod cloth;
mod clumps;
mod compounds;
mod contact;
mod contact_cost;
mod contact_sweep;
mod converged;
mod coupled;
mod draping;
mod emission;
mod emission_in_time;
mod events;
mod fabrics;
mod fractures;
mod free_bodies;
mod grains;
mod granular;
mod guides;
mod hair;
mod hand;
mod hard_grains;
mod joints;
mod layers;
mod liquid_loads;
mod liquids;
mod loads;
mod locking;
mod mesh_contact;
mod pattern;
mod pinned_velocity;
mod pins_in_time;
mod planar;
mod position_based;
mod position_based_scenes;
mod pouring;
mod reaction;
mod rigid;
mod rod_loops;
mod rods_and_emitters;
mod rods_position_based;
mod shells;
mod sleep;
mod solid_edges;
mod statics;
mod surfaces;
mod tear;
mod tied_shapes;
mod trails;
