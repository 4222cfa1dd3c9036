//! The projection of a velocity by every rung of the ladder, with what was left when.

use crate::arguments::{count, unknown};
use crate::fields::{Field, checked, parts, wrong};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::sync::OnceLock;
use std::time::Instant;
use tumble_f64::linalg::poisson::byte;
use tumble_f64::operators as verbs;
use tumble_f64::state::{self, Place};

/// Words of the scene, in the order of `Method::ALL`.
const METHODS: [&str; 9] = [
    "jacobi",
    "gauss_seidel",
    "sor",
    "conjugate_gradients",
    "incomplete_cholesky",
    "modified_incomplete_cholesky",
    "multigrid",
    "multigrid_gradients",
    "cosine",
];

/// Seconds since the first call.
fn now() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}

/// Request to a solver; columns are laid out as on the lattice.
struct Asked<'a> {
    grid: &'a state::Grid,
    open: &'a [Vec<u8>; 3],
    b: &'a [f64],
    method: usize,
    largest: f64,
    iterations: usize,
}

/// Its result.
struct Found {
    q: Vec<f64>,
    history: Vec<f64>,
    times: Vec<f64>,
    set_up: f64,
    converged: bool,
    pockets: usize,
    refinements: usize,
}

macro_rules! solver {
    ($name:ident, $engine:ident) => {
        fn $name(asked: &Asked) -> Result<Found, String> {
            use $engine::linalg::poisson::{Excess, Method, Params, Side, Solver, Target};
            use $engine::math::{Lattice, Real};
            let before = now();
            let sides = asked.grid.periodic.map(|around| [if around { Side::Periodic } else { Side::Closed }; 2]);
            let open = asked.open.each_ref().map(Vec::as_slice);
            let mut solver = Solver::new(Lattice::new(asked.grid.n), sides, open, None).map_err(|fault| fault.to_string())?.with_clock(now);
            let b: Vec<Real> = asked.b.iter().map(|b| *b as Real).collect();
            let params = Params {
                method: Method::ALL[asked.method],
                target: Target::Largest(asked.largest),
                iterations: asked.iterations,
                // The net flow into a closed region is zero up to rounding.
                excess: Excess::Remove,
            };
            let mut q = vec![0.0; b.len()];
            // Factors and plans are made when first asked for: one iteration makes them.
            let once = Params { target: Target::Relative(0.0), iterations: 1, ..params };
            solver.solve_double(&b, &mut q, &once).map_err(|fault| fault.to_string())?;
            let (made, set_up) = (now(), now() - before);
            solver.solve_double(&b, &mut q, &once).map_err(|fault| fault.to_string())?;
            // Less the iteration itself.
            let set_up = (set_up - (now() - made)).max(0.0);
            let info = solver.solve_double(&b, &mut q, &params).map_err(|fault| fault.to_string())?;
            let first = info.times.first().copied().unwrap_or_default();
            Ok(Found {
                q,
                times: info.times.iter().map(|t| t - first).collect(),
                history: info.history,
                set_up,
                converged: info.converged,
                pockets: info.pockets,
                refinements: info.refinements,
            })
        }
    };
}

solver!(single, tumble);
solver!(double, tumble_f64);

/// A velocity without divergence, the nearest to the given one, and how it was found.
#[pyclass(frozen, skip_from_py_object, module = "tumble.fields")]
pub struct Projection {
    velocity: Vec<state::Field>,
    potential: state::Field,
    found: Found,
    speed: f64,
}

#[pymethods]
impl Projection {
    /// The velocity that is left, on faces.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let all = self.velocity.iter().map(|field| Bound::new(py, Field { field: field.clone() })).collect::<PyResult<Vec<_>>>()?;
        PyTuple::new(py, all)
    }

    /// The potential of the removed gradient: the step times the pressure over the density [m²/s].
    #[getter]
    fn potential(&self) -> Field {
        Field { field: self.potential.clone() }
    }

    /// The largest |div u| dx over the largest |u| before the projection: at the start, and after each iteration.
    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let unit = 1.0 / (self.potential.grid.dx * self.speed);
        PyArray1::from_vec(py, self.found.history.iter().map(|r| r * unit).collect())
    }

    /// When that was [s], from the start of the solution.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.found.times.clone())
    }

    /// Time [s] for all that depends on the grid and its solids alone.
    #[getter]
    fn set_up(&self) -> f64 {
        self.found.set_up
    }

    /// Iterations made.
    #[getter]
    fn iterations(&self) -> usize {
        self.found.history.len().saturating_sub(1)
    }

    /// How often what was left was evaluated anew and solved for.
    #[getter]
    fn refinements(&self) -> usize {
        self.found.refinements
    }

    /// Whether the tolerance is met.
    #[getter]
    fn converged(&self) -> bool {
        self.found.converged
    }

    /// Spaces that no open face joins to the largest one.
    #[getter]
    fn pockets(&self) -> usize {
        self.found.pockets
    }

    fn __repr__(&self) -> String {
        let last = self.found.history.last().copied().unwrap_or_default() / (self.potential.grid.dx * self.speed);
        format!("Projection({} iterations, max |div u| dx/max |u| = {last:.1e})", self.iterations())
    }
}

