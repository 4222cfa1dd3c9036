//! Hair: how it is planted and carried, what it does to itself, and what it says of bad input.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, run, simulation, step, vector, velocities};
use std::collections::HashMap;
use tumble_f64::scene::{Assets, Simulation};
use tumble_interface::{Engine, Mesh, Scene};

const BALL: &str = "precision = \"double\"\n[[system]]\nmethod = \"position_based\"\n[[collider]]\nname = \"ball\"\nshape.sphere = { center = [0, 0, 1], radius = 0.1 }\n";

fn roots(x: &[Vector], points: usize) -> Vec<Vector> {
    x.chunks(points).map(|c| c[0]).collect()
}

#[test]
fn strands_are_planted_evenly_and_as_long_as_said() {
    let sim =
        simulation(&format!("{BALL}[[hair]]\nname = \"h\"\non = \"ball\"\nper_area = 8000\nlength = 0.05\nspread = 0.4\nsegments = 5\n"));
    let x = positions(&sim, "h");
    let n = x.len() / 6;
    // 4 pi 0.1² 8000 = 1005, less what the ball of triangles lacks.
    assert!((n as f64 - 1005.0).abs() < 20.0, "{n}");
    let lengths: Vec<f64> = x.chunks(6).map(|c| c.windows(2).map(|p| (p[1] - p[0]).norm()).sum()).collect();
    let mean = lengths.iter().sum::<f64>() / n as f64;
    println!("{n} strands, mean length {mean:.4} m, expected 0.0400");
    assert!((mean - 0.04).abs() < 5e-4 && lengths.iter().all(|l| (0.0299..0.0501).contains(l)));
    // Half of them on each half, within three standard deviations; all grow outwards.
    let above = roots(&x, 6).iter().filter(|r| r.z > 1.0).count() as f64 / n as f64;
    assert!((above - 0.5).abs() < 3.0 * 0.5 / (n as f64).sqrt(), "{above}");
    for c in x.chunks(6) {
        let out = (c[0] - vector(0.0, 0.0, 1.0)).normalized();
        assert!((c[5] - c[0]).normalized().dot(out) > 0.99);
    }
}

/// The first roots of any number, centres of clumps among them, keep apart; and above a height.
#[test]
fn roots_are_in_blue_noise() {
    for above in ["", "above = 1.02\n"] {
        let sim = simulation(&format!("{BALL}[[hair]]\nname = \"h\"\non = \"ball\"\ncount = 1000\nlength = 0.01\nsegments = 1\n{above}"));
        let roots = roots(&positions(&sim, "h"), 2);
        assert_eq!(roots.len(), 1000);
        assert!(above.is_empty() || roots.iter().all(|x| x.z > 1.02));
        // Zones of a ball have the area 2 pi R h.
        let area = std::f64::consts::TAU * 0.1 * if above.is_empty() { 0.2 } else { 0.08 };
        for (n, least) in [(1000, 0.6), (250, 0.5), (30, 0.5)] {
            let lattice = (2.0 / 3.0_f64.sqrt() * area / n as f64).sqrt();
            let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
            let closest = pairs.map(|(i, j)| (roots[i] - roots[j]).norm()).fold(f64::INFINITY, f64::min) / lattice;
            // Of as many at random the closest are at 0.01 to 0.05 of it; a lattice has 1.
            println!("{above:?}: the closest of the first {n} roots are at {closest:.3} of the distance in a lattice");
            assert!(closest > least && closest < 1.0, "{n}: {closest}");
        }
    }
}

