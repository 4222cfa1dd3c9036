//! The direct sum: every mass pulls every other, every charge pushes every other.

use crate::elements::{Batch, Block, Weights};
use crate::math::parallel::{self, Tasks, chunks};
use crate::math::roots::{cube_unit, first_guess, inverse_cube, inverse_root, root_unit};
use crate::math::simd::{Kernel, Width, count, dispatch, packs};
use crate::math::{Lane, Real, Row, Vec3, xyz64};
use crate::state::Masses;
use std::ops::Range;
use tumble_interface::scene::Hessian;

/// The source of attraction.
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
/// Degenerate: two masses in one place have no direction and no force. In single precision equal masses pull each other at
/// distances between 1e-12 m and 1e12 m; of masses that differ by a factor of 1e12, the largest from 3e-9 m on and the smallest up to
/// 4e8 m.
/// N(N - 1)/2 pairs: each is evaluated once, and what it gives to its ends are exact opposites. In single precision a term is
/// right to 3e-7.
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
    /// a in units of `scale`, so that products of two are far from the ends of the range of numbers.
    weight: Vec<Real>,
    scale: f64,
    /// Forces on the masses; scratch of their sums.
    forces: Vec<[Real; 3]>,
    sums: Vec<Real>,
    positions: Columns,
    /// Directions of the product.
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

/// Masses that pull, block by block: partial sums keep single precision exact enough for a million of them, and a block with its
/// sums, 28 KB, stays in the first cache.
const BLOCK: usize = if cfg!(feature = "double") { 512 } else { 1024 };
/// Strips that masses are cut into at most: enough to share out, few enough for what each pair of them sums up.
const STRIPS: usize = 32;

/// Softening lengths whose square is less are none: the cube of their inverse would not be finite.
const POINT: Real = if cfg!(feature = "double") { 1e-200 } else { 1e-24 };

