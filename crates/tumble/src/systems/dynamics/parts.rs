//! Masses and elements of a system, as recipes collect them.

use super::followers::Follower;
use super::holds::{Hold, Times};
use super::tear::{Edges, TearPart};
use crate::elements::{DrivenSpring, LongRangeAttachments, Members, Membrane};
use crate::forces::{Air, Force};
use crate::geometry::Carrier;
use crate::math::{Quat, Real, Signal, Vec3};
use crate::pool::Emitter;
use crate::state::Object;
use std::collections::HashMap;
use std::ops::Range;
use tumble_interface::scene::{AnimatedVector, Force as Words, HairCollisions};
use tumble_interface::{Issue, SceneError};

/// A spring as recipes give it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpringPart {
    /// Its masses.
    pub ends: [u32; 2],
    /// Spring constant [N/m].
    pub stiffness: f64,
    /// Damping along it [N s/m].
    pub damping: f64,
    /// Rest length [m]; 0 makes f = k (b - a).
    pub rest: f64,
    /// Stiffening c.
    pub hardening: f64,
    /// Pulls only.
    pub tension_only: bool,
    /// Strain at which it breaks.
    pub break_strain: Option<f64>,
}

/// A closed surface that holds a volume.
#[derive(Debug, Clone)]
pub struct Closed {
    /// Its triangles, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Volume that they enclose at rest [m³].
    pub volume: f64,
    /// That at which nothing presses, relative to it.
    pub target: Signal,
    /// Pressure over the change of volume [Pa/m³]; infinite to keep it.
    pub stiffness: f64,
}

/// A liquid of particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Liquid {
    /// Spacing at rest [m].
    pub spacing: f64,
    /// Bulk modulus [Pa]; infinite to keep the density.
    pub bulk: f64,
    /// Viscosity [Pa s].
    pub viscosity: f64,
}

/// Springs of one kind, with the strains at which they break.
#[derive(Default)]
pub struct Springs<const D: usize, const P: usize> {
    /// The springs.
    pub members: Vec<Members<2, D, P>>,
    /// Strains at which they break.
    pub limits: Vec<f64>,
}

impl<const D: usize, const P: usize> Springs<D, P> {
    /// Adds some of them to others, those along an edge of two triangles as two halves.
    fn halved(&self, range: Range<usize>, edges: Option<&Edges<'_>>, into: &mut Self) {
        for e in range {
            let (mut member, limit) = (self.members[e], self.limits[e]);
            let halves = if edges.is_some_and(|edges| edges.at(member.nodes).len() == 2) { 2 } else { 1 };
            member.stiffness /= f64::from(halves);
            member.damping /= f64::from(halves);
            for _ in 0..halves {
                into.members.push(member);
                into.limits.push(limit);
            }
        }
    }

    fn push(&mut self, part: &SpringPart, rest: [f64; D], law: [f64; P], damping: f64) {
        self.members.push(Members { nodes: part.ends, rest, law, stiffness: part.stiffness, damping });
        self.limits.push(part.break_strain.unwrap_or(f64::INFINITY));
    }
}

/// Position [m], velocity [m/s], mass [kg], whether it is held.
pub type Point = (Vec3<f64>, Vec3<f64>, f64, bool);

