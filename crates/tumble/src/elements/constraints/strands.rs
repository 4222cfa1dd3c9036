//! Rods that are chains, each solved as a whole. Sweeps from element to element carry a bend along a chain of n segments in n² of them; the
//! multipliers of all elements of a chain are the solution of one linear system, whose matrix has a narrow band:
//!
//!   (J W J^T + alpha) dlambda = -(r + alpha lambda),   dx = W J^T dlambda                     (rods.7)
//!
//! In the order bend, stretch, bend, ... blocks of 3 x 3 couple to the next two on each side, and Cholesky's factorization takes time in
//! proportion to n. Strands of equal length stand side by side in the lanes of registers.
//!
//! Source: [deul2018]. Differs: strains in the frames' axes (rods.1, rods.2), a band instead of a tree. Breaks: a turn of more than half a
//! circle between two segments in a step. Verified in `tests/rods_position_based.rs`.

mod factor;

use super::{Constraints, Members, Projection, Shared, compliance};
use crate::elements::{BendTwist, Element, Linear, StretchShear, corrected, energy};
use crate::geometry::Walls;
use crate::math::parallel::{Tasks, fold, worst};
use crate::math::simd::{Index, Kernel, Scalar, Width, dispatch};
use crate::math::{Lane, Quat, Real, Row, Vec3, xyz};
use factor::{Block, Factor, by_transposed, cross, plus, pulled, zeros};
use std::ops::Range;

/// Strands solved by one task, and of equal length.
const TASK: usize = 64;
/// Farthest that a frame turns in a sweep [rad]; a strand that would turn more takes a part of its step.
const FARTHEST: Real = 0.4;
/// Compliance at least, relative to the diagonal: with less, round-off decides how far neighbours give way. Rigid elements may ask for the
/// same twice.
const RIDGE: f64 = 4.0 * Real::EPSILON as f64;

type Stretch = Members<3, 2, 0>;
type Bend = Members<2, 6, 0>;

/// All rods of a system that are chains.
pub struct Strands {
    groups: Vec<Group>,
    /// Of every segment in the order given: group, segment and strand.
    places: Vec<(u32, u32, u32)>,
    /// Strain at which each breaks; empty if none does.
    limits: Vec<Real>,
    broken: Vec<u32>,
    rows: usize,
}

/// Strands of n segments. Columns hold one number of all strands, then the next: number i of strand s is at i count + s.
#[derive(Default)]
struct Group {
    n: usize,
    count: usize,
    /// n + 1 a strand.
    points: Index,
    /// n + 2 a strand: the first and the last are held, or stand for nothing.
    frames: Index,
    /// Inverse inertias of frames [1/(kg m²)].
    inertia: Vec<Real>,
    /// n a strand: 1/l, s, 1 or 0 for what is not there, 1/k, b/k.
    stretch: [Vec<Real>; 5],
    /// n + 1 a strand: c, kappa0, side, s, 1 or 0, 1/k, b/k.
    bend: [Vec<Real>; 9],
    damped: bool,
    /// 3 (2 n + 1) a strand; empty for one sweep.
    lambda: Vec<Real>,
    /// Numbers taken out of `stretch` and `bend` where a segment broke.
    whole: Option<Box<([Vec<Real>; 5], [Vec<Real>; 9])>>,
    /// Ends that are let go: where their bends stand, and the numbers of these.
    free: Vec<(usize, [Real; 7])>,
}

/// A chain: which of the stretches, and which of the bends before each of them and after the last.
#[derive(Default)]
struct Chain {
    segments: Vec<usize>,
    bends: Vec<Option<usize>>,
    ends: [Option<u32>; 2],
}

