//! Crowds: words to a floor and the people on it.

mod population;

use super::{MethodRules, is_in, late_carriers, scheme_of_its_own};
use crate::math::functions::exp;
use crate::scene::Assets;
use crate::scene::build::Builder;
use crate::scene::laws::flat;
use crate::system::System;
use crate::systems::crowd::{
    AnticipationVelocity, CollisionFreeSpeed, Crowd as People, Floor, Frailty, Gate, Goal, Line, Model, Orca, Plan as Walls, Point,
    Settings, Slope, Smoke, SocialForce, journeys, middle, nearest, width,
};
use population::{fill, largest, smallest, top_speed};
use tumble_interface::check::short;
use tumble_interface::looks::{Colors, FEW, Form, Look};
use tumble_interface::scene::{
    Choice, Crowd, FloorLink, Gate as Words, Method, Plan as Floors, Plane, Preset, Scene, Steering, System as Plan, Walking, corners,
    floor,
};
use tumble_interface::{Issue, Warning};

/// Extinction of light by soot [m²/kg]. Source: [mulholland2000].
const EXTINCTION: f64 = 8700.0;
/// Mass of a person [kg].
const MASS: f64 = 80.0;
/// Bytes for a person: its row three times, and what a step needs.
const PERSON: f64 = 600.0;
/// Bytes for a cell of a floor, and for each way across it.
const CELL: [f64; 2] = [9.0, 20.0];
/// How near lines of links may be to gates [m], and to each other, since nobody crosses two in a step.
const NEAR_LINK: f64 = 0.05;
const FAR: f64 = 0.5;
/// Side of a cell [m], at most, and over the smallest radius.
const SIDE: [f64; 2] = [0.1, 0.6];
/// Pieces of a wall that are compared with each other.
const LONG: usize = 4000;
/// A plan as wide as this [m] is in millimetres.
const WIDE: f64 = 5000.0;

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
        (format!("plan \"{}\".{key}[{k}]", plan.name), Gate { name: words.name.clone(), line, exit, hours: [words.opens, words.closes] })
    };
    let doors = plan.door.iter().enumerate().map(|(k, door)| of("door", k, door, false));
    doors.chain(plan.exit.iter().enumerate().map(|(k, exit)| of("exit", k, exit, true))).collect()
}

/// Links between floors: places in the scene, names and lines.
fn links(plan: &Floors) -> Vec<(String, String, [Line; 2])> {
    let scaled = |line: Line| line.map(|p| p.map(|x| x * plan.scale));
    let link = |(k, link): (usize, &FloorLink)| {
        (format!("plan \"{}\".link[{k}]", plan.name), link.name.clone(), [scaled(link.from), scaled(link.to)])
    };
    plan.link.iter().enumerate().map(link).collect()
}

/// Areas of stairs and ramps, each with its place in the scene.
fn areas(plan: &Floors) -> Vec<(String, Vec<Point>, Point)> {
    let place = |key: &str, k: usize| format!("plan \"{}\".{key}[{k}]", plan.name);
    let scaled = |area: &[Point]| corners(area).into_iter().map(|p| p.map(|x| x * plan.scale)).collect();
    let stairs = plan.stairs.iter().enumerate().map(|(k, s)| (place("stairs", k), scaled(&s.area), s.up));
    stairs.chain(plan.ramp.iter().enumerate().map(|(k, r)| (place("ramp", k), scaled(&r.area), r.up))).collect()
}

/// Stairs and ramps.
fn slopes(plan: &Floors) -> Vec<(Vec<Point>, Slope)> {
    // [tobler1993]: the speed at a slope s is as exp(-3.5 |s + 0.05|).
    let tobler = |s: f64| exp(-3.5 * (s + 0.05).abs()) / exp(-3.5 * 0.05);
    let stairs = plan.stairs.iter().map(|s| [s.up_factor, s.down_factor]);
    let factors = stairs.chain(plan.ramp.iter().map(|r| [tobler(r.slope), tobler(-r.slope)]));
    let slope = |((_, polygon, up), [up_factor, down_factor]): ((String, Vec<Point>, Point), [f64; 2])| {
        let size = (up[0] * up[0] + up[1] * up[1]).sqrt();
        (polygon, Slope { up: up.map(|u| u / size), up_factor, down_factor })
    };
    areas(plan).into_iter().zip(factors).map(slope).collect()
}

