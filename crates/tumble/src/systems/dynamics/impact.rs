//! Impulses at the contacts of a body whose shape is matched by a share s in a sub-step: 1 if it is rigid, kappa h²/(1 + kappa h²) if it is soft. An
//! impulse p on a mass at the arm r moves the body as a whole by that share, and the mass alone by the rest,
//!
//!   dV = s p/M,   dw = s I⁻¹ (r x p),   dv = dV + dw x r + (1 - s) p/m                                (shapes.5)
//!
//! First the impulses p of an inelastic impact: no contact comes nearer than it may, none pulls, and friction is Coulomb's. Then those that
//! push are repeated by the restitution e, as Poisson's hypothesis has it, and friction is found anew for all of that, as much as takes most
//! energy:
//!
//!   p_n -> (1 + e) p_n,   p_t = argmin of the kinetic energy, |p_t| <= mu p_n                            (shapes.6)
//!
//! With one e this cannot add energy: the impulses (1 + e) p are among those that friction chooses from. Where contacts have
//! several, repeating ends where it would.
//! Found by Gauss-Seidel over contacts [jean1999]. Verified in `tests/shape_contact.rs`.

use super::inertia::Motion;
use crate::geometry::{Friction, Vector};

/// Sweeps over contacts at most, and the change of speed, over the largest, at which they end.
const SWEEPS: usize = 200;
const EXACT: f64 = 1e-11;

/// Speed over the largest from which a contact slips.
const SLIPS: f64 = 1e-6;

/// A place where a mass of a body meets a solid.
#[derive(Debug, Clone, Copy)]
pub struct Contact {
    /// The mass, counted from the first of the body.
    pub k: usize,
    /// It [kg].
    pub mass: f64,
    /// From the centre of the body [m].
    pub arm: Vector,
    /// Unit normal out of the solid.
    pub normal: Vector,
    /// Its velocity before, relative to the solid [m/s].
    pub arrival: Vector,
    /// Speed at which it has to leave the solid at least, before restitution; negative where it may still come nearer [m/s].
    pub least: f64,
    /// Part of the impulse that comes back.
    pub restitution: f64,
    /// Friction.
    pub friction: Friction,
}

/// What impulses give a body.
#[derive(Debug, Clone, Default)]
pub struct Effect {
    /// Velocity of its centre [m/s].
    pub velocity: Vector,
    /// Spin [rad/s].
    pub spin: Vector,
    /// What single masses have beyond that [m/s], contact by contact.
    pub own: Vec<Vector>,
}

/// How much an impulse at a contact moves it.
struct Yield {
    /// Along the normal, and along the tangent where it is most [1/kg].
    normal: f64,
    tangent: f64,
}

struct Solver<'a> {
    /// Mass and inertia of the body.
    body: &'a Motion,
    share: f64,
    contacts: &'a [Contact],
    /// For each contact, the first one of the same mass.
    first: Vec<usize>,
    yields: Vec<Yield>,
    pushes: Vec<Vector>,
    /// Contacts at which friction has given way: they have the coefficient of what slides.
    slides: Vec<bool>,
    effect: Effect,
}

/// What the contacts of a body give it whose shape is matched by that share.
pub fn solve(body: &Motion, share: f64, contacts: &[Contact]) -> Effect {
    let mut solver = Solver::new(body, share, contacts);
    solver.guess();
    solver.sweep(true);
    if contacts.iter().any(|c| c.restitution > 0.0) {
        let start = solver.pushes.clone();
        for (push, Contact { normal, restitution, .. }) in solver.pushes.iter_mut().zip(contacts) {
            *push = *push + *normal * (restitution * push.dot(*normal));
        }
        solver.effect = solver.effect_of(&solver.pushes);
        solver.sweep(false);
        let part = solver.affordable(&start);
        let mixed: Vec<Vector> = start.iter().zip(&solver.pushes).map(|(a, b)| *a + (*b - *a) * part).collect();
        solver.effect = solver.effect_of(&mixed);
    }
    // Of several contacts of a mass the first has all.
    solver.effect
}

