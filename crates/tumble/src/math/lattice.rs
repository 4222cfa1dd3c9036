//! Memory layout of grids.

/// The layout of numbers at the cells, faces, edges or nodes of a grid of n[0] x n[1] x n[2] cells, x fastest: one layout for all
/// places, so that cell (i, j, k) and its lower faces, edges and node have one number.
///
/// ```text
///   FRONT | ghost plane | ghost row | cells 0 .. n[0] - 1 of row j = 0, pad | row 1 ... | ghost row | ... | ghost plane
/// ```
///
/// A row holds at least one number more than cells: the upper face of its last cell, and the ghost that it shares with the row
/// behind it. Rows are multiples of 16 numbers, so that all start alike in registers; those of 128 or 256 cells are no power of
/// two long and do not fall on the same lines of the caches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lattice {
    /// Cells along each axis.
    pub n: [usize; 3],
    /// From a number to that of the next cell along each axis.
    pub stride: [usize; 3],
}

/// Numbers in front of all others, so that the first row starts like every other one and has a ghost before it.
const FRONT: usize = 16;

impl Lattice {
    /// The layout for n cells.
    pub fn new(n: [usize; 3]) -> Self {
        let row = (n[0] + 1).next_multiple_of(16);
        Self { n, stride: [1, row, row * (n[1] + 2)] }
    }

    /// How many numbers there are, ghosts and pads included.
    pub fn len(&self) -> usize {
        FRONT + self.stride[2] * (self.n[2] + 2)
    }

    /// Whether there are no cells.
    pub fn is_empty(&self) -> bool {
        self.cells() == 0
    }

    /// How many cells there are.
    pub fn cells(&self) -> usize {
        self.n.iter().product()
    }

    /// The number of cell (i, j, k), or of its lower faces, edges and node; i <= n[0] and so on.
    #[inline(always)]
    pub fn at(&self, i: usize, j: usize, k: usize) -> usize {
        FRONT + i + self.stride[1] * (j + 1) + self.stride[2] * (k + 1)
    }

    /// The inverse of [`Lattice::at`].
    pub fn place(&self, number: usize) -> [usize; 3] {
        let (n, [_, row, plane]) = (number - self.at(0, 0, 0), self.stride);
        [n % row, n % plane / row, n / plane]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_lie_a_stride_away_and_inside() {
        let l = Lattice::new([5, 3, 2]);
        assert_eq!(l.at(3, 2, 1) - l.at(2, 2, 1), l.stride[0]);
        assert_eq!(l.at(3, 2, 1) - l.at(3, 1, 1), l.stride[1]);
        assert_eq!(l.at(3, 2, 1) - l.at(3, 2, 0), l.stride[2]);
        assert!(l.at(0, 0, 0) >= l.stride[2] && l.at(5, 3, 2) < l.len());
        // The upper face of a row's last cell is no number of the next row.
        assert!(l.at(5, 0, 0) < l.at(0, 1, 0));
        assert_eq!(l.at(0, 1, 1) % 16, 0);
        assert_eq!(l.place(l.at(5, 3, 2)), [5, 3, 2]);
    }
}
