//! Which features are near each other, and how far vertices may go before any two of them could meet.
//!
//!   |x_v - X_v| ≤ b_v = gamma min(reach, nearest distance of a pair with v)             (contact.16)
//!
//! X is where the vertices were when pairs were found. Every point of an edge or a triangle is a mean of its vertices and goes no
//! farther than the farthest of them, so that a pair at the distance d keeps at least (1 - 2 gamma) d > 0; nothing passes through.
//! A plane between the two features of a pair says less: `hold` only stops what goes towards it.        (contact.17)
//! Where it is known which way a vertex is about to go, it may go gamma reach off any part of that way.  (contact.20)
//! What all do in common is done first: X is where that leads.                                            (contact.25)
//!
//! Features that are neighbours at rest are left out as long as they are far from contact; their vertices may go less far off. (contact.24)
//!
//! Source: [chen2025], whose bound is a ball; the planes, the ways and the neighbours are ours.

use super::crossing::crossings;
use super::distance::{Nearest, edge_edge, point_triangle};
use super::topology::Topology;
use super::tree::{Box3, LEAF, Tree, around, grown, union, whole};
use crate::geometry::Vector;
use crate::math::parallel::{self, Tasks, chunks};
use crate::math::{Real, Row, xyz64};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// The part of a distance that each side may use up; below 1/2, so that something is left of it.
pub const GAMMA: f64 = 0.45;
/// Least remaining distance, relative to the distance from the origin: below it, planes would be noise.
const LEAST: f64 = 64.0 * f64::EPSILON;
/// How near neighbours must come to be a pair, over the distance of their contact, and over the whole thickness. The latter, as what vertices of
/// those left out may go is a ball.
const LEFT_OUT: (f64, f64) = (1.5, 0.25);
/// Least distance of pairs that are held along a common way, relative to that from the origin: places there are rounded to single precision.
const LEAST_ALONG: f64 = 64.0 * Real::EPSILON as f64;
/// Leaves per task.
const TASK: usize = 32;
/// Vertices per task.
const CHUNK: usize = 1024;

/// Kind of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PairKind {
    /// The first vertex is a point, the others a triangle.
    PointTriangle,
    /// The first two vertices are an edge, the others another one.
    EdgeEdge,
}

/// Two features that are near each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Its kind.
    pub kind: PairKind,
    /// The vertices of both features.
    pub vertices: [u32; 4],
    /// Weights of the vertices, negative ones for the second feature, whose sum is zero: the sum of weights times vertices
    /// leads from the second feature to the first where they are nearest.
    pub weights: [Real; 4],
    /// That direction, of length 1. Where the features touch, that across both; zero if there is none.
    pub normal: [Real; 3],
    /// Distance [m].
    pub distance: Real,
    /// Distance at which they are in contact [m].
    pub thickness: Real,
}

/// Result of `hold`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Held {
    /// Vertices that were held back.
    pub held: usize,
    /// Fixed vertices that went farther than their bounds: what they do to others is not safe; find pairs more often.
    pub driven: usize,
}

/// Finds pairs. What it finds depends only on topology and positions, never on what was found before.
#[derive(Debug, Default)]
pub struct Detector {
    reach: f64,
    /// Where vertices were, their predicted displacements, and what they have in common of these; the latter two are empty if none.
    start: Vec<Vector>,
    predicted: Vec<Vector>,
    common: Vec<Vector>,
    /// Where the common displacements lead, and those beside them.
    at: Vec<Vector>,
    ways: Vec<Vector>,
    /// The longest of them [m].
    longest: f64,
    /// How far off its way each vertex may go, over gamma: the reach, or less beside neighbours that are left out [m]. Bits of numbers that
    /// are not negative, which sort like them.
    radius: Vec<AtomicU64>,
    points: Tree,
    edges: Tree,
    triangles: Tree,
    pairs: Vec<Pair>,
    bounds: Vec<f64>,
    /// Vertices that may be on the wrong side of something: pairs with one on each side are left alone.
    loose: Vec<bool>,
    /// Pairs of each vertex: those of v are `lists[first[v]..first[v + 1]]`. Empty until `hold` needs them.
    first: Vec<u32>,
    lists: Vec<u32>,
    /// Workspace of `hold`: vertices that went too far, and the plane of each pair.
    far: Vec<bool>,
    chosen: Vec<Plane>,
    nearest: Vec<AtomicU64>,
}

