//! People on the plan of a floor, each a disk: they walk to exits, queue before doors, and leave. See docs/theory/crowds.md.
//!
//! All numbers are in double precision, whatever the engine's: places decide who goes first.

mod around;
mod arrivals;
mod bodies;
mod figure;
mod floor;
mod image;
mod journey;
mod line;
mod link;
mod models;
mod near;
mod people;
mod place;
mod plan;
mod smoke;
mod tally;
mod touch;
mod walk;
mod way;

pub use around::Person;
pub use arrivals::Arrivals;
pub use bodies::Frailty;
pub use floor::Floor;
pub use journey::{Goal, Leg, journeys};
pub use models::{AnticipationVelocity, CollisionFreeSpeed, Model, Orca, SocialForce};
pub use place::{Misfit, Room, overlapping};
pub use plan::{Gate, Line, Plan, Point, Slope, middle, nearest, width};
pub use smoke::Smoke;

use crate::exchange::Turn;
use crate::geometry::Vector;
use crate::integrators::equal_steps;
use crate::math::functions::{cos, sin};
use crate::math::{Quat, Real};
use crate::system::{Archive, Part, System};
use figure::{LYING, figure};
use plan::length;
use tally::densities;
use tumble_interface::engine::{Ledger, Stability, StepReport};
use tumble_interface::{Column, StepError};
use walk::Walk;

/// Numbers of a person in a snapshot.
const ROW: usize = 14;
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
    /// What people withstand, where there are bodies.
    pub frailty: Option<Frailty>,
    /// The smoke that they walk in.
    pub smoke: Option<Smoke>,
    /// Whether the scene is flat: elsewhere people stand in space.
    pub flat: bool,
    /// Mass of a person [kg].
    pub mass: f64,
    /// Name of the plan.
    pub plan: String,
    /// Names of the crowds.
    pub crowds: Vec<String>,
    /// Where each goes.
    pub journeys: Vec<Vec<Leg>>,
}

/// People on a floor.
pub struct Crowd {
    settings: Settings,
    walk: Walk,
    /// Everybody who was there at the start, or comes later, by number.
    all: Vec<Person>,
}

impl Crowd {
    /// People on a floor, and who comes later, each numbered from 0.
    pub fn new(settings: Settings, floor: Floor, people: Vec<Person>, arrivals: Vec<Arrivals>) -> Self {
        let mut all: Vec<Person> = people.iter().chain(arrivals.iter().flat_map(|a| a.people.iter().map(|(_, p)| p))).copied().collect();
        all.sort_by_key(|p| p.id);
        Self {
            walk: Walk::new(floor, (settings.model, settings.frailty, settings.smoke.clone()), settings.journeys.clone(), people, arrivals),
            settings,
            all,
        }
    }

    /// Rows of a crowd.
    fn of(&self, crowd: usize) -> impl Iterator<Item = &Person> {
        self.walk.present().filter(move |p| p.crowd as usize == crowd)
    }

    /// Columns of the plan that change.
    fn of_gates(&self, names: &[&str], out: &mut Vec<Column>) {
        let name = &self.settings.plan;
        let plan = &self.walk.floor.plan;
        if names.contains(&"position") {
            let ends = plan.walls[..plan.solid].iter().copied().chain(plan.gates.iter().map(|g| g.line)).flatten();
            out.push(Column::new(name, "position", ends.flat_map(|[x, y]| [x as Real, y as Real, 0.0]).collect::<Vec<Real>>()));
        }
        let pairs = self.walk.tally.crossed.concat();
        out.push(Column::new(name, "crossings", pairs));
        let numbers = |numbers: &[f64]| numbers.iter().map(|x| *x as Real).collect::<Vec<Real>>();
        out.push(Column::new(name, "crossing_times", numbers(&self.walk.tally.span.concat())));
        out.push(Column::new(name, "gate_density", numbers(&densities(&self.walk.floor, &self.walk.people))));
        out.push(Column::new(name, "gate_waiting", numbers(&self.walk.tally.waited)));
        out.push(Column::new(name, "gate_lost", numbers(&self.walk.tally.lost)));
    }
}

impl System for Crowd {
    fn name(&self) -> &str {
        &self.settings.name
    }

