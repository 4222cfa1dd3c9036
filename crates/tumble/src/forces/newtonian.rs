//! Viscosity of a liquid of particles.

use super::PairLaw;
use crate::elements::spline;
use crate::math::Lane;
use std::f64::consts::PI;

/// f_i = 2 mu V² sum_j |dW/dr|/r (v_j - v_i), the Laplacian of the velocity in sums over neighbours            (liquids.6)
///
/// mu [Pa s]   V = s³ [m³]   W: (liquids.2). Source: [morris1997], eq. 22.
#[derive(Debug, Clone, Copy)]
pub struct Newtonian {
    /// mu [Pa s].
    pub viscosity: f64,
    /// s [m].
    pub spacing: f64,
}

impl PairLaw for Newtonian {
    const NAME: &'static str = "liquid viscosity";
    const DAMPS: bool = true;

    #[inline(always)]
    fn reach(&self) -> f64 {
        2.0 * self.spacing
    }

    #[inline(always)]
    fn damping<L: Lane>(&self, r_sq: L) -> L {
        let q = r_sq.sqrt() * r_sq.like(1.0 / self.spacing);
        let slope = spline(q).1;
        // 2 mu s⁶/(pi s⁴ q s) slope.
        slope * r_sq.like(2.0 * self.viscosity * self.spacing / PI) / q
    }
}
