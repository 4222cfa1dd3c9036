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
use crate::math::{Real, Row, xyz64};
use crate::operators::{Nodes, Transfer};
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
    /// Momentum and mass of the free points, cell by cell [kg m/s, kg].
    transfer: Transfer<4>,
    /// Momentum, then mass [kg m/s, kg].
    nodes: Vec<[f64; 4]>,
    /// Velocities that pressure gives [m/s].
    kicks: Vec<[f64; 3]>,
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
    fn splat(&mut self, x: &[Row], v: &[Row]) -> Option<Nodes> {
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
        let lattice = Nodes { low, cell, n };
        let Scratch { transfer, nodes, .. } = &mut self.scratch;
        let position = |i: usize| (x[i][3] > 0.0).then(|| xyz64(x[i]));
        let carried = |i: usize| {
            let m = 1.0 / f64::from(x[i][3]);
            let [u, v, w] = [0, 1, 2].map(|a| m * f64::from(v[i][a]));
            [u, v, w, m]
        };
        transfer.to_nodes(&lattice, x.len(), position, carried, nodes);
        Some(lattice)
    }

    /// Friction and pressure of the hair in a step of length h [s].
    fn act(&mut self, h: f64, x: &[Row], v: &mut [Row]) {
        if self.is_idle() {
            return;
        }
        let Some(lattice) = self.splat(x, v) else { return };
        let (Nodes { cell, n, .. }, words, rest) = (lattice, &self.words, self.rest);
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
            let (mut around, mut kick) = ([0.0; 3], [0.0; 3]);
            lattice.around(xyz64(*x), |node, w| {
                let mass = nodes[node][3];
                if mass > 0.0 {
                    for a in 0..3 {
                        around[a] += w * (nodes[node][a] / mass);
                        kick[a] += w * kicks[node][a];
                    }
                }
            });
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
