//! Internal damping resists lengthening and nothing else; viscous damping resists every motion. See docs/theory/springs.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Numbers, Vector, fixed, list, positions, run, simulation, slope, step, vector, velocities, write, zeros};
use std::f64::consts::PI;
use tumble_f64::reference::Oscillator;
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;
use tumble_interface::scene::Integrator;

const MASSES: [f64; 2] = [0.4, 0.6];
/// Reduced mass [kg].
const M: f64 = 0.24;
const K: f64 = 30.0;

fn direction() -> Vector {
    vector(2.0, -1.0, 2.0) * (1.0 / 3.0)
}

/// Two masses on a spring of rest length 1 m along a slanted line, stretched by 0.1 m.
fn pair(system: &str, damping: f64, gravity: f64, rest: &str) -> Simulation {
    simulation(&format!(
        "time.fps = 100\nworld.gravity = [0, 0, {}]\n[[system]]\n{system}\n\
         [[particles]]\nname = \"p\"\nposition = {}\nmass = {MASSES:?}\n\
         spring = [{{ between = [0, 1], stiffness = {K}, damping = {damping}, rest_length = 1.0 }}]\n{rest}",
        -gravity,
        list(&[vector(0.0, 0.0, 0.0), direction() * 1.1]),
    ))
}

/// Lengthening and its rate.
fn stretch(sim: &Simulation) -> (f64, f64) {
    let (x, v) = (positions(sim, "p"), velocities(sim, "p"));
    let d = x[1] - x[0];
    (d.norm() - 1.0, d.normalized().dot(v[1] - v[0]))
}

/// Centre of mass and its velocity.
fn center(sim: &Simulation) -> (Vector, Vector) {
    let mean = |c: Vec<Vector>| c[0] * MASSES[0] + c[1] * MASSES[1];
    (mean(positions(sim, "p")), mean(velocities(sim, "p")))
}

/// r'' + b/M r' + k/M r = 0                                             (springs.14)
#[test]
fn a_pair_oscillates_and_decays_as_the_damped_oscillator() {
    for b in [0.1, 0.5, 3.0] {
        let exact = Oscillator::new(M, K, b, 0.1, 0.0);
        for scheme in [
            Integrator::SymplecticEuler,
            Integrator::Midpoint,
            Integrator::Heun,
            Integrator::Rk4,
            Integrator::Verlet,
            Integrator::VelocityVerlet,
            Integrator::ImplicitMidpoint,
            Integrator::Bdf2,
        ] {
            // Phases err by (w h)²/24 to (w h)²/3 of themselves, rates by c h/2 (symplectic Euler: its determinant is 1 - c h) or
            // (w h)² w/c: with h = 1e-4 all below 6.3e-4, 5e-4 where c h/2 is largest.
            let mut sim = pair(&format!("integrator = \"{}\"\nsubsteps = 100", scheme.name()), b, 9.8, "");
            let mut samples = Vec::new();
            for frame in 0..250 {
                let (r, speed) = stretch(&sim);
                samples.push((0.01 * f64::from(frame), r, speed));
                step(&mut sim);
            }
            let zeros = zeros(&samples);
            let n = zeros.len() - 1;
            let frequency = PI * n as f64 / (zeros[n].0 - zeros[0].0);
            let logs: Vec<(f64, f64)> = zeros.iter().map(|(t, s)| (*t, s.abs().ln())).collect();
            let rate = -2.0 * slope(&logs);
            let (off_f, off_c) = (frequency / exact.damped_frequency() - 1.0, rate / exact.damping - 1.0);
            println!("b = {b} {:18} frequency {:+.1e}, rate {:+.1e} off over {n} half-periods", scheme.name(), off_f, off_c);
            // Measured: rates 6.3e-4 off for symplectic Euler with b = 3, all others below 1.3e-4.
            assert!(n >= 6);
            assert!(off_f.abs() < 1e-3, "{frequency} against {}", exact.damped_frequency());
            assert!(off_c.abs() < 1e-3, "{rate} against {}", exact.damping);
        }
    }
}

