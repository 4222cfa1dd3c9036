//! Birth, life and death of particles: exact counts, exact moments, exact places.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::*;
use std::collections::HashSet;
use tumble_f64::scene::Simulation;
use tumble_interface::scene::Integrator;
use tumble_interface::{Data, Engine, Scene, StepError};

const RATE: &str = "time.fps = 24\n[[system]]\nintegrator = \"SCHEME\"\nsubsteps = 3\n";

fn scheme(name: &str) -> String {
    RATE.replace("SCHEME", name)
}

/// Ids of the living.
pub fn ids(sim: &Simulation, object: &str) -> Vec<u32> {
    match &sim.frame(&["position"]).column(object, "id").unwrap().data {
        Data::U32(ids) => ids.clone(),
        other => panic!("{other:?}"),
    }
}

/// A column of numbers.
pub fn numbers(sim: &Simulation, object: &str, name: &str) -> Vec<f64> {
    match &sim.frame(&["position"]).column(object, name).unwrap_or_else(|| panic!("no {name}")).data {
        Data::F64(numbers) => numbers.clone(),
        other => panic!("{other:?}"),
    }
}

/// Position, velocity and age by id.
pub fn by_id(sim: &Simulation, object: &str) -> Vec<(u32, Vector, Vector, f64)> {
    let (x, v, age) = (positions(sim, object), velocities(sim, object), numbers(sim, object, "age"));
    let mut all: Vec<_> = ids(sim, object).into_iter().enumerate().map(|(i, id)| (id, x[i], v[i], age[i])).collect();
    all.sort_by_key(|p| p.0);
    all
}

#[test]
fn as_many_are_born_as_the_rate_says() {
    for rate in [0.5, 24.0, 100.7, 240.0, 31_415.9] {
        for jitter in [0.0, 1.0] {
            let text = format!("{}[[emitter]]\nname = \"p\"\nrate = {rate}\njitter = {jitter}\nfrom.point = {{}}\n", scheme("midpoint"));
            let mut sim = simulation(&text);
            for frame in 1..=50 {
                step(&mut sim);
                let born = ids(&sim, "p");
                // A count that is a whole number up to rounding counts in full.
                let expected = (rate * f64::from(frame) / 24.0 + 1e-6).floor();
                assert_eq!(born.len() as f64, expected, "rate {rate}, frame {frame}");
                assert_eq!(born.iter().collect::<HashSet<_>>().len(), born.len());
                assert!(born.iter().all(|id| f64::from(*id) < expected));
            }
        }
    }
}

#[test]
fn a_window_and_bursts_add_up() {
    let text = format!(
        "{}[[emitter]]\nname = \"p\"\nrate = 100\nstart = 0.31\nend = 0.9\nburst = [{{ count = 7 }}, {{ time = 0.5, count = 11 }}]\nfrom.point = {{}}\n",
        scheme("verlet")
    );
    let mut sim = simulation(&text);
    assert_eq!(ids(&sim, "p").len(), 7, "a burst at the start is there at the start");
    for frame in 1..=30 {
        step(&mut sim);
        let t = f64::from(frame) / 24.0;
        let rate = (100.0 * (t.min(0.9) - 0.31).max(0.0) + 1e-6).floor() as usize;
        assert_eq!(ids(&sim, "p").len(), 7 + rate + if t >= 0.5 - 1e-9 { 11 } else { 0 }, "{frame}");
    }
    assert_eq!(ids(&sim, "p").len(), 7 + 59 + 11);
}

#[test]
fn a_steady_source_holds_rate_times_lifetime() {
    let text = format!("{}[[emitter]]\nname = \"p\"\nrate = 1200\nlifetime = 0.5\nfrom.point = {{}}\n", scheme("verlet"));
    let mut sim = simulation(&text);
    for frame in 1..=60 {
        step(&mut sim);
        assert_eq!(ids(&sim, "p").len(), 50 * frame.min(12), "{frame}");
        let newest = 50 * frame as u32;
        // Those that died are the oldest, and only they.
        assert!(ids(&sim, "p").iter().all(|id| *id < newest && *id >= newest.saturating_sub(600)));
    }
    // With a spread of lifetimes the mean is the same: Poisson's scatter of 600 is 24; 4 of them.
    let mut sim = simulation(&text.replace("lifetime = 0.5", "lifetime = 0.5\nlifetime_spread = 0.8"));
    run(&mut sim, 60);
    let count = ids(&sim, "p").len() as f64;
    assert!((count - 600.0).abs() < 100.0, "{count}");
    let ages = numbers(&sim, "p", "age");
    assert!(ages.iter().any(|a| *a > 0.7) && ages.iter().all(|a| *a < 0.9));
}

/// Born at any moment within a sub-step, under gravity a particle is on its parabola: the midpoint step that brings it to the
/// end of the sub-step is exact there, and so are the schemes of order 2 after it.
#[test]
fn particles_born_between_frames_are_on_their_parabola() {
    for name in ["verlet", "velocity_verlet", "midpoint", "heun", "rk4", "dormand_prince", "implicit_midpoint"] {
        for jitter in ["0", "1"] {
            let text = format!(
                "{}[[emitter]]\nname = \"p\"\nrate = 1003\njitter = {jitter}\nvelocity = [1, 0, 5]\nfrom.point.at = [0.5, 0, 0]\n",
                scheme(name).replace("substeps = 3\n", if name == "dormand_prince" { "" } else { "substeps = 3\n" })
            );
            let mut sim = simulation(&text);
            run(&mut sim, 10);
            let mut worst = 0.0_f64;
            for (_, x, v, age) in by_id(&sim, "p") {
                let exact = vector(0.5 + age, 0.0, 5.0 * age - 4.9 * age * age);
                worst = worst.max((x - exact).norm()).max((v - vector(1.0, 0.0, 5.0 - 9.8 * age)).norm());
            }
            // Measured: at most 4e-14; implicit midpoint 1e-10 (Newton's tolerance).
            assert!(worst < if name == "implicit_midpoint" { 1e-8 } else { 1e-12 }, "{name}: {worst:e}");
        }
    }
}

