//! Intervals that are repeated until systems agree about the impulses between them.                   (coupling.7)
//!
//! In each pass every system starts from the same state and takes x, what the pass before said that the others post to it:
//!
//!   x ← x + w (p(x) - x),   w ← -w r·(r' - r)/|r' - r|²,   r = p(x) - x
//!
//! with p(x), what they do post once systems have moved under x, and the relaxation w of Aitken, for each system by itself. What a pass leaves
//! of p - x is mail for the next interval, so that no impulse is lost, however far from agreement it ends.
//!
//! Source: [kuttler2008].

use super::{Address, BodyState, Flux, Letter, SystemId, Wrench};
use crate::geometry::Vector;
use std::collections::BTreeMap;

/// Part of what is left that a pass takes at first, at least and at most.
const FIRST: f64 = 1.0;
const LEAST: f64 = 0.02;
const MOST: f64 = 1.0;

pub type Sums = BTreeMap<Address, Wrench>;

/// An interval that is being repeated.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Repeat {
    /// Its start and its end [s].
    pub span: [f64; 2],
    /// Passes that have ended.
    pub passes: u32,
    /// States of all bodies at its start.
    pub start: Vec<Vec<BodyState>>,
    /// At its end, as the pass before has found them.
    pub end: Vec<Vec<BodyState>>,
    /// Mail on hand at its start.
    pub carried: Vec<Letter>,
    /// Sum of all impulses ever posted, at its start [N s].
    pub posted: Vector,
    /// Fluxes at its start.
    pub fluxes: Vec<Flux>,
    /// Mail of the pass before.
    last: Vec<Letter>,
    /// Systems that have had their turn in this pass.
    done: Vec<SystemId>,
    /// What each system has taken in this pass.
    taken: BTreeMap<SystemId, Sums>,
    /// What was left, r, and the relaxation w.
    residuals: BTreeMap<SystemId, (Sums, f64)>,
    /// The largest change of what a system takes over what it takes, and which system that is.
    pub gap: Option<(f64, SystemId)>,
}

/// Adds letters up.
fn sum<'a>(letters: impl Iterator<Item = &'a Letter>, mut sums: Sums) -> Sums {
    letters.for_each(|letter| sums.entry(letter.address).or_default().add(letter.wrench, 1.0));
    sums
}

/// a + w b, of all addresses in either.
fn combined(a: &Sums, w: f64, b: &Sums) -> Sums {
    let mut out = a.clone();
    b.iter().for_each(|(address, wrench)| out.entry(*address).or_default().add(*wrench, w));
    out
}

fn dot(a: &Sums, b: &Sums) -> f64 {
    a.iter().map(|(address, wrench)| b.get(address).map_or(0.0, |other| wrench.impulse.dot(other.impulse))).sum()
}

impl Repeat {
    /// An interval [s], with the states of bodies, the mail, the sum of all impulses ever posted and the fluxes at its start.
    pub fn new(span: [f64; 2], start: Vec<Vec<BodyState>>, carried: Vec<Letter>, posted: Vector, fluxes: Vec<Flux>) -> Self {
        Self { span, start, carried, posted, fluxes, ..Self::default() }
    }

    /// What a system takes at its turn, `mail` being what has been posted in this pass so far.
    pub fn take(&mut self, system: SystemId, mail: &[Letter], owner: impl Fn(&Letter) -> SystemId) -> Sums {
        let mine = |letter: &&Letter| owner(letter) == system;
        let late = self.last.iter().filter(|letter| !self.done.contains(&letter.from));
        let posted = sum(late.chain(mail).filter(mine), sum(self.carried.iter().filter(mine), Sums::new()));
        let taken = match self.taken.remove(&system).filter(|_| self.passes > 0) {
            None => posted,
            Some(before) => {
                let left = combined(&posted, -1.0, &before);
                let relaxed = match self.residuals.get(&system) {
                    None => FIRST,
                    Some((other, w)) => {
                        let change = combined(&left, -1.0, other);
                        let square = dot(&change, &change);
                        if square > 0.0 { (-w * dot(other, &change) / square).clamp(LEAST, MOST) } else { *w }
                    }
                };
                let taken = combined(&before, relaxed, &left);
                // What was posted in the pass before has been noted at its end.
                if mail.iter().any(|letter| owner(letter) == system) {
                    self.note(system, &left, &posted, &before);
                }
                self.residuals.insert(system, (left, relaxed));
                taken
            }
        };
        self.taken.insert(system, taken.clone());
        taken
    }

    /// A system has had its turn.
    pub fn passed(&mut self, system: SystemId) {
        self.done.push(system);
    }

    /// Notes what is left over what is posted or taken, whichever is larger. NaN stays.
    fn note(&mut self, system: SystemId, left: &Sums, posted: &Sums, taken: &Sums) {
        let whole = dot(posted, posted).max(dot(taken, taken)).sqrt();
        let gap = if whole == 0.0 { 0.0 } else { dot(left, left).sqrt() / whole };
        if self.gap.is_none_or(|(most, _)| gap > most || gap.is_nan()) {
            self.gap = Some((gap, system));
        }
    }

    /// Ends a pass in which `mail` was posted, with the states of bodies at its end; says how far systems disagree, in the first pass only if
    /// nothing was posted.
    pub fn end_pass(&mut self, mail: Vec<Letter>, end: Vec<Vec<BodyState>>, owner: impl Fn(&Letter) -> SystemId) -> Option<f64> {
        (self.last, self.end) = (mail, end);
        self.done.clear();
        self.passes += 1;
        let receivers: Vec<SystemId> = self.taken.keys().copied().collect();
        for system in receivers {
            let (left, posted) = self.left(system, &owner);
            let taken = self.taken.get(&system).cloned().unwrap_or_default();
            self.note(system, &left, &posted, &taken);
        }
        let gap = self.gap.map_or(0.0, |(gap, _)| gap);
        (self.passes > 1 || self.carried.is_empty() && self.last.is_empty()).then_some(gap)
    }

    /// The system that has posted most to a system in the last pass.
    pub fn sender(&self, to: SystemId, owner: impl Fn(&Letter) -> SystemId) -> Option<SystemId> {
        let mut all: BTreeMap<SystemId, f64> = BTreeMap::new();
        for letter in self.last.iter().filter(|letter| owner(letter) == to) {
            *all.entry(letter.from).or_default() += letter.wrench.impulse.norm();
        }
        all.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(from, _)| from)
    }

    /// What a system has been posted less what it has taken, and the former.
    fn left(&self, system: SystemId, owner: &impl Fn(&Letter) -> SystemId) -> (Sums, Sums) {
        let posted = sum(self.carried.iter().chain(&self.last).filter(|letter| owner(letter) == system), Sums::new());
        let left = self.taken.get(&system).map_or_else(|| posted.clone(), |taken| combined(&posted, -1.0, taken));
        (left, posted)
    }

    /// Mail for the next interval: what is left of all systems.
    pub fn leftovers(&self, systems: usize, owner: impl Fn(&Letter) -> SystemId) -> Vec<Letter> {
        let of = |system: usize| {
            // Nobody asks for the sender of what is carried.
            let letter = move |(address, wrench): (Address, Wrench)| Letter { address, wrench, from: SystemId(system) };
            self.left(SystemId(system), &owner).0.into_iter().map(letter)
        };
        (0..systems).flat_map(of).filter(|letter| letter.wrench != Wrench::default()).collect()
    }
}
