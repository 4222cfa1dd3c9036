//! Grains against closed forms. See docs/theory/grains.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, column, positions, run, simulation, slope, step, velocities};
use std::f64::consts::{PI, TAU};
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Engine, Mesh, Scene};

const G: f64 = 9.81;
const LAWS: [&str; 2] = ["hertz", "linear"];

/// A scene of grains; frames last 1/100 s.
fn scene(gravity: [f64; 3], system: &str, words: &str) -> Simulation {
    simulation(&format!("time.fps = 100\nworld.gravity = {gravity:?}\n[[system]]\nmethod = \"grains\"\n{system}\n{words}"))
}

/// Gravity on a slope whose floor is level.
fn tilted(angle: f64) -> [f64; 3] {
    [G * angle.sin(), 0.0, -G * angle.cos()]
}

fn grains(name: &str, words: &str) -> String {
    format!("[[grains]]\nname = \"{name}\"\n{words}\n")
}

const FLOOR: &str = "[[collider]]\nname = \"floor\"\nshape = { floor = {} }\nfriction = 0\nrestitution = 0\n";

fn momenta(sim: &Simulation) -> [Vector; 2] {
    let ledger = sim.ledger();
    [ledger.momentum.into(), ledger.angular_momentum.unwrap().into()]
}

#[test]
fn a_ball_rolls_or_slips_down_a_slope_as_friction_says() {
    let friction: f64 = 0.2;
    for law in LAWS {
        for angle in [0.1_f64, 0.5, 0.8] {
            let words = format!("radius = 0.05\nposition = [[0, 0, 0.05]]\nfriction = {friction}\nrestitution = 0.3");
            let mut sim = scene(tilted(angle), &format!("grains = {{ law = \"{law}\" }}"), &(grains("ball", &words) + FLOOR));
            run(&mut sim, 20);
            let before = (velocities(&sim, "ball")[0].x, column(&sim, "ball", "angular_velocity")[0].y);
            run(&mut sim, 50);
            let after = (velocities(&sim, "ball")[0].x, column(&sim, "ball", "angular_velocity")[0].y);
            let (a, alpha) = ((after.0 - before.0) / 0.5, (after.1 - before.1) / 0.5);
            let rolls = angle.tan() <= 3.5 * friction;
            let exact = if rolls { 5.0 / 7.0 * G * angle.sin() } else { G * (angle.sin() - friction * angle.cos()) };
            let turn = if rolls { exact / 0.05 } else { 2.5 * friction * G * angle.cos() / 0.05 };
            assert!((a - exact).abs() < 5e-3 * exact && (alpha - turn).abs() < 5e-3 * turn, "{law} {angle}: {a} {exact}, {alpha} {turn}");
        }
        assert!(0.5_f64.tan() < 3.5 * friction && 0.8_f64.tan() > 3.5 * friction);
    }
}

#[test]
fn a_ball_thrown_along_the_floor_slides_and_then_rolls() {
    let (friction, speed) = (0.3, 2.0);
    let words = format!("radius = 0.05\nposition = [[0, 0, 0.05]]\nvelocity = [[{speed}, 0, 0]]\nfriction = {friction}\nrestitution = 0.3");
    let mut sim = scene([0.0, 0.0, -G], "", &(grains("ball", &words) + FLOOR));
    let until = 2.0 * speed / (7.0 * friction * G);
    run(&mut sim, 60);
    let (v, x) = (velocities(&sim, "ball")[0].x, positions(&sim, "ball")[0].x);
    let way = 12.0 * speed * speed / (49.0 * friction * G) + 5.0 / 7.0 * speed * (0.6 - until);
    assert!(until < 0.5 && (v - 5.0 / 7.0 * speed).abs() < 5e-3 * v && (x - way).abs() < 5e-3 * way, "{v}, {x} of {way}");
}

#[test]
fn what_slides_has_sliding_friction_and_what_rests_has_static() {
    // A ball that slides does not stick again and again, whatever static friction would hold, nor where a step slides far less than friction stores.
    let sliding = 0.1;
    let floor = |resting: f64| FLOOR.replace("friction = 0", &format!("friction = {sliding}\nfriction_static = {resting}"));
    for (speed, frames, step, restitution) in [(3.0, 20, "", 0.3), (0.3, 5, "step = 1e-5", 1.0)] {
        let words = format!(
            "radius = 0.05\nposition = [[0, 0, 0.0497464]]\nvelocity = [[{speed}, 0, 0]]\nfriction = 0\nrestitution = {restitution}"
        );
        let mut sim = scene([0.0, 0.0, -G], step, &(grains("ball", &words) + &floor(0.8)));
        // Static friction holds it first, until it gives way.
        run(&mut sim, 1);
        let before = velocities(&sim, "ball")[0].x;
        run(&mut sim, frames);
        let (v, lost) = (velocities(&sim, "ball")[0].x, sliding * G * 0.01 * frames as f64);
        assert!((before - v - lost).abs() < 5e-3 * lost && lost < 0.2 * speed, "{speed}: {before} {v}, {lost}");
    }
    // On a slope on which sliding friction could not keep it from slipping, static friction lets it roll.
    for (resting, angle) in [(0.8, 0.6_f64), (0.1, 0.6)] {
        let words = "radius = 0.05\nposition = [[0, 0, 0.05]]\nfriction = 0\nrestitution = 0.3";
        let mut sim = scene(tilted(angle), "", &(grains("ball", words) + &floor(resting)));
        run(&mut sim, 20);
        let before = velocities(&sim, "ball")[0].x;
        run(&mut sim, 50);
        let a = (velocities(&sim, "ball")[0].x - before) / 0.5;
        let rolls = angle.tan() < 3.5 * resting;
        let exact = if rolls { 5.0 / 7.0 * G * angle.sin() } else { G * (angle.sin() - sliding * angle.cos()) };
        assert!((a - exact).abs() < 5e-3 * exact && rolls == (resting > 0.5), "{resting}: {a} {exact}");
    }
}

