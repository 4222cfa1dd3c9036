//! Multigrid V-cycles: a symmetric, positive approximation of A^-1.
//!
//! Each coarser grid joins two cells along every axis that has more than one. What is left over is added up, the correction is
//! copied: with cut cells this beats interpolation, which reaches across walls, and it is exactly symmetric. The smoother is
//! Chebyshev's polynomial of order two, two Jacobi sweeps with fixed weights: nothing is updated in place, so that both sweeps and
//! the residual pass over memory once.                                                        (pressure.7, pressure.8, pressure.9)
//!
//! Source: [mcadams2010] for multigrid as the preconditioner of conjugate gradients on such grids, [adams2003] for the smoother,
//! [braess1995] for constant transfers and their scaling.

use super::faces::Weight;
use super::level::{Grid, Pass, Relax, Residual, Ring, Rows, Tile, dot, run, scale, sum, sweep};
use crate::math::simd::{Level as Registers, Width, ask};
use crate::math::{Lattice, Real};

/// The part of the spectrum that the smoother damps: from 2/ALPHA to 2, where the spectrum of D^-1 A ends.
const ALPHA: f64 = 5.0;

/// The weights of the two sweeps, theta -+ delta/sqrt(2) inverted.                                      (pressure.7)
pub(super) fn sweeps() -> [Real; 2] {
    let (theta, delta) = (1.0 + 1.0 / ALPHA, 1.0 - 1.0 / ALPHA);
    [1.0, -1.0].map(|sign| (1.0 / (theta + sign * delta * std::f64::consts::FRAC_1_SQRT_2)) as Real)
}

/// Which axes a coarser grid halves, and what sums are multiplied with so that b stays that of the same equation.
fn halved(n: [usize; 3]) -> ([bool; 3], f64) {
    let half = n.map(|n| n > 1);
    (half, 4.0 / f64::from(1 << half.iter().filter(|h| **h).count()))
}

/// The grid with half the cells along each axis.                                                        (pressure.8)
pub(super) fn coarser<T: Weight>(fine: &Grid<T>) -> Grid<Real> {
    let n = fine.lattice.n;
    let (half, factor) = halved(n);
    let lattice = Lattice::new(n.map(|n| n.div_ceil(2)));
    let children = |axis: usize, i: usize| if half[axis] { 2 * i..(2 * i + 2).min(n[axis]) } else { i..i + 1 };
    let mut w = [(); 3].map(|()| vec![0.0; lattice.len()]);
    // A single cell that is joined to itself is closed.
    let periodic = [0, 1, 2].map(|axis| fine.periodic[axis] && lattice.n[axis] > 1);
    for axis in (0..3).filter(|a| periodic[*a] || !fine.periodic[*a]) {
        // Along its own axis a face is that of the first child, or the upper side of the box.
        let faces = |a: usize, i: usize| {
            if a == axis {
                let first = if half[a] { (2 * i).min(n[a]) } else { i };
                first..first + 1
            } else {
                children(a, i)
            }
        };
        let factor = if half[axis] { factor / 2.0 } else { factor } as Real;
        let up = |a: usize| lattice.n[a] + usize::from(a == axis);
        for k in 0..up(2) {
            for j in 0..up(1) {
                let at = lattice.at(0, j, k);
                for fk in faces(2, k) {
                    for fj in faces(1, j) {
                        let from = fine.lattice.at(0, fj, fk);
                        for i in 0..up(0) {
                            for fi in faces(0, i) {
                                w[axis][at + i] += factor * fine.w[axis][from + fi].value();
                            }
                        }
                    }
                }
            }
        }
    }
    let extra = fine.extra.as_ref().map(|extra| {
        let mut sums = vec![0.0; lattice.len()];
        fine.each_row(|from, [j, k]| {
            let at = lattice.at(0, if half[1] { j / 2 } else { j }, if half[2] { k / 2 } else { k });
            for i in 0..n[0] {
                sums[at + if half[0] { i / 2 } else { i }] += factor as Real * extra[from + i];
            }
        });
        sums
    });
    Grid::new(lattice, periodic, w, extra).with_columns()
}

