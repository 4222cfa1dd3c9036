//! Contacts of overlapping polyhedra, held to what their extents allow.
//!
//! Two convex shapes are parted by a translation along any direction by the overlap of their extents along it: no point of contact is deeper.
//! Parry's points of thin pieces can be, by far: where its polytope ends at a wrong direction, or where three corners of a face, from which its
//! plane is taken, lie nearly on a line.

use parry3d_f64::math::{Pose, Vector as V};
use parry3d_f64::query::{ContactManifold, TrackedContact};
use parry3d_f64::shape::{PackedFeatureId, PolygonalFeature, Shape};

/// Overlaps are compared to this part of them.
const ROUND: f64 = 1e-6;

/// Corners of a polyhedron, and unit normals of its faces.
fn polyhedron(shape: &dyn Shape) -> Option<(Vec<V>, Vec<V>)> {
    if let Some(hull) = shape.as_convex_polyhedron() {
        return Some((hull.points().to_vec(), hull.faces().iter().map(|face| face.normal).collect()));
    }
    let [x, y, z] = shape.as_cuboid()?.half_extents.to_array();
    let side = |k: usize, bit: usize, half: f64| if k & bit == 0 { half } else { -half };
    let corners = (0..8).map(|k| V::new(side(k, 1, x), side(k, 2, y), side(k, 4, z))).collect();
    Some((corners, [V::X, -V::X, V::Y, -V::Y, V::Z, -V::Z].to_vec()))
}

/// The corner that lies farthest along n, and how far.
fn farthest(corners: &[V], n: V) -> (V, f64) {
    corners.iter().map(|p| (*p, p.dot(n))).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default()
}

/// Replaces points of a polyhedron at a half-space, of which Parry's miss corners beside the face that it takes for the lowest, by all of its
/// corners within a distance [m].
fn settle(manifold: &mut ContactManifold<(), ()>, within: f64, apart: &Pose, corners: &[V], up: V) {
    manifold.clear();
    (manifold.local_n1, manifold.local_n2) = (-(apart.rotation * up), up);
    for corner in corners {
        let below = apart.inverse_transform_point(*corner);
        let dist = below.dot(up);
        if dist <= within {
            let unknown = PackedFeatureId::UNKNOWN;
            manifold.points.push(TrackedContact::new(*corner, below - up * dist, unknown, unknown, dist));
        }
    }
}

/// Puts the points of two polyhedra that overlap right; the second has its pose in the axes of the first. The normal becomes that of a face where
/// they overlap by less along it; points that are deeper than the extents along the normal go.
pub fn correct(manifold: &mut ContactManifold<(), ()>, within: f64, apart: &Pose, [one, two]: [&dyn Shape; 2]) {
    if let (Some(hull), Some(plane)) = (one.as_convex_polyhedron(), two.as_halfspace()) {
        return settle(manifold, within, apart, hull.points(), plane.normal);
    }
    let boxes = one.as_cuboid().is_some() && two.as_cuboid().is_some();
    if boxes || manifold.points.iter().all(|point| point.dist >= 0.0) {
        return;
    }
    let (Some((p, m)), Some((mut q, n))) = (polyhedron(one), polyhedron(two)) else { return };
    q.iter_mut().for_each(|q| *q = *apart * *q);
    let overlap = |n: V| farthest(&p, n).1 + farthest(&q, -n).1;
    let normals = m.into_iter().chain(n.into_iter().map(|n| -(apart.rotation * n)));
    let Some((least, n)) = normals.map(|n| (overlap(n), n)).min_by(|a, b| a.0.total_cmp(&b.0)) else { return };
    let mut depth = overlap(manifold.local_n1);
    if least < depth * (1.0 - ROUND) {
        let (Some((a, _)), Some((b, _))) = (one.as_polygonal_feature_map(), two.as_polygonal_feature_map()) else { return };
        let (back, mut first, mut second) = (apart.inverse(), PolygonalFeature::default(), PolygonalFeature::default());
        (depth, manifold.local_n1, manifold.local_n2) = (least, n, back.rotation * -n);
        a.local_support_feature(manifold.local_n1, &mut first);
        b.local_support_feature(manifold.local_n2, &mut second);
        manifold.clear();
        PolygonalFeature::contacts(apart, &back, n, manifold.local_n2, &first, &second, manifold, false);
    }
    manifold.points.retain(|point| -point.dist <= depth.max(0.0) * (1.0 + ROUND));
    if depth > 0.0 && manifold.points.iter().all(|point| point.dist > -depth * (1.0 - ROUND)) {
        // The corner that reaches deepest, and the point of the other extent below it.
        let n = manifold.local_n1;
        let on = farthest(&q, -n).0;
        let unknown = PackedFeatureId::UNKNOWN;
        manifold.points.push(TrackedContact::new(on + n * depth, apart.inverse_transform_point(on), unknown, unknown, -depth));
    }
}
