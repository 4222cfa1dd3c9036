//! The spring of rest length zero.

use super::{Element, force, point};
use crate::math::Lane;

/// The lecture's first spring, f = k (b - a):
///
///   r = x1 - x0                                                      (springs.1)
///
/// x [m]   k [N/m].   Linear, so its Hessian k is exact and never indefinite; no degenerate case.
pub struct Vector;

impl Element<2, 3, 0> for Vector {
    const NAME: &'static str = "vector";
    #[inline(always)]
    fn residual<L: Lane>(_: [L; 0], [x0, x1]: [[L; 4]; 2]) -> [L; 3] {
        (point(x1) - point(x0)).into()
    }
    #[inline(always)]
    fn pullback<L: Lane>(_: [L; 0], _: [[L; 4]; 2], y: [L; 3]) -> [[L; 4]; 2] {
        [force(-crate::math::Vec3::from(y)), force(y.into())]
    }
}
