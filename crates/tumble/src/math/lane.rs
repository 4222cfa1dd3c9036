//! What a kernel computes with: a number, a register of numbers, or either with a derivative.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A lane type. No fused multiply-add and no approximate functions: the same bits on every machine and width.
pub trait Lane: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self> {
    /// The constant `c`, in the shape of `self`.
    fn like(self, c: f64) -> Self;
    /// Square root, correctly rounded.
    fn sqrt(self) -> Self;
    /// `then` where self > 0, `other` elsewhere: the only branch that a kernel may have.
    fn positive(self, then: Self, other: Self) -> Self;
    /// Zero in the shape of `self`.
    #[inline(always)]
    fn zero(self) -> Self {
        self.like(0.0)
    }
    /// The larger of self and 0.
    #[inline(always)]
    fn above_zero(self) -> Self {
        self.positive(self, self.zero())
    }
}

impl Lane for f32 {
    #[inline(always)]
    fn like(self, c: f64) -> Self {
        c as f32
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }
    #[inline(always)]
    fn positive(self, then: Self, other: Self) -> Self {
        if self > 0.0 { then } else { other }
    }
}

impl Lane for f64 {
    #[inline(always)]
    fn like(self, c: f64) -> Self {
        c
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn positive(self, then: Self, other: Self) -> Self {
        if self > 0.0 { then } else { other }
    }
}
