//! The direct sum: every mass pulls every other, every charge pushes every other.

use crate::elements::{Batch, Block, Weights};
use crate::math::parallel::chunks;
use crate::math::roots::{cube_unit, inverse_cube, inverse_root, root_unit};
use crate::math::simd::{Kernel, Scalar, Width, count, dispatch, packs};
use crate::math::{Lane, Real, Row, Vec3, xyz64};
use crate::state::Masses;
use rayon::prelude::*;
use std::ops::Range;
use tumble_interface::scene::Hessian;

/// What pulls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Attractor {
    /// Masses, by G [N m²/kg²].
    Mass(f64),
    /// Charges, by -k [N m²/C²]: like ones push each other.
    Charge(f64),
}

/// f_i = a_i sum over j of b_j d/(|d|² + s²)^(3/2),   d = x_j - x_i           (orbits.11, orbits.14)
///
/// Gravitation: a = m, b = G m. Electrostatics: a = q, b = -k q.   s [m]: the softening length, 0 for points.
/// Degenerate: two masses in one place have no direction and no force. In single precision distances between 1e-12 m and 1e12 m
/// are told apart.
/// N(N - 1) terms: every pair is evaluated from both ends, which are exact opposites up to the order of products. In single
/// precision a term is right to 3e-7.
///
/// The kernels take targets and sources apart, as columns: a tree would hand them the cells and masses that a group of
/// targets has to see, and nothing else would change.
pub struct DirectSum {
    attractor: Attractor,
    softening: f64,
    /// Whether fused and estimated arithmetic may be used for forces.
    native: bool,
    /// Rows of halos, which are no points.
    except: Vec<u32>,
    /// The rows that pull each other, and where each range starts among them.
    ranges: Vec<(Range<usize>, usize)>,
    /// a.
    own: Vec<Real>,
    /// b.
    source: Vec<Real>,
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

/// Softening lengths whose square is less are none: the cube of their inverse would not be finite.
const POINT: Real = if cfg!(feature = "double") { 1e-200 } else { 1e-24 };

impl DirectSum {
    /// The direct sum among the rows of these ranges, which do not overlap; halos among them (rows with radii) are left out.
    pub fn new(
        attractor: Attractor,
        softening: f64,
        native: bool,
        halos: &[(u32, f64)],
        ranges: Vec<Range<usize>>,
        masses: &Masses,
    ) -> Self {
        let mut law = Self {
            attractor,
            softening,
            native,
            except: halos.iter().map(|(row, _)| *row).collect(),
            ranges: Vec::new(),
            own: Vec::new(),
            source: Vec::new(),
            positions: Columns::default(),
            directions: Columns::default(),
            weights: Weights { stiffness: 1.0, damping: 0.0, hessian: Hessian::Definite },
        };
        law.take(ranges, masses);
        law
    }

    /// Goes over to other rows, or to other masses and charges of the same.
    fn take(&mut self, ranges: Vec<Range<usize>>, masses: &Masses) {
        let (column, constant) = match self.attractor {
            Attractor::Mass(constant) => (&masses.mass, constant),
            Attractor::Charge(constant) => (&masses.charge, constant),
        };
        self.ranges.clear();
        self.own.clear();
        for range in without(&ranges, &self.except) {
            let start = self.own.len();
            match column.get(range.clone()) {
                Some(some) => self.own.extend_from_slice(some),
                // Nothing is charged.
                None => self.own.resize(start + range.len(), 0.0),
            }
            self.ranges.push((range, start));
        }
        self.source.clear();
        self.source.extend(self.own.iter().map(|own| (constant * f64::from(*own)) as Real));
    }

