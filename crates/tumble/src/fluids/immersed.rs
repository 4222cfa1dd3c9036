//! Bodies that the fluid moves: rigid bodies and masses of other systems, solved for together with the pressure.
//!
//!   (V', O') = (V, O) + W P,   P = rho dx^(d-1) J q                                                  (gas.16)
//!
//! The rows of J have the closed share of each face beside the body, + where the fluid is on its lower side, and its moments about the centre of
//! mass; W is how velocity and spin yield to an impulse and an angular impulse. The same J carries (V', O') into the divergence, so that momentum
//! and angular momentum pass over without loss, and what the fluid's mass adds to that of the body is in the matrix: no body is too light. The
//! weight of the displaced fluid, which the pressure of the fluid does not have, is added.            (gas.17)
//!
//! Source: [batty2007]. Limits: no skin friction comes back; within an interval of the exchange W stays, joints hold nothing, and what bears a body
//! does so without friction.
//! Tests: crates/tumble-f64/tests/bodies.rs, crates/tumble-f64/tests/immersed.rs.

use crate::exchange::{BodyRow, BodyState, Exchange, Turn};
use crate::geometry::{Collider, Friction, Shape, Vector};
use crate::linalg::poisson::{DIRECTIONS, Directions, Joint, times};
use crate::math::{Real, rotation};
use crate::state::Grid;
use std::f64::consts::PI;
use std::sync::Arc;

/// A body stands on feet that are farther apart than this, over its reach: else it tilts.
const FEET: f64 = 1e-3;

/// How a body yields: what an impulse [N s] and an angular impulse [N m s] change of its velocity [m/s] and its spin [rad/s].
type Response = [Directions; DIRECTIONS];

/// An impulse, or a velocity, and the same of the turn.
fn joined(along: Vector, about: Vector) -> Directions {
    [along.x, along.y, along.z, about.x, about.y, about.z]
}

fn parted([a, b, c, d, e, f]: Directions) -> [Vector; 2] {
    [Vector { x: a, y: b, z: c }, Vector { x: d, y: e, z: f }]
}

/// The surface of bodies.
#[derive(Debug, Clone)]
pub struct Hull {
    /// In the axes of the body, about its centre of mass; it has no motion of its own.
    pub solid: Arc<Collider>,
    /// Greatest distance of the surface from the centre of mass [m].
    pub reach: f64,
    /// Its volume [m³]; in the plane, of one metre across it.
    pub volume: f64,
}

impl Hull {
    /// Of a ball, a disk of one metre thickness in the plane.
    pub fn ball(name: &str, radius: f64, flat: bool) -> Self {
        let solid = Collider {
            name: name.into(),
            shape: Shape::Sphere { center: Vector::default(), radius },
            inside: false,
            thickness: 0.0,
            friction: Friction::default(),
            rubbing: None,
            restitution: 0.0,
            belt: Vector::default(),
            motion: None,
            rig: None,
            edges: None,
        };
        let volume = PI * radius * radius * if flat { 1.0 } else { 4.0 / 3.0 * radius };
        Self { solid: Arc::new(solid), reach: radius, volume }
    }

    /// Radius of what is round [m], which no wall thickens (gas.19); the reach of all else.
    pub fn radius(&self) -> f64 {
        match self.solid.shape {
            Shape::Sphere { radius, .. } | Shape::Capsule { radius, .. } => radius,
            _ => self.reach,
        }
    }
}

/// A body in a fluid.
#[derive(Debug, Clone)]
pub struct Immersed {
    /// The row of another system that it is.
    row: BodyRow,
    /// Its surface.
    pub hull: Hull,
    /// A copy of its state, which takes every impulse at once.
    pub state: BodyState,
    /// How it yields to impulses, in this interval; not at all before the first.
    response: Response,
    /// Impulse from the fluid in this interval [N s], and angular impulse about the centre of mass [N m s].
    wrench: Directions,
    /// Cells beside it, with its closed shares of their faces along each axis, and the moments of those [m].
    cells: Vec<(u32, [Real; DIRECTIONS])>,
}

/// What of a body a half step goes on from: velocity and spin, and what it has got.
pub struct Before {
    twist: Directions,
    wrench: Directions,
}

impl Immersed {
    /// A body in this state.
    pub fn new(row: BodyRow, hull: Hull, state: BodyState) -> Self {
        Self { row, hull, state, response: Response::default(), wrench: Default::default(), cells: Vec::new() }
    }

    /// The object that it belongs to.
    pub fn name(&self) -> &String {
        &self.hull.solid.name
    }

