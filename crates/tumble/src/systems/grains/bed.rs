//! Grains and their motion.

use super::clumps::{Clumps, Moved};
use super::kick::{Kick, QUICK, narrow};
use super::law::{BALL, Pair};
use super::list::{Four, Kept, List, Part, point};
use super::press::Rows;
use super::walls::{Touched, Walls, add};
use crate::geometry::Vector;
use crate::math::parallel::{CHUNK, Tasks, fold};
use crate::math::{Real, Row};

/// A grain as the books see it.
pub struct Body {
    /// Mass [kg], and its centre [m].
    pub mass: f64,
    pub center: Vector,
    /// Momentum [N s], and angular momentum about the origin [N m s].
    pub momenta: [Vector; 2],
    /// Kinetic energy [J].
    pub kinetic: f64,
}

/// Grains in the order of their cells.
#[derive(Debug, Default)]
pub struct Bed {
    /// Places and radii [m].
    pub x: Vec<Four>,
    /// Velocities [m/s], and 1/mass [1/kg].
    pub v: Vec<Four>,
    /// Angular velocities [rad/s], and kinds.
    pub w: Vec<Four>,
    /// The grain of each row.
    pub grain: Vec<u32>,
    /// Forces [N] and torques [N m] of contacts, by the last pass.
    pub force: Vec<Four>,
    pub torque: Vec<Four>,
    /// By positions: how far contacts shift each, times its mass [kg m], and how many it has.
    pub shift: Vec<Four>,
    pub counts: Vec<u32>,
    /// Velocities and 1/mass, angular velocities and radii, and what both gain until the time of the next forces, in the engine's scalar, grain by
    /// grain; and half of what the last forces gave both.
    pub quick: Vec<Row>,
    pub last: Vec<[Row; 2]>,
    /// Grains that are spheres of clumps.
    pub clumps: Clumps,
    /// The pair of each kind with each.
    pub pairs: Vec<Pair>,
    pub kinds: usize,
    pub list: List,
    /// How far any grain or surface may have gone since candidates were sought [m].
    pub travel: f64,
}

impl Bed {
    /// Whether contacts remember turns.
    fn turns(&self) -> bool {
        self.pairs.iter().any(Pair::resists_turns)
    }

    /// Puts rows into the order of their cells and seeks candidates: at the start of each interval, so that the order of sums does not depend on
    /// when candidates run out.
    pub fn sort(&mut self, walls: &mut Walls, t: f64) {
        let order = self.list.order(&self.x);
        if order.len() < self.x.len() {
            // What is not finite is told after the interval.
            return self.rebuild(walls, t, None);
        }
        for rows in [&mut self.x, &mut self.v, &mut self.w] {
            *rows = order.iter().map(|row| rows[*row as usize]).collect();
        }
        self.grain = order.iter().map(|row| self.grain[*row as usize]).collect();
        self.clumps.sort(&self.grain);
        self.rebuild(walls, t, Some(&order));
    }

    /// Whether grains have more candidates than so many on average, clumps that for each of their spheres.
    pub fn is_crushed(&mut self, most: usize) -> bool {
        let spheres = self.clumps.all.iter().map(|clump| clump.spheres.len()).max().unwrap_or(1);
        self.list.exceeds(&self.x, most * spheres * self.x.len())
    }

    /// Seeks candidates anew; rows may have come from others.
    fn rebuild(&mut self, walls: &mut Walls, t: f64, from: Option<&[u32]>) {
        let same: Vec<u32> = (0..self.x.len() as u32).collect();
        let from = from.unwrap_or(&same);
        let mut to = vec![0; self.x.len()];
        from.iter().enumerate().for_each(|(row, old)| to[*old as usize] = row as u32);
        self.list.rebuild(&self.x, from, self.turns(), |a, b| self.clumps.joins(a, b));
        // Both may go that far.
        walls.rebuild(&self.x, self.list.chunk, t, 2.0 * self.list.slack, &to);
        self.travel = 0.0;
        self.force.resize(self.x.len(), [0.0; 4]);
        self.torque.resize(self.x.len(), [0.0; 4]);
    }

