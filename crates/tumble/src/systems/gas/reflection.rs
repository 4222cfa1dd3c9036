//! A step of second order: half a path, the pressure and the forces of its middle twice over, half a path, and a projection.
//!
//!   w = A(u0, h/2),   u1 = P V (w + h/2 f),   u2 = A(2 u1 - w, h/2),   u = P u2                          (gas.20)
//!
//! The first half goes with u0, the second with 2 u1 - u0. 2 P - 1 reflects at the space of velocities without divergence and keeps the
//! energy, of which P would take what paths have turned out of that space.
//! Sources, fire and sheets act once, in the middle. Source: [zehnder2018], [narain2019]; tests: crates/tumble-f64/tests/reflection.rs.

use super::fluid::{Fluid, copy};
use crate::fluids::projection::subtract_gradient;
use crate::fluids::{Beyond, Failure, Immersed};
use crate::math::Real;
use crate::operators::each_row;
use crate::state::Vectors;
use std::f64::consts::FRAC_1_SQRT_2;
use tumble_interface::engine::StepReport;

/// u -> a u + b v
fn mix(u: &mut Vectors, a: f64, v: &Vectors, b: f64) {
    let (a, b) = (a as Real, b as Real);
    for (u, v) in u.parts.iter_mut().zip(&v.parts) {
        each_row(u, |j, k, row| {
            let at = v.index([0, j, k]);
            row.iter_mut().zip(&v.data[at..]).for_each(|(u, v)| *u = a * *u + b * v);
        });
    }
}

impl Fluid {
    /// A step of h seconds from t to `end` [s].                                                          (gas.20)
    pub(super) fn reflected(&mut self, t: f64, h: f64, end: f64, report: &mut StepReport) -> Result<(), Failure> {
        let half = 0.5 * h;
        let mut flow = copy(&self.u, &mut self.solver.spare)?;
        self.advection(t, half)?;
        self.settle(t + half)?;
        self.supply(t, h);
        self.diffusion(h)?;
        self.trade(h);
        let mut from = copy(&self.u, &mut self.solver.spare)?;
        let bodies: Vec<_> = self.bodies().iter().map(Immersed::before).collect();
        self.accelerate(t + half, half)?;
        self.middle_friction(&from, t + half, h, report)?;
        self.projection(t + half, half, report)?;
        mix(&mut flow, -1.0, &self.u, 2.0);
        mix(&mut from, -1.0, &self.u, 2.0);
        std::mem::swap(&mut self.u, &mut from);
        self.bodies().iter_mut().zip(&bodies).for_each(|(body, before)| body.reflect(before));
        self.solids.iter_mut().for_each(|solids| solids.follow());
        self.advection_by(Some(&mut flow), t + half, half)?;
        from.parts.into_iter().chain(flow.parts).for_each(|part| self.solver.spare.keep(part));
        self.settle(end)?;
        // The pressure of a step is all that it has taken.
        let middle = self.pressure.data.to_vec();
        self.projection(t + h, h, report)?;
        self.pressure.data.iter_mut().zip(middle).for_each(|(p, middle)| *p += middle);
        Ok(())
    }

    /// From `start` and u = start + h/2 f to the velocity at the middle of a step with viscosity, before its pressure; by a scheme that leaves
    /// nothing of what is stiff.                                                                         (gas.21)
    ///
    /// Beside walls the pressure balances viscosity, so that the last one acts meanwhile: the projection gives it back and takes the new one.
    fn middle_friction(&mut self, start: &Vectors, t: f64, h: f64, report: &mut StepReport) -> Result<(), Failure> {
        if self.settings.viscosity == 0.0 {
            return Ok(());
        }
        self.weigh();
        self.push_by_pressure(0.5 * h);
        let pushed = copy(&self.u, &mut self.solver.spare)?;
        let gamma = 1.0 - FRAC_1_SQRT_2;
        let c = (1.0 - gamma) / gamma;
        mix(&mut self.u, 2.0 * gamma, start, 1.0 - 2.0 * gamma);
        self.friction(t, gamma * h, report)?;
        mix(&mut self.u, c, &pushed, 2.0 * gamma);
        mix(&mut self.u, 1.0, start, 1.0 - c - 2.0 * gamma);
        self.friction(t, gamma * h, report)?;
        mix(&mut self.u, 0.5, start, 0.5);
        pushed.parts.into_iter().for_each(|part| self.solver.spare.keep(part));
        self.push_by_pressure(-0.5 * h);
        Ok(())
    }

    /// u -= h grad p/rho
    fn push_by_pressure(&mut self, h: f64) {
        let Self { u, pressure, settings, densities, .. } = self;
        let scale = (h / settings.density) as Real;
        let q: Vec<Real> = pressure.data.iter().map(|p| scale * p).collect();
        subtract_gradient(u, &q, Beyond::open(&settings.sides), densities.as_ref().map(|densities| &densities.light));
    }
}
