//! Forces and extra masses on some masses of an object, against exact solutions. docs/theory/particles.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, run, simulation, velocities};
use tumble_interface::{Engine, Scene};

fn told(text: &str) -> String {
    let scene = Scene::from_toml(&format!("version = 1\n{text}")).unwrap();
    tumble_f64::scene::Simulation::new(scene, tumble_interface::Assets::default()).err().map(|e| e.to_string()).unwrap_or_default()
}

/// A force that changes in time moves masses as its integrals say, whatever moves them and however many share it.
#[test]
fn a_load_moves_masses_by_its_integrals() {
    for method in
        ["integrator = \"rk4\"\nstep = 2e-3", "integrator = \"implicit_euler\"\nstep = 2e-4", "method = \"position_based\"\nstep = 2e-4"]
    {
        let mut sim = simulation(&format!(
            "precision = \"double\"\nworld.gravity = [0, 0, 0]\ntime.fps = 10\n[[system]]\n{method}\n\
             [[particles]]\nname = \"p\"\nposition = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]\nmass = [1, 3, 0.5]\n\
             load = [{{ at = {{ center = [0.5, 0, 0], radius = 0.6 }}, force = [\"8*cos(2*t)\", 0, 4] }}, {{ at = \"vertex 2\", force = [0, 1, 0] }}]\n"
        ));
        run(&mut sim, 10);
        let (x, v) = (positions(&sim, "p"), velocities(&sim, "p"));
        // Both have the acceleration F/(m1 + m2), so that nothing pulls them apart.
        for i in [0, 1] {
            let exact = [(1.0 - 2_f64.cos()) / 2.0 + i as f64, 0.0, 0.5];
            assert!((x[i] - Vector::from(exact)).norm() < 4e-4, "{method} {i}: {:?} {exact:?}", x[i]);
            assert!((v[i] - Vector::from([2_f64.sin(), 0.0, 1.0])).norm() < 4e-4, "{method} {i}: {:?}", v[i]);
        }
        assert!((x[2] - Vector::from([2.0, 1.0, 0.0])).norm() < 4e-4, "{method}: {:?}", x[2]);
    }
}

/// A cantilever of a rod under a load at its end sinks by F L³/(3 E I), and one that is held at both ends and loaded in the middle by F L³/(192 E I).
#[test]
fn loaded_beams_sink_as_beams_do() {
    let beam = |pin: &str, at: &str, n: u32| {
        let mut sim = simulation(&format!(
            "precision = \"double\"\nworld.gravity = [0, 0, 0]\ntime.fps = 10\n[[system]]\nintegrator = \"implicit_euler\"\n\
             solver = {{ newton_tolerance = 1e-6, linear_tolerance = 0.01 }}\n[[force]]\nkind = \"drag\"\nrate = 20\n\
             [[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = {n}\ndensity = 0.1\nradius = 0.01\n\
             rod = {{ stretch = 1e6, bend = 2 }}\npin = [{pin}]\nload = [{{ at = \"{at}\", force = [0, 0, -0.06] }}]\n"
        ));
        run(&mut sim, 60);
        assert!(sim.ledger().speed.unwrap() < 1e-6);
        positions(&sim, "r").iter().fold(0.0_f64, |low, x| low.min(x.z))
    };
    let (end, middle) = (beam("\"start\"", "end", 24), beam("\"start\", \"end\"", "vertex 24", 48));
    let [exact_end, exact_middle] = [3.0, 192.0].map(|c| -0.06 / (c * 2.0));
    println!("{:+.3} % {:+.3} %", 100.0 * (end / exact_end - 1.0), 100.0 * (middle / exact_middle - 1.0));
    assert!((end / exact_end - 1.0).abs() < 5e-3, "{end} {exact_end}");
    assert!((middle / exact_middle - 1.0).abs() < 5e-3, "{middle} {exact_middle}");
}

/// A sheet of equal threads hung by one edge, with a line load on the other: each thread carries its share, so that all stretch alike.
#[test]
fn a_load_on_an_edge_is_uniform_along_it() {
    let mut sim = simulation(
        "precision = \"double\"\nworld.gravity = [0, 0, 0]\ntime.fps = 10\n[[system]]\nintegrator = \"implicit_euler\"\n\
         [[force]]\nkind = \"drag\"\nrate = 20\n[[sheet]]\nname = \"s\"\nsize = [1, 0.5]\nresolution = [6, 5]\nlinks = { structural = 40 }\n\
         pin = [\"edge y+\"]\nload = [{ at = \"edge y-\", force = [0, -2, 0] }]\n",
    );
    let start = positions(&sim, "s");
    run(&mut sim, 80);
    // 2 N on 1 m of a modulus of 40 N/m: 5 %.
    for (i, (x, s)) in positions(&sim, "s").iter().zip(&start).enumerate() {
        let exact = Vector { y: s.y - 0.05 * (0.25 - s.y), ..*s };
        assert!((*x - exact).norm() < 1e-6, "{i}: {x:?} {exact:?}");
    }
}

