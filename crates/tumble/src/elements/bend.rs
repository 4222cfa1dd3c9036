//! Bending of a triangle, by its folds against the triangles beside it.

use super::{Element, force, point};
use crate::math::{Lane, Vec3};

/// Bending of one triangle, x0 x1 x2 counter-clockwise, with the triangles beside it: x3 lies across the edge x0 x1, x4 across x1 x2, x5 across
/// x2 x0; where nothing does, the node is that with which the edge begins. Their folds give its curvature, as three edges determine a quadratic surface:
///
///   t_i = 2 sin(theta_i/2) - t0_i,   r = L t,   L^T L = A G^T D G/B,   G t = (kxx, kyy, kxy)     (bending.1, bending.6)
///
/// ```text
///         x5---x2---x4       theta_i is the angle between the normals of both sides of an edge, 0 when flat.
///           \ /  \ /
///           x0----x1
///             \  /
///              x3
/// ```
/// x [m]   L [1]   k = B [N m].   A is the area at rest.   Rest: L by rows, a column for each edge, zero where it has no neighbour; t0.
/// No trigonometry, smooth through flat, and bounded: |t + t0| <= 2.
/// Degenerate: folded onto itself (theta = pi) the side of a fold, and with it the sign of t + t0, is anyone's guess. A triangle without area
/// or an edge without length has no normal and folds nothing.
/// Source: [bridson2003] for the gradient of theta, [grinspun2006] for the quadratic surface. Differs: angles instead of heights, so that neither
/// stretch nor a rest shape that is not flat counts as bending.
pub struct Bending;

impl Bending {
    /// The numbers of one fold alone, over the edge x0 x1 of nodes 0, 1, 2, 3, 1, 2, and its t0: r = t.
    pub fn fold(rest: f64) -> [f64; 12] {
        let mut numbers = [0.0; 12];
        (numbers[0], numbers[9]) = (1.0, rest);
        numbers
    }

    /// t0 of the fold over the edge x0 x1 with x2 and x3 across it.
    pub fn angle(x: [[f64; 3]; 4]) -> f64 {
        let [a, b, c, d] = x.map(|[x, y, z]| [x, y, z, 0.0]);
        folds(&[0.0; 12], &[a, b, c, d, b, c])[0]
    }
}

/// 2 sin(theta/2), cos(theta/2) and |n1||n2|, which is zero where there is no angle, for normals on both sides of the edge e; from the quotient
/// that loses no digits: by cos(theta/2) on a fold that is more open than a right angle, by sin(theta/2) on the others.
#[inline(always)]
fn half_angle<L: Lane>(n1: Vec3<L>, n2: Vec3<L>, e: Vec3<L>) -> (L, L, L) {
    let scale = n1.norm() * n2.norm();
    let (zero, one, two) = (scale.zero(), scale.like(1.0), scale.like(2.0));
    let sin = scale.positive(n1.cross(n2).dot(e) / e.norm() / scale, zero);
    let cos = scale.positive(n1.dot(n2) / scale, one);
    let open = ((one + cos) * scale.like(0.5)).sqrt();
    let folded = ((one - cos) * two).sqrt();
    let folded = sin.positive(folded, -folded);
    (cos.positive(sin / open, folded), cos.positive(open, sin / folded), scale)
}

/// The normal of a triangle, of length twice its area.
#[inline(always)]
fn normal<L: Lane>(x: &[[L; 4]; 6]) -> Vec3<L> {
    (point(x[1]) - point(x[0])).cross(point(x[2]) - point(x[0]))
}

/// t of each edge; 0 where there is no neighbour.
#[inline(always)]
pub(super) fn folds<L: Lane, const D: usize>(rest: &[L; D], x: &[[L; 4]; 6]) -> [L; 3] {
    let n1 = normal(x);
    let mut t = [n1.x.zero(); 3];
    for i in 0..3 {
        let x0 = point(x[i]);
        let e = point(x[(i + 1) % 3]) - x0;
        let (twice_sin, _, scale) = half_angle(n1, (point(x[3 + i]) - x0).cross(e), e);
        t[i] = scale.positive(twice_sin - rest[9 + i], t[i]);
    }
    t
}

