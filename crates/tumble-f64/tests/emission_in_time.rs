//! Emitters whose lifetimes, radii and colours change: particles have those of their birth.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common::{run, simulation, step};
use crate::emission::{ids, numbers};
use std::collections::HashSet;
use tumble_f64::scene::Simulation;
use tumble_interface::{Engine, Scene};

/// A lifetime, radius and colour that change are those of the time of birth, also after a restore and as rows move.
#[test]
fn what_changes_in_time_is_that_of_the_birth() {
    let text = "time = { fps = 24, frames = 48 }\n[[emitter]]\nname = \"p\"\nrate = 240\nfrom.point = {}\n\
                lifetime = { keys = [[0, 0.9], [1, 0.1]] }\nradius = \"0.01 + 0.02*t\"\ncolor = [0.2, \"0.5*t\", 0]\ncolor_end = { keys = [[0, 0, 0, 1]] }\n\
                [[emitter]]\nname = \"q\"\nrate = 100\nlifetime = 0.2\nfrom.point = {}\n";
    let mut sim = simulation(text);
    let lifetime = |born: f64| 0.9 - 0.8 * born.min(1.0);
    let check = |sim: &Simulation, frame: usize| {
        let (ids, t) = (ids(sim, "p"), frame as f64 / 24.0);
        let (age, radius, color) = (numbers(sim, "p", "age"), numbers(sim, "p", "radius"), numbers(sim, "p", "color"));
        let born = |id: u32| f64::from(id + 1) / 240.0;
        for (k, id) in ids.iter().enumerate() {
            let (born, age) = (born(*id), age[k]);
            assert!((age - (t - born)).abs() < 1e-9 && age < lifetime(born) + 1e-9);
            let share = age / lifetime(born);
            let expected = [0.2 * (1.0 - share), 0.5 * born * (1.0 - share), share];
            assert!((radius[k] - 0.01 - 0.02 * born).abs() < 1e-9, "{id}: {}", radius[k]);
            assert!((0..3).all(|c| (color[3 * k + c] - expected[c]).abs() < 1e-6), "{id}: {expected:?} {:?}", &color[3 * k..3 * k + 3]);
        }
        let alive = (0..).map(|i| (i, born(i))).take_while(|(_, born)| *born < t + 1e-9);
        let surely =
            |least: f64| alive.clone().filter(|(_, born)| t - born < lifetime(*born) + least).map(|(i, _)| i).collect::<HashSet<_>>();
        let found: HashSet<u32> = ids.into_iter().collect();
        assert!(surely(-1e-6).is_subset(&found) && found.is_subset(&surely(1e-6)), "frame {frame}");
        found.len()
    };
    let mut saved = Vec::new();
    let mut alive = Vec::new();
    for frame in 1..=48 {
        step(&mut sim);
        alive.push(check(&sim, frame));
        if frame == 20 {
            saved = sim.save(&[]);
        }
    }
    assert!(alive[19] > 120 && alive[47] < 30, "{alive:?}");
    let mut other = simulation(text);
    other.restore(&saved).unwrap();
    check(&other, 20);
    run(&mut other, 28);
    assert_eq!(
        (numbers(&other, "p", "radius"), numbers(&other, "p", "color")),
        (numbers(&sim, "p", "radius"), numbers(&sim, "p", "color"))
    );
}

#[test]
fn a_lifetime_radius_or_colour_out_of_bounds_is_told_with_its_time() {
    let text = "version = 1\ntime = { fps = 10, frames = 20 }\n[[emitter]]\nname = \"p\"\nrate = 1\nfrom.point = {}\nlifetime = \"1 - t\"\nradius = 0\n\
                color = [0, 1.5, 0]\ncolor_to = { keys = [[0, 0, 0, 0], [1, 0, 0, -1]] }\n";
    let error = Simulation::new(Scene::from_toml(text).unwrap(), Default::default()).map(|_| ()).unwrap_err().to_string();
    for told in [
        "emitter \"p\".lifetime: 0 at t = 1 s, expected > 0",
        "emitter \"p\".radius: 0, expected > 0",
        "emitter \"p\".color: [0, 1.5, 0], expected numbers from 0 to 1",
        "emitter \"p\".color_to: [0, 0, -0.1] at t = 0.1 s, expected numbers from 0 to 1",
    ] {
        assert!(error.contains(told), "{error}");
    }
}
