//! Newton's universal gravitation: every mass pulls every other, by the direct sum.

use crate::elements::{Batch, Block, Weights};
use crate::math::parallel::chunks;
use crate::math::simd::{Kernel, Width, count, dispatch, packs};
use crate::math::{Lane, Real, Row, Vec3, xyz64};
use rayon::prelude::*;
use std::ops::Range;
use tumble_interface::scene::Hessian;

/// f_i = sum over j of G m_i m_j d/(|d|² + s²)^(3/2),   d = x_j - x_i                   (orbits.11)
///
/// G [N m²/kg²]   s [m]: the softening length, 0 for points.
/// Degenerate: two masses in one place have no direction and no force. In single precision distances between 1e-12 m and 1e12 m
/// are told apart.
/// N(N - 1) terms: every pair is evaluated from both ends, which are exact opposites up to the order of products.
pub struct Gravitation {
    /// The rows that pull each other, and where each range starts among them.
    ranges: Vec<(Range<usize>, usize)>,
    mass: Vec<Real>,
    /// G m.
    gm: Vec<Real>,
    softening: f64,
    positions: Columns,
    /// What a product is taken with.
    directions: Columns,
    weights: Weights,
}

/// Positions or directions of the rows, as columns.
#[derive(Default)]
struct Columns([Vec<Real>; 3]);

impl Columns {
    fn fill(&mut self, ranges: &[(Range<usize>, usize)], rows: &[Row]) {
        for (c, column) in self.0.iter_mut().enumerate() {
            column.clear();
            column.extend(ranges.iter().flat_map(|(range, _)| &rows[range.clone()]).map(|row| row[c]));
        }
    }

    #[inline(always)]
    fn load<W: Width>(&self, w: W, at: usize) -> Vec3<W::L> {
        Vec3 { x: w.load(&self.0[0][at..]), y: w.load(&self.0[1][at..]), z: w.load(&self.0[2][at..]) }
    }

    fn at(&self, i: usize) -> Vec3<Real> {
        Vec3 { x: self.0[0][i], y: self.0[1][i], z: self.0[2][i] }
    }
}

/// Masses that pull, block by block: partial sums keep single precision exact enough for a million of them.
const BLOCK: usize = 1024;

impl Gravitation {
    /// Gravitation among the rows of these ranges, which do not overlap; `mass` [kg] are those of all rows.
    pub fn new(ranges: Vec<Range<usize>>, mass: &[Real], constant: f64, softening: f64) -> Self {
        let mut count = 0;
        let mass: Vec<Real> = ranges.iter().flat_map(|r| &mass[r.clone()]).copied().collect();
        let ranges = ranges
            .into_iter()
            .map(|r| {
                count += r.len();
                (r.clone(), count - r.len())
            })
            .collect();
        Self {
            ranges,
            gm: mass.iter().map(|m| (constant * f64::from(*m)) as Real).collect(),
            mass,
            softening,
            positions: Columns::default(),
            directions: Columns::default(),
            weights: Weights { stiffness: 1.0, damping: 0.0, hessian: Hessian::Definite },
        }
    }

    /// Calls `f(first of the masses, their part of out)` for those among the rows from `start` on.
    fn among<T>(&self, start: usize, out: &mut [T], mut f: impl FnMut(usize, &mut [T])) {
        for (range, first) in &self.ranges {
            let (a, b) = (range.start.max(start), range.end.min(start + out.len()));
            if a < b {
                f(first + a - range.start, &mut out[a - start..b - start]);
            }
        }
    }

    /// The 3 x 3 matrix of a pair: c (I s3 - d d^T q), the second derivative of its energy, or its part that is not negative.
    #[inline(always)]
    fn matrix<L: Lane>(&self, d: Vec3<L>) -> (L, L) {
        let r_sq = d.norm_sq();
        let inverse = r_sq.positive((r_sq + r_sq.like(self.softening * self.softening)).rsqrt(), r_sq.zero());
        let s3 = inverse * inverse * inverse;
        let q = s3 * inverse * inverse * s3.like(3.0);
        if self.weights.hessian == Hessian::Exact {
            return (s3, q);
        }
        // Along d: s3 - q r², negative outside the softening length.
        let across = r_sq.positive(s3 / r_sq, s3.zero());
        (s3, (q - across).positive(across, q))
    }
}

