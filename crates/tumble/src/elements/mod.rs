//! L3: elastic laws over a few nodes. An element is two pure functions, `residual` r(x) and `pullback` J(x)^T y
//! with J = dr/dx; energy, force, internal damping, Hessian products and the position-based projection are derived
//! from them here, once, for every element.
//!
//!   E = k/2 |r|²,   f = -J^T (k r + b J v)                            (elements.1, elements.2)
//!
//! A node is a point [x, y, z, -] or a frame (unit quaternion). What moves a frame is a rotation vector in the frame's
//! own axes, so velocities, forces and products hold three numbers per node: velocity or angular velocity, force or torque.
//! Verified in `tests/elements.rs`: force = -dE/dx, exact Hessian, symmetry, zero net force and torque.

mod batch;
mod bend;
mod constraints;
mod contact;
mod distance;
mod driven;
mod isometric;
mod law;
mod list;
mod long_range_attachments;
mod membrane;
mod neighbours;
mod pairs;
mod rod;
mod tetrahedron;
mod vector;
mod woven;

pub use crate::linalg::blocks::Block;
pub use batch::{Batch, Elements, Incidence};
pub use bend::Bending;
pub use constraints::{
    Constraints, Density, Frozen, HELD, Neohookean, Projected, Projection, Samples, Shape, Strands, Volume, behind, enclosed, spline,
};
pub use contact::PointPlane;
pub use distance::{Distance, Limit};
pub use driven::{Driven, DrivenSpring};
pub use isometric::IsometricBend;
pub use law::{Law, Linear, Nonlinear};
pub use list::{Members, Weights};
pub use long_range_attachments::LongRangeAttachments;
pub use membrane::{Area, Membrane};
pub use pairs::{Pair, Pairs};
pub use rod::{BendTwist, StretchShear};
pub use tetrahedron::{TetShear, TetStrain, TetVolume, rest_matrix};
pub use vector::Vector;
pub use woven::{Woven, WovenBending, moment};

use crate::math::{Dual, Lane, Quat, Vec3};

/// One elastic law over N nodes with an M-vector as measure and D rest numbers.
pub trait Element<const N: usize, const M: usize, const D: usize>: Send + Sync + 'static {
    /// Name in reports.
    const NAME: &'static str;
    /// How many of the nodes, the last ones, are frames.
    const FRAMES: usize = 0;
    /// Of a link, which of the rest numbers is its length.
    const LENGTH: Option<usize> = None;
    /// Of a link, the way from its first point to its second; the measure is its length less a rest length.
    #[inline(always)]
    fn way<L: Lane>(_x: [[L; 4]; N]) -> Option<Vec3<L>> {
        None
    }
    /// The measure r that the stiffness multiplies.
    fn residual<L: Lane>(rest: [L; D], x: [[L; 4]; N]) -> [L; M];
    /// J(x)^T y: forces on points, and on the four numbers of a frame.
    fn pullback<L: Lane>(rest: [L; D], x: [[L; 4]; N], y: [L; M]) -> [[L; 4]; N];
    /// Of a triangle or a piece of a rod that resists stretch, the largest lengthening of its edges over their rest lengths. Links have
    /// `LENGTH`, or are pairs.
    #[inline(always)]
    fn lengthening<L: Lane>(_rest: [L; D], _x: [[L; 4]; N]) -> Option<L> {
        None
    }
    /// The share of tension in the product of the definite Hessian with u: the part of y d²r/dx² that is never negative. y is the stress.
    #[inline(always)]
    fn tension<L: Lane>(_rest: [L; D], _x: [[L; 4]; N], _y: [L; M], _u: [Vec3<L>; N]) -> Option<[Vec3<L>; N]> {
        None
    }
}

/// The first three numbers of a node.
#[inline(always)]
pub fn point<L: Lane>([x, y, z, _]: [L; 4]) -> Vec3<L> {
    Vec3 { x, y, z }
}

/// A force on a point.
#[inline(always)]
pub fn force<L: Lane>(v: Vec3<L>) -> [L; 4] {
    [v.x, v.y, v.z, v.x.zero()]
}

/// Positions with a direction of motion: points move straight, frames turn.
#[inline(always)]
fn lift<L: Lane, const N: usize>(frames: usize, x: [[L; 4]; N], u: [Vec3<L>; N]) -> [[Dual<L>; 4]; N] {
    let mut out = [[Dual::constant(x[0][0].zero()); 4]; N];
    for i in 0..N {
        let slope = if i < N - frames { force(u[i]) } else { (Quat::from_row(x[i]) * Quat::pure(u[i])).scaled(x[0][0].like(0.5)).row() };
        for c in 0..4 {
            out[i][c] = Dual { re: x[i][c], slope: slope[c] };
        }
    }
    out
}

