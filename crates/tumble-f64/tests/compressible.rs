//! The gas whose pressure follows from its density, against acoustics and its own limits.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{run, simulation, step};
use std::f64::consts::PI;
use tumble_f64::scene::Simulation;
use tumble_f64::state::{Field, Grid, Place, Vectors};
use tumble_f64::systems::compressible::{Fluid, Gas};
use tumble_interface::{Data, Engine};

const C: f64 = 3.0;

fn scene(dt: f64, system: &str, dimension: u32, words: &str) -> Simulation {
    simulation(&format!(
        "dimension = {dimension}\nplane = \"xy\"\ntime.fps = {:e}\nworld.gravity = [0, 0, 0]\n[[system]]\nname = \"s\"\nmethod = \"compressible\"\n\
         {system}\n[[compressible]]\nname = \"g\"\nsound_speed = {C}\ndensity = 1.2\n{words}\n",
        1.0 / dt
    ))
}

fn numbers(sim: &Simulation, column: &str) -> Vec<f64> {
    match &sim.frame(&[column]).column("g", column).unwrap().data {
        Data::F64(numbers) => numbers.clone(),
        other => panic!("{other:?}"),
    }
}

/// A standing wave in a closed tube of 1 m: the part that is left of cos(pi x) after so many steps of 1/4 of its period 2/c.
fn tube(n: usize, steps: u32, periods: f64) -> f64 {
    let words = format!(
        "box = {{ size = [1, {:e}, 1], center = [0.5, 0, 0], resolution = {n} }}\ninitial_density = \"1.2*(1 + 1e-6*cos(pi*x))\"",
        1.0 / n as f64
    );
    let mut sim = scene(periods * 2.0 / C, &format!("substeps = {steps}"), 2, &words);
    step(&mut sim);
    let mode: Vec<f64> = (0..n).map(|i| (PI * (i as f64 + 0.5) / n as f64).cos()).collect();
    let p = numbers(&sim, "density");
    p.iter().zip(&mode).map(|(rho, m)| (rho - 1.2) * m).sum::<f64>() / mode.iter().map(|m| m * m).sum::<f64>() / 1.2e-6
}

#[test]
fn sound_stands_in_a_tube_with_its_frequency() {
    // A quarter of a period after 5 whole ones the wave is flat: what is left is -2 pi times the error of the phase.
    let errors: Vec<f64> = [16, 32, 64].iter().map(|n| tube(*n as usize, n * 21, 5.25)).collect();
    // Half a step of velocity against density: the wave goes through zero h/2 late in these units, an order 1 of the start.
    let phases: Vec<f64> = errors.iter().map(|e| e / (2.0 * PI * 5.25)).collect();
    println!("{phases:?}");
    // c h/dx = 2/4 at every n; measured -2.8e-4, -4.4e-4, -3.0e-4.
    assert!(phases[2].abs() < 1e-3, "{phases:?}");
    // After whole periods the phase enters squared and only what is damped or blown up shows: nothing is.
    let left = tube(32, 32 * 20, 5.0);
    println!("left {left:.6}");
    // Measured 1.000187.
    assert!((left - 1.0).abs() < 1e-3, "{left}");
}

#[test]
fn its_frequency_is_that_of_leapfrog_and_converges_with_order_two() {
    // sin(w h/2) = (c h/dx) sin(k dx/2): the period from zero crossings of the mode.
    let found = |n: usize| {
        let grid = Grid::new([n, 1, 1], 1.0 / n as f64, [0.0; 3]).unwrap();
        let rho = Field::of(grid, Place::Cell, "kg/m³", |x| 1.2 * (1.0 + 1e-7 * (PI * x[0]).cos())).unwrap();
        let fluid = Fluid { sound_speed: C, density: 1.2, viscosity: 0.0, gravity: [0.0; 3] };
        let mut gas = Gas::new("g".into(), fluid, rho, Vectors::faces(grid, "m/s").unwrap()).unwrap();
        let h = 0.5 * grid.dx / C;
        let (mut crossings, mut last) = (Vec::new(), 1.0);
        for step in 1..200 * n {
            gas.step(h).unwrap();
            let now = gas.density.each().map(|at| (gas.density.value(at) - 1.2) * (PI * grid.point(Place::Cell, at)[0]).cos()).sum::<f64>();
            if (now > 0.0) != (last > 0.0) && last != 1.0 {
                crossings.push(h * (step as f64 - now / (now - last)));
            }
            last = now;
            if crossings.len() == 21 {
                break;
            }
        }
        PI / ((crossings[20] - crossings[0]) / 20.0)
    };
    let mut errors = Vec::new();
    for n in [8, 16, 32] {
        let (w, dx) = (found(n), 1.0 / n as f64);
        let h = 0.5 * dx / C;
        let exact = 2.0 / h * (0.5 * (PI * dx / 2.0).sin()).asin();
        println!("{n}: {w:.6} rad/s, leapfrog {exact:.6}, sound {:.6}", PI * C);
        // Straight lines between two steps place the crossings; measured 2e-6 and less.
        assert!((w / exact - 1.0).abs() < 1e-4, "{w} {exact}");
        errors.push((w / (PI * C) - 1.0).abs());
    }
    let orders: Vec<f64> = errors.windows(2).map(|e| (e[0] / e[1]).log2()).collect();
    println!("{errors:?} {orders:?}");
    assert!(orders.iter().all(|o| (o - 2.0).abs() < 0.2), "{orders:?}");
}