#[test]
fn groomed_hair_is_at_rest() {
    // Curled, leaning and in clumps, without gravity: nothing moves, and nothing is stored.
    let mut sim = simulation(&format!(
        "world.gravity = [0, 0, 0]\n{BALL}[[hair]]\nname = \"h\"\non = \"ball\"\ncount = 40\nlength = 0.1\nsegments = 20\nlean = [1.5, 0, 0.7]\ncurl = {{ radius = 0.002, pitch = 0.03 }}\nclump = {{ count = 20, strength = 0.7 }}\n"
    ));
    let x = positions(&sim, "h");
    run(&mut sim, 12);
    let off = positions(&sim, "h").iter().zip(&x).map(|(a, b)| (*a - *b).norm()).fold(0.0, f64::max);
    println!("moved by {off:.1e} m");
    assert!(off < 1e-9, "{off:e}");
    // Strands that go apart from a ball of 0.1 m have tips twice as far apart as roots, but for the clumps. Measured: 1.07.
    let mean = |k: usize| {
        let at: Vec<Vector> = x.chunks(21).map(|c| c[k]).collect();
        at[20..].iter().map(|p| at[..20].iter().map(|q| (*p - *q).norm()).fold(f64::INFINITY, f64::min)).sum::<f64>()
    };
    assert!(mean(20) < 1.3 * mean(0), "{} {}", mean(20), mean(0));
    // A spiral of that radius and pitch: the circle of curvature has R (1 + (pitch/2 pi R)²).
    let curl = simulation(&format!(
        "{BALL}[[hair]]\nname = \"h\"\non = \"ball\"\ncount = 1\nlength = 0.2\nsegments = 400\ncurl = {{ radius = 0.01, pitch = 0.02 }}\n"
    ));
    let x = positions(&curl, "h");
    let (a, b) = (x[101] - x[100], x[102] - x[101]);
    let radius = a.norm() / a.cross(b).norm() * a.norm() * b.norm();
    let exact = 0.01 * (1.0 + (0.02 / (std::f64::consts::TAU * 0.01)).powi(2));
    assert!((radius / exact - 1.0).abs() < 1e-3, "{radius} {exact}");
}

/// However different a strand and the middle of its clump are: the shape at rest has no fold.
#[test]
fn strands_of_a_clump_have_no_folds() {
    let sim = simulation(&format!(
        "{BALL}[[hair]]\nname = \"h\"\non = \"ball\"\ncount = 400\nlength = 0.1\nspread = 0.45\nsegments = 12\nlean = [0, 0, -0.6]\n\
         clump = {{ count = 100, strength = 0.3 }}\n"
    ));
    let cosine = |p: &[Vector]| (p[1] - p[0]).normalized().dot((p[2] - p[1]).normalized());
    let sharpest = positions(&sim, "h").chunks(13).flat_map(|c| c.windows(3).map(cosine).collect::<Vec<_>>()).fold(1.0, f64::min);
    println!("sharpest bend {:.0} degrees", sharpest.acos().to_degrees());
    assert!(sharpest > 0.5, "{sharpest}");
}

#[test]
fn roots_go_where_the_collider_goes() {
    let motion = "motion = { spin = [0, 2, 0], pivot = [0, 0, 1], keys = [{ time = 0, translate = [0.2, 0, 0] }, { time = 0.4, translate = [0, 0.3, 0], rotate = [0, 0, 60] }] }\n";
    let mut sim = simulation(&format!("{BALL}{motion}[[hair]]\nname = \"h\"\non = \"ball\"\ncount = 20\nlength = 0.05\nsegments = 6\n"));
    let first = roots(&positions(&sim, "h"), 7);
    let start = |p: Vector| p - vector(0.2, 0.0, 1.0);
    for _ in 0..12 {
        step(&mut sim);
    }
    // At 0.5 s: the keys have ended, and the spin has turned by 1 rad about y after them.
    let (turned, (s, c)) = (60.0_f64.to_radians(), 1.0_f64.sin_cos());
    let place = |p: Vector| {
        let q = vector(turned.cos() * p.x - turned.sin() * p.y, turned.sin() * p.x + turned.cos() * p.y, p.z);
        vector(c * q.x + s * q.z, q.y, c * q.z - s * q.x) + vector(0.0, 0.3, 1.0)
    };
    let (x, v) = (positions(&sim, "h"), velocities(&sim, "h"));
    for (i, (root, was)) in roots(&x, 7).iter().zip(&first).enumerate() {
        let place = place(start(*was));
        assert!((*root - place).norm() < 1e-12, "{root:?} {place:?}");
        // The surface's velocity: 2 rad/s about y through (0, 0.3, 1); a difference over one sub-step of 1/1008 s.
        let surface = vector(0.0, 2.0, 0.0).cross(*root - vector(0.0, 0.3, 1.0));
        assert!((v[7 * i] - surface).norm() < 1e-3 && surface.norm() > 1e-3);
        // Strands are clamped: their first piece still points outwards.
        let out = (*root - vector(0.0, 0.3, 1.0)).normalized();
        assert!((x[7 * i + 1] - *root).normalized().dot(out) > 0.97);
    }
}

