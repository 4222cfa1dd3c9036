//! Triangle meshes of simple solids.

use super::Vector;
use crate::math::Quat;
use crate::math::rotation::from_z_to;
use std::collections::HashMap;
use tumble_interface::Mesh;

/// A sphere, as an octahedron whose triangles are divided in four `levels` times.
pub fn sphere(levels: u32, center: Vector, radius: f64) -> Mesh {
    let mut mesh = Mesh {
        vertices: vec![[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]],
        triangles: vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]],
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

/// A box with these half edges, turned.
pub fn cuboid(center: Vector, half: Vector, turn: Quat<f64>) -> Mesh {
    let sign = |bit: usize, k: usize| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
    let corner = |k: usize| center + turn.turn(Vector { x: sign(0, k) * half.x, y: sign(1, k) * half.y, z: sign(2, k) * half.z });
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Mesh {
        vertices: (0..8).map(|k| corner(k).into()).collect(),
        triangles: faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect(),
    }
}

/// A square around a point, seen counter-clockwise from where the normal points.
pub fn square(center: Vector, normal: Vector, half: f64) -> Mesh {
    let turn = from_z_to(normal);
    let corner = |x: f64, y: f64| (center + turn.turn(Vector { x: x * half, y: y * half, z: 0.0 })).into();
    Mesh {
        vertices: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
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
        let block = cuboid([1.0, 0.0, 0.0].into(), [0.5, 1.0, 2.0].into(), crate::math::rotation::from_degrees([10.0, 20.0, 30.0]));
        assert_eq!(block.defects(), Defects::default());
        assert!((volume(&block) - 8.0).abs() < 1e-12);
    }
}
