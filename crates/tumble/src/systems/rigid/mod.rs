//! Rigid bodies with contact and friction.
//!
//!   m v' = m g + sum of p,   L' = sum of r × p,   x' = v,   q' = (0, ω) q / 2                                            (rigid.1)
//!
//! Each sub-step: gravity; contacts that may close; bounces; soft passes; bodies move and turn; rigid passes. Of bodies that joints hold and no
//! contact, half of gravity acts before they move, half after (see `joint`). Rows are there from the start: bodies that are born (`birth`) and
//! pieces that break off (`fracture`) fill those that are kept for them. Bodies are in double precision in both engines, and contacts in the
//! order of their pairs, so that a far body changes no bit.

mod birth;
mod body;
mod contact;
mod direct;
mod fracture;
mod glue;
mod joint;
mod lever;
mod overlap;
mod pattern;
mod sleep;
mod solids;
mod solve;
mod wide;

pub use birth::{Birth, any_turn};
pub use body::Body;
pub use contact::{Bodies, Hull, pose};
pub use joint::{Drive, Joint, Kind, Motor, WORLD};
pub use pattern::{Bond, Frame, Pattern, Piece, Weight, steiner};
pub use solids::refusal;

use crate::exchange::{BodyState, Push, Turn, When};
use crate::forces::Gravity;
use crate::geometry::{Collider, Vector};
use crate::integrators::equal_steps;
use crate::math::{Quat, Real};
use crate::system::{Archive, Part, System};
use birth::Births;
use contact::{CONTACT, Contact, Near};
use fracture::{Cracked, Fractures};
use joint::Joints;
use lever::Pace;
use sleep::Sleep;
use std::ops::Range;
use std::sync::Arc;
use tumble_interface::engine::{Ledger, Share, Stability, StepReport, Worst};
use tumble_interface::error::Breakdown;
use tumble_interface::{Column, Mesh, StepError};

/// Sub-steps are no longer than this, unless a scene says otherwise [s].
const STEP: f64 = 1.0 / 480.0;
/// Overlaps at the start that are told, over the reach of a body.
const OVERLAP: f64 = 1e-3;
/// Numbers of a body in a snapshot.
const BODY: usize = 13;
/// Numbers of a joint in a snapshot.
const JOINT: usize = 7;

/// Bodies of one shape.
pub struct Object {
    /// Its name.
    pub name: String,
    /// Its bodies, those that are born later last; of those that break the pieces of each side by side.
    pub rows: Range<usize>,
    /// Their surface for pictures, in their own axes.
    pub mesh: Mesh,
    /// How they are born, if that is during the run.
    pub birth: Option<Birth>,
    /// Whether they sleep where they have come to rest.
    pub sleeps: bool,
    /// How they break, if they do, and the first of their surfaces at the exchange, if others touch them.
    pub pattern: Option<(Arc<Pattern>, Option<usize>)>,
}

impl Object {
    /// Rows of a body: one, or one of each piece.
    fn each(&self) -> usize {
        self.pattern.as_ref().map_or(1, |(pattern, _)| pattern.pieces.len())
    }
}

/// Joints of one kind.
pub struct Ends {
    /// Their name.
    pub name: String,
    /// Which they are.
    pub joints: Range<usize>,
}

/// How the system goes on.
pub struct Settings {
    /// Its name.
    pub name: String,
    /// Sub-steps of an interval, if the scene says so.
    pub substeps: Option<u32>,
    /// The longest sub-step, if the scene says so [s].
    pub step: Option<f64>,
    /// Passes over all contacts.
    pub iterations: u32,
    /// Gravity.
    pub gravity: Gravity,
}

/// Rigid bodies.
pub struct Rigid {
    settings: Settings,
    objects: Vec<Object>,
    births: Vec<Births>,
    fractures: Fractures,
    bodies: Bodies,
    ends: Vec<Ends>,
    joints: Joints,
    contacts: Vec<Contact>,
    sleep: Sleep,
    /// What this interval knows of pairs.
    near: Near,
    /// Of constant forces, over this interval.
    steady: Vec<Push>,
    /// The solids of others, and of each body beyond those that move which one it is.
    solids: Arc<Vec<Collider>>,
    of: Vec<usize>,
}

