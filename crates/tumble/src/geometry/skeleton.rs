//! Figures that bones move: the places of joints at a time, and the skin that they carry.
//!
//!   x(t) = sum_b w_b M_b(t) p,   M_b = P G_b(t) B_b                                     (character.1)
//!
//! p vertex as it was bound [m], w_b its weights, B_b the inverse of the bone's place then, G_b(t) its place now, P where the
//! figure stands. All are functions of time alone. Source: [gltf2021], 3.7.3.3. Breaks: a joint bent or twisted by much more than 90°
//! loses volume there.

use super::affine::Affine;
use super::motion::{Pose, Twist};
use super::{Facets, Vector, mannequin};
use crate::math::Quat;
use crate::math::functions::{acos, floor, sin};
use tumble_interface::character::{Between, Clip, Influence, Joint, Part, Track, Transform};

/// When a movement begins, and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    /// When it begins [s].
    pub start: f64,
    /// Time of the way from the pose of dressing into the movement [s].
    pub settle: f64,
    /// Factor on its pace.
    pub pace: f64,
}

impl Clock {
    /// Share of the movement in the pose, 0 to 1, and how far the movement has come [s]. With u = (t - start)/settle:
    ///
    ///   s = u³ (10 - 15 u + 6 u²),   tau = pace ∫ s dt                                        (character.2)
    pub fn at(&self, t: f64) -> (f64, f64) {
        let since = (t - self.start).max(0.0);
        if since >= self.settle {
            return (1.0, self.pace * (since - 0.5 * self.settle));
        }
        let u = since / self.settle;
        (u * u * u * (10.0 - 15.0 * u + 6.0 * u * u), self.pace * self.settle * u * u * u * u * (2.5 - 3.0 * u + u * u))
    }
}

/// Motion of a figure.
#[derive(Debug, Clone)]
pub enum Act {
    /// A clip from a file, again and again if it has a period [s].
    Clip {
        /// The joints at rest.
        joints: Vec<Joint>,
        /// The clip that moves them.
        clip: Clip,
        /// Time until it starts again.
        period: Option<f64>,
    },
    /// A movement of the mannequin.
    Mannequin(mannequin::Dance),
}

/// A figure with bones and skin. Everything about it is a function of time.
#[derive(Debug, Clone)]
pub struct Rig {
    /// Names of the bones.
    pub names: Vec<String>,
    /// Vertices as they were bound [m].
    pub vertices: Vec<Vector>,
    /// Their triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Bones of each vertex.
    pub skin: Vec<[Influence; 4]>,
    /// Bones of the binds, and the inverses of their places then.
    pub binds: Vec<(u32, Affine)>,
    /// Its motion.
    pub act: Act,
    /// When.
    pub clock: Clock,
    /// Factor on its size.
    pub scale: f64,
    /// Its placement.
    pub place: Pose,
}

/// Half the time over which velocities of bones are taken [s].
const MOMENT: f64 = 1e-5;

