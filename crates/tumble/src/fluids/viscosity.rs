//! Viscosity, one component of the velocity after the other; and what is carried spreads.
//!
//!   implicit   (1 - h nu lap) u(t + h) = u(t)        conjugate gradients                          (gas.3)
//!   explicit   u(t + h) = (1 + h nu lap) u(t)        in parts of half its limit (grids.10)
//!
//! What the sides of the box hold stays as it is, and so do the faces of open sides.

use super::failure::Failure;
use super::rows::dot;
use super::solids::Solids;
use crate::math::{Real, Spare};
use crate::operators::{diffuse, each_row, laplacian};
use crate::state::{Field, Place, Side, Vectors};
use tumble_interface::engine::StepReport;
use tumble_interface::scene::Viscous;

/// Residual over |u| at which conjugate gradients stop.
#[cfg(not(feature = "double"))]
const TOLERANCE: f64 = 1e-6;
/// Residual over |u| at which conjugate gradients stop.
#[cfg(feature = "double")]
const TOLERANCE: f64 = 1e-12;
/// Iterations at most.
const ITERATIONS: usize = 1000;

/// y = a x + b y over the points of y.
fn blend(y: &mut Field, b: f64, x: &Field, a: f64) {
    let (a, b) = (a as Real, b as Real);
    each_row(y, |j, k, row| {
        let at = x.index([0, j, k]);
        row.iter_mut().zip(&x.data[at..]).for_each(|(y, x)| *y = a * x + b * *y);
    });
}

/// Zero on the faces of walls and open sides.
fn free(part: &mut Field) {
    let Place::Face(axis) = part.place else { return };
    if !part.grid.periodic[axis] {
        for index in [0, part.grid.n[axis]] {
            super::sides::set_wall(part, axis, index, |_| 0.0);
        }
    }
}

/// Diffusion for h seconds: x(t + h) = (1 + h kappa lap) x(t), with kappa [m²/s].                        (gas.3)
pub fn spread(x: &mut Field, kappa: f64, h: f64, spare: &mut Spare) -> Result<(), Failure> {
    let mut next = spare.field(x.grid, x.place, "")?;
    let done = diffuse(x, kappa, h, &mut next);
    spare.keep(next);
    done?;
    Ok(())
}

/// Solves (1 - c lap) x = b from x = b; returns iterations and whether it converged.
fn implicit(x: &mut Field, c: f64, solids: Option<&Solids>, spare: &mut Spare) -> Result<(usize, bool), Failure> {
    // The same sides at rest: directions change nothing that is held.
    let sides = x.sides.map(|ends| ends.map(|side| if let Side::Value(_) = side { Side::Value(0.0) } else { Side::Closed }));
    let mut field = || Ok::<_, Failure>(Field { sides, ..spare.field(x.grid, x.place, "")? });
    let mut fields = [field()?, field()?, field()?];
    let found = conjugate_gradients(x, c, solids, &mut fields);
    fields.into_iter().for_each(|field| spare.keep(field));
    found
}

fn conjugate_gradients(x: &mut Field, c: f64, solids: Option<&Solids>, [r, p, product]: &mut [Field; 3]) -> Result<(usize, bool), Failure> {
    laplacian(x, product)?;
    let free = |part: &mut Field| {
        free(part);
        solids.iter().for_each(|solids| solids.free(part));
    };
    blend(r, 0.0, product, c);
    free(r);
    blend(p, 0.0, r, 1.0);
    let size = dot(x, x);
    let mut rr = dot(r, r);
    let enough = TOLERANCE * TOLERANCE * size.max(rr);
    for iteration in 0..ITERATIONS {
        if rr <= enough {
            return Ok((iteration, true));
        }
        laplacian(p, product)?;
        blend(product, -c, p, 1.0);
        free(product);
        let alpha = rr / dot(p, product);
        if !alpha.is_finite() {
            return Ok((iteration, false));
        }
        blend(x, 1.0, p, alpha);
        blend(r, 1.0, product, -alpha);
        let after = dot(r, r);
        blend(p, after / rr, r, 1.0);
        rr = after;
    }
    Ok((ITERATIONS, rr <= enough))
}

/// Viscosity of a velocity, and how it is stepped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viscosity {
    /// Kinematic viscosity nu [m²/s].
    pub nu: f64,
    /// The scheme.
    pub method: Viscous,
}

impl Viscosity {
    /// Acts for h seconds on a velocity whose sides are held, around solids whose images were kept before the forces.      (gas.3)
    pub fn act(&self, u: &mut Vectors, solids: Option<&Solids>, h: f64, spare: &mut Spare, report: &mut StepReport) -> Result<(), Failure> {
        if let Some(solids) = solids {
            solids.recall(u);
        }
        for part in &mut u.parts {
            match self.method {
                Viscous::Explicit => spread(part, self.nu, h, spare)?,
                Viscous::Implicit => {
                    let (iterations, converged) = implicit(part, h * self.nu, solids, spare)?;
                    report.linear += iterations as u64;
                    report.unconverged += u64::from(!converged);
                }
            }
        }
        Ok(())
    }
}
