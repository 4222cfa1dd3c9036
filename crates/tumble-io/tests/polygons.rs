//! Polygons of every shape become triangles that cover them once.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

mod files;

use files::*;
use tumble_interface::Mesh;
use tumble_interface::mesh::Defects;
use tumble_io::{Format, mesh};

/// One polygon as OBJ and as PLY, its corners at these places.
fn both(corners: &[[f64; 3]]) -> [(Vec<u8>, Format); 2] {
    let n = corners.len();
    let rows = |start: &str| corners.iter().map(|[x, y, z]| format!("{start}{x} {y} {z}\n")).collect::<String>();
    let list = |first: usize| (first..first + n).map(|i| i.to_string()).collect::<Vec<_>>().join(" ");
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex {n}\nproperty double x\nproperty double y\nproperty double z\nelement face 1\n\
         property list int int vertex_indices\nend_header\n{}{n} {}\n",
        rows(""),
        list(0)
    );
    [(format!("{}f {}\n", rows("v "), list(1)).into_bytes(), Format::Obj), (ply.into_bytes(), Format::Ply)]
}

fn read(corners: &[[f64; 3]]) -> Mesh {
    let [obj, ply] = both(corners).map(|(bytes, format)| mesh(&bytes, format).unwrap());
    assert_eq!(obj, ply);
    obj
}

/// Sum of the areas, however they face, and of their vectors.
fn areas(mesh: &Mesh) -> (f64, [f64; 3]) {
    let mut sum = (0.0, [0.0; 3]);
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.vertices[i as usize]);
        let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
        let area = [0, 1, 2].map(|k| (u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3]) / 2.0);
        sum.0 += area.iter().map(|x| x * x).sum::<f64>().sqrt();
        (0..3).for_each(|k| sum.1[k] += area[k]);
    }
    sum
}

/// The polygon is covered once, by triangles of all its corners, from wherever its ring begins, in any plane and place.
#[track_caller]
fn covered(ring: &[[f64; 2]], area: f64) {
    let n = ring.len();
    type Place = fn([f64; 2]) -> [f64; 3];
    let places: [Place; 4] = [
        |[x, y]| [x, y, 0.0],
        |[x, y]| [y, x, 7.0], // seen from below
        |[x, y]| [4e5, 5.5e6 + x, y - 3.0],
        |[x, y]| [0.6 * x - 0.48 * y, 0.8 * x + 0.36 * y, 0.8 * y],
    ];
    for (p, place) in places.iter().enumerate() {
        for start in 0..n {
            let corners: Vec<_> = (0..n).map(|k| place(ring[(start + k) % n])).collect();
            let found = read(&corners);
            let (sum, vector) = areas(&found);
            let whole = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
            assert!((sum - area).abs() < 1e-8 && (whole - area).abs() < 1e-8, "place {p}, start {start}: {sum} and {whole}, not {area}");
            assert_eq!((found.vertices.len(), found.triangles.len(), found.defects().degenerate), (n, n - 2, 0), "{p} {start}");
            assert_eq!(found.defects(), Defects { open_edges: n, ..Defects::default() }, "{p} {start}");
        }
    }
}

#[test]
fn concave_polygons_are_covered_once() {
    // An arrow, an L, a comb, and a star with five points.
    covered(&[[0.0, 0.0], [2.0, -1.0], [0.5, 0.0], [2.0, 1.0]], 0.5);
    covered(&[[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 4.0], [0.0, 4.0]], 6.0);
    covered(
        &[
            [0.0, 0.0],
            [5.0, 0.0],
            [5.0, 2.0],
            [4.0, 2.0],
            [4.0, 1.0],
            [3.0, 1.0],
            [3.0, 2.0],
            [2.0, 2.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 2.0],
            [0.0, 2.0],
        ],
        8.0,
    );
    let star: Vec<[f64; 2]> = (0..10)
        .map(|k| {
            let (r, a) = (if k % 2 == 0 { 2.0 } else { 0.5 }, std::f64::consts::PI * f64::from(k) / 5.0);
            [r * a.cos(), r * a.sin()]
        })
        .collect();
    covered(&star, 10.0 * 0.5 * 2.0 * 0.5 * (std::f64::consts::PI / 5.0).sin());
}

#[test]
fn corners_on_straight_sides_stay() {
    covered(&[[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.25, 1.0], [0.0, 1.0]], 1.0);
    covered(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0], [0.0, 1.0]], 3.0);
}

