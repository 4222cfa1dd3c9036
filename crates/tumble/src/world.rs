//! L6: systems in order, the exchange, the clock: THE stepping loop. Knows no concrete system.

use crate::exchange::Exchange;
use crate::system::{Archive, Part, System};
use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use std::collections::HashMap;
use std::hash::Hasher;
use std::sync::atomic::{AtomicU64, Ordering};
use tumble_interface::engine::{Account, Ledger, Stability, StepReport};
use tumble_interface::{Column, SceneError, StepError};
use twox_hash::XxHash3_64;

/// Everything that moves.
pub struct World {
    systems: Vec<Box<dyn System>>,
    exchange: Exchange,
    /// Length of an exchange interval [s].
    dt: f64,
    exchanges: u32,
    frame: u64,
    /// The state at the last good frame.
    good: Archive,
}

impl World {
    /// A world of systems at t = 0; a frame of `frame_time` [s] has `exchanges` exchange intervals.
    pub fn new(systems: Vec<Box<dyn System>>, exchange: Exchange, frame_time: f64, exchanges: u32) -> Self {
        let dt = frame_time / f64::from(exchanges);
        let mut world = Self { systems, exchange, dt, exchanges, frame: 0, good: Archive::default() };
        for system in &mut world.systems {
            system.publish(0.0, &mut world.exchange);
        }
        world.keep();
        world
    }

    /// Simulated time [s].
    pub fn time(&self) -> f64 {
        (self.frame * u64::from(self.exchanges)) as f64 * self.dt
    }

    /// Frames simulated so far.
    pub fn frame_index(&self) -> u64 {
        self.frame
    }

    /// One frame. Each system in turn takes its mail, goes its own way through the interval, and publishes where it is:
    /// what it posts reaches the others on their next turn, the same interval for those after it, the next for those
    /// before it. After an error, or when `go_on` says no (`None`), the state is that of the last good frame.
    pub fn step(&mut self, go_on: &(dyn Fn() -> bool + Sync)) -> Result<Option<StepReport>, StepError> {
        let result = self.intervals(go_on, |_, _, _| {});
        let report = match result {
            Ok(report) if go_on() => report,
            Ok(_) => {
                self.roll_back();
                return Ok(None);
            }
            Err(error) => {
                self.roll_back();
                return Err(self.explain(error, go_on));
            }
        };
        let time = (self.frame + 1) as f64 * f64::from(self.exchanges) * self.dt;
        if let Some(error) = self.systems.iter_mut().find_map(|s| s.breakdown(time)) {
            let error = self.first_breakdown().unwrap_or(error);
            return Err(self.explain(error, go_on));
        }
        self.frame += 1;
        self.keep();
        Ok(Some(report))
    }

    /// All intervals of a frame; `done` hears of each turn: which system, from when on [s], and what it took.
    fn intervals(
        &mut self,
        go_on: &(dyn Fn() -> bool + Sync),
        mut done: impl FnMut(usize, f64, &StepReport),
    ) -> Result<StepReport, StepError> {
        let mut report = StepReport::default();
        for k in 0..u64::from(self.exchanges) {
            // From whole numbers, so that time does not drift.
            let [t, end] = [k, k + 1].map(|k| (self.frame * u64::from(self.exchanges) + k) as f64 * self.dt);
            let mut interval = StepReport::default();
            for (i, system) in self.systems.iter_mut().enumerate() {
                system.absorb(&mut self.exchange);
                let turn = system.advance(t, self.dt, &mut self.exchange, go_on)?;
                done(i, t, &turn);
                interval.add_system(&turn);
                system.publish(end, &mut self.exchange);
            }
            report.add_interval(&interval);
        }
        Ok(report)
    }

    /// Goes back to the last good frame and steps again, watching every sub-step.
    fn first_breakdown(&mut self) -> Option<StepError> {
        self.roll_back();
        let found = self.watched(&|| true, |_, _, _| {}).err();
        self.roll_back();
        found
    }

    /// A frame sub-step by sub-step, each of which is looked at.
    fn watched(&mut self, go_on: &(dyn Fn() -> bool + Sync), done: impl FnMut(usize, f64, &StepReport)) -> Result<StepReport, StepError> {
        self.systems.iter_mut().for_each(|s| s.watch(true));
        let result = self.intervals(go_on, done);
        self.systems.iter_mut().for_each(|s| s.watch(false));
        result
    }

