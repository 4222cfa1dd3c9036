//! Forces between masses that are near each other.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, list, positions, simulation, step, vector, velocities, write};
use tumble_f64::math::Random;
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

/// Laws, with lengths that suit a cloud of neighbours 0.3 m apart.
const LAWS: [(&str, bool); 6] = [
    ("kind = \"lennard_jones\"\nepsilon = 2\nsigma = 0.12\ncutoff = 0.5", true),
    ("kind = \"lennard_jones\"\nepsilon = 2\nsigma = 0.12\ncutoff = 0.5\nsmooth = false", true),
    ("kind = \"repulsion\"\nstiffness = 30\ndistance = 0.5\nexponent = 2", true),
    ("kind = \"cohesion\"\nstrength = 3\nradius = 0.7", true),
    ("kind = \"viscosity\"\ncoefficient = 3\nradius = 0.6", false),
    ("kind = \"viscosity\"\ncoefficient = 3\nradius = 0.6\ncentral = true", true),
];

fn cloud(n: usize, size: f64) -> (Vec<Vector>, Vec<Vector>, Vec<f64>) {
    let random = Random::new(3, "cloud");
    // On a jittered lattice, so that no two come so close that differences of energies drown.
    let side = (n as f64).cbrt().ceil() as usize;
    let at = |i: usize| {
        let [a, b, c, _] = random.uniform(i as u64, 0, 0);
        let cell = size / side as f64;
        let place = |k: usize, jitter: f64| (k as f64 + 0.6 * jitter) * cell;
        vector(place(i % side, a), place(i / side % side, b), place(i / side / side, c))
    };
    let velocity = |i: usize| {
        let [a, b, c, _] = random.uniform(i as u64, 0, 1);
        vector(a - 0.5, b - 0.5, c - 0.5)
    };
    let mass = |i: usize| 0.5 + random.uniform(i as u64, 0, 2)[0];
    ((0..n).map(at).collect(), (0..n).map(velocity).collect(), (0..n).map(mass).collect())
}

fn scene(system: &str, h: f64, x: &[Vector], v: &[Vector], mass: &[f64], force: &str) -> Simulation {
    simulation(&format!(
        "time.fps = {:e}\nworld.gravity = [0, 0, 0]\n[[system]]\n{system}\n\
         [[particles]]\nname = \"a\"\nposition = {}\nvelocity = {}\nmass = {mass:?}\n[[force]]\n{force}\n",
        1.0 / h,
        list(x),
        list(v)
    ))
}

/// Step [s] after which changes of velocity are read.
const H: f64 = 1e-3;

/// Forces, as the change of momentum in a step of forward Euler.
fn forces(x: &[Vector], v: &[Vector], mass: &[f64], force: &str) -> Vec<Vector> {
    let mut sim = scene("integrator = \"forward_euler\"\nsubsteps = 1", H, x, v, mass, force);
    step(&mut sim);
    velocities(&sim, "a").iter().zip(v).zip(mass).map(|((after, before), m)| (*after - *before) * (*m / H)).collect()
}

#[test]
fn pairs_keep_momentum_and_angular_momentum() {
    let (x, v, mass) = cloud(300, 2.0);
    for (law, central) in LAWS {
        let f = forces(&x, &v, &mass, law);
        let size: f64 = f.iter().map(|f| f.norm()).sum();
        let total = f.iter().fold(Vector::default(), |sum, f| sum + *f);
        let torque = x.iter().zip(&f).fold(Vector::default(), |sum, (x, f)| sum + x.cross(*f));
        println!("{law:?}: of {size:.2}, net {:.1e}, torque {:.1e}", total.norm(), torque.norm());
        // 300 velocities below 1 m/s are rounded to 1e-16 of themselves, over H; lever arms are below 4 m.
        let rounding = 300.0 * 1.1e-16 / H;
        assert!(size > 20.0 && total.norm() < rounding + 3e-15 * size, "{law}");
        assert!((torque.norm() < 4.0 * rounding + 1e-14 * size) == central, "{law}");
    }
}

