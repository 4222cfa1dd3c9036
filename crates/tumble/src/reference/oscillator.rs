//! One mass on a spring: x'' + c x' + w² x = 0.                        (oscillator.1)

use crate::math::functions::{cos, cosh, exp, sin, sinh};
use std::f64::consts::PI;

/// An oscillator from its state at t = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oscillator {
    /// Angular frequency w [rad/s], > 0.
    pub frequency: f64,
    /// Damping rate c [1/s], >= 0.
    pub damping: f64,
    /// Position at t = 0 [m].
    pub x0: f64,
    /// Velocity at t = 0 [m/s].
    pub v0: f64,
}

impl Oscillator {
    /// From a mass [kg] on a spring [N/m] with a damper [N s/m].
    pub fn new(mass: f64, stiffness: f64, damping: f64, x0: f64, v0: f64) -> Self {
        Self { frequency: (stiffness / mass).sqrt(), damping: damping / mass, x0, v0 }
    }

    /// Damping ratio zeta: oscillates below 1, creeps above.
    pub fn ratio(&self) -> f64 {
        self.damping / (2.0 * self.frequency)
    }

    /// Angular frequency of the damped oscillation [rad/s]; 0 where it creeps.
    pub fn damped_frequency(&self) -> f64 {
        (self.frequency * self.frequency - self.damping * self.damping / 4.0).max(0.0).sqrt()
    }

    /// ln of one maximum over the next one of the same sign; infinite where it creeps.            (oscillator.7)
    pub fn decrement(&self) -> f64 {
        PI * self.damping / self.damped_frequency()
    }

    /// Position [m] and velocity [m/s] at t [s].         (oscillator.4, oscillator.5, oscillator.6)
    pub fn at(&self, t: f64) -> (f64, f64) {
        let (x0, half) = (self.x0, self.damping / 2.0);
        let slope = self.v0 + half * x0;
        // D = w² - c²/4 is the square of the damped frequency, or minus that of the rate of creep.
        let d = self.frequency * self.frequency - half * half;
        let root = d.abs().sqrt();
        // x e^(c t/2) = x0 C + slope S  with  C' = -D S,  S' = C.
        let (c, s) = if d > 0.0 {
            (cos(root * t), sin(root * t) / root)
        } else if d < 0.0 {
            (cosh(root * t), sinh(root * t) / root)
        } else {
            (1.0, t)
        };
        let decay = exp(-half * t);
        (decay * (x0 * c + slope * s), decay * (slope * c - x0 * d * s - half * (x0 * c + slope * s)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table of docs/theory/oscillator.md, and x'' + c x' + w² x = 0 by differences.
    #[test]
    fn under_critical_and_over() {
        for (c, table) in [
            (2.0, [0.568_971_89, 0.098_550_67, -0.336_851_68]),
            (20.0, [0.735_758_88, 0.040_427_68, 4.993_992_3e-4]),
            (40.0, [0.822_263_42, 0.282_171_17, 0.073_904_07]),
        ] {
            let exact = Oscillator::new(1.0, 100.0, c, 1.0, 0.0);
            for (t, x) in [0.1, 0.5, 1.0].into_iter().zip(table) {
                assert!((exact.at(t).0 - x).abs() < 5e-9, "c = {c}, t = {t}: {}", exact.at(t).0);
            }
            let moving = Oscillator { v0: -3.0, ..exact };
            assert_eq!(moving.at(0.0), (1.0, -3.0));
            let (h, t) = (1e-4, 0.3);
            let [(a, _), (x, v), (b, _)] = [t - h, t, t + h].map(|t| moving.at(t));
            // Second differences err by h² x''''/12 = 1e-8 1e4/12 and by round-off 1e-16/h² = 1e-8.
            assert!(((b - a) / (2.0 * h) - v).abs() < 1e-5);
            assert!(((a - 2.0 * x + b) / (h * h) + c * v + 100.0 * x).abs() < 1e-3);
        }
    }

    #[test]
    fn successive_maxima_shrink_by_the_decrement() {
        let exact = Oscillator::new(2.0, 50.0, 1.5, 1.0, 0.0);
        let period = 2.0 * PI / exact.damped_frequency();
        assert!(((exact.at(0.0).0 / exact.at(period).0).ln() - exact.decrement()).abs() < 1e-12);
        let zeta = exact.ratio();
        assert!((exact.decrement() - 2.0 * PI * zeta / (1.0 - zeta * zeta).sqrt()).abs() < 1e-12);
    }
}