impl Strands {
    /// Takes what is a chain out of both lists: stretches in a row that go on where the last one ended. Bends that join other frames stay.
    /// `None` if there are no stretches, a node is not a row, or a point or frame belongs to two chains.
    pub fn new(rows: usize, points: usize, inverse: &[Real], stretches: &[Stretch], bends: &mut Vec<Bend>, limits: &[f64]) -> Option<Self> {
        let fits = |nodes: &[u32]| nodes.iter().all(|i| (*i as usize) < rows.min(points + inverse.len()));
        if stretches.is_empty() || !stretches.iter().all(|m| fits(&m.nodes)) || !bends.iter().all(|m| fits(&m.nodes)) {
            return None;
        }
        let weight = |frame: u32| inverse.get((frame as usize).wrapping_sub(points)).copied().unwrap_or(0.0);
        // Which chain and segment a frame belongs to; every point and frame has one chain.
        let mut owner: Vec<Option<(usize, usize)>> = vec![None; rows];
        let mut chains: Vec<Chain> = Vec::new();
        let mut last = u32::MAX;
        for (e, m) in stretches.iter().enumerate() {
            let [a, b, q] = m.nodes;
            let joins = last == a && owner[a as usize] == chains.len().checked_sub(1).map(|c| (c, usize::MAX));
            if !joins {
                chains.push(Chain::default());
                if owner[a as usize].is_some() {
                    return None;
                }
            }
            let c = chains.len() - 1;
            if owner[b as usize].is_some() || owner[q as usize].is_some() || a == b {
                return None;
            }
            (owner[a as usize], owner[b as usize]) = (Some((c, usize::MAX)), Some((c, usize::MAX)));
            owner[q as usize] = Some((c, chains[c].segments.len()));
            chains[c].segments.push(e);
            last = b;
        }
        for chain in &mut chains {
            chain.bends = vec![None; chain.segments.len() + 1];
        }
        // The place of a bend: between neighbours, or between an end and a frame that is held.
        let mut taken = vec![false; bends.len()];
        for (e, m) in bends.iter().enumerate() {
            let [a, b] = m.nodes;
            let place = match (owner[a as usize], owner[b as usize]) {
                (Some((c, i)), Some((d, j))) if c == d && j == i + 1 => Some((c, j, None)),
                (None, Some((c, 0))) if weight(a) == 0.0 => Some((c, 0, Some((0, a)))),
                (None, Some((c, i))) if weight(a) == 0.0 && i + 1 == chains[c].segments.len() => Some((c, i + 1, Some((1, a)))),
                _ => None,
            };
            let Some((c, slot, end)) = place else { continue };
            if chains[c].bends[slot].is_some() {
                continue;
            }
            chains[c].bends[slot] = Some(e);
            taken[e] = true;
            if let Some((side, frame)) = end {
                chains[c].ends[side] = Some(frame);
            }
        }
        let mut order: Vec<usize> = (0..chains.len()).collect();
        order.sort_by_key(|c| chains[*c].segments.len());
        let mut places = vec![(0, 0, 0); stretches.len()];
        let mut groups = Vec::new();
        for alike in order.chunk_by(|a, b| chains[*a].segments.len() == chains[*b].segments.len()) {
            for some in alike.chunks(TASK) {
                let some: Vec<&Chain> = some.iter().map(|c| &chains[*c]).collect();
                for (s, chain) in some.iter().enumerate() {
                    for (i, e) in chain.segments.iter().enumerate() {
                        places[*e] = (groups.len() as u32, i as u32, s as u32);
                    }
                }
                groups.push(Group::new(rows, &some, stretches, bends, &weight)?);
            }
        }
        let mut kept = taken.iter();
        bends.retain(|_| !*kept.next().unwrap_or(&false));
        let breaks = limits.iter().any(|l| l.is_finite());
        let limits = if breaks { limits.iter().map(|l| *l as Real).collect() } else { Vec::new() };
        Some(Self { groups, places, limits, broken: Vec::new(), rows })
    }

    /// Panics unless there are rows for the unchecked loads.
    fn check(&self, rows: &[Row]) {
        assert!(rows.len() >= self.rows, "a column is shorter than the rows that strands use");
    }

    fn strain(&self, x: &[Row], e: usize) -> Real {
        let (g, i, s) = self.places[e];
        let group = &self.groups[g as usize];
        let at = i as usize * group.count + s as usize;
        let ends = [at, at + group.count].map(|p| xyz(x[group.points.get()[p] as usize]));
        if group.stretch[2][at] > 0.0 { (ends[1] - ends[0]).norm() * group.stretch[0][at] - 1.0 } else { Real::NAN }
    }

