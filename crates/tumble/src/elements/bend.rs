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
/// Source: [bridson2003] for the gradient of theta. Differs: there sin(theta/2) is the moment; here 2 sin(theta/2) is the
/// measure, so that the moment is k sin(theta).
pub struct Hinge;

/// 2 sin(theta/2), cos(theta/2) and |n1||n2|, which is zero where there is no angle; from the quotient that loses no digits: by cos(theta/2) on a hinge that is more open
/// than a right angle, by sin(theta/2) on the others.
#[inline(always)]
fn half_angle<L: Lane>([x0, x1, x2, x3]: [[L; 4]; 4]) -> (L, L, L) {
    let (x0, e) = (point(x0), point(x1) - point(x0));
    let (n1, n2) = (e.cross(point(x2) - x0), (point(x3) - x0).cross(e));
    let scale = n1.norm() * n2.norm();
    let (zero, one, two) = (scale.zero(), scale.like(1.0), scale.like(2.0));
    let sin = scale.positive(n1.cross(n2).dot(e) / e.norm() / scale, zero);
    let cos = scale.positive(n1.dot(n2) / scale, one);
    let open = ((one + cos) * scale.like(0.5)).sqrt();
    let folded = ((one - cos) * two).sqrt();
    let folded = sin.positive(folded, -folded);
    (cos.positive(sin / open, folded), cos.positive(open, sin / folded), scale)
}

impl Element<4, 1, 1> for Hinge {
    const NAME: &'static str = "hinge";
    #[inline(always)]
    fn residual<L: Lane>([r0]: [L; 1], x: [[L; 4]; 4]) -> [L; 1] {
        let (twice_sin, _, scale) = half_angle(x);
        [scale.positive(twice_sin - r0, scale.zero())]
    }
    #[inline(always)]
    fn pullback<L: Lane>(_: [L; 1], x: [[L; 4]; 4], [y]: [L; 1]) -> [[L; 4]; 4] {
        // dr = cos(theta/2) dtheta
        let (_, cos, scale) = half_angle(x);
        let y = scale.positive(y * cos, scale.zero());
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_precision_is_enough_from_micrometres_to_kilometres() {
        for size in [1e-6_f32, 1.0, 1e5].map(|s| s as crate::math::Real) {
            let x =
                [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.4, 0.0], [0.8, 0.6, 0.6]].map(|[x, y, z]| [x * size, y * size, z * size, 0.0]);
            let [r] = Hinge::residual([0.0], x);
            // The angle whose sine is 0.6 and whose cosine is 0.8.
            assert!((r.abs() - 2.0 * ((1.0 - 0.8) / 2.0 as crate::math::Real).sqrt()).abs() < 1e-5, "{size}: {r}");
        }
    }

    #[test]
    fn the_two_sides_of_a_fold_differ_in_sign() {
        for theta in [0.5_f64, 1.2, 2.0, 3.0] {
            let r = |theta: f64| {
                let x = [[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [-1.0, 0.7, 0.0], [theta.cos(), 1.1, -theta.sin()]];
                Hinge::residual([0.0], x.map(|[x, y, z]| [x as crate::math::Real, y as crate::math::Real, z as crate::math::Real, 0.0]))[0]
            };
            let exact = 2.0 * (theta / 2.0).sin();
            assert!((f64::from(r(theta).abs()) - exact).abs() < 1e-5 && r(-theta) == -r(theta), "{theta}: {} {}", r(theta), r(-theta));
            assert!(r(theta) * r(0.1) > 0.0, "{theta}");
        }
    }
}
