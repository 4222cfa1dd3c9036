//! Springs whose stiffness and rest length are functions of time: winches and muscles. They are few, and go one by one.
//!
//!   f = k(t) (|d| - l(t)) + b n . d'                                                            (springs.16)
//!
//! Verified in `tests/anchors.rs`.

use super::batch::Batch;
use super::constraints::{Constraints, Projection};
use super::list::Weights;
use crate::geometry::Walls;
use crate::linalg::blocks::Block;
use crate::math::{Real, Row, Signal, Vec3, add, row, sub, xyz64};
use tumble_interface::scene::Hessian;

/// A spring between two points whose stiffness and length change in time.
#[derive(Debug, Clone)]
pub struct DrivenSpring {
    /// Rows of its ends.
    pub nodes: [u32; 2],
    /// Spring constant [N/m].
    pub stiffness: Signal,
    /// Rest length [m].
    pub rest: Signal,
    /// Damping along the spring [N s/m].
    pub damping: f64,
    /// The largest spring constant [N/m].
    pub stiffest: f64,
    /// The longest of its rest lengths, and its length at the start [m].
    pub reach: f64,
}

/// A spring at one time.
#[derive(Debug, Clone, Copy, Default)]
struct Now {
    stiffness: f64,
    rest: f64,
    /// Force on the first end [N].
    force: Row,
    matrix: [[f64; 3]; 3],
    /// Its multiplier in this sub-step.
    lambda: f64,
}

/// Driven springs, as forces or as constraints.
pub struct Driven {
    springs: Vec<DrivenSpring>,
    now: Vec<Now>,
}

impl Driven {
    /// Springs between some of the rows; `None` if an end is none of them.
    pub fn new(rows: usize, springs: Vec<DrivenSpring>) -> Option<Self> {
        let inside = springs.iter().flat_map(|s| s.nodes).all(|node| (node as usize) < rows);
        let now = |s: &DrivenSpring| Now { stiffness: s.stiffest, rest: s.rest.value(0.0), ..Now::default() };
        inside.then(|| Self { now: springs.iter().map(now).collect(), springs })
    }

    fn way(&self, e: usize, x: &[Row]) -> Vec3<f64> {
        let [a, b] = self.springs[e].nodes.map(|i| xyz64(x[i as usize]));
        b - a
    }

    /// What the drives may bring at once: the largest stiffness over the longest way [J].
    fn work(&self) -> f64 {
        self.springs.iter().map(|s| s.stiffest * s.reach * s.reach).sum()
    }

    /// Energy at a time [J].
    fn stored(&self, t: f64, x: &[Row]) -> f64 {
        let one = |e: usize| {
            let spring = &self.springs[e];
            0.5 * spring.stiffness.value(t) * (self.way(e, x).norm() - spring.rest.value(t)).powi(2)
        };
        (0..self.springs.len()).map(one).sum()
    }
}

