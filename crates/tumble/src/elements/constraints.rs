//! Elements that a position-based method satisfies one after the other: Gauss-Seidel over colours, elements of one colour, which share no node, side
//! by side. Threads first take clusters, elements between rows that are near in memory, and go through all colours of one without waiting for others;
//! elements between clusters follow, colour by colour. The order of elements is fixed, and so are the bits, whatever the threads and registers.
//! Source: [bender2015], section 5; [macklin2016]. Verified in `tests/position_based.rs`.

use super::list::Members;
use super::{Compliance, Element, Law, corrected, energy, project};
use crate::geometry::Walls;
use crate::math::parallel::{self, Tasks, fold, worst};
use crate::math::simd::{Index, Kernel, Sum, Width, dispatch, packs};
use crate::math::{Lane, Quat, Real, Row, Vec3, xyz};
use chains::Chain;
use std::marker::PhantomData;
use std::ops::Range;

mod chains;
mod density;
mod neohookean;
mod shape;
mod strands;
mod volume;

pub use density::{Density, Frozen, Samples, behind, spline};
pub use neohookean::Neohookean;
pub use shape::{HELD, Shape};
pub use strands::Strands;
pub use volume::{Volume, enclosed};

/// Rows of a cluster: 64 KB in single precision.
const CLUSTER: usize = 4096;
/// Elements per task, of those between clusters.
const TASK: usize = 1024;
/// Chains per task.
const CHAINS: usize = 16;
/// Compliance of what has broken, and of a damper without stiffness [m/N]: nothing that is there feels it.
const LIMP: f64 = 1e18;

/// A sub-step, as elements see it.
#[derive(Debug, Clone, Copy)]
pub struct Projection<'a> {
    /// Its length [s].
    pub h: f64,
    /// Points and frames when it began, for damping.
    pub before: &'a [Row],
    /// Which sweep this is, from 0 on.
    pub iteration: u32,
    /// How many there are at most.
    pub iterations: u32,
    /// Of plain elements, whatever their stiffness, the share of the error that a sweep takes back.
    pub plain: Option<Real>,
    /// Solids that liquids meet, at its end.
    pub walls: Walls<'a>,
}

