//! Masses under forces: x'' = f(x, v, t)/m, stepped by any integrator. Points and frames, elements between them, forces
//! on each, contact with solids.

mod account;
mod batches;
mod build;
mod contact;
mod followers;
mod hair_continuum;
mod implicit;
mod laws;
mod ledger;
mod life;
mod modes;
mod position_based;
mod self_contact;
mod solid_features;
mod tear;

pub use build::{Closed, Liquid, Parts, Settings, SpringPart};
pub use tear::TearPart;

use crate::elements::{Constraints, Limit, Linear, LongRangeAttachments, Projected, Projection};
use crate::exchange::{Exchange, Port};
use crate::geometry::{Vector, Walls};
use crate::integrators::{self, Equation, Memory, Scratch, Step, adaptive_step};
use crate::math::parallel::{CHUNK, Tasks, sum};
use crate::math::{Real, Row, Vec3, ZERO, axpy, row, sub, xyz64};
use crate::pool::{Hit, Pool};
use crate::state::{Object, State};
use crate::system::{Archive, Part, System};
use followers::Follower;
use laws::{Laws, Local, flat};
use self_contact::SelfContact;
use tumble_interface::engine::{Ledger, Share, Stability, StepReport, UserForce, UserIntegrator, Worst};
use tumble_interface::scene::{Adaptive, Integrator, PositionBased};
use tumble_interface::{Column, StepError};

/// Rows of masses that do not feel each other which are stepped together: 24 KB in single precision, with accelerations.
const BLOCK: usize = 512;

/// Sub-steps of an exchange interval beyond which a step counts as too small.
pub const MOST_SUBSTEPS: f64 = 1e7;

/// How an exchange interval is divided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stepping {
    /// Into this many equal sub-steps.
    Substeps(u32),
    /// Into equal sub-steps no longer than this [s].
    Step(f64),
    /// Into as many as 0.7 of the stability limit asks for.
    Automatic,
}

/// A system of masses.
pub struct Dynamics {
    name: String,
    index: usize,
    integrator: Integrator,
    stepping: Stepping,
    /// Sub-steps that automatic stepping has chosen; 0 before the first interval.
    automatic: u32,
    /// Rows when it chose them.
    measured: usize,
    adaptive: Adaptive,
    state: State,
    laws: Laws,
    objects: Vec<Object>,
    /// Particles that are born and die; their rows are the last.
    pool: Pool,
    /// Batches between masses of some objects, with these objects and others that they name.
    between: Vec<(usize, Vec<usize>, Option<Vec<usize>>)>,
    anchors: Vec<Anchor>,
    clamp: Option<Projected<Limit, Linear, 2, 1, 1, 0>>,
    /// Elements of a position-based system, which are no forces there.
    constraints: Vec<Box<dyn Constraints>>,
    sweeps: PositionBased,
    attachments: Vec<LongRangeAttachments>,
    self_contact: Option<SelfContact>,
    /// What counts as passing through each other where nothing keeps it from doing so, if that is asked for.
    intersection_counter: Option<SelfContact>,
    /// Surfaces that tear.
    tears: Vec<tear::Tear>,
    /// Points that follow colliders.
    followers: Vec<Follower>,
    hair: Vec<hair_continuum::HairContinuum>,
    user: Option<Box<dyn UserIntegrator>>,
    memory: Memory,
    scratch: Scratch,
    /// Positions and velocities at the start of a sub-step, for contact.
    before: Vec<Row>,
    before_v: Vec<Row>,
    /// Positions before the clamp.
    unclamped: Vec<Row>,
    /// Accelerations of the predicted velocities; scratch.
    rates: Vec<Row>,
    /// What the energy is measured against, and the energy at the start [J].
    scale: ledger::Scale,
    broken: u64,
    /// Whether other systems push masses of this one.
    pushed: bool,
    watched: bool,
    /// Time and state before the sub-step, while watched.
    witness: Option<(f64, Vec<Row>, Vec<Row>)>,
}

