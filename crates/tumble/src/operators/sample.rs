//! Fields between their points: linear, cubic and monotone cubic, in the plane and in space (grids.12 to 14).
//!
//! A position is a point of the grid and a displacement in cells. The whole part of the displacement picks the cell, its fraction
//! the weights: no number depends on where the cell is, so that a shift by whole cells changes no bit. Positions outside of the
//! box are moved to its wall, or wrapped; what is not a number goes to the lower wall. Tests: crates/tumble-f64/tests/operators.rs.

use super::stencil::{ghosted, reach};
use crate::math::parallel::Tasks;
use crate::math::simd::{Kernel, Scalar, Width, ask, dispatch};
use crate::math::{Lane, Real};
use crate::state::{Field, Grid, GridError, Side};
use std::borrow::Cow;

/// How values between points are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Interpolation {
    /// Bilinear or trilinear.                                     (grids.12)
    #[default]
    Linear,
    /// Through four points along each axis.                       (grids.13)
    Cubic,
    /// The same without new extrema.                              (grids.14)
    MonotoneCubic,
}

/// Points that are worked on at once; a multiple of every width.
pub(super) const SEGMENT: usize = 128;

/// A number for each point of a segment.
pub(super) type Lot<T> = [T; SEGMENT];

/// Displacements beyond this many cells are cut, so that all whole numbers are exact.
const FAR: f64 = 1_048_576.0;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Axis {
    /// Range of positions, counted from the first point in cells.
    low: Real,
    high: Real,
    /// The last point that has a next one.
    last: Real,
    /// Points of a period, or 0.
    period: Real,
    /// From one point to the next in `data`.
    stride: i32,
    /// The first point from the lowest corner, in cells.
    offset: f64,
}

/// A field ready to be read between its points.
pub(super) struct View<'a> {
    data: Cow<'a, [Real]>,
    /// Point (0, 0, 0) in `data`.
    first: i32,
    axes: [Axis; 3],
    there: [bool; 3],
    how: Interpolation,
}

impl<'a> View<'a> {
    /// Whether the same spots serve for both.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        self.first == other.first && self.axes == other.axes && self.there == other.there
    }

    /// Reads the field in place if it needs nothing from beyond its walls, else a copy with ghosts.
    pub fn new(f: &'a Field, how: Interpolation) -> Self {
        let (grid, points, l) = (f.grid, f.points(), f.grid.lattice());
        let there = std::array::from_fn(|a| grid.flat != Some(a));
        let simple = |a: usize| {
            let closed = grid.on_walls(f.place, a) || f.sides[a] == [Side::Closed; 2];
            !there[a] || (!grid.periodic[a] && closed && points[a] > 1)
        };
        let in_place = how == Interpolation::Linear && (0..3).all(simple);
        let axis = |a: usize, stride: usize| {
            let (n, offset) = (grid.n[a] as Real, grid.offset(f.place)[a]);
            let wide = if in_place { 0.0 } else { offset as Real };
            let (high, last) = match (grid.periodic[a], offset == 0.0) {
                (true, _) => (n, n - 1.0),
                (false, true) => (n, n - 1.0),
                (false, false) => (n - 1.0 + wide, if in_place { n - 2.0 } else { n - 1.0 }),
            };
            let period = if grid.periodic[a] { n } else { 0.0 };
            Axis { low: -wide, high, last, period, stride: stride as i32, offset }
        };
        if in_place {
            let axes = std::array::from_fn(|a| axis(a, l.stride[a]));
            return Self { data: Cow::Borrowed(&f.data[..l.len()]), first: l.at(0, 0, 0) as i32, axes, there, how };
        }
        let pad = if how == Interpolation::Linear { 1 } else { 2 };
        let (data, first, strides) = padded(f, points, there, pad);
        Self { data: Cow::Owned(data), first, axes: std::array::from_fn(|a| axis(a, strides[a])), there, how }
    }
}

