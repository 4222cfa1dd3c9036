//! Words of a scene that change in time, by formulas and keyframes, against exact solutions.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, column, every, grid, largest, positions, run, simulation, velocities};
use tumble_f64::scene::Simulation;
use tumble_interface::{Engine, Scene};

fn told(text: &str) -> String {
    let scene = Scene::from_toml(&format!("version = 1\n{text}")).unwrap();
    Simulation::new(scene, Default::default()).err().map(|e| e.to_string()).unwrap_or_default()
}

/// The system of a scheme in steps of h.
fn system(integrator: tumble_interface::scene::Integrator, h: f64) -> String {
    match integrator {
        tumble_interface::scene::Integrator::PositionBased => format!("[[system]]\nmethod = \"position_based\"\nstep = {h:e}\n"),
        _ if integrator.is_adaptive() => format!("[[system]]\nintegrator = \"{}\"\n", integrator.name()),
        _ => format!("[[system]]\nintegrator = \"{}\"\nstep = {h:e}\n", integrator.name()),
    }
}

/// Of fixed steps; adaptive ones are as wrong as their tolerance lets them.
fn bound(integrator: tumble_interface::scene::Integrator, fixed: f64) -> f64 {
    if integrator.is_adaptive() { 0.03 } else { fixed }
}

/// z = -9.8 (1 - cos t) under the gravity -9.8 cos t, by every scheme; and along a parabola of third degree under keyframes.
#[test]
fn masses_fall_under_gravity_that_changes() {
    for integrator in every() {
        for (gravity, exact) in
            [("[0, 0, \"-9.8*cos(t)\"]", -9.8 * (1.0 - 1_f64.cos())), ("{ keys = [[0, 0, 0, 0], [1, 0, 0, -6]] }", -1.0)]
        {
            let mut sim = simulation(&format!(
                "precision = \"double\"\ntime.fps = 10\nworld.gravity = {gravity}\n{}[[particles]]\nname = \"p\"\nposition = [[1, 2, 0]]\n",
                system(integrator, 1e-3)
            ));
            run(&mut sim, 10);
            let z = positions(&sim, "p")[0].z;
            assert!((z - exact).abs() < bound(integrator, 8e-3) * exact.abs(), "{integrator:?} {gravity}: {z} {exact}");
        }
    }
}

/// Warm gas in a box without an end rises by what gravity has been; sound in a column that falls with it feels none.
#[test]
fn gases_feel_gravity_that_changes() {
    let mut sim = simulation(
        "precision = \"double\"\ntime = { fps = 10, frames = 10 }\nworld.gravity = [0, 0, \"-10*t\"]\n[[system]]\nmethod = \"gas\"\nsubsteps = 4\n\
         [[gas]]\nname = \"air\"\nbox = { size = [1, 1, 1], resolution = 4 }\n\
         sides = { x = [\"periodic\", \"periodic\"], y = [\"periodic\", \"periodic\"], z = [\"periodic\", \"periodic\"] }\n\
         temperature = { ambient = 300, initial = 330 }\n",
    );
    run(&mut sim, 10);
    // 10 t x 30/300: a speed of t²/2.
    let (velocity, _) = grid(&sim, "air", "velocity");
    assert!((largest(&velocity) - 0.5).abs() < 1e-12, "{}", largest(&velocity));
    let weight = |gravity: &str| {
        let mut sim = simulation(&format!(
            "precision = \"double\"\ndimension = 2\ntime = {{ fps = 100, frames = 10 }}\nworld.gravity = {gravity}\n\
             [[compressible]]\nname = \"air\"\nbox = {{ size = [1, 1, 1], resolution = 8 }}\ndensity = 1.2\nsound_speed = 20\n"
        ));
        run(&mut sim, 10);
        sim.ledger().momentum[2]
    };
    // Before sound has come from the walls, momentum is that of the whole less what the walls bear: it differs by the course alone.
    let (steady, course) = (weight("[0, 0, -5]"), weight("{ keys = [[0, 0, 0, -5], [1, 0, 0, -5]] }"));
    assert!(steady.abs() > 1e-3 && (course - steady).abs() < 1e-12, "{steady} {course}");
    let off = weight("{ keys = [[0, 0, 0, -5], [0.05, 0, 0, 0]], interpolation = \"step\" }");
    assert!((off - steady).abs() > 0.2 * steady.abs(), "{off} {steady}");
}

