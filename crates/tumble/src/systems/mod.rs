//! L5: the numerical methods. None imports another.

pub mod dynamics;
pub mod gas;
pub mod tracers;
pub mod vicsek;
