//! Position-based dynamics: single elements against hand computation, and motions against exact solutions and against implicit Euler,
//! to which compliant elements converge.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, list, positions, run, simulation, step, vector, velocities};
use tumble_f64::elements::{
    Bending, Constraints, Distance, Limit, Linear, Members, Neohookean, Nonlinear, Projected, Projection, StretchShear, rest_matrix,
};
use tumble_f64::geometry::Walls;
use tumble_f64::math::{Row, ZERO};
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

fn step_of(h: f64, iteration: u32, iterations: u32, before: &[Row]) -> Projection<'_> {
    Projection { h, before, iteration, iterations, plain: None, walls: Walls::default() }
}

type Springs = Projected<Distance, Linear, 2, 1, 1, 0>;

fn spring(rest: f64, stiffness: f64, damping: f64) -> Springs {
    Springs::new(2, 2, &[], &[Members { nodes: [0, 1], rest: [rest], law: [], stiffness, damping }], &[]).unwrap()
}

/// Masses 1 kg and 3 kg, 2 m apart.
fn two() -> Vec<Row> {
    vec![[0.0, 0.0, 0.0, 1.0], [2.0, 0.0, 0.0, 1.0 / 3.0]]
}

#[test]
fn a_projected_spring_moves_as_computed_by_hand() {
    // Rest length 1 m, k = 100 N/m, h = 0.1 s: alpha = 1/(k h²) = 1, lambda = -1/(1 + 1/3 + 1).
    let (mut x, mut soft) = (two(), spring(1.0, 100.0, 0.0));
    soft.project(&mut x, &step_of(0.1, 0, 2, &[]));
    let lambda = -1.0 / (1.0 + 1.0 / 3.0 + 1.0);
    assert!((x[0][0] + lambda).abs() < 1e-15 && (x[1][0] - (2.0 + lambda / 3.0)).abs() < 1e-15, "{x:?}");
    // The multiplier is kept: a single straight element is satisfied, and a second sweep does nothing.
    let once = x.clone();
    soft.project(&mut x, &step_of(0.1, 1, 2, &[]));
    assert!((x[0][0] - once[0][0]).abs() < 1e-15 && (x[1][0] - once[1][0]).abs() < 1e-15, "{x:?}");
    // In a new sub-step it starts from zero.
    soft.project(&mut x, &step_of(0.1, 0, 2, &[]));
    assert!((x[0][0] - once[0][0]).abs() > 0.1);
    // A limit is rigid beyond its length and slack below.
    let rigid = [Members { nodes: [0, 1], rest: [1.0], law: [], stiffness: f64::INFINITY, damping: 0.0 }];
    let mut limit = Projected::<Limit, Linear, 2, 1, 1, 0>::new(2, 2, &[], &rigid, &[]).unwrap();
    let mut x = two();
    limit.project(&mut x, &step_of(0.1, 0, 1, &[]));
    assert!((x[1][0] - x[0][0] - 1.0).abs() < 1e-15 && (x[0][0] - 0.75).abs() < 1e-15, "{x:?}");
    let mut short = vec![[0.0, 0.0, 0.0, 1.0], [0.5, 0.0, 0.0, 1.0]];
    limit.project(&mut short, &step_of(0.1, 0, 1, &[]));
    assert_eq!(short, [[0.0, 0.0, 0.0, 1.0], [0.5, 0.0, 0.0, 1.0]]);
    // A plain element takes back its share, whatever its stiffness.
    let (mut x, mut soft) = (two(), spring(1.0, 100.0, 0.0));
    soft.project(&mut x, &Projection { plain: Some(0.25), ..step_of(0.1, 0, 1, &[]) });
    assert!((x[1][0] - x[0][0] - 1.75).abs() < 1e-15, "{x:?}");
}

