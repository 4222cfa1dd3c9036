//! Joints against closed forms and against the trajectories of ADAMS. See docs/theory/joints.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, column, run, simulation, step, vector};
use std::f64::consts::PI;
use tumble_f64::scene::Simulation;
use tumble_interface::{Engine, Scene};

const G: f64 = 9.80665;

/// A scene of bodies and joints; frames last 1/100 s and have so many sub-steps.
fn scene(gravity: [f64; 3], substeps: u32, words: &str) -> Simulation {
    simulation(&text(gravity, substeps, words))
}

fn text(gravity: [f64; 3], substeps: u32, words: &str) -> String {
    format!("time.fps = 100\nworld.gravity = {gravity:?}\n[[system]]\nmethod = \"rigid\"\nsubsteps = {substeps}\n{words}")
}

const DOWN: [f64; 3] = [0.0, 0.0, -G];
const NONE: [f64; 3] = [0.0; 3];

/// A body of 1 kg with the moments of inertia of ADAMS's tests.
fn block(at: [f64; 3]) -> String {
    format!(
        "[[body]]\nname = \"block\"\nshape = {{ sphere = {{ radius = 0.3 }} }}\nmass = 1\ninertia = [0.04, 0.1, 0.1]\nposition = [{at:?}]\n"
    )
}

fn joint(words: &str) -> String {
    format!("[[joint]]\nname = \"joint\"\n{words}\n")
}

fn place(sim: &Simulation) -> Vector {
    column(sim, "block", "position")[0]
}

/// Signed angle of the block below a pivot at the origin, about -y from hanging [rad].
fn angle(sim: &Simulation) -> f64 {
    let x = place(sim);
    x.x.atan2(-x.z)
}

#[test]
fn trajectories_agree_with_those_of_adams() {
    let spring = "{ target = { stiffness = 10, damping = 0.5 } }";
    let twist = "{ target = { stiffness = 200, damping = 10 } }";
    let at = "between = [\"block\"]\nat";
    // Source: data/testing/joints of Project Chrono, output of ADAMS, with 1 kg, I = (0.04, 0.1, 0.1), g = 9.80665 m/s²; at 1, 2, 3, 4, 5 s.
    let cases = [
        (
            [2.0, 0.0, 0.0],
            format!("{at} = [0, 0, 0]\nkind = {{ hinge = {{ axis = [0, 1, 0] }} }}"),
            [[-0.8924, 0.0, -1.7899], [-1.9511, 0.0, -0.4395], [1.8692, 0.0, -0.7115], [1.2970, 0.0, -1.5225], [-1.9997, 0.0, -0.0356]],
        ),
        (
            [3.0, 2.0, 3.0],
            format!("{at} = [1, 2, 3]\nkind = {{ hinge = {{ axis = [0, 1, 1] }} }}"),
            [
                [1.0421, 3.4139, 1.5861],
                [-1.0000, 2.0006, 2.9994],
                [0.8738, 3.4114, 1.5886],
                [3.0000, 2.0025, 2.9975],
                [1.2100, 3.4064, 1.5936],
            ],
        ),
        (
            [0.0; 3],
            format!("{at} = [0, 0, 0]\nkind = {{ slider = {{ axis = [0, 0, 1], motor = {spring} }} }}"),
            [[0.0, 0.0, -1.7450], [0.0, 0.0, -0.3850], [0.0, 0.0, -1.4448], [0.0, 0.0, -0.6190], [0.0, 0.0, -1.2624]],
        ),
        (
            [2.0, 0.0, 0.0],
            format!("{at} = [0, 0, 0]\nkind = {{ hinge = {{ axis = [0, 1, 0], motor = {twist} }} }}"),
            [[1.9949, 0.0, -0.1424], [1.9913, 0.0, -0.1868], [1.9904, 0.0, -0.1956], [1.9904, 0.0, -0.1959], [1.9904, 0.0, -0.1953]],
        ),
        (
            [3.0, 2.0, 3.0],
            format!("{at} = [1, 2, 3]\nkind = {{ ball = {{}} }}"),
            [
                [0.1076, 2.0000, 1.2101],
                [-0.9511, 2.0000, 2.5605],
                [2.8692, 2.0000, 2.2885],
                [2.2970, 2.0000, 1.4775],
                [-0.9997, 2.0000, 2.9644],
            ],
        ),
    ];
    for (at, words, expected) in cases {
        let mut sim = scene(DOWN, 5, &(block(at) + &joint(&words)));
        for (second, there) in expected.into_iter().enumerate() {
            run(&mut sim, 100);
            let off = (place(&sim) - Vector::from(there)).norm();
            assert!(off < 1e-3, "{words}: {off:.1e} m off after {} s", second + 1);
        }
    }
}

