//! The projection: takes from a velocity the gradient that makes it free of divergence.               (gas.4, pressure.1)

use super::failure::Failure;
use super::rows::{self, Face, runs};
use super::sides::{Beyond, hold};
use super::solids::Solids;
use crate::linalg::poisson::{Directions, Excess, Fault, Info, Params, Solver, Target, Weight};
use crate::math::parallel::chunks;
use crate::math::{Column, Real};
use crate::operators::each_row;
use crate::state::{Field, Place, Vectors};
use tumble_interface::engine::StepReport;
use tumble_interface::scene::OnFailure;

/// b = -dx D u = -dx² div u at the cells.                                             (pressure.2)
pub fn right_side(u: &Vectors, b: &mut Field) {
    let grid = b.grid;
    let lattice = grid.lattice();
    let dx = grid.dx as Real;
    each_row(b, |j, k, row| {
        let at = lattice.at(0, j, k);
        let n = row.len();
        row.fill(0.0);
        for (axis, part) in grid.axes().zip(&u.parts) {
            let (cell, stride) = ([0, j, k], lattice.stride[axis]);
            let wraps = |i: usize| grid.periodic[axis] && i + 1 == grid.n[axis];
            let low = &part.data[at..];
            if axis == 0 {
                let high = &part.data[at + 1..];
                for i in 0..n {
                    row[i] += dx * (low[i] - if wraps(i) { low[0] } else { high[i] });
                }
            } else {
                let high = if wraps(cell[axis]) { &part.data[at - (grid.n[axis] - 1) * stride..] } else { &part.data[at + stride..] };
                for i in 0..n {
                    row[i] += dx * (low[i] - high[i]);
                }
            }
        }
    });
}

/// The same around solids, where the divergence is to be S.                              (gas.10, fire.3)
pub fn around(u: &Vectors, solids: Option<&Solids>, swelling: Option<&Field>, b: &mut Field) {
    right_side(u, b);
    if let Some(swelling) = swelling {
        let scale = (b.grid.dx * b.grid.dx) as Real;
        each_row(b, |j, k, row| {
            let at = swelling.index([0, j, k]);
            row.iter_mut().zip(&swelling.data[at..]).for_each(|(b, s)| *b += scale * s);
        });
    }
    solids.iter().for_each(|solids| solids.correct(u, b));
}

/// u -= rho_0/rho_f grad q, on the sides of the box only where they are open.                      (pressure.1, gas.13)
pub fn subtract_gradient(u: &mut Vectors, q: &[Real], open: [[bool; 2]; 3], light: Option<&Vectors>) {
    for (index, part) in u.parts.iter_mut().enumerate() {
        let light = light.and_then(|light| light.parts.get(index));
        let Place::Face(axis) = part.place else { continue };
        let scale = (1.0 / part.grid.dx) as Real;
        let grid = part.grid;
        let lattice = grid.lattice();
        each_row(part, |j, k, row| {
            if let Some(light) = light {
                let at = lattice.at(0, j, k);
                let mut done = 0;
                return runs(&grid, axis, j, k, row, |run, face| {
                    let light = &light.data[at + done..][..run.len()];
                    done += run.len();
                    let (low, high, scale) = match face {
                        Face::Between(low, high) => (Some(low), Some(high), scale),
                        Face::Lower(cell) if open[axis][0] => (None, Some(cell), 2.0 * scale),
                        Face::Upper(cell) if open[axis][1] => (Some(cell), None, 2.0 * scale),
                        Face::Lower(_) | Face::Upper(_) => return,
                    };
                    let q = |cell: Option<usize>, i: usize| cell.map_or(0.0, |cell| q[cell + i]);
                    for i in 0..run.len() {
                        run[i] -= scale * light[i] * (q(high, i) - q(low, i));
                    }
                });
            }
            runs(&grid, axis, j, k, row, |run, face| match face {
                Face::Between(low, high) => {
                    let n = run.len();
                    let (low, high) = (&q[low..low + n], &q[high..high + n]);
                    for i in 0..n {
                        run[i] -= scale * (high[i] - low[i]);
                    }
                }
                Face::Lower(cell) if open[axis][0] => run.iter_mut().zip(&q[cell..]).for_each(|(u, q)| *u -= 2.0 * scale * q),
                Face::Upper(cell) if open[axis][1] => run.iter_mut().zip(&q[cell..]).for_each(|(u, q)| *u += 2.0 * scale * q),
                Face::Lower(_) | Face::Upper(_) => {}
            });
        });
    }
}

/// Solves with a correction among the spare columns.
fn refine<T: Weight>(
    solver: &mut Solver<T>,
    params: &Params,
    evaluate: impl FnMut(&Solver<T>, Option<&[Real]>, &mut Column),
) -> Result<Info, Fault> {
    let mut correction = solver.spare.column(solver.lattice().len());
    let info = solver.refine(&mut correction, params, evaluate);
    solver.spare.give(correction);
    info
}

/// The weights of the pressure equation: open shares times rho_0/rho_f.                                  (gas.13)
fn weights(light: &Vectors, open: Option<&[Vec<u8>; 3]>, len: usize) -> [Vec<Real>; 3] {
    std::array::from_fn(|axis| {
        let share = |i: usize| open.map_or(1.0, |open| open[axis][i].value());
        let light = light.part(axis);
        light.map_or_else(|| vec![1.0; len], |light| light.data.iter().enumerate().map(|(i, light)| share(i) * light).collect())
    })
}

