//! Stable Fluids in double precision: docs/theory/gas.md.

extern crate tumble_f64 as tumble;

use crate::common;

use common::{grid, largest, orders, run, show, simulation, step};
use std::f64::consts::PI;
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

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
fn a_taylor_green_vortex_decays_with_first_order_at_a_fixed_courant_number() {
    // h and dx shrink together: what interpolation loses in a step, dx² of it linear, adds up over 1/h steps, and the split is of
    // order 1 in h. Errors at 64 cells over the decayed amplitude 0.674: linear 4.8 %, corrected and cubic 1.2 %.
    for (name, words, worst) in [
        ("linear", "", 0.033),
        ("corrected", "advection = { velocity = { corrected = true } }", 0.0083),
        ("cubic", "advection = { velocity = { interpolation = \"cubic\" } }", 0.0084),
        ("lecture", "order = \"advect_last\"", 0.033),
        ("explicit", "viscous = \"explicit\"", 0.034),
    ] {
        let errors: Vec<f64> = [16, 32, 64].map(|n| taylor_green(n, 0.5, words)).to_vec();
        let orders = orders(&errors);
        println!("{name}: errors {} orders {}", show(&errors), show(&orders));
        // Measured at the finest: 0.863, 0.917, 0.943; 0.865 explicit; rising towards 1.
        assert!(orders[1] > 0.82 && orders[1] < 1.2 && orders[1] > orders[0] - 0.05, "{name}: orders {orders:?}");
        assert!(errors[2] < worst && errors[2] > 0.9 * worst, "{name}: {errors:?}");
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
    for viscous in ["implicit", "explicit"] {
        let sides = "sides = { x = [\"periodic\", \"periodic\"], z = [\"no_slip\", \"no_slip\"] }\nacceleration = [0.05, 0, 0]";
        let sim = channel(&format!("{sides}\nviscous = \"{viscous}\""), 60);
        let (u, points) = grid(&sim, "air", "velocity_x");
        let dx = 1.0 / 32.0;
        let z = |i: usize| ((i / points[0]) as f64 + 0.5) * dx;
        // u = a z (1 - z)/(2 nu), nu = 0.05. Second differences of a parabola are exact; the ghosts mirrored in the walls stand for
        // its chord, not its arc, which adds a dx²/(8 nu) everywhere: 1.2207e-4, to what 60 s leave of the start.
        let offset = 0.05 * dx * dx / (8.0 * 0.05);
        let error = u.iter().enumerate().map(|(i, u)| (u - 0.05 * z(i) * (1.0 - z(i)) / 0.1 - offset).abs()).fold(0.0, f64::max);
        if viscous == "explicit" {
            // Half the acceleration of a step is still there when a frame is taken: h a/2 = 6.25e-3, measured 6.37e-3.
            assert!(error > 0.9 * 6.25e-3 && error < 1.1 * 6.25e-3, "{error:e}");
            continue;
        }
        assert!(error < 1e-11, "{error:e}"); // 1e-13
        assert!((largest(&u) - 0.125).abs() < 1e-3);
    }
    let sim = channel("sides = { x = [\"periodic\", \"periodic\"], z = [\"no_slip\", { wall = { velocity = [0.3, 0, 0] } }] }", 60);
    let (u, points) = grid(&sim, "air", "velocity_x");
    let error = u.iter().enumerate().map(|(i, u)| (u - 0.3 * ((i / points[0]) as f64 + 0.5) / 32.0).abs()).fold(0.0, f64::max);
    assert!(error < 1e-11, "{error:e}"); // 1.4e-12
}

#[test]
fn what_rests_stays_at_rest_and_has_the_pressure_of_its_weight() {
    // Warm above cold: the weight of every layer is borne by the pressure.
    let mut sim = simulation(
        r#"
time = { fps = 24, frames = 10 }
[[gas]]
name = "air"
box = { size = [1, 0.5, 1], center = [0, 0, 0.5], resolution = 16 }
temperature = { ambient = 300, initial = "300 + 20*z" }
"#,
    );
    run(&mut sim, 10);
    let books = sim.ledger();
    // A step of gravity gives 0.027 m/s, of which 1e-10 may be left.
    assert!(books.speed.unwrap() < 1e-10, "{:e}", books.speed.unwrap());
    let (p, points) = grid(&sim, "air", "pressure");
    let n = points[0] * points[1];
    // dp/dz = rho g (T - T0)/T0 between the two middle cells, where T - T0 = 10.
    let rise = (p[n * 8] - p[n * 7]) * 16.0;
    let exact = 1.2 * 9.8 * 10.0 / 300.0;
    assert!((rise / exact - 1.0).abs() < 1e-6, "{rise} {exact}");
}

const PLUME: &str = r#"
time = { fps = 24, frames = 20 }
[[gas]]
name = "air"
box = { size = [1, 1, 1.5], center = [0, 0, 0.75], resolution = 24 }
smoke = { initial = "smoothstep(0.3, 0.1, hypot(x, y, z - 0.4))" }
temperature = { ambient = 300, initial = "300 + 100*smoothstep(0.3, 0.1, hypot(x - 0.02, y, z - 0.4))" }
viscosity = 1e-4
courant = 2
"#;

#[test]
fn a_frame_is_free_of_divergence_in_both_orders_and_with_every_solver() {
    for words in [
        "",
        "order = \"advect_last\"",
        "pressure = { method = \"sor\", iterations = 5000 }",
        "pressure = { method = \"cosine\" }",
        "pressure = { method = \"modified_incomplete_cholesky\", tolerance = 1e-6 }",
    ] {
        let mut sim = simulation(&format!("{PLUME}{words}\n"));
        let report = run(&mut sim, 4);
        assert_eq!(report.unconverged, 0, "{words}");
        let asked = if words.contains("1e-6") { 1e-6 } else { 1e-10 };
        assert!(report.residual.unwrap() <= asked && report.residual.unwrap() > 0.0, "{words}: {:e}", report.residual.unwrap());
        let fastest =
            ["velocity_x", "velocity_y", "velocity_z"].map(|name| largest(&grid(&sim, "air", name).0)).into_iter().fold(0.0, f64::max);
        let left = largest(&grid(&sim, "air", "divergence").0) / 24.0 * 1.5 / fastest;
        // The tolerance is over the velocity before the projection, which is a little faster.
        assert!(fastest > 0.1 && left < 3.0 * asked, "{words}: {left:e} at {fastest} m/s");
        // Over-relaxation may grow before it falls.
        assert!(report.pressure.last().is_some_and(|r| *r < 1e-3), "{words}: {:?}", report.pressure.last());
    }
}

#[test]
fn smoke_is_neither_made_nor_lost_but_by_advection() {
    let mut sim = simulation(PLUME);
    let before = sim.ledger().mass;
    // 4 pi int r² s(r) dr over the ball, by quadrature: 0.038537.
    assert!((before - 0.038537).abs() < 5e-5, "{before}"); // 0.038529
    run(&mut sim, 20);
    let books = sim.ledger();
    println!("mass {before} -> {}, speed {}, kinetic {}", books.mass, books.speed.unwrap(), books.kinetic);
    // Semi-Lagrangian advection conserves no sums: 20 frames of a puff of 10 cells at two cells a step lose 8.0 %.
    let lost = 1.0 - books.mass / before;
    assert!(lost.abs() < 0.09 && lost != 0.0, "{lost}");
    assert!(books.speed.unwrap() > 0.5 && books.speed.unwrap() < 3.0, "{}", books.speed.unwrap());
    // A fluid at rest loses none.
    let mut still = simulation(
        "time = { fps = 24, frames = 5 }\nworld = { gravity = [0, 0, 0] }\n[[gas]]\nname = \"air\"\nbox = { size = [1, 1, 1], resolution = 12 }\nsmoke = { initial = \"1 + x\" }\n",
    );
    let before = still.ledger().mass;
    run(&mut still, 5);
    assert_eq!(still.ledger().mass, before);
    assert!((before - 1.0).abs() < 1e-12);
}

#[test]
fn what_advection_loses_of_a_puff_falls_with_resolution() {
    // As it rises freely, and when it has met the ceiling, under which it is a layer of a cell or two.
    let lost = |n: usize| {
        let mut sim = simulation(&PLUME.replace("resolution = 24", &format!("resolution = {n}")));
        let before = sim.ledger().mass;
        let mut after = |frames: usize| {
            run(&mut sim, frames);
            (1.0 - sim.ledger().mass / before).abs()
        };
        [after(8), after(4), after(8)]
    };
    let (coarse, fine) = (lost(24), lost(48));
    println!("lost {coarse:?} {fine:?}");
    // 0.56 % and 0.05 %; 3.6 % and 2.3 %; 8.0 % and 7.3 %.
    assert!(coarse[0] > 0.004 && coarse[0] < 0.007 && fine[0] < 0.25 * coarse[0], "{coarse:?} {fine:?}");
    assert!(coarse[1] < 0.04 && fine[1] < 0.75 * coarse[1], "{coarse:?} {fine:?}");
    assert!(coarse[2] < 0.09 && fine[2] < 0.95 * coarse[2], "{coarse:?} {fine:?}");
}

#[test]
fn smoke_leaves_through_open_sides_and_is_never_less_than_none() {
    for corrected in ["true", "false"] {
        let mut sim = simulation(&format!(
            r#"
dimension = 2
time = {{ fps = 24, frames = 200 }}
[[gas]]
name = "air"
box = {{ size = [1, 1, 1.5], center = [0, 0, 0.75], resolution = 48 }}
sides = {{ x = ["open", "open"], z = ["no_slip", "open"] }}
smoke = {{ weight = 0 }}
temperature = {{ ambient = 300 }}
advection.scalars = {{ corrected = {corrected} }}
[[gas.source]]
shape = {{ sphere = {{ center = [0.01, 0, 0.2], radius = 0.12 }} }}
density = 1
temperature = 400
end = 1
"#
        ));
        let (mut least, mut most, mut peak) = (0.0_f64, 0.0_f64, 0.0_f64);
        for _ in 0..144 {
            step(&mut sim);
            let (smoke, _) = grid(&sim, "air", "density");
            least = smoke.iter().fold(least, |a, b| a.min(*b));
            most = smoke.iter().fold(most, |a, b| a.max(*b));
            peak = peak.max(sim.ledger().mass);
        }
        let left = sim.ledger().mass / peak;
        println!("corrected {corrected}: least {least:e} most {most} peak {peak} left {left}");
        assert!(least > -1e-15 && most < 1.0 + 1e-12 && most > 0.9, "{least:e} {most}");
        assert!(peak > 0.05 && left < 0.1, "{peak} {left}");
    }
}

#[test]
fn sources_and_fading_keep_their_rates() {
    let mut sim = simulation(
        r#"
time = { fps = 10, frames = 20 }
world = { gravity = [0, 0, 0] }
[[gas]]
name = "air"
box = { size = [1, 1, 1], resolution = 20 }
smoke = { dissipation = 0.5 }
temperature = { ambient = 300, initial = 310, cooling = 2 }
[[gas.source]]
shape = { box = { size = [0.4, 0.4, 0.4] } }
smoke = 3
start = 0.45
end = 1.0
"#,
    );
    run(&mut sim, 10);
    // M' = 3 0.4³ - M/2 from 0.45 to 1 s; fading comes first in each step of 0.1 s, so that what is born in a step fades from the next on.
    let rate = 3.0 * 0.4_f64.powi(3);
    let exact = (0..10).fold(0.0, |m, i| {
        m * (-0.05_f64).exp()
            + rate
                * if i < 4 {
                    0.0
                } else if i == 4 {
                    0.05
                } else {
                    0.1
                }
    });
    assert!((sim.ledger().mass / exact - 1.0).abs() < 1e-9, "{} {exact}", sim.ledger().mass);
    let (t, _) = grid(&sim, "air", "temperature");
    assert!((t[7] - 300.0 - 10.0 * (-2.0_f64).exp()).abs() < 1e-9, "{}", t[7]);
}

#[test]
fn a_fluid_takes_the_components_of_a_formula_each_along_its_own_axis() {
    // Without divergence, so that pressure takes nothing of it; periodic, and from rest, so that nothing is carried yet.
    let mut sim = simulation(
        "precision = \"double\"\ntime = { fps = 1000, frames = 1 }\nworld.gravity = [0, 0, 0]\n[[system]]\nmethod = \"gas\"\nsubsteps = 1\n[[gas]]\nname = \"air\"\nbox = { size = [1, 1, 1], resolution = 10 }\n\
         sides = { x = [\"periodic\", \"periodic\"], y = [\"periodic\", \"periodic\"], z = [\"periodic\", \"periodic\"] }\nacceleration = [\"sin(2*pi*z)\", \"2*cos(2*pi*x)\", \"3*sin(2*pi*y)\"]\n",
    );
    step(&mut sim);
    for (axis, name) in ["velocity_x", "velocity_y", "velocity_z"].into_iter().enumerate() {
        let (u, points) = grid(&sim, "air", name);
        let mut most = 0.0_f64;
        for (i, u) in u.iter().enumerate() {
            let at = [i % points[0], i / points[0] % points[1], i / points[0] / points[1]];
            let x: [f64; 3] = std::array::from_fn(|a| (at[a] as f64 + if a == axis { 0.0 } else { 0.5 }) / 10.0 - 0.5);
            let turn = 2.0 * PI;
            let a = [(turn * x[2]).sin(), 2.0 * (turn * x[0]).cos(), 3.0 * (turn * x[1]).sin()][axis];
            assert!((u - 1e-3 * a).abs() < 1e-9, "{name} at {x:?}: {u} {}", 1e-3 * a);
            most = most.max(u.abs());
        }
        assert!(most > 0.9e-3, "{name}: {most}");
    }
}

#[test]
fn sources_give_what_their_keys_and_formulas_integrate_to() {
    // A region of 0.4 x 0.4 x 0.4 m in a box at rest, and its rates over a second.
    let given = |words: &str| {
        let mut sim = simulation(&format!(
            "time = {{ fps = 10, frames = 10 }}\nworld.gravity = [0, 0, 0]\n[[gas]]\nname = \"air\"\nbox = {{ size = [1, 1, 1], resolution = 20 }}\nsmoke = {{}}\ntemperature.ambient = \
             300\nfire = {{ ignition = 1e4 }}\n[[gas.source]]\nshape.box.size = [0.4, 0.4, 0.4]\n{words}\n"
        ));
        run(&mut sim, 10);
        let middle = |column: &str| grid(&sim, "air", column).0[10 + 20 * 10 + 400 * 10];
        [middle("density"), middle("temperature") - 300.0, middle("fuel")]
    };
    // The jump of the steps lies within a step of time.
    for (words, exact) in [
        ("smoke = { keys = [[0, 2], [0.55, 0]], interpolation = \"step\" }", [1.1, 0.0, 0.0]),
        ("smoke = { keys = [[0.25, 0], [0.75, 4]] }", [0.5 * 0.5 * 4.0 + 0.25 * 4.0, 0.0, 0.0]),
        ("smoke = \"3*t^2\"\nheating = \"10*t\"", [1.0, 5.0, 0.0]),
        ("fuel = { keys = [[0, 1], [1, 0]] }", [0.0, 0.0, 0.5]),
        ("heating = { keys = [[0, 0], [0.5, 8], [1, 0]] }\nstart = 0.25", [0.0, 3.5, 0.0]),
        // Held values are those at the end.
        ("density = { keys = [[0, 1], [1, 3]] }\ntemperature = \"300 + 7*t\"\nfuel_density = \"t/4\"", [3.0, 7.0, 0.25]),
    ] {
        let given = given(words);
        assert!(given.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-9), "{words}: {given:?} {exact:?}");
    }
}