/// Elements of one kind that are projected.
pub trait Constraints: Send + Sync {
    /// Name of the kind.
    fn name(&self) -> &'static str;
    /// Count of elements.
    fn len(&self) -> usize;
    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Calls `join` with pairs of rows that connect all rows of each element; what has broken connects none.
    fn connect(&self, join: &mut dyn FnMut(u32, u32));
    /// One of its rows, where solids have pushed them in the sweeps of this sub-step.
    fn leans(&self) -> Option<usize> {
        None
    }
    /// The rows of a body whose shape is matched, and the share of the way to it that a sub-step of length h [s] takes; of plain elements, `plain`.
    fn matched(&self, _h: f64, _plain: Option<f64>) -> Option<(Range<usize>, f64)> {
        None
    }
    /// The liquid that they are, if they are one.
    fn liquid(&self) -> Option<&Density> {
        None
    }
    /// Puts bodies into the liquid that they are, if they are one.
    fn immerse(&mut self, _put: &mut dyn FnMut(&mut Density)) {}
    /// Of elements that drive: the energy that they may bring the masses [J].
    fn drives(&self) -> Option<f64> {
        None
    }
    /// Potential energy [J], zero at rest; nothing of rigid elements.
    fn energy(&self, x: &[Row], walls: Walls<'_>) -> f64;
    /// Corrects points and frames once, element by element; x[i][3] are inverse masses of points.
    fn project(&mut self, x: &mut [Row], step: &Projection<'_>);
    /// How many times as soft as they should be round-off makes the elements in sub-steps of length h [s], the worst of them; 1 is not at all.
    fn softening(&self, _h: f64) -> f64 {
        1.0
    }
    /// The longest sub-step [s] in which what hangs under this gravity [m/s²] does not shake; infinite if any is.
    fn longest_step(&self, _x: &[Row], _gravity: f64) -> f64 {
        f64::INFINITY
    }
    /// Adds the stiffness with which the elements hold each row [N/m].
    fn add_grip(&self, x: &[Row], grip: &mut [Real]);
    /// Lengthening over rest length of every element that is a link, in the order in which they were given.
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
    /// Gives a frame another inverse inertia [1/(kg m²)].
    fn set_inverse(&mut self, _frame: usize, _inverse: Real) {}
}

/// Rows that tasks write side by side, each others.
#[derive(Clone, Copy)]
struct Shared(*mut Row);

// SAFETY: whoever uses the pointer sees to it that no two tasks touch the same row.
unsafe impl Send for Shared {}
// SAFETY: as above.
unsafe impl Sync for Shared {}

impl Shared {
    fn rows(self) -> *mut Row {
        self.0
    }
}

/// Elements sorted by cluster, by colour, and by their first node within a colour, so that memory is walked through in order.
struct Columns<const N: usize, const D: usize, const P: usize> {
    nodes: [Index; N],
    rest: [Vec<Real>; D],
    law: [Vec<Real>; P],
    /// 1/k.
    compliance: Vec<Real>,
    /// Empty if nothing is damped.
    damping: Vec<Real>,
    /// Inverse inertias of frames [1/(kg m²)]; empty for points.
    inverse: [Vec<Real>; N],
    /// For every place of links, how many from there on, up to 255, have first nodes that lie one behind the other, and second ones that do,
    /// as on lattices; empty of others.
    runs: Vec<u8>,
    order: Order,
    /// For every place, which of the elements given stands there.
    given: Vec<u32>,
}

/// Nodes whose frames, the last ones, have length 1.
#[inline(always)]
fn unit_frames<L: Lane, const N: usize>(frames: usize, nodes: [[L; 4]; N]) -> [[L; 4]; N] {
    let mut out = nodes;
    for a in N - frames..N {
        out[a] = Quat::from_row(nodes[a]).normalized().row();
    }
    out
}

fn compliance(stiffness: f64) -> Real {
    (1.0 / stiffness).min(LIMP) as Real
}

impl<const N: usize, const D: usize, const P: usize> Columns<N, D, P> {
    /// `None` if a node is not one of the rows; `inverse` are the inverse inertias of frames, the rows from `points` on.
    /// The elements of `chains` stand at the end, in order and in no colour.
    fn new(rows: usize, points: usize, inverse: &[Real], members: &[Members<N, D, P>], chains: &[Range<usize>]) -> Option<Self> {
        let all: Vec<u32> = members.iter().flat_map(|m| m.nodes).collect();
        if all.iter().any(|i| *i as usize >= rows) || rows > points + inverse.len() {
            return None;
        }
        let (given, order) = sorted(rows, N, &all, chains);
        let of = |place: &u32| &members[*place as usize];
        let column = |f: &dyn Fn(&Members<N, D, P>) -> f64| -> Vec<Real> { given.iter().map(|e| f(of(e)) as Real).collect() };
        let mut nodes: [Index; N] = std::array::from_fn(|_| Index::default());
        for (a, index) in nodes.iter_mut().enumerate() {
            *index = node(a, N, &all, &given, rows)?;
        }
        let inverse = std::array::from_fn(|a| inverses(&nodes[a], points, inverse));
        let damped = members.iter().any(|m| m.damping != 0.0);
        Some(Self {
            runs: runs(&nodes),
            nodes,
            rest: std::array::from_fn(|d| column(&|m| m.rest[d])),
            law: std::array::from_fn(|p| column(&|m| m.law[p])),
            compliance: given.iter().map(|e| compliance(of(e).stiffness)).collect(),
            damping: if damped { column(&|m| m.damping) } else { Vec::new() },
            inverse,
            order,
            given,
        })
    }

    fn len(&self) -> usize {
        self.given.len()
    }

    /// For every element given, the place where it stands.
    fn places(&self) -> Vec<usize> {
        let mut places = vec![0; self.len()];
        self.given.iter().enumerate().for_each(|(place, given)| places[*given as usize] = place);
        places
    }

    /// Joins the nodes of each element that has not broken.
    fn connect(&self, join: &mut dyn FnMut(u32, u32)) {
        for e in (0..self.len()).filter(|e| self.compliance[*e] < LIMP as Real) {
            (1..N).for_each(|a| join(self.nodes[0].get()[e], self.nodes[a].get()[e]));
        }
    }

    /// Panics unless there are rows for the unchecked loads.
    fn check(&self, rows: &[Row]) {
        assert!(self.nodes.iter().all(|i| i.rows() <= rows.len()), "a column is shorter than the rows that elements use");
    }

    /// Rows of the nodes of a pack; the last `frames` are scaled to length 1.
    ///
    /// # Safety
    /// Nobody writes these rows, and `check` has been called on them.
    #[inline(always)]
    unsafe fn gather<W: Width>(&self, w: W, frames: usize, x: *const Row, e: usize) -> [[W::L; 4]; N] {
        // SAFETY: see above.
        unsafe { self.fetch::<W, false>(w, frames, x, e) }
    }

    /// The same; of a pack that is a `RUN`, in its order.
    ///
    /// # Safety
    /// As of `gather`.
    #[inline(always)]
    unsafe fn fetch<W: Width, const RUN: bool>(&self, w: W, frames: usize, x: *const Row, e: usize) -> [[W::L; 4]; N] {
        let mut out = [[w.splat(0.0); 4]; N];
        for a in 0..N {
            let index = &self.nodes[a].get()[e..];
            // SAFETY: see above.
            out[a] = unsafe { if RUN { w.rows_at(x, index[0]) } else { w.gather_at(x, index) } };
        }
        unit_frames(frames, out)
    }

    /// Whether a pack of links is one run.
    #[inline(always)]
    fn is_run<W: Width>(&self, _w: W, e: usize) -> bool {
        usize::from(self.runs[e]) >= W::N
    }

    /// Rest numbers and parameters of the law of a pack.
    #[inline(always)]
    fn pack<W: Width>(&self, w: W, e: usize) -> ([W::L; D], [W::L; P]) {
        let (mut rest, mut law) = ([w.splat(0.0); D], [w.splat(0.0); P]);
        for d in 0..D {
            rest[d] = w.load(&self.rest[d][e..]);
        }
        for p in 0..P {
            law[p] = w.load(&self.law[p][e..]);
        }
        (rest, law)
    }

    /// Calls `run(elements, their numbers)` for ranges of elements that share no node; `each` of the numbers belong to an element.
    fn sweep(&self, each: usize, numbers: &mut [Real], run: impl Fn(Range<usize>, &mut [Real]) + Sync) {
        let mut left = numbers;
        let mut take = |elements: usize| -> &mut [Real] {
            let (own, rest) = std::mem::take(&mut left).split_at_mut(each * elements);
            left = rest;
            own
        };
        let clusters = self.order.clusters.iter().map(|colors| (colors, take(colors.iter().map(Range::len).sum())));
        clusters.in_parallel(|(colors, numbers)| {
            let mut left = numbers;
            for color in colors {
                let (own, rest) = left.split_at_mut(each * color.len());
                left = rest;
                run(color.clone(), own);
            }
        });
        for color in &self.order.between {
            let own = take(color.len());
            let task = |t: usize| {
                let start = color.start + t * TASK;
                start..(start + TASK).min(color.end)
            };
            if color.len() <= TASK {
                run(color.clone(), own);
            } else if each == 0 {
                parallel::each(color.len().div_ceil(TASK), &|t| run(task(t), &mut []));
            } else {
                own.chunks_mut(each * TASK).enumerate().in_parallel(|(t, own)| run(task(t), own));
            }
        }
    }
}

/// The node number `a` of `n` of the elements given.
fn node(a: usize, n: usize, nodes: &[u32], given: &[u32], rows: usize) -> Option<Index> {
    Index::new(given.iter().map(|e| nodes[n * *e as usize + a]).collect(), rows)
}

/// Inverse inertias of nodes that are frames, the rows from `points` on; empty for points.
fn inverses(nodes: &Index, points: usize, inverse: &[Real]) -> Vec<Real> {
    let of_frame = |i: &u32| inverse.get((*i as usize).wrapping_sub(points)).copied();
    nodes.get().iter().map_while(of_frame).collect()
}

/// The `runs` of `Columns`.
fn runs<const N: usize>(nodes: &[Index; N]) -> Vec<u8> {
    let [first, second] = &nodes[..] else { return Vec::new() };
    let (first, second) = (first.get(), second.get());
    let mut runs = vec![1_u8; first.len()];
    for e in (1..runs.len()).rev() {
        if first[e - 1] + 1 == first[e] && second[e - 1] + 1 == second[e] {
            runs[e - 1] = runs[e].saturating_add(1);
        }
    }
    runs
}

/// Ranges of elements that share no node.
struct Order {
    /// The colours of each cluster; no element of one has a node of another.
    clusters: Vec<Vec<Range<usize>>>,
    /// The colours of what lies between clusters.
    between: Vec<Range<usize>>,
}

/// Elements of `n` nodes each, whose rows these are one element after the other, in the order in which they are satisfied.
fn sorted(rows: usize, n: usize, nodes: &[u32], chains: &[Range<usize>]) -> (Vec<u32>, Order) {
    let mut chained = vec![false; nodes.len() / n];
    chains.iter().for_each(|chain| chained[chain.clone()].fill(true));
    let mut inside: Vec<Vec<u32>> = vec![Vec::new(); rows.div_ceil(CLUSTER)];
    let mut between = Vec::new();
    for (e, member) in nodes.chunks(n).enumerate().filter(|(e, _)| !chained[*e]) {
        let cluster = member[0] as usize / CLUSTER;
        let whole = member.iter().all(|i| *i as usize / CLUSTER == cluster);
        if whole { inside[cluster].push(e as u32) } else { between.push(e as u32) }
    }
    let mut given = Vec::with_capacity(chained.len());
    let mut used = vec![0; rows];
    let clusters = inside.iter().filter(|own| !own.is_empty()).map(|own| colored(own, n, nodes, &mut used, &mut given)).collect();
    used.fill(0);
    let between = colored(&between, n, nodes, &mut used, &mut given);
    chains.iter().for_each(|chain| given.extend(chain.clone().map(|e| e as u32)));
    (given, Order { clusters, between })
}

/// Appends elements by colour, and returns the ranges of the colours: greedily in the order given, each element takes the first colour that
/// none of its nodes has `used`.
fn colored(elements: &[u32], n: usize, nodes: &[u32], used: &mut [u64], given: &mut Vec<u32>) -> Vec<Range<usize>> {
    let mut colors: Vec<Vec<u32>> = Vec::new();
    // Elements around a node with more than 64 of them go one by one.
    let mut late: Vec<u32> = Vec::new();
    for e in elements {
        let member = &nodes[n * *e as usize..][..n];
        let taken = member.iter().fold(0, |t, i| t | used[*i as usize]);
        let color = (!taken).trailing_zeros() as usize;
        if color == 64 {
            late.push(*e);
            continue;
        }
        for i in member {
            used[*i as usize] |= 1 << color;
        }
        if color == colors.len() {
            colors.push(Vec::new());
        }
        colors[color].push(*e);
    }
    for color in &mut colors {
        color.sort_by_key(|e| nodes[n * *e as usize]);
    }
    colors.extend(late.into_iter().map(|e| vec![e]));
    let mut start = given.len();
    given.extend(colors.iter().flatten());
    let ends = colors.iter().map(|c| {
        start += c.len();
        start - c.len()..start
    });
    ends.collect()
}

/// Elements E with the law Y.
pub struct Projected<E, Y, const N: usize, const M: usize, const D: usize, const P: usize> {
    columns: Columns<N, D, P>,
    lambda: Vec<Real>,
    /// Strain at which each breaks, in place; empty if none does.
    limits: Vec<Real>,
    broken: Vec<Broken>,
    chains: Vec<Chain>,
    kind: PhantomData<(E, Y)>,
}

/// A broken link, with what would mend it.
struct Broken {
    place: usize,
    compliance: Real,
    damping: Real,
}

impl<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize> Projected<E, Y, N, M, D, P> {
    /// Elements over rows 0..rows, of which those from `points` on are frames with the inverse inertias `inverse` [1/(kg m²)]; `None`
    /// if a node is not one of them. `limits` are the strains at which links break (infinite: never), or empty.
    pub fn new(rows: usize, points: usize, inverse: &[Real], members: &[Members<N, D, P>], limits: &[f64]) -> Option<Self> {
        Self::with_chains(rows, points, inverse, members, limits, &[])
    }

    /// The same, with `chains` of linear springs, each of which begins where the one before it ends.
    pub fn with_chains(
        rows: usize,
        points: usize,
        inverse: &[Real],
        members: &[Members<N, D, P>],
        limits: &[f64],
        chains: &[Range<usize>],
    ) -> Option<Self> {
        let columns = Columns::new(rows, points, inverse, members, chains)?;
        let breaks = limits.iter().any(|l| l.is_finite());
        let limits = if breaks { columns.given.iter().map(|e| limits[*e as usize] as Real).collect() } else { Vec::new() };
        let mut start = members.len() - chains.iter().map(Range::len).sum::<usize>();
        let places = |chain: &Range<usize>| {
            start += chain.len();
            Chain::new(start - chain.len()..start)
        };
        let chains = chains.iter().map(places).collect();
        Some(Self { columns, lambda: Vec::new(), limits, broken: Vec::new(), chains, kind: PhantomData })
    }

    fn set(&mut self, place: usize, compliance: Real, damping: Real) {
        self.columns.compliance[place] = compliance;
        if let Some(old) = self.columns.damping.get_mut(place) {
            *old = damping;
        }
    }

    fn tear(&mut self, place: usize) {
        let damping = self.columns.damping.get(place).copied().unwrap_or(0.0);
        self.broken.push(Broken { place, compliance: self.columns.compliance[place], damping });
        self.set(place, LIMP as Real, 0.0);
    }

    /// Solves the chains, each as a whole.
    fn project_chains(&mut self, x: &mut [Row], step: &Projection<'_>) {
        let (columns, Some(rest)) = (&self.columns, E::LENGTH) else { return };
        let link = |place: usize| {
            let soft = columns.compliance[place];
            let damping = columns.damping.get(place).copied().unwrap_or(0.0);
            chains::Given {
                nodes: [0, 1].map(|a| columns.nodes[a].get()[place]),
                rest: f64::from(columns.rest[rest][place]),
                compliance: (soft < LIMP as Real || damping > 0.0).then(|| f64::from(soft)),
                time: f64::from(soft) * f64::from(damping),
            }
        };
        let rows = &*x;
        self.chains.chunks_mut(CHAINS).in_parallel(|chains| chains.iter_mut().for_each(|chain| chain.solve(rows, step, link)));
        chains::correct(&self.chains, [columns.nodes[0].get(), columns.nodes[1].get()], x);
    }

    /// Lengthening over rest length; NaN of what is no link or has broken.
    fn strain_at(&self, x: &[Row], place: usize) -> Real {
        let Some(rest) = E::LENGTH.map(|d| self.columns.rest[d][place]) else { return Real::NAN };
        let ends = [0, 1].map(|a| xyz(x[self.columns.nodes[a].get()[place] as usize]));
        if self.columns.compliance[place] < LIMP as Real { ((ends[1] - ends[0]).norm() - rest) / rest } else { Real::NAN }
    }
}

/// Numbers of a pack in the order of its rows.
#[inline(always)]
fn ordered<W: Width, const RUN: bool>(w: W, v: W::L) -> W::L {
    if RUN { w.in_run(v) } else { v }
}

/// Numbers common to all elements of a sweep.
#[derive(Clone, Copy)]
struct Sweep<'a> {
    h: Real,
    x: Shared,
    before: &'a [Row],
    /// Whether multipliers start from zero.
    first: bool,
    damped: bool,
    plain: Option<Real>,
}

/// Projects a range of elements; `lambda` is empty where one sweep is all.
struct Project<'a, E, Y, const N: usize, const M: usize, const D: usize, const P: usize> {
    columns: &'a Columns<N, D, P>,
    range: Range<usize>,
    lambda: &'a mut [Real],
    sweep: Sweep<'a>,
    kind: PhantomData<(E, Y)>,
}

