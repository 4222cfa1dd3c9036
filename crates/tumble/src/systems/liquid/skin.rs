//! The surface of a liquid as triangles, for pictures and files: the net of its distances, smoothed along itself.
//!
//! Beyond the sides of the box distances are mirrored with their sign reversed, so that the surface closes on them. Vertices have the mean velocity of
//! the particles around.
//!
//! Source: [gibson1998] for the net, [taubin1995] for smoothing that keeps the volume.

use super::level::share;
use super::tank::Tank;
use crate::geometry::Vector;
use crate::geometry::nets::{halved, net};
use crate::math::Real;
use crate::math::parallel::{CHUNK, Tasks};

/// Rounds of smoothing, each there and back.
const ROUNDS: usize = 3;
/// Parts of the way to the mean of the neighbours, there and back.
const THERE: f64 = 0.5;
const BACK: f64 = -0.53;
/// How far vertices are moved at most to enclose what they should [cells].
const MOST: f64 = 0.2;
/// How far particles lend a vertex their velocity [cells].
const REACH: Real = 1.5;

/// A closed surface, facing outward.
#[derive(Debug, Default)]
pub struct Skin {
    /// Places of its vertices [m].
    pub vertices: Vec<[f64; 3]>,
    /// Their velocities [m/s].
    pub velocities: Vec<[f64; 3]>,
    /// Corners of its triangles.
    pub triangles: Vec<[u32; 3]>,
}

impl Tank {
    /// Its surface now; none in the plane.
    pub fn skin(&self) -> Skin {
        let grid = self.grid();
        if grid.flat.is_some() {
            return Skin::default();
        }
        // A point for each cell, and one beyond each side.
        let n = grid.n.map(|n| n + 2);
        let lattice = grid.lattice();
        let mut values = Vec::with_capacity(n.iter().product());
        let mut inside = 0.0;
        for k in 0..n[2] {
            for j in 0..n[1] {
                for i in 0..n[0] {
                    let point = [i, j, k];
                    let cell: [usize; 3] = std::array::from_fn(|a| point[a].clamp(1, grid.n[a]) - 1);
                    let phi = f64::from(self.level.distance.data[lattice.at(cell[0], cell[1], cell[2])]);
                    if (0..3).all(|a| cell[a] + 1 == point[a]) {
                        inside += f64::from(share(-phi as Real));
                        values.push(phi);
                    } else {
                        values.push(phi.abs());
                    }
                }
            }
        }
        let (mut vertices, quads) = net(&values, n, &|i| Vector::from(i.map(|i| i as f64 - 0.5)));
        smooth(&mut vertices, &quads);
        let triangles = halved(&vertices, &quads);
        fill(&mut vertices, &triangles, inside);
        let velocities =
            vertices.chunks(CHUNK).map_in_parallel(|part| part.iter().map(|x| self.velocity_near(x)).collect::<Vec<_>>()).concat();
        let place = |x: &[f64; 3]| std::array::from_fn(|a| grid.origin[a] + grid.dx * x[a].clamp(0.0, grid.n[a] as f64));
        Skin { vertices: vertices.iter().map(place).collect(), velocities, triangles }
    }

    /// The mean velocity of the particles around a place [cells].
    fn velocity_near(&self, x: &[f64; 3]) -> [f64; 3] {
        let n = self.grid().n;
        let around = |a: usize| {
            let cell = (x[a].max(0.0) as usize).min(n[a] - 1);
            cell.saturating_sub(1)..(cell + 2).min(n[a])
        };
        let (mut sum, mut mean) = (0.0, [0.0; 3]);
        for k in around(2) {
            for j in around(1) {
                let row = around(0);
                let number = |i: usize| i + n[0] * (j + n[1] * k);
                let particles = self.particles.between(number(row.start), number(row.end));
                for (p, v) in self.particles.x[particles.clone()].iter().zip(&self.particles.v[particles]) {
                    let far: Real = (0..3).map(|a| (p[a] - x[a] as Real) * (p[a] - x[a] as Real)).sum();
                    let weight = f64::from((1.0 - far / (REACH * REACH)).max(0.0));
                    sum += weight;
                    (0..3).for_each(|a| mean[a] += weight * f64::from(v[a]));
                }
            }
        }
        if sum > 0.0 { mean.map(|m| m / sum) } else { [0.0; 3] }
    }
}

/// Moves vertices along their normals until they enclose a volume [cells]: chords and means lie inside of what bulges.
fn fill(vertices: &mut [[f64; 3]], triangles: &[[u32; 3]], volume: f64) {
    let mut normals = vec![Vector::default(); vertices.len()];
    let (mut six, mut twice) = (0.0, 0.0);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| Vector::from(vertices[i as usize]));
        let normal = (b - a).cross(c - a);
        six += a.dot(normal);
        twice += normal.norm();
        triangle.iter().for_each(|i| normals[*i as usize] = normals[*i as usize] + normal);
    }
    let way = if twice > 0.0 { (2.0 * (volume - six / 6.0) / twice).clamp(-MOST, MOST) } else { 0.0 };
    for (x, normal) in vertices.iter_mut().zip(&normals) {
        let far = normal.norm();
        if far > 0.0 {
            *x = (Vector::from(*x) + *normal * (way / far)).into();
        }
    }
}

/// Moves vertices towards the mean of their neighbours, and a little farther back.
fn smooth(vertices: &mut [[f64; 3]], quads: &[[u32; 4]]) {
    let mut counts = vec![0.0; vertices.len()];
    quads.iter().flatten().for_each(|corner| counts[*corner as usize] += 2.0);
    let mut sums = vec![[0.0; 3]; vertices.len()];
    for part in [THERE, BACK].repeat(ROUNDS) {
        sums.fill([0.0; 3]);
        for quad in quads {
            for k in 0..4 {
                for other in [quad[(k + 1) % 4], quad[(k + 3) % 4]] {
                    (0..3).for_each(|a| sums[quad[k] as usize][a] += vertices[other as usize][a]);
                }
            }
        }
        for ((x, sum), count) in vertices.iter_mut().zip(&sums).zip(&counts) {
            (0..3).for_each(|a| x[a] += part * (sum[a] / count - x[a]));
        }
    }
}
