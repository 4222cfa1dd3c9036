//! Many elements of one kind behind one small trait, so that no system knows which kinds there are.

use super::list::{List, Members, Weights, unit};
use super::{Element, Law};
use crate::linalg::blocks::Block;
use crate::math::parallel::{CHUNK, Tasks, chunks, fold};
use crate::math::simd::{Index, Kernel, Width, dispatch, packs};
use crate::math::{Real, Row, ZERO, add};
use std::ops::Range;

/// Elements of one kind. Rows of `x` are points and frames; rows of everything else hold three numbers per node.
pub trait Batch: Send + Sync {
    /// Name of the kind.
    fn name(&self) -> &'static str;
    /// Count of elements.
    fn len(&self) -> usize;
    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Potential energy [J], zero at rest (or far apart).
    fn energy(&self, x: &[Row]) -> f64;
    /// The same at a time [s], of elements that change in time.
    fn energy_at(&self, _t: f64, x: &[Row]) -> f64 {
        self.energy(x)
    }
    /// Whether that energy is stored in a deformation; else it counts among those of forces.
    fn is_elastic(&self) -> bool {
        true
    }
    /// For a force that drives: the energy up to which it may bring the masses [J]. Energy then does not have to come from anywhere.
    fn drives(&self) -> Option<f64> {
        None
    }
    /// Whether it depends on velocities in a way that its matrix at rest does not tell.
    fn feels_velocity(&self) -> bool {
        false
    }
    /// From now on the forces act on velocities for h [s] at once: they must not carry them beyond where they would come to rest.
    fn act_at_once(&mut self, _h: f64) {}
    /// The rows of the objects that it acts between have changed, those of the others that it names, and what they weigh.
    fn renew(&mut self, _on: Vec<Range<usize>>, _others: Option<Vec<Range<usize>>>, _masses: &crate::state::Masses) {}
    /// The solids around it have changed.
    fn take_surfaces(&mut self, _solids: &std::sync::Arc<Vec<crate::geometry::Collider>>) {}
    /// Prepares the forces at (t, x, v): what has to be known of all elements before rows can be summed.
    fn begin_forces(&mut self, _t: f64, _x: &[Row], _v: &[Row]) {}
    /// Adds the forces [N] and torques [N m], internal damping included, on the rows from `start` on, a multiple of CHUNK.
    /// x and v are those of all rows, as begun with.
    fn add_forces(&self, x: &[Row], v: &[Row], start: usize, force: &mut [Row]);
    /// For estimates: the next matrix is to be the stiffest of elements that change in time.
    fn foresee(&mut self, _x: &[Row]) {}
    /// Prepares products with the matrix at x.
    fn linearize(&mut self, x: &[Row], weights: Weights);
    /// Prepares the product with u.
    fn begin_product(&mut self, _x: &[Row], _u: &[Row]) {}
    /// Adds (K and D, weighted as linearized) u to the rows from `start` on, a multiple of CHUNK; u is as begun with.
    fn add_product(&self, u: &[Row], start: usize, out: &mut [Row]);
    /// Adds the diagonal blocks of the matrix.
    fn add_diagonal(&mut self, x: &[Row], blocks: &mut [Block]);
    /// Gives every block of the matrix, as row, column and entries; both triangles.
    fn entries(&self, x: &[Row], sink: &mut dyn FnMut(usize, usize, [[f64; 3]; 3]));
    /// Lengthening over rest length of every element that is a link.
    fn link_strain(&self, _x: &[Row]) -> Vec<Real> {
        Vec::new()
    }
    /// The rows of their ends.
    fn link_ends(&self) -> Vec<[u32; 2]> {
        Vec::new()
    }
    /// The largest lengthening of links, pieces of rods and edges of membranes and fabrics over rest length; negative infinity if there is none.
    fn largest_strain(&self, _x: &[Row]) -> f64 {
        f64::NEG_INFINITY
    }
    /// The element of the largest lengthening, by how much, and its first two rows.
    fn most_strained(&self, _x: &[Row]) -> Option<(f64, [u32; 2])> {
        None
    }
    /// Breaks the links that are strained beyond their limit; returns how many.
    fn break_links(&mut self, _x: &[Row]) -> u64 {
        0
    }
    /// Which links have broken, as indices.
    fn broken(&self) -> Vec<u32> {
        Vec::new()
    }
    /// Puts nodes of elements, as (element, node), onto other rows.
    fn rewire(&mut self, _changes: &[(u32, usize, u32)]) {}
    /// Breaks elements for good.
    fn break_elements(&mut self, _elements: &[u32]) {}
    /// Mends all links, then breaks these.
    fn set_broken(&mut self, _broken: &[u32]) {}
}

