//! Grids of cubic cells and the places on them.

use crate::math::Lattice;
use std::fmt;
use tumble_interface::Column;

/// A box of cubic cells. A plane is a grid one cell thick, along whose flat axis nothing is differentiated or interpolated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Cells along each axis, 1 along the flat one.
    pub n: [usize; 3],
    /// Length of a cell's sides [m].
    pub dx: f64,
    /// The lowest corner of the box [m].
    pub origin: [f64; 3],
    /// The axis across the plane of a grid of two dimensions.
    pub flat: Option<usize>,
    /// The axes along which the last cell is the neighbour of the first.
    pub periodic: [bool; 3],
}

/// Most cells of a grid: numbers are counted in 32 bits, and the ghosts of thin grids need room as well.
const CELLS: f64 = 268_435_456.0;

impl Grid {
    /// A grid with walls all around.
    pub fn new(n: [usize; 3], dx: f64, origin: [f64; 3]) -> Result<Self, GridError> {
        let cells = n.iter().map(|n| *n as f64).product::<f64>();
        if n.contains(&0) || cells > CELLS || n.iter().any(|n| *n > 1 << 20) {
            return Err(GridError::Size { n });
        }
        if !(dx.is_finite() && dx > 0.0 && origin.iter().all(|x| x.is_finite())) {
            return Err(GridError::Spacing { dx });
        }
        if Lattice::new(n).len() > 1 << 30 {
            return Err(GridError::Size { n });
        }
        Ok(Self { n, dx, origin, flat: None, periodic: [false; 3] })
    }

    /// The same in the plane across an axis, which must be one cell thick.
    pub fn flat(self, axis: usize) -> Result<Self, GridError> {
        if axis > 2 || self.n[axis] != 1 {
            return Err(GridError::Thick { axis, n: self.n });
        }
        Ok(Self { flat: Some(axis), ..self })
    }

    /// The same with these axes periodic; the flat one never is.
    pub fn periodic(self, periodic: [bool; 3]) -> Self {
        Self { periodic: std::array::from_fn(|a| periodic[a] && self.flat != Some(a)), ..self }
    }

    /// The axes that are not flat.
    pub fn axes(&self) -> impl Iterator<Item = usize> + use<> {
        let flat = self.flat;
        (0..3).filter(move |a| flat != Some(*a))
    }

    /// 2 or 3.
    pub fn dimension(&self) -> usize {
        if self.flat.is_some() { 2 } else { 3 }
    }

    /// How its numbers lie in memory.
    pub fn lattice(&self) -> Lattice {
        Lattice::new(self.n)
    }

    /// The place by its one name on this grid: in the plane, the edges across it are its nodes, and no place lies along the flat
    /// axis but cells, faces and nodes.
    pub fn place(&self, place: Place) -> Result<Place, GridError> {
        match (place, self.flat) {
            (Place::Face(a) | Place::Edge(a), _) if a > 2 => Err(GridError::Absent { place, flat: self.flat }),
            (Place::Face(a), Some(f)) if a == f => Err(GridError::Absent { place, flat: self.flat }),
            (Place::Edge(a), Some(f)) if a != f => Err(GridError::Absent { place, flat: self.flat }),
            (Place::Edge(_), Some(_)) => Ok(Place::Node),
            _ => Ok(place),
        }
    }

    /// How many points of a place there are along each axis: as many as cells, or one more on walls; along a periodic axis the
    /// last wall is the first.
    pub fn points(&self, place: Place) -> [usize; 3] {
        std::array::from_fn(|a| self.n[a] + usize::from(self.on_walls(place, a) && !self.periodic[a]))
    }

    /// Whether the points of a place lie on the walls between cells along an axis, or at the middle of cells.
    pub fn on_walls(&self, place: Place, axis: usize) -> bool {
        if self.flat == Some(axis) {
            return false;
        }
        match place {
            Place::Cell => false,
            Place::Face(a) => a == axis,
            Place::Edge(a) => a != axis,
            Place::Node => true,
        }
    }

    /// The place whose points lie on walls along these axes.
    pub fn place_on(&self, walls: [bool; 3]) -> Place {
        let on: Vec<usize> = self.axes().filter(|a| walls[*a]).collect();
        match on[..] {
            [] => Place::Cell,
            [a] => Place::Face(a),
            [a, b] if self.flat.is_none() => Place::Edge(3 - a - b),
            _ => Place::Node,
        }
    }

    /// The first point of a place from the lowest corner, in cells.
    pub fn offset(&self, place: Place) -> [f64; 3] {
        std::array::from_fn(|a| if self.on_walls(place, a) { 0.0 } else { 0.5 })
    }

