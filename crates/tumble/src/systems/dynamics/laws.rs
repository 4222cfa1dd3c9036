//! The right-hand side: what accelerates the masses at (t, x, v).

use super::implicit::Implicit;
use crate::elements::Batch;
use crate::forces::Force;
use crate::geometry::Collider;
use crate::integrators::{Equation, Kinematics, Stage, newton};
use crate::math::parallel::{chunks, sum};
use crate::math::{Real, Row, Vec3, ZERO, xyz64};
use crate::state::Masses;
use std::ops::Range;
use std::sync::Arc;
use tumble_interface::StepError;
use tumble_interface::engine::{StepReport, UserForce};
use tumble_interface::scene::Solver;

/// Every law of a system.
#[derive(Default)]
pub struct Laws {
    /// Elements between masses.
    pub batches: Vec<Box<dyn Batch>>,
    /// Forces on each mass by itself, with the rows that they act on.
    pub forces: Vec<(Box<dyn Force>, Vec<Range<usize>>)>,
    /// Forces written by users.
    pub user: Vec<Box<dyn UserForce>>,
    /// Gravity on points [m/s²].
    pub gravity: [f64; 3],
    /// What each row weighs.
    pub masses: Masses,
    /// Solids.
    pub colliders: Arc<Vec<Collider>>,
    /// Whether implicit stages see the solids as penalties.
    pub penalty: bool,
    /// Stiffness with which the elements hold each row at the start [N/m].
    pub grip: Vec<Real>,
    /// Positions at the start of the implicit stage.
    pub start: Vec<Row>,
    /// Settings of implicit stages.
    pub solver: Solver,
    /// Storage of implicit stages.
    pub implicit: Implicit,
    /// Sums of element forces; scratch.
    pub coupled: Vec<Row>,
}

impl Laws {
    /// Whether no mass feels another, so that each can be stepped by itself.
    pub fn is_local(&self) -> bool {
        self.batches.is_empty() && self.user.is_empty()
    }

    /// The forces of elements and users, or nothing if there are none.
    fn couple(&mut self, t: f64, x: &[Row], v: &[Row]) -> Result<(), StepError> {
        if self.is_local() {
            return Ok(());
        }
        self.coupled.resize(x.len(), ZERO);
        chunks(&mut self.coupled, |_, f| f.fill(ZERO));
        for batch in &mut self.batches {
            batch.add_forces(x, v, &mut self.coupled);
        }
        if !self.user.is_empty() {
            let flat =
                |rows: &[Row]| -> Vec<f64> { rows.iter().flat_map(|r| [f64::from(r[0]), f64::from(r[1]), f64::from(r[2])]).collect() };
            let n = self.masses.points;
            let (x, v) = (flat(&x[..n]), flat(&v[..n]));
            let mass: Vec<f64> = self.masses.mass[..n].iter().map(|m| f64::from(*m)).collect();
            let mut force = vec![0.0; x.len()];
            for user in &mut self.user {
                user.force(t, &x, &v, &mass, &mut force).map_err(StepError::User)?;
            }
            for (f, add) in self.coupled.iter_mut().zip(force.chunks_exact(3)) {
                *f = [f[0] + add[0] as Real, f[1] + add[1] as Real, f[2] + add[2] as Real, 0.0];
            }
        }
        Ok(())
    }

    /// Adds the forces on each mass by itself, gravity left out, to the rows from `start` on.
    fn add_local(&self, t: f64, start: usize, mass: &[Real], x: &[Row], v: &[Row], force: &mut [Row]) {
        let end = start + x.len();
        for (law, ranges) in &self.forces {
            for range in ranges {
                let (a, b) = (range.start.max(start), range.end.min(end));
                if a < b {
                    let (a, b) = (a - start, b - start);
                    law.add(t, &mass[a..b], &x[a..b], &v[a..b], &mut force[a..b]);
                }
            }
        }
    }

    /// Starts sums of forces with those of elements and users.
    fn take_coupled(&self, start: usize, out: &mut [Row]) {
        match self.is_local() {
            true => out.fill(ZERO),
            false => out.copy_from_slice(&self.coupled[start..start + out.len()]),
        }
    }

