//! Grids, fields and the verbs on them, in double precision.

use crate::arguments::{count, unknown};
use crate::errors::TumbleError;
use numpy::{AllowTypeChange, PyArray1, PyArrayDyn, PyArrayLike2, PyArrayLikeDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use tumble_f64::math::Spare;
use tumble_f64::operators as verbs;
use tumble_f64::operators::{Advection, Interpolation, Trace};
use tumble_f64::state::{self, GridError, Place, Side, Sides, Vectors};

type Any<'py> = Bound<'py, PyAny>;

pub fn wrong(text: impl std::fmt::Display) -> PyErr {
    TumbleError::new_err(text.to_string())
}

pub fn checked<T>(result: Result<T, GridError>) -> PyResult<T> {
    result.map_err(wrong)
}

const AXES: [&str; 3] = ["x", "y", "z"];

fn axis(name: &str) -> Option<usize> {
    AXES.iter().position(|a| *a == name)
}

fn place(name: &str) -> PyResult<Place> {
    let found = match name.split_once(' ') {
        None if name == "cell" => Some(Place::Cell),
        None if name == "node" => Some(Place::Node),
        Some(("face", a)) => axis(a).map(Place::Face),
        Some(("edge", a)) => axis(a).map(Place::Edge),
        _ => None,
    };
    found.ok_or_else(|| {
        let known = ["cell", "node", "face x", "face y", "face z", "edge x", "edge y", "edge z"];
        wrong(unknown("place", name, &known))
    })
}

/// A box of cubic cells, with two numbers of cells in a plane, with three in space. Lengths in metres.
#[pyclass(frozen, skip_from_py_object, module = "tumble.fields")]
#[derive(Clone)]
pub struct Grid {
    grid: state::Grid,
}

impl Grid {
    fn shape(&self, place: Place) -> Vec<usize> {
        let points = self.grid.points(place);
        self.grid.axes().map(|a| points[a]).collect()
    }
}

#[pymethods]
impl Grid {
    #[new]
    #[pyo3(signature = (cells, spacing, origin=None, plane="xy", periodic=""))]
    fn new(cells: &Any, spacing: f64, origin: Option<Vec<f64>>, plane: &str, periodic: &str) -> PyResult<Self> {
        let cells =
            cells.try_iter().map_err(|_| wrong(format!("cells: {}, expected two whole numbers (a plane) or three", cells.get_type())))?;
        let cells = cells.map(|n| count(&n?, "cells", 1)).collect::<PyResult<Vec<_>>>()?;
        let flat = match (cells.len(), plane) {
            (3, _) => None,
            (2, "xy") => Some(2),
            (2, "xz") => Some(1),
            (2, "yz") => Some(0),
            (2, other) => return Err(wrong(unknown("plane", other, &["xy", "xz", "yz"]))),
            (n, _) => return Err(wrong(format!("cells: {n} numbers, expected two (a plane) or three"))),
        };
        let axes: Vec<usize> = (0..3).filter(|a| flat != Some(*a)).collect();
        let (mut n, mut corner) = ([1; 3], [0.0; 3]);
        axes.iter().zip(&cells).for_each(|(a, c)| n[*a] = *c);
        if let Some(origin) = origin {
            if origin.len() != axes.len() {
                return Err(wrong(format!("origin: {} numbers, expected {}", origin.len(), axes.len())));
            }
            axes.iter().zip(&origin).for_each(|(a, x)| corner[*a] = *x);
        }
        let mut around = [false; 3];
        for name in periodic.chars().map(String::from) {
            let Some(a) = axis(&name).filter(|a| axes.contains(a)) else {
                return Err(wrong(format!("periodic: \"{periodic}\", expected some of the letters of the grid's axes")));
            };
            around[a] = true;
        }
        let grid = checked(state::Grid::new(n, spacing, corner))?;
        let grid = flat.map_or(Ok(grid), |a| checked(grid.flat(a)))?;
        Ok(Self { grid: grid.periodic(around) })
    }

    /// Cells along each axis.
    #[getter]
    fn cells<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.grid.axes().map(|a| self.grid.n[a]).collect::<Vec<_>>())
    }

    /// Length of a cell's sides [m].
    #[getter]
    fn spacing(&self) -> f64 {
        self.grid.dx
    }

    /// How many points a place has along each axis: the shape of its arrays.
    #[pyo3(name = "shape", signature = (place="cell"))]
    fn shape_of<'py>(&self, py: Python<'py>, place: &str) -> PyResult<Bound<'py, PyTuple>> {
        let place = checked(self.grid.place(self::place(place)?))?;
        PyTuple::new(py, self.shape(place))
    }

    /// The coordinates [m] of the points of a place: one array for each axis.
    #[pyo3(signature = (place="cell"))]
    fn points<'py>(&self, py: Python<'py>, place: &str) -> PyResult<Bound<'py, PyTuple>> {
        let place = checked(self.grid.place(self::place(place)?))?;
        let all = checked(state::Field::new(self.grid, place, ""))?;
        let mut found = Vec::new();
        for a in self.grid.axes() {
            let numbers = all.each().map(|at| self.grid.point(place, at)[a]).collect();
            found.push(shaped(py, numbers, self.shape(place))?);
        }
        PyTuple::new(py, found)
    }

    /// A field from an array, a number or a function of the coordinates. Raises TumbleError.
    #[pyo3(signature = (values, place="cell", unit="", sides=None))]
    fn field(&self, py: Python<'_>, values: &Any, place: &str, unit: &str, sides: Option<&Any>) -> PyResult<Field> {
        let values = if values.is_callable() { &values.call1(self.points(py, place)?)? } else { values };
        let mut field = checked(state::Field::new(self.grid, self::place(place)?, unit.to_string()))?;
        if let Some(sides) = sides {
            field.sides = all_sides(&self.grid, sides)?;
        }
        let array: PyArrayLikeDyn<'_, f64, AllowTypeChange> =
            values.extract().map_err(|_| wrong(format!("values at \"{}\": no array of numbers", field.place)))?;
        let (shape, found) = (self.shape(field.place), array.shape().to_vec());
        let numbers: Vec<f64> = if found.is_empty() {
            vec![array.as_array().iter().next().copied().unwrap_or(0.0); shape.iter().product()]
        } else if found == shape {
            array.as_array().t().iter().copied().collect()
        } else {
            return Err(wrong(format!("values at \"{}\": an array of shape {found:?}, expected {shape:?}", field.place)));
        };
        checked(field.set(&numbers))?;
        Ok(Field { field })
    }

    fn __repr__(&self) -> String {
        let cells: Vec<String> = self.grid.axes().map(|a| format!("{} {}", self.grid.n[a], AXES[a])).collect();
        format!("Grid({}, spacing={} m)", cells.join(" x "), self.grid.dx)
    }
}