    /// Grid description of an object for pictures and files.
    pub fn columns(&self, object: &str) -> Vec<Column> {
        vec![
            Column::new(object, "grid_cells", self.axes().map(|a| self.n[a] as u32).collect::<Vec<u32>>()),
            Column::new(object, "grid_spacing", vec![self.dx]),
            Column::new(object, "grid_origin", self.origin.to_vec()),
            Column::new(object, "grid_flat", vec![self.flat.unwrap_or(3) as u32]),
        ]
    }

    /// Point (i, j, k) of a place [m].
    pub fn point(&self, place: Place, at: [usize; 3]) -> [f64; 3] {
        let offset = self.offset(place);
        std::array::from_fn(|a| self.origin[a] + self.dx * (at[a] as f64 + offset[a]))
    }
}

/// Location of a field's numbers on a grid.
///
/// ```text
///     node ---- edge along x ---- node
///      |                           |
///   edge along y     face of z    edge along y         the front of a cell; the cell's own point is its middle
///      |                           |
///     node ---- edge along x ---- node
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Place {
    /// The middle of cells.
    Cell,
    /// The middle of the faces that an axis pierces.
    Face(usize),
    /// The middle of the edges along an axis.
    Edge(usize),
    /// The corners of cells.
    Node,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = |a: &usize| ["x", "y", "z"].get(*a).copied().unwrap_or("?");
        match self {
            Self::Cell => write!(f, "cell"),
            Self::Face(a) => write!(f, "face {}", axis(a)),
            Self::Edge(a) => write!(f, "edge {}", axis(a)),
            Self::Node => write!(f, "node"),
        }
    }
}

/// Errors of grids and of combinations of fields.
#[derive(Debug, Clone, PartialEq)]
pub enum GridError {
    /// No cells, or too many.
    Size {
        /// Cells along each axis.
        n: [usize; 3],
    },
    /// No length.
    Spacing {
        /// The given value [m].
        dx: f64,
    },
    /// More than one cell along a flat axis.
    Thick {
        /// The axis.
        axis: usize,
        /// Cells along each axis.
        n: [usize; 3],
    },
    /// A place that the grid does not have.
    Absent {
        /// The place.
        place: Place,
        /// The axis across the plane.
        flat: Option<usize>,
    },
    /// A field at another place than the operator works on.
    Mixed {
        /// Which field of which operator.
        what: &'static str,
        /// The expected location.
        expected: Place,
        /// The actual location.
        found: Place,
    },
    /// Fields of different grids.
    Grids {
        /// Which field of which operator.
        what: &'static str,
    },
    /// Too few or too many components.
    Components {
        /// Which vectors of which operator.
        what: &'static str,
        /// How many they must have.
        expected: usize,
        /// How many they have.
        found: usize,
    },
    /// Numbers that do not fill a place.
    Count {
        /// The place.
        place: Place,
        /// How many it has along each axis.
        points: [usize; 3],
        /// How many were given.
        found: usize,
    },
    /// A step of diffusion beyond its limit.
    Step {
        /// The step [s].
        h: f64,
        /// The largest that does not grow [s].
        limit: f64,
    },
}

impl fmt::Display for GridError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { n: [x, y, z] } => {
                write!(f, "a grid of {x} x {y} x {z} cells, expected 1 to {CELLS} in all and at most {} along an axis", 1 << 20)
            }
            Self::Spacing { dx } => write!(f, "cells of {dx} m at a finite origin, expected > 0 m"),
            Self::Thick { axis, n } => {
                write!(f, "the flat axis {axis} of {} x {} x {} cells, expected one of 0, 1, 2 with 1 cell along it", n[0], n[1], n[2])
            }
            Self::Absent { place, flat } => match flat {
                Some(a) => {
                    write!(f, "\"{place}\" is no place of a plane across axis {a}; it has cells, the faces of its two axes, and nodes")
                }
                None => write!(f, "\"{place}\" is no place of a grid"),
            },
            Self::Mixed { what, expected, found } => {
                write!(f, "{what}: values at \"{found}\", expected \"{expected}\"; interpolate them there, or take another operator")
            }
            Self::Grids { what } => write!(f, "{what}: fields of two different grids; interpolate one to the points of the other"),
            Self::Components { what, expected, found } => {
                write!(f, "{what}: {found} components, expected {expected}: one field for each axis, in their order")
            }
            Self::Count { place, points: [x, y, z], found } => {
                write!(f, "{found} values, expected {x} x {y} x {z} = {} at \"{place}\"", x * y * z)
            }
            Self::Step { h, limit } => write!(f, "a step of {h} s of diffusion grows beyond {limit} s; take more and smaller steps"),
        }
    }
}

impl std::error::Error for GridError {}
