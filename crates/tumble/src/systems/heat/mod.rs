//! Heat in bodies on grids.
//!
//!   rho c T' = div(k grad T) + sources                                                                (heat.1)
//!
//! Temperatures stand at cells, fluxes on faces, each of which two cells share: what leaves one enters the other. Each body has its
//! own scheme: forward Euler (limit (heat.7)), backward Euler or the trapezoid by the solvers of pressure, or cosine series, exact in
//! time. Verified by crates/tumble-f64/tests/heat.rs.

mod body;
mod pass;

pub use body::{Boundary, HeatedBody, Material, Plan, Source};
pub use pass::{Cells, Pass};

use crate::exchange::{Exchange, SystemId, Turn};
use crate::integrators::equal_steps;
use crate::integrators::stability::{Mode, limits};
use crate::math::Real;
use crate::state::{Field, Place};
use crate::system::{Archive, Part, System};
use tumble_interface::engine::{Ledger, Limit, Share, Stability, StepReport};
use tumble_interface::error::Breakdown;
use tumble_interface::scene::{HeatScheme, Integrator};
use tumble_interface::{Column, StepError};

/// Part of the longest stable step that is taken where the scene names none.
pub const SAFE: f64 = 0.7;

/// How the system steps.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Settings {
    /// Name in the scene.
    pub name: String,
    /// Sub-steps of an interval.
    pub substeps: Option<u32>,
    /// Longest sub-step [s].
    pub step: Option<f64>,
}

/// Bodies that conduct heat.
pub struct Heat {
    settings: Settings,
    bodies: Vec<HeatedBody>,
    /// Index of the first flux of each body's boundaries in the exchange.
    surfaces: Vec<usize>,
    watched: bool,
}

impl Heat {
    /// A system of bodies; what enters through their boundaries is told to the exchange as fluxes.
    pub fn new(settings: Settings, bodies: Vec<HeatedBody>, id: SystemId, exchange: &mut Exchange) -> Self {
        let mut surfaces = Vec::new();
        for body in &bodies {
            let mut first = None;
            for boundary in &body.plan.boundaries {
                let at = exchange.open_flux(id, format!("{} {}", body.plan.name, boundary.name));
                first = first.or(Some(at));
            }
            surfaces.push(first.unwrap_or(0));
        }
        Self { settings, bodies, surfaces, watched: false }
    }

    /// Sub-steps of an interval dt [s]: those that the scene names, or as many as its explicit bodies need.
    fn steps(&self, dt: f64) -> u32 {
        let limit = self.bodies.iter().map(HeatedBody::limit).fold(f64::INFINITY, f64::min);
        match (self.settings.substeps, self.settings.step) {
            (Some(n), _) => n,
            (None, Some(step)) => equal_steps(dt, step) as u32,
            (None, None) => equal_steps(dt, SAFE * limit) as u32,
        }
    }

    fn broken(&self, t: f64, h: f64) -> Option<StepError> {
        self.bodies.iter().find_map(|body| {
            // The sum of all is finite if they are, and found much faster.
            if body.stored().is_finite() {
                return None;
            }
            let points = body.t.points();
            let bad = body.t.each().find(|at| !body.t.value(*at).is_finite())?;
            Some(StepError::NotFinite(Box::new(Breakdown {
                system: self.settings.name.clone(),
                object: body.plan.name.clone(),
                column: "temperature".into(),
                index: bad[0] + points[0] * (bad[1] + points[1] * bad[2]),
                id: None,
                cell: Some((bad, body.plan.grid.point(Place::Cell, bad))),
                time: t,
                integrator: integrator(body.plan.scheme).name().into(),
                step: h,
                stable_step: body.limit(),
                energy_ratio: None,
                cause: None,
            })))
        })
    }
}

/// The scheme by the name that it has for differential equations: the trapezoid is, for linear ones, the implicit midpoint, and series
/// are as stable as that.
fn integrator(scheme: HeatScheme) -> Integrator {
    match scheme {
        HeatScheme::Explicit => Integrator::ForwardEuler,
        HeatScheme::Implicit => Integrator::ImplicitEuler,
        HeatScheme::Trapezoid | HeatScheme::Spectral => Integrator::ImplicitMidpoint,
    }
}

impl System for Heat {
    fn name(&self) -> &str {
        &self.settings.name
    }

