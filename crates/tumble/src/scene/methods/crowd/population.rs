//! The people of crowds: who they are by their distributions, where they stand at the start, and who comes later.

use crate::math::Random;
use crate::math::functions::{atan2, cos, ln};
use crate::systems::crowd::{Arrivals, Floor, Goal, Leg, Misfit, Person, Point, Room, overlapping};
use tumble_interface::Issue;
use tumble_interface::check::short;
use tumble_interface::scene::{Crowd, Plan, Preset};

// Purposes of random numbers.
const RADIUS: u32 = 16;
const SPEED: u32 = 17;
const REACTION: u32 = 18;
const GAP: u32 = 20;
const AGE: u32 = 21;

/// Desired speeds of measured people, mean and deviation [m/s].
const WEIDMANN: [f64; 2] = [1.34, 0.26];
/// Deviation of desired speeds, unless given [m/s].
const DEVIATION: f64 = 0.26;
/// Ages, mean and deviation, and between which.
const AGES: [[f64; 2]; 2] = [[50.0, 20.0], [10.0, 85.0]];
/// Speed on the level [m/s] at an age, from the figure in the guideline of [rimea2016], after [weidmann1993]; linear in between.
const SPEEDS: [(f64, f64); 10] = [
    (3.0, 0.58),
    (10.0, 1.17),
    (20.0, 1.61),
    (30.0, 1.54),
    (40.0, 1.48),
    (50.0, 1.41),
    (60.0, 1.26),
    (70.0, 1.06),
    (80.0, 0.7),
    (85.0, 0.55),
];

/// The largest radius of a crowd [m].
pub fn largest(thing: &Crowd) -> f64 {
    thing.radius * (1.0 + thing.radius_spread) + 2.0 * thing.radius_deviation
}

/// The smallest.
pub fn smallest(thing: &Crowd) -> f64 {
    thing.radius * (1.0 - thing.radius_spread) - 2.0 * thing.radius_deviation
}

/// The largest desired speed [m/s].
pub fn top_speed(thing: &Crowd) -> f64 {
    match (thing.preset, thing.speed_spread) {
        (Some(Preset::Rimea), _) => SPEEDS.iter().map(|(_, speed)| *speed).fold(0.0, f64::max),
        (Some(Preset::Weidmann), _) => WEIDMANN[0] + 2.0 * WEIDMANN[1],
        (None, Some(spread)) => thing.speed * (1.0 + spread),
        (None, None) => thing.speed + 2.0 * thing.speed_deviation.unwrap_or(DEVIATION),
    }
}

/// Numbers of a crowd.
struct Draw<'a> {
    thing: &'a Crowd,
    random: Random,
}