/// Adds the forces on some of the masses.
struct Pull<'a> {
    law: &'a Gravitation,
    first: usize,
    out: &'a mut [Row],
}

impl Kernel for Pull<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        let law = self.law;
        let [x, y, z] = &law.positions.0;
        packs!(W, w, (0..self.out.len()), |i| {
            let softening = w.splat((law.softening * law.softening) as Real);
            let here = law.positions.load(w, self.first + i);
            let zero = w.splat(0.0);
            let mut sum = Vec3 { x: zero, y: zero, z: zero };
            let sources = x.chunks(BLOCK).zip(y.chunks(BLOCK)).zip(z.chunks(BLOCK).zip(law.gm.chunks(BLOCK)));
            for ((x, y), (z, gm)) in sources {
                let mut part = Vec3 { x: zero, y: zero, z: zero };
                for ((x, y), (z, gm)) in x.iter().zip(y).zip(z.iter().zip(gm)) {
                    let d = Vec3 { x: w.splat(*x), y: w.splat(*y), z: w.splat(*z) } - here;
                    let r_sq = d.norm_sq();
                    let inverse = r_sq.positive((r_sq + softening).rsqrt(), zero);
                    part = part + d * (w.splat(*gm) * inverse * inverse * inverse);
                }
                sum = sum + part;
            }
            let [fx, fy, fz, _] = w.rows(self.out, i);
            let mass = w.load(&law.mass[self.first + i..]);
            w.scatter([fx + sum.x * mass, fy + sum.y * mass, fz + sum.z * mass, zero], self.out, i, 1);
        });
    }
}

/// The sum of gm m/sqrt(|d|² + s²) over some of the masses and all others, themselves included where s is not zero.
struct Potential<'a> {
    law: &'a Gravitation,
    positions: &'a Columns,
    range: Range<usize>,
}

impl Kernel for Potential<'_> {
    type Output = f64;
    #[allow(clippy::assign_op_pattern)] // lanes have no +=
    #[inline(always)]
    fn run<W: Width>(self, w: W) -> f64 {
        let law = self.law;
        let [x, y, z] = &self.positions.0;
        let mut total = 0.0;
        packs!(W, w, self.range, |i| {
            let softening = w.splat((law.softening * law.softening) as Real);
            let here = self.positions.load(w, i);
            let zero = w.splat(0.0);
            let mut sum = [0.0_f64; 16];
            let sources = x.chunks(BLOCK).zip(y.chunks(BLOCK)).zip(z.chunks(BLOCK).zip(law.gm.chunks(BLOCK)));
            for ((x, y), (z, gm)) in sources {
                let mut part = zero;
                for ((x, y), (z, gm)) in x.iter().zip(y).zip(z.iter().zip(gm)) {
                    let d = Vec3 { x: w.splat(*x), y: w.splat(*y), z: w.splat(*z) } - here;
                    let r_sq = d.norm_sq() + softening;
                    part = part + w.splat(*gm) * r_sq.positive(r_sq.rsqrt(), zero);
                }
                let mut each = [0.0; 16];
                w.store(part, &mut each);
                for k in 0..count(w) {
                    sum[k] += f64::from(each[k]);
                }
            }
            for k in 0..count(w) {
                total += sum[k] * f64::from(law.mass[i + k]);
            }
        });
        total
    }
}

/// Adds the product of the matrix with the directions on some of the masses.
struct Product<'a> {
    law: &'a Gravitation,
    first: usize,
    out: &'a mut [Row],
}

