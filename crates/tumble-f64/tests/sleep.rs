//! Rigid bodies that sleep, against the same ones awake. See docs/theory/rigid.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, column, run, simulation};
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

const FLOOR: &str = "[[collider]]\nname = \"floor\"\nshape = { floor = {} }\n";

/// A scene of bodies; frames last 1/50 s and have ten sub-steps.
fn scene(gravity: &str, words: &str) -> Simulation {
    simulation(&format!("time.fps = 50\nworld.gravity = [0, 0, {gravity}]\n[[system]]\nmethod = \"rigid\"\nsubsteps = 10\n{words}"))
}

/// A stack of five boxes that falls by a centimetre, and what else there is.
fn stack(sleeping: bool, more: &str) -> String {
    format!(
        "[[body]]\nname = \"stack\"\nshape = {{ box = {{ size = [0.5, 0.5, 0.2] }} }}\nposition = [[0, 0, 0.11]]\narrange = {{ stack = {{ count = 5 }} }}\nsleeping = {sleeping}\n{more}"
    )
}

/// A brick that is thrown up at the start, and lands beside the middle of the stack after 3.36 s.
fn brick(sleeping: bool) -> String {
    format!(
        "[[body]]\nname = \"brick\"\nshape = {{ box = {{ size = [0.2, 0.2, 0.2] }} }}\nmass = 50\nposition = [[0.15, 0, 6]]\nvelocity = [[0, 0, 15]]\nsleeping = {sleeping}\n{FLOOR}"
    )
}

/// The whole state of the stack.
fn state(sim: &Simulation) -> Vec<Vec<Vector>> {
    ["position", "velocity", "angular_velocity"].map(|name| column(sim, "stack", name)).to_vec()
}

#[test]
fn what_has_come_to_rest_sleeps_where_it_would_rest_awake() {
    let [mut asleep, mut awake] = [true, false].map(|sleeping| scene("-9.81", &stack(sleeping, FLOOR)));
    // Awake it goes on by little; until it sleeps, both have the same bits.
    run(&mut asleep, 20);
    run(&mut awake, 20);
    assert!(state(&asleep) == state(&awake) && asleep.ledger().speed > Some(0.0));
    run(&mut asleep, 100);
    run(&mut awake, 100);
    let [one, other] = [&asleep, &awake].map(Simulation::ledger);
    assert!(one.speed == Some(0.0) && one.contacts == Some(5) && other.contacts == Some(5), "{one:?} {other:?}");
    for (x, y) in column(&asleep, "stack", "position").into_iter().zip(column(&awake, "stack", "position")) {
        assert!((x - y).norm() < 1e-4 && x.z > 0.09, "{x:?} {y:?}");
    }
    let before = state(&asleep);
    run(&mut asleep, 50);
    assert!(state(&asleep) == before);
}

#[test]
fn what_lands_on_them_wakes_them_as_hard_as_others() {
    let places = [true, false].map(|sleeping| {
        let mut sim = scene("-9.81", &stack(sleeping, &brick(false)));
        run(&mut sim, 165);
        let slow = column(&sim, "stack", "velocity").iter().all(|v| v.norm() == 0.0);
        assert_eq!(slow, sleeping, "before it lands");
        let before = column(&sim, "stack", "position")[4];
        run(&mut sim, 10);
        column(&sim, "stack", "position")[4] - before
    });
    // It tips the highest box.
    let [one, other] = places;
    assert!(one.norm() > 5e-3 && (one - other).norm() < 0.05 * other.norm(), "{places:?}");
    // All of it comes to rest again.
    let mut sim = scene("-9.81", &stack(true, &brick(true)));
    run(&mut sim, 600);
    assert_eq!(sim.ledger().speed, Some(0.0));
}

#[test]
fn they_wake_when_what_bears_them_changes() {
    // A table that goes away after three seconds.
    let table = "[[collider]]\nname = \"table\"\nshape = { box = { center = [0, 0, -0.5], size = [6, 2, 1] } }\nmotion = { keys = [{ time = 3 }, { time = 4, translate = [0, 0, -9] }] }\n";
    // Gravity that leans after three seconds: they slide down.
    for (gravity, words) in [("-9.81", stack(true, table)), ("\"-9.81 + 12*max(t - 3, 0)\"", stack(true, FLOOR))] {
        let mut sim = scene(gravity, &words);
        run(&mut sim, 148);
        assert_eq!(sim.ledger().speed, Some(0.0), "{gravity}");
        let before = column(&sim, "stack", "position")[0].z;
        run(&mut sim, 100);
        let moved = column(&sim, "stack", "position")[0].z - before;
        assert!(moved.abs() > 0.5, "{gravity}: {moved} m");
    }
}

#[test]
fn what_no_solid_bears_or_a_joint_holds_does_not_sleep() {
    // Without gravity, slowly; a pendulum of half a degree, which is slower than the limit all the time.
    let drift = "[[body]]\nname = \"stack\"\nshape = { sphere = { radius = 0.1 } }\nposition = [[0, 0, 1]]\nvelocity = [[1e-4, 0, 0]]\nsleeping = true\n";
    let mut sim = scene("0", drift);
    run(&mut sim, 100);
    assert!((column(&sim, "stack", "position")[0].x - 2e-4).abs() < 1e-15);
    let swing = "[[body]]\nname = \"stack\"\nshape = { sphere = { radius = 0.1 } }\nposition = [[0.001, 0, 0]]\nsleeping = true\n[[joint]]\nname = \"pin\"\nbetween = [\"stack\"]\nat = [0, 0, 1]\nkind.ball = {}\n";
    let mut sim = scene("-9.81", swing);
    let mut places = Vec::new();
    for _ in 0..200 {
        run(&mut sim, 1);
        places.push(column(&sim, "stack", "position")[0].x);
    }
    let late = &places[100..];
    assert!(late.iter().copied().fold(0.0, f64::max) > 9e-4 && late.iter().copied().fold(0.0, f64::min) < -9e-4, "{late:?}");
}

#[test]
fn sleepers_have_the_same_bits_after_a_restore_and_beside_what_is_far() {
    let alone = stack(true, &brick(false));
    let far = "[[body]]\nname = \"far\"\nshape = { sphere = { radius = 0.1 } }\nposition = [[50, 0, 3]]\nvelocity = [[1, 0, 0]]\nsleeping = true\n";
    let mut sim = scene("-9.81", &alone);
    let mut other = scene("-9.81", &format!("{alone}{far}"));
    // While it falls asleep, before something lands on what sleeps, and after that.
    for (frames, moves) in [(30, false), (30, true)] {
        run(&mut sim, frames);
        let mut again = scene("-9.81", &alone);
        again.restore(&sim.save(&[])).unwrap();
        run(&mut again, 60);
        run(&mut sim, 60);
        run(&mut other, frames + 60);
        assert!(state(&again) == state(&sim) && state(&sim) == state(&other), "{frames}");
        assert_eq!(column(&sim, "stack", "velocity")[4].norm() > 1e-9, moves, "{frames}");
    }
}