/// Masses and elements under construction. Nodes are counted from 0: points by points, frames by frames.
#[derive(Default)]
pub struct Parts {
    pub(super) points: Vec<Point>,
    pub(super) frames: Vec<([f64; 4], f64, bool)>,
    /// Points with an electric charge [C].
    pub(super) charges: Vec<(u32, f64)>,
    /// Points that are spread out as Plummer's sphere, with its radius [m], in order.
    pub(super) halos: Vec<(u32, f64)>,
    pub(super) linear: Springs<1, 0>,
    pub(super) nonlinear: Springs<1, 2>,
    pub(super) vector: Springs<0, 0>,
    pub(super) dampers: Vec<Members<2, 1, 0>>,
    /// Springs that change in time.
    pub driven: Vec<DrivenSpring>,
    pub(super) bending: Vec<Members<6, 12, 0>>,
    pub(super) isometric: Vec<Members<4, 3, 0>>,
    pub(super) membranes: Vec<Members<3, 8, 0>>,
    pub(super) areas: Vec<Members<3, 1, 0>>,
    pub(super) woven: Vec<Members<3, 28, 0>>,
    pub(super) woven_bending: Vec<Members<6, 36, 0>>,
    /// Closed surfaces and whole bodies, each with its place in the scene.
    pub(super) closed: Vec<(String, Closed)>,
    pub(super) shapes: Vec<(String, Range<usize>, f64)>,
    pub(super) liquids: Vec<(String, Range<usize>, Liquid)>,
    pub(super) shears: Vec<Members<4, 9, 0>>,
    pub(super) volumes: Vec<Members<4, 10, 0>>,
    pub(super) strains: Vec<Members<4, 9, 0>>,
    pub(super) stretches: Vec<Members<3, 2, 0>>,
    pub(super) bends: Vec<Members<2, 6, 0>>,
    /// Hair that acts on itself, by object.
    pub(super) hair: Vec<(usize, HairCollisions)>,
    /// Strains at which segments of rods break.
    pub(super) rod_limits: Vec<f64>,
    pub(super) energy_at_rest: [f64; 2],
    /// Points that follow colliders: by their places in the world at t = 0, and by places in the frames of their carriers.
    pub(super) followers: Vec<Follower>,
    pub(super) carried: Vec<Follower>,
    /// Points that are held for some time, as rows; and such frames, as frames.
    pub(super) holds: Vec<Hold>,
    pub(super) frame_holds: Vec<Hold>,
    /// Places [m] of points of no object that are held beside clamped edges.
    pub(super) ghosts: Vec<Vec3<f64>>,
    pub(super) objects: Vec<Draft>,
    pub(super) emitters: Vec<Emitter>,
    /// Forces on each mass by itself, and what they act on.
    pub forces: Vec<(String, Box<dyn Force>, On)>,
    /// Forces [N] that some points share.
    pub loads: Vec<(String, Vec<u32>, AnimatedVector)>,
    /// The air around the surfaces of some objects.
    pub airs: Vec<(Air, Vec<usize>)>,
    /// Times of the run at which forces that change in time are tried [s].
    pub times: Vec<f64>,
    /// Forces between masses of some objects, and the other objects that the words name.
    pub between: Vec<(Words, Vec<usize>, Option<Vec<usize>>)>,
}

/// The number of the first point that belongs to no object, until all others are there.
const GHOST: u32 = 1 << 31;

/// What a force acts on.
pub enum On {
    /// Objects, counted from the first that was begun.
    Objects(Vec<usize>),
    /// Points.
    Points(Vec<u32>),
}

/// An object and how many links of each kind there were before it.
pub(super) struct Draft {
    pub object: Object,
    pub links: [usize; 3],
    pub tear: Option<TearPart>,
}

impl Parts {
    /// Begins an object, to which all later additions belong.
    pub fn begin(&mut self, name: &str, radius: f64) {
        let (p, f) = (self.points.len(), self.frames.len());
        let object = Object { name: name.into(), points: p..p, frames: f..f, radius, ..Object::default() };
        self.objects.push(Draft { object, links: self.counts(), tear: None });
    }

    pub(super) fn counts(&self) -> [usize; 3] {
        [self.linear.members.len(), self.nonlinear.members.len(), self.vector.members.len()]
    }

    /// Lets the object under construction tear; it must have its triangles, pins and elements.
    pub fn tear(&mut self, part: TearPart) {
        let Some(first) = self.objects.last().and_then(|d| self.points.get(d.object.points.start)) else { return };
        // Spare vertices weigh nothing and are held where the first is, until they are needed.
        let idle = (first.0, Vec3::default(), 0.0, true);
        self.points.extend(std::iter::repeat_n(idle, part.spare));
        let end = self.points.len();
        if let Some(draft) = self.objects.last_mut() {
            draft.object.points.end = end;
            draft.object.spare = part.spare;
            draft.tear = Some(part);
        }
    }