/// A damped spring to a port of another system, as impulses at the start of each sub-step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Anchor {
    /// The mass of this system.
    pub row: usize,
    /// The mass of the other.
    pub port: Port,
    /// Spring constant [N/m].
    pub stiffness: f64,
    /// Damping along the spring [N s/m].
    pub damping: f64,
    /// Rest length [m].
    pub rest_length: f64,
}

impl Dynamics {
    /// Hangs a mass of this system on a mass of another.
    pub fn add_anchor(&mut self, anchor: Anchor) {
        self.anchors.push(anchor);
        self.pushed = true;
    }

    /// Other systems will push masses of this one.
    pub fn expect_pushes(&mut self) {
        self.pushed = true;
    }

    /// Speed that gravity gives in two steps: slower impacts do not bounce.
    fn resting_speed(&self, h: f64) -> f64 {
        2.0 * h * Vec3::from(self.laws.gravity).norm()
    }

    /// Sub-steps of an interval of length dt; any number if `go_on` says no.
    fn substeps(&mut self, dt: f64, go_on: &(dyn Fn() -> bool + Sync)) -> f64 {
        match self.stepping {
            Stepping::Substeps(n) => f64::from(n),
            Stepping::Step(step) => integrators::equal_steps(dt, step),
            // A crowd that has grown may have another limit.
            Stepping::Automatic if self.automatic > 0 && self.state.x.len() <= 2 * self.measured => f64::from(self.automatic),
            Stepping::Automatic => {
                let limit = if self.integrator.is_implicit() { f64::INFINITY } else { self.limit(go_on) };
                let n = if limit > 0.0 { (dt / (0.7 * limit)).ceil().max(1.0) } else { 1.0 };
                // What has no masses yet has no limit to keep to later.
                if n <= MOST_SUBSTEPS && !self.state.x.is_empty() {
                    (self.automatic, self.measured) = (n as u32, self.state.x.len());
                }
                n
            }
        }
    }

    /// Largest usable step of the integrator in use [s].
    fn limit(&mut self, go_on: &(dyn Fn() -> bool + Sync)) -> f64 {
        self.modes(go_on).map_or(f64::INFINITY, |modes| integrators::stability::limits(self.integrator, &modes.list()).1)
    }

    /// Springs to other systems: half of the interaction that this system owns. Each is an impulse h f, so what one side
    /// gets the other loses, whatever the integrator.
    fn apply_anchors(&mut self, h: f64, exchange: &mut Exchange) {
        for k in 0..self.anchors.len() {
            let anchor = self.anchors[k];
            let other = exchange.port(anchor.port);
            let (x, v) = (xyz64(self.state.x[anchor.row]), xyz64(self.state.v[anchor.row]));
            // The state as published: carrying it on to t would insert_births a partner's kick an interval late.
            let d = other.position - x;
            let length = d.norm();
            let n = d.normalized();
            let pull = anchor.stiffness * (length - anchor.rest_length) + anchor.damping * n.dot(other.velocity - v);
            let impulse = n * (h * pull);
            exchange.post(anchor.port, -impulse);
            self.push(anchor.row, impulse);
        }
    }

    fn push(&mut self, i: usize, impulse: Vec3<f64>) {
        let w = f64::from(self.laws.masses.inverse(i, &self.state.x));
        let dv = impulse * w;
        self.state.v[i] = axpy(self.state.v[i], 1.0, row(Vec3 { x: dv.x as Real, y: dv.y as Real, z: dv.z as Real }, 0.0));
        self.memory.ready = false;
    }

    /// One sub-step of a scheme with a fixed step, contact, clamp and breaking included.
    fn substep(&mut self, t: f64, h: f64, report: &mut StepReport) -> Result<(), StepError> {
        let (x, v) = (&self.state.x, &mut self.state.v);
        self.hair.iter_mut().for_each(|continuum| continuum.act(h, x, v));
        self.lead_followers(t, h);
        self.remember(t, h);
        self.memory.ready &= self.followers.is_empty() && self.hair.is_empty();
        let mut user = self.user.take();
        let result = match &mut user {
            Some(user) => self.user_step(user.as_mut(), t, h),
            None if self.integrator == Integrator::PositionBased => self.project_step(t, h, report),
            None => {
                let (equation, x, v, ready) = (&mut self.laws, &mut self.state.x, &mut self.state.v, self.memory.ready);
                let (memory, scratch) = (&mut self.memory.slices(), &mut self.scratch);
                integrators::step(self.integrator, Step { equation, t, h, x, v, memory, ready, scratch, report })
            }
        };
        self.user = user;
        result?;
        self.memory.ready = true;
        report.stepped(h);
        self.after(t, h, report);
        Ok(())
    }

