//! Surface tension: on a curved surface the pressure is that of its curvature.
//!
//!   p = gamma kappa,   kappa = div (grad c/|grad c|)                                                                   (pic.11)
//!
//! c is the distance from the surface, known up to the reach of its kernel, after some rounds of smoothing; across sides and within solids it is
//! mirrored, so that the surface meets walls at a right angle. Curvatures count up to that of a drop of one cell.
//!
//! Source: [gibou2002] for the jump at the surface; the longest step is that of [brackbill1992].

use super::level::{Level, cell};
use super::pressure::Matrix;
use crate::math::Real;
use crate::math::parallel::{CHUNK, Tasks};
use crate::operators::each_row;
use crate::state::{Field, Grid};
use std::f64::consts::PI;

/// Rounds of smoothing, each over three cells.
const ROUNDS: usize = 4;

/// The longest step [s] that waves of the length of two cells bear; `density` [kg/m³], `tension` gamma [N/m].
pub fn longest(density: f64, tension: f64, dx: f64) -> f64 {
    (density * dx * dx * dx / (4.0 * PI * tension)).sqrt()
}

/// The curvature where each line between two cells crosses the surface [1/cell], positive where the liquid bulges.
pub fn curvatures(level: &Level, matrix: &Matrix) -> Vec<Real> {
    let mut smooth = level.distance.clone();
    for _ in 0..ROUNDS {
        for axis in smooth.grid.axes() {
            let from = smooth.clone();
            blur(&mut smooth, &from, axis);
        }
    }
    let grid = smooth.grid;
    let crossings: Vec<([u32; 2], Real)> = matrix.crossings().collect();
    let parts = crossings.chunks(CHUNK).map_in_parallel(|crossings| {
        let between = |(cells, theta): &([u32; 2], Real)| {
            let [here, there] = cells.map(|at| curvature(&grid, level, &smooth.data, at as usize));
            here + theta * (there - here)
        };
        crossings.iter().map(between).collect::<Vec<_>>()
    });
    parts.concat()
}

/// A quarter of both neighbours along an axis, which beyond sides are the cell itself.
fn blur(into: &mut Field, from: &Field, axis: usize) {
    let (grid, stride) = (from.grid, from.grid.lattice().stride[axis]);
    each_row(into, |j, k, row| {
        let start = grid.lattice().at(0, j, k);
        for (i, x) in row.iter_mut().enumerate() {
            let (at, along) = (start + i, [i, j, k][axis]);
            let low = if along == 0 { at } else { at - stride };
            let high = if along + 1 == grid.n[axis] { at } else { at + stride };
            *x = 0.25 * (from.data[low] + from.data[high]) + 0.5 * from.data[at];
        }
    });
}

/// The curvature of the level that goes through a cell [1/cell].
fn curvature(grid: &Grid, level: &Level, c: &[Real], at: usize) -> Real {
    let stride = grid.lattice().stride;
    let axes: Vec<usize> = grid.axes().collect();
    // Beyond a side: the cell before it.
    let step = |from: usize, axis: usize, up: bool| {
        let to = if up { from + stride[axis] } else { from - stride[axis] };
        if level.cells[to] == cell::OUTSIDE { from } else { to }
    };
    let (mut slope, mut second) = ([0.0; 3], [[0.0; 3]; 3]);
    for &a in &axes {
        let (low, high) = (step(at, a, false), step(at, a, true));
        slope[a] = 0.5 * (c[high] - c[low]);
        second[a][a] = c[high] + c[low] - 2.0 * c[at];
        for &b in axes.iter().filter(|b| **b < a) {
            let mixed = 0.25 * (c[step(high, b, true)] - c[step(high, b, false)] - c[step(low, b, true)] + c[step(low, b, false)]);
            (second[a][b], second[b][a]) = (mixed, mixed);
        }
    }
    let square: Real = slope.iter().map(|s| s * s).sum();
    if square < 1e-12 {
        return 0.0;
    }
    let (mut trace, mut along) = (0.0, 0.0);
    for &a in &axes {
        trace += second[a][a];
        for &b in &axes {
            along += slope[a] * second[a][b] * slope[b];
        }
    }
    let most = (axes.len() - 1) as Real;
    ((trace - along / square) / square.sqrt()).max(-most).min(most)
}
