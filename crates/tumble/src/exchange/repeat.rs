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

use super::{Address, BodyState, Letter, SystemId, Wrench};
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
    /// An interval [s], with the states of bodies, the mail and the sum of all impulses ever posted at its start.
    pub fn new(span: [f64; 2], start: Vec<Vec<BodyState>>, carried: Vec<Letter>, posted: Vector) -> Self {
        Self { span, start, carried, posted, ..Self::default() }
    }

    /// What a system takes at its turn, `mail` being what has been posted in this pass so far.
    pub fn take(&mut self, system: SystemId, mail: &[Letter], owner: impl Fn(&Letter) -> SystemId) -> Sums {
        let mine = |letter: &&Letter| owner(letter) == system;
        let late = self.last.iter().filter(|letter| !self.done.contains(&letter.from));
        let posted = sum(late.chain(mail).filter(mine), sum(self.carried.iter().filter(mine), Sums::new()));
        let taken = match self.taken.get(&system).filter(|_| self.passes > 0) {
            None => posted,
            Some(before) => {
                let left = combined(&posted, -1.0, before);
                let relaxed = match self.residuals.get(&system) {
                    None => FIRST,
                    Some((other, w)) => {
                        let change = combined(&left, -1.0, other);
                        let square = dot(&change, &change);
                        if square > 0.0 { (-w * dot(other, &change) / square).clamp(LEAST, MOST) } else { *w }
                    }
                };
                let taken = combined(before, relaxed, &left);
                self.note(system, (dot(&left, &left) / dot(&posted, &posted)).sqrt());
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

    fn note(&mut self, system: SystemId, gap: f64) {
        // 0/0: nothing is posted, and nothing was.
        if gap.is_finite() && self.gap.is_none_or(|(most, _)| gap > most) {
            self.gap = Some((gap, system));
        }
    }

    /// Ends a pass in which `mail` was posted, with the states of bodies at its end; says how far systems disagree, in all but the first pass.
    pub fn end_pass(&mut self, mail: Vec<Letter>, end: Vec<Vec<BodyState>>, owner: impl Fn(&Letter) -> SystemId) -> Option<f64> {
        (self.last, self.end) = (mail, end);
        self.done.clear();
        self.passes += 1;
        let receivers: Vec<SystemId> = self.taken.keys().copied().collect();
        for system in receivers {
            let (left, posted) = self.left(system, &owner);
            self.note(system, (dot(&left, &left) / dot(&posted, &posted)).sqrt());
        }
        let gap = self.gap.map_or(0.0, |(gap, _)| gap);
        (self.passes > 1).then_some(gap)
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
            let letter = move |(address, wrench): (Address, Wrench)| Letter { address, wrench, from: SystemId(system) };
            self.left(SystemId(system), &owner).0.into_iter().map(letter)
        };
        (0..systems).flat_map(of).filter(|letter| letter.wrench != Wrench::default()).collect()
    }
}
