//! Impacts on the way: bouncing balls, containers, moving solids, and nothing that passes through a wall at any speed.
//! See docs/theory/contact.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, every, positions, run, simulation, solid, step, vector, velocities};
use proptest::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;
use tumble_f64::geometry::contact::Collider;
use tumble_f64::geometry::motion::Motion;
use tumble_f64::geometry::{Facets, GridSdf, Shape, surface};
use tumble_f64::integrators::lead;
use tumble_f64::math::rotation::from_degrees;
use tumble_f64::scene::Simulation;
use tumble_interface::scene::Integrator;
use tumble_interface::{Engine, Mesh, Scene};

const G: f64 = 9.81;

/// One mass, with the words of a system and of a collider.
fn one(system: &str, x: Vector, v: Vector, collider: &str, gravity: f64) -> Simulation {
    simulation(&scene(system, x, v, collider, gravity))
}

fn scene(system: &str, x: Vector, v: Vector, collider: &str, gravity: f64) -> String {
    format!(
        "world.gravity = [0, 0, {:e}]\n{system}\n[[particles]]\nname = \"p\"\nposition = [[{:e}, {:e}, {:e}]]\nvelocity = [[{:e}, {:e}, {:e}]]\n\
         [[collider]]\nname = \"c\"\n{collider}\n",
        -gravity, x.x, x.y, x.z, v.x, v.y, v.z
    )
}

fn words(scheme: Integrator, fps: f64, substeps: u32) -> String {
    let steps = if scheme.is_adaptive() { "adaptive.tolerance = 1e-8".to_string() } else { format!("substeps = {substeps}") };
    format!("time.fps = {fps}\n[[system]]\nintegrator = \"{}\"\n{steps}\n", scheme.name())
}

fn now(sim: &Simulation) -> (Vector, Vector) {
    (positions(sim, "p")[0], velocities(sim, "p")[0])
}

/// A ball dropped from 1 m rests after sqrt(2h/g) (1 + e)/(1 - e), having made a way of h (1 + e²)/(1 - e²).   (contact.13)
#[test]
fn a_bouncing_ball_rests_when_the_series_says() {
    let h = 1e-3;
    for scheme in [Integrator::SymplecticEuler, Integrator::ModifiedEuler, Integrator::VelocityVerlet, Integrator::Rk4] {
        for (e, time, way) in [(0.5, 1.354_570_9, 1.666_667), (0.8, 4.063_712_8, 4.555_556), (0.9, 8.578_949_2, 9.526_316)] {
            let sim = &mut one(
                &words(scheme, 1.0 / h, 1),
                vector(0.0, 0.0, 1.0),
                vector(0.0, 0.0, 0.0),
                &format!("restitution = {e}\nshape.floor.height = 0"),
                G,
            );
            let (mut last, mut path, mut before) = (0.0, 0.0, (1.0, 0.0));
            for frame in 1..10_000 {
                step(sim);
                let (x, v) = now(sim);
                if v.norm() > 1e-9 {
                    last = f64::from(frame) * h;
                }
                if before.1 > 0.0 && v.z <= 0.0 {
                    // The top of a flight, up and down; the speed says how far from a sample it is.
                    let speed = v.z - lead(scheme) * G * h;
                    let top: f64 = x.z + speed * speed / (2.0 * G);
                    path += 2.0 * top;
                }
                before = (x.z, v.z);
            }
            path += 1.0;
            println!("{:16} e = {e}: rests after {last:.4} s ({:+.1e}), way {path:.6} m ({:+.1e})", scheme.name(), last - time, path - way);
            // All are exact in flight, symplectic Euler after a start at g h/2 downwards: h/2 early. Impacts slower than 2 g h do not bounce: what is left of the series then is at most
            // 4 h e/(1 - e), 0.036 s for e = 0.9 (measured: 0.034), and a way of 4 g h² e²/(1 - e²) (measured: 1.1e-5, 5.1e-5, 1.5e-4 m).
            let early = (4.0 + 2.0 * lead(scheme)) * h * e / (1.0 - e) + h + lead(scheme) * h;
            assert!(last - time < 1.5 * h && last - time > -early, "{} {e} {last}", scheme.name());
            let off = 2e-5 + (2.0 + lead(scheme)).powi(2) * G * h * h * e * e / (1.0 - e * e);
            assert!((path - way).abs() < off, "{} {e} {path}", scheme.name());
            assert!(last > 1.0);
        }
    }
}

