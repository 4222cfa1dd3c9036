//! The mannequin: bones, how a pose turns them, and what it does. In metres, for a height of 1.7 m; it looks along -y, its left is
//! +x, its soles are at z = 0. A limb that hangs down has the axes of the world.

mod body;
mod poses;

pub use body::{Body, body};
pub use poses::Moves;

use super::Vector;
use super::motion::Pose;
use crate::math::Quat;
use crate::math::rotation::from_degrees;
use poses::{Stance, part};

/// Height for which all is measured [m].
pub const HEIGHT: f64 = 1.7;

/// Bones of the body, then those of the left side and of the right one.
pub const BONES: [&str; 21] = [
    "hips",
    "spine",
    "chest",
    "neck",
    "head",
    "shoulder_l",
    "upper_arm_l",
    "forearm_l",
    "hand_l",
    "thigh_l",
    "shin_l",
    "foot_l",
    "toes_l",
    "shoulder_r",
    "upper_arm_r",
    "forearm_r",
    "hand_r",
    "thigh_r",
    "shin_r",
    "foot_r",
    "toes_r",
];

/// Bones of the middle.
const MIDDLE: usize = 5;
/// Bones of a side.
const SIDE: usize = 8;
/// The bone that carries each of the middle and of the left side.
const PARENTS: [usize; MIDDLE + SIDE] = [0, 0, 1, 2, 3, 2, 5, 6, 7, 0, 9, 10, 11];

/// Joints in the axes of their parents [m]: spine to toes, middle and left side.
const JOINTS: [[f64; 3]; MIDDLE + SIDE] = [
    [0.0, 0.0, 0.0],
    [0.0, 0.0, 0.115],
    [0.0, -0.004, 0.14],
    [0.0, 0.016, 0.235],
    [0.0, -0.014, 0.085],
    [0.025, 0.012, 0.175],
    [0.140, 0.006, -0.004],
    [0.0, 0.0, -0.275],
    [0.0, 0.0, -0.24],
    [0.092, 0.0, -0.03],
    [0.0, 0.0, -THIGH],
    [0.0, 0.0, -SHIN],
    [0.0, -BALL, -0.055],
];

/// Lengths of thigh and shin, of the ankle above the sole, and from there forward to the ball of the foot [m].
const THIGH: f64 = 0.42;
const SHIN: f64 = 0.40;
const ANKLE: f64 = 0.08;
const BALL: f64 = 0.115;

/// The knee stays bent: a leg does not reach farther than this part of its length, and from this part on only approaches that.
const STRETCH: f64 = 0.9985;
const EASY: f64 = 0.985;

/// The bone that carries a bone; that of the hips is itself.
pub fn parent(bone: usize) -> usize {
    if bone < MIDDLE + SIDE {
        return PARENTS[bone];
    }
    match PARENTS[bone - SIDE] {
        middle if middle < MIDDLE => middle,
        left => left + SIDE,
    }
}

/// A movement of the mannequin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dance {
    /// Its motion.
    pub moves: Moves,
    /// Whether a walk goes forward.
    pub travel: bool,
}

impl Dance {
    /// Places of the bones after a time tau [s] of the movement, with this share of it in the pose.
    pub fn joints(&self, share: f64, tau: f64) -> Vec<Pose> {
        let stance = Stance::bind().mixed(&Stance::of(self.moves, tau), share);
        let (yaw, center, gone) = poses::course(self.moves, self.travel, tau);
        let mut joints = stand(&stance);
        let whole = from_degrees([0.0, 0.0, yaw]);
        for joint in &mut joints {
            joint.shift = center + whole.turn(joint.shift - center) + gone;
            joint.turn = whole * joint.turn;
        }
        joints
    }

    /// Time after which all comes again [s], and how far it has gone then [m].
    pub fn period(&self) -> Option<(f64, Vector)> {
        let period = self.moves.period()?;
        let (_, _, gone) = poses::course(self.moves, self.travel, period);
        Some((period, gone))
    }
}