/// With drag the first partial step has an error of its own, of order 3; the whole stays of order 2.
#[test]
fn the_first_step_of_a_life_keeps_the_order() {
    let error = |substeps: usize| {
        let text = format!(
            "time.fps = 10\n[[system]]\nintegrator = \"midpoint\"\nsubsteps = {substeps}\n[[force]]\nkind = \"drag\"\nrate = 2\n\
             [[emitter]]\nname = \"p\"\nrate = 173\nvelocity = [0, 0, 8]\nfrom.point = {{}}\n"
        );
        let mut sim = simulation(&text);
        run(&mut sim, 5);
        let exact = |t: f64| (8.0 + 4.9) / 2.0 * (1.0 - (-2.0 * t).exp()) - 4.9 * t;
        by_id(&sim, "p").iter().map(|(_, x, _, age)| (x.z - exact(*age)).abs()).fold(0.0, f64::max)
    };
    let errors: Vec<f64> = [4, 8, 16, 32].map(error).into();
    let orders = orders(&errors);
    println!("errors {} orders {}", show(&errors), show(&orders));
    assert!(orders.iter().all(|o| (o - 2.0).abs() < 0.2), "{orders:?}");
}

/// A spring elsewhere in the system makes the engine step all masses together, sub-step by sub-step; without it they go block by
/// block through the interval. The particles do not notice.
#[test]
fn both_ways_of_stepping_agree() {
    let source = "[[force]]\nkind = \"drag\"\nrate = 0.5\n[[emitter]]\nname = \"p\"\nrate = 2007\njitter = 0.5\nspeed = 4\ncone = 30\nspeed_spread = 0.3\nlifetime = 0.4\n\
                  lifetime_spread = 0.5\nfrom.sphere.radius = 0.1\n[[collider]]\nname = \"floor\"\nrestitution = 0.4\nfriction = 0.2\nshape.floor.height = -0.2\n";
    let spring = "[[particles]]\nname = \"pair\"\nposition = [[5, 0, 0], [6, 0, 0]]\nspring = [{ between = [0, 1], stiffness = 10 }]\n";
    for name in ["symplectic_euler", "verlet", "velocity_verlet", "rk4"] {
        let mut alone = simulation(&format!("{}{source}", scheme(name)));
        let mut beside = simulation(&format!("{}{source}{spring}", scheme(name)));
        run(&mut alone, 20);
        run(&mut beside, 20);
        let (a, b) = (by_id(&alone, "p"), by_id(&beside, "p"));
        assert!(a.len() > 500);
        assert_eq!(a.len(), b.len(), "{name}");
        let far = a.iter().zip(&b).map(|(a, b)| if a.0 == b.0 { (a.1 - b.1).norm() } else { f64::INFINITY }).fold(0.0, f64::max);
        // The Verlets start anew when someone is born, in one case after a sub-step and in the other after an interval, and guess their
        // first velocities under drag anew. Measured: 0, and 9e-7 for both.
        assert!(far < if name.ends_with("verlet") { 1e-5 } else { 1e-12 }, "{name}: {far:e}");
    }
}

#[test]
fn children_are_born_where_and_when_their_parents_die() {
    // Straight ways at constant speed: a parent born at b dies at b + 0.33 at x = 0.33 speed.
    let text = format!(
        "world.gravity = [0, 0, 0]\n{}[[emitter]]\nname = \"rocket\"\nrate = 50\nvelocity = [2, 0, 0]\nlifetime = 0.33\nfrom.point = {{}}\n\
         [[emitter]]\nname = \"spark\"\nburst = [{{ count = 4 }}]\nvelocity = [0, 3, 0]\ninherit = 0.5\nfrom.particles.of = \"rocket\"\n\
         [[emitter]]\nname = \"smoke\"\nrate = 200\nfrom.particles.of = \"rocket\"\n",
        scheme("verlet")
    );
    let mut sim = simulation(&text);
    run(&mut sim, 24);
    let sparks = by_id(&sim, "spark");
    // Born at k/50 for k = 1..50; those up to k/50 + 0.33 = 1 have died: 33.
    assert_eq!(sparks.len(), 4 * 33);
    for (id, x, v, age) in &sparks {
        let death = f64::from(id / 4 + 1) / 50.0 + 0.33;
        assert!((age - (1.0 - death)).abs() < 1e-12, "{id}: {age}");
        // Half of the parent's 2 m/s, and 3 m/s of its own.
        let exact = vector(0.66 + age, 3.0 * age, 0.0);
        assert!((*x - exact).norm() < 1e-12 && (*v - vector(1.0, 3.0, 0.0)).norm() < 1e-12, "{id}: {x:?}");
    }
    // Smoke stays where it was left: child k of a parent at its age k/200, at x = 2 k/200, 66 of them a life.
    let smoke = by_id(&sim, "smoke");
    let left: HashSet<i64> = smoke.iter().map(|(_, x, ..)| (x.x * 100.0).round() as i64).collect();
    assert!(smoke.iter().all(|(_, x, ..)| ((x.x * 100.0).round() / 100.0 - x.x).abs() < 1e-12));
    assert_eq!(left, (1..=66).collect());
}

#[test]
fn a_full_pool_waits_or_replaces_or_fails() {
    let text = |full: &str| {
        format!(
            "{}[[emitter]]\nname = \"p\"\nrate = 240\nlifetime = 10\nmost = 33\nwhen_full = \"{full}\"\nfrom.point = {{}}\n",
            scheme("verlet")
        )
    };
    let mut wait = simulation(&text("wait"));
    let mut replace = simulation(&text("replace_oldest"));
    run(&mut wait, 10);
    run(&mut replace, 10);
    let sorted = |sim: &Simulation| {
        let mut ids = ids(sim, "p");
        ids.sort_unstable();
        ids
    };
    assert_eq!(sorted(&wait), (0..33).collect::<Vec<u32>>());
    assert_eq!(sorted(&replace), (67..100).collect::<Vec<u32>>());
    let mut fails = simulation(&text("error"));
    run(&mut fails, 3);
    let before = fails.hash();
    let error = fails.step(&|| true).unwrap_err();
    assert!(matches!(&error, StepError::Capacity { .. }), "{error}");
    assert!(error.to_string().contains("emitter \"p\" is full: 33 particles live; raise most"), "{error}");
    assert_eq!(fails.hash(), before, "the state is that of the last good frame");
}

