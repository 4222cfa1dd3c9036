//! L2: the columns of a system of masses; grids and the fields on them. Data only.

mod field;
mod grid;
mod spare;

pub use field::{Field, Side, Sides, Vectors};
pub use grid::{Grid, GridError, Place};

use crate::math::{Real, Row};
use std::ops::Range;
use tumble_interface::{Column, Data};

/// Moving state: points and frames.
#[derive(Debug, Clone, Default)]
pub struct State {
    /// Points [x, y, z, 1/m] [m, 1/kg]; frames are unit quaternions.
    pub x: Vec<Row>,
    /// Velocities [m/s] of points, angular velocities in their own axes [rad/s] of frames; the fourth number is 0.
    pub v: Vec<Row>,
}

/// The rows of frames: they follow the points that are there from the start, and come before the points that are born. All others are
/// points.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Frames {
    /// The first.
    pub start: usize,
    /// One past the last.
    pub end: usize,
}

impl Frames {
    /// Whether a row is a frame.
    #[inline(always)]
    pub fn contains(self, i: usize) -> bool {
        self.start <= i && i < self.end
    }

    /// Rows counted from `first` on: points, frames, points.
    pub fn cut(self, first: usize, rows: usize) -> [Range<usize>; 3] {
        let at = |i: usize| i.saturating_sub(first).min(rows);
        // Without frames, all points are one range.
        let (start, end) = if self.start == self.end { (rows, rows) } else { (at(self.start), at(self.end)) };
        [0..start, start..end, end..rows]
    }

    /// The frames among rows counted from `first` on.
    pub fn from(self, first: usize) -> Self {
        Self { start: self.start.saturating_sub(first), end: self.end.saturating_sub(first) }
    }
}

/// How much each row weighs.
#[derive(Debug, Clone, Default)]
pub struct Masses {
    /// Masses [kg] of points and moments of inertia [kg m²] of frames, pinned ones included.
    pub mass: Vec<Real>,
    /// 1/inertia of frames, 0 for clamped ones; 1/mass of a point stands in its row.
    pub inverse_inertia: Vec<Real>,
    /// Electric charges [C]; empty where nothing is charged.
    pub charge: Vec<Real>,
    /// Which rows are frames.
    pub frames: Frames,
    /// How many points before the frames, the last ones, belong to no object: they are held, and weigh nothing.
    pub ghosts: usize,
}

impl Masses {
    /// 1/mass or 1/inertia of row i, 0 for what is held; x are all rows.
    #[inline(always)]
    pub fn inverse(&self, i: usize, x: &[Row]) -> Real {
        if self.frames.contains(i) { self.inverse_inertia[i - self.frames.start] } else { x[i][3] }
    }

    /// The first three numbers of the rows of points, one after the other.
    pub fn flat(&self, rows: &[Row]) -> Vec<f64> {
        self.points().flat_map(|points| &rows[points]).flat_map(|r| [f64::from(r[0]), f64::from(r[1]), f64::from(r[2])]).collect()
    }

    /// The rows of points of objects, in ranges.
    pub fn points(&self) -> impl Iterator<Item = Range<usize>> + Clone {
        let [a, _, b] = self.frames.cut(0, self.mass.len());
        let (first, end) = (self.frames.start - self.ghosts, self.frames.start);
        let ranges = match self.ghosts {
            0 => [a, b, 0..0],
            _ => [a.start..a.end.min(first), a.start.max(end)..a.end, b],
        };
        ranges.into_iter().filter(|range| !range.is_empty())
    }
}

/// A thing in a system: which rows it has, and how it hangs together.
#[derive(Debug, Clone, Default)]
pub struct Object {
    /// Name in the scene.
    pub name: String,
    /// Its points, as rows.
    pub points: Range<usize>,
    /// How many of them, the last ones, are spare vertices of a surface that tears.
    pub spare: usize,
    /// Its frames, as rows.
    pub frames: Range<usize>,
    /// Triangles over its points, counted from its first.
    pub triangles: Vec<[u32; 3]>,
    /// Texture coordinates u, v of the three corners of each triangle; empty if there are none.
    pub texture: Vec<[f32; 6]>,
    /// Whether the triangles enclose a volume, and go on to: none tears.
    pub closed: bool,
    /// Points in the order of a curve, counted from its first; empty if it is none.
    pub curve: Vec<u32>,
    /// Of many curves, how many points each has; 0 if it is one.
    pub curve_points: u32,
    /// Length of a piece of its curves beyond which it has broken [m], if any breaks.
    pub breaks: Option<f64>,
    /// Its links: index of the batch and the elements in it.
    pub links: Vec<(usize, Range<usize>)>,
    /// The emitter in the system's pool whose particles these are; their number changes.
    pub stream: Option<usize>,
    /// Radius in pictures [m]; 0 for a surface.
    pub radius: f64,
}

impl Object {
    /// The pieces of its curves: pairs of points, counted from its first.
    pub fn pieces(&self) -> impl Iterator<Item = [u32; 2]> {
        let each = if self.curve_points > 0 { self.curve_points as usize } else { self.curve.len().max(1) };
        self.curve.chunks(each).flat_map(|curve| curve.windows(2).map(|ends| [ends[0], ends[1]]))
    }

    /// A column of its own.
    pub fn column(&self, name: &str, data: impl Into<Data>) -> Column {
        Column::new(&self.name, name, data)
    }

    /// Its radius as a column.
    pub fn one_radius(&self) -> Column {
        self.column("radius", vec![self.radius])
    }
}
