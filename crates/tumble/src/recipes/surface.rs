//! What makes triangles of points elastic: bending across their edges, stretch and area of each, the volume that they enclose.

use super::Site;
use crate::elements::{Element, Hinge, IsometricBend, Membrane, Moment, Woven, enclosed};
use crate::geometry::Vector;
use crate::math::{Signal, functions};
use crate::systems::dynamics::{Closed, TearPart};
use std::ops::Range;
use tumble_interface::check::plain;
use tumble_interface::fault::Fault;
use tumble_interface::repair::repair;
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

/// Where nothing of a surface is strained, and the direction of its warp.
pub struct Rest<'a> {
    mesh: &'a Mesh,
    pattern: Option<&'a [[Vector; 3]]>,
    warp: Vector,
}

/// Two triangles on both sides of an edge: its ends, what lies opposite on the left and on the right; the triangles; and where these four are at
/// rest.
pub struct Wings {
    pub nodes: [u32; 4],
    pub faces: [usize; 2],
    pub at: [Vector; 4],
}

impl<'a> Rest<'a> {
    /// The mesh as it is, with this direction of the warp as far as it lies in a triangle.
    pub fn mesh(mesh: &'a Mesh, warp: Vector) -> Self {
        Self { mesh, pattern: None, warp }
    }

    /// Flat triangles in the xy plane, with the warp along x. Neighbours need not be neighbours there, and may be turned over.
    pub fn pattern(mesh: &'a Mesh, pattern: &'a [[Vector; 3]]) -> Self {
        Self { mesh, pattern: Some(pattern), warp: Vector { x: 1.0, y: 0.0, z: 0.0 } }
    }

    /// Corners of a triangle [m].
    pub fn corners(&self, triangle: usize) -> [Vector; 3] {
        match self.pattern {
            Some(pattern) => pattern[triangle],
            None => self.mesh.triangles[triangle].map(|i| Vector::from(self.mesh.vertices[i as usize])),
        }
    }

    /// Direction of the warp and what it is still to be turned by [rad], for an angle [degrees]. A pattern is turned in its plane, seen from one
    /// side, a mesh as seen from outside.
    fn warp(&self, angle: f64) -> (Vector, f64) {
        let angle = angle.to_radians();
        match self.pattern {
            Some(_) => (Vector { x: functions::cos(angle), y: functions::sin(angle), z: 0.0 }, 0.0),
            None => (self.warp, angle),
        }
    }

    /// From one end of an edge to the other in one of its triangles.
    fn edge(&self, triangle: usize, ends: [u32; 2]) -> Vector {
        let (nodes, corners) = (self.mesh.triangles[triangle], self.corners(triangle));
        let [a, b] = ends.map(|end| nodes.iter().position(|i| *i == end).map_or(Vector::default(), |k| corners[k]));
        b - a
    }

    /// Length of an edge [m]; where its triangles do not agree, as along seams of a pattern, the mean.
    pub fn length(&self, ends: [u32; 2], faces: &[u32]) -> f64 {
        faces.iter().map(|t| self.edge(*t as usize, ends).norm()).sum::<f64>() / faces.len() as f64
    }

