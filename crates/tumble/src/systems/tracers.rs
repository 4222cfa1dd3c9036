//! Massless particles carried by velocity fields: x' = u(x, t). The plain case of y' = f(y, t).

use crate::exchange::Turn;
use crate::forces::Flow;
use crate::integrators::{self, Equation, Kinematics, Memory, Scratch, Stage, Step, adaptive_step};
use crate::math::parallel::chunks;
use crate::math::{Real, Row, Vec3, ZERO, is_finite, xyz64};
use crate::pool::{Birth, Columns, Emitter, Pool, due};
use crate::state::{Frames, Object};
use crate::system::{Archive, Part, System};
use tumble_interface::engine::{Ledger, Stability, StepReport};
use tumble_interface::error::Breakdown;
use tumble_interface::scene::{Adaptive, Integrator};
use tumble_interface::{Column, StepError};

/// How a system of tracers steps.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Name in the scene.
    pub name: String,
    /// Scheme; one that does not need velocities.
    pub integrator: Integrator,
    /// Sub-steps of an interval, if their number is given.
    pub substeps: Option<u32>,
    /// Longest sub-step [s], if given.
    pub step: Option<f64>,
    /// Of the adaptive schemes.
    pub adaptive: Adaptive,
}

/// A system of tracers.
pub struct Tracers {
    settings: Settings,
    flow: Flow,
    x: Vec<Row>,
    objects: Vec<Object>,
    /// Points that are born and die; their rows are the last.
    pool: Pool,
    memory: Memory,
    scratch: Scratch,
    /// Largest distance from the origin at the start [m].
    size: f64,
    /// Now [s].
    time: f64,
}

impl Tracers {
    /// A system of points in a flow; every object is a range of them, or the points of an emitter.
    pub fn new(settings: Settings, flow: Flow, x: &[Vec3<f64>], objects: Vec<Object>, emitters: Vec<Emitter>) -> Self {
        let size = x.iter().map(|x| x.norm()).fold(1e-30, f64::max);
        let x: Vec<Row> = x.iter().map(|x| [x.x as Real, x.y as Real, x.z as Real, 0.0]).collect();
        let memory = Memory::new(settings.integrator, x.len());
        let pool = Pool::new(x.len(), emitters);
        Self { memory, settings, flow, x, objects, pool, scratch: Scratch::default(), size, time: 0.0 }
    }

    /// Those who are there at the start; an exchange interval has the length dt [s].
    pub fn begin_life(&mut self, dt: f64) -> Result<(), StepError> {
        let mut unborn = self.pool.schedule_births(&self.settings.name, -dt, dt)?;
        self.deliver(&mut unborn, 0.0, 0.0);
        Ok(())
    }

    /// Takes those born by the time `until`, to which a step of Runge and Kutta's carries them from their birth. The interval ends at `end`.
    fn deliver(&mut self, unborn: &mut [Vec<Birth>], until: f64, end: f64) {
        for (s, unborn) in unborn.iter_mut().enumerate() {
            self.settle(s, &due(unborn, until, end), until, end);
        }
    }

    fn settle(&mut self, s: usize, births: &[Birth], until: f64, end: f64) {
        if births.is_empty() {
            return;
        }
        let (flow, x) = (&self.flow, &self.x);
        let velocity = |row: usize| {
            let u = flow.at(until, xyz64(x[row]));
            [u.x as Real, u.y as Real, u.z as Real, 0.0]
        };
        let surplus = self.pool.surplus(s, births, (until, end), x, &velocity);
        self.pool.remove(s, &surplus, owned(&mut self.x, &mut self.memory));
        let births = &births[births.len().saturating_sub(self.pool.emitter(s).most().unwrap_or(usize::MAX))..];
        let rows = self.pool.insert(s, births, end, owned(&mut self.x, &mut self.memory));
        for (x, birth) in self.x[rows].iter_mut().zip(births) {
            let tau = until - birth.time;
            let (flow, t, start) = (&self.flow, birth.time, birth.x);
            let k1 = flow.at(t, start);
            let k2 = flow.at(t + 0.5 * tau, start + k1 * (0.5 * tau));
            let k3 = flow.at(t + 0.5 * tau, start + k2 * (0.5 * tau));
            let k4 = flow.at(until, start + k3 * tau);
            let there = start + (k1 + (k2 + k3) * 2.0 + k4) * (tau / 6.0);
            *x = [there.x as Real, there.y as Real, there.z as Real, 0.0];
            self.size = self.size.max(there.norm()).max(1e-3);
        }
        self.count_rows();
    }

