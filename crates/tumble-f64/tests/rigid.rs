//! Rigid bodies against closed forms. See docs/theory/rigid.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, column, run, simulation, step, whole};
use std::fmt::Write;
use tumble_f64::math::Quat;
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Data, Engine, Mesh, Scene};

const G: f64 = 9.81;

/// A scene of bodies; frames last 1/100 s and have so many sub-steps.
fn scene(gravity: [f64; 3], substeps: u32, words: &str) -> Simulation {
    simulation(&format!("time.fps = 100\nworld.gravity = {gravity:?}\n[[system]]\nmethod = \"rigid\"\nsubsteps = {substeps}\n{words}"))
}

const DOWN: [f64; 3] = [0.0, 0.0, -G];
const NONE: [f64; 3] = [0.0; 3];

fn floor(friction: f64, restitution: f64) -> String {
    format!("[[collider]]\nname = \"floor\"\nshape = {{ floor = {{}} }}\nfriction = {friction}\nrestitution = {restitution}\n")
}

fn body(name: &str, words: &str) -> String {
    format!("[[body]]\nname = \"{name}\"\n{words}\n")
}

fn turns(sim: &Simulation, object: &str) -> Vec<Quat<f64>> {
    let frame = sim.frame(&[]);
    match &frame.column(object, "turn").unwrap().data {
        Data::F64(numbers) => numbers.chunks_exact(4).map(|q| Quat::from_row([q[0], q[1], q[2], q[3]])).collect(),
        other => panic!("{other:?}"),
    }
}

/// Angular velocity in the body's own axes.
fn own(sim: &Simulation, object: &str) -> Vector {
    turns(sim, object)[0].conj().turn(column(sim, object, "angular_velocity")[0])
}

#[test]
fn a_free_body_tumbles_as_elliptic_functions_say_and_keeps_what_it_must() {
    for (w, period) in [([0.01, 1.0, 0.0], 41.509_219_5), ([0.1, 1.0, 0.1], 22.996_262_9)] {
        let words = format!("shape = {{ sphere = {{ radius = 0.1 }} }}\nmass = 1\ninertia = [1, 2, 3]\nangular_velocity = [{w:?}]");
        let mut sim = scene(NONE, 1, &body("nut", &words));
        let start = sim.ledger();
        let (mut crossings, mut last) = (Vec::new(), own(&sim, "nut").y);
        for frame in 1..=(140.0 * period) as usize {
            step(&mut sim);
            let now = own(&sim, "nut").y;
            if now * last < 0.0 {
                crossings.push((frame as f64 - now / (now - last)) / 100.0);
            }
            last = now;
        }
        assert!((crossings[2] - crossings[0] - period).abs() < 1e-3 * period, "{crossings:?}");
        if w[2] == 0.0 {
            assert!((crossings[0] - 10.377_304_9).abs() < 1e-3 * 10.4, "{crossings:?}");
        }
        let end = sim.ledger();
        // Bounded, of order (h w)² = 1e-4.
        assert!((end.energy() / start.energy() - 1.0).abs() < 1e-5 && start.kinetic > 0.9, "{} {}", end.energy(), start.energy());
        let [before, after] = [&start, &end].map(|l| Vector::from(l.angular_momentum.unwrap()));
        assert!((after - before).norm() < 1e-10 * before.norm() && before.norm() > 1.0);
    }
}

#[test]
fn turning_is_of_second_order() {
    let error = |substeps: u32| {
        let words = "shape = { sphere = { radius = 0.1 } }\nmass = 1\ninertia = [1, 2, 3]\nangular_velocity = [[3, 5, 2]]";
        let mut sim = scene(NONE, substeps, &body("nut", words));
        run(&mut sim, 50);
        turns(&sim, "nut")[0]
    };
    let exact = error(400);
    let [a, b] = [10, 20].map(|n| {
        let q = error(n);
        (q.conj() * exact).v.norm()
    });
    let order = (a / b).log2();
    assert!(a > 1e-9 && (1.9..2.1).contains(&order), "order {order}: {a:e}, {b:e}");
}

