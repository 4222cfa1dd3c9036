//! Rows of fields and their neighbours, ghosts included.

use crate::math::Real;
use crate::math::parallel::{CHUNK, Tasks};
use crate::math::simd::{Kernel, Width, dispatch};
use crate::state::{Field, Side};

/// A value a + b c made of the stored value c.
#[derive(Clone, Copy)]
pub struct Reach {
    /// The stored point along the axis.
    pub from: usize,
    /// The constant; `None` for the stored value itself.
    pub ghost: Option<(Real, Real)>,
}

/// Source of the value at point m along an axis, inside or beyond the walls.                     (grids.2)
pub fn reach(f: &Field, axis: usize, m: isize) -> Reach {
    let (n, points) = (f.grid.n[axis] as isize, f.points()[axis] as isize);
    if f.grid.periodic[axis] {
        return Reach { from: m.rem_euclid(n) as usize, ghost: None };
    }
    if (0..points).contains(&m) {
        return Reach { from: m as usize, ghost: None };
    }
    // The image in the wall: points on walls have the wall's own point in the middle.
    let (below, on_walls) = (m < 0, f.grid.on_walls(f.place, axis));
    let image = match (below, on_walls) {
        (true, false) => -1 - m,
        (true, true) => -m,
        (false, false) => 2 * n - 1 - m,
        (false, true) => 2 * n - m,
    };
    let from = image.clamp(0, points - 1);
    let distance = f.grid.dx * (m - from).unsigned_abs() as f64;
    let (a, b) = match f.sides[axis][usize::from(!below)] {
        Side::Closed => (0.0, 1.0),
        Side::Slope(g) => (g * distance, 1.0),
        Side::Value(v) => (2.0 * v, -1.0),
        Side::Ghost(v) => (v, 0.0),
    };
    Reach { from: from as usize, ghost: Some((a as Real, b as Real)) }
}

/// The value at any point: beyond several walls at once, ghosts are made of ghosts, x first.
pub fn ghosted(f: &Field, at: [isize; 3]) -> Real {
    let [x, y, z] = [reach(f, 0, at[0]), reach(f, 1, at[1]), reach(f, 2, at[2])];
    let stored = f.value([x.from, y.from, z.from]);
    [x, y, z].iter().filter_map(|r| r.ghost).fold(stored, |c, (a, b)| a + b * c)
}

/// A row, made in `scratch` if it lies beyond a wall.
pub fn fetch<'a>(f: &'a Field, j: isize, k: isize, scratch: &'a mut Vec<Real>) -> &'a [Real] {
    let (y, z) = (reach(f, 1, j), reach(f, 2, k));
    let start = f.index([0, y.from, z.from]);
    let row = &f.data[start..start + f.points()[0]];
    if y.ghost.is_none() && z.ghost.is_none() {
        return row;
    }
    scratch.clear();
    scratch.extend(row.iter().map(|c| [y, z].iter().filter_map(|r| r.ghost).fold(*c, |c, (a, b)| a + b * c)));
    scratch
}

/// Calls `work(j, k, row)` for every row of points, rows of fixed tasks in parallel.
pub fn each_row(out: &mut Field, work: impl Fn(usize, usize, &mut [Real]) + Sync) {
    each_row_of(&mut [out], |j, k, rows| {
        if let [row] = rows {
            work(j, k, row);
        }
    });
}

/// The same for several fields at the same place at once.
pub fn each_row_of(out: &mut [&mut Field], work: impl Fn(usize, usize, &mut [&mut [Real]]) + Sync) {
    each_row_with(out, || (), |(), j, k, rows| work(j, k, rows));
}

/// The same with something to work with that is made once for each task.
pub fn each_row_with<T>(
    out: &mut [&mut Field],
    make: impl Fn() -> T + Sync,
    work: impl Fn(&mut T, usize, usize, &mut [&mut [Real]]) + Sync,
) {
    let Some(first) = out.first() else { return };
    let ([px, py, pz], l) = (first.points(), first.grid.lattice());
    let (row, rows, start) = (l.stride[1], l.n[1] + 2, l.at(0, 0, 0) - l.stride[1] - l.stride[2]);
    let task = (CHUNK / row).max(1);
    let mut tasks: Vec<Vec<&mut [Real]>> = Vec::new();
    for field in out.iter_mut() {
        for (t, chunk) in field.data[start..].chunks_mut(task * row).enumerate() {
            if t == tasks.len() {
                tasks.push(Vec::new());
            }
            tasks[t].push(chunk);
        }
    }
    let body = |t: usize, mut chunks: Vec<&mut [Real]>| {
        let mut with = make();
        for r in 0..task {
            let (k, j) = ((t * task + r) / rows, (t * task + r) % rows);
            if !(1..=pz).contains(&k) || !(1..=py).contains(&j) {
                continue;
            }
            let mut here: Vec<&mut [Real]> = chunks.iter_mut().map(|c| &mut c[r * row..r * row + px]).collect();
            work(&mut with, j - 1, k - 1, &mut here);
        }
    };
    if tasks.len() <= 2 {
        tasks.into_iter().enumerate().for_each(|(t, chunks)| body(t, chunks));
    } else {
        tasks.into_iter().enumerate().in_parallel(|(t, chunks)| body(t, chunks));
    }
}

