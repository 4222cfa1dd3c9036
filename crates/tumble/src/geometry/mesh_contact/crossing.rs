//! Which edges pass through which triangles, by exact predicates, and ways out of a tangle.
//!
//! An edge passes through a triangle with which it shares no vertex if its ends lie strictly on different sides of the plane, and
//! its line meets the triangle, sides and corners included. What only touches does not count: an end that lies exactly in the
//! plane, an edge in the plane, a triangle without area. Nothing that goes on through is missed for it: as soon as an end is on
//! the other side, its edge counts.
//!
//! Source: signs by [shewchuk1997], the way out by [volino2006].

use super::topology::Topology;
use super::tree::{LEAF, Tree, around, whole};
use crate::geometry::Vector;
use crate::math::{Row, xyz64};
use rayon::prelude::*;
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
    if x.len() < topology.vertices() {
        return Vec::new();
    }
    let at = |v: u32| xyz64(x[v as usize]);
    let finite = |p: &Vector| p.norm_sq().is_finite();
    let origin = topology.points().iter().map(|v| at(*v)).find(finite).unwrap_or_default();
    let (mut edges, mut triangles) = (Tree::default(), Tree::default());
    edges.fit(topology.edges.len(), |i| around(topology.edges[i as usize].map(at), origin));
    triangles.fit(topology.triangles.len(), |i| around(topology.triangles[i as usize].map(at), origin));
    let task = |task: usize| {
        let (mut found, mut leaves) = (Vec::new(), Vec::new());
        for leaf in task * TASK..((task + 1) * TASK).min(edges.n_leaves()) {
            leaves.clear();
            triangles.walk(&whole(&edges, leaf), |l| leaves.push(l));
            for (place, i) in edges.features(leaf).iter().enumerate() {
                let (b, e) = (edges.bounds(leaf, place), topology.edges[*i as usize]);
                for l in &leaves {
                    let mut mask = triangles.mask(*l, &b);
                    while mask != 0 {
                        let j = triangles.features(*l as usize)[mask.trailing_zeros() as usize % LEAF];
                        let t = topology.triangles[j as usize];
                        if topology.meet(e, t) && passes(e.map(at), t.map(at)) {
                            found.push((*i, j));
                        }
                        mask &= mask - 1;
                    }
                }
            }
        }
        found
    };
    let tasks: Vec<Vec<(u32, u32)>> = (0..edges.n_leaves().div_ceil(TASK)).into_par_iter().map(task).collect();
    let mut all = tasks.concat();
    all.sort_unstable();
    all
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

/// Where edges pass through triangles, surfaces meet in lines. The length L of all these lines [m], and its gradient by the
/// position of each vertex: who goes against it shortens them.
///
///   G = sum of R_i,   dL = -(G - N (E·G)/(E·N))·u_e - N (E·G)/(E·N)·u_t               (contact.19)
///
/// E runs along the edge, N is the normal of the triangle, R_i the direction from the place of the crossing into each line that
/// begins there, one for each triangle at the edge; u_e and u_t are how the edge and the triangle move there.
/// Source: [volino2006].   Differs: the parts of edge and triangle stand apart, which makes the gradient exact.
pub fn contour(topology: &Topology, x: &[Row], crossings: &[(u32, u32)]) -> (f64, Vec<Vector>) {
    let mut gradient = vec![Vector::default(); topology.vertices()];
    let mut length = 0.0;
    let at = |v: u32| xyz64(x[v as usize]);
    let known = |(e, t): &&(u32, u32)| (*e as usize) < topology.edges.len() && (*t as usize) < topology.triangles.len();
    if x.len() < topology.vertices() {
        return (length, gradient);
    }
    for &(e, t) in crossings.iter().filter(known) {
        let ([a, b], [p, q, r]) = (topology.edges[e as usize], topology.triangles[t as usize]);
        let n = (at(q) - at(p)).cross(at(r) - at(p)).normalized();
        let along = (at(b) - at(a)).normalized();
        let steep = along.dot(n);
        let (above, below) = (n.dot(at(a) - at(p)), n.dot(at(b) - at(p)));
        let s = above / (above - below);
        if !s.is_finite() || steep == 0.0 {
            continue;
        }
        let place = at(a) + (at(b) - at(a)) * s;
        let mut g = Vector::default();
        for wing in topology.wings(e) {
            let w = topology.triangles[*wing as usize];
            if topology.share(w, [p, q, r]) {
                continue;
            }
            // The other end of the line: where another edge of one passes through the other.
            if let Some(end) = other_end(topology, x, crossings, (e, t), *wing) {
                let line = end - place;
                length += 0.5 * line.norm();
                g = g + line.normalized();
            }
        }
        let across = n * (along.dot(g) / steep);
        let of_edge = across - g;
        gradient[a as usize] = gradient[a as usize] + of_edge * (1.0 - s);
        gradient[b as usize] = gradient[b as usize] + of_edge * s;
        let weights = super::distance::point_triangle(place, [at(p), at(q), at(r)]).weights;
        for (v, w) in [p, q, r].into_iter().zip(&weights[1..]) {
            gradient[v as usize] = gradient[v as usize] + across * *w;
        }
    }
    (length, gradient)
}

/// The place of a crossing of `wing` with triangle t, other than that of edge e.
fn other_end(topology: &Topology, x: &[Row], crossings: &[(u32, u32)], (e, t): (u32, u32), wing: u32) -> Option<Vector> {
    let sides = |t: [u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].map(|[a, b]| topology.edge_of(a, b));
    let crosses = |edge: Option<u32>, t: u32| edge.filter(|edge| crossings.binary_search(&(*edge, t)).is_ok()).map(|edge| (edge, t));
    let of_wing = sides(topology.triangles[wing as usize]).into_iter().filter(|s| *s != Some(e)).find_map(|s| crosses(s, t));
    let (edge, triangle) = of_wing.or_else(|| sides(topology.triangles[t as usize]).into_iter().find_map(|s| crosses(s, wing)))?;
    let at = |v: u32| xyz64(x[v as usize]);
    let ([a, b], [p, q, r]) = (topology.edges[edge as usize], topology.triangles[triangle as usize]);
    let n = (at(q) - at(p)).cross(at(r) - at(p));
    let (above, below) = (n.dot(at(a) - at(p)), n.dot(at(b) - at(p)));
    let s = above / (above - below);
    s.is_finite().then(|| at(a) + (at(b) - at(a)) * s)
}

/// A way out for each vertex: how to move by about `step` [m] so that the lines in which surfaces meet become shorter. Edge and
/// triangle go opposite ways, fixed vertices stay. Zero for all that do not take part.
pub fn untangle_directions(topology: &Topology, x: &[Row], crossings: &[(u32, u32)], step: f64) -> Vec<Vector> {
    let (_, mut gradient) = contour(topology, x, crossings);
    for (v, g) in gradient.iter_mut().enumerate() {
        let size = g.norm();
        // Volino and Magnenat-Thalmann's step: short where the gradient is small, and never longer than `step`.
        let reach = step / (1.0 + size * size).sqrt();
        *g = if topology.is_fixed(v as u32) || !size.is_finite() { Vector::default() } else { *g * -reach };
    }
    gradient
}
