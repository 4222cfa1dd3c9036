//! L6: systems in order, the exchange, the clock: THE stepping loop. Knows no concrete system.

use crate::exchange::{Exchange, SystemId};
use crate::system::{Archive, Entry, Part, System};
use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use std::collections::HashMap;
use std::hash::Hasher;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use tumble_interface::engine::{Account, Ledger, Stability, StepReport, UserForce};
use tumble_interface::scene::Coupling;
use tumble_interface::warning::Code;
use tumble_interface::{Column, Data, SceneError, StepError, Warning};
use twox_hash::XxHash3_64;

/// A system, and its number at the exchange.
type Member = (SystemId, Box<dyn System>);

/// Everything that moves.
pub struct World {
    systems: Vec<Member>,
    exchange: Exchange,
    /// How intervals are repeated, if they are.
    coupling: Option<Coupling>,
    /// Systems that did not come to agree.
    disagreements: Vec<Warning>,
    /// Whether an interval is taken once more, in the sub-steps of which nobody looks.
    repeating: Arc<AtomicBool>,
    /// Length of an exchange interval [s].
    dt: f64,
    exchanges: u32,
    frame: u64,
    /// The state at the last good frame: of the world and the exchange, and of each system.
    good: (Archive, Vec<Archive>),
    /// The state of each system at the start of an interval that is repeated.
    start: Vec<Archive>,
}

/// Version of the parts of world and exchange.
const VERSION: u32 = 2;

impl World {
    /// A world of systems at t = 0; a frame of `frame_time` [s] has `exchanges` exchange intervals.
    pub fn new(systems: Vec<Member>, exchange: Exchange, frame_time: f64, exchanges: u32) -> Self {
        let dt = frame_time / f64::from(exchanges);
        let (good, start) = ((Archive::default(), vec![Archive::default(); systems.len()]), vec![Archive::default(); systems.len()]);
        let mut world = Self {
            systems,
            exchange,
            coupling: None,
            disagreements: Vec::new(),
            repeating: Arc::default(),
            dt,
            exchanges,
            frame: 0,
            good,
            start,
        };
        world.publish(0.0);
        world.keep();
        world
    }

    /// Repeats each interval from now on until systems agree; `None`: takes it once.
    pub fn repeat_until_agreed(&mut self, coupling: Option<Coupling>) {
        self.coupling = coupling;
    }

    /// Warnings of systems that did not come to agree.
    pub fn disagreements(&self) -> &[Warning] {
        &self.disagreements
    }

    fn publish(&mut self, t: f64) {
        for (id, system) in &mut self.systems {
            system.publish(t, &mut self.exchange.turn(*id));
        }
    }

    fn each(&self) -> impl Iterator<Item = &dyn System> {
        self.systems.iter().map(|(_, system)| &**system)
    }

    fn each_mut(&mut self) -> impl Iterator<Item = &mut Box<dyn System>> {
        self.systems.iter_mut().map(|(_, system)| system)
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
        let error = self.each_mut().find_map(|s| s.breakdown(time));
        if let Some(error) = error {
            return Err(self.first_breakdown(error, go_on));
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
            let interval = match self.coupling.clone() {
                None => self.turns([t, end], go_on, &mut done)?,
                Some(coupling) => self.passes([t, end], &coupling, go_on, &mut done)?,
            };
            report.add_interval(&interval);
        }
        Ok(report)
    }

    /// Each system's turn in an interval [s].
    fn turns(
        &mut self,
        [t, end]: [f64; 2],
        go_on: &(dyn Fn() -> bool + Sync),
        done: &mut impl FnMut(usize, f64, &StepReport),
    ) -> Result<StepReport, StepError> {
        let mut interval = StepReport::default();
        for (i, (id, system)) in self.systems.iter_mut().enumerate() {
            let exchange = &mut self.exchange.turn(*id);
            system.absorb(exchange);
            let turn = system.advance(t, self.dt, exchange, go_on)?;
            done(i, t, &turn);
            interval.add_system(&turn);
            system.publish(end, exchange);
            self.exchange.passed(*id);
        }
        Ok(interval)
    }

