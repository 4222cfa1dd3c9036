//! Pins that let go and take hold, each at the sub-step nearest to its time.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::*;
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;
use tumble_interface::scene::Integrator;

const G: f64 = 9.8;

fn system(integrator: Integrator, substeps: u32) -> String {
    match integrator {
        Integrator::PositionBased => format!("method = \"position_based\"\nsubsteps = {substeps}\n"),
        adaptive if adaptive.is_adaptive() => format!("integrator = \"{}\"\nadaptive.tolerance = 1e-7\n", adaptive.name()),
        fixed => format!("integrator = \"{}\"\nsubsteps = {substeps}\n", fixed.name()),
    }
}

/// Two masses on a spring at rest, and one alone, held for these times.
fn masses(integrator: Integrator, substeps: u32, times: &str) -> Simulation {
    simulation(&format!(
        "precision = \"double\"\ntime = {{ fps = 25, frames = 50 }}\n[[system]]\n{}\n[[particles]]\nname = \"p\"\nposition = [[0, 0, 0], [0.3, 0, 0], [5, 0, 0]]\n\
         spring = [{{ between = [0, 1], stiffness = 10 }}]\npin = [{{ which = \"all\", {times} }}]\n",
        system(integrator, substeps)
    ))
}

#[test]
fn what_is_let_go_falls_from_then_on_under_every_scheme() {
    for integrator in every() {
        // Not at the start of a frame: 0.5 s are 12.5 of them. The frame before, all stand.
        let mut sim = masses(integrator, 200, "until = 0.5");
        run(&mut sim, 12);
        assert!(positions(&sim, "p").iter().all(|x| x.z == 0.0), "{integrator:?}");
        run(&mut sim, 13);
        let fall = -G / 2.0 * 0.25;
        for x in positions(&sim, "p") {
            // Schemes of first order are off by g t h/2.
            let bound = if integrator == Integrator::DormandPrince { 1e-8 } else { 1.01 * G * 0.5 * (0.04 / 200.0) };
            assert!((x.z - fall).abs() < bound, "{integrator:?}: {} {fall}", x.z);
        }
    }
}

#[test]
fn what_is_taken_hold_of_stays_where_it_is_then() {
    for integrator in every() {
        let mut sim = masses(integrator, 200, "from = 0.5");
        run(&mut sim, 13);
        let before = positions(&sim, "p");
        let bound = 1.01 * G * 0.5 * (0.04 / 200.0);
        assert!((before[2].z + G / 2.0 * 0.25).abs() < bound, "{integrator:?}: {:?}", before[2]);
        run(&mut sim, 12);
        assert_eq!(positions(&sim, "p"), before, "{integrator:?}");
        assert_eq!(velocities(&sim, "p"), [[0.0; 3].into(); 3], "{integrator:?}");
    }
}

#[test]
fn a_pin_may_let_go_and_take_hold_again() {
    let mut sim = simulation(
        "precision = \"double\"\ntime = { fps = 50, frames = 100 }\n[[system]]\nintegrator = \"velocity_verlet\"\nsubsteps = 10\n[[particles]]\nname = \"p\"\n\
         position = [[0, 0, 0]]\npin = [{ which = \"all\", until = 0.4 }, { which = \"all\", from = 1 }]\n",
    );
    run(&mut sim, 50);
    let fall = positions(&sim, "p")[0].z;
    assert!((fall + G / 2.0 * 0.36).abs() < 1e-9, "{fall}");
    run(&mut sim, 50);
    assert_eq!(positions(&sim, "p")[0].z, fall);
}

/// A sheet that is carried along by an edge, from one time to another.
fn carried(method: &str) -> Simulation {
    simulation(&format!(
        "precision = \"double\"\nworld.gravity = [0, 0, 0]\ntime = {{ fps = 50, frames = 100 }}\n[[system]]\n{method}\n[[collider]]\nname = \"hand\"\nfriction = 0\nshape.sphere = \
         {{ radius = 0.1, center = [0, 0, 5] }}\nmotion.velocity = [0, 0, 2]\n[[particles]]\nname = \"p\"\nposition = [[0.2, 0, 0], [0.7, 0, 0]]\nvelocity = [[0.5, 0, 0]]\n\
         pin = [{{ which = \"vertex 0\", from = 0.4, until = 1, follow.collider = \"hand\" }}]\n"
    ))
}

