//! Contact of masses with solids. Every method gets its candidates here and resolves them in its own way.

use super::motion::{Pose, Twist};
use super::{Motion, Rig, Shape, Vector};
use crate::math::Signal;
use std::sync::Arc;
use tumble_interface::Mesh;

/// A solid turns less than this while the way of a mass past it counts as straight [rad].
const TURN: f64 = 0.25;
/// Pieces of a way at most: a solid that turns more in a step is not resolved.
const PIECES: f64 = 64.0;

/// A solid with a surface.
#[derive(Debug, Clone)]
pub struct Collider {
    /// Its name in the scene.
    pub name: String,
    /// Its shape.
    pub shape: Shape,
    /// Whether it keeps masses in instead of out.
    pub inside: bool,
    /// Masses are kept this far from the surface [m].
    pub thickness: f64,
    /// Coulomb friction; `friction_at` has that of a time.
    pub friction: Friction,
    /// Coefficients that change in time, of what slides and of what rests.
    pub rubbing: Option<Arc<[Signal; 2]>>,
    /// Speed after a bounce over speed before.
    pub restitution: f64,
    /// Velocity of the surface along itself [m/s].
    pub belt: Vector,
    /// How it moves; `None` if it does not.
    pub motion: Option<Motion>,
    /// Its bones, if it is a figure.
    pub rig: Option<Arc<Rig>>,
    /// Its mesh at t = 0, before its motion, where edges and triangles meet those of what is soft; `None` for contact with masses only.
    pub edges: Option<Arc<Mesh>>,
}

impl Collider {
    /// Coulomb friction at a time [s].
    pub fn friction_at(&self, t: f64) -> Friction {
        let Some(rubbing) = &self.rubbing else { return self.friction };
        let [sliding, resting] = [0, 1].map(|k: usize| rubbing[k].value(t));
        Friction { sliding, resting }
    }
}

/// Coefficients of Coulomb friction.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Friction {
    /// Of what slides.
    pub sliding: f64,
    /// Of what rests, at least as large.
    pub resting: f64,
}

impl Friction {
    /// How much friction takes of a slide, where the normal impulse is `press` in the same unit: all where it can hold that, else what it takes of
    /// what slides.                                                                              (contact.22)
    pub fn takes(self, slide: f64, press: f64) -> f64 {
        if slide <= self.resting * press { slide } else { slide.min(self.sliding * press) }
    }
}

/// The part of a collider that attached points follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Carrier {
    /// The collider as a rigid whole.
    Whole,
    /// One of its bones.
    Bone(usize),
    /// A triangle of a surface that moves by itself, and the weights of its corners where it carries.
    Facet(usize, [f64; 3]),
}

/// A mass within the thickness of a solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// How deep it is below the thickness [m], > 0.
    pub depth: f64,
    /// Unit normal towards where masses may be.
    pub normal: Vector,
    /// Velocity of the surface [m/s].
    pub velocity: Vector,
}

/// A mass that meets a solid on its way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Impact {
    /// Part of the way, 0 to 1.
    pub part: f64,
    /// Unit normal towards where the mass came from.
    pub normal: Vector,
    /// Velocity of the surface [m/s].
    pub velocity: Vector,
}

/// What is looked for around a point.
#[derive(Debug, Clone, Copy)]
pub struct Search {
    /// Surfaces nearer than this [m].
    pub within: f64,
    /// A solid counts as having at least this thickness [m].
    pub thickness: f64,
    /// How many of its surfaces at most.
    pub surfaces: usize,
    /// Whether what lies deep inside a mesh looks for its surface, however far.
    pub deep: bool,
}

/// Solids at a time.
#[derive(Debug, Clone, Copy, Default)]
pub struct Walls<'a> {
    /// The solids.
    pub colliders: &'a [Collider],
    /// The time [s].
    pub t: f64,
}

impl Walls<'_> {
    /// Calls `f` with the number of the solid, the distance [m] of p from where masses are stopped, and the direction away from there, of every
    /// surface that is nearer than `within` [m]: of a solid the nearest one, of a box that contains each of its walls, of another container up to
    /// three, as if each were flat. Solids count as having a thickness of at least `thickness` [m].
    pub fn near(&self, p: Vector, thickness: f64, within: f64, mut f: impl FnMut(usize, f64, Vector)) {
        for (at, collider) in self.colliders.iter().enumerate() {
            let search = Search { within, thickness, surfaces: if collider.inside { 3 } else { 1 }, deep: true };
            collider.each_near(p, self.t, search, |distance, normal| f(at, distance, normal));
        }
    }
}

