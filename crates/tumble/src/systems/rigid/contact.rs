//! Contacts between bodies: pairs by sorted bounds, points by Parry.

use super::body::Body;
use super::overlap;
use crate::geometry::{Friction, Vector};
use crate::math::Quat;
use crate::math::parallel::{Tasks, fold};
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::{Pose, Rotation, Vector as V};
use parry3d_f64::query::{ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher, intersection_test};
use parry3d_f64::shape::{Shape, SharedShape};

/// Surfaces this close count as touching, over the reach of a body.
const CLOSE: f64 = 1e-3;
/// A contact that has moved less than this over the reach of a body is the same one.
const NEAR: f64 = 0.1;

/// A pair keeps its points while it moves and turns less than this against how it was found, over the reach of the smaller body.
const STILL: f64 = 1e-4;
/// Bounds are let out by this multiple of the margin of a sub-step, so that pairs hold for several.
const ROOM: f64 = 4.0;
/// Points are looked for within this multiple of the distance that matters.
const SIGHT: f64 = 1.5;
/// Pairs per task.
const PAIRS: usize = 256;

/// Numbers of a contact in a snapshot.
pub const CONTACT: usize = 20;

/// The surface of bodies.
#[derive(Clone)]
pub struct Hull {
    /// Its shape.
    pub shape: SharedShape,
    /// Where that is in the axes of the body.
    pub place: Pose,
    /// Distance that it keeps from others [m].
    pub thickness: f64,
    /// Coulomb friction.
    pub friction: Friction,
    /// Largest moment against rolling, over the normal force and the height of the centre of mass over the contact.
    pub rolling: f64,
    /// Speed after a bounce over speed before.
    pub restitution: f64,
    /// Velocity of the surface along itself [m/s], in the axes of the body.
    pub belt: Vector,
    /// Greatest distance of the surface from the centre of mass [m].
    pub reach: f64,
}

impl Hull {
    /// Lower and upper corner about the centre of mass [m] of a body of this turn.
    pub fn bounds(&self, q: Quat<f64>) -> [Vector; 2] {
        let Aabb { mins, maxs } = self.shape.compute_aabb(&(pose(Vector::default(), q) * self.place));
        [vector(mins), vector(maxs)]
    }

    /// Whether two bodies with it overlap or touch.
    pub fn meets(&self, one: (Vector, Quat<f64>), other: (Vector, Quat<f64>)) -> bool {
        let at = |(x, q)| pose(x, q) * self.place;
        let near = || intersection_test(&at(one), &*self.shape.0, &at(other), &*self.shape.0);
        // What cannot be told may meet.
        (one.0 - other.0).norm() <= 2.0 * self.reach && near().map_or(true, |found| found.intersecting)
    }
}

/// Bodies and their surfaces: first those that move, then solids.
#[derive(Clone, Default)]
pub struct Bodies {
    /// Their states.
    pub rows: Vec<Body>,
    /// The surface of each.
    pub hull: Vec<u32>,
    /// All surfaces.
    pub hulls: Vec<Hull>,
    /// How many move.
    pub moving: usize,
}

impl Bodies {
    /// The surface of a body.
    pub fn hull(&self, i: usize) -> &Hull {
        &self.hulls[self.hull[i] as usize]
    }

    /// Whether there is a body in a row: those of the unborn, and of pieces that hang on others, have no mass.
    pub fn is_there(&self, i: usize) -> bool {
        i >= self.moving || self.rows[i].inverse_mass > 0.0
    }

    /// Where the surface of a body is.
    pub fn pose(&self, i: usize) -> Pose {
        pose(self.rows[i].x, self.rows[i].q) * self.hull(i).place
    }
}

/// A point of contact of two bodies.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// The two bodies.
    pub pair: [u32; 2],
    /// Where on the first, in its axes: what is kept of a contact is found again by it.
    pub local: Vector,
    /// Unit vector from the first to the second.
    pub normal: Vector,
    /// Arms from both centres of mass [m].
    pub arms: [Vector; 2],
    /// Distance of the surfaces [m], negative where they overlap.
    pub gap: f64,
    /// Coulomb friction.
    pub friction: Friction,
    /// Largest moment against rolling over the normal force [m].
    pub rolling: f64,
    /// Coefficient of restitution.
    pub restitution: f64,
    /// Velocity of the second surface along the first by belts [m/s].
    pub belt: Vector,
    /// Impulse along the normal [N s].
    pub press: f64,
    /// Impulse of friction on the second [N s].
    pub drag: Vector,
    /// Angular impulse against rolling on the second [N m s].
    pub roll: Vector,
}