impl Detector {
    /// Nothing found yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Leaves alone all pairs that have one of these vertices on either side, without contact and without bounds: those of a
    /// tangle, see `tangled`. One flag per vertex, or none at all.
    pub fn set_loose(&mut self, loose: Vec<bool>) {
        self.loose = loose;
    }

    /// Pairs nearer than the reach: points with triangles, then edges with edges, each sorted by their features.
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// How far each vertex may go [m] from where it was, in any direction.
    pub fn bounds(&self) -> &[f64] {
        &self.bounds
    }

    /// Former positions of the vertices, moved along with what they have in common [m].
    pub fn at(&self) -> &[Vector] {
        &self.at
    }

    /// Finds all pairs of features nearer than `reach` [m]. `x` has a row for each vertex of the topology, at least.
    pub fn detect(&mut self, topology: &Topology, x: &[Row], reach: f64) {
        self.detect_along(topology, x, &[], &[], reach);
    }

    /// Finds all pairs of features that could come nearer than `reach` [m] while each vertex goes some part of its way [m]; without
    /// ways, none moves. `common` is the part of them that all are sure to go together, see `common_ways`; none of it if empty. Rows of all for
    /// each vertex of the topology, at least. Neighbours at rest that stay away from contact are no pairs.
    pub fn detect_along(&mut self, topology: &Topology, x: &[Row], ways: &[Vector], common: &[Vector], reach: f64) {
        self.reach = if reach.is_finite() { reach.max(0.0) } else { 0.0 };
        self.first.clear();
        self.pairs.clear();
        let n = topology.vertices();
        if x.len() < n || ways.len() < n && !ways.is_empty() {
            self.bounds = vec![0.0; n];
            return;
        }
        self.start.resize(n, Vector::default());
        chunks(&mut self.start, |start, at| at.iter_mut().zip(&x[start..]).for_each(|(p, x)| *p = xyz64(*x)));
        // A way that is not finite is none.
        let finite = |w: &Vector| if w.norm_sq().is_finite() { *w } else { Vector::default() };
        self.predicted.clear();
        self.predicted.extend(ways.iter().take(n).map(finite));
        self.common.clear();
        if common.len() >= n && !ways.is_empty() {
            self.common.extend(common.iter().take(n).map(finite));
        }
        self.find(topology);
    }

    /// Finds them beside the common displacements.
    fn find(&mut self, topology: &Topology) {
        let n = topology.vertices();
        self.first.clear();
        self.pairs.clear();
        self.at.clone_from(&self.start);
        self.ways.clone_from(&self.predicted);
        self.at.iter_mut().zip(&self.common).for_each(|(p, common)| *p = *p + *common);
        self.ways.iter_mut().zip(&self.common).for_each(|(w, common)| *w = *w - *common);
        self.longest = self.ways.iter().map(|w| w.norm_sq()).fold(0.0, f64::max).sqrt();
        self.radius.clear();
        self.radius.resize_with(n, || AtomicU64::new(self.reach.to_bits()));
        self.fit(topology);
        let point_triangle = self.with_triangles(topology);
        let edge_edge = self.with_edges(topology);
        // Sorted by the first vertex: points have one, edges the smaller of two.
        append(&mut self.pairs, &point_triangle, n);
        append(&mut self.pairs, &edge_edge, n);
        self.bound(n);
    }

    /// The result of `intersections`, faster, with the trees of this detector.
    pub fn intersections(&mut self, topology: &Topology, x: &[Row]) -> Vec<(u32, u32)> {
        crossings(topology, x, &mut self.edges, &mut self.triangles)
    }

    /// Fits the trees to the positions.
    fn fit(&mut self, topology: &Topology) {
        let (at, ways) = (&self.at, &self.ways);
        let finite = |p: &Vector| p.norm_sq().is_finite();
        let origin = topology.points().iter().map(|v| at[*v as usize]).find(finite).unwrap_or_default();
        let (points, edges, triangles) = (topology.points(), topology.edges(), topology.triangles());
        self.points.fit(points.len(), |i| swept([points[i as usize]], at, ways, origin));
        self.edges.fit(edges.len(), |i| swept(edges[i as usize], at, ways, origin));
        self.triangles.fit(triangles.len(), |i| swept(triangles[i as usize], at, ways, origin));
    }

    /// Positions of some vertices. Not `array::map`, which would be a call.
    #[inline(always)]
    fn two([a, b]: [u32; 2], x: &[Vector]) -> [Vector; 2] {
        [x[a as usize], x[b as usize]]
    }