impl<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize> Kernel
    for Project<'_, E, Y, N, M, D, P>
{
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(mut self, w: W) {
        packs!(W, w, self.range, |e| {
            if const { N == 2 && W::N > 1 } && self.columns.is_run(w, e) { self.pack::<_, true>(w, e) } else { self.pack::<_, false>(w, e) }
        }, else Self { range: e..self.range.end, lambda: self.lambda.get_mut(e - self.range.start..).unwrap_or_default(), ..self });
    }
}

impl<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize> Project<'_, E, Y, N, M, D, P> {
    /// Projects a pack; one that is a `RUN` in its order.
    #[inline(always)]
    fn pack<W: Width, const RUN: bool>(&mut self, w: W, e: usize) {
        let (columns, sweep, start, many) = (self.columns, self.sweep, self.range.start, !self.lambda.is_empty());
        let (rows, inverse_h) = (sweep.x.rows(), 1.0 / sweep.h);
        let (mut rest, mut law) = columns.pack(w, e);
        for d in 0..D {
            rest[d] = ordered::<W, RUN>(w, rest[d]);
        }
        for p in 0..P {
            law[p] = ordered::<W, RUN>(w, law[p]);
        }
        // SAFETY: `check` has been called. Of elements that are projected at the same time none share a node: those of a colour by its
        // making, those of two clusters since each has rows of its own.
        let x = unsafe { columns.fetch::<W, RUN>(w, E::FRAMES, rows, e) };
        let mut weights = [w.splat(0.0); N];
        for a in 0..N {
            weights[a] = if a < N - E::FRAMES { x[a][3] } else { ordered::<W, RUN>(w, w.load(&columns.inverse[a][e..])) };
        }
        let (zero, one) = (w.splat(0.0), w.splat(1.0));
        let soft = ordered::<W, RUN>(w, w.load(&columns.compliance[e..]));
        let (mut alpha, mut share) = (soft * w.splat(inverse_h * inverse_h), zero);
        let mut before = None;
        if sweep.damped {
            let ratio = soft * ordered::<W, RUN>(w, w.load(&columns.damping[e..])) * w.splat(inverse_h);
            alpha = alpha / (one + ratio);
            share = ratio / (one + ratio);
            // SAFETY: as above.
            before = Some(unsafe { columns.fetch::<W, RUN>(w, E::FRAMES, sweep.before.as_ptr(), e) });
        }
        if sweep.plain.is_some() {
            // Broken links stay broken.
            alpha = (soft - w.splat(0.5 * LIMP as Real)).positive(alpha, zero);
        }
        let lambda = if many && !sweep.first { ordered::<W, RUN>(w, w.load(&self.lambda[e - start..])) } else { zero };
        let compliance = Compliance { alpha, lambda, share };
        let (mut moves, delta) = project::<E, Y, _, N, M, D, P>(compliance, law, rest, x, before, weights);
        if many {
            w.store(ordered::<W, RUN>(w, lambda + delta), &mut self.lambda[e - start..]);
        }
        if let Some(part) = sweep.plain {
            for a in 0..N {
                moves[a] = moves[a] * w.splat(part);
            }
        }
        let x = corrected(E::FRAMES, x, moves);
        // The first of several nodes that are one is the one that moves.
        for a in (0..N).rev() {
            let index = &columns.nodes[a].get()[e..];
            // SAFETY: as above.
            unsafe { if RUN { w.put_rows(x[a], rows, index[0]) } else { w.put(x[a], rows, index) } };
        }
    }
}

