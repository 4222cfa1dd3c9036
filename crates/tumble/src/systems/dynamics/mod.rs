//! Masses under forces: x'' = f(x, v, t)/m. Points and frames, elements between them, forces on each, contact with solids; stepped by
//! any integrator, or by projecting positions.

mod account;
mod body_contact;
mod build;
mod columns;
mod contact;
mod core;
mod feature;
mod features;
mod followers;
mod fracture;
mod hair_continuum;
mod holds;
mod impact;
mod implicit;
mod inertia;
mod laws;
mod ledger;
mod life;
mod liquid_loads;
mod local;
mod modes;
mod parts;
mod reaction;
mod scale;
mod scheme;
mod self_contact;
mod settings;
mod solid_features;
mod sums;
mod tear;

pub use holds::Times;
pub use parts::{Closed, Liquid, On, Parts, SpringPart};
pub use settings::{Settings, Stepping};
pub use tear::TearPart;

use crate::exchange::{BodyRow, Exchange, Turn, When};
use crate::geometry::{Collider, Vector};
use crate::integrators;
use crate::math::{Real, Row, Signal, xyz64};
use crate::pool::Birth;
use crate::state::State;
use crate::system::{Archive, Part, System};
use core::Core;
use feature::Span;
use features::Features;
use reaction::Reaction;
use scale::Scale;
use scheme::Scheme;
use std::sync::Arc;
use tumble_interface::check::short;
use tumble_interface::engine::{Ledger, Share, Stability, StepReport, UserForce, UserIntegrator, Worst};
use tumble_interface::scene::Integrator;
use tumble_interface::warning::Code;
use tumble_interface::{Column, SceneError, StepError, Warning};

/// Sub-steps of an exchange interval beyond which a step counts as too small.
pub const MOST_SUBSTEPS: f64 = 1e7;

/// h² k/m of masses beyond which they bear rigid bodies too weakly.                                 (coupling.8)
const YIELDING: f64 = 1.0;

/// A system of masses.
pub struct Dynamics {
    core: Core,
    scheme: Box<dyn Scheme>,
    features: Features,
    reaction: Reaction,
    stepping: Stepping,
    /// Sub-steps that automatic stepping has chosen; 0 before the first interval.
    automatic: u32,
    /// Rows when it chose them.
    measured: usize,
    anchors: Vec<Anchor>,
    /// Whether other systems push masses of this one.
    pushed: bool,
    watched: bool,
    /// Whether an explosion is no breakdown.
    tolerant: bool,
    /// Time and state before the sub-step, while watched.
    witness: Option<(f64, Vec<Row>, Vec<Row>)>,
}

/// A damped spring to a body of another system, as impulses at the start of each sub-step.
#[derive(Debug, Clone)]
pub struct Anchor {
    /// The mass of this system.
    pub row: usize,
    /// The row of the other.
    pub other: BodyRow,
    /// Where on it, from its centre of mass in its axes [m].
    pub at: Vector,
    /// Spring constant [N/m].
    pub stiffness: Signal,
    /// Damping along the spring [N s/m].
    pub damping: f64,
    /// Rest length [m].
    pub rest_length: Signal,
}

type GoOn<'a> = &'a (dyn Fn() -> bool + Sync);

impl Dynamics {
    fn new(core: Core, scheme: Box<dyn Scheme>, features: Features, settings: &Settings) -> Result<Self, SceneError> {
        let mut system = Self {
            core,
            scheme,
            features,
            reaction: Reaction::default(),
            stepping: settings.stepping,
            automatic: 0,
            measured: 0,
            anchors: Vec::new(),
            pushed: false,
            watched: false,
            tolerant: false,
            witness: None,
        };
        system.set_scale();
        let begun = system.core.begin_life(settings.interval);
        begun.map_err(|e| SceneError::one(format!("system \"{}\"", settings.name), e.to_string()))?;
        Ok(system)
    }

    /// Attaches a mass of this system to a mass of another.
    pub fn add_anchor(&mut self, anchor: Anchor) {
        self.anchors.push(anchor);
        self.pushed = true;
    }

    /// Other systems will push masses of this one.
    pub fn expect_pushes(&mut self) {
        self.pushed = true;
    }

