//! Grains that are poured in over time. See docs/theory/grains.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{positions, run, simulation, velocities};
use std::f64::consts::PI;
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Data, Engine, Scene};

const R: f64 = 0.01;
const SCHEMES: [&str; 2] = ["forces", "positions"];

/// Grains poured over a floor; frames last 1/50 s.
fn scene(scheme: &str, words: &str, emit: &str, more: &str) -> Simulation {
    let system = format!("[[system]]\nname = \"grains\"\nmethod = \"grains\"\ngrains.scheme = \"{scheme}\"\n");
    let floor = "[[collider]]\nname = \"floor\"\nshape = { floor = {} }\nfriction = 0.5\n";
    let sand = format!("[[grains]]\nname = \"sand\"\nradius = {R}\nfriction = 0.5\nrolling_friction = 0.1\n{words}\nemit = {{ {emit} }}\n");
    simulation(&format!("seed = 3\ntime = {{ fps = 50, exchanges = 2 }}\nworld.gravity = [0, 0, -9.81]\n{system}{sand}{floor}{more}"))
}

const DISK: &str = "from = { disk = { center = [0, 0, 0.5], radius = 0.06 } }, velocity = [0, 0, -1]";

fn numbers(sim: &Simulation, column: &str) -> Vec<f64> {
    match &sim.frame(&["position"]).column("sand", column).unwrap().data {
        Data::F64(numbers) => numbers.clone(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn as_many_are_born_as_the_rate_says_each_where_it_has_fallen_to() {
    for scheme in SCHEMES {
        let mut sim = scene(scheme, "", &format!("{DISK}, rate = 150, count = 60, start = 0.1, end = 0.4"), "");
        assert_eq!(positions(&sim, "sand").len(), 0);
        for frame in 1..=30 {
            run(&mut sim, 1);
            let t = f64::from(frame) / 50.0;
            // The k-th at 0.1 s + k/150 s, until 0.4 s: 45.
            let due = (150.0 * (t.min(0.4) - 0.1) + 1e-6).max(0.0) as usize;
            let (x, ledger) = (positions(&sim, "sand"), sim.ledger());
            assert_eq!((x.len(), ledger.waiting), (due, Some(0)), "{scheme} {t}");
            let each = 4.0 / 3.0 * PI * R.powi(3) * 2500.0;
            assert!((ledger.mass - due as f64 * each).abs() < 1e-12 && numbers(&sim, "radius") == vec![R; due], "{scheme} {t}");
            assert_eq!(numbers(&sim, "mass").len(), due);
        }
        assert_eq!(positions(&sim, "sand").len(), 45);
    }
    // In free fall all left the disk when they were due, with its velocity.
    let mut sim = scene("positions", "radius_spread = 0.3", &format!("{DISK}, rate = 200, count = 60"), "");
    run(&mut sim, 10);
    let (x, v) = (positions(&sim, "sand"), velocities(&sim, "sand"));
    assert!(x.len() == 40 && x.iter().all(|p| p.x.hypot(p.y) < 0.0601));
    let radii = numbers(&sim, "radius");
    assert!(radii.iter().any(|r| *r < 0.8 * R) && radii.iter().any(|r| *r > 1.2 * R));
    for (k, (x, v)) in x.iter().zip(&v).enumerate() {
        let age = 0.2 - (k as f64 + 1.0) / 200.0;
        // Steps of first order fall a little farther.
        let (fallen, fast) = (0.5 - age - 0.5 * 9.81 * age * age, -1.0 - 9.81 * age);
        assert!((x.z - fallen).abs() < 1e-3 && (v.z - fast).abs() < 1e-9, "{k}: {x:?} of {fallen}, {v:?} of {fast}");
    }
}

#[test]
fn a_crowded_source_waits_and_loses_none() {
    for scheme in SCHEMES {
        // Five times as many as leave a disk of two diameters at 0.5 m/s.
        let emit = "from = { disk = { center = [0, 0, 0.4], radius = 0.02 } }, velocity = [0, 0, -0.5], rate = 1500, count = 150";
        let mut sim = scene(scheme, "", emit, "");
        run(&mut sim, 5);
        let (some, waiting) = (positions(&sim, "sand").len() as u64, sim.ledger().waiting.unwrap());
        assert!(some > 5 && waiting > 20 && some + waiting == 150, "{scheme}: {some}, {waiting}");
        let mut deepest = 0.0_f64;
        for _ in 0..120 {
            run(&mut sim, 1);
            deepest = deepest.max(sim.ledger().penetration.unwrap());
        }
        assert_eq!((positions(&sim, "sand").len(), sim.ledger().waiting), (150, Some(0)), "{scheme}");
        assert!(deepest < 0.15 * R, "{scheme}: {deepest}");
    }
    // A source in a solid bears none.
    let block = "[[collider]]\nname = \"block\"\nshape = { sphere = { center = [0, 0, 0.5], radius = 0.2 } }\n";
    let mut sim = scene("positions", "", &format!("{DISK}, rate = 100, count = 10"), block);
    run(&mut sim, 20);
    assert_eq!((positions(&sim, "sand").len(), sim.ledger().waiting), (0, Some(10)));
}

#[test]
fn threads_and_a_restore_while_grains_are_poured_change_no_bit() {
    for scheme in SCHEMES {
        let build = || {
            let more = "[[body]]\nname = \"box\"\nshape = { box = { size = [0.1, 0.1, 0.05] } }\nposition = [[0, 0, 0.1]]\n[[system]]\nname = \"bodies\"\nmethod = \"rigid\"\n";
            let words = "radius_spread = 0.2\nfill = [{ center = [0, 0, 0.04], size = [0.2, 0.2, 0.06] }]";
            scene(scheme, words, &format!("{DISK}, rate = 400, count = 200"), more)
        };
        let after = |threads: usize, cut: bool| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut sim = build();
                run(&mut sim, 12);
                if cut {
                    let kept = sim.save(&[]);
                    sim = build();
                    sim.restore(&kept).unwrap();
                }
                run(&mut sim, 12);
                assert!(sim.ledger().contacts.unwrap() > 40);
                [positions(&sim, "sand"), velocities(&sim, "sand"), positions(&sim, "box")].concat()
            })
        };
        let plain = after(1, false);
        assert!(plain.len() > 500, "{}", plain.len());
        assert!(plain == after(3, false), "{scheme}: threads");
        assert!(plain == after(2, true), "{scheme}: a snapshot");
    }
}

