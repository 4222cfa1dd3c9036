//! One grid of the pressure system: its matrix row by row, and the tiles that passes over it are cut into.
//!
//! Rows are worked on in blocks of 16 cells, pads included: what lies in a pad has no open face and does nothing. A block whose
//! faces are all open, but perhaps for a wall at its ends, needs no weights, and gives the same bits as the one that reads them. Tiles have a fixed shape and compute
//! the rows around them anew, so that neither the number of threads nor the width of registers shows in a result.

use super::block::{Block, LANES, blocks};
use super::faces::Weight;
use crate::math::parallel::Tasks;
use crate::math::simd::{Kernel, Level as Registers, Width, ask, dispatch_at};
use crate::math::{Column, Lane, Lattice, Real};
use std::cell::RefCell;
use std::marker::PhantomData;

/// A grid, its matrix and, while it is worked on, three columns.
#[derive(Debug, Clone)]
pub(super) struct Grid<T> {
    pub lattice: Lattice,
    pub periodic: [bool; 3],
    /// Weights of lower faces; those of upper faces are a stride further on.
    pub w: [Vec<T>; 3],
    /// Extra diagonal, if any.
    pub extra: Option<Vec<Real>>,
    /// OpenFaces of every block.
    pub kinds: Vec<OpenFaces>,
    edges: [Edge; 4],
    /// One cell along z, whose faces across it are closed.
    pub flat: bool,
    /// Whether a row needs ghosts at its ends: its ends are joined, or open.
    pub ends: bool,
    /// Right-hand side, or what is left of it.
    pub b: Column,
    /// Before the correction from the coarser grid.
    pub x: Column,
    /// The result of a cycle.
    pub y: Column,
    /// Numbers of a row in blocks.
    pub width: usize,
    /// A row of zeros.
    zeros: Column,
}

/// Which faces of a block along x, y, and z unless the grid is flat, are open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OpenFaces {
    /// Any of them, or something is added to the diagonal.
    Mixed,
    /// All.
    Open,
    /// All but the first along x, the last one, or both.
    Walls([bool; 2]),
}

/// Substitute for the weights of a block with walls at its ends.
#[derive(Debug, Clone, Copy)]
struct Edge {
    lower: Block,
    upper: Block,
    diagonal: Block,
    inverse: Block,
}

impl Edge {
    fn new(walls: [bool; 2], open: Real) -> Self {
        let (mut lower, mut upper) = ([1.0; LANES], [1.0; LANES]);
        lower[0] = if walls[0] { 0.0 } else { 1.0 };
        upper[LANES - 1] = if walls[1] { 0.0 } else { 1.0 };
        let diagonal = std::array::from_fn(|i| (open - 2.0) + lower[i] + upper[i]);
        Self { lower, upper, diagonal, inverse: diagonal.map(|d| 1.0 / d) }
    }
}

