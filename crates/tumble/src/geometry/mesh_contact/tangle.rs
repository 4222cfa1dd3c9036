//! Ways out of a tangle: where edges pass through triangles, surfaces meet in lines, and who makes these lines shorter comes apart.
//!
//!   G = sum of R_i,   dL = -(G - N (E·G)/(E·N))·u_e - N (E·G)/(E·N)·u_t               (contact.19)
//!
//! L is the length of all lines. E runs along the edge, N is the normal of the triangle, R_i the direction from the place of the
//! crossing into each line that begins there, one for each triangle at the edge; u_e and u_t are how the edge and the triangle
//! move there.
//!
//! Source: [volino2006].   Differs: the parts of edge and triangle stand apart, which makes the gradient exact; the ways are its
//! sums over connected lines.

use super::topology::{Topology, root};
use crate::geometry::Vector;
use crate::math::{Row, xyz64};

/// A crossing in numbers.
#[derive(Debug, Clone, Copy, Default)]
struct Crossing {
    /// Place on the edge, 0..1, and in space [m].
    s: f64,
    place: Vector,
    /// The gradient of the length where the edge, and where the triangle, moves.
    of_edge: Vector,
    of_triangle: Vector,
    /// Length of the lines that begin here, half of each [m].
    length: f64,
    /// Ends of the lines: the crossing, and whether edge and triangle change sides there.
    ends: [Option<(usize, bool)>; 2],
}

/// The lines in which surfaces meet.
struct Lines<'a> {
    topology: &'a Topology,
    x: &'a [Row],
    crossings: &'a [(u32, u32)],
}

impl Lines<'_> {
    fn at(&self, v: u32) -> Vector {
        xyz64(self.x[v as usize])
    }

    /// The place of a crossing, as the part of the edge, and in space.
    fn place(&self, (e, t): (u32, u32)) -> (f64, Vector) {
        let ([a, b], [p, q, r]) = (self.topology.edges[e as usize], self.topology.triangles[t as usize]);
        let (a, b, p) = (self.at(a), self.at(b), self.at(p));
        let n = (self.at(q) - p).cross(self.at(r) - p);
        let (above, below) = (n.dot(a - p), n.dot(b - p));
        let s = above / (above - below);
        (s, a + (b - a) * s)
    }

    /// The other end of the line in which a triangle at edge e meets triangle t, and whether edge and triangle change sides there.
    fn other_end(&self, (e, t): (u32, u32), wing: u32) -> Option<(usize, bool)> {
        let sides = |t: u32| {
            let t = self.topology.triangles[t as usize];
            [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].map(|[a, b]| self.topology.edge_of(a, b))
        };
        let find = |edge: Option<u32>, t: u32| self.crossings.binary_search(&(edge?, t)).ok();
        let of_wing = sides(wing).into_iter().filter(|s| *s != Some(e)).find_map(|s| find(s, t));
        of_wing.map(|i| (i, false)).or_else(|| sides(t).into_iter().find_map(|s| find(s, wing)).map(|i| (i, true)))
    }

    fn crossing(&self, (e, t): (u32, u32)) -> Crossing {
        let ([a, b], [p, q, r]) = (self.topology.edges[e as usize], self.topology.triangles[t as usize]);
        let n = (self.at(q) - self.at(p)).cross(self.at(r) - self.at(p)).normalized();
        let along = (self.at(b) - self.at(a)).normalized();
        let steep = along.dot(n);
        let (s, place) = self.place((e, t));
        let mut found = Crossing { s, place, ..Crossing::default() };
        if !s.is_finite() || !place.norm_sq().is_finite() || steep == 0.0 {
            return Crossing::default();
        }
        let mut g = Vector::default();
        let wings = self.topology.wings(e).iter().filter(|w| !self.topology.share(self.topology.triangles[**w as usize], [p, q, r]));
        let ends = wings.filter_map(|w| self.other_end((e, t), *w));
        for (k, end) in ends.enumerate() {
            let line = self.place(self.crossings[end.0]).1 - place;
            found.length += 0.5 * line.norm();
            g = g + line.normalized();
            if let Some(slot) = found.ends.get_mut(k) {
                *slot = Some(end);
            }
        }
        let across = n * (along.dot(g) / steep);
        found.of_edge = across - g;
        found.of_triangle = -across;
        found
    }

    /// Adds what an edge and a triangle get to their vertices, by their weights at the crossing.
    fn spread(&self, (e, t): (u32, u32), c: &Crossing, mut add: impl FnMut(u32, f64, bool)) {
        let ([a, b], t) = (self.topology.edges[e as usize], self.topology.triangles[t as usize]);
        add(a, 1.0 - c.s, true);
        add(b, c.s, true);
        let weights = super::distance::point_triangle(c.place, t.map(|v| self.at(v))).weights;
        (0..3).for_each(|k| add(t[k], -weights[k + 1], false));
    }
}

