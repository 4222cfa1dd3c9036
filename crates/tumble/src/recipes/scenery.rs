//! Colliders: the solids that masses feel, and the meshes that pictures show.

use crate::geometry::{Collider, GridSdf, Shape, Vector, surface};
use crate::math::rotation::from_degrees;
use tumble_interface::Mesh;
use tumble_interface::scene::{Collider as Thing, MeshFile, Shape as Words};

/// Half the side of the square that stands for an endless plane in pictures [m].
const PLANE: f64 = 10.0;

/// A mesh put in its place: scaled, turned, moved.
pub fn placed(mesh: &Mesh, file: &MeshFile) -> Mesh {
    let (turn, shift) = (from_degrees(file.rotate), Vector::from(file.translate));
    let place = |v: &[f64; 3]| (turn.turn(Vector::from(*v) * file.scale) + shift).into();
    Mesh { vertices: mesh.vertices.iter().map(place).collect(), triangles: mesh.triangles.clone() }
}

/// The solid of a collider; `mesh` stands where it belongs. `Err` says what is wrong with which key.
pub fn solid(thing: &Thing, mesh: Option<&Mesh>) -> Result<Collider, (&'static str, String)> {
    let shape = match (&thing.shape, mesh) {
        (Words::Sphere { center, radius }, _) => Shape::Sphere { center: (*center).into(), radius: *radius },
        (Words::Box { center, size, rotate }, _) => {
            Shape::Box { center: (*center).into(), half: Vector::from(*size) * 0.5, turn: from_degrees(*rotate) }
        }
        (Words::Plane { point, normal }, _) => {
            let normal = Vector::from(*normal);
            if normal.norm() == 0.0 {
                return Err((".shape.plane.normal", "[0, 0, 0] has no direction".into()));
            }
            let normal = normal.normalized();
            Shape::Plane { normal, offset: normal.dot(Vector::from(*point)) }
        }
        (Words::Floor { height }, _) => Shape::Plane { normal: [0.0, 0.0, 1.0].into(), offset: *height },
        (Words::Mesh(file), Some(mesh)) => {
            let defects = mesh.defects();
            let holes = defects.open_edges + defects.bad_edges;
            if holes > 0 && !file.shell {
                let message = format!(
                    "the mesh has {} open and {} inconsistent edges, so it has no inside; close it, or set shell = true with a thickness",
                    defects.open_edges, defects.bad_edges
                );
                return Err((".shape.mesh", message));
            }
            if !file.shell && volume(mesh) < 0.0 {
                return Err((".shape.mesh", "the triangles face inward; reverse them, or set shell = true with a thickness".into()));
            }
            if file.shell && thing.thickness == 0.0 {
                return Err((".thickness", "0 m, expected > 0 m for a shell, which has no inside".into()));
            }
            match GridSdf::new(mesh, file.resolution, thing.thickness, file.shell) {
                Some(grid) => Shape::Mesh(grid),
                None => return Err((".shape.mesh", "the mesh has no triangle with an area".into())),
            }
        }
        (Words::Mesh(_), None) => return Err((".shape.mesh", "the mesh has not been loaded".into())),
    };
    Ok(Collider { shape, thickness: thing.thickness, friction: thing.friction, restitution: thing.restitution })
}

/// Six times the volume of a closed mesh [m³], negative if its triangles face inward.
fn volume(mesh: &Mesh) -> f64 {
    let corner = |i: u32| Vector::from(mesh.vertices[i as usize]);
    mesh.triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2])))).sum()
}

/// The surface of a collider for pictures.
pub fn scenery(thing: &Thing, mesh: Option<&Mesh>) -> Mesh {
    match &thing.shape {
        Words::Sphere { center, radius } => surface::sphere(4, (*center).into(), *radius),
        Words::Box { center, size, rotate } => surface::cuboid((*center).into(), Vector::from(*size) * 0.5, from_degrees(*rotate)),
        Words::Plane { point, normal } => surface::square((*point).into(), Vector::from(*normal).normalized(), PLANE),
        Words::Floor { height } => surface::square([0.0, 0.0, *height].into(), [0.0, 0.0, 1.0].into(), PLANE),
        Words::Mesh(_) => mesh.cloned().unwrap_or_default(),
    }
}