    /// Passes through an interval [s] until systems agree about the impulses between them. The report is that of the last pass. (coupling.7)
    fn passes(
        &mut self,
        [t, end]: [f64; 2],
        coupling: &Coupling,
        go_on: &(dyn Fn() -> bool + Sync),
        done: &mut impl FnMut(usize, f64, &StepReport),
    ) -> Result<StepReport, StepError> {
        self.systems.iter().zip(&mut self.start).for_each(|((_, system), kept)| system.keep(kept));
        self.exchange.begin_repeats(t, end);
        let (mut report, mut passes) = (StepReport::default(), 0);
        let cut = AtomicBool::new(false);
        let asked = || {
            let goes_on = go_on();
            cut.fetch_or(!goes_on, Ordering::Relaxed);
            goes_on
        };
        for pass in 0..coupling.iterations {
            self.repeating.store(pass > 0, Ordering::Relaxed);
            if pass > 0 {
                self.systems.iter_mut().zip(&mut self.start).for_each(|((_, system), kept)| system.roll_back(kept));
                self.exchange.repeat();
            }
            report = self.turns([t, end], &asked, done)?;
            if cut.load(Ordering::Relaxed) {
                // The state is about to be thrown away.
                return Ok(report);
            }
            passes += 1;
            if self.exchange.end_pass().is_some_and(|gap| gap <= coupling.tolerance) {
                break;
            }
        }
        self.repeating.store(false, Ordering::Relaxed);
        report.passes = passes;
        if let Some((gap, pair)) = self.exchange.end_repeats() {
            report.disagree(gap);
            if gap > coupling.tolerance || gap.is_nan() {
                self.warn_of_disagreement(&pair, gap, end, coupling);
            }
        }
        Ok(report)
    }

    /// Once for each system that is pushed.
    fn warn_of_disagreement(&mut self, [system, sender]: &[String; 2], gap: f64, t: f64, coupling: &Coupling) {
        let path = format!("system \"{system}\"");
        if self.disagreements.iter().any(|warning| warning.path == path) {
            return;
        }
        let message = format!(
            "what \"{sender}\" does to it still changes by {gap:.1e} of itself after {} passes through the interval that ends at t = {t:.4} s; \
             raise world.coupling.iterations, or time.exchanges",
            coupling.iterations
        );
        self.disagreements.push(Warning::new(Code::Disagreement, path, message));
    }

    /// Whether an explosion ends a step with an error.
    pub fn stop_on_explosion(&mut self, stop: bool) {
        self.each_mut().for_each(|s| s.tolerate_explosions(!stop));
    }

    /// Goes back to the last good frame and steps again, watching every sub-step: the first breakdown, or this one at the end of the frame.
    fn first_breakdown(&mut self, error: StepError, go_on: &(dyn Fn() -> bool + Sync)) -> StepError {
        self.roll_back();
        self.each_mut().for_each(|s| s.watch(true));
        let found = self.intervals(&|| true, |_, _, _| {}).err().unwrap_or(error);
        let found = self.explain(found, go_on);
        self.each_mut().for_each(|s| s.watch(false));
        self.roll_back();
        found
    }

    /// A frame sub-step by sub-step, each of which is looked at.
    fn watched(&mut self, go_on: &(dyn Fn() -> bool + Sync), done: impl FnMut(usize, f64, &StepReport)) -> Result<StepReport, StepError> {
        self.each_mut().for_each(|s| s.watch(true));
        let result = self.intervals(go_on, done).map_err(|error| self.explain(error, go_on));
        self.each_mut().for_each(|s| s.watch(false));
        result
    }

    /// Lets `see` look at the world after `n` sub-steps of the next frame, at the time [s] of the system that took the last one, with
    /// the name of that system and the length of the sub-step [s]; then the world is back at its last good frame. `None`: the frame
    /// has no more sub-steps, or `go_on` said no. Of an interval that is repeated, the sub-steps of the first pass count.
    pub fn inside<T>(
        &mut self,
        n: u64,
        go_on: &(dyn Fn() -> bool + Sync),
        see: impl FnOnce(&Self, f64, &str, f64) -> T,
    ) -> Result<Option<T>, StepError> {
        let (asked, dt, mut last) = (AtomicU64::new(0), self.dt, None);
        let repeating = self.repeating.clone();
        let counted = || (repeating.load(Ordering::Relaxed) || asked.fetch_add(1, Ordering::Relaxed) < n) && go_on();
        let result = self.watched(&counted, |system, t, turn| {
            if turn.steps > 0 {
                last = Some((system, t + turn.way.1.min(dt), turn.way.0));
            }
        });
        let seen = match (&result, last) {
            (Ok(_), Some((system, time, step))) if asked.into_inner() > n && go_on() => {
                Some(see(self, time, self.systems[system].1.name(), step))
            }
            _ => None,
        };
        self.roll_back();
        result.map(|_| seen)
    }

