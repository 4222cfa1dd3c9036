//! Contact with the bodies of other systems, which yield: masses visit them one after the other, with a copy of each body's state that all impulses
//! so far have changed, and what a body has got in an interval is posted to its system.                                (coupling.8)
//!
//!   K = 1/m + 1/M + [r]ᵀ I⁻¹ [r],   J = K⁻¹ dv
//!
//! with dv, what the velocity of the mass would change by if the body could not yield. Then both part with the relative velocity that contact with
//! a solid gives, and friction is held within its cone.

use super::contact::{Found, Pass, Step};
use super::core::Core;
use super::feature::Span;
use crate::elements::{Density, Frozen, Samples};
use crate::exchange::{BodyRow, BodyState, Exchange, Turn, Visit};
use crate::geometry::motion::Key;
use crate::geometry::{Collider, Friction, Motion, Vector};
use crate::math::parallel::fold;
use crate::math::{Real, Row, xyz64};
use crate::pool::Hit;
use std::ops::Range;
use std::sync::Arc;

/// The part of their depth by which masses that are held move a body out of themselves in a sub-step.
const PART: f64 = 0.2;
/// How fast they do so at most [m/s].
const FASTEST: f64 = 0.3;
/// A body of another system, as masses of this one have changed it.
struct Visited {
    body: Visit,
    /// Its surface.
    solid: usize,
}

/// The bodies of other systems, and their surfaces.
#[derive(Default)]
pub struct Reaction {
    /// As they were announced, and with a motion.
    announced: Vec<Arc<Collider>>,
    solids: Vec<Collider>,
    bodies: Vec<Visited>,
    /// Volume of each surface [m³], and its samples for each liquid.
    volumes: Vec<f64>,
    samples: Vec<Vec<Option<Arc<Samples>>>>,
    /// Masses that do not touch a body because an anchor ties them to it, in order.
    tied: Vec<(usize, usize)>,
}

impl Visited {
    /// Moves its surface as it moves in a sub-step that begins at the time 0.
    fn lead(&self, solid: &mut Collider) {
        let BodyState { position, orientation, velocity, spin, .. } = self.body.state;
        if let Some(motion) = &mut solid.motion {
            (motion.velocity, motion.spin) = (velocity, spin);
            motion.keys[0] = Key { time: 0.0, shift: position, turn: orientation };
        }
    }

    /// K of its point and a mass of this inverse [1/kg], column by column.
    fn yields(&self, point: Vector, inverse: f64, normal: Vector) -> [Vector; 3] {
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(|e| self.body.yields_to(point, e.into(), normal) + Vector::from(e) * inverse)
    }
}

/// The impulse that changes the velocity of a mass relative to the surface by `change` = K J, which ends its slide, where friction holds that. Else
/// friction is against the slide, against which J need not point. Where a slide makes the body yield along the normal, a quarter of what K has there
/// keeps the divisor above zero.
fn impulse(k: [Vector; 3], change: Vector, normal: Vector, friction: Friction) -> Vector {
    let [a, b, c] = k;
    let (bc, ca, ab) = (b.cross(c), c.cross(a), a.cross(b));
    // K is symmetric: its columns are its rows.
    let full = (bc * change.x + ca * change.y + ab * change.z) * (1.0 / a.dot(bc));
    let press = full.dot(normal);
    let along = full - normal * press;
    if along.norm() <= friction.takes(along.norm(), press.max(0.0)) {
        return full;
    }
    let slide = change - normal * change.dot(normal);
    let direction = normal + slide.normalized() * friction.sliding;
    let gives = a * direction.x + b * direction.y + c * direction.z;
    let least = a * normal.x + b * normal.y + c * normal.z;
    direction * (change.dot(normal).max(0.0) / gives.dot(normal).max(0.25 * least.dot(normal)))
}

impl Reaction {
    /// Takes the bodies of others as they are at the start of an interval; anchors tie masses to bodies.
    pub fn begin(&mut self, exchange: &Exchange, anchors: impl Iterator<Item = (usize, BodyRow)>) {
        let surfaces = exchange.body_surfaces();
        let known = self.announced.iter().zip(surfaces).all(|(known, surface)| Arc::ptr_eq(known, &surface.solid));
        if self.solids.len() != surfaces.len() || !known {
            self.announced = surfaces.iter().map(|surface| surface.solid.clone()).collect();
            let still = Key { time: 0.0, shift: Vector::default(), turn: BodyState::default().orientation };
            let zero = Vector::default();
            let motion = || Motion { velocity: zero, spin: zero, pivot: zero, keys: vec![still], smooth: false };
            self.volumes = surfaces.iter().map(|surface| surface.volume).collect();
            self.samples.clear();
            self.solids = surfaces.iter().map(|surface| Collider { motion: Some(motion()), ..(*surface.solid).clone() }).collect();
        }
        self.bodies.clear();
        for (solid, surface) in surfaces.iter().enumerate() {
            let reach = surface.reach + surface.solid.thickness;
            let present = surface.rows.iter().filter(|at| exchange.state_before(**at).present);
            self.bodies.extend(present.map(|at| Visited { body: Visit::new(exchange, *at, reach), solid }));
        }
        let bodies = &self.bodies;
        let tied =
            |(row, other): (usize, BodyRow)| Some((row, bodies.iter().position(|visited| exchange.is_same(visited.body.at, other))?));
        self.tied = if bodies.is_empty() { Vec::new() } else { anchors.filter_map(tied).collect() };
        self.tied.sort_unstable();
    }

