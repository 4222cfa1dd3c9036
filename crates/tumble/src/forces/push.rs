//! Forces that are a formula of one mass: evaluated on wide registers, differentiated by dual numbers.

use super::{Group, One};
use crate::elements::Block;
use crate::math::simd::{Kernel, Width, ask_behind, count, dispatch, packs};
use crate::math::{Dual, Lane, Real, Row, Vec3};

/// The force on one mass, given its weight (the mass [kg], or the charge [C] for forces on charges).
pub trait Push {
    /// The force [N] at x with velocity v.
    fn at<L: Lane>(&self, weight: L, x: Vec3<L>, v: Vec3<L>) -> Vec3<L>;
}

struct Pushed<'a, P> {
    law: &'a P,
    weight: &'a [Real],
    x: &'a [Row],
    v: &'a [Row],
    force: &'a mut [Row],
}

impl<P: Push> Kernel for Pushed<'_, P> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        packs!(W, w, (0..self.force.len()), |i| {
            ask_behind(self.x, i, count(w));
            ask_behind(self.v, i, count(w));
            let [x, y, z, _] = w.rows(self.x, i);
            let [vx, vy, vz, _] = w.rows(self.v, i);
            let push = self.law.at(w.load(&self.weight[i..]), Vec3 { x, y, z }, Vec3 { x: vx, y: vy, z: vz });
            w.add_to_rows([push.x, push.y, push.z, w.splat(0.0)], self.force, i);
        });
    }
}

/// Adds the force on every mass of a group.
#[inline]
pub fn push<P: Push>(law: &P, group: Group<'_>, force: &mut [Row]) {
    push_by(law, group.mass, group, force);
}

/// Adds the force on every mass of a group, by weights in place of the masses.
#[inline]
pub fn push_by<P: Push>(law: &P, weight: &[Real], group: Group<'_>, force: &mut [Row]) {
    let n = force.len();
    assert!(weight.len() == n && group.x.len() == n && group.v.len() == n);
    dispatch(Pushed { law, weight, x: group.x, v: group.v, force });
}

/// -df/dx and -df/dv, their symmetric parts.
pub fn derivatives<P: Push>(law: &P, weight: f64, one: &One) -> (Block, Block) {
    let zero = Vec3::from([0.0; 3]);
    let slope = |dx: Vec3<f64>, dv: Vec3<f64>| law.at(Dual::constant(weight), Vec3::lift(one.x, dx), Vec3::lift(one.v, dv)).slope();
    (block(|e| slope(e, zero)), block(|e| slope(zero, e)))
}

/// The same by central differences, for forces that are no formula of lanes. `x` and `v` are how far to go [m], [m/s].
pub fn differences(force: impl Fn(Vec3<f64>, Vec3<f64>) -> Vec3<f64>, one: &One, x: f64, v: f64) -> (Block, Block) {
    let by_x = |e: Vec3<f64>| (force(one.x + e * x, one.v) - force(one.x - e * x, one.v)) * (0.5 / x);
    let by_v = |e: Vec3<f64>| (force(one.x, one.v + e * v) - force(one.x, one.v - e * v)) * (0.5 / v);
    (block(by_x), block(by_v))
}

/// The step of central differences near a value: the cube root of round-off, where both errors meet.
pub fn near(value: f64) -> f64 {
    6e-6 * (1.0 + value)
}

/// The symmetric part of a matrix with its sign turned, from its products with the unit vectors.
fn block(column: impl Fn(Vec3<f64>) -> Vec3<f64>) -> Block {
    let [a, b, c] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|e| column(e.into()));
    [a.x, b.y, c.z, 0.5 * (a.y + b.x), 0.5 * (b.z + c.y), 0.5 * (a.z + c.x)].map(|k| -k as Real)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forces::{Drag, Vortex};
    use crate::math::simd::{Level, dispatch_at};

    fn every_width_agrees(law: &impl Push) {
        // 45 masses: no multiple of any register.
        let number = |i: usize, c: usize| ((i * 131 + c * 37) % 1009) as Real * 0.003 - 1.5;
        let rows = |c: usize| -> Vec<Row> { (0..45).map(|i| [number(i, c), number(i, c + 1), number(i, c + 2), 7.0]).collect() };
        let (x, v, weight): (_, _, Vec<Real>) = (rows(1), rows(4), (0..45).map(|i| 1.0 + number(i, 8)).collect());
        let forces = |level| {
            let mut force = rows(9);
            dispatch_at(level, Pushed { law, weight: &weight, x: &x, v: &v, force: &mut force });
            force
        };
        let one = forces(Level::Scalar);
        let (before, at) = (rows(9), |c: usize, rows: &[Row]| Vec3 { x: rows[c][0], y: rows[c][1], z: rows[c][2] });
        for i in 0..45 {
            let push = law.at(weight[i], at(i, &x), at(i, &v));
            assert_eq!(one[i], [before[i][0] + push.x, before[i][1] + push.y, before[i][2] + push.z, 7.0]);
            assert!(push.norm_sq() > 0.0);
        }
        for level in Level::available() {
            assert_eq!(forces(level), one, "{level:?}");
        }
    }

    #[test]
    fn every_width_gives_the_same_bits() {
        every_width_agrees(&Drag { coefficient: 0.3, rate: 0.2, quadratic: 0.7 });
        let axis = Vec3 { x: 0.6, y: 0.0, z: 0.8 };
        let center = [0.1, 0.2, 0.3].into();
        every_width_agrees(&Vortex { center, axis, core: 0.5, swirl: 3.0.into(), inward: 1.0.into(), lift: 2.0.into() }.now(0.0));
    }
}
