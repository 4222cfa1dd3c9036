//! What makes triangles of points elastic: bending across their edges, stretch and area of each, the volume that they enclose.

use super::Site;
use super::pins::Clamp;
use crate::elements::{Bending, IsometricBend, Membrane, Woven, WovenBending, enclosed};
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
    /// Bending stiffness of a plate of any shape at rest [N m].
    pub hinge: f64,
    /// Bending stiffness of flat hinges [N m].
    pub isometric: f64,
    /// Resistance against stretch.
    pub membrane: Option<&'a Words>,
    /// Measured fabric.
    pub fabric: Option<Measured>,
    /// Stiffness against changes of area [N/m].
    pub area: f64,
    /// Where its rim keeps its slope.
    pub clamps: &'a [Clamp],
}

/// Where nothing of a surface is strained, and the direction of its warp.
pub struct Rest<'a> {
    mesh: &'a Mesh,
    pattern: Option<&'a [[Vector; 3]]>,
    warp: Vector,
}

/// Two triangles on both sides of an edge: its ends, what lies opposite on the left and on the right; the triangles in that order; where those four are at
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
        Some(Wings { nodes: [a, b, left.0, right.0], faces: [left.1, right.1], at })
    }
}

/// A record and how it is used.
#[derive(Clone)]
pub struct Measured {
    record: Fabric,
    words: FabricUse,
}

impl Measured {
    /// The rows of the record for creases along the weft, at 45 degrees and along the warp, as numbers of an element.
    fn rows(&self) -> Option<[[f64; 8]; 3]> {
        let factor = self.words.thicken * self.words.bending;
        // What is not > 0 resists hardly.
        let row = |i: usize| {
            let samples = self.record.bending[i];
            WovenBending::samples(samples.map(|b| factor * b.max(1e-3 * samples[0])))
        };
        Some([row(2)?, row(1)?, row(0)?])
    }
}

/// What lies beside a triangle, across one of its edges.
#[derive(Clone, Copy)]
struct Beside {
    node: u32,
    /// Whether the edge is clamped: what lies beside it is held, as the mirror image of the triangle in its plane.
    clamped: bool,
    /// Where its height stands on the edge, from the corner where the edge begins (0) to the next (1).
    foot: f64,
    /// Its height over the edge [m].
    height: f64,
}

/// Pivots below this, of 1, leave a curvature undetermined: the six points lie nearly on one conic.
const UNDETERMINED: f64 = 1e-5;

/// A triangle at rest with those beside it, laid into its plane.
#[derive(Clone)]
struct Patch {
    /// Its nodes; those that begin an edge with something beside it come first.
    nodes: [u32; 3],
    /// Its corners [m].
    at: [[f64; 2]; 3],
    beside: Vec<Beside>,
}

impl Patch {
    fn new(nodes: [u32; 3], at: [[f64; 2]; 3], beside: &[Option<Beside>; 3]) -> Self {
        let start = (0..3).find(|k| beside[*k].is_some() && beside[(k + 2) % 3].is_none()).unwrap_or(0);
        let order = [0, 1, 2].map(|k| (start + k) % 3);
        Self { nodes: order.map(|k| nodes[k]), at: order.map(|k| at[k]), beside: order.into_iter().map_while(|k| beside[k]).collect() }
    }

    /// The nodes of its element, as points from `first` on; where nothing is beside an edge, that with which the edge begins.
    fn all(&self, first: u32) -> [u32; 6] {
        let node = |i: usize| self.beside.get(i).map_or(self.nodes[i], |beside| beside.node);
        let [a, b, c] = self.nodes;
        let [d, e, f] = [0, 1, 2].map(|i| if self.beside.get(i).is_some_and(|b| b.clamped) { node(i) } else { node(i) + first });
        [a + first, b + first, c + first, d, e, f]
    }

