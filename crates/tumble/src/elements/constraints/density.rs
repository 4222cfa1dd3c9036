//! A liquid of particles that keeps its density: one constraint for each particle on all its neighbours.
//!
//!   C_i = V sum_j W(|x_i - x_j|) - 1 <= 0,   W = (a³/4 - b³)/(pi s³),   a = max(0, 2 - r/s), b = max(0, 1 - r/s)   (liquids.1, liquids.2)
//!
//! V = s³ [m³] is a particle's share of a liquid at rest, s [m] the spacing. All particles are corrected at once from where they were, by
//! half of what each alone would need (liquids.5): more would overshoot. Positive pressure only, so that surfaces are free.
//! Source: [macklin2013]. Differs: compliance instead of a mixture of forces, masses in the weights, no tensile term; viscosity is a force.
//! Verified in `tests/liquids.rs`.

use super::{Constraints, Projection};
use crate::geometry::{Meet, Neighbours};
use crate::math::parallel::{chunks, sum};
use crate::math::{Lane, Real, Row};
use std::f64::consts::PI;
use std::ops::Range;

/// What a sweep takes back of what each particle alone would need.                                   (liquids.5)
const PART: Real = 0.5;

/// pi s³ W and minus pi s⁴ dW/dr at r = q s: the cubic spline of [monaghan1992], 0 beyond q = 2.
#[inline(always)]
pub fn spline<L: Lane>(q: L) -> (L, L) {
    let (a, b) = ((q.like(2.0) - q).above_zero(), (q.like(1.0) - q).above_zero());
    (q.like(0.25) * a * a * a - b * b * b, q.like(0.75) * a * a - q.like(3.0) * b * b)
}

/// The liquid of some rows.
pub struct Density {
    rows: Range<usize>,
    spacing: f64,
    /// 1/(K V) [1/J]; 0 keeps the density.
    compliance: f64,
    grid: Neighbours,
    points: Vec<[Real; 4]>,
    sums: Vec<[Real; 5]>,
    pushed: Vec<[Real; 4]>,
    moves: Vec<[Real; 3]>,
    /// Multipliers so far, and what this sweep adds.
    lambda: Vec<Real>,
    delta: Vec<Real>,
}

/// x, w -> V sum of W, s V sum of grad W, s² V² sum of w |grad W|², over all others.
struct Sums {
    inverse: f64,
}

impl Meet<4, 5> for Sums {
    #[inline(always)]
    fn meet<L: Lane>(&self, here: [L; 4], there: [L; 4], sum: [L; 5]) -> [L; 5] {
        let (d, q, inverse_q) = apart(self.inverse, [here[0], here[1], here[2]], [there[0], there[1], there[2]]);
        let scale = q.like(1.0 / PI);
        let (w, slope) = spline(q);
        let (w, slope) = (inverse_q.positive(w * scale, q.zero()), slope * scale);
        // Towards the other, since W falls.
        let pull = slope * inverse_q;
        [sum[0] + w, sum[1] + d[0] * pull, sum[2] + d[1] * pull, sum[3] + d[2] * pull, sum[4] + there[3] * slope * slope]
    }
}

/// x, dlambda -> s V sum of (dlambda_i + dlambda_j) grad W.
struct Moves {
    inverse: f64,
}

impl Meet<4, 3> for Moves {
    #[inline(always)]
    fn meet<L: Lane>(&self, here: [L; 4], there: [L; 4], sum: [L; 3]) -> [L; 3] {
        let (d, q, inverse_q) = apart(self.inverse, [here[0], here[1], here[2]], [there[0], there[1], there[2]]);
        let pull = spline(q).1 * q.like(1.0 / PI) * inverse_q * (here[3] + there[3]);
        [sum[0] + d[0] * pull, sum[1] + d[1] * pull, sum[2] + d[2] * pull]
    }
}

/// (x_j - x_i)/s, its length q, and 1/q, which is 0 for the particle itself.
#[inline(always)]
fn apart<L: Lane>(inverse: f64, here: [L; 3], there: [L; 3]) -> ([L; 3], L, L) {
    let scale = here[0].like(inverse);
    let d = [(there[0] - here[0]) * scale, (there[1] - here[1]) * scale, (there[2] - here[2]) * scale];
    let q_sq = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    let q = q_sq.sqrt();
    (d, q, q_sq.positive(q.like(1.0) / q, q.zero()))
}

