//! The same scene gives the same bits: on any count of threads, after saving and restoring, beside an unrelated object, and after a
//! failed or abandoned step. `crates/tumble-f64/tests/determinism.rs` runs this file again in double precision.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

use std::fmt::Write;
use tumble::scene::Simulation;
use tumble_interface::engine::Engine;
use tumble_interface::{Scene, StepError};

fn simulation(text: &str) -> Simulation {
    let scene = Scene::from_toml(&format!("version = 1\n{text}")).unwrap_or_else(|e| panic!("{e}"));
    Simulation::new(scene, Default::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn run(sim: &mut Simulation, frames: usize) {
    for _ in 0..frames {
        sim.step(&|| true).unwrap_or_else(|e| panic!("{e}")).unwrap();
    }
}

/// A sheet that falls on a ball; 4356 masses are more than one chunk of the parallel loops.
fn sheet(system: &str, links: &str) -> String {
    format!(
        "time.fps = 60\n[[system]]\n{system}\n[[sheet]]\nname = \"sheet\"\nsize = [1, 1]\nresolution = [66, 66]\ndensity = 1\ncenter = [0.02, 0.01, 0.305]\n{links}\n\
         [[collider]]\nname = \"ball\"\nfriction = 0.4\nshape.sphere.radius = 0.3\n"
    )
}

/// Name, scene, frames: every kind of element, contact, memory and solver.
fn scenes() -> Vec<(&'static str, String, usize)> {
    // More than one chunk, two materials, a wall that moves, and a body that yields.
    let sand = "time.fps = 60
        [[system]]\nname = \"sand\"\nmethod = \"grains\"\nstep = 4e-4\n[[system]]\nname = \"bodies\"\nmethod = \"rigid\"
        [[grains]]\nname = \"fine\"\nradius = 0.02\nradius_spread = 0.2\nrolling_friction = 0.1\nyoung = 1e6
        fill = [{ center = [0, 0, 0.3], size = [0.6, 0.6, 0.5] }]
        [[grains]]\nname = \"coarse\"\nradius = 0.03\ncohesion = 2\nyoung = 1e6\nfill = [{ center = [0, 0, 0.7], size = [0.5, 0.5, 0.3] }]
        [[body]]\nname = \"brick\"\nshape = { box = { size = [0.3, 0.2, 0.1] } }\nposition = [[0, 0, 1]]\nrotate = [[10, 20, 0]]\nvelocity = [[0, 0, -3]]
        [[collider]]\nname = \"bin\"\nshape = { box = { center = [0, 0, 1], size = [0.64, 0.64, 2] } }\ninside = true
        [[collider]]\nname = \"rod\"\nshape = { capsule = { from = [-0.2, -0.5, 0.1], to = [-0.2, 0.5, 0.1], radius = 0.03 } }\nmotion = { velocity = [0.5, 0, 0] }\n";
    let hinges = "hinge = 2e-5\nlinks = { structural = { modulus = 50, damping = 0.005 }, shear = 20 }";
    let links = "links = { structural = { modulus = 50, damping = 0.005 }, shear = 20, bend = 2 }";
    let air = "[[force]]\nkind = \"air\"\nwind = [{ kind = \"uniform\", velocity = [\"6*sin(9*t)\", 3, 2] }, { kind = \"turbulence\", strength = 2, scale = 0.3 }]\n";
    let ripping = "tear = { strain = 0.01, spread = 0.3 }\nlinks = { structural = 60, shear = 30, bend = 1 }\nhinge = 1e-5\npin = [\"corner 0 0\", \"corner 1 1\"]";
    let torn = "links = { structural = { modulus = 20, break_strain = 0.01 }, shear = 8 }\npin = [\"corner 0 0\", \"corner 1 1\"]";
    let mut dust = String::from(
        "[[system]]\nintegrator = \"velocity_verlet\"\nsubsteps = 3\n[[force]]\nkind = \"drag\"\nrate = 0.3\n[[particles]]\nname = \"dust\"\nposition = [",
    );
    let mut tracers = String::from(
        "[[system]]\nmethod = \"tracers\"\nintegrator = \"heun\"\nsubsteps = 3\n[[field]]\nkind = \"swirl\"\nrate = 2\n[[particles]]\nname = \"smoke\"\nposition = [",
    );
    for i in 0..10_000 {
        let t = f64::from(i);
        write!(dust, "[{}, {}, {}],", (t * 0.37).sin(), (t * 0.11).cos(), (t * 0.0731).sin() + 1.0).unwrap();
        write!(tracers, "[{}, {}, {}],", (t * 0.37).sin(), (t * 0.11).cos(), (t * 0.0731).sin()).unwrap();
    }
    dust += "]\n[[collider]]\nname = \"floor\"\nrestitution = 0.3\nfriction = 0.2\nshape.floor.height = 0\n";
    let stirred = dust.clone()
        + "[[collider]]\nname = \"paddle\"\nrestitution = 0.5\nfriction = 0.2\nmotion = { spin = [0, 0, 9], keys = [{ time = 0 }, { time = 0.2, translate = [0, 0, 0.5], rotate = [20, 0, 90] }] }\n\
           shape.capsule = { from = [-1, 0, 0.5], to = [1, 0, 0.5], radius = 0.2 }\n\
           [[collider]]\nname = \"room\"\ninside = true\nrestitution = 0.8\nmotion.velocity = [3, 0, 0]\nshape.box = { center = [0, 0, 1], size = [2.5, 2.5, 2.5] }\n";
    tracers += "]\n";
    let vicsek = "dimension = 2\n[[system]]\nmethod = \"vicsek\"\nsubsteps = 3\nvicsek = { side = 20, radius = 1, speed = 1, noise = 0.5 }\n\
                  [[particles]]\nname = \"p\"\ncloud = { count = 9000, size = [20, 0, 20] }\n";
    let rod = "[[system]]\nintegrator = \"SCHEME\"\nsubsteps = N\n[[rope]]\nname = \"rod\"\nfrom = [0, 0, 0]\nto = [0.6, 0.2, 0.4]\nsegments = 60\npin = [\"start\"]\n\
               rod = { stretch = 100, bend = 1e-3, twist = 1e-3, inertia = 1e-4, damping = 1e-4 }\n";
    let rod = |scheme, n| rod.replace("SCHEME", scheme).replace("= N", n);
    let jelly = "[[system]]\nintegrator = \"symplectic_euler\"\nsubsteps = 10\n[[block]]\nname = \"jelly\"\nsize = [0.3, 0.3, 0.3]\nresolution = [17, 17, 15]\ncenter = [0, 0, 0.155]\n\
                 material = { young = 2000, poisson = 0.4, damping = 0.002 }\n[[collider]]\nname = \"floor\"\nfriction = 0.3\nshape.floor.height = 0\n";
    let plume = "[[gas]]\nname = \"air\"\nbox = { size = [1, 1, 1.5], resolution = 33 }\nsides = { x = [\"periodic\", \"periodic\"], z = [\"no_slip\", \"open\"] }\n\
                 smoke = { initial = \"smoothstep(0.4, 0.2, hypot(x, y, z))\" }\ntemperature = { ambient = 300 }\nviscosity = 1e-3\nconfinement = 0.2\ncourant = 2\n\
                 advection.velocity.corrected = true\n[[gas.source]]\nshape = { sphere = { center = [0.1, 0, -0.3], radius = 0.25 } }\ntemperature = 400\n";
    let stirring = plume.replace("viscosity", "solids = \"no_slip\"\nviscosity")
        + "[[collider]]\nname = \"ball\"\nmotion = { velocity = [0.5, 0.2, 0.7], spin = [0, 5, 0] }\nshape.sphere = { center = [-0.2, 0.1, 0], radius = 0.17 }\n\
           [[collider]]\nname = \"floor\"\nshape.floor.height = -0.7\n";
    let fire = stirring
        .replace("[[gas]]", "[[system]]\nname = \"air\"\nmethod = \"gas\"\n[[system]]\nname = \"dust\"\nmethod = \"tracers\"\nintegrator = \"heun\"\n[[gas]]")
        .replace("viscosity = 1e-3", "densities = \"variable\"\nfire = { ignition = 350, burn_time = 0.1, soot = 0.1, heat = 1e7, expansion = 30 }\nviscosity = 1e-3")
        .replace("{ ambient = 300 }", "{ ambient = 300, radiation = 1000 }")
        .replace("temperature = 400", "temperature = 600\nfuel_density = 0.03")
        + "[[field]]\nkind = \"gas\"\nof = \"air\"\n[[emitter]]\nname = \"dust\"\nsystem = \"dust\"\nrate = 40000\nlifetime = 0.4\nfrom.sphere = { center = [0.1, 0, -0.3], radius = 0.3 }\n";
    let rope = "[[system]]\nintegrator = \"bdf2\"\nsolver.linear = \"cholesky\"\n[[rope]]\nname = \"rope\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nlength = 1.2\nsegments = 40\npin = [\"start\", \"end\"]\n";
    let spray = "[[system]]\nintegrator = \"velocity_verlet\"\nsubsteps = 3\n[[force]]\nkind = \"drag\"\nrate = 0.3\n\
                 [[emitter]]\nname = \"spray\"\nrate = 60000\njitter = 1\nspeed = 3\ncone = 20\nlifetime = 0.4\nlifetime_spread = 0.5\nmass_spread = 0.3\nfrom.disk.radius = 0.1\n\
                 columns = { heat = { from = 1, to = 2 } }\nkill = [{ near_collider = 0.001 }]\n\
                 [[emitter]]\nname = \"mist\"\nburst = [{ count = 2 }]\nspeed = 1\ncone = 180\ninherit = 0.5\nlifetime = 0.1\nfrom.particles.of = \"spray\"\n\
                 [[collider]]\nname = \"floor\"\nshape.floor.height = -0.2\n";
    let splashing = spray
        .replace("speed = 3", "speed = -3")
        .replace("kill = [{ near_collider = 0.001 }]", "most = 9000\nwhen_full = \"replace_oldest\"")
        + "[[emitter]]\nname = \"splash\"\nburst = [{ count = 2 }]\nspeed = 1\ncone = 60\nlifetime = 0.1\nfrom.particles = { of = \"spray\", at = \"bounce\" }\n";
    let swarm = "world.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"rk4\"\nsubsteps = 2\n[[force]]\nkind = \"gravitation\"\nconstant = 1e-4\nsoftening = 0.05\n\
                 [[emitter]]\nname = \"swarm\"\nrate = 1500\nspeed = 0.3\ncone = 180\nlifetime = 0.5\nlifetime_spread = 0.3\nfrom.sphere.radius = 0.3\n\
                 [[particles]]\nname = \"sun\"\nposition = [[0.1, 0, 0]]\nmass = [100]\n";
    let stars = "world.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"velocity_verlet\"\nsubsteps = 2\n[[force]]\nkind = \"gravitation\"\nconstant = 1\nsoftening = 0.1\n\
                 [[force]]\nkind = \"electrostatics\"\nconstant = 1e-3\nsoftening = 0.1\n[[galaxy]]\nname = \"g\"\nstars = 4200\nmass = 1\nlength = 1\nradius = 0.01\n\
                 halo = { mass = 4, radius = 2 }\n[[particles]]\nname = \"ions\"\nposition = [[0.1, 0, 1], [0.3, 1, 0], [2, 1, 1]]\ncharge = [1, -1, 2]\n";
    let smoke = "[[system]]\nmethod = \"tracers\"\nintegrator = \"rk4\"\nsubsteps = 2\n[[field]]\nkind = \"swirl\"\nrate = 3\n[[field]]\nkind = \"turbulence\"\nstrength = 0.3\nscale = 0.4\n\
                 [[emitter]]\nname = \"smoke\"\nrate = \"20000*(1 + sin(9*t))\"\npath = \"[0.3*cos(5*t), 0.3*sin(5*t), 0]\"\nlifetime = 0.5\nlifetime_spread = 0.2\nfrom.sphere.radius = 0.1\n\
                 [[particles]]\nname = \"three\"\nposition = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n";
    let hair = "[[system]]\nmethod = \"position_based\"\nsubsteps = 10\n[[collider]]\nname = \"head\"\nthickness = 0.002\nfriction = 0.3\nshape.sphere.radius = 0.1\n\
                motion = { spin = [0, 3, 0], keys = [{ time = 0 }, { time = 0.2, translate = [0.1, 0, 0.1], rotate = [0, 40, 0] }] }\n\
                [[hair]]\nname = \"hair\"\non = \"head\"\ncount = 301\nlength = 0.12\nspread = 0.3\nsegments = 14\nlean = [0.3, 0, 0.2]\ncurl = { radius = 0.02, pitch = 0.05 }\n\
                clump = { count = 20 }\ndamping = 0.01\ncollisions = { cell = 0.015, friction = 8, pressure = 0.02 }\n";
    let surface = "hinge = 1e-5\nisometric = 1e-5\nmembrane = { warp = 50, weft = 30, angle = 20, damping = 1e-4 }\narea = 5";
    let shape = "[[system]]\nmethod = \"position_based\"\nsubsteps = 4\nposition_based.iterations = 2\n[[block]]\nname = \"b\"\nsize = [0.3, 0.3, 0.3]\nresolution = [17, 17, 17]\n\
                 center = [0, 0, 0.2]\nrotate = [20, 30, 0]\nshape_matching.frequency = 5\n[[collider]]\nname = \"floor\"\nfriction = 0.3\nshape.floor.height = 0\n";
    let thrown = "[[system]]\nmethod = \"position_based\"\nsubsteps = 10\n[[block]]\nname = \"large\"\nsize = [0.3, 0.3, 0.3]\nresolution = [17, 17, 17]\n\
                  center = [0, 0, 0.3]\nrotate = [20, 30, 0]\nvelocity = [1, 0, -2]\nshape_matching = {}\n\
                  [[block]]\nname = \"small\"\nsize = [0.2, 0.2, 0.2]\nresolution = [4, 4, 4]\ncenter = [1, 0, 0.2]\nrotate = [0, 10, 40]\nvelocity = [2, 0, -2]\nshape_matching = {}\n\
                  [[collider]]\nname = \"floor\"\nfriction = 0.3\nrestitution = 0.4\nshape.floor.height = 0\n";
    let pool = "[[system]]\nmethod = \"position_based\"\nsubsteps = 8\n[[particles]]\nname = \"water\"\n\
                fluid = { spacing = 0.02, viscosity = 0.5, fill = [{ center = [-0.1, 0, 0.2], size = [0.32, 0.36, 0.4] }] }\n\
                [[collider]]\nname = \"tank\"\ninside = true\nshape.box = { center = [0, 0, 0.4], size = [0.6, 0.4, 0.8] }\n";
    let dam = "time.fps = 50\n[[liquid]]\nname = \"water\"\nTRANSFER\nbox = { size = [1, 0.6, 0.8], center = [0.5, 0.3, 0.4], resolution = 24 }\n\
               fill = [{ shape = { box = { center = [0.2, 0.3, 0.3], size = [0.4, 0.6, 0.6] } } },\n\
                       { shape = { sphere = { center = [0.7, 0.3, 0.5], radius = 0.13 } }, velocity = [0.3, \"sin(9*x)\", 0] }]\n\
               [[collider]]\nname = \"post\"\nshape.capsule = { from = [0.7, ACROSS, 0], to = [0.7, ACROSS, 0.3], radius = 0.08 }\n\
               [[collider]]\nname = \"paddle\"\nmotion = { velocity = [-0.4, 0, 0.2], spin = [0, 2, 0] }\nshape.box = { center = [0.9, ACROSS, 0.1], size = [0.1, 0.4, 0.2] }\n";
    vec![
        ("sheet, air, position based", sheet("method = \"position_based\"\nsubsteps = 8", links) + air, 20),
        ("sheet, air, explicit", sheet("integrator = \"rk4\"\nsubsteps = 24", links) + air, 6),
        ("sheet, air, implicit", sheet("integrator = \"implicit_euler\"", hinges) + air, 6),
        (
            "sheet, ripping, position based",
            sheet("method = \"position_based\"\nsubsteps = 12\nself_contact.thickness = 0.004", ripping) + air,
            12,
        ),
        (
            "sheet, edges of a moving solid",
            sheet("method = \"position_based\"\nsubsteps = 8\nself_contact = { thickness = 0.004, friction = 0.2 }", hinges)
                + "[[collider]]\nname = \"wire\"\nedges = true\nfriction = 0.4\nthickness = 0.002\nmotion = { velocity = [0, 0, 0.4], spin = [0, 0, 2] }\n\
                   shape.capsule = { from = [-0.6, 0.1, 0.28], to = [0.6, 0.1, 0.28], radius = 0.002 }\n",
            8,
        ),
        ("sheet, ripping", sheet("integrator = \"velocity_verlet\"\nsubsteps = 30", ripping) + air, 12),
        ("sheet, membrane", sheet("method = \"position_based\"\nsubsteps = 8", surface), 10),
        (
            "sheet, membrane, implicit",
            sheet("integrator = \"implicit_euler\"\nsolver = { newton_tolerance = 1e-3, linear_tolerance = 1e-2 }", surface),
            6,
        ),
        ("block, shape", shape.to_string(), 10),
        ("blocks, rigid, thrown", thrown.to_string(), 20),
        ("pool", pool.to_string(), 6),
        ("dam, affine", dam.replace("TRANSFER", "").replace("ACROSS", "0.3"), 8),
        ("dam, FLIP", dam.replace("TRANSFER", "transfer = \"flip\"").replace("ACROSS", "0.3"), 8),
        (
            "dam, PIC, in a plane",
            format!("dimension = 2\n{}", dam.replace("TRANSFER", "transfer = \"pic\"").replace("ACROSS", "0").replace("\"sin(9*x)\"", "0")),
            12,
        ),
        ("smoke", smoke.to_string(), 16),
        ("fire", fire, 6),
        ("dust, stirred", stirred, 8),
        ("stars", stars.to_string(), 3),
        ("stars, native", format!("bits = \"native\"\n{stars}"), 3),
        ("sheet, explicit", sheet("integrator = \"symplectic_euler\"\nsubsteps = 24", links), 20),
        ("sheet, verlet", sheet("integrator = \"verlet\"\nsubsteps = 12", links), 6),
        (
            "sheet, implicit",
            sheet("integrator = \"implicit_euler\"\nsolver = { newton_tolerance = 1e-3, linear_tolerance = 1e-2 }", hinges),
            20,
        ),
        ("sheet, dormand-prince", sheet("integrator = \"dormand_prince\"\nadaptive.tolerance = 1e-3", links), 3),
        ("sheet, position based", sheet("method = \"position_based\"\nsubsteps = 8\nclamp = 1.2", &format!("hinge = 2e-5\n{links}")), 20),
        ("sheet, iterated", sheet("method = \"position_based\"\nsubsteps = 2\nposition_based.iterations = 4", hinges), 10),
        ("sheet, torn, position based", sheet("method = \"position_based\"\nsubsteps = 12", torn), 20),
        ("rod, position based", rod("position_based", "= 20"), 10),
        ("hair", hair.to_string(), 10),
        ("hair, iterated", hair.replace("substeps = 10", "substeps = 2\nposition_based.iterations = 3"), 5),
        ("jelly, position based", jelly.replace("symplectic_euler", "position_based"), 4),
        ("sheet, torn", sheet("integrator = \"velocity_verlet\"\nsubsteps = 12", torn), 20),
        ("rod, explicit", rod("symplectic_euler", "= 200"), 20),
        ("rod, implicit", rod("implicit_midpoint", "= 4"), 10),
        ("jelly", jelly.to_string(), 4),
        ("dust", dust, 20),
        ("tracers", tracers, 20),
        ("vicsek", vicsek.to_string(), 20),
        ("spray", spray.to_string(), 20),
        ("spray, splashing", splashing, 16),
        ("spray, implicit", spray.replace("velocity_verlet", "implicit_midpoint"), 8),
        ("spray, adaptive", spray.replace("velocity_verlet\"\nsubsteps = 3", "dormand_prince\"\nadaptive.tolerance = 1e-4"), 8),
        ("swarm", swarm.to_string(), 16),
        ("rope, cholesky", rope.to_string(), 20),
        ("plume", plume.to_string(), 4),
        ("plume, stirred", stirring, 4),
        ("sand", sand.to_string(), 8),
    ]
}

/// The two tiers differ, by the round-off of a force.
#[test]
fn native_bits_agree_with_portable_ones_to_round_off() {
    for softening in [0.1, 0.0] {
        let run = |bits: &str| {
            let mut sim = simulation(&format!(
                "bits = \"{bits}\"\ntime.fps = 100\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"symplectic_euler\"\nsubsteps = 1\n\
                 [[galaxy]]\nname = \"g\"\nprofile = \"plummer\"\nstars = 2000\nmass = 1\nlength = 1\nradius = 0.01\n\
                 [[force]]\nkind = \"gravitation\"\nconstant = 1\nsoftening = {softening}\n"
            ));
            let n = 3 * 2000;
            sim.write("g", "velocity", &vec![0.0; n]).unwrap();
            run(&mut sim, 1);
            match sim.frame(&["velocity"]).columns.into_iter().next().unwrap().data {
                tumble_interface::Data::F32(v) => v.into_iter().map(f64::from).collect::<Vec<f64>>(),
                tumble_interface::Data::F64(v) => v,
                tumble_interface::Data::U32(_) => panic!("velocities are no indices"),
            }
        };
        let (portable, native) = (run("portable"), run("native"));
        let size = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        let off = size(&portable.iter().zip(&native).map(|(a, b)| a - b).collect::<Vec<_>>()) / size(&portable);
        #[allow(clippy::useless_conversion)] // single precision needs it
        let unit = f64::from(tumble::math::Real::EPSILON);
        println!("softening {softening}: native and portable differ by {:.2} units of round-off", off / unit);
        // A term is right to three units, a block of 1024 terms to a few more. Measured: 0.5 to 2 units.
        assert!(off < 10.0 * unit, "{off:e}");
        let wide = tumble::math::simd::Level::available().len() > 1;
        assert_eq!(off > 0.0, wide, "{off:e}");
    }
}

/// All scenes in `make validate`. In `make test` every other one: those that one precision leaves out are the other's.
fn part() -> Vec<(&'static str, String, usize)> {
    let (all, double) = (std::env::var_os("TUMBLE_WHOLE").is_some(), usize::from(size_of::<tumble::math::Real>() == 8));
    scenes().into_iter().enumerate().filter(|(i, _)| all || (i + double).is_multiple_of(2)).map(|(_, scene)| scene).collect()
}

/// Frames of a scene in `make test`: a third of all, which `make validate` goes through.
fn beginning(frames: usize) -> usize {
    frames.div_ceil(3).max(2)
}

#[test]
fn any_count_of_threads_gives_the_same_bits() {
    on_any_count_of_threads(beginning, &[3]);
}

#[test]
#[ignore = "long: make validate"]
fn any_count_of_threads_gives_the_same_bits_to_the_end() {
    for (name, contacts, broken) in on_any_count_of_threads(|frames| frames, &[2, 8]) {
        assert!(!name.contains("torn") || broken > Some(0), "{name}: nothing tears");
        assert!(!name.contains("sheet, implicit") || contacts > Some(10), "{name}: no contact");
    }
}

/// Compares so many frames of each scene on one thread and on these; returns name, contacts, broken links.
fn on_any_count_of_threads(frames: fn(usize) -> usize, counts: &[usize]) -> Vec<(&'static str, Option<u64>, Option<u64>)> {
    let mut all = Vec::new();
    for (name, text, most) in part() {
        let frames = frames(most);
        let hash = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut sim = simulation(&text);
                let start = sim.hash();
                run(&mut sim, frames);
                assert_ne!(sim.hash(), start, "{name}: nothing happens");
                let books = sim.ledger();
                (sim.hash(), books.contacts, books.broken)
            })
        };
        let start = std::time::Instant::now();
        let one = hash(1);
        println!("{name:22} {:016x} after {frames} frames, {:?} contacts, {:?} broken, {:.1?}", one.0, one.1, one.2, start.elapsed());
        for threads in counts {
            assert_eq!(one, hash(*threads), "{name}: {threads} threads");
        }
        all.push((name, one.1, one.2));
    }
    // Some of them tear, and some touch a collider.
    assert!(all.iter().any(|(_, contacts, _)| *contacts > Some(10)) && all.iter().any(|(_, _, broken)| *broken > Some(0)), "{all:?}");
    all
}

