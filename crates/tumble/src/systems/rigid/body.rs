//! A rigid body in its principal axes, and how it turns where nothing touches it.
//!
//!   L' = 0,   q' = q (0, J⁻¹ q* L q) / 2                                                                        (rigid.2)
//!
//! Source: splitting of the kinetic energy into those of turns about each axis [mclachlan1993].

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
}

impl Body {
    /// Angular momentum about the centre of mass [N m s].
    pub fn spin(&self) -> Vector {
        let w = self.q.conj().turn(self.w);
        let [a, b, c] = self.inertia;
        self.q.turn([a * w.x, b * w.y, c * w.z].into())
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

    /// Puts the inverse inertia into the axes of the world.
    pub fn orient(&mut self) {
        if self.inverse_mass == 0.0 {
            return;
        }
        let [a, b, c] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|e| self.q.turn(Vector::from(e)));
        let [i, j, k] = self.inertia.map(|moment| 1.0 / moment);
        let sum = |f: fn(Vector) -> f64| i * f(a) + j * f(b) + k * f(c);
        self.inverse_inertia =
            [sum(|e| e.x * e.x), sum(|e| e.y * e.y), sum(|e| e.z * e.z), sum(|e| e.x * e.y), sum(|e| e.y * e.z), sum(|e| e.z * e.x)];
    }

    /// Turns freely for h [s]: the flow of L_a²/(2 I_a) about each principal axis, forwards and backwards. Keeps the angular momentum to
    /// round-off, the energy within O(h²), and is exact for bodies of three equal moments.                       (rigid.3)
    pub fn turn_freely(&mut self, h: f64) {
        let [a, b, c] = self.inertia;
        if a == b && b == c {
            self.q = (by(self.w * h) * self.q).normalized();
            return;
        }
        let momentum = self.spin();
        let mut l = self.q.conj().turn(momentum);
        for (axis, part) in [(0, 0.5), (1, 0.5), (2, 1.0), (1, 0.5), (0, 0.5)] {
            let mut angle = [0.0; 3];
            angle[axis] = <[f64; 3]>::from(l)[axis] / self.inertia[axis] * h * part;
            let turn = by(angle.into());
            self.q = self.q * turn;
            l = turn.conj().turn(l);
        }
        self.q = self.q.normalized();
        self.w = self.q.turn([l.x / a, l.y / b, l.z / c].into());
    }

    /// Kinetic energy [J].
    pub fn kinetic(&self) -> f64 {
        0.5 * (self.v.norm_sq() / self.inverse_mass + self.w.dot(self.spin()))
    }
}
