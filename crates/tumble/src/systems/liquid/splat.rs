//! From particles to the grid: every point gathers what the particles around it carry, in their order.
//!
//!   m_i = sum over p of w_ip,   m_i u_i = sum over p of w_ip (v_p + C_p (x_i - x_p))                                   (pic.1)
//!
//! A task has some planes of points and goes through all particles that reach them; so each sum is in the order of the particles, whatever
//! the number of threads and the size of a task.

use super::particles::Particles;
use super::stencil::Points;
use crate::math::parallel::{Tasks, chunks2};
use crate::math::{Column, Real};
use crate::state::{Field, Grid, Place, Vectors};

/// Planes of a task, or rows in a plane.
const SLAB: usize = 4;
/// Weight below which a face has no velocity.
pub const LEAST: Real = 1e-6;

/// Points of a task.
struct Target<'a> {
    axis: Option<usize>,
    points: Points,
    momentum: &'a mut [Real],
    weight: &'a mut [Real],
}

/// How tasks share a grid.
#[derive(Clone, Copy)]
struct Slabs {
    n: [usize; 3],
    outer: usize,
    stride: [usize; 3],
    /// From the start of a task's numbers to its first row.
    inset: usize,
    first: usize,
    count: usize,
}

impl Slabs {
    fn new(grid: &Grid) -> Self {
        let (n, lattice) = (grid.n, grid.lattice());
        let outer = if grid.flat == Some(2) { 1 } else { 2 };
        let inset = if outer == 2 { lattice.stride[1] } else { 0 };
        Self { n, outer, stride: lattice.stride, inset, first: lattice.at(0, 0, 0) - inset, count: (n[outer] + 1).div_ceil(SLAB) }
    }

    fn chunks<'a>(&self, data: &'a mut [Real]) -> impl Iterator<Item = &'a mut [Real]> {
        data[self.first..].chunks_mut(SLAB * self.stride[self.outer]).take(self.count)
    }

    /// Particles that may reach the points of a task.
    fn particles(&self, task: usize, particles: &Particles) -> std::ops::Range<usize> {
        let n = self.n[self.outer];
        let (from, to) = ((SLAB * task).saturating_sub(1).min(n), (SLAB * (task + 1) + 1).min(n));
        let plane = if self.outer == 2 { self.n[0] * self.n[1] } else { self.n[0] };
        particles.between(from * plane, to * plane)
    }
}

/// Gives faces the velocity [m/s] and the weight of the particles around them; where there are none, both are zero.
pub fn to_faces(particles: &Particles, u: &mut Vectors, weights: &mut [Column]) {
    let Some(grid) = u.parts.first().map(|part| part.grid) else { return };
    let slabs = Slabs::new(&grid);
    let mut tasks: Vec<Vec<Target<'_>>> = (0..slabs.count).map(|_| Vec::new()).collect();
    for (part, weight) in u.parts.iter_mut().zip(weights.iter_mut()) {
        let (axis, points) = (if let Place::Face(axis) = part.place { axis } else { 0 }, Points::new(&grid, part.place));
        let chunks = slabs.chunks(&mut part.data).zip(slabs.chunks(weight));
        for (task, (momentum, weight)) in tasks.iter_mut().zip(chunks) {
            task.push(Target { axis: Some(axis), points, momentum, weight });
        }
    }
    tasks.into_iter().enumerate().in_parallel(|(task, targets)| gather(particles, &slabs, task, targets));
    for (part, weight) in u.parts.iter_mut().zip(weights) {
        chunks2(&mut part.data, weight, |_, u, weight| {
            for (u, weight) in u.iter_mut().zip(weight) {
                *u = if *weight > LEAST { *u / *weight } else { 0.0 };
            }
        });
    }
}

/// Gives cells the number of particles around them, by their weights.                                                     (pic.9)
pub fn to_cells(particles: &Particles, count: &mut Field) {
    let (slabs, points) = (Slabs::new(&count.grid), Points::new(&count.grid, Place::Cell));
    let chunks: Vec<&mut [Real]> = slabs.chunks(&mut count.data).collect();
    chunks.into_iter().enumerate().in_parallel(|(task, weight)| {
        gather(particles, &slabs, task, vec![Target { axis: None, points, momentum: &mut [], weight }]);
    });
}

