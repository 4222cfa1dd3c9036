//! The orbit of one mass about a fixed centre.

use crate::geometry::Vector;
use crate::math::functions::{cos, sin};
use std::f64::consts::PI;

/// An ellipse in the plane z = 0, with the centre of attraction at the origin; starts at the pericentre on the positive
/// x-axis and turns counter-clockwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kepler {
    /// Gravitational parameter G M [m³/s²].
    pub gm: f64,
    /// Semi-major axis a [m].
    pub semi_major: f64,
    /// Eccentricity e, 0 to below 1.
    pub eccentricity: f64,
}

impl Kepler {
    /// Period [s].                                                      (orbits.4)
    pub fn period(&self) -> f64 {
        2.0 * PI / self.mean_motion()
    }

    /// Mean angular velocity [rad/s].
    pub fn mean_motion(&self) -> f64 {
        (self.gm / self.semi_major.powi(3)).sqrt()
    }

    /// Energy per mass [m²/s²].                                         (orbits.3)
    pub fn energy(&self) -> f64 {
        -self.gm / (2.0 * self.semi_major)
    }

    /// Angular momentum per mass [m²/s].                                (orbits.3)
    pub fn angular_momentum(&self) -> f64 {
        (self.gm * self.semi_major * (1.0 - self.eccentricity * self.eccentricity)).sqrt()
    }

    /// Eccentric anomaly u at t [s]: u - e sin u = n t.                 (orbits.5)
    pub fn eccentric_anomaly(&self, t: f64) -> f64 {
        let e = self.eccentricity;
        let turns = (t / self.period()).round();
        let mean = self.mean_motion() * t - 2.0 * PI * turns;
        // Newton's method from the far side of the root, where it converges without overshooting.
        let mut u = if mean < 0.0 { -PI } else { PI };
        for _ in 0..60 {
            let step = (u - e * sin(u) - mean) / (1.0 - e * cos(u));
            u -= step;
            if step.abs() <= 1e-16 * (1.0 + u.abs()) {
                break;
            }
        }
        u + 2.0 * PI * turns
    }

    /// Position [m] and velocity [m/s] at t [s].                        (orbits.5)
    pub fn at(&self, t: f64) -> (Vector, Vector) {
        let (a, e) = (self.semi_major, self.eccentricity);
        let b = a * (1.0 - e * e).sqrt();
        let u = self.eccentric_anomaly(t);
        let (s, c) = (sin(u), cos(u));
        let rate = self.mean_motion() / (1.0 - e * c);
        (Vector { x: a * (c - e), y: b * s, z: 0.0 }, Vector { x: -a * s * rate, y: b * c * rate, z: 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_orbit_obeys_its_equation_and_keeps_its_constants() {
        for e in [0.0, 0.5, 0.6, 0.97] {
            let orbit = Kepler { gm: 2.0, semi_major: 1.5, eccentricity: e };
            let (x, v) = orbit.at(0.0);
            assert!((x.x - 1.5 * (1.0 - e)).abs() < 1e-15 && x.y == 0.0);
            assert!((v.y - ((1.0 + e) / (1.0 - e) * 2.0 / 1.5).sqrt()).abs() < 1e-12 * v.y && v.x == 0.0);
            for t in [-4.0, -0.1, 0.3, 1.0, 5.0, 20.0] {
                let (x, v) = orbit.at(t);
                assert!((v.norm_sq() / 2.0 - 2.0 / x.norm() - orbit.energy()).abs() < 1e-12 * v.norm_sq().max(1.0));
                assert!((x.cross(v).z - orbit.angular_momentum()).abs() < 1e-13);
                // Differences err by h² x'''/6; x''' is at most 2 gm v/r³.
                let h = 1e-5;
                let (before, after) = (orbit.at(t - h), orbit.at(t + h));
                let bound = 1e-9 + h * h * 2.0 * 2.0 * (v.norm() / x.norm().powi(3)).max(1.0) * (v.norm() / x.norm()).max(1.0);
                assert!(((after.0 - before.0) * (0.5 / h) - v).norm() < bound, "e = {e}, t = {t}");
                let pull = x * (-2.0 / x.norm().powi(3));
                assert!(((after.1 - before.1) * (0.5 / h) - pull).norm() < 10.0 * bound, "e = {e}, t = {t}");
            }
            let (there, back) = (orbit.at(0.7), orbit.at(0.7 + 3.0 * orbit.period()));
            assert!((there.0 - back.0).norm() < 1e-12 / (1.0 - e));
        }
        // docs/theory/orbits.md: e = 0.6 starts with v = 2.
        let orbit = Kepler { gm: 1.0, semi_major: 1.0, eccentricity: 0.6 };
        assert!((orbit.at(0.0).1.y - 2.0).abs() < 1e-15 && (orbit.angular_momentum() - 0.8).abs() < 1e-15);
    }
}
