//! Masses that touch rigid bodies, and what bodies get of it. See docs/theory/coupling.md.

use crate::common;

use common::{Vector, column, run, simulation, step};
use std::fmt::Write;
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

const G: f64 = 9.81;

fn scene_of(integrator: &str, gravity: f64, exchanges: u32, first: bool, words: &str) -> Simulation {
    let substeps = if integrator.starts_with("implicit") { 1 } else { 8 };
    let systems = [
        format!("[[system]]\nname = \"masses\"\nintegrator = \"{integrator}\"\nsubsteps = {substeps}\n"),
        "[[system]]\nname = \"bodies\"\nmethod = \"rigid\"\n".to_string(),
    ];
    let systems = if first { systems.concat() } else { systems.into_iter().rev().collect() };
    simulation(&format!("time = {{ fps = 100, exchanges = {exchanges} }}\nworld.gravity = [0, 0, -{gravity}]\n{systems}{words}"))
}

fn scene(integrator: &str, gravity: f64, words: &str) -> Simulation {
    scene_of(integrator, gravity, 5, true, words)
}

/// Points without links, each of this mass.
fn points(places: &[[f64; 3]], mass: f64, velocity: [f64; 3]) -> String {
    format!("[[particles]]\nname = \"p\"\nposition = {places:?}\nmass = [{mass}]\nvelocity = [{velocity:?}]\n")
}

fn body(shape: &str, mass: f64, at: [f64; 3], more: &str) -> String {
    format!("[[body]]\nname = \"b\"\nshape = {{ {shape} }}\nmass = {mass}\nposition = [{at:?}]\n{more}\n")
}

const CUBE: &str = "box = { size = [0.4, 0.4, 0.4] }";

/// The change of momentum and angular momentum from one ledger to another.
fn lost(start: &tumble_interface::engine::Ledger, end: &tumble_interface::engine::Ledger) -> [f64; 2] {
    let apart = |a: [f64; 3], b: [f64; 3]| (Vector::from(a) - Vector::from(b)).norm();
    [apart(start.momentum, end.momentum), apart(start.angular_momentum.unwrap(), end.angular_momentum.unwrap())]
}

#[test]
fn what_masses_lose_a_body_gains() {
    let shapes = [
        CUBE,
        "cylinder = { radius = 0.2, height = 0.4 }",
        "capsule = { radius = 0.1, length = 0.3 }",
        "hull = { points = [[0, 0, 0.3], [0.3, 0, -0.1], [-0.2, 0.3, -0.1], [-0.2, -0.3, -0.1]] }",
    ];
    for (integrator, shape) in ["velocity_verlet", "implicit_euler", "position_based", "velocity_verlet"].into_iter().zip(shapes) {
        // A sheet that a spinning body flies into, off its centre.
        let words =
            "[[sheet]]\nname = \"s\"\nsize = [1, 1]\nresolution = [12, 12]\ndensity = 0.5\nlinks = { structural = 200, shear = 50 }\n"
                .to_string()
                + &body(
                    shape,
                    0.3,
                    [0.15, 0.1, 0.5],
                    "velocity = [[0.2, 0, -2]]\nangular_velocity = [[1, 2, 3]]\nfriction = 0.4\nthickness = 0.02",
                );
        let mut sim = scene(integrator, 0.0, &words);
        let start = sim.ledger();
        run(&mut sim, 60);
        let [momentum, angular] = lost(&start, &sim.ledger());
        let slowed = column(&sim, "b", "velocity")[0].z;
        assert!(slowed > -1.5, "{integrator} {shape}: {slowed}");
        run(&mut sim, 140);
        let [later, turned] = lost(&start, &sim.ledger());
        // Implicit Euler does not keep angular momentum by itself.
        let kept = integrator == "implicit_euler" || angular.max(turned) < 1e-12;
        assert!(momentum.max(later) < 1e-12 && kept, "{integrator} {shape}: {momentum:e} {angular:e} {later:e} {turned:e}");
    }
}

