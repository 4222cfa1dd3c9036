//! Bending that is quadratic in the positions, for surfaces that hardly stretch.

use super::{Element, force, point};
use crate::geometry::Vector;
use crate::math::Lane;

/// The flat hinge. Edge x0 x1, opposite vertices x2 and x3, as for a fold (bending.1); the K_i are the slopes of its angle where it is flat:
///
///   r = sum_i K_i x_i,   sum_i K_i = 0                               (bending.10)
///
/// x [m]   K [1/m]   k [N m].   Without stretch |r| = 2 sin(theta/2), so that its energy is that of a fold at every angle; its
/// Hessian is constant. Three masses in a row are such a hinge, too: K_1 = 0 (bending.11). Rest: K_1, K_2, K_3.
/// Source: [bergou2006], eq. 3. Differs: the factor, see docs/theory/bending.md.
pub struct IsometricBend;

impl IsometricBend {
    /// K_1, K_2, K_3 from corners at rest, unfolded; `None` if a triangle has no area.
    pub fn rest([x0, x1, x2, x3]: [Vector; 4]) -> Option<[f64; 3]> {
        let e = x1 - x0;
        let length = e.norm();
        // Height over the edge, and where its foot is, from x0 to x1.
        let wing = |x: Vector| (e.cross(x - x0).norm() / length, (x - x0).dot(e) / (length * length));
        let ((h2, t2), (h3, t3)) = (wing(x2), wing(x3));
        let k = [t2 / h2 + t3 / h3, -1.0 / h2, -1.0 / h3];
        k.iter().all(|k| k.is_finite()).then_some(k)
    }
}

impl Element<4, 3, 3> for IsometricBend {
    const NAME: &'static str = "isometric bend";
    #[inline(always)]
    fn residual<L: Lane>([k1, k2, k3]: [L; 3], x: [[L; 4]; 4]) -> [L; 3] {
        // From differences, so that nothing is lost far from the origin.
        let x0 = point(x[0]);
        let r = (point(x[1]) - x0) * k1 + (point(x[2]) - x0) * k2 + (point(x[3]) - x0) * k3;
        [r.x, r.y, r.z]
    }
    #[inline(always)]
    fn pullback<L: Lane>([k1, k2, k3]: [L; 3], _: [[L; 4]; 4], [x, y, z]: [L; 3]) -> [[L; 4]; 4] {
        let y = crate::math::Vec3 { x, y, z };
        let (g1, g2, g3) = (y * k1, y * k2, y * k3);
        [force(-(g1 + g2 + g3)), force(g1), force(g2), force(g3)]
    }
}
