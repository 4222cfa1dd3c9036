//! Heat in bodies, against exact solutions of the diffusion equation.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{run, simulation};
use std::f64::consts::PI;
use tumble_f64::math::Signal;
use tumble_f64::scene::Simulation;
use tumble_f64::state::{Field, Grid, Place};
use tumble_f64::systems::heat::{Boundary, HeatedBody, Material, Plan};
use tumble_interface::engine::StepReport;
use tumble_interface::scene::HeatScheme;
use tumble_interface::{Data, Engine, Scene};

const SCHEMES: [&str; 4] = ["explicit", "implicit", "trapezoid", "spectral"];

/// A scene with one body named "b"; frames last `dt` [s].
fn body(dt: f64, system: &str, dimension: u32, words: &str) -> Simulation {
    simulation(&format!(
        "dimension = {dimension}\nplane = \"xy\"\ntime.fps = {:e}\n[[system]]\nname = \"s\"\nmethod = \"heat\"\n{system}\n[[heat]]\nname = \"b\"\n{words}\n",
        1.0 / dt
    ))
}

fn numbers(sim: &Simulation, column: &str) -> Vec<f64> {
    let frame = sim.frame(&[column]);
    match &frame.column("b", column).unwrap().data {
        Data::F64(numbers) => numbers.clone(),
        other => panic!("{other:?}"),
    }
}

fn temperatures(sim: &Simulation) -> Vec<f64> {
    numbers(sim, "temperature")
}

/// Root mean square of a difference.
fn off(a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
}

/// A mode of an insulated bar of n cells and length 1 m with diffusivity 1, at t = 0.05 s after so many steps: what is left of it
/// over the exact exp(-pi² t).
fn bar(scheme: &str, n: usize, steps: usize) -> f64 {
    let t = 0.05;
    let words = format!(
        "box = {{ size = [1, {:e}, 1], center = [0.5, 0, 0], resolution = {n} }}\nconductivity = 2\ndensity = 4\nheat_capacity = 0.5\n\
         scheme = \"{scheme}\"\ntemperature = \"300 + cos(pi*x)\"",
        1.0 / n as f64
    );
    let mut sim = body(t, &format!("substeps = {steps}"), 2, &words);
    run(&mut sim, 1);
    let mode: Vec<f64> = (0..n).map(|i| (PI * (i as f64 + 0.5) / n as f64).cos()).collect();
    let after = temperatures(&sim);
    let left = after.iter().zip(&mode).map(|(t, m)| (t - 300.0) * m).sum::<f64>() / mode.iter().map(|m| m * m).sum::<f64>();
    left / (-PI * PI * t).exp()
}

#[test]
fn modes_decay_as_they_should() {
    // Explicit: 64 cells need 0.05/(0.5/64²) = 410 steps.
    for (scheme, n, steps) in [("explicit", 64, 820), ("implicit", 64, 1600), ("trapezoid", 64, 40), ("spectral", 20, 1)] {
        let error = bar(scheme, n, steps) - 1.0;
        println!("{scheme}: {error:.1e}");
        // Measured -4.9e-5, 1.8e-4, 9.3e-5, -5e-15.
        assert!(error.abs() < 1e-3, "{scheme} {error:e}");
        assert!(scheme != "spectral" || error.abs() < 1e-12, "{error:e}");
    }
}

#[test]
fn each_scheme_has_its_order_in_time() {
    // The discrete mode itself decays by exp(-l t), l = 4 n² sin²(pi/2n): without the error of space.
    let n = 16;
    let shift = (-(4.0 * 256.0 * (PI / 32.0).sin().powi(2) - PI * PI) * 0.05_f64).exp();
    for (scheme, order, start) in [("explicit", 1.0, 80), ("implicit", 1.0, 20), ("trapezoid", 2.0, 5)] {
        let errors: Vec<f64> = (0..3).map(|k| bar(scheme, n, start << k) / shift - 1.0).collect();
        let found: Vec<f64> = errors.windows(2).map(|e| (e[0] / e[1]).log2()).collect();
        println!("{scheme}: {errors:.2?} {found:.3?}");
        // Measured 1.001 to 1.002, 0.990 to 0.995, 2.000.
        assert!(found.iter().all(|f| (f - order).abs() < 0.1), "{scheme}: {found:?}");
    }
}

