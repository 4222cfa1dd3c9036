//! What the schema cannot say: things that depend on several values together.

use super::laws::off_plane;
use super::methods::{METHODS, default_of, place, rules};
use crate::systems::dynamics::MOST_SUBSTEPS;
use std::collections::HashSet;
use tumble_interface::Issue;
use tumble_interface::check::suggestion;
use tumble_interface::columns::COLUMNS;
use tumble_interface::scene::{Force, KINDS, Object, Plane, Scene, Shape, Source, System};

/// Everything wrong that can be seen in a resolved scene before anything is built.
pub fn check(scene: &Scene) -> Vec<Issue> {
    let mut issues = Vec::new();
    METHODS.into_iter().for_each(|method| method.check(scene, &mut issues));
    let mut wrong = |path: String, message: String| issues.push(Issue::new(path, message));
    let (objects, systems) = (scene.objects(), &scene.system);
    if objects.is_empty() {
        wrong(String::new(), format!("nothing to simulate: there is no object of any kind ({})", KINDS.join(", ")));
    }
    let colliders = scene.collider.iter().map(|c| ("collider", c.name.as_str()));
    let mut names = HashSet::new();
    let pieces: Vec<String> = scene.body.iter().filter(|thing| thing.fracture.is_some()).flat_map(|thing| thing.parts()).collect();
    let broken = pieces.iter().map(|name| ("body", name.as_str()));
    for (kind, name) in objects.iter().map(|o| (o.kind, o.name)).chain(colliders).chain(broken) {
        if name.is_empty() || name.contains('/') {
            wrong(format!("{kind} \"{name}\".name"), "expected a name that is not empty and has no slash".into());
        }
        if !names.insert(name) {
            wrong(format!("{kind} \"{name}\".name"), "another object has this name; names must differ".into());
        }
    }
    let mut names = HashSet::new();
    for system in systems {
        let path = format!("system \"{}\"", system.name);
        if !names.insert(system.name.as_str()) {
            wrong(format!("{path}.name"), "another system has this name; names must differ".into());
        }
        check_system(system, &path, &mut wrong);
        let interval = scene.interval();
        if let Some(step) = system.step.filter(|step| interval / step > MOST_SUBSTEPS) {
            wrong(
                format!("{path}.step"),
                format!("{step:e} s divides an exchange interval of {interval:.3e} s into more than {MOST_SUBSTEPS:.0e} steps"),
            );
        }
    }
    for thing in &scene.particles {
        let message = match (thing.position.is_empty(), thing.cloud.is_some(), thing.fluid.is_some()) {
            (true, false, false) => "missing, expected positions, a cloud or a fluid",
            (false, true, _) => "given beside cloud; leave out one of them",
            (false, _, true) => "given beside fluid, which fills boxes; leave out one of them",
            (_, true, true) => "a cloud beside a fluid, which fills boxes; leave out one of them",
            _ => continue,
        };
        wrong(format!("particles \"{}\".position", thing.name), message.into());
    }
    for thing in scene.particles.iter().filter(|thing| thing.fluid.is_some() && thing.mass != [1.0]) {
        wrong(format!("particles \"{}\".mass", thing.name), "given beside fluid, whose density and spacing say it; leave it out".into());
    }
    for anchor in &scene.anchor {
        let path = format!("anchor \"{}\"", anchor.name);
        if objects.iter().any(|o| o.name == anchor.name) {
            wrong(format!("{path}.name"), "an object has this name; names must differ".into());
        }
        if anchor.between[0].split_whitespace().eq(anchor.between[1].split_whitespace()) {
            wrong(format!("{path}.between"), "both ends are the same mass".into());
        }
    }
    for object in &objects {
        if let Some(message) = unplaced(systems, object) {
            wrong(format!("{} \"{}\".system", object.kind, object.name), message);
        }
    }
    for (i, force) in scene.force.iter().enumerate() {
        let (key, others) = others(force).unwrap_or(("", &[]));
        let on = force.on().into_iter().flatten().map(|on| ("on", on));
        for (key, on) in on.chain(others.iter().map(|other| (key, other))) {
            match objects.iter().find(|o| o.name == on) {
                None => {
                    let hint = suggestion(on, objects.iter().map(|o| o.name));
                    wrong(format!("force[{i}].{key}"), format!("there is no object \"{on}\"{hint}"));
                }
                Some(object) => {
                    let method = place(systems, object.kind, object.system).map(|i| rules(systems[i].method));
                    if let Some(what) = method.and_then(|method| method.massless()) {
                        let cure =
                            if METHODS[0].kinds().contains(&object.kind) { "put them into a dynamics system" } else { "leave it out" };
                        let message = format!("\"{on}\" are {what}, which feel no force; {cure}");
                        wrong(format!("force[{i}].{key}"), message);
                    }
                }
            }
        }
        if let Force::Flock { predators, on: Some(on), .. } = force
            && let Some(both) = predators.iter().find(|p| on.contains(p))
        {
            wrong(format!("force[{i}].predators"), format!("\"{both}\" is in `on`, too; a predator is no prey of its own"));
        }
    }
    let touching = systems.iter().filter_map(|s| s.self_contact.as_ref().map(|c| (s, c)));
    let touching = touching.map(|(s, c)| (format!("system \"{}\".self_contact", s.name), c.friction, c.friction_static));
    for (path, sliding, resting) in touching {
        if let Some(resting) = resting.filter(|resting| *resting < sliding) {
            let message = format!("{resting}, expected >= {sliding}, the friction of what slides");
            wrong(format!("{path}.friction_static"), message);
        }
    }
    let known: Vec<&str> = COLUMNS.iter().filter(|known| known.asked).map(|known| known.name).collect();
    for (i, column) in scene.output.columns.iter().enumerate() {
        if !known.contains(&column.as_str()) {
            let hint = suggestion(column, known.iter().copied());
            wrong(format!("output.columns[{i}]"), format!("\"{column}\", expected one of {}{hint}", known.join(", ")));
        }
    }
    if scene.output.ply && !objects.iter().any(|o| matches!(o.kind, "particles" | "emitter" | "galaxy")) {
        let message = "true, but there are no particles to write: no [[particles]], [[emitter]] or [[galaxy]]; \
                       leave it out, output.usd writes everything else";
        wrong("output.ply".into(), message.into());
    }
    let on_grids: Vec<&str> = METHODS.into_iter().filter(|m| m.is_on_grids()).flat_map(|m| m.kinds().iter().copied()).collect();
    if scene.output.vdb && !objects.iter().any(|o| on_grids.contains(&o.kind)) {
        let kinds = on_grids.join("]] or [[");
        let message = format!("true, but nothing lies on a grid: no [[{kinds}]]; leave it out, output.usd writes everything else");
        wrong("output.vdb".into(), message);
    }
    for (i, probe) in scene.expect.probe.iter().enumerate() {
        if !objects.iter().any(|o| o.name == probe.object) && !pieces.contains(&probe.object) {
            let hint = suggestion(&probe.object, objects.iter().map(|o| o.name));
            wrong(format!("expect.probe[{i}].object"), format!("there is no object \"{}\"{hint}", probe.object));
        }
        if !scene.output.columns.contains(&probe.column) {
            wrong(format!("expect.probe[{i}].column"), format!("\"{}\" is not among output.columns", probe.column));
        }
    }
    if scene.dimension == 2 {
        check_plane(scene, &mut wrong);
    }
    issues
}

