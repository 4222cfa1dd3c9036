//! Triangles of measured cloth, whose stiffness changes with direction, strain and curvature.

use super::bend::{folds, product, spread, transposed};
use super::membrane::{edges, taut};
use super::{Element, force, point};
use crate::math::{Lane, Vec3};
use tumble_interface::Fabric;

/// Largest Green strain up to which stretch is measured: the stretch 7/6.
const MOST_STRAIN: f64 = 13.0 / 72.0;
/// Strains below this count as none.
const NO_STRAIN: f64 = 1e-12;
/// The mean of the weight v over the way to that strain, (fabrics.5).
const MEAN_AT_MOST: f64 = 114.8 / 169.0;

/// The stretch of a measured fabric. F and e as for the membrane; C, the elastic matrix, is no constant:
///
///   r = L(e)^T e,   L L^T = C(e) = C0 + m(e) (Ca(e) - C0)            (fabrics.3)
///
/// with C0 at small strain, Ca for the direction of the largest stretch and m the mean over the way of the weight that the record gives it, so
/// that the work along a straight way from rest is exactly that of the record.
/// x [m]   L [(N/m)^(1/2)]   k = rest area [m²].   Rest: B row by row, C0, the differences of the five directions from what is before them; each
/// as 2 C11, 2 C12, 2 C22, C33/2.
/// Source: [wang2011]; as read by [narain2012]. Differs: there the stress is C(e) e, which has no potential.
/// Degenerate: where the smaller stretch is a stretch, too, directions fade; unstrained m = 0.
pub struct Woven;

/// The bending of a triangle of a measured fabric, with folds and nodes as in `Bending`. kappa = G t is its curvature (kuu, kvv, kuv) in the
/// axes of the threads, in samples 10/m apart:
///
///   r_i = sqrt(D_i(s)) kappa_i,   s² = kuu² + kvv² + 2 kuv²,   D = (B90, B0, 4 B45 - B0 - B90)        (fabrics.8)
///
/// with B the mean over the way from rest of the b of the record, so that the energy is the work of its moments (fabrics.9); b is linear between
/// samples, constant beyond, and such that moments do not fall (fabrics.10).
/// x [m]   k = rest area times (10/m)².   Rest: G by rows, t0; for creases along the weft, at 45 degrees, along the warp the row of `samples`.
/// Source: [wang2011].   Degenerate: where 4 B45 is below B0 + B90, which no plate has, twist resists by `LEAST` B45.
pub struct WovenBending;

/// Resistance to twist of a record without any, relative to that at 45 degrees.
const LEAST: f64 = 0.05;

impl Woven {
    /// The rest numbers from B and a record.
    pub fn rest(b: [f64; 4], fabric: &Fabric, thicken: f64) -> [f64; 28] {
        let row = |i: usize| {
            let c = fabric.stretching[i].map(|c| c.max(0.0) * thicken);
            [2.0 * c[0], 2.0 * c[1], 2.0 * c[2], 0.5 * c[3]]
        };
        let mut rest = [0.0; 28];
        rest[..4].copy_from_slice(&b);
        let mut before = [0.0; 4];
        for i in 0..6 {
            for (c, (value, old)) in row(i).into_iter().zip(before).enumerate() {
                rest[4 + 4 * i + c] = value - old;
            }
            before = row(i);
        }
        rest
    }
}

impl WovenBending {
    /// Samples are this far apart [1/m].
    pub const SAMPLE: f64 = 10.0;

    /// D without curvature [N m], for these rows.
    pub fn flat(rows: &[[f64; 8]; 3]) -> [f64; 3] {
        let root = stiffness(rows, 0.0).0;
        root.map(|root| root * root)
    }

    /// The numbers of a row of the record for five samples [N m]: b at 0, 1, 2, 3; slope and curvature of the moment from 3 to k4, which is 4 or the
    /// end of a constant moment; k4; b beyond. `None` if the first sample is not > 0.
    pub fn samples(samples: [f64; 5]) -> Option<[f64; 8]> {
        if samples[0].is_nan() || samples[0] <= 0.0 {
            return None;
        }
        let mut b = samples.map(|b| b.max(1e-6 * samples[0]));
        // The slope of the moment at the end of a piece is b + kappa b'.
        for i in 0..3 {
            let i_ = i as f64;
            b[i + 1] = b[i + 1].max(b[i] * (i_ + 1.0) / (i_ + 2.0));
        }
        let (t1, t2, k4) = if b[4] < 0.8 * b[3] { (0.0, 0.0, 3.0 * b[3] / b[4]) } else { (b[3] + 3.0 * (b[4] - b[3]), b[4] - b[3], 4.0) };
        Some([b[0], b[1], b[2], b[3], t1, t2, k4, b[4]])
    }
}