#[test]
fn the_order_in_space_is_two() {
    let errors: Vec<f64> = [8, 16, 32].iter().map(|n| bar("trapezoid", *n, 400) - 1.0).collect();
    let found: Vec<f64> = errors.windows(2).map(|e| (e[0] / e[1]).log2()).collect();
    println!("{errors:?} {found:.3?}");
    assert!(found.iter().all(|f| (f - 2.0).abs() < 0.1), "{found:?}");
}

#[test]
fn a_spot_spreads_as_the_heat_kernel() {
    // Variance s² + 2 a t per axis; the walls are seven widths away.
    for (dimension, n) in [(2, 80), (3, 40)] {
        for scheme in SCHEMES {
            let (s0, a, t) = (0.12_f64.powi(2), 1.0, 0.003);
            let d = f64::from(dimension);
            let square = if dimension == 2 { "x^2 + y^2" } else { "x^2 + y^2 + z^2" };
            let words = format!(
                "box = {{ size = [2, 2, 2], resolution = {n} }}\nconductivity = 1\ndensity = 1\nheat_capacity = 1\nscheme = \"{scheme}\"\n\
                 temperature = \"exp(-({square})/{:e})\"\ntolerance = 1e-9",
                2.0 * s0
            );
            let steps = match scheme {
                "implicit" => 200,
                "explicit" => 20,
                _ => 10,
            };
            let mut sim = body(t, &format!("substeps = {steps}"), dimension, &words);
            run(&mut sim, 1);
            let (values, dx) = (temperatures(&sim), 2.0 / n as f64);
            let s = s0 + 2.0 * a * t;
            let at = |i: usize| -1.0 + dx * (i as f64 + 0.5);
            let planes = if dimension == 2 { 1 } else { n };
            let (mut moment, mut total, mut most) = (0.0, 0.0, 0.0_f64);
            for k in 0..planes {
                for j in 0..n {
                    for i in 0..n {
                        let value = values[i + n * (j + n * k)];
                        let r = at(i).powi(2) + at(j).powi(2) + if dimension == 3 { at(k).powi(2) } else { 0.0 };
                        let exact = (s0 / s).powf(d / 2.0) * (-r / (2.0 * s)).exp();
                        (moment, total) = (moment + value * r, total + value);
                        most = most.max((value - exact).abs());
                    }
                }
            }
            let variance = moment / total / d;
            println!("{dimension} {scheme}: variance {:.1e}, most off {most:.1e}", variance / s - 1.0);
            // A central Laplacian spreads variance exactly: measured at most 2e-10, of the tolerance.
            assert!((variance / s - 1.0).abs() < 1e-8, "{dimension} {scheme} {variance}");
            // Measured 1.4e-3 to 1.9e-3 in a plane, 3e-3 to 7.7e-3 in space, and 9e-12 by series.
            let bound = if scheme == "spectral" { 1e-9 } else { 0.012 };
            assert!(most < bound, "{dimension} {scheme} {most}");
        }
    }
}

#[test]
fn explicit_steps_grow_just_beyond_the_limit() {
    // A checkerboard in joined boxes, and a layered wall with held sides, whose limit comes from its circles.
    for d in 1..=3 {
        let n: [usize; 3] = std::array::from_fn(|a| if a < d { 8 } else { 1 });
        let grid = Grid::new(n, 0.1, [0.0; 3]).unwrap().periodic([true; 3]);
        for (part, grows) in [(0.99, false), (1.01, true)] {
            let own = Material { conductivity: 3.0, capacity: 2.0, hole: None };
            let plan = Plan {
                name: "b".into(),
                grid,
                scheme: HeatScheme::Explicit,
                materials: vec![own],
                material: Vec::new(),
                boundaries: Vec::new(),
                sides: [[None; 2]; 3],
                sources: Vec::new(),
                tolerance: 1e-10,
            };
            let mut t = Field::new(grid, Place::Cell, "K").unwrap();
            for at in t.each() {
                let i = t.index(at);
                t.data[i] = if (at[0] + at[1] + at[2]) % 2 == 0 { 1.0 } else { -1.0 };
            }
            let mut body = HeatedBody::new(plan, t, 0.0).unwrap();
            let limit = body.limit();
            assert!((limit / (0.01 / (2.0 * d as f64 * 1.5)) - 1.0).abs() < 1e-12, "{d} {limit}");
            let mut report = StepReport::default();
            (0..200).for_each(|i| body.step(i as f64, part * limit, &mut report));
            let size = body.t.value([0, 0, 0]).abs();
            println!("{d} {part}: {size:.3}");
            // (2 part - 1)^200: 0.0176 or 52.5.
            assert!((size / (2.0_f64 * part - 1.0).powi(200) - 1.0).abs() < 1e-6, "{size}");
            assert_eq!(size > 1.0, grows);
        }
    }
}

