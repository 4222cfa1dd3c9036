//! Rows of cells and faces: sums over them in a fixed order, and the two cells beside a face.

use crate::math::Real;
use crate::math::parallel;
use crate::state::{Field, Grid};

/// Calls `f(start of the row in data, its points)` for all rows of a field, in parallel; the sum of the results in a fixed order.
pub fn sum(field: &Field, f: impl Fn(usize, usize) -> f64 + Sync) -> f64 {
    fold_rows(field, 0.0, |a, b| a + b, f)
}

/// The same for the largest result, at least 0; a NaN wins.
pub fn largest(field: &Field, f: impl Fn(usize, usize) -> f64 + Sync) -> f64 {
    fold_rows(field, 0.0, worse, f)
}

/// The same for the largest result of all.
pub fn extreme(field: &Field, f: impl Fn(usize, usize) -> f64 + Sync) -> f64 {
    fold_rows(field, f64::NEG_INFINITY, worse, f)
}

/// The larger of two numbers; a NaN wins.
pub fn worse(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() { a } else { b }
}

fn fold_rows(field: &Field, zero: f64, join: impl Fn(f64, f64) -> f64 + Sync, f: impl Fn(usize, usize) -> f64 + Sync) -> f64 {
    let [x, y, z] = field.points();
    // A task for so many rows, whatever the number of threads.
    let part = (4096 / x).max(1);
    let tasks = (y * z).div_ceil(part);
    let one = |task: usize| {
        (task * part..((task + 1) * part).min(y * z)).fold(zero, |sum, row| join(sum, f(field.index([0, row % y, row / y]), x)))
    };
    parallel::map(tasks, one).into_iter().fold(zero, join)
}

/// a . b over the points of a.
pub fn dot(a: &Field, b: &Field) -> f64 {
    sum(a, |at, n| a.data[at..at + n].iter().zip(&b.data[at..at + n]).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum())
}

/// The largest |value|; NaN if one is.
pub fn magnitude(a: &Field) -> f64 {
    largest(a, |at, n| a.data[at..at + n].iter().fold(0.0, |most, x| worse(most, f64::from(x.abs()))))
}

/// The two sides of a face.
#[derive(Clone, Copy, PartialEq)]
pub enum Face {
    /// Two cells, by their numbers in `data`.
    Between(usize, usize),
    /// The lower side of the box, before a cell.
    Lower(usize),
    /// The upper side of the box, behind a cell.
    Upper(usize),
}

/// The cells beside face (i, j, k) of an axis; along x, of i = 1 for all inner faces of the row.
pub fn beside(grid: &Grid, axis: usize, at: [usize; 3]) -> Face {
    let (n, lattice) = (grid.n[axis], grid.lattice());
    let stride = lattice.stride[axis];
    let here = lattice.at(at[0], at[1], at[2]);
    match at[axis] {
        0 if grid.periodic[axis] => Face::Between(here + (n - 1) * stride, here),
        0 => Face::Lower(here),
        i if i == n => Face::Upper(here - stride),
        _ => Face::Between(here - stride, here),
    }
}

/// Calls `each(faces of a run, what is beside its first)` for row (j, k) of faces of an axis: in one run across the other axes, along x
/// the ends by themselves.
pub fn runs(grid: &Grid, axis: usize, j: usize, k: usize, row: &mut [Real], mut each: impl FnMut(&mut [Real], Face)) {
    if axis != 0 {
        return each(row, beside(grid, axis, [0, j, k]));
    }
    let n = grid.n[0];
    let (first, rest) = row.split_at_mut(1);
    each(first, beside(grid, 0, [0, j, k]));
    let (inner, last) = rest.split_at_mut((n - 1).min(rest.len()));
    if !inner.is_empty() {
        each(inner, beside(grid, 0, [1, j, k]));
    }
    if !last.is_empty() {
        each(last, beside(grid, 0, [n, j, k]));
    }
}