impl Rig {
    /// The bone of a name.
    pub fn bone(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| n == name)
    }

    /// Places of all bones at time t, with and without their scale, before the figure is put where it stands.
    fn joints(&self, t: f64) -> Vec<(Pose, Affine)> {
        let (share, mut tau) = self.clock.at(t);
        match &self.act {
            Act::Mannequin(dance) => dance.joints(share, tau).into_iter().map(|pose| (pose, Affine::rigid(&pose))).collect(),
            Act::Clip { joints, clip, period } => {
                if let Some(period) = period.filter(|p| *p > 0.0) {
                    tau -= period * floor(tau / period);
                }
                clip_joints(joints, clip, share, tau)
            }
        }
    }

    fn placed(&self, pose: &Pose) -> Pose {
        Pose { turn: self.place.turn * pose.turn, shift: self.place.out(pose.shift * self.scale) }
    }

    /// Pose of a bone at time t: its joint and axes, without scale.
    pub fn pose(&self, bone: usize, t: f64) -> Option<Pose> {
        self.joints(t).get(bone).map(|(pose, _)| self.placed(pose))
    }

    /// The same, and how it moves: the mean over 20 microseconds.
    pub fn moving(&self, bone: usize, t: f64) -> Option<(Pose, Twist)> {
        let (before, now, after) = (self.pose(bone, t - MOMENT)?, self.pose(bone, t)?, self.pose(bone, t + MOMENT)?);
        let turn = after.turn * before.turn.conj();
        // The rotation vector of a small turn, to its third power.
        let v = if turn.w < 0.0 { -turn.v } else { turn.v };
        let angular = v * ((1.0 + v.norm_sq() / 6.0) / MOMENT);
        let velocity = (after.shift - before.shift) * (0.5 / MOMENT);
        Some((now, Twist { linear: velocity - angular.cross(now.shift), angular }))
    }

    /// The skin at time t [m].                                                                (character.1)
    pub fn skin_at(&self, t: f64) -> Vec<Vector> {
        let joints = self.joints(t);
        let size = self.scale;
        let place = Affine::of(Vector { x: size, y: size, z: size }, &self.place);
        let maps: Vec<Affine> = self
            .binds
            .iter()
            .map(|(joint, inverse)| joints.get(*joint as usize).map_or(Affine::ZERO, |(_, map)| place.after(&map.after(inverse))))
            .collect();
        let carried = |(p, skin): (&Vector, &[Influence; 4])| {
            let mut map = Affine::ZERO;
            for part in skin.iter().filter(|part| part.weight > 0.0) {
                if let Some(m) = maps.get(part.bind as usize) {
                    map.add(m, part.weight);
                }
            }
            map.apply(*p)
        };
        self.vertices.iter().zip(&self.skin).map(carried).collect()
    }

    /// Time after which the movement comes again [s], and how far it has gone then [m]; `None` if it never does.
    pub fn period(&self) -> Option<(f64, Vector)> {
        let (period, gone) = match &self.act {
            Act::Clip { period, .. } => ((*period)?, Vector::default()),
            Act::Mannequin(dance) => dance.period()?,
        };
        (period > 0.0).then(|| (period / self.clock.pace, self.place.turn.turn(gone * self.scale)))
    }

    /// How long its keyframes are for a movement until `end` [s].
    pub fn needed(&self, end: f64) -> f64 {
        let moved = self.clock.start + self.clock.settle;
        self.period().map_or(end, |(period, _)| end.min(moved + period))
    }

    /// Keyframes of the skin until `end` [s], `rate` [1/s] of them or a few more, linear between them. Where the movement comes
    /// again, one period stands for all.                                                      (character.3)
    pub fn facets(&self, rate: f64, end: f64) -> Option<Facets> {
        let Clock { start, settle, .. } = self.clock;
        let moved = start + settle;
        let mut times = vec![start];
        let mut add = |until: f64| {
            let from = times[times.len() - 1];
            let n = ((until - from) * rate - 1e-9).ceil().max(0.0);
            times.extend((1..=n as usize).map(|k| if k as f64 == n { until } else { from + (until - from) * (k as f64 / n) }));
        };
        add(moved.min(end.max(start)));
        let period = self.period().filter(|(period, _)| moved + period < end);
        let back = period.map(|(period, gone)| {
            add(moved + period);
            (moved, gone)
        });
        if back.is_none() {
            let still = match &self.act {
                Act::Clip { clip, period: None, .. } => moved + (clip.duration() - 0.5 * settle).max(0.0),
                _ => f64::INFINITY,
            };
            add(end.min(still).max(moved.min(end)));
        }
        let mut frames: Vec<Vec<Vector>> = times.iter().map(|t| self.skin_at(*t)).collect();
        // A clip may end elsewhere than it begins: the way back takes one frame.
        if let Some((from, gone)) = back
            && let Some(first) = times.iter().position(|t| *t == from)
            && let Some(last) = frames.len().checked_sub(1)
        {
            frames[last] = frames[first].iter().map(|x| *x + gone).collect();
        }
        Facets::of(self.triangles.clone(), frames, times, back)
    }
}

