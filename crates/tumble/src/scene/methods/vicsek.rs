//! The model of Vicsek.

use super::{MethodRules, is_in, particles, words_of_masses};
use crate::geometry::Vector;
use crate::scene::Assets;
use crate::scene::build::Builder;
use crate::state::Object;
use crate::system::System;
use crate::systems::vicsek::Swarm;
use tumble_interface::Issue;
use tumble_interface::looks::{Colors, Look};
use tumble_interface::scene::{Method, Particles, Plane, Scene, System as Plan};

pub struct Rules;

impl MethodRules for Rules {
    fn words(&self) -> &'static [Method] {
        &[Method::Vicsek]
    }

    fn kinds(&self) -> &'static [&'static str] {
        &["particles"]
    }

    fn massless(&self) -> Option<&'static str> {
        Some("particles of a vicsek system")
    }

    fn own_scheme(&self) -> Option<&'static str> {
        Some("the model of Vicsek is a map and has no integrator")
    }

    fn noun(&self) -> &'static str {
        "particle"
    }

    fn theory(&self) -> &'static [(&'static str, &'static [&'static str])] {
        &[("flocks", &["flocks.1"])]
    }

    fn check(&self, scene: &Scene, issues: &mut Vec<Issue>) {
        for plan in &scene.system {
            let path = format!("system \"{}\"", plan.name);
            let own = plan.method == Method::Vicsek;
            if own && scene.dimension != 2 {
                let message = format!("{}, but system \"{}\" moves in a plane; set dimension = 2", scene.dimension, plan.name);
                issues.push(Issue::new("dimension", message));
            }
            match &plan.vicsek {
                None if own => issues.push(Issue::new(format!("{path}.vicsek"), "missing, expected side, radius, speed and noise")),
                Some(words) if own && 2.0 * words.radius > words.side => {
                    let message = format!("{} m, expected at most half the side, {} m", words.radius, 0.5 * words.side);
                    issues.push(Issue::new(format!("{path}.vicsek.radius"), message));
                }
                Some(_) if !own => {
                    let message = format!("given with method \"{}\"; leave it out, or set method = \"vicsek\"", plan.method.name());
                    issues.push(Issue::new(format!("{path}.vicsek"), message));
                }
                _ => {}
            }
        }
    }

    fn looks(&self, scene: &Scene, plan: &Plan, colors: &mut Colors) -> Vec<Look> {
        let leap = plan.vicsek.as_ref().map(|words| 0.5 * words.side);
        let own = scene.particles.iter().filter(|t| is_in(&t.system, plan));
        own.map(|t| Look { leap, ..particles(t, colors) }).collect()
    }

    /// Particles are counted as masses.
    fn memory(&self, _scene: &Scene, _assets: &Assets) -> f64 {
        0.0
    }

    fn build(&self, builder: &mut Builder<'_>, index: usize) -> Option<Box<dyn System>> {
        let (scene, plan) = (builder.scene, builder.plan(index));
        let (mut points, mut all) = (Vec::new(), Vec::new());
        for thing in scene.particles.iter().filter(|t| is_in(&t.system, plan)) {
            let first = points.len();
            points.extend(walkers(thing, &mut builder.issues));
            all.push(Object { name: thing.name.clone(), points: first..points.len(), radius: thing.radius, ..Object::default() });
        }
        let plane = if scene.plane == Plane::Xz { [0, 2] } else { [0, 1] };
        Some(Box::new(Swarm::new(plan, plan.vicsek.as_ref()?, scene.seed, plane, &points, all)))
    }
}

/// Positions and velocities of an object; what only masses can have is wrong.
fn walkers(thing: &Particles, issues: &mut Vec<Issue>) -> Vec<[Vector; 2]> {
    let n = thing.position.len();
    for key in words_of_masses(thing) {
        let message = "particles of a vicsek system have a direction and no mass; leave it out, or use a dynamics system";
        issues.push(Issue::new(format!("particles \"{}\".{key}", thing.name), message));
    }
    if !matches!(thing.velocity.len(), 0 | 1) && thing.velocity.len() != n {
        let message = format!("{} velocities for {n} positions, expected none, one, or {n}", thing.velocity.len());
        issues.push(Issue::new(format!("particles \"{}\".velocity", thing.name), message));
    }
    let velocity = |i: usize| thing.velocity.get(i).or(thing.velocity.first()).copied().unwrap_or_default();
    thing.position.iter().enumerate().map(|(i, x)| [Vector::from(*x), Vector::from(velocity(i))]).collect()
}
