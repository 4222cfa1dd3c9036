//! The pressure under a free surface, where it is zero.
//!
//! Between a cell with liquid and one without, the surface is the part theta of the way, and so
//!   theta = phi_i/(phi_i - phi_j),   u_f -= (0 - q_i)/(theta dx),   d_i += w_f/theta                                       (pic.6)
//!
//! Where the surface is curved, the pressure on it is gamma kappa (pic.11), and q there h gamma kappa/rho.
//!
//! Source: [gibou2002]; theta is at least 1/100, so that a cell that the surface barely holds does not rule the matrix.

use super::level::{Level, cell};
use crate::fluids::projection::{around, fastest, subtract_gradient};
use crate::fluids::{Beyond, Failure, Solids, hold};
use crate::linalg::poisson::{Excess, Params, Solver, Target, Weight};
use crate::math::parallel::{Tasks, chunks};
use crate::math::{Column, Real, Spare};
use crate::state::{Field, Grid, Place, Vectors};
use tumble_interface::engine::StepReport;
use tumble_interface::scene::OnFailure;

/// The least part of the way to the next cell at which a surface may lie.
const LEAST: Real = 0.01;
/// How much farther inside the particles of a surface lie than those of a lattice whose surface is as far [cells].
const INSIDE: Real = 0.08;
/// The largest excess or lack of density that is removed at once.
const MOST: Real = 0.5;
/// Part of what solids take of a cell's space within which its density may be off.
const UNSURE: Real = 0.5;
/// Residual of the displacement, relative to the density's error.
const DISPLACED: f64 = 1e-2;

/// How the pressure is found.
#[derive(Debug, Clone, Copy)]
pub struct Accuracy {
    /// Largest |div u| dx over the fastest velocity.
    pub tolerance: f64,
    /// Iterations at most.
    pub iterations: usize,
    /// Behaviour if it is not met.
    pub on_failure: OnFailure,
}

/// A face that the surface lies behind.
struct Open {
    /// The component of the velocity.
    part: usize,
    at: u32,
    /// The cell with liquid, and the one without.
    cells: [u32; 2],
    /// 1 if the liquid is on the lower side, else -1.
    sign: Real,
    inverse: Real,
}

/// The matrix under a surface.
pub struct Matrix {
    solver: Solver<u8>,
    surface: Vec<Open>,
}

/// No side of the box is open.
const CLOSED: [[bool; 2]; 3] = [[false; 2]; 3];

impl Matrix {
    /// Of the liquid below a surface, between sides that are walls.
    pub fn new(level: &Level, solids: Option<&Solids>, sides: &[[Beyond; 2]; 3], spare: Spare) -> Result<Self, Failure> {
        let grid = level.distance.grid;
        let (lattice, len) = (grid.lattice(), grid.lattice().len());
        let mut weights = [(); 3].map(|()| vec![u8::CLOSED; len]);
        let mut extra = vec![0.0; len];
        let plane = lattice.stride[2];
        let first = lattice.at(0, 0, 0) - lattice.stride[1];
        let [wx, wy, wz] = &mut weights;
        let mut rest = [wx, wy, wz].map(|w| w[first..].chunks_mut(plane));
        let tasks: Vec<_> = extra[first..]
            .chunks_mut(plane)
            .take(grid.n[2])
            .map(|extra| (extra, rest.each_mut().map(|w| w.next().unwrap_or_default())))
            .collect();
        let found = tasks.into_iter().enumerate().map_in_parallel(|(k, (extra, mut weights))| {
            let mut surface = Vec::new();
            for j in 0..grid.n[1] {
                let row = lattice.at(0, j, k);
                for at in row..row + grid.n[0] {
                    if level.cells[at] == cell::LIQUID {
                        let own = at - first - k * plane;
                        extra[own] = weigh(&grid, level, solids, at, |axis, weight| weights[axis][own] = weight, &mut surface);
                    }
                }
            }
            surface
        });
        let sides = sides.each_ref().map(|ends| ends.each_ref().map(Beyond::pressure));
        let mut solver = Solver::new(lattice, sides, weights.each_ref().map(Vec::as_slice), Some(&extra)).map_err(Failure::Pressure)?;
        solver.spare = spare;
        Ok(Self { solver, surface: found.into_iter().flatten().collect() })
    }

