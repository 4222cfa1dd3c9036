//! Masses under forces, and position-based dynamics.

use super::{MethodRules, emitted, is_in, particles, surfaces, touches, visits_bodies};
use crate::forces::Load;
use crate::geometry::motion::Pose;
use crate::geometry::{Carrier, Collider, Vector};
use crate::math::parallel::fold;
use crate::recipes::{self, Site};
use crate::scene::build::{Builder, ask_for_events, emit};
use crate::scene::checks::others;
use crate::scene::coupling::Link;
use crate::scene::laws::Reader;
use crate::scene::{Assets, coincident, far, hints, locking, memory};
use crate::system::System;
use crate::systems::dynamics::{Anchor, Dynamics, On, Parts, Settings, Stepping};
use tumble_interface::check::short;
use tumble_interface::looks::{Colors, FEW, Form, Look, Rgb};
use tumble_interface::scene::{Bits, Force as Words, Hair, Integrator, Method, Scene, Shape, System as Plan};
use tumble_interface::warning::Code;
use tumble_interface::{Issue, Mesh, SceneError, Warning};

/// Births that are looked at before a run.
const TRIALS: usize = 64;

/// Longest sub-step of position-based dynamics where a scene says nothing [s].
const POSITION_BASED_STEP: f64 = 1e-3;

pub struct Rules;

impl MethodRules for Rules {
    fn words(&self) -> &'static [Method] {
        &[Method::Dynamics, Method::PositionBased]
    }

    fn kinds(&self) -> &'static [&'static str] {
        &["particles", "emitter", "rope", "hair", "sheet", "block", "net", "cloth", "galaxy"]
    }

    fn default_system(&self) -> Plan {
        Plan::default()
    }

    fn normalize(&self, plan: &mut Plan) {
        if plan.method == Method::PositionBased {
            (plan.method, plan.integrator) = (Method::Dynamics, Integrator::PositionBased);
        }
    }

    fn meets_colliders(&self) -> bool {
        true
    }

    fn check(&self, scene: &Scene, issues: &mut Vec<Issue>) {
        for plan in scene.system.iter().filter(|plan| plan.clamp.is_some()) {
            let clamped = matches!(plan.integrator, Integrator::ModifiedEuler | Integrator::Verlet | Integrator::PositionBased);
            if plan.method != Method::Dynamics || !clamped {
                let message = "the position clamp goes with modified_euler, verlet or position_based";
                issues.push(Issue::new(format!("system \"{}\".clamp", plan.name), message));
            }
        }
        // What is wrong with a force is told even where it acts on nothing.
        let mut reader = Reader::new(scene, issues);
        for (i, force) in scene.force.iter().enumerate() {
            reader.law(&format!("force[{i}]"), force);
            reader.air(&format!("force[{i}]"), force);
        }
    }

    fn hints(&self, scene: &Scene) -> Vec<Warning> {
        let meets = scene.system.iter().any(|plan| plan.method == Method::Dynamics && plan.self_contact.is_some());
        let idle = scene.collider.iter().filter(|thing| thing.edges && !meets);
        let message = "edges meet in systems with self_contact, and there is none; add it, or leave edges out";
        let idle = idle.map(|thing| Warning::new(Code::Unfelt, format!("collider \"{}\".edges", thing.name), message));
        idle.chain(hints::thin(scene)).chain(hints::coupled(scene)).chain(locking::locking(scene)).collect()
    }

    fn looks(&self, scene: &Scene, plan: &Plan, colors: &mut Colors) -> Vec<Look> {
        drawn(scene, plan, colors)
    }

    fn memory(&self, scene: &Scene, assets: &Assets) -> f64 {
        memory::masses(scene, assets)
    }

    fn fill(&self, builder: &mut Builder<'_>, index: usize) {
        let mut parts = std::mem::take(&mut builder.masses[index]);
        fill(builder, index, &mut parts);
        act(builder, &mut parts);
        builder.masses[index] = parts;
    }

    fn build(&self, builder: &mut Builder<'_>, index: usize) -> Option<Box<dyn System>> {
        if !builder.sound {
            return None;
        }
        let (scene, plan, interval) = (builder.scene, builder.plan(index), builder.interval);
        let parts = std::mem::take(&mut builder.masses[index]);
        ask_for_events(&mut builder.exchange, parts.emitters());
        let settings = Settings {
            name: plan.name.clone(),
            interval,
            integrator: plan.integrator,
            stepping: stepping(plan),
            adaptive: plan.adaptive.clone(),
            solver: plan.solver.clone(),
            sweeps: plan.position_based.clone(),
            self_contact: plan.self_contact.clone(),
            counted: scene.expect.max_intersections.is_some(),
            clamp: plan.clamp,
            gravity: builder.gravity.clone(),
            native: scene.bits == Bits::Native,
            colliders: builder.colliders.clone(),
        };
        let inside = buried(builder, &parts, index);
        builder.warnings.extend(inside);
        builder.warnings.extend(coincident::springs(&parts));
        let known = builder.issues.len();
        far::objects(&parts, &mut builder.issues, &mut builder.warnings);
        if builder.issues.len() > known {
            let issues = builder.issues.split_off(known);
            builder.issues.extend(placed(scene, SceneError { issues }).issues);
            return None;
        }
        let mut system = match parts.build(settings) {
            Ok(system) => system,
            Err(error) => {
                builder.issues.extend(placed(scene, error).issues);
                return None;
            }
        };
        builder.warnings.extend(system.tangles());
        builder.warnings.extend(system.doubts(interval));
        // What anchors tie to bodies hangs on them, and is not there to bear them.
        let tied = builder.anchors.iter().any(|anchor| anchor.on_body && anchor.ends[0].0 == index);
        if touches(scene) && !tied {
            builder.warnings.extend(system.yields(interval));
        }
        builder.warnings.extend(system.idle_attachments());
        if builder.exchange.has_bodies(builder.ids[index]) {
            system.expect_pushes();
        }
        for anchor in builder.anchors.clone().iter() {
            hang(&mut system, index, anchor, builder);
        }
        Some(Box::new(system))
    }
}

