//! Cloth cut from panels: what it weighs, how it is sewn, and pins that follow colliders.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, every, intersections_after, positions, run, simulation, step, vector};
use tumble_f64::scene::Simulation;
use tumble_interface::{Data, Engine, Scene};

fn issues(text: &str) -> String {
    let scene = Scene::from_toml(&format!("version = 1\n{text}")).unwrap_or_else(|e| panic!("{e}"));
    match Simulation::new(scene, Default::default()) {
        Ok(_) => panic!("nothing is wrong with it"),
        Err(error) => error.to_string(),
    }
}

fn triangles(sim: &Simulation, object: &str) -> Vec<[u32; 3]> {
    let all = sim.topology();
    match &all.iter().find(|c| c.object == object && c.name == "triangles").unwrap().data {
        Data::U32(t) => t.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        _ => panic!("triangles are indices"),
    }
}

#[test]
fn a_dress_weighs_what_its_pattern_says() {
    for resolution in [0.06, 0.03] {
        let sim = simulation(&format!(
            "[[cloth]]\nname = \"dress\"\ndensity = 0.2\nresolution = {resolution}\n\
             dress = {{ waist_girth = 0.76, bust_girth = 0.94, bodice = 0.2, shoulder = 0.22 }}\n"
        ));
        // The skirt is a ring around a waist of 0.76 m, 0.55 m long; the bodice two trapezes below the arms, and straps.
        let inner = 0.76 / std::f64::consts::TAU;
        let skirt = std::f64::consts::PI * ((inner + 0.55_f64).powi(2) - inner * inner);
        let below = 2.0 * 0.2 * 0.25 * (0.76 + 0.94);
        let mass = sim.ledger().mass / 0.2;
        let (least, most) = (skirt + below, skirt + below + 0.22 * 0.94);
        println!("resolution {resolution}: {mass:.4} m², between {least:.4} and {most:.4}");
        // Arcs are cut to polygons of about 60 sides, which lose 0.2 % of a circle.
        assert!(mass > 0.99 * least && mass < most);
        // At the start every edge is nearly as long as in the pattern: the dress hangs on the body as it is cut.
        // The straps are cut shorter than their way over the shoulders.
        let stretch = sim.ledger().stretch.unwrap();
        assert!(stretch > 1.01 && stretch < 1.35, "{stretch}");
        assert!(triangles(&sim, "dress").len() as f64 > 1.5 * mass / (resolution * resolution));
    }
}

/// Two squares side by side, 2 cm apart, sewn along their neighbouring sides.
const SQUARES: &str = "[[system]]\nmethod = \"position_based\"\nsubsteps = 20\n[[cloth]]\nname = \"c\"\nresolution = 0.1\nhinge = 1e-3\n\
     panels = [{ name = \"a\", outline = [[0, 0], [0.5, 0], [0.5, 0.5], [0, 0.5]] },\n\
     { name = \"b\", outline = [[0, 0], [SIDE, 0], [SIDE, 0.5], [0, 0.5]], origin = [0.52, 0, 0] }]\n\
     seams = [{ from = { panel = \"a\", side = 1 }, to = { panel = \"b\", side = 3 } }]\n";

#[test]
fn seams_close_and_hold() {
    let text = SQUARES.replace("SIDE", "0.5");
    let mut sim = simulation(&format!("{text}pin = [\"vertex 0\"]\n[[force]]\nkind = \"drag\"\nrate = 2\n"));
    let x = positions(&sim, "c");
    let half = x.len() / 2;
    let along = |x: &[common::Vector], at: f64| -> Vec<usize> { (0..x.len()).filter(|i| (x[*i].x - at).abs() < 1e-9).collect() };
    let (left, right) = (along(&x, 0.5), along(&x, 0.52));
    assert!(left.len() == 6 && right.len() == 6 && left.iter().all(|i| *i < half) && right.iter().all(|i| *i >= half));
    run(&mut sim, 48);
    let x = positions(&sim, "c");
    for a in &left {
        let nearest = right.iter().map(|b| (x[*a] - x[*b]).norm()).fold(f64::INFINITY, f64::min);
        // 0.05 kg hang on 6 stitches of 1e4 N/m: 8e-6 m each; the first ones carry more.
        assert!(nearest < 1e-3, "{nearest}");
    }
    assert!(x.iter().all(|x| x.z < 0.51) && x[x.len() - 1].z < -0.2, "it hangs");
}

