//! Surfaces that tear: at their strength and not below, without loss of mass or momentum, for good, and the same after saving.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, run, simulation, step, vector, velocities, write};
use std::collections::BTreeMap;
use tumble_f64::scene::Simulation;
use tumble_interface::{Data, Engine};

const SIZE: usize = 9;
/// Every kind of element that a sheet can have.
const ALL: &str = "links = { structural = { modulus = 40, damping = 0.02 }, shear = 20, bend = 1 }\nhinge = 1e-4\nisometric = 1e-4\n\
                   membrane = { warp = 30, damping = 1e-3 }\narea = 5\n";

fn sheet(scheme: &str, substeps: u32, elements: &str, tear: &str) -> Simulation {
    let substeps = if scheme == "dormand_prince" { String::new() } else { format!("substeps = {substeps}") };
    simulation(&format!(
        "time.fps = 100\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"{scheme}\"\n{substeps}\nsolver.newton_iterations = 40\n\
         [[sheet]]\nname = \"s\"\nsize = [1, 1]\nresolution = [{SIZE}, {SIZE}]\ndensity = 0.2\n{elements}{tear}\n"
    ))
}

fn triangles(sim: &Simulation) -> Vec<[u32; 3]> {
    let frame = sim.frame(&["position"]);
    let Data::U32(flat) = &frame.column("s", "triangles").unwrap().data else { panic!() };
    flat.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect()
}

/// How many pieces hang together by edges.
fn pieces(triangles: &[[u32; 3]]) -> usize {
    sizes(triangles).len()
}

/// The triangles of each piece, the fewest first.
fn sizes(triangles: &[[u32; 3]]) -> Vec<usize> {
    let mut of: Vec<usize> = (0..triangles.len()).collect();
    let mut edges: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for (t, triangle) in triangles.iter().enumerate() {
        for k in 0..3 {
            let [a, b] = [triangle[k], triangle[(k + 1) % 3]];
            if let Some(other) = edges.insert([a.min(b), a.max(b)], t) {
                let (from, to) = (of[t], of[other]);
                of.iter_mut().filter(|p| **p == from).for_each(|p| *p = to);
            }
        }
    }
    of.sort_unstable();
    let mut sizes: Vec<usize> = of.chunk_by(|a, b| a == b).map(<[usize]>::len).collect();
    sizes.sort_unstable();
    sizes
}

/// Both halves fly apart, along x, with a turn and some shear.
fn fling(sim: &mut Simulation) {
    let x = positions(sim, "s");
    let v: Vec<Vector> = x.iter().map(|x| vector(14.0 * x.x.signum() * x.x.abs().sqrt() + x.y, 0.5 - 0.7 * x.x, 0.3 * x.x * x.y)).collect();
    write(sim, "s", "velocity", &v);
}

/// A tear gives nothing and takes nothing but the energy of what has broken.
#[test]
fn mass_and_momentum_outlast_a_tear() {
    for (scheme, substeps) in [("symplectic_euler", 40), ("rk4", 40), ("implicit_euler", 4), ("position_based", 10), ("dormand_prince", 1)]
    {
        let mut sim = sheet(scheme, substeps, ALL, "tear = { strain = 0.3, spread = 0.2 }");
        fling(&mut sim);
        let before = sim.ledger();
        let report = run(&mut sim, 30);
        let after = sim.ledger();
        let off = |a: [f64; 3], b: [f64; 3]| (Vector::from(a) - Vector::from(b)).norm();
        let (p, l) = (off(before.momentum, after.momentum), off(before.angular_momentum.unwrap(), after.angular_momentum.unwrap()));
        let now = triangles(&sim);
        println!(
            "{scheme:18} {} vertices came apart, {} pieces; mass off by {:.1e}, momentum by {p:.1e}, angular momentum by {l:.1e}; energy {:.3} -> {:.3} J",
            report.broken,
            pieces(&now),
            (after.mass - before.mass).abs(),
            before.kinetic + before.elastic,
            after.kinetic + after.elastic
        );
        assert!(report.broken > 4 && pieces(&now) > 1, "{scheme}");
        assert_eq!(after.broken.unwrap(), report.broken);
        assert!((after.mass - before.mass).abs() < 1e-14);
        // 0.2 kg at some m/s; implicit schemes solve to 1e-10 of their forces, and one iteration of theirs turns by second order.
        let bound = if scheme == "implicit_euler" { 1e-6 } else { 1e-12 };
        assert!(p < bound, "{scheme}: {p:e}");
        // Symplectic Euler keeps it to rounding, explicit schemes to their order; the others turn with what they damp, torn or not.
        let turn = match scheme {
            "symplectic_euler" => Some(1e-12),
            "rk4" | "dormand_prince" => Some(1e-7),
            _ => None,
        };
        assert!(turn.is_none_or(|most| l < most), "{scheme}: {l:e}");
        assert!(after.kinetic + after.elastic < before.kinetic + before.elastic + 1e-6);
        // No triangle has lost its corners, and each vertex belongs to triangles that hang together.
        assert_eq!(now.len(), 2 * (SIZE - 1) * (SIZE - 1));
        assert!(now.iter().all(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]));
    }
}

