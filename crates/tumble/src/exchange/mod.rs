//! L4: all that systems say to each other. Bodies are rows that others may push, surfaces are solids that others touch, fields are
//! quantities on grids; impulses go to bodies, what passes through a surface of a system, heat, say, is a flux, and what happens at a moment is an
//! event. A system never sees another system.
//!
//! The world delivers an impulse to a system on the system's own next turn, before it advances: absorbing them after
//! everyone has advanced would conserve momentum too, and multiply the energy (see `docs/theory/coupling.md`).

mod body;
mod body_surface;
mod event;
mod repeat;
mod visit;

pub use body::{Body, BodyRow, BodyState};
pub use body_surface::BodySurface;
pub use event::{Event, Happening};
pub use visit::Visit;

use crate::geometry::{Collider, Vector};
use crate::state::Vectors;
use event::Heard;
use repeat::Repeat;
use std::ops::{Deref, Range};
use std::sync::Arc;

/// A system at the exchange.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct SystemId(usize);

/// When an impulse acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum When {
    /// At once, before its row moves on.
    Kick,
    /// As that of a constant force over the interval to come.
    Steady,
    /// Like a steady one, with the displacement that it has given to the visitor's copy.                   (coupling.9)
    Timed,
    /// Like a steady one, through the centre of mass wherever that goes, and a couple.
    Central,
}

/// Where an impulse goes, and when it acts.
type Address = (BodyRow, When);

/// An impulse [N s], and its moment about the origin [N m s].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Wrench {
    impulse: Vector,
    moment: Vector,
    /// Time integrals until the end of the interval of what of the impulse [N s²], and of its moment about the body's centre [N m s²], has acted;
    /// of timed impulses.
    ways: [Vector; 2],
}

impl Wrench {
    fn add(&mut self, other: Self, weight: f64) {
        (self.impulse, self.moment) = (self.impulse + other.impulse * weight, self.moment + other.moment * weight);
        self.ways = [0, 1].map(|k| self.ways[k] + other.ways[k] * weight);
    }
}

/// An impulse on its way.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Letter {
    address: Address,
    wrench: Wrench,
    from: SystemId,
}

/// Numbers of a letter in a snapshot.
const LETTER: usize = 16;

impl Letter {
    fn numbers(&self) -> [f64; LETTER] {
        let ((to, when), Wrench { impulse, moment, ways: [a, b] }) = (self.address, self.wrench);
        let mut numbers = [0.0; LETTER];
        numbers[..4].copy_from_slice(&[to.body as f64, to.row as f64, f64::from(when as u8), self.from.0 as f64]);
        let vectors = [impulse, moment, a, b].map(<[f64; 3]>::from);
        numbers[4..].copy_from_slice(vectors.as_flattened());
        numbers
    }

    fn of(numbers: &[f64]) -> Self {
        let v = |s: &[f64]| Vector { x: s[0], y: s[1], z: s[2] };
        let to = BodyRow { body: numbers[0] as usize, row: numbers[1] as usize };
        let wrench = Wrench { impulse: v(&numbers[4..]), moment: v(&numbers[7..]), ways: [v(&numbers[10..]), v(&numbers[13..])] };
        let when = [When::Kick, When::Steady, When::Timed, When::Central][(numbers[2] as usize).min(3)];
        Self { address: (to, when), wrench, from: SystemId(numbers[3] as usize) }
    }
}

/// An impulse that has arrived.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Push {
    /// The row that it pushes.
    pub row: usize,
    /// The impulse [N s].
    pub impulse: Vector,
    /// Its moment about the origin [N m s]; of a central one, that about the centre of mass.
    pub moment: Vector,
    /// When it acts.
    pub when: When,
    /// Of a timed one, the time integrals of what of the impulse [N s²], and of its moment about the body's centre [N m s²], has acted.
    pub ways: [Vector; 2],
}

/// Flux through a surface of a system.
#[derive(Debug, Clone, PartialEq)]
pub struct Flux {
    /// System that it has entered.
    pub system: SystemId,
    /// Object and surface: `plate x_low`.
    pub name: String,
    /// Heat that has entered, in all [J].
    pub heat: f64,
    /// Mass that has entered, in all [kg].
    pub mass: f64,
}

