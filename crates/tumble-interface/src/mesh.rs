//! A triangle mesh as data; reading one from bytes is the work of `tumble-io`.

use crate::triples::{cross, dot, sub};
use std::collections::HashMap;

/// Vertices closer than this part of the largest coordinate may be one that was rounded: it is eight units in the last place of single
/// precision, which is what places keep that were computed in two ways, or written with six digits behind the point.
const ROUNDING: f64 = 1.0 / (1 << 20) as f64;
/// And closer than this part of the shortest edge at either, so that nothing of a mesh that is as fine as that becomes one.
const FINE: f64 = 0.01;
/// A triangle counts as one without area if twice that is at most this part of its longest side squared.
pub const SLIVER: f64 = 1e-12;

/// Triangles over shared vertices.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Vertex positions [m].
    pub vertices: Vec<[f64; 3]>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Texture coordinates of the corners of each triangle, v upwards, as far as the file has some; empty if it has none. A
    /// vertex has several of them where it lies on a seam.
    pub texture: Vec<Option<[[f64; 2]; 3]>>,
    /// Vertices of the file that belong to no triangle and were left out, so that the numbers of those behind them have changed.
    pub unused: usize,
    /// The first vertex, from 0, that has another number here than in the file: that one, and this.
    pub renumbered: Option<[u32; 2]>,
}

/// Findings of the mesh checker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Defects {
    /// Edges with one triangle only: the mesh is open there.
    pub open_edges: usize,
    /// Edges with more than two triangles, or two that run the same way.
    pub bad_edges: usize,
    /// Triangles of zero area or with a repeated vertex.
    pub degenerate: usize,
}

/// Defects of a mesh as a soft surface, where open edges are allowed: the changes that a repair would make.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Flaws {
    /// Triangles that are there already.
    pub repeated: usize,
    /// Triangles with a vertex twice, or without an area.
    pub degenerate: usize,
    /// Edges between two triangles that face different ways.
    pub turned: usize,
    /// Edges of more than two triangles.
    pub crowded: usize,
    /// Open edges that lie on others.
    pub unsewn: usize,
    /// Vertices that belong to no triangle.
    pub unused: usize,
}

impl Flaws {
    /// Whether there are none.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

impl std::fmt::Display for Flaws {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let kinds = [
            (self.repeated, "triangle is a duplicate", "triangles are duplicates"),
            (self.degenerate, "triangle has no area", "triangles have no area"),
            (self.turned, "edge is between triangles that face different ways", "edges are between triangles that face different ways"),
            (self.crowded, "edge has more than two triangles", "edges have more than two triangles"),
            (self.unsewn, "open edge coincides with another", "open edges coincide with others"),
            (self.unused, "vertex belongs to no triangle", "vertices belong to no triangle"),
        ];
        let said = kinds.iter().filter(|(n, ..)| *n > 0);
        let said: Vec<String> = said.map(|(n, one, many)| format!("{n} {}", if *n == 1 { one } else { many })).collect();
        f.write_str(&said.join(", "))
    }
}

impl Mesh {
    /// Lower and upper corner of the bounding box [m]; `None` without vertices.
    pub fn bounds(&self) -> Option<([f64; 3], [f64; 3])> {
        let first = *self.vertices.first()?;
        let (mut low, mut high) = (first, first);
        for v in &self.vertices {
            for a in 0..3 {
                low[a] = low[a].min(v[a]);
                high[a] = high[a].max(v[a]);
            }
        }
        Some((low, high))
    }

