//! Every scheme on the oscillator x'' = -w² x, a unit mass on a spring of rest length zero: not only stable or unstable, but
//! by how much in each step. The laws are derived in docs/theory/integrators.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, fixed, positions, run, simulation, step, vector, velocities};
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;
use tumble_interface::scene::Integrator;

/// z = w h of the exact laws.
const Z: [f64; 3] = [0.3, 1.0, 1.9];

/// A mass of 1 kg on a spring to the origin with w h = z and so many steps a frame; it starts in general position and motion.
fn oscillator(scheme: Integrator, z: f64, h: f64, substeps: u32) -> Simulation {
    let w = z / h;
    simulation(&format!(
        "time.fps = {:e}\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"{}\"\nsubsteps = {substeps}\n\
         [[particles]]\nname = \"p\"\nposition = [[0, 0, 0], [1.0, -0.4, 0.3]]\nvelocity = [[0, 0, 0], [{:e}, {:e}, {:e}]]\npin = [\"vertex 0\"]\n\
         spring = [{{ between = [0, 1], stiffness = {:e}, rest_length = 0 }}]\n",
        1.0 / (h * f64::from(substeps)),
        scheme.name(),
        -0.3 * w,
        0.5 * w,
        0.2 * w,
        w * w
    ))
}

/// x and u = v/w of the mass.
fn state(sim: &Simulation, w: f64) -> (Vector, Vector) {
    (positions(sim, "p")[1], velocities(sim, "p")[1] * (1.0 / w))
}

/// x² + c x u + u², the quadratic forms that schemes multiply by a constant.
fn form(sim: &Simulation, w: f64, c: f64) -> f64 {
    let (x, u) = state(sim, w);
    x.norm_sq() + c * x.dot(u) + u.norm_sq()
}

/// Largest |growth/expected - 1| over some steps, for the growth of a form in one step.
fn worst(scheme: Integrator, z: f64, c: f64, expected: f64, steps: usize) -> f64 {
    let h = 1.0 / 64.0;
    let mut sim = oscillator(scheme, z, h, 1);
    let mut before = form(&sim, z / h, c);
    let mut worst = 0.0_f64;
    for _ in 0..steps {
        step(&mut sim);
        let after = form(&sim, z / h, c);
        worst = worst.max((after / before / expected - 1.0).abs());
        before = after;
    }
    worst
}

/// Round-off: one step sums some ten products, each with an error of 1e-16 of the largest term, which for z = 1.9 is up to
/// ten times the result.
const ROUND_OFF: f64 = 1e-14;

#[test]
fn one_step_multiplies_the_energy_by_exactly_its_factor() {
    for z in Z {
        let z2 = z * z;
        // Measured over the three z and 4 steps, before the run is stopped at a thousandfold energy: at most 6.7e-16 for every scheme.
        for (scheme, factor) in [
            (Integrator::ForwardEuler, 1.0 + z2),
            (Integrator::Midpoint, 1.0 + z2 * z2 / 4.0),
            (Integrator::Heun, 1.0 + z2 * z2 / 4.0),
            (Integrator::Rk4, 1.0 - z2.powi(3) / 72.0 + z2.powi(4) / 576.0),
        ] {
            let worst = worst(scheme, z, 0.0, factor, 4);
            println!("{} z = {z}: energy x {factor:.6} a step to {worst:.1e}", scheme.name());
            assert!(worst < ROUND_OFF);
            assert!((factor - 1.0).abs() > 1e-6, "no signal");
        }
    }
}

#[test]
fn the_energy_of_the_ledger_is_that_of_the_oscillator() {
    let (z, h) = (0.3, 1.0 / 64.0);
    let w = z / h;
    let mut sim = oscillator(Integrator::ForwardEuler, z, h, 1);
    for _ in 0..3 {
        step(&mut sim);
        let energy = 0.5 * w * w * form(&sim, w, 0.0);
        assert!((sim.ledger().energy() / energy - 1.0).abs() < ROUND_OFF);
    }
}

/// x² - (w h/2) x v/w + (v/w)² grows by exactly 1 + w²h²/2 a step.      (integrators.22)
#[test]
fn modified_euler_multiplies_its_form_by_exactly_one_plus_half_z_squared() {
    for z in Z {
        let worst = worst(Integrator::ModifiedEuler, z, -z / 2.0, 1.0 + z * z / 2.0, 4);
        // The energy itself does not grow by a constant factor: the test sees the difference.
        let energy = self::worst(Integrator::ModifiedEuler, z, 0.0, 1.0 + z * z / 2.0, 4);
        println!("modified_euler z = {z}: form to {worst:.1e}, energy only to {energy:.1e}");
        assert!(worst < ROUND_OFF);
        assert!(energy > 1e-3);
    }
}

