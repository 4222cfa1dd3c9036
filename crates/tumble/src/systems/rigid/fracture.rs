//! Bodies that break: a cluster of pieces moves as one body, in the row of its first piece, until its glue fails. What it falls into has the rigid
//! motion that it had: momentum, angular momentum and energy stay.                                                    (fracture.2)

use super::body::Body;
use super::contact::{Bodies, Contact};
use super::glue::{Cluster, Six};
use super::joint::{Joint, WORLD};
use super::pattern::{Frame, Pattern};
use super::solve::Blow;
use crate::exchange::Push;
use crate::geometry::{Collider, Vector};
use crate::math::Quat;
use crate::math::parallel::Tasks;
use std::sync::Arc;

/// A body of pieces.
pub struct Cracked {
    /// How it breaks.
    pub pattern: Arc<Pattern>,
    /// Row of its first piece; all pieces have one.
    pub first: usize,
    /// Which of its bonds have broken.
    pub broken: Vec<bool>,
    /// Of each piece the first one of its cluster.
    lead: Vec<usize>,
    /// Of each first one, what its cluster is as a body.
    frames: Vec<Frame>,
    /// Of each first one, what masses of other systems touch, its reach [m] and its volume [m³].
    pub covers: Vec<(Arc<Collider>, f64, f64)>,
    /// Whether they have changed since they were published.
    pub fresh: bool,
}

/// A body that has fallen apart.
pub struct Fallen {
    /// What it was, and its row.
    pub whole: Body,
    /// Its row.
    pub row: usize,
    /// Rows of what it has fallen into.
    pub rows: Vec<usize>,
}

impl Fallen {
    /// What an impulse on it [N s] with this moment about the origin [N m s] is on its parts: they go on as it would have.
    pub fn share(&self, rows: &[Body], push: &Push) -> Vec<Push> {
        let moment = push.moment - self.whole.x.cross(push.impulse);
        let (velocity, spin) = (push.impulse * self.whole.inverse_mass, self.whole.turned(moment));
        let part = |row: &usize| {
            let body = &rows[*row];
            let impulse = (velocity + spin.cross(body.x - self.whole.x)) * (1.0 / body.inverse_mass);
            let moment = body.x.cross(impulse) + Body { w: spin, ..*body }.spin();
            Push { row: *row, impulse, moment, ..*push }
        };
        self.rows.iter().map(part).collect()
    }
}

/// Where a joint holds a body of pieces.
pub struct Hold {
    joint: usize,
    end: usize,
    cracked: usize,
    piece: usize,
    /// Point [m] and axes in those of the whole.
    at: Vector,
    turn: Quat<f64>,
}

impl Cracked {
    /// A body whose pieces begin with a row.
    pub fn new(pattern: Arc<Pattern>, first: usize) -> Self {
        let n = pattern.pieces.len();
        let cover = (pattern.solid.clone(), pattern.hull.reach, pattern.pieces.iter().map(|piece| piece.volume).sum());
        Self {
            first,
            broken: vec![false; pattern.bonds.len()],
            lead: vec![0; n],
            frames: vec![pattern.whole.clone(); n],
            covers: vec![cover; n],
            fresh: false,
            pattern,
        }
    }

    /// How many pieces it has.
    pub fn len(&self) -> usize {
        self.lead.len()
    }

    /// Pieces of a cluster, in order.
    fn members(&self, lead: usize) -> Vec<usize> {
        (0..self.len()).filter(|k| self.lead[*k] == lead).collect()
    }

    /// The first pieces of clusters.
    fn leads(&self) -> impl Iterator<Item = usize> {
        (0..self.len()).filter(|k| self.lead[*k] == *k)
    }

    /// The turn of the axes of the whole, as a cluster has it.
    fn turn(&self, bodies: &[Body], lead: usize) -> Quat<f64> {
        (bodies[self.first + lead].q * self.frames[lead].axes.conj()).normalized()
    }

    /// A piece with the motion of its cluster; its axes are those of the whole.
    pub fn piece(&self, bodies: &[Body], k: usize) -> Body {
        let lead = self.lead[k];
        let (body, q) = (bodies[self.first + lead], self.turn(bodies, lead));
        let arm = q.turn(self.pattern.pieces[k].weight.center - self.frames[lead].center);
        Body { x: body.x + arm, q, v: body.velocity_at(arm), ..body }
    }

