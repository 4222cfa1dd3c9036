//! Resistance of the medium: viscous and quadratic damping.

use super::push::{Push, derivatives, push};
use super::{Force, Group, One};
use crate::elements::Block;
use crate::math::rows::{self, Each};
use crate::math::{Lane, Real, Row, Signal, Vec3, ZERO};

/// f = -(k_d + c |v|) v with k_d = coefficient + rate m.                          (particles.3)
///
/// coefficient [N s/m]   rate [1/s]   c = quadratic [kg/m]. It damps every motion, falling too.
#[derive(Debug, Clone, Copy)]
pub struct Drag {
    /// The same for every mass [N s/m].
    pub coefficient: f64,
    /// Per mass [1/s].
    pub rate: f64,
    /// In front of the square of the speed [kg/m].
    pub quadratic: f64,
}

impl Each for &Drag {
    #[inline(always)]
    fn at<L: Lane>(&self, mass: L, v: L, _: L, force: L) -> L {
        force - (mass.like(self.coefficient) + mass.like(self.rate) * mass) * v
    }
}

impl Push for Drag {
    #[inline(always)]
    fn at<L: Lane>(&self, mass: L, _: Vec3<L>, v: Vec3<L>) -> Vec3<L> {
        -(v * (mass.like(self.coefficient) + mass.like(self.rate) * mass + mass.like(self.quadratic) * v.norm_sq().sqrt()))
    }
}

impl Drag {
    /// Adds the forces [N] on a group of masses.
    pub fn add(&self, group: Group<'_>, force: &mut [Row]) {
        if self.quadratic == 0.0 {
            rows::each(force, group.mass, group.v, ZERO, self);
        } else {
            push(self, group, force);
        }
    }

    fn matrix(&self, one: &One) -> (Block, Block) {
        if self.quadratic == 0.0 {
            let d = (self.coefficient + self.rate * one.mass) as Real;
            return ([0.0; 6], [d, d, d, 0.0, 0.0, 0.0]);
        }
        derivatives(self, one.mass, one)
    }
}

/// Drag whose coefficients may change in time.
pub struct Medium {
    /// [N s/m]
    pub coefficient: Signal,
    /// [1/s]
    pub rate: Signal,
    /// [kg/m]
    pub quadratic: Signal,
    /// The largest of each during the run.
    pub largest: Drag,
}

impl From<Drag> for Medium {
    fn from(drag: Drag) -> Self {
        let Drag { coefficient, rate, quadratic } = drag;
        Self { coefficient: coefficient.into(), rate: rate.into(), quadratic: quadratic.into(), largest: drag }
    }
}

impl Medium {
    /// The drag at a time [s].
    pub fn at(&self, t: f64) -> Drag {
        Drag { coefficient: self.coefficient.value(t), rate: self.rate.value(t), quadratic: self.quadratic.value(t) }
    }
}

impl Force for Medium {
    fn add(&self, t: f64, group: Group<'_>, force: &mut [Row]) {
        self.at(t).add(group, force);
    }

    fn matrix(&self, t: f64, one: &One) -> (Block, Block) {
        self.at(t).matrix(one)
    }

    fn largest_matrix(&self, one: &One) -> (Block, Block) {
        self.largest.matrix(one)
    }
}
