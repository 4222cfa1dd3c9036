//! What joins systems: anchors between masses, and between a mass and a rigid body.

use super::laws::Reader;
use super::methods::{bodies_of, place};
use crate::elements::DrivenSpring;
use crate::geometry::Vector;
use crate::math::Signal;
use crate::recipes::named;
use crate::scene::Assets;
use crate::systems::dynamics::{Parts, SpringPart};
use tumble_interface::Issue;
use tumble_interface::check::suggestion;
use tumble_interface::scene::{Anchor, Scene};

/// An anchor whose ends have been found: system and point of each.
pub struct Link {
    pub name: String,
    pub ends: [(usize, u32); 2],
    /// Whether the second end is a rigid body.
    pub on_body: bool,
    /// Where on it, from its centre of mass in its axes [m].
    pub at: Vector,
    /// From one end to the other at the start [m].
    pub distance: f64,
    pub stiffness: Signal,
    pub damping: f64,
    pub rest_length: Signal,
    /// The largest stiffness [N/m].
    pub stiffest: f64,
    /// The longest of its rest lengths, and its length at the start [m].
    pub reach: f64,
    /// 1/m1 + 1/m2 [1/kg].
    pub inverse_mass: f64,
}

/// Finds the ends of all anchors; within a system they are springs of its own.
pub fn fasten(scene: &Scene, assets: &Assets, masses: &mut [Parts], issues: &mut Vec<Issue>) -> Vec<Link> {
    let anchors: Vec<Link> = scene.anchor.iter().filter_map(|anchor| link(scene, assets, anchor, masses, issues)).collect();
    for anchor in &anchors {
        let [(s, a), (t, b)] = anchor.ends;
        if s == t && !(anchor.stiffness.is_constant() && anchor.rest_length.is_constant()) {
            let Link { stiffness, damping, rest_length, stiffest, reach, .. } = anchor;
            let (stiffness, rest) = (stiffness.clone(), rest_length.clone());
            masses[s].driven.push(DrivenSpring { nodes: [a, b], stiffness, rest, damping: *damping, stiffest: *stiffest, reach: *reach });
        } else if s == t {
            masses[s].begin(&anchor.name, 0.0);
            masses[s].spring(SpringPart {
                ends: [a, b],
                stiffness: anchor.stiffest,
                damping: anchor.damping,
                rest: anchor.rest_length.value(0.0),
                hardening: 0.0,
                tension_only: false,
                break_strain: None,
            });
        }
    }
    anchors
}

/// An end of an anchor.
struct End {
    system: usize,
    row: u32,
    /// Where in the world [m].
    place: Vector,
    /// How much it yields [1/kg].
    inverse_mass: f64,
    /// Where on a rigid body, from its centre of mass in its axes, if it is one [m].
    on: Option<Vector>,
}

/// The two ends of an anchor.
fn link(scene: &Scene, assets: &Assets, anchor: &Anchor, parts: &[Parts], issues: &mut Vec<Issue>) -> Option<Link> {
    let mut end = |k: usize| -> Option<End> {
        let path = format!("anchor \"{}\".between[{k}]", anchor.name);
        let words = &anchor.between[k];
        let mut wrong = |message: String| issues.push(Issue::new(path.clone(), message));
        let alone = || scene.body.iter().any(|thing| thing.name == *words).then_some((words.as_str(), 0));
        let Some((name, index)) = named(words).or_else(alone) else {
            wrong(format!("\"{words}\", expected an object and an index: \"flag 3\""));
            return None;
        };
        let Some(object) = scene.objects().into_iter().find(|o| o.name == name) else {
            let hint = suggestion(name, scene.objects().iter().map(|o| o.name));
            wrong(format!("there is no object \"{name}\"{hint}"));
            return None;
        };
        let s = place(&scene.system, object.kind, object.system)?;
        if object.kind == "body" {
            let (first, made) = bodies_of(scene, assets, name)?;
            let Some(body) = made.bodies.get(index) else {
                wrong(format!("there is no body {index} in \"{name}\"; the last one is {}", made.bodies.len().saturating_sub(1)));
                return None;
            };
            let row = (first + index) as u32;
            let at = anchor.at.map_or(body.x, Vector::from);
            let arm = at - body.x;
            let least = body.inertia.into_iter().fold(f64::INFINITY, f64::min);
            let inverse_mass = body.inverse_mass + arm.norm_sq() / least;
            return Some(End { system: s, row, place: at, inverse_mass, on: Some(body.q.conj().turn(arm)) });
        }
        let Some(range) = parts[s].ranges().find(|(n, _)| *n == name).map(|(_, r)| r) else {
            wrong(format!("\"{name}\" has no masses to pull"));
            return None;
        };
        if object.kind == "emitter" {
            wrong(format!("the particles of emitter \"{name}\" come and go; an anchor needs a mass that stays"));
            return None;
        }
        if index >= range.len() {
            wrong(format!("there is no mass {index} in \"{name}\"; the last one is {}", range.len().saturating_sub(1)));
            return None;
        }
        let i = (range.start + index) as u32;
        Some(End { system: s, row: i, place: parts[s].position(i), inverse_mass: parts[s].inverse_mass(i), on: None })
    };
    let (a, b) = (end(0), end(1));
    let (a, b) = (a?, b?);
    // The system of masses owns the spring.
    let (a, b) = if a.on.is_some() { (b, a) } else { (a, b) };
    if a.on.is_some() {
        let message = "both ends are rigid bodies; take a [[joint]] of kind spring";
        issues.push(Issue::new(format!("anchor \"{}\".between", anchor.name), message));
        return None;
    }
    if b.on.is_none() && anchor.at.is_some() {
        let message = "given without a rigid body in `between`; leave it out";
        issues.push(Issue::new(format!("anchor \"{}\".at", anchor.name), message));
        return None;
    }
    let distance = (a.place - b.place).norm();
    let path = |key: &str| format!("anchor \"{}\".{key}", anchor.name);
    let mut reader = Reader::new(scene, issues);
    let stiffness = reader.signal(&path("stiffness"), &anchor.stiffness, 0.0);
    let rest_length = anchor.rest_length.as_ref().map(|words| reader.signal(&path("rest_length"), words, 0.0));
    Some(Link {
        name: anchor.name.clone(),
        ends: [(a.system, a.row), (b.system, b.row)],
        on_body: b.on.is_some(),
        at: b.on.unwrap_or_default(),
        distance,
        stiffest: reader.largest(|t| stiffness.value(t), stiffness.key_times()),
        reach: rest_length.iter().map(|rest| reader.largest(|t| rest.value(t), rest.key_times())).fold(distance, f64::max),
        stiffness,
        damping: anchor.damping,
        rest_length: rest_length.unwrap_or_else(|| distance.into()),
        inverse_mass: a.inverse_mass + b.inverse_mass,
    })
}
