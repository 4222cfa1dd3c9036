//! A liquid of particles that keeps its density: one constraint for each particle on all its neighbours.
//!
//!   C_i = V sum_j W(|x_i - x_j|) - 1 <= 0,   W = (a³/4 - b³)/(pi s³),   a = max(0, 2 - r/s), b = max(0, 1 - r/s)   (liquids.1, liquids.2)
//!
//! V = s³ [m³] is a particle's share of a liquid at rest, s [m] the spacing. All particles are corrected at once from where they were, by
//! half of what each alone would need (liquids.5): more would overshoot. Positive pressure only, so that surfaces are free. Behind a
//! wall the liquid goes on, at rest, so that a particle at a wall has what it has inside                       (liquids.7).
//! Source: [macklin2013]. Differs: compliance instead of a mixture of forces, masses in the weights, no tensile term; viscosity is a force.
//! Verified in `tests/liquids.rs`.

mod frozen;

pub use frozen::{Frozen, Samples};

use super::{Constraints, Projection};
use crate::geometry::{Meet, Neighbours, Vector, Walls};
use crate::math::parallel::{chunks, chunks2, fold, sum};
use crate::math::{Lane, Real, Row, xyz64};
use std::f64::consts::PI;
use std::ops::Range;

/// Share that a sweep takes back of the correction that each particle alone would need.                                   (liquids.5)
const PART: Real = 0.5;

/// How far beyond the outermost layer of particles, half a spacing off a wall, the liquid behind it begins, over s: that layer of a cubic
/// lattice misses a neighbouring one, 3/20 of its density, and `behind` of this is that.
const BEGINS: f64 = 0.5825604019819524;

/// Of what lies beyond a plane at the distance q s >= 0: the part of all W, minus its slope over q, and s² V times the integral of
/// |grad W|².                                                                                          (liquids.7)
pub fn behind(q: f64) -> [f64; 3] {
    let (a, b) = ((2.0 - q).max(0.0), (1.0 - q).max(0.0));
    let (a4, b4) = (a * a * a * a, b * b * b * b);
    let part = a4 * a * (3.0 - a) / 60.0 - b4 * b * (3.0 - 2.0 * b) / 30.0;
    let less = a4 * (5.0 - 2.0 * a) / 20.0 - b4 * (5.0 - 4.0 * b) / 10.0;
    let mixed = b4 * (1.0 / 12.0 + b * (1.0 / 20.0 - b * (1.0 / 30.0 + b / 42.0)));
    let inner = 2.0 * b4 * b * b * (1.0 / 30.0 - b / 42.0) - mixed;
    [part, less, (1.125 * a4 * a * a * (1.0 / 15.0 - a / 42.0) + 9.0 * inner) / PI]
}

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
    /// Share of walls in the density of each particle, s times its gradient, and their share in the last of the sums over others.
    against: Vec<[Real; 5]>,
    /// Multipliers so far, and what this sweep adds.
    lambda: Vec<Real>,
    delta: Vec<Real>,
    /// The solid whose walls are near each particle, `NONE` or `SEVERAL`.
    near: Vec<u32>,
    /// Impulses on every solid in this sub-step [N s].
    pushes: Vec<Vector>,
    /// Whether walls have pushed in this sub-step.
    leans: bool,
    /// Rigid bodies in it, which sweeps move as well.
    pub bodies: Vec<Frozen>,
    touches: Vec<Touch>,
}

/// A body near a particle.
#[derive(Debug, Clone, Copy)]
struct Touch {
    particle: usize,
    body: usize,
    /// Its share of the density, and s times the gradient of that.
    part: f64,
    slope: Vector,
    /// By how much it yields to a push along the slope, the square root [1/sqrt(kg)].
    size: f64,
}