/// A copy with `pad` ghosts on each side of the axes that are there; where its first point is, and its strides.
fn padded(f: &Field, points: [usize; 3], there: [bool; 3], pad: usize) -> (Vec<Real>, i32, [usize; 3]) {
    let pads = there.map(|t| if t { pad } else { 0 });
    let n: [usize; 3] = std::array::from_fn(|a| points[a] + 2 * pads[a]);
    let strides = [1, n[0], n[0] * n[1]];
    // Four numbers are read at once where the row has fewer.
    let mut data = vec![0.0; strides[2] * n[2] + 4];
    let body = n[0] * n[1] * n[2];
    data[..body].chunks_mut(strides[2]).enumerate().in_parallel(|(k, plane)| {
        let k = k as isize - pads[2] as isize;
        for (j, row) in plane.chunks_mut(n[0]).enumerate() {
            let j = j as isize - pads[1] as isize;
            let (y, z) = (reach(f, 1, j), reach(f, 2, k));
            let start = f.index([0, y.from, z.from]);
            let from = &f.data[start..start + points[0]];
            let to = &mut row[pads[0]..pads[0] + points[0]];
            match (y.ghost, z.ghost) {
                (None, None) => to.copy_from_slice(from),
                _ => {
                    for i in 0..points[0] {
                        to[i] = [y, z].iter().filter_map(|r| r.ghost).fold(from[i], |c, (a, b)| a + b * c);
                    }
                }
            }
            for i in (0..pads[0]).chain(pads[0] + points[0]..n[0]) {
                row[i] = ghosted(f, [i as isize - pads[0] as isize, j, k]);
            }
        }
    });
    let first = pads[0] * strides[0] + pads[1] * strides[1] + pads[2] * strides[2];
    (data, first as i32, strides)
}

/// Start of a run of points on the grid: point (i, j, k) of a location, with its offsets.
#[derive(Clone, Copy)]
pub(super) struct Start {
    /// The first point.
    pub(super) at: [usize; 3],
    /// Offsets of its place, in cells.
    pub offset: [f64; 3],
}

/// Which numbers to read and their weights.
pub(super) struct Spots {
    /// The lower corner of the cell of each.
    pub(super) index: Lot<i32>,
    t: [Lot<Real>; 3],
}

impl Spots {
    /// None yet.
    pub fn new() -> Self {
        Self { index: [0; SEGMENT], t: [[0.0; SEGMENT]; 3] }
    }
}

/// 0, 1, 2, ...
pub(super) const COUNT: [Real; 16] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];

#[inline(always)]
fn least<L: Lane>(a: L, b: L) -> L {
    (a - b).positive(b, a)
}

#[inline(always)]
fn most<L: Lane>(a: L, b: L) -> L {
    (a - b).positive(a, b)
}

/// Between bounds; what is not a number becomes the lower one.
#[inline(always)]
fn between<L: Lane>(x: L, low: L, high: L) -> L {
    let x = (x - low).positive(x, low);
    (high - x).positive(x, high)
}

struct Locate<'a, 'b> {
    view: &'a View<'b>,
    start: Start,
    d: &'a [Lot<Real>; 3],
    count: usize,
    spots: &'a mut Spots,
}

