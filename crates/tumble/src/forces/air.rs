//! Surfaces and threads in air that moves: drag along the air's velocity, lift across it, friction in the surface, triangle by triangle; drag
//! across a thread and friction along it, piece by piece.
//!
//!   F = rho/2 A (C_D |s| w + C_L (s |w| n - s²/|w| w) + C_F |w| (w - s n)),   w = u - v,   s = w . n             (cloth.1)
//!
//! w [m/s] is the velocity of the air relative to the triangle, whose velocity v is the mean of its corners'; n its unit normal, A its area
//! [m²]. Each corner takes a third. Turning n around changes nothing.
//!   F = rho/2 d (C_D |w_n| w_n + pi/2 C_F |w| (w - w_n)) |e|,   w_n = w - e (w . e)/e²                          (cloth.4)
//!
//! of a piece e [m] of a thread of diameter d [m]: only what blows across it meets its width (the independence principle), and all of its
//! surface rubs.
//!
//! Source: [ling1996] for drag on the area that the air sees, A |s|/|w|. Differs: lift is that of a plate that turns the air, sin a cos a
//! at the angle a between air and surface, which has no jump at a = 0.
//! Limits: the air does not notice the surface, and no triangle shelters another. Verified in tests/air.rs.

use super::Flow;
use crate::elements::{Batch, Block, Incidence, Weights};
use crate::math::parallel::{CHUNK, Tasks, chunks};
use crate::math::simd::Index;
use crate::math::{Lane, Real, Row, Vec3, ZERO, add, row, xyz64};

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// Air force on a surface or a thread.
pub struct Air {
    /// Density of the air [kg/m³].
    pub density: f64,
    /// C_D, on the area that the air sees.
    pub drag: f64,
    /// C_L.
    pub lift: f64,
    /// C_F, of both faces together.
    pub friction: f64,
    /// Velocity of the air.
    pub flow: Flow,
}

impl Air {
    /// The force [N] on a triangle of that normal, as long as its area [m²], for the relative velocity w [m/s].
    pub fn force(&self, area: Vec3<f64>, w: Vec3<f64>) -> Vec3<f64> {
        self.force_on(area, w)
    }

    fn force_on<L: Lane>(&self, area: Vec3<f64>, w: Vec3<L>) -> Vec3<L> {
        let size = area.norm();
        let one = |c: f64| w.x.like(c);
        let speed = w.norm_sq().sqrt();
        let inverse = speed.positive(one(1.0) / speed, one(0.0));
        let unit = if size > 0.0 { area * (1.0 / size) } else { area };
        let n = Vec3 { x: one(unit.x), y: one(unit.y), z: one(unit.z) };
        let s = w.dot(n);
        let seen = s.positive(s, -s);
        let along = one(self.drag) * seen - one(self.lift) * s * s * inverse + one(self.friction) * speed;
        let across = one(self.lift - self.friction) * speed * s;
        (w * along + n * across) * one(0.5 * self.density * size)
    }

    /// The force [N] on a piece of a thread of this diameter [m].
    pub fn thread_force(&self, diameter: f64, piece: Vec3<f64>, w: Vec3<f64>) -> Vec3<f64> {
        let t = piece.normalized();
        let along = t * w.dot(t);
        let across = w - along;
        (across * (self.drag * across.norm()) + along * (FRAC_PI_2 * self.friction * w.norm()))
            * (0.5 * self.density * diameter * piece.norm())
    }

    /// dF/dw without what is not symmetric, as a I + b n n^T with a, b >= 0, for that normal and relative velocity.
    fn slope(&self, area: Vec3<f64>, w: Vec3<f64>) -> (f64, f64, Vec3<f64>) {
        let size = area.norm();
        let n = if size > 0.0 { area * (1.0 / size) } else { area };
        let (speed, s) = (w.norm(), w.dot(n).abs());
        let flat = if speed > 0.0 { (speed - s * s / speed).max(0.0) } else { 0.0 };
        let scale = 0.5 * self.density * size;
        (scale * (self.drag * s + self.friction * speed), scale * (self.drag * s + self.lift * flat), n)
    }
}

