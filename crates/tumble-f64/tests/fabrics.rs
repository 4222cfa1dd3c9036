//! Measured fabrics against their records: what a pulled triangle and a bent hinge answer, and how strips hang. docs/theory/fabrics.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, run, write};
use std::collections::HashMap;
use tumble_f64::elements::{Linear, Membrane, Woven, WovenBending, energy, forces, moment};
use tumble_f64::scene::Simulation;
use tumble_interface::{Assets, Engine, Fabric, Scene};

const SHIPPED: [&str; 3] = ["denim", "interlock", "tablecloth"];
const G: f64 = 9.8;
const IMPLICIT: &str = "integrator = \"implicit_euler\"\nsolver = { newton_tolerance = 1e-3, linear_tolerance = 0.1 }";

fn record(name: &str) -> Fabric {
    tumble_io::shipped(name).unwrap()
}

/// A unit right triangle in the axes of the fabric after a stretch along each: its energy, and its forces on x1 along x and on x2 along y.
fn pulled(fabric: &Fabric, along: f64, across: f64, shear: f64) -> (f64, f64, f64) {
    let corner = |x: f64, y: f64| [x, y, 0.0, 1.0];
    let rest = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Vector::from);
    let (b, area) = Membrane::axes(rest, Vector::from([1.0, 0.0, 0.0]), 0.0).unwrap();
    let rest = Woven::rest(b, fabric, 1.0);
    let x = [corner(0.0, 0.0), corner(along, 0.0), corner(shear, across)];
    let f = forces::<Woven, Linear, f64, 3, 3, 28, 0>(area, [], rest, x, None);
    (energy::<Woven, Linear, f64, 3, 3, 28, 0>(area, [], rest, x), f[1].x, f[2].y)
}

/// The force per width at a stretch w is w 2 C e, with e = (w² - 1)/2 and C between small strain and 7/6: (fabrics.2), by hand.
#[test]
fn a_triangle_pulled_along_warp_or_weft_answers_as_the_record_says() {
    let denim = record("denim");
    // Warp at 1.05: v = 0.3, C11 = 0.7 x 205.352005 + 0.3 x 232.027634 = 213.3546937, e = 0.05125: 1.05 x 2 x C11 x e.
    // Weft at 1.05: C22 = 0.7 x 1013.88629 + 0.3 x 1051.55712 = 1025.187539.
    for (found, exact) in [(-2.0 * pulled(&denim, 1.05, 1.0, 0.0).1, 22.962_299), (-2.0 * pulled(&denim, 1.0, 1.05, 0.0).2, 110.335_809)] {
        // The area is a half, the width 1.
        assert!((found / exact - 1.0).abs() < 1e-7, "{found} {exact}");
    }
    // All of the record, and constant beyond it.
    for name in SHIPPED {
        let f = record(name);
        for w in [1.0001, 1.02, 1.1, 1.16, 7.0 / 6.0, 1.2, 1.4] {
            let (e, v) = (0.5 * (w * w - 1.0), (6.0 * (w - 1.0_f64)).min(1.0));
            let c = |row: usize, i: usize| f.stretching[0][i] + (f.stretching[row][i] - f.stretching[0][i]) * v;
            let (warp, weft) = (-2.0 * pulled(&f, w, 1.0, 0.0).1, -2.0 * pulled(&f, 1.0, w, 0.0).2);
            assert!((warp / (2.0 * w * e * c(1, 0)) - 1.0).abs() < 1e-9, "{name} warp at {w}: {warp}");
            assert!((weft / (2.0 * w * e * c(5, 2)) - 1.0).abs() < 1e-9, "{name} weft at {w}: {weft}");
        }
        // Shear at small strain: E = A C33 (2 e12)²/4 with 2 e12 = 1e-4.
        let (shear, _, _) = pulled(&f, 1.0, 1.0, 1e-4);
        assert!((shear / (0.5 * f.stretching[0][3] * 1e-8 / 4.0) - 1.0).abs() < 0.02, "{name}: {shear:e}");
    }
}

