//! Viscous damping.

use super::Force;
use crate::elements::Block;
use crate::math::{Real, Row, Vec3, axpy};

/// f = -k_d v with k_d = coefficient + rate m.                          (springs.5)
///
/// coefficient [N s/m]   rate [1/s]. It damps every motion, falling too.
pub struct Drag {
    /// The same for every mass [N s/m].
    pub coefficient: f64,
    /// Per mass [1/s].
    pub rate: f64,
}

impl Force for Drag {
    fn add(&self, _t: f64, mass: &[Real], _x: &[Row], v: &[Row], force: &mut [Row]) {
        let (coefficient, rate) = (self.coefficient as Real, self.rate as Real);
        for ((f, m), v) in force.iter_mut().zip(mass).zip(v) {
            *f = axpy(*f, -(coefficient + rate * m), *v);
        }
    }

    fn matrix(&self, _t: f64, mass: f64, _x: Vec3<f64>, _v: Vec3<f64>) -> (Block, Block) {
        let d = (self.coefficient + self.rate * mass) as Real;
        ([0.0; 6], [d, d, d, 0.0, 0.0, 0.0])
    }
}
