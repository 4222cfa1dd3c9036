//! A tree of boxes over triangles, for the closest point and the signed distance.
//!
//! The sign is that of the pseudonormal of the closest feature (face, edge or vertex), which is right wherever the mesh
//! is closed and consistently wound. Source: [baerentzen2005]. Verified against a brute-force search and a sphere.

use super::Vector;
use crate::math::functions::acos;
use tumble_interface::Mesh;

/// Triangles per leaf.
const LEAF: usize = 4;

/// Triangles in a tree.
#[derive(Debug, Clone)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// Triangles in leaf order.
    triangles: Vec<[u32; 3]>,
    vertices: Vec<Vector>,
    /// Pseudonormals: of faces, of their three edges, of vertices.
    faces: Vec<Vector>,
    edges: Vec<[Vector; 3]>,
    corners: Vec<Vector>,
}

/// A box of the tree.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    low: Vector,
    high: Vector,
    /// Of a leaf the first triangle, of an inner node its right child; the left one follows the node.
    pub next: u32,
    /// Count of triangles, 0 for an inner node.
    pub count: u32,
}

/// The closest point of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest {
    /// The point [m].
    pub point: Vector,
    /// Pseudonormal of the feature it lies on.
    pub normal: Vector,
    /// Squared distance [m²].
    pub distance_sq: f64,
}

impl Bvh {
    /// A tree over the triangles that have an area; `None` if there are none.
    pub fn new(mesh: &Mesh) -> Option<Self> {
        let vertices: Vec<Vector> = mesh.vertices.iter().map(|v| Vector::from(*v)).collect();
        let corner = |t: &[u32; 3]| t.map(|i| vertices[i as usize]);
        let area = |t: &[u32; 3]| {
            let [a, b, c] = corner(t);
            (b - a).cross(c - a)
        };
        let mut triangles: Vec<[u32; 3]> = mesh.triangles.iter().filter(|t| area(t).norm_sq() > 0.0).copied().collect();
        if triangles.is_empty() {
            return None;
        }
        let mut nodes = Vec::new();
        let middle = |t: &[u32; 3]| {
            let [a, b, c] = corner(t);
            a + b + c
        };
        build(&mut nodes, &mut triangles, 0, &|t| bounds(&corner(t)), &middle);
        let faces: Vec<Vector> = triangles.iter().map(|t| area(t).normalized()).collect();
        let mut corners = vec![Vector::default(); vertices.len()];
        let mut across = std::collections::HashMap::new();
        for (t, n) in triangles.iter().zip(&faces) {
            for k in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|i| t[(k + i) % 3]);
                let (u, v) = (
                    (vertices[b as usize] - vertices[a as usize]).normalized(),
                    (vertices[c as usize] - vertices[a as usize]).normalized(),
                );
                let angle = acos(u.dot(v).clamp(-1.0, 1.0));
                corners[a as usize] = corners[a as usize] + *n * angle;
                let sum: &mut Vector = across.entry((a.min(b), a.max(b))).or_default();
                *sum = *sum + *n;
            }
        }
        let edge = |a: u32, b: u32| across[&(a.min(b), a.max(b))];
        let edges = triangles.iter().map(|t| [edge(t[0], t[1]), edge(t[1], t[2]), edge(t[2], t[0])]).collect();
        Some(Self { nodes, triangles, vertices, faces, edges, corners })
    }

    /// The closest point to p, if one lies nearer than `within` [m].
    pub fn closest(&self, p: Vector, within: f64) -> Option<Closest> {
        let mut best: Option<Closest> = None;
        let mut limit = within * within;
        let mut stack = vec![0_usize];
        while let Some(i) = stack.pop() {
            let node = &self.nodes[i];
            if box_distance_sq(node, p) >= limit {
                continue;
            }
            if node.count == 0 {
                let (left, right) = (i + 1, node.next as usize);
                let near = box_distance_sq(&self.nodes[left], p) <= box_distance_sq(&self.nodes[right], p);
                stack.extend(if near { [right, left] } else { [left, right] });
                continue;
            }
            for t in node.next as usize..(node.next + node.count) as usize {
                let (point, feature) = closest_on_triangle(p, self.triangles[t].map(|i| self.vertices[i as usize]));
                let distance_sq = (p - point).norm_sq();
                if distance_sq < limit {
                    limit = distance_sq;
                    let normal = match feature {
                        Feature::Face => self.faces[t],
                        Feature::Edge(k) => self.edges[t][k],
                        Feature::Vertex(k) => self.corners[self.triangles[t][k] as usize],
                    };
                    best = Some(Closest { point, normal, distance_sq });
                }
            }
        }
        best
    }

    /// Distance to the surface [m], negative inside.
    pub fn signed_distance(&self, p: Vector) -> f64 {
        match self.closest(p, f64::INFINITY) {
            Some(c) if (p - c.point).dot(c.normal) < 0.0 => -c.distance_sq.sqrt(),
            Some(c) => c.distance_sq.sqrt(),
            None => f64::INFINITY,
        }
    }

    /// Lower and upper corner of everything [m].
    pub fn bounds(&self) -> (Vector, Vector) {
        (self.nodes[0].low, self.nodes[0].high)
    }
}

fn bounds(points: &[Vector]) -> (Vector, Vector) {
    points.iter().skip(1).fold((points[0], points[0]), |(l, h), p| (low(l, *p), high(h, *p)))
}

