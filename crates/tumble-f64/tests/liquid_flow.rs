//! What comes into liquids on a grid and leaves them, what rubs, and what pulls at their surface: docs/theory/pic.md.

#![allow(clippy::unwrap_used)] // helpers of tests fail by panicking, too

use crate::common;

use common::{positions, run, simulation, step, velocities};
use std::f64::consts::PI;
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Engine, Scene};

/// A box of liquid in the plane, from the origin; `words` are those of the liquid.
fn tank(head: &str, size: [f64; 2], resolution: usize, words: &str) -> Simulation {
    let [x, z] = size;
    simulation(&format!(
        "dimension = 2\n{head}\n[[liquid]]\nname = \"l\"\nbox = {{ size = [{x}, 1, {z}], center = [{}, 0, {}], resolution = {resolution} }}\n{words}",
        0.5 * x,
        0.5 * z
    ))
}

fn box_of(low: [f64; 2], high: [f64; 2]) -> String {
    let ([x, z], [sx, sz]) = ([0, 1].map(|a| 0.5 * (low[a] + high[a])), [0, 1].map(|a| high[a] - low[a]));
    format!("{{ box = {{ center = [{x}, 0, {z}], size = [{sx}, 1, {sz}] }} }}")
}

#[test]
fn a_tap_gives_what_its_velocity_and_its_width_say() {
    let (side, row) = (12.0 / 64.0, 1.0 / 64.0);
    let tap = box_of([26.0 * row, 52.0 * row], [26.0 * row + side, 1.0]);
    let words = format!("inflow = [{{ shape = {tap}, velocity = [0, 0, -0.7], start = 0.1, end = 0.6 }}]");
    let mut sim = tank("time.fps = 50", [1.0, 1.0], 32, &words);
    assert_eq!(sim.ledger().mass, 0.0);
    let mut last = 0.0;
    for frame in 1..=40 {
        step(&mut sim);
        let mass = sim.ledger().mass;
        assert!(mass >= last);
        last = mass;
        let t = f64::from(frame) / 50.0;
        // The tap itself is full at once.
        let exact = if t <= 0.1 { 0.0 } else { 1000.0 * side * (side + 0.7 * (t.min(0.6) - 0.1)) };
        assert!((mass - exact).abs() < 1000.0 * side * 1.01 * row, "{t}: {mass} {exact}");
    }
    let frame = sim.frame(&["position"]);
    let ids: Vec<f64> = frame.column("l", "id").unwrap().data.numbers();
    assert!(ids.windows(2).all(|pair| pair[0] < pair[1]) && ids.len() == positions(&sim, "l").len());
}

#[test]
fn a_drain_lets_out_what_torricelli_says() {
    // A slot of 0.1 m in the floor of a tank of 1 m; the jet contracts and the tank is not endless.
    let words = format!(
        "fill = [{{ shape = {} }}]\ndrain = [{{ shape = {} }}]\n[[collider]]\nname = \"left\"\nshape = {}\n[[collider]]\nname = \"right\"\nshape = {}\n",
        box_of([0.0, 0.3], [1.0, 0.9]),
        box_of([0.0, 0.0], [1.0, 0.05]),
        box_of([-0.5, 0.2], [0.45, 0.3]),
        box_of([0.55, 0.2], [1.5, 0.3]),
    );
    let mut sim = tank("time.fps = 50\nworld.gravity = [0, 0, -10]", [1.0, 1.0], 80, &words);
    let start = sim.ledger().mass;
    run(&mut sim, 15);
    let early = sim.ledger().mass;
    run(&mut sim, 15);
    let late = sim.ledger().mass;
    // Depth above the lower mouth, with what falls; a jet from a sharp slot has pi/(pi + 2) of its width [milne1968], one from a thick wall more.
    let rate = (early - late) / 0.3;
    let depth = 0.5 * (early + late) / 1000.0 + 0.1;
    let part = rate / (1000.0 * 0.1 * (2.0 * 10.0 * depth).sqrt());
    println!("{start} {early} {late}: {rate} kg/s, {part} of the slot");
    assert!(part > PI / (PI + 2.0) && part < 1.0, "{part}");
}

#[test]
fn a_viscous_disc_that_turns_as_a_whole_turns_on() {
    for viscosity in [0.0, 1000.0] {
        let words = format!(
            "viscosity = {viscosity}\nfill = [{{ shape.sphere = {{ center = [0.5, 0, 0.5], radius = 0.25 }}, velocity = [\"z - 0.5\", 0, \"0.5 - x\"] }}]"
        );
        let mut sim = tank("world.gravity = [0, 0, 0]\ntime.fps = 8", [1.0, 1.0], 64, &words);
        let start = sim.ledger();
        run(&mut sim, 8);
        let end = sim.ledger();
        let spin = end.angular_momentum.unwrap()[1] / start.angular_momentum.unwrap()[1];
        println!("{viscosity}: angular momentum {spin}, energy {}", end.kinetic / start.kinetic);
        assert!((spin - 1.0).abs() < 0.01 && (end.kinetic / start.kinetic - 1.0).abs() < 0.02);
    }
}