#[test]
fn pendulums_swing_as_elliptic_integrals_say() {
    // T/T0 = 2 K(sin(A/2))/π.
    let table =
        [(10.0, 1.001_907_2), (30.0, 1.017_408_8), (60.0, 1.073_182_0), (90.0, 1.180_340_6), (120.0, 1.372_880_5), (150.0, 1.762_203_7)];
    for (amplitude, ratio) in table {
        let a = f64::to_radians(amplitude);
        let words = joint("between = [\"block\"]\nat = [0, 0, 0]\nkind = { hinge = { axis = [0, 1, 0] } }");
        let mut sim = scene(DOWN, 5, &(block([a.sin(), 0.0, -a.cos()]) + &words));
        // The body turns about its y, of 0.1 kg m².
        let period = ratio * 2.0 * PI * (1.1 / G).sqrt();
        let (mut crossings, mut last) = (Vec::new(), a);
        for frame in 1..=(320.0 * period) as usize {
            step(&mut sim);
            let now = angle(&sim);
            if now * last < 0.0 && now.abs() < 1.0 {
                crossings.push((frame as f64 - now / (now - last)) / 100.0);
            }
            last = now;
        }
        let measured = (crossings[4] - crossings[0]) / 2.0;
        assert!((measured / period - 1.0).abs() < 1e-3, "{amplitude}°: {measured} of {period} s");
    }
}

#[test]
fn sub_steps_are_of_second_order() {
    let words = joint("between = [\"block\"]\nat = [0, 0, 0]\nkind = { ball = {} }");
    let after = |substeps: u32| {
        let start = block([1.0, 0.0, 0.2]) + "velocity = [[0, 0.7, 0]]\nangular_velocity = [[3, 0, 0.7]]\n";
        let mut sim = scene(DOWN, substeps, &(start + &words));
        run(&mut sim, 100);
        place(&sim)
    };
    let exact = after(320);
    let errors = [5, 10, 20].map(|n| (after(n) - exact).norm());
    let orders = common::orders(&errors);
    assert!(errors[0] > 1e-6 && orders.iter().all(|order| (1.8..2.2).contains(order)), "{orders:?}: {errors:?}");
}

#[test]
fn a_gyroscope_precesses_steadily() {
    // Steady precession at 60°: (I3 w - I1 Ω cos θ) Ω = m g l, with 5 kg at 0.02 m, I1 = 0.005 kg m² about the pivot, I3 = 0.002, spin 300.
    let (precession, a) = (1.646_293, 60f64.to_radians());
    let axis = vector(a.sin(), 0.0, a.cos());
    let w = vector(0.0, 0.0, precession) + axis * (300.0 - precession * a.cos());
    let v = w.cross(axis * 0.02);
    let top = format!(
        "[[body]]\nname = \"block\"\nshape = {{ sphere = {{ radius = 0.01 }} }}\nmass = 5\ninertia = [0.003, 0.003, 0.002]\n\
         position = [{:?}]\nrotate = [[0, 60, 0]]\nvelocity = [{:?}]\nangular_velocity = [{:?}]\n",
        <[f64; 3]>::from(axis * 0.02),
        <[f64; 3]>::from(v),
        <[f64; 3]>::from(w)
    );
    let words = joint("between = [\"block\"]\nat = [0, 0, 0]\nkind = { ball = {} }");
    let mut sim = scene([0.0, 0.0, -9.81], 10, &(top + &words));
    for _ in 0..100 {
        step(&mut sim);
        let tilt = (place(&sim).z / 0.02).acos().to_degrees();
        assert!((tilt - 60.0).abs() < 0.05, "{tilt}");
    }
    let turned = place(&sim).y.atan2(place(&sim).x);
    assert!((turned - precession).abs() < 1e-3 * precession, "{turned}");
}

