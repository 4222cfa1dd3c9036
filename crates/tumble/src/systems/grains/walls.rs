//! Contact of grains with solids, and with rigid bodies, which yield.

mod by_positions;

pub use by_positions::HardTouched;

use super::kick::{Kick, QUICK};
use super::law::{Dampings, Material, Memory, Overlap, Pair};
use super::list::{Four, point};
use crate::exchange::{BodyState, Exchange, Turn, Visit};
use crate::geometry::{Collider, Friction, Search, Shape, Vector};
use crate::math::Row;
use crate::math::parallel::Tasks;
use std::sync::Arc;
use tumble_interface::scene::NormalLaw;

/// Surfaces of a solid that a grain touches at once, if it may have an inner corner.
const SURFACES: usize = 3;
/// Least product of the normals before and after a step of what is the same contact.
const SAME: f64 = 0.5;

/// A contact of a grain with a surface.
#[derive(Debug, Clone, Copy)]
pub struct WallContact {
    pub row: u32,
    pub surface: u32,
    /// Towards the grain.
    pub normal: Vector,
    pub memory: Memory,
    pub depth: f64,
    /// By positions: whether nothing has pressed it in the step before.
    pub fresh: bool,
}

/// What a body gets: its number, the place, force [N], couple [N m] and the normal away from it.
#[derive(Debug, Clone, Copy)]
struct Push {
    body: usize,
    point: Vector,
    force: Vector,
    couple: Vector,
    normal: Vector,
}

/// A body that grains meet.
#[derive(Debug)]
struct Body {
    visit: Visit,
    shape: usize,
    /// What velocity and spin gain until the time of the next forces, and half of what the last forces gave both.
    gains: [Vector; 2],
    last: [Vector; 2],
    /// By positions: its state with the impulses of the last pass, and how many grains touch it.
    ahead: BodyState,
    touches: u32,
}

/// The walls of a chunk.
#[derive(Debug, Default)]
struct Part {
    /// Grains that may touch a surface, and that, in order.
    candidates: Vec<[u32; 2]>,
    contacts: Vec<WallContact>,
    pushes: Vec<Push>,
}

/// Rows of grains that walls touch, and what walls add to.
pub struct Touched<'a> {
    pub x: &'a [Four],
    pub v: &'a [Four],
    pub w: &'a [Four],
    /// `Bed::quick`.
    pub quick: &'a [Row],
    pub force: &'a mut [Four],
    pub torque: &'a mut [Four],
    /// Rows of a chunk.
    pub chunk: usize,
}

/// Solids and bodies that grains meet. Surfaces are counted through: first solids, then bodies.
#[derive(Debug, Default)]
pub struct Walls {
    /// As they were published, and as grains meet them: meshes by their triangles.
    published: Arc<Vec<Collider>>,
    solids: Vec<Collider>,
    /// The pair of each solid, or surface of bodies, with each kind of grains.
    pairs: Vec<Pair>,
    /// The surfaces of bodies; the bodies, and the surface of each.
    shapes: Vec<Arc<Collider>>,
    bodies: Vec<Body>,
    parts: Vec<Part>,
    /// Material of each kind of grains.
    kinds: Vec<Material>,
    law: NormalLaw,
}

/// A solid as a material: it does not yield.
fn material(solid: &Collider) -> Material {
    let Collider { friction, restitution, .. } = *solid;
    // What changes in time is asked for then.
    let friction = if solid.rubbing.is_some() { Friction::default() } else { friction };
    Material { young: f64::INFINITY, poisson: 0.0, friction, resists: [0.0; 2], restitution, cohesion: 0.0 }
}

impl Walls {
    /// For grains of these kinds.
    pub fn new(law: NormalLaw, kinds: Vec<Material>) -> Self {
        Self { law, kinds, ..Self::default() }
    }

