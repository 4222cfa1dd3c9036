//! L4: what the world asks of a system, and the archive that snapshots are made of.

use crate::exchange::{Exchange, Turn};
use crate::math::parallel::{CHUNK, Tasks, rows};
use crate::math::{Real, Row};
use crate::state::Field;
use tumble_interface::engine::{Ledger, Share, Stability, StepReport, UserForce, UserIntegrator, Worst};
use tumble_interface::{Column, StepError};

/// One numerical method with its state.
pub trait System: Send + Sync {
    /// Name in the scene.
    fn name(&self) -> &str;

    /// Whether the scene lists it; what is a function of time alone has no words there.
    fn is_listed(&self) -> bool {
        true
    }

    /// Takes what was posted to it since its last turn.
    fn absorb(&mut self, exchange: &mut Turn<'_>);

    /// Goes from t to t + dt [s] with its own sub-steps. `go_on` is asked between them; `false` ends the work, and the
    /// state is then to be thrown away.
    fn advance(&mut self, t: f64, dt: f64, exchange: &mut Turn<'_>, go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError>;

    /// Publishes its state at its new time t [s].
    fn publish(&mut self, t: f64, exchange: &mut Turn<'_>);

    /// The named columns of its objects at time t [s].
    fn columns(&self, t: f64, names: &[&str], out: &mut Vec<Column>);

    /// Constant columns of its objects.
    fn topology(&self, out: &mut Vec<Column>);

    /// Its ledger at time t [s].
    fn ledger(&self, t: f64) -> Ledger;

    /// Elastic energy [J] of what connects it with other systems at time t [s], where it owns that; their bodies are as published.
    fn energy_between(&self, _t: f64, _exchange: &Exchange) -> f64 {
        0.0
    }

    /// Share of each of its objects; none if unknown.
    fn shares(&self, _t: f64) -> Vec<Share> {
        Vec::new()
    }

    /// Places of the worst numbers of its ledger, as far as known.
    fn worst(&self, _t: f64) -> Vec<Worst> {
        Vec::new()
    }

    /// The failure, if any: a non-finite number, or an energy beyond its scale. A healthy state updates the scale.
    fn breakdown(&mut self, t: f64) -> Option<StepError>;

    /// While watched, a system looks for a breakdown after every sub-step and returns the first as an error.
    fn watch(&mut self, on: bool);

    /// Whether an explosion is no breakdown.
    fn tolerate_explosions(&mut self, _on: bool) {}

    /// Drops cached choices (sub-step count, energy scale) after loading another scene's state.
    fn reconsider(&mut self) {}

    /// Largest stable steps from its stiffest modes now; `None` if it has none to tell, or if `go_on` says no.
    fn stability(&mut self, dt: f64, go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability>;

    /// Version of the parts that it saves: raise it with their meaning, so that no state of another meaning is read.
    fn version(&self) -> u32 {
        1
    }

    /// Keeps its state in `kept` to roll back to, as [`save`](Self::save) writes it; at every frame and every repeated interval, so in the
    /// memory that `kept` has already.
    fn keep(&self, kept: &mut Archive) {
        kept.rewind();
        kept.begin(self.version());
        self.save(kept);
        kept.end();
    }

    /// Goes back to a state that it has kept.
    fn roll_back(&mut self, kept: &mut Archive) {
        kept.rewind();
        kept.begin(self.version());
        // A state of this very system always fits.
        let _ = self.restore(kept);
    }

    /// Writes everything that the next step depends on.
    fn save(&self, archive: &mut Archive);

    /// Reads it back; `None` if it is not of this system.
    fn restore(&mut self, archive: &mut Archive) -> Option<()>;

    /// Adds a user's force; `false` if it cannot take one.
    fn add_force(&mut self, _force: Box<dyn UserForce>) -> bool {
        false
    }

    /// Steps with a user's integrator; `false` if it cannot.
    fn replace_integrator(&mut self, _integrator: Box<dyn UserIntegrator>) -> bool {
        false
    }

    /// Sets a column of an object; `None` if it has no such object, `Some(false)` if the column or the count is wrong.
    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool>;
}

/// A part of a snapshot.
#[derive(Debug, Clone, PartialEq)]
pub enum Part {
    /// Numbers in the engine's scalar, so many to a row.
    Table(usize, Vec<Real>),
    /// Numbers in double precision.
    Numbers(Vec<f64>),
    /// Indices.
    Indices(Vec<u32>),
    /// Whatever a library writes.
    Bytes(Vec<u8>),
}

/// A part with its name, and the version of what it means.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Its name.
    pub name: String,
    /// Version of its writer.
    pub version: u32,
    /// What it holds.
    pub part: Part,
}

/// Parts in the order in which they were written.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Archive {
    /// All of them.
    pub parts: Vec<Entry>,
    /// Position of reading or writing.
    next: usize,
    /// Version of who reads or writes.
    version: u32,
    /// A part of another version than that.
    pub outdated: Option<Entry>,
}

impl Archive {
    /// Writes a part, over the old one at this place.
    pub fn push(&mut self, name: impl Into<String>, part: Part) {
        let entry = Entry { name: name.into(), version: self.version, part };
        match self.parts.get_mut(self.next) {
            Some(old) => *old = entry,
            None => self.parts.push(entry),
        }
        self.next += 1;
    }

    /// Writes rows.
    pub fn push_rows(&mut self, name: &str, rows: &[Row]) {
        self.table(name, 4, rows.len(), 0).copy_from_slice(bytemuck::cast_slice(rows));
    }

    /// A table to fill, in the memory of the old one if it has the same name: a snapshot is taken at every frame, and new
    /// memory would cost more than the copy. New memory has room for `room` rows.
    fn table(&mut self, name: &str, width: usize, rows: usize, room: usize) -> &mut [Real] {
        let old = match self.parts.get_mut(self.next) {
            Some(Entry { name: old, part: Part::Table(_, into), .. }) if old == name => std::mem::take(into),
            _ => Vec::new(),
        };
        let mut numbers = old;
        if numbers.capacity() < width * rows {
            numbers = Vec::with_capacity(width * rows.max(room));
        }
        numbers.resize(width * rows, 0.0);
        self.push(name, Part::Table(width, numbers));
        match &mut self.parts[self.next - 1].part {
            Part::Table(_, numbers) => numbers,
            _ => &mut [],
        }
    }

    /// Writes the first three numbers of each row. There may be as many as `room` later.
    pub fn push_points(&mut self, name: &str, rows: &[Row], room: usize) {
        let into = self.table(name, 3, rows.len(), room);
        into.chunks_mut(3 * CHUNK).zip(rows.chunks(CHUNK)).in_parallel(|(into, rows)| {
            for (into, row) in into.chunks_exact_mut(3).zip(rows) {
                into.copy_from_slice(&row[..3]);
            }
        });
    }

    /// Writes a column of numbers, with the room that it has.
    #[allow(clippy::ptr_arg)] // for its capacity
    pub fn push_numbers(&mut self, name: &str, numbers: &Vec<Real>) {
        self.table(name, 1, numbers.len(), numbers.capacity()).copy_from_slice(numbers);
    }

    /// Writes the points of a field, without its pads.
    pub fn push_field(&mut self, name: &str, field: &Field) {
        let [x, y, z] = field.points();
        let into = self.table(name, 1, x * y * z, 0);
        rows(into, x, |row, into| {
            let at = field.index([0, row % y, row / y]);
            into.copy_from_slice(&field.data[at..at + x]);
        });
    }

    /// Writes a column of indices, with the room that it has.
    #[allow(clippy::ptr_arg)] // for its capacity
    pub fn push_indices(&mut self, name: &str, indices: &Vec<u32>) {
        match self.parts.get_mut(self.next) {
            Some(Entry { name: old, part: Part::Indices(into), version }) if old == name && *version == self.version => {
                if into.capacity() < indices.len() {
                    *into = Vec::with_capacity(indices.capacity());
                }
                indices.clone_into(into);
                self.next += 1;
            }
            _ => self.push(name, Part::Indices(indices.to_vec())),
        }
    }

    /// Reads the next part if it has this name and the version of the reader.
    fn pop(&mut self, name: &str) -> Option<&Part> {
        let entry = self.parts.get(self.next)?;
        (entry.name == name).then_some(())?;
        if entry.version != self.version {
            self.outdated = Some(Entry { name: entry.name.clone(), version: entry.version, part: Part::Bytes(Vec::new()) });
            return None;
        }
        self.next += 1;
        Some(&entry.part)
    }

    /// Reads rows into a column of the same length.
    pub fn rows(&mut self, name: &str, into: &mut [Row]) -> Option<()> {
        match self.pop(name)? {
            Part::Table(4, numbers) if numbers.len() == 4 * into.len() => {
                into.copy_from_slice(bytemuck::cast_slice(numbers));
                Some(())
            }
            _ => None,
        }
    }

    /// Reads the first three numbers of as many rows as there are.
    pub fn points(&mut self, name: &str, into: &mut [Row]) -> Option<()> {
        match self.pop(name)? {
            Part::Table(3, numbers) if numbers.len() == 3 * into.len() => {
                for (row, numbers) in into.iter_mut().zip(numbers.chunks_exact(3)) {
                    row[..3].copy_from_slice(numbers);
                }
                Some(())
            }
            _ => None,
        }
    }

    /// Reads a column of numbers of any length.
    pub fn column(&mut self, name: &str, into: &mut Vec<Real>) -> Option<()> {
        match self.pop(name)? {
            Part::Table(1, numbers) => {
                numbers.clone_into(into);
                Some(())
            }
            _ => None,
        }
    }

    /// Reads numbers in the engine's scalar, so many to a row.
    pub fn table_of(&mut self, width: usize, name: &str) -> Option<Vec<Real>> {
        match self.pop(name)? {
            Part::Table(columns, numbers) if *columns == width => Some(numbers.clone()),
            _ => None,
        }
    }

    /// Reads the points of a field.
    pub fn field(&mut self, name: &str, into: &mut Field) -> Option<()> {
        match self.pop(name)? {
            Part::Table(1, numbers) => into.set(numbers).ok(),
            _ => None,
        }
    }

    /// Reads numbers.
    pub fn numbers(&mut self, name: &str) -> Option<Vec<f64>> {
        match self.pop(name)? {
            Part::Numbers(numbers) => Some(numbers.clone()),
            _ => None,
        }
    }

    /// Reads indices.
    pub fn indices(&mut self, name: &str) -> Option<Vec<u32>> {
        match self.pop(name)? {
            Part::Indices(indices) => Some(indices.clone()),
            _ => None,
        }
    }

    /// Reads bytes.
    pub fn bytes(&mut self, name: &str) -> Option<&[u8]> {
        match self.pop(name)? {
            Part::Bytes(bytes) => Some(bytes),
            _ => None,
        }
    }

    /// Reads or writes parts of this version from here on.
    pub fn begin(&mut self, version: u32) {
        self.version = version;
    }

    /// Whether everything has been read.
    pub fn is_read(&self) -> bool {
        self.next == self.parts.len()
    }

    /// Forgets what lies beyond the part that was written last.
    pub fn end(&mut self) {
        self.parts.truncate(self.next);
    }

    /// Starts from the beginning.
    pub fn rewind(&mut self) {
        self.next = 0;
    }
}
