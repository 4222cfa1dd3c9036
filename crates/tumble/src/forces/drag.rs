//! Viscous damping.

use super::{Force, Group, One};
use crate::elements::Block;
use crate::math::rows::{self, Each};
use crate::math::{Lane, Real, Row, ZERO};

/// f = -k_d v with k_d = coefficient + rate m.                          (springs.5)
///
/// coefficient [N s/m]   rate [1/s]. It damps every motion, falling too.
pub struct Drag {
    /// The same for every mass [N s/m].
    pub coefficient: f64,
    /// Per mass [1/s].
    pub rate: f64,
}

impl Each for &Drag {
    #[inline(always)]
    fn at<L: Lane>(&self, mass: L, v: L, _: L, force: L) -> L {
        force - (mass.like(self.coefficient) + mass.like(self.rate) * mass) * v
    }
}

impl Force for Drag {
    fn add(&self, _t: f64, group: Group<'_>, force: &mut [Row]) {
        rows::each(force, group.mass, group.v, ZERO, self);
    }

    fn matrix(&self, _t: f64, one: &One) -> (Block, Block) {
        let d = (self.coefficient + self.rate * one.mass) as Real;
        ([0.0; 6], [d, d, d, 0.0, 0.0, 0.0])
    }
}
