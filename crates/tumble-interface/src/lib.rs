//! The two doors of the engine: a [`scene::Scene`] goes in, [`frame::Frame`]s come out.
//!
//! Nothing here depends on the engine's scalar type, so the single- and the double-precision engine
//! share it, and fronts (Python, command line, browser) see both through one [`engine::Engine`] trait.

pub mod assets;
pub mod character;
pub mod check;
pub mod columns;
pub mod engine;
pub mod error;
pub mod fabric;
pub mod fault;
pub mod frame;
pub mod kinds;
pub mod looks;
pub mod measures;
pub mod mesh;
pub mod repair;
pub mod scene;
pub mod tree;
pub mod triples;
pub mod warning;

pub use assets::{Assets, Curves};
pub use character::Character;
pub use engine::Engine;
pub use error::{Issue, SceneError, StepError};
pub use fabric::Fabric;
pub use frame::{Column, Data, Frame};
pub use mesh::Mesh;
pub use scene::Scene;
pub use warning::Warning;
