//! State and laws of a system of masses, on which schemes and features act.

use super::body_contact::{self, Body};
use super::contact::{Found, Pass, Response, Step};
use super::feature::Span;
use super::laws::Laws;
use super::scale::Scale;
use crate::elements::{Constraints, Density, Limit, Linear, Projected};
use crate::geometry::{Collider, Vector};
use crate::integrators::Memory;
use crate::math::parallel::{CHUNK, Tasks, chunks2};
use crate::math::{Real, Row, Vec3, ZERO, axpy, row};
use crate::pool::Pool;
use crate::state::{Object, State};
use std::ops::Range;
use tumble_interface::scene::Integrator;

/// Rows of masses that do not feel each other which are stepped together: 24 KB in single precision, with accelerations.
pub const BLOCK: usize = 512;

/// Springs longer than a multiple of their rest length, which are shortened to it.
pub type Clamp = Projected<Limit, Linear, 2, 1, 1, 0>;

/// A force between masses of some objects.
pub struct Between {
    /// Its batch.
    pub batch: usize,
    /// The objects on which it acts.
    pub objects: Vec<usize>,
    /// Other objects that it names.
    pub others: Option<Vec<usize>>,
}

/// Masses, the laws between them, and the memory of their integrator.
pub struct Core {
    /// Name of the system in the scene.
    pub name: String,
    /// Scheme, as the scene names it.
    pub integrator: Integrator,
    /// Positions and velocities.
    pub state: State,
    /// Forces.
    pub laws: Laws,
    /// Elements that are no forces but constraints.
    pub constraints: Vec<Box<dyn Constraints>>,
    /// Limit of the length of springs.
    pub clamp: Option<Clamp>,
    /// Rows and topology of every object.
    pub objects: Vec<Object>,
    /// Particles that are born and die; their rows are the last.
    pub pool: Pool,
    /// Forces between masses of some objects.
    pub between: Vec<Between>,
    /// Columns that the integrator keeps from step to step.
    pub memory: Memory,
    /// Positions and velocities at the start of a sub-step, for contact.
    pub before: Vec<Row>,
    pub before_v: Vec<Row>,
    /// Whether bodies of other systems are there to be touched.
    pub visits: bool,
    /// Impulses of liquids on every solid in the last contact pass [N s].
    pub pushes: Vec<Vector>,
    /// Scale of the energy.
    pub scale: Scale,
    /// Links and vertices broken so far.
    pub broken: u64,
    /// How often another state has been read, or something has been held or let go, so that what is free is found anew.
    pub regrouped: u64,
}

impl Core {
    /// Speed that gravity gives in two steps: slower impacts do not bounce.
    pub fn resting_speed(&self, h: f64) -> f64 {
        2.0 * h * self.laws.gravity.largest
    }

    /// The energies up to which elements and forces that drive may bring the masses [J].
    pub fn drives(&self) -> impl Iterator<Item = f64> {
        self.laws.batches.iter().filter_map(|b| b.drives()).chain(self.constraints.iter().filter_map(|c| c.drives()))
    }

    /// Its liquids.
    pub fn liquids(&self) -> impl Iterator<Item = &Density> {
        self.constraints.iter().filter_map(|c| c.liquid())
    }

    /// Whether no mass feels another.
    pub fn is_local(&self) -> bool {
        self.laws.is_local() && self.constraints.is_empty() && self.clamp.is_none()
    }

    /// Kicks a mass with an impulse [N s].
    pub fn kick(&mut self, i: usize, impulse: Vec3<f64>) {
        let w = f64::from(self.laws.masses.inverse(i, &self.state.x));
        let dv = impulse * w;
        self.state.v[i] = axpy(self.state.v[i], 1.0, row(Vec3 { x: dv.x as Real, y: dv.y as Real, z: dv.z as Real }, 0.0));
        self.memory.ready = false;
    }

    /// Adds the impulse of a constant force over the next interval [N s].
    pub fn push_steadily(&mut self, row: usize, impulse: Vector) {
        let steady = &mut self.laws.steady;
        match steady.binary_search_by_key(&row, |(row, _)| *row) {
            Ok(at) => steady[at].1 = steady[at].1 + impulse,
            Err(at) => steady.insert(at, (row, impulse)),
        }
        self.memory.ready = false;
    }

    /// The normal of the nearest solid that a point leans on, zero if there is none.
    pub fn contact_normal(&self, x: Vector, t: f64) -> Vector {
        let gap = |collider: &Collider| {
            let thick = collider.thickness;
            let (distance, normal) = collider.distance(x, t, 2.0 * thick);
            (distance <= thick * (1.0 + 1e-3)).then_some((distance - thick, normal))
        };
        let nearest = self.laws.colliders.iter().filter_map(gap).reduce(|a, b| if b.0 < a.0 { b } else { a });
        nearest.map_or(Vector::default(), |(_, normal)| normal)
    }

