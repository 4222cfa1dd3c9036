//! Viscosity, one component of the velocity after the other; and what is carried spreads.
//!
//!   implicit   (1 - h nu lap) u(t + h) = u(t)        conjugate gradients                          (gas.3)
//!   explicit   u(t + h) = (1 + h nu lap) u(t)        in parts of half its limit (grids.10)
//!
//! What the sides of the box hold stays as it is, and so do the faces of open sides.

use super::fluid::{Failure, Fluid};
use super::rows::dot;
use super::solids::Solids;
use crate::math::{Real, Spare};
use crate::operators::{diffuse, each_row, laplacian};
use crate::state::{Field, Place, Side};
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

/// x(t + h) = (1 + h kappa lap) x(t)
fn explicit(x: &mut Field, kappa: f64, h: f64, spare: &mut Spare) -> Result<(), Failure> {
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

impl Fluid {
    /// Viscosity of the velocity, and diffusion of smoke and warmth, for h seconds from t on.             (gas.3)
    pub fn viscosity(&mut self, t: f64, h: f64, report: &mut StepReport) -> Result<(), Failure> {
        let spare = &mut self.solver.spare;
        for (carried, spread) in [(&mut self.smoke, 0), (&mut self.temperature, 1)] {
            let diffusivity = self.settings.diffusivity[spread];
            if let Some(carried) = carried
                && diffusivity > 0.0
            {
                if let Some(solids) = &self.solids {
                    solids.shade(carried);
                }
                explicit(carried, diffusivity, h, spare)?;
            }
        }
        self.clear();
        let nu = self.settings.viscosity / self.settings.density;
        if nu == 0.0 {
            return Ok(());
        }
        super::sides::hold(&mut self.u, &self.settings.sides, t + h);
        if let Some(solids) = &self.solids {
            solids.recall(&mut self.u);
        }
        for axis in 0..self.u.parts.len() {
            let part = &mut self.u.parts[axis];
            match self.settings.viscous {
                Viscous::Explicit => explicit(part, nu, h, &mut self.solver.spare)?,
                Viscous::Implicit => {
                    let (iterations, converged) = implicit(part, h * nu, self.solids.as_ref(), &mut self.solver.spare)?;
                    report.linear += iterations as u64;
                    report.unconverged += u64::from(!converged);
                }
            }
        }
        Ok(())
    }
}
