//! A chain of springs, or a rod, between two points.

use super::Site;
use super::loads::load;
use super::pins::{Pinnable, Pinned, pin};
use crate::geometry::Vector;
use crate::math::functions::{cos, sin};
use crate::math::rotation::from_z_to;
use crate::math::{Quat, bisect};
use crate::systems::dynamics::Times;
use tumble_interface::scene::{Links, Rod, Rope};

/// Adds the masses, and links or rod elements.
pub fn rope(site: &mut Site<'_>, thing: &Rope) {
    let path = format!("rope \"{}\"", thing.name);
    let distance = (Vector::from(thing.to) - Vector::from(thing.from)).norm();
    let length = thing.length.unwrap_or(distance);
    if length == 0.0 {
        return site.wrong(format!("{path}.to"), "the ends coincide; move one of them, or give a length");
    }
    let n = thing.segments;
    site.parts.begin(&thing.name, thing.radius);
    let spacing = length / f64::from(n);
    let places = course(thing.from.into(), thing.to.into(), length, n, site.up);
    let mut first = 0;
    for (i, x) in places.iter().enumerate() {
        let rim = i == 0 || i == n as usize;
        let mass = thing.density * spacing * if rim { 0.5 } else { 1.0 };
        let index = site.parts.point(*x, Vector::default(), mass);
        if i == 0 {
            first = index;
        }
    }
    if let Some(object) = site.parts.object() {
        object.curve = (0..=n).collect();
        let strain = match &thing.rod {
            Some(rod) => rod.break_strain,
            None => thing.links().structural.and_then(|family| family.settings().break_strain),
        };
        object.breaks = strain.map(|strain| spacing * (1.0 + strain));
    }
    let pinnable = Pinnable { path: &path, n: &[n + 1], first, is_lattice: true, clamps: false };
    let pins = pin(site, &pinnable, &thing.pin);
    load(site, &pinnable, &thing.load, &thing.point_mass);
    site.parts.launch(thing.velocity);
    match (&thing.rod, &thing.links) {
        (Some(_), Some(_)) => site.wrong(format!("{path}.links"), "a rod has no links; leave out links or rod"),
        (Some(rod), None) => {
            let ends = [first, first + n].map(|end| Held::of(&pins, end));
            frames(site, thing, rod, &places, first, ends, spacing);
        }
        (None, _) => {
            let links = thing.links();
            if links.shear.is_some() {
                site.wrong(format!("{path}.links.shear"), "a rope has no diagonals; known here: structural, bend");
            }
            chain(site, &links, first, n, spacing);
        }
    }
}

/// Springs by the rest length, which a slack or a taut start does not have between its masses.
fn chain(site: &mut Site<'_>, links: &Links, first: u32, n: u32, spacing: f64) {
    for (family, step) in [(&links.structural, 1), (&links.bend, 2)] {
        let Some(family) = family else { continue };
        for i in 0..(n + 1).saturating_sub(step) {
            site.link_of(family, [first + i, first + i + step], spacing, spacing * f64::from(step));
        }
    }
}

/// A frame per segment, its third axis along the segment, carried on from the first without twist; the first axis of the first is where
/// `bend_side` resists.                                                                                   (rods.8)
fn frames(site: &mut Site<'_>, thing: &Rope, rod: &Rod, places: &[Vector], first: u32, ends: [Held; 2], spacing: f64) {
    let (side, twist) = (rod.bend_side.unwrap_or(rod.bend), rod.twist.unwrap_or(rod.bend));
    if rod.bend == 0.0 && side.max(twist) > 0.0 {
        let what = if twist > 0.0 { "twist" } else { "bending to one side" };
        return site.wrong(format!("rope \"{}\".rod.bend", thing.name), format!("0 N m², expected > 0 N m² for a rod that resists {what}"));
    }
    let Some(start) = first_frame(rod, places[1] - places[0], site.up) else {
        return site.wrong(format!("rope \"{}\".rod.side", thing.name), "expected a direction across the rod, not along it");
    };
    let ratios = [side, twist].map(|k| if rod.bend > 0.0 { (k / rod.bend).sqrt() } else { 0.0 });
    // A round wire of density rho A has rho A r²/4 about its diameter and twice as much about its axis.
    let inertia = rod.inertia.unwrap_or(thing.density * thing.radius * thing.radius / 2.0) * spacing;
    let shear = (rod.shear.unwrap_or(rod.stretch) / rod.stretch).sqrt();
    let n = places.len() - 1;
    let (mut turn, mut before) = (start, 0);
    for i in 0..n {
        let d = (places[i + 1] - places[i]).normalized();
        if i > 0 {
            turn = shortest(turn.axis_z(), d) * turn;
        }
        let frame = site.parts.frame(turn.row(), inertia);
        for (place, here) in [i == 0, i + 1 == n].into_iter().enumerate() {
            if here {
                clamp(site, rod, (&ends[place], place), (frame, inertia, turn), spacing, ratios);
            }
        }
        let k = rod.stretch * spacing;
        site.parts.rod_stretch([first + i as u32, first + i as u32 + 1], frame, [spacing, shear], k, k * rod.damping, rod.break_strain);
        if i > 0 && rod.bend > 0.0 {
            bend(site, rod, [before, frame], false, spacing, ratios);
        }
        before = frame;
    }
}

