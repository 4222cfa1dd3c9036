//! Molecules that repel each other close by and attract each other further off.

use super::PairLaw;
use crate::math::Lane;

/// E = 4 epsilon ((sigma/r)^12 - (sigma/r)^6), moved so that it ends at the cutoff with zero, and by choice its force, too:
///
///   E_c(r) = E(r) - E(r_c) - (r - r_c) E'(r_c)                                                   (neighbours.6)
///
/// Below a fifth of sigma it goes on as the parabola in r with the same slope: finite everywhere.
///
/// Source: [lennardjones1931]; the shift is [allen2017], section 5.2.2.
#[derive(Debug, Clone, Copy)]
pub struct LennardJones {
    epsilon: f64,
    sigma: f64,
    cutoff: f64,
    /// E at the cutoff [J].
    end: f64,
    /// E' at the cutoff [N], if the force ends there with zero.
    slope: f64,
    /// E' and r of the core's rim: r², E'/r, E.
    core: [f64; 3],
}

/// Start of the parabola, relative to sigma.
const CORE: f64 = 0.2;

impl LennardJones {
    /// epsilon [J], sigma [m], cutoff [m].
    pub fn new(epsilon: f64, sigma: f64, cutoff: f64, smooth: bool) -> Self {
        let mut law = Self { epsilon, sigma, cutoff, end: 0.0, slope: 0.0, core: [0.0; 3] };
        let c_sq = cutoff * cutoff;
        law.end = law.plain_energy(c_sq);
        law.slope = if smooth { law.plain_pull(c_sq) * cutoff } else { 0.0 };
        let rim = (CORE * sigma) * (CORE * sigma);
        law.core = [rim, law.outer_pull(rim), law.outer_energy(rim)];
        law
    }

    #[inline(always)]
    fn sixth<L: Lane>(&self, r_sq: L) -> L {
        let s = r_sq.like(self.sigma * self.sigma) / r_sq;
        s * s * s
    }

    #[inline(always)]
    fn plain_energy<L: Lane>(&self, r_sq: L) -> L {
        let s = self.sixth(r_sq);
        s.like(4.0 * self.epsilon) * (s * s - s)
    }

    #[inline(always)]
    fn plain_pull<L: Lane>(&self, r_sq: L) -> L {
        let s = self.sixth(r_sq);
        s.like(-24.0 * self.epsilon) * (s * s + s * s - s) / r_sq
    }

    #[inline(always)]
    fn outer_energy<L: Lane>(&self, r_sq: L) -> L {
        let shifted = self.plain_energy(r_sq) - r_sq.like(self.end);
        if self.slope == 0.0 { shifted } else { shifted - (r_sq.sqrt() - r_sq.like(self.cutoff)) * r_sq.like(self.slope) }
    }

    #[inline(always)]
    fn outer_pull<L: Lane>(&self, r_sq: L) -> L {
        let pull = self.plain_pull(r_sq);
        if self.slope == 0.0 { pull } else { pull - r_sq.like(self.slope) * r_sq.rsqrt() }
    }
}

impl PairLaw for LennardJones {
    const NAME: &'static str = "lennard_jones";

    #[inline(always)]
    fn reach(&self) -> f64 {
        self.cutoff
    }

    #[inline(always)]
    fn energy<L: Lane>(&self, r_sq: L) -> L {
        let [rim, pull, energy] = self.core;
        let inside = r_sq.like(energy) + r_sq.like(0.5 * pull) * (r_sq - r_sq.like(rim));
        (r_sq - r_sq.like(rim)).positive(self.outer_energy(r_sq), inside)
    }

    #[inline(always)]
    fn pull<L: Lane>(&self, r_sq: L) -> L {
        (r_sq - r_sq.like(self.core[0])).positive(self.outer_pull(r_sq), r_sq.like(self.core[1]))
    }

    #[inline(always)]
    fn tangent<L: Lane>(&self, r_sq: L) -> L {
        let s = self.sixth(r_sq);
        let outside = s.like(24.0 * self.epsilon) * (s.like(26.0) * s * s - s.like(7.0) * s) / r_sq;
        (r_sq - r_sq.like(self.core[0])).positive(outside, r_sq.like(self.core[1]))
    }
}
