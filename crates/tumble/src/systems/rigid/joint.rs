//! Joints: what they ask of the speeds of two bodies, so that a sub-step is one of RATTLE, with springs and motors by the implicit midpoint rule.
//!
//!   C(x) + h J v = 0 before bodies move,   J v = 0 afterwards                                                    (joints.1)
//!
//! C is what a joint forbids, J its derivative. Half of the impulse of a spring acts before bodies move, half after.
//!
//! Sources: RATTLE [andersen1983]; what long sub-steps make of tension [tournier2015].

use super::body::Body;
use super::lever::{FASTEST, Lever, Pace, Twist};
use crate::geometry::Vector;
use crate::math::functions::atan2;
use crate::math::{Quat, Signal};

/// Of a body: the world, which nothing moves.
pub const WORLD: u32 = u32::MAX;
/// Ends of a rope or spring closer than this have no direction [m].
const CLOSE: f64 = 1e-12;
/// Springs are resolved by sub-steps for (h w)² and h c/m below this.
const EXPLICIT: f64 = 0.25;
/// A load |p| at the arm r turns a body as fast as sub-steps resolve, where h² r |p| is less than this part of its moment of inertia.
const RESOLVED: f64 = 0.5;

/// What holds a body to another one, or to the world.
#[derive(Debug, Clone)]
pub struct Joint {
    /// Whether others see the two touch.
    pub collides: bool,
    /// The other body, and the one whose motion against it counts.
    pub pair: [u32; 2],
    /// Its point on each, from the centre of mass in the axes of each [m].
    pub at: [Vector; 2],
    /// Its axes in those of each: hinges and sliders have their x.
    pub turn: [Quat<f64>; 2],
    /// What it leaves free.
    pub kind: Kind,
    /// The least and the greatest angle [rad] or way [m].
    pub limits: Option<[f64; 2]>,
    /// What moves it.
    pub motor: Option<Motor>,
    /// Force [N] and torque [N m] beyond which it breaks.
    pub breaks: [f64; 2],
    /// Whether it has broken.
    pub broken: bool,
    /// Force [N] and torque [N m] on the second body in the last sub-step.
    pub load: [Vector; 2],
}

/// Kinds of joints.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// Nothing.
    Fixed,
    /// All turns.
    Ball,
    /// Turns about its axis.
    Hinge,
    /// Ways along its axis.
    Slider,
    /// All within a length [m].
    Rope(f64),
    /// All; it pulls to its length [m] by its stiffness [N/m], and damps [N s/m].
    Spring([f64; 3]),
}

/// What moves a joint along the axis, or about it.
#[derive(Debug, Clone)]
pub struct Motor {
    /// What it aims at.
    pub drive: Drive,
    /// Its largest torque [N m] or force [N].
    pub strength: f64,
}

/// What a motor aims at.
#[derive(Debug, Clone)]
pub enum Drive {
    /// A speed [rad/s] or [m/s].
    Speed(Signal),
    /// An angle [rad] or a way [m], by a stiffness [N m/rad] or [N/m] and a damping [N m s/rad] or [N s/m].
    Target(Signal, [f64; 2]),
}

/// What a joint asks: u + give p = target, with p within bounds.
#[derive(Clone)]
pub struct Row {
    /// Its joint, and the two bodies.
    pub joint: u32,
    pub pair: [u32; 2],
    pub lever: Lever,
    /// Speed of the second body along the lever [m/s] or about it [rad/s].
    pub target: f64,
    /// Compliance of its own [1/kg], of a turn [1/(kg m²)].
    pub give: f64,
    /// The least and the greatest impulse that it can give [N s], or [N m s].
    pub bounds: [f64; 2],
    /// 1 over the sum of `give` and the compliance of both bodies, once there is an answer of all that hangs on them [kg], or [kg m²].
    pub mass: f64,
    /// What it gives [N s], or [N m s].
    pub impulse: f64,
    /// Of a row with bounds: what a unit of it does to those without, from so many rows on.
    pub answer: Option<Vec<(usize, Vec<f64>)>>,
}

impl Row {
    /// Whether there is something that it cannot give.
    pub fn is_bounded(&self) -> bool {
        self.bounds.iter().any(|b| b.is_finite())
    }