#[test]
fn piles_come_to_rest_however_strongly_contacts_are_damped() {
    for law in LAWS {
        for restitution in [0.05, 0.2, 0.5] {
            let words = format!(
                "radius = 0.02\nradius_spread = 0.1\nfill = [{{ center = [0, 0, 0.2], size = [0.3, 0.3, 0.36] }}]\nfriction = 0.5\nrolling_friction = 0.1\nrestitution = {restitution}"
            );
            let bin = "[[collider]]\nname = \"bin\"\nshape = { box = { center = [0, 0, 0.5], size = [0.32, 0.32, 1] } }\ninside = true\nfriction = 0\nrestitution = 0\n";
            let mut sim = scene([0.0, 0.0, -G], &format!("grains = {{ law = \"{law}\" }}"), &(grains("heap", &words) + bin));
            let mut fastest = |frames: usize| {
                run(&mut sim, frames);
                velocities(&sim, "heap").iter().map(|v| v.norm()).fold(0.0, f64::max)
            };
            let (falling, resting) = (fastest(20), fastest(160));
            let contacts = sim.ledger().contacts.unwrap();
            assert!(falling > 0.5 && resting < 5e-4 && contacts > 500, "{law} {restitution}: {falling}, {resting} m/s, {contacts}");
        }
    }
}

#[test]
fn a_grain_that_hits_a_free_body_parts_as_restitution_says() {
    // Contact lasts longer than an interval of the exchange. Off the centre the body turns: the point of contact parts all the same.
    for (offset, order) in [(0.0, ["grains", "rigid"]), (0.06, ["grains", "rigid"]), (0.06, ["rigid", "grains"])] {
        let systems: String =
            order.iter().map(|method| format!("[[system]]\nname = \"{method}\"\nmethod = \"{method}\"\nstep = 2e-4\n")).collect();
        let ball = grains(
            "ball",
            &format!(
                "radius = 0.05\nposition = [[{offset}, 0, 0.16]]\nvelocity = [[0, 0, -1]]\nfriction = 0\nrestitution = 0.5\nyoung = 2e6"
            ),
        );
        let body = "[[body]]\nname = \"box\"\nshape = { box = { size = [0.3, 0.3, 0.2] } }\nmass = 1\nfriction = 0\nrestitution = 0\n";
        let text = format!("time = {{ fps = 100, exchanges = 3 }}\nworld.gravity = [0, 0, 0]\n{systems}{ball}{body}");
        let mut sim = simulation(&text);
        let before = momenta(&sim);
        run(&mut sim, 20);
        let (v, u) = (velocities(&sim, "ball")[0].z, velocities(&sim, "box")[0].z);
        let w = column(&sim, "box", "angular_velocity")[0].y;
        let parts = v - (u - w * offset);
        assert!((parts - 0.5).abs() < 0.01 && u < -0.1, "{offset} {order:?}: parts with {parts}, box {u}");
        for (a, b) in before.into_iter().zip(momenta(&sim)) {
            assert!((a - b).norm() < 1e-13, "{offset}: {:e}", (a - b).norm());
        }
    }
}

#[test]
fn a_free_body_moves_and_turns_as_far_as_in_short_intervals() {
    let ends = |exchanges: u32| {
        let ball = grains(
            "ball",
            "radius = 0.05\nposition = [[0.1, 0, 0.16]]\nvelocity = [[0, 0, -1]]\nfriction = 0\nrestitution = 0.5\nyoung = 2e6",
        );
        let systems: String = ["grains", "rigid"].map(|m| format!("[[system]]\nname = \"{m}\"\nmethod = \"{m}\"\nstep = 2e-4\n")).concat();
        let body = "[[body]]\nname = \"box\"\nshape = { box = { size = [0.3, 0.3, 0.2] } }\nmass = 1\nfriction = 0\nrestitution = 0\n";
        let time = format!("time = {{ fps = 100, exchanges = {exchanges} }}\nworld.gravity = [0, 0, 0]\n");
        let mut sim = simulation(&format!("{time}{systems}{ball}{body}"));
        run(&mut sim, 3);
        let turn = match &sim.frame(&[]).column("box", "turn").unwrap().data {
            tumble_interface::Data::F64(q) => 2.0 * q[1].asin(),
            _ => panic!(),
        };
        (positions(&sim, "box")[0].z, turn)
    };
    let (coarse, fine) = (ends(1), ends(50));
    assert!((coarse.0 - fine.0).abs() < 0.02 * fine.0.abs() && fine.0 < -5e-3, "{coarse:?} {fine:?}");
    assert!((coarse.1 - fine.1).abs() < 0.02 * fine.1.abs() && fine.1 > 0.05, "{coarse:?} {fine:?}");
}

