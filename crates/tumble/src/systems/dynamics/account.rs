//! The ledger by object, and the rows of its worst numbers: asked for where a bound is broken, not in every frame.

use super::Dynamics;
use super::self_contact::{Crossing, Other};
use crate::math::parallel::worst;
use crate::math::xyz64;
use crate::state::Object;
use crate::system::System;
use tumble_interface::engine::{Ledger, Share, Worst};

impl Dynamics {
    pub(super) fn shares_at(&self, t: f64) -> Vec<Share> {
        self.core.objects.iter().map(|o| Share { system: self.name().into(), object: o.name.clone(), ledger: self.share(o, t) }).collect()
    }

    fn share(&self, object: &Object, t: f64) -> Ledger {
        let sums = self.core.sums(std::iter::once(object.points.clone()), object.frames.clone());
        Ledger {
            time: t,
            mass: sums.mass,
            momentum: sums.momentum.into(),
            angular_momentum: Some(sums.angular.into()),
            kinetic: sums.kinetic,
            speed: Some(sums.speed_sq.sqrt()),
            volume: object.closed.then(|| self.core.volume_in(object)),
            ..Ledger::default()
        }
    }

    pub(super) fn worst_at(&self, t: f64) -> Vec<Worst> {
        let (x, v, frames) = (&self.core.state.x, &self.core.state.v, self.core.laws.masses.frames);
        let fastest = worst(x.len(), |i| if frames.contains(i) { 0.0 } else { xyz64(v[i]).norm() });
        let deepest = worst(x.len(), |i| self.core.depths(i, t).fold(f64::NEG_INFINITY, f64::max));
        let strained = self
            .core
            .laws
            .batches
            .iter()
            .filter_map(|b| b.most_strained(x))
            .chain(self.core.constraints.iter().filter_map(|c| c.most_strained(x)));
        let strained = strained.max_by(|a, b| a.0.total_cmp(&b.0));
        let crossing = self.features.surfaces().and_then(|surfaces| surfaces.crossing(x, t));
        let mut all = Vec::new();
        all.extend(fastest.map(|(i, speed)| self.worst_of("speed", speed, &[i as u32])));
        all.extend(deepest.filter(|(_, depth)| *depth > 0.0).map(|(i, depth)| self.worst_of("penetration", depth, &[i as u32])));
        all.extend(strained.map(|(strain, rows)| self.worst_of("stretch", strain + 1.0, &rows)));
        all.extend(crossing.map(|Crossing { count, vertices, other }| {
            let other = match other {
                Other::Soft(vertex) => self.owner_of(vertex as usize).0,
                Other::Solid(name) => name,
            };
            Worst { other: Some(other), ..self.worst_of("intersections", count as f64, &vertices) }
        }));
        all
    }

    /// A number of these rows, which are of one object; those of another are left out.
    fn worst_of(&self, measure: &'static str, value: f64, rows: &[u32]) -> Worst {
        let owners: Vec<(String, usize)> = rows.iter().map(|i| self.owner_of(*i as usize)).collect();
        let object = owners.first().map_or(String::new(), |(name, _)| name.clone());
        let particles = owners.into_iter().filter(|(name, _)| *name == object).map(|(_, i)| i).collect();
        let id = rows.first().and_then(|i| self.core.pool.id_of(*i as usize));
        Worst { measure, value, object, other: None, particles, id, cell: None }
    }
}
