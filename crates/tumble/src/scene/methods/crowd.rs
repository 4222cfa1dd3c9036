//! Crowds: words to a floor and the people on it.

use super::{MethodRules, is_in, scheme_of_its_own};
use crate::math::Random;
use crate::math::functions::{atan2, cos, ln};
use crate::scene::Assets;
use crate::scene::build::Builder;
use crate::system::System;
use crate::systems::crowd::{
    Crowd as People, Floor, Gate, Line, Misfit, Model, Person, Plan as Walls, Point, Room, Settings, nearest, overlapping, reach,
};
use tumble_interface::check::short;
use tumble_interface::looks::{Colors, FEW, Form, Look};
use tumble_interface::scene::{Crowd, Gate as Words, Integrator, Method, Plan as Floors, Plane, Scene, System as Plan};
use tumble_interface::{Issue, Warning};

/// Bytes for a person: its row three times, and what a step needs.
const PERSON: f64 = 600.0;
/// Bytes for a cell of a floor, and for each way across it.
const CELL: [f64; 2] = [9.0, 20.0];
/// Side of a cell [m], at most, and over the smallest radius.
const SIDE: [f64; 2] = [0.1, 0.6];
/// Pieces of a wall that are compared with each other.
const LONG: usize = 4000;
/// A plan as wide as this [m] is in millimetres.
const WIDE: f64 = 5000.0;

// Purposes of random numbers.
const RADIUS: u32 = 16;
const SPEED: u32 = 17;
const REACTION: u32 = 18;

pub struct Rules;

/// Walls of a plan, wall by wall [m].
fn walls(plan: &Floors) -> Vec<Vec<Point>> {
    plan.walls.iter().map(|wall| wall.iter().map(|p| p.map(|x| x * plan.scale)).collect()).collect()
}

fn lines(walls: &[Vec<Point>]) -> Vec<Line> {
    walls.iter().flat_map(|wall| wall.windows(2).map(|ends| [ends[0], ends[1]])).collect()
}

/// Doors, then exits, with their places in the scene.
fn gates(plan: &Floors) -> Vec<(String, Gate)> {
    let of = |key: &str, k: usize, words: &Words, exit: bool| {
        let line = [words.from, words.to].map(|p| p.map(|x| x * plan.scale));
        (format!("plan \"{}\".{key}[{k}]", plan.name), Gate { name: words.name.clone(), line, exit })
    };
    let doors = plan.door.iter().enumerate().map(|(k, door)| of("door", k, door, false));
    doors.chain(plan.exit.iter().enumerate().map(|(k, exit)| of("exit", k, exit, true))).collect()
}

/// The largest radius of a crowd [m].
fn largest(thing: &Crowd) -> f64 {
    thing.radius * (1.0 + thing.radius_spread)
}

/// The plan and the crowds of a system.
fn own<'a>(scene: &'a Scene, plan: &Plan) -> (Vec<&'a Floors>, Vec<&'a Crowd>) {
    (scene.plan.iter().filter(|t| is_in(&t.system, plan)).collect(), scene.crowd.iter().filter(|t| is_in(&t.system, plan)).collect())
}

fn model(plan: &Plan) -> Model {
    let words = plan.crowd.clone().unwrap_or_default();
    Model { time_gap: words.time_gap, buffer: words.buffer }
}

fn at(x: Point) -> String {
    format!("({}, {})", short(x[0]), short(x[1]))
}

/// Where two lines cross, their ends left out.
fn cross([a, b]: Line, [c, d]: Line) -> Option<Point> {
    let side = |p: Point, q: Point, x: Point| (q[0] - p[0]) * (x[1] - p[1]) - (q[1] - p[1]) * (x[0] - p[0]);
    let (sc, sd, sa, sb) = (side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b));
    let s = sa / (sa - sb);
    (sc * sd < 0.0 && sa * sb < 0.0).then(|| [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])])
}