/// Weights at most, where they differ by more than its square.
const LARGEST: f64 = 1e6;

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
            weight: Vec::new(),
            scale: 1.0,
            forces: Vec::new(),
            sums: Vec::new(),
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
            Attractor::Mass(_) => (&masses.mass, self.constant()),
            Attractor::Charge(_) => (&masses.charge, self.constant()),
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
        let sizes = || self.own.iter().map(|own| f64::from(own.abs())).filter(|own| *own > 0.0);
        let (least, largest) = (sizes().fold(f64::INFINITY, f64::min), sizes().fold(0.0, f64::max));
        self.scale = if largest > 0.0 { (least * largest).sqrt().max(largest / LARGEST) } else { 1.0 };
        self.weight.clear();
        self.weight.extend(self.own.iter().map(|own| (f64::from(*own) / self.scale) as Real));
    }

    /// b/a.
    fn constant(&self) -> f64 {
        match self.attractor {
            Attractor::Mass(constant) | Attractor::Charge(constant) => constant,
        }
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

/// |d|² + s².
#[inline(always)]
fn squared<W: Width, const NATIVE: bool>(w: W, d: Vec3<W::L>, softening: W::L) -> W::L {
    if NATIVE {
        w.fused(d.x, d.x, w.fused(d.y, d.y, w.fused(d.z, d.z, softening)))
    } else {
        d.x * d.x + (d.y * d.y + (d.z * d.z + softening))
    }
}

/// Sources that meet a pack at once: their roots hide each other's delays.
const AT_ONCE: usize = 2;
/// Lanes that a sum over masses has, whatever the width of the registers.
const LANES: usize = if cfg!(feature = "double") { 8 } else { 16 };
/// Ones, then zeros: the mask of the first lanes of a pack.
const STAIRS: [Real; 2 * LANES] = {
    let mut stairs = [0.0; 2 * LANES];
    let mut i = 0;
    while i < LANES {
        stairs[i] = 1.0;
        i += 1;
    }
    stairs
};

/// Some masses side by side, and the sums over what pulls them; no register of them lies on two lines of the cache.
#[derive(Clone, Copy, Default)]
#[repr(align(64))]
struct Pack {
    x: [[Real; LANES]; 3],
    weight: [Real; LANES],
    sum: [[Real; LANES]; 3],
}

/// The sum of the lanes, halves upon halves.
#[inline(always)]
fn total(mut lanes: [Real; LANES]) -> Real {
    let mut half = LANES / 2;
    while half > 0 {
        for i in 0..half {
            lanes[i] += lanes[i + half];
        }
        half /= 2;
    }
    lanes[0]
}

/// The pulls of every mass of a strip on every mass of another, or on those behind it in the same: each pair is evaluated
/// once, and pulls both. `POINTS`: without softening.
struct Tile<'a, const NATIVE: bool, const POINTS: bool> {
    law: &'a DirectSum,
    /// The strips: the same, or one behind the other.
    strips: [Range<usize>; 2],
    /// Forces in units of the weights: three columns for the masses of each strip.
    out: [[&'a mut [Real]; 3]; 2],
}

/// Sources at hand, and the sums over what pulls them, lane by lane.
struct Sources<L, const B: usize> {
    x: [Vec3<L>; B],
    weight: [L; B],
    sum: [[Vec3<L>; LANES]; B],
}

/// Meetings of a part of a pack with B sources, begun: their squared distances, and where their roots start from.
#[derive(Clone, Copy)]
struct Begun<L, const B: usize> {
    r_sq: [L; B],
    guess: [L; B],
    both: [L; B],
}

impl<const NATIVE: bool, const POINTS: bool> Tile<'_, NATIVE, POINTS> {
    /// Which of the sources at once meet the packs by a root and a division, a bit for each: in double precision without estimates
    /// these take as long as two steps of `inverse_cube`, in another part of the machine, and keep it busy.
    const ROOTS: usize = if cfg!(feature = "double") && !NATIVE { 0b10 } else { 0 };

    #[inline(always)]
    fn way<W: Width>(w: W, source: Vec3<W::L>, pack: &Pack, k: usize) -> Vec3<W::L> {
        let load = |lanes: &[Real; LANES]| w.load(&lanes[k * W::N..]);
        source - Vec3 { x: load(&pack.x[0]), y: load(&pack.x[1]), z: load(&pack.x[2]) }
    }

    /// B sources come near part k of a pack.
    #[inline(always)]
    fn begin<W: Width, const B: usize>(w: W, sources: &Sources<W::L, B>, pack: &Pack, k: usize, softening: W::L) -> Begun<W::L, B> {
        let weight = w.load(&pack.weight[k * W::N..]);
        let mut begun = Begun { r_sq: [softening; B], guess: [softening; B], both: [softening; B] };
        for b in 0..B {
            begun.r_sq[b] = squared::<_, NATIVE>(w, Self::way(w, sources.x[b], pack, k), softening);
            begun.both[b] = sources.weight[b] * weight;
            begun.guess[b] = if Self::ROOTS >> b & 1 == 1 { begun.r_sq[b].sqrt() } else { first_guess::<W, NATIVE>(w, begun.r_sq[b]) };
        }
        begun
    }

    /// They pull it, and it them. The ways are found anew, which costs less than to keep them.
    #[inline(always)]
    fn finish<W: Width, const B: usize>(w: W, sources: &mut Sources<W::L, B>, pack: &mut Pack, k: usize, begun: Begun<W::L, B>) {
        let load = |lanes: &[Real; LANES]| w.load(&lanes[k * W::N..]);
        let mut sum = Vec3 { x: load(&pack.sum[0]), y: load(&pack.sum[1]), z: load(&pack.sum[2]) };
        for b in 0..B {
            let (r_sq, guess, both) = (begun.r_sq[b], begun.guess[b], begun.both[b]);
            let mut pull = if Self::ROOTS >> b & 1 == 1 {
                let unit = w.splat((1.0 / cube_unit::<W, NATIVE>(w)) as Real);
                both * (unit / (r_sq * guess))
            } else {
                inverse_cube::<W, NATIVE>(w, r_sq, guess, both)
            };
            if POINTS {
                pull = r_sq.positive(pull, w.splat(0.0));
            }
            // Additions are free beside multiplications, which other parts of the machine do.
            let force = Self::way(w, sources.x[b], pack, k) * pull;
            sum = sum + force;
            sources.sum[b][k] = sources.sum[b][k] + force;
        }
        w.store(sum.x, &mut pack.sum[0][k * W::N..]);
        w.store(sum.y, &mut pack.sum[1][k * W::N..]);
        w.store(sum.z, &mut pack.sum[2][k * W::N..]);
    }

    /// The sources from number j on meet all of the first `packs` packs, and where they are among the near masses themselves
    /// those before them in the next one.
    #[inline(always)]
    fn sources<W: Width, const B: usize>(&mut self, w: W, near: &mut [Pack; BLOCK / LANES], j: usize, packs: usize, among: bool) {
        let law = self.law;
        let zero = w.splat(0.0);
        let nothing = Vec3 { x: zero, y: zero, z: zero };
        let softening = w.splat(if POINTS { 0.0 } else { law.softening_sq() });
        let mut sources = Sources { x: [nothing; B], weight: [zero; B], sum: [[nothing; LANES]; B] };
        for b in 0..B {
            let x = law.positions.at(j + b);
            sources.x[b] = Vec3 { x: w.splat(x.x), y: w.splat(x.y), z: w.splat(x.z) };
            sources.weight[b] = w.splat(law.weight[j + b]);
        }
        // Each part is begun before the one ahead of it is finished: what has to wait for roots then waits beside other work.
        let (parts, last) = (LANES / W::N, if among { packs } else { packs - 1 });
        let mut begun = Self::begin(w, &sources, &near[0], 0, softening);
        for i in 0..last {
            for k in 0..parts {
                let (pack, part) = if k + 1 < parts { (i, k + 1) } else { (i + 1, 0) };
                let next = Self::begin(w, &sources, &near[pack], part, softening);
                Self::finish(w, &mut sources, &mut near[i], k, begun);
                begun = next;
            }
        }
        for k in 0..parts {
            if k > 0 {
                begun = Self::begin(w, &sources, &near[last], k, softening);
            }
            if among {
                for b in 0..B {
                    let lanes = (j + b - self.strips[1].start) % BLOCK - last * LANES;
                    begun.both[b] = begun.both[b] * w.load(&STAIRS[LANES - lanes + k * W::N..]);
                }
            }
            Self::finish(w, &mut sources, &mut near[last], k, begun);
        }
        for b in 0..B {
            for c in 0..3 {
                let mut lanes = [0.0; LANES];
                for k in 0..LANES / W::N {
                    let sum = sources.sum[b][k];
                    w.store([sum.x, sum.y, sum.z][c], &mut lanes[k * W::N..]);
                }
                self.out[1][c][j + b - self.strips[1].start] -= total(lanes);
            }
        }
    }
}

impl<const NATIVE: bool, const POINTS: bool> Kernel for Tile<'_, NATIVE, POINTS> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(mut self, w: W) {
        let law = self.law;
        let mut near = [Pack::default(); BLOCK / LANES];
        let same = self.strips[0] == self.strips[1];
        let mut first = self.strips[0].start;
        while first < self.strips[0].end {
            let n = BLOCK.min(self.strips[0].end - first);
            let packs = n.div_ceil(LANES);
            for i in 0..packs * LANES {
                let (pack, lane) = (&mut near[i / LANES], i % LANES);
                let here = if i < n { law.positions.at(first + i) } else { Vec3::default() };
                (pack.x[0][lane], pack.x[1][lane], pack.x[2][lane]) = (here.x, here.y, here.z);
                pack.weight[lane] = if i < n { law.weight[first + i] } else { 0.0 };
            }
            let mut from = if same { first } else { self.strips[1].start };
            while from < self.strips[1].end {
                let m = BLOCK.min(self.strips[1].end - from);
                let among = same && from == first;
                near.iter_mut().for_each(|pack| pack.sum = [[0.0; LANES]; 3]);
                let mut j = 0;
                while j < m {
                    let packs = if among { j / LANES } else { packs };
                    if j + AT_ONCE <= m {
                        self.sources::<W, AT_ONCE>(w, &mut near, from + j, packs, among);
                        j += AT_ONCE;
                    } else {
                        self.sources::<W, 1>(w, &mut near, from + j, packs, among);
                        j += 1;
                    }
                }
                for c in 0..3 {
                    for i in 0..n {
                        self.out[0][c][first - self.strips[0].start + i] += near[i / LANES].sum[c][i % LANES];
                    }
                }
                from += m;
            }
            first += n;
        }
    }
}

