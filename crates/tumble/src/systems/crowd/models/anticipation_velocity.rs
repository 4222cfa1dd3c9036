//! Anticipation velocity: of first order, with a direction that avoids where others will be, and a speed that follows from the room ahead.
//!
//! Source: [xu2021].

use super::super::around::{Around, Neighbour};
use super::super::plan::{Point, along, cross, dot, length, sub};
use super::Motion;
use crate::math::functions::{atan2, exp};

/// Parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnticipationVelocity {
    /// Time gap to the next ahead [s].
    pub time_gap: f64,
    /// Distance of bodies at which people stand [m].
    pub buffer: f64,
}

/// How far ahead people think [s].
const AHEAD: f64 = 1.0;
/// Time in which a direction relaxes [s].
const RELAX: f64 = 0.3;
/// Strength and decay [m] of others in the direction.
const OTHERS: [f64; 2] = [3.0, 0.1];
/// Who will be exactly ahead counts as this far to the left [m], so that both turn right.
const RIGHT: f64 = 0.01;
/// How far people look at least [m].
const LOOK: f64 = 3.0;

impl AnticipationVelocity {
    /// How far people look [m].
    pub fn reach(&self, speed: f64, radius: f64) -> f64 {
        (speed * self.time_gap + self.buffer + 2.0 * radius).max(LOOK)
    }

    /// What somebody does in a step h [s] who wants to go in a direction.
    pub fn motion(&self, around: &Around<'_>, wanted: Point, h: f64) -> Motion {
        let now = around.e;
        let aim = direction(around, around.reference(wanted));
        let e = along(now, (h / RELAX).min(1.0), sub(aim, now));
        let size = length(e);
        let e = if size > 1e-9 { e.map(|e| e / size) } else { now };
        let v = ((around.room(e).min(1e6) - self.buffer) / self.time_gap).clamp(0.0, around.speed);
        let u = along(around.makes_way(), v, e);
        // Nobody is faster than it wants to be.
        let size = length(u);
        Motion { v: if size > around.speed { u.map(|u| u * around.speed / size) } else { u }, heading: atan2(e[1], e[0]) }
    }
}

/// The direction that avoids where others will be.                                                     (crowds.10)
fn direction(around: &Around<'_>, e: Point) -> Point {
    let me = around.me;
    let now = around.e;
    let mut aside = 0.0;
    for them @ Neighbour { r, d, other } in around.others {
        if (dot(now, *r) <= 0.0 && dot(e, *r) <= 0.0) || *d == 0.0 || !around.sees(them) {
            continue;
        }
        let then = along(*r, AHEAD, other.v);
        let reach = me.radius + other.radius;
        let gap = dot(along(then, -AHEAD, me.v), *r) / d;
        let strength = OTHERS[0] * (1.0 + 0.5 * (1.0 - dot(e, other.e))) * exp((reach - gap.max(reach)) / OTHERS[1]);
        aside -= strength * (cross(e, then) + RIGHT).signum();
    }
    let e = along(e, aside, [-e[1], e[0]]);
    let size = length(e);
    e.map(|e| e / size)
}