/// Falls like a stone: the centre of mass does not feel what the spring does.        (springs.13)
#[test]
fn a_rusty_spring_falls_like_a_new_one() {
    for scheme in fixed() {
        let system =
            format!("integrator = \"{}\"\nsubsteps = 10\nsolver.newton_tolerance = 1e-13\nsolver.linear_tolerance = 1e-9", scheme.name());
        let mut free = pair(&system, 0.0, 9.8, "");
        let mut rusty = pair(&system, 2.0, 9.8, "");
        run(&mut free, 100);
        run(&mut rusty, 100);
        let ((a, va), (b, vb)) = (center(&free), center(&rusty));
        let off = (a - b).norm().max((va - vb).norm());
        let oscillation = |sim: &Simulation| stretch(sim).0.hypot(stretch(sim).1 / 11.18);
        println!(
            "{:18} centres differ by {off:.1e} m; oscillation {:.1e} m new, {:.1e} m rusty",
            scheme.name(),
            oscillation(&free),
            oscillation(&rusty)
        );
        // Round-off of 1000 steps on numbers up to 10 m/s; Verlet's velocities are differences of positions over 1 ms: 1e-12.
        // What Newton's method leaves of the residual, 1e-13 of m g a step, adds up to 1e-11.
        // Measured: 2.7e-12 (Verlet), 1.6e-14 (all others).
        let bound = if scheme == Integrator::Verlet || scheme.is_implicit() { 2e-11 } else { 2e-13 };
        assert!(off < bound, "{off:e}");
        // It fell by g t²/2, to first order in h, and the rusty one has stopped to oscillate: e^(-b t/2M) = 0.016.
        let fall = center(&rusty).0.z - (direction() * 1.1 * 0.6).z;
        assert!((fall + 4.9).abs() < 0.006, "{fall}");
        assert!(oscillation(&rusty) < 0.003);
        assert!(oscillation(&free) > 0.03 || scheme == Integrator::ImplicitEuler);
    }
}

/// V' = g - rate V: through honey.                                      (springs.15)
#[test]
fn viscous_damping_slows_the_fall() {
    let rate: f64 = 2.0;
    let drag = format!("[[force]]\nkind = \"drag\"\nrate = {rate}\n");
    let mut sim = pair("integrator = \"rk4\"\nsubsteps = 4", 0.0, 9.8, &drag);
    run(&mut sim, 100);
    let (x, v) = center(&sim);
    let exact = -9.8 / rate * (1.0 - (-rate).exp());
    let depth = -9.8 / rate * (1.0 - (1.0 - (-rate).exp()) / rate) + (direction() * 1.1 * 0.6).z;
    println!("drag: speed {:.6} ({exact:.6}), height {:.6} ({depth:.6})", v.z, x.z);
    // RK4 with rate h = 0.005: (rate h)^4/120 of itself.
    assert!((v.z - exact).abs() < 1e-9 && (x.z - depth).abs() < 1e-9);
    assert!(v.z > -9.8 * 0.5, "much slower than in free fall");
    // The oscillation decays with c = rate: e^(-1) in 1 s, where r'' + rate r' + k/M r = 0.
    let (r, speed) = stretch(&sim);
    let (er, ev) = Oscillator { frequency: (K / M).sqrt(), damping: rate, x0: 0.1, v0: 0.0 }.at(1.0);
    assert!((r - er).abs() < 1e-6 && (speed - ev).abs() < 1e-5, "{r} {er} {speed} {ev}");
    // A coefficient acts on each mass alike, so the lighter one is slowed more.
    let mut sim = pair("integrator = \"rk4\"", 0.0, 0.0, "[[force]]\nkind = \"drag\"\ncoefficient = 0.3\n");
    write(&mut sim, "p", "position", &[vector(0.0, 0.0, 0.0), direction()]);
    let across = vector(0.0, 2.0, 1.0) * (1.0 / 5.0_f64.sqrt());
    write(&mut sim, "p", "velocity", &[across; 2]);
    step(&mut sim);
    let v = velocities(&sim, "p");
    for i in 0..2 {
        let expected = (-0.3 / MASSES[i] * 0.01).exp();
        // The masses part by 1e-5 m in that time, and the spring pulls them by 1e-9.
        assert!((v[i].dot(across) - expected).abs() < 1e-7, "{} {expected}", v[i].dot(across));
    }
}