#[test]
fn what_is_wrong_with_a_pattern_is_told_with_its_place() {
    let unequal =
        issues(&SQUARES.replace("SIDE, 0.5]", "0.5, 0.45]").replace("SIDE", "0.5").replace("[0, 0.5]], origin", "[0, 0.4]], origin"));
    assert!(unequal.contains("cloth \"c\".seams[0]") && unequal.contains("0.5000 m and 0.4000 m"), "{unequal}");
    let none = issues(&SQUARES.replace("SIDE", "0.5").replace("side = 3", "side = 4"));
    assert!(none.contains("cloth \"c\".seams[0].to.side") && none.contains("the last one is 3"), "{none}");
    let unknown = issues(&SQUARES.replace("SIDE", "0.5").replace("to = { panel = \"b\"", "to = { panel = \"d\""));
    assert!(unknown.contains("\"d\" is no panel; known are a, b"), "{unknown}");
    let crossed =
        issues(&SQUARES.replace("[0.5, 0], [0.5, 0.5], [0, 0.5]] },", "[0.5, 0.5], [0.5, 0], [0, 0.5]] },").replace("SIDE", "0.5"));
    assert!(crossed.contains("panels[0].outline") && crossed.contains("cross"), "{crossed}");
    let fine = issues("[[cloth]]\nname = \"c\"\ndress = {}\nresolution = 1e-5\n");
    assert!(fine.contains("cloth \"c\".resolution") || fine.contains("memory_limit"), "{fine}");
    let empty = issues("[[cloth]]\nname = \"c\"\n");
    assert!(empty.contains("expected panels or a dress"), "{empty}");
    let text = "[[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 4\npin = [{ which = \"start\", follow = { collider = \"x\" } }]\n\
                [[collider]]\nname = \"ball\"\nshape.sphere = { center = [9, 0, 0], radius = 1 }\n";
    let lost = issues(text);
    assert!(lost.contains("rope \"r\".pin[0]") && lost.contains("known are ball"), "{lost}");
    let boneless = issues(&text.replace("\"x\"", "\"ball\", bone = \"hips\""));
    assert!(boneless.contains("has no bones"), "{boneless}");
}