#[test]
fn a_ball_bounces_for_as_long_and_as_far_as_its_restitution_says() {
    for e in [0.5, 0.8, 0.9_f64] {
        let words = format!("shape = {{ sphere = {{ radius = 0.1 }} }}\nposition = [[0, 0, 1.1]]\nrestitution = {e}\nfriction = 0");
        let mut sim = scene(DOWN, 40, &(body("ball", &words) + &floor(0.0, 0.0)));
        let total = (2.0 / G).sqrt() * (1.0 + e) / (1.0 - e);
        let (mut rest, mut highest) = (0.0, Vec::new());
        let (mut before, mut rising) = (1.1, false);
        for frame in 1..(100.0 * total * 1.2) as usize {
            step(&mut sim);
            let z = column(&sim, "ball", "position")[0].z;
            if (z - 0.1).abs() > 2e-5 {
                rest = frame as f64 / 100.0;
            }
            if rising && z < before {
                highest.push(before - 0.1);
            }
            rising = z > before;
            before = z;
        }
        assert!((rest - total).abs() < 0.02 * total, "e = {e}: {rest} s of {total} s");
        for (k, height) in highest.iter().take(4).enumerate() {
            let exact = e.powi(2 * (k as i32 + 1));
            // The highest of frames is up to g (dt/2)²/2 below the top.
            assert!((height - exact).abs() < 2e-3 * exact + 1.3e-4, "e = {e}, bounce {k}: {height} of {exact}");
        }
        assert!(highest.len() > 3, "{highest:?}");
    }
}

#[test]
fn elastic_balls_keep_their_energy() {
    let words =
        "shape = { sphere = { radius = 0.1 } }\nposition = [[0, 0, 1.1], [1, 0, 0.613], [2, 0, 4.2]]\nrestitution = 1\nfriction = 0";
    let mut sim = scene(DOWN, 5, &(body("balls", words) + &floor(0.0, 0.0)));
    let start = sim.ledger();
    run(&mut sim, 1000);
    let end = sim.ledger();
    assert!((end.energy() / start.energy() - 1.0).abs() < 1e-11, "{} {}", start.energy(), end.energy());
    assert!((end.kinetic - start.kinetic).abs() > 1e-3 * start.energy());
}

/// Acceleration along x on a slope of angle a, of what starts at rest.
fn slide(a: f64, shape: &str, height: f64, friction: f64) -> f64 {
    let words = format!("shape = {shape}\nposition = [[0, 0, {height}]]\nfriction = {friction}");
    let mut sim = scene([G * a.sin(), 0.0, -G * a.cos()], 5, &(body("thing", &words) + &floor(0.0, 0.0)));
    run(&mut sim, 30);
    let first = column(&sim, "thing", "velocity")[0].x;
    run(&mut sim, 100);
    column(&sim, "thing", "velocity")[0].x - first
}

#[test]
fn blocks_and_balls_go_down_a_slope_as_coulomb_says() {
    let block = "{ box = { size = [0.4, 0.4, 0.2] } }";
    let ball = "{ sphere = { radius = 0.1 } }";
    for (a, mu) in [(0.3, 0.5), (0.6, 0.5), (0.4, 0.2), (0.7, 0.9)] {
        let slides = f64::max(G * (f64::sin(a) - mu * f64::cos(a)), 0.0);
        let found = slide(a, block, 0.1, mu);
        assert!((found - slides).abs() < 5e-3 * slides + 1e-6, "block, {a} rad, mu = {mu}: {found} of {slides} m/s²");
        let rolls = if f64::tan(a) <= 3.5 * mu { 5.0 / 7.0 * G * f64::sin(a) } else { slides };
        let found = slide(a, ball, 0.1, mu);
        assert!((found - rolls).abs() < 5e-3 * rolls, "ball, {a} rad, mu = {mu}: {found} of {rolls} m/s²");
    }
}

