//! Preconditioned conjugate gradients on rows, without a matrix.
//!
//! Vectors are in the engine's scalar, all products in double precision over fixed chunks, so that the iterates have the
//! same bits on any number of threads. Source: [shewchuk1994], B3; negative curvature: [nocedal2006], 7.1.

use crate::math::parallel::{CHUNK, Tasks, chunk_sum, chunks, sum};
use crate::math::{Real, Row, ZERO, rows};

/// A symmetric operator and its preconditioner, chunk by chunk: `start` is a multiple of CHUNK.
pub trait Operator {
    /// Prepares the product with u.
    fn begin(&mut self, _u: &[Row]) {}
    /// out = A u on the rows from `start` on; u is as begun with.
    fn apply(&self, u: &[Row], start: usize, out: &mut [Row]);
    /// out = an approximation of A^-1 r on the rows from `start` on.
    fn precondition(&self, start: usize, r: &[Row], out: &mut [Row]);
}

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Residual over right-hand side, in the norm of the preconditioner.
    pub tolerance: f64,
    /// Iterations at most.
    pub iterations: usize,
}

/// How it ended.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Info {
    /// Iterations made.
    pub iterations: usize,
    /// Residual over right-hand side, in the norm of the preconditioner, by recursion.
    pub residual: f64,
    /// Whether it met a direction of negative curvature; the solution is then that of the iteration before, or the
    /// preconditioned right-hand side if there was none.
    pub indefinite: bool,
}

/// Vectors of a solve, kept between solves.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    r: Vec<Row>,
    p: Vec<Row>,
    q: Vec<Row>,
}

/// Solves A x = b from x = 0.
pub fn solve(operator: &mut (impl Operator + Sync), b: &[Row], x: &mut [Row], params: Params, work: &mut Workspace) -> Info {
    let n = b.len();
    for column in [&mut work.r, &mut work.p, &mut work.q] {
        column.clear();
        column.resize(n, ZERO);
    }
    let Workspace { r, p, q } = work;
    x.fill(ZERO);
    r.copy_from_slice(b);
    chunks(p, |start, p| operator.precondition(start, &b[start..start + p.len()], p));
    let first = sum(n, |range| rows::dot(&r[range.clone()], &p[range]));
    let mut info = Info { residual: 1.0, ..Info::default() };
    let mut rz = first;
    if first.is_nan() || first <= 0.0 {
        info.residual = 0.0;
        return info;
    }
    while info.iterations < params.iterations {
        operator.begin(p);
        let (direction, a) = (&p[..], &*operator);
        let curvature = chunk_sum(q, |start, q| {
            a.apply(direction, start, q);
            rows::dot(&direction[start..start + q.len()], q)
        });
        if curvature.is_nan() || curvature <= 0.0 {
            info.indefinite = true;
            if info.iterations == 0 {
                x.copy_from_slice(p);
            }
            return info;
        }
        let alpha = (rz / curvature) as Real;
        let after = update(operator, alpha, x, r, p, q);
        info.iterations += 1;
        info.residual = (after / first).sqrt();
        if info.residual <= params.tolerance || after.is_nan() {
            return info;
        }
        // q holds the preconditioned residual now.
        let beta = (after / rz) as Real;
        rz = after;
        let z = &*q;
        chunks(p, |start, p| rows::xpby(p, beta, &z[start..start + p.len()]));
    }
    info
}

/// x += alpha p, r -= alpha q, q = preconditioned r; returns r . q. One pass over memory.
fn update(operator: &(impl Operator + Sync), alpha: Real, x: &mut [Row], r: &mut [Row], p: &[Row], q: &mut [Row]) -> f64 {
    let parts: Vec<f64> =
        x.chunks_mut(CHUNK).zip(r.chunks_mut(CHUNK)).zip(p.chunks(CHUNK).zip(q.chunks_mut(CHUNK))).enumerate().map_in_parallel(
            |(c, ((x, r), (p, q)))| {
                rows::axpy(x, alpha, p);
                rows::axpy(r, -alpha, q);
                operator.precondition(c * CHUNK, r, q);
                rows::dot(r, q)
            },
        );
    parts.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// -u'' on a line with fixed ends, a different stiffness for each of the three components.
    struct Line(usize);

    impl Operator for Line {
        fn apply(&self, u: &[Row], _start: usize, out: &mut [Row]) {
            for i in 0..self.0 {
                for c in 0..3 {
                    let at = |j: usize| if j < self.0 { u[j][c] } else { 0.0 };
                    out[i][c] = (c + 1) as Real * (2.0 * u[i][c] - at(i.wrapping_sub(1)) - at(i + 1));
                }
            }
        }
        fn precondition(&self, _: usize, r: &[Row], out: &mut [Row]) {
            for (o, r) in out.iter_mut().zip(r) {
                *o = [r[0] / 2.0, r[1] / 4.0, r[2] / 6.0, 0.0];
            }
        }
    }

    #[test]
    fn it_solves_the_discrete_parabola() {
        let n = 50;
        let b = vec![[1.0, 1.0, 1.0, 0.0]; n];
        let mut x = vec![ZERO; n];
        let params = Params { tolerance: 1e-6, iterations: 200 };
        let info = solve(&mut Line(n), &b, &mut x, params, &mut Workspace::default());
        assert!(info.iterations <= 55 && info.residual <= 1e-6, "{info:?}");
        for i in 0..n {
            for c in 0..3 {
                let exact = (i + 1) as f64 * (n - i) as f64 / 2.0 / (c + 1) as f64;
                assert!((f64::from(x[i][c]) - exact).abs() < 2e-3 * exact.max(1.0));
            }
        }
        let cut = solve(&mut Line(n), &b, &mut x, Params { tolerance: 1e-6, iterations: 3 }, &mut Workspace::default());
        assert!(cut.iterations == 3 && cut.residual > 1e-3);
    }

    struct Indefinite;

    impl Operator for Indefinite {
        fn apply(&self, u: &[Row], _start: usize, out: &mut [Row]) {
            out[0] = [-u[0][0], u[0][1], u[0][2], 0.0];
        }
        fn precondition(&self, _: usize, r: &[Row], out: &mut [Row]) {
            out.copy_from_slice(r);
        }
    }

    #[test]
    fn negative_curvature_is_reported() {
        let mut x = vec![ZERO];
        let info =
            solve(&mut Indefinite, &[[1.0, 0.0, 0.0, 0.0]], &mut x, Params { tolerance: 1e-6, iterations: 9 }, &mut Workspace::default());
        assert!(info.indefinite);
        assert_eq!(x[0], [1.0, 0.0, 0.0, 0.0]);
    }
}
