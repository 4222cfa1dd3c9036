//! Rims that keep their slope, against the elastica. docs/theory/bending.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, orders, positions, run, show};
use std::collections::HashMap;
use std::sync::Arc;
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Engine, Fabric, Mesh, Scene};

const B: f64 = 1e-4;
const DENSITY: f64 = 0.3;
const G: f64 = 9.8;
/// Drop over reach of the elastica at rho g L³/B: `draping.rs` has others.
const GAMMA: [(f64, f64); 2] = [(1.0, 0.123471 / 0.991246), (5.0, 0.495905 / 0.846657)];
const HINGE: &str = "hinge = 1e-4\nmembrane = { warp = 3000 }";
const WOVEN: &str = "fabric = { path = \"it\" }";

fn length(gamma: f64) -> f64 {
    (gamma * B / (DENSITY * G)).cbrt()
}

fn simulate(text: &str, mesh: Mesh) -> Result<Simulation, tumble_interface::SceneError> {
    let text = format!(
        "version = 1\nprecision = \"double\"\ntime.fps = 50\n[[system]]\nintegrator = \"implicit_euler\"\n\
         solver = {{ newton_tolerance = 1e-3, linear_tolerance = 0.1 }}\n[[force]]\nkind = \"drag\"\nrate = 12\n{text}"
    );
    let pulled = [3000.0, 0.0, 3000.0, 1500.0];
    let fabric = Fabric { density: DENSITY, stretching: [pulled; 6], bending: [[B; 5]; 3], ..Fabric::default() };
    let assets: Assets = Arc::new(HashMap::from([("mesh".to_string(), mesh)])).into();
    Simulation::new(Scene::from_toml(&text)?, assets.with_fabrics(HashMap::from([("it".to_string(), fabric)])))
}

/// Where the middle of the end is after two seconds, from the middle of the clamp; along `reach` at the start.
fn tip(mut sim: Simulation, reach: Vector) -> Vector {
    let start = positions(&sim, "s");
    let along = |x: &Vector| x.dot(reach);
    let (low, high) = start.iter().map(along).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    run(&mut sim, 100);
    assert!(sim.ledger().speed.unwrap() < 1e-3, "{:?}", sim.ledger().speed);
    let now = positions(&sim, "s");
    let middle = |level: f64| {
        let found: Vec<Vector> = now.iter().zip(&start).filter(|(_, s)| (along(s) - level).abs() < 1e-9).map(|(x, _)| *x).collect();
        found.iter().fold(Vector::default(), |sum, x| sum + *x) * (1.0 / found.len() as f64)
    };
    middle(high) - middle(low)
}

fn drop_over_reach(sim: Simulation) -> f64 {
    let tip = tip(sim, Vector::from([1.0, 0.0, 0.0]));
    -tip.z / tip.x
}

/// A strip of n by m cells, as long as it hangs: nothing of it is lost to the clamp.
fn sheet(words: &str, [n, m]: [u32; 2], length: f64, pin: &str) -> String {
    let width = length * f64::from(m) / f64::from(n);
    format!(
        "[[sheet]]\nname = \"s\"\ndensity = {DENSITY}\nsize = [{length}, {width}]\nresolution = [{}, {}]\n{words}\npin = [{pin}]\n",
        n + 1,
        m + 1
    )
}

const CLAMPED: &str = "{ which = \"edge x-\", clamp = true }";

#[test]
fn clamped_strips_converge_to_the_elastica_in_second_order() {
    let flat = "isometric = 1e-4\nmembrane = { warp = 3000 }";
    for (gamma, exact) in GAMMA {
        let error = |words: &str, n: u32| {
            let sim = simulate(&sheet(words, [n, n / 3], length(gamma), CLAMPED), Mesh::default()).unwrap();
            (drop_over_reach(sim) / exact - 1.0).abs()
        };
        for words in [HINGE, flat] {
            // A strip that hardly bends is the shorter run.
            let errors = if gamma > 1.0 { vec![6, 12] } else { vec![6, 12, 24] }.into_iter().map(|n| error(words, n)).collect::<Vec<_>>();
            println!("{gamma} {words:?}: {} orders {}", show(&errors), show(&orders(&errors)));
            assert!(errors[1] < 0.025 && errors.get(2).is_none_or(|e| *e < 7e-3), "{gamma} {words}: {errors:?}");
            assert!(orders(&errors).iter().all(|order| *order > 1.7), "{gamma} {words}: {errors:?}");
        }
        assert!((error(WOVEN, 12) - error(HINGE, 12)).abs() < 1e-3, "{gamma}");
    }
    // Pinned without a clamp it is a flap, and hangs straight down.
    let flap = simulate(&sheet(HINGE, [12, 3], length(1.0), "\"edge x-\""), Mesh::default()).unwrap();
    assert!(drop_over_reach(flap).abs() > 10.0);
}