#[test]
fn a_blow_gives_a_free_body_what_its_mass_and_inertia_take() {
    // 0.1 kg at 3 m/s meets a cube of 1 kg, 0.1 m off its centre, elastically: J = (1 + e) v/(1/m + 1/M + r²/I).
    for (restitution, friction) in [(1.0, 0.0), (0.5, 0.0), (0.0, 0.0)] {
        let words = points(&[[0.1, 0.0, 1.0]], 0.1, [0.0, 0.0, -3.0])
            + &body(CUBE, 1.0, [0.0; 3], &format!("restitution = {restitution}\nfriction = {friction}"));
        let mut sim = scene("velocity_verlet", 0.0, &words);
        // It arrives after 0.2667 s.
        run(&mut sim, 27);
        let inertia = 0.4 * 0.4 / 6.0;
        let j = (1.0 + restitution) * 3.0 / (10.0 + 1.0 + 0.01 / inertia);
        let (v, w, p) = (column(&sim, "b", "velocity")[0], column(&sim, "b", "angular_velocity")[0], column(&sim, "p", "velocity")[0]);
        assert!((v.z + j).abs() < 1e-4 * j && (w.y - 0.1 * j / inertia).abs() < 1e-4 * w.y, "e = {restitution}: {v:?} {w:?}, expected {j}");
        assert!((p.z - (10.0 * j - 3.0)).abs() < 1e-3 * j, "e = {restitution}: {p:?}");
    }
}

#[test]
fn what_slides_on_a_slab_takes_it_along() {
    // On a rail without friction: the two end with v m/(m + M), after m has slid v²/(2 mu g (1 + m/M)).
    let (m, slab, mu, v) = (0.5, 1.0, 0.3, 2.0);
    let words = points(&[[-0.9, 0.0, 0.1]], m, [v, 0.0, 0.0])
        + &body("box = { size = [2, 1, 0.2] }", slab, [0.0; 3], &format!("friction = {mu}"))
        + "[[joint]]\nname = \"rail\"\nbetween = [\"b\"]\nkind = { slider = { axis = [1, 0, 0] } }\n";
    let mut sim = scene_of("velocity_verlet", G, 20, true, &words);
    run(&mut sim, 100);
    let [p, b] = ["p", "b"].map(|name| (column(&sim, name, "position")[0].x, column(&sim, name, "velocity")[0].x));
    let (end, way) = (v * m / (m + slab), v * v / (2.0 * mu * G * (1.0 + m / slab)));
    assert!((p.1 - end).abs() < 1e-3 * end && (b.1 - end).abs() < 1e-3 * end, "{p:?} {b:?}, expected {end}");
    assert!((p.0 + 0.9 - b.0 - way).abs() < 5e-3 * way, "{} of {way}", p.0 + 0.9 - b.0);
}

#[test]
fn a_slab_on_the_floor_is_rubbed_as_coulomb_says() {
    // The slab yields along the floor and not into it: mu m g acts on both all the same, and along the slide, whatever its direction.
    let (m, slab, mu, v) = (0.8, 0.4, 0.2, [1.2, 0.5, 0.0]);
    let words = points(&[[-0.6, -0.3, 0.1]], m, v)
        + &body("box = { size = [2, 2, 0.2] }", slab, [0.0; 3], &format!("friction = {mu}"))
        + "[[collider]]\nname = \"floor\"\nshape = { floor = { height = -0.1 } }\nfriction = 0\n";
    let mut sim = scene_of("velocity_verlet", G, 10, true, &words);
    // The friction of the slab is that of its floor, too: the larger of the two.
    run(&mut sim, 15);
    let [p, b] = ["p", "b"].map(|name| column(&sim, name, "velocity")[0]);
    let (speed, t) = (f64::hypot(v[0], v[1]), 0.15);
    let (took, got) = (speed - f64::hypot(p.x, p.y), f64::hypot(b.x, b.y));
    let floor = mu * (m + slab) * G;
    assert!(floor > mu * m * G, "{floor}");
    assert!((took - mu * G * t).abs() < 0.01 * mu * G * t, "{took} of {}; slab {got}", mu * G * t);
    assert!((p.y / p.x - v[1] / v[0]).abs() < 1e-3, "{p:?}");
}

#[test]
fn a_rain_on_a_light_plate_moves_it_no_faster_than_itself() {
    let places: Vec<[f64; 3]> =
        (0..400).map(|i| [0.04 * f64::from(i % 20) - 0.38, 0.04 * f64::from(i / 20) - 0.38, 0.1 + 1e-4 * f64::from(i)]).collect();
    let words = points(&places, 0.01, [0.0, 0.0, -1.0]) + &body("box = { size = [1, 1, 0.1] }", 0.02, [0.0; 3], "inertia = [9, 9, 9]");
    let mut sim = scene("velocity_verlet", 0.0, &words);
    let start = sim.ledger();
    for _ in 0..100 {
        step(&mut sim);
        assert!(column(&sim, "b", "velocity")[0].norm() < 1.02);
    }
    assert!(lost(&start, &sim.ledger())[0] < 1e-13);
    let speed = column(&sim, "b", "velocity")[0].z;
    // 4 kg against 0.02 kg.
    assert!((speed + 4.0 / 4.02).abs() < 0.005, "{speed}");
    let below = column(&sim, "p", "position").into_iter().filter(|p| p.z < column(&sim, "b", "position")[0].z).count();
    assert_eq!(below, 0);
}