/// In the sub-step in which a vertex first comes apart, all is as without a tear but the elements that break.
#[test]
fn a_tear_moves_nothing() {
    for scheme in ["symplectic_euler", "implicit_euler", "position_based"] {
        let start = |tear: &str| {
            let mut sim = simulation(&format!(
                "time.fps = 4000\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"{scheme}\"\nsubsteps = 1\n\
                 [[sheet]]\nname = \"s\"\nsize = [1, 1]\nresolution = [{SIZE}, {SIZE}]\ndensity = 0.2\npin = [\"corner 0 0\", \"edge x+\"]\n{ALL}{tear}\n"
            ));
            fling(&mut sim);
            sim
        };
        let (mut torn, mut whole) = (start("tear = { strain = 0.3, spread = 0.2 }"), start("tear = { strain = 1000 }"));
        let mut steps = 0;
        while torn.ledger().broken.unwrap() == 0 && steps < 400 {
            step(&mut torn);
            step(&mut whole);
            steps += 1;
        }
        let (a, b) = (torn.ledger(), whole.ledger());
        let off = |a: [f64; 3], b: [f64; 3]| (Vector::from(a) - Vector::from(b)).norm();
        let off = [
            off(a.momentum, b.momentum),
            off(a.angular_momentum.unwrap(), b.angular_momentum.unwrap()),
            a.kinetic - b.kinetic,
            a.mass - b.mass,
        ];
        println!(
            "{scheme}: {} apart after {steps} steps; momentum, angular momentum, kinetic energy, mass off by {}",
            a.broken.unwrap(),
            common::show(&off)
        );
        assert!(a.broken > Some(0) && off.iter().all(|e| e.abs() < 1e-13), "{scheme}: {off:?}");
        assert!(a.elastic < b.elastic, "{scheme}");
        // Held vertices never split, however long.
        run(&mut torn, 200);
        let (x, mut used) = (positions(&torn, "s"), triangles(&torn).concat());
        used.sort_unstable();
        used.dedup();
        let now: Vec<Vector> = used.into_iter().map(|i| x[i as usize]).collect();
        let held: Vec<Vector> = positions(&start(""), "s").into_iter().filter(|x| x.x > 0.4999 || x.x < -0.4999 && x.y < -0.4999).collect();
        assert!(torn.ledger().broken > a.broken && held.len() == SIZE + 1);
        assert!(held.iter().all(|x| now.iter().filter(|y| **y == *x).count() == 1), "{scheme}");
    }
}

