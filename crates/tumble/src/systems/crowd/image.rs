//! Images of people across links: how those beyond a line see them.

use super::around::Person;
use super::link::Passage;
use super::plan::{Plan, Point, along, crossing, length, nearest, sub};

/// Somebody near a line of a link, as seen from beyond the other.
#[derive(Debug)]
pub struct Image {
    /// The row of whom.
    pub row: u32,
    pub passage: Passage,
    /// Where it seems to be.
    pub x: Point,
}

/// Images of all who are so near a line of a link [m].
pub fn images(people: &[Person], plan: &Plan, reach: f64) -> impl Iterator<Item = Image> {
    let linked = if plan.passages().is_empty() { &[] } else { people };
    linked.iter().enumerate().flat_map(move |(row, p)| {
        let near = plan.passages_near(p.x).filter(move |passage| length(sub(p.x, nearest(passage.from, p.x))) < reach);
        near.map(move |passage| Image { row: row as u32, passage: *passage, x: passage.place(p.x) })
    })
}

impl Image {
    /// Whether it is seen from a place: through the line, and past the walls of both floors, of somebody at x.
    pub fn is_seen(&self, plan: &Plan, from: Point, x: Point) -> bool {
        let Some((s, _)) = crossing(self.passage.to, from, self.x) else { return false };
        let through = along(from, s, sub(self.x, from));
        plan.sees(plan.near(from), from, through) && plan.sees(plan.near(x), self.passage.before(through), x)
    }
}
