//! Grains: words to materials and places.

use super::{MethodRules, is_in, scheme_of_its_own, surfaces, touches};
use crate::geometry::Friction;
use crate::recipes;
use crate::scene::Assets;
use crate::scene::build::Builder;
use crate::scene::plausible::odd_density;
use crate::system::System;
use crate::systems::grains::{Clump, Clumps, Grains as Bed, Material, Object, Overlaps, Settings, longest_step, settling_step};
use std::sync::Arc;
use tumble_interface::check::short;
use tumble_interface::looks::{Colors, FEW, Form, Look};
use tumble_interface::scene::{GrainFill, GrainScheme, Grains, MeshFile, Method, NormalLaw, Scene, Shape, System as Plan};
use tumble_interface::warning::Code;
use tumble_interface::{Issue, Mesh, Warning};

/// Bytes for a grain: its rows, some eight candidates, contacts that remember, and a snapshot.
const GRAIN: f64 = 1000.0;
/// How much longer than the default a step may be without a word.
const LONG: f64 = 1.5;

pub struct Rules;

fn material(thing: &Grains) -> Material {
    Material {
        young: thing.young,
        poisson: thing.poisson,
        friction: Friction { sliding: thing.friction, resting: thing.friction },
        resists: [thing.rolling_friction, thing.twisting_friction],
        restitution: thing.restitution,
        cohesion: thing.cohesion,
    }
}

fn law(plan: &Plan) -> NormalLaw {
    plan.grains.clone().unwrap_or_default().law
}

fn scheme(plan: &Plan) -> GrainScheme {
    plan.grains.clone().unwrap_or_default().scheme
}

/// Words that say nothing of grains that are moved by positions.
fn refuse_softness(scene: &Scene, issues: &mut Vec<Issue>) {
    const CURE: &str = "hard grains, moved by positions, have no such thing; leave it out, or set scheme = \"forces\"";
    for plan in scene.system.iter().filter(|plan| plan.method == Method::Grains && scheme(plan) == GrainScheme::Positions) {
        if law(plan) != NormalLaw::default() {
            issues.push(Issue::new(format!("system \"{}\".grains.law", plan.name), CURE));
        }
        for thing in scene.grains.iter().filter(|t| is_in(&t.system, plan)) {
            issues.extend(thing.words_of_forces().map(|key| Issue::new(format!("grains \"{}\".{key}", thing.name), CURE)));
        }
    }
}

/// The longest step that resolves all contacts of a system [s].
fn step(scene: &Scene, plan: &Plan) -> f64 {
    let own = scene.grains.iter().filter(|t| is_in(&t.system, plan));
    let of = |t: &Grains| {
        // The matter of a clump is borne by all of its spheres.
        let [least, share, count] = t.clump.as_ref().and_then(recipes::crowded).unwrap_or([1.0; 3]);
        let radius = least * t.radius * (1.0 - t.radius_spread);
        match scheme(plan) {
            GrainScheme::Forces => longest_step(law(plan), &material(t), radius, share * t.density, count),
            GrainScheme::Positions => settling_step(radius),
        }
    };
    own.map(of).fold(f64::INFINITY, f64::min)
}