impl Kernel for Locate<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        let Self { view, start, d, count, spots } = self;
        let far = w.splat(FAR as Real);
        let mut e = 0;
        while e < count {
            let mut index = [view.first; 16];
            for a in 0..3 {
                if !view.there[a] {
                    continue;
                }
                let axis = &view.axes[a];
                let shift = w.splat((start.offset[a] - axis.offset) as Real);
                let i = if a == 0 {
                    w.load(&COUNT[e % 16..]) + w.splat((start.at[0] + e / 16 * 16) as Real)
                } else {
                    w.splat(start.at[a] as Real)
                };
                let s = w.load(&d[a][e..]) + shift;
                let (t, cell);
                if axis.period > 0.0 {
                    let (period, inverse) = (w.splat(axis.period), w.splat(1.0 / axis.period));
                    let s = between(s, -far, far);
                    let floor = w.floor(s);
                    t = s - floor;
                    let b = floor + i;
                    // The quotient may be one too small where it is whole; b is too small for it to be one too large.
                    let b = b - w.floor(b * inverse) * period;
                    cell = (period - b).positive(b, b - period);
                } else {
                    let (low, high, last) = (w.splat(axis.low), w.splat(axis.high), w.splat(axis.last));
                    let s = between(s, low - i, high - i);
                    let floor = least(w.floor(s), last - i);
                    t = s - floor;
                    cell = most(floor + i, low - w.splat(0.5));
                }
                w.store(t, &mut spots.t[a][e..]);
                let mut whole = [0; 16];
                w.whole(cell, &mut whole);
                for l in 0..W::N {
                    index[l] += whole[l] * axis.stride;
                }
            }
            spots.index[e..e + W::N].copy_from_slice(&index[..W::N]);
            e += W::N;
        }
    }
}

/// Finds the cells of points displaced by d [cells] from consecutive points.
#[inline]
pub(super) fn locate(view: &View, start: Start, d: &[Lot<Real>; 3], count: usize, spots: &mut Spots) {
    dispatch(Locate { view, start, d, count, spots });
}

/// One position on an axis: its point and the fraction of the way to the next one, as found by `Locate`.
fn spot(axis: &Axis, i: Real, shift: Real) -> (Real, Real) {
    if axis.period > 0.0 {
        let cell = shift.floor() + i;
        return (cell - (cell / axis.period).floor() * axis.period, shift - shift.floor());
    }
    let s = shift.max(axis.low - i).min(axis.high - i);
    let floor = s.floor().min(axis.last - i);
    (floor + i, s - floor)
}

struct Still<'a, 'b> {
    view: &'a View<'b>,
    /// The number of the lower corner of the first point's cell.
    index: usize,
    t: [Real; 3],
    out: &'a mut [Real],
}

impl Still<'_, '_> {
    /// Whole packs; the last one may take numbers of the one before it once more. Fewer numbers than a pack one by one.
    #[inline(always)]
    fn packs<const X: bool, const Y: bool, const Z: bool, W: Width>(self, w: W) {
        let Self { view, index, t, out } = self;
        let (sy, sz) = (view.axes[1].stride as usize, view.axes[2].stride as usize);
        let (ny, nz) = (1 + usize::from(Y), 1 + usize::from(Z));
        let [tx, ty, tz] = [w.splat(t[0]), w.splat(t[1]), w.splat(t[2])];
        let ahead = AHEAD as usize * sy;
        let n = out.len();
        let last = (ny - 1) * sy + (nz - 1) * sz + usize::from(X);
        let data = &view.data[index..index + n + last];
        let mut e = 0;
        while e < n {
            e = e.min(n - W::N);
            let mut planes = [w.splat(0.0); 2];
            for z in 0..nz {
                let mut rows = [w.splat(0.0); 2];
                for y in 0..ny {
                    let at = e + y * sy + z * sz;
                    ask(view.data.get(index + at + ahead..index + at + ahead + 1).unwrap_or(&[]));
                    let a = w.load(&data[at..]);
                    rows[y] = if X { line(a, w.load(&data[at + 1..]), tx) } else { a };
                }
                planes[z] = if Y { line(rows[0], rows[1], ty) } else { rows[0] };
            }
            w.store(if Z { line(planes[0], planes[1], tz) } else { planes[0] }, &mut out[e..]);
            e += W::N;
        }
    }
}

impl Kernel for Still<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        // Weights of 0 need no second number.
        let with = |a: usize| self.view.there[a] && self.t[a] != 0.0;
        match [with(0), with(1), with(2)] {
            [true, true, true] => self.packs::<true, true, true, W>(w),
            [true, true, false] => self.packs::<true, true, false, W>(w),
            [true, false, true] => self.packs::<true, false, true, W>(w),
            [true, false, false] => self.packs::<true, false, false, W>(w),
            [false, true, true] => self.packs::<false, true, true, W>(w),
            [false, true, false] => self.packs::<false, true, false, W>(w),
            [false, false, true] => self.packs::<false, false, true, W>(w),
            [false, false, false] => self.packs::<false, false, false, W>(w),
        }
    }
}