/// The invariants of the symplectic schemes, over 1000 steps.           (integrators.23, integrators.24)
#[test]
fn symplectic_schemes_keep_their_forms() {
    for z in Z {
        let h = 1.0 / 64.0;
        let w = z / h;
        for scheme in [Integrator::SymplecticEuler, Integrator::Verlet, Integrator::VelocityVerlet] {
            let kept = |sim: &Simulation| {
                let (x, u) = state(sim, w);
                match scheme {
                    Integrator::SymplecticEuler => x.norm_sq() - z * x.dot(u) + u.norm_sq(),
                    _ => (1.0 - z * z / 4.0) * x.norm_sq() + u.norm_sq(),
                }
            };
            let mut sim = oscillator(scheme, z, h, 1);
            let (start, energy) = (kept(&sim), form(&sim, w, 0.0));
            let (mut worst, mut swing) = (0.0_f64, 0.0_f64);
            for _ in 0..1000 {
                step(&mut sim);
                worst = worst.max((kept(&sim) / start - 1.0).abs());
                swing = swing.max((form(&sim, w, 0.0) / energy - 1.0).abs());
            }
            println!("{} z = {z}: form kept to {worst:.1e}, energy swings by {swing:.2}", scheme.name());
            // Round-off of 1000 steps at 1e-16, at most all of one sign, over a form that is down to 0.1 of its terms. Verlet's
            // velocities are differences of positions over h: 1/z times as much.
            // Measured: at most 1.1e-14.
            assert!(worst < 1e-12);
            assert!(swing > 0.01);
        }
    }
}

/// Whether the energy stays below `bound` times its start for 3000 steps.
fn stays(scheme: Integrator, z: f64, bound: f64) -> (bool, f64) {
    let h = 1.0 / 64.0;
    let mut sim = oscillator(scheme, z, h, 1);
    let start = form(&sim, z / h, 0.0);
    let mut largest = 0.0_f64;
    for _ in 0..3000 {
        if sim.step(&|| true).is_err() {
            return (false, f64::INFINITY);
        }
        largest = largest.max(form(&sim, z / h, 0.0) / start);
        if largest > 1e30 {
            return (false, largest);
        }
    }
    (largest < bound, largest)
}

#[test]
fn schemes_are_stable_up_to_their_limits_and_not_beyond() {
    for scheme in [Integrator::SymplecticEuler, Integrator::Verlet, Integrator::VelocityVerlet] {
        // The form bounds the energy by (1 + z/2)/(1 - z/2) for symplectic Euler and 1/(1 - z²/4) for Verlet: 399 and 100.
        let bound = if scheme == Integrator::SymplecticEuler { 1.995 / 0.005 } else { 1.0 / (1.0 - 1.99_f64.powi(2) / 4.0) };
        let (bounded, largest) = stays(scheme, 1.99, bound);
        // Beyond 2 one eigenvalue is 1.0025 + sqrt(1.0025² - 1) in square: x 1.49 a step at 2.01.
        let (unbounded, beyond) = stays(scheme, 2.01, 1e6);
        println!("{}: energy at most x {largest:.1} at 1.99 (bound {bound:.0}), x {beyond:.1e} at 2.01", scheme.name());
        assert!(bounded && !unbounded);
    }
    // |R4|² = 1 - z^6/72 + z^8/576: 0.959 a step at 2.82, 1.060 at 2.84.   (integrators.28)
    let (bounded, largest) = stays(Integrator::Rk4, 2.82, 1.0);
    let (unbounded, beyond) = stays(Integrator::Rk4, 2.84, 1e6);
    println!("rk4: energy at most x {largest:.3} at 2.82, x {beyond:.1e} at 2.84");
    assert!(bounded && !unbounded);
    for scheme in [Integrator::ForwardEuler, Integrator::ModifiedEuler, Integrator::Midpoint, Integrator::Heun] {
        // No step is stable: even z = 0.3 grows; midpoint and Heun by 1 + z^4/4 = 1.002 a step, x 430 in 3000.
        let (bounded, largest) = stays(scheme, 0.3, 100.0);
        println!("{}: energy x {largest:.1e} at 0.3", scheme.name());
        assert!(!bounded);
    }
}

