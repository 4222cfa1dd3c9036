//! Lengths that round-off cannot resolve: positions are stored to half a unit in the last place of their distance from the origin.

use crate::geometry::{Collider, Vector};
use crate::math::Real;
use crate::systems::dynamics::Parts;
use tumble_interface::check::short;
use tumble_interface::scene::{Scene, Shape};
use tumble_interface::warning::Code;
use tumble_interface::{Issue, Warning};

/// Parts of a length that may be lost before a scene is warned, and before it is refused.
const TOLD: f64 = 1e-3;
const REFUSED: f64 = 0.1;
/// Part of a solid's thickness.
const THIN: f64 = 0.05;

/// Round-off of positions at p [m].
fn lost(p: Vector) -> f64 {
    0.5 * f64::from(Real::EPSILON) * p.x.abs().max(p.y.abs()).max(p.z.abs())
}

fn message(lost: f64, length: f64, what: &str, far: f64) -> String {
    format!(
        "single precision knows places {} m from the origin to {} m, {} % of {what}, {} m; take precision = \"double\", or put the scene near the \
         origin",
        short(far),
        short(lost),
        short(100.0 * lost / length),
        short(length)
    )
}

/// The objects of a system whose shortest length, of an element or else of all of it, is not resolved where it starts.
pub fn objects(parts: &Parts, issues: &mut Vec<Issue>, warnings: &mut Vec<Warning>) {
    for ((name, range), (shortest, size)) in parts.ranges().zip(parts.lengths()) {
        let (length, what) = if shortest.is_finite() { (shortest, "its shortest length") } else { (size, "its size") };
        let places = range.map(|i| parts.position(i as u32));
        let Some(worst) = places.max_by(|a, b| lost(*a).total_cmp(&lost(*b))).filter(|_| length > 0.0) else { continue };
        let lost = lost(worst);
        if lost > TOLD * length {
            let message = message(lost, length, what, worst.norm());
            if lost > REFUSED * length {
                issues.push(Issue::new(name, message));
            } else {
                warnings.push(Warning::new(Code::RoundOff, format!("\"{name}\""), message));
            }
        }
    }
}

/// Solids that masses cannot tell from others where they stand.
pub fn solids(scene: &Scene, colliders: &[Collider]) -> Vec<Warning> {
    let told = |(thing, solid): (&tumble_interface::scene::Collider, &Collider)| {
        let (center, size) = match &thing.shape {
            Shape::Sphere { center, radius } => (Vector::from(*center), 2.0 * radius),
            Shape::Box { center, size, .. } => (Vector::from(*center), size.iter().copied().fold(f64::INFINITY, f64::min)),
            Shape::Capsule { from, to, radius } => ((Vector::from(*from) + Vector::from(*to)) * 0.5, 2.0 * radius),
            Shape::Plane { .. } | Shape::Floor { .. } => return None,
            _ => {
                let (low, high) = solid.shape.bounds()?;
                ((low + high) * 0.5, (high - low).norm())
            }
        };
        let lost = lost(center);
        let thin = solid.thickness > 0.0 && solid.thickness < size;
        let (length, what, part) = if thin { (solid.thickness, "its thickness", THIN) } else { (size, "its size", TOLD) };
        (lost > part * length)
            .then(|| Warning::new(Code::RoundOff, format!("collider \"{}\"", thing.name), message(lost, length, what, center.norm())))
    };
    scene.collider.iter().zip(colliders).filter_map(told).collect()
}