/// Places of the bones in a stance: the trunk and the arms follow turns, the legs reach for the feet.
fn stand(stance: &Stance) -> Vec<Pose> {
    let mut all = vec![Pose::default(); BONES.len()];
    all[0] = Pose { turn: from_degrees(stance.0[part::PELVIS]), shift: stance.0[part::HIPS].into() };
    for (bone, which) in [(1, part::SPINE), (2, part::CHEST), (3, part::NECK), (4, part::HEAD)] {
        all[bone] = below(&all[PARENTS[bone]], JOINTS[bone], stance.0[which]);
    }
    for side in 0..2 {
        let mirror = if side == 0 { 1.0 } else { -1.0 };
        let of = |which: usize| stance.0[part::SIDES[side] + which];
        let joint = |bone: usize| [JOINTS[bone][0] * mirror, JOINTS[bone][1], JOINTS[bone][2]];
        let at = |bone: usize| bone + side * SIDE;
        for (bone, which) in [(5, part::SHOULDER), (6, part::UPPER), (7, part::FOREARM), (8, part::HAND)] {
            let carrier = all[parent(at(bone))];
            all[at(bone)] = below(&carrier, joint(bone), of(which));
        }
        let [pitch, _, out] = of(part::SOLE);
        let foot = from_degrees([0.0, 0.0, out]) * from_degrees([pitch, 0.0, 0.0]);
        let ankle = Vector::from(of(part::BALL)) + foot.turn([0.0, BALL, ANKLE].into());
        let hip = all[0].out(joint(9).into());
        let ahead = all[0].turn.turn([0.0, -1.0, 0.0].into()) + from_degrees([0.0, 0.0, out]).turn([0.0, -1.0, 0.0].into());
        let (thigh, shin, ankle) = leg(hip, ankle, ahead);
        all[at(9)] = thigh;
        all[at(10)] = shin;
        all[at(11)] = Pose { turn: foot, shift: ankle };
        // Toes stay flat while the heel is up.
        all[at(12)] = below(&all[at(11)], joint(12), [-pitch.max(0.0), 0.0, 0.0]);
    }
    all
}

fn below(parent: &Pose, joint: [f64; 3], degrees: [f64; 3]) -> Pose {
    Pose { turn: parent.turn * from_degrees(degrees), shift: parent.out(joint.into()) }
}

/// Thigh, shin and ankle of a leg that reaches from the hip to an ankle, its knee bent towards `ahead`. By the cosine theorem
///
///   cos a = (L1² + d² - L2²)/(2 L1 d)                                                       (character.5)
///
/// is the angle at the hip between the thigh and the way to the ankle, which is d long.
fn leg(hip: Vector, ankle: Vector, ahead: Vector) -> (Pose, Pose, Vector) {
    let way = ankle - hip;
    let (length, e) = (way.norm(), way.normalized());
    let (easy, most) = (EASY * (THIGH + SHIN), STRETCH * (THIGH + SHIN));
    // An ankle out of reach falls short, without a kink.
    let room = most - easy;
    let d = if length <= easy { length } else { easy + room * (1.0 - crate::math::functions::exp(-(length - easy) / room)) };
    let d = d.max(0.2 * THIGH);
    let cos = ((THIGH * THIGH + d * d - SHIN * SHIN) / (2.0 * THIGH * d)).clamp(-1.0, 1.0);
    let sin = (1.0 - cos * cos).sqrt();
    let k = (ahead - e * ahead.dot(e)).normalized();
    let knee = hip + e * (THIGH * cos) + k * (THIGH * sin);
    let ankle = hip + e * d;
    let x = k.cross(e);
    let frame = |from: Vector, to: Vector| {
        let z = (from - to).normalized();
        Pose { turn: from_axes(x, z.cross(x), z), shift: from }
    };
    (frame(hip, knee), frame(knee, ankle), ankle)
}

/// The turn that takes the axes of the world to these.
fn from_axes(x: Vector, y: Vector, z: Vector) -> Quat<f64> {
    let (w, a, b, c) = (1.0 + x.x + y.y + z.z, 1.0 + x.x - y.y - z.z, 1.0 - x.x + y.y - z.z, 1.0 - x.x - y.y + z.z);
    let v = |x: f64, y: f64, z: f64| Vector { x, y, z };
    // The largest of the four numbers first.
    let q = if w >= a && w >= b && w >= c {
        Quat { v: v(y.z - z.y, z.x - x.z, x.y - y.x), w }
    } else if a >= b && a >= c {
        Quat { v: v(a, x.y + y.x, x.z + z.x), w: y.z - z.y }
    } else if b >= c {
        Quat { v: v(x.y + y.x, b, y.z + z.y), w: z.x - x.z }
    } else {
        Quat { v: v(x.z + z.x, y.z + z.y, c), w: x.y - y.x }
    };
    q.normalized()
}

/// Places of the bones in the pose in which the skin is bound.
pub fn bind() -> Vec<Pose> {
    stand(&Stance::bind())
}