    /// Takes the solids that systems have published.
    fn take_surfaces(&mut self, solids: &Arc<Vec<Collider>>) {
        if Arc::ptr_eq(solids, &self.core.laws.colliders) {
            return;
        }
        self.core.laws.colliders = solids.clone();
        self.core.laws.batches.iter_mut().for_each(|batch| batch.take_surfaces(solids));
        let surfaces = self.features.self_contact.iter_mut().chain(&mut self.features.intersection_counter);
        surfaces.for_each(|contact| contact.take_surfaces(solids));
    }

    /// A warning of surfaces that start in each other.
    pub fn tangles(&self) -> Option<Warning> {
        self.features.self_contact.as_ref()?.tangled_start(&self.core)
    }

    /// Warnings of what goes wrong in intervals of length dt [s].
    pub fn doubts(&mut self, dt: f64) -> Vec<Warning> {
        match self.stepping {
            Stepping::Substeps(n) => self.scheme.doubts(&mut self.core, dt, f64::from(n)),
            Stepping::Step(step) => self.scheme.doubts(&mut self.core, dt, integrators::equal_steps(dt, step)),
            Stepping::Automatic => Vec::new(),
        }
    }

    /// A warning of springs that pull masses far into the rigid bodies which they bear, in intervals of length dt [s].
    pub fn yields(&self, dt: f64) -> Option<Warning> {
        let Core { laws, state: State { x, .. }, integrator, name, .. } = &self.core;
        let steps = match self.stepping {
            Stepping::Substeps(n) => f64::from(n),
            Stepping::Step(step) => integrators::equal_steps(dt, step),
            Stepping::Automatic => return None,
        };
        // Rods are stiff along themselves, and yield to what lies on them.
        if self.scheme.is_adaptive(&self.core) || laws.masses.frames.start < laws.masses.frames.end {
            return None;
        }
        let h = dt / steps;
        let stiff = |(x, (grip, mass)): (&Row, (&Real, &Real))| if x[3] > 0.0 { f64::from(*grip) / f64::from(*mass) } else { 0.0 };
        let most = h * h * x.iter().zip(laws.grip.iter().zip(&laws.masses.mass)).map(stiff).fold(0.0, f64::max);
        // It evaluates forces where masses are held.
        (most > YIELDING && *integrator != Integrator::SymplecticEuler).then(|| {
            let message = format!(
                "h² k/m of its masses is up to {}: in sub-steps of {} s springs pull masses into the rigid bodies that they bear, which then hang too low; take \
                 {} sub-steps, or softer springs",
                short(most),
                short(h),
                (steps * most.sqrt()).ceil()
            );
            Warning::new(Code::YieldingMasses, format!("system \"{name}\""), message)
        })
    }

    /// A warning of long-range attachments that attach nothing.
    pub fn idle_attachments(&self) -> Option<Warning> {
        self.scheme.idle_attachments(&self.core)
    }

    /// Sub-steps of an interval of length dt; any number if `go_on` says no.
    fn substeps(&mut self, dt: f64, go_on: GoOn<'_>) -> f64 {
        let rows = self.core.state.x.len();
        match self.stepping {
            Stepping::Substeps(n) => f64::from(n),
            Stepping::Step(step) => integrators::equal_steps(dt, step),
            // A crowd that has grown may have another limit.
            Stepping::Automatic if self.automatic > 0 && rows <= 2 * self.measured => f64::from(self.automatic),
            Stepping::Automatic => {
                let limit = self.core.usable_step(go_on);
                let n = if limit > 0.0 { (dt / (0.7 * limit)).ceil().max(1.0) } else { 1.0 };
                // A system without masses yet has no limit to keep to later.
                if n <= MOST_SUBSTEPS && rows > 0 {
                    (self.automatic, self.measured) = (n as u32, rows);
                }
                n
            }
        }
    }

