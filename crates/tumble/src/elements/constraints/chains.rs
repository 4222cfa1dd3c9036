//! Links in a row, each chain solved as a whole. Sweeps from link to link carry a load along a chain of n links in n² of them; one linear
//! system carries it at once, whatever n. Its unknowns are the displacements d of the points and the multipliers of the links:
//!
//!   m_i d_i + sum over links of g (I - n n^T)(d_i - d_j) = sum over links of ± n dlambda                    (positions.7)
//!   n . (d_{i+1} - d_i) + alpha dlambda = -(C + alpha lambda),   g = max(0, -lambda/l)
//!
//! g is the stiffness across a taut link: without it tension acts in the direction of a sub-step before, and a string under much tension
//! shakes itself to pieces. The tension is that of a first solution without g. Points and multipliers are eliminated in turn from one end to
//! the other, in time proportional to n and with any compliance, in double precision.
//!
//! As in [macklin2016], later sweeps leave out what is left of the first line, of second order in the turn of a link in a sub-step.
//!
//! Source: [macklin2016], with the geometric stiffness of [tournier2015]. Verified in `tests/chains.rs`.

use super::Projection;
use crate::math::{Real, Row, Vec3, xyz64};
use std::ops::Range;

/// Compliance at least, h² k = 1e9 masses at most: rigid links stay solvable, also between held points.
const RIDGE: f64 = 1e-9;
/// Newton's method ends where no link is farther from its equation than this, over its length; or after so many steps. One is usually
/// enough; the end of a whip takes more.
const NEAR: f64 = 1e-6;
const ROUNDS: usize = 5;

/// A chain: link i joins the points i and i + 1.
#[derive(Debug, Clone)]
pub(super) struct Chain {
    /// Where its links stand.
    pub places: Range<usize>,
    links: Vec<Link>,
    /// Multipliers [kg m], kept from sweep to sweep.
    lambda: Vec<f64>,
    /// Displacements of its points [m]; scratch.
    ways: Vec<Vec3<f64>>,
    /// Where they go in this sweep [m].
    to: Vec<Vec3<f64>>,
}

/// A link, as `Chain::solve` is given it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Given {
    /// Rows of its points.
    pub nodes: [u32; 2],
    /// Its rest length [m].
    pub rest: f64,
    /// 1/k [m/N]; `None` of one that has broken.
    pub compliance: Option<f64>,
    /// b/k [s].
    pub time: f64,
}

/// A link in elimination. With all before it eliminated, and Q = I - n n^T, point i has B^-1 d_i - g Q d_{i+1} + n dlambda = r.
#[derive(Debug, Clone, Copy, Default)]
struct Link {
    weights: [f64; 2],
    /// Where damping pulls it to [m].
    rest: f64,
    n: Vec3<f64>,
    length: f64,
    /// C + alpha lambda.
    c: f64,
    alpha: f64,
    /// Without stiffness across: the coupling to the link before, and the change of lambda once those before are eliminated.
    off: f64,
    change: f64,
    /// Stiffness across, times h² [kg].
    g: f64,
    b: Symmetric,
    r: Vec3<f64>,
    u: Vec3<f64>,
    /// The inverse of the pivot of its multiplier; 0 where there is none.
    pivot: f64,
    broken: bool,
}

impl Chain {
    pub fn new(places: Range<usize>) -> Self {
        let n = places.len();
        let points = vec![Vec3::default(); n + 1];
        Self { places, links: vec![Link::default(); n], lambda: vec![0.0; n], ways: points.clone(), to: points }
    }

    /// Finds where its points go.
    pub fn solve(&mut self, x: &[Row], step: &Projection<'_>, given: impl Fn(usize) -> Given) {
        if step.iteration == 0 || step.plain.is_some() {
            self.lambda.fill(0.0);
        }
        for (i, place) in self.places.clone().enumerate() {
            let link = given(place);
            let [a, b] = link.nodes.map(|i| i as usize);
            self.links[i] = Link::new(link, [x[a][3], x[b][3]], [step.before[a], step.before[b]], step);
            (self.to[i], self.to[i + 1]) = (xyz64(x[a]), xyz64(x[b]));
        }
        let part = step.plain.map_or(1.0, f64::from);
        for round in 0..if step.plain.is_some() { 1 } else { ROUNDS } {
            let mut farthest = 0.0_f64;
            for (i, link) in self.links.iter_mut().enumerate() {
                link.aim(self.to[i + 1] - self.to[i], self.lambda[i]);
                farthest = farthest.max(if link.pulls() { link.c.abs() / link.rest } else { 0.0 });
            }
            if round > 0 && farthest < NEAR {
                break;
            }
            self.pull();
            self.eliminate();
            self.to.iter_mut().zip(&self.ways).for_each(|(to, way)| *to = *to + *way * part);
        }
    }