#[test]
fn forces_are_the_slopes_of_the_energy() {
    let (x, v, mass) = cloud(60, 1.2);
    for (law, _) in &LAWS[..4] {
        let f = forces(&x, &v, &mass, law);
        let mut sim = scene("integrator = \"forward_euler\"\nsubsteps = 1", 1.0, &x, &v, &mass, law);
        let h = 1e-6;
        let mut energy = |x: &[Vector]| {
            write(&mut sim, "a", "position", x);
            sim.ledger().external
        };
        let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
        for i in (0..60).step_by(7) {
            for axis in [vector(1.0, 0.0, 0.0), vector(0.0, 1.0, 0.0), vector(0.0, 0.0, 1.0)] {
                let mut moved = x.clone();
                moved[i] = x[i] + axis * h;
                let high = energy(&moved);
                moved[i] = x[i] - axis * h;
                let slope = (high - energy(&moved)) / (2.0 * h);
                worst = worst.max((slope + f[i].dot(axis)).abs());
                largest = largest.max(slope.abs());
            }
        }
        println!("{law:?}: slopes up to {largest:.2}, off by {worst:.1e}");
        // Central differences: h² E'''/6 and round-off 1e-16 E/h, for E of some hundred joules.
        assert!(largest > 1.0 && worst < 1e-6 * largest.max(10.0), "{law}");
    }
}

#[test]
fn molecules_keep_their_energy_to_second_order() {
    let (x, v, mass) = cloud(64, 0.9);
    let law = LAWS[0].0;
    let drift = |substeps: usize| {
        let system = format!("integrator = \"velocity_verlet\"\nsubsteps = {substeps}");
        let mut sim = scene(&system, 0.005, &x, &v, &mass, law);
        let start = sim.ledger().energy();
        let worst = (0..25).map(|_| {
            step(&mut sim);
            (sim.ledger().energy() - start).abs()
        });
        (worst.fold(0.0, f64::max), sim.ledger().kinetic)
    };
    let (coarse, fine) = (drift(20), drift(40));
    println!("energy off by {:.2e}, {:.2e}; kinetic {:.2}", coarse.0, fine.0, fine.1);
    // Order 2: a ratio of 4. Measured: see the line above.
    assert!(fine.1 > 1.0 && (3.0..5.5).contains(&(coarse.0 / fine.0)));
    assert!(fine.0 < 1e-2 * fine.1);
}

/// Two molecules at rest distance: w² = E''/mu with E'' = 72 epsilon/(2^(1/3) sigma²) and mu = m1 m2/(m1 + m2).
#[test]
fn a_pair_of_molecules_swings_at_its_frequency() {
    let (epsilon, sigma, m) = (1.5, 0.3, [1.0, 3.0]);
    let rest = 2.0_f64.powf(1.0 / 6.0) * sigma;
    let omega = (72.0 * epsilon / (2.0_f64.cbrt() * sigma * sigma) / (m[0] * m[1] / (m[0] + m[1]))).sqrt();
    let swing = 1e-5 * sigma;
    let half = std::f64::consts::PI / omega;
    let x = [Vector::default(), vector(rest + swing, 0.0, 0.0)];
    let law = format!("kind = \"lennard_jones\"\nepsilon = {epsilon}\nsigma = {sigma}\nsmooth = false");
    let system = "integrator = \"dormand_prince\"\nadaptive = { tolerance = 1e-13, relative = 0 }";
    let mut sim = scene(system, half, &x, &[Vector::default(); 2], &m, &law);
    for turn in 1..=10 {
        step(&mut sim);
        let (x, v) = (positions(&sim, "a"), velocities(&sim, "a"));
        let (stretch, speed) = ((x[1] - x[0]).norm() - rest, (v[1] - v[0]).norm());
        let side = if turn % 2 == 1 { -1.0 } else { 1.0 };
        // The well is lopsided: E'''/E'' = -21/r0, so that amplitudes differ by 21/(6 r0) 2 swing of swing: 6e-5.
        assert!((stretch / swing * side - 1.0).abs() < 2e-4, "{turn}: {:e}", stretch / swing * side - 1.0);
        // A frequency off by 1e-6 would show as 1e-6 pi turn.
        assert!(speed / (swing * omega) < 1e-6 * turn as f64 + 1e-6, "{turn}: {:e}", speed / (swing * omega));
    }
}