    /// Edges as (low vertex, high vertex), each once, in order of first appearance, with their triangles.
    pub fn edges(&self) -> Vec<([u32; 2], Vec<u32>)> {
        let mut index = HashMap::new();
        let mut edges: Vec<([u32; 2], Vec<u32>)> = Vec::new();
        for (t, triangle) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                let key = [a.min(b), a.max(b)];
                let e = *index.entry(key).or_insert_with(|| {
                    edges.push((key, Vec::new()));
                    edges.len() - 1
                });
                edges[e].1.push(t as u32);
            }
        }
        edges
    }

    /// Counts what would make an inside and an outside doubtful.
    pub fn defects(&self) -> Defects {
        self.doubtful().0
    }

    /// The same, with the ends of the first open edge and of the first bad one.
    pub(crate) fn doubtful(&self) -> (Defects, [Option<[u32; 2]>; 2]) {
        let mut defects = Defects::default();
        let mut first = [None; 2];
        for t in &self.triangles {
            let [a, b, c] = t.map(|i| self.vertices[i as usize]);
            let n = cross(sub(b, a), sub(c, a));
            if n.iter().all(|x| *x == 0.0) {
                defects.degenerate += 1;
            }
        }
        for ([a, b], faces) in self.edges() {
            let forward = faces.iter().filter(|t| runs(self.triangles[**t as usize], a, b)).count();
            match (faces.len(), forward) {
                (1, _) => {
                    defects.open_edges += 1;
                    first[0] = first[0].or(Some([a, b]));
                }
                (2, 1) => {}
                _ => {
                    defects.bad_edges += 1;
                    first[1] = first[1].or(Some([a, b]));
                }
            }
        }
        (defects, first)
    }

    /// Texture coordinates of the corners of all triangles, as pictures want them, 0 where there are none; empty if there are none at all.
    pub fn drawn_texture(&self) -> Vec<[f32; 6]> {
        if self.texture.len() != self.triangles.len() {
            return Vec::new();
        }
        let flat = |[[a, b], [c, d], [e, f]]: [[f64; 2]; 3]| [a, b, c, d, e, f].map(|x| x as f32);
        self.texture.iter().map(|corners| corners.map_or([0.0; 6], flat)).collect()
    }

    /// For each vertex, the first one at its place: at the same one, or so near that rounding may have moved it.
    pub fn places(&self) -> Vec<u32> {
        let all = || self.vertices.iter().flatten().map(|x| x.abs());
        let largest = all().fold(0.0, f64::max);
        let near = ROUNDING * largest;
        // The shortest edge at each vertex that is none by the measure of rounding; none where whole triangles are as small as that.
        let mut edge_sq = vec![f64::INFINITY; self.vertices.len()];
        for t in &self.triangles {
            let corners = t.map(|i| self.vertices[i as usize]);
            let sides = [0, 1, 2].map(|k| sub(corners[(k + 1) % 3], corners[k])).map(|way| dot(way, way));
            let is_fine = sides.iter().all(|side| (0.0..=near * near).contains(side)) && sides.iter().any(|side| *side > 0.0);
            for k in 0..3 {
                for i in [t[k], t[(k + 1) % 3]].map(|i| i as usize) {
                    if is_fine {
                        edge_sq[i] = 0.0;
                    } else if sides[k] > near * near {
                        edge_sq[i] = edge_sq[i].min(sides[k]);
                    }
                }
            }
        }
        // Cells wider than what is near, and not begun at zero, where vertices like to lie: most then look into one only.
        let width = 8.0 * near.max(f64::MIN_POSITIVE);
        let cell = |x: f64| ((x / width) + 0.381_966).floor() as i64;
        let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
        let mut places = Vec::with_capacity(self.vertices.len());
        for (i, x) in self.vertices.iter().enumerate() {
            let ends = x.map(|x| [cell(x - near), cell(x + near)]);
            let is_same = |j: &&u32| {
                let (way, j) = (sub(*x, self.vertices[**j as usize]), **j as usize);
                let known = edge_sq[i].is_finite() && edge_sq[j].is_finite();
                let fine_sq = if known { FINE * FINE * edge_sq[i].min(edge_sq[j]) } else { 0.0 };
                dot(way, way) <= fine_sq.min(near * near)
            };
            let mut found: Option<u32> = None;
            for c in (0..8_usize).map(|k| [0, 1, 2].map(|a| ends[a][k >> a & 1])) {
                let first = cells.get(&c).and_then(|there| there.iter().find(is_same));
                found = [found, first.copied()].into_iter().flatten().min();
            }
            if found.is_none() {
                cells.entry(x.map(cell)).or_default().push(i as u32);
            }
            places.push(found.unwrap_or(i as u32));
        }
        places
    }

    /// Counts what mending would change in a soft surface.
    pub fn flaws(&self) -> Flaws {
        self.flawed().0
    }

    /// The same, with the vertices at the first place of any, if it has one.
    pub(crate) fn flawed(&self) -> (Flaws, Vec<u32>) {
        let mut first = Vec::new();
        let mut note = |at: &[u32]| {
            if first.is_empty() {
                first.extend(at);
            }
        };
        let mut flaws = Flaws { unused: self.unused, ..Flaws::default() };
        let places = self.places();
        let place = |i: u32| places[i as usize];
        // Each triangle by its vertices, however it faces, and by its places, as it does.
        let (mut nodes_seen, mut places_seen) = (HashMap::new(), HashMap::new());
        let mut kept = Vec::with_capacity(self.triangles.len());
        for t in &self.triangles {
            let mut at = t.map(place);
            if at[0] == at[1] || at[1] == at[2] || at[2] == at[0] || self.is_sliver(*t) {
                flaws.degenerate += 1;
                note(t);
                continue;
            }
            let mut nodes = *t;
            nodes.sort_unstable();
            let least = (0..3).fold(0, |l, k| if at[k] < at[l] { k } else { l });
            at.rotate_left(least);
            let seen = [nodes_seen.insert(nodes, ()), places_seen.insert(at, ())];
            if seen.iter().any(Option::is_some) {
                flaws.repeated += 1;
                note(t);
            } else {
                kept.push(*t);
            }
        }
        let kept = Self { triangles: kept, ..Self::default() };
        // Open edges by their places: how many run from the lower to the higher, and how many back.
        let mut rims: HashMap<[u32; 2], [usize; 2]> = HashMap::new();
        for ([a, b], faces) in kept.edges() {
            let forward = |t: &u32| runs(kept.triangles[*t as usize], a, b);
            match faces[..] {
                [t] => {
                    let back = (place(a) > place(b)) == forward(&t);
                    rims.entry([place(a).min(place(b)), place(a).max(place(b))]).or_default()[usize::from(back)] += 1;
                }
                [t, u] if forward(&t) != forward(&u) => {}
                [_, _] => {
                    flaws.turned += 1;
                    note(&[a, b]);
                }
                _ => {
                    flaws.crowded += 1;
                    note(&[a, b]);
                }
            }
        }
        let coincide = rims.iter().filter(|(_, n)| n[0] > 0 && n[1] > 0 || n[0] + n[1] == 2);
        flaws.unsewn = coincide.clone().map(|(_, n)| n[0] + n[1]).sum();
        if let Some((ends, _)) = coincide.min() {
            note(ends);
        }
        (flaws, first)
    }

    /// Whether a triangle has no area.
    pub fn is_sliver(&self, t: [u32; 3]) -> bool {
        let [a, b, c] = t.map(|i| self.vertices[i as usize]);
        let n = cross(sub(b, a), sub(c, a));
        let longest_sq = [sub(b, a), sub(c, b), sub(a, c)].iter().map(|s| dot(*s, *s)).fold(0.0, f64::max);
        dot(n, n).sqrt() <= SLIVER * longest_sq
    }
}

/// Whether the triangle runs from a to b.
fn runs(t: [u32; 3], a: u32, b: u32) -> bool {
    (0..3).any(|k| t[k] == a && t[(k + 1) % 3] == b)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> Mesh {
        Mesh {
            vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
            ..Mesh::default()
        }
    }

    #[test]
    fn a_closed_mesh_has_no_defects() {
        assert_eq!(tetrahedron().defects(), Defects::default());
        assert_eq!(tetrahedron().edges().len(), 6);
    }

    #[test]
    fn each_defect_is_counted() {
        let mut open = tetrahedron();
        open.triangles.pop();
        assert_eq!(open.defects(), Defects { open_edges: 3, ..Defects::default() });
        let mut flipped = tetrahedron();
        flipped.triangles[0] = [0, 1, 2];
        assert_eq!(flipped.defects().bad_edges, 3);
        let mut flat = tetrahedron();
        flat.vertices[3] = [0.0; 3];
        assert_eq!(flat.defects().degenerate, 2);
    }
}
