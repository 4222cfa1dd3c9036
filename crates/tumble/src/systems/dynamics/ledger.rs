//! The ledger of a system, the scale of its energy, and breakdowns.

use super::Dynamics;
use super::laws::Acting;
use super::scale::Scale;
use crate::forces::Group;
use crate::integrators::stability::limits;
use crate::math::parallel::{fold, max, sum};
use crate::math::{Row, Vec3, ZERO, is_finite, xyz64};
use crate::state::Object;
use crate::system::System;
use std::ops::Range;
use tumble_interface::StepError;
use tumble_interface::engine::{BLOW_UP, Ledger, Limit, Stability};
use tumble_interface::error::Breakdown;
use tumble_interface::scene::Integrator;

impl Dynamics {
    pub(super) fn ledger_at(&self, t: f64) -> Ledger {
        let (x, v) = (&self.core.state.x, &self.core.state.v);
        let total = self.core.total();
        let strains =
            self.core.laws.batches.iter().map(|b| b.largest_strain(x)).chain(self.core.constraints.iter().map(|c| c.largest_strain(x)));
        let strain = strains.fold(f64::NEG_INFINITY, f64::max);
        // Where every element that can stretch has broken, nothing is stretched.
        let stretch = if strain > f64::NEG_INFINITY { Some(strain + 1.0) } else { (self.core.broken > 0).then_some(0.0) };
        let depths = |i: usize| self.core.depths(i, t);
        let touching = !self.core.laws.colliders.is_empty();
        let closed = self.core.objects.iter().filter(|o| o.closed);
        Ledger {
            time: t,
            mass: total.mass,
            momentum: total.momentum.into(),
            angular_momentum: Some(total.angular.into()),
            kinetic: total.kinetic,
            elastic: self.core.energy_between(true, t),
            external: self.core.energy_between(false, t) + self.core.laws.external_energy(t, x, v)
                - Vec3::from(self.core.laws.gravity.at(t)).dot(total.first_moment),
            stretch,
            penetration: touching.then(|| max(x.len(), |range| range.flat_map(depths).fold(0.0, f64::max)).max(0.0)),
            intersections: self.features.surfaces().and_then(|surfaces| surfaces.intersections(x, t)),
            speed: Some(total.speed_sq.sqrt()),
            contacts: touching.then(|| sum(x.len(), |range| range.filter(|i| depths(*i).next().is_some()).count() as f64) as u64),
            broken: Some(self.core.broken),
            volume: closed.clone().next().map(|_| closed.map(|o| self.core.volume_in(o)).sum()),
            ..Ledger::default()
        }
    }

    /// Takes the scale of the energy from the start: kinetic and elastic energy, a fall by the system's own size, and
    /// gravitation.
    pub(super) fn set_scale(&mut self) {
        let ledger = self.ledger_at(0.0);
        let far = |a: Vec3<f64>, b: Vec3<f64>| (a - b).norm();
        let first = self.core.state.x.first().map(|x| xyz64(*x)).unwrap_or_default();
        let rows = &self.core.state.x[..];
        let span =
            |points: Range<usize>| max(points.len(), |range| range.map(|i| far(xyz64(rows[points.start + i]), first)).fold(0.0, f64::max));
        let size = self.core.laws.masses.points().map(span).fold(0.0, f64::max);
        // Gravity that changes gives and takes the energy of a height over the origin.
        let gravity = &self.core.laws.gravity;
        let high =
            |points: Range<usize>| max(points.len(), |range| range.map(|i| xyz64(rows[points.start + i]).norm()).fold(0.0, f64::max));
        let high = if gravity.course.is_constant() { 0.0 } else { self.core.laws.masses.points().map(high).fold(0.0, f64::max) };
        let fall = ledger.mass * gravity.largest * (size + high);
        // The energy that holds masses together is a scale, too, even if they start at rest, and so is that of driving forces.
        let driven: f64 = self.core.drives().sum();
        // Masses that a moving solid hits leave with at most twice its velocity.
        let reach = self.core.laws.colliders.iter().filter_map(|c| c.motion.as_ref()).map(|m| far(m.pivot, first)).fold(size, |a, b| a + b);
        let fastest = self.core.laws.colliders.iter().map(|c| c.fastest(reach)).fold(0.0, f64::max);
        let hit = 2.0 * ledger.mass * fastest * fastest;
        self.core.scale = Scale::new(&ledger, fall.max(self.core.energy_between(false, 0.0).abs()).max(hit).max(driven), self.core.noise());
    }

    /// Takes the scale of the energy from the ledger of a good frame. Energy that came from nowhere does not count, or a slow
    /// explosion would carry its scale along; pushes of other systems bring energy of unknown origin.
    pub(super) fn rescale(&mut self, ledger: &Ledger) {
        let drives = self.core.laws.colliders.iter().any(|c| c.moves()) || self.core.drives().next().is_some();
        let changes = !self.core.laws.gravity.course.is_constant();
        let changes = changes || self.core.laws.forces.iter().any(|force| force.law.drives());
        let driven = self.pushed || changes || !self.features.followers.is_empty() || drives || !self.core.laws.user.is_empty();
        let gain = if driven { 0.0 } else { (ledger.energy() - self.core.scale.start).max(0.0) };
        let external = (ledger.external - self.core.scale.external).abs();
        let energy = ledger.kinetic.max(ledger.elastic).max(external) - gain;
        if !self.core.pool.is_empty() {
            // Particles that have left are no scale for those that are there.
            self.core.scale.fade();
        }
        let mut scale = self.core.scale;
        scale.take(energy, || self.core.noise());
        self.core.scale = scale;
    }