impl Rigid {
    /// Bodies that move, and their objects; joints, and theirs. Rows of the unborn, and of all pieces but the first, have [`Body::WORLD`].
    pub fn new(settings: Settings, objects: Vec<Object>, bodies: Bodies, ends: Vec<Ends>, joints: Vec<Joint>) -> Self {
        let cracked = objects.iter().filter_map(|object| Some((object.rows.clone(), &object.pattern.as_ref()?.0)));
        let cracked =
            cracked.flat_map(|(rows, pattern)| rows.step_by(pattern.pieces.len()).map(|first| Cracked::new(pattern.clone(), first)));
        let fractures = Fractures::new(cracked.collect(), &joints);
        let born = |object: &Object| Births { born: if object.birth.is_some() { 0 } else { object.rows.len() / object.each() }, tried: 0 };
        let sleeps = |i: usize| objects.iter().any(|object| object.sleeps && object.rows.contains(&i));
        Self {
            births: objects.iter().map(born).collect(),
            sleep: Sleep::new((0..bodies.moving).map(sleeps).collect()),
            joints: Joints::new(joints, bodies.moving),
            settings,
            objects,
            fractures,
            bodies,
            ends,
            contacts: Vec::new(),
            near: Near::default(),
            steady: Vec::new(),
            solids: Arc::default(),
            of: Vec::new(),
        }
    }

    /// The two surfaces that overlap most at the start, by more than round-off, the index of the first, if its object has several, and how deep [m].
    pub fn overlap(&mut self) -> Option<(&str, Option<usize>, &str, f64)> {
        self.place_solids(0.0, 0.0);
        let found = Near::default()
            .contacts(&self.bodies, 0.0, &self.joints.apart(), |_| false)
            .into_iter()
            .min_by(|a, b| a.gap.total_cmp(&b.gap))?;
        let [a, b] = found.pair.map(|i| i as usize);
        let least = OVERLAP * self.bodies.hulls[self.bodies.hull[a] as usize].reach;
        let (object, row) = self.owner(a)?;
        let index = (object.rows.len() > object.each()).then_some(row / object.each());
        (-found.gap > least).then_some((&object.name, index, self.named(b)?, -found.gap))
    }

    /// Name of the object or solid of a body.
    fn named(&self, row: usize) -> Option<&str> {
        match self.owner(row) {
            Some((object, _)) => Some(&object.name),
            None => Some(&self.solids.get(*self.of.get(row - self.bodies.moving)?)?.name),
        }
    }

    /// Name in frames of the object of a body that moves, and its index there.
    fn place(&self, row: usize) -> Option<(String, usize)> {
        let (object, row) = self.owner(row)?;
        let (index, piece) = (row / object.each(), row % object.each());
        Some((if object.pattern.is_some() { piece_name(object, piece) } else { object.name.clone() }, index))
    }

    /// Object of a body that moves, and its row there.
    fn owner(&self, row: usize) -> Option<(&Object, usize)> {
        self.objects.iter().find(|object| object.rows.contains(&row)).map(|object| (object, row - object.rows.start))
    }

    /// Rows of an object up to the last body that has been born.
    fn born(&self, k: usize) -> Range<usize> {
        let object = &self.objects[k];
        object.rows.start..object.rows.start + self.births[k].born * object.each()
    }

    /// Bodies are born that are due at a time [s] and find room.
    fn bear(&mut self, t: f64) {
        for k in 0..self.objects.len() {
            let (object, births) = (&self.objects[k], &mut self.births[k]);
            let Some(birth) = &object.birth else { continue };
            while births.born < birth.due(t) {
                let row = object.rows.start + births.born * object.each();
                let Some(body) = birth.next(births, &self.bodies, row) else { break };
                self.bodies.rows[row] = body;
                births.born += 1;
                self.near = Near::default();
            }
        }
    }

    /// Bodies fall apart whose glue this sub-step of h [s] has loaded too much.
    fn crack(&mut self, blows: &[solve::Blow], h: f64) {
        if self.fractures.all.is_empty() {
            return;
        }
        let fallen = self.fractures.crack(&mut self.bodies, &self.contacts, blows, &self.joints.all, h);
        if !fallen.is_empty() {
            self.near = Near::default();
            self.fractures.hold(&mut self.joints.all);
            let stays = |i: u32| fallen.iter().all(|fallen| fallen.row != i as usize);
            self.contacts.retain(|contact| contact.pair.into_iter().all(stays));
            for fallen in &fallen {
                let (own, others): (Vec<Push>, Vec<Push>) = self.steady.drain(..).partition(|push| push.row == fallen.row);
                self.steady = others;
                self.steady.extend(own.iter().flat_map(|push| fallen.share(&self.bodies.rows, push)));
            }
        }
    }

