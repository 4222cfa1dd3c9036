//! Changes of velocities, and what velocities gain until the time of the next forces.

use crate::geometry::Vector;
use crate::math::{Real, Row};

/// Numbers of a grain in `Bed::quick`.
pub const QUICK: usize = 4;

/// A change of velocities.
#[derive(Debug, Clone, Copy)]
pub struct Kick {
    /// For so long [s], within a step of so long [s].
    pub h: f64,
    pub step: f64,
    /// Whether it is the first of an interval, before which no forces are known.
    pub first: bool,
}

impl Kick {
    /// What a velocity gains in half a step by the mean of the last two accelerations, given that of the last [m/s²]; `last` is half of what the one
    /// before gave, and becomes half of what this one gives.                                                         (grains.8)
    pub fn gain(&self, acceleration: Vector, last: Vector) -> [Vector; 2] {
        let half = acceleration * (0.25 * self.step);
        [half + if self.first { half } else { last }, half]
    }
}

/// A vector in the engine's scalar.
pub fn narrow(v: Vector) -> Row {
    [v.x as Real, v.y as Real, v.z as Real, 0.0]
}
