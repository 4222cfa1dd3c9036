//! Doors that open and close, goals in order, people who come later, and the choice of an exit. See docs/theory/crowds.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common::{positions, step, velocities};
use crate::crowds::{FPS, apart, crowd, empty, gate, gates, people, plan, same_bits, scene, text};
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Engine, Scene};

/// A gate with hours.
fn timed(kind: &str, name: &str, from: [f64; 2], to: [f64; 2], hours: &str) -> String {
    gate(kind, name, from, to) + hours + "\n"
}

/// A room 10 m x 8 m with exits of 1.2 m at both ends.
const ROOM: &str = "[[[0, 3.4], [0, 0], [10, 0], [10, 3.4]], [[10, 4.6], [10, 8], [0, 8], [0, 4.6]]]";

fn left(hours: &str) -> String {
    timed("exit", "left", [0.0, 3.4], [0.0, 4.6], hours)
}

fn right(hours: &str) -> String {
    timed("exit", "right", [10.0, 3.4], [10.0, 4.6], hours)
}

fn stranded(sim: &Simulation) -> u64 {
    sim.ledger().stranded.unwrap()
}

#[test]
fn nobody_passes_a_door_before_it_opens() {
    let walls = "[[[8, 3], [8, 0], [0, 0], [0, 6], [8, 6], [8, 4]], [[8, 0], [12, 0]], [[8, 6], [12, 6]]]";
    let all = timed("door", "door", [8.0, 3.0], [8.0, 4.0], "opens = 12") + &gate("exit", "out", [12.0, 0.0], [12.0, 6.0]);
    let mut sim = scene(&(plan(walls, &all) + &crowd("area = [[1, 1], [7, 5]]\ncount = 20")));
    // Nobody has a way until then, and everybody says so.
    assert_eq!(stranded(&sim), 20);
    while sim.time() < 11.9 {
        step(&mut sim);
        assert_eq!((stranded(&sim), gates(&sim, "crossings")[0]), (20, 0.0));
    }
    empty(&mut sim, 60.0, |sim| {
        apart(sim);
        assert!(sim.time() < 12.1 || stranded(sim) == 0);
    });
    assert_eq!(gates(&sim, "crossings")[0], 20.0);
    assert!(gates(&sim, "crossing_times")[0] >= 12.0);
}

#[test]
fn people_turn_round_when_their_exit_closes() {
    // All are nearer to the left; it closes in front of most of them.
    let words = plan(ROOM, &(left("closes = 5") + &right(""))) + &crowd("area = [[1, 0.5], [4.5, 7.5]]\ncount = 40");
    let mut sim = scene(&words);
    let mut before = 0.0;
    empty(&mut sim, 90.0, |sim| {
        apart(sim);
        assert_eq!(stranded(sim), 0);
        if sim.time() < 5.0 {
            before = gates(sim, "crossings")[1];
        }
    });
    let crossings = gates(&sim, "crossings");
    // Rows: from the left of each to its right, and back. Whoever stood in it when it closed gets out.
    let (by_left, by_right) = (crossings[0] + crossings[1], crossings[2] + crossings[3]);
    assert!(before > 2.0 && by_left >= before && by_left <= before + 3.0, "{before} {crossings:?}");
    assert_eq!(by_left + by_right, 40.0);
}

#[test]
fn a_door_that_closes_and_opens_again_lets_nobody_through_in_between() {
    let walls = "[[[8, 3], [8, 0], [0, 0], [0, 6], [8, 6], [8, 4]], [[8, 0], [12, 0]], [[8, 6], [12, 6]]]";
    let all = timed("door", "door", [8.0, 3.0], [8.0, 4.0], "closes = 8\nopens = 15") + &gate("exit", "out", [12.0, 0.0], [12.0, 6.0]);
    let mut sim = scene(&(plan(walls, &all) + &crowd("area = [[1, 1], [7, 5]]\ncount = 40")));
    let mut counts = Vec::new();
    empty(&mut sim, 80.0, |sim| {
        apart(sim);
        counts.push((sim.time(), gates(sim, "crossings")[0]));
    });
    let at = |t: f64| counts.iter().find(|(time, _)| *time >= t).unwrap().1;
    assert!(at(8.0) > 3.0 && at(15.0) <= at(8.0) + 1.0 && at(15.0) < 30.0, "{} {}", at(8.0), at(15.0));
}

