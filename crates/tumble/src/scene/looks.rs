//! How the objects of a scene are drawn.

use super::methods::{resolve, rules};
use crate::geometry::Vector;
use crate::recipes::named;
use tumble_interface::Scene;
use tumble_interface::looks::{Colors, Form, GROUND, Look, Looks, SOLID};
use tumble_interface::scene::{Collider, Shape};

/// What is drawn of a scene: its objects in the order of their columns, colliders last, and its anchors.
pub fn looks(scene: &Scene) -> Looks {
    let scene = &resolve(scene.clone());
    let mut colors = Colors::default();
    let moved = scene.system.iter().flat_map(|plan| rules(plan.method).looks(scene, plan, &mut colors));
    let mut objects: Vec<Look> = moved.collect();
    objects.extend(scene.collider.iter().map(solid));
    // One without stiffness and damping does nothing.
    let pulling = scene.anchor.iter().filter(|anchor| anchor.stiffness.constant() != Some(0.0) || anchor.damping > 0.0);
    let ends = pulling.filter_map(|anchor| Some([named(&anchor.between[0])?, named(&anchor.between[1])?]));
    let anchors = ends.map(|ends| ends.map(|(name, index)| (name.to_string(), index))).collect();
    Looks { objects, anchors }
}

fn solid(thing: &Collider) -> Look {
    let plane = match &thing.shape {
        Shape::Floor { height } => Some([[0.0, 0.0, *height], [0.0, 0.0, 1.0]]),
        Shape::Plane { point, normal } => {
            let length = Vector::from(*normal).norm();
            Some([*point, normal.map(|c| c / length)])
        }
        _ => None,
    };
    let form = match plane {
        Some(_) => Form::Ground,
        None if thing.inside => Form::Container,
        None => Form::Solid,
    };
    let color = thing.color.unwrap_or(if plane.is_some() { GROUND } else { SOLID });
    Look { plane, ..Look::new(&thing.name, form, color) }
}
