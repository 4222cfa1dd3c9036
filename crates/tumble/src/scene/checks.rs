//! What the schema cannot say: things that depend on several values together.

use super::laws::off_plane;
use crate::systems::dynamics::MOST_SUBSTEPS;
use std::collections::HashSet;
use tumble_interface::Issue;
use tumble_interface::check::suggestion;
use tumble_interface::columns::COLUMNS;
use tumble_interface::scene::{Field, Force, Integrator, Method, Plane, Scene, Shape, Source, System};

/// Names of objects, with the kind of each.
pub fn objects(scene: &Scene) -> Vec<(&'static str, &str, Option<&str>)> {
    let particles = scene.particles.iter().map(|o| ("particles", o.name.as_str(), o.system.as_deref()));
    let ropes = scene.rope.iter().map(|o| ("rope", o.name.as_str(), o.system.as_deref()));
    let sheets = scene.sheet.iter().map(|o| ("sheet", o.name.as_str(), o.system.as_deref()));
    let hairs = scene.hair.iter().map(|o| ("hair", o.name.as_str(), o.system.as_deref()));
    let blocks = scene.block.iter().map(|o| ("block", o.name.as_str(), o.system.as_deref()));
    let nets = scene.net.iter().map(|o| ("net", o.name.as_str(), o.system.as_deref()));
    let cloths = scene.cloth.iter().map(|o| ("cloth", o.name.as_str(), o.system.as_deref()));
    let emitters = scene.emitter.iter().map(|o| ("emitter", o.name.as_str(), o.system.as_deref()));
    let galaxies = scene.galaxy.iter().map(|o| ("galaxy", o.name.as_str(), o.system.as_deref()));
    let gases = scene.gas.iter().map(|o| ("gas", o.name.as_str(), o.system.as_deref()));
    let bodies = scene.heat.iter().map(|o| ("heat", o.name.as_str(), o.system.as_deref()));
    let sounding = scene.compressible.iter().map(|o| ("compressible", o.name.as_str(), o.system.as_deref()));
    let things = particles.chain(emitters).chain(ropes).chain(hairs).chain(sheets).chain(blocks).chain(nets).chain(cloths).chain(galaxies);
    things.chain(gases).chain(bodies).chain(sounding).collect()
}

