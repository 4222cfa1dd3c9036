//! Grains in bulk against what is measured of columns and packings. See docs/theory/grains.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, run, simulation, velocities};
use std::f64::consts::PI;
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

/// Radius of the grains [m], density [kg/m³].
const R: f64 = 0.0025;
const DENSITY: f64 = 2500.0;

/// Words of a system whose contacts act by forces, and by positions.
pub const FORCES: &str = "";
pub const POSITIONS: &str = "grains.scheme = \"positions\"\n";

/// A scene of grains in a system with these words; those that are moved by positions have no stiffness.
fn scene(system: &str, words: &str) -> Simulation {
    let said = |line: &&str| !system.starts_with(POSITIONS) || !line.starts_with("young");
    let words: String = words.lines().filter(said).flat_map(|line| [line, "\n"]).collect();
    simulation(&format!("time.fps = 50\nworld.gravity = [0, 0, -9.81]\n[[system]]\nmethod = \"grains\"\n{system}{words}"))
}

/// Grains of this friction in boxes, each given by its centre and size.
fn sand(friction: f64, more: &str, boxes: &[[[f64; 3]; 2]]) -> String {
    let fill: Vec<String> = boxes.iter().map(|[center, size]| format!("{{ center = {center:?}, size = {size:?} }}")).collect();
    format!(
        "[[grains]]\nname = \"sand\"\nradius = {R}\nfriction = {friction}\nyoung = 2e6\nrestitution = 0.3\ndensity = {DENSITY}\n{more}\nfill = [{}]\n",
        fill.join(", ")
    )
}

fn block(name: &str, center: [f64; 3], size: [f64; 3], more: &str) -> String {
    format!("[[collider]]\nname = \"{name}\"\nshape = {{ box = {{ center = {center:?}, size = {size:?} }} }}\n{more}\n")
}

/// The number below which this part of them lies.
fn quantile(mut numbers: Vec<f64>, part: f64) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers[((numbers.len() - 1) as f64 * part) as usize]
}

/// A column of 16 grains' width between two panes: its height over its width when it has settled, and then, when the gate has gone and the avalanche
/// has stopped, the run-out and the height over the width before. Its edge is where it is a grain deep: single ones roll on.
pub fn collapse(system: &str, friction: f64, rolling: f64) -> [f64; 3] {
    const WIDTH: f64 = 0.08;
    const DEPTH: f64 = 0.02;
    const BIN: f64 = 0.01;
    let floor = format!("[[collider]]\nname = \"floor\"\nshape = {{ floor = {{}} }}\nfriction = {}\n", friction.max(0.3));
    let opens = "friction = 0\nmotion.keys = [{ time = 0.6 }, { time = 0.64, translate = [0, 0, 0.6] }]";
    let gate = block("gate", [WIDTH + 0.01, 0.0, 0.3], [0.02, 0.1, 0.6], opens);
    let panes = format!(
        "[[collider]]\nname = \"panes\"\nshape = {{ box = {{ center = [0.5, 0, 0.5], size = [1, {DEPTH}, 1.2] }} }}\ninside = true\nfriction = 0\n"
    );
    let more = format!("rolling_friction = {rolling}\nradius_spread = 0.1");
    let words = sand(friction, &more, &[[[0.5 * WIDTH, 0.0, 0.165], [WIDTH, DEPTH, 0.33]]]);
    let mut sim = scene(system, &[words, floor, gate, panes].concat());
    run(&mut sim, 30);
    let height = |sim: &Simulation| quantile(positions(sim, "sand").iter().map(|p| p.z).collect(), 0.995) + R;
    let before = height(&sim) / WIDTH;
    run(&mut sim, 60);
    let mut x: Vec<f64> = positions(&sim, "sand").iter().map(|p| p.x).collect();
    x.sort_by(f64::total_cmp);
    // The end of the farthest centimetre that is a grain deep, packed to 0.6.
    let grains = (2.0 * R * 0.6 * BIN * DEPTH / (4.0 / 3.0 * PI * R.powi(3))) as usize;
    let edge = x.windows(grains + 1).rfind(|run| run[grains] - run[0] < BIN).unwrap()[0] + BIN;
    [before, edge / WIDTH - 1.0, height(&sim) / WIDTH]
}

#[test]
#[ignore = "long: make validate"]
fn a_column_of_glass_beads_collapses_as_far_as_measured_and_others_do_not() {
    // [lube2005]: 1.2 a, [lajeunesse2005]: 1.8 a; the height about a^0.4, between 0.8 and 1.7.
    let [a, far, high] = collapse(FORCES, 0.2, 0.0);
    assert!((1.7..2.2).contains(&a), "{a}");
    assert!((1.2 * a..1.8 * a).contains(&far) && (0.8..1.7).contains(&high), "a = {a}: {far} of {} to {}, {high}", 1.2 * a, 1.8 * a);
    // Without friction all runs to the far wall; angular grains stop short.
    let [_, slips, _] = collapse(FORCES, 0.0, 0.0);
    let [_, short, higher] = collapse(FORCES, 0.5, 0.1);
    assert!(slips > 10.0 && short < 1.1 * a && higher > high, "{slips} {far} {short}, {high} {higher}");
}