/// Intersection lines of a list of crossings, as returned by `intersections`, at these positions; crossings that do not fit are left out.
fn lines<'a>(topology: &'a Topology, x: &'a [Row], crossings: &'a [(u32, u32)]) -> Option<(Lines<'a>, Vec<Crossing>)> {
    let fits = |(e, t): &(u32, u32)| (*e as usize) < topology.edges.len() && (*t as usize) < topology.triangles.len();
    if x.len() < topology.vertices() || !crossings.iter().all(fits) {
        return None;
    }
    let lines = Lines { topology, x, crossings };
    let all = crossings.iter().map(|c| lines.crossing(*c)).collect();
    Some((lines, all))
}

/// The length [m] of all lines in which surfaces meet, and its gradient by the position of each vertex. `crossings` are those of
/// `intersections`.
pub fn contour(topology: &Topology, x: &[Row], crossings: &[(u32, u32)]) -> (f64, Vec<Vector>) {
    let mut gradient = vec![Vector::default(); topology.vertices()];
    let Some((lines, all)) = lines(topology, x, crossings) else { return (0.0, gradient) };
    for (pair, c) in crossings.iter().zip(&all) {
        lines.spread(*pair, c, |v, weight, edge| {
            gradient[v as usize] = gradient[v as usize] + if edge { c.of_edge } else { c.of_triangle } * weight;
        });
    }
    (all.iter().map(|c| c.length).sum(), gradient)
}

/// The number of vertices that hang together with each vertex without the edges that cross something, and which ones they are.
fn parts(topology: &Topology, crossings: &[(u32, u32)]) -> (Vec<u32>, Vec<u32>) {
    let mut part: Vec<u32> = (0..topology.vertices() as u32).collect();
    for (e, [a, b]) in topology.edges.iter().enumerate() {
        let first = crossings.partition_point(|c| (c.0 as usize) < e);
        if crossings.get(first).is_none_or(|c| c.0 as usize != e) {
            let (a, b) = (root(&mut part, *a), root(&mut part, *b));
            part[a.max(b) as usize] = a.min(b);
        }
    }
    let mut size = vec![0; part.len()];
    for v in 0..part.len() {
        part[v] = root(&mut part, v as u32);
        size[part[v] as usize] += 1;
    }
    (part.iter().map(|p| size[*p as usize]).collect(), part)
}

/// A way out for each vertex [m], at most `step` long: all that meets along one connected line goes the same way, the two sides
/// against each other, so that the line becomes shorter and no corner is bent off to make it so. A line that cuts a surface in two
/// need not become shorter (a straight side that hangs through a floor): there the smaller part goes back to where the larger
/// one is. Fixed vertices stay; zero for all that do not take part. `crossings` are those of `intersections`.
pub fn untangle_directions(topology: &Topology, x: &[Row], crossings: &[(u32, u32)], step: f64) -> Vec<Vector> {
    let mut ways = vec![Vector::default(); topology.vertices()];
    let Some((lines, all)) = lines(topology, x, crossings) else { return ways };
    let (size, part) = parts(topology, crossings);
    let mut side: Vec<f64> = vec![0.0; all.len()];
    for first in 0..all.len() {
        if side[first] != 0.0 {
            continue;
        }
        // All crossings along one line; the side that is the edge at the first one moves against the gradient.
        let (mut line, mut next) = (vec![first], 0);
        side[first] = 1.0;
        while let Some(i) = line.get(next).copied() {
            next += 1;
            for (j, swaps) in all[i].ends.iter().flatten() {
                if side[*j] == 0.0 {
                    side[*j] = if *swaps { -side[i] } else { side[i] };
                    line.push(*j);
                }
            }
        }
        let g = line.iter().fold(Vector::default(), |g, i| g + (all[*i].of_edge - all[*i].of_triangle) * side[*i]);
        // Out of the other surface, for what is cut off.
        let out = line.iter().fold(Vector::default(), |out, i| {
            let ([a, b], t) = (topology.edges[crossings[*i].0 as usize], topology.triangles[crossings[*i].1 as usize]);
            let [p, q, r] = t.map(|v| lines.at(v));
            let n = (q - p).cross(r - p).normalized() * side[*i];
            let small_to_large = (lines.at(b) - lines.at(a)) * (f64::from(size[b as usize]) - f64::from(size[a as usize]));
            let cut = part[a as usize] != part[b as usize];
            let turn = small_to_large.dot(n * side[*i]);
            if !cut || turn == 0.0 { out } else { out + n * turn.signum() }
        });
        let way = out * (step / (1.0 + out.norm_sq()).sqrt()) - g * (step / (1.0 + g.norm_sq()).sqrt());
        if !way.norm_sq().is_finite() {
            continue;
        }
        for i in line {
            lines.spread(crossings[i], &all[i], |v, _, edge| {
                let way = if edge { way * side[i] } else { way * -side[i] };
                ways[v as usize] = ways[v as usize] + way;
            });
        }
    }
    for (v, way) in ways.iter_mut().enumerate() {
        let length = way.norm();
        *way = if topology.is_fixed(v as u32) { Vector::default() } else { *way * (step / length).min(1.0) };
    }
    ways
}
