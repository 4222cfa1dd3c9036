//! How particles go their way, within the box and around solids.

use crate::fluids::Solids;
use crate::math::Real;
use crate::state::Grid;

/// How far from a side of the box particles stay [cells].
pub const SIDE: Real = 1e-3;
/// How far from a solid particles stay [cells].
pub const GAP: Real = 0.05;
/// Parts of a cell in which particles go near solids; walls count as two cells thick.
const STRIDES: Real = 4.0;

/// Moves a particle by a way [cells], within the box and around solids.
pub fn go(solids: Option<&Solids>, grid: &Grid, x: &mut [Real; 3], way: &[Real; 3]) {
    let strides = solids.map_or(1, |solids| strides(solids, grid, x, way));
    for _ in 0..strides {
        for a in grid.axes() {
            x[a] = (x[a] + way[a] / strides as Real).max(SIDE).min(grid.n[a] as Real - SIDE);
        }
        if let (true, Some(solids)) = (strides > 1, solids) {
            push_out(solids, grid, x);
        }
    }
}

/// Moves a particle out of solids.
pub fn push_out(solids: &Solids, grid: &Grid, x: &mut [Real; 3]) {
    let (distance, normal) = solids.near(x);
    let lack = GAP - distance * (1.0 / grid.dx) as Real;
    if lack > 0.0 {
        for a in grid.axes() {
            x[a] = (x[a] + lack * normal[a]).max(SIDE).min(grid.n[a] as Real - SIDE);
        }
    }
}

/// Parts of a way [cells] that may lead into a solid: so short that what enters one is put back on the side from which it came.
fn strides(solids: &Solids, grid: &Grid, x: &[Real; 3], way: &[Real; 3]) -> usize {
    let long = grid.axes().map(|a| way[a] * way[a]).sum::<Real>().sqrt();
    if solids.near(x).0 * (1.0 / grid.dx) as Real > long + GAP {
        return 1;
    }
    1 + (STRIDES * long).min(64.0) as usize
}