    /// The square of the softening length.
    fn softening_sq(&self) -> Real {
        (self.softening * self.softening) as Real
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

    /// The 3 x 3 matrix of a pair: c (I s3 - d d^T q), c = a_i b_j, the second derivative of its energy, or its part that is
    /// not negative: across d where they pull, along it where they push.
    #[inline(always)]
    fn matrix<L: Lane>(&self, d: Vec3<L>, c: L) -> (L, L) {
        let r_sq = d.norm_sq();
        let inverse = r_sq.positive((r_sq + r_sq.like(self.softening * self.softening)).rsqrt(), r_sq.zero());
        let s3 = inverse * inverse * inverse;
        let q = s3 * inverse * inverse * s3.like(3.0);
        if self.weights.hessian == Hessian::Exact {
            return (s3, q);
        }
        // Along d: s3 - q r², negative outside the softening length.
        let across = r_sq.positive(s3 / r_sq, s3.zero());
        (c.positive(s3, s3.zero()), c.positive((q - across).positive(across, q), (q - across).above_zero()))
    }
}

/// The ranges without some rows.
fn without(ranges: &[Range<usize>], rows: &[u32]) -> Vec<Range<usize>> {
    let mut rest = Vec::new();
    for range in ranges {
        let mut from = range.start;
        for at in rows.iter().map(|row| *row as usize).filter(|row| range.contains(row)) {
            rest.push(from..at);
            from = at + 1;
        }
        rest.push(from..range.end);
    }
    rest.retain(|range| !range.is_empty());
    rest
}

/// Adds the forces on some of the masses. `POINTS`: without softening.
struct Pull<'a, const NATIVE: bool, const POINTS: bool> {
    law: &'a DirectSum,
    first: usize,
    out: &'a mut [Row],
}

impl<const NATIVE: bool, const POINTS: bool> Pull<'_, NATIVE, POINTS> {
    /// The forces on the masses of B packs from number i on. Two packs at once read each source once, and hide the time
    /// that one takes for its root.
    #[inline(always)]
    fn block<W: Width, const B: usize>(&mut self, w: W, i: usize) {
        let law = self.law;
        let [x, y, z] = &law.positions.0;
        let softening = w.splat(if POINTS { 0.0 } else { law.softening_sq() });
        let zero = w.splat(0.0);
        let nothing = Vec3 { x: zero, y: zero, z: zero };
        let unit = cube_unit::<W, NATIVE>(w);
        let per_unit = (1.0 / unit) as Real;
        let mut here = [nothing; B];
        for b in 0..B {
            here[b] = law.positions.load(w, self.first + i + b * W::N);
        }
        let mut sum = [nothing; B];
        let sources = x.chunks(BLOCK).zip(y.chunks(BLOCK)).zip(z.chunks(BLOCK).zip(law.source.chunks(BLOCK)));
        for ((x, y), (z, source)) in sources {
            let mut part = [nothing; B];
            for (j, ((x, y), (z, source))) in x.iter().zip(y).zip(z.iter().zip(source)).enumerate() {
                for b in 0..B {
                    let d = Vec3 { x: w.splat(*x) - here[b].x, y: w.splat(*y) - here[b].y, z: w.splat(*z) - here[b].z };
                    let r_sq = if NATIVE {
                        w.fused(d.x, d.x, w.fused(d.y, d.y, w.fused(d.z, d.z, softening)))
                    } else {
                        d.x * d.x + (d.y * d.y + (d.z * d.z + softening))
                    };
                    // In double precision a root and a division take as long as the steps, in another part of the machine.
                    let divide = cfg!(feature = "double") && j % 2 == 1;
                    let mut pull = if divide {
                        w.splat(*source * per_unit) / (r_sq * r_sq.sqrt())
                    } else {
                        inverse_cube::<W, NATIVE>(w, r_sq, w.splat(*source))
                    };
                    if POINTS {
                        pull = r_sq.positive(pull, zero);
                    }
                    let p = part[b];
                    part[b] = if NATIVE {
                        Vec3 { x: w.fused(d.x, pull, p.x), y: w.fused(d.y, pull, p.y), z: w.fused(d.z, pull, p.z) }
                    } else {
                        p + d * pull
                    };
                }
            }
            for b in 0..B {
                sum[b] = sum[b] + part[b];
            }
        }
        let unit = w.splat(unit as Real);
        for b in 0..B {
            let at = i + b * W::N;
            let own = w.load(&law.own[self.first + at..]) * unit;
            let [fx, fy, fz, _] = w.rows(self.out, at);
            w.scatter([fx + sum[b].x * own, fy + sum[b].y * own, fz + sum[b].z * own, zero], self.out, at, 1);
        }
    }
}

impl<const NATIVE: bool, const POINTS: bool> Kernel for Pull<'_, NATIVE, POINTS> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(mut self, w: W) {
        let (n, mut i) = (self.out.len(), 0);
        while i + 2 * W::N <= n {
            self.block::<W, 2>(w, i);
            i += 2 * W::N;
        }
        while i + W::N <= n {
            self.block::<W, 1>(w, i);
            i += W::N;
        }
        while i < n {
            self.block::<Scalar, 1>(Scalar, i);
            i += 1;
        }
    }
}

/// The sum of a_i b_j/sqrt(|d|² + s²) over i in a range and all j that are not before it: those inside once, themselves
/// included where s is not zero, those behind it twice.
struct Potential<'a> {
    law: &'a DirectSum,
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
        let n = law.source.len();
        let points = law.softening_sq() < POINT;
        let mut total = 0.0;
        packs!(W, w, self.range, |i| {
            let softening = w.splat(if points { 0.0 } else { law.softening_sq() });
            let here = self.positions.load(w, i);
            let zero = w.splat(0.0);
            let mut sum = [0.0_f64; 16];
            let mut from = self.range.start;
            while from < n {
                let (to, times) = if from < self.range.end { (self.range.end, 1.0) } else { ((from + BLOCK).min(n), 2.0) };
                let mut part = zero;
                for ((x, y), (z, source)) in x[from..to].iter().zip(&y[from..to]).zip(z[from..to].iter().zip(&law.source[from..to])) {
                    let d = Vec3 { x: w.splat(*x), y: w.splat(*y), z: w.splat(*z) } - here;
                    let r_sq = d.x * d.x + (d.y * d.y + (d.z * d.z + softening));
                    part = part + w.splat(*source) * r_sq.positive(inverse_root(w, r_sq), zero);
                }
                let mut each = [0.0; 16];
                w.store(part, &mut each);
                for k in 0..count(w) {
                    sum[k] += times * f64::from(each[k]);
                }
                from = to;
            }
            for k in 0..count(w) {
                total += sum[k] * f64::from(law.own[i + k]);
            }
        });
        total * root_unit()
    }
}