/// A quantity on a grid at the last two times [s] at which it was published. It is in no snapshot: its system publishes it anew.
#[derive(Debug, Clone, PartialEq, Default)]
struct PublishedField {
    object: String,
    quantity: String,
    states: Vec<(f64, Arc<Vectors>)>,
}

/// All that systems say to each other.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Exchange {
    systems: Vec<String>,
    bodies: Vec<Body>,
    body_surfaces: Vec<BodySurface>,
    surfaces: Surfaces,
    fields: Vec<PublishedField>,
    fluxes: Vec<Flux>,
    heard: Vec<Heard>,
    mail: Vec<Letter>,
    repeat: Option<Repeat>,
    /// Sum of all impulses ever posted [N s].
    pub posted: Vector,
    /// Sum of all impulses ever delivered [N s].
    pub delivered: Vector,
}

/// The surfaces of each system, in the order in which systems have entered, and all of them.
#[derive(Debug, Clone, Default)]
struct Surfaces {
    parts: Vec<(SystemId, Arc<Vec<Collider>>)>,
    all: Arc<Vec<Collider>>,
}

impl PartialEq for Surfaces {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.all, &other.all)
    }
}

/// A system's turn at the exchange: what it says is said by it.
pub struct Turn<'a> {
    exchange: &'a mut Exchange,
    system: SystemId,
}

impl Deref for Turn<'_> {
    type Target = Exchange;

    fn deref(&self) -> &Exchange {
        self.exchange
    }
}

impl Exchange {
    /// A system comes in.
    pub fn enter(&mut self, name: &str) -> SystemId {
        self.systems.push(name.into());
        SystemId(self.systems.len() - 1)
    }

