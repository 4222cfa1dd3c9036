//! The velocity of a fluid on a grid as a velocity field: between points and between two times linear, beyond the box that at its side.

use crate::math::Vec3;
use crate::operators::ghosted;
use crate::state::{Field, Place, Vectors};
use std::sync::Arc;

/// Velocities of a fluid at some times [s], in order; before the first and after the last they are those.          (gas.14)
#[derive(Debug, Clone, Default)]
pub struct OnGrid {
    /// Name of the fluid.
    pub fluid: String,
    /// Time and velocities on faces [m/s].
    pub states: Vec<(f64, Arc<Vectors>)>,
}

/// The value of a field at a place.
fn value(f: &Field, x: [f64; 3]) -> f64 {
    let (grid, offset) = (f.grid, f.grid.offset(f.place));
    let (mut base, mut part) = ([0_isize; 3], [0.0; 3]);
    for a in grid.axes() {
        let (n, cells) = (grid.n[a] as f64, (x[a] - grid.origin[a]) / grid.dx);
        let inside = if grid.periodic[a] && cells.is_finite() { cells.rem_euclid(n) } else { cells.max(0.0).min(n) };
        let low = (inside - offset[a]).floor();
        (base[a], part[a]) = (low as isize, inside - offset[a] - low);
    }
    let mut sum = 0.0;
    for corner in 0..8 {
        let (mut weight, mut at) = (1.0, base);
        for a in 0..3 {
            let up = corner >> a & 1;
            weight *= if up == 1 { part[a] } else { 1.0 - part[a] };
            at[a] += up;
        }
        if weight != 0.0 {
            sum += weight * f64::from(ghosted(f, at));
        }
    }
    sum
}

impl OnGrid {
    /// u(x, t) [m/s].
    pub fn at(&self, t: f64, x: Vec3<f64>) -> Vec3<f64> {
        let one = |u: &Vectors| {
            let mut v = [0.0; 3];
            for part in &u.parts {
                if let Place::Face(axis) = part.place {
                    v[axis] = value(part, x.into());
                }
            }
            Vec3::from(v)
        };
        let after = self.states.partition_point(|(time, _)| *time <= t);
        match (after.checked_sub(1).and_then(|i| self.states.get(i)), self.states.get(after)) {
            (Some((t0, a)), Some((t1, b))) => {
                let s = (t - t0) / (t1 - t0);
                if s > 0.0 { one(a) * (1.0 - s) + one(b) * s } else { one(a) }
            }
            (Some((_, u)), None) | (None, Some((_, u))) => one(u),
            (None, None) => Vec3::from([0.0; 3]),
        }
    }

    /// A length over which it changes little [m].
    pub fn small(&self) -> f64 {
        self.states.first().and_then(|(_, u)| u.parts.first()).map_or(1.0, |part| 1e-3 * part.grid.dx)
    }
}