    /// Makes clusters of what bonds hold together, and rows of clusters, of one that has been born.
    fn settle(&mut self, bodies: &mut Bodies) {
        let pattern = self.pattern.clone();
        self.lead = pattern.clusters(&self.broken);
        for k in 0..self.len() {
            let row = self.first + k;
            if self.lead[k] != k {
                bodies.rows[row] = Body::WORLD;
                continue;
            }
            let members = self.members(k);
            let frame = pattern.frame(&members);
            let (hull, solid, volume) = pattern.surface(&members, &frame);
            self.covers[k] = (solid, hull.reach, volume);
            bodies.hulls[bodies.hull[row] as usize] = hull;
            let body = &mut bodies.rows[row];
            (body.inverse_mass, body.inertia) = (1.0 / frame.mass, frame.inertia);
            body.orient();
            self.frames[k] = frame;
        }
        self.fresh = true;
    }

    /// Takes over which bonds have broken, and whether it has been born.
    pub fn restore(&mut self, broken: Vec<bool>, born: bool, bodies: &mut Bodies) {
        if born {
            self.broken = broken;
            self.settle(bodies);
        } else {
            *self = Self { fresh: true, ..Self::new(self.pattern.clone(), self.first) };
            bodies.rows[self.first..self.first + self.len()].fill(Body::WORLD);
        }
    }

    /// Breaks bonds; the clusters that fall apart.
    fn split(&mut self, bonds: &[usize], bodies: &mut Bodies) -> Vec<Fallen> {
        bonds.iter().for_each(|i| self.broken[*i] = true);
        let before = self.lead.clone();
        if self.pattern.clusters(&self.broken) == before {
            return Vec::new();
        }
        let old: Vec<(Body, Quat<f64>)> =
            (0..self.len()).map(|k| (bodies.rows[self.first + k], self.turn(&bodies.rows, before[k]))).collect();
        let frames = self.frames.clone();
        self.settle(bodies);
        let leads: Vec<usize> = self.leads().collect();
        for k in leads {
            let (from, frame) = (before[k], &self.frames[k]);
            let (body, turn) = (old[from].0, old[from].1);
            let arm = turn.turn(frame.center - frames[from].center);
            let own = &mut bodies.rows[self.first + k];
            (own.x, own.q) = (body.x + arm, (turn * frame.axes).normalized());
            (own.v, own.w) = (body.velocity_at(arm), body.w);
            own.orient();
        }
        let of = |lead: usize| self.leads().filter(|k| before[*k] == lead).map(|k| self.first + k).collect::<Vec<_>>();
        let firsts = (0..self.len()).filter(|k| before[*k] == *k);
        let fallen = firsts.map(|lead| Fallen { whole: old[lead].0, row: self.first + lead, rows: of(lead) });
        fallen.filter(|fallen| fallen.rows.len() > 1).collect()
    }
}

/// All bodies of pieces of a system, in the order of their rows.
#[derive(Default)]
pub struct Fractures {
    /// They.
    pub all: Vec<Cracked>,
    holds: Vec<Hold>,
}

impl Fractures {
    /// Those bodies, and joints between bodies as they are at the start.
    pub fn new(all: Vec<Cracked>, joints: &[Joint]) -> Self {
        let mut made = Self { all, holds: Vec::new() };
        for (joint, words) in joints.iter().enumerate() {
            for (end, row) in words.pair.into_iter().enumerate().filter(|(_, row)| *row != WORLD) {
                let Some((cracked, _)) = made.find(row as usize) else { continue };
                let pattern = &made.all[cracked].pattern;
                let whole = &pattern.whole;
                let (at, turn) = (whole.center + whole.axes.turn(words.at[end]), whole.axes * words.turn[end]);
                let piece = pattern.nearest(at, 0..pattern.pieces.len());
                made.holds.push(Hold { joint, end, cracked, piece, at, turn });
            }
        }
        made
    }

    /// The body of pieces that has a row, and its piece there.
    fn find(&self, row: usize) -> Option<(usize, usize)> {
        let k = self.all.partition_point(|cracked| cracked.first <= row).checked_sub(1)?;
        let piece = row - self.all[k].first;
        (piece < self.all[k].len()).then_some((k, piece))
    }

    /// Bonds that have broken.
    pub fn broken(&self) -> u64 {
        self.all.iter().flat_map(|cracked| &cracked.broken).filter(|broken| **broken).count() as u64
    }