/// The part of the volume that balls without friction fill, poured into a bin, and how deep they overlap, over their radius.
pub fn packing(system: &str) -> [f64; 2] {
    let side = 24.0 * R;
    let bin = format!(
        "[[collider]]\nname = \"bin\"\nshape = {{ box = {{ center = [0, 0, 0.2], size = [{side}, {side}, 0.4] }} }}\ninside = true\nfriction = 0\n"
    );
    let mut sim = scene(system, &(sand(0.0, "", &[[[0.0, 0.0, 0.1], [side, side, 0.2]]]) + &bin));
    run(&mut sim, 50);
    let inner = 0.5 * side - 6.0 * R;
    let within = |p: &&Vector| p.x.abs() < inner && p.y.abs() < inner && (6.0 * R..22.0 * R).contains(&p.z);
    let count = positions(&sim, "sand").iter().filter(within).count() as f64;
    assert!(count > 100.0, "{count}");
    [count * 4.0 / 3.0 * PI * R.powi(3) / (4.0 * inner * inner * 16.0 * R), sim.ledger().penetration.unwrap() / R]
}

#[test]
#[ignore = "long: make validate"]
fn poured_balls_pack_as_densely_as_random_ones() {
    let [part, _] = packing(FORCES);
    assert!((0.6..0.66).contains(&part), "{part}");
}

/// Four walls around a square of this width [m], from `low` [m] on.
fn walls(width: f64, low: f64, more: &str) -> String {
    const THICK: f64 = 0.02;
    let away = 0.5 * (width + THICK);
    let sides = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
    let wall = |(k, [x, y]): (usize, [f64; 2])| {
        let size = [x, y].map(|along: f64| if along == 0.0 { width + 2.0 * THICK } else { THICK });
        block(&format!("wall {k}"), [x * away, y * away, low + 0.5], [size[0], size[1], 1.0], more)
    };
    sides.into_iter().enumerate().map(wall).collect()
}

/// The slope of a heap that so many grains make when the walls around them are lifted: of a cone, twice the mean height over the mean distance from the
/// axis.
pub fn slope(system: &str, words: &str, count: usize) -> f64 {
    const RADIUS: f64 = 0.004;
    let heap = format!(
        "[[grains]]\nname = \"heap\"\nradius = {RADIUS}\n{words}\nradius_spread = 0.05\nfill = [{{ center = [0, 0, 0.4], size = [0.09, 0.09, 0.8], count = {count} }}]\nyoung = 1e6\nrestitution = 0.2\n"
    );
    let lifted = "friction = 0\nmotion.keys = [{ time = 0.4 }, { time = 0.7, translate = [0, 0, 1] }]";
    let pipe = walls(0.1, 0.0, lifted);
    let floor = "[[collider]]\nname = \"floor\"\nshape = { floor = {} }\nfriction = 0\n";
    let mut sim = scene(system, &[heap, pipe, floor.into()].concat());
    run(&mut sim, 65);
    let x = positions(&sim, "heap");
    let n = x.len() as f64;
    let [height, far] = [x.iter().map(|p| p.z - RADIUS).sum::<f64>() / n, x.iter().map(|p| p.x.hypot(p.y)).sum::<f64>() / n];
    assert!(n > 500.0 && far > 0.02, "{n} {far}");
    2.0 * height / far
}

#[test]
#[ignore = "long: make validate"]
fn heaps_are_the_steeper_the_more_friction_there_is() {
    let [smooth, medium, rough] = [0.05, 0.2, 0.6].map(|mu| slope(FORCES, &format!("friction = {mu}\nrolling_friction = 0.1"), 800));
    assert!(smooth < 0.1 && medium > 1.5 * smooth && rough > 1.2 * medium && rough < 0.6, "{smooth} {medium} {rough}");
}

