//! Ropes as chains that are solved as a whole: docs/theory/positions.md, (positions.7).

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::*;
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

const G: f64 = 9.8;

/// A rope of 1 m and 0.1 kg that hangs from its start, with a modulus of 1 kN.
fn hanging(segments: usize, system: &str, links: &str) -> Simulation {
    simulation(&format!(
        "precision = \"double\"\ntime = {{ fps = 24, frames = 96 }}\n[[system]]\nmethod = \"position_based\"\n{system}\n[[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [0, 0, -1]\n\
         segments = {segments}\ndensity = 0.1\npin = [\"start\"]\nlinks.structural = {{ modulus = 1000, {links} }}\n[[force]]\nkind = \"drag\"\nrate = 4\n"
    ))
}

fn stretch(sim: &Simulation) -> f64 {
    positions(sim, "r").windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum::<f64>() - 1.0
}

#[test]
fn a_rope_of_any_number_of_pieces_hangs_as_long_as_its_modulus_says() {
    for segments in [2, 4, 16, 64, 256, 1024] {
        for system in ["", "substeps = 4", "substeps = 80", "substeps = 20\nposition_based.iterations = 3"] {
            let mut sim = hanging(segments, system, "");
            run(&mut sim, 96);
            // Each piece bears what hangs below it: the sum of (rho g l/k)(n - i), the last mass being half of one.
            let exact = 0.1 * G / (2.0 * 1000.0);
            let found = stretch(&sim) / exact;
            assert!((found - 1.0).abs() < 0.01, "{segments} pieces, {system}: {found}");
        }
    }
}

#[test]
fn a_plain_rope_keeps_its_length() {
    for segments in [4, 64, 512] {
        let mut sim = hanging(segments, "substeps = 20\nposition_based.projection = \"plain\"", "");
        run(&mut sim, 48);
        assert!(stretch(&sim).abs() < 1e-6, "{segments}: {}", stretch(&sim));
    }
}

#[test]
fn damping_takes_the_energy_of_stretching_and_leaves_that_of_falling() {
    // Dropped with its lower end stretched: without damping it rings, with damping it does not, and its centre falls freely in both.
    let mut left = Vec::new();
    for damping in [0.0, 5.0] {
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime = {{ fps = 100, frames = 20 }}\n[[system]]\nmethod = \"position_based\"\nsubsteps = 50\n[[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [0, 0, \
             -1.05]\nlength = 1\nsegments = 20\ndensity = 0.1\nlinks.structural = {{ modulus = 50, damping = {damping} }}\n"
        ));
        run(&mut sim, 20);
        let books = sim.ledger();
        assert!((books.momentum[2] / books.mass + G * 0.2).abs() < 1e-9, "{:?}", books.momentum);
        let own = books.kinetic + books.elastic - books.momentum[2].powi(2) / (2.0 * books.mass);
        left.push(own);
    }
    let start = 0.5 * 50.0 * 0.05_f64.powi(2);
    assert!(left[0] > 0.3 * start && left[1] < 0.02 * start, "{left:?} of {start}");
}

#[test]
fn a_free_rope_keeps_its_momenta_and_a_broken_one_parts() {
    let mut sim = simulation(
        "precision = \"double\"\nworld.gravity = [0, 0, 0]\ntime = { fps = 24, frames = 48 }\n[[system]]\nmethod = \"position_based\"\nsubsteps = 10\n[[rope]]\nname = \"r\"\n\
         from = [0, 0, 0]\nto = [1, 0, 0.3]\nlength = 1.2\nsegments = 40\ndensity = 0.1\nvelocity = [1, 2, 0]\nlinks.structural = { modulus = 1000, break_strain = 0.2 }\n[[particles]]\nname = \
         \"p\"\nposition = [[9, 0, 0]]\n",
    );
    let start = sim.ledger();
    run(&mut sim, 24);
    let books = sim.ledger();
    for c in 0..3 {
        assert!((books.momentum[c] - start.momentum[c]).abs() < 1e-11, "{:?} {:?}", books.momentum, start.momentum);
        let [now, then] = [&books, &start].map(|books| books.angular_momentum.unwrap()[c]);
        assert!((now - then).abs() < 1e-10, "{now} {then}");
    }
    // Pulled apart in its middle.
    let mut v = velocities(&sim, "r");
    let half = v.len() / 2;
    v.iter_mut().enumerate().for_each(|(i, v)| v.x += if i < half { -20.0 } else { 20.0 });
    write(&mut sim, "r", "velocity", &v);
    run(&mut sim, 10);
    let x = positions(&sim, "r");
    assert!((x[half] - x[half - 1]).norm() > 5.0);
    let lengths = |x: &[Vector]| x.windows(2).map(|pair| (pair[1] - pair[0]).norm()).fold(0.0, f64::max);
    // The jerk takes a neighbour or two along.
    assert!(lengths(&x[..half - 3]) < 0.04 && lengths(&x[half + 3..]) < 0.04, "{x:?}");
}

#[test]
fn a_taut_rope_between_two_pins_stays_between_them() {
    // Too short, exact or a little long for its way; oblique, with and without weight.
    for segments in [10, 64] {
        for part in [0.9, 0.99, 1.0, 1.01] {
            for (gravity, projection) in [(0.0, "plain"), (9.8, "plain"), (0.0, "compliant"), (9.8, "compliant")] {
                let way = (1.0_f64 + 0.09 + 0.49).sqrt();
                let mut sim = simulation(&format!(
                    "world.gravity = [0, 0, -{gravity}]\ntime = {{ fps = 24, frames = 24 }}\n[[system]]\nmethod = \"position_based\"\nsubsteps = 10\nposition_based.projection = \
                     \"{projection}\"\n[[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [1, 0.3, 0.7]\nlength = {}\nsegments = {segments}\ndensity = 0.05\npin = [\"start\", \"end\"]\n\
                     links.structural = 1e5\n",
                    part * way
                ));
                for frame in 0..24 {
                    step(&mut sim);
                    for x in positions(&sim, "r") {
                        // From the line between its ends, at most as far as a rope of that length may hang.
                        let off = x - Vector::from([1.0, 0.3, 0.7]) * (x.dot([1.0, 0.3, 0.7].into()) / (way * way));
                        let bound = 0.5 * ((part * way).powi(2) - way * way).max(0.0).sqrt() + 0.02;
                        assert!(
                            off.norm() < bound,
                            "{segments} pieces, {part} of its way, {gravity} m/s², {projection}, frame {frame}: {}",
                            off.norm()
                        );
                    }
                }
            }
        }
    }
}