    /// What lies on both sides of an edge; `None` unless it has two triangles. Those of a pattern are laid side by side.
    pub fn wings(&self, [a, b]: [u32; 2], faces: &[u32]) -> Option<Wings> {
        let faces: [u32; 2] = faces.try_into().ok()?;
        let [t, u] = faces.map(|t| self.mesh.triangles[t as usize]);
        let opposite = |t: [u32; 3]| t.into_iter().find(|i| *i != a && *i != b);
        let (c, d) = (opposite(t)?, opposite(u)?);
        // n1 = e x (x2 - x0) must be the outward normal of its triangle: edge a b runs forward in it.
        let forward = (0..3).any(|k| t[k] == a && t[(k + 1) % 3] == b);
        let side = |left: bool| if left == forward { (c, faces[0] as usize) } else { (d, faces[1] as usize) };
        let (left, right) = (side(true), side(false));
        let at = if self.pattern.is_none() {
            [a, b, left.0, right.0].map(|i| Vector::from(self.mesh.vertices[i as usize]))
        } else {
            let half = 0.5 * self.length([a, b], &faces);
            let place = |(corner, triangle): (u32, usize), sign: f64| {
                let (e, to) = (self.edge(triangle, [a, b]), self.edge(triangle, [a, corner]));
                let length = e.norm();
                Vector { x: to.dot(e) / length - 0.5 * length, y: sign * e.cross(to).norm() / length, z: 0.0 }
            };
            let end = |x: f64| Vector { x, y: 0.0, z: 0.0 };
            [end(-half), end(half), place(left, 1.0), place(right, -1.0)]
        };
        Some(Wings { nodes: [a, b, left.0, right.0], faces: faces.map(|t| t as usize), at })
    }
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
    fn hinges(&self, edge: Vector, triangle: [Vector; 3], rest: &Rest<'_>, squares: Option<bool>) -> [f64; 5] {
        let (warp, angle) = rest.warp(self.words.angle);
        let (u, v) = Membrane::grain(triangle, warp, angle);
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

    /// All elements of the triangles of a mesh whose vertices are points from `first` on; `rest` is where nothing is strained.
    pub(super) fn surface(&mut self, mesh: &Mesh, first: u32, words: &Surface<'_>, rest: &Rest<'_>) {
        self.bending(mesh, first, words, rest);
        if let Some(membrane) = words.membrane {
            let Some(root) = Membrane::root(membrane.warp, membrane.weft(), membrane.poisson, membrane.shear()) else {
                let most = (membrane.warp / membrane.weft()).sqrt();
                let message = format!("{}, expected less than sqrt(warp/weft) = {most:.4}", membrane.poisson);
                return self.wrong(format!("{}.membrane.poisson", words.path), message);
            };
            for (i, t) in mesh.triangles.iter().enumerate() {
                let (warp, angle) = rest.warp(membrane.angle);
                if let Some((b, area)) = Membrane::axes(rest.corners(i), warp, angle) {
                    self.parts.membrane(t.map(|i| i + first), b, root, area, membrane.damping);
                }
            }
        }
        if let Some(Measured { record, words: fabric }) = &words.fabric {
            for (i, t) in mesh.triangles.iter().enumerate() {
                let (warp, angle) = rest.warp(fabric.angle);
                if let Some((b, area)) = Membrane::axes(rest.corners(i), warp, angle) {
                    self.parts.woven(t.map(|i| i + first), Woven::rest(b, record, fabric.thicken), area, fabric.damping);
                }
            }
        }
        if words.area > 0.0 {
            for (i, t) in mesh.triangles.iter().enumerate() {
                let [a, b, c] = rest.corners(i);
                let area = (b - a).cross(c - a).norm() / 2.0;
                if area > 0.0 {
                    self.parts.area(t.map(|i| i + first), area, words.area / area);
                }
            }
        }
    }

    /// Hinges across every edge of a mesh that has two triangles; B is the bending stiffness per width [N m]. A dihedral hinge has the rest
    /// angle of the mesh, or none if there is a pattern. k = B l²/(A1 + A2), which gives a sheet bent to a cylinder its stiffness B.      (bending.6)
    fn bending(&mut self, mesh: &Mesh, first: u32, words: &Surface<'_>, rest: &Rest<'_>) {
        if words.hinge == 0.0 && words.isometric == 0.0 && words.fabric.is_none() {
            return;
        }
        for ([a, b], faces) in mesh.edges() {
            let Some(Wings { nodes: [_, _, c, d], faces: [t, u], at }) = rest.wings([a, b], &faces) else { continue };
            let area = |t: usize| {
                let [a, b, c] = rest.corners(t);
                (b - a).cross(c - a).norm() / 2.0
            };
            let (areas, length_sq) = (area(t) + area(u), (at[1] - at[0]).norm_sq());
            if areas > 0.0 && length_sq > 0.0 {
                let nodes = [a, b, c, d].map(|i| i + first);
                let share = length_sq / areas;
                let [angle] = Hinge::residual([0.0], at.map(|x| [x.x, x.y, x.z, 0.0]));
                if words.hinge > 0.0 {
                    self.parts.hinge(nodes, angle, words.hinge * share);
                }
                if let Some(fabric) = &words.fabric {
                    // A diagonal lies opposite to a right angle.
                    let (to_a, to_b) = (at[0] - at[2], at[1] - at[2]);
                    let squares = words.squares.then(|| to_a.dot(to_b).abs() < 1e-6 * to_a.norm() * to_b.norm());
                    let sides = [t, u].map(|t| fabric.hinges(rest.edge(t, [a, b]), rest.corners(t), rest, squares));
                    let samples = std::array::from_fn(|i| (sides[0][i] + sides[1][i]) / 2.0);
                    if let Some((stiffness, law)) =
                        Moment::samples(samples, if words.squares { SQUARES } else { 1.0 } * length_sq.sqrt() / areas)
                    {
                        self.parts.crease(nodes, angle, stiffness * share, law, fabric.words.damping);
                    }
                }
                if let (true, Some(rest)) = (words.isometric > 0.0, IsometricBend::rest(at)) {
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
        if let Some(Fault { defects, place, cure }) = mesh.fault() {
            let message = format!(
                "the mesh encloses nothing: {} edges have one triangle only, {} more than two or such as turn against each other, for \
                 example {place}; {cure}",
                defects.open_edges, defects.bad_edges
            );
            return self.wrong(path, message);
        }
        let volume_of = |mesh: &Mesh| enclosed(&mesh.triangles, |i| Vector::from(mesh.vertices[i as usize]));
        let volume = volume_of(mesh);
        if volume.is_nan() || volume <= 0.0 {
            let cure = match volume_of(&repair(mesh).0) > 0.0 {
                true => "mend the file with `tumble check SCENE --repair`",
                false => "turn its triangles to be counter-clockwise from outside",
            };
            return self.wrong(path, format!("the mesh is inside out or flat, with a volume of {volume} m³; {cure}"));
        }
        let triangles = mesh.triangles.iter().map(|t| t.map(|i| i + first)).collect();
        let stiffness = words.stiffness.map_or(f64::INFINITY, |modulus| modulus / volume);
        let target = match Signal::new(&words.volume) {
            Ok(target) => target,
            Err(message) => return self.wrong(format!("{path}.volume"), message),
        };
        let tried = [0.0].iter().chain(&self.parts.times).chain(target.key_times());
        if let Some((t, value)) = tried.map(|t| (*t, target.value(*t))).find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
            let when = if target.is_constant() { String::new() } else { format!(" at t = {} s", plain(t)) };
            return self.wrong(format!("{path}.volume"), format!("{}{when}, expected a number above 0", plain(value)));
        }
        self.parts.closed(path, Closed { triangles, volume, target, stiffness });
    }

    /// Keeps points in shape.
    pub(super) fn shape(&mut self, points: Range<usize>, words: &ShapeMatching, path: &str) {
        let rate = std::f64::consts::TAU * words.frequency.unwrap_or(f64::INFINITY);
        self.parts.shape(format!("{path}.shape_matching"), points, rate * rate);
    }
}
