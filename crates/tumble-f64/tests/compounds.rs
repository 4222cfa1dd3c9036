//! Bodies of several parts, and meshes with hollows. See docs/theory/rigid.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, column, run};
use std::f64::consts::TAU;
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Data, Engine, Mesh, Scene};

/// A ring of n flat sides about z, between two radii, from -h/2 to h/2.
fn ring(n: u32, [inner, outer]: [f64; 2], h: f64) -> Mesh {
    let corner = |k: u32| {
        let (angle, r) = (TAU * f64::from(k / 4) / f64::from(n), if k % 4 < 2 { outer } else { inner });
        [r * angle.cos(), r * angle.sin(), if k.is_multiple_of(2) { -0.5 * h } else { 0.5 * h }]
    };
    // Outer bottom, outer top, inner bottom, inner top of each corner.
    let quads = (0..n).flat_map(|i| {
        let [a, b] = [4 * i, 4 * ((i + 1) % n)];
        [[a, b, b + 1, a + 1], [b + 2, a + 2, a + 3, b + 3], [a + 1, b + 1, b + 3, a + 3], [b, a, a + 2, b + 2]]
    });
    let triangles = quads.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    Mesh { vertices: (0..4 * n).map(corner).collect(), triangles: triangles.collect(), ..Mesh::default() }
}

/// A scene with the mesh `thing.obj`.
fn with_mesh(mesh: Mesh, words: &str) -> Result<Simulation, String> {
    let text = format!("version = 1\ntime.fps = 100\n{words}\n");
    let assets = Assets::new([("thing.obj".to_string(), mesh)].into(), Default::default());
    Simulation::new(Scene::from_toml(&text).unwrap(), assets).map_err(|error| error.to_string())
}

fn scene(words: &str) -> Simulation {
    with_mesh(Mesh::default(), words).unwrap()
}

/// Extent of the surface that pictures show, about the centre of mass in the axes of the body.
fn extent(sim: &Simulation, object: &str) -> [Vector; 2] {
    let topology = sim.topology();
    let column = topology.iter().find(|column| column.object == object && column.name == "vertices").unwrap();
    let Data::F64(numbers) = &column.data else { panic!("no numbers") };
    let far = f64::INFINITY;
    numbers.chunks_exact(3).fold([Vector::from([far; 3]), Vector::from([-far; 3])], |[low, high], p| {
        [[low.x.min(p[0]), low.y.min(p[1]), low.z.min(p[2])].into(), [high.x.max(p[0]), high.y.max(p[1]), high.z.max(p[2])].into()]
    })
}

#[test]
fn a_box_of_two_halves_is_the_box() {
    let rest = "world.gravity = [0, 0, 0]\n[[body]]\nname = \"box\"\nangular_velocity = [[3, 5, 2]]\ndensity = 700\n";
    let whole = format!("{rest}shape = {{ box = {{ size = [0.5, 0.2, 0.3] }} }}");
    let halves = format!(
        "{rest}[[body.shape.compound.parts]]\nshape = {{ box = {{ size = [0.25, 0.2, 0.3] }} }}\nposition = [1, 0, 0]\n\
        [[body.shape.compound.parts]]\nshape = {{ box = {{ size = [0.2, 0.25, 0.3] }} }}\nposition = [1.25, 0, 0]\nrotate = [0, 0, 90]"
    );
    let [one, two] = [&whole, &halves].map(|words| {
        let mut sim = scene(words);
        let start = sim.ledger();
        run(&mut sim, 100);
        (start, column(&sim, "box", "angular_velocity")[0], sim)
    });
    assert!((two.0.mass / one.0.mass - 1.0).abs() < 1e-12 && (one.0.mass - 21.0).abs() < 1e-9, "{} kg", two.0.mass);
    assert!((two.0.kinetic / one.0.kinetic - 1.0).abs() < 1e-9 && one.0.kinetic > 1.0);
    // Principal axes of a sum are found to some 1e-8, which 6 rad/s make 1e-6 within a second.
    assert!((two.1 - one.1).norm() < 2e-6 && (one.1 - Vector::from([3.0, 5.0, 2.0])).norm() > 1.0, "{:?} {:?}", one.1, two.1);
}

