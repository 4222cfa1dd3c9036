//! The free surface: how far each cell is from it, from the particles around.
//!
//!   y = sum over p of k(|x - x_p|) (x_p - x)/sum of k,   phi = G(|y|)                                                   (pic.4)
//!
//! with k(r) = (1 - (r/R)²)³ and G such that phi is the distance from the surface of a half-space that is full of particles. In a full
//! neighbourhood y is 0. It is so in thin sheets, too, and a crowd in one spot looks like a single particle; so the weight of the particles around
//! bounds phi from both sides.
//!
//! Source: [zhu2005], without a radius of its own.

use super::particles::Particles;
use crate::fluids::Solids;
use crate::math::Real;
use crate::math::parallel::{self, Tasks};
use crate::state::{Field, Grid, GridError, Place};
use std::f64::consts::PI;

/// Reach of the kernel [cells].
const REACH: f64 = 1.5;
/// Entries of G.
const TABLE: usize = 128;
/// Beside solids that are nearer than that, particles that only they keep away are not missed [cells].
const BESIDE: Real = 1.5;

/// What a cell is.
pub mod cell {
    /// Without liquid.
    pub const AIR: u8 = 0;
    /// With liquid at its middle.
    pub const LIQUID: u8 = 1;
    /// Beyond the box.
    pub const OUTSIDE: u8 = 2;
}

/// A liquid that is nowhere around so deep is thin [cells].
const DEEP: Real = 0.5;

/// What a cell has, and all those around it together: nothing, particles, or a solid that keeps them away.
const NOTHING: u8 = 1;
const PARTICLES: u8 = 2;
const SOLID: u8 = 4;
/// Fewer particles than for half of it.
const SPARSE: u8 = 8;
/// By how much the weight of the particles around may be off before it says more than where they lie.
const SPREAD: Real = 1.2;

/// The free surface of a liquid.
pub struct Level {
    /// Distance of the middle of cells from it, below zero inside [cells]; beyond the reach of the kernel it is that.
    pub distance: Field,
    /// What each cell is.
    pub cells: Vec<u8>,
    /// Volume of the liquid [cells].
    pub volume: f64,
    /// Which cells have particles, and which neighbourhoods.
    there: Vec<u8>,
    around: Vec<u8>,
    /// G at equal distances from 0 to R.
    table: Vec<Real>,
    /// Distances of half-spaces, by equal parts of the weight of a full neighbourhood that they have.
    parts: Vec<Real>,
}

/// What distances are looked up in, and the part of the weight of a full neighbourhood that a particle at its middle has.
struct Tables<'a> {
    distance: &'a [Real],
    parts: &'a [Real],
    particle: Real,
}

impl Level {
    /// Of an empty box.
    pub fn new(grid: Grid) -> Result<Self, GridError> {
        let len = grid.lattice().len();
        Ok(Self {
            distance: Field::new(grid, Place::Cell, "1")?,
            cells: vec![cell::OUTSIDE; len],
            volume: 0.0,
            there: vec![0; len],
            around: vec![0; len],
            table: table(grid.dimension()),
            parts: parts(grid.dimension()),
        })
    }

    /// Finds it anew around sorted particles, each of this volume [cells].
    pub fn measure(&mut self, particles: &Particles, particle: f64, solids: Option<&Solids>) {
        let grid = self.distance.grid;
        self.fill(particles, particle, solids);
        let full = if grid.dimension() == 3 { REACH.powi(3) * 64.0 * PI / 315.0 } else { REACH * REACH * PI / 4.0 };
        let Self { distance, cells, there, around, table, parts, .. } = self;
        let tables = Tables { distance: table, parts, particle: (particle / full) as Real };
        let (lattice, [x, y, z]) = (grid.lattice(), grid.n);
        let plane = lattice.stride[2];
        let first = lattice.at(0, 0, 0) - lattice.stride[1];
        let there = &*there;
        let tasks = distance.data[first..].chunks_mut(plane).zip(cells[first..].chunks_mut(plane)).zip(around[first..].chunks_mut(plane));
        tasks.take(z).enumerate().in_parallel(|(k, ((distance, cells), around))| {
            for j in 0..y {
                let row = lattice.at(0, j, k);
                let own = row - first - k * plane;
                let around = &mut around[own..own + x];
                look_around(&grid, there, row, around);
                for i in 0..x {
                    let phi = if around[i] & PARTICLES == 0 {
                        REACH as Real
                    } else if around[i] & (NOTHING | SPARSE) == 0 {
                        -REACH as Real
                    } else {
                        found(&grid, particles, solids, &tables, [i, j, k])
                    };
                    distance[own + i] = phi;
                    cells[own + i] = if phi < 0.0 { cell::LIQUID } else { cell::AIR };
                }
            }
        });
        self.volume = self.sum(particles, particle, solids);
    }

