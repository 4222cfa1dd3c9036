//! Links of ropes, each rope solved as a whole. Sweeps from link to link carry a load along n links in n² of them, and a long rope stretches
//! like rubber; the multipliers of all links of a rope are the solution of one tridiagonal system:
//!
//!   (J W J^T + alpha) dlambda = -(y + alpha lambda),   dx = W J^T dlambda                     (positions.7)
//!
//! with w_i + w_i+1 + alpha_i on its diagonal and -w_i+1 n_i . n_i+1 beside it. Elimination takes time in proportion to n and needs no pivots: the
//! diagonal dominates.
//!
//! Sources: [macklin2016] (multipliers), [deul2018] (direct solutions of chains). Verified in `tests/ropes_position_based.rs`.

use super::{Columns, Constraints, LIMP, Members, Projected, Projection};
use crate::elements::{Distance, Linear};
use crate::geometry::{Vector, Walls};
use crate::math::parallel::Tasks;
use crate::math::{Real, Row, xyz64};
use std::ops::Range;

type Links = Projected<Distance, Linear, 2, 1, 1, 0>;

/// Linear links, some of which are chains.
pub struct Chains {
    links: Links,
    chains: Vec<Chain>,
}

/// Links between rows that follow each other.
struct Chain {
    first: usize,
    /// Where its links stand in the columns.
    places: Vec<usize>,
    lambda: Vec<f64>,
    /// Of each link, in a sweep.
    system: Vec<Link>,
}

/// A link's row of the system.
#[derive(Clone, Copy, Default)]
struct Link {
    direction: Vector,
    /// Reduced: what stands to the right of the diagonal, and on the right side, over the diagonal.
    beside: f64,
    right: f64,
}

impl Chains {
    /// Of these members, those of each range are a chain; `None` if a node is not one of the rows.
    pub fn new(rows: usize, members: &[Members<2, 1, 0>], limits: &[f64], ranges: &[Range<usize>]) -> Option<Self> {
        let mut alone = vec![true; members.len()];
        ranges.iter().cloned().flatten().for_each(|e| alone[e] = false);
        let columns = Columns::of(rows, rows, &[], members, |e| alone[e])?;
        let places = columns.places();
        let chain = |range: &Range<usize>| Chain {
            first: members[range.start].nodes[0] as usize,
            places: range.clone().map(|e| places[e]).collect(),
            lambda: Vec::new(),
            system: vec![Link::default(); range.len()],
        };
        let mut chains: Vec<Chain> = ranges.iter().filter(|range| !range.is_empty()).map(chain).collect();
        chains.sort_by_key(|chain| chain.first);
        Some(Self { chains, links: Links::with(columns, limits) })
    }
}

