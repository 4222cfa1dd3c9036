//! Attraction between neighbours.

use super::PairLaw;
use crate::math::Lane;

/// f = F c t (1 - t²)²,   t = r/R < 1,   c = 25 sqrt(5)/16,   E = -F c R (1 - t²)³/6                (neighbours.8)
///
/// Smooth, zero at both ends, and largest, F, at R/sqrt(5).
#[derive(Debug, Clone, Copy)]
pub struct Cohesion {
    /// F [N].
    pub strength: f64,
    /// R [m].
    pub radius: f64,
}

/// 1 over the largest value of t (1 - t²)².
const PEAK: f64 = 3.493_856_214_843_421_3;

impl Cohesion {
    #[inline(always)]
    fn fade<L: Lane>(&self, r_sq: L) -> L {
        r_sq.like(1.0) - r_sq * r_sq.like(1.0 / (self.radius * self.radius))
    }
}

impl PairLaw for Cohesion {
    const NAME: &'static str = "cohesion";

    #[inline(always)]
    fn reach(&self) -> f64 {
        self.radius
    }

    #[inline(always)]
    fn energy<L: Lane>(&self, r_sq: L) -> L {
        let q = self.fade(r_sq);
        r_sq.like(-self.strength * PEAK * self.radius / 6.0) * q * q * q
    }

    #[inline(always)]
    fn pull<L: Lane>(&self, r_sq: L) -> L {
        let q = self.fade(r_sq);
        r_sq.like(self.strength * PEAK / self.radius) * q * q
    }

    #[inline(always)]
    fn tangent<L: Lane>(&self, r_sq: L) -> L {
        let q = self.fade(r_sq);
        r_sq.like(self.strength * PEAK / self.radius) * q * (r_sq.like(5.0) * q - r_sq.like(4.0))
    }
}
