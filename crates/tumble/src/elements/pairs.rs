//! Elements between two points, gathered: every point sums over its own list of neighbours (sliced ELL: slices of 16
//! rows, padded to the longest list in the slice). Each spring is evaluated from both ends, which costs arithmetic and
//! saves the pass through memory: 2x faster than two passes on a sheet, and the two evaluations are exact opposites.

use super::batch::{Batch, Block, Weights};
use super::list::{List, Members};
use super::{Distance, Element, Law, Vector, forces};
use crate::math::parallel::{chunks, fold};
use crate::math::simd::{Index, Kernel, Scalar, Width, dispatch};
use crate::math::{Lane, Real, Row, Vec3, ZERO, xyz};
use rayon::prelude::*;
use tumble_interface::scene::Hessian;

/// Rows per slice; every register width divides it.
const SLICE: usize = 16;

/// An element between two points that is the same seen from either end, and whose matrix is c n n^T + s I with n along
/// the line between them.
pub trait Pair<const M: usize, const D: usize>: Element<2, M, D> {
    /// sqrt(c) n and s for stiffness k and damping b, from d = x1 - x0. `exact` keeps a negative s.
    fn stiffness<Y: Law<P>, L: Lane, const P: usize>(k: L, b: L, law: [L; P], rest: [L; D], d: Vec3<L>, exact: bool) -> (Vec3<L>, L);

    /// Lengthening over rest length at the length l; NaN if the pair has no rest length.
    fn strain(rest: [Real; D], length: Real) -> Real;
}

/// K = (t - s) n n^T + s I,  t = d stress/dr,  s = stress/|d|                   (springs.3)
impl Pair<1, 1> for Distance {
    #[inline(always)]
    fn stiffness<Y: Law<P>, L: Lane, const P: usize>(k: L, b: L, law: [L; P], [l]: [L; 1], d: Vec3<L>, exact: bool) -> (Vec3<L>, L) {
        let length = d.norm();
        let r = length - l;
        let inverse = length.positive(length.like(1.0) / length, length.zero());
        let transverse = Y::stress(k, law, r) * inverse;
        let transverse = if exact { transverse } else { transverse.above_zero() };
        let along = ((Y::tangent(k, law, r) - transverse).above_zero() + b).above_zero();
        (d * (along.sqrt() * inverse), transverse)
    }

    fn strain([l]: [Real; 1], length: Real) -> Real {
        (length - l) / l
    }
}

/// K = k I.
impl Pair<3, 0> for Vector {
    #[inline(always)]
    fn stiffness<Y: Law<P>, L: Lane, const P: usize>(k: L, b: L, law: [L; P], _: [L; 0], d: Vec3<L>, _: bool) -> (Vec3<L>, L) {
        let zero = k.zero();
        (Vec3 { x: zero, y: zero, z: zero }, Y::tangent(k, law, d.x) + b)
    }

    fn strain(_: [Real; 0], _: Real) -> Real {
        Real::NAN
    }
}

/// Springs between points.
pub struct Pairs<E, Y, const M: usize, const D: usize, const P: usize> {
    list: List<E, Y, 2, M, D, P>,
    lists: Neighbours<D, P>,
    /// For products: sqrt(c) n and s of every entry.
    cache: Vec<Row>,
    /// Strain at which each spring breaks; empty if none does.
    limits: Vec<Real>,
    broken: Vec<Broken>,
}

/// A broken spring, with what would mend it.
struct Broken {
    spring: u32,
    stiffness: Real,
    damping: Real,
}

/// The neighbours of every row, slice by slice: 16 first neighbours, 16 second ones, ...
struct Neighbours<const D: usize, const P: usize> {
    /// First row; a multiple of nothing, the slices start here.
    first: usize,
    rows: usize,
    /// Where each slice starts, in entries; one more than there are slices.
    start: Vec<u32>,
    neighbour: Index,
    rest: [Vec<Real>; D],
    law: [Vec<Real>; P],
    stiffness: Vec<Real>,
    damping: Vec<Real>,
    /// The two entries of each spring.
    entries: Vec<[u32; 2]>,
}