/// No solid is near.
const NONE: u32 = u32::MAX;
/// More than one solid is near.
const SEVERAL: u32 = u32::MAX - 1;

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
            against: Vec::new(),
            lambda: Vec::new(),
            delta: Vec::new(),
            near: Vec::new(),
            pushes: Vec::new(),
            leans: false,
            bodies: Vec::new(),
            touches: Vec::new(),
        }
    }

    /// The distance of its particles at rest [m].
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Its rows.
    pub fn rows(&self) -> Range<usize> {
        self.rows.clone()
    }

    /// Impulses on every solid in the last sub-step, in their order [N s].                                  (liquids.8)
    pub fn pushes(&self) -> &[Vector] {
        &self.pushes
    }

    /// The pressure of a particle in the last sub-step, of length h [Pa]: -lambda/(V h²), whose multiplier counts s² times here.  (liquids.9)
    pub fn pressure(&self, particle: usize, h: f64) -> f64 {
        self.lambda.get(particle).map_or(0.0, |lambda| -f64::from(*lambda) / (self.spacing * h * h))
    }

    /// Sums over the neighbours of each, place by place.
    fn gather(&self, grid: &mut Neighbours, x: &[Row], points: &mut Vec<[Real; 4]>, sums: &mut Vec<[Real; 5]>) {
        grid.rebuild(x);
        grid.sorted(|i| x[i], points);
        grid.gather(&Sums { inverse: 1.0 / self.spacing }, points, sums);
    }

    /// Calls `f` with every solid near a particle, and `behind` and the direction away of each of its walls.
    fn walls_of(&self, x: Row, walls: Walls<'_>, mut f: impl FnMut(usize, [f64; 3], Vector)) {
        let s = self.spacing;
        // Deeper there is no more than that.
        walls.near(xyz64(x), 0.5 * s, 2.0 * s, |solid, distance, normal| f(solid, behind((distance / s + BEGINS).max(0.0)), normal));
    }

    /// Adds the share of walls. Where several are near, the liquid between them is the part that none of them takes.
    fn add_walls(&self, x: &[Row], walls: Walls<'_>, near: &mut Vec<u32>, against: &mut Vec<[Real; 5]>) {
        against.clear();
        against.resize(x.len(), [0.0; 5]);
        near.clear();
        near.resize(x.len(), NONE);
        if walls.colliders.is_empty() {
            return;
        }
        chunks2(against, near, |start, against, near| {
            for ((against, near), x) in against.iter_mut().zip(near).zip(&x[start..]) {
                let (mut free, mut slope, mut stiff) = (1.0, Vector::default(), 0.0);
                self.walls_of(*x, walls, |solid, [part, less, squares], normal| {
                    stiff += squares;
                    slope = slope * (1.0 - part) - normal * (free * less);
                    free *= 1.0 - part;
                    *near = if [NONE, solid as u32].contains(near) { solid as u32 } else { SEVERAL };
                });
                *against = [1.0 - free, slope.x, slope.y, slope.z, stiff * f64::from(x[3])].map(|c| c as Real);
            }
        });
    }

    /// Adds the share of bodies, and how they yield to all multipliers near them together: that keeps the sweep from overshooting, as all act
    /// at once.                                                                                              (liquids.11)
    fn add_bodies(&self, x: &[Row], near: &mut [u32], against: &mut [[Real; 5]]) -> Vec<Touch> {
        if self.bodies.is_empty() {
            return Vec::new();
        }
        let of = |range: Range<usize>| {
            let mut found = Vec::new();
            for particle in range {
                let at = xyz64(x[particle]);
                for (body, frozen) in self.bodies.iter().enumerate() {
                    if let Some((part, slope)) = frozen.near(at) {
                        found.push(Touch { particle, body, part, slope, size: frozen.yields(at, slope).sqrt() });
                    }
                }
            }
            found
        };
        let touches = fold(x.len(), of).concat();
        let mut sizes = vec![0.0; self.bodies.len()];
        touches.iter().for_each(|touch| sizes[touch.body] += touch.size);
        for Touch { particle, body, part, slope, size } in &touches {
            let more = [*part, slope.x, slope.y, slope.z, size * sizes[*body]];
            against[*particle].iter_mut().zip(more).for_each(|(sum, more)| *sum += more as Real);
            // What walls take of it is found without the bodies.
            let near = &mut near[*particle];
            *near = if *near == NONE { NONE } else { SEVERAL };
        }
        touches
    }

    /// Gives bodies what this sweep's multipliers push them, in a sub-step of length h [s] that began at `before`.          (liquids.11)
    fn push_bodies(&mut self, x: &[Row], before: &[Row], h: f64) {
        let Self { bodies, touches, delta, spacing, .. } = self;
        for (body, frozen) in bodies.iter_mut().enumerate() {
            let own = touches.iter().filter(|touch| touch.body == body && delta[touch.particle] != 0.0);
            let push = |touch: &Touch| {
                let [now, start] = [x, before].map(|rows| xyz64(rows[touch.particle]));
                (now, start, touch.slope * (-f64::from(delta[touch.particle]) * *spacing / h))
            };
            frozen.take(own.map(push), h);
        }
    }

    /// Adds what this sweep's multipliers push the solids, in a sub-step of length h [s].                    (liquids.8)
    fn add_pushes(&mut self, x: &[Row], walls: Walls<'_>, h: f64) {
        let count = walls.colliders.len();
        let of = |range: Range<usize>| {
            let (mut pushes, mut found) = (vec![Vector::default(); count], Vec::new());
            for i in range.filter(|i| self.near[*i] != NONE && self.delta[*i] != 0.0) {
                let delta = f64::from(self.delta[i]);
                if self.near[i] != SEVERAL {
                    let [_, x, y, z, _] = self.against[i].map(f64::from);
                    let push = &mut pushes[self.near[i] as usize];
                    *push = *push - Vector { x, y, z } * delta;
                    continue;
                }
                found.clear();
                self.walls_of(x[i], walls, |solid, [part, less, _], normal| found.push((solid, 1.0 - part, normal * less)));
                for (k, (solid, _, slope)) in found.iter().enumerate() {
                    let free = found.iter().enumerate().filter(|(other, _)| *other != k).map(|(_, (_, free, _))| free).product::<f64>();
                    pushes[*solid] = pushes[*solid] + *slope * (free * delta);
                }
            }
            pushes
        };
        let scale = self.spacing / h;
        for pushes in fold(x.len(), of) {
            self.pushes.iter_mut().zip(pushes).for_each(|(sum, push)| *sum = *sum + push * scale);
        }
    }
}

