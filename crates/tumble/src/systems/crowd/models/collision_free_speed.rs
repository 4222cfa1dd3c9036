//! Collision-free speed: of first order, with a heading that turns away from whoever is ahead, and a speed that follows from the room there.
//!
//! Source: [tordeux2016], with steering by rotation, after the description of the third version of that model in the documentation of
//! JuPedSim, [jupedsim2026].

use super::super::around::Around;
use super::super::plan::{Point, along, cross, dot, length};
use super::Motion;
use crate::math::functions::{atan2, cos, exp, sin};

/// Parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CollisionFreeSpeed {
    /// Time gap to the next ahead [s].
    pub time_gap: f64,
    /// Distance of bodies at which people stand [m].
    pub buffer: f64,
}

// Of the third version, by its documentation, but for the largest turn, which is chosen so that doors have the measured flow.
/// Decay of who matters, ahead and aside [m].
const DECAY: Point = [2.0, 0.8];
/// Largest turn [rad].
const TURN: f64 = 1.0;
/// Time in which a heading relaxes [s].
const RELAX: f64 = 0.3;
/// Offset that smooths the choice of a side [m].
const SIDE: f64 = 0.05;
/// Share of the room on the way to the goal in the spacing.
const BLEND: f64 = 0.15;
/// Speed back where there is no room [m/s].
const BACK: f64 = -0.01;
/// Whoever is exactly ahead counts as this far to the left [m], so that both turn right.
const RIGHT: f64 = 0.01;

/// How far people look at least [m].
const LOOK: f64 = 2.0;

impl CollisionFreeSpeed {
    /// How far people look [m].
    pub fn reach(&self, speed: f64, radius: f64) -> f64 {
        (speed * self.time_gap + self.buffer + 2.0 * radius).max(LOOK)
    }

    /// What somebody does in a step h [s] who wants to go in a direction.
    pub fn motion(&self, around: &Around<'_>, wanted: Point, h: f64) -> Motion {
        let me = around.me;
        let now = around.e;
        let reference = around.reference(wanted);
        let target = atan2(reference[1], reference[0]) + turn(around, reference);
        let aim = [cos(target), sin(target)];
        let heading = me.heading + (h / RELAX).min(1.0) * atan2(cross(now, aim), dot(now, aim));
        let e = [cos(heading), sin(heading)];
        let room = (1.0 - BLEND) * around.room(e).min(1e6) + BLEND * around.room(wanted).min(1e6);
        let v = ((room - self.buffer) / self.time_gap).clamp(BACK, around.speed);
        let u = along(around.makes_way(), v, e);
        // Nobody is faster than it wants to be.
        let size = length(u);
        Motion { v: if size > around.speed { u.map(|u| u * around.speed / size) } else { u }, heading }
    }
}

/// The turn away from the one ahead who matters most [rad].                                       (crowds.3)
fn turn(around: &Around<'_>, e: Point) -> f64 {
    let mut least = (f64::INFINITY, 0.0);
    for them in around.others {
        let (ahead, aside) = (dot(e, them.r), cross(e, them.r));
        let q = ahead / DECAY[0] + aside.abs() / DECAY[1];
        if ahead > 0.0 && q < least.0 && around.sees(them) {
            least = (q, aside);
        }
    }
    let (q, aside) = least;
    let side = aside + RIGHT;
    let a = -exp(-q) * side / (side.abs() + SIDE);
    // tanh.
    let s = exp(2.0 * a);
    TURN * (s - 1.0) / (s + 1.0)
}
