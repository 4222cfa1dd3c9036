//! Solids by their signed distance: negative inside.

use super::facets::{Nearest, Sides};
use super::{Facets, GridSdf, Vector};
use crate::math::Quat;

/// A solid.
#[derive(Debug, Clone)]
pub enum Shape {
    /// A ball.
    Sphere {
        /// Centre [m].
        center: Vector,
        /// Radius [m].
        radius: f64,
    },
    /// A box.
    Box {
        /// Centre [m].
        center: Vector,
        /// Half its edges [m].
        half: Vector,
        /// Its turn.
        turn: Quat<f64>,
    },
    /// Everything behind a plane n . x = d.
    Plane {
        /// Unit vector out of the solid.
        normal: Vector,
        /// Distance from the origin [m].
        offset: f64,
    },
    /// Everything closer than the radius to a segment.
    Capsule {
        /// One end [m].
        from: Vector,
        /// The other end [m].
        to: Vector,
        /// Radius [m].
        radius: f64,
    },
    /// A mesh that keeps its shape.
    Mesh {
        /// Distance to it.
        grid: GridSdf,
        /// Its triangles, which nothing passes.
        facets: Facets,
        /// Whether it has no inside.
        shell: bool,
    },
    /// A mesh whose vertices move.
    Animated {
        /// Its triangles.
        facets: Facets,
        /// Whether it has no inside.
        shell: bool,
    },
}

/// The surface near a point: signed distance [m], outward unit normal (zero if undefined), velocity of the surface [m/s].
pub type Near = (f64, Vector, Vector);

/// Corrections of Newton's method on the way to a contact; each at least halves what is left.
const CORRECTIONS: usize = 100;

/// The surface near p by its nearest point; a shell has two outsides.
fn signed(p: Vector, found: &Nearest, shell: bool) -> Near {
    let way = p - found.point;
    let sign = if !shell && way.dot(found.normal) < 0.0 { -1.0 } else { 1.0 };
    let normal = if found.distance > 0.0 { way * (sign / found.distance) } else { found.normal.normalized() };
    (sign * found.distance, normal, found.velocity)
}

impl Shape {
    /// Signed distance [m] at p and time t, the outward normal, and the velocity of the surface. What is farther than
    /// `within` [m] may be told too near.
    pub fn near(&self, p: Vector, t: f64, within: f64) -> Near {
        let (d, n) = match self {
            Self::Sphere { center, radius } => ball(p - *center, *radius),
            Self::Box { center, half, turn } => {
                let (d, n) = box_distance(turn.conj().turn(p - *center), *half);
                (d, turn.turn(n))
            }
            Self::Plane { normal, offset } => (p.dot(*normal) - offset, *normal),
            Self::Capsule { from, to, radius } => {
                let axis = *to - *from;
                let along = (p - *from).dot(axis) / axis.norm_sq().max(f64::MIN_POSITIVE);
                ball(p - *from - axis * along.clamp(0.0, 1.0), *radius)
            }
            Self::Mesh { grid, facets, shell } => match grid.sample(p) {
                // Where the grid is too coarse, the triangles are asked.
                None => {
                    let found = facets.nearest(p, 0.0, 4.0 * grid.cell()).or_else(|| facets.nearest(p, 0.0, f64::INFINITY));
                    return found.map_or((within, Vector::default(), Vector::default()), |found| signed(p, &found, *shell));
                }
                Some((d, gradient)) => (d, gradient.normalized()),
            },
            Self::Animated { facets, shell } => {
                // Far inside a solid there may be nothing near, too.
                let near = facets.nearest(p, t, within);
                let deep = || if *shell || facets.apart(p, t) { None } else { facets.nearest(p, t, f64::INFINITY) };
                let found = near.or_else(deep);
                return found.map_or((within, Vector::default(), Vector::default()), |found| signed(p, &found, *shell));
            }
        };
        (d, n, Vector::default())
    }

    /// The same of a surface that is nearer than `within` [m]: deep inside a mesh nothing is, and nothing is looked for.
    pub fn near_surface(&self, p: Vector, t: f64, within: f64) -> Option<Near> {
        match self {
            Self::Animated { facets, shell } => facets.nearest(p, t, within).map(|found| signed(p, &found, *shell)),
            _ => Some(self.near(p, t, within)),
        }
    }

