//! Implicit schemes. Each is one or more stages x = x* + gh v, v = v* + gh a(t, x, v), which the equation solves.

use super::{Stage, Step};
use crate::math::{Quat, Real, axpy, scale, sub};
use tumble_interface::StepError;

/// x += h v_t+h,  v_t+h = v + h a(t+h).  Order 1, damps, stable for every h.        (integrators.10)
///
/// Leaves x and v as they were in the first two columns of the scratch.
pub(super) fn euler(Step { equation, t, h, x, v, scratch, report, .. }: &mut Step<'_, '_>) -> Result<(), StepError> {
    let [x0, v0] = scratch.take(x.len());
    x0.copy_from_slice(x);
    v0[..v.len()].copy_from_slice(v);
    equation.solve(&Stage { t: *t + *h, gh: *h, x: x0, v: &v0[..v.len()] }, x, v, report)
}

/// Implicit Euler over h/2 to the midpoint, then the same movement again.            (integrators.11)
///
/// Order 2; keeps quadratic invariants such as angular momentum; does not damp.
pub(super) fn midpoint(mut step: Step<'_, '_>) -> Result<(), StepError> {
    step.h /= 2.0;
    euler(&mut step)?;
    let Step { equation, h, x, v, scratch, .. } = step;
    let (kinematics, [x0, v0]) = (equation.kinematics(), scratch.take(x.len()));
    for i in 0..x.len() {
        x[i] = if kinematics.frames.contains(i) { kinematics.moved(i, x[i], v[i], h as Real) } else { sub(scale(x[i], 2.0), x0[i]) };
    }
    for (v, v0) in v.iter_mut().zip(v0) {
        *v = sub(scale(*v, 2.0), *v0);
    }
    Ok(())
}

/// y_t+h = 4/3 y_t - 1/3 y_t-h + 2/3 h f(t+h).                                       (integrators.12)
///
/// Order 2, damps high frequencies only; starts with implicit Euler. Memory: x_t-h and v_t-h.
pub(super) fn bdf2(Step { equation, t, h, x, v, memory, ready, scratch, report }: Step<'_, '_>) -> Result<(), StepError> {
    let [x1, v1] = memory else { return Ok(()) };
    let [x0, v0] = scratch.take(x.len());
    let kinematics = equation.kinematics();
    let third = (1.0_f64 / 3.0) as Real;
    let gh = if ready { h * 2.0 / 3.0 } else { h };
    for i in 0..x.len() {
        x0[i] = x[i];
        if ready {
            // A quaternion and its negative are one orientation: take the nearer.
            let before = if kinematics.frames.contains(i) && Quat::from_row(x[i]).dot(Quat::from_row(x1[i])) < 0.0 {
                scale(x1[i], -1.0)
            } else {
                x1[i]
            };
            x0[i] = axpy(x[i], third, sub(x[i], before));
            if kinematics.frames.contains(i) {
                x0[i] = Quat::from_row(x0[i]).normalized().row();
            }
        }
        x1[i] = x[i];
    }
    for i in 0..v.len() {
        v0[i] = if ready { axpy(v[i], third, sub(v[i], v1[i])) } else { v[i] };
        v1[i] = v[i];
    }
    equation.solve(&Stage { t: t + h, gh, x: x0, v: &v0[..v.len()] }, x, v, report)
}