impl<const D: usize, const P: usize> Neighbours<D, P> {
    fn new(rows: usize, members: &[Members<2, D, P>]) -> Option<Self> {
        let ends = || members.iter().flat_map(|m| m.nodes);
        let (low, high) = ends().fold((u32::MAX, 0), |(a, b), i| (a.min(i), b.max(i)));
        let (first, count) = if low > high { (0, 0) } else { (low as usize, (high - low + 1) as usize) };
        let mut degree = vec![0_u32; count];
        let place: Vec<[u32; 2]> = members
            .iter()
            .map(|m| {
                m.nodes.map(|i| {
                    let d = &mut degree[i as usize - first];
                    *d += 1;
                    *d - 1
                })
            })
            .collect();
        let mut start = vec![0_u32];
        for slice in degree.chunks(SLICE) {
            let width = slice.iter().copied().max().unwrap_or(0);
            start.push(start[start.len() - 1] + width * SLICE as u32);
        }
        let total = start[start.len() - 1] as usize;
        // A padding entry is a spring of no stiffness from a row to itself.
        let mut neighbour = vec![low.min(high); total];
        let (mut stiffness, mut damping) = (vec![0.0; total], vec![0.0; total]);
        let (mut rest, mut law): ([Vec<Real>; D], [Vec<Real>; P]) =
            (std::array::from_fn(|_| vec![0.0; total]), std::array::from_fn(|_| vec![0.0; total]));
        let entry = |i: u32, slot: u32| {
            let i = i as usize - first;
            start[i / SLICE] as usize + slot as usize * SLICE + i % SLICE
        };
        let mut entries = Vec::with_capacity(members.len());
        for (m, place) in members.iter().zip(&place) {
            let e = [entry(m.nodes[0], place[0]), entry(m.nodes[1], place[1])];
            for side in 0..2 {
                neighbour[e[side]] = m.nodes[1 - side];
                stiffness[e[side]] = m.stiffness as Real;
                damping[e[side]] = m.damping as Real;
                for d in 0..D {
                    rest[d][e[side]] = m.rest[d] as Real;
                }
                for p in 0..P {
                    law[p][e[side]] = m.law[p] as Real;
                }
            }
            entries.push(e.map(|e| e as u32));
        }
        Some(Self { first, rows: count, start, neighbour: Index::new(neighbour, rows)?, rest, law, stiffness, damping, entries })
    }

    fn slices(&self) -> usize {
        self.start.len() - 1
    }
}

impl<E: Pair<M, D>, Y: Law<P>, const M: usize, const D: usize, const P: usize> Pairs<E, Y, M, D, P> {
    /// Springs over rows 0..rows; `None` if an end is not one of them. `limits` are the strains at which springs break
    /// (infinite: never), or empty.
    pub fn new(rows: usize, members: &[Members<2, D, P>], limits: &[f64]) -> Option<Self> {
        let limits: Vec<Real> = if limits.iter().any(|l| l.is_finite()) { limits.iter().map(|l| *l as Real).collect() } else { Vec::new() };
        Some(Self {
            list: List::new(rows, members)?,
            lists: Neighbours::new(rows, members)?,
            cache: Vec::new(),
            limits,
            broken: Vec::new(),
        })
    }

    fn set_stiffness(&mut self, spring: u32, stiffness: Real, damping: Real) {
        let e = spring as usize;
        self.list.stiffness[e] = stiffness;
        self.list.damping[e] = damping;
        for entry in self.lists.entries[e] {
            self.lists.stiffness[entry as usize] = stiffness;
            self.lists.damping[entry as usize] = damping;
        }
    }

    fn tear(&mut self, spring: u32) {
        let e = spring as usize;
        self.broken.push(Broken { spring, stiffness: self.list.stiffness[e], damping: self.list.damping[e] });
        self.set_stiffness(spring, 0.0, 0.0);
    }