#[test]
fn a_run_that_is_restored_midway_goes_on_to_the_same_bits() {
    goes_on_when_restored(|frames| beginning(frames).min(4));
}

#[test]
#[ignore = "long: make validate"]
fn a_run_that_is_restored_later_goes_on_to_the_same_bits() {
    goes_on_when_restored(|frames| frames.min(8));
}

fn goes_on_when_restored(frames: fn(usize) -> usize) {
    let mut touching = 0;
    for (name, text, most) in part() {
        let frames = frames(most);
        let (first, rest) = (frames / 2, frames - frames / 2);
        let mut sim = simulation(&text);
        run(&mut sim, first);
        let saved = sim.save(&[("about", "half-way")]);
        touching += u64::from(sim.ledger().contacts > Some(0));
        let at_half = sim.hash();
        run(&mut sim, rest);
        let mut fresh = simulation(&text);
        fresh.restore(&saved).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(fresh.hash(), at_half, "{name}");
        run(&mut fresh, rest);
        assert_eq!(fresh.hash(), sim.hash(), "{name}");
        assert_eq!((fresh.time(), fresh.frame_index()), (sim.time(), sim.frame_index()));
        // And the same object can go back.
        sim.restore(&saved).unwrap();
        run(&mut sim, rest);
        assert_eq!(fresh.hash(), sim.hash(), "{name}, back");
    }
    assert!(touching > 1, "{touching}");
}

