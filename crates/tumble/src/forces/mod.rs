//! L3: forces that act on each mass by itself, and velocity fields. One file per law.

mod attraction;
mod drag;
mod field;

pub use attraction::Attraction;
pub use drag::Drag;
pub use field::Flow;

use crate::elements::Block;
use crate::math::{Real, Row, Vec3};

/// A force on every mass by itself. Slices are the rows of the masses it acts on.
pub trait Force: Send + Sync {
    /// Adds the forces [N] at time t [s].
    fn add(&self, t: f64, mass: &[Real], x: &[Row], v: &[Row], force: &mut [Row]);

    /// Potential energy of one mass [J]; 0 for a force that has none.
    fn energy(&self, _t: f64, _mass: f64, _x: Vec3<f64>) -> f64 {
        0.0
    }

    /// -df/dx [N/m] and -df/dv [N s/m] of one mass, for implicit schemes; a symmetric approximation will do.
    fn matrix(&self, t: f64, mass: f64, x: Vec3<f64>, v: Vec3<f64>) -> (Block, Block);
}

/// A uniform acceleration, f = m a.
pub struct Acceleration(pub [f64; 3]);

impl Force for Acceleration {
    fn add(&self, _t: f64, mass: &[Real], _x: &[Row], _v: &[Row], force: &mut [Row]) {
        let a = self.0.map(|a| a as Real);
        for (f, m) in force.iter_mut().zip(mass) {
            *f = [f[0] + m * a[0], f[1] + m * a[1], f[2] + m * a[2], f[3]];
        }
    }

    fn energy(&self, _t: f64, mass: f64, x: Vec3<f64>) -> f64 {
        -mass * Vec3::from(self.0).dot(x)
    }

    fn matrix(&self, _: f64, _: f64, _: Vec3<f64>, _: Vec3<f64>) -> (Block, Block) {
        ([0.0; 6], [0.0; 6])
    }
}
