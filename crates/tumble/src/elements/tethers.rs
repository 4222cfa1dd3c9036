//! Tethers: what hangs from held points stays within reach of them, whatever the sweeps have left undone. Each point is tied to the nearest
//! point of some groups of held ones, by the length of the shortest way along links and edges, and is pulled back when it is farther away.
//!
//!   x = p + (x - p) min(1, s l/|x - p|)                                (positions.3)
//!
//! Source: [kim2012]. Differs: held points that are linked to each other are one group, of which only the nearest ties a point.

use crate::math::parallel::{CHUNK, Tasks};
use crate::math::simd::{Index, Kernel, Width, dispatch, packs};
use crate::math::{Lane, Real, Row, Vec3};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

/// Groups that tie a point at most.
const GROUPS: usize = 4;

/// Tethers of a run of rows.
pub struct Tethers {
    rows: Range<usize>,
    /// Rows of the held points.
    held: Vec<u32>,
    /// For each of some groups, which of them every row is tied to, and the length of the tether [m], infinite where there is none.
    groups: Vec<(Index, Vec<Real>)>,
}

/// A distance from a group, smallest first.
#[derive(PartialEq)]
struct Reached(f64, u32);

impl Eq for Reached {}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0).then(self.1.cmp(&other.1))
    }
}

impl Tethers {
    /// Tethers of the points of a run of rows with these links, as ends and rest lengths [m]: `slack` times the shortest way to what `held`
    /// says. `None` if nothing is held, or nothing else is.
    pub fn new(rows: Range<usize>, links: &[([u32; 2], f64)], held: &dyn Fn(usize) -> bool, slack: f64) -> Option<Self> {
        let n = rows.len();
        let mut start = vec![0_u32; n + 1];
        let inside = |i: u32| (i as usize).checked_sub(rows.start).filter(|i| *i < n);
        let own: Vec<(usize, usize, f64)> = links.iter().filter_map(|([a, b], l)| Some((inside(*a)?, inside(*b)?, *l))).collect();
        own.iter().for_each(|(a, b, _)| {
            start[a + 1] += 1;
            start[b + 1] += 1;
        });
        (0..n).for_each(|i| start[i + 1] += start[i]);
        let (mut next, mut near) = (start.clone(), vec![(0_u32, 0.0); start[n] as usize]);
        for (a, b, l) in &own {
            for (i, j) in [(a, b), (b, a)] {
                near[next[*i] as usize] = (*j as u32, *l);
                next[*i] += 1;
            }
        }
        let around = |i: usize| &near[start[i] as usize..start[i + 1] as usize];
        let is_held = |i: usize| held(rows.start + i);
        let mut group = vec![u32::MAX; n];
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for first in (0..n).filter(|i| is_held(*i)) {
            if group[first] != u32::MAX {
                continue;
            }
            let (mut members, mut done) = (vec![first], 0);
            group[first] = groups.len() as u32;
            while done < members.len() {
                for (j, _) in around(members[done]) {
                    if is_held(*j as usize) && group[*j as usize] == u32::MAX {
                        group[*j as usize] = groups.len() as u32;
                        members.push(*j as usize);
                    }
                }
                done += 1;
            }
            groups.push(members);
        }
        // The nearest groups of every point, as (distance, held point).
        let mut best: Vec<Vec<(f64, u32)>> = vec![Vec::new(); n];
        for members in &groups {
            let mut distance = vec![f64::INFINITY; n];
            let mut from = vec![0_u32; n];
            let mut heap = BinaryHeap::new();
            for i in members {
                (distance[*i], from[*i]) = (0.0, *i as u32);
                heap.push(Reverse(Reached(0.0, *i as u32)));
            }
            while let Some(Reverse(Reached(d, i))) = heap.pop() {
                if d > distance[i as usize] {
                    continue;
                }
                for (j, l) in around(i as usize) {
                    let way = d + l;
                    if way < distance[*j as usize] {
                        (distance[*j as usize], from[*j as usize]) = (way, from[i as usize]);
                        heap.push(Reverse(Reached(way, *j)));
                    }
                }
            }
            for i in (0..n).filter(|i| distance[*i].is_finite() && !is_held(*i)) {
                let list = &mut best[i];
                let at = list.partition_point(|(d, _)| *d <= distance[i]);
                list.insert(at, (distance[i], from[i]));
                list.truncate(GROUPS);
            }
        }
        let most = best.iter().map(Vec::len).max().filter(|most| *most > 0)?;
        let held: Vec<u32> = (0..n).filter(|i| is_held(*i)).map(|i| (rows.start + i) as u32).collect();
        let which = |from: u32| held.partition_point(|row| *row < from + rows.start as u32) as u32;
        let of = |k: usize| {
            let pin = |i: usize| best[i].get(k).map_or(0, |(_, from)| which(*from));
            let length = |i: usize| best[i].get(k).map_or(Real::INFINITY, |(d, _)| (slack * d) as Real);
            Some((Index::new((0..n).map(pin).collect(), held.len())?, (0..n).map(length).collect()))
        };
        let groups = (0..most).map(of).collect::<Option<Vec<_>>>()?;
        Some(Self { rows, held, groups })
    }