    /// A segment that breaks is not there any more, nor what bends it.
    fn tear(&mut self, e: u32) {
        let (g, i, s) = self.places[e as usize];
        let group = &mut self.groups[g as usize];
        group.whole.get_or_insert_with(|| Box::new((group.stretch.clone(), group.bend.clone())));
        let at = i as usize * group.count + s as usize;
        (group.stretch[1][at], group.stretch[2][at]) = (0.0, 0.0);
        for at in [at, at + group.count] {
            (0..7).for_each(|c| group.bend[c][at] = 0.0);
        }
        self.broken.push(e);
    }
}

impl Group {
    fn new(rows: usize, chains: &[&Chain], stretches: &[Stretch], bends: &[Bend], weight: &dyn Fn(u32) -> Real) -> Option<Self> {
        let (count, n) = (chains.len(), chains.first()?.segments.len());
        let mut group = Self { n, count, ..Self::default() };
        let mut points = Vec::with_capacity((n + 1) * count);
        let mut frames = Vec::with_capacity((n + 2) * count);
        let stretch = |chain: &Chain, i: usize| &stretches[chain.segments[i]];
        for i in 0..=n {
            points.extend(chains.iter().map(|c| if i < n { stretch(c, i).nodes[0] } else { stretch(c, n - 1).nodes[1] }));
        }
        for i in 0..n + 2 {
            frames.extend(chains.iter().map(|c| match i {
                0 => c.ends[0].unwrap_or(stretch(c, 0).nodes[2]),
                _ if i == n + 1 => c.ends[1].unwrap_or(stretch(c, n - 1).nodes[2]),
                _ => stretch(c, i - 1).nodes[2],
            }));
        }
        group.inertia = frames.iter().map(|f| weight(*f)).collect();
        // Held rows, and rows that stand for nothing, do not move.
        group.inertia[..count].fill(0.0);
        group.inertia[(n + 1) * count..].fill(0.0);
        (group.points, group.frames) = (Index::new(points, rows)?, Index::new(frames, rows)?);
        let time = |k: f64, b: f64| if k > 0.0 && k.is_finite() { (b / k) as Real } else { 0.0 };
        for i in 0..n {
            for chain in chains {
                let m = stretch(chain, i);
                let numbers = [(1.0 / m.rest[0]) as Real, m.rest[1] as Real, 1.0, compliance(m.stiffness), time(m.stiffness, m.damping)];
                group.damped |= m.damping > 0.0;
                group.stretch.iter_mut().zip(numbers).for_each(|(column, number)| column.push(number));
            }
        }
        for i in 0..=n {
            for chain in chains {
                let mut numbers = [0.0; 9];
                if let Some(m) = chain.bends[i].map(|e| &bends[e]) {
                    (0..6).for_each(|c| numbers[c] = m.rest[c] as Real);
                    (numbers[6], numbers[7], numbers[8]) = (1.0, compliance(m.stiffness), time(m.stiffness, m.damping));
                    group.damped |= m.damping > 0.0;
                    // Seen from the held frame at the end, the rod bends the other way.
                    if i == n {
                        (1..4).for_each(|c| numbers[c] = -numbers[c]);
                    }
                }
                group.bend.iter_mut().zip(numbers).for_each(|(column, number)| column.push(number));
            }
        }
        Some(group)
    }

    /// Clamps an end, or lets it go: the bend there, beside a segment, is there or not.
    fn hold_end(&mut self, bend: usize, segment: usize, held: bool) {
        let place = self.free.iter().position(|(at, _)| *at == bend);
        let numbers = match (place, held) {
            (None, false) => {
                let whole = self.whole.as_ref().map_or(&self.bend, |whole| &whole.1);
                self.free.push((bend, std::array::from_fn(|c| whole[c][bend])));
                [0.0; 7]
            }
            (Some(place), true) if self.stretch[2][segment] > 0.0 => self.free.remove(place).1,
            _ => return,
        };
        for columns in [&mut self.bend].into_iter().chain(self.whole.iter_mut().map(|whole| &mut whole.1)) {
            columns.iter_mut().zip(numbers).for_each(|(column, number)| column[bend] = number);
        }
    }

    /// How much more the softest bend gives than it should, in sub-steps of length h [s].
    fn softening(&self, h: f64) -> f64 {
        let bend = |at: usize| {
            let half = 0.5 * f64::from(self.bend[0][at]);
            let side = f64::from(self.bend[4][at]).max(1.0);
            let diagonal = (half * side).powi(2) * (f64::from(self.inertia[at]) + f64::from(self.inertia[at + self.count]));
            let alpha = f64::from(self.bend[7][at]) / (h * h);
            if alpha > 0.0 { RIDGE * diagonal / alpha } else { 1.0 }
        };
        (0..(self.n + 1) * self.count).map(bend).fold(1.0, f64::max)
    }

