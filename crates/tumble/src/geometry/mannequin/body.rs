//! The surface of the mannequin: round cones about its bones, joined smoothly, meshed once in the pose of dressing; and its skin.
//!
//!   smin(a, b) = min(a, b) - h² k/4,   h = max(k - |a - b|, 0)/k                              (character.6)
//!
//! joins two distances over a width k [m]. Source: [quilez2013].

use super::{BONES, HEIGHT, MIDDLE, SIDE, bind, parent};
use crate::geometry::Affine;
use crate::geometry::motion::Pose;
use crate::geometry::{Vector, nets};
use std::sync::OnceLock;
use tumble_interface::Mesh;
use tumble_interface::character::Influence;

/// Edge of the cells in which it is meshed [m].
const CELL: f64 = 0.024;

/// The mannequin as it is dressed, for a height of 1.7 m.
#[derive(Debug)]
pub struct Body {
    /// Its surface, closed.
    pub mesh: Mesh,
    /// Bones of each vertex; binds are bones.
    pub skin: Vec<[Influence; 4]>,
    /// Bones, and what takes vertices into them.
    pub binds: Vec<(u32, Affine)>,
}

/// A cone with round ends in the axes of a bone, pressed flat along x and y.
struct Flesh {
    bone: usize,
    from: [f64; 3],
    to: [f64; 3],
    radii: [f64; 2],
    flat: [f64; 2],
}

const fn flesh(bone: usize, from: [f64; 3], to: [f64; 3], radii: [f64; 2], flat: [f64; 2]) -> Flesh {
    Flesh { bone, from, to, radii, flat }
}

/// Connected parts and the blend width [m]. For paired parts, the left one.
const TRUNK: [Flesh; 9] = [
    flesh(0, [0.0, 0.008, -0.02], [0.0, 0.006, 0.06], [0.130, 0.118], [1.0, 0.80]),
    flesh(0, [0.058, 0.01, -0.02], [0.068, 0.012, -0.085], [0.090, 0.086], [1.0, 1.0]),
    flesh(0, [0.062, 0.05, -0.055], [0.062, 0.05, -0.075], [0.072, 0.070], [1.0, 1.0]),
    flesh(1, [0.0, 0.0, -0.05], [0.0, -0.004, 0.07], [0.112, 0.100], [1.0, 0.76]),
    flesh(1, [0.0, -0.004, 0.06], [0.0, -0.002, 0.15], [0.099, 0.118], [1.0, 0.78]),
    flesh(2, [0.0, 0.0, 0.0], [0.0, 0.012, 0.11], [0.119, 0.120], [1.0, 0.78]),
    flesh(2, [0.0, 0.012, 0.10], [0.085, 0.016, 0.125], [0.088, 0.066], [1.0, 0.92]),
    flesh(2, [0.060, -0.052, 0.045], [0.060, -0.058, 0.035], [0.050, 0.052], [1.0, 1.0]),
    flesh(2, [0.0, 0.03, 0.14], [0.10, 0.018, 0.158], [0.052, 0.038], [1.0, 0.9]),
];
const HEAD: [Flesh; 4] = [
    flesh(3, [0.0, 0.002, -0.05], [0.0, -0.012, 0.09], [0.056, 0.048], [1.0, 1.0]),
    flesh(4, [0.0, 0.004, 0.105], [0.0, -0.016, 0.098], [0.094, 0.088], [0.80, 1.0]),
    flesh(4, [0.0, -0.040, 0.075], [0.0, -0.066, 0.016], [0.060, 0.032], [0.86, 1.0]),
    flesh(4, [0.0, -0.094, 0.078], [0.0, -0.104, 0.058], [0.010, 0.012], [1.0, 1.0]),
];
const ARM: [Flesh; 8] = [
    flesh(5, [0.06, 0.006, -0.004], [0.138, 0.006, -0.008], [0.048, 0.050], [1.0, 0.95]),
    flesh(6, [0.0, 0.0, -0.005], [0.0, 0.0, -0.275], [0.049, 0.035], [1.0, 1.0]),
    flesh(6, [0.0, -0.006, -0.10], [0.0, -0.006, -0.17], [0.042, 0.040], [1.0, 1.0]),
    flesh(7, [0.0, 0.0, 0.0], [0.0, 0.0, -0.235], [0.034, 0.0235], [1.0, 1.0]),
    flesh(7, [0.004, 0.0, -0.035], [0.004, 0.0, -0.10], [0.037, 0.034], [1.0, 1.0]),
    flesh(8, [0.0, -0.002, -0.01], [0.0, -0.004, -0.085], [0.026, 0.041], [0.52, 1.0]),
    flesh(8, [0.0, -0.004, -0.08], [-0.006, -0.004, -0.165], [0.038, 0.022], [0.50, 1.0]),
    flesh(8, [-0.002, -0.022, -0.03], [-0.006, -0.050, -0.085], [0.019, 0.016], [1.0, 1.0]),
];
const LEG: [Flesh; 8] = [
    flesh(9, [-0.006, 0.006, -0.02], [0.0, 0.0, -0.42], [0.080, 0.050], [1.0, 1.0]),
    flesh(9, [0.0, -0.012, -0.14], [0.0, -0.008, -0.26], [0.070, 0.060], [1.0, 1.0]),
    flesh(10, [0.0, 0.0, 0.0], [0.0, 0.002, -0.38], [0.049, 0.031], [1.0, 1.0]),
    flesh(10, [0.0, 0.016, -0.07], [0.0, 0.018, -0.17], [0.046, 0.044], [1.0, 1.0]),
    flesh(11, [0.0, 0.004, 0.01], [0.0, 0.018, -0.044], [0.034, 0.036], [1.0, 1.0]),
    flesh(11, [0.0, 0.0, -0.02], [0.0, -0.10, -0.054], [0.036, 0.029], [1.0, 1.0]),
    flesh(11, [0.004, -0.06, -0.055], [0.004, -0.115, -0.058], [0.034, 0.037], [1.08, 1.0]),
    flesh(12, [0.004, 0.0, -0.001], [-0.002, -0.058, -0.008], [0.037, 0.026], [1.1, 1.0]),
];
/// Widths of joints [m]: in the trunk, between trunk and head, arm and leg, in the limbs, and between legs.
const JOIN: [f64; 5] = [0.055, 0.050, 0.045, 0.022, 0.012];
/// The sole below the ankle [m].
const SOLE: f64 = super::ANKLE;