    /// Whether there is nothing to touch.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// The largest speed of a point of a body [m/s].
    pub fn fastest(&self) -> f64 {
        self.bodies.iter().map(|visited| visited.body.fastest()).fold(0.0, f64::max)
    }

    /// Puts bodies into liquids, where a sub-step of h seconds would take them: its sweeps move both.                (liquids.11)
    pub fn immerse(&mut self, core: &mut Core, h: f64) {
        if self.bodies.is_empty() {
            return;
        }
        let Self { solids, bodies, volumes, samples, .. } = self;
        let mut k = 0;
        let mut put = |liquid: &mut Density| {
            if samples.len() == k {
                let one = |(solid, volume): (&Collider, &f64)| Samples::new(&solid.shape, *volume, liquid.spacing()).map(Arc::new);
                samples.push(solids.iter().zip(volumes.iter()).map(one).collect());
            }
            let frozen = |(owner, Visited { body, solid }): (usize, &Visited)| {
                let samples = samples[k][*solid].clone()?;
                let BodyState { position, orientation, mut inverse_mass, mut inverse_inertia, .. } = body.ahead(h);
                if body.stands() {
                    (inverse_mass, inverse_inertia) = Default::default();
                }
                let zero = Vector::default();
                let got = [zero; 3];
                Some(Frozen { samples, owner, position, orientation, inverse_mass, inverse_inertia, got })
            };
            liquid.bodies.clear();
            liquid.bodies.extend(bodies.iter().enumerate().filter_map(frozen));
            k += 1;
        };
        core.constraints.iter_mut().for_each(|c| c.immerse(&mut put));
    }

    /// Gives bodies what liquids have pushed them in the sweeps.
    pub fn emerge(&mut self, core: &Core) {
        for frozen in core.liquids().flat_map(|liquid| &liquid.bodies) {
            let [impulse, moment, angular] = frozen.got;
            if let Some(visited) = self.bodies.get_mut(frozen.owner).filter(|_| impulse != Vector::default()) {
                visited.body.take_all(impulse, moment, angular);
            }
        }
    }

    /// The contact pass of a sub-step: masses that touch a body, in the order of their rows.
    pub fn resolve(&mut self, core: &mut Core, Span { t, h }: Span, lead: f64) {
        if self.bodies.is_empty() {
            return;
        }
        self.bodies.iter_mut().for_each(|visited| visited.body.accelerate(h));
        let observed = core.pool.heeded();
        let step = Step { t: 0.0, h, resting: core.resting_speed(h), lead, observed: false };
        let mut hits = Vec::new();
        for (row, body) in self.near(core, h) {
            if core.state.x[row][3] > 0.0 {
                core.memory.ready &= !self.touch(core, (row, body), &step, &observed, &mut hits);
            } else {
                self.touch_held(core, (row, body), h);
            }
        }
        hits.into_iter().for_each(|(row, hit)| core.pool.note_row(row, Hit { time: t + hit.time, ..hit }));
        self.bodies.iter_mut().for_each(|visited| visited.body.advance(h));
    }

