//! Contact with solids. Implicit Euler sees it as penalty elements with friction inside Newton's method. All other
//! integrators resolve it by a pass over positions and velocities after each step: a penalty does not damp under implicit
//! midpoint, and BDF2 has a history that an impact makes wrong.

use crate::elements::{Block, Linear, PointPlane, forces};
use crate::geometry::{Collider, Touch, Vector};
use crate::math::{Real, Row, row, xyz64};

/// Penalty stiffness over m/h²: a resting mass sinks in by g h²/30, 0.006 mm at 240 steps a second.
const PENALTY: f64 = 30.0;
/// Penalty stiffness over that of the links which pull the mass in.
const GRIP: f64 = 4.0;
/// Speed below which friction of the implicit schemes is proportional to the speed [m/s].
const CREEP: f64 = 1e-3;

/// Moves one mass out of the solids and gives it the velocity after the impact; says whether it touched one.
///
/// Position: out along the normal; of the way made along the surface since `before` as much is taken back as friction
/// allows, mu times the depth. Velocity: v_n -> -e v_n, and v_t loses at most mu times the change of v_n. A speed of
/// approach below `resting` [m/s], what gravity gives in two steps, does not bounce.      (contact.2, contact.3)
pub fn resolve(colliders: &[Collider], before: Row, x: &mut Row, v: &mut Row, resting: f64) -> bool {
    let mut touched = false;
    for collider in colliders {
        let (position, velocity) = (xyz64(*x), xyz64(*v));
        let Some(Touch { depth, normal }) = collider.touch(position) else { continue };
        touched = true;
        let way = position - xyz64(before);
        let along = way - normal * way.dot(normal);
        let back = (collider.friction * depth).min(along.norm());
        let position = position + normal * depth - along.normalized() * back;
        let approach = velocity.dot(normal);
        let slide = velocity - normal * approach;
        let bounce = if approach < -resting { -collider.restitution * approach } else { 0.0 };
        let after = approach.max(bounce);
        let loss = (collider.friction * (after - approach)).min(slide.norm());
        let velocity = slide - slide.normalized() * loss + normal * after;
        *x = row(real(position), x[3]);
        *v = row(real(velocity), 0.0);
    }
    touched
}

/// After an implicit step: a mass that came in faster than `resting` leaves with e times its speed.
pub fn bounce(colliders: &[Collider], x: Row, before: Row, v: &mut Row, resting: f64) -> bool {
    let mut touched = false;
    for collider in colliders.iter().filter(|c| c.restitution > 0.0) {
        let Some(Touch { normal, .. }) = collider.touch(xyz64(x)) else { continue };
        let approach = xyz64(before).dot(normal);
        let wanted = -collider.restitution * approach;
        let velocity = xyz64(*v);
        if approach < -resting && velocity.dot(normal) < wanted {
            *v = row(real(velocity + normal * (wanted - velocity.dot(normal))), 0.0);
            touched = true;
        }
    }
    touched
}

/// Penalty stiffness [N/m] of a mass [kg] that its links hold with `grip` [N/m], in a stage of length gh.   (contact.6)
pub fn stiffness(mass: Real, grip: Real, gh: f64) -> f64 {
    PENALTY * f64::from(mass) / (gh * gh) + GRIP * f64::from(grip)
}

/// Penalty and friction of one mass in an implicit stage.
pub struct Penalty {
    touch: Touch,
    rest: [f64; 4],
    stiffness: f64,
    /// mu times the normal force at the start of the stage [N].
    friction: f64,
    slide: Vector,
}

impl Penalty {
    /// The contacts of a mass at x with velocity v, with this penalty stiffness [N/m]. Friction takes its normal force from
    /// `start`, where the mass was when the stage began: with that force held fixed friction has a convex potential, and
    /// Newton's method converges.
    pub fn of(colliders: &[Collider], stiffness: f64, x: Row, v: Row, start: Row) -> impl Iterator<Item = Penalty> {
        colliders.iter().filter_map(move |collider| {
            let (position, velocity) = (xyz64(x), xyz64(v));
            let touch = collider.touch(position)?;
            let n = touch.normal;
            Some(Penalty {
                rest: [n.x, n.y, n.z, n.dot(position) + touch.depth],
                stiffness,
                friction: collider.friction
                    * stiffness
                    * if collider.friction > 0.0 { collider.touch(xyz64(start)).map_or(0.0, |t| t.depth) } else { 0.0 },
                slide: velocity - n * velocity.dot(n),
                touch,
            })
        })
    }

    /// mu N/|v_t|, finite where the mass rests [N s/m].
    fn drag(&self) -> f64 {
        self.friction / self.slide.norm().max(CREEP)
    }

    /// The force [N]: the point-plane element and Coulomb friction.
    pub fn force(&self, x: Row) -> Vector {
        let [push] = forces::<PointPlane, Linear, f64, 1, 1, 4, 0>(self.stiffness, [], self.rest, [x.map(f64::from)], None);
        push - self.slide * self.drag()
    }

    /// -df/dx - df/dv / gh, without its indefinite parts.
    pub fn matrix(&self, gh: f64) -> Block {
        let n = self.touch.normal;
        let drag = self.drag() / gh;
        let t = if self.slide.norm() > CREEP { self.slide.normalized() } else { Vector::default() };
        let k = self.stiffness - drag;
        let block = [
            k * n.x * n.x + drag * (1.0 - t.x * t.x),
            k * n.y * n.y + drag * (1.0 - t.y * t.y),
            k * n.z * n.z + drag * (1.0 - t.z * t.z),
            k * n.x * n.y - drag * t.x * t.y,
            k * n.y * n.z - drag * t.y * t.z,
            k * n.z * n.x - drag * t.z * t.x,
        ];
        block.map(|b| b as Real)
    }
}

fn real(v: Vector) -> crate::math::Vec3<Real> {
    crate::math::Vec3 { x: v.x as Real, y: v.y as Real, z: v.z as Real }
}