    /// The volume below the surface [cells]. Of drops and sheets thinner than a cell, particles say more than the surface around them.
    fn sum(&self, particles: &Particles, particle: f64, solids: Option<&Solids>) -> f64 {
        let (grid, phi) = (self.distance.grid, &self.distance.data);
        let (lattice, [x, y, z]) = (grid.lattice(), grid.n);
        let offsets = |a: usize| if grid.flat == Some(a) { [0, 0, 0] } else { [0, lattice.stride[a], 2 * lattice.stride[a]] };
        let [across, along, up] = [0, 1, 2].map(offsets);
        let first = grid.axes().map(|a| lattice.stride[a]).sum::<usize>();
        let is_deep = |at: usize| {
            let low = at - first;
            up.iter().any(|z| along.iter().any(|y| across.iter().any(|x| phi[low + x + y + z] < -DEEP)))
        };
        let planes = parallel::map(z, |k| {
            let mut volume = 0.0;
            for j in 0..y {
                let row = lattice.at(0, j, k);
                for i in 0..x {
                    let (at, number) = (row + i, i + x * (j + y * k));
                    let part = share(-phi[at]);
                    let own = || particle * particles.between(number, number + 1).len() as f64;
                    volume += match part {
                        0.0 => own(),
                        1.0 => open(&grid, solids, at),
                        _ if is_deep(at) => open(&grid, solids, at) * f64::from(part),
                        _ => own(),
                    };
                }
            }
            volume
        });
        planes.iter().sum()
    }

    /// Which cells have particles; those in solids miss none.
    fn fill(&mut self, particles: &Particles, particle: f64, solids: Option<&Solids>) {
        let grid = self.distance.grid;
        let (lattice, [x, y, z]) = (grid.lattice(), grid.n);
        let plane = lattice.stride[2];
        let first = lattice.at(0, 0, 0) - lattice.stride[1];
        self.there[first..].chunks_mut(plane).take(z).enumerate().in_parallel(|(k, there)| {
            for j in 0..y {
                let row = lattice.at(0, j, k);
                let there = &mut there[row - first - k * plane..][..x];
                for (i, there) in there.iter_mut().enumerate() {
                    let number = i + x * (j + y * k);
                    let solid = || solids.is_some_and(|solids| solids.middle(row + i) < 0.5 * grid.dx as Real);
                    *there = match particles.between(number, number + 1).len() {
                        0 if solid() => SOLID,
                        0 => NOTHING,
                        n if n as f64 * particle < 0.5 => PARTICLES | SPARSE,
                        _ => PARTICLES,
                    };
                }
            }
        });
    }
}

/// The part of a cell that solids leave.
fn open(grid: &Grid, solids: Option<&Solids>, cell: usize) -> f64 {
    solids.map_or(1.0, |solids| f64::from(share(solids.middle(cell) / grid.dx as Real)))
}

/// The part of a cell that is on the lower side of a surface at this distance from its middle [cells].
pub fn share(distance: Real) -> Real {
    (0.5 + distance).clamp(0.0, 1.0)
}

/// What the neighbourhoods of a row of cells have.
fn look_around(grid: &Grid, there: &[u8], row: usize, around: &mut [u8]) {
    let (stride, n) = (grid.lattice().stride, around.len());
    around.fill(0);
    let offsets = |a: usize| if grid.flat == Some(a) { [0, 0, 0] } else { [0, stride[a], 2 * stride[a]] };
    let low = row - grid.axes().filter(|a| *a > 0).map(|a| stride[a]).sum::<usize>();
    for z in offsets(2) {
        for y in offsets(1) {
            // What lies beyond the box has neither.
            let at = low + y + z;
            let (left, here, right) = (&there[at - 1..], &there[at..], &there[at + 1..]);
            for i in 0..n {
                around[i] |= left[i] | here[i] | right[i];
            }
        }
    }
}

