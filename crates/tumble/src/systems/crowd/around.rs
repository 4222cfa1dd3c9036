//! People, and what is around one of them: walls, others, and where it can go.

use super::plan::{Plan, Point, along, cross, dot, length, nearest, sub};
use super::touch::Touch;
use crate::math::functions::exp;

/// Somebody.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Person {
    /// Place [m].
    pub x: Point,
    /// Displacement over the last step, over its length [m/s].
    pub v: Point,
    /// Angle of the heading [rad].
    pub heading: f64,
    /// Distance left [m].
    pub phi: f64,
    /// Radius of the body [m].
    pub radius: f64,
    /// Desired speed [m/s].
    pub speed: f64,
    /// The same where it is, which may be a slope.
    pub free: f64,
    /// When it starts [s], or has left.
    pub starts: f64,
    /// Where it goes once it has left: straight on, a unit vector.
    pub out: Option<Point>,
    /// Whether it has.
    pub started: bool,
    /// Velocity by the blows of bodies [m/s].
    pub slide: Point,
    /// When it has risen from a fall [s]; never, if it is injured.
    pub up: f64,
    /// Whether it lies on the floor.
    pub lies: bool,
    /// Number, which it keeps.
    pub id: u32,
    /// Its crowd.
    pub crowd: u32,
    /// Which leg of its journey it is on.
    pub leg: u32,
    /// The way that it takes.
    pub way: u32,
}

impl Person {
    /// Whether it is on its way at t [s], on its feet.
    pub fn walks(&self, t: f64) -> bool {
        self.started && t >= self.up && self.out.is_none()
    }

    /// Whether it steps over somebody at a distance d [m], or is about to: over who lies, and where there is no way around.
    pub fn steps_over(&self, other: &Other, d: f64) -> bool {
        let waits = || self.started && length(self.v) < WAITS * self.speed;
        other.lies && !self.lies && (d < self.radius + other.radius || waits())
    }

    /// Whether it is on its way, and slow.
    pub fn waits(&self) -> bool {
        self.started && length(self.v) < WAITS * self.free
    }
}

/// Of the desired speed: who is slower waits.
pub const WAITS: f64 = 0.5;

/// Strength and decay [m] of walls in the reference direction.
const WALL: [f64; 2] = [5.0, 0.02];
/// Speed at which way is made for whoever touches [m/s].
const YIELD: f64 = 0.5;
/// Gap below which it is made [m].
const TOUCH: f64 = 0.05;
/// Rounds over all contacts of a person.
const ROUNDS: usize = 6;
/// What others need to know of somebody, sorted by cells.
#[derive(Debug, Clone, Copy, Default)]
pub struct Other {
    pub x: Point,
    pub radius: f64,
    /// Heading, a unit vector.
    pub e: Point,
    pub v: Point,
    pub phi: f64,
    /// Whether it lies on the floor.
    pub lies: bool,
    pub id: u32,
    /// Its row.
    pub row: u32,
    /// Whether it is on another floor, and seen through a link.
    pub is_beyond: bool,
}

/// Somebody near.
#[derive(Debug, Clone, Copy)]
pub struct Neighbour<'a> {
    /// From here to it [m].
    pub r: Point,
    /// Length of that [m].
    pub d: f64,
    /// Who it is.
    pub other: &'a Other,
}

/// What is around a person.
pub struct Around<'a> {
    pub me: &'a Person,
    /// Its heading, a unit vector.
    pub e: Point,
    /// Its desired speed here [m/s].
    pub speed: f64,
    pub plan: &'a Plan,
    /// Walls near it.
    pub walls: &'a [u32],
    /// Bodies near it.
    pub bodies: &'a [Touch],
    pub others: &'a [Neighbour<'a>],
}

