//! The advection-reflection step of a gas, in double precision: docs/theory/gas.md, (gas.20) and (gas.21).

extern crate tumble_f64 as tumble;

use crate::common;

use common::{column, grid, largest, orders, run, show, simulation, step};
use std::f64::consts::PI;
use tumble_f64::scene::Simulation;
use tumble_interface::{Engine, Scene};

const LINEAR: &str = "order = \"project_last\"";
const CUBIC: &str = "order = \"project_last\"\nadvection.velocity.interpolation = \"cubic\"";
const REFLECTED: &str = "order = \"reflection\"";
const BOTH: &str = "order = \"reflection\"\nadvection.velocity = { interpolation = \"cubic\", corrected = false }";

/// Root mean square error of a vortex that a stream carries through a periodic square for half a second, over its first speed.
fn moving_vortex(n: usize, courant: f64, words: &str) -> f64 {
    let steps = (0.75 * n as f64 / courant).round();
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
viscosity = 0.002
velocity = ["0.5 + sin(2*pi*x)*cos(2*pi*z)", 0, "0.3 - cos(2*pi*x)*sin(2*pi*z)"]
{words}
"#
    ));
    step(&mut sim);
    let decay = (-8.0 * PI * PI * 0.002 * 0.5_f64).exp();
    let (u, _) = grid(&sim, "air", "velocity_x");
    let (x, z) = (|i: usize| (i % n) as f64 / n as f64 - 0.25, |i: usize| ((i / n) as f64 + 0.5) / n as f64 - 0.15);
    let exact = |i: usize| 0.5 + decay * (2.0 * PI * x(i)).sin() * (2.0 * PI * z(i)).cos();
    (u.iter().enumerate().map(|(i, u)| (u - exact(i)).powi(2)).sum::<f64>() / u.len() as f64).sqrt()
}

#[test]
fn a_vortex_in_a_stream_moves_on_with_second_order() {
    // Step and cells shrink together; errors at 64 cells measured.
    for (name, words, courant, order, worst) in [
        ("first order", CUBIC, 0.5, 1.0, 1.45e-2),
        ("reflection", REFLECTED, 0.5, 2.0, 1.8e-3),
        ("reflection", REFLECTED, 2.0, 2.0, 2.0e-3),
        ("reflection, cubic", BOTH, 0.5, 2.05, 1.05e-3),
        ("reflection, cubic", BOTH, 2.0, 1.9, 0.95e-3),
    ] {
        let errors = [16, 32, 64].map(|n| moving_vortex(n, courant, words));
        let orders = orders(&errors);
        println!("{name} at {courant}: {} orders {}", show(&errors), show(&orders));
        assert!((orders[1] - order).abs() < 0.08, "{name} at {courant}: {orders:?}");
        assert!(errors[2] < worst && errors[2] > 0.85 * worst, "{name} at {courant}: {errors:?}");
    }
    // The cells stay, the step shrinks: what is left at 64 cells is 8e-4, of space.
    let errors = [8.0, 4.0].map(|courant| moving_vortex(64, courant, BOTH));
    println!("in time: {} orders {}", show(&errors), show(&orders(&errors)));
    assert!(orders(&errors)[0] > 1.75, "{errors:?}");
}

/// Share of the energy that vortices without viscosity in a closed square have after four turns or so.
fn kept(courant: f64, words: &str) -> f64 {
    let mut sim = simulation(&format!(
        r#"
dimension = 2
time = {{ fps = 1, frames = 4 }}
[[gas]]
name = "air"
box = {{ size = [1, 1, 1], center = [0.5, 0, 0.5], resolution = 64 }}
fluid_density = 1.0
courant = {courant}
velocity = ["sin(pi*x)*cos(pi*z) + 0.5*sin(2*pi*x)*cos(2*pi*z)", 0, "-cos(pi*x)*sin(pi*z) - 0.5*cos(2*pi*x)*sin(2*pi*z)"]
{words}
"#
    ));
    let before = sim.ledger().kinetic;
    run(&mut sim, 4);
    sim.ledger().kinetic / before
}

#[test]
fn vortices_keep_their_energy_at_every_courant_number() {
    // Measured: 0.215, 0.569 and 0.843 by the cycle, with cubic interpolation; 0.9858, 0.9983, 0.9982 by reflection.
    for (courant, cycle, least) in [(8.0, 0.25, 0.98), (2.0, 0.6, 0.997), (0.5, 0.87, 0.997)] {
        let (before, now) = (kept(courant, CUBIC), kept(courant, REFLECTED));
        println!("courant {courant}: {before:.4} {now:.4}");
        assert!(before < cycle && now > least && now < 1.0, "{courant}: {before} {now}");
    }
    // Nothing grows where a step crosses half of the box.
    let now = kept(40.0, REFLECTED);
    assert!(now > 0.1 && now < 1.0, "{now}");
}

