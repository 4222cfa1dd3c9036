//! Solids whose edges and triangles meet those of what is soft: what is thin or sharp stops cloth whose masses pass it.    (contact.23)

use crate::common;

use common::{Vector, positions, simulation, step, vector, velocities};
use std::collections::HashMap;
use tumble_f64::math::rotation::from_degrees;
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Engine, Mesh, Scene};

const G: f64 = 9.8;
/// Of the collider; that of `self_contact` is 0.008.
const THICKNESS: f64 = 0.005;

fn system(words: &str) -> String {
    format!(
        "precision = \"double\"\ntime.fps = 60\nworld.gravity = [0, 0, -{G}]\n[[system]]\n{words}\n\
         self_contact = {{ thickness = 0.008, friction = 0.1 }}\n"
    )
}

fn position_based() -> String {
    system("method = \"position_based\"\nsubsteps = 12")
}

/// A square sheet of 0.4 m whose masses are 0.02 m apart.
fn sheet(words: &str) -> String {
    format!(
        "[[sheet]]\nname = \"cloth\"\nsize = [0.4, 0.4]\nresolution = [21, 21]\ndensity = 0.2\n\
         links = {{ structural = {{ modulus = 100, damping = 0.02 }}, shear = 30 }}\nhinge = 1e-5\n{words}\n"
    )
}

/// A collider of this shape, its edges met or not.
fn solid(shape: &str, edges: bool, words: &str) -> String {
    format!("[[collider]]\nname = \"solid\"\nthickness = {THICKNESS}\nfriction = 0.5\nedges = {edges}\nshape.{shape}\n{words}\n")
}

/// 16 mm thick with its thickness, in the middle between two rows of masses.
const WIRE: &str = "capsule = { from = [0, -0.3, 0], to = [0, 0.3, 0], radius = 0.003 }";
const ABOVE_WIRE: &str = "center = [0.01, 0, 0.03]";

fn lowest(x: &[Vector]) -> f64 {
    x.iter().map(|x| x.z).fold(f64::INFINITY, f64::min)
}

fn highest(x: &[Vector]) -> f64 {
    x.iter().map(|x| x.z).fold(f64::NEG_INFINITY, f64::max)
}

/// Distances of the middles of a sheet's links from the axis through the origin along y.
fn beside_axis(x: &[Vector]) -> f64 {
    let middle = |i: usize| (x[i] + x[i + 1]) * 0.5;
    (0..x.len()).filter(|i| i % 21 != 20).map(|i| middle(i).x.hypot(middle(i).z)).fold(f64::INFINITY, f64::min)
}

fn frame(sim: &mut Simulation, crossed: &mut u64) {
    step(sim);
    *crossed += sim.ledger().intersections.unwrap();
}

/// Under every kind of scheme. Without edges the cloth falls on as if there were no wire.
#[test]
fn cloth_stays_on_a_wire_that_passes_between_its_masses() {
    let schemes = [
        "method = \"position_based\"\nsubsteps = 12",
        "method = \"position_based\"\nsubsteps = 4\nposition_based.iterations = 4",
        "integrator = \"implicit_euler\"\nsubsteps = 8",
        "integrator = \"symplectic_euler\"\nsubsteps = 60",
        "integrator = \"dormand_prince\"",
    ];
    for words in common::cases(schemes, 3) {
        let scene = |edges: bool| simulation(&format!("{}{}{}", system(words), sheet(ABOVE_WIRE), solid(WIRE, edges, "")));
        let (mut held, mut free, mut crossed) = (scene(true), scene(false), 0);
        for _ in 0..30 {
            frame(&mut held, &mut crossed);
            step(&mut free);
        }
        let (on, gone) = (positions(&held, "cloth"), positions(&free, "cloth"));
        println!(
            "{words:?}: {:.4} to {:.4} m, {:.4} m from the axis, without edges {:.3} m",
            lowest(&on),
            highest(&on),
            beside_axis(&on),
            highest(&gone)
        );
        assert_eq!(crossed, 0, "{words}");
        // Half a second of free fall.
        assert!(highest(&gone) < -1.0, "{words}");
        // It lies on the wire, and its sides hang down from it; where nothing damps them they swing and pull it some way to one side:
        // measured -0.17 to -0.29 m, as its bending changes by a tenth.
        assert!((0.003..0.02).contains(&highest(&on)), "{words}");
        assert!((-0.3..-0.12).contains(&lowest(&on)), "{words}");
    }
}

