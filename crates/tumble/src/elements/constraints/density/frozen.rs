//! Rigid bodies in a liquid of particles: each is a piece of frozen liquid.
//!
//!   C_i = V sum_j W(|x_i - x_j|) + psi sum_b W(|x_i - x_b|) - 1,   psi = volume of the body over the count of its samples   (liquids.10)
//!
//! Samples x_b stand on a lattice of about the spacing of the liquid that fits the body, so that it displaces its volume as so much liquid would.
//! A sweep moves the body as it moves particles, by the multipliers of all that it touches at once.        (liquids.11)
//! Sources: samples of a boundary whose volumes take part in the density [akinci2012]; theirs cover the surface, those here fill what is below it.
//! Verified in `tests/afloat.rs`.

use super::spline;
use crate::geometry::{Shape, Vector};
use crate::math::{Quat, rotation};
use std::f64::consts::PI;
use std::sync::Arc;

/// Samples of a body along an axis at most.
const MOST: f64 = 256.0;

/// Samples of a body for a liquid of a spacing, in the axes of the body, by cells as wide as the kernel reaches.
#[derive(Debug)]
pub struct Samples {
    spacing: f64,
    /// psi over the volume of a particle.
    share: f64,
    points: Vec<Vector>,
    /// Of each cell, the first point of it; and the end.
    starts: Vec<usize>,
    low: Vector,
    cells: [usize; 3],
    /// Greatest distance from the centre at which they are felt [m].
    reach: f64,
}

/// Middle, half of the extents and their axes.
fn extents(shape: &Shape) -> Option<(Vector, [f64; 3], Quat<f64>)> {
    let upright = rotation::from_degrees([0.0; 3]);
    let between = |low: Vector, high: Vector| ((low + high) * 0.5, ((high - low) * 0.5).into(), upright);
    match shape {
        Shape::Sphere { center, radius } => Some((*center, [*radius; 3], upright)),
        Shape::Box { center, half, turn } => Some((*center, (*half).into(), *turn)),
        Shape::Capsule { from, to, radius } => {
            let [a, b]: [[f64; 3]; 2] = [(*from).into(), (*to).into()];
            let end = |pick: fn(f64, f64) -> f64, way: f64| Vector::from([0, 1, 2].map(|k: usize| pick(a[k], b[k]) + way));
            Some(between(end(f64::min, -radius), end(f64::max, *radius)))
        }
        _ => shape.bounds().map(|(low, high)| between(low, high)),
    }
}

impl Samples {
    /// Of a body with this surface about its centre of mass and this volume [m³]; none of what has no inside, or is too large to be sampled.
    pub fn new(shape: &Shape, volume: f64, spacing: f64) -> Option<Self> {
        let (center, half, turn) = extents(shape)?;
        let counts = half.map(|half| (2.0 * half / spacing).round().max(1.0));
        if counts.iter().any(|n| *n > MOST) {
            return None;
        }
        let n = counts.map(|n| n as usize);
        let place = |k: usize| {
            let at = [k % n[0], k / n[0] % n[1], k / (n[0] * n[1])];
            center + turn.turn(Vector::from([0, 1, 2].map(|a: usize| half[a] * ((2 * at[a] + 1) as f64 / counts[a] - 1.0))))
        };
        let (mut count, mut points) = (0, Vec::new());
        for p in (0..n[0] * n[1] * n[2]).map(place) {
            let (distance, ..) = shape.near(p, 0.0, f64::INFINITY);
            if distance < 0.0 {
                count += 1;
                // No particle feels what is deeper.
                points.extend((distance > -2.0 * spacing).then_some(p));
            }
        }
        if points.is_empty() {
            return None;
        }
        let corner = |pick: fn(f64, f64) -> f64| {
            let all = points.iter().map(|p| <[f64; 3]>::from(*p));
            all.reduce(|a, b| [0, 1, 2].map(|k: usize| pick(a[k], b[k]))).unwrap_or_default()
        };
        let (low, high) = (corner(f64::min), corner(f64::max));
        let width = 2.0 * spacing;
        let cells = [0, 1, 2].map(|k: usize| ((high[k] - low[k]) / width) as usize + 1);
        let reach = points.iter().map(|p| p.norm()).fold(0.0, f64::max) + width;
        let mut samples =
            Self { spacing, share: volume / (count as f64 * spacing.powi(3)), points, starts: Vec::new(), low: low.into(), cells, reach };
        samples.sort();
        Some(samples)
    }

    /// Puts points into the order of their cells.
    fn sort(&mut self) {
        let cell = |p: &Vector| {
            let [i, j, k] = self.cell(*p).map(|c| c as usize);
            i + self.cells[0] * (j + self.cells[1] * k)
        };
        let mut of: Vec<(usize, Vector)> = self.points.iter().map(|p| (cell(p), *p)).collect();
        of.sort_by_key(|(cell, _)| *cell);
        let cells: usize = self.cells.iter().product();
        self.starts = (0..=cells).map(|cell| of.partition_point(|(other, _)| *other < cell)).collect();
        self.points = of.into_iter().map(|(_, p)| p).collect();
    }

    fn cell(&self, p: Vector) -> [f64; 3] {
        let way: [f64; 3] = (p - self.low).into();
        way.map(|way| (way / (2.0 * self.spacing)).floor())
    }