    /// Adds the step in use and the stable one, in the state that there is.
    fn explain(&mut self, mut error: StepError, go_on: &(dyn Fn() -> bool + Sync)) -> StepError {
        if let StepError::NotFinite(b) | StepError::Exploded(b) = &mut error {
            let dt = self.dt;
            let system = self.each_mut().find(|s| s.name() == b.system);
            if let Some(stability) = system.and_then(|s| s.stability(dt, go_on)) {
                b.step = stability.step;
                b.stable_step = stability.limit(stability.integrator).map_or(f64::INFINITY, |l| l.stable);
            }
        }
        error
    }

    /// Goes to the last good frame.
    fn roll_back(&mut self) {
        let (world, systems) = &mut self.good;
        self.systems.iter_mut().zip(systems).for_each(|((_, system), kept)| system.roll_back(kept));
        world.rewind();
        // A state of this very world always fits.
        let _ = read_world(&mut self.frame, &mut self.exchange, world);
        self.repeating.store(false, Ordering::Relaxed);
        self.publish(self.time());
    }

    /// Takes the state as the last good frame.
    fn keep(&mut self) {
        let (world, systems) = &mut self.good;
        world.rewind();
        world.begin(VERSION);
        world.push("world", Part::Numbers(vec![self.frame as f64]));
        world.push("exchange", Part::Numbers(self.exchange.save()));
        world.end();
        self.systems.iter().zip(systems).for_each(|((_, system), kept)| system.keep(kept));
    }

    fn read(&mut self, archive: &mut Archive) -> Option<()> {
        read_world(&mut self.frame, &mut self.exchange, archive)?;
        for (_, system) in &mut self.systems {
            archive.begin(system.version());
            system.restore(archive)?;
        }
        self.publish(self.time());
        archive.is_read().then_some(())
    }

    /// Everything that the next step depends on, at the last good frame.
    fn parts(&self) -> impl Iterator<Item = &Entry> {
        let (world, systems) = &self.good;
        world.parts.iter().chain(systems.iter().flat_map(|kept| &kept.parts))
    }

    /// Hash of everything that the next step depends on.
    pub fn hash(&self) -> u64 {
        let mut hasher = XxHash3_64::with_seed(0);
        for Entry { name, part, .. } in self.parts() {
            hasher.write(name.as_bytes());
            hasher.write(bytes(part));
        }
        hasher.finish()
    }

