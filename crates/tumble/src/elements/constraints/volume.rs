//! Volume inside a closed surface: one constraint on all its points.
//!
//!   V = sum over triangles of x0 . (x1 x x2)/6,   E = K/(2 V0) (V - V1)²                          (membranes.7)
//!
//! V0 [m³] is the volume of the mesh, V1 that at which nothing presses, K [Pa] the bulk modulus (infinite: V1 is kept).
//! Source: [mueller2007], section 4.4. Differs: stiffness is a compliance; no factor on the initial volume but V1/V0.
//! Verified in `tests/surfaces.rs`: an icosahedron between pressure and tension, and an exact volume.

use super::{Constraints, Projection};
use crate::geometry::Walls;
use crate::math::parallel::{CHUNK, Tasks, fold};
use crate::math::{Real, Row, Signal, Vec3, xyz64};

type Vector = Vec3<f64>;

/// A closed surface.
pub struct Volume {
    triangles: Vec<[u32; 3]>,
    /// Points, and where the list of triangles of each begins; one more for the end.
    points: Vec<u32>,
    start: Vec<u32>,
    /// For every point its triangles, as the two corners that follow it.
    around: Vec<[u32; 2]>,
    /// Volume of the mesh [m³], and that without pressure, relative to it.
    volume: f64,
    target: Signal,
    /// 1/k, k = K/V0 [Pa/m³].
    compliance: f64,
    lambda: f64,
    gradient: Vec<Vector>,
}

/// Volume inside closed triangles [m³], measured from one of their points.
pub fn enclosed(triangles: &[[u32; 3]], x: impl Fn(u32) -> Vector + Sync) -> f64 {
    let Some(origin) = triangles.first().map(|t| x(t[0])) else { return 0.0 };
    let of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| x(i) - origin);
        a.dot(b.cross(c)) / 6.0
    };
    fold(triangles.len(), |range| triangles[range].iter().map(of).sum::<f64>()).into_iter().sum()
}

impl Volume {
    /// Closed triangles over rows 0..rows that hold V1 = `volume` [m³] times `target` with the stiffness k = `stiffness` [Pa/m³], infinite to keep it;
    /// `None` if a corner is not a row.
    pub fn new(rows: usize, triangles: Vec<[u32; 3]>, volume: f64, target: Signal, stiffness: f64) -> Option<Self> {
        if triangles.iter().flatten().any(|i| *i as usize >= rows) {
            return None;
        }
        let mut corners: Vec<[u32; 3]> = triangles.iter().flat_map(|[a, b, c]| [[*a, *b, *c], [*b, *c, *a], [*c, *a, *b]]).collect();
        corners.sort_by_key(|c| c[0]);
        let (mut points, mut start) = (Vec::new(), Vec::new());
        for (k, corner) in corners.iter().enumerate() {
            if points.last() != Some(&corner[0]) {
                points.push(corner[0]);
                start.push(k as u32);
            }
        }
        start.push(corners.len() as u32);
        let around = corners.into_iter().map(|[_, b, c]| [b, c]).collect();
        Some(Self { triangles, points, start, around, volume, target, compliance: 1.0 / stiffness, lambda: 0.0, gradient: Vec::new() })
    }

    /// dV/dx of the point in place k.
    fn slope(&self, x: &[Row], k: usize) -> Vector {
        let here = xyz64(x[self.points[k] as usize]);
        let part = |[b, c]: &[u32; 2]| (xyz64(x[*b as usize]) - here).cross(xyz64(x[*c as usize]) - here) * (1.0 / 6.0);
        self.around[self.start[k] as usize..self.start[k + 1] as usize].iter().map(part).fold(Vector::default(), |s, g| s + g)
    }

    fn over(&self, x: &[Row], t: f64) -> f64 {
        enclosed(&self.triangles, |i| xyz64(x[i as usize])) - self.volume * self.target.value(t)
    }
}

impl Constraints for Volume {
    fn name(&self) -> &'static str {
        "volume"
    }

    fn len(&self) -> usize {
        1
    }

    fn connect(&self, join: &mut dyn FnMut(u32, u32)) {
        self.points.iter().skip(1).for_each(|i| join(self.points[0], *i));
    }

    fn energy(&self, x: &[Row], walls: Walls<'_>) -> f64 {
        if self.compliance == 0.0 {
            return 0.0;
        }
        let over = self.over(x, walls.t);
        0.5 * over * over / self.compliance
    }

    fn project(&mut self, x: &mut [Row], step: &Projection<'_>) {
        if step.iteration == 0 {
            self.lambda = 0.0;
        }
        let over = self.over(x, step.walls.t);
        let mut gradient = std::mem::take(&mut self.gradient);
        gradient.resize(self.points.len(), Vector::default());
        let (this, rows) = (&*self, &*x);
        gradient.chunks_mut(CHUNK).enumerate().in_parallel(|(chunk, out)| {
            out.iter_mut().enumerate().for_each(|(k, g)| *g = this.slope(rows, chunk * CHUNK + k));
        });
        let weigh = |k: usize| f64::from(rows[this.points[k] as usize][3]) * gradient[k].norm_sq();
        let weight: f64 = fold(gradient.len(), |range| range.map(weigh).sum::<f64>()).into_iter().sum();
        let alpha = if step.plain.is_some() { 0.0 } else { self.compliance / (step.h * step.h) };
        if weight + alpha > 0.0 {
            let mut delta = -(over + alpha * self.lambda) / (weight + alpha);
            delta *= step.plain.map_or(1.0, f64::from);
            self.lambda += if step.plain.is_some() { 0.0 } else { delta };
            for (point, g) in self.points.iter().zip(&gradient) {
                let row = &mut x[*point as usize];
                let way = *g * (f64::from(row[3]) * delta);
                *row = [row[0] + way.x as Real, row[1] + way.y as Real, row[2] + way.z as Real, row[3]];
            }
        }
        self.gradient = gradient;
    }

    fn add_grip(&self, x: &[Row], grip: &mut [Real]) {
        if self.compliance > 0.0 {
            for (k, point) in self.points.iter().enumerate() {
                grip[*point as usize] += (self.slope(x, k).norm_sq() / self.compliance) as Real;
            }
        }
    }
}