impl Kernel for Product<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        let law = self.law;
        packs!(W, w, (0..self.out.len()), |i| {
            let (here, along) = (law.positions.load(w, self.first + i), law.directions.load(w, self.first + i));
            let zero = w.splat(0.0);
            let mut sum = Vec3 { x: zero, y: zero, z: zero };
            for j in 0..law.gm.len() {
                let (x, u) = (law.positions.at(j), law.directions.at(j));
                let d = Vec3 { x: w.splat(x.x), y: w.splat(x.y), z: w.splat(x.z) } - here;
                let u = along - Vec3 { x: w.splat(u.x), y: w.splat(u.y), z: w.splat(u.z) };
                let (s3, q) = law.matrix(d);
                sum = sum + (u * s3 - d * (d.dot(u) * q)) * w.splat(law.gm[j]);
            }
            let [fx, fy, fz, _] = w.rows(self.out, i);
            let mass = w.load(&law.mass[self.first + i..]) * w.splat(law.weights.stiffness);
            w.scatter([fx + sum.x * mass, fy + sum.y * mass, fz + sum.z * mass, zero], self.out, i, 1);
        });
    }
}

impl Batch for Gravitation {
    fn name(&self) -> &'static str {
        "gravitation"
    }

    fn len(&self) -> usize {
        self.mass.len()
    }

    /// -1/2 the sum of G m_i m_j/sqrt(|d|² + s²): negative, zero far apart.
    fn energy(&self, x: &[Row]) -> f64 {
        let mut positions = Columns::default();
        positions.fill(&self.ranges, x);
        let pairs: f64 = tasks(self.len(), |range| dispatch(Potential { law: self, positions: &positions, range })).into_iter().sum();
        let own = ((self.softening * self.softening) as Real).rsqrt();
        let own = if self.softening > 0.0 { f64::from(own) } else { 0.0 };
        let selves: f64 = self.gm.iter().zip(&self.mass).map(|(gm, m)| f64::from(*gm) * f64::from(*m) * own).sum();
        -0.5 * (pairs - selves)
    }

    fn is_elastic(&self) -> bool {
        false
    }

    fn begin_forces(&mut self, _t: f64, x: &[Row], _v: &[Row]) {
        self.positions.fill(&self.ranges, x);
    }

    fn add_forces(&self, _x: &[Row], _v: &[Row], start: usize, force: &mut [Row]) {
        self.among(start, force, |first, out| {
            out.par_chunks_mut(TASK).enumerate().for_each(|(k, out)| dispatch(Pull { law: self, first: first + k * TASK, out }));
        });
    }

    fn linearize(&mut self, x: &[Row], weights: Weights) {
        self.positions.fill(&self.ranges, x);
        self.weights = weights;
    }

    fn begin_product(&mut self, x: &[Row], u: &[Row]) {
        self.positions.fill(&self.ranges, x);
        self.directions.fill(&self.ranges, u);
    }

    fn add_product(&self, _u: &[Row], start: usize, out: &mut [Row]) {
        self.among(start, out, |first, out| {
            out.par_chunks_mut(TASK).enumerate().for_each(|(k, out)| dispatch(Product { law: self, first: first + k * TASK, out }));
        });
    }

    fn add_diagonal(&mut self, x: &[Row], blocks: &mut [Block]) {
        self.positions.fill(&self.ranges, x);
        let law = &*self;
        chunks(blocks, |start, blocks| {
            law.among(start, blocks, |first, blocks| {
                for (k, block) in blocks.iter_mut().enumerate() {
                    let (here, mass) = (law.positions.at(first + k), law.mass[first + k] * law.weights.stiffness);
                    for j in 0..law.gm.len() {
                        let d = law.positions.at(j) - here;
                        let (s3, q) = law.matrix(d);
                        let c = mass * law.gm[j];
                        let terms =
                            [s3 - q * d.x * d.x, s3 - q * d.y * d.y, s3 - q * d.z * d.z, -q * d.x * d.y, -q * d.y * d.z, -q * d.z * d.x];
                        for a in 0..6 {
                            block[a] += c * terms[a];
                        }
                    }
                }
            });
        });
    }

    fn entries(&self, x: &[Row], sink: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        let rows: Vec<usize> = self.ranges.iter().flat_map(|(range, _)| range.clone()).collect();
        for (a, i) in rows.iter().enumerate() {
            for (b, j) in rows.iter().enumerate().filter(|(b, _)| *b != a) {
                let d = xyz64(x[*j]) - xyz64(x[*i]);
                let (s3, q) = self.matrix(d);
                let c = f64::from(self.mass[a]) * f64::from(self.gm[b]) * f64::from(self.weights.stiffness);
                let d = [d.x, d.y, d.z];
                let mut block = [[0.0; 3]; 3];
                for r in 0..3 {
                    for k in 0..3 {
                        block[r][k] = c * (if r == k { s3 } else { 0.0 } - q * d[r] * d[k]);
                    }
                }
                sink(*i, *i, block);
                sink(*i, *j, block.map(|row| row.map(|v| -v)));
            }
        }
    }

    fn project(&mut self, _x: &mut [Row], _h: f64) {}
}

