//! Rods, whose frames are rows, and particles that are born into the same system: each moves as it does in a system of its own.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::{common, emission};

use common::*;
use emission::by_id;
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;
use tumble_interface::engine::UserForce;

const FLOOR: &str = "[[collider]]\nname = \"floor\"\nrestitution = 0.5\nshape.floor.height = -0.3\n";

/// A rod clamped at its start, whose frames turn as it sinks.
fn rod(system: &str) -> String {
    format!(
        "[[rope]]\nname = \"rod\"\n{system}from = [0, 0, 0]\nto = [0.5, 0, 0]\nsegments = 12\ndensity = 0.1\npin = [\"start\"]\nrod = {{ stretch = 500, bend = 0.01, \
         twist = 0.01 }}\n"
    )
}

/// Particles, and a spring, so that the masses of their system are stepped together as those of a rod are.
fn source(system: &str) -> String {
    format!(
        "[[particles]]\nname = \"pair\"\n{system}position = [[1, 0, 0.5], [1.1, 0, 0.5]]\nspring = [{{ between = [0, 1], stiffness = 10 }}]\n[[emitter]]\nname = \
         \"p\"\n{system}rate = 400\nspeed = 2\ncone = 40\nspeed_spread = 0.3\nlifetime = 0.5\nlifetime_spread = 0.4\nfrom.point.at = [0.2, 0, 0.1]\n"
    )
}

fn scene(names: [&str; 2], words: &str) -> Simulation {
    let mut text = String::from("precision = \"double\"\ntime.fps = 24\n");
    for (i, name) in names.iter().enumerate() {
        if i == 0 || name != &names[0] {
            text += &format!("[[system]]\nname = \"{name}\"\n{words}\n");
        }
    }
    let [a, b] = names.map(|name| format!("system = \"{name}\"\n"));
    simulation(&format!("{text}{}{}{FLOOR}", rod(&a), source(&b)))
}

fn turns(sim: &Simulation) -> Vec<f64> {
    match &sim.frame(&["orientation"]).column("rod", "orientation").unwrap().data {
        tumble_interface::Data::F64(q) => q.clone(),
        other => panic!("{other:?}"),
    }
}

/// Schemes of each family, and how far the two may differ [m]: bits, but where births make a scheme start anew or unknowns are solved together.
const WORDS: [(&str, f64); 6] = [
    ("integrator = \"symplectic_euler\"\nsubsteps = 400", 0.0),
    ("integrator = \"velocity_verlet\"\nsubsteps = 400", 0.0),
    ("integrator = \"verlet\"\nsubsteps = 400", 1e-10),
    ("integrator = \"rk4\"\nsubsteps = 400", 0.0),
    ("integrator = \"implicit_euler\"\nsubsteps = 10\nsolver.newton_tolerance = 1e-12\nsolver.linear_tolerance = 1e-8", 1e-11),
    ("method = \"position_based\"\nsubsteps = 10", 0.0),
];

#[test]
fn each_moves_as_in_a_system_of_its_own() {
    for (words, most) in WORDS {
        let (mut one, mut two) = (scene(["s", "s"], words), scene(["a", "b"], words));
        run(&mut one, 12);
        run(&mut two, 12);
        let far = |a: &[Vector], b: &[Vector]| a.iter().zip(b).map(|(a, b)| (*a - *b).norm()).fold(0.0, f64::max);
        let (x, y) = (positions(&one, "rod"), positions(&two, "rod"));
        assert!(x[12].z < -0.01, "{words}: the rod hangs at {}", x[12].z);
        let way = far(&x, &y).max(far(&positions(&one, "pair"), &positions(&two, "pair")));
        let turned = turns(&one).iter().zip(turns(&two)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let (p, q) = (by_id(&one, "p"), by_id(&two, "p"));
        assert!(p.len() > 100 && p.len() == q.len(), "{words}: {} and {}", p.len(), q.len());
        let apart = p.iter().zip(&q).map(|(a, b)| if a.0 == b.0 { (a.1 - b.1).norm() } else { f64::INFINITY }).fold(0.0, f64::max);
        println!("{words}: rod {way:e} m, frames {turned:e}, particles {apart:e} m");
        assert!(way <= most && turned <= 20.0 * most && apart <= most, "{words}: {way:e} {turned:e} {apart:e}");
        // Some of them bounced, and the ledger counts all masses once.
        assert!(p.iter().any(|p| p.2.z > 0.0 && p.1.z < 0.0), "{words}");
        let (a, b) = (one.ledger(), two.ledger());
        assert!((a.mass - b.mass).abs() < 1e-9 * b.mass && (a.kinetic - b.kinetic).abs() < 1e-4 * b.kinetic, "{words}: {a:?} {b:?}");
    }
}

#[test]
fn a_restored_run_goes_on_to_the_same_bits() {
    for (words, _) in WORDS {
        let mut sim = scene(["s", "s"], words);
        run(&mut sim, 8);
        let kept = sim.save(&[]);
        run(&mut sim, 6);
        let (hash, born) = (sim.hash(), by_id(&sim, "p").len());
        let mut other = scene(["s", "s"], words);
        run(&mut other, 3);
        other.restore(&kept).unwrap();
        run(&mut other, 6);
        assert!(born > 100);
        assert_eq!(other.hash(), hash, "{words}");
    }
}

/// Pushes every mass up as strongly as gravity pulls it down, and counts them.
struct Lift(std::sync::Arc<std::sync::atomic::AtomicUsize>);

impl UserForce for Lift {
    fn force(&mut self, _: f64, x: &[f64], _: &[f64], mass: &[f64], out: &mut [f64]) -> Result<(), String> {
        assert!(x.len() == out.len() && x.len() == 3 * mass.len());
        self.0.store(mass.len(), std::sync::atomic::Ordering::Relaxed);
        for (out, mass) in out.chunks_exact_mut(3).zip(mass) {
            out[2] += 9.8 * mass;
        }
        Ok(())
    }
}

/// A force of a user's on all masses meets points before and after the frames, and no frame.
#[test]
fn forces_of_users_act_on_points_alone() {
    let words = "integrator = \"rk4\"\nsubsteps = 400";
    let count = std::sync::Arc::default();
    let mut sim = scene(["s", "s"], words);
    sim.add_force("s", Box::new(Lift(std::sync::Arc::clone(&count)))).unwrap();
    run(&mut sim, 5);
    let n = by_id(&sim, "p").len();
    assert!(n > 50);
    let seen = count.load(std::sync::atomic::Ordering::Relaxed);
    assert!(seen > 15 && seen <= n + 15 + 17, "{seen} of {n}");
    let rod = positions(&sim, "rod");
    assert!(rod.iter().all(|x| x.z.abs() < 1e-9), "nothing weighs: {rod:?}");
    // Straight ways from the nozzle, but for the first sub-step of a life, which users' forces do not act in, and for bounces.
    for (_, x, v, age) in by_id(&sim, "p") {
        let from = x - v * age - vector(0.2, 0.0, 0.1);
        assert!(from.norm() < 1e-3 || x.z < 0.0, "{from:?}");
    }
}