/// How the objects of a system are drawn, in the order in which `fill` makes them.
fn drawn(scene: &Scene, plan: &Plan, colors: &mut Colors) -> Vec<Look> {
    let mut all = Vec::new();
    let form = |name: &str, form: Form, color: Option<Rgb>, colors: &mut Colors| Look::new(name, form, colors.pick(color));
    all.extend(scene.particles.iter().filter(|t| is_in(&t.system, plan)).map(|t| particles(t, colors)));
    all.extend(scene.emitter.iter().filter(|t| is_in(&t.system, plan)).map(|t| emitted(t, colors)));
    for t in scene.rope.iter().filter(|t| is_in(&t.system, plan)) {
        let few = f64::from(t.segments) + 1.0 < FEW;
        all.push(Look { few, ..form(&t.name, Form::Curve, t.color, colors).with_radius(t.radius) });
    }
    for t in scene.hair.iter().filter(|t| is_in(&t.system, plan)) {
        all.push(Look { strands: t.render, ..form(&t.name, Form::Strands, t.color, colors).with_radius(t.radius) });
    }
    all.extend(scene.sheet.iter().filter(|t| is_in(&t.system, plan)).map(|t| form(&t.name, Form::Surface, t.color, colors)));
    all.extend(scene.block.iter().filter(|t| is_in(&t.system, plan)).map(|t| form(&t.name, Form::Body, t.color, colors)));
    all.extend(scene.net.iter().filter(|t| is_in(&t.system, plan)).map(|t| form(&t.name, Form::Surface, t.color, colors)));
    all.extend(scene.cloth.iter().filter(|t| is_in(&t.system, plan)).map(|t| form(&t.name, Form::Surface, t.color, colors)));
    for t in scene.galaxy.iter().filter(|t| is_in(&t.system, plan)) {
        let look = form(&t.name, Form::Points, t.color, colors).with_radius(t.radius);
        all.push(Look { trail: t.trail, few: f64::from(t.stars) < FEW, ..look });
    }
    all
}