impl Draw<'_> {
    /// Uniform in -1 to 1.
    fn uniform(&self, i: usize, purpose: u32) -> f64 {
        2.0 * self.random.uniform(i as u64, 0, purpose)[0] - 1.0
    }

    /// A number of the standard normal distribution, cut at 2, by Box and Muller.
    fn normal(&self, i: usize, purpose: u32) -> f64 {
        let [u, v, ..] = self.random.uniform(i as u64, 0, purpose);
        ((-2.0 * ln(1.0 - u)).sqrt() * cos(std::f64::consts::TAU * v)).clamp(-2.0, 2.0)
    }

    fn radius(&self, i: usize) -> f64 {
        let thing = self.thing;
        if thing.radius_deviation > 0.0 {
            return thing.radius + thing.radius_deviation * self.normal(i, RADIUS);
        }
        thing.radius * (1.0 + thing.radius_spread * self.uniform(i, RADIUS))
    }

    fn speed(&self, i: usize) -> f64 {
        let thing = self.thing;
        match (thing.preset, thing.speed_spread) {
            (Some(Preset::Rimea), _) => speed_at(self.age(i)),
            (Some(Preset::Weidmann), _) => WEIDMANN[0] + WEIDMANN[1] * self.normal(i, SPEED),
            (None, Some(spread)) => thing.speed * (1.0 + spread * self.uniform(i, SPEED)),
            (None, None) => {
                let deviation = thing.speed_deviation.unwrap_or(DEVIATION);
                (thing.speed + deviation * self.normal(i, SPEED)).max(0.1 * thing.speed)
            }
        }
    }

    fn reaction(&self, i: usize) -> f64 {
        let thing = self.thing;
        if thing.reaction_deviation > 0.0 {
            return (thing.reaction + thing.reaction_deviation * self.normal(i, REACTION)).max(0.0);
        }
        thing.reaction + thing.reaction_spread * self.random.uniform(i as u64, 0, REACTION)[0]
    }

    /// Age in years.
    fn age(&self, i: usize) -> f64 {
        if let Some([low, high]) = self.thing.age {
            return low + (high - low) * self.random.uniform(i as u64, 0, AGE)[0];
        }
        let [[mean, deviation], [low, high]] = AGES;
        // What is cut off is drawn again.
        let drawn = |k: u32| {
            let [u, v, ..] = self.random.uniform(i as u64, k, AGE);
            mean + deviation * (-2.0 * ln(1.0 - u)).sqrt() * cos(std::f64::consts::TAU * v)
        };
        (0..32).map(drawn).find(|age| (low..=high).contains(age)).unwrap_or(mean)
    }

    /// When each of so many comes [s], if they come later.
    fn arrivals(&self, count: usize) -> Option<Vec<f64>> {
        if !self.thing.arrivals.is_empty() {
            let mut times = self.thing.arrivals.clone();
            times.sort_by(f64::total_cmp);
            return Some(times);
        }
        let rate = self.thing.rate?;
        let mut t = 0.0;
        let next = |i: usize| {
            t -= ln(1.0 - self.random.uniform(i as u64, 0, GAP)[0]) / rate;
            t
        };
        Some((0..count).map(next).collect())
    }
}

/// Speed on the level at an age [m/s].
fn speed_at(age: f64) -> f64 {
    let between = |ends: &[(f64, f64)]| {
        let ((a, v), (b, w)) = (ends[0], ends[1]);
        (age >= a && age <= b).then(|| v + (age - a) / (b - a) * (w - v))
    };
    let beyond = if age < SPEEDS[0].0 { SPEEDS[0].1 } else { SPEEDS[SPEEDS.len() - 1].1 };
    SPEEDS.windows(2).find_map(between).unwrap_or(beyond)
}

/// Everybody on a floor at the start, and who comes later. `open` is the floor with all gates open.
pub fn fill(
    crowds: &[&Crowd],
    plan: &Plan,
    journeys: &[Vec<Leg>],
    floor: &Floor,
    open: &Floor,
    seed: u32,
    issues: &mut Vec<Issue>,
) -> (Vec<Person>, Vec<Arrivals>) {
    let (mut people, mut arrivals, mut id) = (Vec::new(), Vec::new(), 0);
    for (k, thing) in crowds.iter().enumerate() {
        let legs = &journeys[k];
        check_legs(thing, plan, legs, open, issues);
        let draw = Draw { thing, random: Random::new(seed, &thing.name) };
        let person = |i: usize, x: Point| {
            let (way, phi) = legs[0].shortest(floor, x);
            let (down, _) = floor.way(way).direction(x);
            let (radius, speed) = (draw.radius(i), draw.speed(i));
            Person {
                x,
                v: [0.0; 2],
                heading: atan2(down[1], down[0]),
                phi,
                radius,
                speed,
                free: speed,
                starts: draw.reaction(i),
                started: false,
                slide: [0.0; 2],
                up: 0.0,
                lies: false,
                out: None,
                id: id + i as u32,
                crowd: k as u32,
                leg: 0,
                way,
            }
        };
        let count = thing.people() as usize;
        if let Some(times) = draw.arrivals(count) {
            // There is room for one at least.
            places(&draw, &legs[0], 1, open, &[], issues);
            let later = times.into_iter().enumerate().map(|(i, t)| (t, person(i, thing.polygon()[0])));
            arrivals.push(Arrivals { polygon: thing.polygon(), random: draw.random, people: later.collect(), come: 0 });
        } else {
            let new: Vec<Person> =
                places(&draw, &legs[0], count, open, &people, issues).into_iter().enumerate().map(|(i, x)| person(i, x)).collect();
            people.extend(new);
        }
        id += count as u32;
    }
    (people, arrivals)
}