    /// Its spare columns, for the next one.
    pub fn into_spare(self) -> Spare {
        self.solver.spare
    }

    /// Makes bodies a part of it; `density` is that of the liquid [kg/m³].
    pub fn join(&mut self, level: &Level, solids: &Solids, density: f64) {
        self.solver.join(solids.joints(density, |cell| level.cells[cell as usize] == cell::LIQUID));
    }

    /// The pressure [m²/s, times the time] that a surface has by itself drives a velocity.                     (pic.11)
    pub fn pull(&self, u: &mut Vectors, at_surface: &[Real]) {
        let Some(scale) = u.parts.first().map(|part| (1.0 / part.grid.dx) as Real) else { return };
        for (face, q) in self.surface.iter().zip(at_surface) {
            u.parts[face.part].data[face.at as usize] -= face.sign * scale * face.inverse * q;
        }
    }

    /// The cells beside each face to the surface, the one with liquid first, and the part of the way from there to the surface.
    pub fn crossings(&self) -> impl Iterator<Item = ([u32; 2], Real)> {
        self.surface.iter().map(|face| (face.cells, 1.0 / face.inverse))
    }

    /// Makes a velocity at time t free of divergence in the liquid; h [s] is the time for which the pressure [Pa] acts.
    pub fn project(
        &mut self,
        u: &mut Vectors,
        pressure: &mut Field,
        level: &Level,
        (mut solids, sides): (Option<&mut Solids>, &[[Beyond; 2]; 3]),
        (t, h, density): (f64, f64, f64),
        accuracy: Accuracy,
        report: &mut StepReport,
    ) -> Result<(), Failure> {
        hold(u, sides, t);
        solids.iter().for_each(|solids| solids.close(u));
        let grid = pressure.grid;
        let speed = fastest(u, solids.as_deref()).max(solids.as_deref().map_or(0.0, Solids::fastest_cut));
        let mass = density * solids.as_deref().map_or(0.0, Solids::area);
        // Walls that come closer press out what no pressure can hold.
        let params = Params {
            target: Target::Largest(accuracy.tolerance * grid.dx * speed),
            iterations: accuracy.iterations,
            excess: Excess::Remove,
            ..Params::default()
        };
        pressure.data.fill(0.0);
        let scale = (density / h) as Real;
        let Self { solver, surface } = self;
        let mut correction = solver.spare.column(pressure.data.len());
        let info = solver.refine(&mut correction, &params, |solver, q, b| {
            if let Some(q) = q {
                subtract(surface, u, q);
                if let Some(solids) = &mut solids {
                    solids.bodies.iter_mut().zip(solver.yielded(q)).for_each(|(body, product)| body.yield_to(&product, mass));
                    solids.follow();
                    solids.close(u);
                }
                chunks(&mut pressure.data, |start, p| p.iter_mut().zip(&q[start..]).for_each(|(p, q)| *p += scale * q));
            }
            let mut left = Field { grid, place: Place::Cell, sides: Default::default(), unit: "m²/s".into(), data: std::mem::take(b) };
            around(u, solids.as_deref(), None, &mut left);
            keep_liquid(&mut left.data, level);
            *b = left.data;
        });
        solver.spare.give(correction);
        let info = info.map_err(Failure::Pressure)?;
        beyond(surface, pressure);
        report.linear += info.iterations as u64;
        report.pressure = info.residuals;
        let reached = if speed > 0.0 { info.largest / (grid.dx * speed) } else { 0.0 };
        report.left(reached);
        if !info.converged {
            if accuracy.on_failure == OnFailure::Error {
                return Err(Failure::Unconverged { iterations: info.iterations, reached, asked: accuracy.tolerance });
            }
            report.unconverged += 1;
        }
        Ok(())
    }

