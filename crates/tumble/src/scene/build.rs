//! Fills systems with objects, forces, solids and anchors.

use super::Assets;
use super::checks::{check, objects, others, place};
use super::coupling;
use super::gas::gas;
use super::hints::unused;
use super::laws::{Reader, flat};
use super::memory::memory;
use super::plausible::implausible;
use crate::exchange::Exchange;
use crate::geometry::motion::Pose;
use crate::geometry::{Carrier, Collider, Vector};
use crate::math::parallel::fold;
use crate::pool::{Course, Emitter as Emission};
use crate::recipes::{self, Site};
use crate::state::Object;
use crate::system::System;
use crate::systems::compressible::{self, Compressible as Loud};
use crate::systems::dynamics::{MOST_SUBSTEPS, Parts, Settings, SpringPart, Stepping};
use crate::systems::heat::{self, Heat as Warm};
use crate::systems::tracers::{self, Tracers};
use crate::systems::vicsek::Swarm;
use crate::world::World;
use std::borrow::Cow;
use std::sync::Arc;
use tumble_interface::check::short;
use tumble_interface::scene::{
    Animated, Bits, Collider as Thing, Field as Stream, Force as Words, Hair, Integrator, MeshFile, Method, Plane, Scene, Shape,
    System as Plan, Vicsek,
};
use tumble_interface::warning::Code;
use tumble_interface::{Column, Data, Issue, Mesh, SceneError, Warning};

/// Births that are looked at before a run.
const TRIALS: usize = 64;

/// Longest sub-step of position-based dynamics where a scene says nothing [s].
const POSITION_BASED_STEP: f64 = 1e-3;

/// A world, the surfaces of its colliders, and what is doubtful about it.
pub struct Built {
    pub world: World,
    pub scenery: Vec<Column>,
    pub colliders: Arc<Vec<Collider>>,
    pub warnings: Vec<Warning>,
}

/// Names of the fluids that carry tracers.
fn fluids(scene: &Scene) -> impl Iterator<Item = &String> {
    scene.field.iter().filter_map(|field| if let Stream::Gas { of } = field { Some(of) } else { None })
}

/// The systems of a scene, or the default ones.
pub fn plans(scene: &Scene) -> Vec<Plan> {
    if !scene.system.is_empty() {
        let named = |plan: &Plan| match plan.method {
            Method::PositionBased => Plan { method: Method::Dynamics, integrator: Integrator::PositionBased, ..plan.clone() },
            _ => plan.clone(),
        };
        return scene.system.iter().map(named).collect();
    }
    // Each method on grids has a system of its own; all other objects are in one of dynamics.
    let mut methods =
        vec![(Method::Gas, scene.gas.len()), (Method::Heat, scene.heat.len()), (Method::Compressible, scene.compressible.len())];
    methods.retain(|(_, count)| *count > 0);
    let others = objects(scene).len() - methods.iter().map(|(_, count)| count).sum::<usize>();
    let plain = (others > 0 || methods.is_empty()).then(Plan::default);
    let own = |(method, _): (Method, usize)| Plan { name: method.name().into(), method, ..Plan::default() };
    let own = methods.into_iter().map(own);
    // What a fluid moves comes after it.
    let moved = scene.gas.iter().any(|gas| !gas.bodies.is_empty() || !gas.sheet.is_empty());
    if moved { own.chain(plain).collect() } else { plain.into_iter().chain(own).collect() }
}