/// Forces on nodes: on a frame the four numbers become a torque in the frame's own axes.
#[inline(always)]
fn lower<L: Lane, const N: usize>(frames: usize, x: [[L; 4]; N], g: [[L; 4]; N]) -> [Vec3<L>; N] {
    let mut out = [point(g[0]); N];
    for i in 0..N {
        out[i] = if i < N - frames { point(g[i]) } else { (Quat::from_row(x[i]).conj() * Quat::from_row(g[i])).v * x[0][0].like(0.5) };
    }
    out
}

#[inline(always)]
fn constant<L: Lane, const D: usize>(rest: [L; D], any: L) -> [Dual<L>; D] {
    let mut out = [Dual::constant(any); D];
    for i in 0..D {
        out[i] = Dual::constant(rest[i]);
    }
    out
}

/// J u: how fast r changes when the nodes move with u.
#[inline(always)]
pub fn rate<E: Element<N, M, D>, L: Lane, const N: usize, const M: usize, const D: usize>(
    rest: [L; D],
    x: [[L; 4]; N],
    u: [Vec3<L>; N],
) -> [L; M] {
    let r = E::residual(constant(rest, x[0][0]), lift(E::FRAMES, x, u));
    let mut out = [x[0][0]; M];
    for i in 0..M {
        out[i] = r[i].slope;
    }
    out
}

/// The energy.
#[inline(always)]
pub fn energy<E: Element<N, M, D>, Y: Law<P>, L: Lane, const N: usize, const M: usize, const D: usize, const P: usize>(
    k: L,
    law: [L; P],
    rest: [L; D],
    x: [[L; 4]; N],
) -> L {
    let r = E::residual(rest, x);
    let mut sum = k.zero();
    for i in 0..M {
        sum = sum + Y::energy(k, law, r[i]);
    }
    sum
}

/// Forces from the stress and, with velocities, from internal damping b.
#[inline(always)]
pub fn forces<E: Element<N, M, D>, Y: Law<P>, L: Lane, const N: usize, const M: usize, const D: usize, const P: usize>(
    k: L,
    law: [L; P],
    rest: [L; D],
    x: [[L; 4]; N],
    damping: Option<(L, [Vec3<L>; N])>,
) -> [Vec3<L>; N] {
    let r = E::residual(rest, x);
    let mut y = r;
    for i in 0..M {
        y[i] = -Y::stress(k, law, r[i]);
    }
    if let Some((b, v)) = damping {
        let speed = rate::<E, L, N, M, D>(rest, x, v);
        for i in 0..M {
            y[i] = y[i] - b * speed[i];
        }
    }
    lower(E::FRAMES, x, E::pullback(rest, x, y))
}

/// The product of the exact Hessian of the energy with u. On frames it is the second derivative along rotations at
/// constant rate, which is symmetric.
#[inline(always)]
pub fn hessian<E: Element<N, M, D>, Y: Law<P>, L: Lane, const N: usize, const M: usize, const D: usize, const P: usize>(
    k: L,
    law: [L; P],
    rest: [L; D],
    x: [[L; 4]; N],
    u: [Vec3<L>; N],
) -> [Vec3<L>; N] {
    let (rest, lifted) = (constant(rest, k), lift(E::FRAMES, x, u));
    let mut y = E::residual(rest, lifted);
    for i in 0..M {
        y[i] = Y::stress(Dual::constant(k), constant(law, k), y[i]);
    }
    let g = E::pullback(rest, lifted, y);
    let (mut value, mut slope) = (x, x);
    for i in 0..N {
        for c in 0..4 {
            value[i][c] = g[i][c].re;
            slope[i][c] = g[i][c].slope;
        }
    }
    let mut product = lower(E::FRAMES, x, slope);
    // q'' = -|u|²/4 q along a rotation.
    for i in N - E::FRAMES..N {
        let radial = Quat::from_row(x[i]).dot(Quat::from_row(value[i]));
        product[i] = product[i] - u[i] * (radial * radial.like(0.25));
    }
    product
}

/// J^T (c_i (J u)_i): with c = tangent of the law, the Hessian without its indefinite part (Gauss-Newton); with c = b,
/// the matrix of internal damping.
#[inline(always)]
pub fn gauss_newton<E: Element<N, M, D>, L: Lane, const N: usize, const M: usize, const D: usize>(
    c: [L; M],
    rest: [L; D],
    x: [[L; 4]; N],
    u: [Vec3<L>; N],
) -> [Vec3<L>; N] {
    let mut y = rate::<E, L, N, M, D>(rest, x, u);
    for i in 0..M {
        y[i] = y[i] * c[i];
    }
    lower(E::FRAMES, x, E::pullback(rest, x, y))
}

