//! Bodies: rows of a system that others may push.

use super::SystemId;
use crate::geometry::Vector;
use crate::math::Quat;
use std::ops::Range;

/// A row of a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct BodyRow {
    pub(super) body: usize,
    /// Counted from the first row of the body.
    pub(super) row: usize,
}

/// A range of rows of a system, with their published states.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// The system that moves it.
    pub(super) system: SystemId,
    /// Its rows in the system.
    pub rows: Range<usize>,
    /// Whether accelerations and contact normals are asked for.
    pub detailed: bool,
    /// The states of its rows.
    pub states: Vec<BodyState>,
    /// When they hold [s].
    pub time: f64,
}

/// The state of a row of a body. A mass point is a body without inertia: it takes no spin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyState {
    /// Position of the centre of mass [m].
    pub position: Vector,
    /// Turn from the axes of the body to those of the world.
    pub orientation: Quat<f64>,
    /// Velocity of the centre of mass [m/s].
    pub velocity: Vector,
    /// Angular velocity [rad/s].
    pub spin: Vector,
    /// Acceleration by all that its own system does to it but contact and joints [m/s²], where the body is detailed.
    pub acceleration: Vector,
    /// Whether a solid or the world holds it, by contact or joints, so that it does not fall; told of rigid bodies.
    pub borne: bool,
    /// Away from the solid of its own system that it touches, where the body is detailed; zero if it touches none.
    pub normal: Vector,
    /// Where that solid bears it: the centre of the points of contact [m], and the mean square of their distances from it, as xx, yy, zz, xy, yz,
    /// zx [m²].
    pub footing: (Vector, [f64; 6]),
    /// 1/mass [1/kg], 0 for what is held.
    pub inverse_mass: f64,
    /// Inverse of the inertia about the centre of mass, in the axes of the world: xx, yy, zz, xy, yz, zx [1/(kg m²)].
    pub inverse_inertia: [f64; 6],
    /// Whether it is there: rows may be kept for what is born, or breaks off.
    pub present: bool,
}

impl Default for BodyState {
    fn default() -> Self {
        let zero = Vector::default();
        Self {
            position: zero,
            orientation: Quat { v: zero, w: 1.0 },
            velocity: zero,
            spin: zero,
            acceleration: zero,
            borne: false,
            normal: zero,
            footing: (zero, [0.0; 6]),
            inverse_mass: 0.0,
            inverse_inertia: [0.0; 6],
            present: true,
        }
    }
}

impl BodyState {
    /// Where a point of it is, from the centre of mass in its own axes [m].
    pub fn place(&self, own: Vector) -> Vector {
        if own == Vector::default() { self.position } else { self.position + self.orientation.turn(own) }
    }

    /// Velocity of its point at x [m/s].
    pub fn velocity_at(&self, x: Vector) -> Vector {
        self.velocity + self.spin.cross(x - self.position)
    }

    /// How velocity [m/s] and spin [rad/s] change by an impulse [N s] at a point [m]: whoever touches a body keeps a copy of its state, counts
    /// both sides in the effective mass, and changes the copy with each impulse.
    pub fn response(&self, point: Vector, impulse: Vector) -> (Vector, Vector) {
        (impulse * self.inverse_mass, self.turned((point - self.position).cross(impulse)))
    }

    /// Change of spin by an angular impulse about the centre of mass [N m s].
    pub fn turned(&self, angular: Vector) -> Vector {
        let [xx, yy, zz, xy, yz, zx] = self.inverse_inertia;
        let Vector { x, y, z } = angular;
        Vector { x: xx * x + xy * y + zx * z, y: xy * x + yy * y + yz * z, z: zx * x + yz * y + zz * z }
    }

    /// Whether a push into what bears it finds that below the point, and does not turn it.
    pub fn is_borne_at(&self, point: Vector) -> bool {
        let (foot, [xx, yy, zz, xy, yz, zx]) = self.footing;
        let arm = point - foot;
        let Vector { x, y, z } = arm - self.normal * arm.dot(self.normal);
        let square = x * x + y * y + z * z;
        let spread = xx * x * x + yy * y * y + zz * z * z + 2.0 * (xy * x * y + yz * y * z + zx * z * x);
        square * square <= spread
    }

