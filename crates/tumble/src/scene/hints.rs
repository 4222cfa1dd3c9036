//! What a scene says in vain, and what it hardly means.

use super::methods::touches;
use super::methods::{METHODS, present};
use crate::recipes::named;
use tumble_interface::Warning;
use tumble_interface::check::{plain, short};
use tumble_interface::scene::{
    Animated, AnimatedVector, Collider, Component, Emitter, Event, Force as Words, Kill, Particles, Rope, Scene, Shape, Source,
};
use tumble_interface::warning::Code;

/// Intervals that are repeated where nothing joins two systems.
pub fn coupled(scene: &Scene) -> Option<Warning> {
    let of = |end: &str| {
        let (name, _) = named(end)?;
        scene.objects().into_iter().find(|object| object.name == name)?.system.map(str::to_string)
    };
    let joins = scene.anchor.iter().any(|anchor| of(&anchor.between[0]) != of(&anchor.between[1]));
    let message =
        "no anchor joins two systems and no mass meets a rigid body, so that each interval is taken again for nothing; leave it out";
    (scene.world.coupling.is_some() && !joins && !touches(scene)).then(|| Warning::new(Code::Unfelt, "world.coupling", message))
}

/// What a resolved scene says and nothing heeds.
pub fn unused(scene: &Scene) -> Vec<Warning> {
    let mut warnings: Vec<Warning> = METHODS.into_iter().flat_map(|method| method.hints(scene)).collect();
    let present = present(scene);
    let massless: Option<Vec<&str>> = present.iter().map(|method| method.massless()).collect();
    if let Some(natures) = massless {
        let solids = !scene.collider.is_empty() && !present.iter().any(|method| method.meets_colliders());
        for (key, words, given) in [("force", "forces", !scene.force.is_empty()), ("collider", "colliders", solids)] {
            if given {
                let message = format!("all objects are {}, which feel no {words}", natures.join(" or "));
                warnings.push(Warning::new(Code::Unfelt, key, message));
            }
        }
    }
    for (i, force) in scene.force.iter().enumerate() {
        let at = || format!("force[{i}]");
        let reached = |name: &String| force.on().is_none_or(|on| on.contains(name));
        let charged = |p: &Particles| p.charge.iter().any(|q| *q != 0.0) && reached(&p.name);
        let emitted = |e: &Emitter| e.charge != 0.0 && reached(&e.name);
        let any = scene.particles.iter().any(charged) || scene.emitter.iter().any(emitted);
        if matches!(force, Words::Air { .. })
            && !scene
                .sheet
                .iter()
                .map(|t| &t.name)
                .chain(scene.net.iter().map(|t| &t.name))
                .chain(scene.cloth.iter().map(|t| &t.name))
                .chain(scene.block.iter().map(|t| &t.name))
                .chain(scene.rope.iter().map(|t| &t.name))
                .chain(scene.hair.iter().map(|t| &t.name))
                .any(reached)
        {
            warnings.push(Warning::new(
                Code::NoSurface,
                at(),
                "nothing in its reach has a surface or is a thread; give it a sheet, a net, cloth, a block, a rope or hair",
            ));
        }
        if matches!(force, Words::Magnetic { .. } | Words::Electric { .. } | Words::Electrostatics { .. }) && !any {
            warnings.push(Warning::new(Code::NoCharge, at(), "nothing in its reach has a charge; give particles a charge"));
        }
    }
    if scene.collider.is_empty() {
        let mut alone = |path: String, message: &str| warnings.push(Warning::new(Code::NoCollider, path, message));
        for emitter in &scene.emitter {
            if let Some(i) = emitter.kill.iter().position(|rule| matches!(rule, Kill::NearCollider(_))) {
                let name = &emitter.name;
                alone(format!("emitter \"{name}\".kill[{i}]"), "near_collider, but there is no collider; add one, or leave it out");
            }
        }
        for emitter in &scene.emitter {
            if matches!(&emitter.from, Source::Particles { at: Event::Bounce, .. }) {
                let name = &emitter.name;
                alone(format!("emitter \"{name}\".from.particles.at"), "there is no collider to bounce off; add one");
            }
        }
        for (i, _) in scene.force.iter().enumerate().filter(|(_, f)| matches!(f, Words::Flock { avoidance, .. } if *avoidance > 0.0)) {
            alone(format!("force[{i}].avoidance"), "there is no collider to shun; add one, or leave it out");
        }
    }
    scene.emitter.iter().for_each(|emitter| doubts(scene, emitter, &mut warnings));
    if let Some(last) = scene.output.stills.iter().find(|i| **i > scene.time.frames) {
        let message = format!("there is no frame {last}; the last one is {}", scene.time.frames);
        warnings.push(Warning::new(Code::NoSuchFrame, "output.stills", message));
    }
    warnings
}