    fn strain_of(&self, x: &[Row], e: usize) -> Real {
        let ends = [0, 1].map(|a| xyz(x[self.list.nodes[a].get()[e] as usize]));
        E::strain(std::array::from_fn(|d| self.list.rest[d][e]), (ends[1] - ends[0]).norm())
    }

    /// Runs `f(slice, out of its rows)` over all slices, in parallel by fixed groups.
    fn slices<T: Send>(&self, out: &mut [T], f: impl Fn(std::ops::Range<usize>, &mut [T]) + Sync) {
        let (first, rows) = (self.lists.first, self.lists.rows);
        chunks(&mut out[first..first + rows], |start, out| f(start / SLICE..(start + out.len()).div_ceil(SLICE), out));
    }
}

/// Calls `$body` for every pack of rows of a range of slices: `$i` is the pack's first row within the lists, `$lane` its
/// place in the slice. The last, short slice goes row by row.
macro_rules! row_packs {
    ($width:ident, $w:ident, $slices:expr, $rows:expr, |$slice:ident, $lane:ident| $body:expr) => {{
        for $slice in $slices.clone() {
            if ($slice + 1) * SLICE <= $rows {
                let mut $lane = 0;
                while $lane < SLICE {
                    $body;
                    $lane += $width::N;
                }
            }
        }
        let last = $slices.end.max(1) - 1;
        if $slices.contains(&last) && (last + 1) * SLICE > $rows {
            let $w = Scalar;
            let $slice = last;
            for $lane in 0..$rows - last * SLICE {
                $body;
            }
        }
    }};
}

struct Gather<'a, E, Y, const M: usize, const D: usize, const P: usize> {
    lists: &'a Neighbours<D, P>,
    slices: std::ops::Range<usize>,
    x: &'a [Row],
    v: Option<&'a [Row]>,
    out: &'a mut [Row],
    kind: std::marker::PhantomData<(E, Y)>,
}

impl<E: Pair<M, D>, Y: Law<P>, const M: usize, const D: usize, const P: usize> Gather<'_, E, Y, M, D, P> {
    /// The force on the rows of one pack from all their neighbours.
    #[inline(always)]
    fn pack<W: Width>(&mut self, w: W, slice: usize, lane: usize) {
        let lists = self.lists;
        let i = slice * SLICE + lane;
        let here = w.rows(self.x, lists.first + i);
        let zero = w.splat(0.0);
        let mut sum = Vec3 { x: zero, y: zero, z: zero };
        let mut entry = lists.start[slice] as usize + lane;
        while entry < lists.start[slice + 1] as usize {
            let index = &lists.neighbour.get()[entry..];
            // SAFETY: `check` has been called on x and v.
            let there = unsafe { w.gather(self.x, index) };
            let (mut rest, mut law) = ([zero; D], [zero; P]);
            for d in 0..D {
                rest[d] = w.load(&lists.rest[d][entry..]);
            }
            for p in 0..P {
                law[p] = w.load(&lists.law[p][entry..]);
            }
            let damping = match self.v {
                Some(v) => {
                    let [x, y, z, _] = w.rows(v, lists.first + i);
                    // SAFETY: as above.
                    let [a, b, c, _] = unsafe { w.gather(v, index) };
                    Some((w.load(&lists.damping[entry..]), [Vec3 { x, y, z }, Vec3 { x: a, y: b, z: c }]))
                }
                None => None,
            };
            let [f, _] = forces::<E, Y, _, 2, M, D, P>(w.load(&lists.stiffness[entry..]), law, rest, [here, there], damping);
            sum = sum + f;
            entry += SLICE;
        }
        let at = i - self.slices.start * SLICE;
        let [x, y, z, _] = w.rows(self.out, at);
        w.scatter([x + sum.x, y + sum.y, z + sum.z, zero], self.out, at, 1);
    }
}

impl<E: Pair<M, D>, Y: Law<P>, const M: usize, const D: usize, const P: usize> Kernel for Gather<'_, E, Y, M, D, P> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(mut self, w: W) {
        let (slices, rows) = (self.slices.clone(), self.lists.rows);
        row_packs!(W, w, slices, rows, |slice, lane| self.pack(w, slice, lane));
    }
}

