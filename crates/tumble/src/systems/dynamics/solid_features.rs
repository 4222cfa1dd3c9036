//! Solids whose edges and triangles meet those of soft surfaces, too. Their corners are vertices of the topology after all points of the
//! system, held and of no mass; where they are is a function of time alone, and so in no snapshot.                  (contact.23)

use super::contact::real;
use super::feature::Span;
use crate::geometry::mesh_contact::{Owner, Pair, PairKind, Topology};
use crate::geometry::{Collider, Friction, Vector};
use crate::math::{Row, axpy, row, xyz64};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

/// Depth in a solid up to which a point lies on it [m], 1 m from the origin.
const TOUCH: f64 = 1e-6;

/// Edges keep off a solid by this part of its thickness: where masses lie on a face, edges between them are left alone.
const NEARER: f64 = 0.9;

/// One solid.
struct Solid {
    /// Which collider.
    collider: usize,
    /// Its corners, counted from the first of all solids.
    corners: Range<usize>,
}

/// All of them.
#[derive(Default)]
pub struct SolidFeatures {
    colliders: Arc<Vec<Collider>>,
    /// Points of the system; corners come after them.
    points: usize,
    list: Vec<Solid>,
    /// Whether any of them ever moves.
    moving: bool,
    /// End of the sub-step [s].
    time: f64,
    /// Places of corners at the end of the sub-step.
    pub end: Vec<Row>,
    /// Their places at its start, less the way of belts: friction compares with these.
    pub start: Vec<Row>,
    /// Rows of points and corners.
    rows: Vec<Row>,
}

impl SolidFeatures {
    /// Whether any collider, with edges or without, is within a ball at the start of a sub-step or at its end.
    pub fn are_near(&self, centre: Vector, radius: f64, step: Span) -> bool {
        let within = |c: &Collider, t: f64| c.distance(centre, t, radius).0 < radius + c.thickness;
        self.colliders.iter().any(|c| within(c, step.t) || c.moves() && within(c, step.end()))
    }

    /// Features of the colliders that have edges.
    pub fn new(colliders: &Arc<Vec<Collider>>, points: usize) -> Self {
        let mut all = Self { colliders: colliders.clone(), points, ..Self::default() };
        let mut first = 0;
        for (i, collider) in colliders.iter().enumerate() {
            let Some(mesh) = &collider.edges else { continue };
            let corners = first..first + mesh.vertices.len();
            first = corners.end;
            all.moving |= collider.moves();
            all.list.push(Solid { collider: i, corners });
        }
        all
    }

    /// Points of the system.
    pub fn points(&self) -> usize {
        self.points
    }

    /// Points and corners.
    pub fn vertices(&self) -> usize {
        self.points + self.list.last().map_or(0, |solid| solid.corners.end)
    }

    /// Places of corners at time t [m].
    fn at(&self, t: f64) -> impl Iterator<Item = Row> {
        self.list.iter().flat_map(move |solid| self.colliders[solid.collider].corners(t)).map(|x| row(real(x), 0.0))
    }

