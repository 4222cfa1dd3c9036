//! Liquids with a free surface: particles carry them, a grid finds their pressure.
//!
//!   du/dt + u . grad u = g - grad p/rho,   div u = 0,   p = 0 on the surface                                              (pic.0)
//!
//! A step ([`Tank::step`]): velocities of particles to faces, gravity, pressure, velocities back to particles, which go with them. All sums are
//! in the order of the particles, which are sorted by cell.
//!
//! Source: [harlow1964] for particles in cells, [brackbill1986] and [zhu2005] for FLIP, [jiang2015] for APIC, [kugelstadt2021] for the volume;
//! tests: crates/tumble-f64/tests/liquid.rs.

mod extend;
mod flow;
mod ledger;
mod level;
mod particles;
mod paths;
mod pressure;
mod relax;
mod skin;
mod splat;
mod stencil;
mod tank;
mod tension;
mod viscosity;
mod whitewater;

pub use flow::{Inflow, Openings, Region};
pub use particles::Particles;
pub use pressure::Accuracy;
pub use tank::{Settings, Tank, Transfer};
pub use tension::longest;
pub use whitewater::{Kind, Settings as WhitewaterSettings, Whitewater};

use crate::exchange::Turn;
use crate::integrators::equal_steps;
use crate::system::{Archive, System};
use tumble_interface::engine::{Ledger, Share, Stability, StepReport, Worst};
use tumble_interface::{Column, StepError};

/// Sub-steps of an exchange interval at most.
const MOST_STEPS: f64 = 1e6;

/// Liquids that step alike, each in a box of its own.
pub struct Liquid {
    name: String,
    substeps: Option<u32>,
    step: Option<f64>,
    tanks: Vec<Tank>,
    watched: bool,
}

impl Liquid {
    /// A system of these liquids; `substeps` of an interval, a largest `step` [s], or steps by the Courant number of each.
    pub fn new(name: String, substeps: Option<u32>, step: Option<f64>, tanks: Vec<Tank>) -> Self {
        Self { name, substeps, step, tanks, watched: false }
    }

    fn capacity(&self, time: f64, tank: &Tank, what: String) -> StepError {
        StepError::Capacity { system: self.name.clone(), time, what: format!("liquid \"{}\": {what}", tank.name) }
    }

    /// The next sub-step [s] with this much of an interval dt left.
    fn next_step(&self, tank: &Tank, t: f64, dt: f64, left: f64) -> Result<f64, StepError> {
        if let Some(n) = self.substeps.map(f64::from).or(self.step.map(|step| equal_steps(dt, step))) {
            return Ok(dt / n);
        }
        let n = (left / tank.courant_step(t, left)).ceil().max(1.0);
        if n <= MOST_STEPS {
            return Ok(left / n);
        }
        if let Some(error) = tank.broken(&self.name, t) {
            return Err(error);
        }
        let what = format!("it moves at {:.2e} m/s and would need {n:.1e} sub-steps; raise courant, or set substeps", tank.fastest());
        Err(self.capacity(t, tank, what))
    }
}

impl System for Liquid {
    fn name(&self) -> &str {
        &self.name
    }

    fn absorb(&mut self, _exchange: &mut Turn<'_>) {}

    fn advance(&mut self, t: f64, dt: f64, exchange: &mut Turn<'_>, go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError> {
        let mut report = StepReport::default();
        for i in 0..self.tanks.len() {
            self.tanks[i].take_surfaces(exchange.surfaces());
            self.tanks[i].listen(t, exchange);
            let mut done = 0.0;
            while dt - done > 1e-9 * dt {
                if !go_on() {
                    return Ok(report);
                }
                let h = self.next_step(&self.tanks[i], t + done, dt, dt - done)?;
                let (start, end) = (t + done, t + (done + h));
                if let Err(failure) = self.tanks[i].step(start, h, end, &mut report) {
                    let tank = &self.tanks[i];
                    return Err(tank.broken(&self.name, end).unwrap_or_else(|| self.capacity(end, tank, failure.to_string())));
                }
                done += h;
                report.stepped(h);
                if self.watched
                    && let Some(error) = self.tanks[i].broken(&self.name, end)
                {
                    return Err(error);
                }
            }
            self.tanks[i].tell(exchange);
        }
        Ok(report)
    }

    fn publish(&mut self, _t: f64, _exchange: &mut Turn<'_>) {}

    fn columns(&self, _t: f64, names: &[&str], out: &mut Vec<Column>) {
        for tank in &self.tanks {
            tank.columns(names, out);
            tank.skin_columns(names, out);
            tank.whitewater_columns(names, out);
            tank.cell_columns(names, out);
        }
        if names.contains(&"force") {
            out.extend(self.tanks.iter().flat_map(Tank::forces_on));
        }
    }

    fn topology(&self, out: &mut Vec<Column>) {
        self.tanks.iter().for_each(|tank| tank.topology(out));
    }

    fn ledger(&self, t: f64) -> Ledger {
        let mut total = Ledger { time: t, ..Ledger::default() };
        self.tanks.iter().for_each(|tank| total.add_system(&tank.ledger(t)));
        total
    }

    fn shares(&self, t: f64) -> Vec<Share> {
        let share = |tank: &Tank| Share { system: self.name.clone(), object: tank.name.clone(), ledger: tank.ledger(t) };
        self.tanks.iter().map(share).collect()
    }

    fn worst(&self, _t: f64) -> Vec<Worst> {
        self.tanks.iter().filter_map(Tank::worst).collect()
    }

    fn breakdown(&mut self, t: f64) -> Option<StepError> {
        self.tanks.iter().find_map(|tank| tank.broken(&self.name, t))
    }

    fn watch(&mut self, on: bool) {
        self.watched = on;
    }

    /// Every step is stable.
    fn stability(&mut self, _dt: f64, _go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability> {
        None
    }

    fn save(&self, archive: &mut Archive) {
        self.tanks.iter().for_each(|tank| tank.save(archive));
    }

    fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        self.tanks.iter_mut().try_for_each(|tank| tank.restore(archive))
    }

    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool> {
        Some(self.tanks.iter_mut().find(|tank| tank.name == object)?.write(column, values))
    }
}