    /// Anchors to other systems: half of the interaction that this system owns. Each is an impulse h f, so one side
    /// gains exactly the other's loss, whatever the integrator.
    fn apply_anchors(&mut self, Span { t, h }: Span, exchange: &mut Turn<'_>) {
        for anchor in &self.anchors {
            let (other, state) = (exchange.state_at(anchor.other, t), &self.core.state);
            let (x, v) = (xyz64(state.x[anchor.row]), xyz64(state.v[anchor.row]));
            let point = other.place(anchor.at);
            let d = point - x;
            let length = d.norm();
            let n = d.normalized();
            let pull =
                anchor.stiffness.value(t) * (length - anchor.rest_length.value(t)) + anchor.damping * n.dot(other.velocity_at(point) - v);
            let impulse = n * (h * pull);
            if exchange.repeats() {
                exchange.post_steady(anchor.other, point, -impulse);
            } else {
                exchange.post(anchor.other, point, -impulse);
            }
            self.core.kick(anchor.row, impulse);
        }
    }

    /// Takes the bodies of other systems as they are now. What they may do to masses at first is a scale of the energy; later, masses that explode
    /// would fling bodies, and hide it.
    fn visit(&mut self, exchange: &Exchange) {
        self.reaction.begin(exchange, self.anchors.iter().map(|anchor| (anchor.row, anchor.other)));
        if !self.reaction.is_empty() && !std::mem::replace(&mut self.core.visits, true) {
            self.pushed = true;
            let fastest = self.reaction.fastest();
            let hit = 2.0 * self.core.total().mass * fastest * fastest;
            self.core.scale.size = self.core.scale.size.max(hit);
        }
    }

    /// All sub-steps of an interval.
    fn advance_interval(&mut self, t: f64, dt: f64, exchange: &mut Turn<'_>, go_on: GoOn<'_>) -> Result<StepReport, StepError> {
        let mut births = self.core.pool.schedule_births(&self.core.name, t, dt)?;
        self.features.begin(&mut self.core, t);
        if self.scheme.is_adaptive(&self.core) {
            return self.adaptive_steps(Span { t, h: dt }, &mut births, exchange, go_on);
        }
        let substeps = self.substeps(dt, go_on);
        if substeps > MOST_SUBSTEPS {
            return Err(StepError::StepTooSmall { system: self.core.name.clone(), time: t, step: dt / substeps });
        }
        let (substeps, h) = (substeps as u32, dt / substeps);
        let alone =
            self.core.is_local() && self.features.are_idle() && self.anchors.is_empty() && self.reaction.is_empty() && !self.watched;
        if alone && self.scheme.steps_alone(&self.core) {
            let response = self.scheme.response(&self.core);
            let done = self.core.advance_blocks(Span { t, h }, substeps, response, go_on);
            done.map_err(|e| e.in_system(&self.core.name))?;
            self.core.insert_births_of_interval(births, (t, h, substeps))?;
            self.core.remove_dead(t + dt, dt, h)?;
            return Ok(StepReport { steps: u64::from(substeps), step_range: Some((h, h)), ..StepReport::default() });
        }
        self.equal_steps(Span { t, h: dt }, (substeps, h), &mut births, exchange, go_on)
    }

    /// An interval in equal sub-steps of length h [s].
    fn equal_steps(
        &mut self,
        interval: Span,
        (substeps, h): (u32, f64),
        births: &mut [Vec<Birth>],
        exchange: &mut Turn<'_>,
        go_on: GoOn<'_>,
    ) -> Result<StepReport, StepError> {
        let (mut report, end) = (StepReport::default(), interval.end());
        for k in 0..substeps {
            if !go_on() {
                return Ok(report);
            }
            let step = Span { t: interval.t + f64::from(k) * h, h };
            self.witness(step.t);
            self.apply_anchors(step, exchange);
            self.features.before(&mut self.core, step);
            self.reaction.immerse(&mut self.core, h);
            let taken = self.scheme.step(&mut self.core, &mut self.features, step, &mut report);
            taken.map_err(|e| e.in_system(&self.core.name))?;
            self.reaction.emerge(&self.core);
            report.stepped(h);
            self.finish(step, &mut report);
            self.core.insert_births(births, if k + 1 == substeps { end } else { step.end() }, h, end)?;
            self.check_watched(step.end())?;
        }
        self.core.remove_dead(end, interval.h, h)?;
        Ok(report)
    }