struct Energies<'a, E, Y, const N: usize, const M: usize, const D: usize, const P: usize> {
    columns: &'a Columns<N, D, P>,
    range: Range<usize>,
    x: &'a [Row],
    kind: PhantomData<(E, Y)>,
}

impl<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize> Kernel
    for Energies<'_, E, Y, N, M, D, P>
{
    type Output = f64;
    #[inline(always)]
    fn run<W: Width>(self, w: W) -> f64 {
        let (columns, mut sum, start) = (self.columns, Sum::default(), self.range.start);
        packs!(W, w, self.range, |e| {
            let (rest, law) = columns.pack(w, e);
            // SAFETY: `energy` has called `check`.
            let x = unsafe { columns.gather(w, E::FRAMES, self.x.as_ptr(), e) };
            let soft = w.load(&columns.compliance[e..]);
            let k = soft.positive(w.splat(1.0) / soft, w.splat(0.0));
            sum.add(w, energy::<E, Y, _, N, M, D, P>(k, law, rest, x), e - start);
        });
        sum.total()
    }
}

/// The largest strain of links and triangles that are not broken.
struct Strains<'a, E, const N: usize, const M: usize, const D: usize, const P: usize> {
    columns: &'a Columns<N, D, P>,
    range: Range<usize>,
    x: &'a [Row],
    kind: PhantomData<[E; M]>,
}