impl<T: Weight> Grid<T> {
    /// A grid of that matrix. Faces on the upper side of an axis have number n; those of joined sides are copies of number 0.
    pub fn new(lattice: Lattice, periodic: [bool; 3], w: [Vec<T>; 3], extra: Option<Vec<Real>>) -> Self {
        let [n0, n1, n2] = lattice.n;
        let width = n0.next_multiple_of(LANES);
        let is = |axis: usize, c: T, range: std::ops::Range<usize>| w[axis][range].iter().all(|w| *w == c);
        let mut ends = periodic[0];
        let flat = n2 == 1 && (0..n1).all(|j| [0, 1].iter().all(|k| is(2, T::CLOSED, lattice.at(0, j, *k)..lattice.at(n0, j, *k))));
        let z = if flat { T::CLOSED } else { T::OPEN };
        let mut kinds = Vec::with_capacity(width / LANES * n1 * n2);
        for k in 0..n2 {
            for j in 0..n1 {
                ends |= w[0][lattice.at(0, j, k)] != T::CLOSED || w[0][lattice.at(n0, j, k)] != T::CLOSED;
                for e in (0..width).step_by(LANES) {
                    let at = lattice.at(e, j, k);
                    let here = |up: usize| at + up..at + up + LANES;
                    let side = |w: T| [T::OPEN, T::CLOSED].contains(&w);
                    let walls = [0, LANES].map(|up| w[0][at + up] == T::CLOSED);
                    let open = e + LANES <= n0
                        && side(w[0][at])
                        && side(w[0][at + LANES])
                        && is(0, T::OPEN, at + 1..at + LANES)
                        && is(1, T::OPEN, here(0))
                        && is(1, T::OPEN, here(lattice.stride[1]))
                        && is(2, z, here(0))
                        && is(2, z, here(lattice.stride[2]))
                        && extra.as_ref().is_none_or(|d| d[here(0)].iter().all(|d| *d == 0.0));
                    kinds.push(match (open, walls) {
                        (false, _) => OpenFaces::Mixed,
                        (true, [false, false]) => OpenFaces::Open,
                        (true, walls) => OpenFaces::Walls(walls),
                    });
                }
            }
        }
        let open = if flat { 4.0 } else { 6.0 };
        let edges = [[false, false], [true, false], [false, true], [true, true]].map(|walls| Edge::new(walls, open));
        Self {
            lattice,
            periodic,
            w,
            extra,
            kinds,
            edges,
            flat,
            ends,
            b: Column::default(),
            x: Column::default(),
            y: Column::default(),
            width,
            zeros: Column::zeros(width),
        }
    }

    /// The same with columns of its own.
    pub fn with_columns(mut self) -> Self {
        [self.b, self.x, self.y] = [(); 3].map(|()| Column::zeros(self.lattice.len()));
        self
    }

    /// The number of the first cell of row (j, k), which may lie one row outside; sides that are joined continue for ever.
    #[inline(always)]
    pub fn start(&self, j: isize, k: isize) -> usize {
        let wrap = |i: isize, axis: usize| {
            let n = self.lattice.n[axis] as isize;
            if self.periodic[axis] && !(0..n).contains(&i) { i.rem_euclid(n) } else { i }
        };
        let (j, k) = (wrap(j, 1), wrap(k, 2));
        (self.lattice.at(0, 0, 0) as isize + j * self.lattice.stride[1] as isize + k * self.lattice.stride[2] as isize) as usize
    }

    /// The faces of the row that starts at cell number `at`.
    #[inline(always)]
    pub fn faces(&self, at: usize) -> Faces<'_, T> {
        let [_, row, plane] = self.lattice.stride;
        let of = |axis: usize, up: usize| self.w[axis][at + up..at + up + self.width].as_chunks::<LANES>().0;
        let (first, count) = (at - self.lattice.at(0, 0, 0), self.width / LANES);
        let (k, j) = (first / plane, first % plane / row);
        let number = (j + self.lattice.n[1] * k) * count;
        Faces {
            w: [[of(0, 0), of(0, 1)], [of(1, 0), of(1, row)], [of(2, 0), of(2, plane)]],
            extra: self.extra.as_ref().map(|d| blocks(&d[at..at + self.width])),
            kinds: &self.kinds[number..number + count],
            edges: &self.edges,
            flat: self.flat,
        }
    }

    /// The row that starts at `at`.
    #[inline(always)]
    pub fn row<'a>(&self, of: &'a [Real], at: usize) -> &'a [Real] {
        &of[at..at + self.width]
    }

    /// The rows around row (j, k) of a column. Its own row is copied to `own` if its ends need ghosts.
    #[inline(always)]
    pub fn near<'a>(&self, of: &'a [Real], j: isize, k: isize, own: &'a mut [Real]) -> Near<'a> {
        let at = self.start(j, k);
        let row = |j, k| self.row(of, self.start(j, k));
        let padded = if self.ends {
            own[1..=self.width].copy_from_slice(self.row(of, at));
            self.close(own);
            &own[..]
        } else {
            &of[at - 1..at + self.width + 1]
        };
        Near { padded, y: [row(j - 1, k), row(j + 1, k)], z: [row(j, k - 1), row(j, k + 1)] }
    }

    /// Sets the ghosts at both ends of a row with one number more on each side: what is joined, or zero.
    #[inline(always)]
    pub fn close(&self, padded: &mut [Real]) {
        let n = self.lattice.n[0];
        let ends = if self.periodic[0] { [padded[n], padded[1]] } else { [0.0; 2] };
        [padded[0], padded[n + 1]] = ends;
    }

    /// Sets what a row holds behind its last cell to zero: an open or joined side gives the first number there, and the last one,
    /// whose upper face is the lower one of the next row, a face and a value.
    #[inline(always)]
    pub fn end(&self, row: &mut [Real]) {
        if self.ends {
            row[self.lattice.n[0]..].fill(0.0);
        }
    }

    /// Calls `f(first number, [j, k])` for every row.
    pub fn each_row(&self, mut f: impl FnMut(usize, [usize; 2])) {
        for k in 0..self.lattice.n[2] {
            for j in 0..self.lattice.n[1] {
                f(self.lattice.at(0, j, k), [j, k]);
            }
        }
    }
}