/// Whether what is small stays small: a joined box with noise.
fn stays(n: [usize; 3], flow: [f64; 3], viscosity: f64, part: f64) -> (f64, bool) {
    let grid = Grid::new(n, 0.1, [0.0; 3]).unwrap().periodic([true; 3]);
    let noise = |at: [usize; 3]| ((at[0] * 7919 + at[1] * 104_729 + at[2] * 1_299_709 + 12345) % 1013) as f64 / 1013.0 - 0.5;
    let mut rho = Field::new(grid, Place::Cell, "kg/m³").unwrap();
    for at in rho.each() {
        let i = rho.index(at);
        rho.data[i] = 1.2 * (1.0 + 1e-9 * noise(at));
    }
    let u = Vectors::of(grid, "m/s", |_| flow).unwrap();
    let fluid = Fluid { sound_speed: C, density: 1.2, viscosity, gravity: [0.0; 3] };
    let mut gas = Gas::new("g".into(), fluid, rho, u).unwrap();
    let limit = gas.limit();
    let size = |gas: &Gas| gas.density.each().map(|at| (gas.density.value(at) / 1.2 - 1.0).abs()).fold(0.0, f64::max);
    let before = size(&gas);
    for _ in 0..400 {
        gas.step(part * limit).unwrap();
        if size(&gas).is_nan() || size(&gas) >= 100.0 * before {
            return (limit, false);
        }
    }
    (limit, true)
}

#[test]
fn the_largest_step_is_the_predicted_one_in_one_two_and_three_dimensions() {
    for d in 1..=3 {
        let n: [usize; 3] = std::array::from_fn(|a| if a < d { 8 } else { 1 });
        let flows = [([0.0; 3], 0.0), ([1.0, 0.0, 0.0], 0.0), ([-0.8, 0.7, 0.6], 0.0), ([0.0; 3], 0.2), ([1.0, 0.5, 0.0], 0.1)];
        // Faster than sound, too.
        for (flow, viscosity) in flows.into_iter().chain([([5.0, 0.0, 0.0], 0.0)]) {
            let flow = std::array::from_fn(|a| if a < d { flow[a] } else { 0.0 });
            // The largest part of the predicted step at which nothing grows.
            let (mut low, mut high) = (0.5, 1.5);
            for _ in 0..9 {
                let middle = 0.5 * (low + high);
                if stays(n, flow, viscosity, middle).1 { low = middle } else { high = middle }
            }
            let (limit, _) = stays(n, flow, viscosity, 0.5);
            println!("{d}D, flow {flow:?}, viscosity {viscosity}: predicted {limit:.5} s, measured {:.3} of that", low);
            if flow == [0.0; 3] && viscosity == 0.0 {
                assert!((C * limit * (d as f64).sqrt() / 0.1 - 1.0).abs() < 1e-12, "{limit}");
            }
            // Measured 1.000 to 1.008: what grows by less than 100 in 400 steps does not show.
            assert!((low - 1.0).abs() < 0.02, "{d} {flow:?} {viscosity}: {low}");
        }
    }
}

#[test]
fn where_some_air_rests_the_limit_is_that_of_rest() {
    // Damping by a flow allows longer steps, but only where there is flow.
    let grid = Grid::new([16, 16, 1], 0.1, [0.0; 3]).unwrap();
    let rho = Field::of(grid, Place::Cell, "kg/m³", |_| 1.2).unwrap();
    let u = Vectors::of(grid, "m/s", |x| [x[1].sin(), 0.0, 0.0]).unwrap();
    let gas = Gas::new("g".into(), Fluid { sound_speed: C, density: 1.2, viscosity: 0.0, gravity: [0.0; 3] }, rho, u).unwrap();
    assert!((C * gas.limit() * 2.0_f64.sqrt() / 0.1 - 1.0).abs() < 1e-12, "{}", gas.limit());
}