/// Combination of two neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Combination {
    /// Their difference, halfway between them.
    Difference,
    /// Their mean, halfway between them.
    Average,
    /// The difference of the two neighbours of a point.
    Central,
}

/// Something along an axis, times a factor.
pub struct Term<'a> {
    /// Of which field.
    pub of: &'a Field,
    /// Along which axis.
    pub axis: usize,
    /// Combination.
    pub kind: Combination,
    /// Times which factor.
    pub scale: f64,
}

struct Pair<'a> {
    out: &'a mut [Real],
    high: &'a [Real],
    low: &'a [Real],
    scale: Real,
    sum: bool,
    add: bool,
}

/// (high +- low) scale. The output is a parameter: the compiler then knows that it overlaps nothing.
#[inline(always)]
fn pair(out: &mut [Real], high: &[Real], low: &[Real], scale: Real, sum: bool, add: bool) {
    let n = out.len();
    let (high, low) = (&high[..n], &low[..n]);
    match (sum, add) {
        (false, false) => {
            for i in 0..n {
                out[i] = (high[i] - low[i]) * scale;
            }
        }
        (false, true) => {
            for i in 0..n {
                out[i] += (high[i] - low[i]) * scale;
            }
        }
        (true, false) => {
            for i in 0..n {
                out[i] = (high[i] + low[i]) * scale;
            }
        }
        (true, true) => {
            for i in 0..n {
                out[i] += (high[i] + low[i]) * scale;
            }
        }
    }
}

impl Kernel for Pair<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, _: W) {
        pair(self.out, self.high, self.low, self.scale, self.sum, self.add);
    }
}

/// The sum of the terms, in their order; places are the caller's business.
pub fn combine(out: &mut Field, terms: &[Term]) {
    each_row(out, |j, k, row| {
        let (mut above, mut below) = (Vec::new(), Vec::new());
        for (t, term) in terms.iter().enumerate() {
            let (f, axis) = (term.of, term.axis);
            let (high, low): (isize, isize) = match term.kind {
                Combination::Central => (1, -1),
                _ if f.grid.on_walls(f.place, axis) => (1, 0),
                _ => (0, -1),
            };
            let (scale, sum, add) = (term.scale as Real, term.kind == Combination::Average, t > 0);
            let (j, k) = (j as isize, k as isize);
            if axis != 0 {
                let at = |m: isize| if axis == 1 { (j + m, k) } else { (j, k + m) };
                let (high, low) = (fetch(f, at(high).0, at(high).1, &mut above), fetch(f, at(low).0, at(low).1, &mut below));
                dispatch(Pair { out: row, high, low, scale, sum, add });
                continue;
            }
            let (n, points) = (row.len() as isize, f.points()[0] as isize);
            let (first, last) = ((-low).clamp(0, n), (points - high).clamp(0, n));
            for i in (0..first).chain(last.max(first)..n) {
                let (h, l) = (ghosted(f, [i + high, j, k]), ghosted(f, [i + low, j, k]));
                pair(&mut row[i as usize..=i as usize], &[h], &[l], scale, sum, add);
            }
            if first < last {
                let from = fetch(f, j, k, &mut above);
                let (high, low) = (&from[(first + high) as usize..], &from[(first + low) as usize..]);
                dispatch(Pair { out: &mut row[first as usize..last as usize], high, low, scale, sum, add });
            }
        }
    });
}

struct Curvature<'a> {
    out: &'a mut [Real],
    c: &'a [Real],
    /// The rows below and above along each axis but x.
    rows: [[&'a [Real]; 2]; 2],
    /// Whether there is x, how many of the rows there are.
    axes: (bool, usize),
    keep: bool,
    scale: Real,
}

/// keep c + scale sum over axes of (above - c) - (c - below); c has a number more on each side than `out` where there is x.
#[inline(always)]
fn curvature<const X: bool, const ROWS: usize, const KEEP: bool>(
    out: &mut [Real],
    c: &[Real],
    [[a0, b0], [a1, b1]]: [[&[Real]; 2]; 2],
    scale: Real,
) {
    let n = out.len();
    let side = usize::from(X);
    let (low, c, high) = (&c[..n], &c[side..side + n], &c[2 * side..2 * side + n]);
    let (a0, b0) = (&a0[..n], &b0[..n]);
    let (a1, b1) = if ROWS > 1 { (&a1[..n], &b1[..n]) } else { (a0, b0) };
    for i in 0..n {
        let mut sum = if X { (high[i] - c[i]) - (c[i] - low[i]) } else { 0.0 };
        sum += (b0[i] - c[i]) - (c[i] - a0[i]);
        if ROWS > 1 {
            sum += (b1[i] - c[i]) - (c[i] - a1[i]);
        }
        out[i] = if KEEP { c[i] + scale * sum } else { scale * sum };
    }
}

impl Kernel for Curvature<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, _: W) {
        let Self { out, c, rows, scale, .. } = self;
        match (self.axes, self.keep) {
            ((true, 1), false) => curvature::<true, 1, false>(out, c, rows, scale),
            ((true, 1), true) => curvature::<true, 1, true>(out, c, rows, scale),
            ((true, _), false) => curvature::<true, 2, false>(out, c, rows, scale),
            ((true, _), true) => curvature::<true, 2, true>(out, c, rows, scale),
            ((false, _), false) => curvature::<false, 2, false>(out, c, rows, scale),
            ((false, _), true) => curvature::<false, 2, true>(out, c, rows, scale),
        }
    }
}