/// So does a rope, whose edges belong to no triangle.
#[test]
fn a_rope_stays_on_a_wire_that_passes_between_its_masses() {
    let rope = "[[rope]]\nname = \"cloth\"\nfrom = [-0.26, 0, 0.03]\nto = [0.24, 0, 0.03]\nsegments = 11\ndensity = 0.05\nlinks = { structural = 500, bend = 1 }\n";
    let scene = |edges: bool| simulation(&format!("{}{rope}{}", position_based(), solid(WIRE, edges, "")));
    let (mut with, mut without, mut crossed) = (scene(true), scene(false), 0);
    for _ in 0..30 {
        frame(&mut with, &mut crossed);
        step(&mut without);
    }
    let [on, gone] = [&with, &without].map(|sim| positions(sim, "cloth"));
    println!("on the wire {:.4} to {:.4} m, without edges {:.4} m", lowest(&on), highest(&on), highest(&gone));
    assert_eq!(crossed, 0);
    assert!((0.0..0.03).contains(&highest(&on)) && lowest(&on) > -0.32 && highest(&gone) < -1.0);
}

/// Whatever shape has corners: a thin prism as a mesh, as a shell without its ends and as a mesh that rises, and a small ball under the middle
/// of four masses.
#[test]
fn edges_of_every_kind_of_solid_are_met() {
    let prism = |ends: bool, z: f64| {
        let section = [[-0.003, -0.003], [0.003, -0.003], [0.0, 0.003]];
        let corner = |y: f64| move |[x, h]: [f64; 2]| [x, y, h + z];
        let mut triangles: Vec<[u32; 3]> = (0..3).flat_map(|i| [[i, i + 3, (i + 1) % 3], [(i + 1) % 3, i + 3, (i + 1) % 3 + 3]]).collect();
        triangles.extend([[0, 1, 2], [3, 5, 4]].into_iter().filter(|_| ends));
        Mesh { vertices: section.map(corner(-0.3)).into_iter().chain(section.map(corner(0.3))).collect(), triangles, ..Mesh::default() }
    };
    let meshes = [("solid", prism(true, 0.0)), ("open", prism(false, 0.0)), ("higher", prism(true, 0.1))];
    let assets = Assets::new(meshes.map(|(name, mesh)| (name.to_string(), mesh)).into(), HashMap::new());
    let shapes = [
        ("mesh = { path = \"solid\" }", ABOVE_WIRE, 0.0),
        ("mesh = { path = \"open\", shell = true }", ABOVE_WIRE, 0.0),
        ("animated_mesh = { frames = [{ time = 0, path = \"solid\" }, { time = 0.5, path = \"higher\" }] }", ABOVE_WIRE, 0.1),
        ("sphere = { center = [0, 0, 0], radius = 0.002 }", "center = [0.01, 0.01, 0.02]", 0.0),
    ];
    for (shape, above, at) in common::cases(shapes, 2) {
        let scene = |edges: bool| {
            let text = format!("version = 1\n{}{}{}", position_based(), sheet(above), solid(shape, edges, ""));
            Simulation::new(Scene::from_toml(&text).unwrap(), assets.clone()).unwrap_or_else(|e| panic!("{e}\n{text}"))
        };
        let (mut with, mut without, mut crossed) = (scene(true), scene(false), 0);
        for _ in 0..30 {
            frame(&mut with, &mut crossed);
            step(&mut without);
        }
        let [on, gone] = [&with, &without].map(|sim| positions(sim, "cloth"));
        println!("{shape}: {:.4} m, without edges {:.4} m", highest(&on), highest(&gone));
        assert_eq!(crossed, 0, "{shape}");
        assert!((at..at + 0.03).contains(&highest(&on)) && highest(&gone) < -0.5, "{shape}");
    }
}

/// If only masses collide with it, links cut through the corner.
#[test]
fn nothing_cuts_into_the_edge_of_a_box() {
    let scene = |edges: bool| {
        let shape = "box = { center = [0, 0, -0.1], size = [0.1, 0.5, 0.2], rotate = [0, 0, 0] }";
        simulation(&format!("{}{}{}", position_based(), sheet("center = [0.013, 0, 0.01]"), solid(shape, edges, "")))
    };
    // The deepest middle of a link along x below the surface of the box.
    let deepest = |x: &[Vector]| {
        let middle = |i: usize| (x[i] + x[i + 1]) * 0.5;
        let depth = |p: Vector| (0.05 - p.x.abs()).min(-p.z);
        (0..x.len()).filter(|i| i % 21 != 20).map(|i| depth(middle(i))).fold(f64::NEG_INFINITY, f64::max)
    };
    let (mut with, mut without, mut crossed) = (scene(true), scene(false), 0);
    let mut depths = [f64::NEG_INFINITY; 2];
    for _ in 0..45 {
        frame(&mut with, &mut crossed);
        step(&mut without);
        depths[0] = depths[0].max(deepest(&positions(&with, "cloth")));
        depths[1] = depths[1].max(deepest(&positions(&without, "cloth")));
    }
    println!("middles of links at most {:.4} m deep with edges, {:.4} m without", depths[0], depths[1]);
    assert_eq!(crossed, 0);
    assert!(depths[0] < 0.0 && depths[1] > 0.001, "{depths:?}");
}