/// E / (1 + w²h²) for every h.                                          (integrators.25)
#[test]
fn implicit_euler_decays_by_exactly_its_factor_for_every_step() {
    for z in [0.1, 0.3, 1.0, 1.9, 10.0, 100.0, 1000.0_f64] {
        let mut sim = oscillator(Integrator::ImplicitEuler, z, 1.0, 1);
        let mut worst = 0.0_f64;
        for _ in 0..8 {
            let before = form(&sim, z, 0.0);
            step(&mut sim);
            worst = worst.max((form(&sim, z, 0.0) / before * (1.0 + z * z) - 1.0).abs());
        }
        println!("implicit_euler z = {z}: 1/(1 + z²) to {worst:.1e}");
        // The matrix is a multiple of one 3 x 3 identity, which the preconditioner inverts. v = (v* - z² x)/(1 + z²) loses
        // nothing, x = x* + v cancels to 1/z² of its terms for z >> 1: round-off times z in x, times z² in its square.
        // Measured: 8.9e-16 up to z = 1.9, 3.8e-14 at 10, 2.5e-10 at 1000.
        assert!(worst < 1e-14 * (1.0 + z * z), "{worst:e}");
        assert!(worst < 1e-9);
    }
}

/// (integrators.26)
#[test]
fn implicit_midpoint_keeps_the_energy() {
    for z in [0.3, 1.0, 1.9, 10.0, 100.0] {
        let mut sim = oscillator(Integrator::ImplicitMidpoint, z, 1.0, 1);
        let start = form(&sim, z, 0.0);
        let mut worst = 0.0_f64;
        for _ in 0..1000 {
            step(&mut sim);
            worst = worst.max((form(&sim, z, 0.0) / start - 1.0).abs());
        }
        println!("implicit_midpoint z = {z}: energy kept to {worst:.1e} over 1000 steps");
        // 1000 steps of round-off 1e-16; x_m = x + v_m/2 cancels to 1/z of its terms.
        // Measured: 6.8e-15 up to z = 1.9, 2.0e-13 at 100.
        assert!(worst < 1e-13 * (1.0 + z), "{worst:e}");
    }
}

/// The recurrence (1 - 2/3 i z) y_n+1 = 4/3 y_n - 1/3 y_n-1 for y = x - i u, which starts with implicit Euler.   (integrators.12)
#[test]
fn bdf2_is_its_recurrence_and_decays() {
    type Complex = (f64, f64);
    let over = |a: Complex, b: Complex| -> Complex {
        let n = b.0 * b.0 + b.1 * b.1;
        ((a.0 * b.0 + a.1 * b.1) / n, (a.1 * b.0 - a.0 * b.1) / n)
    };
    for z in [0.1, 0.3, 1.0, 1.9, 10.0, 1000.0] {
        let mut sim = oscillator(Integrator::Bdf2, z, 1.0, 1);
        let y = |sim: &Simulation| {
            let (x, u) = state(sim, z);
            (x.x, -u.x)
        };
        let mut exact = [y(&sim), (0.0, 0.0)];
        let start = form(&sim, z, 0.0);
        let mut worst = 0.0_f64;
        let mut last = start;
        for n in 0..40 {
            let next = if n == 0 {
                over(exact[0], (1.0, -z))
            } else {
                let sum = |a: f64, b: f64| 4.0 / 3.0 * a - b / 3.0;
                over((sum(exact[0].0, exact[1].0), sum(exact[0].1, exact[1].1)), (1.0, -2.0 / 3.0 * z))
            };
            exact = [next, exact[0]];
            step(&mut sim);
            let now = y(&sim);
            worst = worst.max((now.0 - next.0).abs().max((now.1 - next.1).abs()) / start.sqrt());
            last = form(&sim, z, 0.0);
        }
        println!("bdf2 z = {z}: recurrence to {worst:.1e}, energy x {:.1e} after 40 steps", last / start);
        // Round-off of 40 steps; cancellation as for implicit Euler. Measured: 5.0e-15, at z = 1000 3.5e-14.
        assert!(worst < 1e-14 * (1.0 + z), "{worst:e}");
        // The larger root is 1 - z^4/4 for small z: 0.9980 in energy after 40 steps at z = 0.1; less for every larger z.
        assert!(last < 0.9985 * start);
    }
}

/// A system stepped by any scheme in one frame of two steps goes where two frames of one step go: schemes with a memory
/// carry it over frames.
#[test]
fn frames_do_not_show_in_the_motion() {
    for scheme in fixed() {
        let (z, h) = (0.3, 1.0 / 64.0);
        let mut one = oscillator(scheme, z, h, 1);
        run(&mut one, 6);
        let mut two = oscillator(scheme, z, h, 2);
        run(&mut two, 3);
        let (a, b) = (state(&one, z / h), state(&two, z / h));
        assert!((a.0 - b.0).norm() < 1e-14 && (a.1 - b.1).norm() < 1e-14, "{}", scheme.name());
        assert!((a.0 - vector(1.0, -0.4, 0.3)).norm() > 0.1, "it moves");
    }
}