impl Chain {
    /// Solves it for its rows, and those at the start of the sub-step.
    fn solve(&mut self, columns: &Columns<2, 1, 0>, x: &mut [Row], step: &Projection<'_>) {
        let n = self.places.len();
        let many = step.iterations > 1 && step.plain.is_none();
        if many && step.iteration == 0 {
            self.lambda.clear();
            self.lambda.resize(n, 0.0);
        }
        let weight = |x: &[Row], i: usize| f64::from(x[i][3]);
        let mut before = Link::default();
        for (i, place) in self.places.iter().enumerate() {
            let way = xyz64(x[i + 1]) - xyz64(x[i]);
            let (length, rest) = (way.norm(), f64::from(columns.rest[0][*place]));
            let direction = if length > 0.0 { way * (1.0 / length) } else { Vector::default() };
            let soft = f64::from(columns.compliance[*place]);
            let (mut alpha, mut y) = (soft / (step.h * step.h), length - rest);
            match (step.plain, columns.damping.get(*place)) {
                (Some(_), _) => alpha = if soft > 0.5 * LIMP { alpha } else { 0.0 },
                (None, Some(damping)) => {
                    let ratio = soft * f64::from(*damping) / step.h;
                    let was = (xyz64(step.before[self.first + i + 1]) - xyz64(step.before[self.first + i])).norm() - rest;
                    (alpha, y) = (alpha / (1.0 + ratio), y - ratio / (1.0 + ratio) * was);
                }
                _ => {}
            }
            // What stands left of the diagonal is symmetric to what stands right of it in the row before.
            let left = -weight(x, i) * before.direction.dot(direction);
            let diagonal = weight(x, i) + weight(x, i + 1) + alpha - left * before.beside;
            let right = -(y + alpha * self.lambda.get(i).copied().unwrap_or(0.0)) - left * before.right;
            let next = self.places.get(i + 1).map_or(0.0, |_| {
                let way = xyz64(x[i + 2]) - xyz64(x[i + 1]);
                let length = way.norm();
                if length > 0.0 { -weight(x, i + 1) * direction.dot(way) / length } else { 0.0 }
            });
            let over = if diagonal > 0.0 { 1.0 / diagonal } else { 0.0 };
            before = Link { direction, beside: next * over, right: right * over };
            self.system[i] = before;
        }
        let (mut after, mut pull) = (0.0, Vector::default());
        let part = step.plain.map_or(1.0, f64::from);
        for i in (0..n).rev() {
            let link = self.system[i];
            let delta = link.right - link.beside * after;
            if many {
                self.lambda[i] += delta;
            }
            // On the point between this link and the next.
            let force = link.direction * delta;
            move_by(&mut x[i + 1], (force - pull) * part);
            (after, pull) = (delta, force);
        }
        move_by(&mut x[0], -pull * part);
    }
}

/// Moves a point by its inverse mass times this.
fn move_by(x: &mut Row, by: Vector) {
    let by = by * f64::from(x[3]);
    *x = [(f64::from(x[0]) + by.x) as Real, (f64::from(x[1]) + by.y) as Real, (f64::from(x[2]) + by.z) as Real, x[3]];
}

impl Constraints for Chains {
    fn project(&mut self, x: &mut [Row], step: &Projection<'_>) {
        self.links.project(x, step);
        let columns = &self.links.columns;
        let (mut left, mut start) = (x, 0);
        let mut own = Vec::with_capacity(self.chains.len());
        for chain in &mut self.chains {
            let (_, rest) = std::mem::take(&mut left).split_at_mut(chain.first - start);
            let (rows, rest) = rest.split_at_mut(chain.places.len() + 1);
            (left, start) = (rest, chain.first + rows.len());
            own.push((chain, rows));
        }
        own.into_iter().in_parallel(|(chain, rows)| chain.solve(columns, rows, step));
    }

    fn name(&self) -> &'static str {
        self.links.name()
    }

    fn len(&self) -> usize {
        self.links.len()
    }

    fn connect(&self, join: &mut dyn FnMut(u32, u32)) {
        self.links.connect(join);
    }

    fn energy(&self, x: &[Row], walls: Walls<'_>) -> f64 {
        self.links.energy(x, walls)
    }

    fn add_grip(&self, x: &[Row], grip: &mut [Real]) {
        self.links.add_grip(x, grip);
    }

    fn link_strain(&self, x: &[Row]) -> Vec<Real> {
        self.links.link_strain(x)
    }

    fn link_ends(&self) -> Vec<[u32; 2]> {
        self.links.link_ends()
    }

    fn largest_strain(&self, x: &[Row]) -> f64 {
        self.links.largest_strain(x)
    }

    fn most_strained(&self, x: &[Row]) -> Option<(f64, [u32; 2])> {
        self.links.most_strained(x)
    }

    fn break_links(&mut self, x: &[Row]) -> u64 {
        self.links.break_links(x)
    }

    fn broken(&self) -> Vec<u32> {
        self.links.broken()
    }

    fn break_elements(&mut self, elements: &[u32]) {
        self.links.break_elements(elements);
    }

    fn set_broken(&mut self, broken: &[u32]) {
        self.links.set_broken(broken);
    }
}
