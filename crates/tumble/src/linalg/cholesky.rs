//! Sparse Cholesky factorization of block matrices, by faer, in double precision and on one thread. The symbolic part
//! is kept while the pattern stays the same. Bits depend on the machine's instruction set.

use crate::math::{Real, Row};
use faer::prelude::Solve;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Col, Side};

/// A symmetric matrix of 3 x 3 blocks under construction: entries at the same place add up.
#[derive(Debug, Clone)]
pub struct Assembly {
    rows: usize,
    triplets: Vec<Triplet<usize, usize, f64>>,
}

impl Assembly {
    /// A matrix over so many rows of three numbers.
    pub fn new(rows: usize) -> Self {
        Self { rows, triplets: Vec::new() }
    }

    /// Adds a block; of the two triangles only the lower one is used.
    pub fn add(&mut self, row: usize, column: usize, block: [[f64; 3]; 3]) {
        if row < column {
            return;
        }
        for (a, values) in block.iter().enumerate() {
            for (b, value) in values.iter().enumerate() {
                let (i, j) = (3 * row + a, 3 * column + b);
                if i >= j {
                    self.triplets.push(Triplet::new(i, j, *value));
                }
            }
        }
    }
}

/// A factorization, and what of it can be used again.
#[derive(Default)]
pub struct Cholesky {
    symbolic: Option<(Vec<usize>, Vec<usize>, SymbolicLlt<usize>)>,
    factor: Option<Llt<usize, f64>>,
}

/// The matrix is not positive definite, or too large to factorize.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotDefinite;

impl Cholesky {
    /// Factorizes.
    pub fn factorize(&mut self, assembly: &Assembly) -> Result<(), NotDefinite> {
        let n = 3 * assembly.rows;
        self.factor = None;
        let matrix = SparseColMat::try_new_from_triplets(n, n, &assembly.triplets).map_err(|_| NotDefinite)?;
        let pattern = matrix.symbolic();
        let same = self.symbolic.as_ref().is_some_and(|(columns, rows, _)| columns == pattern.col_ptr() && rows == pattern.row_idx());
        if !same {
            let symbolic = SymbolicLlt::try_new(pattern, Side::Lower).map_err(|_| NotDefinite)?;
            self.symbolic = Some((pattern.col_ptr().to_vec(), pattern.row_idx().to_vec(), symbolic));
        }
        let Some((_, _, symbolic)) = &self.symbolic else { return Err(NotDefinite) };
        self.factor = Some(Llt::try_new_with_symbolic(symbolic.clone(), matrix.as_ref(), Side::Lower).map_err(|_| NotDefinite)?);
        Ok(())
    }

    /// Solves A x = b with the last factorization; x = 0 if there is none.
    pub fn solve(&self, b: &[Row], x: &mut [Row]) {
        let Some(factor) = &self.factor else { return x.fill([0.0; 4]) };
        let rhs = Col::from_fn(3 * b.len(), |i| f64::from(b[i / 3][i % 3]));
        let solution = factor.solve(&rhs);
        for (i, x) in x.iter_mut().enumerate() {
            *x = [solution[3 * i] as Real, solution[3 * i + 1] as Real, solution[3 * i + 2] as Real, 0.0];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_solves_what_it_factorized_and_refuses_an_indefinite_matrix() {
        let mut cholesky = Cholesky::default();
        for scale in [1.0, 2.0] {
            let mut a = Assembly::new(3);
            let unit = |c: f64| [[c, 0.1, 0.0], [0.1, c, 0.2], [0.0, 0.2, c]];
            for i in 0..3 {
                a.add(i, i, unit(4.0 * scale));
                if i > 0 {
                    a.add(i, i - 1, unit(-scale));
                    a.add(i - 1, i, unit(-scale));
                }
            }
            cholesky.factorize(&a).unwrap();
            let x = [[1.0, 2.0, 3.0, 0.0], [-1.0, 0.5, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
            let mut b = [[0.0; 4]; 3];
            for i in 0..3_usize {
                for j in 0..3 {
                    let block = match i.abs_diff(j) {
                        0 => unit(4.0 * scale),
                        1 => unit(-scale),
                        _ => [[0.0; 3]; 3],
                    };
                    for r in 0..3 {
                        for c in 0..3 {
                            b[i][r] += block[r][c] as Real * x[j][c];
                        }
                    }
                }
            }
            let mut found = [[0.0; 4]; 3];
            cholesky.solve(&b, &mut found);
            for i in 0..3 {
                for c in 0..3 {
                    assert!((found[i][c] - x[i][c]).abs() < 1e-5, "{found:?}");
                }
            }
        }
        let mut bad = Assembly::new(1);
        bad.add(0, 0, [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(cholesky.factorize(&bad), Err(NotDefinite));
    }
}