    /// Lets `see` look at the world after `n` sub-steps of the next frame, at the time [s] of the system that took the last one, with
    /// the name of that system and the length of the sub-step [s]; then the world is back at its last good frame. `None`: the frame
    /// has no more sub-steps, or `go_on` said no.
    pub fn inside<T>(
        &mut self,
        n: u64,
        go_on: &(dyn Fn() -> bool + Sync),
        see: impl FnOnce(&Self, f64, &str, f64) -> T,
    ) -> Result<Option<T>, StepError> {
        let (asked, dt, mut last) = (AtomicU64::new(0), self.dt, None);
        let counted = || asked.fetch_add(1, Ordering::Relaxed) < n && go_on();
        let result = self.watched(&counted, |system, t, turn| {
            if turn.steps > 0 {
                last = Some((system, t + turn.way.1.min(dt), turn.way.0));
            }
        });
        let seen = match (&result, last) {
            (Ok(_), Some((system, time, step))) if asked.into_inner() > n && go_on() => {
                Some(see(self, time, self.systems[system].name(), step))
            }
            _ => None,
        };
        self.roll_back();
        result.map(|_| seen).map_err(|error| self.explain(error, go_on))
    }

    /// Adds the step in use and the stable one, at the last good frame.
    fn explain(&mut self, mut error: StepError, go_on: &(dyn Fn() -> bool + Sync)) -> StepError {
        if let StepError::NotFinite(b) | StepError::Exploded(b) = &mut error {
            let dt = self.dt;
            let system = self.systems.iter_mut().find(|s| s.name() == b.system);
            if let Some(stability) = system.and_then(|s| s.stability(dt, go_on)) {
                b.step = stability.step;
                b.stable_step = stability.limit(stability.integrator).map_or(f64::INFINITY, |l| l.stable);
            }
        }
        error
    }

    fn roll_back(&mut self) {
        let mut good = std::mem::take(&mut self.good);
        // A snapshot of this very world always fits.
        let _ = self.read(&mut good);
        self.good = good;
    }

    /// Takes the state as the last good frame.
    fn keep(&mut self) {
        let good = &mut self.good;
        good.rewind();
        good.push("world", Part::Numbers(vec![self.frame as f64]));
        good.push("exchange", Part::Numbers(self.exchange.save()));
        for system in &self.systems {
            system.save(good);
        }
        good.end();
    }

    fn read(&mut self, archive: &mut Archive) -> Option<()> {
        archive.rewind();
        let [frame] = archive.numbers("world")?[..] else { return None };
        self.frame = frame as u64;
        let posted = archive.numbers("exchange")?;
        self.systems.iter_mut().try_for_each(|s| s.restore(archive))?;
        if self.exchange.is_heard() {
            let time = self.time();
            self.systems.iter_mut().for_each(|s| s.publish(time, &mut self.exchange));
        }
        self.exchange.restore(&posted)
    }

    /// Hash of everything that the next step depends on.
    pub fn hash(&self) -> u64 {
        let mut hasher = XxHash3_64::with_seed(0);
        for (name, part) in &self.good.parts {
            hasher.write(name.as_bytes());
            hasher.write(bytes(part));
        }
        hasher.finish()
    }

    /// The state of the last good frame as safetensors, with texts about it.
    pub fn save(&self, about: &[(&str, &str)]) -> Vec<u8> {
        let views: Vec<(String, TensorView<'_>)> = self
            .good
            .parts
            .iter()
            .enumerate()
            .filter_map(|(k, (name, part))| {
                let (dtype, shape) = match part {
                    Part::Table(width, numbers) => (REAL, vec![numbers.len() / width, *width]),
                    Part::Numbers(numbers) => (Dtype::F64, vec![numbers.len()]),
                    Part::Indices(indices) => (Dtype::U32, vec![indices.len()]),
                };
                Some((format!("{k:05} {name}"), TensorView::new(dtype, shape, bytes(part)).ok()?))
            })
            .collect();
        let about: HashMap<String, String> = about.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
        serialize(views, Some(about)).unwrap_or_default()
    }

    /// Goes to a saved state of the same scene; on an error the state stays as it was.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), SceneError> {
        let wrong = |message: &str| SceneError::one("checkpoint", message);
        let tensors = SafeTensors::deserialize(bytes).map_err(|e| wrong(&format!("not a checkpoint: {e}")))?;
        let mut named = tensors.tensors();
        named.sort_by(|a, b| a.0.cmp(&b.0));
        let mut archive = Archive::default();
        for (name, tensor) in &named {
            let part = part(tensor).ok_or_else(|| wrong("it was written by an engine of another precision"))?;
            archive.push(name.split_once(' ').map_or("", |(_, n)| n), part);
        }
        if self.read(&mut archive).is_none() || archive.parts.len() != self.good.parts.len() {
            self.roll_back();
            return Err(wrong("it belongs to another scene: names or sizes differ"));
        }
        self.keep();
        Ok(())
    }

