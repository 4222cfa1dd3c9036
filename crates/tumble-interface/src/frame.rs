//! All that leaves the engine: named columns with a unit and a shape.

use crate::columns;

/// The numbers of a column.
#[derive(Debug, Clone, PartialEq)]
pub enum Data {
    /// Single precision.
    F32(Vec<f32>),
    /// Double precision.
    F64(Vec<f64>),
    /// Indices.
    U32(Vec<u32>),
}

impl Data {
    /// Count of numbers.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(v) => v.len(),
            Self::F64(v) => v.len(),
            Self::U32(v) => v.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All of them in double precision.
    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Self::F32(v) => v.iter().map(|x| f64::from(*x)).collect(),
            Self::F64(v) => v.clone(),
            Self::U32(v) => v.iter().map(|x| f64::from(*x)).collect(),
        }
    }
}

impl From<Vec<f32>> for Data {
    fn from(v: Vec<f32>) -> Self {
        Self::F32(v)
    }
}

impl From<Vec<f64>> for Data {
    fn from(v: Vec<f64>) -> Self {
        Self::F64(v)
    }
}

impl From<Vec<u32>> for Data {
    fn from(v: Vec<u32>) -> Self {
        Self::U32(v)
    }
}

/// A column of an object: of a table, as `position` [m], n x 3, or of a grid, as `density` [kg/m³] on all of its cells.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Object it belongs to.
    pub object: String,
    /// What it is: `position`, `velocity`, `link_strain`.
    pub name: String,
    /// SI unit, `1` for a pure number.
    pub unit: &'static str,
    /// Numbers per row; the number of rows is `data.len() / width`.
    pub width: usize,
    /// Points along each axis of the grid on which the rows lie, the first axis fastest; two in a plane, none in a table.
    pub points: Vec<usize>,
    /// Row after row.
    pub data: Data,
}

/// The state of the world at one time, as columns.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Frame {
    /// Simulated time [s].
    pub time: f64,
    /// Frame number, 0 at the start.
    pub index: u64,
    /// Columns, object by object in scene order.
    pub columns: Vec<Column>,
}

impl Column {
    /// A column of a table, of the unit and width that [`columns`] says.
    pub fn new(object: &str, name: &str, data: impl Into<Data>) -> Self {
        let known = columns::of(name);
        let (unit, width) = known.map_or(("1", 1), |known| (known.unit, known.width));
        Self { object: object.into(), name: name.into(), unit, width, points: Vec::new(), data: data.into() }
    }

    /// A column on a grid with so many points along each axis, of the unit that [`columns`] says.
    pub fn on_grid(object: &str, name: &str, points: Vec<usize>, data: impl Into<Data>) -> Self {
        let data = data.into();
        let width = data.len() / points.iter().product::<usize>().max(1);
        Self { width, points, ..Self::new(object, name, data) }
    }
}

impl Frame {
    /// The column `name` of `object`, if there is one.
    pub fn column(&self, object: &str, name: &str) -> Option<&Column> {
        self.columns.iter().find(|c| c.object == object && c.name == name)
    }
}
