//! Rigid bodies among people: blows, falls, injuries, pushes, and ways that bodies close. See docs/theory/crowds.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common::{column, positions, run, simulation, step, velocities};
use crate::crowds::{crowd, gate, plan};
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

const FPS: usize = 100;
const G: f64 = 9.81;

/// A corridor of 20 m x 4 m with an exit at its right end, in space, with this gravity.
fn words(gravity: f64, people: &str, rest: &str) -> String {
    let walls = "[[[20, 0], [0, 0], [0, 4], [20, 4]]]";
    let floor = plan(walls, &gate("exit", "out", [20.0, 0.0], [20.0, 4.0]));
    format!("time = {{ fps = {FPS}, frames = 100000 }}\nworld.gravity = [0, 0, {}]\n", -gravity) + &floor + &crowd(people) + rest
}

fn ball(mass: f64, position: [f64; 3], velocity: [f64; 3]) -> String {
    let shape = "shape = { sphere = { radius = 0.2 } }";
    format!("[[body]]\nname = \"rock\"\n{shape}\nmass = {mass}\nposition = [{position:?}]\nvelocity = [{velocity:?}]\n")
}

fn cube(size: [f64; 3], mass: f64, at: [f64; 2], friction: f64) -> String {
    let shape = format!("shape = {{ box = {{ size = {size:?} }} }}");
    let position = [at[0], at[1], 0.5 * size[2]];
    format!("[[body]]\nname = \"crate\"\n{shape}\nmass = {mass}\nposition = [{position:?}]\nfriction = {friction}\n")
        + "[[collider]]\nname = \"ground\"\nshape = { floor = {} }\n"
}

/// How many lie, and how many are injured.
fn fallen(sim: &Simulation) -> [u64; 2] {
    let ledger = sim.ledger();
    [ledger.fallen.unwrap(), ledger.injured.unwrap()]
}

/// What a blow has done.
struct Blow {
    /// Velocities after it [m/s].
    rock: f64,
    person: f64,
    lies: [u64; 2],
    /// Velocity of the rock, and way of the person, a second later [m/s, m].
    late: f64,
    way: f64,
}

/// Somebody who stands still, and a ball that hits at the height of the middle.
fn struck(mass: f64, speed: f64) -> Blow {
    let at = [10.0, 2.0];
    let start = [at[0] - 0.18 - 0.2 - 0.5 * speed / FPS as f64, at[1], 1.0];
    let text = words(0.0, &format!("position = [{at:?}]\nreaction = 1000"), &ball(mass, start, [speed, 0.0, 0.0]));
    let mut sim = simulation(&text);
    assert_eq!(fallen(&sim), [0, 0]);
    let mut v = velocities(&sim, "rock")[0];
    while v.x > 0.99 * speed {
        assert!(sim.time() < 0.1, "no blow");
        step(&mut sim);
        v = velocities(&sim, "rock")[0];
    }
    assert!(v.y.abs() < 1e-3 * speed && v.z.abs() < 1e-3 * speed, "{v:?}");
    let (person, lies) = (velocities(&sim, "people")[0].x, fallen(&sim));
    run(&mut sim, FPS);
    Blow { rock: v.x, person, lies, late: velocities(&sim, "rock")[0].x, way: positions(&sim, "people")[0].x - at[0] }
}

#[test]
fn a_blow_is_plastic_and_throws_down_or_injures_by_its_size() {
    for (mass, speed, lies) in [
        // By 0.12 m/s and 24 J; by 0.5 m/s and 30 J; by 1.07 m/s and 64 J; by 1 m/s and 200 J.
        (2.0, 5.0, [0, 0]),
        (40.0, 1.5, [0, 0]),
        (200.0, 1.5, [1, 0]),
        (20.0, 5.0, [0, 1]),
    ] {
        let Blow { rock, person, lies: found, late, way } = struck(mass, speed);
        let impulse = speed / (1.0 / 80.0 + 1.0 / mass);
        let (expected, gain) = (speed - impulse / mass, impulse / 80.0);
        // Whoever is pushed brakes by 0.05 m/s a frame, and what touches with it.
        assert!((rock - expected).abs() < 0.06, "{mass} kg: {rock} m/s, expected {expected}");
        assert!((person - gain).abs() < 0.06, "{mass} kg: {person} m/s, expected {gain}");
        assert_eq!(found, lies, "{mass} kg at {speed} m/s");
        if lies == [0, 0] {
            // The ball lies against a body that stands: both have come to rest.
            assert!(late.abs() < 5e-3, "{mass} kg: still at {late} m/s");
        } else {
            // It goes on above one that slides to rest by 5 m/s².
            let slide = gain * gain / (2.0 * 5.0);
            assert!(
                (late - expected).abs() < 0.06 && (way - slide).abs() < 0.05 * slide,
                "{mass} kg: {late} m/s, {way} m, expected {slide}"
            );
        }
    }
}

