//! What makes triangles of points elastic: bending across their edges, stretch and area of each, the volume that they enclose.

use super::Site;
use crate::elements::{Element, Hinge, IsometricBend, Membrane, Moment, Woven, enclosed};
use crate::geometry::Vector;
use crate::math::functions;
use crate::systems::dynamics::{Closed, TearPart};
use std::ops::Range;
use tumble_interface::scene::{FabricUse, FabricWords, Inflation, Membrane as Words, ShapeMatching, Tear};
use tumble_interface::{Fabric, Mesh};

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
    /// Measured fabric.
    pub fabric: Option<Measured>,
    /// Whether its triangles are squares with alternating diagonals, for fabrics.
    pub squares: bool,
    /// Stiffness against changes of area [N/m].
    pub area: f64,
}

/// A record and how it is used.
#[derive(Clone)]
pub struct Measured {
    record: Fabric,
    words: FabricUse,
}

/// Sides of squares are folded by 3/4 of the curvature of the surface.
const SQUARES: f64 = 4.0 / 3.0;

impl Measured {
    /// Bending stiffness [N m] of hinges along an edge with this direction in a triangle, at each curvature of the record; of a side of squares,
    /// or of a diagonal, such that a surface bent along either side, or between them, has that of the record: (fabrics.11).
    fn hinges(&self, edge: Vector, triangle: [Vector; 3], warp: Vector, squares: Option<bool>) -> [f64; 5] {
        let (u, v) = Membrane::grain(triangle, warp, self.words.angle.to_radians());
        let at = functions::atan2(edge.dot(v), edge.dot(u)).to_degrees();
        let factor = self.words.thicken * self.words.bending;
        std::array::from_fn(|i| {
            let stiff = |turn: f64| factor * self.across(at + turn, i);
            let Some(diagonal) = squares else { return stiff(0.0) };
            let side = if diagonal { 45.0 } else { 0.0 };
            let (own, other) = (stiff(side), stiff(side + 90.0));
            let between = 0.5 * (stiff(side + 45.0) + stiff(side - 45.0));
            let [side, _, diagonals] = of_squares([own, other, between]);
            if diagonal { diagonals } else { side }
        })
    }

    /// That of the record for creases at an angle to the warp [degrees], linear between 0, 45 and 90.
    fn across(&self, angle: f64, sample: usize) -> f64 {
        let at = angle.abs() % 180.0;
        let at = if at > 90.0 { 180.0 - at } else { at } / 45.0;
        let (row, part) = if at < 1.0 { (0, at) } else { (1, at - 1.0) };
        // What is not > 0 resists hardly.
        let number = |row: usize| self.record.bending[row][sample].max(1e-3 * self.record.bending[row][0]);
        number(row) + part * (number(row + 1) - number(row))
    }
}

/// Stiffness of both sides and of the diagonals of squares whose diagonals alternate, for that of creases along either side and between:
///
///   B_y = b_y - b_y²/s,  B_x = b_x - b_x²/s,  B_d = b_d (1 + (b_x + b_y)/s),  s = b_x + b_y + 4 b_d   (fabrics.11)
fn of_squares([one, other, between]: [f64; 3]) -> [f64; 3] {
    let mut b = [4.0 / 3.0 * one, 4.0 / 3.0 * other, 2.0 / 3.0 * between];
    // Contracts by a half each time; where there is no solution it ends near by.
    for _ in 0..40 {
        let s = b[0] + b[1] + 4.0 * b[2];
        let side = |stiff: f64| 0.5 * (s - (s * s - 4.0 * s * stiff).max(0.0).sqrt());
        let next = [side(one), side(other), between * s / (s + b[0] + b[1])];
        b = std::array::from_fn(|i| 0.5 * (b[i] + next[i]));
    }
    b
}

impl Site<'_> {
    /// The fabric that words name, and the density [kg/m²]; `None`, and an issue, if there is no record.
    pub(super) fn fabric(&mut self, path: &str, words: Option<&FabricWords>, density: Option<f64>) -> Option<(Option<Measured>, f64)> {
        let Some(words) = words else { return Some((None, density.unwrap_or(0.2))) };
        let Some(record) = self.assets.fabric(words.key()).cloned() else {
            self.wrong(format!("{path}.fabric"), "the record has not been loaded");
            return None;
        };
        let words = words.settings();
        let density = density.unwrap_or(record.density * words.thicken);
        Some((Some(Measured { record, words }), density))
    }

    /// All elements of the triangles of a mesh at rest, whose vertices are points from `first` on; `warp` is the direction of the warp.
    pub(super) fn surface(&mut self, mesh: &Mesh, first: u32, words: &Surface<'_>, warp: Vector) {
        self.bending(mesh, first, words, warp);
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
        if let Some(Measured { record, words: fabric }) = &words.fabric {
            for t in &mesh.triangles {
                if let Some((b, area)) = Membrane::axes(corners(t), warp, fabric.angle.to_radians()) {
                    self.parts.woven(t.map(|i| i + first), Woven::rest(b, record, fabric.thicken), area, fabric.damping);
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
    fn bending(&mut self, mesh: &Mesh, first: u32, words: &Surface<'_>, warp: Vector) {
        if words.hinge == 0.0 && words.isometric == 0.0 && words.fabric.is_none() {
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
                let row = |i: u32| [vertex(i).x, vertex(i).y, vertex(i).z, 0.0];
                let [rest] = Hinge::residual([0.0], [row(a), row(b), row(c), row(d)]);
                if words.hinge > 0.0 {
                    self.parts.hinge(nodes, rest, words.hinge * share);
                }
                if let Some(fabric) = &words.fabric {
                    let way = vertex(b) - vertex(a);
                    // A diagonal lies opposite to a right angle.
                    let (to_a, to_b) = (vertex(a) - vertex(c), vertex(b) - vertex(c));
                    let squares = words.squares.then(|| to_a.dot(to_b).abs() < 1e-6 * to_a.norm() * to_b.norm());
                    let sides = [t, u].map(|t| fabric.hinges(way, t.map(vertex), warp, squares));
                    let samples = std::array::from_fn(|i| (sides[0][i] + sides[1][i]) / 2.0);
                    if let Some((stiffness, law)) =
                        Moment::samples(samples, if words.squares { SQUARES } else { 1.0 } * length_sq.sqrt() / areas)
                    {
                        self.parts.crease(nodes, rest, stiffness * share, law, fabric.words.damping);
                    }
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