/// Places of joints: each by its own numbers in its parent.
fn clip_joints(joints: &[Joint], clip: &Clip, share: f64, tau: f64) -> Vec<(Pose, Affine)> {
    let mut own: Vec<Transform> = joints.iter().map(|j| j.rest).collect();
    for track in &clip.tracks {
        let (Some(to), Some(value)) = (own.get_mut(track.joint as usize), sample(track, tau)) else { continue };
        let mix = |a: f64, b: f64| a + (b - a) * share;
        match track.part {
            Part::Translation => to.translation = std::array::from_fn(|k| mix(to.translation[k], value[k])),
            Part::Scale => to.scale = std::array::from_fn(|k| mix(to.scale[k], value[k])),
            Part::Rotation => to.rotation = if share == 1.0 { unit(value) } else { slerp(unit(to.rotation), unit(value), share) },
        }
    }
    let mut all: Vec<(Pose, Affine)> = Vec::with_capacity(joints.len());
    for (joint, own) in joints.iter().zip(own) {
        let local = Pose { turn: Quat::from_row(unit(own.rotation)), shift: own.translation.into() };
        let map = Affine::of(own.scale.into(), &local);
        all.push(match joint.parent.and_then(|p| all.get(p as usize)) {
            Some((pose, parent)) => {
                let map = parent.after(&map);
                (Pose { turn: pose.turn * local.turn, shift: map.t }, map)
            }
            None => (local, map),
        });
    }
    all
}

fn unit(q: [f64; 4]) -> [f64; 4] {
    let n = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    if n > 0.0 { q.map(|x| x / n) } else { [0.0, 0.0, 0.0, 1.0] }
}

/// From a to b along the shorter way on the sphere of turns.
fn slerp(a: [f64; 4], b: [f64; 4], s: f64) -> [f64; 4] {
    let dot: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
    let (b, dot) = if dot < 0.0 { (b.map(|x| -x), -dot) } else { (b, dot) };
    let angle = acos(dot.min(1.0));
    // Nearly the same: the chord.
    let (p, q) = if angle < 1e-6 { (1.0 - s, s) } else { (sin((1.0 - s) * angle) / sin(angle), sin(s * angle) / sin(angle)) };
    unit(std::array::from_fn(|k| p * a[k] + q * b[k]))
}

/// The value of a track at time t; a cubic one between keys at a distance of d, with the part s of the way:
///
///   p = (2s³ - 3s² + 1) p0 + d (s³ - 2s² + s) m0 + (3s² - 2s³) p1 + d (s³ - s²) m1             (character.4)
///
/// p values, m rates. Source: [gltf2021], appendix C.
pub fn sample(track: &Track, t: f64) -> Option<[f64; 4]> {
    let cubic = track.between == Between::Cubic;
    let value = |k: usize| track.values.get(if cubic { 3 * k + 1 } else { k }).copied();
    let next = track.times.partition_point(|x| *x <= t);
    if next == 0 {
        return value(0);
    }
    if next >= track.times.len() {
        return value(track.times.len().checked_sub(1)?);
    }
    let (a, b) = (value(next - 1)?, value(next)?);
    let d = track.times[next] - track.times[next - 1];
    let s = (t - track.times[next - 1]) / d;
    Some(match track.between {
        Between::Step => a,
        Between::Linear if track.part == Part::Rotation => slerp(unit(a), unit(b), s),
        Between::Linear => std::array::from_fn(|k| a[k] + (b[k] - a[k]) * s),
        Between::Cubic => {
            let (m0, m1) = (track.values.get(3 * next - 1)?, track.values.get(3 * next)?);
            let (s2, s3) = (s * s, s * s * s);
            std::array::from_fn(|k| {
                (2.0 * s3 - 3.0 * s2 + 1.0) * a[k] + d * (s3 - 2.0 * s2 + s) * m0[k] + (3.0 * s2 - 2.0 * s3) * b[k] + d * (s3 - s2) * m1[k]
            })
        }
    })
}