#[test]
fn a_ball_that_is_thrown_slides_and_then_rolls() {
    let (mu, v) = (0.3, 2.0);
    let words = format!("shape = {{ sphere = {{ radius = 0.1 }} }}\nposition = [[0, 0, 0.1]]\nvelocity = [[{v}, 0, 0]]\nfriction = {mu}");
    let mut sim = scene(DOWN, 10, &(body("ball", &words) + &floor(0.0, 0.0)));
    run(&mut sim, 100);
    let (found, turn) = (column(&sim, "ball", "velocity")[0].x, column(&sim, "ball", "angular_velocity")[0].y);
    assert!((found - 5.0 / 7.0 * v).abs() < 1e-4 && (0.1 * turn - found).abs() < 1e-4, "{found} m/s, {turn} rad/s");
    // It slides for 2 v/(7 mu g), over 12 v²/(49 mu g).
    let (time, way) = (2.0 * v / (7.0 * mu * G), 12.0 * v * v / (49.0 * mu * G));
    let exact = way + 5.0 / 7.0 * v * (1.0 - time);
    let x = column(&sim, "ball", "position")[0].x;
    assert!((x - exact).abs() < 5e-3 * way, "{x} of {exact} m");
}

#[test]
fn what_rolls_is_stopped_as_its_rolling_friction_says() {
    let (mu, v) = (0.1, 1.5);
    // With the moment of inertia c m R² about its centre it slows down by mu g/(1 + c).
    for (shape, c) in [("{ sphere = { radius = 0.1 } }", 0.4), ("{ cylinder = { radius = 0.1, height = 0.2 } }", 0.5)] {
        let words = format!(
            "shape = {shape}\nposition = [[0, 0, 0.1]]\nrotate = [[90, 0, 0]]\nvelocity = [[{v}, 0, 0]]\nangular_velocity = [[0, {}, 0]]\n\
             friction = 0.5\nrolling_friction = {mu}",
            v / 0.1
        );
        let mut sim = scene(DOWN, 5, &(body("thing", &words) + &floor(0.5, 0.0)));
        let slows = mu * G / (1.0 + c);
        run(&mut sim, 100);
        let speed = column(&sim, "thing", "velocity")[0].x;
        assert!((speed - (v - slows)).abs() < 5e-3 * slows, "{shape}: {speed} of {} m/s", v - slows);
        run(&mut sim, (100.0 * v / slows) as usize - 95);
        let (x, v_end) = (column(&sim, "thing", "position")[0].x, column(&sim, "thing", "velocity")[0]);
        let way = v * v / (2.0 * slows);
        assert!((x - way).abs() < 5e-3 * way && v_end.norm() < 1e-6, "{shape}: {x} of {way} m, {v_end:?}");
    }
}

#[test]
fn a_ball_rests_on_slopes_up_to_the_tangent_of_its_rolling_friction() {
    let mu = 0.1;
    for (tan, rolls) in [(0.098, false), (0.102, true), (0.3, true)] {
        let a = f64::atan(tan);
        let words = format!("shape = {{ sphere = {{ radius = 0.1 }} }}\nposition = [[0, 0, 0.1]]\nfriction = 0.8\nrolling_friction = {mu}");
        let mut sim = scene([G * a.sin(), 0.0, -G * a.cos()], 5, &(body("ball", &words) + &floor(0.0, 0.0)));
        run(&mut sim, 100);
        let v = column(&sim, "ball", "velocity")[0].x;
        let exact = if rolls { 5.0 / 7.0 * G * (a.sin() - mu * a.cos()) } else { 0.0 };
        assert!((v - exact).abs() < 5e-3 * exact + 1e-6, "tan a = {tan}: {v} of {exact} m/s");
    }
}

#[test]
fn what_rolls_goes_on_to_the_same_bits_from_a_snapshot() {
    let words = "shape = { sphere = { radius = 0.1 } }\nposition = [[0, 0, 0.1], [0.15, 0, 0.3]]\nvelocity = [[1, 0.3, 0]]\nfriction = 0.5\nrolling_friction = 0.05";
    let mut sim = scene(DOWN, 5, &(body("balls", words) + &floor(0.5, 0.0)));
    run(&mut sim, 40);
    let kept = sim.save(&[]);
    run(&mut sim, 40);
    let mut again = scene(DOWN, 5, &(body("balls", words) + &floor(0.5, 0.0)));
    again.restore(&kept).unwrap();
    run(&mut again, 40);
    assert_eq!(column(&sim, "balls", "position"), column(&again, "balls", "position"));
    assert_eq!(turns(&sim, "balls"), turns(&again, "balls"));
}