    /// Pulls every point back to the length of its tethers.
    pub fn project(&self, x: &mut [Row]) {
        let held: Vec<Row> = self.held.iter().map(|i| x[*i as usize]).collect();
        x[self.rows.clone()].chunks_mut(CHUNK).enumerate().in_parallel(|(c, x)| {
            dispatch(Pull { groups: &self.groups, start: c * CHUNK, held: &held, x });
        });
    }
}

struct Pull<'a> {
    groups: &'a [(Index, Vec<Real>)],
    /// Of the first point.
    start: usize,
    held: &'a [Row],
    x: &'a mut [Row],
}

impl Kernel for Pull<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        packs!(W, w, (0..self.x.len()), |i| {
            let [mut x, mut y, mut z, q] = w.rows(self.x, i);
            for (index, length) in self.groups {
                // SAFETY: the index was made for as many rows as are held.
                let [px, py, pz, _] = unsafe { w.gather_at(self.held.as_ptr(), &index.get()[self.start + i..]) };
                let d = Vec3 { x: x - px, y: y - py, z: z - pz };
                let (size, most) = (d.norm(), w.load(&length[self.start + i..]));
                let back = (size - most).positive((size - most) / size, w.splat(0.0));
                // Held points stay.
                let back = q.positive(back, w.splat(0.0));
                (x, y, z) = (x - d.x * back, y - d.y * back, z - d.z * back);
            }
            w.scatter([x, y, z, q], self.x, i, 1);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_tied_to_what_is_held_by_the_shortest_way() {
        // A line of five links, held at both ends, with a loose end at 4; slack 1.
        let links: Vec<([u32; 2], f64)> = (0..4).map(|i| ([i, i + 1], 1.0)).collect();
        let tethers = Tethers::new(0..5, &links, &|i| i == 0, 1.0).unwrap();
        let mut x: Vec<Row> = (0..5).map(|i| [2.0 * i as Real, 0.0, 0.0, if i == 0 { 0.0 } else { 1.0 }]).collect();
        tethers.project(&mut x);
        assert_eq!(x.iter().map(|x| x[0]).collect::<Vec<_>>(), [0.0, 1.0, 2.0, 3.0, 4.0]);
        let before = x.clone();
        tethers.project(&mut x);
        assert_eq!(x, before);
        assert!(Tethers::new(0..5, &links, &|_| false, 1.0).is_none());
        // Two groups: each point is as near to each as the way to it is long.
        let both = Tethers::new(0..5, &links, &|i| i == 0 || i == 4, 1.0).unwrap();
        assert_eq!(both.groups.len(), 2);
        assert_eq!((both.groups[0].1[1], both.groups[1].1[1]), (1.0, 3.0));
        // The nearest pulls first, the other last.
        let mut x: Vec<Row> = (0..5).map(|i| [2.0 * i as Real, 0.0, 0.0, if i % 4 == 0 { 0.0 } else { 1.0 }]).collect();
        both.project(&mut x);
        assert_eq!(x.iter().map(|x| x[0]).collect::<Vec<_>>(), [0.0, 5.0, 6.0, 3.0, 8.0]);
    }
}