#[test]
fn nothing_passes_at_a_hundred_metres_a_second() {
    for (mass, thin) in [(10.0, 0.01), (0.1, 0.01)] {
        let shape = format!("box = {{ size = [1, 1, {thin}] }}");
        let words = points(&[[0.1, 0.2, 0.5], [-0.1, -0.2, 0.5], [0.3, 0.1, 0.7], [-0.3, -0.1, 0.7]], 0.1, [0.0, 0.0, -100.0])
            + &body(&shape, mass, [0.0; 3], "inertia = [9, 9, 9]");
        let mut sim = scene("velocity_verlet", 0.0, &words);
        run(&mut sim, 10);
        let (b, turn) = (column(&sim, "b", "velocity")[0], column(&sim, "b", "angular_velocity")[0]);
        assert!(b.z < -1.0 && turn.norm() < 0.5, "{b:?} {turn:?}");
        let center = column(&sim, "b", "position")[0];
        for p in column(&sim, "p", "position") {
            assert!(p.z > center.z, "{mass}: {p:?} is behind {center:?}");
        }
    }
}

/// Half-span of a rope between two pins [m], EA [N], and its springs.
const SPAN: f64 = 0.5;
const EA: f64 = 300.0;
const SPRINGS: u32 = 60;

/// Where the centre of a roller of 2 kg comes to rest that hangs across the rope, which weighs 0.12 kg.
fn slung(integrator: &str, substeps: u32) -> f64 {
    let mut words = format!(
        "time = {{ fps = 100, exchanges = 10 }}\nworld.gravity = [0, 0, -{G}]\n[[system]]\nname = \"masses\"\nintegrator = \"{integrator}\"\nsubsteps = {substeps}\n\
         [[system]]\nname = \"bodies\"\nmethod = \"rigid\"\n[[force]]\nkind = \"drag\"\ncoefficient = 0.8\n\
         [[particles]]\nname = \"rope\"\nmass = [0.002]\npin = [\"vertex 0\", \"vertex {SPRINGS}\"]\nposition = ["
    );
    (0..=SPRINGS).for_each(|i| write!(words, "[{}, 0, 0], ", SPAN * (2.0 * f64::from(i) / f64::from(SPRINGS) - 1.0)).unwrap());
    words += "]\nspring = [";
    let k = EA * f64::from(SPRINGS) / (2.0 * SPAN);
    (1..=SPRINGS).for_each(|i| write!(words, "{{ between = [{}, {i}], stiffness = {k}, damping = 0.3 }}, ", i - 1).unwrap());
    words += "]\n";
    // Near where it will hang.
    words += &body("capsule = { radius = 0.1, length = 0.4 }", 2.0, [0.0, 0.0, 0.1], "rotate = [[90, 0, 0]]\nfriction = 0");
    let mut sim = simulation(&words);
    run(&mut sim, 150);
    let speed = column(&sim, "b", "velocity")[0].norm();
    assert!(speed < 6e-3, "{integrator}: {speed}");
    column(&sim, "b", "position")[0].z
}

/// How far below the pins it hangs: the rope is straight up to where it wraps around, with some 0.06 kg between.
fn depth(radius: f64) -> f64 {
    let excess = |d: f64| {
        let far = SPAN.hypot(d);
        let angle = d.atan2(SPAN) + (radius / far).asin();
        let length = 2.0 * ((far * far - radius * radius).sqrt() + radius * angle);
        2.0 * EA * (length / (2.0 * SPAN) - 1.0) * angle.sin() - 2.06 * G
    };
    let (mut low, mut high) = (-radius, 1.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if excess(middle) < 0.0 { low = middle } else { high = middle }
    }
    low
}

