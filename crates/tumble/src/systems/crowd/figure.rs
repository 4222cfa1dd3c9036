//! The figure of a person in pictures: a body of revolution of the height of people, on its feet at the origin.

use super::bodies::STATURE;
use crate::math::Real;
use crate::math::functions::{cos, sin};

/// Height and radius of its rings [m], from the feet to above the neck, for a body of radius `WIDTH`.
const RINGS: [[f64; 2]; 9] =
    [[0.0, 0.1], [0.08, 0.12], [0.75, 0.13], [0.95, 0.15], [1.25, 0.16], [1.4, 0.18], [1.46, 0.14], [1.5, 0.06], [1.53, 0.06]];
const WIDTH: f64 = 0.18;
/// Radius of its head [m], rings of that, and corners of a ring.
const HEAD: f64 = 0.115;
const TOP: usize = 5;
const CORNERS: usize = 12;

/// Height of the axis of one that lies [m].
pub const LYING: f64 = 0.16;

/// Corners and triangles of the figure of a person of this radius [m].
pub fn figure(radius: f64) -> (Vec<Real>, Vec<u32>) {
    let turn = |k: usize| std::f64::consts::PI * (0.17 + 0.83 * k as f64 / TOP as f64);
    let head = (1..TOP).map(|k| [STATURE - HEAD - HEAD * cos(turn(k)), HEAD * sin(turn(k))]);
    let rings: Vec<[f64; 2]> = RINGS.into_iter().map(|[z, r]| [z, r * radius / WIDTH]).chain(head).collect();
    let mut corners: Vec<Real> = Vec::new();
    for [z, r] in &rings {
        for k in 0..CORNERS {
            let angle = std::f64::consts::TAU * k as f64 / CORNERS as f64;
            corners.extend([r * cos(angle), r * sin(angle), *z].map(|x| x as Real));
        }
    }
    corners.extend([0.0, 0.0, 0.0, 0.0, 0.0, STATURE as Real]);
    let (last, ends) = ((rings.len() - 1) * CORNERS, [(rings.len() * CORNERS) as u32, (rings.len() * CORNERS) as u32 + 1]);
    let mut triangles = Vec::new();
    for k in 0..CORNERS {
        let next = (k + 1) % CORNERS;
        triangles.extend([next as u32, k as u32, ends[0], (last + k) as u32, (last + next) as u32, ends[1]]);
        for ring in (0..last).step_by(CORNERS) {
            let [a, b, c, d] = [ring + k, ring + next, ring + CORNERS + k, ring + CORNERS + next].map(|i| i as u32);
            triangles.extend([a, b, d, a, d, c]);
        }
    }
    (corners, triangles)
}