/// One of the corners of a lathe, between four masses.
#[test]
fn a_sheet_does_not_pass_the_tip_of_a_cone() {
    let shape = "lathe = { center = [0, 0, -0.3], profile = [[0, 0], [0.03, 0], [0, 0.3]], sides = 12 }";
    let scene = |edges: bool| {
        simulation(&format!(
            "{}{}{}",
            position_based(),
            sheet("center = [0.01, 0.01, 0.02]"),
            solid(shape, edges, "motion.spin = [0, 0, 3]")
        ))
    };
    let (mut with, mut without, mut crossed) = (scene(true), scene(false), 0);
    for _ in 0..30 {
        frame(&mut with, &mut crossed);
        step(&mut without);
    }
    let [on, gone] = [&with, &without].map(|sim| positions(sim, "cloth"));
    println!("on the tip {:.4} m, without edges {:.4} m", highest(&on), highest(&gone));
    assert_eq!(crossed, 0);
    assert!(highest(&on) > 0.0 && highest(&gone) < -0.02);
}

/// Masses meet its face as ever, with all of the friction.
#[test]
fn a_sheet_on_a_tilted_box_slides_beyond_the_angle_of_friction() {
    let limit = 0.5_f64.atan().to_degrees();
    let way = |words: &str, degrees: f64| {
        let system = system(words);
        let tilt = from_degrees([0.0, degrees, 0.0]);
        let c = tilt.turn(vector(0.0, 0.0, 2.0 * THICKNESS));
        let place = format!("center = [{:e}, 0, {:e}]\nrotate = [0, {degrees:e}, 0]", c.x, c.z);
        let top = tilt.turn(vector(0.0, 0.0, -0.1));
        let shape = format!("box = {{ center = [{:e}, 0, {:e}], size = [3, 1, 0.2], rotate = [0, {degrees:e}, 0] }}", top.x, top.z);
        let mut sim = simulation(&format!("{system}{}{}", sheet(&place), solid(&shape, true, "")));
        let along = tilt.turn(vector(1.0, 0.0, 0.0));
        let at = |sim: &Simulation| positions(sim, "cloth").iter().map(|x| x.dot(along)).sum::<f64>() / 441.0;
        // Until it lies.
        (0..15).for_each(|_| _ = step(&mut sim));
        let (start, v) = (at(&sim), velocities(&sim, "cloth").iter().map(|v| v.dot(along)).sum::<f64>() / 441.0);
        (0..30).for_each(|_| _ = step(&mut sim));
        at(&sim) - start - 0.5 * v
    };
    for words in ["method = \"position_based\"\nsubsteps = 12", "integrator = \"implicit_euler\"\nsubsteps = 8"] {
        let (rests, slides) = (way(words, limit - 1.0), way(words, limit + 1.0));
        let a = (limit + 1.0).to_radians();
        let exact = 0.5 * G * (a.sin() - 0.5 * a.cos()) * 0.25;
        println!("{words:?}: below the angle {rests:.5} m in half a second, above {slides:.5} m of {exact:.5} m");
        // Implicit Euler creeps by at most 1 mm each second (contact.8).
        assert!(rests.abs() < 1e-3 && (slides / exact - 1.0).abs() < 0.1, "{words}: {rests} {slides}");
    }
}

/// Cloth that hangs down farther on one side slides off a wire without friction, and stays on one with it.
#[test]
#[ignore = "long: make validate"]
fn friction_holds_what_hangs_on_a_wire() {
    let top = |friction: f64| {
        let wire = solid(WIRE, true, "").replace("friction = 0.5", &format!("friction = {friction}"));
        // It comes down slowly, as in water.
        let water = "[[force]]\nkind = \"drag\"\nrate = 8\n";
        let mut sim = simulation(&format!("{}{}{wire}{water}", position_based(), sheet("center = [0.03, 0, 0.012]")));
        (0..if common::whole() { 120 } else { 80 }).for_each(|_| _ = step(&mut sim));
        highest(&positions(&sim, "cloth"))
    };
    let (held, free) = (top(0.5), top(0.0));
    println!("its top is at {held:.4} m with friction, {free:.4} m without");
    assert!(held > 0.0 && free < -0.1, "{held} {free}");
}