#[test]
fn a_far_object_in_another_system_changes_nothing() {
    for scheme in ["symplectic_euler", "verlet", "implicit_euler", "dormand_prince"] {
        let steps = if scheme == "dormand_prince" { "" } else { "substeps = 30" };
        let near = format!(
            "[[system]]\nname = \"near\"\nintegrator = \"{scheme}\"\n{steps}\n\
             [[sheet]]\nname = \"flag\"\nsystem = \"near\"\nsize = [1, 1]\nresolution = [12, 9]\npin = [\"corner 0 0\", \"corner 1 0\"]\nhinge = 1e-3\n"
        );
        let far = "[[system]]\nname = \"far\"\nintegrator = \"rk4\"\nsubsteps = 20\n\
                   [[rope]]\nname = \"lost\"\nsystem = \"far\"\nfrom = [900, 0, 0]\nto = [901, 0, 0]\nsegments = 9\npin = [\"start\"]\nlinks = { structural = 50 }\n";
        let columns = |text: &str| {
            let mut sim = simulation(text);
            run(&mut sim, 10);
            let frame = sim.frame(&["position", "velocity", "link_strain"]);
            frame.columns.into_iter().filter(|c| c.object == "flag").map(|c| format!("{:?}", c.data)).collect::<Vec<_>>()
        };
        let alone = columns(&near);
        assert_eq!(alone.len(), 3);
        assert_eq!(alone, columns(&format!("{near}{far}")), "{scheme}: after it");
        // Before it in the scene, too: nothing depends on the place of a system.
        let (system, object) = near.split_at(near.find("[[sheet]]").unwrap());
        let (far_system, far_object) = far.split_at(far.find("[[rope]]").unwrap());
        assert_eq!(alone, columns(&format!("{far_system}{system}{far_object}{object}")), "{scheme}: before it");
    }
}

