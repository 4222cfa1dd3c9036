//! Nothing passes a mesh that is thinner than the cells of its grid: shells, and solids as flat as sheet metal, whatever the thickness, the
//! grid, the step, the scheme; and where something is too deep, the ledger tells.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::*;
use std::collections::HashMap;
use std::sync::Arc;
use tumble_f64::geometry::surface;
use tumble_f64::math::rotation::from_degrees;
use tumble_f64::scene::Simulation;
use tumble_interface::scene::Integrator;
use tumble_interface::{Engine, Mesh, Scene};

fn with_mesh(text: &str, mesh: &Mesh) -> Simulation {
    let scene = Scene::from_toml(&format!("version = 1\nprecision = \"double\"\n{text}")).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let assets: HashMap<String, Mesh> = HashMap::from([("mesh".into(), mesh.clone())]);
    Simulation::new(scene, Arc::new(assets).into()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// A square of side 2 at z = 0 in two triangles a cell.
fn plate(cells: u32) -> Mesh {
    let at = |k: u32| 2.0 * f64::from(k) / f64::from(cells) - 1.0;
    let vertices = (0..=cells).flat_map(|j| (0..=cells).map(move |i| [at(i), at(j), 0.0])).collect();
    let triangles = (0..cells * cells).flat_map(|k| {
        let a = k % cells + k / cells * (cells + 1);
        [[a, a + 1, a + cells + 2], [a, a + cells + 2, a + cells + 1]]
    });
    Mesh { vertices, triangles: triangles.collect(), ..Mesh::default() }
}

fn words(scheme: Integrator, substeps: u32) -> String {
    match scheme {
        Integrator::PositionBased => format!("[[system]]\nmethod = \"position_based\"\nsubsteps = {substeps}\n"),
        _ if scheme.is_adaptive() => format!("[[system]]\nintegrator = \"{}\"\n", scheme.name()),
        _ => format!("[[system]]\nintegrator = \"{}\"\nsubsteps = {substeps}\n", scheme.name()),
    }
}

/// Masses at these places with one velocity.
fn masses(x: &[Vector], v: Vector) -> String {
    format!("[[particles]]\nname = \"m\"\nposition = {}\nvelocity = {}\n", list(x), list(&vec![v; x.len()]))
}

/// Places over the middle of the plate, from just above it to 0.3 m.
fn above(count: u32, lowest: f64) -> Vec<Vector> {
    let part = |k: u32, by: f64| (f64::from(k) * by).fract();
    (0..count)
        .map(|k| vector(1.6 * part(k, 0.618) - 0.8, 1.6 * part(k, 0.755) - 0.8, lowest + 0.3 * f64::from(k) / f64::from(count)))
        .collect()
}

const SHELL: &str = "shape.mesh = { path = \"mesh\", shell = true";

/// Masses that fall on a plate rest one thickness above it, and those thrown up from below stay below.
#[test]
fn nothing_passes_a_plate() {
    let (up, down) = (vector(0.0, 0.0, 1.0), vector(0.0, 0.0, -1.0));
    for scheme in every() {
        for thickness in [1e-4, 0.003, 0.01, 0.05] {
            for (resolution, substeps) in [(8, 1), (31, 7), (100, 20)] {
                let collider = format!("[[collider]]\nname = \"plate\"\nthickness = {thickness}\n{SHELL}, resolution = {resolution} }}\n");
                let all = above(60, thickness + 1e-6);
                let mut fall = with_mesh(&format!("{}{}{collider}", words(scheme, substeps), masses(&all, Vector::default())), &plate(3));
                run(&mut fall, 12);
                let z: Vec<f64> = positions(&fall, "m").iter().map(|x| x.z).collect();
                let (low, high) = z.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (z.min(l), z.max(h)));
                // Implicit Euler sinks into its penalty: g h²/30, h = 1/24 s and less.
                let sunk = if scheme == Integrator::ImplicitEuler { 9.8 / 900.0 / f64::from(substeps * substeps) } else { 1e-9 };
                assert!(
                    low >= (thickness - sunk).max(0.0) && high < thickness + 0.02,
                    "{} {thickness} {resolution}: {low} to {high}",
                    scheme.name()
                );
                let below: Vec<Vector> = all.iter().map(|x| vector(x.x, x.y, -x.z)).collect();
                let mut rise = with_mesh(
                    &format!("world.gravity = [0, 0, 0]\n{}{}{collider}", words(scheme, substeps), masses(&below, up * 5.0)),
                    &plate(3),
                );
                run(&mut rise, 6);
                assert!(positions(&rise, "m").iter().all(|x| x.z <= 0.0), "{} {thickness} {resolution}", scheme.name());
                assert!(down.dot(positions(&rise, "m")[59]) < 0.3, "they have come near");
            }
        }
    }
}

/// A plate that leans, whose triangles go through the cells of its grid at every height; and one of sheet metal, closed.
#[test]
fn nothing_passes_what_leans() {
    let turn = from_degrees([20.0, 33.0, 10.0]);
    let normal = turn.turn(vector(0.0, 0.0, 1.0));
    let sheet = surface::cuboid(Vector::default(), vector(1.0, 1.0, 0.001), from_degrees([0.0; 3]));
    for (mesh, word, half) in [(plate(2), ", shell = true", 0.0), (sheet, "", 0.001)] {
        for scheme in [Integrator::SymplecticEuler, Integrator::Rk4, Integrator::PositionBased, Integrator::ImplicitEuler] {
            for resolution in [8, 32, 64] {
                let text = format!(
                    "{}{}[[collider]]\nname = \"plate\"\nthickness = 0.004\nfriction = 5\nshape.mesh = {{ path = \"mesh\"{word}, resolution = {resolution}, rotate = [20, \
                     33, 10] }}\n",
                    words(scheme, 10),
                    masses(&above(60, 0.01).iter().map(|x| turn.turn(*x * 0.8)).collect::<Vec<_>>(), Vector::default()),
                );
                let mut sim = with_mesh(&text, &mesh);
                run(&mut sim, 12);
                let heights: Vec<f64> = positions(&sim, "m").iter().map(|x| x.dot(normal) - half).collect();
                let (low, high) = heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (z.min(l), z.max(h)));
                assert!(low > 0.0038 && high < 0.0045, "{} {word} {resolution}: {low} to {high}", scheme.name());
            }
        }
    }
}