#[test]
fn a_damped_spring_takes_the_step_of_implicit_euler() {
    // m v' = -k (x - l) - b v between a wall and 2 kg, from x = 1.5 m at 3 m/s: h² (k + b/h + m/h²) x' = m x* + h² k l + h b x.
    let (k, b, m, l, h) = (70.0, 9.0, 2.0, 1.0, 0.05);
    let (x, v) = (1.5, 3.0);
    let exact = (m * (x + h * v) + h * h * k * l + h * b * x) / (m + h * h * k + h * b);
    let before = vec![ZERO, [x, 0.0, 0.0, 1.0 / m]];
    for iterations in [1, 3] {
        let mut rows = vec![ZERO, [x + h * v, 0.0, 0.0, 1.0 / m]];
        let mut soft = spring(l, k, b);
        (0..iterations).for_each(|i| soft.project(&mut rows, &step_of(h, i, iterations, &before)));
        assert!((rows[1][0] - exact).abs() < 1e-15, "{} {exact}", rows[1][0]);
    }
    // A damper without stiffness, and a spring of another law: b (x' - x)/h, and k r (1 + c r²) with one step of Newton's method.
    let mut rows = vec![ZERO, [x + h * v, 0.0, 0.0, 1.0 / m]];
    spring(0.0, 0.0, b).project(&mut rows, &step_of(h, 0, 1, &before));
    let exact = (m * (x + h * v) + h * b * x) / (m + h * b);
    assert!((rows[1][0] - exact).abs() < 1e-13, "{} {exact}", rows[1][0]);
    let c = 0.8;
    let member = [Members { nodes: [0, 1], rest: [l], law: [c, 1.0], stiffness: k, damping: 0.0 }];
    let mut stiffening = Projected::<Distance, Nonlinear, 2, 1, 1, 2>::new(2, 2, &[], &member, &[]).unwrap();
    let mut rows = vec![ZERO, [x + h * v, 0.0, 0.0, 1.0 / m]];
    (0..20).for_each(|i| stiffening.project(&mut rows, &step_of(h, i, 20, &before)));
    let r = rows[1][0] - l;
    let error = m * (rows[1][0] - (x + h * v)) + h * h * k * r * (1.0 + c * r * r);
    assert!(error.abs() < 1e-14, "{error:e}");
}

