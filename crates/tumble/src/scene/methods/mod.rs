//! Methods: each file holds all that the scene layer knows of one, and `METHODS` is the table of them.

mod compressible;
mod crowd;
mod dynamics;
mod gas;
mod grains;
mod heat;
mod liquid;
mod movers;
mod rigid;
mod tracers;
mod vicsek;

pub use rigid::{bodies_of, surfaces};

use super::Assets;
use super::build::Builder;
use super::laws::flat;
use crate::math::formula::Of;
use crate::math::{Signal, VectorSignal};
use crate::system::System;
use serde::Serialize;
use tumble_interface::looks::{Colors, FEW, Form, LIQUID, Look, RADIUS, SMOKE};
use tumble_interface::scene::{Emitter, Integrator, Method, Object, Particles, Scene, System as Plan};
use tumble_interface::warning::Code;
use tumble_interface::{Issue, Warning};

/// All methods. Where several can move a kind of objects, the first is its default.
/// A constant: as a static it would be compiled into the unit tests, with the whole engine behind it.
pub const METHODS: [&dyn MethodRules; 10] = [
    &dynamics::Rules,
    &tracers::Rules,
    &vicsek::Rules,
    &rigid::Rules,
    &grains::Rules,
    &gas::Rules,
    &liquid::Rules,
    &heat::Rules,
    &compressible::Rules,
    &crowd::Rules,
];

/// Exchanges a second where masses and rigid bodies touch: in one interval a body falls 0.1 mm before what bears it says so.
const RATE: f64 = 240.0;

/// What the scene layer knows of a method. Scenes that it is given are resolved, but for `leads`.
pub trait MethodRules: Sync {
    /// Its word in scenes, and other words for it.
    fn words(&self) -> &'static [Method];

    /// Kinds of objects that it can move.
    fn kinds(&self) -> &'static [&'static str];

    /// Its main word.
    fn name(&self) -> &'static str {
        self.words()[0].name()
    }

    /// Its system in scenes that list none.
    fn default_system(&self) -> Plan {
        Plan { name: self.name().into(), method: self.words()[0], ..Plan::default() }
    }

    /// Whether its default system must come before those of other methods.
    fn leads(&self, _scene: &Scene) -> bool {
        false
    }

    /// Writes out what another word for it means.
    fn normalize(&self, _plan: &mut Plan) {}

    /// What its objects are, if they are no masses, which forces move.
    fn massless(&self) -> Option<&'static str> {
        None
    }

    /// Whether its objects meet colliders.
    fn meets_colliders(&self) -> bool {
        false
    }

    /// Whether its objects lie on grids.
    fn is_on_grids(&self) -> bool {
        false
    }

    /// The word for one of its points.
    fn noun(&self) -> &'static str {
        "mass"
    }

    /// Why integrators do not step it; `None` if they do.
    fn own_scheme(&self) -> Option<&'static str> {
        None
    }

    /// Why an integrator cannot step it; `None` if it can.
    fn refusal(&self, integrator: Integrator) -> Option<String> {
        self.own_scheme().filter(|_| integrator != Integrator::default()).map(|why| format!("{why}; leave it out"))
    }

    /// Pages of theory that its objects are on, with the equations shown first.
    fn theory(&self) -> &'static [(&'static str, &'static [&'static str])] {
        &[]
    }

    /// What is wrong with its words, before anything is built.
    fn check(&self, _scene: &Scene, _issues: &mut Vec<Issue>) {}

    /// What is doubtful about its words.
    fn hints(&self, _scene: &Scene) -> Vec<Warning> {
        Vec::new()
    }

    /// How the objects of one of its systems are drawn, in the order of its columns.
    fn looks(&self, scene: &Scene, plan: &Plan, colors: &mut Colors) -> Vec<Look>;

    /// Bytes that its objects need, an upper estimate; those of kinds whose default is another method are counted there.
    fn memory(&self, scene: &Scene, assets: &Assets) -> f64;

    /// Adds masses and elements to a system, before any system is built: other systems may hold on to them.
    fn fill(&self, _builder: &mut Builder<'_>, _index: usize) {}

    /// Builds a system; what is wrong with its objects goes to the builder's issues.
    fn build(&self, builder: &mut Builder<'_>, index: usize) -> Option<Box<dyn System>>;
}

/// What fronts know of a method.
#[derive(Debug, Serialize)]
pub struct Facts {
    /// Its words in scenes, the main one first.
    pub words: Vec<&'static str>,
    /// Kinds of objects that it can move.
    pub kinds: &'static [&'static str],
    /// The word for one of its points.
    pub noun: &'static str,
    /// Why integrators do not step it; none if they do.
    pub own_scheme: Option<&'static str>,
    /// Whether forces move its points.
    pub has_masses: bool,
    /// Pages of theory, with the equations shown first.
    pub theory: &'static [(&'static str, &'static [&'static str])],
}

