//! Number types of kernels: a number, a register of numbers, or either with a derivative.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A lane type. No fused multiply-add and no approximate functions: the same bits on every machine and width.
pub trait Lane: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self> {
    /// The constant `c`, in the shape of `self`.
    fn like(self, c: f64) -> Self;
    /// Square root, correctly rounded.
    fn sqrt(self) -> Self;
    /// 1/sqrt(self) for self > 0, to two units in the last place, with the same bits on every machine. In single precision
    /// it is faster than a root and a division.
    fn rsqrt(self) -> Self;
    /// `then` where self > 0, `other` elsewhere: the only branch by which results may differ.
    fn positive(self, then: Self, other: Self) -> Self;
    /// Whether self > 0 anywhere: to leave out what would add nothing, so that the bits do not depend on the width.
    fn any_positive(self) -> bool;
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

/// Half the bits of a float, taken from this, are the bits of its inverse root to 3.5 %.
pub const RSQRT: u32 = 0x5f37_5a86;

/// Three of Newton's steps from that guess: 1.8e-3, 5e-6, round-off.
#[inline(always)]
pub fn newton_rsqrt<L: Lane>(x: L, guess: L) -> L {
    let (half, y) = (x * x.like(0.5), guess);
    let y = y * (x.like(1.5) - half * y * y);
    let y = y * (x.like(1.5) - half * y * y);
    y * (x.like(1.5) - half * y * y)
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
    fn rsqrt(self) -> Self {
        newton_rsqrt(self, f32::from_bits(RSQRT.wrapping_sub(self.to_bits() >> 1)))
    }
    #[inline(always)]
    fn positive(self, then: Self, other: Self) -> Self {
        if self > 0.0 { then } else { other }
    }
    #[inline(always)]
    fn any_positive(self) -> bool {
        self > 0.0
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
    fn rsqrt(self) -> Self {
        1.0 / f64::sqrt(self)
    }
    #[inline(always)]
    fn positive(self, then: Self, other: Self) -> Self {
        if self > 0.0 { then } else { other }
    }
    #[inline(always)]
    fn any_positive(self) -> bool {
        self > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_roots_are_right_to_two_units_in_the_last_place() {
        let mut worst = 0.0_f64;
        for i in 0..4000 {
            // Every exponent between 1e-30 and 1e30, and mantissas without a pattern.
            let x = (10.0_f64.powf(-30.0 + 0.015 * f64::from(i)) * 1.3) as f32;
            worst = worst.max((f64::from(x.rsqrt()) * f64::from(x).sqrt() - 1.0).abs());
            assert!(((f64::from(x)).rsqrt() * f64::from(x).sqrt() - 1.0).abs() < 4e-16);
        }
        assert!(worst > 1e-9 && worst < 2.0 * 1.2e-7, "{worst:e}");
    }
}
