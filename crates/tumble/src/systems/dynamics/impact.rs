//! Impulses at the contacts of a rigid body: an impulse p at the arm r changes velocity and spin of the body as a whole,
//!
//!   dV = p/M,   dw = I⁻¹ (r x p),   dv at r = p/M + (I⁻¹ (r x p)) x r                                 (contact.24)
//!
//! First the impulses p of an inelastic impact: no contact comes nearer than it may, none pulls, and friction is Coulomb's. Then those that
//! push are repeated by the restitution e, as Poisson's hypothesis has it, and friction is found anew for all of that, as much as takes most
//! energy:
//!
//!   p_n -> (1 + e) p_n,   p_t = argmin of the kinetic energy, |p_t| <= mu p_n                            (contact.25)
//!
//! With one e this cannot add energy: the impulses (1 + e) p are among those that friction chooses from. Where contacts have
//! several, repeating ends where it would.
//! Found by Gauss-Seidel over contacts [jean1999]. Verified in `tests/shape_contact.rs`.

use super::inertia::Motion;
use crate::geometry::{Friction, Vector};

/// Sweeps over contacts at most, and the change of speed, over the largest, at which they end.
const SWEEPS: usize = 200;
const EXACT: f64 = 1e-11;

/// A place where a body meets a solid.
#[derive(Debug, Clone, Copy)]
pub struct Contact {
    /// From the centre of the body [m].
    pub arm: Vector,
    /// Unit normal out of the solid.
    pub normal: Vector,
    /// Velocity of the solid there [m/s].
    pub surface: Vector,
    /// Speed at which it has to leave the solid at least, before restitution; negative where it may still come nearer [m/s].
    pub least: f64,
    /// Part of the impulse that comes back.
    pub restitution: f64,
    /// Friction.
    pub friction: Friction,
}

/// How much an impulse at a contact moves it.
struct Yield {
    /// Along the normal, and along the tangent where it is most [1/kg].
    normal: f64,
    tangent: f64,
}

struct Solver<'a> {
    body: &'a Motion,
    contacts: &'a [Contact],
    yields: Vec<Yield>,
    pushes: Vec<Vector>,
    /// Contacts at which friction has given way: they have the coefficient of what slides.
    slides: Vec<bool>,
    /// Velocity and spin that all impulses give.
    change: [Vector; 2],
}

/// The change of velocity [m/s] and spin [rad/s] of a body by its contacts.
pub fn solve(body: &Motion, contacts: &[Contact]) -> [Vector; 2] {
    let mut solver = Solver::new(body, contacts);
    solver.guess();
    solver.sweep(true);
    if contacts.iter().any(|c| c.restitution > 0.0) {
        let (pushes, change) = (solver.pushes.clone(), solver.change);
        for (push, Contact { normal, restitution, .. }) in solver.pushes.iter_mut().zip(contacts) {
            *push = *push + *normal * (restitution * push.dot(*normal));
        }
        solver.change = solver.effect(&solver.pushes);
        solver.sweep(false);
        let part = solver.affordable(&pushes, change);
        let [velocity, spin] = [0, 1].map(|k| change[k] + (solver.change[k] - change[k]) * part);
        return [velocity, spin];
    }
    solver.change
}

impl<'a> Solver<'a> {
    fn new(body: &'a Motion, contacts: &'a [Contact]) -> Self {
        let given = |r: Vector, n: Vector| n * (1.0 / body.mass) + body.inertia.spin(r.cross(n)).cross(r);
        let of = |Contact { arm, normal, .. }: &Contact| {
            let [s, t] = across(*normal);
            let [a, b] = [given(*arm, s), given(*arm, t)];
            let (ss, st, tt) = (a.dot(s), a.dot(t), b.dot(t));
            Yield { normal: given(*arm, *normal).dot(*normal), tangent: 0.5 * (ss + tt) + (0.25 * (ss - tt) * (ss - tt) + st * st).sqrt() }
        };
        let n = contacts.len();
        let yields = contacts.iter().map(of).collect();
        Self { body, contacts, yields, pushes: vec![Vector::default(); n], slides: vec![false; n], change: Default::default() }
    }

    /// Velocity and spin that impulses give.
    fn effect(&self, pushes: &[Vector]) -> [Vector; 2] {
        let zero = [Vector::default(); 2];
        let [push, turn] = self.contacts.iter().zip(pushes).fold(zero, |[p, l], (c, push)| [p + *push, l + c.arm.cross(*push)]);
        [push * (1.0 / self.body.mass), self.body.inertia.spin(turn)]
    }

    /// Velocity of contact k relative to the solid, before the impulses or with them.
    fn arrival(&self, k: usize) -> Vector {
        self.body.at(self.contacts[k].arm) - self.contacts[k].surface
    }

    fn velocity(&self, k: usize) -> Vector {
        self.arrival(k) + self.change[0] + self.change[1].cross(self.contacts[k].arm)
    }

    fn push(&mut self, k: usize, push: Vector) {
        let more = push - self.pushes[k];
        self.pushes[k] = push;
        self.change[0] = self.change[0] + more * (1.0 / self.body.mass);
        self.change[1] = self.change[1] + self.body.inertia.spin(self.contacts[k].arm.cross(more));
    }

    /// A push that friction allows.
    fn allowed(&mut self, k: usize, normal: f64, along: Vector) -> Vector {
        let Contact { normal: n, friction, .. } = self.contacts[k];
        let size = along.norm();
        self.slides[k] |= size > friction.resting * normal;
        let most = if self.slides[k] { friction.sliding * normal } else { size };
        n * normal + if size > most { along * (most / size) } else { along }
    }

    /// The start: the smallest impulses that would bring all contacts to rest, as far as a rigid motion can, each cut off to what contact allows. Of a
    /// body that rests on a face they are the solution.
    fn guess(&mut self) {
        let n = self.contacts.len();
        let arm = |k: usize| self.contacts[k].arm;
        // Points of mass 1 at the contacts have the same equations as the body.
        let places = Motion::of(n, |_| 1.0, arm, |k| self.contacts[k].normal * self.contacts[k].least - self.arrival(k));
        if n < 3 || !places.inertia.is_round() {
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
        self.slides.fill(false);
        self.change = self.effect(&self.pushes);
    }

    /// Sweeps over all contacts, over friction alone where normal impulses are given.
    fn sweep(&mut self, normals: bool) {
        let n = self.contacts.len();
        let scale = (0..n).map(|k| self.arrival(k).norm().max(self.contacts[k].least.abs())).fold(0.0, f64::max);
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
        self.change = self.effect(&self.pushes);
    }

    /// How far impulses may go from `pushes` with the effect `change` to those found without adding energy. On the way b they do the work
    /// a_0 + a_1 b + a_2 b².
    fn affordable(&self, pushes: &[Vector], change: [Vector; 2]) -> f64 {
        let (mut none, mut linear, mut square) = (0.0, 0.0, 0.0);
        for (k, (from, to)) in pushes.iter().zip(&self.pushes).enumerate() {
            let (arm, more) = (self.contacts[k].arm, *to - *from);
            let given = change[0] + change[1].cross(arm);
            let later = self.change[0] + self.change[1].cross(arm) - given;
            none += from.dot(self.arrival(k) + given * 0.5);
            linear += more.dot(self.arrival(k) + given);
            square += 0.5 * more.dot(later);
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