/// A box that is pushed along the diagonal, and 25 balls on it: an elliptic cone of friction lets it go, a pyramid does not. Figures of SimBenchmark.
#[test]
fn balls_on_a_box_that_is_pulled_along_the_diagonal() {
    // F pulls the box: its velocity is raised. The ground holds it back by f = 0.4 (M + 25 m) g, each ball by (F - f)/(M (3.5/m + 25/M)).
    let mut words = String::from("shape = { sphere = { radius = 0.5 } }\nmass = 1\nfriction = 0.8\nposition = [");
    (0..25).for_each(|k| write!(words, "[{}, {}, 0.7], ", 2 * (k % 5) - 4, 2 * (k / 5) - 4).unwrap());
    words.push(']');
    let tray = "shape = { box = { size = [20, 20, 0.2] } }\nmass = 10\nposition = [[0, 0, 0.1]]\nfriction = 0.4";
    let mut sim = simulation(&format!(
        "time.fps = 200\nworld.gravity = [0, 0, -9.81]\n[[system]]\nmethod = \"rigid\"\nsubsteps = 1\n{}{}{}",
        body("tray", tray),
        body("balls", &words),
        floor(0.0, 0.0)
    ));
    let pull = 150.0 / 2.0_f64.sqrt() / 10.0 / 200.0;
    for _ in 0..800 {
        let v = column(&sim, "tray", "velocity")[0];
        assert!(sim.write("tray", "velocity", &[v.x + pull, v.y + pull, v.z]).is_ok());
        step(&mut sim);
    }
    let [tray, ball] = ["tray", "balls"].map(|name| column(&sim, name, "velocity").pop().unwrap().norm());
    assert!((tray - 2.954).abs() < 5e-3 * 2.954 && (ball - 0.844).abs() < 5e-3 * 0.844, "{tray} m/s, {ball} m/s");
}

#[test]
fn slender_bodies_turn_without_gaining_energy() {
    for (shape, w) in [
        ("{ capsule = { radius = 0.002, length = 1 } }", [0.0, 10.0, 0.1]),
        ("{ cylinder = { radius = 0.001, height = 1 } }", [3.0, 10.0, 40.0]),
        ("{ box = { size = [0.002, 1, 0.003] } }", [10.0, 3.0, 7.0]),
    ] {
        let mut sim = scene(NONE, 5, &body("rod", &format!("shape = {shape}\nangular_velocity = [{w:?}]")));
        let start = sim.ledger().kinetic;
        let worst = (0..500).map(|_| (step(&mut sim), (sim.ledger().kinetic / start - 1.0).abs()).1).fold(0.0, f64::max);
        assert!(worst < 1e-6 && start > 0.0, "{shape}: {worst:e}");
    }
}

#[test]
fn flat_and_oblique_blows_obey_the_restitution() {
    // A box that falls flat on a face rises to e² of its height and does not turn.
    for mu in [0.0, 0.5] {
        let words =
            format!("shape = {{ box = {{ size = [0.4, 0.4, 0.2] }} }}\nposition = [[0, 0, 1.1]]\nrestitution = 0.5\nfriction = {mu}");
        let mut sim = scene(DOWN, 5, &(body("box", &words) + &floor(0.0, 0.0)));
        run(&mut sim, 46);
        let heights: Vec<f64> = (0..40).map(|_| (step(&mut sim), column(&sim, "box", "position")[0].z - 0.1).1).collect();
        let top = heights.into_iter().fold(0.0, f64::max);
        assert!((top - 0.25).abs() < 1e-3 && column(&sim, "box", "angular_velocity")[0].norm() < 1e-9, "mu = {mu}: {top} m");
    }
    // Without friction nothing changes the spin of a ball, and an elastic one keeps its energy.
    let words = "shape = { sphere = { radius = 0.5 } }\nposition = [[0, 0, 0.5043]]\nvelocity = [[5, 0, -3]]\nangular_velocity = [[0, 40, 0]]\n\
        restitution = 1\nfriction = 0";
    let mut sim = scene(NONE, 1, &(body("ball", words) + &floor(0.0, 0.0)));
    run(&mut sim, 10);
    let (v, w) = (column(&sim, "ball", "velocity")[0], column(&sim, "ball", "angular_velocity")[0]);
    assert!((v - Vector::from([5.0, 0.0, 3.0])).norm() < 1e-12 && (w.y - 40.0).abs() < 1e-12, "{v:?} {w:?}");
}