    fn steps(&self, dt: f64) -> u32 {
        self.settings.substeps.unwrap_or_else(|| equal_steps(dt, self.settings.step.unwrap_or(STEP)) as u32)
    }

    /// Takes over solids that others have published.
    pub fn meet(&mut self, solids: &Arc<Vec<Collider>>) {
        if Arc::ptr_eq(solids, &self.solids) {
            return;
        }
        let bodies = &mut self.bodies;
        let own = bodies.hull[..bodies.moving].iter().max().map_or(0, |last| *last as usize + 1);
        bodies.hulls.truncate(own);
        bodies.hull.truncate(bodies.moving);
        self.of.clear();
        for (k, solid) in solids.iter().enumerate() {
            for hull in solids::hulls(solid) {
                bodies.hull.push(bodies.hulls.len() as u32);
                bodies.hulls.push(hull);
                self.of.push(k);
            }
        }
        self.solids = solids.clone();
    }

    /// Puts solids where they are at a time [s].
    fn place_solids(&mut self, t: f64, h: f64) {
        let bodies = &mut self.bodies;
        bodies.rows.truncate(bodies.moving);
        for (place, k) in self.of.iter().enumerate() {
            let solid = &self.solids[*k];
            bodies.rows.push(solids::body(solid, t, h));
            bodies.hulls[bodies.hull[bodies.moving + place] as usize].friction = solid.friction_at(t);
        }
    }

    /// Gives bodies a part of their impulses.
    fn push(&mut self, pushes: &[Push], part: f64) {
        for push in pushes {
            if [push.impulse, push.moment] != [Vector::default(); 2] {
                self.sleep.wake(push.row);
            }
            let body = &mut self.bodies.rows[push.row];
            body.orient();
            let impulse = push.impulse * part;
            body.v = body.v + impulse * body.inverse_mass;
            let about = if push.when == When::Central { Vector::default() } else { body.x.cross(impulse) };
            body.w = body.w + body.turned(push.moment * part - about);
        }
    }

    /// Displaces free bodies by what timed impulses have done to a visitor's copy beyond what they do here: over the interval each of their
    /// sub-steps gets an equal part, which then acts for `mean` seconds.                                              (coupling.9)
    fn shift(&mut self, mean: f64) {
        if self.steady.iter().all(|push| push.when != When::Timed) {
            return;
        }
        let (mut held, moving) = (self.borne(), self.bodies.moving);
        for i in self.joints.pairs().flatten().filter(|i| (*i as usize) < moving) {
            held[i as usize] = true;
        }
        for push in self.steady.iter().filter(|push| push.when == When::Timed && !held[push.row]) {
            let body = &mut self.bodies.rows[push.row];
            let [way, turn] = push.ways;
            body.orient();
            let angular = push.moment - body.x.cross(push.impulse);
            body.displace((way - push.impulse * mean) * body.inverse_mass, body.turned(turn - angular * mean));
        }
    }

    /// What this part of constant forces through their centres changes of the velocity of bodies [m/s].
    fn gains(&self, part: f64) -> Vec<Vector> {
        let mut gains = vec![Vector::default(); self.bodies.moving];
        for push in self.steady.iter().filter(|push| push.when == When::Central) {
            gains[push.row] = gains[push.row] + push.impulse * (part * self.bodies.rows[push.row].inverse_mass);
        }
        gains
    }