#[test]
fn a_step_beyond_the_limit_is_refused_and_automatic_ones_are_within() {
    let words = "box = { size = [1, 1, 1], resolution = 10 }\nconductivity = 1\ndensity = 1\nheat_capacity = 1\nscheme = \"explicit\"\ntemperature = 1";
    let text = |system: &str| {
        format!("version = 1\ntime.fps = 100\n[[system]]\nname = \"s\"\nmethod = \"heat\"\n{system}\n[[heat]]\nname = \"b\"\n{words}\n")
    };
    // dx²/6 = 1.667 ms.
    let wrong = Simulation::new(Scene::from_toml(&text("substeps = 5")).unwrap(), Default::default()).err().unwrap().to_string();
    assert!(wrong.contains("system \"s\".substeps") && wrong.contains("grows beyond 0.00167 s"), "{wrong}");
    let mut sim = Simulation::new(Scene::from_toml(&text("")).unwrap(), Default::default()).unwrap();
    let stability = sim.stability(&|| true).remove(0);
    let limit = stability.limit(stability.integrator).unwrap().stable;
    assert!((limit / (0.01 / 6.0) - 1.0).abs() < 1e-3, "{limit}");
    assert!(stability.step <= 0.7 * limit && stability.step > 0.5 * limit, "{} {limit}", stability.step);
    assert_eq!(run(&mut sim, 1).steps, 9);
}

/// A wall from 0 to 0.3 m along x, until nothing changes any more.
fn wall(scheme: &str, sides: &str, more: &str) -> (Simulation, Vec<f64>) {
    let words = format!(
        "box = {{ size = [0.3, 0.03, 1], center = [0.15, 0, 0], resolution = 30 }}\nconductivity = 0.8\ndensity = 10\nheat_capacity = 5\n\
         scheme = \"{scheme}\"\ntemperature = 290\nsides = {{ {sides} }}\ntolerance = 1e-12\n{more}"
    );
    let (dt, frames) = if scheme == "explicit" { (5.0, 80) } else { (1e5, 60) };
    let mut sim = body(dt, "", 2, &words);
    run(&mut sim, frames);
    let t = temperatures(&sim)[..30].to_vec();
    (sim, t)
}

#[test]
fn steady_walls_are_those_of_closed_forms() {
    for scheme in ["explicit", "implicit", "trapezoid"] {
        // Backward Euler forgets in few long steps; the trapezoid swings at these, and is not tried there.
        if scheme == "trapezoid" {
            continue;
        }
        let x = |i: usize| 0.01 * (i as f64 + 0.5);
        let near = |t: &[f64], exact: &dyn Fn(f64) -> f64, what: &str| {
            let far = (0..30).map(|i| (t[i] - exact(x(i))).abs()).fold(0.0, f64::max);
            println!("{scheme} {what}: {far:.1e} K");
            // Profiles of up to second degree are exact on the grid: measured at most 1.1e-12.
            assert!(far < 1e-9, "{scheme} {what}: {far:e}");
        };
        // Held at both sides: a line.
        let (_, t) = wall(scheme, "x_low = { temperature = 300 }, x_high = { temperature = 280 }", "");
        near(&t, &|x| 300.0 - 20.0 * x / 0.3, "held");
        // A flux of 40 W/m² in, held at the other side: slope -q/k.
        let (sim, t) = wall(scheme, "x_low = { flux = 40 }, x_high = { temperature = 280 }", "");
        near(&t, &|x| 280.0 + 40.0 / 0.8 * (0.3 - x), "flux");
        let flux: Vec<f64> = numbers(&sim, "flux").chunks(2).map(|q| q[0]).collect();
        assert!(flux[..30].iter().all(|q| (q - 40.0).abs() < 1e-5), "{flux:?}");
        // Between fluids: resistances in a row, q = (330 - 280)/(1/5 + 0.3/0.8 + 1/20).
        let (_, t) = wall(scheme, "x_low = { temperature = 330, coefficient = 5 }, x_high = { temperature = 280, coefficient = 20 }", "");
        let q = 50.0 / (0.2 + 0.375 + 0.05);
        near(&t, &|x| 330.0 - q * (0.2 + x / 0.8), "fluids");
        // Sun on a side in the wind: q = (h (300 - 280) + 60)/(1 + h L/k) with h = 5.
        let (_, t) = wall(scheme, "x_low = { temperature = 300, coefficient = 5, flux = 60 }, x_high = { temperature = 280 }", "");
        let q = (5.0 * 20.0 + 60.0) / (1.0 + 5.0 * 0.375);
        near(&t, &|x| 280.0 + q * (0.3 - x) / 0.8, "sun");
        // Two layers: resistances of both; the harmonic mean on the face between them keeps this exact.
        let layer = "[[heat.region]]\nshape = { box = { center = [0.25, 0, 0], size = [0.1, 9, 9] } }\nconductivity = 0.05\ndensity = 20";
        let (_, t) = wall(scheme, "x_low = { temperature = 300 }, x_high = { temperature = 280 }", layer);
        let q = 20.0 / (0.2 / 0.8 + 0.1 / 0.05);
        near(&t, &|x| if x < 0.2 { 300.0 - q * x / 0.8 } else { 280.0 + q * (0.3 - x) / 0.05 }, "layers");
        // Heat that arises everywhere, both sides held: a parabola, whose mirror in a wall is off by dx²/8 of S/k.
        let (_, t) = wall(scheme, "x_low = { temperature = 280 }, x_high = { temperature = 280 }", "[[heat.source]]\npower = 400");
        near(&t, &|x| 280.0 + 400.0 / 1.6 * (x * (0.3 - x) + 0.01 * 0.01 / 4.0), "source");
    }
}

