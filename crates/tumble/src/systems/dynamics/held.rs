//! Points that are held and follow a collider, or one of its bones: functions of time alone, and so in no snapshot.

use super::Dynamics;
use crate::geometry::{Collider, Vector};
use crate::math::{Real, row, xyz64};

/// A point that follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held {
    /// Its row.
    pub row: usize,
    /// The collider, counted from the first.
    pub collider: usize,
    /// One of its bones, or the whole.
    pub bone: Option<usize>,
    /// Where it is in what it follows [m].
    pub place: Vector,
}

impl Held {
    /// Points whose places are those at t = 0 in the world.
    pub fn at_rest(mut points: Vec<Held>, colliders: &[Collider]) -> Vec<Held> {
        points.iter_mut().for_each(|p| p.place = colliders[p.collider].pose(p.bone, 0.0).back(p.place));
        points
    }
}

impl Dynamics {
    /// Gives held points the velocity that takes them to where they have to be at t + h.
    pub(super) fn lead_held(&mut self, t: f64, h: f64) {
        for held in &self.held {
            let to = self.laws.colliders[held.collider].pose(held.bone, t + h).out(held.place);
            let v = (to - xyz64(self.state.x[held.row])) * (1.0 / h);
            self.state.v[held.row] = row(real(v), 0.0);
        }
    }

    /// Puts held points to where they have to be at t.
    pub(super) fn place_held(&mut self, t: f64) {
        for held in &self.held {
            let x = self.laws.colliders[held.collider].pose(held.bone, t).out(held.place);
            self.state.x[held.row] = row(real(x), 0.0);
        }
    }
}

fn real(v: Vector) -> crate::math::Vec3<Real> {
    crate::math::Vec3 { x: v.x as Real, y: v.y as Real, z: v.z as Real }
}