#[test]
fn rolling_and_twisting_friction_hold_what_they_say() {
    let resists = 0.2_f64;
    for (angle, moves) in [(0.19_f64, false), (0.3, true)] {
        let words = format!("radius = 0.05\nposition = [[0, 0, 0.05]]\nfriction = 1\nrolling_friction = {resists}\nrestitution = 0.3");
        let mut sim = scene(tilted(angle), "", &(grains("ball", &words) + FLOOR));
        run(&mut sim, 50);
        let before = velocities(&sim, "ball")[0].x;
        run(&mut sim, 50);
        let a = (velocities(&sim, "ball")[0].x - before) / 0.5;
        let exact = if moves { 5.0 / 7.0 * G * (angle.sin() - resists * angle.cos()) } else { 0.0 };
        assert!((a - exact).abs() < 5e-3 * exact.max(0.02), "{angle}: {a} of {exact}");
    }
    let words = "radius = 0.05\nposition = [[0, 0, 0.05]]\nangular_velocity = [[0, 0, 40]]\nfriction = 0.5\ntwisting_friction = 0.02\nrestitution = 0.3";
    let mut sim = scene([0.0, 0.0, -G], "", &(grains("top", words) + FLOOR));
    run(&mut sim, 100);
    let left = 40.0 - 2.5 * 0.02 * G / 0.05;
    let w = column(&sim, "top", "angular_velocity")[0].z;
    assert!((w - left).abs() < 5e-3 * (40.0 - left), "{w} of {left}");
}

#[test]
fn grains_part_with_the_speed_that_restitution_says() {
    for law in LAWS {
        for e in [0.05, 0.2, 0.5, 0.9, 1.0] {
            for speed in [0.05, 1.0] {
                let at = "position = [[-0.0501, 0, 0], [0.0501, 0, 0]]";
                let words = format!("radius = 0.05\n{at}\nvelocity = [[{speed}, 0, 0], [-{speed}, 0, 0]]\nrestitution = {e}");
                let mut sim = scene([0.0; 3], &format!("step = 2e-6\ngrains = {{ law = \"{law}\" }}"), &grains("balls", &words));
                run(&mut sim, 10);
                let [a, b] = velocities(&sim, "balls")[..] else { panic!() };
                let found = (b.x - a.x) / (2.0 * speed);
                assert!((found - e).abs() < 1e-3, "{law}, e = {e} at {speed} m/s: {found}");
            }
        }
    }
}

#[test]
fn at_the_default_step_balls_part_nearly_as_restitution_says() {
    // Eight pairs that touch at eight moments of a step; all of them within a step are not longer than 9e-4 s.
    for law in LAWS {
        for e in [0.1, 0.3, 0.5, 0.8] {
            let at: Vec<Vector> = (0..8)
                .flat_map(|k| [-1.0, 1.0].map(|side| common::vector(side * (0.0501 + 1e-4 * f64::from(k)), f64::from(k), 0.0)))
                .collect();
            let v: Vec<Vector> = (0..16).map(|k| common::vector(if k % 2 == 0 { 1.0 } else { -1.0 }, 0.0, 0.0)).collect();
            let words = format!("radius = 0.05\nposition = {}\nvelocity = {}\nrestitution = {e}", common::list(&at), common::list(&v));
            let mut sim = scene([0.0; 3], &format!("grains = {{ law = \"{law}\" }}"), &grains("balls", &words));
            run(&mut sim, 10);
            let found: Vec<f64> = velocities(&sim, "balls").chunks_exact(2).map(|pair| 0.5 * (pair[1].x - pair[0].x)).collect();
            let mean = found.iter().sum::<f64>() / 8.0;
            assert!((mean - e).abs() < 6e-3 && found.iter().all(|one| (one - e).abs() < 0.03), "{law} {e}: {mean} {found:?}");
        }
    }
}

#[test]
fn damped_contacts_have_errors_of_second_order() {
    // A ball that swings on its contact, sticks and rolls against resistance; two that hold together, turn and swing.
    let ball = grains(
        "ball",
        "radius = 0.05\nposition = [[0, 0, 0.0495]]\nvelocity = [[0.02, 0, 0]]\nfriction = 2\nrolling_friction = 1\ntwisting_friction = 1\nrestitution = 0.3",
    ) + FLOOR;
    let pair = grains(
        "ball",
        "radius = 0.05\nposition = [[0, 0, 1], [0.0995, 0, 1]]\nvelocity = [[0, 0.02, 0], [0.05, 0, 0]]\nangular_velocity = [[0.2, 0.3, 0.5], [0, 0, 0.4]]\nfriction = 5\nrolling_friction = 2\ntwisting_friction = 2\ncohesion = 1000\nrestitution = 0.3",
    );
    for (what, gravity, words) in [("floor", tilted(0.1), &ball), ("pair", [0.0; 3], &pair)] {
        let after = |substeps: u32| {
            let mut sim = scene(gravity, &format!("substeps = {substeps}"), words);
            run(&mut sim, 3);
            assert!(sim.ledger().contacts.unwrap() == 1, "{what}");
            [velocities(&sim, "ball"), column(&sim, "ball", "angular_velocity").iter().map(|w| *w * 0.05).collect()].concat()
        };
        let exact = after(1024);
        let error = |substeps: u32| after(substeps).iter().zip(&exact).map(|(a, b)| (*a - *b).norm()).fold(0.0, f64::max);
        let errors = [16, 32, 64].map(error);
        let order = (errors[0] / errors[2]).log2() / 2.0;
        assert!(order > 1.8 && errors[2] > 1e-8, "{what}: {errors:?}, order {order}");
    }
}