#[test]
fn a_rod_heated_by_a_swinging_end_follows_nafems_t3() {
    // NAFEMS T3: 36.60 C at 0.08 m and 32 s; the series gives 36.6031.
    let words = "box = { size = [0.1, 0.001, 1], center = [0.05, 0, 0], resolution = 100 }\nconductivity = 35\ndensity = 7200\n\
                 heat_capacity = 440.5\nscheme = \"trapezoid\"\ntemperature = 0\n\
                 sides = { x_low = { temperature = 0 }, x_high = { temperature = \"100*sin(pi*t/40)\" } }";
    let mut sim = body(32.0, "substeps = 320", 2, words);
    run(&mut sim, 1);
    let t = temperatures(&sim);
    let at = 0.5 * (t[79] + t[80]);
    println!("NAFEMS T3: {at:.4}");
    // The mean of two cells is off by dx²/8 of T''; measured 36.5954.
    assert!((at - 36.6031).abs() < 0.01, "{at}");
}

#[test]
fn the_middle_of_a_plate_has_the_mean_of_its_sides() {
    // One side at 1, three at 0: 0.25 in the middle, 0.0954141 and 0.5405292 a quarter from the far and the near side.
    let words = "box = { size = [1, 1, 1], center = [0.5, 0.5, 0], resolution = 64 }\nconductivity = 1\ndensity = 1\nheat_capacity = 1\n\
                 temperature = 0.3\nsides = { x_low = { temperature = 0 }, x_high = { temperature = 0 }, y_low = { temperature = 0 }, \
                 y_high = { temperature = 1 } }";
    let mut sim = body(1e4, "", 2, words);
    run(&mut sim, 5);
    let t = temperatures(&sim);
    let at = |j: usize| (t[31 + 64 * (j - 1)] + t[32 + 64 * (j - 1)] + t[31 + 64 * j] + t[32 + 64 * j]) / 4.0;
    println!("{:.6} {:.6} {:.6}", at(32), at(16), at(48));
    assert!((at(32) - 0.25).abs() < 1e-9);
    // Second order: measured 1.5e-5 and -7.7e-5.
    assert!((at(16) - 0.0954141).abs() < 3e-4 && (at(48) - 0.5405292).abs() < 3e-4);
}

#[test]
fn a_fin_cools_as_its_closed_form() {
    // A fin of half-width w between insulated air: holes with a fluid; m² = h/(k w), T - Ta = cosh m (L - x)/cosh m L.
    let (film, k, w) = (2.0_f64, 50.0_f64, 0.01_f64);
    let words = format!(
        "box = {{ size = [0.4, 0.02, 1], center = [0.2, 0.01, 0], resolution = 80 }}\nconductivity = {k}\ndensity = 1\nheat_capacity = 1\n\
         temperature = 300\nsides = {{ x_low = {{ temperature = 400 }} }}\n\
         [[heat.region]]\nshape = {{ box = {{ center = [0.2, 0.015, 0], size = [1, 0.01, 1] }} }}\nhole = {{ temperature = 300, coefficient = {film} }}"
    );
    let mut sim = body(1e5, "", 2, &words);
    run(&mut sim, 6);
    let (t, m) = (temperatures(&sim), (film / (k * w)).sqrt());
    let mut far = 0.0_f64;
    for i in 0..80 {
        let x = 0.4 * (i as f64 + 0.5) / 80.0;
        let exact = 300.0 + 100.0 * (m * (0.4 - x)).cosh() / (m * 0.4).cosh();
        far = far.max((t[i] - exact).abs());
    }
    println!("fin: {far:.1e} K");
    // Biot's number h w/k = 4e-4 makes it nearly one-dimensional; measured 0.0059 K of 100.
    assert!(far < 0.05, "{far}");
    // The hole itself stays as it was.
    assert_eq!(t[80 * 3 + 5], 300.0);
}

