//! Which masses a pin means.

use super::Site;
use crate::geometry::{Carrier, Collider, Vector};
use crate::systems::dynamics::Times;
use std::cell::Cell;
use tumble_interface::check::plain;
use tumble_interface::scene::{Follow, Pin, Place, Region, Within};

/// What a thing offers to pin.
pub struct Pinnable<'a> {
    /// Where it stands in the scene: `sheet "flag"`.
    pub path: &'a str,
    /// Masses along each of its directions; a single number for a plain list.
    pub n: &'a [u32],
    /// First mass.
    pub first: u32,
    /// Whether it has a start and an end, corners and edges, or is only a list.
    pub is_lattice: bool,
    /// Whether it is a surface whose slope a pin can hold.
    pub clamps: bool,
}

/// The masses that pins hold for ever, in order, each once; those that they hold for some time are noted, with the times.
pub struct Pinned {
    /// For ever.
    pub always: Vec<u32>,
    /// For some time.
    pub passing: Vec<(u32, Times)>,
    /// Where the slope is held, too.
    pub clamps: Vec<Clamp>,
}

/// Masses at which a surface keeps its slope.
pub struct Clamp {
    /// The pin's place in the scene.
    pub path: String,
    /// The points.
    pub points: Vec<u32>,
    /// The collider that carries them, counted from the first, and its bone.
    pub carrier: Option<(usize, Option<usize>)>,
    /// Whether a slope is held.
    used: Cell<bool>,
}

/// Holds the masses that the pins mean.
pub fn pin(site: &mut Site<'_>, thing: &Pinnable<'_>, pins: &[Pin]) -> Pinned {
    let mut all = Pinned { always: Vec::new(), passing: Vec::new(), clamps: Vec::new() };
    let mut following = Vec::new();
    for (i, pin) in pins.iter().enumerate() {
        let (found, follow, times) = match pin {
            Pin::Words(words) => (in_words(thing, words), None, Ok(None)),
            Pin::Region(region) => (in_table(site, thing, region), region.follow.as_ref(), times(region)),
        };
        // What is wrong with a collider is told elsewhere.
        let carrier = follow.zip(site.solids).map(|(follow, solids)| carrier(solids, follow)).transpose();
        match found.and_then(|found| Ok((found, carrier?, times?))) {
            Ok((found, carrier, times)) => {
                if let Pin::Region(Region { clamp: true, .. }) = pin {
                    let path = format!("{}.pin[{i}].clamp", thing.path);
                    match (thing.clamps, times) {
                        (true, None) => {
                            let points = found.iter().map(|p| p + thing.first).collect();
                            all.clamps.push(Clamp { path, points, carrier, used: Cell::new(false) });
                        }
                        (true, Some(_)) => site.wrong(path, "a slope is held for the whole run; leave out from and until"),
                        (false, _) => site.wrong(
                            path,
                            "only a sheet, net or cloth that has hinge, isometric or fabric, and does not tear, has a slope to hold; leave it out",
                        ),
                    }
                }
                let found = found.iter().map(|p| p + thing.first);
                match times {
                    None => all.always.extend(found.clone()),
                    Some(times) => all.passing.extend(found.clone().map(|point| (point, times))),
                }
                let Some((solid, bone)) = carrier else { continue };
                for point in found {
                    let carrier = nearest(site.solids, (solid, bone), site.parts.position(point));
                    following.push((point, solid, carrier, times));
                }
            }
            Err(message) => site.wrong(format!("{}.pin[{i}]", thing.path), message),
        }
    }
    all.always.sort_unstable();
    all.always.dedup();
    for clamp in all.clamps.iter().filter(|clamp| clamp.carrier.is_none()) {
        if following.iter().any(|(point, ..)| clamp.points.binary_search(point).is_ok()) {
            let message =
                "another pin lets some of these masses follow a collider; put its follow into this table, so that the slope goes along";
            site.wrong(clamp.path.as_str(), message);
        }
    }
    all.always.iter().for_each(|point| site.parts.pin(*point));
    all.passing.retain(|(point, _)| all.always.binary_search(point).is_err());
    all.passing.iter().for_each(|(point, times)| site.parts.hold(*point, *times));
    for (point, solid, carrier, times) in following {
        // What is held for ever follows for ever, or not at all.
        if times.is_none() || all.always.binary_search(&point).is_err() {
            site.parts.follow(point, solid, carrier, times.unwrap_or(Times::ALWAYS));
        }
    }
    all
}

/// What of a collider carries a point at x [m]: the bone, or what is nearest.
fn nearest(solids: Option<&[Collider]>, (solid, bone): (usize, Option<usize>), x: Vector) -> Carrier {
    bone.map_or_else(|| solids.map_or(Carrier::Whole, |solids| solids[solid].carrier(x)), Carrier::Bone)
}

