//! Optimal reciprocal collision avoidance: of all velocities that keep clear of everybody for a time, the one nearest to the desired one.
//!
//! Source: [vandenberg2011].

use super::super::around::{Around, Neighbour};
use super::super::plan::{Point, along, cross, dot, length, sub};
use super::Motion;
use crate::math::functions::atan2;

/// Parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Orca {
    /// For which time velocities keep clear of others [s].
    pub time_horizon: f64,
}

/// For which time they keep clear of walls [s].
const WALLS: f64 = 0.3;
/// A turn of the desired velocity to the right, so that two who meet head-on do not stop each other.
const RIGHT: f64 = 0.02;
/// How far people look at least [m].
const LOOK: f64 = 2.0;

/// Velocities v with n·v ≥ c.
#[derive(Debug, Clone, Copy)]
struct HalfPlane {
    n: Point,
    c: f64,
}

impl HalfPlane {
    /// How far a velocity is from it [m/s].
    fn lacks(&self, v: Point) -> f64 {
        self.c - dot(self.n, v)
    }
}

impl Orca {
    /// How far people look [m].
    pub fn reach(&self, speed: f64, radius: f64) -> f64 {
        (2.0 * speed * self.time_horizon + 2.0 * radius).clamp(LOOK, 5.0)
    }

    /// What somebody does in a step h [s] who wants to go in a direction.
    pub fn motion(&self, around: &Around<'_>, wanted: Point, h: f64) -> Motion {
        let me = around.me;
        let e = around.reference(wanted);
        let desired = along(around.makes_way(), around.speed * around.freedom(e), along(e, RIGHT, [e[1], -e[0]]));
        let mut planes: Vec<HalfPlane> = Vec::with_capacity(around.others.len() + 8);
        for (d, far) in around.to_walls().filter(|(_, far)| *far > 0.0) {
            let room = (far - me.radius).max(0.0) / WALLS;
            if room < around.speed {
                planes.push(HalfPlane { n: d.map(|d| -d / far), c: -room });
            }
        }
        let walls = planes.len();
        planes.extend(around.others.iter().filter(|them| them.d > 0.0 && around.sees(them)).map(|them| self.keeps_clear(around, them, h)));
        let v = match nearest(&planes, around.speed, desired, false) {
            Ok(v) => v,
            Err((failed, v)) => safest(&planes, walls, failed, around.speed, v),
        };
        // Whoever is pushed back goes on facing where it wants to go.
        let heading = if length(v) > 0.05 * around.speed && dot(v, wanted) > 0.0 { atan2(v[1], v[0]) } else { me.heading };
        Motion { v, heading }
    }

    /// Velocities that keep clear of another, if it does as much.                                       (crowds.11)
    fn keeps_clear(&self, around: &Around<'_>, Neighbour { r, d, other }: &Neighbour<'_>, h: f64) -> HalfPlane {
        let me = around.me;
        let reach = me.radius + other.radius;
        let relative = sub(me.v, other.v);
        let ahead = if *d > reach { self.time_horizon } else { h };
        // From the middle of the disk of relative velocities that meet at that time.
        let w = along(relative, -1.0 / ahead, *r);
        let (size, to) = (length(w), dot(w, *r));
        let (n, u) = if *d <= reach || (to < 0.0 && to * to > reach * reach * size * size) {
            let n = if size > 1e-9 { w.map(|w| w / size) } else { r.map(|r| -r / d) };
            (n, reach / ahead - size)
        } else {
            // A side of the cone behind it.
            let side = if cross(*r, w) > 0.0 { 1.0 } else { -1.0 };
            let leg = (d * d - reach * reach).sqrt();
            let l = along(r.map(|r| r * leg / (d * d)), side * reach / (d * d), [-r[1], r[0]]);
            let n = [-side * l[1], side * l[0]];
            (n, -dot(relative, n))
        };
        HalfPlane { n, c: dot(n, me.v) + 0.5 * u }
    }
}

/// The velocity of at most this speed on the edge of a half-plane that is in the ones before it, too, and nearest to a desired one, or farthest in
/// its direction.
fn on_edge(planes: &[HalfPlane], i: usize, speed: f64, desired: Point, farthest: bool) -> Option<Point> {
    let HalfPlane { n, c } = planes[i];
    let (foot, e) = (n.map(|n| n * c), [-n[1], n[0]]);
    let half = speed * speed - c * c;
    if half < 0.0 {
        return None;
    }
    let (mut low, mut high) = (-half.sqrt(), half.sqrt());
    for plane in &planes[..i] {
        let (slope, lacks) = (dot(plane.n, e), plane.lacks(foot));
        if slope.abs() < 1e-9 {
            if lacks > 0.0 {
                return None;
            }
        } else if slope > 0.0 {
            low = low.max(lacks / slope);
        } else {
            high = high.min(lacks / slope);
        }
        if low > high {
            return None;
        }
    }
    let s = match farthest {
        true if dot(desired, e) > 0.0 => high,
        true => low,
        false => dot(sub(desired, foot), e).clamp(low, high),
    };
    Some(along(foot, s, e))
}

/// The velocity of at most this speed in all half-planes that is nearest to a desired one, or farthest in its direction, a unit vector; or the first
/// half-plane for which there is none, and that for those before it.
fn nearest(planes: &[HalfPlane], speed: f64, desired: Point, farthest: bool) -> Result<Point, (usize, Point)> {
    let size = length(desired);
    let mut v = if farthest || size > speed { desired.map(|v| v * speed / size) } else { desired };
    for (i, plane) in planes.iter().enumerate() {
        if plane.lacks(v) > 0.0 {
            v = on_edge(planes, i, speed, desired, farthest).ok_or((i, v))?;
        }
    }
    Ok(v)
}

/// The velocity that is the least outside of half-planes, but in those of walls.
fn safest(planes: &[HalfPlane], walls: usize, failed: usize, speed: f64, mut v: Point) -> Point {
    let mut most = 0.0;
    for (i, worst) in planes.iter().enumerate().skip(failed.max(walls)) {
        if worst.lacks(v) <= most {
            continue;
        }
        // Where no earlier one is farther than this one.
        let no_farther = |plane: &HalfPlane| {
            let n = sub(plane.n, worst.n);
            let size = length(n);
            (size > 1e-9).then(|| HalfPlane { n: n.map(|n| n / size), c: (plane.c - worst.c) / size })
        };
        let own: Vec<HalfPlane> = planes[..walls].iter().copied().chain(planes[walls..i].iter().filter_map(no_farther)).collect();
        v = nearest(&own, speed, worst.n, true).unwrap_or(v);
        most = worst.lacks(v);
    }
    v
}
