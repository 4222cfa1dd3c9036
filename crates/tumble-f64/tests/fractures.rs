//! Rigid bodies that break, against statics and laws of conservation. See docs/theory/fracture.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, column, run, simulation, step};
use tumble_f64::math::Quat;
use tumble_f64::scene::Simulation;
use tumble_interface::{Data, Engine, Scene};

const G: f64 = 9.81;

/// A body of pieces; frames last 1/50 s and have ten sub-steps.
fn scene(gravity: f64, words: &str) -> Simulation {
    simulation(&format!(
        "time.fps = 50\nworld.gravity = [0, 0, {}]\n[[system]]\nmethod = \"rigid\"\nsubsteps = 10\n[[body]]\nname = \"b\"\n{words}\n",
        -gravity
    ))
}

fn numbers(data: &Data) -> Vec<f64> {
    data.numbers().into_iter().collect()
}

/// Masses of the pieces [kg].
fn masses(sim: &Simulation) -> Vec<f64> {
    let topology = sim.topology();
    topology.iter().filter(|c| c.object.starts_with("b.") && c.name == "mass").map(|c| numbers(&c.data)[0]).collect()
}

fn turn(sim: &Simulation, object: &str) -> Quat<f64> {
    let q = numbers(&sim.frame(&[]).column(object, "turn").unwrap().data);
    Quat::from_row([q[0], q[1], q[2], q[3]])
}

/// Volume, first and second moments about the origin of the pieces where they are.
fn moments(sim: &Simulation, pieces: usize) -> (f64, Vector, [f64; 6]) {
    let topology = sim.topology();
    let (mut volume, mut first, mut second) = (0.0, Vector::default(), [0.0; 6]);
    for k in 1..=pieces {
        let name = format!("b.{k}");
        let find = |column: &str| numbers(&topology.iter().find(|c| c.object == name && c.name == column).unwrap().data);
        let (x, q) = (column(sim, &name, "position")[0], turn(sim, &name));
        let points: Vec<Vector> = find("vertices").chunks(3).map(|p| x + q.turn(Vector::from([p[0], p[1], p[2]]))).collect();
        for t in find("triangles").chunks(3) {
            let [a, b, c] = [0, 1, 2].map(|i| points[t[i] as usize]);
            let v = a.dot(b.cross(c)) / 6.0;
            volume += v;
            first = first + (a + b + c) * (v / 4.0);
            for p in [a, b, c, a + b + c] {
                let squares = [p.x * p.x, p.y * p.y, p.z * p.z, p.x * p.y, p.y * p.z, p.z * p.x];
                (0..6).for_each(|i| second[i] += squares[i] * v / 20.0);
            }
        }
    }
    (volume, first, second)
}

#[test]
fn pieces_fill_the_body_and_weigh_what_it_weighs() {
    for (pieces, more) in [(7, ""), (40, ", seed = 3"), (25, ", around = [0.1, 0.05, 0.2]")] {
        let words = format!(
            "shape = {{ box = {{ size = [0.4, 0.6, 1] }} }}\nposition = [[0.3, -0.2, 0.5]]\ndensity = 800\nfracture = {{ pieces = {pieces}, strength = 1e9{more} }}"
        );
        let sim = scene(0.0, &words);
        let (volume, first, second) = moments(&sim, pieces);
        assert!((volume / 0.24 - 1.0).abs() < 1e-12, "{volume}");
        let center = first * (1.0 / volume);
        assert!((center - Vector::from([0.3, -0.2, 0.5])).norm() < 1e-12, "{center:?}");
        let exact = [0.09 + 0.16 / 12.0, 0.04 + 0.36 / 12.0, 0.25 + 1.0 / 12.0, -0.06, -0.1, 0.15];
        (0..6).for_each(|k| assert!((second[k] / volume - exact[k]).abs() < 1e-12, "{second:?}"));
        let all = masses(&sim);
        assert!(all.len() == pieces && (all.iter().sum::<f64>() / 192.0 - 1.0).abs() < 1e-12 && all.iter().all(|m| *m > 0.0));
        assert!((sim.ledger().mass / 192.0 - 1.0).abs() < 1e-12);
    }
    // Of a stone of an arch and of a hull, too: the sum of the pieces is the body.
    for shape in [
        "voussoir = { radius = 1, thickness = 0.3, width = 0.4, stones = 7 }",
        "hull = { points = [[0, 0, 0], [1, 0, 0], [0, 1.2, 0], [0, 0, 0.9], [0.8, 0.8, 0.7]] }",
    ] {
        let words = |fracture: &str| format!("shape = {{ {shape} }}\nangular_velocity = [[0.3, 1, 2]]\nvelocity = [[1, 2, 3]]\n{fracture}");
        let whole = scene(0.0, &words("")).ledger();
        let sim = scene(0.0, &words("fracture = { pieces = 15, strength = 1e9 }"));
        let (mut momentum, mut kinetic) = (Vector::default(), 0.0);
        for (k, m) in masses(&sim).into_iter().enumerate() {
            let v = column(&sim, &format!("b.{}", k + 1), "velocity")[0];
            (momentum, kinetic) = (momentum + v * m, kinetic + 0.5 * m * v.norm_sq());
        }
        assert!((momentum - Vector::from(whole.momentum)).norm() < 1e-11 * whole.mass, "{momentum:?} {whole:?}");
        assert!(kinetic < whole.kinetic && kinetic > 0.9 * whole.kinetic);
    }
}

