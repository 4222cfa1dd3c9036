//! The bunny that the package carries is what `python/tumble/scenes/assets/README.md` says.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

use tumble_interface::mesh::Defects;
use tumble_io::{Format, mesh};

const BUNNY: &[u8] = include_bytes!("../../../python/tumble/scenes/assets/bunny.ply");

#[test]
fn the_bunny_is_closed_upright_and_one_metre_wide() {
    let bunny = mesh(BUNNY, Format::Ply).unwrap();
    assert_eq!((bunny.vertices.len(), bunny.triangles.len()), (1839, 3674));
    assert_eq!(bunny.defects(), Defects::default());
    assert_eq!(bunny.vertices.len() + bunny.triangles.len() - bunny.edges().len(), 2); // Euler: one piece, no handles

    let (low, high) = bunny.bounds().unwrap();
    assert_eq!((low[0], high[0]), (-0.5, 0.5));
    assert_eq!(low[1], -high[1]);
    assert_eq!(low[2], 0.0);
    assert!((high[1] - 0.380550).abs() < 1e-6 && (high[2] - 0.974824).abs() < 1e-6);

    let volume: f64 = bunny.triangles.iter().map(|t| six_volumes(t.map(|i| bunny.vertices[i as usize]))).sum::<f64>() / 6.0;
    assert!((volume - 0.199792).abs() < 1e-6, "{volume}");
    assert!(BUNNY.len() < 200_000);
}

/// Six times the signed volume of the tetrahedron from the origin.
fn six_volumes([a, b, c]: [[f64; 3]; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}