#[inline(always)]
fn least<L: Lane>(a: L, b: L) -> L {
    (b - a).positive(a, b)
}

/// f1 and f2.
#[inline(always)]
fn deformation<L: Lane>(rest: &[L; 28], x: [[L; 4]; 3]) -> [Vec3<L>; 2] {
    let x0 = point(x[0]);
    let (d1, d2) = (point(x[1]) - x0, point(x[2]) - x0);
    [d1 * rest[0] + d2 * rest[2], d1 * rest[1] + d2 * rest[3]]
}

#[inline(always)]
fn strain<L: Lane>([f1, f2]: [Vec3<L>; 2]) -> [L; 3] {
    let (one, half) = (f1.x.like(1.0), f1.x.like(0.5));
    [(f1.norm_sq() - one) * half, (f2.norm_sq() - one) * half, f1.dot(f2)]
}

/// The part of the strain on which the coefficients depend: the weight m and the direction c, with their slopes.
struct Place<L> {
    m: L,
    c: L,
    dm: [L; 3],
    dc: [L; 3],
}

/// g1 >= g2 are the principal strains; c is the cosine of twice the angle between warp and the direction of g1, times 1 - (g2/g1)² where both
/// are stretched.                                                       (fabrics.4, fabrics.5, fabrics.6)
#[inline(always)]
fn place<L: Lane>([e1, e2, e3]: [L; 3]) -> Place<L> {
    let (zero, one, two, half) = (e1.zero(), e1.like(1.0), e1.like(2.0), e1.like(0.5));
    let (d, sum) = (e1 - e2, e1 + e2);
    let q = (d * d + e3 * e3).sqrt();
    let (g1, g2) = ((sum + q) * half, (sum - q) * half);
    // A strain far below rounding counts as none: its inverse squared would be beyond single precision.
    let counts = |strain: L| strain - e1.like(NO_STRAIN);
    let (cos, sin) = (counts(q).positive(d / q, zero), counts(q).positive(e3 / q, zero));
    let dg1 = [(one + cos) * half, (one - cos) * half, sin * half];
    let most = e1.like(MOST_STRAIN);
    let g = g1.above_zero();
    let inner = least(g, most);
    let t = two * inner / (one + (one + two * inner).sqrt());
    let half_way = one + t * half;
    let inside = e1.like(6.0) * t * (e1.like(2.0 / 3.0) + t * (e1.like(0.75) + t * e1.like(0.2))) / (half_way * half_way);
    let far = most / g;
    let m = (g - most).positive(one - far * far * e1.like(1.0 - MEAN_AT_MOST), inside);
    let v = (g - most).positive(one, e1.like(6.0) * t);
    let slope = counts(g).positive(two * (v - m) / g, zero);
    // c = w d, with w = 1/q or, where both are stretched, (g1 + g2)/g1².
    let w = counts(g2).positive(sum / (g1 * g1), counts(q).positive(one / q, zero));
    let wq = counts(g2).positive(zero, -(w * w));
    let (ws, wg) = (counts(g2).positive(one / (g1 * g1), zero), counts(g2).positive(-(two * w) / g1, zero));
    let dw = |sum: L, dq: L, dg: L| ws * sum + wq * dq + wg * dg;
    let dc = [w + d * dw(one, cos, dg1[0]), d * dw(one, -cos, dg1[1]) - w, d * dw(zero, sin, dg1[2])];
    Place { m, c: w * d, dm: [slope * dg1[0], slope * dg1[1], slope * dg1[2]], dc }
}

/// Coefficients of the direction c less those of small strain, and their slopes: from one measured direction to the next by a smooth step in c.
///                                                                      (fabrics.7)
#[inline(always)]
fn direction<L: Lane>(rest: &[L; 28], c: L) -> ([L; 4], [L; 4]) {
    let (zero, one) = (c.zero(), c.like(1.0));
    let (mut value, mut slope) = ([rest[8], rest[9], rest[10], rest[11]], [zero; 4]);
    let root = std::f64::consts::FRAC_1_SQRT_2;
    for (k, (from, width)) in [(1.0, 1.0 - root), (root, root), (0.0, root), (-root, 1.0 - root)].into_iter().enumerate() {
        let inverse = c.like(1.0 / width);
        let u = least(((c.like(from) - c) * inverse).above_zero(), one);
        let step = u * u * (c.like(3.0) - (u + u));
        let rate = -(c.like(6.0) * u * (one - u) * inverse);
        for i in 0..4 {
            let difference = rest[12 + 4 * k + i];
            value[i] = value[i] + step * difference;
            slope[i] = slope[i] + rate * difference;
        }
    }
    (value, slope)
}