    /// The longest sub-step in which a strand does not shake that hangs from what is held. Tension T acts in the direction of its predicted places, and
    /// bending B implicitly: a wave across it, with s = 4 sin²(k l/2), is stable if a (3 s - b s²) < 4 for a = T h²/(m l), b = B/(T l²).  (rods.11)
    fn longest_step(&self, x: &[Row], gravity: f64, s: usize) -> f64 {
        let at = |i: usize| i * self.count + s;
        let mass = |i: usize| Some(f64::from(x[self.points.get()[at(i)] as usize][3])).filter(|w| *w > 0.0).map(|w| 1.0 / w);
        let weight: f64 = gravity * (0..=self.n).filter_map(mass).sum::<f64>();
        if (0..=self.n).all(|i| mass(i).is_some()) {
            return f64::INFINITY;
        }
        let longest = |i: usize| {
            let (l, bend) = (1.0 / f64::from(self.stretch[0][at(i)]), at(i));
            let soft = f64::from(self.bend[7][bend]) * l / f64::from(self.bend[4][bend]).powi(2).min(1.0);
            let b = if self.bend[6][bend] > 0.0 { 1.0 / (soft * weight * l * l) } else { 0.0 };
            // The largest of 3 s - b s² where s is at most 4.
            let most = if b < 0.375 { 12.0 - 16.0 * b } else { 2.25 / b };
            (4.0 / most * mass(i).unwrap_or(f64::INFINITY) * l / weight).sqrt()
        };
        (1..self.n).map(longest).fold(f64::INFINITY, f64::min)
    }

    fn project(&mut self, x: Shared, step: &Projection<'_>) {
        let damped = self.damped && step.plain.is_none();
        let many = step.iterations > 1 && step.plain.is_none();
        if many {
            self.lambda.resize(3 * (2 * self.n + 1) * self.count, 0.0);
            if step.iteration == 0 {
                self.lambda.fill(0.0);
            }
        }
        let mut lambda = std::mem::take(&mut self.lambda);
        let own = if many { &mut lambda[..] } else { &mut [] };
        let group = &*self;
        dispatch(Solve { group, x, step, lambda: own, damped });
        self.lambda = lambda;
    }
}

/// Both elements at a place of a pack of strands.
#[derive(Clone, Copy)]
struct Bent<L> {
    r: [L; 3],
    by: [Block<L>; 2],
    alpha: L,
    share: L,
}

#[derive(Clone, Copy)]
struct Stretched<L> {
    r: [L; 3],
    /// The change of r with a way of the second point; the first has the opposite.
    by_point: Block<L>,
    by_frame: Block<L>,
    alpha: L,
    share: L,
}

struct Solve<'a> {
    group: &'a Group,
    x: Shared,
    step: &'a Projection<'a>,
    /// Empty for one sweep.
    lambda: &'a mut [Real],
    damped: bool,
}

/// alpha of an element, and the share of damping in it.
#[inline(always)]
fn soft<W: Width>(w: W, step: &Projection<'_>, compliance: W::L, time: W::L) -> (W::L, W::L) {
    let inverse_h = 1.0 / step.h as Real;
    if step.plain.is_some() {
        return (w.splat(0.0), w.splat(0.0));
    }
    let (one, ratio) = (w.splat(1.0), time * w.splat(inverse_h));
    (compliance * w.splat(inverse_h) * w.splat(inverse_h) / (one + ratio), ratio / (one + ratio))
}

#[inline(always)]
fn unit<L: Lane>(row: [L; 4]) -> Quat<L> {
    Quat::from_row(row).normalized()
}