impl Batch for Driven {
    fn name(&self) -> &'static str {
        "driven spring"
    }

    fn len(&self) -> usize {
        self.springs.len()
    }

    /// As the forces have seen it last.
    fn energy(&self, x: &[Row]) -> f64 {
        let one = |(e, now): (usize, &Now)| 0.5 * now.stiffness * (self.way(e, x).norm() - now.rest).powi(2);
        self.now.iter().enumerate().map(one).sum()
    }

    fn energy_at(&self, t: f64, x: &[Row]) -> f64 {
        self.stored(t, x)
    }

    fn drives(&self) -> Option<f64> {
        Some(self.work())
    }

    fn begin_forces(&mut self, t: f64, x: &[Row], v: &[Row]) {
        for e in 0..self.springs.len() {
            let spring = &self.springs[e];
            let (stiffness, rest) = (spring.stiffness.value(t), spring.rest.value(t));
            let (d, [a, b]) = (self.way(e, x), spring.nodes.map(|i| xyz64(v[i as usize])));
            let n = d.normalized();
            let pull = n * (stiffness * (d.norm() - rest) + spring.damping * n.dot(b - a));
            let force = row(Vec3 { x: pull.x as Real, y: pull.y as Real, z: pull.z as Real }, 0.0);
            self.now[e] = Now { stiffness, rest, force, ..self.now[e] };
        }
    }

    fn add_forces(&self, _x: &[Row], _v: &[Row], start: usize, force: &mut [Row]) {
        let rows = start..start + force.len();
        for (spring, now) in self.springs.iter().zip(&self.now) {
            let [a, b] = spring.nodes.map(|i| i as usize);
            if rows.contains(&a) {
                force[a - start] = add(force[a - start], now.force);
            }
            if rows.contains(&b) {
                force[b - start] = sub(force[b - start], now.force);
            }
        }
    }

    /// Where it is it may be at rest, for all that is known.
    fn foresee(&mut self, x: &[Row]) {
        for e in 0..self.springs.len() {
            (self.now[e].stiffness, self.now[e].rest) = (self.springs[e].stiffest, self.way(e, x).norm());
        }
    }

    fn linearize(&mut self, x: &[Row], weights: Weights) {
        for e in 0..self.springs.len() {
            let (d, Now { stiffness, rest, .. }) = (self.way(e, x), self.now[e]);
            let length = d.norm();
            let n: [f64; 3] = d.normalized().into();
            let across = if length > 0.0 { stiffness * (length - rest) / length } else { 0.0 };
            let across = if weights.hessian == Hessian::Exact { across } else { across.max(0.0) };
            let (k, b) = (f64::from(weights.stiffness), f64::from(weights.damping) * self.springs[e].damping);
            let entry = |i: usize, j: usize| {
                let own = if i == j { k * across } else { 0.0 };
                own + (k * (stiffness - across) + b) * n[i] * n[j]
            };
            self.now[e].matrix = [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(i, j)));
        }
    }

    fn add_product(&self, u: &[Row], start: usize, out: &mut [Row]) {
        let rows = start..start + out.len();
        for (e, now) in self.now.iter().enumerate() {
            let w: [f64; 3] = self.way(e, u).into();
            let product = now.matrix.map(|m| (m[0] * w[0] + m[1] * w[1] + m[2] * w[2]) as Real);
            let product = [product[0], product[1], product[2], 0.0];
            let [a, b] = self.springs[e].nodes.map(|i| i as usize);
            if rows.contains(&a) {
                out[a - start] = sub(out[a - start], product);
            }
            if rows.contains(&b) {
                out[b - start] = add(out[b - start], product);
            }
        }
    }

    fn add_diagonal(&mut self, _x: &[Row], blocks: &mut [Block]) {
        for (spring, now) in self.springs.iter().zip(&self.now) {
            let m = now.matrix;
            let own = [m[0][0], m[1][1], m[2][2], m[0][1], m[1][2], m[2][0]];
            spring.nodes.iter().for_each(|i| blocks[*i as usize].iter_mut().zip(own).for_each(|(b, k)| *b += k as Real));
        }
    }

    fn entries(&self, _x: &[Row], sink: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        for (spring, now) in self.springs.iter().zip(&self.now) {
            let [a, b] = spring.nodes.map(|i| i as usize);
            let other = now.matrix.map(|row| row.map(|k| -k));
            [(a, a, now.matrix), (b, b, now.matrix), (a, b, other), (b, a, other)].into_iter().for_each(|(i, j, m)| sink(i, j, m));
        }
    }
}

impl Constraints for Driven {
    fn name(&self) -> &'static str {
        "driven spring"
    }

    fn len(&self) -> usize {
        self.springs.len()
    }

    fn connect(&self, join: &mut dyn FnMut(u32, u32)) {
        self.springs.iter().for_each(|spring| join(spring.nodes[0], spring.nodes[1]));
    }

    fn energy(&self, x: &[Row], walls: Walls<'_>) -> f64 {
        self.stored(walls.t, x)
    }

    fn drives(&self) -> Option<f64> {
        Some(self.work())
    }

    /// As all springs are projected.                                                       (positions.1, positions.3)
    fn project(&mut self, x: &mut [Row], step: &Projection<'_>) {
        for e in 0..self.springs.len() {
            let spring = &self.springs[e];
            if step.iteration == 0 {
                self.now[e] =
                    Now { stiffness: spring.stiffness.value(step.walls.t), rest: spring.rest.value(step.walls.t), ..Now::default() };
            }
            let (d, [a, b]) = (self.way(e, x), spring.nodes.map(|i| i as usize));
            let (n, weight) = (d.normalized(), f64::from(x[a][3] + x[b][3]));
            let Now { stiffness, rest, lambda, .. } = self.now[e];
            if weight == 0.0 || stiffness == 0.0 && (spring.damping == 0.0 || step.plain.is_some()) {
                continue;
            }
            let error = d.norm() - rest;
            let change = match step.plain {
                Some(part) => -f64::from(part) * error / weight,
                None => {
                    // Multiplied by k h² + b h, so that a spring without stiffness still damps.
                    let (k, b) = (stiffness * step.h * step.h, spring.damping * step.h);
                    let rate = n.dot(d - self.way(e, step.before));
                    -(k * error + b * rate + lambda) / (1.0 + (k + b) * weight)
                }
            };
            self.now[e].lambda += change;
            for (i, sign) in [(a, -change), (b, change)] {
                let moved = xyz64(x[i]) + n * (sign * f64::from(x[i][3]));
                x[i] = [moved.x as Real, moved.y as Real, moved.z as Real, x[i][3]];
            }
        }
    }

    fn add_grip(&self, _x: &[Row], grip: &mut [Real]) {
        self.springs.iter().for_each(|spring| spring.nodes.iter().for_each(|i| grip[*i as usize] += spring.stiffest as Real));
    }
}
