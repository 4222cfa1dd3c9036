//! Nets whose rest shape is the flat pattern in their texture coordinates, against exact energies. docs/theory/structures.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, run, write};
use std::collections::HashMap;
use std::f64::consts::PI;
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Data, Engine, Fabric, Mesh, Scene};

/// Sides, rows, radius [m] and height [m] of the tube.
const SIDES: usize = 12;
const ROWS: usize = 5;
const RADIUS: f64 = 0.2;
const HEIGHT: f64 = 0.5;

/// Metres to a unit of texture.
const SCALE: f64 = 2.0;

/// A tube around the z axis, sewn along one line. `texture` takes the way around [m], which goes on beyond the seam, and the height [m] to a
/// place in the pattern [m].
fn tube(texture: &dyn Fn(f64, f64) -> [f64; 2]) -> Mesh {
    let mut mesh = Mesh::default();
    for j in 0..=ROWS {
        for i in 0..SIDES {
            let a = 2.0 * PI * i as f64 / SIDES as f64;
            mesh.vertices.push([RADIUS * a.cos(), RADIUS * a.sin(), HEIGHT * j as f64 / ROWS as f64]);
        }
    }
    let side = 2.0 * RADIUS * (PI / SIDES as f64).sin();
    for j in 0..ROWS {
        for i in 0..SIDES {
            let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
            let at = |k: usize| (corners[k].1 * SIDES + corners[k].0 % SIDES) as u32;
            let flat = |k: usize| texture(side * corners[k].0 as f64, HEIGHT * corners[k].1 as f64 / ROWS as f64).map(|x| x / SCALE);
            for t in [[0, 1, 2], [0, 2, 3]] {
                mesh.triangles.push(t.map(at));
                mesh.texture.push(Some(t.map(flat)));
            }
        }
    }
    mesh
}

/// Area of the tube [m²].
fn area() -> f64 {
    2.0 * RADIUS * (PI / SIDES as f64).sin() * SIDES as f64 * HEIGHT
}