#[test]
fn what_is_taken_along_starts_where_it_was_and_leaves_with_the_velocity_of_its_carrier() {
    for method in [
        "integrator = \"symplectic_euler\"\nsubsteps = 10",
        "integrator = \"implicit_euler\"\nsubsteps = 10",
        "method = \"position_based\"\nsubsteps = 10",
    ] {
        let mut sim = carried(method);
        run(&mut sim, 35);
        let [held, free] = positions(&sim, "p")[..] else { panic!() };
        assert!((held - [0.4, 0.0, 2.0 * 0.3].into()).norm() < 1e-9, "{method}: {held:?}");
        assert!((free - [0.7 + 0.35, 0.0, 0.0].into()).norm() < 1e-9, "{method}: {free:?}");
        run(&mut sim, 40);
        let x = positions(&sim, "p")[0];
        assert!((x - [0.4, 0.0, 2.0 * 1.1].into()).norm() < 1e-9, "{method}: {x:?}");
    }
}

#[test]
fn a_restored_run_holds_what_the_whole_one_holds() {
    for method in
        ["integrator = \"verlet\"\nsubsteps = 10", "method = \"position_based\"\nsubsteps = 10", "integrator = \"rk4\"\nsubsteps = 10"]
    {
        for at in [10, 30, 60] {
            let mut whole = carried(method);
            run(&mut whole, at);
            let saved = whole.save(&[]);
            run(&mut whole, 80 - at);
            let mut again = carried(method);
            again.restore(&saved).unwrap();
            run(&mut again, 80 - at);
            assert_eq!(whole.hash(), again.hash(), "{method}, from frame {at}");
        }
    }
}

#[test]
fn a_rod_that_is_let_go_falls_as_a_whole() {
    for words in ["integrator = \"symplectic_euler\"\nsubsteps = 400", "method = \"position_based\"\nsubsteps = 40"] {
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime = {{ fps = 25, frames = 20 }}\n[[system]]\n{words}\n[[rope]]\nname = \"rod\"\nfrom = [0, 0, 0]\nto = [0.5, 0, 0]\nsegments = 10\n\
             density = 0.1\npin = [{{ which = \"start\", until = 0.2 }}, {{ which = \"end\", until = 0.2 }}]\nrod = {{ stretch = 500, bend = 0.05 }}\n"
        ));
        run(&mut sim, 5);
        let sag = positions(&sim, "rod")[5].z;
        assert!(sag < -1e-4 && sag > -0.01, "{words}: {sag}");
        let momentum = sim.ledger().momentum[2];
        run(&mut sim, 10);
        let books = sim.ledger();
        assert!((books.momentum[2] - momentum + books.mass * G * 0.4).abs() < 1e-9 * books.mass * G, "{words}: {:?}", books.momentum);
        // Free, its ends turn with it: they are clamped no more.
        let x = positions(&sim, "rod");
        assert!(x.iter().all(|x| x.z < -0.7), "{words}: {x:?}");
    }
}

#[test]
fn an_end_of_a_rod_is_clamped_while_it_is_held() {
    // A cantilever without gravity, loaded for a while by an acceleration; then free, and clamped again as it lies.
    for words in ["integrator = \"implicit_euler\"\nsubsteps = 10", "method = \"position_based\"\nsubsteps = 40"] {
        let tip = |pins: &str, frames: usize| {
            let mut sim = simulation(&format!(
                "precision = \"double\"\nworld.gravity = [0, 0, -1]\ntime = {{ fps = 25, frames = 100 }}\n[[system]]\n{words}\n[[rope]]\nname = \"rod\"\nfrom = [0, 0, 0]\n\
                 to = [0.5, 0, 0]\nsegments = 20\ndensity = 0.1\npin = [{pins}]\nrod = {{ stretch = 500, bend = 0.05, damping = 0.02 }}\n"
            ));
            run(&mut sim, frames);
            let x = positions(&sim, "rod");
            // Turn of the first segment and fall of the last point, from the first.
            [(x[1] - x[0]).z / (x[1] - x[0]).norm(), (x[20] - x[0]).z]
        };
        let always = tip("\"start\"", 50);
        let passing = tip("{ which = \"start\", until = 3 }", 50);
        assert!(always[1] < -0.01 && (passing[1] / always[1] - 1.0).abs() < 1e-3, "{words}: {always:?} {passing:?}");
        // Held on without a gap, it stays clamped as it was.
        let again = tip("{ which = \"start\", until = 0.5 }, { center = [0, 0, 0], radius = 0.001, from = 0.5 }", 50);
        assert_eq!(again, passing, "{words}");
    }
}

