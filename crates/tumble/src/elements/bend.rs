//! Bending between two triangles that share an edge.

use super::{Element, force, point};
use crate::math::Lane;

/// The dihedral hinge. Edge x0 x1, opposite vertices x2 and x3; theta is the angle between the normals, 0 when flat:
///
///   r = 2 tan(theta/2) - r0 = 2 sin/(1 + cos) - r0                   (bending.1)
///
/// ```text
///        x1
///       / | \
///     x2  |  x3        n1 = e x (x2 - x0),  n2 = (x3 - x0) x e,  e = x1 - x0
///       \ | /
///        x0
/// ```
/// x [m]   k [N m].   No trigonometry, smooth through flat.
/// Degenerate: folded onto itself (theta = pi) r is infinite; a triangle without area or an edge without length
/// has no normal and gives no force.
/// Source: [tamstorf2013] for the measure, [bridson2003] for the gradient of theta.
pub struct Hinge;

impl Element<4, 1, 1> for Hinge {
    const NAME: &'static str = "hinge";
    #[inline(always)]
    fn residual<L: Lane>([r0]: [L; 1], [x0, x1, x2, x3]: [[L; 4]; 4]) -> [L; 1] {
        let (x0, e) = (point(x0), point(x1) - point(x0));
        let (n1, n2) = (e.cross(point(x2) - x0), (point(x3) - x0).cross(e));
        let length = e.norm();
        let sin = length.positive(n1.cross(n2).dot(e) / length, length.zero());
        let one_plus_cos = n1.norm() * n2.norm() + n1.dot(n2);
        [one_plus_cos.positive((sin + sin) / one_plus_cos, sin.zero()) - r0]
    }
    #[inline(always)]
    fn pullback<L: Lane>([r0]: [L; 1], x: [[L; 4]; 4], [y]: [L; 1]) -> [[L; 4]; 4] {
        let [r] = Self::residual([r0], x);
        let half = (r + r0) * r.like(0.5);
        // dr = (1 + tan²(theta/2)) dtheta
        let y = y * (r.like(1.0) + half * half);
        let [x0, x1, x2, x3] = [point(x[0]), point(x[1]), point(x[2]), point(x[3])];
        let e = x1 - x0;
        let (n1, n2) = (e.cross(x2 - x0), (x3 - x0).cross(e));
        let length = e.norm();
        let (a1, a2) = (n1.norm_sq(), n2.norm_sq());
        let flat = length.zero();
        let m1 = n1 * a1.positive(y / a1, flat);
        let m2 = n2 * a2.positive(y / a2, flat);
        let unit = e * length.positive(length.like(1.0) / length, flat);
        let g2 = -(m1 * length);
        let g3 = -(m2 * length);
        let g0 = m1 * (x1 - x2).dot(unit) + m2 * (x1 - x3).dot(unit);
        let g1 = m1 * (x2 - x0).dot(unit) + m2 * (x3 - x0).dot(unit);
        [force(g0), force(g1), force(g2), force(g3)]
    }
}
