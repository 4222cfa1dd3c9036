//! Fluids that move bodies: what their words name, and what is wrong with it.

use super::{bodies_of, place, rules};
use crate::exchange::BodyState;
use crate::fluids::{Hull, Immersed};
use crate::scene::build::Builder;
use crate::scene::laws::flat;
use crate::state::Grid;
use crate::systems::rigid;
use std::sync::Arc;
use tumble_interface::check::{short, suggestion};
use tumble_interface::scene::Scene;
use tumble_interface::warning::Code;
use tumble_interface::{Issue, Warning};

/// Bodies that one fluid moves at most.
const MOST_BODIES: usize = 256;
/// Radius of a ball or capsule in cells at least, and reach of any body: what is smaller may close no face.
const LEAST_RADIUS: f64 = 1.5;

/// A fluid, by its words.
pub struct Mover<'a> {
    /// Kind of object.
    pub kind: &'static str,
    /// Its name.
    pub name: &'a str,
    /// Its system, if it names one.
    pub system: Option<&'a str>,
    /// Objects that it moves.
    pub bodies: &'a [String],
}

impl Mover<'_> {
    /// The bodies that it moves; what is wrong goes to the builder's issues.
    pub fn bodies(&self, builder: &mut Builder<'_>) -> Vec<Immersed> {
        let mut bodies = Vec::new();
        for (i, name) in self.bodies.iter().enumerate() {
            let at = format!("{} \"{}\".bodies[{i}]", self.kind, self.name);
            let Some(system) = self.system_of(builder.scene, name, &mut |message| builder.issues.push(Issue::new(at.clone(), message)))
            else {
                continue;
            };
            let Some(found) = hulls(builder, name, system) else {
                let message = format!("\"{name}\" is no object of [[body]], nor of [[particles]], whose masses could be balls");
                builder.issues.push(Issue::new(at, message));
                continue;
            };
            if bodies.len() + found.len() > MOST_BODIES {
                let message = format!("\"{name}\" has {} bodies; a fluid moves {MOST_BODIES} at most", found.len());
                builder.issues.push(Issue::new(at, message));
                continue;
            }
            let (Some((first, ..)), Some((last, ..))) = (found.first(), found.last()) else { continue };
            let rows = builder.exchange.open(builder.ids[system], *first..last + 1, true);
            bodies.extend(rows.into_iter().zip(found).map(|(row, (_, hull, state))| Immersed::new(row, hull, state)));
        }
        bodies
    }

    /// The system of an object that it is to move.
    pub fn system_of(&self, scene: &Scene, name: &str, wrong: &mut dyn FnMut(String)) -> Option<usize> {
        let (all, plans) = (scene.objects(), &scene.system);
        let Some(object) = all.iter().find(|o| o.name == name) else {
            let hint = suggestion(name, all.iter().map(|o| o.name));
            wrong(format!("there is no object \"{name}\"{hint}"));
            return None;
        };
        if named(scene).filter(|other| *other == name).count() > 1 {
            wrong(format!("\"{name}\" is named more than once; one fluid moves it, as a body or as a sheet"));
            return None;
        }
        let (own, other) = (place(plans, self.kind, self.system)?, place(plans, object.kind, object.system)?);
        let is_body = object.kind == "body" && self.bodies.iter().any(|body| body == name);
        if !is_body && rules(plans[other].method).massless().is_some() {
            wrong(format!("\"{name}\" is in a system of method {}; a fluid moves masses of dynamics", plans[other].method.name()));
            return None;
        }
        if other < own {
            // Otherwise the masses would fall for an interval before they feel the fluid.
            wrong(format!(
                "system \"{}\" of \"{name}\" comes before the fluid that moves it; put [[system]] \"{}\" first",
                plans[other].name, plans[own].name
            ));
            return None;
        }
        Some(other)
    }
}

/// All that fluids are to move.
fn named(scene: &Scene) -> impl Iterator<Item = &String> {
    let gases = scene.gas.iter().flat_map(|gas| gas.bodies.iter().chain(gas.sheet.iter().map(|sheet| &sheet.object)));
    gases.chain(scene.liquid.iter().flat_map(|liquid| &liquid.bodies))
}

/// What is wrong with bodies that cover no cell.
pub fn too_small(bodies: &[Immersed], grid: &Grid) -> Vec<String> {
    let least = LEAST_RADIUS * grid.dx;
    let small = bodies.iter().filter(|body| body.hull.radius() < least);
    let message = |body: &Immersed| {
        format!(
            "a body of \"{}\" has a radius of {} m, expected >= {LEAST_RADIUS} cells = {} m; raise box.resolution or the radius",
            body.name(),
            short(body.hull.radius()),
            short(least)
        )
    };
    small.map(message).collect()
}

/// A fluid whose bodies nothing keeps in its box.
pub fn unbounded(scene: &Scene, kind: &str, name: &str, bodies: &[String]) -> Option<Warning> {
    let message = "the sides of the box are no obstacle to bodies, and there is no collider; add one of its shape with inside = true";
    let alone = scene.collider.is_empty() && !bodies.is_empty();
    alone.then(|| Warning::new(Code::NoCollider, format!("{kind} \"{name}\".bodies"), message))
}

/// Hulls and rows in their system, with the states at the start, of what a fluid is to move as bodies: [[body]], or masses as balls.
fn hulls(builder: &Builder<'_>, name: &str, system: usize) -> Option<Vec<(usize, Hull, BodyState)>> {
    let (scene, parts) = (builder.scene, &builder.masses[system]);
    if scene.body.iter().any(|thing| thing.name == name) {
        let Some((first, made)) = bodies_of(scene, builder.assets, name) else { return Some(Vec::new()) };
        let hull = Hull { reach: made.outline.reach, volume: made.volume(), solid: Arc::new(made.solid) };
        let state = |body: &rigid::Body| BodyState {
            position: body.x,
            orientation: body.q,
            velocity: body.v,
            spin: body.w,
            inverse_mass: body.inverse_mass,
            ..BodyState::default()
        };
        return Some(made.bodies.iter().enumerate().map(|(i, body)| (first + i, hull.clone(), state(body))).collect());
    }
    let thing = scene.particles.iter().find(|thing| thing.name == name)?;
    let range = parts.ranges().find(|(n, _)| *n == name).map_or(0..0, |(_, range)| range);
    let hull = Hull::ball(name, thing.radius, flat(scene).is_some());
    let ball = |row: usize| {
        let row = row as u32;
        let (position, velocity, inverse_mass) = (parts.position(row), parts.velocity(row), parts.inverse_mass(row));
        (row as usize, hull.clone(), BodyState { position, velocity, inverse_mass, ..BodyState::default() })
    };
    Some(range.map(ball).collect())
}
