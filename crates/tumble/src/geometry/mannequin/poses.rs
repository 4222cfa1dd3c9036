//! Motions of the mannequin, as smooth functions of time: rotations of trunk and arms, paths of hips and feet.

use crate::geometry::Vector;
use crate::math::functions::{cos, floor, sin};

/// Its motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moves {
    /// The pose of dressing.
    Bind,
    /// At ease.
    Stand,
    /// Steps forward.
    Walk,
    /// Turns about the vertical.
    Twirl,
    /// Steps, sways and a twirl.
    Dance,
}

/// Breath [s].
const BREATH: f64 = 4.0;
/// Two steps of the walk [s], and their length [m].
const PACE: f64 = 1.1;
const STRIDE: f64 = 1.1;
/// Part of the pace in which a foot is on the floor.
const GROUNDED: f64 = 0.6;
/// A turn of the twirl [s].
const TURN: f64 = 1.6;
/// The dance [s].
const DANCE: f64 = 8.0;
/// Middle of the twirl in the dance [m].
const SPOT: f64 = -0.26;

impl Moves {
    /// Time after which it comes again [s].
    pub fn period(self) -> Option<f64> {
        match self {
            Self::Bind => None,
            Self::Stand => Some(BREATH),
            Self::Walk => Some(PACE),
            Self::Twirl => Some(TURN),
            Self::Dance => Some(DANCE),
        }
    }
}

/// Which numbers of a stance stand for what.
pub mod part {
    /// Position of the hips [m].
    pub const HIPS: usize = 0;
    /// Turns about x, then y, then z [degrees].
    pub const PELVIS: usize = 1;
    pub const SPINE: usize = 2;
    pub const CHEST: usize = 3;
    pub const NECK: usize = 4;
    pub const HEAD: usize = 5;
    /// First number of each side.
    pub const SIDES: [usize; 2] = [6, 12];
    /// Floor under the ball of the foot [m].
    pub const BALL: usize = 0;
    /// Pitch of the foot (heel up), nothing, turn outward to the left [degrees].
    pub const SOLE: usize = 1;
    pub const SHOULDER: usize = 2;
    pub const UPPER: usize = 3;
    pub const FOREARM: usize = 4;
    pub const HAND: usize = 5;
}
use part::*;

/// All numbers of a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stance(pub [[f64; 3]; 18]);

/// A phase as a wave, with `phase` in periods.
fn wave(phase: f64) -> f64 {
    sin(std::f64::consts::TAU * phase)
}

fn cowave(phase: f64) -> f64 {
    cos(std::f64::consts::TAU * phase)
}

/// From 0 before a to 1 after b.
fn ramp(t: f64, a: f64, b: f64) -> f64 {
    let u = ((t - a) / (b - a)).clamp(0.0, 1.0);
    u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
}

/// Up to 1 between a and b, and down again.
fn bump(t: f64, a: f64, b: f64) -> f64 {
    let u = ((t - a) / (b - a)).clamp(0.0, 1.0);
    let w = 4.0 * u * (1.0 - u);
    w * w * w
}

/// The whole figure turns about the vertical by an angle [degrees] about a point, and moves [m].
pub fn course(moves: Moves, travel: bool, tau: f64) -> (f64, Vector, Vector) {
    let mut center = Vector::default();
    let mut gone = Vector::default();
    let yaw = match moves {
        Moves::Twirl => 360.0 * tau / TURN,
        Moves::Dance => {
            center.x = SPOT;
            360.0 * ramp(tau - DANCE * floor(tau / DANCE), 4.9, 6.7)
        }
        Moves::Walk => {
            if travel {
                gone.y = -STRIDE / PACE * tau;
            }
            0.0
        }
        _ => 0.0,
    };
    (yaw, center, gone)
}

impl Stance {
    /// The pose in which it is dressed: feet a little apart, arms held out at 45 degrees.
    pub fn bind() -> Self {
        let mut s = Self([[0.0; 3]; 18]);
        s.0[HIPS] = [0.0, 0.0, 0.921];
        for side in 0..2 {
            s.foot(side, [0.112, -super::BALL + 0.004], 0.0, 0.0, 6.0);
            s.arm(side, [0.0, -45.0, 0.0], -8.0);
        }
        s
    }

    /// A foot of a side: where its ball is (x outward), height, pitch, turn outward.
    fn foot(&mut self, side: usize, [x, y]: [f64; 2], z: f64, pitch: f64, out: f64) {
        let m = if side == 0 { 1.0 } else { -1.0 };
        self.0[SIDES[side] + BALL] = [x * m, y, z];
        self.0[SIDES[side] + SOLE] = [pitch, 0.0, out * m];
    }