impl Density {
    /// The liquid of some rows with the spacing s [m] at rest and the bulk modulus K [Pa], infinite to keep the density.
    pub fn new(rows: Range<usize>, spacing: f64, bulk: f64) -> Self {
        Self {
            rows,
            spacing,
            compliance: 1.0 / (bulk * spacing * spacing * spacing),
            grid: Neighbours::new(2.0 * spacing),
            points: Vec::new(),
            sums: Vec::new(),
            pushed: Vec::new(),
            moves: Vec::new(),
            lambda: Vec::new(),
            delta: Vec::new(),
        }
    }

    /// Sums over the neighbours of each, place by place.
    fn gather(&self, grid: &mut Neighbours, x: &[Row], points: &mut Vec<[Real; 4]>, sums: &mut Vec<[Real; 5]>) {
        grid.rebuild(x);
        grid.sorted(|i| x[i], points);
        grid.gather(&Sums { inverse: 1.0 / self.spacing }, points, sums);
    }
}

/// C of sums: with the particle's own share, V W(0) = 1/pi.
fn excess(sums: &[Real; 5]) -> Real {
    sums[0] + (1.0 / PI - 1.0) as Real
}

impl Constraints for Density {
    fn name(&self) -> &'static str {
        "density"
    }

    fn len(&self) -> usize {
        self.rows.len()
    }

    fn energy(&self, x: &[Row]) -> f64 {
        if self.compliance == 0.0 {
            return 0.0;
        }
        let (mut grid, mut points, mut sums) = (Neighbours::new(2.0 * self.spacing), Vec::new(), Vec::new());
        self.gather(&mut grid, &x[self.rows.clone()], &mut points, &mut sums);
        let of = |s: &[Real; 5]| 0.5 * f64::from(excess(s)).max(0.0) * f64::from(excess(s)).max(0.0) / self.compliance;
        sum(sums.len(), |range| sums[range].iter().map(of).sum())
    }

    fn project(&mut self, x: &mut [Row], step: &Projection<'_>) {
        let rows = &mut x[self.rows.clone()];
        let mut grid = std::mem::take(&mut self.grid);
        let (mut points, mut sums) = (std::mem::take(&mut self.points), std::mem::take(&mut self.sums));
        self.gather(&mut grid, rows, &mut points, &mut sums);
        (self.grid, self.points, self.sums) = (grid, points, sums);
        if step.iteration == 0 || self.lambda.len() != rows.len() {
            self.lambda.clear();
            self.lambda.resize(rows.len(), 0.0);
        }
        self.delta.resize(rows.len(), 0.0);
        // In units of s: weights count s² times, and so do multipliers.
        let spacing = self.spacing as Real;
        let alpha = if step.plain.is_some() { 0.0 } else { (self.compliance / (step.h * step.h)) as Real * spacing * spacing };
        let part = PART * step.plain.unwrap_or(1.0);
        let (grid, sums, lambda, own) = (&self.grid, &self.sums, &self.lambda, &*rows);
        chunks(&mut self.delta, |start, delta| {
            for (k, delta) in delta.iter_mut().enumerate() {
                let i = start + k;
                *delta = 0.0;
                if let Some(place) = grid.place(i) {
                    let s = &sums[place];
                    let weight = own[i][3] * (s[1] * s[1] + s[2] * s[2] + s[3] * s[3]) + s[4] + alpha;
                    if weight > 0.0 {
                        // Never a pull: the multiplier stays at or below 0.
                        let next = lambda[i] - part * (excess(s) + alpha * lambda[i]) / weight;
                        *delta = next.min(0.0) - lambda[i];
                    }
                }
            }
        });
        for (lambda, delta) in self.lambda.iter_mut().zip(&self.delta) {
            *lambda += delta;
        }
        let delta = &self.delta;
        self.grid.sorted(|i| [own[i][0], own[i][1], own[i][2], delta[i]], &mut self.pushed);
        self.grid.gather(&Moves { inverse: 1.0 / self.spacing }, &self.pushed, &mut self.moves);
        let (grid, moves) = (&self.grid, &self.moves);
        chunks(rows, |start, rows| {
            for (k, row) in rows.iter_mut().enumerate() {
                if let Some(place) = grid.place(start + k) {
                    let (m, c) = (moves[place], row[3] * spacing);
                    *row = [row[0] + m[0] * c, row[1] + m[1] * c, row[2] + m[2] * c, row[3]];
                }
            }
        });
    }

    fn add_grip(&self, _: &[Row], _: &mut [Real]) {}
}
