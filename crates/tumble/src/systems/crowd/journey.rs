//! Where people go: goals in order, then an exit, and which of the exits.

use super::around::Person;
use super::floor::Floor;
use super::plan::Point;
use super::tally::Share;
use super::way::Target;

/// Where a leg of a journey ends.
#[derive(Debug, Clone, PartialEq)]
pub enum Goal {
    /// At the first of these gates that is crossed, by which people leave.
    Exits(Vec<usize>),
    /// At a gate.
    Gate(usize),
    /// Within a radius [m] of a place.
    Place(Point, f64),
}

/// A part of a journey.
#[derive(Debug, Clone, PartialEq)]
pub struct Leg {
    /// Where it ends.
    pub goal: Goal,
    /// The ways there: one to the nearest exit, or one to each.
    pub ways: Vec<u32>,
}

impl Leg {
    /// The shortest of its ways from a place, and the distance.
    pub fn shortest(&self, floor: &Floor, x: Point) -> (u32, f64) {
        let ways = self.ways.iter().map(|way| (*way, floor.way(*way).distance(x)));
        ways.reduce(|a, b| if b.1 < a.1 { b } else { a }).unwrap_or((0, f64::INFINITY))
    }
}

/// Legs of all crowds, given their goals and whether they take the quickest exit, and what their ways lead to.
pub fn journeys(all: Vec<(Vec<Goal>, bool)>) -> (Vec<Vec<Leg>>, Vec<Vec<Target>>) {
    let mut targets: Vec<Vec<Target>> = Vec::new();
    let mut number = |wanted: Vec<Target>| {
        let known = targets.iter().position(|known| *known == wanted);
        known.unwrap_or_else(|| {
            targets.push(wanted);
            targets.len() - 1
        }) as u32
    };
    let mut leg = |goal: Goal, quickest: bool| {
        let ways = match &goal {
            Goal::Exits(exits) if quickest => exits.iter().map(|g| number(vec![Target::Gate(*g)])).collect(),
            Goal::Exits(exits) => vec![number(exits.iter().map(|g| Target::Gate(*g)).collect())],
            Goal::Gate(g) => vec![number(vec![Target::Gate(*g)])],
            Goal::Place(x, radius) => vec![number(vec![Target::Place(*x, *radius)])],
        };
        Leg { goal, ways }
    };
    let legs = all.into_iter().map(|(goals, quickest)| goals.into_iter().map(|goal| leg(goal, quickest)).collect()).collect();
    (legs, targets)
}

/// What an exit lets through, a second and a metre of its width: the mean of experiments, [kretz2006] [seyfried2009].
const FLOW: f64 = 1.86;
/// How often somebody thinks about another exit [s].
const EVERY: f64 = 1.0;
/// By how much another must be quicker, in seconds, and as a part of the time.
const GAIN: [f64; 2] = [1.0, 0.1];

/// Lets those whose turn it is choose the exit that they would be out of first:                           (crowds.12)
///
///   T = max(phi / v0, n / (1.86 /(m s) w))
///
/// with n people who go there and are nearer. Says what that adds to the time of walking freely.
pub fn choose(people: &mut [Person], floor: &Floor, journeys: &[Vec<Leg>], t: f64, h: f64) -> Vec<Share> {
    if !journeys.iter().flatten().any(|leg| leg.ways.len() > 1) {
        return Vec::new();
    }
    let mut queues: Vec<Vec<f64>> = vec![Vec::new(); floor.count()];
    for p in people.iter().filter(|p| p.out.is_none()) {
        queues[p.way as usize].push(p.phi);
    }
    queues.iter_mut().for_each(|queue| queue.sort_by(f64::total_cmp));
    let (turns, turn) = ((EVERY / h).round().max(1.0) as u64, (t / h).round() as u64);
    let mut shares = Vec::new();
    for p in people.iter_mut().filter(|p| p.out.is_none() && t >= p.starts && (turn + u64::from(p.id)).is_multiple_of(turns)) {
        let leg = &journeys[p.crowd as usize][p.leg as usize];
        let Goal::Exits(exits) = &leg.goal else { continue };
        if leg.ways.len() < 2 {
            continue;
        }
        let time = |phi: f64, way: u32, exit: usize| {
            let ahead = queues[way as usize].partition_point(|other| *other < phi) as f64;
            (phi / p.speed).max(ahead / (FLOW * floor.plan.gates[exit].width()))
        };
        let (mut now, mut best) = (f64::INFINITY, (f64::INFINITY, p.way, p.phi));
        for (way, exit) in leg.ways.iter().zip(exits) {
            let phi = floor.way(*way).distance(p.x);
            let time = time(phi, *way, *exit);
            if *way == p.way {
                now = time;
            }
            if time < best.0 {
                best = (time, *way, phi);
            }
        }
        if best.1 != p.way && best.0 < now - (GAIN[1] * now).max(GAIN[0]) {
            if p.phi.is_finite() {
                let (_, gate) = floor.way(p.way).direction(p.x);
                shares.push(Share { gate, lost: (best.2 - p.phi) / p.speed, waited: 0.0 });
            }
            (p.way, p.phi) = (best.1, best.2);
        }
    }
    shares
}
