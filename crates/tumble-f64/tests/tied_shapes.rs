//! Rigid things among soft ones: shapes without a frequency, held by a corner, or hung from ropes by anchors. docs/theory/positions.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, simulation, step, vector, velocities, write};
use tumble_f64::math::rotation::from_z_to;
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

const G: f64 = 9.8;
const FPS: u32 = 100;

/// Oscillation with two zero crossings per period, from samples of position and speed, and the largest relative change of a distance between masses
/// of "block".
fn swing(sim: &mut Simulation, seconds: f64, along: impl Fn(&Simulation) -> (f64, f64)) -> (f64, f64) {
    let start = positions(sim, "block");
    let (mut samples, mut bent) = (Vec::new(), 0.0_f64);
    for i in 0..(f64::from(FPS) * seconds) as u32 {
        let (x, v) = along(sim);
        samples.push((f64::from(i) / f64::from(FPS), x, v));
        step(sim);
        let x = positions(sim, "block");
        for i in 0..x.len() {
            for j in 0..i {
                bent = bent.max(((x[i] - x[j]).norm() / (start[i] - start[j]).norm() - 1.0).abs());
            }
        }
    }
    let zeros = common::zeros(&samples);
    assert!(zeros.len() >= 3, "it swings: {zeros:?}");
    (zeros[2].0 - zeros[0].0, bent)
}

/// The period of a pendulum of reduced length l [m] from an amplitude a, by the arithmetic-geometric mean.
fn period(l: f64, a: f64) -> f64 {
    let (mut p, mut q) = (1.0, (a / 2.0).cos());
    for _ in 0..8 {
        (p, q) = (0.5 * (p + q), (p * q).sqrt());
    }
    std::f64::consts::TAU * (l / G).sqrt() / p
}

/// A cube held by a corner. About the corner its inertia is that of a top around the diagonal, so that it swings in a plane.
#[test]
fn a_rigid_block_on_a_corner_keeps_the_time_of_a_physical_pendulum() {
    for (a, substeps, iterations) in [(0.2_f64, 10, 1), (1.2, 40, 1), (0.2, 30, 4)] {
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime.fps = {FPS}\n[[system]]\nmethod = \"position_based\"\nsubsteps = {substeps}\nposition_based = {{ iterations = {iterations} }}\n\
             [[block]]\nname = \"block\"\nsize = [0.2, 0.2, 0.2]\nresolution = [3, 3, 3]\ncenter = [0.1, 0.1, 0.1]\nshape_matching = {{}}\npin = [\"corner 0 0 0\"]\n"
        ));
        // The diagonal goes from straight up to a off straight down, in the plane of x and z.
        let turn = from_z_to(vector(a.sin(), 0.0, -a.cos())) * from_z_to(vector(1.0, 1.0, 1.0).normalized()).conj();
        let turned: Vec<Vector> = positions(&sim, "block").iter().map(|x| turn.turn(*x)).collect();
        write(&mut sim, "block", "position", &turned);
        // Masses as the lattice gives them: corners an eighth, edges a quarter, faces a half of what the middle has.
        let weight = |x: Vector| <[f64; 3]>::from(x).map(|c| if (c - 0.1).abs() < 0.05 { 2.0 } else { 1.0 }).iter().product::<f64>();
        let at: Vec<Vector> = (0..27).map(|i| vector(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9)) * 0.1).collect();
        let diagonal = vector(1.0, 1.0, 1.0).normalized();
        let sum = |f: &dyn Fn(Vector) -> f64| at.iter().map(|x| weight(*x) * f(*x)).sum::<f64>();
        // Σ m |x|² and Σ m (x . d)²: the inertia across the diagonal is half of the first and half of the second.
        let across = 0.5 * (sum(&|x| x.norm_sq()) + sum(&|x| x.dot(diagonal).powi(2)));
        let exact = period(across / sum(&|x| x.dot(diagonal)), a);
        let far = |sim: &Simulation| (positions(sim, "block")[26].x, velocities(sim, "block")[26].x);
        let (found, bent) = swing(&mut sim, 1.3 * exact, far);
        println!("from {a} rad, {substeps} sub-steps: period {found:.5} s, physical pendulum {exact:.5} s; bent by {bent:.1e}");
        assert!((found / exact - 1.0).abs() < 5e-3 && bent < 1e-6, "{found} {exact} {bent:e}");
        let aside = positions(&sim, "block").iter().zip(&turned).map(|(x, s)| (*x - *s).y.abs()).fold(0.0, f64::max);
        assert!(aside < 1e-6, "{aside:e}");
    }
}

