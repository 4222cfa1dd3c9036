//! Points spread evenly over curves, surfaces and volumes, as functions of uniform random numbers.

use super::{Bvh, Vector};
use crate::math::Quat;
use crate::math::functions::{cos, pow, sin};
use crate::math::rotation::from_z_to;
use std::f64::consts::{PI, TAU};
use tumble_interface::Mesh;

/// Cells along the longest side of the box of a mesh in which its inside is looked for.
const CELLS: f64 = 32.0;
/// Points tried in the cells of a mesh volume: enough for plates a hundredth of a cell thick.
const TRIES: u32 = 10_000;

/// Something that points are spread over.
pub enum Sampler {
    /// A point.
    Point(Vector),
    /// Straight pieces, with the length up to the end of each.
    Curve(Vec<Vector>, Vec<f64>),
    /// A disk: centre, turn of e_z to its normal, radius.
    Disk(Vector, Quat<f64>, f64),
    /// A ball, or its surface.
    Ball(Vector, f64, bool),
    /// A box: centre, edges, turn.
    Box(Vector, Vector, Quat<f64>),
    /// Triangles with their normals, and the area up to each.
    Surface(Vec<([Vector; 3], Vector)>, Vec<f64>),
    /// The inside of a mesh: cells that may hold some of it, and their edge.
    Volume(Box<Bvh>, Vec<Vector>, f64),
}

/// Sums up to and including each number.
fn up_to(numbers: impl Iterator<Item = f64>) -> Vec<f64> {
    numbers
        .scan(0.0, |sum, x| {
            *sum += x;
            Some(*sum)
        })
        .collect()
}

/// The item in which the share u of the total lies, and where in it.
fn pick(sums: &[f64], u: f64) -> (usize, f64) {
    let total = sums.last().copied().unwrap_or(0.0);
    let at = u * total;
    let i = sums.partition_point(|sum| *sum <= at).min(sums.len().saturating_sub(1));
    let before = if i == 0 { 0.0 } else { sums[i - 1] };
    (i, ((at - before) / (sums[i] - before)).clamp(0.0, 1.0))
}

impl Sampler {
    /// Over straight pieces between points; `None` if they have no length.
    pub fn curve(points: &[[f64; 3]]) -> Option<Self> {
        let points: Vec<Vector> = points.iter().map(|p| Vector::from(*p)).collect();
        let sums = up_to(points.windows(2).map(|p| (p[1] - p[0]).norm()));
        (sums.last().is_some_and(|l| *l > 0.0)).then_some(Self::Curve(points, sums))
    }

    /// Over the triangles of a mesh; `None` if they have no area.
    pub fn surface(mesh: &Mesh) -> Option<Self> {
        let corner = |i: u32| Vector::from(mesh.vertices[i as usize]);
        let triangles: Vec<([Vector; 3], Vector)> = mesh
            .triangles
            .iter()
            .map(|t| t.map(corner))
            .map(|[a, b, c]| ([a, b, c], (b - a).cross(c - a)))
            .filter(|(_, n)| n.norm() > 0.0)
            .collect();
        let sums = up_to(triangles.iter().map(|(_, n)| n.norm()));
        (!triangles.is_empty()).then_some(Self::Surface(triangles, sums))
    }