    /// Matrices with which folds give curvatures (kxx, kyy, kxy), of whom and for how much area [m²]: of the whole, by (bending.6); where six
    /// points do not determine a surface, or two of them are one, each fold stands for half of the area on both sides of it.
    fn curvatures(&self, d: [f64; 3]) -> Vec<(Self, [f64; 9], f64)> {
        let [a, b, c] = self.at;
        let area = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0;
        let others: Vec<u32> = self.beside.iter().map(|b| b.node).collect();
        let is_plain = (0..others.len()).all(|i| !self.nodes.contains(&others[i]) && !others[..i].contains(&others[i]));
        if self.beside.is_empty() {
            return Vec::new();
        }
        if let Some(g) = is_plain.then(|| self.curvature(d)).flatten() {
            return vec![(self.clone(), g, area)];
        }
        let alone = |(i, beside): (usize, &Beside)| {
            let order = [0, 1, 2].map(|k| (i + k) % 3);
            let one = Self { nodes: order.map(|k| self.nodes[k]), at: order.map(|k| self.at[k]), beside: vec![*beside] };
            let e = [0, 1].map(|c| one.at[1][c] - one.at[0][c]);
            let length_sq = e[0] * e[0] + e[1] * e[1];
            let (own, other) = (2.0 * area, beside.height * length_sq.sqrt());
            // theta = kappa (h2 + h3)/2, across the edge; at a clamp, half of that on this side alone.
            let (sum, share) = if beside.clamped { (own, own / 2.0) } else { (own + other, (own + other) / 4.0) };
            let (x, y, over) = (e[1], -e[0], 2.0 / (length_sq.sqrt() * sum));
            let mut g = [0.0; 9];
            (g[0], g[3], g[6]) = (over * x * x, over * y * y, over * x * y);
            (one, g, share)
        };
        // What a fold would have for itself as its own neighbour is no fold.
        let folds = self.beside.iter().enumerate().filter(|(_, b)| !self.nodes.contains(&b.node));
        folds.map(alone).collect()
    }

    /// Folds t of the surface with the second derivatives kxx, kyy, kxy: a row for each edge that has a neighbour.     (bending.10)
    fn folds(&self) -> Vec<[f64; 3]> {
        let row = |(i, beside): (usize, &Beside)| {
            let [a, b, c] = [0, 1, 2].map(|k| self.at[(i + k) % 3]);
            let (e, to) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
            let length_sq = e[0] * e[0] + e[1] * e[1];
            let length = length_sq.sqrt();
            let (foot, height) = ((to[0] * e[0] + to[1] * e[1]) / length_sq, (e[0] * to[1] - e[1] * to[0]) / length);
            if beside.clamped {
                // Of w = k n²/2, n from the edge, the fold against the plane of the clamp.                 (bending.14)
                let (x, y) = (-e[1] / length, e[0] / length);
                return [-height / 2.0 * x * x, -height / 2.0 * y * y, -height * x * y];
            }
            let out = beside.height / length;
            let d = [a[0] + beside.foot * e[0] + out * e[1], a[1] + beside.foot * e[1] - out * e[0]];
            let (k2, k3) = (-1.0 / height, -1.0 / beside.height);
            let k1 = -foot * k2 - beside.foot * k3;
            let slopes = [-k1 - k2 - k3, k1, k2, k3].into_iter().zip([a, b, c, d]);
            slopes.fold([0.0; 3], |s, (k, [x, y])| [s[0] + k * x * x / 2.0, s[1] + k * y * y / 2.0, s[2] + k * x * y])
        };
        self.beside.iter().enumerate().map(row).collect()
    }