    /// A sub-step of h seconds; constant forces through the centres of bodies have changed their velocities by `gains` for it.
    fn step(&mut self, t: f64, h: f64, gains: &[Vector]) {
        self.place_solids(t, h);
        self.bear(t);
        let gravity = Vector::from(self.settings.gravity.at(t + 0.5 * h));
        let moving = self.bodies.moving;
        self.sleep.look(&self.bodies, &self.contacts, gravity);
        let mut falls: Vec<usize> = (0..moving).filter(|i| self.bodies.is_there(*i) && !self.sleep.is_asleep(*i)).collect();
        if falls.is_empty() {
            return;
        }
        let mut contacts = Vec::new();
        while !falls.is_empty() {
            for i in falls {
                let body = &mut self.bodies.rows[i];
                body.orient();
                body.v = body.v + gravity * h;
            }
            contacts = self.near.contacts(&self.bodies, h, &self.joints.apart(), |pair| self.sleep.rests(pair));
            // What comes near wakes all that hangs together with it.
            falls = self.sleep.spread(&contacts);
            if !falls.is_empty() {
                falls.extend(self.sleep.spread(&self.contacts));
            }
        }
        contact::carry(&self.bodies, &self.contacts, &mut contacts);
        let awake: Vec<bool> = (0..moving).map(|i| self.bodies.is_there(i) && !self.sleep.is_asleep(i)).collect();
        let pace = Pace { t, h, iterations: self.settings.iterations, still: 2.0 * gravity.norm() * h, gravity };
        let rows = &mut self.bodies.rows;
        let blows = solve::bounce(rows, &contacts, &pace);
        // What joints hold and no contact has half of gravity before it moves.
        let mut hangs = vec![false; rows.len()];
        self.joints.held().for_each(|i| hangs[i as usize] = true);
        contacts.iter().filter(|c| c.press > 0.0).flat_map(|c| c.pair).for_each(|i| hangs[i as usize] = false);
        let half = gravity * (0.5 * h);
        rows.iter_mut().zip(&hangs).filter(|(_, hangs)| **hangs).for_each(|(body, _)| body.v = body.v - half);
        solve::solve(rows, &mut contacts, &mut self.joints, &pace, |rows, contacts, joints| {
            // What nothing holds moves along the exact parabola.
            let mut held = vec![false; rows.len()];
            joints.held().for_each(|i| held[i as usize] = true);
            contacts.iter().filter(|c| c.press > 0.0).flat_map(|c| c.pair).for_each(|i| held[i as usize] = true);
            let all = rows[..moving].iter_mut().zip(held).zip(hangs).zip(gains);
            for ((((body, held), hangs), gain), _) in all.zip(&awake).filter(|(_, awake)| **awake) {
                body.flatten();
                body.x = body.x + body.v * h - if held { Vector::default() } else { (gravity * h + *gain) * (0.5 * h) };
                body.turn_freely(h);
                body.orient();
                body.v = body.v + if hangs { half } else { Vector::default() };
            }
        });
        self.bodies.rows[..moving].iter_mut().for_each(Body::flatten);
        if self.sleep.any() {
            contacts.extend(self.contacts.drain(..).filter(|contact| self.sleep.rests(contact.pair)));
            contacts.sort_by_key(|contact| contact.pair);
        }
        self.contacts = contacts;
        self.crack(&blows, h);
        self.sleep.rest(&mut self.bodies, &self.contacts, self.joints.held(), gravity, h);
    }

    /// Which bodies a solid or the world holds, directly or by other bodies; all others fall, whatever they do to each other.
    fn borne(&self) -> Vec<bool> {
        let moving = self.bodies.moving;
        let contacts = self.contacts.iter().filter(|contact| contact.press > 0.0).map(|contact| contact.pair);
        let pairs: Vec<[usize; 2]> = contacts.chain(self.joints.pairs()).map(|pair| pair.map(|i| i as usize)).collect();
        let mut beside = vec![Vec::new(); moving];
        for [a, b] in &pairs {
            for (one, other) in [(*a, *b), (*b, *a)] {
                if one < moving {
                    beside[one].push(other);
                }
            }
        }
        let (mut borne, mut next) = (vec![false; moving], Vec::new());
        next.extend((0..moving).filter(|i| beside[*i].iter().any(|other| *other >= moving)));
        while let Some(i) = next.pop() {
            if !std::mem::replace(&mut borne[i], true) {
                next.extend(beside[i].iter().copied().filter(|other| *other < moving));
            }
        }
        borne
    }

