//! Surfaces that bend, stretch and enclose, and bodies that keep their shape: against exact energies, engineering formulas and recurrences.
//! docs/theory/bending.md, membranes.md, shapes.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, run, simulation, vector, velocities, write};
use std::collections::HashMap;
use std::sync::Arc;
use tumble_f64::elements::{
    Constraints, Element, IsometricBend, Linear, Members, Membrane, Projected, Projection, Shape, Volume, enclosed,
};
use tumble_f64::geometry::Walls;
use tumble_f64::math::{Row, rotation, xyz};
use tumble_f64::scene::Simulation;
use tumble_interface::{Engine, Mesh, Scene};

fn step_of(h: f64, iteration: u32, iterations: u32) -> Projection<'static> {
    Projection { h, before: &[], iteration, iterations, plain: None, walls: Walls::default() }
}

fn rows(x: &[Vector], w: &[f64]) -> Vec<Row> {
    x.iter().zip(w).map(|(x, w)| [x.x, x.y, x.z, *w]).collect()
}

#[test]
fn the_flat_hinge_has_the_energy_of_the_dihedral_one_where_nothing_stretches() {
    // E = k (1 - cos theta), at every angle and for wings of any shape.
    let corners = |theta: f64| {
        [vector(0.0, 0.0, 0.0), vector(0.0, 2.0, 0.0), vector(-0.6, 0.3, 0.0), vector(0.9 * theta.cos(), 1.4, -0.9 * theta.sin())]
    };
    let rest = IsometricBend::rest(corners(0.0)).unwrap();
    // The rest numbers do not depend on how far it is folded when they are taken.
    let folded = IsometricBend::rest(corners(1.1)).unwrap();
    assert!(rest.iter().zip(folded).all(|(a, b)| (a - b).abs() < 1e-14));
    for step in 0..=32 {
        let theta = f64::from(step - 16) / 16.0 * std::f64::consts::PI;
        let r = IsometricBend::residual(rest, corners(theta).map(|x| [x.x, x.y, x.z, 0.0]));
        let energy = 0.5 * r.iter().map(|r| r * r).sum::<f64>();
        assert!((energy - (1.0 - theta.cos())).abs() < 1e-14, "{theta}: {energy}");
    }
    // A pure stretch along the hinge or across it bends nothing.
    let r = IsometricBend::residual(rest, corners(0.0).map(|x| [3.0 * x.x, 0.5 * x.y, 0.0, 0.0]));
    assert!(r.iter().all(|r| r.abs() < 1e-14));
}

#[test]
fn a_projected_flat_hinge_moves_as_computed_by_hand() {
    // The energy is quadratic: one projection is the exact step, dx_i = -w_i K_i r/(sum w K² + alpha).
    let x = [vector(0.0, 0.0, 0.0), vector(0.0, 2.0, 0.0), vector(-1.0, 1.0, 0.0), vector(0.0, 1.0, 1.0)];
    let w = [1.0, 0.5, 2.0, 1.0];
    let (k, h) = (3.0, 0.2);
    let member = [Members { nodes: [0, 1, 2, 3], rest: [1.0, -1.0, -1.0], law: [], stiffness: k, damping: 0.0 }];
    let mut moved = rows(&x, &w);
    Projected::<IsometricBend, Linear, 4, 3, 3, 0>::new(4, 4, &[], &member, &[]).unwrap().project(&mut moved, &step_of(h, 0, 1));
    // K = (1, 1, -1, -1), r = (1, 0, -1), sum w K² = 4.5, alpha = 1/(k h²).
    let factor = -1.0 / (4.5 + 1.0 / (k * h * h));
    for (i, k) in [1.0, 1.0, -1.0, -1.0].into_iter().enumerate() {
        let exact = vector(1.0, 0.0, -1.0) * (w[i] * k * factor);
        assert!((xyz(moved[i]) - x[i] - exact).norm() < 1e-15 && exact.norm() > 0.01, "{i}: {:?}", moved[i]);
    }
}