#[test]
fn no_wave_grows_at_the_predicted_step_and_one_does_beyond() {
    use tumble_f64::systems::compressible::Rates;
    // Waves one by one, by the matrix of a step on (u, rho c/rho0): the carried and what sound makes of it, in complex numbers.
    let times = |a: [f64; 2], b: [f64; 2]| [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
    let plus = |a: [f64; 2], b: [f64; 2]| [a[0] + b[0], a[1] + b[1]];
    for (d, flow, friction) in [(1, 0.4, 0.0), (2, 0.0, 0.1), (2, 0.3, 0.0), (2, 0.9, 0.2), (3, 0.2, 0.05), (3, 3.0, 0.0)] {
        let flow = std::array::from_fn(|a| if a < d { flow / (1.0 + a as f64) } else { 0.0 });
        let waves = std::array::from_fn(|a| if a < d { 12 } else { 1 });
        let limit = Rates { sound: 1.0, friction, flow, waves }.limit();
        let growth = |h: f64| {
            let mut most = 0.0_f64;
            for number in 0..12_usize.pow(d as u32) {
                let phase: [f64; 3] =
                    std::array::from_fn(|a| if a < d { (number / 12_usize.pow(a as u32) % 12) as f64 * PI / 6.0 } else { 0.0 });
                let mut carried = [1.0, 0.0];
                (0..3).for_each(|a| carried = plus(carried, [h * flow[a] * (phase[a].cos() - 1.0), -h * flow[a] * phase[a].sin()]));
                let s = 2.0 * h * phase.iter().map(|p| (p / 2.0).sin().powi(2)).sum::<f64>().sqrt();
                let kept = 1.0 - friction / h * s * s;
                // From a start that holds both waves.
                let (mut u, mut rho) = ([1.0, 0.3], [-0.2, 0.7]);
                for _ in 0..2000 {
                    u = times(carried, plus([kept * u[0], kept * u[1]], [s * rho[1], -s * rho[0]]));
                    rho = plus(times(carried, rho), [s * u[1], -s * u[0]]);
                }
                let size = |a: [f64; 2]| a[0].hypot(a[1]);
                most = most.max(size(u).max(size(rho)));
            }
            most
        };
        let (within, beyond) = (growth(0.999 * limit), growth(1.02 * limit));
        println!("{d}D: {limit:.4}: {within:.2e}, beyond {beyond:.2e}");
        // Measured 1.04, the start itself, and 1e34 to 1e185.
        assert!(within < 2.0 && (beyond >= 1e6 || beyond.is_nan()), "{d} {flow:?} {friction}: {within:e} {beyond:e}");
    }
}

const BLAST: &str = "box = { size = [1, 0.8, 0.7], resolution = 14 }\nviscosity = 0.01\n\
     initial_density = \"1.2 + 0.3*exp(-20*((x - 0.1)^2 + y^2 + z^2))\"\nvelocity = [0.3, \"0.2*x\", 0.1]\nperiodic = [true, false, false]";

#[test]
fn mass_is_kept_to_round_off() {
    let mut sim = scene(0.02, "", 3, BLAST);
    let before = sim.ledger();
    run(&mut sim, 20);
    let after = sim.ledger();
    println!("mass {:e}, off by {:e}", before.mass, after.mass / before.mass - 1.0);
    assert!((after.mass / before.mass - 1.0).abs() < 1e-13);
    // Sound has run through the box, and lost little.
    let change = numbers(&sim, "density").iter().map(|rho| (rho - 1.2).abs()).fold(0.0, f64::max);
    assert!(change > 1e-3 && after.energy() < before.energy() && after.kinetic > 0.0, "{change} {after:?}");
}

#[test]
fn bits_are_those_of_any_number_of_threads_and_of_a_restored_run() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut sim = scene(0.02, "", 3, BLAST);
            run(&mut sim, 4);
            sim.hash()
        })
    };
    assert_eq!(with(1), with(2));
    assert_eq!(with(1), with(8));
    let mut other = scene(0.02, "", 3, BLAST);
    run(&mut other, 2);
    let mut again = scene(0.02, "", 3, BLAST);
    again.restore(&other.save(&[])).unwrap();
    run(&mut again, 2);
    assert_eq!(again.hash(), with(1));
}

#[test]
fn a_step_too_long_ends_with_an_explanation() {
    let words = "box = { size = [1, 1, 1], resolution = 16 }\ninitial_density = \"1.2 + 0.01*exp(-50*(x^2 + y^2))\"";
    let mut sim = scene(0.1, "substeps = 6", 2, words);
    let stability = sim.stability(&|| true).remove(0);
    let limit = stability.limits[0].stable;
    assert!((limit / (1.0 / 16.0 / (C * 2.0_f64.sqrt())) - 1.0).abs() < 1e-9 && stability.step > limit, "{stability:?}");
    let error = (0..100).find_map(|_| sim.step(&|| true).err()).unwrap().to_string();
    assert!(error.contains("symplectic_euler") && error.contains("\"g\"") && error.contains("whose largest stable step is 1.4"), "{error}");
    let cures = sim.cures(&|| true);
    assert!(cures.iter().any(|cure| cure.survived), "{cures:?}");
}
