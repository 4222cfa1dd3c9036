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
use super::lever::{Lever, Pace, Twist};
use super::wide::{Blocks, across, meeting};
use crate::geometry::{self, Vector};

/// Rounds of bounces at most.
const ROUNDS: usize = 200;
/// Sweeps over the points of a pair that bounces, at most.
const SWEEPS: usize = 100;

/// A point of a pair that bounces.
struct Row {
    /// The normal.
    normal: Lever,
    /// 1/(n K n) [kg].
    mass: f64,
    /// Two directions across the normal.
    across: [Lever; 2],
    /// The inverse of K along them: xx, yy, xy [kg].
    inverse: [f64; 3],
    /// 1 over the largest eigenvalue of K.
    slide: f64,
    /// Speeds of belts along them [m/s].
    belt: [f64; 2],
    /// Coulomb friction.
    friction: geometry::Friction,
    /// Impulses along the normal and across it [N s].
    press: f64,
    drag: [f64; 2],
}

impl Row {
    fn new(bodies: &[Body], c: &Contact, arms: [Vector; 2]) -> Self {
        let pair @ [a, b] = c.pair.map(|i| &bodies[i as usize]);
        let inverse_mass = a.inverse_mass + b.inverse_mass;
        let (normal, along) = (Lever::new(pair, arms, c.normal), across(c.normal));
        let levers = along.map(|along| Lever::new(pair, arms, along));
        let k = |i: usize, j: usize| levers[i].compliance(&levers[j], inverse_mass);
        let [xx, yy, xy] = [k(0, 0), k(1, 1), k(0, 1)];
        let det = xx * yy - xy * xy;
        Self {
            mass: 1.0 / normal.compliance(&normal, inverse_mass),
            normal,
            across: levers,
            inverse: [yy / det, xx / det, -xy / det],
            slide: 2.0 / (xx + yy + ((xx - yy) * (xx - yy) + 4.0 * xy * xy).sqrt()),
            belt: along.map(|along| c.belt.dot(along)),
            friction: c.friction,
            press: 0.0,
            drag: [0.0; 2],
        }
    }

    /// Friction within Coulomb's cone over the impulse along the normal, as in `wide`.
    fn rub(&mut self, a: &mut Twist, b: &mut Twist) {
        let [s, t] = &self.across;
        let (x, y) = (s.speed(a, b) + self.belt[0], t.speed(a, b) + self.belt[1]);
        let ([xx, yy, xy], [p, q]) = (self.inverse, self.drag);
        let mut new = [p - (xx * x + xy * y), q - (xy * x + yy * y)];
        let square = |[p, q]: [f64; 2]| p * p + q * q;
        if square(new) > (self.friction.resting * self.press).powi(2) {
            new = [p - self.slide * x, q - self.slide * y];
            let (most, length) = (self.friction.sliding * self.press, square(new).sqrt());
            if length > most {
                new = new.map(|p| p * (most / length));
            }
        }
        s.push(a, b, new[0] - p);
        t.push(a, b, new[1] - q);
        self.drag = new;
    }
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
    let met = closing.iter().map(|(c, _)| Row::new(bodies, c, meeting([a, b], [a.x + a.v * t, b.x + b.v * t], c.arms)));
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
        impulse: row.normal.along * row.press + row.across[0].along * row.drag[0] + row.across[1].along * row.drag[1],
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
    let mut blocks = Blocks::new(bodies, contacts, pace);
    let mut first = Rows::new(joints, bodies, pace, None);
    // The last one is the world.
    let now = |bodies: &[Body]| -> Vec<Twist> { bodies.iter().chain([&Body::WORLD]).map(Twist::of).collect() };
    let mut twists = now(bodies);
    blocks.start(&mut twists);
    let passes = |joints: &mut Rows, blocks: &mut Blocks, twists: &mut [Twist], soft: bool| {
        for _ in 0..pace.iterations {
            joints.pass(twists);
            blocks.pass(twists, soft);
        }
    };
    let back = |bodies: &mut [Body], twists: &[Twist]| {
        bodies.iter_mut().zip(twists).for_each(|(body, twist)| (body.v, body.w) = (twist.v, twist.w));
    };
    first.give(&mut twists);
    passes(&mut first, &mut blocks, &mut twists, true);
    back(bodies, &twists);
    blocks.keep(contacts);
    go(bodies, contacts, joints);
    blocks.moved(bodies, contacts);
    let mut last = Rows::new(joints, bodies, pace, Some(&first.all));
    let mut twists = now(bodies);
    last.give(&mut twists);
    passes(&mut last, &mut blocks, &mut twists, false);
    back(bodies, &twists);
    blocks.keep(contacts);
    joints.load([&first.all, &last.all], pace.h);
}