#[test]
fn what_is_wrong_with_an_emit_is_told_with_its_place() {
    let told = |words: &str, emit: &str| -> Vec<String> {
        let text = format!("version = 1\n[[grains]]\nname = \"g\"\nradius = 0.01\n{words}\nemit = {{ rate = 10, count = 5, {emit} }}\n");
        let issues = Simulation::new(Scene::from_toml(&text).unwrap(), Assets::default()).err().map(|error| error.issues);
        issues.unwrap_or_default().into_iter().map(|issue| format!("{}: {}", issue.path, issue.message)).collect()
    };
    let disk = "from = { disk = { radius = 0.1 } }";
    assert!(told("", disk).is_empty());
    for (words, emit, path, cure) in [
        ("", format!("{disk}, start = 2, end = 1"), "grains \"g\".emit.end: ", "after start"),
        ("", "from = { particles = { of = \"spray\" } }".into(), "grains \"g\".emit.from.particles: ", "take"),
        ("", "from = { disk = { radius = 0.1, normal = [0, 0, 0] } }".into(), "grains \"g\".emit.from.disk.normal: ", "direction"),
        ("clump = \"dumbbell\"", disk.into(), "grains \"g\".emit: ", "leave out clump"),
    ] {
        let told = told(words, &emit);
        assert!(told.len() == 1 && told[0].starts_with(path) && told[0].contains(cure), "{told:?}");
    }
}
