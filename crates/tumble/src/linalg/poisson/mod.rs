//! The pressure equation on a staggered grid, and the ladder of its solvers.
//!
//!   sum over faces of w_f (q_i - q_other) + d_i q_i = b_i                                               (pressure.2)
//!
//! q [m²/s] is the step's length times pressure over density, b = -dx D u [m²/s] with D u the sum of what flows out through the
//! faces, weighted with their open fractions w [1]. Cells are those of a [`Lattice`]; walls have weight zero, sides are closed, open
//! (q = 0 on the side) or joined. Two dimensions are one cell along an axis. Everything has the same bits on any number of threads
//! and any width of registers.
//!
//! Verified by `crates/tumble-f64/tests/pressure.rs`.

mod block;
mod cosine;
mod faces;
mod incomplete;
mod joined;
mod krylov;
mod ladder;
mod level;
mod multigrid;
mod pockets;
mod report;
#[cfg(test)]
mod tests;

pub use cosine::Series;
pub use faces::{Weight, byte};
pub use joined::{DIRECTIONS, Directions, Joint, times};
pub use report::{Excess, Fault, Info, Method, Params, Target};

use crate::math::parallel::{Tasks, chunks};
use crate::math::simd::{Kernel, Level as Registers, Width, dispatch};
use crate::math::{Column, Lattice, Real, Spare};
use cosine::Cosine;
use incomplete::Factors;
use krylov::Before;
use level::Grid;
use multigrid::{Coarsest, FEW};
use pockets::Pockets;

/// Boundary condition of a side of the box.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Side {
    /// A wall: nothing passes.
    #[default]
    Closed,
    /// Pressure zero on the side itself, half a cell from the centres.
    Open,
    /// The other side of the axis, which must say the same.
    Periodic,
}

/// A pressure system with everything that depends on geometry alone, made once for many solves.
#[derive(Debug)]
pub struct Solver<T> {
    fine: Grid<T>,
    coarse: Vec<Grid<Real>>,
    coarsest: Coarsest,
    pockets: Pockets,
    joints: Vec<Joint>,
    sides: [[Side; 2]; 3],
    /// Made when first asked for.
    incomplete: Option<Factors>,
    cosine: Option<Cosine>,
    /// The direction of conjugate gradients, or the other of two iterates.
    p: Column,
    /// Source of its temporary columns.
    pub spare: Spare,
    registers: Registers,
    clock: report::Clock,
}

impl<T: Weight> Solver<T> {
    /// From the weights of the lower faces of all cells, each column of the lattice's length; upper sides are faces n. Weights on
    /// closed sides, and on the upper one of two that are joined, do not matter. `extra` [1] is added to the diagonal: a
    /// reaction, an implicit step (dx²/(nu dt)), or a free surface (w/theta of the faces to air, whose own weight is then closed).
    pub fn new(lattice: Lattice, sides: [[Side; 2]; 3], weights: [&[T]; 3], extra: Option<&[Real]>) -> Result<Self, Fault> {
        if lattice.is_empty() {
            return Err(Fault::Shape { expected: 1, given: 0 });
        }
        for column in weights.iter().map(|w| w.len()).chain(extra.map(<[Real]>::len)) {
            if column != lattice.len() {
                return Err(Fault::Shape { expected: lattice.len(), given: column });
            }
        }
        Self::of(lattice, sides, |axis, at| weights[axis][at], extra)
    }

    /// Of a box without anything in it.
    pub fn empty(lattice: Lattice, sides: [[Side; 2]; 3]) -> Result<Self, Fault> {
        if lattice.is_empty() {
            return Err(Fault::Shape { expected: 1, given: 0 });
        }
        Self::of(lattice, sides, |_, _| T::OPEN, None)
    }

