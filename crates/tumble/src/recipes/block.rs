//! A box of masses and links, or of elastic tetrahedra.

use super::Site;
use super::lattice::Lattice;
use super::loads::load;
use super::pins::{Pinnable, pin};
use crate::elements::rest_matrix;
use tumble_interface::scene::{Block, Material};

/// The six tetrahedra of a cell: the ways from corner 000 to corner 111 along its edges (Kuhn), all of positive volume.
const WAYS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];

/// Adds the masses, links or tetrahedra, and the triangles of the surface.
pub fn block(site: &mut Site<'_>, thing: &Block) {
    let path = format!("block \"{}\"", thing.name);
    site.parts.begin(&thing.name, 0.0);
    let lattice = Lattice::build(site, thing.resolution, thing.size, thing.center, thing.rotate, thing.density);
    match (&thing.links, &thing.material) {
        (Some(links), None) => lattice.links(site, links),
        (None, Some(material)) => tetrahedra(site, &lattice, material),
        (Some(_), Some(_)) => site.wrong(format!("{path}.links"), "a block of tetrahedra has no links; leave out links or material"),
        (None, None) if thing.shape_matching.is_some() => {}
        (None, None) => site.wrong(path.as_str(), "expected links (springs), material (tetrahedra) or shape_matching"),
    }
    let first = lattice.index([0; 3]);
    let pinnable = Pinnable { path: &path, n: &lattice.n, first, is_lattice: true, clamps: false };
    pin(site, &pinnable, &thing.pin);
    load(site, &pinnable, &thing.load, &thing.point_mass);
    site.parts.launch(thing.velocity);
    if let Some(words) = &thing.shape_matching {
        let count: usize = lattice.n.iter().map(|n| *n as usize).product();
        site.shape(first as usize..first as usize + count, words, &path);
    }
    let triangles = surface(&lattice, first);
    if let Some(object) = site.parts.object() {
        object.triangles = triangles;
    }
}

/// Two triangles for each face of a cell on the outside, with the diagonals of the tetrahedra, seen from outside
/// counter-clockwise.
fn surface(lattice: &Lattice, first: u32) -> Vec<[u32; 3]> {
    let mut triangles = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for (level, outward) in [(0, false), (lattice.n[axis] - 1, true)] {
            for j in 1..lattice.n[v] {
                for i in 1..lattice.n[u] {
                    let corner = |i: u32, j: u32| {
                        let mut node = [level; 3];
                        (node[u], node[v]) = (i, j);
                        lattice.index(node) - first
                    };
                    let [a, b, c, d] = [corner(i - 1, j - 1), corner(i, j - 1), corner(i, j), corner(i - 1, j)];
                    triangles.extend(if outward { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
                }
            }
        }
    }
    triangles
}

fn tetrahedra(site: &mut Site<'_>, lattice: &Lattice, material: &Material) {
    let (young, nu) = (material.young, material.poisson);
    let mu = young / (2.0 * (1.0 + nu));
    let lambda = young * nu / ((1.0 + nu) * (1.0 - 2.0 * nu));
    for cell in lattice.nodes() {
        if (0..3).any(|a| cell[a] + 1 >= lattice.n[a]) {
            continue;
        }
        for (w, way) in WAYS.iter().enumerate() {
            let mut corner = cell;
            let mut nodes = [lattice.index(cell); 4];
            for (k, axis) in way.iter().enumerate() {
                corner[*axis] += 1;
                nodes[k + 1] = lattice.index(corner);
            }
            // Odd ways turn left: swap two corners.
            if w >= 3 {
                nodes.swap(1, 2);
            }
            let (b, volume) = rest_matrix(nodes.map(|i| site.parts.position(i)));
            site.parts.tetrahedron(nodes, b, volume, mu, lambda, material.damping);
        }
    }
}