/// A strip that is bent to a polygon, each segment as long as before and turned against the last by theta.
#[test]
fn a_bent_sheet_has_the_same_energy_by_either_word() {
    let (n, m, s, b, theta) = (9, 5, 0.1, 0.02, 0.2_f64);
    let bent = |words: &str| {
        let mut sim = simulation(&format!(
            "precision = \"double\"\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"implicit_euler\"\n[[sheet]]\nname = \"s\"\nsize = [{}, {}]\n\
             resolution = [{n}, {m}]\nlinks = {{}}\n{words}\n",
            s * f64::from(n - 1),
            s * f64::from(m - 1)
        ));
        let mut at = vector(0.0, 0.0, 0.0);
        let mut column = vec![at];
        for i in 0..n - 1 {
            let angle = theta * f64::from(i);
            at = at + vector(angle.cos(), 0.0, angle.sin()) * s;
            column.push(at);
        }
        let x: Vec<Vector> = (0..m).flat_map(|j| column.iter().map(move |c| vector(c.x, s * f64::from(j), c.z))).collect();
        write(&mut sim, "s", "position", &x);
        sim.ledger().energy()
    };
    // Seven folds of four edges, k = B l²/(A1 + A2) = B.
    let exact = 28.0 * b * (1.0 - theta.cos());
    for words in ["hinge", "isometric"] {
        let energy = bent(&format!("{words} = {b}"));
        assert!((energy / exact - 1.0).abs() < 1e-12, "{words}: {energy} {exact}");
    }
    // Both words add up.
    assert!((bent("hinge = 0.01\nisometric = 0.01") / exact - 1.0).abs() < 1e-12);
}

/// Creases of any direction cost the same: W = B/2 (kxx² + kyy² + 2 kxy²), on cells that are not square, too.            (bending.13)
#[test]
fn a_sheet_bends_alike_in_all_directions() {
    let ([nx, ny], [a, b], stiffness, kappa) = ([9, 6], [0.1, 0.16], 0.02, 0.05);
    let [length, width] = [a * f64::from(nx - 1), b * f64::from(ny - 1)];
    let mut sim = simulation(&format!(
        "precision = \"double\"\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"implicit_euler\"\n[[sheet]]\nname = \"s\"\n\
         size = [{length}, {width}]\nresolution = [{nx}, {ny}]\nlinks = {{}}\nisometric = {stiffness}\n"
    ));
    let flat = positions(&sim, "s");
    for degrees in [0.0_f64, 20.0, 45.0, 63.0, 90.0, 135.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let x: Vec<Vector> = flat.iter().map(|p| vector(p.x, p.y, p.z + kappa / 2.0 * (cos * p.x + sin * p.y).powi(2))).collect();
        write(&mut sim, "s", "position", &x);
        // Rows have no angle at their ends: half a cell at each does not bend.
        let areas = [(length - a) * width, length * (width - b), length * width];
        let squares = [cos.powi(4), sin.powi(4), 2.0 * (sin * cos).powi(2)];
        let exact = stiffness / 2.0 * kappa * kappa * areas.iter().zip(squares).map(|(a, k)| a * k).sum::<f64>();
        let energy = sim.ledger().energy();
        assert!((energy / exact - 1.0).abs() < 1e-11, "{degrees}: {energy} {exact}");
    }
}

#[test]
fn a_projected_membrane_moves_as_computed_by_hand() {
    // A right triangle stretched along the warp by a half: e = (0.625, 0, 0), r = L^T e = (L11 e, 0, 0), dr/dx1 = L11 f1.
    let x = [vector(0.0, 0.0, 0.0), vector(1.5, 0.0, 0.0), vector(0.0, 1.0, 0.0)];
    let (b, area) = Membrane::axes([x[0], vector(1.0, 0.0, 0.0), x[2]], vector(1.0, 0.0, 0.0), 0.0).unwrap();
    let root = Membrane::root(4.0, 9.0, 0.0, 1.0).unwrap();
    assert!((area - 0.5).abs() < 1e-15 && root == [2.0, 0.0, 3.0, 1.0] && b == [1.0, 0.0, 0.0, 1.0], "{area} {root:?} {b:?}");
    let rest = std::array::from_fn(|i| if i < 4 { b[i] } else { root[i - 4] });
    let member = [Members { nodes: [0, 1, 2], rest, law: [], stiffness: area, damping: 0.0 }];
    let (mut moved, h) = (rows(&x, &[1.0, 2.0, 1.0]), 0.5);
    Projected::<Membrane, Linear, 3, 3, 8, 0>::new(3, 3, &[], &member, &[]).unwrap().project(&mut moved, &step_of(h, 0, 1));
    // c = 2 e, g1 = 2 f1 = 3 along x, weight = 9 (1 + 2), alpha = 1/(area h²) = 8.
    let lambda = -2.0 * 0.625 / (27.0 + 8.0);
    assert!((moved[1][0] - (1.5 + 6.0 * lambda)).abs() < 1e-15 && (moved[0][0] + 3.0 * lambda).abs() < 1e-15, "{moved:?}");
    assert_eq!(moved[2], [0.0, 1.0, 0.0, 1.0]);
    // A material whose ratio is too large is not stable.
    assert!(Membrane::root(1.0, 4.0, 0.5, 1.0).is_none() && Membrane::root(1.0, 4.0, 0.49, 1.0).is_some());
}