    /// An arm: turns of the upper arm as on the left (forward is -x, outward -y), bend of the elbow (forward is negative).
    fn arm(&mut self, side: usize, [x, y, z]: [f64; 3], elbow: f64) {
        let m = if side == 0 { 1.0 } else { -1.0 };
        self.0[SIDES[side] + UPPER] = [x, y * m, z * m];
        self.0[SIDES[side] + FOREARM] = [elbow, 0.0, 0.0];
    }

    /// From this to another, with a share of that.
    pub fn mixed(&self, other: &Self, share: f64) -> Self {
        let mut s = *self;
        for (a, b) in s.0.as_flattened_mut().iter_mut().zip(other.0.as_flattened()) {
            *a += (b - *a) * share;
        }
        s
    }

    /// The pose after a time tau [s] of a movement.
    pub fn of(moves: Moves, tau: f64) -> Self {
        match moves {
            Moves::Bind => Self::bind(),
            Moves::Stand => Self::at_ease(tau / BREATH),
            Moves::Walk => Self::walk(tau / PACE),
            Moves::Twirl => Self::twirl(tau / TURN),
            Moves::Dance => Self::dance(tau - DANCE * floor(tau / DANCE)),
        }
    }

    fn at_ease(phase: f64) -> Self {
        let mut s = Self::bind();
        let (breath, sway) = (wave(phase), cowave(phase) - 1.0);
        s.0[HIPS] = [0.006 * sway, 0.0, 0.920];
        s.0[PELVIS] = [0.0, 0.6 * sway, 0.0];
        s.0[SPINE] = [0.0, -0.6 * sway, 0.0];
        s.0[CHEST] = [0.7 * breath, 0.0, 0.0];
        s.0[HEAD] = [-0.5 * breath, 0.0, 2.0 * wave(phase)];
        for side in 0..2 {
            s.arm(side, [0.0, -17.0 - 0.7 * breath, 0.0], -16.0);
        }
        s
    }

    fn walk(phase: f64) -> Self {
        let mut s = Self::bind();
        // The left foot comes down at phase 0, when the trunk is lowest.
        let swing = cowave(phase);
        s.0[HIPS] = [0.018 * wave(phase + 0.02), 0.0, 0.893 - 0.012 * cowave(2.0 * phase)];
        s.0[PELVIS] = [-2.0, 2.5 * wave(phase + 0.05), -6.0 * swing];
        s.0[SPINE] = [1.0, -2.0 * wave(phase + 0.05), 4.0 * swing];
        s.0[CHEST] = [1.0, -0.8 * wave(phase), 6.5 * swing];
        s.0[NECK] = [0.0, 0.0, -2.5 * swing];
        s.0[HEAD] = [0.0, 0.0, -2.0 * swing];
        for side in 0..2 {
            let own = phase + 0.5 * side as f64;
            let p = own - floor(own);
            let (y, z, pitch) = step(p);
            s.foot(side, [0.075, y], z, pitch, 4.0);
            // The arm swings against the leg.
            let back = cowave(own - 0.02);
            s.arm(side, [-4.0 + 23.0 * back, -15.0, 0.0], -22.0 + 11.0 * back);
        }
        s
    }

    fn twirl(phase: f64) -> Self {
        let mut s = Self::bind();
        let beat = wave(phase);
        s.0[HIPS] = [0.0, 0.0, 0.938 + 0.006 * cowave(2.0 * phase)];
        s.0[PELVIS] = [0.0, 1.5 * beat, 0.0];
        s.0[SPINE] = [-2.0, -1.5 * beat, 4.0];
        s.0[CHEST] = [-3.0, 0.0, 5.0];
        s.0[HEAD] = [2.0, 0.0, 10.0];
        for side in 0..2 {
            let m = if side == 0 { 1.0 } else { -1.0 };
            s.foot(side, [0.06, -0.06 - 0.03 * m], 0.0, 24.0, 8.0);
            s.arm(side, [-12.0, -66.0 - 5.0 * beat * m, 0.0], -22.0);
            s.0[SIDES[side] + SHOULDER] = [0.0, -8.0 * m, 0.0];
        }
        s
    }

