//! L3: forces that act on each mass by itself, and velocity fields. One file per law.

mod attraction;
mod drag;
mod field;
mod gravitation;

pub use attraction::Attraction;
pub use drag::Drag;
pub use field::Flow;
pub use gravitation::Gravitation;

use crate::elements::Block;
use crate::math::rows::{self, Each};
use crate::math::{Lane, Real, Row, Vec3};

/// A force on every mass by itself. Slices are the rows of the masses it acts on.
pub trait Force: Send + Sync {
    /// Adds the forces [N] at time t [s].
    fn add(&self, t: f64, mass: &[Real], x: &[Row], v: &[Row], force: &mut [Row]);

    /// Potential energy of one mass [J]; `None` for a force that has none, wherever the mass is.
    fn energy(&self, _t: f64, _mass: f64, _x: Vec3<f64>) -> Option<f64> {
        None
    }

    /// -df/dx [N/m] and -df/dv [N s/m] of one mass, for implicit schemes; a symmetric approximation will do.
    fn matrix(&self, t: f64, mass: f64, x: Vec3<f64>, v: Vec3<f64>) -> (Block, Block);
}

/// A uniform acceleration, f = m a.
pub struct Acceleration(pub [f64; 3]);

impl Each for &Acceleration {
    #[inline(always)]
    fn at<L: Lane>(&self, mass: L, _: L, acceleration: L, force: L) -> L {
        force + mass * acceleration
    }
}

impl Force for Acceleration {
    fn add(&self, _t: f64, mass: &[Real], x: &[Row], _v: &[Row], force: &mut [Row]) {
        let [ax, ay, az] = self.0.map(|a| a as Real);
        rows::each(force, mass, x, [ax, ay, az, 0.0], self);
    }

    fn energy(&self, _t: f64, mass: f64, x: Vec3<f64>) -> Option<f64> {
        Some(-mass * Vec3::from(self.0).dot(x))
    }

    fn matrix(&self, _: f64, _: f64, _: Vec3<f64>, _: Vec3<f64>) -> (Block, Block) {
        ([0.0; 6], [0.0; 6])
    }
}
