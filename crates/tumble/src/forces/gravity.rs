//! Uniform gravity.

use crate::math::VectorSignal;

/// Gravity [m/s²], which may change in time.
#[derive(Debug, Clone)]
pub struct Gravity {
    /// As a function of time.
    pub course: VectorSignal,
    /// The largest length that it has.
    pub largest: f64,
}

impl Default for Gravity {
    fn default() -> Self {
        Self { course: [0.0; 3].into(), largest: 0.0 }
    }
}

impl Gravity {
    /// At a time [s].
    pub fn at(&self, t: f64) -> [f64; 3] {
        match &self.course {
            VectorSignal::Constant(value) => *value,
            course => course.value(t).into(),
        }
    }
}