    /// The way from its centre to a point, of the nearest image across periodic sides [m]; in the plane, in it.
    fn arm(&self, x: Vector, grid: &Grid) -> Vector {
        let mut way: [f64; 3] = (x - self.state.position).into();
        for axis in 0..3 {
            if grid.flat == Some(axis) {
                way[axis] = 0.0;
            } else if grid.periodic[axis] {
                let length = grid.n[axis] as f64 * grid.dx;
                way[axis] -= length * (way[axis] / length).round();
            }
        }
        way.into()
    }

    /// Signed distance of a point from the surface [m], of no more than a lower bound beyond `within` [m], the direction away from it, and its
    /// velocity [m/s].
    pub(super) fn near(&self, x: Vector, grid: &Grid, within: f64) -> (f64, Vector, Vector) {
        let arm = self.arm(x, grid);
        let (least, velocity) = (arm.norm() - self.hull.reach, self.velocity_at(x, grid));
        if least > within {
            return (least, Vector::default(), velocity);
        }
        let turn = self.state.orientation;
        let (distance, normal, _) = self.hull.solid.surface(turn.conj().turn(arm), 0.0, within);
        (distance, turn.turn(normal), velocity)
    }

    /// Velocity of its point at x [m/s].
    pub(super) fn velocity_at(&self, x: Vector, grid: &Grid) -> Vector {
        self.state.velocity + self.state.spin.cross(self.arm(x, grid))
    }

    /// The speed of its fastest point [m/s], 0 out of the box.
    pub(super) fn fastest(&self, grid: &Grid) -> f64 {
        let overlap = self.overlap(grid);
        if overlap > 0.0 { self.state.velocity.norm() + self.state.spin.norm() * self.hull.reach } else { 0.0 }
    }

    /// The share of the box around the ball of its reach that is in the box of the fluid.
    fn overlap(&self, grid: &Grid) -> f64 {
        let (x, r): ([f64; 3], f64) = (self.state.position.into(), self.hull.reach);
        let share = |a: usize| {
            let (low, high) = (grid.origin[a], grid.origin[a] + grid.n[a] as f64 * grid.dx);
            let both = (x[a] + r).min(high) - (x[a] - r).max(low);
            if grid.periodic[a] { 1.0 } else { (both / (2.0 * r)).clamp(0.0, 1.0) }
        };
        grid.axes().map(share).product()
    }

    /// The volume that it displaces [m³]; across a side of the box, an estimate.
    fn displaced(&self, grid: &Grid) -> f64 {
        self.overlap(grid) * self.hull.volume
    }

    /// Takes its state from its system.
    pub fn listen(&mut self, exchange: &Exchange, gravity: [f64; 3], density: f64, grid: &Grid) {
        self.state = *exchange.state(self.row);
        let BodyState { position, acceleration, normal, footing: (foot, spread), inverse_mass, inverse_inertia, .. } = self.state;
        self.response = free(inverse_mass, inverse_inertia);
        let pressed = acceleration - Vector::from(gravity) * (density * self.displaced(grid) * inverse_mass);
        // A mass has no feet.
        let arm = if inverse_inertia == [0.0; 6] { Vector::default() } else { foot - position };
        let leaves = self.state.velocity_at(position + arm).dot(normal) > 1e-3 * (pressed.norm() * self.hull.reach).sqrt();
        if pressed.dot(normal) < 0.0 && !leaves {
            hold(&mut self.response, joined(normal, arm.cross(normal)));
            let least = FEET * self.hull.reach;
            for tilt in tilts(normal, spread, least * least).into_iter().flatten() {
                hold(&mut self.response, joined(Vector::default(), tilt));
            }
        }
        // A step that was cut short may have left some.
        self.wrench = Default::default();
    }

    /// Gives its system what the fluid has given it.
    pub fn tell(&mut self, exchange: &mut Turn<'_>) {
        let [impulse, couple] = parted(std::mem::take(&mut self.wrench));
        exchange.post_central(self.row, impulse, couple);
    }

    /// Changes velocity and spin by an impulse and an angular impulse about its centre.
    fn yield_by(&mut self, wrench: Directions) {
        let [velocity, spin] = parted(times(&self.response, &wrench));
        (self.state.velocity, self.state.spin) = (self.state.velocity + velocity, self.state.spin + spin);
    }

    fn push(&mut self, wrench: Directions) {
        self.wrench.iter_mut().zip(wrench).for_each(|(sum, part)| *sum += part);
        self.yield_by(wrench);
    }

    /// Forces besides the pressure, for h seconds: other forces, and the weight of the fluid that it displaces.      (gas.17)
    pub fn fall(&mut self, h: f64, gravity: [f64; 3], density: f64, grid: &Grid) {
        let BodyState { acceleration, inverse_mass, .. } = self.state;
        if inverse_mass == 0.0 {
            return;
        }
        self.yield_by(joined(acceleration * (h / inverse_mass), Vector::default()));
        self.push(joined(Vector::from(gravity) * (-h * density * self.displaced(grid)), Vector::default()));
    }