/// v = exp(-t²/2) under a drag of the rate t; and wind that dies away.
#[test]
fn drag_changes_in_time() {
    for integrator in every() {
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime.fps = 10\nworld.gravity = [0, 0, 0]\n{}[[force]]\nkind = \"drag\"\nrate = \"t\"\non = [\"p\"]\n\
             [[force]]\nkind = \"wind\"\nrate = {{ keys = [[0, 2], [0.5, 0]] }}\nair = [{{ kind = \"uniform\", velocity = [1, 0, 0] }}]\non = [\"q\"]\n\
             [[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\nvelocity = [[1, 0, 0]]\n\
             [[particles]]\nname = \"q\"\nposition = [[0, 0, 0]]\n",
            system(integrator, 1e-3)
        ));
        run(&mut sim, 10);
        let (v, u) = (velocities(&sim, "p")[0].x, velocities(&sim, "q")[0].x);
        // The rate falls from 2 to 0 in half a second: its integral is a half.
        assert!((v - (-0.5_f64).exp()).abs() < bound(integrator, 2e-3), "{integrator:?}: {v}");
        assert!((u - (1.0 - (-0.5_f64).exp())).abs() < bound(integrator, 2e-3), "{integrator:?}: {u}");
    }
}

/// A mass slides over a floor without friction, which is switched on after half a second: it stops after v²/(2 mu g).
#[test]
fn friction_changes_in_time() {
    // An adaptive step that a jump falls into has the friction of its end.
    for integrator in every().into_iter().filter(|i| !i.is_adaptive()) {
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime.fps = 50\n{}[[collider]]\nname = \"floor\"\nshape.floor = {{}}\n\
             friction = {{ keys = [[0, 0], [0.5, 0.4]], interpolation = \"step\" }}\n\
             [[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\nvelocity = [[1, 0, 0]]\n",
            system(integrator, 1e-3)
        ));
        run(&mut sim, 24);
        assert!((velocities(&sim, "p")[0].x - 1.0).abs() < 1e-12, "{integrator:?}");
        run(&mut sim, 26);
        let (x, exact) = (positions(&sim, "p")[0].x, 0.5 + 1.0 / (2.0 * 0.4 * 9.8));
        assert!((x - exact).abs() < 4e-3 && velocities(&sim, "p")[0].x.abs() < 2e-3, "{integrator:?}: {x} {exact}");
    }
}

/// A winch reels a weight in: its length less the stretch under the weight, within a system under every scheme, and between two systems.
#[test]
fn a_winch_reels_a_weight_in() {
    let scene = |systems: &str, of: &str, stiffness: f64| {
        format!(
            "precision = \"double\"\ntime = {{ fps = 20, exchanges = 50 }}\n{systems}\
             [[particles]]\nname = \"hook\"\nposition = [[0, 0, 2]]\npin = [\"all\"]\nmass = [1]\n\
             [[particles]]\nname = \"weight\"\nposition = [[0, 0, 1]]\nmass = [2]\n{of}\
             [[anchor]]\nname = \"winch\"\nbetween = [\"hook 0\", \"weight 0\"]\nstiffness = {stiffness:e}\ndamping = 60\n\
             rest_length = {{ keys = [[0.5, 1.0], [2.5, 0.4]] }}\n"
        )
    };
    let two = "[[system]]\nname = \"a\"\n[[system]]\nname = \"b\"\n";
    let all = every().into_iter().map(|i| (format!("{i:?}"), system(i, 5e-4), "")).chain([(
        "two systems".into(),
        two.into(),
        "system = \"b\"\n",
    )]);
    for (name, systems, of) in all {
        // Forward Euler needs the damping.
        let mut sim = simulation(&scene(&systems, of, 2e3));
        run(&mut sim, 40);
        let z = positions(&sim, "weight")[0].z;
        // Moving steadily at t = 2.0 s, 0.55 m long and stretched by m g/k; the dashpot moves with the reel.
        let speed = velocities(&sim, "weight")[0].z;
        let exact = 2.0 - 0.55 - 2.0 * 9.8 / 2e3 - 60.0 * 0.3 / 2e3;
        assert!((z - exact).abs() < 2e-3, "{name}: {z} {exact}");
        assert!((speed - 0.3).abs() < 5e-3, "{name}: {speed}");
        // What it has stored is in the ledger.
        let stored = 0.5 * 2e3 * (2.0 - z - 0.55).powi(2);
        let (elastic, between) = (sim.ledger().elastic, sim.ledger().external - 9.8 * (2.0 * z + 2.0));
        assert!((elastic + between - stored).abs() < 1e-9 * (1.0 + stored), "{name}: {elastic} {between} {stored}");
    }
}