/// The velocity without divergence that is nearest to a given one between walls at rest.                     (pressure.1)
#[pyfunction]
#[pyo3(signature = (velocity, open=None, method="multigrid_gradients", tolerance=1e-5, iterations=None, precision="double"),
    text_signature = "(velocity, open=None, method='multigrid_gradients', tolerance=1e-05, iterations=1000, precision='double')")]
pub fn project(
    py: Python<'_>,
    velocity: &Bound<'_, PyAny>,
    open: Option<&Bound<'_, PyAny>>,
    method: &str,
    tolerance: f64,
    iterations: Option<&Bound<'_, PyAny>>,
    precision: &str,
) -> PyResult<Projection> {
    let iterations = iterations.map_or(Ok(1000), |n| count(n, "iterations", 1))?;
    let Some(of_all) = METHODS.iter().position(|m| *m == method) else {
        return Err(wrong(unknown("method", method, &METHODS)));
    };
    if tolerance.is_nan() || tolerance <= 0.0 {
        return Err(wrong(format!("tolerance: {tolerance}, expected > 0")));
    }
    let solve = match precision {
        "single" => single,
        "double" => double,
        _ => return Err(wrong(unknown("precision", precision, &["single", "double"]))),
    };
    let mut u = parts(velocity, "projected velocity")?;
    let grid = checked(u.on_faces("projected velocity"))?;
    let lattice = grid.lattice();
    let shares = open.map(|open| parts(open, "open shares of faces")).transpose()?;
    if let Some(shares) = &shares {
        if checked(shares.on_faces("open shares of faces"))? != grid {
            return Err(wrong("open shares of faces: on another grid than the velocity"));
        }
        if let Some(bad) = shares.parts.iter().flat_map(state::Field::values).find(|w| !(0.0..=1.0).contains(w)) {
            return Err(wrong(format!("open shares of faces: {bad}, expected 0 to 1")));
        }
    }
    // Open parts of 127; on closed sides of the box none.
    let mut bytes = [(); 3].map(|()| vec![0_u8; lattice.len()]);
    let mut flow = u.clone();
    let mut speed = 0.0_f64;
    for (p, axis) in grid.axes().enumerate() {
        for at in u.parts[p].each() {
            let i = u.parts[p].index(at);
            let side = !grid.periodic[axis] && (at[axis] == 0 || at[axis] == grid.n[axis]);
            let share = shares.as_ref().map_or(1.0, |shares| shares.parts[p].data[i]);
            let w = if side { 0 } else { byte(share) };
            bytes[axis][i] = w;
            if w == 0 {
                u.parts[p].data[i] = 0.0;
            }
            speed = speed.max(u.parts[p].data[i].abs());
            flow.parts[p].data[i] = f64::from(w) / 127.0 * u.parts[p].data[i];
        }
    }
    if !speed.is_finite() || speed == 0.0 {
        return Err(wrong(format!("projected velocity: at most {speed} m/s on open faces, expected something finite that moves")));
    }
    let mut potential = checked(state::Field::new(grid, Place::Cell, "m²/s"))?;
    let found = py.detach(|| {
        let mut b = checked(state::Field::new(grid, Place::Cell, ""))?;
        checked(verbs::divergence(&flow, &mut b))?;
        b.data.iter_mut().for_each(|b| *b *= -grid.dx * grid.dx);
        let largest = tolerance * grid.dx * speed;
        let found = solve(&Asked { grid: &grid, open: &bytes, b: &b.data, method: of_all, largest, iterations }).map_err(wrong)?;
        potential.data.copy_from_slice(&found.q);
        let mut slope = u.clone();
        slope.parts.iter_mut().for_each(|part| part.unit = "m/s".into());
        checked(verbs::gradient(&potential, &mut slope))?;
        for (p, axis) in grid.axes().enumerate() {
            for at in u.parts[p].each() {
                let i = u.parts[p].index(at);
                if bytes[axis][i] > 0 {
                    u.parts[p].data[i] -= slope.parts[p].data[i];
                }
            }
        }
        Ok::<_, PyErr>(found)
    })?;
    Ok(Projection { velocity: u.parts, potential, found, speed })
}
