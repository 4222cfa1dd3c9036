//! Triangles whose vertices move, in a tree whose boxes hold them for a whole interval between two keyframes: the closest
//! point at a time, and the first passage of a moving point through a triangle.
//!
//! A point p(s) lies in the plane of a triangle a, b, c when (a - p) . ((b - a) × (c - a)) = 0, a cubic of s where all
//! move straight, and linear where the triangle stands still.                                        (contact.11)

use super::Vector;
use super::bvh::{Feature, Node, build, closest_on_triangle, high, low};
use super::motion::Pose;
use crate::math::functions::{acos, floor};
use crate::math::parallel::{self, Tasks};
use crate::math::rotation::from_axes;
use tumble_interface::Mesh;

/// Triangles with keyframes.
#[derive(Debug, Clone)]
pub struct Facets {
    nodes: Vec<Node>,
    /// Of each interval the lower and upper corner of every node, rounded outward.
    boxes: Vec<Vec<[[f32; 3]; 2]>>,
    triangles: Vec<[u32; 3]>,
    /// Triangles around vertex v: `around[first[v]..first[v + 1]]`.
    first: Vec<u32>,
    around: Vec<u32>,
    times: Vec<f64>,
    frames: Vec<Vec<Vector>>,
    /// Of each interval where nothing of the mesh comes, and nothing is within it.
    apart: Vec<Apart>,
    /// Continuation after the last keyframe: a time among `times`, and the displacement since [m].
    back: Option<(f64, Vector)>,
}

/// Position of a time among the keyframes.
#[derive(Debug, Clone, Copy)]
struct Moment {
    interval: usize,
    /// Part of the interval, 0 to 1.
    s: f64,
    /// Its rate [1/s].
    rate: f64,
    /// Movement of all keyframes since the first round [m].
    gone: Vector,
    /// Time less that on the list of keyframes [s].
    past: f64,
}

/// The closest point of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// The point [m].
    pub point: Vector,
    /// Pseudonormal of the feature it lies on.
    pub normal: Vector,
    /// Its velocity [m/s].
    pub velocity: Vector,
    /// Distance [m].
    pub distance: f64,
}

/// A passage through a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passage {
    /// Part of the way, 0 to 1; less than 0 by round-off.
    pub s: f64,
    /// Unit normal of the triangle.
    pub normal: Vector,
    /// Velocity of the triangle there [m/s].
    pub velocity: Vector,
}

/// Which passages count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    /// Against the normals.
    In,
    /// Along the normals.
    Out,
    /// Either way.
    Both,
}

impl Facets {
    /// Keyframes of a mesh at rising times, with the same triangles; `None` without a triangle that has an area, or if
    /// counts of vertices differ.
    pub fn new(meshes: &[&Mesh], times: &[f64]) -> Option<Self> {
        let frames: Vec<Vec<Vector>> = meshes.iter().map(|m| m.vertices.iter().map(|v| Vector::from(*v)).collect()).collect();
        Self::of(meshes.first()?.triangles.clone(), frames, times.to_vec(), None)
    }

    /// Keyframes of vertices [m] at rising times; after the last it goes on from a time in `back`, moved as much as that says [m].
    pub fn of(mut triangles: Vec<[u32; 3]>, frames: Vec<Vec<Vector>>, times: Vec<f64>, back: Option<(f64, Vector)>) -> Option<Self> {
        let start = frames.first()?;
        if times.len() != frames.len() || frames.iter().any(|f| f.len() != start.len()) {
            return None;
        }
        if triangles.is_empty() || triangles.iter().flatten().any(|i| *i as usize >= start.len()) {
            return None;
        }
        let corner = |t: &[u32; 3]| t.map(|i| start[i as usize]);
        let bounds = |points: &[Vector]| points.iter().fold((points[0], points[0]), |(l, h), p| (low(l, *p), high(h, *p)));
        let mut nodes = Vec::new();
        let middle = |t: &[u32; 3]| corner(t).into_iter().fold(Vector::default(), |a, b| a + b);
        build(&mut nodes, &mut triangles, 0, &|t| bounds(&corner(t)), &middle);
        let mut first = vec![0_u32; start.len() + 1];
        triangles.iter().flatten().for_each(|i| first[*i as usize + 1] += 1);
        for v in 0..start.len() {
            first[v + 1] += first[v];
        }
        let mut next = first.clone();
        let mut around = vec![0; 3 * triangles.len()];
        for (t, corners) in triangles.iter().enumerate() {
            for i in corners {
                around[next[*i as usize] as usize] = t as u32;
                next[*i as usize] += 1;
            }
        }
        let mut facets = Self { nodes, boxes: Vec::new(), triangles, first, around, times, frames, apart: Vec::new(), back };
        let pairs = parallel::map(facets.frames.len().saturating_sub(1).max(1), |k| facets.refit(k));
        facets.boxes = pairs;
        let apart = facets.boxes.iter().map_in_parallel(|boxes| Apart::new(&facets.nodes, boxes));
        facets.apart = apart;
        Some(facets)
    }

