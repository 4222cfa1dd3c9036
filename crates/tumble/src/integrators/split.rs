//! Schemes that move velocities and positions in turn: x' = v, v' = a(t, x, v).
//!
//! Verified against their closed recurrences on the oscillator and their orders on Kepler's problem.

use super::Step;
use crate::math::parallel::{chunks, chunks2};
use crate::math::{Real, Row, add, axpy, rows, scale};
use tumble_interface::StepError;

/// v += h a(t, x, v), then x += h v.                                   (integrators.2)
///
/// Order 1. Symplectic for a(x): energy oscillates and does not drift for w h < 2.
pub(super) fn symplectic_euler(step: Step<'_, '_>) -> Result<(), StepError> {
    euler(step, 1.0)
}

/// x += h/2 (v_t + v_t+h),   v_t+h = v + h a(t, x, v).                 (integrators.3)
///
/// The lecture's modified Euler. Order 1, because the rate is taken once, at the start: the quadratic form
/// x² - (w h/2) x v/w + (v/w)² of the oscillator grows by exactly 1 + w²h²/2 a step.
pub(super) fn modified_euler(step: Step<'_, '_>) -> Result<(), StepError> {
    // After half a kick the velocity is the mean of the two.
    euler(step, 0.5)
}

/// A part of the kick before the positions move, and the rest after it.
fn euler(Step { equation, t, h, x, v, scratch, .. }: Step<'_, '_>, early: Real) -> Result<(), StepError> {
    let [a] = scratch.take(x.len());
    equation.rate(t, x, v, a)?;
    let (kinematics, h, a) = (equation.kinematics(), h as Real, &*a);
    chunks2(x, v, |start, x, v| {
        let a = &a[start..start + v.len()];
        rows::axpy(v, early * h, a);
        kinematics.drift(start, x, v, h);
        if early < 1.0 {
            rows::axpy(v, (1.0 - early) * h, a);
        }
    });
    Ok(())
}

/// Stoermer's form: x_t+h = x_t + d,   d += h² a_t,   v_t = d/h + h/2 a_t,   where d = x_t - x_t-h.        (integrators.6)
///
/// Order 2, symplectic, w h < 2. Memory: d and a_t: of two positions far from the origin the difference would be lost in round-off. Frames,
/// which have no differences, take the velocity form.
pub(super) fn verlet(Step { equation, t, h, x, v, memory, ready, scratch, .. }: Step<'_, '_>) -> Result<(), StepError> {
    let [way, a] = memory else { return Ok(()) };
    let kinematics = equation.kinematics();
    let [guess] = scratch.take(x.len());
    let (half, h) = ((h / 2.0) as Real, h as Real);
    let time = t + f64::from(h);
    if !ready {
        equation.rate(t, x, v, a)?;
        let (v, a) = (&*v, &**a);
        chunks(way, |start, way| {
            for (i, d) in way.iter_mut().enumerate() {
                let i = start + i;
                *d = scale(axpy(v[i], -half, a[i]), h);
            }
        });
    }
    {
        let (v, a) = (&*v, &**a);
        chunks2(x, way, |start, x, way| {
            for (i, (x, d)) in x.iter_mut().zip(way).enumerate() {
                let i = start + i;
                if kinematics.frames.contains(i) {
                    *x = kinematics.moved(i, *x, axpy(v[i], half, a[i]), h);
                } else {
                    *d = axpy(*d, h * h, a[i]);
                    *x = add(*x, *d);
                }
            }
        });
    }
    {
        // The velocity without its last half kick, and a first-order guess of the whole for forces that depend on it.
        let (way, a) = (&**way, &**a);
        chunks2(v, guess, |start, v, guess| {
            for (i, (v, guess)) in v.iter_mut().zip(guess).enumerate() {
                let i = start + i;
                *v = if kinematics.frames.contains(i) { axpy(*v, half, a[i]) } else { scale(way[i], 1.0 / h) };
                *guess = axpy(*v, half, a[i]);
            }
        });
    }
    equation.rate(time, x, guess, a)?;
    kick(v, half, a);
    Ok(())
}

/// v += h/2 a_t,  x += h v,  v += h/2 a_t+h.                           (integrators.7)
///
/// Order 2, symplectic, w h < 2. Memory: a_t, which the next step uses again.
pub(super) fn velocity_verlet(Step { equation, t, h, x, v, memory, ready, scratch, .. }: Step<'_, '_>) -> Result<(), StepError> {
    let [a] = memory else { return Ok(()) };
    let kinematics = equation.kinematics();
    let [guess] = scratch.take(x.len());
    if !ready {
        equation.rate(t, x, v, a)?;
    }
    let (after, half, h) = (t + h, (h / 2.0) as Real, h as Real);
    kick(v, half, a);
    {
        let (v, a) = (&*v, &**a);
        chunks2(x, guess, |start, x, guess| {
            let rows = start..start + x.len();
            kinematics.drift(start, x, &v[rows.clone()], h);
            guess.copy_from_slice(&v[rows.clone()]);
            rows::axpy(guess, half, &a[rows]);
        });
    }
    equation.rate(after, x, guess, a)?;
    kick(v, half, a);
    Ok(())
}

/// v += h a.
fn kick(v: &mut [Row], h: Real, a: &[Row]) {
    chunks(v, |start, v| {
        rows::axpy(v, h, &a[start..start + v.len()]);
    });
}