/// Why no system can move an object; `None` if one can.
fn unplaced(systems: &[System], object: &Object<'_>) -> Option<String> {
    if place(systems, object.kind, object.system).is_some() {
        return None;
    }
    let method = default_of(object.kind).name();
    let Some(given) = object.system else {
        return Some(format!("no system can move it: add a [[system]] with method = \"{method}\""));
    };
    let known = || systems.iter().map(|s| s.name.as_str());
    Some(match systems.iter().find(|s| s.name == given) {
        Some(system) => {
            format!("system \"{given}\" has method \"{}\"; this needs a system with method = \"{method}\"", system.method.name())
        }
        None => {
            let hint = suggestion(given, known());
            format!("there is no system \"{given}\"{hint} (systems: {})", known().collect::<Vec<_>>().join(", "))
        }
    })
}

/// The objects that a force names beside its targets, with the word for them.
pub fn others(force: &Force) -> Option<(&'static str, &[String])> {
    match force {
        Force::LennardJones { from, .. } | Force::Repulsion { from, .. } | Force::Cohesion { from, .. } | Force::Viscosity { from, .. } => {
            from.as_deref().map(|from| ("from", from))
        }
        Force::Flock { predators, .. } => Some(("predators", predators)),
        _ => None,
    }
}

fn check_system(system: &System, path: &str, wrong: &mut impl FnMut(String, String)) {
    let integrator = system.integrator;
    if system.substeps.is_some() && system.step.is_some() {
        wrong(format!("{path}.step"), "given beside substeps; leave out one of them".into());
    }
    if integrator.is_adaptive() && (system.substeps.is_some() || system.step.is_some()) {
        let message = format!("{} chooses its own steps; leave out substeps and step, or set adaptive.tolerance", integrator.name());
        wrong(format!("{path}.integrator"), message);
    }
    if let Some(message) = rules(system.method).refusal(integrator) {
        wrong(format!("{path}.integrator"), message);
    }
}

