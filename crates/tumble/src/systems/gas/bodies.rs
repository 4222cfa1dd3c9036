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

use crate::exchange::{Exchange, Port};
use crate::geometry::Vector;
use crate::linalg::poisson::Joint;
use crate::math::Real;
use crate::state::Grid;
use std::f64::consts::PI;

/// A ball, a disk of one metre thickness in the plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// The object that it belongs to.
    pub name: String,
    /// The mass of another system that it is.
    pub port: Port,
    /// Radius [m].
    pub radius: f64,
    /// Centre [m].
    pub position: Vector,
    /// Velocity [m/s].
    pub velocity: Vector,
    /// Acceleration by all but the fluid [m/s²].
    pub acceleration: Vector,
    /// 1/mass [1/kg]; 0 if it is held.
    pub inverse_mass: f64,
    /// What the fluid has given it in this interval [N s].
    pub impulse: Vector,
    /// Of each axis, the numbers of faces' cells and their closed shares.
    pub(super) faces: [Vec<(u32, Real)>; 3],
}

impl Body {
    /// A ball at rest.
    pub fn new(name: String, port: Port, radius: f64) -> Self {
        Self {
            name,
            port,
            radius,
            position: Vector::default(),
            velocity: Vector::default(),
            acceleration: Vector::default(),
            inverse_mass: 0.0,
            impulse: Vector::default(),
            faces: Default::default(),
        }
    }

    /// Signed distance [m] and direction of a point from the surface, of the nearest image across periodic sides.
    pub(super) fn near(&self, x: Vector, grid: &Grid) -> (f64, Vector) {
        let mut way: [f64; 3] = (x - self.position).into();
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
        let x: [f64; 3] = self.position.into();
        let share = |a: usize| {
            let (low, high) = (grid.origin[a], grid.origin[a] + grid.n[a] as f64 * grid.dx);
            let both = (x[a] + r).min(high) - (x[a] - r).max(low);
            if grid.periodic[a] { 1.0 } else { (both / (2.0 * r)).clamp(0.0, 1.0) }
        };
        grid.axes().map(share).product::<f64>() * whole
    }

    /// Takes its state from its system.
    pub(super) fn listen(&mut self, exchange: &Exchange) {
        let port = exchange.port(self.port);
        (self.position, self.velocity, self.acceleration) = (port.position, port.velocity, port.acceleration);
        self.inverse_mass = port.inverse_mass;
        // A step that was cut short may have left some.
        self.impulse = Vector::default();
    }

    /// Gives its system what the fluid has given it.
    pub(super) fn tell(&mut self, exchange: &mut Exchange) {
        exchange.lean(self.port, std::mem::take(&mut self.impulse));
    }

    fn push(&mut self, impulse: Vector) {
        self.impulse = self.impulse + impulse;
        self.velocity = self.velocity + impulse * self.inverse_mass;
    }

    /// What is not the pressure's, for h seconds: other forces, and the weight of the fluid that it displaces.      (gas.17)
    pub(super) fn fall(&mut self, h: f64, gravity: [f64; 3], density: f64, grid: &Grid) {
        if self.inverse_mass == 0.0 {
            return;
        }
        self.velocity = self.velocity + self.acceleration * h;
        self.push(Vector::from(gravity) * (-h * density * self.displaced(grid)));
    }

    /// Its part of the matrix of the pressure, a row for each axis; `mass` is that of the fluid in a cell [kg].
    pub(super) fn joints(&self, mass: f64) -> impl Iterator<Item = Joint> + '_ {
        self.faces.iter().map(move |cells| Joint::new(cells.clone(), mass * self.inverse_mass))
    }

    /// Takes the impulse of a pressure, from j . q of its rows [m²/s]; `mass` is rho dx^(d-1) [kg/m].
    pub(super) fn yield_to(&mut self, products: &[f64], mass: f64) {
        if let ([x, y, z], true) = (products, self.inverse_mass > 0.0) {
            self.push(Vector::from([*x, *y, *z]) * mass);
        }
    }
}
