//! One step of people, whatever their model: who is near, where each wants to go, and how far it can go before it meets others.

use super::around::{Around, Neighbour, Other, Person};
use super::bodies::Bodies;
use super::floor::Floor;
use super::image::{self, Image};
use super::models::{Model, Motion};
use super::near::Near;
use super::plan::{Point, along, crossing, dot, length, sub};
use super::smoke::{sight, slowed};
use super::way::{NONE, Way};
use crate::math::functions::{cos, sin};
use crate::math::parallel::Tasks;

/// People a task.
const TASK: usize = 256;

/// Of the desired speed: how fast people step over who lies.
const OVER: f64 = 0.5;

/// Memory that steps reuse.
#[derive(Debug, Default)]
pub struct Scratch {
    images: Vec<Image>,
    near: Near,
    sorted: Vec<Other>,
    /// What everybody does in this step, cell by cell.
    own: Vec<Move>,
    /// The same by rows.
    pub moves: Vec<Move>,
}

/// What somebody does in a step.
#[derive(Debug, Clone, Copy, Default)]
pub struct Move {
    /// Displacement [m].
    u: Point,
    /// Heading at its end [rad].
    heading: f64,
    /// Distance left at its end [m].
    pub phi: f64,
    /// The next gate at its start.
    pub gate: u32,
    /// Whether a gate is near its end, and whether one or a link is crossed.
    pub near: bool,
    pub crosses: bool,
    /// Desired speed there [m/s].
    free: f64,
}

/// What fills the room around people.
pub struct Air<'a> {
    /// Bodies among them.
    pub bodies: &'a Bodies,
    /// Extinction where each of them is, by row [1/m]; empty without smoke.
    pub extinctions: &'a [f64],
}

