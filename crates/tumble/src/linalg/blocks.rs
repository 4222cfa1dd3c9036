//! Symmetric 3 x 3 blocks on a diagonal, as columns.

use crate::math::simd::{Kernel, Width, dispatch, packs};
use crate::math::{Real, Row};

/// A symmetric 3 x 3 matrix: xx, yy, zz, xy, yz, zx.
pub type Block = [Real; 6];

/// One block per row.
#[derive(Debug, Clone, Default)]
pub struct Blocks {
    columns: [Vec<Real>; 6],
}

impl Blocks {
    /// Takes over these blocks.
    pub fn set(&mut self, blocks: &[Block]) {
        for (c, column) in self.columns.iter_mut().enumerate() {
            column.clear();
            column.extend(blocks.iter().map(|b| b[c]));
        }
    }

    /// out = B u for the rows from `start` on.
    pub fn multiply(&self, start: usize, u: &[Row], out: &mut [Row]) {
        assert_eq!(u.len(), out.len());
        dispatch(Multiply { blocks: self, start, u, out });
    }
}

struct Multiply<'a> {
    blocks: &'a Blocks,
    start: usize,
    u: &'a [Row],
    out: &'a mut [Row],
}

impl Kernel for Multiply<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        packs!(W, w, (0..self.u.len()), |i| {
            let [x, y, z, _] = w.rows(self.u, i);
            let mut b = [x; 6];
            for c in 0..6 {
                b[c] = w.load(&self.blocks.columns[c][self.start + i..]);
            }
            let [xx, yy, zz, xy, yz, zx] = b;
            let product = [xx * x + xy * y + zx * z, xy * x + yy * y + yz * z, zx * x + yz * y + zz * z, w.splat(0.0)];
            w.scatter(product, self.out, i, 1);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::simd::{Level, dispatch_at};

    #[test]
    fn every_width_multiplies_alike() {
        let n = 37;
        let list: Vec<Block> = (0..n).map(|i| std::array::from_fn(|c| (i * 6 + c) as Real * 0.1 - 3.0)).collect();
        let u: Vec<Row> = (0..n).map(|i| [1.0 + i as Real, -0.5 * i as Real, 2.0, 7.0]).collect();
        let mut blocks = Blocks::default();
        blocks.set(&list);
        for level in Level::available() {
            let mut out = vec![[9.0; 4]; n - 5];
            dispatch_at(level, Multiply { blocks: &blocks, start: 5, u: &u[5..], out: &mut out });
            for (i, o) in out.iter().enumerate() {
                let ([xx, yy, zz, xy, yz, zx], [x, y, z, _]) = (list[5 + i], u[5 + i]);
                assert_eq!(*o, [xx * x + xy * y + zx * z, xy * x + yy * y + yz * z, zx * x + yz * y + zz * z, 0.0], "{level:?}");
            }
        }
    }
}