#[test]
fn a_shift_by_whole_cells_changes_nothing() {
    let plume = |shift: f64| {
        let mut sim = simulation(&format!(
            r#"
time = {{ fps = 24, frames = 3 }}
dimension = 2
[[gas]]
name = "air"
box = {{ size = [2, 1, 1], resolution = 64 }}
sides = {{ x = ["periodic", "periodic"] }}
temperature = {{ ambient = 300 }}
smoke = {{}}
[[gas.source]]
shape = {{ box = {{ center = [{shift}, 0, -0.25], size = [0.25, 1, 0.125] }} }}
temperature = 400
density = 1
"#
        ));
        run(&mut sim, 3);
        let (s, points) = grid(&sim, "air", "density");
        (0..s.len()).map(|i| (i / points[0], i % points[0], s[i])).collect::<Vec<_>>()
    };
    // 0.25 m are 8 cells.
    let (a, b) = (plume(0.0), plume(0.25));
    let shifted = |j: usize, i: usize| b[j * 64 + (i + 8) % 64].2;
    assert!(a.iter().any(|(_, _, s)| *s > 0.5));
    let worst = a.iter().map(|(j, i, s)| (s - shifted(*j, *i)).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-9, "{worst:e}"); // the pressure solver sees another lattice: its tolerance is left
}