    #[inline(always)]
    fn three([a, b, c]: [u32; 3], x: &[Vector]) -> [Vector; 3] {
        [x[a as usize], x[b as usize], x[c as usize]]
    }

    #[inline(always)]
    fn four(&self, [a, b, c, d]: [u32; 4]) -> [Vector; 4] {
        [self.at[a as usize], self.at[b as usize], self.at[c as usize], self.at[d as usize]]
    }

    fn with_triangles(&self, topology: &Topology) -> Vec<Vec<Pair>> {
        let (points, triangles) = (topology.points(), topology.triangles());
        search::<false>(&self.points, &self.triangles, self.reach, |i, j, found| {
            let (v, t) = (points[i as usize], triangles[j as usize]);
            if topology.meet([v], t) {
                let near = point_triangle(self.at[v as usize], Self::three(t, &self.at));
                let rest = |x: &[Vector]| point_triangle(x[v as usize], Self::three(t, x)).distance_sq.sqrt();
                self.keep(topology, PairKind::PointTriangle, [v, t[0], t[1], t[2]], near, rest, found);
            }
        })
    }

    fn with_edges(&self, topology: &Topology) -> Vec<Vec<Pair>> {
        let edges = topology.edges();
        search::<true>(&self.edges, &self.edges, self.reach, |i, j, found| {
            let (e, f) = (edges[i.min(j) as usize], edges[i.max(j) as usize]);
            if topology.meet(e, f) {
                let near = edge_edge(Self::two(e, &self.at), Self::two(f, &self.at));
                let rest = |x: &[Vector]| edge_edge(Self::two(e, x), Self::two(f, x)).distance_sq.sqrt();
                self.keep(topology, PairKind::EdgeEdge, [e[0], e[1], f[0], f[1]], near, rest, found);
            }
        })
    }

    /// Keeps a pair that is near.
    #[inline(always)]
    fn keep(
        &self,
        topology: &Topology,
        kind: PairKind,
        vertices: [u32; 4],
        near: Nearest,
        rest: impl Fn(&[Vector]) -> f64,
        found: &mut Vec<Pair>,
    ) {
        let far = self.reach + 2.0 * self.longest;
        if near.distance_sq >= far * far || near.distance_sq.is_nan() || self.is_tangled(kind, vertices) {
            return;
        }
        let distance = near.distance_sq.sqrt();
        let p = self.four(vertices);
        let w = near.weights;
        let mut n = p[0] * w[0] + p[1] * w[1] + p[2] * w[2] + p[3] * w[3];
        if distance == 0.0 {
            n = match kind {
                PairKind::PointTriangle => (p[2] - p[1]).cross(p[3] - p[1]),
                PairKind::EdgeEdge => (p[1] - p[0]).cross(p[3] - p[2]),
            };
        }
        let n = n.tamed().normalized();
        let left = distance - self.approach(kind, vertices, n);
        if !n.norm_sq().is_finite() || left >= self.reach {
            return;
        }
        let (thickness, whole) = match topology.neighbours(vertices, w, self.reach) {
            Some((thickness, whole)) => (thickness, whole),
            None => (topology.thickness(vertices[0], vertices[3], rest), f64::INFINITY),
        };
        if left >= (LEFT_OUT.0 * thickness).max(LEFT_OUT.1 * whole) {
            lower(&self.radius, vertices, left);
            return;
        }
        found.push(Pair {
            kind,
            vertices,
            weights: [w[0] as Real, w[1] as Real, w[2] as Real, w[3] as Real],
            normal: [n.x as Real, n.y as Real, n.z as Real],
            distance: distance as Real,
            thickness: thickness as Real,
        });
    }

    /// How far the features of a pair could come towards each other along a direction from the second to the first [m].
    #[inline(always)]
    fn approach(&self, kind: PairKind, vertices: [u32; 4], n: Vector) -> f64 {
        if self.ways.is_empty() {
            return 0.0;
        }
        let [a, b, c, d] = vertices.map(|v| n.dot(self.ways[v as usize]));
        match kind {
            PairKind::PointTriangle => b.max(c).max(d).max(0.0) - a.min(0.0),
            PairKind::EdgeEdge => c.max(d).max(0.0) - a.min(b).min(0.0),
        }
    }