#[test]
fn every_rule_kills() {
    let survivors = |rule: &str| {
        let text = format!(
            "world.gravity = [0, 0, 0]\n{}[[emitter]]\nname = \"p\"\nburst = [{{ count = 200 }}]\nspeed = 1\nspeed_spread = 1\ncone = 180\nkill = [{rule}]\nfrom.point = {{}}\n\
             [[collider]]\nname = \"wall\"\nshape.plane = {{ point = [2, 0, 0], normal = [-1, 0, 0] }}\n",
            scheme("verlet")
        );
        let mut sim = simulation(&text);
        run(&mut sim, 24);
        by_id(&sim, "p")
    };
    let all = survivors("");
    assert_eq!(all.len(), 200);
    // After 1 s everyone is as far out as it is fast.
    let check = |rule: &str, lives: &dyn Fn(Vector, f64) -> bool| {
        let left: Vec<u32> = survivors(rule).iter().map(|p| p.0).collect();
        let expected: Vec<u32> = all.iter().filter(|p| lives(p.1, p.2.norm())).map(|p| p.0).collect();
        assert!(!expected.is_empty() && expected.len() < 200, "{rule} tells nothing");
        assert_eq!(left, expected, "{rule}");
    };
    check("{ outside.sphere.radius = 0.7 }", &|x, _| x.norm() <= 0.7);
    check("{ inside.floor.height = -0.3 }", &|x, _| x.z >= -0.3);
    check("{ slower_than = 0.5 }", &|_, v| v >= 0.5);
    check("{ faster_than = 0.5 }, { slower_than = 0.2 }", &|_, v| (0.2..=0.5).contains(&v));
    check("{ near_collider = 1.5 }", &|x, _| x.x <= 0.5);
}

/// Half the directions of a cone of half-angle 60 degrees lie within the angle whose cosine is 0.75; speeds are even between
/// their bounds; a column of one's own is even between its bounds, and stays with its particle.
#[test]
fn what_particles_are_born_with_is_spread_evenly() {
    let text = format!(
        "world.gravity = [0, 0, 0]\nseed = 5\n{}[[emitter]]\nname = \"p\"\nrate = 24000\nspeed = 2\nspeed_spread = 0.5\ncone = 60\ndirection = [1, 0, 0]\nmass = 2\nmass_spread = 0.5\n\
         radius = 0.1\nradius_spread = 0.2\ncolor = [1, 0, 0]\ncolor_to = [0, 1, 0]\ncolumns = {{ heat = {{ from = 300, to = 400 }} }}\nfrom.point = {{}}\n",
        scheme("verlet")
    );
    let mut sim = simulation(&text);
    run(&mut sim, 10);
    let v = velocities(&sim, "p");
    let n = v.len() as f64;
    assert_eq!(v.len(), 10_000);
    // Means of 10,000 even numbers scatter by 0.29 %% of their range; 4 of it.
    let mean = |values: Vec<f64>, low: f64, high: f64| {
        assert!(values.iter().all(|x| *x >= low - 1e-9 && *x <= high + 1e-9));
        let mean = values.iter().sum::<f64>() / n;
        assert!((mean - (low + high) / 2.0).abs() < 0.012 * (high - low), "{mean}");
    };
    mean(v.iter().map(|v| v.norm()).collect(), 1.0, 3.0);
    mean(v.iter().map(|v| v.x / v.norm()).collect(), 0.5, 1.0);
    mean(numbers(&sim, "p", "mass"), 1.0, 3.0);
    mean(numbers(&sim, "p", "radius"), 0.08, 0.12);
    mean(numbers(&sim, "p", "heat"), 300.0, 400.0);
    mean(column(&sim, "p", "color").iter().map(|c| c.y).collect(), 0.0, 1.0);
    let heat = |sim: &Simulation| -> Vec<(u32, u64)> {
        let mut all: Vec<(u32, u64)> = ids(sim, "p").into_iter().zip(numbers(sim, "p", "heat").iter().map(|h| h.to_bits())).collect();
        all.sort_unstable();
        all
    };
    let before = heat(&sim);
    run(&mut sim, 3);
    assert_eq!(heat(&sim)[..10_000], before[..]);
}

/// Simpson's rule is exact for a rate that grows linearly: 50 t² particles by the time t.
#[test]
fn a_rate_that_changes_is_integrated() {
    let text = format!("{}[[emitter]]\nname = \"p\"\nrate = \"100*t\"\nfrom.point = {{}}\n", scheme("verlet"));
    let mut sim = simulation(&text);
    for frame in 1..=48 {
        step(&mut sim);
        let t = f64::from(frame) / 24.0;
        assert_eq!(ids(&sim, "p").len() as f64, (50.0 * t * t + 1e-6).floor(), "{frame}");
    }
}

/// From a source on a circle at constant speed, with all of its velocity: particles leave along tangents.
#[test]
fn a_moving_source_gives_place_and_velocity() {
    let text = format!(
        "world.gravity = [0, 0, 0]\n{}[[emitter]]\nname = \"p\"\nrate = 317\njitter = 1\ninherit = 1\npath = \"[2*cos(3*t), 2*sin(3*t), 0]\"\nvelocity = [0, 0, \"2*t\"]\nfrom.point.at = [0, 0, 1]\n",
        scheme("verlet")
    );
    let mut sim = simulation(&text);
    run(&mut sim, 24);
    let all = by_id(&sim, "p");
    assert_eq!(all.len(), 317);
    for (_, x, v, age) in all {
        let birth = 1.0 - age;
        let (s, c) = (3.0 * birth).sin_cos();
        let velocity = vector(-6.0 * s, 6.0 * c, 2.0 * birth);
        let place = vector(2.0 * c, 2.0 * s, 1.0) + velocity * age;
        // Central differences of 1e-4 s are off by 6 w³ 1e-8/6: 9e-8 m/s.
        assert!((v - velocity).norm() < 2e-7 && (x - place).norm() < 2e-7, "{x:?} {place:?} {v:?} {velocity:?}");
    }
}

/// Tracers are born, carried and die as masses are: in a swirl they go round their circles, whenever they were born.
#[test]
fn a_flow_carries_what_is_born_in_it() {
    for name in ["midpoint", "rk4", "dormand_prince", "implicit_midpoint"] {
        let substeps = if name == "dormand_prince" { "adaptive.tolerance = 1e-8" } else { "substeps = 20" };
        let text = format!(
            "[[system]]\nmethod = \"tracers\"\nintegrator = \"{name}\"\n{substeps}\n[[field]]\nkind = \"swirl\"\nrate = 4\n\
             [[emitter]]\nname = \"p\"\nrate = 500\njitter = 0.5\nlifetime = 0.5\nfrom.point.at = [1, 0, 0]\n\
             [[emitter]]\nname = \"q\"\nburst = [{{ count = 2 }}]\nfrom.particles.of = \"p\"\n"
        );
        let mut sim = simulation(&text);
        run(&mut sim, 24);
        let (p, q) = (by_id(&sim, "p"), by_id(&sim, "q"));
        assert_eq!((p.len(), q.len()), (250, 500));
        let off = |x: Vector, t: f64| (x - vector((4.0 * t).cos(), (4.0 * t).sin(), 0.0)).norm();
        // The first step is off by (w h)^5/120 = 1e-6 over 1/24 s, and the scheme is: midpoint's 240 steps of (w h)³/6; the place of
        // death goes back along the tangent, (w h)²/2 over an exchange interval of 1/24 s at most.
        let worst = p.iter().map(|(_, x, _, age)| off(*x, *age)).fold(0.0, f64::max);
        assert!(worst < if name.contains("midpoint") { 3e-5 } else { 2e-6 }, "{name}: {worst:e}");
        let worst = q.iter().map(|(_, x, _, age)| off(*x, age + 0.5)).fold(0.0, f64::max);
        assert!(worst > 0.0 && worst < (4.0_f64 / 24.0).powi(2) / 2.0, "{name}: {worst:e}");
    }
}