#[test]
fn joined_bodies_keep_their_momenta_and_those_without_loss_their_energy() {
    let kinds = [
        "fixed = {}",
        "ball = {}",
        "hinge = { axis = [0.3, 1, 0.2] }",
        "slider = { axis = [1, 0.1, 0] }",
        "spring = { stiffness = 200, length = 0.3 }",
    ];
    for kind in kinds {
        // So small that they do not meet.
        let bodies = "[[body]]\nname = \"links\"\nshape = { sphere = { radius = 0.01 } }\nmass = 1.5\ninertia = [0.005, 0.01, 0.006]\n\
            arrange = { row = { count = 4, step = [0.4, 0, 0] } }\nvelocity = [[1, 0.2, 0], [0.3, 2, 0], [0, -1, 0.5], [0.4, 0.1, 1]]\n\
            angular_velocity = [[1, 2, 3]]\n";
        let mut sim = scene(NONE, 10, &(bodies.to_string() + &joint(&format!("between = [\"links\"]\nchain = true\nkind = {{ {kind} }}"))));
        // What joints do not allow is lost in the first sub-step.
        step(&mut sim);
        let start = sim.ledger();
        run(&mut sim, 300);
        let end = sim.ledger();
        let change = |a: [f64; 3], b: [f64; 3]| (Vector::from(a) - Vector::from(b)).norm();
        assert!(change(start.momentum, end.momentum) < 1e-12, "{kind}");
        let first = start.energy();
        let [before, after] = [start, end.clone()].map(|l| l.angular_momentum.unwrap());
        assert!(change(before, after) < 1e-11 * Vector::from(before).norm() && Vector::from(before).norm() > 1.0, "{kind}");
        let energy = end.energy();
        assert!((energy / first - 1.0).abs() < 0.01 && end.kinetic > 1.0, "{kind}: {energy} of {first} J");
    }
}

#[test]
fn limits_stop_hinges_and_sliders() {
    for (kind, motion) in
        [("hinge = { axis = [0, 1, 0], limits = [-0.5, 0.4] }", "hinge"), ("slider = { axis = [0, 0, 1], limits = [-0.5, 0.4] }", "slider")]
    {
        let words = joint(&format!("between = [\"block\"]\nat = [0, 0, 0]\nkind = {{ {kind} }}"));
        let mut sim = scene(DOWN, 5, &(block([1.0, 0.0, 0.0]) + &words));
        run(&mut sim, 300);
        let x = place(&sim);
        // A hinge about y turns x towards -z.
        let end = if motion == "hinge" { vector(0.4f64.cos(), 0.0, -(0.4f64.sin())) } else { vector(1.0, 0.0, -0.5) };
        assert!((x - end).norm() < 1e-5, "{kind}: {x:?}");
        assert!(column(&sim, "block", "velocity")[0].norm() < 1e-6, "{kind}");
    }
}

