//! Contact of bodies whose shape is matched: solids act on the body as a whole, as far as a sub-step matches it, and not on single masses, which the
//! next match would turn into any motion of the body. The sub-step has moved it; impulses (shapes.5) add a rigid motion to that, by which a rigid
//! body stays in shape, and what single masses of a soft one yield.
//!
//!   n.v >= min(0, n.v_1 + depth/h)                                                                    (shapes.7)
//!
//! of every mass that ends too deep, or has passed a surface: it may come near, but not within the thickness. One that comes in faster than `resting`
//! is an impact at a time s h: its normal speed is stopped then and comes back by restitution, and what it changes acts for the rest of
//! the sub-step. What is still too deep is moved out, without speed. Verified in `tests/shape_contact.rs`.

use super::contact::{Step, on_parabola};
use super::impact::{Contact, Effect, solve};
use super::inertia::Motion;
use crate::elements::HELD;
use crate::geometry::{Collider, Friction, Vector};
use crate::math::parallel::fold;
use crate::math::{Quat, Real, Row, rotation, xyz64};

/// How often masses that a body's new motion brings into touch join the others.
const ROUNDS: usize = 4;
/// How often a body that is too deep is moved.
const PUSHES: usize = 8;
/// Contacts with one solid whose normals have a smaller product are different ones.
const APART: f64 = 0.9;

/// The masses of a body in a sub-step.
pub struct Body<'a> {
    /// Their masses [kg].
    pub mass: &'a [Real],
    /// Positions and velocities when it began.
    pub before: [&'a [Row]; 2],
    /// The same at its end, before contact.
    pub x: &'a [Row],
    pub v: &'a [Row],
    /// The share of the way to its shape that a sub-step takes.
    pub share: f64,
}

/// A motion that contact adds to that of a body.
#[derive(Debug, Clone)]
pub struct Change {
    /// Places turn about `from`, which goes to `to` [m].
    from: Vector,
    to: Vector,
    turn: Quat<f64>,
    /// Velocity of that point [m/s], and spin [rad/s].
    velocity: Vector,
    spin: Vector,
    /// Way [m] and velocity [m/s] of each mass beyond that; empty if it is rigid.
    own: Vec<[Vector; 2]>,
}

impl Change {
    fn place(&self, k: usize, x: Vector) -> Vector {
        self.to + self.turn.turn(x - self.from) + self.own.get(k).map_or(Vector::default(), |own| own[0])
    }

    /// Mass k with it; held ones stay.
    pub fn apply(&self, k: usize, x: &mut Row, v: &mut Row) {
        if x[3] > 0.0 {
            let place = self.place(k, xyz64(*x));
            let own = self.own.get(k).map_or(Vector::default(), |own| own[1]);
            let velocity = xyz64(*v) + self.velocity + self.spin.cross(place - self.to) + own;
            *x = [place.x as Real, place.y as Real, place.z as Real, x[3]];
            *v = [velocity.x as Real, velocity.y as Real, velocity.z as Real, 0.0];
        }
    }
}

/// A mass that a solid does not let pass.
#[derive(Clone, Copy)]
struct Meeting {
    k: usize,
    collider: usize,
    normal: Vector,
    surface: Vector,
    /// How deep it would be at the end of the sub-step [m].
    depth: f64,
    /// When it touches, as a part of the sub-step.
    part: f64,
    fast: bool,
}

impl Meeting {
    fn is_at(&self, other: &Self) -> bool {
        (self.k, self.collider) == (other.k, other.collider) && self.normal.dot(other.normal) > APART
    }
}