/// Drag of 200/s in an exchange interval of 1/24 s: children, and the newborn of an implicit scheme, are slowed down and not thrown.
#[test]
fn strong_drag_throws_no_newborn() {
    for name in ["verlet", "implicit_euler"] {
        let steps = if name == "verlet" { "substeps = 20" } else { "substeps = 1" };
        let text = format!(
            "world.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"{name}\"\n{steps}\n[[force]]\nkind = \"drag\"\nrate = 200\n\
             [[emitter]]\nname = \"p\"\nrate = 48\nvelocity = [5, 0, 0]\nlifetime = 0.11\nfrom.point = {{}}\n\
             [[emitter]]\nname = \"q\"\nrate = 100\nburst = [{{ count = 1 }}]\nvelocity = [0, 5, 0]\nfrom.particles.of = \"p\"\n"
        );
        let mut sim = simulation(&text);
        run(&mut sim, 12);
        let (p, q) = (by_id(&sim, "p"), by_id(&sim, "q"));
        assert!(p.len() >= 4 && q.len() > 20);
        // All go 5/200 = 25 mm in all; the midpoint rule is off by 10 % of that with half the rate a piece.
        assert!(p.iter().all(|(_, x, v, _)| x.norm() < 0.03 && v.norm() <= 5.0), "{name}: {p:?}");
        assert!(q.iter().all(|(_, x, v, _)| (x.y - 0.025 * (1.0 - v.y / 5.0)).abs() < 0.004 && v.norm() <= 5.0), "{name}");
    }
}

/// Three generations: grandchildren are born of children that were born in the same interval, too.
#[test]
fn grandchildren_are_counted() {
    let text = format!(
        "world.gravity = [0, 0, 0]\n{}[[emitter]]\nname = \"a\"\nrate = 10\nlifetime = 0.5\nfrom.point = {{}}\n\
         [[emitter]]\nname = \"b\"\nrate = 20\nlifetime = 0.25\nfrom.particles.of = \"a\"\n\
         [[emitter]]\nname = \"c\"\nrate = 40\nfrom.particles.of = \"b\"\n",
        scheme("verlet")
    );
    let mut sim = simulation(&text);
    run(&mut sim, 48);
    // a: born at k/10; b: at k/10 + j/20, j = 1..10; c: at k/10 + j/20 + i/40, i = 1..10; up to 2 s.
    let mut expected = 0;
    for k in 1..=20 {
        for j in 1..=10 {
            expected += (1..=10).filter(|i| 4 * k + 2 * j + i <= 80).count();
        }
    }
    let mut ids = ids(&sim, "c");
    assert_eq!(ids.len(), expected);
    ids.sort_unstable();
    assert!(ids.iter().enumerate().all(|(i, id)| i as u32 == *id));
}

/// The guard against explosions is awake beside an emitter, and does not take births for one.
#[test]
fn explosions_are_seen_beside_an_emitter() {
    let text = "[[system]]\nintegrator = \"midpoint\"\nsubsteps = 8\n\
                [[rope]]\nname = \"r\"\nfrom = [0, 0, 1]\nto = [1, 0, 1]\nsegments = 6\npin = [\"start\"]\nlinks = { structural = 50 }\n\
                [[emitter]]\nname = \"e\"\nrate = 1\nfrom.point = {}\n";
    let mut sim = simulation(text);
    let failed = (0..20).find_map(|_| sim.step(&|| true).err());
    assert!(matches!(&failed, Some(StepError::Exploded(b)) if b.object == "r" && b.time < 0.7), "{failed:?}");
    let text = "[[emitter]]\nname = \"one\"\nburst = [{ count = 1 }]\nfrom.point = {}\n\
                [[emitter]]\nname = \"many\"\nburst = [{ time = 1, count = 5000 }]\nspeed = 50\ncone = 180\nlifetime = 0.5\nfrom.point = {}\n";
    let mut sim = simulation(text);
    run(&mut sim, 60);
}

/// A force that is not finite ends the run under implicit schemes, too, with the name of the mass.
#[test]
fn forces_that_are_no_numbers_end_every_scheme() {
    for name in ["rk4", "implicit_euler", "implicit_midpoint", "bdf2"] {
        let text = format!(
            "world.gravity = [0, 0, 0]\n{}[[particles]]\nname = \"p\"\nposition = [[1, 0, 0], [0, 0, 0]]\n[[force]]\nkind = \"acceleration\"\nvalue = [\"sqrt(x - 0.5)\", 1, 0]\n",
            scheme(name)
        );
        let error = simulation(&text).step(&|| true).unwrap_err();
        assert!(matches!(&error, StepError::NotFinite(b) if b.object == "p" && b.index == 1), "{name}: {error}");
    }
}

