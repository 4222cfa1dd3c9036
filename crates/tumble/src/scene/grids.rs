//! Boxes of cells, and functions of place on them.

use crate::math::formula::{Formula, Of};
use crate::math::parallel::rows;
use crate::math::{Real, Vec3};
use crate::state::{Grid, GridError, Place};
use tumble_interface::scene::{Component, GridBox};

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

/// Cells of a box with their ghosts, for estimates of memory.
pub fn cells(words: &GridBox, flat: Option<usize>) -> f64 {
    let long = (0..3).filter(|a| flat != Some(*a)).map(|a| words.size[a]).fold(0.0, f64::max);
    let along = |a: usize| if flat == Some(a) { 3.0 } else { (words.size[a] / long * f64::from(words.resolution)).round() + 2.0 };
    along(0) * along(1) * along(2)
}

/// A function of place.
pub enum Map {
    /// The same everywhere.
    Value(f64),
    /// A formula of x, y, z.
    Formula(Formula),
}

impl Map {
    /// From its words, or what is wrong with them.
    pub fn new(words: &Component) -> Result<Self, String> {
        Ok(match words {
            Component::Value(value) => Self::Value(*value),
            Component::Formula(text) => Self::Formula(Formula::new(text, 1, Of::Start)?),
        })
    }

    /// Its value at a place [m].
    pub fn at(&self, x: [f64; 3]) -> f64 {
        match self {
            Self::Value(value) => *value,
            Self::Formula(formula) => formula.at(0.0, Vec3::from(x), Vec3::default())[0],
        }
    }
}

/// The middle of a cell [m]; in a plane, on it.
pub fn middle(grid: &Grid, at: [usize; 3]) -> [f64; 3] {
    let mut x = grid.point(Place::Cell, at);
    if let Some(flat) = grid.flat {
        x[flat] = grid.origin[flat];
    }
    x
}

/// Sets every cell of a column.
pub fn fill(grid: &Grid, column: &mut [Real], value: impl Fn([usize; 3]) -> f64 + Sync) {
    let l = grid.lattice();
    rows(&mut column[l.at(0, 0, 0)..], l.stride[1], |r, row| {
        let (j, k) = (r % (l.n[1] + 2), r / (l.n[1] + 2));
        if j < l.n[1] && k < l.n[2] {
            for (i, out) in row[..l.n[0]].iter_mut().enumerate() {
                *out = value([i, j, k]) as Real;
            }
        }
    });
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
