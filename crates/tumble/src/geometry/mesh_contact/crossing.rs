//! Which edges pass through which triangles, by exact predicates.
//!
//! An edge passes through a triangle with which it shares no vertex if its ends lie strictly on different sides of the plane, and
//! its line meets the triangle, sides and corners included. What only touches does not count: an end that lies exactly in the
//! plane, an edge in the plane, a triangle without area. Nothing that goes on through is missed for it: as soon as an end is on
//! the other side, its edge counts.
//!
//! Source: signs by [shewchuk1997].

use super::topology::Topology;
use super::tree::{LEAF, Tree, around, whole};
use crate::geometry::Vector;
use crate::math::parallel;
use crate::math::{Row, xyz64};
use robust::{Coord3D, orient3d};

/// Leaves per task.
const TASK: usize = 32;

/// The side of the plane through a, b and c on which d lies: its sign is exact, 0 in the plane.
fn side(a: Vector, b: Vector, c: Vector, d: Vector) -> f64 {
    let p = |v: Vector| Coord3D { x: v.x, y: v.y, z: v.z };
    orient3d(p(a), p(b), p(c), p(d))
}

/// Whether an edge passes through a triangle: decided exactly.
pub fn passes([a, b]: [Vector; 2], [p, q, r]: [Vector; 3]) -> bool {
    let (s, t) = (side(p, q, r, a), side(p, q, r, b));
    if !(s < 0.0 && t > 0.0 || s > 0.0 && t < 0.0) {
        return false;
    }
    let turns = [side(a, b, p, q), side(a, b, q, r), side(a, b, r, p)];
    turns.iter().all(|t| *t >= 0.0) || turns.iter().all(|t| *t <= 0.0)
}

/// All edges that pass through triangles with which they share no vertex, as (edge, triangle), sorted. Seams count as shared. Of
/// objects that do not touch themselves, only what passes through others counts. `x` has a row for each vertex, at least.
pub fn intersections(topology: &Topology, x: &[Row]) -> Vec<(u32, u32)> {
    crossings(topology, x, &mut Tree::default(), &mut Tree::default())
}

/// How many there are, and the first of them: of surfaces that are crushed everything passes through everything, and no list is made.
pub fn crossed(topology: &Topology, x: &[Row]) -> (usize, Option<(u32, u32)>) {
    let count = |(count, first): &mut (usize, Option<(u32, u32)>), pair: (u32, u32)| {
        *count += 1;
        *first = Some(first.map_or(pair, |before| before.min(pair)));
    };
    let tasks = visit(topology, x, &mut Tree::default(), &mut Tree::default(), count);
    (tasks.iter().map(|(count, _)| count).sum(), tasks.iter().filter_map(|(_, first)| *first).min())
}

/// The list, with trees for edges and triangles.
pub(super) fn crossings(topology: &Topology, x: &[Row], edges: &mut Tree, triangles: &mut Tree) -> Vec<(u32, u32)> {
    let mut all = visit(topology, x, edges, triangles, |found: &mut Vec<_>, pair| found.push(pair)).concat();
    all.sort_unstable();
    all
}

/// Accumulator of each task for the crossings that it finds, in any order.
fn visit<T: Default + Send>(
    topology: &Topology,
    x: &[Row],
    edges: &mut Tree,
    triangles: &mut Tree,
    gather: impl Fn(&mut T, (u32, u32)) + Sync,
) -> Vec<T> {
    if x.len() < topology.vertices() {
        return Vec::new();
    }
    let at = |v: u32| xyz64(x[v as usize]);
    let two = |[a, b]: [u32; 2]| [at(a), at(b)];
    let three = |[a, b, c]: [u32; 3]| [at(a), at(b), at(c)];
    let finite = |p: &Vector| p.norm_sq().is_finite();
    let origin = topology.points().iter().map(|v| at(*v)).find(finite).unwrap_or_default();
    edges.fit(topology.edges.len(), |i| around(two(topology.edges[i as usize]), origin));
    triangles.fit(topology.triangles.len(), |i| around(three(topology.triangles[i as usize]), origin));
    let (edges, triangles) = (&*edges, &*triangles);
    let task = |task: usize| {
        let (mut found, mut leaves) = (T::default(), Vec::new());
        for leaf in task * TASK..((task + 1) * TASK).min(edges.n_leaves()) {
            leaves.clear();
            triangles.walk(&whole(edges, leaf), 0, |l| leaves.push(l));
            for (place, i) in edges.features(leaf).iter().enumerate() {
                let (b, e) = (edges.bounds(leaf, place), topology.edges[*i as usize]);
                for l in &leaves {
                    let mut mask = triangles.mask(*l, &b);
                    while mask != 0 {
                        let j = triangles.features(*l as usize)[mask.trailing_zeros() as usize % LEAF];
                        let t = topology.triangles[j as usize];
                        if topology.meet(e, t) && passes(two(e), three(t)) {
                            gather(&mut found, (*i, j));
                        }
                        mask &= mask - 1;
                    }
                }
            }
        }
        found
    };
    parallel::map(edges.n_leaves().div_ceil(TASK), task)
}

/// A flag for each vertex of an edge or a triangle that takes part in a crossing, and of their neighbours so many edges away.
pub fn tangled(topology: &Topology, crossings: &[(u32, u32)], rings: u32) -> Vec<bool> {
    let mut loose = vec![false; topology.vertices()];
    for (e, t) in crossings {
        let e = topology.edges.get(*e as usize).into_iter().flatten();
        for v in e.chain(topology.triangles.get(*t as usize).into_iter().flatten()) {
            loose[*v as usize] = true;
        }
    }
    for _ in 0..rings {
        let before = loose.clone();
        for [a, b] in topology.edges.iter().map(|e| e.map(|v| v as usize)) {
            loose[a] |= before[b];
            loose[b] |= before[a];
        }
    }
    loose
}
