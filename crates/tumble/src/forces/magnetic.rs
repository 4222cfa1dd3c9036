//! Electric and magnetic fields, which act on charges.

use super::push::{Push, push_by};
use super::{Force, Group, One};
use crate::elements::Block;
use crate::math::{Lane, Real, Row, Vec3, VectorSignal, row};

/// f = q v x B                                                                 (particles.8)
///
/// q [C]   B [T], everywhere the same or a formula. It does no work.
pub struct Magnetic(pub VectorSignal);

/// f = q E                                                                     (particles.9)
///
/// q [C]   E [V/m], everywhere the same or a formula. The energy is -q E x where E is constant.
pub struct Electric(pub VectorSignal);

struct Turn(Vec3<f64>);

struct Pull(Vec3<f64>);

impl Push for Turn {
    #[inline(always)]
    fn at<L: Lane>(&self, charge: L, _: Vec3<L>, v: Vec3<L>) -> Vec3<L> {
        v.cross(Vec3 { x: charge.like(self.0.x), y: charge.like(self.0.y), z: charge.like(self.0.z) }) * charge
    }
}

impl Push for Pull {
    #[inline(always)]
    fn at<L: Lane>(&self, charge: L, _: Vec3<L>, _: Vec3<L>) -> Vec3<L> {
        Vec3 { x: charge.like(self.0.x), y: charge.like(self.0.y), z: charge.like(self.0.z) } * charge
    }
}

impl Force for Magnetic {
    fn add(&self, t: f64, group: Group<'_>, force: &mut [Row]) {
        if group.charge.is_empty() {
            return;
        }
        let varies = self.0.rows(t, group.x, group.v, |i, b| {
            let b = Vec3 { x: b.x as Real, y: b.y as Real, z: b.z as Real };
            let f = row(crate::math::xyz(group.v[i]).cross(b) * group.charge[i], 0.0);
            force[i] = crate::math::add(force[i], f);
        });
        if !varies {
            push_by(&Turn(self.0.value(t)), group.charge, group, force);
        }
    }

    /// df/dv is antisymmetric: its symmetric part is zero.
    fn matrix(&self, _t: f64, _one: &One) -> (Block, Block) {
        ([0.0; 6], [0.0; 6])
    }
}

impl Force for Electric {
    fn add(&self, t: f64, group: Group<'_>, force: &mut [Row]) {
        if group.charge.is_empty() {
            return;
        }
        let varies = self.0.rows(t, group.x, group.v, |i, e| {
            let f = row(Vec3 { x: e.x as Real, y: e.y as Real, z: e.z as Real } * group.charge[i], 0.0);
            force[i] = crate::math::add(force[i], f);
        });
        if !varies {
            push_by(&Pull(self.0.value(t)), group.charge, group, force);
        }
    }

    fn energy(&self, t: f64, one: &One) -> Option<f64> {
        self.0.is_constant().then(|| -one.charge * self.0.value(t).dot(one.x))
    }

    fn matrix(&self, t: f64, one: &One) -> (Block, Block) {
        if self.0.is_uniform() {
            return ([0.0; 6], [0.0; 6]);
        }
        let size = super::push::near(one.x.norm());
        super::push::differences(|x, v| self.0.at(t, x, v) * one.charge, one, size, 1.0)
    }
}
