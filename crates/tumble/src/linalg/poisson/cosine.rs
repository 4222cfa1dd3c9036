//! The direct solver of closed boxes without solids: cosines diagonalise the matrix.                       (pressure.14)
//!
//! A real cosine transform is a complex Fourier transform of even, then odd places in reverse, turned by quarter steps [makhoul1980];
//! two real lines make one complex line. Sixteen such pairs stand side by side in registers, so that the transform is written as for
//! one, and every width has the same bits. The Fourier transform sorts itself (Stockham), with radices 4, 2, 3, 5.

use super::block::{Block, LANES};
use super::faces::Weight;
use super::level::{Grid, Rows};
use crate::math::functions::{cos, exp, sin};
use crate::math::parallel::each;
use crate::math::simd::{Kernel, Level as Registers, Width, dispatch_at};
use crate::math::{Column, Lane, Lattice, Real};
use std::cell::RefCell;
use std::f64::consts::PI;

/// One axis: its length, twiddles and eigenvalues.
#[derive(Debug, Clone)]
struct Axis {
    n: usize,
    radices: Vec<usize>,
    /// Stage after stage, exp(-2 pi i p j/length) for p, then j = 1 .. radix - 1.
    twiddles: Vec<[Real; 2]>,
    /// cos and sin of pi k/2n.
    quarter: Vec<[Real; 2]>,
    /// 2 - 2 cos(pi k/n).
    eigenvalue: Vec<Real>,
}

impl Axis {
    fn new(n: usize) -> Option<Self> {
        let (mut radices, mut rest) = (Vec::new(), n);
        for radix in [4, 2, 3, 5_usize] {
            while rest.is_multiple_of(radix) {
                radices.push(radix);
                rest /= radix;
            }
        }
        if rest != 1 {
            return None;
        }
        let turn = |angle: f64| [cos(angle) as Real, sin(angle) as Real];
        let (mut twiddles, mut length) = (Vec::new(), n);
        for radix in &radices {
            for p in 0..length / radix {
                twiddles.extend((1..*radix).map(|j| turn(-2.0 * PI * (p * j) as f64 / length as f64)));
            }
            length /= radix;
        }
        let quarter = (0..n).map(|k| turn(PI * k as f64 / (2 * n) as f64)).collect();
        let eigenvalue = (0..n).map(|k| 4.0 * sin(PI * k as f64 / (2 * n) as f64).powi(2)).map(|e| e as Real).collect();
        Some(Self { n, radices, twiddles, quarter, eigenvalue })
    }

    /// Target of index i: even ones forward, odd ones backward.
    #[inline(always)]
    fn place(&self, i: usize) -> usize {
        if i.is_multiple_of(2) { i / 2 } else { self.n - 1 - i / 2 }
    }
}

/// Complex numbers of sixteen lines.
type Complex<'a> = [&'a mut [Block]; 2];

/// A box whose sides are products of 2, 3 and 5.
#[derive(Debug, Clone)]
pub(super) struct Cosine {
    axes: [Axis; 3],
}

thread_local! {
    static LINES: RefCell<Column> = const { RefCell::new(Column::new()) };
}

/// Lines of a task: sixteen in the real part, sixteen in the imaginary one.
const GROUP: usize = 2 * LANES;

impl Cosine {
    /// For a grid, or what stands in the way.
    pub fn new<T: Weight>(grid: &Grid<T>) -> Result<Self, String> {
        let Lattice { n, .. } = grid.lattice;
        if grid.extra.is_some() || grid.periodic.contains(&true) {
            return Err("it needs a box that is closed on all sides".to_string());
        }
        for axis in 0..3 {
            let wrong = |at: usize, i: usize| grid.w[axis][at] != if i == 0 || i == n[axis] { T::CLOSED } else { T::OPEN };
            let mut bad = None;
            grid.each_row(|at, [j, k]| {
                for i in 0..n[0] {
                    let cell = [i, j, k];
                    let upper = cell[axis] + 1 == n[axis] && wrong(at + i + grid.lattice.stride[axis], n[axis]);
                    if upper || wrong(at + i, cell[axis]) {
                        bad = bad.or(Some(cell));
                    }
                }
            });
            if let Some(cell) = bad {
                return Err(format!("it needs a closed box without solids, and a face of cell {cell:?} is none of such a box"));
            }
        }
        let axis =
            |a: usize| Axis::new(n[a]).ok_or(format!("the {} cells along {} are no product of 2, 3 and 5", n[a], ["x", "y", "z"][a]));
        Ok(Self { axes: [axis(0)?, axis(1)?, axis(2)?] })
    }

