//! Splines of DXF: rational B-splines, by de Boor's algorithm.

use super::{Point, distance};

/// Chords in a span between two knots, at most.
const CHORDS: f64 = 256.0;

/// Points of a spline of some degree; `None` where knots, points and weights do not fit together. Where knots are even and weights alike, no chord is
/// further than `fine` from it.
pub fn spline(degree: usize, knots: &[f64], points: &[Point], weights: &[f64], fine: f64) -> Option<Vec<Point>> {
    let n = points.len();
    let rising = knots.windows(2).all(|pair| pair[0] <= pair[1]);
    if !(1..=9).contains(&degree) || n <= degree || knots.len() != n + degree + 1 || !rising {
        return None;
    }
    let weight = |k: usize| weights.get(k).copied().filter(|w| *w > 0.0).unwrap_or(1.0);
    let at = |span: usize, t: f64| {
        let mut d: Vec<[f64; 3]> =
            (span - degree..=span).map(|k| [points[k][0] * weight(k), points[k][1] * weight(k), weight(k)]).collect();
        for r in 1..=degree {
            for j in (r..=degree).rev() {
                let (low, high) = (knots[j + span - degree], knots[j + 1 + span - r]);
                let s = if high > low { (t - low) / (high - low) } else { 0.0 };
                d[j] = [0, 1, 2].map(|a| (1.0 - s) * d[j - 1][a] + s * d[j][a]);
            }
        }
        let [x, y, w] = d[degree];
        [x / w, y / w]
    };
    let mut found = Vec::new();
    for span in degree..n {
        let (low, high) = (knots[span], knots[span + 1]);
        if high > low {
            // As for a Bézier curve, whose second derivative is no smaller for the same points.
            let own = &points[span - degree..=span];
            let bend = own.windows(3).map(|w| distance([w[0][0] + w[2][0], w[0][1] + w[2][1]], [2.0 * w[1][0], 2.0 * w[1][1]]));
            let most = (degree * (degree - 1)) as f64 * bend.fold(0.0, f64::max) / (8.0 * fine.max(1e-300));
            let n = most.sqrt().ceil().clamp(1.0, CHORDS) as usize;
            let first = usize::from(!found.is_empty());
            found.extend((first..=n).map(|k| at(span, low + (high - low) * k as f64 / n as f64)));
        }
    }
    Some(found)
}