/// A cup without a lid holds its water.
#[test]
fn a_cup_holds_water() {
    let mut cup = surface::cuboid(vector(0.0, 0.0, 0.15), vector(0.13, 0.13, 0.15), from_degrees([0.0; 3]));
    cup.triangles.retain(|t| !t.iter().all(|i| cup.vertices[*i as usize][2] > 0.2));
    assert_eq!(cup.triangles.len(), 10);
    for resolution in [10, 64] {
        let text = format!(
            "[[system]]\nmethod = \"position_based\"\nsubsteps = 6\n[[particles]]\nname = \"water\"\nfluid = {{ spacing = 0.02, fill = [{{ center = [0, 0, 0.12], size = [0.2, 0.2, 0.2] }}] \
             }}\n[[collider]]\nname = \"cup\"\nthickness = 0.004\n{SHELL}, resolution = {resolution} }}\n"
        );
        let mut sim = with_mesh(&text, &cup);
        run(&mut sim, 24);
        let water = positions(&sim, "water");
        assert!(water.len() > 500, "{}", water.len());
        let out = water.iter().filter(|x| x.z < 0.0 || x.x.abs() > 0.13 || x.y.abs() > 0.13).count();
        assert_eq!(out, 0, "of {} at {resolution}", water.len());
    }
}

/// A cloth that falls flat on a plate lies on it; what is pushed into the thickness is told by the ledger.
#[test]
fn cloth_lies_on_a_plate_and_depth_is_told() {
    let text = format!(
        "[[system]]\nintegrator = \"symplectic_euler\"\nsubsteps = 100\n[[sheet]]\nname = \"cloth\"\nsize = [0.6, 0.6]\nresolution = [17, 17]\ncenter = [0.1, 0, \
         0.2]\nrotate = [3, 2, 0]\n[[collider]]\nname = \"plate\"\nthickness = 0.01\n{SHELL} }}\n"
    );
    let mut sim = with_mesh(&text, &plate(2));
    run(&mut sim, 24);
    let x = positions(&sim, "cloth");
    assert!(x.iter().all(|x| x.z > 0.0099 && x.z < 0.1), "{:?}", x.iter().map(|x| x.z).fold(f64::INFINITY, f64::min));
    assert!(sim.ledger().penetration.unwrap() < 1e-9);
    for depth in [0.004, 0.0099] {
        let pushed: Vec<Vector> = x.iter().map(|x| vector(x.x, x.y, 0.01 - depth)).collect();
        write(&mut sim, "cloth", "position", &pushed);
        let told = sim.ledger().penetration.unwrap();
        assert!((told - depth).abs() < 1e-12, "{told} of {depth}");
    }
}
