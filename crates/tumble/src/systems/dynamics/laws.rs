//! The right-hand side: accelerations of the masses at (t, x, v).

use crate::elements::Batch;
use crate::forces::{Force, Gravity, Group};
use crate::geometry::{Collider, Vector};
use crate::integrators::{Equation, Kinematics, Stage};
use crate::linalg::blocks::Block;
use crate::math::parallel::{chunks, sum};
use crate::math::rows::{self, Each};
use crate::math::{Lane, Real, Row, ZERO, add};
use crate::state::Masses;
use std::ops::Range;
use std::sync::Arc;
use tumble_interface::StepError;
use tumble_interface::engine::{StepReport, UserForce};

/// A force on each mass by itself, and the masses that it acts on.
pub struct Acting {
    /// Its place in the scene.
    pub name: String,
    /// The force.
    pub law: Box<dyn Force>,
    /// Objects that it acts on as a whole.
    pub objects: Vec<usize>,
    /// Their rows, or those of some of their points.
    pub ranges: Vec<Range<usize>>,
}

/// Every law of a system.
#[derive(Default)]
pub struct Laws {
    /// Elements between masses.
    pub batches: Vec<Box<dyn Batch>>,
    /// Forces on each mass by itself.
    pub forces: Vec<Acting>,
    /// Forces written by users.
    pub user: Vec<Box<dyn UserForce>>,
    /// Forces of other systems [N] on rows, in their order, constant over an interval.
    pub steady: Vec<(usize, Vector)>,
    /// Gravity on points [m/s²].
    pub gravity: Gravity,
    /// Masses and moments of inertia of the rows.
    pub masses: Masses,
    /// Solids.
    pub colliders: Arc<Vec<Collider>>,
    /// Stiffness with which the elements hold each row at the start [N/m]; emitted particles have none.
    pub grip: Vec<Real>,
    /// Users' forces on the rows; scratch.
    pub pushes: Vec<[f64; 3]>,
}

/// The symmetric part of minus a matrix; if it is to be definite, with as much on the diagonal as Gershgorin's circles ask for.
fn resisting(m: [f64; 9], definite: bool) -> Block {
    let [xy, yz, zx] = [m[1] + m[3], m[5] + m[7], m[2] + m[6]].map(|sum| -0.5 * sum);
    let diagonal = [-m[0], -m[4], -m[8]];
    let around = [xy.abs() + zx.abs(), xy.abs() + yz.abs(), yz.abs() + zx.abs()];
    let least = (0..3).map(|c| diagonal[c] - around[c]).fold(0.0, f64::min);
    let [xx, yy, zz] = diagonal.map(|d| if definite { d - least } else { d });
    [xx, yy, zz, xy, yz, zx].map(|b| b as Real)
}

impl Laws {
    /// Whether no mass feels another, so that each can be stepped by itself.
    pub fn is_local(&self) -> bool {
        self.batches.is_empty() && self.user.is_empty()
    }

    /// Prepares the sums of forces at (x, v): elements, and users' forces.
    fn begin(&mut self, t: f64, x: &[Row], v: &[Row]) -> Result<(), StepError> {
        for batch in &mut self.batches {
            batch.begin_forces(t, x, v);
        }
        if self.user.is_empty() {
            return Ok(());
        }
        let [xs, vs, mass] = self.points(x, v);
        let mut pushes = vec![0.0; xs.len()];
        for user in &mut self.user {
            user.force(t, &xs, &vs, &mass, &mut pushes).map_err(StepError::User)?;
        }
        self.pushes.clear();
        self.pushes.resize(x.len(), [0.0; 3]);
        for (i, push) in self.masses.points().flatten().zip(pushes.as_chunks().0) {
            self.pushes[i] = *push;
        }
        Ok(())
    }

    /// Positions, velocities and masses of all points, as users' forces take them.
    fn points(&self, x: &[Row], v: &[Row]) -> [Vec<f64>; 3] {
        let masses = &self.masses;
        let mass = masses.points().flat_map(|points| &masses.mass[points]).map(|m| f64::from(*m)).collect();
        [masses.flat(x), masses.flat(v), mass]
    }

