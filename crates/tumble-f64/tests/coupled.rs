//! Rigid bodies coupled to masses by anchors. See docs/theory/coupling.md.

use crate::common;

use common::{Vector, column, run, simulation, step};
use std::fmt::Write;
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

const G: f64 = 9.81;

fn scene(gravity: f64, exchanges: u32, integrator: &str, words: &str) -> Simulation {
    scene_of("", gravity, exchanges, integrator, words)
}

fn scene_of(first: &str, gravity: f64, exchanges: u32, integrator: &str, words: &str) -> Simulation {
    let substeps = if integrator.starts_with("implicit") { 1 } else { 4 };
    simulation(&format!(
        "{first}\ntime = {{ fps = 100, exchanges = {exchanges} }}\nworld.gravity = [0, 0, -{gravity}]\n\
         [[system]]\nname = \"masses\"\nintegrator = \"{integrator}\"\nsubsteps = {substeps}\n[[system]]\nname = \"bodies\"\nmethod = \"rigid\"\n{words}"
    ))
}

/// A ball of so much mass.
fn ball(name: &str, mass: f64, at: [f64; 3], more: &str) -> String {
    format!("[[body]]\nname = \"{name}\"\nshape = {{ sphere = {{ radius = 0.1 }} }}\nmass = {mass}\nposition = [{at:?}]\n{more}\n")
}

fn anchor(name: &str, between: [&str; 2], words: &str) -> String {
    format!("[[anchor]]\nname = \"{name}\"\nbetween = {between:?}\n{words}\n")
}

#[test]
fn what_one_side_loses_the_other_gains() {
    // Off the centre, so that the body turns.
    for integrator in ["velocity_verlet", "implicit_euler", "position_based"] {
        let words =
            "[[particles]]\nname = \"p\"\nposition = [[1, 0, 0.3], [1.5, 0.2, 0]]\nmass = [0.5, 0.3]\nvelocity = [[0, 1, 0], [0.3, 0, 0]]\n"
                .to_string()
                + &ball("b", 2.0, [0.0; 3], "inertia = [0.02, 0.01, 0.015]\nangular_velocity = [[0, 0, 3]]")
                + &anchor("one", ["p 0", "b 0"], "at = [0.08, 0.05, 0]\nstiffness = 40\nrest_length = 0.5\ndamping = 0.2")
                + &anchor("two", ["b 0", "p 1"], "at = [0, 0, 0.1]\nstiffness = 20\nrest_length = 1");
        let mut sim = scene(0.0, 5, integrator, &words);
        let start = sim.ledger();
        let mut moved = 0.0_f64;
        for _ in 0..200 {
            step(&mut sim);
            moved = moved.max((column(&sim, "b", "velocity")[0]).norm());
        }
        let end = sim.ledger();
        let change = |a: [f64; 3], b: [f64; 3]| (Vector::from(a) - Vector::from(b)).norm();
        assert!(change(start.momentum, end.momentum) < 1e-12 && moved > 0.1, "{integrator}: {:?} {:?}", start.momentum, end.momentum);
        let [before, after] = [start, end].map(|l| l.angular_momentum.unwrap());
        assert!(change(before, after) < 1e-11, "{integrator}: {before:?} {after:?}");
    }
}

#[test]
fn a_box_hangs_on_a_rope_where_statics_says() {
    let words = "[[rope]]\nname = \"rope\"\nfrom = [0, 0, 2]\nto = [0, 0, 1]\nsegments = 10\ndensity = 0.02\nlinks = { structural = 2000 }\npin = [\"start\"]\npoint_mass = [{ at = \"end\", mass = 0.3 }]\n[[force]]\nkind = \"drag\"\ncoefficient = 1\n"
        .to_string()
        + &ball("box", 3.0, [0.0, 0.0, 0.9], "")
        + &anchor("hook", ["rope 10", "box 0"], "at = [0, 0, 1]\nstiffness = 5000\nrest_length = 0\ndamping = 20");
    let mut sim = scene(G, 10, "position_based", &words);
    run(&mut sim, 2400);
    let (box_at, end) = (column(&sim, "box", "position")[0], column(&sim, "rope", "position")[10]);
    // The published velocity of what rests is that after half of an interval of gravity: damping makes g dt c/2 of it.
    // EA = 2000 N bears the box, the ring and a half of the rope; the anchor bears the box.
    let (rope, hook) = ((3.3 + 0.01) * G / 2000.0, 3.0 * G / 5000.0);
    assert!((end.z - (1.0 - rope)).abs() < 0.01 * rope, "{} of {}", 1.0 - end.z, rope);
    assert!((end.z - box_at.z - 0.1 - hook).abs() < 0.01 * hook, "{} of {hook}", end.z - box_at.z - 0.1);
    assert!(column(&sim, "box", "velocity")[0].norm() < 5e-3);
}