impl Collider {
    fn at(&self, t: f64) -> Option<(Pose, Twist)> {
        self.motion.as_ref().map(|m| m.at(t))
    }

    /// Pose at time t of the rigid whole, or of one of its bones or triangles.
    pub fn pose(&self, carrier: Carrier, t: f64) -> Pose {
        let whole = self.at(t).map_or(Pose::default(), |(pose, _)| pose);
        match (carrier, &self.shape) {
            (Carrier::Bone(bone), _) => self.bone_pose(bone, t).map_or(Pose::default(), |(pose, _)| pose),
            (Carrier::Facet(triangle, weights), Shape::Animated { facets, .. }) => {
                let own = facets.pose(triangle, weights, t);
                Pose { turn: whole.turn * own.turn, shift: whole.out(own.shift) }
            }
            _ => whole,
        }
    }

    /// The carrier of a point that is at p when t = 0: the nearest point of a deforming surface, or the rigid whole.
    pub fn carrier(&self, p: Vector) -> Carrier {
        let Shape::Animated { facets, .. } = &self.shape else { return Carrier::Whole };
        let local = self.at(0.0).map_or(p, |(pose, _)| pose.back(p));
        facets.carrier(local).map_or(Carrier::Whole, |(triangle, weights)| Carrier::Facet(triangle, weights))
    }

    /// Calls `f` with the distance [m] of p from where masses are stopped, and the direction away from there, of its surfaces nearer than that of
    /// the search, as if each were flat: of a box that contains each wall, else up to so many.
    pub fn each_near(&self, p: Vector, t: f64, search: Search, mut f: impl FnMut(f64, Vector)) {
        let (mut from, thickness) = (p, search.thickness.max(self.thickness));
        let reach = search.within + thickness;
        if let Some(walls) = self.walls(p, t) {
            for (distance, normal) in walls.into_iter().filter(|(distance, _)| *distance < reach) {
                f(distance - thickness, normal);
            }
            return;
        }
        for _ in 0..search.surfaces {
            let found = if search.deep { Some(self.distance(from, t, reach)) } else { self.distance_near(from, t, reach) };
            let Some((distance, normal)) = found.filter(|(distance, normal)| *distance < reach && normal.norm_sq() > 0.0) else { break };
            f(distance - thickness + normal.dot(p - from), normal);
            // A point from which that surface is out of reach, whatever the rounding.
            from = from + normal * (1.01 * reach - distance);
        }
    }

    /// The same solid, a mesh by its triangles instead of a grid of distances.
    pub fn by_triangles(&self) -> Self {
        let shape = match &self.shape {
            Shape::Mesh { facets, shell, .. } => Shape::Animated { facets: facets.clone(), shell: *shell },
            other => other.clone(),
        };
        Self { shape, ..self.clone() }
    }

    /// Distance [m] of a point from every wall of a box that contains, and the direction away from it, the nearest first.
    fn walls(&self, p: Vector, t: f64) -> Option<[(f64, Vector); 6]> {
        let Shape::Box { center, half, turn } = &self.shape else { return None };
        if !self.inside {
            return None;
        }
        let pose = self.at(t).map_or(Pose::default(), |(pose, _)| pose);
        let (q, half): ([f64; 3], [f64; 3]) = (turn.conj().turn(pose.back(p) - *center).into(), (*half).into());
        let mut walls = [0, 1, 2, 3, 4, 5].map(|k| {
            let (axis, side) = (k / 2, if k % 2 == 0 { 1.0 } else { -1.0 });
            let inward: [f64; 3] = std::array::from_fn(|a| if a == axis { side } else { 0.0 });
            (half[axis] + side * q[axis], pose.turn.turn(turn.turn(inward.into())))
        });
        walls.sort_by(|a, b| a.0.total_cmp(&b.0));
        Some(walls)
    }

    fn near(&self, local: Vector, t: f64, within: f64) -> (f64, Vector, Vector) {
        if self.inside { self.shape.near_walls(local, t, within) } else { self.shape.near(local, t, within) }
    }

