//! A closed mesh as convex parts: it is cut by planes, always the piece that its convex hull exceeds by most, until the hulls of all pieces together
//! fill little more than the mesh.                                                                                         (rigid.5)
//!
//! Source: cuts as in [wei2022], here of exact pieces by their volume. A piece is a list of flat faces, each a list of directed sides in any order,
//! which close: cutting needs no topology.

use crate::geometry::Vector;
use parry3d_f64::math::{Pose, Vector as V};
use parry3d_f64::shape::SharedShape;
use tumble_interface::Mesh;

/// Cuts pass what they are to touch by this part of the size of the mesh, so that no corner lies in them.
const PAST: f64 = 1e-7;
/// Corners closer than this part of the size are one.
const WELD: f64 = 1e-6;
/// Planes of faces that are tried as cuts, those of the largest faces that cut.
const FACES: usize = 16;
/// Cuts whose hulls differ by less than this part of a piece are as good: the one into more equal halves is taken. A ring must be cut twice before
/// anything is gained.
const EQUAL: f64 = 1e-3;

/// Normals of cuts that are tried anywhere.
const NORMALS: [[f64; 3]; 13] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, 1.0],
    [0.0, 1.0, -1.0],
    [1.0, 1.0, 1.0],
    [1.0, 1.0, -1.0],
    [1.0, -1.0, 1.0],
    [-1.0, 1.0, 1.0],
];

/// A flat face of a piece.
#[derive(Clone, Default)]
pub struct Face {
    /// Its sides, counter-clockwise from outside around what is filled.
    pub sides: Vec<[Vector; 2]>,
    /// The piece on its other side, where that is told.
    pub beyond: Option<usize>,
}

impl Face {
    /// Its area times its normal, outwards [m²].
    pub fn area(&self) -> Vector {
        let Some([origin, _]) = self.sides.first() else { return Vector::default() };
        self.sides.iter().fold(Vector::default(), |sum, [a, b]| sum + (*a - *origin).cross(*b - *origin) * 0.5)
    }
}

/// A plane: its unit normal, and its distance from the origin [m].
pub type Plane = (Vector, f64);

/// A piece of the mesh.
struct Piece {
    faces: Vec<Face>,
    hull: (SharedShape, Pose),
    /// By how much its hull is larger [m³].
    excess: f64,
    volume: f64,
    /// Whether it cannot be cut.
    done: bool,
}

impl Piece {
    /// `None` of what has no volume.
    fn new(faces: Vec<Face>, size: f64) -> Option<Self> {
        let (hull, filled) = hull(&faces, size)?;
        let volume = volume(&faces);
        Some(Self { faces, hull, excess: filled - volume, volume, done: false })
    }

    /// The cut into the two pieces whose hulls together are smallest.
    fn best_cut(&self, size: f64) -> Option<[Self; 2]> {
        let halves = |plane: Plane| {
            let [a, b] = cut(&self.faces, plane).map(|faces| Self::new(faces, size));
            Some([a?, b?])
        };
        let score = |[a, b]: &[Self; 2]| [((a.excess + b.excess) / (EQUAL * self.volume)).round(), a.volume.max(b.volume)];
        let less = |a: &[Self; 2], b: &[Self; 2]| {
            let ([excess, larger], [other, its]) = (score(a), score(b));
            excess.total_cmp(&other).then(larger.total_cmp(&its))
        };
        self.planes(size).into_iter().filter_map(halves).min_by(less)
    }

    /// Cuts that are tried: across some directions at quarters of its extent, and along its largest faces that lie within it.
    fn planes(&self, size: f64) -> Vec<Plane> {
        let extent = |n: Vector| {
            let along = self.faces.iter().flat_map(|face| &face.sides).map(|[a, _]| a.dot(n));
            along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], d| [low.min(d), high.max(d)])
        };
        let mut planes = Vec::new();
        for n in NORMALS.map(|n| Vector::from(n).normalized()) {
            let [low, high] = extent(n);
            planes.extend([0.25, 0.5, 0.75].map(|part| (n, low + part * (high - low) + PAST * size)));
        }
        let mut faces: Vec<(f64, Plane)> = Vec::new();
        for face in &self.faces {
            let area = face.area();
            let n = area.normalized();
            let Some([origin, _]) = face.sides.first() else { continue };
            let plane = (n, origin.dot(n) + PAST * size);
            let known = |(_, (m, d)): &(f64, Plane)| (*m - n).norm() < WELD && (d - plane.1).abs() < WELD * size;
            if let Some((sum, _)) = faces.iter_mut().find(|other| known(other)) {
                *sum += area.norm();
            } else if extent(n)[1] > plane.1 + WELD * size {
                faces.push((area.norm(), plane));
            }
        }
        faces.sort_by(|a, b| b.0.total_cmp(&a.0));
        planes.extend(faces.into_iter().take(FACES).map(|(_, plane)| plane));
        planes
    }
}