impl Clamp {
    /// The clamp of an edge of the rim, if its ends are held by one or by two.
    pub fn of_edge(clamps: &[Self], ends: [u32; 2]) -> Option<&Self> {
        let holds = |clamp: &&Self, point: u32| clamp.points.binary_search(&point).is_ok();
        let all: Vec<&Self> = clamps.iter().filter(|clamp| ends.iter().any(|end| holds(clamp, *end))).collect();
        if !ends.iter().all(|end| all.iter().any(|clamp| holds(clamp, *end))) {
            return None;
        }
        all.iter().for_each(|clamp| clamp.used.set(true));
        all.iter().find(|clamp| ends.iter().all(|end| holds(clamp, *end))).or(all.first()).copied()
    }

    /// Whether it has an edge of the rim; told if not.
    pub fn check(&self, site: &mut Site<'_>) {
        if !self.used.get() {
            site.wrong(self.path.as_str(), "no edge of the rim lies between these masses, so there is no slope to hold; leave it out");
        }
    }

    /// A point that is held, or carried, at x [m]: what it lies beside keeps its slope.
    pub fn ghost(&self, site: &mut Site<'_>, x: Vector) -> u32 {
        let carrier = self.carrier.map(|(solid, bone)| (solid, nearest(site.solids, (solid, bone), x)));
        site.parts.ghost(x, carrier)
    }
}

/// When a region is held, if not always.
fn times(region: &Region) -> Result<Option<Times>, String> {
    let times = Times { from: region.from.unwrap_or(0.0), until: region.until.unwrap_or(f64::INFINITY) };
    if times.until <= times.from {
        return Err(format!("held from {} s until {} s, expected an end after the start", plain(times.from), plain(times.until)));
    }
    Ok((times != Times::ALWAYS).then_some(times))
}

/// The collider that is followed, counted from the first, and its bone.
fn carrier(solids: &[Collider], follow: &Follow) -> Result<(usize, Option<usize>), String> {
    let Some(solid) = solids.iter().position(|solid| solid.name == follow.collider) else {
        let known: Vec<&str> = solids.iter().map(|solid| solid.name.as_str()).collect();
        return Err(format!("there is no collider \"{}\" to follow; known are {}", follow.collider, known.join(", ")));
    };
    let Some(bone) = &follow.bone else { return Ok((solid, None)) };
    let collider = &solids[solid];
    match collider.bone(bone) {
        Some(bone) => Ok((solid, Some(bone))),
        None if collider.bones().is_empty() => Err(format!("collider \"{}\" has no bones; leave out bone", follow.collider)),
        None => Err(format!("collider \"{}\" has no bone \"{bone}\"; known are {}", follow.collider, collider.bones().join(", "))),
    }
}

fn in_table(site: &Site<'_>, thing: &Pinnable<'_>, region: &Region) -> Result<Vec<u32>, String> {
    let (center, radius) = match (region.center, region.radius, &region.which) {
        (Some(center), Some(radius), None) => (center, radius),
        (None, None, Some(words)) => return in_words(thing, words),
        _ => return Err("expected center and radius, or which".into()),
    };
    within(site, thing, center, radius)
}

/// The masses of a place, counted from the first of the thing.
pub fn masses_at(site: &Site<'_>, thing: &Pinnable<'_>, place: &Place) -> Result<Vec<u32>, String> {
    match place {
        Place::Words(words) => in_words(thing, words),
        Place::Within(Within { center, radius }) => within(site, thing, *center, *radius),
    }
}

fn within(site: &Site<'_>, thing: &Pinnable<'_>, center: [f64; 3], radius: f64) -> Result<Vec<u32>, String> {
    let count: u32 = thing.n.iter().product();
    let distance = |i: u32| (site.parts.position(thing.first + i) - Vector::from(center)).norm();
    let found: Vec<u32> = (0..count).filter(|i| distance(*i) <= radius).collect();
    if found.is_empty() {
        let nearest = (0..count).map(distance).fold(f64::INFINITY, f64::min);
        return Err(format!("no mass lies within {radius} m; the nearest is {nearest:.4} m away"));
    }
    Ok(found)
}