/// A muscle: a mass on a spring of no length whose stiffness changes in time, against the equation itself by small steps of its own.
#[test]
fn a_muscle_pulls_as_its_stiffness_says() {
    let (mut x, mut v, n) = (0.5_f64, 0.0, 200_000);
    let (h, k) = (1.5 / f64::from(n), |t: f64| 20.0 + 15.0 * (3.0 * t).sin());
    for i in 0..n {
        // Leapfrog.
        let t = f64::from(i) * h;
        v -= 0.5 * h * k(t) * x;
        x += h * v;
        v -= 0.5 * h * k(t + h) * x;
    }
    for (name, h, bound) in
        [("rk4", 1e-3, 1e-8), ("implicit_midpoint", 1e-3, 1e-5), ("implicit_euler", 1e-4, 2e-3), ("position_based", 1e-4, 2e-3)]
    {
        let words = if name == "position_based" { "method" } else { "integrator" };
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime.fps = 10\nworld.gravity = [0, 0, 0]\n[[system]]\n{words} = \"{name}\"\nstep = {h:e}\n\
             [[particles]]\nname = \"a\"\nposition = [[0, 0, 0], [0.5, 0, 0]]\npin = [\"vertex 0\"]\n\
             [[anchor]]\nname = \"muscle\"\nbetween = [\"a 0\", \"a 1\"]\nstiffness = \"20 + 15*sin(3*t)\"\nrest_length = 0\n"
        ));
        run(&mut sim, 15);
        let found = positions(&sim, "a")[1].x;
        assert!((found - x).abs() < bound, "{name}: {found} {x}");
    }
}

/// What changes by a jump brings energy, and is no explosion: gravity, also for what is born, a load, a muscle.
#[test]
fn a_jump_is_no_explosion() {
    let gravity = "world.gravity = { keys = [[0, 0, 0, 0], [0.5, 0, 0, -9.8]], interpolation = \"step\" }\n";
    let mut sim = simulation(&format!(
        "precision = \"double\"\ntime.fps = 50\n{gravity}[[system]]\nsubsteps = 20\n[[particles]]\nname = \"p\"\nposition = [[0, 0, 10]]\nvelocity = [[0.1, 0, 0]]\n"
    ));
    run(&mut sim, 50);
    assert!((velocities(&sim, "p")[0].z + 4.9).abs() < 0.02, "{:?}", velocities(&sim, "p"));
    let mut sim = simulation(&format!(
        "precision = \"double\"\ntime.fps = 50\n{gravity}[[system]]\nsubsteps = 20\n[[emitter]]\nname = \"e\"\nfrom.point = {{ at = [0, 0, 10] }}\nrate = 20\n\
         velocity = [0.1, 0, 0]\nlifetime = 5\n"
    ));
    run(&mut sim, 50);
    assert!(velocities(&sim, "e")[0].z < -4.0);
    let mut sim = simulation(
        "precision = \"double\"\ntime.fps = 50\nworld.gravity = [0, 0, 0]\n[[system]]\nsubsteps = 20\n\
         [[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\nvelocity = [[0.01, 0, 0]]\nload = [{ at = \"all\", force = [\"10*t\", 0, 0] }]\n",
    );
    run(&mut sim, 50);
    assert!((velocities(&sim, "p")[0].x - 5.01).abs() < 0.02);
    for method in ["integrator = \"symplectic_euler\"", "method = \"position_based\""] {
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime.fps = 50\nworld.gravity = [0, 0, 0]\n[[system]]\n{method}\nsubsteps = 40\n\
             [[particles]]\nname = \"p\"\nposition = [[0, 0, 0], [1, 0, 0]]\nvelocity = [[0, 0.1, 0]]\n\
             [[anchor]]\nname = \"muscle\"\nbetween = [\"p 0\", \"p 1\"]\nrest_length = 0\n\
             stiffness = {{ keys = [[0, 0], [0.3, 1e3]], interpolation = \"step\" }}\n"
        ));
        run(&mut sim, 40);
        let x = positions(&sim, "p");
        assert!((x[1] - x[0]).norm() < 1.05 && sim.ledger().speed.unwrap() > 1.0, "{method}: {x:?}");
    }
}

