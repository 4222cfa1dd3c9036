//! How open faces are, as the matrix stores them.

use super::block::LANES;
use crate::math::Real;
use crate::math::simd::Width;

/// The weight of a face: bytes for cut cells, a quarter of the memory and enough for areas; numbers where densities differ or
/// a free surface cuts the way between two centres.
pub trait Weight: Copy + Default + PartialEq + Send + Sync + std::fmt::Debug + 'static {
    /// A wall.
    const CLOSED: Self;
    /// A whole face.
    const OPEN: Self;
    /// Whether it may be the weight of a face.
    fn valid(self) -> bool;
    /// Its value: 1 is open.
    fn value(self) -> Real;
    /// Twice the weight: the way to the side of a box is half as long as that to the next centre.
    fn doubled(self) -> Self;
    /// Loads W::N of a block's weights from number `i` on.
    fn load<W: Width>(w: W, from: &[Self; LANES], i: usize) -> W::L;
}

/// 1/OPEN: 127 and 254 times it are exactly 1 and 2 in both precisions.
const PART: Real = 1.0 / 127.0;

impl Weight for u8 {
    const CLOSED: Self = 0;
    const OPEN: Self = 127;
    fn valid(self) -> bool {
        self <= Self::OPEN
    }
    #[inline(always)]
    fn value(self) -> Real {
        Real::from(self) * PART
    }
    fn doubled(self) -> Self {
        2 * self
    }
    #[inline(always)]
    fn load<W: Width>(w: W, from: &[Self; LANES], i: usize) -> W::L {
        let mut numbers = [0.0; LANES];
        for lane in 0..W::N {
            numbers[lane] = Real::from(from[i + lane]);
        }
        w.load(&numbers) * w.splat(PART)
    }
}

impl Weight for Real {
    const CLOSED: Self = 0.0;
    const OPEN: Self = 1.0;
    fn valid(self) -> bool {
        self.is_finite() && self >= 0.0
    }
    #[inline(always)]
    fn value(self) -> Real {
        self
    }
    fn doubled(self) -> Self {
        2.0 * self
    }
    #[inline(always)]
    fn load<W: Width>(w: W, from: &[Self; LANES], i: usize) -> W::L {
        w.load(&from[i..])
    }
}

/// The byte of an open fraction, to the nearest 1/127.
pub fn byte(open: f64) -> u8 {
    // Not `round`, a call on machines without the instruction.
    (open.clamp(0.0, 1.0) * 127.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_faces_weigh_one_exactly() {
        assert_eq!(u8::OPEN.value(), 1.0);
        assert_eq!(u8::OPEN.doubled().value(), 2.0);
        assert_eq!((byte(0.5), byte(1.2), byte(-1.0), byte(0.003)), (64, 127, 0, 0));
    }
}
