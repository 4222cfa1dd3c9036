//! Functions of place on grids.

use crate::math::formula::{Formula, Of};
use crate::math::parallel::rows;
use crate::math::{Real, Vec3};
use crate::state::{Grid, Place};
use tumble_interface::scene::Component;

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
            Component::Formula(text) => Self::Formula(Formula::new(text, 1, Of::Place)?),
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
