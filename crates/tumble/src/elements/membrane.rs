//! Triangles that resist stretch.

use super::{Element, force, point};
use crate::geometry::Vector;
use crate::math::{Lane, Vec3};

/// The orthotropic membrane. F = [x1-x0, x2-x0] B, with columns f1 along the warp and f2 along the weft, and B the inverse of the rest edges in
/// these axes; e the Green strain and C = L L^T the elastic matrix of (membranes.3):
///
///   e = ((|f1|² - 1)/2, (|f2|² - 1)/2, f1 . f2),   r = L^T e         (membranes.1)
///
/// x [m]   L [(N/m)^(1/2)]   k = rest area [m²], so that E = k/2 e^T C e.   Rest: B row by row, then L11, L21, L22, L33.
/// The Saint Venant-Kirchhoff law. Degenerate: pressed to a point a triangle exerts no force.
pub struct Membrane;

/// How much a triangle's area differs from rest:
///
///   r = |(x1 - x0) x (x2 - x0)|/2 - A0                               (membranes.6)
///
/// x [m]   A0 [m²]   k [N/m³].   Degenerate: without area there is no direction, no force.
pub struct Area;

impl Membrane {
    /// The inverse B of the rest edges in the axes warp and weft, row by row, and the area [m²]; `None` without area.
    pub fn axes(x: [Vector; 3], warp: Vector, angle: f64) -> Option<([f64; 4], f64)> {
        let (d1, d2) = (x[1] - x[0], x[2] - x[0]);
        let (u, v) = Self::grain(x, warp, angle);
        let ([a, b], [c, d]) = ([d1.dot(u), d2.dot(u)], [d1.dot(v), d2.dot(v)]);
        let det = a * d - b * c;
        let inverse = [d / det, -b / det, -c / det, a / det];
        (inverse.iter().all(|b| b.is_finite()) && det > 0.0).then_some((inverse, 0.5 * det))
    }

    /// Rest lengths of the edges from x0 to x1, from x0 to x2 and from x1 to x2, from B.
    pub fn lengths([b0, b1, b2, b3]: [f64; 4]) -> [f64; 3] {
        let det = (b0 * b3 - b1 * b2).abs();
        [[b3, b2], [b1, b0], [b1 + b3, b0 + b2]].map(|[u, v]| (u * u + v * v).sqrt() / det)
    }

    /// Directions of warp and weft in a triangle. `warp` counts as far as it lies in the triangle, or the y axis if none of it does, turned by
    /// `angle` [rad]. Not finite if the triangle has no area.
    pub fn grain(x: [Vector; 3], warp: Vector, angle: f64) -> (Vector, Vector) {
        let normal = (x[1] - x[0]).cross(x[2] - x[0]);
        let n = normal * (1.0 / normal.norm());
        let within = |d: Vector| d - n * d.dot(n);
        let mut u = within(warp);
        if u.norm() < 1e-6 * warp.norm() {
            u = within(Vector { x: 0.0, y: 1.0, z: 0.0 });
        }
        let u = u.normalized();
        let v = n.cross(u);
        let (cos, sin) = (crate::math::functions::cos(angle), crate::math::functions::sin(angle));
        (u * cos + v * sin, v * cos - u * sin)
    }

    /// L11, L21, L22, L33 of a material with the stiffnesses `warp`, `weft` and `shear` [N/m]; `None` if it is not stable.
    pub fn root(warp: f64, weft: f64, poisson: f64, shear: f64) -> Option<[f64; 4]> {
        let bracket = 1.0 - poisson * poisson * weft / warp;
        if bracket.is_nan() || bracket <= 0.0 || !(warp > 0.0 && weft > 0.0 && shear > 0.0) {
            return None;
        }
        let (c11, c12) = (warp / bracket, poisson * weft / bracket);
        let l11 = c11.sqrt();
        // C22 - C12²/C11 = weft.
        Some([l11, c12 / l11, weft.sqrt(), shear.sqrt()])
    }
}

/// f1 and f2.
#[inline(always)]
fn deformation<L: Lane>(rest: [L; 8], x: [[L; 4]; 3]) -> [Vec3<L>; 2] {
    let x0 = point(x[0]);
    let (d1, d2) = (point(x[1]) - x0, point(x[2]) - x0);
    [d1 * rest[0] + d2 * rest[2], d1 * rest[1] + d2 * rest[3]]
}

/// The stress conjugate to the Green strain, L y.
#[inline(always)]
fn stress<L: Lane>(rest: [L; 8], [y1, y2, y3]: [L; 3]) -> [L; 3] {
    [rest[4] * y1, rest[5] * y1 + rest[6] * y2, rest[7] * y3]
}

