//! Floors that are drawn side by side and go on at each other. See docs/theory/crowds.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::crowds::{apart, crowd, empty, gate, gates, people, plan, same_bits, scene, text};
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Engine, Scene};

/// People in a room, its door of 1.2 m, and an exit of 1.2 m behind another room of 5 m x 6 m.
const FORTY: &str = "area = [[0.5, 0.5], [5.5, 5.5]]\ncount = 40";

fn link(from: [[f64; 2]; 2], to: [[f64; 2]; 2]) -> String {
    format!("[[plan.link]]\nname = \"stairs\"\nfrom = {from:?}\nto = {to:?}\n")
}

/// The first room, on whose passage to the second a door stands.
const FIRST: &str = "[[6, 2.4], [6, 0], [0, 0], [0, 6], [6, 6], [6, 3.6]]";
const DOOR: [[f64; 2]; 2] = [[6.0, 2.4], [6.0, 3.6]];

fn whole() -> String {
    let walls = format!(
        "[{FIRST}, [[7, 2.4], [6, 2.4]], [[7, 3.6], [6, 3.6]], [[12, 2.4], [12, 0], [7, 0], [7, 2.4]], [[7, 3.6], [7, 6], [12, 6], [12, 3.6]]]"
    );
    plan(&walls, &(gate("door", "door", DOOR[0], DOOR[1]) + &gate("exit", "out", [12.0, 2.4], [12.0, 3.6]))) + &crowd(FORTY)
}

/// The same with the second room turned by a quarter and drawn elsewhere: x, y to 40 - y, x.
fn parted() -> String {
    let walls = format!(
        "[{FIRST}, [[6.5, 2.4], [6, 2.4]], [[6.5, 3.6], [6, 3.6]], [[37.6, 6.5], [37.6, 7]], [[36.4, 6.5], [36.4, 7]], \
         [[37.6, 12], [40, 12], [40, 7], [37.6, 7]], [[36.4, 7], [34, 7], [34, 12], [36.4, 12]]]"
    );
    let gates = gate("door", "door", DOOR[0], DOOR[1]) + &gate("exit", "out", [37.6, 12.0], [36.4, 12.0]);
    plan(&walls, &(gates + &link([[6.5, 2.4], [6.5, 3.6]], [[37.6, 6.5], [36.4, 6.5]]))) + &crowd(FORTY)
}

#[test]
fn a_building_empties_as_fast_as_if_it_were_drawn_in_one_piece() {
    let [one, two] = [whole(), parted()].map(|words| {
        let mut sim = scene(&words);
        let time = empty(&mut sim, 120.0, apart);
        // All of them through the door, once.
        assert_eq!(gates(&sim, "crossings")[..2], [40.0, 0.0]);
        (time, gates(&sim, "gate_lost"))
    });
    println!("{} and {} person-seconds, lost before the door {} and {}", one.0, two.0, one.1[0], two.1[0]);
    assert!((two.0 / one.0 - 1.0).abs() < 0.01 && one.0 > 400.0);
    assert!((two.1[0] - one.1[0]).abs() < 0.01 * one.1[0] && one.1[0] > 100.0);
}

#[test]
fn two_streams_pass_each_other_in_a_link_of_two_metres() {
    // A corridor of 2 m in two pieces of 8 m, whose streams go to the far end of the other.
    let walls = "[[[0, 0], [8, 0]], [[0, 2], [8, 2]], [[20, 0], [28, 0]], [[20, 2], [28, 2]]]";
    let gates = gate("exit", "left", [0.0, 0.0], [0.0, 2.0]) + &gate("exit", "right", [28.0, 0.0], [28.0, 2.0]);
    let some =
        |name: &str, area: &str, exit: &str| format!("[[crowd]]\nname = \"{name}\"\narea = {area}\ncount = 12\nexit = [\"{exit}\"]\n");
    let words = plan(walls, &(gates + &link([[8.0, 0.0], [8.0, 2.0]], [[20.0, 0.0], [20.0, 2.0]])))
        + &some("there", "[[1, 0], [7, 2]]", "right")
        + &some("back", "[[21, 0], [27, 2]]", "left");
    let mut sim = scene(&words);
    empty(&mut sim, 60.0, apart);
    let crossed = sim.frame(&[]).column("floor", "crossings").unwrap().data.numbers();
    assert_eq!(crossed.iter().sum::<f64>(), 24.0);
}