    /// The matrix of three rows with which folds give the curvature of least energy D/2 that has them; `None` if they leave one undetermined.
    fn curvature(&self, d: [f64; 3]) -> Option<[f64; 9]> {
        let folds = self.folds();
        let n = folds.len();
        let sizes: Vec<f64> = folds.iter().map(|a| (0..3).map(|c| a[c] * a[c] / d[c]).sum::<f64>().sqrt()).collect();
        // Cholesky of S = A D^-1 A^T, scaled to a diagonal of 1.
        let mut l = [[0.0; 3]; 3];
        for i in 0..n {
            for j in 0..=i {
                let s: f64 = (0..3).map(|c| folds[i][c] * folds[j][c] / d[c]).sum::<f64>() / (sizes[i] * sizes[j]);
                let rest = s - (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>();
                l[i][j] = if i == j { rest.sqrt() } else { rest / l[j][j] };
                if i == j && (rest.is_nan() || rest <= UNDETERMINED) {
                    return None;
                }
            }
        }
        // G = D^-1 A^T S^-1, column by column.
        let mut g = [0.0; 9];
        for column in 0..n {
            let mut y = [0.0; 3];
            for i in 0..n {
                let own = if i == column { 1.0 / sizes[i] } else { 0.0 };
                y[i] = (own - (0..i).map(|k| l[i][k] * y[k]).sum::<f64>()) / l[i][i];
            }
            for i in (0..n).rev() {
                y[i] = (y[i] - (i + 1..n).map(|k| l[k][i] * y[k]).sum::<f64>()) / l[i][i];
            }
            for c in 0..3 {
                g[3 * c + column] = (0..n).map(|i| folds[i][c] / d[c] * y[i] / sizes[i]).sum();
            }
        }
        Some(g)
    }
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

    /// What keeps the triangles of a mesh in shape, whose vertices are points from `first` on; `rest` is where nothing is strained.
    pub(super) fn stretch(&mut self, mesh: &Mesh, first: u32, words: &Surface<'_>, rest: &Rest<'_>) {
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

    /// Bending of the triangles of a mesh. Its rest angles are those of the mesh, or none if there is a pattern; flat hinges across edges have none.
    pub(super) fn bending(&mut self, mesh: &Mesh, first: u32, words: &Surface<'_>, rest: &Rest<'_>) {
        if words.hinge == 0.0 && words.isometric == 0.0 && words.fabric.is_none() {
            return;
        }
        let mut beside = vec![[None; 3]; mesh.triangles.len()];
        for ([a, b], faces) in mesh.edges() {
            if let [t] = faces[..] {
                self.clamp(mesh, first, (words, rest), [a, b], (t as usize, &mut beside[t as usize]));
                continue;
            }
            let Some(Wings { nodes, faces, at }) = rest.wings([a, b], &faces) else { continue };
            let e = at[1] - at[0];
            let length_sq = e.norm_sq();
            let [left, right] = [at[2], at[3]].map(|x| (e.dot(x - at[0]) / length_sq, e.cross(x - at[0]).norm() / length_sq.sqrt()));
            if !(left.1 > 0.0 && right.1 > 0.0) {
                continue;
            }
            for (t, node, (foot, height)) in [(faces[0], nodes[3], right), (faces[1], nodes[2], left)] {
                let corners = mesh.triangles[t];
                if let Some(k) = (0..3).find(|k| [a, b].contains(&corners[*k]) && [a, b].contains(&corners[(k + 1) % 3])) {
                    let foot = if corners[k] == a { foot } else { 1.0 - foot };
                    beside[t][k] = Some(Beside { node, clamped: false, foot, height });
                }
            }
            if let (true, Some(flat)) = (words.isometric > 0.0, IsometricBend::rest(at)) {
                // k = B l²/(A1 + A2): (bending.10).
                let share = 2.0 * length_sq.sqrt() / (left.1 + right.1);
                self.parts.isometric(nodes.map(|i| i + first), flat, words.isometric * share);
            }
        }
        for (t, beside) in beside.iter().enumerate() {
            self.bend(mesh, first, words, rest, t, beside);
        }
    }

    /// Lets the rim edge a b of a triangle keep its slope where it is clamped: beside it lies the mirror image of the triangle.
    fn clamp(
        &mut self,
        mesh: &Mesh,
        first: u32,
        (words, rest): (&Surface<'_>, &Rest<'_>),
        [a, b]: [u32; 2],
        (t, beside): (usize, &mut [Option<Beside>; 3]),
    ) {
        let Some(clamp) = Clamp::of_edge(words.clamps, [a + first, b + first]) else { return };
        let nodes = mesh.triangles[t];
        let Some(i) = (0..3).find(|i| nodes[(*i + 2) % 3] != a && nodes[(*i + 2) % 3] != b) else { return };
        let order = [0, 1, 2].map(|c| (i + c) % 3);
        // Foot of the third corner on the edge, from the first to the second, and its height [m].
        let over = |[x, y, z]: [Vector; 3]| {
            let (e, to) = (y - x, z - x);
            (e.dot(to) / e.norm_sq(), e.cross(to).norm() / e.norm())
        };
        let flat = rest.corners(t);
        let (foot, height) = over(order.map(|c| flat[c]));
        let now = order.map(|c| self.parts.position(nodes[c] + first));
        let on_edge = now[0] + (now[1] - now[0]) * over(now).0;
        if height.is_nan() || height <= 0.0 {
            return;
        }
        let node = clamp.ghost(self, on_edge * 2.0 - now[2]);
        beside[i] = Some(Beside { node, clamped: true, foot, height });
        let [x, y, z] = order.map(|c| flat[c]);
        let mirrored = (x + (y - x) * foot) * 2.0 - z;
        if let (true, Some(flat)) = (words.isometric > 0.0, IsometricBend::rest([x, y, z, mirrored])) {
            // The fold stands for this side of the edge alone: k = B l²/A.                                (bending.14)
            let length = (y - x).norm();
            let [p, q, r] = order.map(|c| nodes[c] + first);
            self.parts.isometric([p, q, r, node], flat, words.isometric * 2.0 * length / height);
        }
    }

    /// Bending of one triangle with what lies beside it, across each of its edges.
    fn bend(&mut self, mesh: &Mesh, first: u32, words: &Surface<'_>, rest: &Rest<'_>, t: usize, beside: &[Option<Beside>; 3]) {
        let corners = rest.corners(t);
        let (warp, turn) = rest.warp(words.fabric.as_ref().map_or(0.0, |f| f.words.angle));
        let (u, v) = Membrane::grain(corners, warp, turn);
        if !(u.norm_sq().is_finite() && v.norm_sq().is_finite()) {
            return;
        }
        let patch = Patch::new(mesh.triangles[t], corners.map(|x| [(x - corners[0]).dot(u), (x - corners[0]).dot(v)]), beside);
        let angles = |patch: &Patch| {
            let x = |i: u32| mesh.vertices[i as usize];
            let angle = |(i, b): (usize, &Beside)| {
                let [p, q, r] = [0, 1, 2].map(|k| patch.nodes[(i + k) % 3]);
                if rest.pattern.is_some() || b.clamped { 0.0 } else { Bending::angle([x(p), x(q), x(r), x(b.node)]) }
            };
            patch.beside.iter().enumerate().map(angle).collect::<Vec<_>>()
        };
        let numbers = |l: [f64; 9], patch: &Patch| {
            let mut numbers = [0.0; 12];
            numbers[..9].copy_from_slice(&l);
            numbers[9..].iter_mut().zip(angles(patch)).for_each(|(t0, angle)| *t0 = angle);
            numbers
        };
        if words.hinge > 0.0 {
            // W = B/2 (kxx² + kyy² + 2 kxy²): (bending.13).
            let d = [1.0, 1.0, 2.0];
            for (patch, g, area) in patch.curvatures(d) {
                let l = std::array::from_fn(|i| (area * d[i / 3]).sqrt() * g[i]);
                self.parts.bending(patch.all(first), numbers(l, &patch), words.hinge);
            }
        }
        if let Some((fabric, rows)) = words.fabric.as_ref().and_then(|f| Some((f, f.rows()?))) {
            for (patch, g, area) in patch.curvatures(WovenBending::flat(&rows)) {
                let mut all = [0.0; 36];
                all[..12].copy_from_slice(&numbers(g.map(|g| g / WovenBending::SAMPLE), &patch));
                all[12..].copy_from_slice(rows.as_flattened());
                let stiffness = area * WovenBending::SAMPLE * WovenBending::SAMPLE;
                self.parts.woven_bending(patch.all(first), all, stiffness, fabric.words.damping);
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