    /// An interval in sub-steps of lengths that the scheme chooses.
    fn adaptive_steps(
        &mut self,
        interval: Span,
        births: &mut [Vec<Birth>],
        exchange: &mut Turn<'_>,
        go_on: GoOn<'_>,
    ) -> Result<StepReport, StepError> {
        let (mut report, Span { t, h: dt }, end) = (StepReport::default(), interval, interval.end());
        let (mut done, mut last) = (0.0, dt);
        while done < dt && go_on() {
            // No step goes past a time at which something is held or let go.
            let stop = (self.features.holds.next_change(t + done) - t).min(dt);
            let rest = Span { t: t + done, h: stop - done };
            self.features.before(&mut self.core, rest);
            self.witness(rest.t);
            let taken = self.scheme.adaptive_step(&mut self.core, &self.features, rest, dt, &mut report);
            let h = taken.map_err(|e| e.in_system(&self.core.name))?;
            // The last step ends exactly there.
            done = if h == rest.h { stop } else { done + h };
            report.stepped(h);
            // Anchors wait for the length of the step.
            self.apply_anchors(Span { t: t + done, h }, exchange);
            self.finish(Span { t: rest.t, h }, &mut report);
            self.core.insert_births(births, t + done, h, end)?;
            last = h;
            self.check_watched(t + done)?;
        }
        if done == dt {
            self.core.remove_dead(end, dt, last)?;
        }
        Ok(report)
    }

    /// Ends a sub-step: corrections of positions, contact with solids, features.
    fn finish(&mut self, step: Span, report: &mut StepReport) {
        self.scheme.correct(&mut self.core, &mut self.features, step, report);
        let response = self.scheme.response(&self.core);
        // Solids have the last word: what lies between one and a body stays out of the solid.
        self.reaction.resolve(&mut self.core, step, response.lead);
        self.core.resolve_contact(step, response);
        self.features.after(&mut self.core, step, report);
    }

    /// While watched: keeps the state at time t.
    fn witness(&mut self, t: f64) {
        self.witness = self.watched.then(|| (t, self.core.state.x.clone(), self.core.state.v.clone()));
    }

    /// While watched: the first breakdown as an error.
    fn check_watched(&self, t: f64) -> Result<(), StepError> {
        if self.watched { self.checked_ledger(t).map(|_| ()) } else { Ok(()) }
    }
}

impl System for Dynamics {
    fn name(&self) -> &str {
        &self.core.name
    }

    fn absorb(&mut self, exchange: &mut Turn<'_>) {
        self.take_surfaces(exchange.surfaces());
        self.core.pool.listen(exchange);
        for push in exchange.take() {
            if push.when != When::Kick {
                self.core.push_steadily(push.row, push.impulse);
            } else {
                self.core.kick(push.row, push.impulse);
            }
        }
    }

    fn advance(&mut self, t: f64, dt: f64, exchange: &mut Turn<'_>, go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError> {
        // Impulses until here.
        self.core.laws.steady.iter_mut().for_each(|(_, force)| *force = *force * (1.0 / dt));
        self.visit(exchange);
        let report = self.advance_interval(t, dt, exchange, go_on);
        self.reaction.end(exchange);
        self.core.memory.ready &= self.core.laws.steady.is_empty();
        self.core.laws.steady.clear();
        self.core.pool.tell(exchange);
        report
    }

    fn publish(&mut self, t: f64, exchange: &mut Turn<'_>) {
        let asked = exchange.bodies().any(|body| body.detailed);
        let rates = if asked { self.core.accelerations(t) } else { Vec::new() };
        for body in exchange.bodies() {
            body.time = t;
            for (state, i) in body.states.iter_mut().zip(body.rows.clone()) {
                (state.position, state.velocity) = (xyz64(self.core.state.x[i]), xyz64(self.core.state.v[i]));
                state.inverse_mass = f64::from(self.core.laws.masses.inverse(i, &self.core.state.x));
                if body.detailed {
                    state.acceleration = rates.get(i).map_or(Vector::default(), |a| xyz64(*a));
                    state.normal = self.core.contact_normal(state.position, t);
                }
            }
        }
    }

    fn columns(&self, _t: f64, names: &[&str], out: &mut Vec<Column>) {
        self.write_columns(names, out);
    }

    fn topology(&self, out: &mut Vec<Column>) {
        self.write_topology(out);
    }

    fn ledger(&self, t: f64) -> Ledger {
        self.ledger_at(t)
    }