    /// The stiffness across each link, from the multipliers of a solution without it: of (J W J^T + alpha) dlambda = -(C + alpha lambda), which is
    /// tridiagonal.
    fn pull(&mut self) {
        let (mut right, mut pivot, mut last) = (0.0, 0.0, Vec3::default());
        for link in &mut self.links {
            let off = -link.weights[0] * link.n.dot(last);
            link.pivot = link.inverse_pivot(link.weights[0] + link.weights[1] - off * off * pivot);
            right = (-link.c - off * right) * link.pivot;
            (link.off, link.change) = (off, right);
            (pivot, last) = (link.pivot, link.n);
        }
        let mut ahead = 0.0;
        for (link, lambda) in self.links.iter_mut().zip(&self.lambda).rev() {
            let change = link.change - link.pivot * ahead;
            ahead = link.off * change;
            let tension = -(lambda + change);
            link.g = if tension > 0.0 && link.pulls() { tension / link.length } else { 0.0 };
        }
    }

    /// Solves (positions.7), and adds to the multipliers.
    fn eliminate(&mut self) {
        let (mut p, mut r) = (Symmetric::default(), Vec3::default());
        for link in &mut self.links {
            let Link { n, g, .. } = *link;
            let across = |v: Vec3<f64>| (v - n * n.dot(v)) * g;
            let b = p.with(link.weights[0], Symmetric::across(n, g));
            let bn = b.times(n);
            let (a, br) = (n.dot(bn), b.times(r));
            link.pivot = link.inverse_pivot(a);
            (link.b, link.r, link.u) = (b, r, n - across(bn));
            // g Q - g² Q B Q, and what the multiplier carries on.
            let mut q = Symmetric::across(n, g);
            q.add_outer(n, n, -0.5 * g * g * a);
            q.add_outer(bn, n, g * g);
            (0..6).for_each(|k| q.0[k] -= g * g * b.0[k]);
            q.add_outer(link.u, link.u, 0.5 * link.pivot);
            (p, r) = (q, across(br) + link.u * ((n.dot(br) - link.c) * link.pivot));
        }
        let last = self.links.last().map_or(0.0, |link| link.weights[1]);
        let mut way = p.with(last, Symmetric::default()).times(r);
        for (i, link) in self.links.iter().enumerate().rev() {
            self.ways[i + 1] = way;
            let change = (link.n.dot(link.b.times(link.r)) - link.c - link.u.dot(way)) * link.pivot;
            self.lambda[i] += change;
            let pull = (way - link.n * link.n.dot(way)) * link.g;
            way = link.b.times(link.r + pull - link.n * change);
        }
        self.ways[0] = way;
    }
}

impl Link {
    fn new(given: Given, weights: [Real; 2], before: [Row; 2], step: &Projection<'_>) -> Self {
        let (weights, ratio, h) = (weights.map(f64::from), given.time / step.h, step.h);
        let (mut alpha, mut rest) = (0.0, given.rest);
        if step.plain.is_none() {
            alpha = given.compliance.unwrap_or(0.0) / (h * h * (1.0 + ratio));
            if ratio > 0.0 {
                rest += ((xyz64(before[1]) - xyz64(before[0])).norm() - given.rest) * ratio / (1.0 + ratio);
            }
        }
        alpha = alpha.max(RIDGE * (weights[0] + weights[1]));
        Self { weights, rest, alpha, broken: given.compliance.is_none(), ..Self::default() }
    }

    /// Whether it is there and has a direction.
    fn pulls(&self) -> bool {
        !self.broken && self.length > 0.0
    }

    /// Its direction and error, of the way between its points.
    fn aim(&mut self, way: Vec3<f64>, lambda: f64) {
        self.length = way.norm();
        self.n = if self.length > 0.0 { way * (1.0 / self.length) } else { Vec3::default() };
        self.c = self.length - self.rest + self.alpha * lambda;
    }

    /// Of a multiplier with this on the diagonal beside the compliance; 0 of a link without a direction.
    fn inverse_pivot(&self, own: f64) -> f64 {
        let pivot = self.alpha + own;
        if self.pulls() && pivot > 0.0 { 1.0 / pivot } else { 0.0 }
    }
}

/// A symmetric matrix: xx, yy, zz, xy, xz, yz.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Symmetric([f64; 6]);

impl Symmetric {
    /// g (I - n n^T).
    fn across(n: Vec3<f64>, g: f64) -> Self {
        let mut out = Self([g, g, g, 0.0, 0.0, 0.0]);
        out.add_outer(n, n, -0.5 * g);
        out
    }

    /// Adds c (a b^T + b a^T).
    fn add_outer(&mut self, a: Vec3<f64>, b: Vec3<f64>, c: f64) {
        let pairs =
            [2.0 * a.x * b.x, 2.0 * a.y * b.y, 2.0 * a.z * b.z, a.x * b.y + a.y * b.x, a.x * b.z + a.z * b.x, a.y * b.z + a.z * b.y];
        self.0.iter_mut().zip(pairs).for_each(|(own, pair)| *own += c * pair);
    }

    fn times(&self, v: Vec3<f64>) -> Vec3<f64> {
        let [xx, yy, zz, xy, xz, yz] = self.0;
        Vec3 { x: xx * v.x + xy * v.y + xz * v.z, y: xy * v.x + yy * v.y + yz * v.z, z: xz * v.x + yz * v.y + zz * v.z }
    }

