//! Who has how much of the books, and where the worst numbers in them are. Asked for where a bound is broken, not in every frame.

use super::Dynamics;
use super::layers::{Crossing, Other};
use crate::math::parallel::worst;
use crate::math::xyz64;
use crate::state::Object;
use crate::system::System;
use tumble_interface::engine::{Ledger, Share, Worst};

impl Dynamics {
    pub(super) fn shares_at(&self, t: f64) -> Vec<Share> {
        self.objects.iter().map(|o| Share { system: self.name().into(), object: o.name.clone(), ledger: self.share(o, t) }).collect()
    }

    fn share(&self, object: &Object, t: f64) -> Ledger {
        let sums = self.sums(object.points.clone(), object.frames.clone());
        Ledger {
            time: t,
            mass: sums.mass,
            momentum: sums.momentum.into(),
            angular_momentum: Some(sums.angular.into()),
            kinetic: sums.kinetic,
            speed: Some(sums.speed_sq.sqrt()),
            volume: object.closed.then(|| self.volume_in(object)),
            ..Ledger::default()
        }
    }

    pub(super) fn worst_at(&self, t: f64) -> Vec<Worst> {
        let (x, v, points) = (&self.state.x, &self.state.v, self.laws.masses.points);
        let fastest = worst(points, |i| xyz64(v[i]).norm());
        let deepest = worst(points, |i| self.depths(i, t).fold(f64::NEG_INFINITY, f64::max));
        let strained =
            self.laws.batches.iter().filter_map(|b| b.most_strained(x)).chain(self.constraints.iter().filter_map(|c| c.most_strained(x)));
        let strained = strained.max_by(|a, b| a.0.total_cmp(&b.0));
        let crossing = self.layers.as_ref().or(self.judge.as_ref()).and_then(|layers| layers.crossing(x, t));
        let mut all = Vec::new();
        all.extend(fastest.map(|(i, speed)| self.blame("speed", speed, &[i as u32])));
        all.extend(deepest.filter(|(_, depth)| *depth > 0.0).map(|(i, depth)| self.blame("penetration", depth, &[i as u32])));
        all.extend(strained.map(|(strain, rows)| self.blame("stretch", strain + 1.0, &rows)));
        all.extend(crossing.map(|Crossing { count, vertices, other }| {
            let other = match other {
                Other::Soft(vertex) => self.whose(vertex as usize).0,
                Other::Solid(name) => name,
            };
            Worst { other: Some(other), ..self.blame("intersections", count as f64, &vertices) }
        }));
        all
    }

    /// A number of these rows, which are of one object; those of another are left out.
    fn blame(&self, measure: &'static str, value: f64, rows: &[u32]) -> Worst {
        let owners: Vec<(String, usize)> = rows.iter().map(|i| self.whose(*i as usize)).collect();
        let object = owners.first().map_or(String::new(), |(name, _)| name.clone());
        let particles = owners.into_iter().filter(|(name, _)| *name == object).map(|(_, i)| i).collect();
        let id = rows.first().and_then(|i| self.pool.id_of(*i as usize));
        Worst { measure, value, object, other: None, particles, id, cell: None }
    }
}