/// Separated pieces share no element: each conserves its momentum.
#[test]
fn torn_pieces_exert_nothing_on_each_other() {
    let mut sim = sheet("symplectic_euler", 40, ALL, "tear = { strain = 0.3, spread = 0.2 }");
    let mut around = vec![0_u32; SIZE * SIZE];
    let whole = triangles(&sim);
    whole.iter().flatten().for_each(|i| around[*i as usize] += 1);
    fling(&mut sim);
    run(&mut sim, 20);
    let now = triangles(&sim);
    let spread = |piece: &mut Vec<usize>| {
        for t in &now {
            let least = t.iter().map(|i| piece[*i as usize]).min().unwrap();
            t.iter().for_each(|i| piece[*i as usize] = least);
        }
    };
    let mut piece: Vec<usize> = (0..positions(&sim, "s").len()).collect();
    loop {
        let before = piece.clone();
        spread(&mut piece);
        if piece == before {
            break;
        }
    }
    // A triangle has its part of the mass of each corner: 0.2 kg/m² over a cell, half of it at a rim, a quarter in a corner of the sheet.
    let rim = |i: u32| if i == 0 || i as usize == SIZE - 1 { 0.5 } else { 1.0 };
    let mass = |i: u32| 0.2 * rim(i % SIZE as u32) * rim(i / SIZE as u32) / ((SIZE - 1) * (SIZE - 1)) as f64;
    let momenta = |sim: &Simulation| {
        let (v, mut found) = (velocities(sim, "s"), BTreeMap::<usize, Vector>::new());
        for (i, now) in whole.iter().flatten().zip(now.iter().flatten()) {
            let part = v[*now as usize] * (mass(*i) / f64::from(around[*i as usize]));
            let sum = found.entry(piece[*now as usize]).or_default();
            *sum = *sum + part;
        }
        found
    };
    let before = momenta(&sim);
    let all: Vector = before.values().fold(Vector::default(), |a, b| a + *b);
    assert!((all - Vector::from(sim.ledger().momentum)).norm() < 1e-12 && before.len() > 1, "{all:?}");
    let energy = sim.ledger().elastic;
    assert_eq!(run(&mut sim, 2).broken, 0);
    let worst = momenta(&sim).iter().map(|(k, p)| (*p - before[k]).norm()).fold(0.0, f64::max);
    println!(
        "{} pieces, whose elastic energy goes from {energy:.4} to {:.4} J: momenta change by {worst:.1e}",
        before.len(),
        sim.ledger().elastic
    );
    assert!(worst < 1e-13 && (sim.ledger().elastic / energy - 1.0).abs() > 0.1);
}

/// A sheet that is stretched evenly holds up to its strength and gives way beyond it.
#[test]
fn it_tears_beyond_its_strength_and_not_below() {
    for scheme in ["symplectic_euler", "position_based"] {
        for (stretch, torn) in [(1.099, false), (1.101, true)] {
            // So short a step that nothing moves by much.
            let mut sim = sheet(scheme, 1000, "", "tear.strain = 0.1");
            let x: Vec<Vector> = positions(&sim, "s").iter().map(|x| vector(stretch * x.x, x.y, x.z)).collect();
            write(&mut sim, "s", "position", &x);
            let whole = triangles(&sim);
            let report = step(&mut sim);
            assert_eq!(report.broken > 0, torn, "{scheme} at {stretch}");
            assert_eq!(triangles(&sim) != whole, torn);
        }
    }
}

/// Links along edges are two halves where a surface may tear; as long as it is whole, that changes nothing.
#[test]
fn a_whole_surface_is_as_stiff_as_one_that_cannot_tear() {
    for (scheme, substeps, bound) in [("rk4", 40, 1e-12), ("implicit_euler", 2, 1e-6)] {
        let mut one = sheet(scheme, substeps, ALL, "");
        let mut other = sheet(scheme, substeps, ALL, "tear = { strain = 50, spare = 7 }");
        let n = SIZE * SIZE;
        assert_eq!(positions(&other, "s").len(), n + 7);
        let bent: Vec<Vector> = positions(&one, "s").iter().map(|x| vector(1.3 * x.x, x.y + 0.2 * x.x * x.x, 0.3 * x.x * x.y)).collect();
        write(&mut one, "s", "position", &bent);
        let idle = bent.iter().copied().chain([bent[0]; 7]).collect::<Vec<_>>();
        write(&mut other, "s", "position", &idle);
        run(&mut one, 10);
        run(&mut other, 10);
        let (a, b) = (positions(&one, "s"), positions(&other, "s"));
        let worst = (0..n).map(|i| (a[i] - b[i]).norm()).fold(0.0, f64::max);
        let moved = (0..n).map(|i| (a[i] - bent[i]).norm()).fold(0.0, f64::max);
        println!("{scheme}: {worst:.1e} m apart after a way of {moved:.2} m");
        assert!(worst < bound && moved > 0.05);
        assert!((one.ledger().mass - other.ledger().mass).abs() < 1e-15);
    }
}