    /// column = A^-1 column without its mean.
    pub fn solve<T: Weight>(&self, grid: &Grid<T>, column: &mut [Real], registers: Registers) {
        self.transform(grid.lattice, column, &Scale::Inverse, registers);
    }

    /// There, each mode times its factor, and back.
    fn transform(&self, lattice: Lattice, column: &mut [Real], scale: &Scale, registers: Registers) {
        let n = lattice.n;
        let rows = Rows::of(column);
        let width = n[0].next_multiple_of(LANES);
        let pairs = width.div_ceil(GROUP);
        let group = |axis: usize, first: usize, other: usize, kind: Transform| {
            let longest = n.iter().max().copied().unwrap_or(1);
            LINES.with_borrow_mut(|scratch| {
                scratch.reserve(4 * longest * LANES);
                let scratch = scratch.as_chunks_mut().0;
                dispatch_at(registers, Lines { cosine: self, lattice, width, rows: &rows, axis, first, other, kind, scale, scratch });
            });
        };
        each(n[2], &|k| {
            each(n[1].div_ceil(GROUP), &|g| group(0, g * GROUP, k, Transform::Forward));
            each(pairs, &|g| group(1, g * GROUP, k, Transform::Forward));
        });
        each(n[1], &|j| {
            each(pairs, &|g| group(2, g * GROUP, j, Transform::Both));
        });
        each(n[2], &|k| {
            each(pairs, &|g| group(1, g * GROUP, k, Transform::Back));
            each(n[1].div_ceil(GROUP), &|g| group(0, g * GROUP, k, Transform::Back));
        });
    }
}

/// Factors on the modes.
#[derive(Debug, Clone)]
enum Scale {
    /// One over the eigenvalue; 0 for the mean.
    Inverse,
    /// One factor for each axis.
    Factors([Vec<Real>; 3]),
    /// With z = `length` and f, g = 1 - f for each axis: (1 - f_x f_y f_z)/e of the mode's e = e_x + e_y + e_z, and z for e = 0.
    Gains {
        /// The factors f of each axis.
        factors: [Vec<Real>; 3],
        /// 1 - f.
        losses: [Vec<Real>; 3],
        /// e of each axis.
        squares: [Vec<Real>; 3],
        /// z.
        length: Real,
    },
}

/// Cosine series in a closed box: diffusion for any time, exactly.                                             (heat.9)
#[derive(Debug, Clone)]
pub struct Series {
    cosine: Cosine,
    lattice: Lattice,
    decay: Scale,
    gain: Scale,
}

impl Series {
    /// For steps of z = kappa h/dx² [1], or the axis whose count of cells is no product of 2, 3 and 5.
    pub fn new(lattice: Lattice, z: f64) -> Result<Self, usize> {
        let mut axes = Vec::new();
        for a in 0..3 {
            axes.push(Axis::new(lattice.n[a]).ok_or(a)?);
        }
        let [x, y, w] = <[Axis; 3]>::try_from(axes).map_err(|_| 0_usize)?;
        let of = |f: &dyn Fn(f64) -> f64| -> [Vec<Real>; 3] {
            std::array::from_fn(|a| (0..lattice.n[a]).map(|k| f((PI * k as f64 / lattice.n[a] as f64).powi(2)) as Real).collect())
        };
        let factors = of(&|e| exp(-z * e));
        let gain = Scale::Gains { factors: factors.clone(), losses: of(&|e| loss(z * e)), squares: of(&|e| e), length: z as Real };
        Ok(Self { cosine: Cosine { axes: [x, y, w] }, lattice, decay: Scale::Factors(factors), gain })
    }

    /// A column after the step.
    pub fn decay(&self, column: &mut [Real]) {
        self.cosine.transform(self.lattice, column, &self.decay, Registers::Avx512);
    }

