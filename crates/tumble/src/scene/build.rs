//! From a resolved scene to a world: checks all, builds all, and tells all that is wrong in one list.

use super::Assets;
use super::camera;
use super::checks::check;
use super::coincident;
use super::coupling;
use super::far;
use super::hints::unused;
use super::laws::{Reader, flat};
use super::memory::memory;
use super::methods::{is_in, rules};
use super::plausible::implausible;
use crate::exchange::{Exchange, Happening, SystemId};
use crate::forces::Gravity;
use crate::geometry::{Collider, Vector};
use crate::pool::{self, Course, Origin};
use crate::recipes::{self, Site};
use crate::system::System;
use crate::systems::dynamics::Parts;
use crate::systems::scenery::Scenery;
use crate::world::World;
use std::borrow::Cow;
use std::sync::Arc;
use tumble_interface::scene::{Collider as Thing, Emitter, Event, MeshFile, Plane, Scene, Shape, Source, System as Plan};
use tumble_interface::{Column, Data, Issue, Mesh, SceneError, Warning};

/// A world, and what is doubtful about it.
pub struct Built {
    pub world: World,
    pub warnings: Vec<Warning>,
}

/// What methods build their systems from, and what they find.
pub struct Builder<'a> {
    /// The resolved scene.
    pub scene: &'a Scene,
    pub assets: &'a Assets,
    /// Acceleration of gravity, in the plane of a scene of two dimensions [m/s²].
    pub gravity: Gravity,
    /// Direction that counts as up.
    pub up: Vector,
    /// Length of an exchange interval [s].
    pub interval: f64,
    /// Those without faults; what is made of them otherwise is dropped.
    pub colliders: Arc<Vec<Collider>>,
    /// Their surfaces.
    pub surfaces: Vec<Mesh>,
    /// Masses and elements of each system that has some.
    pub masses: Vec<Parts>,
    /// Anchors whose ends have been found.
    pub anchors: Arc<Vec<coupling::Link>>,
    pub exchange: Exchange,
    /// Of each system.
    pub ids: Vec<SystemId>,
    pub issues: Vec<Issue>,
    pub warnings: Vec<Warning>,
    /// Whether masses and elements are free of issues, so that their systems can be built.
    pub sound: bool,
}

impl<'a> Builder<'a> {
    /// The words of a system.
    pub fn plan(&self, index: usize) -> &'a Plan {
        &self.scene.system[index]
    }
}

/// Builds a resolved scene, or tells everything that is wrong with it.
pub fn build(scene: &Scene, assets: &Assets) -> Result<Built, SceneError> {
    let mut issues = check(scene);
    if let Some(issue) = too_large(scene, assets) {
        issues.push(issue);
        return Err(SceneError { issues });
    }
    let mut warnings = unused(scene);
    warnings.extend(implausible(scene, assets));
    let drawn = with_clouds(scene);
    let scene = &*drawn;
    let (colliders, meshes, surfaces) = solids(scene, assets, &mut issues);
    let colliders = Arc::new(colliders);
    let mut exchange = Exchange::default();
    let scenery = (exchange.enter("scenery"), Box::new(Scenery::new(colliders.clone(), meshes)) as Box<dyn System>);
    let ids: Vec<SystemId> = scene.system.iter().map(|plan| exchange.enter(&plan.name)).collect();
    let mut builder = Builder {
        scene,
        assets,
        gravity: gravity(scene, &mut issues),
        up: if scene.dimension == 2 && scene.plane == Plane::Xy { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] }.into(),
        interval: scene.interval(),
        colliders,
        surfaces,
        masses: scene.system.iter().map(|_| Parts::default()).collect(),
        anchors: Arc::default(),
        exchange,
        ids,
        issues,
        warnings,
        sound: false,
    };
    let methods: Vec<_> = scene.system.iter().map(|plan| rules(plan.method)).collect();
    methods.iter().enumerate().for_each(|(index, method)| method.fill(&mut builder, index));
    if builder.colliders.len() == scene.collider.len() && methods.iter().any(|method| method.meets_colliders()) {
        builder.warnings.extend(far::solids(scene, &builder.colliders));
    }
    Reader::new(scene, &mut builder.issues).flow("field", &scene.field);
    builder.issues.extend(camera::check(scene));
    builder.anchors = Arc::new(coupling::fasten(builder.scene, builder.assets, &mut builder.masses, &mut builder.issues));
    builder.warnings.extend(builder.anchors.iter().filter_map(|link| coincident::anchor(&builder.masses, link)));
    builder.sound = builder.issues.is_empty();
    let systems: Vec<Option<Box<dyn System>>> =
        methods.iter().enumerate().map(|(index, method)| method.build(&mut builder, index)).collect();
    let Builder { ids, exchange, issues, warnings, .. } = builder;
    match systems.into_iter().collect::<Option<Vec<_>>>() {
        Some(systems) if issues.is_empty() => {
            let systems = ids.into_iter().zip(systems).chain([scenery]).collect();
            let mut world = World::new(systems, exchange, scene.frame_time(), scene.exchanges());
            world.repeat_until_agreed(scene.world.coupling.clone());
            Ok(Built { world, warnings })
        }
        _ => Err(SceneError { issues }),
    }
}