    /// The same for what is to stay in: beyond the edge of a box the nearest wall counts, and not the edge, so that every wall pushes
    /// along its own normal.
    pub fn near_walls(&self, p: Vector, t: f64, within: f64) -> Near {
        let Self::Box { center, half, turn } = self else { return self.near(p, t, within) };
        let (p, half): ([f64; 3], [f64; 3]) = (turn.conj().turn(p - *center).into(), (*half).into());
        let q: [f64; 3] = std::array::from_fn(|a| p[a].abs() - half[a]);
        let axis = if q[0] >= q[1] && q[0] >= q[2] { 0 } else { 1 + usize::from(q[2] > q[1]) };
        let mut n = [0.0; 3];
        n[axis] = if p[axis] < 0.0 { -1.0 } else { 1.0 };
        (q[axis], turn.turn(n.into()), Vector::default())
    }

    /// First contact of a mass that moves straight from a to b during t0 to t1: where it comes within `thickness` of the
    /// surface from outside (from within, if `inside`): part of the way, normal towards the mass, velocity of the surface.
    ///
    /// The distance to a convex solid is a convex function along the way, so that Newton's method comes closer from one
    /// side and never steps over the contact.                                                         (contact.10)
    pub fn sweep(&self, a: Vector, b: Vector, times: (f64, f64), thickness: f64, inside: bool) -> Option<(f64, Vector, Vector)> {
        let d = b - a;
        let slack = 1e-6 * (1.0 + a.norm());
        let (facets, sides) = match self {
            Self::Mesh { facets, shell, grid } => {
                // The grid's distance is off by less than two of its cells.
                if grid.sample(b).is_some_and(|(far, _)| far.abs() > d.norm() + thickness + 2.0 * grid.cell()) {
                    return None;
                }
                (facets, sides(*shell, inside))
            }
            Self::Animated { facets, shell } => (facets, sides(*shell, inside)),
            convex => return convex.sweep_convex(a, d, thickness, inside, slack).map(|(s, n)| (s, n, Vector::default())),
        };
        let found = facets.passage(a, b, times, sides, slack)?;
        // The normal towards where the mass came from.
        let span = times.1 - times.0;
        let way = d - found.velocity * span;
        let normal = if way.dot(found.normal) > 0.0 { -found.normal } else { found.normal };
        let speed = -way.dot(normal);
        let back = if speed > 0.0 { thickness / speed } else { 0.0 };
        Some(((found.s - back).max(0.0), normal, found.velocity))
    }

    fn sweep_convex(&self, a: Vector, d: Vector, thickness: f64, inside: bool, slack: f64) -> Option<(f64, Vector)> {
        let side = if inside { -1.0 } else { 1.0 };
        let at = |s: f64| {
            let p = a + d * s;
            let (distance, n, _) = if inside { self.near_walls(p, 0.0, f64::INFINITY) } else { self.near(p, 0.0, f64::INFINITY) };
            (side * distance - thickness, n * side)
        };
        let round = 1e-13 * (1.0 + a.norm() + d.norm());
        let start = || {
            let (g, n) = at(0.0);
            (g <= 0.0 && n.dot(d) < 0.0 && -g <= thickness + slack).then_some((0.0, n))
        };
        if inside {
            // Concave: from beyond the end backwards.
            let (mut g, mut n) = at(1.0);
            if g >= 0.0 {
                return None;
            }
            let mut s = 1.0;
            for _ in 0..CORRECTIONS {
                let rate = n.dot(d);
                s = if rate < 0.0 { s - g / rate } else { 0.0 };
                if s <= 0.0 {
                    return start();
                }
                let wall = n;
                (g, n) = at(s);
                if g >= -round {
                    // In a corner of a room the other wall is as near, and not the one that was met.
                    return Some((s, if matches!(self, Self::Box { .. }) { wall } else { n }));
                }
            }
            return Some((s, n));
        }
        if let Self::Plane { .. } = self
            && at(1.0).0 >= 0.0
        {
            return None;
        }
        let (mut g, mut n) = at(0.0);
        if g <= 0.0 {
            return start();
        }
        if g >= d.norm() {
            return None;
        }
        let mut s = 0.0;
        for _ in 0..CORRECTIONS {
            let rate = n.dot(d);
            if rate >= 0.0 {
                return None;
            }
            s -= g / rate;
            if s > 1.0 {
                return None;
            }
            (g, n) = at(s);
            if g <= round {
                return Some((s, n));
            }
        }
        None
    }

    /// Lower and upper corner of a mesh at all times [m]; `None` for other shapes.
    pub fn bounds(&self) -> Option<(Vector, Vector)> {
        match self {
            Self::Mesh { facets, .. } | Self::Animated { facets, .. } => Some(facets.bounds()),
            _ => None,
        }
    }