    /// Masses of some rows.
    pub fn weights(&self, rows: Range<usize>) -> RowMasses<'_> {
        RowMasses { mass: &self.masses.mass[rows.clone()], inverse: &self.masses.inverse[rows] }
    }

    /// Accelerations of the rows from `start` on; `out` holds the coupled forces.
    fn accelerate(&self, t: f64, start: usize, weights: RowMasses<'_>, x: &[Row], v: &[Row], out: &mut [Row]) {
        self.add_local(t, start, weights.mass, x, v, out);
        let g = self.gravity.map(|g| g as Real);
        let points = self.masses.points.saturating_sub(start);
        for (i, (f, w)) in out.iter_mut().zip(weights.inverse).enumerate() {
            let fall = if i < points && *w > 0.0 { g } else { [0.0; 3] };
            *f = [f[0] * w + fall[0], f[1] * w + fall[1], f[2] * w + fall[2], 0.0];
        }
    }

    /// Forces of everything but contact [N, N m].
    pub fn forces(&mut self, t: f64, x: &[Row], v: &[Row], out: &mut [Row]) -> Result<(), StepError> {
        self.couple(t, x, v)?;
        let laws = &*self;
        let (g, points) = (self.gravity.map(|g| g as Real), self.masses.points);
        chunks(out, |start, out| {
            let rows = start..start + out.len();
            let mass = laws.weights(rows.clone()).mass;
            laws.take_coupled(start, out);
            laws.add_local(t, start, mass, &x[rows.clone()], &v[rows], out);
            for (i, (f, m)) in out.iter_mut().zip(mass).enumerate() {
                if start + i < points {
                    *f = [f[0] + m * g[0], f[1] + m * g[1], f[2] + m * g[2], 0.0];
                }
            }
        });
        Ok(())
    }

    /// Potential energy of gravity and of the forces that have one [J].
    pub fn external_energy(&self, t: f64, x: &[Row]) -> f64 {
        let (g, mass) = (Vec3::from(self.gravity), &self.masses.mass);
        let fall = sum(self.masses.points, |range| range.map(|i| -f64::from(mass[i]) * g.dot(xyz64(x[i]))).sum());
        let one = |law: &dyn Force, range: &Range<usize>| -> f64 {
            sum(range.len(), |part| part.map(|k| range.start + k).map(|i| law.energy(t, f64::from(mass[i]), xyz64(x[i]))).sum())
        };
        fall + self.forces.iter().flat_map(|(law, ranges)| ranges.iter().map(|r| one(law.as_ref(), r))).sum::<f64>()
    }
}

/// Masses of the rows at hand, and their inverses, 0 for pinned ones.
#[derive(Clone, Copy)]
pub struct RowMasses<'a> {
    /// [kg], [kg m²] for frames.
    pub mass: &'a [Real],
    /// 1/mass.
    pub inverse: &'a [Real],
}

impl Equation for Laws {
    fn kinematics(&self) -> Kinematics {
        Kinematics { points: self.masses.points, second_order: true }
    }

    fn rate(&mut self, t: f64, x: &[Row], v: &[Row], out: &mut [Row]) -> Result<(), StepError> {
        self.couple(t, x, v)?;
        let laws = &*self;
        chunks(out, |start, out| {
            let rows = start..start + out.len();
            laws.take_coupled(start, out);
            laws.accelerate(t, start, laws.weights(rows.clone()), &x[rows.clone()], &v[rows], out);
        });
        Ok(())
    }

    fn solve(&mut self, stage: &Stage<'_>, x: &mut [Row], v: &mut [Row], report: &mut StepReport) -> Result<(), StepError> {
        if !self.colliders.is_empty() {
            self.start.clear();
            self.start.extend_from_slice(x);
        }
        let mut work = std::mem::take(&mut self.implicit.newton);
        let solver = self.solver.clone();
        let result = newton::solve(self, stage, x, v, &solver, &mut work, report);
        self.implicit.newton = work;
        result
    }
}

/// The equation of motion of some rows of a system in which no mass feels another.
pub struct Local<'a> {
    /// The laws of the whole system.
    pub laws: &'a Laws,
    /// First row.
    pub start: usize,
}

impl Equation for Local<'_> {
    fn kinematics(&self) -> Kinematics {
        Kinematics { points: self.laws.masses.points.saturating_sub(self.start), second_order: true }
    }

    fn rate(&mut self, t: f64, x: &[Row], v: &[Row], out: &mut [Row]) -> Result<(), StepError> {
        out.fill(ZERO);
        let weights = self.laws.weights(self.start..self.start + x.len());
        self.laws.accelerate(t, self.start, weights, x, v, out);
        Ok(())
    }

    fn solve(&mut self, _: &Stage<'_>, _: &mut [Row], _: &mut [Row], _: &mut StepReport) -> Result<(), StepError> {
        Err(StepError::User("implicit stages are solved for a whole system".into()))
    }
}