#[test]
fn motors_turn_by_their_strength_up_to_their_speed() {
    let words = |motor: &str| joint(&format!("between = [\"block\"]\nkind = {{ hinge = {{ axis = [0, 0, 1], motor = {{ {motor} }} }} }}"));
    // 0.3 N m on 0.1 kg m².
    let mut sim = scene(DOWN, 5, &(block([0.0; 3]) + &words("speed = { value = 6, strength = 0.3 }")));
    run(&mut sim, 100);
    let spin = |sim: &Simulation| column(sim, "block", "angular_velocity")[0].z;
    assert!((spin(&sim) - 3.0).abs() < 1e-9, "{}", spin(&sim));
    run(&mut sim, 150);
    assert!((spin(&sim) - 6.0).abs() < 1e-9, "{}", spin(&sim));
    let mut sim = scene(DOWN, 5, &(block([0.0; 3]) + &words("speed = { value = \"4*sin(3*t)\" }")));
    run(&mut sim, 100);
    // At the middle of the last of 500 sub-steps.
    assert!((spin(&sim) - 4.0 * (3.0f64 * 0.999).sin()).abs() < 1e-9, "{}", spin(&sim));
    // A lift on a spring of 50 N/m hangs m g/k low.
    let kind = "{ slider = { axis = [0, 0, 1], motor = { target = { stiffness = 50, damping = 10 } } } }";
    let mut sim = scene(DOWN, 5, &(block([0.0; 3]) + &joint(&format!("between = [\"block\"]\nkind = {kind}"))));
    run(&mut sim, 500);
    assert!((place(&sim).z + G / 50.0).abs() < 1e-6, "{}", place(&sim).z);
    let kind = "{ slider = { axis = [0, 0, 1], motor = { target = { stiffness = 5e5, damping = 10, strength = 5 } } } }";
    let mut sim = scene(DOWN, 5, &(block([0.0; 3]) + &joint(&format!("between = [\"block\"]\nkind = {kind}"))));
    run(&mut sim, 100);
    // It falls with g - 5 m/s², but for the first 0.01 mm.
    let fall = 0.5 * (G - 5.0);
    assert!((place(&sim).z + fall).abs() < 0.01, "{}", place(&sim).z);
    // Which takes 5 J for each metre.
    let energy = sim.ledger();
    assert!((energy.elastic - 5.0 * fall).abs() < 0.01 * energy.elastic && energy.energy().abs() < 0.1, "{energy:?}");
}

#[test]
fn a_rope_is_slack_then_taut_and_tells_its_force() {
    let words = joint("between = [\"block\"]\nkind = { rope = { to = [0, 0, 0], length = 1.5 } }");
    let mut sim = scene(DOWN, 5, &(block([0.0, 0.0, -0.5]) + &words));
    run(&mut sim, 40);
    assert!((place(&sim).z + 0.5 + 0.5 * G * 0.16).abs() < 1e-9, "{:?}", place(&sim));
    assert_eq!(column(&sim, "joint", "force")[1].norm(), 0.0);
    run(&mut sim, 300);
    assert!((place(&sim).z + 1.5).abs() < 1e-6, "{:?}", place(&sim));
    let [on_block, on_world] = column(&sim, "joint", "force")[..] else { panic!() };
    assert!((on_block - vector(0.0, 0.0, G)).norm() < 1e-6 * G && (on_world + on_block).norm() == 0.0, "{on_block:?}");
    let ends = column(&sim, "joint", "position");
    assert!(ends[1].norm() == 0.0 && (ends[0] - place(&sim)).norm() < 1e-12);
}

#[test]
fn joints_break_beyond_their_load() {
    // 1 kg at an arm of 1 m: 9.81 N and 9.81 N m.
    for (words, breaks) in
        [("break_force = 9.9", false), ("break_force = 9.7", true), ("break_torque = 9.9", false), ("break_torque = 9.7", true)]
    {
        let words = joint(&format!("between = [\"block\"]\nat = [0, 0, 0]\nkind = {{ fixed = {{}} }}\n{words}"));
        let mut sim = scene(DOWN, 5, &(block([1.0, 0.0, 0.0]) + &words));
        run(&mut sim, 100);
        let fallen = -place(&sim).z;
        let expected = if breaks { 0.5 * G } else { 0.0 };
        assert!((fallen - expected).abs() < if breaks { 0.03 } else { 1e-6 }, "{words}: {fallen}");
        assert_eq!(sim.ledger().broken, Some(u64::from(breaks)));
    }
}