#[test]
fn a_contact_is_as_deep_and_as_long_as_hertz_says() {
    let (young, poisson, radius, density): (f64, f64, f64, f64) = (1e7, 0.25, 0.05, 2500.0);
    let mass = 4.0 / 3.0 * PI * radius.powi(3) * density;
    // On a floor that does not yield.
    let elastic = young / (1.0 - poisson * poisson);
    let words = format!("radius = {radius}\nposition = [[0, 0, {radius}]]\nrestitution = 0.1");
    let mut sim = scene([0.0, 0.0, -G], "", &(grains("ball", &words) + FLOOR));
    run(&mut sim, 100);
    let exact = (3.0 * mass * G / (4.0 * elastic * radius.sqrt())).powf(2.0 / 3.0);
    let depth = sim.ledger().penetration.unwrap();
    assert!((depth - exact).abs() < 1e-4 * exact && exact > 1e-4, "{depth:e} of {exact:e}");
    assert!((sim.ledger().elastic - 0.4 * mass * G * exact).abs() < 1e-3 * mass * G * exact, "{}", sim.ledger().elastic);
    // A head-on impact: the greatest overlap, and how long it takes.
    let speed: f64 = 1.0;
    let words = format!("radius = {radius}\nposition = [[0, 0, {radius}]]\nvelocity = [[0, 0, -{speed}]]\nrestitution = 1");
    let text = "time.fps = 20000\nworld.gravity = [0, 0, 0]\n[[system]]\nmethod = \"grains\"\nsubsteps = 5\n";
    let mut sim = simulation(&format!("{text}{}{FLOOR}", grains("ball", &words)));
    let (mut deepest, mut touching) = (0.0_f64, 0);
    for _ in 0..400 {
        step(&mut sim);
        let ledger = sim.ledger();
        deepest = deepest.max(ledger.penetration.unwrap());
        touching += u32::from(ledger.contacts.unwrap() > 0);
    }
    let most = (15.0 * mass * speed * speed / (16.0 * elastic * radius.sqrt())).powf(0.4);
    let (took, exact) = (f64::from(touching) / 20000.0, 2.943_275_2 * most / speed);
    assert!((deepest - most).abs() < 1e-3 * most, "{deepest:e} of {most:e}");
    assert!((took - exact).abs() < 1.5 / 20000.0 && exact < 0.015, "{took:e} of {exact:e}");
}

/// Balls that fly into each other, spinning.
fn crowd(words: &str, system: &str) -> Simulation {
    let mut random = common::Numbers(7);
    let mut places = Vec::new();
    while places.len() < 150 {
        let p = random.vector() * 0.6;
        if places.iter().all(|q: &Vector| (*q - p).norm() > 0.105) {
            places.push(p);
        }
    }
    let v: Vec<Vector> = places.iter().map(|p| *p * -2.0 + random.vector()).collect();
    let w: Vec<Vector> = places.iter().map(|_| random.vector() * 30.0).collect();
    let at =
        [("position", &places), ("velocity", &v), ("angular_velocity", &w)].map(|(key, list)| format!("{key} = {}\n", common::list(list)));
    scene([0.0; 3], system, &grains("balls", &format!("radius = 0.05\n{}{words}", at.concat())))
}

#[test]
fn without_walls_momentum_and_angular_momentum_stay() {
    for law in LAWS {
        let words =
            "friction = 0.5\nrolling_friction = 0.1\ntwisting_friction = 0.1\nrestitution = 0.4\nradius_spread = 0.04\ncohesion = 2";
        let mut sim = crowd(words, &format!("grains = {{ law = \"{law}\" }}"));
        let (before, energy) = (momenta(&sim), sim.ledger().kinetic);
        run(&mut sim, 40);
        let (after, left) = (momenta(&sim), sim.ledger().kinetic);
        // Most of the energy is gone.
        assert!(left < 0.6 * energy, "{left} of {energy}");
        let scale = sim.ledger().mass * 2.0;
        for (a, b) in before.into_iter().zip(after) {
            assert!((a - b).norm() < 1e-12 * scale && a.norm() > 1e-4 * scale, "{a:?} {b:?}, {scale}");
        }
    }
}

