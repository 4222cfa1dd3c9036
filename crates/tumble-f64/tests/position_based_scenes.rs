//! Position-based scenes as a whole: moved and turned, beside others, with extreme masses, triangles and steps.

use crate::common;

use common::{Vector, positions, simulation, step, vector, velocities};
use std::collections::HashMap;
use tumble_f64::math::rotation::from_degrees;
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Engine, Scene};

const G: f64 = 9.8;
const LINKS: &str = "links = { structural = { modulus = 200, damping = 0.05 }, shear = 60 }\nhinge = 1e-5\ndensity = 0.2";

fn system(fps: u32, substeps: u32) -> String {
    format!(
        "precision = \"double\"\ntime.fps = {fps}\n[[system]]\nmethod = \"position_based\"\nsubsteps = {substeps}\n\
         self_contact = {{ thickness = 0.008, friction = 0.3 }}\n"
    )
}

/// A sheet that falls on a ball and on another sheet, at a place and turned about the vertical.
fn meeting(at: [f64; 3], turn: f64) -> String {
    let [x, y, z] = at;
    let place = |d: Vector| {
        let p: [f64; 3] = (from_degrees([0.0, 0.0, turn]).turn(d) + Vector::from(at)).into();
        format!("[{:e}, {:e}, {:e}]", p[0], p[1], p[2])
    };
    format!(
        "[[sheet]]\nname = \"low\"\nsize = [0.6, 0.6]\nresolution = [13, 13]\ncenter = [{x}, {y}, {}]\nrotate = [0, 0, {turn}]\n{LINKS}\n\
         [[sheet]]\nname = \"high\"\nsize = [0.4, 0.5]\nresolution = [9, 11]\ncenter = {}\nrotate = [0, 0, {}]\n{LINKS}\n\
         [[collider]]\nname = \"ball\"\nfriction = 0.3\nthickness = 0.005\nshape.sphere = {{ center = [{x}, {y}, {z}], radius = 0.15 }}\n",
        z + 0.17,
        place(vector(0.06, 0.02, 0.19)),
        turn + 10.0
    )
}

/// A translated and rotated scene gives the same motion, up to rounding that contact amplifies.
#[test]
fn a_scene_that_is_moved_and_turned_does_the_same_there() {
    let (at, turn) = ([3.0, -2.0, 1.0], 37.0);
    let mut here = simulation(&format!("{}{}", system(60, 10), meeting([0.0; 3], 0.0)));
    let mut there = simulation(&format!("{}{}", system(60, 10), meeting(at, turn)));
    let mut apart = 0.0_f64;
    // 100 steps.
    for _ in 0..10 {
        step(&mut here);
        step(&mut there);
        for name in ["low", "high"] {
            for (p, q) in positions(&here, name).iter().zip(positions(&there, name)) {
                apart = apart.max((from_degrees([0.0, 0.0, turn]).turn(*p) + Vector::from(at) - q).norm());
            }
        }
    }
    let moved = positions(&here, "high").iter().map(|p| (p.z - 0.19).abs()).fold(0.0, f64::max);
    println!("{apart:.1e} m apart after moving by {moved:.3} m");
    assert!(apart < 1e-9 && moved > 0.02, "{apart:e} {moved}");
}

/// Things far away change no bit, whether they come first or last.
#[test]
fn what_is_far_away_changes_no_bit() {
    let far = format!(
        "[[sheet]]\nname = \"far\"\nsize = [0.7, 0.5]\nresolution = [9, 8]\ncenter = [80, -50, 3]\n{LINKS}\npin = [\"corner 0 0\"]\n"
    );
    let near = meeting([0.0; 3], 0.0);
    let mut alone = simulation(&format!("{}{near}", system(60, 10)));
    let mut others = [format!("{}{near}{far}", system(60, 10)), format!("{}{far}{near}", system(60, 10))].map(|text| simulation(&text));
    for _ in 0..20 {
        step(&mut alone);
        others.iter_mut().for_each(|sim| _ = step(sim));
        for name in ["low", "high"] {
            for sim in &others {
                assert_eq!(positions(&alone, name), positions(sim, name), "{name}");
                assert_eq!(velocities(&alone, name), velocities(sim, name), "{name}");
            }
        }
    }
}