    /// From a source that stays the same during the step to what it has added at the end, in units of dx²/kappa.
    pub fn gain(&self, column: &mut [Real]) {
        self.cosine.transform(self.lattice, column, &self.gain, Registers::Avx512);
    }
}

/// 1 - exp(-x), to all digits.
fn loss(x: f64) -> f64 {
    if x < 1e-3 { x * (1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0)))) } else { 1.0 - exp(-x) }
}

/// Operation along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Transform {
    Forward,
    Back,
    /// There, division by the eigenvalues, and back.
    Both,
}

/// A group of lines: along x, rows from `first` on in plane `other`; along y or z, places from `first` on in plane or row `other`.
struct Lines<'a> {
    cosine: &'a Cosine,
    lattice: Lattice,
    width: usize,
    rows: &'a Rows<'a>,
    axis: usize,
    first: usize,
    other: usize,
    kind: Transform,
    scale: &'a Scale,
    scratch: &'a mut [Block],
}

impl Kernel for Lines<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(mut self, w: W) {
        let axis = &self.cosine.axes[self.axis];
        let n = axis.n;
        let scratch = std::mem::take(&mut self.scratch);
        let (re, rest) = scratch[..4 * n].split_at_mut(n);
        let (im, rest) = rest.split_at_mut(n);
        let (a, b) = rest.split_at_mut(n);
        // Going there the lines are sorted as they are read, coming back as they are written.
        let sorted = self.kind != Transform::Back;
        self.read(axis, [re, im], sorted);
        if sorted {
            let inside = fourier(w, axis, [re, im], [a, b]);
            if inside {
                cosines(w, axis, [a, b], [re, im]);
            } else {
                cosines(w, axis, [re, im], [a, b]);
            }
            let (to, free) = if inside { ([re, im], [a, b]) } else { ([a, b], [re, im]) };
            if self.kind == Transform::Forward {
                return self.write(axis, to, false);
            }
            let [to_re, to_im] = to;
            self.divide(w, axis, [to_re, to_im]);
            return self.back(w, axis, [to_re, to_im], free);
        }
        self.back(w, axis, [re, im], [a, b]);
    }
}