/// A strip, free everywhere and pulled at both ends, is in uniform tension: strain = tension/E(angle), with
/// 1/E = cos⁴/E1 + sin⁴/E2 + (1/G - 2 nu/E1) sin² cos².                            (membranes.5)
#[test]
fn a_pulled_strip_has_the_modulus_of_its_direction() {
    let (warp, weft, poisson, shear) = (1000.0, 400.0, 0.3, 150.0);
    let (length, width, nx, ny, density) = (1.0, 0.4, 11, 5, 1.0);
    let spacing = length / f64::from(nx - 1);
    let tension = 1.0;
    // Masses at the ends stand for half a spacing, those in corners for a quarter: equal accelerations are a uniform tension.
    let acceleration = 2.0 * tension / (density * spacing);
    for (system, fps, frames) in
        [("method = \"position_based\"\nsubsteps = 160", 50, 100), ("integrator = \"implicit_euler\"\nsolver.hessian = \"exact\"", 50, 100)]
    {
        for angle in [0.0_f64, 45.0, 90.0] {
            let mut sim = simulation(&format!(
                "precision = \"double\"\ntime.fps = {fps}\nworld.gravity = [0, 0, 0]\n[[system]]\n{system}\n[[force]]\nkind = \"drag\"\nrate = 40\n\
                 [[force]]\nkind = \"acceleration\"\nvalue = \"[{acceleration}*(smoothstep(0.45, 0.46, x) - smoothstep(0.45, 0.46, -x)), 0, 0]\"\n\
                 [[sheet]]\nname = \"s\"\nsize = [{length}, {width}]\nresolution = [{nx}, {ny}]\ndensity = {density}\n\
                 membrane = {{ warp = {warp}, weft = {weft}, poisson = {poisson}, shear = {shear}, angle = {angle} }}\n"
            ));
            run(&mut sim, frames);
            let x = positions(&sim, "s");
            let at = |i: i32, j: i32| x[(i + nx * j) as usize];
            let long = (0..ny).map(|j| at(nx - 1, j).x - at(0, j).x).sum::<f64>() / f64::from(ny);
            let wide = (0..nx).map(|i| at(i, ny - 1).y - at(i, 0).y).sum::<f64>() / f64::from(nx);
            let (strain, across) = (long / length - 1.0, wide / width - 1.0);
            let (c, s) = (angle.to_radians().cos(), angle.to_radians().sin());
            let coupling = 1.0 / shear - 2.0 * poisson / warp;
            let exact = tension * (c.powi(4) / warp + s.powi(4) / weft + coupling * s * s * c * c);
            // Across, with the same compliances turned.
            let turned = tension * ((1.0 / warp + 1.0 / weft - 1.0 / shear) * s * s * c * c - poisson / warp * (s.powi(4) + c.powi(4)));
            let speed = sim.ledger().speed.unwrap();
            println!(
                "{system:?} at {angle}: strain {strain:.6e}, exact {exact:.6e}; across {across:.6e}, exact {turned:.6e}; speed {speed:.1e}"
            );
            // A Green strain e is a stretch e - e²/2, and the stress turns with it: 3/2 of the strain, 0.4 % at most.
            assert!((strain / exact - 1.0).abs() < 1e-2 && (across - turned).abs() < 1e-2 * exact, "{strain} {exact} {across} {turned}");
        }
    }
}

