//! Dual numbers: a value and its derivative along one direction. Running an element's own functions on
//! them gives J v and the exact Hessian product without a second definition.

use super::{Lane, Quat, Vec3};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// re + slope e, with e² = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dual<L> {
    /// The value.
    pub re: L,
    /// The derivative.
    pub slope: L,
}

impl<L: Lane> Add for Dual<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self { re: self.re + b.re, slope: self.slope + b.slope }
    }
}

impl<L: Lane> Sub for Dual<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self { re: self.re - b.re, slope: self.slope - b.slope }
    }
}

impl<L: Lane> Mul for Dual<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        Self { re: self.re * b.re, slope: self.slope * b.re + self.re * b.slope }
    }
}

impl<L: Lane> Div for Dual<L> {
    type Output = Self;
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        let q = self.re / b.re;
        Self { re: q, slope: (self.slope - q * b.slope) / b.re }
    }
}

impl<L: Lane> Neg for Dual<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { re: -self.re, slope: -self.slope }
    }
}

impl<L: Lane> Lane for Dual<L> {
    #[inline(always)]
    fn like(self, c: f64) -> Self {
        Self { re: self.re.like(c), slope: self.re.zero() }
    }
    /// The slope at 0 is taken as 0.
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.re.sqrt();
        let slope = self.slope / (root + root);
        Self { re: root, slope: root.positive(slope, root.zero()) }
    }
    #[inline(always)]
    fn rsqrt(self) -> Self {
        let y = self.re.rsqrt();
        Self { re: y, slope: -(self.slope * y * y * y) * y.like(0.5) }
    }
    #[inline(always)]
    fn positive(self, then: Self, other: Self) -> Self {
        Self { re: self.re.positive(then.re, other.re), slope: self.re.positive(then.slope, other.slope) }
    }
    #[inline(always)]
    fn any_positive(self) -> bool {
        self.re.any_positive()
    }
}

impl<L: Lane> Dual<L> {
    /// A constant.
    #[inline(always)]
    pub fn constant(re: L) -> Self {
        Self { re, slope: re.zero() }
    }
}

impl<L: Lane> Vec3<Dual<L>> {
    /// x + e v.
    #[inline(always)]
    pub fn lift(x: Vec3<L>, v: Vec3<L>) -> Self {
        Vec3 { x: Dual { re: x.x, slope: v.x }, y: Dual { re: x.y, slope: v.y }, z: Dual { re: x.z, slope: v.z } }
    }

    /// The derivative.
    #[inline(always)]
    pub fn slope(self) -> Vec3<L> {
        Vec3 { x: self.x.slope, y: self.y.slope, z: self.z.slope }
    }
}

impl<L: Lane> Quat<Dual<L>> {
    /// q + e r.
    #[inline(always)]
    pub fn lift(q: Quat<L>, r: Quat<L>) -> Self {
        Quat { v: Vec3::lift(q.v, r.v), w: Dual { re: q.w, slope: r.w } }
    }

    /// The derivative.
    #[inline(always)]
    pub fn slope(self) -> Quat<L> {
        Quat { v: self.v.slope(), w: self.w.slope }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_calculus() {
        let x = Dual { re: 0.7, slope: 1.0 };
        let f = (x * x + x.like(3.0)) / (x.sqrt() - x.like(2.0) * -x);
        let value = |x: f64| (x * x + 3.0) / (x.sqrt() + 2.0 * x);
        let h = 1e-6;
        assert!((f.re - value(0.7)).abs() < 1e-15);
        assert!((f.slope - (value(0.7 + h) - value(0.7 - h)) / (2.0 * h)).abs() < 1e-8, "{}", f.slope);
        assert_eq!(Dual { re: 0.0, slope: 1.0 }.sqrt().slope, 0.0);
    }
}
