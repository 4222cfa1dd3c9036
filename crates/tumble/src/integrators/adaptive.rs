//! Schemes that choose their own step from an estimate of the error they make in it.

use super::runge_kutta::{COLUMNS, DORMAND_PRINCE, finish, stages};
use super::{Equation, Memory, Scratch};
use crate::math::functions::pow;
use crate::math::parallel::max;
use crate::math::{Real, Row, axpy, sub};
use tumble_interface::StepError;
use tumble_interface::engine::{StepReport, Trial};
use tumble_interface::scene::{Adaptive, Integrator};

/// One accepted step of `adaptive_euler` or `dormand_prince` from t, at most `left` [s] long; returns its length.
/// The step tried first is `memory.next_step`, or the settings' first one. Trials are logged in the report, as many as it takes.
pub fn adaptive_step(
    scheme: Integrator,
    settings: &Adaptive,
    equation: &mut dyn Equation,
    (t, left, interval): (f64, f64, f64),
    (x, v): (&mut [Row], &mut [Row]),
    memory: &mut Memory,
    scratch: &mut Scratch,
    report: &mut StepReport,
) -> Result<f64, StepError> {
    if memory.next_step == 0.0 {
        memory.next_step = settings.first_step.unwrap_or(interval / 100.0);
    }
    let smallest = settings.smallest * interval;
    loop {
        let wanted = memory.next_step;
        // The last step of an interval may be cut; it then says nothing about the next one.
        let cut = wanted >= left;
        let h = if cut { left } else { wanted };
        let (error, after) = match scheme {
            Integrator::DormandPrince => dormand_prince(settings, equation, t, h, x, v, memory, scratch)?,
            _ => step_doubling(settings, equation, t, h, x, v, scratch)?,
        };
        // A number that is not finite: the step is far too long, or the equation itself is not finite, which ends the loop below.
        let accepted = error <= 1.0;
        report.tried(Trial { time: t, step: h, error, accepted });
        let factor = match scheme {
            _ if !error.is_finite() => 0.1,
            Integrator::DormandPrince => pi_factor(error, memory.last_error, accepted),
            // The error of one Euler step is proportional to h².
            _ => (0.9 / error.sqrt()).clamp(0.1, 5.0),
        };
        let next = h * if factor.is_finite() { factor } else { 0.1 };
        if accepted {
            after.accept(x, v, memory);
            memory.next_step = if cut { wanted.max(next) } else { next };
            memory.last_error = error;
            return Ok(h);
        }
        report.rejected += 1;
        memory.next_step = next;
        if next < smallest {
            return Err(StepError::StepTooSmall { system: String::new(), time: t, step: next });
        }
    }
}

/// The columns that hold (x, v) after a trial.
struct After<'a> {
    x: &'a [Row],
    v: &'a [Row],
    /// Rates at the end, for the next step.
    rates: Option<[&'a [Row]; 2]>,
}

impl After<'_> {
    fn accept(&self, x: &mut [Row], v: &mut [Row], memory: &mut Memory) {
        x.copy_from_slice(self.x);
        v.copy_from_slice(self.v);
        if let Some(rates) = self.rates {
            for (column, rates) in memory.columns.iter_mut().zip(rates) {
                column.copy_from_slice(rates);
            }
            memory.ready = true;
        }
    }
}

