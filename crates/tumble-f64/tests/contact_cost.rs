//! What self-contact has to look at does not depend on what a surface is at rest, nor on how fast all of it goes; and nothing passes for it.
//! docs/theory/contact.md, "Neighbours" and "Common motion".

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, run, simulation, step, vector, velocities, write};
use std::f64::consts::PI;
use tumble_f64::geometry::mesh_contact::{
    Detector, Held, Owner, PairKind, Topology, common_ways, edge_edge, intersections, point_triangle,
};
use tumble_f64::math::Row;
use tumble_interface::Engine;

/// Squares at a side of a sheet, and vertices.
const N: u32 = 16;
const ALL: usize = 17 * 17;

/// A sheet with edges of 1 m and diagonals of both directions.
fn sheet(place: impl Fn(f64, f64) -> Vector) -> Vec<Row> {
    let at = |k: u32| place(f64::from(k % (N + 1)), f64::from(k / (N + 1)));
    (0..(N + 1) * (N + 1)).map(at).map(|v| [v.x, v.y, v.z, 1.0]).collect()
}

fn flat(u: f64, v: f64) -> Vector {
    vector(u, v, 0.0)
}

fn triangles(first: u32) -> Vec<[u32; 3]> {
    let at = |i: u32, j: u32| first + j * (N + 1) + i;
    let square = |i: u32, j: u32| {
        let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
        if (i + j).is_multiple_of(2) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
    };
    (0..N).flat_map(|j| (0..N).flat_map(move |i| square(i, j))).collect()
}

/// Windings of a coil are no neighbours, though they are of one curve: they touch at their distance at rest. The next pieces of a winding, just as
/// near, are neighbours and no pairs at rest.                                                                        (contact.24)
#[test]
fn windings_of_a_coil_touch_at_their_distance_at_rest() {
    let (turn, pitch, thickness) = (24_u32, 1.0, 1.2);
    let place = |k: u32| {
        let angle = 2.0 * PI * f64::from(k) / f64::from(turn);
        vector(2.0 * angle.cos(), 2.0 * angle.sin(), pitch * angle / (2.0 * PI))
    };
    let n = 3 * turn;
    let x: Vec<Row> = (0..=n).map(place).map(|v| [v.x, v.y, v.z, 1.0]).collect();
    let mut topology = Topology::new(x.len());
    let segments: Vec<[u32; 2]> = (0..n).map(|k| [k, k + 1]).collect();
    topology.add(Owner { radius: 0.5 * thickness, itself: true, hair: false }, &[], &segments, &[]);
    topology.set_rest(&x);
    let mut detector = Detector::new();
    detector.detect(&topology, &x, 2.0 * thickness);
    let mut across = 0;
    for pair in detector.pairs() {
        let [a, _, c, _] = pair.vertices;
        if pair.distance > thickness {
            assert!((pair.thickness - thickness).abs() < 1e-6, "{pair:?}");
        } else {
            across += 1;
            assert!(a.abs_diff(c) > turn / 2 && (pair.thickness - pair.distance).abs() < 1e-6, "{pair:?}");
        }
    }
    assert!(across > 100, "{across}");
}

/// Sheets of a thickness, each an object, flat at rest.
fn topology(sheets: usize, thickness: f64) -> Topology {
    let mut topology = Topology::new(sheets * ALL);
    for k in 0..sheets {
        topology.add(Owner { radius: 0.5 * thickness, itself: true, hair: false }, &triangles((k * ALL) as u32), &[], &[]);
    }
    let rest: Vec<Row> = (0..sheets).flat_map(|k| sheet(|u, v| vector(u, v, 100.0 * k as f64))).collect();
    topology.set_rest(&rest);
    topology
}

fn at(x: &[Row], v: u32) -> Vector {
    let [x, y, z, _] = x[v as usize];
    vector(x, y, z)
}