/// Largest error of u on the vertical through the middle of the cavity at Re 400, 64 x 64 cells, over the lid's speed: see gas.rs.
fn cavity(courant: f64, words: &str) -> f64 {
    const LID: [(f64, f64); 9] = [
        (0.9531, 0.56178),
        (0.8516, 0.29201),
        (0.7344, 0.16254),
        (0.6172, 0.02102),
        (0.5, -0.11505),
        (0.4531, -0.17145),
        (0.2812, -0.32875),
        (0.1719, -0.24376),
        (0.0703, -0.10332),
    ];
    let n = 64;
    let mut sim = simulation(&format!(
        r#"
dimension = 2
time = {{ fps = 1, frames = 30 }}
[[gas]]
name = "fluid"
box = {{ size = [1, 1, 1], center = [0.5, 0, 0.5], resolution = {n} }}
sides = {{ x = ["no_slip", "no_slip"], z = ["no_slip", {{ wall = {{ velocity = [1, 0, 0] }} }}] }}
fluid_density = 1
viscosity = 0.0025
courant = {courant}
pressure.tolerance = 1e-6
{words}
"#
    ));
    run(&mut sim, 30);
    let (u, points) = grid(&sim, "fluid", "velocity_x");
    let line: Vec<f64> = (0..n).map(|i| u[i * points[0] + n / 2]).collect();
    let at = |z: f64| {
        let x = z * n as f64 - 0.5;
        let i = (x.floor() as usize).min(n - 2);
        line[i] + (line[i + 1] - line[i]) * (x - i as f64)
    };
    LID.iter().map(|(z, u)| (at(*z) - u).abs()).fold(0.0, f64::max)
}

#[test]
#[ignore = "long: make validate"]
fn what_is_steady_does_not_depend_on_the_step() {
    let cycle: Vec<f64> = common::cases([4.0, 2.0], 2).map(|courant| cavity(courant, CUBIC)).collect();
    let reflected = [4.0, 2.0].map(|courant| cavity(courant, BOTH));
    println!("cycle {cycle:?}, reflection {reflected:?}");
    assert!(cycle[0] > 0.05 && cycle.iter().all(|e| *e > 0.03), "{cycle:?}");
    // What is left is of space: a quarter of it at 128 x 128 cells.
    assert!(reflected.iter().all(|e| *e < 0.018) && (reflected[0] - reflected[1]).abs() < 0.004, "{reflected:?}");
}

#[test]
fn a_channel_has_its_profile_and_a_stiff_viscosity_rings_no_bell() {
    let channel = |sides: &str, frames: usize| {
        let mut sim = simulation(&format!(
            r#"
dimension = 2
time = {{ fps = 1, frames = 60 }}
[[system]]
method = "gas"
substeps = 4
[[gas]]
name = "air"
box = {{ size = [0.25, 1, 1], center = [0, 0, 0.5], resolution = 32 }}
fluid_density = 2.0
viscosity = 0.1
order = "reflection"
{sides}
"#
        ));
        run(&mut sim, frames);
        let (u, points) = grid(&sim, "air", "velocity_x");
        (0..points[1]).map(|k| u[k * points[0]]).collect::<Vec<f64>>()
    };
    let z = |k: usize| (k as f64 + 0.5) / 32.0;
    // As by the cycle: the parabola of a z (1 - z)/(2 nu), and a dx²/(8 nu) that ghosts in the walls add.
    let u = channel("sides = { x = [\"periodic\", \"periodic\"], z = [\"no_slip\", \"no_slip\"] }\nacceleration = [0.05, 0, 0]", 60);
    let offset = 0.05 / 1024.0 / (8.0 * 0.05);
    let error = u.iter().enumerate().map(|(k, u)| (u - 0.5 * z(k) * (1.0 - z(k)) - offset).abs()).fold(0.0, f64::max);
    assert!(error < 1e-10 && (largest(&u) - 0.125).abs() < 1e-3, "{error:e}");
    // A lid that starts: viscosity crosses 13 cells squared in a step. The speed falls from the lid on, and next to it all is there.
    let u = channel("sides = { x = [\"periodic\", \"periodic\"], z = [\"no_slip\", { wall = { velocity = [0.3, 0, 0] } }] }", 2);
    println!("below the lid: {}", show(&u[28..]));
    assert!(u.windows(2).all(|u| u[0] < u[1]) && u[31] > 0.27 && u[31] < 0.3, "{}", show(&u));
}

