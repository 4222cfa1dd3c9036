//! Impulses of contacts: bounces, one after the other; then non-penetration and friction by sequential impulses, in soft passes that mend
//! overlaps, too, and rigid ones after bodies have moved, which take away the speed of mending.
//!
//!   speed  u = v_b + ω_b × r_b - v_a - ω_a × r_a,   n·u ≥ -gap/h  ⊥  p ≥ 0,   |d| ≤ μ p,   d ∥ -u_t where it slides          (rigid.4)
//!   and against rolling the angular impulse  |l| ≤ μ_r ρ p,   l ∥ -(ω_b - ω_a)_t where it rolls                              (rigid.6)
//!
//! Sources: sequential impulses and soft constraints [catto2009], small steps [macklin2019], the step along the slide back to the cone
//! [jourdan1998].

use super::body::Body;
use super::contact::Contact;
use super::direct::Rows;
use super::joint::Joints;
use super::lever::{FASTEST, Lever, Pace, Twist, two};
use crate::geometry::Vector;
use crate::math::parallel::fold;

/// Overlaps are mended as by springs of this frequency over that of sub-steps, twice as much against what nothing moves.
const MEND: f64 = 0.25;
/// Damping ratio of these.
const DAMPING: f64 = 10.0;
/// Rounds of bounces at most.
const ROUNDS: usize = 200;
/// Sweeps over the points of a pair that bounces, at most.
const SWEEPS: usize = 100;

/// Friction against sliding, or against rolling: impulses along two levers, both together at most in proportion to the impulse along the normal.
#[derive(Clone)]
struct Friction {
    /// Two directions across the normal, or axes.
    levers: [Lever; 2],
    /// The inverse of K along them: xx, yy, xy [kg], or [kg m²].
    inverse: [f64; 3],
    /// 1 over the largest eigenvalue of K.
    slide: f64,
    /// Speeds of belts along them [m/s].
    belt: [f64; 2],
    /// The largest impulse over that along the normal, of what rests and of what moves [1], or [m].
    bounds: [f64; 2],
    /// Impulses along them [N s], or [N m s].
    impulse: [f64; 2],
}

impl Friction {
    /// Along two levers of bodies with the sum `inverse_mass` [1/kg], as it was at first.
    fn new(levers: [Lever; 2], inverse_mass: f64, bounds: [f64; 2], impulse: [f64; 2]) -> Self {
        let k = |i: usize, j: usize| levers[i].compliance(&levers[j], inverse_mass);
        let [xx, yy, xy] = [k(0, 0), k(1, 1), k(0, 1)];
        let det = xx * yy - xy * xy;
        let slide = 2.0 / (xx + yy + ((xx - yy) * (xx - yy) + 4.0 * xy * xy).sqrt());
        Self { levers, inverse: [yy / det, xx / det, -xy / det], slide, belt: [0.0; 2], bounds, impulse }
    }

    /// Within Coulomb's cone over an impulse along the normal [N s].
    #[inline(always)]
    fn rub(&mut self, press: f64, a: &mut Twist, b: &mut Twist) {
        let [s, t] = &self.levers;
        let (x, y) = (s.speed(a, b) + self.belt[0], t.speed(a, b) + self.belt[1]);
        let ([xx, yy, xy], [p, q], [resting, sliding]) = (self.inverse, self.impulse, self.bounds);
        let mut new = [p - (xx * x + xy * y), q - (xy * x + yy * y)];
        let square = |[p, q]: [f64; 2]| p * p + q * q;
        if square(new) > (resting * press) * (resting * press) {
            // With the inverse of K, the impulse would not point against the slide: a step along that, and back to the cone.
            new = [p - self.slide * x, q - self.slide * y];
            let (most, length) = (sliding * press, square(new).sqrt());
            if length > most {
                new = new.map(|p| p * (most / length));
            }
        }
        s.push(a, b, new[0] - p);
        t.push(a, b, new[1] - q);
        self.impulse = new;
    }