/// x fastest -> an array whose first index is that of x.
fn shaped(py: Python<'_>, numbers: Vec<f64>, shape: Vec<usize>) -> PyResult<Bound<'_, PyArrayDyn<f64>>> {
    let reversed: Vec<usize> = shape.into_iter().rev().collect();
    PyArray1::from_vec(py, numbers).reshape(reversed)?.call_method0("transpose")?.extract().map_err(Into::into)
}

fn one_side(value: &Any) -> PyResult<Side> {
    if let Ok(name) = value.extract::<String>() {
        if name == "closed" {
            return Ok(Side::Closed);
        }
    } else if let Ok((name, number)) = value.extract::<(String, f64)>() {
        match name.as_str() {
            "slope" => return Ok(Side::Slope(number)),
            "value" => return Ok(Side::Value(number)),
            "ghost" => return Ok(Side::Ghost(number)),
            _ => {}
        }
    }
    Err(wrong(format!("sides: {}, expected \"closed\", (\"slope\", g), (\"value\", v) or (\"ghost\", v)", value.repr()?)))
}

/// One side for all, or a dict: "x" both, "x-" the lower, "x+" the upper side.
fn all_sides(grid: &state::Grid, value: &Any) -> PyResult<Sides> {
    let Ok(table) = value.cast::<PyDict>() else { return Ok([[one_side(value)?; 2]; 3]) };
    let mut sides = Sides::default();
    // Axes first, so that "x-" stands beside "x" in any order.
    for signed in [false, true] {
        for (key, value) in table {
            let key: String = key.extract().map_err(|_| wrong("sides: a key is no text"))?;
            let (name, which) = match key.strip_suffix(['-', '+']) {
                Some(name) => (name, usize::from(key.ends_with('+'))..usize::from(key.ends_with('+')) + 1),
                None => (key.as_str(), 0..2),
            };
            let Some(a) = axis(name).filter(|a| grid.flat != Some(*a)) else {
                return Err(wrong(format!("sides: \"{key}\", expected an axis of the grid (both sides), or one with - or + behind it")));
            };
            if grid.periodic[a] {
                return Err(wrong(format!("sides: \"{key}\" is periodic and has none; leave it out")));
            }
            if signed == (which.len() == 1) {
                sides[a][which].fill(one_side(&value)?);
            }
        }
    }
    Ok(sides)
}

/// Numbers at one place of a grid.
#[pyclass(frozen, skip_from_py_object, module = "tumble.fields")]
#[derive(Clone)]
pub struct Field {
    pub(crate) field: state::Field,
}

#[pymethods]
impl Field {
    /// The numbers; the first index is that of the first axis.
    #[getter]
    fn array<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let points = self.field.points();
        shaped(py, self.field.values(), self.field.grid.axes().map(|a| points[a]).collect())
    }

    /// "cell", "face x", "edge x" (or y, z) or "node".
    #[getter]
    fn place(&self) -> String {
        self.field.place.to_string()
    }

    /// SI unit.
    #[getter]
    fn unit(&self) -> &str {
        &self.field.unit
    }

    /// Its grid.
    #[getter]
    fn grid(&self) -> Grid {
        Grid { grid: self.field.grid }
    }

    fn __repr__(&self) -> String {
        let cells: Vec<String> = self.field.grid.axes().map(|a| self.field.grid.n[a].to_string()).collect();
        format!("Field({} cells, at {:?}, unit {:?})", cells.join(" x "), self.field.place.to_string(), self.field.unit)
    }
}