#[test]
fn a_roller_hangs_in_a_rope_where_statics_says() {
    // 0.1 m less where nothing gives way.
    let wanted = depth(0.1);
    let sag = -slung("symplectic_euler", 16);
    assert!((sag - wanted).abs() < 0.003 * (wanted + 0.1) && wanted > 0.1, "{sag} of {wanted}");
    // Within a sub-step others see masses yield to their springs, which h² k/m and h c/m of a mass make weaker.
    for (integrator, n, order) in [("velocity_verlet", 8, 1), ("implicit_euler", 4, 1), ("position_based", 8, 2)] {
        let [coarse, fine] = [n, 2 * n].map(|n| -slung(integrator, n) - sag);
        let ratio = coarse / fine / f64::from(1 << order);
        assert!(coarse > 2e-4 && (0.75..1.3).contains(&ratio), "{integrator}: {coarse} {fine}");
    }
}

#[test]
fn springs_too_stiff_for_their_sub_steps_are_told_and_so_is_what_starts_inside() {
    let of = |integrator: &str, more: &str| -> Vec<String> {
        let words = format!(
            "[[sheet]]\nname = \"s\"\nsize = [1, 1]\nresolution = [9, 9]\ndensity = 0.3\nlinks = {{ structural = 4e5 }}\n{}{more}",
            body("sphere = { radius = 0.2 }", 1.0, [0.0, 0.0, 0.21], "")
        );
        scene_of(integrator, G, 10, true, &words).warnings().iter().map(|w| format!("{} {} {}", w.code.name(), w.path, w.message)).collect()
    };
    let told = of("position_based", "[[particles]]\nname = \"p\"\nposition = [[0, 0, 0.3]]\n");
    assert!(told.iter().any(|w| w.starts_with("yielding-masses system \"masses\"") && w.contains("sub-steps")), "{told:?}");
    assert!(told.iter().any(|w| w.starts_with("starts-inside \"p\"") && w.contains("0.11 m inside body \"b\"")), "{told:?}");
    assert_eq!(of("symplectic_euler", ""), [""; 0]);
    // A liquid touches bodies, too.
    let liquid = "[[particles]]\nname = \"l\"\nfluid = { spacing = 0.05, fill = [{ center = [1, 1, 0.1], size = [0.2, 0.2, 0.2] }] }\n";
    assert!(!of("position_based", liquid).iter().any(|w| w.starts_with("unfelt body")));
}

#[test]
fn a_light_ball_lies_still_on_a_heavy_sheet() {
    for integrator in ["velocity_verlet", "implicit_euler", "position_based"] {
        let words =
            "[[sheet]]\nname = \"s\"\nsize = [1, 1]\nresolution = [16, 16]\ndensity = 1\nlinks = { structural = { modulus = 400, damping = 0.5 }, shear = { modulus = 100, damping = 0.5 } }\npin = [\"edge x-\", \"edge x+\", \"edge y-\", \"edge y+\"]\n[[force]]\nkind = \"drag\"\ncoefficient = 0.01\n"
                .to_string()
                + &body("sphere = { radius = 0.15 }", 0.05, [0.0, 0.0, 0.2], "thickness = 0.01\nfriction = 0.5");
        let mut sim = scene(integrator, G, &words);
        run(&mut sim, 400);
        let mut fastest = 0.0_f64;
        let start = column(&sim, "b", "position")[0];
        for _ in 0..100 {
            step(&mut sim);
            fastest = fastest.max(column(&sim, "b", "velocity")[0].norm());
        }
        let end = column(&sim, "b", "position")[0];
        let under = column(&sim, "s", "position").into_iter().map(|p| p.z).fold(0.0, f64::min);
        assert!(fastest < 0.05 && (end - start).norm() < 0.01, "{integrator}: {fastest} {start:?} {end:?}");
        // 0.15 m above the lowest vertex, but for thickness and the mesh.
        assert!((end.z - under - 0.16).abs() < 0.02, "{integrator}: {} over {under}", end.z);
    }
}

#[test]
fn a_mass_between_a_body_and_the_floor_stays_out_of_the_floor() {
    let words = points(&[[0.0, 0.0, 0.0]], 0.01, [0.0; 3])
        + &body(CUBE, 5.0, [0.0, 0.0, 0.3], "")
        + "[[collider]]\nname = \"floor\"\nshape = { floor = {} }\n";
    let mut sim = scene("velocity_verlet", G, &words);
    run(&mut sim, 100);
    let (p, b) = (column(&sim, "p", "position")[0], column(&sim, "b", "position")[0]);
    assert!(p.z > -1e-9 && (b.z - 0.2).abs() < 2e-3, "{p:?} {b:?}");
}

