//! Boxes of cells.

use crate::state::{Grid, GridError};
use tumble_interface::scene::GridBox;

/// The grid of a box; `flat` is the axis across the plane of a scene of two dimensions.
pub fn grid(words: &GridBox, flat: Option<usize>, periodic: [bool; 3]) -> Result<Grid, GridError> {
    let long = (0..3).filter(|a| flat != Some(*a)).map(|a| words.size[a]).fold(0.0, f64::max);
    let dx = long / f64::from(words.resolution);
    // A side that is not a number, or far too long, becomes one that Grid::new refuses.
    let cells = |a: usize| if flat == Some(a) { 1 } else { (words.size[a] / dx).round().max(1.0) as usize };
    let n: [usize; 3] = std::array::from_fn(cells);
    let half = |a: usize| if flat == Some(a) { 0.0 } else { 0.5 * n[a] as f64 * dx };
    let grid = Grid::new(n, dx, std::array::from_fn(|a| words.center[a] - half(a)))?;
    Ok(flat.map_or(Ok(grid), |a| grid.flat(a))?.periodic(periodic))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_cubes_around_the_middle() {
        let words = GridBox { size: [1.0, 2.0, 0.55], center: [0.5, 1.0, 3.0], resolution: 20 };
        let space = grid(&words, None, [false; 3]).unwrap();
        assert_eq!((space.n, space.dx, space.origin), ([10, 20, 6], 0.1, [0.0, 0.0, 2.7]));
        let plane = grid(&words, Some(1), [true, true, false]).unwrap();
        assert_eq!((plane.n, plane.flat, plane.periodic), ([20, 1, 11], Some(1), [true, false, false]));
        assert_eq!((plane.dx, plane.origin[1]), (0.05, 1.0));
        assert!(grid(&GridBox { size: [1.0, 1e9, 1.0], ..words }, None, [false; 3]).is_ok_and(|g| g.n == [1, 20, 1]));
    }
}
