//! Cases of the guideline of RiMEA that are not in crowds.rs (1, 5, 6, 9, 12), each with its criterion. See docs/theory/crowds.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common::{positions, run, step, velocities};
use crate::crowds::{FPS, apart, crowd, empty, gate, gates, plan, scene};
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

/// A corridor along x of this length and width, with an exit at its end.
fn corridor(length: f64, width: f64, more: &str) -> String {
    let walls = format!("[[[{length}, 0], [-2, 0], [-2, {width}], [{length}, {width}]]]");
    plan(&walls, &(gate("exit", "out", [length - 0.5, 0.0], [length - 0.5, width]) + more))
}

fn stairs(low: [f64; 2], high: [f64; 2], up: [f64; 2], words: &str) -> String {
    format!("[[plan.stairs]]\narea = [{low:?}, {high:?}]\nup = {up:?}\n{words}\n")
}

#[test]
fn cases_2_and_3_stairs_are_walked_at_the_speed_of_their_slope() {
    // 8 m in plan and 6 m high: at 0.5 m/s upward 16 s, at 0.65 m/s downward 12.31 s, within 5 %.
    for (up, seconds) in [([1.0, 0.0], 16.0), ([-1.0, 0.0], 12.31)] {
        let doors = gate("door", "foot", [6.0, 0.0], [6.0, 2.0]) + &gate("door", "head", [14.0, 0.0], [14.0, 2.0]);
        let slope = stairs([6.0, 0.0], [14.0, 2.0], up, "up_factor = 0.5\ndown_factor = 0.65");
        let words = corridor(20.0, 2.0, &(doors + &slope)) + &crowd("position = [[0, 1]]\nspeed = 1\nspeed_deviation = 0");
        let mut sim = scene(&words);
        empty(&mut sim, 60.0, |_| ());
        let times = gates(&sim, "crossing_times");
        assert!((times[2] - times[0] - seconds).abs() < 0.05 * seconds, "{times:?}");
        // The way knows it: nothing is lost.
        let lost = sim.ledger().lost.unwrap();
        assert!(lost.abs() < 0.3, "{lost}");
    }
}

#[test]
fn a_ramp_slows_people_by_toblers_function() {
    // exp(-3.5 |s + 0.05|) over its value at s = 0: 0.7047 at 0.1 upward, and 1 at 0.1 downward.
    for (up, factor) in [([1.0, 0.0], 0.704_688), ([-2.0, 0.0], 1.0)] {
        let ramp = format!("[[plan.ramp]]\narea = [[-2, 0], [20, 2]]\nup = {up:?}\nslope = 0.1\n");
        let mut sim = scene(&(corridor(20.0, 2.0, &ramp) + &crowd("position = [[0, 1]]\nspeed = 1.2\nspeed_deviation = 0")));
        run(&mut sim, 20);
        let v = velocities(&sim, "people")[0].x;
        assert!((v - 1.2 * factor).abs() < 1e-3, "{v}");
    }
}

/// Density [1/m²] and speed [m/s] in 2 m x 1 m of a corridor, from 10 s on.
fn measured(density: f64) -> (f64, f64) {
    let words = corridor(90.0, 4.0, "") + &crowd(&format!("area = [[0, 0.02], [60, 3.98]]\ndensity = {density}"));
    let mut sim = scene(&words);
    run(&mut sim, 10 * FPS as usize);
    let (mut count, mut sum) = (0.0, 0.0);
    let frames = 8 * FPS as usize;
    for _ in 0..frames {
        step(&mut sim);
        for (x, v) in positions(&sim, "people").iter().zip(velocities(&sim, "people")) {
            if (29.0..31.0).contains(&x.x) && (1.0..3.0).contains(&x.y) {
                (count, sum) = (count + 1.0, sum + v.x);
            }
        }
    }
    (count / frames as f64 / 4.0, sum / count)
}

#[test]
fn case_4_speed_falls_with_density() {
    // Weidmann's curve, v = 1.34 (1 - exp(-1.913 (1/rho - 1/5.4))), in between measured ones, which differ by 0.3 m/s from each other.
    let of: Vec<(f64, f64)> = [0.5, 1.0, 2.0, 3.0].into_iter().map(measured).collect();
    let weidmann = |rho: f64| 1.34 * (1.0 - (-1.913 * (1.0 / rho - 1.0 / 5.4)).exp());
    for (rho, v) in &of {
        println!("{rho:.2} /m²: {v:.2} m/s, Weidmann {:.2}", weidmann(*rho));
        assert!((v - weidmann(*rho)).abs() < 0.35, "{of:?}");
    }
    assert!(of.windows(2).all(|pair| pair[1].1 < pair[0].1), "{of:?}");
}