/// The values, linear, at consecutive points themselves: all weights are 0 or a half, and rows are read as they lie.
pub(super) fn read_still(view: &View, start: Start, count: usize, out: &mut Lot<Real>) {
    let shift: [Real; 3] = std::array::from_fn(|a| (start.offset[a] - view.axes[a].offset) as Real);
    let x = view.axes[0];
    let (mut index, mut t) = (view.first as isize, [0.0; 3]);
    for a in (1..3).filter(|a| view.there[*a]) {
        let (cell, weight) = spot(&view.axes[a], start.at[a] as Real, shift[a]);
        index += cell as isize * view.axes[a].stride as isize;
        t[a] = weight;
    }
    let rows = index;
    // The points whose weight along x is the same: not those that a wall moves.
    let (mut from, mut to) = (0, count);
    if view.there[0] {
        let i = start.at[0] as Real;
        let below = shift[0].floor();
        t[0] = shift[0] - below;
        index += i as isize + below as isize;
        if x.period == 0.0 {
            while from < to && i + from as Real + shift[0] < x.low {
                from += 1;
            }
            while to > from && (i + (to - 1) as Real + shift[0] > x.high || i + (to - 1) as Real + below > x.last) {
                to -= 1;
            }
        }
    }
    for e in (0..from).chain(to..count) {
        let (cell, weight) = spot(&x, (start.at[0] + e) as Real, shift[0]);
        let (index, t) = ((rows + cell as isize) as usize, [weight, t[1], t[2]]);
        Still { view, index, t, out: &mut out[e..=e] }.run(Scalar);
    }
    if to > from {
        let (index, out) = ((index + from as isize) as usize, &mut out[from..to]);
        if out.len() < 16 {
            Still { view, index, t, out }.run(Scalar);
        } else {
            dispatch(Still { view, index, t, out });
        }
    }
}

struct Read<'a, 'b> {
    view: &'a View<'b>,
    spots: &'a Spots,
    count: usize,
    out: &'a mut Lot<Real>,
}

#[inline(always)]
fn line<L: Lane>(a: L, b: L, t: L) -> L {
    a + t * (b - a)
}

/// (grids.13), or (grids.14) where `monotone` is 1 and not 0.
#[inline(always)]
fn curve<L: Lane>(p: [L; 4], t: L, monotone: L) -> L {
    let d = p[2] - p[1];
    let half = t.like(0.5);
    let (s0, s1) = ((p[2] - p[0]) * half, (p[3] - p[1]) * half);
    let steep = d * d.like(3.0);
    let (low, high) = (least(steep, d.zero()), most(steep, d.zero()));
    let s0 = monotone.positive(between(s0, low, high), s0);
    let s1 = monotone.positive(between(s1, low, high), s1);
    let value = p[1] + t * (s0 + t * ((d + d + d) - (s0 + s0) - s1 + t * (s0 + s1 - (d + d))));
    // Round-off must not make extrema either.
    monotone.positive(between(value, least(p[1], p[2]), most(p[1], p[2])), value)
}

/// How many rows earlier memory is asked for a row.
const AHEAD: i32 = 3;