/// The sum of a_i b_j/sqrt(|d|² + s²) over i in a range and all j that are not before it: those inside once, themselves
/// included where s is not zero, those behind it twice.
struct Potential<'a, const NATIVE: bool, const POINTS: bool> {
    law: &'a DirectSum,
    positions: &'a Columns,
    range: Range<usize>,
}

impl<const NATIVE: bool, const POINTS: bool> Kernel for Potential<'_, NATIVE, POINTS> {
    type Output = f64;
    #[allow(clippy::assign_op_pattern)] // lanes have no +=
    #[inline(always)]
    fn run<W: Width>(self, w: W) -> f64 {
        let law = self.law;
        let [x, y, z] = &self.positions.0;
        let n = law.source.len();
        let mut total = 0.0;
        packs!(W, w, self.range, |i| {
            let softening = w.splat(if POINTS { 0.0 } else { law.softening_sq() });
            let here = self.positions.load(w, i);
            let zero = w.splat(0.0);
            let mut sum = [0.0_f64; 16];
            let mut from = self.range.start;
            while from < n {
                let (to, times) = if from < self.range.end { (self.range.end, 1.0) } else { ((from + BLOCK).min(n), 2.0) };
                let mut part = zero;
                for ((x, y), (z, source)) in x[from..to].iter().zip(&y[from..to]).zip(z[from..to].iter().zip(&law.source[from..to])) {
                    let d = Vec3 { x: w.splat(*x), y: w.splat(*y), z: w.splat(*z) } - here;
                    let r_sq = squared::<_, NATIVE>(w, d, softening);
                    let mut inverse = inverse_root::<_, NATIVE>(w, r_sq);
                    if POINTS {
                        inverse = r_sq.positive(inverse, zero);
                    }
                    part = part + w.splat(*source) * inverse;
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
        total * root_unit::<W, NATIVE>(w)
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

/// Adds the blocks on the diagonal of some of the masses.
struct Diagonal<'a> {
    law: &'a DirectSum,
    first: usize,
    blocks: &'a mut [Block],
}

impl Kernel for Diagonal<'_> {
    type Output = ();
    #[allow(clippy::assign_op_pattern)] // lanes have no +=
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        let law = self.law;
        packs!(W, w, (0..self.blocks.len()), |i| {
            let here = law.positions.load(w, self.first + i);
            let own = w.load(&law.own[self.first + i..]) * w.splat(law.weights.stiffness);
            let mut sums = [w.splat(0.0); 6];
            for j in 0..law.source.len() {
                let x = law.positions.at(j);
                let d = Vec3 { x: w.splat(x.x), y: w.splat(x.y), z: w.splat(x.z) } - here;
                let c = own * w.splat(law.source[j]);
                let (s3, q) = law.matrix(d, c);
                let terms =
                    [s3 - q * d.x * d.x, s3 - q * d.y * d.y, s3 - q * d.z * d.z, -(q * d.x * d.y), -(q * d.y * d.z), -(q * d.z * d.x)];
                for a in 0..6 {
                    sums[a] = sums[a] + c * terms[a];
                }
            }
            let mut lanes = [0.0; 16];
            for a in 0..6 {
                w.store(sums[a], &mut lanes);
                for k in 0..count(w) {
                    self.blocks[i + k][a] += lanes[k];
                }
            }
        });
    }
}

impl DirectSum {
    fn potential<const NATIVE: bool, const POINTS: bool>(&self, positions: &Columns) -> f64 {
        tasks(self.len(), |range| dispatch(Potential::<NATIVE, POINTS> { law: self, positions, range })).into_iter().sum()
    }

    /// Finds all forces. The masses are cut into strips; each pair of strips sums for itself, and then the sums are added in their
    /// order.
    fn pull<const NATIVE: bool, const POINTS: bool>(&mut self) {
        let n = self.own.len();
        let size = n.div_ceil(STRIPS).next_multiple_of(BLOCK).min(n.next_multiple_of(LANES)).max(1);
        let count = n.div_ceil(size);
        let pairs: Vec<(usize, usize)> = (0..count).flat_map(|a| (a..count).map(move |b| (a, b))).collect();
        let mut sums = std::mem::take(&mut self.sums);
        sums.clear();
        sums.resize(pairs.len() * 6 * size, 0.0);
        let mut forces = std::mem::take(&mut self.forces);
        forces.resize(n, [0.0; 3]);
        let law = &*self;
        let strip = |k: usize| k * size..((k + 1) * size).min(n);
        sums.chunks_mut(6 * size).zip(&pairs).in_parallel(|(out, (a, b))| {
            let mut columns = out.chunks_exact_mut(size);
            let mut three = || std::array::from_fn(|_| columns.next().unwrap_or(&mut []));
            let out = [three(), three()];
            dispatch(Tile::<NATIVE, POINTS> { law, strips: [strip(*a), strip(*b)], out });
        });
        let unit = law.constant() * law.scale * law.scale * dispatch(Unit::<NATIVE>);
        chunks(&mut forces, |start, forces| {
            forces.fill([0.0; 3]);
            for (sums, (a, b)) in sums.chunks_exact(6 * size).zip(&pairs) {
                for (half, k) in [a, b].into_iter().enumerate() {
                    let rows = strip(*k);
                    let (from, to) = (rows.start.max(start), rows.end.min(start + forces.len()));
                    for c in 0..3 {
                        let column = &sums[(3 * half + c) * size..];
                        for i in from..to {
                            forces[i - start][c] += column[i - rows.start];
                        }
                    }
                }
            }
            for f in forces.as_flattened_mut() {
                *f = (f64::from(*f) * unit) as Real;
            }
        });
        (self.sums, self.forces) = (sums, forces);
    }
}

/// Factor on the sums of [`Tile`].
struct Unit<const NATIVE: bool>;

impl<const NATIVE: bool> Kernel for Unit<NATIVE> {
    type Output = f64;
    #[inline(always)]
    fn run<W: Width>(self, w: W) -> f64 {
        cube_unit::<W, NATIVE>(w)
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
        let pairs: f64 = match (self.native, self.softening_sq() < POINT) {
            (false, false) => self.potential::<false, false>(&positions),
            (false, true) => self.potential::<false, true>(&positions),
            (true, false) => self.potential::<true, false>(&positions),
            (true, true) => self.potential::<true, true>(&positions),
        };
        let own = if self.softening_sq() < POINT { 0.0 } else { 1.0 / f64::from(self.softening_sq()).sqrt() };
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
        match (self.native, self.softening_sq() < POINT) {
            (false, false) => self.pull::<false, false>(),
            (false, true) => self.pull::<false, true>(),
            (true, false) => self.pull::<true, false>(),
            (true, true) => self.pull::<true, true>(),
        }
    }

    fn add_forces(&self, _x: &[Row], _v: &[Row], start: usize, force: &mut [Row]) {
        self.among(start, force, |first, out| {
            for (out, [x, y, z]) in out.iter_mut().zip(&self.forces[first..]) {
                *out = [out[0] + x, out[1] + y, out[2] + z, 0.0];
            }
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
            out.chunks_mut(TASK).enumerate().in_parallel(|(k, out)| dispatch(Product { law: self, first: first + k * TASK, out }));
        });
    }

    fn add_diagonal(&mut self, x: &[Row], blocks: &mut [Block]) {
        self.positions.fill(&self.ranges, x);
        let law = &*self;
        chunks(blocks, |start, blocks| {
            law.among(start, blocks, |first, blocks| {
                blocks.chunks_mut(TASK).enumerate().in_parallel(|(k, blocks)| dispatch(Diagonal { law, first: first + k * TASK, blocks }));
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
}

/// Masses per task: a task reads all others, so that it is long however few they are.
const TASK: usize = 128;

/// `f(range)` of fixed shares of 0..n, in order.
fn tasks(n: usize, f: impl Fn(Range<usize>) -> f64 + Sync) -> Vec<f64> {
    parallel::map(n.div_ceil(TASK), |k| f(k * TASK..((k + 1) * TASK).min(n)))
}

#[cfg(test)]
#[allow(clippy::single_range_in_vec_init)] // ranges of rows, of which there is one
mod tests;