#[test]
fn a_broken_number_is_told_with_its_cell() {
    // A root of negative numbers at low x, from the second frame on.
    let mut sim = simulation(&format!("{PLUME}acceleration = [\"sqrt(x + 1 - step(1/24, t))\", 0, 0]\n"));
    step(&mut sim);
    let hash = sim.hash();
    let error = sim.step(&|| true).unwrap_err().to_string();
    println!("{error}");
    // Not at the wall, where the velocity is given.
    assert!(error.contains("first bad velocity in \"air\", cell [1, 0, 0] at [-0.4375, -0.46875, 0.03125] m"), "{error}");
    assert_eq!(sim.hash(), hash);
    // Too fast for any number of sub-steps.
    let mut t = vec![300.0; 16 * 16 * 24];
    t[16 * 16 * 3 + 16 * 2 + 1] = 1e200;
    sim.write("air", "temperature", &t).unwrap();
    let error = sim.step(&|| true).unwrap_err().to_string();
    assert!(error.contains("\"air\"") && error.contains("sub-steps; raise courant"), "{error}");
}

/// The cavity under a lid that moves at 1 m/s, at Reynolds number 1/viscosity.
fn cavity(n: usize, viscosity: f64, courant: f64, tolerance: f64) -> Simulation {
    simulation(&format!(
        r#"
dimension = 2
time = {{ fps = 1, frames = 1 }}
[[gas]]
name = "fluid"
box = {{ size = [1, 1, 1], center = [0.5, 0, 0.5], resolution = {n} }}
sides = {{ x = ["no_slip", "no_slip"], z = ["no_slip", {{ wall = {{ velocity = [1, 0, 0] }} }}] }}
fluid_density = 1
viscosity = {viscosity}
advection = {{ velocity = {{ interpolation = "cubic" }} }}
courant = {courant}
pressure = {{ tolerance = {tolerance:e} }}
"#
    ))
}