/// y ~ A^-1 b on a grid and all coarser ones; returns b.y, the sum of y and that of b.
pub(super) fn cycle<T: Weight>(grid: &mut Grid<T>, coarser: &mut [Grid<Real>], coarsest: &Coarsest, registers: Registers) -> [f64; 3] {
    let Some((next, rest)) = coarser.split_first_mut() else { return coarsest.solve(grid) };
    let n = grid.lattice.n;
    let (mut x, mut b) = (std::mem::take(&mut grid.x), std::mem::take(&mut next.b));
    run(n, registers, &Down { grid, next, x: Rows::of(&mut x), out: Rows::of(&mut b) });
    (grid.x, next.b) = (x, b);
    cycle(next, rest, coarsest, registers);
    let mut y = std::mem::take(&mut grid.y);
    let [by, of_y, of_b, _] = run(n, registers, &Up { grid, next, y: Rows::of(&mut y) });
    grid.y = y;
    [by, of_y, of_b]
}

/// A sweep over plane k, as far as a sweep over the tile needs it.
#[inline(always)]
fn relax<W: Width, T: Weight>(w: W, grid: &Grid<T>, tile: Tile, k: isize, from: &Ring, to: &mut Ring, weight: Real) {
    if k >= tile.k[0] - 1 && tile.has(grid, k) {
        for j in tile.rows(grid, 1) {
            let at = grid.start(j, k);
            let row = to.padded(j, k);
            sweep(w, &grid.faces(at), &from.near(grid, j, k), grid.row(&grid.b, at), &mut row[1..=grid.width], Relax(weight));
            grid.close(row);
        }
    }
}

/// Two sweeps from zero, and what is left to the coarser grid.
struct Down<'a, T> {
    grid: &'a Grid<T>,
    next: &'a Grid<Real>,
    x: Rows<'a>,
    out: Rows<'a>,
}

impl<T: Weight> Pass for Down<'_, T> {
    fn scratch(&self) -> usize {
        // Two rings, a row, and a plane of the coarser grid with its rows still at full length.
        2 * Ring::numbers(self.grid) + Ring::numbers(self.grid)
    }

    #[inline(always)]
    fn tile<W: Width>(&self, w: W, tile: Tile, scratch: &mut [Real]) -> [f64; 4] {
        let (grid, width) = (self.grid, self.grid.width);
        let n = grid.lattice.n;
        let (half, factor) = halved(n);
        let weights = sweeps();
        let (mut first, rest) = Ring::new(grid, tile, scratch);
        let (mut second, rest) = Ring::new(grid, tile, rest);
        let (left, sums) = rest.split_at_mut(width);
        for k in tile.k[0] - 2..tile.k[1] + 2 {
            if tile.has(grid, k) {
                for (j, ahead) in tile.rows_ahead(grid, 2, k) {
                    ask(grid.row(&grid.b, ahead));
                    let at = grid.start(j, k);
                    let row = first.padded(j, k);
                    scale(w, &grid.faces(at), weights[0], grid.row(&grid.b, at), &mut row[1..=width]);
                    grid.close(row);
                }
            }
            let k = k - 1;
            relax(w, grid, tile, k, &first, &mut second, weights[1]);
            let k = k - 1;
            if k < tile.k[0] {
                continue;
            }
            for (j, ahead) in tile.rows_ahead(grid, 0, k) {
                self.x.ask(ahead, width);
                let at = grid.start(j, k);
                let near = second.near(grid, j, k);
                // SAFETY: a row of this tile.
                let x = unsafe { self.x.take(at, width) };
                x.copy_from_slice(near.own());
                sweep(w, &grid.faces(at), &near, grid.row(&grid.b, at), left, Residual);
                grid.end(left);
                let (j, k) = (j as usize, k as usize);
                let (cj, ck) = (if half[1] { j / 2 } else { j }, if half[2] { k / 2 } else { k });
                let from = (cj - if half[1] { tile.j[0] as usize / 2 } else { tile.j[0] as usize }) * width;
                let sums = &mut sums[from..from + width];
                let starts = |i: usize, axis: usize| !half[axis] || i.is_multiple_of(2);
                let ends = |i: usize, axis: usize| !half[axis] || i % 2 == 1 || i + 1 == n[axis];
                if starts(j, 1) && starts(k, 2) {
                    sums.copy_from_slice(left);
                } else {
                    for i in 0..width {
                        sums[i] += left[i];
                    }
                }
                if ends(j, 1) && ends(k, 2) {
                    // SAFETY: tiles have even numbers of rows and planes, so that this row comes from this tile alone.
                    let out = unsafe { self.out.take(self.next.lattice.at(0, cj, ck), self.next.lattice.n[0]) };
                    collect(out, sums, factor as Real, half[0]);
                }
            }
        }
        [0.0; 4]
    }
}

