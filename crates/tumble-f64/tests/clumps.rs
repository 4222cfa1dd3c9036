//! Clumps, rigid unions of spheres, against closed forms. See docs/theory/grains.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::{common, granular};

use common::{Vector, column, positions, run, simulation, velocities};
use std::f64::consts::PI;
use tumble_f64::math::rotation;
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Engine, Scene};

const R: f64 = 0.05;
const DENSITY: f64 = 2500.0;

/// A scene of grains; frames last 1/100 s.
fn scene(gravity: f64, system: &str, words: &str) -> Simulation {
    simulation(&format!("time.fps = 100\nworld.gravity = [0, 0, -{gravity}]\n[[system]]\nmethod = \"grains\"\n{system}\n{words}"))
}

fn clumps(words: &str) -> String {
    format!("[[grains]]\nname = \"clumps\"\n{words}\n")
}

fn ball() -> f64 {
    4.0 / 3.0 * PI * DENSITY * R.powi(3)
}

fn momenta(sim: &Simulation) -> [Vector; 2] {
    let ledger = sim.ledger();
    [ledger.momentum.into(), ledger.angular_momentum.unwrap().into()]
}

/// Angular momentum about an axis at one turn a second [kg m²].
fn inertia(clump: &str, axis: [f64; 3]) -> [f64; 2] {
    let words = format!("radius = {R}\nclump = {clump}\nposition = [[0, 0, 0]]\nangular_velocity = [{axis:?}]");
    let ledger = scene(0.0, "", &clumps(&words)).ledger();
    let spin = Vector::from(ledger.angular_momentum.unwrap());
    assert!((2.0 * ledger.kinetic - spin.norm()).abs() < 1e-12);
    [ledger.mass, spin.norm()]
}

