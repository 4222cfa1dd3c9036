//! Contacts between bodies: pairs by sorted bounds, points by Parry.

use super::body::Body;
use crate::geometry::{Friction, Vector};
use crate::math::Quat;
use crate::math::parallel::fold;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::{Pose, Rotation, Vector as V};
use parry3d_f64::query::{ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher, intersection_test};
use parry3d_f64::shape::SharedShape;

/// Surfaces this close count as touching, over the reach of a body.
const CLOSE: f64 = 1e-3;
/// A contact that has moved less than this over the reach of a body is the same one.
const NEAR: f64 = 0.1;

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

/// Points of contact of a pair that are closer than `within` [m].
fn touch(bodies: &Bodies, pair: [u32; 2], within: f64, out: &mut Vec<Contact>) {
    let [i, j] = pair.map(|i| i as usize);
    let ([a, b], [one, two], [first, second]) =
        ([&bodies.rows[i], &bodies.rows[j]], [bodies.hull(i), bodies.hull(j)], [bodies.pose(i), bodies.pose(j)]);
    let mut manifolds: Vec<ContactManifold<(), ()>> = Vec::new();
    let (skin, between) = (one.thickness + two.thickness, first.inv_mul(&second));
    // Shapes that it cannot pair are refused when a scene is read.
    let _ = DefaultQueryDispatcher.contact_manifolds(&between, &*one.shape.0, &*two.shape.0, within + skin, &mut manifolds, &mut None);
    let friction =
        Friction { sliding: one.friction.sliding.max(two.friction.sliding), resting: one.friction.resting.max(two.friction.resting) };
    let belt = b.q.turn(two.belt) - a.q.turn(one.belt);
    for manifold in &manifolds {
        let part = manifold.subshape_pos1().map_or(first, |own| first * *own);
        let normal = vector(part.rotation * manifold.local_n1);
        for point in manifold.contacts().iter().filter(|point| point.dist <= within + skin) {
            let on = vector(part * point.local_p1);
            let at = on + normal * (0.5 * point.dist);
            let arms = [at - a.x, at - b.x];
            // What nothing moves does not roll.
            let arm =
                |hull: &Hull, body: &Body, arm: Vector| if body.inverse_mass > 0.0 { hull.rolling * arm.dot(normal).abs() } else { 0.0 };
            out.push(Contact {
                pair,
                local: a.q.conj().turn(on - a.x),
                normal,
                arms,
                gap: point.dist - skin,
                friction,
                rolling: arm(one, a, arms[0]).max(arm(two, b, arms[1])),
                restitution: one.restitution.max(two.restitution),
                belt: belt - normal * belt.dot(normal),
                press: 0.0,
                drag: Vector::default(),
                roll: Vector::default(),
            });
        }
    }
}

/// All contacts that may close within h [s], in the order of their pairs, but for pairs that stay apart.
pub fn contacts(bodies: &Bodies, h: f64, apart: &[[u32; 2]]) -> Vec<Contact> {
    let margin = |i: usize| {
        let (body, hull) = (&bodies.rows[i], bodies.hull(i));
        let close = if body.inverse_mass > 0.0 { CLOSE * hull.reach } else { 0.0 };
        1.5 * h * (body.v.norm() + body.w.norm() * hull.reach) + hull.thickness + close
    };
    let margins: Vec<f64> = (0..bodies.rows.len()).map(margin).collect();
    let mut pairs = pairs(bodies, &margins);
    pairs.retain(|pair| apart.binary_search(pair).is_err());
    let found = fold(pairs.len(), |range| {
        let mut found = Vec::new();
        for pair in &pairs[range] {
            touch(bodies, *pair, pair.iter().map(|i| margins[*i as usize]).sum(), &mut found);
        }
        found
    });
    found.concat()
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
