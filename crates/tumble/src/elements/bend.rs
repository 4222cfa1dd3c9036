//! Bending between two triangles that share an edge.

use super::{Element, force, point};
use crate::math::Lane;

/// The dihedral hinge. Edge x0 x1, opposite vertices x2 and x3; theta is the angle between the normals, 0 when flat:
///
///   r = 2 sin(theta/2) - r0                                          (bending.1)
///
/// ```text
///        x1
///       / | \
///     x2  |  x3        n1 = e x (x2 - x0),  n2 = (x3 - x0) x e,  e = x1 - x0
///       \ | /
///        x0
/// ```
/// x [m]   k [N m].   No trigonometry, smooth through flat, and bounded: |r + r0| <= 2.
/// Degenerate: folded onto itself (theta = pi) the side of the fold, and with it the sign of r + r0, is anyone's guess;
/// for r0 = 0 neither energy nor force notice. A triangle without area or an edge without length has no normal and gives
/// no force.
/// Source: [bridson2003] for the measure and the gradient of theta.
pub struct Hinge;

/// 2 sin(theta/2) and cos(theta/2), from the quotient that loses no digits: by cos(theta/2) on a hinge that is more open
/// than a right angle, by sin(theta/2) on the others.
#[inline(always)]
fn half_angle<L: Lane>([x0, x1, x2, x3]: [[L; 4]; 4]) -> (L, L) {
    let (x0, e) = (point(x0), point(x1) - point(x0));
    let (n1, n2) = (e.cross(point(x2) - x0), (point(x3) - x0).cross(e));
    let scale = e.norm() * (n1.norm_sq() * n2.norm_sq()).sqrt();
    let (zero, one, two) = (scale.zero(), scale.like(1.0), scale.like(2.0));
    let sin = scale.positive(n1.cross(n2).dot(e) / scale, zero);
    let cos = scale.positive(n1.dot(n2) * e.norm() / scale, one);
    let open = ((one + cos) * scale.like(0.5)).sqrt();
    let folded = ((one - cos) * two).sqrt();
    let folded = sin.positive(folded, -folded);
    (cos.positive(sin / open, folded), cos.positive(open, sin / folded))
}

impl Element<4, 1, 1> for Hinge {
    const NAME: &'static str = "hinge";
    #[inline(always)]
    fn residual<L: Lane>([r0]: [L; 1], x: [[L; 4]; 4]) -> [L; 1] {
        [half_angle(x).0 - r0]
    }
    #[inline(always)]
    fn pullback<L: Lane>(_: [L; 1], x: [[L; 4]; 4], [y]: [L; 1]) -> [[L; 4]; 4] {
        // dr = cos(theta/2) dtheta
        let y = y * half_angle(x).1;
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