/// All features without a common vertex: their vertices, the weights of the nearest places, the distance.
fn all(topology: &Topology, x: &[Row]) -> Vec<(PairKind, [u32; 4], [f64; 4], f64)> {
    let mut found = Vec::new();
    for v in topology.points() {
        for t in topology.triangles().iter().filter(|t| !t.contains(v)) {
            let near = point_triangle(at(x, *v), t.map(|v| at(x, v)));
            found.push((PairKind::PointTriangle, [*v, t[0], t[1], t[2]], near.weights, near.distance_sq.sqrt()));
        }
    }
    for (i, e) in topology.edges().iter().enumerate() {
        for f in topology.edges()[i + 1..].iter().filter(|f| !f.contains(&e[0]) && !f.contains(&e[1])) {
            let near = edge_edge(e.map(|v| at(x, v)), f.map(|v| at(x, v)));
            found.push((PairKind::EdgeEdge, [e[0], e[1], f[0], f[1]], near.weights, near.distance_sq.sqrt()));
        }
    }
    found
}

/// However thick a sheet is, it has no pairs where it lies flat, sheared, stretched or gently waved, and a little motion is free; up to half an edge,
/// bounds are the reach.                                                                                             (contact.24)
#[test]
fn what_is_near_at_rest_is_no_pair_at_any_thickness() {
    let places: [(&str, fn(f64, f64) -> Vector); 4] = [
        ("flat", flat),
        ("sheared", |u, v| vector(u + 0.15 * v, v, 0.0)),
        ("pressed", |u, v| vector(0.85 * u, v, 0.0)),
        ("waved", |u, v| vector(u, v, 0.4 * (2.0 * PI * u / 8.0).sin())),
    ];
    for (name, place) in places {
        let x = sheet(place);
        for thickness in [0.4, 0.65, 0.73, 0.9, 1.1, 1.5, 2.5] {
            let topology = topology(1, thickness);
            let mut detector = Detector::new();
            detector.detect(&topology, &x, 1.5 * thickness);
            let near = all(&topology, &x).iter().filter(|pair| pair.3 < 1.5 * thickness).count();
            println!("{name}, thickness {thickness} edges: {} pairs of {near} that are near", detector.pairs().len());
            assert!(detector.pairs().is_empty() && near < 100_000, "{name} {thickness}");
            assert!(thickness < 0.7 || near > 2000, "{near}");
            // A vertex has the nearest other one, or side, at 0.707 edges, pressed or sheared somewhat nearer: 0.45 of that is free.
            let least = detector.bounds().iter().copied().fold(f64::INFINITY, f64::min);
            let free = if thickness < 0.5 { 0.45 * 1.5 * thickness..0.271 } else { 0.24..0.33 };
            assert!(free.contains(&least), "{name} {thickness}: {least}");
        }
    }
}

/// Folded about a cylinder of half the thickness, whatever is nearer than its contact distance is a pair: half of the way at rest between the nearest
/// places where both are neighbours, else all of the thickness.                                                  (contact.24)
#[test]
fn a_fold_has_the_pairs_of_brute_force() {
    for thickness in [0.5, 1.1, 1.7] {
        let topology = topology(1, thickness);
        let (rest, middle) = (sheet(flat), 0.5 * f64::from(N) + 0.3);
        // A hairpin of a radius of 0.2 thicknesses, tighter than it may be.
        let fold = |radius: f64| {
            sheet(|u, v| {
                let (s, turned) = (u - middle, PI * radius);
                if s < 0.0 {
                    vector(s, v, 0.0)
                } else if s < turned {
                    vector(radius * (s / radius).sin(), v, radius * (1.0 - (s / radius).cos()))
                } else {
                    vector(turned - s, v, 2.0 * radius)
                }
            })
        };
        let counts = [0.2, 0.52].map(|radius| {
            let x = fold(radius * thickness);
            let mut detector = Detector::new();
            detector.detect(&topology, &x, 1.5 * thickness);
            let mut wanted = 0;
            for (kind, vertices, weights, distance) in all(&topology, &x) {
                let way = (0..4).fold(vector(0.0, 0.0, 0.0), |sum, k| sum + at(&rest, vertices[k]) * weights[k]).norm();
                let contact = thickness.min(0.5 * way);
                if distance < contact * (1.0 - 1e-12) {
                    wanted += 1;
                    let pair = detector.pairs().iter().find(|pair| (pair.kind, pair.vertices) == (kind, vertices));
                    let pair = pair.unwrap_or_else(|| panic!("{vertices:?} at {distance} of {contact} is left out"));
                    assert!((pair.thickness - contact).abs() < 1e-12, "{pair:?} {contact}");
                }
            }
            (wanted, detector.pairs().len())
        });
        println!("thickness {thickness}: {counts:?} pairs in contact, and found");
        let [tight, wide] = counts;
        // Edges cut the corner of the wider one, the more the coarser they are beside it.
        assert!(tight.0 > 1000 && tight.1 < 6 * tight.0 && 50 * wide.0 < tight.0 && wide.1 > 500, "{counts:?}");
    }
}

