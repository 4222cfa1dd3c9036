//! One step of people: where each turns to, how fast it goes, and how far it can go before it meets others.
//!
//! Source: [tordeux2016], with steering by rotation, after the description of the third version of that model in the documentation of
//! JuPedSim, [jupedsim2026].

use super::near::Near;
use super::plan::{Plan, Point, along, cross, dot, length, nearest, sub};
use super::way::{Floor, NONE, Way};
use crate::math::functions::{atan2, cos, exp, sin};
use crate::math::parallel::Tasks;

/// Somebody.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Person {
    /// Place [m].
    pub x: Point,
    /// Displacement over the last step, over its length [m/s].
    pub v: Point,
    /// Angle of the heading [rad].
    pub heading: f64,
    /// Distance left [m].
    pub phi: f64,
    /// Radius of the body [m].
    pub radius: f64,
    /// Desired speed [m/s].
    pub speed: f64,
    /// When it starts [s], or has left.
    pub starts: f64,
    /// Where it goes once it has left: straight on, a unit vector.
    pub out: Option<Point>,
    /// Whether it has.
    pub started: bool,
    /// Number, which it keeps.
    pub id: u32,
    /// Its crowd.
    pub crowd: u32,
}

impl Person {
    /// Whether it is on its way, and slow.
    pub fn waits(&self) -> bool {
        self.started && length(self.v) < WAITS * self.speed
    }
}

/// Of the desired speed: who is slower waits.
pub const WAITS: f64 = 0.5;

/// Parameters of the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model {
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
/// Strength and decay [m] of walls in the reference direction.
const WALL: [f64; 2] = [5.0, 0.02];
/// Speed back where there is no room [m/s].
const BACK: f64 = -0.01;

/// Whoever is exactly ahead counts as this far to the left [m], so that both turn right.
const RIGHT: f64 = 0.01;
/// Speed at which way is made for whoever touches [m/s].
const YIELD: f64 = 0.5;
/// Gap below which it is made [m].
const TOUCH: f64 = 0.05;
/// Rounds over all contacts of a person.
const ROUNDS: usize = 6;
/// People a task.
const TASK: usize = 256;

/// What others need to know of somebody, sorted by cells.
#[derive(Debug, Clone, Copy, Default)]
struct Other {
    x: Point,
    radius: f64,
    /// Heading, a unit vector.
    e: Point,
    phi: f64,
    id: u32,
}

/// Memory that steps reuse.
#[derive(Debug, Default)]
pub struct Scratch {
    near: Near,
    sorted: Vec<Other>,
    /// What everybody does in this step.
    pub moves: Vec<Move>,
}

/// What somebody does in a step.
#[derive(Debug, Clone, Copy, Default)]
pub struct Move {
    /// Displacement [m].
    u: Point,
    /// Heading at its end [rad].
    heading: f64,
    /// Distance left at its end [m].
    pub phi: f64,
    /// The next gate at its start.
    pub gate: u32,
}

/// What is around a person.
struct Around<'a> {
    me: &'a Person,
    plan: &'a Plan,
    walls: &'a [u32],
    /// From here to them, its length, and who they are.
    others: &'a [(Point, f64, &'a Other)],
}