    /// Keeps what contact and clamp compare with in a step of at most h [s]; who may meet whom in it, for schemes that do not ask themselves.
    fn remember(&mut self, t: f64, h: f64) {
        if self.integrator != Integrator::PositionBased {
            self.find_pairs(t, h);
        }
        // Where positions are predicted, they are kept then.
        let predicted = self.integrator == Integrator::PositionBased && self.user.is_none();
        if !predicted && (!self.laws.colliders.is_empty() || self.self_contact.is_some()) {
            self.before.resize(self.state.x.len(), ZERO);
            self.before.copy_from_slice(&self.state.x);
        }
        if !self.laws.colliders.is_empty() {
            self.before_v.resize(self.state.x.len(), ZERO);
            self.before_v.copy_from_slice(&self.state.v);
        }
    }

    /// What follows a step of length h from t on: clamp, contact, breaking. Whatever it changes, the scheme starts anew from.
    fn after(&mut self, t: f64, h: f64, report: &mut StepReport) {
        self.place_followers(t + h);
        if let Some(clamp) = self.clamp.as_mut().filter(|_| self.integrator != Integrator::PositionBased) {
            let masses = &self.laws.masses;
            let one = |v: &[Row], i: usize| 0.5 * f64::from(masses.mass[i]) * xyz64(v[i]).norm_sq();
            let kinetic = |v: &[Row]| sum(masses.points, |range| range.map(|i| one(v, i)).sum());
            let energy = |state: &State| kinetic(&state.v) + self.laws.batches.iter().map(|b| b.energy(&state.x)).sum::<f64>();
            let was = energy(&self.state);
            self.unclamped.clone_from(&self.state.x);
            let projection = Projection { h, before: &self.unclamped, iteration: 0, iterations: 1, plain: None, walls: Walls::default() };
            clamp.project(&mut self.state.x, &projection);
            let inverse_h = (1.0 / h) as Real;
            let mut moved = false;
            for i in 0..masses.points {
                let change = sub(self.state.x[i], self.unclamped[i]);
                if change != ZERO {
                    self.state.v[i] = axpy(self.state.v[i], inverse_h, change);
                    moved = true;
                }
            }
            if moved {
                self.memory.ready = false;
                report.clamped += was - energy(&self.state);
            }
        }
        if self.integrator != Integrator::PositionBased {
            self.separate(t, h);
        }
        if !self.laws.colliders.is_empty() {
            let heeded = self.pool.heeded();
            // Users' schemes are unknown, and what the penalty pushes has no constant acceleration.
            let lead = if self.user.is_some() || self.laws.penalty { 0.0 } else { integrators::lead(self.integrator) };
            let step = contact::Step { t, h, resting: self.resting_speed(h), lead, heeded: false };
            let penalty = self.laws.penalty && self.user.is_none();
            let points = self.laws.masses.points;
            let (colliders, before, before_v) = (&self.laws.colliders[..], &self.before, &self.before_v);
            let touched: Vec<(bool, Vec<(usize, Hit)>)> =
                self.state.x[..points].chunks_mut(CHUNK).zip(self.state.v[..points].chunks_mut(CHUNK)).enumerate().map_in_parallel(
                    |(c, (x, v))| {
                        let (mut any, mut hits) = (false, Vec::new());
                        for (k, (x, v)) in x.iter_mut().zip(v).enumerate() {
                            let i = c * CHUNK + k;
                            let step = contact::Step { heeded: heeded.iter().any(|rows| rows.contains(&i)), ..step };
                            if x[3] > 0.0 {
                                let (was, told) = ((before[i], before_v[i]), |hit| hits.push((i, hit)));
                                any |= if penalty {
                                    contact::bounce(colliders, &step, was, x, v, told)
                                } else {
                                    contact::resolve(colliders, &step, was, x, v, told)
                                };
                            }
                        }
                        (any, hits)
                    },
                );
            for (any, hits) in touched {
                self.memory.ready &= !any;
                hits.into_iter().for_each(|(row, hit)| self.pool.note_row(row, hit));
            }
        }
        self.limit_impacts(h);
        let x = &self.state.x;
        let broken: u64 = self.laws.batches.iter_mut().map(|b| b.break_links(x)).sum::<u64>()
            + self.constraints.iter_mut().map(|c| c.break_links(x)).sum::<u64>();
        if broken > 0 {
            report.broken += broken;
            self.broken += broken;
            self.memory.ready = false;
        }
        self.tear(report);
    }

