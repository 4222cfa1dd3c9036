//! Points and frames that are held for some time.

use super::core::Core;
use super::feature::{Feature, Span};
use crate::math::{Quat, Real, ZERO};
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

/// A row that is held for some time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hold {
    /// The row.
    pub row: usize,
    /// When.
    pub times: Times,
    /// Of a frame at the end of a rod, that of the segment there, and its turn relative to it when it is taken hold of.
    pub segment: Option<(usize, Quat<f64>)>,
}

/// Rows that are held for some time; a row may be there more than once.
pub struct Holds {
    list: Vec<Hold>,
    /// Which of them are in force.
    active: Vec<bool>,
}

impl Holds {
    /// For these rows, as they are held at the start.
    pub fn new(mut list: Vec<Hold>) -> Self {
        list.sort_by_key(|hold| hold.row);
        Self { active: list.iter().map(|hold| hold.times.contain(0.0)).collect(), list }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Whether a row is held at times only.
    pub fn contain(&self, row: usize) -> bool {
        self.list.binary_search_by_key(&row, |hold| hold.row).is_ok()
    }

    /// Whether a row is held.
    fn held(&self, row: usize) -> bool {
        self.list.iter().zip(&self.active).any(|(hold, active)| hold.row == row && *active)
    }

    /// The first time after t at which something is held or let go [s]; infinite if there is none.
    pub fn next_change(&self, t: f64) -> f64 {
        let changes = self.list.iter().flat_map(|hold| [hold.times.from, hold.times.until]);
        // Not one that rounding puts beside t.
        changes.filter(|change| *change > t + 1e-9 * t.abs().max(1.0)).fold(f64::INFINITY, f64::min)
    }

    /// Every row, the inverse of its mass or inertia, and whether it is held: those that are held come last.
    fn rows(&self, masses: &Masses) -> Vec<(usize, Real, bool)> {
        let one = |held: bool| {
            let some = self.list.iter().zip(&self.active).filter(move |(_, active)| **active == held);
            some.map(move |(hold, _)| {
                let mass = masses.mass[hold.row];
                (hold.row, if held || mass == 0.0 { 0.0 } else { 1.0 / mass }, held)
            })
        };
        one(false).chain(one(true)).collect()
    }

    /// Holds rows where that is in force, and lets the others go.
    pub fn apply(&self, state: &mut State, masses: &mut Masses) {
        for (row, inverse, held) in self.rows(masses) {
            if masses.frames.contains(row) {
                masses.inverse_inertia[row - masses.frames.start] = inverse;
            } else {
                state.x[row][3] = inverse;
            }
            if held {
                state.v[row] = ZERO;
            }
        }
    }

    /// Tells constraints which frames are held.
    pub fn tell(&self, core: &mut Core) {
        let frames = core.laws.masses.frames;
        for (row, inverse, _) in self.rows(&core.laws.masses).into_iter().filter(|(row, ..)| frames.contains(*row)) {
            core.constraints.iter_mut().for_each(|constraints| constraints.set_inverse(row, inverse));
        }
    }
}

impl Feature for Holds {
    fn before(&mut self, core: &mut Core, step: Span) {
        if self.list.is_empty() {
            return;
        }
        let active: Vec<bool> = self.list.iter().map(|hold| hold.times.cover(step)).collect();
        if active != self.active {
            for (hold, _) in self.list.iter().zip(&active).filter(|(_, now)| **now) {
                if let Some((segment, turn)) = hold.segment.filter(|_| !self.held(hold.row)) {
                    let turned = Quat::from_row(core.state.x[segment].map(f64::from)) * turn;
                    core.state.x[hold.row] = turned.row().map(|q| q as Real);
                }
            }
            self.active = active;
            core.memory.ready = false;
            core.regrouped += 1;
            self.tell(core);
        }
        self.apply(&mut core.state, &mut core.laws.masses);
    }

    fn save(&self, _core: &Core, archive: &mut Archive) {
        if !self.list.is_empty() {
            archive.push("holds", Part::Numbers(self.active.iter().map(|active| f64::from(u8::from(*active))).collect()));
        }
    }

    fn restore(&mut self, core: &mut Core, archive: &mut Archive) -> Option<()> {
        if !self.list.is_empty() {
            let numbers = archive.numbers("holds").filter(|numbers| numbers.len() == self.list.len())?;
            self.active = numbers.iter().map(|number| *number == 1.0).collect();
            self.apply(&mut core.state, &mut core.laws.masses);
            self.tell(core);
        }
        Some(())
    }
}