/// Runs a scene for a second: nothing passes anything, and no energy comes from nowhere; what falls from there may at the rim be
/// whipped to a few times the speed of a free fall. What one sweep of a long step leaves stretched counts as no energy: the next takes
/// it back without a push.
fn holds(what: &str, fps: u32, text: &str, height: f64) {
    let mut sim = simulation(text);
    let start = sim.ledger();
    let scale = start.mass * G * height;
    let (mut fastest, mut grown) = (0.0_f64, 0.0_f64);
    for frame in 1..=fps {
        step(&mut sim);
        let books = sim.ledger();
        fastest = fastest.max(books.speed.unwrap() / (2.0 * G * height).sqrt());
        grown = grown.max((books.kinetic + books.external - start.external) / scale);
        assert_eq!(books.intersections.unwrap(), 0, "{what}, frame {frame}");
    }
    println!("{what}: {fastest:.2} of the speed of a free fall, energy grew by {grown:.1e} of what there is");
    assert!(grown < 1e-3 && fastest < 3.0, "{what}: {grown:e} {fastest}");
}

#[test]
fn masses_from_one_to_ten_thousand_hold() {
    for ratio in [1.0, 100.0, 1e4] {
        for heavy_above in [true, false] {
            let (above, below) = if heavy_above { (0.05 * ratio, 0.05) } else { (0.05, 0.05 * ratio) };
            let sheet = |name: &str, z: f64, density: f64, pin: &str| {
                format!(
                    "[[sheet]]\nname = \"{name}\"\nsize = [0.5, 0.5]\nresolution = [11, 11]\ncenter = [0, 0, {z}]\nrotate = [0, 0, {}]\n\
                     links = {{ structural = {{ modulus = {:e}, damping = 0.05 }}, shear = {:e} }}\nhinge = 1e-5\ndensity = {density}\n{pin}\n",
                    200.0 * z,
                    500.0 * (density / 0.2).max(1.0),
                    100.0 * (density / 0.2).max(1.0),
                )
            };
            let text = format!(
                "{}{}{}[[collider]]\nname = \"floor\"\nfriction = 0.4\nthickness = 0.004\nshape.floor = {{}}\n",
                system(60, 20),
                sheet("below", 0.1, below, ""),
                sheet("above", 0.14, above, ""),
            );
            holds(&format!("ratio {ratio}, heavy above: {heavy_above}"), 60, &text, 0.14);
        }
    }
}

#[test]
fn triangles_fifty_times_as_long_as_wide_hold() {
    let text = format!(
        "{}[[sheet]]\nname = \"s\"\nsize = [1, 0.5]\nresolution = [6, 126]\ncenter = [0, 0, 0.35]\n{LINKS}\n\
         [[collider]]\nname = \"ball\"\nfriction = 0.3\nthickness = 0.002\nshape.sphere = {{ center = [0, 0, 0.2], radius = 0.1 }}\n\
         [[collider]]\nname = \"floor\"\nfriction = 0.3\nthickness = 0.002\nshape.floor = {{}}\n",
        system(60, 20).replace("0.008", "0.002")
    );
    holds("aspect 50", 60, &text, 0.35);
}

#[test]
fn steps_from_a_24th_to_a_2000th_of_a_second_hold() {
    for (fps, substeps) in [(24, 1), (24, 2), (24, 8), (100, 20)] {
        let text = format!(
            "{}{}[[collider]]\nname = \"floor\"\nfriction = 0.3\nthickness = 0.005\nshape.floor.height = -0.15\n",
            system(fps, substeps),
            meeting([0.0; 3], 0.0)
        );
        holds(&format!("steps of 1/{} s", fps * substeps), fps, &text, 0.35);
    }
}

/// docs/theory/positions.md, "Compliant elements": what long steps leave unsolved.
#[test]
fn one_sweep_in_a_long_step_leaves_cloth_too_long() {
    let most = |substeps: u32| {
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime.fps = 24\n[[system]]\nmethod = \"position_based\"\nsubsteps = {substeps}\nself_contact.thickness = 0.004\n\
             [[sheet]]\nname = \"s\"\nsize = [1, 1]\nresolution = [26, 26]\ncenter = [0.1, 0, 0.6]\nrotate = [10, 5, 0]\ndensity = 0.2\n\
             [[collider]]\nname = \"ball\"\nfriction = 0.3\nthickness = 0.005\nshape.sphere = {{ center = [0, 0, 0.2], radius = 0.2 }}\n\
             [[collider]]\nname = \"floor\"\nfriction = 0.4\nthickness = 0.005\nshape.floor = {{}}\n"
        ));
        (0..48).fold(0.0_f64, |most, _| {
            step(&mut sim);
            most.max(sim.ledger().stretch.unwrap())
        })
    };
    let (one, eight) = (most(1), most(8));
    println!("stretched to {one:.2} in one sub-step a frame, {eight:.3} in eight");
    assert!(one > 5.0 && eight < 1.7, "{one} {eight}");
}