    /// The state of the last good frame as safetensors, with texts about it.
    pub fn save(&self, about: &[(&str, &str)]) -> Vec<u8> {
        let views: Vec<(String, TensorView<'_>)> = self
            .parts()
            .enumerate()
            .filter_map(|(k, Entry { name, version, part })| {
                let (dtype, shape) = match part {
                    Part::Table(width, numbers) => (REAL, vec![numbers.len() / width, *width]),
                    Part::Numbers(numbers) => (Dtype::F64, vec![numbers.len()]),
                    Part::Indices(indices) => (Dtype::U32, vec![indices.len()]),
                    Part::Bytes(bytes) => (Dtype::U8, vec![bytes.len()]),
                };
                Some((format!("{k:05} {version} {name}"), TensorView::new(dtype, shape, bytes(part)).ok()?))
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
            let mut words = name.splitn(3, ' ').skip(1);
            archive.begin(words.next().and_then(|version| version.parse().ok()).unwrap_or(0));
            archive.push(words.next().unwrap_or_default(), part);
        }
        archive.rewind();
        if self.read(&mut archive).is_none() {
            self.roll_back();
            let outdated = archive.outdated.map(|entry| {
                format!("\"{}\" in it has version {}, which this engine does not read; run the scene again", entry.name, entry.version)
            });
            return Err(wrong(outdated.as_deref().unwrap_or("it belongs to another scene: names or sizes differ")));
        }
        self.keep();
        Ok(())
    }

    /// Columns of every object, at time t [s].
    pub fn columns(&self, t: f64, names: &[&str]) -> Vec<Column> {
        let mut out = Vec::new();
        self.each().for_each(|s| s.columns(t, names, &mut out));
        merged(out)
    }

    /// Constant columns of all objects.
    pub fn topology(&self) -> Vec<Column> {
        let mut out = Vec::new();
        self.each().for_each(|s| s.topology(&mut out));
        out
    }

    /// The ledger of all systems together.
    pub fn ledger(&self) -> Ledger {
        self.ledger_at(self.time())
    }

    /// The same, of a state at this time [s].
    pub fn ledger_at(&self, time: f64) -> Ledger {
        let mut total = Ledger { time, ..Ledger::default() };
        self.each().for_each(|s| total.add_system(&self.ledger_of(s, time)));
        total
    }

    /// The ledger of a system, with what it owns between systems.
    fn ledger_of(&self, system: &dyn System, time: f64) -> Ledger {
        let mut ledger = system.ledger(time);
        ledger.elastic += system.energy_between(time, &self.exchange);
        ledger
    }

    /// Breakdown of the ledger by object, and the places of the worst values.
    pub fn account(&self) -> Account {
        let (time, listed) = (self.time(), || self.each().filter(|s| s.is_listed()));
        Account {
            systems: listed().map(|s| (s.name().to_string(), self.ledger_of(s, time))).collect(),
            shares: listed().flat_map(|s| s.shares(time)).collect(),
            worst: listed().flat_map(|s| s.worst(time)).collect(),
        }
    }

    /// Drops cached choices of the systems (sub-step count, energy scale) after loading another scene's state.
    pub fn reconsider(&mut self) {
        self.each_mut().for_each(|s| s.reconsider());
    }

    /// The pre-flight estimate of every system that has one; none of those for which `go_on` says no.
    pub fn stability(&mut self, go_on: &(dyn Fn() -> bool + Sync)) -> Vec<Stability> {
        let dt = self.dt;
        self.each_mut().filter_map(|s| s.stability(dt, go_on)).collect()
    }

    /// Adds a user's force to the system of that name; see [`System::add_force`].
    pub fn add_force(&mut self, name: &str, force: Box<dyn UserForce>) -> Option<bool> {
        let added = self.system(name)?.add_force(force);
        // Accelerations of bodies are others now.
        self.publish(self.time());
        Some(added)
    }

    /// The system of that name.
    pub fn system(&mut self, name: &str) -> Option<&mut dyn System> {
        self.each_mut().find(|s| s.name() == name).map(|s| &mut **s as &mut dyn System)
    }

    /// Names of the systems that the scene lists, in its order.
    pub fn names(&self) -> Vec<&str> {
        self.each().filter(|s| s.is_listed()).map(|s| s.name()).collect()
    }

    /// Sets a column of an object; see [`System::write`].
    pub fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool> {
        let done = self.each_mut().find_map(|s| s.write(object, column, values))?;
        self.publish(self.time());
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
        Part::Bytes(bytes) => bytes,
    }
}

/// Columns of an object that several systems write, added up: forces of gases and liquids.
fn merged(columns: Vec<Column>) -> Vec<Column> {
    let mut out: Vec<Column> = Vec::with_capacity(columns.len());
    for column in columns {
        let same = |other: &&mut Column| other.name == column.name && other.object == column.object;
        let known = if column.name == "force" { out.iter_mut().find(same) } else { None };
        match known {
            Some(Column { data: Data::F64(sums), .. }) => sums.iter_mut().zip(column.data.numbers()).for_each(|(sum, f)| *sum += f),
            _ => out.push(column),
        }
    }
    out
}

/// Reads the number of the frame, and the exchange.
fn read_world(frame: &mut u64, exchange: &mut Exchange, archive: &mut Archive) -> Option<()> {
    archive.begin(VERSION);
    let [number] = archive.numbers("world")?[..] else { return None };
    let posted = archive.numbers("exchange")?;
    exchange.restore(&posted)?;
    *frame = number as u64;
    Some(())
}

fn part(tensor: &TensorView<'_>) -> Option<Part> {
    let data = tensor.data();
    Some(match (tensor.dtype(), tensor.shape()) {
        (dtype, [_, width]) if dtype == REAL => Part::Table(*width, bytemuck::allocation::pod_collect_to_vec(data)),
        (Dtype::F64, [_]) => Part::Numbers(bytemuck::allocation::pod_collect_to_vec(data)),
        (Dtype::U32, [_]) => Part::Indices(bytemuck::allocation::pod_collect_to_vec(data)),
        (Dtype::U8, [_]) => Part::Bytes(data.to_vec()),
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
        let written = Part::Bytes(vec![0, 255, 7]);
        let view = TensorView::new(Dtype::U8, vec![3], bytes(&written)).unwrap();
        assert_eq!(part(&view), Some(written));
    }

    #[test]
    fn a_part_of_another_version_is_not_read() {
        let mut archive = Archive::default();
        archive.begin(1);
        archive.push("state", Part::Bytes(vec![1, 2]));
        archive.rewind();
        assert_eq!(archive.bytes("state"), Some(&[1, 2][..]));
        archive.rewind();
        archive.begin(2);
        assert!(archive.bytes("state").is_none());
        assert_eq!(archive.outdated.map(|entry| (entry.name, entry.version)), Some(("state".into(), 1)));
    }
}
