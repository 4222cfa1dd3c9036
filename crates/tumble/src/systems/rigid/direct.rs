//! All joints that neither slip nor stop, solved at once: a chain of any length hangs together, whatever its masses.
//!
//!   (J M⁻¹ Jᵀ + γ) p = u* - J v                                                                              (joints.3)
//!
//! by L D Lᵀ within the envelope, joints in the order of Cuthill and McKee [cuthill1969]. Rows that others imply share what they hold.

use super::body::Body;
use super::joint::{Joints, Row};
use super::lever::{Pace, Twist, two};
use crate::geometry::Vector;
use std::ops::Range;

/// What all rows yield, over their diagonal: rows that others imply, or nearly so where a linkage is stretched or folded, share what they hold. Passes
/// bring the rest.
const YIELDS: f64 = 1e-6;

/// The rows of all joints in a stage of a sub-step.
#[derive(Default)]
pub struct Rows {
    pub all: Vec<Row>,
    /// Those that are solved at once.
    direct: Vec<usize>,
    /// Where each row of the factor begins, in columns and in its numbers, which end before the diagonal.
    first: Vec<usize>,
    starts: Vec<usize>,
    factor: Vec<f64>,
    /// 1/D.
    pivots: Vec<f64>,
    /// Where each set of rows begins that nothing joins with those before.
    sets: Vec<usize>,
    /// Bodies that move, and a row of each.
    holds: Vec<(u32, usize)>,
    /// All bodies at rest, to try impulses on.
    still: Vec<Twist>,
}

impl Rows {
    /// What joints ask before bodies move, or afterwards, when `before` has what they asked then.
    pub fn new(joints: &Joints, bodies: &[Body], pace: &Pace, before: Option<&[Row]>) -> Self {
        let all = joints.ask(bodies, pace, before);
        let direct = (0..all.len()).filter(|i| !all[*i].is_bounded()).collect();
        let mut rows = Self { all, direct, ..Self::default() };
        rows.assemble(bodies);
        rows.factorize();
        rows
    }

    fn assemble(&mut self, bodies: &[Body]) {
        let n = self.direct.len();
        // Rows of each body that moves, in their order.
        let mut ends: Vec<(u32, usize, usize)> = Vec::with_capacity(2 * n);
        for (k, i) in self.direct.iter().enumerate() {
            let moves = |i: &u32| bodies.get(*i as usize).is_some_and(|body| body.inverse_mass > 0.0);
            ends.extend(self.all[*i].pair.iter().enumerate().filter(|(_, i)| moves(i)).map(|(role, i)| (*i, k, role)));
        }
        ends.sort_unstable();
        self.holds = ends.iter().map(|(body, k, _)| (*body, *k)).collect();
        self.first = (0..n).collect();
        for group in ends.chunk_by(|a, b| a.0 == b.0) {
            for (_, k, _) in group {
                self.first[*k] = self.first[*k].min(group[0].1);
            }
        }
        let mut least = n;
        for k in (0..n).rev() {
            least = least.min(self.first[k]);
            if least == k {
                self.sets.push(k);
            }
        }
        self.sets.reverse();
        self.starts = vec![0];
        for k in 0..n {
            self.starts.push(self.starts[k] + k - self.first[k]);
        }
        self.factor = vec![0.0; self.starts[n]];
        self.pivots = self.direct.iter().map(|i| self.all[*i].give).collect();
        for group in ends.chunk_by(|a, b| a.0 == b.0) {
            let inverse_mass = bodies[group[0].0 as usize].inverse_mass;
            for (place, (_, k, role)) in group.iter().enumerate() {
                let one = &self.all[self.direct[*k]].lever;
                for (_, l, other) in &group[..=place] {
                    let two = &self.all[self.direct[*l]].lever;
                    let sign = if role == other { 1.0 } else { -1.0 };
                    let value = sign * (inverse_mass * one.along.dot(two.along) + one.arms[*role].dot(two.turns[*other]));
                    match k == l {
                        true => self.pivots[*k] += value,
                        false => self.factor[self.starts[*k] + l - self.first[*k]] += value,
                    }
                }
            }
        }
    }

    fn factorize(&mut self) {
        for k in 0..self.direct.len() {
            let (done, rest) = self.factor.split_at_mut(self.starts[k]);
            let (row, from, mut pivot) = (&mut rest[..k - self.first[k]], self.first[k], self.pivots[k] * (1.0 + YIELDS));
            for l in from..k {
                let common = from.max(self.first[l]);
                let other = &done[self.starts[l] + common - self.first[l]..self.starts[l + 1]];
                let sum: f64 = row[common - from..l - from].iter().zip(other).map(|(a, b)| a * b).sum();
                row[l - from] -= sum;
            }
            for l in from..k {
                let scaled = row[l - from] * self.pivots[l];
                pivot -= row[l - from] * scaled;
                row[l - from] = scaled;
            }
            self.pivots[k] = 1.0 / pivot;
        }
    }