/// A door or a waypoint by its name.
fn goal(plan: &Floors, name: &str) -> Option<Goal> {
    let door = plan.door.iter().position(|door| door.name == name).map(Goal::Gate);
    let place = || plan.waypoint.iter().find(|w| w.name == name).map(|w| Goal::Place(w.at.map(|x| x * plan.scale), w.radius));
    door.or_else(place)
}

/// The plan and the crowds of a system.
fn own<'a>(scene: &'a Scene, plan: &Plan) -> (Vec<&'a Floors>, Vec<&'a Crowd>) {
    (scene.plan.iter().filter(|t| is_in(&t.system, plan)).collect(), scene.crowd.iter().filter(|t| is_in(&t.system, plan)).collect())
}

fn model(words: &Walking) -> Model {
    let buffer = words.buffer.unwrap_or(0.04);
    match words.model {
        Steering::CollisionFreeSpeed => Model::CollisionFreeSpeed(CollisionFreeSpeed { time_gap: words.time_gap.unwrap_or(0.65), buffer }),
        Steering::SocialForce => {
            Model::SocialForce(SocialForce { mass: words.mass.unwrap_or(MASS), relaxation: words.relaxation.unwrap_or(0.5) })
        }
        Steering::AnticipationVelocity => {
            Model::AnticipationVelocity(AnticipationVelocity { time_gap: words.time_gap.unwrap_or(0.5), buffer })
        }
        Steering::Orca => Model::Orca(Orca { time_horizon: words.time_horizon.unwrap_or(2.0) }),
    }
}

fn frailty(words: &Walking, flat: bool) -> Frailty {
    Frailty {
        mass: words.mass.unwrap_or(MASS),
        fall_speed: words.fall_speed.unwrap_or(1.0),
        rise_time: words.rise_time.unwrap_or(5.0),
        injury_energy: words.injury_energy.unwrap_or(79.0),
        flat,
    }
}

/// Words of another model, and words for blows where there is nothing that hits.
fn check_model(plan: &Plan, bodies: bool, issues: &mut Vec<Issue>) {
    let Some(words) = &plan.crowd else { return };
    for (word, given) in [
        ("fall_speed", words.fall_speed.is_some()),
        ("rise_time", words.rise_time.is_some()),
        ("injury_energy", words.injury_energy.is_some()),
    ] {
        if given && !bodies {
            let message = "of people whom a [[body]] hits, and there is none; leave it out, or add one";
            issues.push(Issue::new(format!("system \"{}\".crowd.{word}", plan.name), message));
        }
    }
    let gaps = matches!(words.model, Steering::CollisionFreeSpeed | Steering::AnticipationVelocity);
    let (forces, clear) = (words.model == Steering::SocialForce, words.model == Steering::Orca);
    let of = [
        ("time_gap", words.time_gap.is_some() && !gaps, "collision_free_speed and anticipation_velocity"),
        ("buffer", words.buffer.is_some() && !gaps, "collision_free_speed and anticipation_velocity"),
        ("mass", words.mass.is_some() && !forces && !bodies, "social_force, and of people whom a [[body]] hits"),
        ("relaxation", words.relaxation.is_some() && !forces, "social_force"),
        ("time_horizon", words.time_horizon.is_some() && !clear, "orca"),
    ];
    for (word, _, models) in of.into_iter().filter(|(_, idle, _)| *idle) {
        issues.push(Issue::new(
            format!("system \"{}\".crowd.{word}", plan.name),
            format!("of the model {models}; leave it out, or set model"),
        ));
    }
}

