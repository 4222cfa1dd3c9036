//! Forces and extra masses on some masses of a thing.

use super::Site;
use super::pins::{Pinnable, masses_at};
use tumble_interface::scene::{Load, PointMass};

/// Adds the loads and the extra masses of a thing whose pins are in place.
pub fn load(site: &mut Site<'_>, thing: &Pinnable<'_>, loads: &[Load], masses: &[PointMass]) {
    for (i, load) in loads.iter().enumerate() {
        let path = format!("{}.load[{i}]", thing.path);
        match masses_at(site, thing, &load.at) {
            Ok(found) if found.iter().all(|p| site.parts.inverse_mass(p + thing.first) == 0.0) => {
                site.wrong(format!("{path}.at"), "all of these masses are pinned, and feel no force; name others");
            }
            Ok(found) => site.parts.load(format!("{path}.force"), found.iter().map(|p| p + thing.first).collect(), load.force.clone()),
            Err(message) => site.wrong(format!("{path}.at"), message),
        }
    }
    // All shares are those of the thing by itself.
    let mut added = Vec::new();
    for (i, extra) in masses.iter().enumerate() {
        match masses_at(site, thing, &extra.at) {
            Ok(found) => added.extend(shares(site, thing, &found).into_iter().map(|(point, share)| (point, share * extra.mass))),
            Err(message) => site.wrong(format!("{}.point_mass[{i}].at", thing.path), message),
        }
    }
    added.into_iter().for_each(|(point, mass)| site.parts.add_mass(point, mass));
}

/// The points and the share of each in the mass of all.
fn shares(site: &Site<'_>, thing: &Pinnable<'_>, found: &[u32]) -> Vec<(u32, f64)> {
    let all: Vec<(u32, f64)> = found.iter().map(|p| (p + thing.first, site.parts.mass(p + thing.first))).collect();
    let sum: f64 = all.iter().map(|(_, mass)| mass).sum();
    all.into_iter().map(|(point, mass)| (point, mass / sum)).collect()
}