/// Bend and twist between two frames at a distance of l [m], given in the order of the rod or backwards.
fn bend(site: &mut Site<'_>, rod: &Rod, frames: [u32; 2], backwards: bool, l: f64, [side, twist]: [f64; 2]) {
    let k = rod.bend * l;
    let [x, y, z] = rod.curvature.map(|k| if backwards { -k } else { k });
    site.parts.rod_bend(frames, [2.0 / l, x, y, z, side, twist], k, k * rod.damping);
}

/// The frame of a segment that goes along d: its first axis is the rod's side, or horizontal; `None` if that lies along d. Round rods have no
/// side, and the frame that is nearest to the world's axes.
fn first_frame(rod: &Rod, d: Vector, up: Vector) -> Option<Quat<f64>> {
    let d = d.normalized();
    let upright = from_z_to(d);
    let side = match (rod.side, rod.bend_side) {
        (None, None) => return Some(upright),
        (Some(side), _) => Vector::from(side).normalized(),
        (None, Some(_)) if up.cross(d).norm() > 1e-6 => up.cross(d),
        (None, Some(_)) => up.cross(Vector { x: 1.0, y: 0.0, z: 0.0 }),
    };
    let across = side - d * side.dot(d);
    if across.norm() < 1e-6 {
        return None;
    }
    // About e_z by the angle of which these are cosine and sine.
    let Vector { x, y, .. } = upright.conj().turn(across.normalized());
    let half = Quat { v: Vector { x: 0.0, y: 0.0, z: y }, w: 1.0 + x };
    Some(upright * if half.w > 1e-12 { half.normalized() } else { Quat { v: Vector { x: 0.0, y: 0.0, z: 1.0 }, w: 0.0 } })
}

/// Holds a frame at the very end of the rod, half a segment from that of its last segment: holding the latter itself would
/// clamp the rod half a segment too far along, an error of order 1.    (rods.5)
fn clamp(
    site: &mut Site<'_>,
    rod: &Rod,
    (end, place): (&Held, usize),
    (frame, inertia, turn): (u32, f64, Quat<f64>),
    spacing: f64,
    ratios: [f64; 2],
) {
    let mut held = frame;
    let free = matches!(end, Held::At(times) if times.is_empty());
    if rod.bend > 0.0 && !free {
        // Of a frame that is let go the inertia of half a segment remains.
        held = site.parts.frame(turn.row(), if matches!(end, Held::Always) { 1.0 } else { inertia / 2.0 });
        bend(site, rod, [held, frame], place == 1, spacing / 2.0, ratios);
    }
    match end {
        Held::Always => site.parts.clamp_frame(held),
        Held::At(times) => {
            // Where the natural curvature over half a segment asks for nothing.
            let sign = if place == 0 { -spacing / 4.0 } else { spacing / 4.0 };
            let v = Vector::from(rod.curvature) * sign;
            let v = if held == frame { Vector::default() } else { v };
            let turn = Quat { v, w: (1.0 - v.norm_sq()).max(0.0).sqrt() }.normalized();
            times.iter().for_each(|times| site.parts.hold_frame(held, (frame, turn), *times));
        }
    }
}

/// When an end is held.
enum Held {
    Always,
    At(Vec<Times>),
}

impl Held {
    fn of(pins: &Pinned, point: u32) -> Self {
        if pins.always.contains(&point) {
            return Self::Always;
        }
        Self::At(pins.passing.iter().filter(|(held, _)| *held == point).map(|(_, times)| *times).collect())
    }
}

/// The shortest rotation from one unit vector to another.
pub(super) fn shortest(a: Vector, b: Vector) -> Quat<f64> {
    let q = Quat { v: a.cross(b), w: 1.0 + a.dot(b) };
    if q.w > 1e-12 { q.normalized() } else { from_z_to(b) * from_z_to(a).conj() }
}