#[test]
fn a_weight_over_a_pulley_pulls_a_cart() {
    // Along the top, a quarter of a circle, and down.
    let (radius, spacing) = (0.2, 0.02);
    let reach = radius + 0.005;
    let quarter = 0.5 * std::f64::consts::PI * reach;
    let place = |s: f64| {
        if s < 1.5 {
            [s - 1.5, 0.0, 1.0 + reach]
        } else if s < 1.5 + quarter {
            let a = (s - 1.5) / reach;
            [reach * a.sin(), 0.0, 1.0 + reach * a.cos()]
        } else {
            [reach, 0.0, 1.0 - (s - 1.5 - quarter)]
        }
    };
    let count = ((1.5 + quarter + 0.3) / spacing) as usize;
    let mut words = String::from("[[particles]]\nname = \"rope\"\nmass = [0.002]\nposition = [");
    (0..count).for_each(|i| write!(words, "{:?}, ", place(i as f64 * spacing)).unwrap());
    words += "]\nspring = [";
    (1..count).for_each(|i| write!(words, "{{ between = [{}, {i}], stiffness = 2e5, damping = 2000 }}, ", i - 1).unwrap());
    let last = place((count - 1) as f64 * spacing);
    words += "]\n[[collider]]\nname = \"pulley\"\nshape = { capsule = { from = [0, -1, 1], to = [0, 1, 1], radius = 0.2 } }\nthickness = 0.005\nfriction = 0\n";
    let at = |place: [f64; 3]| format!("at = {place:?}\nstiffness = 3000\nrest_length = 0\ndamping = 1");
    // Tied by their surfaces: the rope touches them, too.
    words += &(ball("cart", 2.0, [-1.6, 0.0, 1.0 + reach], "")
        + &ball("weight", 1.0, [last[0], 0.0, last[2] - 0.1], "")
        + "[[joint]]\nname = \"rail\"\nbetween = [\"cart\"]\nkind = { slider = { axis = [1, 0, 0] } }\n"
        + &anchor("front", ["rope 0", "cart 0"], &at(place(0.0)))
        + &anchor("hook", [&format!("rope {}", count - 1), "weight 0"], &at(last)));
    let mut sim = scene(G, 20, "implicit_midpoint", &words);
    let speed = |sim: &Simulation| column(sim, "cart", "velocity")[0].x;
    run(&mut sim, 20);
    let (early, high) = (speed(&sim), column(&sim, "weight", "position")[0].z);
    run(&mut sim, 60);
    let rate = (speed(&sim) - early) / 0.6;
    // What hangs of the rope pulls, too: 0.1 kg/m, the mean over this time.
    let hanging = 0.1 * (0.5 * (high + column(&sim, "weight", "position")[0].z) + 0.1 - 1.0).abs();
    let exact = (1.0 + hanging) * G / (3.0 + 0.002 * count as f64);
    assert!((rate / exact - 1.0).abs() < 0.01, "{rate} of {exact} m/s²");
}

#[test]
fn the_order_of_systems_and_the_interval_matter_less_and_less() {
    // A body on a spring to a heavy mass at rest: m x'' = -k x.
    let after = |exchanges: u32, first: bool| {
        let systems = [
            "[[system]]\nname = \"masses\"\nintegrator = \"velocity_verlet\"\nsubsteps = 4\n",
            "[[system]]\nname = \"bodies\"\nmethod = \"rigid\"\n",
        ];
        let order = if first { [systems[0], systems[1]] } else { [systems[1], systems[0]] };
        let words = format!(
            "time = {{ fps = 100, exchanges = {exchanges} }}\nworld.gravity = [0, 0, 0]\n{}[[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\nmass = [1]\n{}{}",
            order.concat(),
            ball("b", 2.0, [0.5, 0.0, 0.0], ""),
            anchor("tie", ["p 0", "b 0"], "stiffness = 60\nrest_length = 0.4")
        );
        let mut sim = simulation(&words);
        run(&mut sim, 60);
        column(&sim, "b", "position")[0].x
    };
    // Reduced mass 2/3: the distance is 0.4 + 0.1 cos(w t), of which the body has a third.
    let w = (60.0_f64 * 1.5).sqrt();
    let exact = 0.5 - (1.0 - (w * 0.6).cos()) * 0.1 / 3.0;
    for first in [true, false] {
        let errors = [2, 4, 8].map(|n| (after(n, first) - exact).abs());
        let orders = common::orders(&errors);
        assert!(orders.iter().all(|order| *order > 0.8) && errors[0] > 1e-6 && errors[2] < 1e-3, "{first}: {errors:?} {orders:?}");
    }
}

#[test]
fn repeated_intervals_bear_stiff_anchors() {
    // omega dt = 3: explicit exchange of impulses explodes.
    let words = "[[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\nmass = [1]\n".to_string()
        + &ball("b", 1.0, [0.5, 0.0, 0.0], "")
        + &anchor("tie", ["p 0", "b 0"], "stiffness = 45000\nrest_length = 0.49");
    let mut alone = scene(0.0, 1, "velocity_verlet", &words);
    run(&mut alone, 100);
    assert!(column(&alone, "b", "position")[0].norm() > 10.0);
    let mut sim = scene_of("world.coupling = { iterations = 30, tolerance = 1e-6 }", 0.0, 1, "velocity_verlet", &words);
    for _ in 0..100 {
        step(&mut sim);
        let [p, b] = ["p", "b"].map(|object| column(&sim, object, "position")[0]);
        assert!(((b - p).norm() - 0.49).abs() < 0.1, "{p:?} {b:?}");
    }
    assert!(column(&sim, "b", "velocity")[0].norm() > 0.1);
}
