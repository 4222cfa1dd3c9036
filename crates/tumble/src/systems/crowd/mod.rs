//! People on the plan of a floor, each a disk: they walk to exits, queue before doors, and leave. See docs/theory/crowds.md.
//!
//! All numbers are in double precision, whatever the engine's: places decide who goes first.

mod near;
mod people;
mod place;
mod plan;
mod tally;
mod way;

pub use people::{Model, Person, reach};
pub use place::{Misfit, Room, overlapping};
pub use plan::{Gate, Line, Plan, Point, inside, nearest};
pub use way::Floor;

use crate::exchange::Turn;
use crate::integrators::equal_steps;
use crate::math::Real;
use crate::math::parallel::max;
use crate::system::{Archive, Part, System};
use near::Near;
use people::{Scratch, step};
use plan::{length, sub};
use tally::{Share, Tally, densities};
use tumble_interface::engine::{Ledger, Stability, StepReport};
use tumble_interface::{Column, StepError};

/// Longest step, unless given [s].
pub const STEP: f64 = 0.05;

/// How far people go on beyond an exit, in the way of who follows [m], and for how long at most [s].
const BEYOND: f64 = 1.0;
const PATIENCE: f64 = 3.0;

/// How far anybody goes in a step, at most [m].
const FAR: f64 = 0.5;

/// What does not change about a system.
pub struct Settings {
    /// Its name.
    pub name: String,
    /// Sub-steps of an interval, if given.
    pub substeps: Option<u32>,
    /// Longest sub-step [s], if given.
    pub step: Option<f64>,
    /// Parameters of the model.
    pub model: Model,
    /// Name of the plan.
    pub plan: String,
    /// Names of the crowds.
    pub crowds: Vec<String>,
    /// The gates by which each leaves.
    pub exits: Vec<Vec<usize>>,
}

/// People on a floor.
pub struct Crowd {
    settings: Settings,
    floor: Floor,
    /// Everybody who was there at the start, by number.
    all: Vec<Person>,
    /// Who is there, and who has just left, in the order of numbers.
    people: Vec<Person>,
    /// Time lost by all so far [s].
    lost: f64,
    tally: Tally,
    scratch: Scratch,
    /// Places before a step.
    before: Vec<(Point, f64)>,
}

impl Crowd {
    /// People on a floor, each numbered as its row.
    pub fn new(settings: Settings, floor: Floor, people: Vec<Person>) -> Self {
        let tally = Tally::new(floor.plan.gates.len());
        Self { settings, floor, all: people.clone(), people, lost: 0.0, tally, scratch: Scratch::default(), before: Vec::new() }
    }

    /// A step of h [s] from t.
    fn step(&mut self, t: f64, h: f64) {
        self.before.clear();
        self.before.extend(self.people.iter().map(|p| (p.x, p.phi)));
        step(&mut self.people, &self.floor, &self.settings.model, &mut self.scratch, t, h);
        let moves = &self.scratch.moves;
        let queues = self.tally.queues(&self.floor, &self.people, moves.iter().map(|to| to.gate), h);
        let (mut shares, mut gone) = (Vec::with_capacity(moves.len()), Vec::new());
        for ((p, to), (x, phi)) in self.people.iter_mut().zip(moves).zip(&self.before) {
            if p.out.is_some() {
                p.phi = to.phi;
                if p.phi < -BEYOND || t - p.starts > PATIENCE {
                    gone.push(p.id);
                }
                continue;
            }
            let out = self.tally.cross(&self.floor, &self.settings.exits[p.crowd as usize], *x, p.x, t, h);
            let (took, left) = out.map_or((h, to.phi), |(_, s)| (s * h, 0.0));
            p.phi = left;
            if p.started {
                shares.push(Share { gate: to.gate, lost: took - (phi - left) / p.speed, waited: if p.waits() { took } else { 0.0 } });
            }
            if let Some((out, _)) = out {
                (p.out, p.starts) = (Some(out), t);
            }
        }
        self.lost += shares.iter().map(|share| share.lost).sum::<f64>();
        self.tally.charge(&shares, &queues);
        if !gone.is_empty() {
            self.people.retain(|p| gone.binary_search(&p.id).is_err());
        }
    }

