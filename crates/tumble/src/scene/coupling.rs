//! What joins systems: anchors between masses, and masses that a fluid moves.

use super::checks::{objects, place};
use crate::exchange::Exchange;
use crate::geometry::Vector;
use crate::systems::dynamics::{self, Dynamics, Parts};
use crate::systems::gas::{Body, Sheet};
use tumble_interface::check::suggestion;
use tumble_interface::scene::{Anchor, Gas, Method, Scene, System as Plan};
use tumble_interface::warning::Code;
use tumble_interface::{Issue, Warning};

/// Balls that one fluid moves at most.
const MOST_BODIES: usize = 256;

/// What a fluid moves.
pub type Moved = (Vec<Body>, Vec<Sheet>);

/// The balls and sheets that a fluid moves.
pub fn moved(scene: &Scene, plans: &[Plan], words: &Gas, parts: &[Parts], exchange: &mut Exchange, issues: &mut Vec<Issue>) -> Moved {
    let (mut bodies, mut sheets) = (Vec::new(), Vec::new());
    for (i, name) in words.bodies.iter().enumerate() {
        let mut wrong = |message: String| issues.push(Issue::new(format!("gas \"{}\".bodies[{i}]", words.name), message));
        let Some(system) = moved_by(scene, plans, words, name, &mut wrong) else { continue };
        let Some(thing) = scene.particles.iter().find(|thing| thing.name == *name) else {
            wrong(format!("\"{name}\" is no object of [[particles]], whose masses could be balls"));
            continue;
        };
        let range = parts[system].ranges().find(|(n, _)| n == name).map_or(0..0, |(_, range)| range);
        if bodies.len() + range.len() > MOST_BODIES {
            wrong(format!("\"{name}\" has {} masses; a fluid moves {MOST_BODIES} balls at most", range.len()));
            continue;
        }
        for row in range {
            let mut body = Body::new(name.clone(), exchange.open_body(system, row), thing.radius);
            body.position = parts[system].position(row as u32);
            body.velocity = parts[system].velocity(row as u32);
            body.inverse_mass = parts[system].inverse_mass(row as u32);
            bodies.push(body);
        }
    }
    for (i, sheet) in words.sheet.iter().enumerate() {
        let name = &sheet.object;
        let mut wrong = |message: String| issues.push(Issue::new(format!("gas \"{}\".sheet[{i}].object", words.name), message));
        let Some(system) = moved_by(scene, plans, words, name, &mut wrong) else { continue };
        let Some(object) = parts[system].named(name) else { continue };
        let curve = object.curve.windows(2).map(|ends| [ends[0], ends[1]]).collect();
        let (triangles, pieces) = if scene.dimension == 2 { (Vec::new(), curve) } else { (object.triangles.clone(), Vec::new()) };
        if triangles.is_empty() && pieces.is_empty() {
            let what = if scene.dimension == 2 { "curve, which a sheet in the plane is" } else { "surface of triangles" };
            wrong(format!("\"{name}\" has no {what}"));
            continue;
        }
        let ports = object.points.clone().map(|row| exchange.open(system, row)).collect();
        sheets.push(Sheet::new(name.clone(), ports, triangles, pieces, [sheet.resistance, sheet.friction]));
    }
    (bodies, sheets)
}

