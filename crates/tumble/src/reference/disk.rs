//! A thin disk of exponential density under its own gravitation: [freeman1970].

use crate::math::bisect;
use crate::math::functions::{cosh, exp};
use std::f64::consts::PI;

/// A disk of no thickness whose surface density is M/(2 pi R_d²) exp(-R/R_d).            (orbits.17)
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disk {
    /// G M [m³/s²].
    pub gm: f64,
    /// R_d [m].
    pub length: f64,
}

impl Disk {
    /// G times the surface density [m/s²].
    pub fn surface(&self, r: f64) -> f64 {
        self.gm / (2.0 * PI * self.length * self.length) * exp(-r / self.length)
    }

    /// The part of the mass within r [m].
    pub fn enclosed(&self, r: f64) -> f64 {
        let x = r / self.length;
        1.0 - (1.0 + x) * exp(-x)
    }

    /// The radius [m] that encloses a part of the mass, below 1.
    pub fn radius(&self, part: f64) -> f64 {
        bisect((0.0, 50.0 * self.length), 60, |middle| self.enclosed(middle) < part).0
    }

    /// The square of the speed on a circle [m²/s²].                      (orbits.18)
    pub fn speed_sq(&self, r: f64) -> f64 {
        let y = r / (2.0 * self.length);
        if y == 0.0 {
            return 0.0;
        }
        if y > 300.0 {
            return self.gm / r;
        }
        let ([i0, i1], [k0, k1]) = bessel(y);
        2.0 * self.gm / self.length * y * y * (i0 * k0 - i1 * k1)
    }
}

/// The modified Bessel functions I0, I1 and K0, K1 of x, 0 < x < 700: the first two by their power series, whose terms are
/// positive, the others by the trapezoidal rule on ∫ exp(-x cosh t) cosh(n t) dt, which converges faster than any power.
pub fn bessel(x: f64) -> ([f64; 2], [f64; 2]) {
    let q = x * x / 4.0;
    let (mut term, mut i) = (1.0, [0.0; 2]);
    let mut k = 0.0;
    while term > 1e-18 * i[0] {
        i[0] += term;
        i[1] += term / (k + 1.0);
        k += 1.0;
        term *= q / (k * k);
    }
    i[1] *= x / 2.0;
    // Its error is exp(-2 pi²/(x h²)) where the integrand is a narrow bell, exp(-pi²/h) else.
    let h = (0.7 / x.sqrt()).min(0.125);
    let mut sums = [0.5 * exp(-x); 2];
    let mut t = h;
    loop {
        let c = cosh(t);
        let e = exp(-x * c);
        sums[0] += e;
        sums[1] += e * c;
        if e * c < 1e-18 * sums[1] {
            break;
        }
        t += h;
    }
    (i, sums.map(|s| s * h))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bessel_functions_have_their_tabulated_values() {
        // [abramowitz1964], tables 9.8 and 9.11.
        let known = [
            (0.1, [1.002_501_562_934_095_6, 0.050_062_526_047_092_7], [2.427_069_024_702_017, 9.853_844_780_870_606]),
            (1.0, [1.266_065_877_752_008_4, 0.565_159_103_992_485], [0.421_024_438_240_708_34, 0.601_907_230_197_234_6]),
            (5.0, [27.239_871_823_604_442, 24.335_642_142_450_53], [0.003_691_098_334_042_594, 0.004_044_613_445_452_164]),
        ];
        for (x, i, k) in known {
            let (a, b) = bessel(x);
            for n in 0..2 {
                assert!((a[n] / i[n] - 1.0).abs() < 2e-15 && (b[n] / k[n] - 1.0).abs() < 2e-14, "{x}: {a:?} {b:?}");
            }
        }
        for x in [0.01, 0.7, 3.0, 40.0, 300.0] {
            let (i, k) = bessel(x);
            // Wronski's determinant.
            assert!(((i[0] * k[1] + i[1] * k[0]) * x - 1.0).abs() < 3e-14);
        }
    }

    /// Freeman's curve, from the table of ../shared/validation.
    #[test]
    fn the_curve_of_a_disk_is_freemans() {
        let disk = Disk { gm: 1.0, length: 1.0 };
        let known = [
            (0.5, 0.369736),
            (1.0, 0.527218),
            (1.5, 0.597922),
            (2.0, 0.621082),
            (2.15, 0.622130),
            (3.0, 0.599160),
            (4.0, 0.545197),
            (5.0, 0.489275),
            (6.0, 0.440971),
            (8.0, 0.370665),
            (10.0, 0.325329),
        ];
        for (r, speed) in known {
            let v = disk.speed_sq(r).sqrt();
            assert!((v - speed).abs() < 1e-6, "{r}: {v}");
        }
        assert!((disk.enclosed(disk.radius(0.5)) - 0.5).abs() < 1e-12 && (disk.radius(0.5) - 1.678_347).abs() < 1e-6);
    }
}