    /// Displacements on faces [cells] after which the liquid is as dense as at rest;
    /// `density` is relative to that at rest, in the `room` that solids leave.                                                                    (pic.9)
    pub fn displace(
        &mut self,
        density: &Field,
        level: &Level,
        room: Option<&[Real]>,
        solids: Option<&Solids>,
        way: &mut Vectors,
        report: &mut StepReport,
    ) -> Result<(), Failure> {
        let grid = density.grid;
        let mut b = self.solver.spare.column(density.data.len());
        let mut q = self.solver.spare.column(density.data.len());
        let dx = grid.dx as Real;
        chunks(&mut b, |start, b| {
            for (i, b) in b.iter_mut().enumerate() {
                let at = start + i;
                // What a cell so far below a plane surface has of the density.
                let above = (1.0 - INSIDE + level.distance.data[at]).clamp(0.0, 1.0);
                let excess = density.data[at] - 1.0 + 0.5 * above * above;
                // What solids leave of the space around a cell is known to some part.
                let unsure = room.map_or(0.0, |room| UNSURE * (1.0 - room[at]).max(0.0));
                *b = dx * (excess - excess.clamp(-unsure, unsure)).clamp(-MOST, MOST);
            }
        });
        keep_liquid(&mut b, level);
        let params = Params { target: Target::Relative(DISPLACED), iterations: 50, excess: Excess::Remove, ..Params::default() };
        let solved = self.solver.solve(&b, &mut q, &params);
        way.parts.iter_mut().for_each(|part| part.data.fill(0.0));
        subtract(&self.surface, way, &q);
        if let Some(solids) = solids {
            way.parts.iter_mut().for_each(|part| solids.free(part));
        }
        [b, q].into_iter().for_each(|column| self.solver.spare.give(column));
        report.linear += solved.map_err(Failure::Pressure)?.iterations as u64;
        Ok(())
    }
}

/// Takes the gradient of q [m²/s] from a velocity.
fn subtract(surface: &[Open], u: &mut Vectors, q: &[Real]) {
    subtract_gradient(u, q, CLOSED, None);
    let Some(scale) = u.parts.first().map(|part| (1.0 / part.grid.dx) as Real) else { return };
    for face in surface {
        u.parts[face.part].data[face.at as usize] += face.sign * scale * (face.inverse - 1.0) * q[face.cells[0] as usize];
    }
}

/// Gives cells beside the liquid the pressure that goes on behind the surface.
fn beyond(surface: &[Open], pressure: &mut Field) {
    let behind = |face: &Open| (face.cells[1], pressure.data[face.cells[0] as usize] * (1.0 - face.inverse));
    let mut behind: Vec<(u32, Real)> = surface.iter().map(behind).collect();
    behind.sort_by_key(|(cell, _)| *cell);
    for same in behind.chunk_by(|a, b| a.0 == b.0) {
        pressure.data[same[0].0 as usize] = same.iter().map(|(_, p)| p).sum::<Real>() / same.len() as Real;
    }
}

/// Sets what is not liquid to zero.
fn keep_liquid(column: &mut Column, level: &Level) {
    chunks(column, |start, column| {
        for (x, cell) in column.iter_mut().zip(&level.cells[start..]) {
            if *cell != cell::LIQUID {
                *x = 0.0;
            }
        }
    });
}

/// Weights of the lower faces of a cell with liquid; returns what its faces to the surface add to the diagonal.
fn weigh(
    grid: &Grid,
    level: &Level,
    solids: Option<&Solids>,
    at: usize,
    mut lower: impl FnMut(usize, u8),
    surface: &mut Vec<Open>,
) -> Real {
    let stride = grid.lattice().stride;
    let mut extra = 0.0;
    for (part, axis) in grid.axes().enumerate() {
        for (other, face, sign) in [(at - stride[axis], at, -1.0), (at + stride[axis], at + stride[axis], 1.0)] {
            let open = solids.map_or(u8::OPEN, |solids| solids.open[axis][face]);
            match level.cells[other] {
                cell::LIQUID if sign < 0.0 => lower(axis, open),
                cell::AIR if open > 0 => {
                    let (here, there) = (level.distance.data[at], level.distance.data[other]);
                    let inverse = 1.0 / (here / (here - there)).max(LEAST);
                    extra += open.value() * inverse;
                    surface.push(Open { part, at: face as u32, cells: [at as u32, other as u32], sign, inverse });
                }
                _ => {}
            }
        }
    }
    extra
}