    /// Calls `add` with every point and its own stiffness -df/dx [N/m] and damping -df/dv [N s/m] by users' forces, as far as they tell them. Of these the
    /// symmetric parts; `definite` ones where that is asked for, stiffer by the least that makes them so.
    pub fn add_user_stiffness(
        &mut self,
        t: f64,
        x: &[Row],
        v: &[Row],
        definite: bool,
        mut add: impl FnMut(usize, [Block; 2]),
    ) -> Result<(), StepError> {
        if self.user.is_empty() {
            return Ok(());
        }
        let [xs, vs, mass] = self.points(x, v);
        for user in &mut self.user {
            let Some(all) = user.jacobian(t, &xs, &vs, &mass).map_err(StepError::User)? else { continue };
            for (i, both) in self.masses.points().flatten().zip(all) {
                add(i, both.map(|matrix| resisting(matrix, definite)));
            }
        }
        Ok(())
    }

    /// Forces on the rows from `start` on, gravity left out.
    fn sum(&self, t: f64, start: usize, x: &[Row], v: &[Row], out: &mut [Row]) {
        let end = start + out.len();
        out.fill(ZERO);
        for batch in &self.batches {
            batch.add_forces(x, v, start, out);
        }
        for (f, push) in out.iter_mut().zip(self.pushes.get(start..).unwrap_or_default()) {
            *f = add(*f, [push[0] as Real, push[1] as Real, push[2] as Real, 0.0]);
        }
        self.add_local(t, start, &x[start..end], &v[start..end], out);
    }

    /// Adds the forces on each mass by itself, gravity left out, to the rows from `start` on.
    fn add_local(&self, t: f64, start: usize, x: &[Row], v: &[Row], force: &mut [Row]) {
        let (end, group) = (start + x.len(), Group::new(&self.masses, start, x, v));
        let first = self.steady.partition_point(|(row, _)| *row < start);
        for (row, push) in self.steady[first..].iter().take_while(|(row, _)| *row < end) {
            force[row - start] = add(force[row - start], [push.x as Real, push.y as Real, push.z as Real, 0.0]);
        }
        for Acting { law, objects, ranges, .. } in &self.forces {
            // Runs of points are in order; objects need not be, as what is emitted stands at the end.
            let runs = objects.is_empty();
            let from = if runs { ranges.partition_point(|range| range.end <= start) } else { 0 };
            for range in ranges[from..].iter().take_while(|range| !runs || range.start < end) {
                let (a, b) = (range.start.max(start), range.end.min(end));
                if a < b {
                    let (a, b) = (a - start, b - start);
                    law.add(t, group.part(a..b), &mut force[a..b]);
                }
            }
        }
    }

    /// Turns the forces on the rows from `start` on into accelerations.
    fn accelerate(&self, t: f64, masses: &Masses, start: usize, x: &[Row], out: &mut [Row]) {
        let [gx, gy, gz] = self.gravity.at(t).map(|g| g as Real);
        let [before, frames, after] = masses.frames.cut(start, x.len());
        for points in [before, after] {
            rows::each_by_last(&mut out[points.clone()], &x[points], [gx, gy, gz, 0.0], Weigh);
        }
        if !frames.is_empty() {
            let first = start + frames.start - masses.frames.start;
            let inverse = &masses.inverse_inertia[first..first + frames.len()];
            rows::each(&mut out[frames.clone()], inverse, &x[frames], ZERO, Weigh);
        }
    }

    /// Points and frames.
    pub fn kinematics(&self) -> Kinematics {
        Kinematics { frames: self.masses.frames, second_order: true }
    }

    /// Accelerations at (t, x, v) [m/s², rad/s²].
    pub fn rate(&mut self, t: f64, x: &[Row], v: &[Row], out: &mut [Row]) -> Result<(), StepError> {
        self.begin(t, x, v)?;
        let laws = &*self;
        chunks(out, |start, out| {
            laws.sum(t, start, x, v, out);
            laws.accelerate(t, &laws.masses, start, &x[start..start + out.len()], out);
        });
        Ok(())
    }

