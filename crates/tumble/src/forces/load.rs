//! A given force on some masses.

use super::{Force, Group, One};
use crate::elements::Block;
use crate::math::{Real, Row, Vec3, VectorSignal, add, row};

/// f = s F(t): a share s of a force that is a function of time.                 (particles.12)
pub struct Load {
    /// F [N].
    pub force: VectorSignal,
    /// The share of each mass [1].
    pub share: f64,
}

impl Force for Load {
    fn add(&self, t: f64, _: Group<'_>, force: &mut [Row]) {
        let f = self.force.value(t) * self.share;
        let f = row(Vec3 { x: f.x as Real, y: f.y as Real, z: f.z as Real }, 0.0);
        force.iter_mut().for_each(|force| *force = add(*force, f));
    }

    /// Known while it is the same at all times.
    fn energy(&self, t: f64, one: &One) -> Option<f64> {
        self.force.is_constant().then(|| -self.share * self.force.value(t).dot(one.x))
    }

    fn matrix(&self, _t: f64, _one: &One) -> (Block, Block) {
        ([0.0; 6], [0.0; 6])
    }
}