#[test]
fn emitters_that_cannot_work_are_refused() {
    let refused = |words: &str| {
        let text = format!("version = 1\n[[emitter]]\nname = \"p\"\n{words}\n");
        let scene = match Scene::from_toml(&text) {
            Ok(scene) => scene,
            Err(error) => return error.to_string(),
        };
        match Simulation::new(scene, Default::default()) {
            Ok(_) => panic!("{words} was taken"),
            Err(error) => error.to_string(),
        }
    };
    for (words, told) in [
        ("rate = 1\nlifetime = -1\nfrom.point = {}", "lifetime: -1"),
        ("from.point = {}", "emitter \"p\": it makes no particles"),
        ("rate = 1e11\nfrom.point = {}", "GiB, the limit is 8 GiB; lower a resolution, a rate or a lifetime"),
        ("rate = 1\nfrom.particles.of = \"q\"", "emitter \"p\".from.particles.of: \"q\" is no emitter of the same system"),
        (
            "rate = 1\nfrom.particles.of = \"p\"",
            "emitter \"p\".from.particles.of: \"p\" is no emitter of the same system that stands before",
        ),
        ("rate = 1\nfrom.curve.points = [[0, 0, 0], [0, 0, 0]]", "from.curve.points: they are all in one place"),
        ("rate = 1\nfrom.disk = { radius = 1, normal = [0, 0, 0] }", "from.disk.normal: [0, 0, 0], expected a direction"),
        ("rate = 1\nfrom.mesh_surface.path = \"x.obj\"", "from.mesh_surface: the mesh has not been loaded"),
        ("rate = 1\nfrom.point = {}\ncolor_end = [0, 0, 0]", "color_to and color_end need a color"),
        (
            "rate = 1\nfrom.point = {}\ncolumns = { id = { from = 1 } }",
            "columns.id: expected a name of letters, digits and _ that is none of position",
        ),
        ("rate = 1\nfrom.point = {}\ncolumns = { a = { from = 1, to = 0 } }", "columns.a.to: 0, expected >= 1"),
        ("rate = 1\nfrom.point = {}\nwhen_full = \"error\"", "when_full: it never is full; set most"),
        ("rate = \"1/(t - t)\"\nfrom.point = {}", "rate: "),
        ("rate = -1\nfrom.point = {}", "rate: -1, expected >= 0"),
        ("rate = 1e12\nlifetime = 1e-9\nfrom.point = {}", "GiB, the limit is 8 GiB"),
        ("rate = 1\nfrom.point = {}\ncolumns = { x = { from = 1 } }", "columns.x: expected a name of letters"),
        (
            "burst = [{ time = 1, count = 1 }]\nfrom.particles.of = \"p\"",
            "burst[0].time: children are born when the parent dies or bounces",
        ),
        ("rate = 1\nfrom.point = {}\nlifetime_spread = 0.5", "lifetime_spread: 0.5, but there is no lifetime to spread; set lifetime"),
        ("rate = 1\nfrom.point = {}\ncolumns = { h = 5 }", "columns.h: 5, expected a table { from = ... }"),
        (
            "rate = 1\nfrom.point = {}\nkill = \"floor\"",
            "kill: \"floor\", expected a list, each a table with one of the keys inside, outside, ",
        ),
        ("rate = 1\nfrom.point = {}\nkill = [\"floor\"]", "kill[0]: \"floor\", expected a table with one of the keys inside, outside, "),
        (
            "rate = 1\nfrom.point = {}\n[[force]]\nkind = \"flock\"\nradius = 1\ngoal = [3]",
            "goal[0]: 3, expected a table { point = ..., strength = ... }",
        ),
        (
            "rate = 1\nfrom.point = {}\n[[emitter]]\nname = \"q\"\nburst = [{ count = 1 }]\nfrom.particles = { of = \"p\", cause = [\"lifetime\"] }",
            "emitter \"q\".from.particles.cause[0]: nothing of \"p\" dies of that",
        ),
        (
            "burst = [{ count = 1 }]\nfrom.particles = { of = \"p\", at = \"bounce\", cause = [\"lifetime\"] }",
            "from.particles.cause: a bounce is no death; leave it out",
        ),
        ("rate = 1\nfrom.particles = { of = \"p\", at = \"bounce\" }", "burst: missing: at and cause say when a burst is born"),
        ("rate = \"1 + sin\"\nfrom.point = {}", "rate: \"1 + sin\": \"sin\" is a function; write sin(...)"),
        ("rate = -1e300\nfrom.point = {}", "rate: -1e300, expected >= 0"),
        ("rate.keys = [[0, 1], [0.02, -5], [0.03, 1]]\nfrom.point = {}", "rate: -5 at t = 0.02 s, expected >= 0"),
        ("rate = 1\nvelocity = [1e300, 0, 0]\nfrom.point = {}", "velocity: [1e300, 0, 0], expected a length below 1e154"),
        ("rate = 1\nfrom.point = {}\ncolumns = { a = { from = 2e200, to = 1e200 } }", "columns.a.to: 1e200, expected >= 2e200"),
        (
            "rate = 1\nfrom.point = {}\n[[particles]]\nname = \"q\"\nposition = [[0, 0, 0]]\n[[anchor]]\nname = \"a\"\nstiffness = 1\nbetween = [\"q 0\", \"p 0\"]",
            "between[1]: the particles of emitter \"p\" come and go; an anchor needs a mass that stays",
        ),
    ] {
        let message = refused(words);
        assert!(message.contains(told), "{words}: {message}");
    }
}

/// In two dimensions nothing is put onto the plane in silence.
#[test]
fn emitters_keep_to_the_plane() {
    let scene = |words: &str, more: &str| {
        let text = format!("version = 1\ndimension = 2\n[[emitter]]\nname = \"p\"\nrate = 1\n{words}\n{more}");
        Simulation::new(Scene::from_toml(&text).unwrap_or_else(|e| panic!("{e}\n{text}")), Default::default())
    };
    for words in [
        "from.point.at = [1, 0, 2]\nvelocity = [1, 0, \"t\"]",
        "from.disk = { radius = 1, normal = [0, 1, 0] }",
        "from.disk = { radius = 1 }\nspeed = 1",
        "from.disk = { radius = 1, normal = [0, 1, 0] }\nspeed = 1\ndirection = [1, 0, 0]",
        "from.box = { size = [1, 0, 1], rotate = [0, 30, 0] }",
        "from.sphere.radius = 1",
    ] {
        assert!(scene(words, "").is_ok(), "{words}");
    }
    for (words, told) in [
        ("from.point.at = [0, 1, 0]", "emitter \"p\".from.point.at: y = 1, expected 0 in a scene of dimension 2"),
        ("from.curve.points = [[0, 0, 0], [1, 1e30, 0]]", "from.curve.points[1]: y = 1e30, expected 0"),
        ("from.disk = { radius = 1, normal = [1, 2, 0] }", "from.disk.normal: y = 2, expected 0"),
        ("from.disk = { radius = 1, normal = [0, 1, 0] }\nspeed = 1", "direction: missing: the normal of the disk points out of the plane"),
        ("from.box.size = [1, 1, 1]", "from.box.size: y = 1, expected 0"),
        ("from.box = { size = [1, 0, 1], rotate = [30, 0, 0] }", "from.box.rotate: [30.0, 0.0, 0.0], expected a turn about y"),
        ("from.point = {}\nvelocity = [0, \"t - 1\", 0]", "velocity: y = -1, expected 0"),
        ("from.point = {}\npath.keys = [[0, 0, 0, 0], [1, 0, 1, 0]]", "path: y = "),
        ("from.point = {}\nspeed = 1\ndirection = [0, 1, 0]", "direction: y = 1, expected 0"),
        ("from.mesh_surface.path = \"x.obj\"", "from: a mesh does not fit into a plane"),
    ] {
        let message = scene(words, "").err().unwrap_or_else(|| panic!("{words} was taken")).to_string();
        assert!(message.contains(told), "{words}: {message}");
    }
    let goal =
        "[[force]]\nkind = \"flock\"\nradius = 1\ngoal = [{ point = [0, 0, 1], strength = 1 }, { point = [0, 3, 1], strength = 1 }]\n";
    let message = scene("from.point = {}", goal).err().unwrap().to_string();
    assert!(message.contains("force[0].goal[1].point: y = 3, expected 0"), "{message}");
}

