//! Free bodies under position-based dynamics keep linear and angular momentum to round-off, whatever the element, the sub-steps and the sweeps;
//! what holds a body, breaks it or lies in its way acts as before.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::*;
use std::collections::HashMap;
use std::sync::Arc;
use tumble_f64::geometry::surface;
use tumble_f64::scene::Simulation;
use tumble_interface::{Engine, Mesh, Scene};

fn with_mesh(text: &str, mesh: &Mesh) -> Simulation {
    let scene = Scene::from_toml(&format!("version = 1\n{text}")).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let assets: HashMap<String, Mesh> = HashMap::from([("mesh".into(), mesh.clone())]);
    Simulation::new(scene, Arc::new(assets).into()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// An icosphere whose vertices are unevenly spread, as those of a downloaded mesh are.
fn uneven() -> Mesh {
    let mut mesh = surface::sphere(2, Vector::default(), 0.3);
    for v in &mut mesh.vertices {
        let stretch = 1.0 + 0.4 * (7.0 * v[0] + 3.0 * v[1]).sin();
        *v = [v[0] * stretch, v[1] * (2.0 - stretch), v[2] + 0.1 * v[0]];
    }
    mesh
}

const HEAD: &str = "precision = \"double\"\nworld.gravity = [0, 0, 0]\n[[system]]\nmethod = \"position_based\"\n";

/// Bodies of each element.
const BODIES: [(&str, &str); 13] = [
    (
        "balloon",
        "[[net]]\nname = \"b\"\nmesh.path = \"mesh\"\nlinks = { structural = 200, bend = 5 }\npressure = { volume = 1.5, stiffness = 1000 }\n",
    ),
    (
        "membrane",
        "[[net]]\nname = \"b\"\nmesh.path = \"mesh\"\nmembrane = { warp = 200, damping = 0.02 }\nhinge = 1e-3\npressure.volume = 1.3\n",
    ),
    ("fabric", "[[net]]\nname = \"b\"\nmesh.path = \"mesh\"\nmembrane = { warp = 300, weft = 100 }\nisometric = 1e-3\narea = 50\n"),
    ("soft shape", "[[net]]\nname = \"b\"\nmesh.path = \"mesh\"\nshape_matching.frequency = 5\n"),
    ("sheet", "[[sheet]]\nname = \"b\"\nsize = [1, 0.7]\nresolution = [9, 7]\nhinge = 1e-3\n"),
    ("damped", "[[sheet]]\nname = \"b\"\nsize = [1, 0.7]\nresolution = [9, 7]\nlinks.structural = { modulus = 500, damping = 0.5 }\n"),
    ("links", "[[rope]]\nname = \"b\"\nfrom = [0, 0, 0]\nto = [1, 0.2, 0.1]\nsegments = 10\n"),
    (
        "rod",
        "[[rope]]\nname = \"b\"\nfrom = [0, 0, 0]\nto = [1, 0.2, 0.1]\nsegments = 10\nrod = { stretch = 500, bend = 0.05, twist = 0.05 }\n",
    ),
    ("block", "[[block]]\nname = \"b\"\nsize = [0.6, 0.3, 0.3]\nresolution = [5, 3, 3]\nlinks = { structural = 3e4, shear = 2e4 }\n"),
    ("neo-hookean", "[[block]]\nname = \"b\"\nsize = [0.6, 0.3, 0.3]\nresolution = [5, 3, 3]\nmaterial = { young = 3e4, poisson = 0.4 }\n"),
    ("shape", "[[block]]\nname = \"b\"\nsize = [0.6, 0.3, 0.3]\nresolution = [5, 3, 3]\nshape_matching = {}\n"),
    ("pair", "[[particles]]\nname = \"b\"\nposition = [[0, 0, 0], [0.3, 0, 0]]\nspring = [{ between = [0, 1], stiffness = 10 }]\n"),
    ("liquid", "[[particles]]\nname = \"b\"\nfluid = { spacing = 0.05, fill = [{ center = [0, 0, 0], size = [0.4, 0.3, 0.3] }] }\n"),
];

/// Velocities that turn, bend and stretch a body.
fn stirred(x: &[Vector]) -> Vec<Vector> {
    let v = |x: &Vector| {
        vector(0.3, -0.5, 0.2) + vector(1.0, 2.0, -1.5).cross(*x) + vector(x.y * x.y, -2.0 * x.x * x.z, (9.0 * x.x).sin()) * 0.5
    };
    x.iter().map(v).collect()
}

/// Linear and angular momentum.
fn momenta(sim: &Simulation) -> [Vector; 2] {
    let ledger = sim.ledger();
    [ledger.momentum.into(), ledger.angular_momentum.unwrap().into()]
}

#[test]
fn every_element_keeps_the_momenta_of_free_bodies() {
    let mesh = uneven();
    for (name, body) in BODIES {
        for (substeps, iterations) in [(1, 1), (4, 3), (20, 1)] {
            let mut sim = with_mesh(&format!("{HEAD}substeps = {substeps}\nposition_based.iterations = {iterations}\n{body}"), &mesh);
            let start = positions(&sim, "b");
            write(&mut sim, "b", "velocity", &stirred(&start));
            let [p, l] = momenta(&sim);
            let mass = sim.ledger().mass;
            let mut most = [0.0_f64; 2];
            for _ in 0..36 {
                step(&mut sim);
                let [p1, l1] = momenta(&sim);
                most = [most[0].max((p1 - p).norm()), most[1].max((l1 - l).norm())];
            }
            let bent = distances(&start).iter().zip(distances(&positions(&sim, "b"))).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(l.norm() > 0.005 * mass && (bent > 5e-5 || name == "shape"), "{name}: {} of {mass}, {bent}", l.norm());
            println!("{name}, {substeps} x {iterations}: {:e} N s, {:e} N m s of {mass} kg", most[0], most[1]);
            assert!(
                most[0] < 1e-11 * mass && most[1] < 1e-11 * mass,
                "{name} {substeps} {iterations}: {most:?} of {mass} kg, {}",
                l.norm()
            );
        }
    }
}

/// Distances of all masses from the first and the last.
fn distances(x: &[Vector]) -> Vec<f64> {
    [x[0], x[x.len() - 1]].into_iter().flat_map(|from| x.iter().map(move |x| (*x - from).norm())).collect()
}

/// An inflated balloon that nobody touches does not turn, in sub-steps of any length.
#[test]
fn a_balloon_at_rest_does_not_turn() {
    for substeps in [5, 20, 80] {
        let mut sim = with_mesh(&format!("{HEAD}substeps = {substeps}\n{}", BODIES[0].1), &uneven());
        let speed = (0..72).map(|_| (step(&mut sim), sim.ledger().speed.unwrap()).1).fold(0.0, f64::max);
        let [p, l] = momenta(&sim);
        assert!(speed > 0.1 && p.norm() < 1e-13 && l.norm() < 1e-11, "{substeps}: {speed} {p:?} {l:?}");
    }
}

/// Once a link has broken, each piece keeps the momenta of its own.
#[test]
fn pieces_keep_their_own() {
    let text = format!(
        "{HEAD}substeps = 10\n[[rope]]\nname = \"b\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 10\nlinks.structural = {{ modulus = 100, break_strain = 0.05 }}\n"
    );
    let mut sim = simulation(&text);
    // The halves fly apart, each turning.
    let x = positions(&sim, "b");
    let half = |i: usize| if i < 6 { (-1.0, 0.25) } else { (1.0, 0.8) };
    let v = |i: usize| vector(half(i).0 * 2.0, 0.0, 0.0) + vector(0.0, 0.0, 5.0 * half(i).0).cross(x[i] - vector(half(i).1, 0.0, 0.0));
    write(&mut sim, "b", "velocity", &(0..11).map(v).collect::<Vec<_>>());
    let whole = momenta(&sim);
    run(&mut sim, 12);
    let (broken, x) = (sim.ledger().broken.unwrap(), positions(&sim, "b"));
    let mut pieces = vec![vec![0_usize]];
    for i in 1..11 {
        if (x[i] - x[i - 1]).norm() > 0.2 {
            pieces.push(Vec::new());
        }
        pieces.last_mut().unwrap().push(i);
    }
    assert!(broken > 0 && pieces.len() == broken as usize + 1 && pieces.iter().filter(|p| p.len() > 2).count() == 2, "{pieces:?}");
    let about = |sim: &Simulation, piece: &[usize]| {
        let (x, v) = (positions(sim, "b"), velocities(sim, "b"));
        piece.iter().fold(Vector::default(), |l, i| l + x[*i].cross(v[*i]) * if *i == 0 || *i == 10 { 0.005 } else { 0.01 })
    };
    let before: Vec<Vector> = pieces.iter().map(|p| about(&sim, p)).collect();
    run(&mut sim, 24);
    assert_eq!(sim.ledger().broken.unwrap(), broken);
    for (piece, before) in pieces.iter().zip(before) {
        let after = about(&sim, piece);
        assert!((after - before).norm() < 1e-13 && (before.norm() > 1e-4 || piece.len() < 3), "{piece:?}: {before:?} {after:?}");
    }
    assert!(whole.iter().zip(momenta(&sim)).all(|(a, b)| (*a - b).norm() < 1e-12));
}

/// What pushes a body from outside still does: a liquid in a box rests on its floor, and a rope that is pinned turns about its pin.
#[test]
fn what_is_held_is_left_alone() {
    let head = HEAD.replace("gravity = [0, 0, 0]", "gravity = [0, 0, -9.8]");
    let pool = format!(
        "{head}substeps = 10\n{}[[collider]]\nname = \"tank\"\ninside = true\nshape.box = {{ size = [0.42, 0.32, 0.6], center = [0, 0, 0.15] }}\n",
        BODIES[12].1
    );
    let mut sim = simulation(&pool);
    run(&mut sim, 24);
    let ledger = sim.ledger();
    assert!(ledger.momentum[2].abs() < 0.1 * ledger.mass, "{:?} of {}", ledger.momentum, ledger.mass);
    let rope = format!("{head}substeps = 10\n[[rope]]\nname = \"b\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 10\npin = [\"start\"]\n");
    let mut sim = simulation(&rope);
    run(&mut sim, 12);
    let x = positions(&sim, "b");
    assert!(x[0] == Vector::default() && x[10].z < -0.5, "{x:?}");
}