/// The convex parts of a closed mesh whose triangles face outwards, each in its place, and the part of its volume by which they exceed it together: no more than
/// `tolerance`, unless it takes more than `most` parts. `None` of a mesh without a volume.
pub fn convex_parts(mesh: &Mesh, tolerance: f64, most: usize) -> Option<(Vec<(SharedShape, Pose)>, f64)> {
    let (low, high) = mesh.bounds()?;
    let size = (Vector::from(high) - Vector::from(low)).norm();
    let whole = Piece::new(faces(mesh), size)?;
    let filled = whole.volume;
    let excess = |pieces: &[Piece]| pieces.iter().map(|piece| piece.excess).sum::<f64>() / filled;
    let mut pieces = vec![whole];
    while pieces.len() < most && excess(&pieces) > tolerance {
        let open = pieces.iter().enumerate().filter(|(_, piece)| !piece.done);
        let Some((worst, _)) = open.max_by(|a, b| a.1.excess.total_cmp(&b.1.excess)) else { break };
        match pieces[worst].best_cut(size) {
            Some([a, b]) => {
                pieces[worst] = a;
                pieces.push(b);
            }
            None => pieces[worst].done = true,
        }
    }
    let left = excess(&pieces).max(0.0);
    Some((pieces.into_iter().map(|piece| piece.hull).collect(), left))
}

/// Volume that a closed mesh encloses [m³], negative if its triangles face inwards.
pub fn enclosed(mesh: &Mesh) -> f64 {
    volume(&faces(mesh))
}

/// The triangles of a mesh.
pub fn faces(mesh: &Mesh) -> Vec<Face> {
    let corners = mesh.triangles.iter().map(|t| t.map(|i| Vector::from(mesh.vertices[i as usize])));
    corners.map(|[a, b, c]| Face { sides: vec![[a, b], [b, c], [c, a]], beyond: None }).collect()
}

/// Volume of what faces enclose [m³].
pub fn volume(faces: &[Face]) -> f64 {
    let Some([origin, _]) = faces.iter().find_map(|face| face.sides.first()) else { return 0.0 };
    faces.iter().filter_map(|face| Some((face.sides.first()?[0] - *origin).dot(face.area()) / 3.0)).sum()
}

/// The convex hull of points about their mean, and where that is, unless it has no volume: contact of hulls far from their origin is inexact.
pub fn centered_hull(points: &[V]) -> Option<(SharedShape, Pose)> {
    let center = points.iter().fold(V::ZERO, |sum, p| sum + *p) / points.len().max(1) as f64;
    let shape = SharedShape::convex_hull(&points.iter().map(|p| *p - center).collect::<Vec<_>>())?;
    (shape.mass_properties(1.0).mass() > 0.0).then_some((shape, Pose::from_translation(center)))
}

/// The convex hull of faces, and its volume [m³].
pub fn hull(faces: &[Face], size: f64) -> Option<((SharedShape, Pose), f64)> {
    let cell = |p: &Vector| <[f64; 3]>::from(*p).map(|c| (c / (WELD * size)).round() as i64);
    let mut corners: Vec<([i64; 3], Vector)> = faces.iter().flat_map(|face| &face.sides).map(|[a, _]| (cell(a), *a)).collect();
    corners.sort_by_key(|(cell, _)| *cell);
    corners.dedup_by_key(|(cell, _)| *cell);
    if corners.len() < 4 {
        return None;
    }
    let points: Vec<V> = corners.into_iter().map(|(_, p)| V::new(p.x, p.y, p.z)).collect();
    let hull = centered_hull(&points)?;
    let filled = hull.0.mass_properties(1.0).mass();
    Some((hull, filled))
}

/// What of faces lies below a plane, and what above, both closed by the section.
pub fn cut(faces: &[Face], (n, d): Plane) -> [Vec<Face>; 2] {
    let (mut parts, mut caps) = ([Vec::new(), Vec::new()], [Face::default(), Face::default()]);
    for face in faces {
        let mut kept = [0, 1].map(|_| Face { sides: Vec::new(), beyond: face.beyond });
        // Where its outline passes the plane, and whether it leaves what is below.
        let mut passes: Vec<(Vector, bool)> = Vec::new();
        for [a, b] in &face.sides {
            let [over, under] = [a, b].map(|p| p.dot(n) - d);
            let [from, to] = [over, under].map(|height| usize::from(height >= 0.0));
            if from == to {
                kept[from].sides.push([*a, *b]);
                continue;
            }
            let p = passage([*a, *b], [over, under]);
            kept[from].sides.push([*a, p]);
            kept[to].sides.push([p, *b]);
            passes.push((p, from == 0));
        }
        if passes.len() > 2 {
            let along = face.area().cross(n);
            passes.sort_by(|a, b| a.0.dot(along).total_cmp(&b.0.dot(along)));
        }
        for pair in passes.chunks_exact(2) {
            let [out, back] = if pair[0].1 { [pair[0].0, pair[1].0] } else { [pair[1].0, pair[0].0] };
            for (part, [p, q]) in [[out, back], [back, out]].into_iter().enumerate() {
                kept[part].sides.push([p, q]);
                caps[part].sides.push([q, p]);
            }
        }
        for (part, face) in parts.iter_mut().zip(kept) {
            part.extend((!face.sides.is_empty()).then_some(face));
        }
    }
    for (part, cap) in parts.iter_mut().zip(caps) {
        part.extend((!cap.sides.is_empty()).then_some(cap));
    }
    parts
}