    /// What bears each body: the direction away from it, by the loads of its contacts, zero if joints alone do, or nothing; and its footing.
    fn supports(&self, borne: &[bool]) -> Vec<(Vector, (Vector, [f64; 6]))> {
        let mut feet: Vec<Vec<(Vector, Vector)>> = vec![Vec::new(); borne.len()];
        let holds = |i: usize| borne.get(i).is_none_or(|borne| *borne);
        for contact in self.contacts.iter().filter(|contact| contact.press > 0.0) {
            let [a, b] = contact.pair.map(|i| i as usize);
            for (k, one, other, away) in [(0, a, b, -contact.normal), (1, b, a, contact.normal)] {
                if one < feet.len() && holds(other) {
                    feet[one].push((self.bodies.rows[one].x + contact.arms[k], away * contact.press));
                }
            }
        }
        let support = |feet: Vec<(Vector, Vector)>| {
            let normal = feet.iter().fold(Vector::default(), |sum, (_, load)| sum + *load).normalized();
            // Those that press on it from the other side do not bear it.
            let below: Vec<Vector> = feet.iter().filter(|(_, load)| load.dot(normal) > 0.0).map(|(place, _)| *place).collect();
            let share = 1.0 / below.len().max(1) as f64;
            let foot = below.iter().fold(Vector::default(), |sum, place| sum + *place * share);
            let mut spread = [0.0; 6];
            for Vector { x, y, z } in below.into_iter().map(|place| place - foot) {
                spread.iter_mut().zip([x * x, y * y, z * z, x * y, y * z, z * x]).for_each(|(sum, part)| *sum += part * share);
            }
            (normal, (foot, spread))
        };
        feet.into_iter().map(support).collect()
    }

    /// Rows have the masses of those that are there, as births and broken bonds say.
    fn fill(&mut self, mut broken: &[u8]) {
        for k in 0..self.objects.len() {
            let born = self.born(k);
            let object = &self.objects[k];
            if let (Some(birth), None) = (&object.birth, &object.pattern) {
                for row in object.rows.clone() {
                    let body = &mut self.bodies.rows[row];
                    let like = if born.contains(&row) { &birth.like } else { &Body::WORLD };
                    (body.inverse_mass, body.inertia) = (like.inverse_mass, like.inertia);
                    body.inverse_inertia = [0.0; 6];
                }
            }
        }
        let ends: Vec<Range<usize>> = (0..self.objects.len()).map(|k| self.born(k)).collect();
        for cracked in &mut self.fractures.all {
            let (own, rest) = broken.split_at(cracked.broken.len());
            broken = rest;
            let born = ends.iter().any(|rows| rows.contains(&cracked.first));
            cracked.restore(own.iter().map(|broken| *broken == 1).collect(), born, &mut self.bodies);
        }
        self.fractures.hold(&mut self.joints.all);
    }

    fn moving(&self) -> &[Body] {
        &self.bodies.rows[..self.bodies.moving]
    }

    fn ledger_of(&self, rows: Range<usize>, t: f64) -> Ledger {
        let gravity = Vector::from(self.settings.gravity.at(t));
        let (mut momentum, mut spin, mut speed) = (Vector::default(), Vector::default(), 0.0_f64);
        let mut ledger = Ledger { time: t, ..Ledger::default() };
        for body in self.moving()[rows.clone()].iter().filter(|body| body.inverse_mass > 0.0) {
            let mass = 1.0 / body.inverse_mass;
            ledger.mass += mass;
            momentum = momentum + body.v * mass;
            spin = spin + body.x.cross(body.v * mass) + body.spin();
            ledger.kinetic += body.kinetic();
            ledger.external -= mass * gravity.dot(body.x);
            speed = speed.max(body.v.norm());
        }
        let mine = |c: &&Contact| c.pair.iter().any(|i| rows.contains(&(*i as usize)));
        let mut touching: Vec<u32> = self.contacts.iter().filter(mine).filter(|c| c.press > 0.0).flat_map(|c| c.pair).collect();
        touching.sort_unstable();
        touching.dedup();
        let depth = self.contacts.iter().filter(mine).map(|c| -c.gap).fold(0.0, f64::max);
        Ledger {
            momentum: momentum.into(),
            angular_momentum: Some(spin.into()),
            speed: Some(speed),
            penetration: Some(depth),
            contacts: Some(touching.iter().filter(|i| rows.contains(&(**i as usize))).count() as u64),
            ..ledger
        }
    }

    /// The first body that is not finite.
    fn lost(&self, t: f64) -> Option<StepError> {
        // As columns have them, too.
        let finite = |v: Vector| <[f64; 3]>::from(v).iter().all(|c| (*c as Real).is_finite());
        let bad = |body: &Body| match (finite(body.x) && body.q.row().iter().all(|c| c.is_finite()), finite(body.v) && finite(body.w)) {
            (false, _) => Some("position"),
            (_, false) => Some("velocity"),
            _ => None,
        };
        let (row, column) = self.moving().iter().enumerate().find_map(|(i, body)| Some((i, bad(body)?)))?;
        let (object, index) = self.place(row)?;
        Some(StepError::NotFinite(Box::new(Breakdown {
            system: self.settings.name.clone(),
            object,
            column: column.into(),
            index,
            id: None,
            cell: None,
            time: t,
            integrator: "rigid".into(),
            step: 0.0,
            stable_step: f64::INFINITY,
            energy_ratio: None,
            cause: None,
        })))
    }
}