#[test]
fn a_projected_hinge_moves_as_computed_by_hand() {
    // Right angle over an edge of 2 m, wings of 1 m, all masses 1 kg: r = 2 sin(45°), dr/dtheta = cos(45°); theta moves with the wings
    // at 1/height each and with the ends of the edge at half of both, opposite.
    let (k, h, height) = (3.0, 0.2, 1.0);
    let mut x = vec![[0.0, -1.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [-height, 0.0, 0.0, 1.0], [0.0, 0.0, height, 1.0]];
    let start = x.clone();
    let member = [Members { nodes: [0, 1, 2, 3, 1, 2], rest: Bending::fold(0.0), law: [], stiffness: k, damping: 0.0 }];
    Projected::<Bending, Linear, 6, 3, 12, 0>::new(4, 4, &[], &member, &[]).unwrap().project(&mut x, &step_of(h, 0, 1, &[]));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // |grad theta|²: 1 for each wing, and (1/2)² (1 + 1) for each end, whose two parts are at right angles.
    let weight = half * half * (1.0 + 1.0 + 2.0 * 0.5);
    let lambda = -2.0 * half / (weight + 1.0 / (k * h * h));
    let moved = |i: usize| vector(x[i][0] - start[i][0], x[i][1] - start[i][1], x[i][2] - start[i][2]);
    for i in [2, 3] {
        assert!((moved(i).norm() - (half * lambda).abs()).abs() < 1e-15, "{} {}", moved(i).norm(), half * lambda);
    }
    let net = (0..4).fold(Vector::default(), |sum, i| sum + moved(i));
    assert!(net.norm() < 1e-15 && moved(0).norm() > 0.05, "{net:?}");
}

#[test]
fn a_projected_rod_turns_frames_and_moves_points() {
    // A segment of 1 m along z whose frame is turned by a small angle about x: both give way, momentum and torque are kept.
    let angle = 1e-4_f64;
    let mut x = vec![[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], [(angle / 2.0).sin(), 0.0, 0.0, (angle / 2.0).cos()]];
    let member = [Members { nodes: [0, 1, 2], rest: [1.0, 1.0], law: [], stiffness: f64::INFINITY, damping: 0.0 }];
    let mut rod = Projected::<StretchShear, Linear, 3, 3, 2, 0>::new(3, 2, &[10.0], &member, &[]).unwrap();
    rod.project(&mut x, &step_of(0.1, 0, 1, &[]));
    // c = angle; gradients 1 for each point and for the frame; weights 1, 1, 10: the frame turns back by 10/12 of it.
    let turned = 2.0 * x[2][0];
    assert!((turned - angle / 6.0).abs() < 1e-8 * angle.sqrt(), "{turned} {angle}");
    assert!((x[0][1] + x[1][1]).abs() < 1e-15 && (x[0][1].abs() - angle / 12.0).abs() < 1e-8, "{x:?}");
}

/// Reference: the factor of the energy of an oscillator in a step of backward Euler is 1/(1 + z²), z = w h.
#[test]
fn a_spring_is_an_oscillator_under_backward_euler() {
    let (w, h) = (2.0 * std::f64::consts::PI, 0.02);
    let k = w * w;
    let mut sim = simulation(&format!(
        "precision = \"double\"\ntime = {{ fps = 50, frames = 500 }}\nworld.gravity = [0, 0, 0]\n[[system]]\nmethod = \"position_based\"\nsubsteps = 1\n\
         [[particles]]\nname = \"p\"\nposition = [[0, 0, 0], [2, 0, 0]]\nmass = [1, 1]\npin = [\"vertex 0\"]\nspring = [{{ between = [0, 1], stiffness = {k:e}, rest_length = 1 }}]\n"
    ));
    let start = sim.ledger().energy();
    run(&mut sim, 500);
    let (ratio, exact) = (sim.ledger().energy() / start, (1.0 + (w * h) * (w * h)).powi(-500));
    println!("E/E0 after 10 s: {ratio:.6e}, backward Euler {exact:.6e}, reference 3.960420e-4");
    assert!((exact - 3.960420e-4).abs() < 1e-9 && (ratio / exact - 1.0).abs() < 1e-9, "{ratio:e} {exact:e}");
}

/// A chain of N links hangs by one end: link i carries what hangs below it, so it is longer by alpha times that weight.
#[test]
fn a_hanging_chain_is_as_long_as_its_compliance_says() {
    let (n, length, density, modulus) = (20, 1.0, 0.4, 30.0);
    let (l, g) = (length / n as f64, 9.8);
    let stiffness = modulus / l;
    for substeps in [1, 2, 5, 20, 100] {
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime.fps = 25\n[[system]]\nmethod = \"position_based\"\nsubsteps = {substeps}\n\
             position_based = {{ iterations = 20000, tolerance = 1e-12 }}\n[[force]]\nkind = \"drag\"\nrate = 3\n\
             [[rope]]\nname = \"c\"\nfrom = [0, 0, 0]\nto = [0, 0, -{length}]\nsegments = {n}\ndensity = {density}\npin = [\"start\"]\nlinks = {{ structural = {modulus} }}\n"
        ));
        let frames = 120;
        run(&mut sim, frames);
        let x = positions(&sim, "c");
        let m = density * l;
        // The last mass is half of one.
        let weight = |i: usize| g * (m * (n - 1 - i) as f64 + 0.5 * m);
        let mut most: f64 = 0.0;
        for i in 0..n {
            let stretch = (x[i + 1] - x[i]).norm() - l;
            most = most.max((stretch - weight(i) / stiffness).abs() / (weight(0) / stiffness));
        }
        let sag = -x[n].z - length;
        let exact: f64 = (0..n).map(|i| weight(i) / stiffness).sum();
        println!("{substeps} sub-steps: longer by {sag:.8} m, exact {exact:.8} m; links off by {most:.1e} of the first one's stretch");
        assert!(exact > 0.05 && (sag / exact - 1.0).abs() < 5e-3 && most < 5e-3, "{substeps}: {sag} {exact} {most:e}");
    }
}

