//! Sums over points and frames of a system.

use super::core::Core;
use crate::elements::enclosed;
use crate::geometry::Walls;
use crate::math::parallel::{fold, sum};
use crate::math::simd::{Kernel, Width, dispatch};
use crate::math::{Quat, Real, Row, Vec3, xyz64};
use crate::state::Object;
use std::ops::Range;

/// Sums over points, taken in one pass.
#[derive(Default)]
pub struct Sums {
    pub mass: f64,
    pub first_moment: Vec3<f64>,
    pub momentum: Vec3<f64>,
    pub angular: Vec3<f64>,
    pub kinetic: f64,
    pub speed_sq: f64,
}

/// Points summed side by side.
const LANES: usize = 8;

/// The sums over some points. Eight of each go side by side, whatever the width of the registers.
struct Summation<'a> {
    mass: &'a [Real],
    x: &'a [Row],
    v: &'a [Row],
}

impl Kernel for Summation<'_> {
    type Output = Sums;
    #[inline(always)]
    fn run<W: Width>(self, _: W) -> Sums {
        let mut lanes = [[0.0_f64; LANES]; 12];
        for ((mass, x), v) in self.mass.chunks(LANES).zip(self.x.chunks(LANES)).zip(self.v.chunks(LANES)) {
            let mut rows = [[0.0_f64; LANES]; 7];
            for j in 0..mass.len() {
                rows[0][j] = f64::from(mass[j]);
                for c in 0..3 {
                    rows[1 + c][j] = f64::from(x[j][c]);
                    rows[4 + c][j] = f64::from(v[j][c]);
                }
            }
            let [m, x, y, z, u, v, w] = rows;
            for j in 0..LANES {
                let (px, py, pz) = (m[j] * u[j], m[j] * v[j], m[j] * w[j]);
                let speed_sq = u[j] * u[j] + v[j] * v[j] + w[j] * w[j];
                lanes[0][j] += m[j];
                lanes[1][j] += m[j] * x[j];
                lanes[2][j] += m[j] * y[j];
                lanes[3][j] += m[j] * z[j];
                lanes[4][j] += px;
                lanes[5][j] += py;
                lanes[6][j] += pz;
                lanes[7][j] += y[j] * pz - z[j] * py;
                lanes[8][j] += z[j] * px - x[j] * pz;
                lanes[9][j] += x[j] * py - y[j] * px;
                lanes[10][j] += 0.5 * m[j] * speed_sq;
                lanes[11][j] = if speed_sq > lanes[11][j] { speed_sq } else { lanes[11][j] };
            }
        }
        let mut sums = Sums::default();
        for j in 0..LANES {
            sums.mass += lanes[0][j];
            sums.first_moment = sums.first_moment + Vec3 { x: lanes[1][j], y: lanes[2][j], z: lanes[3][j] };
            sums.momentum = sums.momentum + Vec3 { x: lanes[4][j], y: lanes[5][j], z: lanes[6][j] };
            sums.angular = sums.angular + Vec3 { x: lanes[7][j], y: lanes[8][j], z: lanes[9][j] };
            sums.kinetic += lanes[10][j];
            sums.speed_sq = sums.speed_sq.max(lanes[11][j]);
        }
        sums
    }
}

impl Sums {
    fn add(&mut self, other: &Self) {
        self.mass += other.mass;
        self.first_moment = self.first_moment + other.first_moment;
        self.momentum = self.momentum + other.momentum;
        self.angular = self.angular + other.angular;
        self.kinetic += other.kinetic;
        self.speed_sq = self.speed_sq.max(other.speed_sq);
    }
}

impl Core {
    /// Energy of the elastic batches, or of the others [J].
    pub fn energy_between(&self, elastic: bool, t: f64) -> f64 {
        let x = &self.state.x;
        let constraints = if elastic { &self.constraints[..] } else { &[] };
        let walls = Walls { colliders: &self.laws.colliders, t };
        let forces = self.laws.batches.iter().filter(|b| b.is_elastic() == elastic).map(|b| b.energy_at(t, x));
        forces.chain(constraints.iter().map(|c| c.energy(x, walls))).sum()
    }

    /// Sums over some points and frames.
    pub fn sums(&self, points: impl Iterator<Item = Range<usize>>, frames: impl Iterator<Item = usize>) -> Sums {
        let mut total = Sums::default();
        for rows in points {
            let (x, v, mass) = (&self.state.x[rows.clone()], &self.state.v[rows.clone()], &self.laws.masses.mass[rows.clone()]);
            for part in fold(rows.len(), |range| dispatch(Summation { mass: &mass[range.clone()], x: &x[range.clone()], v: &v[range] })) {
                total.add(&part);
            }
        }
        for i in frames {
            let (inertia, turning) = (f64::from(self.laws.masses.mass[i]), xyz64(self.state.v[i]));
            total.angular = total.angular + Quat::from_row(self.state.x[i].map(f64::from)).turn(turning * inertia);
            total.kinetic += 0.5 * inertia * turning.norm_sq();
        }
        total
    }

    /// Sums over all points and frames.
    pub fn total(&self) -> Sums {
        let masses = &self.laws.masses;
        self.sums(masses.points(), masses.frames.start..masses.frames.end)
    }

    /// How deep a point is in each collider that it touches at time t [s]; frames are in none. No solid moves held points, such as the
    /// roots of hair.
    pub fn depths(&self, i: usize, t: f64) -> impl Iterator<Item = f64> {
        let (x, masses) = (&self.state.x, &self.laws.masses);
        let colliders = if masses.mass[i] > 0.0 && x[i][3] > 0.0 && !masses.frames.contains(i) { &self.laws.colliders[..] } else { &[] };
        let p = xyz64(x[i]);
        colliders.iter().filter_map(move |c| c.touch(p, t)).map(|t| t.depth)
    }

    /// Volume inside the triangles of an object [m³].
    pub fn volume_in(&self, object: &Object) -> f64 {
        enclosed(&object.triangles, |i| xyz64(self.state.x[object.points.start + i as usize]))
    }

    /// Energy [J] that a thing at rest may seem to hold: a thousand times the energy of its links from rounded positions.
    pub fn noise(&self) -> f64 {
        let (x, grip) = (&self.state.x, &self.laws.grip);
        let rounding = |i: usize| f64::from(Real::EPSILON) * xyz64(x[i]).norm();
        1e3 * sum(grip.len(), |range| range.map(|i| f64::from(grip[i]) * rounding(i) * rounding(i)).sum())
    }
}