#[test]
fn a_gas_of_elastic_balls_keeps_its_energy() {
    let (mut position, mut velocity) = (String::new(), String::new());
    for k in 0..27 {
        write!(position, "[{}, {}, {}], ", 0.4 * f64::from(k % 3 - 1), 0.4 * f64::from(k / 3 % 3 - 1), 0.4 * f64::from(k / 9 - 1)).unwrap();
        write!(velocity, "[{}, {}, {}], ", 1.3 - f64::from(k % 4), 0.7 - f64::from(k % 3), f64::from(k * 7 % 5) - 2.0).unwrap();
    }
    let words = format!(
        "shape = {{ sphere = {{ radius = 0.1 }} }}\nposition = [{position}]\nvelocity = [{velocity}]\nrestitution = 1\nfriction = 0"
    );
    let room = "[[collider]]\nname = \"room\"\nshape = { box = { size = [2, 2, 2] } }\ninside = true\n";
    let mut sim = scene(NONE, 5, &(body("balls", &words) + room));
    let start = sim.ledger();
    run(&mut sim, 500);
    let end = sim.ledger();
    assert!((end.kinetic / start.kinetic - 1.0).abs() < 1e-9, "{} of {} J", end.kinetic, start.kinetic);
    assert!((Vector::from(end.momentum) - Vector::from(start.momentum)).norm() > 1e-3 * start.mass);
}

#[test]
fn shells_are_met_from_both_sides() {
    let vertices = vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    for triangles in [vec![[0, 1, 2], [0, 2, 3]], vec![[2, 1, 0], [3, 2, 0]]] {
        let text = "version = 1\n[[body]]\nname = \"ball\"\nshape = { sphere = { radius = 0.1 } }\nposition = [[0.2, 0.1, 0.3]]\n\
            [[collider]]\nname = \"plate\"\nshape = { mesh = { path = \"plate.obj\", shell = true } }\nthickness = 0.01\n";
        let plate = Mesh { vertices: vertices.clone(), triangles, ..Mesh::default() };
        let assets = Assets::new([("plate.obj".to_string(), plate)].into(), Default::default());
        let mut sim = Simulation::new(Scene::from_toml(text).unwrap(), assets).unwrap();
        run(&mut sim, 24);
        let z = column(&sim, "ball", "position")[0].z;
        assert!((z - 0.11).abs() < 1e-3, "{z} m");
    }
}

#[test]
fn as_many_balls_leave_a_row_as_come_in() {
    for coming in 1..=3 {
        let (mut position, mut velocity) = (String::new(), String::new());
        for i in 0..5 {
            let moves = i < coming;
            write!(position, "[{}, 0, 0], ", 0.2 * f64::from(i) - if moves { 0.05 } else { 0.0 }).unwrap();
            write!(velocity, "[{}, 0, 0], ", u8::from(moves)).unwrap();
        }
        let words = format!(
            "shape = {{ sphere = {{ radius = 0.1 }} }}\nposition = [{position}]\nvelocity = [{velocity}]\nrestitution = 1\nfriction = 0"
        );
        let mut sim = scene(NONE, 1, &body("balls", &words));
        run(&mut sim, 20);
        let found: Vec<f64> = column(&sim, "balls", "velocity").iter().map(|v| v.x).collect();
        for (i, v) in found.iter().enumerate() {
            let exact = f64::from(u8::from(i >= 5 - coming as usize));
            assert!((v - exact).abs() < 1e-9, "{coming} in: {found:?}");
        }
    }
}

#[test]
fn momentum_and_angular_momentum_stay_where_nothing_else_is() {
    [0.0, 0.4].into_iter().for_each(conserved);
}

