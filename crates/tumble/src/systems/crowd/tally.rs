//! What gates count: crossings, density, and the time that people lose before them.
//!
//! Somebody who gets d nearer to the exit in a step h loses h - d/v0: summed over a way, its time less that of walking it freely. (crowds.7)
//! It is charged to the next gate on the way, unless people beyond that gate stand, too: then the queue is that of theirs.

use super::around::Person;
use super::floor::{Floor, NEAR};
use super::people::Move;
use super::plan::{Point, crossing, length, sub};
use super::way::{NONE, in_sight};

/// Mean speed of people beyond a gate over their desired ones, below which its queue is that of the next gate.
const SLOW: f64 = 0.45;
/// Time over which it is a mean [s].
const MEMORY: f64 = 2.0;

/// Counts of all gates.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tally {
    /// Crossings from the left of a gate to its right, and back.
    pub crossed: Vec<[u32; 2]>,
    /// When the first and the last was [s]; NaN before there is one.
    pub span: Vec<[f64; 2]>,
    /// Time waited [s], of all people together.
    pub waited: Vec<f64>,
    /// Time lost [s], of all people together.
    pub lost: Vec<f64>,
    /// Speed of people just beyond each gate over their desired ones, a mean over the last seconds.
    pub pace: Vec<f64>,
}

/// What a step meant to somebody.
pub struct Share {
    /// The next gate at its start.
    pub gate: u32,
    /// Time lost [s].
    pub lost: f64,
    /// Time waited [s].
    pub waited: f64,
}

impl Tally {
    /// Counts of so many gates.
    pub fn new(gates: usize) -> Self {
        Self {
            crossed: vec![[0; 2]; gates],
            span: vec![[f64::NAN; 2]; gates],
            waited: vec![0.0; gates],
            lost: vec![0.0; gates],
            pace: vec![1.0; gates],
        }
    }

    /// Counts the gates that a step of h [s] from t crosses; at which part of the step each was, which it is, and the way across, a unit vector.
    pub fn cross(&mut self, floor: &Floor, before: Point, after: Point, t: f64, h: f64) -> Vec<(f64, usize, Point)> {
        let mut met: Vec<(f64, usize, bool)> = Vec::new();
        for &g in floor.plan.gates_near(after) {
            let found = crossing(floor.plan.gates[g as usize].line, before, after);
            met.extend(found.map(|(s, to_right)| (s, g as usize, to_right)));
        }
        met.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut count = |(s, g, to_right): (f64, usize, bool)| {
            self.crossed[g][usize::from(!to_right)] += 1;
            let at = t + s * h;
            self.span[g] = [if self.span[g][0].is_nan() { at } else { self.span[g][0] }, at];
            let [a, b] = floor.plan.gates[g].line;
            let d = sub(b, a);
            let side = if to_right { 1.0 } else { -1.0 } / length(d);
            (s, g, [side * d[1], -side * d[0]])
        };
        met.into_iter().map(&mut count).collect()
    }

    /// For each gate the one whose queue people before it stand in: itself, or the next of most who are slow beyond it. h is the step [s].
    pub fn queues(&mut self, floor: &Floor, people: &[Person], moves: &[Move], h: f64) -> Vec<u32> {
        // Gate, next gate, and pace of those beyond it.
        let mut beyond = Vec::new();
        for (p, Move { gate: next, .. }) in people.iter().zip(moves).filter(|(p, to)| to.near && p.started && to.gate != NONE) {
            for &g in floor.plan.gates_near(p.x).iter().filter(|g| *g != next) {
                let gate = &floor.plan.gates[g as usize];
                if p.phi < floor.gate(p.way, g as usize) && in_sight(&floor.plan, gate, p.x, NEAR).is_some() {
                    beyond.push((g, *next, (length(p.v) / p.free).min(1.0)));
                }
            }
        }
        beyond.sort_by_key(|(g, next, _)| (*g, *next));
        let count = self.pace.len();
        let (mut now, mut queue) = (vec![1.0; count], (0..count as u32).collect::<Vec<u32>>());
        for of in beyond.chunk_by(|a, b| a.0 == b.0) {
            let g = of[0].0 as usize;
            now[g] = of.iter().map(|(_, _, pace)| pace).sum::<f64>() / of.len() as f64;
            let most = of.chunk_by(|a, b| a.1 == b.1).fold(&of[..0], |most, of| if of.len() > most.len() { of } else { most });
            queue[g] = most[0].1;
        }
        for (g, (pace, now)) in self.pace.iter_mut().zip(now).enumerate() {
            *pace += (h / MEMORY).min(1.0) * (now - *pace);
            if *pace >= SLOW {
                queue[g] = g as u32;
            }
        }
        let last = |g: u32| {
            // In a circle of queues each is its own.
            let mut at = g;
            for _ in 0..count {
                if queue[at as usize] == at {
                    return at;
                }
                at = queue[at as usize];
            }
            g
        };
        (0..count as u32).map(last).collect()
    }

    /// Charges everybody's step to gates.
    pub fn charge(&mut self, shares: &[Share], queues: &[u32]) {
        for share in shares.iter().filter(|share| share.gate != NONE) {
            let g = queues[share.gate as usize] as usize;
            self.lost[g] += share.lost;
            self.waited[g] += share.waited;
        }
    }
}

/// People on the floor near each gate, over its area, on the side where there are more [1/m²].
pub fn densities(floor: &Floor, people: &[Person]) -> Vec<f64> {
    let mut count = vec![[0.0; 2]; floor.plan.gates.len()];
    for p in people.iter().filter(|p| p.out.is_none()) {
        for &g in floor.plan.gates_near(p.x) {
            if let Some(side) = in_sight(&floor.plan, &floor.plan.gates[g as usize], p.x, NEAR) {
                count[g as usize][side] += 1.0;
            }
        }
    }
    let of = |(count, area): (&[f64; 2], &[f64; 2])| {
        let on = |side: usize| if area[side] > 0.0 { count[side] / area[side] } else { 0.0 };
        on(0).max(on(1))
    };
    count.iter().zip(&floor.areas).map(of).collect()
}
