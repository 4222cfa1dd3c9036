//! Hard contact: what an impulse of the step before becomes in a pass.                                                 (grains.11)

use super::law::{BALL, Memory, Pair};
use crate::math::{Lane, Vec3};

/// Overlap over 2 R* that is left, so that what rests keeps touching.
const SLOP: f64 = 0.005;
/// Velocity that a ball gains at its surface, along it, over that of its centre: it turns, too.
const ALONG: f64 = 1.0 + 1.0 / BALL;

/// Two surfaces that touch within a step, the second on the side of the normal.
#[derive(Debug, Clone, Copy)]
pub struct Touch<L = f64> {
    /// What is between them at the start of the step [m]; less than 0 if they overlap.
    pub gap: L,
    pub normal: Vec3<L>,
    /// Velocity of the second surface against the first with the impulses of the last pass [m/s], and that along the normal before the step.
    pub velocity: Vec3<L>,
    pub before: L,
    /// Angular velocity of the second against the first [rad/s].
    pub turning: Vec3<L>,
    /// R* [m].
    pub radius: L,
    /// What an impulse changes of both, each in as many parts as it has contacts: velocities across the surface and along it [1/kg], and the turn
    /// [1/(kg m²)].
    pub yields: [L; 3],
}

/// Impulse [N s] and couple [N m s] on the second, and how far it is shifted along the normal times its mass [kg m].
#[derive(Debug, Clone, Copy)]
pub struct Push<L = f64> {
    pub impulse: Vec3<L>,
    pub couple: Vec3<L>,
    pub shift: L,
}

/// The length of a step [s], and the speed up to which nothing bounces [m/s].
#[derive(Debug, Clone, Copy)]
pub struct Step {
    pub h: f64,
    pub slow: f64,
}

impl<L: Lane> Pair<L> {
    /// One pass over a contact.
    #[inline(always)]
    pub fn project(&self, at: &Touch<L>, [h, slow]: [L; 2], memory: &mut Memory<L>, turns: bool) -> Push<L> {
        let (n, one) = (at.normal, h.like(1.0));
        let [across, along, turning] = at.yields;
        let away = at.velocity.dot(n);
        // Apart, they may close up within the step; what hits leaves.
        let wanted = (-at.before - slow).positive(-at.before * self.restitution, -(at.gap.above_zero() / h));
        let old = memory.slip.dot(n);
        let press = (old + (wanted - away) / across).above_zero();
        let held = memory.slip - n * old - (at.velocity - n * away) * (one / along);
        let [slides, rests] = self.friction;
        let (taken, limit) = (held.norm_sq(), memory.slides.positive(slides, rests) * press);
        let over = taken - limit * limit;
        memory.slides = over.positive(one, h.zero());
        memory.slip = n * press + held * over.positive(slides * press / taken.sqrt(), one);
        if turns {
            let turn = memory.turn - at.turning * (one / turning);
            let twist = n * turn.dot(n);
            memory.turn = n * h.zero();
            for (turn, resists) in [turn - twist, twist].into_iter().zip(self.resists) {
                let (taken, limit) = (turn.norm_sq(), resists * at.radius * press);
                memory.turn = memory.turn + turn * (taken - limit * limit).positive(limit / taken.sqrt(), one);
            }
        }
        let deep = (-at.gap - at.radius * h.like(2.0 * SLOP)).above_zero();
        Push { impulse: memory.slip, couple: memory.turn, shift: deep / across }
    }
}

/// What an impulse changes of so many parts of a ball, over 1/mass, across its surface and along it: friction and resistance to turns share its turns.
#[inline(always)]
pub fn shares(turns: bool) -> [f64; 2] {
    if turns { [2.0 * ALONG - 1.0, 2.0 / BALL] } else { [ALONG, 1.0 / BALL] }
}
