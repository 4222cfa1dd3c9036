//! Objects of a system, from the drafts of the parts.

use super::super::parts::Draft;
use super::super::tear::TearPart;
use crate::state::Object;
use std::ops::Range;

/// Objects that have masses or will have some. Drafts without any are left out: the spring of an anchor is in the ledger, but in no frame.
pub struct Objects {
    /// The objects.
    pub list: Vec<Object>,
    /// Surfaces that tear, with the object of each.
    pub torn: Vec<(usize, TearPart)>,
    /// For each draft, the object made of it.
    places: Vec<usize>,
}

impl Objects {
    /// From drafts; links of each kind end at `end` and are in the lists `springs`, and points of the system end at `points`.
    pub fn new(drafts: Vec<Draft>, end: [usize; 3], springs: [Option<usize>; 3], points: usize) -> Self {
        let next: Vec<[usize; 3]> = drafts.iter().skip(1).map(|d| d.links).chain([end]).collect();
        let mut objects = Self { list: Vec::new(), torn: Vec::new(), places: Vec::new() };
        for (draft, next) in drafts.into_iter().zip(next) {
            let Draft { mut object, links, tear } = draft;
            object.frames = object.frames.start + points..object.frames.end + points;
            for kind in 0..3 {
                let range = links[kind]..next[kind];
                if let (Some(list), false) = (springs[kind], range.is_empty()) {
                    object.links.push((list, range));
                }
            }
            let place = objects.list.len();
            objects.places.push(place);
            object.closed = tear.is_none() && is_closed(&object.triangles);
            objects.torn.extend(tear.map(|part| (place, part)));
            if object.stream.is_some() {
                object.points = points..points;
            }
            if !object.points.is_empty() || object.stream.is_some() {
                objects.list.push(object);
            }
        }
        objects
    }

    /// The objects made of some drafts.
    pub fn placed(&self, drafts: &[usize]) -> Vec<usize> {
        drafts.iter().map(|i| self.places[*i]).collect()
    }

    /// Rows of points of the object made of a draft.
    pub fn points_of(&self, draft: usize) -> Range<usize> {
        self.list[self.places[draft]].points.clone()
    }

    /// Rows of points of some objects.
    pub fn rows(&self, objects: &[usize]) -> Vec<Range<usize>> {
        objects.iter().map(|i| self.list[*i].points.clone()).collect()
    }

    /// Triangles of an object over rows.
    pub fn triangles(&self, object: usize) -> Vec<[u32; 3]> {
        let first = self.list[object].points.start as u32;
        self.list[object].triangles.iter().map(|t| t.map(|i| i + first)).collect()
    }
}

/// Whether triangles enclose something: each way along an edge comes once, and so does the way back.
fn is_closed(triangles: &[[u32; 3]]) -> bool {
    let mut ways: Vec<[u32; 2]> = triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]).collect();
    ways.sort_unstable();
    let once = ways.windows(2).all(|w| w[0] != w[1]);
    once && !ways.is_empty() && ways.iter().all(|[a, b]| ways.binary_search(&[*b, *a]).is_ok())
}
