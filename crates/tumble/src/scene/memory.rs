//! How much memory a scene will take, told before any is taken.

use tumble_interface::Scene;
use tumble_interface::scene::Diagonals;

/// Bytes for a mass: its rows in state, scratch, snapshot and history, in double precision.
const MASS: f64 = 1200.0;
/// Bytes for a link: as part, in the list of its kind, and in the gather lists of both ends.
const LINK: f64 = 260.0;
/// Bytes for a tetrahedron with its two or three laws.
const TETRAHEDRON: f64 = 1400.0;

/// An upper estimate of the bytes that the scene's objects need.
pub fn memory(scene: &Scene) -> f64 {
    let diagonals = |d: &Diagonals| if *d == Diagonals::Both { 2.0 } else { 1.0 };
    let mut bytes = 0.0;
    for thing in &scene.particles {
        bytes += thing.position.len() as f64 * MASS + thing.spring.len() as f64 * LINK;
    }
    for thing in &scene.rope {
        let links = if thing.rod.is_some() { 6.0 } else { 2.0 };
        bytes += (f64::from(thing.segments) + 1.0) * (2.0 * MASS + links * LINK);
    }
    for thing in &scene.sheet {
        let n: f64 = thing.resolution.iter().map(|n| f64::from(*n)).product();
        let hinges = if thing.hinge > 0.0 { 9.0 } else { 0.0 };
        bytes += n * (MASS + (4.0 + diagonals(&thing.links.diagonals) + hinges) * LINK);
    }
    for thing in &scene.block {
        let n: f64 = thing.resolution.iter().map(|n| f64::from(*n)).product();
        let links = thing.links.as_ref().map_or(0.0, |l| 6.0 + 3.0 * diagonals(&l.diagonals));
        let solids = if thing.material.is_some() { 6.0 } else { 0.0 };
        bytes += n * (MASS + links * LINK + solids * TETRAHEDRON);
    }
    bytes
}