/// For every row, the slots (element times N plus node) that act on it.
pub struct Incidence {
    first: usize,
    start: Vec<u32>,
    slot: Vec<u32>,
}

impl Incidence {
    /// Of elements with these nodes.
    pub fn new<const N: usize>(nodes: &[Index; N]) -> Self {
        let all = || nodes.iter().flat_map(|i| i.get().iter().copied());
        let (first, last) = all().fold((u32::MAX, 0), |(a, b), i| (a.min(i), b.max(i)));
        let rows = if first > last { 0 } else { (last - first + 1) as usize };
        let first = if rows == 0 { 0 } else { first as usize };
        let mut start = vec![0_u32; rows + 1];
        for i in all() {
            start[i as usize - first + 1] += 1;
        }
        for i in 0..rows {
            start[i + 1] += start[i];
        }
        let (mut next, mut slot) = (start.clone(), vec![0; start[rows] as usize]);
        for e in 0..nodes[0].get().len() {
            for (a, index) in nodes.iter().enumerate() {
                let row = index.get()[e] as usize - first;
                slot[next[row] as usize] = (e * N + a) as u32;
                next[row] += 1;
            }
        }
        Self { first, start, slot }
    }

    /// Calls `f(row, its number, its slots in order)` for the rows from `start` on that have any.
    pub fn rows<O>(&self, start: usize, out: &mut [O], f: impl Fn(usize, &mut O, &[u32])) {
        let end = (start + out.len()).min(self.first + self.start.len() - 1);
        for row in start.max(self.first)..end {
            let i = row - self.first;
            f(row, &mut out[row - start], &self.slot[self.start[i] as usize..self.start[i + 1] as usize]);
        }
    }

    /// out[row] += the sum of its slots, in slot order, for the rows from `start` on.
    fn add<T: Copy, O>(&self, slots: &[T], start: usize, out: &mut [O], add: impl Fn(&mut O, T)) {
        let end = (start + out.len()).min(self.first + self.start.len() - 1);
        for row in start.max(self.first)..end {
            let i = row - self.first;
            for s in &self.slot[self.start[i] as usize..self.start[i + 1] as usize] {
                add(&mut out[row - start], slots[*s as usize]);
            }
        }
    }
}

/// Elements whose forces are computed element by element into slots, then summed row by row in a fixed order: no
/// colours, no races.
pub struct Elements<E, Y, const N: usize, const M: usize, const D: usize, const P: usize> {
    list: List<E, Y, N, M, D, P>,
    incidence: Incidence,
    slots: Vec<Row>,
    energy_at_rest: f64,
    /// Broken elements, with the stiffness and damping that would mend each.
    broken: Vec<(u32, Real, Real)>,
}

impl<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize> Elements<E, Y, N, M, D, P> {
    /// Elements over rows 0..rows; `None` if a node is not one of them.
    pub fn new(rows: usize, members: &[Members<N, D, P>]) -> Option<Self> {
        let list = List::new(rows, members)?;
        Some(Self {
            incidence: Incidence::new(&list.nodes),
            slots: vec![ZERO; N * members.len()],
            energy_at_rest: 0.0,
            broken: Vec::new(),
            list,
        })
    }

    /// Elements that hold this energy [J] at rest; it is left out of the ledger.
    pub fn with_energy_at_rest(mut self, energy: f64) -> Self {
        self.energy_at_rest = energy;
        self
    }

    /// Calls `f(list, range, slots)` for every chunk of elements.
    fn fill(&mut self, f: impl Fn(&List<E, Y, N, M, D, P>, Range<usize>, &mut [Row]) + Sync) {
        let list = &self.list;
        self.slots.chunks_mut(N * CHUNK).enumerate().in_parallel(|(i, slots)| f(list, i * CHUNK..((i + 1) * CHUNK).min(list.len()), slots));
    }
}