#[test]
fn a_light_chain_holds_a_heavy_ball() {
    let words = "[[body]]\nname = \"links\"\nshape = { capsule = { radius = 0.01, length = 0.08 } }\nmass = 0.1\nrotate = [[0, 90, 0]]\n\
        position = [[0.05, 0, 0]]\narrange = { row = { count = 20, step = [0.1, 0, 0] } }\nfriction = 0\n\
        [[body]]\nname = \"block\"\nshape = { sphere = { radius = 0.2 } }\nmass = 100\nposition = [[2.2, 0, 0]]\n\
        [[joint]]\nname = \"top\"\nbetween = [\"links 0\"]\nat = [0, 0, 0]\nkind = { ball = {} }\n\
        [[joint]]\nname = \"chain\"\nbetween = [\"links\"]\nchain = true\nkind = { ball = {} }\n\
        [[joint]]\nname = \"hook\"\nbetween = [\"block\", \"links 19\"]\nat = [2, 0, 0]\nkind = { ball = {} }\n";
    let mut sim = scene(DOWN, 5, words);
    let (start, scale) = (sim.ledger().energy(), 102.0 * G * 2.0);
    let (mut gap, mut most) = (0.0_f64, f64::NEG_INFINITY);
    for _ in 0..300 {
        step(&mut sim);
        most = most.max(sim.ledger().energy() - start);
        for joint in ["top", "chain", "hook"] {
            gap = column(&sim, joint, "position").chunks_exact(2).map(|ends| (ends[0] - ends[1]).norm()).fold(gap, f64::max);
        }
    }
    assert!(gap < 1e-3, "{gap}");
    assert!(most < 1e-3 * scale && sim.ledger().energy() - start > -0.02 * scale, "{most}, {}", sim.ledger().energy() - start);
    assert!(place(&sim).z < -0.5);
}

#[test]
fn hinges_that_imply_each_other_share_a_door() {
    let words = block([0.5, 0.0, 1.0])
        + "[[joint]]\nname = \"low\"\nbetween = [\"block\"]\nat = [0, 0, 0.5]\nkind = { hinge = { axis = [0, 0, 1] } }\n\
           [[joint]]\nname = \"high\"\nbetween = [\"block\"]\nat = [0, 0, 1.5]\nkind = { hinge = { axis = [0, 0, 1] } }\n";
    let mut sim = scene(DOWN, 5, &words.replace("position", "angular_velocity = [[0, 0, 2]]\nvelocity = [[0, 1, 0]]\nposition"));
    run(&mut sim, 500);
    // Free, by 2 rad/s for 5 s.
    assert!((place(&sim) - vector(0.5 * 10f64.cos(), 0.5 * 10f64.sin(), 1.0)).norm() < 1e-3, "{:?}", place(&sim));
}

#[test]
fn far_joints_change_no_bit() {
    let chain = |name: &str, x: f64| {
        format!(
            "[[body]]\nname = \"{name}\"\nshape = {{ box = {{ size = [0.1, 0.1, 0.3] }} }}\nposition = [[{x}, 0, 2]]\n\
             arrange = {{ row = {{ count = 5, step = [0.3, 0, 0] }} }}\n[[joint]]\nname = \"{name} chain\"\nbetween = [\"{name}\"]\n\
             chain = true\nkind = {{ hinge = {{ axis = [0, 1, 0], limits = [-1, 1] }} }}\n\
             [[joint]]\nname = \"{name} top\"\nbetween = [\"{name} 0\"]\nkind = {{ ball = {{}} }}\n"
        )
    };
    let all = |far: &str| {
        let floor = "[[collider]]\nname = \"floor\"\nshape = { floor = {} }\n";
        let mut sim = scene(DOWN, 5, &(chain("near", 0.0) + far + floor));
        run(&mut sim, 150);
        column(&sim, "near", "position")
    };
    let (alone, together) = (all(""), all(&chain("far", 40.0)));
    assert_eq!(alone, together);
    assert!(alone[4].z < 1.5);
}

