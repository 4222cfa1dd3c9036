//! Rigid bodies among people: they stand in the way, knock down and hurt; people push what they can, and find other ways around what they
//! cannot.
//!
//! A person is an upright capsule, and who has fallen a ball on the floor. A blow is plastic: with n from the body to the person,
//!
//!   J = c / (1/m + n . K n),   c = (v_body - v_person) . n > 0,   E = J c / 2                             (crowds.14)
//!
//! K being how the body yields at the point. The body gets -J n, the person J n, of which the floor bears the part along it. Who gets more than
//! `fall_speed` by a blow falls, whom a blow of more than `injury_energy` hits stays down.
//!
//! Sources: [hof2005] for falls, [dod2008] for injuries. Limits: between two bodies, or a body and a wall, nobody is crushed.
//! Tests: crates/tumble-f64/tests/rocks.rs.

use super::around::Person;
use super::floor::Floor;
use super::near::Near;
use super::plan::{Point, length};
use super::touch::Touch;
use crate::exchange::{Exchange, Turn, Visit};
use crate::geometry::{Collider, Vector};
use crate::math::functions::{cos, sin};
use crate::math::parallel;
use std::sync::Arc;

/// Height of people [m], and of what they step over.
pub const STATURE: f64 = 1.75;
const STEP: f64 = 0.2;
/// Force with which a person pushes at most [N], and distance at which it does [m].
const STRENGTH: f64 = 250.0;
const TOUCH: f64 = 0.05;
/// Deceleration of who has been pushed [m/s²].
const BRAKES: f64 = 5.0;
/// How far from a person bodies are seen [m].
const SIGHT: f64 = 1.0;
/// Speed below which a body rests [m/s].
const REST: f64 = 0.05;
/// Friction on the floor by which people judge what they can push.
const FRICTION: f64 = 0.5;
/// Places along the axis of a person at which the distance is measured, and thirds of it that are left out then, where the body touches and elsewhere.
const SAMPLES: usize = 8;
const CLOSE: usize = 24;
const ROUGH: usize = 4;

/// What people withstand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frailty {
    /// Mass of a person [kg].
    pub mass: f64,
    /// Who gets faster by a blow falls [m/s].
    pub fall_speed: f64,
    /// After this time it rises [s].
    pub rise_time: f64,
    /// Energy of a blow that injures [J].
    pub injury_energy: f64,
    /// Whether people are disks in a plane.
    pub flat: bool,
}

/// The bodies of others among people.
#[derive(Debug, Default)]
pub struct Bodies {
    shapes: Vec<Arc<Collider>>,
    visits: Vec<(Visit, usize)>,
    near: Near,
    /// By rows.
    touches: Vec<Touch>,
}

impl Bodies {
    /// Takes the bodies of others as they are at the start of an interval.
    pub fn begin(&mut self, exchange: &Exchange) {
        let surfaces = exchange.body_surfaces();
        self.shapes = surfaces.iter().map(|surface| surface.solid.clone()).collect();
        self.visits.clear();
        for (shape, surface) in surfaces.iter().enumerate() {
            let present = surface.rows.iter().filter(|at| exchange.state_before(**at).present);
            let reach = surface.reach + surface.solid.thickness;
            self.visits.extend(present.map(|at| (Visit::new(exchange, *at, reach), shape)));
        }
    }

    /// Gives them what they have got.
    pub fn post(&self, exchange: &mut Turn<'_>) {
        self.visits.iter().for_each(|(visit, _)| visit.post_timed(exchange));
    }

    /// Moves them on for h [s].
    pub fn advance(&mut self, h: f64) {
        self.visits.iter_mut().for_each(|(visit, _)| visit.advance(h));
    }

    /// The bodies near a person.
    pub fn of(&self, row: u32) -> &[Touch] {
        let start = self.touches.partition_point(|touch| touch.row < row);
        let count = self.touches[start..].partition_point(|touch| touch.row == row);
        &self.touches[start..start + count]
    }

    /// Blows and pushes in a step from t to t + h [s].
    pub fn meet(&mut self, people: &mut [Person], frailty: &Frailty, t: f64, h: f64) {
        self.visits.iter_mut().for_each(|(visit, _)| visit.accelerate(h));
        self.find(people, frailty);
        for touch in &self.touches {
            let (person, (body, _)) = (&mut people[touch.row as usize], &mut self.visits[touch.body as usize]);
            if touch.gap < 0.0 {
                strike(person, body, touch, frailty, t);
            }
            if touch.gap < TOUCH && person.walks(t) {
                push(person, body, touch, h);
            }
        }
        for person in people {
            let speed = length(person.slide);
            let left = (speed - BRAKES * h).max(0.0);
            person.slide = if speed > 0.0 { person.slide.map(|v| v * left / speed) } else { [0.0; 2] };
        }
    }

    /// Finds who is near which body.
    fn find(&mut self, people: &[Person], frailty: &Frailty) {
        self.touches.clear();
        if self.visits.is_empty() || people.is_empty() {
            return;
        }
        self.near.sort(SIGHT, people.iter().map(|p| p.x));
        let (near, visits, shapes) = (&self.near, &self.visits, &self.shapes);
        let widest = people.iter().map(|p| p.radius).fold(0.0, f64::max);
        let found = parallel::map(visits.len(), |k| {
            let (visit, shape) = &visits[k];
            let x = visit.state.position;
            let range = visit.reach + widest + SIGHT;
            let mut touches = Vec::new();
            if !frailty.flat && x.z > STATURE + range {
                return touches;
            }
            for run in near.runs([x.x, x.y], range) {
                for row in &near.order[run] {
                    let person = &people[*row as usize];
                    let axis = axis(person, frailty);
                    if let Some((gap, n, at)) = nearest(&shapes[*shape], visit, person.x, axis, person.radius, SIGHT) {
                        touches.push(Touch { row: *row, body: k as u32, n, gap, at });
                    }
                }
            }
            touches
        });
        self.touches.extend(found.into_iter().flatten());
        self.touches.sort_by_key(|touch| (touch.row, touch.body));
    }