impl Lines<'_> {
    /// From cosines to lines.
    #[inline(always)]
    fn back<W: Width>(&self, w: W, axis: &Axis, from: Complex, free: Complex) {
        let ([fr, fi], [tr, ti]) = (from, free);
        exponentials(w, axis, [fr, fi], [tr, ti]);
        // The inverse is the transform with both parts exchanged.
        let inside = fourier(w, axis, [ti, tr], [fi, fr]);
        self.write(axis, if inside { [fr, fi] } else { [tr, ti] }, true);
    }

    #[inline(always)]
    fn read(&self, axis: &Axis, [re, im]: Complex, sorted: bool) {
        let place = |i: usize| if sorted { axis.place(i) } else { i };
        if self.axis == 0 {
            for (part, out) in [(0, re), (1, im)] {
                for lane in 0..LANES {
                    let j = self.first + part * LANES + lane;
                    if j < self.lattice.n[1] {
                        // SAFETY: rows of this group alone.
                        let row = unsafe { self.rows.take(self.lattice.at(0, j, self.other), axis.n) };
                        for i in 0..axis.n {
                            out[place(i)][lane] = row[i];
                        }
                    } else {
                        for i in 0..axis.n {
                            out[i][lane] = 0.0;
                        }
                    }
                }
            }
            return;
        }
        let both = self.first + LANES < self.width;
        for i in 0..axis.n {
            let at = self.start(i);
            // SAFETY: places of this group alone.
            let row = unsafe { self.rows.take(at, if both { GROUP } else { LANES }) };
            re[place(i)].copy_from_slice(&row[..LANES]);
            if both {
                im[place(i)].copy_from_slice(&row[LANES..]);
            } else {
                im[place(i)] = [0.0; LANES];
            }
        }
    }

    #[inline(always)]
    fn write(&self, axis: &Axis, [re, im]: Complex, sorted: bool) {
        let place = |i: usize| if sorted { axis.place(i) } else { i };
        if self.axis == 0 {
            for (part, from) in [(0, re), (1, im)] {
                for lane in 0..LANES {
                    let j = self.first + part * LANES + lane;
                    if j < self.lattice.n[1] {
                        // SAFETY: rows of this group alone.
                        let row = unsafe { self.rows.take(self.lattice.at(0, j, self.other), axis.n) };
                        for i in 0..axis.n {
                            row[i] = from[place(i)][lane];
                        }
                    }
                }
            }
            return;
        }
        let both = self.first + LANES < self.width;
        for i in 0..axis.n {
            let at = self.start(i);
            // SAFETY: places of this group alone.
            let row = unsafe { self.rows.take(at, if both { GROUP } else { LANES }) };
            row[..LANES].copy_from_slice(&re[place(i)]);
            if both {
                row[LANES..].copy_from_slice(&im[place(i)]);
            }
        }
    }

    #[inline(always)]
    fn start(&self, i: usize) -> usize {
        if self.axis == 1 { self.lattice.at(self.first, i, self.other) } else { self.lattice.at(self.first, self.other, i) }
    }

    /// Multiplies each mode as `scale` says, and divides by the lengths of the three axes, which the way back multiplies with.
    #[inline(always)]
    fn divide<W: Width>(&self, w: W, axis: &Axis, [re, im]: Complex) {
        let [x, y, _] = &self.cosine.axes;
        let scale = w.splat((self.lattice.cells() as f64).recip() as Real);
        match self.scale {
            Scale::Inverse => {}
            Scale::Factors(factors) => {
                return self.multiply(w, [re, im], &mut |i, k| factors[0][i] * (factors[1][self.other] * factors[2][k]));
            }
            Scale::Gains { factors: [fx, fy, _], losses: [gx, gy, gz], squares: [ex, ey, ez], length } => {
                let j = self.other;
                return self.multiply(w, [re, im], &mut |i, k| {
                    let (lost, e) = (gx[i] + fx[i] * (gy[j] + fy[j] * gz[k]), ex[i] + (ey[j] + ez[k]));
                    if e > 0.0 { lost / e } else { *length }
                });
            }
        }
        for (part, numbers) in [(0, re), (1, im)] {
            let mut of_x = [1.0; LANES];
            for lane in 0..LANES {
                if let Some(eigenvalue) = x.eigenvalue.get(self.first + part * LANES + lane) {
                    of_x[lane] = *eigenvalue;
                }
            }
            for k in 0..axis.n {
                let of_yz = w.splat(y.eigenvalue[self.other] + axis.eigenvalue[k]);
                for p in 0..LANES / W::N {
                    let i = p * W::N;
                    let e = w.load(&of_x[i..]) + of_yz;
                    let v = w.load(&numbers[k][i..]);
                    w.store(e.positive(scale * v / e, v.zero()), &mut numbers[k][i..]);
                }
            }
        }
    }
}

impl Lines<'_> {
    /// Multiplies mode (i, other, k) by a factor, and divides by the lengths of the axes.
    #[inline(always)]
    fn multiply<W: Width>(&self, w: W, [re, im]: Complex, factor: &mut impl FnMut(usize, usize) -> Real) {
        let scale = (self.lattice.cells() as f64).recip() as Real;
        for (part, numbers) in [(0, re), (1, im)] {
            for k in 0..numbers.len() {
                let mut factors = [0.0; LANES];
                for lane in 0..LANES {
                    let i = self.first + part * LANES + lane;
                    if i < self.lattice.n[0] {
                        factors[lane] = scale * factor(i, k);
                    }
                }
                for p in 0..LANES / W::N {
                    let i = p * W::N;
                    w.store(w.load(&factors[i..]) * w.load(&numbers[k][i..]), &mut numbers[k][i..]);
                }
            }
        }
    }
}