    /// Makes two of every link along an edge that two triangles share, in surfaces that tear: one for each.
    pub(super) fn halve_links(&mut self) {
        let mut drafts = std::mem::take(&mut self.objects);
        let ends: Vec<[usize; 3]> = drafts.iter().skip(1).map(|d| d.links).chain([self.counts()]).collect();
        let (mut linear, mut nonlinear) = (Springs::default(), Springs::default());
        for (draft, end) in drafts.iter_mut().zip(ends) {
            let (start, first) = (draft.links, draft.object.points.start as u32);
            let rows: Vec<[u32; 3]> = draft.object.triangles.iter().map(|t| t.map(|i| i + first)).collect();
            let edges = draft.tear.as_ref().map(|_| Edges::new(&rows));
            draft.links[0] = linear.members.len();
            draft.links[1] = nonlinear.members.len();
            self.linear.halved(start[0]..end[0], edges.as_ref(), &mut linear);
            self.nonlinear.halved(start[1]..end[1], edges.as_ref(), &mut nonlinear);
        }
        (self.linear, self.nonlinear, self.objects) = (linear, nonlinear, drafts);
    }

    /// Ranges of at least two linear springs that follow one another along a curve, from each point to the next by number.
    pub(super) fn chains(&self) -> Vec<Range<usize>> {
        let ends: Vec<usize> = self.objects.iter().skip(1).map(|d| d.links[0]).chain([self.linear.members.len()]).collect();
        let objects = self.objects.iter().zip(ends).filter(|(d, _)| !d.object.curve.is_empty());
        let along = |nodes: [u32; 2]| nodes[1] == nodes[0] + 1;
        let mut chains: Vec<Range<usize>> = Vec::new();
        for e in objects.flat_map(|(draft, end)| draft.links[0]..end) {
            let nodes = self.linear.members[e].nodes;
            let joins = |chain: &&mut Range<usize>| chain.end == e && self.linear.members[e - 1].nodes[1] == nodes[0];
            match chains.last_mut().filter(joins) {
                Some(chain) if along(nodes) => chain.end = e + 1,
                _ if along(nodes) => chains.push(e..e + 1),
                _ => {}
            }
        }
        chains.retain(|chain| chain.len() > 1);
        chains
    }

    /// The object under construction.
    pub fn object(&mut self) -> Option<&mut Object> {
        self.objects.last_mut().map(|d| &mut d.object)
    }

    /// Gives all masses of the object under construction a velocity [m/s]; those that are held keep still.
    pub fn launch(&mut self, velocity: [f64; 3]) {
        let range = self.objects.last().map_or(0..0, |d| d.object.points.clone());
        self.points[range].iter_mut().for_each(|point| point.1 = Vec3::from(velocity));
    }

    /// Begins an object whose particles an emitter makes.
    pub fn emitter(&mut self, emitter: Emitter) {
        self.begin(&emitter.words().name.clone(), emitter.first_radius());
        let stream = self.emitters.len();
        if let Some(object) = self.object() {
            object.stream = Some(stream);
        }
        self.emitters.push(emitter);
    }

    /// Its emitters, for a system that needs nothing else.
    pub fn take_emitters(&mut self) -> Vec<Emitter> {
        std::mem::take(&mut self.emitters)
    }

    /// Its emitters.
    pub fn emitters(&self) -> impl Iterator<Item = &Emitter> {
        self.emitters.iter()
    }

    /// The emitter of that name, counted from the first.
    pub fn stream(&self, name: &str) -> Option<usize> {
        self.emitters.iter().position(|e| e.words().name == name)
    }

    /// Objects that have masses or will have some, with the place of each.
    pub fn bodies(&self) -> impl Iterator<Item = (usize, &str)> {
        let has = |d: &&Draft| !d.object.points.is_empty() || d.object.stream.is_some();
        self.objects.iter().enumerate().filter(move |(_, d)| has(d)).map(|(i, d)| (i, d.object.name.as_str()))
    }

    /// Points of every object so far, by name.
    pub fn ranges(&self) -> impl Iterator<Item = (&str, Range<usize>)> {
        self.objects.iter().map(|d| (d.object.name.as_str(), d.object.points.clone()))
    }