/// out = keep f + scale (sum of second differences), at the same place.
pub fn second(out: &mut Field, f: &Field, keep: bool, scale: f64) {
    let others: Vec<usize> = f.grid.axes().filter(|a| *a != 0).collect();
    let axes = (f.grid.flat != Some(0), others.len());
    let scale = scale as Real;
    let (points, lattice) = (f.points(), f.grid.lattice());
    let inside = |j: isize, k: isize| (0..points[1] as isize).contains(&j) && (0..points[2] as isize).contains(&k);
    // Sources of the neighbours of the first and the last point along x.
    let ends = [reach(f, 0, -1), reach(f, 0, points[0] as isize)];
    each_row(out, |j, k, row| {
        let (j, k) = (j as isize, k as isize);
        let mut scratch: [Vec<Real>; 5] = Default::default();
        let [own, others_scratch @ ..] = &mut scratch;
        let c = fetch(f, j, k, own);
        let mut rows: [[&[Real]; 2]; 2] = [[c; 2]; 2];
        for (s, made) in others_scratch.iter_mut().enumerate() {
            let Some(axis) = others.get(s / 2) else { break };
            let m = 2 * (s % 2) as isize - 1;
            let (j, k) = if *axis == 1 { (j + m, k) } else { (j, k + m) };
            rows[s / 2][s % 2] = if inside(j, k) {
                let start = lattice.at(0, j as usize, k as usize);
                &f.data[start..start + points[0]]
            } else {
                fetch(f, j, k, made)
            };
        }
        let n = row.len();
        if !axes.0 {
            return dispatch(Curvature { out: row, c, rows, axes, keep, scale });
        }
        for i in [0, n - 1] {
            let end = |r: Reach| r.ghost.map_or(c[r.from], |(a, b)| a + b * c[r.from]);
            let low = if i == 0 { end(ends[0]) } else { c[i - 1] };
            let high = if i + 1 == n { end(ends[1]) } else { c[i + 1] };
            let three = [low, c[i], high];
            let one = |r: [&'_ [Real]; 2]| -> [Real; 2] { [r[0][i], r[1][i]] };
            let [a, b] = [one(rows[0]), one(rows[1])];
            let rows = [[&a[..1], &a[1..]], [&b[..1], &b[1..]]];
            Curvature { out: &mut row[i..=i], c: &three, rows, axes, keep, scale }.run(crate::math::simd::Scalar);
        }
        if n > 2 {
            let inner = |r: &'_ [Real]| -> std::ops::Range<usize> { 1..r.len() - 1 };
            let rows = [[&rows[0][0][inner(c)], &rows[0][1][inner(c)]], [&rows[1][0][inner(c)], &rows[1][1][inner(c)]]];
            dispatch(Curvature { out: &mut row[1..n - 1], c, rows, axes, keep, scale });
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::{Grid, Place};

    #[test]
    fn ghosts_are_images_in_the_wall() {
        let grid = Grid::new([4, 3, 1], 0.5, [0.0; 3]).and_then(|g| g.flat(2)).unwrap();
        let at = |place, side, i| {
            let f = Field::of(grid, place, "", |x| 1.0 + x[0]).unwrap().sides(side);
            f64::from(ghosted(&f, [i, 1, 0]))
        };
        // Cells at 0.25, 0.75, ...; their values 1.25, 1.75, 2.25, 2.75.
        assert_eq!(at(Place::Cell, Side::Closed, -1), 1.25);
        assert_eq!(at(Place::Cell, Side::Closed, -2), 1.75);
        assert_eq!(at(Place::Cell, Side::Slope(-1.0), -2), 0.25);
        assert_eq!(at(Place::Cell, Side::Slope(1.0), 5), 3.75);
        assert_eq!(at(Place::Cell, Side::Value(1.0), -1), 0.75);
        assert_eq!(at(Place::Cell, Side::Ghost(7.0), 4), 7.0);
        // Faces at 0, 0.5, ..., 2; the wall's own point is its own image.
        assert_eq!(at(Place::Face(0), Side::Closed, -1), 1.5);
        assert_eq!(at(Place::Face(0), Side::Value(1.0), -1), 0.5);
        assert_eq!(at(Place::Face(0), Side::Value(3.0), 5), 3.5);
        assert_eq!(at(Place::Face(0), Side::Slope(1.0), 6), 4.0);
    }
}