impl<'a> Solver<'a> {
    fn new(body: &'a Motion, share: f64, contacts: &'a [Contact]) -> Self {
        let given = |r: Vector, n: Vector, m: f64| {
            (n * (1.0 / body.mass) + body.inertia.spin(r.cross(n)).cross(r)) * share + n * ((1.0 - share) / m)
        };
        let of = |Contact { arm, normal, mass, .. }: &Contact| {
            let [s, t] = across(*normal);
            let [a, b] = [given(*arm, s, *mass), given(*arm, t, *mass)];
            let (ss, st, tt) = (a.dot(s), a.dot(t), b.dot(t));
            let tangent = 0.5 * (ss + tt) + (0.25 * (ss - tt) * (ss - tt) + st * st).sqrt();
            Yield { normal: given(*arm, *normal, *mass).dot(*normal), tangent }
        };
        let n = contacts.len();
        let mut seen = std::collections::BTreeMap::new();
        let first = contacts.iter().enumerate().map(|(k, contact)| *seen.entry(contact.k).or_insert(k)).collect();
        let effect = Effect { own: vec![Vector::default(); n], ..Effect::default() };
        let yields = contacts.iter().map(of).collect();
        Self { body, share, contacts, first, yields, pushes: vec![Vector::default(); n], slides: vec![false; n], effect }
    }

    /// What impulses give.
    fn effect_of(&self, pushes: &[Vector]) -> Effect {
        let (mut sum, mut turn, mut own) = (Vector::default(), Vector::default(), vec![Vector::default(); pushes.len()]);
        for (k, (contact, push)) in self.contacts.iter().zip(pushes).enumerate() {
            (sum, turn) = (sum + *push, turn + contact.arm.cross(*push));
            own[self.first[k]] = own[self.first[k]] + *push * ((1.0 - self.share) / contact.mass);
        }
        Effect { velocity: sum * (self.share / self.body.mass), spin: self.body.inertia.spin(turn * self.share), own }
    }

    /// What contact k has of it.
    fn given(&self, k: usize, effect: &Effect) -> Vector {
        effect.velocity + effect.spin.cross(self.contacts[k].arm) + effect.own[self.first[k]]
    }

    fn velocity(&self, k: usize) -> Vector {
        self.contacts[k].arrival + self.given(k, &self.effect)
    }

    fn push(&mut self, k: usize, push: Vector) {
        let more = push - self.pushes[k];
        self.pushes[k] = push;
        let Contact { arm, mass, .. } = self.contacts[k];
        self.effect.velocity = self.effect.velocity + more * (self.share / self.body.mass);
        self.effect.spin = self.effect.spin + self.body.inertia.spin(arm.cross(more) * self.share);
        let own = &mut self.effect.own[self.first[k]];
        *own = *own + more * ((1.0 - self.share) / mass);
    }

    /// A push that friction allows.
    fn allowed(&self, k: usize, normal: f64, along: Vector) -> Vector {
        let Contact { normal: n, friction, .. } = self.contacts[k];
        let size = along.norm();
        let most = if self.slides[k] { friction.sliding } else { friction.resting } * normal;
        n * normal + if size > most { along * (most / size) } else { along }
    }

