//! Everybody's walk: who comes, steps, who crosses gates, reaches goals and leaves, and what is counted.

use super::around::Person;
use super::arrivals::Arrivals;
use super::bodies::{Bodies, Frailty};
use super::floor::Floor;
use super::image::{Image, images};
use super::journey::{Goal, Leg, choose};
use super::models::Model;
use super::near::Near;
use super::people::{Air, Move, Scratch, step};
use super::plan::{Point, length, sub};
use super::smoke::Smoke;
use super::tally::{Share, Tally};
use crate::math::parallel::max;

/// How far people go on beyond an exit, in the way of who follows [m], and for how long at most [s].
const BEYOND: f64 = 1.0;
const PATIENCE: f64 = 3.0;
/// How often people look which ways bodies close [s].
const LOOK: f64 = 1.0;

/// People on a floor.
pub struct Walk {
    pub floor: Floor,
    pub model: Model,
    /// Where each crowd goes.
    pub journeys: Vec<Vec<Leg>>,
    /// Who comes later.
    pub arrivals: Vec<Arrivals>,
    /// Who is there, and who has just left, in the order of numbers.
    pub people: Vec<Person>,
    /// When the last step began [s].
    pub time: f64,
    /// Time lost by all so far [s].
    pub lost: f64,
    pub tally: Tally,
    /// The bodies of others among people, and what people withstand, where there are any.
    pub bodies: Bodies,
    frailty: Option<Frailty>,
    /// The smoke that they walk in, if any.
    pub smoke: Option<Smoke>,
    scratch: Scratch,
    /// Places and distances left before a step.
    before: Vec<(Point, f64)>,
}

impl Walk {
    /// People on a floor.
    pub fn new(
        floor: Floor,
        (model, frailty, smoke): (Model, Option<Frailty>, Option<Smoke>),
        journeys: Vec<Vec<Leg>>,
        people: Vec<Person>,
        arrivals: Vec<Arrivals>,
    ) -> Self {
        let tally = Tally::new(floor.plan.gates.len());
        let (bodies, scratch, before) = (Bodies::default(), Scratch::default(), Vec::new());
        Self { floor, model, journeys, arrivals, people, time: 0.0, lost: 0.0, tally, bodies, frailty, smoke, scratch, before }
    }

    /// A step of h [s] from t.
    pub fn step(&mut self, t: f64, h: f64) {
        self.time = t;
        let looks = (t / LOOK).floor() > ((t - h) / LOOK).floor();
        let changed = match &self.frailty {
            Some(frailty) if looks => self.floor.close(self.bodies.closes(&self.floor, frailty)),
            _ => false,
        };
        if self.floor.keep_hours(t) || changed {
            self.replan();
        }
        for arrivals in &mut self.arrivals {
            arrivals.come(&mut self.people, &self.floor, t, (t / h).round() as u32);
        }
        let mut shares = choose(&mut self.people, &self.floor, &self.journeys, t, h);
        self.before.clear();
        self.before.extend(self.people.iter().map(|p| (p.x, p.phi)));
        if let Some(frailty) = &self.frailty {
            self.bodies.meet(&mut self.people, frailty, t, h);
        }
        let extinctions = self.smoke.as_ref().map_or(Vec::new(), |smoke| smoke.extinctions(self.people.iter().map(|p| p.x)));
        let air = Air { bodies: &self.bodies, extinctions: &extinctions };
        step(&mut self.people, &self.floor, &self.model, &air, &mut self.scratch, t, h);
        self.bodies.advance(h);
        let moves = std::mem::take(&mut self.scratch.moves);
        let queues = self.tally.queues(&self.floor, &self.people, &moves, h);
        let mut gone = Vec::new();
        for (i, to) in moves.iter().enumerate() {
            let p = &mut self.people[i];
            if p.out.is_some() {
                p.phi = to.phi;
                if p.phi < -BEYOND || t - p.starts > PATIENCE {
                    gone.push(p.id);
                }
            } else {
                shares.extend(self.arrive(i, to, t, h));
            }
        }
        self.scratch.moves = moves;
        self.lost += shares.iter().map(|share| share.lost).sum::<f64>();
        self.tally.charge(&shares, &queues);
        if !gone.is_empty() {
            self.people.retain(|p| gone.binary_search(&p.id).is_err());
        }
        if self.frailty.is_some() {
            self.keep_down(t + h, h);
        }
    }

    /// Who would rise at t waits until nobody is on top.
    fn keep_down(&mut self, t: f64, h: f64) {
        let on_top = |p: &Person, o: &Person| !o.lies && o.id != p.id && length(sub(o.x, p.x)) < p.radius + o.radius;
        let waits = |p: &Person| p.lies && t >= p.up && self.people.iter().any(|o| on_top(p, o));
        let waiting: Vec<usize> = (0..self.people.len()).filter(|i| waits(&self.people[*i])).collect();
        waiting.into_iter().for_each(|i| self.people[i].up = t + h);
    }