/// out = factor times the sum of each two.
#[inline(always)]
fn collect(out: &mut [Real], from: &[Real], factor: Real, half: bool) {
    if half {
        for (out, two) in out.iter_mut().zip(from.as_chunks::<2>().0) {
            *out = factor * (two[0] + two[1]);
        }
    } else {
        for i in 0..out.len() {
            out[i] = factor * from[i];
        }
    }
}

/// The correction from the coarser grid, and the same sweeps in reverse order.
struct Up<'a, T> {
    grid: &'a Grid<T>,
    next: &'a Grid<Real>,
    y: Rows<'a>,
}

impl<T: Weight> Pass for Up<'_, T> {
    fn scratch(&self) -> usize {
        2 * Ring::numbers(self.grid)
    }

    #[inline(always)]
    fn tile<W: Width>(&self, w: W, tile: Tile, scratch: &mut [Real]) -> [f64; 4] {
        let (grid, width) = (self.grid, self.grid.width);
        let n = grid.lattice.n;
        let (half, _) = halved(n);
        let weights = sweeps();
        let (mut first, rest) = Ring::new(grid, tile, scratch);
        let (mut second, _) = Ring::new(grid, tile, rest);
        let (mut by, mut of_y, mut of_b) = (0.0, 0.0, 0.0);
        for k in tile.k[0] - 2..tile.k[1] + 2 {
            if tile.has(grid, k) {
                for (j, ahead) in tile.rows_ahead(grid, 2, k) {
                    ask(grid.row(&grid.x, ahead));
                    ask(grid.row(&grid.b, ahead));
                    let row = first.padded(j, k);
                    let of = |i: isize, axis: usize| {
                        let i = i.rem_euclid(n[axis] as isize) as usize;
                        if half[axis] { i / 2 } else { i }
                    };
                    let from = self.next.lattice.at(0, of(j, 1), of(k, 2));
                    let coarse = &self.next.y[from..from + self.next.width];
                    spread(&mut row[1..=width], grid.row(&grid.x, grid.start(j, k)), coarse, half[0]);
                    grid.close(row);
                }
            }
            let k = k - 1;
            relax(w, grid, tile, k, &first, &mut second, weights[1]);
            let k = k - 1;
            if k < tile.k[0] {
                continue;
            }
            for (j, ahead) in tile.rows_ahead(grid, 0, k) {
                self.y.ask(ahead, width);
                let at = grid.start(j, k);
                let b = grid.row(&grid.b, at);
                // SAFETY: a row of this tile.
                let y = unsafe { self.y.take(at, width) };
                sweep(w, &grid.faces(at), &second.near(grid, j, k), b, y, Relax(weights[0]));
                grid.end(y);
                by += dot(w, y, b);
                of_y += sum(w, y);
                of_b += sum(w, b);
            }
        }
        [by, of_y, of_b, 0.0]
    }
}

/// out = x + the number of the coarser cell.
#[inline(always)]
fn spread(out: &mut [Real], x: &[Real], coarse: &[Real], half: bool) {
    if half {
        for ((out, x), c) in out.as_chunks_mut::<2>().0.iter_mut().zip(x.as_chunks::<2>().0).zip(coarse) {
            *out = [x[0] + c, x[1] + c];
        }
    } else {
        for ((out, x), c) in out.iter_mut().zip(x).zip(coarse) {
            *out = x + c;
        }
    }
}

/// The coarsest grid, solved by Cholesky's factors of its few cells. Components without an open side have a constant that the
/// equation does not see: it is left out, and the matrix is shifted along it.
#[derive(Debug, Clone, Default)]
pub(super) struct Coarsest {
    cells: Vec<usize>,
    /// The component of each cell, counted from 0.
    component: Vec<usize>,
    /// Cells of each component, or none if it is held by an open side.
    floating: Vec<Option<usize>>,
    /// The lower factor, row by row.
    factor: Vec<f64>,
}

/// Cells along an axis that the coarsest grid has at most.
pub(super) const FEW: usize = 4;

