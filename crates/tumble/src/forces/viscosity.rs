//! Friction between neighbours: they come to move alike, and their momentum stays.

use super::PairLaw;
use crate::math::Lane;

/// f_i = c w(r) (v_j - v_i), or its part along the line,   w = (1 - r²/R²)²                            (neighbours.9)
#[derive(Debug, Clone, Copy)]
pub struct Viscosity {
    /// c [N s/m].
    pub coefficient: f64,
    /// R [m].
    pub radius: f64,
    /// Only along the line: keeps angular momentum, too.
    pub central: bool,
}

impl PairLaw for Viscosity {
    const NAME: &'static str = "viscosity";
    const DAMPS: bool = true;

    #[inline(always)]
    fn reach(&self) -> f64 {
        self.radius
    }

    #[inline(always)]
    fn damping<L: Lane>(&self, r_sq: L) -> L {
        let q = r_sq.like(1.0) - r_sq * r_sq.like(1.0 / (self.radius * self.radius));
        r_sq.like(self.coefficient) * q * q
    }

    #[inline(always)]
    fn is_central(&self) -> bool {
        self.central
    }
}