#[test]
fn what_is_held_for_ever_does_not_follow_for_some_time() {
    let mut sim = simulation(
        "precision = \"double\"\nworld.gravity = [0, 0, 0]\ntime = { fps = 50, frames = 100 }\n[[system]]\nsubsteps = 10\n[[collider]]\nname = \"hand\"\nshape.sphere = { radius = 0.1, \
         center = [0, 0, 5] }\nmotion.velocity = [0, 0, 2]\n[[particles]]\nname = \"p\"\nposition = [[0.2, 0, 0]]\npin = [\"all\", { which = \"all\", until = 1, follow.collider = \
         \"hand\" }]\n",
    );
    run(&mut sim, 100);
    assert_eq!(positions(&sim, "p"), [[0.2, 0.0, 0.0].into()]);
}

#[test]
fn sheets_that_are_let_go_touch_each_other() {
    // All of both is held at first; then the upper one falls onto the lower one, which is held at its rim.
    let mut sim = simulation(
        "time = { fps = 24, frames = 48 }\n[[system]]\nmethod = \"position_based\"\nsubsteps = 10\nself_contact.thickness = 0.02\n[[sheet]]\nname = \"low\"\nsize = [1, 1]\n\
         resolution = [12, 12]\npin = [\"edge x-\", \"edge x+\", \"edge y-\", \"edge y+\", { which = \"all\", until = 0.25 }]\n[[sheet]]\nname = \"high\"\nsize = [0.5, 0.5]\n\
         resolution = [7, 7]\ncenter = [0.01, 0.02, 0.2]\npin = [{ which = \"all\", until = 0.25 }]\n",
    );
    run(&mut sim, 48);
    let lowest = |name: &str| positions(&sim, name).iter().map(|x| x.z).fold(f64::INFINITY, f64::min);
    assert!(lowest("low") < -1e-3, "{}", lowest("low"));
    assert!(lowest("high") > lowest("low") - 0.02 && lowest("high") < 0.1, "{} {}", lowest("high"), lowest("low"));
}

#[test]
fn the_clamp_of_a_rod_that_broke_comes_back_with_its_state() {
    // Let go, then broken near its start, then taken back to a state in which it was whole and held.
    let scene = |until: f64| {
        simulation(&format!(
            "precision = \"double\"\nworld.gravity = [0, 0, -1]\ntime = {{ fps = 25, frames = 100 }}\n[[system]]\nmethod = \"position_based\"\nsubsteps = 20\n[[rope]]\nname = \"rod\"\n\
             from = [0, 0, 0]\nto = [0.5, 0, 0]\nsegments = 20\ndensity = 0.1\npin = [{{ which = \"start\", until = {until} }}]\nrod = {{ stretch = 500, bend = 0.05, damping = 0.02, break_strain \
             = 0.05 }}\n"
        ))
    };
    let snap = |sim: &mut Simulation| {
        let mut v = velocities(sim, "rod");
        v.iter_mut().take(2).for_each(|v| v.x = -400.0);
        write(sim, "rod", "velocity", &v);
        run(sim, 1);
        assert!(sim.ledger().broken.unwrap() > 0);
    };
    for broken_first in [false, true] {
        let (mut sim, mut whole) = (scene(0.4), scene(0.4));
        run(&mut sim, 5);
        let saved = sim.save(&[]);
        if broken_first {
            let mut v = velocities(&sim, "rod");
            v.iter_mut().skip(1).for_each(|v| v.x = 400.0);
            write(&mut sim, "rod", "velocity", &v);
            run(&mut sim, 1);
            assert!(sim.ledger().broken.unwrap() > 0);
            run(&mut sim, 8);
        } else {
            run(&mut sim, 8);
            snap(&mut sim);
        }
        sim.restore(&saved).unwrap();
        run(&mut sim, 10);
        run(&mut whole, 15);
        assert_eq!(sim.hash(), whole.hash(), "broken first: {broken_first}");
    }
}

#[test]
fn a_curved_rod_is_taken_hold_of_as_it_lies() {
    // It comes to rest along its natural curve, free, and keeps still when both of its ends are held there.
    for words in ["integrator = \"implicit_euler\"\nsubsteps = 4", "method = \"position_based\"\nsubsteps = 20"] {
        let mut sim = simulation(&format!(
            "precision = \"double\"\nworld.gravity = [0, 0, 0]\ntime = {{ fps = 24, frames = 200 }}\n[[system]]\n{words}\n[[rope]]\nname = \"rod\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\n\
             segments = 20\ndensity = 0.1\npin = [{{ which = \"start\", from = 6 }}, {{ which = \"end\", from = 6 }}]\nrod = {{ stretch = 500, bend = 0.05, damping = 0.05, curvature = [0, 2, \
             0] }}\n[[force]]\nkind = \"drag\"\nrate = 5\n"
        ));
        run(&mut sim, 143);
        let before = positions(&sim, "rod");
        assert!((before[20] - before[0]).norm() < 0.85, "{words}");
        run(&mut sim, 50);
        let moved = positions(&sim, "rod").iter().zip(&before).map(|(a, b)| (*a - *b).norm()).fold(0.0, f64::max);
        assert!(moved < 1e-4, "{words}: {moved}");
    }
}