fn in_words(thing: &Pinnable<'_>, words: &str) -> Result<Vec<u32>, String> {
    let mut parts = words.split_whitespace();
    let (word, rest) = (parts.next().unwrap_or(""), parts.collect::<Vec<_>>());
    let n = thing.n;
    let count: u32 = n.iter().product();
    match word {
        "all" if rest.is_empty() => Ok((0..count).collect()),
        "start" if n.len() == 1 && thing.is_lattice && rest.is_empty() => Ok(vec![0]),
        "end" if n.len() == 1 && thing.is_lattice && rest.is_empty() => Ok(vec![count - 1]),
        "vertex" => {
            let node = whole_numbers(&rest, n.len())?;
            match (0..n.len()).find(|a| node[*a] >= n[*a]) {
                Some(_) if n.len() == 1 => Err(format!("there is no {words}; the last one is vertex {}", count.saturating_sub(1))),
                Some(a) => Err(format!("there is no {words}: index {} is {}, the last one is {}", a + 1, node[a], n[a] - 1)),
                None => Ok(vec![index(n, &node)]),
            }
        }
        "corner" if n.len() > 1 => {
            let corner = whole_numbers(&rest, n.len())?;
            match corner.iter().any(|c| *c > 1) {
                true => Err(format!("there is no {words}; a corner has a 0 or a 1 for each direction")),
                false => Ok(vec![index(n, &corner.iter().zip(n).map(|(c, n)| c * (n - 1)).collect::<Vec<_>>())]),
            }
        }
        "edge" | "face" if (word == "edge" && n.len() == 2) || (word == "face" && n.len() == 3) => side(n, word, &rest),
        _ => Err(format!("\"{words}\" is not known here; known are {}, or a table with center and radius", known(thing))),
    }
}

/// All masses on the low or the high side: `x-`, `z+`.
fn side(n: &[u32], word: &str, rest: &[&str]) -> Result<Vec<u32>, String> {
    let axes = &["x", "y", "z"][..n.len()];
    let found = match rest {
        [side] => {
            axes.iter().position(|a| side.strip_prefix(a).is_some_and(|sign| sign == "-" || sign == "+")).map(|a| (a, side.ends_with('+')))
        }
        _ => None,
    };
    let Some((axis, high)) = found else {
        let sides: Vec<String> = axes.iter().flat_map(|a| [format!("{a}-"), format!("{a}+")]).collect();
        return Err(format!("{word} takes one of {}", sides.join(", ")));
    };
    let level = if high { n[axis] - 1 } else { 0 };
    let stride: u32 = n[..axis].iter().product();
    Ok((0..n.iter().product()).filter(|i| i / stride % n[axis] == level).collect())
}

fn whole_numbers(words: &[&str], count: usize) -> Result<Vec<u32>, String> {
    let numbers: Vec<u32> = words.iter().filter_map(|w| w.parse().ok()).collect();
    if numbers.len() != words.len() || numbers.len() != count {
        return Err(format!("expected {count} whole number{} after the word", if count == 1 { "" } else { "s" }));
    }
    Ok(numbers)
}

fn index(n: &[u32], node: &[u32]) -> u32 {
    node.iter().zip(n).rev().fold(0, |sum, (i, n)| sum * n + i)
}

fn known(thing: &Pinnable<'_>) -> &'static str {
    match (thing.is_lattice, thing.n.len()) {
        (false, _) => "\"all\", \"vertex 3\"",
        (_, 1) => "\"all\", \"start\", \"end\", \"vertex 3\"",
        (_, 2) => "\"all\", \"corner 0 1\", \"vertex 3 4\", \"edge x-\"",
        _ => "\"all\", \"corner 0 1 0\", \"vertex 3 4 5\", \"face z+\"",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(n: &[u32], words: &str) -> Result<Vec<u32>, String> {
        in_words(&Pinnable { path: "", n, first: 0, is_lattice: true, clamps: false }, words)
    }

    #[test]
    fn words_mean_masses() {
        assert_eq!(found(&[3, 2], "corner 1 0").unwrap(), [2]);
        assert_eq!(found(&[3, 2], "vertex 1 1").unwrap(), [4]);
        assert_eq!(found(&[3, 2], "edge x+").unwrap(), [2, 5]);
        assert_eq!(found(&[3, 2], "edge y-").unwrap(), [0, 1, 2]);
        assert_eq!(found(&[2, 2, 3], "face z+").unwrap(), [8, 9, 10, 11]);
        assert_eq!(found(&[4], "end").unwrap(), [3]);
        for (n, words, part) in [
            (&[3, 2][..], "corner 2 0", "0 or a 1"),
            (&[3, 2], "vertex 3 0", "the last one is 2"),
            (&[3, 2], "vertex 1", "2 whole numbers"),
            (&[3, 2], "edge z-", "x-, x+, y-, y+"),
            (&[3, 2], "start", "not known here"),
            (&[4], "", "not known here"),
        ] {
            let message = found(n, words).unwrap_err();
            assert!(message.contains(part), "{words}: {message}");
        }
    }
}
