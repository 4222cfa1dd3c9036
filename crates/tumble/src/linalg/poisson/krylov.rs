//! Conjugate gradients with any symmetric, positive preconditioner, in two passes over memory and a dozen lines.
//!
//! Source: [shewchuk1994], B3.                                                                            (pressure.10)

use super::Solver;
use super::faces::Weight;
use super::level::{Grid, Norm, Pass, Product, Ring, Rows, Tile, add, dot, run, sweep};
use super::multigrid;
use super::report::{Info, Params};
use crate::math::Real;
use crate::math::simd::{Level as Registers, Width, ask};

/// The preconditioner.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Before {
    /// The residual itself.
    Nothing,
    /// Incomplete factors, once they are made.
    Incomplete,
    /// One cycle.
    Multigrid,
}

/// Solves for x, from 0; the right-hand side is in the fine grid's b, free of what no pressure can balance.
pub(super) fn solve<T: Weight>(solver: &mut Solver<T>, before: Before, x: &mut [Real], params: &Params) -> Info {
    let n = solver.fine.lattice.n;
    let registers = solver.registers;
    let mut p = std::mem::take(&mut solver.p);
    let mut info = Info::by(solver.clock);
    let [start, most] = solver.norms();
    let mut old = f64::INFINITY;
    info.begin(start, most, params.target);
    while !info.converged && info.iterations < params.iterations {
        let [rz, mean] = solver.precondition(before);
        let mean = mean as Real;
        let beta = (rz / old) as Real;
        old = rz;
        let mut q = std::mem::take(&mut solver.fine.x);
        let grid = &solver.fine;
        let z = if before == Before::Nothing { &grid.b } else { &grid.y };
        // Not 0 p: an earlier solve may have left anything there.
        let before = if info.iterations == 0 { z } else { &p };
        // A cycle leaves nothing of use in x.
        let [curvature, ..] = run(n, registers, &Direction { grid, z, mean, p: before, beta, q: Rows::of(&mut q) });
        solver.fine.x = std::mem::replace(&mut p, q);
        let curvature = curvature + solver.joined_curvature(&p);
        if !(rz > 0.0 && curvature > 0.0) {
            break;
        }
        let [rr, _, _, most] = step(solver, (rz / curvature) as Real, &p, x);
        info.add(rr, start, most, params.target);
        if !rr.is_finite() {
            break;
        }
    }
    solver.p = p;
    info
}

/// Repeated cycles: each is a step of steepest descent, whose length makes it converge with any preconditioner.
///                                                                                                      (pressure.11)
pub(super) fn cycles<T: Weight>(solver: &mut Solver<T>, x: &mut [Real], params: &Params) -> Info {
    let n = solver.fine.lattice.n;
    let registers = solver.registers;
    let mut q = std::mem::take(&mut solver.p);
    let mut info = Info::by(solver.clock);
    let [start, most] = solver.norms();
    info.begin(start, most, params.target);
    while !info.converged && info.iterations < params.iterations {
        let [rz, mean] = solver.precondition(Before::Multigrid);
        let mean = mean as Real;
        let grid = &solver.fine;
        let [curvature, ..] = run(n, registers, &Direction { grid, z: &grid.y, mean, p: &grid.y, beta: 0.0, q: Rows::of(&mut q) });
        if !(rz > 0.0 && curvature > 0.0) {
            break;
        }
        let [rr, _, _, most] = step(solver, (rz / curvature) as Real, &q, x);
        info.add(rr, start, most, params.target);
    }
    solver.p = q;
    info
}

/// One solution by a direct method, which replaces a right-hand side by it; what is left is evaluated.
pub(super) fn direct<T: Weight>(
    solver: &mut Solver<T>,
    x: &mut [Real],
    params: &Params,
    solve: impl FnOnce(&Grid<T>, &mut [Real], Registers),
) -> Info {
    let mut info = Info::by(solver.clock);
    let [start, most] = solver.norms();
    info.begin(start, most, params.target);
    if !info.converged {
        let mut q = std::mem::take(&mut solver.p);
        q.copy_from_slice(&solver.fine.b);
        solve(&solver.fine, &mut q, solver.registers);
        let [rr, _, _, most] = step(solver, 1.0, &q, x);
        info.add(rr, start, most, params.target);
        solver.p = q;
    }
    info
}

/// x += a p, b -= a A p; returns b.b and its largest magnitude.
fn step<T: Weight>(solver: &mut Solver<T>, a: Real, p: &[Real], x: &mut [Real]) -> [f64; 4] {
    solver.joined_step(a, p);
    let mut r = std::mem::take(&mut solver.fine.b);
    let grid = &solver.fine;
    let sums = run(grid.lattice.n, solver.registers, &Step { grid, a, p, x: Rows::of(x), r: Rows::of(&mut r) });
    solver.fine.b = r;
    sums
}

impl<T: Weight> Solver<T> {
    /// The squared norm of the right-hand side and its largest magnitude.
    pub(super) fn norms(&mut self) -> [f64; 2] {
        let grid = &self.fine;
        let [bb, _, _, most] = run(grid.lattice.n, self.registers, &Norms { grid });
        [bb, most]
    }