    /// Of every object, the shortest of its edges, links, pieces of curves and spacings, infinite where it has none, and the diagonal of the box
    /// around it [m].
    pub fn lengths(&self) -> Vec<(f64, f64)> {
        let x = |i: u32| self.points[i as usize].0;
        let mut shortest = vec![f64::INFINITY; self.objects.len()];
        let mut take = |[a, b]: [u32; 2]| {
            let length = (x(a) - x(b)).norm();
            // Objects have their points one after the other.
            let at = self.objects.partition_point(|d| d.object.points.end <= a as usize);
            let same = self.objects.get(at).is_some_and(|d| d.object.points.contains(&(b as usize)));
            if same && length > 0.0 {
                shortest[at] = shortest[at].min(length);
            }
        };
        self.linear.members.iter().map(|m| m.nodes).for_each(&mut take);
        self.nonlinear.members.iter().map(|m| m.nodes).for_each(&mut take);
        self.stretches.iter().map(|m| [m.nodes[0], m.nodes[1]]).for_each(&mut take);
        for nodes in self.strains.iter().map(|m| m.nodes).chain(self.shears.iter().map(|m| m.nodes)) {
            (1..4).for_each(|k| take([nodes[0], nodes[k]]));
        }
        for Draft { object, .. } in &self.objects {
            let first = object.points.start as u32;
            object.triangles.iter().for_each(|t| (0..3).for_each(|k| take([first + t[k], first + t[(k + 1) % 3]])));
        }
        for (_, range, liquid) in &self.liquids {
            let at = self.objects.partition_point(|d| d.object.points.end <= range.start);
            shortest[at] = shortest[at].min(liquid.spacing);
        }
        let size = |d: &Draft| {
            let places = self.points[d.object.points.clone()].iter().map(|p| <[f64; 3]>::from(p.0));
            let least = places.clone().reduce(|a, b| std::array::from_fn(|k| a[k].min(b[k])));
            let most = places.reduce(|a, b| std::array::from_fn(|k| a[k].max(b[k])));
            least.zip(most).map_or(0.0, |(l, h)| (Vec3::from(h) - Vec3::from(l)).norm())
        };
        shortest.into_iter().zip(self.objects.iter().map(size)).collect()
    }

    /// Adds a mass [kg] at x [m] with velocity v [m/s]; returns its index.
    pub fn point(&mut self, x: Vec3<f64>, v: Vec3<f64>, mass: f64) -> u32 {
        self.points.push((x, v, mass, false));
        let n = self.points.len();
        if let Some(object) = self.object() {
            object.points.end = n;
        }
        n as u32 - 1
    }

    /// Adds a point of no object, held at x [m] or carried by a collider, counted from the first.
    pub fn ghost(&mut self, x: Vec3<f64>, carrier: Option<(usize, Carrier)>) -> u32 {
        let point = GHOST + self.ghosts.len() as u32;
        self.ghosts.push(x);
        if let Some((collider, carrier)) = carrier {
            self.followers.push(Follower { row: point as usize, collider, carrier, place: x, frame: None, times: Times::ALWAYS });
        }
        point
    }

    /// Counts the points of no object after those of all objects; returns how many there are.
    pub(super) fn place_ghosts(&mut self) -> usize {
        let count = self.ghosts.len();
        let first = self.points.len() as u32;
        let place = |node: &mut u32| *node = if *node >= GHOST { *node - GHOST + first } else { *node };
        self.points.extend(self.ghosts.drain(..).map(|x| (x, Vec3::default(), 0.0, true)));
        self.bending.iter_mut().flat_map(|m| &mut m.nodes).for_each(place);
        self.isometric.iter_mut().flat_map(|m| &mut m.nodes).for_each(place);
        self.woven_bending.iter_mut().flat_map(|m| &mut m.nodes).for_each(place);
        for follower in self.followers.iter_mut().filter(|f| f.row >= GHOST as usize) {
            follower.row = follower.row - GHOST as usize + first as usize;
        }
        count
    }

    /// Adds a force [N] that points share.
    pub fn load(&mut self, path: String, points: Vec<u32>, force: AnimatedVector) {
        self.loads.push((path, points, force));
    }

    /// Mass of a point [kg].
    pub fn mass(&self, point: u32) -> f64 {
        self.points[point as usize].2
    }

    /// Makes a point heavier [kg].
    pub fn add_mass(&mut self, point: u32, mass: f64) {
        self.points[point as usize].2 += mass;
    }

    /// Adds a frame with a moment of inertia [kg m²]; returns its index among the frames.
    pub fn frame(&mut self, q: [f64; 4], inertia: f64) -> u32 {
        self.frames.push((q, inertia, false));
        let n = self.frames.len();
        if let Some(object) = self.object() {
            object.frames.end = n;
        }
        n as u32 - 1
    }

    /// Gives a point an electric charge [C].
    pub fn charge(&mut self, point: u32, charge: f64) {
        self.charges.push((point, charge));
    }

    /// Electric charges of points [C].
    pub fn charges(&self) -> HashMap<u32, f64> {
        self.charges.iter().copied().collect()
    }