    fn of(lattice: Lattice, sides: [[Side; 2]; 3], weights: impl Fn(usize, usize) -> T, extra: Option<&[Real]>) -> Result<Self, Fault> {
        let n = lattice.n;
        for axis in 0..3 {
            if (sides[axis][0] == Side::Periodic) != (sides[axis][1] == Side::Periodic) {
                return Err(Fault::Sides { axis });
            }
        }
        // A single cell that is joined to itself is closed.
        let periodic = [0, 1, 2].map(|axis| sides[axis][0] == Side::Periodic && n[axis] > 1);
        let mut w = [(); 3].map(|()| vec![T::CLOSED; lattice.len()]);
        for axis in 0..3 {
            let up = |a: usize| n[a] + usize::from(a == axis);
            for k in 0..up(2) {
                for j in 0..up(1) {
                    for i in 0..up(0) {
                        let cell = [i, j, k];
                        let at = lattice.at(i, j, k);
                        let given = weights(axis, at);
                        let side = match cell[axis] {
                            0 => Some(sides[axis][0]),
                            c if c == n[axis] => Some(sides[axis][1]),
                            _ => None,
                        };
                        let weight = match side {
                            None => given,
                            Some(Side::Open) => given,
                            Some(Side::Periodic) if periodic[axis] => {
                                weights(axis, at - if cell[axis] == 0 { 0 } else { n[axis] * lattice.stride[axis] })
                            }
                            _ => continue,
                        };
                        if !weight.valid() {
                            return Err(Fault::Weight { axis, cell });
                        }
                        w[axis][at] = if side == Some(Side::Open) { weight.doubled() } else { weight };
                    }
                }
            }
        }
        let fine = Grid::new(lattice, periodic, w, extra.map(<[Real]>::to_vec));
        let pockets = Pockets::new(&fine);
        let mut coarse = Vec::<Grid<Real>>::new();
        let few = |n: [usize; 3]| n.iter().all(|n| *n <= FEW);
        if !few(n) {
            coarse.push(multigrid::coarser(&fine));
        }
        while let Some(last) = coarse.last().filter(|last| !few(last.lattice.n)) {
            coarse.push(multigrid::coarser(last));
        }
        let coarsest = coarse.last().map_or_else(|| Coarsest::new(&fine), Coarsest::new);
        Ok(Self {
            fine,
            coarse,
            coarsest,
            pockets,
            joints: Vec::new(),
            sides,
            incomplete: None,
            cosine: None,
            p: Column::default(),
            spare: Spare::default(),
            registers: Registers::Avx512,
            clock: report::Clock::default(),
        })
    }

    /// The layout of its columns.
    pub fn lattice(&self) -> Lattice {
        self.fine.lattice
    }

    /// Components of cells that no open face joins to the largest one.
    pub fn pockets(&self) -> usize {
        self.pockets.count()
    }

    /// Uses registers no wider than that; the bits stay the same, which tests show.
    pub fn with_registers(mut self, registers: Registers) -> Self {
        self.registers = registers;
        self
    }

    /// Tells the time [s] of every iteration by that.
    pub fn with_clock(mut self, now: fn() -> f64) -> Self {
        self.clock = report::Clock(Some(now));
        self
    }

    /// Solves for q from zero; both columns have the lattice's length. In cells without an open face q is zero, and its mean over
    /// every component that no open side holds is whatever the method leaves.
    pub fn solve(&mut self, b: &[Real], q: &mut [Real], params: &Params) -> Result<Info, Fault> {
        let expected = self.fine.lattice.len();
        for given in [b.len(), q.len()] {
            if given != expected {
                return Err(Fault::Shape { expected, given });
            }
        }
        self.working(|solver| {
            solver.pockets.load(&mut solver.fine, Some(b), params.excess)?;
            solver.solve_loaded(q, params)
        })
    }

    /// Does something with columns from the spare ones.
    fn working<R>(&mut self, work: impl FnOnce(&mut Self) -> R) -> R {
        let len = self.fine.lattice.len();
        let Self { fine, spare, p, .. } = self;
        [&mut fine.b, &mut fine.x, &mut fine.y, &mut *p].into_iter().for_each(|column| *column = spare.column(len));
        let result = work(self);
        let Self { fine, spare, p, .. } = self;
        [&mut fine.b, &mut fine.x, &mut fine.y, p].into_iter().for_each(|column| spare.give(std::mem::take(column)));
        result
    }

    /// The same with the right-hand side in place.
    fn solve_loaded(&mut self, q: &mut [Real], params: &Params) -> Result<Info, Fault> {
        self.check_joints(params)?;
        q.fill(0.0);
        let mut info = match params.method {
            Method::Jacobi | Method::GaussSeidel | Method::Sor => ladder::relax(self, q, params)?,
            Method::ConjugateGradients => krylov::solve(self, Before::Nothing, q, params),
            Method::IncompleteCholesky | Method::ModifiedIncompleteCholesky => {
                let modified = params.method == Method::ModifiedIncompleteCholesky;
                if self.incomplete.as_ref().is_none_or(|factors| factors.modified != modified) {
                    self.incomplete = Some(Factors::new(&self.fine, modified));
                }
                krylov::solve(self, Before::Incomplete, q, params)
            }
            Method::Multigrid => krylov::cycles(self, q, params),
            Method::MultigridGradients => krylov::solve(self, Before::Multigrid, q, params),
            Method::Cosine => {
                let cosine = match self.cosine.take() {
                    Some(cosine) => cosine,
                    None => Cosine::new(&self.fine).map_err(|because| Fault::Method { method: params.method, because })?,
                };
                let info = krylov::direct(self, q, params, |grid, column, registers| cosine.solve(grid, column, registers));
                self.cosine = Some(cosine);
                info
            }
        };
        info.pockets = self.pockets();
        self.pockets.clear(&self.fine, q);
        Ok(info)
    }

