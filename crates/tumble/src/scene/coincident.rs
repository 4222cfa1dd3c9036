//! Masses that start at one place where a force between them needs a direction: by symmetry it stays zero for ever.

use super::coupling::Link;
use crate::math::Real;
use crate::systems::dynamics::Parts;
use std::collections::HashMap;
use std::ops::Range;
use tumble_interface::Warning;
use tumble_interface::scene::Force as Words;
use tumble_interface::warning::Code;

/// A force between masses at `path` that cannot part some of these objects, or one of them from one of the others.
pub fn forces(parts: &Parts, path: &str, force: &Words, on: &[usize], others: Option<&[usize]>) -> Option<Warning> {
    let charged = match force {
        Words::Electrostatics { .. } => true,
        Words::LennardJones { .. } | Words::Repulsion { .. } => false,
        _ => return None,
    };
    let charges = parts.charges();
    let ranges: Vec<(&str, Range<usize>)> = parts.ranges().collect();
    let rows = |objects: &[usize]| -> Vec<usize> {
        let all = objects.iter().flat_map(|o| ranges[*o].1.clone());
        all.filter(|i| !charged || charges.get(&(*i as u32)).is_some_and(|q| *q != 0.0)).collect()
    };
    let (sources, felt) = (rows(others.unwrap_or(on)), rows(on));
    let mut first: HashMap<[u64; 3], usize> = HashMap::new();
    for i in sources.iter().rev() {
        first.insert(place(parts, *i), *i);
    }
    let pairs: Vec<[usize; 2]> = felt.iter().filter_map(|i| first.get(&place(parts, *i)).filter(|j| *j != i).map(|j| [*j, *i])).collect();
    let [a, b] = *pairs.first()?;
    let more = if pairs.len() > 1 { format!(", and {} pairs more", pairs.len() - 1) } else { String::new() };
    let message = format!(
        "{} and {} start at one place{more}: the force between them has no direction and stays zero for ever; move one of them",
        named(&ranges, a),
        named(&ranges, b)
    );
    Some(Warning::new(Code::Coincident, path, message))
}

/// Springs with a rest length whose ends start at one place, the first of each object.
pub fn springs(parts: &Parts) -> Vec<Warning> {
    let ranges: Vec<(&str, Range<usize>)> = parts.ranges().collect();
    let mut found: Vec<(&str, [usize; 2], usize)> = Vec::new();
    for [a, b] in parts.springs_with_rest_length().map(|ends| ends.map(|i| i as usize)) {
        if place(parts, a) != place(parts, b) {
            continue;
        }
        let name = ranges.iter().find(|(_, range)| range.contains(&a)).map_or("", |(name, _)| name);
        match found.iter_mut().find(|(known, ..)| *known == name) {
            Some((_, _, count)) => *count += 1,
            None => found.push((name, [a, b], 1)),
        }
    }
    let told = |(name, [a, b], count): (&str, [usize; 2], usize)| {
        let more = if count > 1 { format!(", and so do those of {} more", count - 1) } else { String::new() };
        let message = format!(
            "the ends of a spring with a rest length, {} and {}, start at one place{more}: it has no direction and pushes nothing, for ever; move one \
             of them, or set its rest_length to 0",
            named(&ranges, a),
            named(&ranges, b)
        );
        Warning::new(Code::Coincident, format!("\"{name}\""), message)
    };
    found.into_iter().map(told).collect()
}

/// An anchor between systems with a rest length whose ends start at one place.
pub fn anchor(masses: &[Parts], anchor: &Link) -> Option<Warning> {
    let [(s, a), (t, b)] = anchor.ends;
    let one_place = if anchor.on_body { anchor.distance == 0.0 } else { place(&masses[s], a as usize) == place(&masses[t], b as usize) };
    let met = s != t && anchor.rest_length.value(0.0) > 0.0 && one_place;
    let message =
        "its ends start at one place: it has no direction and pushes nothing, for ever; move one of them, or set rest_length to 0";
    met.then(|| Warning::new(Code::Coincident, format!("anchor \"{}\"", anchor.name), message))
}

/// The place of a mass as the engine stores it.
fn place(parts: &Parts, i: usize) -> [u64; 3] {
    <[f64; 3]>::from(parts.position(i as u32)).map(|x| f64::from(x as Real + 0.0).to_bits())
}

fn named(ranges: &[(&str, Range<usize>)], i: usize) -> String {
    let of = ranges.iter().find(|(_, range)| range.contains(&i));
    of.map_or(String::new(), |(name, range)| format!("mass {} of \"{name}\"", i - range.start))
}
