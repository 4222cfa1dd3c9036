//! Stable Fluids: incompressible fluids on staggered grids, with smoke and warmth that they carry.
//!
//!   du/dt + u . grad u = -grad p/rho + nu lap u + f,   div u = 0                                              (gas.1)
//!
//! split into four parts, each of which is stable for every step ([`Fluid::step`]): forces, viscosity, projection, advection.
//!
//! Source: [stam1999]; tests: crates/tumble-f64/tests/gas.rs; limits: large steps damp (grids.17), and the split is of first order
//! in the step.

mod confinement;
mod densities;
mod fire;
mod fluid;
mod forces;
mod ledger;
mod reflection;
mod settings;
mod sources;

pub use fire::{Fire, Flame};
pub use fluid::{Failed, Fluid};
pub use settings::Settings;
pub use sources::{Cover, Source};

use crate::exchange::Turn;
use crate::fluids::hold;
use crate::integrators::equal_steps;
use crate::state::Vectors;
use crate::system::{Archive, System};
use tumble_interface::engine::{Ledger, Share, Stability, StepReport, Worst};
use tumble_interface::{Column, StepError};

/// Sub-steps of an exchange interval at most.
const MOST_STEPS: f64 = 1e6;

/// Fluids that step alike, each in a box of its own.
pub struct Gas {
    name: String,
    substeps: Option<u32>,
    step: Option<f64>,
    fluids: Vec<Fluid>,
    watched: bool,
}

impl Gas {
    /// A system of these fluids; `substeps` of an interval, a largest `step` [s], or steps by the Courant number of each.
    pub fn new(name: String, substeps: Option<u32>, step: Option<f64>, fluids: Vec<Fluid>) -> Self {
        Self { name, substeps, step, fluids, watched: false }
    }

    /// The next sub-step [s] with this much of an interval dt left.
    fn next_step(&self, fluid: &Fluid, t: f64, dt: f64, left: f64) -> Result<f64, StepError> {
        if let Some(n) = self.substeps.map(f64::from).or(self.step.map(|step| equal_steps(dt, step))) {
            return Ok(dt / n);
        }
        let n = (left / fluid.courant_step(left)).ceil().max(1.0);
        if n <= MOST_STEPS {
            return Ok(left / n);
        }
        if let Some(error) = fluid.broken(&self.name, t) {
            return Err(error);
        }
        let what = format!(
            "gas \"{}\" moves at {:.2e} m/s and would need {n:.1e} sub-steps; raise courant, set substeps, or calm it",
            fluid.name,
            fluid.speed()
        );
        Err(StepError::Capacity { system: self.name.clone(), time: t, what })
    }
}

impl System for Gas {
    fn name(&self) -> &str {
        &self.name
    }

    fn version(&self) -> u32 {
        2
    }

    fn absorb(&mut self, _exchange: &mut Turn<'_>) {}

    fn advance(&mut self, t: f64, dt: f64, exchange: &mut Turn<'_>, go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError> {
        let mut report = StepReport::default();
        for f in 0..self.fluids.len() {
            let taken = self.fluids[f].take_surfaces(exchange.surfaces());
            taken.map_err(|failure| self.fluids[f].failed(failure).within(&self.name, t))?;
            self.fluids[f].set_gravity(t);
            self.fluids[f].listen(exchange);
            let mut done = 0.0;
            while dt - done > 1e-9 * dt {
                if !go_on() {
                    return Ok(report);
                }
                self.fluids[f].set_gravity(t + done);
                let h = self.next_step(&self.fluids[f], t + done, dt, dt - done)?;
                let fluid = &mut self.fluids[f];
                fluid.set_gravity(t + done + 0.5 * h);
                fluid.step(t + done, h, t + (done + h), &mut report).map_err(|e| e.within(&self.name, t + done + h))?;
                done += h;
                report.stepped(h);
                if self.watched
                    && let Some(error) = fluid.broken(&self.name, t + done)
                {
                    return Err(error);
                }
            }
            self.fluids[f].finish(t + dt, &mut report).map_err(|e| e.within(&self.name, t + dt))?;
            self.fluids[f].tell(exchange);
        }
        Ok(report)
    }

    fn publish(&mut self, t: f64, exchange: &mut Turn<'_>) {
        for fluid in &mut self.fluids {
            // Values beyond the sides are in no snapshot.
            hold(&mut fluid.u, &fluid.settings.sides, t);
            exchange.publish_field(&fluid.name, "velocity", t, || fluid.u.clone());
            if let Some(smoke) = &fluid.smoke {
                exchange.publish_field(&fluid.name, "smoke", t, || Vectors { parts: vec![smoke.clone()] });
            }
        }
    }

    fn columns(&self, _t: f64, names: &[&str], out: &mut Vec<Column>) {
        self.fluids.iter().for_each(|fluid| fluid.columns(names, out));
        if names.contains(&"force") {
            out.extend(self.fluids.iter().flat_map(Fluid::forces_on));
        }
    }

    fn topology(&self, out: &mut Vec<Column>) {
        self.fluids.iter().for_each(|fluid| fluid.topology(out));
    }

    fn ledger(&self, t: f64) -> Ledger {
        let mut total = Ledger { time: t, ..Ledger::default() };
        self.fluids.iter().for_each(|fluid| total.add_system(&fluid.ledger(t)));
        total
    }

    fn shares(&self, t: f64) -> Vec<Share> {
        let share = |fluid: &Fluid| Share { system: self.name.clone(), object: fluid.name.clone(), ledger: fluid.ledger(t) };
        self.fluids.iter().map(share).collect()
    }

    fn worst(&self, _t: f64) -> Vec<Worst> {
        self.fluids.iter().flat_map(Fluid::worst).collect()
    }

    fn breakdown(&mut self, t: f64) -> Option<StepError> {
        self.fluids.iter().find_map(|fluid| fluid.broken(&self.name, t))
    }

    fn watch(&mut self, on: bool) {
        self.watched = on;
    }

    /// Every step is stable.
    fn stability(&mut self, _dt: f64, _go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability> {
        None
    }

    fn save(&self, archive: &mut Archive) {
        self.fluids.iter().for_each(|fluid| fluid.save(archive));
    }

    fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        self.fluids.iter_mut().try_for_each(|fluid| fluid.restore(archive))
    }

    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool> {
        Some(self.fluids.iter_mut().find(|f| f.name == object)?.write(column, values))
    }
}