    /// Moves for h seconds.
    pub fn advance(&mut self, h: f64) {
        let BodyState { position, orientation, velocity, spin, .. } = &mut self.state;
        *position = *position + *velocity * h;
        if *spin != Vector::default() {
            *orientation = (rotation::by(*spin * h) * *orientation).normalized();
        }
    }

    /// What a half step goes on from.
    pub fn before(&self) -> Before {
        Before { twist: joined(self.state.velocity, self.state.spin), wrench: self.wrench }
    }

    /// Goes on from there by twice what has changed since.                                             (gas.20)
    pub fn reflect(&mut self, before: &Before) {
        let now = self.before();
        let twice = |now: Directions, before: Directions| -> Directions { std::array::from_fn(|k| 2.0 * now[k] - before[k]) };
        [self.state.velocity, self.state.spin] = parted(twice(now.twist, before.twist));
        self.wrench = twice(now.wrench, before.wrench);
    }

    /// Forgets the cells beside it.
    pub(super) fn leave(&mut self) {
        self.cells.clear();
    }

    /// Takes a face: cells whose pressure pushes along the axis, and by which share of the face.
    pub(super) fn meet(&mut self, axis: usize, face: Vector, pushes: impl Iterator<Item = (u32, Real)>, grid: &Grid) {
        let mut along = [0.0; 3];
        along[axis] = 1.0;
        let about: [f64; 3] = self.arm(face, grid).cross(along.into()).into();
        for (cell, share) in pushes {
            let entry = |k: usize| share * if k < 3 { along[k] } else { about[k - 3] } as Real;
            self.cells.push((cell, std::array::from_fn(entry)));
        }
    }

    /// Joins the entries of each cell.
    pub(super) fn sort(&mut self) {
        self.cells.sort_by_key(|(cell, _)| *cell);
        self.cells.dedup_by(|next, first| {
            let same = next.0 == first.0;
            if same {
                first.1.iter_mut().zip(next.1).for_each(|(sum, entry)| *sum += entry);
            }
            same
        });
    }

    /// Its part of the matrix of the pressure of the cells that `has` says; `mass` is that of the fluid in a cell [kg].
    pub(super) fn joint(&self, mass: f64, has: &impl Fn(u32) -> bool) -> Joint {
        Joint::new(self.cells.iter().filter(|(cell, _)| has(*cell)).copied().collect(), self.response.map(|row| row.map(|w| mass * w)))
    }

    /// The sum of what cells that `has` says have, by the rows of J.
    pub(super) fn sum(&self, of: impl Fn(u32) -> f64, has: &impl Fn(u32) -> bool) -> Directions {
        let mut sums = Directions::default();
        for (cell, entries) in self.cells.iter().filter(|(cell, _)| has(*cell)) {
            let value = of(*cell);
            sums.iter_mut().zip(entries).for_each(|(sum, entry)| *sum += f64::from(*entry) * value);
        }
        sums
    }

    /// Takes the impulse of a pressure, from J q [m²/s]; `mass` is rho dx^(d-1) [kg/m].
    pub fn yield_to(&mut self, product: &Directions, mass: f64) {
        if self.state.inverse_mass > 0.0 {
            self.push(product.map(|part| part * mass));
        }
    }

    /// Numbers of its state in a snapshot.
    pub const NUMBERS: usize = 13;

    /// Its place and motion as numbers.
    pub fn numbers(&self) -> [f64; Self::NUMBERS] {
        let mut numbers = [0.0; Self::NUMBERS];
        let BodyState { position, orientation, velocity, spin, .. } = self.state;
        let three = <[f64; 3]>::from;
        let parts = [&three(position)[..], &orientation.row(), &three(velocity), &three(spin)].concat();
        numbers.copy_from_slice(&parts);
        numbers
    }

    /// Takes them back.
    pub fn put(&mut self, s: &[f64]) {
        let v = |s: &[f64]| Vector { x: s[0], y: s[1], z: s[2] };
        self.state.position = v(s);
        self.state.orientation.v = v(&s[3..]);
        self.state.orientation.w = s[6];
        (self.state.velocity, self.state.spin) = (v(&s[7..]), v(&s[10..]));
    }
}

/// The response of a body that nothing holds.
fn free(inverse_mass: f64, [xx, yy, zz, xy, yz, zx]: [f64; 6]) -> Response {
    let m = inverse_mass;
    [
        [m, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, m, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, m, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, xx, xy, zx],
        [0.0, 0.0, 0.0, xy, yy, yz],
        [0.0, 0.0, 0.0, zx, yz, zz],
    ]
}