    /// The inverse of this, another, and a mass of inverse w; zero of what is held.
    fn with(&self, w: f64, other: Self) -> Self {
        if w == 0.0 {
            return Self::default();
        }
        let mut a = self.0;
        (0..6).for_each(|k| a[k] += other.0[k] + if k < 3 { 1.0 / w } else { 0.0 });
        // By Cholesky's factor: cofactors cancel where the pull along a stiff rope is much more than the mass.
        let [xx, yy, zz, xy, xz, yz] = a;
        let x = 1.0 / xx.sqrt();
        let (lxy, lxz) = (xy * x, xz * x);
        let y = 1.0 / (yy - lxy * lxy).sqrt();
        let lyz = (yz - lxy * lxz) * y;
        let z = 1.0 / (zz - lxz * lxz - lyz * lyz).sqrt();
        // The inverse of the factor: rows (x, 0, 0), (yx, y, 0), (zx, zy, z).
        let yx = -lxy * x * y;
        let (zx, zy) = (-(lxz * x + lyz * yx) * z, -lyz * y * z);
        Self([x * x + yx * yx + zx * zx, y * y + zy * zy, z * z, yx * y + zx * zy, zx * z, zy * z])
    }
}

/// Moves the points of chains.
pub(super) fn correct(chains: &[Chain], nodes: [&[u32]; 2], x: &mut [Row]) {
    for chain in chains {
        let first = nodes[0][chain.places.start];
        let rows = std::iter::once(first).chain(chain.places.clone().map(|place| nodes[1][place]));
        for (row, to) in rows.zip(&chain.to) {
            let point = &mut x[row as usize];
            if point[3] > 0.0 {
                *point = [to.x as Real, to.y as Real, to.z as Real, point[3]];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A crooked chain of unequal masses, one of them held, one link broken, half of them taut and some rigid.
    fn crooked() -> Chain {
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let weights: Vec<f64> = (0..13).map(|i| if i == 5 { 0.0 } else { 100.0 * (random() + 0.6) }).collect();
        let mut chain = Chain::new(0..12);
        for (i, link) in chain.links.iter_mut().enumerate() {
            let way = Vec3 { x: random(), y: random(), z: random() + 1.0 };
            let alpha = if i % 3 == 0 { 1e-7 } else { 10.0 * (random() + 0.6) };
            *link = Link { weights: [weights[i], weights[i + 1]], rest: 1.0, alpha, broken: i == 8, ..Link::default() };
            link.aim(way, random());
        }
        chain.lambda.iter_mut().for_each(|lambda| *lambda = 0.01 * random());
        chain
    }

    #[test]
    fn elimination_solves_the_equations() {
        let mut chain = crooked();
        chain.pull();
        let (taut, before) = (chain.links.iter().filter(|link| link.g > 0.0).count(), chain.lambda.clone());
        assert!((3..11).contains(&taut), "{taut}");
        chain.eliminate();
        let mut left: Vec<Vec3<f64>> = (0..13)
            .map(|i| chain.links.get(i).map_or_else(|| chain.links[11].weights[1], |link| link.weights[0]))
            .zip(&chain.ways)
            .map(|(w, d)| if w > 0.0 { *d * (1.0 / w) } else { *d })
            .collect();
        assert!(left[5].norm() == 0.0 && left[6].norm() > 1e-4);
        for (i, link) in chain.links.iter().enumerate() {
            let (way, change) = (chain.ways[i + 1] - chain.ways[i], chain.lambda[i] - before[i]);
            let pull = (way - link.n * link.n.dot(way)) * link.g - link.n * change;
            (left[i], left[i + 1]) = (left[i] - pull, left[i + 1] + pull);
            let stays = if link.broken { change } else { link.n.dot(way) + link.alpha * change + link.c };
            assert!(stays.abs() < 1e-11, "{i}: {stays:e}");
        }
        left[5] = Vec3::default();
        let most = left.iter().map(|v| v.norm()).fold(0.0, f64::max);
        assert!(most < 1e-12, "{most:e}");
    }

    #[test]
    fn tension_is_that_of_a_solution_without_stiffness_across() {
        let (mut across, mut without) = (crooked(), crooked());
        across.pull();
        without.eliminate();
        for (link, lambda) in across.links.iter().zip(&without.lambda) {
            let tension = if link.broken { 0.0 } else { (-lambda).max(0.0) / link.length };
            assert!((link.g - tension).abs() < 1e-11, "{} {tension}", link.g);
        }
    }

    #[test]
    fn inverses_keep_what_is_soft_beside_what_is_stiff() {
        let n = Vec3 { x: 0.6, y: 0.1, z: -0.79 }.normalized();
        let mut stiff = Symmetric::default();
        stiff.add_outer(n, n, 0.5e9);
        let across = n.cross(Vec3 { x: 0.0, y: 0.0, z: 1.0 }).normalized();
        let b = stiff.with(1.0, Symmetric::default());
        assert!((n.dot(b.times(n)) * (1e9 + 1.0) - 1.0).abs() < 1e-5 && (across.dot(b.times(across)) - 1.0).abs() < 1e-6, "{b:?}");
    }
}