    /// Ends of the springs that have a rest length.
    pub fn springs_with_rest_length(&self) -> impl Iterator<Item = [u32; 2]> {
        let linear = self.linear.members.iter().map(|m| (m.nodes, m.rest));
        let all = linear.chain(self.nonlinear.members.iter().map(|m| (m.nodes, m.rest)));
        let driven = self.driven.iter().map(|s| (s.nodes, [s.rest.value(0.0)]));
        all.chain(driven).filter(|(_, [rest])| *rest > 0.0).map(|(nodes, _)| nodes)
    }

    /// Spreads a point out as Plummer's sphere of a radius [m].
    pub fn halo(&mut self, point: u32, radius: f64) {
        self.halos.push((point, radius));
    }

    /// Holds a point.
    pub fn pin(&mut self, point: u32) {
        self.points[point as usize].3 = true;
    }

    /// Lets a point that is held for some time follow a collider, counted from the first.
    pub fn follow(&mut self, point: u32, collider: usize, carrier: Carrier, times: Times) {
        let place = self.position(point);
        self.followers.push(Follower { row: point as usize, collider, carrier, place, frame: None, times });
    }

    /// Holds a point for some time.
    pub fn hold(&mut self, point: u32, times: Times) {
        self.holds.push(Hold { row: point as usize, times, segment: None });
    }

    /// Holds a frame at an end of a rod for some time; `segment` is that of the segment there, and its turn relative to that.
    pub fn hold_frame(&mut self, frame: u32, (segment, turn): (u32, Quat<f64>), times: Times) {
        self.frame_holds.push(Hold { row: frame as usize, times, segment: Some((segment as usize, turn)) });
    }

    /// Holds a frame.
    pub fn clamp_frame(&mut self, frame: u32) {
        self.frames[frame as usize].2 = true;
    }

    /// An object, its rows counted as now: all of them.
    pub fn named(&self, name: &str) -> Option<&Object> {
        self.objects.iter().map(|draft| &draft.object).find(|object| object.name == name)
    }

    /// Position of a point [m].
    pub fn position(&self, point: u32) -> Vec3<f64> {
        self.points[point as usize].0
    }

    /// Velocity of a point at the start [m/s].
    pub fn velocity(&self, point: u32) -> Vec3<f64> {
        self.points[point as usize].1
    }

    /// Inverse mass of a point [1/kg], 0 if it is held.
    pub fn inverse_mass(&self, point: u32) -> f64 {
        let (_, _, mass, pinned) = self.points[point as usize];
        if pinned { 0.0 } else { 1.0 / mass }
    }

    /// Adds a spring.
    pub fn spring(&mut self, part: SpringPart) {
        if part.rest == 0.0 {
            self.vector.push(&part, [], [], 0.0);
            if part.damping > 0.0 {
                // The rate of x1 - x0 would resist rotation; a spring without stiffness damps along the line only.
                self.dampers.push(Members { nodes: part.ends, rest: [0.0], law: [], stiffness: 0.0, damping: part.damping });
            }
        } else if part.hardening == 0.0 && !part.tension_only {
            self.linear.push(&part, [part.rest], [], part.damping);
        } else {
            let law = [part.hardening / (part.rest * part.rest), if part.tension_only { 0.0 } else { 1.0 }];
            self.nonlinear.push(&part, [part.rest], law, part.damping);
        }
    }

    /// Adds the bending of a triangle: its corners, then what lies across its edges.
    pub fn bending(&mut self, nodes: [u32; 6], rest: [f64; 12], stiffness: f64) {
        self.bending.push(Members { nodes, rest, law: [], stiffness, damping: 0.0 });
    }

    /// Adds a flat hinge, quadratic in the positions, over edge 0 1 with opposite corners 2 and 3.
    pub fn isometric(&mut self, nodes: [u32; 4], rest: [f64; 3], stiffness: f64) {
        self.isometric.push(Members { nodes, rest, law: [], stiffness, damping: 0.0 });
    }

    /// Adds a membrane: the inverse of its rest edges, the root of its matrix, its rest area [m²] and damping time [s].
    pub fn membrane(&mut self, nodes: [u32; 3], b: [f64; 4], root: [f64; 4], area: f64, damping: f64) {
        let mut rest = [0.0; 8];
        rest[..4].copy_from_slice(&b);
        rest[4..].copy_from_slice(&root);
        self.membranes.push(Members { nodes, rest, law: [], stiffness: area, damping: area * damping });
    }

