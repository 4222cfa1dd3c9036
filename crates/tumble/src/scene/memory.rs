//! How much memory a scene will take, told before any is taken.

use super::Assets;
use crate::geometry::GridSdf;
use tumble_interface::Scene;
use tumble_interface::scene::{Diagonals, Shape};

/// Bytes for a mass: its rows in state, scratch, snapshot and history, in double precision.
const MASS: f64 = 1200.0;
/// Bytes for a link: as part, in the list of its kind, and in the gather lists of both ends.
const LINK: f64 = 260.0;
/// Bytes for a tetrahedron with its two or three laws.
const TETRAHEDRON: f64 = 1400.0;

/// An upper estimate of the bytes that the scene's objects and colliders need.
pub fn memory(scene: &Scene, assets: &Assets) -> f64 {
    let diagonals = |d: &Diagonals| if *d == Diagonals::Both { 2.0 } else { 1.0 };
    let mut bytes = 0.0;
    for thing in &scene.particles {
        bytes += thing.position.len() as f64 * MASS + thing.spring.len() as f64 * LINK;
    }
    bytes += scene.galaxy.iter().map(|thing| f64::from(thing.stars) * MASS).sum::<f64>();
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
    for mesh in scene.net.iter().filter_map(|thing| assets.get(&thing.mesh.path)) {
        bytes += mesh.vertices.len() as f64 * (MASS + 15.0 * LINK);
    }
    for thing in &scene.collider {
        if let Shape::Mesh(file) = &thing.shape
            && let Some((low, high)) = assets.get(&file.path).and_then(|mesh| mesh.bounds())
        {
            // Turning a box makes it no larger than its diagonal along any axis.
            let size: [f64; 3] = std::array::from_fn(|a| (high[a] - low[a]) * file.scale);
            let size = if file.rotate == [0.0; 3] { size } else { [size.iter().map(|s| s * s).sum::<f64>().sqrt(); 3] };
            bytes += GridSdf::bytes(size, file.resolution, thing.thickness);
        }
    }
    bytes
}