/// The objects of a system, kind by kind, in the order of the scene.
fn fill(builder: &mut Builder<'_>, index: usize, parts: &mut Parts) {
    let (scene, assets) = (builder.scene, builder.assets);
    let plan = builder.plan(index);
    // Issues leave colliders out, and then nothing is built.
    let solids = (builder.colliders.len() == scene.collider.len()).then_some(&builder.colliders[..]);
    let mut site = Site { parts, issues: &mut builder.issues, hints: &mut builder.warnings, up: builder.up, solids, assets };
    scene.particles.iter().filter(|t| is_in(&t.system, plan)).for_each(|t| recipes::particles(&mut site, t));
    scene.emitter.iter().filter(|t| is_in(&t.system, plan)).for_each(|t| emit(&mut site, scene, t));
    scene.rope.iter().filter(|t| is_in(&t.system, plan)).for_each(|t| recipes::rope(&mut site, t));
    for thing in scene.hair.iter().filter(|t| is_in(&t.system, plan)) {
        planted(&mut site, scene, thing, assets, (&builder.colliders, &builder.surfaces));
    }
    scene.sheet.iter().filter(|t| is_in(&t.system, plan)).for_each(|t| recipes::sheet(&mut site, t));
    scene.block.iter().filter(|t| is_in(&t.system, plan)).for_each(|t| recipes::block(&mut site, t));
    for thing in scene.net.iter().filter(|t| is_in(&t.system, plan)) {
        match assets.get(&thing.mesh.path) {
            Some(mesh) => recipes::net(&mut site, thing, &recipes::placed(mesh, &thing.mesh)),
            None => site.issues.push(Issue::new(format!("net \"{}\".mesh", thing.name), "the mesh has not been loaded")),
        }
    }
    scene.cloth.iter().filter(|t| is_in(&t.system, plan)).for_each(|t| recipes::cloth(&mut site, t));
    for thing in scene.galaxy.iter().filter(|t| is_in(&t.system, plan)) {
        let pull = scene.force.iter().find(|f| matches!(f, Words::Gravitation { .. }) && f.on().is_none_or(|on| on.contains(&thing.name)));
        match pull {
            Some(Words::Gravitation { constant, softening, .. }) => recipes::galaxy(&mut site, thing, scene.seed, *constant, *softening),
            _ => {
                let message = "nothing holds it together: add a [[force]] with kind = \"gravitation\" on it";
                site.issues.push(Issue::new(format!("galaxy \"{}\"", thing.name), message));
            }
        }
    }
}

/// The forces on the objects of a system.
fn act(builder: &mut Builder<'_>, parts: &mut Parts) {
    let scene = builder.scene;
    let mut reader = Reader::new(scene, &mut builder.issues);
    for (path, points, words) in std::mem::take(&mut parts.loads) {
        let mass = points.iter().map(|point| parts.mass(*point)).sum();
        let law = Load { force: reader.in_plane(&path, &words), mass };
        parts.forces.push((path, Box::new(law), On::Points(points)));
    }
    for (i, force) in scene.force.iter().enumerate() {
        let (path, others) = (format!("force[{i}]"), others(force));
        let other = |name: &str| others.is_some_and(|(_, others)| others.iter().any(|o| o == name));
        // A flock without a list are all but its predators.
        let spared = |name: &str| matches!(force, Words::Flock { .. }) && other(name);
        let on = |name: &str| force.on().map_or(!spared(name), |on| on.iter().any(|o| o == name));
        let bodies = |of: &dyn Fn(&str) -> bool| -> Vec<usize> { parts.bodies().filter(|(_, name)| of(name)).map(|(i, _)| i).collect() };
        let (on, others) = (bodies(&on), others.map(|_| bodies(&other)));
        if let Some(air) = reader.air(&path, force) {
            parts.times = reader.times().to_vec();
            parts.airs.push((air, on));
            continue;
        }
        match reader.law(&path, force) {
            _ if on.is_empty() => {}
            Some(law) => parts.forces.push((path, law, On::Objects(on))),
            None => {
                builder.warnings.extend(coincident::forces(parts, &path, force, &on, others.as_deref()));
                parts.between.push((force.clone(), on, others));
            }
        }
    }
}

/// What a hair says and cannot mean together: keys and messages.
fn contradictions(thing: &Hair) -> Vec<(&'static str, String)> {
    if thing.guides.is_none() {
        let length = thing.length.is_none().then(|| (".length", "missing, expected a length of strands in m, or guides".into()));
        let count = "expected either a count of strands or per_area, strands per area";
        let count = (thing.count.is_some() == thing.per_area.is_some()).then(|| (".count", count.into()));
        return count.into_iter().chain(length).collect();
    }
    let given = [
        (".count", thing.count.is_some()),
        (".per_area", thing.per_area.is_some()),
        (".above", thing.above.is_some()),
        (".length", thing.length.is_some()),
        (".spread", thing.spread != 0.0),
        (".lean", thing.lean != [0.0; 3]),
        (".curl", thing.curl.is_some()),
        (".clump", thing.clump.is_some()),
    ];
    let message = |key: &str| format!("strands are as their guides say; leave out {}, or guides", &key[1..]);
    given.into_iter().filter(|(_, given)| *given).map(|(key, _)| (key, message(key))).collect()
}