impl Read<'_, '_> {
    #[inline(always)]
    fn linear<const X: bool, const Y: bool, const Z: bool, W: Width>(self, w: W) {
        let Self { view, spots, count, out } = self;
        let (ny, nz) = (1 + usize::from(Y), 1 + usize::from(Z));
        let zero = w.splat(0.0);
        let mut e = 0;
        while e < count {
            let mut index = [0_i32; 16];
            index[..W::N].copy_from_slice(&spots.index[e..e + W::N]);
            let cells = Cells::new::<W>(index);
            // Data for the next rows, if their paths are similar.
            for z in 0..nz as i32 {
                let next = index[0] + AHEAD * view.axes[1].stride + z * view.axes[2].stride;
                ask(view.data.get(next as usize..next as usize + 1).unwrap_or(&[]));
            }
            let (tx, ty, tz) = (w.load(&spots.t[0][e..]), w.load(&spots.t[1][e..]), w.load(&spots.t[2][e..]));
            let mut planes = [zero; 2];
            for z in 0..nz {
                let mut rows = [zero; 2];
                for y in 0..ny {
                    let step = y as i32 * view.axes[1].stride + z as i32 * view.axes[2].stride;
                    // SAFETY: `locate` found a cell whose corners are all inside.
                    let [a, b] = unsafe { cells.pairs(w, view, step) };
                    rows[y] = if X { line(a, b, tx) } else { a };
                }
                planes[z] = if Y { line(rows[0], rows[1], ty) } else { rows[0] };
            }
            w.store(if Z { line(planes[0], planes[1], tz) } else { planes[0] }, &mut out[e..]);
            e += W::N;
        }
    }

    /// The loops over rows are not unrolled: most of the time goes into loading sixteen rows of four numbers.
    #[inline(always)]
    fn cubic<W: Width>(self, w: W) {
        let Self { view, spots, count, out } = self;
        let [x, y, z] = view.there;
        let (ny, nz) = (if y { 4 } else { 1 }, if z { 4 } else { 1 });
        let monotone = view.how == Interpolation::MonotoneCubic;
        let (zero, one) = (w.splat(0.0), w.splat(if monotone { 1.0 } else { 0.0 }));
        let (sy, sz) = (view.axes[1].stride, view.axes[2].stride);
        let first = -i32::from(x) - i32::from(y) * sy - i32::from(z) * sz;
        let mut e = 0;
        while e < count {
            let (tx, ty, tz) = (w.load(&spots.t[0][e..]), w.load(&spots.t[1][e..]), w.load(&spots.t[2][e..]));
            let mut planes = [zero; 4];
            for k in 0..nz {
                let mut rows = [zero; 4];
                for j in 0..ny {
                    let step = first + j as i32 * sy + k as i32 * sz;
                    let mut at = [0_i32; 16];
                    for l in 0..W::N {
                        at[l] = spots.index[e + l] + step;
                    }
                    // SAFETY: `locate` found a cell whose corners and their neighbours are all inside.
                    let p = unsafe { w.quads(&view.data, &at) };
                    rows[j] = if x { curve(p, tx, one) } else { p[0] };
                }
                planes[k] = if y { curve(rows, ty, one) } else { rows[0] };
            }
            w.store(if z { curve(planes, tz, one) } else { planes[0] }, &mut out[e..]);
            e += W::N;
        }
    }
}

impl Kernel for Read<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        match (self.view.how, self.view.there) {
            (Interpolation::Linear, [true, true, true]) => self.linear::<true, true, true, W>(w),
            (Interpolation::Linear, [true, true, _]) => self.linear::<true, true, false, W>(w),
            (Interpolation::Linear, [true, _, _]) => self.linear::<true, false, true, W>(w),
            (Interpolation::Linear, _) => self.linear::<false, true, true, W>(w),
            _ => self.cubic(w),
        }
    }
}

/// The values at spots.
#[inline]
pub(super) fn read(view: &View, spots: &Spots, count: usize, out: &mut Lot<Real>) {
    dispatch(Read { view, spots, count, out });
}

/// Cells of a pack.
struct Cells {
    index: [i32; 16],
    /// Paths that are alike lead to cells that lie side by side.
    aligned: bool,
}

impl Cells {
    #[inline(always)]
    fn new<W: Width>(index: [i32; 16]) -> Self {
        let mut off = 0;
        for l in 0..W::N {
            off |= (index[l] - l as i32) ^ index[0];
        }
        Self { index, aligned: off == 0 }
    }