    /// Largest distance of its points from p [m]; infinite for a plane.
    pub fn reach(&self, p: Vector) -> f64 {
        let corners = |l: Vector, h: Vector| ((l - p).norm()).max((h - p).norm()) + (h - l).norm();
        match self {
            Self::Sphere { center, radius } => (*center - p).norm() + radius,
            Self::Box { center, half, .. } => (*center - p).norm() + half.norm(),
            Self::Plane { .. } => f64::INFINITY,
            Self::Capsule { from, to, radius } => (*from - p).norm().max((*to - p).norm()) + radius,
            Self::Mesh { facets, .. } | Self::Animated { facets, .. } => {
                let (l, h) = facets.bounds();
                corners(l, h)
            }
        }
    }
}

fn sides(shell: bool, inside: bool) -> Sides {
    match (shell, inside) {
        (true, _) => Sides::Both,
        (false, false) => Sides::In,
        (false, true) => Sides::Out,
    }
}

fn ball(d: Vector, radius: f64) -> (f64, Vector) {
    let r = d.norm();
    (r - radius, if r > 0.0 { d * (1.0 / r) } else { Vector { x: 0.0, y: 0.0, z: 1.0 } })
}

/// Distance and normal of the box |x| <= half.
fn box_distance(p: Vector, half: Vector) -> (f64, Vector) {
    let (p, half): ([f64; 3], [f64; 3]) = (p.into(), half.into());
    let q: [f64; 3] = std::array::from_fn(|a| p[a].abs() - half[a]);
    let sign: [f64; 3] = p.map(|x| if x < 0.0 { -1.0 } else { 1.0 });
    let outside = Vector::from(q.map(|q| q.max(0.0)));
    let far = outside.norm();
    if far > 0.0 {
        let n: [f64; 3] = outside.into();
        return (far, Vector::from(std::array::from_fn::<f64, 3, _>(|a| n[a] * sign[a] / far)));
    }
    let axis = if q[0] >= q[1] && q[0] >= q[2] { 0 } else { 1 + usize::from(q[2] > q[1]) };
    let mut n = [0.0; 3];
    n[axis] = sign[axis];
    (q[axis], n.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation::from_degrees;

    #[test]
    fn distances_by_hand() {
        let turn = from_degrees([0.0, 0.0, 90.0]);
        let shape = Shape::Box { center: [1.0, 0.0, 0.0].into(), half: [2.0, 1.0, 0.5].into(), turn };
        // Turned by 90 degrees the long edge lies along y.
        let plain = |shape: &Shape, p: [f64; 3]| {
            let (d, n, _) = shape.near(p.into(), 0.0, f64::INFINITY);
            (d, n)
        };
        let at = |p: [f64; 3]| plain(&shape, p);
        let near = |(d, n): (f64, Vector), e: f64, m: [f64; 3]| (d - e).abs() < 1e-12 && (n - Vector::from(m)).norm() < 1e-12;
        assert!(near(at([1.0, 1.9, 0.0]), -0.1, [0.0, 1.0, 0.0]));
        assert!(near(at([3.0, 0.0, 0.0]), 1.0, [1.0, 0.0, 0.0]));
        assert!(near(at([1.0, 5.0, 4.5]), 5.0, [0.0, 0.6, 0.8]));
        assert!(near(at([1.0, 0.0, -0.4]), -0.1, [0.0, 0.0, -1.0]));
        let ball = Shape::Sphere { center: [0.0, 0.0, 1.0].into(), radius: 0.5 };
        assert!(near(plain(&ball, [0.0, 0.0, 2.0]), 0.5, [0.0, 0.0, 1.0]));
        assert!(near(plain(&ball, [0.0, 0.0, 1.0]), -0.5, [0.0, 0.0, 1.0]));
        let plane = Shape::Plane { normal: [0.6, 0.0, 0.8].into(), offset: 1.0 };
        assert!(near(plain(&plane, [5.0, 7.0, 0.0]), 2.0, [0.6, 0.0, 0.8]));
        let pill = Shape::Capsule { from: [0.0; 3].into(), to: [2.0, 0.0, 0.0].into(), radius: 0.5 };
        assert!(near(plain(&pill, [1.0, 0.0, 2.0]), 1.5, [0.0, 0.0, 1.0]));
        assert!(near(plain(&pill, [5.0, 4.0, 0.0]), 4.5, [0.6, 0.8, 0.0]));
    }
}