/// Weight of the grains in a silo of 4 cm by 4 cm, filled so high [m], and the load of its bottom, a scale [N].
fn silo(friction: f64, filled: f64) -> [f64; 2] {
    const WIDTH: f64 = 0.04;
    const STIFFNESS: f64 = 6000.0;
    const PLATE: f64 = 0.1;
    // Once all is at rest they rise a little, so that all grains have slipped down along them.
    let rises = format!("friction = {friction}\nmotion.keys = [{{ time = 0.6 }}, {{ time = 1, translate = [0, 0, 0.006] }}]");
    let walls = walls(WIDTH, -0.03, &rises);
    let plate = format!(
        "[[body]]\nname = \"plate\"\nshape = {{ box = {{ size = [0.0396, 0.0396, 0.01] }} }}\nmass = {PLATE}\nposition = [[0, 0, -0.005]]\nfriction = 0\n[[joint]]\nname = \"scale\"\nbetween = [\"plate\"]\nkind = {{ slider = {{ axis = [0, 0, 1], motor = {{ target = {{ stiffness = {STIFFNESS}, damping = 40 }} }} }} }}\n"
    );
    let systems = "[[system]]\nname = \"grains\"\nmethod = \"grains\"\n[[system]]\nname = \"bodies\"\nmethod = \"rigid\"\n";
    let fill = [[[0.0, 0.0, 0.5 * filled + 0.001], [WIDTH, WIDTH, filled]]];
    let time = "time = { fps = 50, exchanges = 20 }\nworld.gravity = [0, 0, -9.81]\n";
    let mut sim = simulation(&[time, systems, &sand(friction, "radius_spread = 0.1", &fill), &walls, &plate].concat());
    run(&mut sim, 60);
    let x = positions(&sim, "sand");
    assert!(x.iter().all(|p| p.z > -R), "none fell out");
    let fastest = velocities(&sim, "sand").iter().map(|v| v.norm()).fold(0.0, f64::max);
    assert!(fastest < 0.05, "{friction} {filled}: {fastest} m/s");
    let sunk = -0.005 - positions(&sim, "plate")[0].z;
    let weight = (sim.ledger().mass - PLATE) * 9.81;
    [weight, STIFFNESS * sunk - PLATE * 9.81]
}

#[test]
#[ignore = "some ten seconds"]
fn walls_bear_what_a_silo_holds_beyond_its_width() {
    let [[half, low], [full, high]] = [0.12, 0.24].map(|filled| silo(0.5, filled));
    // [janssen1895]: W (1 - exp(-m/W)) with W = rho g D/(4 mu K) times the floor; K of balls is between 0.3 and 1.
    let floor = 0.04 * 0.04;
    let bears = |k: f64, weight: f64| {
        let most = 0.6 * DENSITY * 9.81 * 0.04 / (4.0 * 0.5 * k) * floor;
        most * (1.0 - (-weight / most).exp())
    };
    assert!(full > 1.9 * half && high < 0.5 * full, "{full}: {high}, {half}: {low}");
    assert!(high < 1.25 * low && high > 0.8 * low, "{low} {high}");
    assert!((bears(1.0, full)..bears(0.3, full)).contains(&high), "{high} of {} to {}", bears(1.0, full), bears(0.3, full));
    // Without friction the bottom bears it all.
    let [weight, load] = silo(0.0, 0.24);
    assert!((load / weight - 1.0).abs() < 0.03, "{load} of {weight}");
}

/// Grains a second that leave a bin of 8 cm by 8 cm, filled so high [m], by a hole of so many diameters in its floor.
fn flow(hole: f64, filled: f64) -> f64 {
    const WIDTH: f64 = 0.08;
    let open = hole * 2.0 * R;
    let side = 0.5 * (0.1 - open);
    let floor: Vec<String> = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]
        .iter()
        .enumerate()
        .map(|(k, [x, y])| {
            let center = [x * 0.5 * (open + side), y * 0.5 * (open + side), -0.005];
            // Those along y lie between those along x.
            let size = if *x == 0.0 { [open, side, 0.01] } else { [side, 0.1, 0.01] };
            block(&format!("floor {k}"), center, size, "friction = 0.5")
        })
        .collect();
    let bin = block("bin", [0.0, 0.0, -3.0], [WIDTH, WIDTH, 8.0], "inside = true\nfriction = 0.3");
    let gate =
        block("gate", [0.0, 0.0, -0.02], [0.06, 0.06, 0.02], "motion.keys = [{ time = 0.26 }, { time = 0.28, translate = [0.2, 0, 0] }]");
    let fill = [[[0.0, 0.0, 0.5 * filled + 0.003], [WIDTH, WIDTH, filled]]];
    let mut sim = scene(FORCES, &[sand(0.5, "radius_spread = 0.1", &fill), floor.concat(), bin, gate].concat());
    let mut left = |frames: usize| {
        run(&mut sim, frames);
        positions(&sim, "sand").iter().filter(|p| p.z < -0.02).count() as f64
    };
    let (before, after) = (left(18), left(14));
    assert!(before > 5.0, "{before}");
    (after - before) / 0.28
}

#[test]
#[ignore = "some minutes"]
fn bins_empty_as_beverloo_says_however_high_they_are_filled() {
    // [beverloo1961]: (D - 1.4 d)^(5/2).
    let holes = [5.0, 6.5, 8.0];
    let flows = holes.map(|hole| flow(hole, 0.16));
    let exponent = (flows[2] / flows[0]).ln() / ((holes[2] - 1.4) / (holes[0] - 1.4)).ln();
    assert!((2.2..2.8).contains(&exponent) && flows[0] > 100.0, "{exponent}: {flows:?}");
    let low = flow(6.5, 0.11);
    assert!((low / flows[1] - 1.0).abs() < 0.1, "{low} {flows:?}");
}