impl Contact {
    /// What a snapshot keeps of a contact: all that the next sub-step, the ledger and what is published read.
    pub fn numbers(&self) -> [f64; CONTACT] {
        let vectors = [self.local, self.drag, self.normal, self.arms[0], self.arms[1], self.roll].map(<[f64; 3]>::from);
        let mut numbers = [0.0; CONTACT];
        numbers[..2].copy_from_slice(&[self.press, self.gap]);
        numbers[2..].copy_from_slice(vectors.as_flattened());
        numbers
    }

    /// A contact from what a snapshot has kept.
    pub fn kept(pair: [u32; 2], numbers: &[f64]) -> Self {
        let at = |k: usize| Vector { x: numbers[k], y: numbers[k + 1], z: numbers[k + 2] };
        Self {
            pair,
            local: at(2),
            normal: at(8),
            arms: [at(11), at(14)],
            gap: numbers[1],
            friction: Friction::default(),
            rolling: 0.0,
            restitution: 0.0,
            belt: Vector::default(),
            press: numbers[0],
            drag: at(5),
            roll: at(17),
        }
    }
}

/// A pose in Parry's words.
pub fn pose(x: Vector, q: Quat<f64>) -> Pose {
    Pose { translation: V::new(x.x, x.y, x.z), rotation: Rotation::from_xyzw(q.v.x, q.v.y, q.v.z, q.w) }
}

fn vector(v: V) -> Vector {
    Vector { x: v.x, y: v.y, z: v.z }
}

/// What is known of pairs from before in an interval.
#[derive(Default)]
pub struct Near {
    /// Of each body: its room [m], and where it was.
    rooms: Vec<(f64, Vector, Quat<f64>)>,
    /// Pairs whose bounds overlap when each is let out by its room, in order.
    seen: Vec<Seen>,
}

/// Points of a pair, as they were found.
struct Seen {
    pair: [u32; 2],
    /// Pose of the second in the axes of the first.
    between: (Vector, Quat<f64>),
    /// Points that are closer than this have been found [m]; negative if none have been looked for.
    within: f64,
    points: Vec<Mark>,
}

/// A point of a pair, in the axes of each body.
#[derive(Clone, Copy)]
struct Mark {
    on: [Vector; 2],
    /// The normal, in the axes of the second body if that is a solid, otherwise of the first.
    normal: Vector,
}

impl Bodies {
    /// Displacement of the surface of a body from a pose, at most [m].
    fn moved(&self, i: usize, x: Vector, q: Quat<f64>) -> f64 {
        (self.rows[i].x - x).norm() + self.hull(i).reach * angle(q.conj() * self.rows[i].q)
    }

    /// Pose of the second body of a pair in the axes of the first.
    fn between(&self, [i, j]: [u32; 2]) -> (Vector, Quat<f64>) {
        let [a, b] = [i, j].map(|i| &self.rows[i as usize]);
        (a.q.conj().turn(b.x - a.x), a.q.conj() * b.q)
    }
}

/// An angle that is not less than that of a turn, nearly it if it is small [rad].
fn angle(q: Quat<f64>) -> f64 {
    std::f64::consts::PI * q.v.norm()
}

impl Near {
    /// All contacts that may close within h [s], in the order of their pairs, but for pairs that stay apart or at rest. Pairs that have hardly moved
    /// against each other since they were looked at in this interval keep their points: which ones does not depend on other bodies.
    pub fn contacts(&mut self, bodies: &Bodies, h: f64, apart: &[[u32; 2]], rests: impl Fn([u32; 2]) -> bool + Sync) -> Vec<Contact> {
        let margins: Vec<f64> = (0..bodies.rows.len()).map(|i| margin(bodies, i, h)).collect();
        self.gather(bodies, &margins, apart);
        let found = self.seen.chunks_mut(PAIRS).map_in_parallel(|pairs| {
            let mut contacts = Vec::new();
            for seen in pairs.iter_mut().filter(|seen| !rests(seen.pair)) {
                let [i, j] = seen.pair.map(|i| i as usize);
                let within = margins[i] + margins[j];
                if seen.within < within || !seen.still(bodies) {
                    *seen = look(bodies, seen.pair, SIGHT * within);
                }
                seen.contacts(bodies, within, &mut contacts);
            }
            contacts
        });
        found.concat()
    }

