//! Places and lines on a floor.

/// A place on the floor, or a direction.
pub type Point = [f64; 2];

pub(super) fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// b to the left of a is positive.
pub(super) fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub(super) fn along(x: Point, s: f64, e: Point) -> Point {
    [x[0] + s * e[0], x[1] + s * e[1]]
}

pub(super) fn length(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// A line from one place to another.
pub type Line = [Point; 2];

/// The middle of a line.
pub fn middle([a, b]: Line) -> Point {
    [0, 1].map(|k| 0.5 * (a[k] + b[k]))
}

/// Length of a line [m].
pub fn width([a, b]: Line) -> f64 {
    length(sub(b, a))
}

/// The place on a line that is nearest to x.
pub fn nearest([a, b]: Line, x: Point) -> Point {
    let d = sub(b, a);
    let len_sq = dot(d, d);
    let s = if len_sq > 0.0 { (dot(sub(x, a), d) / len_sq).clamp(0.0, 1.0) } else { 0.0 };
    along(a, s, d)
}

/// Whether the way from x to y meets a line, its ends included.
pub fn meets([a, b]: Line, x: Point, y: Point) -> bool {
    let (d, e) = (sub(b, a), sub(y, x));
    let (sx, sy) = (cross(d, sub(x, a)), cross(d, sub(y, a)));
    let (sa, sb) = (cross(e, sub(a, x)), cross(e, sub(b, x)));
    sx * sy <= 0.0 && sa * sb <= 0.0 && (sx != 0.0 || sy != 0.0)
}

/// Where on the way from x to y, 0 to 1, a line is crossed, and whether from its left to its right. A place on the line itself is to its left, so
/// that a way of many steps crosses once.
pub fn crossing([a, b]: Line, x: Point, y: Point) -> Option<(f64, bool)> {
    let d = sub(b, a);
    let (sx, sy) = (cross(d, sub(x, a)), cross(d, sub(y, a)));
    if (sx < 0.0) == (sy < 0.0) {
        return None;
    }
    let s = sx / (sx - sy);
    let at = dot(sub(along(x, s, sub(y, x)), a), d);
    (at >= 0.0 && at <= dot(d, d)).then_some((s, sx >= 0.0))
}

/// Whether a place is inside a polygon.
pub fn inside(polygon: &[Point], x: Point) -> bool {
    let mut odd = false;
    for (i, a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        if (a[1] > x[1]) != (b[1] > x[1]) && x[0] < a[0] + (x[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) {
            odd = !odd;
        }
    }
    odd
}
