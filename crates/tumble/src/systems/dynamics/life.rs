//! Birth and death within a system: create new particles, compute forces, update, remove the dead.
//!
//! A particle is born at its own moment: it takes one step of its own length to the end of the sub-step that it is born in, by
//! the midpoint rule, under the forces on single masses; from there on it goes with all others. The dead leave when the
//! exchange interval ends, and who is born of them is born where and when they died.              (particles.11)

use super::laws::Local;
use super::{BLOCK, Dynamics, contact};
use crate::integrators::{self, Equation, Memory, Scratch};
use crate::math::{Real, Row, Vec3, ZERO, axpy, xyz64};
use crate::pool::{Birth, Columns, Parent, Pool};
use crate::state::Masses;
use rayon::prelude::*;
use tumble_interface::StepError;
use tumble_interface::engine::StepReport;

/// Newborn of one emitter at a later time.
struct Grown {
    x: Vec<Row>,
    v: Vec<Row>,
}

impl Dynamics {
    /// Those who are there at the start.
    pub(super) fn begin_life(&mut self, dt: f64) -> Result<(), StepError> {
        let mut unborn = self.conceive(-dt, dt)?;
        self.deliver(&mut unborn, 0.0, dt, 0.0)
    }

    /// Everyone grows older by the interval; tells who of each emitter will be born in it, in the order of their birth.
    pub(super) fn conceive(&mut self, t: f64, dt: f64) -> Result<Vec<Vec<Birth>>, StepError> {
        self.pool.grow_older(dt);
        (0..self.pool.len()).map(|s| self.pool.births(s, t, dt).ok_or_else(|| self.full(s, t))).collect()
    }

    fn full(&self, s: usize, t: f64) -> StepError {
        StepError::Capacity { system: self.name.clone(), time: t, what: self.pool.emitter(s).full() }
    }

    /// Takes those born by the time `until`, where a sub-step of length h [s] ends, into the system. The interval ends at
    /// `end`.
    pub(super) fn deliver(&mut self, unborn: &mut [Vec<Birth>], until: f64, h: f64, end: f64) -> Result<(), StepError> {
        for (s, unborn) in unborn.iter_mut().enumerate() {
            let due = if until >= end { unborn.len() } else { unborn.partition_point(|b| b.time <= until) };
            if due > 0 {
                let births: Vec<Birth> = unborn.drain(..due).collect();
                let grown = self.grow(s, &births, (until, h, 0))?;
                self.settle(s, &births, grown, end);
            }
        }
        Ok(())
    }

    /// Takes those born in an interval of sub-steps (t, h, count) into a system in which no mass feels another, all at its
    /// end.
    pub(super) fn deliver_grown(&mut self, unborn: Vec<Vec<Birth>>, (t, h, count): (f64, f64, u32)) -> Result<(), StepError> {
        let end = t + h * f64::from(count);
        for (s, births) in unborn.into_iter().enumerate() {
            let mut all: Option<Grown> = None;
            let mut first = 0;
            for k in 1..=count {
                let until = t + f64::from(k) * h;
                let last = if k == count { births.len() } else { births.partition_point(|b| b.time <= until) };
                if last > first {
                    let grown = self.grow(s, &births[first..last], (until, h, count - k))?;
                    match &mut all {
                        None => all = Some(grown),
                        Some(all) => {
                            all.x.extend(grown.x);
                            all.v.extend(grown.v);
                        }
                    }
                    first = last;
                }
            }
            if let Some(grown) = all {
                self.settle(s, &births, grown, end);
            }
        }
        Ok(())
    }

