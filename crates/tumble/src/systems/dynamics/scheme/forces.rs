//! Forces under an integrator: x'' = f(x, v, t)/m. Conditions on positions alone are corrected after the step.

use super::super::contact::Response;
use super::super::core::Core;
use super::super::feature::Span;
use super::super::features::Features;
use super::super::implicit::{Implicit, Motion};
use super::super::parts::Parts;
use super::super::settings::Settings;
use super::Scheme;
use crate::elements::{Constraints, Projection};
use crate::geometry::Walls;
use crate::integrators::{self, Scratch, Step, adaptive_step};
use crate::math::parallel::sum;
use crate::math::{Real, Row, ZERO, axpy, sub, xyz64};
use crate::state::State;
use tumble_interface::check::short;
use tumble_interface::engine::{StepReport, UserIntegrator};
use tumble_interface::scene::{Adaptive, Integrator};
use tumble_interface::warning::{Code, Warning};
use tumble_interface::{SceneError, StepError};

/// Round-off of the forces of rods over their weight from which on a scene is warned: at 3 a rod bends as it should, at 130 a third as far.
const DROWNED: f64 = 20.0;

/// An integrator, or the user's in its place, with their storage between steps.
pub struct Forces {
    adaptive: Adaptive,
    implicit: Implicit,
    user: Option<Box<dyn UserIntegrator>>,
    scratch: Scratch,
    /// Positions before the clamp.
    unclamped: Vec<Row>,
}

/// Refuses parts that only projected elements can be.
pub fn check(parts: &Parts, settings: &Settings) -> Result<(), SceneError> {
    if let Some(path) = parts.global_constraint() {
        let message = "a constraint on all masses at once, which only position-based dynamics knows; set method = \"position_based\"";
        return Err(SceneError::one(path, message));
    }
    if settings.integrator.is_adaptive() && parts.has_hair_continuum() {
        let message = "hair that acts on itself needs steps of equal length; set another integrator";
        return Err(SceneError::one(format!("system \"{}\".integrator", settings.name), message));
    }
    if parts.has_breakable_rods() {
        let message = "rods with a break_strain break in position-based systems only; set integrator = \"position_based\"";
        return Err(SceneError::one(format!("system \"{}\".integrator", settings.name), message));
    }
    Ok(())
}

impl Forces {
    /// The integrator of these settings.
    pub fn new(settings: &Settings) -> Self {
        Self {
            adaptive: settings.adaptive.clone(),
            implicit: Implicit::new(settings.solver.clone(), settings.integrator == Integrator::ImplicitEuler),
            user: None,
            scratch: Scratch::default(),
            unclamped: Vec::new(),
        }
    }

    /// Keeps the start of a step for contact.
    fn keep_start(core: &mut Core, features: &Features) {
        if core.meets_solids() || features.self_contact.is_some() {
            core.keep_positions();
        }
        core.keep_velocities();
    }

    /// Shortens springs that are too long; velocities follow.
    fn clamp(&mut self, core: &mut Core, h: f64, report: &mut StepReport) {
        let Core { state, laws, clamp: Some(clamp), memory, .. } = core else { return };
        let masses = &laws.masses;
        let one = |v: &[Row], i: usize| 0.5 * f64::from(masses.mass[i]) * xyz64(v[i]).norm_sq();
        let kinetic =
            |v: &[Row]| masses.points().map(|points| sum(points.len(), |range| range.map(|i| one(v, points.start + i)).sum())).sum::<f64>();
        let energy = |state: &State| kinetic(&state.v) + laws.batches.iter().map(|b| b.energy(&state.x)).sum::<f64>();
        let was = energy(state);
        self.unclamped.clone_from(&state.x);
        let projection = Projection { h, before: &self.unclamped, iteration: 0, iterations: 1, plain: None, walls: Walls::default() };
        clamp.project(&mut state.x, &projection);
        let inverse_h = (1.0 / h) as Real;
        let mut moved = false;
        for i in masses.points().flatten() {
            let change = sub(state.x[i], self.unclamped[i]);
            if change != ZERO {
                state.v[i] = axpy(state.v[i], inverse_h, change);
                moved = true;
            }
        }
        if moved {
            memory.ready = false;
            report.clamped += was - energy(state);
        }
    }
}

impl Scheme for Forces {
    fn step(&mut self, core: &mut Core, features: &mut Features, step: Span, report: &mut StepReport) -> Result<(), StepError> {
        Self::keep_start(core, features);
        if let Some(user) = &mut self.user {
            user_step(user.as_mut(), core, step)?;
        } else {
            let Core { integrator, laws, state, memory, .. } = core;
            let equation = &mut Motion { laws, implicit: &mut self.implicit };
            let (Span { t, h }, ready, scratch) = (step, memory.ready, &mut self.scratch);
            let (x, v, memory) = (&mut state.x[..], &mut state.v[..], &mut memory.slices()[..]);
            integrators::step(*integrator, Step { equation, t, h, x, v, memory, ready, scratch, report })?;
        }
        core.memory.ready = true;
        Ok(())
    }