/// A block that hangs from four ropes, each tied to a corner by an anchor, swings without turning: as a point on a thread.
#[test]
fn a_rigid_block_on_ropes_keeps_the_time_of_a_pendulum() {
    let (a, length, size) = (0.15_f64, 0.5, [0.2, 0.1, 0.05]);
    let (sin, cos) = a.sin_cos();
    let (density, volume) = (50.0, size[0] * size[1] * size[2]);
    let (n, thread) = (3, 2e-3);
    // Masses 0, 1, 2 and 3 of a block of 2 x 2 x 2 are the lower corners, 4 to 7 the upper ones.
    let corner = |k: usize| vector(size[0] * ((k % 2) as f64 - 0.5), size[1] * ((k / 2) as f64 - 0.5), 0.0);
    let ropes: String = (0..4)
        .map(|k| {
            let (from, to) = (corner(k), corner(k) + vector(sin, 0.0, -cos) * length);
            format!(
                "[[rope]]\nname = \"rope{k}\"\nfrom = [{}, {}, 0]\nto = [{:e}, {}, {:e}]\nsegments = {n}\ndensity = {thread}\npin = [\"start\"]\nlinks.structural = 1e4\n\
                 [[anchor]]\nname = \"tie{k}\"\nbetween = [\"rope{k} {n}\", \"block {}\"]\nrest_length = 0\nstiffness = 1e5\n",
                from.x, from.y, to.x, to.y, to.z, k + 4
            )
        })
        .collect();
    let mut sim = simulation(&format!(
        "precision = \"double\"\ntime.fps = {FPS}\n[[system]]\nmethod = \"position_based\"\nsubsteps = 20\nposition_based = {{ iterations = 200 }}\n\
         [[block]]\nname = \"block\"\nsize = {size:?}\nresolution = [2, 2, 2]\ncenter = [{:e}, 0, {:e}]\ndensity = {density}\nshape_matching = {{}}\n{ropes}",
        length * sin,
        -length * cos - 0.5 * size[2]
    ));
    // Of the four ropes: masses of a third of each but the last, which has half of that, at their distances from above.
    let block = density * volume;
    let piece = thread * length / f64::from(n);
    let parts: Vec<(f64, f64)> = (1..=n)
        .map(|i| (if i == n { 0.5 } else { 1.0 } * 4.0 * piece, length * f64::from(i) / f64::from(n)))
        .chain([(block, length)])
        .collect();
    let second = parts.iter().map(|(m, l)| m * l * l).sum::<f64>() / parts.iter().map(|(m, l)| m * l).sum::<f64>();
    let exact = period(second, a);
    let middle = |of: &[Vector]| of.iter().map(|x| x.x).sum::<f64>() / 8.0;
    let start = positions(&sim, "block");
    let across = |sim: &Simulation| (middle(&positions(sim, "block")), middle(&velocities(sim, "block")));
    let (found, bent) = swing(&mut sim, 1.3 * exact, across);
    let x = positions(&sim, "block");
    let turned = (0..8).map(|i| ((x[i] - x[0]) - (start[i] - start[0])).norm()).fold(0.0, f64::max);
    println!("period {found:.5} s, pendulum {exact:.5} s; bent by {bent:.1e}, turned by {turned:.1e} m");
    assert!((found / exact - 1.0).abs() < 5e-3 && bent < 1e-6, "{found} {exact} {bent:e}");
    assert!(turned < 2e-3, "{turned:e}");
    // The ties hold.
    let open = (0..4).map(|k| (positions(&sim, &format!("rope{k}"))[n as usize] - x[k + 4]).norm()).fold(0.0, f64::max);
    assert!(open < 1e-4 && sim.ledger().kinetic > 0.0, "{open:e}");
}
