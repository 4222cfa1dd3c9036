//! Elements between two points, gathered: every point sums over its own list of neighbours. Each spring is evaluated from
//! both ends, which costs arithmetic and saves the pass through memory, and the two evaluations are exact opposites.

use super::batch::Batch;
use super::list::{List, Members, Weights};
use super::neighbours::{Columns, Neighbours, SLICE};
use super::{Distance, Element, Law, Vector};
use crate::linalg::blocks::Block;
use crate::math::parallel::{Tasks, chunks, fold, worst};
use crate::math::simd::{Kernel, Scalar, Width, dispatch, largest, packs};
use crate::math::{Lane, Real, Row, Vec3, xyz};
use std::marker::PhantomData;
use std::ops::Range;
use tumble_interface::scene::Hessian;

/// An element between two points that is the same seen from either end, and whose matrix is c n n^T + s I with n along
/// the line between them.
pub trait Pair<const M: usize, const D: usize>: Element<2, M, D> {
    /// sqrt(c) n and s for stiffness k and damping b, from d = x1 - x0. `exact` keeps a negative s.
    fn stiffness<Y: Law<P>, L: Lane, const P: usize>(k: L, b: L, law: [L; P], rest: [L; D], d: Vec3<L>, exact: bool) -> (Vec3<L>, L);

    /// The force on x0 for stiffness k, from d = x1 - x0 and, with damping b, its rate of change: what `forces` derives,
    /// with one division.
    fn pull<Y: Law<P>, L: Lane, const P: usize>(k: L, law: [L; P], rest: [L; D], d: Vec3<L>, damping: Option<(L, Vec3<L>)>) -> Vec3<L>;

    /// Lengthening over rest length at the length l; NaN if the pair has no rest length.
    fn strain<L: Lane>(rest: [L; D], length: L) -> L;
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

    #[inline(always)]
    fn pull<Y: Law<P>, L: Lane, const P: usize>(k: L, law: [L; P], [l]: [L; 1], d: Vec3<L>, damping: Option<(L, Vec3<L>)>) -> Vec3<L> {
        let length = d.norm();
        let n = d * length.positive(length.like(1.0) / length, length.zero());
        let mut stress = Y::stress(k, law, length - l);
        if let Some((b, rate)) = damping {
            stress = stress + b * n.dot(rate);
        }
        n * stress
    }

    #[inline(always)]
    fn strain<L: Lane>([l]: [L; 1], length: L) -> L {
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

    #[inline(always)]
    fn pull<Y: Law<P>, L: Lane, const P: usize>(k: L, law: [L; P], _: [L; 0], d: Vec3<L>, damping: Option<(L, Vec3<L>)>) -> Vec3<L> {
        let stress = Vec3 { x: Y::stress(k, law, d.x), y: Y::stress(k, law, d.y), z: Y::stress(k, law, d.z) };
        match damping {
            Some((b, rate)) => stress + rate * b,
            None => stress,
        }
    }

    #[inline(always)]
    fn strain<L: Lane>(_: [L; 0], length: L) -> L {
        length.like(f64::NAN)
    }
}

/// Springs between points.
pub struct Pairs<E, Y, const M: usize, const D: usize, const P: usize> {
    list: List<E, Y, 2, M, D, P>,
    lists: Neighbours<D, P>,
    /// Positions, or what a product is taken with, and velocities.
    columns: [Columns; 2],
    /// For products: sqrt(c) n and s, each for the sixteen entries of a slot in turn.
    cache: Vec<[[Real; SLICE]; 4]>,
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

impl<E: Pair<M, D>, Y: Law<P>, const M: usize, const D: usize, const P: usize> Pairs<E, Y, M, D, P> {
    /// Springs over rows 0..rows; `None` if an end is not one of them. `limits` are the strains at which springs break
    /// (infinite: never), or empty.
    pub fn new(rows: usize, members: &[Members<2, D, P>], limits: &[f64]) -> Option<Self> {
        let limits: Vec<Real> = if limits.iter().any(|l| l.is_finite()) { limits.iter().map(|l| *l as Real).collect() } else { Vec::new() };
        Some(Self {
            list: List::new(rows, members)?,
            lists: Neighbours::new(rows, members)?,
            columns: Default::default(),
            cache: Vec::new(),
            limits,
            broken: Vec::new(),
        })
    }

