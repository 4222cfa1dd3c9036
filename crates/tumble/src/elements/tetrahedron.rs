//! The stable Neo-Hookean solid on tetrahedra, as two laws over the same four points. With F = [x1-x0, x2-x0, x3-x0] B
//! and B the inverse of the rest matrix:
//!
//!   E = V (mu/2 |F|² + lambda/2 (det F - 1 - mu/lambda)²)            (solids.1)
//!
//! Small strains see the Lamé constants mu and lambda - mu, so lambda here is the material's plus mu.
//! Both laws are stressed at rest and balance each other. Source: [smith2018], eq. 13, without its log term.

use super::{Element, force, point};
use crate::math::{Lane, Vec3};

/// r = F, nine numbers; k = mu V. Rest: the nine numbers of B, row by row.
pub struct TetShear;

/// r = det F - target; k = lambda V. Rest: B, then target = 1 + mu/lambda.
pub struct TetVolume;

/// r = the Green strain (F^T F - 1)/2: xx, yy, zz and sqrt(2) times xy, yz, zx. As a potential it is the Saint
/// Venant-Kirchhoff solid without its volume term; with no stiffness it damps strain and leaves rotation alone, which the
/// rate of F does not. Rest: B.
pub struct TetStrain;

/// The columns of F.
#[inline(always)]
fn deformation<L: Lane>(b: [L; 9], x: [[L; 4]; 4]) -> [Vec3<L>; 3] {
    let x0 = point(x[0]);
    let (d1, d2, d3) = (point(x[1]) - x0, point(x[2]) - x0, point(x[3]) - x0);
    [d1 * b[0] + d2 * b[3] + d3 * b[6], d1 * b[1] + d2 * b[4] + d3 * b[7], d1 * b[2] + d2 * b[5] + d3 * b[8]]
}

/// Forces on the corners from P = dE/dF, given by columns.
#[inline(always)]
fn corners<L: Lane>(b: [L; 9], p: [Vec3<L>; 3]) -> [[L; 4]; 4] {
    let g1 = p[0] * b[0] + p[1] * b[1] + p[2] * b[2];
    let g2 = p[0] * b[3] + p[1] * b[4] + p[2] * b[5];
    let g3 = p[0] * b[6] + p[1] * b[7] + p[2] * b[8];
    [force(-(g1 + g2 + g3)), force(g1), force(g2), force(g3)]
}

impl Element<4, 9, 9> for TetShear {
    const NAME: &'static str = "tetrahedron shear";
    #[inline(always)]
    fn residual<L: Lane>(b: [L; 9], x: [[L; 4]; 4]) -> [L; 9] {
        let [f1, f2, f3] = deformation(b, x);
        [f1.x, f1.y, f1.z, f2.x, f2.y, f2.z, f3.x, f3.y, f3.z]
    }
    #[inline(always)]
    fn pullback<L: Lane>(b: [L; 9], _: [[L; 4]; 4], y: [L; 9]) -> [[L; 4]; 4] {
        corners(b, [Vec3 { x: y[0], y: y[1], z: y[2] }, Vec3 { x: y[3], y: y[4], z: y[5] }, Vec3 { x: y[6], y: y[7], z: y[8] }])
    }
}

impl Element<4, 1, 10> for TetVolume {
    const NAME: &'static str = "tetrahedron volume";
    #[inline(always)]
    fn residual<L: Lane>(rest: [L; 10], x: [[L; 4]; 4]) -> [L; 1] {
        let [f1, f2, f3] = deformation(matrix(rest), x);
        [f1.cross(f2).dot(f3) - rest[9]]
    }
    #[inline(always)]
    fn pullback<L: Lane>(rest: [L; 10], x: [[L; 4]; 4], [y]: [L; 1]) -> [[L; 4]; 4] {
        let b = matrix(rest);
        let [f1, f2, f3] = deformation(b, x);
        corners(b, [f2.cross(f3) * y, f3.cross(f1) * y, f1.cross(f2) * y])
    }
}

impl Element<4, 6, 9> for TetStrain {
    const NAME: &'static str = "tetrahedron strain";
    #[inline(always)]
    fn residual<L: Lane>(b: [L; 9], x: [[L; 4]; 4]) -> [L; 6] {
        let [f1, f2, f3] = deformation(b, x);
        let (one, half, root) = (b[0].like(1.0), b[0].like(0.5), b[0].like(std::f64::consts::FRAC_1_SQRT_2));
        [
            (f1.norm_sq() - one) * half,
            (f2.norm_sq() - one) * half,
            (f3.norm_sq() - one) * half,
            f1.dot(f2) * root,
            f2.dot(f3) * root,
            f3.dot(f1) * root,
        ]
    }
    #[inline(always)]
    fn pullback<L: Lane>(b: [L; 9], x: [[L; 4]; 4], y: [L; 6]) -> [[L; 4]; 4] {
        let [f1, f2, f3] = deformation(b, x);
        let root = b[0].like(std::f64::consts::FRAC_1_SQRT_2);
        let (a, c, d) = (y[3] * root, y[4] * root, y[5] * root);
        corners(b, [f1 * y[0] + f2 * a + f3 * d, f2 * y[1] + f1 * a + f3 * c, f3 * y[2] + f2 * c + f1 * d])
    }
}

#[inline(always)]
fn matrix<L: Lane>(rest: [L; 10]) -> [L; 9] {
    let mut b = [rest[0]; 9];
    for i in 0..9 {
        b[i] = rest[i];
    }
    b
}

/// B, the inverse of the rest matrix [x1-x0, x2-x0, x3-x0] row by row, and the rest volume [m³], which is negative for
/// an inverted tetrahedron and zero for a flat one (B is then not finite).
pub fn rest_matrix(x: [Vec3<f64>; 4]) -> ([f64; 9], f64) {
    let (a, b, c) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
    let det = a.cross(b).dot(c);
    let rows = [b.cross(c), c.cross(a), a.cross(b)].map(|r| r * (1.0 / det));
    ([rows[0].x, rows[0].y, rows[0].z, rows[1].x, rows[1].y, rows[1].z, rows[2].x, rows[2].y, rows[2].z], det / 6.0)
}