    /// Takes an impulse [N s] at a point [m].
    pub fn push(&mut self, point: Vector, impulse: Vector) {
        let (velocity, spin) = self.response(point, impulse);
        (self.velocity, self.spin) = (self.velocity + velocity, self.spin + spin);
    }

    /// The state at the part s of the way, 0 to 1, from `self` to `end`, h seconds later: positions by the cubic that has the velocities of both
    /// ends, all else linear.
    pub(super) fn towards(&self, end: &Self, h: f64, s: f64) -> Self {
        let mix = |a: Vector, b: Vector| a * (1.0 - s) + b * s;
        let (p, q) = (s * s * (3.0 - 2.0 * s), s * (1.0 - s));
        let position = self.position * (1.0 - p) + end.position * p + (self.velocity * (1.0 - s) - end.velocity * s) * (h * q);
        let far = if self.orientation.dot(end.orientation) < 0.0 { -end.orientation } else { end.orientation };
        Self {
            position,
            orientation: (self.orientation.scaled(1.0 - s) + far.scaled(s)).normalized(),
            velocity: mix(self.velocity, end.velocity),
            spin: mix(self.spin, end.spin),
            ..*end
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_impulse_changes_the_twist_as_inertia_says() {
        // A box of 2 kg; about its own axes 0.5, 0.25 and 0.2 kg m².
        let mut state = BodyState {
            position: [1.0, 0.0, 0.0].into(),
            inverse_mass: 0.5,
            inverse_inertia: [2.0, 4.0, 5.0, 0.0, 0.0, 0.0],
            ..BodyState::default()
        };
        let (point, impulse) = (Vector::from([1.0, 2.0, 0.0]), Vector::from([3.0, 0.0, 1.0]));
        state.push(point, impulse);
        // r x J = (0, 2, 0) x (3, 0, 1) = (2, 0, -6).
        assert_eq!((state.velocity, state.spin), ([1.5, 0.0, 0.5].into(), [4.0, 0.0, -30.0].into()));
        assert_eq!(state.velocity_at(point), [61.5, 0.0, 8.5].into());
        // What the impulse does is half its product with the velocities before and after.
        let energy = 0.5 * 2.0 * state.velocity.norm_sq() + 0.5 * (0.5 * 16.0 + 0.2 * 900.0);
        assert!((energy - 0.5 * impulse.dot(state.velocity_at(point))).abs() < 1e-12 && energy > 90.0);
    }

    #[test]
    fn a_body_is_borne_between_its_feet() {
        // On two feet 0.2 m left and right of the middle.
        let state = BodyState {
            normal: [0.0, 0.0, 1.0].into(),
            footing: (Vector::default(), [0.04, 0.0, 0.0, 0.0, 0.0, 0.0]),
            ..BodyState::default()
        };
        let borne = [[0.0, 0.0, 1.0], [0.19, 0.0, 0.5], [-0.19, 0.0, 0.5]];
        let not = [[0.21, 0.0, 0.5], [0.0, 0.01, 0.5], [0.1, 0.2, 0.5]];
        assert!(borne.iter().all(|p| state.is_borne_at((*p).into())) && !not.iter().any(|p| state.is_borne_at((*p).into())));
    }

    #[test]
    fn between_two_states_a_body_moves_by_the_cubic_of_its_velocities() {
        // x = t³ from t = 1 to t = 3.
        let at =
            |t: f64| BodyState { position: [t * t * t, 0.0, 0.0].into(), velocity: [3.0 * t * t, 0.0, 0.0].into(), ..BodyState::default() };
        let between = at(1.0).towards(&at(3.0), 2.0, 0.25);
        assert!((between.position.x - 1.5_f64.powi(3)).abs() < 1e-12, "{between:?}");
    }
}
