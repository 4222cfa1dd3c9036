//! The points of a grid around a particle, and their trilinear weights.

use super::particles::Gradient;
use crate::math::Real;
use crate::state::{Field, Grid, Place, Vectors};

/// The points of a place, for places in cells.
#[derive(Debug, Clone, Copy)]
pub struct Points {
    /// The first one [cells].
    pub shift: [Real; 3],
    top: [Real; 3],
    last: [usize; 3],
    /// How many are around a particle on each axis.
    pub count: [usize; 3],
}

/// The lower points around a particle, and how far beyond them it is [1]; beyond the outermost points it counts as on them.
#[derive(Debug, Clone, Copy)]
pub struct Around {
    /// Indices of the lower point.
    pub base: [usize; 3],
    /// Weights of the upper points.
    pub part: [Real; 3],
    /// 1 along axes on which it is among the points, 0 where it is beyond them.
    among: [Real; 3],
}

impl Points {
    /// Those of a place on a grid.
    pub fn new(grid: &Grid, place: Place) -> Self {
        let (offset, points) = (grid.offset(place), grid.points(place));
        Self {
            shift: offset.map(|s| s as Real),
            top: points.map(|n| (n - 1) as Real),
            last: points.map(|n| n.saturating_sub(2)),
            count: points.map(|n| n.min(2)),
        }
    }

    /// The points around x [cells].
    #[inline(always)]
    pub fn around(&self, x: &[Real; 3]) -> Around {
        let mut around = Around { base: [0; 3], part: [0.0; 3], among: [1.0; 3] };
        for a in 0..3 {
            let free = x[a] - self.shift[a];
            let s = free.max(0.0).min(self.top[a]);
            around.base[a] = (s as usize).min(self.last[a]);
            around.part[a] = s - around.base[a] as Real;
            around.among[a] = if s == free && self.top[a] > 0.0 { 1.0 } else { 0.0 };
        }
        around
    }
}

/// Reads a vector field anywhere.
pub struct Sampler<'a> {
    parts: Vec<(usize, Points, &'a [Real])>,
    origin: usize,
    stride: [usize; 3],
    step: [usize; 3],
}

impl<'a> Sampler<'a> {
    /// Of components on faces.
    pub fn new(u: &'a Vectors) -> Self {
        Self::of(u.parts.iter())
    }

    /// Of a single field.
    pub fn one(field: &'a Field) -> Self {
        Self::of(std::iter::once(field))
    }

    fn of(fields: impl Iterator<Item = &'a Field>) -> Self {
        let fields: Vec<&Field> = fields.collect();
        let axis = |place: Place| if let Place::Face(axis) = place { axis } else { 0 };
        let parts: Vec<_> = fields.iter().map(|f| (axis(f.place), Points::new(&f.grid, f.place), &f.data[..])).collect();
        let mut sampler = Self { parts, origin: 0, stride: [0; 3], step: [0; 3] };
        if let Some(field) = fields.first() {
            let lattice = field.grid.lattice();
            sampler.origin = lattice.at(0, 0, 0);
            sampler.stride = lattice.stride;
            // A single point along an axis is read twice.
            let many = |a: usize| fields.iter().any(|f| f.points()[a] > 1);
            sampler.step = std::array::from_fn(|a| if many(a) { lattice.stride[a] } else { 0 });
        }
        sampler
    }

    #[inline(always)]
    fn corners(&self, data: &[Real], around: &Around) -> [Real; 8] {
        let [i, j, k] = around.base;
        let at = self.origin + i + self.stride[1] * j + self.stride[2] * k;
        let [x, y, z] = self.step;
        let data = &data[at..at + x + y + z + 1];
        [data[0], data[x], data[y], data[x + y], data[z], data[z + x], data[z + y], data[z + y + x]]
    }

    /// The components at x [cells].
    #[inline(always)]
    pub fn read(&self, x: &[Real; 3]) -> [Real; 3] {
        let mut value = [0.0; 3];
        for (axis, points, data) in &self.parts {
            let around = points.around(x);
            let c = self.corners(data, &around);
            let [s, t, r] = around.part;
            let mix = |a: Real, b: Real, w: Real| a + w * (b - a);
            value[*axis] = mix(mix(mix(c[0], c[1], s), mix(c[2], c[3], s), t), mix(mix(c[4], c[5], s), mix(c[6], c[7], s), t), r);
        }
        value
    }

    /// The components at x [cells], and how much each grows over a cell along each axis.                               (pic.3)
    #[inline(always)]
    pub fn with_gradient(&self, x: &[Real; 3]) -> ([Real; 3], Gradient) {
        let (mut value, mut gradient) = ([0.0; 3], Gradient::default());
        for (axis, points, data) in &self.parts {
            let around = points.around(x);
            let c = self.corners(data, &around);
            let [s, t, r] = around.part;
            let mix = |a: Real, b: Real, w: Real| a + w * (b - a);
            let (low, high) = ([c[0], c[2], c[4], c[6]], [c[1], c[3], c[5], c[7]]);
            let along: [Real; 4] = std::array::from_fn(|e| mix(low[e], high[e], s));
            let slope = [0, 1, 2, 3].map(|e| high[e] - low[e]);
            let (near, far) = (mix(along[0], along[1], t), mix(along[2], along[3], t));
            value[*axis] = mix(near, far, r);
            gradient[*axis] = [
                around.among[0] * mix(mix(slope[0], slope[1], t), mix(slope[2], slope[3], t), r),
                around.among[1] * mix(along[1] - along[0], along[3] - along[2], r),
                around.among[2] * (far - near),
            ];
        }
        (value, gradient)
    }
}