    /// The nearest place to where a vertex has gone that it was expected at: on its way.
    #[inline(always)]
    fn on_way(&self, v: usize, gone: Vector) -> Vector {
        let Some(way) = self.ways.get(v) else { return Vector::default() };
        let length_sq = way.norm_sq();
        if length_sq > 0.0 { *way * (gone.dot(*way) / length_sq).clamp(0.0, 1.0) } else { Vector::default() }
    }

    fn is_tangled(&self, kind: PairKind, v: [u32; 4]) -> bool {
        let loose = |v: u32| self.loose.get(v as usize).is_some_and(|l| *l);
        match kind {
            PairKind::PointTriangle => loose(v[0]) && (loose(v[1]) || loose(v[2]) || loose(v[3])),
            PairKind::EdgeEdge => (loose(v[0]) || loose(v[1])) && (loose(v[2]) || loose(v[3])),
        }
    }

    /// The distance that is left to a pair [m].
    fn least(&self, pair: &Pair) -> f64 {
        let p = self.at[pair.vertices[3] as usize];
        LEAST * p.x.abs().max(p.y.abs()).max(p.z.abs())
    }

    /// How far off its way a vertex may go, over gamma [m].
    #[inline(always)]
    fn radius(&self, v: usize) -> f64 {
        f64::from_bits(self.radius[v].load(Relaxed))
    }

    /// The bound of each vertex. Distances that are not negative sort like their bits.
    fn bound(&mut self, n: usize) {
        let way = |v: usize| self.ways.get(v).map_or(0.0, |w| w.norm() / GAMMA);
        let nearest = (0..n).map(|v| AtomicU64::new((self.radius(v) + way(v)).to_bits())).collect();
        self.nearest = nearest;
        let this = &*self;
        let lower = |pair: &Pair| lower(&this.nearest, pair.vertices, (usable(pair) - this.least(pair)).max(0.0));
        this.pairs.chunks(CHUNK).in_parallel(|pairs| pairs.iter().for_each(lower));
        self.bounds.clear();
        self.bounds.extend(self.nearest.iter().map(|d| GAMMA * f64::from_bits(d.load(Relaxed))));
    }

    /// Holds back every vertex that went too far from where it was when pairs were found: to gamma times its radius off its way, and
    /// to its side of a plane between the features of each of its pairs. What goes along or away from a plane is not held back. As
    /// long as all positions since pairs were found have passed through here, or lie between ones that have, nothing has met.
    pub fn hold(&mut self, topology: &Topology, x: &mut [Row]) -> Held {
        let n = topology.vertices();
        if x.len() < n || self.at.len() < n {
            return Held::default();
        }
        if !self.far(x) {
            return Held::default();
        }
        if self.common.is_empty() {
            return self.hold_those(topology, x);
        }
        let mut along = x.to_vec();
        let held = self.hold_those(topology, &mut along);
        if held.held == 0 {
            return held;
        }
        // Who is stopped by something else does not go along, and is held to where it was. Of both, what changes less.
        let changed = |to: &[Row]| to.iter().zip(&*x).map(|(a, b)| (xyz64(*a) - xyz64(*b)).norm_sq()).sum::<f64>();
        let size = self.at.iter().map(|p| p.norm_sq()).filter(|d| d.is_finite()).fold(0.0, f64::max).sqrt();
        // The places that vertices are held to along the way are rounded.
        let rounded = self.pairs.iter().any(|pair| f64::from(pair.distance) < LEAST_ALONG * size);
        let mut there = self.at_start(topology);
        let mut back = x.to_vec();
        let otherwise = if there.far(&back) { there.hold_those(topology, &mut back) } else { Held::default() };
        if rounded || changed(&back) <= changed(&along) {
            *self = there;
            x.copy_from_slice(&back);
            return otherwise;
        }
        self.swap_lasting(&mut there);
        x.copy_from_slice(&along);
        held
    }

    /// One that has found pairs from where vertices were, without what they have in common.
    fn at_start(&mut self, topology: &Topology) -> Self {
        let mut other = Self { reach: self.reach, ..Self::default() };
        other.swap_lasting(self);
        other.find(topology);
        other
    }

    /// Swaps what does not depend on the common motion.
    fn swap_lasting(&mut self, other: &mut Self) {
        std::mem::swap(&mut self.start, &mut other.start);
        std::mem::swap(&mut self.predicted, &mut other.predicted);
        std::mem::swap(&mut self.loose, &mut other.loose);
        std::mem::swap(&mut self.points, &mut other.points);
        std::mem::swap(&mut self.edges, &mut other.edges);
        std::mem::swap(&mut self.triangles, &mut other.triangles);
    }