    fn user_step(&mut self, user: &mut dyn UserIntegrator, t: f64, h: f64) -> Result<(), StepError> {
        let n = self.laws.masses.points;
        let (mut x, mut v) = (flat(&self.state.x[..n]), flat(&self.state.v[..n]));
        let (state, laws) = (&self.state, &mut self.laws);
        let mut acceleration = |t: f64, x: &[f64], v: &[f64]| -> Result<Vec<f64>, String> {
            if x.len() != 3 * n || v.len() != 3 * n {
                return Err(format!("acceleration takes {n} rows of three numbers"));
            }
            let rows = |from: &[f64], old: &[Row]| -> Vec<Row> {
                let new = from.chunks_exact(3).zip(old).map(|(p, o)| [p[0] as Real, p[1] as Real, p[2] as Real, o[3]]);
                new.chain(old[n..].iter().copied()).collect()
            };
            let mut out = vec![ZERO; state.x.len()];
            laws.rate(t, &rows(x, &state.x), &rows(v, &state.v), &mut out).map_err(|e| e.to_string())?;
            Ok(flat(&out[..n]))
        };
        user.step(t, h, &mut x, &mut v, &mut acceleration).map_err(StepError::User)?;
        for i in 0..n {
            if self.state.x[i][3] > 0.0 {
                let take = |from: &[f64], w: Real| [from[3 * i] as Real, from[3 * i + 1] as Real, from[3 * i + 2] as Real, w];
                self.state.x[i] = take(&x, self.state.x[i][3]);
                self.state.v[i] = take(&v, 0.0);
            }
        }
        Ok(())
    }

    /// All sub-steps of an interval, block by block, where no mass feels another: every number is then read and written
    /// once an interval, and the scratch of any scheme stays in the first cache.
    fn advance_local(&mut self, t: f64, h: f64, substeps: u32, go_on: &(dyn Fn() -> bool + Sync)) -> Result<(), StepError> {
        let (scheme, resting) = (self.integrator, self.resting_speed(h));
        let lead = integrators::lead(scheme);
        let (laws, colliders, state) = (&self.laws, &self.laws.colliders[..], &mut self.state);
        let mut memory: Vec<Vec<&mut [Row]>> = Vec::new();
        memory.resize_with(state.x.len().div_ceil(BLOCK), Vec::new);
        for column in &mut self.memory.columns {
            for (part, rows) in memory.iter_mut().zip(column.chunks_mut(BLOCK)) {
                part.push(rows);
            }
        }
        let was_ready = self.memory.ready;
        let heeded = self.pool.heeded();
        let mut blocks: Vec<_> = state.x.chunks_mut(BLOCK).zip(state.v.chunks_mut(BLOCK)).zip(memory).enumerate().collect();
        let results = blocks.chunks_mut(CHUNK / BLOCK).map_in_parallel(|blocks| {
            let scratch = &mut Scratch::default();
            let moved = blocks.iter_mut().map(|(c, ((x, v), memory))| {
                let start = *c * BLOCK;
                let mut motion = Local { laws, masses: &laws.masses, start, newborn: None };
                let points = motion.kinematics().points;
                let (mut ready, mut before, mut before_v, mut hits) = (was_ready, Vec::new(), Vec::new(), Vec::new());
                for k in 0..substeps {
                    if k % 64 == 63 && !go_on() {
                        return Ok((false, hits));
                    }
                    if !colliders.is_empty() {
                        before.clear();
                        before.extend_from_slice(x);
                        before_v.clear();
                        before_v.extend_from_slice(v);
                    }
                    let (t, equation, report) = (t + f64::from(k) * h, &mut motion, &mut StepReport::default());
                    integrators::step(scheme, Step { equation, t, h, x, v, memory, ready, scratch, report })?;
                    ready = true;
                    for i in 0..before.len().min(points) {
                        let step = contact::Step { t, h, resting, lead, heeded: heeded.iter().any(|rows| rows.contains(&(start + i))) };
                        let (was, told) = ((before[i], before_v[i]), |hit| hits.push((start + i, hit)));
                        if x[i][3] > 0.0 && contact::resolve(colliders, &step, was, &mut x[i], &mut v[i], told) {
                            ready = false;
                        }
                    }
                }
                Ok((ready, hits))
            });
            moved.collect::<Result<Vec<_>, StepError>>()
        });
        self.memory.ready = true;
        for (ready, hits) in results.into_iter().collect::<Result<Vec<_>, _>>()?.concat() {
            self.memory.ready &= ready;
            hits.into_iter().for_each(|(row, hit)| self.pool.note_row(row, hit));
        }
        Ok(())
    }