/// The faces of a row, lower and upper along each axis.
pub(super) struct Faces<'a, T> {
    w: [[&'a [[T; LANES]]; 2]; 3],
    extra: Option<&'a [Block]>,
    kinds: &'a [OpenFaces],
    edges: &'a [Edge; 4],
    flat: bool,
}

/// A row, with one number more on both sides, and the four around it.
pub(super) struct Near<'a> {
    padded: &'a [Real],
    y: [&'a [Real]; 2],
    z: [&'a [Real]; 2],
}

impl<T> Faces<'_, T> {
    #[inline(always)]
    fn edge(&self, [lower, upper]: [bool; 2]) -> &Edge {
        &self.edges[usize::from(lower) + 2 * usize::from(upper)]
    }
}

impl<'a> Near<'a> {
    /// The row itself.
    #[inline(always)]
    pub fn own(&self) -> &'a [Real] {
        &self.padded[1..self.padded.len() - 1]
    }
}

/// Result from (A v)_i, 1/A_ii (zero if A_ii is), v_i and b_i; `lane` counts from the first cell of a block.
pub(super) trait Finish {
    /// The number to store.
    fn at<W: Width>(&self, w: W, lane: usize, product: W::L, inverse: W::L, v: W::L, b: W::L) -> W::L;
}

/// A v.
pub(super) struct Product;

impl Finish for Product {
    #[inline(always)]
    fn at<W: Width>(&self, _w: W, _lane: usize, product: W::L, _inverse: W::L, _v: W::L, _b: W::L) -> W::L {
        product
    }
}

/// b - A v.
pub(super) struct Residual;

impl Finish for Residual {
    #[inline(always)]
    fn at<W: Width>(&self, _w: W, _lane: usize, product: W::L, _inverse: W::L, _v: W::L, b: W::L) -> W::L {
        b - product
    }
}

/// v + weight (b - A v)/A_ii, zero where nothing is to be solved.                                        (pressure.6)
pub(super) struct Relax(pub Real);

impl Finish for Relax {
    #[inline(always)]
    fn at<W: Width>(&self, w: W, _lane: usize, product: W::L, inverse: W::L, v: W::L, b: W::L) -> W::L {
        inverse.positive(v + w.splat(self.0) * inverse * (b - product), v.zero())
    }
}

/// b/A_ii.
struct Scaled(Real);

impl Finish for Scaled {
    #[inline(always)]
    fn at<W: Width>(&self, w: W, _lane: usize, _product: W::L, inverse: W::L, _v: W::L, b: W::L) -> W::L {
        w.splat(self.0) * inverse * b
    }
}