/// The same on triangles of a mesh, and on a panel that is cut.
#[test]
#[ignore = "long: make validate"]
fn the_rims_of_meshes_and_panels_are_clamped_alike() {
    let (gamma, exact) = GAMMA[1];
    let l = length(gamma);
    let n = 16_u32;
    let cell = l / f64::from(n);
    for backward in [false, true] {
        let vertices = (0..6 * (n + 1)).map(|i| [f64::from(i % (n + 1)) * cell, f64::from(i / (n + 1)) * cell, 0.0]).collect();
        let mut triangles = Vec::new();
        for (i, j) in (0..5).flat_map(|j| (0..n).map(move |i| (i, j))) {
            let [a, b, c, d] = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(|[i, j]| i + (n + 1) * j);
            triangles.extend(if backward { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] });
        }
        let mesh = Mesh { vertices, triangles, ..Mesh::default() };
        for words in [HINGE, WOVEN] {
            let text = format!(
                "[[net]]\nname = \"s\"\ndensity = {DENSITY}\nmesh.path = \"mesh\"\nlinks = {{}}\n{words}\n\
                 pin = [{{ center = [{}, {}, 0], radius = {}, clamp = true }}]\n",
                -100.0 * cell,
                2.5 * cell,
                100.04 * cell
            );
            let found = drop_over_reach(simulate(&text, mesh.clone()).unwrap());
            println!("net, backward {backward}, {words:?}: {:+.3} %", 100.0 * (found / exact - 1.0));
            assert!((found / exact - 1.0).abs() < 0.015, "{backward} {words}: {found} {exact}");
        }
    }
    let text = format!(
        "[[cloth]]\nname = \"s\"\ndensity = {DENSITY}\nresolution = {cell}\nlinks = {{}}\n{HINGE}\n\
         pin = [{{ center = [{}, {}, 0], radius = {}, clamp = true }}]\n\
         [[cloth.panels]]\nname = \"p\"\norigin = [0, 0, 0]\nright = [1, 0, 0]\nup = [0, 1, 0]\n\
         outline = [[0, 0], [{l}, 0], [{l}, {w}], [0, {w}]]\n",
        -100.0 * cell,
        2.5 * cell,
        100.04 * cell,
        w = 5.0 * cell
    );
    let found = drop_over_reach(simulate(&text, Mesh::default()).unwrap());
    println!("panel: {:+.3} %", 100.0 * (found / exact - 1.0));
    assert!((found / exact - 1.0).abs() < 0.03, "panel: {found} {exact}");
}

/// A clamp that a solid carries turns the rim with it: upright from level, the strip hangs straight down as one that is cut so.
#[test]
fn a_clamp_turns_with_the_solid_that_carries_it() {
    let l = length(5.0);
    let jaw = |turn: f64| {
        format!(
            "[[collider]]\nname = \"jaw\"\nshape = {{ box = {{ center = [{}, 0, 0.3], size = [0.01, 0.01, 0.01] }} }}\n\
             motion = {{ pivot = [{}, 0, 0], keys = [{{ time = 0 }}, {{ time = 0.5, rotate = [0, {turn}, 0] }}] }}\n",
            -l / 2.0,
            -l / 2.0
        )
    };
    let carried = "{ which = \"edge x-\", clamp = true, follow = { collider = \"jaw\" } }";
    let turned = |turn: f64| {
        let text = jaw(turn) + &sheet(HINGE, [12, 3], l, carried);
        tip(simulate(&text, Mesh::default()).unwrap(), Vector::from([1.0, 0.0, 0.0]))
    };
    // Down, and a slope of 30 degrees against a strip that starts so.
    let down = turned(90.0);
    assert!(down.x.abs() < 1e-3 * l && (down.z / -l - 1.0).abs() < 1e-3, "{down:?}");
    let found = turned(30.0);
    let start = Vector::from([30_f64.to_radians().cos(), 0.0, -(30_f64.to_radians().sin())]);
    let text = sheet(&format!("{HINGE}\nrotate = [0, 30, 0]"), [12, 3], l, CLAMPED);
    let exact = tip(simulate(&text, Mesh::default()).unwrap(), start);
    assert!((found - exact).norm() < 1e-3 * l, "{found:?} {exact:?}");
    assert!((found - turned(0.0)).norm() > 0.1 * l);
}

/// Two pins that hold an edge between them clamp it as one does, and one that holds more clamps no less.
#[test]
fn an_edge_is_clamped_by_all_pins_together() {
    let hung = |pin: &str| tip(simulate(&sheet(HINGE, [6, 2], length(1.0), pin), Mesh::default()).unwrap(), Vector::from([1.0, 0.0, 0.0]));
    let each: Vec<String> = (0..3).map(|j| format!("{{ which = \"vertex 0 {j}\", clamp = true }}")).collect();
    let one = hung(CLAMPED);
    assert_eq!(hung(&each.join(", ")), one);
    assert_eq!(hung(&format!("{CLAMPED}, {CLAMPED}")), one);
    assert!(one.z < 0.0 && one.x > 0.1 * length(1.0));
}

/// What has no slope, or none that could be held, is told with a cure.
#[test]
fn a_clamp_without_a_slope_is_an_error() {
    let told = |text: &str| simulate(text, Mesh::default()).err().map(|e| e.to_string()).unwrap_or_default();
    let soft = told(&sheet("links = { structural = 100 }", [4, 4], 0.1, CLAMPED));
    assert!(soft.contains("pin[0].clamp: only a sheet, net or cloth that has hinge, isometric or fabric"), "{soft}");
    let torn = told(&sheet(&format!("{HINGE}\ntear.strain = 0.3"), [4, 4], 0.1, CLAMPED));
    assert!(torn.contains("and does not tear"), "{torn}");
    let corner = told(&sheet(HINGE, [4, 4], 0.1, "{ which = \"corner 0 0\", clamp = true }"));
    assert!(corner.contains("no edge of the rim lies between these masses"), "{corner}");
    let plate = told(&sheet("isometric = 1e-4", [4, 4], 0.1, "{ which = \"corner 0 0\", clamp = true }"));
    assert!(plate.contains("no edge of the rim lies between these masses"), "{plate}");
    let passing = told(&sheet(HINGE, [4, 4], 0.1, "{ which = \"edge x-\", clamp = true, until = 1 }"));
    assert!(passing.contains("held for the whole run; leave out from and until"), "{passing}");
    let rope =
        told("[[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 4\npin = [{ which = \"start\", clamp = true }]\n");
    assert!(rope.contains("rope \"r\".pin[0].clamp: only a sheet"), "{rope}");
}