/// One step of everybody, from t to t + h [s]. Distances left are not updated.
pub fn step(people: &mut [Person], floor: &Floor, model: &Model, air: &Air<'_>, scratch: &mut Scratch, t: f64, h: f64) {
    people.iter_mut().for_each(|p| (p.started, p.lies) = (t >= p.starts || p.out.is_some(), t < p.up));
    let most = |f: fn(&Person) -> f64| people.iter().map(f).fold(0.0, f64::max);
    let range = model.reach(most(|p| p.speed), most(|p| p.radius));
    // Whoever can be touched in this step is felt.
    let touched = 2.0 * (most(|p| p.radius) + h * most(|p| p.speed + length(p.slide)));
    let Scratch { images, near, sorted, own, moves } = scratch;
    images.clear();
    images.extend(image::images(people, &floor.plan, range));
    near.sort(0.5 * range, people.iter().map(|p| p.x).chain(images.iter().map(|image| image.x)));
    sorted.resize(near.order.len(), Other::default());
    own.resize(near.order.len(), Move::default());
    moves.resize(people.len(), Move::default());
    let (all, images) = (&*people, &*images);
    let image = |other: &Other| images.get((other.row as usize).wrapping_sub(all.len()));
    sorted.chunks_mut(TASK).zip(near.order.chunks(TASK)).in_parallel(|(sorted, rows)| {
        for (other, row) in sorted.iter_mut().zip(rows) {
            *other = Other { row: *row, ..Other::default() };
            let image = image(other);
            let p = &all[image.map_or(*row, |image| image.row) as usize];
            let (x, e, v) = (p.x, [cos(p.heading), sin(p.heading)], p.v);
            let (x, e, v) = image.map_or((x, e, v), |Image { x, passage, .. }| (*x, passage.direction(e), passage.direction(v)));
            *other = Other { x, radius: p.radius, e, v, phi: p.phi, lies: p.lies, id: p.id, row: *row, is_beyond: image.is_some() };
        }
    });
    let (near, sorted) = (&*near, &*sorted);
    own.chunks_mut(TASK).zip(sorted.chunks(TASK)).in_parallel(|(own, part)| {
        // One after the other, so that looking up ways does not wait for itself.
        let direction = |other: &Other| match all.get(other.row as usize) {
            Some(p) => floor.way(p.way).direction(other.x),
            None => ([0.0; 2], NONE),
        };
        let directions: Vec<(Point, u32)> = part.iter().map(direction).collect();
        let (mut others, mut planes) = (Vec::new(), Vec::new());
        for ((to, me), direction) in own.iter_mut().zip(part).zip(directions).filter(|((_, me), _)| image(me).is_none()) {
            let person = &all[me.row as usize];
            let extinction = air.extinctions.get(me.row as usize).copied().unwrap_or(0.0);
            let seen = range.min(sight(extinction).max(touched));
            let mut over = false;
            others.clear();
            for run in near.runs(me.x, range) {
                for other in &sorted[run] {
                    let r = sub(other.x, me.x);
                    let d_sq = dot(r, r);
                    let is_there = || image(other).is_none_or(|image| image.is_seen(&floor.plan, me.x, all[image.row as usize].x));
                    if d_sq < seen * seen && other.id != me.id && is_there() {
                        let d = d_sq.sqrt();
                        if person.steps_over(other, d) {
                            over |= d < person.radius + other.radius;
                        } else {
                            others.push(Neighbour { r, d, other });
                        }
                    }
                }
            }
            let (down, gate) = person.out.map_or(direction, |out| (out, NONE));
            let pace = slowed(extinction) * if over { OVER * person.speed } else { person.speed };
            let speed = floor.plan.slope(me.x).map_or(pace, |slope| pace * slope.factor(down));
            let (walls, bodies) = (floor.plan.near(me.x), air.bodies.of(me.row));
            let around = Around { me: person, e: me.e, speed, plan: &floor.plan, walls, bodies, others: &others };
            *to = Move { gate, ..one(&around, floor.way(person.way), model, down, h, &mut planes) };
        }
    });
    sorted.iter().zip(&*own).filter(|(other, _)| image(other).is_none()).for_each(|(other, to)| moves[other.row as usize] = *to);
    people.iter_mut().zip(moves.iter()).for_each(|(p, to)| {
        p.x = along(p.x, 1.0, to.u);
        p.v = to.u.map(|u| u / h);
        (p.heading, p.free) = (to.heading, to.free);
    });
}

/// What one person does who wants to go in a direction, if in any.
fn one(around: &Around<'_>, way: &Way, model: &Model, down: Point, h: f64, planes: &mut Vec<(Point, f64)>) -> Move {
    let (me, plan) = (around.me, around.plan);
    // Whoever is pushed goes that way, and whoever stands gets out of bodies.
    let (mut u, mut heading) = (me.slide.map(|v| v * h), me.heading);
    if !me.lies {
        u = around.bodies.iter().fold(u, |u, body| along(u, 1.0, body.out()));
    }
    if me.started && !me.lies {
        let motion = if down == [0.0; 2] {
            // Nowhere to go, but in the way of others.
            Motion { v: around.makes_way(), heading }
        } else {
            model.motion(around, down, h)
        };
        heading = motion.heading;
        u = along(motion.v.map(|v| v * h), 1.0, u);
    }
    if u != [0.0; 2] {
        u = around.feasible(u, model.soft(), planes);
    }
    let to = along(me.x, 1.0, u);
    let passage = if me.out.is_none() { plan.passage(me.x, to) } else { None };
    let end = passage.map_or(to, |passage| passage.arrival(me.x, to));
    let phi = me.out.map_or_else(|| way.distance(end), |out| me.phi - dot(u, out));
    let gates = plan.gates_near(to);
    let crosses = passage.is_some() || gates.iter().any(|g| crossing(plan.gates[*g as usize].line, me.x, to).is_some());
    Move { u, heading, phi, gate: NONE, near: !gates.is_empty(), crosses, free: around.speed }
}