/// Adds the product of the matrix with the directions on some of the masses.
struct Product<'a> {
    law: &'a DirectSum,
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
            let (zero, own) = (w.splat(0.0), w.load(&law.own[self.first + i..]));
            let mut sum = Vec3 { x: zero, y: zero, z: zero };
            for j in 0..law.source.len() {
                let (x, u) = (law.positions.at(j), law.directions.at(j));
                let d = Vec3 { x: w.splat(x.x), y: w.splat(x.y), z: w.splat(x.z) } - here;
                let u = along - Vec3 { x: w.splat(u.x), y: w.splat(u.y), z: w.splat(u.z) };
                let c = own * w.splat(law.source[j]);
                let (s3, q) = law.matrix(d, c);
                sum = sum + (u * s3 - d * (d.dot(u) * q)) * c;
            }
            let [fx, fy, fz, _] = w.rows(self.out, i);
            let weight = w.splat(law.weights.stiffness);
            w.scatter([fx + sum.x * weight, fy + sum.y * weight, fz + sum.z * weight, zero], self.out, i, 1);
        });
    }
}

impl DirectSum {
    fn pull<const NATIVE: bool, const POINTS: bool>(&self, start: usize, force: &mut [Row]) {
        self.among(start, force, |first, out| {
            out.par_chunks_mut(TASK)
                .enumerate()
                .for_each(|(k, out)| dispatch(Pull::<NATIVE, POINTS> { law: self, first: first + k * TASK, out }));
        });
    }
}

impl Batch for DirectSum {
    fn name(&self) -> &'static str {
        match self.attractor {
            Attractor::Mass(_) => "gravitation",
            Attractor::Charge(_) => "electrostatics",
        }
    }

    fn len(&self) -> usize {
        self.own.len()
    }

    /// -1/2 the sum of a_i b_j/sqrt(|d|² + s²), zero far apart.
    fn energy(&self, x: &[Row]) -> f64 {
        let mut positions = Columns::default();
        positions.fill(&self.ranges, x);
        let pairs: f64 = tasks(self.len(), |range| dispatch(Potential { law: self, positions: &positions, range })).into_iter().sum();
        let own = if self.softening_sq() < POINT { 0.0 } else { f64::from(inverse_root(Scalar, self.softening_sq())) * root_unit() };
        let selves: f64 = self.source.iter().zip(&self.own).map(|(b, a)| f64::from(*b) * f64::from(*a) * own).sum();
        -0.5 * (pairs - selves)
    }

    fn renew(&mut self, on: Vec<Range<usize>>, _others: Option<Vec<Range<usize>>>, masses: &Masses) {
        self.take(on, masses);
    }

    fn is_elastic(&self) -> bool {
        false
    }

    fn begin_forces(&mut self, _t: f64, x: &[Row], _v: &[Row]) {
        self.positions.fill(&self.ranges, x);
    }

    fn add_forces(&self, _x: &[Row], _v: &[Row], start: usize, force: &mut [Row]) {
        match (self.native, self.softening_sq() < POINT) {
            (false, false) => self.pull::<false, false>(start, force),
            (false, true) => self.pull::<false, true>(start, force),
            (true, false) => self.pull::<true, false>(start, force),
            (true, true) => self.pull::<true, true>(start, force),
        }
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
                    let (here, own) = (law.positions.at(first + k), law.own[first + k] * law.weights.stiffness);
                    for j in 0..law.source.len() {
                        let d = law.positions.at(j) - here;
                        let c = own * law.source[j];
                        let (s3, q) = law.matrix(d, c);
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
                let c = f64::from(self.own[a]) * f64::from(self.source[b]) * f64::from(self.weights.stiffness);
                let (s3, q) = self.matrix(d, c);
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
        let masses = Masses { mass, charge: (0..n).map(|i| number(i, 8)).collect(), ..Masses::default() };
        for (attractor, softening) in [(Attractor::Mass(0.3), 0.05), (Attractor::Charge(-0.3), 0.0)] {
            let mut law = DirectSum::new(attractor, softening, false, &[], vec![0..n], &masses);
            law.begin_product(&x, &u);
            let all = |level| {
                let (mut force, mut product) = (vec![[0.0; 4]; 45], vec![[0.0; 4]; 45]);
                if softening > 0.0 {
                    dispatch_at(level, Pull::<false, false> { law: &law, first: 13, out: &mut force });
                } else {
                    dispatch_at(level, Pull::<false, true> { law: &law, first: 13, out: &mut force });
                }
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
    }

    #[test]
    fn masses_in_one_place_do_not_pull_each_other() {
        for softening in [0.0, 0.1] {
            let masses = Masses { mass: vec![1.0, 2.0, 1.0], ..Masses::default() };
            let mut law = DirectSum::new(Attractor::Mass(1.0), softening, false, &[], vec![0..3], &masses);
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
