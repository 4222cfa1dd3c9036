//! Rigid bodies: words to shapes, masses and states.

use super::{MethodRules, is_in, lists, moves_bodies, scheme_of_its_own, touches, visits_bodies};
use crate::exchange::{BodyRow, BodySurface};
use crate::geometry::motion::Key;
use crate::geometry::{Collider, Motion, Vector};
use crate::recipes;
use crate::scene::Assets;
use crate::scene::build::Builder;
use crate::scene::laws::{Reader, flat, off_plane};
use crate::scene::plausible::odd_density;
use crate::system::System;
use crate::systems::rigid::{Bodies, Body as State, Ends, Joint, Object, Rigid, Settings, refusal};
use std::ops::Range;
use std::sync::Arc;
use tumble_interface::check::short;
use tumble_interface::looks::{Colors, FEW, Form, Look, SOLID};
use tumble_interface::scene::{Body, MeshFile, Method, Scene, System as Plan};
use tumble_interface::warning::Code;
use tumble_interface::{Issue, Mesh, Warning};

/// Bytes for a body: its state, contacts with some ten neighbours, and a snapshot.
const BODY: f64 = 12_000.0;

pub struct Rules;

impl MethodRules for Rules {
    fn words(&self) -> &'static [Method] {
        &[Method::Rigid]
    }

    fn kinds(&self) -> &'static [&'static str] {
        &["body", "joint"]
    }

    fn massless(&self) -> Option<&'static str> {
        Some("rigid bodies")
    }

    fn meets_colliders(&self) -> bool {
        true
    }

    fn own_scheme(&self) -> Option<&'static str> {
        Some("rigid bodies have a scheme of their own and no integrator")
    }

    fn noun(&self) -> &'static str {
        "rigid body"
    }

    fn theory(&self) -> &'static [(&'static str, &'static [&'static str])] {
        &[("rigid", &["rigid.1", "rigid.4"])]
    }

    fn check(&self, scene: &Scene, issues: &mut Vec<Issue>) {
        scheme_of_its_own(scene, Method::Rigid, "rigid bodies", |plan| plan.rigid.is_some(), issues);
        for joint in &scene.joint {
            let object = |words: &String| {
                let name = recipes::named(words).map_or(words.as_str(), |(name, _)| name);
                scene.body.iter().find(|thing| thing.name == *words || thing.name == name)
            };
            let systems: Vec<&str> = joint.between.iter().filter_map(object).filter_map(|thing| thing.system.as_deref()).collect();
            let (path, own) = (format!("joint \"{}\"", joint.name), joint.system.as_deref());
            match systems[..] {
                [a, b] if a != b => {
                    let message = format!("its bodies are moved by systems \"{a}\" and \"{b}\"; put both into one");
                    issues.push(Issue::new(format!("{path}.between"), message));
                }
                [other, ..] if own.is_some_and(|own| own != other) => {
                    let message = format!("its bodies are moved by system \"{other}\"; set system = \"{other}\"");
                    issues.push(Issue::new(format!("{path}.system"), message));
                }
                _ => {}
            }
        }
        changing(scene, issues);
        if let Some(axis) = flat(scene) {
            scene.body.iter().for_each(|thing| in_plane(thing, axis, issues));
        }
    }

    fn hints(&self, scene: &Scene) -> Vec<Warning> {
        let odd = |thing: &Body| odd_density(format!("body \"{}\".density", thing.name), thing.density?, 0.0);
        let mut warnings: Vec<Warning> = scene.body.iter().filter_map(odd).collect();
        // What an anchor ties to a body is meant to be there.
        let ends = |words: &[String; 2]| words.each_ref().map(|end| recipes::named(end).map_or(end.clone(), |(name, _)| name.to_string()));
        let tied =
            |name: &str| {
                scene.anchor.iter().map(|anchor| ends(&anchor.between)).any(|ends| {
                    ends.iter().any(|end| end == name) && ends.iter().any(|end| scene.body.iter().any(|thing| thing.name == *end))
                })
            };
        let fluids =
            scene.gas.iter().map(|gas| (&gas.name, &gas.bodies)).chain(scene.liquid.iter().map(|thing| (&thing.name, &thing.bodies)));
        let moving: Vec<&String> = fluids.filter(|(_, names)| moves_bodies(scene, names)).map(|(name, _)| name).collect();
        let moves = |name: &str| moving.iter().any(|fluid| *fluid == name);
        let others = scene
            .objects()
            .into_iter()
            .filter(|o| !matches!(o.kind, "body" | "joint") && !tied(o.name) && !visits_bodies(scene, o) && !moves(o.name));
        let kinds: Vec<&str> = others.map(|o| o.kind).collect();
        if let (Some(other), false) = (kinds.first(), scene.body.is_empty()) {
            let message = format!(
                "rigid bodies meet each other, colliders, grains, people, and masses of dynamics systems, and a gas or a liquid where its `bodies` name them, but not what [[{other}]] consists of, nor does that meet them"
            );
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
        let look = |t: &Body| {
            let color = colors.pick(t.color);
            let of = |name: String| Look { few: t.count() < FEW, ..Look::new(&name, Form::Instances, color) };
            t.parts().into_iter().map(of).collect::<Vec<_>>()
        };
        let joints = scene.joint.iter().filter(|t| is_in(&t.system, plan));
        let held = |t: &tumble_interface::scene::Joint| Look { few: true, ..Look::new(&t.name, Form::Points, t.color.unwrap_or(SOLID)) };
        own.flat_map(look).chain(joints.map(held)).collect()
    }

    fn memory(&self, scene: &Scene, _assets: &Assets) -> f64 {
        let of = |words: &tumble_interface::scene::Joint| {
            let chain = scene.body.iter().find(|thing| words.chain && words.between.first() == Some(&thing.name));
            chain.map_or(1.0, Body::count)
        };
        BODY * (scene.body.iter().map(rows_of).sum::<f64>() + scene.joint.iter().map(of).sum::<f64>())
    }

    fn build(&self, builder: &mut Builder<'_>, index: usize) -> Option<Box<dyn System>> {
        let (scene, plan) = (builder.scene, builder.plan(index));
        let (mut objects, mut bodies, mut solids) = (Vec::new(), Bodies::default(), Vec::new());
        for thing in scene.body.iter().filter(|t| is_in(&t.system, plan)) {
            match recipes::bodies(thing, &file_of(builder.assets), scene.seed) {
                Ok(mut made) => {
                    if let Some(axis) = flat(scene) {
                        if thing.arrange.is_some() && made.bodies.iter().any(|body| <[f64; 3]>::from(body.x)[axis] != 0.0) {
                            let message = "it leads out of the plane of a scene of dimension 2; give positions, or set dimension = 3";
                            builder.issues.push(Issue::new(format!("body \"{}\".arrange", thing.name), message));
                        }
                        made.bodies.iter_mut().for_each(|body| body.across = Some(axis));
                    }
                    let (first, each) = (bodies.rows.len(), thing.pieces());
                    let (hull, left) = made.hull();
                    builder.warnings.extend(left.map(|left| coarse(thing, left)));
                    let (rows, volume) = (first..first + each * made.count(), made.volume());
                    bodies.rows.resize(rows.end, State::WORLD);
                    made.bodies.iter().enumerate().for_each(|(i, body)| bodies.rows[first + i * each] = *body);
                    // Clusters of pieces have surfaces of their own.
                    for row in rows.clone() {
                        let new = each > 1 || row == first;
                        bodies.hulls.extend(new.then(|| hull.clone()));
                        bodies.hull.push(bodies.hulls.len() as u32 - 1);
                    }
                    solids.push((Arc::new(made.solid), hull.reach, volume));
                    let pattern = made.pattern.map(|pattern| (pattern, None));
                    objects.push(Object {
                        name: thing.name.clone(),
                        rows,
                        mesh: made.mesh,
                        birth: made.birth,
                        sleeps: thing.sleeping,
                        pattern,
                    });
                }
                Err((key, message)) => builder.issues.push(Issue::new(format!("body \"{}\"{key}", thing.name), message)),
            }
        }
        bodies.moving = bodies.rows.len();
        if touches(scene) {
            let rows = builder.exchange.open(builder.ids[index], 0..bodies.moving, true);
            for ((solid, reach, volume), object) in solids.into_iter().zip(&mut objects) {
                let mut cover =
                    |rows: &[BodyRow]| builder.exchange.cover(BodySurface { rows: rows.to_vec(), solid: solid.clone(), reach, volume });
                let own = &rows[object.rows.clone()];
                match &mut object.pattern {
                    None => {
                        cover(own);
                    }
                    Some((_, first)) => *first = own.chunks(1).map(cover).reduce(|first, _| first),
                }
            }
        }
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
        let (ends, joints) = joined(builder, plan, &objects, &bodies);
        let mut system = Rigid::new(settings, objects, bodies, ends, joints);
        if builder.issues.is_empty() {
            system.meet(&builder.colliders);
            builder.warnings.extend(deepest(&mut system));
        }
        Some(Box::new(system))
    }
}