#[test]
fn after_an_error_the_state_is_that_of_the_last_good_frame() {
    // Forward Euler on a stiff sheet multiplies its energy by some 2 a step.
    let mut sim = simulation(
        "time.fps = 100\n[[system]]\nintegrator = \"forward_euler\"\nsubsteps = 20\n\
         [[sheet]]\nname = \"sheet\"\nsize = [1, 1]\nresolution = [9, 9]\npin = [\"corner 0 0\"]\nlinks = { structural = 2000, shear = 800, bend = 40 }\n",
    );
    let mut good = (sim.hash(), sim.frame(&["position"]), sim.ledger());
    let error = loop {
        match sim.step(&|| true) {
            Ok(_) => good = (sim.hash(), sim.frame(&["position"]), sim.ledger()),
            Err(error) => break error,
        }
        assert!(sim.frame_index() < 1000, "it should have exploded");
    };
    println!("{error}");
    assert!(matches!(error, StepError::Exploded(_) | StepError::NotFinite(_)));
    assert_eq!(sim.hash(), good.0);
    assert_eq!(sim.frame(&["position"]), good.1);
    assert_eq!(sim.ledger(), good.2);
    // It fails again in the same way.
    assert_eq!(sim.step(&|| true), Err(error));
    assert_eq!(sim.hash(), good.0);
}