/// Name in frames of a piece of the bodies of an object.
fn piece_name(object: &Object, piece: usize) -> String {
    format!("{}.{}", object.name, piece + 1)
}

/// The columns of bodies.
fn body_columns(object: &str, bodies: &[Body], names: &[&str], out: &mut Vec<Column>) {
    let vectors =
        |f: fn(&Body) -> Vector| -> Vec<Real> { bodies.iter().flat_map(|body| <[f64; 3]>::from(f(body)).map(|c| c as Real)).collect() };
    for name in names {
        let data = match *name {
            "position" => vectors(|body| body.x),
            "velocity" => vectors(|body| body.v),
            "angular_velocity" => vectors(|body| body.w),
            _ => continue,
        };
        out.push(Column::new(object, name, data));
    }
    let turns: Vec<Real> = bodies.iter().flat_map(|body| body.q.row().map(|c| c as Real)).collect();
    out.push(Column::new(object, "turn", turns));
}

impl System for Rigid {
    fn name(&self) -> &str {
        &self.settings.name
    }

    fn version(&self) -> u32 {
        4
    }

    fn absorb(&mut self, exchange: &mut Turn<'_>) {
        let (steady, kicks): (Vec<Push>, Vec<Push>) = exchange.take().into_iter().partition(|push| push.when != When::Kick);
        self.push(&kicks, 1.0);
        self.steady.extend(steady);
    }

    fn advance(&mut self, t: f64, dt: f64, exchange: &mut Turn<'_>, go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError> {
        self.meet(&exchange.surfaces().clone());
        let mut report = StepReport::default();
        let n = self.steps(dt);
        let h = dt / f64::from(n);
        self.shift(0.5 * (dt + h));
        let gains = self.gains(1.0 / f64::from(n));
        self.near = Near::default();
        for k in 0..n {
            if !go_on() {
                return Ok(report);
            }
            let steady = std::mem::take(&mut self.steady);
            self.push(&steady, 1.0 / f64::from(n));
            self.steady = steady;
            self.step(t + f64::from(k) * h, h, &gains);
            report.stepped(h);
        }
        self.steady.clear();
        Ok(report)
    }

    fn publish(&mut self, t: f64, exchange: &mut Turn<'_>) {
        let asked = exchange.bodies().any(|body| body.detailed);
        let borne = if asked { self.borne() } else { Vec::new() };
        let bears = if asked { self.supports(&borne) } else { Vec::new() };
        let gravity = Vector::from(self.settings.gravity.at(t));
        for body in exchange.bodies() {
            body.time = t;
            for (state, i) in body.states.iter_mut().zip(body.rows.clone()) {
                let (normal, footing) = if body.detailed { bears[i] } else { Default::default() };
                let row = &mut self.bodies.rows[i];
                if row.inverse_mass == 0.0 {
                    *state = BodyState { present: false, ..BodyState::default() };
                    continue;
                }
                row.orient();
                *state = BodyState {
                    position: row.x,
                    orientation: row.q,
                    velocity: row.v,
                    spin: row.w,
                    inverse_mass: row.inverse_mass,
                    inverse_inertia: row.inverse_inertia,
                    acceleration: if body.detailed { gravity } else { Vector::default() },
                    borne: body.detailed && borne[i],
                    normal,
                    footing,
                    present: true,
                };
            }
        }
        let firsts = self.objects.iter().filter_map(|object| Some((object.rows.start, object.pattern.as_ref()?.1?)));
        let firsts: Vec<(usize, usize)> = firsts.collect();
        for cracked in self.fractures.all.iter_mut().filter(|cracked| cracked.fresh) {
            cracked.fresh = false;
            let Some((row, cover)) = firsts.iter().rfind(|(row, _)| *row <= cracked.first) else { continue };
            for (k, (solid, reach, volume)) in cracked.covers.iter().enumerate() {
                exchange.cover_anew(cover + cracked.first - row + k, solid, *reach, *volume);
            }
        }
    }