    fn dance(t: f64) -> Self {
        /// Foot (0 left), from and until [s], way [m].
        const STEPS: [(usize, f64, f64, [f64; 2]); 12] = [
            (1, 0.0, 0.5, [-0.26, 0.0]),
            (0, 0.5, 1.0, [-0.26, 0.0]),
            (0, 1.0, 1.5, [0.26, 0.0]),
            (1, 1.5, 2.0, [0.26, 0.0]),
            (0, 2.0, 2.5, [0.0, -0.20]),
            (1, 2.5, 3.0, [0.0, -0.20]),
            (0, 3.0, 3.5, [0.0, 0.20]),
            (1, 3.5, 4.0, [0.0, 0.20]),
            (1, 4.0, 4.45, [-0.26, 0.0]),
            (0, 4.45, 4.9, [-0.26, 0.0]),
            (0, 6.9, 7.4, [0.26, 0.0]),
            (1, 7.4, 7.9, [0.26, 0.0]),
        ];
        let mut s = Self::bind();
        // Terms that start before the dance, or end after it.
        let around = |a: f64, b: f64| bump(t - DANCE, a, b) + bump(t, a, b) + bump(t + DANCE, a, b);
        let spin = bump(t, 4.6, 7.0);
        let mut balls = [[0.09, -super::BALL], [-0.09, -super::BALL]];
        let (mut up, mut pitch) = ([0.0; 2], [26.0 * spin; 2]);
        let mut sway = 0.0;
        for (foot, a, b, way) in STEPS {
            let u = ramp(t, a, b);
            for k in 0..2 {
                balls[foot][k] += way[k] * u;
            }
            up[foot] += 0.045 * bump(t, a, b);
            pitch[foot] += 16.0 * around(a - 0.1, b - 0.05);
            // The weight is on the other foot.
            sway += around(a - 0.12, b + 0.12) * if foot == 0 { -1.0 } else { 1.0 };
        }
        // Feet close and one before the other while turning.
        for (foot, m) in [(0, 1.0), (1, -1.0)] {
            balls[foot][0] -= 0.03 * m * spin;
            balls[foot][1] -= 0.03 * m * spin - 0.05 * spin;
        }
        let beat = 1.0 - cowave(2.0 * t);
        let calm = 1.0 - spin;
        let middle = [0, 1].map(|k| 0.5 * (balls[0][k] + balls[1][k]));
        s.0[HIPS] = [middle[0] + 0.035 * sway, middle[1] + super::BALL - 0.004 - 0.05 * spin, 0.903 - 0.009 * beat * calm + 0.034 * spin];
        s.0[PELVIS] = [0.0, -6.5 * sway, 6.0 * wave(0.5 * t) * calm];
        s.0[SPINE] = [0.0, 5.0 * sway, -3.0 * wave(0.5 * t) * calm];
        s.0[CHEST] = [-2.0 * spin, 4.0 * sway, -6.0 * wave(0.5 * t) * calm];
        s.0[NECK] = [0.0, -1.5 * sway, 0.0];
        s.0[HEAD] = [2.0 * spin, -2.5 * sway, 5.0 * wave(0.5 * t - 0.1) * calm + 8.0 * spin];
        for foot in 0..2 {
            let m = if foot == 0 { 1.0 } else { -1.0 };
            s.0[SIDES[foot] + BALL] = [balls[foot][0], balls[foot][1], up[foot]];
            s.0[SIDES[foot] + SOLE] = [pitch[foot], 0.0, 8.0 * m];
            let (own, slow) = (wave(t + 0.25 * m), wave(0.25 * t));
            let lift = -34.0 - 10.0 * slow * m - 30.0 * spin;
            s.arm(foot, [-8.0 + 14.0 * own * calm, lift, 0.0], -34.0 - 14.0 * own * calm + 10.0 * spin);
            s.0[SIDES[foot] + SHOULDER] = [0.0, -6.0 * spin * m, 0.0];
            s.0[SIDES[foot] + HAND] = [-8.0 * own * calm, 0.0, 0.0];
        }
        s
    }
}

/// A foot in a walk on the spot, its part of the pace p: place of the ball along y, height [m], pitch [degrees].
fn step(p: f64) -> (f64, f64, f64) {
    // On the floor it goes back as fast as the floor does; in the air a cubic with the same speed at both ends.
    const FRONT: f64 = -0.345;
    let back = FRONT + STRIDE * GROUNDED;
    let y = if p < GROUNDED {
        FRONT + STRIDE * p
    } else {
        let (d, s) = (1.0 - GROUNDED, (p - GROUNDED) / (1.0 - GROUNDED));
        let (s2, s3) = (s * s, s * s * s);
        back + (FRONT - back) * (3.0 * s2 - 2.0 * s3) + STRIDE * d * (2.0 * s3 - 3.0 * s2 + s)
    };
    // The heel rises before the foot leaves the floor, the toes before it comes down.
    let heel = 42.0 * ramp(p, 0.36, 0.62) * (1.0 - ramp(p, 0.64, 0.86));
    let toes = 15.0 * (ramp(p, 0.80, 0.99) + 1.0 - ramp(p, 0.0, 0.11));
    // A foot on its heel has its ball this much higher.
    let length = super::BALL + 0.045;
    let z = 0.035 * bump(p, 0.60, 0.98) + length * sin(toes.to_radians());
    (y, z, heel - toes)
}