struct Forces<'a, E, Y, const N: usize, const M: usize, const D: usize, const P: usize> {
    list: &'a List<E, Y, N, M, D, P>,
    range: Range<usize>,
    x: &'a [Row],
    v: Option<&'a [Row]>,
    slots: &'a mut [Row],
}

impl<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize> Kernel
    for Forces<'_, E, Y, N, M, D, P>
{
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        packs!(W, w, self.range, |e| {
            let p = self.list.pack(w, e);
            let rows = self.list.rows(w, self.x, e);
            let damping = match self.v {
                Some(v) => Some((p.damping, self.list.vectors(w, v, e))),
                None => None,
            };
            let f = super::forces::<E, Y, _, N, M, D, P>(p.stiffness, p.law, p.rest, rows, damping);
            for a in 0..N {
                w.scatter([f[a].x, f[a].y, f[a].z, w.splat(0.0)], self.slots, (e - self.range.start) * N + a, N);
            }
        }, else Self { range: e..self.range.end, slots: &mut self.slots[(e - self.range.start) * N..], ..self });
    }
}

/// What the matrices of elements are multiplied with.
#[derive(Clone, Copy)]
enum Factor<'a> {
    /// A vector at every row.
    Rows(&'a [Row]),
    /// In every element one of length 1 at that node, along that axis.
    Unit(usize, usize),
}

struct Products<'a, E, Y, const N: usize, const M: usize, const D: usize, const P: usize> {
    list: &'a List<E, Y, N, M, D, P>,
    range: Range<usize>,
    x: &'a [Row],
    u: Factor<'a>,
    slots: &'a mut [Row],
}

impl<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize> Kernel
    for Products<'_, E, Y, N, M, D, P>
{
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        packs!(W, w, self.range, |e| {
            let p = self.list.pack(w, e);
            let rows = self.list.rows(w, self.x, e);
            let u = match self.u {
                Factor::Rows(u) => self.list.vectors(w, u, e),
                Factor::Unit(a, c) => unit(w, a, c),
            };
            let f = self.list.product(&p, rows, u);
            for a in 0..N {
                w.scatter([f[a].x, f[a].y, f[a].z, w.splat(0.0)], self.slots, (e - self.range.start) * N + a, N);
            }
        }, else Self { range: e..self.range.end, slots: &mut self.slots[(e - self.range.start) * N..], ..self });
    }
}

/// The 3 x 3 blocks on the diagonal for the elements of a range: N blocks an element, as xx, yy, zz, xy, yz, zx.
fn diagonal<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize>(
    list: &List<E, Y, N, M, D, P>,
    x: &[Row],
    range: Range<usize>,
) -> Vec<Block> {
    // As many elements as leave their products in a cache.
    const FEW: usize = 256;
    let mut blocks = vec![[0.0; 6]; N * range.len()];
    let mut products = vec![ZERO; N * FEW.min(range.len())];
    for (start, blocks) in range.clone().step_by(FEW).zip(blocks.chunks_mut(N * FEW)) {
        let few = start..(start + FEW).min(range.end);
        for (a, c) in (0..N).flat_map(|a| (0..3).map(move |c| (a, c))) {
            dispatch(Products { list, range: few.clone(), x, u: Factor::Unit(a, c), slots: &mut products });
            for (block, product) in blocks.iter_mut().zip(&products).skip(a).step_by(N) {
                match c {
                    0 => (block[0], block[5]) = (product[0], product[2]),
                    1 => (block[1], block[3]) = (product[1], product[0]),
                    _ => (block[2], block[4]) = (product[2], product[1]),
                }
            }
        }
    }
    blocks
}