#[test]
fn a_prism_over_a_star_is_closed_and_has_its_volume() {
    // Of six points, and with a corner in the middle of a side that a neighbour has, too.
    let ring: Vec<[f64; 2]> = (0..12)
        .map(|k| (if k % 2 == 0 { 3.0 } else { 1.0 }, f64::from(k) * 30_f64.to_radians()))
        .map(|(r, a)| [r * a.cos(), r * a.sin()])
        .collect();
    let mut text = String::new();
    for z in [0.0, 2.0] {
        ring.iter().for_each(|[x, y]| text += &format!("v {x:.17} {y:.17} {z}\n"));
    }
    let list = |all: &mut dyn Iterator<Item = usize>| format!("f {}\n", all.map(|i| i.to_string()).collect::<Vec<_>>().join(" "));
    text += &list(&mut (1..=12).rev());
    text += &list(&mut (13..=24));
    (0..12).for_each(|k| text += &format!("f {} {} {} {}\n", k + 1, (k + 1) % 12 + 1, (k + 1) % 12 + 13, k + 13));
    let found = mesh(text.as_bytes(), Format::Obj).unwrap();
    assert_eq!((found.vertices.len(), found.defects()), (24, Defects::default()));
    let right = 2.0 * 12.0 * 0.5 * 3.0 * 1.0 * 0.5; // height, triangles from the middle, sin 30°
    assert!((volume(&found) - right).abs() < 1e-12, "{}", volume(&found));
}

#[test]
fn a_hole_may_be_reached_by_a_side_and_back() {
    // A frame: outside 4 by 4, hole 2 by 2, corners 1 and 5 named twice.
    let text = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 1 1 0\nv 1 3 0\nv 3 3 0\nv 3 1 0\nf 1 2 3 4 1 5 6 7 8 5\n";
    let found = mesh(text.as_bytes(), Format::Obj).unwrap();
    let (sum, vector) = areas(&found);
    assert!((sum - 12.0).abs() < 1e-12 && (vector[2] - 12.0).abs() < 1e-12, "{sum} {vector:?}");
    assert_eq!(found.defects(), Defects { open_edges: 8, ..Defects::default() });
    // The same with vertices of their own on the way back.
    let text = text.replace("f 1 2 3 4 1 5 6 7 8 5", "v 0 0 0\nv 1 1 0\nf 1 2 3 4 9 10 6 7 8 5");
    let apart = mesh(text.as_bytes(), Format::Obj).unwrap();
    assert!((areas(&apart).0 - 12.0).abs() < 1e-12);
    assert_eq!(apart.defects(), Defects { open_edges: 10, ..Defects::default() });
}

#[test]
fn texture_follows_the_corners() {
    let corners = [[2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0], [0.0, 0.0]];
    let mut text = String::new();
    corners.iter().for_each(|[x, y]| text += &format!("v {x} {y} 1\nvt {} {}\n", x / 4.0, y / 4.0));
    let found = mesh((text + "f 4/4 5/5 6/6 1/1 2/2 3/3\n").as_bytes(), Format::Obj).unwrap();
    assert_eq!(found.triangles.len(), 4);
    for (t, texture) in found.triangles.iter().zip(&found.texture) {
        assert_eq!(texture.unwrap(), t.map(|i| [0, 1].map(|a| found.vertices[i as usize][a] / 4.0)));
    }
}

#[test]
fn convex_polygons_and_those_without_area_stay_fans() {
    let six: Vec<[f64; 3]> = (0..6).map(|k| f64::from(k) * 60_f64.to_radians()).map(|a| [a.cos(), a.sin(), 0.1 * a.sin()]).collect();
    assert_eq!(read(&six).triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]);
    // Four corners that are not quite in one plane.
    assert_eq!(read(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.3], [1.0, 1.0, 0.0], [0.0, 1.0, 0.3]]).triangles, [[0, 1, 2], [0, 2, 3]]);
    let line = read(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]]);
    assert_eq!((line.triangles.len(), line.defects().degenerate), (2, 2));
    // A corner named twice in a row.
    let three = mesh(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 2 3\n", Format::Obj).unwrap();
    assert_eq!(three.triangles, [[0, 1, 2]]);
}

#[test]
fn polygons_that_cross_themselves_are_told_with_their_place() {
    let bow = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let uneven = [[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let five = [0, 2, 4, 1, 3].map(|k| f64::from(k) * 72_f64.to_radians()).map(|a| [a.cos(), a.sin(), 0.0]);
    for corners in [&bow[..], &uneven, &five] {
        for ((bytes, format), place) in both(corners).iter().zip([format!("line {}", corners.len() + 1), "face 0".to_owned()]) {
            let message = mesh(bytes, *format).unwrap_err();
            assert!(message.contains(&place) && message.contains("cross") && message.contains("triangles"), "{message}");
        }
    }
}
