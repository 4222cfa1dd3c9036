//! Polygons to triangles: the fan around the first corner where that is right, a constrained Delaunay triangulation where not.
//!
//! With the crate `spade` and not by clipping ears, as `earcut` does, which may leave out corners on straight sides: those of a
//! neighbour would then lie on an edge of the polygon, and a closed mesh come out open.

use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};
use std::collections::HashMap;
use tumble_interface::Mesh;
use tumble_interface::triples::{cross, dot, sub};

/// Parts of the square of the extent of a polygon that count as no area.
const FLAT: f64 = 1e-12;

const CROSSED: &str = "the sides of this polygon cross or touch each other; divide it into triangles and export it again";

/// Triangles of one polygon after another, as three of its corners each.
#[derive(Default)]
pub struct Polygons {
    triangles: Vec<[usize; 3]>,
    corners: Vec<[f64; 3]>,
}

impl Polygons {
    /// Appends the triangles of a polygon to a mesh, with their texture coordinates, of which `at` gives those of a corner.
    ///
    /// # Errors
    /// If its sides cross or touch each other.
    pub fn add(&mut self, mesh: &mut Mesh, polygon: &[u32], at: impl Fn(usize) -> Option<[f64; 2]>) -> Result<(), String> {
        self.triangulate(&mesh.vertices, polygon)?;
        mesh.triangles.extend(self.triangles.iter().map(|t| t.map(|k| polygon[k])));
        mesh.texture.extend(self.triangles.iter().map(|[a, b, c]| Some([at(*a)?, at(*b)?, at(*c)?])));
        Ok(())
    }

    /// Fills `triangles` with those of a polygon, which may have holes that a side leads to and another back. One that has no area, or uses vertices
    /// that do not exist, becomes a fan: the final checks tell.
    ///
    /// # Errors
    /// If its sides cross or touch each other.
    fn triangulate(&mut self, vertices: &[[f64; 3]], polygon: &[u32]) -> Result<(), String> {
        let n = polygon.len();
        self.triangles.clear();
        self.triangles.extend((2..n).map(|k| [0, k - 1, k]));
        if n == 3 || polygon.iter().any(|i| *i as usize >= vertices.len()) {
            return Ok(());
        }
        let first = vertices[polygon[0] as usize];
        self.corners.clear();
        self.corners.extend(polygon.iter().map(|i| sub(vertices[*i as usize], first)));
        let extent_sq = self.corners.iter().map(|x| dot(*x, *x)).fold(0.0, f64::max);
        let least = FLAT * extent_sq;
        let area = |k: usize| cross(self.corners[k - 1], self.corners[k]);
        let whole = (2..n).map(area).fold([0.0; 3], |sum, a| [0, 1, 2].map(|i| sum[i] + a[i]));
        let length = dot(whole, whole).sqrt();
        if !length.is_finite() || (2..n).map(area).all(|a| dot(a, a).sqrt() <= least) {
            return Ok(());
        }
        let normal = whole.map(|x| x / length);
        let parts = || (2..n).map(|k| dot(area(k), normal));
        if length > least && parts().all(|part| part > least) {
            return Ok(());
        }
        // A corner that follows itself adds nothing.
        let ring: Vec<usize> = (0..n).filter(|k| polygon[*k] != polygon[(k + n - 1) % n]).collect();
        let flat = || ring.iter().map(|k| projected(self.corners[*k], normal, extent_sq.sqrt()));
        match (length > least).then(|| delaunay(&flat().collect::<Vec<_>>())).flatten() {
            Some(triangles) => self.triangles = triangles.into_iter().map(|t| t.map(|k| ring[k])).collect(),
            // Corners at one place: nothing overlaps.
            None if length > least && parts().all(|part| part >= -least) => {}
            None => return Err(CROSSED.to_owned()),
        }
        Ok(())
    }
}

/// A place in the plane of a polygon, as part of its extent.
fn projected(x: [f64; 3], normal: [f64; 3], extent: f64) -> Point2<f64> {
    let axis = (0..3).fold(0, |best, a| if normal[a].abs() > normal[best].abs() { a } else { best });
    let mut u = normal.map(|n| -n * normal[(axis + 1) % 3]);
    u[(axis + 1) % 3] += 1.0;
    let length = dot(u, u).sqrt();
    let u = u.map(|u| u / length);
    // Smaller than any difference that rounding leaves; the triangulation refuses numbers close to the smallest ones.
    let part = |axis: [f64; 3]| Some(dot(x, axis) / extent).filter(|x| x.abs() > 1e-30).unwrap_or(0.0);
    Point2::new(part(u), part(cross(normal, u)))
}

/// Triangles of a ring that runs counter-clockwise, in order of their least corner; `None` if its sides cross or touch each other.
fn delaunay(ring: &[Point2<f64>]) -> Option<Vec<[usize; 3]>> {
    let n = ring.len();
    let mut net = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    let at = ring.iter().map(|x| net.insert(*x).ok()).collect::<Option<Vec<_>>>()?;
    let mut sides = HashMap::new();
    for k in 0..n {
        let (from, to) = (at[k], at[(k + 1) % n]);
        if from == to || sides.insert((from, to), k).is_some() || !net.can_add_constraint(from, to) {
            return None;
        }
        net.add_constraint(from, to);
        // Not so if another corner lies on it.
        if !net.exists_constraint(from, to) {
            return None;
        }
    }
    // The faces between the sides at each corner, counter-clockwise, are those of the polygon.
    let mut found = vec![[usize::MAX; 3]; net.num_all_faces()];
    for k in 0..n {
        let before = at[(k + n - 1) % n];
        let mut edge = net.get_edge_from_neighbors(at[k], at[(k + 1) % n])?;
        loop {
            let face = edge.face().as_inner()?;
            let corner = face.vertices().iter().position(|v| v.fix() == at[k])?;
            let place = &mut found[face.fix().index()][corner];
            if std::mem::replace(place, k) != usize::MAX {
                return None;
            }
            edge = edge.ccw();
            if edge.to().fix() == before {
                break;
            }
            if edge.is_constraint_edge() {
                return None;
            }
        }
    }
    let mut triangles: Vec<[usize; 3]> = found.into_iter().filter(|t| t.iter().all(|k| *k != usize::MAX)).collect();
    for t in &mut triangles {
        let least = (0..3).fold(0, |l, k| if t[k] < t[l] { k } else { l });
        t.rotate_left(least);
    }
    triangles.sort_unstable();
    (triangles.len() + 2 == n).then_some(triangles)
}