    /// Forces of all contacts at a time; what contacts remember goes on by h [s].
    pub fn press(&mut self, walls: &mut Walls, t: f64, h: f64) {
        let mut parts = std::mem::take(&mut self.list.parts);
        let Self { x, v, w, force, torque, quick, pairs, kinds, .. } = self;
        quick.resize(QUICK * x.len(), [0.0; 4]);
        quick.chunks_mut(QUICK * CHUNK).enumerate().in_parallel(|(c, quick)| {
            let start = c * CHUNK;
            let rows = x[start..].iter().zip(&v[start..]).zip(&w[start..]);
            for (quick, ((x, v), w)) in quick.chunks_exact_mut(QUICK).zip(rows) {
                quick[0] = v.map(|c| c as Real);
                quick[1] = [w[0] as Real, w[1] as Real, w[2] as Real, x[3] as Real];
                if h == 0.0 {
                    quick[2..].fill([0.0; 4]);
                }
            }
        });
        let rows = Rows { x, w, quick, pairs, kinds: *kinds, h };
        let chunk = self.list.chunk;
        parts.iter_mut().zip(force.chunks_mut(chunk)).zip(torque.chunks_mut(chunk)).enumerate().in_parallel(
            |(c, ((part, force), torque))| {
                rows.press(part, c * chunk, force, torque);
            },
        );
        self.list.parts = parts;
        let Self { x, v, w, force, torque, quick, .. } = self;
        walls.press(Touched { x, v, w, quick, force, torque, chunk }, t, h);
    }

    /// Velocities change by forces and gravity.
    pub fn kick(&mut self, gravity: Vector, kick: Kick) {
        let Self { x, v, w, force, torque, quick, last, clumps, .. } = self;
        let (x, force, torque) = (&*x, &*force, &*torque);
        last.resize(x.len(), [[0.0; 4]; 2]);
        let quick = quick.chunks_mut(QUICK * CHUNK).zip(last.chunks_mut(CHUNK));
        v.chunks_mut(CHUNK).zip(w.chunks_mut(CHUNK)).zip(quick).enumerate().in_parallel(|(c, ((v, w), (quick, last)))| {
            for (k, ((v, w), (quick, last))) in v.iter_mut().zip(w).zip(quick.chunks_exact_mut(QUICK).zip(last)).enumerate() {
                let i = c * CHUNK + k;
                let changes = [gravity + point(&force[i]) * v[3], point(&torque[i]) * (v[3] / (BALL * x[i][3] * x[i][3]))];
                add(v, changes[0] * kick.h);
                add(w, changes[1] * kick.h);
                for k in 0..2 {
                    let [gain, half] = kick.gain(changes[k], point(&last[k].map(f64::from)));
                    (quick[2 + k], last[k]) = (narrow(gain), narrow(half));
                }
            }
        });
        clumps.kick(x, [force, torque], gravity, kick);
    }

    fn moved(&mut self) -> (&mut Clumps, Moved<'_>) {
        let Self { x, v, w, quick, grain, clumps, .. } = self;
        (clumps, Moved { x, v, w, quick, grain })
    }

    /// Gives spheres of clumps the velocities that these have at the end of an interval.
    pub fn settle(&mut self) {
        let (clumps, rows) = self.moved();
        clumps.settle(rows);
    }

    /// Grains move for h [s].
    pub fn drift(&mut self, walls: &mut Walls, t: f64, h: f64) {
        let (clumps, rows) = self.moved();
        clumps.drift(rows, h);
        let v = &self.v;
        let parts: Vec<(f64, f64)> = self.x.chunks_mut(CHUNK).enumerate().map_in_parallel(|(c, x)| {
            let (mut fastest, mut farthest) = (0.0_f64, 0.0_f64);
            for (x, v) in x.iter_mut().zip(&v[c * CHUNK..]) {
                let v = point(v);
                add(x, v * h);
                fastest = fastest.max(v.norm_sq());
                farthest = farthest.max(point(x).norm_sq());
            }
            (fastest, farthest)
        });
        let [fastest, farthest] = [|p: &(f64, f64)| p.0, |p: &(f64, f64)| p.1].map(|of| parts.iter().map(of).fold(0.0, f64::max).sqrt());
        self.went(walls, t + h, h * fastest.max(walls.fastest(t, h, farthest)), self.list.slack);
    }

    /// Seeks candidates anew where any grain or surface may have gone farther than `most` since; none went farther than `way` in the last step [m].
    pub fn went(&mut self, walls: &mut Walls, t: f64, way: f64, most: f64) {
        self.travel += way;
        if self.travel > most {
            self.rebuild(walls, t, None);
        }
    }

    /// Takes contacts over.
    pub fn remember(&mut self, contacts: &[([u32; 2], Kept)]) {
        let same: Vec<u32> = (0..self.x.len() as u32).collect();
        self.list.remember(self.x.len(), contacts, self.turns());
        self.clumps.sort(&self.grain);
        self.list.rebuild(&self.x, &same, self.turns(), |a, b| self.clumps.joins(a, b));
    }

