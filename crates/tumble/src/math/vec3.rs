//! Vectors in space over any lane type.

use super::Lane;
use std::ops::{Add, Mul, Neg, Sub};

/// x, y, z.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Vec3<L> {
    /// First component.
    pub x: L,
    /// Second component.
    pub y: L,
    /// Third component.
    pub z: L,
}

/// Shorthand for `Vec3 { x, y, z }`.
#[inline(always)]
pub const fn vec3<L>(x: L, y: L, z: L) -> Vec3<L> {
    Vec3 { x, y, z }
}

impl<L> From<[L; 3]> for Vec3<L> {
    #[inline(always)]
    fn from([x, y, z]: [L; 3]) -> Self {
        Self { x, y, z }
    }
}

impl<L> From<Vec3<L>> for [L; 3] {
    #[inline(always)]
    fn from(v: Vec3<L>) -> Self {
        [v.x, v.y, v.z]
    }
}

impl<L: Lane> Add for Vec3<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        vec3(self.x + b.x, self.y + b.y, self.z + b.z)
    }
}

impl<L: Lane> Sub for Vec3<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        vec3(self.x - b.x, self.y - b.y, self.z - b.z)
    }
}

impl<L: Lane> Mul<L> for Vec3<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, c: L) -> Self {
        vec3(self.x * c, self.y * c, self.z * c)
    }
}

impl<L: Lane> Neg for Vec3<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        vec3(-self.x, -self.y, -self.z)
    }
}

impl Vec3<f64> {
    /// A vector of the same direction whose square is a number: itself, unless it is extremely long or short.
    pub fn tamed(self) -> Self {
        let largest = self.x.abs().max(self.y.abs()).max(self.z.abs());
        if (1e-150..1e150).contains(&largest) || largest == 0.0 { self } else { vec3(self.x / largest, self.y / largest, self.z / largest) }
    }
}

impl<L: Lane> Vec3<L> {
    /// Inner product.
    #[inline(always)]
    pub fn dot(self, b: Self) -> L {
        self.x * b.x + self.y * b.y + self.z * b.z
    }

    /// Outer (vector) product.
    #[inline(always)]
    pub fn cross(self, b: Self) -> Self {
        vec3(self.y * b.z - self.z * b.y, self.z * b.x - self.x * b.z, self.x * b.y - self.y * b.x)
    }

    /// |v|².
    #[inline(always)]
    pub fn norm_sq(self) -> L {
        self.dot(self)
    }

    /// |v|.
    #[inline(always)]
    pub fn norm(self) -> L {
        self.norm_sq().sqrt()
    }

    /// v / |v|, or zero for the zero vector.
    #[inline(always)]
    pub fn normalized(self) -> Self {
        let n = self.norm();
        self * n.positive(n.like(1.0) / n, n.zero())
    }
}