/// A run that goes on from a checkpoint is bit for bit the whole one, whatever changes meanwhile and where its steps come from.
#[test]
fn a_restored_run_sees_what_the_whole_one_sees() {
    let text = "precision = \"double\"\ntime = { fps = 10, frames = 20 }\nworld.gravity = [0, 0, \"-9.8*(1 + t)\"]\n\
         [[system]]\nname = \"masses\"\n[[system]]\nname = \"air\"\nmethod = \"gas\"\n\
         [[gas]]\nname = \"air\"\nbox = { size = [1, 1, 1], resolution = 8 }\nsmoke = {}\n\
         temperature = { ambient = 300, initial = \"300 + 60*smoothstep(0.4, 0.1, hypot(x, y, z))\" }\n\
         [[force]]\nkind = \"drag\"\nrate = \"0.1 + t\"\n[[collider]]\nname = \"floor\"\nshape.floor = { height = -2 }\nfriction = \"0.2*t\"\n\
         [[rope]]\nname = \"r\"\nfrom = [3, 0, 0]\nto = [4, 0, 0]\nsegments = 6\nload = [{ at = \"end\", force = [\"sin(t)\", 0, 0] }]\n\
         [[particles]]\nname = \"p\"\nposition = [[3, 0, 1]]\npin = [\"all\"]\n\
         [[anchor]]\nname = \"winch\"\nbetween = [\"p 0\", \"r 0\"]\nstiffness = \"200 + 100*t\"\nrest_length = { keys = [[0, 1], [2, 0.5]] }\n";
    let mut whole = simulation(text);
    run(&mut whole, 8);
    let saved = whole.save(&[]);
    run(&mut whole, 5);
    let mut again = simulation(text);
    again.restore(&saved).unwrap();
    run(&mut again, 5);
    assert_eq!(whole.ledger(), again.ledger());
    for (object, name) in [("r", "position"), ("r", "velocity")] {
        assert_eq!(column(&whole, object, name), column(&again, object, name));
    }
    assert_eq!(grid(&whole, "air", "velocity_z"), grid(&again, "air", "velocity_z"));
    assert!(largest(&grid(&whole, "air", "velocity_z").0) > 0.1);
}

/// Steps that nobody sets are short enough for the largest of what changes, wherever it falls between frames.
#[test]
fn automatic_steps_foresee_what_grows() {
    let mut sim = simulation(
        "precision = \"double\"\ntime.fps = 24\nworld.gravity = [0, 0, 0]\n[[force]]\nkind = \"drag\"\ncoefficient = \"1000*t\"\n\
         [[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\nvelocity = [[1, 0, 0]]\n",
    );
    run(&mut sim, 48);
    assert!(velocities(&sim, "p")[0].norm() < 1e-6 && positions(&sim, "p")[0].x < 0.1, "{:?}", velocities(&sim, "p"));
    let mut sim = simulation(
        "precision = \"double\"\ntime.fps = 24\nworld.gravity = [0, 0, 0]\n\
         [[particles]]\nname = \"p\"\nposition = [[0, 0, 0], [0.5, 0, 0]]\npin = [\"vertex 0\"]\n\
         [[anchor]]\nname = \"m\"\nbetween = [\"p 0\", \"p 1\"]\nrest_length = 0.4\nstiffness = \"1e4*abs(sin(pi*24*t))\"\n",
    );
    let report = run(&mut sim, 24);
    // omega is 100/s: a step of 0.7 of 2/omega, three in a frame, where the stiffness of the start asks for one.
    assert!(report.steps >= 3 * 24 && positions(&sim, "p")[1].norm() < 0.6, "{} {:?}", report.steps, positions(&sim, "p"));
}

/// Where it stands says so, all at once, and constants give the bits of before.
#[test]
fn what_is_wrong_in_time_is_told() {
    let all = told(
        "world.gravity = [0, 0, \"-1/t\"]\n[[force]]\nkind = \"drag\"\nrate = \"1 - t\"\n[[force]]\nkind = \"drag\"\nquadratic = -1\n\
         [[collider]]\nname = \"floor\"\nshape.floor = {}\nfriction = \"0.5*t\"\nfriction_static = 0.2\n\
         [[particles]]\nname = \"p\"\nposition = [[0, 0, 0], [1, 0, 0]]\n\
         [[anchor]]\nname = \"w\"\nbetween = [\"p 0\", \"p 1\"]\nstiffness = \"x\"\nrest_length = { keys = [[0, 1], [1, -1]] }\n",
    );
    for part in [
        "world.gravity: [0, 0, -inf] at t = 0 s",
        "force[0].rate: ",
        "force[1].quadratic: -1, expected >= 0",
        "collider \"floor\".friction_static: 0.2 at t = ",
        "anchor \"w\".stiffness: ",
        "anchor \"w\".rest_length: -0.",
    ] {
        assert!(all.contains(part), "{part}: {all}");
    }
    let flat = told("dimension = 2\nworld.gravity = [0, \"t\", -9.8]\n[[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\n");
    assert!(flat.contains("world.gravity: y = "), "{flat}");
    let falls = |gravity: &str| {
        let mut sim = simulation(&format!(
            "world.gravity = {gravity}\n[[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 9\npin = [\"start\"]\n"
        ));
        run(&mut sim, 5);
        column(&sim, "r", "position")
    };
    assert_eq!(falls("[0, 0, -9.8]"), falls("{ keys = [[0, 0, 0, -9.8]] }"));
    assert_ne!(falls("[0, 0, -9.8]"), vec![Vector::default(); 10]);
}

