//! Values between the points of a field, by trilinear weights: read, and given back with the same weights.

use crate::geometry::Vector;
use crate::math::Real;
use crate::state::{Grid, Place};

/// Position of an interpolated value.
#[derive(Clone, Copy, Default)]
pub struct Spot {
    at: u32,
    t: [Real; 3],
}

impl Spot {
    /// The spot of x [m] among the points of a place; beyond the outermost points it is on them.
    pub fn new(grid: &Grid, place: Place, x: Vector) -> Self {
        let x: [f64; 3] = x.into();
        let (offset, points) = (grid.offset(place), grid.points(place));
        let (mut base, mut t) = ([0; 3], [0.0; 3]);
        for a in grid.axes().filter(|a| points[*a] > 1) {
            let s = ((x[a] - grid.origin[a]) / grid.dx - offset[a]).clamp(0.0, (points[a] - 1) as f64);
            base[a] = (s as usize).min(points[a] - 2);
            t[a] = (s - base[a] as f64) as Real;
        }
        Self { at: grid.lattice().at(base[0], base[1], base[2]) as u32, t }
    }

    /// Calls `each(number, weight)` for the points around it; the weights add up to 1.
    #[inline(always)]
    pub fn points(&self, stride: [usize; 3], mut each: impl FnMut(usize, Real)) {
        for corner in 0..8 {
            let (mut weight, mut at) = (1.0, self.at as usize);
            for a in 0..3 {
                let up = corner >> a & 1 == 1;
                weight *= if up { self.t[a] } else { 1.0 - self.t[a] };
                at += if up { stride[a] } else { 0 };
            }
            if weight != 0.0 {
                each(at, weight);
            }
        }
    }

    /// The value there.
    pub fn read(&self, stride: [usize; 3], data: &[Real]) -> Real {
        let mut sum = 0.0;
        self.points(stride, |at, weight| sum += weight * data[at]);
        sum
    }
}