    fn pairs_of<'a>(&self, solids: impl Iterator<Item = &'a Collider>) -> Vec<Pair> {
        let (mut pairs, mut dampings) = (Vec::new(), Dampings::default());
        for wall in solids.map(material) {
            pairs.extend(self.kinds.iter().map(|kind| Pair::new(self.law, kind, &wall, &mut dampings)));
        }
        pairs
    }

    /// Takes over solids that others have published.
    pub fn meet(&mut self, solids: &Arc<Vec<Collider>>) {
        if Arc::ptr_eq(solids, &self.published) {
            return;
        }
        // The distance of a grid is off by parts of its cells, more than a grain may overlap.
        (self.published, self.solids) = (solids.clone(), solids.iter().map(Collider::by_triangles).collect());
        self.pairs = self.pairs_of(self.solids.iter().chain(self.shapes.iter().map(|shape| &**shape)));
    }

    /// Takes the bodies of others as they are at the start of an interval.
    pub fn visit(&mut self, exchange: &Exchange) {
        let surfaces = exchange.body_surfaces();
        let known = self.shapes.iter().zip(surfaces).all(|(known, surface)| Arc::ptr_eq(known, &surface.solid));
        if self.shapes.len() != surfaces.len() || !known {
            self.shapes = surfaces.iter().map(|surface| surface.solid.clone()).collect();
            self.pairs = self.pairs_of(self.solids.iter().chain(self.shapes.iter().map(|shape| &**shape)));
        }
        self.bodies.clear();
        for (shape, surface) in surfaces.iter().enumerate() {
            let reach = surface.reach + surface.solid.thickness;
            let body = |at: &_| {
                let visit = Visit::new(exchange, *at, reach);
                Body { ahead: visit.state, visit, shape, gains: Default::default(), last: Default::default(), touches: 0 }
            };
            self.bodies.extend(surface.rows.iter().map(body));
        }
    }

    /// How many solids there are.
    pub fn solids(&self) -> usize {
        self.solids.len()
    }

    /// How many surfaces there are, those of bodies after those of solids.
    pub fn surfaces(&self) -> usize {
        self.solids.len() + self.bodies.len()
    }

    /// Name of a surface.
    pub fn name(&self, surface: u32) -> Option<&str> {
        match self.solids.get(surface as usize) {
            Some(solid) => Some(&solid.name),
            None => Some(&self.shapes[self.bodies.get(surface as usize - self.solids.len())?.shape].name),
        }
    }

    /// The largest speed of a surface, within this distance [m] of the origin, from the time t on for h [s].
    pub fn fastest(&self, t: f64, h: f64, size: f64) -> f64 {
        let of = |solid: &Collider| solid.speed(t, h, size + solid.motion.as_ref().map_or(0.0, |motion| motion.pivot.norm()));
        let solids = self.solids.iter().filter(|solid| solid.moves()).map(of);
        solids.chain(self.bodies.iter().map(|body| body.visit.fastest())).fold(0.0, f64::max)
    }

    /// Calls `f` with the distance [m] of a point from each side of a surface that is nearer than `within` [m], and the direction away from it; see
    /// [`Search`] for `deep`.
    pub fn each_near(&self, surface: usize, p: Vector, t: f64, (within, deep): (f64, bool), mut f: impl FnMut(f64, Vector)) {
        let search = |solid: &Collider| {
            let corners = solid.inside || matches!(solid.shape, Shape::Animated { .. });
            Search { within, thickness: 0.0, surfaces: if corners { SURFACES } else { 1 }, deep }
        };
        if let Some(solid) = self.solids.get(surface) {
            return solid.each_near(p, t, search(solid), f);
        }
        let Body { visit, shape, .. } = &self.bodies[surface - self.solids.len()];
        let state = &visit.state;
        let local = state.orientation.conj().turn(p - state.position);
        let shape = &self.shapes[*shape];
        shape.each_near(local, 0.0, search(shape), |distance, normal| f(distance, state.orientation.turn(normal)));
    }

    /// Velocity of a surface at a point on it [m/s].
    fn velocity(&self, surface: usize, p: Vector, t: f64) -> Vector {
        match self.solids.get(surface) {
            Some(solid) if solid.moves() => solid.surface(p, t, f64::INFINITY).2,
            Some(_) => Vector::default(),
            None => self.bodies[surface - self.solids.len()].visit.state.velocity_at(p),
        }
    }

    /// What the velocity of a surface at a point, and its spin, gain until the time of the forces; those of solids are of that time.
    fn gains(&self, surface: usize, p: Vector) -> [Vector; 2] {
        let Some(Body { visit, gains: [velocity, spin], .. }) = surface.checked_sub(self.solids.len()).map(|k| &self.bodies[k]) else {
            return Default::default();
        };
        [*velocity + spin.cross(p - visit.state.position), *spin]
    }

    /// Angular velocity of a surface [rad/s].
    fn spin(&self, surface: usize, t: f64) -> Vector {
        match self.solids.get(surface) {
            Some(solid) => solid.spin(t),
            None => self.bodies[surface - self.solids.len()].visit.state.spin,
        }
    }

    /// Seeks candidates anew; `places` are the rows of grains that had others before.
    pub fn rebuild(&mut self, x: &[Four], rows_each: usize, t: f64, slack: f64, places: &[u32]) {
        let mut kept: Vec<WallContact> = self.contacts().map(|c| WallContact { row: places[c.row as usize], ..*c }).collect();
        // Of several contacts with one surface the order stays.
        kept.sort_by_key(|contact| [contact.row, contact.surface]);
        let surfaces = self.surfaces();
        let walls = &*self;
        let chunk = |start: usize| {
            let rows = start..(start + rows_each).min(x.len());
            let mut part = Part::default();
            for row in rows.clone() {
                let (p, radius) = (point(&x[row]), x[row][3]);
                for surface in 0..surfaces {
                    let body = surface.checked_sub(walls.solids.len()).map(|k| &walls.bodies[k].visit);
                    let reach = radius + slack;
                    if body.is_some_and(|visit| !visit.state.present || (p - visit.state.position).norm() > visit.reach + reach) {
                        continue;
                    }
                    let mut near = false;
                    walls.each_near(surface, p, t, (reach, false), |distance, _| near |= distance < reach);
                    if near {
                        part.candidates.push([row as u32, surface as u32]);
                    }
                }
            }
            let [first, end] = [rows.start, rows.end].map(|row| kept.partition_point(|contact| (contact.row as usize) < row));
            part.contacts = kept[first..end].to_vec();
            part
        };
        self.parts = (0..x.len()).step_by(rows_each).map_in_parallel(chunk);
    }

    /// The contact pass: adds what surfaces do to grains.
    pub fn press(&mut self, rows: Touched<'_>, t: f64, h: f64) {
        let mut parts = std::mem::take(&mut self.parts);
        let (walls, Touched { x, v, w, quick, force, torque, chunk: each }) = (&*self, rows);
        parts.iter_mut().zip(force.chunks_mut(each)).zip(torque.chunks_mut(each)).enumerate().in_parallel(
            |(c, ((part, force), torque))| {
                let before = std::mem::take(&mut part.contacts);
                let mut old = before.as_slice();
                part.pushes.clear();
                for [row, surface] in &part.candidates {
                    let (i, s) = (*row as usize, *surface as usize);
                    let key = [*row, *surface];
                    let first = old.partition_point(|c| [c.row, c.surface] < key);
                    let end = old.partition_point(|c| [c.row, c.surface] <= key);
                    let same = &old[first..end];
                    old = &old[end..];
                    let mut taken = 0_u32;
                    let (p, radius, [inverse, kind]) = (point(&x[i]), x[i][3], [v[i][3], w[i][3]]);
                    walls.each_near(s, p, t, (radius, false), |distance, normal| {
                        let depth = radius - distance;
                        if depth <= 0.0 {
                            return;
                        }
                        let like = |k: &usize| same[*k].normal.dot(normal);
                        let free = (0..same.len().min(32)).filter(|k| taken & 1 << k == 0 && like(k) > SAME);
                        let known = free.max_by(|a, b| like(a).total_cmp(&like(b)));
                        taken |= known.map_or(0, |k| 1 << k);
                        let mut memory = known.map_or_else(Memory::default, |k| same[k].memory);
                        let (arm, spin) = (-normal * (radius - depth), point(&w[i]));
                        let place = p + arm;
                        let body = s.checked_sub(walls.solids.len()).map(|k| (k, &walls.bodies[k]));
                        let yields = body.map_or(0.0, |(_, body)| body.visit.yields_to(place, normal, normal).dot(normal).max(0.0));
                        let [gain, turn] = [2, 3].map(|c| point(&quick[QUICK * i + c].map(f64::from)));
                        let gains = walls.gains(s, place);
                        let at = Overlap {
                            depth,
                            normal: -normal,
                            velocity: walls.velocity(s, place, t) - point(&v[i]) - spin.cross(arm),
                            gain: gains[0] - gain - turn.cross(arm),
                            spins: [spin, walls.spin(s, t)],
                            spin_gain: gains[1] - turn,
                            radii: [radius, f64::INFINITY],
                            radius,
                            lever: radius - depth,
                            mass: 1.0 / (inverse + yields),
                            inverse_mass: inverse + yields,
                        };
                        let Some(pair) = walls.pair(s, kind as usize, t) else { return };
                        let answer = pair.answer(&at, h, &mut memory, pair.resists_turns());
                        let local = i - c * each;
                        let moment = arm.cross(answer.force) + answer.moment;
                        add(&mut force[local], answer.force);
                        add(&mut torque[local], moment);
                        part.contacts.push(WallContact { row: *row, surface: *surface, normal, memory, depth, fresh: false });
                        if let Some((body, _)) = body {
                            part.pushes.push(Push { body, point: place, force: -answer.force, couple: -answer.moment, normal });
                        }
                    });
                }
            },
        );
        self.parts = parts;
    }

    /// The pair of a surface and a kind of grains; none of a surface that there is not.
    fn pair(&self, surface: usize, kind: usize, t: f64) -> Option<Pair> {
        let solid = self.solids.get(surface);
        let place = if solid.is_some() { surface } else { self.solids.len() + self.bodies.get(surface - self.solids.len())?.shape };
        let pair = *self.pairs.get(place * self.kinds.len() + kind)?;
        Some(match solid {
            Some(solid) if solid.rubbing.is_some() => pair.with_friction(solid.friction_at(t)),
            _ => pair,
        })
    }

    /// Bodies have the forces of the last pass, and their own acceleration.
    pub fn kick(&mut self, kick: Kick) {
        let h = kick.h;
        let before: Vec<[Vector; 2]> = self.bodies.iter().map(|body| [body.visit.state.velocity, body.visit.state.spin]).collect();
        self.bodies.iter_mut().for_each(|body| body.visit.accelerate(h));
        for push in self.parts.iter().flat_map(|part| &part.pushes) {
            self.bodies[push.body].visit.take_couple(push.point, push.force * h, push.couple * h, push.normal);
        }
        for (Body { visit, gains, last, .. }, before) in self.bodies.iter_mut().zip(before) {
            let after = [visit.state.velocity, visit.state.spin];
            for k in 0..2 {
                [gains[k], last[k]] = kick.gain((after[k] - before[k]) * (1.0 / h), last[k]);
            }
        }
    }

    /// Bodies move for h [s].
    pub fn drift(&mut self, h: f64) {
        self.bodies.iter_mut().for_each(|body| body.visit.advance(h));
    }

    /// Posts what bodies have got.
    pub fn post(&self, exchange: &mut Turn<'_>) {
        self.bodies.iter().for_each(|body| body.visit.post_timed(exchange));
    }

    /// All contacts, by rows.
    pub fn contacts(&self) -> impl Iterator<Item = &WallContact> {
        self.parts.iter().flat_map(|part| &part.contacts)
    }

    /// Takes over contacts, in the order of `contacts`, to rebuild from.
    pub fn remember(&mut self, contacts: Vec<WallContact>) {
        self.parts = vec![Part { contacts, ..Part::default() }];
    }

    /// What a contact stores [J]; `radius` [m] and kind are those of its grain.
    pub fn energy(&self, contact: &WallContact, radius: f64, kind: f64, t: f64) -> f64 {
        let pair = self.pair(contact.surface as usize, kind as usize, t);
        pair.map_or(0.0, |pair| pair.energy(contact.depth, [radius, f64::INFINITY], &contact.memory))
    }
}

/// Adds a vector to the first three numbers.
#[inline(always)]
pub fn add(to: &mut Four, v: Vector) {
    to[0] += v.x;
    to[1] += v.y;
    to[2] += v.z;
}
