//! Invariants of internal forces: momentum, angular momentum, and, for some schemes, energy.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Numbers, Vector, fixed, list, positions, run, simulation, step, vector, velocities, write};
use proptest::prelude::*;
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;
use tumble_interface::scene::Integrator;

/// Every kind of element that links masses, free in space without gravity: springs with damping, stiffening and threads,
/// springs without length, structural, shear and bend links, hinges, tetrahedra. `damping` multiplies all dampings; `rod` adds one.
fn everything(scheme: Integrator, damping: f64, rod: bool, fps: f64) -> Simulation {
    let rod = format!(
        "[[rope]]\nname = \"rod\"\nfrom = [0, 0, 2]\nto = [0.5, 0.1, 2.2]\nsegments = 6\ndensity = 1\nrod = {{ stretch = 20, bend = 0.2, twist = 0.1, inertia = 0.01, damping = {} }}\n",
        0.01 * damping
    )
    .repeat(usize::from(rod));
    let text = format!(
        "time.fps = {fps}\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"{}\"\nsubsteps = 1\nsolver.newton_tolerance = 1e-13\nsolver.linear_tolerance = 1e-9\n\
         [[sheet]]\nname = \"sheet\"\nsize = [1.0, 0.8]\nresolution = [6, 5]\ndensity = 1\nhinge = 0.02\n\
         links = {{ structural = {{ modulus = 40, damping = {} }}, shear = 15, bend = 2 }}\n\
         [[block]]\nname = \"jelly\"\nsize = [0.4, 0.3, 0.3]\nresolution = [4, 3, 3]\ncenter = [0, 0, 1]\ndensity = 50\n\
         material = {{ young = 100, poisson = 0.4, damping = {} }}\n\
         [[rope]]\nname = \"rope\"\nfrom = [1, 0, 0]\nto = [2, 0.3, 0]\nsegments = 8\ndensity = 1\nlinks = {{ structural = {{ modulus = 20, hardening = 3 }}, bend = {{ modulus = 2, tension_only = true }} }}\n\
         {rod}\
         [[particles]]\nname = \"p\"\nposition = [[3, 0, 0], [3.5, 0.2, 0], [3.2, 0.6, 0.3], [3.1, 0.2, 0.7]]\nmass = [0.2, 0.5, 0.3, 1.0]\n\
         spring = [{{ between = [0, 1], stiffness = 5, rest_length = 0, damping = {} }}, {{ between = [1, 2], stiffness = 8, damping = {} }}, {{ between = [2, 3], stiffness = 3, rest_length = 0 }}]\n\
         [[anchor]]\nname = \"tie\"\nbetween = [\"sheet 3\", \"jelly 5\"]\nstiffness = 4\ndamping = {}\n",
        scheme.name(),
        0.1 * damping,
        0.02 * damping,
        0.2 * damping,
        0.3 * damping,
        0.1 * damping,
    );
    let mut sim = simulation(&text);
    // Everything is deformed and moves, so that every element pulls.
    let mut numbers = Numbers(5);
    let names: Vec<&str> = ["sheet", "jelly", "rope", "p", "rod"].into_iter().filter(|n| !rod.is_empty() || *n != "rod").collect();
    for name in names {
        let x: Vec<Vector> = positions(&sim, name).iter().map(|x| *x + numbers.vector() * 0.01).collect();
        let v: Vec<Vector> = x.iter().map(|_| numbers.vector() * 0.5 + vector(0.3, -0.2, 0.1)).collect();
        write(&mut sim, name, "position", &x);
        write(&mut sim, name, "velocity", &v);
    }
    sim
}

/// Largest changes of momentum and angular momentum in some steps, relative to sum m |v| and sum m |x| |v| at the start, and the
/// largest impulse that one mass got, relative to the former: the signal.
fn drift(sim: &mut Simulation, steps: usize) -> (f64, f64, f64) {
    let start = sim.ledger();
    let size = start.kinetic.sqrt() * (2.0 * start.mass).sqrt();
    let far = 3.0 * size;
    let before = velocities(sim, "jelly");
    let away = |a: [f64; 3], b: [f64; 3]| (Vector::from(a) - Vector::from(b)).norm();
    let (mut p, mut l) = (0.0_f64, 0.0_f64);
    for _ in 0..steps {
        step(sim);
        let now = sim.ledger();
        p = p.max(away(now.momentum, start.momentum) / size);
        l = l.max(away(now.angular_momentum.unwrap(), start.angular_momentum.unwrap()) / far);
    }
    let signal = velocities(sim, "jelly").iter().zip(&before).map(|(a, b)| (*a - *b).norm()).fold(0.0, f64::max);
    (p, l, signal)
}

