//! Surfaces that tear. Where an edge is stretched beyond its strength, one of its two vertices comes apart: the triangles around it that
//! lie ahead of the plane through it, across the edge, go to a copy of it; each copy has the mass of its triangles, and moves on
//! with the same velocity. Pieces that then hang together by a vertex alone come apart, too.
//!
//! The triangles say everything: masses, and between which rows every element acts, follow from them, so that they are all that a
//! snapshot needs. Strength is (cloth.3). An element of a triangle goes with it; one across an edge breaks where the edge has opened. Links along an edge
//! are therefore two, one for each of its triangles.
//!
//! Source: [mueller2007], section 4.4. Differs: vertices at a rim come apart first, so that tears run on from their tips; a vertex and its
//! neighbours come apart once in a sub-step; and no two pieces are left hanging by a vertex.   Verified in tests/tear.rs.

use crate::elements::Members;
use crate::math::parallel::fold;
use crate::math::{Real, Row, Vec3, xyz64};
use crate::state::Object;
use std::collections::BTreeMap;

/// How a surface tears, as a recipe gives it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TearPart {
    /// Its place in the scene.
    pub path: String,
    /// How many vertices can come apart.
    pub spare: usize,
    /// Rest lengths [m] of the edges of every triangle, from each corner to the next.
    pub rest: Vec<[f64; 3]>,
    /// Strains at which they give way.
    pub limit: Vec<[f64; 3]>,
}

/// A list of elements that may have nodes in surfaces that tear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ElementList {
    /// The batch of forces of that index.
    Batch(usize),
    /// The constraints of that index.
    Constraints(usize),
    /// The springs that the clamp shortens.
    Clamp,
}

const NONE: u32 = u32::MAX;
/// Triangles of the smallest piece that comes off ...
const PIECE: usize = 6;
/// ... unless an edge is stretched to this many times the length at which it gives way.
const TORN_OFF: f64 = 1.5;

/// Which corners of triangles (triangle times 3 plus corner) the nodes of an element are, and which pairs of corners must be one vertex
/// for it to hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tie {
    element: u32,
    corners: [u32; 6],
    same: [[u32; 2]; 6],
}

/// Elements of one list that go with triangles.
pub struct Ties {
    elements: ElementList,
    ties: Vec<Tie>,
}

/// The edges of some triangles.
pub struct Edges<'a> {
    triangles: &'a [[u32; 3]],
    /// For both ends, the smaller first: the corners from which the edge goes.
    of: BTreeMap<[u32; 2], Vec<u32>>,
    /// For the two corners across an edge, the smaller first, both directed corners of that edge.
    across: BTreeMap<[u32; 2], [u32; 2]>,
    around: BTreeMap<u32, Vec<u32>>,
}