    /// Finds the vertices that went too far, and says whether there are any.
    fn far(&mut self, x: &[Row]) -> bool {
        let mut far = std::mem::take(&mut self.far);
        far.resize(self.at.len(), false);
        let is_far = |v: usize| {
            let way = xyz64(x[v]) - self.at[v];
            let (length_sq, radius) = (way.norm_sq(), GAMMA * self.radius(v));
            let off = || !self.ways.is_empty() && (way - self.on_way(v, way)).norm_sq() > radius * radius;
            // Non-finite values are left for other checks to find.
            length_sq.is_finite() && (length_sq > self.bounds[v] * self.bounds[v] || off())
        };
        chunks(&mut far, |start, far| far.iter_mut().enumerate().for_each(|(k, far)| *far = is_far(start + k)));
        self.far = far;
        self.far.iter().any(|far| *far)
    }

    fn hold_those(&mut self, topology: &Topology, x: &mut [Row]) -> Held {
        if self.first.is_empty() {
            self.list(self.far.len());
        }
        let mut chosen = std::mem::take(&mut self.chosen);
        chosen.resize(self.pairs.len(), Plane::default());
        let far = &*self.far;
        // Planes towards which the ways lead that are there before anyone is held: all sides of a pair must see the same one.
        let ways: &[Row] = x;
        chunks(&mut chosen, |start, chosen| {
            for (pair, chosen) in self.pairs[start..].iter().zip(chosen) {
                if pair.vertices.iter().any(|v| far[*v as usize]) {
                    *chosen = self.choose(pair, ways, far);
                }
            }
        });
        let this = &*self;
        let task = |(c, x): (usize, &mut [Row])| {
            let mut counts = Held::default();
            for (i, x) in x.iter_mut().enumerate() {
                let v = c * CHUNK + i;
                if far[v] && topology.is_fixed(v as u32) {
                    counts.driven += 1;
                } else if far[v] {
                    counts.held += usize::from(this.hold_one(v, x, &chosen));
                }
            }
            counts
        };
        let counts: Vec<Held> = x[..far.len()].chunks_mut(CHUNK).enumerate().map_in_parallel(task);
        self.chosen = chosen;
        counts.iter().fold(Held::default(), |a, b| Held { held: a.held + b.held, driven: a.driven + b.driven })
    }

    fn hold_one(&self, v: usize, x: &mut Row, chosen: &[Plane]) -> bool {
        let lists = &self.lists[self.first[v] as usize..self.first[v + 1] as usize];
        let wall = |i: &u32| {
            let pair = &self.pairs[*i as usize];
            let place = pair.vertices.iter().position(|u| *u as usize == v).unwrap_or(0);
            chosen[*i as usize].wall(pair, place)
        };
        let walls: Vec<Wall> = lists.iter().map(wall).collect();
        let radius = GAMMA * self.radius(v);
        let inside = |c: Vector| (c - self.on_way(v, c)).norm_sq() <= radius * radius && walls.iter().all(|w| w.allows(c));
        let way = xyz64(*x) - self.at[v];
        if inside(way) {
            return false;
        }
        // Along each plane as far as it goes; what several planes leave over is cut to the part of the way that all allow.
        let on_way = self.on_way(v, way);
        let off = way - on_way;
        let mut c = on_way + off * (radius / off.norm()).min(1.0);
        for w in &walls {
            c = w.slide(c);
        }
        c = c * walls.iter().fold(1.0, |s: f64, w| s.min(w.part(c)));
        // Each number is rounded towards where it was. That need not be allowed: less, then, and in the end nothing.
        let w = x[3];
        for _ in 0..4 {
            *x = towards(self.at[v], c, w);
            if inside(xyz64(*x) - self.at[v]) {
                return true;
            }
            c = c * 0.75;
        }
        *x = towards(self.at[v], Vector::default(), w);
        true
    }

