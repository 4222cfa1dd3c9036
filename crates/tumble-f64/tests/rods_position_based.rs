//! Rods under position-based dynamics, solved strand by strand, against exact curves of the elastica and critical loads; among them the
//! tests of [romero2021] as far as there are exact figures.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

mod common;

use common::{Vector, positions, run, simulation, vector};

const HEAD: &str = "precision = \"double\"\nworld.gravity = [0, 0, -10]\n[[system]]\nmethod = \"position_based\"\n";

/// A horizontal rod of 1 m and 0.1 kg/m, so that q = 1 N/m, clamped at the start.
fn cantilever(gamma: f64, segments: u32, extra: &str) -> Vec<Vector> {
    let mut sim = simulation(&format!(
        "{HEAD}{extra}\n[[force]]\nkind = \"drag\"\nrate = 5\n[[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = {segments}\ndensity = 0.1\npin = [\"start\"]\n\
         rod = {{ stretch = 1e5, bend = {:e} }}\n",
        1.0 / gamma
    ));
    run(&mut sim, 24 * 12);
    let speed = sim.ledger().speed;
    assert!(speed < 1e-3, "still moving at {speed:e} m/s");
    positions(&sim, "r")
}

/// Drop and reach of the elastica under its own weight, by the boundary-value problem theta'' = -Gamma (1 - s) cos(theta)/L².
#[test]
fn a_cantilever_bends_as_the_elastica() {
    for (gamma, drop, reach) in
        [(0.1, 0.012498, 0.999911), (1.0, 0.123471, 0.991246), (5.0, 0.495905, 0.846657), (20.0, 0.829881, 0.445232), (100.0, 0.937524, 0.159223)]
    {
        for segments in [16, 32, 64] {
            let x = cantilever(gamma, segments, "");
            let tip = x[segments as usize];
            let (h, w) = (-tip.z / drop - 1.0, tip.x / reach - 1.0);
            let ratio = (-tip.z / tip.x) / (drop / reach) - 1.0;
            println!("Gamma = {gamma}, {segments} segments: drop off by {:.2} %, reach by {:.2} %, H/W by {:.2} %", 100.0 * h, 100.0 * w, 100.0 * ratio);
            assert!(h.abs() < 0.03 && w.abs() < 0.03, "{h} {w}");
            // Second order in the length of segments.
            assert!(segments < 64 || ratio.abs() < 0.01, "{ratio}");
            assert!(tip.y.abs() < 1e-9);
        }
    }
}
