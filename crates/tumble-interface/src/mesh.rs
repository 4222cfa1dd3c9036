//! A triangle mesh as data; reading one from bytes is the work of `tumble-io`.

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
}

/// What a linter finds in a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Defects {
    /// Edges with one triangle only: the mesh is open there.
    pub open_edges: usize,
    /// Edges with more than two triangles, or two that run the same way.
    pub bad_edges: usize,
    /// Triangles of zero area or with a repeated vertex.
    pub degenerate: usize,
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
        let mut index = std::collections::HashMap::new();
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
        let mut defects = Defects::default();
        for t in &self.triangles {
            let [a, b, c] = t.map(|i| self.vertices[i as usize]);
            let (u, v) = (sub(b, a), sub(c, a));
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            if n.iter().all(|x| *x == 0.0) {
                defects.degenerate += 1;
            }
        }
        for ([a, b], faces) in self.edges() {
            let forward = faces.iter().filter(|t| runs(self.triangles[**t as usize], a, b)).count();
            match (faces.len(), forward) {
                (1, _) => defects.open_edges += 1,
                (2, 1) => {}
                _ => defects.bad_edges += 1,
            }
        }
        defects
    }
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
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