    /// What a step meant to somebody: what was crossed, whether a leg of the journey ends, and the time that was lost.
    fn arrive(&mut self, i: usize, to: &Move, t: f64, h: f64) -> Option<Share> {
        let (p, (mut x, phi)) = (&mut self.people[i], self.before[i]);
        let legs = &self.journeys[p.crowd as usize];
        // Time taken, and distance left on the leg that the step began on.
        let (mut took, mut left) = (h, to.phi);
        p.phi = to.phi;
        let mut crossings = if to.crosses { self.tally.cross(&self.floor, x, p.x, t, h) } else { Vec::new() };
        if to.crosses
            && let Some(passage) = self.floor.plan.passage(x, p.x)
        {
            (x, p.x) = (passage.place(x), passage.arrival(x, p.x));
            (p.v, p.slide, p.heading) = (passage.direction(p.v), passage.direction(p.slide), p.heading + passage.angle());
            crossings.extend(self.tally.cross(&self.floor, x, p.x, t, h));
        }
        for (s, g, e) in crossings {
            match &legs[p.leg as usize].goal {
                Goal::Exits(exits) if exits.contains(&g) => {
                    (took, left) = (s * h, 0.0);
                    (p.out, p.starts, p.phi) = (Some(e), t, 0.0);
                    break;
                }
                Goal::Gate(goal) if *goal == g => {
                    left = (s - 1.0) * length(sub(p.x, x));
                    p.leg += 1;
                    (p.way, p.phi) = legs[p.leg as usize].shortest(&self.floor, p.x);
                }
                _ => {}
            }
        }
        if let Goal::Place(goal, radius) = legs[p.leg as usize].goal
            && length(sub(p.x, goal)) <= radius
        {
            p.leg += 1;
            (p.way, p.phi) = legs[p.leg as usize].shortest(&self.floor, p.x);
        }
        let nearer = if phi.is_finite() && left.is_finite() { phi - left } else { 0.0 };
        p.started.then(|| Share { gate: to.gate, lost: took - nearer / p.speed, waited: if p.waits() { took } else { 0.0 } })
    }

    /// Distances and ways on a plan whose gates have opened or closed.
    fn replan(&mut self) {
        for p in self.people.iter_mut().filter(|p| p.out.is_none()) {
            let before = p.phi;
            p.phi = self.floor.way(p.way).distance(p.x);
            if p.phi.is_infinite() {
                (p.way, p.phi) = self.journeys[p.crowd as usize][p.leg as usize].shortest(&self.floor, p.x);
            }
            if before.is_finite() && p.phi.is_finite() {
                self.lost += (p.phi - before) / p.speed;
            }
        }
    }

    /// Who has not left.
    pub fn present(&self) -> impl Iterator<Item = &Person> {
        self.people.iter().filter(|p| p.out.is_none())
    }

    /// How many lie on the floor and will rise, and how many are injured, where there are bodies.
    pub fn fallen(&self) -> Option<[usize; 2]> {
        self.frailty?;
        let lie = |injured: bool| self.present().filter(|p| p.lies && (p.up == f64::INFINITY) == injured).count();
        Some([lie(false), lie(true)])
    }

    /// How many are still to come.
    pub fn expected(&self) -> usize {
        self.arrivals.iter().map(|arrivals| arrivals.people.len() - arrivals.come).sum()
    }

    /// How many have no way to where they go.
    pub fn stranded(&self) -> usize {
        self.present().filter(|p| p.phi == f64::INFINITY).count()
    }

    /// The deepest overlap of two bodies, of which none lies, or of a body and a wall [m].
    pub fn deepest(&self) -> f64 {
        let (mut near, plan) = (Near::default(), &self.floor.plan);
        let range = 2.0 * self.people.iter().map(|p| p.radius).fold(0.0, f64::max);
        let images: Vec<Image> = images(&self.people, plan, range).collect();
        near.sort(range.max(0.1), self.people.iter().map(|p| p.x).chain(images.iter().map(|image| image.x)));
        let deepest = |p: &Person| {
            let other = |row: &u32| match images.get((*row as usize).wrapping_sub(self.people.len())) {
                None => self.people.get(*row as usize).map(|o| (o, o.x)),
                Some(image) => {
                    let o = &self.people[image.row as usize];
                    image.is_seen(plan, p.x, o.x).then_some((o, image.x))
                }
            };
            let others = near.runs(p.x, range).flat_map(|run| &near.order[run]).filter_map(other);
            let overlap = |(o, x): (&Person, Point)| {
                if o.id == p.id || o.lies || p.lies { 0.0 } else { p.radius + o.radius - length(sub(x, p.x)) }
            };
            others.map(overlap).fold(p.radius - plan.clearance(p.x), f64::max)
        };
        max(self.people.len(), |range| self.people[range].iter().map(deepest).fold(0.0, f64::max)).max(0.0)
    }
}
