//! Rigid bodies in scenes of two dimensions. See docs/theory/rigid.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, column, run, simulation};
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Engine, Scene};

const G: f64 = 9.81;

/// A scene in a plane; frames last 1/100 s and have ten sub-steps.
fn text(plane: &str, gravity: [f64; 3], words: &str) -> String {
    format!(
        "dimension = 2\nplane = \"{plane}\"\ntime.fps = 100\nworld.gravity = {gravity:?}\n[[system]]\nmethod = \"rigid\"\nsubsteps = 10\n{words}"
    )
}

fn body(name: &str, words: &str) -> String {
    format!("[[body]]\nname = \"{name}\"\n{words}\n")
}

/// Momentum, angular momentum and energy.
fn kept(sim: &Simulation) -> (Vector, Vector, f64) {
    let ledger = sim.ledger();
    (ledger.momentum.into(), ledger.angular_momentum.unwrap().into(), ledger.kinetic)
}

#[test]
fn discs_and_balls_roll_down_a_slope_as_their_inertia_says() {
    let slope: f64 = 0.3;
    for (shape, part) in [("{ cylinder = { radius = 0.1, height = 0.05 } }", 2.0 / 3.0), ("{ sphere = { radius = 0.1 } }", 5.0 / 7.0)] {
        // The axis of the cylinder lies across the plane.
        let words = format!("shape = {shape}\nrotate = [[90, 0, 0]]\nposition = [[0, 0, 0.1]]\nfriction = 1");
        let floor = "[[collider]]\nname = \"floor\"\nshape = { floor = {} }\n";
        let mut sim = simulation(&text("xz", [G * slope.sin(), 0.0, -G * slope.cos()], &(body("roll", &words) + floor)));
        run(&mut sim, 100);
        let (v, w) = (column(&sim, "roll", "velocity")[0], column(&sim, "roll", "angular_velocity")[0]);
        let exact = part * G * slope.sin();
        assert!((v.x - exact).abs() < 5e-3 * exact && (w.y - v.x / 0.1).abs() < 1e-2 * w.y, "{shape}: {v:?} {w:?}, {exact} m/s");
        assert!(v.y == 0.0 && w.x == 0.0 && w.z == 0.0 && column(&sim, "roll", "position")[0].y == 0.0, "{shape}: {v:?} {w:?}");
    }
}

#[test]
fn a_crooked_body_turns_steadily_where_it_would_tumble_in_space() {
    let hull = "shape = { hull = { points = [[0, 0, 0], [0.4, 0.1, 0], [0, 0.3, 0.1], [0.1, -0.1, 0.5]] } }";
    let words = format!("{hull}\nvelocity = [[1, 0, 0.5]]\nangular_velocity = [[0, 3, 0]]");
    let mut sim = simulation(&text("xz", [0.0; 3], &body("b", &words)));
    let (_, spin, energy) = kept(&sim);
    run(&mut sim, 500);
    let w = column(&sim, "b", "angular_velocity")[0];
    let (_, after, left) = kept(&sim);
    assert!(w == Vector::from([0.0, 3.0, 0.0]) && (after - spin).norm() < 1e-12 * spin.norm(), "{w:?} {spin:?} {after:?}");
    assert!((left / energy - 1.0).abs() < 1e-12);
    let mut space = simulation(&text("xz", [0.0; 3], &body("b", &words)).replace("dimension = 2", "dimension = 3"));
    run(&mut space, 500);
    assert!(column(&space, "b", "angular_velocity")[0].x.abs() > 0.1);
}

#[test]
fn blows_in_either_plane_keep_what_they_must() {
    for (plane, axis) in [("xz", 1), ("xy", 2)] {
        let place = |x: f64, up: f64| if axis == 1 { [x, 0.0, up] } else { [x, up, 0.0] };
        let words = format!(
            "shape = {{ box = {{ size = [0.2, 0.2, 0.2] }} }}\nposition = [{:?}, {:?}]\nvelocity = [{:?}, {:?}]\nrestitution = 1\nfriction = 0",
            place(0.0, 0.0),
            place(1.0, 0.12),
            place(2.0, 0.3),
            place(-1.0, 0.0)
        );
        let mut sim = simulation(&text(plane, [0.0; 3], &body("b", &words)));
        let (p, l, energy) = kept(&sim);
        run(&mut sim, 60);
        let (q, m, left) = kept(&sim);
        let w = column(&sim, "b", "angular_velocity").into_iter().map(<[f64; 3]>::from).collect::<Vec<_>>();
        assert!(w.iter().all(|w| w[axis].abs() > 1.0), "{plane}: no oblique blow: {w:?}");
        assert!(w.iter().all(|w| (0..3).all(|k| k == axis || w[k] == 0.0)), "{plane}: {w:?}");
        assert!((p - q).norm() < 1e-12 * p.norm() && (l - m).norm() < 1e-11 * p.norm(), "{plane}: {p:?} {q:?} {l:?} {m:?}");
        assert!((left / energy - 1.0).abs() < 1e-9, "{plane}: {energy} {left}");
    }
}

