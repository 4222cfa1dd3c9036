//! Ropes of links under position-based dynamics, whose chains are solved as a whole.                                  (positions.7)

use crate::common;

use common::{orders, positions, run, show, simulation, step, vector, velocities, write, zeros};
use std::f64::consts::PI;
use tumble_interface::Engine;

const G: f64 = 9.8;
const DENSITY: f64 = 0.1;

fn rope(n: u32, to: [f64; 3], pins: &str, words: &str) -> String {
    format!("[[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = {to:?}\nsegments = {n}\ndensity = {DENSITY}\npin = [{pins}]\n{words}\n")
}

fn system(words: &str) -> String {
    format!("precision = \"double\"\ntime.fps = 24\n[[system]]\nmethod = \"position_based\"\n{words}\n")
}

fn length(x: &[common::Vector]) -> f64 {
    x.windows(2).map(|ends| (ends[1] - ends[0]).norm()).sum()
}

/// However many pieces, with the sub-steps of the default: the strain of a hanging rope is rho g L/(2 EA).
#[test]
fn a_hanging_rope_stretches_as_it_should_whatever_its_pieces() {
    for modulus in [100.0, 1e6] {
        for n in [4, 64, 256, 1024] {
            let rope = rope(n, [0.0, 0.0, -1.0], "\"start\"", &format!("links = {{ structural = {{ modulus = {modulus} }} }}"));
            let mut sim = simulation(&format!("{}{rope}[[force]]\nkind = \"drag\"\nrate = 4\n", system("")));
            run(&mut sim, 72);
            let (found, exact) = (length(&positions(&sim, "r")) - 1.0, 0.5 * DENSITY * G / modulus);
            println!("EA = {modulus} N, {n} pieces: {found:.3e} of {exact:.3e} m");
            assert!((found / exact - 1.0).abs() < 1e-4, "{n}: {found:e} {exact:e}");
        }
    }
}

/// Along no axis, as stiff as steel, and rigid: at rest to round-off.
#[test]
fn a_stiff_rope_hangs_still_in_any_direction() {
    for words in ["structural = { modulus = 1e6 }", "structural = { modulus = 1e9 }", "structural = { modulus = 1e9, damping = 1e3 }"] {
        let rope = rope(64, [0.6, 0.1, -0.79], "\"start\"", &format!("links = {{ {words} }}"));
        for sweeps in ["", "position_based.iterations = 3", "position_based.projection = \"plain\""] {
            let mut sim = simulation(&format!("world.gravity = [6.0, 1.0, -7.9]\n{}{rope}", system(sweeps)));
            let start = length(&positions(&sim, "r"));
            run(&mut sim, 12);
            let (speed, longer) = (sim.ledger().speed.unwrap(), length(&positions(&sim, "r")) / start - 1.0);
            println!("{words}, {sweeps}: {speed:.1e} m/s, longer by {longer:.1e}");
            assert!(speed < 2e-6 && longer.abs() < 1e-6, "{words} {sweeps}: {speed:e} {longer:e}");
        }
    }
}

/// Dashpots of D newtons per strain rate, without springs, let the tip of what hangs creep at rho g L²/(2 D).
#[test]
fn links_without_stiffness_still_damp() {
    let fallen = |damping: f64| {
        let rope = rope(8, [0.0, 0.0, -1.0], "\"start\"", &format!("links = {{ structural = {{ modulus = 0, damping = {damping} }} }}"));
        let mut sim = simulation(&format!("{}{rope}", system("")));
        run(&mut sim, 12);
        -1.0 - positions(&sim, "r")[8].z
    };
    let (creep, free) = (fallen(100.0), fallen(0.0));
    let exact = 0.5 * DENSITY * G / (2.0 * 100.0);
    println!("creeps by {creep:.4e} of {exact:.4e} m, falls by {free:.3} m");
    assert!((free - 0.125 * G).abs() < 0.02 && (creep / exact - 1.0).abs() < 0.01, "{creep} {exact} {free}");
}

/// A rope that is let go from level, and cracks like a whip: energy falls, in steps much longer than those of its waves.
#[test]
fn a_rope_that_swings_gains_no_energy() {
    for n in [16, 64, 256] {
        let rope = rope(n, [1.0, 0.0, 0.0], "\"start\"", "links = { structural = { modulus = 1e5 } }");
        let mut sim = simulation(&format!("{}{rope}", system("substeps = 20")));
        let (mut before, mut lowest) = (sim.ledger().energy(), 0.0_f64);
        let start = before;
        for _ in 0..48 {
            step(&mut sim);
            let now = sim.ledger().energy();
            assert!(now < before + 1e-6, "{n} pieces: {now} after {before}");
            before = now;
            lowest = positions(&sim, "r").iter().map(|x| x.z).fold(lowest, f64::min);
        }
        let stretched = length(&positions(&sim, "r")) - 1.0;
        println!(
            "{n} pieces: {:.3} J of {:.3} J lost, lowest at {lowest:.3} m, longer by {stretched:.1e} m",
            start - before,
            0.5 * DENSITY * G
        );
        assert!(lowest < -0.9 && stretched.abs() < 1e-3, "it swung, and stays as long: {lowest} {stretched}");
    }
}

