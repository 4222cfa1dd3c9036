//! Cosserat rods: points joined by segments, each with an orientation frame whose third axis follows the segment.
//! Source: [kugelstadt2016], with the strains taken in the frame so that shear and stretch, bend and twist may differ.

use super::{Element, force, point};
use crate::math::{Lane, Quat};

/// Stretch and shear of a segment x0 x1 with frame q:
///
///   r = S (R(q)^T (x1 - x0)/l - e_z),  S = diag(s, s, 1)             (rods.1)
///
/// x [m]   l [m]   k = E A l [N m]   s² = (k G A)/(E A).   Rest: l, s.
pub struct StretchShear;

impl Element<3, 3, 2> for StretchShear {
    const NAME: &'static str = "rod stretch";
    const FRAMES: usize = 1;
    #[inline(always)]
    fn residual<L: Lane>([l, s]: [L; 2], [x0, x1, q]: [[L; 4]; 3]) -> [L; 3] {
        let d = (point(x1) - point(x0)) * (l.like(1.0) / l);
        let local = Quat::from_row(q).conj().turn(d);
        [local.x * s, local.y * s, local.z - l.like(1.0)]
    }
    #[inline(always)]
    fn pullback<L: Lane>([l, s]: [L; 2], [x0, x1, q]: [[L; 4]; 3], [a, b, c]: [L; 3]) -> [[L; 4]; 3] {
        let q = Quat::from_row(q);
        let y = crate::math::Vec3 { x: a * s, y: b * s, z: c };
        let world = q.turn(y) * (l.like(1.0) / l);
        // d(q* d q)/dq: the derivative of y . (q* d q) by the four numbers of q is 2 d q y*, written out.
        let d = (point(x1) - point(x0)) * (l.like(2.0) / l);
        let g = Quat::pure(d) * q * Quat::pure(-y);
        [force(-world), force(world), g.row()]
    }
    #[inline(always)]
    fn lengthening<L: Lane>([l, _]: [L; 2], [x0, x1, _]: [[L; 4]; 3]) -> Option<L> {
        Some((point(x1) - point(x0)).norm() / l - l.like(1.0))
    }
}

/// Bend and twist between the frames q0 and q1 of neighbouring segments:
///
///   r = S (2/l Im(q0* q1) - kappa0),  S = diag(1, b, s)              (rods.2)
///
/// l [m] distance of the segments' middles   kappa0 [1/m]   k = E I_1 l [N m³]   b² = I_2/I_1   s² = (G J)/(E I_1).
/// I_1 is for bending about the frame's e_x, I_2 about its e_y. Rest: 2/l, kappa0 (3), b, s. The nearer of q1 and -q1 is meant.
pub struct BendTwist;

impl Element<2, 3, 6> for BendTwist {
    const NAME: &'static str = "rod bend";
    const FRAMES: usize = 2;
    #[inline(always)]
    fn residual<L: Lane>([c, k1, k2, k3, side, s]: [L; 6], [q0, q1]: [[L; 4]; 2]) -> [L; 3] {
        let turn = Quat::from_row(q0).conj() * Quat::from_row(q1);
        let c = turn.w.positive(c, -c);
        [turn.v.x * c - k1, (turn.v.y * c - k2) * side, (turn.v.z * c - k3) * s]
    }
    #[inline(always)]
    fn pullback<L: Lane>([c, _, _, _, side, s]: [L; 6], [q0, q1]: [[L; 4]; 2], [a, b, d]: [L; 3]) -> [[L; 4]; 2] {
        let (q0, q1) = (Quat::from_row(q0), Quat::from_row(q1));
        let c = (q0.conj() * q1).w.positive(c, -c);
        let y = Quat::pure(crate::math::Vec3 { x: a * c, y: b * side * c, z: d * s * c });
        // y . Im(q0* q1): by q1 it is q0 y, by q0 it is q1 y*.
        [(q1 * y.conj()).row(), (q0 * y).row()]
    }
}