/// Tears are permanent, and a snapshot contains them.
#[test]
fn a_torn_surface_is_saved_and_restored() {
    for (scheme, substeps) in [("velocity_verlet", 40), ("implicit_euler", 4), ("position_based", 10)] {
        let mut sim = sheet(scheme, substeps, ALL, "tear = { strain = 0.3, spread = 0.2 }");
        fling(&mut sim);
        let whole = sim.save(&[]);
        run(&mut sim, 12);
        let (torn, middle) = (triangles(&sim), sim.save(&[]));
        run(&mut sim, 10);
        let (end, broken) = (sim.save(&[]), sim.ledger().broken.unwrap());
        assert!(broken > 0 && pieces(&torn) <= pieces(&triangles(&sim)));
        // On from the middle, in this simulation and in a fresh one.
        sim.restore(&middle).unwrap();
        assert_eq!(triangles(&sim), torn);
        run(&mut sim, 10);
        assert!(sim.save(&[]) == end, "{scheme}: other bits from the middle on");
        let mut fresh = sheet(scheme, substeps, ALL, "tear = { strain = 0.3, spread = 0.2 }");
        fresh.restore(&middle).unwrap();
        run(&mut fresh, 10);
        assert!(fresh.save(&[]) == end, "{scheme}: other bits in a fresh simulation");
        // Whole again.
        sim.restore(&whole).unwrap();
        assert_eq!((pieces(&triangles(&sim)), sim.ledger().broken.unwrap()), (1, 0));
        run(&mut sim, 22);
        assert!(sim.save(&[]) == end, "{scheme}: other bits from the start");
    }
}

/// Without spare vertices nothing tears; weak regions tear first.
#[test]
fn spare_vertices_run_out_and_weak_places_tear_first() {
    let mut sim = sheet("position_based", 10, ALL, "tear = { strain = 0.3, spare = 3 }");
    fling(&mut sim);
    assert_eq!(run(&mut sim, 20).broken, 3);
    let mut sim =
        sheet("position_based", 20, "", "tear = { strain = 50, weak = [{ center = [0.2, 0.5, 0], radius = 0.2, strain = 0.05 }] }");
    let whole = triangles(&sim);
    let start = positions(&sim, "s");
    let v: Vec<Vector> = start.iter().map(|x| vector(8.0 * x.x, 0.0, 0.0)).collect();
    write(&mut sim, "s", "velocity", &v);
    let report = run(&mut sim, 20);
    let changed: Vec<u32> = whole.iter().flatten().zip(triangles(&sim).iter().flatten()).filter(|(a, b)| a != b).map(|(a, _)| *a).collect();
    println!(
        "{} came apart, at corners {changed:?}; fastest {:.2} m/s",
        report.broken,
        velocities(&sim, "s").iter().map(|v| v.norm()).fold(0.0, f64::max)
    );
    assert!(report.broken > 0);
    // An edge is weak if its middle is within the ball, and its ends lie no farther than half a diagonal from there.
    assert!(changed.iter().all(|i| (start[*i as usize] - vector(0.2, 0.5, 0.0)).norm() < 0.2 + 0.09));
}

/// Pulled apart by its own momentum under gravity, a sheet tears into pieces of six triangles and more; splits that are refused leave nothing
/// behind: a fresh simulation that takes up the state goes on to the same bits.
#[test]
fn a_tear_leaves_no_scraps() {
    for (scheme, substeps) in [("position_based", 10), ("verlet", 40), ("implicit_euler", 4)] {
        let text = format!(
            "time.fps = 60\nworld.gravity = [0, 0, -9.8]\n[[system]]\n{}\nsubsteps = {substeps}\n\
             [[sheet]]\nname = \"s\"\nsize = [1, 1]\nresolution = [15, 15]\ncenter = [0, 0, 3]\ndensity = 0.2\nlinks.structural = 300\nlinks.shear = 100\n\
             tear = {{ strain = 0.15, spread = 0.5 }}\n",
            if scheme == "position_based" { "method = \"position_based\"".into() } else { format!("integrator = \"{scheme}\"") }
        );
        let mut sim = simulation(&text);
        // Away from the middle, unevenly.
        let v: Vec<Vector> = positions(&sim, "s").iter().map(|x| vector(40.0 * x.x + 9.0 * x.y * x.y, 30.0 * x.y, 5.0 * x.x)).collect();
        write(&mut sim, "s", "velocity", &v);
        let mut middle = Vec::new();
        for frame in 0..16 {
            run(&mut sim, 1);
            if frame == 5 {
                middle = sim.save(&[]);
            }
        }
        let triangles = triangles(&sim);
        let sizes = sizes(&triangles);
        println!("{scheme}: pieces {sizes:?}");
        assert!(sizes.len() > 3 && sizes[0] >= 6, "{scheme}: {sizes:?}");
        let mut fresh = simulation(&text);
        fresh.restore(&middle).unwrap();
        run(&mut fresh, 10);
        assert_eq!(fresh.hash(), sim.hash(), "{scheme}");
    }
}
