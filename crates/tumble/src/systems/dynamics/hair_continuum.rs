//! Hair as a continuum: mass and momentum on a grid, friction towards its velocity, pressure where it is too dense.
//!
//!   M_i = sum_p m_p w_ip,   V_i = sum_p m_p w_ip v_p/M_i,   v_p += (1 - exp(-friction h)) (sum_i w_ip V_i - v_p)     (hair.5)
//!
//! w is trilinear. Pressure goes through the faces between nodes, the lesser of both: one node gains its neighbour's loss, and momentum
//! is kept to round-off (hair.6). Held points take no part. Sources: [petrovic2005], [mcadams2009]. Differs: no projection to zero divergence, hair
//! may thin out. Breaks: h sqrt(pressure/rest density) above a cell. Verified in `tests/hair.rs`.

use super::core::Core;
use super::feature::{Feature, Span};
use crate::math::functions::exp;
use crate::math::parallel::{Tasks, chunks, fold};
use crate::math::{Real, Row, Vec3, xyz64};
use std::ops::Range;
use tumble_interface::scene::HairCollisions;

/// Nodes at most; a larger box gets larger cells.
const NODES: f64 = (1 << 21) as f64;

/// The hair of one object.
#[derive(Debug, Clone)]
pub struct HairContinuum {
    rows: Range<usize>,
    words: HairCollisions,
    /// Density above which it pushes [kg/m³].
    rest: f64,
    scratch: Scratch,
}

#[derive(Debug, Clone, Default)]
struct Scratch {
    /// The cell of every free point, where the points of a cell end, and the points cell by cell.
    cells: Vec<u32>,
    starts: Vec<u32>,
    /// Of each, how far into the cell it is; momentum and mass [kg m/s, kg].
    order: Vec<([f64; 3], [f64; 4])>,
    /// Momentum, then mass [kg m/s, kg]; then velocity, and density over rest density.
    nodes: Vec<[f64; 4]>,
    /// Velocities that pressure gives [m/s].
    kicks: Vec<[f64; 3]>,
}

/// A box of nodes.
#[derive(Debug, Clone, Copy)]
struct Lattice {
    low: [f64; 3],
    cell: f64,
    n: [usize; 3],
}

impl Lattice {
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

    fn node(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * self.n[1] + j) * self.n[0] + i
    }

    fn weight(part: [f64; 3], corner: usize) -> f64 {
        let one = |a: usize| if corner >> a & 1 == 1 { part[a] } else { 1.0 - part[a] };
        one(0) * one(1) * one(2)
    }
}

impl HairContinuum {
    /// The hair in these rows, as it is at the start.
    pub fn new(rows: Range<usize>, words: HairCollisions, x: &[Row]) -> Self {
        let mut continuum = Self { rows, rest: words.rest_density.unwrap_or(1.0), words, scratch: Scratch::default() };
        if continuum.words.rest_density.is_none()
            && let Some(lattice) = continuum.splat(x, &vec![[0.0; 4]; x.len()])
        {
            // The mean over the mass.
            let volume = lattice.cell.powi(3);
            let (mass, square) = continuum.scratch.nodes.iter().fold((0.0, 0.0), |(a, b), n| (a + n[3], b + n[3] * n[3]));
            continuum.rest = (square / mass / volume).max(f64::MIN_POSITIVE);
        }
        continuum
    }

    fn is_idle(&self) -> bool {
        self.words.friction == 0.0 && self.words.pressure == 0.0
    }