impl Group {
    /// Bend i of the strands from s on, between the frames a and b.
    #[inline(always)]
    fn bent<W: Width>(&self, w: W, step: &Projection<'_>, i: usize, s: usize, frames: [Quat<W::L>; 2]) -> Bent<W::L> {
        let at = i * self.count + s;
        let (c, side, twist) = (w.load(&self.bend[0][at..]), w.load(&self.bend[4][at..]), w.load(&self.bend[5][at..]));
        let rest = [c, w.load(&self.bend[1][at..]), w.load(&self.bend[2][at..]), w.load(&self.bend[3][at..]), side, twist];
        let r = BendTwist::residual(rest, [frames[0].row(), frames[1].row()]);
        let p = frames[0].conj() * frames[1];
        let half = p.w.positive(c, -c) * w.splat(0.5);
        let s = [half, half * side, half * twist];
        let (mut forth, mut back) = (cross(s, p.v), cross(s, p.v));
        for k in 0..3 {
            forth[k][k] = forth[k][k] + s[k] * p.w;
            back[k][k] = back[k][k] - s[k] * p.w;
        }
        let (alpha, share) = soft(w, step, w.load(&self.bend[7][at..]), w.load(&self.bend[8][at..]));
        Bent { r, by: [back, forth], alpha, share }
    }

    /// The stretch of segment i.
    #[inline(always)]
    fn stretched<W: Width>(
        &self,
        w: W,
        step: &Projection<'_>,
        i: usize,
        s: usize,
        points: [[W::L; 4]; 2],
        frame: Quat<W::L>,
    ) -> Stretched<W::L> {
        let at = i * self.count + s;
        let (inverse, shear, there) = (w.load(&self.stretch[0][at..]), w.load(&self.stretch[1][at..]), w.load(&self.stretch[2][at..]));
        let way = Vec3 { x: points[1][0] - points[0][0], y: points[1][1] - points[0][1], z: points[1][2] - points[0][2] };
        let d = frame.conj().turn(way * inverse);
        let s = [shear, shear, there];
        let zero = w.splat(0.0);
        let mut by_point = zeros(zero);
        let axes = [
            frame.turn(Vec3 { x: w.splat(1.0), y: zero, z: zero }),
            frame.turn(Vec3 { x: zero, y: w.splat(1.0), z: zero }),
            frame.turn(Vec3 { x: zero, y: zero, z: w.splat(1.0) }),
        ];
        for k in 0..3 {
            let axis = axes[k] * (inverse * s[k]);
            by_point[k] = [axis.x, axis.y, axis.z];
        }
        let r = [d.x * shear, d.y * shear, (d.z - w.splat(1.0)) * there];
        let (alpha, share) = soft(w, step, w.load(&self.stretch[3][at..]), w.load(&self.stretch[4][at..]));
        Stretched { r, by_point, by_frame: cross(s, d), alpha, share }
    }

    /// The point i of the strands from s on.
    ///
    /// # Safety
    /// The rows are there, and nobody writes them.
    #[inline(always)]
    unsafe fn point<W: Width>(&self, w: W, x: *const Row, i: usize, s: usize) -> [W::L; 4] {
        // SAFETY: see above.
        unsafe { w.gather_at(x, &self.points.get()[i * self.count + s..]) }
    }

    /// The frame i.
    ///
    /// # Safety
    /// The rows are there, and nobody writes them.
    #[inline(always)]
    unsafe fn frame<W: Width>(&self, w: W, x: *const Row, i: usize, s: usize) -> Quat<W::L> {
        // SAFETY: see above.
        unit(unsafe { w.gather_at(x, &self.frames.get()[i * self.count + s..]) })
    }
}

/// The right side: -(r - share r_before + alpha lambda).
#[inline(always)]
fn right<L: Lane>(r: [L; 3], before: [L; 3], share: L, alpha: L, lambda: [L; 3]) -> [L; 3] {
    let mut out = r;
    for k in 0..3 {
        out[k] = share * before[k] - r[k] - alpha * lambda[k];
    }
    out
}

/// The diagonal block with its compliance.
#[inline(always)]
fn on_diagonal<L: Lane>(mut a: Block<L>, alpha: L) -> Block<L> {
    for k in 0..3 {
        let least = a[k][k] * alpha.like(RIDGE);
        a[k][k] = a[k][k] + (alpha - least).positive(alpha, least);
    }
    a
}

impl Solve<'_> {
    #[inline(always)]
    fn multiplier<W: Width>(&self, w: W, k: usize, s: usize) -> [W::L; 3] {
        let mut out = [w.splat(0.0); 3];
        if !self.lambda.is_empty() {
            for c in 0..3 {
                out[c] = w.load(&self.lambda[(3 * k + c) * self.group.count + s..]);
            }
        }
        out
    }
}