impl<E: Element<N, M, D>, const N: usize, const M: usize, const D: usize, const P: usize> Kernel for Strains<'_, E, N, M, D, P> {
    type Output = Real;
    #[inline(always)]
    fn run<W: Width>(self, w: W) -> Real {
        let (columns, mut most) = (self.columns, [Real::NEG_INFINITY; 16]);
        packs!(W, w, self.range, |e| {
            // SAFETY: `largest_strain` has called `check`.
            let x = unsafe { columns.gather(w, E::FRAMES, self.x.as_ptr(), e) };
            let soft = w.load(&columns.compliance[e..]);
            let strain = match E::LENGTH {
                Some(d) => {
                    let rest = w.load(&columns.rest[d][e..]);
                    let way = Vec3 { x: x[1][0] - x[0][0], y: x[1][1] - x[0][1], z: x[1][2] - x[0][2] };
                    (way.norm() - rest) / rest
                }
                None => {
                    let Some(strain) = E::lengthening(columns.pack(w, e).0, x) else { return Real::NEG_INFINITY };
                    strain
                }
            };
            let limp = soft - w.splat(0.5 * LIMP as Real);
            let strain = limp.positive(w.splat(Real::NEG_INFINITY), strain);
            // NaN is never the larger.
            let so_far = w.load(&most);
            w.store((strain - so_far).positive(strain, so_far), &mut most);
        });
        most.into_iter().fold(Real::NEG_INFINITY, Real::max)
    }
}

