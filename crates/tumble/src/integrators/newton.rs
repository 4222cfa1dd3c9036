//! Newton's method for the stages of implicit schemes:
//!
//!   R(v) = M (v - v*)/gh - f(t, x* + gh v, v) = 0                     (integrators.13)
//!   (M/gh² + D/gh + K) dx = -R,   v += alpha dx/gh                    (integrators.14)
//!
//! R is the gradient of a potential if f has one, so the step length alpha is accepted by slopes alone, which stay exact
//! where differences of energies drown in round-off: dx.R(alpha) <= 0.8 |dx.R(0)| (the approximate Wolfe condition).
//! It needs no energy, so drag and friction may take part. Source: [nocedal2006], 3.1 and 7.1; [hager2005], T2.

use super::{Equation, Kinematics, Stage};
use crate::math::parallel::{chunk_sum, chunks, chunks2, sum};
use crate::math::{Real, Row, ZERO, axpy, dot, scale, sub};
use tumble_interface::StepError;
use tumble_interface::engine::StepReport;
use tumble_interface::scene::{Hessian, OnFailure, Solver};

/// An equation of second order whose stages can be solved by Newton's method.
pub trait Stiff: Equation {
    /// 1/m of every row [1/kg, 1/(kg m²)]; 0 holds a row still.
    fn inverse_mass(&self) -> &[Real];

    /// Forces f [N] at (t, x, v), with those that only implicit schemes see (contact).
    fn force(&mut self, t: f64, x: &[Row], v: &[Row], gh: f64, out: &mut [Row]) -> Result<(), StepError>;

    /// Prepares the matrix M/gh² + D/gh + K at (t, x, v), and returns the size below which R is round-off, in the norm
    /// sqrt(sum |R|²/m).
    fn linearize(&mut self, t: f64, x: &[Row], v: &[Row], gh: f64, hessian: Hessian) -> Result<f64, StepError>;

    /// Solves with that matrix; rows held still get 0.
    fn solve_linear(&mut self, x: &[Row], rhs: &[Row], out: &mut [Row], settings: &Solver) -> LinearSolve;
}

/// How a linear solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LinearSolve {
    /// Iterations made; 1 for a direct solver.
    pub iterations: usize,
    /// Whether the matrix turned out not to be positive definite.
    pub indefinite: bool,
}

/// Vectors of a solve, kept between solves.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    residual: Vec<Row>,
    direction: Vec<Row>,
    trial_x: Vec<Row>,
    trial_v: Vec<Row>,
}