fn smin(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - 0.25 * h * h * k
}

impl Flesh {
    /// Distance of a point in the axes of the bone; less beside what is pressed flat. `mirror` is -1 on the right.
    fn distance(&self, p: Vector, mirror: f64) -> f64 {
        let press = |[x, y, z]: [f64; 3]| Vector { x: x / self.flat[0], y: y / self.flat[1], z };
        let p = press([p.x * mirror, p.y, p.z]);
        let (a, b) = (press(self.from), press(self.to));
        let (way, l) = (b - a, (b - a).norm());
        let y = (p - a).dot(way) / l;
        let x = ((p - a).norm_sq() - y * y).max(0.0).sqrt();
        // The side of the cone leans by asin(s) against its axis.
        let [r, q] = self.radii;
        let s = (r - q) / l;
        let c = (1.0 - s * s).max(0.0).sqrt();
        let along = c * y - s * x;
        let d = if along < 0.0 {
            (x * x + y * y).sqrt() - r
        } else if along > c * l {
            (x * x + (y - l) * (y - l)).sqrt() - q
        } else {
            c * x + s * y - r
        };
        d * self.flat[0].min(self.flat[1]).min(1.0)
    }
}

/// Distances in the pose of dressing.
struct Figure {
    bones: Vec<Pose>,
}

impl Figure {
    /// Distance to flesh of the left (0) or right (1) side.
    fn one(&self, flesh: &Flesh, p: Vector, side: usize) -> f64 {
        let bone = if flesh.bone < MIDDLE { flesh.bone } else { flesh.bone + side * SIDE };
        flesh.distance(self.bones[bone].back(p), if side == 0 { 1.0 } else { -1.0 })
    }

    fn both(&self, flesh: &Flesh, p: Vector) -> f64 {
        if flesh.from[0] == 0.0 && flesh.to[0] == 0.0 {
            return self.one(flesh, p, 0);
        }
        smin(self.one(flesh, p, 0), self.one(flesh, p, 1), JOIN[4])
    }

    fn limb(&self, all: &[Flesh], p: Vector, side: usize) -> f64 {
        all.iter().map(|f| self.one(f, p, side)).reduce(|a, b| smin(a, b, JOIN[3])).unwrap_or(f64::INFINITY)
    }