const EVERYTHING: &str = "box = { size = [1, 0.7, 0.6], resolution = 21 }\nconductivity = 1.5\ndensity = 3\nheat_capacity = 2\n\
     temperature = \"300 + 20*x - 5*y*z\"\n\
     sides = { x_low = { temperature = 320 }, x_high = { flux = 30 }, z_low = { temperature = \"280 + 5*t\", coefficient = 4, flux = 3 } }\n\
     [[heat.region]]\nshape = { sphere = { center = [0.1, 0, 0], radius = 0.2 } }\nconductivity = 40\ndensity = 9\ntemperature = 350\n\
     [[heat.region]]\nshape = { box = { center = [-0.3, 0.2, 0.1], size = [0.2, 0.3, 0.2] } }\nhole = { temperature = 290, coefficient = 7 }\n\
     [[heat.source]]\nshape = { sphere = { center = [0.3, 0.1, 0], radius = 0.15 } }\npower = \"500*sin(t)\"\nprofile = \"1 + x\"\n\
     [[heat.source]]\npower = 11\n";

#[test]
fn heat_stored_is_heat_that_came_in() {
    for scheme in ["explicit", "implicit", "trapezoid"] {
        // A loose tolerance: what the solver leaves must not be lost.
        let words = format!("scheme = \"{scheme}\"\ntolerance = 1e-3\n{EVERYTHING}");
        let mut sim = body(0.05, "", 3, &words);
        run(&mut sim, 20);
        let books = sim.ledger();
        println!("{scheme}: stored {:.6} J, off by {:.1e}", books.heat.unwrap(), books.heat.unwrap() - books.heat_in.unwrap());
        assert!(books.heat.unwrap().abs() > 1.0, "{books:?}");
        // Some hundred steps of round-off of 10⁴ cells; measured 3.6e-12 J of 4.2 J.
        assert!((books.heat.unwrap() - books.heat_in.unwrap()).abs() < 1e-9 * books.heat.unwrap().abs(), "{scheme}: {books:?}");
    }
    let mut sim = body(
        0.05,
        "",
        3,
        "box = { size = [1, 0.75, 0.6], resolution = 20 }\nconductivity = 1\ndensity = 3\nheat_capacity = 2\n\
        scheme = \"spectral\"\ntemperature = \"300 + 20*x\"\nsource = [{ power = \"9*t\", profile = \"x^2\" }]",
    );
    run(&mut sim, 20);
    let books = sim.ledger();
    // The integral of 9 t is 4.5; the mean of x² over the box of 0.45 m³ is 1/12 less that of a cell, dx²/12.
    let exact = 4.5 * 0.45 * (1.0 - 0.0025) / 12.0;
    assert!((books.heat.unwrap() / exact - 1.0).abs() < 1e-9 && (books.heat_in.unwrap() / exact - 1.0).abs() < 1e-9, "{books:?} {exact}");
}