#[test]
fn who_has_fallen_rises_and_goes_on_and_who_is_injured_stays() {
    for (mass, speed, stays) in [(200.0, 1.5, false), (20.0, 5.0, true)] {
        let start = [9.0, 2.0, 1.0];
        let text = words(0.0, "position = [[10, 2]]\nspeed_deviation = 0\nreaction = 1", &ball(mass, start, [speed, 0.0, 0.0]));
        let mut sim = simulation(&text);
        let mut lay = 0;
        for _ in 0..20 * FPS {
            step(&mut sim);
            lay += u64::from(fallen(&sim) != [0, 0]);
        }
        let ledger = sim.ledger();
        if stays {
            assert_eq!((ledger.people, ledger.injured), (Some(1), Some(1)));
            assert_eq!(sim.frame(&[]).column("people", "fallen").unwrap().data.numbers(), [2.0]);
        } else {
            // 5 s, unless told otherwise.
            assert_eq!((ledger.people, ledger.left), (Some(0), Some(1)));
            assert!((lay as f64 / FPS as f64 - 5.0).abs() < 0.05, "{lay}");
        }
    }
}

#[test]
fn a_rock_that_falls_on_a_head_is_slowed_as_by_a_body_of_that_mass() {
    // From 2 m above the head; the person stands aside by less than a radius.
    let text = words(G, "position = [[10, 2]]\nreaction = 1000", &ball(50.0, [10.0, 2.0, 1.75 + 0.2 + 2.0], [0.0; 3]));
    let mut sim = simulation(&text);
    let mut before = 0.0;
    while fallen(&sim) == [0, 0] {
        assert!(sim.time() < 1.0, "no blow");
        before = velocities(&sim, "rock")[0].z;
        step(&mut sim);
    }
    // What the rock gets comes on its next turn.
    step(&mut sim);
    let (after, speed) = (velocities(&sim, "rock")[0].z, (2.0 * G * 2.0_f64).sqrt());
    assert!((-before - speed).abs() < 0.15, "{before}");
    // m v / (m + M), and what a frame of weight adds.
    let slowed = before * 50.0 / 130.0;
    assert!((after - slowed).abs() < 0.2, "{before} m/s before, {after} after, expected {slowed}");
    assert_eq!(fallen(&sim), [0, 1]);
}

#[test]
fn people_push_what_is_light_and_walk_around_what_is_heavy() {
    for (mass, moves) in [(15.0, true), (800.0, false)] {
        let text = words(G, "position = [[5, 2]]\nspeed_deviation = 0", &cube([0.6, 0.6, 0.8], mass, [8.0, 2.0], 0.3));
        let mut sim = simulation(&text);
        let mut nearest = f64::INFINITY;
        while sim.ledger().people.unwrap() > 0 {
            assert!(sim.time() < 40.0, "{mass} kg: still there at {:?}", positions(&sim, "people"));
            step(&mut sim);
            let (p, b) = (positions(&sim, "people"), positions(&sim, "crate")[0]);
            if let Some(p) = p.first() {
                let beyond = |d: f64| (d.abs() - 0.3).max(0.0);
                nearest = nearest.min((beyond(p.x - b.x).powi(2) + beyond(p.y - b.y).powi(2)).sqrt() - 0.18);
            }
        }
        let b = positions(&sim, "crate")[0];
        let way = (b.x - 8.0).hypot(b.y - 2.0);
        assert!(if moves { way > 0.2 } else { way < 1e-3 }, "{mass} kg: moved by {way} m");
        // Nobody is inside.
        assert!(nearest > -0.02 && nearest < 0.1, "{mass} kg: {nearest} m");
        assert_eq!(fallen(&sim), [0, 0]);
    }
}