/// Builds the scene, or tells everything that is wrong with it.
pub fn build(scene: &Scene, assets: &Assets) -> Result<Built, SceneError> {
    let plans = plans(scene);
    let mut issues = check(scene, &plans);
    let (needed, limit) = (memory(scene, assets) / 1024.0_f64.powi(3), scene.world.memory_limit);
    if needed > limit {
        let about = if needed < 1.0 { format!("{:.1} MiB", 1024.0 * needed) } else { format!("{needed:.1} GiB") };
        let message = format!(
            "the scene needs about {about}, the limit is {limit} GiB; lower a resolution, a rate or a lifetime, set most, or raise world.memory_limit"
        );
        issues.push(Issue::new("world.memory_limit", message));
        return Err(SceneError { issues });
    }
    let drawn = with_clouds(scene);
    let scene = &*drawn;
    let mut warnings = unused(scene, &plans);
    warnings.extend(implausible(scene, assets));
    let (colliders, scenery, surfaces) = solids(scene, assets, &mut issues);
    let mut parts = fill(scene, &plans, assets, (&colliders, &surfaces), (&mut issues, &mut warnings));
    let anchors: Vec<coupling::Link> =
        scene.anchor.iter().filter_map(|anchor| coupling::link(scene, &plans, anchor, &parts, &mut issues)).collect();
    for anchor in &anchors {
        if let [(s, a), (t, b)] = anchor.ends
            && s == t
        {
            let rest = anchor.rest_length;
            parts[s].begin(&anchor.name, 0.0);
            parts[s].spring(SpringPart {
                ends: [a, b],
                stiffness: anchor.stiffness,
                damping: anchor.damping,
                rest,
                hardening: 0.0,
                tension_only: false,
                break_strain: None,
            });
        }
    }
    act(scene, &mut parts, &mut issues);
    let mut exchange = Exchange::default();
    let mut of_gas = |words| coupling::moved(scene, &plans, words, &parts, &mut exchange, &mut issues);
    let mut moved: Vec<_> = scene.gas.iter().map(&mut of_gas).collect();
    if !issues.is_empty() {
        return Err(SceneError { issues });
    }
    let colliders = Arc::new(colliders);
    let gravity = gravity(scene);
    let dt = scene.frame_time() / f64::from(scene.time.exchanges);
    let mut systems: Vec<Box<dyn System>> = Vec::new();
    for (index, (plan, mut parts)) in plans.iter().zip(parts).enumerate() {
        if plan.method == Method::Tracers {
            for of in fluids(scene) {
                exchange.listen(of);
                let later = scene.gas.iter().find(|gas| gas.name == *of).and_then(|gas| place(&plans, "gas", gas.system.as_deref()));
                if let Some(later) = later.filter(|later| *later > index) {
                    let (own, other) = (&plan.name, &plans[later].name);
                    let message = format!(
                        "comes before \"{other}\", whose gas carries it, and sees it as it was at the beginning of each exchange; put it behind"
                    );
                    warnings.push(Warning::new(Code::LateCarrier, format!("system \"{own}\""), message));
                }
            }
            systems.push(Box::new(carried(scene, &plans, index, dt, parts.take_emitters())?));
            continue;
        }
        if let (Method::Vicsek, Some(words)) = (plan.method, &plan.vicsek) {
            systems.push(Box::new(swarm(scene, &plans, index, words)));
            continue;
        }
        if plan.method == Method::Heat {
            systems.push(Box::new(warm(scene, &plans, index, dt, &mut exchange)?));
            continue;
        }
        if plan.method == Method::Compressible {
            systems.push(Box::new(loud(scene, &plans, index)?));
            continue;
        }
        if plan.method == Method::Gas {
            systems.push(Box::new(gas(scene, &plans, index, gravity, &colliders, &mut moved)?));
            continue;
        }
        let settings = Settings {
            name: plan.name.clone(),
            index,
            interval: dt,
            integrator: plan.integrator,
            stepping: stepping(plan),
            adaptive: plan.adaptive.clone(),
            solver: plan.solver.clone(),
            sweeps: plan.position_based.clone(),
            self_contact: plan.self_contact.clone(),
            counted: scene.expect.max_intersections.is_some(),
            clamp: plan.clamp,
            gravity,
            native: scene.bits == Bits::Native,
            colliders: colliders.clone(),
        };
        warnings.extend(buried(scene, &parts, &colliders));
        let mut system = parts.build(settings).map_err(|e| placed(scene, e))?;
        warnings.extend(system.tangles());
        warnings.extend(system.round_off(dt));
        warnings.extend(system.idle_tethers());
        if exchange.ports_of(index).next().is_some() {
            system.expect_pushes();
        }
        anchors.iter().for_each(|anchor| coupling::hang(&mut system, index, anchor, dt, &mut exchange, &mut warnings));
        systems.push(Box::new(system));
    }
    let world = World::new(systems, exchange, scene.frame_time(), scene.time.exchanges);
    Ok(Built { world, scenery, colliders, warnings })
}