    /// The turn of a system.
    pub fn turn(&mut self, system: SystemId) -> Turn<'_> {
        Turn { exchange: self, system }
    }

    /// Makes a range of rows of a system a body. `detailed`: accelerations and contact normals are told as well.
    pub fn open(&mut self, system: SystemId, rows: Range<usize>, detailed: bool) -> Vec<BodyRow> {
        let (body, count) = (self.bodies.len(), rows.len());
        self.bodies.push(Body { system, states: vec![BodyState::default(); count], rows, detailed, time: 0.0 });
        (0..count).map(|row| BodyRow { body, row }).collect()
    }

    /// Whether a system has bodies.
    pub fn has_bodies(&self, system: SystemId) -> bool {
        self.bodies.iter().any(|body| body.system == system)
    }

    /// The state of a row, as published.
    pub fn state(&self, at: BodyRow) -> &BodyState {
        &self.bodies[at.body].states[at.row]
    }

    /// The state of a row from which its next interval goes on, whichever of two systems has its turn first; where the interval is repeated, at its
    /// start.
    pub fn state_before(&self, at: BodyRow) -> &BodyState {
        self.repeat.as_ref().map_or(self.state(at), |repeat| &repeat.start[at.body][at.row])
    }

    /// The state of a row at a time within the interval [s], where that is repeated; else as published: carrying it on would deliver a partner's
    /// kick an interval late.
    pub fn state_at(&self, at: BodyRow, t: f64) -> BodyState {
        let now = self.state(at);
        let Some(repeat) = &self.repeat else { return *now };
        let [t0, t1] = repeat.span;
        let end = if self.bodies[at.body].time >= t1 { Some(now) } else { repeat.end.get(at.body).map(|states| &states[at.row]) };
        end.map_or(*now, |end| repeat.start[at.body][at.row].towards(end, t1 - t0, (t - t0) / (t1 - t0)))
    }

    /// Whether this interval is repeated until systems agree. Post what acts throughout it as steady then.
    pub fn repeats(&self) -> bool {
        self.repeat.is_some()
    }

    /// Gives rows of a body a surface, which systems of masses visit; returns its place among all.
    pub fn cover(&mut self, surface: BodySurface) -> usize {
        self.body_surfaces.push(surface);
        self.body_surfaces.len() - 1
    }

    /// Whether two rows of bodies are the same row of a system.
    pub fn is_same(&self, a: BodyRow, b: BodyRow) -> bool {
        let [a, b] = [a, b].map(|at| (self.bodies[at.body].system, self.bodies[at.body].rows.start + at.row));
        a == b
    }

    /// The surfaces of bodies.
    pub fn body_surfaces(&self) -> &[BodySurface] {
        &self.body_surfaces
    }

    /// Solids that systems have published, in the order in which systems have entered: the scenery is the first.
    pub fn surfaces(&self) -> &Arc<Vec<Collider>> {
        &self.surfaces.all
    }

    /// Announces a surface through which something flows into a system; returns its place among the fluxes.
    pub fn open_flux(&mut self, system: SystemId, name: String) -> usize {
        self.fluxes.push(Flux { system, name, heat: 0.0, mass: 0.0 });
        self.fluxes.len() - 1
    }

    /// Fluxes through all surfaces.
    pub fn fluxes(&self) -> &[Flux] {
        &self.fluxes
    }

    /// Asks for a quantity of an object.
    pub fn ask(&mut self, object: &str, quantity: &str) {
        if self.fields.iter().all(|field| (field.object.as_str(), field.quantity.as_str()) != (object, quantity)) {
            self.fields.push(PublishedField { object: object.into(), quantity: quantity.into(), states: Vec::new() });
        }
    }

    /// What is published of a quantity of an object: at most two states, with their times [s].
    pub fn field(&self, object: &str, quantity: &str) -> &[(f64, Arc<Vectors>)] {
        let found = self.fields.iter().find(|field| (field.object.as_str(), field.quantity.as_str()) == (object, quantity));
        found.map_or(&[], |field| &field.states)
    }

    /// Asks for the events of an object: deaths, and contacts with solids if asked for. The system of who asks has its turn after that of the object.
    pub fn listen(&mut self, object: &str, contacts: bool) {
        match self.heard.iter_mut().find(|heard| heard.object == object) {
            Some(heard) => heard.contacts |= contacts,
            None => self.heard.push(Heard { object: object.into(), contacts, events: Vec::new() }),
        }
    }

    /// Whether anybody asks for the events of an object, and if so, whether for contacts as well.
    pub fn is_heard(&self, object: &str) -> Option<bool> {
        self.heard.iter().find(|heard| heard.object == object).map(|heard| heard.contacts)
    }

    /// Events of an object in the last turn of its system, in the order of their times.
    pub fn events(&self, object: &str) -> &[Event] {
        self.heard.iter().find(|heard| heard.object == object).map_or(&[], |heard| &heard.events)
    }

    /// Takes an interval as one that will be repeated.
    pub fn begin_repeats(&mut self, start: f64, end: f64) {
        let states = self.bodies.iter().map(|body| body.states.clone()).collect();
        let carried = std::mem::take(&mut self.mail);
        self.repeat = Some(Repeat::new([start, end], states, carried, self.posted, self.fluxes.clone()));
    }

    /// A system has had its turn.
    pub fn passed(&mut self, system: SystemId) {
        self.repeat.iter_mut().for_each(|repeat| repeat.passed(system));
    }

    /// Ends a pass through an interval; says how far systems disagree, in the first pass only if nothing was posted.
    pub fn end_pass(&mut self) -> Option<f64> {
        let Self { repeat, mail, bodies, .. } = self;
        let ends = bodies.iter().map(|body| body.states.clone()).collect();
        repeat.as_mut()?.end_pass(std::mem::take(mail), ends, |letter| bodies[letter.address.0.body].system)
    }

    /// Goes back to the start of the interval, for another pass.
    pub fn repeat(&mut self) {
        let Self { repeat, bodies, posted, fluxes, .. } = self;
        let Some(repeat) = repeat else { return };
        (repeat.gap, *posted) = (None, repeat.posted);
        fluxes.clone_from(&repeat.fluxes);
        for (body, start) in bodies.iter_mut().zip(&repeat.start) {
            body.states.clone_from(start);
            body.time = repeat.span[0];
        }
    }

    /// After the last pass: what systems have not taken is mail for the next interval. Returns how far the system that is furthest from agreement
    /// is from it, its name, and that of the system that has posted most to it.
    pub fn end_repeats(&mut self) -> Option<(f64, [String; 2])> {
        let repeat = self.repeat.take()?;
        let bodies = &self.bodies;
        self.mail = repeat.leftovers(self.systems.len(), |letter| bodies[letter.address.0.body].system);
        let impulses = |letters: &[Letter]| letters.iter().fold(Vector::default(), |sum, letter| sum + letter.wrench.impulse);
        self.delivered = self.posted - impulses(&self.mail);
        let name = |system: SystemId| self.systems.get(system.0).cloned().unwrap_or_default();
        let sender = |to| repeat.sender(to, |letter| bodies[letter.address.0.body].system).map_or_else(String::new, name);
        repeat.gap.map(|(gap, system)| (gap, [name(system), sender(system)]))
    }

    /// Everything as numbers, for a snapshot: the number of bodies, sums, fluxes, then the mail. Bodies are published anew.
    pub fn save(&self) -> Vec<f64> {
        let v = |v: Vector| <[f64; 3]>::from(v);
        let mut out = vec![self.bodies.len() as f64];
        out.extend(v(self.posted).into_iter().chain(v(self.delivered)));
        out.extend(self.fluxes.iter().flat_map(|flux| [flux.heat, flux.mass]));
        out.extend(self.mail.iter().flat_map(Letter::numbers));
        out
    }

    /// The inverse of [`Exchange::save`]; `None` if the numbers are not of this exchange.
    pub fn restore(&mut self, numbers: &[f64]) -> Option<()> {
        let (count, rest) = numbers.split_first()?;
        let fixed = 6 + 2 * self.fluxes.len();
        if *count as usize != self.bodies.len() || rest.len() < fixed || !(rest.len() - fixed).is_multiple_of(LETTER) {
            return None;
        }
        let v = |s: &[f64]| Vector { x: s[0], y: s[1], z: s[2] };
        let (sums, rest) = rest.split_at(6);
        let (fluxes, mail) = rest.split_at(2 * self.fluxes.len());
        let known =
            |m: &[f64]| self.bodies.get(m[0] as usize).is_some_and(|body| m[0] >= 0.0 && m[1] >= 0.0 && m[1] < body.rows.len() as f64);
        if !mail.chunks_exact(LETTER).all(known) {
            return None;
        }
        (self.posted, self.delivered) = (v(&sums[..3]), v(&sums[3..]));
        for (flux, s) in self.fluxes.iter_mut().zip(fluxes.chunks_exact(2)) {
            (flux.heat, flux.mass) = (s[0], s[1]);
        }
        self.mail = mail.chunks_exact(LETTER).map(Letter::of).collect();
        self.repeat = None;
        Some(())
    }
}