    /// The plane between the features of a pair that leaves most of the ways of its vertices, and all of those that are not held.
    fn choose(&self, pair: &Pair, x: &[Row], far: &[bool]) -> Plane {
        let way = |k: usize| {
            let v = pair.vertices[k] as usize;
            xyz64(x[v]) - self.at[v]
        };
        let ways = [way(0), way(1), way(2), way(3)];
        let part = |plane: &Plane| {
            let part = |k: usize| {
                let part = plane.wall(pair, k).part(ways[k]);
                if part < 1.0 && !far[pair.vertices[k] as usize] { -1.0 } else { part }
            };
            part(0).min(part(1)).min(part(2)).min(part(3))
        };
        let mut best = self.plane(pair, 0, &ways);
        let mut most = part(&best);
        for choice in 1..3 {
            if most < 1.0 {
                let plane = self.plane(pair, choice, &ways);
                let part = part(&plane);
                if part > most {
                    (best, most) = (plane, part);
                }
            }
        }
        best
    }

    /// A plane between the features of a pair: 0 across the way from one to the other, 1 that of the triangle or of both edges (of
    /// parallel ones: of the edge and of the way that one goes past the other), 2 the first one turned to lie along that way. If it
    /// does not part them, a ball.
    fn plane(&self, pair: &Pair, choice: u8, ways: &[Vector; 4]) -> Plane {
        let p = self.four(pair.vertices);
        let [nx, ny, nz] = pair.normal;
        let across = Vector { x: f64::from(nx), y: f64::from(ny), z: f64::from(nz) };
        let past = || {
            let way = |k: usize| ways[k] * f64::from(pair.weights[k]);
            (way(0) + way(1) + way(2) + way(3)).normalized()
        };
        let mut normal = match (choice, pair.kind) {
            (0, _) => across,
            (1, PairKind::PointTriangle) => (p[2] - p[1]).cross(p[3] - p[1]).normalized(),
            (1, PairKind::EdgeEdge) => {
                let (u, v) = ((p[1] - p[0]).normalized(), (p[3] - p[2]).normalized());
                let both = u.cross(v);
                if both.norm_sq() > 1e-6 { both.normalized() } else { u.cross(past()).normalized() }
            }
            _ => {
                let past = past();
                (across - past * across.dot(past)).normalized()
            }
        };
        if normal.dot(across) < 0.0 {
            normal = -normal;
        }
        // From one of them: differences of near places are exact.
        let along = [normal.dot(p[0] - p[3]), normal.dot(p[1] - p[3]), normal.dot(p[2] - p[3]), 0.0];
        let (low, high) = match pair.kind {
            PairKind::PointTriangle => (along[0], along[1].max(along[2]).max(along[3])),
            PairKind::EdgeEdge => (along[0].min(along[1]), along[2].max(along[3])),
        };
        let d = usable(pair);
        let (gap, middle) = (low - high, 0.5 * (low + high));
        // A plane that is crooked by rounding is none. The others may be nearer to the features than their distance is.
        let parts = d > 0.0 && gap >= if choice == 0 { 0.95 * d } else { 0.0 };
        let left = (0.5 * (gap - self.least(pair))).min(GAMMA * gap).max(0.0);
        let room = |k: usize, sign: f64| sign * (along[k] - middle) - 0.5 * gap + left;
        let second = if pair.kind == PairKind::PointTriangle { 1.0 } else { -1.0 };
        match parts {
            true => Plane { normal, room: [room(0, 1.0), room(1, -second), room(2, -1.0), room(3, -1.0)] },
            false => {
                Plane { normal: Vector::default(), room: [if choice == 0 { GAMMA * (d - self.least(pair)).max(0.0) } else { 0.0 }; 4] }
            }
        }
    }

    /// The pairs of each vertex.
    fn list(&mut self, n: usize) {
        self.first.resize(n + 1, 0);
        for v in self.pairs.iter().flat_map(|p| p.vertices) {
            self.first[v as usize + 1] += 1;
        }
        for v in 0..n {
            self.first[v + 1] += self.first[v];
        }
        let mut next = self.first.clone();
        self.lists.clear();
        self.lists.resize(4 * self.pairs.len(), 0);
        for (i, p) in self.pairs.iter().enumerate() {
            for v in p.vertices {
                self.lists[next[v as usize] as usize] = i as u32;
                next[v as usize] += 1;
            }
        }
    }
}

/// Lowers the numbers of vertices to a distance [m].
#[inline(always)]
fn lower(of: &[AtomicU64], vertices: [u32; 4], distance: f64) {
    let d = distance.to_bits();
    for v in vertices {
        if of[v as usize].load(Relaxed) > d {
            of[v as usize].fetch_min(d, Relaxed);
        }
    }
}