    /// Masses whose way in a sub-step comes within the reach of a body's, and that body.
    fn near(&self, core: &Core, h: f64) -> Vec<(usize, usize)> {
        let Core { state, before, laws, .. } = core;
        // Where a body is at both ends of the step, in the order of the lower ends of x.
        let mut order: Vec<(f64, f64, usize)> = Vec::with_capacity(self.bodies.len());
        for (k, Visited { body, .. }) in self.bodies.iter().enumerate() {
            let (x, way) = (body.state.position.x, body.state.velocity.x * h);
            order.push((x.min(x + way) - body.reach, x.max(x + way) + body.reach, k));
        }
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
        let widest = order.iter().map(|(low, high, _)| high - low).fold(0.0, f64::max);
        let of = |i: usize| {
            let (from, to) = (xyz64(before[i]), xyz64(state.x[i]));
            let (low, high) = (from.x.min(to.x), from.x.max(to.x));
            let first = order.partition_point(|(start, ..)| *start < low - widest);
            let candidates = order[first..].iter().take_while(move |(start, ..)| *start <= high);
            let mut found: Vec<(usize, usize)> = Vec::new();
            for (_, end, k) in candidates {
                let Visited { body, solid } = &self.bodies[*k];
                // In the frame of the body's centre the mass moves straight.
                let (a, b) = (from - body.state.position, to - body.state.position - body.state.velocity * h);
                let way = b - a;
                let s = (-a.dot(way) / way.norm_sq().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
                if *end < low || (a + way * s).norm_sq() > body.reach * body.reach || self.tied.binary_search(&(i, *k)).is_ok() {
                    continue;
                }
                // No point of the surface comes nearer than the mass and the turn of the body go.
                let solid = &self.solids[*solid];
                let within = way.norm() + body.state.spin.norm() * h * body.reach + solid.thickness;
                if solid.shape.near(body.state.orientation.conj().turn(a), 0.0, within).0 <= within {
                    found.push((i, *k));
                }
            }
            found.sort_unstable();
            found
        };
        let all = laws.masses.points().map(|points| {
            let here = |range: Range<usize>| {
                let rows = range.map(|i| points.start + i).filter(|i| laws.masses.mass[*i] > 0.0);
                rows.flat_map(of).collect::<Vec<_>>()
            };
            fold(points.len(), here).concat()
        });
        all.flatten().collect()
    }

    /// Resolves the contact of a mass with a body; says whether there was one.
    fn touch(
        &mut self,
        core: &mut Core,
        (i, k): (usize, usize),
        step: &Step,
        observed: &[Range<usize>],
        hits: &mut Vec<(usize, Hit)>,
    ) -> bool {
        let Core { state, before, before_v, laws, .. } = core;
        let body = &mut self.bodies[k];
        let solid = &mut self.solids[body.solid];
        body.lead(solid);
        let (from, arrives) = (state.x[i], state.v[i]);
        let (mut x, mut v, mut found) = (from, arrives, Found::default());
        let pass = Pass { colliders: std::slice::from_ref(solid), step: *step, penalty: false, observed, counted: &[] };
        if !pass.mass(i, (before[i], before_v[i]), &mut x, &mut v, &mut found) {
            return false;
        }
        let (mass, point, normal) = (f64::from(laws.masses.mass[i]), xyz64(x), found.normal.0);
        let k = body.yields(point, 1.0 / mass, normal);
        // What a solid that does not yield leaves of the slide is for friction, too.
        let left = xyz64(v) - body.body.state.velocity_at(point);
        let change = xyz64(v) - xyz64(arrives);
        let push = if change.dot(normal) > 0.0 {
            impulse(k, change - (left - normal * left.dot(normal)), normal, solid.friction)
        } else {
            Vector::default()
        };
        let after = xyz64(arrives) + push * (1.0 / mass);
        if !after.norm_sq().is_finite() {
            return false;
        }
        hits.extend(found.hits.into_iter().map(|(row, hit)| (row, Hit { v: hit.v + after - xyz64(v), ..hit })));
        // The surface goes on with what it has got.
        let place = point + (after - xyz64(v)) * step.h;
        let real = |v: Vector, last: Real| -> Row { [v.x as Real, v.y as Real, v.z as Real, last] };
        (state.x[i], state.v[i]) = (real(place, x[3]), real(after, 0.0));
        // From what states hold, so that nothing is lost.
        let [(x0, v0), (x1, v1)] = [(from, arrives), (state.x[i], state.v[i])].map(|(x, v)| (xyz64(x), xyz64(v)));
        body.body.take(point, (v0 - v1) * mass, (x0.cross(v0) - x1.cross(v1)) * mass, normal);
        true
    }

    /// A mass that is held, or led, gives a body all of its own velocity.
    fn touch_held(&mut self, core: &Core, (i, k): (usize, usize), h: f64) {
        let body = &mut self.bodies[k];
        let solid = &mut self.solids[body.solid];
        body.lead(solid);
        let (point, velocity) = (xyz64(core.state.x[i]), xyz64(core.state.v[i]));
        let Some(touch) = solid.touch(point, h) else { return };
        let (n, relative) = (touch.normal, velocity - touch.velocity);
        let lack = (PART * touch.depth / h).min(FASTEST) - relative.dot(n);
        if lack <= 0.0 {
            return;
        }
        let change = n * lack - (relative - n * relative.dot(n));
        let push = -impulse(body.yields(point, 0.0, n), change, n, solid.friction);
        if push.norm_sq().is_finite() {
            body.body.take(point, push, point.cross(push), n);
        }
    }

    /// Posts what bodies have got.
    pub fn end(&self, exchange: &mut Turn<'_>) {
        self.bodies.iter().for_each(|visited| visited.body.post(exchange));
    }
}