/// Hair on its mesh or collider.
fn planted(site: &mut Site<'_>, scene: &Scene, thing: &Hair, assets: &Assets, (colliders, surfaces): (&[Collider], &[Mesh])) {
    let path = format!("hair \"{}\"", thing.name);
    let mut wrong = |key: &str, message: String| site.issues.push(Issue::new(format!("{path}{key}"), message));
    let contradictions = contradictions(thing);
    if !contradictions.is_empty() {
        return contradictions.into_iter().for_each(|(key, message)| wrong(key, message));
    }
    let fixed = |mesh| recipes::Ground { mesh, pose: Pose::default(), solid: None };
    match (&thing.mesh, &thing.on) {
        (Some(file), None) => match assets.get(&file.path) {
            Some(mesh) => recipes::hair(site, thing, scene.seed, &fixed(Some(&recipes::placed(mesh, file)))),
            None => wrong(".mesh", "the mesh has not been loaded".into()),
        },
        (None, None) if thing.guides.is_some() => match &thing.bone {
            Some(_) => wrong(".bone", "it is a bone of the collider that on names; name that, or leave out bone".into()),
            None => recipes::hair(site, thing, scene.seed, &fixed(None)),
        },
        (None, Some(name)) => {
            let Some(k) = scene.collider.iter().position(|c| c.name == *name) else {
                return wrong(".on", format!("there is no collider \"{name}\""));
            };
            if let Shape::Plane { .. } | Shape::Floor { .. } = scene.collider[k].shape {
                return wrong(".on", format!("collider \"{name}\" has no end; let hair grow on another"));
            }
            // What is wrong with the collider is told elsewhere.
            let (true, Some(mesh)) = (colliders.len() == scene.collider.len(), surfaces.get(k)) else { return };
            let (solid, bones) = (&colliders[k], colliders[k].bones());
            if solid.inside {
                let message =
                    format!("collider \"{name}\" is a container, and hair grows outwards; let it grow on a mesh that faces inwards");
                return wrong(".on", message);
            }
            let bone = match &thing.bone {
                Some(bone) if bones.is_empty() => {
                    return wrong(".bone", format!("collider \"{name}\" has no bones; leave out bone (\"{bone}\")"));
                }
                Some(bone) => match solid.bone(bone) {
                    Some(bone) => Some(bone),
                    None => return wrong(".bone", format!("collider \"{name}\" has no bone \"{bone}\"; known are {}", bones.join(", "))),
                },
                None => None,
            };
            let ground = recipes::Ground { mesh: Some(mesh), pose: solid.pose(Carrier::Whole, 0.0), solid: Some((solid, k, bone)) };
            recipes::hair(site, thing, scene.seed, &ground);
        }
        _ => wrong(".on", "expected either the name of a collider, or a mesh".into()),
    }
}

