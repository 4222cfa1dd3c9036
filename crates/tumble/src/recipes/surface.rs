//! What makes triangles of points elastic: bending across their edges, stretch and area of each, the volume that they enclose.

use super::Site;
use crate::elements::{Element, Hinge, IsometricBend, Membrane, enclosed};
use crate::geometry::Vector;
use crate::systems::dynamics::{Closed, TearPart};
use std::ops::Range;
use tumble_interface::Mesh;
use tumble_interface::scene::{Inflation, Membrane as Words, ShapeMatching, Tear};

/// The words of a surface that its recipes share.
pub struct Surface<'a> {
    /// Its place in the scene.
    pub path: &'a str,
    /// Bending stiffness of dihedral hinges [N m].
    pub hinge: f64,
    /// Bending stiffness of flat hinges [N m].
    pub isometric: f64,
    /// Resistance against stretch.
    pub membrane: Option<&'a Words>,
    /// Stiffness against changes of area [N/m].
    pub area: f64,
}

impl Site<'_> {
    /// All elements of the triangles of a mesh at rest, whose vertices are points from `first` on; `warp` is the direction of the warp.
    pub(super) fn surface(&mut self, mesh: &Mesh, first: u32, words: &Surface<'_>, warp: Vector) {
        self.bending(mesh, first, words);
        let corners = |t: &[u32; 3]| t.map(|i| Vector::from(mesh.vertices[i as usize]));
        if let Some(membrane) = words.membrane {
            let Some(root) = Membrane::root(membrane.warp, membrane.weft(), membrane.poisson, membrane.shear()) else {
                let most = (membrane.warp / membrane.weft()).sqrt();
                let message = format!("{}, expected less than sqrt(warp/weft) = {most:.4}", membrane.poisson);
                return self.wrong(format!("{}.membrane.poisson", words.path), message);
            };
            for t in &mesh.triangles {
                if let Some((b, area)) = Membrane::axes(corners(t), warp, membrane.angle.to_radians()) {
                    self.parts.membrane(t.map(|i| i + first), b, root, area, membrane.damping);
                }
            }
        }
        if words.area > 0.0 {
            for t in &mesh.triangles {
                let [a, b, c] = corners(t);
                let area = (b - a).cross(c - a).norm() / 2.0;
                if area > 0.0 {
                    self.parts.area(t.map(|i| i + first), area, words.area / area);
                }
            }
        }
    }

    /// Hinges across every edge of a mesh that has two triangles; B is the bending stiffness per width [N m]. A dihedral hinge has the rest
    /// angle of the mesh. k = B l²/(A1 + A2), which gives a sheet bent to a cylinder its stiffness B.      (bending.6)
    fn bending(&mut self, mesh: &Mesh, first: u32, words: &Surface<'_>) {
        if words.hinge == 0.0 && words.isometric == 0.0 {
            return;
        }
        let vertex = |i: u32| Vector::from(mesh.vertices[i as usize]);
        for ([a, b], faces) in mesh.edges() {
            let [t, u] = faces[..] else { continue };
            let (t, u) = (mesh.triangles[t as usize], mesh.triangles[u as usize]);
            let opposite = |t: [u32; 3]| t.into_iter().find(|i| *i != a && *i != b);
            let (Some(c), Some(d)) = (opposite(t), opposite(u)) else { continue };
            // n1 = e x (x2 - x0) must be the outward normal of its triangle: edge a b runs forward in it.
            let forward = (0..3).any(|k| t[k] == a && t[(k + 1) % 3] == b);
            let (c, d) = if forward { (c, d) } else { (d, c) };
            let area = |t: [u32; 3]| (vertex(t[1]) - vertex(t[0])).cross(vertex(t[2]) - vertex(t[0])).norm() / 2.0;
            let (areas, length_sq) = (area(t) + area(u), (vertex(b) - vertex(a)).norm_sq());
            if areas > 0.0 && length_sq > 0.0 {
                let nodes = [a, b, c, d].map(|i| i + first);
                let share = length_sq / areas;
                if words.hinge > 0.0 {
                    let row = |i: u32| [vertex(i).x, vertex(i).y, vertex(i).z, 0.0];
                    let [rest] = Hinge::residual([0.0], [row(a), row(b), row(c), row(d)]);
                    self.parts.hinge(nodes, rest, words.hinge * share);
                }
                if let (true, Some(rest)) = (words.isometric > 0.0, IsometricBend::rest([a, b, c, d].map(vertex))) {
                    self.parts.isometric(nodes, rest, words.isometric * share);
                }
            }
        }
    }

    /// Lets the object under construction tear. `rest` are the corners of each of its triangles [m] where nothing is strained, `places` those
    /// at the start.
    pub(super) fn tear(&mut self, words: &Tear, rest: &[[Vector; 3]], places: &[[Vector; 3]], path: &str) {
        let noise = |t: usize, k: usize, rest: &[[Vector; 3]]| {
            // The same from both triangles of an edge: from where its middle is at the start.
            let m = rest[t][k] + rest[t][(k + 1) % 3];
            let mixed = [m.x, m.y, m.z].iter().fold(0x9e37_79b9_7f4a_7c15_u64, |h, c| {
                let q = (c * 1e6).round() as i64 as u64;
                (h ^ q).wrapping_mul(0xbf58_476d_1ce4_e5b9).rotate_left(31)
            });
            let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((mixed >> 11) as f64) / (1_u64 << 53) as f64 * 2.0 - 1.0
        };
        let strength = |t: usize, k: usize| {
            let middle = (places[t][k] + places[t][(k + 1) % 3]) * 0.5;
            let weak = words.weak.iter().filter(|w| (middle - Vector::from(w.center)).norm() <= w.radius);
            let strain = weak.map(|w| w.strain).fold(words.strain, f64::min);
            strain * (1.0 + words.spread * noise(t, k, places))
        };
        let edges = |t: usize| [0, 1, 2].map(|k| (rest[t][(k + 1) % 3] - rest[t][k]).norm());
        let all = 0..rest.len();
        let spare = words.spare.map_or_else(|| all.len() / 2 + 1, |spare| spare as usize);
        let limit = all.clone().map(|t| [0, 1, 2].map(|k| strength(t, k))).collect();
        self.parts.tear(TearPart { path: format!("{path}.tear"), spare, rest: all.map(edges).collect(), limit });
    }

    /// The volume inside a closed mesh, whose vertices are points from `first` on.
    pub(super) fn inflate(&mut self, mesh: &Mesh, first: u32, words: &Inflation, path: &str) {
        let path = format!("{path}.pressure");
        let found = mesh.defects();
        if found.open_edges + found.bad_edges > 0 {
            let message = format!(
                "the mesh encloses nothing: {} edges have one triangle only, {} more than two or such as turn against each other",
                found.open_edges, found.bad_edges
            );
            return self.wrong(path, message);
        }
        let volume = enclosed(&mesh.triangles, |i| Vector::from(mesh.vertices[i as usize]));
        if volume.is_nan() || volume <= 0.0 {
            return self.wrong(path, "the mesh is inside out; turn its triangles to be counter-clockwise from outside");
        }
        let triangles = mesh.triangles.iter().map(|t| t.map(|i| i + first)).collect();
        let stiffness = words.stiffness.map_or(f64::INFINITY, |modulus| modulus / volume);
        self.parts.closed(path, Closed { triangles, target: volume * words.volume, stiffness });
    }

    /// Keeps points in shape.
    pub(super) fn shape(&mut self, points: Range<usize>, words: &ShapeMatching, path: &str) {
        let rate = std::f64::consts::TAU * words.frequency.unwrap_or(f64::INFINITY);
        self.parts.shape(format!("{path}.shape_matching"), points, rate * rate);
    }
}