    /// Adds a resistance against changes of the rest area [m²]; k [N/m³].
    pub fn area(&mut self, nodes: [u32; 3], rest: f64, stiffness: f64) {
        self.areas.push(Members { nodes, rest: [rest], law: [], stiffness, damping: 0.0 });
    }

    /// Adds a triangle of a measured fabric: its rest numbers, rest area [m²] and damping time [s].
    pub fn woven(&mut self, nodes: [u32; 3], rest: [f64; 28], area: f64, damping: f64) {
        self.woven.push(Members { nodes, rest, law: [], stiffness: area, damping: area * damping });
    }

    /// The same of a measured fabric, with damping time [s].
    pub fn woven_bending(&mut self, nodes: [u32; 6], rest: [f64; 36], stiffness: f64, damping: f64) {
        self.woven_bending.push(Members { nodes, rest, law: [], stiffness, damping: stiffness * damping });
    }

    /// Adds a closed surface, at this place of the scene.
    pub fn closed(&mut self, path: String, closed: Closed) {
        self.closed.push((path, closed));
    }

    /// Keeps some points in the shape that they have now, by kappa [1/s²].
    pub fn shape(&mut self, path: String, points: Range<usize>, kappa: f64) {
        self.shapes.push((path, points, kappa));
    }

    /// Makes some points a liquid.
    pub fn liquid(&mut self, path: String, points: Range<usize>, liquid: Liquid) {
        self.liquids.push((path, points, liquid));
    }

    /// Adds a stable Neo-Hookean tetrahedron of rest volume V [m³] with the material's Lamé constants [Pa] and damping
    /// time [s].
    pub fn tetrahedron(&mut self, nodes: [u32; 4], b: [f64; 9], volume: f64, lame_mu: f64, lame_lambda: f64, damping: f64) {
        let lambda = lame_lambda + lame_mu;
        let mut rest = [1.0 + lame_mu / lambda; 10];
        rest[..9].copy_from_slice(&b);
        self.shears.push(Members { nodes, rest: b, law: [], stiffness: lame_mu * volume, damping: 0.0 });
        self.volumes.push(Members { nodes, rest, law: [], stiffness: lambda * volume, damping: 0.0 });
        if damping > 0.0 {
            // Energy of small strains mu |e|² = (2 mu)/2 |e|².
            self.strains.push(Members { nodes, rest: b, law: [], stiffness: 0.0, damping: 2.0 * lame_mu * volume * damping });
        }
        self.energy_at_rest[0] += 1.5 * lame_mu * volume;
        self.energy_at_rest[1] += 0.5 * lame_mu * lame_mu / lambda * volume;
    }

    /// A collider carries a point, which is at `x` [m] in it, and a frame, whose turn in it is `q`. Both must be held.
    pub fn carry(&mut self, (collider, carrier): (usize, Carrier), point: u32, x: Vec3<f64>, frame: u32, q: Quat<f64>) {
        self.carried.push(Follower {
            row: point as usize,
            collider,
            carrier,
            place: x,
            frame: Some((frame as usize, q)),
            times: Times::ALWAYS,
        });
    }

    /// Makes the object under construction act on itself as a continuum.
    pub fn hair_continuum(&mut self, words: HairCollisions) {
        self.hair.push((self.objects.len() - 1, words));
    }

    /// Adds the stretch and shear of a rod segment between two points, with its frame and the strain at which it breaks.
    pub fn rod_stretch(&mut self, points: [u32; 2], frame: u32, rest: [f64; 2], stiffness: f64, damping: f64, breaks: Option<f64>) {
        self.rod_limits.push(breaks.unwrap_or(f64::INFINITY));
        self.stretches.push(Members { nodes: [points[0], points[1], frame], rest, law: [], stiffness, damping });
    }

    /// Adds the bend and twist between two frames.
    pub fn rod_bend(&mut self, frames: [u32; 2], rest: [f64; 6], stiffness: f64, damping: f64) {
        self.bends.push(Members { nodes: frames, rest, law: [], stiffness, damping });
    }