#[test]
fn wrong_joints_are_told_with_their_place_and_cure() {
    let two = block([0.0; 3]) + "[[body]]\nname = \"links\"\nshape = { sphere = { radius = 0.1 } }\nposition = [[1, 0, 0], [2, 0, 0]]\n";
    for (words, told) in [
        ("between = [\"blok\"]\nkind = { ball = {} }", "did you mean \"block\"?"),
        ("between = [\"links\"]\nkind = { ball = {} }", "say which: \"links 0\""),
        ("between = [\"links 2\"]\nkind = { ball = {} }", "the last one is 1"),
        ("between = [\"block\", \"block 0\"]\nkind = { ball = {} }", "same body"),
        ("between = [\"block\"]\nchain = true\nkind = { ball = {} }", "a chain needs at least two"),
        ("between = [\"block\", \"links 0\"]\nchain = true\nkind = { ball = {} }", "name the object whose bodies it joins"),
        ("between = [\"links\"]\nat = [0, 0, 0]\nchain = true\nkind = { ball = {} }", "leave it out"),
        ("between = [\"block\"]\nkind = { hinge = { axis = [0, 0, 0] } }", "expected a direction"),
        ("between = [\"block\"]\nkind = { hinge = { axis = [0, 0, 1], limits = [-4, 1] } }", "expected angles from -3.1 to 3.1"),
        ("between = [\"block\"]\nkind = { slider = { axis = [0, 0, 1], limits = [2, 1] } }", "the least first"),
        ("between = [\"block\"]\nkind = { slider = { axis = [0, 0, 1], limits = [1, 2] } }", "starts at 0"),
        (
            "between = [\"block\"]\nkind = { hinge = { axis = [0, 0, 1], motor = { target = { value = 4, stiffness = 9 } } } }",
            "-3.1 to 3.1",
        ),
        ("between = [\"block\"]\nkind = { ball = {} }\nbreak_torque = 3", "holds no torque"),
        ("between = [\"links\"]\nchain = true\nkind = { rope = { to = [0, 0, 0] } }", "leave it out"),
        ("between = [\"block\", \"world\"]\nkind = { ball = {} }", "for the world leave it out"),
        ("between = [\"block\"]\nkind = { rope = {} }", "where in the world"),
        ("between = [\"block\", \"links 1\"]\nkind = { rope = { length = 1 } }", "2 m apart"),
        ("between = [\"block\"]\nkind = { rope = { to = [0, 0, 0] } }", "one place"),
    ] {
        let scene = Scene::from_toml(&format!("version = 1\n{}", text(DOWN, 5, &(two.clone() + &joint(words))))).unwrap();
        let message = Simulation::new(scene, Default::default()).map(|_| ()).unwrap_err().to_string();
        assert!(message.contains(told) && message.contains("joint \"joint\""), "{words}: {message}");
    }
}

#[test]
fn limits_and_ropes_are_stronger_than_motors() {
    let motor = "motor = { speed = { value = 1 } }";
    let after = |words: &str, seconds: usize| {
        let mut sim = scene(NONE, 5, &(block([0.0; 3]) + words));
        run(&mut sim, 100 * seconds);
        sim
    };
    let limited =
        after(&joint(&format!("between = [\"block\"]\nkind = {{ slider = {{ axis = [0, 0, 1], limits = [-1, 0.5], {motor} }} }}")), 2);
    assert!((place(&limited).z - 0.5).abs() < 1e-5, "{:?}", place(&limited));
    let tied = after(
        &(joint(&format!("between = [\"block\"]\nkind = {{ slider = {{ axis = [0, 0, 1], {motor} }} }}"))
            + "[[joint]]\nname = \"rope\"\nbetween = [\"block\"]\nkind = { rope = { to = [0, 0, -0.4], length = 0.6 } }\n"),
        2,
    );
    assert!((place(&tied).z - 0.2).abs() < 1e-5, "{:?}", place(&tied));
    // With a strength, so are contacts.
    let wall = "[[collider]]\nname = \"wall\"\nshape = { plane = { point = [0, 0, 1], normal = [0, 0, -1] } }\n";
    let motor = "motor = { speed = { value = 1, strength = 500 } }";
    let kind = format!("between = [\"block\"]\nkind = {{ slider = {{ axis = [0, 0, 1], {motor} }} }}");
    let stopped = after(&(joint(&kind) + wall), 2);
    assert!((place(&stopped).z - 0.7).abs() < 1e-3, "{:?}", place(&stopped));
}