fn with(words: &str, mesh: Mesh, fabric: Option<Fabric>) -> Result<Simulation, String> {
    let text = format!("version = 1\nworld.gravity = [0, 0, 0]\n[[net]]\nname = \"n\"\ndensity = 0.3\n{words}\n");
    let scene = Scene::from_toml(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let fabrics = fabric.map(|f| ("it".to_string(), f)).into_iter().collect();
    let assets = Assets::new(HashMap::from([("tube.obj".to_string(), mesh)]), HashMap::new()).with_fabrics(fabrics);
    Simulation::new(scene, assets).map_err(|e| e.to_string())
}

fn energy(words: &str, mesh: Mesh) -> f64 {
    with(&format!("mesh.path = \"tube.obj\"\npattern.scale = {SCALE}\n{words}"), mesh, None)
        .unwrap_or_else(|e| panic!("{e}"))
        .ledger()
        .elastic
}

fn around(s: f64, z: f64) -> [f64; 2] {
    [s, z]
}

/// A quarter turn of the pattern.
fn upright(s: f64, z: f64) -> [f64; 2] {
    [-z, s]
}

const NO_LINKS: &str = "links = {}\n";

#[test]
fn a_sewn_tube_that_is_as_large_as_its_pattern_is_not_strained() {
    let elastic = "membrane = { warp = 100, weft = 40 }\narea = 30\nlinks = { structural = 50 }";
    let sim = with(&format!("mesh.path = \"tube.obj\"\npattern.scale = {SCALE}\n{elastic}"), tube(&around), None).unwrap();
    let books = sim.ledger();
    assert!(books.elastic < 1e-20 && (books.stretch.unwrap() - 1.0).abs() < 1e-12, "{books:?}");
    assert!((books.mass / (0.3 * area()) - 1.0).abs() < 1e-12, "{}", books.mass);
    assert_eq!(positions(&sim, "n").len(), SIDES * (ROWS + 1), "a vertex on the seam is one");
}

/// A tube twice as heavy and strained as the pattern says: E = A/2 e^T C e with C of (membranes.3) and A that of the pattern.
#[test]
fn strain_is_measured_from_the_pattern() {
    let words = format!("{NO_LINKS}membrane = {{ warp = 100, weft = 40, poisson = 0.3, shear = 20 }}");
    let bracket = 1.0 - 0.09 * 0.4;
    let exact = |along: f64, across: f64, shear: f64| {
        let (e1, e2) = ((along * along - 1.0) / 2.0, (across * across + shear * shear - 1.0) / 2.0);
        let e3 = along * shear;
        0.5 * (100.0 * e1 * e1 + 2.0 * 0.3 * 40.0 * e1 * e2 + 40.0 * e2 * e2) / bracket + 0.5 * 20.0 * e3 * e3
    };
    for (along, across) in [(1.0, 1.0), (1.1, 1.0), (1.0, 1.1), (1.07, 0.96)] {
        // The pattern is smaller than the tube by these stretches.
        let flat = area() / (along * across);
        let found = energy(&words, tube(&|s, z| around(s / along, z / across)));
        let right = flat * exact(along, across, 0.0);
        assert!((found - right).abs() < 1e-12 * area() * 100.0, "{along} {across}: {found} {right}");
        // Turned by a quarter, the warp is along the axis: both exchange their parts.
        let turned = energy(&words, tube(&|s, z| upright(s / along, z / across)));
        let right = flat * exact(across, along, 0.0);
        assert!((turned - right).abs() < 1e-12 * area() * 100.0, "{along} {across}: {turned} {right}");
    }
    // Sheared: z is the image of (s - 0.1 z, z), so that f2 = (0.1, 1).
    let found = energy(&words, tube(&|s, z| around(s - 0.1 * z, z)));
    assert!((found / (area() * exact(1.0, 1.0, 0.1)) - 1.0).abs() < 1e-12, "{found}");
    // The scale of the mesh is not that of its pattern.
    let larger = with(&format!("mesh = {{ path = \"tube.obj\", scale = 1.05 }}\npattern.scale = {SCALE}\n{words}"), tube(&around), None);
    let (found, right) = (larger.unwrap().ledger().elastic, area() * exact(1.05, 1.05, 0.0));
    assert!((found / right - 1.0).abs() < 1e-12, "{found} {right}");
}

/// Springs along the edges, those of the seam too: E = sum k/2 (s l - l)², and k = 50 A_edge/l².
#[test]
fn links_have_the_lengths_of_the_pattern() {
    // Every triangle is a part of three edges: sum A_edge = 3 A.
    let found = energy("links = { structural = 50 }", tube(&|s, z| around(s / 1.1, z / 1.1)));
    let right = 0.5 * 50.0 * 3.0 * area() / 1.21 * 0.01;
    assert!((found / right - 1.0).abs() < 1e-12, "{found} {right}");
    // Links across edges are as long as two triangles side by side: on the tube they are shorter.
    let flat = energy("links = { structural = 50, bend = 1 }", tube(&around));
    let (l, dz) = (2.0 * RADIUS * (PI / SIDES as f64).sin(), HEIGHT / ROWS as f64);
    // Across upright edges the far corners are 2 l apart in the pattern and 2 l cos(pi/n) on the tube, dz higher or lower.
    let chord = 2.0 * l * (PI / SIDES as f64).cos();
    let (rest, now) = ((4.0 * l * l + dz * dz).sqrt(), (chord * chord + dz * dz).sqrt());
    let right = (SIDES * ROWS) as f64 * 0.5 * l * dz / (rest * rest) * (rest - now).powi(2);
    assert!((flat / right - 1.0).abs() < 1e-9, "{flat} {right}");
}

/// The pattern is flat, the tube has the curvature 1/R: E = B A/(2 R²), exactly so for (bending.6) on this mesh, along the seam too.
#[test]
fn a_pattern_is_flat_at_rest() {
    let right = 1e-3 * area() / (2.0 * RADIUS * RADIUS);
    for kind in ["hinge", "isometric"] {
        for texture in [around, upright] {
            let found = energy(&format!("{NO_LINKS}{kind} = 1e-3"), tube(&texture));
            assert!((found / right - 1.0).abs() < 1e-12, "{kind}: {found} {right}");
        }
    }
    // Without a pattern the dihedral hinge rests as it is.
    let found = with(&format!("mesh.path = \"tube.obj\"\n{NO_LINKS}hinge = 1e-3"), tube(&around), None).unwrap().ledger().elastic;
    assert!(found < 1e-24, "{found}");
}

#[test]
fn a_fabric_lies_as_the_pattern_says() {
    // One that is the same at every strain and curvature.
    let plain = Fabric {
        density: 0.3,
        stretching: [[200.0, 30.0, 900.0, 40.0]; 6],
        bending: [[1e-4; 5], [2e-4; 5], [5e-4; 5]],
        ..Fabric::default()
    };
    let energy = |angle: f64, texture: &dyn Fn(f64, f64) -> [f64; 2]| {
        let words = format!("mesh.path = \"tube.obj\"\npattern.scale = {SCALE}\nfabric = {{ path = \"it\", angle = {angle} }}");
        with(&words, tube(texture), Some(plain.clone())).unwrap().ledger().elastic
    };
    // Creases run along the axis: across the warp where that goes around the tube, along it where the pattern is turned.
    let bent = |b: f64| b * area() / (2.0 * RADIUS * RADIUS);
    for (angle, texture, b) in [
        (0.0, around as fn(f64, f64) -> [f64; 2], 5e-4),
        (90.0, around, 1e-4),
        (0.0, upright, 1e-4),
        (90.0, upright, 5e-4),
        (45.0, around, 2e-4),
    ] {
        let found = energy(angle, &texture);
        // Between the threads, triangles at both rims may warp: (bending.6).
        let least = if angle == 45.0 { 0.9 } else { 1.0 };
        assert!(found > (least - 1e-9) * bent(b) && found < (1.0 + 1e-9) * bent(b), "{angle}: {found} {}", bent(b));
    }
    // The same with a stretch around: E = A C e² of (fabrics.2), twice that of the membrane.
    let e = (1.1 * 1.1 - 1.0) / 2.0;
    for (texture, c, b) in [(around as fn(f64, f64) -> [f64; 2], 200.0, 5e-4), (upright, 900.0, 1e-4)] {
        let found = energy(0.0, &|s, z| texture(s / 1.1, z));
        // The pattern has 1/1.1 of the area, and is curved 1.1 times as much.
        let right = area() / 1.1 * c * e * e + 1.1 * bent(b);
        assert!((found / right - 1.0).abs() < 1e-9, "{found} {right}");
    }
}

#[test]
fn panels_may_be_turned_over() {
    let shear = |s: f64, z: f64| [s / 1.05 - 0.1 * z, z];
    let over = |s: f64, z: f64| [-shear(s, z)[0], shear(s, z)[1]];
    let words = |angle: f64| format!("{NO_LINKS}membrane = {{ warp = 300, weft = 20, angle = {angle} }}\nhinge = 1e-4\nisometric = 1e-4");
    let (plain, turned) = (energy(&words(0.0), tube(&shear)), energy(&words(0.0), tube(&over)));
    assert!((plain / turned - 1.0).abs() < 1e-12 && plain > 0.01, "{plain} {turned}");
    // The roll of cloth has one grain: what is cut from it and turned over has it mirrored.
    let (mirrored, left) = (energy(&words(30.0), tube(&over)), energy(&words(-30.0), tube(&shear)));
    assert!((mirrored / left - 1.0).abs() < 1e-12, "{mirrored} {left}");
    let right = energy(&words(30.0), tube(&shear));
    assert!((right / left - 1.0).abs() > 0.1, "{right} {left}");
}

#[test]
fn a_tube_that_was_cut_too_small_comes_to_rest_at_the_size_of_its_pattern() {
    let words = format!(
        "mesh = {{ path = \"tube.obj\", scale = 1.3 }}\npattern.scale = {SCALE}\nmembrane = {{ warp = 100, weft = 40, damping = 0.01 }}\n\
         [[system]]\nintegrator = \"implicit_euler\"\nsubsteps = 10\n[[force]]\nkind = \"drag\"\nrate = 5"
    );
    let mut sim = with(&words, tube(&around), None).unwrap();
    let stretched = sim.ledger().elastic;
    run(&mut sim, 72);
    let x = positions(&sim, "n");
    let (low, high) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x.z), h.max(x.z)));
    let books = sim.ledger();
    println!("height {:.4}, energy {:e} of {stretched:e}", high - low, books.elastic);
    assert!((high - low) / HEIGHT > 0.95 && (high - low) / HEIGHT < 1.01, "{}", high - low);
    assert!(books.elastic > 0.0 && books.elastic < 1e-3 && stretched > 1.0, "{} {stretched}", books.elastic);
}