/// Round-off of 100 steps: each changes momenta by rounding 1e-16 of forces times h, which are up to 10 times the momenta, and
/// rounding errors add up at random; Verlet's velocities are differences of positions over h, 1e-16 |x|/h. Measured: 4e-13 (Verlet),
/// 1e-15 (all others).
const ROUND_OFF: f64 = 1e-12;

/// Implicit schemes conserve what their Newton iterations have converged to: 1e-13 of the first residual a step. Measured: 9e-16, as
/// the residual has no net force either.
const SOLVED: f64 = 1e-10;

#[test]
fn momentum_is_kept_by_every_scheme_and_angular_momentum_by_the_promised_ones() {
    for damping in [0.0, 1.0] {
        for scheme in fixed() {
            let mut sim = everything(scheme, damping, false, 400.0);
            let (p, l, signal) = drift(&mut sim, 100);
            println!(
                "{:18} damping x {damping}: momentum {p:.1e}, angular momentum {l:.1e}, velocities changed by {signal:.1}",
                scheme.name()
            );
            let solved = if scheme.is_implicit() { SOLVED } else { ROUND_OFF };
            assert!(signal > 0.1, "nothing happens");
            assert!(p < solved, "{} momentum {p:e}", scheme.name());
            match scheme {
                Integrator::SymplecticEuler | Integrator::Verlet | Integrator::VelocityVerlet | Integrator::ImplicitMidpoint => {
                    assert!(l < solved, "{} angular momentum {l:e}", scheme.name());
                }
                // A kick or a drift with the wrong partner: first order in h for the Euler schemes, higher powers for the others.
                // Measured: 5e-5 to 2e-4, then 4e-8 to 3e-6, RK4 4e-10.
                Integrator::ForwardEuler | Integrator::ImplicitEuler | Integrator::ModifiedEuler => {
                    assert!((1e-5..1.0).contains(&l), "{} {l:e}", scheme.name());
                }
                Integrator::Midpoint | Integrator::Heun | Integrator::Bdf2 => assert!((1e-8..1e-2).contains(&l), "{} {l:e}", scheme.name()),
                _ => assert!((1e-14..1e-6).contains(&l), "{} {l:e}", scheme.name()),
            }
        }
    }
}

/// Rods turn frames, whose spin is part of the books. Symplectic Euler and both Verlets keep the whole to round-off.
#[test]
fn rods_keep_momentum_and_angular_momentum() {
    for scheme in [Integrator::SymplecticEuler, Integrator::Verlet, Integrator::VelocityVerlet] {
        for damping in [0.0, 1.0] {
            let mut sim = everything(scheme, damping, true, 400.0);
            let (p, l, _) = drift(&mut sim, 100);
            println!("{:18} with rod, damping x {damping}: momentum {p:.1e}, angular momentum {l:.1e}", scheme.name());
            assert!(p < ROUND_OFF && l < ROUND_OFF, "{}: {p:e} {l:e}", scheme.name());
        }
    }
    // Implicit midpoint keeps what is quadratic in x and v; the spin of a frame, in axes that turn, is not. Its error is one of
    // the scheme, of order 2.
    let errors: Vec<f64> =
        [200.0, 400.0, 800.0].map(|fps| drift(&mut everything(Integrator::ImplicitMidpoint, 0.0, true, fps), fps as usize / 4).1).into();
    let orders = common::orders(&errors);
    println!("implicit_midpoint with rod: angular momentum {}, orders {orders:.2?}", common::show(&errors));
    assert!(errors[2] > 1e-12 && errors[0] < 1e-5);
    assert!(orders.iter().all(|p| (p - 2.0).abs() < 0.3), "{orders:?}");
}