#[test]
fn linkages_pass_where_they_are_stretched() {
    // A rhombus, whose sides fall beside each other.
    let bars = "[[body]]\nname = \"block\"\nshape = { box = { size = [0.1, 0.1, 1] } }\nposition = [[0, -0.2, 2.5], [1, 0.2, 2.5]]\n\
        angular_velocity = [[0, 1, 0], [0, 0, 0]]\n[[body]]\nname = \"top\"\nshape = { box = { size = [1, 0.1, 0.1] } }\nposition = [[0.5, 0, 3]]\n";
    let hinge = |name: &str, between: &str, at: &str, motor: &str| {
        format!("[[joint]]\nname = \"{name}\"\nbetween = [{between}]\nat = {at}\nkind = {{ hinge = {{ axis = [0, 1, 0]{motor} }} }}\n")
    };
    for motor in ["", ", motor = { speed = { value = 3, strength = 1e4 } }", ", motor = { speed = { value = 3 } }"] {
        let words = bars.to_string()
            + &hinge("a", "\"block 0\"", "[0, 0, 2]", motor)
            + &hinge("b", "\"top\", \"block 0\"", "[0, 0, 3]", "")
            + &hinge("c", "\"block 1\", \"top\"", "[1, 0, 3]", "")
            + &hinge("d", "\"block 1\"", "[1, 0, 2]", "");
        let mut sim = scene(DOWN, 5, &words);
        let (mut gap, mut most) = (0.0_f64, 0.0_f64);
        for _ in 0..400 {
            step(&mut sim);
            most = most.max(sim.ledger().energy());
            for joint in ["a", "b", "c", "d"] {
                let ends = column(&sim, joint, "position");
                gap = gap.max((ends[0] - ends[1]).norm());
            }
        }
        assert!(gap < 1e-3 && most < 900.0 && most > 700.0, "{motor}: {gap:e} m, {most} J");
    }
}

#[test]
fn springs_off_the_centre_keep_energy() {
    for (words, at) in [("length = 0.5", "[0.1, 0.1, 0.1]"), ("length = 0, to = [0.9, -0.1, 0]", "[0.1, 0, 0]")] {
        let bodies = "[[body]]\nname = \"block\"\nshape = { box = { size = [0.2, 0.2, 0.2] } }\nposition = [[0, 0, 0], [1, 0, 0]]\n";
        let spring = format!("between = [\"block 0\", \"block 1\"]\nat = {at}\nkind = {{ spring = {{ stiffness = 1e4, {words} }} }}");
        let mut sim = scene(NONE, 5, &(bodies.to_string() + &joint(&spring)));
        let start = sim.ledger().energy();
        for _ in 0..1000 {
            step(&mut sim);
            let now = sim.ledger().energy();
            assert!((now / start - 1.0).abs() < 0.04, "{words}: {now} of {start} J");
        }
        assert!(start > 100.0);
    }
}