/// Largest difference from a table of one component along the line through the middle across it.
fn off_line(sim: &Simulation, column: &str, table: &[(f64, f64)]) -> f64 {
    let (u, points) = grid(sim, "fluid", column);
    let (along_z, lid) = (column == "velocity_x", if column == "velocity_x" { 1.0 } else { 0.0 });
    let n = if along_z { points[1] } else { points[0] };
    let line: Vec<f64> = (0..n).map(|i| if along_z { u[i * points[0] + n / 2] } else { u[n / 2 * points[0] + i] }).collect();
    let at = |z: f64| {
        let x = z * n as f64 - 0.5;
        let i = (x.floor() as usize).min(n - 2);
        // Beyond the last middle of a cell the wall is half a cell away.
        let beyond = x - (n - 1) as f64;
        if beyond > 0.0 { line[n - 1] + (lid - line[n - 1]) * beyond / 0.5 } else { line[i] + (line[i + 1] - line[i]) * (x - i as f64) }
    };
    table.iter().map(|(z, u)| (at(*z) - u).abs()).fold(0.0, f64::max)
}

/// Heights at which Ghia, Ghia and Shin give u on x = 0.5, with its converged values at Re 100, 400 and 1000.
const LID: [(f64, [f64; 3]); 15] = [
    (0.9766, [0.84348, 0.76034, 0.66409]),
    (0.9688, [0.79161, 0.68679, 0.58047]),
    (0.9609, [0.74071, 0.62026, 0.51727]),
    (0.9531, [0.69118, 0.56178, 0.47252]),
    (0.8516, [0.23645, 0.29201, 0.33718]),
    (0.7344, [0.00415, 0.16254, 0.18863]),
    (0.6172, [-0.13881, 0.02102, 0.05699]),
    (0.5, [-0.20915, -0.11505, -0.06207]),
    (0.4531, [-0.21398, -0.17145, -0.10819]),
    (0.2812, [-0.15765, -0.32875, -0.28044]),
    (0.1719, [-0.10173, -0.24376, -0.38864]),
    (0.1016, [-0.06441, -0.14615, -0.30032]),
    (0.0703, [-0.04663, -0.10332, -0.22287]),
    (0.0625, [-0.04198, -0.09260, -0.20227]),
    (0.0547, [-0.03722, -0.08181, -0.18120]),
];