/// The Fourier transform of `a`, with `b` as scratch; whether the result is in `b`.
#[inline(always)]
fn fourier<W: Width>(w: W, axis: &Axis, a: Complex, b: Complex) -> bool {
    let ([mut ar, mut ai], [mut br, mut bi]) = (a, b);
    let (mut length, mut stride, mut twiddles, mut inside) = (axis.n, 1, &axis.twiddles[..], false);
    for radix in &axis.radices {
        let groups = length / radix;
        let (these, rest) = twiddles.split_at(groups * (radix - 1));
        match radix {
            2 => stage::<W, 2>(w, these, groups, stride, [ar, ai], [br, bi]),
            3 => stage::<W, 3>(w, these, groups, stride, [ar, ai], [br, bi]),
            4 => stage::<W, 4>(w, these, groups, stride, [ar, ai], [br, bi]),
            _ => stage::<W, 5>(w, these, groups, stride, [ar, ai], [br, bi]),
        }
        (ar, ai, br, bi) = (br, bi, ar, ai);
        (length, stride, twiddles, inside) = (groups, stride * radix, rest, !inside);
    }
    inside
}

/// One stage of radix R: y[q + s (R p + j)] = w_p^j sum over k of x[q + s (p + m k)] e^(-2 pi i j k/R).
#[inline(always)]
fn stage<W: Width, const R: usize>(w: W, twiddles: &[[Real; 2]], m: usize, s: usize, [xr, xi]: Complex, [yr, yi]: Complex) {
    for p in 0..m {
        let twiddles = &twiddles[p * (R - 1)..(p + 1) * (R - 1)];
        for q in 0..s {
            for part in 0..LANES / W::N {
                let i = part * W::N;
                let mut z = [[w.splat(0.0); 2]; R];
                for k in 0..R {
                    let at = q + s * (p + m * k);
                    z[k] = [w.load(&xr[at][i..]), w.load(&xi[at][i..])];
                }
                let z = butterfly::<W, R>(w, z);
                for j in 0..R {
                    let at = q + s * (R * p + j);
                    let mut out = z[j];
                    if j > 0 {
                        let [c, d] = twiddles[j - 1];
                        let (c, d) = (w.splat(c), w.splat(d));
                        out = [out[0] * c - out[1] * d, out[0] * d + out[1] * c];
                    }
                    w.store(out[0], &mut yr[at][i..]);
                    w.store(out[1], &mut yi[at][i..]);
                }
            }
        }
    }
}