    /// What a constant force over the next interval gives in all [N s].
    fn push_steadily(&mut self, row: usize, impulse: Vector) {
        let steady = &mut self.laws.steady;
        match steady.binary_search_by_key(&row, |(row, _)| *row) {
            Ok(at) => steady[at].1 = steady[at].1 + impulse,
            Err(at) => steady.insert(at, (row, impulse)),
        }
        self.memory.ready = false;
    }

    /// The normal of the nearest solid that a point leans on, zero if there is none.
    fn touched(&self, x: Vector, t: f64) -> Vector {
        let gap = |collider: &crate::geometry::Collider| {
            let thick = collider.thickness;
            let (distance, normal) = collider.distance(x, t, 2.0 * thick);
            (distance <= thick * (1.0 + 1e-3)).then_some((distance - thick, normal))
        };
        let nearest = self.laws.colliders.iter().filter_map(gap).reduce(|a, b| if b.0 < a.0 { b } else { a });
        nearest.map_or(Vector::default(), |(_, normal)| normal)
    }

    /// Accelerations now [m/s²]; none where a user's force fails, which the next step tells.
    fn rates(&mut self, t: f64) -> Vec<Row> {
        let mut out = vec![ZERO; self.state.x.len()];
        let done = self.laws.rate(t, &self.state.x, &self.state.v, &mut out);
        done.map_or(Vec::new(), |()| out)
    }