fn ways_of(x: &[Row], way: impl Fn(usize, Vector) -> Vector) -> Vec<Vector> {
    (0..x.len()).map(|v| way(v, at(x, v as u32))).collect()
}

fn found(topology: &Topology, x: &[Row], ways: &[Vector], parts: usize) -> Detector {
    let all: Vec<u32> = (0..(parts * ALL) as u32).collect();
    let parts: Vec<&[u32]> = all.chunks(ALL).collect();
    let mut detector = Detector::new();
    detector.detect_along(topology, x, ways, &common_ways(&parts, x, ways, 3.0, &|_, _| false), 0.9);
    detector
}

/// Pairs and what is free are the same at rest and in any motion that all have in common: moved, turned, or two sheets that leave each other.
/// Sheets that fly at each other do meet.                                                                        (contact.25)
#[test]
fn pairs_in_common_motion_are_those_at_rest() {
    let crumpled = |u: f64, v: f64| vector(u, 0.3 * v, 0.4 * (2.0 * u).sin() + 0.3 * (3.0 * v).cos());
    let one = topology(1, 0.6);
    let x = sheet(crumpled);
    let still = found(&one, &x, &vec![vector(0.0, 0.0, 0.0); ALL], 1);
    assert!(still.pairs().len() > 2000, "{}", still.pairs().len());
    let moving: [(&str, fn(usize, Vector) -> Vector); 3] = [
        ("moved", |_, _| vector(3.0, -50.0, 8.0)),
        ("turned", |_, x| vector(0.0, 0.0, 0.01).cross(x)),
        ("both", |_, x| vector(40.0, 0.0, 2.0) + vector(0.01, 0.0, -0.02).cross(x)),
    ];
    for (name, way) in moving {
        let ways = ways_of(&x, way);
        let detector = found(&one, &x, &ways, 1);
        let vertices = |detector: &Detector| detector.pairs().iter().map(|p| p.vertices).collect::<Vec<_>>();
        // A turn by 0.01 is an affine map that lengthens by 5e-5.
        let (a, b) = (vertices(&still), vertices(&detector));
        println!("{name}: {} pairs, {} at rest", b.len(), a.len());
        assert!(if name == "moved" { a == b } else { a.len().abs_diff(b.len()) < a.len() / 100 }, "{name}");
        for (a, b) in still.bounds().iter().zip(detector.bounds()) {
            assert!((a - b).abs() < if name == "moved" { 1e-12 } else { 2e-3 }, "{a} {b}");
        }
        // All go there.
        let mut detector = detector;
        let mut next: Vec<Row> = x.iter().zip(&ways).map(|(x, w)| [x[0] + w.x, x[1] + w.y, x[2] + w.z, x[3]]).collect();
        let there = next.clone();
        assert_eq!(detector.hold(&one, &mut next), Held::default());
        assert_eq!(next, there);
        // Most of them are stopped: they may be, and nothing passes for it.
        let mut next: Vec<Row> = (0..ALL).map(|v| if v % 17 < 13 { x[v] } else { there[v] }).collect();
        let held = detector.hold(&one, &mut next).held;
        println!("{held} held where most are stopped");
        assert!(held > 10 || name == "turned");
        assert_eq!(intersections(&one, &next), []);
        assert!((0..ALL).filter(|v| v % 17 < 12).all(|v| (at(&next, v as u32) - at(&x, v as u32)).norm() < 1e-9 || name == "turned"));
    }
    let two = topology(2, 0.6);
    let x: Vec<Row> = sheet(crumpled).into_iter().chain(sheet(|u, v| crumpled(u, v) + vector(0.0, 0.0, 10.0))).collect();
    let count = |speed: f64| found(&two, &x, &ways_of(&x, |v, _| vector(60.0, 0.0, if v < ALL { speed } else { -speed })), 2).pairs().len();
    println!("{} pairs apart, {} together", count(-30.0), count(10.0));
    assert_eq!(count(-30.0), 2 * still.pairs().len());
    assert!(count(10.0) > 4 * still.pairs().len());
    // Two that are about to meet are one neighbourhood: what they have in common leaves their approach.
    let all: Vec<u32> = (0..2 * ALL as u32).collect();
    let parts: Vec<&[u32]> = all.chunks(ALL).collect();
    let ways = ways_of(&x, |v, _| vector(60.0, 0.0, if v < ALL { 10.0 } else { -10.0 }));
    let common = common_ways(&parts, &x, &ways, 3.0, &|_, _| false);
    assert!(common.iter().all(|c| (*c - vector(60.0, 0.0, 0.0)).norm() < 1.0), "{:?}", common[0]);
    // Nothing is sure to be in common beside what may stop it.
    assert!(common_ways(&parts, &x, &ways, 3.0, &|centre, radius| centre.x.abs() < radius).is_empty());
    // Nothing in common, nothing to take off.
    let ways = ways_of(&x, |v, _| vector(0.0, 0.0, if v < ALL { 10.0 } else { -10.0 }));
    assert!(common_ways(&parts, &x, &ways, 3.0, &|_, _| false).is_empty());
}