#[inline(always)]
fn plus<L: Lane>(a: [L; 2], b: [L; 2]) -> [L; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

#[inline(always)]
fn minus<L: Lane>(a: [L; 2], b: [L; 2]) -> [L; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// -i a.
#[inline(always)]
fn turned<L: Lane>(a: [L; 2]) -> [L; 2] {
    [a[1], -a[0]]
}

#[inline(always)]
fn times<L: Lane>(c: L, a: [L; 2]) -> [L; 2] {
    [c * a[0], c * a[1]]
}

/// The transform of R numbers.
#[inline(always)]
fn butterfly<W: Width, const R: usize>(w: W, z: [[W::L; 2]; R]) -> [[W::L; 2]; R] {
    let mut out = z;
    if R == 2 {
        out[0] = plus(z[0], z[1]);
        out[1] = minus(z[0], z[1]);
    } else if R == 3 {
        let sum = plus(z[1], z[2]);
        let side = times(w.splat((3.0_f64.sqrt() / 2.0) as Real), turned(minus(z[1], z[2])));
        let middle = minus(z[0], times(w.splat(0.5), sum));
        out[0] = plus(z[0], sum);
        out[1] = plus(middle, side);
        out[2] = minus(middle, side);
    } else if R == 4 {
        let (even, odd) = (plus(z[0], z[2]), plus(z[1], z[3]));
        let (low, side) = (minus(z[0], z[2]), turned(minus(z[1], z[3])));
        out[0] = plus(even, odd);
        out[1] = plus(low, side);
        out[2] = minus(even, odd);
        out[3] = minus(low, side);
    } else {
        let root = 5.0_f64.sqrt();
        let (c1, c2) = (w.splat(((root - 1.0) / 4.0) as Real), w.splat((-(root + 1.0) / 4.0) as Real));
        let (s1, s2) = (w.splat(((10.0 + 2.0 * root).sqrt() / 4.0) as Real), w.splat(((10.0 - 2.0 * root).sqrt() / 4.0) as Real));
        let (a, b) = (plus(z[1], z[4]), plus(z[2], z[3]));
        let (c, d) = (turned(minus(z[1], z[4])), turned(minus(z[2], z[3])));
        let one = plus(z[0], plus(times(c1, a), times(c2, b)));
        let two = plus(z[0], plus(times(c2, a), times(c1, b)));
        let (u, v) = (plus(times(s1, c), times(s2, d)), minus(times(s2, c), times(s1, d)));
        out[0] = plus(z[0], plus(a, b));
        out[1] = plus(one, u);
        out[2] = plus(two, v);
        out[3] = minus(two, v);
        out[4] = minus(one, u);
    }
    out
}

/// Cosine coefficients of both lines from the Fourier coefficients of their sum, the second times i.
#[inline(always)]
fn cosines<W: Width>(w: W, axis: &Axis, [zr, zi]: Complex, [xr, xi]: Complex) {
    let n = axis.n;
    let half = w.splat(0.5);
    for k in 0..n {
        let (c, s) = (w.splat(axis.quarter[k][0]), w.splat(axis.quarter[k][1]));
        let other = if k == 0 { 0 } else { n - k };
        for part in 0..LANES / W::N {
            let i = part * W::N;
            let (zr_k, zi_k) = (w.load(&zr[k][i..]), w.load(&zi[k][i..]));
            let (yr, yi) = (w.load(&zr[other][i..]), w.load(&zi[other][i..]));
            w.store(half * (c * (zr_k + yr) + s * (zi_k - yi)), &mut xr[k][i..]);
            w.store(half * (c * (zi_k + yi) + s * (yr - zr_k)), &mut xi[k][i..]);
        }
    }
}

/// The way back.
#[inline(always)]
fn exponentials<W: Width>(w: W, axis: &Axis, [xr, xi]: Complex, [zr, zi]: Complex) {
    let n = axis.n;
    for k in 0..n {
        let (c, s) = (w.splat(axis.quarter[k][0]), w.splat(axis.quarter[k][1]));
        for part in 0..LANES / W::N {
            let i = part * W::N;
            let (one, two) = (w.load(&xr[k][i..]), w.load(&xi[k][i..]));
            let zero = w.splat(0.0);
            let (one_n, two_n) = if k == 0 { (zero, zero) } else { (w.load(&xr[n - k][i..]), w.load(&xi[n - k][i..])) };
            let (u1, v1) = (c * one + s * one_n, s * one - c * one_n);
            let (u2, v2) = (c * two + s * two_n, s * two - c * two_n);
            w.store(u1 - v2, &mut zr[k][i..]);
            w.store(v1 + u2, &mut zi[k][i..]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::simd::Scalar;

    #[test]
    fn every_radix_is_the_sum_of_its_definition() {
        for n in [1, 2, 3, 4, 5, 6, 8, 12, 15, 30, 60] {
            let axis = Axis::new(n).unwrap();
            let number = |i: usize, c: usize| ((7 * i + 3 * c) % 11) as f64 - 4.3;
            let blocks = |c: usize| (0..n).map(|i| [number(i, c) as Real; LANES]).collect::<Vec<_>>();
            let (mut re, mut im, mut a, mut b) = (blocks(0), blocks(1), blocks(0), blocks(0));
            let inside = fourier(Scalar, &axis, [&mut re, &mut im], [&mut a, &mut b]);
            let (re, im) = if inside { (a, b) } else { (re, im) };
            for k in 0..n {
                let (mut x, mut y) = (0.0, 0.0);
                for i in 0..n {
                    let angle = -2.0 * PI * (i * k) as f64 / n as f64;
                    x += number(i, 0) * angle.cos() - number(i, 1) * angle.sin();
                    y += number(i, 0) * angle.sin() + number(i, 1) * angle.cos();
                }
                let far = (x - f64::from(re[k][5])).abs().max((y - f64::from(im[k][5])).abs());
                // Measured 2e-5 in single precision, 5e-13 in double (whose sum of the definition is no better), for sums up to 280.
                assert!(far < 8e3 * f64::from(Real::EPSILON), "{n} {k} {far:e}");
            }
        }
        assert!(Axis::new(14).is_none());
    }
}