    /// Its impulse as a vector along those of its levers.
    fn sum(&self, along: impl Fn(&Lever) -> Vector) -> Vector {
        along(&self.levers[0]) * self.impulse[0] + along(&self.levers[1]) * self.impulse[1]
    }
}

/// A contact as the passes see it.
#[derive(Clone)]
struct Row {
    pair: [u32; 2],
    /// The normal.
    normal: Lever,
    /// 1/(n K n) [kg].
    mass: f64,
    /// Against sliding, and against rolling, if there is some.
    friction: Friction,
    rolling: Option<Box<Friction>>,
    /// Speed of approach that is left by a soft pass, negative to part what overlaps, and by a rigid pass [m/s].
    bias: [f64; 2],
    /// Factors of a soft pass on the effective mass and on the accumulated impulse.
    soft: [f64; 2],
    /// Impulse along the normal [N s].
    press: f64,
}

impl Row {
    fn new(bodies: &[Body], c: &Contact, pace: &Pace) -> Self {
        let pair @ [a, b] = c.pair.map(|i| &bodies[i as usize]);
        let n = c.normal;
        let least = if n.x.abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let t = n.cross(Vector::from(least)).normalized();
        let across = [t, n.cross(t)];
        let inverse_mass = a.inverse_mass + b.inverse_mass;
        let normal = Lever::new(pair, c.arms, n);
        let along = across.map(|along| Lever::new(pair, c.arms, along));
        let bounds = [c.friction.resting, c.friction.sliding];
        let belt = across.map(|along| c.belt.dot(along));
        let friction = Friction { belt, ..Friction::new(along, inverse_mass, bounds, across.map(|along| c.drag.dot(along))) };
        let rolls = || Friction::new(across.map(|axis| Lever::about(pair, axis)), 0.0, [c.rolling; 2], across.map(|axis| c.roll.dot(axis)));
        let fixed = a.inverse_mass == 0.0 || b.inverse_mass == 0.0;
        // h ω of the springs.
        let rate = std::f64::consts::TAU * MEND * if fixed { 2.0 } else { 1.0 };
        let damped = 2.0 * DAMPING + rate;
        let left = 1.0 / (1.0 + rate * damped);
        let (bias, soft) = if c.gap > 0.0 {
            (c.gap / pace.h, [1.0, 0.0])
        } else {
            ((c.gap * rate / (pace.h * damped)).max(-FASTEST), [rate * damped * left, left])
        };
        Self {
            pair: c.pair,
            mass: 1.0 / normal.compliance(&normal, inverse_mass),
            normal,
            friction,
            rolling: (c.rolling > 0.0).then(|| Box::new(rolls())),
            bias: [bias, c.gap.max(0.0) / pace.h],
            soft,
            press: c.press,
        }
    }

    /// The same contact of two bodies that have moved.
    fn moved(&mut self, bodies: &[Body], c: &Contact) {
        let pair @ [a, b] = c.pair.map(|i| &bodies[i as usize]);
        if a.inverse_mass > 0.0 && b.inverse_mass > 0.0 {
            let arms = meeting(pair, [a.x, b.x], c.arms);
            self.normal = Lever::new(pair, arms, self.normal.along);
            let levers = &mut self.friction.levers;
            *levers = levers.map(|lever| Lever::new(pair, arms, lever.along));
            if let Some(rolling) = &mut self.rolling {
                rolling.levers = rolling.levers.map(|lever| Lever::about(pair, lever.arms[0]));
            }
        }
    }

    /// Friction against sliding.
    #[inline(always)]
    fn rub(&mut self, a: &mut Twist, b: &mut Twist) {
        if self.friction.bounds[0] > 0.0 {
            self.friction.rub(self.press, a, b);
        }
    }

    /// One pass over a contact.
    #[inline(always)]
    fn pass(&mut self, twists: &mut [Twist], soft: bool) {
        let (a, b) = two(twists, self.pair);
        let (bias, [mass, left]) = if soft { (self.bias[0], self.soft) } else { (self.bias[1], [1.0, 0.0]) };
        let speed = self.normal.speed(a, b);
        let press = (self.press - self.mass * mass * (speed + bias) - left * self.press).max(0.0);
        self.normal.push(a, b, press - self.press);
        self.press = press;
        self.rub(a, b);
        if let Some(rolling) = &mut self.rolling {
            rolling.rub(press, a, b);
        }
    }
}

