//! Surfaces that tear, with the elements that go with their triangles.

use super::super::parts::Parts;
use super::super::tear::{Edges, ElementList, Tear};
use super::elements::Lists;
use super::objects::Objects;
use crate::math::{Real, Row};

/// The lists of elements that may have nodes in surfaces that tear.
pub struct Tied<'a> {
    /// Those of the parts.
    pub parts: &'a Parts,
    /// Their places.
    pub lists: Lists,
    /// Whether elements are constraints.
    pub projects: bool,
    /// Whether springs are clamped.
    pub clamped: bool,
    /// Batches of air over the triangles of some objects.
    pub sails: &'a [(usize, Vec<usize>)],
}

impl Tied<'_> {
    /// The surfaces that tear, with masses `mass` at x.
    pub fn tears(&self, objects: &Objects, mass: &[Real], x: &[Row]) -> Vec<Tear> {
        let Self { parts, lists, .. } = self;
        let list = |at: Option<usize>| at.map(|i| if self.projects { ElementList::Constraints(i) } else { ElementList::Batch(i) });
        let clamp = self.clamped.then_some(ElementList::Clamp);
        let one = |(index, part): &(usize, _)| {
            let own = objects.triangles(*index);
            let edges = Edges::new(&own);
            let ties = [
                edges.ties(list(lists.springs[0]), &parts.linear.members, 0, x),
                edges.ties(list(lists.springs[1]), &parts.nonlinear.members, 0, x),
                edges.ties(clamp, &parts.linear.members, 0, x),
                edges.ties(clamp, &parts.nonlinear.members, parts.linear.members.len(), x),
                edges.ties(list(lists.bending), &parts.bending, 0, x),
                edges.ties(list(lists.isometric), &parts.isometric, 0, x),
                edges.ties(list(lists.membranes), &parts.membranes, 0, x),
                edges.ties(list(lists.areas), &parts.areas, 0, x),
                edges.ties(list(lists.woven), &parts.woven, 0, x),
                edges.ties(list(lists.woven_bending), &parts.woven_bending, 0, x),
            ];
            let count = |i: &usize| objects.list[*i].triangles.len();
            let blown = self.sails.iter().filter_map(|(batch, on)| {
                let at = on.iter().position(|i| i == index)?;
                Some(edges.own(ElementList::Batch(*batch), on[..at].iter().map(count).sum()))
            });
            Tear::new(*index, &objects.list[*index], part, mass, x, ties.into_iter().flatten().chain(blown).collect())
        };
        objects.torn.iter().map(one).collect()
    }
}