    /// Finds pairs anew if a body may have met others than those that are known.
    fn gather(&mut self, bodies: &Bodies, margins: &[f64], apart: &[[u32; 2]]) {
        let n = bodies.rows.len();
        let roomy = |(i, (room, x, q)): (usize, &(f64, Vector, Quat<f64>))| margins[i] + bodies.moved(i, *x, *q) <= *room;
        if self.rooms.len() == n && self.rooms.iter().enumerate().all(roomy) {
            return;
        }
        let room = |i: usize| (ROOM * margins[i], bodies.rows[i].x, bodies.rows[i].q);
        self.rooms = (0..n).map(room).collect();
        let mut pairs = pairs(bodies, &self.rooms.iter().map(|(room, ..)| *room).collect::<Vec<_>>());
        pairs.retain(|pair| apart.binary_search(pair).is_err());
        let mut before = std::mem::take(&mut self.seen).into_iter().peekable();
        let seen = |pair| {
            while before.next_if(|seen| seen.pair < pair).is_some() {}
            let new = || Seen { pair, between: bodies.between(pair), within: -1.0, points: Vec::new() };
            before.next_if(|seen| seen.pair == pair).unwrap_or_else(new)
        };
        self.seen = pairs.into_iter().map(seen).collect();
    }
}

/// How far a body's bounds are let out for the next sub-step [m].
fn margin(bodies: &Bodies, i: usize, h: f64) -> f64 {
    let (body, hull) = (&bodies.rows[i], bodies.hull(i));
    let close = if body.inverse_mass > 0.0 { CLOSE * hull.reach } else { 0.0 };
    1.5 * h * (body.v.norm() + body.w.norm() * hull.reach) + hull.thickness + close
}

/// Pairs whose bounds overlap when each is let out by its margin [m], in order.
fn pairs(bodies: &Bodies, margins: &[f64]) -> Vec<[u32; 2]> {
    let n = bodies.rows.len();
    let bounds = |i: usize| {
        if !bodies.is_there(i) {
            return [V::ZERO; 2];
        }
        let Aabb { mins, maxs } = bodies.hull(i).shape.compute_aabb(&bodies.pose(i));
        [mins - V::splat(margins[i]), maxs + V::splat(margins[i])]
    };
    let bounds: Vec<[V; 2]> = fold(n, |range| range.map(bounds).collect::<Vec<_>>()).concat();
    let mut order: Vec<usize> = (0..n).filter(|i| bodies.is_there(*i)).collect();
    order.sort_by(|a, b| bounds[*a][0].x.total_cmp(&bounds[*b][0].x).then(a.cmp(b)));
    let mut found = Vec::new();
    for (k, &i) in order.iter().enumerate() {
        let [low, high] = bounds[i];
        for &j in &order[k + 1..] {
            let [bottom, top] = bounds[j];
            if bottom.x > high.x {
                break;
            }
            if i.min(j) < bodies.moving && bottom.y <= high.y && bottom.z <= high.z && low.y <= top.y && low.z <= top.z {
                found.push([i.min(j) as u32, i.max(j) as u32]);
            }
        }
    }
    found.sort_unstable();
    found
}

/// A part of a shape, itself if it has none.
fn part(shape: &SharedShape, k: u32) -> &dyn Shape {
    shape.as_compound().map_or(&*shape.0, |whole| &*whole.shapes()[k as usize].1.0)
}