/// out = finish of (A v)_i, ... along a row.                                                            (pressure.2)
#[inline(always)]
pub(super) fn sweep<W: Width, T: Weight, F: Finish>(w: W, faces: &Faces<T>, near: &Near, b: &[Real], out: &mut [Real], finish: F) {
    let out = out.as_chunks_mut::<LANES>().0;
    let n = out.len();
    let of = |row| &blocks(row)[..n];
    let (b, xm, v, xp) = (of(b), of(near.padded), of(&near.padded[1..]), of(&near.padded[2..]));
    let (ym, yp, zm, zp) = (of(near.y[0]), of(near.y[1]), of(near.z[0]), of(near.z[1]));
    let kinds = &faces.kinds[..n];
    let diagonal: Real = if faces.flat { 4.0 } else { 6.0 };
    let (d, inverse) = (w.splat(diagonal), w.splat(1.0 / diagonal));
    for e in 0..n {
        for part in 0..LANES / W::N {
            let i = part * W::N;
            let (v, b) = (w.load(&v[e][i..]), w.load(&b[e][i..]));
            let (xm, xp) = (w.load(&xm[e][i..]), w.load(&xp[e][i..]));
            let (ym, yp) = (w.load(&ym[e][i..]), w.load(&yp[e][i..]));
            let (zm, zp) = (w.load(&zm[e][i..]), w.load(&zp[e][i..]));
            let of_z = if faces.flat { w.splat(0.0) } else { zm + zp };
            let new = match kinds[e] {
                OpenFaces::Open => finish.at(w, i, d * v - (((xm + xp) + (ym + yp)) + of_z), inverse, v, b),
                OpenFaces::Walls(walls) => {
                    let edge = faces.edge(walls);
                    let s = ((w.load(&edge.lower[i..]) * xm + w.load(&edge.upper[i..]) * xp) + (ym + yp)) + of_z;
                    finish.at(w, i, w.load(&edge.diagonal[i..]) * v - s, w.load(&edge.inverse[i..]), v, b)
                }
                OpenFaces::Mixed => {
                    let [[x0, x1], [y0, y1], [z0, z1]] = weights(w, faces, e, i);
                    let s = ((x0 * xm + x1 * xp) + (y0 * ym + y1 * yp)) + (z0 * zm + z1 * zp);
                    let d = diagonal_of(w, faces, e, i, [[x0, x1], [y0, y1], [z0, z1]]);
                    finish.at(w, i, d * v - s, d.positive(d.like(1.0) / d, d.zero()), v, b)
                }
            };
            w.store(new, &mut out[e][i..]);
        }
    }
}

#[inline(always)]
fn weights<W: Width, T: Weight>(w: W, faces: &Faces<T>, e: usize, i: usize) -> [[W::L; 2]; 3] {
    let [x, y, z] = &faces.w;
    [
        [T::load(w, &x[0][e], i), T::load(w, &x[1][e], i)],
        [T::load(w, &y[0][e], i), T::load(w, &y[1][e], i)],
        [T::load(w, &z[0][e], i), T::load(w, &z[1][e], i)],
    ]
}

#[inline(always)]
fn diagonal_of<W: Width, T: Weight>(w: W, faces: &Faces<T>, e: usize, i: usize, [x, y, z]: [[W::L; 2]; 3]) -> W::L {
    let d = (x[0] + x[1]) + (y[0] + y[1]) + (z[0] + z[1]);
    match faces.extra {
        Some(extra) => d + w.load(&extra[e][i..]),
        None => d,
    }
}