fn sorted(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

fn next(corner: u32) -> u32 {
    corner / 3 * 3 + (corner + 1) % 3
}

impl<'a> Edges<'a> {
    /// Of triangles over rows.
    pub fn new(triangles: &'a [[u32; 3]]) -> Self {
        let (mut of, mut around): (BTreeMap<_, Vec<u32>>, BTreeMap<_, Vec<u32>>) = (BTreeMap::new(), BTreeMap::new());
        for (t, triangle) in triangles.iter().enumerate() {
            for k in 0..3 {
                let [a, b] = [triangle[k], triangle[(k + 1) % 3]];
                of.entry(sorted(a, b)).or_default().push((3 * t + k) as u32);
                for [a, b] in [[a, b], [b, a]] {
                    let others = around.entry(a).or_default();
                    if !others.contains(&b) {
                        others.push(b);
                    }
                }
            }
        }
        let mut edges = Self { triangles, of, across: BTreeMap::new(), around };
        for corners in edges.of.values() {
            if let [c, d] = corners[..] {
                let key = sorted(edges.row(next(next(c))), edges.row(next(next(d))));
                edges.across.entry(key).or_insert([c, d]);
            }
        }
        edges
    }

    fn row(&self, corner: u32) -> u32 {
        self.triangles[corner as usize / 3][corner as usize % 3]
    }

    /// The corner of the triangle of a corner that is that row.
    fn corner(&self, of: u32, row: u32) -> Option<u32> {
        (0..3).map(|k| of / 3 * 3 + k).find(|c| self.row(*c) == row)
    }

    /// Triangles at an edge, each as the corner from which the edge goes.
    pub fn at(&self, [a, b]: [u32; 2]) -> &[u32] {
        self.of.get(&sorted(a, b)).map_or(&[], |c| &c[..])
    }

    /// The corners of an edge and those opposite to it on either side, and those that are the ends of the edge on both sides.
    fn hinge(&self, [a, b, c, d]: [u32; 4]) -> Option<([u32; 4], [[u32; 2]; 2])> {
        let with = |row: u32| self.at([a, b]).iter().copied().find(|at| self.corner(*at, row).is_some());
        let [t, u] = [with(c)?, with(d)?];
        let corners = [self.corner(t, a)?, self.corner(t, b)?, self.corner(t, c)?, self.corner(u, d)?];
        Some((corners, [[corners[0], self.corner(u, a)?], [corners[1], self.corner(u, b)?]]))
    }

    /// The triangles of an element; `half` says to which triangle of its edge a link goes. `None` if it goes with no triangle.
    fn tie<const N: usize>(&self, element: u32, nodes: [u32; N], half: usize, x: &[Row]) -> Option<Tie> {
        let (mut corners, mut same) = ([NONE; 6], [[0; 2]; 6]);
        match nodes[..] {
            [a, b] => {
                if let Some(at) = self.at([a, b]).get(half) {
                    (corners[0], corners[1]) = (self.corner(*at, a)?, self.corner(*at, b)?);
                } else if let Some([c, d]) = self.across.get(&sorted(a, b)) {
                    let [c, d] = if self.row(next(next(*c))) == a { [*c, *d] } else { [*d, *c] };
                    (corners[0], corners[1]) = (next(next(c)), next(next(d)));
                    (same[0], same[1]) = ([c, self.corner(d, self.row(c))?], [next(c), self.corner(d, self.row(next(c)))?]);
                } else {
                    // Over a vertex between the two, the nearest to their middle.
                    let at = |i: u32| xyz64(x[i as usize]);
                    let middle = (at(a) + at(b)) * 0.5;
                    let far = |m: &u32| (at(*m) - middle).norm_sq();
                    let between = self.around.get(&a)?.iter().filter(|m| self.of.contains_key(&sorted(**m, b)));
                    let m = *between.min_by(|m, n| far(m).total_cmp(&far(n)))?;
                    let [c, d] = [*self.at([a, m]).first()?, *self.at([m, b]).first()?];
                    (corners[0], corners[1]) = (self.corner(c, a)?, self.corner(d, b)?);
                    same[0] = [self.corner(c, m)?, self.corner(d, m)?];
                }
            }
            [a, b, c] => {
                let at = self.at([a, b]).iter().copied().find(|at| self.corner(*at, c).is_some())?;
                (corners[0], corners[1], corners[2]) = (self.corner(at, a)?, self.corner(at, b)?, self.corner(at, c)?);
            }
            [a, b, c, d] => {
                if let Some((at, both)) = self.hinge([a, b, c, d]) {
                    corners[..4].copy_from_slice(&at);
                    same[..2].copy_from_slice(&both);
                } else if let Some(([c, d, a, b], both)) = self.hinge([c, d, a, b]) {
                    corners[..4].copy_from_slice(&[a, b, c, d]);
                    same[..2].copy_from_slice(&both);
                } else {
                    // Three in a row, over the first; the second only makes up the number.
                    let [t, u, v] = [[a, c], [a, d], [a, b]].map(|edge| self.at(edge).first().copied());
                    let (t, u) = (t?, u?);
                    corners[..4].copy_from_slice(&[self.corner(t, a)?, self.corner(v?, b)?, self.corner(t, c)?, self.corner(u, d)?]);
                    same[0] = [corners[0], self.corner(u, a)?];
                }
            }
            [a, b, c, d, e, f] => {
                // A triangle that bends, with those across its edges.
                let own = self.at([a, b]).iter().copied().find(|at| self.corner(*at, c).is_some())?;
                for (i, [p, q, r, d]) in [[a, b, c, d], [b, c, a, e], [c, a, b, f]].into_iter().enumerate() {
                    corners[i] = self.corner(own, p)?;
                    corners[3 + i] = corners[i];
                    if d != p {
                        let ([.., d], both) = self.hinge([p, q, r, d])?;
                        corners[3 + i] = d;
                        same[2 * i..2 * i + 2].copy_from_slice(&both);
                    }
                }
            }
            _ => return None,
        }
        Some(Tie { element, corners, same })
    }

    /// The ties of all elements of a list, the first of which has the index `first`. Equal links that follow each other are the halves of one.
    pub fn ties<const N: usize, const D: usize, const P: usize>(
        &self,
        elements: Option<ElementList>,
        members: &[Members<N, D, P>],
        first: usize,
        x: &[Row],
    ) -> Option<Ties> {
        let half = |e: usize| usize::from(e > 0 && N == 2 && members[e - 1].nodes == members[e].nodes);
        let mine = |m: &Members<N, D, P>| m.nodes.iter().all(|i| self.around.contains_key(i));
        let all = members.iter().enumerate().filter(|(_, m)| mine(m));
        let ties: Vec<Tie> = all.filter_map(|(e, m)| self.tie((first + e) as u32, m.nodes, half(e), x)).collect();
        elements.filter(|_| !ties.is_empty()).map(|elements| Ties { elements, ties })
    }

    /// The ties of elements that are the triangles themselves.
    pub fn own(&self, elements: ElementList, first: usize) -> Ties {
        let tie = |t: u32| Tie { element: first as u32 + t, corners: [3 * t, 3 * t + 1, 3 * t + 2, NONE, NONE, NONE], same: [[0; 2]; 6] };
        Ties { elements, ties: (0..self.triangles.len() as u32).map(tie).collect() }
    }
}

/// A surface that tears.
pub struct Tear {
    object: usize,
    /// Its first row.
    first: u32,
    /// Vertices at the start; their copies follow.
    vertices: usize,
    spare: usize,
    used: usize,
    /// Triangles over rows, now and as elements know them.
    triangles: Vec<[u32; 3]>,
    /// Corners at every vertex, in order.
    fans: Vec<Vec<u32>>,
    known: Vec<[u32; 3]>,
    original: Vec<[u32; 3]>,
    rest: Vec<[Real; 3]>,
    limit: Vec<[Real; 3]>,
    /// Mass of each corner, and of each vertex at the start [kg].
    share: Vec<[f64; 3]>,
    mass: Vec<Real>,
    /// The inverse masses of vertices at the start; 0 for held ones.
    inverse: Vec<Real>,
    ties: Vec<Ties>,
}

impl Tear {
    /// Of an object that is whole; its vertices weigh `mass`.
    pub fn new(object: usize, of: &Object, part: &TearPart, mass: &[Real], x: &[Row], ties: Vec<Ties>) -> Self {
        let first = of.points.start as u32;
        let triangles: Vec<[u32; 3]> = of.triangles.iter().map(|t| t.map(|i| i + first)).collect();
        let vertices = of.points.len() - of.spare;
        // Of a vertex, each triangle has its part by area.
        let area = |rest: &[f64; 3]| {
            let [a, b, c] = *rest;
            let s = 0.5 * (a + b + c);
            (s * (s - a) * (s - b) * (s - c)).max(0.0).sqrt().max(1e-6 * s * s)
        };
        let mut sums = vec![0.0; vertices];
        for (t, rest) in triangles.iter().zip(&part.rest) {
            t.iter().for_each(|i| sums[(i - first) as usize] += area(rest));
        }
        let own = |i: u32| (i - first) as usize;
        let share = |(t, rest): (&[u32; 3], &[f64; 3])| t.map(|i| f64::from(mass[i as usize]) * area(rest) / sums[own(i)]);
        let narrow = |all: &[[f64; 3]]| all.iter().map(|of| of.map(|x| x as Real)).collect();
        let mut tear = Self {
            object,
            first,
            vertices,
            spare: of.spare,
            used: 0,
            share: triangles.iter().zip(&part.rest).map(share).collect(),
            known: triangles.clone(),
            original: triangles.clone(),
            triangles,
            fans: Vec::new(),
            rest: narrow(&part.rest),
            limit: narrow(&part.limit),
            mass: mass[of.points.start..of.points.start + vertices].to_vec(),
            inverse: x[of.points.start..of.points.start + vertices].iter().map(|x| x[3]).collect(),
            ties,
        };
        tear.find_fans();
        tear
    }

    fn find_fans(&mut self) {
        self.fans = vec![Vec::new(); self.vertices + self.spare];
        for (c, row) in self.triangles.as_flattened().iter().enumerate() {
            self.fans[(row - self.first) as usize].push(c as u32);
        }
    }

    /// Which object it is.
    pub fn object(&self) -> usize {
        self.object
    }

    /// Rows of the spare vertices that nothing uses yet.
    pub fn idle(&self) -> std::ops::Range<usize> {
        let first = self.first as usize + self.vertices;
        first + self.used..first + self.spare
    }

    /// Triangles over rows.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Every copy in use, with the vertex that it is one of.
    pub fn copies(&self) -> Vec<[u32; 2]> {
        let mut origin = vec![NONE; self.used];
        for (t, original) in self.triangles.iter().zip(&self.original) {
            for k in 0..3 {
                if let Some(of) = (t[k] - self.first).checked_sub(self.vertices as u32) {
                    origin[of as usize] = original[k];
                }
            }
        }
        let row = |k: usize| self.first + (self.vertices + k) as u32;
        (0..self.used).filter(|k| origin[*k] != NONE).map(|k| [row(k), origin[k]]).collect()
    }

    /// Puts the triangles as a snapshot has them; `None` if they are none of this surface.
    pub fn set(&mut self, flat: &[u32]) -> Option<()> {
        let end = self.first + (self.vertices + self.spare) as u32;
        if flat.len() != 3 * self.triangles.len() || flat.iter().any(|i| !(self.first..end).contains(i)) {
            return None;
        }
        for (t, rows) in self.triangles.iter_mut().zip(flat.chunks_exact(3)) {
            t.copy_from_slice(rows);
        }
        let last = flat.iter().copied().max().unwrap_or(0);
        self.used = (last + 1).saturating_sub(self.first + self.vertices as u32) as usize;
        self.find_fans();
        Some(())
    }

    /// Edges beyond their strength: their lengths over that at which they give way, and corners, the worst first.
    fn strained(&self, x: &[Row]) -> Vec<(f64, u32)> {
        let beyond = |t: usize| {
            let corners = self.triangles[t].map(|i| xyz64(x[i as usize]));
            (0..3).filter_map(move |k| {
                let (rest, limit) = (f64::from(self.rest[t][k]), f64::from(self.limit[t][k]));
                let over = (corners[(k + 1) % 3] - corners[k]).norm() / (rest * (1.0 + limit));
                (over > 1.0).then_some((over, (3 * t + k) as u32))
            })
        };
        let mut found = fold(self.triangles.len(), |range| range.flat_map(beyond).collect::<Vec<_>>()).concat();
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        found
    }

    /// Corners that are that vertex, in order.
    fn fan(&self, row: u32) -> &[u32] {
        &self.fans[(row - self.first) as usize]
    }

    /// Whether fewer triangles than a piece has hang together by edges with that of a corner.
    fn is_scrap(&self, corner: u32) -> bool {
        let (mut found, mut k) = (vec![corner / 3], 0);
        while k < found.len() && found.len() < PIECE {
            let t = self.triangles[found[k] as usize];
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                let beyond = self.fan(a).iter().map(|c| c / 3).filter(|u| self.triangles[*u as usize].contains(&b));
                for u in beyond {
                    if !found.contains(&u) {
                        found.push(u);
                    }
                }
            }
            k += 1;
        }
        found.len() < PIECE
    }

    fn others(&self, corner: u32) -> [u32; 2] {
        let t = self.triangles[corner as usize / 3];
        [t[(corner as usize + 1) % 3], t[(corner as usize + 2) % 3]]
    }

    /// Whether the triangles around a vertex do not close.
    fn is_rim(&self, fan: &[u32]) -> bool {
        let ends: Vec<u32> = fan.iter().flat_map(|c| self.others(*c)).collect();
        ends.iter().any(|a| ends.iter().filter(|b| *b == a).count() == 1)
    }

    /// Makes some corners of a vertex another vertex.
    fn put(&mut self, corners: &[u32], row: u32) {
        for corner in corners {
            let old = std::mem::replace(&mut self.triangles[*corner as usize / 3][*corner as usize % 3], row);
            self.fans[(old - self.first) as usize].retain(|c| c != corner);
        }
        let fan = &mut self.fans[(row - self.first) as usize];
        fan.extend(corners);
        fan.sort_unstable();
    }

    /// Gives some corners of a vertex to a copy of it.
    fn move_to_copy(&mut self, corners: &[u32], x: &mut [Row], v: &mut [Row]) -> bool {
        if self.used == self.spare || corners.is_empty() {
            return false;
        }
        let copy = self.first + (self.vertices + self.used) as u32;
        let of = self.triangles[corners[0] as usize / 3][corners[0] as usize % 3] as usize;
        self.used += 1;
        self.put(corners, copy);
        (x[copy as usize], v[copy as usize]) = (x[of], v[of]);
        true
    }

    /// Parts of the triangles around a vertex that hang together by edges; the first is that of the first triangle.
    fn parts(&self, fan: &[u32]) -> Vec<Vec<u32>> {
        let (mut left, mut parts) = (fan.to_vec(), Vec::new());
        while !left.is_empty() {
            let (mut part, mut k) = (vec![left.remove(0)], 0);
            while k < part.len() {
                let ends = self.others(part[k]);
                let (near, far): (Vec<u32>, Vec<u32>) = left.into_iter().partition(|c| self.others(*c).iter().any(|e| ends.contains(e)));
                part.extend(near);
                left = far;
                k += 1;
            }
            parts.push(part);
        }
        parts
    }

    /// Takes a vertex apart across a direction; `None` if all of its triangles lie on one side, no copy is left, or, unless `torn_off`, a scrap would
    /// come off. Returns the number of splits and the vertices touched.
    fn split(&mut self, row: u32, across: Vec3<f64>, torn_off: bool, x: &mut [Row], v: &mut [Row]) -> Option<(u64, Vec<u32>)> {
        let fan = self.fan(row).to_vec();
        let here = xyz64(x[row as usize]);
        let ahead = |c: &u32| self.others(*c).iter().map(|i| (xyz64(x[*i as usize]) - here).dot(across)).sum::<f64>() > 0.0;
        let (go, stay): (Vec<u32>, Vec<u32>) = fan.iter().copied().partition(|c| ahead(c));
        let (used, small) = (self.used, fan.iter().all(|c| self.is_scrap(*c)));
        if go.is_empty() || stay.is_empty() || !self.move_to_copy(&go, x, v) {
            return None;
        }
        let mut moved = vec![(go, row)];
        let mut touched: Vec<u32> = fan.iter().flat_map(|c| self.triangles[*c as usize / 3]).collect();
        touched.sort_unstable();
        touched.dedup();
        for near in touched.clone() {
            if x[near as usize][3] == 0.0 {
                continue;
            }
            for part in self.parts(self.fan(near)).into_iter().skip(1) {
                if self.move_to_copy(&part, x, v) {
                    moved.push((part, near));
                }
            }
        }
        let pieces = moved.iter().flat_map(|(corners, _)| corners).chain(&fan);
        if !torn_off && !small && pieces.into_iter().any(|c| self.is_scrap(*c)) {
            moved.iter().rev().for_each(|(corners, row)| self.put(corners, *row));
            // Nobody stands on the rows of the copies any more.
            let first = self.first as usize + self.vertices;
            for row in first + used..first + self.used {
                (x[row][3], v[row]) = (0.0, [0.0; 4]);
            }
            self.used = used;
            return None;
        }
        Some((moved.len() as u64, touched))
    }

    /// Splits vertices of edges beyond their strength; returns how many came apart.
    pub fn split_strained(&mut self, x: &mut [Row], v: &mut [Row]) -> u64 {
        let (mut done, mut touched): (u64, Vec<u32>) = (0, Vec::new());
        for (over, corner) in self.strained(x) {
            let [a, b] = [self.triangles[corner as usize / 3][corner as usize % 3], self.others(corner)[0]];
            if touched.contains(&a) || touched.contains(&b) || self.used == self.spare {
                continue;
            }
            let along = xyz64(x[b as usize]) - xyz64(x[a as usize]);
            let mut ends = [a, b];
            if !self.is_rim(self.fan(a)) && self.is_rim(self.fan(b)) {
                ends = [b, a];
            }
            for end in ends.into_iter().filter(|end| x[*end as usize][3] > 0.0).collect::<Vec<_>>() {
                if let Some((splits, who)) = self.split(end, along, over > TORN_OFF, x, v) {
                    done += splits;
                    touched.extend(who);
                    touched.push(a);
                    touched.push(b);
                    break;
                }
            }
        }
        done
    }

    /// Sets the mass of every vertex: that of a whole one is not summed up anew, so that it keeps its bits.
    pub fn weigh(&self, mass: &mut [Real], x: &mut [Row]) {
        let n = self.vertices + self.spare;
        let (mut sums, mut counts, mut whole) = (vec![0.0; n], vec![0_u32; n], vec![0_u32; n]);
        for (t, share) in self.triangles.iter().zip(&self.share) {
            for k in 0..3 {
                sums[(t[k] - self.first) as usize] += share[k];
                counts[(t[k] - self.first) as usize] += 1;
            }
        }
        self.original.iter().flatten().for_each(|i| whole[(i - self.first) as usize] += 1);
        for i in 0..n {
            let row = self.first as usize + i;
            (mass[row], x[row][3]) = match (self.mass.get(i), self.inverse.get(i)) {
                (Some(mass), Some(inverse)) if counts[i] == whole[i] || *inverse == 0.0 => (*mass, *inverse),
                _ if sums[i] > 0.0 => (sums[i] as Real, (1.0 / sums[i]) as Real),
                _ => (0.0, 0.0),
            };
        }
    }

    /// New rows for nodes of the elements of each list, as (element, node, row), and the elements that no longer hold.
    pub fn changes(&mut self) -> Vec<(ElementList, Vec<(u32, usize, u32)>, Vec<u32>)> {
        let row = |triangles: &[[u32; 3]], c: u32| triangles[c as usize / 3][c as usize % 3];
        let (now, before) = (&self.triangles, &self.known);
        let of = |ties: &Ties| {
            let (mut moved, mut lost) = (Vec::new(), Vec::new());
            for tie in &ties.ties {
                for (k, c) in tie.corners.iter().enumerate().filter(|(_, c)| **c != NONE) {
                    if row(now, *c) != row(before, *c) {
                        moved.push((tie.element, k, row(now, *c)));
                    }
                }
                if tie.same.iter().any(|[c, d]| row(now, *c) != row(now, *d)) {
                    lost.push(tie.element);
                }
            }
            (ties.elements, moved, lost)
        };
        let found = self.ties.iter().map(of).collect();
        self.known.clone_from(&self.triangles);
        found
    }
}