/// Walls that are no walls.
fn check_walls(thing: &Floors, issues: &mut Vec<Issue>) {
    for (k, wall) in walls(thing).iter().enumerate() {
        let path = format!("plan \"{}\".walls[{k}]", thing.name);
        if wall.len() < 2 {
            issues.push(Issue::new(
                path,
                format!("{} point, expected at least 2: a line, or an outline that ends where it begins", wall.len()),
            ));
            continue;
        }
        let pieces = lines(std::slice::from_ref(wall));
        // Of very long ones only the beginning is looked at: all pairs are.
        let crossing = (0..pieces.len().min(LONG)).find_map(|i| (0..i).find_map(|j| cross(pieces[i], pieces[j])));
        if let Some(x) = crossing {
            issues.push(Issue::new(path, format!("crosses itself at {}; mend the order of its points, or make two walls of it", at(x))));
        }
    }
    let points: Vec<Point> = walls(thing).concat();
    let bound = |a: usize, f: fn(f64, f64) -> f64| points.iter().map(|p| p[a]).reduce(f).unwrap_or(0.0);
    let wide = (bound(0, f64::max) - bound(0, f64::min)).max(bound(1, f64::max) - bound(1, f64::min));
    if wide > WIDE {
        let message = format!("its walls span {} m; if the plan is in millimetres, set scale = 0.001", short(wide));
        issues.push(Issue::new(format!("plan \"{}\"", thing.name), message));
    }
}

/// Gates that nobody can pass, or that are nowhere.
fn check_gates(thing: &Floors, radius: f64, issues: &mut Vec<Issue>) {
    let (all, walls) = (gates(thing), lines(&walls(thing)));
    let bound = |a: usize, f: fn(f64, f64) -> f64| walls.iter().flatten().map(|p| p[a]).reduce(f);
    for (k, (path, gate)) in all.iter().enumerate() {
        let middle = [0, 1].map(|a| 0.5 * (gate.line[0][a] + gate.line[1][a]));
        let clear = walls.iter().map(|wall| {
            let foot = nearest(*wall, middle);
            ((foot[0] - middle[0]).powi(2) + (foot[1] - middle[1]).powi(2)).sqrt()
        });
        let clear = clear.fold(f64::INFINITY, f64::min);
        let outside = (0..2).any(|a| {
            let beyond = |low: f64, high: f64| middle[a] < low - radius || middle[a] > high + radius;
            bound(a, f64::min).zip(bound(a, f64::max)).is_some_and(|(low, high)| beyond(low, high))
        });
        if let Some((first, _)) = all[..k].iter().find(|(_, other)| other.name == gate.name) {
            issues.push(Issue::new(path, format!("\"{}\" is the name of {first}, too; give it another", gate.name)));
        }
        if outside {
            issues.push(Issue::new(
                path,
                format!("\"{}\" at {} lies outside the walls; move it to an opening of them", gate.name, at(middle)),
            ));
        } else if gate.width() < 2.0 * radius {
            let message = format!(
                "nobody can pass: \"{}\" at {} is {} m wide, and the largest body {} m; widen it, or lower the radius",
                gate.name,
                at(middle),
                short(gate.width()),
                short(2.0 * radius)
            );
            issues.push(Issue::new(path, message));
        } else if clear < radius {
            let message =
                format!("nobody can pass: a wall stands in \"{}\" at {}; end the wall at its jambs, or move it", gate.name, at(middle));
            issues.push(Issue::new(path, message));
        }
    }
}

/// What is wrong with the words of a crowd.
fn check_crowd(thing: &Crowd, plan: Option<&Floors>, issues: &mut Vec<Issue>) {
    let path = format!("crowd \"{}\"", thing.name);
    let given = [thing.count.is_some(), thing.density.is_some(), !thing.position.is_empty()];
    if given.iter().filter(|given| **given).count() != 1 {
        issues.push(Issue::new(&path, "expected one of count, density and position"));
    }
    if thing.position.is_empty() && (thing.area.len() < 2 || thing.floor() <= 0.0) {
        let message = "expected two opposite corners of a rectangle, or at least three corners of a polygon, around some floor";
        issues.push(Issue::new(format!("{path}.area"), message));
    }
    if !thing.position.is_empty() && !thing.area.is_empty() {
        issues.push(Issue::new(format!("{path}.area"), "given with position; leave one of them out"));
    }
    let names: Vec<&str> = plan.into_iter().flat_map(|plan| &plan.exit).map(|exit| exit.name.as_str()).collect();
    for (k, name) in thing.exit.iter().enumerate().filter(|(_, name)| !names.contains(&name.as_str())) {
        let message = format!("\"{name}\" is no exit of the plan, expected one of {}", names.join(", "));
        issues.push(Issue::new(format!("{path}.exit[{k}]"), message));
    }
}