    /// Over the inside of a closed mesh; `None` if it has none.
    pub fn volume(mesh: &Mesh) -> Option<Self> {
        let bvh = Bvh::new(mesh)?;
        let (low, high) = bvh.bounds();
        let size: [f64; 3] = (high - low).into();
        let edge = size.iter().copied().fold(0.0, f64::max) / CELLS;
        let n = size.map(|s| (s / edge).ceil().max(1.0) as usize);
        let reach = edge * 3.0_f64.sqrt() / 2.0;
        let mut cells = Vec::new();
        for k in 0..n[2] {
            for j in 0..n[1] {
                for i in 0..n[0] {
                    let center = low + Vector { x: i as f64 + 0.5, y: j as f64 + 0.5, z: k as f64 + 0.5 } * edge;
                    if bvh.signed_distance(center) < reach {
                        cells.push(center);
                    }
                }
            }
        }
        let corner = |i: u32| Vector::from(mesh.vertices[i as usize]);
        let volume: f64 = mesh.triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2])))).sum();
        (volume > 0.0 && !cells.is_empty()).then(|| Self::Volume(Box::new(bvh), cells, edge))
    }

    /// A point and the normal there, zero where there is none. `draw(k)` gives the k-th four uniform numbers in [0, 1).
    pub fn sample(&self, draw: &dyn Fn(u32) -> [f64; 4]) -> (Vector, Vector) {
        let [u, v, w, _] = draw(0);
        match self {
            Self::Point(p) => (*p, Vector::default()),
            Self::Curve(points, sums) => {
                let (i, s) = pick(sums, u);
                (points[i] + (points[i + 1] - points[i]) * s, Vector::default())
            }
            Self::Disk(center, turn, radius) => {
                let (r, a) = (radius * u.sqrt(), TAU * v);
                (*center + turn.turn(Vector { x: r * cos(a), y: r * sin(a), z: 0.0 }), turn.axis_z())
            }
            Self::Ball(center, radius, surface) => {
                let n = in_cone(u, v, PI);
                let r = if *surface { *radius } else { radius * pow(w, 1.0 / 3.0) };
                (*center + n * r, n)
            }
            Self::Box(center, size, turn) => {
                let p = Vector { x: (u - 0.5) * size.x, y: (v - 0.5) * size.y, z: (w - 0.5) * size.z };
                (*center + turn.turn(p), Vector::default())
            }
            Self::Surface(triangles, sums) => {
                let ([a, b, c], n) = &triangles[pick(sums, u).0];
                let root = v.sqrt();
                (*a * (1.0 - root) + *b * (root * (1.0 - w)) + *c * (root * w), n.normalized())
            }
            Self::Volume(bvh, cells, edge) => {
                let mut p = cells[0];
                for k in 0..TRIES {
                    let [a, u, v, w] = draw(k);
                    let cell = cells[((a * cells.len() as f64) as usize).min(cells.len() - 1)];
                    p = cell + Vector { x: u - 0.5, y: v - 0.5, z: w - 0.5 } * *edge;
                    if bvh.signed_distance(p) < 0.0 {
                        break;
                    }
                }
                (p, Vector::default())
            }
        }
    }
}

/// A direction within `angle` [rad] of e_z, evenly over the solid angle.
pub fn in_cone(u: f64, v: f64, angle: f64) -> Vector {
    let z = 1.0 - u * (1.0 - cos(angle));
    let (r, a) = ((1.0 - z * z).max(0.0).sqrt(), TAU * v);
    Vector { x: r * cos(a), y: r * sin(a), z }
}