#[test]
fn people_come_down_two_floors_in_millimetres_by_timed_doors() {
    // Three floors of 5 m x 2 m, drawn 10 m apart; those on the uppermost come one after the other.
    let walls = "[[[5000, 0], [0, 0]], [[0, 2000], [5000, 2000]], [[5400, 0], [5400, 2000]], [[0, 10000], [5000, 10000]], \
         [[0, 12000], [5000, 12000]], [[-400, 10000], [-400, 12000]], [[5400, 10000], [5400, 12000]], \
         [[5000, 20000], [0, 20000], [0, 22000], [5000, 22000]], [[5400, 20000], [5400, 22000]]]";
    let at = |x: f64, y: f64| [[x, y], [x, y + 2000.0]];
    // The lower landing is turned round: whoever crosses it goes on in the other direction.
    let stairs = link(at(5000.0, 0.0), [[5000.0, 12000.0], [5000.0, 10000.0]])
        + &link(at(0.0, 10000.0), at(5000.0, 20000.0)).replace("stairs", "upper");
    let gates = gate("exit", "out", [0.0, 0.0], [0.0, 2000.0])
        + &gate("door", "half way", [2500.0, 10000.0], [2500.0, 12000.0])
        + "opens = 10
";
    let words = plan(walls, &(gates + &stairs)).replace(
        "walls =",
        "scale = 0.001
walls =",
    ) + &crowd(
        "area = [[1, 20.3], [4, 21.7]]
count = 12
rate = 2",
    );
    let mut sim = scene(&words);
    while sim.ledger().left.unwrap() < 12 {
        crate::common::step(&mut sim);
        apart(&sim);
        assert!(sim.time() < 60.0 && (sim.time() > 10.0 || gates_of(&sim)[0] == 0.0), "{} at {} s", people(&sim), sim.time());
    }
    assert_eq!(gates_of(&sim), [12.0, 12.0]);
}

/// Crossings of all gates, from both sides together.
fn gates_of(sim: &Simulation) -> Vec<f64> {
    gates(sim, "crossings").chunks(2).map(|c| c[0] + c[1]).collect()
}

#[test]
fn floors_have_the_same_bits_on_any_count_of_threads_and_after_a_restore() {
    let sim = same_bits(&parted(), 200, &[(3, None), (1, Some(100)), (2, Some(170))]);
    // Some are on either floor.
    assert!(people(&sim) > 5 && people(&sim) < 40);
}

#[test]
fn links_that_are_none_are_refused_with_place_and_cure() {
    let floor = |links: &str| {
        let words = parted();
        let begin = words.find("[[plan.link]]").unwrap();
        let end = begin + words[begin..].find("[[crowd]]").unwrap();
        [&words[..begin], links, &words[end..]].concat()
    };
    let (from, to) = ([[6.5, 2.4], [6.5, 3.6]], [[37.6, 6.5], [36.4, 6.5]]);
    let cases = [
        (floor(&link(from, [[37.6, 6.5], [36.6, 6.5]])), "plan \"floor\".link[0].to", "draw them equally wide"),
        (floor(&(link(from, to) + &link(from, to))), "plan \"floor\".link[1]", "give it another"),
        (floor(&link(from, to).replace("stairs", "door")), "plan \"floor\".link[0]", "\"door\" is the name of"),
        (floor(&link([[6.5, 2.9], [6.5, 3.1]], [[37.1, 6.5], [36.9, 6.5]])), "plan \"floor\".link[0].from", "nobody can pass"),
        (floor(&link(from, [[60.0, 6.5], [58.8, 6.5]])), "plan \"floor\".link[0].to", "lies outside the walls"),
        (floor(&(link(from, to) + &gate("door", "second", [6.52, 2.4], [6.52, 3.6]))), "plan \"floor\".link[0].from", "move one of them"),
        (
            floor(&(link(from, to) + &link([[6.8, 2.4], [6.8, 3.6]], [[37.6, 6.8], [36.4, 6.8]]).replace("stairs", "second"))),
            "plan \"floor\".link[1].from",
            "nearer than 0.5 m",
        ),
        // Its ends in the other order: people come out on the wrong side, and walk around the building.
        (floor(&link(from, [to[1], to[0]])), "plan \"floor\".link", "swap the ends of to"),
    ];
    for (words, place, what) in cases {
        let told = Scene::from_toml(&format!("version = 1\n{}", text(&words)))
            .and_then(|scene| Simulation::new(scene, Assets::default()).map(|_| ()))
            .map_or_else(|error| error.issues, |()| Vec::new());
        let is = |issue: &tumble_interface::Issue| issue.path == place && issue.message.contains(what);
        assert!(told.iter().any(is), "{place}: {what}\n{told:?}");
    }
}
