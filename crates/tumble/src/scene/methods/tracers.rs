//! Tracers: massless particles that velocity fields carry.

use super::{MethodRules, emitted, is_in, late_carriers, particles, present, words_of_masses};
use crate::geometry::Vector;
use crate::recipes::Site;
use crate::scene::Assets;
use crate::scene::build::{Builder, ask_for_events, emit};
use crate::scene::laws::Reader;
use crate::state::Object;
use crate::system::System;
use crate::systems::dynamics::Parts;
use crate::systems::tracers::{Settings, Tracers};
use tumble_interface::looks::{Colors, Look};
use tumble_interface::scene::{Emitter, Field, Integrator, Kill, Method, Particles, Scene, System as Plan};
use tumble_interface::warning::Code;
use tumble_interface::{Issue, Warning};

const NO_MASS: &str = "tracers have no mass and go with the flow; leave it out, or use a dynamics system";

pub struct Rules;

impl MethodRules for Rules {
    fn words(&self) -> &'static [Method] {
        &[Method::Tracers]
    }

    fn kinds(&self) -> &'static [&'static str] {
        &["particles", "emitter"]
    }

    fn massless(&self) -> Option<&'static str> {
        Some("tracers")
    }

    fn noun(&self) -> &'static str {
        "tracer"
    }

    fn refusal(&self, integrator: Integrator) -> Option<String> {
        let known: Vec<&str> = Integrator::ALL.into_iter().filter(|i| !i.needs_velocities()).map(Integrator::name).collect();
        let message = || format!("{} needs velocities, and tracers have none; expected one of {}", integrator.name(), known.join(", "));
        integrator.needs_velocities().then(message)
    }

    fn hints(&self, scene: &Scene) -> Vec<Warning> {
        let mut warnings = Vec::new();
        let there = present(scene).iter().any(|m| m.name() == self.name());
        if !scene.field.is_empty() && !there {
            let message = "no object is moved by a system of tracers, so that nothing follows the fields";
            warnings.push(Warning::new(Code::IdleFields, "field", message));
        }
        if scene.field.is_empty() && there {
            warnings.push(Warning::new(Code::IdleTracers, "", "tracers have no [[field]] to follow, and stay where they are; add one"));
        }
        for (index, _) in scene.system.iter().enumerate().filter(|(_, plan)| plan.method == Method::Tracers) {
            warnings.extend(late_carriers(scene, index, &fluids(scene).cloned().collect::<Vec<_>>()));
        }
        warnings
    }

    fn looks(&self, scene: &Scene, plan: &Plan, colors: &mut Colors) -> Vec<Look> {
        let all = scene.particles.iter().filter(|t| is_in(&t.system, plan)).map(|t| particles(t, colors));
        let mut all: Vec<Look> = all.collect();
        all.extend(scene.emitter.iter().filter(|t| is_in(&t.system, plan)).map(|t| emitted(t, colors)));
        all
    }

    /// Particles are counted as masses.
    fn memory(&self, _scene: &Scene, _assets: &Assets) -> f64 {
        0.0
    }

    fn build(&self, builder: &mut Builder<'_>, index: usize) -> Option<Box<dyn System>> {
        let (scene, plan) = (builder.scene, builder.plan(index));
        fluids(scene).for_each(|of| builder.exchange.ask(of, "velocity"));
        let (mut x, mut all) = (Vec::new(), Vec::new());
        for thing in scene.particles.iter().filter(|t| is_in(&t.system, plan)) {
            let first = x.len();
            refuse_masses(thing, &mut builder.issues);
            x.extend(thing.position.iter().map(|x| Vector::from(*x)));
            all.push(Object { name: thing.name.clone(), points: first..x.len(), radius: thing.radius, ..Object::default() });
        }
        let mut parts = Parts::default();
        for thing in scene.emitter.iter().filter(|t| is_in(&t.system, plan)) {
            refuse_motion(thing, &mut builder.issues);
            let mut site = Site {
                parts: &mut parts,
                issues: &mut builder.issues,
                hints: &mut builder.warnings,
                up: builder.up,
                solids: None,
                assets: builder.assets,
            };
            emit(&mut site, scene, thing);
        }
        ask_for_events(&mut builder.exchange, parts.emitters());
        let emitters = parts.take_emitters();
        for (stream, emitter) in emitters.iter().enumerate() {
            let (name, radius) = (emitter.words().name.clone(), emitter.first_radius());
            all.push(Object { name, points: x.len()..x.len(), radius, stream: Some(stream), ..Object::default() });
        }
        let settings = Settings {
            name: plan.name.clone(),
            integrator: plan.integrator,
            substeps: plan.substeps,
            step: plan.step,
            adaptive: plan.adaptive.clone(),
        };
        let flow = Reader::new(scene, &mut builder.issues).flow("field", &scene.field);
        if !builder.issues.is_empty() {
            return None;
        }
        let mut tracers = Tracers::new(settings, flow, &x, all, emitters);
        if let Err(error) = tracers.begin_life(builder.interval) {
            builder.issues.push(Issue::new(format!("system \"{}\"", plan.name), error.to_string()));
        }
        Some(Box::new(tracers))
    }
}

/// Names of the fluids that carry tracers.
fn fluids(scene: &Scene) -> impl Iterator<Item = &String> {
    scene.field.iter().filter_map(|field| if let Field::Gas { of } = field { Some(of) } else { None })
}

/// What only masses can have.
fn refuse_masses(thing: &Particles, issues: &mut Vec<Issue>) {
    let velocity = (!thing.velocity.is_empty()).then_some("velocity");
    let given = velocity.into_iter().chain(words_of_masses(thing));
    issues.extend(given.map(|key| Issue::new(format!("particles \"{}\".{key}", thing.name), NO_MASS)));
}

/// What only masses can be born with, and what only they meet.
fn refuse_motion(thing: &Emitter, issues: &mut Vec<Issue>) {
    let mut wrong = |key: &str, message: &str| issues.push(Issue::new(format!("emitter \"{}\".{key}", thing.name), message));
    if thing.kill.iter().any(|rule| matches!(rule, Kill::NearCollider(_))) {
        wrong("kill", "tracers see no colliders; use inside or outside");
    }
    let given = [
        ("velocity", thing.velocity.constant() != Some([0.0; 3])),
        ("speed", thing.speed.constant() != Some(0.0)),
        ("mass", thing.mass != 1.0 || thing.mass_spread != 0.0),
        ("charge", thing.charge != 0.0),
    ];
    given.into_iter().filter(|(_, given)| *given).for_each(|(key, _)| wrong(key, NO_MASS));
}
