//! A given acceleration: uniform, changing in time, or a formula of place and velocity.

use super::push::{differences, near};
use super::{Force, Group, One};
use crate::elements::Block;
use crate::math::rows::{self, Each};
use crate::math::{Lane, Real, Row, Vec3, VectorSignal, row};

/// f = m a(x, v, t)                                                            (particles.2)
pub struct Acceleration(pub VectorSignal);

/// f + m a
pub(super) struct Uniform;

impl Each for Uniform {
    #[inline(always)]
    fn at<L: Lane>(&self, mass: L, _: L, acceleration: L, force: L) -> L {
        force + mass * acceleration
    }
}

impl Force for Acceleration {
    fn add(&self, t: f64, group: Group<'_>, force: &mut [Row]) {
        let varies = self.0.rows(t, group.x, group.v, |i, a| {
            let a = Vec3 { x: a.x as Real, y: a.y as Real, z: a.z as Real };
            force[i] = crate::math::add(force[i], row(a * group.mass[i], 0.0));
        });
        if !varies {
            let a = self.0.value(t);
            rows::each(force, group.mass, group.x, [a.x as Real, a.y as Real, a.z as Real, 0.0], Uniform);
        }
    }

    /// Known while it is the same everywhere, at all times.
    fn energy(&self, t: f64, one: &One) -> Option<f64> {
        self.0.is_constant().then(|| -one.mass * self.0.value(t).dot(one.x))
    }

    /// By central differences.
    fn matrix(&self, t: f64, one: &One) -> (Block, Block) {
        if self.0.is_uniform() {
            return ([0.0; 6], [0.0; 6]);
        }
        differences(|x, v| self.0.at(t, x, v) * one.mass, one, near(one.x.norm()), near(one.v.norm()))
    }
}
