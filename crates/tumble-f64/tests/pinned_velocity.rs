//! Regression: writing velocities of a whole object set its pinned masses in motion, and they left their place.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{positions, run, simulation, vector, velocities, write};

#[test]
fn a_pinned_mass_stays_whatever_velocity_is_written() {
    for scheme in common::every() {
        let mut sim = simulation(&format!(
            "[[system]]\nintegrator = \"{}\"\n[[rope]]\nname = \"rope\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 4\npin = [\"start\"]\n\
             links = {{ structural = {{ modulus = 50, damping = 1 }} }}\n",
            scheme.name()
        ));
        write(&mut sim, "rope", "velocity", &[vector(1.0, 2.0, 3.0); 5]);
        run(&mut sim, 2);
        assert_eq!(positions(&sim, "rope")[0], vector(0.0, 0.0, 0.0), "{}", scheme.name());
        assert_eq!(velocities(&sim, "rope")[0], vector(0.0, 0.0, 0.0));
        assert!(positions(&sim, "rope")[4].y > 0.05, "the others move");
    }
}