/// The distance of a cell from the surface.
fn found(grid: &Grid, particles: &Particles, solids: Option<&Solids>, tables: &Tables<'_>, at: [usize; 3]) -> Real {
    let middle = at.map(|i| i as Real + 0.5);
    let (mut sum, mut mean) = (0.0, [0.0; 3]);
    let scale = (1.0 / (REACH * REACH)) as Real;
    // A cell beyond a side is the image of that before it.
    let along = |a: usize, d: usize| -> (usize, Real, Real) {
        if grid.flat == Some(a) {
            return (0, 1.0, 0.0);
        }
        let n = grid.n[a];
        match (at[a] + d).checked_sub(1) {
            None => (0, -1.0, 0.0),
            Some(i) if i == n => (n - 1, -1.0, (2 * n) as Real),
            Some(i) => (i, 1.0, 0.0),
        }
    };
    let around = |a: usize| if grid.flat == Some(a) { 1..2 } else { 0..3 };
    for dz in around(2) {
        let z = along(2, dz);
        for dy in around(1) {
            let y = along(1, dy);
            for dx in around(0) {
                let x = along(0, dx);
                let number = x.0 + grid.n[0] * (y.0 + grid.n[1] * z.0);
                for p in &particles.x[particles.between(number, number + 1)] {
                    let to = [x.2 + x.1 * p[0] - middle[0], y.2 + y.1 * p[1] - middle[1], z.2 + z.1 * p[2] - middle[2]];
                    let part = 1.0 - scale * (to[0] * to[0] + to[1] * to[1] + to[2] * to[2]);
                    if part > 0.0 {
                        let k = part * part * part;
                        sum += k;
                        (0..3).for_each(|a| mean[a] += k * to[a]);
                    }
                }
            }
        }
    }
    if sum == 0.0 {
        return REACH as Real;
    }
    let mut mean = mean.map(|m| m / sum);
    let mut part = sum * tables.particle;
    if let Some(solids) = solids {
        let (distance, normal) = solids.middle_and_normal(grid.lattice().at(at[0], at[1], at[2]));
        let near = BESIDE - distance / grid.dx as Real;
        part /= 1.0 - part_at(tables.parts, distance / grid.dx as Real);
        let away = mean.iter().zip(normal).map(|(m, n)| m * n).sum::<Real>();
        if near > 0.0 && away > 0.0 {
            let less = near.min(1.0) * away;
            (0..3).for_each(|a| mean[a] -= less * normal[a]);
        }
    }
    let by_mean = read(tables.distance, mean.iter().map(|m| m * m).sum::<Real>().sqrt() / REACH as Real);
    by_mean.max(read(tables.parts, SPREAD * part)).min(read(tables.parts, part / SPREAD))
}

/// An entry of a table, at a place from 0 to 1.
fn read(table: &[Real], at: Real) -> Real {
    let s = at.clamp(0.0, 1.0) * TABLE as Real;
    let i = (s as usize).min(TABLE - 1);
    table[i] + (s - i as Real) * (table[i + 1] - table[i])
}

/// The part of the weight of a neighbourhood that lies behind a plane at this distance [cells].
fn part_at(parts: &[Real], distance: Real) -> Real {
    // parts falls.
    let i = parts.partition_point(|d| *d > distance);
    if i == 0 { 0.0 } else { (i as Real / TABLE as Real).min(0.95) }
}

/// Distances of half-spaces, by their part of the weight of a full neighbourhood.
fn parts(dimension: usize) -> Vec<Real> {
    const STEPS: usize = 4096;
    let layer = |z: f64| {
        let s = (1.0 - z * z).max(0.0);
        s * s * s * if dimension == 3 { s } else { s.sqrt() }
    };
    let width = 2.0 / STEPS as f64;
    let mut at = vec![(0.0, 1.0)];
    let mut area = 0.0;
    for step in 1..=STEPS {
        let d = 1.0 - step as f64 * width;
        area += width * (layer(d) + 4.0 * layer(d + 0.5 * width) + layer(d + width)) / 6.0;
        at.push((area, d));
    }
    let mut next = 0;
    let mut entry = |p: f64| {
        while next + 2 < at.len() && at[next + 1].0 < p * area {
            next += 1;
        }
        let ((p0, d0), (p1, d1)) = (at[next], at[next + 1]);
        d0 + ((p * area - p0) / (p1 - p0).max(1e-300)).clamp(0.0, 1.0) * (d1 - d0)
    };
    (0..=TABLE).map(|i| (REACH * entry(i as f64 / TABLE as f64)) as Real).collect()
}

/// G. With d the distance from the surface over R, the layers of a half-space weigh (1 - z²)^(m - 1), and so
///   |y|/R = (1 - d²)^m/(2 m A(d)),   A(d) = integral from d to 1 of (1 - z²)^(m - 1) dz                                     (pic.5)
/// m = 5 in space and 9/2 in a plane.
fn table(dimension: usize) -> Vec<Real> {
    const STEPS: usize = 4096;
    let layer = |z: f64| {
        let s = (1.0 - z * z).max(0.0);
        s * s * s * if dimension == 3 { s } else { s.sqrt() }
    };
    let m = if dimension == 3 { 5.0 } else { 4.5 };
    let width = 2.0 / STEPS as f64;
    // |y|/R at d from 1 down to -1, which it falls with.
    let mut at = vec![[1.0, 1.0]];
    let mut area = 0.0;
    for step in 1..=STEPS {
        let d = 1.0 - step as f64 * width;
        area += width * (layer(d) + 4.0 * layer(d + 0.5 * width) + layer(d + width)) / 6.0;
        at.push([layer(d) * (1.0 - d * d) / (2.0 * m * area), d]);
    }
    at.reverse();
    let mut next = 0;
    let mut entry = |y: f64| {
        while next + 2 < at.len() && at[next + 1][0] < y {
            next += 1;
        }
        let ([y0, d0], [y1, d1]) = (at[next], at[next + 1]);
        d0 + ((y - y0) / (y1 - y0)).clamp(0.0, 1.0) * (d1 - d0)
    };
    (0..=TABLE).map(|i| (REACH * entry(i as f64 / TABLE as f64)) as Real).collect()
}