/// What starts inside a collider, or a rigid body that no anchor ties it to.
fn buried(builder: &Builder<'_>, parts: &Parts, index: usize) -> Vec<Warning> {
    type Start = (f64, Vector);
    let scene = builder.scene;
    let deeper = |a: (f64, f64, usize), b: (f64, f64, usize)| if b.0 > a.0 { b } else { a };
    let deepest = |solids: &[Collider], start: &(dyn Fn(usize) -> Option<Start> + Sync), n: usize, spare: f64| {
        let one = |i: usize| {
            let (t, x) = start(i)?;
            let depth = |(k, c): (usize, &Collider)| Some((c.touch(x, t)?.depth - c.thickness, t, k));
            solids.iter().enumerate().filter_map(depth).filter(|found| found.0 > spare).reduce(deeper)
        };
        fold(n, |range| range.filter_map(one).reduce(deeper)).into_iter().flatten().reduce(deeper)
    };
    let (colliders, bodies) = (&builder.colliders[..], if touches(scene) { surfaces(scene, builder.assets) } else { Vec::new() });
    let ends = builder.anchors.iter().filter(|anchor| anchor.on_body).map(|anchor| anchor.ends[0]);
    let tied: Vec<usize> = ends.filter(|(system, _)| *system == index).map(|(_, row)| row as usize).collect();
    let visits = |name: &str| scene.objects().iter().any(|o| o.name == name && visits_bodies(scene, o));
    let end = scene.frame_time() * f64::from(scene.time.frames);
    let mut found = Vec::new();
    for (name, range) in parts.ranges() {
        let free = |i: usize| (parts.inverse_mass(i as u32) > 0.0).then(|| (0.0, parts.position(i as u32)));
        found.push((name, "collider", deepest(colliders, &|i| free(range.start + i), range.len(), 1e-6), colliders));
        // Held masses throw out the body.
        let loose = |i: usize| (!tied.contains(&i)).then(|| (0.0, parts.position(i as u32)));
        if visits(name) {
            found.push((name, "body", deepest(&bodies, &|i| loose(range.start + i), range.len(), 1e-6), &bodies[..]));
        }
    }
    // A source may touch a surface: particles are not deep in it before they are all in it.
    for e in parts.emitters() {
        let deep = deepest(colliders, &|k| e.trial(k, TRIALS, end), TRIALS, e.first_radius());
        found.push((e.words().name.as_str(), "collider", deep, colliders));
    }
    let told = |(name, kind, found, solids): (&str, &str, Option<(f64, f64, usize)>, &[Collider])| {
        let (deep, t, k) = found?;
        let (deep, solid) = (short(deep), &solids[k].name);
        let out = if kind == "body" { "each other" } else { "it" };
        let when = if t > 0.0 { format!(" at t = {} s", short(t)) } else { String::new() };
        let message =
            format!("masses start{when} up to {deep} m inside {kind} \"{solid}\", and will be thrown out of {out}; move one of them");
        Some(Warning::new(Code::StartsInside, format!("\"{name}\""), message))
    };
    found.into_iter().filter_map(told).collect()
}

/// Between systems the one of the first end owns the spring; the other gives a body.
fn hang(system: &mut Dynamics, index: usize, anchor: &Link, builder: &mut Builder<'_>) {
    let ([(s, a), (t, b)], dt) = (anchor.ends, builder.interval);
    if s != t && t == index {
        system.expect_pushes();
    }
    if s == t || s != index {
        return;
    }
    let other = builder.exchange.open(builder.ids[t], b as usize..b as usize + 1, false)[0];
    system.add_anchor(Anchor {
        row: a as usize,
        other,
        at: anchor.at,
        stiffness: anchor.stiffness.clone(),
        damping: anchor.damping,
        rest_length: anchor.rest_length.clone(),
    });
    let turn = dt * (anchor.stiffest * anchor.inverse_mass).sqrt();
    let damp = dt * anchor.damping * anchor.inverse_mass;
    if builder.scene.world.coupling.is_none() && (turn > 0.5 || damp > 0.5) {
        let times = (2.0 * turn.max(damp)).ceil();
        let message = format!(
            "omega dt = {turn:.2}, c dt/m = {damp:.2}; systems exchange impulses explicitly, which needs both below 0.5: \
             raise time.exchanges {times} times, repeat intervals with world.coupling = {{}}, or put both objects into one system"
        );
        builder.warnings.push(Warning::new(Code::StiffAnchor, format!("anchor \"{}\"", anchor.name), message));
    }
}

/// The issues of objects, at their places in the scene.
fn placed(scene: &Scene, mut error: SceneError) -> SceneError {
    for issue in &mut error.issues {
        if let Some(object) = scene.objects().into_iter().find(|o| o.name == issue.path) {
            issue.path = format!("{} \"{}\"", object.kind, object.name);
        }
    }
    error
}

fn stepping(plan: &Plan) -> Stepping {
    match (plan.substeps, plan.step) {
        (Some(n), _) => Stepping::Substeps(n),
        (None, Some(step)) => Stepping::Step(step),
        (None, None) if plan.integrator == Integrator::PositionBased => Stepping::Step(POSITION_BASED_STEP),
        // An implicit scheme needs no more than one step an interval.
        (None, None) if plan.integrator.is_implicit() => Stepping::Substeps(1),
        (None, None) => Stepping::Automatic,
    }
}