fn icosahedron(radius: f64) -> Mesh {
    let g = 0.5 * (1.0 + 5.0_f64.sqrt());
    let scale = radius / (1.0 + g * g).sqrt();
    let mut vertices = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        vertices.extend([[0.0, a, b], [b, 0.0, a], [a, b, 0.0]].map(|v: [f64; 3]| v.map(|c| c * scale)));
    }
    let edge = 2.0 * scale;
    let x = |i: usize| Vector::from(vertices[i]);
    let near = |i: usize, j: usize| ((x(i) - x(j)).norm() / edge - 1.0).abs() < 1e-9;
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if near(i, j) && near(j, k) && near(k, i) {
                    let outside = (x(j) - x(i)).cross(x(k) - x(i)).dot(x(i)) > 0.0;
                    triangles.push(if outside { [i, j, k] } else { [i, k, j] }.map(|i| i as u32));
                }
            }
        }
    }
    assert_eq!(triangles.len(), 20);
    Mesh { vertices, triangles, ..Mesh::default() }
}

fn with_mesh(text: &str, mesh: Mesh) -> Result<Simulation, String> {
    let scene = Scene::from_toml(&format!("version = 1\n{text}")).map_err(|e| e.to_string())?;
    Simulation::new(scene, Arc::new(HashMap::from([("ball.obj".to_string(), mesh)])).into()).map_err(|e| e.to_string())
}

fn volume_of(sim: &Simulation, mesh: &Mesh) -> f64 {
    let x = positions(sim, "ball");
    enclosed(&mesh.triangles, |i| x[i as usize])
}

#[test]
fn a_ball_swells_until_tension_holds_its_pressure() {
    let mesh = icosahedron(0.5);
    let (v0, area) = (enclosed(&mesh.triangles, |i| Vector::from(mesh.vertices[i as usize])), {
        let x = |i: u32| Vector::from(mesh.vertices[i as usize]);
        mesh.triangles.iter().map(|t| (x(t[1]) - x(t[0])).cross(x(t[2]) - x(t[0])).norm() / 2.0).sum::<f64>()
    });
    // 20 equilateral triangles of edge a: V = 5 (3 + sqrt 5)/12 a³.
    let a =
        (Vector::from(mesh.vertices[mesh.triangles[0][0] as usize]) - Vector::from(mesh.vertices[mesh.triangles[0][1] as usize])).norm();
    assert!((v0 / (5.0 * (3.0 + 5.0_f64.sqrt()) / 12.0 * a.powi(3)) - 1.0).abs() < 1e-14, "{v0}");
    let scene = |pressure: &str| {
        format!(
            "precision = \"double\"\ntime.fps = 50\nworld.gravity = [0, 0, 0]\n[[system]]\nmethod = \"position_based\"\nsubsteps = 40\n\
             [[force]]\nkind = \"drag\"\nrate = 10\n[[net]]\nname = \"ball\"\nmesh = {{ path = \"ball.obj\" }}\ndensity = 1\n\
             membrane = {{ warp = 100, poisson = 0.4 }}\npressure = {{ {pressure} }}\n"
        )
    };
    // Scaled by s the energy is A k/(1 - nu) e² + K V0/2 (s³ - 1.5)², e = (s² - 1)/2; by symmetry the minimum is a scaling.
    let (k, bulk) = (100.0 / (1.0 - 0.4), 300.0);
    let slope = |s: f64| area * k * (s * s - 1.0) * s + 3.0 * bulk * v0 * s * s * (s.powi(3) - 1.5);
    let (mut low, mut high) = (1.0, 1.2);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if slope(middle) < 0.0 { low = middle } else { high = middle }
    }
    let mut sim = with_mesh(&scene(&format!("volume = 1.5, stiffness = {bulk}")), mesh.clone()).unwrap();
    run(&mut sim, 250);
    let radii: Vec<f64> = positions(&sim, "ball").iter().map(|x| x.norm() / 0.5).collect();
    let (least, most) = radii.iter().fold((f64::MAX, 0.0_f64), |(a, b), r| (a.min(*r), b.max(*r)));
    println!("radius {least:.6} to {most:.6} times that at rest, balance at {low:.6}");
    assert!(low > 1.02 && low < 1.13 && (least / low - 1.0).abs() < 2e-3 && (most / low - 1.0).abs() < 2e-3);
    // Without a stiffness the volume is kept, whatever the membrane wants.
    let mut sim = with_mesh(&scene("volume = 1.5"), mesh.clone()).unwrap();
    let start = sim.ledger();
    run(&mut sim, 250);
    let volume = volume_of(&sim, &mesh) / v0;
    println!("volume {volume:.9} of 1.5");
    // Membranes come first in a sweep, the volume last; one step of Newton's method leaves the square of a small error.
    assert!((volume - 1.5).abs() < 1e-4);
    // Nothing else pushes: momentum stays zero.
    let p = Vector::from(sim.ledger().momentum);
    assert!(p.norm() < 1e-10 && Vector::from(start.momentum).norm() == 0.0, "{p:?}");
    // Impossible input is an error.
    let mut open = mesh.clone();
    open.triangles.pop();
    let told = |text: &str, mesh: Mesh| with_mesh(text, mesh).err().unwrap();
    assert!(
        told(&scene("volume = 1.5"), open).contains("net \"ball\".pressure: the mesh encloses nothing: 3 edges have one triangle only")
    );
    let mut turned = mesh.clone();
    turned.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    assert!(told(&scene("volume = 1.5"), turned).contains("inside out"));
    let explicit = scene("volume = 1.5").replace("method = \"position_based\"", "integrator = \"rk4\"");
    let message = told(&explicit, mesh);
    assert!(message.contains("net \"ball\".pressure") && message.contains("position_based"), "{message}");
}

