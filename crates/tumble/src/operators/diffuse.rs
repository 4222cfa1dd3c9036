//! Diffusion by explicit steps: of heat, of smoke, and of each component of a velocity (viscosity over density).
//!
//!   f(t + h) = f(t) + h kappa lap f                                  (grids.9)
//!
//! kappa [m²/s]. Steps above dx²/(2 d kappa) grow without bound (grids.10); at half that limit and below no new extrema arise and
//! no mode changes its sign from step to step. Test: crates/tumble-f64/tests/operators.rs.

use super::stencil::second;
use crate::state::{Field, Grid, GridError};

/// The largest step [s] that does not grow; infinite without diffusion.                   (grids.10)
pub fn diffusion_limit(grid: &Grid, kappa: f64) -> f64 {
    grid.dx * grid.dx / (2.0 * grid.dimension() as f64 * kappa)
}

/// One step h [s]; an error beyond the limit, and `out` then stays as it was.
pub fn diffuse_step(f: &Field, kappa: f64, h: f64, out: &mut Field) -> Result<(), GridError> {
    out.expect(&f.grid, f.place, "diffusion")?;
    let limit = diffusion_limit(&f.grid, kappa);
    if !(h >= 0.0 && kappa >= 0.0 && h <= limit * (1.0 + 1e-12)) {
        return Err(GridError::Step { h, limit });
    }
    second(out, f, true, h * kappa / (f.grid.dx * f.grid.dx));
    Ok(())
}

/// Diffuses for a duration [s], in as few equal steps as stay within half the limit; returns how many.
pub fn diffuse(f: &mut Field, kappa: f64, duration: f64, scratch: &mut Field) -> Result<usize, GridError> {
    let steps = (duration / (0.5 * diffusion_limit(&f.grid, kappa))).ceil().max(1.0);
    // Beyond that many steps nobody waits; NaN and negative numbers end here, too.
    if !(steps <= 1e9 && duration >= 0.0 && kappa >= 0.0) {
        return Err(GridError::Step { h: duration, limit: diffusion_limit(&f.grid, kappa) });
    }
    let scratch_sides = std::mem::replace(&mut scratch.sides, f.sides);
    let mut taken = 0;
    let result = (0..steps as usize).try_for_each(|_| {
        diffuse_step(f, kappa, duration / steps, scratch)?;
        std::mem::swap(&mut f.data, &mut scratch.data);
        taken += 1;
        Ok(())
    });
    scratch.sides = scratch_sides;
    result.map(|()| taken)
}