/// Arms of a contact of two bodies at other places: it goes with the smaller one, and both still push at one point, so that no angular momentum is
/// lost.
fn meeting(pair: [&Body; 2], [a, b]: [Vector; 2], [ra, rb]: [Vector; 2]) -> [Vector; 2] {
    let [one, two] = pair.map(|body| body.inertia.iter().sum::<f64>());
    if one <= two { [ra, a + ra - b] } else { [b + rb - a, rb] }
}

/// An impulse of a bounce on the second of two bodies [N s], at these arms.
pub struct Blow {
    /// The bodies.
    pub pair: [u32; 2],
    /// Ways from their centres [m].
    pub arms: [Vector; 2],
    /// The impulse [N s].
    pub impulse: Vector,
}

/// Bounces: each pair that closes within the sub-step turns its approach round, one pair after the other until none approaches.
pub fn bounce(bodies: &mut [Body], contacts: &[Contact], pace: &Pace) -> Vec<Blow> {
    let mut blows = Vec::new();
    let elastic: Vec<&[Contact]> = contacts.chunk_by(|a, b| a.pair == b.pair).filter(|points| points[0].restitution > 0.0).collect();
    for round in 0..ROUNDS {
        let hits = elastic.iter().map(|points| u32::from(hit(bodies, points, round == 0, pace, &mut blows))).sum::<u32>();
        if hits == 0 {
            break;
        }
    }
    blows
}

/// A bounce of a pair at all its points that close within the sub-step; `false` if there are none. In the first round it has its time.
fn hit(bodies: &mut [Body], points: &[Contact], first: bool, pace: &Pace, blows: &mut Vec<Blow>) -> bool {
    let index = points[0].pair;
    let pair = index.map(|i| bodies[i as usize]);
    let [a, b] = &pair;
    let pull = |body: &Body, n: Vector| if body.inverse_mass > 0.0 { pace.gravity.dot(n) } else { 0.0 };
    // Points that close: the time of their meeting, from gap + u t + a t²/2 = 0 with the speed and the gravity of the start.
    let closing = points.iter().filter_map(|c| {
        let speed = (b.velocity_at(c.arms[1]) - a.velocity_at(c.arms[0])).dot(c.normal);
        let gap = if first { c.gap.max(0.0) } else { 0.0 };
        if speed >= -pace.still || gap + speed * pace.h >= 0.0 {
            return None;
        }
        let rate = pull(b, c.normal) - pull(a, c.normal);
        let start = speed - rate * pace.h;
        let root = (start * start - 2.0 * rate * gap).max(0.0).sqrt();
        Some((c, if gap > 0.0 { 2.0 * gap / (root - start) } else { 0.0 }))
    });
    let closing: Vec<(&Contact, f64)> = closing.collect();
    let Some(t) = closing.iter().map(|(_, t)| *t).min_by(f64::total_cmp) else { return false };
    let met = closing.iter().map(|(c, _)| {
        let arms = meeting([a, b], [a.x + a.v * t, b.x + b.v * t], c.arms);
        let none = Vector::default();
        Row::new(bodies, &Contact { arms, press: 0.0, drag: none, roll: none, ..(*c).clone() }, pace)
    });
    let mut rows: Vec<Row> = met.collect();
    let [mut one, mut two] = [Twist::of(a), Twist::of(b)];
    // Speeds after: gravity has pulled for all of the sub-step, the part after the meeting comes on top of what bounces.
    let after: Vec<f64> = rows
        .iter()
        .zip(&closing)
        .map(|(row, (c, _))| {
            let (speed, late) = (row.normal.speed(&one, &two), if first { pace.h - t } else { 0.0 });
            let rate = pull(b, c.normal) - pull(a, c.normal);
            speed - (1.0 + c.restitution) * (speed - rate * late).min(0.0)
        })
        .collect();
    for _ in 0..SWEEPS {
        let mut change = 0.0_f64;
        for (row, after) in rows.iter_mut().zip(&after) {
            let lever = &row.normal;
            let press = (row.press + row.mass * (after - lever.speed(&one, &two))).max(0.0);
            change = change.max((press - row.press).abs() / press.max(f64::MIN_POSITIVE));
            lever.push(&mut one, &mut two, press - row.press);
            row.press = press;
            row.rub(&mut one, &mut two);
        }
        if change < 1e-13 {
            break;
        }
    }
    // Until they met, they have moved as before.
    let t = if first { t } else { 0.0 };
    for (i, twist) in index.into_iter().zip([one, two]) {
        let body = &mut bodies[i as usize];
        body.x = body.x - (twist.v - body.v) * t;
        (body.v, body.w) = (twist.v, twist.w);
    }
    let blow = |(row, (c, _)): (&Row, &(&Contact, f64))| Blow {
        pair: index,
        arms: c.arms,
        impulse: row.normal.along * row.press + row.friction.sum(|lever| lever.along),
    };
    blows.extend(rows.iter().zip(&closing).map(blow));
    true
}

