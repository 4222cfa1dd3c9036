//! Attraction to a fixed point.

use super::{Force, Group, One};
use crate::elements::Block;
use crate::math::{Lane, Real, Row, Vec3, axpy, row, xyz};

/// f = -m gm d/|d|³,  d = x - center.                                   (orbits.1)
///
/// gm = G M [m³/s²]. Degenerate: at the centre there is no direction and no force.
pub struct Attraction {
    /// The point [m].
    pub center: Vec3<f64>,
    /// G M [m³/s²].
    pub gm: f64,
}

impl Force for Attraction {
    fn add(&self, _t: f64, group: Group<'_>, force: &mut [Row]) {
        let center = Vec3 { x: self.center.x as Real, y: self.center.y as Real, z: self.center.z as Real };
        let gm = self.gm as Real;
        for ((f, m), x) in force.iter_mut().zip(group.mass).zip(group.x) {
            let d = xyz(*x) - center;
            let r_sq = d.norm_sq();
            let pull = r_sq.positive(gm / (r_sq * r_sq.sqrt()), 0.0);
            *f = axpy(*f, -m * pull, row(d, 0.0));
        }
    }

    fn energy(&self, _t: f64, one: &One) -> Option<f64> {
        let r = (one.x - self.center).norm();
        Some(if r > 0.0 { -one.mass * self.gm / r } else { 0.0 })
    }

    /// m gm (1/r³ - 3 d d^T/r^5): exact, and indefinite (a tide stretches along d).
    fn matrix(&self, _t: f64, one: &One) -> (Block, Block) {
        let d = one.x - self.center;
        let r_sq = d.norm_sq();
        if r_sq == 0.0 {
            return ([0.0; 6], [0.0; 6]);
        }
        let a = one.mass * self.gm / (r_sq * r_sq.sqrt());
        let b = 3.0 * a / r_sq;
        let k = [a - b * d.x * d.x, a - b * d.y * d.y, a - b * d.z * d.z, -b * d.x * d.y, -b * d.y * d.z, -b * d.z * d.x];
        (k.map(|k| k as Real), [0.0; 6])
    }
}
