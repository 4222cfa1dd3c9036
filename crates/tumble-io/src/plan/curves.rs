//! Curves to chords. All angles go through `libm`: browsers read the same bits.

use super::{Point, between, distance, sub};
use std::f64::consts::TAU;

/// Chords of a curve, at most.
const CHORDS: f64 = 512.0;

/// A placement: x -> [a c; b d] x + [e f].
#[derive(Debug, Clone, Copy)]
pub struct Place {
    pub m: [f64; 6],
}

impl Place {
    pub const HERE: Self = Self { m: [1.0, 0.0, 0.0, 1.0, 0.0, 0.0] };

    pub fn at(&self, x: Point) -> Point {
        let [a, b, c, d, e, f] = self.m;
        [a * x[0] + c * x[1] + e, b * x[0] + d * x[1] + f]
    }

    /// First `inner`, then this.
    pub fn of(&self, inner: &Self) -> Self {
        let [a, b, c, d, ..] = self.m;
        let [i, j, k, l, e, f] = inner.m;
        let [x, y] = self.at([e, f]);
        Self { m: [a * i + c * j, b * i + d * j, a * k + c * l, b * k + d * l, x, y] }
    }

    /// How much longer it makes lines, at most.
    pub fn stretch(&self) -> f64 {
        let [a, b, c, d, ..] = self.m;
        (a * a + b * b + c * c + d * d).sqrt()
    }

    /// Whether it keeps circles round.
    pub fn is_even(&self) -> bool {
        let [a, b, c, d, ..] = self.m;
        let (p, q) = (a * a + b * b, c * c + d * d);
        (p - q).abs() <= 1e-6 * (p + q) && (a * c + b * d).abs() <= 1e-6 * (p + q)
    }
}

/// Points of an arc around a centre with two half axes, from an angle on [rad], `turn` further, which may be negative; no chord is further than
/// `fine` from it.
pub fn arc(centre: Point, axes: [Point; 2], from: f64, turn: f64, fine: f64) -> Vec<Point> {
    let radius = distance(axes[0], [0.0; 2]).max(distance(axes[1], [0.0; 2]));
    // The height of a chord over an angle t is r (1 - cos(t/2)).
    let step = 2.0 * libm::acos(1.0 - (fine / radius.max(1e-300)).clamp(1e-9, 0.3));
    let n = (turn.abs() / step).ceil().clamp(1.0, CHORDS);
    let point = |k: usize| {
        let (s, c) = (libm::sin(from + turn * k as f64 / n), libm::cos(from + turn * k as f64 / n));
        [0, 1].map(|a| centre[a] + c * axes[0][a] + s * axes[1][a])
    };
    let mut points: Vec<Point> = (0..=n as usize).map(point).collect();
    if (turn.abs() - TAU).abs() < 1e-9
        && let (Some(first), Some(last)) = (points.first().copied(), points.last_mut())
    {
        *last = first;
    }
    points
}

/// Centre, first angle and turn of the arc from a to b that bulges by `bulge`: the tangent of a quarter of its angle, positive to the right of the chord
/// (AutoCAD).
pub fn bulged(a: Point, b: Point, bulge: f64) -> (Point, f64, f64) {
    let turn = 4.0 * libm::atan(bulge);
    // From the middle of the chord to the centre, to its left, in parts of the chord.
    let to_centre = (1.0 - bulge * bulge) / (4.0 * bulge);
    let d = sub(b, a);
    let middle = between(a, b, 0.5);
    let centre = [middle[0] - to_centre * d[1], middle[1] + to_centre * d[0]];
    (centre, libm::atan2(a[1] - centre[1], a[0] - centre[0]), turn)
}

/// Appends the points of a Bézier curve after its first, `p` being its control points (three or four).
pub fn bezier(points: &mut Vec<Point>, p: &[Point], fine: f64) {
    // The error of chords is at most |second derivative| / (8 n²).
    let bend = p.windows(3).map(|w| distance([w[0][0] + w[2][0], w[0][1] + w[2][1]], [2.0 * w[1][0], 2.0 * w[1][1]])).fold(0.0, f64::max);
    let degree = (p.len() - 1) as f64;
    let n = (degree * (degree - 1.0) * bend / (8.0 * fine.max(1e-300))).sqrt().ceil().clamp(1.0, CHORDS);
    for k in 1..=n as usize {
        let mut row = p.to_vec();
        while row.len() > 1 {
            row = row.windows(2).map(|w| between(w[0], w[1], k as f64 / n)).collect();
        }
        points.push(if k == n as usize { p[p.len() - 1] } else { row[0] });
    }
}