/// C of sums and of what walls add: with the particle's own share, V W(0) = 1/pi.
fn excess(sums: &[Real; 5], against: &[Real; 5]) -> Real {
    sums[0] + (1.0 / PI - 1.0) as Real + against[0]
}

impl Constraints for Density {
    fn name(&self) -> &'static str {
        "density"
    }

    fn len(&self) -> usize {
        self.rows.len()
    }

    fn connect(&self, join: &mut dyn FnMut(u32, u32)) {
        self.rows.clone().skip(1).for_each(|i| join(self.rows.start as u32, i as u32));
    }

    fn leans(&self) -> Option<usize> {
        self.leans.then_some(self.rows.start)
    }

    fn liquid(&self) -> Option<&Density> {
        Some(self)
    }

    fn immerse(&mut self, put: &mut dyn FnMut(&mut Density)) {
        put(self);
    }

    fn energy(&self, x: &[Row], walls: Walls<'_>) -> f64 {
        if self.compliance == 0.0 {
            return 0.0;
        }
        let (mut grid, mut points, mut sums) = (Neighbours::new(2.0 * self.spacing), Vec::new(), Vec::new());
        let (x, mut near, mut against) = (&x[self.rows.clone()], Vec::new(), Vec::new());
        self.gather(&mut grid, x, &mut points, &mut sums);
        self.add_walls(x, walls, &mut near, &mut against);
        let of = |i: usize| grid.place(i).map_or(0.0, |place| f64::from(excess(&sums[place], &against[i])).max(0.0));
        sum(x.len(), |range| range.map(|i| 0.5 * of(i) * of(i) / self.compliance).sum())
    }

    fn project(&mut self, x: &mut [Row], step: &Projection<'_>) {
        let rows = &mut x[self.rows.clone()];
        let mut grid = std::mem::take(&mut self.grid);
        let (mut points, mut sums) = (std::mem::take(&mut self.points), std::mem::take(&mut self.sums));
        let (mut near, mut against) = (std::mem::take(&mut self.near), std::mem::take(&mut self.against));
        self.gather(&mut grid, rows, &mut points, &mut sums);
        self.add_walls(rows, step.walls, &mut near, &mut against);
        self.leans = (step.iteration > 0 && self.leans) || against.iter().any(|a| a[0] > 0.0);
        self.touches = self.add_bodies(rows, &mut near, &mut against);
        (self.grid, self.points, self.sums, self.near, self.against) = (grid, points, sums, near, against);
        if step.iteration == 0 || self.lambda.len() != rows.len() {
            self.lambda.clear();
            self.lambda.resize(rows.len(), 0.0);
            self.pushes.clear();
            self.pushes.resize(step.walls.colliders.len(), Vector::default());
        }
        self.delta.resize(rows.len(), 0.0);
        // In units of s: weights count s² times, and so do multipliers.
        let spacing = self.spacing as Real;
        let alpha = if step.plain.is_some() { 0.0 } else { (self.compliance / (step.h * step.h)) as Real * spacing * spacing };
        let part = PART * step.plain.unwrap_or(1.0);
        let (grid, sums, lambda, own, against) = (&self.grid, &self.sums, &self.lambda, &*rows, &self.against);
        chunks(&mut self.delta, |start, delta| {
            for (k, delta) in delta.iter_mut().enumerate() {
                let i = start + k;
                *delta = 0.0;
                if let Some(place) = grid.place(i) {
                    let (s, w) = (&sums[place], &against[i]);
                    let slope = [s[1] + w[1], s[2] + w[2], s[3] + w[3]];
                    let weight = own[i][3] * (slope[0] * slope[0] + slope[1] * slope[1] + slope[2] * slope[2]) + s[4] + w[4] + alpha;
                    if weight > 0.0 {
                        // Never a pull: the multiplier stays at or below 0.
                        let next = lambda[i] - part * (excess(s, w) + alpha * lambda[i]) / weight;
                        *delta = next.min(0.0) - lambda[i];
                    }
                }
            }
        });
        for (lambda, delta) in self.lambda.iter_mut().zip(&self.delta) {
            *lambda += delta;
        }
        if self.leans {
            self.add_pushes(rows, step.walls, step.h);
        }
        if !self.touches.is_empty() {
            self.push_bodies(rows, &step.before[self.rows.clone()], step.h);
        }
        let (own, delta) = (&*rows, &self.delta);
        self.grid.sorted(|i| [own[i][0], own[i][1], own[i][2], delta[i]], &mut self.pushed);
        self.grid.gather(&Moves { inverse: 1.0 / self.spacing }, &self.pushed, &mut self.moves);
        let (grid, moves, against, delta) = (&self.grid, &self.moves, &self.against, &self.delta);
        chunks(rows, |start, rows| {
            for (k, row) in rows.iter_mut().enumerate() {
                if let Some(place) = grid.place(start + k) {
                    let (m, c, w, d) = (moves[place], row[3] * spacing, against[start + k], delta[start + k]);
                    *row = [row[0] + (m[0] + w[1] * d) * c, row[1] + (m[1] + w[2] * d) * c, row[2] + (m[2] + w[3] * d) * c, row[3]];
                }
            }
        });
    }

    fn add_grip(&self, _: &[Row], _: &mut [Real]) {}
}