    /// The contact of a mass at p at time t, if it is closer than the thickness.
    pub fn touch(&self, p: Vector, t: f64) -> Option<Touch> {
        let place = self.at(t);
        let local = place.map_or(p, |(pose, _)| pose.back(p));
        let (distance, normal, moves) = self.near(local, t, self.thickness);
        let (distance, normal) = if self.inside { (-distance, -normal) } else { (distance, normal) };
        let depth = self.thickness - distance;
        if depth <= 0.0 || normal.norm_sq() == 0.0 {
            return None;
        }
        let slide = moves + self.belt;
        Some(match place {
            None => Touch { depth, normal, velocity: slide },
            Some((pose, twist)) => Touch { depth, normal: pose.turn.turn(normal), velocity: twist.at(p) + pose.turn.turn(slide) },
        })
    }

    /// Distance [m] of a point from where masses may not be, negative inside, and the direction away from it; of no more than a
    /// lower bound beyond `within` [m].
    pub fn distance(&self, p: Vector, t: f64, within: f64) -> (f64, Vector) {
        let place = self.at(t);
        let (distance, normal, _) = self.near(place.map_or(p, |(pose, _)| pose.back(p)), t, within);
        self.outwards(place, distance, normal)
    }

    /// The same of a surface that is nearer than `within` [m]: deep inside a mesh nothing is.
    fn distance_near(&self, p: Vector, t: f64, within: f64) -> Option<(f64, Vector)> {
        let place = self.at(t);
        let local = place.map_or(p, |(pose, _)| pose.back(p));
        let near = self.shape.near_surface(local, t, within);
        near.map(|(distance, normal, _)| self.outwards(place, distance, normal))
    }

    /// What is near its shape, towards where masses may be.
    fn outwards(&self, place: Option<(Pose, Twist)>, distance: f64, normal: Vector) -> (f64, Vector) {
        let normal = place.map_or(normal, |(pose, _)| pose.turn.turn(normal));
        if self.inside { (-distance, -normal) } else { (distance, normal) }
    }

    /// The same with the velocity of the surface [m/s]; a shell is as thick as its thickness.
    pub fn surface(&self, p: Vector, t: f64, within: f64) -> (f64, Vector, Vector) {
        let place = self.at(t);
        let thick =
            if let Shape::Mesh { shell: true, .. } | Shape::Animated { shell: true, .. } = self.shape { self.thickness } else { 0.0 };
        let (distance, normal, moves) = self.near(place.map_or(p, |(pose, _)| pose.back(p)), t, within + thick);
        let slide = moves + self.belt;
        let (normal, velocity) =
            place.map_or((normal, slide), |(pose, twist)| (pose.turn.turn(normal), twist.at(p) + pose.turn.turn(slide)));
        if self.inside { (-distance, -normal, velocity) } else { (distance - thick, normal, velocity) }
    }

    /// First contact with the solid of a mass that moves straight from `from` at time t0 to `to` at t1. A mass that starts touching hits at once if
    /// it moves inward; deeper starts are not handled here.
    pub fn sweep(&self, from: Vector, to: Vector, t0: f64, t1: f64) -> Option<Impact> {
        self.passage(from, to, t0, t1).or_else(|| self.landing(from, to, t0, t1))
    }

    /// A way that ends in touch with a mesh but passes no triangle: the surface counts as flat.
    fn landing(&self, from: Vector, to: Vector, t0: f64, t1: f64) -> Option<Impact> {
        if !matches!(self.shape, Shape::Mesh { .. } | Shape::Animated { .. }) {
            return None;
        }
        let Touch { depth, normal, velocity } = self.touch(to, t1)?;
        let fall = (velocity * (t1 - t0) - (to - from)).dot(normal);
        // Deeper at the start: no matter of a way.
        let flat = fall > 0.0 && depth - fall <= self.thickness + 1e-6 * (1.0 + from.norm());
        flat.then(|| Impact { part: (1.0 - depth / fall).max(0.0), normal, velocity })
    }