    /// Columns of every object.
    pub fn columns(&self, names: &[&str]) -> Vec<Column> {
        let mut out = Vec::new();
        self.systems.iter().for_each(|s| s.columns(names, &mut out));
        out
    }

    /// Constant columns of all objects.
    pub fn topology(&self) -> Vec<Column> {
        let mut out = Vec::new();
        self.systems.iter().for_each(|s| s.topology(&mut out));
        out
    }

    /// The books of all systems together.
    pub fn ledger(&self) -> Ledger {
        self.ledger_at(self.time())
    }

    /// The same, of a state at this time [s].
    pub fn ledger_at(&self, time: f64) -> Ledger {
        let mut total = Ledger { time, ..Ledger::default() };
        self.systems.iter().for_each(|s| total.add_system(&s.ledger(time)));
        total
    }

    /// Breakdown of the ledger by object, and the places of the worst values.
    pub fn account(&self) -> Account {
        let (time, systems) = (self.time(), &self.systems);
        Account {
            systems: systems.iter().map(|s| (s.name().to_string(), s.ledger(time))).collect(),
            shares: systems.iter().flat_map(|s| s.shares(time)).collect(),
            worst: systems.iter().flat_map(|s| s.worst(time)).collect(),
        }
    }

    /// Drops cached choices of the systems (sub-step count, energy scale) after loading another scene's state.
    pub fn reconsider(&mut self) {
        self.systems.iter_mut().for_each(|s| s.reconsider());
    }

    /// The pre-flight estimate of every system that has one; none of those for which `go_on` says no.
    pub fn stability(&mut self, go_on: &(dyn Fn() -> bool + Sync)) -> Vec<Stability> {
        let dt = self.dt;
        self.systems.iter_mut().filter_map(|s| s.stability(dt, go_on)).collect()
    }

    /// The system of that name.
    pub fn system(&mut self, name: &str) -> Option<&mut dyn System> {
        self.systems.iter_mut().find(|s| s.name() == name).map(|s| &mut **s as &mut dyn System)
    }

    /// Names of the systems.
    pub fn names(&self) -> Vec<&str> {
        self.systems.iter().map(|s| s.name()).collect()
    }

    /// Sets a column of an object; see [`System::write`].
    pub fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool> {
        let done = self.systems.iter_mut().find_map(|s| s.write(object, column, values))?;
        let time = self.time();
        self.systems.iter_mut().for_each(|s| s.publish(time, &mut self.exchange));
        self.keep();
        Some(done)
    }
}

/// The texts that [`World::save`] was given.
pub fn about(bytes: &[u8]) -> Option<HashMap<String, String>> {
    SafeTensors::read_metadata(bytes).ok()?.1.metadata().clone()
}

#[cfg(not(feature = "double"))]
const REAL: Dtype = Dtype::F32;
#[cfg(feature = "double")]
const REAL: Dtype = Dtype::F64;

fn bytes(part: &Part) -> &[u8] {
    match part {
        Part::Table(_, numbers) => bytemuck::cast_slice(numbers),
        Part::Numbers(numbers) => bytemuck::cast_slice(numbers),
        Part::Indices(indices) => bytemuck::cast_slice(indices),
    }
}

fn part(tensor: &TensorView<'_>) -> Option<Part> {
    let data = tensor.data();
    Some(match (tensor.dtype(), tensor.shape()) {
        (dtype, [_, width]) if dtype == REAL => Part::Table(*width, bytemuck::allocation::pod_collect_to_vec(data)),
        (Dtype::F64, [_]) => Part::Numbers(bytemuck::allocation::pod_collect_to_vec(data)),
        (Dtype::U32, [_]) => Part::Indices(bytemuck::allocation::pod_collect_to_vec(data)),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Real;

    #[test]
    fn a_part_of_any_width_is_read_as_it_was_written() {
        for width in 1..=6 {
            let numbers: Vec<Real> = (0..width * 5).map(|i| i as Real).collect();
            let written = Part::Table(width, numbers);
            let view = TensorView::new(REAL, vec![5, width], bytes(&written)).unwrap();
            assert_eq!(part(&view), Some(written));
        }
    }
}