    /// Joints hold the clusters of their pieces.
    pub fn hold(&self, joints: &mut [Joint]) {
        for Hold { joint, end, cracked, piece, at, turn } in &self.holds {
            let cracked = &self.all[*cracked];
            let lead = cracked.lead[*piece];
            let (frame, joint) = (&cracked.frames[lead], &mut joints[*joint]);
            joint.pair[*end] = (cracked.first + lead) as u32;
            joint.at[*end] = frame.axes.conj().turn(*at - frame.center);
            joint.turn[*end] = frame.axes.conj() * *turn;
        }
    }

    /// Breaks what a sub-step of h [s] has loaded too much; says which have fallen apart.
    pub fn crack(&mut self, bodies: &mut Bodies, contacts: &[Contact], blows: &[Blow], joints: &[Joint], h: f64) -> Vec<Fallen> {
        let mut loads: Vec<Vec<Six>> = vec![Vec::new(); self.all.len()];
        let mut put = |row: u32, arm: Vector, force: Vector, couple: Vector| {
            let Some((k, lead)) = self.find(row as usize) else { return };
            let cracked = &self.all[k];
            let (turn, pieces) = (cracked.turn(&bodies.rows, lead).conj(), &cracked.pattern.pieces);
            let (place, force, couple) = (cracked.frames[lead].center + turn.turn(arm), turn.turn(force), turn.turn(couple));
            let piece = cracked.pattern.nearest(place, (0..cracked.len()).filter(|k| cracked.lead[*k] == lead));
            loads[k].resize(cracked.len(), Six::default());
            let load = &mut loads[k][piece];
            *load = [load[0] + force, load[1] + couple + (place - pieces[piece].weight.center).cross(force)];
        };
        for c in contacts {
            let (force, couple) = ((c.normal * c.press + c.drag) * (1.0 / h), c.roll * (1.0 / h));
            put(c.pair[0], c.arms[0], -force, -couple);
            put(c.pair[1], c.arms[1], force, couple);
        }
        for Blow { pair, arms, impulse } in blows {
            put(pair[0], arms[0], *impulse * (-1.0 / h), Vector::default());
            put(pair[1], arms[1], *impulse * (1.0 / h), Vector::default());
        }
        for joint in joints {
            for (end, sign) in [-1.0, 1.0].into_iter().enumerate().filter(|(end, _)| joint.pair[*end] != WORLD) {
                let row = joint.pair[end];
                let arm = bodies.rows[row as usize].q.turn(joint.at[end]);
                put(row, arm, joint.load[0] * sign, joint.load[1] * sign);
            }
        }
        let fails = |(cracked, loads): (&Cracked, Vec<Six>)| cracked.failing(&bodies.rows, loads);
        let failing = self.all.iter().zip(loads).map_in_parallel(fails);
        let mut fallen = Vec::new();
        for (cracked, bonds) in self.all.iter_mut().zip(failing).filter(|(_, bonds)| !bonds.is_empty()) {
            fallen.extend(cracked.split(&bonds, bodies));
        }
        fallen
    }
}

impl Cracked {
    /// Bonds whose tension exceeds the strength under loads on pieces, none if there are none.
    fn failing(&self, bodies: &[Body], mut loads: Vec<Six>) -> Vec<usize> {
        loads.resize(self.len(), Six::default());
        let mut failing = Vec::new();
        for lead in self.leads() {
            let body = &bodies[self.first + lead];
            let members = self.members(lead);
            let idle = body.w == Vector::default() && members.iter().all(|k| loads[*k] == Six::default());
            if members.len() < 2 || body.inverse_mass == 0.0 || idle {
                continue;
            }
            let bonds = self.pattern.bonds.iter().enumerate();
            let bonds: Vec<usize> = bonds.filter(|(i, bond)| !self.broken[*i] && self.lead[bond.pair[0]] == lead).map(|(i, _)| i).collect();
            let cluster = Cluster {
                pattern: &self.pattern,
                loads: members.iter().map(|k| loads[*k]).collect(),
                members,
                spin: self.turn(bodies, lead).conj().turn(body.w),
                bonds,
            };
            let tensions = cluster.tensions();
            failing.extend(cluster.bonds.into_iter().zip(tensions).filter(|(_, t)| *t > self.pattern.strength).map(|(i, _)| i));
        }
        failing
    }
}