#[test]
#[ignore = "long: make validate"]
fn the_cavity_of_ghia_at_re_100() {
    let mut sim = cavity(64, 0.01, 0.5, 1e-10);
    run(&mut sim, 30);
    let worst = off_line(&sim, "velocity_x", &LID.map(|(z, u)| (z, u[0])));
    let before = sim.ledger().kinetic;
    step(&mut sim);
    println!("cavity: {worst:.4}, kinetic {before} -> {}", sim.ledger().kinetic);
    assert!((sim.ledger().kinetic / before - 1.0).abs() < 1e-4);
    // The goal is 2 % of the lid's speed; measured 0.40 %.
    assert!(worst < 0.006, "{worst}");
}

#[test]
#[ignore = "long: make validate"]
fn the_cavity_of_ghia_at_128_squared() {
    // The same along z = 0.5: w at Re 100 and 1000.
    let w: [(f64, [f64; 2]); 15] = [
        (0.9688, [-0.06229, -0.22827]),
        (0.9609, [-0.07790, -0.29331]),
        (0.9531, [-0.09334, -0.35506]),
        (0.9453, [-0.10851, -0.41024]),
        (0.9062, [-0.17716, -0.52647]),
        (0.8594, [-0.23371, -0.42643]),
        (0.8047, [-0.25354, -0.32020]),
        (0.5, [0.05754, 0.02579]),
        (0.2344, [0.17956, 0.32541]),
        (0.2266, [0.17936, 0.33406]),
        (0.1562, [0.16481, 0.37694]),
        (0.0938, [0.12639, 0.33298]),
        (0.0781, [0.11178, 0.30995]),
        (0.0703, [0.10360, 0.29629]),
        (0.0625, [0.09481, 0.28070]),
    ];
    // Semi-Lagrangian with cubic interpolation and RK2, implicit viscosity, a quarter of a cell a step: where the flow has settled,
    // what is left is of first order in the step (half a cell: 1.97 % and 2.42 % at Re 1000; two cells: 4.7 % and 5.2 %), and no
    // better with MacCormack's correction (1.49 % and 1.92 %). Steps of a cell settle it first, which is four times as fast.
    for (i, (re, fast, slow)) in [(100.0, 20, 10), (400.0, 30, 20), (1000.0, 40, 35)].into_iter().enumerate() {
        let mut first = cavity(128, 1.0 / re, 1.0, 1e-6);
        run(&mut first, fast);
        let mut sim = cavity(128, 1.0 / re, 0.25, 1e-6);
        for face in ["velocity_x", "velocity_z"] {
            sim.write("fluid", face, &grid(&first, "fluid", face).0).unwrap();
        }
        run(&mut sim, slow - 1);
        let before = sim.ledger().kinetic;
        step(&mut sim);
        let change = sim.ledger().kinetic / before - 1.0;
        let u = off_line(&sim, "velocity_x", &LID.map(|(z, u)| (z, u[i])));
        let of_w = if i == 1 { 0.0 } else { off_line(&sim, "velocity_z", &w.map(|(x, w)| (x, w[i / 2]))) };
        println!(
            "cavity, 128², Re {re}, semi-Lagrangian cubic, 0.25 cells a step: u off by {:.2} %, w by {:.2} % of the lid's speed (aim: 2 %); \
             energy grows by {change:.1e} in the last second",
            100.0 * u,
            100.0 * of_w
        );
        assert!(change.abs() < 1e-3, "{re} {change}");
        assert!(u < 0.02 && of_w < 0.02, "{re} {u} {of_w}");
    }
}