    /// The numbers so many further on, and those after them.
    ///
    /// # Safety
    /// They are in the view.
    #[inline(always)]
    unsafe fn pairs<W: Width>(&self, w: W, view: &View, step: i32) -> [W::L; 2] {
        if self.aligned {
            let numbers = &view.data[(self.index[0] + step) as usize..];
            return [w.load(numbers), w.load(&numbers[1..])];
        }
        let mut at = [0_i32; 16];
        for l in 0..W::N {
            at[l] = self.index[l] + step;
        }
        // SAFETY: the caller's.
        unsafe { w.pairs(&view.data, &at) }
    }
}

struct Corners<'a, 'b> {
    view: &'a View<'b>,
    cells: &'a [i32],
    out: &'a mut [Lot<Real>; 2],
}

impl Kernel for Corners<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        let Self { view, cells, out } = self;
        let [x, y, z] = view.there;
        let (ny, nz) = (1 + i32::from(y), 1 + i32::from(z));
        for (pack, part) in cells.chunks(W::N).enumerate() {
            let mut index = [part[0]; 16];
            index[..part.len()].copy_from_slice(part);
            let cells = Cells::new::<W>(index);
            let (mut low, mut high) = (w.splat(Real::INFINITY), w.splat(-Real::INFINITY));
            for z in 0..nz {
                for y in 0..ny {
                    let step = y * view.axes[1].stride + z * view.axes[2].stride;
                    // SAFETY: `locate` found cells whose corners are all inside.
                    let [a, b] = unsafe { cells.pairs(w, view, step) };
                    let (l, h) = if x { (least(a, b), most(a, b)) } else { (a, a) };
                    (low, high) = (least(low, l), most(high, h));
                }
            }
            w.store(low, &mut out[0][pack * W::N..]);
            w.store(high, &mut out[1][pack * W::N..]);
        }
    }
}

/// The least and the greatest corner of cells that `locate` has found.
#[inline]
pub(super) fn corners(view: &View, cells: &[i32], out: &mut [Lot<Real>; 2]) {
    dispatch(Corners { view, cells, out });
}

/// The point of the grid's cells at or below a position along an axis, and the way from it, in cells. Positions that are no numbers
/// are at the lower wall.
fn split(grid: &Grid, axis: usize, x: f64) -> (f64, f64) {
    let n = grid.n[axis] as f64;
    let cells = (x - grid.origin[axis]) / grid.dx;
    let inside = if grid.periodic[axis] && cells.is_finite() { cells.rem_euclid(n) } else { cells.max(0.0).min(n) };
    let whole = inside.floor();
    (whole, inside - whole)
}