/// Nonsensical values are errors that name the key at fault.
#[test]
fn measures_beyond_sense_are_refused_with_the_word_at_fault() {
    let two = "name = \"c\"\nresolution = RES\npanels = [{ name = \"a\", outline = [[0, 0], [1, 0], [1, HIGH], [0, HIGH]] },\n\
               { name = \"OTHER\", outline = [[0, 0], [1, 0], [1, 1], [0, 1]], origin = [2, 0, 0] }]\n";
    let panels = |res: &str, high: &str, other: &str| {
        let words = two.replace("RES", res).replace("HIGH", high).replace("OTHER", other);
        let scene = Scene::from_toml(&format!("version = 1\n[[cloth]]\n{words}")).unwrap_or_else(|e| panic!("{e}"));
        Simulation::new(scene, Default::default()).map_or_else(|e| e.to_string(), |_| String::new())
    };
    assert_eq!(panels("0.1", "0.5", "b"), "");
    // A ribbon of 2 mm is cut to triangles fifty times as long.
    assert_eq!(panels("0.1", "0.002", "b"), "");
    let thin = panels("0.03", "1e-6", "b");
    assert!(thin.contains("cloth \"c\".panels[0].outline") && thin.contains("100 times as long as wide"), "{thin}");
    let same = panels("0.1", "0.5", "a");
    assert!(same.contains("cloth \"c\".panels[1].name") && same.contains("name of panels[0] already"), "{same}");
    let coarse = panels("1e5", "0.5", "b");
    assert!(coarse.contains("cloth \"c\".resolution") && coarse.contains("1.12 m; take a smaller one"), "{coarse}");
    // However coarsely, a collar keeps its corners.
    let collar = "[[cloth]]\nname = \"c\"\nresolution = 0.9\npanels = [{ name = \"a\", \
                  outline = [[0, 0], [1, 0], [1, 0.6], [0.9, 0.6], [0.9, 0.1], [0.1, 0.1], [0.1, 0.6], [0, 0.6]] }]\n";
    assert_eq!(simulation(collar).warnings().len(), 0);
    let dress = |words: &str| {
        let scene = Scene::from_toml(&format!("version = 1\n[[cloth]]\nname = \"d\"\n{words}")).unwrap_or_else(|e| panic!("{e}"));
        Simulation::new(scene, Default::default()).map_or_else(|e| e.to_string(), |_| String::new())
    };
    assert_eq!(dress("dress = {}\nresolution = 0.1"), "");
    // A child's and a giant's.
    assert_eq!(
        dress("dress = { waist_girth = 0.5, bust_girth = 0.52, bodice = 0.14, shoulder = 0.15, strap_distance = 0.13, skirt = 0.3 }"),
        ""
    );
    for (words, place, cure) in [
        ("dress = { strap = 0.9 }", "dress.strap", "less than strap_distance, 0.2 m"),
        ("dress = { strap_distance = 0.6 }", "dress.strap_distance", "less than half of bust_girth together, 0.49 m"),
        ("dress = { waist_girth = 1e-6 }", "dress.waist_girth", "0.01 to 100 m"),
        ("dress = { waist_girth = 300 }\nresolution = 10", "dress.waist_girth", "0.01 to 100 m"),
        ("dress = { bust_girth = 1e-4 }", "dress.bust_girth", "0.16 to 4 m"),
        ("dress = { skirt = 40 }\nresolution = 0.1", "dress.skirt", "0.016 to 16 m"),
        ("dress = { shoulder = 1e-5 }", "dress.shoulder", "0.016 to 4 m"),
        ("dress = {}\nresolution = 1e5", "resolution", "a sixth of it, 0.133 m"),
    ] {
        let told = dress(words);
        assert!(told.contains(&format!("cloth \"d\".{place}:")) && told.contains(cure), "{words}: {told}");
    }
}

#[test]
fn panels_have_their_own_metres_as_texture() {
    let sim = simulation(&SQUARES.replace("SIDE", "0.5"));
    let columns = sim.topology();
    let Data::F32(uv) = &columns.iter().find(|c| c.object == "c" && c.name == "texture").unwrap().data else { panic!() };
    let (x, all) = (positions(&sim, "c"), triangles(&sim, "c"));
    assert_eq!(uv.len(), 6 * all.len());
    for (t, uv) in all.iter().zip(uv.chunks_exact(6)) {
        for (k, i) in t.iter().enumerate() {
            // The panels stand in the xz plane, the second one 0.52 m to the right.
            let at = x[*i as usize];
            let u = if at.x > 0.51 { at.x - 0.52 } else { at.x };
            assert!((f64::from(uv[2 * k]) - u).abs() < 1e-6 && (f64::from(uv[2 * k + 1]) - at.z).abs() < 1e-6);
        }
    }
}