#[test]
fn goals_are_reached_in_their_order() {
    let walls = "[[[0, 0], [20, 0], [20, 3]], [[20, 5], [20, 8], [0, 8], [0, 0]], [[10, 0], [10, 5]]]";
    let words = plan(walls, &(gate("door", "gap", [10.0, 5.0], [10.0, 8.0]) + &gate("exit", "out", [20.0, 3.0], [20.0, 5.0])))
        + "[[plan.waypoint]]\nname = \"desk\"\nat = [8, 1]\nradius = 0.5\n[[plan.waypoint]]\nname = \"till\"\nat = [18, 7]\n"
        + &crowd("position = [[2, 7]]\ngoals = [\"desk\", \"gap\", \"till\"]\nspeed = 1.2\nspeed_deviation = 0");
    let mut sim = scene(&words);
    let (mut desk, mut till) = (None, None);
    let born = sim.time();
    empty(&mut sim, 60.0, |sim| {
        let Some(x) = positions(sim, "people").first().copied() else { return };
        let near = |a: f64, b: f64, radius: f64| ((x.x - a).powi(2) + (x.y - b).powi(2)).sqrt() <= radius;
        if near(8.0, 1.0, 0.5) && desk.is_none() {
            desk = Some(sim.time());
        }
        if near(18.0, 7.0, 1.0) && till.is_none() {
            till = Some(sim.time());
        }
    });
    let times = gates(&sim, "crossing_times");
    let (desk, gap, till, out) = (desk.unwrap(), times[0], till.unwrap(), times[2]);
    assert!(desk < gap && gap < till && till < out, "{desk} {gap} {till} {out}");
    // Straight lines: to within 0.5 m of the desk, around the end of the wall, to within 1 m of the till, to the exit.
    let lines = [8.49 - 0.5, 4.3, 8.0, 2.5];
    let way: f64 = lines.iter().sum();
    assert!((1.2 * (out - born) - way).abs() < 0.12 * way, "{} m, about {way} m", 1.2 * out);
    // Walking the way to each goal loses no more than turning.
    let lost = sim.ledger().lost.unwrap();
    assert!(lost.abs() < 2.0, "{lost}");
}

#[test]
fn people_come_at_their_times_and_at_their_rate() {
    let words = plan(ROOM, &right("")) + &crowd("area = [[1, 1], [3, 7]]\narrivals = [0, 2, 2.5, 9]\nspeed_deviation = 0");
    let mut sim = scene(&words);
    let mut seen = Vec::new();
    while sim.time() < 20.0 {
        step(&mut sim);
        let ledger = sim.ledger();
        seen.push((sim.time(), ledger.people.unwrap() + ledger.left.unwrap()));
        apart(&sim);
    }
    let come = |t: f64| seen.iter().find(|(time, _)| *time > t + 1e-9).unwrap().1;
    assert_eq!([1.0, 2.2, 2.7, 8.9, 9.2].map(come), [1, 2, 3, 3, 4]);
    assert_eq!((people(&sim), sim.ledger().left), (0, Some(4)));
    // 200 at 4 a second: the last comes after 50 s, with a deviation of the square root of 200 over 4.
    let words = plan(ROOM, &(left("") + &right(""))) + &crowd("area = [[1, 1], [9, 7]]\ncount = 200\nrate = 4");
    let mut sim = scene(&words);
    let mut last = 0.0;
    while sim.ledger().left.unwrap() < 200 {
        assert!(sim.time() < 120.0);
        let before = sim.ledger().people.unwrap() + sim.ledger().left.unwrap();
        step(&mut sim);
        if sim.ledger().people.unwrap() + sim.ledger().left.unwrap() > before {
            last = sim.time();
        }
    }
    assert!((last - 50.0_f64).abs() < 3.0 * 200.0_f64.sqrt() / 4.0, "{last}");
}

/// 300 people at the left end of a hall with an exit there, and another twice as far; how many took each, and when the last was out.
fn hall(choice: &str, each: impl FnMut(&Simulation)) -> ([f64; 2], f64) {
    let walls = "[[[0, 3.5], [0, 0], [24, 0], [24, 3.5]], [[24, 4.5], [24, 8], [0, 8], [0, 4.5]]]";
    let exits = gate("exit", "near", [0.0, 3.5], [0.0, 4.5]) + &gate("exit", "far", [24.0, 3.5], [24.0, 4.5]);
    let words = plan(walls, &exits) + &crowd(&format!("area = [[0.3, 0.3], [11, 7.7]]\ncount = 160\nchoice = \"{choice}\""));
    let mut sim = scene(&words);
    empty(&mut sim, 300.0, each);
    let c = gates(&sim, "crossings");
    ([c[0] + c[1], c[2] + c[3]], sim.time())
}