/// A scene that needs more memory than it may have.
fn too_large(scene: &Scene, assets: &Assets) -> Option<Issue> {
    let (needed, limit) = (memory(scene, assets) / 1024.0_f64.powi(3), scene.world.memory_limit);
    let about = if needed < 1.0 { format!("{:.1} MiB", 1024.0 * needed) } else { format!("{needed:.1} GiB") };
    let message = format!(
        "the scene needs about {about}, the limit is {limit} GiB; lower a resolution, a rate or a lifetime, set most, or raise world.memory_limit"
    );
    (needed > limit).then(|| Issue::new("world.memory_limit", message))
}

/// An emitter in a system.
pub fn emit(site: &mut Site<'_>, scene: &Scene, thing: &Emitter) {
    let at = |key: &str| format!("emitter \"{}\".{key}", thing.name);
    let assets = site.assets;
    let mut reader = Reader::new(scene, site.issues);
    let course = Course {
        rate: reader.signal(&at("rate"), &thing.rate, 0.0),
        velocity: reader.in_plane(&at("velocity"), &thing.velocity),
        speed: reader.signal(&at("speed"), &thing.speed, f64::NEG_INFINITY),
        cone: reader.signal_within(&at("cone"), &thing.cone, [0.0, 180.0]),
        path: reader.in_plane(&at("path"), &thing.path),
        lifetime: thing.lifetime.as_ref().map(|lifetime| reader.positive(&at("lifetime"), lifetime)),
        radius: reader.positive(&at("radius"), &thing.radius),
        colors: [("color", &thing.color), ("color_to", &thing.color_to), ("color_end", &thing.color_end)]
            .map(|(key, words)| words.as_ref().map(|words| reader.color(&at(key), words))),
        end: scene.frame_time() * f64::from(scene.time.frames),
    };
    let parent = parent(scene, thing);
    if let (Source::Particles { at: Event::Bounce, .. }, Some((words, _))) = (&thing.from, parent)
        && !scene.system.iter().any(|plan| is_in(&words.system, plan) && rules(plan.method).meets_colliders())
    {
        let message = format!("\"{}\" meets no colliders; leave it out, or move \"{0}\" by a dynamics system", words.name);
        site.issues.push(Issue::new(at("from.particles.at"), message));
    }
    recipes::emitter(site, thing, course, (scene.seed, flat(scene)), parent, &|file: &MeshFile| assets.get(&file.path));
}

/// The emitter of an emitter's parents, and whether it is in another system, which has its turn before.
fn parent<'a>(scene: &'a Scene, thing: &Emitter) -> Option<(&'a Emitter, bool)> {
    let Source::Particles { of, .. } = &thing.from else { return None };
    let words = scene.emitter.iter().find(|other| other.name == *of)?;
    let turn = |emitter: &Emitter| scene.system.iter().position(|plan| is_in(&emitter.system, plan));
    Some((words, turn(words)? < turn(thing)?))
}

/// Asks for the events of parents in other systems.
pub fn ask_for_events<'a>(exchange: &mut Exchange, emitters: impl Iterator<Item = &'a pool::Emitter>) {
    for emitter in emitters {
        if let Origin::Elsewhere(of) = &emitter.from {
            exchange.listen(of, emitter.is_stirred_by(Happening::Contact));
        }
    }
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

/// The scene's gravity, without the part of a constant one that points out of the plane of a two-dimensional scene.
fn gravity(scene: &Scene, issues: &mut Vec<Issue>) -> Gravity {
    let mut reader = Reader::new(scene, issues);
    let course = match scene.world.gravity.constant() {
        Some(mut g) => {
            flat(scene).into_iter().for_each(|axis| g[axis] = 0.0);
            g.into()
        }
        None => reader.in_plane("world.gravity", &scene.world.gravity),
    };
    let largest = reader.largest(|t| course.value(t).norm(), course.key_times());
    Gravity { course, largest }
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
        // One beyond the end, so that surfaces still move there.
        let times: Vec<f64> = (0..=scene.time.frames + 1).map(|frame| scene.frame_time() * f64::from(frame)).collect();
        let solid = figure.transpose().and_then(|figure| recipes::solid(thing, &meshes, figure, &times));
        let surface = recipes::scenery(thing, &meshes, solid.as_ref().ok());
        match solid {
            Ok(collider) => {
                let (friction, rubbing) = Reader::new(scene, issues).friction(thing);
                colliders.push(Collider { friction, rubbing, ..collider });
            }
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