#[test]
fn elastic_grains_keep_their_energy_to_second_order() {
    for law in LAWS {
        let lost = |step: f64| {
            let mut sim = crowd("friction = 0\nrestitution = 1", &format!("step = {step}\ngrains = {{ law = \"{law}\" }}"));
            let before = sim.ledger();
            let mut off = 0.0_f64;
            for _ in 0..30 {
                common::step(&mut sim);
                off = off.max((sim.ledger().energy() / before.energy() - 1.0).abs());
            }
            assert!(sim.ledger().contacts.unwrap() < 150);
            off
        };
        let errors = [8e-5, 4e-5, 2e-5, 1e-5].map(lost);
        let order = slope(&[(8e-5_f64.ln(), errors[0].ln()), (1e-5_f64.ln(), errors[3].ln())]);
        assert!(errors[3] < 1e-5 && order > 1.6, "{law}: {errors:?}, order {order}");
    }
}

#[test]
fn cohesion_holds_what_it_can_carry() {
    let (radius, density): (f64, f64) = (0.01, 2500.0);
    let weight = 4.0 / 3.0 * PI * radius.powi(3) * density * G;
    for (part, holds) in [(1.05, true), (0.95, false)] {
        let cohesion = part * weight / (TAU * radius);
        let words = format!("radius = {radius}\nposition = [[0, 0, {}]]\ncohesion = {cohesion}\nrestitution = 0.3", 1e-6 - radius);
        let ceiling = "[[collider]]\nname = \"ceiling\"\nshape = { plane = { point = [0, 0, 0], normal = [0, 0, -1] } }\n";
        let mut sim = scene([0.0, 0.0, -G], "", &(grains("drop", &words) + ceiling));
        run(&mut sim, 50);
        let fell = -radius - positions(&sim, "drop")[0].z;
        assert!(if holds { fell.abs() < 1e-5 } else { fell > 0.01 }, "{part}: {fell}");
    }
}

/// A heap between walls, with grains of two materials and a ball that is pushed through.
fn heap(radius: f64, system: &str, more: &str) -> Simulation {
    let words = format!(
        "radius = {radius}\nradius_spread = 0.2\nfill = [{{ center = [0, 0, 0.2], size = [0.4, 0.3, 0.38], shape = \"cylinder\" }}]\n\
                 friction = 0.4\nrolling_friction = 0.05\nrestitution = 0.3\n"
    );
    let heavy = "radius = 0.04\nposition = [[0.02, 0.01, 0.5], [-0.05, 0, 0.6]]\ndensity = 5000\ncohesion = 1\n";
    let wall = |name: &str, center: [f64; 2], size: [f64; 2]| {
        let ([x, y], [a, b]) = (center, size);
        format!("[[collider]]\nname = \"{name}\"\nshape = {{ box = {{ center = [{x}, {y}, 0.5], size = [{a}, {b}, 1] }} }}\n")
    };
    let walls = [
        wall("left", [-0.26, 0.0], [0.1, 0.5]),
        wall("right", [0.26, 0.0], [0.1, 0.5]),
        wall("front", [0.0, -0.2], [0.42, 0.1]),
        wall("back", [0.0, 0.2], [0.42, 0.1]),
        "[[collider]]\nname = \"stirrer\"\nshape = { sphere = { center = [-0.3, 0, 0.05], radius = 0.04 } }\nmotion.keys = [{ time = 0 }, { time = 0.8, translate = [0.4, 0, 0] }]\n"
            .into(),
        FLOOR.into(),
    ];
    scene([0.0, 0.0, -G], system, &[&grains("sand", &words), &grains("stones", heavy), &walls.concat(), more].concat())
}

#[test]
fn threads_snapshots_and_far_grains_change_no_bit() {
    let after = |threads: usize, cut: bool, more: &str| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut sim = heap(0.006, "step = 8e-5", more);
            run(&mut sim, 4);
            if cut {
                let kept = sim.save(&[]);
                sim = heap(0.006, "step = 8e-5", more);
                sim.restore(&kept).unwrap();
            }
            run(&mut sim, 4);
            assert!(sim.ledger().contacts.unwrap() > 1000);
            [positions(&sim, "sand"), velocities(&sim, "sand"), column(&sim, "stones", "angular_velocity")].concat()
        })
    };
    let plain = after(1, false, "");
    let far = grains("far", "radius = 0.03\nposition = [[-50, 0, 0.03], [-50.02, 0, 0.5], [60, 3, 9]]\nvelocity = [[0, 0, 3]]");
    assert!(plain.iter().all(|v| v.norm().is_finite()) && plain.len() > 3 * 4096);
    for (what, other) in [("threads", after(3, false, "")), ("a snapshot", after(2, true, "")), ("far grains", after(2, false, &far))] {
        assert!(plain == other, "{what}");
    }
}