/// A mass on a box that grows is lifted at the speed of its top, whatever the scheme; it rests on one that has another size from the start.
#[test]
fn solids_change_their_size() {
    for integrator in every() {
        let scene = |height: f64, motion: &str| {
            simulation(&format!(
                "precision = \"double\"\ntime = {{ fps = 50, frames = 100 }}\n{}[[particles]]\nname = \"p\"\nposition = [[0.03, 0.02, {height}]]\n\
                 [[collider]]\nname = \"box\"\nshape.box = {{ center = [0, 0, 0.3], size = [0.4, 0.4, 0.4] }}\nmotion = {{ pivot = [0, 0, 0.1], {motion} }}\n",
                system(integrator, 2e-3)
            ))
        };
        let mut sim = scene(0.5, "scale = { keys = [[0, 1], [1, 1.5], [2, 1.5]] }");
        run(&mut sim, 25);
        let (x, v) = (positions(&sim, "p")[0], velocities(&sim, "p")[0]);
        // The top is 0.4 m above the pivot. Implicit schemes let a mass sink in by fractions of a millimetre.
        assert!((x.z - 0.1 - 0.4 * 1.25).abs() < 2e-3 && (v.z - 0.2).abs() < 0.03, "{integrator:?}: {x:?} {v:?}");
        run(&mut sim, 75);
        // In flight for v²/2g = 2 mm at the end of the growth.
        assert!((positions(&sim, "p")[0].z - 0.7).abs() < 2e-3, "{integrator:?}: {:?}", positions(&sim, "p"));
        let mut large = scene(0.91, "scale = 2");
        run(&mut large, 10);
        assert!((positions(&large, "p")[0].z - 0.9).abs() < 2e-3, "{integrator:?}: {:?}", positions(&large, "p"));
    }
}

/// The surface of a solid that breathes is where its formula says at every frame; frames tell its vertices.
#[test]
fn the_surface_of_a_solid_that_breathes_is_in_frames() {
    let mut sim = simulation(
        "precision = \"double\"\ntime = { fps = 25, frames = 10 }\n[[particles]]\nname = \"p\"\nposition = [[9, 0, 0]]\n[[collider]]\nname = \"box\"\n\
         shape.box = { center = [1, 0, 0], size = [1, 2, 4] }\nmotion = { scale = \"1 + 0.5*sin(9*t)\", velocity = [0, 0, 3], pivot = [1, 0, 0] }\n",
    );
    run(&mut sim, 7);
    let (corners, t) = (column(&sim, "box", "position"), 7.0 / 25.0);
    let size = 1.0 + 0.5 * f64::sin(9.0 * t);
    assert!(corners.iter().all(|x| ((*x - Vector::from([1.0, 0.0, 0.0])).norm() - size * 21_f64.sqrt() / 2.0).abs() < 1e-9), "{corners:?}");
    assert!((column(&sim, "box", "translation")[0].z - 3.0 * t).abs() < 1e-12);
}

#[test]
fn a_size_that_cannot_be_is_told() {
    let of = |shape: &str, scale: &str| {
        told(&format!(
            "time = {{ fps = 10, frames = 20 }}\n[[particles]]\nname = \"p\"\nposition = [[9, 0, 9]]\n[[collider]]\nname = \"c\"\nshape = {{ {shape} }}\n\
             motion.scale = {scale}\n"
        ))
    };
    let sphere = "sphere = { center = [0, 0, 0], radius = 1 }";
    for (shape, scale, expected) in [
        (sphere, "\"1 - t\"", "collider \"c\".motion.scale: 0 at t = 1 s, expected > 0"),
        (sphere, "-2", "collider \"c\".motion.scale: -2, expected > 0"),
        (sphere, "\"1 + y\"", "collider \"c\".motion.scale: "),
        (sphere, "{ keys = [[0, 1], [1, 2]], interpolation = \"step\" }", "a surface cannot jump"),
        ("floor = {}", "2", "a plane has no size"),
        ("mannequin = {}", "2", "its own frames say"),
    ] {
        let error = of(shape, scale);
        assert!(error.contains(expected), "{shape} {scale}: {error}");
    }
    assert_eq!(of(sphere, "{ keys = [[0, 1], [1, 2]], interpolation = \"smooth\" }"), "");
}

