//! A rigid body in its principal axes, and how it turns where nothing touches it.
//!
//!   L' = 0,   q' = q (0, J⁻¹ q* L q) / 2                                                                        (rigid.2)
//!
//! Source: splitting of the kinetic energy [mclachlan1993], into that of a symmetric top and the rest.

use crate::geometry::Vector;
use crate::math::Quat;
use crate::math::rotation::by;

/// State and inertia of a rigid body. A solid that moves as the scene says has an inverse mass of 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Centre of mass [m].
    pub x: Vector,
    /// Turn from the principal axes to those of the world.
    pub q: Quat<f64>,
    /// Velocity [m/s].
    pub v: Vector,
    /// Angular velocity [rad/s].
    pub w: Vector,
    /// 1/mass [1/kg].
    pub inverse_mass: f64,
    /// Principal moments of inertia [kg m²].
    pub inertia: [f64; 3],
    /// Inverse inertia in the axes of the world: xx, yy, zz, xy, yz, zx [1/(kg m²)].
    pub inverse_inertia: [f64; 6],
    /// The axis of the world across the plane in which it moves, if it moves in one.
    pub across: Option<usize>,
}

impl Body {
    /// What nothing moves, at the origin.
    pub const WORLD: Self = {
        let zero = Vector { x: 0.0, y: 0.0, z: 0.0 };
        let q = Quat { v: zero, w: 1.0 };
        Self { x: zero, q, v: zero, w: zero, inverse_mass: 0.0, inertia: [f64::INFINITY; 3], inverse_inertia: [0.0; 6], across: None }
    };

    /// Angular momentum about the centre of mass [N m s].
    pub fn spin(&self) -> Vector {
        let w = self.q.conj().turn(self.w);
        let [a, b, c] = self.inertia;
        let spin = self.q.turn([a * w.x, b * w.y, c * w.z].into());
        self.across.map_or(spin, |axis| only(spin, axis))
    }

    /// Takes away what leads out of the plane in which it moves.
    pub fn flatten(&mut self) {
        if let Some(axis) = self.across {
            self.v = self.v - only(self.v, axis);
            self.w = only(self.w, axis);
        }
    }

    /// Change of angular velocity by an angular impulse [N m s].
    #[inline]
    pub fn turned(&self, l: Vector) -> Vector {
        let [xx, yy, zz, xy, yz, zx] = self.inverse_inertia;
        Vector { x: xx * l.x + xy * l.y + zx * l.z, y: xy * l.x + yy * l.y + yz * l.z, z: zx * l.x + yz * l.y + zz * l.z }
    }

    /// Velocity at the arm r [m/s].
    #[inline]
    pub fn velocity_at(&self, r: Vector) -> Vector {
        self.v + self.w.cross(r)
    }

    /// Moves [m] and turns it by little [rad]; its angular momentum about the origin stays.
    pub fn displace(&mut self, way: Vector, turn: Vector) {
        let spin = self.spin() - way.cross(self.v * (1.0 / self.inverse_mass));
        self.x = self.x + way;
        self.q = (by(turn) * self.q).normalized();
        self.orient();
        self.w = self.turned(spin);
    }

    /// Puts the inverse inertia into the axes of the world.
    pub fn orient(&mut self) {
        if self.inverse_mass == 0.0 {
            return;
        }
        if let Some(axis) = self.across {
            let [x, y, z] = <[f64; 3]>::from(self.q.conj().turn(only([1.0; 3].into(), axis)));
            let [a, b, c] = self.inertia;
            self.inverse_inertia = [0.0; 6];
            self.inverse_inertia[axis] = 1.0 / (a * x * x + b * y * y + c * z * z);
            return;
        }
        let [a, b, c] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|e| self.q.turn(Vector::from(e)));
        let [i, j, k] = self.inertia.map(|moment| 1.0 / moment);
        let sum = |f: fn(Vector) -> f64| i * f(a) + j * f(b) + k * f(c);
        self.inverse_inertia =
            [sum(|e| e.x * e.x), sum(|e| e.y * e.y), sum(|e| e.z * e.z), sum(|e| e.x * e.y), sum(|e| e.y * e.z), sum(|e| e.z * e.x)];
    }

    /// Turns freely for h [s]: half a turn about one axis, a symmetric top's motion, which has a formula, and the other half. Keeps the angular
    /// momentum to round-off and the energy within O(h²); exact for two equal moments.                             (rigid.3)
    pub fn turn_freely(&mut self, h: f64) {
        if self.across.is_some() {
            self.q = (by(self.w * h) * self.q).normalized();
            return;
        }
        let inverse = self.inertia.map(|moment| 1.0 / moment);
        let apart = |a: usize, b: usize| (inverse[a] - inverse[b]).abs();
        // The top has the two moments that differ least.
        let [a, b, c] = [[0, 1, 2], [1, 2, 0], [2, 0, 1]]
            .into_iter()
            .fold([0, 1, 2], |best, pair| if apart(pair[0], pair[1]) < apart(best[0], best[1]) { pair } else { best });
        let momentum = self.spin();
        let about = |q: Quat<f64>, axis: usize, rate: f64, s: f64| {
            let mut angle = [0.0; 3];
            angle[axis] = rate * <[f64; 3]>::from(q.conj().turn(momentum))[axis] * s;
            q * by(angle.into())
        };
        let rest = inverse[b] - inverse[a];
        let mut q = about(self.q, b, rest, 0.5 * h);
        q = by(momentum * (inverse[a] * h)) * about(q, c, inverse[c] - inverse[a], h);
        self.q = about(q, b, rest, 0.5 * h).normalized();
        let l = <[f64; 3]>::from(self.q.conj().turn(momentum));
        self.w = self.q.turn([l[0] * inverse[0], l[1] * inverse[1], l[2] * inverse[2]].into());
    }

    /// Kinetic energy [J].
    pub fn kinetic(&self) -> f64 {
        0.5 * (self.v.norm_sq() / self.inverse_mass + self.w.dot(self.spin()))
    }
}

/// The part of a vector along an axis.
fn only(v: Vector, axis: usize) -> Vector {
    let mut part = [0.0; 3];
    part[axis] = <[f64; 3]>::from(v)[axis];
    part.into()
}