/// Where a side passes a plane at these heights of its ends; the same point for both faces that share it.
fn passage([a, b]: [Vector; 2], [over, under]: [f64; 2]) -> Vector {
    let point = |a: Vector, b: Vector, from: f64, to: f64| a + (b - a) * (from / (from - to));
    if <[f64; 3]>::from(a) < <[f64; 3]>::from(b) { point(a, b, over, under) } else { point(b, a, under, over) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A prism of height 1 over a polygon that need not be convex; `lid` lists the triangles of its top.
    fn prism(outline: &[[f64; 2]], lid: &[[u32; 3]]) -> Mesh {
        let n = outline.len() as u32;
        let at = |z: f64| outline.iter().map(move |[x, y]| [*x, *y, z]);
        let bottom = lid.iter().map(|[a, b, c]| [*a, *c, *b]);
        let top = lid.iter().map(|t| t.map(|i| i + n));
        let sides = (0..n).flat_map(|i| {
            let j = (i + 1) % n;
            [[i, j, j + n], [i, j + n, i + n]]
        });
        Mesh { vertices: at(0.0).chain(at(1.0)).collect(), triangles: bottom.chain(top).chain(sides).collect(), ..Mesh::default() }
    }

    fn filled(parts: &[(SharedShape, Pose)]) -> f64 {
        parts.iter().map(|(part, _)| part.mass_properties(1.0).mass()).sum()
    }

    #[test]
    fn an_l_is_two_boxes_and_a_box_is_one() {
        let l = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let mesh = prism(&l, &[[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]]);
        let (parts, left) = convex_parts(&mesh, 0.01, 32).unwrap();
        assert!(parts.len() == 2 && left < 1e-6 && (filled(&parts) - 4.0).abs() < 1e-5, "{} {left} {}", parts.len(), filled(&parts));
        let (parts, _) =
            convex_parts(&prism(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]], &[[0, 1, 2], [0, 2, 3]]), 0.01, 32).unwrap();
        assert!(parts.len() == 1 && (filled(&parts) - 2.0).abs() < 1e-9);
    }

    #[test]
    fn cutting_keeps_the_volume_whatever_the_plane() {
        let u = [[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [2.0, 2.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let mesh = prism(&u, &[[0, 1, 4], [0, 4, 5], [1, 2, 4], [2, 3, 4], [0, 5, 7], [5, 6, 7]]);
        let mut pieces = vec![faces(&mesh)];
        for (n, d) in [([0.2, 1.0, 0.1], 1.4), ([1.0, 0.3, 0.0], 1.7), ([0.1, -0.2, 1.0], 0.3), ([0.5, 0.5, 0.5], 1.2)] {
            let plane = (Vector::from(n).normalized(), d);
            pieces = pieces.iter().flat_map(|piece| cut(piece, plane)).filter(|piece| !piece.is_empty()).collect();
            let sum: f64 = pieces.iter().map(|piece| volume(piece)).sum();
            assert!((sum - 5.0).abs() < 1e-12 && pieces.iter().all(|piece| volume(piece) > 0.0), "{sum}");
        }
        assert!(pieces.len() > 8, "{}", pieces.len());
    }

    #[test]
    fn a_torus_takes_more_parts_the_closer_they_are_to_be() {
        let (around, across) = (32, 12);
        let point = |k: u32| {
            let [a, b] = [(k / across, around), (k % across, across)].map(|(i, n)| std::f64::consts::TAU * f64::from(i) / f64::from(n));
            let r = 1.0 + 0.3 * b.cos();
            [r * a.cos(), r * a.sin(), 0.3 * b.sin()]
        };
        let index = |i: u32, j: u32| i % around * across + j % across;
        let quads = (0..around).flat_map(|i| (0..across).map(move |j| [i, j]));
        let triangles = quads.flat_map(|[i, j]| {
            let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
            [[a, b, c], [a, c, d]]
        });
        let mesh = Mesh { vertices: (0..around * across).map(point).collect(), triangles: triangles.collect(), ..Mesh::default() };
        let [coarse, fine] = [0.1, 0.02].map(|tolerance| convex_parts(&mesh, tolerance, 64).unwrap());
        assert!(
            coarse.1 <= 0.1 && fine.1 <= 0.02 && coarse.0.len() < fine.0.len() && fine.0.len() <= 32,
            "{} {}",
            coarse.0.len(),
            fine.0.len()
        );
        let whole = 0.5 * f64::from(across) * 0.09 * (std::f64::consts::TAU / f64::from(across)).sin();
        // Its volume, up to the chords around: Pappus.
        let exact = whole * std::f64::consts::TAU;
        assert!((filled(&fine.0) / exact - 1.0).abs() < 0.03, "{} of {exact}", filled(&fine.0));
        assert_eq!(convex_parts(&mesh, 0.001, 5).unwrap().0.len(), 5);
    }
}