#[test]
fn clumps_have_the_mass_and_inertia_of_their_union() {
    let m = ball();
    let near = |[a, b]: [f64; 2], [c, d]: [f64; 2], tolerance: f64| (a - c).abs() < tolerance * c && (b - d).abs() < tolerance * d;
    let dumbbell = |axis| inertia("\"dumbbell\"", axis);
    assert!(near(dumbbell([1.0, 0.0, 0.0]), [2.0 * m, 0.8 * m * R * R], 1e-12));
    assert!(near(dumbbell([0.0, 0.6, 0.8]), [2.0 * m, 2.8 * m * R * R], 1e-12));
    for axis in [[1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [0.48, 0.64, 0.6]] {
        assert!(near(inertia("\"tetrahedron\"", axis), [4.0 * m, 5.6 * m * R * R], 1e-12), "{axis:?}");
    }
    // Two spheres with a lens in common, by the integral along their line, here across all axes of the words.
    let half = 0.6_f64;
    let integral = |f: &dyn Fn(f64) -> f64| {
        let n = 20_000;
        (0..n).map(|i| (1.0 + half) * (f64::from(i) + 0.5) / f64::from(n)).map(f).sum::<f64>() * 2.0 * (1.0 + half) / f64::from(n)
    };
    let section = |x: f64| 1.0 - (x - half).powi(2);
    let volume = PI * integral(&section);
    let along = PI / 2.0 * integral(&|x| section(x).powi(2));
    let across = 0.5 * along + PI * integral(&|x| section(x) * x * x);
    let clump = "{ spheres = [[1.36, 0, 0, 1], [0.64, 0.96, 0, 1]] }";
    let scale = [DENSITY * R.powi(3), DENSITY * R.powi(5)];
    for (axis, exact) in [([-0.6, 0.8, 0.0], along), ([0.8, 0.6, 0.0], across), ([0.0, 0.0, 1.0], across)] {
        let found = inertia(clump, axis);
        assert!(near(found, [volume * scale[0], exact * scale[1]], 2e-4), "{axis:?}: {found:?}, {}", exact * scale[1]);
    }
    assert!((volume - (8.0 / 3.0 * PI - PI * (4.0 + 1.2) * 0.64 / 12.0)).abs() < 1e-6);
}

#[test]
fn a_free_dumbbell_precesses_as_a_symmetric_top() {
    // Its axis goes about the angular momentum at L/I.
    let w = Vector { x: 9.0, y: 0.0, z: 4.0 };
    let words = format!("radius = {R}\nclump = \"dumbbell\"\nposition = [[0, 0, 0]]\nangular_velocity = [[{}, 0, {}]]", w.x, w.z);
    let after = |substeps: u32| {
        let mut sim = scene(0.0, &format!("substeps = {substeps}"), &clumps(&words));
        let before = momenta(&sim)[1];
        run(&mut sim, 50);
        assert!((momenta(&sim)[1] - before).norm() < 1e-14 * before.norm().max(1.0));
        positions(&sim, "clumps")
    };
    let spin = Vector { x: 0.8 * w.x, y: 0.0, z: 2.8 * w.z };
    let turn = rotation::by(spin * (0.5 / 2.8));
    let exact = turn.turn(Vector { x: R, y: 0.0, z: 0.0 });
    let error = |substeps: u32| {
        let found = after(substeps);
        assert!((found[0] + found[1]).norm() < 1e-12, "{found:?}");
        (found[1] - exact).norm() / R
    };
    let errors = [1, 2, 4].map(error);
    let order = (errors[0] / errors[2]).log2() / 2.0;
    assert!((exact - Vector { x: R, y: 0.0, z: 0.0 }).norm() > R, "{exact:?}");
    assert!(errors[2] < 1e-3 && (order - 2.0).abs() < 0.2, "{errors:?}, order {order}");
}

/// Clumps that fly into each other, spinning.
fn crowd(words: &str, system: &str) -> Simulation {
    let mut random = common::Numbers(11);
    let mut places = Vec::new();
    while places.len() < 60 {
        let p = random.vector() * 0.7;
        if places.iter().all(|q: &Vector| (*q - p).norm() > 0.23) {
            places.push(p);
        }
    }
    let v: Vec<Vector> = places.iter().map(|p| *p * -2.0 + random.vector()).collect();
    let w: Vec<Vector> = places.iter().map(|_| random.vector() * 20.0).collect();
    let turns: Vec<Vector> = places.iter().map(|_| random.vector() * 180.0).collect();
    let at = [("position", &places), ("velocity", &v), ("angular_velocity", &w), ("rotate", &turns)]
        .map(|(key, list)| format!("{key} = {}\n", common::list(list)));
    scene(0.0, system, &clumps(&format!("radius = {R}\n{}{words}", at.concat())))
}

#[test]
fn clumps_that_collide_keep_momentum_and_angular_momentum_and_stay_rigid() {
    let words = "clump = { spheres = [[0, 0, 0, 1], [1.1, 0.2, 0, 0.8], [0.1, 1, 0.3, 0.6]] }\nfriction = 0.5\nrolling_friction = 0.1\nrestitution = 0.4\nradius_spread = 0.04\ncohesion = 2";
    let mut sim = crowd(words, "");
    let (before, energy) = (momenta(&sim), sim.ledger().kinetic);
    let distances = |sim: &Simulation| -> Vec<f64> {
        positions(sim, "clumps").chunks_exact(3).flat_map(|x| [(x[1] - x[0]).norm(), (x[2] - x[1]).norm()]).collect()
    };
    let apart = distances(&sim);
    run(&mut sim, 40);
    let (after, left) = (momenta(&sim), sim.ledger().kinetic);
    assert!(left < 0.6 * energy, "{left} of {energy}");
    let scale = sim.ledger().mass * 2.0;
    for (a, b) in before.into_iter().zip(after) {
        assert!((a - b).norm() < 1e-12 * scale && a.norm() > 1e-4 * scale, "{a:?} {b:?}, {scale}");
    }
    assert!(apart.iter().zip(distances(&sim)).all(|(a, b)| (a - b).abs() < 1e-13));
}

#[test]
fn elastic_clumps_keep_their_energy_to_second_order() {
    let lost = |step: f64| {
        let mut sim = crowd("clump = \"tetrahedron\"\nfriction = 0\nrestitution = 1", &format!("step = {step}"));
        let before = sim.ledger().energy();
        let mut off = 0.0_f64;
        for _ in 0..20 {
            common::step(&mut sim);
            off = off.max((sim.ledger().energy() / before - 1.0).abs());
        }
        off
    };
    let errors = [8e-5, 2e-5].map(lost);
    let order = (errors[0] / errors[1]).log2() / 2.0;
    assert!(errors[1] < 1e-4 && errors[1] > 1e-9 && order > 1.6, "{errors:?}, order {order}");
}

#[test]
fn a_dumbbell_falls_over_in_the_time_that_its_inertia_says() {
    // On a floor without friction its centre falls straight: z'' and the tilt follow from energy, I θ'²/2 + m (R sin θ θ')²/2 = m g R (1 - cos θ) from upright.
    let words = format!(
        "radius = {R}\nclump = \"dumbbell\"\nposition = [[0, 0, {}]]\nrotate = [[0, {}, 0]]\nfriction = 0\nrestitution = 0.5\nyoung = 1e8",
        R * (1.0 + 0.3_f64.cos()),
        90.0 - 0.3_f64.to_degrees()
    );
    let floor = "[[collider]]\nname = \"floor\"\nshape = { floor = {} }\nfriction = 0\nrestitution = 0\n";
    let mut sim = scene(9.81, "", &(clumps(&words) + floor));
    let tilt = |sim: &Simulation| {
        let x = positions(sim, "clumps");
        let way = x[1] - x[0];
        (way.z.abs() / way.norm()).acos()
    };
    run(&mut sim, 12);
    // The time to the tilt by quadrature.
    let rate = |theta: f64| (2.0 * 2.0 * 9.81 * R * (0.3_f64.cos() - theta.cos()) / (2.8 * R * R + 2.0 * (R * theta.sin()).powi(2))).sqrt();
    let end = tilt(&sim);
    let n = 200_000;
    // In √(θ - θ0), where the rate has no pole.
    let root = (end - 0.3).sqrt();
    let time: f64 =
        (0..n).map(|i| root * (f64::from(i) + 0.5) / f64::from(n)).map(|s| 2.0 * s / rate(0.3 + s * s)).sum::<f64>() * root / f64::from(n);
    assert!((time - 0.12).abs() < 1e-3 && end > 0.5 && end < 1.5, "{time} s to {end}");
}

#[test]
#[ignore = "long: make validate"]
fn heaps_of_clumps_are_steeper_than_those_of_spheres() {
    let slope = |clump: &str, count: usize| granular::slope(granular::FORCES, &format!("{clump}\nfriction = 0.4"), count);
    let spheres = slope("", 800);
    let [dumbbells, tetrahedra] =
        [("dumbbell", 400), ("tetrahedron", 200)].map(|(clump, count)| slope(&format!("clump = \"{clump}\""), count));
    // Balls roll apart.
    assert!(
        spheres.abs() < 0.05 && dumbbells > 0.15 && tetrahedra > 1.1 * dumbbells && tetrahedra < 0.6,
        "{spheres} {dumbbells} {tetrahedra}"
    );
}

#[test]
fn threads_and_snapshots_change_no_bit_of_clumps() {
    let build = || {
        let words = "radius = 0.01\nclump = \"tetrahedron\"\nradius_spread = 0.1\nfill = [{ center = [0, 0, 0.25], size = [0.4, 0.4, 0.45] }]\nrolling_friction = 0.05\nyoung = 1e6";
        let more = "[[grains]]\nname = \"balls\"\nradius = 0.012\nposition = [[0, 0, 0.6], [0.1, 0, 0.6]]\n[[collider]]\nname = \"floor\"\nshape = { floor = {} }\n";
        scene(9.81, "step = 2e-4", &(clumps(words) + more))
    };
    let after = |threads: usize, cut: bool| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut sim = build();
            run(&mut sim, 6);
            if cut {
                let kept = sim.save(&[]);
                sim = build();
                sim.restore(&kept).unwrap();
            }
            run(&mut sim, 6);
            [positions(&sim, "clumps"), velocities(&sim, "clumps"), column(&sim, "clumps", "angular_velocity"), positions(&sim, "balls")]
                .concat()
        })
    };
    let plain = after(1, false);
    assert!(plain.len() > 3000 && plain.iter().all(|v| v.norm().is_finite()));
    assert!(plain == after(3, false), "threads");
    assert!(plain == after(2, true), "a snapshot");
}