/// A ball that loses nothing bounces for ever: after 100 bounces it rises as high as at the start, and in time.   (contact.14)
#[test]
fn an_elastic_ball_bounces_for_ever() {
    // Step doubling changes its step in flight and with it the speed of its path; implicit Euler damps.
    let others = [Integrator::AdaptiveEuler, Integrator::ImplicitEuler];
    for scheme in every().into_iter().filter(|s| !others.contains(s)) {
        for h in [1e-2, 2e-3] {
            // Two steps a frame; dropped from 1 m.
            let words = words(scheme, 0.5 / h, 2);
            let sim = &mut one(&words, vector(0.0, 0.0, 1.0), Vector::default(), "restitution = 1\nshape.floor.height = 0", G);
            let (lead, fall) = (lead(scheme) * h, (2.0 / G).sqrt());
            let (mut bounces, mut late, mut frame, mut before) = (0, 0.0_f64, 0, 0.0);
            let (mut top, mut low, mut high, mut off) = (1.0_f64, f64::INFINITY, 0.0_f64, 0.0_f64);
            while bounces < 100 {
                frame += 1;
                step(sim);
                let (x, v) = now(sim);
                if before < 0.0 && v.z > 0.0 {
                    // The parabola of the path back to the floor.
                    let speed = v.z - lead * G;
                    let since = 2.0 * x.z / (speed + (speed * speed + 2.0 * G * x.z).sqrt());
                    let found = f64::from(2 * frame) * h - since - fall * f64::from(2 * bounces + 1);
                    late = if found.abs() > late.abs() { found } else { late };
                    (low, high, top) = (low.min(top), high.max(top), 0.0);
                    bounces += 1;
                }
                before = v.z;
                top = top.max(x.z);
                off = off.max((0.5 * v.norm_sq() + G * x.z - G).abs());
            }
            println!("{:18} h = {h}: tops {low:.6} to {high:.6} m, {late:+.1e} s late, energy {off:.1e} J/kg off", scheme.name());
            // The path starts at the speed u = lead g downwards, and so comes from u²/(2 g) higher.
            let u = lead.abs() * G;
            let higher = u * u / (2.0 * G);
            // BDF2 starts anew after each impact, (1/2 + 1/6 + 1/18 + ...) g h² too low.
            let lost = if scheme == Integrator::Bdf2 { 0.75 * G * h * h } else { 0.0 };
            // A sample is at most h from a top: g h²/2 lower. Measured: 0.99 of that.
            let (lowest, sampled) = (1.0 - 100.0 * lost, 0.5 * G * h * h);
            assert!(low > lowest - sampled - 1e-9 && low < lowest && high < 1.0 + higher + 1e-9, "{} {h}: {low} {high}", scheme.name());
            // h/2 early from the start (forward Euler: late), and each fall longer by half of u²/(2 g). Measured: -5.0, 11 ms with 10 ms.
            let latest = u / G + 199.0 * fall * 0.5 * higher + 0.55 * fall * lost * 1e4 + 1e-6;
            assert!(late.abs() < latest, "{} {h}: {late} {latest}", scheme.name());
            // v differs from the path's by u, at most at the speed of impact: order 1, and the same for ever.
            let swing = u * (2.0 * G).sqrt() + u * u + G * lost * 100.0;
            assert!(off < 1.01 * swing + 1e-9 && off > 0.9 * swing - 1e-9, "{} {h}: {off} {swing}", scheme.name());
        }
    }
}

/// Under a constant acceleration a step moves by h (v_t + v_t+h)/2 + lead h² a.                                      (contact.14)
#[test]
fn velocities_lag_behind_positions() {
    let h = 0.01;
    for scheme in every() {
        let words = words(scheme, 1.0 / h, 1).replace("tolerance = 1e-8", &format!("tolerance = 1\nadaptive.first_step = {h}"));
        let sim = &mut one(&words, vector(0.0, 0.0, 9.0), vector(1.0, 0.0, 2.0), "shape.floor.height = 0", G);
        // BDF2 starts with implicit Euler, from whose lag a third is left after each step: 1.4e-10.
        run(sim, 20);
        let (x, v) = now(sim);
        let steps = step(sim).steps;
        let (x1, v1) = now(sim);
        let found = ((v + v1) * (0.5 * h) - (x1 - x)).z / (G * h * h);
        println!("{:18} {found:+.6}", scheme.name());
        assert_eq!(steps, 1);
        assert!((found - lead(scheme)).abs() < 1e-9, "{} {found}", scheme.name());
    }
}