/// The values of a field at positions [m].
pub fn sample(f: &Field, points: &[[f64; 3]], how: Interpolation) -> Result<Vec<Real>, GridError> {
    f.expect(&f.grid, f.place, "sampled field")?;
    let view = View::new(f, how);
    let mut out = vec![0.0; points.len()];
    out.chunks_mut(SEGMENT).zip(points.chunks(SEGMENT)).in_parallel(|(out, points)| {
        let (mut spots, mut all) = (Spots::new(), Spots::new());
        let mut d = [[0.0; SEGMENT]; 3];
        for (e, x) in points.iter().enumerate() {
            let mut at = [0; 3];
            for a in f.grid.axes() {
                let (whole, rest) = split(&f.grid, a, x[a]);
                (at[a], d[a][0]) = (whole as usize, rest as Real);
            }
            locate(&view, Start { at, offset: [0.0; 3] }, &d, 1, &mut spots);
            all.index[e] = spots.index[0];
            for a in 0..3 {
                all.t[a][e] = spots.t[a][0];
            }
        }
        // Pads of the last register read the first spot.
        for e in points.len()..points.len().next_multiple_of(16).min(SEGMENT) {
            all.index[e] = all.index[0];
        }
        let mut values = [0.0; SEGMENT];
        read(&view, &all, points.len(), &mut values);
        out.copy_from_slice(&values[..points.len()]);
    });
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::simd::{Level, dispatch_at};
    use crate::state::Place;

    #[test]
    fn every_width_finds_and_reads_the_same_bits() {
        let planes = [(0, [1, 9, 7]), (1, [40, 1, 6]), (2, [40, 11, 1])];
        let mut grids: Vec<Grid> = planes.iter().map(|(a, n)| Grid::new(*n, 0.1, [0.0; 3]).unwrap().flat(*a).unwrap()).collect();
        grids.push(Grid::new([40, 7, 6], 0.1, [0.0; 3]).unwrap());
        let mut read_something = 0.0;
        for grid in grids.into_iter().flat_map(|g| [g, g.periodic([true; 3])]) {
            let f = Field::of(grid, Place::Cell, "", |x| (31.0 * x[0]).sin() * (27.0 * x[1]).cos() + (40.0 * x[2]).sin()).unwrap();
            for how in [Interpolation::Linear, Interpolation::Cubic, Interpolation::MonotoneCubic] {
                let view = View::new(&f, how);
                let wild = |e: usize| ((e * e % 37) as f64 - 18.0) * 0.713;
                let mut d = [[0.0; SEGMENT]; 3];
                for a in 0..3 {
                    for e in 0..SEGMENT {
                        d[a][e] = wild(e + 7 * a) as Real;
                    }
                }
                (d[0][3], d[1][5]) = (Real::NAN, Real::INFINITY);
                let all = |level| {
                    let (mut spots, mut out, mut bounds) = (Spots::new(), [0.0; SEGMENT], [[0.0; SEGMENT]; 2]);
                    let start = Start { at: [0, 0, 0], offset: [0.0, 0.5, 0.0] };
                    let count = 40;
                    dispatch_at(level, Locate { view: &view, start, d: &d, count, spots: &mut spots });
                    dispatch_at(level, Read { view: &view, spots: &spots, count, out: &mut out });
                    dispatch_at(level, Corners { view: &view, cells: &spots.index[..count], out: &mut bounds });
                    [&out[..40], &bounds[0][..40], &bounds[1][..40]].concat().iter().map(|v| v.to_bits()).collect::<Vec<_>>()
                };
                let one = all(Level::Scalar);
                read_something += Real::from_bits(one[7]).abs();
                Level::available().into_iter().for_each(|level| assert_eq!(all(level), one, "{level:?} {how:?} {grid:?}"));
            }
        }
        assert!(read_something > 1.0);
    }

    #[test]
    fn rows_that_are_not_displaced_are_read_as_all_others() {
        let space = Grid::new([37, 5, 4], 0.1, [0.0; 3]).unwrap();
        let plane = Grid::new([37, 1, 6], 0.1, [0.0; 3]).unwrap().flat(1).unwrap();
        let mut rows = 0;
        for grid in [space, space.periodic([true; 3]), plane, plane.periodic([true; 3])] {
            for (from, to) in [Place::Cell, Place::Face(0), Place::Face(2), Place::Node]
                .into_iter()
                .flat_map(|a| [Place::Cell, Place::Face(0), Place::Face(2), Place::Node].map(|b| (a, b)))
            {
                let f = Field::of(grid, from, "", |x| (31.0 * x[0]).sin() + (27.0 * x[1]).cos() * (40.0 * x[2]).sin()).unwrap();
                let (view, points) = (View::new(&f, Interpolation::Linear), grid.points(to));
                for (j, k) in (0..points[1]).flat_map(|j| (0..points[2]).map(move |k| (j, k))) {
                    let start = Start { at: [0, j, k], offset: grid.offset(to) };
                    let (mut spots, mut still, mut all) = (Spots::new(), [0.0; SEGMENT], [0.0; SEGMENT]);
                    read_still(&view, start, points[0], &mut still);
                    locate(&view, start, &[[0.0; SEGMENT]; 3], points[0], &mut spots);
                    read(&view, &spots, points[0], &mut all);
                    assert_eq!(still[..points[0]], all[..points[0]], "{from} {to} {j} {k}");
                    rows += 1;
                }
            }
        }
        assert!(rows > 500);
    }
}
