//! Viscosity under a free surface, on which nothing rubs: honey folds and coils.
//!
//!   u minimises   sum over faces of m (u - u*)² + h nu (2 sum over cells of w (du_a/dx_a)² + sum over edges of w (du_a/dx_b + du_b/dx_a)²)   (pic.10)
//!
//! m and w are the shares of liquid around faces, and in cells and around edges. All of the rate of strain is in it, not the Laplacian alone, so that
//! what turns as a whole turns on. Solved by conjugate gradients.
//!
//! Source: [batty2008]; solids in steps of faces, first order.

use super::level::{Level, cell, share};
use crate::fluids::Solids;
use crate::math::Real;
use crate::math::parallel::{self, CHUNK, Tasks, chunks};
use crate::state::{Grid, Place, Vectors};
use std::ops::Range;
use tumble_interface::engine::StepReport;

/// Residual over velocity at which conjugate gradients stop.
#[cfg(not(feature = "double"))]
const TOLERANCE: f64 = 1e-5;
/// Residual over velocity at which conjugate gradients stop.
#[cfg(feature = "double")]
const TOLERANCE: f64 = 1e-10;
/// Iterations at most.
const ITERATIONS: u64 = 1000;
/// Mass of faces beside the liquid, which have none of their own.
const LIGHT: Real = 0.01;

/// One number for each face of each axis; nothing along a flat axis.
type Faces = [Vec<Real>; 3];

/// The matrix of a surface and a step.
pub struct Viscosity {
    grid: Grid,
    mass: Faces,
    /// By cells, and by edges along each axis.
    cells: Vec<Real>,
    edges: Faces,
    /// Inverse of the diagonal; 0 where the velocity is given.
    inverse: Faces,
    /// Where faces are free: numbers in a row, by chunks.
    runs: [Vec<Vec<Range<usize>>>; 3],
}

impl Viscosity {
    /// Of the kinematic viscosity nu [m²/s] for h seconds; `stick` to solids and sides, or slip along them.
    pub fn new(level: &Level, solids: Option<&Solids>, stick: bool, nu: f64, h: f64) -> Self {
        let grid = level.distance.grid;
        let len = grid.lattice().len();
        let c = (h * nu / (grid.dx * grid.dx)) as Real;
        let own = |axis: usize| if grid.flat == Some(axis) { 0 } else { len };
        let mut this = Self {
            grid,
            mass: [0, 1, 2].map(|axis| vec![0.0; own(axis)]),
            cells: vec![0.0; len],
            edges: [0, 1, 2].map(|axis| vec![0.0; if grid.axes().filter(|a| *a != axis).count() == 2 { len } else { 0 }]),
            inverse: [0, 1, 2].map(|axis| vec![0.0; own(axis)]),
            runs: Default::default(),
        };
        // The share of liquid in what a solid leaves of a cell; none where it leaves nothing, or beyond the box.
        let dry = |at: usize| level.cells[at] == cell::OUTSIDE || solids.is_some_and(|solids| solids.middle(at) <= 0.0);
        let wet = |at: usize| if dry(at) { None } else { Some(share(-level.distance.data[at])) };
        let mean = |cells: &[usize]| {
            let (sum, count) = cells.iter().filter_map(|at| wet(*at)).fold((0.0, 0.0), |(sum, count), w| (sum + w, count + 1.0));
            if count > 0.0 { sum / count } else { 0.0 }
        };
        let closed = |axis: usize, at: usize| solids.is_some_and(|solids| solids.open[axis][at] == 0);
        let stride = grid.lattice().stride;
        chunks(&mut this.cells, |start, cells| {
            cells.iter_mut().enumerate().for_each(|(i, w)| *w = 2.0 * c * wet(start + i).unwrap_or(0.0));
        });
        let inside = |from: usize, range: std::ops::Range<usize>| range.start >= from && range.end + from <= len;
        for axis in grid.axes() {
            let step = stride[axis];
            chunks(&mut this.mass[axis], |start, mass| {
                for (i, mass) in mass.iter_mut().enumerate().filter(|(i, _)| inside(step, start + i..start + i + 1)) {
                    *mass = mean(&[start + i, start + i - step]);
                }
            });
        }
        for along in 0..3 {
            let others: Vec<usize> = grid.axes().filter(|a| *a != along).collect();
            let [a, b] = others[..] else { continue };
            let (sa, sb) = (stride[a], stride[b]);
            chunks(&mut this.edges[along], |start, edges| {
                for (i, w) in edges.iter_mut().enumerate().filter(|(i, _)| inside(sa + sb, start + i..start + i + 1)) {
                    let at = start + i;
                    let around = [at, at - sa, at - sb, at - sa - sb];
                    let beyond = around.iter().filter(|at| level.cells[**at] == cell::OUTSIDE).count();
                    let shut = closed(a, at) || closed(a, at - sb) || closed(b, at) || closed(b, at - sa);
                    // Beyond a side to which it sticks velocities are reversed: read as 0, they count half.
                    *w = match (beyond, stick) {
                        (4, _) => 0.0,
                        (1.., false) => 0.0,
                        (1.., true) => 2.0 * c * mean(&around),
                        (0, false) if shut => 0.0,
                        (0, _) => c * mean(&around),
                    };
                }
            });
        }
        this.weigh(level, &closed);
        this.runs = this.inverse.each_ref().map(|free| {
            let chunks = free.chunks(CHUNK).enumerate();
            chunks.map_in_parallel(|(i, free)| runs(free).map(|run| i * CHUNK + run.start..i * CHUNK + run.end).collect())
        });
        this
    }