/// out = c b/A_ii along a row.
#[inline(always)]
pub(super) fn scale<W: Width, T: Weight>(w: W, faces: &Faces<T>, c: Real, b: &[Real], out: &mut [Real]) {
    let (out, b) = (out.as_chunks_mut::<LANES>().0, blocks(b));
    let zero = w.splat(0.0);
    let n = out.len();
    let (b, kinds) = (&b[..n], &faces.kinds[..n]);
    let sixth = w.splat(1.0 / if faces.flat { 4.0 } else { 6.0 });
    for e in 0..n {
        for part in 0..LANES / W::N {
            let i = part * W::N;
            let inverse = match kinds[e] {
                OpenFaces::Open => sixth,
                OpenFaces::Walls(walls) => w.load(&faces.edge(walls).inverse[i..]),
                OpenFaces::Mixed => {
                    let d = diagonal_of(w, faces, e, i, weights(w, faces, e, i));
                    d.positive(d.like(1.0) / d, d.zero())
                }
            };
            w.store(Scaled(c).at(w, i, zero, inverse, zero, w.load(&b[e][i..])), &mut out[e][i..]);
        }
    }
}

/// The sum of products along a row: sixteen sums side by side whatever the width, added in order.
#[inline(always)]
pub(super) fn dot<W: Width>(w: W, a: &[Real], b: &[Real]) -> f64 {
    let (a, b) = (blocks(a), blocks(b));
    let b = &b[..a.len()];
    let mut sums = [w.splat(0.0); LANES];
    for e in 0..a.len() {
        for part in 0..LANES / W::N {
            let i = part * W::N;
            sums[part] = sums[part] + w.load(&a[e][i..]) * w.load(&b[e][i..]);
        }
    }
    total(w, &sums)
}

/// The sum of a row.
#[inline(always)]
pub(super) fn sum<W: Width>(w: W, a: &[Real]) -> f64 {
    let a = blocks(a);
    let mut sums = [w.splat(0.0); LANES];
    for e in 0..a.len() {
        for part in 0..LANES / W::N {
            sums[part] = sums[part] + w.load(&a[e][part * W::N..]);
        }
    }
    total(w, &sums)
}

/// The largest magnitude of a row; a NaN stays one in the sums of squares.
#[inline(always)]
fn largest<W: Width>(w: W, a: &[Real]) -> f64 {
    let a = blocks(a);
    let mut most = [w.splat(0.0); LANES];
    for e in 0..a.len() {
        for part in 0..LANES / W::N {
            let v = w.load(&a[e][part * W::N..]);
            let v = v.positive(v, -v);
            most[part] = (v - most[part]).positive(v, most[part]);
        }
    }
    let mut lanes = [0.0; LANES];
    for part in 0..LANES / W::N {
        w.store(most[part], &mut lanes[part * W::N..]);
    }
    let mut of_all = 0.0;
    for lane in lanes {
        of_all = if lane > of_all { lane } else { of_all };
    }
    f64::from(of_all)
}

/// The squared norm of rows and their largest magnitude.
#[derive(Default)]
pub(super) struct Norm {
    squares: f64,
    most: f64,
}

impl Norm {
    /// Adds a row.
    #[inline(always)]
    pub fn add<W: Width>(&mut self, w: W, row: &[Real]) {
        self.squares += dot(w, row, row);
        let here = largest(w, row);
        self.most = if here > self.most { here } else { self.most };
    }

    /// Result of a pass.
    #[inline(always)]
    pub fn sums(&self) -> [f64; 4] {
        [self.squares, 0.0, 0.0, self.most]
    }
}

#[inline(always)]
fn total<W: Width>(w: W, sums: &[W::L; LANES]) -> f64 {
    let mut lanes = [0.0; LANES];
    for part in 0..LANES / W::N {
        w.store(sums[part], &mut lanes[part * W::N..]);
    }
    let mut total = 0.0;
    for lane in lanes {
        total += f64::from(lane);
    }
    total
}

/// y += c x along a row.
#[inline(always)]
pub(super) fn add<W: Width>(w: W, y: &mut [Real], c: Real, x: &[Real]) {
    let (y, x) = (y.as_chunks_mut::<LANES>().0, blocks(x));
    let x = &x[..y.len()];
    let c = w.splat(c);
    for e in 0..y.len() {
        for part in 0..LANES / W::N {
            let i = part * W::N;
            let new = w.load(&y[e][i..]) + c * w.load(&x[e][i..]);
            w.store(new, &mut y[e][i..]);
        }
    }
}