/// L11, L21, L22, L33.
#[inline(always)]
fn root<L: Lane>(rest: &[L; 28], m: L, value: &[L; 4]) -> [L; 4] {
    let c = |i: usize| rest[4 + i] + m * value[i];
    let l11 = c(0).sqrt();
    let l21 = c(1) / l11;
    [l11, l21, (c(2) - l21 * l21).above_zero().sqrt(), c(3).above_zero().sqrt()]
}

/// The stress that belongs to the Green strain as y belongs to r.
#[inline(always)]
fn stress<L: Lane>(rest: &[L; 28], f: [Vec3<L>; 2], [y1, y2, y3]: [L; 3]) -> [L; 3] {
    let e = strain(f);
    let at = place(e);
    let (value, slope) = direction(rest, at.c);
    let [l11, l21, l22, l33] = root(rest, at.m, &value);
    let (zero, half) = (y1.zero(), y1.like(0.5));
    // The slopes by the entries of L, then of C.
    let over = |a: L, l: L| l.positive(a * half / l, zero);
    let c22 = over(y2 * e[1], l22);
    let in21 = y1 * e[1] - c22 * l21 * y1.like(2.0);
    let c12 = in21 / l11;
    let c11 = (y1 * e[0] - c12 * l21) * half / l11;
    let c33 = over(y3 * e[2], l33);
    let with = |t: &[L; 4]| c11 * t[0] + c12 * t[1] + c22 * t[2] + c33 * t[3];
    let (in_m, in_c) = (with(&value), at.m * with(&slope));
    let mut s = [l11 * y1, l21 * y1 + l22 * y2, l33 * y3];
    for i in 0..3 {
        s[i] = s[i] + in_m * at.dm[i] + in_c * at.dc[i];
    }
    s
}

impl Element<3, 3, 28> for Woven {
    const NAME: &'static str = "fabric";
    #[inline(always)]
    fn lengthening<L: Lane>([b0, b1, b2, b3, ..]: [L; 28], x: [[L; 4]; 3]) -> Option<L> {
        Some(edges([b0, b1, b2, b3], x))
    }
    #[inline(always)]
    fn residual<L: Lane>(rest: [L; 28], x: [[L; 4]; 3]) -> [L; 3] {
        let e = strain(deformation(&rest, x));
        let at = place(e);
        let (value, _) = direction(&rest, at.c);
        let l = root(&rest, at.m, &value);
        [l[0] * e[0] + l[1] * e[1], l[2] * e[1], l[3] * e[2]]
    }
    #[inline(always)]
    fn tension<L: Lane>(rest: [L; 28], x: [[L; 4]; 3], y: [L; 3], u: [Vec3<L>; 3]) -> Option<[Vec3<L>; 3]> {
        let [b0, b1, b2, b3, ..] = rest;
        Some(taut([b0, b1, b2, b3], stress(&rest, deformation(&rest, x), y), u))
    }
    #[inline(always)]
    fn pullback<L: Lane>(rest: [L; 28], x: [[L; 4]; 3], y: [L; 3]) -> [[L; 4]; 3] {
        let [f1, f2] = deformation(&rest, x);
        let s = stress(&rest, [f1, f2], y);
        let (p1, p2) = (f1 * s[0] + f2 * s[2], f2 * s[1] + f1 * s[2]);
        let (g1, g2) = (p1 * rest[0] + p2 * rest[1], p1 * rest[2] + p2 * rest[3]);
        [force(-(g1 + g2)), force(g1), force(g2)]
    }
}