    fn is_adaptive(&self, core: &Core) -> bool {
        core.integrator.is_adaptive() && self.user.is_none()
    }

    fn adaptive_step(
        &mut self,
        core: &mut Core,
        features: &Features,
        rest: Span,
        dt: f64,
        report: &mut StepReport,
    ) -> Result<f64, StepError> {
        Self::keep_start(core, features);
        // The error of a step knows nothing of contact.
        let apart = features.self_contact.as_ref().map_or(f64::INFINITY, |contact| contact.longest_step(rest.h));
        let times = (rest.t, apart.max(self.adaptive.smallest * dt).min(rest.h), dt);
        let Core { integrator, laws, state, memory, .. } = core;
        let mut motion = Motion { laws, implicit: &mut self.implicit };
        let y = (&mut state.x[..], &mut state.v[..]);
        adaptive_step(*integrator, &self.adaptive, &mut motion, times, y, memory, &mut self.scratch, report)
    }

    fn correct(&mut self, core: &mut Core, features: &mut Features, step: Span, report: &mut StepReport) {
        features.moved(core, step);
        self.clamp(core, step.h, report);
        features.relax(core, step);
    }

    fn response(&self, core: &Core) -> Response {
        let penalty = self.implicit.sees_solids();
        // The path under a user's scheme is unknown, and masses that the penalty pushes have no constant acceleration.
        let lead = if self.user.is_some() || penalty { 0.0 } else { integrators::lead(core.integrator) };
        Response { lead, penalty: penalty && self.user.is_none(), plain: None }
    }

    fn steps_alone(&self, core: &Core) -> bool {
        self.user.is_none() && !core.integrator.is_implicit()
    }

    fn has_stability_limit(&self) -> bool {
        true
    }

    /// Forces of stiff rods are differences of places that single precision rounds: where that is more than their weight, Newton's method cannot tell
    /// what the weight does.
    fn doubts(&mut self, core: &mut Core, dt: f64, steps: f64) -> Vec<Warning> {
        let Core { laws, state: State { x, v }, integrator, name, .. } = core;
        if !integrator.is_implicit() || laws.masses.frames.start == laws.masses.frames.end {
            return Vec::new();
        }
        let ratio = self.implicit.noise_over_weight(laws, x, v, dt / steps).filter(|ratio| *ratio > DROWNED);
        let warning = |ratio: f64| {
            let message = format!(
                "round-off of forces is {} times the weight of everything in it, and Newton's method ends before that weight shows; use method = \
                 \"position_based\", or precision = \"double\" with solver.linear = \"cholesky\"",
                short(ratio)
            );
            Warning::new(Code::RoundOff, format!("system \"{name}\""), message)
        };
        ratio.map(warning).into_iter().collect()
    }

    fn replace(&mut self, integrator: Box<dyn UserIntegrator>) -> bool {
        self.user = Some(integrator);
        true
    }
}

/// A step of a user's integrator, which knows points alone.
fn user_step(user: &mut dyn UserIntegrator, core: &mut Core, Span { t, h }: Span) -> Result<(), StepError> {
    let Core { state, laws, .. } = core;
    let points: Vec<usize> = laws.masses.points().flatten().collect();
    let n = points.len();
    let (mut x, mut v) = (laws.masses.flat(&state.x), laws.masses.flat(&state.v));
    let mut acceleration = |t: f64, x: &[f64], v: &[f64]| -> Result<Vec<f64>, String> {
        if x.len() != 3 * n || v.len() != 3 * n {
            return Err(format!("acceleration takes {n} rows of three numbers"));
        }
        let rows = |from: &[f64], old: &[Row]| -> Vec<Row> {
            let mut rows = old.to_vec();
            for (i, p) in points.iter().zip(from.chunks_exact(3)) {
                rows[*i] = [p[0] as Real, p[1] as Real, p[2] as Real, old[*i][3]];
            }
            rows
        };
        let mut out = vec![ZERO; state.x.len()];
        laws.rate(t, &rows(x, &state.x), &rows(v, &state.v), &mut out).map_err(|e| e.to_string())?;
        Ok(laws.masses.flat(&out))
    };
    user.step(t, h, &mut x, &mut v, &mut acceleration).map_err(StepError::User)?;
    for ((i, x), v) in points.iter().zip(x.chunks_exact(3)).zip(v.chunks_exact(3)) {
        let w = state.x[*i][3];
        if w > 0.0 {
            state.x[*i] = [x[0] as Real, x[1] as Real, x[2] as Real, w];
            state.v[*i] = [v[0] as Real, v[1] as Real, v[2] as Real, 0.0];
        }
    }
    Ok(())
}