    /// The start: the smallest impulses that would bring all contacts to rest, as far as a rigid motion can, each cut off to what contact allows. Of a
    /// body that rests on a face they are the solution.
    fn guess(&mut self) {
        let n = self.contacts.len();
        let arm = |k: usize| self.contacts[k].arm;
        // Points of mass 1 at the contacts have the same equations as the body.
        let places = Motion::of(n, |_| 1.0, arm, |k| self.contacts[k].normal * self.contacts[k].least - self.contacts[k].arrival);
        if n < 3 || self.share < 0.5 || !places.inertia.is_round() {
            return;
        }
        let wanted = [places.at(-places.center), places.spin];
        let (push, turn) = (wanted[0] * self.body.mass, self.body.inertia.times(wanted[1]));
        let spin = places.inertia.spin(turn - places.center.cross(push));
        let each = |k: usize| push * (1.0 / n as f64) + spin.cross(arm(k) - places.center);
        for (k, push) in (0..n).map(each).collect::<Vec<_>>().into_iter().enumerate() {
            let normal = push.dot(self.contacts[k].normal).max(0.0);
            let along = push - self.contacts[k].normal * push.dot(self.contacts[k].normal);
            self.pushes[k] = self.allowed(k, normal, along);
        }
        self.effect = self.effect_of(&self.pushes);
    }

    /// Sweeps over all contacts, over friction alone where normal impulses are given. What still slips where friction at rest is all that it can be
    /// slides from then on.
    fn sweep(&mut self, normals: bool) {
        let n = self.contacts.len();
        let scale = (0..n).map(|k| self.contacts[k].arrival.norm().max(self.contacts[k].least.abs())).fold(0.0, f64::max);
        loop {
            self.converge(normals, scale);
            let slips = |k: &usize| {
                let Contact { normal, friction, .. } = self.contacts[*k];
                let velocity = self.velocity(*k);
                let slide = (velocity - normal * velocity.dot(normal)).norm();
                !self.slides[*k] && friction.sliding < friction.resting && slide > SLIPS * scale
            };
            let slipping: Vec<usize> = (0..n).filter(slips).collect();
            if slipping.is_empty() {
                break;
            }
            slipping.into_iter().for_each(|k| self.slides[k] = true);
        }
    }

    fn converge(&mut self, normals: bool, scale: f64) {
        let n = self.contacts.len();
        for _ in 0..SWEEPS {
            let mut changed = 0.0_f64;
            for k in 0..n {
                let Contact { normal, least, .. } = self.contacts[k];
                let old = self.pushes[k];
                let mut press = old.dot(normal);
                let along = old - normal * press;
                if normals {
                    press = (press - (self.velocity(k).dot(normal) - least) / self.yields[k].normal).max(0.0);
                    self.push(k, along + normal * press);
                }
                let velocity = self.velocity(k);
                let slide = velocity - normal * velocity.dot(normal);
                let push = self.allowed(k, press, along - slide * (1.0 / self.yields[k].tangent));
                self.push(k, push);
                changed = changed.max((push - old).norm() * self.yields[k].normal.max(self.yields[k].tangent));
            }
            if changed <= EXACT * scale {
                break;
            }
        }
        self.effect = self.effect_of(&self.pushes);
    }

    /// How far impulses may go from `start` to those found without adding energy. On the way b they do the work a_0 + a_1 b + a_2 b².
    fn affordable(&self, start: &[Vector]) -> f64 {
        let (before, mut none, mut linear, mut square) = (self.effect_of(start), 0.0, 0.0, 0.0);
        for (k, (from, to)) in start.iter().zip(&self.pushes).enumerate() {
            let (given, more) = (self.given(k, &before), *to - *from);
            none += from.dot(self.contacts[k].arrival + given * 0.5);
            linear += more.dot(self.contacts[k].arrival + given);
            square += 0.5 * more.dot(self.given(k, &self.effect) - given);
        }
        // What holding against a push takes is no gain of restitution.
        let start = none.min(0.0);
        if start + linear + square <= 0.0 || square <= 0.0 {
            return 1.0;
        }
        let root = (linear * linear - 4.0 * square * start).max(0.0).sqrt();
        ((root - linear) / (2.0 * square)).clamp(0.0, 1.0)
    }
}

/// Two directions across a normal.
fn across(n: Vector) -> [Vector; 2] {
    let other = if n.x.abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let s = n.cross(other.into()).normalized();
    [s, n.cross(s)]
}