#[test]
fn pins_follow_a_collider_under_every_integrator() {
    for scheme in every() {
        let steps = if scheme.is_adaptive() { "" } else { "substeps = 40" };
        let mut sim = simulation(&format!(
            "time.fps = 20\n[[system]]\nintegrator = \"{}\"\n{steps}\n[[rope]]\nname = \"r\"\nfrom = [0, 0, 2]\nto = [1, 0, 2]\nsegments = 8\n\
             links = {{ structural = {{ modulus = 20, damping = 0.5 }} }}\npin = [{{ center = [0, 0, 2], radius = 0.01, follow = {{ collider = \"wheel\" }} }}]\n\
             [[collider]]\nname = \"wheel\"\nshape.sphere = {{ center = [0, 0, 5], radius = 0.1 }}\n\
             motion = {{ pivot = [0, 0, 5], spin = [0, 1.5, 0], velocity = [0.1, 0, 0] }}\n",
            scheme.name()
        ));
        for frame in 1..=10 {
            step(&mut sim);
            let (t, x) = (f64::from(frame) / 20.0, positions(&sim, "r"));
            let a = 1.5 * t;
            let exact = vector(0.1 * t - 3.0 * a.sin(), 0.0, 5.0 - 3.0 * a.cos());
            assert!((x[0] - exact).norm() < 1e-9, "{} at {t}: {:?}, {exact:?}", scheme.name(), x[0]);
            assert!((x[1] - x[0]).norm() < 0.2, "{}", scheme.name());
        }
    }
}

/// One word changed, the shipped dress is masses and springs under implicit Euler: it hangs on the dancer, and passes through nothing.
#[test]
#[ignore = "long: make validate"]
fn the_dress_needs_one_other_word_to_be_masses_and_springs() {
    let shipped = include_str!("../../../python/tumble/scenes/cloth/dress.toml");
    let coarse = shipped.replace("resolution = 0.03", "resolution = 0.06").replace("version = 1\n", "");
    let word = "method = \"position_based\"";
    assert!(coarse.matches(word).count() == 1 && coarse.contains("resolution = 0.06"));
    let [swept, sprung] = [word, "method = \"dynamics\""].map(|other| {
        let mut sim = simulation(&coarse.replace(word, other));
        let start = positions(&sim, "dress");
        let mut crossed = 0;
        for _ in 0..12 {
            step(&mut sim);
            crossed += sim.ledger().intersections.unwrap();
        }
        let books = sim.ledger();
        let (stretch, depth) = (books.stretch.unwrap(), books.penetration.unwrap());
        println!("{other}: stretch {stretch:.3}, {crossed} crossings in 12 frames, {depth:.1e} m inside the dancer");
        assert!(crossed == 0 && stretch < 1.35 && depth < 0.005, "{crossed} {stretch} {depth}");
        // Measured: 1.26 at the start, where seams close, and 2.1 mm.
        // Of the bodice; the skirt starts wider than it is cut, and how it swings from there depends on how much a method dampens.
        let end = positions(&sim, "dress");
        // Without her it would have fallen by 1.2 m. Measured: 4 mm and 7 cm.
        let sunk = start.iter().zip(&end).map(|(s, x)| s.z - x.z).sum::<f64>() / end.len() as f64;
        assert!(stretch > 1.01 && sunk < 0.4, "neither cloth nor body: {stretch} {sunk}");
        // The counter sees a vertex that is pulled through the dancer to her other side.
        let across = |x: Vector| vector(-3.0 * x.x, -3.0 * x.y, 0.0);
        assert!(intersections_after(&mut sim, "dress", 1, across) > 0);
        end.into_iter().zip(start).filter(|(_, s)| s.z > 1.1).map(|(x, _)| x).collect::<Vec<_>>()
    });
    let apart = (swept.iter().zip(&sprung).map(|(a, b)| (*a - *b).norm_sq()).sum::<f64>() / swept.len() as f64).sqrt();
    // Measured: 21 mm.
    println!("{} masses of the bodice, {:.2} mm apart", swept.len(), 1e3 * apart);
    assert!(swept.len() > 100 && apart < 0.03, "{apart}");
}