/// Period 4 K(sin(a/2)) sqrt(l/g) by the arithmetic-geometric mean.
#[test]
fn a_pendulum_keeps_time() {
    for degrees in [10.0_f64, 90.0] {
        let a = degrees.to_radians();
        let (mut p, mut q) = (1.0, (a / 2.0).cos());
        for _ in 0..8 {
            (p, q) = (0.5 * (p + q), (p * q).sqrt());
        }
        let exact = std::f64::consts::TAU * (1.0 / 9.8_f64).sqrt() / p;
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime.fps = 250\n[[system]]\nmethod = \"position_based\"\nsubsteps = 8\n\
             [[particles]]\nname = \"p\"\nposition = [[0, 0, 0], [{:e}, 0, {:e}]]\nmass = [1, 1]\npin = [\"vertex 0\"]\nspring = [{{ between = [0, 1], stiffness = 1e9, rest_length = 1 }}]\n",
            a.sin(),
            -a.cos()
        ));
        let mut samples = Vec::new();
        for i in 0..(250.0 * 2.2 * exact) as usize {
            let (x, v) = (positions(&sim, "p")[1], velocities(&sim, "p")[1]);
            samples.push((i as f64 / 250.0, x.x, v.x));
            step(&mut sim);
        }
        let zeros = common::zeros(&samples);
        let period = zeros[2].0 - zeros[0].0;
        println!("{degrees} degrees: period {period:.6} s, exact {exact:.6} s");
        assert!((period / exact - 1.0).abs() < 5e-3, "{period} {exact}");
    }
}

/// Corrections act between the ends as they are after a step, at lever arms from before it; free bodies get back what that takes.
#[test]
fn elements_keep_momentum_and_angular_momentum() {
    // A jelly and a sheet with hinges that fly and turn freely.
    let lost = |substeps: u32| {
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime.fps = 30\nworld.gravity = [0, 0, 0]\n[[system]]\nmethod = \"position_based\"\nsubsteps = {substeps}\n\
             [[block]]\nname = \"jelly\"\nsize = [0.3, 0.3, 0.3]\nresolution = [4, 4, 4]\nmaterial = {{ young = 2000, poisson = 0.4, damping = 0.01 }}\n\
             [[sheet]]\nname = \"sheet\"\nsize = [1, 1]\nresolution = [7, 7]\ndensity = 1\ncenter = [2, 0, 0]\nhinge = 1e-3\nlinks = {{ structural = {{ modulus = 50, damping = 0.5 }}, shear = 20 }}\n"
        ));
        let mut numbers = common::Numbers(5);
        for (name, n) in [("jelly", 64), ("sheet", 49)] {
            // A spin, and something without a pattern.
            let spun: Vec<Vector> =
                positions(&sim, name).iter().map(|x| vector(0.2, 3.0, 1.0).cross(*x) + numbers.vector() * 0.1).collect();
            assert_eq!(spun.len(), n);
            common::write(&mut sim, name, "velocity", &spun);
        }
        let before = sim.ledger();
        run(&mut sim, 5);
        let after = sim.ledger();
        let (p, l) = (Vector::from(before.momentum), Vector::from(before.angular_momentum.unwrap()));
        assert!(after.energy() < before.energy() && after.kinetic > 0.1 * before.kinetic);
        ((Vector::from(after.momentum) - p).norm() / p.norm(), (Vector::from(after.angular_momentum.unwrap()) - l).norm() / l.norm())
    };
    let found = [5, 100, 400].map(lost);
    println!("momentum and angular momentum lost: {found:?}");
    assert!(found.iter().all(|(p, l)| *p < 1e-12 && *l < 1e-12), "{found:?}");
}