/// What starts inside a collider.
fn buried(scene: &Scene, parts: &Parts, colliders: &[Collider]) -> Vec<Warning> {
    type Start = (f64, Vector);
    let deeper = |a: (f64, f64, usize), b: (f64, f64, usize)| if b.0 > a.0 { b } else { a };
    let deepest = |start: &(dyn Fn(usize) -> Option<Start> + Sync), n: usize, spare: f64| {
        let one = |i: usize| {
            let (t, x) = start(i)?;
            let depth = |(k, c): (usize, &Collider)| Some((c.touch(x, t)?.depth - c.thickness, t, k));
            colliders.iter().enumerate().filter_map(depth).filter(|found| found.0 > spare).reduce(deeper)
        };
        fold(n, |range| range.filter_map(one).reduce(deeper)).into_iter().flatten().reduce(deeper)
    };
    let end = scene.frame_time() * f64::from(scene.time.frames);
    let masses = parts.ranges().map(|(name, range)| {
        let free = |i: usize| (parts.inverse_mass(i as u32) > 0.0).then(|| (0.0, parts.position(i as u32)));
        (name, deepest(&|i| free(range.start + i), range.len(), 1e-6))
    });
    // A source may touch a surface: particles are not deep in it before they are all in it.
    let sources = parts.emitters().map(|e| (e.words().name.as_str(), deepest(&|k| e.trial(k, TRIALS, end), TRIALS, e.words().radius)));
    let told = |(name, found): (&str, Option<(f64, f64, usize)>)| {
        let (deep, t, k) = found?;
        let (deep, solid) = (short(deep), &scene.collider[k].name);
        let when = if t > 0.0 { format!(" at t = {} s", short(t)) } else { String::new() };
        let message =
            format!("masses start{when} up to {deep} m inside collider \"{solid}\", and will be thrown out of it; move one of them");
        Some(Warning::new(Code::StartsInside, format!("\"{name}\""), message))
    };
    masses.chain(sources).filter_map(told).collect()
}

/// The scene with the masses of its clouds drawn.
fn with_clouds(scene: &Scene) -> Cow<'_, Scene> {
    if scene.particles.iter().all(|thing| thing.cloud.is_none() && thing.fluid.is_none()) {
        return Cow::Borrowed(scene);
    }
    let mut scene = scene.clone();
    scene.particles.iter_mut().for_each(|thing| recipes::draw_cloud(thing, scene.seed));
    Cow::Owned(scene)
}