/// Masses per task: a task reads all others, so that it is long however few they are.
const TASK: usize = 128;

/// `f(range)` of fixed shares of 0..n, in order.
fn tasks(n: usize, f: impl Fn(Range<usize>) -> f64 + Sync) -> Vec<f64> {
    (0..n.div_ceil(TASK)).into_par_iter().map(|k| f(k * TASK..((k + 1) * TASK).min(n))).collect()
}

#[cfg(test)]
#[allow(clippy::single_range_in_vec_init)] // ranges of rows, of which there is one
mod tests {
    use super::*;
    use crate::math::simd::{Level, dispatch_at};

    #[test]
    fn every_width_gives_the_same_bits() {
        // More than one block of sources, and no multiple of any register.
        let n = BLOCK + 77;
        let number = |i: usize, c: usize| ((i * 131 + c * 37) % 1009) as Real * 0.003 - 1.5;
        let x: Vec<Row> = (0..n).map(|i| [number(i, 1), number(i, 2), number(i, 3), 0.0]).collect();
        let u: Vec<Row> = (0..n).map(|i| [number(i, 4), number(i, 5), number(i, 6), 0.0]).collect();
        let mass: Vec<Real> = (0..n).map(|i| 1.0 + number(i, 7).abs()).collect();
        let mut law = Gravitation::new(vec![0..n], &mass, 0.3, 0.05);
        law.begin_product(&x, &u);
        let all = |level| {
            let (mut force, mut product) = (vec![[0.0; 4]; 45], vec![[0.0; 4]; 45]);
            dispatch_at(level, Pull { law: &law, first: 13, out: &mut force });
            dispatch_at(level, Product { law: &law, first: 13, out: &mut product });
            let potential = dispatch_at(level, Potential { law: &law, positions: &law.positions, range: 13..58 });
            (force, product, potential.to_bits())
        };
        let one = all(Level::Scalar);
        assert!(one.0.iter().all(|f| f[0] != 0.0) && one.1.iter().all(|f| f[1] != 0.0));
        for level in Level::available() {
            assert_eq!(all(level), one, "{level:?}");
        }
    }

    #[test]
    fn masses_in_one_place_do_not_pull_each_other() {
        for softening in [0.0, 0.1] {
            let mut law = Gravitation::new(vec![0..3], &[1.0, 2.0, 1.0], 1.0, softening);
            let x = [[1.0, 2.0, 3.0, 0.0], [1.0, 2.0, 3.0, 0.0], [1.0, 2.0, 4.0, 0.0]];
            let mut f = [[0.0; 4]; 3];
            law.begin_forces(0.0, &x, &x);
            law.add_forces(&x, &x, 0, &mut f);
            let pull = (1.0 + (softening * softening) as Real).powf(-1.5);
            assert!((f[0][2] - pull).abs() < 1e-6 && (f[1][2] - 2.0 * pull).abs() < 1e-6 && f[0][0] == 0.0, "{f:?}");
            assert!(law.energy(&x).is_finite());
        }
    }
}
