//! Attraction to a point, or repulsion from it.

use super::push::{Push, derivatives, differences, push};
use super::{Force, Group, One};
use crate::elements::Block;
use crate::math::{Lane, Real, Row, Signal, Vec3, VectorSignal, functions, row};

/// f = -m gm d/r^(p + 1),   d = x - center,   r² = |d|² + s²              (particles.5), with p = 2, s = 0 (orbits.1)
///
/// gm [m^(p + 1)/s²], negative repels   p the power   s softening [m]   R radius [m]: times (1 - |d|²/R²)² within, nothing beyond.
/// Degenerate: at the centre there is no direction and no force.
pub struct Attraction {
    /// The point [m].
    pub center: VectorSignal,
    /// Strength [m^(p + 1)/s²].
    pub gm: Signal,
    /// p.
    pub power: f64,
    /// s [m].
    pub softening: f64,
    /// R [m]; infinite for no end.
    pub radius: f64,
}

/// It with p = 2 at one time.
struct Newton {
    center: Vec3<f64>,
    gm: f64,
    softening_sq: f64,
    inverse_radius_sq: f64,
}

impl Push for Newton {
    #[inline(always)]
    fn at<L: Lane>(&self, mass: L, x: Vec3<L>, _: Vec3<L>) -> Vec3<L> {
        let d = x - Vec3 { x: mass.like(self.center.x), y: mass.like(self.center.y), z: mass.like(self.center.z) };
        let near_sq = d.norm_sq();
        let r_sq = near_sq + mass.like(self.softening_sq);
        let pull = r_sq.positive(mass.like(self.gm) / (r_sq * r_sq.sqrt()), mass.zero());
        if self.inverse_radius_sq == 0.0 {
            return d * (-mass * pull);
        }
        let inside = (mass.like(1.0) - near_sq * mass.like(self.inverse_radius_sq)).above_zero();
        d * (-mass * pull * inside * inside)
    }
}

impl Attraction {
    fn newton(&self, t: f64) -> Newton {
        Newton {
            center: self.center.value(t),
            gm: self.gm.value(t),
            softening_sq: self.softening * self.softening,
            inverse_radius_sq: 1.0 / (self.radius * self.radius),
        }
    }

    /// The acceleration for any power.
    fn acceleration(&self, law: &Newton, x: Vec3<f64>) -> Vec3<f64> {
        let d = x - law.center;
        let near_sq = d.norm_sq();
        if near_sq == 0.0 {
            return d;
        }
        let inside = (1.0 - near_sq * law.inverse_radius_sq).above_zero();
        d * (-law.gm * functions::pow(near_sq + law.softening_sq, -0.5 * (self.power + 1.0)) * inside * inside)
    }
}

impl Force for Attraction {
    fn add(&self, t: f64, group: Group<'_>, force: &mut [Row]) {
        let law = self.newton(t);
        if self.power == 2.0 {
            return push(&law, group, force);
        }
        for ((f, m), x) in force.iter_mut().zip(group.mass).zip(group.x) {
            let a = self.acceleration(&law, crate::math::xyz64(*x)) * f64::from(*m);
            *f = crate::math::add(*f, row(Vec3 { x: a.x as Real, y: a.y as Real, z: a.z as Real }, 0.0));
        }
    }

    /// Known without a radius, while nothing changes in time.
    fn energy(&self, t: f64, one: &One) -> Option<f64> {
        if self.radius.is_finite() || !self.gm.is_constant() || !self.center.is_constant() {
            return None;
        }
        let law = self.newton(t);
        let r_sq = (one.x - law.center).norm_sq() + law.softening_sq;
        Some(if r_sq == 0.0 && self.power >= 1.0 {
            0.0
        } else if self.power == 2.0 {
            -one.mass * law.gm / r_sq.sqrt()
        } else if self.power == 1.0 {
            0.5 * one.mass * law.gm * functions::ln(r_sq)
        } else {
            one.mass * law.gm * functions::pow(r_sq, 0.5 * (1.0 - self.power)) / (1.0 - self.power)
        })
    }

    /// Exact for p = 2, and indefinite (a tide stretches along d).
    fn matrix(&self, t: f64, one: &One) -> (Block, Block) {
        let law = self.newton(t);
        let near = (one.x - law.center).norm();
        if near == 0.0 && self.softening == 0.0 {
            return ([0.0; 6], [0.0; 6]);
        }
        if self.power == 2.0 {
            return derivatives(&law, one.mass, one);
        }
        let size = 6e-6 * (near + self.softening);
        (differences(|x, _| self.acceleration(&law, x) * one.mass, one, size, 1.0).0, [0.0; 6])
    }
}
