//! A body near a person, as the person meets it.

use super::plan::{Point, length};
use crate::geometry::Vector;

/// The least horizontal part of a normal at which a body is ahead, and not overhead.
const AHEAD: f64 = 0.3;
/// Who overlaps with a body gets out by this in a step at most [m].
const OUT: f64 = 0.05;

/// A body near a person.
#[derive(Debug, Clone, Copy)]
pub struct Touch {
    /// Row of the person.
    pub row: u32,
    /// The body.
    pub body: u32,
    /// Unit vector from the body to the person.
    pub n: Vector,
    /// Distance between their surfaces [m].
    pub gap: f64,
    /// The place on the body.
    pub at: Vector,
}

impl Touch {
    /// The horizontal direction to the person, unless the body is overhead.
    pub fn ahead(&self) -> Option<Point> {
        let size = length([self.n.x, self.n.y]);
        (size > AHEAD).then(|| [self.n.x / size, self.n.y / size])
    }

    /// From a person of this radius to the nearest place of the body in plan, and its length [m].
    pub fn wall(&self, radius: f64) -> Option<(Point, f64)> {
        let far = self.gap + radius;
        self.ahead().map(|n| (n.map(|n| -n * far), far))
    }

    /// The way out of the body [m].
    pub fn out(&self) -> Point {
        self.ahead().map_or([0.0; 2], |n| n.map(|n| n * (-self.gap).clamp(0.0, OUT)))
    }
}
