//! Thrust along the direction of motion.

use super::push::{Push, derivatives, push};
use super::{Force, Group, One};
use crate::elements::Block;
use crate::math::{Lane, Row, Signal, Vec3};

/// f = (F + m (v0 - |v|)/tau) v/|v|                                           (particles.7)
///
/// F thrust [N]   v0 desired speed [m/s]   tau [s]. Degenerate: a mass at rest has no direction and stays.
pub struct Propulsion {
    /// F [N].
    pub thrust: Signal,
    /// v0 [m/s], if there is one.
    pub speed: Option<Signal>,
    /// tau [s].
    pub time: f64,
}

/// It at one time.
struct Now {
    thrust: f64,
    speed: f64,
    rate: f64,
}

impl Propulsion {
    fn now(&self, t: f64) -> Now {
        let rate = if self.speed.is_some() { 1.0 / self.time } else { 0.0 };
        Now { thrust: self.thrust.value(t), speed: self.speed.as_ref().map_or(0.0, |s| s.value(t)), rate }
    }
}

impl Push for Now {
    #[inline(always)]
    fn at<L: Lane>(&self, mass: L, _: Vec3<L>, v: Vec3<L>) -> Vec3<L> {
        let speed = v.norm_sq().sqrt();
        let size = mass.like(self.thrust) + mass * (mass.like(self.speed) - speed) * mass.like(self.rate);
        v * speed.positive(size / speed, mass.zero())
    }
}

impl Force for Propulsion {
    fn add(&self, t: f64, group: Group<'_>, force: &mut [Row]) {
        push(&self.now(t), group, force);
    }

    fn matrix(&self, t: f64, one: &One) -> (Block, Block) {
        if one.v.norm_sq() == 0.0 {
            return ([0.0; 6], [0.0; 6]);
        }
        derivatives(&self.now(t), one.mass, one)
    }
}