#[test]
fn case_7_speeds_are_those_of_ages() {
    // Four groups of 50, with the lowest and the highest speed that each may have [m/s].
    for (ages, range) in [([3, 20], [0.58, 1.61]), ([30, 50], [1.41, 1.54]), ([50, 80], [0.68, 1.41]), ([80, 85], [0.46, 0.76])] {
        let walls = "[[[0, 0], [80, 0], [80, 80], [0, 80], [0, 0]]]";
        let words = plan(walls, &gate("exit", "out", [79.0, 20.0], [79.0, 60.0]))
            + &crowd(&format!("area = [[1, 1], [60, 79]]\ncount = 50\npreset = \"rimea\"\nage = {ages:?}"));
        let mut sim = scene(&words);
        step(&mut sim);
        let v: Vec<f64> = velocities(&sim, "people").iter().map(|v| v.norm()).collect();
        assert!(v.iter().all(|v| (range[0] - 1e-6..=range[1] + 1e-6).contains(v)), "{ages:?}: {v:?}");
        let spread = v.iter().fold(0.0, |a: f64, b| a.max(*b)) - v.iter().fold(9.0, |a: f64, b| a.min(*b));
        assert!(spread > 0.6 * (range[1] - range[0]).min(0.15), "{ages:?}: {spread}");
    }
}

#[test]
fn distributions_have_their_means_and_widths() {
    let walls = "[[[0, 0], [80, 0], [80, 80], [0, 80], [0, 0]]]";
    // 400 people 3.5 m from each other.
    let places: Vec<[f64; 2]> = (0..400).map(|i| [2.0 + 3.5 * f64::from(i % 20), 2.0 + 3.5 * f64::from(i / 20)]).collect();
    let speeds = |words: &str| {
        let words = plan(walls, &gate("exit", "out", [79.0, 20.0], [79.0, 60.0])) + &crowd(&format!("position = {places:?}\n{words}"));
        let mut sim = scene(&words);
        step(&mut sim);
        let radii = sim.frame(&[]).column("people", "radius").unwrap().data.numbers();
        (velocities(&sim, "people").iter().map(|v| v.norm()).collect::<Vec<f64>>(), radii)
    };
    let moments = |x: &[f64]| {
        let mean = x.iter().sum::<f64>() / x.len() as f64;
        (mean, (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len() as f64).sqrt())
    };
    // Uniform: a deviation of the half width over the square root of 3. Three standard errors.
    let (v, radii) = speeds("speed = 1.2\nspeed_spread = 0.3\nradius = 0.2\nradius_deviation = 0.02");
    let (mean, deviation) = moments(&v);
    assert!((mean - 1.2).abs() < 0.032 && (deviation - 0.36 / 3.0_f64.sqrt()).abs() < 0.015, "{mean} {deviation}");
    assert!(v.iter().all(|v| (0.84 - 1e-9..=1.56 + 1e-9).contains(v)));
    // Normal, cut at two deviations, which leaves 0.96 of one, since what is beyond is at the cuts.
    let (mean, deviation) = moments(&radii);
    assert!((mean - 0.2).abs() < 0.003 && (deviation - 0.0192).abs() < 0.0021, "{mean} {deviation}");
    assert!(radii.iter().all(|r| (0.16 - 1e-9..=0.24 + 1e-9).contains(r)));
    let (v, _) = speeds("preset = \"weidmann\"");
    let (mean, deviation) = moments(&v);
    assert!((mean - 1.34).abs() < 0.04 && (deviation - 0.25).abs() < 0.03, "{mean} {deviation}");
}

/// A room with a door of 1 m from which so many go out; the time that it takes them [s].
fn room(words: &str) -> f64 {
    let walls = "[[[8, 3.5], [8, 0], [0, 0], [0, 8], [8, 8], [8, 4.5]]]";
    let mut sim =
        scene(&(plan(walls, &gate("exit", "out", [8.0, 3.5], [8.0, 4.5])) + &crowd(&format!("area = [[0.2, 0.2], [7, 7.8]]\n{words}"))));
    empty(&mut sim, 300.0, |_| ());
    sim.time()
}