/// Objects that start in a solid give a warning with both names; pinned masses and mere contact do not.
#[test]
fn what_starts_inside_a_collider_is_told() {
    let warnings = |things: &str| {
        let ball = "[[collider]]\nname = \"ball\"\nthickness = 0.05\nshape.sphere = { center = [3, 0, 0], radius = 1 }\n";
        simulation(&format!("{things}\n{ball}")).warnings().iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let told = |name: &str, when: &str, deep: &str| {
        vec![format!(
            "\"{name}\": masses start{when} up to {deep} m inside collider \"ball\", and will be thrown out of it; move one of them"
        )]
    };
    let particles = "[[particles]]\nname = \"q\"\nposition = [[0, 0, 0], [2.25, 0, 0]]\n";
    assert_eq!(warnings(particles), told("q", "", "0.25"));
    assert!(warnings(&format!("{particles}pin = [\"vertex 1\"]")).is_empty());
    let emitter = |words: &str| format!("[[emitter]]\nname = \"p\"\n{words}");
    assert!(warnings(&emitter("rate = 9\nfrom.point = {}")).is_empty());
    assert_eq!(warnings(&emitter("rate = 9\nfrom.point.at = [3, 0, 0.5]")), told("p", "", "0.5"));
    // On the surface, outward.
    assert!(warnings(&emitter("rate = 9\nfrom.sphere = { center = [3, 0, 0], radius = 1, surface = true }")).is_empty());
    // A burst where the path has led: at t = 2 s, 0.6 m deep.
    let burst = "burst = [{ time = 2, count = 3 }]\npath.keys = [[0, 0, 0, 0], [2, 2.6, 0, 0]]\nfrom.point = {}";
    assert_eq!(warnings(&emitter(burst)), told("p", " at t = 2 s", "0.6"));
    // A rate along the same path ends before it is there, or not.
    let along = |end: f64| emitter(&format!("rate = 100\nend = {end}\npath.keys = [[0, 0, 0, 0], [2, 2.6, 0, 0]]\nfrom.point = {{}}"));
    assert!(warnings(&along(1.5)).is_empty());
    assert_eq!(warnings(&along(2.5)).len(), 1);
}

#[test]
fn colliders_that_are_missing_are_told() {
    let warnings = |text: &str| simulation(text).warnings().iter().map(ToString::to_string).collect::<Vec<_>>();
    let emitter = "[[emitter]]\nname = \"p\"\nrate = 9\nkill = [{ slower_than = 1 }, { near_collider = 0.1 }]\nfrom.point = {}\n";
    assert_eq!(warnings(emitter), ["emitter \"p\".kill[1]: near_collider, but there is no collider; add one, or leave it out"]);
    let flock = "[[particles]]\nname = \"q\"\nposition = [[0, 0, 0]]\n[[force]]\nkind = \"flock\"\nradius = 1\navoidance = 3\n";
    assert_eq!(warnings(flock), ["force[0].avoidance: there is no collider to shun; add one, or leave it out"]);
    let floor = "[[collider]]\nname = \"floor\"\nshape.floor.height = -9\n";
    let splash = "[[emitter]]\nname = \"p\"\nrate = 9\nfrom.point = {}\n[[emitter]]\nname = \"q\"\nburst = [{ count = 1 }]\nfrom.particles = { of = \"p\", at = \"bounce\" }\n";
    assert_eq!(warnings(splash), ["emitter \"q\".from.particles.at: there is no collider to bounce off; add one"]);
    assert!(warnings(&format!("{emitter}{floor}")).is_empty() && warnings(&format!("{flock}{floor}")).is_empty());
}

/// A source that jumps between places has no velocity to give.
#[test]
fn a_path_of_steps_gives_no_velocity() {
    let text = format!(
        "world.gravity = [0, 0, 0]\n{}[[emitter]]\nname = \"p\"\nrate = 240\ninherit = 1\nfrom.point = {{}}\n\
         path = {{ interpolation = \"step\", keys = [[0, 0, 0, 0], [0.1, 3, 0, 0], [0.25, 0, 5, 0]] }}\n",
        scheme("verlet")
    );
    let mut sim = simulation(&text);
    run(&mut sim, 12);
    let all = by_id(&sim, "p");
    assert_eq!(all.len(), 120);
    for (id, x, v, _) in all {
        // A key holds from its time on; births at the times of keys may round to either side.
        let t = f64::from(id + 1) / 240.0;
        let place = if t < 0.1 {
            vector(0.0, 0.0, 0.0)
        } else if t < 0.25 {
            vector(3.0, 0.0, 0.0)
        } else {
            vector(0.0, 5.0, 0.0)
        };
        assert!(v.norm() == 0.0 && (x == place || (t - 0.1).abs() < 1e-9 || (t - 0.25).abs() < 1e-9), "{id}: {x:?} {v:?}");
    }
}

/// Directions of any length are the same direction.
#[test]
fn the_length_of_a_direction_is_of_no_account() {
    let run_with = |length: f64| {
        let text = format!(
            "{}[[emitter]]\nname = \"p\"\nrate = 100\nspeed = 2\ncone = 20\ndirection = [{length:e}, 0, 0]\n\
             from.disk = {{ radius = 0.1, normal = [0, {length:e}, 0] }}\nkill = [{{ inside.plane = {{ point = [1, 0, 0], normal = [-{length:e}, 0, 0] }} }}]\n\
             [[collider]]\nname = \"wall\"\nrestitution = 0.5\nshape.plane = {{ point = [0, 0, -0.1], normal = [0, 0, {length:e}] }}\n\
             [[force]]\nkind = \"vortex\"\naxis = [0, 0, {length:e}]\ncenter = [1, 0, 0]\nswirl = 3\ncore = 0.5\n",
            scheme("verlet")
        );
        let mut sim = simulation(&text);
        run(&mut sim, 24);
        by_id(&sim, "p")
    };
    let ordinary = run_with(1.0);
    // They leave to the right, bounce off the floor, and go at the wall.
    assert!(ordinary.len() > 20 && ordinary.len() < 90, "{}", ordinary.len());
    assert!(ordinary.iter().all(|p| p.1.x < 1.0 && p.1.z > -0.1001) && ordinary.iter().any(|p| p.2.z > 0.3));
    for length in [1e-170, 1e160, 1e300] {
        assert!(run_with(length) == ordinary, "{length:e}");
    }
}

/// Nobody goes beyond x = 0.5. Particles born at t_b = k/24 go there at t_b m/s and live for 11 frames: k 11/24² > 0.5 first for
/// k = 27, with id 26, one of a dozen that live then.
#[test]
fn what_breaks_is_named_by_its_id() {
    let text = format!(
        "world.gravity = [0, 0, 0]\n{}[[emitter]]\nname = \"p\"\nrate = 24\nlifetime = 0.45\nvelocity = [\"t\", 0, 0]\nfrom.point = {{}}\n\
         [[force]]\nkind = \"acceleration\"\nvalue = [\"0*sqrt(0.5 - x)\", 0, 0]\n",
        scheme("verlet")
    );
    let mut sim = simulation(&text);
    let error = (0..100).find_map(|_| sim.step(&|| true).err()).unwrap();
    assert!(matches!(&error, StepError::NotFinite(b) if b.id == Some(26) && b.index < 13), "{error:?}");
    assert!(error.to_string().contains("in emitter \"p\", the particle with id 26."), "{error}");
}

/// A triangle of 150 (0.9 - 0.1) s, with corners within frames: N(t) by hand.
#[test]
fn a_rate_of_keys_is_counted_exactly() {
    for fps in [2.0, 24.0, 100.0] {
        let text = format!(
            "time.fps = {fps}\n[[system]]\nsubsteps = 1\nintegrator = \"verlet\"\n[[emitter]]\nname = \"p\"\nrate.keys = [[0.1, 0], [0.33, 30_000], [0.9, 0]]\nfrom.point = {{}}\n"
        );
        let mut sim = simulation(&text);
        for frame in 1..=(fps as u32) {
            step(&mut sim);
            let t = f64::from(frame) / fps;
            let (up, down) = ((t - 0.1).clamp(0.0, 0.23), (0.9 - t).clamp(0.0, 0.57));
            let exact = if t < 0.33 { 15_000.0 / 0.23 * up * up } else { 12_000.0 - 15_000.0 / 0.57 * down * down };
            assert_eq!(ids(&sim, "p").len() as f64, (exact + 1e-6).floor(), "{fps} frames a second, t = {t}");
        }
    }
}

/// The clamp holds the links of a rope to 1.1 of their length and leaves the particles of the same system alone: on their parabolas,
/// as Verlet makes them, without a clamp and with one.
#[test]
fn a_clamp_leaves_particles_alone() {
    let particles = |clamp: &str| {
        let text = format!(
            "time.fps = 24\n[[system]]\nintegrator = \"verlet\"\nsubsteps = 20\n{clamp}\n\
             [[rope]]\nname = \"rope\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 10\nlinks = {{ structural = 3 }}\npin = [\"start\"]\n\
             [[emitter]]\nname = \"p\"\nrate = 100\nlifetime = 0.4\nvelocity = [1, 0, 3]\nfrom.point = {{}}\n"
        );
        let mut sim = simulation(&text);
        run(&mut sim, 24);
        let rope = positions(&sim, "rope");
        let longest = rope.windows(2).map(|x| (x[1] - x[0]).norm()).fold(0.0, f64::max) / 0.1;
        (by_id(&sim, "p"), longest)
    };
    let (held, longest) = particles("clamp = 1.1");
    let (free, loose) = particles("");
    assert_eq!(held.len(), 40);
    // Measured: 1.35 and 1.10.
    assert!(loose > 1.3 && longest < 1.1001 && longest > 1.05, "{loose} {longest}");
    for (p, q) in held.iter().zip(&free) {
        // Verlet is exact under gravity, up to its first step.
        let exact = vector(p.3, 0.0, 3.0 * p.3 - 4.9 * p.3 * p.3);
        assert!(p.0 == q.0 && (p.1 - q.1).norm() < 1e-12 && (p.1 - exact).norm() < 1e-9, "{p:?} {q:?} {exact:?}");
    }
}

/// The oldest of 33 dies as another is born, after 33/240 s, and bears a child then and there, however the system is stepped.
#[test]
fn those_who_are_replaced_bear_children() {
    let emitters = |velocity: &str| {
        format!(
            "[[emitter]]\nname = \"p\"\nrate = 240\n{velocity}\nlifetime = 10\nmost = 33\nwhen_full = \"replace_oldest\"\nfrom.point = {{}}\n\
             [[emitter]]\nname = \"heir\"\nburst = [{{ count = 1 }}]\nfrom.particles = {{ of = \"p\", cause = [\"replaced\"] }}\n\
             [[emitter]]\nname = \"any\"\nburst = [{{ count = 2 }}]\nfrom.particles.of = \"p\"\n\
             [[emitter]]\nname = \"none\"\nburst = [{{ count = 1 }}]\nfrom.particles = {{ of = \"p\", cause = [\"lifetime\"] }}\n\
             [[emitter]]\nname = \"trace\"\nrate = 240\nfrom.particles.of = \"p\"\n"
        )
    };
    for name in ["verlet", "implicit_midpoint", "tracers"] {
        let text = if name == "tracers" {
            let field = "[[system]]\nmethod = \"tracers\"\nintegrator = \"rk4\"\nsubsteps = 3\n[[field]]\nkind = \"uniform\"\nvelocity = [2, 0, 0]\n";
            format!("time.fps = 24\n{field}{}", emitters(""))
        } else {
            format!("world.gravity = [0, 0, 0]\n{}{}", scheme(name), emitters("velocity = [2, 0, 0]"))
        };
        let mut sim = simulation(&text);
        run(&mut sim, 10);
        let drift = if name == "tracers" { 2.0 } else { 0.0 };
        assert_eq!((ids(&sim, "p").len(), ids(&sim, "any").len(), ids(&sim, "none").len()), (33, 2 * 67, 0), "{name}");
        let heirs = by_id(&sim, "heir");
        assert_eq!(heirs.len(), 67, "{name}");
        for (id, x, _, age) in heirs {
            let death = f64::from(id + 34) / 240.0;
            assert!((age - (10.0 / 24.0 - death)).abs() < 1e-12, "{name}, {id}: {age}");
            assert!((x - vector(0.275 + drift * age, 0.0, 0.0)).norm() < 1e-12, "{name}, {id}: {x:?}");
        }
        // Each leaves a trace at every 240th of a second until it is replaced: 33 (the last at its death) of 67, and 0 to 32 of the
        // others.
        let traces = ids(&sim, "trace").len();
        assert_eq!(traces, 33 * 67 + 33 * 32 / 2, "{name}");
    }
}

/// Those faster than 0.25 m in 11 frames leave the ball before their lifetime of 12 frames ends.
#[test]
fn children_heed_what_their_parents_died_of() {
    let child = |name: &str, cause: &str| {
        format!("[[emitter]]\nname = \"{name}\"\nburst = [{{ count = 1 }}]\nfrom.particles = {{ of = \"p\", cause = [{cause}] }}\n")
    };
    let text = format!(
        "world.gravity = [0, 0, 0]\n{}[[emitter]]\nname = \"p\"\nburst = [{{ count = 300 }}]\nspeed = 1\nspeed_spread = 1\ncone = 180\nlifetime = 0.5\n\
         kill = [{{ faster_than = 5 }}, {{ outside.sphere.radius = 0.25 }}]\nfrom.point = {{}}\n{}{}{}{}",
        scheme("verlet"),
        child("old", "\"lifetime\""),
        child("out", "\"outside\", \"faster_than\""),
        child("fast", "\"faster_than\""),
        child("all", "")
    );
    let mut sim = simulation(&text);
    let out = velocities(&sim, "p").iter().filter(|v| v.norm() * 11.0 / 24.0 > 0.25).count();
    run(&mut sim, 13);
    let count = |name: &str| ids(&sim, name).len();
    assert!(out > 150 && out < 280, "{out}");
    assert_eq!((count("p"), count("old"), count("out"), count("fast"), count("all")), (0, 300 - out, out, 0, 300));
}

/// A mass that falls from 1 m meets the floor after sqrt(2/g) and leaves with half its speed; its next way takes as long.
#[test]
fn splashes_are_born_where_and_when_drops_bounce() {
    let text = |system: &str, restitution: f64| {
        format!(
            "time.fps = 24\n[[system]]\n{system}\n[[emitter]]\nname = \"drop\"\nburst = [{{ count = 1 }}, {{ time = 0.3, count = 2 }}]\nfrom.point.at = [0, 0, 1]\n\
             [[emitter]]\nname = \"splash\"\nburst = [{{ count = 3 }}]\nspeed = 1\nfrom.particles = {{ of = \"drop\", at = \"bounce\" }}\n\
             [[emitter]]\nname = \"shadow\"\nburst = [{{ count = 1 }}]\ninherit = 1\nfrom.particles = {{ of = \"drop\", at = \"bounce\" }}\n\
             [[collider]]\nname = \"floor\"\nrestitution = {restitution}\nshape.floor.height = 0\n"
        )
    };
    let fall = (2.0_f64 / 9.8).sqrt();
    for system in ["integrator = \"verlet\"\nsubsteps = 4", "integrator = \"dormand_prince\"", "integrator = \"rk4\"\nsubsteps = 7"] {
        let mut sim = simulation(&text(system, 0.5));
        run(&mut sim, 14);
        assert_eq!(ids(&sim, "splash").len(), 3, "{system}");
        for (_, x, v, age) in by_id(&sim, "splash") {
            // Measured: 3e-15 s; off the floor at 1 m/s.
            assert!((age - (14.0 / 24.0 - fall)).abs() < 1e-9, "{system}: {age}");
            assert!((x.z - (age - 4.9 * age * age)).abs() < 1e-9 && (v.z - (1.0 - 9.8 * age)).abs() < 1e-9, "{system}: {x:?} {v:?}");
        }
        // With all of its velocity a child goes where its parent goes.
        let (drop, shadow) = (by_id(&sim, "drop")[0], by_id(&sim, "shadow")[0]);
        assert!((drop.1 - shadow.1).norm() < 1e-9 && (drop.2 - shadow.2).norm() < 1e-9 && drop.1.z > 0.1, "{system}: {drop:?} {shadow:?}");
        // The two others by 0.3 s + fall, the first again by 2 fall.
        run(&mut sim, 8);
        assert_eq!(ids(&sim, "splash").len(), 3 * 4, "{system}");
    }
    // A mass that stays on the floor has hit it once, under every scheme; schemes that see the impact at the end of the step are late by that.
    for integrator in Integrator::ALL {
        let steps = if integrator.is_adaptive() { "" } else { "substeps = 10" };
        let mut sim = simulation(&text(&format!("integrator = \"{}\"\n{steps}", integrator.name()), 0.0));
        run(&mut sim, 40);
        let all = by_id(&sim, "splash");
        assert_eq!(all.len(), 3 * 3, "{}", integrator.name());
        for (id, _, _, age) in all {
            let late = 40.0 / 24.0 - age - fall - if id < 3 { 0.0 } else { 0.3 };
            assert!(late > -2.0 / 240.0 && late < 2.0 / 240.0, "{}, {id}: {late}", integrator.name());
        }
    }
}

/// Many meet the floor in the first step of their life, 4 ms after their birth; none that lives for 2 ms only.
#[test]
fn newborn_splash_and_the_dead_do_not() {
    let splashes = |integrator: &str, lifetime: f64| {
        let text = format!(
            "{}[[emitter]]\nname = \"drop\"\nrate = 50\njitter = 1\nvelocity = [0, 0, -5]\nlifetime = {lifetime}\nfrom.point.at = [0, 0, 0.02]\n\
             [[emitter]]\nname = \"splash\"\nburst = [{{ count = 1 }}]\nspeed = 1\nfrom.particles = {{ of = \"drop\", at = \"bounce\" }}\n\
             [[collider]]\nname = \"floor\"\nshape.floor.height = 0\n",
            scheme(integrator)
        );
        let mut sim = simulation(&text);
        run(&mut sim, 24);
        (ids(&sim, "splash").len(), positions(&sim, "drop").iter().filter(|x| x.z < 1e-3).count())
    };
    for integrator in ["verlet", "implicit_midpoint"] {
        let (splashes_of_all, landed) = splashes(integrator, 9.0);
        assert!(splashes_of_all == landed && landed > 45, "{integrator}: {splashes_of_all} {landed}");
        assert_eq!(splashes(integrator, 0.002).0, 0, "{integrator}");
    }
}