/// The largest lengthening of an edge over its rest length, from B, whose inverse has the rest edges x1-x0 and x2-x0 as columns.
#[inline(always)]
pub fn edges<L: Lane>([b0, b1, b2, b3]: [L; 4], x: [[L; 4]; 3]) -> L {
    let x0 = point(x[0]);
    let (d1, d2) = (point(x[1]) - x0, point(x[2]) - x0);
    let det = b0 * b3 - b1 * b2;
    let ratio = |way: Vec3<L>, [u, v]: [L; 2]| way.norm() * det / (u * u + v * v).sqrt();
    let larger = |a: L, b: L| (b - a).positive(b, a);
    let most = larger(ratio(d1, [b3, b2]), ratio(d2, [b1, b0]));
    larger(most, ratio(d2 - d1, [b1 + b3, b0 + b2])) - det.like(1.0)
}

/// The product of the Hessian with u as far as it comes from tension, (membranes.10): that of the stress (s11, s22, s12), which belongs to the Green
/// strain, without its negative part.
#[inline(always)]
pub fn taut<L: Lane>([b0, b1, b2, b3]: [L; 4], [s1, s2, s3]: [L; 3], u: [Vec3<L>; 3]) -> [Vec3<L>; 3] {
    let (zero, half) = (b0.zero(), b0.like(0.5));
    let (mean, d) = ((s1 + s2) * half, (s1 - s2) * half);
    let q = (d * d + s3 * s3).sqrt();
    let (p1, p2) = ((mean + q).above_zero(), (mean - q).above_zero());
    let (same, turned) = ((p1 + p2) * half, q.positive((p1 - p2) * half / q, zero));
    let (t1, t2, t3) = (same + turned * d, same - turned * d, turned * s3);
    let (d1, d2) = (u[1] - u[0], u[2] - u[0]);
    let (f1, f2) = (d1 * b0 + d2 * b2, d1 * b1 + d2 * b3);
    let (p1, p2) = (f1 * t1 + f2 * t3, f2 * t2 + f1 * t3);
    let (g1, g2) = (p1 * b0 + p2 * b1, p1 * b2 + p2 * b3);
    [-(g1 + g2), g1, g2]
}

impl Element<3, 3, 8> for Membrane {
    const NAME: &'static str = "membrane";
    #[inline(always)]
    fn lengthening<L: Lane>([b0, b1, b2, b3, ..]: [L; 8], x: [[L; 4]; 3]) -> Option<L> {
        Some(edges([b0, b1, b2, b3], x))
    }
    #[inline(always)]
    fn residual<L: Lane>(rest: [L; 8], x: [[L; 4]; 3]) -> [L; 3] {
        let [f1, f2] = deformation(rest, x);
        let (one, half) = (rest[0].like(1.0), rest[0].like(0.5));
        let (e1, e2) = ((f1.norm_sq() - one) * half, (f2.norm_sq() - one) * half);
        [rest[4] * e1 + rest[5] * e2, rest[6] * e2, rest[7] * f1.dot(f2)]
    }
    #[inline(always)]
    fn tension<L: Lane>(rest: [L; 8], _: [[L; 4]; 3], y: [L; 3], u: [Vec3<L>; 3]) -> Option<[Vec3<L>; 3]> {
        let [b0, b1, b2, b3, ..] = rest;
        Some(taut([b0, b1, b2, b3], stress(rest, y), u))
    }
    #[inline(always)]
    fn pullback<L: Lane>(rest: [L; 8], x: [[L; 4]; 3], [y1, y2, y3]: [L; 3]) -> [[L; 4]; 3] {
        let [f1, f2] = deformation(rest, x);
        let [s1, s2, s3] = stress(rest, [y1, y2, y3]);
        let (p1, p2) = (f1 * s1 + f2 * s3, f2 * s2 + f1 * s3);
        let (g1, g2) = (p1 * rest[0] + p2 * rest[1], p1 * rest[2] + p2 * rest[3]);
        [force(-(g1 + g2)), force(g1), force(g2)]
    }
}

impl Element<3, 1, 1> for Area {
    const NAME: &'static str = "area";
    #[inline(always)]
    fn residual<L: Lane>([rest]: [L; 1], x: [[L; 4]; 3]) -> [L; 1] {
        let x0 = point(x[0]);
        [(point(x[1]) - x0).cross(point(x[2]) - x0).norm() * rest.like(0.5) - rest]
    }
    #[inline(always)]
    fn pullback<L: Lane>(_: [L; 1], x: [[L; 4]; 3], [y]: [L; 1]) -> [[L; 4]; 3] {
        let x0 = point(x[0]);
        let (d1, d2) = (point(x[1]) - x0, point(x[2]) - x0);
        let normal = d1.cross(d2);
        let twice = normal.norm();
        let n = normal * twice.positive(y * y.like(0.5) / twice, y.zero());
        let (g1, g2) = (d2.cross(n), n.cross(d1));
        [force(-(g1 + g2)), force(g1), force(g2)]
    }
}
