//! Contact of surfaces with each other, or the counter of their intersections.

use super::super::self_contact::SelfContact;
use super::super::settings::Settings;
use crate::geometry::Collider;
use crate::state::{Object, State};
use std::sync::Arc;
use tumble_interface::SceneError;
use tumble_interface::check::short;
use tumble_interface::scene;

/// Thickest surfaces that meet, over the longest of their edges.
const WIDEST: f64 = 32.0;

/// Self-contact and the intersection counter of a system, of which at most one is there; `sewn` points count as one.
pub fn surfaces(
    settings: &Settings,
    objects: &[Object],
    sewn: &[[u32; 2]],
    state: &State,
) -> Result<(Option<SelfContact>, Option<SelfContact>), SceneError> {
    let meeting = |words: &scene::SelfContact, solids: &Arc<Vec<Collider>>| SelfContact::new(words, objects, sewn, state, solids);
    let Some(words) = &settings.self_contact else {
        let nothing = scene::SelfContact { thickness: 0.0, friction: 0.0, friction_static: None };
        return Ok((None, settings.counted.then(|| meeting(&nothing, &Arc::default())).flatten()));
    };
    let contact = meeting(words, &settings.colliders);
    let longest = contact.as_ref().map_or(0.0, SelfContact::longest_edge);
    if longest > 0.0 && words.thickness > WIDEST * longest {
        let message = format!(
            "{} m, expected at most {WIDEST} times the longest edge, {} m: everything would be near everything",
            short(words.thickness),
            short(longest)
        );
        return Err(SceneError::one(format!("system \"{}\".self_contact.thickness", settings.name), message));
    }
    Ok((contact, None))
}
