//! Faults of meshes are told with a place, and with a cure that cures.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

mod files;

use files::*;
use tumble_interface::Mesh;
use tumble_interface::fault::place;
use tumble_interface::mesh::Defects;
use tumble_io::repair;

const REPAIR: &str = "mend the file with `tumble check SCENE --repair`";

/// Every triangle with vertices of its own.
fn apart(mesh: &Mesh) -> Mesh {
    let vertices: Vec<_> = mesh.triangles.iter().flatten().map(|i| mesh.vertices[*i as usize]).collect();
    let triangles = (0..mesh.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    Mesh { vertices, triangles, ..Mesh::default() }
}

/// A band of `n` squares around the z axis, half a turn in itself or none.
fn band(n: u32, twist: bool) -> Mesh {
    let edge = |k: u32| {
        let a = std::f64::consts::TAU * f64::from(k) / f64::from(n);
        let tilt = if twist { a / 2.0 } else { 0.0 };
        [-0.2, 0.2].map(|w| [(2.0 + w * tilt.sin()) * a.cos(), (2.0 + w * tilt.sin()) * a.sin(), w * tilt.cos()])
    };
    let mut triangles = Vec::new();
    for k in 0..n {
        let [a, b, mut c, mut d] = [2 * k, 2 * k + 1, 2 * ((k + 1) % n), 2 * ((k + 1) % n) + 1];
        if twist && k + 1 == n {
            (c, d) = (d, c);
        }
        triangles.extend([[a, c, d], [a, d, b]]);
    }
    Mesh { vertices: (0..n).flat_map(edge).collect(), triangles, ..Mesh::default() }
}

#[test]
fn what_a_repair_mends_names_it() {
    let mut turned = cube();
    turned.triangles[3].swap(0, 1);
    let mut twice = cube();
    twice.triangles.push(twice.triangles[7]);
    for broken in [apart(&cube()), apart(&tetrahedron()), turned, twice] {
        let fault = broken.fault().unwrap();
        assert_eq!(fault.cure, REPAIR);
        assert!(fault.defects == broken.defects() && fault.place.starts_with("around ("), "{fault:?}");
        assert_eq!(repair(&broken).0.fault(), None);
        let told = broken.unsound().unwrap();
        assert!(told.ends_with(REPAIR) && told.contains(", for example around ("), "{told}");
        assert_eq!(repair(&broken).0.unsound(), None);
    }
    assert_eq!((cube().fault(), cube().unsound()), (None, None));
    // A surface that ends is sound, but has no inside.
    assert_eq!(band(12, false).unsound(), None);
}

#[test]
fn a_hole_is_told_where_it_is() {
    let mut open = cube();
    open.triangles.truncate(10); // without x = 0
    let fault = open.fault().unwrap();
    assert_eq!((fault.defects, fault.cure.as_str()), (Defects { open_edges: 4, ..Defects::default() }, "close the hole there"));
    assert!(fault.place.starts_with("around (0, "), "{}", fault.place);
    // Among seams that a repair sews, the hole is what is left.
    let fault = apart(&open).fault().unwrap();
    assert_eq!(fault.defects, Defects { open_edges: 4, ..Defects::default() });
    assert!(fault.place.starts_with("around (0, "), "{}", fault.place);
    assert_eq!(fault.cure, "close the hole there; what else is wrong is mended by `tumble check SCENE --repair`");
}

#[test]
fn a_vertex_on_an_edge_is_told_as_what_it_is() {
    // The upper side in two halves, divided at y = 0.25, far away and large.
    let at = |x: f64, y: f64, z: f64| [100.0 + 8.0 * x, 8.0 * y, 8.0 * z];
    let mut tee = Mesh { vertices: CUBE.map(|[x, y, z]| at(x, y, z)).to_vec(), ..cube() };
    tee.triangles.retain(|t| t.iter().any(|i| *i < 4));
    tee.vertices.extend([at(0.0, 0.25, 1.0), at(1.0, 0.25, 1.0)]);
    tee.triangles.extend([[4, 5, 9], [4, 9, 8], [8, 9, 6], [8, 6, 7]]);
    let fault = tee.fault().unwrap();
    assert_eq!((fault.defects.open_edges, fault.defects.bad_edges), (6, 0));
    assert!(["around (100, 2, 8)", "around (108, 2, 8)"].contains(&fault.place.as_str()), "{}", fault.place);
    assert!(fault.cure.contains("T-junction") && !fault.cure.contains("--repair"), "{}", fault.cure);
}

#[test]
fn a_surface_with_one_side_has_no_cure_that_does_not_cure() {
    let strip = band(16, true);
    assert!(strip.vertices.len() == 32 && band(16, false).defects().bad_edges == 0);
    let fault = strip.fault().unwrap();
    assert_eq!(fault.defects, Defects { open_edges: 32, bad_edges: 1, degenerate: 0 });
    assert!(fault.cure.contains("one side only") && !fault.cure.contains("--repair"), "{}", fault.cure);
    let told = strip.unsound().unwrap();
    assert!(told.starts_with("1 edge is between triangles that face different ways, for example around (2, 0, 0): "), "{told}");
    assert!(told.contains("one side only") && !told.contains("--repair"), "{told}");
    // With something that can be mended, too.
    let mut worse = strip.clone();
    worse.triangles.push(worse.triangles[5]);
    let told = worse.unsound().unwrap();
    assert!(told.contains("one side only") && told.contains("what else is wrong is mended by `tumble check SCENE --repair`"), "{told}");
}

#[test]
fn places_are_short_and_plain() {
    assert_eq!(place([0.1 + 0.2, -0.0, 1e-17]), "(0.3, 0, 0)");
    assert_eq!(place([4_500_000.25, -2e-3, 1.0 / 3.0]), "(4500000.25, 0, 0.333333333)");
    assert_eq!(place([0.0; 3]), "(0, 0, 0)");
}