    /// The ledger at time t [s], or the breakdown.
    pub(super) fn checked_ledger(&self, t: f64) -> Result<Ledger, StepError> {
        let state = &self.core.state;
        let ledger = self.ledger_at(t);
        // One number that is not finite makes these sums so.
        let finite = ledger.kinetic.is_finite() && ledger.angular_momentum.iter().flatten().all(|l| l.is_finite());
        let bad = |rows: &[Row]| fold(rows.len(), |mut range| range.find(|i| !is_finite(rows[*i]))).into_iter().flatten().next();
        let columns = [("position", &state.x), ("velocity", &state.v)];
        let search = || columns.into_iter().find_map(|(column, rows)| Some((column, bad(rows)?, None)));
        let mut found = if finite { None } else { search() };
        if found.is_none() && !self.tolerant {
            let ratio = self.core.scale.growth(&self.scheme.felt(&ledger)).filter(|g| *g > BLOW_UP || g.is_nan());
            if let Some(ratio) = ratio {
                let points = self.core.laws.masses.points().flatten();
                let fastest = points.max_by(|a, b| xyz64(state.v[*a]).norm_sq().total_cmp(&xyz64(state.v[*b]).norm_sq()));
                found = Some(("velocity", fastest.unwrap_or(0), Some(ratio)));
            }
        }
        let Some((column, i, energy_ratio)) = found else { return Ok(ledger) };
        let (object, index) = self.owner_of(i);
        let breakdown = Box::new(Breakdown {
            system: self.name().into(),
            object,
            column: column.into(),
            index,
            id: self.core.pool.id_of(i),
            cell: None,
            time: t,
            integrator: self.core.integrator.name().into(),
            step: 0.0,
            stable_step: if self.scheme.has_stability_limit() { 0.0 } else { f64::INFINITY },
            energy_ratio,
            cause: self.failing_force(i),
        });
        Err(if energy_ratio.is_none() { StepError::NotFinite(breakdown) } else { StepError::Exploded(breakdown) })
    }

    /// The force that is not finite on a row as it was before the sub-step that broke it.
    fn failing_force(&self, i: usize) -> Option<String> {
        let (t, x, v) = self.witness.as_ref()?;
        let (x, v) = (x.get(i..=i)?, v.get(i..=i)?);
        let is_bad = |acting: &&Acting| {
            let mut force = [ZERO];
            acting.law.add(*t, Group::new(&self.core.laws.masses, i, x, v), &mut force);
            acting.ranges.iter().any(|range| range.contains(&i)) && !is_finite(force[0])
        };
        let name = &self.core.laws.forces.iter().find(is_bad)?.name;
        Some(format!("{name} gives no finite number at {:?} m", <[f64; 3]>::from(xyz64(x[0]))))
    }

    /// Object and index within it of a row.
    pub(super) fn owner_of(&self, i: usize) -> (String, usize) {
        let owner = |o: &&Object| o.points.contains(&i) || o.frames.contains(&i);
        self.core
            .objects
            .iter()
            .find(owner)
            .map_or((String::new(), i), |o| (o.name.clone(), if o.points.contains(&i) { i - o.points.start } else { i - o.frames.start }))
    }

    /// The estimate of the sub-step that is watched, from the state before it or, where that is stiffer, after it; else of the state that there is.
    pub(super) fn estimate_of_witness(&mut self, dt: f64, go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability> {
        let finite = |rows: &[Row]| rows.iter().all(|row| is_finite(*row));
        let here = finite(&self.core.state.x) && finite(&self.core.state.v);
        let after = if here || self.witness.is_none() { self.estimate(dt, go_on) } else { None };
        let Some((_, x, v)) = self.witness.clone().filter(|(_, x, _)| x.len() == self.core.state.x.len()) else { return after };
        let now = (std::mem::replace(&mut self.core.state.x, x), std::mem::replace(&mut self.core.state.v, v));
        let before = self.estimate(dt, go_on);
        (self.core.state.x, self.core.state.v) = now;
        let stiffer = |a: Stability, b: Stability| if b.frequency.max(b.damping_max) > a.frequency.max(a.damping_max) { b } else { a };
        match (before, after) {
            (Some(before), Some(after)) => Some(stiffer(before, after)),
            (before, after) => before.or(after),
        }
    }

    /// The pre-flight estimate.
    pub(super) fn estimate(&mut self, dt: f64, go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability> {
        if !self.scheme.has_stability_limit() {
            return None;
        }
        let modes = self.core.modes(go_on)?;
        let list = modes.list();
        let fixed = Integrator::ALL.into_iter().filter(|i| !i.is_adaptive());
        let limits = fixed
            .map(|integrator| {
                let (stable, usable) = limits(integrator, &list);
                Limit { integrator, stable, usable }
            })
            .collect();
        // Looking changes no state.
        let kept = (self.automatic, self.measured);
        let substeps = self.substeps(dt, go_on);
        (self.automatic, self.measured) = kept;
        Some(Stability {
            system: self.core.name.clone(),
            integrator: self.core.integrator,
            step: dt / substeps,
            frequency: modes.stiffest.frequency,
            damping: modes.stiffest.damping,
            damping_max: modes.most_damped.damping,
            culprit: modes.culprit.map(|i| self.owner_of(i)),
            limits,
        })
    }
}