/// The sum of z_i grad t_i.                                                             (bending.2 to bending.5)
#[inline(always)]
pub(super) fn spread<L: Lane>(x: &[[L; 4]; 6], z: [L; 3]) -> [[L; 4]; 6] {
    let n1 = normal(x);
    let zero = n1.x.zero();
    let a1 = n1.norm_sq();
    let mut sums = [Vec3 { x: zero, y: zero, z: zero }; 6];
    for i in 0..3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let [x0, x1, x2, x3] = [point(x[i]), point(x[j]), point(x[k]), point(x[3 + i])];
        let e = x1 - x0;
        let n2 = (x3 - x0).cross(e);
        let (_, cos, scale) = half_angle(n1, n2, e);
        // dt = cos(theta/2) dtheta
        let y = scale.positive(z[i] * cos, zero);
        let (length, a2) = (e.norm(), n2.norm_sq());
        let m1 = n1 * a1.positive(y / a1, zero);
        let m2 = n2 * a2.positive(y / a2, zero);
        let unit = e * length.positive(length.like(1.0) / length, zero);
        sums[i] = sums[i] + m1 * (x1 - x2).dot(unit) + m2 * (x1 - x3).dot(unit);
        sums[j] = sums[j] + m1 * (x2 - x0).dot(unit) + m2 * (x3 - x0).dot(unit);
        sums[k] = sums[k] - m1 * length;
        sums[3 + i] = -(m2 * length);
    }
    let mut g = [[zero; 4]; 6];
    for i in 0..6 {
        g[i] = force(sums[i]);
    }
    g
}

/// L t.
#[inline(always)]
pub(super) fn product<L: Lane, const D: usize>(rest: &[L; D], t: [L; 3]) -> [L; 3] {
    let mut r = t;
    for m in 0..3 {
        r[m] = rest[3 * m] * t[0] + rest[3 * m + 1] * t[1] + rest[3 * m + 2] * t[2];
    }
    r
}

/// L^T y.
#[inline(always)]
pub(super) fn transposed<L: Lane, const D: usize>(rest: &[L; D], y: [L; 3]) -> [L; 3] {
    let mut z = y;
    for i in 0..3 {
        z[i] = rest[i] * y[0] + rest[3 + i] * y[1] + rest[6 + i] * y[2];
    }
    z
}

impl Element<6, 3, 12> for Bending {
    const NAME: &'static str = "hinge";
    #[inline(always)]
    fn residual<L: Lane>(rest: [L; 12], x: [[L; 4]; 6]) -> [L; 3] {
        product(&rest, folds(&rest, &x))
    }
    #[inline(always)]
    fn pullback<L: Lane>(rest: [L; 12], x: [[L; 4]; 6], y: [L; 3]) -> [[L; 4]; 6] {
        spread(&x, transposed(&rest, y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Real;

    fn angle(x: [[f64; 3]; 4], size: f64) -> Real {
        let [a, b, c, d] = x.map(|x| [x[0] * size, x[1] * size, x[2] * size, 0.0].map(|x| x as Real));
        folds(&[0.0; 12], &[a, b, c, d, b, c])[0]
    }

    #[test]
    fn single_precision_is_enough_from_micrometres_to_kilometres() {
        let x = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.4, 0.0], [0.8, 0.6, 0.6]];
        for size in [1e-6, 1.0, 1e5] {
            // The angle whose sine is 0.6 and whose cosine is 0.8.
            let t = angle(x, size);
            assert!((t.abs() - 2.0 * ((1.0 - 0.8) / 2.0 as Real).sqrt()).abs() < 1e-5, "{size}: {t}");
        }
    }

    #[test]
    fn the_two_sides_of_a_fold_differ_in_sign() {
        for theta in [0.5_f64, 1.2, 2.0, 3.0] {
            let t = |theta: f64| angle([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [-1.0, 0.7, 0.0], [theta.cos(), 1.1, -theta.sin()]], 1.0);
            let exact = 2.0 * (theta / 2.0).sin();
            assert!((f64::from(t(theta).abs()) - exact).abs() < 1e-5 && t(-theta) == -t(theta), "{theta}: {} {}", t(theta), t(-theta));
            assert!(t(theta) * t(0.1) > 0.0, "{theta}");
        }
    }
}