#[test]
fn case_8_times_follow_the_parameters() {
    // Alone, speed tells: the time goes down with it. In a queue the number does.
    let times = [0.7, 1.0, 1.4].map(|speed| room(&format!("count = 4\nspeed = {speed}\nspeed_deviation = 0")));
    assert!(times[0] > 1.2 * times[1] && times[1] > 1.2 * times[2], "{times:?}");
    let times = [25, 50, 100].map(|count| room(&format!("count = {count}")));
    assert!(times[2] > 1.5 * times[1] && times[1] > 1.3 * times[0], "{times:?}");
    // Who reacts later is out later, by as much.
    let (now, later) = (room("count = 20"), room("count = 20\nreaction = 15"));
    assert!((later - now - 15.0).abs() < 0.5, "{now} {later}");
}

#[test]
fn case_10_everybody_takes_the_exit_of_its_room() {
    // Twelve rooms on both sides of a corridor with 23 people; those of four rooms leave by the second exit, though the first is nearer to some.
    let mut walls = vec!["[[0, 5], [0, 0], [18, 0], [18, 5.4]]".to_owned(), "[[18, 6.6], [18, 12], [0, 12], [0, 6.6]]".to_owned()];
    let mut words = String::new();
    let mut left = 0;
    for k in 0..12 {
        let (column, below) = (f64::from(k % 6), k < 6);
        let (low, high, wall) = if below { (0.0, 5.0, 5.0) } else { (7.0, 12.0, 7.0) };
        let x = 3.0 * column;
        walls.push(format!("[[{x}, {wall}], [{}, {wall}]]", x + 1.0));
        walls.push(format!("[[{}, {wall}], [{}, {wall}]]", x + 2.0, x + 3.0));
        if column > 0.0 {
            walls.push(format!("[[{x}, {low}], [{x}, {high}]]"));
        }
        let (count, second) = (if k == 0 { 1 } else { 2 }, [1, 3, 7, 9].contains(&k));
        left += if second { 0 } else { count };
        words += &format!(
            "[[crowd]]\nname = \"r{k}\"\narea = [[{}, {}], [{}, {}]]\ncount = {count}\nexit = [\"{}\"]\n",
            x + 0.3,
            low + 0.3,
            x + 2.7,
            high - 0.3,
            if second { "second" } else { "first" }
        );
    }
    let exits = gate("exit", "first", [0.0, 5.0], [0.0, 6.6]) + &gate("exit", "second", [18.0, 5.4], [18.0, 6.6]);
    let mut sim = scene(&(plan(&format!("[{}]", walls.join(", ")), &exits) + &words));
    empty(&mut sim, 90.0, apart);
    let c = gates(&sim, "crossings");
    assert_eq!(([c[0] + c[1], c[2] + c[3]], left), ([15.0, 8.0], 15), "{c:?}");
}

#[test]
fn case_11_most_take_the_nearer_exit_and_some_the_other() {
    // 500 of the thousand: at the left half of 30 m x 20 m, two exits of 1 m at the lower wall.
    let walls = "[[[0, 0], [4, 0]], [[5, 0], [20, 0]], [[21, 0], [30, 0], [30, 20], [0, 20], [0, 0]]]";
    let exits = gate("exit", "near", [4.0, 0.0], [5.0, 0.0]) + &gate("exit", "far", [20.0, 0.0], [21.0, 0.0]);
    let mut sim = scene(&(plan(walls, &exits) + &crowd("area = [[0.3, 4], [11, 19.7]]\ncount = 300\nchoice = \"quickest\"")));
    empty(&mut sim, 300.0, |_| ());
    let c = gates(&sim, "crossings");
    let (near, far) = (c[0] + c[1], c[2] + c[3]);
    println!("near {near}, far {far}");
    assert!(near > far && far > 30.0, "{c:?}");
}

/// Speeds of people in a part of a corridor along x [m/s].
fn speeds(sim: &Simulation, low: f64, high: f64) -> Vec<f64> {
    let is_in = |x: f64| (low..high).contains(&x);
    positions(sim, "people").iter().zip(velocities(sim, "people")).filter(|(x, _)| is_in(x.x)).map(|(_, v)| v.norm()).collect()
}