impl Kernel for Solve<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(mut self, w: W) {
        let (count, rows) = (self.group.count, 2 * self.group.n + 5);
        let mut wide = vec![Factor::none(w.splat(0.0)); if count >= W::N { rows } else { 0 }];
        let mut s = 0;
        while s + W::N <= count {
            self.strand(w, s, &mut wide);
            s += W::N;
        }
        if s < count {
            self.rest(s);
        }
    }
}

impl Solve<'_> {
    /// The strands from s on one by one: compiled once, for no registers in particular, whose bits are the same.
    #[inline(never)]
    fn rest(&mut self, s: usize) {
        let mut factor = vec![Factor::none(0.0); 2 * self.group.n + 5];
        (s..self.group.count).for_each(|s| self.strand(Scalar, s, &mut factor));
    }

    /// A pack of strands from s on.
    #[inline(always)]
    fn strand<W: Width>(&mut self, w: W, s: usize, factor: &mut [Factor<W::L>]) {
        let (group, step, n) = (self.group, self.step, self.group.n);
        let (x, old) = (self.x.rows().cast_const(), step.before.as_ptr());
        let (zero, count) = (w.splat(0.0), group.count);
        // Matrix, factor and forward substitution.
        // SAFETY: `project` has called `check`; no two strands share a row.
        let (mut q, mut p) = unsafe { (group.frame(w, x, 0, s), group.point(w, x, 0, s)) };
        let (mut q_old, mut p_old) = (q, p);
        if self.damped {
            // SAFETY: as above.
            (q_old, p_old) = unsafe { (group.frame(w, old, 0, s), group.point(w, old, 0, s)) };
        }
        let mut last_bend = zeros(zero);
        let (mut last_stretch, mut last_point) = (zeros(zero), zeros(zero));
        for i in 0..=n {
            // SAFETY: as above.
            let next = unsafe { group.frame(w, x, i + 1, s) };
            let bend = group.bent(w, step, i, s, [q, next]);
            let (w0, w1) = (w.load(&group.inertia[i * count + s..]), w.load(&group.inertia[(i + 1) * count + s..]));
            let mut before = [zero; 3];
            if self.damped {
                // SAFETY: as above.
                let next_old = unsafe { group.frame(w, old, i + 1, s) };
                before = group.bent(w, step, i, s, [q_old, next_old]).r;
                q_old = next_old;
            }
            let own = plus(by_transposed(bend.by[0], bend.by[0], w0), by_transposed(bend.by[1], bend.by[1], w1));
            let left = [by_transposed(bend.by[0], last_stretch, w0), by_transposed(bend.by[0], last_bend, w0)];
            let y = right(bend.r, before, bend.share, bend.alpha, self.multiplier(w, 2 * i, s));
            factor[2 * i + 2] = Factor::next(on_diagonal(own, bend.alpha), left, y, [&factor[2 * i + 1], &factor[2 * i]]);
            last_bend = bend.by[1];
            q = next;
            if i == n {
                break;
            }
            // SAFETY: as above.
            let ahead = unsafe { group.point(w, x, i + 1, s) };
            let stretch = group.stretched(w, step, i, s, [p, ahead], q);
            if self.damped {
                // SAFETY: as above.
                let ahead_old = unsafe { group.point(w, old, i + 1, s) };
                before = group.stretched(w, step, i, s, [p_old, ahead_old], q_old).r;
                p_old = ahead_old;
            }
            let own = plus(
                by_transposed(stretch.by_point, stretch.by_point, p[3] + ahead[3]),
                by_transposed(stretch.by_frame, stretch.by_frame, w1),
            );
            let left = [by_transposed(stretch.by_frame, last_bend, w1), by_transposed(stretch.by_point, last_point, -p[3])];
            let y = right(stretch.r, before, stretch.share, stretch.alpha, self.multiplier(w, 2 * i + 1, s));
            factor[2 * i + 3] = Factor::next(on_diagonal(own, stretch.alpha), left, y, [&factor[2 * i + 2], &factor[2 * i + 1]]);
            (last_stretch, last_point) = (stretch.by_frame, stretch.by_point);
            p = ahead;
        }
        // Backward substitution.
        for k in (0..2 * n + 1).rev() {
            let (own, next) = factor.split_at_mut(k + 3);
            own[k + 2].back([&next[0], &next[1]]);
        }
        // Corrections of points and frames, kept in place of the factor.
        // SAFETY: as above.
        let (mut q, mut p) = unsafe { (group.frame(w, x, 1, s), group.point(w, x, 0, s)) };
        // SAFETY: as above.
        let held = unsafe { group.frame(w, x, 0, s) };
        let mut torque = pulled(group.bent(w, step, 0, s, [held, q]).by[1], factor[2].y);
        let mut force = Vec3 { x: zero, y: zero, z: zero };
        let mut most = zero;
        for i in 0..n {
            // SAFETY: as above.
            let (next, ahead) = unsafe { (group.frame(w, x, i + 2, s), group.point(w, x, i + 1, s)) };
            let stretch = group.stretched(w, step, i, s, [p, ahead], q);
            let bend = group.bent(w, step, i + 1, s, [q, next]);
            let pull = pulled(stretch.by_point, factor[2 * i + 3].y);
            let turn = torque + pulled(stretch.by_frame, factor[2 * i + 3].y) + pulled(bend.by[0], factor[2 * i + 4].y);
            let (way, turn) = ((force - pull) * p[3], turn * w.load(&group.inertia[(i + 1) * count + s..]));
            let angle = turn.norm_sq();
            most = (angle - most).positive(angle, most);
            factor[2 * i + 3].own = [way.x, way.y, way.z, turn.x, turn.y, turn.z];
            force = pull;
            torque = pulled(bend.by[1], factor[2 * i + 4].y);
            (q, p) = (next, ahead);
        }
        let way = force * p[3];
        factor[2 * n + 3].own = [way.x, way.y, way.z, zero, zero, zero];
        // All of it, unless a frame turns too far for what is linear in it.
        let far = w.splat(FARTHEST * FARTHEST);
        let share = (most - far).positive(w.splat(FARTHEST) / (most - far).positive(most, far).sqrt(), w.splat(1.0));
        if !self.lambda.is_empty() {
            for k in 0..2 * n + 1 {
                for c in 0..3 {
                    let at = (3 * k + c) * count + s;
                    w.store(w.load(&self.lambda[at..]) + factor[k + 2].y[c] * share, &mut self.lambda[at..]);
                }
            }
        }
        let part = share * w.splat(step.plain.unwrap_or(1.0));
        for i in 0..=n {
            let [a, b, c, d, e, f] = factor[2 * i + 3].own;
            // SAFETY: as above.
            let p = unsafe { group.point(w, x, i, s) };
            let [to] = corrected::<_, 1>(0, [p], [Vec3 { x: a, y: b, z: c } * part]);
            // SAFETY: as above.
            unsafe { w.put(to, self.x.rows(), &group.points.get()[i * count + s..]) };
            if i == n {
                break;
            }
            // SAFETY: as above.
            let q = unsafe { group.frame(w, x, i + 1, s) };
            let [turned] = corrected::<_, 1>(1, [q.row()], [Vec3 { x: d, y: e, z: f } * part]);
            // SAFETY: as above.
            unsafe { w.put(turned, self.x.rows(), &group.frames.get()[(i + 1) * count + s..]) };
        }
    }
}

