//! Cuts a flat panel into triangles of nearly equal edges: points along its sides, a lattice of equilateral triangles inside, and the
//! constrained Delaunay triangulation of both.

use crate::geometry::Vector;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

/// A panel before it is cut.
pub struct Cut {
    /// Its sides in order around it, each a line of at least two points [m]; one ends where the next begins.
    pub sides: Vec<Vec<[f64; 2]>>,
    /// From its own plane to where it hangs.
    pub place: Box<dyn Fn([f64; 2]) -> Vector>,
}

/// Two sides, as (panel, side), that are sewn together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stitch {
    /// One.
    pub from: (usize, usize),
    /// The other.
    pub to: (usize, usize),
    /// Begin with begin.
    pub flip: bool,
}

/// A panel that has been cut.
pub struct Piece {
    /// Its points in its own plane [m], row by row.
    pub flat: Vec<[f64; 2]>,
    /// Its triangles, turning as its outline does not: counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
    /// The points along each side, both ends included.
    pub sides: Vec<Vec<u32>>,
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    ((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1])).sqrt()
}

impl Cut {
    /// Length of a side [m].
    pub fn length(&self, side: usize) -> f64 {
        self.sides[side].windows(2).map(|p| distance(p[0], p[1])).sum()
    }

    /// Area [m²].
    pub fn area(&self) -> f64 {
        let twice = |p: &[[f64; 2]]| p[0][0] * p[1][1] - p[1][0] * p[0][1];
        self.sides.iter().flat_map(|side| side.windows(2)).map(twice).sum::<f64>().abs() / 2.0
    }

    /// From one corner of the box around it to the other [m].
    pub fn extent(&self) -> f64 {
        let along = |a: usize| {
            let all = self.sides.iter().flatten().map(|p| p[a]);
            all.clone().fold(f64::NEG_INFINITY, f64::max) - all.fold(f64::INFINITY, f64::min)
        };
        distance([along(0), along(1)], [0.0, 0.0])
    }
}

impl Piece {
    /// The longest side of its thinnest triangle and its height above it [m].
    pub fn thinnest(&self) -> (f64, f64) {
        let shape = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| self.flat[i as usize]);
            let long = distance(a, b).max(distance(b, c)).max(distance(c, a));
            (long, ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs() / long)
        };
        let thinner = |a: (f64, f64), b: (f64, f64)| if b.0 * a.1 > a.0 * b.1 { b } else { a };
        self.triangles.iter().map(shape).reduce(thinner).unwrap_or((1.0, 1.0))
    }
}

/// The points that divide a line into `n` parts of one length, without the last end.
fn divided(line: &[[f64; 2]], n: usize) -> Vec<[f64; 2]> {
    let whole: f64 = line.windows(2).map(|p| distance(p[0], p[1])).sum();
    let mut points = Vec::new();
    let (mut passed, mut k) = (0.0, 0);
    for i in 0..n {
        let s = whole * i as f64 / n as f64;
        while k + 2 < line.len() && passed + distance(line[k], line[k + 1]) <= s {
            passed += distance(line[k], line[k + 1]);
            k += 1;
        }
        let (a, b) = (line[k], line[k + 1]);
        let part = ((s - passed) / distance(a, b).max(f64::MIN_POSITIVE)).min(1.0);
        points.push([a[0] + (b[0] - a[0]) * part, a[1] + (b[1] - a[1]) * part]);
    }
    points
}

