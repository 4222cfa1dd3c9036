//! One pass over the cells of a body: what comes in through the six faces of each.
//!
//! ```text
//!   net_i = sum over faces of w_f (T_other - T_i)                   [K]
//!   out_i = net_i,   or   T_i + z m_i net_i                         (heat.2), (heat.3)
//! ```
//!
//! Walls have weight zero. A face's two cells see opposite differences, so that nothing is lost between them.

use crate::math::parallel::Tasks;
use crate::math::simd::{Kernel, Width, dispatch};
use crate::math::{Lattice, Real};

/// The materials of a body of several.
#[derive(Debug, Clone)]
pub struct Cells {
    /// Weights of the lower faces, conductivity over that of the body; upper sides are faces n.
    pub w: [Vec<Real>; 3],
    /// Capacity of the body's material over that of the cell; 0 in holes.
    pub m: Vec<Real>,
}

/// Operation on the cells of a body.
#[derive(Clone, Copy)]
pub struct Pass<'a> {
    /// How they lie.
    pub lattice: Lattice,
    /// Axes without walls.
    pub periodic: [bool; 3],
    /// Materials; without them all weights are 1.
    pub cells: Option<&'a Cells>,
    /// The temperatures.
    pub t: &'a [Real],
    /// kappa h/dx²; without it the pass gives the net sums alone.
    pub z: Option<Real>,
}

/// Rows of a task.
const ROWS: usize = 32;

impl Pass<'_> {
    /// Writes all cells of `out`.
    pub fn run(&self, out: &mut [Real]) {
        let (l, first) = (self.lattice, self.lattice.at(0, 0, 0));
        let (row, lines) = (l.stride[1], l.n[1] + 2);
        let body = |task: usize, chunk: &mut [Real]| {
            for (r, out) in chunk.chunks_mut(row).enumerate() {
                let (k, j) = ((task * ROWS + r) / lines, (task * ROWS + r) % lines);
                if j < l.n[1] && k < l.n[2] {
                    dispatch(Line { pass: self, j, k, out: &mut out[..l.n[0]] });
                }
            }
        };
        let all = &mut out[first..first + l.stride[2] * (l.n[2] - 1) + row * l.n[1]];
        if all.len() <= 2 * ROWS * row {
            all.chunks_mut(ROWS * row).enumerate().for_each(|(task, chunk)| body(task, chunk));
        } else {
            all.chunks_mut(ROWS * row).enumerate().in_parallel(|(task, chunk)| body(task, chunk));
        }
    }

    /// Start of the row before or after row (j, k) along an axis; beyond a wall it is the row itself.
    #[inline(always)]
    fn beside(&self, j: usize, k: usize, axis: usize, up: bool) -> usize {
        let mut at = [0, j, k];
        let n = self.lattice.n[axis];
        let inside = if up { at[axis] + 1 < n } else { at[axis] > 0 };
        if inside {
            at[axis] = if up { at[axis] + 1 } else { at[axis] - 1 };
        } else if self.periodic[axis] {
            at[axis] = if up { 0 } else { n - 1 };
        }
        self.lattice.at(0, at[1], at[2])
    }
}

struct Line<'a> {
    pass: &'a Pass<'a>,
    j: usize,
    k: usize,
    out: &'a mut [Real],
}

/// The rows that a row needs, all of its length; `c` has a number more on both sides.
struct Near<'a> {
    c: &'a [Real],
    y: [&'a [Real]; 2],
    z: [&'a [Real]; 2],
}

#[inline(always)]
fn same<const KEEP: bool>(out: &mut [Real], near: &Near, z: Real) {
    let n = out.len();
    let (a, c, b) = (&near.c[..n], &near.c[1..n + 1], &near.c[2..n + 2]);
    let ([ya, yb], [za, zb]) = ([&near.y[0][..n], &near.y[1][..n]], [&near.z[0][..n], &near.z[1][..n]]);
    for i in 0..n {
        let x = (b[i] - c[i]) - (c[i] - a[i]);
        let y = (yb[i] - c[i]) - (c[i] - ya[i]);
        let net = x + y + ((zb[i] - c[i]) - (c[i] - za[i]));
        out[i] = if KEEP { c[i] + z * net } else { net };
    }
}

#[inline(always)]
fn mixed<const KEEP: bool>(out: &mut [Real], near: &Near, w: [[&[Real]; 2]; 3], m: &[Real], z: Real) {
    let n = out.len();
    let (a, c, b) = (&near.c[..n], &near.c[1..n + 1], &near.c[2..n + 2]);
    let ([ya, yb], [za, zb]) = ([&near.y[0][..n], &near.y[1][..n]], [&near.z[0][..n], &near.z[1][..n]]);
    let [[xl, xh], [yl, yh], [zl, zh]] = w;
    let (xl, xh, yl, yh, zl, zh, m) = (&xl[..n], &xh[..n], &yl[..n], &yh[..n], &zl[..n], &zh[..n], &m[..n]);
    for i in 0..n {
        let x = xh[i] * (b[i] - c[i]) - xl[i] * (c[i] - a[i]);
        let y = yh[i] * (yb[i] - c[i]) - yl[i] * (c[i] - ya[i]);
        let net = x + y + (zh[i] * (zb[i] - c[i]) - zl[i] * (c[i] - za[i]));
        out[i] = if KEEP { c[i] + z * m[i] * net } else { net };
    }
}

impl Line<'_> {
    /// Cells from..to of the row.
    #[inline(always)]
    fn part(&mut self, from: usize, to: usize, ends: Option<&[Real; 3]>) {
        let Self { pass, j, k, .. } = *self;
        let l = pass.lattice;
        let at = l.at(from, j, k);
        let beside = |axis: usize, up: bool| &pass.t[pass.beside(j, k, axis, up) + from..];
        let c = match ends {
            Some(ends) => &ends[..],
            None => &pass.t[at - 1..at + to - from + 1],
        };
        let near = Near { c, y: [beside(1, false), beside(1, true)], z: [beside(2, false), beside(2, true)] };
        let out = &mut self.out[from..to];
        match (pass.cells, pass.z) {
            (None, Some(z)) => same::<true>(out, &near, z),
            (None, None) => same::<false>(out, &near, 0.0),
            (Some(cells), z) => {
                let of = |axis: usize| [&cells.w[axis][at..], &cells.w[axis][at + l.stride[axis]..]];
                let w = [of(0), of(1), of(2)];
                match z {
                    Some(z) => mixed::<true>(out, &near, w, &cells.m[at..], z),
                    None => mixed::<false>(out, &near, w, &cells.m[at..], 0.0),
                }
            }
        }
    }
}

impl Kernel for Line<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(mut self, _: W) {
        let (n, at) = (self.pass.lattice.n[0], self.pass.lattice.at(0, self.j, self.k));
        let t = self.pass.t;
        let joined = self.pass.periodic[0];
        if n > 2 {
            self.part(1, n - 1, None);
        }
        for i in [0, n - 1] {
            let here = t[at + i];
            let low = if i > 0 {
                t[at + i - 1]
            } else if joined {
                t[at + n - 1]
            } else {
                here
            };
            let high = if i + 1 < n {
                t[at + i + 1]
            } else if joined {
                t[at]
            } else {
                here
            };
            self.part(i, i + 1, Some(&[low, here, high]));
        }
    }
}