/// Twelve boxes that meet, by passes and by bounces.
fn conserved(restitution: f64) {
    let mut words =
        format!("restitution = {restitution}\nrolling_friction = 0.2\nshape = {{ box = {{ size = [0.3, 0.2, 0.25] }} }}\nposition = [");
    (0..12).for_each(|k| {
        write!(words, "[{}, {}, {}], ", 0.4 * f64::from(k % 3), 0.37 * f64::from(k / 3 % 2), 0.41 * f64::from(k / 6)).unwrap()
    });
    words.push_str("]\nvelocity = [");
    (0..12).for_each(|k| write!(words, "[{}, {}, {}], ", 1 - k % 3, f64::from(1 - k / 3 % 2 * 2), 0.7 - f64::from(k / 6)).unwrap());
    words.push_str("]\nangular_velocity = [[1, 2, 3]]");
    let mut sim = scene(NONE, 5, &body("boxes", &words));
    let start = sim.ledger();
    run(&mut sim, 200);
    let end = sim.ledger();
    let [l, m] = [&start, &end].map(|ledger| Vector::from(ledger.angular_momentum.unwrap()));
    let scale = start.mass * 1.0;
    assert!((Vector::from(end.momentum) - Vector::from(start.momentum)).norm() < 1e-12 * scale);
    assert!((m - l).norm() < 1e-11 * scale, "{l:?} {m:?}");
    // They have met: energy is lost.
    assert!(end.kinetic < 0.9 * start.kinetic, "{} of {} J", end.kinetic, start.kinetic);
}

#[test]
fn what_starts_in_a_floor_is_pushed_out_without_a_launch() {
    let words = "shape = { box = { size = [0.4, 0.4, 0.4] } }\nposition = [[0, 0, 0.15]]";
    let mut sim = scene(NONE, 5, &(body("box", words) + &floor(0.5, 0.0)));
    step(&mut sim);
    assert!(column(&sim, "box", "position")[0].z > 0.151);
    run(&mut sim, 200);
    let (z, v) = (column(&sim, "box", "position")[0].z, column(&sim, "box", "velocity")[0]);
    assert!((z - 0.2).abs() < 1e-3 && v.norm() < 1e-3, "{z} m, {v:?} m/s");
}

#[test]
fn a_stack_stands_still() {
    let words = "shape = { box = { size = [1, 1, 1] } }\nposition = [[0, 0, 0.5]]\narrange = { stack = { count = 10 } }";
    let mut sim = scene(DOWN, 5, &(body("stack", words) + &floor(0.5, 0.0)));
    run(&mut sim, if whole() { 6000 } else { 500 });
    let x = column(&sim, "stack", "position");
    for (k, x) in x.iter().enumerate() {
        let off = *x - Vector::from([0.0, 0.0, 0.5 + k as f64]);
        assert!(off.norm() < 5e-3, "block {k} is off by {off:?}");
    }
    let ledger = sim.ledger();
    assert!(ledger.speed.unwrap() < 1e-6 && ledger.contacts == Some(10), "{ledger:?}");
    assert!(ledger.penetration.unwrap() < 2e-3);
}

/// Blocks that lean out by 1/2, 1/4, 1/6 ... of their length over a table, all of them times `part`.
fn overhang(part: f64) -> f64 {
    let n = 4;
    let mut position = String::new();
    let mut x = 0.0;
    for k in 0..n {
        x += part * 0.5 / f64::from(n - k);
        write!(position, "[{}, 0, {}], ", x - 0.5, 0.1 + 0.2 * f64::from(k)).unwrap();
    }
    let words = format!("shape = {{ box = {{ size = [1, 0.5, 0.2] }} }}\nposition = [{position}]\nfriction = 0.8");
    let table = "[[collider]]\nname = \"table\"\nshape = { box = { center = [-2, 0, -0.5], size = [4, 2, 1] } }\nfriction = 0.8\n";
    let mut sim = scene(DOWN, 10, &(body("blocks", &words) + table));
    run(&mut sim, 300);
    column(&sim, "blocks", "position").iter().map(|x| x.z).fold(f64::INFINITY, f64::min)
}

#[test]
fn blocks_lean_out_as_far_as_the_harmonic_series() {
    let (stands, falls) = (overhang(0.96), overhang(1.04));
    assert!(stands > 0.095 && falls < 0.0, "{stands} {falls}");
}