/// The system of an object that a fluid is to move.
fn moved_by(scene: &Scene, plans: &[Plan], words: &Gas, name: &str, wrong: &mut dyn FnMut(String)) -> Option<usize> {
    let all = objects(scene);
    let Some((kind, _, system)) = all.iter().find(|(_, n, _)| *n == name) else {
        let hint = suggestion(name, all.iter().map(|o| o.1));
        wrong(format!("there is no object \"{name}\"{hint}"));
        return None;
    };
    let all = scene.gas.iter().flat_map(|gas| gas.bodies.iter().chain(gas.sheet.iter().map(|sheet| &sheet.object)));
    if all.filter(|other| *other == name).count() > 1 {
        wrong(format!("\"{name}\" is named more than once; one fluid moves it, as a ball or as a sheet"));
        return None;
    }
    let (own, other) = (place(plans, "gas", words.system.as_deref())?, place(plans, kind, *system)?);
    if plans[other].method != Method::Dynamics {
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

/// An anchor whose ends have been found: system and point of each.
pub struct Link {
    pub name: String,
    pub ends: [(usize, u32); 2],
    pub stiffness: f64,
    pub damping: f64,
    pub rest_length: f64,
    /// 1/m1 + 1/m2 [1/kg].
    inverse_mass: f64,
}

/// The two ends of an anchor.
pub fn link(scene: &Scene, plans: &[Plan], anchor: &Anchor, parts: &[Parts], issues: &mut Vec<Issue>) -> Option<Link> {
    let mut end = |k: usize| -> Option<(usize, u32, Vector, f64)> {
        let path = format!("anchor \"{}\".between[{k}]", anchor.name);
        let words = &anchor.between[k];
        let mut wrong = |message: String| issues.push(Issue::new(path.clone(), message));
        let Some((name, index)) = words.rsplit_once(' ').and_then(|(n, i)| Some((n.trim(), i.parse::<usize>().ok()?))) else {
            wrong(format!("\"{words}\", expected an object and an index: \"flag 3\""));
            return None;
        };
        let Some((kind, _, system)) = objects(scene).into_iter().find(|(_, n, _)| *n == name) else {
            let hint = suggestion(name, objects(scene).iter().map(|o| o.1));
            wrong(format!("there is no object \"{name}\"{hint}"));
            return None;
        };
        let s = place(plans, kind, system)?;
        let Some(range) = parts[s].ranges().find(|(n, _)| *n == name).map(|(_, r)| r) else {
            wrong(format!("\"{name}\" has no masses to pull"));
            return None;
        };
        if kind == "emitter" {
            wrong(format!("the particles of emitter \"{name}\" come and go; an anchor needs a mass that stays"));
            return None;
        }
        if index >= range.len() {
            wrong(format!("there is no mass {index} in \"{name}\"; the last one is {}", range.len().saturating_sub(1)));
            return None;
        }
        let i = (range.start + index) as u32;
        Some((s, i, parts[s].position(i), parts[s].inverse_mass(i)))
    };
    let (a, b) = (end(0), end(1));
    let (a, b) = (a?, b?);
    Some(Link {
        name: anchor.name.clone(),
        ends: [(a.0, a.1), (b.0, b.1)],
        stiffness: anchor.stiffness,
        damping: anchor.damping,
        rest_length: anchor.rest_length.unwrap_or((a.2 - b.2).norm()),
        inverse_mass: a.3 + b.3,
    })
}

/// Between systems the one of the first end owns the spring; the other gives a port.
pub fn hang(system: &mut Dynamics, index: usize, anchor: &Link, dt: f64, exchange: &mut Exchange, warnings: &mut Vec<Warning>) {
    let [(s, a), (t, b)] = anchor.ends;
    if s != t && t == index {
        system.expect_pushes();
    }
    if s == t || s != index {
        return;
    }
    let port = exchange.open(t, b as usize);
    system.add_anchor(dynamics::Anchor {
        row: a as usize,
        port,
        stiffness: anchor.stiffness,
        damping: anchor.damping,
        rest_length: anchor.rest_length,
    });
    let turn = dt * (anchor.stiffness * anchor.inverse_mass).sqrt();
    let damp = dt * anchor.damping * anchor.inverse_mass;
    if turn > 0.5 || damp > 0.5 {
        let times = (2.0 * turn.max(damp)).ceil();
        let message = format!(
            "omega dt = {turn:.2}, c dt/m = {damp:.2}; systems exchange impulses explicitly, which needs both below 0.5: \
             raise time.exchanges {times} times, or put both objects into one system"
        );
        warnings.push(Warning::new(Code::StiffAnchor, format!("anchor \"{}\"", anchor.name), message));
    }
}