impl Body<'_> {
    fn len(&self) -> usize {
        self.x.len()
    }

    fn end(&self, k: usize) -> Vector {
        xyz64(self.x[k])
    }

    /// Where a mass is after a part of the sub-step, on a straight way.
    fn place(&self, k: usize, part: f64) -> Vector {
        let from = xyz64(self.before[0][k]);
        from + (self.end(k) - from) * part
    }

    fn velocity(&self, k: usize, part: f64) -> Vector {
        let from = xyz64(self.before[1][k]);
        from + (xyz64(self.v[k]) - from) * part
    }

    /// Its rigid motion; held masses are as heavy as can be, so that it turns about them.
    fn motion(&self, x: impl Fn(usize) -> Vector + Sync, v: impl Fn(usize) -> Vector + Sync) -> Motion {
        let total: f64 = self.mass.iter().map(|m| f64::from(*m)).sum();
        let mass = |k: usize| if self.x[k][3] > 0.0 { f64::from(self.mass[k]) } else { HELD * total };
        Motion::of(self.len(), mass, x, v)
    }

    /// Adds what single masses of a soft body have of their own.
    fn add_own(&self, sum: &mut Vec<[Vector; 2]>, own: impl Iterator<Item = (usize, [Vector; 2])>) {
        if self.share < 1.0 {
            sum.resize(self.len(), Default::default());
            for (k, [way, velocity]) in own {
                let [x, v] = sum[k];
                sum[k] = [x + way, v + velocity];
            }
        }
    }

    /// The meeting of a mass with a solid on its way, or at its end.
    fn meet(&self, k: usize, collider: &Collider, at: usize, step: &Step) -> Option<Meeting> {
        let (from, to) = (xyz64(self.before[0][k]), self.end(k));
        let way = to - from;
        if let Some(hit) = collider.sweep(from, to, step.t, step.t + step.h) {
            let fall = (way - hit.velocity * step.h).dot(hit.normal);
            if fall < 0.0 {
                let pull = self.velocity(k, 1.0) - self.velocity(k, 0.0);
                let part = on_parabola(hit.part, fall, 0.5 * step.h * pull.dot(hit.normal));
                let fast = (self.velocity(k, part) - hit.velocity).dot(hit.normal) < -step.resting;
                let depth = -fall * (1.0 - hit.part);
                return Some(Meeting { k, collider: at, normal: hit.normal, surface: hit.velocity, depth, part, fast });
            }
        }
        let touch = collider.touch(to, step.t + step.h)?;
        let fall = (way - touch.velocity * step.h).dot(touch.normal);
        let part = if fall < 0.0 { (1.0 + touch.depth / fall).max(0.0) } else { 0.0 };
        let fast = (self.velocity(k, part) - touch.velocity).dot(touch.normal) < -step.resting;
        Some(Meeting { k, collider: at, normal: touch.normal, surface: touch.velocity, depth: touch.depth, part, fast })
    }

    /// All of them.
    fn meetings(&self, colliders: &[Collider], step: &Step) -> Vec<Meeting> {
        let of = |k: usize| colliders.iter().enumerate().filter_map(move |(at, collider)| self.meet(k, collider, at, step));
        fold(self.len(), |range| range.filter(|k| self.x[*k][3] > 0.0).flat_map(of).collect::<Vec<_>>()).concat()
    }

    /// The masses that are deeper than rounding explains once the body has moved on.
    fn too_deep(&self, colliders: &[Collider], change: &Change, step: &Step) -> Vec<Meeting> {
        let of = |k: usize| {
            let place = change.place(k, self.end(k));
            let round = 8.0 * f64::from(Real::EPSILON) * (1e-3 + place.norm());
            let meeting = move |(at, collider): (usize, &Collider)| {
                let touch = collider.touch(place, step.t + step.h).filter(|touch| touch.depth > round)?;
                let (normal, surface, depth) = (touch.normal, touch.velocity, touch.depth);
                Some(Meeting { k, collider: at, normal, surface, depth, part: 0.0, fast: false })
            };
            colliders.iter().enumerate().filter_map(meeting)
        };
        fold(self.len(), |range| range.filter(|k| self.x[*k][3] > 0.0).flat_map(of).collect::<Vec<_>>()).concat()
    }
}

/// A time in a sub-step, as a part of it, and the rigid motion of a body then.
struct Moment {
    motion: Motion,
    part: f64,
    /// The velocity of the path is ahead of that of the scheme by this and by this spin; the motion has both.    (contact.14)
    ahead: [Vector; 2],
}

impl Moment {
    fn arm(&self, body: &Body<'_>, k: usize) -> Vector {
        body.place(k, self.part) - self.motion.center
    }

    /// Velocity of a mass of a body whose shape is matched by a share: what it has of its own is what the shape leaves.
    fn velocity(&self, body: &Body<'_>, k: usize, share: f64) -> Vector {
        let arm = self.arm(body, k);
        let own = body.velocity(k, self.part) + self.ahead[0] + self.ahead[1].cross(arm);
        let rigid = self.motion.at(arm);
        rigid + (own - rigid) * (1.0 - share)
    }
}

/// The meetings of a body in a sub-step, and when they act.
struct Course<'a> {
    body: &'a Body<'a>,
    colliders: &'a [Collider],
    /// End of the sub-step [s].
    time: f64,
    now: Moment,
    end: Moment,
    /// The time left [s].
    rest: f64,
    /// The largest restitution of an impact; `None` without one.
    restitution: Option<f64>,
}