/// What fronts know of the methods.
pub fn facts() -> Vec<Facts> {
    let of = |m: &'static dyn MethodRules| Facts {
        words: m.words().iter().map(|word| word.name()).collect(),
        kinds: m.kinds(),
        noun: m.noun(),
        own_scheme: m.own_scheme(),
        has_masses: m.massless().is_none(),
        theory: m.theory(),
    };
    METHODS.into_iter().map(of).collect()
}

/// The rules of a method.
pub fn rules(method: Method) -> &'static dyn MethodRules {
    METHODS.into_iter().find(|m| m.words().contains(&method)).unwrap_or(METHODS[0])
}

/// The method that moves a kind of objects by default.
pub fn default_of(kind: &str) -> &'static dyn MethodRules {
    METHODS.into_iter().find(|m| m.kinds().contains(&kind)).unwrap_or(METHODS[0])
}

/// The system that moves an object of this kind: the one it names, else the first that can.
pub fn place(systems: &[Plan], kind: &str, named: Option<&str>) -> Option<usize> {
    systems.iter().position(|s| rules(s.method).kinds().contains(&kind) && named.is_none_or(|name| s.name == name))
}

/// Whether an object of a resolved scene is in a system.
pub fn is_in(system: &Option<String>, plan: &Plan) -> bool {
    system.as_ref() == Some(&plan.name)
}

/// What is wrong with systems of a method that has a table of its own name for its settings, and heeds no words for integrators.
fn scheme_of_its_own(scene: &Scene, method: Method, what: &str, given: fn(&Plan) -> bool, issues: &mut Vec<Issue>) {
    let name = method.name();
    for plan in &scene.system {
        let at = |key: &str| format!("system \"{}\".{key}", plan.name);
        if plan.method != method {
            if given(plan) {
                let message = format!("given with method \"{}\"; leave it out, or set method = \"{name}\"", plan.method.name());
                issues.push(Issue::new(at(name), message));
            }
            continue;
        }
        let plain = Plan::default();
        let idle = [
            ("clamp", plan.clamp != plain.clamp),
            ("adaptive", plan.adaptive != plain.adaptive),
            ("solver", plan.solver != plain.solver),
            ("position_based", plan.position_based != plain.position_based),
            ("self_contact", plan.self_contact != plain.self_contact),
        ];
        for (key, _) in idle.into_iter().filter(|(_, idle)| *idle) {
            let message = format!("says nothing to {what}; leave it out, `substeps`, `step` and `{name}` are theirs");
            issues.push(Issue::new(at(key), message));
        }
    }
}

/// Words of particles that only masses have, and that are given.
fn words_of_masses(thing: &Particles) -> impl Iterator<Item = &'static str> {
    let given = [
        ("mass", thing.mass != [1.0]),
        ("charge", !thing.charge.is_empty()),
        ("pin", !thing.pin.is_empty()),
        ("load", !thing.load.is_empty()),
        ("point_mass", !thing.point_mass.is_empty()),
        ("spring", !thing.spring.is_empty()),
        ("shape_matching", thing.shape_matching.is_some()),
        ("fluid", thing.fluid.is_some()),
    ];
    given.into_iter().filter_map(|(key, given)| given.then_some(key))
}

/// Particles, as all methods draw them.
fn particles(thing: &Particles, colors: &mut Colors) -> Look {
    let liquid = thing.fluid.as_ref().map_or(0.0, |fluid| fluid.count());
    let count = thing.position.len() as f64 + thing.cloud.as_ref().map_or(0.0, |c| f64::from(c.count)) + liquid;
    let look = Look::new(&thing.name, Form::Points, colors.pick(thing.color)).with_radius(thing.radius);
    Look { trail: thing.trail, few: count < FEW, ..look }
}

/// Emitted particles, as all methods draw them.
fn emitted(thing: &Emitter, colors: &mut Colors) -> Look {
    // A radius or colour that changes is in frames; what is drawn before has the first.
    let first_radius = || Signal::new(&thing.radius).map_or(RADIUS, |radius| radius.value(thing.start));
    let radius = if thing.radius_spread > 0.0 { RADIUS } else { first_radius() };
    let first = |color| VectorSignal::new(color, Of::Time).map_or([0.0; 3], |color| color.value(thing.start).into());
    let color = thing.color.as_ref().map(first);
    Look { trail: thing.trail, ..Look::new(&thing.name, Form::Points, colors.pick(color)).with_radius(radius) }
}

