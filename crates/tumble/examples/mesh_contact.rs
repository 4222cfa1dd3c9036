//! Cost of finding the self-contacts of a folded sheet: milliseconds per stage, and the numbers of pairs found. `cargo run --release -p tumble
//! --example mesh_contact -- [squares per side] [threads]`

#![allow(clippy::unwrap_used)]

use std::time::Instant;
use tumble::geometry::mesh_contact::{Detector, Owner, Topology};
use tumble::math::{Real, Row};

/// A sheet of 1 m, folded twice into layers that are 3 mm apart, wrinkled and turned: no axis is along an edge.
fn folded(n: u32, flat: bool) -> Vec<Row> {
    let place = |i: u32, j: u32| {
        let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
        let fold = |u: f64| {
            let (turn, s) = ((4.0 * u) as i32, (4.0 * u).fract());
            (if turn % 2 == 0 { 0.25 * s } else { 0.25 * (1.0 - s) }, f64::from(turn), s)
        };
        let (x, layer, s) = if flat { (u, 0.0, 0.0) } else { fold(u) };
        // Layers part smoothly at the folds.
        let z = 0.003 * (layer + (s - 0.5).powi(5) * 16.0) + 0.004 * (40.0 * x).sin() * (31.0 * v).cos();
        let (c, s) = (0.8, 0.6);
        let (x, y) = (c * x - s * v, s * x + c * v);
        [x as Real, (c * y - s * z) as Real, (s * y + c * z) as Real, 1.0]
    };
    (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j))).map(|(i, j)| place(i, j)).collect()
}

fn triangles(n: u32) -> Vec<[u32; 3]> {
    let at = |i: u32, j: u32| j * (n + 1) + i;
    let square = |i: u32, j: u32| {
        let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
        if (i + j).is_multiple_of(2) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
    };
    (0..n).flat_map(|j| (0..n).flat_map(move |i| square(i, j))).collect()
}

fn main() {
    let mut words = std::env::args().skip(1).map(|w| w.parse::<u32>());
    let n = words.next().and_then(Result::ok).unwrap_or(100);
    let threads = words.next().and_then(Result::ok).unwrap_or(2);
    rayon::ThreadPoolBuilder::new().num_threads(threads as usize).build_global().unwrap();
    for (name, flat, reach) in [("flat", true, 0.004), ("folded", false, 0.004), ("folded, far", false, 0.008)] {
        let x = folded(n, flat);
        let mut topology = Topology::new(x.len());
        topology.add(Owner { radius: 0.001, itself: true, hair: false }, &triangles(n), &[], &[]);
        topology.set_rest(&folded(n, true));
        let mut detector = Detector::new();
        detector.detect(&topology, &x, reach);
        let best = |f: &mut dyn FnMut()| {
            (0..25).fold(f64::INFINITY, |best, _| {
                let start = Instant::now();
                f();
                best.min(start.elapsed().as_secs_f64() * 1e3)
            })
        };
        let detect = best(&mut || detector.detect(&topology, &x, reach));
        let hold = best(&mut || {
            let mut x: Vec<Row> = x.iter().map(|[a, b, c, w]| [*a, *b, *c - 0.002, *w]).collect();
            detector.hold(&topology, &mut x);
        });
        let judge = best(&mut || {
            detector.intersections(&topology, &x);
        });
        println!(
            "{name}: {} vertices, {} triangles, {} edges, reach {reach} m: detect {detect:.2} ms ({} pairs), hold {hold:.2} ms, intersections {judge:.2} ms ({})",
            x.len(),
            topology.triangles().len(),
            topology.edges().len(),
            detector.pairs().len(),
            detector.intersections(&topology, &x).len(),
        );
    }
}
