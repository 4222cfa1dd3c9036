//! The tests of crates/tumble/tests/determinism.rs in double precision.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

extern crate tumble_f64 as tumble;

#[path = "../../tumble/tests/determinism.rs"]
mod single;