    /// Moves candidates that overlap, and those in solids, apart: how many did, and how deep the deepest was [m].
    pub fn part(&mut self, walls: &Walls) -> (usize, f64) {
        let (mut count, mut deepest) = (0, 0.0_f64);
        for [a, b] in self.list.parts.iter().flat_map(|part| &part.own.rows).map(|pair| pair.map(|row| row as usize)) {
            let (x, y) = (point(&self.x[a]), point(&self.x[b]));
            let way = y - x;
            let depth = self.x[a][3] + self.x[b][3] - way.norm();
            if depth > 0.0 {
                let normal = if way.norm() > 0.0 { way.normalized() } else { Vector { x: 0.0, y: 0.0, z: 1.0 } };
                let share = self.v[a][3] / (self.v[a][3] + self.v[b][3]);
                self.clumps.shift(&mut self.x, a, normal * (-depth * share));
                self.clumps.shift(&mut self.x, b, normal * (depth * (1.0 - share)));
                (count, deepest) = (count + 1, deepest.max(depth));
            }
        }
        for row in 0..self.x.len() {
            for surface in 0..walls.solids() {
                let (p, radius, mut shift) = (point(&self.x[row]), self.x[row][3], Vector::default());
                walls.each_near(surface, p, 0.0, (radius, true), |distance, normal| {
                    let depth = radius - distance - shift.dot(normal);
                    if depth > 0.0 {
                        (shift, count, deepest) = (shift + normal * depth, count + 1, deepest.max(depth));
                    }
                });
                self.clumps.shift(&mut self.x, row, shift);
            }
        }
        self.clumps.follow(&self.x);
        (count, deepest)
    }

    /// Elastic energy of contacts [J] and the deepest overlap [m], with its rows.
    pub fn stored(&self) -> (f64, Option<(f64, [u32; 2])>, u64) {
        let of = |part: &Part| {
            let (mut energy, mut deepest, mut count) = (0.0, None::<(f64, [u32; 2])>, 0);
            for (k, pair) in part.own.rows.iter().enumerate() {
                let [a, b] = pair.map(|i| i as usize);
                let radii = [self.x[a][3], self.x[b][3]];
                let depth = radii[0] + radii[1] - (point(&self.x[b]) - point(&self.x[a])).norm();
                if depth <= 0.0 {
                    continue;
                }
                let memory = part.own.memory(k);
                energy += self.pairs[self.w[a][3] as usize * self.kinds + self.w[b][3] as usize].energy(depth, radii, &memory);
                count += 1;
                if deepest.is_none_or(|(most, _)| depth > most) {
                    deepest = Some((depth, *pair));
                }
            }
            (energy, deepest, count)
        };
        let larger = |a: Option<(f64, [u32; 2])>, b: Option<(f64, [u32; 2])>| if b.map(|b| b.0) > a.map(|a| a.0) { b } else { a };
        self.list.parts.iter().map_in_parallel(of).into_iter().fold((0.0, None, 0), |a, b| (a.0 + b.0, larger(a.1, b.1), a.2 + b.2))
    }

    /// What moves as a row says; of a clump its first sphere stands for all.
    pub fn body(&self, row: usize) -> Option<Body> {
        if let Some(clump) = self.clumps.at(row) {
            let first = clump.spheres.start == self.grain[row];
            let body = || Body { mass: clump.mass, center: clump.x, momenta: clump.momenta(), kinetic: clump.kinetic() };
            return first.then(body);
        }
        let (mass, center, radius) = (1.0 / self.v[row][3], point(&self.x[row]), self.x[row][3]);
        let (v, w, inertia) = (point(&self.v[row]), point(&self.w[row]), BALL * mass * radius * radius);
        let momenta = [v * mass, center.cross(v * mass) + w * inertia];
        Some(Body { mass, center, momenta, kinetic: 0.5 * (mass * v.norm_sq() + inertia * w.norm_sq()) })
    }

    /// Mass of a row [kg]: of a clump the same part for each of its spheres.
    pub fn mass(&self, row: usize) -> f64 {
        self.clumps.at(row).map_or(1.0 / self.v[row][3], |clump| clump.mass / clump.spheres.len() as f64)
    }

    /// The first row that is not finite.
    pub fn lost(&self) -> Option<(usize, &'static str)> {
        let finite = |row: &Four| row[..3].iter().all(|c| (*c as Real).is_finite());
        let first = |range: std::ops::Range<usize>| {
            range.into_iter().find(|i| !(finite(&self.x[*i]) && finite(&self.v[*i]) && finite(&self.w[*i])))
        };
        let row = fold(self.x.len(), first).into_iter().flatten().next()?;
        let column = [("position", &self.x), ("velocity", &self.v)].into_iter().find(|(_, rows)| !finite(&rows[row]));
        Some((row, column.map_or("angular_velocity", |(name, _)| name)))
    }
}