    /// At the time t, where an interval of length dt [s] ends: the dead leave, and children of the dead and of the living come.
    fn remove_dead(&mut self, t: f64, dt: f64) -> Result<(), StepError> {
        let n = self.pool.len();
        let mut born: Vec<Vec<Birth>> = vec![Vec::new(); n];
        for s in 0..n {
            let births = std::mem::take(&mut born[s]);
            self.settle(s, &births, t, t);
            let mut v = vec![ZERO; self.x.len()];
            let (flow, x) = (&self.flow, &self.x);
            chunks(&mut v, |start, v| flow.velocities(t, &x[start..start + v.len()], v));
            let dead = self.pool.dead(s, (t, dt), &self.x, &v, &|_, _| false);
            for (child, births) in self.pool.descendants(s, &self.settings.name, t, &dead, (&self.x, &v))? {
                born[child] = births;
            }
            let dead: Vec<u32> = dead.into_iter().map(|(k, _)| k).collect();
            self.pool.remove(s, &dead, owned(&mut self.x, &mut self.memory));
            self.count_rows();
        }
        self.pool.calm();
        Ok(())
    }

    /// Tells everything that counts rows how many there are now.
    fn count_rows(&mut self) {
        self.memory.ready = false;
        self.pool.place(&mut self.objects);
    }
}

/// The columns whose rows the pool moves.
fn owned<'a>(x: &'a mut Vec<Row>, memory: &'a mut Memory) -> Columns<'a> {
    Columns { rows: std::iter::once(x).chain(&mut memory.columns).collect(), numbers: Vec::new() }
}

/// Points in a flow.
struct Carried<'a>(&'a Flow);

impl Equation for Carried<'_> {
    fn kinematics(&self) -> Kinematics {
        Kinematics { frames: Frames::default(), second_order: false }
    }

    fn rate(&mut self, t: f64, x: &[Row], _v: &[Row], out: &mut [Row]) -> Result<(), StepError> {
        let flow = self.0;
        chunks(out, |start, out| flow.velocities(t, &x[start..start + out.len()], out));
        Ok(())
    }

    /// Newton's method for each point by itself: x = x* + gh u(x, t), with the 3 x 3 gradient of u.
    fn solve(&mut self, stage: &Stage<'_>, x: &mut [Row], _v: &mut [Row], report: &mut StepReport) -> Result<(), StepError> {
        let flow = self.0;
        let one = |start: Vec3<f64>, guess: Vec3<f64>| {
            let mut x = guess;
            for _ in 0..20 {
                let residual = x - start - flow.at(stage.t, x) * stage.gh;
                let [a, b, c] = flow.gradient(stage.t, x);
                let unit = |i: usize| Vec3::from(std::array::from_fn::<f64, 3, _>(|j| f64::from(u8::from(i == j))));
                let (a, b, c) = (unit(0) - a * stage.gh, unit(1) - b * stage.gh, unit(2) - c * stage.gh);
                let det = a.dot(b.cross(c));
                let step = Vec3 { x: residual.dot(b.cross(c)), y: a.dot(residual.cross(c)), z: a.dot(b.cross(residual)) } * (1.0 / det);
                x = x - step;
                if step.norm() <= 1e-15 * (1.0 + x.norm()) {
                    break;
                }
            }
            x
        };
        chunks(x, |first, x| {
            for (k, x) in x.iter_mut().enumerate() {
                let found = one(xyz64(stage.x[first + k]), xyz64(*x));
                *x = [found.x as Real, found.y as Real, found.z as Real, 0.0];
            }
        });
        report.newton += 1;
        Ok(())
    }
}

impl System for Tracers {
    fn name(&self) -> &str {
        &self.settings.name
    }

    fn absorb(&mut self, exchange: &mut Turn<'_>) {
        self.pool.listen(exchange);
        self.flow.fluids().for_each(|fluid| fluid.states = exchange.field(&fluid.fluid, "velocity").to_vec());
    }

    fn advance(&mut self, t: f64, dt: f64, exchange: &mut Turn<'_>, go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError> {
        let mut report = StepReport::default();
        let (integrator, end) = (self.settings.integrator, t + dt);
        let mut unborn = self.pool.schedule_births(&self.settings.name, t, dt)?;
        if integrator.is_adaptive() {
            let mut done = 0.0;
            while done < dt && go_on() {
                let left = dt - done;
                let times = (t + done, left, dt);
                let (memory, scratch) = (&mut self.memory, &mut self.scratch);
                let h = adaptive_step(
                    integrator,
                    &self.settings.adaptive,
                    &mut Carried(&self.flow),
                    times,
                    (&mut self.x, &mut []),
                    memory,
                    scratch,
                    &mut report,
                )
                .map_err(|e| e.in_system(&self.settings.name))?;
                done = if h == left { dt } else { done + h };
                report.stepped(h);
                self.deliver(&mut unborn, if done == dt { end } else { t + done }, end);
            }
            if done == dt {
                self.remove_dead(end, dt)?;
                self.time = end;
                self.pool.tell(exchange);
            }
            return Ok(report);
        }
        let by_step = self.settings.step.map(|step| integrators::equal_steps(dt, step) as u32);
        let n = self.settings.substeps.or(by_step).unwrap_or(1);
        let h = dt / f64::from(n);
        for k in 0..n {
            if !go_on() {
                return Ok(report);
            }
            let (time, ready, memory) = (t + f64::from(k) * h, self.memory.ready, &mut self.memory.slices());
            let (equation, x, v) = (&mut Carried(&self.flow), &mut self.x, &mut []);
            let (scratch, report) = (&mut self.scratch, &mut report);
            integrators::step(integrator, Step { equation, t: time, h, x, v, memory, ready, scratch, report })?;
            self.memory.ready = true;
            report.stepped(h);
            self.deliver(&mut unborn, if k + 1 == n { end } else { time + h }, end);
        }
        self.remove_dead(end, dt)?;
        self.time = end;
        self.pool.tell(exchange);
        Ok(report)
    }