    /// Cells of a floor where nobody can be, as bodies rest there that nobody can push.
    pub fn closes(&self, floor: &Floor, frailty: &Frailty) -> Vec<u32> {
        let rests = |(visit, _): &&(Visit, usize)| {
            let mass = if visit.state.inverse_mass > 0.0 { 1.0 / visit.state.inverse_mass } else { f64::INFINITY };
            visit.fastest() < REST && mass * FRICTION * 9.81 > STRENGTH
        };
        let resting: Vec<&(Visit, usize)> = self.visits.iter().filter(rests).collect();
        let radius = floor.radius();
        let closed = parallel::map(resting.len(), |k| {
            let (visit, shape) = resting[k];
            let x = visit.state.position;
            let least = radius - 0.5 * floor.side();
            let axis = if frailty.flat { [0.0; 2] } else { [STEP + least, STATURE - least] };
            let is_closed = |cell: &u32| nearest(&self.shapes[*shape], visit, floor.middle(*cell), axis, least, 0.0).is_some();
            floor.cells_around([x.x, x.y], visit.reach + radius).filter(is_closed).collect::<Vec<u32>>()
        });
        let mut closed = closed.concat();
        closed.sort_unstable();
        closed.dedup();
        closed
    }
}

/// The heights between which the axis of a person lies [m].
fn axis(person: &Person, frailty: &Frailty) -> [f64; 2] {
    match (frailty.flat, person.lies) {
        (true, _) => [0.0; 2],
        (false, true) => [person.radius; 2],
        (false, false) => [STEP + person.radius, STATURE - person.radius],
    }
}

/// The least distance [m] of a body from the surface of a capsule around a vertical axis at x, less than `within`; the direction from the body, and
/// the place on it.
fn nearest(shape: &Collider, visit: &Visit, x: Point, [low, high]: [f64; 2], radius: f64, within: f64) -> Option<(f64, Vector, Vector)> {
    let state = &visit.state;
    let place = |z: f64| Vector { x: x[0], y: x[1], z };
    // The nearest place of the axis to the centre: beyond the reach nothing is near.
    let arm = place(state.position.z.clamp(low, high)) - state.position;
    if arm.norm() > visit.reach + radius + within {
        return None;
    }
    let at = |z: f64| shape.surface(state.orientation.conj().turn(place(z) - state.position), 0.0, f64::INFINITY);
    let mut z = low;
    if high > low {
        let step = (high - low) / SAMPLES as f64;
        let sample = |k: usize| (low + step * k as f64, at(low + step * k as f64).0);
        let best = (0..=SAMPLES).map(sample).reduce(|a, b| if b.1 < a.1 { b } else { a })?;
        let (mut a, mut b) = ((best.0 - step).max(low), (best.0 + step).min(high));
        // Where the body is convex, so is its distance along the axis.
        for _ in 0..if best.1 < radius + TOUCH { CLOSE } else { ROUGH } {
            let (u, v) = (a + (b - a) / 3.0, b - (b - a) / 3.0);
            if at(u).0 <= at(v).0 { b = v } else { a = u }
        }
        z = 0.5 * (a + b);
        if at(z).0 > best.1 {
            z = best.0;
        }
    }
    let (distance, normal, _) = at(z);
    let n = state.orientation.turn(normal);
    (distance - radius < within).then(|| (distance - radius, n, place(z) - n * distance))
}

/// A body hits a person who overlaps with it.                                                            (crowds.14)
fn strike(person: &mut Person, body: &mut Visit, touch: &Touch, frailty: &Frailty, t: f64) {
    let n = touch.n;
    // Getting out of a body is no velocity: who does not walk has that of blows alone.
    let [x, y] = if person.walks(t) { person.v } else { person.slide };
    let own = Vector { x, y, z: 0.0 };
    let closing = (body.state.velocity_at(touch.at) - own).dot(n);
    // Who walks into something slow hits nothing.
    if closing <= 0.0 || body.state.velocity_at(touch.at).dot(n) <= 0.0 {
        return;
    }
    let yields = body.yields_to(touch.at, n, n).dot(n);
    let j = closing / (1.0 / frailty.mass + yields);
    body.take(touch.at, n * -j, touch.at.cross(n * -j), n);
    let gain = j / frailty.mass;
    person.slide = [person.slide[0] + gain * n.x, person.slide[1] + gain * n.y];
    if 0.5 * j * closing >= frailty.injury_energy {
        person.up = f64::INFINITY;
    } else if gain >= frailty.fall_speed {
        person.up = person.up.max(t + frailty.rise_time);
    }
}

/// A person pushes what is in its way.
fn push(person: &Person, body: &mut Visit, touch: &Touch, h: f64) {
    let Some(n) = touch.ahead() else { return };
    let toward = Vector { x: -n[0], y: -n[1], z: 0.0 };
    let along = cos(person.heading) * toward.x + sin(person.heading) * toward.y;
    let missing = along * person.free - body.state.velocity_at(touch.at).dot(toward);
    let yields = body.yields_to(touch.at, toward, touch.n).dot(toward);
    if along > 0.0 && missing > 0.0 && yields > 0.0 {
        let impulse = toward * (missing / yields).min(STRENGTH * along * h);
        body.take(touch.at, impulse, touch.at.cross(impulse), touch.n);
    }
}
