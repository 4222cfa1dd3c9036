//! Contact of a point with a plane.

use super::{Element, force, point};
use crate::math::{Lane, Vec3};

/// The unilateral penalty of a point behind the plane n . x = d:
///
///   r = max(0, d - n . x)                                            (contact.1)
///
/// x [m]   n unit vector out of the solid   d [m]   k [N/m].   Rest: n (3), d.
pub struct PointPlane;

impl Element<1, 1, 4> for PointPlane {
    const NAME: &'static str = "contact";
    #[inline(always)]
    fn residual<L: Lane>([nx, ny, nz, d]: [L; 4], [x]: [[L; 4]; 1]) -> [L; 1] {
        [(d - Vec3 { x: nx, y: ny, z: nz }.dot(point(x))).above_zero()]
    }
    #[inline(always)]
    fn pullback<L: Lane>(rest: [L; 4], x: [[L; 4]; 1], [y]: [L; 1]) -> [[L; 4]; 1] {
        let [r] = Self::residual(rest, x);
        let [nx, ny, nz, _] = rest;
        [force(Vec3 { x: nx, y: ny, z: nz } * r.positive(-y, y.zero()))]
    }
}