    /// Mass and momentum on nodes; `None` if nothing is free.
    fn splat(&mut self, x: &[Row], v: &[Row]) -> Option<Lattice> {
        let (x, v) = (&x[self.rows.clone()], &v[self.rows.clone()]);
        let least = |a: [f64; 3], b: [f64; 3]| [a[0].min(b[0]), a[1].min(b[1]), a[2].min(b[2])];
        // The lowest corner, and the highest with its sign turned.
        let corner = |i: usize| -> [[f64; 3]; 2] { [xyz64(x[i]).into(), (-xyz64(x[i])).into()] };
        let both = |a: [[f64; 3]; 2], b: [[f64; 3]; 2]| [least(a[0], b[0]), least(a[1], b[1])];
        let boxes = fold(x.len(), |range| range.filter(|i| x[*i][3] > 0.0).map(corner).reduce(both));
        let [low, high] = boxes.into_iter().flatten().reduce(both)?;
        let size: [f64; 3] = std::array::from_fn(|a| -high[a] - low[a]);
        if !size.iter().all(|s| s.is_finite()) {
            return None;
        }
        let mut cell = self.words.cell;
        let count = |cell: f64| size.iter().map(|s| (s / cell).floor() + 3.0).product::<f64>();
        while count(cell) > NODES {
            cell *= 1.25;
        }
        // Nodes stand at multiples of the spacing, wherever the hair is.
        let low = low.map(|x| (x / cell).floor() * cell);
        let n = std::array::from_fn(|a| ((-high[a] - low[a]) / cell) as usize + 2);
        let lattice = Lattice { low, cell, n };
        let Scratch { cells, starts, order, nodes, .. } = &mut self.scratch;
        // Points sorted by cell, within a cell in their order.
        cells.resize(x.len(), 0);
        chunks(cells, |start, cells| {
            for (cell, x) in cells.iter_mut().zip(&x[start..]) {
                *cell = if x[3] > 0.0 { lattice.node(lattice.place(xyz64(*x)).0) as u32 } else { u32::MAX };
            }
        });
        let total = n[0] * n[1] * n[2];
        starts.clear();
        starts.resize(total + 1, 0);
        cells.iter().filter(|c| **c != u32::MAX).for_each(|c| starts[*c as usize + 1] += 1);
        for c in 0..total {
            starts[c + 1] += starts[c];
        }
        order.resize(x.len(), ([0.0; 3], [0.0; 4]));
        for (i, c) in cells.iter().enumerate().filter(|(_, c)| **c != u32::MAX) {
            let m = 1.0 / f64::from(x[i][3]);
            let [u, v, w] = [0, 1, 2].map(|a| m * f64::from(v[i][a]));
            order[starts[*c as usize] as usize] = (lattice.place(xyz64(x[i])).1, [u, v, w, m]);
            starts[*c as usize] += 1;
        }
        // `starts` are ends now: a cell begins where the one before ends.
        nodes.resize(total, [0.0; 4]);
        let (starts, order) = (&*starts, &*order);
        nodes.chunks_mut(n[0] * n[1]).enumerate().in_parallel(|(k, slab)| {
            for (s, node) in slab.iter_mut().enumerate() {
                let (i, j) = (s % n[0], s / n[0]);
                let mut sum = [0.0; 4];
                for corner in 0..8 {
                    // The node is that corner of the cell.
                    let [di, dj, dk] = [corner & 1, corner >> 1 & 1, corner >> 2];
                    if di > i || dj > j || dk > k {
                        continue;
                    }
                    let c = lattice.node([i - di, j - dj, k - dk]);
                    let begin = if c == 0 { 0 } else { starts[c - 1] };
                    for (part, carried) in &order[begin as usize..starts[c] as usize] {
                        let w = Lattice::weight(*part, corner);
                        for a in 0..4 {
                            sum[a] += w * carried[a];
                        }
                    }
                }
                *node = sum;
            }
        });
        Some(lattice)
    }

    /// Friction and pressure of the hair in a step of length h [s].
    fn act(&mut self, h: f64, x: &[Row], v: &mut [Row]) {
        if self.is_idle() {
            return;
        }
        let Some(lattice) = self.splat(x, v) else { return };
        let (Lattice { cell, n, .. }, words, rest) = (lattice, &self.words, self.rest);
        let Scratch { nodes, kicks, .. } = &mut self.scratch;
        kicks.resize(nodes.len(), [0.0; 3]);
        let full = rest * cell.powi(3);
        let squeezed = |node: usize| words.pressure * (nodes[node][3] / full - 1.0).max(0.0);
        let strides = [1, n[0], n[0] * n[1]];
        kicks.chunks_mut(n[0] * n[1]).enumerate().in_parallel(|(k, slab)| {
            for (s, kick) in slab.iter_mut().enumerate() {
                let at = [s % n[0], s / n[0], k];
                let node = lattice.node(at);
                let own = squeezed(node);
                *kick = [0.0; 3];
                if own == 0.0 {
                    continue;
                }
                for a in 0..3 {
                    let before = if at[a] > 0 { own.min(squeezed(node - strides[a])) } else { 0.0 };
                    let behind = if at[a] + 1 < n[a] { own.min(squeezed(node + strides[a])) } else { 0.0 };
                    kick[a] = h * cell * cell * (before - behind) / nodes[node][3];
                }
            }
        });
        let share = 1.0 - exp(-words.friction * h);
        let (nodes, kicks) = (&*nodes, &*kicks);
        let stir = |v: &mut Row, x: &Row| {
            if x[3] == 0.0 {
                return;
            }
            let (at, part) = lattice.place(xyz64(*x));
            let (mut around, mut kick) = ([0.0; 3], [0.0; 3]);
            for corner in 0..8 {
                let w = Lattice::weight(part, corner);
                let node = lattice.node([at[0] + (corner & 1), at[1] + (corner >> 1 & 1), at[2] + (corner >> 2)]);
                let mass = nodes[node][3];
                if mass > 0.0 {
                    for a in 0..3 {
                        around[a] += w * (nodes[node][a] / mass);
                        kick[a] += w * kicks[node][a];
                    }
                }
            }
            for a in 0..3 {
                let own = f64::from(v[a]);
                v[a] = (own + share * (around[a] - own) + kick[a]) as Real;
            }
        };
        let x = &x[self.rows.clone()];
        chunks(&mut v[self.rows.clone()], |start, v| v.iter_mut().zip(&x[start..]).for_each(|(v, x)| stir(v, x)));
    }
}

impl Feature for HairContinuum {
    fn before(&mut self, core: &mut Core, step: Span) {
        self.act(step.h, &core.state.x, &mut core.state.v);
        core.memory.ready = false;
    }
}