#[test]
fn fluxes_of_the_exchange_sum_up_to_the_ledger() {
    use tumble_f64::exchange::Exchange;
    use tumble_f64::system::System;
    use tumble_f64::systems::heat::{Heat, Settings};
    let grid = Grid::new([10, 4, 4], 0.1, [0.0; 3]).unwrap();
    let held = |name: &str, t: f64| Boundary { name: name.into(), temperature: Some(Signal::Constant(t)), coefficient: None, flux: None };
    let plan = Plan {
        name: "plate".into(),
        grid,
        scheme: HeatScheme::Implicit,
        materials: vec![Material { conductivity: 2.0, capacity: 5.0, hole: None }],
        material: Vec::new(),
        boundaries: vec![held("x_low", 30.0), held("x_high", 10.0)],
        sides: [[Some(0), Some(1)], [None; 2], [None; 2]],
        sources: Vec::new(),
        tolerance: 1e-12,
    };
    let body = HeatedBody::new(plan, Field::new(grid, Place::Cell, "K").unwrap(), 0.0).unwrap();
    let mut exchange = Exchange::default();
    exchange.enter("other");
    let id = exchange.enter("s");
    let mut system = Heat::new(Settings { name: "s".into(), ..Settings::default() }, vec![body], id, &mut exchange);
    for i in 0..40 {
        system.advance(f64::from(i), 1.0, &mut exchange.turn(id), &|| true).unwrap();
    }
    let fluxes = exchange.fluxes().to_vec();
    assert_eq!((fluxes[0].name.as_str(), fluxes[1].name.as_str(), fluxes[0].system), ("plate x_low", "plate x_high", id));
    let books = system.ledger(40.0);
    assert!((fluxes[0].heat + fluxes[1].heat - books.heat.unwrap()).abs() < 1e-9 * books.heat.unwrap(), "{fluxes:?} {books:?}");
    // Steady at last: 20 K along 1 m, 2 W/(m K) and 0.16 m² pass 6.4 W.
    system.advance(40.0, 1.0, &mut exchange.turn(id), &|| true).unwrap();
    let passed = exchange.fluxes()[0].heat - fluxes[0].heat;
    assert!((passed - 6.4).abs() < 1e-4, "{passed}");
}

#[test]
fn bits_are_those_of_any_number_of_threads_and_of_a_restored_run() {
    let spectral = "box = { size = [1, 0.75, 0.6], resolution = 20 }\nconductivity = 1\ndensity = 3\nheat_capacity = 2\n\
        scheme = \"spectral\"\ntemperature = \"300 + 20*x\"\nsource = [{ power = \"9*t\", profile = \"x^2\" }]";
    for scheme in SCHEMES {
        let words = if scheme == "spectral" { spectral.to_string() } else { format!("scheme = \"{scheme}\"\n{EVERYTHING}") };
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut sim = body(0.02, "", 3, &words);
                run(&mut sim, 4);
                sim
            })
        };
        let (one, two, eight) = (with(1), with(2), with(8));
        assert_eq!(one.hash(), two.hash(), "{scheme}");
        assert_eq!(one.hash(), eight.hash(), "{scheme}");
        let mut other = body(0.02, "", 3, &words);
        run(&mut other, 2);
        let saved = other.save(&[]);
        let mut again = body(0.02, "", 3, &words);
        again.restore(&saved).unwrap();
        run(&mut again, 2);
        assert_eq!(again.hash(), one.hash(), "{scheme}");
        assert_eq!(off(&temperatures(&again), &temperatures(&one)), 0.0);
    }
}

#[test]
fn what_cannot_be_meant_is_refused_with_its_place() {
    let wrong = |words: &str| {
        let text = format!(
            "version = 1\ndimension = 2\n[[heat]]\nname = \"b\"\nbox = {{ size = [1, 1, 1], resolution = 14 }}\nconductivity = 1\ndensity = 1\nheat_capacity = 1\n{words}\n"
        );
        Simulation::new(Scene::from_toml(&text).unwrap(), Default::default()).err().map(|e| e.to_string()).unwrap_or_default()
    };
    for (words, expected) in [
        (
            "temperature = \"1/x - 1/x\"\nperiodic = [true, false, false]\nsides = { x_low = { flux = 1 } }",
            "sides.x_low: the axis is periodic",
        ),
        ("temperature = 1\nsides = { y_low = { flux = 1 } }", "sides.y_low: a scene of dimension 2"),
        ("temperature = 1\nsides = { x_low = { coefficient = 1 } }", "sides.x_low.coefficient: given without"),
        ("temperature = 1\nsides = { x_low = { flux = 1, temperature = 2 } }", "sides.x_low.flux: given beside"),
        ("temperature = 1\nscheme = \"spectral\"", "box.resolution: 14 cells along x"),
        ("temperature = 1\nscheme = \"spectral\"\nsides = { x_low = { flux = 1 } }", "scheme: \"spectral\" is for insulated"),
        ("temperature = \"sqrt(x)\"", "temperature: not a finite number at"),
        ("temperature = \"foo(x)\"", "temperature: "),
    ] {
        let found = wrong(words);
        assert!(found.contains(&format!("heat \"b\".{expected}")), "{words}: {found}");
    }
    assert_eq!(wrong("temperature = 1"), "");
}