/// Rows j of planes k that are worked on together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tile {
    pub j: [isize; 2],
    pub k: [isize; 2],
}

/// Rows and planes of a tile, even numbers so that a row of the coarser grid belongs to one tile. The rows of three planes that
/// a pass keeps fit into the caches of one core.
const SHAPE: [usize; 2] = [64, 16];

/// How many rows earlier memory is asked for a row.
const AHEAD: isize = 4;

/// Cells up to which threads would cost more than they save.
const SERIAL: usize = 20_000;

impl Tile {
    fn all(n: [usize; 3]) -> Vec<Self> {
        let part = |axis: usize| {
            let (n, size) = (n[axis], SHAPE[axis - 1]);
            (0..n).step_by(size).map(move |from| [from as isize, (from + size).min(n) as isize])
        };
        part(2).flat_map(|k| part(1).map(move |j| Self { j, k })).collect()
    }

    /// The rows of the tile and `more` around it, as far as the grid goes.
    #[inline(always)]
    pub fn rows<T>(&self, grid: &Grid<T>, more: isize) -> std::ops::Range<isize> {
        if grid.periodic[1] {
            self.j[0] - more..self.j[1] + more
        } else {
            (self.j[0] - more).max(0)..(self.j[1] + more).min(grid.lattice.n[1] as isize)
        }
    }

    /// Its rows in plane k and `more` around them, each with the start of the one that is worked on some rows later.
    #[inline(always)]
    pub fn rows_ahead<T: Weight>(&self, grid: &Grid<T>, more: isize, k: isize) -> impl Iterator<Item = (isize, usize)> {
        let rows = self.rows(grid, more);
        let (first, count, next) = (rows.start, rows.end - rows.start, self.has(grid, k + 1));
        rows.map(move |j| {
            let later = j + AHEAD;
            let (aj, ak) = match later < first + count {
                true => (later, k),
                false if next => ((later - count).clamp(first, first + count - 1), k + 1),
                false => (j, k),
            };
            (j, grid.start(aj, ak))
        })
    }

    /// Whether the grid has a plane k.
    #[inline(always)]
    pub fn has<T>(&self, grid: &Grid<T>, k: isize) -> bool {
        grid.periodic[2] || (0..grid.lattice.n[2] as isize).contains(&k)
    }
}

/// A pass over a tile: what it adds up.
pub(super) trait Pass: Sync {
    /// Does the work on a tile with scratch of at least `scratch` numbers, whose content means nothing.
    fn tile<W: Width>(&self, w: W, tile: Tile, scratch: &mut [Real]) -> [f64; 4];
    /// Numbers of scratch.
    fn scratch(&self) -> usize;
}

struct OnTile<'a, P> {
    pass: &'a P,
    tile: Tile,
    scratch: &'a mut [Real],
}

impl<P: Pass> Kernel for OnTile<'_, P> {
    type Output = [f64; 4];
    #[inline(always)]
    fn run<W: Width>(self, w: W) -> [f64; 4] {
        self.pass.tile(w, self.tile, self.scratch)
    }
}

thread_local! {
    static SCRATCH: RefCell<Column> = const { RefCell::new(Column::new()) };
}

/// Runs a pass over all tiles of a grid. The first three of what tiles return are added in the order of tiles, of the fourth the
/// largest is taken.
pub(super) fn run<P: Pass>(n: [usize; 3], registers: Registers, pass: &P) -> [f64; 4] {
    let tiles = Tile::all(n);
    let one = |tile: &Tile| {
        SCRATCH.with_borrow_mut(|scratch| {
            scratch.reserve(pass.scratch());
            dispatch_at(registers, OnTile { pass, tile: *tile, scratch })
        })
    };
    let parts: Vec<[f64; 4]> = if tiles.len() < 2 || n.iter().product::<usize>() < SERIAL {
        tiles.iter().map(one).collect()
    } else {
        tiles.iter().map_in_parallel(one)
    };
    parts.iter().fold([0.0; 4], |all, part| {
        let most = if part[3] > all[3] { part[3] } else { all[3] };
        [all[0] + part[0], all[1] + part[1], all[2] + part[2], most]
    })
}