/// The same about the direction `axis`.
pub fn about(axis: Vector, u: f64, v: f64, angle: f64) -> Vector {
    if angle == 0.0 { axis.normalized() } else { from_z_to(axis).turn(in_cone(u, v, angle)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::surface;
    use crate::math::Random;

    fn many(sampler: &Sampler) -> Vec<(Vector, Vector)> {
        let random = Random::new(1, "points");
        (0..20_000).map(|id| sampler.sample(&|k| random.uniform(id, 0, k))).collect()
    }

    /// Mean of f over the points; its standard error is at most 0.3/sqrt(20000) = 0.002 for f in [0, 1].
    fn mean(points: &[(Vector, Vector)], f: impl Fn(Vector) -> f64) -> f64 {
        points.iter().map(|(p, _)| f(*p)).sum::<f64>() / points.len() as f64
    }

    #[test]
    fn points_are_even_over_length_area_and_volume() {
        // An elbow of lengths 1 and 3: a quarter of the points on the first piece.
        let curve = many(&Sampler::curve(&[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 3.0, 0.0]]).unwrap());
        assert!((mean(&curve, |p| f64::from(p.y == 0.0)) - 0.25).abs() < 0.01);
        assert!(curve.iter().all(|(p, _)| p.z == 0.0 && (p.y == 0.0 || p.x == 1.0)));
        // Half the area of a disk lies within r/sqrt 2.
        let disk = many(&Sampler::Disk(Vector::default(), from_z_to([1.0, 0.0, 0.0].into()), 2.0));
        assert!((mean(&disk, |p| f64::from(p.norm() < 2.0_f64.sqrt())) - 0.5).abs() < 0.012);
        assert!(disk.iter().all(|(p, n)| p.x.abs() < 1e-12 && p.norm() <= 2.0 && (n.x - 1.0).abs() < 1e-12));
        // An eighth of the volume of a ball lies within r/2; |z| of its surface is uniform.
        let ball = many(&Sampler::Ball(Vector::default(), 1.0, false));
        assert!((mean(&ball, |p| f64::from(p.norm() < 0.5)) - 0.125).abs() < 0.01);
        let sphere = many(&Sampler::Ball(Vector::default(), 1.0, true));
        assert!(sphere.iter().all(|(p, n)| (p.norm() - 1.0).abs() < 1e-12 && (*p - *n).norm() < 1e-12));
        assert!((mean(&sphere, |p| p.z.abs()) - 0.5).abs() < 0.01);
        // A box 1 x 2 x 3 as a mesh: faces of area 2, 3 and 6, each twice.
        let mesh = surface::cuboid(Vector::default(), [0.5, 1.0, 1.5].into(), Quat { v: Vector::default(), w: 1.0 });
        let faces = many(&Sampler::surface(&mesh).unwrap());
        assert!((mean(&faces, |p| f64::from(p.z.abs() > 1.5 - 1e-9)) - 2.0 / 11.0).abs() < 0.012);
        assert!((mean(&faces, |p| f64::from(p.x.abs() > 0.5 - 1e-9)) - 6.0 / 11.0).abs() < 0.015);
        // A plate far thinner than a cell.
        let plate = surface::cuboid(Vector::default(), [0.5, 0.5, 0.005].into(), Quat { v: Vector::default(), w: 1.0 });
        let inside = Sampler::volume(&plate).unwrap();
        let random = Random::new(1, "plate");
        assert!((0..200).all(|id| inside.sample(&|k| random.uniform(id, 0, k)).0.z.abs() < 0.005));
        // A ball as a mesh: all inside, an eighth within half the radius.
        let volume = many(&Sampler::volume(&surface::sphere(3, Vector::default(), 1.0)).unwrap());
        assert!(volume.iter().all(|(p, _)| p.norm() < 1.0));
        assert!((mean(&volume, |p| f64::from(p.norm() < 0.5)) - 0.125).abs() < 0.012);
        assert!(mean(&volume, |p| p.x).abs() < 0.015);
    }

    #[test]
    fn what_has_no_measure_has_no_points() {
        assert!(Sampler::curve(&[[1.0; 3], [1.0; 3]]).is_none());
        let flat = Mesh { vertices: vec![[0.0; 3]; 3], triangles: vec![[0, 1, 2]], ..Mesh::default() };
        assert!(Sampler::surface(&flat).is_none());
        assert!(Sampler::volume(&flat).is_none());
    }

    #[test]
    fn directions_fill_the_cone() {
        let random = Random::new(1, "cone");
        let angle = 0.5;
        let axis = Vector::from([0.0, -1.0, 1.0]).normalized();
        let cosines: Vec<f64> =
            (0..20_000).map(|id| random.uniform(id, 0, 0)).map(|[u, v, ..]| about(axis, u, v, angle).dot(axis)).collect();
        assert!(cosines.iter().all(|c| *c > cos(angle) - 1e-12));
        // Even over the solid angle: the cosine is uniform between cos(angle) and 1.
        let mean = cosines.iter().sum::<f64>() / cosines.len() as f64;
        assert!((mean - (1.0 + cos(angle)) / 2.0).abs() < 0.001, "{mean}");
    }
}