#[test]
fn grains_and_a_body_share_momentum_and_angular_momentum() {
    let shapes = [
        "box = { size = [0.3, 0.2, 0.1] }",
        "sphere = { radius = 0.12 }",
        "cylinder = { radius = 0.1, height = 0.2 }",
        "hull = { points = [[0.2, 0, 0], [-0.1, 0.15, 0], [-0.1, -0.15, 0], [0, 0, 0.2]] }",
    ];
    for shape in shapes {
        let mut random = common::Numbers(3);
        let places: Vec<Vector> = (0..60)
            .map(|k| common::vector(f64::from(k % 4) * 0.05 - 0.07, f64::from(k / 4 % 4) * 0.05 - 0.07, -0.25 - f64::from(k / 16) * 0.05))
            .collect();
        let spins: Vec<Vector> = places.iter().map(|_| random.vector() * 20.0).collect();
        let words = format!(
            "radius = 0.02\nposition = {}\nangular_velocity = {}\nvelocity = [[0.3, 0.1, 2]]\nfriction = 0.5\nrolling_friction = 0.1\nrestitution = 0.4",
            common::list(&places),
            common::list(&spins)
        );
        let body = format!(
            "[[body]]\nname = \"raft\"\nshape = {{ {shape} }}\nmass = 1\nangular_velocity = [[1, 2, 3]]\n[[system]]\nname = \"bodies\"\nmethod = \"rigid\"\n"
        );
        let mut sim = scene([0.0; 3], "name = \"grains\"\nstep = 1e-4", &(body + &grains("shot", &words)));
        let before = momenta(&sim);
        run(&mut sim, 60);
        let after = momenta(&sim);
        let v = velocities(&sim, "raft")[0];
        assert!(v.z > 0.3, "{shape}: {v:?}");
        for (a, b) in before.into_iter().zip(after) {
            assert!((a - b).norm() < 1e-11 && a.norm() > 0.05, "{shape}: {:e} of {}", (a - b).norm(), a.norm());
        }
    }
}

#[test]
fn a_body_rests_on_grains_and_a_heavier_one_lies_deeper() {
    let resting = |mass: f64| {
        let body = format!(
            "[[body]]\nname = \"box\"\nshape = {{ box = {{ size = [0.15, 0.15, 0.1] }} }}\nposition = [[0, 0, 0.55]]\nmass = {mass}\n[[system]]\nname = \"bodies\"\nmethod = \"rigid\"\n"
        );
        let mut sim = heap(0.02, "name = \"grains\"", &body);
        run(&mut sim, 300);
        sim
    };
    let depth = |mass: f64| {
        let sim = resting(mass);
        let (x, v) = (positions(&sim, "box")[0].z, velocities(&sim, "box")[0].norm());
        assert!(v < 0.02, "{mass} kg: {v} m/s at {x} m");
        x
    };
    // Nor does it creep.
    let mut sim = resting(2.0);
    let before = positions(&sim, "box")[0].z;
    run(&mut sim, 50);
    let crept = positions(&sim, "box")[0].z - before;
    assert!(crept.abs() < 2e-5, "{crept:e} m in 0.5 s");
    let [light, heavy] = [2.0, 40.0].map(depth);
    assert!(light > 0.12 && heavy < light - 0.01 && heavy > 0.06, "{light} {heavy}");
}

/// All that is wrong with a scene of grains.
fn wrong(words: &str) -> Vec<String> {
    let scene = Scene::from_toml(&format!("version = 1\n{words}")).unwrap();
    let issues = Simulation::new(scene, Assets::default()).err().unwrap().issues;
    issues.into_iter().map(|issue| format!("{}: {}", issue.path, issue.message)).collect()
}

#[test]
fn what_is_wrong_with_grains_is_told_at_once_with_a_cure() {
    let full = "fill = [{ center = [0, 0, 1], size = [0.1, 0.1, 0.1] }]";
    let told = wrong(
        &[
            grains("none", "radius = 0.01"),
            grains("large", &format!("radius = 0.1\n{full}")),
            grains("many", "radius = 0.01\nfill = [{ center = [0, 0, 1], size = [0.1, 0.1, 0.1], count = 5000 }]"),
            grains("fast", &format!("radius = 0.01\nvelocity = [[0, 0, 1], [0, 0, 2]]\n{full}")),
        ]
        .concat(),
    );
    let expected =
        ["grains \"none\": ", "grains \"large\".fill[0].size: ", "grains \"many\".fill[0].count: ", "grains \"fast\".velocity: "];
    assert_eq!(told.len(), expected.len(), "{told:?}");
    for (told, expected) in told.iter().zip(expected) {
        assert!(told.starts_with(expected) && (told.contains("lower") || told.contains("give") || told.contains("expected")), "{told}");
    }
    // Grains between walls that leave no room for them.
    let walls = ["-1", "1"].map(|side| {
        format!(
            "[[collider]]\nname = \"w{side}\"\nshape = {{ plane = {{ point = [0, 0, {}0.005], normal = [0, 0, {side}] }} }}\n",
            if side == "1" { "-" } else { "" }
        )
    });
    let told = wrong(&(grains("pressed", "radius = 0.01\nposition = [[0, 0, 0]]") + &walls.concat()));
    assert!(told.len() == 1 && told[0].contains("room"), "{told:?}");
    // So many in one place that all meet all.
    let heap = vec!["[0, 0, 0]"; 300].join(", ");
    let told = wrong(&grains("heap", &format!("radius = 0.01\nposition = [{heap}]")));
    assert!(told.len() == 1 && told[0].contains("more than 100 others"), "{told:?}");
    // Words of others.
    let told = wrong(&format!(
        "dimension = 2\n[[system]]\nmethod = \"grains\"\nclamp = 2\nsolver.newton_iterations = 3\n{}",
        grains("g", &format!("radius = 0.01\n{full}"))
    ));
    assert!(told.len() >= 2 && told.iter().any(|t| t.starts_with("dimension")) && told.iter().any(|t| t.contains("clamp")), "{told:?}");
}

