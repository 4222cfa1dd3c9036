//! Features act on whole columns of masses beside a scheme. Their trait names the stages of a sub-step at which they may, in order.

use super::core::Core;
use crate::system::Archive;
use tumble_interface::engine::StepReport;

/// A span of time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Its start [s].
    pub t: f64,
    /// Its length [s].
    pub h: f64,
}

impl Span {
    /// Its end [s].
    pub fn end(self) -> f64 {
        self.t + self.h
    }
}

/// Physics that is neither an element nor a force on single masses. A feature that changes positions or velocities clears
/// `core.memory.ready`, so that the scheme starts anew from them.
pub trait Feature: Send + Sync {
    /// Before an exchange interval from t on.
    fn begin(&mut self, _core: &mut Core, _t: f64) {}

    /// Before a sub-step; an adaptive scheme may end it earlier.
    fn before(&mut self, _core: &mut Core, _step: Span) {}

    /// In a sub-step, once masses have been moved to its end.
    fn moved(&mut self, _core: &mut Core, _step: Span) {}

    /// In a sub-step, in each sweep over positions.
    fn sweep(&mut self, _core: &mut Core) {}

    /// In a sub-step of a scheme without sweeps, once masses have been moved; changes velocities as well.
    fn relax(&mut self, _core: &mut Core, _step: Span) {}

    /// After a sub-step, its contact with solids included.
    fn after(&mut self, _core: &mut Core, _step: Span, _report: &mut StepReport) {}

    /// Writes its state.
    fn save(&self, _core: &Core, _archive: &mut Archive) {}

    /// Reads it back; `None` if it is not of this system.
    fn restore(&mut self, _core: &mut Core, _archive: &mut Archive) -> Option<()> {
        Some(())
    }
}