#[test]
fn what_is_wrong_with_a_pattern_is_told_with_its_place() {
    let told = |mesh: Mesh| {
        let words = format!("mesh.path = \"tube.obj\"\npattern.scale = {SCALE}\n");
        match with(&words, mesh, None) {
            Ok(sim) => sim.warnings().iter().map(ToString::to_string).collect::<String>(),
            Err(message) => message,
        }
    };
    assert_eq!(told(tube(&around)), "");
    let none = told(Mesh { texture: Vec::new(), ..tube(&around) });
    assert!(none.contains("net \"n\".pattern") && none.contains("no texture coordinates") && none.contains("TEXCOORD_0"), "{none}");
    let mut some = tube(&around);
    some.texture[7] = None;
    let some = told(some);
    assert!(some.contains("triangle 7") && some.contains("around [") && some.contains("vt in OBJ"), "{some}");
    let line = told(tube(&|s, z| [s + z, s + z]));
    assert!(line.contains("triangle 0") && line.contains("no area") && line.contains("119 others"), "{line}");
    let tiny = told(tube(&|s, z| [0.1 * s, 0.1 * z]));
    // A tenth of the length: the scale should be ten times as large.
    assert!(tiny.contains("net \"n\".pattern.scale") && tiny.contains("scale of 20.0000"), "{tiny}");
    for factor in [1e-6, 1e3] {
        let absurd = told(tube(&|s, z| [factor * s, factor * z]));
        assert!(absurd.contains("net \"n\".pattern.scale") && absurd.contains("no cloth is stretched so"), "{absurd}");
    }
    let middle = RADIUS * PI;
    let folded = told(tube(&|s, z| [if s > middle { 2.0 * middle - s } else { s }, z]));
    assert!(folded.contains("folded over") && folded.contains("unwrap"), "{folded}");
    let refused =
        Scene::from_toml("version = 1\n[[net]]\nname = \"n\"\nmesh.path = \"x.obj\"\npattern.scale = 0\n").unwrap_err().to_string();
    assert!(refused.contains("pattern.scale"), "{refused}");
}