/// Net force and torque at random states: one step of symplectic Euler changes momentum by h times the net force, and angular
/// momentum by h times the net torque about the origin.
#[test]
fn net_force_and_torque_are_round_off() {
    let mut sim = everything(Integrator::SymplecticEuler, 1.0, true, 400.0);
    let mut worst = (0.0_f64, 0.0_f64);
    for _ in 0..5 {
        let (start, before) = (sim.ledger(), velocities(&sim, "sheet"));
        step(&mut sim);
        let end = sim.ledger();
        let away = |a: [f64; 3], b: [f64; 3]| (Vector::from(a) - Vector::from(b)).norm();
        // The largest impulse on one mass of the sheet (rim masses weigh less) stands for the size of what cancels.
        let impulse = velocities(&sim, "sheet").iter().zip(&before).map(|(a, b)| (*a - *b).norm()).fold(0.0, f64::max) * 0.2 * 0.8 / 20.0;
        worst.0 = worst.0.max(away(end.momentum, start.momentum) / impulse);
        worst.1 = worst.1.max(away(end.angular_momentum.unwrap(), start.angular_momentum.unwrap()) / impulse);
        assert!(impulse > 1e-5);
    }
    println!("net force {:.1e}, net torque {:.1e} of the largest force on one mass", worst.0, worst.1);
    // Measured: 2.0e-12 and 8.1e-13. Some 500 elements, each off by 1e-16 of its own force; forces in the jelly are larger than in the sheet.
    assert!(worst.0 < 1e-11 && worst.1 < 1e-11);
}

/// Energy of a sheet that swings and flutters, free of damping, over 10^4 steps.
#[test]
fn symplectic_schemes_keep_the_energy_bounded() {
    for (scheme, swing) in [
        // Order 1: the energy swings by some w h of the modes that move.
        (Integrator::SymplecticEuler, 0.05),
        (Integrator::Verlet, 0.01),
        (Integrator::VelocityVerlet, 0.01),
    ] {
        let mut sim = simulation(&format!(
            "time.fps = 50\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"{}\"\nsubsteps = 20\n\
             [[sheet]]\nname = \"sheet\"\nsize = [1, 1]\nresolution = [6, 6]\nhinge = 0.01\npin = [\"corner 0 0\"]\nlinks = {{ structural = 60, shear = 20, bend = 2 }}\n",
            scheme.name()
        ));
        let mut numbers = Numbers(3);
        let v: Vec<Vector> = (0..36).map(|_| numbers.vector() * 0.2).collect();
        write(&mut sim, "sheet", "velocity", &v);
        let start = sim.ledger().energy();
        let mut early = (f64::INFINITY, 0.0_f64);
        let mut late = early;
        for frame in 0..500 {
            step(&mut sim);
            let e = sim.ledger().energy() / start;
            let range = if frame < 100 { &mut early } else { &mut late };
            *range = (range.0.min(e), range.1.max(e));
        }
        println!("{:18} energy {:.4} .. {:.4} in 2000 steps, {:.4} .. {:.4} in 8000 more", scheme.name(), early.0, early.1, late.0, late.1);
        assert!(late.1 - late.0 > 1e-5, "it moves");
        // Measured: 0.989 .. 1.018 for symplectic Euler, 1.0005 .. 1.0022 for both Verlets.
        assert!((late.0 - 1.0).abs() < swing && (late.1 - 1.0).abs() < swing);
        // No drift: what comes later is not much wider than what came first.
        assert!(late.1 - late.0 < 2.0 * (early.1 - early.0));
    }
    // Forward Euler on the same sheet, to show what the bound can see.
    let mut sim = everything(Integrator::ForwardEuler, 0.0, false, 400.0);
    let start = sim.ledger().energy();
    run(&mut sim, 100);
    assert!(sim.ledger().energy() > 1.5 * start);
}