/// Solids that masses may pass on both sides of.
pub fn thin(scene: &Scene) -> Vec<Warning> {
    let along = |size: f64, n: u32| size / f64::from(n.max(2) - 1);
    let sheets = scene.sheet.iter().map(|t| (&t.name, along(t.size[0], t.resolution[0]).max(along(t.size[1], t.resolution[1]))));
    let cloths = scene.cloth.iter().map(|t| (&t.name, t.resolution));
    let way = |t: &Rope| (0..3).map(|k| (t.to[k] - t.from[k]).powi(2)).sum::<f64>().sqrt();
    let ropes = scene.rope.iter().map(|t| (&t.name, t.length.unwrap_or_else(|| way(t)) / f64::from(t.segments)));
    let hair = scene.hair.iter().filter_map(|t| Some((&t.name, t.length? / f64::from(t.segments))));
    let all = sheets.chain(cloths).chain(ropes).chain(hair);
    let Some((name, apart)) = all.max_by(|a, b| a.1.total_cmp(&b.1)) else { return Vec::new() };
    let doubt = |thing: &Collider| {
        let across = match &thing.shape {
            Shape::Sphere { radius, .. } | Shape::Capsule { radius, .. } => 2.0 * radius,
            Shape::Box { size, .. } => {
                let mut size = *size;
                size.sort_by(f64::total_cmp);
                size[1]
            }
            _ => return None,
        } + 2.0 * thing.thickness;
        let message = format!(
            "is {} m across with its thickness, and the masses of \"{name}\" are {} m apart: they may pass on both sides of it, since masses \
             alone meet it; set edges = true, and self_contact in their system",
            short(across),
            short(apart)
        );
        (across < apart && !thing.edges && !thing.inside)
            .then(|| Warning::new(Code::ThinCollider, format!("collider \"{}\"", thing.name), message))
    };
    scene.collider.iter().filter_map(doubt).collect()
}

/// Whether an emitter has particles at all, and whether regions that kill them are thick enough for their speed.
fn doubts(scene: &Scene, emitter: &Emitter, warnings: &mut Vec<Warning>) {
    let (name, end) = (&emitter.name, f64::from(scene.time.frames) / scene.time.fps);
    let quiet = matches!(emitter.rate, Animated::Value(rate) if rate <= 0.0) || emitter.start >= emitter.end.unwrap_or(end).min(end);
    if quiet && !matches!(emitter.from, Source::Particles { .. }) && emitter.burst.iter().all(|b| b.time >= end || b.count == 0) {
        let message = format!("nothing is born in the {} s of the scene; see its rate, start and burst", plain(end));
        warnings.push(Warning::new(Code::NoBirths, format!("emitter \"{name}\""), message));
    }
    let given = match &emitter.velocity {
        AnimatedVector::Components(all) => all.iter().map(|c| if let Component::Value(v) = c { v * v } else { 0.0 }).sum::<f64>().sqrt(),
        _ => 0.0,
    };
    let speed = given.max(emitter.speed.constant().unwrap_or(0.0).abs());
    let way = speed / (scene.time.fps * f64::from(scene.exchanges()));
    for (i, rule) in emitter.kill.iter().enumerate() {
        let thick = match rule {
            Kill::Inside(Shape::Sphere { radius, .. } | Shape::Capsule { radius, .. }) => 2.0 * radius,
            Kill::Inside(Shape::Box { size, .. }) => size.iter().copied().fold(f64::INFINITY, f64::min),
            _ => continue,
        };
        if way > thick {
            let enough = (f64::from(scene.exchanges()) * way / thick).ceil();
            let message = format!(
                "at {} m/s particles may pass {} m unseen, for rules are looked at when an exchange \
                 interval ends; set time.exchanges to {enough} or more",
                plain(speed),
                plain(thick)
            );
            warnings.push(Warning::new(Code::ThinRegion, format!("emitter \"{name}\".kill[{i}].inside"), message));
        }
    }
}
