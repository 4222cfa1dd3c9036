//! Blocks of 16 cells, in which rows and the weights of their faces are worked on.

use crate::math::Real;

/// Cells of a block: the widest register.
pub(super) const LANES: usize = 16;

/// Numbers of a block of cells.
pub(super) type Block = [Real; LANES];

/// The blocks of a row.
#[inline(always)]
pub(super) fn blocks(row: &[Real]) -> &[Block] {
    row.as_chunks().0
}