    /// How far what it asks is from what there is [m/s] or [rad/s].
    pub fn asked(&self, twists: &[Twist]) -> f64 {
        self.target - self.lever.speed_of(twists, self.pair) - self.give * self.impulse
    }

    /// The nearest that it can give.
    pub fn clamped(&self, impulse: f64) -> f64 {
        impulse.max(self.bounds[0]).min(self.bounds[1])
    }
}

/// When joints ask.
#[derive(Clone, Copy)]
enum Stage<'a> {
    /// Before bodies move.
    First,
    /// Afterwards, with what the same joint has asked before.
    Last(&'a [Row]),
}

/// Along which line, or about which axis, a row acts.
#[derive(Clone, Copy)]
enum Way {
    Along(Vector),
    About(Vector),
}

/// A joint that asks.
struct Asker<'a> {
    joint: u32,
    pair: [u32; 2],
    bodies: [&'a Body; 2],
    /// From the centres of mass to where it pushes [m].
    arms: [Vector; 2],
    /// The sub-step [s].
    h: f64,
    /// What is out of place is mended no faster than this: ways [m/s], turns [rad/s]. What turning adds in a sub-step comes on top.
    mend: [f64; 2],
    stage: Stage<'a>,
    out: &'a mut Vec<Row>,
}

const FREE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

impl Asker<'_> {
    /// `asked` has the target, the compliance and the bounds.
    fn push(&mut self, way: Way, (target, give, bounds): (f64, f64, [f64; 2])) {
        let [a, b] = self.bodies;
        let (lever, moved) = match way {
            Way::Along(e) => (Lever::new(self.bodies, self.arms, e), a.inverse_mass + b.inverse_mass),
            Way::About(e) => (Lever::about(self.bodies, e), 0.0),
        };
        let compliance = lever.compliance(&lever, moved) + give;
        if compliance == 0.0 {
            // In a plane nothing turns about an axis that lies in it.
            return;
        }
        let mass = 1.0 / compliance;
        self.out.push(Row { joint: self.joint, pair: self.pair, lever, target, give, bounds, mass, impulse: 0.0, answer: None });
    }

    /// Nothing goes on along a way, and c [m] or [rad] is mended.
    fn hold(&mut self, way: Way, c: f64) {
        let most = self.mend[usize::from(matches!(way, Way::About(_)))];
        let target = match self.stage {
            Stage::First => (-c / self.h).max(-most).min(most),
            Stage::Last(_) => 0.0,
        };
        self.push(way, (target, 0.0, FREE));
    }

    /// The gap along a way does not close.
    fn stop(&mut self, way: Way, gap: f64) {
        let target = match self.stage {
            Stage::First => (-gap / self.h).min(self.mend[usize::from(matches!(way, Way::About(_)))]),
            Stage::Last(_) => -gap.max(0.0) / self.h,
        };
        self.push(way, (target, 0.0, [0.0, f64::INFINITY]));
    }

    /// A speed along a way, by so much force or torque at most; limits and ropes are stronger than any motor.
    fn drive(&mut self, way: Way, speed: f64, most: f64) {
        let half = (0.5 * self.h * most).min(f64::MAX);
        self.push(way, (speed, 0.0, [-half, half]));
    }

    /// A spring along a way: stretched by c, of stiffness k and damping d, by so much at most.                  (joints.2)
    fn pull(&mut self, way: Way, c: f64, [k, d]: [f64; 2], most: f64) {
        let half = 0.5 * self.h;
        let rate = half * (half * k + d);
        match self.stage {
            _ if rate == 0.0 => {}
            Stage::First => self.push(way, (-half * k * c / rate, 1.0 / rate, [-half * most, half * most])),
            // It is the last row of its joint.
            Stage::Last(before) => self.push(way, (0.0, 0.0, [before.last().map_or(0.0, |row| row.impulse); 2])),
        }
    }

    /// A spring along a line, of which c is how far it is stretched, u how fast it stretches. Where sub-steps resolve it, half of its impulse is that
    /// of the force before bodies move, half that of the force after it, as in velocity Verlet: energy and angular momentum stay. Stiffer ones are
    /// damped by implicit Euler.
    fn line(&mut self, e: Vector, c: f64, [k, d]: [f64; 2]) {
        let lever = Lever::new(self.bodies, self.arms, e);
        let [a, b] = self.bodies;
        let (compliance, h) = (lever.compliance(&lever, a.inverse_mass + b.inverse_mass), self.h);
        if (h * h * k).max(h * d) * compliance < EXPLICIT {
            let u = e.dot(b.velocity_at(self.arms[1]) - a.velocity_at(self.arms[0]));
            self.push(Way::Along(e), (0.0, 0.0, [-0.5 * h * (k * c + d * u); 2]));
        } else if let Stage::First = self.stage {
            let rate = h * (h * k + d);
            self.push(Way::Along(e), (-h * k * c / rate, 1.0 / rate, FREE));
        }
    }

    /// A damper on turns, before bodies move alone: as half of an implicit midpoint it would not damp what is too fast.      (joints.4)
    fn damp(&mut self, way: Way, damping: f64) {
        if let (Stage::First, true) = (self.stage, damping > 0.0) {
            self.push(way, (0.0, 1.0 / (self.h * damping), FREE));
        }
    }
}

