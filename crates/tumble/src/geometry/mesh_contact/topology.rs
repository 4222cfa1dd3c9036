//! Topology of contact: triangles, edges and points of all soft meshes, and the pairs that are never in contact.

use crate::geometry::Vector;
use crate::math::{Row, xyz64};

/// How the features of one object touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Owner {
    /// Half the thickness of the object [m]: two features are in contact when nearer than the sum of their radii.
    pub radius: f64,
    /// Whether the object touches itself.
    pub itself: bool,
    /// Whether it is hair, which meets no hair: what strands do to each other is the hair continuum's.
    pub hair: bool,
}

/// Triangles, edges and points that can meet. Its indices are those of the column of positions that it belongs to.
#[derive(Debug, Clone, Default)]
pub struct Topology {
    vertices: usize,
    owners: Vec<Owner>,
    pub(super) points: Vec<u32>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) edges: Vec<[u32; 2]>,
    /// The object of each vertex, or NOBODY.
    owner: Vec<u32>,
    /// The smallest vertex that each one is sewn to, itself if to none.
    weld: Vec<u32>,
    fixed: Vec<bool>,
    /// Whether there are any at all.
    has_welds: bool,
    has_fixed: bool,
    has_hair: bool,
    /// The first corner of what is no soft object.
    first_corner: Option<u32>,
    rest: Vec<Vector>,
    /// Of each vertex there, its normal, zero where there is no surface; and the smallest vertex that edges and seams connect it to.
    normals: Vec<Vector>,
    /// Directions of curves at rest; zero in surfaces.
    tangents: Vec<Vector>,
    piece: Vec<u32>,
    /// Triangles at each edge: those of edge e are `wings[wing[e]..wing[e + 1]]`.
    wing: Vec<u32>,
    wings: Vec<u32>,
}

const NOBODY: u32 = u32::MAX;

/// The distance at which neighbours touch, over their distance at rest. In a fold as tight as the thickness allows, half a circle, places come as
/// near as 2/pi of that.
const NEIGHBOURS: f64 = 0.5;
/// The largest square of the sine of the angle between a surface and the way to a neighbour: 45°.
const STEEP: f64 = 0.5;

/// The smallest of the vertices that are connected; shortens the way there.
pub(super) fn root(parent: &mut [u32], mut v: u32) -> u32 {
    while parent[v as usize] != v {
        parent[v as usize] = parent[parent[v as usize] as usize];
        v = parent[v as usize];
    }
    v
}

impl Topology {
    /// Nothing yet, over so many vertices.
    pub fn new(vertices: usize) -> Self {
        Self {
            vertices,
            owner: vec![NOBODY; vertices],
            weld: (0..vertices as u32).collect(),
            fixed: vec![false; vertices],
            wing: vec![0],
            ..Self::default()
        }
    }