    /// The leg stands on its sole.
    fn leg(&self, p: Vector, side: usize) -> f64 {
        let foot = self.bones[11 + side * SIDE].back(p);
        -smin(-self.limb(&LEG, p, side), foot.z + SOLE, 0.008)
    }

    fn distance(&self, p: Vector) -> f64 {
        let join = |all: &[Flesh], k: f64| all.iter().map(|f| self.both(f, p)).reduce(|a, b| smin(a, b, k)).unwrap_or(f64::INFINITY);
        let trunk = smin(join(&TRUNK, JOIN[0]), join(&HEAD, 0.03), JOIN[1]);
        let arms = self.limb(&ARM, p, 0).min(self.limb(&ARM, p, 1));
        let legs = smin(self.leg(p, 0), self.leg(p, 1), JOIN[4]);
        smin(smin(trunk, arms, JOIN[2]), legs, JOIN[2])
    }

    /// Distance to the flesh of each bone.
    fn to_bones(&self, p: Vector) -> [f64; BONES.len()] {
        let mut d = [f64::INFINITY; BONES.len()];
        for f in TRUNK.iter().chain(&HEAD).chain(&ARM).chain(&LEG) {
            for side in 0..2 {
                let bone = if f.bone < MIDDLE { f.bone } else { f.bone + side * SIDE };
                d[bone] = d[bone].min(self.one(f, p, side));
            }
        }
        d
    }
}

/// The share of a bone in a vertex falls to zero where it is this much farther than the nearest one [m].
const REACH: f64 = 0.055;
/// Rounds in which neighbours share.
const SHARING: usize = 4;

fn skin(figure: &Figure, mesh: &Mesh) -> Vec<[Influence; 4]> {
    let n = BONES.len();
    let kin = |a: usize, b: usize| a == b || parent(a) == b || parent(b) == a;
    let own = |v: &[f64; 3]| {
        let d = figure.to_bones(Vector::from(*v));
        let nearest = (0..n).fold(0, |best, b| if d[b] < d[best] { b } else { best });
        let mut w = [0.0; BONES.len()];
        for b in (0..n).filter(|b| kin(*b, nearest)) {
            let share = (1.0 - (d[b] - d[nearest]) / REACH).max(0.0);
            w[b] = share * share;
        }
        let sum: f64 = w.iter().sum();
        w.map(|x| x / sum)
    };
    let mut weights: Vec<[f64; BONES.len()]> = mesh.vertices.iter().map(own).collect();
    let mut near = vec![Vec::new(); mesh.vertices.len()];
    for ([a, b], _) in mesh.edges() {
        near[a as usize].push(b as usize);
        near[b as usize].push(a as usize);
    }
    for _ in 0..SHARING {
        let old = weights.clone();
        for (i, w) in weights.iter_mut().enumerate().filter(|(i, _)| !near[*i].is_empty()) {
            let share = 0.5 / near[i].len() as f64;
            *w = std::array::from_fn(|b| 0.5 * old[i][b] + near[i].iter().map(|j| old[*j][b]).sum::<f64>() * share);
        }
    }
    let four = |w: &[f64; BONES.len()]| {
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| w[*b].total_cmp(&w[*a]).then(a.cmp(b)));
        let sum: f64 = order[..4].iter().map(|b| w[*b]).sum();
        std::array::from_fn(|k| Influence { bind: order[k] as u32, weight: w[order[k]] / sum })
    };
    weights.iter().map(four).collect()
}

/// The mannequin; made once.
pub fn body() -> &'static Body {
    static BODY: OnceLock<Body> = OnceLock::new();
    BODY.get_or_init(|| {
        let figure = Figure { bones: bind() };
        let reach = figure.bones.iter().fold(0.0_f64, |r, b| r.max(b.shift.x.abs())) + 0.25;
        let bounds = ([-reach, -0.3, -0.03].into(), [reach, 0.3, HEIGHT + 0.05].into());
        let mesh = nets::surface(&|p| figure.distance(p), bounds, CELL);
        let skin = skin(&figure, &mesh);
        let inverse = |pose: &Pose| {
            let turn = pose.turn.conj();
            Affine::rigid(&Pose { turn, shift: -turn.turn(pose.shift) })
        };
        let binds = figure.bones.iter().enumerate().map(|(i, pose)| (i as u32, inverse(pose))).collect();
        Body { mesh, skin, binds }
    })
}