/// A field, or a sequence of the components of vectors.
pub fn parts(value: &Any, what: &str) -> PyResult<Vectors> {
    if let Ok(one) = value.cast::<Field>() {
        return Ok(Vectors { parts: vec![one.get().field.clone()] });
    }
    let refused = || wrong(format!("{what}: {}, expected a field, or the fields of all components in the order of axes", value.get_type()));
    let mut parts = Vec::new();
    for part in value.try_iter().map_err(|_| refused())? {
        parts.push(part?.cast::<Field>().map_err(|_| refused())?.get().field.clone());
    }
    if parts.is_empty() { Err(refused()) } else { Ok(Vectors { parts }) }
}

/// One field, or a tuple of them.
fn handed(py: Python<'_>, parts: Vec<state::Field>) -> PyResult<Any<'_>> {
    let mut all = parts.into_iter().map(|field| Bound::new(py, Field { field })).collect::<PyResult<Vec<_>>>()?;
    match (all.len(), all.pop()) {
        (1, Some(one)) => Ok(one.into_any()),
        (_, last) => Ok(PyTuple::new(py, all.into_iter().chain(last).collect::<Vec<_>>())?.into_any()),
    }
}

/// A unit over m: "m/s" -> "1/s".
fn over_metre(unit: &str) -> String {
    match unit {
        "" | "1" => "1/m".into(),
        "m" => "1".into(),
        _ if unit.starts_with("m/") => format!("1/{}", &unit[2..]),
        _ => format!("{unit}/m"),
    }
}

/// A field of zeros between closed walls.
fn empty(like: &state::Field, place: Place, unit: String) -> PyResult<state::Field> {
    checked(state::Field::new(like.grid, place, unit))
}

fn faces(like: &state::Field, unit: &str) -> PyResult<Vectors> {
    let parts = like.grid.axes().map(|a| empty(like, Place::Face(a), unit.to_string())).collect::<PyResult<_>>()?;
    Ok(Vectors { parts })
}

/// The gradient of a field of cells, on faces.
#[pyfunction]
pub fn gradient<'py>(py: Python<'py>, field: &Any<'py>) -> PyResult<Any<'py>> {
    let f = only(field, "gradient of a field")?;
    let mut out = faces(&f, &over_metre(&f.unit))?;
    py.detach(|| checked(verbs::gradient(&f, &mut out)))?;
    handed(py, out.parts)
}

fn only(value: &Any, what: &str) -> PyResult<state::Field> {
    let all = parts(value, what)?;
    match <[state::Field; 1]>::try_from(all.parts) {
        Ok([one]) => Ok(one),
        Err(several) => Err(wrong(format!("{what}: {} fields, expected one", several.len()))),
    }
}

/// The divergence of vectors on faces, at cells.
#[pyfunction]
pub fn divergence<'py>(py: Python<'py>, vectors: &Any<'py>) -> PyResult<Any<'py>> {
    let u = parts(vectors, "divergence of vectors")?;
    let mut out = empty(&u.parts[0], Place::Cell, over_metre(&u.parts[0].unit))?;
    py.detach(|| checked(verbs::divergence(&u, &mut out)))?;
    handed(py, vec![out])
}

/// The curl of vectors on faces, on edges (in the plane: at nodes), or the other way.
#[pyfunction]
pub fn curl<'py>(py: Python<'py>, vectors: &Any<'py>) -> PyResult<Any<'py>> {
    let u = parts(vectors, "curl of vectors")?;
    let (first, unit) = (&u.parts[0], over_metre(&u.parts[0].unit));
    let mut out = match (first.place, first.grid.flat) {
        (Place::Face(_) | Place::Cell, Some(_)) => Vectors { parts: vec![empty(first, Place::Node, unit)?] },
        (Place::Face(_) | Place::Cell, None) => {
            Vectors { parts: (0..3).map(|a| empty(first, Place::Edge(a), unit.clone())).collect::<PyResult<_>>()? }
        }
        _ => faces(first, &unit)?,
    };
    py.detach(|| checked(verbs::curl(&u, &mut out)))?;
    handed(py, out.parts)
}

/// The Laplacian of a field or of each component of vectors, at its own place.
#[pyfunction]
pub fn laplacian<'py>(py: Python<'py>, field: &Any<'py>) -> PyResult<Any<'py>> {
    let f = parts(field, "Laplacian of a field")?;
    let mut out = Vec::new();
    for f in &f.parts {
        let mut here = empty(f, f.place, over_metre(&over_metre(&f.unit)).replace("/m/m", "/m²"))?;
        py.detach(|| checked(verbs::laplacian(f, &mut here)))?;
        out.push(here);
    }
    handed(py, out)
}

/// The directional derivative: velocity . grad field, at the place of the field.
#[pyfunction]
pub fn directional<'py>(py: Python<'py>, velocity: &Any<'py>, field: &Any<'py>) -> PyResult<Any<'py>> {
    let (u, f) = (parts(velocity, "velocity of a directional derivative")?, only(field, "field of a directional derivative")?);
    let mut out = empty(&f, f.place, format!("{}·{}", u.parts[0].unit, over_metre(&f.unit)))?;
    py.detach(|| checked(verbs::directional(&u, &f, &mut out)))?;
    handed(py, vec![out])
}