/// Two unit vectors across a unit vector, and each other.
fn across(e: Vector) -> [Vector; 2] {
    let least = if e.x.abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let s = e.cross(Vector::from(least)).normalized();
    [s, e.cross(s)]
}

/// Where a joint's two points and axes are.
struct Pose {
    points: [Vector; 2],
    turns: [Quat<f64>; 2],
}

impl Pose {
    /// The rotation vector from the first axes to the second, in those of the world [rad].
    fn twist(&self) -> Vector {
        let q = self.turns[0].conj() * self.turns[1];
        let q = if q.w < 0.0 { q.scaled(-1.0) } else { q };
        let length = q.v.norm();
        let per = if length > 0.0 { 2.0 * atan2(length, q.w) / length } else { 2.0 };
        self.turns[0].turn(q.v * per)
    }

    /// The angle about the axis, from -pi to pi [rad].
    fn angle(&self) -> f64 {
        let q = self.turns[0].conj() * self.turns[1];
        let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
        2.0 * atan2(sign * q.v.x, sign * q.w)
    }

    fn axes(&self) -> [Vector; 3] {
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|e| self.turns[0].turn(Vector::from(e)))
    }
}

impl Joint {
    fn pose(&self, bodies: [&Body; 2]) -> Pose {
        let [a, b] = bodies;
        Pose { points: [a.x + a.q.turn(self.at[0]), b.x + b.q.turn(self.at[1])], turns: [a.q * self.turn[0], b.q * self.turn[1]] }
    }

    /// Its ends on both [m].
    pub fn ends(&self, bodies: &[Body]) -> [Vector; 2] {
        self.pose(self.bodies(bodies)).points
    }