    fn absorb(&mut self, _exchange: &mut Turn<'_>) {}

    fn advance(&mut self, t: f64, dt: f64, exchange: &mut Turn<'_>, go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError> {
        let mut report = StepReport::default();
        let n = self.steps(dt);
        let h = dt / f64::from(n);
        let before: Vec<Vec<f64>> = self.bodies.iter().map(|body| body.come.clone()).collect();
        for i in 0..n {
            if !go_on() {
                break;
            }
            let now = t + f64::from(i) * h;
            for body in &mut self.bodies {
                body.step(now, h, &mut report);
            }
            report.stepped(h);
            if self.watched
                && let Some(error) = self.broken(now + h, h)
            {
                return Err(error);
            }
        }
        for ((body, before), first) in self.bodies.iter().zip(before).zip(&self.surfaces) {
            for i in 0..body.plan.boundaries.len() {
                exchange.flow(first + i, body.come[i] - before[i], 0.0);
            }
        }
        Ok(report)
    }

    fn publish(&mut self, _t: f64, _exchange: &mut Turn<'_>) {}

    fn columns(&self, _t: f64, names: &[&str], out: &mut Vec<Column>) {
        for body in &self.bodies {
            let grid = body.plan.grid;
            let points: Vec<usize> = grid.axes().map(|a| grid.n[a]).collect();
            let mut add = |name: &str, data: Vec<Real>| out.push(Column::on_grid(&body.plan.name, name, points.clone(), data));
            for name in names {
                match *name {
                    "temperature" => {
                        let whole = |t: Real| (f64::from(t) + body.reference) as Real;
                        add("temperature", body.t.each().map(|at| whole(body.t.value(at))).collect());
                    }
                    "flux" => add("flux", body.flux(body.time)),
                    _ => {}
                }
            }
        }
    }

    fn topology(&self, out: &mut Vec<Column>) {
        for body in &self.bodies {
            out.extend(body.plan.grid.columns(&body.plan.name));
        }
    }

    fn ledger(&self, t: f64) -> Ledger {
        let mut total = Ledger { time: t, ..Ledger::default() };
        self.bodies.iter().for_each(|body| total.add_system(&ledger(body, t)));
        total
    }

    fn shares(&self, t: f64) -> Vec<Share> {
        let share =
            |body: &HeatedBody| Share { system: self.settings.name.clone(), object: body.plan.name.clone(), ledger: ledger(body, t) };
        self.bodies.iter().map(share).collect()
    }

    fn breakdown(&mut self, t: f64) -> Option<StepError> {
        self.broken(t, 0.0)
    }

    fn watch(&mut self, on: bool) {
        self.watched = on;
    }

    fn stability(&mut self, dt: f64, _go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability> {
        let worst = self.bodies.iter().max_by(|a, b| a.fastest().total_cmp(&b.fastest()))?;
        let first = self.bodies.iter().find(|b| b.plan.scheme == HeatScheme::Explicit).unwrap_or(worst);
        let mode = Mode { frequency: 0.0, damping: worst.fastest() };
        let of = |integrator| {
            let (stable, usable) = limits(integrator, &[mode]);
            Limit { integrator, stable, usable }
        };
        let known = [Integrator::ForwardEuler, Integrator::ImplicitEuler, Integrator::ImplicitMidpoint];
        Some(Stability {
            system: self.settings.name.clone(),
            integrator: integrator(first.plan.scheme),
            step: dt / f64::from(self.steps(dt)),
            frequency: 0.0,
            damping: mode.damping,
            damping_max: mode.damping,
            culprit: None,
            limits: known.map(of).to_vec(),
        })
    }

    fn save(&self, archive: &mut Archive) {
        for body in &self.bodies {
            archive.push_field("temperature", &body.t);
            let mut numbers = body.come.clone();
            numbers.push(body.time);
            archive.push("heat", Part::Numbers(numbers));
        }
    }

    fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        for body in &mut self.bodies {
            archive.field("temperature", &mut body.t)?;
            let mut come = archive.numbers("heat")?;
            let time = come.pop()?;
            (come.len() == body.come.len()).then_some(())?;
            (body.come, body.time) = (come, time);
        }
        Some(())
    }

    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool> {
        let body = self.bodies.iter_mut().find(|b| b.plan.name == object)?;
        let reference = body.reference;
        let values: Vec<Real> = values.iter().map(|t| (t - reference) as Real).collect();
        Some(column == "temperature" && Field::set(&mut body.t, &values).is_ok())
    }
}

fn ledger(body: &HeatedBody, t: f64) -> Ledger {
    Ledger { time: t, heat: Some(body.stored()), heat_in: Some(body.come.iter().sum()), ..Ledger::default() }
}
