//! Social force: people have masses; they accelerate to the desired velocity and away from others, and push when they touch.
//!
//! Sources: [helbing2000] for the desired velocity, walls and contact, [moussaid2009] for what others do at a distance.

use super::super::around::{Around, Neighbour};
use super::super::plan::{Point, along, cross, dot, length, sub};
use super::Motion;
use crate::math::functions::{atan2, exp};

/// Parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SocialForce {
    /// Mass of a body [kg].
    pub mass: f64,
    /// Time in which the velocity relaxes to the desired one [s].
    pub relaxation: f64,
}

/// How far people look [m].
pub const REACH: f64 = 3.0;
/// Longest step, unless given [s]: two bodies in contact swing with a period of 0.11 s.
pub const STEP: f64 = 0.02;
/// By which part of their radii bodies give way.
pub const SOFT: f64 = 0.01;

/// Acceleration by somebody who touches [m/s²], and over which distance it falls [m].
const OTHERS: [f64; 2] = [2.6, 0.35];
/// How much of the relative velocity counts in the direction of who comes [s].
const RELATIVE: f64 = 2.0;
/// Widths of who slows down and of who turns aside, over angle and distance [1/m].
const WIDTHS: [f64; 2] = [3.0, 2.0];
/// An angle by which everybody prefers the right, over a distance [1/m].
const RIGHT: f64 = 0.005;
/// Force of a wall that touches [N], and over which distance it falls [m].
const WALLS: [f64; 2] = [1000.0, 0.08];
/// Stiffness [N/m] and friction [N s/m²] of bodies that touch.
const CONTACT: [f64; 2] = [1.2e5, 2.4e5];

impl SocialForce {
    /// What somebody does in a step h [s] who wants to go in a direction.
    pub fn motion(&self, around: &Around<'_>, wanted: Point, h: f64) -> Motion {
        let me = around.me;
        let a = self.acceleration(around);
        // Exact under accelerations that stay.                                                           (crowds.8)
        let end = along(along(around.makes_way(), around.speed * around.freedom(wanted), wanted), self.relaxation, a);
        let v = along(end, exp(-h / self.relaxation), sub(me.v, end));
        // Whoever is pushed back goes on facing where it wants to go.
        let heading = if length(v) > 0.05 * around.speed && dot(v, wanted) > 0.0 { atan2(v[1], v[0]) } else { me.heading };
        Motion { v, heading }
    }

    /// Acceleration by others and by walls [m/s²].
    fn acceleration(&self, around: &Around<'_>) -> Point {
        let me = around.me;
        let mut a = [0.0; 2];
        for (d, far) in around.to_walls() {
            if far > 0.0 && far < me.radius + 10.0 * WALLS[1] {
                a = along(a, -WALLS[0] / self.mass * exp((me.radius - far) / WALLS[1]) / far, d);
            }
        }
        for them in around.others {
            let Neighbour { r, d, other } = them;
            if *d == 0.0 {
                continue;
            }
            let overlap = me.radius + other.radius - d;
            if overlap > 0.0 {
                let n = r.map(|r| r / d);
                let side = [-n[1], n[0]];
                a = along(a, -CONTACT[0] * overlap / self.mass, n);
                a = along(a, CONTACT[1] * overlap / self.mass * dot(sub(other.v, me.v), side), side);
            }
            if !around.goes_first(*r, other) && around.sees(them) {
                a = along(a, 1.0, at_a_distance(me.v, them));
            }
        }
        a
    }
}

/// Acceleration by somebody who does not touch [m/s²].                                              (crowds.9)
fn at_a_distance(v: Point, Neighbour { r, d, other }: &Neighbour<'_>) -> Point {
    let n = r.map(|r| r / d);
    let towards = along(n, RELATIVE, sub(v, other.v));
    let size = length(towards);
    if size < 1e-9 {
        return [0.0; 2];
    }
    let t = towards.map(|t| t / size);
    let b = OTHERS[1] * size;
    let angle = atan2(cross(t, n), dot(t, n)) + RIGHT * b;
    let strength = OTHERS[0] * exp(-d / b);
    let part = |width: f64| strength * exp(-(width * b * angle) * (width * b * angle));
    along(t.map(|t| -t * part(WIDTHS[0])), -part(WIDTHS[1]) * angle.signum(), [-t[1], t[0]])
}