    /// The diagonal, and which faces are free: those beside liquid.
    fn weigh(&mut self, level: &Level, closed: &(dyn Fn(usize, usize) -> bool + Sync)) {
        let Self { grid, mass, cells, edges, inverse, .. } = self;
        let (lattice, stride) = (grid.lattice(), grid.lattice().stride);
        for axis in grid.axes() {
            let points = grid.points(Place::Face(axis));
            for k in 0..points[2] {
                for j in 0..points[1] {
                    for i in 0..points[0] {
                        let (at, along) = (lattice.at(i, j, k), [i, j, k][axis]);
                        let step = stride[axis];
                        let side = level.cells[at] == cell::OUTSIDE || level.cells[at - step] == cell::OUTSIDE;
                        if along == 0 || along == grid.n[axis] || side || closed(axis, at) {
                            continue;
                        }
                        let mut sum = cells[at] + cells[at - step];
                        for b in grid.axes().filter(|b| *b != axis) {
                            let edges = &edges[3 - axis - b];
                            sum += edges[at] + edges[at + stride[b]];
                        }
                        if mass[axis][at] + sum > 0.0 {
                            mass[axis][at] = mass[axis][at].max(LIGHT);
                            inverse[axis][at] = 1.0 / (mass[axis][at] + sum);
                        }
                    }
                }
            }
        }
    }

    /// Rows of the matrix times x.
    fn times(&self, x: &Faces, out: &mut Faces) {
        let stride = self.grid.lattice().stride;
        for axis in self.grid.axes() {
            let (own, step, cells, mass) = (&x[axis], stride[axis], &self.cells, &self.mass[axis]);
            let others: Vec<_> = self.grid.axes().filter(|b| *b != axis).map(|b| (&self.edges[3 - axis - b], &x[b], stride[b])).collect();
            self.along(axis, &mut out[axis], |at, _| {
                let upper = cells[at] * (own[at + step] - own[at]);
                let lower = cells[at - step] * (own[at] - own[at - step]);
                let mut sum = mass[at] * own[at] - (upper - lower);
                for (edges, other, across) in &others {
                    let shear = |at: usize| edges[at] * (own[at] - own[at - across] + other[at] - other[at - step]);
                    sum -= shear(at + across) - shear(at);
                }
                sum
            });
        }
    }

    /// Puts `f(number, value)` at each free face of an axis.
    fn along(&self, axis: usize, out: &mut [Real], f: impl Fn(usize, Real) -> Real + Sync) {
        chunks(out, |start, out| {
            for run in &self.runs[axis][start / CHUNK] {
                let own = &mut out[run.start - start..run.end - start];
                own.iter_mut().zip(run.clone()).for_each(|(out, at)| *out = f(at, *out));
            }
        });
    }