/// The distance of a pair [m], without what rounding to single precision may have added.
fn usable(pair: &Pair) -> f64 {
    f64::from(pair.distance) * (1.0 - f64::from(f32::EPSILON))
}

/// A plane between two features, and how far from it each vertex is, less what must be left.
#[derive(Debug, Clone, Copy, Default)]
struct Plane {
    normal: Vector,
    room: [f64; 4],
}

impl Plane {
    /// The wall for the vertex at a position of the pair.
    fn wall(&self, pair: &Pair, place: usize) -> Wall {
        let first = place == 0 || place == 1 && pair.kind == PairKind::EdgeEdge;
        Wall { normal: if first { self.normal } else { -self.normal }, room: self.room[place] }
    }
}

/// A plane that a vertex must not reach: normal·c ≥ -room for its way c. Without a normal, a ball: |c| ≤ room.
#[derive(Debug, Clone, Copy)]
struct Wall {
    normal: Vector,
    room: f64,
}

impl Wall {
    fn is_ball(&self) -> bool {
        self.normal.norm_sq() == 0.0
    }

    fn allows(&self, c: Vector) -> bool {
        if self.is_ball() { c.norm_sq() <= self.room * self.room } else { self.normal.dot(c) >= -self.room }
    }

    /// A way along the plane, where it would cross it.
    fn slide(&self, c: Vector) -> Vector {
        let over = self.normal.dot(c) + self.room;
        if self.is_ball() || over >= 0.0 { c } else { c - self.normal * (over / self.normal.norm_sq()) }
    }

    /// The part of a way that stays on this side.
    fn part(&self, c: Vector) -> f64 {
        let towards = if self.is_ball() { c.norm() } else { -self.normal.dot(c) };
        if towards > self.room { (self.room / towards).max(0.0) } else { 1.0 }
    }
}

/// a + c, each number rounded towards a, and a fourth number.
fn towards(a: Vector, c: Vector, w: Real) -> Row {
    let round = |a: f64, c: f64| {
        let r = (a + c) as Real;
        let over = (f64::from(r) - a).abs() > c.abs();
        match (over, f64::from(r) > a) {
            (false, _) => r,
            (true, true) => r.next_down(),
            (true, false) => r.next_up(),
        }
    };
    [round(a.x, c.x), round(a.y, c.y), round(a.z, c.z), w]
}

/// Pulls every vertex that went farther than its bound from `at` back to the sphere around it, and returns how many. Numbers are
/// rounded towards `at`, so that none is farther than its bound. What is not finite stays so, for others to find.
pub fn truncate(at: &[Vector], x: &mut [Row], bounds: &[f64]) -> usize {
    let one = |((a, x), b): ((&Vector, &mut Row), &f64)| {
        let way = xyz64(*x) - *a;
        let length = way.norm();
        if length <= *b || !length.is_finite() {
            return 0;
        }
        *x = towards(*a, way * (b / length), x[3]);
        1
    };
    let tasks = at.chunks(CHUNK).zip(x.chunks_mut(CHUNK)).zip(bounds.chunks(CHUNK));
    tasks.map_in_parallel(|((at, x), bounds)| at.iter().zip(x).zip(bounds).map(one).sum::<usize>()).into_iter().sum()
}

/// A box around where vertices are and are about to go.
#[inline(always)]
fn swept<const N: usize>(vertices: [u32; N], at: &[Vector], ways: &[Vector], origin: Vector) -> Box3 {
    let here = around(vertices.map(|v| at[v as usize]), origin);
    if ways.is_empty() { here } else { union(&here, &around(vertices.map(|v| at[v as usize] + ways[v as usize]), origin)) }
}

/// Calls `f` for all features i of `from` and j of `with` whose boxes are nearer than `reach`. In a tree with ITSELF each two come
/// once, and none with itself.
fn search<const ITSELF: bool>(from: &Tree, with: &Tree, reach: f64, f: impl Fn(u32, u32, &mut Vec<Pair>) + Sync) -> Vec<Vec<Pair>> {
    let reach = (reach * (1.0 + f64::from(f32::EPSILON))) as f32;
    let task = |task: usize| {
        let (mut found, mut leaves) = (Vec::new(), Vec::new());
        for leaf in task * TASK..((task + 1) * TASK).min(from.n_leaves()) {
            leaves.clear();
            with.walk(&grown(&whole(from, leaf), reach), if ITSELF { leaf as u32 } else { 0 }, |l| leaves.push(l));
            for (place, i) in from.features(leaf).iter().enumerate() {
                let b = grown(&from.bounds(leaf, place), reach);
                for l in &leaves {
                    let mut mask = with.mask(*l, &b);
                    if ITSELF && *l as usize == leaf {
                        mask &= !1 << place;
                    }
                    while mask != 0 {
                        f(*i, with.features(*l as usize)[mask.trailing_zeros() as usize % LEAF], &mut found);
                        mask &= mask - 1;
                    }
                }
            }
        }
        found
    };
    parallel::map(from.n_leaves().div_ceil(TASK), task)
}

