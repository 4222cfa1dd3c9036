//! Motion that all of a neighbourhood have in common: none of it brings anything nearer to anything else.
//!
//!   u_v = u + omega × (X_v - c),   I omega = Σ (X_v - c) × w_v                          (contact.25)
//!
//! u and c are means of ways w_v and places X_v, I the inertia of the places about c, all of one mass. Along X + s u, 0 ≤ s ≤ 1, a neighbourhood
//! goes through affine maps with the determinant 1 + s² omega²: none is folded.

use crate::geometry::Vector;
use crate::math::{Row, xyz64};

/// The part of the longest way that may be left beside the common one: else it is not worth while.
const LEFT: f64 = 0.5;

/// The volume of the inertia's columns, over that of a cube with such sides, below which there is no turn.
const FLAT: f64 = 1e-6;

/// Unit vectors.
const AXES: [Vector; 3] = [Vector { x: 1.0, y: 0.0, z: 0.0 }, Vector { x: 0.0, y: 1.0, z: 0.0 }, Vector { x: 0.0, y: 0.0, z: 1.0 }];

/// Where parts of a system are and go: lower and upper corner [m].
type Bounds = [Vector; 2];

/// For each vertex, the part of its way that its neighbourhood has in common [m]: zero where that does not shorten the longest of them to less
/// than half. `parts` are lists of vertices; those that come nearer than `apart` [m] to each other in boxes are one neighbourhood. Who may be
/// stopped does not go along: nothing is in common where `stops` says so of a ball, by centre and radius [m], that one keeps to.
/// `x` and `ways` have a row for each vertex of a part. Empty if there is nothing in common anywhere.
pub fn common_ways(parts: &[&[u32]], x: &[Row], ways: &[Vector], apart: f64, stops: &dyn Fn(Vector, f64) -> bool) -> Vec<Vector> {
    // Alone, each part would go along with itself; those that could meet on that way, or on their own, go together.
    let mut groups: Vec<(Vec<u32>, Common, Bounds)> = Vec::new();
    for part in parts.iter().filter(|part| !part.is_empty()) {
        let mut members = part.to_vec();
        loop {
            let common = Common::of(&members, x, ways);
            let bounds = common.bounds(&members, x, ways, 0.5 * apart);
            let Some(near) = groups.iter().position(|(.., other)| overlap(&bounds, other)) else {
                groups.push((members, common, bounds));
                break;
            };
            members.extend(groups.swap_remove(near).0);
        }
    }
    let mut all = Vec::new();
    let is_free = |[low, high]: &Bounds| !stops((*low + *high) * 0.5, 0.5 * (*high - *low).norm());
    for (members, common, _) in groups.iter().filter(|(_, common, bounds)| common.any && is_free(bounds)) {
        all.resize(ways.len(), Vector::default());
        vertices(members).for_each(|v| all[v] = common.way(xyz64(x[v])));
    }
    all
}

fn vertices(members: &[u32]) -> impl Iterator<Item = usize> {
    members.iter().map(|v| *v as usize)
}

fn overlap(a: &Bounds, b: &Bounds) -> bool {
    // What is not finite is near everything.
    let apart = |a: &Bounds, b: &Bounds| a[1].x < b[0].x || a[1].y < b[0].y || a[1].z < b[0].z;
    !(apart(a, b) || apart(b, a))
}

/// A motion in common.
#[derive(Debug, Clone, Copy, Default)]
struct Common {
    any: bool,
    centre: Vector,
    shift: Vector,
    turn: Vector,
}

impl Common {
    fn way(&self, x: Vector) -> Vector {
        if self.any { self.shift + self.turn.cross(x - self.centre) } else { Vector::default() }
    }

    /// The best one for some vertices; none where it leaves much. What weighs nothing follows others, or does not.
    fn of(members: &[u32], x: &[Row], ways: &[Vector]) -> Self {
        let free = || vertices(members).filter(|v| x[*v][3] > 0.0);
        let n = free().count() as f64;
        let mean = |f: &dyn Fn(usize) -> Vector| free().fold(Vector::default(), |sum, v| sum + f(v)) * (1.0 / n);
        let (centre, shift) = (mean(&|v| xyz64(x[v])), mean(&|v| ways[v]));
        // The inertia by columns.
        let (mut inertia, mut spin) = ([Vector::default(); 3], Vector::default());
        for v in free() {
            let r = xyz64(x[v]) - centre;
            spin = spin + r.cross(ways[v] - shift);
            let columns = AXES.map(|e| r.cross(e.cross(r)));
            (0..3).for_each(|k| inertia[k] = inertia[k] + columns[k]);
        }
        // Of places along a line, or of one, there is none.
        let [a, b, c] = inertia;
        let volume = a.dot(b.cross(c));
        let turn = if volume > FLAT * a.norm() * b.norm() * c.norm() {
            Vector { x: spin.dot(b.cross(c)), y: a.dot(spin.cross(c)), z: a.dot(b.cross(spin)) } * (1.0 / volume)
        } else {
            Vector::default()
        };
        let common = Self { any: true, centre, shift, turn };
        let longest = |left: &dyn Fn(usize) -> Vector| vertices(members).map(|v| left(v).norm_sq()).fold(0.0, f64::max).sqrt();
        let finite = (centre + shift + turn).norm_sq().is_finite();
        let any = finite && longest(&|v| ways[v] - common.way(xyz64(x[v]))) < LEFT * longest(&|v| ways[v]);
        Self { any, ..common }
    }

    /// A box around where vertices are, are about to go, and go in common.
    fn bounds(&self, members: &[u32], x: &[Row], ways: &[Vector], beyond: f64) -> Bounds {
        let mut bounds = [Vector { x: f64::MAX, y: f64::MAX, z: f64::MAX }, Vector { x: f64::MIN, y: f64::MIN, z: f64::MIN }];
        for v in vertices(members) {
            let x = xyz64(x[v]);
            for p in [x, x + ways[v], x + self.way(x)] {
                let each = |of: fn(f64, f64) -> f64, a: Vector| Vector { x: of(a.x, p.x), y: of(a.y, p.y), z: of(a.z, p.z) };
                bounds = [each(f64::min, bounds[0]), each(f64::max, bounds[1])];
            }
        }
        let beyond = Vector { x: beyond, y: beyond, z: beyond };
        [bounds[0] - beyond, bounds[1] + beyond]
    }
}