    /// The newborn at the time `until`, where the sub-step that they are born in ends, and so many sub-steps later.
    fn grow(&self, s: usize, births: &[Birth], (until, h, more): (f64, f64, u32)) -> Result<Grown, StepError> {
        let masses = weigh(&self.pool, s, births.iter().map(|b| b.id), !self.laws.masses.charge.is_empty());
        let object = self.objects.iter().position(|o| o.stream == Some(s));
        let row = |p: Vec3<f64>, w: Real| [p.x as Real, p.y as Real, p.z as Real, w];
        let mut x: Vec<Row> = births.iter().map(|b| row(b.x, (1.0 / self.pool.emitter(s).mass(b.id)) as Real)).collect();
        let mut v: Vec<Row> = births.iter().map(|b| row(b.v, 0.0)).collect();
        let (laws, colliders, resting) = (&self.laws, &self.laws.colliders[..], self.resting_speed(h));
        let touch = |t: f64, h: f64, before: (Row, Row), x: &mut Row, v: &mut Row| {
            let step = contact::Step { t, h, resting };
            !colliders.is_empty() && h > 0.0 && contact::resolve(colliders, &step, before, x, v)
        };
        let scheme = if self.integrator.is_implicit() || self.integrator.is_adaptive() {
            tumble_interface::scene::Integrator::Midpoint
        } else {
            self.integrator
        };
        let one = |start: usize, births: &[Birth], x: &mut [Row], v: &mut [Row]| -> Result<(), StepError> {
            let mut motion = Local { laws, masses: &masses, start, newborn: object };
            let n = x.len();
            let (mut a, mut xm, mut vm) = (vec![ZERO; n], x.to_vec(), v.to_vec());
            motion.rate(until - h, x, v, &mut a)?;
            let tau = |i: usize| (until - births[i].time).clamp(0.0, h) as Real;
            for i in 0..n {
                xm[i] = axpy(x[i], 0.5 * tau(i), v[i]);
                vm[i] = axpy(v[i], 0.5 * tau(i), a[i]);
            }
            motion.rate(until - 0.5 * h, &xm, &vm, &mut a)?;
            for i in 0..n {
                let before = (x[i], v[i]);
                x[i] = axpy(x[i], tau(i), vm[i]);
                v[i] = axpy(v[i], tau(i), a[i]);
                touch(until - f64::from(tau(i)), f64::from(tau(i)), before, &mut x[i], &mut v[i]);
            }
            let mut memory = Memory::new(scheme, n);
            let (mut ready, mut scratch) = (false, Scratch::default());
            for k in 0..more {
                let before: Vec<(Row, Row)> = x.iter().copied().zip(v.iter().copied()).collect();
                let mut columns: Vec<&mut [Row]> = memory.columns.iter_mut().map(|c| &mut c[..]).collect();
                let time = until + f64::from(k) * h;
                let mut report = StepReport::default();
                integrators::step(scheme, &mut motion, (time, h), (&mut *x, &mut *v), &mut columns, ready, &mut scratch, &mut report)?;
                ready = true;
                for i in 0..n {
                    ready &= !touch(time, h, before[i], &mut x[i], &mut v[i]);
                }
            }
            Ok(())
        };
        let blocks = x.par_chunks_mut(BLOCK).zip(v.par_chunks_mut(BLOCK)).zip(births.par_chunks(BLOCK)).enumerate();
        let done: Vec<Result<(), StepError>> = blocks.map(|(c, ((x, v), births))| one(c * BLOCK, births, x, v)).collect();
        done.into_iter().collect::<Result<(), StepError>>()?;
        Ok(Grown { x, v })
    }

    /// Gives the newborn of an emitter their rows; their ages will be right at the time `end`.
    fn settle(&mut self, s: usize, births: &[Birth], grown: Grown, end: f64) {
        let surplus = self.pool.surplus(s, births.len());
        self.pool.remove(s, &surplus, owned(&mut self.state.x, &mut self.state.v, &mut self.laws.masses, &mut self.memory));
        // Where even the newborn are too many, the last of them live.
        let most = self.pool.emitter(s).most().unwrap_or(usize::MAX);
        let skip = births.len().saturating_sub(most);
        let births = &births[skip..];
        let rows = self.pool.insert(s, births, end, owned(&mut self.state.x, &mut self.state.v, &mut self.laws.masses, &mut self.memory));
        self.state.x[rows.clone()].copy_from_slice(&grown.x[skip..]);
        self.state.v[rows.clone()].copy_from_slice(&grown.v[skip..]);
        let charged = !self.laws.masses.charge.is_empty();
        let masses = weigh(&self.pool, s, births.iter().map(|b| b.id), charged);
        self.laws.masses.mass[rows.clone()].copy_from_slice(&masses.mass);
        if charged {
            self.laws.masses.charge[rows.clone()].copy_from_slice(&masses.charge);
        }
        // What they bring with them is a scale of energy.
        let gravity = Vec3::from(self.laws.gravity);
        let energy = |i: usize| {
            let (x, v) = (xyz64(self.state.x[i]), xyz64(self.state.v[i]));
            f64::from(self.laws.masses.mass[i]) * (0.5 * v.norm_sq() + gravity.dot(x).abs())
        };
        let brought = rows.map(energy).sum();
        self.scale.add(brought);
        self.count_rows();
    }