    /// The boxes of an interval: they hold both ends, and so all between.
    fn refit(&self, k: usize) -> Vec<[[f32; 3]; 2]> {
        let (a, b) = (&self.frames[k], &self.frames[(k + 1).min(self.frames.len() - 1)]);
        let mut boxes = vec![[[0.0; 3]; 2]; self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate().rev() {
            boxes[i] = if node.count == 0 {
                let ([a, b], [c, d]) = (boxes[i + 1], boxes[node.next as usize]);
                [std::array::from_fn(|k| f32::min(a[k], c[k])), std::array::from_fn(|k| f32::max(b[k], d[k]))]
            } else {
                let range = node.next as usize..(node.next + node.count) as usize;
                let corners = self.triangles[range].iter().flatten().flat_map(|v| [a[*v as usize], b[*v as usize]]);
                let none = Vector { x: f64::INFINITY, y: f64::INFINITY, z: f64::INFINITY };
                let (l, h) = corners.fold((none, -none), |(l, h), p| (low(l, p), high(h, p)));
                [<[f64; 3]>::from(l).map(|x| (x as f32).next_down()), <[f64; 3]>::from(h).map(|x| (x as f32).next_up())]
            };
        }
        boxes
    }

    fn moment(&self, t: f64) -> Moment {
        let last = self.boxes.len() - 1;
        let (t, past, gone) = self.round(t);
        let next = self.times.partition_point(|x| *x <= t);
        let still = |interval, s| Moment { interval, s, rate: 0.0, gone, past };
        if next == 0 || self.frames.len() < 2 {
            return still(0, 0.0);
        }
        if next == self.times.len() {
            return still(last, 1.0);
        }
        let span = self.times[next] - self.times[next - 1];
        Moment { interval: next - 1, s: (t - self.times[next - 1]) / span, rate: 1.0 / span, gone, past }
    }

    /// The time on the list of keyframes, what it is less, and how far all has gone since.
    fn round(&self, t: f64) -> (f64, f64, Vector) {
        if let (Some((from, gone)), Some(last)) = (self.back, self.times.last())
            && t >= *last
            && *last > from
        {
            let n = floor((t - from) / (last - from));
            let past = n * (last - from);
            return (t - past, past, gone * n);
        }
        (t, 0.0, Vector::default())
    }

    /// The first keyframe after a time.
    fn next_key(&self, t: f64) -> Option<f64> {
        // A key as near as round-off is the one at which t is.
        let (local, past, _) = self.round(t + 1e-12 * (1.0 + t.abs()));
        self.times.get(self.times.partition_point(|x| *x <= local)).map(|x| x + past)
    }

    fn vertex(&self, m: Moment, i: u32) -> Vector {
        let (a, b) = self.ends(m, i);
        a + (b - a) * m.s
    }

    fn ends(&self, m: Moment, i: u32) -> (Vector, Vector) {
        let next = (m.interval + 1).min(self.frames.len() - 1);
        (self.frames[m.interval][i as usize], self.frames[next][i as usize])
    }

    /// Whether its vertices never move.
    pub fn is_still(&self) -> bool {
        self.times.len() == 1 && self.back.is_none()
    }

    /// Lower and upper corner of everything at all times [m].
    pub fn bounds(&self) -> (Vector, Vector) {
        let none = Vector { x: f64::INFINITY, y: f64::INFINITY, z: f64::INFINITY };
        if self.back.is_some_and(|(_, gone)| gone != Vector::default()) {
            return (-none, none);
        }
        self.frames.iter().flatten().fold((none, -none), |(l, h), p| (low(l, *p), high(h, *p)))
    }

    /// The triangles, in the order of the tree.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Vertices at time t [m].
    pub fn vertices(&self, t: f64) -> Vec<[f64; 3]> {
        let m = self.moment(t);
        (0..self.frames[0].len() as u32).map(|i| (self.vertex(m, i) + m.gone).into()).collect()
    }

    /// The triangle nearest to p when t = 0, and the weights of its corners in the nearest point.
    pub fn carrier(&self, p: Vector) -> Option<(usize, [f64; 3])> {
        let m = self.moment(0.0);
        let p = p - m.gone;
        let corners = |t: usize| self.triangles[t].map(|i| self.vertex(m, i));
        let closest = |t: usize| closest_on_triangle(p, corners(t)).0;
        let whole = (0..self.triangles.len()).filter(|t| self.face(m, *t).norm_sq() > 0.0);
        let far = whole.map(|t| (t, (closest(t) - p).norm_sq()));
        let (t, _) = far.reduce(|a, b| if b.1 < a.1 { b } else { a })?;
        Some((t, Self::weights(closest(t), corners(t))))
    }

    /// The place of a point of a triangle at time t, with axes along its first side and its normal.
    pub fn pose(&self, t: usize, weights: [f64; 3], time: f64) -> Pose {
        let m = self.moment(time);
        let [a, b, c] = self.triangles[t].map(|i| self.vertex(m, i));
        let turn = from_axes((b - a).normalized(), self.face(m, t));
        Pose { turn, shift: a * weights[0] + b * weights[1] + c * weights[2] + m.gone }
    }

    /// Largest speed of a vertex [m/s].
    pub fn fastest(&self) -> f64 {
        let ways = self.frames.windows(2).zip(self.times.windows(2));
        let speed =
            |(f, t): (&[Vec<Vector>], &[f64])| f[0].iter().zip(&f[1]).map(|(a, b)| (*b - *a).norm()).fold(0.0, f64::max) / (t[1] - t[0]);
        ways.map(speed).fold(0.0, f64::max)
    }

    /// Barycentric weights of a point in a triangle.
    fn weights(p: Vector, [a, b, c]: [Vector; 3]) -> [f64; 3] {
        let (u, v, w) = (b - a, c - a, p - a);
        let (uu, uv, vv, wu, wv) = (u.dot(u), u.dot(v), v.dot(v), w.dot(u), w.dot(v));
        let det = uu * vv - uv * uv;
        if det <= 0.0 {
            return [1.0, 0.0, 0.0];
        }
        let (y, z) = ((vv * wu - uv * wv) / det, (uu * wv - uv * wu) / det);
        [1.0 - y - z, y, z]
    }

    fn velocity(&self, m: Moment, t: usize, weights: [f64; 3]) -> Vector {
        let mut v = Vector::default();
        if m.rate > 0.0 {
            for (i, w) in self.triangles[t].into_iter().zip(weights) {
                let (a, b) = self.ends(m, i);
                v = v + (b - a) * (w * m.rate);
            }
        }
        v
    }

    fn face(&self, m: Moment, t: usize) -> Vector {
        let [a, b, c] = self.triangles[t].map(|i| self.vertex(m, i));
        (b - a).cross(c - a).normalized()
    }

    fn about(&self, v: u32) -> &[u32] {
        &self.around[self.first[v as usize] as usize..self.first[v as usize + 1] as usize]
    }

    /// Whether p is certain to be outside a closed mesh at time t; what is close to it never is certain.
    pub fn apart(&self, p: Vector, t: f64) -> bool {
        let m = self.moment(t);
        self.apart[m.interval].holds(p - m.gone)
    }

    /// The closest point to p at time t, if one lies nearer than `within` [m].
    pub fn nearest(&self, p: Vector, t: f64, within: f64) -> Option<Nearest> {
        let m = self.moment(t);
        let p = p - m.gone;
        let boxes = &self.boxes[m.interval];
        let mut limit = within * within;
        let mut best = None;
        // The tree halves its triangles: it is never deeper than this.
        let mut stack = [(0_u32, 0.0_f64); 64];
        let mut n = 1;
        stack[0].1 = distance_sq(&boxes[0], p);
        while n > 0 {
            n -= 1;
            let (i, far) = stack[n];
            if far >= limit {
                continue;
            }
            let node = &self.nodes[i as usize];
            if node.count == 0 {
                let (left, right) = (i + 1, node.next);
                let (a, b) = (distance_sq(&boxes[left as usize], p), distance_sq(&boxes[right as usize], p));
                let (near, other) = if a <= b { ((left, a), (right, b)) } else { ((right, b), (left, a)) };
                if other.1 < limit {
                    stack[n] = other;
                    n += 1;
                }
                if near.1 < limit {
                    stack[n] = near;
                    n += 1;
                }
                continue;
            }
            for k in node.next as usize..(node.next + node.count) as usize {
                let corners = self.triangles[k].map(|v| self.vertex(m, v));
                let (point, feature) = closest_on_triangle(p, corners);
                let d = (p - point).norm_sq();
                if d < limit {
                    limit = d;
                    best = Some((k, point, feature, corners));
                }
            }
        }
        let (k, point, feature, corners) = best?;
        let normal = match feature {
            Feature::Face => self.face(m, k),
            Feature::Edge(e) => {
                let (a, b) = (self.triangles[k][e], self.triangles[k][(e + 1) % 3]);
                let both = self.about(a).iter().filter(|t| self.triangles[**t as usize].contains(&b));
                both.fold(Vector::default(), |n, t| n + self.face(m, *t as usize))
            }
            Feature::Vertex(e) => {
                let v = self.triangles[k][e];
                self.about(v).iter().fold(Vector::default(), |n, t| {
                    let ring = self.triangles[*t as usize];
                    let at = ring.iter().position(|i| *i == v).unwrap_or(0);
                    let [a, b, c] = [0, 1, 2].map(|i| self.vertex(m, ring[(at + i) % 3]));
                    let angle = acos((b - a).normalized().dot((c - a).normalized()).clamp(-1.0, 1.0));
                    n + self.face(m, *t as usize) * angle
                })
            }
        };
        let velocity = self.velocity(m, k, Self::weights(point, corners));
        Some(Nearest { point: point + m.gone, normal, velocity, distance: limit.sqrt() })
    }

    /// The first passage of a point that goes straight from a at time t0 to b at t1. `slack` [m] is the round-off of a:
    /// what starts this far beyond a triangle has not yet passed it.
    pub fn passage(&self, a: Vector, b: Vector, (t0, t1): (f64, f64), sides: Sides, slack: f64) -> Option<Passage> {
        let mut from = t0;
        let part = |t: f64| if t1 > t0 { (t - t0) / (t1 - t0) } else { 0.0 };
        loop {
            // Straight until the next keyframe.
            let cut = self.next_key(from).filter(|t| *t < t1).unwrap_or(t1);
            let (s0, s1) = (part(from), if cut == t1 { 1.0 } else { part(cut) });
            let (p, q) = (a + (b - a) * s0, a + (b - a) * s1);
            if let Some(mut found) = self.piece(p, q, (from, cut), sides, slack) {
                found.s = s0 + (s1 - s0) * found.s;
                return Some(found);
            }
            if cut == t1 {
                return None;
            }
            from = cut;
        }
    }

    fn piece(&self, a: Vector, b: Vector, (t0, t1): (f64, f64), sides: Sides, slack: f64) -> Option<Passage> {
        // Both ends within one interval; the middle says which.
        let m = self.moment(0.5 * (t0 + t1));
        let k = m.interval;
        let (a, b) = (a - m.gone, b - m.gone);
        let at = |t: f64| if m.rate > 0.0 { (t - m.past - self.times[k]) * m.rate } else { m.s };
        let (m0, m1) = (Moment { s: at(t0), ..m }, Moment { s: at(t1), ..m });
        let d = b - a;
        let boxes = &self.boxes[k];
        let mut best: Option<Passage> = None;
        let mut stack = vec![0_usize];
        while let Some(i) = stack.pop() {
            let until = best.map_or(1.0, |b| b.s);
            if !crosses(&boxes[i], a, d, until, slack) {
                continue;
            }
            let node = &self.nodes[i];
            if node.count == 0 {
                stack.extend([node.next as usize, i + 1]);
                continue;
            }
            for t in node.next as usize..(node.next + node.count) as usize {
                let start = self.triangles[t].map(|v| self.vertex(m0, v));
                let end = if m.rate > 0.0 { self.triangles[t].map(|v| self.vertex(m1, v)) } else { start };
                let Some((s, weights, normal)) = passes(a, d, start, end, sides, slack) else { continue };
                if best.is_none_or(|b| s < b.s) {
                    best = Some(Passage { s, normal, velocity: self.velocity(m, t, weights) });
                }
            }
        }
        best
    }
}

/// Cells along the longest side of a mesh.
const CELLS: f64 = 40.0;

/// Cubes around a mesh that no box of its tree touches and that are connected with the space around it.
#[derive(Debug, Clone)]
struct Apart {
    low: [f64; 3],
    cell: f64,
    n: [usize; 3],
    bits: Vec<u64>,
}

impl Apart {
    fn new(nodes: &[Node], boxes: &[[[f32; 3]; 2]]) -> Self {
        let [low, high] = boxes[0].map(|x| x.map(f64::from));
        let size: [f64; 3] = std::array::from_fn(|a| high[a] - low[a]);
        let cell = size.iter().fold(f64::MIN_POSITIVE, |a, b| a.max(*b)) / CELLS;
        // A free cell all around.
        let low = low.map(|x| x - 1.5 * cell);
        let n = size.map(|s| (s / cell) as usize + 4);
        let mut shut = vec![false; n[0] * n[1] * n[2]];
        let index = |x: usize, y: usize, z: usize| (z * n[1] + y) * n[0] + x;
        for (_, [l, h]) in nodes.iter().zip(boxes).filter(|(node, _)| node.count > 0) {
            let at = |x: f32, a: usize| (((f64::from(x) - low[a]) / cell) as usize).min(n[a] - 1);
            for z in at(l[2], 2)..=at(h[2], 2) {
                for y in at(l[1], 1)..=at(h[1], 1) {
                    shut[index(at(l[0], 0), y, z)..=index(at(h[0], 0), y, z)].fill(true);
                }
            }
        }
        let mut bits = vec![0_u64; shut.len().div_ceil(64)];
        let mut todo = vec![0_usize];
        shut[0] = true;
        while let Some(i) = todo.pop() {
            bits[i / 64] |= 1 << (i % 64);
            let at = [i % n[0], i / n[0] % n[1], i / n[0] / n[1]];
            for (a, step) in [1, n[0], n[0] * n[1]].into_iter().enumerate() {
                for next in [(at[a] > 0).then(|| i - step), (at[a] + 1 < n[a]).then(|| i + step)].into_iter().flatten() {
                    if !std::mem::replace(&mut shut[next], true) {
                        todo.push(next);
                    }
                }
            }
        }
        Self { low, cell, n, bits }
    }

