//! Where the bodies of an object stand. See docs/theory/rigid.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, column, simulation, step};
use tumble_f64::math::Quat;
use tumble_f64::scene::Simulation;
use tumble_interface::{Data, Engine, Scene};

/// A scene of bodies without gravity.
fn scene(seed: u32, words: &str) -> Simulation {
    simulation(&format!("seed = {seed}\nworld.gravity = [0, 0, 0]\n[[body]]\nname = \"bodies\"\n{words}\n"))
}

fn turns(sim: &Simulation) -> Vec<Quat<f64>> {
    let frame = sim.frame(&[]);
    match &frame.column("bodies", "turn").unwrap().data {
        Data::F64(numbers) => numbers.chunks_exact(4).map(|q| Quat::from_row([q[0], q[1], q[2], q[3]])).collect(),
        other => panic!("{other:?}"),
    }
}

fn places(sim: &Simulation) -> Vec<Vector> {
    column(sim, "bodies", "position")
}

#[test]
fn strewn_bodies_fill_their_box_and_do_not_touch() {
    let words =
        "shape = { box = { size = [0.3, 0.1, 0.2] } }\nposition = [[1, 2, 3]]\narrange = { scatter = { count = 80, size = [2, 1, 1.5] } }";
    let mut sim = scene(1, words);
    let (x, q) = (places(&sim), turns(&sim));
    // Corners are within the box, and come close to each of its sides.
    let mut reach = [0.0_f64; 6];
    for (x, q) in x.iter().zip(&q) {
        for k in 0..8 {
            let sign = |bit: u32| if k >> bit & 1 == 0 { -0.5 } else { 0.5 };
            let corner = *x + q.turn(Vector::from([0.3 * sign(0), 0.1 * sign(1), 0.2 * sign(2)])) - Vector::from([1.0, 2.0, 3.0]);
            let parts = [corner.x, corner.y / 0.5, corner.z / 0.75];
            (0..3).for_each(|a| {
                reach[a] = reach[a].max(parts[a]);
                reach[a + 3] = reach[a + 3].max(-parts[a]);
            });
        }
    }
    assert!(reach.iter().all(|part| (0.95..1.0 + 1e-12).contains(part)), "{reach:?}");
    // Of a direction that is turned at random the mean square of a component is 1/3, with a standard deviation of 0.3/sqrt(80).
    let mean = q.iter().map(|q| q.turn(Vector::from([1.0, 0.0, 0.0])).z.powi(2)).sum::<f64>() / 80.0;
    assert!((mean - 1.0 / 3.0).abs() < 0.1, "{mean}");
    step(&mut sim);
    let ledger = sim.ledger();
    assert!(ledger.contacts == Some(0) && ledger.penetration == Some(0.0), "{ledger:?}");
    // Seed and name alone decide.
    assert_eq!(x, places(&scene(1, words)));
    assert_ne!(x, places(&scene(2, words)));
    let upright = scene(1, &format!("{words}\nrotate = [[0, 0, 90]]"));
    assert!(turns(&upright).iter().all(|q| (q.turn(Vector::from([1.0, 0.0, 0.0])).y - 1.0).abs() < 1e-12));
}

#[test]
fn strewn_balls_keep_apart_by_two_radii() {
    let sim = scene(7, "shape = { sphere = { radius = 0.1 } }\narrange = { scatter = { count = 150, size = [1.4, 1.4, 1.4] } }");
    let x = places(&sim);
    let nearest = (0..150).flat_map(|i| (0..i).map(move |j| [i, j])).map(|[i, j]| (x[i] - x[j]).norm()).fold(f64::INFINITY, f64::min);
    // They fill 23 % of the box: some nearly touch.
    assert!((0.2..0.21).contains(&nearest), "{nearest}");
}