    /// z from r, in the fine grid's y; returns r.z without the means of floating components, and the mean that is to be taken from
    /// every cell of z.
    pub(super) fn precondition(&mut self, before: Before) -> [f64; 2] {
        let sums = match before {
            Before::Nothing => return [self.norms()[0], 0.0],
            Before::Incomplete => self.incomplete.as_ref().map_or([0.0; 3], |factors| factors.solve(&mut self.fine)),
            Before::Multigrid => multigrid::cycle(&mut self.fine, &mut self.coarse, &self.coarsest, self.registers),
        };
        self.pockets.centre(&mut self.fine.y, &self.fine.b, sums)
    }
}

/// q = (z - mean) + beta p, and q.Aq.
struct Direction<'a, T> {
    grid: &'a Grid<T>,
    z: &'a [Real],
    mean: Real,
    p: &'a [Real],
    beta: Real,
    q: Rows<'a>,
}

impl<T: Weight> Pass for Direction<'_, T> {
    fn scratch(&self) -> usize {
        Ring::numbers(self.grid) + self.grid.width
    }

    #[inline(always)]
    fn tile<W: Width>(&self, w: W, tile: Tile, scratch: &mut [Real]) -> [f64; 4] {
        let (grid, width) = (self.grid, self.grid.width);
        let (mut ring, rest) = Ring::new(grid, tile, scratch);
        let product = &mut rest[..width];
        let mut curvature = 0.0;
        for k in tile.k[0] - 1..tile.k[1] + 1 {
            if tile.has(grid, k) {
                for (j, ahead) in tile.rows_ahead(grid, 1, k) {
                    ask(grid.row(self.z, ahead));
                    ask(grid.row(self.p, ahead));
                    let at = grid.start(j, k);
                    let row = ring.padded(j, k);
                    self.combine(w, at, &mut row[1..=width]);
                    grid.close(row);
                }
            }
            let k = k - 1;
            if k < tile.k[0] {
                continue;
            }
            for (j, ahead) in tile.rows_ahead(grid, 0, k) {
                self.q.ask(ahead, width);
                let at = grid.start(j, k);
                let near = ring.near(grid, j, k);
                sweep(w, &grid.faces(at), &near, near.own(), product, Product);
                grid.end(product);
                curvature += dot(w, near.own(), product);
                // SAFETY: a row of this tile.
                unsafe { self.q.take(at, width) }.copy_from_slice(near.own());
            }
        }
        [curvature, 0.0, 0.0, 0.0]
    }
}

impl<T: Weight> Direction<'_, T> {
    #[inline(always)]
    fn combine<W: Width>(&self, w: W, at: usize, out: &mut [Real]) {
        use super::block::{LANES, blocks};
        let (out, z, p) = (out.as_chunks_mut::<LANES>().0, blocks(self.grid.row(self.z, at)), blocks(self.grid.row(self.p, at)));
        let (z, p) = (&z[..out.len()], &p[..out.len()]);
        let (mean, beta) = (w.splat(self.mean), w.splat(self.beta));
        for e in 0..out.len() {
            for part in 0..LANES / W::N {
                let i = part * W::N;
                w.store((w.load(&z[e][i..]) - mean) + beta * w.load(&p[e][i..]), &mut out[e][i..]);
            }
        }
    }
}

/// x += a p, r -= a A p; returns r.r and the largest magnitude of r.
struct Step<'a, T> {
    grid: &'a Grid<T>,
    a: Real,
    p: &'a [Real],
    x: Rows<'a>,
    r: Rows<'a>,
}

impl<T: Weight> Pass for Step<'_, T> {
    fn scratch(&self) -> usize {
        2 * (self.grid.width + 2)
    }

    #[inline(always)]
    fn tile<W: Width>(&self, w: W, tile: Tile, scratch: &mut [Real]) -> [f64; 4] {
        let (grid, width) = (self.grid, self.grid.width);
        let (own, rest) = scratch.split_at_mut(width + 2);
        let product = &mut rest[..width];
        let mut norm = Norm::default();
        for k in tile.k[0]..tile.k[1] {
            for (j, ahead) in tile.rows_ahead(grid, 0, k) {
                ask(grid.row(self.p, ahead + grid.lattice.stride[2]));
                self.x.ask(ahead, width);
                self.r.ask(ahead, width);
                let at = grid.start(j, k);
                let near = grid.near(self.p, j, k, own);
                sweep(w, &grid.faces(at), &near, near.own(), product, Product);
                grid.end(product);
                // SAFETY: rows of this tile.
                let (x, r) = unsafe { (self.x.take(at, width), self.r.take(at, width)) };
                add(w, x, self.a, near.own());
                add(w, r, -self.a, product);
                norm.add(w, r);
            }
        }
        norm.sums()
    }
}

/// b.b, the sum of b and its largest magnitude.
struct Norms<'a, T> {
    grid: &'a Grid<T>,
}

impl<T: Weight> Pass for Norms<'_, T> {
    fn scratch(&self) -> usize {
        0
    }

    #[inline(always)]
    fn tile<W: Width>(&self, w: W, tile: Tile, _scratch: &mut [Real]) -> [f64; 4] {
        let grid = self.grid;
        let mut norm = Norm::default();
        for k in tile.k[0]..tile.k[1] {
            for j in tile.rows(grid, 0) {
                norm.add(w, grid.row(&grid.b, grid.start(j, k)));
            }
        }
        norm.sums()
    }
}