/// The work along a straight way of strain is that of C(e) e, whatever the direction: by quadrature of the record itself.
#[test]
fn the_energy_is_the_work_that_the_record_tells() {
    let (d1, d2, gamma) = (0.03, -0.008, 0.09_f64);
    for name in SHIPPED {
        let f = record(name);
        // The principal direction of this strain is 35.4 degrees off the warp; only its rows take part, as the smooth step says.
        let q = ((d1 - d2) * (d1 - d2) + gamma * gamma).sqrt();
        let (g, c) = (0.5 * (d1 + d2 + q), (d1 - d2) / q);
        let root = 0.5_f64.sqrt();
        assert!(c < root && c > 0.0);
        let u = (root - c) / root;
        let step = u * u * (3.0 - 2.0 * u);
        let coefficient = |i: usize, v: f64| {
            let row = |k: usize| f.stretching[k][i].max(0.0);
            row(0) + v * (row(2) + step * (row(3) - row(2)) - row(0))
        };
        let n = 4000_u32;
        let work: f64 = (0..n)
            .map(|k| {
                let s = (f64::from(k) + 0.5) / f64::from(n);
                let v = (6.0 * ((1.0 + 2.0 * s * g).sqrt() - 1.0)).min(1.0);
                let c = |i| coefficient(i, v);
                2.0 * s * (c(0) * d1 * d1 + 2.0 * c(1) * d1 * d2 + c(2) * d2 * d2 + c(3) * gamma * gamma / 4.0) / f64::from(n)
            })
            .sum();
        // A unit of warp along x, then weft so that the Green strain is this one.
        let along = (1.0 + 2.0 * d1).sqrt();
        let (shear, across_sq) = (gamma / along, 1.0 + 2.0 * d2);
        let (energy, _, _) = pulled(&f, along, (across_sq - shear * shear).sqrt(), shear);
        assert!((energy / (0.5 * work) - 1.0).abs() < 1e-6, "{name}: {energy:e} {:e}", 0.5 * work);
    }
}

#[test]
fn the_moment_is_that_of_the_record_and_never_falls() {
    // Nothing is lost of samples that do not fall faster than 1/kappa.
    let b = [2.0, 1.5, 1.2, 1.8, 1.6];
    let row = WovenBending::samples(b).unwrap();
    let at = |row, kappa: f64| 10.0 * moment(row, kappa / 10.0).0;
    for (i, b) in b.iter().enumerate().skip(1) {
        let kappa = 10.0 * i as f64;
        assert!((at(row, kappa) / (b * kappa) - 1.0).abs() < 1e-12, "{i}");
    }
    // Between samples, at the start and beyond the last.
    for (kappa, b) in [(1e-6, 2.0 - 0.05e-6), (14.0, 1.38), (36.0, 1.68), (70.0, 1.6)] {
        assert!((at(row, kappa) / (b * kappa) - 1.0).abs() < 1e-9, "{kappa}");
    }
    // A record that falls: the moment stays, until the last sample reaches it: 3 b3/b4 = 9.
    let row = WovenBending::samples([2.0, 2.0, 2.0, 1.5, 0.5]).unwrap();
    for (kappa, exact) in [(30.0, 45.0), (40.0, 45.0), (88.0, 45.0), (100.0, 50.0)] {
        assert!((at(row, kappa) / exact - 1.0).abs() < 1e-12, "{kappa}: {}", at(row, kappa));
    }
    for name in SHIPPED {
        for row in record(name).bending {
            let row = WovenBending::samples(row).unwrap();
            let steps: Vec<(f64, f64)> = (0..2000).map(|i| moment(row, f64::from(i) * 0.005)).collect();
            assert!(steps.windows(2).all(|w| w[1].0 - w[0].0 > -1e-15) && steps[1].0 > 0.0, "{name}");
            // The work is the integral of the moment.
            assert!(steps.windows(2).all(|w| (w[1].1 - w[0].1 - 0.0025 * (w[0].0 + w[1].0)).abs() < 1e-5 * w[1].0), "{name}");
        }
    }
    assert!(WovenBending::samples([0.0, 1.0, 1.0, 1.0, 1.0]).is_none());
}