    fn publish(&mut self, _t: f64, _exchange: &mut Turn<'_>) {}

    fn columns(&self, _t: f64, names: &[&str], out: &mut Vec<Column>) {
        for object in &self.objects {
            for name in names {
                let rows = &self.x[object.points.clone()];
                let rows: Vec<[Real; 3]> = match *name {
                    "position" => rows.iter().map(|x| [x[0], x[1], x[2]]).collect(),
                    "velocity" => {
                        let mut u = vec![ZERO; rows.len()];
                        self.flow.velocities(self.time, rows, &mut u);
                        u.iter().map(|u| [u[0], u[1], u[2]]).collect()
                    }
                    _ => continue,
                };
                out.push(object.column(name, rows.concat()));
            }
            if let Some(stream) = object.stream {
                self.pool.write(stream, &object.name, &[], out);
            }
        }
    }

    fn topology(&self, out: &mut Vec<Column>) {
        for object in self.objects.iter().filter(|o| o.stream.is_none_or(|s| !self.pool.emitter(s).has_radii())) {
            out.push(object.one_radius());
        }
    }

    fn ledger(&self, t: f64) -> Ledger {
        let speed = self.x.iter().map(|x| self.flow.at(t, xyz64(*x)).norm()).fold(0.0, f64::max);
        Ledger { time: t, speed: Some(speed), ..Ledger::default() }
    }

    /// A tracer is lost when it is not finite, or a million times as far out as the farthest at the start.
    fn breakdown(&mut self, t: f64) -> Option<StepError> {
        let far = |x: &Row| !is_finite(*x) || xyz64(*x).norm() > 1e6 * self.size;
        let i = self.x.iter().position(far)?;
        let object = self.objects.iter().find(|o| o.points.contains(&i));
        let breakdown = Box::new(Breakdown {
            system: self.settings.name.clone(),
            object: object.map_or(String::new(), |o| o.name.clone()),
            column: "position".into(),
            index: object.map_or(i, |o| i - o.points.start),
            id: self.pool.id_of(i),
            cell: None,
            time: t,
            integrator: self.settings.integrator.name().into(),
            step: 0.0,
            stable_step: f64::INFINITY,
            energy_ratio: None,
            cause: None,
        });
        Some(StepError::NotFinite(breakdown))
    }

    fn watch(&mut self, _on: bool) {}

    fn stability(&mut self, _dt: f64, _go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability> {
        None
    }

    fn save(&self, archive: &mut Archive) {
        if !self.pool.is_empty() {
            self.pool.save(archive);
        }
        archive.push_rows("x", &self.x);
        for column in &self.memory.columns {
            archive.push_rows("memory", column);
        }
        let ready = f64::from(u8::from(self.memory.ready));
        archive.push("numbers", Part::Numbers(vec![ready, self.memory.next_step, self.memory.last_error, self.time, self.size]));
    }

    fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        if !self.pool.is_empty() {
            self.pool.restore(archive)?;
            let rows = self.pool.end();
            owned(&mut self.x, &mut self.memory).rows.into_iter().for_each(|c| c.resize(rows, ZERO));
            self.count_rows();
        }
        archive.rows("x", &mut self.x)?;
        for column in &mut self.memory.columns {
            archive.rows("memory", column)?;
        }
        let numbers = archive.numbers("numbers")?;
        let [ready, next_step, last_error, time, size] = numbers[..] else { return None };
        (self.time, self.size) = (time, size);
        (self.memory.ready, self.memory.next_step, self.memory.last_error) = (ready == 1.0, next_step, last_error);
        Some(())
    }

    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool> {
        let points = self.objects.iter().find(|o| o.name == object)?.points.clone();
        if column != "position" || values.len() != 3 * points.len() {
            return Some(false);
        }
        for (x, value) in self.x[points].iter_mut().zip(values.chunks_exact(3)) {
            *x = [value[0] as Real, value[1] as Real, value[2] as Real, 0.0];
        }
        self.memory.ready = false;
        Some(true)
    }
}