/// Takes out of a response what changes c . (velocity, spin).                                              (gas.23)
fn hold(response: &mut Response, c: Directions) {
    let way = times(response, &c);
    let size: f64 = way.iter().zip(&c).map(|(a, b)| a * b).sum();
    let largest = (0..DIRECTIONS).map(|k| response[k][k] * c[k] * c[k]).fold(0.0, f64::max);
    // What is held already is held but for rounding.
    if size > 1e-9 * largest {
        for (row, a) in response.iter_mut().zip(way) {
            row.iter_mut().zip(way).for_each(|(w, b)| *w -= a * b / size);
        }
    }
}

/// Axes about which feet keep a body from tilting, from the normal and the mean squares of how they are spread [m²], where they are spread by more
/// than `least` [m²]: two if they are no line, one if they are.
fn tilts(normal: Vector, [xx, yy, zz, xy, yz, zx]: [f64; 6], least: f64) -> [Option<Vector>; 2] {
    let size = [normal.x.abs(), normal.y.abs(), normal.z.abs()];
    let axis = if size[0] <= size[1] && size[0] <= size[2] { 0 } else { 1 + usize::from(size[2] < size[1]) };
    let mut across = [0.0; 3];
    across[axis] = 1.0;
    let first = normal.cross(across.into()).normalized();
    let second = normal.cross(first);
    let spread = |a: Vector, b: Vector| {
        let x = Vector { x: xx * b.x + xy * b.y + zx * b.z, y: xy * b.x + yy * b.y + yz * b.z, z: zx * b.x + yz * b.y + zz * b.z };
        a.dot(x)
    };
    // In the plane of the feet: the two principal squares, and the direction of the larger.
    let (a, b, c) = (spread(first, first), spread(first, second), spread(second, second));
    let (mean, half) = (0.5 * (a + c), (0.25 * (a - c) * (a - c) + b * b).sqrt());
    if mean - half > least {
        return [Some(first), Some(second)];
    }
    if mean + half <= least {
        return [None, None];
    }
    let low = mean - half;
    let [one, other] = [first * (a - low) + second * b, first * b + second * (c - low)];
    let line = if one.norm_sq() >= other.norm_sq() { one } else { other };
    [Some(normal.cross(line).normalized()), None]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of 2 kg on the floor, which touches with these feet below its centre.
    fn borne(feet: &[[f64; 2]]) -> Response {
        let mut response = free(0.5, [2.0, 4.0, 5.0, 0.0, 0.0, 0.0]);
        let n = feet.len() as f64;
        let [x, y] = [0, 1].map(|k| feet.iter().map(|foot| foot[k]).sum::<f64>() / n);
        let mean = |a: usize, b: usize| feet.iter().map(|f| (f[a] - [x, y][a]) * (f[b] - [x, y][b])).sum::<f64>() / n;
        let up = Vector { x: 0.0, y: 0.0, z: 1.0 };
        let arm = Vector { x, y, z: -0.5 };
        hold(&mut response, joined(up, arm.cross(up)));
        let spread = [mean(0, 0), mean(1, 1), 0.0, mean(0, 1), 0.0, 0.0];
        tilts(up, spread, 1e-6).into_iter().flatten().for_each(|tilt| hold(&mut response, joined(Vector::default(), tilt)));
        response
    }

    #[test]
    fn feet_hold_what_they_stand_on() {
        let push = [3.0, 1.0, -2.0, 0.7, -0.4, 0.9];
        // On four feet it slides and turns about the vertical.
        let [v, w] = parted(times(&borne(&[[0.1, 0.2], [0.1, -0.2], [-0.1, 0.2], [-0.1, -0.2]]), &push));
        assert!((v - [1.5, 0.5, 0.0].into()).norm() < 1e-12 && (w - [0.0, 0.0, 4.5].into()).norm() < 1e-12, "{v:?} {w:?}");
        // On two it tilts about their line; the feet do not move up or down.
        let [v, w] = parted(times(&borne(&[[0.3, 0.1], [0.3, -0.1]]), &push));
        let [arm, along]: [Vector; 2] = [[0.3, 0.0, -0.5].into(), [0.0, 1.0, 0.0].into()];
        assert!((v + w.cross(arm)).z.abs() < 1e-12 && w.x.abs() < 1e-12 && w.dot(along).abs() > 0.1, "{v:?} {w:?}");
        // On one it rolls.
        let [v, w] = parted(times(&borne(&[[0.0, 0.0]]), &push));
        assert!(v.z.abs() < 1e-12 && (w - [1.4, -1.6, 4.5].into()).norm() < 1e-12, "{v:?} {w:?}");
    }
}