const SHEET: &str = "size = [1, 1]\nresolution = [17, 17]\nlinks = { structural = 200, shear = 50 }\nhinge = 1e-5\ndensity = 0.2\n";

fn scene(thickness: f64, more: &str) -> String {
    let contact = if thickness > 0.0 { format!("self_contact = {{ thickness = {thickness}, friction = 0.4 }}\n") } else { String::new() };
    format!(
        "precision = \"double\"\ntime.fps = 24\nworld.gravity = [0, 0, 0]\n[[system]]\nmethod = \"position_based\"\nsubsteps = 10\n{contact}{more}"
    )
}

/// Its own thickness, of 1.5 edges, neither moves a sheet at rest nor changes by a bit how it stretches, shears and flies.
#[test]
fn a_thick_sheet_moves_as_without_contact() {
    for (name, shape) in [("at rest", 0.0), ("in motion", 1.0)] {
        let mut sims = [0.0, 1.5 / 16.0].map(|thickness| simulation(&scene(thickness, &format!("[[sheet]]\nname = \"s\"\n{SHEET}"))));
        let start = positions(&sims[0], "s");
        let speed = |x: &Vector| vector(16.0 + 0.3 * x.y, 0.2 * x.x * x.y, 0.2 * (3.0 * x.x).sin()) * shape;
        for sim in &mut sims {
            write(sim, "s", "velocity", &start.iter().map(speed).collect::<Vec<_>>());
            run(sim, 12);
        }
        let [without, with] = [0, 1].map(|k| positions(&sims[k], "s"));
        let moved = with.iter().zip(&start).map(|(a, b)| (*a - *b).norm()).fold(0.0, f64::max);
        println!("{name}: moved by {moved} m");
        assert!(with == without, "{name}");
        assert!(if shape == 0.0 { with == start } else { moved > 7.0 }, "{moved}");
    }
}

/// What can tear flies on, too: its spare vertices, which stay behind, have no part in the motion in common.
#[test]
fn a_sheet_that_can_tear_is_not_braked_by_its_own_contact() {
    let tearing = format!("[[sheet]]\nname = \"s\"\n{SHEET}tear = {{ strain = 5 }}\n");
    let mut sims = [0.0, 1.5 / 16.0].map(|thickness| simulation(&scene(thickness, &tearing)));
    for sim in &mut sims {
        let v = positions(sim, "s").iter().map(|x| vector(16.0 + 0.3 * x.y, 0.2 * x.x * x.y, 0.0)).collect::<Vec<_>>();
        write(sim, "s", "velocity", &v);
        run(sim, 12);
    }
    let [without, with] = [0, 1].map(|k| positions(&sims[k], "s"));
    assert!(with[..ALL] == without[..ALL] && with[0].x > 7.0, "{:?} {:?}", with[0], without[0]);
}

