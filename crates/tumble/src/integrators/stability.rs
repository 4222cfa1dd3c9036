//! Which steps are stable, from one mode of the system: x'' + c x' + w² x = 0.
//!
//! A step of any scheme is then a matrix on (x, v, and what the scheme remembers); its spectral radius is the growth.
//! Tested against the schemes themselves, step by step, and against the closed limits.

use super::{DORMAND_PRINCE, Tableau, tableau};
use crate::math::bisect;
use crate::math::functions::{ln, pow};
use tumble_interface::engine::BLOW_UP;
use tumble_interface::scene::Integrator;

/// A mode of a system.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mode {
    /// Angular frequency w [rad/s].
    pub frequency: f64,
    /// Damping rate c [1/s].
    pub damping: f64,
}

/// Numbers that a step acts on: x, v, and up to two that the scheme remembers.
pub type State = [f64; 4];

impl Mode {
    fn acceleration(self, x: f64, v: f64) -> f64 {
        -self.frequency * self.frequency * x - self.damping * v
    }

    /// One step of a scheme, memory included: for `verlet` x and a of before, for `velocity_verlet` a, for `bdf2` x and
    /// v of before.
    pub fn step(self, scheme: Integrator, h: f64, [x, v, m, n]: State) -> State {
        let a = |x, v| self.acceleration(x, v);
        match scheme {
            Integrator::SymplecticEuler => {
                let v = v + h * a(x, v);
                [x + h * v, v, 0.0, 0.0]
            }
            Integrator::ModifiedEuler => {
                let after = v + h * a(x, v);
                [x + h / 2.0 * (v + after), after, 0.0, 0.0]
            }
            Integrator::Verlet => {
                let after = 2.0 * x - m + h * h * n;
                let drift = (after - x) / h;
                let end = a(after, drift + h / 2.0 * n);
                [after, drift + h / 2.0 * end, x, end]
            }
            Integrator::VelocityVerlet => {
                let half = v + h / 2.0 * m;
                let after = x + h * half;
                let end = a(after, half + h / 2.0 * m);
                [after, half + h / 2.0 * end, end, 0.0]
            }
            Integrator::ImplicitEuler => {
                let [x, v] = self.stage(h, x, v);
                [x, v, 0.0, 0.0]
            }
            Integrator::ImplicitMidpoint => {
                let [mx, mv] = self.stage(h / 2.0, x, v);
                [2.0 * mx - x, 2.0 * mv - v, 0.0, 0.0]
            }
            Integrator::Bdf2 => {
                let [ax, av] = self.stage(2.0 / 3.0 * h, x + (x - m) / 3.0, v + (v - n) / 3.0);
                [ax, av, x, v]
            }
            Integrator::DormandPrince => self.runge_kutta(&DORMAND_PRINCE, h, x, v),
            explicit => self.runge_kutta(tableau(explicit), h, x, v),
        }
    }

    fn runge_kutta(self, tableau: &Tableau, h: f64, x: f64, v: f64) -> State {
        let mut k: Vec<[f64; 2]> = Vec::new();
        let sum = |weights: &[f64], k: &[[f64; 2]], c: usize| weights.iter().zip(k).map(|(w, k)| w * k[c]).sum::<f64>();
        for row in tableau.a {
            let (sx, sv) = (x + h * sum(row, &k, 0), v + h * sum(row, &k, 1));
            k.push([sv, self.acceleration(sx, sv)]);
        }
        [x + h * sum(tableau.b, &k, 0), v + h * sum(tableau.b, &k, 1), 0.0, 0.0]
    }

    /// x = x* + g v, v = v* + g a(x, v).
    fn stage(self, g: f64, x: f64, v: f64) -> [f64; 2] {
        let w2 = self.frequency * self.frequency;
        let v = (v - g * w2 * x) / (1.0 + g * self.damping + g * g * w2);
        [x + g * v, v]
    }

    /// Growth of the fastest growing state in one step: the spectral radius of the step's matrix.
    pub fn growth(self, scheme: Integrator, h: f64) -> f64 {
        // In units of x and v/rate the matrix is well scaled.
        let rate = self.frequency.max(self.damping).max(1e-300);
        let units = match scheme {
            Integrator::Verlet => [1.0, rate, 1.0, rate * rate],
            Integrator::VelocityVerlet => [1.0, rate, rate * rate, 1.0],
            _ => [1.0, rate, 1.0, rate],
        };
        let mut a = [[0.0; 4]; 4];
        for j in 0..4 {
            let mut unit = [0.0; 4];
            unit[j] = units[j];
            let image = self.step(scheme, h, unit);
            for i in 0..4 {
                a[i][j] = image[i] / units[i];
            }
        }
        spectral_radius(a)
    }
}

/// By repeated squaring: |A^(2^k)|^(1/2^k).
fn spectral_radius(mut a: [[f64; 4]; 4]) -> f64 {
    let mut log = 0.0;
    let mut weight = 1.0;
    for _ in 0..40 {
        let norm = a.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
        if norm == 0.0 || !norm.is_finite() {
            return if norm == 0.0 { 0.0 } else { f64::INFINITY };
        }
        log += weight * ln(norm);
        weight /= 2.0;
        let scaled = a.map(|row| row.map(|x| x / norm));
        for i in 0..4 {
            for j in 0..4 {
                a[i][j] = (0..4).map(|k| scaled[i][k] * scaled[k][j]).sum();
            }
        }
    }
    pow(std::f64::consts::E, log)
}