#[test]
fn stones_of_an_arch_stand_side_by_side_on_a_circle() {
    let words = "shape.voussoir = { radius = 1, thickness = 0.12, width = 0.3, stones = 21 }\nposition = [[0, 0.5, 0.3]]\narrange.arch = {}\ndensity = 2000";
    let mut sim = scene(0, words);
    let (b, r, s) = (std::f64::consts::PI / 42.0, 0.94_f64, 1.06_f64);
    // A stone is the trapezoid between the radii r and s, its centre at 2/3 cos b (s³ - r³)/(s² - r²) from the centre of the arch.
    let far = 2.0 / 3.0 * b.cos() * (s.powi(3) - r.powi(3)) / (s * s - r * r);
    for (k, x) in places(&sim).into_iter().enumerate() {
        let angle = (k as f64 - 10.0) * 2.0 * b;
        let exact = Vector::from([far * angle.sin(), 0.5, 0.3 + far * angle.cos()]);
        assert!((x - exact).norm() < 1e-12, "stone {k}: {x:?}, not {exact:?}");
    }
    let mass = 21.0 * 2000.0 * 0.3 * b.sin() * b.cos() * (s * s - r * r);
    assert!((sim.ledger().mass / mass - 1.0).abs() < 1e-12 && mass > 200.0);
    assert!(sim.warnings().is_empty(), "{:?}", sim.warnings());
    step(&mut sim);
    assert!(sim.ledger().penetration.unwrap() < 1e-12);
    // A full circle, lying down.
    let ring = scene(
        0,
        "shape.voussoir = { radius = 1, thickness = 0.2, width = 0.3, stones = 8, span = 360 }\narrange.arch = {}\nrotate = [[90, 0, 0]]",
    );
    let x = places(&ring);
    let sum = x.iter().fold(Vector::default(), |sum, x| sum + *x);
    assert!(x.len() == 8 && sum.norm() < 1e-12 && x.iter().all(|x| x.z.abs() < 1e-12 && x.norm() > 0.9), "{x:?}");
}

#[test]
fn links_of_a_chain_are_turned_one_against_the_other_and_can_be_joined() {
    // With moments of inertia the axes of a body are those of its words.
    let words = "shape = { capsule = { radius = 0.02, length = 0.1 } }\nposition = [[0, 0, 1]]\nrotate = [[0, 90, 0]]\nmass = 1\ninertia = [1, 1, 1]\n\
        arrange = { chain = { count = 4, step = [0.14, 0, 0] } }\n\
        [[joint]]\nname = \"pins\"\nbetween = [\"bodies\"]\nchain = true\nkind = { ball = {} }";
    let sim = scene(0, words);
    for (k, (x, q)) in places(&sim).into_iter().zip(turns(&sim)).enumerate() {
        assert!((x - Vector::from([0.14 * k as f64, 0.0, 1.0])).norm() < 1e-12);
        // All lie along x; y goes round it by quarters.
        let [along, side] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]].map(|e| q.turn(Vector::from(e)));
        let exact = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]][k];
        assert!((along.x.abs() - 1.0).abs() < 1e-12 && (side - Vector::from(exact)).norm() < 1e-12, "link {k}: {along:?} {side:?}");
    }
    assert_eq!(column(&sim, "pins", "position").len(), 6);
}

#[test]
fn arrangements_that_cannot_be_are_told_with_their_cure() {
    let ball = "shape = { sphere = { radius = 0.1 } }";
    let stone = "shape.voussoir = { radius = 1, thickness = 0.1, width = 0.3, stones = 5 }";
    let cases = [
        (format!("{ball}\narrange = {{ scatter = {{ count = 40, size = [0.5, 0.5, 0.5] }} }}"), ".arrange.scatter.count: 40, but only "),
        (
            format!("{ball}\narrange = {{ scatter = {{ count = 1, size = [0.5, 0.1, 0.5] }} }}"),
            ".arrange.scatter.count: 1, but only 0 have found",
        ),
        (format!("{ball}\narrange.arch = {{}}"), ".arrange.arch: given with another shape; expected shape.voussoir"),
        (format!("{stone}\narrange.arch = {{}}\nrotate = [[0, 0, 1], [0, 0, 2]]"), ".rotate: 2 with arrange.arch, expected none or one"),
        (format!("{stone}\narrange.stack.count = 2\nrotate = [[0, 0, 1], [0, 0, 2], [0, 0, 3]]"), ".rotate: 3 for 2 bodies"),
        (stone.replace("thickness = 0.1", "thickness = 2.5"), ".shape.voussoir.thickness: 2.5 m, expected less than twice the mean radius"),
    ];
    for (words, told) in cases {
        let text = format!("version = 1\n[[body]]\nname = \"a\"\n{words}\n");
        let error = Simulation::new(Scene::from_toml(&text).unwrap(), Default::default()).err().unwrap().to_string();
        assert!(error.contains(&format!("body \"a\"{told}")), "{words}: {error}");
    }
}