    /// Puts `f(axis, number, value)` at each free face.
    fn each(&self, out: &mut Faces, f: impl Fn(usize, usize, Real) -> Real + Sync) {
        self.grid.axes().for_each(|axis| self.along(axis, &mut out[axis], |at, old| f(axis, at, old)));
    }

    /// a . b over the free faces, in a fixed order.
    fn dot(&self, a: &Faces, b: &Faces) -> f64 {
        let of = |axis: usize| {
            let (a, b) = (&a[axis], &b[axis]);
            parallel::map(self.runs[axis].len(), |i| {
                let faces = self.runs[axis][i].iter().flat_map(|run| a[run.clone()].iter().zip(&b[run.clone()]));
                faces.fold(0.0, |sum, (a, b)| sum + f64::from(*a) * f64::from(*b))
            })
        };
        self.grid.axes().flat_map(of).sum()
    }

    /// Acts on velocities, which must be known beside the liquid; those of closed faces are the solids'.
    pub fn act(&self, u: &mut Vectors, report: &mut StepReport) {
        let zero = || -> Faces { self.inverse.each_ref().map(|faces| vec![0.0; faces.len()]) };
        let mut x = zero();
        let lattice = self.grid.lattice();
        for (axis, part) in self.grid.axes().zip(&u.parts) {
            // Beyond the box it is at rest, and so are its sides.
            let points = self.grid.points(Place::Face(axis));
            let from: [usize; 3] = std::array::from_fn(|a| usize::from(a == axis));
            for k in from[2]..points[2] - from[2] {
                for j in from[1]..points[1] - from[1] {
                    let row = lattice.at(from[0], j, k)..lattice.at(points[0] - from[0], j, k);
                    x[axis][row.clone()].copy_from_slice(&part.data[row]);
                }
            }
        }
        let (mut r, mut z, mut p, mut product) = (zero(), zero(), zero(), zero());
        let start = x.clone();
        self.times(&start, &mut product);
        self.each(&mut r, |axis, at, _| self.mass[axis][at] * start[axis][at] - product[axis][at]);
        self.each(&mut z, |axis, at, _| self.inverse[axis][at] * r[axis][at]);
        p.clone_from(&z);
        let mut rz = self.dot(&r, &z);
        let mut scale = zero();
        self.each(&mut scale, |axis, at, _| self.mass[axis][at] * start[axis][at]);
        let enough = TOLERANCE * TOLERANCE * self.dot(&scale, &start).max(rz);
        let mut iterations = 0;
        while rz > enough && iterations < ITERATIONS {
            iterations += 1;
            self.times(&p, &mut product);
            let alpha = (rz / self.dot(&p, &product)) as Real;
            if !alpha.is_finite() {
                break;
            }
            self.each(&mut x, |axis, at, x| x + alpha * p[axis][at]);
            self.each(&mut r, |axis, at, r| r - alpha * product[axis][at]);
            self.each(&mut z, |axis, at, _| self.inverse[axis][at] * r[axis][at]);
            let after = self.dot(&r, &z);
            let beta = (after / rz) as Real;
            self.each(&mut p, |axis, at, p| z[axis][at] + beta * p);
            rz = after;
        }
        report.linear += iterations;
        report.unconverged += u64::from(rz > enough || rz.is_nan());
        for (axis, part) in self.grid.axes().zip(&mut u.parts) {
            self.along(axis, &mut part.data, |at, _| x[axis][at]);
        }
    }
}

/// Where numbers are above zero, in a row.
fn runs(free: &[Real]) -> impl Iterator<Item = Range<usize>> + '_ {
    let mut at = 0;
    std::iter::from_fn(move || {
        let start = at + free[at..].iter().position(|f| *f > 0.0)?;
        at = free[start..].iter().position(|f| *f <= 0.0).map_or(free.len(), |n| start + n);
        Some(start..at)
    })
}
