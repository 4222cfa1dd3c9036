//! The table of how linear tetrahedra lock, by which a scene is warned: crates/tumble/src/scene/locking.rs.

#![allow(clippy::unwrap_used)] // helpers of tests fail by panicking, too

use crate::common;

use common::*;
use tumble_interface::Engine;

/// Excess stiffness of a cantilever of 1 m and 0.2 m thickness over Timoshenko's beam, and the warning of its scene.
fn excess(cells: u32, nu: f64) -> (f64, Option<String>) {
    let (long, across) = (5 * cells + 1, cells + 1);
    let mut sim = simulation(&format!(
        "precision = \"double\"\nworld.gravity = [0, 0, -0.01]\ntime = {{ fps = 0.05, frames = 2 }}\n[[system]]\nintegrator = \"implicit_euler\"\nsubsteps = 1\nsolver = {{ linear = \"cholesky\", hessian = \"exact\", newton_iterations = 30 }}\n[[block]]\nname = \
         \"beam\"\nsize = [1, 0.2, 0.2]\nresolution = [{long}, {across}, {across}]\ndensity = 1000\nmaterial = {{ young = 1e6, poisson = {nu} }}\npin = [\"face x-\"]\n"
    ));
    let start = positions(&sim, "beam");
    assert_eq!(run(&mut sim, 2).unconverged, 0);
    let falls = positions(&sim, "beam").into_iter().zip(start).filter(|(_, x0)| x0.x > 0.5 - 1e-9).map(|(x, x0)| x0.z - x.z);
    let fall = falls.sum::<f64>() / f64::from(across * across);
    let (q, e, shear) = (1000.0 * 0.01 * 0.04, 1e6, 1e6 / (2.0 * (1.0 + nu)));
    let exact = q / (8.0 * e * 0.2_f64.powi(4) / 12.0) + q / (2.0 * 5.0 / 6.0 * shear * 0.04);
    let told = sim.warnings().iter().find(|warning| warning.code.name() == "locking").map(|warning| warning.message.clone());
    (exact / fall - 1.0, told)
}

#[test]
fn a_block_that_locks_is_told_by_how_much() {
    for (cells, nu) in [(1, 0.45), (2, 0.45), (4, 0.45), (2, 0.49), (3, 0.49), (8, 0.45), (4, 0.499)] {
        let (found, told) = excess(cells, nu);
        let told = told.unwrap();
        let percent: f64 = told.split("about ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
        // Three cells are between two places of the table, eight beyond the last.
        let bound = if cells == 3 || cells == 8 { 0.1 } else { 0.01 };
        assert!((percent / 100.0 / found - 1.0).abs() < bound, "{cells} {nu}: {found} {told}");
    }
    let (found, told) = excess(2, 0.3);
    assert!(told.is_none() && (found - 0.9645).abs() < 0.001, "{found} {told:?}");
}
