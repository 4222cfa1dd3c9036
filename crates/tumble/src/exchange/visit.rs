//! A visitor's copy of a body that it touches: all impulses so far have changed it, and their sum is posted at the end of the interval.
//!                                                                                                                     (coupling.8)

use super::{BodyRow, BodyState, Exchange, Turn};
use crate::geometry::Vector;
use crate::math::rotation;

/// Least product of two normals at which a push goes into what bears the body.
const INTO: f64 = 0.1;

/// A body of another system, as this one has changed it.
#[derive(Debug, Clone)]
pub struct Visit {
    /// The body.
    pub at: BodyRow,
    /// Greatest distance of its surface, with the thickness, from the centre of mass [m].
    pub reach: f64,
    /// The copy of its state.
    pub state: BodyState,
    /// What it has got in this interval [N s], and the moment about the origin [N m s].
    impulse: Vector,
    moment: Vector,
    /// The moment about its own centre [N m s], and time integrals of the impulse [N s²] and of that.
    angular: Vector,
    ways: [Vector; 2],
}

impl Visit {
    /// A body as it is at the start of an interval.
    pub fn new(exchange: &Exchange, at: BodyRow, reach: f64) -> Self {
        let zero = Vector::default();
        Self { at, reach, state: *exchange.state_before(at), impulse: zero, moment: zero, angular: zero, ways: [zero; 2] }
    }

    /// The largest speed of a point of it [m/s].
    pub fn fastest(&self) -> f64 {
        self.state.velocity.norm() + self.state.spin.norm() * self.reach
    }

    /// Whether a push along the normal, which points away from the body, goes into what bears it below that point.
    fn is_into(&self, point: Vector, normal: Vector) -> bool {
        normal.dot(self.state.normal) > INTO && self.state.is_borne_at(point)
    }

    /// Change of velocity [m/s] and spin [rad/s] by an impulse at a point; `normal` points away from the body. Of a push into what bears the body
    /// below that point, the bearing takes the part along its own normal, and keeps the body from turning.
    fn response(&self, point: Vector, impulse: Vector, normal: Vector) -> (Vector, Vector) {
        if self.is_into(point, normal) {
            let bears = self.state.normal;
            return ((impulse - bears * impulse.dot(bears)) * self.state.inverse_mass, Vector::default());
        }
        self.state.response(point, impulse)
    }

    /// Takes an impulse at a point, with that moment about the origin.
    pub fn take(&mut self, point: Vector, impulse: Vector, moment: Vector, normal: Vector) {
        let (velocity, spin) = self.response(point, impulse, normal);
        (self.state.velocity, self.state.spin) = (self.state.velocity + velocity, self.state.spin + spin);
        (self.impulse, self.moment) = (self.impulse + impulse, self.moment + moment);
        self.angular = self.angular + (point - self.state.position).cross(impulse);
    }

    /// Takes an impulse at a point and a couple [N m s].
    pub fn take_couple(&mut self, point: Vector, impulse: Vector, couple: Vector, normal: Vector) {
        self.take(point, impulse, point.cross(impulse) + couple, normal);
        self.angular = self.angular + couple;
        if couple != Vector::default() && !self.is_into(point, normal) {
            self.state.spin = self.state.spin + self.state.turned(couple);
        }
    }

    /// Whether it stays where it is, as something bears it.
    pub fn stands(&self) -> bool {
        self.state.borne && self.state.normal != Vector::default()
    }

    /// Takes an impulse, its moment about the origin, and that about the centre, of what pushes from all around.
    pub fn take_all(&mut self, impulse: Vector, moment: Vector, angular: Vector) {
        if !self.stands() {
            self.state.velocity = self.state.velocity + impulse * self.state.inverse_mass;
            self.state.spin = self.state.spin + self.state.turned(angular);
        }
        (self.impulse, self.moment, self.angular) = (self.impulse + impulse, self.moment + moment, self.angular + angular);
    }

    /// Where it will be in h [s], if nothing touches it.
    pub fn ahead(&self, h: f64) -> BodyState {
        let mut copy = self.clone();
        copy.accelerate(h);
        copy.advance(h);
        copy.state
    }

    /// Change of the velocity of its point by an impulse e there [m/s].
    pub fn yields_to(&self, point: Vector, e: Vector, normal: Vector) -> Vector {
        let (velocity, spin) = self.response(point, e, normal);
        velocity + spin.cross(point - self.state.position)
    }

    /// Has its own acceleration for h [s], if nothing bears it.
    pub fn accelerate(&mut self, h: f64) {
        if !self.state.borne {
            self.state.velocity = self.state.velocity + self.state.acceleration * h;
        }
    }

    /// Moves for h [s].
    pub fn advance(&mut self, h: f64) {
        let BodyState { position, orientation, velocity, spin, .. } = &mut self.state;
        *position = *position + *velocity * h;
        *orientation = (rotation::by(*spin * h) * *orientation).normalized();
        self.ways = [self.ways[0] + self.impulse * h, self.ways[1] + self.angular * h];
    }

    /// Posts what it has got.
    pub fn post(&self, exchange: &mut Turn<'_>) {
        if self.impulse != Vector::default() || self.moment != Vector::default() {
            exchange.post_sum(self.at, self.impulse, self.moment);
        }
    }

    /// Posts what it has got, and how far that has moved the copy.                                           (coupling.9)
    pub fn post_timed(&self, exchange: &mut Turn<'_>) {
        if self.impulse != Vector::default() || self.moment != Vector::default() {
            exchange.post_timed(self.at, self.impulse, self.moment, self.ways);
        }
    }
}
