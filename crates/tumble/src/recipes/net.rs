//! Masses at the vertices of a mesh, springs along its edges.

use super::Site;
use super::pins::{Pinnable, pinned};
use super::surface::Surface;
use crate::geometry::Vector;
use tumble_interface::Mesh;
use tumble_interface::scene::Net;

/// Adds the masses, links, hinges and triangles. `mesh` stands where it belongs.
///
/// An edge stands for the area of its triangles: an equilateral net then has the modulus of its links as Young's modulus.
pub fn net(site: &mut Site<'_>, thing: &Net, mesh: &Mesh) {
    let path = format!("net \"{}\"", thing.name);
    site.parts.begin(&thing.name, 0.0);
    let Some((fabric, density)) = site.fabric(&path, thing.fabric.as_ref(), thing.density) else { return };
    let corner = |i: u32| Vector::from(mesh.vertices[i as usize]);
    let area = |t: &[u32; 3]| (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).norm() / 2.0;
    let areas: Vec<f64> = mesh.triangles.iter().map(area).collect();
    let mut mass = vec![0.0; mesh.vertices.len()];
    for (t, area) in mesh.triangles.iter().zip(&areas) {
        t.iter().for_each(|i| mass[*i as usize] += density * area / 3.0);
    }
    if let Some(i) = mass.iter().position(|m| *m == 0.0) {
        return site.wrong(
            format!("{path}.mesh"),
            format!("vertex {i} has no triangle with an area, so it would have no mass; remove it from the mesh"),
        );
    }
    let first = mesh.vertices.iter().zip(&mass).map(|(x, m)| site.parts.point(Vector::from(*x), Vector::default(), *m)).min().unwrap_or(0);
    let links = thing.links();
    if links.shear.is_some() {
        site.wrong(format!("{path}.links.shear"), "a net of triangles has no diagonals; known here: structural, bend");
    }
    let edges = mesh.edges();
    for ([a, b], faces) in &edges {
        let measure: f64 = faces.iter().map(|t| areas[*t as usize]).sum();
        if let Some(family) = &links.structural {
            site.link(family, [first + a, first + b], measure);
        }
        if let (Some(family), [t, u]) = (&links.bend, &faces[..]) {
            let opposite = |t: u32| mesh.triangles[t as usize].into_iter().find(|i| i != a && i != b);
            if let (Some(c), Some(d)) = (opposite(*t), opposite(*u)) {
                site.link(family, [first + c, first + d], measure);
            }
        }
    }
    let words = Surface {
        path: &path,
        hinge: thing.hinge,
        isometric: thing.isometric,
        membrane: thing.membrane.as_ref(),
        fabric,
        squares: false,
        area: thing.area,
    };
    // The triangles' own planes have no axes in common; the x axis has a direction in most.
    site.surface(mesh, first, &words, Vector { x: 1.0, y: 0.0, z: 0.0 });
    if let Some(words) = &thing.pressure {
        site.inflate(mesh, first, words, &path);
    }
    if let Some(words) = &thing.shape_matching {
        site.shape(first as usize..first as usize + mesh.vertices.len(), words, &path);
    }
    let pins = pinned(site, &Pinnable { path: &path, n: &[mesh.vertices.len() as u32], first, is_lattice: false }, &thing.pin);
    pins.iter().for_each(|p| site.parts.pin(*p));
    if let Some(object) = site.parts.object() {
        object.triangles.clone_from(&mesh.triangles);
    }
    if let Some(words) = &thing.tear {
        if thing.pressure.is_some() || thing.shape_matching.is_some() {
            return site.wrong(
                format!("{path}.tear"),
                "what tears can neither hold a pressure nor keep a shape as a whole; leave out one of them",
            );
        }
        let corners: Vec<_> = mesh.triangles.iter().map(|t| t.map(corner)).collect();
        site.tear(words, &corners, &corners, &path);
    }
}
