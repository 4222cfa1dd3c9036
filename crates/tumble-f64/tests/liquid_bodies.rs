//! Rigid bodies in liquids on a grid: docs/theory/pic.md.

use crate::common;

use common::{column, run, simulation, step};
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

const G: f64 = 9.8;

/// Water of a depth in a tank, with a body of these words.
fn afloat(dimension: usize, size: [f64; 3], resolution: usize, depth: f64, words: &str, time: &str) -> Simulation {
    let [x, y, z] = size;
    let center = [0.0, 0.0, 0.5 * z];
    simulation(&format!(
        "dimension = {dimension}\ntime = {{ {time} }}\n[[liquid]]\nname = \"water\"\nbodies = [\"b\"]\nbox = {{ size = {size:?}, center = {center:?}, resolution = {resolution} }}\n\
         fill = [{{ shape.box = {{ center = [0, 0, {}], size = [{x}, {y}, {depth}] }} }}]\n\
         [[collider]]\nname = \"tank\"\ninside = true\nshape.box = {{ center = {center:?}, size = {size:?} }}\n[[body]]\nname = \"b\"\n{words}\n",
        0.5 * depth
    ))
}

fn z(sim: &Simulation) -> f64 {
    column(sim, "b", "position")[0].z
}

#[test]
fn a_raft_floats_as_deep_as_its_density_says() {
    // Wide and low, so that it stays upright; let go where it is to float.
    let ([width, height], wide, depth) = ([0.64, 0.3], 1.6, 0.6);
    for ratio in [0.3, 0.6] {
        let start = depth + height * (0.5 - ratio);
        let words = format!("shape.box.size = [{width}, 1, {height}]\ndensity = {}\nposition = [[0, 0, {start}]]", 1000.0 * ratio);
        let mut sim = afloat(2, [wide, 1.0, 1.2], 48, depth, &words, "fps = 24, exchanges = 4");
        run(&mut sim, 12);
        let middle = (0..36).map(|_| {
            step(&mut sim);
            z(&sim) / 36.0
        });
        let middle: f64 = middle.sum();
        // It weighs what it displaces.
        let surface = sim.ledger().mass / 1000.0 / wide;
        let deep = (surface - (middle - 0.5 * height)) / height;
        println!("{ratio}: {deep} of its height under water");
        assert!((deep - ratio).abs() < 0.01, "{ratio}: {deep}");
    }
}

#[test]
fn a_ball_under_water_starts_with_its_added_mass() {
    // In a wide tank: half of the displaced mass in space, all of it in the plane; walls and surface change that by some percent.
    let (radius, depth) = (0.15, 1.2);
    let ball = format!("shape.sphere.radius = {radius}");
    let roll = format!("shape.cylinder = {{ radius = {radius}, height = 1.0 }}\nrotate = [[90, 0, 0]]");
    for (dimension, shape, added, resolution, ratio) in [(2, &roll, 1.0, 64, 3.0), (3, &ball, 0.5, 40, 3.0), (2, &roll, 1.0, 64, 0.3)] {
        let words = format!("{shape}\ndensity = {}\nposition = [[0, 0, 0.6]]", 1000.0 * ratio);
        let mut sim = afloat(dimension, [1.6, 1.6, 1.6], resolution, depth, &words, "fps = 1000");
        run(&mut sim, 2);
        let v = column(&sim, "b", "velocity")[0].z / 0.002;
        let exact = -G * (ratio - 1.0) / (ratio + added);
        println!("{dimension} {ratio}: {v} m/s², {exact} in an endless sea: {}", v / exact);
        assert!((v / exact - 1.0).abs() < 0.08);
    }
}

#[test]
fn a_restored_body_goes_on_with_the_same_bits_and_no_more_energy() {
    let make = || {
        let words =
            "shape.box.size = [0.3, 0.2, 0.2]\nrotate = [[0, 20, 10]]\ndensity = 500\nposition = [[0, 0, 0.7]]\nvelocity = [[0.4, 0, -1]]";
        afloat(3, [1.0, 1.0, 1.0], 20, 0.5, words, "fps = 60")
    };
    let mut sim = make();
    let start = sim.ledger();
    assert!(start.mass > 400.0);
    run(&mut sim, 10);
    let one = sim.hash();
    assert!(sim.ledger().energy() < 1.02 * start.energy());
    let mut first = make();
    run(&mut first, 5);
    let mut fresh = make();
    fresh.restore(&first.save(&[])).unwrap();
    run(&mut fresh, 5);
    assert_eq!(fresh.hash(), one);
    let two = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap().install(|| {
        let mut sim = make();
        run(&mut sim, 10);
        sim.hash()
    });
    assert_eq!(two, one);
}