/// Thrown down an incline with mu > tan a, a mass stops after v²/(2 g (mu cos a - sin a)).
#[test]
fn a_slider_stops_where_it_should() {
    let (a, mu, v) = (10.0_f64.to_radians(), 0.5, 2.0);
    let expected = v * v / (2.0 * G * (mu * a.cos() - a.sin()));
    for scheme in every() {
        let down = vector(a.cos(), 0.0, -a.sin());
        let collider = format!("friction = {mu}\nshape.plane.normal = [{:e}, 0, {:e}]", a.sin(), a.cos());
        let sim = &mut one(&words(scheme, 100.0, 10), vector(0.0, 0.0, 0.0), down * v, &collider, G);
        run(sim, 150);
        let way = now(sim).0.dot(down);
        println!("{:18} stops after {way:.5} m, expected {expected:.5}", scheme.name());
        // Order 1: v h/2 = 1 mm with steps of 1 ms (adaptive: h = 10 ms); implicit Euler starts without normal force, v h more, and
        // creeps 0.35 mm/s.
        let h = if scheme.is_adaptive() { 1e-2 } else { 1e-3 };
        assert!((way - expected).abs() < 1.6 * v * h + 2e-3, "{} {way} {expected}", scheme.name());
    }
}

/// Reflections in a ball keep energy and angular momentum, and the mass inside, at 400 m per step in a room of 2 m.
#[test]
fn light_in_a_round_room() {
    let collider = "inside = true\nrestitution = 1\nthickness = 0.01\nshape.sphere = { center = [0.5, -0.2, 0.1], radius = 1 }";
    for scheme in
        [Integrator::SymplecticEuler, Integrator::VelocityVerlet, Integrator::Rk4, Integrator::DormandPrince, Integrator::ImplicitMidpoint]
    {
        for speed in [3.0, 1e4] {
            let center = vector(0.5, -0.2, 0.1);
            let v = vector(0.6, 0.48, 0.64) * speed;
            let sim = &mut one(&words(scheme, 24.0, 1), center + vector(0.3, 0.1, -0.6), v, collider, 0.0);
            let spin = |sim: &Simulation| (now(sim).0 - center).cross(now(sim).1);
            let start = spin(sim);
            let mut moved = 0.0_f64;
            for _ in 0..200 {
                step(sim);
                let (x, v) = now(sim);
                moved = moved.max((x - center - vector(0.3, 0.1, -0.6)).norm());
                assert!((x - center).norm() < 0.99 + 1e-9, "{} {x:?}", scheme.name());
                assert!((v.norm() / speed - 1.0).abs() < 1e-9);
                // Measured: 2e-11 (round-off of 5e4 reflections).
                assert!((spin(sim) - start).norm() < 1e-7 * speed, "{} {:?} {start:?}", scheme.name(), spin(sim));
            }
            assert!(moved > 1.0);
        }
    }
}

/// A mass on a belt gains mu g t until it has the belt's speed; a floor that moves along itself is a belt.
#[test]
fn a_belt_drags() {
    let (mu, belt) = (0.3, 2.0);
    for words_of in ["belt = [2, 0, 0]", "motion.velocity = [2, 0, 0]"] {
        for scheme in every() {
            let collider = format!("friction = {mu}\n{words_of}\nshape.floor.height = 0");
            let sim = &mut one(&words(scheme, 100.0, 10), vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0), &collider, G);
            run(sim, 40);
            let early = now(sim).1.x;
            run(sim, 60);
            let (x, v) = now(sim);
            let expected = mu * G * 0.4;
            println!("{:18} {words_of}: {early:.4} m/s after 0.4 s ({expected:.4}), then {:.6}, height {:.1e}", scheme.name(), v.x, x.z);
            // Two steps late at most: mu g h = 3 mm/s each (adaptive: h = 10 ms).
            let late = if scheme.is_adaptive() { 0.06 } else { 0.006 };
            assert!((early - expected).abs() < late, "{} {early} {expected}", scheme.name());
            assert!((v.x - belt).abs() < 1e-3 && x.z.abs() < 1e-4, "{} {v:?}", scheme.name());
        }
    }
}

