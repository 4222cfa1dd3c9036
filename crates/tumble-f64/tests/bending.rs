//! Strips of surfaces that bend, on meshes of any triangles: how they hang depends on their stiffness alone. docs/theory/bending.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, run, write};
use std::collections::HashMap;
use std::sync::Arc;
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Engine, Fabric, Mesh, Scene};

const B: f64 = 1e-4;
const DENSITY: f64 = 0.3;
const G: f64 = 9.8;
/// Drop over reach of the elastica at rho g L³/B = 8: `draping.rs` has others.
const GAMMA: [(f64, f64); 2] = [(1.0, 0.123471 / 0.991246), (5.0, 0.495905 / 0.846657)];

fn length(gamma: f64) -> f64 {
    (gamma * B / (DENSITY * G)).cbrt()
}

fn fabric(bending: [f64; 3]) -> Fabric {
    let pulled = [3000.0, 0.0, 3000.0, 1500.0];
    Fabric { density: DENSITY, stretching: [pulled; 6], bending: bending.map(|b| [b; 5]), ..Fabric::default() }
}

fn simulate(text: &str, mesh: &Mesh, fabric: Fabric) -> Simulation {
    let text = format!(
        "version = 1\nprecision = \"double\"\ntime.fps = 50\n[[system]]\nintegrator = \"implicit_euler\"\n\
         solver = {{ newton_tolerance = 1e-3, linear_tolerance = 0.1 }}\n[[force]]\nkind = \"drag\"\nrate = 12\n{text}"
    );
    let scene = Scene::from_toml(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let assets: HashMap<String, Mesh> = HashMap::from([("mesh".into(), mesh.clone())]);
    let assets: Assets = Arc::new(assets).into();
    Simulation::new(scene, assets.with_fabrics(HashMap::from([("it".to_string(), fabric)]))).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Drop over reach of the middle of the tip of a strip along x from 0, whose masses up to a cell are held.
fn chord(mut sim: Simulation, cell: f64, length: f64) -> f64 {
    let start = positions(&sim, "s");
    run(&mut sim, 100);
    assert!(sim.ledger().speed.unwrap() < 1e-3, "{:?}", sim.ledger().speed);
    let x = positions(&sim, "s");
    let left = start.iter().fold(f64::INFINITY, |m, x| m.min(x.x));
    let tip: Vec<Vector> = x.iter().zip(&start).filter(|(_, s)| s.x - left > cell + length - 0.51 * cell).map(|(x, _)| *x).collect();
    let n = tip.len() as f64;
    let end = tip.iter().fold(Vector::default(), |sum, x| sum + *x) * (1.0 / n);
    -end.z / (end.x - left - 0.5 * cell)
}

/// By `hinge` and by `fabric`, in cells of any shape, however many lie across.
#[test]
#[ignore = "long: make validate"]
fn a_strip_of_a_sheet_hangs_alike_in_cells_of_any_shape() {
    for (gamma, exact) in GAMMA {
        let words = ["hinge = 1e-4\nmembrane = { warp = 3000 }", "fabric = { path = \"it\" }", "fabric = { path = \"it\", angle = 30 }"];
        for (k, words) in words.into_iter().enumerate() {
            let cells = [(16, 5, 1.0), (16, 2, 1.0), (16, 3, 3.0), (16, 4, 0.3), (24, 3, 2.0), (8, 3, 0.5), (12, 3, 40.0)];
            for (n, m, aspect) in common::cases(cells.into_iter().cycle().skip(2 * k).take(7), 3) {
                let cell = length(gamma) / (f64::from(n) + 0.5);
                let pins: Vec<String> = (0..2).flat_map(|i| (0..m).map(move |j| format!("\"vertex {i} {j}\""))).collect();
                let text = format!(
                    "[[sheet]]\nname = \"s\"\ndensity = {DENSITY}\nsize = [{}, {}]\nresolution = [{}, {m}]\n{words}\npin = [{}]\n",
                    cell * f64::from(n + 1),
                    aspect * cell * f64::from(m - 1),
                    n + 2,
                    pins.join(", ")
                );
                let found = chord(simulate(&text, &Mesh::default(), fabric([B; 3])), cell, length(gamma));
                println!("{gamma}, {words:?}, {n} x {m} cells of 1 to {aspect}: {:+.3} %", 100.0 * (found / exact - 1.0));
                assert!((found / exact - 1.0).abs() < 0.01, "{words} {n} {m} {aspect}: {found} {exact}");
            }
        }
    }
}

/// A strip of n by m vertices, in cells of that width along x, with diagonals forward, backward, or of equilateral triangles; jittered inside by
/// a part of it.
fn strip(kind: &str, (n, m): (i32, i32), cell: f64, jitter: f64) -> Mesh {
    let slant = if kind == "equilateral" { 0.75_f64.sqrt() } else { 1.0 };
    let mut seed = 1_u64;
    let mut noise = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0) * jitter * cell
    };
    let mut vertices = Vec::new();
    for j in 0..m {
        for i in 0..n {
            // Rows of equilateral triangles run across, so that their heights run along.
            let odd = if kind == "equilateral" && i % 2 == 1 { 0.5 } else { 0.0 };
            let inside = i > 1 && i < n - 1 && j > 0 && j < m - 1;
            let (dx, dy) = if inside { (noise(), noise()) } else { (0.0, 0.0) };
            vertices.push([f64::from(i) * cell + dx, (f64::from(j) + odd) * cell / slant + dy, 0.0]);
        }
    }
    let mut triangles = Vec::new();
    for j in 1..m {
        for i in 1..n {
            let [a, b, c, d] = [[i - 1, j - 1], [i, j - 1], [i, j], [i - 1, j]].map(|[i, j]| (i + n * j) as u32);
            let forward = match kind {
                "forward" => true,
                "backward" => false,
                _ => i % 2 == 0,
            };
            triangles.extend(if forward { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
        }
    }
    Mesh { vertices, triangles, ..Mesh::default() }
}

/// Either diagonal, equilateral triangles, and uneven ones: by `hinge` and by `fabric`.
#[test]
fn a_strip_of_a_net_hangs_alike_with_any_triangles() {
    let (gamma, exact) = GAMMA[1];
    let cell = length(gamma) / 16.5;
    for words in ["hinge = 1e-4\nmembrane = { warp = 3000 }", "fabric = { path = \"it\" }"] {
        let triangles = [("forward", 0.0), ("backward", 0.0), ("equilateral", 0.0), ("forward", 0.15), ("equilateral", 0.2)];
        for (kind, jitter) in common::cases(triangles, 4) {
            let mesh = strip(kind, (18, 7), cell, jitter);
            let held = mesh.vertices.iter().enumerate().filter(|(_, x)| x[0] < 1.5 * cell);
            let pins: Vec<String> = held.map(|(i, _)| format!("\"vertex {i}\"")).collect();
            let text = format!(
                "[[net]]\nname = \"s\"\ndensity = {DENSITY}\nmesh.path = \"mesh\"\nlinks = {{}}\n{words}\npin = [{}]\n",
                pins.join(", ")
            );
            let found = chord(simulate(&text, &mesh, fabric([B; 3])), cell, 16.5 * cell);
            println!("{words:?}, {kind}, jitter {jitter}: {:+.3} %", 100.0 * (found / exact - 1.0));
            // The sides of rows of equilateral triangles are zigzags, which bend a little more easily, as do uneven meshes.
            assert!(
                (found / exact - 1.0).abs() < if kind == "equilateral" { 0.04 } else { 0.02 },
                "{words} {kind} {jitter}: {found} {exact}"
            );
        }
    }
}

/// Quadratic surfaces of any curvature on uneven triangles: W = B/2 (kxx² + kyy² + 2 kxy²), and that of the record, where a triangle has three
/// beside it; those at the rim have at most as much.
#[test]
fn a_quadratic_surface_of_uneven_triangles_has_the_energy_of_a_plate() {
    let mesh = strip("forward", (60, 50), 0.1, 0.25);
    let edges = mesh.edges();
    let mut beside = vec![0; mesh.triangles.len()];
    edges.iter().filter(|(_, faces)| faces.len() == 2).flat_map(|(_, faces)| faces).for_each(|t| beside[*t as usize] += 1);
    let area = |least: i32| {
        let counted = mesh.triangles.iter().zip(&beside).filter(|(_, n)| **n >= least);
        let corners = counted.map(|(t, _)| t.map(|i| Vector::from(mesh.vertices[i as usize])));
        corners.map(|[a, b, c]| (b - a).cross(c - a).norm() / 2.0).sum::<f64>()
    };
    let (inner, all) = (area(3), area(0));
    assert!(inner > 0.95 * all && inner < 0.99 * all);
    let record = [1e-4, 3e-4, 2e-4];
    let twist = 4.0 * record[1] - record[0] - record[2];
    for [kxx, kyy, kxy] in [[1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0], [0.0, 0.0, 1e-3], [1e-3, -7e-4, 4e-4]] {
        let energy = |words: &str| {
            let text = format!("[[net]]\nname = \"s\"\ndensity = {DENSITY}\nmesh.path = \"mesh\"\nlinks = {{}}\n{words}\n");
            let mut sim = simulate(&text, &mesh, fabric(record));
            let lift = |x: &Vector| Vector { z: kxx / 2.0 * x.x * x.x + kyy / 2.0 * x.y * x.y + kxy * x.x * x.y, ..*x };
            let x: Vec<Vector> = positions(&sim, "s").iter().map(lift).collect();
            write(&mut sim, "s", "position", &x);
            sim.ledger().elastic
        };
        let woven = energy("fabric = { path = \"it\" }") - energy("fabric = { path = \"it\", bending = 1e-9 }");
        for (found, w) in [
            (energy("hinge = 1e-4"), B / 2.0 * (kxx * kxx + kyy * kyy + 2.0 * kxy * kxy)),
            (woven, 0.5 * (record[2] * kxx * kxx + record[0] * kyy * kyy + twist * kxy * kxy)),
        ] {
            println!("{kxx}, {kyy}, {kxy}: {:.5} of {:.5} to 1", found / w / all, inner / all);
            assert!(found / w > inner * (1.0 - 1e-3) && found / w < all * (1.0 + 1e-3), "{found} {w} {inner} {all}");
        }
    }
}