/// out += sum over neighbours of (q . (u_i - u_j)) q + s (u_i - u_j), with q and s cached.
struct Product<'a, const D: usize, const P: usize> {
    lists: &'a Neighbours<D, P>,
    cache: &'a [Row],
    slices: std::ops::Range<usize>,
    u: &'a [Row],
    out: &'a mut [Row],
}

impl<const D: usize, const P: usize> Product<'_, D, P> {
    #[inline(always)]
    fn pack<W: Width>(&mut self, w: W, slice: usize, lane: usize) {
        let lists = self.lists;
        let i = slice * SLICE + lane;
        let [ux, uy, uz, _] = w.rows(self.u, lists.first + i);
        let zero = w.splat(0.0);
        let mut sum = Vec3 { x: zero, y: zero, z: zero };
        let mut entry = lists.start[slice] as usize + lane;
        while entry < lists.start[slice + 1] as usize {
            // SAFETY: `check` has been called on u.
            let [x, y, z, _] = unsafe { w.gather(self.u, &lists.neighbour.get()[entry..]) };
            let d = Vec3 { x: ux - x, y: uy - y, z: uz - z };
            let [qx, qy, qz, s] = w.rows(self.cache, entry);
            let q = Vec3 { x: qx, y: qy, z: qz };
            sum = sum + q * q.dot(d) + d * s;
            entry += SLICE;
        }
        let at = i - self.slices.start * SLICE;
        let [x, y, z, _] = w.rows(self.out, at);
        w.scatter([x + sum.x, y + sum.y, z + sum.z, zero], self.out, at, 1);
    }
}

impl<const D: usize, const P: usize> Kernel for Product<'_, D, P> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(mut self, w: W) {
        let (slices, rows) = (self.slices.clone(), self.lists.rows);
        row_packs!(W, w, slices, rows, |slice, lane| self.pack(w, slice, lane));
    }
}

