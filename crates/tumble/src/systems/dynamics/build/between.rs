//! Forces between masses as batches.

use super::super::settings::Settings;
use crate::elements::Batch;
use crate::forces::{Attractor, Cohesion, DirectSum, Flock, Goal, Habits, Halos, LennardJones, Near, Repulsion, Viscosity};
use crate::math::functions;
use crate::state::Masses;
use std::ops::Range;
use tumble_interface::scene::Force as Words;

/// The batches of a force between masses.
pub fn between(
    words: Words,
    on: Vec<Range<usize>>,
    others: Option<Vec<Range<usize>>>,
    masses: &Masses,
    halos: &[(u32, f64)],
    settings: &Settings,
) -> Vec<Box<dyn Batch>> {
    vec![match words {
        Words::Gravitation { constant, softening, .. } => {
            let attractor = Attractor::Mass(constant);
            let points: Box<dyn Batch> = Box::new(DirectSum::new(attractor, softening, settings.native, halos, on.clone(), masses));
            if halos.is_empty() {
                return vec![points];
            }
            return vec![Box::new(Halos::new(constant, softening, halos, &on, masses)), points];
        }
        Words::Electrostatics { constant, softening, .. } => {
            Box::new(DirectSum::new(Attractor::Charge(-constant), softening, settings.native, &[], on, masses))
        }
        Words::LennardJones { epsilon, sigma, cutoff, smooth, .. } => {
            Box::new(Near::new(LennardJones::new(epsilon, sigma, cutoff.unwrap_or(2.5 * sigma), smooth), on, others))
        }
        Words::Repulsion { stiffness, distance, exponent, .. } => {
            Box::new(Near::new(Repulsion { stiffness, distance, exponent }, on, others))
        }
        Words::Cohesion { strength, radius, .. } => Box::new(Near::new(Cohesion { strength, radius }, on, others)),
        Words::Viscosity { coefficient, radius, central, .. } => {
            Box::new(Near::new(Viscosity { coefficient, radius, central }, on, others))
        }
        Words::Flock {
            radius,
            nearest,
            view,
            cohesion,
            alignment,
            separation,
            spacing,
            speed,
            propulsion,
            max_acceleration,
            goal,
            avoidance,
            clearance,
            fear,
            fear_radius,
            chase,
            predator_speed,
            ..
        } => {
            let habits = Habits {
                radius,
                nearest: nearest.unwrap_or(0) as usize,
                view: if view < 360.0 { functions::cos((0.5 * view).to_radians()) } else { -2.0 },
                cohesion,
                alignment,
                separation,
                spacing: spacing.unwrap_or(0.5 * radius),
                speed,
                propulsion,
                limit: max_acceleration.unwrap_or(0.0),
                goals: goal.into_iter().map(|g| Goal { point: g.point.into(), strength: g.strength }).collect(),
                avoidance,
                clearance: clearance.unwrap_or(radius),
                fear,
                fear_radius: fear_radius.unwrap_or(3.0 * radius),
                chase,
                predator_speed: predator_speed.unwrap_or(speed),
            };
            Box::new(Flock::new(habits, on, others.unwrap_or_default(), masses, settings.colliders.clone()))
        }
        // Forces on each mass by itself, and on surfaces.
        _ => return Vec::new(),
    }]
}