/// What the air blows at: elements of N points, each of which takes an equal part of the force.
pub trait Blown<const N: usize>: Send + Sync {
    /// The area of a triangle along its normal [m²], or the way of a piece [m].
    fn span(x: [Vec3<f64>; N]) -> Vec3<f64>;
    /// The force [N] on the element `e` of this span for the relative velocity w [m/s].
    fn force(&self, air: &Air, e: usize, span: Vec3<f64>, w: Vec3<f64>) -> Vec3<f64>;
    /// dF/dw, its symmetric part without what is negative: xx, yy, zz, xy, yz, zx [N s/m].
    fn matrix(&self, air: &Air, e: usize, span: Vec3<f64>, w: Vec3<f64>) -> [f64; 6];
    /// The largest of its eigenvalues, or more.
    fn steepest(&self, air: &Air, e: usize, span: Vec3<f64>, w: Vec3<f64>) -> f64;
}

/// Triangles.
pub struct Sheets;

impl Blown<3> for Sheets {
    fn span([a, b, c]: [Vec3<f64>; 3]) -> Vec3<f64> {
        (b - a).cross(c - a) * 0.5
    }

    fn force(&self, air: &Air, _: usize, area: Vec3<f64>, w: Vec3<f64>) -> Vec3<f64> {
        air.force(area, w)
    }

    fn matrix(&self, air: &Air, _: usize, area: Vec3<f64>, w: Vec3<f64>) -> [f64; 6] {
        let (level, steep, n) = air.slope(area, w);
        block(|i, j, n| steep * n[i] * n[j] + if i == j { level } else { 0.0 }, n)
    }

    fn steepest(&self, air: &Air, _: usize, area: Vec3<f64>, w: Vec3<f64>) -> f64 {
        let (level, steep, _) = air.slope(area, w);
        level + steep
    }
}

/// Pieces of threads.
pub struct Threads {
    /// Diameter of each piece, and the length beyond which it has broken, and is none [m].
    pub pieces: Vec<[f64; 2]>,
}

impl Threads {
    /// The diameter of a piece [m]; 0 if it has broken.
    fn diameter(&self, e: usize, piece: Vec3<f64>) -> f64 {
        let [diameter, longest] = self.pieces[e];
        if piece.norm() > longest { 0.0 } else { diameter }
    }

    /// What resists across the piece, and along it [N s/m]; along w_n it is twice as much.
    fn slopes(&self, air: &Air, e: usize, piece: Vec3<f64>, w: Vec3<f64>) -> [f64; 2] {
        let t = piece.normalized();
        let across = (w - t * w.dot(t)).norm();
        let scale = 0.5 * air.density * self.diameter(e, piece) * piece.norm();
        [scale * air.drag * across, scale * FRAC_PI_2 * air.friction * w.norm()]
    }
}

impl Blown<2> for Threads {
    fn span([a, b]: [Vec3<f64>; 2]) -> Vec3<f64> {
        b - a
    }

    fn force(&self, air: &Air, e: usize, piece: Vec3<f64>, w: Vec3<f64>) -> Vec3<f64> {
        air.thread_force(self.diameter(e, piece), piece, w)
    }

    fn matrix(&self, air: &Air, e: usize, piece: Vec3<f64>, w: Vec3<f64>) -> [f64; 6] {
        let [across, along] = self.slopes(air, e, piece, w);
        let t = piece.normalized();
        let n: [f64; 3] = (w - t * w.dot(t)).normalized().into();
        let rise = |i: usize, j: usize| across * n[i] * n[j];
        block(|i, j, t| rise(i, j) + (along - across) * t[i] * t[j] + if i == j { across } else { 0.0 }, t)
    }

