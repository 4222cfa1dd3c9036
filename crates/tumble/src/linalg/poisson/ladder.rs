//! The lower rungs: every cell is set from its neighbours, all at once, or one colour of a chequerboard after the other.
//!
//! Jacobi's method has weight 6/7, because weight 1 keeps the chequerboard of a closed box for ever; the successive ones go through
//! red cells (i + j + k even), then black ones, so that their result depends on no order.                  (pressure.6)
//!
//! Source: [young1971] for the factor of successive over-relaxation.

use super::block::{Block, LANES};
use super::faces::Weight;
use super::level::{Finish, Grid, Norm, Pass, Relax, Residual, Rows, Tile, run, sweep};
use super::report::{Fault, Info, Method, Params};
use super::{Side, Solver};
use crate::math::Real;
use crate::math::functions::cos;
use crate::math::simd::Width;
use std::f64::consts::PI;

/// Jacobi's weight.
pub(super) const JACOBI: f64 = 6.0 / 7.0;

/// The over-relaxation that is best where mu is the largest cosine of the box:
///   omega = 2/(1 + sqrt(1 - mu²)),   mu = 1 - sum over axes of (1 - cos theta)/axes                     (pressure.5)
/// with theta = pi/n between two walls or two open sides, pi/2n between one of each, 2 pi/n where joined. Only axes with an open
/// side count in the sum, all at once; without one it is that of the longest axis.
pub(super) fn omega(n: [usize; 3], sides: [[Side; 2]; 3]) -> f64 {
    let open = sides.map(|sides| sides.iter().filter(|s| **s == Side::Open).count());
    let axes: Vec<usize> = (0..3).filter(|a| n[*a] > 1 || open[*a] > 0).collect();
    let below_one = |a: usize| {
        let theta = match (sides[a][0], open[a]) {
            (Side::Periodic, _) => 2.0 * PI,
            (_, 1) => PI / 2.0,
            _ => PI,
        };
        1.0 - cos(theta / n[a] as f64)
    };
    let held: f64 = axes.iter().filter(|a| open[**a] > 0).map(|a| below_one(*a)).sum();
    let floating = axes.iter().map(|a| below_one(*a)).fold(2.0, f64::min);
    let mu = 1.0 - if held > 0.0 { held } else { floating } / axes.len().max(1) as f64;
    2.0 / (1.0 + (1.0 - (mu * mu).min(1.0)).sqrt())
}

/// Solves for x from 0 by one of them.
pub(super) fn relax<T: Weight>(solver: &mut Solver<T>, x: &mut [Real], params: &Params) -> Result<Info, Fault> {
    let n = solver.fine.lattice.n;
    if params.method != Method::Jacobi
        && let Some(axis) = (0..3).find(|a| solver.fine.periodic[*a] && n[*a] % 2 == 1)
    {
        let because =
            format!("a chequerboard needs an even number of cells along the periodic axis {}, not {}", ["x", "y", "z"][axis], n[axis]);
        return Err(Fault::Method { method: params.method, because });
    }
    let weight = match params.method {
        Method::Jacobi => JACOBI,
        Method::Sor => omega(n, solver.sides),
        _ => 1.0,
    } as Real;
    let mut other = std::mem::take(&mut solver.p);
    let (grid, registers) = (&solver.fine, solver.registers);
    let mut info = Info::by(solver.clock);
    let mut start = 0.0;
    loop {
        let half = |x: &[Real], out: &mut [Real], colour: Option<usize>, norms: bool| {
            run(n, registers, &Half { grid, x, out: Rows::of(out), weight, colour, norms })
        };
        // The residual after a sweep is known when the next one starts.
        let colours = params.method != Method::Jacobi;
        let [rr, _, _, most] = half(x, &mut other, colours.then_some(0), true);
        if start == 0.0 {
            start = rr;
            info.begin(start, most, params.target);
        } else {
            info.add(rr, start, most, params.target);
        }
        if info.converged || info.iterations >= params.iterations || !rr.is_finite() {
            break;
        }
        if colours {
            half(&other, x, Some(1), false);
        } else {
            x.copy_from_slice(&other);
        }
    }
    solver.p = other;
    Ok(info)
}

/// out = x, relaxed in all cells or in those of a colour; returns r.r of x and the largest magnitude of r.
struct Half<'a, T> {
    grid: &'a Grid<T>,
    x: &'a [Real],
    out: Rows<'a>,
    weight: Real,
    colour: Option<usize>,
    norms: bool,
}

/// x + weight (b - A x)/A_ii where the pattern is 1.
struct Coloured(Real, Block);

impl Finish for Coloured {
    #[inline(always)]
    fn at<W: Width>(&self, w: W, lane: usize, product: W::L, inverse: W::L, v: W::L, b: W::L) -> W::L {
        v + w.load(&self.1[lane..]) * (w.splat(self.0) * inverse * (b - product))
    }
}

impl<T: Weight> Pass for Half<'_, T> {
    fn scratch(&self) -> usize {
        2 * (self.grid.width + 2)
    }

    #[inline(always)]
    fn tile<W: Width>(&self, w: W, tile: Tile, scratch: &mut [Real]) -> [f64; 4] {
        let (grid, width) = (self.grid, self.grid.width);
        let (own, rest) = scratch.split_at_mut(width + 2);
        let left = &mut rest[..width];
        let mut norm = Norm::default();
        for k in tile.k[0]..tile.k[1] {
            for j in tile.rows(grid, 0) {
                let at = grid.start(j, k);
                let (faces, near, b) = (grid.faces(at), grid.near(self.x, j, k, own), grid.row(&grid.b, at));
                if self.norms {
                    sweep(w, &faces, &near, b, left, Residual);
                    grid.end(left);
                    norm.add(w, left);
                }
                // SAFETY: a row of this tile.
                let out = unsafe { self.out.take(at, width) };
                match self.colour {
                    None => sweep(w, &faces, &near, b, out, Relax(self.weight)),
                    Some(colour) => {
                        let mut pattern = [0.0; LANES];
                        for i in 0..LANES {
                            pattern[i] = ((i + j as usize + k as usize + colour + 1) % 2) as Real;
                        }
                        sweep(w, &faces, &near, b, out, Coloured(self.weight, pattern));
                    }
                }
                grid.end(out);
            }
        }
        norm.sums()
    }
}