/// The energy per area of a surface of a fabric that is bent to a cylinder of curvature kappa [1/m], whose creases run at an angle to the warp
/// [degrees], along rows of cells of these sizes: the work of the record's moments.
#[test]
fn a_cylinder_of_any_cells_holds_the_work_of_the_moments_of_its_record() {
    for name in SHIPPED {
        let f = record(name);
        for (row, angle) in [(2, 0.0), (1, 45.0), (0, 90.0), (2, 180.0), (0, -90.0)] {
            let numbers = WovenBending::samples(f.bending[row]).unwrap();
            for (cells, kappa) in [([0.01, 0.01], 3.0), ([0.002, 0.004], 14.0), ([0.003, 0.001], 27.0), ([0.001, 0.0013], 60.0)] {
                let (n, m) = (9, 7);
                let text = format!(
                    "version = 1\nprecision = \"double\"\n[[sheet]]\nname = \"s\"\nsize = [{}, {}]\nresolution = [{n}, {m}]\n\
                     fabric = {{ path = \"it\", angle = {angle} }}\n",
                    cells[0] * f64::from(n - 1),
                    cells[1] * f64::from(m - 1)
                );
                let mut sim = Simulation::new(Scene::from_toml(&text).unwrap(), assets_of(&f)).unwrap();
                let x: Vec<Vector> = positions(&sim, "s")
                    .into_iter()
                    .map(|x| Vector { x: (kappa * x.x).sin() / kappa, y: x.y, z: (1.0 - (kappa * x.x).cos()) / kappa })
                    .collect();
                write(&mut sim, "s", "position", &x);
                // Chords are shorter than arcs; that stretch by (kappa dx)²/24 is not bending.
                let stretch = {
                    let mut sim =
                        Simulation::new(Scene::from_toml(&text.replace("angle", "bending = 1e-12, angle")).unwrap(), assets_of(&f))
                            .unwrap();
                    write(&mut sim, "s", "position", &x);
                    sim.ledger().elastic
                };
                let area = cells[0] * cells[1] * f64::from((n - 1) * (m - 1));
                let exact = 100.0 * moment(numbers, kappa / 10.0).1 * area;
                let found = sim.ledger().elastic - stretch;
                let ends = 1.0 - 1.0 / f64::from(n - 1);
                println!("{name} at {angle}, {cells:?}, {kappa}/m: {:.4}", found / exact);
                // Triangles at the sides may warp between the threads.
                assert!(found / exact < 1.005 && found / exact > ends - 0.03, "{name} {angle} {cells:?} {kappa}: {}", found / exact);
            }
        }
    }
}

fn assets_of(fabric: &Fabric) -> Assets {
    Assets::default().with_fabrics(HashMap::from([("it".to_string(), fabric.clone())]))
}

/// Height over width of the chord of a heavy strip of length L [m] and weight w [N/m²] that is clamped horizontally, with the curvature [1/m]
/// that a moment [N] takes: the elastica, integrated from the tip, whose angle is sought.
fn elastica(length: f64, weight: f64, curvature: &dyn Fn(f64) -> f64) -> f64 {
    let hang = |tip: f64| {
        let (mut angle, mut moment, mut at, mut x, mut z) = (tip, 0.0, 0.0, 0.0, 0.0);
        let h = length / 20_000.0;
        while angle > 0.0 && at < 2.0 * length {
            moment += weight * (at + 0.5 * h) * f64::cos(angle) * h;
            x += h * f64::cos(angle);
            z += h * f64::sin(angle);
            at += h;
            angle -= h * curvature(moment);
        }
        (at, z / x)
    };
    let (mut low, mut high) = (1e-3, 1.57);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if hang(middle).0 < length { low = middle } else { high = middle }
    }
    hang(low).1
}