/// Appends pairs, sorted by their vertices, of which there are n.
fn append(pairs: &mut Vec<Pair>, found: &[Vec<Pair>], n: usize) {
    let Some(any) = found.iter().flatten().next() else { return };
    // How many begin with each vertex; then where the next one of them goes.
    let mut next = vec![0_u32; n + 1];
    found.iter().flatten().for_each(|p| next[p.vertices[0] as usize + 1] += 1);
    (0..n).for_each(|v| next[v + 1] += next[v]);
    let ends: Vec<u32> = next[1..].to_vec();
    let first = pairs.len();
    pairs.resize(first + ends[n - 1] as usize, *any);
    let mut rest = &mut pairs[first..];
    for p in found.iter().flatten() {
        let at = &mut next[p.vertices[0] as usize];
        rest[*at as usize] = *p;
        *at += 1;
    }
    let mut runs = Vec::with_capacity(n.div_ceil(CHUNK));
    let mut done = 0;
    for ends in ends.chunks(CHUNK) {
        let (these, others) = rest.split_at_mut((ends[ends.len() - 1] - done) as usize);
        runs.push((these, ends, done));
        done = ends[ends.len() - 1];
        rest = others;
    }
    runs.into_iter().in_parallel(|(pairs, ends, done)| {
        let mut start = 0;
        for end in ends {
            let end = (end - done) as usize;
            pairs[start..end].sort_unstable_by_key(|p| p.vertices);
            start = end;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::super::{Owner, intersections};
    use super::*;

    /// Two sheets that are pressed together until they are as near as numbers can say: nothing passes, and they come apart again.
    #[test]
    fn layers_never_stick_nor_pass_at_the_limit_of_the_numbers() {
        let place = |i: u32, j: u32, z: f64| [10.0 + 0.1 * f64::from(i), 10.0 + 0.1 * f64::from(j) + 0.03 * f64::from(i), z];
        let sheet = |z: f64| (0..36).map(move |k| place(k % 6, k / 6, z).map(|c| c as Real)).map(|[x, y, z]| [x, y, z, 1.0]);
        let mut x: Vec<Row> = sheet(10.0).chain(sheet(10.01)).collect();
        x[36..].iter_mut().for_each(|x| x[0] += 0.043);
        let squares = (0..72).filter(|k| k % 6 < 5 && k % 36 < 30);
        let triangles: Vec<[u32; 3]> = squares.flat_map(|k| [[k, k + 1, k + 7], [k, k + 7, k + 6]]).collect();
        let mut topology = Topology::new(72);
        topology.add(Owner { radius: 1e-3, itself: true, hair: false }, &triangles, &[], &[]);
        let mut detector = Detector::new();
        let least = |detector: &Detector| detector.pairs().iter().map(|p| f64::from(p.distance)).fold(1.0, f64::min);
        for round in 0..60 {
            detector.detect(&topology, &x, 0.02);
            let wrinkle = |v: usize| 1e-3 * ((7 * v + round) % 5) as Real;
            for v in 36..72 {
                x[v][2] -= 0.01 + wrinkle(v);
                x[v][1] += wrinkle(v);
            }
            (0..36).for_each(|v| x[v][2] += wrinkle(v));
            assert!(detector.hold(&topology, &mut x).held > 30);
            assert_eq!(intersections(&topology, &x), []);
        }
        detector.detect(&topology, &x, 0.02);
        let near = least(&detector);
        assert!(near > 0.0 && near < 256.0 * 10.0 * f64::from(Real::EPSILON), "{near}");
        x[36..].iter_mut().for_each(|x| x[2] += 5e-3);
        detector.hold(&topology, &mut x);
        detector.detect(&topology, &x, 0.02);
        assert!(least(&detector) > 4e-3, "{}", least(&detector));
    }
}