/// A random net of springs of rest length zero as a scene.
fn net(seed: u64, n: usize, h: f64) -> String {
    let mut numbers = Numbers(seed);
    let unit = |numbers: &mut Numbers| 0.5 + 0.5 * numbers.next();
    let places: Vec<Vector> = (0..n).map(|_| numbers.vector()).collect();
    let speeds: Vec<Vector> = (0..n).map(|_| numbers.vector() * 3.0).collect();
    let masses: Vec<f64> = (0..n).map(|_| 0.1 + unit(&mut numbers) * 2.0).collect();
    let springs: Vec<String> = (0..2 * n)
        .filter_map(|_| {
            let (a, b) = ((unit(&mut numbers) * n as f64) as usize % n, (unit(&mut numbers) * n as f64) as usize % n);
            let k = 10.0_f64.powf(2.0 + 2.0 * numbers.next());
            (a != b).then(|| format!("{{ between = [{a}, {b}], stiffness = {k:e}, rest_length = 0 }}"))
        })
        .collect();
    let pin = if seed.is_multiple_of(2) { "pin = [\"vertex 0\"]\n" } else { "" };
    format!(
        "time.fps = {:e}\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"implicit_euler\"\nsubsteps = 1\nsolver = {{ newton_tolerance = 1e-13, linear_tolerance = 1e-10 }}\n\
         [[particles]]\nname = \"net\"\n{pin}position = {}\nvelocity = {}\nmass = {masses:?}\nspring = [{}]\n",
        1.0 / h,
        list(&places),
        list(&speeds),
        springs.join(", ")
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, failure_persistence: None, ..ProptestConfig::default() })]

    /// The energy k/2 |r|² is convex, so implicit Euler can only lower the sum.
    #[test]
    fn implicit_euler_never_raises_the_energy_of_springs_without_length(seed in any::<u64>(), n in 2_usize..12, exponent in -3.0..2.0_f64) {
        let mut sim = simulation(&net(seed, n, 10.0_f64.powf(exponent)));
        let start = sim.ledger().energy();
        let mut before = start;
        for _ in 0..10 {
            step(&mut sim);
            let after = sim.ledger().energy();
            // The linear system is solved to 1e-13 of its first residual, which may be 1e4 times the forces that remain; what has
            // died out is round-off.
            prop_assert!(after <= before * (1.0 + 1e-9) + 1e-20 * start, "{before:e} -> {after:e}");
            prop_assert!(after >= 0.0);
            before = after;
        }
    }
}

/// Two triangles thrown about their common edge fold onto each other and through. A measure with a pole there, such as
/// 2 tan(theta/2), turns a stiff hinge back at 0.35 m and makes a soft one explode.
#[test]
fn a_sheet_that_folds_through_itself_gains_no_energy() {
    for hinge in [1e-6, 0.02] {
        let mut sim = simulation(&format!(
            "time.fps = 100\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"velocity_verlet\"\nstep = 1e-3\n\
             [[sheet]]\nname = \"s\"\nsize = [1, 1]\nresolution = [2, 2]\nhinge = {hinge}\npin = [\"corner 0 0\", \"corner 1 1\"]\n\
             links = {{ structural = 100, shear = 10, diagonals = \"one\" }}\n",
        ));
        write(&mut sim, "s", "velocity", &[vector(0.0, 0.0, 5.0); 4]);
        let start = sim.ledger().energy();
        let (mut off, mut closest) = (0.0_f64, f64::INFINITY);
        for _ in 0..100 {
            step(&mut sim);
            off = off.max((sim.ledger().energy() / start - 1.0).abs());
            let x = positions(&sim, "s");
            closest = closest.min((x[1] - x[2]).norm());
        }
        println!("hinge {hinge}: folded until the free corners were {closest:.3} m apart, energy off by {off:.1e}");
        assert!(closest < 0.2, "it never folded: {closest}");
        // Verlet swings by (w h)²/4 of what the springs hold. Measured: 1.1e-5.
        assert!(off < 1e-4, "{off}");
    }
}

/// Gravity pulls points and turns nothing.
#[test]
fn a_falling_rod_does_not_turn() {
    for scheme in [Integrator::SymplecticEuler, Integrator::VelocityVerlet, Integrator::Rk4] {
        let mut sim = simulation(&format!(
            "time.fps = 1000\n[[system]]\nintegrator = \"{}\"\nsubsteps = 4\n\
             [[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 6\ndensity = 0.1\n\
             rod = {{ stretch = 10, shear = 10, bend = 0.01, twist = 0.01, inertia = 1e-4 }}\n",
            scheme.name()
        ));
        for _ in 0..20 {
            step(&mut sim);
        }
        let turning = common::column(&sim, "r", "angular_velocity");
        assert!(!turning.is_empty() && turning.iter().all(|w| w.norm() < 1e-9), "{}: {turning:?}", scheme.name());
        assert!(velocities(&sim, "r").iter().all(|v| (v.z + 9.8 * 0.02).abs() < 1e-9), "it falls");
    }
}