/// Goals from which there is no way on.
fn check_legs(thing: &Crowd, plan: &Plan, legs: &[Leg], open: &Floor, issues: &mut Vec<Issue>) {
    for (k, pair) in legs.windows(2).enumerate() {
        let from = match &pair[0].goal {
            Goal::Gate(g) => {
                let [a, b] = open.plan.gates[*g].line;
                [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
            }
            Goal::Place(x, _) => *x,
            Goal::Exits(_) => continue,
        };
        if pair[1].shortest(open, from).1.is_infinite() {
            let (word, what) = match thing.goals.get(k + 1) {
                Some(name) => (format!("goals[{}]", k + 1), format!("\"{name}\"")),
                None => ("exit".into(), "an exit of it".into()),
            };
            let message =
                format!("no way leads from \"{}\" to {what} of plan \"{}\"; open one, or leave the goal out", thing.goals[k], plan.name);
            issues.push(Issue::new(format!("crowd \"{}\".{word}", thing.name), message));
        }
    }
}

/// Places of so many people of a crowd.
fn places(draw: &Draw<'_>, leg: &Leg, count: usize, open: &Floor, people: &[Person], issues: &mut Vec<Issue>) -> Vec<Point> {
    let thing = draw.thing;
    if !thing.position.is_empty() {
        check_positions(draw, leg, open, people, issues);
        return thing.position.clone();
    }
    let path = format!("crowd \"{}\".area", thing.name);
    let polygon = thing.polygon();
    let room = Room { polygon: &polygon, count, radius: largest(thing), ways: &leg.ways };
    let there: Vec<(Point, f64)> = people.iter().map(|p: &Person| (p.x, p.radius)).collect();
    room.places(open, &draw.random, &there).unwrap_or_else(|misfit| {
        issues.push(match misfit {
            Misfit::NoWay => {
                let what = if thing.goals.is_empty() { "exit" } else { "goal" };
                let message = format!(
                    "no {what} of it can be reached from there: walls or narrow doors cut it off; open a way, or name another {what}"
                );
                Issue::new(path, message)
            }
            Misfit::Most(most) => Issue::new(path, format!("{count} people, but at most {most} fit there; take fewer, or a larger area")),
        });
        Vec::new()
    })
}

/// Given positions where somebody cannot be.
fn check_positions(draw: &Draw<'_>, leg: &Leg, open: &Floor, people: &[Person], issues: &mut Vec<Issue>) {
    let thing = draw.thing;
    let own = thing.position.iter().enumerate().map(|(i, x)| (*x, draw.radius(i)));
    let overlap = overlapping(&people.iter().map(|p| (p.x, p.radius)).chain(own).collect::<Vec<_>>());
    for (i, x) in thing.position.iter().enumerate() {
        let path = format!("crowd \"{}\".position[{i}]", thing.name);
        let clear = open.plan.clearance(*x);
        if clear < draw.radius(i) {
            let message = format!("{} m from a wall, but the body has a radius of {} m; move it", short(clear), short(draw.radius(i)));
            issues.push(Issue::new(path, message));
        } else if leg.shortest(open, *x).1.is_infinite() {
            issues.push(Issue::new(path, "no exit of it can be reached from there; open a way, or name another exit"));
        } else if overlap[people.len() + i] {
            issues.push(Issue::new(path, "overlaps somebody who stands there already; move it"));
        }
    }
}
