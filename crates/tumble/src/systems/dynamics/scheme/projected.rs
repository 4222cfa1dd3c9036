//! Position-based dynamics: elements are no forces but constraints on positions, satisfied one after the other. The lines of a step are
//! those of Algorithm 1 of [bender2015], and free bodies keep their momenta (`free_bodies.rs`); constraints, and how far they are satisfied, are defined in `elements/constraints.rs`.
//!
//!   v += h f_ext/m,   x = x_old + h v,   n times: x += dx of each element,   v = (x - x_old)/h       (positions.1)
//!
//! One sweep over compliant elements a sub-step is a step of implicit Euler to first order in h [macklin2019]; unsatisfied elements
//! make things softer, and in steps much longer than the default shake stiff sheets. Verified in `tests/position_based.rs`.

use super::super::contact::Response;
use super::super::core::{BLOCK, Core};
use super::super::feature::Span;
use super::super::features::Features;
use super::super::parts::Parts;
use super::super::settings::Settings;
use super::Scheme;
use super::free_bodies::FreeBodies;
use crate::elements::{Constraints, LongRangeAttachments, Projection};
use crate::geometry::Walls;
use crate::integrators;
use crate::math::functions::pow;
use crate::math::parallel::{CHUNK, Tasks, chunks, max};
use crate::math::simd::{Kernel, Width, dispatch, packs};
use crate::math::{Quat, Real, Row, Vec3, ZERO, rotation, rows, sub, xyz, xyz64};
use crate::state::State;
use tumble_interface::check::short;
use tumble_interface::engine::{Ledger, StepReport};
use tumble_interface::scene::{PositionBased, Projection as ProjectionMode};
use tumble_interface::warning::{Code, Warning};
use tumble_interface::{SceneError, StepError};

/// Softening of rods by round-off, and the share of gravity that positions may lose to it, beyond which a scene is warned.
const SOFTER: f64 = 1.05;
const UNKNOWN: f64 = 0.1;
/// The longest sub-step of hanging rods is that of their whole weight; what hangs lower has less.
const SHAKES: f64 = 1.1;

/// Sweeps over projected elements.
pub struct Projected {
    words: PositionBased,
    attachments: Vec<LongRangeAttachments>,
    /// Accelerations of the predicted velocities; scratch.
    rates: Vec<Row>,
    /// Positions before a sweep; scratch.
    old: Vec<Row>,
    /// Positions before contact between surfaces; scratch.
    unpushed: Vec<Row>,
    free_bodies: FreeBodies,
}

/// Refuses long-range attachments that would hold broken pieces.
pub fn check(parts: &Parts, settings: &Settings) -> Result<(), SceneError> {
    if settings.sweeps.tethers.is_none() {
        return Ok(());
    }
    if let Some(path) = parts.tearing_surface() {
        let message = "tethers of the system would hold what has torn off; leave out one of them";
        return Err(SceneError::one(path, message));
    }
    if parts.has_breakable_links() || parts.has_breakable_rods() {
        let message = "would hold what has broken off, and something in the system has a break_strain; leave out one of them";
        return Err(SceneError::one(format!("system \"{}\".position_based.tethers", settings.name), message));
    }
    Ok(())
}

impl Projected {
    /// The sweeps of these settings, with long-range attachments.
    pub fn new(settings: &Settings, attachments: Vec<LongRangeAttachments>) -> Self {
        Self {
            words: settings.sweeps.clone(),
            attachments,
            rates: Vec::new(),
            old: Vec::new(),
            unpushed: Vec::new(),
            free_bodies: FreeBodies::default(),
        }
    }

    /// Forces that are no elements, predicted velocities and positions; `before` keeps where they start from.
    fn predict(&mut self, core: &mut Core, Span { t, h }: Span) -> Result<(), StepError> {
        let (Core { laws, state: State { x, v }, before, .. }, rates, step) = (core, &mut self.rates, h as Real);
        let (local, kinematics) = (laws.is_local(), laws.kinematics());
        laws.batches.iter_mut().for_each(|b| b.act_at_once(h));
        if !local {
            rates.resize(x.len(), ZERO);
            laws.rate(t, x, v, rates)?;
        }
        before.resize(x.len(), ZERO);
        let (laws, rates) = (&*laws, &*rates);
        let mut blocks: Vec<_> = x.chunks_mut(BLOCK).zip(v.chunks_mut(BLOCK)).zip(before.chunks_mut(BLOCK)).enumerate().collect();
        blocks.chunks_mut(CHUNK / BLOCK).in_parallel(|blocks| {
            for (c, ((x, v), before)) in blocks {
                let start = *c * BLOCK;
                if local {
                    let rates = &mut [ZERO; BLOCK][..x.len()];
                    laws.rate_alone(t, start, x, v, rates);
                    rows::axpy(v, step, rates);
                } else {
                    rows::axpy(v, step, &rates[start..start + x.len()]);
                }
                before.copy_from_slice(x);
                kinematics.drift(start, x, v, step);
            }
        });
        Ok(())
    }