/// The field at another place: the mean of the nearest points there.
#[pyfunction]
pub fn average<'py>(py: Python<'py>, field: &Any<'py>, place: &str) -> PyResult<Any<'py>> {
    let (f, to) = (only(field, "average of a field")?, self::place(place)?);
    let out = py.detach(|| checked(verbs::average(&f, to)))?;
    handed(py, vec![state::Field { sides: Sides::default(), ..out }])
}

fn interpolation(name: &str) -> PyResult<Interpolation> {
    match name {
        "linear" => Ok(Interpolation::Linear),
        "cubic" => Ok(Interpolation::Cubic),
        "monotone" => Ok(Interpolation::MonotoneCubic),
        _ => Err(wrong(unknown("interpolation", name, &["linear", "cubic", "monotone"]))),
    }
}

/// The values at points, n x 2 or n x 3 [m].
#[pyfunction]
#[pyo3(signature = (field, points, interpolation="linear"))]
pub fn sample<'py>(py: Python<'py>, field: &Any<'py>, points: &Any<'py>, interpolation: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (f, how) = (only(field, "sampled field")?, self::interpolation(interpolation)?);
    let axes: Vec<usize> = f.grid.axes().collect();
    let shape = || wrong(format!("points: expected an array of n x {} numbers [m]", axes.len()));
    let points: PyArrayLike2<'_, f64, AllowTypeChange> = points.extract().map_err(|_| shape())?;
    if points.shape()[1] != axes.len() {
        return Err(shape());
    }
    let mut rows = Vec::with_capacity(points.shape()[0]);
    for row in points.as_array().rows() {
        let mut x = f.grid.origin;
        axes.iter().zip(row).for_each(|(a, c)| x[*a] = *c);
        rows.push(x);
    }
    let values = py.detach(|| checked(verbs::sample(&f, &rows, how)))?;
    Ok(PyArray1::from_vec(py, values))
}

