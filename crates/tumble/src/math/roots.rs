//! Inverse roots and their cubes for sums over pairs, where they are most of the work.
//!
//! Portable: from half the bits of x, w = z (c - x z²) is in proportion to 1/sqrt(x) to 7.8e-4 (in double precision a
//! second such step follows), and a polynomial of t = x w², nearly constant, takes it or its cube to round-off. All
//! constant factors are left to the end of the sum.                     (orbits.15)
//! Source: [moroz2018].   Differs: no factor but one in each step, and the cube straight from the second step.
//! Native: an estimate by the machine, fused operations.

use super::Real;
use super::simd::Width;

/// c of the step.
const C: f64 = 1.436_355_569_136_327;
/// The middle of t after it.
const T1: f64 = 0.438_338_300_6;
/// The middle of t after the last step; the second has c = 3 T1.
#[cfg(not(feature = "double"))]
const T: f64 = T1;
#[cfg(feature = "double")]
const T: f64 = 4.0 * T1 * T1 * T1 * (1.0 - 0.9e-6);

/// a, b, c of the polynomial of the native cube in double precision.
const FACTORS: [f64; 3] = [0.752_863_051_671_532_6, 0.052_139_911_117_565_475, 0.604_487_290_187_232_5];

/// Initial estimate of 1/sqrt(x).
#[inline(always)]
pub fn first_guess<W: Width, const NATIVE: bool>(w: W, x: W::L) -> W::L {
    if NATIVE { w.estimate(x) } else { w.guess(x) }
}

/// w, in proportion to 1/sqrt(x), and t = x w².
#[inline(always)]
fn steps<W: Width, const NATIVE: bool>(w: W, x: W::L, guess: W::L) -> (W::L, W::L) {
    let step = |y: W::L, c: f64| {
        if NATIVE { y * w.fused(-(x * y), y, w.splat(c as Real)) } else { y * (w.splat(c as Real) - x * (y * y)) }
    };
    let y = step(guess, C);
    #[cfg(feature = "double")]
    let y = step(y, 3.0 * T1);
    (y, x * (y * y))
}

/// (t - a)² + b.
#[inline(always)]
fn parabola<W: Width, const NATIVE: bool>(w: W, t: W::L, a: f64, b: f64) -> W::L {
    let u = t - w.splat(a as Real);
    let b = w.splat(b as Real);
    if NATIVE { w.fused(u, u, b) } else { u * u + b }
}

/// x^(-3/2) for x > 0, in units of [`cube_unit`], times a weight, from the first guess; `NATIVE` may differ in its last bits from
/// machine to machine.
#[inline(always)]
pub fn inverse_cube<W: Width, const NATIVE: bool>(w: W, x: W::L, guess: W::L, weight: W::L) -> W::L {
    if NATIVE && W::ESTIMATES {
        let y = guess;
        let y_sq = y * y;
        return if cfg!(feature = "double") {
            // (1 - e)^(-3/2) = 1 + 3/2 e + 15/8 e² + 35/16 e³ + 315/128 e⁴, the last by its best parabola over |e| < 2^-13, as
            // 35/16 (e + a)((e + b)² + c): one multiplication less than in powers of e.
            let first = w.fused(-x, y_sq, w.splat((1.0 + FACTORS[0]) as Real));
            let u = first + w.splat((FACTORS[1] - FACTORS[0]) as Real);
            (((weight * y) * y_sq) * first) * w.fused(u, u, w.splat(FACTORS[2] as Real))
        } else {
            // 1 + 3/2 e = 3/2 (5/3 - x y²): 2.8e-8.
            ((weight * y) * y_sq) * w.fused(-x, y_sq, w.splat((5.0 / 3.0) as Real))
        };
    }
    let (y, t) = steps::<W, NATIVE>(w, x, guess);
    let p = parabola::<W, NATIVE>(w, t, 1.4 * T, T * T * (7.0 / 3.0 - 1.96));
    ((weight * y) * (y * y)) * p
}

/// Factor on a sum over [`inverse_cube`].
pub fn cube_unit<W: Width, const NATIVE: bool>(_w: W) -> f64 {
    if NATIVE && W::ESTIMATES {
        return if cfg!(feature = "double") { 35.0 / 16.0 } else { 1.5 };
    }
    15.0 / 8.0 / (T * T * T * T.sqrt())
}

/// x^(-1/2) for x > 0, in units of [`root_unit`]; `NATIVE` as above.
#[inline(always)]
pub fn inverse_root<W: Width, const NATIVE: bool>(w: W, x: W::L) -> W::L {
    if NATIVE && W::ESTIMATES {
        // (1 - e)^(-1/2) = 1 + 1/2 e + 3/8 e² + 5/16 e³, in single precision to the first power.
        let y = w.estimate(x);
        let e = w.fused(-x, y * y, w.splat(1.0));
        let p = if cfg!(feature = "double") { w.fused(e, w.fused(e, w.splat(0.3125), w.splat(0.375)), w.splat(0.5)) } else { w.splat(0.5) };
        return w.fused(y * e, p, y);
    }
    let (y, t) = steps::<W, NATIVE>(w, x, w.guess(x));
    y * parabola::<W, NATIVE>(w, t, 5.0 / 3.0 * T, T * T * (5.0 - 25.0 / 9.0))
}

/// Factor on a sum over [`inverse_root`].
pub fn root_unit<W: Width, const NATIVE: bool>(_w: W) -> f64 {
    if NATIVE && W::ESTIMATES { 1.0 } else { 3.0 / 8.0 / (T * T * T.sqrt()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::simd::{Kernel, dispatch};

    struct Worst<const NATIVE: bool>;

    impl<const NATIVE: bool> Kernel for Worst<NATIVE> {
        type Output = (f64, f64);
        fn run<W: Width>(self, w: W) -> (f64, f64) {
            let (mut cube, mut root) = (0.0_f64, 0.0_f64);
            let mut all = [0.0; 16];
            for i in 0..40_000 {
                // Every exponent between 1e-22 and 1e22, and mantissas without a pattern.
                let x = (10.0_f64.powf(-22.0 + 0.0011 * f64::from(i)) * 1.3) as Real;
                let exact = f64::from(x);
                w.store(inverse_cube::<W, NATIVE>(w, w.splat(x), first_guess::<W, NATIVE>(w, w.splat(x)), w.splat(1.0)), &mut all);
                cube = cube.max((f64::from(all[0]) * cube_unit::<W, NATIVE>(w) * (exact * exact.sqrt()) - 1.0).abs());
                w.store(inverse_root::<W, NATIVE>(w, w.splat(x)), &mut all);
                root = root.max((f64::from(all[0]) * root_unit::<W, NATIVE>(w) * exact.sqrt() - 1.0).abs());
            }
            (cube, root)
        }
    }

    #[test]
    fn roots_and_cubes_are_right_to_a_few_units_in_the_last_place() {
        let unit = if cfg!(feature = "double") { f64::EPSILON } else { f64::from(f32::EPSILON) };
        for (name, (cube, root)) in [("portable", dispatch(Worst::<false>)), ("native", dispatch(Worst::<true>))] {
            println!("{name}: cube {:.2}, root {:.2} units", cube / unit, root / unit);
            assert!(cube > 0.1 * unit && cube < 4.0 * unit, "{name}: {cube:e}");
            assert!(root > 0.1 * unit && root < 3.0 * unit, "{name}: {root:e}");
        }
    }
}
