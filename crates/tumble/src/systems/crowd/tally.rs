//! What gates count: crossings, density, and the time that people lose before them.
//!
//! Somebody who gets d nearer to the exit in a step h loses h - d/v0: summed over a way, its time less that of walking it freely. (crowds.7)
//! It is charged to the next gate on the way, unless people beyond that gate stand, too: then the queue is that of theirs.

use super::people::Person;
use super::plan::{Point, crossing};
use super::way::{Floor, NEAR, NONE, in_sight};

/// People beyond a gate, at least, of whom most must wait for its queue to be that of the next.
const FEW: u32 = 2;

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
        Self { crossed: vec![[0; 2]; gates], span: vec![[f64::NAN; 2]; gates], waited: vec![0.0; gates], lost: vec![0.0; gates] }
    }

    /// Counts the gates that a step of h [s] from t crosses, and says which exit ends it, and at which part of the step.
    pub fn cross(&mut self, floor: &Floor, exits: &[usize], before: Point, after: Point, t: f64, h: f64) -> Option<(usize, f64)> {
        let mut met: Vec<(f64, usize, bool)> = Vec::new();
        for &g in floor.plan.gates_near(after) {
            let found = crossing(floor.plan.gates[g as usize].line, before, after);
            met.extend(found.map(|(s, to_right)| (s, g as usize, to_right)));
        }
        met.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (s, g, to_right) in met {
            self.crossed[g][usize::from(!to_right)] += 1;
            let at = t + s * h;
            self.span[g] = [if self.span[g][0].is_nan() { at } else { self.span[g][0] }, at];
            if exits.contains(&g) {
                return Some((g, s));
            }
        }
        None
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

/// For each gate the one whose queue people before it stand in: itself, or one beyond whose queue reaches back through it.
pub fn queues(floor: &Floor, people: &[Person], gates: impl Iterator<Item = u32>) -> Vec<u32> {
    let count = floor.plan.gates.len();
    let (mut all, mut votes) = (vec![0; count], Vec::new());
    for (p, next) in people.iter().zip(gates).filter(|(_, next)| *next != NONE) {
        for &g in floor.plan.gates_near(p.x).iter().filter(|g| **g != next) {
            let gate = &floor.plan.gates[g as usize];
            if p.phi < floor.gate(p.crowd, g as usize) && in_sight(&floor.plan, gate, p.x, NEAR).is_some() {
                all[g as usize] += 1;
                if p.waits() {
                    votes.push((g, next));
                }
            }
        }
    }
    votes.sort_unstable();
    let mut queue: Vec<u32> = (0..count as u32).collect();
    for of in votes.chunk_by(|a, b| a.0 == b.0) {
        let g = of[0].0;
        if all[g as usize] >= FEW && 2 * of.len() as u32 > all[g as usize] {
            let most = of.chunk_by(|a, b| a == b).fold(&of[..0], |most, of| if of.len() > most.len() { of } else { most });
            queue[g as usize] = most[0].1;
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

/// People on the floor near each gate, over its area, on the side where there are more [1/m²].
pub fn densities(floor: &Floor, people: &[Person]) -> Vec<f64> {
    let mut count = vec![[0.0; 2]; floor.plan.gates.len()];
    for p in people {
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