/// The moment at a curvature, in samples, and the work up to there.
#[inline(always)]
pub fn moment<L: Lane>([b0, b1, b2, b3, t1, t2, k4, b4]: [L; 8], kappa: L) -> (L, L) {
    let (one, half, third) = (kappa.like(1.0), kappa.like(0.5), kappa.like(1.0 / 3.0));
    let near = least(kappa, kappa.like(3.0));
    let (from1, from2) = ((near - one).above_zero(), (near - kappa.like(2.0)).above_zero());
    let (m0, m1, m2) = (b1 - b0, b2 - b1 - b1 + b0, b3 - b2 - b2 + b1);
    let mut m = near * (b0 + m0 * near + m1 * from1 + m2 * from2);
    let mut e = near * near * (b0 * half + m0 * near * third);
    for (bend, from, at) in [(m1, from1, 1.0), (m2, from2, 2.0)] {
        e = e + bend * from * from * (from * third + kappa.like(0.5 * at));
    }
    let u = (least(kappa, k4) - kappa.like(3.0)).above_zero();
    let beyond = (kappa - k4).above_zero();
    m = m + u * (t1 + t2 * u) + b4 * beyond;
    e = e + u * (kappa.like(3.0) * b3 + u * (t1 * half + t2 * u * third)) + b4 * beyond * (k4 + beyond * half);
    (m, e)
}

/// The mean of b over the way to a curvature, in samples, and its slope.                     (fabrics.9)
#[inline(always)]
fn mean<L: Lane>(row: [L; 8], s: L) -> (L, L) {
    let (m, e) = moment(row, s);
    let first = s.like(1.0) - s;
    let inverse = first.positive(s.like(1.0), s.like(1.0) / s);
    let far = (e + e) * inverse * inverse;
    let rate = (row[1] - row[0]) * s.like(2.0 / 3.0);
    let slope = (m * inverse - far) * inverse;
    (first.positive(row[0] + rate * s, far), first.positive(rate, slope + slope))
}

#[inline(always)]
fn rows<L: Lane>(rest: &[L; 36]) -> [[L; 8]; 3] {
    let mut rows = [[rest[0]; 8]; 3];
    for i in 0..24 {
        rows[i / 8][i % 8] = rest[12 + i];
    }
    rows
}

/// Roots of D, and how they change with s.
#[inline(always)]
fn stiffness<L: Lane>(rows: &[[L; 8]; 3], s: L) -> ([L; 3], [L; 3]) {
    let mut b = [(s, s); 3];
    for i in 0..3 {
        b[i] = mean(rows[i], s);
    }
    let [(weft, weft_slope), (between, between_slope), (warp, warp_slope)] = b;
    let (four, low) = (s.like(4.0), s.like(LEAST));
    let twist = four * between - weft - warp;
    let above = twist - low * between;
    let d = [(weft, weft_slope), (warp, warp_slope)];
    let twist = (above.positive(twist, low * between), above.positive(four * between_slope - weft_slope - warp_slope, low * between_slope));
    let (mut root, mut slope) = ([s; 3], [s; 3]);
    for (i, (d, rate)) in [d[0], d[1], twist].into_iter().enumerate() {
        root[i] = d.sqrt();
        slope[i] = rate * s.like(0.5) / root[i];
    }
    (root, slope)
}

/// s, and its inverse, which is 0 at 0.
#[inline(always)]
fn size<L: Lane>([u, v, w]: [L; 3]) -> (L, L) {
    let s = (u * u + v * v + (w + w) * w).sqrt();
    (s, s.positive(s.like(1.0) / s, s.zero()))
}

impl Element<6, 3, 36> for WovenBending {
    const NAME: &'static str = "fabric hinge";
    #[inline(always)]
    fn residual<L: Lane>(rest: [L; 36], x: [[L; 4]; 6]) -> [L; 3] {
        let kappa = product(&rest, folds(&rest, &x));
        let (root, _) = stiffness(&rows(&rest), size(kappa).0);
        [root[0] * kappa[0], root[1] * kappa[1], root[2] * kappa[2]]
    }
    #[inline(always)]
    fn pullback<L: Lane>(rest: [L; 36], x: [[L; 4]; 6], y: [L; 3]) -> [[L; 4]; 6] {
        let kappa = product(&rest, folds(&rest, &x));
        let (s, inverse) = size(kappa);
        let (root, slope) = stiffness(&rows(&rest), s);
        let along = (y[0] * kappa[0] * slope[0] + y[1] * kappa[1] * slope[1] + y[2] * kappa[2] * slope[2]) * inverse;
        let twist = (kappa[2] + kappa[2]) * along;
        let z = [y[0] * root[0] + kappa[0] * along, y[1] * root[1] + kappa[1] * along, y[2] * root[2] + twist];
        spread(&x, transposed(&rest, z))
    }
}