/// The longest edge of a tube over its length where nothing is strained, for places of its vertices and of them at rest.
fn longest(x: &[Vector], rest: &Mesh) -> f64 {
    let length = |a: Vector, b: Vector| (b - a).norm();
    let ratio = |([a, b], _): ([u32; 2], Vec<u32>)| {
        let [a, b] = [a as usize, b as usize];
        length(x[a], x[b]) / length(rest.vertices[a].into(), rest.vertices[b].into())
    };
    rest.edges().into_iter().map(ratio).fold(0.0, f64::max)
}

/// Membranes and fabrics have no links, but are stretched as well, whatever moves them.
#[test]
fn the_books_know_how_far_triangles_are_stretched() {
    let fabric = Fabric {
        density: 0.3,
        stretching: [[200.0, 30.0, 900.0, 40.0]; 6],
        bending: [[1e-4; 5], [2e-4; 5], [5e-4; 5]],
        ..Fabric::default()
    };
    for scheme in ["position_based", "implicit_euler", "velocity_verlet"] {
        for (words, counts) in [("membrane = { warp = 100 }", true), ("fabric = \"it\"", true), ("links = {}\narea = 100", false)] {
            let words = format!("mesh.path = \"tube.obj\"\n{words}\n[[system]]\nintegrator = \"{scheme}\"");
            let mut sim = with(&words, Mesh { texture: Vec::new(), ..tube(&around) }, Some(fabric.clone())).unwrap();
            let (rest, start) = (tube(&around), positions(&sim, "n"));
            for factors in [[1.0; 3], [1.0, 1.0, 1.25], [1.1, 1.1, 1.0], [0.5, 0.5, 0.5], [0.3, 1.4, 1.2]] {
                let x: Vec<Vector> =
                    start.iter().map(|x| Vector { x: factors[0] * x.x, y: factors[1] * x.y, z: factors[2] * x.z }).collect();
                write(&mut sim, "n", "position", &x);
                let (found, exact) = (sim.ledger().stretch, longest(&x, &rest));
                assert_eq!(found.is_some(), counts, "{words}");
                assert!(found.is_none_or(|found| (found - exact).abs() < 1e-12), "{words} {factors:?}: {found:?}, {exact}");
            }
        }
    }
    // The rest lengths are those of the pattern.
    let words = format!("mesh = {{ path = \"tube.obj\", scale = 1.3 }}\npattern.scale = {SCALE}\nmembrane = {{ warp = 100 }}");
    let found = with(&words, tube(&around), None).unwrap().ledger().stretch.unwrap();
    assert!((found - 1.3).abs() < 1e-12, "{found}");
}