impl<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize> Constraints
    for Projected<E, Y, N, M, D, P>
{
    fn name(&self) -> &'static str {
        E::NAME
    }

    fn len(&self) -> usize {
        self.columns.len()
    }

    fn connect(&self, join: &mut dyn FnMut(u32, u32)) {
        self.columns.connect(join);
    }

    fn energy(&self, x: &[Row], _: Walls<'_>) -> f64 {
        self.columns.check(x);
        let (columns, kind) = (&self.columns, PhantomData::<(E, Y)>);
        fold(self.len(), |range| dispatch(Energies { columns, range, x, kind })).into_iter().sum()
    }

    fn project(&mut self, x: &mut [Row], step: &Projection<'_>) {
        let (columns, kind) = (&self.columns, PhantomData::<(E, Y)>);
        columns.check(x);
        let damped = !columns.damping.is_empty() && step.plain.is_none();
        if damped {
            columns.check(step.before);
        }
        let many = step.iterations > 1 && step.plain.is_none();
        if many {
            self.lambda.resize(columns.len(), 0.0);
        }
        let (rows, first) = (Shared(x.as_mut_ptr()), step.iteration == 0);
        let sweep = Sweep { h: step.h as Real, x: rows, before: step.before, first, damped, plain: step.plain };
        let lambda = if many { &mut self.lambda[..] } else { &mut [] };
        columns.sweep(usize::from(many), lambda, |range, lambda| {
            dispatch(Project::<_, _, N, M, D, P> { columns, range, lambda, sweep, kind });
        });
        self.project_chains(x, step);
    }

    fn add_grip(&self, x: &[Row], grip: &mut [Real]) {
        self.columns.check(x);
        for e in 0..self.len() {
            let (rest, _) = self.columns.pack(crate::math::simd::Scalar, e);
            // SAFETY: checked above.
            let x = unsafe { self.columns.gather(crate::math::simd::Scalar, E::FRAMES, x.as_ptr(), e) };
            let soft = self.columns.compliance[e];
            for m in 0..M {
                let g = E::pullback(rest, x, std::array::from_fn(|i| if i == m { 1.0 } else { 0.0 }));
                for a in 0..N - E::FRAMES {
                    let size: Real = (0..3).map(|c| g[a][c] * g[a][c]).sum();
                    grip[self.columns.nodes[a].get()[e] as usize] += if soft > 0.0 { size / soft } else { 0.0 };
                }
            }
        }
    }

    fn link_strain(&self, x: &[Row]) -> Vec<Real> {
        self.columns.check(x);
        let mut strain = vec![Real::NAN; self.len()];
        for (place, given) in self.columns.given.iter().enumerate() {
            strain[*given as usize] = self.strain_at(x, place);
        }
        strain
    }

    fn link_ends(&self) -> Vec<[u32; 2]> {
        let mut ends = vec![[0; 2]; self.len()];
        for (place, given) in self.columns.given.iter().enumerate() {
            let node = |a: usize| self.columns.nodes.get(a).map_or(0, |nodes| nodes.get()[place]);
            ends[*given as usize] = [0, 1].map(node);
        }
        ends
    }

    fn largest_strain(&self, x: &[Row]) -> f64 {
        self.columns.check(x);
        let (columns, kind) = (&self.columns, PhantomData::<[E; M]>);
        let largest = fold(self.len(), |range| dispatch(Strains { columns, range, x, kind }));
        largest.into_iter().fold(f64::NEG_INFINITY, |m, s| m.max(f64::from(s)))
    }

    fn most_strained(&self, x: &[Row]) -> Option<(f64, [u32; 2])> {
        self.columns.check(x);
        let (columns, kind) = (&self.columns, PhantomData::<[E; M]>);
        let strain = |e: usize| f64::from(dispatch(Strains { columns, range: e..e + 1, x, kind }));
        let (e, most) = worst(self.len(), strain)?;
        Some((most, [0, 1].map(|a| columns.nodes[a.min(N - 1)].get()[e])))
    }

    fn break_links(&mut self, x: &[Row]) -> u64 {
        if self.limits.is_empty() {
            return 0;
        }
        self.columns.check(x);
        let beyond = |place: &usize| self.strain_at(x, *place).abs() > self.limits[*place];
        let found = fold(self.len(), |range| range.filter(beyond).collect::<Vec<_>>()).concat();
        for place in &found {
            self.tear(*place);
        }
        found.len() as u64
    }

    /// Elements that get a new row in place of an old one all had the old one: inside of a cluster they are all of that cluster, and of
    /// different colours; so clusters and colours stay.
    fn rewire(&mut self, changes: &[(u32, usize, u32)]) {
        if changes.is_empty() {
            return;
        }
        let places = self.columns.places();
        for (element, node, row) in changes {
            self.columns.nodes[*node].set(places[*element as usize], *row);
        }
        self.columns.runs = runs(&self.columns.nodes);
    }

    fn break_elements(&mut self, elements: &[u32]) {
        if elements.is_empty() {
            return;
        }
        let places = self.columns.places();
        for e in elements {
            let place = places[*e as usize];
            if self.columns.compliance[place] < LIMP as Real {
                self.tear(place);
            }
        }
    }

    fn broken(&self) -> Vec<u32> {
        self.broken.iter().map(|b| self.columns.given[b.place]).collect()
    }

    fn set_inverse(&mut self, frame: usize, inverse: Real) {
        for (nodes, weights) in self.columns.nodes.iter().zip(&mut self.columns.inverse) {
            let same = nodes.get().iter().zip(weights).filter(|(node, _)| **node as usize == frame);
            same.for_each(|(_, weight)| *weight = inverse);
        }
    }

    fn set_broken(&mut self, broken: &[u32]) {
        for mended in std::mem::take(&mut self.broken) {
            self.set(mended.place, mended.compliance, mended.damping);
        }
        if broken.is_empty() {
            return;
        }
        let places = self.columns.places();
        for given in broken {
            self.tear(places[*given as usize]);
        }
    }
}

#[cfg(test)]
mod tests;