#[test]
fn the_order_of_systems_and_the_interval_matter_less_and_less() {
    // A body falls on a mass on a spring and goes on with it.
    let after = |exchanges: u32, first: bool| {
        let words = "[[particles]]\nname = \"p\"\nposition = [[0, 0, 0], [0, 0, -1]]\nmass = [0.5]\npin = [\"vertex 1\"]\nspring = [{ between = [0, 1], stiffness = 100, damping = 0.5 }]\n".to_string()
            + &body("sphere = { radius = 0.1 }", 1.0, [0.0, 0.0, 0.1], "");
        let mut sim = scene_of("velocity_verlet", G, exchanges, first, &words);
        run(&mut sim, 20);
        column(&sim, "b", "position")[0].z
    };
    let [coarse, fine, finest] = [2, 4, 8].map(|n| [true, false].map(|first| after(n, first)));
    let apart = |x: [f64; 2]| (x[0] - x[1]).abs();
    assert!(apart(coarse) > 1e-6, "{coarse:?}");
    assert!(apart(fine) < 0.65 * apart(coarse) && apart(finest) < 0.65 * apart(fine), "{coarse:?} {fine:?} {finest:?}");
    // Together they swing about g (m + M)/k with w² = k/(m + M).
    let (w, sag) = ((100.0_f64 / 1.5).sqrt(), 1.5 * G / 100.0);
    let exact = 0.1 - sag * (1.0 - (w * 0.2).cos());
    assert!((finest[0] - exact).abs() < 0.05 * sag, "{finest:?} {exact}");
}

#[test]
fn momentum_is_kept_whichever_system_goes_first() {
    let words = points(&[[0.1, 0.05, 0.6], [-0.1, 0.0, 0.7]], 0.2, [0.0, 0.3, -2.0])
        + &body(CUBE, 0.5, [0.0; 3], "restitution = 0.7\nfriction = 0.4\nangular_velocity = [[2, 1, 0]]");
    let mut sim = scene_of("rk4", 0.0, 3, false, &words);
    let start = sim.ledger();
    // What is on its way belongs to neither side.
    run(&mut sim, 100);
    let [momentum, angular] = lost(&start, &sim.ledger());
    // Moments have a rounding in each of 300 intervals.
    assert!(momentum < 1e-14 && angular < 300.0 * f64::EPSILON, "{momentum:e} {angular:e}");
    assert!(column(&sim, "b", "velocity")[0].z < -0.3);
}

#[test]
fn near_an_edge_a_blow_goes_along_the_normal_of_the_face() {
    // 1.5 mm beside the edge of a plate, without friction: half a sub-step later the mass is beyond the edge, which is nearer then.
    let words = points(&[[0.296, 0.0, 0.2075]], 0.01, [20.0, 0.0, -20.0])
        + &body("box = { size = [1, 1, 0.01] }", 1.0, [0.0; 3], "friction = 0\nrestitution = 1");
    let mut sim = scene("velocity_verlet", 0.0, &words);
    run(&mut sim, 10);
    let (p, b) = (column(&sim, "p", "velocity")[0], column(&sim, "b", "velocity")[0]);
    assert!((p.x - 20.0).abs() < 1e-9 && b.x.abs() < 1e-12 && p.z > 15.0 && b.z < -0.1, "{p:?} {b:?}");
}

#[test]
fn a_heavy_load_on_a_light_plate_rests_on_the_floor() {
    let places: Vec<[f64; 3]> = (0..25).map(|i| [0.1 * f64::from(i % 5) - 0.2, 0.1 * f64::from(i / 5) - 0.2, 0.06]).collect();
    let words = points(&places, 0.4, [0.0; 3])
        + &body("box = { size = [0.6, 0.6, 0.04] }", 0.1, [0.0, 0.0, 0.02], "")
        + "[[collider]]\nname = \"floor\"\nshape = { floor = {} }\n";
    let mut sim = scene("velocity_verlet", G, &words);
    run(&mut sim, 200);
    let lowest = column(&sim, "p", "position").into_iter().map(|p| p.z).fold(1.0, f64::min);
    let fastest = column(&sim, "p", "velocity").into_iter().map(|v| v.norm()).fold(0.0, f64::max);
    let plate = column(&sim, "b", "position")[0].z;
    assert!((lowest - 0.04).abs() < 2e-3 && fastest < 0.05 && (plate - 0.02).abs() < 2e-3, "{lowest} {fastest} {plate}");
}