/// One sub-step of contacts and joints: speeds in, speeds and what contacts and joints hold out; `go` moves bodies between the two sorts of passes.
pub fn solve(
    bodies: &mut [Body],
    contacts: &mut [Contact],
    joints: &mut Joints,
    pace: &Pace,
    go: impl FnOnce(&mut [Body], &[Contact], &Joints),
) {
    let made =
        |bodies: &[Body]| fold(contacts.len(), |range| contacts[range].iter().map(|c| Row::new(bodies, c, pace)).collect::<Vec<_>>());
    let mut rows: Vec<Row> = made(bodies).concat();
    let mut first = Rows::new(joints, bodies, pace, None);
    // The last one is the world.
    let now = |bodies: &[Body]| -> Vec<Twist> { bodies.iter().chain([&Body::WORLD]).map(Twist::of).collect() };
    let mut twists = now(bodies);
    for row in &rows {
        let (a, b) = two(&mut twists, row.pair);
        row.normal.push(a, b, row.press);
        for friction in std::iter::once(&row.friction).chain(row.rolling.as_deref()) {
            friction.levers.iter().zip(friction.impulse).for_each(|(lever, impulse)| lever.push(a, b, impulse));
        }
    }
    let passes = |joints: &mut Rows, rows: &mut [Row], twists: &mut [Twist], soft: bool| {
        for _ in 0..pace.iterations {
            joints.pass(twists);
            rows.iter_mut().for_each(|row| row.pass(twists, soft));
        }
    };
    let back = |bodies: &mut [Body], twists: &[Twist]| {
        bodies.iter_mut().zip(twists).for_each(|(body, twist)| (body.v, body.w) = (twist.v, twist.w));
    };
    first.give(&mut twists);
    passes(&mut first, &mut rows, &mut twists, true);
    back(bodies, &twists);
    keep(contacts, &rows);
    go(bodies, contacts, joints);
    rows.iter_mut().zip(&*contacts).for_each(|(row, c)| row.moved(bodies, c));
    let mut last = Rows::new(joints, bodies, pace, Some(&first.all));
    let mut twists = now(bodies);
    last.give(&mut twists);
    passes(&mut last, &mut rows, &mut twists, false);
    back(bodies, &twists);
    keep(contacts, &rows);
    joints.load([&first.all, &last.all], pace.h);
}

/// What the passes have found.
fn keep(contacts: &mut [Contact], rows: &[Row]) {
    for (c, row) in contacts.iter_mut().zip(rows) {
        c.press = row.press;
        c.drag = row.friction.sum(|lever| lever.along);
        c.roll = row.rolling.as_ref().map_or(Vector::default(), |rolling| rolling.sum(|lever| lever.arms[0]));
    }
}