/// A closed ring of square section around z, 0.1 m high, with radii of 0.1 and 0.3 m.
fn ring() -> Mesh {
    let n = 48_u32;
    let corners = [[0.1, 0.0], [0.3, 0.0], [0.3, 0.1], [0.1, 0.1]];
    let vertices = (0..n).flat_map(|i| {
        let turn = TAU * f64::from(i) / f64::from(n);
        corners.map(|[r, z]| [r * turn.cos(), r * turn.sin(), z])
    });
    let quads =
        (0..n).flat_map(|i| (0..4).map(move |k| [i * 4 + k, i * 4 + (k + 1) % 4, (i + 1) % n * 4 + (k + 1) % 4, (i + 1) % n * 4 + k]));
    let triangles = quads.flat_map(|[a, b, c, d]| [[a, d, c], [a, c, b]]).collect();
    Mesh { vertices: vertices.collect(), triangles, ..Mesh::default() }
}

#[test]
fn fills_keep_within_meshes_and_other_solids() {
    let build = |within: &str, mesh: Mesh| {
        let fill = format!("fill = [{{ center = [0, 0, 0.05], size = [0.8, 0.8, 0.4], within = {within} }}]");
        let text = format!("version = 1\n{}", grains("sand", &format!("radius = 0.01\nradius_spread = 0.1\n{fill}")));
        let assets = Assets::new(std::collections::HashMap::from([("ring.obj".to_string(), mesh)]), Default::default());
        Simulation::new(Scene::from_toml(&text).unwrap(), assets)
    };
    let within = "{ mesh = { path = \"ring.obj\" } }";
    let sim = build(within, ring()).unwrap();
    let x = positions(&sim, "sand");
    // Flat sides bring the inner wall nearer, and the outer one.
    let fits = |p: &Vector| (0.11..0.29).contains(&p.x.hypot(p.y)) && (0.01..0.09).contains(&p.z);
    // Of each layer of 2.42 cm squares nearly those whose centres have room.
    let layers = (0.1_f64 / 0.0242).floor();
    let room = PI * (0.29_f64.powi(2) - 0.11_f64.powi(2)) / 0.0242_f64.powi(2);
    assert!(x.iter().all(fits) && x.len() as f64 > 0.8 * room * (layers - 1.0), "{} of {room} in each of {layers}", x.len());
    let sim = build("{ sphere = { center = [0, 0, 0], radius = 0.2 } }", ring()).unwrap();
    let x = positions(&sim, "sand");
    assert!(x.iter().all(|p| p.norm() < 0.19) && x.len() > 200, "{}", x.len());
    // An open mesh has no inside; and nothing fits where there is no room.
    let mut open = ring();
    open.triangles.truncate(300);
    let small = "{ sphere = { center = [0, 0, 0], radius = 0.01 } }";
    for (within, mesh, path, cure) in
        [(within, open, "grains \"sand\".fill[0].within.mesh", "open"), (small, ring(), "grains \"sand\".fill[0].within", "lower radius")]
    {
        let issues = build(within, mesh).err().unwrap().issues;
        assert!(issues.len() == 1 && issues[0].path == path && issues[0].message.contains(cure), "{issues:?}");
    }
}

#[test]
fn grains_that_overlap_at_the_start_part_without_a_launch() {
    let mut random = common::Numbers(5);
    let places: Vec<Vector> = (0..200).map(|_| random.vector() * 0.12).collect();
    let mut sim = scene([0.0; 3], "", &grains("heap", &format!("radius = 0.02\nposition = {}", common::list(&places))));
    assert!(sim.warnings().iter().any(|w| w.code.name() == "starts-inside"));
    run(&mut sim, 20);
    let fastest = velocities(&sim, "heap").iter().map(|v| v.norm()).fold(0.0, f64::max);
    assert!(fastest < 0.2, "{fastest}");
}

#[test]
fn grains_on_a_mesh_go_as_on_a_plane_and_touch_both_sides_of_a_corner() {
    let words = "radius = 0.05\nposition = [[0, 0, 0.05]]\nfriction = 0.4\nrolling_friction = 0.05\nrestitution = 0.3";
    let roll = |solid: &str| {
        let mut sim = scene(tilted(0.3), "", &(grains("ball", words) + solid));
        run(&mut sim, 40);
        (positions(&sim, "ball")[0], sim.ledger().energy())
    };
    let disc =
        "[[collider]]\nname = \"disc\"\nshape.lathe.profile = [[0, 0], [4, 0], [4, -0.2], [0, -0.2]]\nfriction = 0\nrestitution = 0\n";
    let (plane, mesh) = (roll(FLOOR), roll(disc));
    assert!((plane.0 - mesh.0).norm() < 1e-9 && plane.0.x > 0.1, "{plane:?} {mesh:?}");
    // In the groove of a bowl with an upright wall.
    let bowl = "[[collider]]\nname = \"bowl\"\nshape.lathe = { profile = [[0, 0], [0.5, 0], [0.5, 0.3], [0.52, 0.3], [0.52, -0.02], [0, -0.02]], sides = 4 }\n";
    let mut sim = scene([G * 0.5, 0.0, -G], "", &(grains("ball", &words.replace("0, 0, 0.05", "0.2, 0.01, 0.05")) + bowl));
    run(&mut sim, 300);
    let ledger = sim.ledger();
    assert!(ledger.contacts.unwrap() >= 2 && velocities(&sim, "ball")[0].norm() < 1e-4, "{:?}", ledger.contacts);
}

