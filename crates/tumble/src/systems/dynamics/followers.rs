//! Points and frames that are held and follow a collider, one of its bones, or its surface.
//!
//! They are functions of time alone; of those that are taken hold of later, a snapshot has the place.

use super::contact::real;
use super::core::Core;
use super::feature::{Feature, Span};
use super::holds::Times;
use crate::geometry::motion::Pose;
use crate::geometry::{Carrier, Collider, Vector};
use crate::math::{Quat, Real, row, xyz64};
use crate::system::{Archive, Part};

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
    /// When it is held.
    pub times: Times,
}

/// All followers of a system.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Followers {
    list: Vec<Follower>,
    /// Whether the places of those that are taken hold of later are known by now.
    taken: Vec<bool>,
}

impl Followers {
    /// Followers given by their places in the world at t = 0, and others `carried` at places in the frames of their carriers.
    pub fn new(mut given: Vec<Follower>, carried: Vec<Follower>, colliders: &[Collider]) -> Self {
        given.iter_mut().for_each(|p| p.place = colliders[p.collider].pose(p.carrier, 0.0).back(p.place));
        given.extend(carried);
        Self { taken: given.iter().map(|p| p.times.from <= 0.0).collect(), list: given }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Followers that are held in a sub-step, and the pose of their carriers at its end; followers of one carrier stand side by side.
    fn poses(&self, colliders: &[Collider], step: Span) -> Vec<(Follower, Pose)> {
        let t = step.end();
        let mut last: Option<(Follower, Pose)> = None;
        let one = |follower: &Follower| {
            let same = last.filter(|(other, _)| (other.collider, other.carrier) == (follower.collider, follower.carrier));
            let pose = same.map_or_else(|| colliders[follower.collider].pose(follower.carrier, t), |(_, pose)| pose);
            last = Some((*follower, pose));
            (*follower, pose)
        };
        self.list.iter().filter(|follower| follower.times.cover(step)).map(one).collect()
    }
}

impl Followers {
    /// Takes the places of those that are held from this sub-step on.
    fn take(&mut self, core: &Core, step: Span) {
        for (follower, taken) in self.list.iter_mut().zip(&mut self.taken) {
            if !*taken && follower.times.cover(step) {
                let pose = core.laws.colliders[follower.collider].pose(follower.carrier, step.t);
                follower.place = pose.back(xyz64(core.state.x[follower.row]));
                *taken = true;
            }
        }
    }
}

impl Feature for Followers {
    /// Gives followers the velocity that takes them to their places at the end of the sub-step.
    fn before(&mut self, core: &mut Core, step: Span) {
        self.take(core, step);
        for (follower, pose) in self.poses(&core.laws.colliders, step) {
            let to = pose.out(follower.place);
            let v = (to - xyz64(core.state.x[follower.row])) * (1.0 / step.h);
            core.state.v[follower.row] = row(real(v), 0.0);
        }
        core.memory.ready &= self.is_empty();
    }

    /// Puts followers where their carriers are.
    fn moved(&mut self, core: &mut Core, step: Span) {
        let state = &mut core.state;
        for (follower, pose) in self.poses(&core.laws.colliders, step) {
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

    fn save(&self, _core: &Core, archive: &mut Archive) {
        let later = self.list.iter().zip(&self.taken).filter(|(follower, _)| follower.times.from > 0.0);
        let numbers: Vec<f64> = later.flat_map(|(f, taken)| [f64::from(u8::from(*taken)), f.place.x, f.place.y, f.place.z]).collect();
        if !numbers.is_empty() {
            archive.push("followers", Part::Numbers(numbers));
        }
    }

    fn restore(&mut self, _core: &mut Core, archive: &mut Archive) -> Option<()> {
        let later: Vec<_> = self.list.iter_mut().zip(&mut self.taken).filter(|(follower, _)| follower.times.from > 0.0).collect();
        if later.is_empty() {
            return Some(());
        }
        let numbers = archive.numbers("followers")?;
        if numbers.len() != 4 * later.len() {
            return None;
        }
        for ((follower, taken), n) in later.into_iter().zip(numbers.chunks_exact(4)) {
            *taken = n[0] == 1.0;
            follower.place = Vector { x: n[1], y: n[2], z: n[3] };
        }
        Some(())
    }
}