    /// Adds an object and returns its number. Its points are the corners of triangles, the ends of `segments` (edges without a
    /// triangle: ropes, hair) and `points`. Left out are features that name a vertex twice or one that does not exist; edges that
    /// two triangles share are one. A vertex belongs to the first object that names it.
    pub fn add(&mut self, owner: Owner, triangles: &[[u32; 3]], segments: &[[u32; 2]], points: &[u32]) -> u32 {
        let number = self.owners.len() as u32;
        self.has_hair |= owner.hair;
        self.owners.push(Owner { radius: if owner.radius > 0.0 { owner.radius } else { 0.0 }, ..owner });
        let exists = |v: &u32| (*v as usize) < self.vertices;
        let triangles: Vec<[u32; 3]> = triangles.iter().filter(|t| t.iter().all(exists)).copied().collect();
        let sides = triangles.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]);
        let all = sides.chain(segments.iter().filter(|s| s.iter().all(exists)).copied());
        let mut edges: Vec<[u32; 2]> = all.map(|[a, b]| [a.min(b), a.max(b)]).filter(|[a, b]| a != b).collect();
        edges.sort_unstable();
        edges.dedup();
        let corners = triangles.iter().flatten().chain(edges.iter().flatten()).chain(points.iter().filter(|v| exists(v)));
        for v in corners {
            let owner = &mut self.owner[*v as usize];
            if *owner == NOBODY {
                *owner = number;
                self.points.push(*v);
            }
        }
        self.points.sort_unstable();
        self.triangles.extend(triangles.iter().filter(|[a, b, c]| a != b && b != c && c != a));
        self.edges.extend(edges);
        self.edges.sort_unstable();
        self.edges.dedup();
        self.find_wings();
        number
    }

    fn find_wings(&mut self) {
        let mut of: Vec<(u32, u32)> = Vec::with_capacity(3 * self.triangles.len());
        for (i, t) in self.triangles.iter().enumerate() {
            of.extend((0..3).filter_map(|k| Some((self.edge_of(t[k], t[(k + 1) % 3])?, i as u32))));
        }
        of.sort_unstable();
        self.wing = (0..=self.edges.len() as u32).map(|e| of.partition_point(|(edge, _)| *edge < e) as u32).collect();
        self.wings = of.into_iter().map(|(_, t)| t).collect();
    }

    /// The edge between two vertices.
    pub fn edge_of(&self, a: u32, b: u32) -> Option<u32> {
        self.edges.binary_search(&[a.min(b), a.max(b)]).ok().map(|e| e as u32)
    }

    /// Counts two vertices as one where features that share a vertex are told from others: both sides of a seam.
    pub fn weld(&mut self, a: u32, b: u32) {
        if let (Some(a), Some(b)) = (self.weld.get(a as usize).copied(), self.weld.get(b as usize).copied()) {
            self.has_welds |= a != b;
            for w in self.weld.iter_mut().filter(|w| **w == a.max(b)) {
                *w = a.min(b);
            }
        }
    }

    /// Says whether a vertex goes its own way. Pairs of features that are all fixed never meet.
    pub fn fix(&mut self, vertex: u32, fixed: bool) {
        if let Some(f) = self.fixed.get_mut(vertex as usize) {
            *f = fixed;
            self.has_fixed |= fixed;
        }
    }

    /// Says that all vertices from here on are corners of solids. Features that hang on a fixed vertex pass these: pins may lie on solids, or in
    /// them.
    pub fn end_soft(&mut self, first: u32) {
        self.first_corner = Some(first);
    }

    /// The state without stress: features of one object that are nearer than its thickness there, as in a fine mesh, touch only
    /// when they are nearer than that, and neighbours in one surface only when nearer than half of it. `x` has a row for each vertex, else there
    /// is none. Last, after objects and seams.
    pub fn set_rest(&mut self, x: &[Row]) {
        self.rest = if x.len() == self.vertices { x.iter().map(|r| xyz64(*r)).collect() } else { Vec::new() };
        let rest = &self.rest;
        self.normals = vec![Vector::default(); rest.len()];
        for t in self.triangles.iter().filter(|_| !rest.is_empty()) {
            let [a, b, c] = t.map(|v| rest[v as usize]);
            let n = (b - a).cross(c - a);
            t.iter().for_each(|v| self.normals[*v as usize] = self.normals[*v as usize] + n);
        }
        self.normals.iter_mut().for_each(|n| *n = n.tamed().normalized());
        self.tangents = vec![Vector::default(); rest.len()];
        for [a, b] in self.edges.iter().filter(|_| !rest.is_empty()) {
            let (a, b) = (*a as usize, *b as usize);
            let along = rest[b] - rest[a];
            for v in [a, b].into_iter().filter(|v| self.normals[*v].norm_sq() == 0.0) {
                // Edges of a curve have the smaller vertex first.
                self.tangents[v] = self.tangents[v] + along;
            }
        }
        self.tangents.iter_mut().for_each(|t| *t = t.tamed().normalized());
        self.piece = self.weld.clone();
        for [a, b] in &self.edges {
            let (a, b) = (root(&mut self.piece, *a), root(&mut self.piece, *b));
            self.piece[a.max(b) as usize] = a.min(b);
        }
        (0..self.piece.len() as u32).for_each(|v| self.piece[v as usize] = root(&mut self.piece, v));
    }

    /// Vertices in any feature, in order.
    pub fn points(&self) -> &[u32] {
        &self.points
    }

    /// Triangles, in the order they were added.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Edges, the smaller vertex first, sorted.
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// Triangles at an edge.
    pub fn wings(&self, edge: u32) -> &[u32] {
        let e = edge as usize;
        if e + 1 < self.wing.len() { &self.wings[self.wing[e] as usize..self.wing[e + 1] as usize] } else { &[] }
    }

    /// Rows of the column of positions.
    pub fn vertices(&self) -> usize {
        self.vertices
    }

    /// Whether a vertex goes its own way.
    pub fn is_fixed(&self, vertex: u32) -> bool {
        self.fixed.get(vertex as usize).is_some_and(|f| *f)
    }

    /// The largest distance [m] at which any two features are in contact; solids do not meet each other.
    pub fn largest_thickness(&self) -> f64 {
        let largest = |soft: bool| self.owners.iter().filter(|o| !soft || o.itself).map(|o| o.radius).fold(0.0, f64::max);
        if self.first_corner.is_some() { largest(true) + largest(false) } else { 2.0 * largest(false) }
    }

    /// Whether the features a and b can meet: they share no vertex, one can move, and their objects touch.
    #[inline(always)]
    pub fn meet<const A: usize, const B: usize>(&self, a: [u32; A], b: [u32; B]) -> bool {
        // Most that lie near each other share a vertex: this comes first, and looks at nothing else.
        let mut same = false;
        for i in 0..A {
            for j in 0..B {
                same |= a[i] == b[j];
            }
        }
        if same || self.has_welds && self.share(a, b) {
            return false;
        }
        let (of_a, of_b) = (self.owner[a[0] as usize], self.owner[b[0] as usize]);
        if of_a == of_b && !self.owners[of_a as usize].itself {
            return false;
        }
        if self.has_hair && self.owners[of_a as usize].hair && self.owners[of_b as usize].hair {
            return false;
        }
        let fixed = |v: &u32| self.fixed[*v as usize];
        if !self.has_fixed {
            return true;
        }
        let hangs = |solid: u32, soft: &[u32]| self.first_corner.is_some_and(|first| solid >= first) && soft.iter().any(fixed);
        !(a.iter().all(fixed) && b.iter().all(fixed) || hangs(a[0], &b) || hangs(b[0], &a))
    }

    /// Whether two features share a vertex, seams counted as one.
    #[inline(always)]
    pub(super) fn share<const A: usize, const B: usize>(&self, a: [u32; A], b: [u32; B]) -> bool {
        // Not `array::map`, which would be a call.
        let mut share = false;
        for i in 0..A {
            let w = self.weld[a[i] as usize];
            for j in 0..B {
                share |= w == self.weld[b[j] as usize];
            }
        }
        share
    }

    /// Of features that are neighbours in one surface, or along one curve, the distance [m] at which they touch, and that at which others do:
    ///
    ///   c = min(thickness, |Σ w_i X_i|/2)                                               (contact.24)
    ///
    /// with the weights of the places that are nearest now. At rest the way between these is less than `reach` or two thicknesses long, and
    /// leads along the surface rather than through it.
    #[inline(always)]
    pub(super) fn neighbours(&self, v: [u32; 4], w: [f64; 4], reach: f64) -> Option<(f64, f64)> {
        let (a, b) = (v[0] as usize, v[3] as usize);
        if self.rest.is_empty() || self.owner[a] != self.owner[b] || self.piece[a] != self.piece[b] {
            return None;
        }
        let at = |k: usize| self.rest[v[k] as usize] * w[k];
        let way = at(0) + at(1) + at(2) + at(3);
        let (length_sq, whole) = (way.norm_sq(), 2.0 * self.owners[self.owner[a] as usize].radius);
        let far = reach.max(whole / NEIGHBOURS);
        let leads = |v: usize| {
            let (through, along) = (way.dot(self.normals[v]), way.dot(self.tangents[v]));
            let is_curve = self.tangents[v].norm_sq() > 0.0;
            through * through <= STEEP * length_sq && (!is_curve || along * along >= (1.0 - STEEP) * length_sq)
        };
        let along = length_sq < far * far && leads(a) && leads(b);
        along.then(|| (whole.min(NEIGHBOURS * length_sq.sqrt()), whole))
    }

    /// The distance [m] at which two features touch; `rest` finds that of the same features at rest.
    pub(super) fn thickness(&self, a: u32, b: u32, rest: impl Fn(&[Vector]) -> f64) -> f64 {
        let (of_a, of_b) = (self.owner[a as usize], self.owner[b as usize]);
        let thickness = self.owners[of_a as usize].radius + self.owners[of_b as usize].radius;
        if of_a == of_b && !self.rest.is_empty() { thickness.min(rest(&self.rest)) } else { thickness }
    }
}