/// What lies on a grid: an image in a plane, smoke in space, which has a colour of its own in a liquid only.
fn on_grid(name: &str, scene: &Scene, density: f64, colors: &mut Colors) -> Look {
    match flat(scene) {
        Some(_) => Look::new(name, Form::Image, colors.pick(None)),
        None => Look::new(name, Form::Smoke, if density < LIQUID { SMOKE } else { colors.pick(None) }),
    }
}

/// A warning for each of these gases whose system comes after that of this number, which reads it.
pub fn late_carriers(scene: &Scene, index: usize, gases: &[String]) -> Vec<Warning> {
    let late = |name: &String| {
        let gas = scene.gas.iter().find(|gas| gas.name == *name)?;
        let later = place(&scene.system, "gas", gas.system.as_deref()).filter(|later| *later > index)?;
        let (own, other) = (&scene.system[index].name, &scene.system[later].name);
        let message = format!(
            "comes before \"{other}\", whose gas acts on it, and sees it as it was at the beginning of each exchange; put it behind"
        );
        Some(Warning::new(Code::LateCarrier, format!("system \"{own}\""), message))
    };
    gases.iter().filter_map(late).collect()
}

/// The methods that move objects of the scene.
pub fn present(scene: &Scene) -> Vec<&'static dyn MethodRules> {
    let moved = |o: &tumble_interface::scene::Object<'_>| place(&scene.system, o.kind, o.system).map(|i| scene.system[i].method);
    let moving: Vec<Method> = scene.objects().iter().filter_map(moved).collect();
    METHODS.into_iter().filter(|m| m.words().iter().any(|word| moving.contains(word))).collect()
}

/// The scene with its systems, and the system of each object, written out.
pub fn resolve(mut scene: Scene) -> Scene {
    let mut systems = std::mem::take(&mut scene.system);
    if systems.is_empty() {
        systems = default_systems(&scene);
    }
    systems.iter_mut().for_each(|plan| rules(plan.method).normalize(plan));
    for (kind, system) in scene.object_systems_mut() {
        if let Some(i) = place(&systems, kind, system.as_deref()) {
            *system = Some(systems[i].name.clone());
        }
    }
    scene.system = systems;
    let immersed = lists(&scene).any(|(_, names)| moves_bodies(&scene, names));
    let often = if immersed || touches(&scene) { (RATE / scene.time.fps).ceil().clamp(1.0, 1e5) as u32 } else { 1 };
    scene.time.exchanges.get_or_insert(often);
    scene
}

/// Whether masses, grains or people and rigid bodies may touch, in a scene whose systems are written out.
pub fn touches(scene: &Scene) -> bool {
    !scene.body.is_empty() && scene.objects().iter().any(|o| visits_bodies(scene, o))
}

/// Whether an object consists of masses, grains or people that touch rigid bodies.
pub fn visits_bodies(scene: &Scene, object: &Object<'_>) -> bool {
    let mover = place(&scene.system, object.kind, object.system).map(|i| scene.system[i].method);
    matches!(mover, Some(Method::Grains | Method::Dynamics | Method::Crowd))
}

/// Lists of objects that fluids move as bodies, and where they stand.
pub fn lists(scene: &Scene) -> impl Iterator<Item = (String, &[String])> {
    let gases = scene.gas.iter().map(|gas| (format!("gas \"{}\".bodies", gas.name), &gas.bodies[..]));
    gases.chain(scene.liquid.iter().map(|liquid| (format!("liquid \"{}\".bodies", liquid.name), &liquid.bodies[..])))
}

/// Whether a fluid moves rigid bodies.
pub fn moves_bodies(scene: &Scene, names: &[String]) -> bool {
    names.iter().any(|name| scene.body.iter().any(|thing| thing.name == *name))
}

/// A system for each method that objects of the scene need.
fn default_systems(scene: &Scene) -> Vec<Plan> {
    let needed: Vec<&str> = scene.objects().iter().map(|o| default_of(o.kind).name()).collect();
    let mut methods: Vec<_> = METHODS.into_iter().filter(|m| needed.contains(&m.name())).collect();
    if methods.is_empty() {
        methods.push(METHODS[0]);
    }
    methods.sort_by_key(|m| !m.leads(scene));
    methods.iter().map(|m| m.default_system()).collect()
}