#[test]
fn case_13_the_jam_is_before_the_stairs() {
    // A hall, a corridor of 2 m, and stairs up at its end.
    let walls = "[[[8, 3], [8, 0], [0, 0], [0, 8], [8, 8], [8, 5]], [[8, 3], [26, 3]], [[8, 5], [26, 5]]]";
    let all = gate("door", "corridor", [8.0, 3.0], [8.0, 5.0])
        + &gate("door", "foot", [16.0, 3.0], [16.0, 5.0])
        + &gate("exit", "out", [25.0, 3.0], [25.0, 5.0])
        + &stairs([16.0, 3.0], [24.0, 5.0], [1.0, 0.0], "up_factor = 0.5");
    let mut sim = scene(&(plan(walls, &all) + &crowd("area = [[0.3, 0.3], [7, 7.7]]\ncount = 130")));
    let (mut before, mut on, mut early) = (Vec::new(), Vec::new(), 0.0);
    empty(&mut sim, 200.0, |sim| {
        if (15.0..35.0).contains(&sim.time()) {
            before.extend(speeds(sim, 13.0, 16.0));
            on.extend(speeds(sim, 19.0, 22.0));
        }
        if sim.time() < 12.0 {
            early = gates(sim, "crossings")[0];
        }
    });
    // What comes through the corridor at first is more than what goes up.
    let times = gates(&sim, "crossing_times");
    let (corridor, up) = ((early - 1.0) / (12.0 - times[0]), 129.0 / (times[3] - times[2]));
    // Free speeds are 1.34 and 0.67 m/s: people wait before the stairs, and not on them.
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (before, on) = (mean(&before) / 1.34, mean(&on) / 0.67);
    println!("{before:.2} and {on:.2} of free speeds; {corridor:.2} and {up:.2} /s");
    assert!(corridor > up + 0.05, "{corridor} {up}");
    assert!(before < 0.7 && on > 0.75, "{before} {on}");
}

#[test]
fn case_14_the_way_is_the_one_that_takes_least_time() {
    // From a room to an exit by stairs, or around on the level: the way around is longer by more than the stairs slow, or by less.
    for (around, by_stairs) in [(14.0, 10.0), (3.0, 0.0)] {
        let (top, high) = (4.0 + around, 6.0 + around);
        let walls = format!("[[[0, 0], [16, 0], [16, {high}], [0, {high}], [0, 0]], [[4, 2], [14, 2], [14, {top}], [4, {top}], [4, 2]]]");
        let all = gate("exit", "out", [15.5, 0.0], [15.5, 2.0])
            + &gate("door", "stairs", [9.0, 0.0], [9.0, 2.0])
            + &gate("door", "around", [9.0, top], [9.0, high])
            + &stairs([6.0, 0.0], [12.0, 2.0], [1.0, 0.0], "up_factor = 0.25");
        let mut sim = scene(&(plan(&walls, &all) + &crowd("area = [[0.5, 0.3], [3, 3.5]]\ncount = 10")));
        empty(&mut sim, 90.0, |_| ());
        let c = gates(&sim, "crossings");
        assert_eq!((c[0] + c[1], c[2] + c[3]), (by_stairs, 10.0 - by_stairs), "{around}: {c:?}");
    }
}

#[test]
fn case_15_a_corner_costs_more_than_its_inner_length_and_less_than_its_outer() {
    let straight = |length: f64| {
        let mut sim = scene(&(corridor(length, 2.0, "") + &crowd("area = [[0, 0], [6, 2]]\ncount = 6\nspeed_deviation = 0")));
        empty(&mut sim, 60.0, |_| ());
        sim.time()
    };
    let walls = "[[[12, 12], [12, 0], [-2, 0], [-2, 2], [10, 2], [10, 12]]]";
    let words =
        plan(walls, &gate("exit", "out", [10.0, 11.5], [12.0, 11.5])) + &crowd("area = [[0, 0], [6, 2]]\ncount = 6\nspeed_deviation = 0");
    let mut sim = scene(&words);
    empty(&mut sim, 60.0, |_| ());
    // Along the inner wall 10 + 9.5 m, along the outer one 12 + 11.5 m.
    let (short, corner, long) = (straight(20.0), sim.time(), straight(24.0));
    println!("{short:.2} {corner:.2} {long:.2}");
    assert!(short < corner && corner < long, "{short} {corner} {long}");
}