    /// Solves until what is left, as the caller evaluates it, meets the target: in single precision the residual that an iteration
    /// carries along says less and less about the true one. `evaluate(solver, correction, b)` adds the correction, if there is one yet,
    /// to the unknowns, or takes its gradient from the velocity, and writes the right-hand side that is then left to `b`. The
    /// correction has the lattice's length.                                                                  (pressure.12)
    pub fn refine(
        &mut self,
        correction: &mut [Real],
        params: &Params,
        evaluate: impl FnMut(&Self, Option<&[Real]>, &mut Column),
    ) -> Result<Info, Fault> {
        let (expected, given) = (self.fine.lattice.len(), correction.len());
        if given != expected {
            return Err(Fault::Shape { expected, given });
        }
        self.working(|solver| solver.refine_with(correction, params, evaluate))
    }

    fn refine_with(
        &mut self,
        correction: &mut [Real],
        params: &Params,
        mut evaluate: impl FnMut(&Self, Option<&[Real]>, &mut Column),
    ) -> Result<Info, Fault> {
        let mut info = Info { pockets: self.pockets(), ..Info::by(self.clock) };
        let mut left = |solver: &mut Self, correction: Option<&[Real]>, excess: Excess| {
            let mut b = std::mem::take(&mut solver.fine.b);
            evaluate(solver, correction, &mut b);
            solver.fine.b = b;
            solver.pockets.load(&mut solver.fine, None, excess)
        };
        left(self, None, params.excess)?;
        let [start, most] = self.norms();
        info.begin(start, most, params.target);
        let (mut now, mut largest) = (start, most);
        while !info.converged && info.iterations < params.iterations {
            let wanted = match params.target {
                Target::Relative(r) => r * (start / now).sqrt(),
                Target::Largest(m) => m / largest,
            };
            let inner = Params {
                // At least a part that stands out from rounding, should the largest be just above the target.
                target: Target::Relative((0.9 * wanted).clamp(TRUSTED, 0.4)),
                iterations: params.iterations - info.iterations,
                ..*params
            };
            let part = self.solve_loaded(correction, &inner)?;
            // Rounding errors of the mean are not the caller's fault.
            left(self, Some(&*correction), Excess::Remove)?;
            let [after, most] = self.norms();
            let scale = (now / start).sqrt();
            info.residuals.extend(part.residuals.iter().map(|r| r * scale));
            // Each part repeats what the one before left.
            info.history.extend(part.history.iter().skip(1));
            info.times.extend(part.times.iter().skip(1));
            info.iterations += part.iterations;
            info.refinements += 1;
            info.largest = most;
            let residual = (after / start).sqrt();
            let evaluated = [(&mut info.residuals, residual), (&mut info.history, most)];
            evaluated.into_iter().filter_map(|(all, new)| Some((all.last_mut()?, new))).for_each(|(last, new)| *last = new);
            if let (Some(last), Some(now)) = (info.times.last_mut(), self.clock.0) {
                *last = now();
            }
            info.converged = match params.target {
                Target::Relative(r) => residual <= r,
                Target::Largest(m) => most <= m && after.is_finite(),
            };
            // Round-off of the evaluation itself: no solve makes it smaller.
            if after.is_nan() || part.iterations == 0 || after > 0.25 * now {
                break;
            }
            (now, largest) = (after, most);
        }
        Ok(info)
    }

    /// Solves for q in double precision, by refinement: each residual is evaluated in double, each correction solved for in the
    /// engine's precision.
    pub fn solve_double(&mut self, b: &[Real], q: &mut [f64], params: &Params) -> Result<Info, Fault> {
        let expected = self.fine.lattice.len();
        for given in [b.len(), q.len()] {
            if given != expected {
                return Err(Fault::Shape { expected, given });
            }
        }
        q.fill(0.0);
        let mut correction = self.spare.column(expected);
        let info = self.refine(&mut correction, params, |solver, correction, left| match correction {
            None => left.copy_from_slice(b),
            Some(correction) => {
                chunks(q, |start, q| q.iter_mut().zip(&correction[start..]).for_each(|(q, c)| *q += f64::from(*c)));
                solver.residual(b, q, left);
            }
        });
        self.spare.give(correction);
        info
    }