#[test]
fn a_film_starts_to_flow_as_its_series_says() {
    // Depth H on a floor to which it sticks, in a tank so long that its ends are not felt.
    let (depth, nu, pull) = (0.1, 0.02, 0.5);
    let words = format!("solids = \"no_slip\"\nviscosity = {}\nfill = [{{ shape = {} }}]", 1000.0 * nu, box_of([0.0, 0.0], [3.2, depth]));
    let mut sim = tank(&format!("world.gravity = [{pull}, 0, -1]\ntime.fps = 100"), [3.2, 0.2], 256, &words);
    let mut worst: f64 = 0.0;
    for frame in 1..=60 {
        step(&mut sim);
        if frame % 20 > 0 {
            continue;
        }
        let t = f64::from(frame) / 100.0;
        let exact = |z: f64| {
            let steady = pull / nu * (depth * z - 0.5 * z * z);
            let term = |n: f64| {
                let k = (n + 0.5) * PI / depth;
                2.0 * pull / (nu * depth * k.powi(3)) * (k * z).sin() * (-nu * k * k * t).exp()
            };
            steady - (0..40).map(|n| term(f64::from(n))).sum::<f64>()
        };
        let scale = exact(depth);
        let (x, v) = (positions(&sim, "l"), velocities(&sim, "l"));
        // Within half a cell of the floor a particle counts as half a cell above it.
        let middle = x.iter().zip(&v).filter(|(x, _)| (x.x - 1.6).abs() < 0.2 && x.z > 0.5 * 3.2 / 256.0);
        let error = middle.map(|(x, v)| (v.x - exact(x.z)).abs() / scale).fold(0.0, f64::max);
        println!("{t} s: {scale:.4} m/s at the surface, error {error:.4}");
        worst = worst.max(error);
    }
    assert!(worst < 0.05, "{worst}");
}

#[test]
fn a_viscous_wave_fades_as_its_closed_form_says() {
    // Free slip: exp(-2 nu k² t) [lamb1932].
    let (k, g, nu, depth): (f64, f64, f64, f64) = (PI, 9.8, 0.01, 0.5);
    let omega = (g * k * (k * depth).tanh()).sqrt();
    let a = 0.04 * omega / (k * (k * depth).sinh());
    let make = |nu: f64| {
        let velocity =
            format!("[\"-{a}*{k}*sin({k}*x)*(exp({k}*z)+exp(-{k}*z))/2\", 0, \"{a}*{k}*cos({k}*x)*(exp({k}*z)-exp(-{k}*z))/2\"]");
        let words =
            format!("viscosity = {}\nfill = [{{ shape = {}, velocity = {velocity} }}]", 1000.0 * nu, box_of([0.0, 0.0], [1.0, depth]));
        tank(&format!("time.fps = {}", 16.0 * omega / (2.0 * PI)), [1.0, 0.75], 64, &words)
    };
    // Logarithm of how much lower the highest lean of a half period is than that of the one before.
    let decrement = |mut sim: Simulation| {
        let lean = |sim: &Simulation| {
            let x = positions(sim, "l");
            x.iter().map(|x| x.x).sum::<f64>() / x.len() as f64 - 0.5
        };
        let (mut tops, mut last) = (Vec::<f64>::new(), [0.0_f64; 2]);
        for _ in 0..48 {
            step(&mut sim);
            let now = lean(&sim);
            if last[1].abs() >= last[0].abs() && last[1].abs() > now.abs() {
                // The top of the parabola through three.
                let (low, high) = (last[0] - last[1], now - last[1]);
                tops.push((last[1] - (high - low).powi(2) / (8.0 * (low + high))).abs());
            }
            last = [last[1], now];
        }
        println!("{tops:?}");
        (tops[0] / tops[tops.len() - 1]).ln() / (tops.len() - 1) as f64
    };
    let (thin, thick) = (decrement(make(0.0)), decrement(make(nu)));
    let exact = 2.0 * nu * k * k * PI / omega;
    println!("{thin} without viscosity, {thick} with it, exact {exact}");
    assert!(thin.abs() < 0.01 && ((thick - thin) / exact - 1.0).abs() < 0.12);
}