#[test]
fn the_end_of_a_rod_that_is_let_go_is_clamped_no_more() {
    // Clamped at both ends, along its natural curve at neither: let go at once, it curls to an arc as if it had never been held.
    for words in ["integrator = \"implicit_euler\"\nsubsteps = 4", "method = \"position_based\"\nsubsteps = 20"] {
        let chord = |until: f64| {
            let mut sim = simulation(&format!(
                "precision = \"double\"\nworld.gravity = [0, 0, 0]\ntime = {{ fps = 24, frames = 200 }}\n[[system]]\n{words}\n[[rope]]\nname = \"rod\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\n\
                 segments = 20\ndensity = 0.1\npin = [{{ which = \"start\", until = {until} }}, {{ which = \"end\", until = {until} }}]\nrod = {{ stretch = 500, bend = 0.05, damping = 0.05, \
                 curvature = [0, 2, 0] }}\n[[force]]\nkind = \"drag\"\nrate = 5\n"
            ));
            run(&mut sim, 150);
            let x = positions(&sim, "rod");
            (x[20] - x[0]).norm()
        };
        // An arc of curvature 2 and length 1; between held ends it stays as long as the way.
        let (free, held) = (chord(0.5), chord(100.0));
        assert!((free / 1.0_f64.sin() - 1.0).abs() < 2e-3 && (held - 1.0).abs() < 1e-9, "{words}: {free} {held}");
        // Bent between clamps by its weight, it falls straight once they are gone.
        let turn = {
            let mut sim = simulation(&format!(
                "precision = \"double\"\nworld.gravity = [0, 0, -1]\ntime = {{ fps = 24, frames = 200 }}\n[[system]]\n{words}\n[[rope]]\nname = \"rod\"\nfrom = [0, 0, 0]\nto = [0.5, 0, 0]\n\
                 segments = 20\ndensity = 0.1\npin = [{{ which = \"start\", until = 0.5 }}, {{ which = \"end\", until = 0.5 }}]\nrod = {{ stretch = 500, bend = 0.05, damping = 0.05 }}\n[[force]]\nkind = \
                 \"drag\"\nrate = 5\n"
            ));
            run(&mut sim, 150);
            let x = positions(&sim, "rod");
            ((x[1] - x[0]).normalized() - (x[20] - x[19]).normalized()).norm()
        };
        assert!(turn < 1e-3, "{words}: {turn}");
    }
}

#[test]
fn what_is_let_go_keeps_its_momenta_like_any_free_body() {
    // A sheet on springs that swings about a held corner and is let go: from then on it spins as it does then.
    let mut sim = simulation(
        "precision = \"double\"\nworld.gravity = [0, 0, 0]\ntime = { fps = 24, frames = 96 }\n[[system]]\nmethod = \"position_based\"\nsubsteps = 10\n[[sheet]]\nname = \"s\"\nsize = [1, \
         1]\nresolution = [6, 6]\nvelocity = [0, 0, 1]\npin = [{ which = \"edge x-\", until = 0.5 }]\n",
    );
    run(&mut sim, 13);
    let start = sim.ledger();
    run(&mut sim, 60);
    let books = sim.ledger();
    let [before, after] = [&start, &books].map(|books| (books.momentum, books.angular_momentum.unwrap()));
    assert!(before.1[1].abs() > 1e-3, "{before:?}");
    for c in 0..3 {
        assert!((after.0[c] - before.0[c]).abs() < 1e-11 && (after.1[c] - before.1[c]).abs() < 1e-11, "{before:?} {after:?}");
    }
}

#[test]
fn times_that_mean_nothing_are_told() {
    let wrong = |times: &str| {
        let text = format!("version = 1\n[[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\npin = [{{ which = \"all\", {times} }}]\n");
        let scene = tumble_interface::Scene::from_toml(&text).and_then(|scene| Simulation::new(scene, Default::default()).map(|_| ()));
        scene.unwrap_err().to_string()
    };
    assert!(wrong("from = 2, until = 1").contains("expected an end after the start"), "{}", wrong("from = 2, until = 1"));
    assert!(wrong("until = 0").contains("pin"), "{}", wrong("until = 0"));
    assert!(wrong("from = -1").contains("pin"), "{}", wrong("from = -1"));
}