impl<E: Pair<M, D>, Y: Law<P>, const M: usize, const D: usize, const P: usize> Batch for Pairs<E, Y, M, D, P> {
    fn name(&self) -> &'static str {
        E::NAME
    }

    fn len(&self) -> usize {
        self.list.len()
    }

    fn energy(&self, x: &[Row]) -> f64 {
        self.list.energy(x)
    }

    fn add_forces(&mut self, x: &[Row], v: &[Row], force: &mut [Row]) {
        self.list.check(&[x, v, force]);
        let v = self.list.damped.then_some(v);
        self.slices(force, |slices, out| {
            dispatch(Gather::<E, Y, M, D, P> { lists: &self.lists, slices, x, v, out, kind: std::marker::PhantomData });
        });
    }

    fn linearize(&mut self, x: &[Row], weights: Weights) {
        self.list.check(&[x]);
        self.list.weights = weights;
        let mut cache = std::mem::take(&mut self.cache);
        cache.resize(self.lists.stiffness.len(), ZERO);
        let (lists, exact) = (&self.lists, weights.hessian == Hessian::Exact);
        let fill = |slice: usize, cache: &mut [Row]| {
            let base = lists.start[slice] as usize;
            for (k, q) in cache.iter_mut().enumerate() {
                let entry = base + k;
                // Padding reads the last row again where the last slice is short; its stiffness is zero.
                let i = (slice * SLICE + k % SLICE).min(lists.rows - 1);
                let d = xyz(x[lists.neighbour.get()[entry] as usize]) - xyz(x[lists.first + i]);
                let (k, b) = (weights.stiffness * lists.stiffness[entry], weights.damping * lists.damping[entry]);
                let rest = std::array::from_fn(|d| lists.rest[d][entry]);
                let law = std::array::from_fn(|p| lists.law[p][entry]);
                let (n, s) = E::stiffness::<Y, Real, P>(k, b, law, rest, d, exact);
                *q = [n.x, n.y, n.z, s];
            }
        };
        let mut parts = Vec::with_capacity(lists.slices());
        let mut left = &mut cache[..];
        for slice in 0..lists.slices() {
            let (part, rest) = left.split_at_mut((lists.start[slice + 1] - lists.start[slice]) as usize);
            parts.push((slice, part));
            left = rest;
        }
        parts.into_par_iter().with_min_len(64).for_each(|(slice, part)| fill(slice, part));
        self.cache = cache;
    }

    fn add_product(&mut self, _x: &[Row], u: &[Row], out: &mut [Row]) {
        self.list.check(&[u, out]);
        self.slices(out, |slices, out| dispatch(Product { lists: &self.lists, cache: &self.cache, slices, u, out }));
    }

    fn add_diagonal(&mut self, _x: &[Row], blocks: &mut [Block]) {
        let (lists, cache) = (&self.lists, &self.cache);
        self.slices(blocks, |slices, out| {
            for (k, block) in out.iter_mut().enumerate() {
                let slice = slices.start + k / SLICE;
                let mut entry = lists.start[slice] as usize + k % SLICE;
                while entry < lists.start[slice + 1] as usize {
                    let [x, y, z, s] = cache[entry];
                    let terms = [x * x + s, y * y + s, z * z + s, x * y, y * z, z * x];
                    for c in 0..6 {
                        block[c] += terms[c];
                    }
                    entry += SLICE;
                }
            }
        });
    }

    fn entries(&self, x: &[Row], sink: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        // The cached form, so that a factorized matrix is that of the products.
        let exact = self.list.weights.hessian == Hessian::Exact;
        for e in 0..self.len() {
            let [i, j] = [0, 1].map(|a| self.list.nodes[a].get()[e] as usize);
            let (k, b) = (self.list.weights.stiffness * self.list.stiffness[e], self.list.weights.damping * self.list.damping[e]);
            let rest = std::array::from_fn(|d| self.list.rest[d][e]);
            let law = std::array::from_fn(|p| self.list.law[p][e]);
            let (n, s) = E::stiffness::<Y, Real, P>(k, b, law, rest, xyz(x[j]) - xyz(x[i]), exact);
            let n: [Real; 3] = n.into();
            let mut block = [[0.0; 3]; 3];
            for r in 0..3 {
                for c in 0..3 {
                    block[r][c] = f64::from(n[r]) * f64::from(n[c]) + if r == c { f64::from(s) } else { 0.0 };
                }
            }
            let minus = block.map(|row| row.map(|v| -v));
            sink(i, i, block);
            sink(j, j, block);
            sink(i, j, minus);
            sink(j, i, minus);
        }
    }

    fn project(&mut self, x: &mut [Row], h: f64) {
        self.list.project(x, h);
    }

    fn link_strain(&self, x: &[Row]) -> Vec<Real> {
        self.list.check(&[x]);
        let mut strain = fold(self.len(), |range| range.map(|e| self.strain_of(x, e)).collect::<Vec<_>>()).concat();
        for broken in &self.broken {
            strain[broken.spring as usize] = Real::NAN;
        }
        strain
    }

    fn break_links(&mut self, x: &[Row]) -> u64 {
        if self.limits.is_empty() {
            return 0;
        }
        self.list.check(&[x]);
        let beyond =
            |e: &usize| self.strain_of(x, *e).abs() > self.limits[*e] && (self.list.stiffness[*e] > 0.0 || self.list.damping[*e] > 0.0);
        let found = fold(self.len(), |range| range.filter(beyond).collect::<Vec<_>>()).concat();
        for e in &found {
            self.tear(*e as u32);
        }
        found.len() as u64
    }

    fn broken(&self) -> Vec<u32> {
        self.broken.iter().map(|b| b.spring).collect()
    }

    fn set_broken(&mut self, broken: &[u32]) {
        for mended in std::mem::take(&mut self.broken) {
            self.set_stiffness(mended.spring, mended.stiffness, mended.damping);
        }
        for spring in broken {
            self.tear(*spring);
        }
    }
}