fn gather(particles: &Particles, slabs: &Slabs, task: usize, mut targets: Vec<Target<'_>>) {
    for target in &mut targets {
        target.momentum.fill(0.0);
        target.weight.fill(0.0);
    }
    let affine = !particles.gradient.is_empty();
    for i in slabs.particles(task, particles) {
        let (x, v) = (&particles.x[i], &particles.v[i]);
        for target in &mut targets {
            let Some(axis) = target.axis else {
                add(slabs, task, target, x, None);
                continue;
            };
            let slope = if affine { particles.gradient[i][axis] } else { [0.0; 3] };
            add(slabs, task, target, x, Some((v[axis], slope)));
        }
    }
}

/// Adds a particle with a velocity and its slope to the points around it that are the task's.
#[inline(always)]
fn add(slabs: &Slabs, task: usize, target: &mut Target<'_>, x: &[Real; 3], carried: Option<(Real, [Real; 3])>) {
    let Target { points, momentum, weight, .. } = target;
    let around = points.around(x);
    let [i, j, k] = around.base;
    let part = |a: usize, d: usize| if d == 1 { around.part[a] } else { 1.0 - around.part[a] };
    let (value, slope) = carried.unwrap_or((0.0, [0.0; 3]));
    let reach = |a: usize, d: usize| (around.base[a] + d) as Real + points.shift[a] - x[a];
    let first = SLAB * task;
    for dz in 0..points.count[2] {
        for dy in 0..points.count[1] {
            let outer = if slabs.outer == 2 { k + dz } else { j + dy };
            if outer < first || outer >= first + SLAB {
                continue;
            }
            let (row, plane) = if slabs.outer == 2 { (j + dy, outer - first) } else { (outer - first, 0) };
            let at = slabs.inset + i + slabs.stride[1] * row + slabs.stride[2] * plane;
            let w = part(1, dy) * part(2, dz);
            let base = value + slope[1] * reach(1, dy) + slope[2] * reach(2, dz);
            for dx in 0..points.count[0] {
                let w = w * part(0, dx);
                weight[at + dx] += w;
                if carried.is_some() {
                    momentum[at + dx] += w * (base + slope[0] * reach(0, dx));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::systems::liquid::stencil::Sampler;

    /// Momentum and angular momentum across a plane of the velocities on faces.
    fn books(u: &Vectors, weights: &[Column]) -> [f64; 3] {
        let mut sums = [0.0; 3];
        for (part, weight) in u.parts.iter().zip(weights) {
            for at in part.each() {
                let i = part.index(at);
                let momentum = f64::from(weight[i]) * f64::from(part.data[i]);
                let x = part.grid.point(part.place, at);
                if part.place == Place::Face(0) {
                    sums[0] += momentum;
                    sums[2] += x[2] * momentum;
                } else {
                    sums[1] += momentum;
                    sums[2] -= x[0] * momentum;
                }
            }
        }
        sums
    }

    #[test]
    fn a_disc_keeps_its_angular_momentum_by_affine_transfers_alone() {
        let grid = Grid::new([24, 1, 24], 1.0, [-12.0, 0.0, -12.0]).unwrap().flat(1).unwrap();
        let lattice = (0..48).flat_map(|k| (0..48).map(move |i| [0.5 * i as Real + 0.25, 0.5, 0.5 * k as Real + 0.25]));
        let x: Vec<[Real; 3]> = lattice.filter(|x| (x[0] - 12.0).hypot(x[2] - 12.0) < 9.0).collect();
        let v: Vec<[Real; 3]> = x.iter().map(|x| [x[2] - 12.0 + 0.5, 0.0, 12.0 - x[0]]).collect();
        for affine in [true, false] {
            let mut particles = Particles::new(x.clone(), v.clone(), affine);
            particles.sort(grid.n);
            let mut u = Vectors::faces(grid, "m/s").unwrap();
            let mut weights: Vec<Column> = (0..2).map(|_| Column::zeros(grid.lattice().len())).collect();
            let mut first = None;
            for _ in 0..200 {
                to_faces(&particles, &mut u, &mut weights);
                first.get_or_insert(books(&u, &weights));
                let sampler = Sampler::new(&u);
                let Particles { x, v, gradient, .. } = &mut particles;
                for (i, (x, v)) in x.iter().zip(v).enumerate() {
                    let (value, slope) = sampler.with_gradient(x);
                    *v = value;
                    gradient.get_mut(i).into_iter().for_each(|gradient| *gradient = slope);
                }
            }
            let (first, last) = (first.unwrap(), books(&u, &weights));
            let spin = last[2] / first[2];
            assert!((last[0] / first[0] - 1.0).abs() < 1e-3, "{first:?} {last:?}");
            assert!(if affine { (spin - 1.0).abs() < 2e-3 } else { spin < 0.6 }, "{affine}: {spin}");
        }
    }
}
