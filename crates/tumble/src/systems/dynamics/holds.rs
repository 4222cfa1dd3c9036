//! Points and frames that are held for some time.

use super::core::Core;
use super::feature::{Feature, Span};
use crate::math::ZERO;
use crate::state::{Masses, State};
use crate::system::{Archive, Part};

/// From when until when something is held [s].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Times {
    /// From when.
    pub from: f64,
    /// Until when.
    pub until: f64,
}

impl Times {
    /// Always.
    pub const ALWAYS: Self = Self { from: 0.0, until: f64::INFINITY };

    /// Whether that is at a time [s].
    pub fn contain(self, t: f64) -> bool {
        self.from <= t && t < self.until
    }

    /// Whether it is in a sub-step: a sub-step that a change falls into belongs to what holds in its middle.
    pub fn cover(self, step: Span) -> bool {
        self.contain(step.t + 0.5 * step.h)
    }
}

/// Rows and the times at which they are held; a row may have several.
pub struct Holds {
    list: Vec<(usize, Times)>,
    /// Which of them are in force.
    active: Vec<bool>,
}

impl Holds {
    /// For these rows, which it holds as at the start.
    pub fn new(list: Vec<(usize, Times)>, state: &mut State, masses: &mut Masses) -> Self {
        let active = list.iter().map(|(_, times)| times.contain(0.0)).collect::<Vec<_>>();
        apply(&list, &active, state, masses);
        Self { list, active }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Whether a row is held at times only.
    pub fn contain(&self, row: usize) -> bool {
        self.list.iter().any(|(held, _)| *held == row)
    }

    /// The first time after t at which something is held or let go [s]; infinite if there is none.
    pub fn next_change(&self, t: f64) -> f64 {
        let changes = self.list.iter().flat_map(|(_, times)| [times.from, times.until]);
        // Not one that rounding puts beside t.
        changes.filter(|change| *change > t + 1e-9 * t.abs().max(1.0)).fold(f64::INFINITY, f64::min)
    }
}

/// Holds rows where that is in force, and lets the others go.
fn apply(list: &[(usize, Times)], active: &[bool], state: &mut State, masses: &mut Masses) {
    for held in [false, true] {
        for (row, _) in list.iter().zip(active).filter(|(_, active)| **active == held).map(|(hold, _)| hold) {
            let mass = masses.mass[*row];
            let inverse = if held || mass == 0.0 { 0.0 } else { 1.0 / mass };
            if masses.frames.contains(*row) {
                masses.inverse_inertia[row - masses.frames.start] = inverse;
            } else {
                state.x[*row][3] = inverse;
            }
            if held {
                state.v[*row] = ZERO;
            }
        }
    }
}

impl Feature for Holds {
    fn before(&mut self, core: &mut Core, step: Span) {
        if self.list.is_empty() {
            return;
        }
        let active: Vec<bool> = self.list.iter().map(|(_, times)| times.cover(step)).collect();
        if active != self.active {
            self.active = active;
            core.memory.ready = false;
            core.regrouped += 1;
        }
        apply(&self.list, &self.active, &mut core.state, &mut core.laws.masses);
    }

    fn save(&self, _core: &Core, archive: &mut Archive) {
        if !self.list.is_empty() {
            archive.push("holds", Part::Numbers(self.active.iter().map(|active| f64::from(u8::from(*active))).collect()));
        }
    }

    fn restore(&mut self, core: &mut Core, archive: &mut Archive) -> Option<()> {
        if !self.list.is_empty() {
            let numbers = archive.numbers("holds")?;
            self.active = numbers.iter().map(|number| *number == 1.0).collect();
            apply(&self.list, &self.active, &mut core.state, &mut core.laws.masses);
        }
        Some(())
    }
}
