//! Balls that the fluid moves: masses of other systems, solved for together with the pressure.
//!
//!   V' = V + h a + P/m,   P = rho dx^(d-1) jᵀ q                                                      (gas.16)
//!
//! j has the closed share of each face beside the ball, + where the fluid is on its lower side. The same j carries V' into the
//! divergence, so that momentum passes over without loss, and what the fluid's mass adds to that of the ball is in the matrix: no
//! ball is too light. The weight of the displaced fluid, which the pressure of the fluid does not have, is added.    (gas.17)
//!
//! Limits: no torque and no skin friction comes back; a ball is a mass without spin.
//! Tests: crates/tumble-f64/tests/bodies.rs.

use crate::exchange::{BodyRow, BodyState, Exchange, Turn};
use crate::geometry::Vector;
use crate::linalg::poisson::Joint;
use crate::math::Real;
use crate::state::Grid;
use std::f64::consts::PI;

/// A ball, a disk of one metre thickness in the plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Ball {
    /// The object that it belongs to.
    pub name: String,
    /// The row of another system that it is.
    pub row: BodyRow,
    /// Radius [m].
    pub radius: f64,
    /// A copy of its state, which takes every impulse at once.
    pub state: BodyState,
    /// The normal of a solid of its own system that it rests on: along it, the ball is held.
    rests: Option<Vector>,
    /// Impulse from the fluid in this interval [N s].
    pub impulse: Vector,
    /// Of each axis, the numbers of faces' cells and their closed shares.
    pub(super) faces: [Vec<(u32, Real)>; 3],
}

impl Ball {
    /// A ball at rest.
    pub fn new(name: String, row: BodyRow, radius: f64) -> Self {
        Self { name, row, radius, state: BodyState::default(), rests: None, impulse: Vector::default(), faces: Default::default() }
    }

    /// Signed distance [m] and direction of a point from the surface, of the nearest image across periodic sides.
    pub(super) fn near(&self, x: Vector, grid: &Grid) -> (f64, Vector) {
        let mut way: [f64; 3] = (x - self.state.position).into();
        for axis in 0..3 {
            if grid.flat == Some(axis) {
                way[axis] = 0.0;
            } else if grid.periodic[axis] {
                let length = grid.n[axis] as f64 * grid.dx;
                way[axis] -= length * (way[axis] / length).round();
            }
        }
        let way = Vector::from(way);
        let far = way.norm();
        (far - self.radius, if far > 0.0 { way * (1.0 / far) } else { Vector::default() })
    }

    /// The volume that it displaces [m³]. Across a side of the box it is cut like the box around the ball.
    fn displaced(&self, grid: &Grid) -> f64 {
        let r = self.radius;
        let whole = if grid.flat.is_some() { PI * r * r } else { 4.0 / 3.0 * PI * r * r * r };
        let x: [f64; 3] = self.state.position.into();
        let share = |a: usize| {
            let (low, high) = (grid.origin[a], grid.origin[a] + grid.n[a] as f64 * grid.dx);
            let both = (x[a] + r).min(high) - (x[a] - r).max(low);
            if grid.periodic[a] { 1.0 } else { (both / (2.0 * r)).clamp(0.0, 1.0) }
        };
        grid.axes().map(share).product::<f64>() * whole
    }

    /// Takes its state from its system. What is pressed against a solid and does not leave it rests on it.
    pub fn listen(&mut self, exchange: &Exchange, gravity: [f64; 3], density: f64, grid: &Grid) {
        self.state = *exchange.state(self.row);
        let BodyState { velocity, acceleration, normal, inverse_mass, .. } = self.state;
        let pressed = acceleration - Vector::from(gravity) * (density * self.displaced(grid) * inverse_mass);
        let leaves = velocity.dot(normal) > 1e-3 * (pressed.norm() * self.radius).sqrt();
        self.rests = (pressed.dot(normal) < 0.0 && !leaves).then_some(normal);
        // A step that was cut short may have left some.
        self.impulse = Vector::default();
    }

    /// Gives its system what the fluid has given it.
    pub fn tell(&mut self, exchange: &mut Turn<'_>) {
        exchange.post_steady(self.row, self.state.position, std::mem::take(&mut self.impulse));
    }

    fn push(&mut self, impulse: Vector) {
        self.impulse = self.impulse + impulse;
        let (change, _) = self.state.response(self.state.position, impulse);
        self.state.velocity = self.state.velocity + self.free(change);
    }

    /// The part of a change of velocity that nothing holds.
    fn free(&self, change: Vector) -> Vector {
        self.rests.map_or(change, |n| change - n * n.dot(change))
    }

    /// Three directions, and whether the ball is free along each.
    fn directions(&self) -> [([f64; 3], bool); 3] {
        let Some(n) = self.rests else { return [([1.0, 0.0, 0.0], true), ([0.0, 1.0, 0.0], true), ([0.0, 0.0, 1.0], true)] };
        let least = [n.x.abs(), n.y.abs(), n.z.abs()];
        let axis = if least[0] <= least[1] && least[0] <= least[2] { 0 } else { 1 + usize::from(least[2] < least[1]) };
        let mut along = [0.0; 3];
        along[axis] = 1.0;
        let first = n.cross(along.into()).normalized();
        [(n.into(), false), (first.into(), true), (n.cross(first).into(), true)]
    }

    /// Forces besides the pressure, for h seconds: other forces, and the weight of the fluid that it displaces.      (gas.17)
    pub fn fall(&mut self, h: f64, gravity: [f64; 3], density: f64, grid: &Grid) {
        if self.state.inverse_mass == 0.0 {
            return;
        }
        self.state.velocity = self.state.velocity + self.free(self.state.acceleration * h);
        self.push(Vector::from(gravity) * (-h * density * self.displaced(grid)));
    }

    /// Goes on from where it was, a velocity and an impulse, by twice what it has changed since.                 (gas.20)
    pub fn reflect(&mut self, (velocity, impulse): (Vector, Vector)) {
        self.state.velocity = self.state.velocity * 2.0 - velocity;
        self.impulse = self.impulse * 2.0 - impulse;
    }

    /// Its part of the matrix of the pressure, a row for each direction; `mass` is that of the fluid in a cell [kg].
    pub(super) fn joints(&self, mass: f64) -> impl Iterator<Item = Joint> + '_ {
        self.directions().into_iter().map(move |(way, free)| {
            let part = |a: usize| self.faces[a].iter().filter(move |_| way[a] != 0.0).map(move |(at, j)| (*at, *j * way[a] as Real));
            Joint::new((0..3).flat_map(part).collect(), if free { mass * self.state.inverse_mass } else { 0.0 })
        })
    }

    /// Takes the impulse of a pressure, from j . q of its rows [m²/s]; `mass` is rho dx^(d-1) [kg/m].
    pub(super) fn yield_to(&mut self, products: &[f64], mass: f64) {
        if self.state.inverse_mass > 0.0 {
            let all = self.directions().into_iter().zip(products);
            self.push(all.fold(Vector::default(), |sum, ((way, _), product)| sum + Vector::from(way) * (product * mass)));
        }
    }
}