/// The period of a drop over that of [lamb1932], and how round it is at rest: an ellipse of 1 % in the plane.
fn drop_period(resolution: usize) -> f64 {
    let (radius, tension): (f64, f64) = (0.25, 0.07);
    let omega = (6.0 * tension / (1000.0 * radius.powi(3))).sqrt();
    let fps = 32.0 * omega / (2.0 * PI);
    // u = grad of A (x² - z²)/2, which a round drop begins to swing with.
    let rate = 0.1 * omega;
    let words = format!(
        "surface_tension = {tension}\nfill = [{{ shape.sphere = {{ center = [0.5, 0, 0.5], radius = {radius} }}, velocity = [\"{rate}*(x - 0.5)\", 0, \"-{rate}*(z - 0.5)\"] }}]"
    );
    let mut sim = tank(&format!("world.gravity = [0, 0, 0]\ntime.fps = {fps}"), [1.0, 1.0], resolution, &words);
    let stretch = |sim: &Simulation| {
        let x = positions(sim, "l");
        x.iter().map(|x| (x.x - 0.5).powi(2) - (x.z - 0.5).powi(2)).sum::<f64>() / x.len() as f64
    };
    let (mut crossings, mut before) = (Vec::new(), 0.0);
    for frame in 1..=72 {
        step(&mut sim);
        let now = stretch(&sim);
        if frame > 4 && now * before < 0.0 {
            crossings.push(f64::from(frame) - now / (now - before));
        }
        before = now;
    }
    println!("{resolution}: {crossings:?} of 32 frames a period");
    (crossings[crossings.len() - 1] - crossings[0]) / (crossings.len() - 1) as f64 / 16.0
}

#[test]
fn a_drop_swings_with_the_period_of_its_tension() {
    let [coarse, fine] = [24, 48].map(drop_period);
    println!("{coarse} {fine}");
    assert!((fine - 1.0).abs() < 0.05 && (coarse - 1.0).abs() < 0.1, "{coarse} {fine}");
}

/// Paths and messages of all that is wrong with a liquid of these words.
fn faults(words: &str) -> Vec<String> {
    let text = format!("version = 1\n[[liquid]]\nname = \"l\"\nbox = {{ size = [1, 1, 1], resolution = 8 }}\n{words}");
    let issues = match Scene::from_toml(&text) {
        Ok(scene) => Simulation::new(scene, Assets::default()).err().unwrap().issues,
        Err(error) => error.issues,
    };
    issues.iter().map(|issue| format!("{}: {}", issue.path, issue.message)).collect()
}

#[test]
fn openings_and_steps_that_cannot_be_are_refused() {
    let ball = |x: f64| format!("{{ sphere = {{ center = [{x}, 0, 0], radius = 0.2 }} }}");
    let fill = format!("fill = [{{ shape = {} }}]\n", ball(0.0));
    for (words, path, about) in [
        (format!("inflow = [{{ shape = {}, velocity = [0, 0, -1] }}]", ball(2.0)), "liquid \"l\".inflow[0].shape", "no place"),
        (format!("inflow = [{{ shape = {}, velocity = [0, 0, 0] }}]", ball(0.0)), "liquid \"l\".inflow[0].velocity", "nothing comes in"),
        (
            format!("inflow = [{{ shape = {}, velocity = [0, 0, -1], start = 2, end = 1 }}]", ball(0.0)),
            "liquid \"l\".inflow[0].end",
            "expected > start",
        ),
        (format!("{fill}drain = [{{ shape = {{ mesh = {{ path = \"a.obj\" }} }} }}]"), "liquid \"l\".drain[0].shape", "mesh"),
        (
            format!("{fill}drain = [{{ shape = {} }}]\n[[collider]]\nname = \"c\"\nshape.box.size = [0.6, 0.6, 0.6]\n", ball(0.0)),
            "liquid \"l\".drain[0].shape",
            "colliders",
        ),
        (format!("{fill}solids = \"no_slip\""), "liquid \"l\".solids", "viscosity"),
        (format!("{fill}bodies = [\"b\"]"), "liquid \"l\".bodies[0]", "no object"),
        (
            format!("{fill}drain = [{{ shape = {} }}]\n[expect]\nmax_volume_error = 0.1\n", ball(0.3)),
            "expect.max_volume_error",
            "comes in or leaves",
        ),
        (
            format!("{fill}surface_tension = 1000.0\n[[system]]\nmethod = \"liquid\"\nsubsteps = 1\n"),
            "system \"main\".substeps",
            "surface tension",
        ),
    ] {
        let found = faults(&words);
        println!("{found:?}");
        assert!(found.iter().any(|issue| issue.starts_with(path) && issue.contains(about)), "{words}: {found:?}");
    }
}

#[test]
fn a_restored_tap_goes_on_with_the_same_bits() {
    let make = || {
        let words = format!(
            "viscosity = 1.0\nsurface_tension = 0.07\nfill = [{{ shape = {} }}]\ninflow = [{{ shape = {}, velocity = [0.1, 0, -1.03] }}]\ndrain = [{{ shape = {} }}]\n",
            box_of([0.0, 0.0], [1.0, 0.2]),
            box_of([0.4, 0.7], [0.6, 0.9]),
            box_of([0.8, 0.0], [1.0, 0.1])
        );
        tank("time.fps = 30", [1.0, 1.0], 20, &words)
    };
    let on = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let mut sim = make();
            run(&mut sim, 8);
            (sim.hash(), sim.ledger().mass)
        })
    };
    let one = on(1);
    assert!([2, 8].iter().all(|threads| on(*threads) == one));
    let mut first = make();
    run(&mut first, 4);
    let mut fresh = make();
    fresh.restore(&first.save(&[])).unwrap();
    run(&mut fresh, 4);
    assert_eq!((fresh.hash(), fresh.ledger().mass), one);
}
