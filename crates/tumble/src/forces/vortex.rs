//! A vortex about a straight axis.

use super::push::{Push, derivatives, push};
use super::{Force, Group, One};
use crate::elements::Block;
use crate::math::{Lane, Row, Signal, Vec3, VectorSignal};

/// With d = x - center, r the distance to the axis n and c the core radius:
///
///   a = s(r) (swirl n x r^ - inward r^) + lift g(r) n,   s = 2 c r/(r² + c²),   g = c²/(r² + c²)     (particles.6)
///
/// As a force f = m a, as a velocity field u = a. swirl, inward and lift are its largest values, at r = c and on the axis.
/// Source: [vatistas1991] with n = 1.   On the axis there is lift alone.
pub struct Vortex {
    /// A point of the axis [m].
    pub center: VectorSignal,
    /// Direction of the axis, of length 1.
    pub axis: Vec3<f64>,
    /// c [m].
    pub core: f64,
    /// Around the axis [m/s² or m/s].
    pub swirl: Signal,
    /// Towards it.
    pub inward: Signal,
    /// Along it.
    pub lift: Signal,
}

/// It at one time.
pub struct Whirl {
    center: Vec3<f64>,
    axis: Vec3<f64>,
    core: f64,
    swirl: f64,
    inward: f64,
    lift: f64,
}

impl Vortex {
    /// It at a time.
    pub fn now(&self, t: f64) -> Whirl {
        let [swirl, inward, lift] = [&self.swirl, &self.inward, &self.lift].map(|s| s.value(t));
        Whirl { center: self.center.value(t), axis: self.axis, core: self.core, swirl, inward, lift }
    }
}

impl Whirl {
    /// a at x: one division, no root.
    #[inline(always)]
    pub fn value<L: Lane>(&self, x: Vec3<L>) -> Vec3<L> {
        let like = |c: f64| x.x.like(c);
        let n = Vec3 { x: like(self.axis.x), y: like(self.axis.y), z: like(self.axis.z) };
        let d = x - Vec3 { x: like(self.center.x), y: like(self.center.y), z: like(self.center.z) };
        let out = d - n * n.dot(d);
        let q = like(self.core) / (out.norm_sq() + like(self.core * self.core));
        n.cross(d) * (q * like(2.0 * self.swirl)) - out * (q * like(2.0 * self.inward)) + n * (q * like(self.core * self.lift))
    }
}

impl Push for Whirl {
    #[inline(always)]
    fn at<L: Lane>(&self, mass: L, x: Vec3<L>, _: Vec3<L>) -> Vec3<L> {
        self.value(x) * mass
    }
}

impl Force for Vortex {
    fn add(&self, t: f64, group: Group<'_>, force: &mut [Row]) {
        push(&self.now(t), group, force);
    }

    fn matrix(&self, t: f64, one: &One) -> (Block, Block) {
        derivatives(&self.now(t), one.mass, one)
    }
}