/// A mass hit by an elastic bat leaves with 2u - v under every scheme; also for a rotating and for a fast bat.
#[test]
fn a_bat_hits() {
    for scheme in every() {
        for (u, v) in [(3.0, -1.0), (300.0, -100.0), (-1.0, -4.0)] {
            let collider =
                format!("restitution = 1\nmotion.velocity = [0, 0, {u}]\nshape.plane = {{ point = [0, 0, -1], normal = [0, 0, 1] }}");
            let sim = &mut one(&words(scheme, 50.0, 4), vector(0.0, 0.0, 0.0), vector(0.5, 0.0, v), &collider, 0.0);
            run(sim, 50);
            let (x, after) = now(sim);
            assert!((after.z - (2.0 * u - v)).abs() < 1e-9 * (u.abs() + v.abs()), "{} {after:?}", scheme.name());
            assert!((after.x - 0.5).abs() < 1e-9);
            // They met at 1/(u - v), and the mass left from there.
            let t = 1.0 / (u - v);
            let there = v * t + (2.0 * u - v) * (1.0 - t);
            // Implicit Euler finds the impact with the step, h = 5 ms, the others exactly.
            let late = if scheme == Integrator::ImplicitEuler { 5e-3 * 3.0 * (u - v).abs() } else { 1e-6 * (1.0 + there.abs()) };
            assert!((x.z - there).abs() < late, "{} {u}: {} {there}", scheme.name(), x.z);
        }
        // A paddle that turns at 2 rad/s about z meets the mass at 1.5 m from the axis with 3 m/s.
        let collider = "restitution = 1\nmotion.spin = [0, 0, 2]\nshape.box = { center = [1, 0, 0], size = [2, 0.02, 1] }";
        let sim = &mut one(&words(scheme, 100.0, 4), vector(1.5, 0.06, 0.0), vector(0.0, 0.0, 0.0), collider, 0.0);
        run(sim, 10);
        let after = now(sim).1;
        // At the impact the paddle has turned by phi, 1.5 sin phi = 0.06 - 0.01/cos phi: the velocity of its face there is
        // omega times the distance along the face, and so 2 omega (x cos phi + y sin phi) off it.
        let phi = (0..50).fold(0.0_f64, |phi, _| ((0.06 * phi.cos() - 0.01) / 1.5).atan2(1.0));
        let along = 1.5 * phi.cos() + 0.06 * phi.sin();
        let expected = vector(-phi.sin(), phi.cos(), 0.0) * (4.0 * along);
        println!("{:18} paddle: {after:?}, expected {expected:?}", scheme.name());
        let off = if scheme == Integrator::ImplicitEuler {
            0.05
        } else if scheme.is_adaptive() {
            2e-2
        } else {
            5e-3
        };
        assert!((after - expected).norm() < off * expected.norm(), "{} {after:?} {expected:?}", scheme.name());
    }
}