#[test]
fn who_stands_in_a_body_gets_out() {
    // The crate from 9.9 to 10.5 m: the middle of the person is 0.1 m inside.
    let text = words(G, "position = [[10, 2]]\nreaction = 1000", &cube([0.6, 0.6, 0.8], 800.0, [10.2, 2.0], 0.5));
    let mut sim = simulation(&text);
    run(&mut sim, FPS);
    let (p, b) = (positions(&sim, "people")[0], positions(&sim, "crate")[0]);
    assert!((p.y - 2.0).abs() < 1e-9 && (b.x - 10.2).abs() < 0.01, "{p:?} {b:?}");
    let gap = b.x - 0.3 - p.x - 0.18;
    assert!((-5e-3..0.05).contains(&gap), "{gap} m");
}

#[test]
fn a_body_that_fills_a_corridor_sends_everybody_the_other_way() {
    let walls = "[[[0, 0], [20, 0]], [[0, 2], [20, 2]]]";
    let gates = gate("exit", "east", [20.0, 0.0], [20.0, 2.0]) + &gate("exit", "west", [0.0, 0.0], [0.0, 2.0]);
    let people = crowd("area = [[12, 0.3], [16, 1.7]]\ncount = 8");
    let scene = |rest: &str| {
        let start = format!("time = {{ fps = {FPS}, frames = 100000 }}\nworld.gravity = [0, 0, {}]\n", -G);
        simulation(&(start + &plan(walls, &gates) + &people + rest))
    };
    // Ends and falls to the floor within a second: then the way is closed.
    let slab = cube([1.0, 1.9, 2.0], 4000.0, [18.5, 1.0], 0.6).replace("1.0]]", "1.2]]");
    // One that people can push closes nothing.
    let light = slab.replace("mass = 4000", "mass = 10");
    for (rest, east) in [("", 8.0), (&*slab, 0.0), (&*light, 8.0)] {
        let mut sim = scene(rest);
        while sim.ledger().people.unwrap() > 0 {
            assert!(sim.time() < 40.0, "{:?}", positions(&sim, "people"));
            step(&mut sim);
            assert_eq!(sim.ledger().stranded, Some(0));
        }
        let crossings = sim.frame(&[]).column("floor", "crossings").unwrap().data.numbers();
        assert_eq!([crossings[0] + crossings[1], crossings[2] + crossings[3]], [east, 8.0 - east]);
    }
}

#[test]
fn rocks_among_people_give_the_same_bits_on_any_count_of_threads_and_after_a_restore() {
    let rocks = "[[body]]\nname = \"rock\"\nshape = { box = { size = [0.5, 0.4, 0.3] } }\nposition = [[8, 2, 4], [9, 1, 3], [10, 3, 5], [7, 2.5, 2.5]]\n\
                 rotate = [[20, 30, 0]]\nfriction = 0.6\n[[collider]]\nname = \"ground\"\nshape = { floor = {} }\n";
    let text = words(G, "area = [[5, 0.3], [11, 3.7]]\ncount = 30", rocks);
    let once = |threads: usize, restore: bool| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut sim = simulation(&text);
            for frame in 0..300 {
                step(&mut sim);
                if restore && frame % 70 == 0 {
                    let saved = sim.save(&[]);
                    sim = simulation(&text);
                    sim.restore(&saved).unwrap();
                }
            }
            assert!(sim.ledger().injured.unwrap() > 0 && sim.ledger().people.unwrap() > 20);
            let bits = |object: &str, name: &str| -> Vec<u64> {
                column(&sim, object, name).into_iter().flat_map(<[f64; 3]>::from).map(f64::to_bits).collect()
            };
            [bits("people", "position"), bits("people", "velocity"), bits("rock", "position"), bits("rock", "velocity")]
        })
    };
    let reference = once(1, false);
    assert!(reference == once(2, false) && reference == once(8, false) && reference == once(2, true));
}

