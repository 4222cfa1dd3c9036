//! Links of ropes, each rope solved as a whole. Sweeps from link to link carry a load along n links in n² of them, and a long rope stretches
//! like rubber; the multipliers of all links of a rope are the solution of one tridiagonal system:
//!
//!   (J W J^T + alpha) dlambda = -(y + alpha lambda),   dx = W J^T dlambda                     (positions.7)
//!
//! with w_i + w_i+1 + alpha_i on its diagonal and -w_i+1 n_i . n_i+1 beside it. Elimination takes time in proportion to n and needs no pivots: the
//! diagonal dominates, by a ridge where nothing gives way. Of a step that leaves more error than there was, the largest half, quarter, ... is
//! taken that does not.
//!
//! Sources: [macklin2016] (multipliers), [deul2018] (direct solutions of chains). Verified in `tests/ropes_position_based.rs`.

use super::{Columns, Constraints, LIMP, Members, Projected, Projection};
use crate::elements::{Distance, Linear};
use crate::geometry::{Vector, Walls};
use crate::math::parallel::Tasks;
use crate::math::{Real, Row, xyz64};
use std::ops::Range;

/// What stands on the diagonal in excess, relative to it: a rope that is taut between two pins has a singular system.
const RIDGE: f64 = 1e-9;
/// How often a step is halved.
const HALVES: i32 = 24;

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
    /// Its multiplier's change.
    delta: f64,
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
    /// How far links are from where they are to be, and how much they give: y and alpha.
    fn measure(&self, columns: &Columns<2, 1, 0>, x: &[Vector], step: &Projection<'_>, i: usize) -> (f64, f64) {
        let place = self.places[i];
        let rest = f64::from(columns.rest[0][place]);
        let (soft, y) = (f64::from(columns.compliance[place]), (x[i + 1] - x[i]).norm() - rest);
        let alpha = soft / (step.h * step.h);
        match (step.plain, columns.damping.get(place)) {
            (Some(_), _) => (y, if soft > 0.5 * LIMP { alpha } else { 0.0 }),
            (None, Some(damping)) => {
                let ratio = soft * f64::from(*damping) / step.h;
                let was = (xyz64(step.before[self.first + i + 1]) - xyz64(step.before[self.first + i])).norm() - rest;
                (y - ratio / (1.0 + ratio) * was, alpha / (1.0 + ratio))
            }
            _ => (y, alpha),
        }
    }

    /// Sum of the squares of what the multipliers leave, but for broken links [m²].
    fn left(&self, columns: &Columns<2, 1, 0>, x: &[Vector], step: &Projection<'_>, part: f64) -> f64 {
        let one = |i: usize| {
            let (y, alpha) = self.measure(columns, x, step, i);
            let lambda = self.lambda.get(i).copied().unwrap_or(0.0) + part * self.system[i].delta;
            if f64::from(columns.compliance[self.places[i]]) > 0.5 * LIMP { 0.0 } else { (y + alpha * lambda).powi(2) }
        };
        (0..self.places.len()).map(one).sum()
    }

    /// Solves it for its rows.
    fn solve(&mut self, columns: &Columns<2, 1, 0>, rows: &mut [Row], step: &Projection<'_>) {
        let n = self.places.len();
        let many = step.iterations > 1 && step.plain.is_none();
        if many && step.iteration == 0 {
            self.lambda.clear();
            self.lambda.resize(n, 0.0);
        }
        let x: Vec<Vector> = rows.iter().map(|row| xyz64(*row)).collect();
        let weight = |i: usize| f64::from(rows[i][3]);
        let direction = |i: usize| (x[i + 1] - x[i]).normalized();
        let mut before = Link::default();
        for i in 0..n {
            let (y, alpha) = self.measure(columns, &x, step, i);
            let own = direction(i);
            // What stands left of the diagonal is symmetric to what stands right of it in the row before.
            let left = -weight(i) * before.direction.dot(own);
            let both = weight(i) + weight(i + 1);
            let diagonal = both * (1.0 + RIDGE) + alpha - left * before.beside;
            let right = -(y + alpha * self.lambda.get(i).copied().unwrap_or(0.0)) - left * before.right;
            let next = if i + 1 < n { -weight(i + 1) * own.dot(direction(i + 1)) } else { 0.0 };
            let over = if both > 0.0 && own.norm_sq() > 0.0 { 1.0 / diagonal } else { 0.0 };
            before = Link { direction: own, beside: next * over, right: right * over, delta: 0.0 };
            self.system[i] = before;
        }
        let mut after = 0.0;
        for link in self.system.iter_mut().rev() {
            link.delta = link.right - link.beside * after;
            after = link.delta;
        }
        let pull = |i: usize| self.system.get(i).map_or(Vector::default(), |link| link.direction * link.delta);
        let moves: Vec<Vector> = (0..=n).map(|i| (if i > 0 { pull(i - 1) } else { Vector::default() } - pull(i)) * weight(i)).collect();
        let moved = |part: f64| -> Vec<Vector> { x.iter().zip(&moves).map(|(x, by)| *x + *by * part).collect() };
        // Of a step that leaves more than there was, as one far from where the system is linear, a part is taken.
        let enough = self.left(columns, &x, step, 0.0) + 1e-20 * x[0].norm_sq().max(1.0);
        let halves = (0..HALVES).map(|k| 0.5_f64.powi(k));
        let part = halves.into_iter().find(|part| self.left(columns, &moved(*part), step, *part) <= enough).unwrap_or(0.0);
        let share = part * step.plain.map_or(1.0, f64::from);
        for (row, by) in rows.iter_mut().zip(&moves) {
            let by = *by * share;
            *row = [(f64::from(row[0]) + by.x) as Real, (f64::from(row[1]) + by.y) as Real, (f64::from(row[2]) + by.z) as Real, row[3]];
        }
        if many {
            self.lambda.iter_mut().zip(&self.system).for_each(|(lambda, link)| *lambda += part * link.delta);
        }
    }
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