/// A flat plate of triangles as a shell, at z = 0 and at z = 1 a second later.
fn plate(z: f64) -> Mesh {
    let n = 4_u32;
    let at = |k: u32| f64::from(k) / f64::from(n) * 2.0 - 1.0;
    let vertices = (0..=n).flat_map(|j| (0..=n).map(move |i| [at(i), at(j), z])).collect();
    let triangles = (0..n * n).flat_map(|k| {
        let a = k % n + (k / n) * (n + 1);
        [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
    });
    Mesh { vertices, triangles: triangles.collect(), ..Mesh::default() }
}

fn with_meshes(text: &str, meshes: &[(&str, Mesh)]) -> Simulation {
    let scene = Scene::from_toml(&format!("version = 1\n{text}")).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let assets: HashMap<String, Mesh> = meshes.iter().map(|(n, m)| (n.to_string(), m.clone())).collect();
    Simulation::new(scene, Arc::new(assets).into()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// A plate of triangles that rises carries and hits like a plane that rises.
#[test]
fn an_animated_plate_is_a_moving_plane() {
    let animated = "shape.animated_mesh = { shell = true, frames = [{ time = 0, path = \"a\" }, { time = 0.35, path = \"b\" }, { time = 1, path = \"c\" }] }";
    let plane = "motion.velocity = [0, 0, 1]\nshape.floor.height = 0";
    for (x, v, e, mu) in [(0.3, 0.0, 0.0, 0.4), (0.31, -5.0, 0.9, 0.0), (0.01, 0.0, 0.5, 0.3), (0.9, -2000.0, 1.0, 0.1)] {
        for scheme in [Integrator::SymplecticEuler, Integrator::VelocityVerlet, Integrator::Bdf2, Integrator::ImplicitEuler] {
            let common = format!("thickness = 0.01\nrestitution = {e}\nfriction = {mu}\n");
            let start = (vector(0.123, 0.05, x), vector(0.2, 0.0, v));
            let text = |shape: &str| scene(&words(scheme, 50.0, 4), start.0, start.1, &format!("{common}{shape}"), G);
            let mut mesh = with_meshes(&text(animated), &[("a", plate(0.0)), ("b", plate(0.35)), ("c", plate(1.0))]);
            let mut exact = simulation(&text(plane));
            for frame in 0..45 {
                step(&mut mesh);
                step(&mut exact);
                let (a, b) = (now(&mesh), now(&exact));
                if b.0.x.abs() > 0.9 || b.0.z > 20.0 {
                    break;
                }
                // Implicit Euler looks for its end on either side of a shell, and is caught on the way where a plane would push: a step
                // of h = 5 ms late, and g h in speed.
                let (off, fast) = if scheme == Integrator::ImplicitEuler { (4e-3, 0.06) } else { (1e-6, 1e-5) };
                assert!(
                    (a.0 - b.0).norm() < off * (1.0 + v.abs()) && (a.1 - b.1).norm() < fast,
                    "{} {x} {frame}: {a:?} {b:?}",
                    scheme.name()
                );
            }
            assert!(now(&mesh).0.z > 0.5, "{}", scheme.name());
        }
    }
}

/// Nothing passes a thin wall, of any shape, at any speed, under any scheme.
#[test]
fn thin_walls_hold() {
    let walls = [
        ("box", "shape.box = { size = [4, 4, 0.001] }"),
        ("floor", "shape.floor.height = 0"),
        ("capsule", "shape.capsule = { from = [-2, 0, 0], to = [2, 0, 0], radius = 0.0005 }"),
        ("sphere", "shape.sphere.radius = 0.001"),
        ("mesh", "shape.mesh = { path = \"wall\" }"),
        ("shell", "thickness = 1e-4\nshape.mesh = { path = \"plate\", shell = true }"),
        ("animated", "shape.animated_mesh = { frames = [{ time = 0, path = \"wall\" }, { time = 1, path = \"wall\" }] }"),
        ("moving box", "motion.velocity = [0, 0, 5]\nshape.box = { size = [4, 4, 0.001] }"),
        ("turning box", "motion.spin = [0, 0, 9]\nshape.box = { size = [4, 4, 0.001] }"),
    ];
    let wall = surface::cuboid(vector(0.0, 0.0, 0.0), vector(2.0, 2.0, 0.0005), from_degrees([0.0; 3]));
    let meshes = [("wall", wall), ("plate", plate(0.0))];
    for (name, shape) in walls {
        for scheme in every() {
            for speed in [30.0, 1e4] {
                let text = scene(
                    &words(scheme, 24.0, 1),
                    vector(0.0, 0.0, 1.5),
                    vector(0.0, 0.0, -speed),
                    &format!("restitution = 0.5\n{shape}"),
                    G,
                );
                let sim = &mut with_meshes(&text, &meshes);
                run(sim, 2);
                let (x, v) = now(sim);
                // Implicit Euler leaves to its penalty what is not deeper than gravity takes it in two steps, g (2 h)²/2. What comes
                // with v and would be p deep after the step ends it at p/31: (contact.6). At 30 m/s p is 1.05 m: 0.0339 m, of 0.0341.
                let sunk = if scheme == Integrator::ImplicitEuler { 2.0 * G / 576.0 } else { 0.0 };
                assert!(x.z > -sunk && x.z < speed, "{name} {} {speed}: {x:?} {v:?}", scheme.name());
                if speed > 1e3 {
                    // Half the speed, and twice 5 m/s less 0.5 of it where the wall rises.
                    assert!((v.z / speed - 0.5).abs() < 2e-3, "{name} {} {v:?}", scheme.name());
                }
            }
        }
    }
}

fn facets(mesh: &Mesh) -> Facets {
    Facets::new(&[mesh], &[0.0]).unwrap()
}

fn point(size: f64) -> impl Strategy<Value = Vector> {
    [-size..size, -size..size, -size..size].prop_map(Vector::from)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// The first contact is where a fine walk along the segment first finds the mass inside; a way that stays outside is free.
    #[test]
    fn sweeps_find_what_a_walk_finds(a in point(3.0), b in point(3.0), half in [0.05..1.0, 0.05..1.0, 0.05..1.0], thickness in 0.0..0.2, inside: bool) {
        let turn = from_degrees([20.0, -40.0, 70.0]);
        let shapes = [
            Shape::Sphere { center: vector(0.1, 0.2, -0.1), radius: half[0] },
            Shape::Box { center: vector(0.1, 0.2, -0.1), half: half.into(), turn },
            Shape::Capsule { from: vector(-half[0], 0.0, 0.3), to: vector(half[1], half[2], 0.0), radius: half[2] },
            Shape::Plane { normal: vector(0.6, 0.0, 0.8), offset: half[0] },
        ];
        for shape in shapes {
            if inside && matches!(shape, Shape::Plane { .. }) {
                continue;
            }
            let name = format!("{shape:?}");
            let collider = solid(shape, inside, thickness);
            let depth = |s: f64| collider.touch(a + (b - a) * s, 0.0).map_or(0.0, |t| t.depth);
            if depth(0.0) > 0.0 {
                continue;
            }
            let steps = 4000;
            let first = (1..=steps).map(|k| f64::from(k) / f64::from(steps)).find(|s| depth(*s) > 0.0);
            let found = collider.sweep(a, b, 0.0, 1.0);
            match (first, found) {
                (None, None) => {}
                (Some(s), Some(hit)) => {
                    prop_assert!(hit.part <= s + 1e-9 && hit.part > s - 1.001 / f64::from(steps) , "{name} {s} {hit:?}");
                    prop_assert!(depth(hit.part) < 1e-9 && depth(hit.part + 1e-9) > -1e-12);
                    prop_assert!(hit.normal.dot(b - a) < 0.0 && (hit.normal.norm() - 1.0).abs() < 1e-9);
                }
                // Between two samples it may graze.
                (None, Some(hit)) => prop_assert!(depth(hit.part + 0.5 / f64::from(steps)) < 1e-5, "{name} {hit:?}"),
                (Some(s), None) => prop_assert!(depth(s) < 1e-9, "{name} {s}"),
            }
        }
    }
}

// A mesh is sampled in each of these.
proptest! {
    #![proptest_config(ProptestConfig { cases: if common::whole() { 300 } else { 50 }, failure_persistence: None, ..ProptestConfig::default() })]

    /// Twelve triangles stop what the box stops, there and then; moving vertices stop what the moving box stops.
    #[test]
    fn meshes_stop_what_solids_stop(a in point(3.0), b in point(3.0), half in [0.001..1.0, 0.05..1.0, 0.05..1.0], u in point(2.0)) {
        let (center, turn) = (vector(0.1, 0.2, -0.1), from_degrees([20.0, -40.0, 70.0]));
        let mesh = surface::cuboid(center, half.into(), turn);
        let mut later = mesh.clone();
        later.vertices.iter_mut().for_each(|v| *v = (Vector::from(*v) + u).into());
        let exact = solid(Shape::Box { center, half: half.into(), turn }, false, 0.0);
        if exact.touch(a, 0.0).is_some() {
            return Ok(());
        }
        let grid = GridSdf::new(&mesh, 16, 0.0, false).unwrap();
        let still = solid(Shape::Mesh { grid, facets: facets(&mesh), shell: false }, false, 0.0);
        let moving = solid(Shape::Animated { facets: Facets::new(&[&mesh, &later], &[0.0, 1.0]).unwrap(), shell: false }, false, 0.0);
        let motion = Motion { velocity: u, spin: Vector::default(), pivot: center, keys: Vec::new(), smooth: false };
        let carried = Collider { motion: Some(motion), ..exact.clone() };
        for (x, y, name) in [(&exact, &still, "still"), (&carried, &moving, "moving")] {
            let (x, y) = (x.sweep(a, b, 0.0, 1.0), y.sweep(a, b, 0.0, 1.0));
            match (x, y) {
                (None, None) => {}
                (Some(x), Some(y)) => {
                    prop_assert!((x.part - y.part).abs() < 1e-8, "{name} {x:?} {y:?}");
                    prop_assert!((x.normal - y.normal).norm() < 1e-6 && (x.velocity - y.velocity).norm() < 1e-9, "{name} {x:?} {y:?}");
                }
                other => prop_assert!(false, "{name} {other:?}"),
            }
        }
    }

    /// A mass in a room never leaves it, whatever the speed and however the room moves.
    #[test]
    fn rooms_keep_what_is_in_them(v in point(1e3), spin in point(3.0), shape in 0..4, e in 0.0..1.0) {
        let shape = ["box = { size = [2, 1.5, 1] }", "sphere.radius = 1", "capsule = { from = [-1, 0, 0], to = [1, 0, 0], radius = 0.6 }", "mesh = { path = \"room\" }"][shape as usize];
        let room = surface::cuboid(vector(0.0, 0.0, 0.0), vector(1.0, 0.75, 0.5), from_degrees([0.0; 3]));
        let collider = format!("inside = true\nrestitution = {e}\nfriction = 0.1\nthickness = 0.02\nmotion.spin = [{}, {}, {}]\nshape.{shape}", spin.x, spin.y, spin.z);
        let text = scene(&words(Integrator::VelocityVerlet, 24.0, 2), vector(0.1, 0.2, 0.3), v, &collider, G);
        let mut sim = with_meshes(&text, &[("room", room)]);
        for _ in 0..30 {
            step(&mut sim);
            prop_assert!(now(&sim).0.norm() < 1.7, "{shape} {:?}", now(&sim));
            prop_assert!(sim.ledger().penetration.unwrap() < 0.021, "{shape} {}", sim.ledger().penetration.unwrap());
        }
    }
}

/// In the corner of a room each wall pushes along its own normal: energy and the velocity along a wall are conserved.
#[test]
fn a_room_has_corners() {
    for y in ["0.5", "0.4999"] {
        let text = format!(
            "[[system]]\nintegrator = \"velocity_verlet\"\nsubsteps = 8\n[[particles]]\nname = \"p\"\nposition = [[0, {y}, 0.4]]\n\
             [[collider]]\nname = \"room\"\ninside = true\nrestitution = 1\nshape.box.size = [1, 1, 1]\n"
        );
        let mut sim = simulation(&text);
        let start = sim.ledger().energy();
        run(&mut sim, 48);
        let books = sim.ledger();
        // Measured: 1e-15 of 3.92 J.
        assert!((books.energy() - start).abs() < 1e-9, "{y}: {} of {start}", books.energy());
        let v = velocities(&sim, "p")[0];
        assert!(v.x.abs() + v.y.abs() < 1e-9 && v.z.abs() > 0.01, "{v:?}");
    }
}

/// A mass pinned to a deforming surface follows its nearest triangle, with constant barycentric weights and height.
#[test]
fn what_follows_a_surface_goes_with_its_triangle() {
    // In 1 s (x, y) goes to (-y, 2 x), and all by 1 m upwards.
    let triangle = |corners: [[f64; 3]; 3]| Mesh { vertices: corners.to_vec(), triangles: vec![[0, 1, 2]], ..Mesh::default() };
    let meshes = [
        ("a", triangle([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 3.0, 0.0]])),
        ("b", triangle([[0.0, 0.0, 1.0], [0.0, 6.0, 1.0], [-3.0, 0.0, 1.0]])),
    ];
    for scheme in ["position_based", "implicit_euler", "rk4"] {
        let text = format!(
            "time.fps = 4\n[[system]]\nintegrator = \"{scheme}\"\n\
             [[particles]]\nname = \"p\"\nposition = [[0.5, 1.0, 0.25], [1.5, 0.25, -0.1]]\nmass = [1, 1]\n\
             pin = [{{ which = \"all\", follow = {{ collider = \"m\" }} }}]\n\
             [[collider]]\nname = \"m\"\nthickness = 0.01\nmotion.velocity = [0, 0, 2]\n\
             shape.animated_mesh = {{ shell = true, frames = [{{ time = 0, path = \"a\" }}, {{ time = 1, path = \"b\" }}] }}\n"
        );
        let mut sim = with_meshes(&text, &meshes);
        for frame in 1..=4 {
            step(&mut sim);
            let t = f64::from(frame) / 4.0;
            for (x, [u, v, height]) in positions(&sim, "p").into_iter().zip([[0.5, 1.0, 0.25], [1.5, 0.25, -0.1]]) {
                let expected = vector(u * (1.0 - t) - v * t, v * (1.0 - t) + 2.0 * u * t, height + t + 2.0 * t);
                assert!((x - expected).norm() < 1e-12, "{scheme}, {t} s: {x:?} {expected:?}");
            }
        }
    }
}
