//! Explicit Runge-Kutta schemes: a table of coefficients and one loop.
//!
//!   k_i = f(t + c_i h, y + h sum_j a_ij k_j),   y += h sum_i b_i k_i           (integrators.5)
//!
//! Source: [hairer1993], II.1; Dormand-Prince: [dormand1980].

use super::{Equation, Step};
use crate::math::parallel::chunks;
use crate::math::{Real, Row, axpy};
use tumble_interface::StepError;
use tumble_interface::scene::Integrator;

/// The coefficients of an explicit scheme with up to seven stages.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tableau {
    /// Times of the stages, as parts of the step.
    pub c: &'static [f64],
    /// Row i: weights of earlier stages in stage i.
    pub a: &'static [&'static [f64]],
    /// Weights of the stages in the result.
    pub b: &'static [f64],
    /// Weights of the embedded error estimate; empty without one.
    pub e: &'static [f64],
}

const FORWARD_EULER: Tableau = Tableau { c: &[0.0], a: &[&[]], b: &[1.0], e: &[] };
const MIDPOINT: Tableau = Tableau { c: &[0.0, 0.5], a: &[&[], &[0.5]], b: &[0.0, 1.0], e: &[] };
const HEUN: Tableau = Tableau { c: &[0.0, 1.0], a: &[&[], &[1.0]], b: &[0.5, 0.5], e: &[] };
const RK4: Tableau = Tableau {
    c: &[0.0, 0.5, 0.5, 1.0],
    a: &[&[], &[0.5], &[0.0, 0.5], &[0.0, 0.0, 1.0]],
    b: &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
    e: &[],
};

/// Dormand-Prince 5(4): the last stage is the first of the next step; `e` = b - b̂.
pub const DORMAND_PRINCE: Tableau = Tableau {
    c: &[0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0],
    a: &[
        &[],
        &[1.0 / 5.0],
        &[3.0 / 40.0, 9.0 / 40.0],
        &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
        &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
        &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
        &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
    ],
    b: &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0, 0.0],
    e: &[71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0],
};

/// The tableau of an explicit scheme with a fixed step; forward Euler's for every other.
pub fn tableau(scheme: Integrator) -> &'static Tableau {
    match scheme {
        Integrator::Midpoint => &MIDPOINT,
        Integrator::Heun => &HEUN,
        Integrator::Rk4 => &RK4,
        Integrator::DormandPrince => &DORMAND_PRINCE,
        _ => &FORWARD_EULER,
    }
}

/// Columns of a step: x and v of the stage, k of x and of v for each of seven stages, and x and v at the end for schemes
/// that may reject it.
pub(super) const COLUMNS: usize = 2 + 2 * 7 + 2;

/// One step in place.
pub(super) fn step(tableau: &Tableau, Step { equation, t, h, x, v, scratch, .. }: Step<'_, '_>) -> Result<(), StepError> {
    let mut columns: [&mut [Row]; COLUMNS] = scratch.take_some(x.len(), 2 + 2 * tableau.b.len());
    stages(tableau, equation, t, h, x, v, &mut columns, 0)?;
    finish(tableau, equation, h, x, v, &columns);
    Ok(())
}

/// Evaluates the stages from the `first` on; the rates of those before it are in the columns already.
pub(super) fn stages(
    tableau: &Tableau,
    equation: &mut dyn Equation,
    t: f64,
    h: f64,
    x: &[Row],
    v: &[Row],
    columns: &mut [&mut [Row]; COLUMNS],
    first: usize,
) -> Result<(), StepError> {
    let kinematics = equation.kinematics();
    for i in first..tableau.b.len() {
        let [stage_x, stage_v, k @ ..] = &mut *columns;
        let (done, rest) = k.split_at_mut(2 * i);
        combine(stage_x, x, h, tableau.a[i], done, 0);
        combine(stage_v, v, h, tableau.a[i], done, 1);
        let [kx, kv, ..] = rest else { break };
        let time = t + tableau.c[i] * h;
        if !kinematics.second_order {
            equation.rate(time, stage_x, stage_v, kx)?;
            continue;
        }
        equation.rate(time, stage_x, stage_v, kv)?;
        let (stage_x, stage_v) = (&**stage_x, &**stage_v);
        chunks(kx, |start, k| {
            for (j, k) in k.iter_mut().enumerate() {
                *k = kinematics.rate(start + j, stage_x[start + j], stage_v[start + j]);
            }
        });
    }
    Ok(())
}

/// y += h sum b_i k_i.
pub(super) fn finish(tableau: &Tableau, equation: &dyn Equation, h: f64, x: &mut [Row], v: &mut [Row], columns: &[&mut [Row]; COLUMNS]) {
    let k = &columns[2..];
    add(x, h, tableau.b, k, 0);
    add(v, h, tableau.b, k, 1);
    equation.kinematics().normalize(x);
}

/// out = y + h sum_j a_j k_j, where k holds the columns of x at even and of v at odd places (`which`).
fn combine(out: &mut [Row], y: &[Row], h: f64, a: &[f64], k: &[&mut [Row]], which: usize) {
    chunks(&mut out[..y.len()], |start, out| {
        for (i, o) in out.iter_mut().enumerate() {
            *o = weighted(y[start + i], h, a, k, which, start + i);
        }
    });
}

fn add(y: &mut [Row], h: f64, b: &[f64], k: &[&mut [Row]], which: usize) {
    chunks(y, |start, y| {
        for (i, y) in y.iter_mut().enumerate() {
            *y = weighted(*y, h, b, k, which, start + i);
        }
    });
}

#[inline(always)]
fn weighted(mut y: Row, h: f64, weights: &[f64], k: &[&mut [Row]], which: usize, i: usize) -> Row {
    for (j, w) in weights.iter().enumerate() {
        if *w != 0.0 {
            y = axpy(y, (h * w) as Real, k[2 * j + which][i]);
        }
    }
    y
}
