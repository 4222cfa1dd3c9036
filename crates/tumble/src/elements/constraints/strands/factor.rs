//! Cholesky's factorization of a matrix of blocks of 3 x 3 of which each row couples to the next two, a row at a time.

use crate::math::{Lane, Vec3};

/// A block of the matrix.
pub type Block<L> = [[L; 3]; 3];

/// One row of blocks of the factor, and what stands on the right side.
#[derive(Clone, Copy)]
pub struct Factor<L> {
    /// Inverse diagonal, and what is below it: 00, 11, 22, 10, 20, 21. Free for other numbers once y is solved.
    pub own: [L; 6],
    /// The blocks one and two to the left.
    left: [Block<L>; 2],
    /// The right side, then dlambda.
    pub y: [L; 3],
}

/// Nothing.
#[inline(always)]
pub fn zeros<L: Lane>(l: L) -> Block<L> {
    [[l.zero(); 3]; 3]
}

/// a b^T c.
#[inline(always)]
pub fn by_transposed<L: Lane>(a: Block<L>, b: Block<L>, c: L) -> Block<L> {
    let mut out = zeros(c);
    for i in 0..3 {
        for j in 0..3 {
            out[i][j] = (a[i][0] * b[j][0] + a[i][1] * b[j][1] + a[i][2] * b[j][2]) * c;
        }
    }
    out
}

/// a - b.
#[inline(always)]
pub fn minus<L: Lane>(a: Block<L>, b: Block<L>) -> Block<L> {
    let mut out = a;
    for i in 0..3 {
        for j in 0..3 {
            out[i][j] = a[i][j] - b[i][j];
        }
    }
    out
}

/// [v]x with its rows scaled: S [v]x.
#[inline(always)]
pub fn cross<L: Lane>(s: [L; 3], v: Vec3<L>) -> Block<L> {
    let o = v.x.zero();
    [[o, -(s[0] * v.z), s[0] * v.y], [s[1] * v.z, o, -(s[1] * v.x)], [-(s[2] * v.y), s[2] * v.x, o]]
}

/// 1/sqrt(p), 0 for what is not above 0.
#[inline(always)]
pub fn inverse_root<L: Lane>(p: L) -> L {
    let one = p.like(1.0);
    p.positive(one / p.positive(p, one).sqrt(), p.zero())
}

impl<L: Lane> Factor<L> {
    /// A row of nothing, as before the first and behind the last.
    #[inline(always)]
    pub fn none(zero: L) -> Self {
        Self { own: [zero; 6], left: [zeros(zero); 2], y: [zero; 3] }
    }

    /// The next row from the matrix's blocks, the right side and the two rows before.
    #[inline(always)]
    pub fn next(diagonal: Block<L>, left: [Block<L>; 2], right: [L; 3], before: [&Self; 2]) -> Self {
        let far = before[1].solve_rows(left[1]);
        let near = before[0].solve_rows(minus(left[0], by_transposed(far, before[0].left[0], right[0].like(1.0))));
        let one = right[0].like(1.0);
        let d = minus(minus(diagonal, by_transposed(far, far, one)), by_transposed(near, near, one));
        let i0 = inverse_root(d[0][0]);
        let (l10, l20) = (d[1][0] * i0, d[2][0] * i0);
        let i1 = inverse_root(d[1][1] - l10 * l10);
        let l21 = (d[2][1] - l20 * l10) * i1;
        let i2 = inverse_root(d[2][2] - l20 * l20 - l21 * l21);
        let mut y = right;
        for r in 0..3 {
            for c in 0..3 {
                y[r] = y[r] - near[r][c] * before[0].y[c] - far[r][c] * before[1].y[c];
            }
        }
        y[0] = y[0] * i0;
        y[1] = (y[1] - l10 * y[0]) * i1;
        y[2] = (y[2] - l20 * y[0] - l21 * y[1]) * i2;
        Self { own: [i0, i1, i2, l10, l20, l21], left: [near, far], y }
    }

    /// a G^-T, where G G^T is the block on the diagonal.
    #[inline(always)]
    fn solve_rows(&self, a: Block<L>) -> Block<L> {
        let [i0, i1, i2, l10, l20, l21] = self.own;
        let mut out = a;
        for r in 0..3 {
            out[r][0] = a[r][0] * i0;
            out[r][1] = (a[r][1] - out[r][0] * l10) * i1;
            out[r][2] = (a[r][2] - out[r][0] * l20 - out[r][1] * l21) * i2;
        }
        out
    }

    /// Takes what the next rows have found off y and solves G^T.
    #[inline(always)]
    pub fn back(&mut self, next: [&Self; 2]) {
        let [i0, i1, i2, l10, l20, l21] = self.own;
        let mut y = self.y;
        for c in 0..3 {
            for r in 0..3 {
                y[c] = y[c] - next[0].left[0][r][c] * next[0].y[r] - next[1].left[1][r][c] * next[1].y[r];
            }
        }
        y[2] = y[2] * i2;
        y[1] = (y[1] - l21 * y[2]) * i1;
        y[0] = (y[0] - l10 * y[1] - l20 * y[2]) * i0;
        self.y = y;
    }
}

/// a + b.
#[inline(always)]
pub fn plus<L: Lane>(mut a: Block<L>, b: Block<L>) -> Block<L> {
    for i in 0..3 {
        for j in 0..3 {
            a[i][j] = a[i][j] + b[i][j];
        }
    }
    a
}

/// a^T y.
#[inline(always)]
pub fn pulled<L: Lane>(a: Block<L>, y: [L; 3]) -> Vec3<L> {
    Vec3 {
        x: a[0][0] * y[0] + a[1][0] * y[1] + a[2][0] * y[2],
        y: a[0][1] * y[0] + a[1][1] * y[1] + a[2][1] * y[2],
        z: a[0][2] * y[0] + a[1][2] * y[1] + a[2][2] * y[2],
    }
}