#[test]
fn a_hammer_has_its_centre_of_mass_where_its_parts_say() {
    // A handle of 0.6 kg and a head of 2.4 kg, 0.4 m above its middle.
    let words = "[[body]]\nname = \"hammer\"\ndensity = 600\n\
        [[body.shape.compound.parts]]\nshape = { box = { size = [0.04, 0.05, 0.5] } }\n\
        [[body.shape.compound.parts]]\nshape = { box = { size = [0.06, 0.05, 0.1] } }\nposition = [0, 0, 0.4]\ndensity = 8000\n";
    let sim = scene(words);
    let mass = [600.0 * 0.001, 8000.0 * 0.0003];
    assert!((sim.ledger().mass - mass[0] - mass[1]).abs() < 1e-12);
    let center = 0.4 * mass[1] / (mass[0] + mass[1]);
    // Principal axes are those of the parts, in some order and direction: the longest extent is that along the handle.
    let [low, high] = extent(&sim, "hammer");
    let parts = [[low.x, high.x], [low.y, high.y], [low.z, high.z]];
    let [low, high] = parts.into_iter().find(|[low, high]| high - low > 0.5).unwrap();
    let ends = [0.25 + center, 0.45 - center];
    assert!((low.abs().max(high) - ends[0]).abs() < 1e-9 && (low.abs().min(high) - ends[1]).abs() < 1e-9, "{low} {high}, {ends:?}");
}

#[test]
fn a_table_stands_on_its_legs_over_a_box() {
    let leg = |x: f64, y: f64| {
        format!("[[body.shape.compound.parts]]\nshape = {{ box = {{ size = [0.1, 0.1, 0.5] }} }}\nposition = [{x}, {y}, 0.25]\n")
    };
    let legs = [leg(-0.45, -0.45), leg(0.45, -0.45), leg(-0.45, 0.45), leg(0.45, 0.45)].concat();
    let floor = "[[collider]]\nname = \"floor\"\nshape = { floor = {} }\n";
    let words = format!(
        "[[body]]\nname = \"box\"\nshape = {{ box = {{ size = [0.6, 0.6, 0.4] }} }}\nposition = [[0, 0, 0.2]]\n{floor}\
        [[body]]\nname = \"table\"\nposition = [[0, 0, 0.45]]\n[[body.shape.compound.parts]]\nshape = {{ box = {{ size = [1, 1, 0.1] }} }}\nposition = [0, 0, 0.55]\n{legs}"
    );
    let mut sim = scene(&words);
    // Its centre of mass is at (0.1 · 0.55 + 0.02 · 0.25)/0.12 = 0.5 m.
    run(&mut sim, 100);
    let (table, within) = (column(&sim, "table", "position")[0], column(&sim, "box", "position")[0]);
    assert!((table - Vector::from([0.0, 0.0, 0.5])).norm() < 1e-3, "{table:?}");
    assert!((within - Vector::from([0.0, 0.0, 0.2])).norm() < 1e-3 && sim.ledger().speed.unwrap() < 1e-3, "{within:?}");
}

const RING: &str = "[[body]]\nname = \"ring\"\nposition = [[0, 0, 1.2]]\nrotate = [[5, 0, 0]]\nfriction = 0.2\n";
const POLE: &str = "[[collider]]\nname = \"floor\"\nshape = { floor = {} }\n\
    [[collider]]\nname = \"pole\"\nshape = { box = { center = [0, 0, 0.5], size = [0.1, 0.1, 1] } }\n";

#[test]
fn a_ring_falls_over_a_pole_and_its_hull_does_not() {
    let fallen = |shape: &str| {
        let mut sim = with_mesh(ring(12, [0.3, 0.45], 0.1), &format!("{RING}{shape}\n{POLE}")).unwrap();
        assert!(sim.warnings().is_empty(), "{:?}", sim.warnings());
        run(&mut sim, 150);
        column(&sim, "ring", "position")[0].z
    };
    let [hollow, filled] = ["shape.concave.mesh.path = \"thing.obj\"", "shape.mesh.path = \"thing.obj\""].map(fallen);
    assert!((hollow - 0.05).abs() < 5e-3 && filled > 0.3, "{hollow} m, {filled} m");
}