#[test]
fn an_abandoned_step_leaves_no_trace() {
    use std::sync::atomic::{AtomicU32, Ordering};
    for (name, text, _) in
        scenes().into_iter().filter(|(name, _, _)| ["sheet, verlet", "rod, explicit", "dust", "tracers", "vicsek"].contains(name))
    {
        let mut sim = simulation(&text);
        run(&mut sim, 1);
        let before = sim.hash();
        // At once; and, where there are many sub-steps, in the middle.
        for after in [0, 5] {
            let asked = AtomicU32::new(0);
            let go_on = || asked.fetch_add(1, Ordering::Relaxed) < after;
            if after == 0 || name.contains(',') {
                assert_eq!(sim.step(&go_on), Ok(None), "{name}");
            }
            assert_eq!((sim.hash(), sim.frame_index()), (before, 1), "{name}");
        }
        run(&mut sim, 2);
        let mut other = simulation(&text);
        run(&mut other, 3);
        assert_eq!(sim.hash(), other.hash(), "{name}");
    }
}

#[test]
fn looks_inside_a_frame_show_its_sub_steps_and_leave_no_trace() {
    let names = ["position", "velocity", "density", "temperature"];
    for (name, text, _) in part() {
        let (mut sim, mut other) = (simulation(&text), simulation(&text));
        run(&mut sim, 1);
        run(&mut other, 1);
        let (start, before) = (sim.hash(), sim.frame(&names));
        let steps = other.step(&|| true).unwrap().unwrap().steps;
        let mut last: (f64, Vec<_>) = (before.time, before.columns);
        let looks: std::collections::BTreeSet<u64> = [1, 2, steps / 2, steps - 1].into_iter().filter(|n| (1..steps).contains(n)).collect();
        for n in looks {
            let seen = sim.inside(n, &names, &|| true).unwrap().unwrap_or_else(|| panic!("{name}: no sub-step {n} of {steps}"));
            assert!(seen.frame.index == 1 && seen.step > 0.0 && seen.frame.time <= other.time(), "{name}: {n}");
            assert_eq!(seen.ledger.time, seen.frame.time, "{name}: {n}");
            // Systems go one after the other: only where there is one does time run on.
            assert!(sim.systems().len() > 1 || seen.frame.time > last.0, "{name}: {n}");
            assert!(seen.frame.columns != last.1, "{name}: nothing moves in sub-step {n}");
            last = (seen.frame.time, seen.frame.columns);
        }
        assert!(sim.inside(steps, &names, &|| true).unwrap().is_none(), "{name}: the frame has more than {steps} sub-steps");
        assert!(sim.inside(1, &names, &|| false).unwrap().is_none(), "{name}");
        assert_eq!(sim.hash(), start, "{name}");
        run(&mut sim, 1);
        assert_eq!(sim.hash(), other.hash(), "{name}");
    }
}