impl Turn<'_> {
    /// Posts an impulse [N s] to a row at a point [m]: a kick before it moves on.
    pub fn post(&mut self, to: BodyRow, point: Vector, impulse: Vector) {
        self.send((to, When::Kick), Wrench { impulse, moment: point.cross(impulse), ..Wrench::default() });
    }

    /// Posts an impulse [N s] to a row at a point [m]: that of a constant force while it moves through its next interval. Post reaction
    /// forces as steady: as a kick they would set resting bodies in motion.                                     (coupling.6)
    pub fn post_steady(&mut self, to: BodyRow, point: Vector, impulse: Vector) {
        self.post_sum(to, impulse, point.cross(impulse));
    }

    /// The same of a sum of impulses [N s] with their moment about the origin [N m s].
    pub fn post_sum(&mut self, to: BodyRow, impulse: Vector, moment: Vector) {
        self.send((to, When::Steady), Wrench { impulse, moment, ..Wrench::default() });
    }

    /// The same of a force through the centre of mass of the row, wherever that goes, and a couple [N m s]: that of what is all around it.
    pub fn post_central(&mut self, to: BodyRow, impulse: Vector, couple: Vector) {
        self.send((to, When::Central), Wrench { impulse, moment: couple, ..Wrench::default() });
    }

    /// The same as a sum, with the time integrals of what of the impulse [N s²], and of its moment about the body's centre [N m s²], has acted, from which
    /// the body takes its displacement.                                                                      (coupling.9)
    pub fn post_timed(&mut self, to: BodyRow, impulse: Vector, moment: Vector, ways: [Vector; 2]) {
        self.send((to, When::Timed), Wrench { impulse, moment, ways });
    }

    fn send(&mut self, address: Address, wrench: Wrench) {
        self.exchange.posted = self.exchange.posted + wrench.impulse;
        self.exchange.mail.push(Letter { address, wrench, from: self.system });
    }

    /// Takes its mail, in the order in which it was posted.
    pub fn take(&mut self) -> Vec<Push> {
        let Exchange { bodies, mail, repeat, delivered, .. } = &mut *self.exchange;
        let (bodies, system) = (&*bodies, self.system);
        let owner = |letter: &Letter| bodies[letter.address.0.body].system;
        let push = |(to, when): Address, Wrench { impulse, moment, ways }: Wrench| {
            let row = bodies[to.body].rows.start + to.row;
            Push { row, impulse, moment, when, ways }
        };
        if let Some(repeat) = repeat {
            return repeat.take(system, mail, owner).into_iter().map(|(address, wrench)| push(address, wrench)).collect();
        }
        let (mine, others) = mail.drain(..).partition::<Vec<_>, _>(|letter| owner(letter) == system);
        *mail = others;
        for letter in &mine {
            *delivered = *delivered + letter.wrench.impulse;
        }
        mine.into_iter().map(|letter| push(letter.address, letter.wrench)).collect()
    }

    /// Gives a surface of its bodies another shape, with its reach [m] and volume [m³]: they have broken.
    pub fn cover_anew(&mut self, place: usize, solid: &Arc<Collider>, reach: f64, volume: f64) {
        if let Some(surface) = self.exchange.body_surfaces.get_mut(place) {
            (surface.solid, surface.reach, surface.volume) = (solid.clone(), reach, volume);
        }
    }

    /// Its bodies, to publish them.
    pub fn bodies(&mut self) -> impl Iterator<Item = &mut Body> {
        let system = self.system;
        self.exchange.bodies.iter_mut().filter(move |body| body.system == system)
    }

    /// Publishes its solids, with their motion until the end of the interval; what it has published before is gone.
    pub fn publish_surfaces(&mut self, solids: Arc<Vec<Collider>>) {
        let surfaces = &mut self.exchange.surfaces;
        if surfaces.parts.iter().any(|(system, part)| *system == self.system && Arc::ptr_eq(part, &solids)) {
            return;
        }
        surfaces.parts.retain(|(system, _)| *system != self.system);
        let at = surfaces.parts.partition_point(|(system, _)| *system < self.system);
        surfaces.parts.insert(at, (self.system, solids));
        surfaces.all = match &surfaces.parts[..] {
            [(_, only)] => only.clone(),
            parts => Arc::new(parts.iter().flat_map(|(_, part)| part.iter().cloned()).collect()),
        };
    }

    /// Publishes a quantity of an object at time t [s], if anybody asks for it. A density has one part.
    pub fn publish_field(&mut self, object: &str, quantity: &str, t: f64, value: impl FnOnce() -> Vectors) {
        let mut fields = self.exchange.fields.iter_mut();
        if let Some(field) = fields.find(|field| (field.object.as_str(), field.quantity.as_str()) == (object, quantity)) {
            field.states.retain(|(time, _)| *time < t);
            field.states.push((t, Arc::new(value())));
            let old = field.states.len().saturating_sub(2);
            field.states.drain(..old);
        }
    }

    /// Tells the events of an object since its last turn, in the order of their times.
    pub fn tell(&mut self, object: &str, events: Vec<Event>) {
        if let Some(heard) = self.exchange.heard.iter_mut().find(|heard| heard.object == object) {
            heard.events = events;
        }
    }

    /// Heat [J] and mass [kg] have entered through a surface.
    pub fn flow(&mut self, flux: usize, heat: f64, mass: f64) {
        let flux = &mut self.exchange.fluxes[flux];
        (flux.heat, flux.mass) = (flux.heat + heat, flux.mass + mass);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Friction, Shape};

    #[test]
    fn every_impulse_is_delivered_once_to_its_system() {
        let mut exchange = Exchange::default();
        let (first, second) = (exchange.enter("first"), exchange.enter("second"));
        let (a, b) = (exchange.open(first, 5..6, false)[0], exchange.open(second, 6..8, false)[1]);
        let flux = exchange.open_flux(second, "plate x_low".into());
        exchange.turn(second).flow(flux, 3.0, 0.5);
        exchange.turn(second).flow(flux, -1.0, 0.5);
        assert_eq!((exchange.fluxes()[0].heat, exchange.fluxes()[0].mass), (2.0, 1.0));
        let point = Vector::from([0.0, 0.0, 2.0]);
        exchange.turn(second).post(a, point, [1.0, 0.0, 0.0].into());
        exchange.turn(first).post(b, point, [0.0, 2.0, 0.0].into());
        exchange.turn(first).post_steady(b, point, [0.0, 0.0, 3.0].into());
        exchange.turn(first).post_timed(b, [0.0, 0.0, 1.0].into(), [5.0; 3].into(), [[6.0, 7.0, 8.0].into(), [9.0; 3].into()]);
        let mut copy = exchange.clone();
        copy.turn(first).take();
        copy.turn(second).flow(flux, 9.0, 9.0);
        assert!(copy.restore(&exchange.save()).is_some() && copy == exchange);
        assert!(copy.restore(&exchange.save()[1..]).is_none());
        let push = |row, impulse: [f64; 3], moment: [f64; 3], when| {
            let ways = if when == When::Timed { [[6.0, 7.0, 8.0].into(), [9.0; 3].into()] } else { <[Vector; 2]>::default() };
            Push { row, impulse: impulse.into(), moment: moment.into(), when, ways }
        };
        let arrived = vec![
            push(7, [0.0, 2.0, 0.0], [-4.0, 0.0, 0.0], When::Kick),
            push(7, [0.0, 0.0, 3.0], [0.0; 3], When::Steady),
            push(7, [0.0, 0.0, 1.0], [5.0; 3], When::Timed),
        ];
        assert_eq!(exchange.turn(second).take(), arrived);
        assert_eq!(exchange.turn(second).take(), vec![]);
        assert_eq!(exchange.turn(first).take(), vec![push(5, [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], When::Kick)]);
        assert_eq!(exchange.posted, exchange.delivered);
    }

    #[test]
    fn what_passes_of_one_interval_say_counts_once() {
        let mut exchange = Exchange::default();
        let (first, second) = (exchange.enter("first"), exchange.enter("second"));
        let body = exchange.open(first, 0..1, false)[0];
        let flux = exchange.open_flux(second, "plate x_low".into());
        exchange.turn(second).flow(flux, 5.0, 1.0);
        exchange.begin_repeats(0.0, 1.0);
        // A partner that answers x with 3 - x/3: the secant through 0 and 3 meets x at 2.25.
        for (pass, pushed) in [3.0, 2.0, 2.25].into_iter().enumerate() {
            if pass > 0 {
                exchange.repeat();
            }
            let taken = exchange.turn(first).take().iter().map(|push| push.impulse.x).sum::<f64>();
            assert_eq!(taken, [0.0, 3.0, 2.25][pass]);
            exchange.passed(first);
            exchange.turn(second).flow(flux, 2.0, 0.5);
            exchange.turn(second).post(body, Vector::default(), [pushed, 0.0, 0.0].into());
            exchange.passed(second);
            // The first pass has taken nothing, the second what the first posted, the third what both agree about.
            let gap = exchange.end_pass();
            assert_eq!(gap, [None, Some(1.0 / 3.0), Some(0.0)][pass]);
        }
        assert_eq!(exchange.end_repeats(), Some((0.0, ["first".into(), "second".into()])));
        assert_eq!((exchange.fluxes()[0].heat, exchange.fluxes()[0].mass), (7.0, 1.5));
        assert_eq!((exchange.posted.x, exchange.delivered.x, exchange.turn(first).take().len()), (2.25, 2.25, 0));
    }

    #[test]
    fn surfaces_stand_in_the_order_of_their_systems() {
        let mut exchange = Exchange::default();
        let (first, second) = (exchange.enter("first"), exchange.enter("second"));
        let ball = |radius: f64| {
            let shape = Shape::Sphere { center: Vector::default(), radius };
            let (friction, belt) = (Friction::default(), Vector::default());
            let (motion, rig, edges) = (None, None, None);
            Arc::new(vec![Collider {
                name: String::new(),
                shape,
                inside: false,
                thickness: 0.0,
                friction,
                rubbing: None,
                restitution: 0.0,
                belt,
                motion,
                rig,
                edges,
            }])
        };
        exchange.turn(second).publish_surfaces(ball(2.0));
        exchange.turn(first).publish_surfaces(ball(1.0));
        let radii = |exchange: &Exchange| -> Vec<f64> {
            exchange.surfaces().iter().map(|solid| -solid.distance(Vector::default(), 0.0, f64::INFINITY).0).collect()
        };
        assert_eq!(radii(&exchange), [1.0, 2.0]);
        exchange.turn(second).publish_surfaces(ball(3.0));
        assert_eq!(radii(&exchange), [1.0, 3.0]);
    }
}
