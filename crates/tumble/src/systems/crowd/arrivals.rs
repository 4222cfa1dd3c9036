//! People who come later, one after the other, each to a free place of an area.

use super::around::Person;
use super::floor::Floor;
use super::plan::{Point, inside, length, sub};
use crate::math::Random;
use crate::math::functions::atan2;

/// Places that are tried in a step.
const TRIES: u32 = 20;
/// Purpose of random numbers.
const PLACE: u32 = 19;

/// People of a crowd who come later.
pub struct Arrivals {
    /// Where they come to, the corners of a polygon.
    pub polygon: Vec<Point>,
    /// Numbers for their places.
    pub random: Random,
    /// When each comes [s], and who it is, with the time to react after that for its start; in order.
    pub people: Vec<(f64, Person)>,
    /// How many have come.
    pub come: usize,
}

impl Arrivals {
    /// Whoever is due at t [s] comes, if there is room; whoever comes later waits for those before it. `step` numbers the step.
    pub fn come(&mut self, people: &mut Vec<Person>, floor: &Floor, t: f64, step: u32) {
        while let Some((at, person)) = self.people.get(self.come).filter(|(at, _)| *at <= t) {
            let Some(x) = self.place(person, people, floor, step) else { return };
            let (down, _) = floor.way(person.way).direction(x);
            let phi = floor.way(person.way).distance(x);
            let new = Person { x, phi, heading: atan2(down[1], down[0]), starts: at.max(t) + person.starts, ..*person };
            people.insert(people.partition_point(|p| p.id < new.id), new);
            self.come += 1;
        }
    }

    /// A free place from which there is a way.
    fn place(&self, person: &Person, people: &[Person], floor: &Floor, step: u32) -> Option<Point> {
        let bound = |a: usize, f: fn(f64, f64) -> f64| self.polygon.iter().map(|p| p[a]).reduce(f).unwrap_or(0.0);
        let (low, high) = ([bound(0, f64::min), bound(1, f64::min)], [bound(0, f64::max), bound(1, f64::max)]);
        let free = |x: Point| {
            inside(&self.polygon, x)
                && floor.plan.clearance(x) >= person.radius
                && floor.way(person.way).distance(x).is_finite()
                && people.iter().all(|p| length(sub(p.x, x)) >= p.radius + person.radius)
        };
        let place = |k: u32| {
            let [u, v, ..] = self.random.uniform(u64::from(person.id), step.wrapping_mul(TRIES).wrapping_add(k), PLACE);
            [low[0] + u * (high[0] - low[0]), low[1] + v * (high[1] - low[1])]
        };
        (0..TRIES).map(place).find(|x| free(*x))
    }
}