const BLOCK: &str = "box = { center = [0, 0, -0.1], size = [1, 1, 0.2] }";

/// In touch, exactly or nearly, it is put where the thickness ends, at rest.
#[test]
fn what_starts_on_a_solid_lies_on_it() {
    let schemes = [
        "method = \"position_based\"\nsubsteps = 12",
        "integrator = \"velocity_verlet\"\nsubsteps = 60",
        "integrator = \"dormand_prince\"",
    ];
    for (z, speed) in [(0.0, 0.05), (1e-12, 0.05), (0.001, 0.05)] {
        for words in schemes {
            let mut sim = simulation(&format!("{}{}{}", system(words), sheet(&format!("center = [0, 0, {z:e}]")), solid(BLOCK, true, "")));
            let mut fastest = 0.0_f64;
            for _ in 0..3 {
                step(&mut sim);
                fastest = fastest.max(sim.ledger().speed.unwrap());
            }
            let x = positions(&sim, "cloth");
            let aside = x.iter().map(|x| x.x).sum::<f64>() / 441.0;
            println!("{words:?} from {z} m: {:.6} to {:.6} m, at most {fastest:.4} m/s", lowest(&x), highest(&x));
            assert!(lowest(&x) > 0.95 * THICKNESS && fastest < speed && aside.abs() < 1e-5, "{words} {z} {aside}");
            assert!(highest(&x) < 1.05 * THICKNESS, "{words} {z}");
        }
    }
}

/// Masses are put out of what they start in, and nothing holds them back.
#[test]
fn what_starts_in_a_solid_comes_out() {
    let mut sim = simulation(&format!("{}{}{}", position_based(), sheet("center = [0, 0, -0.02]"), solid(BLOCK, true, "")));
    step(&mut sim);
    let x = positions(&sim, "cloth");
    println!("{:.6} to {:.6} m", lowest(&x), highest(&x));
    assert!(lowest(&x) > 0.95 * THICKNESS && highest(&x) < 1.05 * THICKNESS);
}

/// Masses pinned inside a solid are not tangled with it, and hang as with contact of masses only.
#[test]
fn what_is_nailed_to_a_solid_hangs_from_it() {
    let pole = "capsule = { from = [-0.2, 0, -1], to = [-0.2, 0, 1], radius = 0.01 }";
    let flag = sheet("rotate = [90, 0, 0]\npin = [\"edge x-\"]");
    let mut crossed = 0;
    let stretch = [true, false].map(|edges| {
        let mut sim = simulation(&format!("{}{flag}{}", position_based(), solid(pole, edges, "")));
        assert!(!edges || sim.warnings().is_empty(), "{:?}", sim.warnings());
        let mut most = 0.0_f64;
        for _ in 0..30 {
            frame(&mut sim, &mut crossed);
            most = most.max(sim.ledger().stretch.unwrap());
        }
        most
    });
    println!("stretched to {:.3} with edges, {:.3} without", stretch[0], stretch[1]);
    assert!(crossed == 0 && stretch[0] < 1.1 * stretch[1], "{crossed} {stretch:?}");
}

/// Between masses, edges alone touch the wire; its belt runs along it.
#[test]
#[ignore = "long: make validate"]
fn a_belt_on_a_wire_takes_along_what_hangs_on_it() {
    let wire = solid(WIRE, true, "belt = [0, 0.2, 0]");
    let water = "[[force]]\nkind = \"drag\"\nrate = 0.5\n";
    let mut sim = simulation(&format!("{}{}{wire}{water}", position_based(), sheet("center = [0.01, 0, 0.012]")));
    (0..60).for_each(|_| _ = step(&mut sim));
    let v = velocities(&sim, "cloth").iter().map(|v| v.y).sum::<f64>() / 441.0;
    println!("{v:.4} m/s along the wire");
    // Drag is 0.1 m/s² at that speed, friction about half of gravity.
    assert!((v / 0.2 - 1.0).abs() < 0.1, "{v}");
}