/// Everything wrong that can be seen before anything is built; `systems` are those of the scene, or the default one.
pub fn check(scene: &Scene, systems: &[System]) -> Vec<Issue> {
    let mut issues = Vec::new();
    let mut wrong = |path: String, message: String| issues.push(Issue::new(path, message));
    let objects = objects(scene);
    if objects.is_empty() {
        let message = "nothing to simulate: add particles, an emitter, a rope, hair, a sheet, a block, a net, cloth, a galaxy, a gas, heat or a \
                       compressible gas";
        wrong(String::new(), message.into());
    }
    let colliders = scene.collider.iter().map(|c| ("collider", c.name.as_str()));
    let mut names = HashSet::new();
    for (kind, name) in objects.iter().map(|(k, n, _)| (*k, *n)).chain(colliders) {
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
        if system.method == Method::Vicsek && scene.dimension != 2 {
            wrong("dimension".into(), format!("{}, but system \"{}\" moves in a plane; set dimension = 2", scene.dimension, system.name));
        }
        let interval = scene.frame_time() / f64::from(scene.time.exchanges);
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
        if objects.iter().any(|(_, name, _)| *name == anchor.name) {
            wrong(format!("{path}.name"), "an object has this name; names must differ".into());
        }
        if anchor.between[0].split_whitespace().eq(anchor.between[1].split_whitespace()) {
            wrong(format!("{path}.between"), "both ends are the same mass".into());
        }
    }
    let known = || systems.iter().map(|s| s.name.as_str());
    for (kind, name, system) in &objects {
        match (system, place(systems, kind, *system)) {
            (Some(given), None) if !known().any(|s| s == *given) => {
                let hint = suggestion(given, known());
                let list = known().collect::<Vec<_>>().join(", ");
                wrong(format!("{kind} \"{name}\".system"), format!("there is no system \"{given}\"{hint} (systems: {list})"));
            }
            (given, None) if *kind == "gas" => {
                let given = given.map_or_else(|| "no system".into(), |s| format!("system \"{s}\", which"));
                wrong(format!("gas \"{name}\".system"), format!("{given} moves no fluid; add a [[system]] with method = \"gas\""));
            }
            (Some(given), None) => wrong(
                format!("{kind} \"{name}\".system"),
                if matches!(*kind, "heat" | "compressible") {
                    format!("system \"{given}\" has another method; this needs a system with method = \"{kind}\"")
                } else {
                    format!("system \"{given}\" moves particles without mass; this needs a dynamics system")
                },
            ),
            (None, None) => {
                let method = if matches!(*kind, "heat" | "compressible") { kind } else { "dynamics" };
                wrong(format!("{kind} \"{name}\".system"), format!("no system can move it: add a [[system]] with method = \"{method}\""));
            }
            _ => {}
        }
    }
    for (i, force) in scene.force.iter().enumerate() {
        let (key, others) = others(force).unwrap_or(("", &[]));
        let on = force.on().into_iter().flatten().map(|on| ("on", on));
        for (key, on) in on.chain(others.iter().map(|other| (key, other))) {
            if !objects.iter().any(|(_, name, _)| name == on) {
                let hint = suggestion(on, objects.iter().map(|o| o.1));
                wrong(format!("force[{i}].{key}"), format!("there is no object \"{on}\"{hint}"));
            } else if let Some(what) =
                objects.iter().find(|(_, name, _)| name == on).and_then(|(kind, _, system)| massless(systems, kind, *system))
            {
                wrong(format!("force[{i}].{key}"), format!("\"{on}\" are {what}, which feel no force; put them into a dynamics system"));
            }
        }
        if let Force::Flock { predators, on: Some(on), .. } = force
            && let Some(both) = predators.iter().find(|p| on.contains(p))
        {
            wrong(format!("force[{i}].predators"), format!("\"{both}\" is in `on`, too; a predator is no prey of its own"));
        }
    }
    let rubbing = scene.collider.iter().map(|c| (format!("collider \"{}\"", c.name), c.friction, c.friction_static));
    let touching = systems.iter().filter_map(|s| s.self_contact.as_ref().map(|c| (s, c)));
    let touching = touching.map(|(s, c)| (format!("system \"{}\".self_contact", s.name), c.friction, c.friction_static));
    for (path, sliding, resting) in rubbing.chain(touching) {
        if let Some(resting) = resting.filter(|resting| *resting < sliding) {
            let message = format!("{resting}, expected >= {sliding}, the friction of what slides");
            wrong(format!("{path}.friction_static"), message);
        }
    }
    for (i, field) in scene.field.iter().enumerate() {
        if let Field::Gas { of } = field
            && !scene.gas.iter().any(|gas| gas.name == *of)
        {
            let hint = suggestion(of, scene.gas.iter().map(|gas| gas.name.as_str()));
            wrong(format!("field[{i}].of"), format!("there is no gas \"{of}\"{hint}"));
        }
    }
    let known: Vec<&str> = COLUMNS.iter().filter(|known| known.asked).map(|known| known.name).collect();
    for (i, column) in scene.output.columns.iter().enumerate() {
        if !known.contains(&column.as_str()) {
            let hint = suggestion(column, known.iter().copied());
            wrong(format!("output.columns[{i}]"), format!("\"{column}\", expected one of {}{hint}", known.join(", ")));
        }
    }
    if scene.output.ply && !objects.iter().any(|(kind, ..)| matches!(*kind, "particles" | "emitter" | "galaxy")) {
        let message = "true, but there are no particles to write: no [[particles]], [[emitter]] or [[galaxy]]; \
                       leave it out, output.usd writes everything else";
        wrong("output.ply".into(), message.into());
    }
    if scene.output.vdb && !objects.iter().any(|(kind, ..)| matches!(*kind, "gas" | "heat" | "compressible")) {
        let message =
            "true, but nothing lies on a grid: no [[gas]], [[heat]] or [[compressible]]; leave it out, output.usd writes everything else";
        wrong("output.vdb".into(), message.into());
    }
    for (i, probe) in scene.expect.probe.iter().enumerate() {
        if !objects.iter().any(|(_, name, _)| *name == probe.object) {
            let hint = suggestion(&probe.object, objects.iter().map(|o| o.1));
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

/// The system that moves an object of this kind: the one it names, else the first that can.
pub fn place(systems: &[System], kind: &str, named: Option<&str>) -> Option<usize> {
    let can = |s: &System| match s.method {
        Method::Dynamics | Method::PositionBased => !matches!(kind, "gas" | "heat" | "compressible"),
        Method::Gas | Method::Heat | Method::Compressible => kind == s.method.name(),
        Method::Tracers => matches!(kind, "particles" | "emitter"),
        Method::Vicsek => kind == "particles",
    };
    systems.iter().position(|s| can(s) && named.is_none_or(|name| s.name == name))
}

/// What an object is, if it is nothing that forces move.
fn massless(systems: &[System], kind: &str, named: Option<&str>) -> Option<&'static str> {
    match systems[place(systems, kind, named)?].method {
        Method::Dynamics | Method::PositionBased => None,
        Method::Tracers => Some("tracers"),
        Method::Vicsek => Some("particles of a vicsek system"),
        Method::Heat => Some("bodies on grids"),
        Method::Compressible => Some("gases on grids"),
        Method::Gas => Some("cells of a fluid"),
    }
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
    if system.method == Method::Tracers && integrator.needs_velocities() {
        let known: Vec<&str> = Integrator::ALL.into_iter().filter(|i| !i.needs_velocities()).map(Integrator::name).collect();
        let message = format!("{} needs velocities, and tracers have none; expected one of {}", integrator.name(), known.join(", "));
        wrong(format!("{path}.integrator"), message);
    }
    if system.method == Method::Vicsek && integrator != Integrator::default() {
        wrong(format!("{path}.integrator"), "the model of Vicsek is a map and has no integrator; leave it out".into());
    }
    if system.method == Method::Heat && integrator != Integrator::default() {
        wrong(
            format!("{path}.integrator"),
            "each [[heat]] body has a scheme of its own, and the system no integrator; leave it out".into(),
        );
    }
    if system.method == Method::Compressible && integrator != Integrator::default() {
        wrong(format!("{path}.integrator"), "a compressible gas is stepped by symplectic_euler; leave it out".into());
    }
    if system.method == Method::Gas && integrator != Integrator::default() {
        wrong(format!("{path}.integrator"), "Stable Fluids have no integrator; leave it out".into());
    }
    match (&system.vicsek, system.method) {
        (None, Method::Vicsek) => wrong(format!("{path}.vicsek"), "missing, expected side, radius, speed and noise".into()),
        (Some(words), Method::Vicsek) if 2.0 * words.radius > words.side => {
            wrong(format!("{path}.vicsek.radius"), format!("{} m, expected at most half the side, {} m", words.radius, 0.5 * words.side));
        }
        (Some(_), method) if method != Method::Vicsek => {
            wrong(
                format!("{path}.vicsek"),
                format!("given with method \"{}\"; leave it out, or set method = \"vicsek\"", system.method.name()),
            );
        }
        _ => {}
    }
    if system.clamp.is_some()
        && (system.method != Method::Dynamics
            || !matches!(integrator, Integrator::ModifiedEuler | Integrator::Verlet | Integrator::PositionBased))
    {
        wrong(format!("{path}.clamp"), "the position clamp goes with modified_euler, verlet or position_based".into());
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
                } else if thing.direction.is_none() && thing.speed != 0.0 {
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
        for (key, p) in [("from", thing.from), ("to", thing.to)] {
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
        let fits = fits && stays;
        if !fits {
            wrong(
                format!("collider \"{}\".shape", thing.name),
                "it is not symmetric about the plane of a scene of dimension 2; use dimension = 3".into(),
            );
        }
    }
}