    /// At the time t, where an interval of length dt [s] ends: the dead leave, and children of the dead and of the living
    /// come.
    pub(super) fn bury(&mut self, t: f64, dt: f64) -> Result<(), StepError> {
        let n = self.pool.len();
        let mut mourned: Vec<Vec<Parent>> = Vec::with_capacity(n);
        let mut children: Vec<Vec<Birth>> = Vec::with_capacity(n);
        for s in 0..n {
            children.push(self.pool.children(s, t, dt, &self.state.x, &self.state.v).ok_or_else(|| self.full(s, t))?);
        }
        for s in 0..n {
            let colliders = &self.laws.colliders;
            let near = |p: Vec3<f64>, distance: f64| colliders.iter().any(|c| c.distance(p, t, distance).0 < distance);
            let dead = self.pool.dead(s, t, &self.state.x, &self.state.v, &near);
            let is_parent = (0..n).any(|child| self.pool.parent(child) == Some(s));
            mourned.push(if is_parent { self.pool.mourn(s, &dead, (t, dt), &self.state.x, &self.state.v) } else { Vec::new() });
            if !dead.is_empty() {
                self.pool.remove(s, &dead, owned(&mut self.state.x, &mut self.state.v, &mut self.laws.masses, &mut self.memory));
                self.count_rows();
            }
        }
        for s in 0..n {
            let mut births = std::mem::take(&mut children[s]);
            if let Some(parent) = self.pool.parent(s) {
                births.extend(self.pool.orphans(s, &mourned[parent]).ok_or_else(|| self.full(s, t))?);
            }
            if !births.is_empty() {
                let grown = self.grow(s, &births, (t, dt, 0))?;
                self.settle(s, &births, grown, t);
            }
        }
        Ok(())
    }

    /// Tells everything that counts rows how many there are now.
    fn count_rows(&mut self) {
        let rows = self.pool.end();
        self.laws.masses.points = rows;
        self.memory.ready = false;
        for object in &mut self.objects {
            if let Some(s) = object.stream {
                object.points = self.pool.rows(s);
            }
        }
        for force in &mut self.laws.forces {
            for (range, object) in force.ranges.iter_mut().zip(&force.objects) {
                *range = self.objects[*object].points.clone();
            }
        }
        let rows = |objects: &Vec<usize>| objects.iter().map(|o| self.objects[*o].points.clone()).collect();
        for (batch, on, others) in &self.between {
            self.laws.batches[*batch].renew(rows(on), others.as_ref().map(rows), &self.laws.masses);
        }
    }

    /// After the pool was read back: room for its rows, and what they weigh.
    pub(super) fn take_pool(&mut self) {
        let rows = self.pool.end();
        let charged = !self.laws.masses.charge.is_empty();
        let columns = owned(&mut self.state.x, &mut self.state.v, &mut self.laws.masses, &mut self.memory);
        columns.rows.into_iter().for_each(|c| c.resize(rows, ZERO));
        columns.numbers.into_iter().for_each(|c| c.resize(rows, 0.0));
        for s in 0..self.pool.len() {
            let masses = weigh(&self.pool, s, self.pool.ids(s).iter().copied(), charged);
            let rows = self.pool.rows(s);
            for (x, id) in self.state.x[rows.clone()].iter_mut().zip(self.pool.ids(s)) {
                x[3] = (1.0 / self.pool.emitter(s).mass(*id)) as Real;
            }
            self.laws.masses.mass[rows.clone()].copy_from_slice(&masses.mass);
            if charged {
                self.laws.masses.charge[rows].copy_from_slice(&masses.charge);
            }
        }
        self.count_rows();
    }
}

/// What newborn weigh.
fn weigh(pool: &Pool, s: usize, ids: impl Iterator<Item = u32>, charged: bool) -> Masses {
    let emitter = pool.emitter(s);
    let mass: Vec<f64> = ids.map(|id| emitter.mass(id)).collect();
    Masses {
        mass: mass.iter().map(|m| *m as Real).collect(),
        inverse_inertia: Vec::new(),
        charge: if charged { vec![emitter.words().charge as Real; mass.len()] } else { Vec::new() },
        points: mass.len(),
    }
}

/// The columns whose rows a pool moves.
fn owned<'a>(x: &'a mut Vec<Row>, v: &'a mut Vec<Row>, masses: &'a mut Masses, memory: &'a mut Memory) -> Columns<'a> {
    let mut numbers = vec![&mut masses.mass];
    if !masses.charge.is_empty() {
        numbers.push(&mut masses.charge);
    }
    Columns { rows: [x, v].into_iter().chain(&mut memory.columns).collect(), numbers }
}
