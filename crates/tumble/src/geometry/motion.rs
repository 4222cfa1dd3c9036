//! Rigid motion of solids as a function of time alone: keyframes, then constant velocity and spin.
//!
//!   x = pivot + shift(t) + Q(t) (p - pivot),   v(x) = shift' + omega × (x - pivot - shift)      (contact.9)

use super::Vector;
use crate::math::Quat;
use crate::math::functions::{atan2, cos, sin};

/// Pose of a rigid body: x = turn p + shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Its turn.
    pub turn: Quat<f64>,
    /// Its movement after the turn [m].
    pub shift: Vector,
}

/// How a rigid thing moves: v(x) = linear + angular × x.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Twist {
    /// Velocity at the origin [m/s].
    pub linear: Vector,
    /// Angular velocity [rad/s].
    pub angular: Vector,
}

/// A keyframe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Key {
    /// When [s].
    pub time: f64,
    /// Movement of the pivot [m].
    pub shift: Vector,
    /// Turn about the pivot.
    pub turn: Quat<f64>,
}

/// A rigid motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Velocity of the pivot [m/s].
    pub velocity: Vector,
    /// Angular velocity about the pivot [rad/s].
    pub spin: Vector,
    /// The pivot without motion [m].
    pub pivot: Vector,
    /// Keyframes at rising times.
    pub keys: Vec<Key>,
    /// Whether the way between keyframes starts and ends at rest.
    pub smooth: bool,
}

impl Default for Pose {
    fn default() -> Self {
        Self { turn: still(), shift: Vector::default() }
    }
}

impl Pose {
    /// A point of the thing in the world.
    pub fn out(&self, p: Vector) -> Vector {
        self.turn.turn(p) + self.shift
    }

    /// A point of the world in the thing.
    pub fn back(&self, x: Vector) -> Vector {
        self.turn.conj().turn(x - self.shift)
    }
}

impl Twist {
    /// Velocity at x [m/s].
    pub fn at(&self, x: Vector) -> Vector {
        self.linear + self.angular.cross(x)
    }
}

fn still() -> Quat<f64> {
    Quat { v: Vector::default(), w: 1.0 }
}

/// The turn by a rotation vector [rad].
fn turn(theta: Vector) -> Quat<f64> {
    let angle = theta.norm();
    if angle == 0.0 {
        return still();
    }
    let half = angle / 2.0;
    Quat { v: theta * (sin(half) / angle), w: cos(half) }
}

/// The rotation vector of a turn, no longer than pi.
fn vector(q: Quat<f64>) -> Vector {
    let q = if q.w < 0.0 { -q } else { q };
    let s = q.v.norm();
    if s == 0.0 { Vector::default() } else { q.v * (2.0 * atan2(s, q.w) / s) }
}

impl Motion {
    /// Pose and motion at time t.
    pub fn at(&self, t: f64) -> (Pose, Twist) {
        let (key, rate) = self.key(t);
        let spun = turn(self.spin * t);
        let center = self.pivot + key.shift + self.velocity * t;
        let q = spun * key.turn;
        let angular = self.spin + spun.turn(rate.angular);
        let linear = rate.linear + self.velocity - angular.cross(center);
        (Pose { turn: q, shift: center - q.turn(self.pivot) }, Twist { linear, angular })
    }

    /// Shift and turn of the keyframes at time t, and their rates.
    fn key(&self, t: f64) -> (Key, Twist) {
        let none = Key { time: t, shift: Vector::default(), turn: still() };
        let (Some(first), Some(last)) = (self.keys.first(), self.keys.last()) else { return (none, Twist::default()) };
        let next = self.keys.partition_point(|k| k.time <= t);
        let (Some(b), Some(a)) = (self.keys.get(next), next.checked_sub(1).and_then(|i| self.keys.get(i))) else {
            return (if next == 0 { *first } else { *last }, Twist::default());
        };
        let span = b.time - a.time;
        let s = (t - a.time) / span;
        let (way, rate) = if self.smooth { (s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / span) } else { (s, 1.0 / span) };
        let (d, theta) = (b.shift - a.shift, vector(b.turn * a.turn.conj()));
        let key = Key { time: t, shift: a.shift + d * way, turn: turn(theta * way) * a.turn };
        (key, Twist { linear: d * rate, angular: theta * rate })
    }

    /// Largest velocity that a point at most this far from the pivot can have [m/s].
    pub fn fastest(&self, reach: f64) -> f64 {
        let peak = if self.smooth { 1.5 } else { 1.0 };
        let pairs = self.keys.windows(2).map(|k| {
            let span = k[1].time - k[0].time;
            peak * ((k[1].shift - k[0].shift).norm() + vector(k[1].turn * k[0].turn.conj()).norm() * reach) / span
        });
        self.velocity.norm() + self.spin.norm() * reach + pairs.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation::from_degrees;

    /// Velocities are the differences of places: central differences, error h² x'''/6 = 1e-10 at most of 30/s³.
    #[test]
    fn the_surface_moves_as_it_is_said_to() {
        let key = |time, shift: [f64; 3], degrees| Key { time, shift: shift.into(), turn: from_degrees(degrees) };
        let motion = Motion {
            velocity: [0.3, -0.2, 0.1].into(),
            spin: [0.5, 1.0, -2.0].into(),
            pivot: [1.0, 2.0, 0.5].into(),
            keys: vec![key(0.0, [0.0; 3], [0.0; 3]), key(1.0, [1.0, 0.0, 2.0], [30.0, 80.0, -40.0]), key(1.5, [0.0; 3], [0.0, 0.0, 170.0])],
            smooth: true,
        };
        let (p, h) = (Vector::from([0.3, -0.4, 1.1]), 1e-5);
        for t in [0.2, 0.7, 1.2, 1.7] {
            let (pose, twist) = motion.at(t);
            let x = pose.out(p);
            assert!((pose.back(x) - p).norm() < 1e-14);
            let v = (motion.at(t + h).0.out(p) - motion.at(t - h).0.out(p)) * (0.5 / h);
            assert!(v.norm() > 0.5);
            // Measured: 3e-9 m/s.
            assert!((v - twist.at(x)).norm() < 1e-7, "{t} {v:?} {:?}", twist.at(x));
            assert!(v.norm() <= motion.fastest((p - motion.pivot).norm()));
        }
        let (end, _) = motion.at(9.0);
        assert!((end.turn.dot(end.turn) - 1.0).abs() < 1e-14);
    }
}