#[test]
fn a_projected_volume_moves_as_computed_by_hand() {
    // The unit corner tetrahedron: V = 1/6, dV/dx = 1/6 along each axis for its tips, and minus their sum for the corner.
    let x =
        [vector(0.0, 0.0, 0.0), vector(1.0, 0.0, 0.0), vector(0.0, 1.0, 0.0), vector(0.0, 0.0, 1.0)].map(|x| x + vector(5.0, -3.0, 8.0));
    let triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
    let (h, k) = (0.1, 40.0);
    let mut soft = Volume::new(4, triangles.clone(), 0.2, 1.0.into(), k).unwrap();
    let mut moved = rows(&x, &[1.0, 2.0, 3.0, 0.0]);
    let over: f64 = 1.0 / 6.0 - 0.2;
    assert!((soft.energy(&moved, Walls::default()) - 0.5 * k * over * over).abs() < 1e-15);
    soft.project(&mut moved, &step_of(h, 0, 2));
    // Weight (3 + 2 + 3 + 0)/36, alpha = 1/(k h²) = 2.5.
    let lambda = -over / (8.0 / 36.0 + 2.5);
    let exact = [vector(-1.0, -1.0, -1.0), vector(2.0, 0.0, 0.0), vector(0.0, 3.0, 0.0), Vector::default()];
    for i in 0..4 {
        assert!((xyz(moved[i]) - x[i] - exact[i] * (lambda / 6.0)).norm() < 1e-14, "{i}: {:?}", moved[i]);
    }
    assert!(lambda > 0.01 && Volume::new(3, triangles, 0.2, 1.0.into(), k).is_none());
}

fn cloud(n: usize) -> (Vec<Vector>, Vec<f64>) {
    let mut numbers = common::Numbers(41);
    let x = (0..n).map(|_| numbers.vector()).collect();
    (x, (0..n).map(|_| 1.5 + numbers.next()).collect())
}

fn moved_by(x: &[Vector], degrees: [f64; 3], by: Vector) -> Vec<Vector> {
    let turn = rotation::from_degrees(degrees);
    x.iter().map(|x| turn.turn(*x) + by).collect()
}

#[test]
fn a_shape_is_left_alone_where_it_is_only_moved_and_turned() {
    let (rest, mass) = cloud(30);
    let w: Vec<f64> = mass.iter().map(|m| 1.0 / m).collect();
    // Half turns included, where an iteration from the last rotation would stand still.
    for degrees in [[0.0, 0.0, 0.0], [180.0, 0.0, 0.0], [0.0, 180.0, 0.0], [12.0, -77.0, 140.0], [180.0, 90.0, 90.0]] {
        let x = moved_by(&rest, degrees, vector(30.0, -20.0, 7.0));
        for kappa in [f64::INFINITY, 100.0] {
            let mut shape = Shape::new(0..30, mass.clone(), &rest, kappa).unwrap();
            let mut rows = rows(&x, &w);
            shape.project(&mut rows, &step_of(0.1, 0, 1));
            let off = rows.iter().zip(&x).map(|(row, x)| (xyz(*row) - *x).norm()).fold(0.0, f64::max);
            // Places of 40 m have a round-off of 7e-15 m.
            assert!(off < 1e-13, "{degrees:?}: {off:e}");
        }
    }
}

