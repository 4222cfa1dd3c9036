//! Arithmetic on whole columns of rows, number by number, on wide registers. Every width gives the same bits.

use super::simd::{Kernel, Width, ask_behind, count, dispatch, packs};
use super::{Lane, Real, Row};

/// Update of one number `out` of a row from one number of each input row.
pub trait Each {
    /// `of_row` belongs to the whole row, `a` and `out` stand at the same place in it, and so does `constant`.
    fn at<L: Lane>(&self, of_row: L, a: L, constant: L, out: L) -> L;
}

struct All<'a, F, const BY_LAST: bool> {
    out: &'a mut [Row],
    /// None if the last numbers of `a` belong to the whole rows.
    of_rows: &'a [Real],
    a: &'a [Row],
    constant: Row,
    each: F,
}

impl<F: Each, const BY_LAST: bool> Kernel for All<'_, F, BY_LAST> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        let (out, a) = (self.out.as_flattened_mut(), self.a.as_flattened());
        let mut pattern = [0.0; 16];
        for i in 0..16 {
            pattern[i] = self.constant[i % 4];
        }
        packs!(W, w, (0..out.len()), |e| {
            ask_behind(self.a, e / 4, count(w).div_ceil(4));
            let here = &mut out[e..];
            let of_row = if BY_LAST {
                let mut last = [0.0; 4];
                for i in 0..count(w).div_ceil(4) {
                    last[i] = self.a[e / 4 + i][3];
                }
                w.spread(&last, e % 4)
            } else {
                w.spread(self.of_rows, e)
            };
            let new = self.each.at(of_row, w.load(&a[e..]), w.load(&pattern[e % 4..]), w.load(here));
            w.store(new, here);
        });
    }
}

/// Sets every number of `out` to `each` of it; the columns have the same length.
#[inline]
pub fn each(out: &mut [Row], of_rows: &[Real], a: &[Row], constant: Row, each: impl Each) {
    assert!(of_rows.len() == out.len() && a.len() == out.len());
    dispatch(All::<_, false> { out, of_rows, a, constant, each });
}

/// The same where the last number of each row of `a` is the one that belongs to the whole row.
#[inline]
pub fn each_by_last(out: &mut [Row], a: &[Row], constant: Row, each: impl Each) {
    assert!(a.len() == out.len());
    dispatch(All::<_, true> { out, of_rows: &[], a, constant, each });
}

/// y + c x, or x + c y.
struct Axpy<'a, const SCALES_Y: bool> {
    y: &'a mut [Row],
    c: Real,
    x: &'a [Row],
}

impl<const SCALES_Y: bool> Kernel for Axpy<'_, SCALES_Y> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        let (y, x) = (self.y.as_flattened_mut(), self.x.as_flattened());
        packs!(W, w, (0..y.len()), |e| {
            let here = &mut y[e..];
            let (y, x) = (w.load(here), w.load(&x[e..]));
            let new = if SCALES_Y { x + w.splat(self.c) * y } else { y + w.splat(self.c) * x };
            w.store(new, here);
        });
    }
}

/// y += c x.
#[inline]
pub fn axpy(y: &mut [Row], c: Real, x: &[Row]) {
    assert_eq!(x.len(), y.len());
    dispatch(Axpy::<false> { y, c, x });
}

/// y = x + c y.
#[inline]
pub fn xpby(y: &mut [Row], c: Real, x: &[Row]) {
    assert_eq!(x.len(), y.len());
    dispatch(Axpy::<true> { y, c, x });
}

/// Numbers whose products are added in the engine's scalar before they join sums in double precision: converting each
/// would cost more than the products.
const BLOCK: usize = 16 * 16;

struct Dot<'a> {
    a: &'a [Row],
    b: &'a [Row],
}

impl Kernel for Dot<'_> {
    type Output = f64;
    /// Sixteen sums side by side, whatever the width.
    #[inline(always)]
    fn run<W: Width>(self, w: W) -> f64 {
        let (a, b) = (self.a.as_flattened(), self.b.as_flattened());
        let mut total = [0.0_f64; 16];
        let zero = w.splat(0.0);
        for (a, b) in a.chunks(BLOCK).zip(b.chunks(BLOCK)) {
            let mut part = [0.0 as Real; 16];
            let mut sums = [zero; 16];
            let full = a.len() / 16 * 16;
            let mut at = 0;
            while at < full {
                for k in 0..16 / W::N {
                    let i = at + k * W::N;
                    sums[k] = sums[k] + w.load(&a[i..]) * w.load(&b[i..]);
                }
                at += 16;
            }
            for k in 0..16 / W::N {
                w.store(sums[k], &mut part[k * W::N..]);
            }
            for i in full..a.len() {
                part[i - full] += a[i] * b[i];
            }
            for i in 0..16 {
                total[i] += f64::from(part[i]);
            }
        }
        let mut sum = 0.0;
        for part in total {
            sum += part;
        }
        sum
    }
}

/// The sum of the products of all numbers.
#[inline]
pub fn dot(a: &[Row], b: &[Row]) -> f64 {
    assert_eq!(a.len(), b.len());
    dispatch(Dot { a, b })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::simd::{Level, dispatch_at};

    struct Sum3;

    impl Each for Sum3 {
        fn at<L: Lane>(&self, of_row: L, a: L, constant: L, out: L) -> L {
            of_row * a + constant * out.like(0.1) + out
        }
    }

    #[test]
    fn every_width_gives_the_same_bits() {
        // 77 rows: no multiple of any register, more than one block of products.
        let column =
            |seed: usize| -> Vec<Row> { (0..77).map(|i| std::array::from_fn(|c| ((i * 4 + c) * seed % 97) as Real / 7.3 - 5.0)).collect() };
        let (a, b, of_rows) = (column(31), column(53), column(11).iter().map(|r| r[0]).collect::<Vec<Real>>());
        let constant = [1.0, 2.0, 3.0, 4.0];
        for level in Level::available() {
            let mut out = b.clone();
            dispatch_at(level, All::<_, false> { out: &mut out, of_rows: &of_rows, a: &a, constant, each: Sum3 });
            let mut last = b.clone();
            dispatch_at(level, All::<_, true> { out: &mut last, of_rows: &[], a: &a, constant, each: Sum3 });
            let mut y = b.clone();
            dispatch_at(level, Axpy::<false> { y: &mut y, c: 0.37, x: &a });
            let mut z = b.clone();
            dispatch_at(level, Axpy::<true> { y: &mut z, c: 0.37, x: &a });
            for i in 0..77 {
                for c in 0..4 {
                    assert_eq!(out[i][c], of_rows[i] * a[i][c] + constant[c] * (0.1 as Real) + b[i][c], "{level:?}");
                    assert_eq!(last[i][c], a[i][3] * a[i][c] + constant[c] * (0.1 as Real) + b[i][c], "{level:?}");
                    assert_eq!(y[i][c], b[i][c] + 0.37 * a[i][c], "{level:?}");
                    assert_eq!(z[i][c], a[i][c] + 0.37 * b[i][c], "{level:?}");
                }
            }
            let dot = dispatch_at(level, Dot { a: &a, b: &b });
            assert_eq!(dot.to_bits(), dispatch_at(Level::Scalar, Dot { a: &a, b: &b }).to_bits(), "{level:?}");
            let exact: f64 = (0..77 * 4).map(|k| f64::from(a[k / 4][k % 4]) * f64::from(b[k / 4][k % 4])).sum();
            assert!((dot - exact).abs() < 1e-4 * exact.abs(), "{dot} {exact}");
        }
    }
}
