//! When two features that move straight come as near as a thickness.
//!
//!   t ← t + (1 - s) (d - xi)/l,   until d - xi < s (d_0 - xi)                           (contact.18)
//!
//! d is the distance at t, l a bound on how fast it can shrink. Never later than the true time, and slow only where features pass
//! each other closely. Source: [li2021], algorithm 1.

use super::distance::{edge_edge, point_triangle};
use crate::geometry::Vector;

/// The part of the distance to the thickness that is left at the time found.
const LEFT: f64 = 0.1;
/// Steps at most: features that pass each other at the thickness itself need ever shorter ones.
const STEPS: u32 = 4096;

/// The time in 0..1 at which a point and a triangle come as near as `thickness` [m], or a little earlier: with their distance at
/// least the thickness, and a tenth of what they began with above it. 0 if they begin nearer. `None` if they stay apart. The point
/// first, then the corners; `from` and `to` [m] at 0 and 1.
pub fn point_triangle_impact(from: [Vector; 4], to: [Vector; 4], thickness: f64) -> Option<f64> {
    impact::<1>(from, to, thickness, |[p, a, b, c]| point_triangle(p, [a, b, c]).distance_sq)
}

/// The same for two edges.
pub fn edge_edge_impact(from: [Vector; 4], to: [Vector; 4], thickness: f64) -> Option<f64> {
    impact::<2>(from, to, thickness, |[a, b, c, d]| edge_edge([a, b], [c, d]).distance_sq)
}

/// FIRST vertices are those of the first feature.
fn impact<const FIRST: usize>(from: [Vector; 4], to: [Vector; 4], thickness: f64, distance_sq: impl Fn([Vector; 4]) -> f64) -> Option<f64> {
    let mut way = [0, 1, 2, 3].map(|i| to[i] - from[i]);
    // Common motion does not bring them nearer.
    let mean = (way[0] + way[1] + way[2] + way[3]) * 0.25;
    way = way.map(|w| w - mean);
    let longest = |ways: &[Vector]| ways.iter().map(|w| w.norm()).fold(0.0, f64::max);
    let speed = longest(&way[..FIRST]) + longest(&way[FIRST..]);
    // (d² - xi²)/(d + xi), exact where both are close.
    let above = |d_sq: f64| (d_sq - thickness * thickness) / (d_sq.sqrt() + thickness);
    let first = distance_sq(from);
    if first <= thickness * thickness {
        return Some(0.0);
    }
    let mut gap = above(first);
    if gap.is_nan() || speed.is_nan() {
        return None;
    }
    let (enough, mut t) = (LEFT * gap, 0.0);
    for _ in 0..STEPS {
        let next = t + (1.0 - LEFT) * gap / speed;
        if next >= 1.0 {
            return None;
        }
        gap = above(distance_sq([0, 1, 2, 3].map(|i| from[i] + way[i] * next)));
        // The first step leaves as much, but for rounding.
        if t > 0.0 && gap < enough {
            return Some(t);
        }
        t = next;
    }
    Some(t)
}