    /// Sweeps over all elements, until they move nothing farther than the tolerance.
    fn sweep(&mut self, core: &mut Core, features: &mut Features, step: Span, report: &mut StepReport) {
        let words = &self.words;
        // n sweeps that each take back 1 - (1 - k)^(1/n) leave 1 - k of an error.
        let part = 1.0 - pow(1.0 - words.stiffness, 1.0 / f64::from(words.iterations));
        let plain = (words.projection == ProjectionMode::Plain).then_some(part as Real);
        for iteration in 0..words.iterations {
            if words.tolerance.is_some() {
                self.old.clone_from(&core.state.x);
            }
            let Core { state: State { x, .. }, laws, constraints, clamp, before, .. } = &mut *core;
            let walls = Walls { colliders: &laws.colliders, t: step.end() };
            let projection = Projection { h: step.h, before, iteration, iterations: words.iterations, plain, walls };
            constraints.iter_mut().for_each(|c| c.project(x, &projection));
            if let Some(clamp) = clamp {
                clamp.project(x, &projection);
            }
            self.attachments.iter().for_each(|attachments| attachments.project(x));
            if features.self_contact.is_some() && !self.free_bodies.is_empty() {
                self.unpushed.clone_from(&core.state.x);
                features.sweep(core);
                self.free_bodies.add_contact(core, &self.unpushed, step.h);
            } else {
                features.sweep(core);
            }
            report.sweeps += 1;
            let (x, old) = (&core.state.x, &self.old);
            let way = |i: usize| xyz64(sub(x[i], old[i])).norm();
            if words.tolerance.is_some_and(|most| max(x.len(), |range| range.map(way).fold(0.0, f64::max)) <= most) {
                break;
            }
        }
    }
}

/// Velocities from the ways of a sub-step: a point that no element has moved keeps its own to the last bit.
fn set_velocities(core: &mut Core, h: Real) {
    let Core { state: State { x, v }, before, laws, .. } = core;
    let kinematics = laws.kinematics();
    chunks(v, |start, v| {
        let rows = start..start + v.len();
        let (x, before) = (&x[rows.clone()], &before[rows]);
        let [first, frames, last] = kinematics.frames.cut(start, v.len());
        for points in [first, last] {
            dispatch(Velocities { v: &mut v[points.clone()], x: &x[points.clone()], before: &before[points], h });
        }
        for ((v, x), before) in v[frames.clone()].iter_mut().zip(&x[frames.clone()]).zip(&before[frames]) {
            if rotation::turn(*before, xyz(*v) * h) != *x {
                *v = turning(*before, *x, h);
            }
        }
    });
}

impl Scheme for Projected {
    fn step(&mut self, core: &mut Core, features: &mut Features, step: Span, report: &mut StepReport) -> Result<(), StepError> {
        core.keep_velocities();
        self.predict(core, step)?;
        self.free_bodies.begin(core);
        features.moved(core, step);
        self.sweep(core, features, step, report);
        set_velocities(core, step.h as Real);
        self.free_bodies.add_reactions(core);
        self.free_bodies.restore(core);
        core.memory.ready = true;
        Ok(())
    }

    /// Puts followers back, whose frames sweeps have scaled to length 1.
    fn correct(&mut self, core: &mut Core, features: &mut Features, step: Span, _: &mut StepReport) {
        features.moved(core, step);
    }

    fn response(&self, core: &Core) -> Response {
        let plain = (self.words.projection == ProjectionMode::Plain).then_some(self.words.stiffness);
        Response { lead: integrators::lead(core.integrator), penalty: false, plain }
    }

    fn steps_alone(&self, _: &Core) -> bool {
        true
    }

    fn has_stability_limit(&self) -> bool {
        false
    }

    /// Energy that is left in elements because sweeps ended early is no sign of an explosion.
    fn felt(&self, ledger: &Ledger) -> Ledger {
        Ledger { elastic: 0.0, ..ledger.clone() }
    }

