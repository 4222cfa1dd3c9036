//! Free masses, and springs between chosen ones.

use super::Site;
use super::pins::{Pinnable, pinned};
use crate::geometry::Vector;
use crate::systems::dynamics::SpringPart;
use tumble_interface::scene::Particles;

/// Adds the masses and springs.
pub fn particles(site: &mut Site<'_>, thing: &Particles) {
    let path = format!("particles \"{}\"", thing.name);
    let n = thing.position.len();
    site.parts.begin(&thing.name, thing.radius);
    if !matches!(thing.velocity.len(), 0 | 1) && thing.velocity.len() != n {
        site.wrong(
            format!("{path}.velocity"),
            format!("{} velocities for {n} positions, expected none, one, or {n}", thing.velocity.len()),
        );
    }
    if thing.mass.len() != 1 && thing.mass.len() != n {
        site.wrong(format!("{path}.mass"), format!("{} masses for {n} positions, expected one or {n}", thing.mass.len()));
    }
    if thing.charge.len() > 1 && thing.charge.len() != n {
        site.wrong(format!("{path}.charge"), format!("{} charges for {n} positions, expected none, one or {n}", thing.charge.len()));
    }
    let one = |list: &[f64], i: usize| *list.get(i).or(list.first()).unwrap_or(&1.0);
    let mut first = 0;
    for (i, x) in thing.position.iter().enumerate() {
        let v = thing.velocity.get(i).or(thing.velocity.first()).copied().unwrap_or_default();
        let index = site.parts.point(Vector::from(*x), Vector::from(v), one(&thing.mass, i));
        if let Some(charge) = thing.charge.get(i).or(thing.charge.first()) {
            site.parts.charge(index, *charge);
        }
        if i == 0 {
            first = index;
        }
    }
    for pin in pinned(site, &Pinnable { path: &path, n: &[n as u32], first, is_lattice: false }, &thing.pin) {
        site.parts.pin(pin);
    }
    for (i, spring) in thing.spring.iter().enumerate() {
        let [a, b] = spring.between;
        if a.max(b) as usize >= n || a == b {
            let message = format!("[{a}, {b}], expected two different indices below {n}");
            site.wrong(format!("{path}.spring[{i}].between"), message);
            continue;
        }
        let ends = [first + a, first + b];
        let distance = (site.parts.position(ends[1]) - site.parts.position(ends[0])).norm();
        let rest = spring.rest_length.unwrap_or(distance);
        if rest == 0.0 && (spring.hardening > 0.0 || spring.tension_only || spring.break_strain.is_some()) {
            site.wrong(format!("{path}.spring[{i}]"), "hardening, tension_only and break_strain need a rest length above 0");
            continue;
        }
        let (stiffness, damping) = (spring.stiffness, spring.damping);
        site.parts.spring(SpringPart {
            ends,
            stiffness,
            damping,
            rest,
            hardening: spring.hardening,
            tension_only: spring.tension_only,
            break_strain: spring.break_strain,
        });
    }
}

/// Points that a flow carries.
pub struct Tracer {
    /// Where they start [m].
    pub x: Vec<Vector>,
}

/// The points of an object of tracers; what only masses can have is wrong.
pub fn tracers(thing: &Particles, wrong: &mut impl FnMut(String, &str)) -> Tracer {
    let mut refuse = |key: &str, given: bool| {
        if given {
            wrong(
                format!("particles \"{}\".{key}", thing.name),
                "tracers have no mass and go with the flow; leave it out, or use a dynamics system",
            );
        }
    };
    refuse("velocity", !thing.velocity.is_empty());
    refuse("mass", thing.mass != [1.0]);
    refuse("charge", !thing.charge.is_empty());
    refuse("pin", !thing.pin.is_empty());
    refuse("spring", !thing.spring.is_empty());
    Tracer { x: thing.position.iter().map(|x| Vector::from(*x)).collect() }
}