#[test]
fn a_deformed_shape_comes_back_and_keeps_its_momenta() {
    let (rest, mass) = cloud(30);
    let w: Vec<f64> = mass.iter().map(|m| 1.0 / m).collect();
    let mut numbers = common::Numbers(43);
    let x: Vec<Vector> = moved_by(&rest, [70.0, 10.0, -160.0], vector(1.0, 2.0, 3.0)).iter().map(|x| *x + numbers.vector() * 0.3).collect();
    let (kappa, h) = (50.0, 0.2);
    for (kappa, part) in [(f64::INFINITY, 1.0), (kappa, kappa * h * h / (1.0 + kappa * h * h))] {
        let mut shape = Shape::new(0..30, mass.clone(), &rest, kappa).unwrap();
        let mut moved = rows(&x, &w);
        let energy = shape.energy(&moved, Walls::default());
        shape.project(&mut moved, &step_of(h, 0, 1));
        let d: Vec<Vector> = moved.iter().zip(&x).map(|(row, x)| xyz(*row) - *x).collect();
        let (mut p, mut l, mut size) = (Vector::default(), Vector::default(), 0.0);
        for i in 0..30 {
            p = p + d[i] * mass[i];
            l = l + x[i].cross(d[i]) * mass[i];
            size += d[i].norm() * mass[i];
        }
        assert!(size > 3.0 && p.norm() < 1e-13 * size && l.norm() < 1e-13 * size, "{p:?} {l:?} {size}");
        if kappa.is_finite() {
            // Implicit Euler is solved in one step: the deformation is what is left of it, and a second sweep finds nothing to do.
            let left = shape.energy(&moved, Walls::default()) / energy;
            assert!((left - (1.0 - part) * (1.0 - part)).abs() < 1e-13, "{left}");
            let mut twice = rows(&x, &w);
            (0..2).for_each(|i| shape.project(&mut twice, &step_of(h, i, 2)));
            assert!(twice.iter().zip(&moved).all(|(a, b)| (xyz(*a) - xyz(*b)).norm() < 1e-14));
        } else {
            // Rigid: all distances are those of the rest shape.
            let off = |i: usize, j: usize| (xyz(moved[i]) - xyz(moved[j])).norm() - (rest[i] - rest[j]).norm();
            assert!((1..30).all(|i| off(0, i).abs() < 1e-14));
        }
    }
}

/// Every deformation oscillates at the frequency given, and a step of implicit Euler leaves 1/(1 + (w h)²) of its energy.
#[test]
fn a_shape_oscillates_at_its_frequency() {
    let frequency = 2.0;
    let mut sim = simulation(&format!(
        "precision = \"double\"\ntime.fps = 100\nworld.gravity = [0, 0, 0]\n[[system]]\nmethod = \"position_based\"\nsubsteps = 1\n\
         [[block]]\nname = \"b\"\nsize = [0.4, 0.3, 0.2]\nresolution = [5, 4, 3]\nshape_matching = {{ frequency = {frequency} }}\n"
    ));
    // Stretched along one axis, pressed along another: no rotation.
    let x: Vec<Vector> = positions(&sim, "b").iter().map(|x| vector(1.2 * x.x, 0.9 * x.y, x.z)).collect();
    write(&mut sim, "b", "position", &x);
    let start = sim.ledger().energy();
    run(&mut sim, 50);
    let z = std::f64::consts::TAU * frequency * 0.01;
    let (ratio, exact) = (sim.ledger().energy() / start, (1.0 + z * z).powi(-50));
    assert!((ratio / exact - 1.0).abs() < 1e-9 && exact < 0.9, "{ratio} {exact}");
    // It spins freely: angular momentum is kept to the order of the method.
    let spun: Vec<Vector> = positions(&sim, "b").iter().map(|x| vector(0.0, 1.0, 2.0).cross(*x)).collect();
    write(&mut sim, "b", "velocity", &spun);
    let before = Vector::from(sim.ledger().angular_momentum.unwrap());
    run(&mut sim, 50);
    let after = Vector::from(sim.ledger().angular_momentum.unwrap());
    assert!((after - before).norm() < 0.1 * before.norm(), "{before:?} {after:?}");
    assert!(velocities(&sim, "b").iter().all(|v| v.norm().is_finite()));
}