    fn set_stiffness(&mut self, spring: u32, stiffness: Real, damping: Real) {
        let e = spring as usize;
        self.list.stiffness[e] = stiffness;
        self.list.damping[e] = damping;
        self.lists.set(e, stiffness, damping);
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
    columns: &'a [Columns; 2],
    slices: Range<usize>,
    x: &'a [Row],
    v: Option<&'a [Row]>,
    out: &'a mut [Row],
    kind: PhantomData<(E, Y)>,
}

impl<E: Pair<M, D>, Y: Law<P>, const M: usize, const D: usize, const P: usize> Gather<'_, E, Y, M, D, P> {
    /// The force on the rows of one pack from all their neighbours.
    #[inline(always)]
    fn pack<W: Width>(&mut self, w: W, slice: usize, lane: usize) {
        let lists = self.lists;
        let i = slice * SLICE + lane;
        let zero = w.splat(0.0);
        let [x, y, z, _] = w.rows(self.x, lists.first + i);
        let here = Vec3 { x, y, z };
        let moving = match self.v {
            Some(v) => {
                let [x, y, z, _] = w.rows(v, lists.first + i);
                Some((v, Vec3 { x, y, z }))
            }
            None => None,
        };
        let mut sum = Vec3 { x: zero, y: zero, z: zero };
        for (start, slot) in lists.slots(slice) {
            let entry = start + lane;
            // SAFETY: `add_forces` has checked x, v and their columns.
            let d = unsafe { lists.load(w, self.x, &self.columns[0], slot, entry, lane) } - here;
            let p = lists.pack(w, slot, entry);
            let damping = match moving {
                Some((v, velocity)) => {
                    // SAFETY: as above.
                    let rate = unsafe { lists.load(w, v, &self.columns[1], slot, entry, lane) } - velocity;
                    Some((p.damping, rate))
                }
                None => None,
            };
            sum = sum + E::pull::<Y, _, P>(p.stiffness, p.law, p.rest, d, damping);
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

/// Fills the cache of a range of slices.
struct Linearize<'a, E, Y, const M: usize, const D: usize, const P: usize> {
    lists: &'a Neighbours<D, P>,
    weights: Weights,
    slices: Range<usize>,
    x: &'a [Row],
    cache: &'a mut [[[Real; SLICE]; 4]],
    kind: PhantomData<(E, Y)>,
}

impl<E: Pair<M, D>, Y: Law<P>, const M: usize, const D: usize, const P: usize> Linearize<'_, E, Y, M, D, P> {
    #[inline(always)]
    fn pack<W: Width>(&mut self, w: W, slice: usize, lane: usize) {
        let lists = self.lists;
        let [x, y, z, _] = w.rows(self.x, lists.first + slice * SLICE + lane);
        let here = Vec3 { x, y, z };
        let (scale_k, scale_b) = (w.splat(self.weights.stiffness), w.splat(self.weights.damping));
        for (start, slot) in lists.slots(slice) {
            let entry = start + lane;
            // SAFETY: `linearize` has checked x.
            let [x, y, z, _] = unsafe { w.gather(self.x, &lists.neighbour.get()[entry..]) };
            let p = lists.pack(w, slot, entry);
            let (k, b) = (scale_k * p.stiffness, scale_b * p.damping);
            let exact = self.weights.hessian == Hessian::Exact;
            let (q, s) = E::stiffness::<Y, _, P>(k, b, p.law, p.rest, Vec3 { x, y, z } - here, exact);
            let cached = &mut self.cache[(entry - lists.start[self.slices.start] as usize) / SLICE];
            w.store(q.x, &mut cached[0][lane..]);
            w.store(q.y, &mut cached[1][lane..]);
            w.store(q.z, &mut cached[2][lane..]);
            w.store(s, &mut cached[3][lane..]);
        }
    }
}

impl<E: Pair<M, D>, Y: Law<P>, const M: usize, const D: usize, const P: usize> Kernel for Linearize<'_, E, Y, M, D, P> {
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
    columns: &'a Columns,
    cache: &'a [[[Real; SLICE]; 4]],
    slices: Range<usize>,
    u: &'a [Row],
    out: &'a mut [Row],
}

impl<const D: usize, const P: usize> Product<'_, D, P> {
    #[inline(always)]
    fn pack<W: Width>(&mut self, w: W, slice: usize, lane: usize) {
        let lists = self.lists;
        let i = slice * SLICE + lane;
        let [x, y, z, _] = w.rows(self.u, lists.first + i);
        let here = Vec3 { x, y, z };
        let zero = w.splat(0.0);
        let mut sum = Vec3 { x: zero, y: zero, z: zero };
        for (start, slot) in lists.slots(slice) {
            // SAFETY: `add_product` has checked u and its columns.
            let d = here - unsafe { lists.load(w, self.u, self.columns, slot, start + lane, lane) };
            let cached = &self.cache[start / SLICE];
            let q = Vec3 { x: w.load(&cached[0][lane..]), y: w.load(&cached[1][lane..]), z: w.load(&cached[2][lane..]) };
            sum = sum + q * q.dot(d) + d * w.load(&cached[3][lane..]);
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

/// The largest strain of a range of springs.
struct LargestStrain<'a, E, Y, const M: usize, const D: usize, const P: usize> {
    list: &'a List<E, Y, 2, M, D, P>,
    range: Range<usize>,
    x: &'a [Row],
}

impl<E: Pair<M, D>, Y: Law<P>, const M: usize, const D: usize, const P: usize> Kernel for LargestStrain<'_, E, Y, M, D, P> {
    type Output = Real;
    #[inline(always)]
    fn run<W: Width>(self, w: W) -> Real {
        let mut most = Real::NEG_INFINITY;
        packs!(W, w, self.range, |e| {
            let p = self.list.pack(w, e);
            let [a, b] = self.list.vectors(w, self.x, e);
            most = largest(w, E::strain(p.rest, (b - a).norm()), most);
        });
        most
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

    fn begin_forces(&mut self, _t: f64, x: &[Row], v: &[Row]) {
        self.list.check(&[x, v]);
        self.lists.fill(&mut self.columns[0], x);
        if self.list.damped {
            self.lists.fill(&mut self.columns[1], v);
        }
    }

    fn add_forces(&self, x: &[Row], v: &[Row], start: usize, force: &mut [Row]) {
        self.list.check(&[x, v]);
        let v = self.list.damped.then_some(v);
        assert!(self.lists.has_filled(&self.columns[0]) && (v.is_none() || self.lists.has_filled(&self.columns[1])));
        let (slices, out) = self.lists.within(start, force);
        dispatch(Gather::<E, Y, M, D, P> { lists: &self.lists, columns: &self.columns, slices, x, v, out, kind: PhantomData });
    }

    fn linearize(&mut self, x: &[Row], weights: Weights) {
        self.list.check(&[x]);
        self.list.weights = weights;
        let lists = &self.lists;
        self.cache.clear();
        self.cache.resize(lists.stiffness.len() / SLICE, [[0.0; SLICE]; 4]);
        // Sixty-four slices at a time.
        let mut parts = Vec::new();
        let mut left = &mut self.cache[..];
        for first in (0..lists.slices()).step_by(64) {
            let slices = first..(first + 64).min(lists.slices());
            let entries = lists.start[slices.end] - lists.start[slices.start];
            let (part, rest) = left.split_at_mut(entries as usize / SLICE);
            parts.push((slices, part));
            left = rest;
        }
        parts.into_iter().in_parallel(|(slices, cache)| {
            dispatch(Linearize::<E, Y, M, D, P> { lists, weights, slices, x, cache, kind: PhantomData });
        });
    }

    fn begin_product(&mut self, _x: &[Row], u: &[Row]) {
        self.list.check(&[u]);
        self.lists.fill(&mut self.columns[0], u);
    }

    fn add_product(&self, u: &[Row], start: usize, out: &mut [Row]) {
        self.list.check(&[u]);
        assert!(self.lists.has_filled(&self.columns[0]));
        let (slices, out) = self.lists.within(start, out);
        dispatch(Product { lists: &self.lists, columns: &self.columns[0], cache: &self.cache, slices, u, out });
    }

    fn add_diagonal(&mut self, _x: &[Row], blocks: &mut [Block]) {
        let (lists, cache) = (&self.lists, &self.cache);
        chunks(blocks, |start, blocks| {
            let (slices, out) = lists.within(start, blocks);
            for (k, block) in out.iter_mut().enumerate() {
                let (slice, lane) = (slices.start + k / SLICE, k % SLICE);
                for slot in &cache[lists.start[slice] as usize / SLICE..lists.start[slice + 1] as usize / SLICE] {
                    let [x, y, z, s] = [0, 1, 2, 3].map(|c| slot[c][lane]);
                    let terms = [x * x + s, y * y + s, z * z + s, x * y, y * z, z * x];
                    for c in 0..6 {
                        block[c] += terms[c];
                    }
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

    fn link_strain(&self, x: &[Row]) -> Vec<Real> {
        self.list.check(&[x]);
        let mut strain = fold(self.len(), |range| range.map(|e| self.strain_of(x, e)).collect::<Vec<_>>()).concat();
        for broken in &self.broken {
            strain[broken.spring as usize] = Real::NAN;
        }
        strain
    }

    fn link_ends(&self) -> Vec<[u32; 2]> {
        (0..self.len()).map(|e| [0, 1].map(|a| self.list.nodes[a].get()[e])).collect()
    }

    fn largest_strain(&self, x: &[Row]) -> f64 {
        self.list.check(&[x]);
        let parts = match self.broken.is_empty() {
            true => fold(self.len(), |range| dispatch(LargestStrain { list: &self.list, range, x })),
            false => self.link_strain(x),
        };
        parts.into_iter().fold(f64::NEG_INFINITY, |m, s| m.max(f64::from(s)))
    }

    fn most_strained(&self, x: &[Row]) -> Option<(f64, [u32; 2])> {
        let strain = self.link_strain(x);
        let (e, most) = worst(strain.len(), |e| f64::from(strain[e]))?;
        Some((most, [0, 1].map(|a| self.list.nodes[a].get()[e])))
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

    fn rewire(&mut self, changes: &[(u32, usize, u32)]) {
        if changes.is_empty() {
            return;
        }
        for (element, node, row) in changes {
            self.list.nodes[*node].set(*element as usize, *row);
        }
        let list = &self.list;
        let member = |e: usize| Members {
            nodes: [0, 1].map(|a| list.nodes[a].get()[e]),
            rest: std::array::from_fn(|d| f64::from(list.rest[d][e])),
            law: std::array::from_fn(|p| f64::from(list.law[p][e])),
            stiffness: f64::from(list.stiffness[e]),
            damping: f64::from(list.damping[e]),
        };
        let members: Vec<Members<2, D, P>> = (0..list.len()).map(member).collect();
        if let Some(lists) = Neighbours::new(list.nodes[0].rows(), &members) {
            self.lists = lists;
        }
    }

    fn break_elements(&mut self, elements: &[u32]) {
        for e in elements {
            if self.list.stiffness[*e as usize] != 0.0 || self.list.damping[*e as usize] != 0.0 {
                self.tear(*e);
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elements::Linear;
    use crate::math::simd::{Level, dispatch_at};

    /// Forces, cache and product of a sheet with a few springs across it, on registers of one width.
    fn all(level: Level) -> (Vec<Row>, Vec<[[Real; SLICE]; 4]>, Vec<Row>) {
        let n = 16 * 9 + 5;
        let number = |i: usize, c: usize| ((i * 37 + c * 101) % 97) as Real * 0.01 - 0.4;
        let rows = |seed: usize| -> Vec<Row> { (0..n).map(|i| [number(i, seed), number(i, seed + 1), number(i, seed + 2), 0.0]).collect() };
        let (x, v) = (rows(1), rows(5));
        let spring = |a: usize, b: usize| Members { nodes: [a as u32, b as u32], rest: [0.3], law: [], stiffness: 3.0, damping: 0.2 };
        let members: Vec<Members<2, 1, 0>> = (0..n - 17)
            .filter(|i| i % 17 != 16)
            .flat_map(|i| [spring(i, i + 1), spring(i, i + 17)])
            .chain((0..20).map(|i| spring(i * 7, n - 1 - i)))
            .collect();
        let mut pairs = Pairs::<Distance, Linear, 1, 1, 0>::new(n, &members, &[]).unwrap();
        let (lists, slices) = (&pairs.lists, 0..pairs.lists.slices());
        assert!(lists.slices() == 10 && lists.rows == n);
        for (columns, rows) in pairs.columns.iter_mut().zip([&x, &v]) {
            lists.fill(columns, rows);
        }
        let (mut force, mut product) = (vec![[0.0; 4]; n], vec![[0.0; 4]; n]);
        let (columns, kind) = (&pairs.columns, PhantomData::<(Distance, Linear)>);
        dispatch_at(level, Gather { lists, columns, slices: slices.clone(), x: &x, v: Some(&v), out: &mut force, kind });
        let mut cache = vec![[[0.0; SLICE]; 4]; lists.stiffness.len() / SLICE];
        let weights = Weights { stiffness: 0.7, damping: 0.2, hessian: Hessian::Exact };
        dispatch_at(level, Linearize { lists, weights, slices: slices.clone(), x: &x, cache: &mut cache, kind });
        dispatch_at(level, Product { lists, columns: &columns[0], cache: &cache, slices, u: &x, out: &mut product });
        (force, cache, product)
    }

    #[test]
    fn every_width_gives_the_same_bits() {
        let one = all(Level::Scalar);
        assert!(one.0.iter().all(|f| f[0] != 0.0) && one.2.iter().any(|f| f[1] != 0.0));
        for level in Level::available() {
            assert_eq!(all(level), one, "{level:?}");
        }
    }
}