    fn steepest(&self, air: &Air, e: usize, piece: Vec3<f64>, w: Vec3<f64>) -> f64 {
        let [across, along] = self.slopes(air, e, piece, w);
        (2.0 * across).max(along)
    }
}

/// A symmetric matrix from its entries: xx, yy, zz, xy, yz, zx.
fn block(entry: impl Fn(usize, usize, [f64; 3]) -> f64, n: Vec3<f64>) -> [f64; 6] {
    [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)].map(|(i, j)| entry(i, j, n.into()))
}

/// Triangles or threads in the air.
pub struct Sails<B, const N: usize> {
    law: Arc<Air>,
    blown: B,
    nodes: [Index; N],
    incidence: Incidence,
    /// Mass of all corners [kg].
    mass: f64,
    /// Largest speed of the air that is foreseen, if it blows [m/s].
    fastest: Option<f64>,
    /// Of each element: the velocity relative to the air.
    relative: Vec<Row>,
    /// Of each element: the force on each corner [N], and how fast it falls with the corner's velocity [N s/m].
    forces: Vec<Row>,
    matrices: Vec<Block>,
    products: Vec<Row>,
    /// How long the forces will act at once [s]; 0 where the scheme sees to it.
    kick: f64,
}

/// Elements at a time in which the air's velocity is asked for.
const BLOCK: usize = 128;

impl<B: Blown<N>, const N: usize> Sails<B, N> {
    /// The elements of some rows, whose masses [kg] and places are given; `None` if a corner is no row. `times` are some of the run [s].
    pub fn new(law: Arc<Air>, blown: B, elements: &[[u32; N]], x: &[Row], mass: &[Real], times: &[f64]) -> Option<Self> {
        let nodes = nodes(elements, x.len())?;
        let mut rows: Vec<u32> = elements.concat();
        rows.sort_unstable();
        rows.dedup();
        let corners: Vec<Row> = rows.iter().map(|i| x[*i as usize]).collect();
        let mut u = vec![ZERO; corners.len()];
        let mut fastest = 0.0_f64;
        for t in times {
            law.flow.velocities(*t, &corners, &mut u);
            fastest = u.iter().map(|u| xyz64(*u).norm()).fold(fastest, f64::max);
        }
        Some(Self {
            incidence: Incidence::new(&nodes),
            mass: rows.iter().map(|i| f64::from(mass[*i as usize])).sum(),
            fastest: (!law.flow.fields.is_empty()).then_some(fastest),
            law,
            blown,
            nodes,
            relative: Vec::new(),
            forces: Vec::new(),
            matrices: Vec::new(),
            products: Vec::new(),
            kick: 0.0,
        })
    }

    /// The part of a corner in its element.
    const PART: f64 = 1.0 / N as f64;

    fn corners(&self, x: &[Row], e: usize) -> [Vec3<f64>; N] {
        std::array::from_fn(|a| xyz64(x[self.nodes[a].get()[e] as usize]))
    }

    fn middle(&self, x: &[Row], e: usize) -> Vec3<f64> {
        let corners = self.corners(x, e);
        corners[1..].iter().fold(corners[0], |sum, x| sum + *x) * Self::PART
    }

    fn span(&self, x: &[Row], e: usize) -> Vec3<f64> {
        B::span(self.corners(x, e))
    }

    fn check(&self, rows: &[Row]) {
        assert!(self.nodes.iter().all(|i| i.rows() <= rows.len()), "a column is shorter than the rows of the elements");
    }
}

fn nodes<const N: usize>(elements: &[[u32; N]], rows: usize) -> Option<[Index; N]> {
    let mut nodes: [Index; N] = std::array::from_fn(|_| Index::default());
    for (a, index) in nodes.iter_mut().enumerate() {
        *index = Index::new(elements.iter().map(|e| e[a]).collect(), rows)?;
    }
    Some(nodes)
}

fn narrow(v: Vec3<f64>, last: f64) -> Row {
    row(Vec3 { x: v.x as Real, y: v.y as Real, z: v.z as Real }, last as Real)
}