#[test]
fn a_box_on_a_slope_tips_if_it_is_narrower_than_friction_allows() {
    let turned = |width: f64, mu: f64, a: f64| {
        let words = format!("shape = {{ box = {{ size = [{width}, 1, 1] }} }}\nposition = [[0, 0, 0.5]]\nfriction = {mu}");
        let mut sim = scene([G * a.sin(), 0.0, -G * a.cos()], 5, &(body("box", &words) + &floor(0.0, 0.0)));
        run(&mut sim, 200);
        let up = turns(&sim, "box")[0].turn([0.0, 0.0, 1.0].into());
        (up.z, column(&sim, "box", "position")[0].x)
    };
    // It tips where tan a exceeds width over height, and slides where it exceeds mu.
    let angle = |tan: f64| f64::atan(tan);
    let [tips, stands, slides] = [turned(0.5, 0.8, angle(0.53)), turned(0.5, 0.8, angle(0.47)), turned(0.5, 0.4, angle(0.45))];
    assert!(tips.0 < 0.8, "{tips:?}");
    assert!(stands.0 > 0.9999 && stands.1.abs() < 1e-2, "{stands:?}");
    assert!(slides.0 > 0.9999 && slides.1 > 0.3, "{slides:?}");
}

#[test]
fn nothing_passes_a_thin_plate_at_a_hundred_metres_a_second() {
    for shape in ["{ sphere = { radius = 0.05 } }", "{ box = { size = [0.1, 0.1, 0.1] } }", "{ capsule = { radius = 0.03, length = 0.1 } }"]
    {
        let words =
            format!("shape = {shape}\nposition = [[0, 0, 1], [0.5, 0.2, 1]]\nvelocity = [[0, 0, -100]]\nangular_velocity = [[3, 20, 1]]");
        let plate = "[[collider]]\nname = \"plate\"\nshape = { box = { size = [4, 4, 0.005] } }\n";
        let mut sim = scene(NONE, 5, &(body("shots", &words) + plate));
        run(&mut sim, 20);
        assert!(column(&sim, "shots", "position").iter().all(|x| x.z > 0.0), "{shape}");
    }
}

#[test]
fn a_far_body_changes_no_bit() {
    let words =
        "shape = { box = { size = [0.3, 0.2, 0.25] } }\nposition = [[0, 0, 0.2], [0.1, 0.05, 0.5], [0, 0.1, 0.9]]\nrestitution = 0.3";
    let all = |far: &str| {
        let mut sim = scene(DOWN, 5, &(body("boxes", words) + far + &floor(0.5, 0.0)));
        run(&mut sim, 100);
        column(&sim, "boxes", "position")
    };
    let far = body("far", "shape = { sphere = { radius = 0.3 } }\nposition = [[30, 40, 5], [-60, 3, 5]]");
    let (alone, together) = (all(""), all(&far));
    assert_eq!(alone, together);
    assert!((alone[2].z - 0.9).abs() > 0.05);
}

#[test]
fn moving_solids_and_belts_carry_bodies() {
    let words = "shape = { box = { size = [0.2, 0.2, 0.2] } }\nposition = [[0, 0, 0.1]]\nfriction = 0.8";
    for moves in ["belt = [0.5, 0, 0]", "motion = { velocity = [0.5, 0, 0] }"] {
        let table = format!("[[collider]]\nname = \"table\"\nshape = {{ box = {{ center = [0, 0, -0.5], size = [6, 2, 1] }} }}\n{moves}\n");
        let mut sim = scene(DOWN, 5, &(body("box", words) + &table));
        run(&mut sim, 100);
        let v = column(&sim, "box", "velocity")[0];
        assert!((v.x - 0.5).abs() < 1e-6 && v.z.abs() < 1e-6, "{moves}: {v:?}");
    }
}

