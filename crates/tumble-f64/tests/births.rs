//! Rigid bodies that are born during the run. See docs/theory/rigid.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, column, run, simulation, step};
use tumble_f64::math::Quat;
use tumble_f64::scene::Simulation;
use tumble_interface::{Data, Engine, Scene};

const BALL: &str = "shape = { sphere = { radius = 0.1 } }\nmass = 2";

/// Balls in frames of 1/20 s and sub-steps of 1/200 s.
fn scene(gravity: f64, words: &str) -> Simulation {
    simulation(&format!(
        "seed = 3\ntime.fps = 20\nworld.gravity = [0, 0, {gravity}]\n[[system]]\nmethod = \"rigid\"\nsubsteps = 10\n[[body]]\nname = \"rocks\"\n{words}\n"
    ))
}

fn count(sim: &Simulation) -> usize {
    column(sim, "rocks", "position").len()
}

fn turns(sim: &Simulation) -> Vec<Quat<f64>> {
    match &sim.frame(&[]).column("rocks", "turn").unwrap().data {
        Data::F64(numbers) => numbers.chunks_exact(4).map(|q| Quat::from_row([q[0], q[1], q[2], q[3]])).collect(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn bodies_are_born_when_they_are_due_and_only_they_are_there() {
    let emit = "emit = { rate = 8, count = 5, start = 0.5, velocity = [1, 0, 0], spin = [0, 0, 3], from = { box = { center = [0, 0, 5], size = [0, 40, 0] } } }";
    let mut sim = scene(0.0, &format!("{BALL}\n{emit}"));
    assert!(count(&sim) == 0 && sim.ledger().mass == 0.0);
    for frame in 1..=40 {
        step(&mut sim);
        // A frame ends with its last sub-step: who is due at its end is born in the next.
        let due = ((f64::from(frame) / 20.0 - 0.005 - 0.5) * 8.0 + 1e-9).floor().clamp(0.0, 5.0) as usize;
        let ledger = sim.ledger();
        assert_eq!(count(&sim), due, "frame {frame}");
        assert_eq!(ledger.mass, 2.0 * due as f64);
        assert!((ledger.momentum[0] - 2.0 * due as f64).abs() < 1e-12, "{ledger:?}");
    }
    let v = column(&sim, "rocks", "angular_velocity");
    assert!(count(&sim) == 5 && v.iter().all(|w| (*w - Vector::from([0.0, 0.0, 3.0])).norm() < 1e-12));
    // In the order of their births.
    let x = column(&sim, "rocks", "position");
    assert!(x.windows(2).all(|pair| (pair[0].x - pair[1].x - 0.125).abs() < 0.0051), "{x:?}");
    let topology = sim.topology();
    assert!(topology.iter().any(|column| column.object == "rocks" && column.name == "mass" && column.data.len() == 5));
}

#[test]
fn who_finds_no_room_waits_and_nobody_is_lost() {
    // At a point there is room for the next once the last has gone 0.2 m: every 0.4 s, though 10 in a second are due.
    let emit = "emit = { rate = 10, count = 6, end = 0.61, velocity = [0.5, 0, 0], from = { point = {} } }";
    let mut sim = scene(0.0, &format!("{BALL}\n{emit}"));
    let mut counts = Vec::new();
    for _ in 0..60 {
        step(&mut sim);
        counts.push(count(&sim));
        let ledger = sim.ledger();
        assert!(ledger.penetration.unwrap() < 1e-12 && (ledger.momentum[0] - 1.0 * count(&sim) as f64).abs() < 1e-12, "{ledger:?}");
    }
    let births: Vec<usize> = (1..=6).map(|n| counts.iter().position(|count| *count >= n).unwrap()).collect();
    assert!(births.windows(2).all(|pair| (7..=10).contains(&(pair[1] - pair[0]))), "{births:?}");
    // One that stands in the way stops all.
    let mut shut = scene(0.0, &format!("{BALL}\n{}\n[[body]]\nname = \"plug\"\n{BALL}", emit.replace("0.5", "0")));
    run(&mut shut, 40);
    assert_eq!((count(&shut), shut.ledger().mass), (0, 2.0));
    let mut shut = scene(0.0, &format!("{BALL}\n{emit}\n[[collider]]\nname = \"floor\"\nshape.floor = {{ height = -0.09 }}"));
    run(&mut shut, 40);
    assert_eq!(count(&shut), 0);
}

#[test]
fn bodies_that_fall_into_a_heap_do_not_start_in_each_other() {
    let words = "shape = { box = { size = [0.2, 0.15, 0.1] } }\nemit = { rate = 40, count = 60, random_turns = true, from = { disk = { center = [0, 0, 1], radius = 0.25 } } }";
    let floor = "[[collider]]\nname = \"floor\"\nshape.floor = {}";
    let mut sim = scene(-9.81, &format!("{words}\n{floor}"));
    let mut deepest = 0.0_f64;
    for _ in 0..80 {
        step(&mut sim);
        deepest = deepest.max(sim.ledger().penetration.unwrap());
    }
    assert!(count(&sim) == 60 && deepest < 0.01, "{} {deepest}", count(&sim));
    // All turns are as likely: the mean square of a component of a direction is 1/3, within 0.3/sqrt(60).
    let mut still = scene(0.0, &words.replace("[0, 0, 1], radius = 0.25", "[0, 0, 1], radius = 9"));
    run(&mut still, 31);
    let mean = turns(&still).iter().map(|q| q.turn(Vector::from([1.0, 0.0, 0.0])).z.powi(2)).sum::<f64>() / 60.0;
    assert!(turns(&still).len() == 60 && (mean - 1.0 / 3.0).abs() < 0.12, "{mean}");
}

#[test]
fn births_have_the_same_bits_on_any_threads_and_after_a_restore() {
    let words = "shape = { box = { size = [0.2, 0.15, 0.1] } }\nfriction = 0.4\nemit = { rate = 30, count = 40, random_turns = true, from = { sphere = { center = [0, 0, 1], radius = 0.2 } } }\n[[collider]]\nname = \"floor\"\nshape.floor = {}";
    let whole = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut sim = scene(-9.81, words);
            run(&mut sim, 12);
            let kept = sim.save(&[]);
            run(&mut sim, 18);
            (kept, column(&sim, "rocks", "position"), turns(&sim))
        })
    };
    let (kept, x, q) = whole(1);
    for threads in [2, 8] {
        let (other, y, r) = whole(threads);
        assert!(other == kept && x == y && q == r, "{threads} threads");
    }
    let mut again = scene(-9.81, words);
    again.restore(&kept).unwrap();
    assert!(count(&again) > 3 && count(&again) < x.len());
    run(&mut again, 18);
    assert_eq!((column(&again, "rocks", "position"), turns(&again)), (x, q));
}

