//! Affine maps: the places of bones and the skin that they carry.

use super::Vector;
use super::motion::Pose;

/// x -> m x + t, m by rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine {
    m: [Vector; 3],
    pub(super) t: Vector,
}

impl Affine {
    /// From rows of m with t behind.
    pub fn from_rows(rows: [[f64; 4]; 3]) -> Self {
        Self { m: rows.map(|[x, y, z, _]| Vector { x, y, z }), t: Vector::from(rows.map(|r| r[3])) }
    }

    /// Scaled, turned, moved.
    pub(super) fn of(scale: Vector, pose: &Pose) -> Self {
        let unit = |x: f64, y: f64, z: f64| pose.turn.turn(Vector { x, y, z });
        let (a, b, c) = (unit(scale.x, 0.0, 0.0), unit(0.0, scale.y, 0.0), unit(0.0, 0.0, scale.z));
        Self { m: [Vector { x: a.x, y: b.x, z: c.x }, Vector { x: a.y, y: b.y, z: c.y }, Vector { x: a.z, y: b.z, z: c.z }], t: pose.shift }
    }

    /// A rigid one.
    pub fn rigid(pose: &Pose) -> Self {
        Self::of(Vector { x: 1.0, y: 1.0, z: 1.0 }, pose)
    }

    /// The image of a point.
    pub fn apply(&self, p: Vector) -> Vector {
        Vector { x: self.m[0].dot(p), y: self.m[1].dot(p), z: self.m[2].dot(p) } + self.t
    }

    /// `inner` first, then `self`.
    pub(super) fn after(&self, inner: &Self) -> Self {
        let row = |r: Vector| inner.m[0] * r.x + inner.m[1] * r.y + inner.m[2] * r.z;
        Self { m: self.m.map(row), t: self.apply(inner.t) }
    }

    /// Adds w times another: a step of a weighted mean.
    pub(super) fn add(&mut self, other: &Self, w: f64) {
        for (a, b) in self.m.iter_mut().zip(other.m) {
            *a = *a + b * w;
        }
        self.t = self.t + other.t * w;
    }

    /// Maps everything to the origin.
    pub(super) const ZERO: Self = Self { m: [Vector { x: 0.0, y: 0.0, z: 0.0 }; 3], t: Vector { x: 0.0, y: 0.0, z: 0.0 } };
}