/// Smoke of a gas that is none.
fn check_smoke(scene: &Scene, plan: &Plan, issues: &mut Vec<Issue>) {
    let Some(words) = &plan.crowd else { return };
    let path = |word: &str| format!("system \"{}\".crowd.{word}", plan.name);
    if words.extinction.is_some() && words.smoke.is_none() {
        issues.push(Issue::new(path("extinction"), "of smoke, and no gas is named; set smoke to the name of one, or leave it out"));
    }
    let Some(name) = &words.smoke else { return };
    let smoky: Vec<&str> = scene.gas.iter().filter(|gas| gas.smoke.is_some()).map(|gas| gas.name.as_str()).collect();
    if !smoky.contains(&name.as_str()) {
        let message = match &smoky[..] {
            [] => format!("\"{name}\" is no gas with smoke; add a [[gas]] of this name with a table smoke"),
            known => format!("\"{name}\" is no gas with smoke, expected one of {}", known.join(", ")),
        };
        issues.push(Issue::new(path("smoke"), message));
    }
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

/// Distance of two lines [m].
fn apart(v: Line, w: Line) -> f64 {
    let ends = v.map(|x| (x, w)).into_iter().chain(w.map(|x| (x, v)));
    let far = ends.map(|(x, line)| width([x, nearest(line, x)])).fold(f64::INFINITY, f64::min);
    if cross(v, w).is_some() { 0.0 } else { far }
}

/// Links whose lines are not one place, or so near a gate or each other that a step crosses both.
fn check_links(thing: &Floors, issues: &mut Vec<Issue>) {
    let ends =
        links(thing).into_iter().flat_map(|(path, _, lines)| ["from", "to"].map(|key| format!("{path}.{key}")).into_iter().zip(lines));
    let ends: Vec<(String, Line)> = ends.collect();
    for pair in ends.chunks_exact(2) {
        let ([from, to], path) = ([width(pair[0].1), width(pair[1].1)], &pair[1].0);
        if (from - to).abs() > 0.01 * from.max(to) {
            let message = format!("{} m wide, and from {} m; the two lines are one place, draw them equally wide", short(to), short(from));
            issues.push(Issue::new(path, message));
        }
    }
    for (k, (path, line)) in ends.iter().enumerate() {
        if let Some((_, gate)) = gates(thing).into_iter().find(|(_, gate)| apart(gate.line, *line) < NEAR_LINK) {
            let message = format!("\"{}\" is nearer to it than {NEAR_LINK} m; move one of them along the way", gate.name);
            issues.push(Issue::new(path, message));
        }
        if let Some((other, _)) = ends[..k].iter().find(|(_, other)| apart(*other, *line) < FAR) {
            issues.push(Issue::new(path, format!("nearer than {FAR} m to {other}; move one of them along the way")));
        }
    }
}

/// Gates and links that nobody can pass, or that are nowhere.
fn check_gates(thing: &Floors, radius: f64, issues: &mut Vec<Issue>) {
    let names = gates(thing).into_iter().map(|(path, gate)| (path, gate.name));
    let names: Vec<_> = names.chain(links(thing).into_iter().map(|(path, name, _)| (path, name))).collect();
    for (k, (path, name)) in names.iter().enumerate() {
        if let Some((first, _)) = names[..k].iter().find(|(_, other)| other == name) {
            issues.push(Issue::new(path, format!("\"{name}\" is the name of {first}, too; give it another")));
        }
    }
    let both = links(thing).into_iter().flat_map(|(path, name, lines)| {
        ["from", "to"].into_iter().zip(lines).map(move |(key, line)| (format!("{path}.{key}"), name.clone(), line))
    });
    let all = gates(thing).into_iter().map(|(path, gate)| (path, gate.name, gate.line)).chain(both);
    let walls = lines(&walls(thing));
    let bound = |a: usize, f: fn(f64, f64) -> f64| walls.iter().flatten().map(|p| p[a]).reduce(f);
    for (path, name, line) in all {
        let (middle, width) = (middle(line), width(line));
        let clear = walls.iter().map(|wall| {
            let foot = nearest(*wall, middle);
            ((foot[0] - middle[0]).powi(2) + (foot[1] - middle[1]).powi(2)).sqrt()
        });
        let clear = clear.fold(f64::INFINITY, f64::min);
        let outside = (0..2).any(|a| {
            let beyond = |low: f64, high: f64| middle[a] < low - radius || middle[a] > high + radius;
            bound(a, f64::min).zip(bound(a, f64::max)).is_some_and(|(low, high)| beyond(low, high))
        });
        if outside {
            issues.push(Issue::new(path, format!("\"{name}\" at {} lies outside the walls; move it to an opening of them", at(middle))));
        } else if width < 2.0 * radius {
            let message = format!(
                "nobody can pass: \"{name}\" at {} is {} m wide, and the largest body {} m; widen it, or lower the radius",
                at(middle),
                short(width),
                short(2.0 * radius)
            );
            issues.push(Issue::new(path, message));
        } else if clear < radius {
            let message = format!("nobody can pass: a wall stands in \"{name}\" at {}; end the wall at its jambs, or move it", at(middle));
            issues.push(Issue::new(path, message));
        }
    }
}

/// What is wrong with the words of a crowd.
fn check_crowd(thing: &Crowd, plan: Option<&Floors>, issues: &mut Vec<Issue>) {
    let path = format!("crowd \"{}\"", thing.name);
    let given = [thing.count.is_some(), thing.density.is_some(), !thing.position.is_empty(), !thing.arrivals.is_empty()];
    if given.iter().filter(|given| **given).count() != 1 {
        issues.push(Issue::new(&path, "expected one of count, density and position, or arrivals"));
    }
    if thing.rate.is_some() && thing.count.is_none() && thing.density.is_none() {
        issues.push(Issue::new(format!("{path}.rate"), "says how many of a count come in a second; give count, or leave it out"));
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
    for (k, name) in thing.goals.iter().enumerate() {
        if plan.is_some_and(|plan| goal(plan, name).is_none()) {
            let names = plan.into_iter().flat_map(|plan| {
                let doors = plan.door.iter().map(|door| door.name.as_str());
                doors.chain(plan.waypoint.iter().map(|w| w.name.as_str()))
            });
            let message =
                format!("\"{name}\" is no door or waypoint of the plan, expected one of {}", names.collect::<Vec<_>>().join(", "));
            issues.push(Issue::new(format!("{path}.goals[{k}]"), message));
        }
    }
    check_distributions(thing, issues);
}

/// Distributions of a crowd that contradict each other.
fn check_distributions(thing: &Crowd, issues: &mut Vec<Issue>) {
    let path = format!("crowd \"{}\"", thing.name);
    let two = [
        ("radius_deviation", thing.radius_deviation > 0.0 && thing.radius_spread > 0.0, "radius_spread"),
        ("speed_spread", thing.speed_spread.is_some() && thing.speed_deviation.is_some(), "speed_deviation"),
        ("reaction_deviation", thing.reaction_deviation > 0.0 && thing.reaction_spread > 0.0, "reaction_spread"),
        ("preset", thing.preset.is_some() && thing.speed_spread.is_some(), "speed_spread"),
        ("preset", thing.preset.is_some() && thing.speed_deviation.is_some(), "speed_deviation"),
    ];
    for (word, _, other) in two.into_iter().filter(|(_, both, _)| *both) {
        issues.push(Issue::new(format!("{path}.{word}"), format!("given with {other}; leave one of them out")));
    }
    if smallest(thing) < 0.05 {
        let message = format!("radii down to {} m, expected at least 0.05 m; take a smaller deviation or spread", short(smallest(thing)));
        issues.push(Issue::new(format!("{path}.radius"), message));
    }
    if thing.age.is_some() && thing.preset != Some(Preset::Rimea) {
        issues.push(Issue::new(format!("{path}.age"), "says nothing without preset = \"rimea\"; set it, or leave age out"));
    }
    if let Some([low, high]) = thing.age
        && low > high
    {
        issues.push(Issue::new(format!("{path}.age"), format!("{} to {}, expected the lower age first", short(low), short(high))));
    }
}

/// Slopes without floor or direction, hours in which nothing changes, and names that are given twice.
fn check_places(thing: &Floors, issues: &mut Vec<Issue>) {
    for (path, polygon, up) in areas(thing) {
        if polygon.len() < 3 || floor(&polygon) <= 0.0 {
            issues.push(Issue::new(
                format!("{path}.area"),
                "expected two opposite corners of a rectangle, or at least three corners of a polygon",
            ));
        }
        if up == [0.0; 2] {
            issues.push(Issue::new(format!("{path}.up"), "[0, 0], expected the direction in which it rises"));
        }
    }
    for (path, gate) in gates(thing) {
        if let [Some(opens), Some(closes)] = gate.hours
            && opens == closes
        {
            issues.push(Issue::new(format!("{path}.closes"), format!("{} s, when it opens, too; give another time", short(closes))));
        }
    }
    for (k, waypoint) in thing.waypoint.iter().enumerate() {
        let others = thing.door.iter().chain(&thing.exit).map(|gate| &gate.name).chain(thing.link.iter().map(|link| &link.name));
        let others = others.chain(thing.waypoint[..k].iter().map(|w| &w.name));
        if others.into_iter().any(|name| *name == waypoint.name) {
            let path = format!("plan \"{}\".waypoint[{k}]", thing.name);
            issues.push(Issue::new(path, format!("\"{}\" is the name of something else, too; give it another", waypoint.name)));
        }
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

    fn own_scheme(&self) -> Option<&'static str> {
        Some("people have a scheme of their own and no integrator")
    }

    fn noun(&self) -> &'static str {
        "person"
    }

    fn theory(&self) -> &'static [(&'static str, &'static [&'static str])] {
        &[("crowds", &["crowds.4", "crowds.7"])]
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
            check_model(plan, !scene.body.is_empty(), issues);
            check_smoke(scene, plan, issues);
            let radius = crowds.iter().map(|thing| largest(thing)).fold(0.0, f64::max);
            for thing in &floors {
                check_places(thing, issues);
                check_walls(thing, issues);
                check_gates(thing, radius, issues);
                check_links(thing, issues);
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

    fn hints(&self, scene: &Scene) -> Vec<Warning> {
        let crowds = scene.system.iter().enumerate().filter(|(_, plan)| plan.method == Method::Crowd);
        let smoke = |plan: &Plan| plan.crowd.as_ref().and_then(|words| words.smoke.clone()).into_iter().collect::<Vec<_>>();
        crowds.flat_map(|(index, plan)| late_carriers(scene, index, &smoke(plan))).collect()
    }

    fn looks(&self, scene: &Scene, plan: &Plan, colors: &mut Colors) -> Vec<Look> {
        let (floors, crowds) = own(scene, plan);
        let wall = |t: &&Floors| Look {
            few: true,
            ..Look::new(&t.name, Form::Points, t.color.unwrap_or(tumble_interface::looks::SOLID)).with_radius(0.04)
        };
        let mut looks: Vec<Look> = floors.iter().map(wall).collect();
        let form = if flat(scene).is_some() { Form::Points } else { Form::Instances };
        let leap = floors.iter().flat_map(|t| links(t)).map(|(_, _, lines)| 0.5 * width(lines.map(middle))).reduce(f64::min);
        let people = |t: &&Crowd| Look {
            trail: t.trail,
            leap,
            few: t.people() < FEW,
            ..Look::new(&t.name, form, colors.pick(t.color)).with_radius(t.radius)
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
        let of = |thing: &Crowd| (1 + thing.goals.len() + if thing.choice == Choice::Quickest { thing.exit.len() } else { 0 }) as f64;
        let ways = scene.crowd.iter().map(of).sum::<f64>().max(1.0);
        PERSON * people + (CELL[0] + CELL[1] * ways) * scene.plan.iter().map(cells).sum::<f64>()
    }

    fn build(&self, builder: &mut Builder<'_>, index: usize) -> Option<Box<dyn System>> {
        let (scene, plan) = (builder.scene, builder.plan(index));
        let (floors, crowds) = own(scene, plan);
        if !builder.issues.is_empty() {
            return None;
        }
        let thing = *floors.first()?;
        let words = plan.crowd.clone().unwrap_or_default();
        let model = model(&words);
        let gates: Vec<Gate> = gates(thing).into_iter().map(|(_, gate)| gate).collect();
        let goals = |crowd: &Crowd| {
            let may = |gate: &Gate| gate.exit && (crowd.exit.is_empty() || crowd.exit.contains(&gate.name));
            let exits = (0..gates.len()).filter(|g| may(&gates[*g])).collect();
            let goals: Vec<Goal> = crowd.goals.iter().filter_map(|name| goal(thing, name)).chain([Goal::Exits(exits)]).collect();
            (goals, crowd.choice == Choice::Quickest)
        };
        let (journeys, targets) = journeys(crowds.iter().map(|crowd| goals(crowd)).collect());
        let radius = crowds.iter().map(|crowd| largest(crowd)).fold(0.05, f64::max);
        let fastest = crowds.iter().map(|crowd| top_speed(crowd)).fold(0.0, f64::max);
        let timed = gates.iter().any(|gate| gate.hours != [None; 2]);
        let links: Vec<[Line; 2]> = links(thing).into_iter().map(|(_, _, lines)| lines).collect();
        let walls = Walls::new(lines(&walls(thing)), gates, model.reach(fastest, radius)).with_slopes(slopes(thing)).with_links(&links);
        // People have a way if they have one while all is open.
        let side = side(&crowds);
        let open = timed.then(|| Floor::new(walls.clone().without_hours(), targets.clone(), side, radius));
        let floor = Floor::new(walls, targets, side, radius);
        let (people, arrivals) = fill(&crowds, thing, &journeys, &floor, open.as_ref().unwrap_or(&floor), scene.seed, &mut builder.issues);
        let starts: Vec<Point> = people.iter().map(|p| p.x).collect();
        let areas: Vec<&[Point]> = arrivals.iter().map(|a| &a.polygon[..]).collect();
        let both = if thing.link.is_empty() { Vec::new() } else { floor.both_sides(&starts, &areas) };
        if let Some(x) = both.first() {
            let message = format!(
                "people get to both sides of the line at {}; each floor lies on one side of its line: end the line at its jambs, close the walls \
                 around it, or swap the ends of to, if the other floor lies on the wrong side",
                at(*x)
            );
            builder.issues.push(Issue::new(format!("plan \"{}\".link", thing.name), message));
        }
        words.smoke.iter().for_each(|gas| builder.exchange.ask(gas, "smoke"));
        let settings = Settings {
            name: plan.name.clone(),
            substeps: plan.substeps,
            step: plan.step,
            model,
            frailty: (!scene.body.is_empty()).then(|| frailty(&words, flat(scene).is_some())),
            smoke: words.smoke.clone().map(|gas| Smoke::new(gas, words.extinction.unwrap_or(EXTINCTION), flat(scene).is_some())),
            flat: flat(scene).is_some(),
            mass: words.mass.unwrap_or(MASS),
            plan: thing.name.clone(),
            crowds: crowds.iter().map(|crowd| crowd.name.clone()).collect(),
            journeys,
        };
        Some(Box::new(People::new(settings, floor, people, arrivals)))
    }
}

/// Side of a cell for bodies of these crowds [m].
fn side(crowds: &[&Crowd]) -> f64 {
    let smallest = crowds.iter().map(|crowd| smallest(crowd)).fold(f64::INFINITY, f64::min);
    (SIDE[1] * smallest).min(SIDE[0])
}