    fn passage(&self, from: Vector, to: Vector, t0: f64, t1: f64) -> Option<Impact> {
        let Some((start, twist)) = self.at(t0) else {
            let (part, normal, moves) = self.shape.sweep(from, to, (t0, t1), self.thickness, self.inside)?;
            return Some(Impact { part, normal, velocity: moves + self.belt });
        };
        // Straight in the frame of the solid, piece by piece: the pieces join, so that nothing slips through.
        let spin = |t: f64| self.at(t).map_or(0.0, |(_, twist)| twist.angular.norm());
        // Keyframes begin and end with less than they have between.
        let fastest = twist.angular.norm().max(spin(0.5 * (t0 + t1))).max(spin(t1));
        let pieces = (fastest * (t1 - t0) / TURN).ceil().clamp(1.0, PIECES);
        let mut a = start.back(from);
        let mut before = t0;
        for k in 0..pieces as usize {
            let (s, e) = (k as f64 / pieces, (k + 1) as f64 / pieces);
            let time = t0 + (t1 - t0) * e;
            let Some((pose, _)) = self.at(time) else { break };
            let b = pose.back(from + (to - from) * e);
            if let Some((part, normal, moves)) = self.shape.sweep(a, b, (before, time), self.thickness, self.inside) {
                let part = s + (e - s) * part;
                let (pose, twist) = self.at(t0 + (t1 - t0) * part)?;
                let velocity = twist.at(from + (to - from) * part) + pose.turn.turn(moves + self.belt);
                return Some(Impact { part, normal: pose.turn.turn(normal), velocity });
            }
            (a, before) = (b, time);
        }
        None
    }

    /// Corners of its surface at time t [m], if edges meet it.
    pub fn corners(&self, t: f64) -> Vec<Vector> {
        let Some(mesh) = &self.edges else { return Vec::new() };
        let pose = self.pose(Carrier::Whole, t);
        let place = |v: &[f64; 3]| pose.out(Vector::from(*v));
        match &self.shape {
            Shape::Animated { facets, .. } => facets.vertices(t).iter().map(place).collect(),
            _ => mesh.vertices.iter().map(place).collect(),
        }
    }

    /// Angular velocity of the rigid whole at time t [rad/s].
    pub fn spin(&self, t: f64) -> Vector {
        self.at(t).map_or(Vector::default(), |(_, twist)| twist.angular)
    }

    /// How fast its surface moves along itself at time t [m/s].
    pub fn slip(&self, t: f64) -> Vector {
        self.pose(Carrier::Whole, t).turn.turn(self.belt)
    }

    /// Names of its bones; none if it is no figure.
    pub fn bones(&self) -> &[String] {
        self.rig.as_ref().map_or(&[], |rig| &rig.names)
    }

    /// The bone of a name, for [`bone_pose`](Self::bone_pose).
    pub fn bone(&self, name: &str) -> Option<usize> {
        self.rig.as_ref()?.bone(name)
    }

    /// Pose and motion of a bone at time t: a point attached at p0 when t = 0 is at `pose.out(start.back(p0))`, with the velocity `twist.at` there. A
    /// function of time alone.
    pub fn bone_pose(&self, bone: usize, t: f64) -> Option<(Pose, Twist)> {
        let (pose, twist) = self.rig.as_ref()?.moving(bone, t)?;
        let Some((whole, course)) = self.at(t) else { return Some((pose, twist)) };
        // v = course at x, and the turned velocity in the frame of the figure.
        let angular = whole.turn.turn(twist.angular);
        let linear = whole.turn.turn(twist.linear) - angular.cross(whole.shift) + course.linear;
        let pose = Pose { turn: whole.turn * pose.turn, shift: whole.out(pose.shift) };
        Some((pose, Twist { linear, angular: angular + course.angular }))
    }

    /// Whether it, or its surface, ever moves.
    pub fn moves(&self) -> bool {
        self.motion.is_some() || self.belt.norm_sq() > 0.0 || matches!(self.shape, Shape::Animated { .. })
    }

    /// Largest speed of its surface across itself within `size` [m] of its pivot, from the time t on for h [s].
    pub fn speed(&self, t: f64, h: f64, size: f64) -> f64 {
        let own = if let Shape::Animated { facets, .. } = &self.shape { facets.fastest() } else { 0.0 };
        let Some(motion) = &self.motion else { return own };
        let reach = self.shape.reach(motion.pivot).min(size);
        let at = |t: f64| {
            let (pose, twist) = motion.at(t);
            twist.at(pose.out(motion.pivot)).norm() + twist.angular.norm() * reach
        };
        own + [t, t + 0.5 * h, t + h].into_iter().map(at).fold(0.0, f64::max)
    }

    /// Largest velocity of its surface within `size` [m] of its pivot, over all times [m/s].
    pub fn fastest(&self, size: f64) -> f64 {
        let own = if let Shape::Animated { facets, .. } = &self.shape { facets.fastest() } else { 0.0 };
        own + self.belt.norm() + self.motion.as_ref().map_or(0.0, |m| m.fastest(self.shape.reach(m.pivot).min(size)))
    }
}
