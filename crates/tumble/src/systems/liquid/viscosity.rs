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
use crate::math::parallel::{chunks, fold};
use crate::state::{Grid, Place, Vectors};
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
        this
    }

    /// The diagonal, and which faces are free: those beside liquid.
    fn weigh(&mut self, level: &Level, closed: &(dyn Fn(usize, usize) -> bool + Sync)) {
        let Self { grid, mass, cells, edges, inverse } = self;
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

    /// One row of the matrix times x.
    #[inline(always)]
    fn times(&self, x: &Faces, axis: usize, at: usize) -> Real {
        let stride = self.grid.lattice().stride;
        let (own, step) = (&x[axis], stride[axis]);
        let upper = self.cells[at] * (own[at + step] - own[at]);
        let lower = self.cells[at - step] * (own[at] - own[at - step]);
        let mut sum = self.mass[axis][at] * own[at] - (upper - lower);
        for b in self.grid.axes().filter(|b| *b != axis) {
            let (edges, other, across) = (&self.edges[3 - axis - b], &x[b], stride[b]);
            let shear = |at: usize| edges[at] * (own[at] - own[at - across] + other[at] - other[at - step]);
            sum -= shear(at + across) - shear(at);
        }
        sum
    }

    /// Calls `f(axis, number)` for each free face, and puts what it returns there.
    fn each(&self, out: &mut Faces, f: impl Fn(usize, usize) -> Real + Sync) {
        for axis in self.grid.axes() {
            let free = &self.inverse[axis];
            chunks(&mut out[axis], |start, out| {
                for (i, out) in out.iter_mut().enumerate() {
                    if free[start + i] > 0.0 {
                        *out = f(axis, start + i);
                    }
                }
            });
        }
    }

    /// a . b over the faces, in a fixed order.
    fn dot(&self, a: &Faces, b: &Faces) -> f64 {
        let of = |axis: usize| fold(a[axis].len(), |range| range.map(|i| f64::from(a[axis][i]) * f64::from(b[axis][i])).sum::<f64>());
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
        self.each(&mut r, |axis, at| self.mass[axis][at] * start[axis][at] - self.times(&start, axis, at));
        self.each(&mut z, |axis, at| self.inverse[axis][at] * r[axis][at]);
        p.clone_from(&z);
        let mut rz = self.dot(&r, &z);
        let mut scale = zero();
        self.each(&mut scale, |axis, at| self.mass[axis][at] * start[axis][at]);
        let enough = TOLERANCE * TOLERANCE * self.dot(&scale, &start).max(rz);
        let mut iterations = 0;
        while rz > enough && iterations < ITERATIONS {
            iterations += 1;
            self.each(&mut product, |axis, at| self.times(&p, axis, at));
            let alpha = (rz / self.dot(&p, &product)) as Real;
            if !alpha.is_finite() {
                break;
            }
            for axis in self.grid.axes() {
                let (p, product) = (&p[axis], &product[axis]);
                chunks(&mut x[axis], |start, x| x.iter_mut().zip(&p[start..]).for_each(|(x, p)| *x += alpha * p));
                chunks(&mut r[axis], |start, r| r.iter_mut().zip(&product[start..]).for_each(|(r, q)| *r -= alpha * q));
            }
            self.each(&mut z, |axis, at| self.inverse[axis][at] * r[axis][at]);
            let after = self.dot(&r, &z);
            let beta = (after / rz) as Real;
            for axis in self.grid.axes() {
                let z = &z[axis];
                chunks(&mut p[axis], |start, p| p.iter_mut().zip(&z[start..]).for_each(|(p, z)| *p = z + beta * *p));
            }
            rz = after;
        }
        report.linear += iterations;
        report.unconverged += u64::from(rz > enough || rz.is_nan());
        for (axis, part) in self.grid.axes().zip(&mut u.parts) {
            let (free, x) = (&self.inverse[axis], &x[axis]);
            chunks(&mut part.data, |start, u| {
                for (i, u) in u.iter_mut().enumerate().filter(|(i, _)| free[start + i] > 0.0) {
                    *u = x[start + i];
                }
            });
        }
    }
}