/// Roots are in the body, by as much as it is thick: they are held, and nothing pushes them out.
#[test]
fn roots_are_no_penetration() {
    for motion in ["", "motion.velocity = [0.1, 0, 0]\n"] {
        let mut sim = simulation(&format!(
            "{BALL}thickness = 0.003\n{motion}[[hair]]\nname = \"h\"\non = \"ball\"\ncount = 20\nlength = 0.05\nsegments = 6\n"
        ));
        let books = sim.ledger();
        assert!(
            books.penetration.unwrap() == 0.0 && books.contacts.unwrap() == 0,
            "{} {}",
            books.penetration.unwrap(),
            books.contacts.unwrap()
        );
        run(&mut sim, 2);
        // Hair that touches the ball is moved out of it at the end of each sub-step.
        assert!(sim.ledger().penetration.unwrap() < 1e-6, "{}", sim.ledger().penetration.unwrap());
        let x: Vec<Vector> = positions(&sim, "h").iter().map(|x| vector(x.x, x.y, x.z - 0.05)).collect();
        common::write(&mut sim, "h", "position", &x);
        assert!(sim.ledger().penetration.unwrap() > 0.01 && sim.ledger().contacts.unwrap() > 0);
    }
}

/// Strands of almost no stiffness hold nothing, so that nothing but the hair itself acts.
#[test]
fn hair_keeps_its_momentum_among_itself() {
    let total = |collisions: &str| {
        // On a plate that is no collider.
        let plate = Mesh {
            vertices: vec![[0.0; 3], [0.2, 0.0, 0.0], [0.2, 0.2, 0.0], [0.0, 0.2, 0.0]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        };
        let scene = format!(
            "version = 1\nprecision = \"double\"\nworld.gravity = [0, 0, 0]\n[[system]]\nmethod = \"position_based\"\n\
             [[hair]]\nname = \"h\"\nmesh.path = \"plate\"\ncount = 300\nlength = 0.1\nsegments = 10\nyoung = 1e-9\n{collisions}\n"
        );
        let assets = Assets::new(HashMap::from([("plate".to_string(), plate)]), HashMap::new());
        let mut sim = Simulation::new(Scene::from_toml(&scene).unwrap(), assets).unwrap();
        let mut numbers = common::Numbers(3);
        let v: Vec<Vector> = positions(&sim, "h").iter().map(|x| numbers.vector() * 0.2 + vector(0.3, 0.0, x.x)).collect();
        common::write(&mut sim, "h", "velocity", &v);
        let before = sim.ledger();
        step(&mut sim);
        let after = sim.ledger();
        let (p, q) = (Vector::from(before.momentum), Vector::from(after.momentum));
        ((q - p).norm() / p.norm(), after.kinetic / before.kinetic)
    };
    let (lost, kinetic) = total("");
    assert!(lost < 1e-6 && (kinetic - 1.0).abs() < 1e-6, "{lost:e} {kinetic}");
    let (lost, kinetic) = total("collisions = { cell = 0.03, friction = 20 }");
    println!("friction: momentum off by {lost:.1e}, kinetic energy times {kinetic:.4}");
    assert!(lost < 1e-6 && kinetic < 0.98, "{lost:e} {kinetic}");
    let (lost, kinetic) = total("collisions = { cell = 0.03, pressure = 2e-3, rest_density = 0.01 }");
    println!("pressure: momentum off by {lost:.1e}, kinetic energy times {kinetic:.4}");
    assert!(lost < 1e-6 && kinetic > 1.001, "{lost:e} {kinetic}");
}

/// Drag in proportion to mass is drag per length: the tip in the wind does not depend on how finely a strand is divided.
#[test]
fn wind_acts_per_length() {
    let tip = |segments: u32| {
        let mut sim = simulation(&format!(
            "{BALL}[[force]]\nkind = \"wind\"\nair = [{{ kind = \"uniform\", velocity = [3, 0, 0] }}]\nrate = 8\n[[hair]]\nname = \"h\"\non = \"ball\"\ncount = 4\nlength = 0.1\nsegments = {segments}\nradius = 1e-4\n"
        ));
        run(&mut sim, 48);
        let x = positions(&sim, "h");
        (0..4).map(|k| x[(k + 1) * (segments as usize + 1) - 1]).collect::<Vec<_>>()
    };
    let (coarse, fine) = (tip(12), tip(36));
    for (a, b) in coarse.iter().zip(&fine) {
        println!("tips {:.1} mm apart", 1000.0 * (*a - *b).norm());
        assert!((*a - *b).norm() < 2e-3, "{a:?} {b:?}");
    }
}

#[test]
fn bad_hair_is_refused_with_its_place() {
    let issue = |words: &str| {
        let text = format!(
            "version = 1\n{BALL}[[collider]]\nname = \"floor\"\nshape.floor = {{}}\n[[collider]]\nname = \"bowl\"\ninside = true\n\
             shape.sphere.radius = 1\n[[collider]]\nname = \"dancer\"\nshape.mannequin = {{}}\n[[hair]]\nname = \"h\"\n{words}\n"
        );
        match Scene::from_toml(&text) {
            Err(e) => e.to_string(),
            Ok(scene) => Simulation::new(scene, Default::default()).map(|_| ()).unwrap_err().to_string(),
        }
    };
    for (words, expected) in [
        ("on = \"ball\"\ncount = 3\nlength = 0", "length"),
        ("on = \"ball\"\ncount = 0\nlength = 0.1", "count"),
        ("on = \"bald\"\ncount = 3\nlength = 0.1", "there is no collider \"bald\""),
        ("on = \"floor\"\ncount = 3\nlength = 0.1", "has no end"),
        ("on = \"bowl\"\ncount = 3\nlength = 0.1", "is a container"),
        ("on = \"dancer\"\nbone = \"tail\"\ncount = 3\nlength = 0.1", "has no bone \"tail\"; known are hips, "),
        ("on = \"ball\"\nbone = \"head\"\ncount = 3\nlength = 0.1", "has no bones"),
        ("on = \"ball\"\ncount = 3\nlength = 1e30", "length"),
        ("on = \"ball\"\nlength = 0.1", "either a count of strands or per_area"),
        ("on = \"ball\"\ncount = 3\nper_area = 4\nlength = 0.1", "either a count of strands or per_area"),
        ("count = 3\nlength = 0.1", "either the name of a collider, or a mesh"),
        ("on = \"ball\"\nper_area = 1e-9\nlength = 0.1", "0 strands"),
        ("on = \"ball\"\ncount = 3\nabove = 9\nlength = 0.1", "above this height"),
        ("on = \"ball\"\ncount = 3\nlength = 1\nsegments = 4\ncurl.radius = 0.01", "in its curl"),
        ("on = \"ball\"\ncount = 10000000\nsegments = 10000\nlength = 1", "GiB"),
    ] {
        let told = issue(words);
        assert!(told.contains(expected), "{words}: {told}");
    }
    let adaptive = format!("version = 1\n{}[[hair]]\nname = \"h\"\non = \"ball\"\ncount = 3\nlength = 0.1\ncollisions.cell = 0.1\n", BALL)
        .replace("method = \"position_based\"", "integrator = \"dormand_prince\"");
    let told = Simulation::new(Scene::from_toml(&adaptive).unwrap(), Default::default()).map(|_| ()).unwrap_err().to_string();
    assert!(told.contains("steps of equal length"), "{told}");
}