    fn holds(&self, p: Vector) -> bool {
        let p: [f64; 3] = p.into();
        let at: [f64; 3] = std::array::from_fn(|a| (p[a] - self.low[a]) / self.cell);
        if (0..3).any(|a| !(0.0..self.n[a] as f64).contains(&at[a])) {
            return true;
        }
        let i = (at[2] as usize * self.n[1] + at[1] as usize) * self.n[0] + at[0] as usize;
        self.bits[i / 64] >> (i % 64) & 1 == 1
    }
}

/// The first passage of a + d s through a moving triangle: s, weights of the corners, unit normal.
fn passes(a: Vector, d: Vector, start: [Vector; 3], end: [Vector; 3], sides: Sides, slack: f64) -> Option<(f64, [f64; 3], Vector)> {
    let way = |k: usize| end[k] - start[k];
    let (p0, p1) = (start[0] - a, way(0) - d);
    let (e0, f0) = (start[1] - start[0], start[2] - start[0]);
    let (e1, f1) = (way(1) - way(0), way(2) - way(0));
    let (n0, n1, n2) = (e0.cross(f0), e0.cross(f1) + e1.cross(f0), e1.cross(f1));
    // Minus the height over the plane, times twice the area.
    let c = [p0.dot(n0), p0.dot(n1) + p1.dot(n0), p0.dot(n2) + p1.dot(n1), p1.dot(n2)];
    let f = |s: f64| ((c[3] * s + c[2]) * s + c[1]) * s + c[0];
    let lowest = -(slack / (p1.norm() + 1e-300)).min(1.0);
    // Between the zeros of the slope the cubic is monotone.
    let mut cuts = [lowest, 1.0, 1.0, 1.0];
    let mut n = 1;
    let (qa, qb, qc) = (3.0 * c[3], 2.0 * c[2], c[1]);
    let root = qb * qb - 4.0 * qa * qc;
    if root > 0.0 {
        let q = -0.5 * (qb + if qb < 0.0 { -root.sqrt() } else { root.sqrt() });
        let mut zeros = [if qa == 0.0 { f64::NAN } else { q / qa }, if q == 0.0 { f64::NAN } else { qc / q }];
        zeros.sort_unstable_by(f64::total_cmp);
        for z in zeros {
            if z > lowest && z < 1.0 {
                cuts[n] = z;
                n += 1;
            }
        }
    }
    cuts[n] = 1.0;
    for pair in cuts[..=n].windows(2) {
        let (mut l, mut h) = (pair[0], pair[1]);
        let (fl, fh) = (f(l), f(h));
        let inward = fl < 0.0 && fh >= 0.0;
        let outward = fl > 0.0 && fh <= 0.0;
        let counts = match sides {
            Sides::In => inward,
            Sides::Out => outward,
            Sides::Both => inward || outward,
        };
        if !counts {
            continue;
        }
        // The secant is exact where the triangle stands still.
        let s = l + (h - l) * (fl / (fl - fh));
        let mut s = s.clamp(l, h);
        if c[2] != 0.0 || c[3] != 0.0 {
            for _ in 0..80 {
                if (f(s) < 0.0) == (fl < 0.0) {
                    l = s
                } else {
                    h = s
                }
                s = 0.5 * (l + h);
            }
        }
        let corners = [0, 1, 2].map(|k| start[k] + way(k) * s);
        let weights = Facets::weights(a + d * s, corners);
        // Neighbours overlap by round-off, so that nothing slips through an edge.
        if weights.iter().all(|w| *w >= -1e-9) {
            let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
            return (n.norm_sq() > 0.0).then_some((s, weights, n));
        }
    }
    None
}

fn distance_sq([l, h]: &[[f32; 3]; 2], p: Vector) -> f64 {
    let outside = |p: f64, l: f32, h: f32| (f64::from(l) - p).max(p - f64::from(h)).max(0.0);
    let d = Vector { x: outside(p.x, l[0], h[0]), y: outside(p.y, l[1], h[1]), z: outside(p.z, l[2], h[2]) };
    d.norm_sq()
}

/// Whether a + d s comes within `slack` of the box for an s between 0 and `until`.
fn crosses([l, h]: &[[f32; 3]; 2], a: Vector, d: Vector, until: f64, slack: f64) -> bool {
    let (a, d): ([f64; 3], [f64; 3]) = (a.into(), d.into());
    let (mut first, mut last) = (0.0_f64, until.max(0.0));
    for k in 0..3 {
        let (near, far) = (f64::from(l[k]) - slack - a[k], f64::from(h[k]) + slack - a[k]);
        if d[k] == 0.0 {
            if near > 0.0 || far < 0.0 {
                return false;
            }
        } else {
            let (x, y) = (near / d[k], far / d[k]);
            first = first.max(x.min(y));
            last = last.min(x.max(y));
        }
    }
    first <= last
}
