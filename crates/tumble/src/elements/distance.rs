//! Springs along a line.

use super::{Element, force, point};
use crate::math::{Lane, Vec3};

/// The spring of rest length l:
///
///   r = |x1 - x0| - l                                                (springs.2)
///
/// x [m]   l [m]   k [N/m].   Degenerate: x0 = x1 -> no direction, no force.
pub struct Distance;

impl Element<2, 1, 1> for Distance {
    const NAME: &'static str = "distance";
    const LENGTH: Option<usize> = Some(0);
    #[inline(always)]
    fn way<L: Lane>([x0, x1]: [[L; 4]; 2]) -> Option<Vec3<L>> {
        Some(point(x1) - point(x0))
    }
    #[inline(always)]
    fn residual<L: Lane>([l]: [L; 1], [x0, x1]: [[L; 4]; 2]) -> [L; 1] {
        [(point(x1) - point(x0)).norm() - l]
    }
    #[inline(always)]
    fn pullback<L: Lane>(_: [L; 1], [x0, x1]: [[L; 4]; 2], [y]: [L; 1]) -> [[L; 4]; 2] {
        let d = point(x1) - point(x0);
        let n = d.norm();
        let g = d * n.positive(y / n, n.zero());
        [force(-g), force(g)]
    }
}

/// A tether: slack up to the length l, a spring beyond it:
///
///   r = max(0, |x1 - x0| - l)                                        (springs.7)
///
/// Projected rigidly it is the position clamp on over-stretched springs.
pub struct Limit;

impl Element<2, 1, 1> for Limit {
    const NAME: &'static str = "limit";
    #[inline(always)]
    fn residual<L: Lane>(rest: [L; 1], x: [[L; 4]; 2]) -> [L; 1] {
        let [r] = Distance::residual(rest, x);
        [r.above_zero()]
    }
    #[inline(always)]
    fn pullback<L: Lane>(rest: [L; 1], x: [[L; 4]; 2], [y]: [L; 1]) -> [[L; 4]; 2] {
        let [r] = Distance::residual(rest, x);
        Distance::pullback(rest, x, [r.positive(y, y.zero())])
    }
}