#[test]
fn an_unsound_mesh_is_told_once() {
    let told = |change: &dyn Fn(&mut Mesh)| {
        let mut mesh = tube(&around);
        change(&mut mesh);
        with("mesh.path = \"tube.obj\"", mesh, None).unwrap().warnings().iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    assert!(told(&|_| ()).is_empty());
    for (change, words) in [
        ((|m| m.triangles.push(m.triangles[4])) as fn(&mut Mesh), "1 triangle is a duplicate"),
        (|m| m.triangles[30].swap(0, 1), "3 edges are between triangles that face different ways"),
        (|m| m.triangles.push([3, 3, 4]), "1 triangle has no area"),
        (|m| m.triangles.push([14, 27, 45]), "1 edge has more than two triangles"),
        (|m| m.unused = 3, "3 vertices belong to no triangle"),
    ] {
        let all = told(&|mesh| {
            mesh.texture.clear();
            change(mesh);
        });
        let right = all.len() == 1 && all[0].starts_with("net \"n\".mesh: ") && all[0].contains(words);
        assert!(right && all[0].ends_with("mend the file with `tumble check SCENE --repair`"), "{words}: {all:?}");
    }
}

#[test]
fn texture_goes_with_the_triangles() {
    let sim = with(&format!("mesh.path = \"tube.obj\"\npattern.scale = {SCALE}"), tube(&around), None).unwrap();
    let columns = sim.topology();
    let found = columns.iter().find(|c| c.object == "n" && c.name == "texture").unwrap();
    let Data::F32(uv) = &found.data else { panic!() };
    let given: Vec<f32> = tube(&around).texture.iter().flat_map(|c| c.unwrap().concat()).map(|x| x as f32).collect();
    assert!(found.width == 6 && *uv == given && given.iter().any(|x| *x > 0.5));
    let bare = with("mesh.path = \"tube.obj\"", Mesh { texture: Vec::new(), ..tube(&around) }, None).unwrap();
    assert!(bare.topology().iter().all(|c| c.name != "texture"));
}