/// The largest step below which no mode grows, and the largest below which none grows to [`BLOW_UP`] times its energy
/// within 100 of its periods [s]. Zero: no step; infinite: every step.
pub fn limits(scheme: Integrator, modes: &[Mode]) -> (f64, f64) {
    let rate = modes.iter().map(|m| m.frequency.max(m.damping)).fold(0.0, f64::max);
    if rate == 0.0 {
        return (f64::INFINITY, f64::INFINITY);
    }
    // Both forms of Verlet are one map; as a matrix on differences of positions a short step drowns in round-off.
    let scheme = if scheme == Integrator::Verlet { Integrator::VelocityVerlet } else { scheme };
    let stable = |h: f64| modes.iter().all(|m| m.growth(scheme, h) <= 1.0 + 1e-12 * (1.0 + 1e3 * h * rate));
    let usable = |h: f64| {
        modes.iter().filter(|m| m.frequency > 0.0 || m.damping > 0.0).all(|m| {
            // An overdamped mode has no period; 100 times 2 pi / c stands in for 100 of them.
            let steps = 200.0 * std::f64::consts::PI / (m.frequency.max(m.damping) * h);
            2.0 * ln(m.growth(scheme, h).max(1e-300)) * steps <= ln(BLOW_UP)
        })
    };
    // Without damping, weak growth such as Heun's (w h)^4/8 must not hide in round-off: start at w h = 0.01.
    let undamped = modes.iter().any(|m| m.damping <= 1e-6 * m.frequency);
    (first_failure(rate, if undamped { -2 } else { -6 }, &stable), first_failure(rate, -3, &usable))
}

/// The first h at which `fine` fails: a scan from 10^from/rate to 10^4/rate, then bisection.
fn first_failure(rate: f64, from: i32, fine: &impl Fn(f64) -> bool) -> f64 {
    let at = |k: i32| pow(10.0, f64::from(k) / 16.0) / rate;
    let Some(k) = (16 * from..=64).find(|k| !fine(at(*k))) else { return f64::INFINITY };
    if k == 16 * from {
        return 0.0;
    }
    bisect((at(k - 1), at(k)), 50, fine).0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limit(scheme: Integrator, frequency: f64, damping: f64) -> f64 {
        limits(scheme, &[Mode { frequency, damping }]).0
    }

    #[test]
    fn limits_are_the_closed_ones() {
        let w = 3.0;
        let near = |a: f64, b: f64| (a - b).abs() < 1e-4 * b;
        for scheme in [Integrator::ForwardEuler, Integrator::ModifiedEuler, Integrator::Midpoint, Integrator::Heun] {
            assert_eq!(limit(scheme, w, 0.0), 0.0, "{scheme:?}");
        }
        for scheme in [Integrator::SymplecticEuler, Integrator::Verlet, Integrator::VelocityVerlet] {
            assert!(near(limit(scheme, w, 0.0) * w, 2.0), "{scheme:?} {}", limit(scheme, w, 0.0) * w);
        }
        assert!(near(limit(Integrator::Rk4, w, 0.0) * w, 8.0_f64.sqrt()));
        for scheme in [Integrator::ImplicitEuler, Integrator::ImplicitMidpoint, Integrator::Bdf2] {
            assert_eq!(limit(scheme, w, 0.0), f64::INFINITY, "{scheme:?}");
            assert_eq!(limit(scheme, w, 7.0), f64::INFINITY, "{scheme:?}");
        }
        // Damped: forward Euler needs h <= c/w² while underdamped, and h c <= 2 without a spring.
        assert!(near(limit(Integrator::ForwardEuler, w, 0.4), 0.4 / (w * w)));
        assert!(near(limit(Integrator::ForwardEuler, 0.0, 0.4), 2.0 / 0.4));
        // Symplectic Euler: w²h² + 2 c h <= 4, from the determinant 1 - c h and the trace 2 - c h - w²h².
        let h = limit(Integrator::SymplecticEuler, w, 1.3);
        assert!(near(w * w * h * h + 2.0 * 1.3 * h, 4.0), "{h}");
    }

    /// Both forms of Verlet have the same limits, also for a mode that is hardly damped beside one that is.
    #[test]
    fn round_off_does_not_look_like_growth() {
        let modes = [Mode { frequency: 2354.0, damping: 1008.0 }, Mode { frequency: 2100.0, damping: 0.01 }];
        for damped in [&modes[..], &modes[1..], &[Mode { frequency: 1.0, damping: 1e-5 }]] {
            let (a, b) = (limits(Integrator::Verlet, damped), limits(Integrator::VelocityVerlet, damped));
            assert!(a == b && a.0 > 0.0, "{a:?} {b:?}");
            // One map: the matrices have the same radius where round-off lets us see it.
            for z in [0.1, 0.5, 1.0, 1.7, 2.5] {
                let growth = |scheme| damped[0].growth(scheme, z / damped[0].frequency);
                assert!((growth(Integrator::Verlet) / growth(Integrator::VelocityVerlet) - 1.0).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn usable_steps_are_those_that_grow_slowly() {
        // Forward Euler: (1 + z²)^(200 pi/z) = 1000.
        let (_, usable) = limits(Integrator::ForwardEuler, &[Mode { frequency: 2.0, damping: 0.0 }]);
        let z = usable * 2.0;
        assert!(((1.0 + z * z).ln() * 200.0 * std::f64::consts::PI / z - 1000.0_f64.ln()).abs() < 1e-3, "{z}");
        assert!((0.0109..0.0111).contains(&z), "{z}");
    }
}