/// The trap of two successive projections: the shear law alone would shrink the block.
#[test]
fn an_unloaded_block_stays_at_rest() {
    for (young, poisson, substeps) in [(1e4, 0.45, 10), (1e6, 0.4, 10), (1e5, 0.45, 40)] {
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime.fps = 60\nworld.gravity = [0, 0, 0]\n[[system]]\nmethod = \"position_based\"\nsubsteps = {substeps}\n\
             [[block]]\nname = \"b\"\nsize = [0.2, 0.2, 0.2]\nresolution = [4, 4, 4]\nmaterial = {{ young = {young:e}, poisson = {poisson} }}\n"
        ));
        let start = positions(&sim, "b");
        run(&mut sim, 60);
        let off = positions(&sim, "b").iter().zip(&start).map(|(x, s)| (*x - *s).norm()).fold(0.0, f64::max);
        println!("young {young:e}, poisson {poisson}, {substeps} sub-steps: moved by {off:.1e} m");
        assert!(off < 1e-9, "{off:e}");
    }
    // One tetrahedron under tension: both laws together take the step of implicit Euler to first order, checked by the balance of forces.
    let x = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let (b, volume) = rest_matrix(x.map(Into::into));
    let (mu, lambda, h) = (5.0, 40.0, 1e-3);
    let mut rest = [1.0 + mu / lambda; 10];
    rest[..9].copy_from_slice(&b);
    let shear = [Members { nodes: [0, 1, 2, 3], rest: b, law: [], stiffness: mu * volume, damping: 0.0 }];
    let bulk = [Members { nodes: [0, 1, 2, 3], rest, law: [], stiffness: lambda * volume, damping: 0.0 }];
    let stretched = |x: [f64; 3]| [1.1 * x[0], x[1], x[2], 1.0];
    let mut rows: Vec<Row> = x.map(stretched).to_vec();
    Neohookean::new(4, &shear, &bulk, 0.0).unwrap().project(&mut rows, &step_of(h, 0, 1, &[]));
    // P = mu F + lambda (J - 1 - mu/lambda) cof F with F = diag(1.1, 1, 1): forces -V P on the three outer corners, dx = h² f.
    let j = 1.1;
    let bracket = lambda * (j - 1.0) - mu;
    let p = [mu * 1.1 + bracket, mu + bracket * 1.1, mu + bracket * 1.1];
    for c in 0..3 {
        let moved = rows[c + 1][c] - stretched(x[c + 1])[c];
        let exact = -volume * p[c] * h * h;
        // One implicit step differs from the explicit one by h² times the stiffness, 4e-5.
        assert!((moved / exact - 1.0).abs() < 1e-3, "{c}: {moved:e} {exact:e}");
    }
}

/// The converged result does not depend on the path to it.
#[test]
fn the_converged_sag_is_the_same_for_all_steps_and_rates() {
    let sag = |fps: u32, substeps: u32, iterations: u32| {
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime.fps = {fps}\n[[system]]\nmethod = \"position_based\"\nsubsteps = {substeps}\nposition_based = {{ iterations = {iterations}, tolerance = 1e-10 }}\n\
             [[force]]\nkind = \"drag\"\nrate = 4\n[[sheet]]\nname = \"s\"\nsize = [1, 1]\nresolution = [9, 9]\ndensity = 0.5\npin = [\"corner 0 0\", \"corner 1 0\", \"corner 0 1\", \"corner 1 1\"]\n\
             links = {{ structural = 100, shear = 30, bend = 1 }}\nhinge = 1e-3\n"
        ));
        run(&mut sim, 8 * fps as usize);
        let lowest = positions(&sim, "s").iter().map(|x| -x.z).fold(0.0, f64::max);
        (lowest, sim.ledger().speed.unwrap())
    };
    let (reference, _) = sag(24, 4, 4000);
    for (fps, substeps, iterations) in [(24, 16, 4000), (60, 2, 4000), (24, 200, 1), (100, 50, 1)] {
        let (lowest, speed) = sag(fps, substeps, iterations);
        println!(
            "{fps} fps, {substeps} sub-steps, {iterations} sweeps: sag {lowest:.6} m, {:.1e} off, speed {speed:.0e} m/s",
            lowest / reference - 1.0
        );
        assert!((lowest / reference - 1.0).abs() < 5e-3 && reference > 0.02, "{lowest} {reference}");
    }
}

/// The scene's two words for it mean the same.
#[test]
fn the_method_and_the_integrator_are_two_words_for_one_thing() {
    let end = |words: &str| {
        let mut sim: Simulation = simulation(&format!(
            "precision = \"double\"\n[[system]]\n{words}\nsubsteps = 5\n[[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 9\npin = [\"start\"]\n"
        ));
        run(&mut sim, 10);
        list(&positions(&sim, "r"))
    };
    let named = end("integrator = \"position_based\"");
    assert_eq!(end("method = \"position_based\""), named);
    // One word away from a force-based scheme, which goes elsewhere.
    assert_eq!(end("method = \"position_based\"\nintegrator = \"implicit_euler\""), named);
    assert_ne!(end("method = \"dynamics\"\nintegrator = \"implicit_euler\""), named);
}