/// What would leave the plane of a scene of two dimensions; `axis` is across it.
fn in_plane(thing: &Body, axis: usize, issues: &mut Vec<Issue>) {
    let mut wrong = |key: &str, message: String| issues.push(Issue::new(format!("body \"{}\".{key}", thing.name), message));
    for (key, list) in [("position", &thing.position), ("velocity", &thing.velocity)] {
        if let Some(v) = list.iter().find(|v| v[axis] != 0.0) {
            wrong(key, off_plane(axis, v[axis]));
        }
    }
    if let Some(w) = thing.angular_velocity.iter().find(|w| (0..3).any(|k| k != axis && w[k] != 0.0)) {
        wrong("angular_velocity", format!("{w:?}, expected a turn about {} in a scene of dimension 2", ["x", "y", "z"][axis]));
    }
    for (key, given) in [("emit", thing.emit.is_some()), ("fracture", thing.fracture.is_some())] {
        if given {
            wrong(key, "it needs space; leave it out, or set dimension = 3".into());
        }
    }
}

/// Rows of a thing.
fn rows_of(thing: &Body) -> f64 {
    thing.count() * thing.pieces() as f64
}

/// What cannot hold or move bodies that are born, or break.
fn changing(scene: &Scene, issues: &mut Vec<Issue>) {
    let named = |words: &str| {
        let name = recipes::named(words).map_or(words, |(name, _)| name).to_string();
        scene.body.iter().find(|thing| thing.name == words || thing.name == name)
    };
    let mut wrong = |path: String, message: String| issues.push(Issue::new(path, message));
    for joint in &scene.joint {
        if let Some(thing) = joint.between.iter().filter_map(|words| named(words)).find(|thing| thing.emit.is_some()) {
            let message = format!("bodies of \"{}\" are born during the run, and are not there to be joined; leave out emit", thing.name);
            wrong(format!("joint \"{}\".between", joint.name), message);
        }
    }
    let why = |thing: &Body| match (&thing.emit, &thing.fracture) {
        (Some(_), _) => Some("are born during the run"),
        (_, Some(_)) => Some("break"),
        _ => None,
    };
    for anchor in &scene.anchor {
        for (k, words) in anchor.between.iter().enumerate() {
            if let Some((thing, why)) = named(words).and_then(|thing| Some((thing, why(thing)?))) {
                let message = format!("bodies of \"{}\" {why}; an anchor needs a body that stays as it is", thing.name);
                wrong(format!("anchor \"{}\".between[{k}]", anchor.name), message);
            }
        }
    }
    for (at, names) in lists(scene) {
        for name in names {
            if let Some((thing, why)) = scene.body.iter().find(|thing| thing.name == *name).and_then(|thing| Some((thing, why(thing)?))) {
                let message = format!("bodies of \"{}\" {why}, and a fluid moves bodies that stay as they are; leave them out", thing.name);
                wrong(at.clone(), message);
            }
        }
    }
    for (i, probe) in scene.expect.probe.iter().enumerate() {
        if let Some(thing) = scene.body.iter().find(|thing| thing.name == probe.object && thing.fracture.is_some()) {
            let message = format!("\"{0}\" breaks, and its pieces are in frames: name one, as \"{0}.1\"", thing.name);
            wrong(format!("expect.probe[{i}].object"), message);
        }
    }
}

