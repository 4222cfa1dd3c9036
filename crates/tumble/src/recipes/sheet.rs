//! A rectangle of masses and links.

use super::Site;
use super::lattice::Lattice;
use super::loads::load;
use super::pins::{Pinnable, pin};
use super::surface::{Rest, Surface};
use tumble_interface::Mesh;
use tumble_interface::scene::Sheet;

/// Adds the masses, links, elements and triangles.
///
/// ```text
///   y-   (i, j+1)---(i+1, j+1)       index i + nx j; the triangles and the single diagonal of
///   up       |     /    |            shear links run from (i, j) to (i+1, j+1)
///            |   /      |
///          (i, j)----(i+1, j)
/// ```
pub fn sheet(site: &mut Site<'_>, thing: &Sheet) {
    let path = format!("sheet \"{}\"", thing.name);
    site.parts.begin(&thing.name, 0.0);
    let Some((fabric, density)) = site.fabric(&path, thing.fabric.as_ref(), thing.density) else { return };
    let lattice = Lattice::build(site, thing.resolution, thing.size, thing.center, thing.rotate, density);
    lattice.links(site, &thing.links());
    let first = lattice.index([0; 3]);
    let warp = site.parts.position(lattice.index([1, 0, 0])) - site.parts.position(first);
    // Triangles that stretch as a fabric prefer no direction if diagonals alternate. Bending does on rows of equal diagonals, where no edge but
    // those of triangles can tear; links and drawings know the others.
    let alternates = fabric.is_some() && thing.tear.is_none();
    let mut straight = Vec::new();
    let mut triangles = Vec::new();
    for j in 1..lattice.n[1] {
        for i in 1..lattice.n[0] {
            let [a, b, c, d] = [[i - 1, j - 1], [i, j - 1], [i, j], [i - 1, j]].map(|[i, j]| lattice.index([i, j, 0]) - first);
            straight.extend([[a, b, c], [a, c, d]]);
            triangles.extend(if alternates && (i + j) % 2 == 1 { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] });
        }
    }
    let clamps = (thing.hinge > 0.0 || thing.isometric > 0.0 || fabric.is_some()) && thing.tear.is_none();
    let pinnable = Pinnable { path: &path, n: &lattice.n[..2], first, is_lattice: true, clamps };
    let pins = pin(site, &pinnable, &thing.pin);
    load(site, &pinnable, &thing.load, &thing.point_mass);
    site.parts.launch(thing.velocity);
    if thing.isometric > 0.0 {
        lattice.plate(site, thing.isometric, &pins.clamps);
    }
    if thing.hinge > 0.0 || thing.area > 0.0 || thing.membrane.is_some() || fabric.is_some() {
        let vertices: Vec<_> = lattice.nodes().map(|node| site.parts.position(lattice.index(node)).into()).collect();
        let words = Surface {
            path: &path,
            hinge: thing.hinge,
            isometric: 0.0,
            membrane: thing.membrane.as_ref(),
            fabric,
            area: thing.area,
            clamps: &pins.clamps,
        };
        let rows = Mesh { vertices: vertices.clone(), triangles: straight, ..Mesh::default() };
        site.bending(&rows, first, &words, &Rest::mesh(&rows, warp));
        let mesh = Mesh { vertices, triangles, ..Mesh::default() };
        site.stretch(&mesh, first, &words, &Rest::mesh(&mesh, warp));
        triangles = mesh.triangles;
    }
    pins.clamps.iter().for_each(|clamp| clamp.check(site));
    let corners: Vec<_> = triangles.iter().map(|t| t.map(|i| site.parts.position(i + first))).collect();
    if let Some(object) = site.parts.object() {
        object.triangles = triangles;
    }
    if let Some(words) = &thing.tear {
        site.tear(words, &corners, &corners, &path);
    }
}