/// The same of a polygon of n segments of length d [m], each fold of which stands for d, as `strip` has it: exact for finite cells.
fn polygon(n: u32, d: f64, weight: f64, curvature: &dyn Fn(f64) -> f64) -> f64 {
    // From the tip, whose angle is sought, to the clamp, where it must have come to zero.
    let hang = |tip: f64| {
        let (mut angle, mut moment, mut pull, mut x, mut z) = (tip, 0.0, 0.5 * d * weight, 0.0, 0.0);
        for _ in 0..n {
            moment += pull * d * f64::cos(angle);
            x += d * f64::cos(angle);
            z += d * f64::sin(angle);
            pull += d * weight;
            // The moment of a fold is M(kappa) cos(theta/2), with kappa = 2 sin(theta/2)/d.
            let fold = |cos: f64| f64::asin((0.5 * d * curvature(moment / cos)).min(1.0));
            let mut half = 0.0;
            for _ in 0..30 {
                let next = fold(f64::cos(half));
                let done = (next - half).abs() < 1e-15;
                half = next;
                if done {
                    break;
                }
            }
            angle -= 2.0 * half;
        }
        (angle, z / (x + 0.5 * d))
    };
    let (mut low, mut high) = (1e-3, 1.57);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if hang(middle).0 < 0.0 { low = middle } else { high = middle }
    }
    hang(low).1
}

