//! Solids of others as bodies that nothing moves.

use super::body::Body;
use super::contact::{Hull, pose};
use crate::geometry::motion::{Pose as Place, Twist};
use crate::geometry::{Collider, Shape, Vector};
use crate::math::Quat;
use parry3d_f64::math::{Pose, Vector as V};
use parry3d_f64::shape::{SharedShape, TriMeshFlags};

const UPRIGHT: Quat<f64> = Quat { v: Vector { x: 0.0, y: 0.0, z: 0.0 }, w: 1.0 };

fn v(p: Vector) -> V {
    V::new(p.x, p.y, p.z)
}

/// Why bodies cannot meet a solid; `None` if they can.
pub fn refusal(solid: &Collider) -> Option<&'static str> {
    match &solid.shape {
        Shape::Animated { facets, .. } if !facets.is_still() => Some(
            "deforms, and rigid bodies meet only solids that keep their shape; give it a rigid `motion`, or take the bodies out of its way",
        ),
        Shape::Box { .. } | Shape::Plane { .. } => None,
        _ if solid.inside => Some("is a container, of which rigid bodies meet only boxes; take a box, or a mesh with shell = true"),
        _ => None,
    }
}

/// The surfaces of a solid, in its own axes; six planes of a box that contains.
pub fn hulls(solid: &Collider) -> Vec<Hull> {
    let still = pose(Vector::default(), UPRIGHT);
    let plane = |normal: Vector, offset: f64, place: Pose| (SharedShape::halfspace(v(normal)), place * pose(normal * offset, UPRIGHT));
    let mesh = |vertices: Vec<[f64; 3]>, triangles: &[[u32; 3]], shell: bool| {
        let flags = if shell { TriMeshFlags::FIX_INTERNAL_EDGES_TWO_SIDED } else { TriMeshFlags::FIX_INTERNAL_EDGES };
        let vertices = vertices.into_iter().map(|p| V::new(p[0], p[1], p[2])).collect();
        SharedShape::trimesh_with_flags(vertices, triangles.to_vec(), flags).ok()
    };
    let shapes: Vec<(SharedShape, Pose)> = match &solid.shape {
        Shape::Sphere { center, radius } => vec![(SharedShape::ball(*radius), pose(*center, UPRIGHT))],
        Shape::Box { center, half, turn } if solid.inside => {
            let sides = [half.x, half.y, half.z].into_iter().enumerate().flat_map(|(axis, half)| {
                [1.0, -1.0].map(|sign| {
                    let mut normal = [0.0; 3];
                    normal[axis] = sign;
                    plane(normal.into(), -half, pose(*center, *turn))
                })
            });
            sides.collect()
        }
        Shape::Box { center, half, turn } => vec![(SharedShape::cuboid(half.x, half.y, half.z), pose(*center, *turn))],
        Shape::Plane { normal, offset } => vec![plane(*normal, *offset, still)],
        Shape::Capsule { from, to, radius } => vec![(SharedShape::capsule(v(*from), v(*to), *radius), still)],
        Shape::Mesh { facets, shell, .. } | Shape::Animated { facets, shell } => {
            mesh(facets.vertices(0.0), facets.triangles(), *shell).into_iter().map(|shape| (shape, still)).collect()
        }
    };
    let reach = |shape: &SharedShape, place: &Pose| {
        if shape.as_halfspace().is_some() { 0.0 } else { place.translation.length() + shape.compute_local_bounding_sphere().radius() }
    };
    let hull = |(shape, place): (SharedShape, Pose)| Hull {
        reach: reach(&shape, &place),
        shape,
        place,
        thickness: solid.thickness,
        friction: solid.friction,
        rolling: 0.0,
        restitution: solid.restitution,
        belt: solid.belt,
    };
    shapes.into_iter().map(hull).collect()
}

/// A solid at a time [s]: its axes are at the origin of its pose, its twist is that of the point there.
pub fn body(solid: &Collider, t: f64, h: f64) -> Body {
    let at = |t: f64| solid.motion.as_ref().map_or((Place::default(), Twist::default()), |motion| motion.at(t));
    // The twist is the mean over the sub-step.
    let ((place, _), (_, twist)) = (at(t), at(t + 0.5 * h));
    Body {
        x: place.shift,
        q: place.turn,
        v: twist.at(place.shift),
        w: twist.angular,
        inverse_mass: 0.0,
        inertia: [f64::INFINITY; 3],
        inverse_inertia: [0.0; 6],
        across: None,
    }
}
