//! Position-based dynamics: elements are no forces but constraints on positions, satisfied one after the other. The lines of a step are
//! those of Algorithm 1 of [bender2015]; what a constraint is and how far it is satisfied stands in `elements/constraints.rs`.
//!
//!   v += h f_ext/m,   x = x_old + h v,   n times: x += dx of each element,   v = (x - x_old)/h       (positions.1)
//!
//! Stable for every step. One sweep over compliant elements a sub-step is a step of implicit Euler to first order in h [macklin2019]; what
//! is not satisfied yet makes things softer. Verified in `tests/position_based.rs`.

use super::Dynamics;
use crate::elements::{Constraints, Projection};
use crate::geometry::Walls;
use crate::integrators::Equation;
use crate::math::parallel::{CHUNK, Tasks, chunks2, max};
use crate::math::{Quat, Real, Row, Vec3, ZERO, axpy, sub, xyz64};
use tumble_interface::StepError;
use tumble_interface::engine::StepReport;
use tumble_interface::scene::Projection as Kind;

impl Dynamics {
    /// A sub-step without contact, which follows; `before` holds where it starts from.
    pub(super) fn project_step(&mut self, t: f64, h: f64, report: &mut StepReport) -> Result<(), StepError> {
        // Who may meet whom.
        self.find_pairs(h);
        // Forces that are no elements, predicted velocities and positions.
        let (mut rates, kinematics) = (std::mem::take(&mut self.rates), self.laws.kinematics());
        rates.resize(self.state.x.len(), ZERO);
        self.laws.batches.iter_mut().for_each(|b| b.act_at_once(h));
        let done = self.laws.rate(t, &self.state.x, &self.state.v, &mut rates);
        let step = h as Real;
        chunks2(&mut self.state.x, &mut self.state.v, |start, x, v| {
            for (v, a) in v.iter_mut().zip(&rates[start..]) {
                *v = axpy(*v, step, *a);
            }
            kinematics.drift(start, x, v, step);
        });
        self.rates = rates;
        done?;
        self.place_held(t + h);
        // Sweeps over all elements.
        let words = self.sweeps.clone();
        // n sweeps that each take back 1 - (1 - k)^(1/n) leave 1 - k of an error.
        let part = 1.0 - crate::math::functions::pow(1.0 - words.stiffness, 1.0 / f64::from(words.iterations));
        let plain = (words.projection == Kind::Plain).then_some(part as Real);
        let mut old: Vec<Row> = Vec::new();
        for iteration in 0..words.iterations {
            if words.tolerance.is_some() {
                old.clone_from(&self.state.x);
            }
            let (x, walls) = (&mut self.state.x, Walls { colliders: &self.laws.colliders, t: t + h });
            let projection = Projection { h, before: &self.before, iteration, iterations: words.iterations, plain, walls };
            self.constraints.iter_mut().for_each(|c| c.project(x, &projection));
            if let Some(clamp) = &mut self.clamp {
                clamp.project(x, &projection);
            }
            self.reach.iter().for_each(|tethers| tethers.project(x));
            self.push_apart();
            report.sweeps += 1;
            let x = &self.state.x;
            let way = |i: usize| xyz64(sub(x[i], old[i])).norm();
            if words.tolerance.is_some_and(|most| max(x.len(), |range| range.map(way).fold(0.0, f64::max)) <= most) {
                break;
            }
        }
        // Velocities: a point that no element has moved keeps its own to the last bit.
        let (x, before, points) = (&self.state.x, &self.before, kinematics.points);
        self.state.v.chunks_mut(CHUNK).zip(x.chunks(CHUNK)).enumerate().in_parallel(|(c, (v, x))| {
            for (k, (v, x)) in v.iter_mut().zip(x).enumerate() {
                let i = c * CHUNK + k;
                let predicted = kinematics.moved(i, before[i], *v, step);
                if i < points {
                    *v = axpy(*v, 1.0 / step, sub(*x, predicted));
                    v[3] = 0.0;
                } else if predicted != *x {
                    *v = turning(before[i], *x, step);
                }
            }
        });
        Ok(())
    }
}

/// The angular velocity in its own axes of a frame that goes from one orientation to another in the time h.
fn turning(from: Row, to: Row, h: Real) -> Row {
    let turn = Quat::from_row(from).conj() * Quat::from_row(to);
    let sign = if turn.w < 0.0 { -2.0 / h } else { 2.0 / h };
    let Vec3 { x, y, z } = turn.v * sign;
    [x, y, z, 0.0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{rotation, xyz};

    #[test]
    fn a_frame_that_turns_has_turned_at_its_velocity() {
        let q: Row = rotation::from_degrees([20.0, -50.0, 110.0]).row().map(|x| x as Real);
        let omega = Vec3 { x: 0.4, y: -1.1, z: 0.7 };
        let v = xyz(turning(q, rotation::turn(q, omega * 0.01), 0.01));
        // 2 sin(angle/2)/h = omega (1 - angle²/24).
        assert!((v - omega).norm() < 2e-4 && (v - omega).norm() < 1e-3 * omega.norm(), "{v:?}");
    }
}