/// The same from a simulated strip that is cut at an angle to the warp.
fn strip(fabric: &Fabric, length: f64, angle: f64, (n, m): (u32, u32), (system, still): (&str, f64)) -> f64 {
    // Folds stand for half a segment to either side: the clamp is half a segment before the last held row.
    let d = length / (f64::from(n) + 0.5);
    let pins: Vec<String> = (0..2).flat_map(|i| (0..m).map(move |j| format!("\"vertex {i} {j}\""))).collect();
    let text = format!(
        "version = 1\nprecision = \"double\"\ntime.fps = 50\n[[system]]\n{system}\n[[force]]\nkind = \"drag\"\nrate = 12\n[[sheet]]\nname = \"s\"\n\
         size = [{}, {}]\nresolution = [{}, {m}]\nfabric = {{ path = \"it\", angle = {angle} }}\npin = [{}]\n",
        d * f64::from(n + 1),
        d * f64::from(m - 1),
        n + 2,
        pins.join(", ")
    );
    let scene = Scene::from_toml(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let mut sim = Simulation::new(scene, assets_of(fabric)).unwrap_or_else(|e| panic!("{e}"));
    run(&mut sim, 100);
    let x = positions(&sim, "s");
    let (row, speed) = ((n + 2) as usize, sim.ledger().speed.unwrap());
    assert!(speed < still, "still moves at {speed} m/s");
    let middle = row * (m / 2) as usize;
    let (clamp, tip) = (x[middle + 1], x[middle + row - 1]);
    (clamp.z - tip.z) / (tip.x - clamp.x + 0.5 * d)
}

/// Bending stiffness of a strip cut at an angle: its creases run across it.
fn across(fabric: &Fabric, angle: f64) -> [f64; 5] {
    fabric.bending[if angle == 0.0 {
        2
    } else if angle == 45.0 {
        1
    } else {
        0
    }]
}

/// Peirce's test: a strip whose overhang is twice its bending length c = (B/(rho g))^(1/3) hangs with its tip 41.5 degrees below the clamp.
/// shared/validation, 2.2 and 2.3.
#[test]
#[ignore = "long: make validate"]
fn strips_of_all_fabrics_hang_at_the_angle_of_the_cantilever_test() {
    let target = 41.5_f64.to_radians().tan();
    // The test's own integrator first: Gamma = 8 is 41.5 degrees.
    let exact = elastica(2.0, 1.0, &|m| m);
    assert!((exact / target - 1.0).abs() < 5e-3, "{exact}");
    for (k, name) in SHIPPED.into_iter().enumerate() {
        for angle in common::cases([0.0, 45.0, 90.0].into_iter().cycle().skip(k).take(3), 3) {
            let mut fabric = record(name);
            fabric.bending = fabric.bending.map(|row| [row[0]; 5]);
            let c = (across(&fabric, angle)[0] / (fabric.density * G)).cbrt();
            let found = strip(&fabric, 2.0 * c, angle, (16, 7), (IMPLICIT, 1e-3));
            println!("{name} at {angle}: overhang {:.2} cm, tangent {found:.4}, {:.2} %", 200.0 * c, 100.0 * (found / target - 1.0));
            // Between the threads the sides of a strip are free to warp: a narrow one bends as least energy allows, W = (D1 kuu² + D2 kvv² + D3 kuv²)/2
            // with kuu/2 + kvv/2 + kuv given.
            let [b0, b45, b90] = fabric.bending.map(|row| row[0]);
            let narrow = 1.0 / (0.25 / b90 + 0.25 / b0 + 1.0 / (4.0 * b45 - b0 - b90));
            let free = if angle == 45.0 { elastica(2.0 * c, fabric.density * G, &|m| m / narrow) } else { target };
            assert!(found > 0.99 * target && found < 1.01 * free, "{name} at {angle}: {found} {free}");
        }
    }
}

/// The whole record, whose stiffness changes with curvature, against the polygon with the same moments, and the elastica that it tends to. Where a
/// record lets the moment stay, curvature jumps within a millimetre of the clamp, which coarse cells do not see. Sweeps of position-based dynamics
/// come to rest where Newton's method does in the same cells.
#[test]
#[ignore = "long: make validate"]
fn strips_of_whole_records_hang_like_the_elastica_with_their_moments() {
    for name in common::cases(SHIPPED, 3) {
        let fabric = record(name);
        for angle in [0.0, 90.0] {
            let b = across(&fabric, angle);
            let length = 1.6 * (b[0] / (fabric.density * G)).cbrt();
            let numbers = WovenBending::samples(b).unwrap();
            let moment = |kappa: f64| 10.0 * moment(numbers, kappa / 10.0).0;
            let curvature = |m: f64| {
                let (mut low, mut high) = (0.0, 1e4);
                for _ in 0..40 {
                    let middle = 0.5 * (low + high);
                    if moment(middle) < m { low = middle } else { high = middle }
                }
                low
            };
            let segments = |n: u32| polygon(n, length / (f64::from(n) + 0.5), fabric.density * G, &curvature);
            let (exact, limit) = (segments(32), elastica(length, fabric.density * G, &curvature));
            assert!((segments(4000) / limit - 1.0).abs() < 2e-3, "{} {limit}", segments(4000));
            let found = strip(&fabric, length, angle, (32, 3), (IMPLICIT, 1e-3));
            println!("{name} at {angle}: tangent {found:.4}, {:.3} %, elastica {limit:.4}", 100.0 * (found / exact - 1.0));
            assert!((found / exact - 1.0).abs() < 1e-3, "{name} at {angle}: {found} {exact}");
            if angle == 90.0 {
                // Sweeps let a strip creep, and one that is twenty times as stiff as knitwear and as light tremble.
                let still = if name == "tablecloth" { 0.15 } else { 0.03 };
                let swept = strip(&fabric, length, angle, (12, 5), ("method = \"position_based\"\nsubsteps = 300", still));
                let exact = strip(&fabric, length, angle, (12, 5), (IMPLICIT, 1e-3));
                println!("{name} at {angle}, by sweeps: {:.3} %", 100.0 * (swept / exact - 1.0));
                assert!((swept / exact - 1.0).abs() < 1.5e-2, "{name} at {angle}: {swept} {exact}");
            }
        }
    }
}
