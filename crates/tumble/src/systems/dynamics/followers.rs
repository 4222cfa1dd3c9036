//! Points and frames that are held and follow a collider, one of its bones, or its surface: functions of time alone, and so in no snapshot.

use super::Dynamics;
use super::contact::real;
use crate::geometry::motion::Pose;
use crate::geometry::{Carrier, Collider, Vector};
use crate::math::{Quat, Real, row, xyz64};

/// A point that follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Follower {
    /// Its row.
    pub row: usize,
    /// The collider, counted from the first.
    pub collider: usize,
    /// What of it.
    pub carrier: Carrier,
    /// Where it is in what it follows [m].
    pub place: Vector,
    /// A held frame that follows with it, and its turn in what it follows.
    pub frame: Option<(usize, Quat<f64>)>,
}

impl Follower {
    /// Points whose places are those at t = 0 in the world.
    pub fn at_rest(mut points: Vec<Follower>, colliders: &[Collider]) -> Vec<Follower> {
        points.iter_mut().for_each(|p| p.place = colliders[p.collider].pose(p.carrier, 0.0).back(p.place));
        points
    }
}

impl Dynamics {
    /// Followers, and the pose of their carriers at t; followers of one carrier stand side by side.
    fn poses(&self, t: f64) -> Vec<(Follower, Pose)> {
        let mut last: Option<(Follower, Pose)> = None;
        let one = |held: &Follower| {
            let same = last.filter(|(other, _)| (other.collider, other.carrier) == (held.collider, held.carrier));
            let pose = same.map_or_else(|| self.laws.colliders[held.collider].pose(held.carrier, t), |(_, pose)| pose);
            last = Some((*held, pose));
            (*held, pose)
        };
        self.followers.iter().map(one).collect()
    }

    /// Gives held points the velocity that takes them to where they have to be at t + h.
    pub(super) fn lead_followers(&mut self, t: f64, h: f64) {
        for (held, pose) in self.poses(t + h) {
            let to = pose.out(held.place);
            let v = (to - xyz64(self.state.x[held.row])) * (1.0 / h);
            self.state.v[held.row] = row(real(v), 0.0);
        }
    }

    /// Puts held points to where they have to be at t.
    pub(super) fn place_followers(&mut self, t: f64) {
        for (held, pose) in self.poses(t) {
            let x = pose.out(held.place);
            self.state.x[held.row] = row(real(x), 0.0);
            if let Some((frame, q)) = held.frame {
                // Of the two that are the same turn, the one that is nearer to the last.
                let turned = pose.turn * q;
                let same = turned.dot(Quat::from_row(self.state.x[frame].map(f64::from))) >= 0.0;
                self.state.x[frame] = if same { turned } else { -turned }.row().map(|q| q as Real);
            }
        }
    }
}
