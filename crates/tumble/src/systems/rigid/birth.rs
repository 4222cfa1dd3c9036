//! Bodies that are born during the run, in the order of their rows: body k is due at start + (k + 1)/rate, and is born at the start of the first
//! sub-step from then on in which a random place and turn touches nothing.

use super::body::Body;
use super::contact::{Bodies, pose};
use crate::geometry::{Sampler, Vector};
use crate::math::functions::{cos, sin};
use crate::math::{Quat, Random};
use parry3d_f64::query::distance;
use std::f64::consts::TAU;

/// Places that are tried in a sub-step.
const TRIES: u32 = 16;
/// Of a count that is a whole number but for rounding.
const ROUNDING: f64 = 1e-9;

// Purposes of random numbers.
const PLACE: u32 = 0;
const TURN: u32 = 1;

/// How bodies of an object are born.
pub struct Birth {
    /// Bodies per second [1/s].
    pub rate: f64,
    /// Bodies in all, at most.
    pub count: usize,
    /// When the rate starts and ends [s].
    pub span: [f64; 2],
    /// Where their centres of mass are born.
    pub from: Sampler,
    /// The turn of the axes of their words, of each at random if there is none.
    pub turn: Option<Quat<f64>>,
    /// Their own axes in those of the words.
    pub axes: Quat<f64>,
    /// A body with its velocities, its mass and its inertia.
    pub like: Body,
    /// Random numbers of the object.
    pub random: Random,
}

/// How far an object is with its births.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Births {
    /// Bodies that have been born.
    pub born: usize,
    /// Places that have been tried.
    pub tried: u32,
}

impl Birth {
    /// How many are to have been born at a time [s].
    pub fn due(&self, t: f64) -> usize {
        let [start, end] = self.span;
        ((self.rate * (t.min(end) - start) + ROUNDING).floor().max(0.0) as usize).min(self.count)
    }

    /// The next body if it finds a place where it touches nothing; its surface is that of `row`.
    pub fn next(&self, births: &mut Births, bodies: &Bodies, row: usize) -> Option<Body> {
        (0..TRIES).find_map(|_| {
            let attempt = births.tried;
            births.tried = births.tried.wrapping_add(1);
            let draw = |k: u32, purpose: u32| self.random.uniform(u64::from(attempt), k, purpose);
            let (x, _) = self.from.sample(&|k| draw(k, PLACE));
            let turn = self.turn.unwrap_or_else(|| any_turn(draw(0, TURN)));
            let body = Body { x, q: (turn * self.axes).normalized(), ..self.like };
            is_free(bodies, row, &body).then_some(body)
        })
    }
}

/// Whether a body with the surface of a row touches nothing.
fn is_free(bodies: &Bodies, row: usize, body: &Body) -> bool {
    let own = bodies.hull(row);
    let place = pose(body.x, body.q) * own.place;
    (0..bodies.rows.len()).filter(|i| bodies.is_there(*i)).all(|i| {
        let other = bodies.hull(i);
        let skin = own.thickness + other.thickness;
        // What has no reach has no end.
        if other.reach > 0.0 && (bodies.rows[i].x - body.x).norm() > own.reach + other.reach + skin {
            return true;
        }
        // What cannot be told may touch.
        distance(&place, &*own.shape.0, &bodies.pose(i), &*other.shape.0).is_ok_and(|gap| gap.distance > skin)
    })
}

/// A turn of three uniform numbers, all turns being as likely [shoemake1992].
pub fn any_turn([u, v, w, _]: [f64; 4]) -> Quat<f64> {
    let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
    Quat { v: Vector { x: a * sin(TAU * v), y: a * cos(TAU * v), z: b * sin(TAU * w) }, w: b * cos(TAU * w) }
}