    /// Gives what is known before.
    pub fn give(&mut self, twists: &mut [Twist]) {
        for row in self.all.iter_mut().filter(|row| row.bounds[0] == row.bounds[1]) {
            row.impulse = row.bounds[0];
            let (a, b) = two(twists, row.pair);
            row.lever.push(a, b, row.impulse);
        }
    }

    /// One pass: all rows without bounds at once, then those with bounds, one after the other.
    pub fn pass(&mut self, twists: &mut [Twist]) {
        let mut p: Vec<f64> = self.direct.iter().map(|i| self.all[*i].asked(twists)).collect();
        self.solve(0, &mut p);
        self.push(twists, 0, &p, 1.0);
        // Whatever a motor does, limits and ropes hold.
        for motors in [true, false] {
            for i in 0..self.all.len() {
                if (self.all[i].bounds[0] < 0.0) == motors {
                    self.step(i, twists);
                }
            }
        }
    }

    /// One row with bounds.
    fn step(&mut self, i: usize, twists: &mut [Twist]) {
        let row = &self.all[i];
        if !row.is_bounded() || row.clamped(row.impulse + row.mass * row.asked(twists)) == row.impulse {
            return;
        }
        if row.answer.is_none() {
            self.answer(i, twists);
        }
        let row = &mut self.all[i];
        let impulse = row.clamped(row.impulse + row.mass * row.asked(twists));
        let change = impulse - row.impulse;
        row.impulse = impulse;
        let (a, b) = two(twists, row.pair);
        row.lever.push(a, b, change);
        let answer = row.answer.take().unwrap_or_default();
        answer.iter().for_each(|(start, p)| self.push(twists, *start, p, change));
        self.all[i].answer = Some(answer);
    }

    /// The sets of rows that hold one of two bodies.
    fn around(&self, pair: [u32; 2]) -> Vec<Range<usize>> {
        let set = |body: u32| {
            let at = self.holds.partition_point(|(held, _)| *held < body);
            let (held, row) = self.holds.get(at)?;
            let next = self.sets.partition_point(|start| start <= row);
            (*held == body).then(|| self.sets[next - 1]..self.sets.get(next).copied().unwrap_or(self.direct.len()))
        };
        let mut sets: Vec<Range<usize>> = pair.into_iter().filter_map(set).collect();
        sets.dedup();
        sets
    }

    /// Finds what a unit of a row with bounds does to those without, and with them to itself.
    fn answer(&mut self, i: usize, twists: &[Twist]) {
        let mut still = std::mem::take(&mut self.still);
        if still.is_empty() {
            still.extend(twists.iter().map(|twist| Twist { v: Vector::default(), w: Vector::default(), ..*twist }));
        }
        let pair = self.all[i].pair;
        let (a, b) = two(&mut still, pair);
        self.all[i].lever.push(a, b, 1.0);
        let mut answer = Vec::new();
        for set in self.around(pair) {
            let mut p: Vec<f64> =
                self.direct[set.clone()].iter().map(|k| -self.all[*k].lever.speed_of(&still, self.all[*k].pair)).collect();
            self.solve(set.start, &mut p);
            answer.push((set.start, p));
        }
        for (start, p) in &answer {
            for (k, p) in self.direct[*start..].iter().zip(p) {
                let (a, b) = two(&mut still, self.all[*k].pair);
                self.all[*k].lever.push(a, b, *p);
            }
        }
        let yields = self.all[i].lever.speed_of(&still, pair) + self.all[i].give;
        let touched = answer.iter().flat_map(|(start, p)| &self.direct[*start..*start + p.len()]).map(|k| self.all[*k].pair).chain([pair]);
        for body in touched.flatten() {
            let twist = &mut still[body as usize];
            (twist.v, twist.w) = (Vector::default(), Vector::default());
        }
        self.still = still;
        let row = &mut self.all[i];
        row.mass = if yields * row.mass > YIELDS { 1.0 / yields } else { 0.0 };
        row.answer = Some(answer);
    }

    /// Gives bodies a multiple of impulses of the rows without bounds, from so many on.
    fn push(&mut self, twists: &mut [Twist], start: usize, impulses: &[f64], times: f64) {
        for (i, p) in self.direct[start..].iter().zip(impulses) {
            let row = &mut self.all[*i];
            let (a, b) = two(twists, row.pair);
            row.lever.push(a, b, p * times);
            row.impulse += p * times;
        }
    }

    /// L D Lᵀ p = what p is, of whole sets of rows.
    fn solve(&self, start: usize, p: &mut [f64]) {
        let row = |k: usize| &self.factor[self.starts[start + k]..self.starts[start + k + 1]];
        for k in 0..p.len() {
            let sum: f64 = row(k).iter().zip(&p[self.first[start + k] - start..k]).map(|(a, b)| a * b).sum();
            p[k] -= sum;
        }
        p.iter_mut().zip(&self.pivots[start..]).for_each(|(p, pivot)| *p *= pivot);
        for k in (0..p.len()).rev() {
            let (before, after) = p.split_at_mut(k);
            before[self.first[start + k] - start..].iter_mut().zip(row(k)).for_each(|(p, l)| *p -= l * after[0]);
        }
    }
}