impl Coarsest {
    pub fn new<T: Weight>(grid: &Grid<T>) -> Self {
        let Lattice { n, stride } = grid.lattice;
        let value = |axis: usize, at: usize| f64::from(grid.w[axis][at].value());
        let mut all = Vec::new();
        grid.each_row(|at, [j, k]| all.extend((0..n[0]).map(|i| (at + i, [i, j, k]))));
        let diagonal = |at: usize| (0..3).map(|a| value(a, at) + value(a, at + stride[a])).sum::<f64>() + extra(grid, at);
        all.retain(|(at, _)| diagonal(*at) > 0.0);
        let m = all.len();
        let mut matrix = vec![0.0; m * m];
        let mut component: Vec<usize> = (0..m).collect();
        let mut held = vec![false; m];
        let place = |at: usize| all.iter().position(|(other, _)| *other == at);
        for (row, (at, i)) in all.iter().enumerate() {
            matrix[row * m + row] += diagonal(*at);
            held[row] |= extra(grid, *at) > 0.0;
            for axis in 0..3 {
                let weight = value(axis, at + stride[axis]);
                let next = if i[axis] + 1 < n[axis] {
                    Some(at + stride[axis])
                } else if grid.periodic[axis] {
                    Some(at - i[axis] * stride[axis])
                } else {
                    None
                };
                match next.and_then(place) {
                    Some(column) if weight > 0.0 => {
                        matrix[row * m + column] -= weight;
                        matrix[column * m + row] -= weight;
                        let (a, b) = (component[row], component[column]);
                        component.iter_mut().for_each(|c| *c = if *c == b { a } else { *c });
                    }
                    _ => held[row] |= weight > 0.0,
                }
                held[row] |= i[axis] == 0 && !grid.periodic[axis] && value(axis, *at) > 0.0;
            }
        }
        let mut names = component.clone();
        names.sort_unstable();
        names.dedup();
        for c in &mut component {
            *c = names.binary_search(c).unwrap_or(0);
        }
        let mut floating: Vec<Option<usize>> = (0..names.len()).map(|c| Some(component.iter().filter(|o| **o == c).count())).collect();
        for row in 0..m {
            if held[row] {
                floating[component[row]] = None;
            }
        }
        let shift = (0..m).map(|row| matrix[row * m + row]).sum::<f64>() / m.max(1) as f64;
        for row in 0..m {
            for column in 0..m {
                if let (true, Some(count)) = (component[row] == component[column], floating[component[row]]) {
                    matrix[row * m + column] += shift / count as f64;
                }
            }
        }
        Self { cells: all.iter().map(|(at, _)| *at).collect(), component, floating, factor: cholesky(matrix, m) }
    }

    /// y = A^-1 b without the constants of floating components; returns b.y, the sum of y and that of b.
    fn solve<T: Weight>(&self, grid: &mut Grid<T>) -> [f64; 3] {
        let m = self.cells.len();
        let mut y: Vec<f64> = self.cells.iter().map(|at| f64::from(grid.b[*at])).collect();
        self.centre(&mut y);
        for i in 0..m {
            let sum: f64 = (0..i).map(|j| self.factor[i * m + j] * y[j]).sum();
            y[i] = (y[i] - sum) / self.factor[i * m + i];
        }
        for i in (0..m).rev() {
            y[i] /= self.factor[i * m + i];
            for j in 0..i {
                y[j] -= self.factor[i * m + j] * y[i];
            }
        }
        self.centre(&mut y);
        let mut sums = [0.0; 3];
        for (at, y) in self.cells.iter().zip(&y) {
            grid.y[*at] = *y as Real;
            sums[0] += f64::from(grid.b[*at]) * y;
            sums[1] += y;
            sums[2] += f64::from(grid.b[*at]);
        }
        sums
    }

    /// Takes the mean from each floating component.
    fn centre(&self, y: &mut [f64]) {
        for (c, count) in self.floating.iter().enumerate() {
            let Some(count) = count else { continue };
            let of = |i: &usize| self.component[*i] == c;
            let mean = (0..y.len()).filter(of).map(|i| y[i]).sum::<f64>() / *count as f64;
            (0..y.len()).filter(of).for_each(|i| y[i] -= mean);
        }
    }
}

fn extra<T>(grid: &Grid<T>, at: usize) -> f64 {
    grid.extra.as_ref().map_or(0.0, |extra| f64::from(extra[at]))
}

/// The lower factor of a symmetric, positive matrix of m rows. A pivot that is lost to rounding leaves its unknown out.
fn cholesky(mut a: Vec<f64>, m: usize) -> Vec<f64> {
    for j in 0..m {
        let whole = a[j * m + j];
        let sum: f64 = (0..j).map(|k| a[j * m + k] * a[j * m + k]).sum();
        let pivot = whole - sum;
        let d = if pivot > 1e-14 * whole { pivot.sqrt() } else { f64::INFINITY };
        a[j * m + j] = d;
        for i in j + 1..m {
            let sum: f64 = (0..j).map(|k| a[i * m + k] * a[j * m + k]).sum();
            a[i * m + j] = (a[i * m + j] - sum) / d;
        }
    }
    a
}
