//! tumble: a physical-simulation engine for computer animation and for learning it.
pub mod elements;
pub mod math;