impl Constraints for Strands {
    fn name(&self) -> &'static str {
        "strand"
    }

    fn len(&self) -> usize {
        self.places.len()
    }

    fn connect(&self, join: &mut dyn FnMut(u32, u32)) {
        for group in &self.groups {
            let (points, frames, next) = (group.points.get(), group.frames.get(), group.count);
            for at in (0..group.n * next).filter(|at| group.stretch[2][*at] > 0.0) {
                join(points[at], points[at + next]);
                join(points[at], frames[at + next]);
            }
            for at in (0..(group.n + 1) * next).filter(|at| group.bend[6][*at] > 0.0) {
                join(frames[at], frames[at + next]);
            }
        }
    }

    fn softening(&self, h: f64) -> f64 {
        self.groups.iter().map(|group| group.softening(h)).fold(1.0, f64::max)
    }

    fn longest_step(&self, x: &[Row], gravity: f64) -> f64 {
        let strands = self.groups.iter().flat_map(|group| (0..group.count).map(move |s| group.longest_step(x, gravity, s)));
        strands.fold(f64::INFINITY, f64::min)
    }

    fn energy(&self, x: &[Row], _: Walls<'_>) -> f64 {
        self.check(x);
        let one = |group: &Group| {
            let mut total = 0.0;
            let row = |index: &Index, at: usize| x[index.get()[at] as usize];
            for at in 0..group.n * group.count {
                let nodes = [row(&group.points, at), row(&group.points, at + group.count), row(&group.frames, at + group.count)];
                if group.stretch[2][at] > 0.0 {
                    let rest = [1.0 / group.stretch[0][at], group.stretch[1][at]];
                    let k = 1.0 / group.stretch[3][at];
                    total += f64::from(energy::<StretchShear, Linear, _, 3, 3, 2, 0>(k, [], rest, nodes));
                }
            }
            for at in 0..(group.n + 1) * group.count {
                let nodes = [row(&group.frames, at), row(&group.frames, at + group.count)];
                if group.bend[6][at] > 0.0 {
                    let rest = [0, 1, 2, 3, 4, 5].map(|c| group.bend[c][at]);
                    let k = 1.0 / group.bend[7][at];
                    total += f64::from(energy::<BendTwist, Linear, _, 2, 3, 6, 0>(k, [], rest, nodes));
                }
            }
            total
        };
        self.groups.iter().map_in_parallel(one).into_iter().sum()
    }

    fn project(&mut self, x: &mut [Row], step: &Projection<'_>) {
        self.check(x);
        if step.plain.is_none() && self.groups.iter().any(|g| g.damped) {
            self.check(step.before);
        }
        let x = Shared(x.as_mut_ptr());
        self.groups.iter_mut().in_parallel(|group| group.project(x, step));
    }

    fn add_grip(&self, _x: &[Row], grip: &mut [Real]) {
        for group in &self.groups {
            for at in 0..group.n * group.count {
                let k = group.stretch[0][at] * group.stretch[0][at] / group.stretch[3][at];
                for end in [at, at + group.count] {
                    grip[group.points.get()[end] as usize] += k;
                }
            }
        }
    }

    fn largest_strain(&self, x: &[Row]) -> f64 {
        self.check(x);
        // NaN, of what has broken, is never the larger.
        let largest = |range: Range<usize>| range.map(|e| self.strain(x, e)).fold(Real::NEG_INFINITY, Real::max);
        fold(self.len(), largest).into_iter().fold(f64::NEG_INFINITY, |m, s| m.max(f64::from(s)))
    }

    fn most_strained(&self, x: &[Row]) -> Option<(f64, [u32; 2])> {
        self.check(x);
        let (e, most) = worst(self.len(), |e| f64::from(self.strain(x, e)))?;
        let (g, i, s) = self.places[e];
        let group = &self.groups[g as usize];
        let at = i as usize * group.count + s as usize;
        Some((most, [at, at + group.count].map(|p| group.points.get()[p])))
    }

    fn break_links(&mut self, x: &[Row]) -> u64 {
        if self.limits.is_empty() {
            return 0;
        }
        self.check(x);
        let beyond = |e: &usize| self.strain(x, *e).abs() > self.limits[*e];
        let found = fold(self.len(), |range| range.filter(beyond).collect::<Vec<_>>()).concat();
        found.iter().for_each(|e| self.tear(*e as u32));
        found.len() as u64
    }

    fn broken(&self) -> Vec<u32> {
        self.broken.clone()
    }

    fn set_broken(&mut self, broken: &[u32]) {
        for group in &mut self.groups {
            if let Some(whole) = group.whole.take() {
                (group.stretch, group.bend) = *whole;
            }
        }
        self.broken.clear();
        broken.iter().for_each(|e| self.tear(*e));
    }

    fn set_inverse(&mut self, frame: usize, inverse: Real) {
        for group in &mut self.groups {
            let (n, count) = (group.n, group.count);
            for at in (0..(n + 2) * count).filter(|at| group.frames.get()[*at] as usize == frame).collect::<Vec<_>>() {
                match at / count {
                    0 => group.hold_end(at, at, inverse == 0.0),
                    i if i == n + 1 => group.hold_end(at - count, at - 2 * count, inverse == 0.0),
                    _ => group.inertia[at] = inverse,
                }
            }
        }
    }
}
