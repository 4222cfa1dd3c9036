//! Transfer between particles and the points of a grid, by trilinear weights, in a fixed order.
//!
//!   sum_p w_ip q_p at point i,   sum_i w_ip Q_i at particle p,   sum_i w_ip = 1
//!
//! [`Spot`]: one particle after the other among the points of a field. [`Transfer`]: many particles to a box of nodes at once; every
//! node adds up what the particles around it carry, corner by corner and within a cell in their order, so that the bits do not depend
//! on the number of threads. Verified in crates/tumble-f64/tests/sheets.rs and hair.rs.

use crate::geometry::Vector;
use crate::math::parallel::{Tasks, chunks};
use crate::math::{Lane, Real, Vec3};
use crate::state::{Grid, Place};

/// No cell.
const NONE: u32 = u32::MAX;

/// The weight of a corner of a cell, for a point so far into the cell on each axis [1].
#[inline(always)]
fn weight<L: Lane>(part: [L; 3], corner: usize) -> L {
    let one = |a: usize| if corner >> a & 1 == 1 { part[a] } else { part[a].like(1.0) - part[a] };
    one(0) * one(1) * one(2)
}

/// Position of an interpolated value.
#[derive(Clone, Copy, Default)]
pub struct Spot {
    at: u32,
    t: [Real; 3],
}

impl Spot {
    /// The spot of x [m] among the points of a place; beyond the outermost points it is on them.
    pub fn new(grid: &Grid, place: Place, x: Vector) -> Self {
        let x: [f64; 3] = x.into();
        let (offset, points) = (grid.offset(place), grid.points(place));
        let (mut base, mut t) = ([0; 3], [0.0; 3]);
        for a in grid.axes().filter(|a| points[*a] > 1) {
            let s = ((x[a] - grid.origin[a]) / grid.dx - offset[a]).clamp(0.0, (points[a] - 1) as f64);
            base[a] = (s as usize).min(points[a] - 2);
            t[a] = (s - base[a] as f64) as Real;
        }
        Self { at: grid.lattice().at(base[0], base[1], base[2]) as u32, t }
    }

    /// Calls `each(number, weight)` for the points around it; the weights add up to 1.
    #[inline(always)]
    pub fn points(&self, stride: [usize; 3], mut each: impl FnMut(usize, Real)) {
        for corner in 0..8 {
            let (weight, mut at) = (weight(self.t, corner), self.at as usize);
            for a in 0..3 {
                at += if corner >> a & 1 == 1 { stride[a] } else { 0 };
            }
            if weight != 0.0 {
                each(at, weight);
            }
        }
    }

    /// The value there.
    pub fn read(&self, stride: [usize; 3], data: &[Real]) -> Real {
        let mut sum = 0.0;
        self.points(stride, |at, weight| sum += weight * data[at]);
        sum
    }
}

/// A box of nodes, x fastest; at least two along each axis.
#[derive(Debug, Clone, Copy)]
pub struct Nodes {
    /// The lowest node [m].
    pub low: [f64; 3],
    /// Spacing [m].
    pub cell: f64,
    /// Number of nodes along each axis.
    pub n: [usize; 3],
}

impl Nodes {
    /// The lowest node of the cell of a point, and how far into the cell it is on each axis.
    fn place(&self, x: Vec3<f64>) -> ([usize; 3], [f64; 3]) {
        let (mut at, mut part) = ([0; 3], [0.0; 3]);
        let x: [f64; 3] = x.into();
        for a in 0..3 {
            let s = ((x[a] - self.low[a]) / self.cell).clamp(0.0, (self.n[a] - 2) as f64);
            at[a] = (s as usize).min(self.n[a] - 2);
            part[a] = s - at[a] as f64;
        }
        (at, part)
    }

    /// The number of a node.
    pub fn node(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * self.n[1] + j) * self.n[0] + i
    }

    /// Calls `each(node, weight)` for the eight nodes around a point [m]; the weights add up to 1.
    #[inline(always)]
    pub fn around(&self, x: Vec3<f64>, mut each: impl FnMut(usize, f64)) {
        let (at, part) = self.place(x);
        for corner in 0..8 {
            let node = self.node([at[0] + (corner & 1), at[1] + (corner >> 1 & 1), at[2] + (corner >> 2)]);
            each(node, weight(part, corner));
        }
    }
}

/// Particles sorted by cell, each with N numbers that it carries.
#[derive(Debug, Clone, Default)]
pub struct Transfer<const N: usize> {
    /// The cell of every particle, and where the particles of a cell end.
    cells: Vec<u32>,
    starts: Vec<u32>,
    /// Particles cell by cell: how far into the cell it is, and what it carries.
    order: Vec<([f64; 3], [f64; N])>,
}

impl<const N: usize> Transfer<N> {
    /// Sets every node to the weighted sum of what the particles 0..count carry; those without a position [m] take no part.
    pub fn to_nodes(
        &mut self,
        nodes: &Nodes,
        count: usize,
        position: impl Fn(usize) -> Option<Vec3<f64>> + Sync,
        carried: impl Fn(usize) -> [f64; N],
        sums: &mut Vec<[f64; N]>,
    ) {
        let Self { cells, starts, order } = self;
        // Particles sorted by cell, within a cell in their order.
        cells.resize(count, 0);
        chunks(cells, |start, cells| {
            for (i, cell) in cells.iter_mut().enumerate() {
                *cell = position(start + i).map_or(NONE, |x| nodes.node(nodes.place(x).0) as u32);
            }
        });
        let n = nodes.n;
        let total = n[0] * n[1] * n[2];
        starts.clear();
        starts.resize(total + 1, 0);
        cells.iter().filter(|c| **c != NONE).for_each(|c| starts[*c as usize + 1] += 1);
        for c in 0..total {
            starts[c + 1] += starts[c];
        }
        order.resize(count, ([0.0; 3], [0.0; N]));
        for (i, c) in cells.iter().enumerate() {
            let Some(x) = position(i) else { continue };
            order[starts[*c as usize] as usize] = (nodes.place(x).1, carried(i));
            starts[*c as usize] += 1;
        }
        // `starts` are ends now: a cell begins where the one before ends.
        sums.resize(total, [0.0; N]);
        let (starts, order) = (&*starts, &*order);
        sums.chunks_mut(n[0] * n[1]).enumerate().in_parallel(|(k, slab)| {
            for (s, node) in slab.iter_mut().enumerate() {
                let (i, j) = (s % n[0], s / n[0]);
                let mut sum = [0.0; N];
                for corner in 0..8 {
                    // The node is that corner of the cell.
                    let [di, dj, dk] = [corner & 1, corner >> 1 & 1, corner >> 2];
                    if di > i || dj > j || dk > k {
                        continue;
                    }
                    let c = nodes.node([i - di, j - dj, k - dk]);
                    let begin = if c == 0 { 0 } else { starts[c - 1] };
                    for (part, carried) in &order[begin as usize..starts[c] as usize] {
                        let w = weight(*part, corner);
                        for a in 0..N {
                            sum[a] += w * carried[a];
                        }
                    }
                }
                *node = sum;
            }
        });
    }
}