/// A field, or vectors on faces, advected by a velocity for h seconds.
#[pyfunction]
#[pyo3(signature = (field, velocity, h, trace="rk2", substeps=None, interpolation="linear", corrected=false, turning=false),
    text_signature = "(field, velocity, h, trace='rk2', substeps=1, interpolation='linear', corrected=False, turning=False)")]
pub fn advect<'py>(
    py: Python<'py>,
    field: &Any<'py>,
    velocity: &Any<'py>,
    h: f64,
    trace: &str,
    substeps: Option<&Any<'py>>,
    interpolation: &str,
    corrected: bool,
    turning: bool,
) -> PyResult<Any<'py>> {
    let substeps = substeps.map_or(Ok(1), |n| count(n, "substeps", 1))?;
    let (f, u) = (parts(field, "advected field")?, parts(velocity, "velocity of an advection")?);
    let trace = match trace {
        "euler" => Trace::Euler,
        "rk2" => Trace::Rk2,
        "rk3" => Trace::Rk3,
        _ => return Err(wrong(unknown("trace", trace, &["euler", "rk2", "rk3"]))),
    };
    if !h.is_finite() {
        return Err(wrong(format!("advection by {h} s, expected a finite time")));
    }
    let how = Advection { trace, substeps, interpolation: self::interpolation(interpolation)?, corrected, turning };
    let out = py.detach(|| {
        let mut spare = Spare::default();
        if turning {
            return Ok(checked(verbs::advect_vectors(&f, &u, h, &how, &mut spare))?.parts);
        }
        let mut out = Vec::new();
        for f in &f.parts {
            out.extend(checked(verbs::advect(&[f], &u, h, &how, &mut spare))?);
        }
        Ok::<_, PyErr>(out)
    })?;
    handed(py, out)
}

/// A field, or each component of vectors, diffused for a duration [s] with kappa [m²/s].
#[pyfunction]
pub fn diffuse<'py>(py: Python<'py>, field: &Any<'py>, kappa: f64, duration: f64) -> PyResult<Any<'py>> {
    let mut f = parts(field, "diffused field")?;
    py.detach(|| {
        for f in &mut f.parts {
            let mut scratch = f.clone();
            checked(verbs::diffuse(f, kappa, duration, &mut scratch))?;
        }
        Ok::<(), PyErr>(())
    })?;
    handed(py, f.parts)
}

/// The largest explicit step of diffusion [s] that does not grow.
#[pyfunction]
pub fn diffusion_limit(grid: &Grid, kappa: f64) -> f64 {
    verbs::diffusion_limit(&grid.grid, kappa)
}