    /// All sub-steps of an interval.
    fn intervals(&mut self, t: f64, dt: f64, exchange: &mut Exchange, go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError> {
        let mut report = StepReport::default();
        let end = t + dt;
        let mut unborn = self.pool.schedule_births(&self.name, t, dt)?;
        self.untangle(t);
        if self.integrator.is_adaptive() && self.user.is_none() {
            let (mut done, mut last) = (0.0, dt);
            while done < dt && go_on() {
                self.lead_followers(t + done, dt - done);
                self.remember(t + done, dt - done);
                let (begun, left) = (done, dt - done);
                // The error of a step knows nothing of contact.
                let longest = self.longest_among_pairs(left).max(self.adaptive.smallest * dt).min(left);
                self.witness(t + done);
                let y = (&mut self.state.x[..], &mut self.state.v[..]);
                let times = (t + done, longest, dt);
                let taken = adaptive_step(
                    self.integrator,
                    &self.adaptive,
                    &mut self.laws,
                    times,
                    y,
                    &mut self.memory,
                    &mut self.scratch,
                    &mut report,
                );
                let h = taken.map_err(|e| e.in_system(&self.name))?;
                // The last step ends exactly at dt.
                done = if h == left { dt } else { done + h };
                report.stepped(h);
                // The step's length is known only now.
                self.apply_anchors(h, exchange);
                self.after(t + begun, h, &mut report);
                self.insert_births(&mut unborn, t + done, h, end)?;
                last = h;
                self.look(t + done)?;
            }
            if done == dt {
                self.remove_dead(end, dt, last)?;
            }
            return Ok(report);
        }
        let substeps = self.substeps(dt, go_on);
        if substeps > MOST_SUBSTEPS {
            return Err(StepError::StepTooSmall { system: self.name.clone(), time: t, step: dt / substeps });
        }
        let (substeps, h) = (substeps as u32, dt / substeps);
        let each = self.laws.is_local()
            && self.constraints.is_empty()
            && self.self_contact.is_none()
            && self.anchors.is_empty()
            && self.followers.is_empty()
            && self.user.is_none()
            && self.clamp.is_none()
            && !self.integrator.is_implicit()
            && !self.watched;
        if each {
            self.advance_local(t, h, substeps, go_on).map_err(|e| e.in_system(&self.name))?;
            self.insert_births_of_interval(unborn, (t, h, substeps))?;
            self.remove_dead(end, dt, h)?;
            report.steps = u64::from(substeps);
            report.step_range = Some((h, h));
            return Ok(report);
        }
        for k in 0..substeps {
            if !go_on() {
                return Ok(report);
            }
            let time = t + f64::from(k) * h;
            self.witness(time);
            self.apply_anchors(h, exchange);
            self.substep(time, h, &mut report).map_err(|e| e.in_system(&self.name))?;
            self.insert_births(&mut unborn, if k + 1 == substeps { end } else { time + h }, h, end)?;
            self.look(time + h)?;
        }
        self.remove_dead(end, dt, h)?;
        Ok(report)
    }

    /// While watched: keeps the state at time t.
    fn witness(&mut self, t: f64) {
        self.witness = self.watched.then(|| (t, self.state.x.clone(), self.state.v.clone()));
    }

    /// While watched: the first breakdown as an error.
    fn look(&self, t: f64) -> Result<(), StepError> {
        if self.watched { self.checked_ledger(t).map(|_| ()) } else { Ok(()) }
    }
}

impl System for Dynamics {
    fn name(&self) -> &str {
        &self.name
    }

    fn absorb(&mut self, exchange: &mut Exchange) {
        for push in exchange.take(self.index) {
            if push.steady {
                self.push_steadily(push.row, push.impulse);
            } else {
                self.push(push.row, push.impulse);
            }
        }
    }