    /// A position x is known to eps |x|/2, and an acceleration to eps |x|/(2 h²).                              (positions.5)
    fn doubts(&mut self, core: &mut Core, dt: f64, steps: f64) -> Vec<Warning> {
        if core.constraints.is_empty() {
            return Vec::new();
        }
        let h = dt / steps;
        let warning = |message: String| Warning::new(Code::RoundOff, format!("system \"{}\"", core.name), message);
        let softening = core.constraints.iter().map(|c| c.softening(h)).fold(1.0, f64::max);
        let soft = (softening > SOFTER).then(|| {
            let more = (steps * softening.sqrt()).ceil();
            warning(format!(
                "with rods in such short pieces and sub-steps of {} s, round-off lets the stiffest of them bend up to {} times as far as it \
                 should; take precision = \"double\", {more} sub-steps, or longer pieces",
                short(h),
                short(softening)
            ))
        });
        let points = core.laws.masses.points().flat_map(|points| &core.state.x[points]);
        let far = points.filter(|x| x[3] > 0.0).map(|x| xyz64(*x).norm()).fold(0.0, f64::max);
        let unknown = 0.5 * f64::from(Real::EPSILON) * far / (h * h);
        let gravity = core.laws.gravity.largest;
        let longest = core.constraints.iter().map(|c| c.longest_step(&core.state.x, gravity)).fold(f64::INFINITY, f64::min);
        let shakes = (h > SHAKES * longest).then(|| {
            let message = format!(
                "rods that hang in such short pieces shake in sub-steps of {} s, as their tension acts a sub-step late and their bending is too weak; \
                 take {} sub-steps, longer pieces, or stiffer bend",
                short(h),
                (dt / longest).ceil()
            );
            Warning::new(Code::TautRods, format!("system \"{}\"", core.name), message)
        });
        let lost = (gravity > 0.0 && unknown > UNKNOWN * gravity).then(|| {
            let fewer = (steps * (UNKNOWN * gravity / unknown).sqrt()).floor().max(1.0);
            warning(format!(
                "in sub-steps of {} s, and as far as {} m from the origin, positions tell accelerations to {} m/s² only; take precision = \
                 \"double\", at most {fewer} sub-steps, or put the scene near the origin",
                short(h),
                short(far),
                short(unknown)
            ))
        });
        soft.into_iter().chain(lost).chain(shakes).collect()
    }

    fn idle_attachments(&self, core: &Core) -> Option<Warning> {
        let idle = self.words.tethers.is_some() && self.attachments.is_empty();
        idle.then(|| {
            let message = "tie what hangs from pins by links, rods, membranes or fabric, and the system has nothing that does; pin some of \
                           it, or leave tethers out";
            Warning::new(Code::Unfelt, format!("system \"{}\".position_based.tethers", core.name), message)
        })
    }
}

/// v + ((x - x_old)/h - v) of points, as the change of the predicted velocity.
struct Velocities<'a> {
    v: &'a mut [Row],
    x: &'a [Row],
    before: &'a [Row],
    h: Real,
}

impl Kernel for Velocities<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        let (v, x, before) = (self.v.as_flattened_mut(), self.x.as_flattened(), self.before.as_flattened());
        let inverse_h = 1.0 / self.h;
        packs!(W, w, (0..v.len()), |i| {
            let here = &mut v[i..];
            let own = w.load(here);
            // The last numbers of rows, inverse masses, are the same in both.
            let predicted = w.load(&before[i..]) + w.splat(self.h) * own;
            w.store(own + w.splat(inverse_h) * (w.load(&x[i..]) - predicted), here);
        });
    }
}

/// The angular velocity in its own axes of a frame that goes from one orientation to another in the time h.
fn turning(from: Row, to: Row, h: Real) -> Row {
    let turn = Quat::from_row(from).conj() * Quat::from_row(to);
    let sign = if turn.w < 0.0 { -2.0 / h } else { 2.0 / h };
    let Vec3 { x, y, z } = turn.v * sign;
    [x, y, z, 0.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_that_turns_has_turned_at_its_velocity() {
        let q: Row = rotation::from_degrees([20.0, -50.0, 110.0]).row().map(|x| x as Real);
        let omega = Vec3 { x: 0.4, y: -1.1, z: 0.7 };
        let v = xyz(turning(q, rotation::turn(q, omega * 0.01), 0.01));
        // 2 sin(angle/2)/h = omega (1 - angle²/24).
        assert!((v - omega).norm() < 2e-4 && (v - omega).norm() < 1e-3 * omega.norm(), "{v:?}");
    }
}