/// At its cutoff a smooth force ends as E''(r_c) (r - r_c), the plain one with E'(r_c).
#[test]
fn a_smooth_force_ends_with_zero() {
    let (epsilon, sigma, cutoff) = (2.0_f64, 0.12_f64, 0.3_f64);
    let s6 = (sigma / cutoff).powi(6);
    let slope = 24.0 * epsilon * (s6 - 2.0 * s6 * s6) / cutoff;
    let bend = 24.0 * epsilon * (26.0 * s6 * s6 - 7.0 * s6) / (cutoff * cutoff);
    let before = 1e-4 * cutoff;
    let pull = |smooth: bool, r: f64| {
        let law = format!("kind = \"lennard_jones\"\nepsilon = {epsilon}\nsigma = {sigma}\ncutoff = {cutoff}\nsmooth = {smooth}");
        forces(&[Vector::default(), vector(r, 0.0, 0.0)], &[Vector::default(); 2], &[1.0; 2], &law)[0].x
    };
    let (smooth, plain) = (pull(true, cutoff - before), pull(false, cutoff - before));
    println!("smooth {:.5}, plain {:.5} of what they should be", smooth / (-bend * before), plain / slope);
    // The next term of the series is E''' before²/2 with E'''/E'' about -8/r_c: 4e-4 of the first, and 7e-4 of E'.
    assert!((smooth / (-bend * before) - 1.0).abs() < 1e-3);
    assert!((plain / slope - 1.0).abs() < 1e-3);
    assert!(slope.abs() > 100.0 * (bend * before).abs());
    assert_eq!([pull(true, cutoff + before), pull(false, cutoff + before)], [0.0, 0.0]);
}

#[test]
fn what_is_in_one_place_does_not_push_itself() {
    let x = [vector(1.0, 2.0, 3.0), vector(1.0, 2.0, 3.0), vector(1.0, 2.0, 3.25)];
    for (law, _) in LAWS {
        let f = forces(&x, &[Vector::default(), Vector::default(), vector(0.0, 0.0, 1.0)], &[1.0; 3], law);
        assert!(f.iter().all(|f| f.norm().is_finite()), "{law}");
        assert!((f[0] - f[1]).norm() == 0.0 && f[2].norm() > 0.0, "{law}: {f:?}");
    }
}

#[test]
fn some_feel_others_that_do_not_feel_them() {
    let sim = |words: &str| {
        let mut sim = simulation(&format!(
            "time.fps = 10\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"velocity_verlet\"\nsubsteps = 10\n\
             [[particles]]\nname = \"a\"\nposition = [[0, 0, 0], [0.3, 0, 0]]\n\
             [[particles]]\nname = \"b\"\nposition = [[0.1, 0, 0]]\n\
             [[force]]\nkind = \"cohesion\"\nstrength = 1\nradius = 0.5\n{words}\n"
        ));
        step(&mut sim);
        [velocities(&sim, "a"), velocities(&sim, "b")].concat()
    };
    let alone = sim("on = [\"a\"]");
    assert!(alone[0].x > 0.0 && alone[1].x < 0.0 && alone[2].norm() == 0.0);
    let hunted = sim("on = [\"a\"]\nfrom = [\"b\"]");
    // Each of a is pulled by b alone: the near one forward, the far one back, and b stays.
    assert!(hunted[0].x > 0.0 && hunted[1].x < 0.0 && hunted[2].norm() == 0.0 && hunted[0].x != alone[0].x);
    let all = sim("on = [\"a\", \"b\"]\nfrom = [\"a\", \"b\"]");
    assert_eq!(all, sim(""));
    assert!(all[2].norm() > 0.0);
}

/// Implicit schemes see the right matrix: Newton's method settles, and finds what small explicit steps find.
#[test]
fn implicit_schemes_run_pairs() {
    let (x, v, mass) = cloud(40, 1.0);
    for (law, _) in [LAWS[0], LAWS[2], LAWS[3], LAWS[4], LAWS[5]] {
        let end = |system: &str| {
            let mut sim = scene(system, 0.004, &x, &v, &mass, law);
            let report = step(&mut sim);
            assert_eq!(report.unconverged, 0, "{law}");
            positions(&sim, "a")
        };
        let right = end("integrator = \"rk4\"\nsubsteps = 200");
        for linear in ["pcg", "cholesky"] {
            let solver = format!("solver = {{ hessian = \"exact\", linear = \"{linear}\" }}");
            let off = |n: usize| {
                let x = end(&format!("integrator = \"implicit_midpoint\"\nsubsteps = {n}\n{solver}"));
                x.iter().zip(&right).map(|(a, b)| (*a - *b).norm()).fold(0.0, f64::max)
            };
            let (coarse, fine) = (off(10), off(20));
            println!("{law:?} {linear}: {coarse:.1e} {fine:.1e}");
            assert!((3.0..5.0).contains(&(coarse / fine)) || coarse < 1e-12, "{law}: {coarse:e} {fine:e}");
        }
    }
}
