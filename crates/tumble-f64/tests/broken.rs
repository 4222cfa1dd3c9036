//! Breakable links: they break beyond their strain, not below, stay broken, and are counted.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{positions, run, simulation, step, vector, write};
use tumble_f64::scene::Simulation;
use tumble_interface::scene::Integrator;
use tumble_interface::{Data, Engine};

/// A rope of 8 links with a strain limit, hung by its start and pulled down by its weight: the top link carries the most,
/// q l (i - 1/2) with i = 8 in units of the modulus.                    (catenary.5)
fn hanging(scheme: Integrator, limit: f64) -> Simulation {
    let mut sim = simulation(&format!(
        "time.fps = 50\nworld.gravity = [0, 0, -10]\n[[system]]\nintegrator = \"{}\"\nsubsteps = 20\n\
         [[rope]]\nname = \"rope\"\nfrom = [0, 0, 0]\nto = [0, 0, -2]\nsegments = 8\ndensity = 0.5\npin = [\"start\"]\n\
         links = {{ structural = {{ modulus = 100, damping = 2, break_strain = {limit} }} }}\n",
        scheme.name()
    ));
    let rope = tumble_f64::reference::HangingRope { length: 2.0, weight: 5.0, stiffness: 100.0, load: 0.0 };
    let places: Vec<_> = (0..=8).map(|i| vector(0.0, 0.0, -rope.depth(0.25 * f64::from(i)))).collect();
    write(&mut sim, "rope", "position", &places);
    sim
}

/// Load on the top link: 5 N/m x 0.25 m x 7.5 = 9.375 N, strain 0.09375.
const STRAIN: f64 = 0.09375;

#[test]
fn links_break_beyond_their_strain_and_not_below() {
    for scheme in common::fixed() {
        // Implicit schemes solve to 1e-10; nothing moves until a link breaks.
        let mut strong = hanging(scheme, STRAIN * 1.001);
        let report = run(&mut strong, 10);
        assert_eq!((report.broken, strong.ledger().broken.unwrap()), (0, 0), "{}", scheme.name());
        let mut weak = hanging(scheme, STRAIN * 0.999);
        let first = step(&mut weak);
        assert_eq!((first.broken, weak.ledger().broken.unwrap()), (1, 1), "{}", scheme.name());
        // Without its top link the rope falls, and nothing else breaks: falling unloads it.
        let (top, below) = (positions(&weak, "rope")[1].z, positions(&weak, "rope")[8].z);
        let more = run(&mut weak, 20);
        assert_eq!((more.broken, weak.ledger().broken.unwrap()), (0, 1));
        let fallen = positions(&weak, "rope");
        assert!(fallen[1].z < top - 0.3 && fallen[8].z < below - 0.3, "{}", scheme.name());
        assert_eq!(fallen[0], vector(0.0, 0.0, 0.0));
        // The energy of a broken link has left the books, and the pin holds nothing more.
        println!("{:18} broken at strain {STRAIN}: end at {:.3} m after 0.42 s", scheme.name(), fallen[8].z);
    }
}

/// A link that has broken does not heal when its ends come close again, nor by saving and restoring.
#[test]
fn what_is_broken_stays_broken() {
    let mut sim = simulation(
        "time.fps = 50\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"velocity_verlet\"\nsubsteps = 10\n\
         [[particles]]\nname = \"p\"\nposition = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]\nvelocity = [[0, 0, 0], [0, 0, 0], [3, 0, 0]]\nmass = [1, 1, 1]\n\
         spring = [{ between = [0, 1], stiffness = 50 }, { between = [1, 2], stiffness = 20, break_strain = 0.2 }]\n",
    );
    let saved_whole = sim.save(&[]);
    let report = run(&mut sim, 10);
    assert_eq!((report.broken, sim.ledger().broken.unwrap()), (1, 1));
    let saved = sim.save(&[]);
    write(&mut sim, "p", "position", &[vector(0.0, 0.0, 0.0), vector(1.0, 0.0, 0.0), vector(1.5, 0.0, 0.0)]);
    write(&mut sim, "p", "velocity", &[vector(0.0, 0.0, 0.0); 3]);
    run(&mut sim, 10);
    // No force on anything: the first spring is at rest, the second is gone.
    assert_eq!(positions(&sim, "p")[2], vector(1.5, 0.0, 0.0));
    assert_eq!(sim.ledger().elastic, 0.0);
    sim.restore(&saved).unwrap();
    assert_eq!(sim.ledger().broken.unwrap(), 1);
    let frame = sim.frame(&["link_strain"]);
    let Data::F64(strain) = &frame.column("p", "link_strain").unwrap().data else { panic!() };
    println!("strains after breaking: {strain:?}");
    assert!(strain.len() == 2 && strain[0].abs() < 0.2 && strain[1].is_nan());
    // Restoring the state from before mends it: it breaks again at the same time.
    sim.restore(&saved_whole).unwrap();
    assert_eq!(sim.ledger().broken.unwrap(), 0);
    assert_eq!(run(&mut sim, 10).broken, 1);
    assert_eq!(sim.save(&[]), saved);
}

/// Compression breaks as well: |r|/l0.
#[test]
fn compression_breaks_too() {
    for (speed, breaks) in [(-0.4, 0), (-0.6, 1)] {
        // r = -v/w sin w t with w = sqrt(k/M) = sqrt(2 · 8) = 4: down to -0.1 and -0.15 m against 0.12, at 0.39 s; longer than at
        // rest only from 0.79 s on.
        let mut sim = simulation(&format!(
            "time.fps = 50\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"rk4\"\nsubsteps = 10\n\
             [[particles]]\nname = \"p\"\nposition = [[0, 0, 0], [1, 0, 0]]\nvelocity = [[0, 0, 0], [{speed}, 0, 0]]\n\
             spring = [{{ between = [0, 1], stiffness = 8, break_strain = 0.12 }}]\n"
        ));
        assert_eq!(run(&mut sim, 30).broken, breaks);
        assert!(positions(&sim, "p")[1].x - positions(&sim, "p")[0].x < 1.0);
    }
}
