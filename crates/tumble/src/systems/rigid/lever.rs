//! What contacts and joints share: the twists of bodies, and levers by which impulses change them.

use super::body::Body;
use crate::geometry::Vector;

/// What the passes need.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// Start of the sub-step [s].
    pub t: f64,
    /// Its length [s].
    pub h: f64,
    /// Passes of each sort.
    pub iterations: u32,
    /// Bodies that come closer more slowly do not bounce [m/s].
    pub still: f64,
    /// Gravity [m/s²].
    pub gravity: Vector,
}

/// What is out of place is mended no faster than this [m/s], of turns [rad/s].
pub const FASTEST: f64 = 3.0;

/// What a pass reads and writes of a body.
#[derive(Clone, Copy)]
pub struct Twist {
    /// Velocity [m/s].
    pub v: Vector,
    /// Angular velocity [rad/s].
    pub w: Vector,
    /// 1/mass [1/kg].
    pub inverse_mass: f64,
}

impl Twist {
    /// Of a body.
    pub fn of(body: &Body) -> Self {
        Self { v: body.v, w: body.w, inverse_mass: body.inverse_mass }
    }
}

/// A direction at a contact or joint: what a unit impulse along it does to both bodies.
#[derive(Clone, Copy)]
pub struct Lever {
    /// The direction, from the first to the second; zero for a turn.
    pub along: Vector,
    /// r × direction, of each [m]; of a turn its axis.
    pub arms: [Vector; 2],
    /// Change of angular velocity of each, without sign [1/(kg m)].
    pub turns: [Vector; 2],
}

impl Lever {
    /// Along a direction at the arms r.
    pub fn new([a, b]: [&Body; 2], arms: [Vector; 2], along: Vector) -> Self {
        let arms = arms.map(|r| r.cross(along));
        Self { along, arms, turns: [a.turned(arms[0]), b.turned(arms[1])] }
    }

    /// About an axis.
    pub fn about([a, b]: [&Body; 2], axis: Vector) -> Self {
        Self { along: Vector::default(), arms: [axis; 2], turns: [a.turned(axis), b.turned(axis)] }
    }

    /// Whether it is about an axis.
    pub fn is_about(&self) -> bool {
        self.along == Vector::default()
    }

    /// Speed of the second along it, seen from the first [m/s].
    #[inline(always)]
    pub fn speed(&self, a: &Twist, b: &Twist) -> f64 {
        self.along.dot(b.v - a.v) + self.arms[1].dot(b.w) - self.arms[0].dot(a.w)
    }

    /// The same of a pair of all twists.
    pub fn speed_of(&self, twists: &[Twist], [i, j]: [u32; 2]) -> f64 {
        self.speed(&twists[i as usize], &twists[j as usize])
    }

    /// Gives both an impulse [N s].
    #[inline(always)]
    pub fn push(&self, a: &mut Twist, b: &mut Twist, impulse: f64) {
        a.v = a.v - self.along * (impulse * a.inverse_mass);
        a.w = a.w - self.turns[0] * impulse;
        b.v = b.v + self.along * (impulse * b.inverse_mass);
        b.w = b.w + self.turns[1] * impulse;
    }

    /// Change of the speed along it by a unit impulse along another [1/kg].
    pub fn compliance(&self, other: &Self, inverse_mass: f64) -> f64 {
        inverse_mass * self.along.dot(other.along) + self.arms[0].dot(other.turns[0]) + self.arms[1].dot(other.turns[1])
    }
}

/// Two of many.
pub fn two<T>(all: &mut [T], pair: [u32; 2]) -> (&mut T, &mut T) {
    let [i, j] = pair.map(|i| i as usize);
    let (low, high) = all.split_at_mut(i.max(j));
    if i < j { (&mut low[i], &mut high[0]) } else { (&mut high[0], &mut low[j]) }
}