#[test]
fn half_of_a_frame_is_a_frame_of_half_the_length() {
    let (whole, half) = (
        "time.fps = 64\n[[system]]\nintegrator = \"verlet\"\nsubsteps = 12",
        "time.fps = 128\n[[system]]\nintegrator = \"verlet\"\nsubsteps = 6",
    );
    let scene = |head: &str| simulation(&(sheet("", "links = { structural = 50, bend = 2 }").replace("time.fps = 60\n[[system]]\n", head)));
    let (mut whole, mut half) = (scene(whole), scene(half));
    run(&mut whole, 3);
    run(&mut half, 7);
    let inside = whole.inside(6, &["position", "velocity"], &|| true).unwrap().unwrap();
    assert_eq!(inside.frame.time, half.time());
    assert!(inside.frame.columns == half.frame(&["position", "velocity"]).columns);
    assert_eq!(inside.ledger, half.ledger());
}

#[test]
fn a_look_at_what_breaks_is_an_error_with_the_sub_step() {
    let mut sim = simulation(
        "time.fps = 10\n[[system]]\nintegrator = \"forward_euler\"\nsubsteps = 20\n[[rope]]\nname = \"rope\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 8\npin = [\"start\"]\n\
         links = { structural = 1e5 }\n",
    );
    let start = sim.hash();
    let error = (1..20).find_map(|n| sim.inside(n, &["position"], &|| true).err()).expect("nothing breaks");
    assert!(matches!(error, StepError::Exploded(_) | StepError::NotFinite(_)), "{error}");
    assert_eq!(sim.hash(), start);
}