#[test]
fn what_does_not_break_moves_as_the_plain_body() {
    let words = |fracture: &str| {
        format!(
            "shape = {{ box = {{ size = [0.4, 0.6, 1] }} }}\nposition = [[0, 0, 1]]\nrotate = [[20, 35, 10]]\nvelocity = [[1, 0.2, 0]]\nangular_velocity = [[1, 2, 0.5]]\n{fracture}\n[[collider]]\nname = \"floor\"\nshape.floor = {{}}"
        )
    };
    let (mut plain, mut sim) = (scene(G, &words("")), scene(G, &words("fracture = { pieces = 12, strength = 1e12 }")));
    let all = masses(&sim);
    for _ in 0..150 {
        step(&mut plain);
        step(&mut sim);
        let sum =
            all.iter().enumerate().fold(Vector::default(), |sum, (k, m)| sum + column(&sim, &format!("b.{}", k + 1), "position")[0] * *m);
        let x = column(&plain, "b", "position")[0];
        assert!((sum * (1.0 / sim.ledger().mass) - x).norm() < 1e-12, "{x:?}");
        assert_eq!(sim.ledger().kinetic, plain.ledger().kinetic);
    }
    assert!(sim.ledger().broken == Some(0) && sim.ledger().contacts == Some(1));
}

/// How many bonds break in ten frames at these parts of the stress [Pa] that statics says.
fn breaks(words: &dyn Fn(f64) -> String, gravity: f64, stress: f64) -> [u64; 2] {
    [1.05, 0.95].map(|part| {
        let mut sim = scene(gravity, &words(part * stress));
        run(&mut sim, 10);
        sim.ledger().broken.unwrap()
    })
}

/// Sites in a row of n boxes of length l along an axis.
fn row(n: usize, l: f64, axis: usize) -> String {
    let site = |k: usize| {
        let mut p = [0.0; 3];
        p[axis] = (k as f64 - 0.5 * (n as f64 - 1.0)) * l;
        format!("{p:?}")
    };
    (0..n).map(site).collect::<Vec<_>>().join(", ")
}

#[test]
fn a_hanging_column_breaks_at_its_top_under_its_weight() {
    let words = |strength: f64| {
        format!(
            "shape = {{ box = {{ size = [0.2, 0.3, 2] }} }}\ndensity = 2000\nfracture = {{ sites = [{}], strength = {strength} }}\n[[joint]]\nname = \"nail\"\nbetween = [\"b\"]\nat = [0, 0, 0.875]\nkind.fixed = {{}}",
            row(8, 0.25, 2)
        )
    };
    // Seven of eight pieces hang on the highest face: rho g 1.75 m.
    let stress = 2000.0 * G * 1.75;
    assert_eq!(breaks(&words, G, stress), [0, 1]);
    // At 0.95 of it that face alone breaks, and the rest falls as one.
    let mut sim = scene(G, &words(0.95 * stress));
    run(&mut sim, 10);
    let v: Vec<Vector> = (1..=8).map(|k| column(&sim, &format!("b.{k}"), "velocity")[0]).collect();
    assert!(v[7].norm() < 1e-6 && v[..7].iter().all(|v| (v.z + G * 0.2).abs() < 0.05 * G), "{v:?}");
}

#[test]
fn a_cantilever_breaks_where_it_is_held_as_beams_do() {
    let words = |strength: f64| {
        format!(
            "shape = {{ box = {{ size = [2, 0.3, 0.2] }} }}\ndensity = 2000\nfracture = {{ sites = [{}], strength = {strength} }}\n[[joint]]\nname = \"wall\"\nbetween = [\"b\"]\nat = [-0.8, 0, 0]\nkind.fixed = {{}}",
            row(5, 0.4, 0)
        )
    };
    // 1.6 m beyond the first face, 0.2 m high: sigma = 3 rho g l²/h, tau = rho g l; the principal stress of both.
    let (sigma, tau) = (3.0 * 2000.0 * G * 1.6 * 1.6 / 0.2, 2000.0 * G * 1.6);
    let stress = 0.5 * sigma + (0.25 * sigma * sigma + tau * tau).sqrt();
    assert_eq!(breaks(&words, G, stress), [0, 1]);
}