    /// The place in the scene of a constraint on all masses of an object at once, if there is one.
    pub(super) fn global_constraint(&self) -> Option<&str> {
        let mut paths = self.closed.iter().map(|c| &c.0).chain(self.shapes.iter().map(|s| &s.0)).chain(self.liquids.iter().map(|l| &l.0));
        paths.next().map(String::as_str)
    }

    /// The place in the scene of a surface that tears, if there is one.
    pub(super) fn tearing_surface(&self) -> Option<&str> {
        self.objects.iter().find_map(|draft| draft.tear.as_ref()).map(|part| part.path.as_str())
    }

    /// Whether links break.
    pub(super) fn has_breakable_links(&self) -> bool {
        self.linear.limits.iter().chain(&self.nonlinear.limits).chain(&self.vector.limits).any(|limit| limit.is_finite())
    }

    /// Whether rods break.
    pub(super) fn has_breakable_rods(&self) -> bool {
        self.rod_limits.iter().any(|limit| limit.is_finite())
    }

    /// Whether hair acts on itself.
    pub(super) fn has_hair_continuum(&self) -> bool {
        !self.hair.is_empty()
    }

    /// Whether nothing moves.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty() && self.frames.is_empty() && self.emitters.is_empty()
    }

    /// Long-range attachments of every object that has held points: ways go along links, seams, pieces of rods and the edges of membranes and fabrics.
    pub(super) fn attachments(&self, slack: f64, held: impl Fn(usize) -> bool) -> Vec<LongRangeAttachments> {
        let links = self.linear.members.iter().map(|m| (m.nodes, m.rest[0]));
        let links = links.chain(self.nonlinear.members.iter().map(|m| (m.nodes, m.rest[0])));
        let seams = self.vector.members.iter().map(|m| (m.nodes, 0.0));
        let rods = self.stretches.iter().map(|m| ([m.nodes[0], m.nodes[1]], m.rest[0]));
        let edges = |[a, b, c]: [u32; 3], inverse| [[a, b], [a, c], [b, c]].into_iter().zip(Membrane::lengths(inverse));
        let membranes = self.membranes.iter().flat_map(|m| edges(m.nodes, std::array::from_fn(|k| m.rest[k])));
        let woven = self.woven.iter().flat_map(|m| edges(m.nodes, std::array::from_fn(|k| m.rest[k])));
        let ways: Vec<_> = links.chain(seams).chain(rods).chain(membranes).chain(woven).collect();
        self.objects.iter().filter_map(|draft| LongRangeAttachments::new(draft.object.points.clone(), &ways, &held, slack)).collect()
    }

    /// Whether every number survives the engine's scalar: neither infinite nor, where it must not be, zero.
    pub(super) fn check_range(&self) -> Result<(), SceneError> {
        let fits = |x: f64| (x as Real).is_finite() && (x == 0.0 || x as Real != 0.0);
        let mut issues = Vec::new();
        let springs = [
            self.linear.members.iter().map(|m| (m.stiffness, m.damping)).collect::<Vec<_>>(),
            self.nonlinear.members.iter().map(|m| (m.stiffness, m.damping)).collect(),
            self.vector.members.iter().map(|m| (m.stiffness, m.damping)).collect(),
        ];
        let ends: Vec<[usize; 3]> = self.objects.iter().skip(1).map(|d| d.links).chain([self.counts()]).collect();
        for (draft, end) in self.objects.iter().zip(ends) {
            let mut wrong = |what: &str, number: f64| {
                let (low, high) = (Real::MIN_POSITIVE, Real::MAX);
                let message = format!("a {what} of {number:.3e}, expected between {low:.0e} and {high:.0e}; or set precision = \"double\"");
                issues.push(Issue::new(draft.object.name.as_str(), message));
            };
            let points = draft.object.points.start..draft.object.points.end - draft.object.spare;
            let masses = self.points[points].iter().map(|p| p.2);
            if let Some(mass) = masses.into_iter().find(|m| !fits(*m) || !fits(1.0 / m)) {
                wrong("mass", mass);
            }
            let links = (0..3).flat_map(|kind| &springs[kind][draft.links[kind]..end[kind]]);
            if let Some((k, b)) = links.into_iter().find(|(k, b)| !fits(*k) || !fits(*b)) {
                if fits(*k) { wrong("damping", *b) } else { wrong("spring constant", *k) }
            }
        }
        if issues.is_empty() { Ok(()) } else { Err(SceneError { issues }) }
    }
}
