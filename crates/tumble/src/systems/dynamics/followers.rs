//! Points and frames that are held and follow a collider, one of its bones, or its surface: functions of time alone, and so in no snapshot.

use super::contact::real;
use super::core::Core;
use super::feature::{Feature, Span};
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
    /// The part of it that carries the point.
    pub carrier: Carrier,
    /// Its place in the frame of the carrier [m].
    pub place: Vector,
    /// A held frame that follows with it, and its turn in the frame of the carrier.
    pub frame: Option<(usize, Quat<f64>)>,
}

/// All followers of a system.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Followers(Vec<Follower>);

impl Followers {
    /// Followers given by their places in the world at t = 0, and others `carried` at places in the frames of their carriers.
    pub fn new(mut given: Vec<Follower>, carried: Vec<Follower>, colliders: &[Collider]) -> Self {
        given.iter_mut().for_each(|p| p.place = colliders[p.collider].pose(p.carrier, 0.0).back(p.place));
        given.extend(carried);
        Self(given)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Followers, and the pose of their carriers at t; followers of one carrier stand side by side.
    fn poses(&self, colliders: &[Collider], t: f64) -> Vec<(Follower, Pose)> {
        let mut last: Option<(Follower, Pose)> = None;
        let one = |follower: &Follower| {
            let same = last.filter(|(other, _)| (other.collider, other.carrier) == (follower.collider, follower.carrier));
            let pose = same.map_or_else(|| colliders[follower.collider].pose(follower.carrier, t), |(_, pose)| pose);
            last = Some((*follower, pose));
            (*follower, pose)
        };
        self.0.iter().map(one).collect()
    }
}

impl Feature for Followers {
    /// Gives followers the velocity that takes them to their places at the end of the sub-step.
    fn before(&mut self, core: &mut Core, step: Span) {
        for (follower, pose) in self.poses(&core.laws.colliders, step.end()) {
            let to = pose.out(follower.place);
            let v = (to - xyz64(core.state.x[follower.row])) * (1.0 / step.h);
            core.state.v[follower.row] = row(real(v), 0.0);
        }
        core.memory.ready &= self.is_empty();
    }

    /// Puts followers where their carriers are.
    fn moved(&mut self, core: &mut Core, step: Span) {
        let state = &mut core.state;
        for (follower, pose) in self.poses(&core.laws.colliders, step.end()) {
            let x = pose.out(follower.place);
            state.x[follower.row] = row(real(x), 0.0);
            if let Some((frame, q)) = follower.frame {
                // Of the two quaternions of one turn, the one nearer to the last.
                let turned = pose.turn * q;
                let same = turned.dot(Quat::from_row(state.x[frame].map(f64::from))) >= 0.0;
                state.x[frame] = if same { turned } else { -turned }.row().map(|q| q as Real);
            }
        }
    }
}