/// Solves a stage in place, from the guess v.
pub fn solve(
    equation: &mut dyn Stiff,
    stage: &Stage<'_>,
    x: &mut [Row],
    v: &mut [Row],
    settings: &Solver,
    work: &mut Workspace,
    report: &mut StepReport,
) -> Result<(), StepError> {
    let n = x.len();
    for column in [&mut work.residual, &mut work.direction, &mut work.trial_x, &mut work.trial_v] {
        column.resize(n, ZERO);
    }
    let Workspace { residual, direction, trial_x, trial_v } = work;
    let kinematics = equation.kinematics();
    let tolerance = settings.newton_tolerance.unwrap_or(if cfg!(feature = "double") { 1e-10 } else { 1e-3 });
    let inverse_gh = (1.0 / stage.gh) as Real;

    follow(kinematics, stage, v, x);
    let mut size = evaluate(equation, stage, x, v, residual)?;
    if !size.is_finite() {
        // No direction leads on from here: whose force is not finite gets a velocity that is not, and is found by it.
        let bad = |row: &Row| !row[..3].iter().all(|f| f.is_finite());
        let lost = residual.iter().any(bad);
        for (v, _) in v.iter_mut().zip(&*residual).filter(|(_, r)| !lost || bad(r)) {
            *v = [Real::NAN, Real::NAN, Real::NAN, 0.0];
        }
        follow(kinematics, stage, v, x);
        return Ok(());
    }
    let first = size;
    let mut converged = size == 0.0;
    let limit = if settings.linearized { 1 } else { settings.newton_iterations };
    for _ in 0..limit {
        if converged || !size.is_finite() {
            break;
        }
        let mut hessian = settings.hessian;
        let floor = loop {
            let floor = equation.linearize(stage.t, x, v, stage.gh, hessian)?;
            let info = equation.solve_linear(x, residual, direction, settings);
            report.linear += info.iterations as u64;
            if !info.indefinite || hessian == Hessian::Definite {
                break floor;
            }
            // The exact matrix is indefinite here: no descent is sure, so take the definite one for this iteration.
            hessian = Hessian::Definite;
        };
        report.newton += 1;
        if settings.linearized {
            shift(v, direction, -inverse_gh);
            follow(kinematics, stage, v, x);
            return Ok(());
        }
        // The direction solves A d = R, so that dx = -d and the slope along dx is -d.R.
        let slope = -product(direction, residual);
        let before = size;
        let mut alpha = 1.0;
        for attempt in 0..12 {
            trial_v.copy_from_slice(v);
            shift(trial_v, direction, -inverse_gh * alpha as Real);
            follow(kinematics, stage, trial_v, trial_x);
            size = evaluate(equation, stage, trial_x, trial_v, residual)?;
            let now = -product(direction, residual);
            if size.is_finite() && now <= 0.8 * slope.abs() || attempt == 11 {
                break;
            }
            // The zero of the slope by a straight line between the two, kept inside.
            let secant = slope / (slope - now);
            alpha *= if secant.is_finite() { secant.clamp(0.1, 0.5) } else { 0.1 };
        }
        v.copy_from_slice(trial_v);
        x.copy_from_slice(trial_x);
        // Below the round-off of the forces no further progress can be seen; nor where full steps stop helping near it.
        converged = size <= tolerance * first || size <= floor || (alpha == 1.0 && size > 0.5 * before && size <= 10.0 * floor);
    }
    let relative = if first > 0.0 { size / first } else { 0.0 };
    report.left(relative);
    if !converged && size.is_finite() {
        report.unconverged += 1;
        if settings.on_failure == OnFailure::Error {
            return Err(StepError::Solve {
                system: String::new(),
                time: stage.t,
                iterations: settings.newton_iterations as usize,
                residual: relative,
                tolerance,
            });
        }
    }
    Ok(())
}

/// x = x* moved along v for gh.
fn follow(kinematics: Kinematics, stage: &Stage<'_>, v: &[Row], x: &mut [Row]) {
    let gh = stage.gh as Real;
    chunks(x, |start, x| {
        for (k, x) in x.iter_mut().enumerate() {
            let i = start + k;
            *x = kinematics.moved(i, stage.x[i], v[i], gh);
        }
    });
}

/// R at (x, v), and sqrt(sum |R|²/m).
fn evaluate(equation: &mut dyn Stiff, stage: &Stage<'_>, x: &[Row], v: &[Row], residual: &mut [Row]) -> Result<f64, StepError> {
    residual.fill(ZERO);
    equation.force(stage.t, x, v, stage.gh, residual)?;
    let inverse_gh = (1.0 / stage.gh) as Real;
    let w = equation.inverse_mass();
    Ok(chunk_sum(residual, |start, residual| {
        let mut sum = 0.0;
        for (k, r) in residual.iter_mut().enumerate() {
            let i = start + k;
            *r = if w[i] > 0.0 { axpy(scale(*r, -1.0), inverse_gh / w[i], sub(v[i], stage.v[i])) } else { ZERO };
            sum += f64::from(w[i]) * dot(*r, *r);
        }
        sum
    })
    .sqrt())
}

/// v += c d.
fn shift(v: &mut [Row], d: &mut [Row], c: Real) {
    chunks2(v, d, |_, v, d| {
        for (v, d) in v.iter_mut().zip(d) {
            // If a linear solve overflows, its fourth components are NaN; in rows of x they would permanently overwrite the inverse mass.
            let [x, y, z, _] = axpy(*v, c, *d);
            *v = [x, y, z, 0.0];
        }
    });
}

fn product(a: &[Row], b: &[Row]) -> f64 {
    sum(a.len(), |range| range.map(|i| dot(a[i], b[i])).sum())
}