impl<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize> Batch for Elements<E, Y, N, M, D, P> {
    fn name(&self) -> &'static str {
        E::NAME
    }

    fn len(&self) -> usize {
        self.list.len()
    }

    fn energy(&self, x: &[Row]) -> f64 {
        self.list.energy(x) - self.energy_at_rest
    }

    fn largest_strain(&self, x: &[Row]) -> f64 {
        self.list.largest_strain(x)
    }

    fn most_strained(&self, x: &[Row]) -> Option<(f64, [u32; 2])> {
        self.list.most_strained(x)
    }

    fn begin_forces(&mut self, _t: f64, x: &[Row], v: &[Row]) {
        self.list.check(&[x, v]);
        let v = self.list.damped.then_some(v);
        self.fill(|list, range, slots| dispatch(Forces { list, range, x, v, slots }));
    }

    fn add_forces(&self, _x: &[Row], _v: &[Row], start: usize, force: &mut [Row]) {
        self.incidence.add(&self.slots, start, force, |o, f| *o = add(*o, f));
    }

    fn linearize(&mut self, _x: &[Row], weights: Weights) {
        self.list.weights = weights;
    }

    fn begin_product(&mut self, x: &[Row], u: &[Row]) {
        self.list.check(&[x, u]);
        self.fill(|list, range, slots| dispatch(Products { list, range, x, u: Factor::Rows(u), slots }));
    }

    fn add_product(&self, _u: &[Row], start: usize, out: &mut [Row]) {
        self.incidence.add(&self.slots, start, out, |o, f| *o = add(*o, f));
    }

    fn add_diagonal(&mut self, x: &[Row], blocks: &mut [Block]) {
        self.list.check(&[x]);
        let slots = fold(self.len(), |range| diagonal(&self.list, x, range)).concat();
        chunks(blocks, |start, blocks| {
            self.incidence.add(&slots, start, blocks, |o, f: Block| {
                for i in 0..6 {
                    o[i] += f[i];
                }
            });
        });
    }

    fn entries(&self, x: &[Row], sink: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        self.list.entries(x, sink);
    }

    fn rewire(&mut self, changes: &[(u32, usize, u32)]) {
        if changes.is_empty() {
            return;
        }
        for (element, node, row) in changes {
            self.list.nodes[*node].set(*element as usize, *row);
        }
        self.incidence = Incidence::new(&self.list.nodes);
    }

    fn break_elements(&mut self, elements: &[u32]) {
        for e in elements {
            let (k, b) = (&mut self.list.stiffness[*e as usize], &mut self.list.damping[*e as usize]);
            if *k != 0.0 || *b != 0.0 {
                self.broken.push((*e, *k, *b));
                (*k, *b) = (0.0, 0.0);
            }
        }
    }

    fn broken(&self) -> Vec<u32> {
        self.broken.iter().map(|b| b.0).collect()
    }

    fn set_broken(&mut self, broken: &[u32]) {
        for (e, stiffness, damping) in std::mem::take(&mut self.broken) {
            (self.list.stiffness[e as usize], self.list.damping[e as usize]) = (stiffness, damping);
        }
        self.break_elements(broken);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elements::{Distance, Linear};
    use tumble_interface::scene::Hessian;

    /// Products on wide registers, in runs of a few hundred elements and what is left of them, give the blocks that one element after the other
    /// has, bit by bit.
    #[test]
    fn the_diagonal_is_that_of_the_entries() {
        let n = 601_u32;
        let wave = |i: u32, k: f64| (k * f64::from(i)).sin();
        let x: Vec<Row> = (0..=n).map(|i| [wave(i, 1.3), wave(i, 0.7), wave(i, 2.1), 1.0].map(|c| c as Real)).collect();
        let spring = |i: u32| Members { nodes: [i, i + 1], rest: [0.3], law: [], stiffness: 2.0 + wave(i, 0.9), damping: 0.1 };
        let mut springs = Elements::<Distance, Linear, 2, 1, 1, 0>::new(x.len(), &(0..n).map(spring).collect::<Vec<_>>()).unwrap();
        for hessian in [Hessian::Exact, Hessian::Definite] {
            springs.linearize(&x, Weights { stiffness: 0.7, damping: 3.0, hessian });
            let mut found = vec![[0.0; 6]; x.len()];
            springs.add_diagonal(&x, &mut found);
            let mut exact = vec![[0.0; 6]; x.len()];
            springs.entries(&x, &mut |i, j, m| {
                if i == j {
                    let own = [m[0][0], m[1][1], m[2][2], m[0][1], m[1][2], m[2][0]];
                    exact[i].iter_mut().zip(own).for_each(|(sum, k)| *sum += k as Real);
                }
            });
            assert_eq!(found, exact, "{hessian:?}");
            assert!(found.iter().all(|block| block.iter().all(|k| *k != 0.0)), "nothing is stiff");
        }
    }
}
