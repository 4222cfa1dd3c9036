//! Solids by their signed distance: negative inside.

use super::{GridSdf, Vector};
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
    /// A mesh.
    Mesh(GridSdf),
}

impl Shape {
    /// Signed distance [m] at p and the outward normal (unit length, or zero where there is none).
    pub fn distance(&self, p: Vector) -> (f64, Vector) {
        match self {
            Self::Sphere { center, radius } => {
                let d = p - *center;
                let r = d.norm();
                (r - radius, if r > 0.0 { d * (1.0 / r) } else { Vector { x: 0.0, y: 0.0, z: 1.0 } })
            }
            Self::Box { center, half, turn } => {
                let (d, n) = box_distance(turn.conj().turn(p - *center), *half);
                (d, turn.turn(n))
            }
            Self::Plane { normal, offset } => (p.dot(*normal) - offset, *normal),
            Self::Mesh(grid) => {
                let (d, gradient) = grid.sample(p);
                (d, gradient.normalized())
            }
        }
    }
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
        let at = |p: [f64; 3]| shape.distance(p.into());
        let near = |(d, n): (f64, Vector), e: f64, m: [f64; 3]| (d - e).abs() < 1e-12 && (n - Vector::from(m)).norm() < 1e-12;
        assert!(near(at([1.0, 1.9, 0.0]), -0.1, [0.0, 1.0, 0.0]));
        assert!(near(at([3.0, 0.0, 0.0]), 1.0, [1.0, 0.0, 0.0]));
        assert!(near(at([1.0, 5.0, 4.5]), 5.0, [0.0, 0.6, 0.8]));
        assert!(near(at([1.0, 0.0, -0.4]), -0.1, [0.0, 0.0, -1.0]));
        let ball = Shape::Sphere { center: [0.0, 0.0, 1.0].into(), radius: 0.5 };
        assert!(near(ball.distance([0.0, 0.0, 2.0].into()), 0.5, [0.0, 0.0, 1.0]));
        assert!(near(ball.distance([0.0, 0.0, 1.0].into()), -0.5, [0.0, 0.0, 1.0]));
        let plane = Shape::Plane { normal: [0.6, 0.0, 0.8].into(), offset: 1.0 };
        assert!(near(plane.distance([5.0, 7.0, 0.0].into()), 2.0, [0.6, 0.0, 0.8]));
    }
}