#[test]
fn a_plate_is_borne_beside_its_centre_after_a_restore() {
    let words = points(&[[0.3, 0.1, 0.1]], 1.0, [0.0; 3])
        + &body("box = { size = [1, 1, 0.1] }", 0.5, [0.0, 0.0, 0.05], "")
        + "[[collider]]\nname = \"floor\"\nshape = { floor = {} }\n";
    let build = || scene("velocity_verlet", G, &words);
    let mut whole = build();
    run(&mut whole, 10);
    let kept = whole.save(&[]);
    let mut cut = build();
    cut.restore(&kept).unwrap();
    run(&mut whole, 1);
    run(&mut cut, 1);
    for (name, what) in [("p", "position"), ("p", "velocity"), ("b", "position"), ("b", "angular_velocity")] {
        assert!(column(&whole, name, what) == column(&cut, name, what), "{name} {what}");
    }
}

#[test]
fn masses_that_are_held_bear_a_body_and_a_led_one_pushes_it() {
    let places: Vec<[f64; 3]> = (0..9).map(|i| [0.15 * f64::from(i % 3) - 0.15, 0.15 * f64::from(i / 3) - 0.15, 0.0]).collect();
    let words = points(&places, 0.1, [0.0; 3]).replace("mass =", "pin = [\"all\"]\nmass =") + &body(CUBE, 3.0, [0.0, 0.0, 0.25], "");
    let mut sim = scene("velocity_verlet", G, &words);
    run(&mut sim, 200);
    let (b, v) = (column(&sim, "b", "position")[0], column(&sim, "b", "velocity")[0]);
    assert!((b.z - 0.2).abs() < 2e-3 && v.norm() < 0.02, "{b:?} {v:?}");
}

#[test]
fn what_an_anchor_ties_does_not_touch_a_body() {
    let free = body(CUBE, 1.0, [0.0, 0.0, 0.1], "velocity = [[0, 0, -1]]");
    let tied = points(&[[0.1, 0.0, 0.1]], 0.1, [0.0, 0.0, -1.0])
        + "[[anchor]]\nname = \"a\"\nbetween = [\"p 0\", \"b 0\"]\nat = [0.1, 0, 0.1]\nstiffness = 10\nrest_length = 0\n";
    let mut sim = scene("velocity_verlet", G, &(tied + &free));
    assert!(sim.warnings().iter().all(|w| w.code.name() != "starts-inside"), "{:?}", sim.warnings());
    run(&mut sim, 20);
    let exact = 0.1 - 0.2 - 0.5 * G * 0.04;
    let z = column(&sim, "b", "position")[0].z;
    assert!((z - exact).abs() < 1e-3, "{z} of {exact}");
}

#[test]
fn a_cut_interval_leaves_nothing_behind() {
    let words = points(&[[0.05, 0.0, 0.2]], 1.0, [0.0, 0.0, -1.0]) + &body(CUBE, 1.0, [0.0; 3], "");
    let bits = |cut: bool| {
        let mut sim = scene("velocity_verlet", G, &words);
        for substeps in [4, 9, 12, 5, 3] {
            if cut {
                // A look inside a frame is taken back, the first within the turn of masses.
                let _ = sim.inside(substeps, &["position"], &|| true);
            }
            step(&mut sim);
        }
        sim.hash()
    };
    assert_eq!(bits(true), bits(false));
}

#[test]
fn a_far_body_changes_no_bit() {
    let near = points(&[[0.05, 0.0, 0.3], [0.0, 0.1, 0.5]], 0.2, [0.0, 0.0, -1.0]) + &body(CUBE, 1.0, [0.0; 3], "friction = 0.3");
    let far =
        "[[body]]\nname = \"far\"\nshape = { sphere = { radius = 3 } }\nmass = 7\nposition = [[90, 40, -20]]\nvelocity = [[0, 3, 0]]\n";
    let [alone, beside] = [String::new(), far.to_string()].map(|more| {
        let mut sim = scene("velocity_verlet", 0.0, &(near.clone() + &more));
        run(&mut sim, 60);
        (column(&sim, "p", "position"), column(&sim, "b", "velocity"), column(&sim, "b", "angular_velocity"))
    });
    assert_eq!(alone, beside);
    assert!(alone.1[0].norm() > 0.1);
}

