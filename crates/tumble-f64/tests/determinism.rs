//! The tests of crates/tumble/tests/determinism.rs in double precision.

extern crate tumble_f64 as tumble;

#[path = "../../tumble/tests/determinism.rs"]
mod single;
