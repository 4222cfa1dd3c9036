//! Places for people at the start: on a triangular lattice as wide as it can be, each moved at random as far as it may be.

use super::floor::Floor;
use super::near::Near;
use super::plan::{Point, along, inside, length, sub};
use crate::math::Random;
use crate::math::functions::{cos, sin};

/// Why people have no place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Misfit {
    /// From no place of the area there is a way to an exit.
    NoWay,
    /// So many fit at most.
    Most(usize),
}

/// An area, and who is to be there.
pub struct Room<'a> {
    /// Its corners.
    pub polygon: &'a [Point],
    /// How many.
    pub count: usize,
    /// The largest radius of their bodies [m].
    pub radius: f64,
    /// The ways that they may take.
    pub ways: &'a [u32],
}

/// By how much the lattice shrinks from try to try.
const SHRINK: f64 = 0.97;
/// Room between bodies on the densest lattice, over their diameter.
const ROOM: f64 = 1.001;
/// Purposes of random numbers.
const CHOICE: u32 = 0;
const SHIFT: u32 = 1;

impl Room<'_> {
    /// Places for all, away from walls and from those who are `there` with their radii; each has a way to an exit.
    pub fn places(&self, floor: &Floor, random: &Random, there: &[(Point, f64)]) -> Result<Vec<Point>, Misfit> {
        let bound = |a: usize, f: fn(f64, f64) -> f64| self.polygon.iter().map(|p| p[a]).reduce(f).unwrap_or(0.0);
        let (low, high) = ([bound(0, f64::min), bound(1, f64::min)], [bound(0, f64::max), bound(1, f64::max)]);
        let box_ = (high[0] - low[0]) * (high[1] - low[1]);
        let least = 2.0 * self.radius * ROOM;
        let mut near = Near::default();
        near.sort(1.0, there.iter().map(|(x, _)| *x));
        let most = there.iter().map(|(_, r)| *r).fold(0.0, f64::max);
        let free = |x: Point, extra: f64| {
            let apart = |row: &u32| {
                let (y, r) = there[*row as usize];
                length(sub(x, y)) >= r + self.radius + extra
            };
            inside(self.polygon, x)
                && floor.plan.clearance(x) >= self.radius
                && self.has_way(floor, x)
                && near.runs(x, most + self.radius + extra).all(|run| near.order[run].iter().all(apart))
        };
        let mut spacing = (box_ / self.count as f64 / 0.866).sqrt().max(least);
        loop {
            let sites: Vec<Point> = lattice(low, high, spacing).filter(|x| free(*x, 0.0)).collect();
            if sites.len() >= self.count {
                return Ok(self.moved(sites, 0.5 * (spacing - least), random, free));
            }
            if spacing <= least {
                return Err(if sites.is_empty() && self.is_cut_off(floor, low, high) { Misfit::NoWay } else { Misfit::Most(sites.len()) });
            }
            spacing = (SHRINK * spacing).max(least);
        }
    }

    /// As many sites as there are people, chosen at random, each moved by up to `far`.
    fn moved(&self, sites: Vec<Point>, far: f64, random: &Random, free: impl Fn(Point, f64) -> bool) -> Vec<Point> {
        let mut order: Vec<usize> = (0..sites.len()).collect();
        order.sort_by_key(|i| (random.words(*i as u64, 0, CHOICE)[0], *i));
        order.truncate(self.count);
        let moved = |i: usize| {
            let [u, w, ..] = random.uniform(i as u64, 0, SHIFT);
            let angle = std::f64::consts::TAU * u;
            let x = along(sites[i], far * w.sqrt(), [cos(angle), sin(angle)]);
            // Two sites that both move stay apart; somebody of another crowd stays where it is.
            if free(x, 0.0) { x } else { sites[i] }
        };
        order.into_iter().map(moved).collect()
    }

    /// Whether there is a way from a place.
    fn has_way(&self, floor: &Floor, x: Point) -> bool {
        self.ways.iter().any(|way| floor.way(*way).distance(x).is_finite())
    }

    /// Whether bodies fit somewhere in the area, but nowhere with a way.
    fn is_cut_off(&self, floor: &Floor, low: Point, high: Point) -> bool {
        let step = (0.5 * self.radius).max(((high[0] - low[0]) * (high[1] - low[1])).sqrt() / 300.0);
        let mut fit = lattice(low, high, step).filter(|x| inside(self.polygon, *x) && floor.plan.clearance(*x) >= self.radius);
        let first = fit.next();
        first.is_some() && first.into_iter().chain(fit).all(|x| !self.has_way(floor, x))
    }
}

/// Whether each disk, a place and a radius, overlaps an earlier one.
pub fn overlapping(disks: &[(Point, f64)]) -> Vec<bool> {
    let most = disks.iter().map(|(_, r)| *r).fold(0.0, f64::max);
    let mut near = Near::default();
    near.sort(1.0, disks.iter().map(|(x, _)| *x));
    let overlaps = |(i, (x, r)): (usize, &(Point, f64))| {
        let meets = |row: &u32| {
            let (y, other) = disks[*row as usize];
            (*row as usize) < i && length(sub(*x, y)) < r + other
        };
        near.runs(*x, r + most).any(|run| near.order[run].iter().any(meets))
    };
    disks.iter().enumerate().map(overlaps).collect()
}

/// A triangular lattice over a box.
fn lattice(low: Point, high: Point, spacing: f64) -> impl Iterator<Item = Point> {
    let rows = ((high[1] - low[1]) / (0.8660254037844386 * spacing)).floor() as usize + 1;
    let columns = ((high[0] - low[0]) / spacing).floor() as usize + 1;
    // In the middle of the box.
    let rest = [high[0] - low[0] - (columns - 1) as f64 * spacing, high[1] - low[1] - (rows - 1) as f64 * 0.8660254037844386 * spacing];
    (0..rows).flat_map(move |j| {
        (0..columns).map(move |i| {
            let shift = if j % 2 == 0 { 0.0 } else { 0.5 * spacing };
            [low[0] + 0.5 * rest[0] + i as f64 * spacing + shift, low[1] + 0.5 * rest[1] + j as f64 * 0.8660254037844386 * spacing]
        })
    })
}
