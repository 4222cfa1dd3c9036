//! Stable Fluids in double precision: docs/theory/gas.md.

extern crate tumble_f64 as tumble;

mod common;

use common::{orders, run, show, simulation, slope, step};
use std::f64::consts::PI;
use tumble_f64::scene::Simulation;
use tumble_interface::{Data, Engine};

/// A column of a grid, and its points along each axis.
fn grid(sim: &Simulation, object: &str, name: &str) -> (Vec<f64>, Vec<usize>) {
    let frame = sim.frame(&[name]);
    let column = frame.column(object, name).unwrap_or_else(|| panic!("no {name} of {object}"));
    match &column.data {
        Data::F64(numbers) => (numbers.clone(), column.points.clone()),
        other => panic!("{object}.{name} is {other:?}"),
    }
}

fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().fold(0.0, |most, x| x.abs().max(most))
}

/// Root mean square of the differences.
fn rms(a: &[f64], b: impl Fn(usize) -> f64) -> f64 {
    (a.iter().enumerate().map(|(i, a)| (a - b(i)).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
}

/// Largest |div u| dx over the fastest component.
fn divergence(sim: &Simulation, dx: f64) -> f64 {
    let speed = ["velocity_x", "velocity_z"].map(|name| largest(&grid(sim, "air", name).0));
    largest(&grid(sim, "air", "divergence").0) * dx / speed[0].max(speed[1])
}

/// Error of a Taylor-Green vortex on n x n cells after it has decayed to exp(-0.4 pi²) of itself at Re = 10, over its first speed.
fn taylor_green(n: usize, courant: f64, words: &str) -> f64 {
    // u = sin(2 pi x) cos(2 pi z), w = -cos(2 pi x) sin(2 pi z) decays as exp(-8 pi² nu t).
    let steps = (0.5 * n as f64 / courant).round();
    let mut sim = simulation(&format!(
        r#"
dimension = 2
time = {{ fps = 2, frames = 1 }}
[[system]]
method = "gas"
substeps = {steps}
[[gas]]
name = "air"
box = {{ size = [1, 1, 1], center = [0.5, 0, 0.5], resolution = {n} }}
sides = {{ x = ["periodic", "periodic"], z = ["periodic", "periodic"] }}
fluid_density = 1.0
viscosity = 0.01
velocity = ["sin(2*pi*x)*cos(2*pi*z)", 0, "-cos(2*pi*x)*sin(2*pi*z)"]
{words}
"#
    ));
    let before = sim.ledger();
    assert!((before.kinetic - 0.25).abs() < 1e-9, "{}", before.kinetic);
    step(&mut sim);
    assert!(divergence(&sim, 1.0 / n as f64) < 1.01e-10);
    let decay = (-8.0 * PI * PI * 0.01 * 0.5_f64).exp();
    let (u, points) = grid(&sim, "air", "velocity_x");
    assert_eq!(points, [n, n]);
    let (x, z) = (|i: usize| (i % n) as f64 / n as f64, |i: usize| ((i / n) as f64 + 0.5) / n as f64);
    rms(&u, |i| decay * (2.0 * PI * x(i)).sin() * (2.0 * PI * z(i)).cos())
}

#[test]
fn a_taylor_green_vortex_decays() {
    for (name, words) in [
        ("linear", ""),
        ("corrected", "advection = { velocity = { corrected = true } }"),
        ("cubic", "advection = { velocity = { interpolation = \"cubic\" } }"),
        ("cubic rk3", "advection = { velocity = { interpolation = \"cubic\", trace = \"rk3\" } }"),
        ("explicit", "viscous = \"explicit\""),
    ] {
        let errors: Vec<f64> = [16, 32, 64].map(|n| taylor_green(n, 0.5, words)).to_vec();
        println!("{name}: errors {} orders {}", show(&errors), show(&orders(&errors)));
    }
}

fn channel(extra: &str, frames: usize) -> Simulation {
    let mut sim = simulation(&format!(
        r#"
dimension = 2
time = {{ fps = 1, frames = 100 }}
[[system]]
method = "gas"
substeps = 4
[[gas]]
name = "air"
box = {{ size = [0.25, 1, 1], center = [0, 0, 0.5], resolution = 32 }}
fluid_density = 2.0
viscosity = 0.1
{extra}
"#
    ));
    run(&mut sim, frames);
    sim
}

#[test]
fn poiseuille_and_couette_reach_their_profiles() {
    // u = a z (1 - z)/(2 nu), exact for second differences but for the walls: ghosts make a z dz/... of second order.
    let sim = channel("sides = { x = [\"periodic\", \"periodic\"], z = [\"no_slip\", \"no_slip\"] }\nacceleration = [0.05, 0, 0]", 60);
    let (u, points) = grid(&sim, "air", "velocity_x");
    let z = |i: usize| ((i / points[0]) as f64 + 0.5) / 32.0;
    let error = u.iter().enumerate().map(|(i, u)| (u - 0.05 * z(i) * (1.0 - z(i)) / (2.0 * 0.05)).abs()).fold(0.0, f64::max);
    println!("poiseuille {error:e} of {}", largest(&u));
    let sim = channel("sides = { x = [\"periodic\", \"periodic\"], z = [\"no_slip\", { wall = { velocity = [0.3, 0, 0] } }] }", 60);
    let (u, _) = grid(&sim, "air", "velocity_x");
    let error = u.iter().enumerate().map(|(i, u)| (u - 0.3 * z(i)).abs()).fold(0.0, f64::max);
    println!("couette {error:e}");
}
