//! Numbers on a grid that know their place.

use super::grid::{Grid, GridError, Place};
use crate::math::{Column, Real};
use std::borrow::Cow;

/// Boundary condition of a field beyond a wall of its grid; periodic axes have no walls. Values c are mirrored in the wall, at distance s
/// from their image:
///
/// ```text
///   Closed    ghost = c               Value(v)   ghost = 2 v - c                  (grids.2)
///   Slope(g)  ghost = c + g s         Ghost(v)   ghost = v
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Side {
    /// No slope across the wall: an insulating, or for a velocity along it a slippery wall.
    #[default]
    Closed,
    /// A slope along the outward normal.
    Slope(f64),
    /// A value at the wall itself.
    Value(f64),
    /// A value at the points beyond: an open side.
    Ghost(f64),
}

/// The lower and the upper side of each axis.
pub type Sides = [[Side; 2]; 3];

/// Numbers at one place of a grid. Pads and ghosts of its layout hold nothing: operators make what they need beyond a wall from
/// `sides`.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// The grid.
    pub grid: Grid,
    /// Location of the numbers.
    pub place: Place,
    /// Boundary conditions.
    pub sides: Sides,
    /// SI unit.
    pub unit: Cow<'static, str>,
    /// The numbers, as `grid.lattice()` lays them out.
    pub data: Column,
}

impl Field {
    /// Zeros between closed walls.
    pub fn new(grid: Grid, place: Place, unit: impl Into<Cow<'static, str>>) -> Result<Self, GridError> {
        Self::over(grid, place, unit, Column::zeros(grid.lattice().len()))
    }

    /// A field over a column of the lattice's length, between closed walls.
    pub fn over(grid: Grid, place: Place, unit: impl Into<Cow<'static, str>>, data: Column) -> Result<Self, GridError> {
        let place = grid.place(place)?;
        Ok(Self { grid, place, sides: Sides::default(), unit: unit.into(), data })
    }

    /// A function of the points [m], between closed walls.
    pub fn of(grid: Grid, place: Place, unit: impl Into<Cow<'static, str>>, value: impl Fn([f64; 3]) -> f64) -> Result<Self, GridError> {
        let mut field = Self::new(grid, place, unit)?;
        for at in field.each() {
            let i = field.index(at);
            field.data[i] = value(grid.point(field.place, at)) as Real;
        }
        Ok(field)
    }

    /// The same with one kind of side all around.
    pub fn sides(self, side: Side) -> Self {
        Self { sides: [[side; 2]; 3], ..self }
    }

    /// Points along each axis.
    pub fn points(&self) -> [usize; 3] {
        self.grid.points(self.place)
    }

    /// The number of point (i, j, k) in `data`.
    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        self.grid.lattice().at(i, j, k)
    }

    /// The value at point (i, j, k).
    pub fn value(&self, at: [usize; 3]) -> Real {
        self.data[self.index(at)]
    }

    /// All points, x fastest.
    pub fn each(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let [x, y, z] = self.points();
        (0..z).flat_map(move |k| (0..y).flat_map(move |j| (0..x).map(move |i| [i, j, k])))
    }

    /// The values without pads, x fastest.
    pub fn values(&self) -> Vec<Real> {
        self.each().map(|at| self.value(at)).collect()
    }

    /// Sets the values, x fastest.
    pub fn set(&mut self, values: &[Real]) -> Result<(), GridError> {
        let points = self.points();
        if values.len() != points.iter().product::<usize>() {
            return Err(GridError::Count { place: self.place, points, found: values.len() });
        }
        for (at, value) in self.each().zip(values) {
            let i = self.index(at);
            self.data[i] = *value;
        }
        Ok(())
    }

    /// An error unless it is at this place of this grid.
    pub fn expect(&self, grid: &Grid, place: Place, what: &'static str) -> Result<(), GridError> {
        let expected = grid.place(place)?;
        if self.grid != *grid {
            return Err(GridError::Grids { what });
        }
        if self.place != expected {
            return Err(GridError::Mixed { what, expected, found: self.place });
        }
        if self.data.len() != grid.lattice().len() {
            return Err(GridError::Count { place: self.place, points: self.points(), found: self.data.len() });
        }
        Ok(())
    }
}

/// Vectors whose components stand at places of their own: each on the faces of its axis (staggered), or each on the edges along
/// its axis. In the plane there are two on faces, and one, that across the plane, on nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Vectors {
    /// The components, in the order of axes.
    pub parts: Vec<Field>,
}

impl Vectors {
    /// Zeros on the faces.
    pub fn faces(grid: Grid, unit: &'static str) -> Result<Self, GridError> {
        let parts = grid.axes().map(|a| Field::new(grid, Place::Face(a), unit)).collect::<Result<_, _>>()?;
        Ok(Self { parts })
    }

    /// Zeros on the edges.
    pub fn edges(grid: Grid, unit: &'static str) -> Result<Self, GridError> {
        let axes: Vec<usize> = grid.flat.map_or_else(|| vec![0, 1, 2], |a| vec![a]);
        let parts = axes.into_iter().map(|a| Field::new(grid, Place::Edge(a), unit)).collect::<Result<_, _>>()?;
        Ok(Self { parts })
    }

    /// The components of a function of the points [m] on the faces.
    pub fn of(grid: Grid, unit: &'static str, value: impl Fn([f64; 3]) -> [f64; 3]) -> Result<Self, GridError> {
        let parts = grid.axes().map(|a| Field::of(grid, Place::Face(a), unit, |x| value(x)[a])).collect::<Result<_, _>>()?;
        Ok(Self { parts })
    }

    /// The component along an axis, if there is one.
    pub fn part(&self, axis: usize) -> Option<&Field> {
        self.parts.iter().find(|f| match f.place {
            Place::Face(a) | Place::Edge(a) => a == axis,
            Place::Node => f.grid.flat == Some(axis),
            Place::Cell => false,
        })
    }

    /// The grid of all components; an error unless they are the faces' of one grid.
    pub fn on_faces(&self, what: &'static str) -> Result<Grid, GridError> {
        let none = Grid { n: [1; 3], dx: 1.0, origin: [0.0; 3], flat: None, periodic: [false; 3] };
        let grid = self.parts.first().map_or(none, |f| f.grid);
        self.check(&grid, grid.axes().map(Place::Face).collect(), what)?;
        Ok(grid)
    }

    /// An error unless they are the components at these places of the grid.
    pub fn check(&self, grid: &Grid, places: Vec<Place>, what: &'static str) -> Result<(), GridError> {
        if self.parts.len() != places.len() {
            return Err(GridError::Components { what, expected: places.len(), found: self.parts.len() });
        }
        self.parts.iter().zip(places).try_for_each(|(part, place)| part.expect(grid, place, what))
    }
}