    fn energy_between(&self, t: f64, exchange: &Exchange) -> f64 {
        let of = |anchor: &Anchor| {
            let length = (exchange.state_at(anchor.other, t).place(anchor.at) - xyz64(self.core.state.x[anchor.row])).norm();
            0.5 * anchor.stiffness.value(t) * (length - anchor.rest_length.value(t)).powi(2)
        };
        self.anchors.iter().map(of).sum()
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
        self.witness = None;
    }

    fn tolerate_explosions(&mut self, on: bool) {
        self.tolerant = on;
    }

    fn reconsider(&mut self) {
        (self.automatic, self.measured) = (0, 0);
        (self.core.memory.ready, self.core.memory.next_step) = (false, 0.0);
        self.set_scale();
    }

    fn stability(&mut self, dt: f64, go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability> {
        self.estimate_of_witness(dt, go_on)
    }

    fn save(&self, archive: &mut Archive) {
        if !self.core.pool.is_empty() {
            self.core.pool.save(archive);
        }
        let [points, frames, born] = self.core.laws.masses.frames.cut(0, self.core.state.x.len());
        archive.push_points("x", &self.core.state.x[points], self.core.state.x.capacity());
        archive.push_rows("turn", &self.core.state.x[frames]);
        if !born.is_empty() {
            archive.push_points("born", &self.core.state.x[born], self.core.state.x.capacity());
        }
        archive.push_points("v", &self.core.state.v, self.core.state.v.capacity());
        for column in &self.core.memory.columns {
            archive.push_rows("memory", column);
        }
        let ready = f64::from(u8::from(self.core.memory.ready));
        let numbers = vec![
            ready,
            self.core.memory.next_step,
            self.core.memory.last_error,
            f64::from(self.automatic),
            self.measured as f64,
            self.core.broken as f64,
        ];
        archive.push("numbers", Part::Numbers(numbers.into_iter().chain(self.core.scale.numbers()).collect()));
        self.features.save(&self.core, archive);
    }

    fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        if !self.core.pool.is_empty() {
            self.core.pool.restore(archive)?;
            self.core.take_pool();
        }
        let [points, frames, born] = self.core.laws.masses.frames.cut(0, self.core.state.x.len());
        archive.points("x", &mut self.core.state.x[points])?;
        archive.rows("turn", &mut self.core.state.x[frames])?;
        if !born.is_empty() {
            archive.points("born", &mut self.core.state.x[born])?;
        }
        archive.points("v", &mut self.core.state.v)?;
        for column in &mut self.core.memory.columns {
            archive.rows("memory", column)?;
        }
        let numbers = archive.numbers("numbers")?;
        let [ready, next_step, last_error, automatic, measured, broken, scale @ ..] = &numbers[..] else { return None };
        (self.core.memory.ready, self.core.memory.next_step, self.core.memory.last_error) = (*ready == 1.0, *next_step, *last_error);
        (self.automatic, self.measured) = (*automatic as u32, *measured as usize);
        self.core.broken = *broken as u64;
        self.core.regrouped += 1;
        self.core.scale = Scale::from_numbers(scale)?;
        self.features.restore(&mut self.core, archive)
    }

    fn add_force(&mut self, force: Box<dyn UserForce>) -> bool {
        self.core.laws.user.push(force);
        self.core.memory.ready = false;
        true
    }

    fn replace_integrator(&mut self, integrator: Box<dyn UserIntegrator>) -> bool {
        self.scheme.replace(integrator)
    }

    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool> {
        let points = self.core.objects.iter().find(|o| o.name == object)?.points.clone();
        let velocity = match column {
            "position" => false,
            "velocity" => true,
            _ => return Some(false),
        };
        if values.len() != 3 * points.len() {
            return Some(false);
        }
        for (i, value) in points.zip(values.chunks_exact(3)) {
            // Pinned points stay where they are: a velocity would carry them away.
            if velocity && self.core.state.x[i][3] == 0.0 {
                continue;
            }
            let rows = if velocity { &mut self.core.state.v } else { &mut self.core.state.x };
            rows[i] = [value[0] as Real, value[1] as Real, value[2] as Real, rows[i][3]];
        }
        self.core.memory.ready = false;
        // A state put in from outside is a new start for the energy, not a growth.
        let before = self.core.scale;
        self.set_scale();
        self.core.scale.keep(before);
        Some(true)
    }
}