/// Three planes of the rows of a tile and two around it, for a stage of a pass that the next stage reads.
pub(super) struct Ring<'a> {
    rows: &'a mut [Real],
    first: isize,
    height: usize,
    stride: usize,
    width: usize,
}

impl<'a> Ring<'a> {
    /// Numbers that a ring needs.
    pub fn numbers<T>(grid: &Grid<T>) -> usize {
        3 * (SHAPE[0].min(grid.lattice.n[1]) + 4) * (grid.width + 2 * LANES)
    }

    /// Takes its place from the front of `scratch`.
    #[inline(always)]
    pub fn new<T>(grid: &Grid<T>, tile: Tile, scratch: &'a mut [Real]) -> (Self, &'a mut [Real]) {
        let (rows, rest) = scratch.split_at_mut(Self::numbers(grid));
        let height = SHAPE[0].min(grid.lattice.n[1]) + 4;
        (Self { rows, first: tile.j[0] - 2, height, stride: grid.width + 2 * LANES, width: grid.width }, rest)
    }

    #[inline(always)]
    fn at(&self, j: isize, k: isize) -> usize {
        (k.rem_euclid(3) as usize * self.height + (j - self.first) as usize) * self.stride + LANES
    }

    /// Row (j, k), with one number more on both sides.
    #[inline(always)]
    pub fn padded(&mut self, j: isize, k: isize) -> &mut [Real] {
        let at = self.at(j, k);
        &mut self.rows[at - 1..at + self.width + 1]
    }

    /// The rows around row (j, k); zeros where the grid has none.
    #[inline(always)]
    pub fn near<'b, T: Weight>(&'b self, grid: &'b Grid<T>, j: isize, k: isize) -> Near<'b> {
        let row = |j: isize, k: isize| {
            let inside = |i: isize, axis: usize| grid.periodic[axis] || (0..grid.lattice.n[axis] as isize).contains(&i);
            if inside(j, 1) && inside(k, 2) {
                let at = self.at(j, k);
                &self.rows[at..at + self.width]
            } else {
                &grid.zeros[..]
            }
        };
        let at = self.at(j, k);
        Near { padded: &self.rows[at - 1..at + self.width + 1], y: [row(j - 1, k), row(j + 1, k)], z: [row(j, k - 1), row(j, k + 1)] }
    }
}

/// A column that tiles write at the same time, each its own rows.
pub(super) struct Rows<'a> {
    start: *mut Real,
    len: usize,
    life: PhantomData<&'a mut [Real]>,
}

// SAFETY: whoever takes a row vouches that no other thread has it.
unsafe impl Sync for Rows<'_> {}

impl<'a> Rows<'a> {
    /// Of a column.
    pub fn of(column: &'a mut [Real]) -> Self {
        Self { start: column.as_mut_ptr(), len: column.len(), life: PhantomData }
    }

    /// Asks memory for `count` numbers from `at` on.
    #[inline(always)]
    pub fn ask(&self, at: usize, count: usize) {
        assert!(at + count <= self.len);
        // SAFETY: inside the column; nothing is read.
        ask(unsafe { std::slice::from_raw_parts(self.start.add(at), count) });
    }

    /// `count` numbers from `at` on.
    ///
    /// # Safety
    /// Nobody else holds any of them.
    #[inline(always)]
    #[allow(clippy::mut_from_ref)] // that is what it is for
    pub unsafe fn take(&self, at: usize, count: usize) -> &mut [Real] {
        assert!(at + count <= self.len);
        // SAFETY: inside the column, and the caller alone has it.
        unsafe { std::slice::from_raw_parts_mut(self.start.add(at), count) }
    }
}