impl MethodRules for Rules {
    fn words(&self) -> &'static [Method] {
        &[Method::Grains]
    }

    fn kinds(&self) -> &'static [&'static str] {
        &["grains"]
    }

    fn massless(&self) -> Option<&'static str> {
        Some("grains")
    }

    fn meets_colliders(&self) -> bool {
        true
    }

    fn own_scheme(&self) -> Option<&'static str> {
        Some("grains have a scheme of their own and no integrator")
    }

    fn noun(&self) -> &'static str {
        "grain"
    }

    fn theory(&self) -> &'static [(&'static str, &'static [&'static str])] {
        &[("grains", &["grains.1", "grains.2"])]
    }

    fn check(&self, scene: &Scene, issues: &mut Vec<Issue>) {
        scheme_of_its_own(scene, Method::Grains, "grains", |plan| plan.grains.is_some(), issues);
        refuse_softness(scene, issues);
        if scene.dimension == 2 && !scene.grains.is_empty() {
            issues.push(Issue::new("dimension", "2, but grains move in space; set dimension = 3, and take a slice between two planes"));
        }
    }

    fn hints(&self, scene: &Scene) -> Vec<Warning> {
        let odd = |thing: &Grains| odd_density(format!("grains \"{}\".density", thing.name), thing.density, 0.0);
        let mut warnings: Vec<Warning> = scene.grains.iter().filter_map(odd).collect();
        let interval = scene.interval();
        for plan in scene.system.iter().filter(|plan| plan.method == Method::Grains && scheme(plan) == GrainScheme::Forces) {
            let given = plan.substeps.map(|n| ("substeps", interval / f64::from(n)));
            let Some((key, given)) = given.or(plan.step.map(|step| ("step", step.min(interval)))) else { continue };
            let longest = step(scene, plan);
            if given > LONG * longest {
                let cure =
                    if key == "substeps" { format!("{} of them", (interval / longest).ceil()) } else { format!("{} s", short(longest)) };
                let message = format!(
                    "sub-steps of {} s are too long for contacts as stiff as these; take {cure}, leave it out for that, or lower young",
                    short(given)
                );
                warnings.push(Warning::new(Code::StiffContact, format!("system \"{}\".{key}", plan.name), message));
            }
        }
        // What grains do not meet.
        let mut of = scene.objects().into_iter().filter(|o| !matches!(o.kind, "grains" | "body" | "joint"));
        if let (Some(other), false) = (of.next(), scene.grains.is_empty()) {
            let message = format!("grains meet each other, colliders and rigid bodies, but not yet what [[{}]] consists of", other.kind);
            warnings.push(Warning::new(Code::Unfelt, "grains", message));
        }
        let own = |plan: &&Plan| plan.method == Method::Grains && scene.grains.iter().any(|thing| is_in(&thing.system, plan));
        if let Some(second) = scene.system.iter().filter(own).nth(1) {
            let message = "its grains do not meet those of other systems; put all grains that are to meet into one";
            warnings.push(Warning::new(Code::Unfelt, format!("system \"{}\"", second.name), message));
        }
        warnings
    }

    fn looks(&self, scene: &Scene, plan: &Plan, colors: &mut Colors) -> Vec<Look> {
        let own = scene.grains.iter().filter(|t| is_in(&t.system, plan));
        let look =
            |t: &Grains| Look { few: t.count() < FEW, ..Look::new(&t.name, Form::Points, colors.pick(t.color)).with_radius(t.radius) };
        own.map(look).collect()
    }

    fn memory(&self, scene: &Scene, _assets: &Assets) -> f64 {
        GRAIN * scene.grains.iter().map(Grains::count).sum::<f64>()
    }

    fn build(&self, builder: &mut Builder<'_>, index: usize) -> Option<Box<dyn System>> {
        let (scene, plan) = (builder.scene, builder.plan(index));
        let (mut objects, mut all, mut clumps, mut local) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for thing in scene.grains.iter().filter(|t| is_in(&t.system, plan)) {
            let mesh_of = |fill: &GrainFill| match &fill.within {
                Some(Shape::Mesh(file)) => builder.assets.get(&file.path).map(|mesh| recipes::placed(mesh, file)).into_iter().collect(),
                _ => Vec::new(),
            };
            let meshes: Vec<Vec<Mesh>> = thing.fill.iter().map(mesh_of).collect();
            let assets = builder.assets;
            match recipes::grains(thing, scene.seed, &meshes, &|file: &MeshFile| assets.get(&file.path)) {
                Ok(made) => {
                    let range = all.len()..all.len() + made.grains.len();
                    let first = all.len() as u32;
                    let moved = |c: Clump| Clump { spheres: c.spheres.start + first..c.spheres.end + first, ..c };
                    objects.push((Object { name: thing.name.clone(), grains: range, pour: made.pour }, material(thing)));
                    all.extend(made.grains);
                    local.extend(made.local);
                    clumps.extend(made.clumps.into_iter().map(moved));
                }
                Err(wrong) => {
                    let issue = |(key, message): (String, String)| Issue::new(format!("grains \"{}\"{key}", thing.name), message);
                    builder.issues.extend(wrong.into_iter().map(issue));
                }
            }
        }
        let settings = Settings {
            name: plan.name.clone(),
            substeps: plan.substeps,
            step: plan.step,
            longest: step(scene, plan),
            sound: scene.grains.iter().map(|t| (t.young / t.density).sqrt()).fold(0.0, f64::max),
            scheme: scheme(plan),
            law: law(plan),
            gravity: builder.gravity.clone(),
        };
        let mut system = Bed::new(settings, objects, &all, Clumps::new(clumps, local));
        if builder.issues.is_empty() {
            // Bodies, too, where they start.
            let bodies = if touches(scene) { surfaces(scene, builder.assets) } else { Vec::new() };
            system.meet(&Arc::new(builder.colliders.iter().cloned().chain(bodies).collect()));
            if let Some(overlaps) = system.part() {
                tell(builder, plan, &overlaps);
            }
            system.meet(&builder.colliders);
        }
        Some(Box::new(system))
    }
}

/// Tells that grains overlap at the start.
fn tell(builder: &mut Builder<'_>, plan: &Plan, overlaps: &Overlaps) {
    let path = format!("system \"{}\"", plan.name);
    let (count, deepest, left, most) = match overlaps {
        Overlaps::Crushed(most) => {
            let what = format!("each grain meets more than {most} others on average at the start");
            return builder.issues.push(Issue::new(path, format!("{what}; take fewer grains, or move solids that leave them no room")));
        }
        Overlaps::Parted { count, deepest, left, most } => (count, deepest, left, most),
    };
    let what = format!("{count} contacts, of grains with each other or with solids, overlap at the start by up to {} m", short(*deepest));
    if left > most {
        builder.issues.push(Issue::new(path, format!("{what}, and cannot be moved apart; take fewer grains, or give them more room")));
    } else {
        let message = format!(
            "{what}; they have been moved apart, to {} m. Take fewer grains, or a larger volume, unless that is meant",
            short(*left)
        );
        builder.warnings.push(Warning::new(Code::StartsInside, path, message));
    }
}