/// A camera that moves is checked at all frames and keys, each word once, with the first time and a cure; one that stands as before.
#[test]
fn cameras_that_see_nothing_are_told() {
    let camera =
        |words: &str| told(&format!("{words}\n[time]\nfps = 10\nframes = 20\n[[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\n"));
    let fine = "camera = { position = \"[sin(t), -3, 1]\", target = { keys = [[0, 0, 0, 0], [3, 1, 0, 0]], interpolation = \"smooth\" }, \
                view_angle = { keys = [[0, 35], [1, 20]] } }";
    assert_eq!(camera(fine), "");
    // Through the target at t = 1 s, whatever the words; a key after the end counts, too.
    let through = camera("camera = { position = { keys = [[0, -1, 0, 1], [2, 1, 0, 1]] }, target = [0, 0, 1] }");
    assert!(through.contains("camera.position: [0, 0, 1] at t = 1 s, which is the target, too") && through.contains("keep them apart"));
    let late = camera("camera = { position = { keys = [[0, 1, 0, 0], [7, 2, 0, 0]] }, target = [2, 0, 0] }");
    assert!(late.contains("at t = 7 s"), "{late}");
    let always = camera("camera = { position = [1, 2, 3], target = [1, 2, 3] }");
    assert!(always.contains("camera.position: [1, 2, 3], which is the target, too"), "{always}");
    // All at once.
    let all =
        camera("camera = { position = [\"1/(t-1)\", 0, 0], target = [0, \"x\", 0], view_angle = { keys = [[0, 35], [1, 170], [2, 35]] } }");
    assert!(all.contains("camera.target: ") && all.contains("\"x\""), "{all}");
    let all = camera("camera = { position = [\"1/(t-1)\", 0, 0], view_angle = { keys = [[0, 35], [1, 170], [2, 35]] } }");
    assert!(all.contains("camera.position: [inf, 0, 0] at t = 1 s, expected finite numbers"), "{all}");
    assert!(all.contains("camera.view_angle: 170 ° at t = 1 s, expected > 0 and < 170 °"), "{all}");
    let closed = camera("camera.view_angle = \"35 - 35*t\"");
    assert!(closed.contains("camera.view_angle: 0 ° at t = 1 s"), "{closed}");
    assert!(camera("camera.view_angle = 0").contains("camera.view_angle: 0 °, expected > 0"));
    // A plane is seen from the side, as much of it as the distance says, which 0 does not.
    let flat = |words: &str| camera(&format!("dimension = 2\n{words}"));
    let within = flat("camera.position = \"[0, t - 1, 0]\"");
    assert!(within.contains("camera.position: [0, 0, 0] at t = 1 s, expected a y other than 0"), "{within}");
    assert_eq!(flat("camera.position = [0, 0, 0]"), "");
    assert_eq!(flat("camera.position = \"[t, -3, 0]\""), "");
}

/// What fronts ask for: keys exactly, half-way between them the mean, and formulas by their value.
#[test]
fn cameras_follow_their_words() {
    use tumble_f64::scene::Camera;
    let camera = |words: &str| Camera::new(&Scene::from_toml(&format!("version = 1\n{words}")).unwrap().camera).unwrap();
    let moving = camera("camera = { position = { keys = [[1, 0, -3, 0], [3, 4, -3, 2]] }, view_angle = \"35 + 5*t\" }");
    for (t, position) in [(0.0, [0.0, -3.0, 0.0]), (1.0, [0.0, -3.0, 0.0]), (2.0, [2.0, -3.0, 1.0]), (9.0, [4.0, -3.0, 2.0])] {
        let sight = moving.at(t);
        assert_eq!((sight.position, sight.target, sight.view_angle), (Some(position), None, 35.0 + 5.0 * t));
    }
    assert!(!moving.stands() && camera("camera.target = [1, 2, 3]").stands());
}