impl MethodRules for Rules {
    fn words(&self) -> &'static [Method] {
        &[Method::Crowd]
    }

    fn kinds(&self) -> &'static [&'static str] {
        &["plan", "crowd"]
    }

    fn massless(&self) -> Option<&'static str> {
        Some("people")
    }

    fn refusal(&self, integrator: Integrator) -> Option<String> {
        (integrator != Integrator::default()).then(|| "people have a scheme of their own and no integrator; leave it out".into())
    }

    fn check(&self, scene: &Scene, issues: &mut Vec<Issue>) {
        scheme_of_its_own(scene, Method::Crowd, "people", |plan| plan.crowd.is_some(), issues);
        if scene.dimension == 2 && scene.plane == Plane::Xz && !(scene.crowd.is_empty() && scene.plan.is_empty()) {
            issues.push(Issue::new("plane", "\"xz\", but people walk in x and y; set plane = \"xy\""));
        }
        for plan in scene.system.iter().filter(|plan| plan.method == Method::Crowd) {
            let (floors, crowds) = own(scene, plan);
            if crowds.is_empty() && floors.is_empty() {
                continue;
            }
            if floors.len() != 1 {
                let message = format!("{} plans, expected one [[plan]] with the walls, doors and exits of its floor", floors.len());
                issues.push(Issue::new(format!("system \"{}\"", plan.name), message));
            }
            let radius = crowds.iter().map(|thing| largest(thing)).fold(0.0, f64::max);
            for thing in &floors {
                check_walls(thing, issues);
                check_gates(thing, radius, issues);
                if thing.exit.is_empty() {
                    issues.push(Issue::new(
                        format!("plan \"{}\".exit", thing.name),
                        "missing, expected at least one [[plan.exit]] to leave by",
                    ));
                }
            }
            crowds.iter().for_each(|thing| check_crowd(thing, floors.first().copied(), issues));
        }
    }

    fn hints(&self, _scene: &Scene) -> Vec<Warning> {
        Vec::new()
    }

    fn looks(&self, scene: &Scene, plan: &Plan, colors: &mut Colors) -> Vec<Look> {
        let (floors, crowds) = own(scene, plan);
        let wall = |t: &&Floors| Look {
            few: true,
            ..Look::new(&t.name, Form::Points, t.color.unwrap_or(tumble_interface::looks::SOLID)).with_radius(0.04)
        };
        let mut looks: Vec<Look> = floors.iter().map(wall).collect();
        let people = |t: &&Crowd| Look {
            trail: t.trail,
            few: t.people() < FEW,
            ..Look::new(&t.name, Form::Points, colors.pick(t.color)).with_radius(t.radius)
        };
        looks.extend(crowds.iter().map(people));
        looks
    }

    fn memory(&self, scene: &Scene, _assets: &Assets) -> f64 {
        let people = scene.crowd.iter().map(Crowd::people).sum::<f64>();
        let side = side(&scene.crowd.iter().collect::<Vec<_>>());
        let cells = |thing: &Floors| {
            let points: Vec<Point> = walls(thing).concat();
            let span = |a: usize| {
                let bound = |f: fn(f64, f64) -> f64| points.iter().map(|p| p[a]).reduce(f).unwrap_or(0.0);
                (bound(f64::max) - bound(f64::min) + 2.0) / side
            };
            span(0) * span(1)
        };
        let ways = scene.crowd.len().max(1) as f64;
        PERSON * people + (CELL[0] + CELL[1] * ways) * scene.plan.iter().map(cells).sum::<f64>()
    }

    fn build(&self, builder: &mut Builder<'_>, index: usize) -> Option<Box<dyn System>> {
        let (scene, plan) = (builder.scene, builder.plan(index));
        let (floors, crowds) = own(scene, plan);
        if !builder.issues.is_empty() {
            return None;
        }
        let thing = *floors.first()?;
        let model = model(plan);
        let gates: Vec<Gate> = gates(thing).into_iter().map(|(_, gate)| gate).collect();
        let exits_of = |crowd: &Crowd| {
            let may = |gate: &Gate| gate.exit && (crowd.exit.is_empty() || crowd.exit.contains(&gate.name));
            (0..gates.len()).filter(|g| may(&gates[*g])).collect::<Vec<usize>>()
        };
        let exits: Vec<Vec<usize>> = crowds.iter().map(|crowd| exits_of(crowd)).collect();
        let radius = crowds.iter().map(|crowd| largest(crowd)).fold(0.05, f64::max);
        let fastest = crowds.iter().map(|crowd| crowd.speed + 2.0 * crowd.speed_deviation).fold(0.0, f64::max);
        let walls = Walls::new(lines(&walls(thing)), gates, reach(fastest, radius, &model));
        let floor = Floor::new(walls, &exits, side(&crowds), radius);
        let mut people = Vec::new();
        for (k, crowd) in crowds.iter().enumerate() {
            populate(crowd, k as u32, &floor, scene.seed, &mut people, &mut builder.issues);
        }
        let settings = Settings {
            name: plan.name.clone(),
            substeps: plan.substeps,
            step: plan.step,
            model,
            plan: thing.name.clone(),
            crowds: crowds.iter().map(|crowd| crowd.name.clone()).collect(),
            exits,
        };
        Some(Box::new(People::new(settings, floor, people)))
    }
}