    /// Rows of a crowd.
    fn of(&self, crowd: usize) -> impl Iterator<Item = &Person> {
        self.present().filter(move |p| p.crowd as usize == crowd)
    }

    /// Who has not left.
    fn present(&self) -> impl Iterator<Item = &Person> {
        self.people.iter().filter(|p| p.out.is_none())
    }

    /// The deepest overlap of two bodies, or of a body and a wall [m].
    fn deepest(&self) -> f64 {
        let mut near = Near::default();
        let range = 2.0 * self.people.iter().map(|p| p.radius).fold(0.0, f64::max);
        near.sort(range.max(0.1), self.people.iter().map(|p| p.x));
        let deepest = |p: &Person| {
            let others = near.runs(p.x, range).flat_map(|run| &near.order[run]).map(|row| &self.people[*row as usize]);
            let overlap = |o: &Person| if o.id == p.id { 0.0 } else { p.radius + o.radius - length(sub(o.x, p.x)) };
            others.map(overlap).fold(p.radius - self.floor.plan.clearance(p.x), f64::max)
        };
        max(self.people.len(), |range| self.people[range].iter().map(deepest).fold(0.0, f64::max)).max(0.0)
    }

    /// Columns of the plan that change.
    fn of_gates(&self, names: &[&str], out: &mut Vec<Column>) {
        let name = &self.settings.plan;
        let plan = &self.floor.plan;
        if names.contains(&"position") {
            let ends = plan.walls.iter().copied().chain(plan.gates.iter().map(|g| g.line)).flatten();
            out.push(Column::new(name, "position", ends.flat_map(|[x, y]| [x as Real, y as Real, 0.0]).collect::<Vec<Real>>()));
        }
        let pairs = self.tally.crossed.concat();
        out.push(Column::new(name, "crossings", pairs));
        let numbers = |numbers: &[f64]| numbers.iter().map(|x| *x as Real).collect::<Vec<Real>>();
        out.push(Column::new(name, "crossing_times", numbers(&self.tally.span.concat())));
        out.push(Column::new(name, "gate_density", numbers(&densities(&self.floor, &self.people))));
        out.push(Column::new(name, "gate_waiting", numbers(&self.tally.waited)));
        out.push(Column::new(name, "gate_lost", numbers(&self.tally.lost)));
    }
}

impl System for Crowd {
    fn name(&self) -> &str {
        &self.settings.name
    }

