//! Incomplete Cholesky factors, plain and modified, as preconditioners.
//!
//!   A ~ (E + L) E^-1 (E + L^T),   L the part of A below its diagonal, E a diagonal                       (pressure.13)
//!
//! Cell after cell in the order of numbers: the result does not depend on threads because there is only one. Couplings across
//! joined sides are left out of L.
//!
//! Source: [meijerink1977] for IC(0), [gustafsson1978] for MIC(0), [bridson2015] for its two constants.

use super::faces::Weight;
use super::level::Grid;
use crate::math::Real;

/// How much of what the factors drop is given to the diagonal, so that sums of rows stay nearly right.
const TAU: f64 = 0.97;
/// A pivot below this part of the diagonal is replaced by the diagonal.
const SIGMA: f64 = 0.25;

/// 1/E of every cell.
#[derive(Debug, Clone)]
pub(super) struct Factors {
    inverse: Vec<Real>,
    pub modified: bool,
}

impl Factors {
    pub fn new<T: Weight>(grid: &Grid<T>, modified: bool) -> Self {
        let (n, stride) = (grid.lattice.n, grid.lattice.stride);
        let tau = if modified { TAU } else { 0.0 };
        let value = |axis: usize, at: usize| f64::from(grid.w[axis][at].value());
        let mut inverse = vec![0.0 as Real; grid.lattice.len()];
        grid.each_row(|row, [j, k]| {
            for i in 0..n[0] {
                let (at, cell) = (row + i, [i, j, k]);
                let extra = grid.extra.as_ref().map_or(0.0, |e| f64::from(e[at]));
                let diagonal = (0..3).map(|a| value(a, at) + value(a, at + stride[a])).sum::<f64>() + extra;
                let mut e = diagonal;
                for axis in 0..3 {
                    if cell[axis] == 0 {
                        continue;
                    }
                    let (w, lower) = (value(axis, at), at - stride[axis]);
                    let dropped: f64 = (0..3).filter(|a| *a != axis && cell[*a] + 1 < n[*a]).map(|a| value(a, lower + stride[a])).sum();
                    e -= w * (w + tau * dropped) * f64::from(inverse[lower]);
                }
                if diagonal > 0.0 {
                    inverse[at] = (1.0 / if e < SIGMA * diagonal { diagonal } else { e }) as Real;
                }
            }
        });
        Self { inverse, modified }
    }

    /// y = what the factors make of b, forward and back; returns b.y, the sum of y and that of b.
    pub fn solve<T: Weight>(&self, grid: &mut Grid<T>) -> [f64; 3] {
        let ([n0, n1, n2], [_, row, plane]) = (grid.lattice.n, grid.lattice.stride);
        let mut y = std::mem::take(&mut grid.y);
        let value = |axis: usize, at: usize| grid.w[axis][at].value();
        for k in 0..n2 {
            for j in 0..n1 {
                let at = grid.lattice.at(0, j, k);
                let mut last = 0.0;
                for i in at..at + n0 {
                    let mut sum = grid.b[i];
                    if i > at {
                        sum += value(0, i) * last;
                    }
                    if j > 0 {
                        sum += value(1, i) * y[i - row];
                    }
                    if k > 0 {
                        sum += value(2, i) * y[i - plane];
                    }
                    last = sum * self.inverse[i];
                    y[i] = last;
                }
            }
        }
        let mut sums = [0.0; 3];
        for k in (0..n2).rev() {
            for j in (0..n1).rev() {
                let at = grid.lattice.at(0, j, k);
                let mut last = 0.0;
                for i in (at..at + n0).rev() {
                    let mut sum = 0.0;
                    if i + 1 < at + n0 {
                        sum += value(0, i + 1) * last;
                    }
                    if j + 1 < n1 {
                        sum += value(1, i + row) * y[i + row];
                    }
                    if k + 1 < n2 {
                        sum += value(2, i + plane) * y[i + plane];
                    }
                    last = y[i] + sum * self.inverse[i];
                    y[i] = last;
                    sums[0] += f64::from(grid.b[i]) * f64::from(last);
                    sums[1] += f64::from(last);
                    sums[2] += f64::from(grid.b[i]);
                }
            }
        }
        grid.y = y;
        sums
    }
}