/// Side of a cell for bodies of these crowds [m].
fn side(crowds: &[&Crowd]) -> f64 {
    let smallest = crowds.iter().map(|crowd| crowd.radius * (1.0 - crowd.radius_spread)).fold(f64::INFINITY, f64::min);
    (SIDE[1] * smallest).min(SIDE[0])
}

/// Adds the people of a crowd to those who are there.
fn populate(thing: &Crowd, crowd: u32, floor: &Floor, seed: u32, people: &mut Vec<Person>, issues: &mut Vec<Issue>) {
    let path = format!("crowd \"{}\"", thing.name);
    let random = Random::new(seed, &thing.name);
    let radius = |i: usize| thing.radius * (1.0 + thing.radius_spread * (2.0 * random.uniform(i as u64, 0, RADIUS)[0] - 1.0));
    let places = if thing.position.is_empty() {
        let polygon = thing.polygon();
        let count = thing.people() as usize;
        let room = Room { polygon: &polygon, count, radius: largest(thing), crowd };
        let there: Vec<(Point, f64)> = people.iter().map(|p: &Person| (p.x, p.radius)).collect();
        match room.places(floor, &random, &there) {
            Ok(places) => places,
            Err(Misfit::NoWay) => {
                let message = "no exit of it can be reached from there: walls or narrow doors cut it off; open a way, or name another exit";
                return issues.push(Issue::new(format!("{path}.area"), message));
            }
            Err(Misfit::Most(most)) => {
                let message = format!("{count} people, but at most {most} fit there; take fewer, or a larger area");
                return issues.push(Issue::new(format!("{path}.area"), message));
            }
        }
    } else {
        check_places(thing, crowd, floor, people, &radius, issues);
        thing.position.clone()
    };
    for (i, x) in places.into_iter().enumerate() {
        let down = floor.way(crowd).direction(x);
        let speed = (thing.speed + thing.speed_deviation * normal(&random, i as u64)).max(0.1 * thing.speed);
        people.push(Person {
            x,
            v: [0.0; 2],
            heading: atan2(down[1], down[0]),
            phi: floor.way(crowd).distance(x),
            radius: radius(i),
            speed,
            starts: thing.reaction + thing.reaction_spread * random.uniform(i as u64, 0, REACTION)[0],
            started: false,
            out: None,
            id: people.len() as u32,
            crowd,
        });
    }
}

/// A number of the standard normal distribution, cut at 2, by Box and Muller.
fn normal(random: &Random, i: u64) -> f64 {
    let [u, v, ..] = random.uniform(i, 0, SPEED);
    ((-2.0 * ln(1.0 - u)).sqrt() * cos(std::f64::consts::TAU * v)).clamp(-2.0, 2.0)
}

/// Given positions where somebody cannot be.
fn check_places(thing: &Crowd, crowd: u32, floor: &Floor, people: &[Person], radius: &dyn Fn(usize) -> f64, issues: &mut Vec<Issue>) {
    let own = thing.position.iter().enumerate().map(|(i, x)| (*x, radius(i)));
    let overlap = overlapping(&people.iter().map(|p| (p.x, p.radius)).chain(own).collect::<Vec<_>>());
    for (i, x) in thing.position.iter().enumerate() {
        let path = format!("crowd \"{}\".position[{i}]", thing.name);
        let clear = floor.plan.clearance(*x);
        if clear < radius(i) {
            let message = format!("{} m from a wall, but the body has a radius of {} m; move it", short(clear), short(radius(i)));
            issues.push(Issue::new(path, message));
        } else if !floor.way(crowd).distance(*x).is_finite() {
            issues.push(Issue::new(path, "no exit of it can be reached from there; open a way, or name another exit"));
        } else if overlap[people.len() + i] {
            issues.push(Issue::new(path, "overlaps somebody who stands there already; move it"));
        }
    }
}