/// In two dimensions nothing may stick out of the plane.
fn check_plane(scene: &Scene, wrong: &mut impl FnMut(String, String)) {
    let (axis, name) = if scene.plane == Plane::Xz { (1, "y") } else { (2, "z") };
    for thing in &scene.particles {
        if thing.fluid.is_some() {
            wrong(format!("particles \"{}\".fluid", thing.name), "a liquid needs three dimensions; set dimension = 3".into());
        }
        for (key, p) in thing.cloud.iter().flat_map(|c| [("center", c.center), ("size", c.size)]) {
            if p[axis] != 0.0 {
                wrong(format!("particles \"{}\".cloud.{key}", thing.name), off_plane(axis, p[axis]));
            }
        }
        for (key, list) in [("position", &thing.position), ("velocity", &thing.velocity)] {
            if let Some(i) = list.iter().position(|p| p[axis] != 0.0) {
                wrong(format!("particles \"{}\".{key}[{i}]", thing.name), off_plane(axis, list[i][axis]));
            }
        }
    }
    for thing in &scene.emitter {
        let mut flat = |key: &str, p: &[f64; 3]| {
            if p[axis] != 0.0 {
                wrong(format!("emitter \"{}\".{key}", thing.name), off_plane(axis, p[axis]));
            }
        };
        if let Some(direction) = &thing.direction {
            flat("direction", direction);
        }
        match &thing.from {
            Source::Point { at } => flat("from.point.at", at),
            Source::Curve { points } => points.iter().enumerate().for_each(|(i, p)| flat(&format!("from.curve.points[{i}]"), p)),
            Source::Disk { center, normal, .. } => {
                flat("from.disk.center", center);
                // A disk in the plane, or a line.
                if (0..3).any(|a| a != axis && normal[a] != 0.0) {
                    flat("from.disk.normal", normal);
                } else if thing.direction.is_none() && thing.speed.constant() != Some(0.0) {
                    let message = "missing: the normal of the disk points out of the plane of a scene of dimension 2";
                    wrong(format!("emitter \"{}\".direction", thing.name), message.into());
                }
            }
            Source::Sphere { center, .. } => flat("from.sphere.center", center),
            Source::Box { center, size, rotate } => {
                flat("from.box.center", center);
                flat("from.box.size", size);
                if (0..3).any(|a| a != axis && rotate[a] != 0.0) {
                    let message = format!("{rotate:?}, expected a turn about {name} in a scene of dimension 2");
                    wrong(format!("emitter \"{}\".from.box.rotate", thing.name), message);
                }
            }
            Source::MeshSurface(_) | Source::MeshVolume(_) => {
                let message = "a mesh does not fit into a plane; use another source, or dimension = 3";
                wrong(format!("emitter \"{}\".from", thing.name), message.into());
            }
            Source::Particles { .. } => {}
        }
    }
    for (i, force) in scene.force.iter().enumerate() {
        if let Force::Flock { goal, .. } = force {
            for (k, goal) in goal.iter().enumerate().filter(|(_, g)| g.point[axis] != 0.0) {
                wrong(format!("force[{i}].goal[{k}].point"), off_plane(axis, goal.point[axis]));
            }
        }
    }
    for thing in &scene.rope {
        for (key, p) in [("from", thing.from), ("to", thing.to), ("velocity", thing.velocity)] {
            if p[axis] != 0.0 {
                wrong(format!("rope \"{}\".{key}", thing.name), off_plane(axis, p[axis]));
            }
        }
    }
    for (kind, name) in scene
        .block
        .iter()
        .map(|b| ("block", &b.name))
        .chain(scene.net.iter().map(|n| ("net", &n.name)))
        .chain(scene.cloth.iter().map(|c| ("cloth", &c.name)))
    {
        wrong(format!("{kind} \"{name}\""), "it does not fit into a plane; use dimension = 3".into());
    }
    for thing in &scene.galaxy {
        wrong(format!("galaxy \"{}\"", thing.name), "it does not fit into a plane; use dimension = 3".into());
    }
    for thing in &scene.sheet {
        let turn = if axis == 1 { [90.0, 0.0, 0.0] } else { [0.0; 3] };
        let fits = if axis == 1 { thing.rotate == turn } else { thing.rotate[0] == 0.0 && thing.rotate[1] == 0.0 };
        if !fits || thing.center[axis] != 0.0 {
            let message =
                format!("it does not lie in the plane of a scene of dimension 2; set rotate = {turn:?} and {name} of center to 0");
            wrong(format!("sheet \"{}\".rotate", thing.name), message);
        }
    }
    for thing in &scene.collider {
        let fits = match &thing.shape {
            Shape::Sphere { center, .. } => center[axis] == 0.0,
            Shape::Box { center, rotate, .. } => center[axis] == 0.0 && (0..3).all(|a| a == axis || rotate[a] == 0.0),
            Shape::Plane { normal, .. } => normal[axis] == 0.0,
            Shape::Floor { .. } => axis == 1,
            Shape::Capsule { from, to, .. } => from[axis] == 0.0 && to[axis] == 0.0,
            Shape::Lathe { .. } | Shape::Mesh(_) | Shape::AnimatedMesh(_) | Shape::Character(_) | Shape::Mannequin(_) => false,
        };
        let about = |v: &[f64; 3]| (0..3).all(|a| a == axis || v[a] == 0.0);
        let stays = thing.belt[axis] == 0.0
            && thing.motion.as_ref().is_none_or(|m| {
                let keys = m.keys.iter().all(|k| k.translate[axis] == 0.0 && about(&k.rotate));
                m.velocity[axis] == 0.0 && about(&m.spin) && keys
            });
        if thing.motion.as_ref().and_then(|m| m.scale.as_ref()).is_some_and(|scale| scale.constant() != Some(1.0)) {
            let message = "meshes, which solids of another size are, are not symmetric about the plane of a scene of dimension 2; leave it out, or use dimension = 3";
            wrong(format!("collider \"{}\".motion.scale", thing.name), message.into());
        }
        let fits = fits && stays;
        if !fits {
            wrong(
                format!("collider \"{}\".shape", thing.name),
                "it is not symmetric about the plane of a scene of dimension 2; use dimension = 3".into(),
            );
        }
    }
}
