//! A given force that some masses share.

use super::acceleration::Uniform;
use super::{Force, Group, One};
use crate::elements::Block;
use crate::math::rows;
use crate::math::{Real, Row, VectorSignal};

/// f = m/M F(t): a force that is a function of time, shared in proportion to masses of M together.              (particles.12)
pub struct Load {
    /// F [N].
    pub force: VectorSignal,
    /// M [kg].
    pub mass: f64,
}

impl Force for Load {
    fn add(&self, t: f64, group: Group<'_>, force: &mut [Row]) {
        let a = self.force.value(t) * (1.0 / self.mass);
        rows::each(force, group.mass, group.x, [a.x as Real, a.y as Real, a.z as Real, 0.0], Uniform);
    }

    /// Known while it is the same at all times.
    fn energy(&self, t: f64, one: &One) -> Option<f64> {
        self.force.is_constant().then(|| -one.mass / self.mass * self.force.value(t).dot(one.x))
    }

    fn drives(&self) -> bool {
        !self.force.is_constant()
    }

    fn matrix(&self, _t: f64, _one: &One) -> (Block, Block) {
        ([0.0; 6], [0.0; 6])
    }
}