    fn bodies<'a>(&self, bodies: &'a [Body]) -> [&'a Body; 2] {
        self.pair.map(|i| bodies.get(i as usize).unwrap_or(&Body::WORLD))
    }

    /// The angle [rad], way [m] or length [m] that it leaves free, where that is one number.
    pub fn measure(&self, bodies: &[Body]) -> Option<f64> {
        let pose = self.pose(self.bodies(bodies));
        let between = pose.points[1] - pose.points[0];
        match self.kind {
            Kind::Hinge => Some(pose.angle()),
            Kind::Slider => Some(between.dot(pose.axes()[0])),
            Kind::Rope(_) | Kind::Spring(_) => Some(between.norm()),
            Kind::Fixed | Kind::Ball => None,
        }
    }

    /// Energy of its spring, or of its motor with a target: what it takes to stretch them so far [J].
    pub fn energy(&self, bodies: &[Body], t: f64) -> f64 {
        let stretch = |target: f64| self.measure(bodies).map_or(0.0, |now| (now - target).abs());
        let (k, most, c) = match (&self.kind, &self.motor) {
            _ if self.broken => return 0.0,
            (Kind::Spring([length, k, _]), _) => (*k, f64::INFINITY, stretch(*length)),
            (_, Some(Motor { drive: Drive::Target(at, [k, _]), strength })) => (*k, *strength, stretch(at.value(t))),
            _ => return 0.0,
        };
        // Beyond most/k it gives way.
        if k * c <= most { 0.5 * k * c * c } else { most * (c - 0.5 * most / k) }
    }

    /// How much turns are to be damped whose load is faster than sub-steps resolve [N m s]: that of bodies which others hold, too.      (joints.4)
    fn unresolved(&self, bodies: [&Body; 2], arms: [Vector; 2], shared: [bool; 2], h: f64) -> f64 {
        let load = self.load[0].norm();
        let of = |((body, arm), shared): ((&Body, Vector), bool)| {
            let length = arm.norm();
            if !shared || length * load == 0.0 {
                return 0.0;
            }
            // The least moment about an axis across the arm.
            let [s, t] = across(arm * (1.0 / length));
            let ([a, b], c) = ([s, t].map(|e| e.dot(body.turned(e))), s.dot(body.turned(t)));
            let moment = 2.0 / (a + b + ((a - b) * (a - b) + 4.0 * c * c).sqrt());
            (length * load * h - RESOLVED * moment / h).max(0.0)
        };
        2.0 * bodies.into_iter().zip(arms).zip(shared).map(of).sum::<f64>()
    }

    /// What it asks in a sub-step; `shared` tells of each of its bodies whether other joints hold that.
    fn ask(&self, joint: u32, bodies: &[Body], shared: [bool; 2], &Pace { t, h, .. }: &Pace, stage: Stage<'_>, out: &mut Vec<Row>) {
        if self.broken {
            return;
        }
        let both @ [a, b] = self.bodies(bodies);
        let pose = self.pose(both);
        let [from, to] = pose.points;
        let (between, axes @ [axis, ..]) = (to - from, pose.axes());
        let pair = self.pair.map(|i| i.min(bodies.len() as u32));
        // Both push at one point, so that no angular momentum is lost; along a line each at its end.
        let line = matches!(self.kind, Kind::Rope(_) | Kind::Spring(_));
        let arms = [if line { from } else { to } - a.x, to - b.x];
        let turning = both.map(|body| body.w.norm_sq() * h);
        let mend = [turning[0] * arms[0].norm() + turning[1] * arms[1].norm(), turning[0] + turning[1]].map(|own| FASTEST + own);
        let asker = &mut Asker { joint, pair, bodies: both, arms, h, mend, stage, out };
        let points = |asker: &mut Asker<'_>, axes: &[Vector]| axes.iter().for_each(|e| asker.hold(Way::Along(*e), between.dot(*e)));
        let tilted = |asker: &mut Asker<'_>, axes: &[Vector], by: Vector| axes.iter().for_each(|e| asker.hold(Way::About(*e), by.dot(*e)));
        let damping = self.unresolved(both, arms, shared, h);
        match self.kind {
            _ if damping == 0.0 => {}
            Kind::Fixed | Kind::Slider => {}
            Kind::Hinge => asker.damp(Way::About(axis), damping),
            _ => across(self.load[0].normalized()).iter().for_each(|e| asker.damp(Way::About(*e), damping)),
        }
        let (way, now): (fn(Vector) -> Way, f64) = match self.kind {
            Kind::Rope(length) | Kind::Spring([length, ..]) => {
                let distance = between.norm();
                let along = if distance > CLOSE { between * (1.0 / distance) } else { axis };
                return match self.kind {
                    Kind::Spring([_, k, d]) => asker.line(along, distance - length, [k, d]),
                    _ => asker.stop(Way::Along(-along), length - distance),
                };
            }
            Kind::Ball => return points(asker, &axes),
            Kind::Fixed => {
                points(asker, &axes);
                return tilted(asker, &axes, pose.twist());
            }
            Kind::Hinge => {
                points(asker, &axes);
                tilted(asker, &axes[1..], axis.cross(pose.turns[1].turn([1.0, 0.0, 0.0].into())));
                (Way::About, pose.angle())
            }
            Kind::Slider => {
                points(asker, &axes[1..]);
                tilted(asker, &axes, pose.twist());
                (Way::Along, between.dot(axis))
            }
        };
        if let Some([low, high]) = self.limits {
            asker.stop(way(axis), now - low);
            asker.stop(way(-axis), high - now);
        }
        match &self.motor {
            Some(Motor { drive: Drive::Speed(speed), strength }) => asker.drive(way(axis), speed.value(t + 0.5 * h), *strength),
            Some(Motor { drive: Drive::Target(at, spring), strength }) => {
                asker.pull(way(axis), now - at.value(t + 0.5 * h), *spring, *strength)
            }
            None => {}
        }
    }
}

