//! Balls that push each other apart where they overlap.

use super::PairLaw;
use crate::math::Lane;

/// f = k (d - r)^p for r < d,   E = k (d - r)^(p + 1)/(p + 1)                                     (neighbours.7)
#[derive(Debug, Clone, Copy)]
pub struct Repulsion {
    /// k [N/m^p].
    pub stiffness: f64,
    /// d [m].
    pub distance: f64,
    /// p, at least 1.
    pub exponent: u8,
}

impl Repulsion {
    /// (d - r)^n.
    #[inline(always)]
    fn power<L: Lane>(&self, r: L, n: u8) -> L {
        let overlap = r.like(self.distance) - r;
        let mut power = r.like(1.0);
        for _ in 0..n {
            power = power * overlap;
        }
        power
    }
}

impl PairLaw for Repulsion {
    const NAME: &'static str = "repulsion";

    #[inline(always)]
    fn reach(&self) -> f64 {
        self.distance
    }

    #[inline(always)]
    fn energy<L: Lane>(&self, r_sq: L) -> L {
        r_sq.like(self.stiffness / (f64::from(self.exponent) + 1.0)) * self.power(r_sq.sqrt(), self.exponent + 1)
    }

    #[inline(always)]
    fn pull<L: Lane>(&self, r_sq: L) -> L {
        let inverse = r_sq.rsqrt();
        r_sq.like(-self.stiffness) * self.power(r_sq * inverse, self.exponent) * inverse
    }

    #[inline(always)]
    fn tangent<L: Lane>(&self, r_sq: L) -> L {
        let p = f64::from(self.exponent);
        r_sq.like(self.stiffness * p) * self.power(r_sq.sqrt(), self.exponent.saturating_sub(1))
    }
}