/// Ten sweeps leave what hangs too long, or its own softness does; tethers hold it, whatever it is made of.                                  (positions.3)
#[test]
fn tethers_hold_what_hangs() {
    let sheet = "[[sheet]]\nname = \"s\"\nsize = [1, 1]\nresolution = [41, 41]\nrotate = [90, 0, 0]\npin = [\"edge y+\"]\n";
    let rope = "[[rope]]\nname = \"s\"\nfrom = [0, 0, 0]\nto = [0, 0, -1]\nsegments = 40\npin = [\"start\"]\n";
    for what in [
        format!("{sheet}density = 0.2\nlinks.structural = 500\n"),
        format!("{sheet}density = 0.2\nlinks = {{}}\nmembrane.warp = 500\n"),
        format!("{sheet}fabric = \"interlock\"\n"),
        format!("{rope}links.structural = 5\n"),
        format!("{rope}rod = {{ stretch = 10, bend = 1e-2 }}\n"),
    ] {
        let longest = |words: &str| {
            let text = format!(
                "version = 1\nprecision = \"double\"\ntime.fps = 24\n[[system]]\nmethod = \"position_based\"\nsubsteps = 2\n\
                 position_based = {{ iterations = 2{words} }}\n{what}"
            );
            let fabrics = HashMap::from(["interlock".to_string()].map(|name| (name.clone(), tumble_io::shipped(&name).unwrap())));
            let assets = Assets::default().with_fabrics(fabrics);
            let mut sim = Simulation::new(Scene::from_toml(&text).unwrap(), assets).unwrap_or_else(|e| panic!("{e}\n{text}"));
            assert_eq!(sim.warnings(), []);
            let top = positions(&sim, "s").iter().map(|x| x.z).fold(f64::NEG_INFINITY, f64::max);
            (0..24).fold(0.0_f64, |most, _| {
                step(&mut sim);
                positions(&sim, "s").iter().map(|x| top - x.z).fold(most, f64::max)
            })
        };
        let (tied, free) = (longest(", tethers = 1.01"), longest(""));
        println!("{tied:.4} m long with tethers, {free:.3} m without: {}", what.lines().last().unwrap());
        // It hangs from them, by their whole length.
        assert!((1.005..1.01 + 1e-9).contains(&tied) && free > 1.03, "{what}: {tied} {free}");
    }
}

#[test]
fn tethers_that_tie_nothing_or_hold_what_breaks_are_told() {
    let scene = |words: &str| {
        let text = format!("version = 1\n[[system]]\nmethod = \"position_based\"\nposition_based.tethers = 1.01\n{words}");
        Simulation::new(Scene::from_toml(&text).unwrap(), Default::default())
    };
    let rope = "[[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 4\n";
    let told = |words: &str| scene(words).unwrap().warnings().iter().map(|w| format!("{}: {w}", w.code.name())).collect::<String>();
    let idle = told(&format!("{rope}links.structural = 10\n"));
    assert!(idle.contains("unfelt") && idle.contains("system \"main\".position_based.tethers"), "{idle}");
    assert_eq!(told(&format!("{rope}links.structural = 10\npin = [\"start\"]\n")), "");
    let error = |words: &str| scene(words).err().unwrap().to_string();
    let breaks = error(&format!("{rope}links.structural = {{ modulus = 10, break_strain = 0.1 }}\npin = [\"start\"]\n"));
    assert!(breaks.contains("position_based.tethers: would hold what has broken off"), "{breaks}");
    let tears = error(
        "[[sheet]]\nname = \"s\"\nsize = [1, 1]\nresolution = [5, 5]\ndensity = 0.2\nlinks.structural = 10\npin = [\"edge y+\"]\ntear.strain = 0.2\n",
    );
    assert!(tears.contains("would hold what has torn off"), "{tears}");
}