    /// Adds them to the topology, beside soft surfaces of this `thickness` [m].                                  (contact.23)
    pub fn add_to(&self, topology: &mut Topology, thickness: f64) {
        for solid in &self.list {
            let collider = &self.colliders[solid.collider];
            let Some(mesh) = &collider.edges else { continue };
            let first = (self.points + solid.corners.start) as u32;
            let triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|i| i + first)).collect();
            let radius = (NEARER * collider.thickness - 0.5 * thickness).max(0.0);
            topology.add(Owner { radius, itself: false, hair: false }, &triangles, &[], &[]);
        }
        if !self.list.is_empty() {
            topology.end_soft(self.points as u32);
        }
    }

    /// Rows of points, and after them of the corners at time t.
    pub fn joined<'a>(&self, x: &'a [Row], t: f64) -> Cow<'a, [Row]> {
        if self.list.is_empty() {
            return Cow::Borrowed(x);
        }
        Cow::Owned(x[..self.points].iter().copied().chain(self.at(t)).collect())
    }

    /// Works on the rows of points and of corners where they end in the sub-step.
    pub fn with_end<T>(&mut self, x: &mut [Row], work: impl FnOnce(&Self, &mut [Row]) -> T) -> T {
        if self.list.is_empty() {
            return work(self, x);
        }
        let mut rows = std::mem::take(&mut self.rows);
        rows.clear();
        rows.extend_from_slice(&x[..self.points]);
        rows.extend_from_slice(&self.end);
        let result = work(self, &mut rows);
        x[..self.points].copy_from_slice(&rows[..self.points]);
        self.rows = rows;
        result
    }

    /// Finds the places of corners at both ends of a sub-step; belts, which friction compares with, have not run yet.
    pub fn place(&mut self, step: Span) {
        self.time = step.end();
        if self.moving || self.end.is_empty() {
            self.start = self.at(step.t).collect();
            self.end = self.at(step.end()).collect();
        }
    }

    /// The ways that they go [m].
    pub fn ways(&self) -> impl Iterator<Item = Vector> {
        self.start.iter().zip(&self.end).map(|(a, b)| xyz64(*b) - xyz64(*a))
    }

    /// Rows of points, and after them of the corners where they start from.
    pub fn at_start<'a>(&self, x: &'a [Row]) -> Cow<'a, [Row]> {
        if self.list.is_empty() { Cow::Borrowed(x) } else { Cow::Owned([&x[..self.points], &self.start].concat()) }
    }

    /// Takes the way that belts carry along in a sub-step from the start.
    pub fn run_belts(&mut self, step: Span) {
        for solid in &self.list {
            let slip = self.colliders[solid.collider].slip(step.end()) * step.h;
            if slip != Vector::default() {
                let back = |x: &mut Row| *x = row(real(xyz64(*x) - slip), 0.0);
                self.start[solid.corners.clone()].iter_mut().for_each(back);
            }
        }
    }

    /// Puts points that lie on a solid at time t, or nearer than its thickness, to the end of the thickness.
    pub fn lift(&self, topology: &Topology, x: &mut [Row], t: f64) {
        for collider in self.list.iter().map(|solid| &self.colliders[solid.collider]) {
            for i in self.soft(topology) {
                let at = xyz64(x[i]);
                if let Some(touch) = collider.touch(at, t).filter(|touch| x[i][3] > 0.0 && !is_inside(collider, touch.depth, at)) {
                    x[i] = axpy(x[i], 1.0, row(real(touch.normal * touch.depth), 0.0));
                }
            }
        }
    }

    /// Vertices that are inside solids at time t, and the corners of these; none at all if there are none.
    pub fn inside(&self, topology: &Topology, x: &[Row], t: f64) -> Vec<bool> {
        let mut inside = Vec::new();
        for solid in &self.list {
            let collider = &self.colliders[solid.collider];
            let is_in = |i: &usize| {
                let at = xyz64(x[*i]);
                x[*i][3] > 0.0 && collider.touch(at, t).is_some_and(|touch| is_inside(collider, touch.depth, at))
            };
            let found: Vec<usize> = self.soft(topology).filter(is_in).collect();
            if !found.is_empty() {
                inside.resize(self.vertices(), false);
                found.into_iter().chain(solid.corners.clone().map(|c| c + self.points)).for_each(|i| inside[i] = true);
            }
        }
        inside
    }

    fn soft(&self, topology: &Topology) -> impl Iterator<Item = usize> {
        topology.points().iter().map(|i| *i as usize).take_while(|i| *i < self.points)
    }

    /// Which collider one of these vertices belongs to.
    pub fn collider(&self, vertices: &[u32]) -> Option<usize> {
        let corner = vertices.iter().find(|v| **v as usize >= self.points)?;
        let corner = *corner as usize - self.points;
        self.list.iter().find(|solid| solid.corners.contains(&corner)).map(|solid| solid.collider)
    }

    /// The name of a collider.
    pub fn name(&self, collider: usize) -> String {
        self.colliders[collider].name.clone()
    }

    /// Takes the solids anew; those with edges stay in their places.
    pub fn take_surfaces(&mut self, colliders: &Arc<Vec<Collider>>) {
        self.colliders = colliders.clone();
    }

    /// Friction of a pair with one of them, at the end of the sub-step.
    pub fn friction(&self, pair: &Pair) -> Option<Friction> {
        self.collider(&pair.vertices).map(|i| self.colliders[i].friction_at(self.time))
    }

    /// Whether a pair is a mass with a triangle of a solid: masses meet solids as all do, with restitution and as their scheme has it.
    pub fn is_mass(&self, pair: &Pair) -> bool {
        pair.kind == PairKind::PointTriangle && pair.vertices[1] as usize >= self.points
    }
}

/// Whether a point so deep below the thickness of a solid is beyond its surface, too.
fn is_inside(collider: &Collider, depth: f64, at: Vector) -> bool {
    depth > collider.thickness + TOUCH * (1.0 + at.norm())
}
