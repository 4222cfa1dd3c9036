//! Moments of inertia of bodies of points, and the rigid motion that has their momenta.

use crate::geometry::Vector;
use crate::math::parallel::fold;
use std::ops::Range;

/// Part of the inertia that is added to it, so that a body in a line has an inverse one.
const LEAST: f64 = 1e-8;

/// xx, yy, zz, xy, yz, zx of an inertia tensor [kg m²].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Inertia([f64; 6]);

impl Inertia {
    /// Of a mass [kg] at a place from the centre [m].
    pub fn of(m: f64, Vector { x, y, z }: Vector) -> Self {
        Self([y * y + z * z, z * z + x * x, x * x + y * y, -x * y, -y * z, -z * x].map(|c| m * c))
    }

    /// The sum of two.
    pub fn plus(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] + other.0[k]))
    }

    /// With the same about all axes added.
    pub fn plus_round(self, own: f64) -> Self {
        Self(std::array::from_fn(|k| if k < 3 { self.0[k] + own } else { self.0[k] }))
    }

    /// I w.
    pub fn times(self, v: Vector) -> Vector {
        let Self([xx, yy, zz, xy, yz, zx]) = self;
        Vector { x: xx * v.x + xy * v.y + zx * v.z, y: xy * v.x + yy * v.y + yz * v.z, z: zx * v.x + yz * v.y + zz * v.z }
    }

    /// The spin w of I w = L; about the axis of a body in a line L is rounding, and so is w.
    pub fn spin(self, angular: Vector) -> Vector {
        let Self([xx, yy, zz, ..]) = self;
        let rounded = self.plus_round(LEAST * (xx + yy + zz));
        let spin = rounded.solve(angular);
        // The second solution takes back what rounding has added.
        spin + rounded.solve(angular - self.times(spin))
    }

    /// Whether all axes have a moment that is not much smaller than the others.
    pub fn is_round(self) -> bool {
        let Self([xx, yy, zz, ..]) = self;
        let third = (xx + yy + zz) / 3.0;
        third > 0.0 && self.determinant() > 1e-6 * third * third * third
    }

    fn columns(self) -> ([Vector; 3], f64) {
        let Self([xx, yy, zz, xy, yz, zx]) = self;
        let rows = [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]].map(Vector::from);
        let columns = [rows[1].cross(rows[2]), rows[2].cross(rows[0]), rows[0].cross(rows[1])];
        (columns, rows[0].dot(columns[0]))
    }

    fn determinant(self) -> f64 {
        self.columns().1
    }

    fn solve(self, b: Vector) -> Vector {
        let (columns, det) = self.columns();
        if det > 0.0 { (columns[0] * b.x + columns[1] * b.y + columns[2] * b.z) * (1.0 / det) } else { Vector::default() }
    }
}

/// The rigid motion of a body.
#[derive(Debug, Clone, Copy, Default)]
pub struct Motion {
    /// Its mass [kg].
    pub mass: f64,
    /// Its centre of mass [m].
    pub center: Vector,
    /// Its inertia about that [kg m²].
    pub inertia: Inertia,
    /// Velocity of its centre [m/s].
    pub velocity: Vector,
    /// Its spin [rad/s].
    pub spin: Vector,
}

impl Motion {
    /// Of n points with masses [kg], places [m] and velocities [m/s].
    pub fn of(
        n: usize,
        mass: impl Fn(usize) -> f64 + Sync,
        x: impl Fn(usize) -> Vector + Sync,
        v: impl Fn(usize) -> Vector + Sync,
    ) -> Self {
        // Measured from one point, so that nothing is lost far from the origin.
        let origin = if n > 0 { x(0) } else { Vector::default() };
        let first = |range: Range<usize>| {
            range.fold((0.0, Vector::default(), Vector::default()), |(m, c, p), i| {
                (m + mass(i), c + (x(i) - origin) * mass(i), p + v(i) * mass(i))
            })
        };
        let zero = (0.0, Vector::default(), Vector::default());
        let (total, c, p) = fold(n, first).into_iter().fold(zero, |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2));
        let (center, velocity) = (origin + c * (1.0 / total), p * (1.0 / total));
        let second = |range: Range<usize>| {
            range.fold((Inertia::default(), Vector::default()), |(inertia, l), i| {
                let (m, r) = (mass(i), x(i) - center);
                (inertia.plus(Inertia::of(m, r)), l + r.cross(v(i) - velocity) * m)
            })
        };
        let zero = (Inertia::default(), Vector::default());
        let (inertia, angular) = fold(n, second).into_iter().fold(zero, |a, b| (a.0.plus(b.0), a.1 + b.1));
        Self { mass: total, center, inertia, velocity, spin: inertia.spin(angular) }
    }

    /// Velocity [m/s] at a place from the centre [m].
    pub fn at(&self, arm: Vector) -> Vector {
        self.velocity + self.spin.cross(arm)
    }
}