/// All joints of a system, in the order in which they stand in its matrix.
#[derive(Default)]
pub struct Joints {
    pub all: Vec<Joint>,
    order: Vec<u32>,
}

impl Joints {
    /// Joints of so many bodies that move: neighbours stand near each other, what has no body in common apart [cuthill1969].
    pub fn new(all: Vec<Joint>, moving: usize) -> Self {
        let mut of: Vec<Vec<u32>> = vec![Vec::new(); moving];
        for (k, joint) in all.iter().enumerate() {
            joint.pair.iter().for_each(|i| of.get_mut(*i as usize).into_iter().for_each(|joints| joints.push(k as u32)));
        }
        let near = |k: u32| all[k as usize].pair.into_iter().filter_map(|i| of.get(i as usize)).flatten().copied();
        let degree = |k: &u32| (near(*k).count(), *k);
        let mut seeds: Vec<u32> = (0..all.len() as u32).collect();
        seeds.sort_by_key(degree);
        let (mut seen, mut order) = (vec![false; all.len()], Vec::with_capacity(all.len()));
        for seed in seeds {
            let mut next = order.len();
            if !std::mem::replace(&mut seen[seed as usize], true) {
                order.push(seed);
            }
            while next < order.len() {
                let mut found: Vec<u32> = near(order[next]).filter(|k| !std::mem::replace(&mut seen[*k as usize], true)).collect();
                found.sort_by_key(degree);
                order.extend(found);
                next += 1;
            }
        }
        Self { all, order }
    }

    /// What all of them ask before bodies move, or afterwards, when `before` has what they asked then.
    pub fn ask(&self, bodies: &[Body], pace: &Pace, before: Option<&[Row]>) -> Vec<Row> {
        let mut holds = vec![0_u32; bodies.len() + 1];
        let place = |i: u32| (i as usize).min(bodies.len());
        self.held().for_each(|i| holds[place(i)] += 1);
        let (mut rows, mut rest) = (Vec::new(), before.unwrap_or_default());
        for i in &self.order {
            let (own, others) = rest.split_at(rest.iter().take_while(|row| row.joint == *i).count());
            rest = others;
            let stage = if before.is_some() { Stage::Last(own) } else { Stage::First };
            let joint = &self.all[*i as usize];
            joint.ask(*i, bodies, joint.pair.map(|i| holds[place(i)] > 1), pace, stage, &mut rows);
        }
        rows
    }

    /// The bodies that they hold.
    pub fn held(&self) -> impl Iterator<Item = u32> {
        self.all.iter().filter(|joint| !joint.broken).flat_map(|joint| joint.pair).filter(|i| *i != WORLD)
    }

    /// The two that each holds together; one may be the world.
    pub fn pairs(&self) -> impl Iterator<Item = [u32; 2]> {
        self.all.iter().filter(|joint| !joint.broken).map(|joint| joint.pair)
    }

    /// Pairs of bodies that do not touch, in order.
    pub fn apart(&self) -> Vec<[u32; 2]> {
        let joined = self.all.iter().filter(|joint| !joint.broken && !joint.collides && joint.pair[0] != WORLD);
        let mut apart: Vec<[u32; 2]> = joined.map(|joint| [joint.pair[0].min(joint.pair[1]), joint.pair[0].max(joint.pair[1])]).collect();
        apart.sort_unstable();
        apart
    }

    /// Sums what the rows of a sub-step of h [s] have given to the loads of joints; those of too much break.
    pub fn load(&mut self, stages: [&[Row]; 2], h: f64) {
        self.all.iter_mut().for_each(|joint| joint.load = Default::default());
        for row in stages.into_iter().flatten() {
            let (place, direction) = if row.lever.is_about() { (1, row.lever.arms[1]) } else { (0, row.lever.along) };
            let load = &mut self.all[row.joint as usize].load[place];
            *load = *load + direction * (row.impulse / h);
        }
        for joint in &mut self.all {
            joint.broken |= joint.load.iter().zip(joint.breaks).any(|(load, most)| load.norm() > most);
        }
    }
}