impl<B: Blown<N>, const N: usize> Batch for Sails<B, N> {
    fn name(&self) -> &'static str {
        "air"
    }

    fn len(&self) -> usize {
        self.nodes[0].get().len()
    }

    fn energy(&self, _x: &[Row]) -> f64 {
        0.0
    }

    fn is_elastic(&self) -> bool {
        false
    }

    /// Twice the speed of the air.
    fn drives(&self) -> Option<f64> {
        self.fastest.map(|u| 2.0 * self.mass * u * u)
    }

    fn feels_velocity(&self) -> bool {
        true
    }

    fn act_at_once(&mut self, h: f64) {
        self.kick = h;
    }

    fn begin_forces(&mut self, t: f64, x: &[Row], v: &[Row]) {
        self.check(x);
        self.check(v);
        let n = self.len();
        let (mut relative, mut forces) = (std::mem::take(&mut self.relative), std::mem::take(&mut self.forces));
        relative.resize(n, ZERO);
        forces.resize(n, ZERO);
        let sails = &*self;
        relative.chunks_mut(BLOCK).zip(forces.chunks_mut(BLOCK)).enumerate().in_parallel(|(block, (relative, forces))| {
            let mut middle = [ZERO; BLOCK];
            for (k, middle) in middle.iter_mut().enumerate().take(forces.len()) {
                *middle = narrow(sails.middle(x, block * BLOCK + k), 0.0);
            }
            sails.law.flow.velocities(t, &middle[..forces.len()], relative);
            for (k, (w, f)) in relative.iter_mut().zip(forces).enumerate() {
                let e = block * BLOCK + k;
                let (span, wind) = (sails.span(x, e), xyz64(*w) - sails.middle(v, e));
                *w = narrow(wind, 0.0);
                let force = sails.blown.force(&sails.law, e, span, wind) * Self::PART;
                *f = narrow(force, sails.blown.steepest(&sails.law, e, span, wind) * Self::PART);
            }
        });
        (self.relative, self.forces) = (relative, forces);
    }

    fn add_forces(&self, x: &[Row], _v: &[Row], start: usize, force: &mut [Row]) {
        let kick = self.kick as Real;
        self.incidence.rows(start, force, |i, out, slots| {
            let mut sum = ZERO;
            for slot in slots {
                sum = add(sum, self.forces[*slot as usize / N]);
            }
            // At once, no more than what takes the wind out of the surface.
            let part = 1.0 / (kick * x[i][3] * sum[3]).max(1.0);
            *out = [out[0] + part * sum[0], out[1] + part * sum[1], out[2] + part * sum[2], out[3]];
        });
    }

    fn rewire(&mut self, changes: &[(u32, usize, u32)]) {
        if changes.is_empty() {
            return;
        }
        for (element, node, row) in changes {
            self.nodes[*node].set(*element as usize, *row);
        }
        self.incidence = Incidence::new(&self.nodes);
    }

    /// How the force changes with the place and the turn of an element is left out: it is slow beside what velocities do.
    fn linearize(&mut self, x: &[Row], weights: Weights) {
        self.check(x);
        let mut matrices = std::mem::take(&mut self.matrices);
        matrices.resize(self.len(), [0.0; 6]);
        let sails = &*self;
        chunks(&mut matrices, |start, matrices| {
            for (k, block) in matrices.iter_mut().enumerate() {
                let Some(w) = sails.relative.get(start + k) else { continue };
                let c = f64::from(weights.damping) / (N * N) as f64;
                *block = sails.blown.matrix(&sails.law, start + k, sails.span(x, start + k), xyz64(*w)).map(|entry| (c * entry) as Real);
            }
        });
        self.matrices = matrices;
    }

    fn begin_product(&mut self, _x: &[Row], u: &[Row]) {
        self.check(u);
        let mut products = std::mem::take(&mut self.products);
        products.resize(self.len(), ZERO);
        let sails = &*self;
        products.chunks_mut(CHUNK).enumerate().in_parallel(|(c, products)| {
            for (k, out) in products.iter_mut().enumerate() {
                let e = c * CHUNK + k;
                let row = |a: usize| u[sails.nodes[a].get()[e] as usize];
                let s = (1..N).fold(row(0), |sum, a| add(sum, row(a)));
                let [xx, yy, zz, xy, yz, zx] = sails.matrices[e];
                *out = [xx * s[0] + xy * s[1] + zx * s[2], xy * s[0] + yy * s[1] + yz * s[2], zx * s[0] + yz * s[1] + zz * s[2], 0.0];
            }
        });
        self.products = products;
    }

    fn add_product(&self, _u: &[Row], start: usize, out: &mut [Row]) {
        self.incidence.rows(start, out, |_, out, slots| {
            for slot in slots {
                *out = add(*out, self.products[*slot as usize / N]);
            }
        });
    }

    fn add_diagonal(&mut self, _x: &[Row], blocks: &mut [Block]) {
        let sails = &*self;
        chunks(blocks, |start, blocks| {
            sails.incidence.rows(start, blocks, |_, out, slots| {
                for slot in slots {
                    let block = sails.matrices[*slot as usize / N];
                    (0..6).for_each(|c| out[c] += block[c]);
                }
            });
        });
    }

    fn entries(&self, _x: &[Row], sink: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        for (e, block) in self.matrices.iter().enumerate() {
            let [xx, yy, zz, xy, yz, zx] = block.map(f64::from);
            for a in 0..N {
                for b in 0..N {
                    let [a, b] = [a, b].map(|k: usize| self.nodes[k].get()[e] as usize);
                    sink(a, b, [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Dual;

    /// The slope is that of the force where the two agree: straight onto the surface, and the friction along it.
    #[test]
    fn the_slope_is_the_derivative_where_it_is_symmetric() {
        let law = Air { density: 1.2, drag: 1.1, lift: 0.7, friction: 0.05, flow: Flow::default() };
        let area = Vec3 { x: 0.3, y: -0.2, z: 0.6 };
        let n = area * (1.0 / area.norm());
        let w = n * 3.0;
        let derivative = |e: Vec3<f64>| law.force_on(area, Vec3::<Dual<f64>>::lift(w, e)).slope();
        let (level, steep, _) = law.slope(area, w);
        assert!((derivative(n) - n * (level + steep)).norm() < 2.0 * law.friction * 3.0 * area.norm());
        let along = Vec3 { x: 0.2, y: 0.3, z: 0.0 };
        assert!(along.dot(n).abs() < 1e-12 && level > 0.0 && steep > 0.0);
        // A thread, at any angle: the slope is the derivative of the force, symmetric where friction is none.
        let threads = Threads { pieces: vec![[0.02, f64::INFINITY]] };
        let law = Air { friction: 0.0, ..law };
        for (piece, w) in [(area, w + Vec3 { x: 1.0, y: 0.4, z: -0.3 }), (area, Vec3 { x: -0.2, y: 0.1, z: 4.0 })] {
            let matrix = threads.matrix(&law, 0, piece, w);
            let force = |w| threads.force(&law, 0, piece, w);
            for (i, e) in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3::from).into_iter().enumerate() {
                let slope: [f64; 3] = ((force(w + e * 1e-6) - force(w - e * 1e-6)) * 0.5e6).into();
                let column = [[0, 3, 5], [3, 1, 4], [5, 4, 2]][i].map(|k: usize| matrix[k]);
                assert!((0..3).all(|k| (slope[k] - column[k]).abs() < 1e-8), "{slope:?} {column:?}");
                assert!(column[i] <= threads.steepest(&law, 0, piece, w) && column[i] > 0.0);
            }
        }
        // Turned around it is the same surface.
        assert_eq!(law.force(area, w + along), law.force(-area, w + along));
    }
}
