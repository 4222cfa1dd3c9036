//! Links in a row, each chain solved as a whole. Sweeps from link to link carry a load along a chain of n links in n² of them; one linear
//! system carries it at once, whatever n. Its unknowns are the ways d of the points and the multipliers of the links:
//!
//!   m_i d_i + sum over links of g (I - n n^T)(d_i - d_j) = sum over links of ± n dlambda                    (positions.7)
//!   n . (d_{i+1} - d_i) + alpha dlambda = -(C + alpha lambda),   g = max(0, -lambda/l)
//!
//! g is the stiffness across a taut link: without it tension acts in the direction of a sub-step before, and a string under much tension
//! shakes itself to pieces. The tension is that of a first solution without g. Points and multipliers are eliminated in turn from one end to
//! the other, in time proportional to n and with any compliance, in double precision.
//!
//! Source: [macklin2016], with the geometric stiffness of [tournier2015]. Verified in `tests/chains.rs`.

use super::Projection;
use crate::math::{Real, Row, Vec3, xyz64};
use std::ops::Range;

/// Compliance at least, over the inverse masses of both ends: rigid links between held points stay solvable.
const RIDGE: f64 = 1e-9;
/// Newton's method ends where no link is farther from its equation than this, over its length; or after so many steps. Mostly one is enough; the
/// end of a whip takes more.
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
    /// Ways of its points [m]; scratch.
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
                farthest = farthest.max(if link.broken { 0.0 } else { link.c.abs() / link.rest });
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
            link.g = if tension > 0.0 && link.length > 0.0 && !link.broken { tension / link.length } else { 0.0 };
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

    /// Its direction and error, of the way between its points.
    fn aim(&mut self, way: Vec3<f64>, lambda: f64) {
        self.length = way.norm();
        self.n = if self.length > 0.0 { way * (1.0 / self.length) } else { Vec3::default() };
        self.c = self.length - self.rest + self.alpha * lambda;
    }

    /// Of a multiplier with this on the diagonal beside the compliance.
    fn inverse_pivot(&self, own: f64) -> f64 {
        let pivot = self.alpha + own;
        if self.broken || pivot <= 0.0 { 0.0 } else { 1.0 / pivot }
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
        let [xx, yy, zz, xy, xz, yz] = a;
        let minors = [yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy, xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz];
        let determinant = xx * minors[0] + xy * minors[3] + xz * minors[4];
        Self(minors.map(|m| m / determinant))
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