impl Around<'_> {
    fn sees(&self, r: Point) -> bool {
        self.walls.is_empty() || self.plan.sees(self.walls, self.me.x, along(self.me.x, 1.0, r))
    }

    /// Desired direction, bent by walls.                                                             (crowds.2)
    fn reference(&self, wanted: Point) -> Point {
        let mut e = wanted;
        for w in self.walls {
            let d = sub(nearest(self.plan.walls[*w as usize], self.me.x), self.me.x);
            let far = length(d);
            // Beyond twenty decay lengths nothing is left of it.
            if far > 0.0 && far < self.me.radius + 20.0 * WALL[1] {
                e = along(e, -WALL[0] * exp((self.me.radius - far) / WALL[1]) / far, d);
            }
        }
        let size = length(e);
        if size > 1e-9 { e.map(|e| e / size) } else { [cos(self.me.heading), sin(self.me.heading)] }
    }

    /// The turn away from the one ahead who matters most [rad].                                       (crowds.3)
    fn turn(&self, e: Point) -> f64 {
        let mut least = (f64::INFINITY, 0.0);
        for (r, _, _) in self.others {
            let (ahead, aside) = (dot(e, *r), cross(e, *r));
            let q = ahead / DECAY[0] + aside.abs() / DECAY[1];
            if ahead > 0.0 && q < least.0 && self.sees(*r) {
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

    /// Room ahead in a direction [m].                                                                 (crowds.4)
    fn room(&self, e: Point) -> f64 {
        let mut room = f64::INFINITY;
        for (r, d, other) in self.others {
            let reach = self.me.radius + other.radius;
            let ahead = dot(e, *r);
            let gap = d - reach;
            if ahead > 0.0 && cross(e, *r).abs() <= reach && gap < room && !self.goes_first(*r, other) && self.sees(*r) {
                room = gap;
            }
        }
        room
    }

    /// Of two who are in each other's way, the one with less way left goes first.
    fn goes_first(&self, r: Point, other: &Other) -> bool {
        dot(other.e, r) < 0.0 && (self.me.phi, self.me.id) < (other.phi, other.id)
    }

    /// Way made for those who go first and touch: away from them.                                     (crowds.6)
    fn makes_way(&self) -> Point {
        let mut v = [0.0; 2];
        for (r, d, other) in self.others {
            let gap = d - self.me.radius - other.radius;
            if gap < TOUCH && *d > 0.0 && (other.phi, other.id) < (self.me.phi, self.me.id) {
                v = along(v, -YIELD * (1.0 - gap / TOUCH) / d, *r);
            }
        }
        v
    }

    /// The part of a displacement that leads into nobody and no wall: of the gap to another each takes half.      (crowds.5)
    fn feasible(&self, mut u: Point) -> Point {
        let most = length(u);
        let mut planes: Vec<(Point, f64)> = Vec::new();
        for w in self.walls {
            let d = sub(nearest(self.plan.walls[*w as usize], self.me.x), self.me.x);
            let far = length(d);
            if far > 0.0 && far < self.me.radius + most {
                planes.push((d.map(|d| d / far), (far - self.me.radius).max(0.0)));
            }
        }
        for (r, d, other) in self.others {
            let gap = (d - self.me.radius - other.radius).max(0.0);
            if *d > 0.0 && 0.5 * gap < most {
                planes.push((r.map(|r| r / d), 0.5 * gap));
            }
        }
        for _ in 0..ROUNDS {
            let mut held = false;
            for (n, room) in &planes {
                let over = dot(u, *n) - room;
                if over > 0.0 {
                    (u, held) = (along(u, -over, *n), true);
                }
            }
            if !held {
                return u;
            }
        }
        // What is left over in the last round shortens the step.
        let share = |(n, room): &(Point, f64)| if dot(u, *n) > *room { (room / dot(u, *n)).max(0.0) } else { 1.0 };
        let s = planes.iter().map(share).fold(1.0, f64::min);
        u.map(|u| s * u)
    }
}

/// One step of everybody, from t to t + h [s]. Distances left are not updated.
pub fn step(people: &mut [Person], floor: &Floor, model: &Model, scratch: &mut Scratch, t: f64, h: f64) {
    people.iter_mut().for_each(|p| p.started = t >= p.starts || p.out.is_some());
    let most = |f: fn(&Person) -> f64| people.iter().map(f).fold(0.0, f64::max);
    let range = reach(most(|p| p.speed), most(|p| p.radius), model);
    let Scratch { near, sorted, moves } = scratch;
    near.sort(0.5 * range, people.iter().map(|p| p.x));
    sorted.clear();
    sorted.extend(near.order.iter().map(|row| {
        let p = &people[*row as usize];
        Other { x: p.x, radius: p.radius, e: [cos(p.heading), sin(p.heading)], phi: p.phi, id: p.id }
    }));
    moves.resize(people.len(), Move::default());
    let (near, sorted, all) = (&*near, &*sorted, &*people);
    moves.chunks_mut(TASK).enumerate().in_parallel(|(task, moves)| {
        let mut others = Vec::new();
        for (k, to) in moves.iter_mut().enumerate() {
            let me = &all[task * TASK + k];
            let way = floor.way(me.crowd);
            let runs = near.runs(me.x, range).flat_map(|run| &sorted[run]);
            let neighbours = runs.filter(|other| other.id != me.id).filter_map(|other| {
                let r = sub(other.x, me.x);
                let d_sq = dot(r, r);
                (d_sq < range * range).then(|| (r, d_sq.sqrt(), other))
            });
            others.clear();
            others.extend(neighbours);
            let around = Around { me, plan: &floor.plan, walls: floor.plan.near(me.x), others: &others };
            let (u, heading) = if me.started { one(&around, way, model, h) } else { ([0.0; 2], me.heading) };
            *to = match me.out {
                Some(out) => Move { u, heading, phi: me.phi - dot(u, out), gate: NONE },
                None => Move { u, heading, phi: way.distance(along(me.x, 1.0, u)), gate: way.gate(me.x) },
            };
        }
    });
    people.iter_mut().zip(moves.iter()).for_each(|(p, to)| {
        p.x = along(p.x, 1.0, to.u);
        p.v = to.u.map(|u| u / h);
        p.heading = to.heading;
    });
}

/// Displacement [m] and heading [rad] of one person.
fn one(around: &Around<'_>, way: &Way, model: &Model, h: f64) -> (Point, f64) {
    let me = around.me;
    let now = [cos(me.heading), sin(me.heading)];
    let down = me.out.unwrap_or_else(|| way.direction(me.x));
    let wanted = if down == [0.0; 2] { now } else { down };
    let reference = around.reference(wanted);
    let target = atan2(reference[1], reference[0]) + around.turn(reference);
    let aim = [cos(target), sin(target)];
    let heading = me.heading + (h / RELAX).min(1.0) * atan2(cross(now, aim), dot(now, aim));
    let e = [cos(heading), sin(heading)];
    let room = (1.0 - BLEND) * around.room(e).min(1e6) + BLEND * around.room(wanted).min(1e6);
    let v = ((room - model.buffer) / model.time_gap).clamp(BACK, me.speed);
    let u = along(around.makes_way(), v, e);
    // Nobody is faster than it wants to be.
    let size = length(u);
    let u = if size > me.speed { u.map(|u| u * me.speed / size) } else { u };
    (around.feasible(u.map(|u| u * h)), heading)
}

/// How far people look [m].
pub fn reach(speed: f64, radius: f64, model: &Model) -> f64 {
    (speed * model.time_gap + model.buffer + 2.0 * radius).max(2.0)
}