#[test]
fn shapes_have_the_mass_and_the_moments_of_solids() {
    let pi = std::f64::consts::PI;
    for (shape, volume, lowest) in [
        ("{ sphere = { radius = 0.2 } }", 4.0 / 3.0 * pi * 0.008, 0.2),
        ("{ box = { size = [0.2, 0.3, 0.4] } }", 0.024, 0.2),
        ("{ capsule = { radius = 0.1, length = 0.3 } }", pi * 0.003 + 4.0 / 3.0 * pi * 0.001, 0.25),
        ("{ cylinder = { radius = 0.1, height = 0.3 } }", pi * 0.003, 0.15),
        ("{ cone = { radius = 0.1, height = 0.4 } }", pi * 0.004 / 3.0, 0.1),
        ("{ hull = { points = [[0, 0, 0], [0.3, 0, 0], [0, 0.3, 0], [0, 0, 0.3]] } }", 0.0045, 0.075),
    ] {
        let words = format!("shape = {shape}\ndensity = 500\nposition = [[0, 0, {}]]", lowest + 0.001);
        let mut sim = scene(DOWN, 10, &(body("thing", &words) + &floor(0.5, 0.0)));
        let mass = sim.ledger().mass;
        assert!((mass - 500.0 * volume).abs() < 1e-6 * mass, "{shape}: {mass} kg of {}", 500.0 * volume);
        // It stands on the side that is down.
        run(&mut sim, 100);
        let z = column(&sim, "thing", "position")[0].z;
        assert!((z - lowest).abs() < 2e-4, "{shape}: {z} m of {lowest}");
    }
    // A cylinder that rolls has half the mass for its moment about the axis.
    let words = "shape = { cylinder = { radius = 0.1, height = 0.3 } }\nrotate = [[90, 0, 0]]\nposition = [[0, 0, 0.1]]\nfriction = 1";
    let a: f64 = 0.2;
    let mut sim = scene([G * a.sin(), 0.0, -G * a.cos()], 5, &(body("roll", words) + &floor(0.0, 0.0)));
    run(&mut sim, 100);
    let (v, exact) = (column(&sim, "roll", "velocity")[0].x, 2.0 / 3.0 * G * a.sin());
    assert!((v - exact).abs() < 5e-3 * exact, "{v} of {exact} m/s");
}

#[test]
fn all_mistakes_of_bodies_are_told_at_once() {
    let text = "version = 1\n[[body]]\nname = \"a\"\nshape = { hull = { points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]] } }\n\
        [[body]]\nname = \"b\"\nshape = { sphere = { radius = 1 } }\ndensity = 1\nmass = 1\n\
        [[body]]\nname = \"c\"\nshape = { sphere = { radius = 1 } }\nposition = [[0, 0, 0], [3, 0, 0]]\nvelocity = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]\n\
        [[body]]\nname = \"d\"\nshape = { sphere = { radius = 1 } }\ninertia = [1, 1, 3]\n\
        [[body]]\nname = \"e\"\nshape = { sphere = { radius = 1 } }\nfriction = 0.5\nfriction_static = 0.3\n\
        [[body]]\nname = \"f\"\nshape = { sphere = { radius = 1 } }\nposition = [[0, 0, 0], [3, 0, 0]]\narrange = { stack = { count = 3 } }\n\
        [[collider]]\nname = \"jar\"\nshape = { sphere = { radius = 9 } }\ninside = true\n";
    let error = Simulation::new(Scene::from_toml(text).unwrap(), Default::default()).err().unwrap();
    let paths: Vec<&str> = error.issues.iter().map(|issue| issue.path.as_str()).collect();
    let expected = [
        "body \"a\".shape.hull.points",
        "body \"b\".mass",
        "body \"c\".velocity",
        "body \"d\".inertia",
        "body \"e\".friction_static",
        "body \"f\".arrange",
        "collider \"jar\"",
    ];
    assert_eq!(paths, expected, "{error}");
}

#[test]
fn words_that_say_nothing_are_refused_and_overlaps_are_named() {
    let ball = "shape = { sphere = { radius = 0.1 } }\nposition = [[0, 0, 1], [0, 0, 0.07]]";
    for words in [
        "clamp = 1.1",
        "self_contact = { thickness = 0.01 }",
        "solver = { newton_tolerance = 1e-3 }",
        "position_based = { iterations = 3 }",
    ] {
        let text = format!("version = 1\n[[system]]\nmethod = \"rigid\"\n{words}\n{}", body("balls", ball));
        let told = Simulation::new(Scene::from_toml(&text).unwrap(), Default::default()).map(|_| ()).unwrap_err().to_string();
        assert!(told.contains("says nothing to rigid bodies"), "{words}: {told}");
    }
    let sim = scene(DOWN, 5, &(body("balls", ball) + &floor(0.5, 0.0)));
    let told: Vec<String> = sim.warnings().iter().map(ToString::to_string).collect();
    assert!(told.iter().any(|line| line.contains("body \"balls\": number 1 starts 0.03 m deep in \"floor\"")), "{told:?}");
}