/// A string under tension keeps its pitch, and its line: f = sqrt(T/rho)/2L of a string, times sin(pi/2n)/(pi/2n) of n beads.
#[test]
fn a_taut_string_swings_at_its_frequency() {
    let (n, modulus, unstretched) = (32_u32, 100.0, 0.9);
    let tension = modulus * (1.0 - unstretched) / unstretched;
    // A mass is DENSITY times the unstretched length.
    let wave = 0.5 * PI / f64::from(n);
    let exact = 0.5 * (tension / (DENSITY * unstretched)).sqrt() * wave.sin() / wave;
    let mut errors = Vec::new();
    for substeps in [16, 32, 64] {
        let rope = rope(n, [1.0, 0.0, 0.0], "\"start\", \"end\"", &format!("length = {unstretched}\nlinks = {{ structural = {modulus} }}"));
        let mut sim = simulation(
            &format!("world.gravity = [0, 0, 0]\n{}{rope}", system(&format!("substeps = {substeps}"))).replace("fps = 24", "fps = 100"),
        );
        let mut x = positions(&sim, "r");
        x.iter_mut().enumerate().for_each(|(i, x)| x.y = 1e-4 * (PI * i as f64 / f64::from(n)).sin());
        write(&mut sim, "r", "position", &x);
        let mut samples = Vec::new();
        for frame in 0..30 {
            let (x, v) = (positions(&sim, "r"), velocities(&sim, "r"));
            samples.push((f64::from(frame) / 100.0, x[n as usize / 2].y, v[n as usize / 2].y));
            step(&mut sim);
        }
        let zeros = zeros(&samples);
        let count = zeros.len() - 1;
        errors.push((0.5 * count as f64 / (zeros[count].0 - zeros[0].0) / exact - 1.0).abs());
    }
    println!("{exact:.3} Hz, off by {}, orders {}", show(&errors), show(&orders(&errors)));
    assert!(errors[2] < 2e-5 && orders(&errors).iter().all(|order| (order - 2.0).abs() < 0.1), "{errors:?}");
}

/// A string that sags a little between its pins: q L²/(8 T), and it comes to rest.
#[test]
fn a_taut_string_sags_by_its_weight_and_rests() {
    for (n, modulus) in [(16, 1e4), (256, 1e4), (64, 1e6)] {
        let unstretched = 1.0 / 1.01;
        let words = format!("length = {unstretched}\nlinks = {{ structural = {{ modulus = {modulus} }} }}");
        let rope = rope(n, [1.0, 0.0, 0.0], "\"start\", \"end\"", &words);
        let mut sim = simulation(&format!("{}{rope}[[force]]\nkind = \"drag\"\nrate = 4\n", system("")));
        run(&mut sim, 72);
        let tension = modulus * 0.01;
        let exact = DENSITY * unstretched * G / (8.0 * tension);
        let found = -positions(&sim, "r")[n as usize / 2].z;
        let speed = sim.ledger().speed.unwrap();
        println!("{n} pieces, T = {tension:.0} N: sags {found:.4e} of {exact:.4e} m, {speed:.1e} m/s");
        assert!((found / exact - 1.0).abs() < 1e-3 && speed < 1e-6, "{found} {exact} {speed}");
    }
}

/// Rigid links by plain projection are as long as they should be after one sweep, whatever their count; what is torn falls in two.
#[test]
fn plain_and_broken_links() {
    let rope = |words: &str| rope(100, [0.6, 0.0, -0.8], "\"start\"", words);
    let plain = system("substeps = 40\nposition_based = { projection = \"plain\", stiffness = 1 }");
    let mut sim = simulation(&format!("{plain}{}", rope("links = { structural = 1 }")));
    run(&mut sim, 24);
    assert!((length(&positions(&sim, "r")) - 1.0).abs() < 1e-3, "{}", length(&positions(&sim, "r")));

    let broken = rope("links = { structural = { modulus = 1e4, break_strain = 4e-5 } }");
    let mut sim = simulation(&format!("{}{broken}", system("")));
    let torn = (0..24).map(|_| step(&mut sim).broken).sum::<u64>();
    let x = positions(&sim, "r");
    let tip = (x[100].z, velocities(&sim, "r")[100]);
    println!("{torn} torn, {tip:?}");
    assert!(torn >= 1 && tip.0 < -2.0 && (tip.1 - vector(0.0, 0.0, -G)).norm() < 1.0, "{torn} {tip:?}");
}