/// The issues of objects, at their places in the scene.
fn placed(scene: &Scene, mut error: SceneError) -> SceneError {
    for issue in &mut error.issues {
        if let Some((kind, name, _)) = objects(scene).into_iter().find(|(_, name, _)| *name == issue.path) {
            issue.path = format!("{kind} \"{name}\"");
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

/// The scene's gravity, without the part that points out of the plane of a two-dimensional scene.
fn gravity(scene: &Scene) -> [f64; 3] {
    let mut g = scene.world.gravity;
    if scene.dimension == 2 {
        g[if scene.plane == Plane::Xz { 1 } else { 2 }] = 0.0;
    }
    g
}

fn solids(scene: &Scene, assets: &Assets, issues: &mut Vec<Issue>) -> (Vec<Collider>, Vec<Column>, Vec<Mesh>) {
    let (mut colliders, mut scenery, mut surfaces) = (Vec::new(), Vec::new(), Vec::new());
    // What meets edges keeps off faces by more than half of its own thickness.
    let thickness = scene.system.iter().filter_map(|s| s.self_contact.as_ref()).map(|words| 0.6 * words.thickness).fold(0.0, f64::max);
    for thing in &scene.collider {
        let thick = Thing { thickness: thing.thickness.max(thickness), ..thing.clone() };
        let thing = if thing.edges { &thick } else { thing };
        if thing.edges && scene.dimension == 2 {
            let message = "true, but masses alone collide in scenes of two dimensions; leave it out";
            issues.push(Issue::new(format!("collider \"{}\".edges", thing.name), message));
        }
        let meshes: Vec<Mesh> = match &thing.shape {
            Shape::Mesh(file) => assets.get(&file.path).map(|mesh| recipes::placed(mesh, file)).into_iter().collect(),
            Shape::AnimatedMesh(frames) => {
                let found: Vec<&Mesh> = frames.frames.iter().filter_map(|f| assets.get(&f.path)).collect();
                recipes::animated(&found, frames)
            }
            _ => Vec::new(),
        };
        let end = scene.frame_time() * f64::from(scene.time.frames);
        let figure = match &thing.shape {
            Shape::Mannequin(words) => Some(recipes::mannequin(words, end)),
            Shape::Character(words) => Some(match assets.character(&words.path) {
                Some(file) => recipes::character(words, file, end),
                None => Err((".shape.character".into(), "the file has not been loaded".into())),
            }),
            _ => None,
        };
        let solid = figure.transpose().and_then(|figure| recipes::solid(thing, &meshes, figure));
        let surface = recipes::scenery(thing, &meshes, solid.as_ref().ok());
        match solid {
            Ok(collider) => colliders.push(collider),
            Err((key, message)) => issues.push(Issue::new(format!("collider \"{}\"{key}", thing.name), message)),
        }
        let mut add = |name: &str, data: Data| {
            if name != "texture" || !data.is_empty() {
                scenery.push(Column::new(&thing.name, name, data));
            }
        };
        add("position", Data::F64(surface.vertices.concat()));
        add("triangles", Data::U32(surface.triangles.concat()));
        add("texture", Data::F32(surface.drawn_texture().concat()));
        surfaces.push(surface);
    }
    (colliders, scenery, surfaces)
}

/// Parts of every system, filled by the recipes in the order of the scene.
fn fill(
    scene: &Scene,
    plans: &[Plan],
    assets: &Assets,
    surfaced: (&[Collider], &[Mesh]),
    (issues, hints): (&mut Vec<Issue>, &mut Vec<Warning>),
) -> Vec<Parts> {
    // Issues leave colliders out, and then nothing is built.
    let named: Vec<(String, Collider)> = scene.collider.iter().map(|c| c.name.clone()).zip(surfaced.0.iter().cloned()).collect();
    let solids = (named.len() == scene.collider.len()).then_some(&named[..]);
    let mut parts: Vec<Parts> = plans.iter().map(|_| Parts::default()).collect();
    let up: Vector = if scene.dimension == 2 && scene.plane == Plane::Xy { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] }.into();
    let mut at = |kind: &str, system: &Option<String>, recipe: &mut dyn FnMut(&mut Site<'_>)| {
        if let Some(index) = place(plans, kind, system.as_deref()) {
            recipe(&mut Site { parts: &mut parts[index], issues: &mut *issues, hints: &mut *hints, up, solids, assets });
        }
    };
    for thing in &scene.particles {
        let method = place(plans, "particles", thing.system.as_deref()).map_or(Method::Dynamics, |i| plans[i].method);
        at("particles", &thing.system, &mut |site| {
            let mut wrong = |path, message: &str| site.issues.push(Issue::new(path, message));
            match method {
                Method::Tracers => drop(recipes::tracers(thing, &mut wrong)),
                Method::Vicsek => drop(recipes::walkers(thing, &mut wrong)),
                // None is placed in a system on grids.
                Method::Dynamics | Method::PositionBased | Method::Heat | Method::Compressible | Method::Gas => {
                    recipes::particles(site, thing)
                }
            }
        });
    }
    let flat = flat(scene);
    for thing in &scene.emitter {
        let mesh = |file: &MeshFile| assets.get(&file.path);
        let at_path = |key: &str| format!("emitter \"{}\".{key}", thing.name);
        at("emitter", &thing.system, &mut |site| {
            let mut reader = Reader::new(scene, site.issues);
            let course = Course {
                rate: reader.signal(&at_path("rate"), &thing.rate, 0.0),
                velocity: reader.in_plane(&at_path("velocity"), &thing.velocity),
                path: reader.in_plane(&at_path("path"), &thing.path),
                end: scene.frame_time() * f64::from(scene.time.frames),
            };
            let tracers = place(plans, "emitter", thing.system.as_deref()).is_some_and(|i| plans[i].method == Method::Tracers);
            recipes::emitter(site, thing, course, (scene.seed, flat, tracers), &mesh);
        });
    }
    for thing in &scene.rope {
        at("rope", &thing.system, &mut |site| recipes::rope(site, thing));
    }
    for thing in &scene.hair {
        at("hair", &thing.system, &mut |site| planted(site, scene, thing, assets, surfaced));
    }
    for thing in &scene.sheet {
        at("sheet", &thing.system, &mut |site| recipes::sheet(site, thing));
    }
    for thing in &scene.block {
        at("block", &thing.system, &mut |site| recipes::block(site, thing));
    }
    for thing in &scene.net {
        at("net", &thing.system, &mut |site| match assets.get(&thing.mesh.path) {
            Some(mesh) => recipes::net(site, thing, &recipes::placed(mesh, &thing.mesh)),
            None => site.issues.push(Issue::new(format!("net \"{}\".mesh", thing.name), "the mesh has not been loaded")),
        });
    }
    for thing in &scene.cloth {
        at("cloth", &thing.system, &mut |site| recipes::cloth(site, thing));
    }
    for thing in &scene.galaxy {
        let pull = scene.force.iter().find(|f| matches!(f, Words::Gravitation { .. }) && f.on().is_none_or(|on| on.contains(&thing.name)));
        at("galaxy", &thing.system, &mut |site| match pull {
            Some(Words::Gravitation { constant, softening, .. }) => recipes::galaxy(site, thing, scene.seed, *constant, *softening),
            _ => {
                let message = "nothing holds it together: add a [[force]] with kind = \"gravitation\" on it";
                site.issues.push(Issue::new(format!("galaxy \"{}\"", thing.name), message));
            }
        });
    }
    parts
}

/// Hair on its mesh or collider.
fn planted(site: &mut Site<'_>, scene: &Scene, thing: &Hair, assets: &Assets, (colliders, surfaces): (&[Collider], &[Mesh])) {
    let path = format!("hair \"{}\"", thing.name);
    let mut wrong = |key: &str, message: String| site.issues.push(Issue::new(format!("{path}{key}"), message));
    if thing.count.is_some() == thing.per_area.is_some() {
        return wrong(".count", "expected either a count of strands or per_area, strands per area".into());
    }
    match (&thing.mesh, &thing.on) {
        (Some(file), None) => match assets.get(&file.path) {
            Some(mesh) => {
                let mesh = recipes::placed(mesh, file);
                recipes::hair(site, thing, scene.seed, &recipes::Ground { mesh: &mesh, pose: Pose::default(), solid: None });
            }
            None => wrong(".mesh", "the mesh has not been loaded".into()),
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
            let ground = recipes::Ground { mesh, pose: solid.pose(Carrier::Whole, 0.0), solid: Some((solid, k, bone)) };
            recipes::hair(site, thing, scene.seed, &ground);
        }
        _ => wrong(".on", "expected either the name of a collider, or a mesh".into()),
    }
}

/// Gives every system the forces that act on its objects, and reads the fields.
fn act(scene: &Scene, parts: &mut [Parts], issues: &mut Vec<Issue>) {
    let mut reader = Reader::new(scene, issues);
    for (i, force) in scene.force.iter().enumerate() {
        let path = format!("force[{i}]");
        // What is wrong with a force is told even where it acts on nothing.
        reader.law(&path, force);
        reader.air(&path, force);
        for parts in &mut *parts {
            let others = others(force);
            let other = |name: &str| others.is_some_and(|(_, others)| others.iter().any(|o| o == name));
            // A flock without a list are all but its predators.
            let spared = |name: &str| matches!(force, Words::Flock { .. }) && other(name);
            let on = |name: &str| force.on().map_or(!spared(name), |on| on.iter().any(|o| o == name));
            let bodies =
                |of: &dyn Fn(&str) -> bool| -> Vec<usize> { parts.bodies().filter(|(_, name)| of(name)).map(|(i, _)| i).collect() };
            let (on, others) = (bodies(&on), others.map(|_| bodies(&other)));
            if let Some(air) = reader.air(&path, force) {
                parts.times = reader.times().to_vec();
                parts.airs.push((air, on));
                continue;
            }
            match reader.law(&path, force) {
                _ if on.is_empty() => {}
                Some(law) => parts.forces.push((path.clone(), law, on)),
                None => parts.between.push((force.clone(), on, others)),
            }
        }
    }
    reader.flow("field", &scene.field);
}

fn carried(scene: &Scene, plans: &[Plan], index: usize, interval: f64, emitters: Vec<Emission>) -> Result<Tracers, SceneError> {
    let plan = &plans[index];
    let (mut x, mut all) = (Vec::new(), Vec::new());
    for thing in scene.particles.iter().filter(|t| place(plans, "particles", t.system.as_deref()) == Some(index)) {
        let first = x.len();
        x.extend(recipes::tracers(thing, &mut |_, _| {}).x);
        all.push(Object { name: thing.name.clone(), points: first..x.len(), radius: thing.radius, ..Object::default() });
    }
    let settings = tracers::Settings {
        name: plan.name.clone(),
        integrator: plan.integrator,
        substeps: plan.substeps,
        step: plan.step,
        adaptive: plan.adaptive.clone(),
    };
    for (stream, emitter) in emitters.iter().enumerate() {
        let (name, radius) = (emitter.words().name.clone(), emitter.words().radius);
        all.push(Object { name, points: x.len()..x.len(), radius, stream: Some(stream), ..Object::default() });
    }
    let flow = Reader::new(scene, &mut Vec::new()).flow("field", &scene.field);
    let mut tracers = Tracers::new(settings, flow, &x, all, emitters);
    tracers.begin_life(interval).map_err(|e| SceneError::one(format!("system \"{}\"", plan.name), e.to_string()))?;
    Ok(tracers)
}

fn swarm(scene: &Scene, plans: &[Plan], index: usize, words: &Vicsek) -> Swarm {
    let (mut points, mut all) = (Vec::new(), Vec::new());
    for thing in scene.particles.iter().filter(|t| place(plans, "particles", t.system.as_deref()) == Some(index)) {
        let first = points.len();
        points.extend(recipes::walkers(thing, &mut |_, _| {}));
        all.push(Object { name: thing.name.clone(), points: first..points.len(), radius: thing.radius, ..Object::default() });
    }
    let plane = if scene.plane == Plane::Xz { [0, 2] } else { [0, 1] };
    Swarm::new(&plans[index], words, scene.seed, plane, &points, all)
}

/// The bodies of a system of heat.
fn warm(scene: &Scene, plans: &[Plan], index: usize, interval: f64, exchange: &mut Exchange) -> Result<Warm, SceneError> {
    let (plan, mut issues, mut bodies) = (&plans[index], Vec::new(), Vec::new());
    for words in scene.heat.iter().filter(|o| place(plans, "heat", o.system.as_deref()) == Some(index)) {
        let path = format!("heat \"{}\"", words.name);
        let (mut unread, mut faults) = (Vec::new(), Vec::new());
        let mut reader = Reader::new(scene, &mut unread);
        let mut signal = |key: &str, value: &Animated| reader.signal(&format!("{path}{key}"), value, f64::NEG_INFINITY);
        let body = recipes::heat(words, flat(scene), &mut signal, &mut |key, message| faults.push((key.to_string(), message)));
        issues.extend(unread);
        issues.extend(faults.into_iter().map(|(key, message)| Issue::new(format!("{path}{key}"), message)));
        let Some(body) = body else { continue };
        let step = plan.substeps.map(|n| interval / f64::from(n)).or(plan.step.map(|step| step.min(interval)));
        let limit = body.limit();
        if let Some(h) = step.filter(|h| *h > limit * (1.0 + 1e-9)) {
            let key = if plan.substeps.is_some() { "substeps" } else { "step" };
            let message = format!(
                "steps of {} s, but explicit diffusion in \"{}\" grows beyond {} s: leave out {key} to have as many as it needs, \
                 or set scheme = \"implicit\"",
                short(h),
                words.name,
                short(limit)
            );
            issues.push(Issue::new(format!("system \"{}\".{key}", plan.name), message));
        }
        let needed = interval / (heat::SAFE * limit);
        if step.is_none() && needed > MOST_SUBSTEPS {
            let message = format!("an interval would take {needed:.0e} explicit steps; set scheme = \"implicit\", or lower the resolution");
            issues.push(Issue::new(format!("{path}.scheme"), message));
        }
        bodies.push(body);
    }
    if !issues.is_empty() {
        return Err(SceneError { issues });
    }
    let settings = heat::Settings { name: plan.name.clone(), index, substeps: plan.substeps, step: plan.step };
    Ok(Warm::new(settings, bodies, exchange))
}

/// The gases of a compressible system.
fn loud(scene: &Scene, plans: &[Plan], index: usize) -> Result<Loud, SceneError> {
    let (plan, mut issues, mut gases) = (&plans[index], Vec::new(), Vec::new());
    for words in scene.compressible.iter().filter(|o| place(plans, "compressible", o.system.as_deref()) == Some(index)) {
        let path = format!("compressible \"{}\"", words.name);
        let mut wrong = |key: &str, message: String| issues.push(Issue::new(format!("{path}{key}"), message));
        gases.extend(recipes::compressible(words, flat(scene), gravity(scene), &mut wrong));
    }
    if !issues.is_empty() {
        return Err(SceneError { issues });
    }
    let settings = compressible::Settings { name: plan.name.clone(), substeps: plan.substeps, step: plan.step };
    Ok(Loud::new(settings, gases))
}