#[test]
fn a_rotor_on_an_arm_keeps_turning_and_broken_joints_come_back() {
    let rod = "[[body]]\nname = \"block\"\nshape = { capsule = { radius = 0.03, length = 0.94 } }\nrotate = [[0, 90, 0]]\nposition = [[0.5, 0, 0]]\n\
        velocity = [[0, 15, 0]]\nangular_velocity = [[0, 0, 30]]\n"
        .to_string()
        + &joint("between = [\"block\"]\nat = [0, 0, 0]\nkind = { hinge = { axis = [0, 0, 1] } }\nbreak_force = 1500");
    let mut sim = scene(NONE, 5, &rod);
    run(&mut sim, 100);
    // A term of third order in h w = 0.06 brakes it.
    let spin = column(&sim, "block", "angular_velocity")[0].z;
    assert!((spin / 30.0 - 1.0).abs() < 5e-3, "{spin}");
    // It pulls with m w² r = 1220 N; a third faster is too much.
    assert_eq!(sim.ledger().broken, Some(0));
    let faster = rod.replace("15,", "20,").replace("30]", "40]");
    let mut sim = scene(NONE, 5, &faster);
    run(&mut sim, 5);
    assert_eq!(sim.ledger().broken, Some(1));
    let saved = sim.save(&[]);
    run(&mut sim, 20);
    let expected = column(&sim, "block", "position");
    let mut again = scene(NONE, 5, &faster);
    again.restore(&saved).unwrap();
    run(&mut again, 20);
    assert_eq!(column(&again, "block", "position"), expected);
    assert_eq!(again.ledger().broken, Some(1));
}

#[test]
fn a_small_ball_on_a_long_arm_keeps_turning() {
    // Its own moment is far below that of its load in a sub-step; but nothing else holds it.
    let ball = "[[body]]\nname = \"block\"\nshape = { sphere = { radius = 0.02 } }\nposition = [[1, 0, 0]]\nvelocity = [[0, 20, 0]]\n\
        angular_velocity = [[0, 0, 20]]\n";
    for kind in ["hinge = { axis = [0, 0, 1] }", "ball = {}"] {
        let words = format!("between = [\"block\"]\nat = [0, 0, 0]\nkind = {{ {kind} }}");
        let mut sim = scene(NONE, 5, &(ball.to_string() + &joint(&words)));
        run(&mut sim, 100);
        let speed = column(&sim, "block", "velocity")[0].norm();
        assert!((speed / 20.0 - 1.0).abs() < 5e-3, "{kind}: {speed}");
    }
}

#[test]
fn joined_bodies_touch_only_where_they_are_told_to() {
    let boxes = "[[body]]\nname = \"block\"\nshape = { box = { size = [0.2, 0.2, 0.2] } }\nposition = [[0, 0, 0], [0.15, 0, 0]]\n";
    for (words, contacts) in [("", 0), ("collide = true\n", 2)] {
        let words = format!("between = [\"block 0\", \"block 1\"]\nat = [0.075, 0, 0]\nkind = {{ ball = {{}} }}\n{words}");
        let mut sim = scene(NONE, 5, &(boxes.to_string() + &joint(&words)));
        run(&mut sim, 1);
        assert_eq!(sim.ledger().contacts, Some(contacts), "{words}");
    }
}

#[test]
fn a_taut_chain_goes_on_to_the_same_bits() {
    let words = "[[body]]\nname = \"block\"\nshape = { sphere = { radius = 0.01 } }\nposition = [[0.05, 0, 0]]\n\
        arrange = { row = { count = 8, step = [0.1, 0, 0] } }\n[[body]]\nname = \"ball\"\nshape = { sphere = { radius = 0.05 } }\nmass = 50\n\
        position = [[0.85, 0, 0]]\n[[joint]]\nname = \"top\"\nbetween = [\"block 0\"]\nat = [0, 0, 0]\nkind = { ball = {} }\n\
        [[joint]]\nname = \"chain\"\nbetween = [\"block\"]\nchain = true\nkind = { ball = {} }\n\
        [[joint]]\nname = \"hook\"\nbetween = [\"ball\", \"block 7\"]\nat = [0.8, 0, 0]\nkind = { ball = {} }\n";
    let mut sim = scene(DOWN, 5, words);
    run(&mut sim, 40);
    let saved = sim.save(&[]);
    run(&mut sim, 20);
    let expected = column(&sim, "block", "position");
    let mut again = scene(DOWN, 5, words);
    again.restore(&saved).unwrap();
    run(&mut again, 20);
    assert_eq!(column(&again, "block", "position"), expected);
    assert!(column(&sim, "hook", "force")[0].norm() > 100.0);
}