impl Around<'_> {
    /// Whether no wall is between here and another.
    pub fn sees(&self, Neighbour { r, other, .. }: &Neighbour<'_>) -> bool {
        other.is_beyond || self.walls.is_empty() || self.plan.sees(self.walls, self.me.x, along(self.me.x, 1.0, *r))
    }

    /// From here to the nearest place of each wall and body near [m], and its length.
    ///
    /// A gate that closes on somebody is no wall to it.
    pub fn to_walls(&self) -> impl Iterator<Item = (Point, f64)> {
        let far = |w: &u32| {
            let d = sub(nearest(self.plan.walls[*w as usize], self.me.x), self.me.x);
            (*w as usize, d, length(d))
        };
        let is_wall = |(w, _, far): &(usize, Point, f64)| *w < self.plan.solid || *far >= self.me.radius;
        let walls = self.walls.iter().map(far).filter(is_wall).map(|(_, d, far)| (d, far));
        walls.chain(self.bodies.iter().filter_map(|body| body.wall(self.me.radius)))
    }

    /// Desired direction, bent by walls.                                                             (crowds.2)
    pub fn reference(&self, wanted: Point) -> Point {
        let mut e = wanted;
        for (d, far) in self.to_walls() {
            // Beyond twenty decay lengths nothing is left of it.
            if far > 0.0 && far < self.me.radius + 20.0 * WALL[1] {
                e = along(e, -WALL[0] * exp((self.me.radius - far) / WALL[1]) / far, d);
            }
        }
        let size = length(e);
        if size > 1e-9 { e.map(|e| e / size) } else { self.e }
    }

    /// Room ahead in a direction [m].                                                                 (crowds.4)
    pub fn room(&self, e: Point) -> f64 {
        let mut room = f64::INFINITY;
        for them @ Neighbour { r, d, other } in self.others {
            let reach = self.me.radius + other.radius;
            let ahead = dot(e, *r);
            let gap = d - reach;
            if ahead > 0.0 && cross(e, *r).abs() <= reach && gap < room && !self.goes_first(*r, other) && self.sees(them) {
                room = gap;
            }
        }
        room
    }

    /// Of two who are in each other's way, the one with less way left goes first.
    pub fn goes_first(&self, r: Point, other: &Other) -> bool {
        dot(other.e, r) < 0.0 && (self.me.phi, self.me.id) < (other.phi, other.id)
    }

    /// Way made for those who go first and touch: away from them.                                     (crowds.6)
    pub fn makes_way(&self) -> Point {
        let mut v = [0.0; 2];
        for Neighbour { r, d, other } in self.others {
            let gap = d - self.me.radius - other.radius;
            if gap < TOUCH && *d > 0.0 && (other.phi, other.id) < (self.me.phi, self.me.id) {
                v = along(v, -YIELD * (1.0 - gap / TOUCH) / d, *r);
            }
        }
        v
    }

    /// How free the way in a direction is of people who go first: 0 where one touches, 1 where none is so near that way is made for it.
    pub fn freedom(&self, e: Point) -> f64 {
        let mut least = 1.0_f64;
        for Neighbour { r, d, other } in self.others {
            let gap = d - self.me.radius - other.radius;
            if gap < TOUCH && dot(e, *r) > 0.0 && (other.phi, other.id) < (self.me.phi, self.me.id) {
                least = least.min((gap / TOUCH).max(0.0));
            }
        }
        least
    }

    /// The part of a displacement that leads into nobody and no wall: of the gap to another each takes half.      (crowds.5)
    ///
    /// Bodies give way by `soft`, a part of their radius.
    pub fn feasible(&self, mut u: Point, soft: f64, planes: &mut Vec<(Point, f64)>) -> Point {
        let most = length(u);
        planes.clear();
        for (d, far) in self.to_walls() {
            if far > 0.0 && far < self.me.radius + most {
                planes.push((d.map(|d| d / far), (far - self.me.radius).max(0.0)));
            }
        }
        for Neighbour { r, d, other } in self.others {
            let gap = (d - (1.0 - soft) * (self.me.radius + other.radius)).max(0.0);
            if *d > 0.0 && 0.5 * gap < most {
                planes.push((r.map(|r| r / d), 0.5 * gap));
            }
        }
        for _ in 0..ROUNDS {
            let mut held = false;
            for (n, room) in &*planes {
                let over = dot(u, *n) - room;
                if over > 0.0 {
                    (u, held) = (along(u, -over, *n), true);
                }
            }
            if !held {
                return u;
            }
        }
        // What is left over in the last round shortens the step.
        let share = |(n, room): &(Point, f64)| if dot(u, *n) > *room { (room / dot(u, *n)).max(0.0) } else { 1.0 };
        let s = planes.iter().map(share).fold(1.0, f64::min);
        u.map(|u| s * u)
    }
}