#[test]
fn a_ring_has_the_mass_and_the_moments_of_a_ring() {
    let (n, [a, b], h) = (24, [0.3_f64, 0.45], 0.1);
    let words =
        "world.gravity = [0, 0, 0]\n[[body]]\nname = \"ring\"\nshape.concave.mesh.path = \"thing.obj\"\nangular_velocity = [[0, 0, 2]]";
    let sim = with_mesh(ring(n, [a, b], h), words).unwrap();
    // A regular polygon of the circumradius r has the area n r² sin(2 pi/n)/2 and the polar moment A r² (2 + cos(2 pi/n))/6.
    let angle = TAU / f64::from(n);
    let area = |r: f64| 0.5 * f64::from(n) * r * r * angle.sin();
    let polar = |r: f64| area(r) * r * r * (2.0 + angle.cos()) / 6.0;
    let (mass, moment) = (1000.0 * h * (area(b) - area(a)), 1000.0 * h * (polar(b) - polar(a)));
    let ledger = sim.ledger();
    assert!((ledger.mass / mass - 1.0).abs() < 1e-9 && mass > 30.0, "{} kg of {mass}", ledger.mass);
    assert!((ledger.kinetic / (2.0 * moment) - 1.0).abs() < 1e-9, "{} J of {}", ledger.kinetic, 2.0 * moment);
}

#[test]
fn masses_of_other_systems_fall_through_the_hole_of_a_ring_and_rest_on_its_rim() {
    let words = "[[body]]\nname = \"ring\"\nshape.concave.mesh.path = \"thing.obj\"\nposition = [[0, 0, 0.06]]\nthickness = 0.01\n\
        [[particles]]\nname = \"drops\"\nposition = [[0, 0, 0.5], [0.375, 0, 0.5]]\nmass = [1e-3]\n\
        [[collider]]\nname = \"floor\"\nshape = { floor = {} }\nfriction = 0.5\nthickness = 0.01\n";
    let mut sim = with_mesh(ring(12, [0.3, 0.45], 0.1), words).unwrap();
    run(&mut sim, 100);
    let x = column(&sim, "drops", "position");
    // The ring lies 0.01 m above the floor, the other one 0.01 m above the ring.
    assert!((x[0].z - 0.01).abs() < 2e-3 && (x[1].z - 0.12).abs() < 2e-3, "{x:?}");
}

#[test]
fn meshes_that_enclose_nothing_are_told_with_their_cure() {
    let words = "[[body]]\nname = \"ring\"\nshape.concave.mesh.path = \"thing.obj\"";
    let told = |mesh: Mesh| with_mesh(mesh, words).err().unwrap();
    let mut open = ring(12, [0.3, 0.45], 0.1);
    open.triangles.remove(5);
    let message = told(open);
    assert!(
        message.contains("body \"ring\".shape.concave.mesh: the mesh is not closed: 3 open edges") && message.contains("close the hole"),
        "{message}"
    );
    let mut inwards = ring(12, [0.3, 0.45], 0.1);
    inwards.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let message = told(inwards);
    assert!(message.contains("its triangles face inwards") && message.contains("--repair"), "{message}");
    let flat = "[[body]]\nname = \"a\"\n[[body.shape.compound.parts]]\nshape.sphere.radius = 1\n\
        [[body.shape.compound.parts]]\nshape.hull.points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]";
    let message = with_mesh(Mesh::default(), flat).err().unwrap();
    assert!(message.contains("body \"a\".shape.compound.parts[1].shape.hull.points: the points lie in a plane"), "{message}");
    let few = "[[body]]\nname = \"ring\"\nshape.concave = { mesh = { path = \"thing.obj\" }, most = 3 }";
    let sim = with_mesh(ring(12, [0.3, 0.45], 0.1), few).unwrap();
    let warnings: Vec<String> = sim.warnings().iter().map(ToString::to_string).collect();
    assert!(warnings.len() == 1 && warnings[0].contains("more than its mesh; raise most"), "{warnings:?}");
}
