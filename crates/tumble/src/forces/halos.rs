//! Gravitation of masses that are spread out: halos of galaxies, each carried by one mass.

use crate::elements::{Batch, Block, Weights};
use crate::math::parallel::chunks;
use crate::math::{Real, Row, Vec3, xyz64};
use crate::state::Masses;
use std::ops::Range;
use tumble_interface::scene::Hessian;

/// f = G m_h m_i d/(|d|² + b_h² + b_i² + s²)^(3/2) between a halo h and every other mass i          (orbits.16)
///
/// b [m]: radius of Plummer's sphere, 0 for a point; exact between a sphere and a point, close between two spheres.
/// s [m]: the softening length of the points. Both ends feel the same force: momentum is kept.
pub struct Halos {
    constant: f64,
    softening_sq: f64,
    /// Rows of the halos, with their radii [m].
    radii: Vec<(u32, f64)>,
    /// Every mass that pulls or is pulled: its row, mass [kg] and b² [m²].
    bodies: Vec<Body>,
    /// Indices of the halos among the bodies.
    halos: Vec<usize>,
    weights: Weights,
    /// Positions and directions of the bodies.
    x: Vec<Vec3<f64>>,
    u: Vec<Vec3<f64>>,
}

#[derive(Debug, Clone, Copy)]
struct Body {
    row: usize,
    mass: f64,
    extent_sq: f64,
}

impl Halos {
    /// Halos, as rows with radii [m] in order, among the rows of these ranges, which do not overlap.
    pub fn new(constant: f64, softening: f64, halos: &[(u32, f64)], ranges: &[Range<usize>], masses: &Masses) -> Self {
        let mut law = Self {
            constant,
            softening_sq: softening * softening,
            radii: halos.to_vec(),
            halos: Vec::new(),
            bodies: Vec::new(),
            weights: Weights { stiffness: 1.0, damping: 0.0, hessian: Hessian::Definite },
            x: Vec::new(),
            u: Vec::new(),
        };
        law.take(ranges, masses);
        law
    }

    fn take(&mut self, ranges: &[Range<usize>], masses: &Masses) {
        let extent = |row: usize| self.radii.iter().find(|(at, _)| *at as usize == row).map_or(0.0, |(_, b)| b * b);
        let body = |row: usize| Body { row, mass: f64::from(masses.mass[row]), extent_sq: extent(row) };
        let mut rows: Vec<usize> = ranges.iter().flat_map(Clone::clone).collect();
        rows.sort_unstable();
        self.bodies = rows.into_iter().map(body).collect();
        self.halos = (0..self.bodies.len()).filter(|i| self.bodies[*i].extent_sq > 0.0).collect();
    }

    fn place(&self, rows: &[Row]) -> Vec<Vec3<f64>> {
        self.bodies.iter().map(|body| xyz64(rows[body.row])).collect()
    }

    /// Calls `f(body, its place in out)` for those among the rows from `start` on.
    fn among<T>(&self, start: usize, out: &mut [T], mut f: impl FnMut(usize, &mut T)) {
        let first = self.bodies.partition_point(|body| body.row < start);
        let end = start + out.len();
        for (i, body) in self.bodies.iter().enumerate().skip(first).take_while(|(_, body)| body.row < end) {
            f(i, &mut out[body.row - start]);
        }
    }

    /// Partners of body i: all others if it is a halo, otherwise the halos.
    fn partners(&self, i: usize) -> impl Iterator<Item = usize> {
        let (all, some) = if self.bodies[i].extent_sq > 0.0 { (self.bodies.len(), &[][..]) } else { (0, &self.halos[..]) };
        (0..all).filter(move |j| *j != i).chain(some.iter().copied())
    }

    /// G m_i m_j and the softened distance squared.
    fn pair(&self, i: usize, j: usize, d: Vec3<f64>) -> (f64, f64) {
        let (a, b) = (self.bodies[i], self.bodies[j]);
        (self.constant * a.mass * b.mass, d.norm_sq() + a.extent_sq + b.extent_sq + self.softening_sq)
    }

    /// c s3 and c q of the pair's matrix c (I s3 - d d^T q), or of its part that is not negative.
    fn matrix(&self, i: usize, j: usize, d: Vec3<f64>) -> (f64, f64) {
        let (c, r_sq) = self.pair(i, j, d);
        let s3 = c / (r_sq * r_sq.sqrt());
        let q = 3.0 * s3 / r_sq;
        let across = if d.norm_sq() > 0.0 { s3 / d.norm_sq() } else { q };
        (s3, if self.weights.hessian == Hessian::Exact { q } else { q.min(across) })
    }
}