#[test]
fn a_queue_sends_people_to_another_exit() {
    let ([near, far], all) = hall("distance", |_| ());
    assert_eq!([near, far], [160.0, 0.0]);
    let mut turns = 0;
    let mut headings: Vec<f64> = Vec::new();
    let ([shared, others], both) = hall("quickest", |sim| {
        // Whoever turns round again and again is undecided: signs of velocities along the hall, once a second.
        if ((sim.time() * FPS).round() as u64).is_multiple_of(FPS as u64) {
            let v: Vec<f64> = velocities(sim, "people").iter().map(|v| v.x).collect();
            if v.len() == headings.len() {
                turns += v.iter().zip(&headings).filter(|(a, b)| **a * **b < 0.0 && a.abs().min(b.abs()) > 0.3).count();
            }
            headings = v;
        }
    });
    println!("{shared} and {others} in {both:.1} s, all by one in {all:.1} s; {turns} turns");
    // The way to the other one takes 10 s: in that time 18 more leave by the near one.
    assert!(shared > others && others > 40.0, "{shared} {others}");
    assert!(both < 0.75 * all, "{both} {all}");
    assert!(turns < 40, "{turns}");
}

#[test]
fn the_same_bits_on_any_count_of_threads_and_after_a_restore_with_journeys() {
    let words = plan(ROOM, &(left("closes = 6\nopens = 9") + &right("opens = 2")))
        + "[[plan.waypoint]]\nname = \"desk\"\nat = [5, 6]\n"
        + &crowd("area = [[1, 0.5], [6, 4]]\ncount = 60\ngoals = [\"desk\"]\nchoice = \"quickest\"\nspeed_spread = 0.3")
        + "[[crowd]]\nname = \"later\"\narea = [[6, 0.5], [9, 3]]\ncount = 40\nrate = 3\npreset = \"rimea\"\nchoice = \"quickest\"\n";
    let sim = same_bits(&words, 240, &[(3, None), (1, Some(100)), (2, Some(170))]);
    assert!(sim.ledger().left.unwrap() > 5);
}

#[test]
fn words_that_contradict_each_other_are_refused_with_place_and_cure() {
    let desk = "[[plan.waypoint]]\nname = \"desk\"\nat = [5, 6]\n";
    let floor = |gates: &str| plan(ROOM, &(left("") + gates));
    let some = crowd("area = [[1, 1], [7, 7]]\ncount = 10");
    let cut =
        plan("[[[0, 3.4], [0, 0], [10, 0], [10, 8], [0, 8], [0, 4.6]], [[6, 0], [6, 8]]]", &(left("") + &desk.replace("[5, 6]", "[8, 6]")));
    let cases = [
        (
            floor(desk) + &crowd("area = [[1, 1], [7, 7]]\ncount = 9\ngoals = [\"till\"]"),
            "crowd \"people\".goals[0]",
            "is no door or waypoint",
        ),
        (floor(&right("opens = 4\ncloses = 4")) + &some, "plan \"floor\".exit[1].closes", "give another time"),
        (floor(&(desk.to_owned() + desk)) + &some, "plan \"floor\".waypoint[1]", "give it another"),
        (
            floor("[[plan.stairs]]\narea = [[1, 1], [2, 2]]\nup = [0, 0]\n") + &some,
            "plan \"floor\".stairs[0].up",
            "expected the direction in which it rises",
        ),
        (
            floor("[[plan.ramp]]\narea = [[1, 1]]\nup = [1, 0]\nslope = 0.1\n") + &some,
            "plan \"floor\".ramp[0].area",
            "expected two opposite",
        ),
        (cut + &crowd("area = [[1, 1], [5, 7]]\ncount = 9\ngoals = [\"desk\"]"), "crowd \"people\".area", "no goal of it can be reached"),
        (floor("") + &crowd("area = [[1, 1], [7, 7]]\nrate = 3"), "crowd \"people\".rate", "give count"),
        (floor("") + &crowd("area = [[1, 1], [7, 7]]\ncount = 9\nage = [20, 30]"), "crowd \"people\".age", "set it, or leave age out"),
        (
            floor("") + &crowd("area = [[1, 1], [7, 7]]\ncount = 9\nspeed_spread = 0.1\nspeed_deviation = 0.1"),
            "crowd \"people\".speed_spread",
            "leave one of them out",
        ),
        (floor("") + &crowd("area = [[1, 1], [7, 7]]\ncount = 9\nradius_deviation = 0.08"), "crowd \"people\".radius", "smaller deviation"),
        (
            floor("") + &some + "[[system]]\nname = \"main\"\nmethod = \"crowd\"\ncrowd = { model = \"orca\", buffer = 0.1 }\n",
            "system \"main\".crowd.buffer",
            "leave it out",
        ),
    ];
    for (words, place, what) in cases {
        let told = Scene::from_toml(&format!("version = 1\n{}", text(&words)))
            .and_then(|scene| Simulation::new(scene, Assets::default()).map(|_| ()))
            .unwrap_err()
            .issues;
        let is = |issue: &tumble_interface::Issue| issue.path == place && issue.message.contains(what);
        assert!(told.iter().any(is), "{place}: {what}\n{told:?}");
    }
}