    /// Their share of the density at a point, and the spacing times its gradient, if any of them is near; all in the axes of the body.
    fn near(&self, p: Vector) -> Option<(f64, Vector)> {
        let at = self.cell(p);
        let range = |axis: usize| {
            let (low, high) = ((at[axis] - 1.0).max(0.0), (at[axis] + 1.0).min((self.cells[axis] - 1) as f64));
            if low <= high { low as usize..high as usize + 1 } else { 0..0 }
        };
        let (mut part, mut slope) = (0.0, Vector::default());
        for k in range(2) {
            for j in range(1) {
                let (row, along) = (self.cells[0] * (j + self.cells[1] * k), range(0));
                if along.is_empty() {
                    continue;
                }
                for x in &self.points[self.starts[row + along.start]..self.starts[row + along.end]] {
                    let way = (*x - p) * (1.0 / self.spacing);
                    let q = way.norm();
                    let (w, fall) = spline(q);
                    part += w;
                    if q > 0.0 {
                        slope = slope + way * (fall / q);
                    }
                }
            }
        }
        let scale = self.share / PI;
        (part > 0.0).then(|| (part * scale, slope * scale))
    }
}

/// A rigid body in a liquid, where it will be at the end of the sub-step.
#[derive(Debug, Clone)]
pub struct Frozen {
    /// Its samples.
    pub samples: Arc<Samples>,
    /// Which body it is to whoever has put it in.
    pub owner: usize,
    /// Centre of mass [m].
    pub position: Vector,
    /// Turn from its axes to those of the world.
    pub orientation: Quat<f64>,
    /// 1/mass [1/kg].
    pub inverse_mass: f64,
    /// Inverse of the inertia about the centre of mass, in the axes of the world: xx, yy, zz, xy, yz, zx [1/(kg m²)].
    pub inverse_inertia: [f64; 6],
    /// What it has got in this sub-step: impulse [N s], its moment about the origin at the lever arms of the start, with which particles take it,
    /// and that about the centre [N m s].
    pub got: [Vector; 3],
}

impl Frozen {
    /// Its share of the density at a point, and the spacing times its gradient, if it is near.
    pub(super) fn near(&self, x: Vector) -> Option<(f64, Vector)> {
        let arm = x - self.position;
        if arm.norm_sq() > self.samples.reach * self.samples.reach {
            return None;
        }
        let (part, slope) = self.samples.near(self.orientation.conj().turn(arm))?;
        Some((part, self.orientation.turn(slope)))
    }

    fn turned(&self, l: Vector) -> Vector {
        let [xx, yy, zz, xy, yz, zx] = self.inverse_inertia;
        Vector { x: xx * l.x + xy * l.y + zx * l.z, y: xy * l.x + yy * l.y + yz * l.z, z: zx * l.x + yz * l.y + zz * l.z }
    }

    /// How far it yields to a push at a point along it, times the push.
    pub(super) fn yields(&self, x: Vector, push: Vector) -> f64 {
        let about = (x - self.position).cross(push);
        self.inverse_mass * push.norm_sq() + about.dot(self.turned(about))
    }

    /// Takes impulses [N s] at points, each with the place at which its sub-step began, and moves by what they change in h seconds.
    pub(super) fn take(&mut self, pushes: impl Iterator<Item = (Vector, Vector, Vector)>, h: f64) {
        let [mut impulse, mut moment, mut angular] = [Vector::default(); 3];
        for (x, before, push) in pushes {
            impulse = impulse + push;
            angular = angular + (x - self.position).cross(push);
            moment = moment + before.cross(push);
        }
        let [a, b, c] = self.got;
        self.got = [a + impulse, b + moment, c + angular];
        self.position = self.position + impulse * (self.inverse_mass * h);
        self.orientation = (rotation::by(self.turned(angular) * h) * self.orientation).normalized();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_push_off_the_centre_moves_and_turns_a_body_within_the_sub_step() {
        let box_ = Shape::Box { center: Vector::default(), half: [0.2, 0.1, 0.1].into(), turn: rotation::from_degrees([0.0; 3]) };
        let mut body = Frozen {
            samples: Arc::new(Samples::new(&box_, 0.016, 0.05).unwrap()),
            owner: 0,
            position: [1.0, 0.0, 0.0].into(),
            orientation: rotation::from_degrees([0.0; 3]),
            inverse_mass: 0.5,
            inverse_inertia: [2.0, 4.0, 5.0, 0.0, 0.0, 0.0],
            got: [Vector::default(); 3],
        };
        // r x p = (0.2, 0, 0) x (0, 0.03, 0) = (0, 0, 0.006), which turns it by 5 * 0.006 * h about z.
        let (x, before, push, h) = (Vector::from([1.2, 0.0, 0.0]), Vector::from([1.1, 0.0, 0.0]), Vector::from([0.0, 0.03, 0.0]), 0.1);
        body.take([(x, before, push)].into_iter(), h);
        let turned = body.orientation.turn([1.0, 0.0, 0.0].into());
        assert!((body.position - Vector::from([1.0, 0.0015, 0.0])).norm() < 1e-15, "{:?}", body.position);
        assert!((turned.y - 0.003).abs() < 1e-8 && turned.z.abs() < 1e-15, "{turned:?}");
        assert!((body.got[2].z - 0.006).abs() < 1e-15 && (body.got[1].z - 0.033).abs() < 1e-15, "{:?}", body.got);
    }
}
