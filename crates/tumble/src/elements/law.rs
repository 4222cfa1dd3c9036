//! How stress follows from the measure r where the energy is not k/2 r².

use crate::math::{Dual, Lane};

/// Energy and stress of one component of r, with P parameters. stress = dE/dr.
pub trait Law<const P: usize>: Send + Sync + 'static {
    /// Energy.
    fn energy<L: Lane>(k: L, p: [L; P], r: L) -> L;
    /// Its derivative.
    fn stress<L: Lane>(k: L, p: [L; P], r: L) -> L;
    /// Its second derivative.
    #[inline(always)]
    fn tangent<L: Lane>(k: L, p: [L; P], r: L) -> L {
        let mut constant = [Dual::constant(k); P];
        for i in 0..P {
            constant[i] = Dual::constant(p[i]);
        }
        Self::stress(Dual::constant(k), constant, Dual { re: r, slope: k.like(1.0) }).slope
    }
}

/// E = k/2 r².
pub struct Linear;

impl Law<0> for Linear {
    #[inline(always)]
    fn energy<L: Lane>(k: L, _: [L; 0], r: L) -> L {
        k * r * r * k.like(0.5)
    }
    #[inline(always)]
    fn stress<L: Lane>(k: L, _: [L; 0], r: L) -> L {
        k * r
    }
    #[inline(always)]
    fn tangent<L: Lane>(k: L, _: [L; 0], _: L) -> L {
        k
    }
}

/// Stiffening, and with or without resistance to compression:
///
///   stress = k r (1 + c r²),   times p where r < 0                   (springs.6)
///
/// Parameters: c [1/m²] = hardening / l0², p = 1 for a spring, 0 for a thread.
pub struct Nonlinear;

impl Law<2> for Nonlinear {
    #[inline(always)]
    fn energy<L: Lane>(k: L, [c, p]: [L; 2], r: L) -> L {
        let r_sq = r * r;
        let e = k * r_sq * (r.like(0.5) + c * r_sq * r.like(0.25));
        r.positive(e, e * p)
    }
    #[inline(always)]
    fn stress<L: Lane>(k: L, [c, p]: [L; 2], r: L) -> L {
        let s = k * r * (r.like(1.0) + c * r * r);
        r.positive(s, s * p)
    }
}
