//! The tests of what is generic: they compile kernels of the engine for themselves, and so with its optimisation.
//!
//! `cargo test --release -p tumble-f64 --test kernels pressure::` runs one file of them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

mod elements;
mod pressure;
