//! Closest points of a point and a triangle, and of two edges.

use crate::geometry::Vector;

/// Closest points of two features: signed weights of their four vertices, which sum to zero, so that the sum of weights times vertices points from
/// the second feature to the first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// Weights: of the first feature's points positive, of the second one's negative.
    pub weights: [f64; 4],
    /// Squared distance [m²].
    pub distance_sq: f64,
}

/// The closest point of a segment to p, as the weight of its end b. A segment without length is its start.
#[inline(always)]
fn on_segment(p: Vector, a: Vector, b: Vector) -> (f64, f64) {
    let (d, w) = (b - a, p - a);
    let length_sq = d.norm_sq();
    let t = if length_sq > 0.0 { (w.dot(d) / length_sq).clamp(0.0, 1.0) } else { 0.0 };
    (t, (w - d * t).norm_sq())
}

/// A point and a triangle, by the regions of barycentric coordinates ([ericson2004], 5.1.5). Near a triangle without area, where
/// these are noise, the nearest of its sides counts as well.
#[inline(always)]
pub fn point_triangle(p: Vector, [a, b, c]: [Vector; 3]) -> Nearest {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (aa, bb) = (ab.norm_sq(), ac.norm_sq());
    let area_sq = ab.cross(ac).norm_sq();
    let length_sq = aa.max(bb);
    let mut best = Nearest { weights: [1.0, -1.0, 0.0, 0.0], distance_sq: f64::INFINITY };
    if area_sq > 1e-20 * length_sq * length_sq {
        let (v, w) = inside(p, [a, b, c], ab, ac, ap);
        best = Nearest { weights: [1.0, v + w - 1.0, -v, -w], distance_sq: (ap - ab * v - ac * w).norm_sq() };
        if area_sq > 1e-6 * length_sq * length_sq {
            return best;
        }
    }
    let mut side = |q: Vector, r: Vector, i: usize, j: usize| {
        let (t, distance_sq) = on_segment(p, q, r);
        if distance_sq < best.distance_sq {
            best = Nearest { weights: [1.0, 0.0, 0.0, 0.0], distance_sq };
            best.weights[i] -= 1.0 - t;
            best.weights[j] -= t;
        }
    };
    side(a, b, 1, 2);
    side(b, c, 2, 3);
    side(c, a, 3, 1);
    best
}

/// The weights of b and c at the closest point.
#[inline(always)]
fn inside(p: Vector, [_, b, c]: [Vector; 3], ab: Vector, ac: Vector, ap: Vector) -> (f64, f64) {
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (0.0, 0.0);
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return (1.0, 0.0);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (d1 / (d1 - d3), 0.0);
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return (0.0, 1.0);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (0.0, d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return (1.0 - w, w);
    }
    let scale = 1.0 / (va + vb + vc);
    (vb * scale, vc * scale)
}

/// Two edges, a to b and c to d ([ericson2004], 5.1.9). Of parallel ones, and of such without length, an end counts as well as any
/// other place: the first of the four that is nearest to the other edge.
#[inline(always)]
pub fn edge_edge([a, b]: [Vector; 2], [c, d]: [Vector; 2]) -> Nearest {
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, vv, uv) = (u.norm_sq(), v.norm_sq(), u.dot(v));
    let (uw, vw) = (u.dot(w), v.dot(w));
    let sine = uu * vv - uv * uv;
    let mut best = (0.0, 0.0, f64::INFINITY);
    if sine > 1e-20 * uu * vv {
        let mut s = ((uv * vw - vv * uw) / sine).clamp(0.0, 1.0);
        let mut t = (uv * s + vw) / vv;
        if !(0.0..=1.0).contains(&t) {
            t = t.clamp(0.0, 1.0);
            s = ((uv * t - uw) / uu).clamp(0.0, 1.0);
        }
        best = (s, t, (w + u * s - v * t).norm_sq());
    }
    if sine <= 1e-6 * uu * vv {
        let mut end = |s: f64, t: f64, distance_sq: f64| {
            if distance_sq < best.2 {
                best = (s, t, distance_sq);
            }
        };
        let (t, r) = on_segment(a, c, d);
        end(0.0, t, r);
        let (t, r) = on_segment(b, c, d);
        end(1.0, t, r);
        let (s, r) = on_segment(c, a, b);
        end(s, 0.0, r);
        let (s, r) = on_segment(d, a, b);
        end(s, 1.0, r);
    }
    let (s, t, distance_sq) = best;
    Nearest { weights: [1.0 - s, s, t - 1.0, -t], distance_sq }
}