/// Convex parts of a mesh are larger than it by this part, more than meant.
fn coarse(thing: &Body, left: f64) -> Warning {
    let message = format!("its convex parts fill {} % more than its mesh; raise most, or tolerance if that will do", short(100.0 * left));
    Warning::new(Code::CoarseParts, format!("body \"{}\".shape", thing.name), message)
}

/// The first row of an object's bodies in their system, and the bodies, unless there is no such object or its words are wrong.
pub fn bodies_of(scene: &Scene, assets: &Assets, name: &str) -> Option<(usize, recipes::Made)> {
    let thing = scene.body.iter().find(|thing| thing.name == name)?;
    let before = scene.body.iter().take_while(|other| other.name != name).filter(|other| other.system == thing.system);
    Some((before.map(rows_of).sum::<f64>() as usize, recipes::bodies(thing, &file_of(assets), scene.seed).ok()?))
}

/// The surfaces of all bodies that masses touch, where they start.
pub fn surfaces(scene: &Scene, assets: &Assets) -> Vec<Collider> {
    let made = scene.body.iter().filter_map(|thing| recipes::bodies(thing, &file_of(assets), scene.seed).ok());
    let zero = Vector::default();
    let placed = |solid: &Collider, body: &State| {
        let keys = vec![Key { time: 0.0, shift: body.x, turn: body.q }];
        Collider { motion: Some(Motion { velocity: zero, spin: zero, pivot: zero, keys, smooth: false }), ..solid.clone() }
    };
    made.flat_map(|made| made.bodies.iter().map(|body| placed(&made.solid, body)).collect::<Vec<_>>()).collect()
}