#[test]
fn solids_lose_friction_in_time_and_turn_grains_with_them() {
    // From 0.5 to nothing at once: the spin that friction has given stays.
    let floor = "[[collider]]\nname = \"floor\"\nshape = { floor = {} }\nfriction = { keys = [[0, 0.5], [0.1, 0]], interpolation = \"step\" }\nrestitution = 0\n";
    let words = "radius = 0.05\nposition = [[0, 0, 0.05]]\nvelocity = [[5, 0, 0]]\nfriction = 0\nrestitution = 0.3";
    let mut sim = scene([0.0, 0.0, -G], "", &(grains("ball", words) + floor));
    run(&mut sim, 11);
    let spin = column(&sim, "ball", "angular_velocity")[0].y;
    run(&mut sim, 20);
    let later = column(&sim, "ball", "angular_velocity")[0].y;
    assert!(spin > 5.0 && (later - spin).abs() < 1e-9, "{spin} {later}");
    // A grain in the middle of a turntable turns with it.
    let table =
        "[[collider]]\nname = \"table\"\nshape = { box = { center = [0, 0, -0.1], size = [1, 1, 0.2] } }\nmotion = { spin = [0, 0, 3] }\n";
    let words = "radius = 0.05\nposition = [[0, 0, 0.05]]\nfriction = 0.5\ntwisting_friction = 0.1\nrestitution = 0.3";
    let mut sim = scene([0.0, 0.0, -G], "", &(grains("ball", words) + table));
    run(&mut sim, 100);
    let w = column(&sim, "ball", "angular_velocity")[0];
    assert!((w.z - 3.0).abs() < 1e-6, "{w:?}");
}

#[test]
fn the_books_are_the_same_after_a_restore() {
    let body = "[[body]]\nname = \"box\"\nshape = { box = { size = [0.15, 0.15, 0.1] } }\nposition = [[0, 0, 0.3]]\n[[system]]\nname = \"bodies\"\nmethod = \"rigid\"\n";
    let build = || heap(0.02, "name = \"grains\"", body);
    let mut sim = build();
    run(&mut sim, 25);
    let kept = sim.save(&[]);
    let mut fresh = build();
    fresh.restore(&kept).unwrap();
    let (a, b) = (sim.ledger(), fresh.ledger());
    assert!(a.contacts.unwrap() > 100 && a.elastic > 0.0, "{a:?}");
    assert_eq!((a.contacts, a.penetration, a.elastic, a.kinetic), (b.contacts, b.penetration, b.elastic, b.kinetic));
}

#[test]
fn a_far_fast_grain_changes_no_bit_where_a_grain_and_a_body_close_in() {
    let body = "[[body]]\nname = \"box\"\nshape = { box = { size = [0.3, 0.3, 0.1] } }\nvelocity = [[0, 0, 2]]\nmass = 1\n[[system]]\nname = \"bodies\"\nmethod = \"rigid\"\n";
    let after = |more: &str| {
        let words = "radius = 0.02\nposition = [[0, 0, 0.12], [0.05, 0, 0.13]]\nvelocity = [[0, 0, -2]]";
        let mut sim = scene([0.0; 3], "name = \"grains\"\nstep = 1e-4", &[body, &grains("shot", words), more].concat());
        run(&mut sim, 6);
        [positions(&sim, "shot"), velocities(&sim, "box")].concat()
    };
    let plain = after("");
    assert!(plain[2].z < 1.99);
    for speed in [10, 35, 90] {
        assert!(
            plain == after(&grains("far", &format!("radius = 0.02\nposition = [[0, 90, 0]]\nvelocity = [[0, {speed}, 0]]"))),
            "{speed}"
        );
    }
}

#[test]
fn a_heap_that_explodes_by_too_long_steps_ends_the_run() {
    let heap = "radius = 0.01\nfill = [{ center = [0, 0, 0.2], size = [0.2, 0.2, 0.3] }]";
    let last = |step: f64| {
        let mut sim = scene([0.0, 0.0, -G], &format!("step = {step}"), &(grains("heap", heap) + FLOOR));
        (0..40).find_map(|_| sim.step(&|| true).err())
    };
    let (told, healthy) = (last(5e-3), last(1.6e-4));
    let text = told.map(|error| error.to_string()).unwrap_or_default();
    assert!(text.contains("exploded") && text.contains("stable step"), "{text}");
    assert!(healthy.is_none(), "{healthy:?}");
}