    fn advance(&mut self, t: f64, dt: f64, exchange: &mut Exchange, go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError> {
        // Impulses until here.
        self.laws.steady.iter_mut().for_each(|(_, force)| *force = *force * (1.0 / dt));
        let report = self.intervals(t, dt, exchange, go_on);
        self.memory.ready &= self.laws.steady.is_empty();
        self.laws.steady.clear();
        report
    }

    fn publish(&mut self, t: f64, exchange: &mut Exchange) {
        let told = exchange.has_body(self.index);
        let rates = if told { self.rates(t) } else { Vec::new() };
        for port in exchange.ports_of(self.index) {
            let i = port.owner.1;
            (port.position, port.velocity, port.time) = (xyz64(self.state.x[i]), xyz64(self.state.v[i]), t);
            port.acceleration = rates.get(i).map_or(Vector::default(), |a| xyz64(*a));
            port.inverse_mass = f64::from(self.laws.masses.inverse(i, &self.state.x));
            port.normal = if told { self.touched(port.position, t) } else { Vector::default() };
        }
    }

    fn columns(&self, names: &[&str], out: &mut Vec<Column>) {
        self.write_columns(names, out);
    }

    fn topology(&self, out: &mut Vec<Column>) {
        self.write_topology(out);
    }

    fn ledger(&self, t: f64) -> Ledger {
        self.ledger_at(t)
    }

    fn shares(&self, t: f64) -> Vec<Share> {
        self.shares_at(t)
    }

    fn worst(&self, t: f64) -> Vec<Worst> {
        self.worst_at(t)
    }

    fn breakdown(&mut self, t: f64) -> Option<StepError> {
        match self.checked_ledger(t) {
            Ok(ledger) => {
                self.rescale(&ledger);
                None
            }
            Err(error) => Some(error),
        }
    }

    fn watch(&mut self, on: bool) {
        self.watched = on;
    }

    fn reconsider(&mut self) {
        (self.automatic, self.measured) = (0, 0);
        (self.memory.ready, self.memory.next_step) = (false, 0.0);
        self.set_scale();
    }

    fn stability(&mut self, dt: f64, go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability> {
        self.estimate(dt, go_on)
    }

    fn save(&self, archive: &mut Archive) {
        if !self.pool.is_empty() {
            self.pool.save(archive);
        }
        let points = self.laws.masses.points;
        archive.push_points("x", &self.state.x[..points], self.state.x.capacity());
        archive.push_rows("turn", &self.state.x[points..]);
        archive.push_points("v", &self.state.v, self.state.v.capacity());
        for column in &self.memory.columns {
            archive.push_rows("memory", column);
        }
        let ready = f64::from(u8::from(self.memory.ready));
        let numbers =
            vec![ready, self.memory.next_step, self.memory.last_error, f64::from(self.automatic), self.measured as f64, self.broken as f64];
        archive.push("numbers", Part::Numbers(numbers.into_iter().chain(self.scale.numbers()).collect()));
        for tear in &self.tears {
            archive.push("triangles", Part::Indices(tear.triangles().concat()));
        }
        for batch in &self.laws.batches {
            archive.push("broken", Part::Indices(batch.broken()));
        }
        for constraints in &self.constraints {
            archive.push("broken", Part::Indices(constraints.broken()));
        }
    }

    fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        if !self.pool.is_empty() {
            self.pool.restore(archive)?;
            self.take_pool();
        }
        let points = self.laws.masses.points;
        archive.points("x", &mut self.state.x[..points])?;
        archive.rows("turn", &mut self.state.x[points..])?;
        archive.points("v", &mut self.state.v)?;
        for column in &mut self.memory.columns {
            archive.rows("memory", column)?;
        }
        let numbers = archive.numbers("numbers")?;
        let [ready, next_step, last_error, automatic, measured, broken, scale @ ..] = &numbers[..] else { return None };
        (self.memory.ready, self.memory.next_step, self.memory.last_error) = (*ready == 1.0, *next_step, *last_error);
        (self.automatic, self.measured) = (*automatic as u32, *measured as usize);
        self.broken = *broken as u64;
        self.scale = ledger::Scale::from_numbers(scale)?;
        for tear in &mut self.tears {
            tear.set(&archive.indices("triangles")?)?;
        }
        if !self.tears.is_empty() {
            self.follow_tears();
        }
        for batch in &mut self.laws.batches {
            let broken = archive.indices("broken")?;
            if broken.iter().any(|e| *e as usize >= batch.len()) {
                return None;
            }
            batch.set_broken(&broken);
        }
        for constraints in &mut self.constraints {
            let broken = archive.indices("broken")?;
            if broken.iter().any(|e| *e as usize >= constraints.len()) {
                return None;
            }
            constraints.set_broken(&broken);
        }
        Some(())
    }

    fn add_force(&mut self, force: Box<dyn UserForce>) -> bool {
        self.laws.user.push(force);
        self.memory.ready = false;
        true
    }

    fn replace_integrator(&mut self, integrator: Box<dyn UserIntegrator>) -> bool {
        // What is a constraint there is no force that a scheme could ask for.
        if self.integrator == Integrator::PositionBased {
            return false;
        }
        self.user = Some(integrator);
        true
    }

    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool> {
        let points = self.objects.iter().find(|o| o.name == object)?.points.clone();
        let velocity = match column {
            "position" => false,
            "velocity" => true,
            _ => return Some(false),
        };
        if values.len() != 3 * points.len() {
            return Some(false);
        }
        for (i, value) in points.zip(values.chunks_exact(3)) {
            // What is pinned stays where it is: a velocity would carry it away.
            if velocity && self.state.x[i][3] == 0.0 {
                continue;
            }
            let rows = if velocity { &mut self.state.v } else { &mut self.state.x };
            rows[i] = [value[0] as Real, value[1] as Real, value[2] as Real, rows[i][3]];
        }
        self.memory.ready = false;
        // What was put in from outside is a new start for the energy, not a growth.
        let before = self.scale;
        self.set_scale();
        self.scale.keep(before);
        Some(true)
    }
}