    /// Accelerations at time t [m/s²]; none where a user's force fails, which the next step reports.
    pub fn accelerations(&mut self, t: f64) -> Vec<Row> {
        let mut out = vec![ZERO; self.state.x.len()];
        let done = self.laws.rate(t, &self.state.x, &self.state.v, &mut out);
        done.map_or(Vec::new(), |()| out)
    }

    /// Whether there is a solid to touch.
    pub fn meets_solids(&self) -> bool {
        self.visits || !self.laws.colliders.is_empty()
    }

    /// Keeps the positions at the start of a sub-step.
    pub fn keep_positions(&mut self) {
        self.before.resize(self.state.x.len(), ZERO);
        self.before.copy_from_slice(&self.state.x);
    }

    /// Keeps the velocities at the start of a sub-step, if contact will ask for them.
    pub fn keep_velocities(&mut self) {
        if self.meets_solids() {
            self.before_v.resize(self.state.x.len(), ZERO);
            self.before_v.copy_from_slice(&self.state.v);
        }
    }

    /// The contact pass after a sub-step.
    pub fn resolve_contact(&mut self, Span { t, h }: Span, Response { lead, penalty, plain }: Response) {
        if self.laws.colliders.is_empty() {
            return;
        }
        let observed = self.pool.heeded();
        let step = Step { t, h, resting: self.resting_speed(h), lead, observed: false };
        let bodies = self.resolve_body_contact(&step, plain);
        let liquids: Vec<Range<usize>> = self.liquids().map(Density::rows).collect();
        let pass = Pass { colliders: &self.laws.colliders, step, penalty, observed: &observed, counted: &liquids };
        self.pushes.clear();
        self.pushes.resize(self.laws.colliders.len(), Vector::default());
        for points in self.laws.masses.points().flat_map(|points| without(points, &bodies)) {
            let (before, before_v) = (&self.before[points.clone()], &self.before_v[points.clone()]);
            let chunks = self.state.x[points.clone()].chunks_mut(CHUNK).zip(self.state.v[points.clone()].chunks_mut(CHUNK));
            let chunks = chunks.zip(before.chunks(CHUNK).zip(before_v.chunks(CHUNK))).enumerate();
            let all: Vec<Found> = chunks.map_in_parallel(|(c, ((x, v), (before, before_v)))| {
                let mut found = Found::default();
                pass.rows(points.start + c * CHUNK, [before, before_v], x, v, &mut found);
                found
            });
            for Found { touched, hits, pushes, .. } in all {
                self.memory.ready &= !touched;
                hits.into_iter().for_each(|(row, hit)| self.pool.note_row(row, hit));
                self.pushes.iter_mut().zip(pushes).for_each(|(sum, push)| *sum = *sum + push);
            }
        }
    }

    /// The contact of bodies whose shape is matched; returns their rows, in order.
    fn resolve_body_contact(&mut self, step: &Step, plain: Option<f64>) -> Vec<Range<usize>> {
        let mut bodies: Vec<(Range<usize>, f64)> = self.constraints.iter().filter_map(|c| c.matched(step.h, plain)).collect();
        bodies.sort_by_key(|(rows, _)| rows.start);
        let Self { state: State { x, v }, before, before_v, laws, .. } = self;
        let changes = bodies.iter().map_in_parallel(|(rows, share)| {
            let rows = rows.clone();
            let before = [&before[rows.clone()], &before_v[rows.clone()]];
            let body = Body { mass: &laws.masses.mass[rows.clone()], before, x: &x[rows.clone()], v: &v[rows], share: *share };
            body_contact::resolve(&body, &laws.colliders, step)
        });
        for ((rows, _), change) in bodies.iter().zip(changes) {
            let Some(change) = change else { continue };
            self.memory.ready = false;
            chunks2(&mut x[rows.clone()], &mut v[rows.clone()], |start, x, v| {
                x.iter_mut().zip(v).enumerate().for_each(|(k, (x, v))| change.apply(start + k, x, v));
            });
        }
        bodies.into_iter().map(|(rows, _)| rows).collect()
    }

    /// Breaks the links that are strained beyond their limit; returns how many.
    pub fn break_links(&mut self) -> u64 {
        let x = &self.state.x;
        self.laws.batches.iter_mut().map(|b| b.break_links(x)).sum::<u64>()
            + self.constraints.iter_mut().map(|c| c.break_links(x)).sum::<u64>()
    }
}

/// A range without some others, which are in order.
pub fn without(range: Range<usize>, others: &[Range<usize>]) -> Vec<Range<usize>> {
    let (mut left, mut start) = (Vec::new(), range.start);
    for other in others.iter().filter(|other| other.start < range.end && range.start < other.end) {
        left.push(start..other.start.max(start));
        start = other.end.max(start);
    }
    left.push(start.min(range.end)..range.end);
    left.retain(|rows| !rows.is_empty());
    left
}