    fn columns(&self, _t: f64, names: &[&str], out: &mut Vec<Column>) {
        for (k, object) in self.objects.iter().enumerate() {
            let Some((pattern, _)) = &object.pattern else {
                body_columns(&object.name, &self.moving()[self.born(k)], names, out);
                continue;
            };
            let first = self.fractures.all.partition_point(|cracked| cracked.first < object.rows.start);
            for piece in 0..pattern.pieces.len() {
                let of = self.fractures.all[first..first + self.births[k].born].iter();
                let bodies: Vec<Body> = of.map(|cracked| cracked.piece(&self.bodies.rows, piece)).collect();
                body_columns(&piece_name(object, piece), &bodies, names, out);
            }
        }
        for Ends { name: object, joints } in &self.ends {
            // The first body's end comes first. Those of what has broken are in one place, where nobody sees them.
            let ends = |joint: &Joint| {
                let [a, b] = joint.ends(&self.bodies.rows);
                if joint.broken { [b, b] } else { [b, a] }
            };
            for name in names {
                let of: Vec<[Vector; 2]> = match *name {
                    "position" => self.joints.all[joints.clone()].iter().map(ends).collect(),
                    "force" => self.joints.all[joints.clone()].iter().map(|joint| [joint.load[0], -joint.load[0]]).collect(),
                    _ => continue,
                };
                out.push(Column::new(
                    object,
                    name,
                    of.into_iter().flatten().flat_map(|v| <[f64; 3]>::from(v).map(|c| c as Real)).collect::<Vec<_>>(),
                ));
            }
        }
    }

    fn topology(&self, out: &mut Vec<Column>) {
        let mut of = |name: &str, mesh: &Mesh, mass: f64, count: usize| {
            out.push(Column::new(name, "vertices", mesh.vertices.concat()));
            out.push(Column::new(name, "triangles", mesh.triangles.concat()));
            out.push(Column::new(name, "mass", vec![mass as Real; count]));
        };
        for object in &self.objects {
            let Some((pattern, _)) = &object.pattern else {
                let body = object.birth.as_ref().map_or(&self.bodies.rows[object.rows.start], |birth| &birth.like);
                of(&object.name, &object.mesh, 1.0 / body.inverse_mass, object.rows.len());
                continue;
            };
            for (k, piece) in pattern.pieces.iter().enumerate() {
                of(&piece_name(object, k), &piece.mesh, piece.weight.mass, object.rows.len() / object.each());
            }
        }
        for Ends { name, joints } in &self.ends {
            let lines = |joint: &Joint| matches!(joint.kind, Kind::Rope(_) | Kind::Spring(_) | Kind::Slider);
            if self.joints.all[joints.clone()].iter().all(lines) {
                out.push(Column::new(name, "links", (0..2 * joints.len() as u32).collect::<Vec<u32>>()));
            }
        }
    }

    fn ledger(&self, t: f64) -> Ledger {
        let elastic = self.joints.all.iter().map(|joint| joint.energy(&self.bodies.rows, t)).sum();
        let broken = self.joints.all.iter().filter(|joint| joint.broken).count() as u64 + self.fractures.broken();
        let breaks = !self.ends.is_empty() || !self.fractures.all.is_empty();
        Ledger { elastic, broken: breaks.then_some(broken), ..self.ledger_of(0..self.bodies.moving, t) }
    }

    fn shares(&self, t: f64) -> Vec<Share> {
        let share = |object: &Object| Share {
            system: self.settings.name.clone(),
            object: object.name.clone(),
            ledger: self.ledger_of(object.rows.clone(), t),
        };
        self.objects.iter().map(share).collect()
    }

    fn worst(&self, _t: f64) -> Vec<Worst> {
        let of = |measure, value, row: usize, other: Option<usize>| {
            let (object, index) = self.place(row)?;
            let other = other.and_then(|row| self.named(row)).map(str::to_string);
            Some(Worst { measure, value, object, other, particles: vec![index], id: None, cell: None })
        };
        let speeds = self.moving().iter().map(|body| body.v.norm()).enumerate();
        let fastest = speeds.max_by(|a, b| a.1.total_cmp(&b.1)).and_then(|(row, speed)| of("speed", speed, row, None));
        let deepest = self.contacts.iter().filter(|c| c.gap < 0.0).min_by(|a, b| a.gap.total_cmp(&b.gap));
        let deepest = deepest.and_then(|c| of("penetration", -c.gap, c.pair[0] as usize, Some(c.pair[1] as usize)));
        fastest.into_iter().chain(deepest).collect()
    }

