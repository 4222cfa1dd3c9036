//! Frequencies of strings, of beads on a string, and of a chain that hangs from one end.

use crate::math::bisect;
use crate::math::functions::{cos, sin};
use std::f64::consts::PI;

/// A string between two fixed ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TautString {
    /// Length as it is stretched [m].
    pub length: f64,
    /// Tension [N].
    pub tension: f64,
    /// Mass per stretched length [kg/m].
    pub density: f64,
}

impl TautString {
    /// Frequency of mode n = 1, 2, ... [Hz].                            (catenary.6)
    pub fn frequency(&self, n: u32) -> f64 {
        f64::from(n) / (2.0 * self.length) * (self.tension / self.density).sqrt()
    }

    /// The string as `n` straight pieces with the mass in beads between them.
    pub fn beads(&self, pieces: u32) -> Beads {
        let spacing = self.length / f64::from(pieces);
        Beads { pieces, stiffness: self.tension / spacing, mass: self.density * spacing }
    }
}

/// A row of equal beads between two fixed ends, coupled to their neighbours.
///
/// Sideways on a string under the tension T with spacing l the stiffness is T/l, exactly in the limit of small motion;
/// along a chain of springs it is that of the springs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beads {
    /// Count of pieces; there is one bead less.
    pub pieces: u32,
    /// Stiffness between neighbours [N/m].
    pub stiffness: f64,
    /// Mass of a bead [kg].
    pub mass: f64,
}

impl Beads {
    /// Frequency of mode n = 1 .. pieces - 1 [Hz].                      (oscillator.8)
    pub fn frequency(&self, n: u32) -> f64 {
        2.0 * (self.stiffness / self.mass).sqrt() * sin(PI * f64::from(n) / (2.0 * f64::from(self.pieces))) / (2.0 * PI)
    }

    /// Displacement of bead i = 0 .. pieces in mode n, fixed ends included.
    pub fn shape(&self, n: u32, i: u32) -> f64 {
        sin(PI * f64::from(n) * f64::from(i) / f64::from(self.pieces))
    }
}

/// A rope that hangs from one end and swings sideways a little.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HangingChain {
    /// Length [m].
    pub length: f64,
    /// Gravity [m/s²].
    pub gravity: f64,
}

impl HangingChain {
    /// Frequency of mode n = 1, 2, ... [Hz]: half a zero of Bessel's J0 times sqrt(g/L).            (catenary.8)
    pub fn frequency(&self, n: u32) -> f64 {
        bessel_zero(n) / 2.0 * (self.gravity / self.length).sqrt() / (2.0 * PI)
    }

    /// Displacement in mode n at the height s [m] above the free end, 1 at the end: J0(j sqrt(s/L)).   (catenary.7)
    pub fn shape(&self, n: u32, s: f64) -> f64 {
        bessel(bessel_zero(n) * (s / self.length).sqrt())
    }
}

/// J0 by its integral, (1/pi) int_0^pi cos(x sin t) dt; the midpoint rule converges faster than any power.
fn bessel(x: f64) -> f64 {
    let n = 40 + x.abs() as u32;
    (0..n).map(|k| cos(x * sin(PI * (f64::from(k) + 0.5) / f64::from(n)))).sum::<f64>() / f64::from(n)
}

/// The n-th positive zero of J0, which lies between (n - 1/2) pi and n pi.
fn bessel_zero(n: u32) -> f64 {
    let (low, high) = ((f64::from(n) - 0.5) * PI, f64::from(n) * PI);
    let sign = bessel(low);
    let (low, high) = bisect((low, high), 60, |middle| bessel(middle) * sign > 0.0);
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_figures() {
        // A guitar string, and a chain of ten masses (../shared/validation, 2.1 and 1.1).
        let string = TautString { length: 0.65, tension: 71.0, density: 4.01e-4 };
        assert!((string.frequency(1) - 323.678).abs() < 1e-3);
        let chain = Beads { pieces: 11, stiffness: 1.0, mass: 1.0 };
        for (n, w) in [(1, 0.284_629_68), (2, 0.563_465_11), (10, 1.979_642_88)] {
            assert!((2.0 * PI * chain.frequency(n) - w).abs() < 5e-9);
        }
        for (n, zero) in [(1, 2.404_826), (2, 5.520_078), (3, 8.653_728)] {
            assert!((bessel_zero(n) - zero).abs() < 5e-7);
        }
    }

    #[test]
    fn beads_become_the_string() {
        let string = TautString { length: 2.0, tension: 50.0, density: 0.1 };
        // sin(x)/x = 1 - x²/6 with x = n pi/(2 pieces).
        let defect = |pieces| 1.0 - string.beads(pieces).frequency(3) / string.frequency(3);
        let x = 3.0 * PI / 200.0;
        assert!((defect(100) / (x * x / 6.0) - 1.0).abs() < 1e-3);
        assert!((defect(50) / defect(100) - 4.0).abs() < 0.01);
    }

    /// g (s y')' + w² y = 0 by differences, y = 0 at the support and 1 at the free end.
    #[test]
    fn the_mode_of_the_hanging_chain_obeys_its_equation() {
        let chain = HangingChain { length: 1.5, gravity: 9.8 };
        for n in [1, 2] {
            let y = |s| chain.shape(n, s);
            assert!(y(1.5).abs() < 1e-12 && (y(0.0) - 1.0).abs() < 1e-15);
            let w = 2.0 * PI * chain.frequency(n);
            let (s, h) = (0.6, 1e-3);
            let slope = |s: f64| s * (y(s + h / 2.0) - y(s - h / 2.0)) / h;
            let force = 9.8 * (slope(s + h / 2.0) - slope(s - h / 2.0)) / h;
            assert!((force + w * w * y(s)).abs() < 1e-4 * w * w, "{force} {}", w * w * y(s));
        }
    }
}