/// Points of a pair that are closer than `within` [m].
fn look(bodies: &Bodies, pair: [u32; 2], within: f64) -> Seen {
    let [i, j] = pair.map(|i| i as usize);
    let ([a, b], [one, two], [first, second]) =
        ([&bodies.rows[i], &bodies.rows[j]], [bodies.hull(i), bodies.hull(j)], [bodies.pose(i), bodies.pose(j)]);
    let mut manifolds: Vec<ContactManifold<(), ()>> = Vec::new();
    let (skin, apart) = (one.thickness + two.thickness, first.inv_mul(&second));
    // Shapes that it cannot pair are refused when a scene is read.
    let _ = DefaultQueryDispatcher.contact_manifolds(&apart, &*one.shape.0, &*two.shape.0, within + skin, &mut manifolds, &mut None);
    let mut points = Vec::new();
    for manifold in &mut manifolds {
        let places = [manifold.subshape_pos1(), manifold.subshape_pos2()].map(|place| place.copied().unwrap_or_default());
        let parts = [part(&one.shape, manifold.subshape1), part(&two.shape, manifold.subshape2)];
        overlap::correct(manifold, within + skin, &places[0].inv_mul(&(apart * places[1])), parts);
        let part = manifold.subshape_pos1().map_or(first, |own| first * *own);
        let normal = vector(part.rotation * manifold.local_n1);
        let owner = if b.inverse_mass == 0.0 { b } else { a };
        for point in manifold.contacts().iter().filter(|point| point.dist <= within + skin) {
            let on = vector(part * point.local_p1);
            let on = [a.q.conj().turn(on - a.x), b.q.conj().turn(on + normal * point.dist - b.x)];
            points.push(Mark { on, normal: owner.q.conj().turn(normal) });
        }
    }
    Seen { pair, between: bodies.between(pair), within, points }
}

impl Seen {
    /// Whether both bodies are where they were against each other.
    fn still(&self, bodies: &Bodies) -> bool {
        let [i, j] = self.pair.map(|i| i as usize);
        let (x, q) = bodies.between(self.pair);
        let reach = |i: usize| if bodies.rows[i].inverse_mass > 0.0 { bodies.hull(i).reach } else { f64::INFINITY };
        let least = reach(i).min(reach(j));
        (x - self.between.0).norm_sq() <= (STILL * least).powi(2) && angle(self.between.1.conj() * q) <= STILL
    }

    /// Its contacts that are closer than `within` [m].
    fn contacts(&self, bodies: &Bodies, within: f64, out: &mut Vec<Contact>) {
        let [i, j] = self.pair.map(|i| i as usize);
        let ([a, b], [one, two]) = ([&bodies.rows[i], &bodies.rows[j]], [bodies.hull(i), bodies.hull(j)]);
        let skin = one.thickness + two.thickness;
        let larger = |of: fn(&Friction) -> f64| of(&one.friction).max(of(&two.friction));
        let friction = Friction { sliding: larger(|f| f.sliding), resting: larger(|f| f.resting) };
        let belt = b.q.turn(two.belt) - a.q.turn(one.belt);
        // What nothing moves does not roll.
        let arm = |hull: &Hull, body: &Body, arm: f64| if body.inverse_mass > 0.0 { hull.rolling * arm.abs() } else { 0.0 };
        for mark in &self.points {
            let normal = if b.inverse_mass == 0.0 { b.q.turn(mark.normal) } else { a.q.turn(mark.normal) };
            let [p, q] = [a.x + a.q.turn(mark.on[0]), b.x + b.q.turn(mark.on[1])];
            let distance = (q - p).dot(normal);
            if distance > within + skin {
                continue;
            }
            let at = p + normal * (0.5 * distance);
            let arms = [at - a.x, at - b.x];
            out.push(Contact {
                pair: self.pair,
                local: mark.on[0],
                normal,
                arms,
                gap: distance - skin,
                friction,
                rolling: arm(one, a, arms[0].dot(normal)).max(arm(two, b, arms[1].dot(normal))),
                restitution: one.restitution.max(two.restitution),
                belt: belt - normal * belt.dot(normal),
                press: 0.0,
                drag: Vector::default(),
                roll: Vector::default(),
            });
        }
    }
}

/// Takes over the impulses of the contacts before; both lists are in the order of their pairs. The nearest point of a pair is the same one, if
/// it has moved less on the first body than a tenth of that one's reach.
pub fn carry(bodies: &Bodies, old: &[Contact], new: &mut [Contact]) {
    let mut k = 0;
    for contact in new {
        while k < old.len() && old[k].pair < contact.pair {
            k += 1;
        }
        let near = NEAR * bodies.hull(contact.pair[0] as usize).reach;
        let same = old[k..].iter().take_while(|o| o.pair == contact.pair).map(|o| ((o.local - contact.local).norm_sq(), o));
        let best = same.filter(|(distance, _)| *distance < near * near).min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, o)) = best {
            contact.press = o.press;
            [contact.drag, contact.roll] = [o.drag, o.roll].map(|p| p - contact.normal * p.dot(contact.normal));
        }
    }
}