    fn breakdown(&mut self, t: f64) -> Option<StepError> {
        self.lost(t)
    }

    fn watch(&mut self, _on: bool) {}

    fn stability(&mut self, _dt: f64, _go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability> {
        None
    }

    fn save(&self, archive: &mut Archive) {
        let three = <[f64; 3]>::from;
        let rows = self.moving().iter().flat_map(|b| [&three(b.x)[..], &b.q.row(), &three(b.v), &three(b.w)].concat());
        archive.push("bodies", Part::Numbers(rows.collect()));
        let pairs: Vec<u32> = self.contacts.iter().flat_map(|c| c.pair).collect();
        archive.push_indices("pairs", &pairs);
        archive.push("contacts", Part::Numbers(self.contacts.iter().flat_map(Contact::numbers).collect()));
        let joint = |j: &Joint| [&[f64::from(u8::from(j.broken))][..], &three(j.load[0]), &three(j.load[1])].concat();
        archive.push("joints", Part::Numbers(self.joints.all.iter().flat_map(joint).collect()));
        let births: Vec<u32> = self.births.iter().flat_map(|births| [births.born as u32, births.tried]).collect();
        archive.push_indices("births", &births);
        let broken: Vec<u8> = self.fractures.all.iter().flat_map(|cracked| &cracked.broken).map(|broken| u8::from(*broken)).collect();
        archive.push("broken", Part::Bytes(broken));
        for (name, numbers) in ["still", "around"].into_iter().zip(self.sleep.numbers()) {
            archive.push(name, Part::Numbers(numbers.to_vec()));
        }
    }

    fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        let (bodies, pairs, contacts) = (archive.numbers("bodies")?, archive.indices("pairs")?, archive.numbers("contacts")?);
        let joints = archive.numbers("joints")?;
        let (births, broken) = (archive.indices("births")?, archive.bytes("broken")?.to_vec());
        let (still, around) = (archive.numbers("still")?, archive.numbers("around")?);
        self.sleep.restore(&still, &around)?;
        // Of an interval that was cut short.
        self.steady.clear();
        if bodies.len() != BODY * self.bodies.moving
            || contacts.len() * 2 != CONTACT * pairs.len()
            || joints.len() != JOINT * self.joints.all.len()
            || births.len() != 2 * self.births.len()
            || broken.len() != self.fractures.all.iter().map(|cracked| cracked.broken.len()).sum::<usize>()
        {
            return None;
        }
        let three = |s: &[f64]| Vector { x: s[0], y: s[1], z: s[2] };
        for (body, s) in self.bodies.rows.iter_mut().zip(bodies.chunks_exact(BODY)) {
            body.x = three(s);
            body.q = Quat { v: three(&s[3..]), w: s[6] };
            (body.v, body.w) = (three(&s[7..]), three(&s[10..]));
        }
        for (own, s) in self.births.iter_mut().zip(births.chunks_exact(2)) {
            *own = Births { born: s[0] as usize, tried: s[1] };
        }
        self.fill(&broken);
        for (joint, s) in self.joints.all.iter_mut().zip(joints.chunks_exact(JOINT)) {
            (joint.broken, joint.load) = (s[0] == 1.0, [three(&s[1..]), three(&s[4..])]);
        }
        let kept = pairs.chunks_exact(2).zip(contacts.chunks_exact(CONTACT));
        self.contacts = kept.map(|(pair, numbers)| Contact::kept([pair[0], pair[1]], numbers)).collect();
        Some(())
    }

    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool> {
        let k = self.objects.iter().position(|o| o.name == object)?;
        let rows = self.born(k);
        if self.objects[k].pattern.is_some() {
            return Some(false);
        }
        let width = if column == "turn" { 4 } else { 3 };
        if !matches!(column, "position" | "velocity" | "angular_velocity" | "turn") || values.len() != width * rows.len() {
            return Some(false);
        }
        self.sleep.wake_all();
        for (body, s) in self.bodies.rows[rows].iter_mut().zip(values.chunks_exact(width)) {
            match column {
                "turn" => body.q = Quat { v: [s[0], s[1], s[2]].into(), w: s[3] }.normalized(),
                "position" => body.x = [s[0], s[1], s[2]].into(),
                "velocity" => body.v = [s[0], s[1], s[2]].into(),
                _ => body.w = [s[0], s[1], s[2]].into(),
            }
        }
        Some(true)
    }
}
