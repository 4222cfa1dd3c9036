//! The largest step that `tumble check` predicts, against the largest one found by bisection, on a stiff sheet.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, simulation, step, vector, velocities, write};
use std::f64::consts::PI;
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;
use tumble_interface::engine::BLOW_UP;
use tumble_interface::scene::Integrator;

fn sheet(scheme: Integrator, h: f64, damping: f64) -> Simulation {
    simulation(&format!(
        "time.fps = {:e}\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"{}\"\nsubsteps = 1\n\
         [[sheet]]\nname = \"sheet\"\nsize = [1, 1]\nresolution = [8, 8]\npin = [\"corner 0 0\", \"corner 1 0\"]\n\
         links = {{ structural = {{ modulus = 5000, damping = {:e} }}, shear = {{ modulus = 2000, damping = {:e} }}, bend = {{ modulus = 200, damping = {:e} }} }}\n",
        1.0 / h,
        scheme.name(),
        5000.0 * damping,
        2000.0 * damping,
        200.0 * damping
    ))
}

/// The shape of the stiffest mode: symplectic Euler just beyond its limit lets it grow above all others, because
/// |growth| rises with w.
fn stiffest_shape(frequency: f64) -> Vec<Vector> {
    let mut sim = sheet(Integrator::SymplecticEuler, 2.02 / frequency, 0.0);
    let mut v: Vec<Vector> = (0..64).map(|i| vector((i as f64).sin(), (1.7 * i as f64).cos(), 0.0) * 1e-9).collect();
    let rest = positions(&sim, "sheet");
    // Twelve steps multiply its energy by a hundred, which is no explosion yet.
    for _ in 0..40 {
        write(&mut sim, "sheet", "velocity", &v);
        write(&mut sim, "sheet", "position", &rest);
        for _ in 0..12 {
            step(&mut sim);
        }
        v = velocities(&sim, "sheet");
        let size = v.iter().map(|v| v.norm_sq()).sum::<f64>().sqrt();
        v.iter_mut().for_each(|v| *v = *v * (1e-9 / size));
    }
    v
}

/// Whether the energy of that mode stays below 1000 times its start for 100 of its periods.
fn usable(scheme: Integrator, h: f64, frequency: f64, damping: f64, shape: &[Vector]) -> bool {
    let mut sim = sheet(scheme, h, damping);
    write(&mut sim, "sheet", "velocity", shape);
    let start = sim.ledger().energy();
    let steps = (200.0 * PI / (frequency * h)).ceil() as usize;
    for _ in 0..steps {
        if sim.step(&|| true).is_err() {
            return false;
        }
        let books = sim.ledger();
        // Energy in the mode: what moves and what is stretched.
        let energy = books.energy();
        if energy.is_nan() || energy >= BLOW_UP * start {
            return false;
        }
    }
    true
}

#[test]
fn the_predicted_step_is_the_measured_one() {
    let frequency = sheet(Integrator::Rk4, 1e-4, 0.0).stability(&|| true)[0].frequency;
    let shape = stiffest_shape(frequency);
    // b = 2e-5 s k: forward Euler is then stable up to h = b/k, because c = 2e-5 s w² for every mode. (integrators.31)
    for (scheme, damping) in [
        (Integrator::SymplecticEuler, 0.0),
        (Integrator::Verlet, 0.0),
        (Integrator::VelocityVerlet, 0.0),
        (Integrator::Rk4, 0.0),
        (Integrator::Midpoint, 0.0),
        (Integrator::Heun, 0.0),
        (Integrator::ForwardEuler, 2e-5),
        (Integrator::SymplecticEuler, 2e-4),
        (Integrator::Verlet, 2e-5),
    ] {
        let predicted = sheet(scheme, 1e-4, damping).stability(&|| true)[0].limit(scheme).unwrap().usable;
        let (mut low, mut high) = (0.7 * predicted, 1.4 * predicted);
        let fine = |h: f64| usable(scheme, h, frequency, damping, &shape);
        assert!(fine(low) && !fine(high), "{}: the limit is not near {predicted:e}", scheme.name());
        for _ in 0..9 {
            let middle = 0.5 * (low + high);
            if fine(middle) { low = middle } else { high = middle }
        }
        let measured = 0.5 * (low + high);
        println!(
            "{:18} b/k = {damping:.0e} s: predicted {predicted:.4e} s (w h = {:.4}), measured {measured:.4e} s, {:+.2} %",
            scheme.name(),
            predicted * frequency,
            100.0 * (predicted / measured - 1.0)
        );
        // Measured: within 0.13 %, the width of the last interval of the bisection.
        assert!((predicted / measured - 1.0).abs() < 0.05);
    }
}

/// Springs of the same frequency, all but one damped: the stiffest mode is any mixture of them, and the undamped one alone
/// says what forward Euler can take, which is nothing.
#[test]
fn of_modes_of_one_frequency_the_least_damped_limits() {
    let pair = |i: usize, damping: f64| {
        format!(
            "[[particles]]\nname = \"p{i}\"\nposition = [[0, 0, 0], [1, 0, 0]]\npin = [\"vertex 0\"]\n\
             spring = [{{ between = [0, 1], stiffness = 100, damping = {damping}, rest_length = 1 }}]\n"
        )
    };
    let head = "time.fps = 100\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"forward_euler\"\nsubsteps = 1\n";
    let of = |damping: &[f64]| {
        let text = head.to_string() + &(0..).zip(damping).map(|(i, d)| pair(i, *d)).collect::<String>();
        let limit = simulation(&text).stability(&|| true)[0].limit(Integrator::ForwardEuler).unwrap();
        (limit.stable, limit.usable)
    };
    // Damped alone: stable below c/w² = 4/100 s. Together: as the undamped one alone, w h = 0.0110 (integrators.35).
    let (damped, mixed, undamped) = (of(&[4.0]), of(&[4.0, 4.0, 4.0, 0.0, 4.0, 4.0, 4.0]), of(&[0.0]));
    println!("stable and usable: damped {damped:?}, mixed {mixed:?}, undamped {undamped:?}");
    assert!((damped.0 - 0.04).abs() < 1e-6);
    assert!(undamped.0 == 0.0 && (undamped.1 - 0.0110 / 10.0).abs() < 1e-5);
    assert!((mixed.1 / undamped.1 - 1.0).abs() < 0.02 && mixed.0 < 0.02 * damped.0);
}

#[test]
fn an_estimate_ends_when_it_is_told_to() {
    let scene = "[[system]]\nname = \"explicit\"\n[[rope]]\nname = \"rope\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 40\n";
    let mut sim = simulation(scene);
    assert_eq!(sim.stability(&|| true).len(), 1);
    assert!(sim.stability(&|| false).is_empty());
}