/// Masses bounce off faces as they do where masses alone meet them.
#[test]
fn faces_return_what_falls_on_them() {
    let top = |edges: bool| {
        let box_ = solid(BLOCK, edges, "restitution = 0.7");
        let mut sim = simulation(&format!("{}{}{box_}", position_based(), sheet("center = [0, 0, 0.15]")));
        // It lands after 0.17 s.
        (0..11).for_each(|_| _ = step(&mut sim));
        let rise = |sim: &Simulation| velocities(sim, "cloth").iter().map(|v| v.z).sum::<f64>() / 441.0;
        rise(&sim)
    };
    let (with, without) = (top(true), top(false));
    println!("{with:.4} m/s upwards with edges, {without:.4} m/s without");
    assert!(without > 0.5 && (with / without - 1.0).abs() < 0.05, "{with} {without}");
}

/// A wire that rises takes the sheet along, one that goes through a hanging sheet from the side pushes it; nothing passes.
#[test]
fn wires_that_move_carry_what_lies_on_them() {
    let lifted = solid(WIRE, true, "motion.velocity = [0, 0, 0.5]");
    let mut sim = simulation(&format!("{}{}{lifted}", position_based(), sheet(ABOVE_WIRE)));
    let mut crossed = 0;
    let mut nearest = f64::INFINITY;
    for k in 1..=60 {
        frame(&mut sim, &mut crossed);
        let x: Vec<Vector> = positions(&sim, "cloth").iter().map(|x| *x - vector(0.0, 0.0, 0.5 * f64::from(k) / 60.0)).collect();
        nearest = nearest.min(beside_axis(&x));
    }
    let x = positions(&sim, "cloth");
    println!("lifted to {:.4} m, edges at least {nearest:.5} m from the axis", highest(&x));
    assert!((0.5..0.53).contains(&highest(&x)) && crossed == 0, "{} {crossed}", highest(&x));
    // Position of the wire at the end of a step, 0.7 mm above its start (contact.23).
    assert!(nearest > 0.003 + 0.9 * THICKNESS - 1e-4, "{nearest}");

    let bar = "capsule = { from = [-0.3, -0.05, -0.11], to = [0.3, -0.05, -0.11], radius = 0.003 }";
    let pushed = solid(bar, true, "motion.velocity = [0, 1, 0]");
    let hung = sheet("rotate = [90, 0, 0]\npin = [\"edge y+\"]");
    let mut sim = simulation(&format!("{}{hung}{pushed}", position_based()));
    let before = positions(&sim, "cloth").iter().map(|x| x.y).sum::<f64>() / 441.0;
    (0..9).for_each(|_| frame(&mut sim, &mut crossed));
    let after = positions(&sim, "cloth").iter().map(|x| x.y).sum::<f64>() / 441.0;
    println!("pushed by {:.4} m on average", after - before);
    assert!(after - before > 0.03 && crossed == 0, "{before} {after} {crossed}");
}

/// A belt runs under what lies on it and takes it along.
#[test]
fn belts_take_along_what_lies_on_them() {
    let shape = "box = { center = [0, 0, -0.1], size = [3, 1, 0.2] }";
    let belt = solid(shape, true, "belt = [0.3, 0, 0]");
    let mut sim = simulation(&format!("{}{}{belt}", position_based(), sheet(&format!("center = [0, 0, {}]", 1.1 * THICKNESS))));
    (0..60).for_each(|_| _ = step(&mut sim));
    let v = velocities(&sim, "cloth").iter().map(|v| v.x).sum::<f64>() / 441.0;
    println!("{v:.5} m/s");
    assert!((v / 0.3 - 1.0).abs() < 0.01, "{v}");
}

/// A start through a solid gives a warning with its name, and so do edges of a plane.
#[test]
fn words_about_edges_name_the_solid() {
    let through = simulation(&format!("{}{}{}", position_based(), sheet("rotate = [0, 90, 0]"), solid(WIRE, true, "")));
    let told = through.warnings().iter().map(ToString::to_string).collect::<String>();
    assert!(told.contains("\"cloth\" passes through \"solid\""), "{told}");
    let account = through.account();
    let crossing = account.worst.iter().find(|worst| worst.measure == "intersections").unwrap();
    assert!(crossing.object == "cloth" && crossing.other.as_deref() == Some("solid") && crossing.value > 0.0, "{crossing:?}");
    let text = format!("version = 1\n{}{}{}", position_based(), sheet(""), solid("floor.height = -1", true, ""));
    let error = Simulation::new(Scene::from_toml(&text).unwrap(), Default::default()).err().unwrap().to_string();
    assert!(error.contains("collider \"solid\".edges") && error.contains("a plane has none"), "{error}");
}