/// Ten people, one who stands at x [m] and is injured by a stone from behind, and a wall at 10 m with a gap around y = 2 m.
fn past_the_injured(gap: f64, x: f64) -> Simulation {
    let walls = format!("[[[20, 0], [0, 0], [0, 4], [20, 4]], [[10, 0], [10, {}]], [[10, {}], [10, 4]]]", 2.0 - 0.5 * gap, 2.0 + 0.5 * gap);
    let floor = plan(&walls, &gate("exit", "out", [20.0, 0.0], [20.0, 4.0]));
    let places: Vec<[f64; 2]> = (0..10).map(|i| [2.0 + 0.6 * f64::from(i % 5), 1.5 + f64::from(i / 5)]).collect();
    let head = format!("time = {{ fps = {FPS}, frames = 100000 }}\nworld.gravity = [0, 0, 0]\n");
    let walkers = crowd(&format!("position = {places:?}\nspeed_deviation = 0"));
    let victim = format!("[[crowd]]\nname = \"victim\"\nposition = [[{x}, 2]]\nreaction = 1000\n");
    simulation(&(head + &floor + &walkers + &victim + &ball(20.0, [x - 0.6, 2.0, 1.0], [5.0, 0.0, 0.0])))
}

#[test]
fn people_step_over_the_injured_where_there_is_no_way_around() {
    // The blow moves the injured by 0.1 m: into the gap.
    let mut times = Vec::new();
    for x in [9.9, 15.0] {
        let mut sim = past_the_injured(0.8, x);
        let mut on_top = 0;
        while sim.ledger().people.unwrap() > 1 {
            assert!(sim.time() < 60.0, "{:?}", positions(&sim, "people"));
            step(&mut sim);
            let lies = positions(&sim, "victim")[0];
            let near = |p: &&tumble_f64::geometry::Vector| (p.x - lies.x).hypot(p.y - lies.y) < 0.3;
            on_top += positions(&sim, "people").iter().filter(near).count();
        }
        assert_eq!(fallen(&sim), [0, 1]);
        // In the gap everybody steps over; where there is room, nobody.
        assert!(if x < 10.0 { on_top > 10 * FPS / 10 } else { on_top == 0 }, "{on_top} at {x} m");
        times.push(sim.time());
    }
    assert!(times[0] > times[1] + 1.0 && times[0] < times[1] + 20.0, "{times:?}");
}

#[test]
fn who_would_rise_waits_until_nobody_is_on_top() {
    // Knocked down for 5 s before a gap, which forty pass.
    let walls = "[[[20, 0], [0, 0], [0, 4], [20, 4]], [[10, 0], [10, 1.6]], [[10, 2.4], [10, 4]]]";
    let head = format!("time = {{ fps = {FPS}, frames = 100000 }}\nworld.gravity = [0, 0, 0]\n");
    let places: Vec<[f64; 2]> = (0..40).map(|i| [8.6 - 0.6 * f64::from(i / 5), 0.8 + 0.6 * f64::from(i % 5)]).collect();
    let victim = "[[crowd]]\nname = \"victim\"\nposition = [[9.4, 2]]\nreaction = 1000\n";
    let floor = plan(walls, &gate("exit", "out", [20.0, 0.0], [20.0, 4.0]));
    let lies = |walkers: &str| {
        let mut sim = simulation(&format!("{head}{floor}{walkers}{victim}{}", ball(200.0, [8.9, 2.0, 1.0], [1.5, 0.0, 0.0])));
        run(&mut sim, 2 * FPS);
        assert_eq!(fallen(&sim), [1, 0]);
        let nearest = |sim: &Simulation, lies: tumble_f64::geometry::Vector| {
            let others = if walkers.is_empty() { Vec::new() } else { positions(sim, "people") };
            others.iter().map(|p| (p.x - lies.x).hypot(p.y - lies.y)).fold(f64::INFINITY, f64::min)
        };
        loop {
            let before = nearest(&sim, positions(&sim, "victim")[0]);
            step(&mut sim);
            let after = nearest(&sim, positions(&sim, "victim")[0]);
            if fallen(&sim)[0] == 0 {
                return (sim.time(), before.max(after));
            }
            assert!(sim.time() < 5.2 || before.min(after) < 0.45, "{} {before} {after}", sim.time());
        }
    };
    let (alone, trodden) = (lies(""), lies(&crowd(&format!("position = {places:?}\nspeed_deviation = 0"))));
    assert!((5.0..5.2).contains(&alone.0) && trodden.0 > alone.0 + 1.0 && trodden.1 > 0.35, "{alone:?} {trodden:?}");
}