#[test]
fn masses_and_grains_meet_bodies_only_once_they_are_born() {
    // A plate, held up by nothing, at rest without gravity of its own: what flies through its place before its birth does not meet it.
    let plate = "shape = { box = { size = [1, 1, 0.1] } }\nmass = 1000\nemit = { rate = 2, count = 1, from = { point = {} } }";
    let dots = "[[system]]\nname = \"masses\"\nmethod = \"dynamics\"\n[[particles]]\nname = \"dots\"\nposition = [[0, 0, 0.5], [0.1, 0, 3.5]]\nvelocity = [[0, 0, -4]]";
    let beads = "[[system]]\nname = \"bed\"\nmethod = \"grains\"\n[[grains]]\nname = \"beads\"\nradius = 0.02\nyoung = 1e6\nposition = [[0.2, 0, 0.5], [0.3, 0, 3.5]]\nvelocity = [[0, 0, -4]]";
    let mut sim = scene(0.0, &format!("{plate}\n{dots}\n{beads}"));
    run(&mut sim, 25);
    for name in ["dots", "beads"] {
        let [early, late] = column(&sim, name, "velocity")[..] else { panic!() };
        assert!((early.z + 4.0).abs() < 1e-9 && late.z > -1.0, "{name}: {early:?} {late:?}");
    }
    assert!(column(&sim, "rocks", "velocity")[0].z < 0.0);
}

#[test]
fn births_that_cannot_be_are_told_with_their_cure() {
    let emit = |more: &str| format!("{BALL}\nemit = {{ rate = 8, count = 5, from = {{ point = {{}} }}{more} }}");
    let cases = [
        (emit("").replace("rate = 8", "rate = 0"), ".emit.rate: 0 1/s, expected > 0"),
        (emit("").replace("count = 5", "count = 0"), ".emit.count: 0, expected >= 1"),
        (emit(", start = 2, end = 1"), ".emit.end: it is not after start"),
        (emit("") + "\nvelocity = [[1, 0, 0]]", ".velocity: given beside emit; say it of those that are born: emit.velocity"),
        (emit("") + "\narrange.row = { count = 2, step = [1, 0, 0] }", ".arrange: given beside emit"),
        (emit("") + "\nposition = [[1, 0, 0]]", ".position: given beside emit"),
        (emit(", random_turns = true") + "\nrotate = [[1, 0, 0]]", ".emit.random_turns: true, and rotate is given"),
        (
            emit("").replace("point = {}", "disk = { radius = 1, normal = [0, 0, 0] }"),
            ".emit.from.disk.normal: [0, 0, 0], expected a direction",
        ),
    ];
    for (words, told) in cases {
        let text = format!("version = 1\n[[body]]\nname = \"a\"\n{words}\n");
        let error = match Scene::from_toml(&text) {
            Ok(scene) => Simulation::new(scene, Default::default()).err().unwrap().to_string(),
            Err(error) => error.to_string(),
        };
        assert!(error.contains(told) && error.contains("\"a\""), "{words}: {error}");
    }
    let text = format!("version = 1\n[[body]]\nname = \"a\"\n{}\n[[joint]]\nname = \"j\"\nbetween = [\"a 0\"]\nkind.ball = {{}}", emit(""));
    let error = Simulation::new(Scene::from_toml(&text).unwrap(), Default::default()).err().unwrap().to_string();
    assert!(error.contains("joint \"j\".between: bodies of \"a\" are born during the run"), "{error}");
}
