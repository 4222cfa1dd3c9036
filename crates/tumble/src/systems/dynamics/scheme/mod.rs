//! How a sub-step finds positions and velocities: from forces, by an integrator, or by projecting predicted positions.

mod forces;
mod free_bodies;
mod projected;

pub use forces::Forces;
pub use projected::Projected;

use super::contact::Response;
use super::core::Core;
use super::feature::Span;
use super::features::Features;
use super::parts::Parts;
use super::settings::Settings;
use tumble_interface::engine::{Ledger, StepReport, UserIntegrator};
use tumble_interface::scene::Integrator;
use tumble_interface::{SceneError, StepError, Warning};

/// A scheme. Contact with solids and fracture, which follow its steps, are not its own.
pub trait Scheme: Send + Sync {
    /// One sub-step.
    fn step(&mut self, core: &mut Core, features: &mut Features, step: Span, report: &mut StepReport) -> Result<(), StepError>;

    /// Whether it chooses the lengths of its steps.
    fn is_adaptive(&self, _core: &Core) -> bool {
        false
    }

    /// One step of its own length from `rest.t` on, within the rest of an interval of length dt [s]; returns the length.
    fn adaptive_step(
        &mut self,
        core: &mut Core,
        features: &Features,
        rest: Span,
        dt: f64,
        report: &mut StepReport,
    ) -> Result<f64, StepError> {
        let _ = (core, features, dt, report);
        Ok(rest.h)
    }

    /// Corrects positions after a step, before contact with solids.
    fn correct(&mut self, core: &mut Core, features: &mut Features, step: Span, report: &mut StepReport);

    /// The part of contact that it leaves to the contact pass.
    fn response(&self, core: &Core) -> Response;

    /// Whether masses that feel no other may be stepped block by block.
    fn steps_alone(&self, core: &Core) -> bool;

    /// Whether the largest stable step follows from the modes of the system.
    fn has_stability_limit(&self) -> bool;

    /// The ledger, less energies that masses will never feel.
    fn felt(&self, ledger: &Ledger) -> Ledger {
        ledger.clone()
    }

    /// Warnings of what goes wrong in intervals of length dt [s] with so many sub-steps.
    fn doubts(&mut self, _core: &mut Core, _dt: f64, _steps: f64) -> Vec<Warning> {
        Vec::new()
    }

    /// A warning of long-range attachments that attach nothing.
    fn idle_attachments(&self, _core: &Core) -> Option<Warning> {
        None
    }

    /// Steps with a user's integrator from now on; `false` if it cannot.
    fn replace(&mut self, _integrator: Box<dyn UserIntegrator>) -> bool {
        false
    }
}

/// Whether the elements of a system are constraints on positions, and no forces.
pub fn projects(settings: &Settings) -> bool {
    settings.integrator == Integrator::PositionBased
}

/// Refuses parts that the scheme of a system does not know.
pub fn check(parts: &Parts, settings: &Settings) -> Result<(), SceneError> {
    if projects(settings) { projected::check(parts, settings) } else { forces::check(parts, settings) }
}