/// The slope of the law at each component of r, negative ones taken as zero.
#[inline(always)]
pub fn tangents<E: Element<N, M, D>, Y: Law<P>, L: Lane, const N: usize, const M: usize, const D: usize, const P: usize>(
    k: L,
    law: [L; P],
    rest: [L; D],
    x: [[L; 4]; N],
) -> [L; M] {
    let mut r = E::residual(rest, x);
    for i in 0..M {
        r[i] = Y::tangent(k, law, r[i]).above_zero();
    }
    r
}

/// Numbers that the projection of an element takes beside its positions.
#[derive(Clone, Copy)]
pub struct Compliance<L> {
    /// 1/((k + b/h) h²), 0 for a rigid element.
    pub alpha: L,
    /// The multiplier so far.
    pub lambda: L,
    /// s = (b/h)/(k + b/h), the share of damping.
    pub share: L,
}

/// One step of the position-based projection. It minimizes along one line, that of the forces, what a step of implicit Euler minimizes:
/// k phi(r) + b/(2h) |r - r_before|² and the kinetic energy. With y = (1 - s) stress(r)/k + s (r - r_before):
///
///   dx_i = w_i g_i dlambda,   dlambda = -(c + alpha lambda) / (t sum_j w_j |g_j|² + alpha),   g = J^T y/|y|, c = |y|  (elements.5)
///
/// and c = y, g = J^T for a measure of one number; t is the slope of y. `w` are inverse masses of points and inverse inertias of frames.
/// Returns the corrections, rotation vectors for frames, and dlambda.
///
/// Source: [macklin2016], eq. 18, 26. Differs: damping is that of the element's own force.
#[inline(always)]
pub fn project<E: Element<N, M, D>, Y: Law<P>, L: Lane, const N: usize, const M: usize, const D: usize, const P: usize>(
    compliance: Compliance<L>,
    law: [L; P],
    rest: [L; D],
    x: [[L; 4]; N],
    before: Option<[[L; 4]; N]>,
    w: [L; N],
) -> ([Vec3<L>; N], L) {
    let Compliance { alpha, lambda, share } = compliance;
    let one = alpha.like(1.0);
    let r = E::residual(rest, x);
    let mut y = r;
    for i in 0..M {
        y[i] = Y::stress(one, law, r[i]);
    }
    if let Some(before) = before {
        let r_before = E::residual(rest, before);
        for i in 0..M {
            y[i] = (one - share) * y[i] + share * (r[i] - r_before[i]);
        }
    }
    let (mut c, mut slope) = (y[0], one);
    if M == 1 {
        slope = Y::tangent(one, law, r[0]);
        if before.is_some() {
            slope = (one - share) * slope + share;
        }
        y[0] = one;
    } else {
        let mut norm_sq = alpha.zero();
        for i in 0..M {
            norm_sq = norm_sq + y[i] * y[i];
        }
        c = norm_sq.sqrt();
        for i in 0..M {
            y[i] = c.positive(y[i] / c, c.zero());
        }
    }
    if let Some(way) = E::way(x) {
        // Both g are of length 1: one quotient does for the direction and for dlambda.
        let length = way.norm();
        let weight = (slope * (w[0] + w[1]) + alpha) * length;
        let part = weight.positive(-(c + alpha * lambda) / weight, c.zero());
        let mut out = [-way * (w[0] * part); N];
        out[1] = way * (w[1] * part);
        return (out, part * length);
    }
    let g = lower(E::FRAMES, x, E::pullback(rest, x, y));
    let mut weight = alpha.zero();
    for i in 0..N {
        weight = weight + w[i] * g[i].norm_sq();
    }
    weight = slope * weight + alpha;
    let delta = weight.positive(-(c + alpha * lambda) / weight, c.zero());
    let mut out = g;
    for i in 0..N {
        out[i] = g[i] * (w[i] * delta);
    }
    (out, delta)
}

/// Nodes after a correction: points move, frames turn.
#[inline(always)]
pub fn corrected<L: Lane, const N: usize>(frames: usize, x: [[L; 4]; N], d: [Vec3<L>; N]) -> [[L; 4]; N] {
    let mut out = x;
    for i in 0..N {
        if i < N - frames {
            out[i] = [x[i][0] + d[i].x, x[i][1] + d[i].y, x[i][2] + d[i].z, x[i][3]];
        } else {
            let q = Quat::from_row(x[i]);
            out[i] = (q + (q * Quat::pure(d[i])).scaled(x[i][0].like(0.5))).normalized().row();
        }
    }
    out
}