impl Batch for Halos {
    fn name(&self) -> &'static str {
        "halos"
    }

    fn len(&self) -> usize {
        self.bodies.len()
    }

    /// -G m_h m_i/sqrt(|d|² + b_h² + b_i² + s²) of every pair.
    fn energy(&self, x: &[Row]) -> f64 {
        let x = self.place(x);
        let mut energy = 0.0;
        for h in &self.halos {
            // Of two halos, only the second sees the first.
            for i in (0..self.bodies.len()).filter(|i| i != h && (self.bodies[*i].extent_sq == 0.0 || i < h)) {
                let (c, r_sq) = self.pair(*h, i, x[i] - x[*h]);
                energy -= c / r_sq.sqrt();
            }
        }
        energy
    }

    fn renew(&mut self, on: Vec<Range<usize>>, _others: Option<Vec<Range<usize>>>, masses: &Masses) {
        self.take(&on, masses);
    }

    fn is_elastic(&self) -> bool {
        false
    }

    fn begin_forces(&mut self, _t: f64, x: &[Row], _v: &[Row]) {
        self.x = self.place(x);
    }

    fn add_forces(&self, _x: &[Row], _v: &[Row], start: usize, force: &mut [Row]) {
        self.among(start, force, |i, out| {
            let mut sum = Vec3::default();
            for j in self.partners(i) {
                let d = self.x[j] - self.x[i];
                let (c, r_sq) = self.pair(i, j, d);
                sum = sum + d * (c / (r_sq * r_sq.sqrt()));
            }
            add(out, sum);
        });
    }

    fn linearize(&mut self, x: &[Row], weights: Weights) {
        self.x = self.place(x);
        self.weights = weights;
    }

    fn begin_product(&mut self, x: &[Row], u: &[Row]) {
        self.x = self.place(x);
        self.u = self.place(u);
    }

    fn add_product(&self, _u: &[Row], start: usize, out: &mut [Row]) {
        let weight = f64::from(self.weights.stiffness);
        self.among(start, out, |i, out| {
            let mut sum = Vec3::default();
            for j in self.partners(i) {
                let (d, u) = (self.x[j] - self.x[i], self.u[i] - self.u[j]);
                let (s3, q) = self.matrix(i, j, d);
                sum = sum + u * s3 - d * (d.dot(u) * q);
            }
            add(out, sum * weight);
        });
    }

    fn add_diagonal(&mut self, x: &[Row], blocks: &mut [Block]) {
        self.x = self.place(x);
        let law = &*self;
        let weight = f64::from(law.weights.stiffness);
        chunks(blocks, |start, blocks| {
            law.among(start, blocks, |i, block| {
                for j in law.partners(i) {
                    let d = law.x[j] - law.x[i];
                    let (s3, q) = law.matrix(i, j, d);
                    let terms =
                        [s3 - q * d.x * d.x, s3 - q * d.y * d.y, s3 - q * d.z * d.z, -q * d.x * d.y, -q * d.y * d.z, -q * d.z * d.x];
                    for a in 0..6 {
                        block[a] += (weight * terms[a]) as Real;
                    }
                }
            });
        });
    }

    fn entries(&self, x: &[Row], sink: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        let (x, weight) = (self.place(x), f64::from(self.weights.stiffness));
        for i in 0..self.bodies.len() {
            for j in self.partners(i) {
                let d = x[j] - x[i];
                let (s3, q) = self.matrix(i, j, d);
                let d = [d.x, d.y, d.z];
                let mut block = [[0.0; 3]; 3];
                for r in 0..3 {
                    for k in 0..3 {
                        block[r][k] = weight * (if r == k { s3 } else { 0.0 } - q * d[r] * d[k]);
                    }
                }
                sink(self.bodies[i].row, self.bodies[i].row, block);
                sink(self.bodies[i].row, self.bodies[j].row, block.map(|row| row.map(|v| -v)));
            }
        }
    }
}

fn add(out: &mut Row, f: Vec3<f64>) {
    *out = [out[0] + f.x as Real, out[1] + f.y as Real, out[2] + f.z as Real, out[3]];
}
