//! Fields in spare columns.

use super::field::Field;
use super::grid::{Grid, GridError, Place};
use crate::math::column::Spare;
use std::borrow::Cow;

impl Spare {
    /// A field between closed walls.
    pub fn field(&mut self, grid: Grid, place: Place, unit: impl Into<Cow<'static, str>>) -> Result<Field, GridError> {
        Field::over(grid, place, unit, self.column(grid.lattice().len()))
    }

    /// Takes the column of a field. What lies on upper walls is among the ghosts of cells.
    pub fn keep(&mut self, mut field: Field) {
        let (points, n) = (field.points(), field.grid.n);
        for axis in (0..3).filter(|a| points[*a] > n[*a]) {
            let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
            for (p, q) in (0..points[a]).flat_map(|p| (0..points[b]).map(move |q| (p, q))) {
                let mut at = [0; 3];
                (at[axis], at[a], at[b]) = (n[axis], p, q);
                let i = field.index(at);
                field.data[i] = 0.0;
            }
        }
        self.give(field.data);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_back_has_zeros_beyond_the_cells() {
        let grid = Grid::new([5, 4, 3], 0.1, [0.0; 3]).unwrap();
        let mut spare = Spare::default();
        let cells: Vec<usize> = Field::new(grid, Place::Cell, "").map(|f| f.each().map(|at| f.index(at)).collect()).unwrap();
        for place in [Place::Cell, Place::Face(0), Place::Face(1), Place::Face(2), Place::Node] {
            let mut field = spare.field(grid, place, "").unwrap();
            field.each().for_each(|at| {
                let i = field.index(at);
                field.data[i] = f64::NAN as crate::math::Real;
            });
            spare.keep(field);
            let column = spare.column(grid.lattice().len());
            assert!(column.iter().enumerate().all(|(i, x)| *x == 0.0 || cells.contains(&i)), "{place}");
            assert!(column.iter().any(|x| x.is_nan()));
            spare.give(column);
        }
    }
}
