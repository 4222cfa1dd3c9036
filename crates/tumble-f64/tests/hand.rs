//! The hand: a spring that pulls, a Gaussian that stirs.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{simulation, step};
use tumble_f64::scene::Simulation;
use tumble_f64::scene::hand::{Hand, Held, stir};
use tumble_interface::{Data, Engine};

fn column(sim: &Simulation, object: &str, name: &str) -> Vec<f64> {
    match &sim.frame(&[name]).column(object, name).unwrap().data {
        Data::F64(v) => v.clone(),
        _ => panic!("{name} is not in double precision"),
    }
}

/// A held mass goes to the hand as a critically damped spring takes it there: x = d (1 - (1 + w t) exp(-w t)).
#[test]
fn a_held_mass_follows_its_spring_and_is_free_when_let_go() {
    let mut sim = simulation(
        "time.fps = 100\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"rk4\"\nsubsteps = 20\n\
         [[particles]]\nname = \"other\"\nposition = [[5, 0, 0]]\nmass = [3]\n[[particles]]\nname = \"p\"\nposition = [[0, 0, 0], [0, 1, 0]]\nmass = [1, 2]\n",
    );
    let mut hand = Hand::default();
    let (w, d): (f64, f64) = (3.0, 0.4);
    let (system, held) = Held::new(&mut sim, "p", 1, [d, 1.0, 0.0], Some(2.0 * w * w), &|| true).unwrap();
    assert!(hand.take(&system, held));
    sim.add_force(&system, hand.force(&system)).unwrap();
    for frame in 1..=60 {
        step(&mut sim);
        let (x, t) = (column(&sim, "p", "position"), f64::from(frame) / 100.0);
        let exact = d * (1.0 - (1.0 + w * t) * (-w * t).exp());
        assert!((x[3] - exact).abs() < 1e-9, "after {t} s: {} instead of {exact}", x[3]);
        assert_eq!((x[0], column(&sim, "other", "position")[0]), (0.0, 5.0), "others are pulled, too");
    }
    assert!(hand.drag("p", 1, [0.0, 1.0, 0.0]) && !hand.drag("p", 0, [0.0; 3]));
    hand.release();
    let v = column(&sim, "p", "velocity");
    step(&mut sim);
    assert_eq!(column(&sim, "p", "velocity"), v, "it is not free");
}

#[test]
fn what_cannot_be_held_or_stirred_says_so() {
    let mut sim = simulation(
        "[[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\n[[emitter]]\nname = \"e\"\nrate = 10\nlifetime = 1\nfrom.sphere.radius = 0.1\n",
    );
    for (object, row) in [("p", 1), ("e", 0), ("none", 0)] {
        let error = Held::new(&mut sim, object, row, [0.0; 3], None, &|| true).err().unwrap();
        assert!(error.to_string().contains(object), "{error}");
    }
    let error = stir(&mut sim, "p", [0.0; 3], [1.0, 0.0, 0.0], 0.1, 0.0).err().unwrap();
    assert!(error.to_string().contains("there is no such gas"), "{error}");
    assert!(stir(&mut sim, "p", [0.0; 3], [1.0, 0.0, 0.0], f64::NAN, 0.0).is_err());
}

/// A stir adds the Gaussian's integral, pi r^2 in a plane, of what it brings; in its middle the whole.
#[test]
fn a_stir_adds_a_gaussian() {
    let mut sim = simulation(
        "dimension = 2\n[[gas]]\nname = \"air\"\nbox = { size = [1, 1, 1], center = [0.5, 0, 0.5], resolution = 64 }\nsmoke = {}\n",
    );
    let r: f64 = 0.08;
    stir(&mut sim, "air", [0.5, 0.0, 0.5], [2.0, 0.0, -1.0], r, 3.0).unwrap();
    let whole = std::f64::consts::PI * r * r * 64.0 * 64.0;
    for (name, amount) in [("velocity_x", 2.0), ("velocity_z", -1.0), ("density", 3.0)] {
        let sum: f64 = column(&sim, "air", name).iter().sum();
        assert!((sum / (amount * whole) - 1.0).abs() < 1e-5, "{name}: {sum}, expected {}", amount * whole);
    }
    let u = column(&sim, "air", "velocity_x");
    let middle = u.iter().copied().fold(0.0, f64::max);
    let off: f64 = 0.5 / 64.0 / r;
    assert!((middle - 2.0 * (-off * off).exp()).abs() < 1e-12, "{middle}");
}