/// Finds the meshes of bodies.
fn file_of(assets: &Assets) -> impl Fn(&MeshFile) -> Option<Mesh> {
    |file| assets.get(&file.path).map(|mesh| recipes::placed(mesh, file))
}

/// The joints of a system.
fn joined(builder: &mut Builder<'_>, plan: &Plan, objects: &[Object], bodies: &Bodies) -> (Vec<Ends>, Vec<Joint>) {
    let each = |object: &Object| object.pattern.as_ref().map_or(1, |(pattern, _)| pattern.pieces.len());
    let named: Vec<(&str, Range<usize>, usize)> =
        objects.iter().map(|object| (object.name.as_str(), object.rows.clone(), each(object))).collect();
    let (mut ends, mut all) = (Vec::new(), Vec::new());
    for words in builder.scene.joint.iter().filter(|t| is_in(&t.system, plan)) {
        let path = format!("joint \"{}\"", words.name);
        let mut reader = Reader::new(builder.scene, &mut builder.issues);
        let made =
            recipes::joints(words, &named, bodies, &mut |key, value, range| reader.signal_within(&format!("{path}{key}"), value, range));
        match made {
            Ok(made) => {
                if let Some([away, reach]) = made.far {
                    let message = format!(
                        "{} m from the centre of a body that reaches {} m; check `at` and `to`, which are places in the world",
                        short(away),
                        short(reach)
                    );
                    builder.warnings.push(Warning::new(Code::FarJoint, path, message));
                }
                ends.push(Ends { name: words.name.clone(), joints: all.len()..all.len() + made.joints.len() });
                all.extend(made.joints);
            }
            Err((key, message)) => builder.issues.push(Issue::new(format!("{path}{key}"), message)),
        }
    }
    (ends, all)
}

/// The two surfaces that overlap most at the start.
fn deepest(system: &mut Rigid) -> Option<Warning> {
    let (a, row, b, depth) = system.overlap()?;
    let which = row.map_or(String::new(), |row| format!("number {row} "));
    let message = format!(
        "{which}starts {} m deep in \"{b}\"; it is pushed out at no more than 3 m/s. Move one of them, unless that is meant",
        short(depth)
    );
    Some(Warning::new(Code::StartsInside, format!("body \"{a}\""), message))
}
