//! Rigid bodies: words to shapes, masses and states.

use super::{MethodRules, is_in};
use crate::recipes;
use crate::scene::Assets;
use crate::scene::build::Builder;
use crate::scene::plausible::odd_density;
use crate::system::System;
use crate::systems::rigid::{Bodies, Object, Rigid, Settings, refusal};
use tumble_interface::check::short;
use tumble_interface::looks::{Colors, FEW, Form, Look};
use tumble_interface::scene::{Body, BodyShape, Integrator, Method, Scene, System as Plan};
use tumble_interface::warning::Code;
use tumble_interface::{Issue, Warning};

/// Bytes for a body: its state, contacts with some ten neighbours, and a snapshot.
const BODY: f64 = 12_000.0;

pub struct Rules;

fn count(thing: &Body) -> f64 {
    thing.arrange.as_ref().map_or(thing.position.len() as f64, |arrange| arrange.count())
}

impl MethodRules for Rules {
    fn words(&self) -> &'static [Method] {
        &[Method::Rigid]
    }

    fn kinds(&self) -> &'static [&'static str] {
        &["body"]
    }

    fn massless(&self) -> Option<&'static str> {
        Some("rigid bodies")
    }

    fn meets_colliders(&self) -> bool {
        true
    }

    fn refusal(&self, integrator: Integrator) -> Option<String> {
        (integrator != Integrator::default()).then(|| "rigid bodies have a scheme of their own and no integrator; leave it out".into())
    }

    fn check(&self, scene: &Scene, issues: &mut Vec<Issue>) {
        for plan in &scene.system {
            if plan.method != Method::Rigid && plan.rigid.is_some() {
                let message = format!("given with method \"{}\"; leave it out, or set method = \"rigid\"", plan.method.name());
                issues.push(Issue::new(format!("system \"{}\".rigid", plan.name), message));
            }
        }
        if scene.dimension == 2 && !scene.body.is_empty() {
            issues.push(Issue::new("dimension", "2, but rigid bodies move in space; set dimension = 3"));
        }
    }

    fn hints(&self, scene: &Scene) -> Vec<Warning> {
        let odd = |thing: &Body| odd_density(format!("body \"{}\".density", thing.name), thing.density?, 0.0);
        let mut warnings: Vec<Warning> = scene.body.iter().filter_map(odd).collect();
        let kinds: Vec<&str> = scene.objects().iter().map(|o| o.kind).filter(|kind| *kind != "body").collect();
        if let (Some(other), false) = (kinds.first(), scene.body.is_empty()) {
            let message =
                format!("rigid bodies meet each other and colliders, but not yet what [[{other}]] consists of, nor does that meet them");
            warnings.push(Warning::new(Code::Unfelt, "body", message));
        }
        let own = |plan: &&Plan| plan.method == Method::Rigid && scene.body.iter().any(|thing| is_in(&thing.system, plan));
        if let Some(second) = scene.system.iter().filter(own).nth(1) {
            let message = "its bodies do not meet those of other systems; put all bodies that are to meet into one";
            warnings.push(Warning::new(Code::Unfelt, format!("system \"{}\"", second.name), message));
        }
        warnings
    }

    fn looks(&self, scene: &Scene, plan: &Plan, colors: &mut Colors) -> Vec<Look> {
        let own = scene.body.iter().filter(|t| is_in(&t.system, plan));
        let look = |t: &Body| Look { few: count(t) < FEW, ..Look::new(&t.name, Form::Instances, colors.pick(t.color)) };
        own.map(look).collect()
    }

    fn memory(&self, scene: &Scene, _assets: &Assets) -> f64 {
        scene.body.iter().map(|thing| BODY * count(thing)).sum()
    }

    fn build(&self, builder: &mut Builder<'_>, index: usize) -> Option<Box<dyn System>> {
        let (scene, plan) = (builder.scene, builder.plan(index));
        let (mut objects, mut bodies) = (Vec::new(), Bodies::default());
        for thing in scene.body.iter().filter(|t| is_in(&t.system, plan)) {
            let file = match &thing.shape {
                BodyShape::Mesh(file) => builder.assets.get(&file.path).map(|mesh| recipes::placed(mesh, file)),
                _ => None,
            };
            match recipes::bodies(thing, file.as_ref()) {
                Ok(made) => {
                    let first = bodies.rows.len();
                    bodies.hull.resize(first + made.bodies.len(), bodies.hulls.len() as u32);
                    bodies.hulls.push(made.hull);
                    bodies.rows.extend(made.bodies);
                    objects.push(Object { name: thing.name.clone(), rows: first..bodies.rows.len(), mesh: made.mesh });
                }
                Err((key, message)) => builder.issues.push(Issue::new(format!("body \"{}\"{key}", thing.name), message)),
            }
        }
        bodies.moving = bodies.rows.len();
        for solid in builder.colliders.iter() {
            if let Some(message) = refusal(solid) {
                builder.issues.push(Issue::new(format!("collider \"{}\"", solid.name), message));
            }
        }
        let settings = Settings {
            name: plan.name.clone(),
            substeps: plan.substeps,
            step: plan.step,
            iterations: plan.rigid.clone().unwrap_or_default().iterations,
            gravity: builder.gravity.clone(),
        };
        let mut system = Rigid::new(settings, objects, bodies);
        if builder.issues.is_empty() {
            system.meet(&builder.colliders);
            builder.warnings.extend(deepest(&mut system));
        }
        Some(Box::new(system))
    }
}

/// The two surfaces that overlap most at the start.
fn deepest(system: &mut Rigid) -> Option<Warning> {
    let (a, b, depth) = system.overlap()?;
    let message = format!(
        "starts {} m deep in \"{b}\"; it is pushed out at no more than 3 m/s. Move one of them, unless that is meant",
        short(depth)
    );
    Some(Warning::new(Code::StartsInside, format!("body \"{a}\""), message))
}