#[test]
fn clumps_that_overlap_at_the_start_part_as_a_whole() {
    let words = format!(
        "radius = {R}\nclump = \"dumbbell\"\nposition = [[0, 0, 0.06], [0.02, 0.04, 0.08], [0, 0, 0.3]]\nrotate = [[0, 0, 0], [0, 30, 90], [0, 0, 0]]"
    );
    let floor = "[[collider]]\nname = \"floor\"\nshape = { floor = {} }\n";
    let mut sim = scene(0.0, "", &(clumps(&words) + floor));
    assert!(sim.warnings().iter().any(|w| w.code.name() == "starts-inside"));
    let x = positions(&sim, "clumps");
    assert!(x.chunks_exact(2).all(|pair| ((pair[1] - pair[0]).norm() - 2.0 * R).abs() < 1e-14), "{x:?}");
    let apart = x[..2].iter().flat_map(|a| x[2..].iter().map(|b| (*a - *b).norm())).fold(f64::INFINITY, f64::min);
    assert!(apart > 1.98 * R && apart < 2.02 * R && x.iter().all(|p| p.z > 0.98 * R), "{apart} {x:?}");
    run(&mut sim, 10);
    assert!(velocities(&sim, "clumps").iter().all(|v| v.norm() < 0.2));
}

#[test]
fn what_is_wrong_with_clumps_is_told_with_its_place() {
    let wrong = |words: &str| -> Vec<String> {
        let scene =
            Scene::from_toml(&format!("version = 1\n{}", clumps(&format!("radius = 0.01\nposition = [[0, 0, 1]]\n{words}")))).unwrap();
        let issues = Simulation::new(scene, Assets::default()).err().map(|error| error.issues).unwrap_or_default();
        issues.into_iter().map(|issue| format!("{}: {}", issue.path, issue.message)).collect()
    };
    for (words, path, cure) in [
        ("clump = { spheres = [] }", "grains \"clumps\".clump.spheres", "give"),
        ("clump = { spheres = [[0, 0, 0, 1], [1, 0, 0, 0]] }", "grains \"clumps\".clump.spheres[1]", "expected > 0"),
        ("clump = { spheres = [[0, 0, 0, 1], [3, 0, 0, 1]] }", "grains \"clumps\".clump.spheres[1]", "between"),
        ("rotate = [[0, 0, 30]]", "grains \"clumps\".rotate", "leave it out"),
        ("clump = \"dumbbell\"\nrotate = [[0, 0, 30], [0, 0, 0]]", "grains \"clumps\".rotate", "expected"),
    ] {
        let told = wrong(words);
        assert!(told.len() == 1 && told[0].starts_with(path) && told[0].contains(cure), "{words}: {told:?}");
    }
    assert!(wrong("clump = \"dumbbell\"\nrotate = [[0, 0, 30]]").is_empty());
}