/// A weight on a light spring swings by its mass, and weighs in the ledger.
#[test]
fn an_extra_mass_swings_and_weighs() {
    let mut sim = simulation(
        "precision = \"double\"\nworld.gravity = [0, 0, 0]\ntime.fps = 100\n[[system]]\nintegrator = \"rk4\"\nstep = 1e-3\n\
         [[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 1\ndensity = 0.2\nlinks = { structural = 30 }\npin = [\"start\"]\n\
         point_mass = [{ at = \"end\", mass = 1.1 }]\nvelocity = [0.3, 0, 0]\n",
    );
    // 0.1 kg of the rope and 1.1 kg.
    assert!((sim.ledger().mass - 1.3).abs() < 1e-12, "{}", sim.ledger().mass);
    let rate = (30.0_f64 / 1.2).sqrt();
    run(&mut sim, 70);
    let (x, exact) = (positions(&sim, "r")[1].x - 1.0, 0.3 / rate * (0.7 * rate).sin());
    assert!((x - exact).abs() < 1e-8, "{x} {exact}");
}

/// A load that stays the same has a potential: what it gives is in the ledger.
#[test]
fn a_steady_load_has_a_potential() {
    let mut sim = simulation(
        "precision = \"double\"\nworld.gravity = [0, 0, 0]\ntime.fps = 10\n[[system]]\nintegrator = \"rk4\"\nstep = 1e-2\n\
         [[particles]]\nname = \"p\"\nposition = [[1, 0, 0], [0, 2, 0]]\nmass = [1, 2]\nload = [{ at = \"all\", force = [6, 0, 1] }]\n",
    );
    let start = sim.ledger();
    run(&mut sim, 10);
    let end = sim.ledger();
    assert!(end.kinetic > 6.0 && (end.energy() - start.energy()).abs() < 1e-12 * end.kinetic, "{} {}", end.energy(), start.energy());
}

/// A force on all objects acts on each, wherever their masses stand, in several blocks of rows: what is emitted stands behind all others.
#[test]
fn forces_reach_objects_in_any_order() {
    for method in [
        "integrator = \"symplectic_euler\"\nstep = 1e-3",
        "integrator = \"implicit_euler\"\nstep = 1e-3",
        "method = \"position_based\"\nstep = 1e-3",
    ] {
        let mut sim = simulation(&format!(
            "precision = \"double\"\nworld.gravity = [0, 0, 0]\ntime.fps = 10\n[[system]]\n{method}\n[[force]]\nkind = \"acceleration\"\nvalue = [0, 2, 0]\n\
             [[particles]]\nname = \"p\"\nposition = [[5, 0, 0]]\n\
             [[emitter]]\nname = \"e\"\nfrom.point = {{ at = [9, 0, 0] }}\nburst = [{{ time = 0, count = 3 }}]\n\
             [[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 3\nload = [{{ at = \"start\", force = [0, 0, 1e-3] }}, {{ at = \"end\", force = [0, 0, 1e-3] }}]\n\
             [[sheet]]\nname = \"s\"\nsize = [1, 1]\nresolution = [50, 50]\ncenter = [0, 0, 5]\nlinks = {{ structural = 1 }}\n"
        ));
        run(&mut sim, 10);
        for object in ["p", "e", "r", "s"] {
            let v = velocities(&sim, object);
            assert!(!v.is_empty() && v.iter().all(|v| (v.y - 2.0).abs() < 1e-6), "{method} {object}: {v:?}");
        }
        assert!(velocities(&sim, "r")[0].z > 1e-3 && velocities(&sim, "r")[3].z > 1e-3, "{method}");
    }
}

#[test]
fn loads_on_nothing_are_told() {
    let particles = |words: &str| told(&format!("[[particles]]\nname = \"p\"\nposition = [[0, 0, 0], [1, 0, 0]]\n{words}\n"));
    let held = particles("pin = [\"all\"]\nload = [{ at = \"vertex 1\", force = [0, 0, 1] }]");
    assert!(held.contains("particles \"p\".load[0].at: all of these masses are pinned"), "{held}");
    let far = particles("load = [{ at = { center = [9, 0, 0], radius = 1 }, force = [0, 0, 1] }]");
    assert!(far.contains("load[0].at: no mass lies within 1 m; the nearest is 8.0000 m away"), "{far}");
    let both = particles("load = [{ at = \"vertex 0\", force = \"[t, 1/0, 0]\" }]\npoint_mass = [{ at = \"edge x-\", mass = 1 }]");
    assert!(both.contains("load[0].force") && both.contains("point_mass[0].at"), "{both}");
    let flat = told("dimension = 2\n[[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\nload = [{ at = \"all\", force = [0, 1, 0] }]\n");
    assert!(flat.contains("load[0].force: y = 1, expected 0 in a scene of dimension 2"), "{flat}");
    let tracers = told(
        "[[system]]\nmethod = \"tracers\"\n[[field]]\nkind = \"uniform\"\nvelocity = [1, 0, 0]\n\
         [[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\npoint_mass = [{ at = \"all\", mass = 1 }]\n",
    );
    assert!(tracers.contains("point_mass"), "{tracers}");
}