/// Two sheets shot at each other at 16 m/s each, beside 100 m/s in common: nothing passes, they go on together, and
/// the common speed stays.
#[test]
fn sheets_shot_at_each_other_stop_in_any_frame() {
    for common in [0.0, 100.0] {
        let mut sim = simulation(&scene(
            0.02,
            &format!("[[sheet]]\nname = \"a\"\n{SHEET}[[sheet]]\nname = \"b\"\ncenter = [0.11, 0.07, 0.9]\nrotate = [0, 0, 20]\n{SHEET}"),
        ));
        for (name, v) in [("a", 16.0), ("b", -16.0)] {
            write(&mut sim, name, "velocity", &vec![vector(common, 0.0, v); ALL]);
        }
        let before = Vector::from(sim.ledger().momentum);
        let mean = |of: Vec<Vector>| of.iter().fold(vector(0.0, 0.0, 0.0), |sum, v| sum + *v) * (1.0 / ALL as f64);
        let (mut crossed, mut after) = (0, [vector(0.0, 0.0, 0.0); 2]);
        for frame in 0..24 {
            step(&mut sim);
            crossed += sim.ledger().intersections.unwrap();
            if frame == 2 {
                after = ["a", "b"].map(|name| mean(velocities(&sim, name)));
            }
        }
        let lost = (Vector::from(sim.ledger().momentum) - before).norm();
        let [a, b] = after;
        println!("{common} m/s: {crossed} crossings, {lost:.2e} N s lost, {a:?} {b:?} m/s");
        // A frame of theirs is 1.3 m, past each other: who has passed is still as fast.
        assert!(crossed == 0 && a.z.abs() < 4.0 && b.z.abs() < 4.0, "{crossed} {a:?} {b:?}");
        // What is held back loses momentum, at most a part of what each brings along: 3.2 N s.
        assert!(lost < 0.05 * 3.2 && (a.x - common).abs() < 0.5, "{lost} {a:?}");
    }
}

/// The upper half of a bent sheet falls on the other half, which lies on a floor, at thicknesses below and above an edge: nothing passes, and away from
/// the crease the halves rest a thickness apart.
#[test]
fn a_thick_sheet_folds_on_itself_without_passing() {
    for edges in [0.5, 1.1] {
        let thickness = edges / 16.0;
        let text = scene(
            thickness,
            &format!(
                "[[sheet]]\nname = \"s\"\ncenter = [0, 0, 0.01]\n{SHEET}[[collider]]\nname = \"floor\"\nthickness = 0.01\nfriction = 0.8\nshape.floor.height = 0\n"
            ),
        );
        let mut sim = simulation(&text.replace("gravity = [0, 0, 0]", "gravity = [0, 0, -9.81]").replace("substeps = 10", "substeps = 20"));
        // Half a circle, and the other half above.
        let radius = 0.15;
        let bend = |x: &Vector| match x.x {
            s if s < 0.0 => *x,
            s if s < PI * radius => vector(radius * (s / radius).sin(), x.y, x.z + radius * (1.0 - (s / radius).cos())),
            s => vector(PI * radius - s, x.y, x.z + 2.0 * radius),
        };
        let start = positions(&sim, "s");
        write(&mut sim, "s", "position", &start.iter().map(bend).collect::<Vec<_>>());
        let mut crossed = 0;
        for _ in 0..48 {
            step(&mut sim);
            crossed += sim.ledger().intersections.unwrap();
        }
        let x = positions(&sim, "s");
        // The side that was at x = 0.5.
        let side: Vec<Vector> = (0..17).map(|j| x[17 * j + 16]).collect();
        let over = side.iter().filter(|x| x.x < 0.0).count();
        let (low, high) = side.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), x| (l.min(x.z), h.max(x.z)));
        println!(
            "{edges} edges: {crossed} crossings, {over} of 17 over, {low:.4} to {high:.4} m above the floor, thickness {thickness:.4} m"
        );
        assert!(crossed == 0 && over == 17, "{crossed} {over}");
        assert!(low > 0.9 * (thickness + 0.01) && high < 2.0 * thickness + 0.05, "{low} {high}");
    }
}