#[test]
fn a_ball_starts_with_its_added_mass_and_rests_where_it_weighs_nothing() {
    let ball = |ratio: f64, frames: usize| {
        let (a, b): (f64, f64) = (0.25, 0.6);
        let mass = ratio * 2.0 * 4.0 / 3.0 * PI * a.powi(3);
        let mut sim = simulation(&format!(
            r#"
time = {{ fps = 1000, frames = {frames} }}
[[gas]]
name = "water"
box = {{ size = [1.25, 1.25, 1.25], center = [0, 0, 0], resolution = 40 }}
fluid_density = 2
order = "reflection"
bodies = ["ball"]
[[particles]]
name = "ball"
position = [[0.013, 0.007, -0.011]]
radius = {a}
mass = [{mass}]
[[collider]]
name = "shell"
inside = true
shape.sphere = {{ center = [0.013, 0.007, -0.011], radius = {b} }}
"#
        ));
        run(&mut sim, frames);
        let added = 0.5 * (b.powi(3) + 2.0 * a.powi(3)) / (b.powi(3) - a.powi(3));
        (column(&sim, "ball", "velocity")[0].z, -9.8e-3 * frames as f64 * (ratio - 1.0) / (ratio + added))
    };
    // So light that explicit exchange would multiply every error by 32 in each step; and heavy. 0.4 % and 0.2 % off, for the surface of
    // cut cells, and no more after twenty steps.
    for (ratio, frames) in [(0.02, 2), (8.0, 2), (0.02, 20)] {
        let (v, exact) = ball(ratio, frames);
        println!("ball of {ratio}, {frames} frames: {}", v / exact - 1.0);
        assert!((v / exact - 1.0).abs() < 0.016, "{ratio}: {v} {exact}");
    }
    let (v, _) = ball(1.0, 20);
    assert!(v.abs() < 1e-13, "{v:e}");
}

/// Everything at once: a solid that moves and spins, a net, viscosity, buoyancy, a source, an inflow and an open side.
const BUSY: &str = r#"
time = { fps = 24, frames = 8 }
[[gas]]
name = "air"
box = { size = [1, 0.75, 1], resolution = 20 }
sides = { x = [{ inflow = { velocity = [1, 0, 0], density = 0.2 } }, "open"], z = ["no_slip", "free_slip"] }
smoke = { initial = "step(x, 0)" }
temperature = { ambient = 300, initial = "300 + 50*step(x, 0)" }
viscosity = 1e-3
solids = "no_slip"
courant = 4
order = "reflection"
source = [{ shape.sphere = { center = [0.2, 0, -0.2], radius = 0.15 }, heating = 200, velocity = [0, 0, 1] }]
[[gas.sheet]]
object = "net"
resistance = 3
[[collider]]
name = "ball"
shape.sphere = { center = [-0.1, 0.02, 0], radius = 0.15 }
motion = { velocity = [0.4, 0, 0.3], spin = [0, 0, 4] }
[[sheet]]
name = "net"
center = [0.3, 0, 0.2]
size = [0.3, 0.3]
resolution = [5, 5]
"#;

fn busy() -> Simulation {
    simulation(BUSY)
}

#[test]
fn a_restored_run_goes_on_with_the_same_bits_on_any_number_of_threads() {
    let mut sim = busy();
    let report = run(&mut sim, 6);
    assert!(report.unconverged == 0 && report.residual.unwrap() <= 1e-10 && report.residual.unwrap() > 0.0, "{report:?}");
    let speed = sim.ledger().speed.unwrap();
    assert!(speed > 1.0 && speed < 4.0, "{speed}");
    let mut other = busy();
    run(&mut other, 3);
    let saved = other.save(&[]);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let hash = pool.install(|| {
            let mut back = busy();
            back.restore(&saved).unwrap();
            run(&mut back, 3);
            back.hash()
        });
        assert_eq!(hash, sim.hash(), "{threads}");
    }
}

#[test]
fn what_reflection_cannot_do_is_told() {
    for (words, place, message) in [
        ("viscous = \"explicit\"\nviscosity = 0.1", "gas \"air\".viscous", "explicit, expected implicit"),
        ("densities = \"variable\"", "gas \"air\".densities", "variable, expected boussinesq"),
    ] {
        let text = format!(
            "version = 1\n[[gas]]\nname = \"air\"\nbox = {{ size = [1, 1, 1], resolution = 8 }}\norder = \"reflection\"\n{words}\n"
        );
        let error = Simulation::new(Scene::from_toml(&text).unwrap(), Default::default()).err().unwrap().to_string();
        assert!(error.contains(place) && error.contains(message), "{error}");
        assert!(Simulation::new(Scene::from_toml(&text.replace("reflection", "project_last")).unwrap(), Default::default()).is_ok());
    }
    // Smeared by linear interpolation it is of first order, so that it corrects where nothing else is said.
    let corrected = moving_vortex(32, 0.5, &format!("{REFLECTED}\nadvection.velocity.corrected = true"));
    assert_eq!(moving_vortex(32, 0.5, REFLECTED), corrected);
    assert!(moving_vortex(32, 0.5, &format!("{REFLECTED}\nadvection.velocity.corrected = false")) > 10.0 * corrected);
    assert!(moving_vortex(32, 0.5, LINEAR) > 10.0 * corrected);
}