#[test]
fn a_crooked_body_that_is_hit_takes_what_the_other_loses() {
    let hull = "shape = { hull = { points = [[0, 0, 0], [0.4, 0.1, 0], [0, 0.3, 0.1], [0.1, -0.1, 0.5]] } }";
    let ball = body("ball", "shape = { sphere = { radius = 0.1 } }\nposition = [[-0.6, 0, 0.1]]\nvelocity = [[3, 0, 0]]\nfriction = 0.3");
    let mut sim = simulation(&text("xz", [0.0; 3], &(body("b", hull) + &ball)));
    let (p, l, _) = kept(&sim);
    run(&mut sim, 60);
    let (q, m, _) = kept(&sim);
    assert!(column(&sim, "b", "angular_velocity")[0].y.abs() > 0.1);
    assert!((p - q).norm() < 1e-11 * p.norm() && (l - m).norm() < 1e-11 * p.norm(), "{p:?} {q:?} {l:?} {m:?}");
}

#[test]
fn a_board_swings_on_its_joint_as_a_physical_pendulum() {
    // A board of 1 m on a pin 0.4 m above its centre: T = 2 pi sqrt((l²/12 + b²/12 + d²)/(g d)), at 1 degree.
    let a: f64 = 1f64.to_radians();
    for kind in ["ball", "hinge"] {
        let axis = if kind == "hinge" { "kind.hinge = { axis = [0, 1, 0] }" } else { "kind.ball = {}" };
        let words = format!(
            "shape = {{ box = {{ size = [0.1, 0.05, 1] }} }}\nposition = [[{}, 0, {}]]\nrotate = [[0, {}, 0]]\n[[joint]]\nname = \"pin\"\nbetween = [\"b\"]\nat = [0, 0, 0]\n{axis}",
            -0.4 * a.sin(),
            -0.4 * a.cos(),
            1.0
        );
        let mut sim = simulation(&text("xz", [0.0, 0.0, -G], &body("b", &words)));
        let (mut times, mut last) = (Vec::new(), column(&sim, "b", "position")[0].x);
        for frame in 1..=500 {
            run(&mut sim, 1);
            let now = column(&sim, "b", "position")[0].x;
            if now * last < 0.0 {
                times.push((f64::from(frame) - now / (now - last)) / 100.0);
            }
            last = now;
        }
        let exact = std::f64::consts::TAU * ((1.0 / 12.0 + 0.01 / 12.0 + 0.16) / (G * 0.4)).sqrt();
        assert!((times[4] - times[0] - 2.0 * exact).abs() < 2e-3 * exact, "{kind}: {times:?}, {exact} s");
    }
}

#[test]
fn what_leaves_the_plane_is_told_at_once() {
    let ball = "shape = { sphere = { radius = 0.1 } }";
    let words = [
        body("a", &format!("{ball}\nposition = [[0, 0.5, 0]]\nvelocity = [[0, 2, 0]]\nangular_velocity = [[1, 0, 0]]")),
        body("b", &format!("{ball}\nemit = {{ rate = 1, count = 2, from = {{ box = {{ center = [0, 0, 0], size = [1, 1, 1] }} }} }}")),
        body("c", "shape = { box = { size = [1, 1, 1] } }\nfracture = { pieces = 4, strength = 1 }"),
    ];
    let error = Scene::from_toml(&format!("version = 1\n{}", text("xz", [0.0, 0.0, -G], &words.concat())))
        .map(|scene| Simulation::new(scene, Assets::default()));
    let told: Vec<String> = match error {
        Ok(made) => made.err().unwrap().issues.iter().map(ToString::to_string).collect(),
        Err(error) => error.issues.iter().map(ToString::to_string).collect(),
    };
    for part in ["\"a\".position: y = 0.5", "\"a\".velocity: y = 2", "\"a\".angular_velocity", "\"b\".emit", "\"c\".fracture"] {
        assert_eq!(told.iter().filter(|t| t.contains(part)).count(), 1, "{part}: {told:?}");
    }
    assert_eq!(told.len(), 5, "{told:?}");
}
