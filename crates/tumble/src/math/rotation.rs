//! Rotations of scenery and of frames.

use super::functions::{cos, sin};
use super::{Quat, Real, Row, Vec3};

/// The rotation about x, then y, then z, angles in degrees.
pub fn from_degrees([a, b, c]: [f64; 3]) -> Quat<f64> {
    let about = |axis: Vec3<f64>, degrees: f64| {
        let half = degrees.to_radians() / 2.0;
        Quat { v: axis * sin(half), w: cos(half) }
    };
    let unit = |x, y, z| Vec3 { x, y, z };
    about(unit(0.0, 0.0, 1.0), c) * about(unit(0.0, 1.0, 0.0), b) * about(unit(1.0, 0.0, 0.0), a)
}

/// The shortest rotation that takes e_z to the direction of `d`.
pub fn from_z_to(d: Vec3<f64>) -> Quat<f64> {
    let d = d.normalized();
    if d.z < -1.0 + 1e-12 {
        return Quat { v: Vec3 { x: 1.0, y: 0.0, z: 0.0 }, w: 0.0 };
    }
    Quat { v: Vec3 { x: -d.y, y: d.x, z: 0.0 }, w: 1.0 + d.z }.normalized()
}

/// The rotation that takes e_x and e_z to two unit vectors across each other.
pub fn from_axes(x: Vec3<f64>, z: Vec3<f64>) -> Quat<f64> {
    let upright = from_z_to(z);
    let before = upright.turn(Vec3 { x: 1.0, y: 0.0, z: 0.0 });
    // About z, by its half angle.
    let half = ((1.0 + before.dot(x)) / 2.0).max(0.0).sqrt();
    let about = if half < 1e-7 { Quat { v: z, w: 0.0 } } else { Quat { v: z * (z.dot(before.cross(x)) / (2.0 * half)), w: half } };
    (about * upright).normalized()
}

/// exp(theta/2): the turn by a rotation vector [rad].
pub fn by(theta: Vec3<f64>) -> Quat<f64> {
    let angle = theta.norm();
    let half = angle / 2.0;
    // sin(half)/angle, by its series where the quotient would lose digits.
    let c = if angle < 1e-4 { 0.5 - angle * angle / 48.0 } else { sin(half) / angle };
    Quat { v: theta * c, w: cos(half) }
}

/// q exp(theta/2): the frame q turned by the rotation vector theta [rad], given in the frame's own axes.
pub fn turn(q: Row, theta: Vec3<Real>) -> Row {
    let step = by(Vec3 { x: f64::from(theta.x), y: f64::from(theta.y), z: f64::from(theta.z) });
    let turned = Quat::from_row(q.map(f64::from)) * step;
    turned.normalized().row().map(|x| x as Real)
}

/// q' = q (0, omega) / 2: the rate of a frame that turns at omega [rad/s] in its own axes.
#[inline(always)]
pub fn rate(q: Row, omega: Vec3<Real>) -> Row {
    (Quat::from_row(q) * Quat::pure(omega)).scaled(0.5).row()
}

/// The torque in the frame's own axes that belongs to the force g = -dE/dq on the four numbers of q: Im(q* g) / 2.
#[inline(always)]
pub fn torque(q: Row, g: Row) -> Vec3<Real> {
    (Quat::from_row(q).conj() * Quat::from_row(g)).v * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_follow_the_right_hand() {
        let q = from_degrees([0.0, 0.0, 90.0]);
        let v = q.turn(Vec3 { x: 1.0, y: 0.0, z: 0.0 });
        assert!((v.y - 1.0).abs() < 1e-15 && v.x.abs() < 1e-15);
        // x first, then z: e_y -> e_z -> e_z
        let v = from_degrees([90.0, 0.0, 90.0]).turn(Vec3 { x: 0.0, y: 1.0, z: 0.0 });
        assert!((v.z - 1.0).abs() < 1e-15);
        for d in [[1.0, 2.0, -3.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]] {
            let d = Vec3::from(d).normalized();
            assert!((from_z_to(d).turn(Vec3 { x: 0.0, y: 0.0, z: 1.0 }) - d).norm() < 1e-15);
            assert!((from_z_to(d).axis_z() - d).norm() < 1e-15);
        }
    }

    #[test]
    fn axes_are_found_where_the_shortest_way_is_half_a_turn() {
        // Across e_x the shortest rotation takes e_x to -e_z, up to round-off.
        let unit = |x, y, z| Vec3 { x, y, z };
        for tilt in [0.0, 1e-9, 1e-8, 3e-8, 1e-7, 1e-6] {
            let (x, z) = (unit(0.0, tilt, 1.0).normalized(), unit(1.0, 0.0, 0.0));
            let q = from_axes(x, z);
            assert!((q.turn(unit(1.0, 0.0, 0.0)) - x).norm() < 1e-6 && (q.axis_z() - z).norm() < 1e-6, "{tilt}");
        }
    }

    #[test]
    fn turning_a_frame_integrates_its_rate() {
        let q: Row = from_degrees([10.0, 20.0, 30.0]).row().map(|x| x as Real);
        let omega = Vec3 { x: 0.3, y: -0.7, z: 0.4 };
        let h = 1e-3;
        let exact = turn(q, omega * h);
        let euler = super::super::axpy(q, h, rate(q, omega));
        for i in 0..4 {
            assert!((exact[i] - euler[i]).abs() < 1e-6);
        }
    }
}