/// Whether a point is inside a closed line, and its distance to it.
fn inside(line: &[[f64; 2]], p: [f64; 2]) -> (bool, f64) {
    let (mut odd, mut nearest) = (false, f64::INFINITY);
    for (i, a) in line.iter().enumerate() {
        let b = line[(i + 1) % line.len()];
        if (a[1] > p[1]) != (b[1] > p[1]) && p[0] < a[0] + (b[0] - a[0]) * (p[1] - a[1]) / (b[1] - a[1]) {
            odd = !odd;
        }
        let d = [b[0] - a[0], b[1] - a[1]];
        let s = (((p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1]) / (d[0] * d[0] + d[1] * d[1]).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        nearest = nearest.min(distance(p, [a[0] + s * d[0], a[1] + s * d[1]]));
    }
    (odd, nearest)
}

/// Cuts a panel into triangles with edges of about `edge` [m], a side into `count(side)` of them; `None` if its sides cross, or do so when they are
/// cut that coarsely.
pub fn cut(panel: &Cut, edge: f64, count: &dyn Fn(usize) -> usize) -> Option<Piece> {
    let mut outline = Vec::new();
    let mut starts = Vec::new();
    for (k, side) in panel.sides.iter().enumerate() {
        starts.push(outline.len());
        outline.extend(divided(side, count(k)));
    }
    let border = outline.len();
    let mut points = outline.clone();
    let bounds = |a: usize| outline.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[a]), h.max(p[a])));
    let ((x0, x1), (y0, y1)) = (bounds(0), bounds(1));
    let height = edge * 0.75_f64.sqrt();
    for row in 0..=((y1 - y0) / height) as usize {
        let y = y0 + row as f64 * height;
        let shift = if row % 2 == 1 { 0.5 * edge } else { 0.0 };
        for column in 0..=((x1 - x0) / edge) as usize {
            let p = [x0 + shift + column as f64 * edge, y];
            // As far from the sides as a triangle is high would leave holes, closer would make slivers.
            if let (true, near) = inside(&outline, p)
                && near > 0.6 * edge
            {
                points.push(p);
            }
        }
    }
    // Row by row, so that neighbours in space are neighbours in memory.
    let mut order: Vec<usize> = (0..points.len()).collect();
    let key = |i: usize| (((points[i][1] - y0) / height).round(), points[i][0], points[i][1]);
    order.sort_by(|a, b| key(*a).partial_cmp(&key(*b)).unwrap_or(std::cmp::Ordering::Equal));
    let mut place = vec![0_u32; points.len()];
    order.iter().enumerate().for_each(|(new, old)| place[*old] = new as u32);
    let flat: Vec<[f64; 2]> = order.iter().map(|i| points[*i]).collect();
    let mut delaunay = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    let mut handles = Vec::new();
    for p in &flat {
        handles.push(delaunay.insert(Point2::new(p[0], p[1])).ok()?);
    }
    // Two points at one place, or sides that cross, make no panel.
    if delaunay.num_vertices() != flat.len() {
        return None;
    }
    for i in 0..border {
        let (a, b) = (handles[place[i] as usize], handles[place[(i + 1) % border] as usize]);
        if !delaunay.can_add_constraint(a, b) {
            return None;
        }
        delaunay.add_constraint(a, b);
    }
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for face in delaunay.inner_faces() {
        let corners = face.vertices().map(|v| v.fix().index() as u32);
        let [a, b, c] = corners.map(|i| flat[i as usize]);
        let middle = [(a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0];
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if inside(&outline, middle).0 && area > 1e-9 * edge * edge {
            triangles.push(corners);
        }
    }
    triangles.sort_unstable_by_key(|t| (t.iter().copied().min(), *t));
    let mut used = vec![false; flat.len()];
    triangles.iter().flatten().for_each(|i| used[*i as usize] = true);
    if triangles.is_empty() || used.contains(&false) {
        return None;
    }
    let n = panel.sides.len();
    let sides = (0..n).map(|k| {
        let end = if k + 1 < n { starts[k + 1] } else { border };
        (starts[k]..=end).map(|i| place[i % border]).collect()
    });
    Some(Piece { sides: sides.collect(), flat, triangles })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(side: f64) -> Cut {
        let corners = [[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]];
        let sides = (0..4).map(|i| vec![corners[i], corners[(i + 1) % 4]]).collect();
        Cut { sides, place: Box::new(|p| [p[0], p[1], 0.0].into()) }
    }

    #[test]
    fn a_panel_is_covered_once_by_triangles_of_one_size() {
        for edge in [0.3, 0.07, 0.021] {
            let panel = square(1.0);
            let piece = cut(&panel, edge, &|side| (panel.length(side) / edge).round() as usize).unwrap();
            let area = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|i| piece.flat[i as usize]);
                0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
            };
            let total: f64 = piece.triangles.iter().map(area).sum();
            assert!((total - 1.0).abs() < 1e-9, "{edge}: {total}");
            let even = edge * edge * 3.0_f64.sqrt() / 4.0;
            let (small, large) = piece.triangles.iter().map(area).fold((1.0_f64, 0.0_f64), |(s, l), a| (s.min(a), l.max(a)));
            // Measured: 0.52 to 1.9 of an equilateral triangle.
            assert!(small > 0.3 * even && large < 2.5 * even, "{edge}: {} {}", small / even, large / even);
            assert!(piece.sides.iter().all(|s| s.len() == (1.0 / edge).round() as usize + 1));
            assert_eq!(piece.sides[0].last(), piece.sides[1].first());
        }
    }

    #[test]
    fn sides_that_cross_make_no_panel() {
        let corners = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
        let sides = (0..4).map(|i| vec![corners[i], corners[(i + 1) % 4]]).collect();
        let panel = Cut { sides, place: Box::new(|p| [p[0], p[1], 0.0].into()) };
        assert!(cut(&panel, 0.1, &|side| (panel.length(side) / 0.1).round() as usize).is_none());
    }
}