impl Course<'_> {
    fn contact(&self, m: &Meeting, share: f64) -> Contact {
        let collider = &self.colliders[m.collider];
        let (restitution, friction) = (collider.restitution, collider.friction_at(self.time));
        let arrival = self.now.velocity(self.body, m.k, share) - m.surface;
        let later = (self.end.velocity(self.body, m.k, share) - m.surface).dot(m.normal);
        let least = if m.fast { 0.0 } else { (later + m.depth / self.rest).min(0.0) - later + arrival.dot(m.normal) };
        let (mass, arm) = (f64::from(self.body.mass[m.k]), self.now.arm(self.body, m.k));
        Contact { k: m.k, mass, arm, normal: m.normal, arrival, least, restitution: if m.fast { restitution } else { 0.0 }, friction }
    }

    /// What contact gives the body: of an impact a part as if it were rigid, of what is left all as far as its shape is matched.    (shapes.8)
    fn effect(&self, meetings: &[Meeting]) -> Effect {
        let share = self.body.share;
        let mut whole = Effect { own: vec![Vector::default(); meetings.len()], ..Effect::default() };
        if let Some(restitution) = self.restitution {
            let contacts: Vec<Contact> = meetings.iter().map(|m| self.contact(m, 1.0)).collect();
            let (part, rigid) = (share + (1.0 - share) * restitution, solve(&self.now.motion, 1.0, &contacts));
            (whole.velocity, whole.spin) = (rigid.velocity * part, rigid.spin * part);
            if share == 1.0 {
                return whole;
            }
        }
        let left = |m: &Meeting| {
            let contact = self.contact(m, share);
            Contact { arrival: contact.arrival + whole.velocity + whole.spin.cross(contact.arm), restitution: 0.0, ..contact }
        };
        let Effect { velocity, spin, own } = solve(&self.now.motion, share, &meetings.iter().map(left).collect::<Vec<_>>());
        Effect { velocity: whole.velocity + velocity, spin: whole.spin + spin, own }
    }
}

/// What contact with solids adds to the motion of a body in a sub-step, if there is any.
pub fn resolve(body: &Body<'_>, colliders: &[Collider], step: &Step) -> Option<Change> {
    let mut meetings = body.meetings(colliders, step);
    if meetings.is_empty() {
        return None;
    }
    let motion = |part: f64| body.motion(|k| body.place(k, part), |k| body.velocity(k, part));
    let at_end = || Moment { motion: motion(1.0), part: 1.0, ahead: Default::default() };
    let (end, impacts) = (at_end(), || meetings.iter().filter(|m| m.fast));
    let restitution = impacts().map(|m| colliders[m.collider].restitution).reduce(f64::max);
    // The first impact; without one, all acts as if from the start of the sub-step on.
    let (now, rest) = match impacts().map(|m| m.part).reduce(f64::min) {
        Some(part) => {
            let (at, start) = (motion(part), motion(0.0));
            let ahead = [end.motion.velocity - start.velocity, end.motion.spin - start.spin].map(|pull| pull * step.lead);
            let motion = Motion { velocity: at.velocity + ahead[0], spin: at.spin + ahead[1], ..at };
            (Moment { motion, part, ahead }, (1.0 - part) * step.h)
        }
        None => (at_end(), step.h),
    };
    let course = Course { body, colliders, time: step.t + step.h, now, end, rest, restitution };
    let from = course.end.motion.center;
    let mut change = None;
    for _ in 0..ROUNDS {
        let Effect { velocity, spin, own } = course.effect(&meetings);
        let turn = rotation::by(spin * rest);
        let mut found = Change { from, to: from + velocity * rest, turn, velocity, spin, own: Vec::new() };
        body.add_own(&mut found.own, meetings.iter().zip(own).map(|(m, own)| (m.k, [own * rest, own])));
        let mut deep = body.too_deep(colliders, &found, step);
        deep.retain(|new| !meetings.iter().any(|old| old.is_at(new)));
        for new in &mut deep {
            let place = body.end(new.k);
            new.depth += (found.place(new.k, place) - place).dot(new.normal);
        }
        change = Some(found);
        if deep.is_empty() {
            break;
        }
        meetings.extend(deep);
    }
    change.map(|change| moved_out(body, colliders, step, &course.end.motion, change))
}

/// A change that leaves no mass too deep, by a way that is no velocity.
fn moved_out(body: &Body<'_>, colliders: &[Collider], step: &Step, end: &Motion, mut change: Change) -> Change {
    for _ in 0..PUSHES {
        let deep = body.too_deep(colliders, &change, step);
        if deep.is_empty() {
            break;
        }
        let contact = |m: &Meeting| Contact {
            k: m.k,
            mass: f64::from(body.mass[m.k]),
            arm: change.place(m.k, body.end(m.k)) - change.to,
            normal: m.normal,
            arrival: Vector::default(),
            least: m.depth,
            restitution: 0.0,
            friction: Friction::default(),
        };
        let contacts: Vec<Contact> = deep.iter().map(contact).collect();
        let Effect { velocity: way, spin: turn, own } = solve(end, body.share, &contacts);
        (change.to, change.turn) = (change.to + way, rotation::by(turn) * change.turn);
        body.add_own(&mut change.own, deep.iter().zip(own).map(|(m, own)| (m.k, [own, Vector::default()])));
    }
    change
}