#[test]
fn a_load_that_falls_on_an_overhang_gives_no_energy() {
    // A plank on a narrow post, and 1 kg that falls on its end.
    let words = points(&[[0.18, 0.0, 0.74]], 1.0, [0.0; 3])
        + &body("box = { size = [0.4, 0.1, 0.04] }", 1.0, [0.0, 0.0, 0.52], "")
        + "[[collider]]\nname = \"post\"\nshape = { box = { size = [0.02, 1, 0.5], center = [0, 0, 0.25] } }\n";
    let mut sim = scene("velocity_verlet", G, &words);
    let start = sim.ledger().energy();
    let mut least = f64::INFINITY;
    for _ in 0..25 {
        step(&mut sim);
        let energy = sim.ledger().energy();
        assert!(energy < start + 0.02, "{energy} of {start}");
        least = least.min(energy);
    }
    // The blow costs a part of 1.96 J.
    assert!(least < start - 0.2 && column(&sim, "b", "angular_velocity")[0].norm() > 1.0, "{least} of {start}");
}

#[test]
fn held_masses_in_a_body_let_it_out_slowly_and_are_told() {
    let places: Vec<[f64; 3]> = (0..25).map(|i| [0.05 * f64::from(i % 5) - 0.1, 0.05 * f64::from(i / 5) - 0.1, 0.0]).collect();
    let words = points(&places, 0.1, [0.0; 3]).replace("mass =", "pin = [\"all\"]\nmass =") + &body(CUBE, 0.5, [0.03, 0.02, 0.02], "");
    let mut sim = scene("velocity_verlet", 0.0, &words);
    assert!(sim.warnings().iter().any(|w| w.code.name() == "starts-inside"), "{:?}", sim.warnings());
    run(&mut sim, 100);
    let speed = column(&sim, "b", "velocity")[0].norm();
    assert!(speed > 0.05 && speed < 1.5, "{speed}");
}

#[test]
fn what_falls_together_does_not_press() {
    // In one interval of 10 ms a mass would fall 0.5 mm onto a body that did not.
    let words = points(&[[0.1, 0.05, 0.2]], 1.0, [0.0; 3]) + &body(CUBE, 1.0, [0.0; 3], "");
    let mut sim = scene_of("velocity_verlet", G, 1, true, &words);
    run(&mut sim, 20);
    let (b, turn) = (column(&sim, "b", "position")[0], column(&sim, "b", "angular_velocity")[0]);
    assert!((b.z + 0.5 * G * 0.04).abs() < 1e-9 && turn.norm() < 1e-9, "{b:?} {turn:?}");
}

#[test]
fn a_blade_that_turns_far_in_an_interval_hits_what_is_in_its_way() {
    // 0.6 rad in 10 ms; a mass at rest 0.3 rad ahead.
    let words = points(&[[0.4 * 0.3_f64.cos(), 0.4 * 0.3_f64.sin(), 0.0]], 0.01, [0.0; 3])
        + &body("box = { size = [1, 0.02, 0.2] }", 100.0, [0.0; 3], "angular_velocity = [[0, 0, 60]]\nfriction = 0");
    let mut sim = scene_of("velocity_verlet", 0.0, 1, true, &words);
    run(&mut sim, 3);
    let speed = column(&sim, "p", "velocity")[0].norm();
    assert!(speed > 22.0, "{speed} of 24 m/s");
}

#[test]
fn repeated_intervals_find_what_one_pass_with_masses_first_finds() {
    let after = |more: &str, first: bool| {
        let words = format!("[world.coupling]\niterations = {more}\n");
        let words = if more.is_empty() { String::new() } else { words }
            + "[[particles]]\nname = \"p\"\nposition = [[0, 0, 0], [0, 0, -1]]\nmass = [0.5]\npin = [\"vertex 1\"]\nspring = [{ between = [0, 1], stiffness = 100, damping = 0.5 }]\n"
            + &body("sphere = { radius = 0.1 }", 1.0, [0.0, 0.0, 0.1], "");
        let mut sim = scene_of("velocity_verlet", G, 2, first, &words);
        run(&mut sim, 20);
        column(&sim, "b", "position")[0].z
    };
    let (once, repeated, late) = (after("", true), after("10", false), after("", false));
    assert!((repeated - once).abs() < 1e-9 && (late - once).abs() > 1e-5, "{once} {repeated} {late}");
}
