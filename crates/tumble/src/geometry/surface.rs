//! Triangle meshes of simple solids.

use super::Vector;
use crate::math::Quat;
use crate::math::functions::{cos, sin};
use crate::math::rotation::from_z_to;
use std::collections::HashMap;
use tumble_interface::Mesh;

/// A sphere, as an octahedron whose triangles are divided in four `levels` times.
pub fn sphere(levels: u32, center: Vector, radius: f64) -> Mesh {
    let mut mesh = Mesh {
        vertices: vec![[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]],
        triangles: vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]],
        ..Mesh::default()
    };
    for _ in 0..levels {
        let mut middle = HashMap::new();
        let mut finer = Vec::new();
        for t in &mesh.triangles {
            let m = [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])].map(|(a, b)| {
                *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let m = (Vector::from(mesh.vertices[a as usize]) + Vector::from(mesh.vertices[b as usize])).normalized();
                    mesh.vertices.push(m.into());
                    mesh.vertices.len() as u32 - 1
                })
            });
            finer.extend([[t[0], m[0], m[2]], [m[0], t[1], m[1]], [m[2], m[1], t[2]], m]);
        }
        mesh.triangles = finer;
    }
    for v in &mut mesh.vertices {
        *v = (center + Vector::from(*v) * radius).into();
    }
    mesh
}

/// A cylinder with round ends around the segment from a to b, rings from one pole to the other.
pub fn capsule(a: Vector, b: Vector, radius: f64) -> Mesh {
    /// Sides, and rings of each end.
    const SIDES: u32 = 32;
    const RINGS: u32 = 8;
    let turn = if (b - a).norm() > 0.0 { from_z_to(b - a) } else { from_z_to(Vector { x: 0.0, y: 0.0, z: 1.0 }) };
    let at = |center: Vector, ring: f64, side: u32| -> [f64; 3] {
        let (up, around) = (ring * std::f64::consts::FRAC_PI_2, f64::from(side) / f64::from(SIDES) * std::f64::consts::TAU);
        (center + turn.turn(Vector { x: cos(up) * cos(around), y: cos(up) * sin(around), z: sin(up) }) * radius).into()
    };
    let mut vertices = vec![at(a, -1.0, 0)];
    let rings =
        (1..=RINGS).map(|k| (a, f64::from(k) / f64::from(RINGS) - 1.0)).chain((0..RINGS).map(|k| (b, f64::from(k) / f64::from(RINGS))));
    for (center, ring) in rings {
        vertices.extend((0..SIDES).map(|side| at(center, ring, side)));
    }
    vertices.push(at(b, 1.0, 0));
    let (rows, last) = (2 * RINGS, 2 * RINGS * SIDES + 1);
    let mut triangles = Vec::new();
    for i in 0..SIDES {
        let j = (i + 1) % SIDES;
        triangles.push([0, 1 + j, 1 + i]);
        for row in 0..rows - 1 {
            let (low, high) = (1 + row * SIDES, 1 + (row + 1) * SIDES);
            triangles.extend([[low + i, low + j, high + j], [low + i, high + j, high + i]]);
        }
        let top = 1 + (rows - 1) * SIDES;
        triangles.push([last, top + i, top + j]);
    }
    Mesh { vertices, triangles, ..Mesh::default() }
}

/// A solid of revolution about an axis along z: the profile holds distances from the axis and heights, counter-clockwise where the
/// distance grows to the right.
pub fn revolved(center: Vector, profile: &[[f64; 2]], sides: u32) -> Mesh {
    let mut mesh = Mesh::default();
    // A corner on the axis is one vertex, any other a ring of them.
    let mut rings = Vec::new();
    for [r, z] in profile {
        rings.push((mesh.vertices.len() as u32, *r > 0.0));
        for k in 0..if *r > 0.0 { sides } else { 1 } {
            let angle = f64::from(k) / f64::from(sides) * std::f64::consts::TAU;
            mesh.vertices.push((center + Vector { x: r * cos(angle), y: r * sin(angle), z: *z }).into());
        }
    }
    for (i, low) in rings.iter().enumerate() {
        let high = rings[(i + 1) % rings.len()];
        let at = |(first, ring): (u32, bool), k: u32| first + if ring { k % sides } else { 0 };
        for k in 0..sides {
            let [a, b, c, d] = [at(*low, k), at(*low, k + 1), at(high, k + 1), at(high, k)];
            mesh.triangles.extend([[a, b, c], [a, c, d]].into_iter().filter(|[i, j, k]| i != j && j != k && k != i));
        }
    }
    mesh
}

/// A box with these half edges, turned.
pub fn cuboid(center: Vector, half: Vector, turn: Quat<f64>) -> Mesh {
    let sign = |bit: usize, k: usize| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
    let corner = |k: usize| center + turn.turn(Vector { x: sign(0, k) * half.x, y: sign(1, k) * half.y, z: sign(2, k) * half.z });
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Mesh {
        vertices: (0..8).map(|k| corner(k).into()).collect(),
        triangles: faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect(),
        ..Mesh::default()
    }
}

/// A square around a point, seen counter-clockwise from where the normal points.
pub fn square(center: Vector, normal: Vector, half: f64) -> Mesh {
    let turn = from_z_to(normal);
    let corner = |x: f64, y: f64| (center + turn.turn(Vector { x: x * half, y: y * half, z: 0.0 })).into();
    Mesh {
        vertices: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_interface::mesh::Defects;

    #[test]
    fn solids_are_closed_and_face_outward() {
        let volume = |mesh: &Mesh| -> f64 {
            let part = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|i| Vector::from(mesh.vertices[i as usize]));
                a.dot(b.cross(c)) / 6.0
            };
            mesh.triangles.iter().map(part).sum()
        };
        let ball = sphere(4, [1.0, 2.0, 3.0].into(), 2.0);
        assert_eq!(ball.defects(), Defects::default());
        assert!((volume(&ball) / (32.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.01);
        let (a, b) = (Vector::from([1.0, 0.0, 0.0]), Vector::from([1.0, 3.0, 4.0]));
        let pill = capsule(a, b, 2.0);
        assert_eq!(pill.defects(), Defects::default());
        // A cone with a radius of 3 and a height of 4; a ring with a square cut, by the theorem of Pappus.
        for (profile, exact) in
            [(vec![[0.0, 0.0], [3.0, 0.0], [0.0, 4.0]], 12.0), (vec![[2.0, 0.0], [3.0, 0.0], [3.0, 1.0], [2.0, 1.0]], 5.0)]
        {
            let solid = revolved([1.0, 2.0, 3.0].into(), &profile, 200);
            assert_eq!(solid.defects(), Defects::default());
            assert!((volume(&solid) / (exact * std::f64::consts::PI) - 1.0).abs() < 1e-3);
        }
        // A cylinder of length 5 and a ball.
        assert!((volume(&pill) / (std::f64::consts::PI * (20.0 + 32.0 / 3.0)) - 1.0).abs() < 0.01);
        let block = cuboid([1.0, 0.0, 0.0].into(), [0.5, 1.0, 2.0].into(), crate::math::rotation::from_degrees([10.0, 20.0, 30.0]));
        assert_eq!(block.defects(), Defects::default());
        assert!((volume(&block) - 8.0).abs() < 1e-12);
    }
}