    fn absorb(&mut self, _exchange: &mut Turn<'_>) {}

    fn advance(&mut self, t: f64, dt: f64, exchange: &mut Turn<'_>, go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError> {
        let mut report = StepReport::default();
        let given = self.settings.substeps.unwrap_or(equal_steps(dt, self.settings.step.unwrap_or(self.settings.model.step())) as u32);
        // Nobody goes beyond the walls and gates of the lists in a step, however long it is to be.
        let fastest = self.walk.people.iter().map(|p| p.speed).fold(0.0, f64::max);
        let n = given.max(equal_steps(dt * fastest.max(1e-9), FAR) as u32);
        let h = dt / f64::from(n);
        self.walk.bodies.begin(exchange);
        self.walk.smoke.iter_mut().for_each(|smoke| smoke.take(exchange));
        for k in 0..n {
            if !go_on() {
                return Ok(report);
            }
            self.walk.step(t + f64::from(k) * h, h);
            report.stepped(h);
        }
        self.walk.bodies.post(exchange);
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
                    let lies = |p: &Person| !self.settings.flat && p.lies && *column == "position";
                    let rows = self.of(crowd).filter_map(|p| Some((of(p)?, if lies(p) { LYING } else { 0.0 })));
                    let rows = rows.flat_map(|([x, y], z)| [x as Real, y as Real, z as Real]);
                    out.push(Column::new(name, column, rows.collect::<Vec<Real>>()));
                }
            }
            if !self.settings.flat {
                out.push(Column::new(name, "turn", self.of(crowd).flat_map(turn).collect::<Vec<Real>>()));
            }
            out.push(Column::new(name, "id", self.of(crowd).map(|p| p.id).collect::<Vec<u32>>()));
            out.push(Column::new(name, "radius", self.of(crowd).map(|p| p.radius as Real).collect::<Vec<Real>>()));
            if self.settings.frailty.is_some() {
                let lies = |p: &Person| u32::from(p.lies) + u32::from(p.lies && p.up == f64::INFINITY);
                out.push(Column::new(name, "fallen", self.of(crowd).map(lies).collect::<Vec<u32>>()));
            }
        }
    }

    fn topology(&self, out: &mut Vec<Column>) {
        let name = &self.settings.plan;
        let ends = 2 * self.walk.floor.plan.solid as u32;
        out.push(Column::new(name, "links", (0..ends).collect::<Vec<u32>>()));
        out.push(Column::new(name, "radius", vec![WALL]));
        for (crowd, name) in self.settings.crowds.iter().enumerate().filter(|_| !self.settings.flat) {
            let own = || self.all.iter().filter(|p| p.crowd as usize == crowd);
            let (corners, triangles) = figure(own().map(|p| p.radius).sum::<f64>() / own().count().max(1) as f64);
            out.push(Column::new(name, "vertices", corners));
            out.push(Column::new(name, "triangles", triangles));
            out.push(Column::new(name, "mass", vec![self.settings.mass as Real; own().count()]));
        }
    }

    fn ledger(&self, t: f64) -> Ledger {
        let fallen = self.walk.fallen();
        let speed = self.walk.people.iter().map(|p| length(p.v)).fold(0.0, f64::max);
        Ledger {
            time: t,
            speed: Some(speed),
            penetration: Some(self.walk.deepest()),
            people: Some(self.walk.present().count() as u64),
            left: Some((self.all.len() - self.walk.expected() - self.walk.present().count()) as u64),
            stranded: Some(self.walk.stranded() as u64),
            fallen: fallen.map(|[fallen, _]| fallen as u64),
            injured: fallen.map(|[_, injured]| injured as u64),
            lost: Some(self.walk.lost),
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

    fn version(&self) -> u32 {
        3
    }

    fn save(&self, archive: &mut Archive) {
        archive.push_indices("people", &self.walk.people.iter().map(|p| p.id).collect());
        let rows = self.walk.people.iter().flat_map(|p| {
            let out = p.out.unwrap_or([f64::NAN; 2]);
            [
                p.x[0],
                p.x[1],
                p.v[0],
                p.v[1],
                p.heading,
                p.phi,
                p.starts,
                out[0],
                out[1],
                f64::from(p.leg),
                f64::from(p.way),
                p.slide[0],
                p.slide[1],
                p.up,
            ]
        });
        archive.push("rows", Part::Numbers(rows.collect()));
        archive.push_indices("crossed", &self.walk.tally.crossed.concat());
        let tally =
            [&self.walk.tally.span.concat()[..], &self.walk.tally.waited, &self.walk.tally.lost, &self.walk.tally.pace, &[self.walk.lost]]
                .concat();
        archive.push("tally", Part::Numbers(tally));
        archive.push_indices("come", &self.walk.arrivals.iter().map(|arrivals| arrivals.come as u32).collect());
        archive.push("time", Part::Numbers(vec![self.walk.time]));
        archive.push_indices("blocked", &self.walk.floor.blocked().to_vec());
    }

    fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        let (ids, rows) = (archive.indices("people")?, archive.numbers("rows")?);
        let (crossed, tally) = (archive.indices("crossed")?, archive.numbers("tally")?);
        let (come, time, blocked) = (archive.indices("come")?, archive.numbers("time")?, archive.indices("blocked")?);
        let (gates, ways) = (self.walk.floor.plan.gates.len(), self.walk.floor.count());
        let known = |(id, row): (&u32, &[f64])| {
            let crowd = self.all.get(*id as usize).map(|p| p.crowd as usize);
            crowd.is_some_and(|crowd| row[9] < self.settings.journeys[crowd].len() as f64 && row[10] < ways as f64)
        };
        let came = self.walk.arrivals.iter().zip(&come).all(|(arrivals, come)| *come as usize <= arrivals.people.len());
        let fits = rows.len() == ROW * ids.len() && crossed.len() == 2 * gates && tally.len() == 5 * gates + 1;
        let fits = fits && come.len() == self.walk.arrivals.len() && came && time.len() == 1;
        let fits = fits && blocked.iter().all(|cell| (*cell as usize) < self.walk.floor.cells());
        if !fits
            || !ids.iter().zip(rows.chunks_exact(ROW)).all(known)
            || !ids.is_sorted_by(|a, b| a < b)
            || ids.last().is_some_and(|id| *id as usize >= self.all.len())
        {
            return None;
        }
        let person = |(id, row): (&u32, &[f64])| {
            let of = &self.all[*id as usize];
            let out = row[7].is_finite().then_some([row[7], row[8]]);
            Person {
                x: [row[0], row[1]],
                v: [row[2], row[3]],
                heading: row[4],
                phi: row[5],
                starts: row[6],
                out,
                leg: row[9] as u32,
                way: row[10] as u32,
                started: out.is_some() || time[0] >= row[6],
                slide: [row[11], row[12]],
                up: row[13],
                lies: time[0] < row[13],
                ..*of
            }
        };
        self.walk.people = ids.iter().zip(rows.chunks_exact(ROW)).map(person).collect();
        self.walk.tally.crossed = crossed.chunks_exact(2).map(|c| [c[0], c[1]]).collect();
        let (span, rest) = tally.split_at(2 * gates);
        self.walk.tally.span = span.chunks_exact(2).map(|c| [c[0], c[1]]).collect();
        self.walk.tally.waited = rest[..gates].to_vec();
        self.walk.tally.lost = rest[gates..2 * gates].to_vec();
        self.walk.tally.pace = rest[2 * gates..3 * gates].to_vec();
        self.walk.lost = rest[3 * gates];
        self.walk.arrivals.iter_mut().zip(come).for_each(|(arrivals, come)| arrivals.come = come as usize);
        self.walk.time = time[0];
        self.walk.floor.close(blocked);
        self.walk.floor.keep_hours(time[0]);
        Some(())
    }

    /// Positions where bodies fit and from which there is a way.
    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool> {
        let crowd = self.settings.crowds.iter().position(|name| name == object)?;
        let rows: Vec<usize> = (0..self.walk.people.len())
            .filter(|i| self.walk.people[*i].crowd as usize == crowd && self.walk.people[*i].out.is_none())
            .collect();
        if column != "position" || values.len() != 3 * rows.len() {
            return Some(false);
        }
        let places: Vec<(usize, Point)> = rows.into_iter().zip(values.chunks_exact(3).map(|v| [v[0], v[1]])).collect();
        let fits = |(i, x): &(usize, Point)| {
            let way = self.walk.floor.way(self.walk.people[*i].way);
            x.iter().all(|x| x.is_finite())
                && way.distance(*x).is_finite()
                && self.walk.floor.plan.clearance(*x) >= self.walk.people[*i].radius
        };
        if !places.iter().all(fits) {
            return Some(false);
        }
        for (i, x) in places {
            let phi = self.walk.floor.way(self.walk.people[i].way).distance(x);
            (self.walk.people[i].x, self.walk.people[i].phi) = (x, phi);
        }
        Some(true)
    }
}

/// How somebody is turned: it looks along its heading, and lies on its back.
fn turn(p: &Person) -> [Real; 4] {
    let half = 0.5 * p.heading;
    let upright = Quat { v: Vector { x: 0.0, y: 0.0, z: sin(half) }, w: cos(half) };
    let back = Quat { v: Vector { x: 0.0, y: -0.5_f64.sqrt(), z: 0.0 }, w: 0.5_f64.sqrt() };
    let whole = if p.lies { upright * back } else { upright };
    whole.row().map(|c| c as Real)
}

/// Half the width of walls in pictures [m].
const WALL: f64 = 0.04;