pub(super) fn low(a: Vector, b: Vector) -> Vector {
    Vector { x: a.x.min(b.x), y: a.y.min(b.y), z: a.z.min(b.z) }
}

pub(super) fn high(a: Vector, b: Vector) -> Vector {
    Vector { x: a.x.max(b.x), y: a.y.max(b.y), z: a.z.max(b.z) }
}

/// Splits at the median of the longest axis of the centres.
pub(super) fn build(
    nodes: &mut Vec<Node>,
    triangles: &mut [[u32; 3]],
    first: usize,
    bounds: &impl Fn(&[u32; 3]) -> (Vector, Vector),
    middle: &impl Fn(&[u32; 3]) -> Vector,
) {
    let (l, h) = triangles[1..].iter().map(bounds).fold(bounds(&triangles[0]), |(l, h), (a, b)| (low(l, a), high(h, b)));
    let me = nodes.len();
    nodes.push(Node { low: l, high: h, next: first as u32, count: triangles.len() as u32 });
    if triangles.len() <= LEAF {
        return;
    }
    let centres: Vec<Vector> = triangles.iter().map(middle).collect();
    let (l, h) = centres[1..].iter().fold((centres[0], centres[0]), |(l, h), c| (low(l, *c), high(h, *c)));
    let d: [f64; 3] = (h - l).into();
    let axis = if d[0] >= d[1] && d[0] >= d[2] { 0 } else { 1 + usize::from(d[2] > d[1]) };
    let key = |t: &[u32; 3]| <[f64; 3]>::from(middle(t))[axis];
    // Ties are broken by the indices, so that the order never depends on the sorting algorithm.
    triangles.sort_unstable_by(|a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
    let half = triangles.len() / 2;
    let (left, right) = triangles.split_at_mut(half);
    build(nodes, left, first, bounds, middle);
    nodes[me].next = nodes.len() as u32;
    nodes[me].count = 0;
    build(nodes, right, first + half, bounds, middle);
}

fn box_distance_sq(node: &Node, p: Vector) -> f64 {
    let outside = |p: f64, l: f64, h: f64| (l - p).max(p - h).max(0.0);
    let d = [outside(p.x, node.low.x, node.high.x), outside(p.y, node.low.y, node.high.y), outside(p.z, node.low.z, node.high.z)];
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
}

/// Feature that contains the closest point; edge k runs from corner k to corner k + 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Feature {
    Face,
    Edge(usize),
    Vertex(usize),
}

/// The closest point of a triangle, by the regions of its barycentric coordinates. Source: [ericson2004], 5.1.5.
pub(super) fn closest_on_triangle(p: Vector, [a, b, c]: [Vector; 3]) -> (Vector, Feature) {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (a, Feature::Vertex(0));
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return (b, Feature::Vertex(1));
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (a + ab * (d1 / (d1 - d3)), Feature::Edge(0));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return (c, Feature::Vertex(2));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (a + ac * (d2 / (d2 - d6)), Feature::Edge(2));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return (b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6))), Feature::Edge(1));
    }
    let scale = 1.0 / (va + vb + vc);
    (a + ab * (vb * scale) + ac * (vc * scale), Feature::Face)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A sphere of radius 1.
    pub fn sphere(n: u32) -> Mesh {
        crate::geometry::surface::sphere(n, Vector::default(), 1.0)
    }

    /// Points evenly spread over the cube |x| < 1.5 (the R3 sequence).
    pub fn points() -> impl Iterator<Item = Vector> {
        (0..500_u32).map(|i| Vector::from([0.819_172_513, 0.671_043_607, 0.549_700_478].map(|a| (f64::from(i) * a).fract() * 3.0 - 1.5)))
    }

    #[test]
    fn the_tree_finds_what_brute_force_finds() {
        let mesh = sphere(2);
        let bvh = Bvh::new(&mesh).unwrap();
        for p in points() {
            let brute = mesh
                .triangles
                .iter()
                .map(|t| (p - closest_on_triangle(p, t.map(|i| mesh.vertices[i as usize].into())).0).norm())
                .fold(f64::INFINITY, f64::min);
            let found = bvh.closest(p, f64::INFINITY).unwrap();
            assert!((found.distance_sq.sqrt() - brute).abs() < 1e-14);
            assert!(bvh.closest(p, brute * 0.99).is_none());
        }
    }

    #[test]
    fn signed_distance_is_that_of_the_sphere_also_at_corners() {
        let bvh = Bvh::new(&sphere(4)).unwrap();
        let mut inside = 0;
        for p in points().chain([[0.0, 0.0, 1.2], [0.999, 0.0, 0.0], [0.0, -0.5, 0.5]].map(Vector::from)) {
            let exact = p.norm() - 1.0;
            // The facets lie within 1 - cos(half an edge) = 0.003 of the sphere.
            assert!((bvh.signed_distance(p) - exact).abs() < 0.004, "{p:?}");
            inside += usize::from(exact < 0.0);
        }
        assert!(inside > 20);
    }

    #[test]
    fn a_mesh_without_area_gives_no_tree() {
        assert!(Bvh::new(&Mesh { vertices: vec![[0.0; 3]; 3], triangles: vec![[0, 1, 2]], ..Mesh::default() }).is_none());
    }
}