/// Particles die at the end of a frame: inside of it all still exist.
#[test]
fn a_look_inside_a_frame_buries_nobody() {
    for system in [
        "integrator = \"velocity_verlet\"\nsubsteps = 4",
        "integrator = \"dormand_prince\"\nadaptive = { tolerance = 1e-6, first_step = 0.02 }",
        "method = \"tracers\"\nintegrator = \"heun\"\nsubsteps = 4",
        "method = \"tracers\"\nintegrator = \"dormand_prince\"\nadaptive = { tolerance = 1e-6, first_step = 0.02 }",
    ] {
        let field = if system.contains("tracers") { "[[field]]\nkind = \"swirl\"\nrate = 2\n" } else { "" };
        let mut sim = simulation(&format!(
            "time.fps = 10\n[[system]]\n{system}\n{field}[[emitter]]\nname = \"e\"\nburst = [{{ time = 0, count = 50 }}]\nlifetime = 0.09\nfrom.sphere.radius = 0.1\n"
        ));
        let count = |frame: &tumble_interface::Frame| frame.column("e", "position").map_or(0, |c| c.data.len() / 3);
        let seen = sim.inside(1, &["position"], &|| true).unwrap().unwrap();
        assert_eq!(count(&seen.frame), 50, "{system}, at {} s", seen.frame.time);
        run(&mut sim, 1);
        assert_eq!(count(&sim.frame(&["position"])), 0, "{system}");
    }
}
