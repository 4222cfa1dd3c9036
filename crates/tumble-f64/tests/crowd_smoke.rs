//! People in the smoke of a gas: speed and sight. See docs/theory/crowds.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common::{positions, run, velocities};
use crate::crowds::{FPS, apart, crowd, gate, plan, same_bits, scene, text};
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Engine, Scene};

/// A corridor of 40 m x 0.6 m whose first 20 m are full of smoke of this extinction [1/m].
fn corridor(extinction: f64, people: &str) -> String {
    let walls = "[[[-1, 0], [41, 0]], [[-1, 0.6], [41, 0.6]]]";
    let gas = format!(
        "[[gas]]\nname = \"air\"\nbox = {{ size = [21, 2, 1], center = [9.5, 0.3, 0], resolution = 42 }}\n\
         smoke = {{ initial = \"{}\", weight = 0 }}\n",
        extinction / 8700.0
    );
    let systems = "[[system]]\nname = \"air flow\"\nmethod = \"gas\"\n\
                   [[system]]\nname = \"walkers\"\nmethod = \"crowd\"\ncrowd = { smoke = \"air\" }\n";
    plan(walls, &gate("exit", "out", [40.0, 0.0], [40.0, 0.6])) + people + &gas + systems
}

fn walker(x: f64) -> String {
    crowd(&format!("position = [[{x}, 0.3]]\nspeed = 1.33\nspeed_deviation = 0"))
}

#[test]
fn smoke_slows_people_as_measured_and_the_air_beyond_it_does_not() {
    for (extinction, factor) in [(0.0, 1.0), (4.0, 1.0 - 4.0 * 0.057 / 0.706), (40.0, 0.1)] {
        let mut sim = scene(&corridor(extinction, &walker(0.0)));
        run(&mut sim, (10.0 * FPS) as usize);
        let gone = positions(&sim, "people")[0].x;
        assert!((gone / (13.3 * factor) - 1.0).abs() < 0.005, "{extinction}: {gone}");
        let mut beyond = scene(&corridor(extinction, &walker(21.0)));
        run(&mut beyond, (10.0 * FPS) as usize);
        assert!((positions(&beyond, "people")[0].x - 34.3).abs() < 0.01);
    }
}

/// The speed of somebody who comes up to another who stands, 0.2 m from touching.
fn speed_before_touching(extinction: f64) -> f64 {
    let stands = "[[crowd]]\nname = \"standing\"\nposition = [[5, 0.3]]\nreaction = 1000\nradius = 0.18\n";
    let mut sim = scene(&corridor(extinction, &(walker(3.0) + stands)));
    let mut found = None;
    for _ in 0..(20.0 * FPS) as usize {
        run(&mut sim, 1);
        apart(&sim);
        if found.is_none() && 5.0 - positions(&sim, "people")[0].x < 0.56 {
            found = Some(velocities(&sim, "people")[0].norm());
        }
    }
    assert!(positions(&sim, "people")[0].x > 4.5);
    found.unwrap()
}

#[test]
fn people_in_smoke_see_each_other_late_and_do_not_overlap() {
    // In clear air the speed follows from the gap, (0.2 m - buffer)/time_gap. In smoke nobody is seen from there, and it is that of (crowds.15).
    let clear = speed_before_touching(0.0);
    assert!(clear < 0.3, "{clear}");
    let smoky = speed_before_touching(8.0);
    let full = 1.33 * (1.0 - 8.0 * 0.057 / 0.706);
    assert!((smoky / full - 1.0).abs() < 0.02, "{smoky} {full}");
}

#[test]
fn people_in_smoke_have_the_same_bits_on_any_count_of_threads_and_after_a_restore() {
    let words = corridor(3.0, &crowd("area = [[0, 0], [19, 0.6]]\ncount = 20"));
    same_bits(&words, 60, &[(3, None), (2, Some(31))]);
}

#[test]
fn people_see_the_smoke_of_an_earlier_system_and_are_told_of_a_later_one() {
    let words = corridor(1.0, &walker(0.0));
    let late = |sim: &Simulation| sim.warnings().iter().filter(|w| w.code.name() == "late-carrier").count();
    assert_eq!(late(&scene(&words)), 0);
    let [gas, crowd] = [
        "[[system]]\nname = \"air flow\"\nmethod = \"gas\"\n",
        "[[system]]\nname = \"walkers\"\nmethod = \"crowd\"\ncrowd = { smoke = \"air\" }\n",
    ];
    assert!(words.contains(&[gas, crowd].concat()));
    assert_eq!(late(&scene(&words.replace(&[gas, crowd].concat(), &[crowd, gas].concat()))), 1);
}

#[test]
fn in_space_the_smoke_at_eye_level_counts() {
    // A layer of smoke above 1 m, and one below: people walk in the one, and over the other.
    let gone = |layer: &str| {
        let words = corridor(4.0, &walker(0.0))
            .replace("size = [21, 2, 1], center = [9.5, 0.3, 0]", "size = [21, 2, 2], center = [9.5, 0.3, 1]")
            .replace(&format!("initial = \"{}\"", 4.0 / 8700.0), &format!("initial = \"{}*{layer}\"", 4.0 / 8700.0));
        let mut sim = crate::common::simulation(&text(&words).replace("dimension = 2\nplane = \"xy\"\n", ""));
        run(&mut sim, (5.0 * FPS) as usize);
        positions(&sim, "people")[0].x
    };
    let (within, over) = (gone("step(1, z)"), gone("step(z, 1)"));
    assert!((within / (6.65 * (1.0 - 4.0 * 0.057 / 0.706)) - 1.0).abs() < 0.005, "{within}");
    assert!((over / 6.65 - 1.0).abs() < 0.005, "{over}");
}

#[test]
fn smoke_that_is_none_is_refused_with_place_and_cure() {
    let words = corridor(1.0, &walker(0.0));
    let clear = words.lines().filter(|line| !line.starts_with("smoke =")).collect::<Vec<_>>().join("\n");
    let place = "system \"walkers\".crowd";
    let cases = [
        (words.replace("crowd = { smoke = \"air\" }", "crowd = { smoke = \"fog\" }"), ".smoke", "expected one of air"),
        (clear, ".smoke", "add a [[gas]]"),
        (words.replace("smoke = \"air\"", "extinction = 8000"), ".extinction", "set smoke"),
    ];
    for (words, word, what) in cases {
        let told = Scene::from_toml(&format!("version = 1\n{}", text(&words)))
            .and_then(|scene| Simulation::new(scene, Assets::default()).map(|_| ()))
            .map_or_else(|error| error.issues, |()| Vec::new());
        let is = |issue: &tumble_interface::Issue| issue.path == format!("{place}{word}") && issue.message.contains(what);
        assert!(told.iter().any(is), "{word}: {what}\n{told:?}");
    }
}