    /// Accelerations of the rows from `start` on, where no mass feels another.
    pub fn rate_alone(&self, t: f64, start: usize, x: &[Row], v: &[Row], out: &mut [Row]) {
        out.fill(ZERO);
        self.add_local(t, start, x, v, out);
        self.accelerate(t, &self.masses, start, x, out);
    }

    /// Forces of everything but contact [N, N m].
    pub fn forces(&mut self, t: f64, x: &[Row], v: &[Row], out: &mut [Row]) -> Result<(), StepError> {
        self.begin(t, x, v)?;
        let laws = &*self;
        let g = self.gravity.at(t).map(|g| g as Real);
        chunks(out, |start, out| {
            laws.sum(t, start, x, v, out);
            let [before, _, after] = laws.masses.frames.cut(start, out.len());
            for i in before.chain(after) {
                let (f, m) = (&mut out[i], laws.masses.mass[start + i]);
                *f = [f[0] + m * g[0], f[1] + m * g[1], f[2] + m * g[2], 0.0];
            }
        });
        Ok(())
    }

    /// Potential energy of the forces that have one [J], gravity left out.
    pub fn external_energy(&self, t: f64, x: &[Row], v: &[Row]) -> f64 {
        let group = Group::new(&self.masses, 0, x, v);
        let of = |law: &dyn Force, i: usize| law.energy(t, &group.one(i));
        let has_one = |(law, range): &(&dyn Force, &Range<usize>)| !range.is_empty() && of(*law, range.start).is_some();
        let all = self.forces.iter().flat_map(|f| f.ranges.iter().map(|range| (f.law.as_ref(), range)));
        all.filter(has_one).map(|(law, range)| sum(range.len(), |part| part.filter_map(|k| of(law, range.start + k)).sum())).sum()
    }
}

/// f/m + g; pinned masses do not fall.
struct Weigh;

impl Each for Weigh {
    #[inline(always)]
    fn at<L: Lane>(&self, inverse: L, _: L, gravity: L, force: L) -> L {
        force * inverse + inverse.positive(gravity, inverse.zero())
    }
}

/// The equation of motion of some masses that feel no other: rows of a system, or newborn that are not in it yet.
pub struct Local<'a> {
    /// The laws of the whole system.
    pub laws: &'a Laws,
    /// Their masses.
    pub masses: &'a Masses,
    /// First of their rows in `masses`.
    pub start: usize,
    /// Of newborn, the object that they belong to.
    pub newborn: Option<usize>,
}

impl Equation for Local<'_> {
    fn kinematics(&self) -> Kinematics {
        Kinematics { frames: self.masses.frames.from(self.start), second_order: true }
    }

    fn rate(&mut self, t: f64, x: &[Row], v: &[Row], out: &mut [Row]) -> Result<(), StepError> {
        out.fill(ZERO);
        match self.newborn {
            None => self.laws.add_local(t, self.start, x, v, out),
            Some(object) => {
                let group = Group::new(self.masses, self.start, x, v);
                self.laws.forces.iter().filter(|f| f.objects.contains(&object)).for_each(|f| f.law.add(t, group, out));
            }
        }
        self.laws.accelerate(t, self.masses, self.start, x, out);
        Ok(())
    }

    fn solve(&mut self, _: &Stage<'_>, _: &mut [Row], _: &mut [Row], _: &mut StepReport) -> Result<(), StepError> {
        Err(StepError::User("implicit stages are solved for a whole system".into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_that_pushes_away_is_made_to_resist() {
        // Eigenvalues -1 and 3 in a plane, and an antisymmetric part that does not count.
        let m = [-1.0, 2.5, 0.0, 1.5, -1.0, 0.0, 0.0, 0.0, -4.0];
        assert_eq!(resisting(m, false), [1.0, 1.0, 4.0, -2.0, 0.0, 0.0]);
        // Stiffer by 1, so that the least eigenvalue is 0.
        assert_eq!(resisting(m, true), [2.0, 2.0, 5.0, -2.0, 0.0, 0.0]);
        assert_eq!(resisting([-3.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -2.0], true), [3.0, 1.0, 2.0, 0.0, 0.0, 0.0]);
    }
}
