//! Guides: hair from curves that were groomed elsewhere, how it is resampled, carried and at rest, and what it says of bad input.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, run, step, vector};
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};
use tumble_f64::scene::{Assets, Simulation};
use tumble_interface::{Curves, Engine, Scene};

const BALL: &str = "[[collider]]\nname = \"ball\"\nshape.sphere = { center = [0, 0, 1], radius = 0.1 }\n";
const GROOM: &str = "[[hair]]\nname = \"h\"\nguides.path = \"groom.obj\"\n";

fn build(text: &str, curves: Curves) -> Result<Simulation, String> {
    let text = format!("version = 1\nprecision = \"double\"\n{text}\n[[system]]\nmethod = \"position_based\"\n");
    let scene = Scene::from_toml(&text).map_err(|e| e.to_string())?;
    let assets = Assets::default().with_curves(HashMap::from([("groom.obj".to_string(), curves)]));
    Simulation::new(scene, assets).map_err(|e| e.to_string())
}

fn built(text: &str, curves: Curves) -> Simulation {
    build(text, curves).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Points of a curve at uneven steps of its parameter, which runs from 0 to 1.
fn curve(n: usize, at: impl Fn(f64) -> [f64; 3]) -> Vec<[f64; 3]> {
    (0..=n).map(|i| i as f64 / n as f64).map(|t| at(t * (1.0 + 0.5 * (1.0 - t)))).collect()
}

/// Curls that begin on the ball and go away from it.
fn curls(count: usize) -> Curves {
    let one = |k: usize| {
        let a = TAU * k as f64 / count as f64;
        let out = vector(a.cos(), a.sin(), 0.5).normalized();
        let side = out.cross(vector(0.0, 0.0, 1.0)).normalized();
        let up = side.cross(out);
        curve(400, |t| {
            let turn = 3.0 * TAU * t;
            let x =
                vector(0.0, 0.0, 1.0) + out * (0.1 + 0.08 * t) + side * (0.004 * turn.sin() * t) + up * (0.004 * (1.0 - turn.cos()) * t);
            x.into()
        })
    };
    (0..count).map(one).collect()
}

#[test]
fn curves_are_resampled_to_pieces_of_equal_length_along_them() {
    // Three quarters of a circle of 0.1 m, in a plane; scaled to 0.2 m, turned about x and moved.
    let (n, fine, angle) = (24, 3000, 1.5 * PI);
    let circle = |t: f64| [0.1 * (1.0 - (angle * t).cos()), 0.1 * (angle * t).sin(), 0.0];
    let place = "guides.scale = 2\nguides.rotate = [90, 0, 0]\nguides.translate = [1, 2, 3]\n";
    let sim = built(&format!("{GROOM}{place}segments = {n}\n"), vec![curve(fine, circle), vec![[0.0; 3], [0.0, 0.0, 0.1]]]);
    let x = positions(&sim, "h");
    assert_eq!(x.len(), 2 * (n + 1));
    let meant = |t: f64| {
        let [a, b, _] = circle(t);
        vector(1.0 + 2.0 * a, 2.0, 3.0 + 2.0 * b)
    };
    let off = (0..=n).map(|k| (x[k] - meant(k as f64 / n as f64)).norm()).fold(0.0, f64::max);
    // Chords of the curve given are off the circle by R (angle step)²/8, steps being 1.5 times the mean at most.
    let most = 0.2 * (1.5 * angle / fine as f64).powi(2) / 8.0;
    println!("resampled points are off the circle by {off:.1e} m, at most {most:.1e} m");
    assert!(off < 2.0 * most && off > 0.0, "{off:e} {most:e}");
    let chord = 0.4 * (0.5 * angle / n as f64).sin();
    assert!((1..=n).all(|k| ((x[k] - x[k - 1]).norm() / chord - 1.0).abs() < 1e-5));
    // A straight one of two points: z of the file is -y of the scene.
    for (k, p) in x[n + 1..].iter().enumerate() {
        assert!((*p - vector(1.0, 2.0 - 0.2 * k as f64 / n as f64, 3.0)).norm() < 1e-14, "{p:?}");
    }
}

#[test]
fn a_groom_is_at_rest_as_it_is() {
    let moved = |words: &str, gravity: f64| {
        let mut sim = built(&format!("world.gravity = [0, 0, {gravity}]\n{BALL}{GROOM}segments = 40\n{words}"), curls(12));
        let x = positions(&sim, "h");
        run(&mut sim, 12);
        assert!(sim.warnings().is_empty(), "{:?}", sim.warnings());
        positions(&sim, "h").iter().zip(&x).map(|(a, b)| (*a - *b).norm()).fold(0.0, f64::max)
    };
    for words in ["", "on = \"ball\"\n"] {
        let (still, hanging) = (moved(words, 0.0), moved(words, -9.81));
        println!("{words:?}: moved by {still:.1e} m, and by {hanging:.1e} m under gravity");
        assert!(still < 1e-9 && hanging > 1e-3, "{still:e} {hanging:e}");
    }
}

#[test]
fn roots_go_where_the_collider_goes_from_where_they_are() {
    // One root floats 1 mm above the ball: it stays there. The groom lies as on the collider before its motion.
    let mut curves = curls(8);
    curves[3].iter_mut().for_each(|x| x[2] += 0.001);
    let motion =
        "motion = { keys = [{ time = 0, translate = [0.2, 0, 0] }, { time = 0.4, translate = [0, 0.3, 0], rotate = [0, 0, 60] }] }\n";
    let mut sim = built(&format!("{BALL}{motion}{GROOM}on = \"ball\"\nsegments = 30\n"), curves.clone());
    assert!(sim.warnings().is_empty(), "{:?}", sim.warnings());
    let roots = |sim: &Simulation| positions(sim, "h").chunks(31).map(|c| c[0]).collect::<Vec<_>>();
    let own = |k: usize| Vector::from(curves[k][0]);
    for (k, root) in roots(&sim).iter().enumerate() {
        assert!((*root - own(k) - vector(0.2, 0.0, 0.0)).norm() < 1e-14);
    }
    for _ in 0..12 {
        step(&mut sim);
    }
    let (s, c) = 60.0_f64.to_radians().sin_cos();
    for (k, root) in roots(&sim).iter().enumerate() {
        let p = own(k);
        let place = vector(c * p.x - s * p.y, s * p.x + c * p.y + 0.3, p.z);
        assert!((*root - place).norm() < 1e-12, "{root:?} {place:?}");
    }
}

#[test]
fn what_becomes_of_a_groom_is_told() {
    let told = |words: &str, curves: Curves| {
        let sim = built(&format!("{BALL}thickness = 0.001\n{GROOM}on = \"ball\"\n{words}"), curves);
        sim.warnings().iter().map(|w| format!("[{}] {w}", w.code.name())).collect::<Vec<_>>()
    };
    assert!(told("segments = 40", curls(5)).is_empty());
    let mut far = curls(5);
    far[1].iter_mut().for_each(|x| x[2] += 0.05);
    far[3].iter_mut().for_each(|x| x[2] += 0.3);
    let found = told("segments = 40", far);
    assert_eq!(found.len(), 1, "{found:?}");
    let start = "[far-roots] hair \"h\".guides: 2 of 5 roots are off the surface by more than 5% of their strands, that of curve 4, at [";
    assert!(found[0].starts_with(start) && found[0].contains("], by 0.256"), "{found:?}");
    // Curls of 4 mm lose their turns in six pieces.
    let found = told("segments = 6", curls(5));
    assert!(found.len() == 1 && found[0].starts_with("[coarse-guides] hair \"h\".segments: 5 of 5 curves"), "{found:?}");
    // Through the ball.
    let found = told("segments = 20", vec![vec![[0.1, 0.0, 1.0], [-0.05, 0.0, 1.05]]]);
    assert!(found.len() == 1 && found[0].starts_with("[combed-guides] hair \"h\".guides: 1 of 1 strands"), "{found:?}");
}

#[test]
fn bad_guides_are_refused_with_their_place() {
    let straight = || vec![vec![[0.0; 3], [0.0, 0.0, 0.1]]];
    for (words, curves, expected) in [
        (
            "guides.scale = 1e-9",
            straight(),
            "hair \"h\".guides.path: curve 1 of \"groom.obj\" is 1.000e-10 m long, expected 1e-6 to 1000 m",
        ),
        ("guides.scale = 1e300", straight(), "m long, expected 1e-6 to 1000 m; set guides.scale"),
        ("segments = 1", vec![vec![[0.0; 3], [0.0, 0.0, 0.1], [0.0; 3]]], "hair \"h\".segments: curve 1 of \"groom.obj\" folds back"),
        ("on = \"bald\"", straight(), "there is no collider \"bald\""),
        ("on = \"ball\"\nmesh.path = \"groom.obj\"", straight(), "either the name of a collider, or a mesh"),
        ("bone = \"head\"", straight(), "hair \"h\".bone: "),
        ("on = \"ball\"\nbone = \"head\"", straight(), "has no bones"),
        ("segments = 10000", vec![straight()[0].clone(); 10_001], "10001 curves of 10000 segments"),
    ] {
        let told = build(&format!("world.memory_limit = 1e6\n{BALL}{GROOM}{words}"), curves).map(drop).unwrap_err();
        assert!(told.contains(expected), "{words}: {told}");
    }
    let told = build(
        &format!(
            "{GROOM}count = 3\nper_area = 2\nabove = 0\nlength = 1\nspread = 0.1\nlean = [0, 0, 1]\ncurl.radius = 0.1\nclump.count = 1\n"
        ),
        straight(),
    )
    .map(drop)
    .unwrap_err();
    for key in ["count", "per_area", "above", "length", "spread", "lean", "curl", "clump"] {
        let line = format!("hair \"h\".{key}: strands are as their guides say; leave out {key}, or guides");
        assert!(told.contains(&line), "{line}\n{told}");
    }
    let told = build(&format!("{BALL}[[hair]]\nname = \"h\"\non = \"ball\"\n"), straight()).map(drop).unwrap_err();
    assert!(told.contains("either a count of strands or per_area") && told.contains("hair \"h\".length: missing"), "{told}");
}