#[test]
fn a_bar_that_spins_breaks_in_its_middle_and_keeps_what_it_must() {
    let words = |strength: f64| {
        format!(
            "shape = {{ box = {{ size = [2, 0.1, 0.2] }} }}\ndensity = 2000\nvelocity = [[1, 2, 3]]\nangular_velocity = [[0, 0, 10]]\nfracture = {{ sites = [{}], strength = {strength} }}",
            row(6, 2.0 / 6.0, 0)
        )
    };
    // Half of it, 1 m, pulls at the middle with rho w² l²/2.
    let stress = 0.5 * 2000.0 * 100.0;
    assert_eq!(breaks(&words, 0.0, stress), [0, 1]);
    let mut sim = scene(0.0, &words(0.95 * stress));
    let start = sim.ledger();
    run(&mut sim, 10);
    let end = sim.ledger();
    let [l, m] = [&start, &end].map(|ledger| (Vector::from(ledger.momentum), Vector::from(ledger.angular_momentum.unwrap())));
    assert!((l.0 - m.0).norm() < 1e-12 * l.0.norm() && (l.1 - m.1).norm() < 1e-12 * l.1.norm(), "{l:?} {m:?}");
    assert!((end.kinetic / start.kinetic - 1.0).abs() < 1e-12, "{} {}", start.kinetic, end.kinetic);
    // Both halves fly apart: 0.5 m from the middle with 5 m/s across.
    let [a, b] = [1, 6].map(|k| column(&sim, &format!("b.{k}"), "position")[0]);
    assert!((a - b).norm() > 1.9, "{a:?} {b:?}");
}

/// Height of the lowest corner of all pieces [m], by what frames say.
fn lowest(sim: &Simulation) -> f64 {
    let topology = sim.topology();
    let corners = topology.iter().filter(|c| c.object.starts_with("b.") && c.name == "vertices").flat_map(|c| {
        let (x, q) = (column(sim, &c.object, "position")[0], turn(sim, &c.object));
        numbers(&c.data).chunks(3).map(|p| (x + q.turn(Vector::from([p[0], p[1], p[2]]))).z).collect::<Vec<_>>()
    });
    corners.fold(f64::INFINITY, f64::min)
}

/// A box that falls on its corner and breaks.
fn fall(strength: f64) -> Simulation {
    scene(
        G,
        &format!(
            "shape = {{ box = {{ size = [0.4, 0.6, 1] }} }}\nposition = [[0, 0, 1.5]]\nrotate = [[30, 35, 10]]\nangular_velocity = [[1, 2, 0.5]]\nfracture = {{ pieces = 30, strength = {strength} }}\n[[collider]]\nname = \"floor\"\nshape.floor = {{}}"
        ),
    )
}

#[test]
fn a_blow_breaks_weak_glue_and_makes_no_energy_itself() {
    let mut sim = fall(2e5);
    let energy = |sim: &Simulation| sim.ledger().kinetic + sim.ledger().external;
    let mut last = f64::INFINITY;
    for frame in 0..100 {
        step(&mut sim);
        assert!(energy(&sim) < last + 1e-3 * 240.0 * G, "frame {frame}: {} after {last} J", energy(&sim));
        let depth = sim.ledger().penetration.unwrap();
        assert!(depth < 0.02, "frame {frame}: {depth} m");
        assert!(lowest(&sim) > -0.02, "frame {frame}: a corner at {} m", lowest(&sim));
        last = energy(&sim);
    }
    let ledger = sim.ledger();
    assert!((ledger.mass / 240.0 - 1.0).abs() < 1e-12, "{ledger:?}");
    assert!(ledger.broken.unwrap() > 20 && energy(&sim) < 0.7 * 240.0 * G * 1.5, "{ledger:?}");
    let mut strong = fall(1e9);
    run(&mut strong, 100);
    assert_eq!(strong.ledger().broken, Some(0));
}

