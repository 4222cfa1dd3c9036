//! Quaternions x i + y j + z k + w over any lane type.

use super::{Lane, Vec3};
use std::ops::{Add, Mul, Neg, Sub};

/// A quaternion; of length 1 it is an orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quat<L> {
    /// Vector part.
    pub v: Vec3<L>,
    /// Scalar part.
    pub w: L,
}

impl<L: Lane> Add for Quat<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self { v: self.v + b.v, w: self.w + b.w }
    }
}

impl<L: Lane> Sub for Quat<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self { v: self.v - b.v, w: self.w - b.w }
    }
}

impl<L: Lane> Neg for Quat<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { v: -self.v, w: -self.w }
    }
}

/// The Hamilton product.
impl<L: Lane> Mul for Quat<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        Self { v: b.v * self.w + self.v * b.w + self.v.cross(b.v), w: self.w * b.w - self.v.dot(b.v) }
    }
}

impl<L: Lane> Quat<L> {
    /// The quaternion of a row [x, y, z, w].
    #[inline(always)]
    pub fn from_row([x, y, z, w]: [L; 4]) -> Self {
        Self { v: Vec3 { x, y, z }, w }
    }

    /// The row [x, y, z, w].
    #[inline(always)]
    pub fn row(self) -> [L; 4] {
        [self.v.x, self.v.y, self.v.z, self.w]
    }

    /// A vector as a quaternion without scalar part.
    #[inline(always)]
    pub fn pure(v: Vec3<L>) -> Self {
        Self { v, w: v.x.zero() }
    }

    /// The conjugate: the inverse of a unit quaternion.
    #[inline(always)]
    pub fn conj(self) -> Self {
        Self { v: -self.v, w: self.w }
    }

    /// c q.
    #[inline(always)]
    pub fn scaled(self, c: L) -> Self {
        Self { v: self.v * c, w: self.w * c }
    }

    /// Inner product of the four numbers.
    #[inline(always)]
    pub fn dot(self, b: Self) -> L {
        self.v.dot(b.v) + self.w * b.w
    }

    /// q / |q|.
    #[inline(always)]
    pub fn normalized(self) -> Self {
        let n = self.dot(self).sqrt();
        self.scaled(n.like(1.0) / n)
    }

    /// The third axis of the frame, q e_z q* (for a unit quaternion).
    #[inline(always)]
    pub fn axis_z(self) -> Vec3<L> {
        let Self { v: Vec3 { x, y, z }, w } = self;
        let two = w.like(2.0);
        Vec3 { x: two * (x * z + w * y), y: two * (y * z - w * x), z: w * w - x * x - y * y + z * z }
    }

    /// q v q*: a vector turned by a unit quaternion.
    #[inline(always)]
    pub fn turn(self, v: Vec3<L>) -> Vec3<L> {
        let t = self.v.cross(v) * self.w.like(2.0);
        v + t * self.w + self.v.cross(t)
    }
}