/// Objects with internal damping of every kind, at rest in shape.
fn damped_things(scheme: Integrator) -> Simulation {
    simulation(&format!(
        "time.fps = 1000\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"{}\"\nsubsteps = 1\n\
         [[sheet]]\nname = \"sheet\"\nsize = [1.0, 0.8]\nresolution = [6, 5]\nrotate = [20, 30, 40]\nhinge = 0.02\n\
         links = {{ structural = {{ modulus = 40, damping = 2 }}, shear = {{ modulus = 15, damping = 1 }}, bend = {{ modulus = 2, damping = 1 }} }}\n\
         [[block]]\nname = \"jelly\"\nsize = [0.4, 0.3, 0.3]\nresolution = [4, 3, 3]\ncenter = [0, 0, 1]\ndensity = 50\nmaterial = {{ young = 500, poisson = 0.4, damping = 0.1 }}\n\
         [[rope]]\nname = \"rope\"\nfrom = [1, 0, 0]\nto = [2, 0.3, 0]\nsegments = 8\nlinks = {{ structural = {{ modulus = 20, damping = 2, hardening = 3 }} }}\n\
         [[particles]]\nname = \"p\"\nposition = [[3, 0, 0], [3.5, 0.2, 0]]\nspring = [{{ between = [0, 1], stiffness = 0, rest_length = 0, damping = 5 }}]\n",
        scheme.name()
    ))
}

const THINGS: [&str; 4] = ["sheet", "jelly", "rope", "p"];

/// Largest change of a velocity in one step of forward Euler from a given field of velocities.
fn kick(field: impl Fn(Vector) -> Vector) -> f64 {
    let mut sim = damped_things(Integrator::ForwardEuler);
    let before: Vec<Vec<Vector>> = THINGS.iter().map(|name| positions(&sim, name).iter().map(|x| field(*x)).collect()).collect();
    for (name, v) in THINGS.iter().zip(&before) {
        write(&mut sim, name, "velocity", v);
    }
    step(&mut sim);
    let change = |name: &str, v: &Vec<Vector>| velocities(&sim, name).iter().zip(v).map(|(a, b)| (*a - *b).norm()).fold(0.0, f64::max);
    THINGS.iter().zip(&before).map(|(name, v)| change(name, v)).fold(0.0, f64::max)
}

#[test]
fn internal_damping_leaves_rigid_motion_alone() {
    let (shift, spin) = (vector(1.0, -2.0, 0.5), vector(0.7, 1.1, -0.4));
    let translation = kick(|_| shift);
    let rotation = kick(|x| shift + spin.cross(x));
    let mut numbers = Numbers(9);
    let noise: Vec<Vector> = (0..200).map(|_| numbers.vector()).collect();
    let mut i = 0;
    let shaken = std::cell::RefCell::new(&mut i);
    let deformation = kick(|_| {
        let mut i = shaken.borrow_mut();
        **i += 1;
        noise[**i % 200]
    });
    println!("velocities change by {translation:.1e} (translation), {rotation:.1e} (rotation), {deformation:.1e} m/s (deformation)");
    // Round-off of velocities of 5 m/s, times b h/m <= 10. Measured: 7.0e-16, 4.4e-16, 2.5.
    assert!(translation < 1e-13 && rotation < 1e-13);
    assert!(deformation > 1.0);
}

/// A pair that spins so fast that the spring is held stretched: k (d - l) = M w² d. Internal damping takes nothing.
#[test]
fn a_spinning_pair_keeps_its_energy() {
    let spin = 4.0;
    let d = K / (K - M * spin * spin);
    let energies = |damping: f64, rest: &str| {
        let mut sim = pair("integrator = \"rk4\"\nsubsteps = 20", damping, 0.0, rest);
        let across = vector(1.0, 2.0, 0.0) * (1.0 / 5.0_f64.sqrt());
        write(&mut sim, "p", "position", &[direction() * (-d * 0.6), direction() * (d * 0.4)]);
        write(&mut sim, "p", "velocity", &[across * (-d * 0.6 * spin), across * (d * 0.4 * spin)]);
        let start = sim.ledger().energy();
        run(&mut sim, 400);
        (sim.ledger().energy() / start - 1.0, stretch(&sim).0 - (d - 1.0))
    };
    let (change, off) = energies(3.0, "");
    let (dragged, _) = energies(0.0, "[[force]]\nkind = \"drag\"\nrate = 0.2\n");
    println!("spinning for 4 s: energy {change:+.1e} with internal damping, {dragged:+.2} with drag; length off by {off:.1e}");
    // RK4 with w h = 0.002 turns by a relative (w h)^4/120 = 1e-13 too little a step; 8000 steps. Measured: -1.2e-14, 1.1e-12 m.
    assert!(change.abs() < 1e-11 && off.abs() < 1e-11, "{change:e} {off:e}");
    assert!(dragged < -0.4);
}