    /// out = b - A q, evaluated in double precision.
    pub fn residual(&self, b: &[Real], q: &[f64], out: &mut [Real]) {
        let grid = &self.fine;
        let (n, stride) = (grid.lattice.n, grid.lattice.stride);
        let zeros = vec![0.0; n[0]];
        // A row, or what lies beyond an open side; a wall lets nothing of it through.
        let row = |j: isize, k: isize| {
            let inside = |i: isize, axis: usize| grid.periodic[axis] || (0..n[axis] as isize).contains(&i);
            if inside(j, 1) && inside(k, 2) {
                let at = grid.start(j, k);
                &q[at..at + n[0]]
            } else {
                &zeros[..]
            }
        };
        let first = grid.lattice.at(0, 0, 0);
        out[first..first + stride[2] * n[2]].chunks_mut(LINES * stride[1]).enumerate().in_parallel(|(task, rows)| {
            let mut padded = vec![0.0; n[0] + 2];
            for (line, out) in rows.chunks_mut(stride[1]).enumerate() {
                let line = task * LINES + line;
                let (j, k) = (line % (n[1] + 2), line / (n[1] + 2));
                if j >= n[1] {
                    continue;
                }
                let at = grid.lattice.at(0, j, k);
                let (j, k) = (j as isize, k as isize);
                let here = row(j, k);
                padded[1..=n[0]].copy_from_slice(here);
                [padded[0], padded[n[0] + 1]] = if grid.periodic[0] { [here[n[0] - 1], here[0]] } else { [0.0; 2] };
                let of = |axis: usize, up: usize| &grid.w[axis][at + up..at + up + n[0]];
                dispatch(Left {
                    out: &mut out[..n[0]],
                    b: &b[at..],
                    here,
                    extra: grid.extra.as_ref().map(|extra| &extra[at..at + n[0]]),
                    others: [&padded[..], &padded[2..], row(j - 1, k), row(j + 1, k), row(j, k - 1), row(j, k + 1)],
                    w: [of(0, 0), of(0, 1), of(1, 0), of(1, stride[1]), of(2, 0), of(2, stride[2])],
                });
            }
        });
        self.joined_residual(q, out);
    }
}

/// Rows per task of what is left.
const LINES: usize = 16;

/// Residual of a row, in double precision.
struct Left<'a, T> {
    out: &'a mut [Real],
    b: &'a [Real],
    here: &'a [f64],
    extra: Option<&'a [Real]>,
    others: [&'a [f64]; 6],
    w: [&'a [T]; 6],
}

impl<T: Weight> Kernel for Left<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, _: W) {
        left(self.out, self.b, self.here, self.extra, self.others, self.w);
    }
}

/// The output is a parameter: the compiler then knows that it overlaps nothing.
#[inline(always)]
fn left<T: Weight>(out: &mut [Real], b: &[Real], here: &[f64], extra: Option<&[Real]>, others: [&[f64]; 6], w: [&[T]; 6]) {
    let n = out.len();
    let (b, here) = (&b[..n], &here[..n]);
    let [x0, x1, y0, y1, z0, z1] = others.map(|o| &o[..n]);
    let [a0, a1, b0, b1, c0, c1] = w.map(|w| &w[..n]);
    let flow = |w: T, here: f64, other: f64| f64::from(w.value()) * (here - other);
    for i in 0..n {
        let v = here[i];
        let product = extra.map_or(0.0, |extra| f64::from(extra[i]) * v);
        let product = product + flow(a0[i], v, x0[i]) + flow(a1[i], v, x1[i]) + flow(b0[i], v, y0[i]);
        let product = product + flow(b1[i], v, y1[i]) + flow(c0[i], v, z0[i]) + flow(c1[i], v, z1[i]);
        out[i] = (f64::from(b[i]) - product) as Real;
    }
}

/// The reduction up to which the residual of an iteration agrees with the true one.
#[cfg(not(feature = "double"))]
const TRUSTED: f64 = 1e-3;
/// The reduction up to which the residual of an iteration agrees with the true one.
#[cfg(feature = "double")]
const TRUSTED: f64 = 1e-9;