/// Where the masses start: on a straight line, or, if the rope is longer than the distance of its ends, on a circular arc
/// that hangs down, with n equal chords of length/n: c/L = sin(phi)/(n sin(phi/n)) for half the opening angle phi.
fn course(from: Vector, to: Vector, length: f64, n: u32, up: Vector) -> Vec<Vector> {
    let chord = to - from;
    let (c, count) = (chord.norm(), f64::from(n));
    let straight = |i: u32| from + chord * (f64::from(i) / count);
    if length <= c * (1.0 + 1e-12) || n < 2 {
        return (0..=n).map(straight).collect();
    }
    let along = if c > 0.0 { chord.normalized() } else { any_across(up) };
    let across = up - along * up.dot(along);
    let down = -(if across.norm() > 1e-6 { across.normalized() } else { any_across(along) });
    let (low, high) = bisect((0.0, std::f64::consts::PI), 100, |phi| sin(phi) / (count * sin(phi / count)) > c / length);
    let phi = 0.5 * (low + high);
    let radius = length / (2.0 * count * sin(phi / count));
    let middle = from + chord * 0.5;
    let on_arc = |i: u32| {
        let angle = phi * (2.0 * f64::from(i) / count - 1.0);
        middle + along * (radius * sin(angle)) + down * (radius * (cos(angle) - cos(phi)))
    };
    // The ends are met exactly.
    (0..=n)
        .map(|i| {
            if i == 0 {
                from
            } else if i == n {
                to
            } else {
                on_arc(i)
            }
        })
        .collect()
}

/// A horizontal direction across v, if there is one.
fn any_across(v: Vector) -> Vector {
    let x = Vector { x: 1.0, y: 0.0, z: 0.0 };
    let across = x - v * v.dot(x);
    if across.norm() > 1e-6 { across.normalized() } else { Vector { x: 0.0, y: 1.0, z: 0.0 } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slack_rope_starts_with_segments_of_rest_length() {
        let up = Vector { x: 0.0, y: 0.0, z: 1.0 };
        for (to, length) in [([1.0, 0.0, 0.0], 1.5), ([0.0, 0.0, -1.0], 1.2), ([0.0; 3], 2.0), ([0.3, 0.4, 0.1], 7.0)] {
            let places = course(Vector::default(), to.into(), length, 20, up);
            assert_eq!(places[20], to.into());
            for w in places.windows(2) {
                let l = (w[1] - w[0]).norm();
                assert!((l - length / 20.0).abs() < 1e-9, "{to:?} {l}");
            }
            assert!(places.iter().all(|p| p.z < 1e-9 || to[2] != 0.0));
        }
        let taut = course(Vector::default(), [3.0, 0.0, 0.0].into(), 2.0, 4, up);
        assert!((taut[1].x - 0.75).abs() < 1e-15);
    }

    #[test]
    fn the_first_axis_of_a_strip_is_its_side() {
        let unit = |x: f64, y: f64, z: f64| Vector { x, y, z };
        let rod = |side: Option<[f64; 3]>, bend_side| Rod {
            stretch: 1.0,
            shear: None,
            bend: 1.0,
            bend_side,
            side,
            twist: None,
            curvature: [0.0; 3],
            inertia: None,
            damping: 0.0,
            break_strain: None,
        };
        let axis = |side, d| {
            let q = first_frame(&rod(side, Some(2.0)), d, unit(0.0, 0.0, 1.0)).unwrap_or_else(|| panic!("{d:?}"));
            assert!((q.axis_z() - d.normalized()).norm() < 1e-14 && (q.v.norm_sq() + q.w * q.w - 1.0).abs() < 1e-14);
            q.turn(unit(1.0, 0.0, 0.0))
        };
        // Flat unless it is told otherwise, also where the rod is vertical; upright; and what is given is made perpendicular.
        for d in [unit(2.0, 0.0, 0.0), unit(-1.0, 0.5, 0.3), unit(0.0, 0.0, 1.0), unit(0.0, 0.0, -1.0)] {
            assert!(axis(None, d).z.abs() < 1e-14);
        }
        assert!((axis(None, unit(0.0, 0.0, -1.0)).y.abs() - 1.0).abs() < 1e-14);
        assert!((axis(Some([0.0, 0.0, 3.0]), unit(1.0, 0.0, 0.0)) - unit(0.0, 0.0, 1.0)).norm() < 1e-14);
        assert!((axis(Some([1.0, 1.0, 0.0]), unit(1.0, 0.0, 0.0)) - unit(0.0, 1.0, 0.0)).norm() < 1e-14);
        // The one that is opposite to that of the nearest frame.
        assert!((axis(Some([-1.0, 0.0, 0.0]), unit(0.0, 0.0, 1.0)) - unit(-1.0, 0.0, 0.0)).norm() < 1e-14);
        assert!(first_frame(&rod(Some([2.0, 0.0, 0.0]), None), unit(-1.0, 0.0, 0.0), unit(0.0, 0.0, 1.0)).is_none());
    }
}