/// The largest component of a velocity on any face [m/s]; bodies count by their speed.
pub fn fastest(u: &Vectors, solids: Option<&Solids>) -> f64 {
    let bodies = solids.map_or(0.0, Solids::fastest);
    u.parts.iter().map(rows::magnitude).fold(bodies, rows::worse)
}

/// A projection of the velocity of a fluid: what it changes, what it is given, and how exact it is.
pub struct PressureProjection<'a> {
    /// Velocity on faces [m/s].
    pub u: &'a mut Vectors,
    /// Pressure at cells [Pa], taken anew.
    pub pressure: &'a mut Field,
    /// The pressure equation around the solids.
    pub solver: &'a mut Solver<u8>,
    /// Solids in the fluid; bodies take the impulse of the pressure.
    pub solids: Option<&'a mut Solids>,
    /// The lower and the upper side of each axis.
    pub sides: &'a [[Beyond; 2]; 3],
    /// Density rho_0 [kg/m³].
    pub density: f64,
    /// Density rho_0 over that of the fluid at faces, where it varies.
    pub light: Option<&'a Vectors>,
    /// Divergence S at cells, where it is not zero [1/s].
    pub swelling: Option<&'a Field>,
    /// The pressure solver; its target is the tolerance.
    pub params: Params,
    /// Largest |div u - S| dx over the fastest velocity.
    pub tolerance: f64,
    /// Behaviour if it is not met.
    pub on_failure: OnFailure,
}

impl PressureProjection<'_> {
    /// Gives the velocity at time t the divergence S; h [s] only scales the pressure that it takes.          (gas.4)
    pub fn run(self, t: f64, h: f64, report: &mut StepReport) -> Result<(), Failure> {
        let Self { u, pressure, solver, mut solids, sides, density, light, swelling, params, tolerance, on_failure } = self;
        hold(u, sides, t);
        if let Some(solids) = &solids {
            solids.close(u);
        }
        let mut fastest = fastest(u, solids.as_deref());
        if fastest == 0.0 {
            // Solids that come in have cut faces only, and no fluid moves yet.
            fastest = solids.as_deref().map_or(0.0, Solids::fastest_cut);
        }
        let mass = density * solids.as_deref().map_or(0.0, Solids::area);
        let grid = pressure.grid;
        let dx = grid.dx;
        if let Some(swelling) = swelling {
            // A fluid at rest is moved by nothing else.
            fastest = rows::worse(fastest, dx * rows::magnitude(swelling));
        }
        let asked = tolerance * dx * fastest;
        let params = match params.excess {
            Excess::Refuse => Params { excess: Excess::RefuseAbove(4.0 * f64::from(Real::EPSILON) * dx * fastest), ..params },
            _ => params,
        };
        let mut params = Params { target: Target::Largest(asked), ..params };
        if solids.as_deref().is_some_and(Solids::moves) {
            // Walls that come closer press out what no pressure can hold.
            params.excess = Excess::Remove;
        }
        let open = Beyond::open(sides);
        pressure.data.fill(0.0);
        let to_pressure = (density / h) as Real;
        // Another equation in every step.
        let varying = light.map(|light| {
            let weights = weights(light, solids.as_deref().map(|solids| &solids.open), pressure.data.len());
            let sides = sides.each_ref().map(|ends| ends.each_ref().map(Beyond::pressure));
            let mut varying = Solver::new(solver.lattice(), sides, weights.each_ref().map(Vec::as_slice), None)?;
            varying.join(solids.as_deref().map_or(Vec::new(), |solids| solids.joints(density, |_| true)));
            varying.spare = std::mem::take(&mut solver.spare);
            Ok(varying)
        });
        let mut varying = varying.transpose().map_err(Failure::Pressure)?;
        let mut take = |yielded: &dyn Fn(&[Real]) -> Vec<Directions>, q: Option<&[Real]>, b: &mut Column| {
            if let Some(q) = q {
                subtract_gradient(u, q, open, light);
                if let Some(solids) = &mut solids {
                    solids.bodies.iter_mut().zip(yielded(q)).for_each(|(body, product)| body.yield_to(&product, mass));
                    solids.follow();
                    solids.close(u);
                }
                chunks(&mut pressure.data, |start, p| p.iter_mut().zip(&q[start..]).for_each(|(p, q)| *p += to_pressure * q));
            }
            let mut left = Field { grid, place: Place::Cell, sides: Default::default(), unit: "m²/s".into(), data: std::mem::take(b) };
            around(u, solids.as_deref(), swelling, &mut left);
            *b = left.data;
        };
        let info = match &mut varying {
            None => refine(solver, &params, |solver, q, b| take(&|q| solver.yielded(q), q, b)),
            Some(varying) => refine(varying, &params, |solver, q, b| take(&|q| solver.yielded(q), q, b)),
        };
        if let Some(varying) = varying {
            solver.spare = varying.spare;
        }
        let info = info.map_err(Failure::Pressure)?;
        report.linear += info.iterations as u64;
        report.pressure = info.residuals;
        let reached = if fastest > 0.0 { info.largest / (dx * fastest) } else { 0.0 };
        report.left(reached);
        if !info.converged {
            if on_failure == OnFailure::Error {
                return Err(Failure::Unconverged { iterations: info.iterations, reached, asked: tolerance });
            }
            report.unconverged += 1;
        }
        Ok(())
    }
}