/// The lecture's step doubling on forward Euler: one step of h against two of h/2, which are kept. The error is the
/// largest distance between the two positions, over the tolerance.                                  (integrators.8)
fn step_doubling<'a>(
    settings: &Adaptive,
    equation: &mut dyn Equation,
    t: f64,
    h: f64,
    x: &[Row],
    v: &[Row],
    scratch: &'a mut Scratch,
) -> Result<(f64, After<'a>), StepError> {
    let [dx, dv, one, two_x, two_v] = scratch.take(x.len());
    let kinematics = equation.kinematics();
    let euler = |equation: &mut dyn Equation, t: f64, x: &[Row], v: &[Row], dx: &mut [Row], dv: &mut [Row]| -> Result<(), StepError> {
        if !kinematics.second_order {
            return equation.rate(t, x, v, dx);
        }
        equation.rate(t, x, v, dv)?;
        (0..x.len()).for_each(|i| dx[i] = kinematics.rate(i, x[i], v[i]));
        Ok(())
    };
    let half = (h / 2.0) as Real;
    euler(equation, t, x, v, dx, dv)?;
    for i in 0..x.len() {
        one[i] = axpy(x[i], h as Real, dx[i]);
        two_x[i] = axpy(x[i], half, dx[i]);
    }
    for i in 0..v.len() {
        two_v[i] = axpy(v[i], half, dv[i]);
    }
    euler(equation, t + h / 2.0, two_x, two_v, dx, dv)?;
    for i in 0..x.len() {
        two_x[i] = axpy(two_x[i], half, dx[i]);
    }
    for i in 0..v.len() {
        two_v[i] = axpy(two_v[i], half, dv[i]);
    }
    let (one, ends) = (&*one, &*two_x);
    let distance = max(x.len(), |range| {
        range.map(|i| sub(one[i], ends[i]).iter().map(|d| f64::from(*d) * f64::from(*d)).sum::<f64>().sqrt()).fold(0.0, nan_max)
    });
    kinematics.normalize(two_x);
    Ok((distance / settings.tolerance, After { x: two_x, v: &two_v[..v.len()], rates: None }))
}

/// One trial of Dormand-Prince 5(4). The error is the largest component of the embedded estimate over
/// tolerance + relative max(|y|, |y after|).                                                        (integrators.9)
fn dormand_prince<'a>(
    settings: &Adaptive,
    equation: &mut dyn Equation,
    t: f64,
    h: f64,
    x: &[Row],
    v: &[Row],
    memory: &Memory,
    scratch: &'a mut Scratch,
) -> Result<(f64, After<'a>), StepError> {
    let mut columns: [&mut [Row]; COLUMNS] = scratch.take(x.len());
    let kinematics = equation.kinematics();
    let mut first = 0;
    if memory.ready {
        first = 1;
        for (k, kept) in columns[2..4].iter_mut().zip(&memory.columns) {
            k.copy_from_slice(kept);
        }
    }
    stages(&DORMAND_PRINCE, equation, t, h, x, v, &mut columns, first)?;
    let [.., end_x, end_v] = &mut columns;
    let (end_x, end_v) = (std::mem::take(end_x), &mut std::mem::take(end_v)[..v.len()]);
    end_x.copy_from_slice(x);
    end_v.copy_from_slice(v);
    finish(&DORMAND_PRINCE, equation, h, end_x, end_v, &columns);
    let worst = |y: &[Row], end: &[Row], which: usize| {
        let rates = &columns[2..];
        max(y.len(), |range| {
            let component = |i: usize, c: usize| {
                let estimate: f64 = DORMAND_PRINCE.e.iter().enumerate().map(|(j, e)| e * f64::from(rates[2 * j + which][i][c])).sum();
                let size = f64::from(y[i][c]).abs().max(f64::from(end[i][c]).abs());
                (h * estimate).abs() / (settings.tolerance + settings.relative * size)
            };
            range.flat_map(|i| (0..4).map(move |c| (i, c))).map(|(i, c)| component(i, c)).fold(0.0, nan_max)
        })
    };
    let error = nan_max(worst(x, end_x, 0), if kinematics.second_order { worst(v, end_v, 1) } else { 0.0 });
    let [.., last_x, last_v, _, _] = columns;
    Ok((error, After { x: end_x, v: end_v, rates: Some([last_x, last_v]) }))
}

/// The larger, or NaN if either is.
fn nan_max(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// The PI controller, smoother than the error alone:
///
///   h *= (theta/e)^0.17 (e_before/theta)^0.04,   theta = 0.7            (integrators.17)
///
/// theta is the error over the tolerance that it aims at. It stands inside the powers: a safety factor on h (0.9) would let
/// the error settle at 0.9^(1/0.13) of the tolerance where the solution is smooth and stay near 1 where it is not, so that a
/// smaller tolerance would gain more than its share. Source: [gustafsson1991]; exponents of [hairer1993].
fn pi_factor(error: f64, before: f64, accepted: bool) -> f64 {
    let error = error.max(1e-10);
    if !accepted {
        return (0.9 * pow(error, -0.2)).clamp(0.1, 1.0);
    }
    let theta = 0.7;
    let before = if before > 0.0 { before.max(1e-4) } else { theta };
    (pow(theta / error, 0.17) * pow(before / theta, 0.04)).clamp(0.2, 10.0)
}