    fn absorb(&mut self, _exchange: &mut Turn<'_>) {}

    fn advance(&mut self, t: f64, dt: f64, _exchange: &mut Turn<'_>, go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError> {
        let mut report = StepReport::default();
        let given = self.settings.substeps.unwrap_or(equal_steps(dt, self.settings.step.unwrap_or(STEP)) as u32);
        // Nobody goes beyond the walls and gates of the lists in a step, however long it is to be.
        let fastest = self.people.iter().map(|p| p.speed).fold(0.0, f64::max);
        let n = given.max(equal_steps(dt * fastest.max(1e-9), FAR) as u32);
        let h = dt / f64::from(n);
        for k in 0..n {
            if !go_on() {
                break;
            }
            self.step(t + f64::from(k) * h, h);
            report.stepped(h);
        }
        Ok(report)
    }

    fn publish(&mut self, _t: f64, _exchange: &mut Turn<'_>) {}

    fn columns(&self, _t: f64, names: &[&str], out: &mut Vec<Column>) {
        self.of_gates(names, out);
        for (crowd, name) in self.settings.crowds.iter().enumerate() {
            for column in names {
                let of = |p: &Person| match *column {
                    "position" => Some(p.x),
                    "velocity" => Some(p.v),
                    _ => None,
                };
                if matches!(*column, "position" | "velocity") {
                    let rows = self.of(crowd).filter_map(of).flat_map(|[x, y]| [x as Real, y as Real, 0.0]);
                    out.push(Column::new(name, column, rows.collect::<Vec<Real>>()));
                }
            }
            out.push(Column::new(name, "id", self.of(crowd).map(|p| p.id).collect::<Vec<u32>>()));
            out.push(Column::new(name, "radius", self.of(crowd).map(|p| p.radius as Real).collect::<Vec<Real>>()));
        }
    }

    fn topology(&self, out: &mut Vec<Column>) {
        let name = &self.settings.plan;
        let ends = 2 * self.floor.plan.walls.len() as u32;
        out.push(Column::new(name, "links", (0..ends).collect::<Vec<u32>>()));
        out.push(Column::new(name, "radius", vec![WALL]));
    }

    fn ledger(&self, t: f64) -> Ledger {
        let speed = self.people.iter().map(|p| length(p.v)).fold(0.0, f64::max);
        Ledger {
            time: t,
            speed: Some(speed),
            penetration: Some(self.deepest()),
            people: Some(self.present().count() as u64),
            left: Some((self.all.len() - self.present().count()) as u64),
            lost: Some(self.lost),
            ..Ledger::default()
        }
    }

    /// Nothing can: steps are bounded, and what is written is checked.
    fn breakdown(&mut self, _t: f64) -> Option<StepError> {
        None
    }

    fn watch(&mut self, _on: bool) {}

    fn stability(&mut self, _dt: f64, _go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability> {
        None
    }

    fn save(&self, archive: &mut Archive) {
        archive.push_indices("people", &self.people.iter().map(|p| p.id).collect());
        let rows = self.people.iter().flat_map(|p| {
            let out = p.out.unwrap_or([f64::NAN; 2]);
            [p.x[0], p.x[1], p.v[0], p.v[1], p.heading, p.phi, p.starts, out[0], out[1]]
        });
        archive.push("rows", Part::Numbers(rows.collect()));
        archive.push_indices("crossed", &self.tally.crossed.concat());
        let tally = [&self.tally.span.concat()[..], &self.tally.waited, &self.tally.lost, &self.tally.pace, &[self.lost]].concat();
        archive.push("tally", Part::Numbers(tally));
    }

    fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        let (ids, rows) = (archive.indices("people")?, archive.numbers("rows")?);
        let (crossed, tally) = (archive.indices("crossed")?, archive.numbers("tally")?);
        let gates = self.floor.plan.gates.len();
        let fits = rows.len() == 9 * ids.len() && crossed.len() == 2 * gates && tally.len() == 5 * gates + 1;
        if !fits || !ids.is_sorted_by(|a, b| a < b) || ids.last().is_some_and(|id| *id as usize >= self.all.len()) {
            return None;
        }
        let person = |(id, row): (&u32, &[f64])| {
            let of = &self.all[*id as usize];
            let out = row[7].is_finite().then_some([row[7], row[8]]);
            Person { x: [row[0], row[1]], v: [row[2], row[3]], heading: row[4], phi: row[5], starts: row[6], out, ..*of }
        };
        self.people = ids.iter().zip(rows.chunks_exact(9)).map(person).collect();
        self.tally.crossed = crossed.chunks_exact(2).map(|c| [c[0], c[1]]).collect();
        let (span, rest) = tally.split_at(2 * gates);
        self.tally.span = span.chunks_exact(2).map(|c| [c[0], c[1]]).collect();
        self.tally.waited = rest[..gates].to_vec();
        self.tally.lost = rest[gates..2 * gates].to_vec();
        self.tally.pace = rest[2 * gates..3 * gates].to_vec();
        self.lost = rest[3 * gates];
        Some(())
    }

    /// Positions where bodies fit and from which there is a way.
    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool> {
        let crowd = self.settings.crowds.iter().position(|name| name == object)?;
        let rows: Vec<usize> =
            (0..self.people.len()).filter(|i| self.people[*i].crowd as usize == crowd && self.people[*i].out.is_none()).collect();
        if column != "position" || values.len() != 3 * rows.len() {
            return Some(false);
        }
        let places: Vec<(usize, Point)> = rows.into_iter().zip(values.chunks_exact(3).map(|v| [v[0], v[1]])).collect();
        let way = self.floor.way(crowd as u32);
        let fits = |(i, x): &(usize, Point)| {
            x.iter().all(|x| x.is_finite()) && way.distance(*x).is_finite() && self.floor.plan.clearance(*x) >= self.people[*i].radius
        };
        if !places.iter().all(fits) {
            return Some(false);
        }
        for (i, x) in places {
            (self.people[i].x, self.people[i].phi) = (x, way.distance(x));
        }
        Some(true)
    }
}

/// Half the width of walls in pictures [m].
const WALL: f64 = 0.04;