#[test]
fn breaking_has_the_same_bits_on_any_threads_and_after_a_restore() {
    let places = |sim: &Simulation| -> Vec<(Vector, Quat<f64>)> {
        (1..=30).map(|k| (column(sim, &format!("b.{k}"), "position")[0], turn(sim, &format!("b.{k}")))).collect()
    };
    let whole = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut sim = fall(6e5);
            // It breaks further after that.
            while sim.ledger().broken == Some(0) {
                step(&mut sim);
            }
            let kept = (sim.save(&[]), sim.ledger().broken);
            run(&mut sim, 30);
            (kept, sim.ledger().broken, places(&sim))
        })
    };
    let (kept, broken, end) = whole(1);
    assert!(broken > kept.1, "{broken:?} {:?}", kept.1);
    for threads in [2, 8] {
        assert!(whole(threads) == (kept.clone(), broken, end.clone()), "{threads} threads");
    }
    let mut again = fall(6e5);
    again.restore(&kept.0).unwrap();
    assert_eq!(again.ledger().broken, kept.1);
    run(&mut again, 30);
    assert_eq!(places(&again), end);
}

#[test]
fn masses_and_grains_meet_the_pieces() {
    // Two halves of a beam fly apart, and leave room where the beam was.
    let beam = "shape = { box = { size = [1, 1, 0.2] } }\nmass = 1000\nangular_velocity = [[0, 1, 0]]\nfracture = { sites = [[-0.25, 0, 0], [0.25, 0, 0]], strength = 1e-3 }";
    let dots = "[[system]]\nname = \"masses\"\nmethod = \"dynamics\"\n[[particles]]\nname = \"dots\"\nposition = [[-0.25, 0.3, 3], [0.6, 0.3, 3]]\nvelocity = [[0, 0, -1]]";
    let beads = "[[system]]\nname = \"bed\"\nmethod = \"grains\"\n[[grains]]\nname = \"beads\"\nradius = 0.02\nyoung = 1e6\nposition = [[-0.25, -0.3, 3], [0.6, -0.3, 3]]\nvelocity = [[0, 0, -1]]";
    let mut sim = scene(0.0, &format!("{beam}\n{dots}\n{beads}"));
    run(&mut sim, 10);
    assert_eq!(sim.ledger().broken, Some(1));
    // The halves rise and fall by 0.25 m/s, and reach 0.27 m around their centres: the left one meets what comes down at x = -0.25 m.
    run(&mut sim, 290);
    let half = column(&sim, "b.2", "position")[0];
    for name in ["dots", "beads"] {
        let v = column(&sim, name, "velocity");
        assert!(half.z < -1.0 && (v[0].z + 1.0).abs() > 0.1 && (v[1].z + 1.0).abs() < 1e-9, "{name}: {v:?}");
    }
}

#[test]
fn fractures_that_cannot_be_are_told_with_their_cure() {
    let brick = "shape = { box = { size = [1, 1, 1] } }";
    let cases = [
        (format!("{brick}\nfracture = {{ pieces = 1, strength = 1 }}"), ".fracture.pieces: 1, expected >= 2"),
        (format!("{brick}\nfracture = {{ pieces = 0, strength = 1 }}"), ".fracture.pieces: 0, expected >= 2"),
        (format!("{brick}\nfracture = {{ pieces = 5, strength = 0 }}"), ".fracture.strength: 0 Pa, expected > 0"),
        (format!("{brick}\nfracture = {{ strength = 1 }}"), ".fracture: no pieces; give pieces"),
        (format!("{brick}\nfracture = {{ sites = [[0, 0, 0]], strength = 1 }}"), ".fracture.sites: one site, expected at least two"),
        (
            format!("{brick}\nfracture = {{ sites = [[0, 0, 0], [0, 0, 0.6]], strength = 1 }}"),
            ".fracture.sites[1]: [0.0, 0.0, 0.6] m lies outside",
        ),
        (
            format!("{brick}\nfracture = {{ sites = [[0, 0, 0.1], [0, 0, 0.1]], strength = 1 }}"),
            ".fracture.sites[1]: [0.0, 0.0, 0.1] m is given twice",
        ),
        (
            format!("{brick}\nfracture = {{ pieces = 5, strength = 1, around = [2, 0, 0] }}"),
            ".fracture.around: [2.0, 0.0, 0.0] m lies outside",
        ),
        (format!("{brick}\ninertia = [1, 1, 1]\nfracture = {{ pieces = 5, strength = 1 }}"), ".inertia: given beside fracture"),
        (
            "shape = { sphere = { radius = 1 } }\nfracture = { pieces = 5, strength = 1 }".into(),
            ".fracture: only a convex body with flat faces breaks",
        ),
    ];
    for (words, told) in cases {
        let text = format!("version = 1\n[[body]]\nname = \"a\"\n{words}\n");
        let error = match Scene::from_toml(&text) {
            Ok(scene) => Simulation::new(scene, Default::default()).err().unwrap().to_string(),
            Err(error) => error.to_string(),
        };
        assert!(error.contains(told) && error.contains("\"a\"") && error.matches("\"a\"").count() == 1, "{words}: {error}");
    }
}
