//! Birth and death within a system: create new particles, compute forces, update, remove dead ones.
//!
//! A particle is born at its own moment: it takes one step of its own length to the end of the sub-step that it is born in, by
//! the midpoint rule (more where that is too long a step for the forces), under the forces on single masses; from there on it goes with all others. The dead leave when the
//! exchange interval ends, and their children are born where and when they died.              (particles.11)

use super::contact::{Found, Pass, Step as Contact};
use super::core::{BLOCK, Between, Core};
use super::laws::Local;
use crate::forces::One;
use crate::integrators::{self, Equation, Memory, Scratch, Step};
use crate::math::parallel::Tasks;
use crate::math::{Real, Row, Vec3, ZERO, axpy, xyz64};
use crate::pool::{Birth, Columns, Hit, Pool, due};
use crate::state::{Frames, Masses};
use std::ops::Range;
use tumble_interface::StepError;
use tumble_interface::engine::StepReport;
use tumble_interface::scene::Integrator;

/// Pieces that the first step of a life is cut into at most.
const PIECES: f64 = 1000.0;

/// Newborn of one emitter at a later time.
struct Newborn {
    x: Vec<Row>,
    v: Vec<Row>,
    /// Solids that they met, with the place of each in the list of births.
    hits: Vec<(usize, Hit)>,
}

impl Core {
    /// Births at the start.
    pub fn begin_life(&mut self, dt: f64) -> Result<(), StepError> {
        let mut unborn = self.pool.schedule_births(&self.name, -dt, dt)?;
        self.insert_births(&mut unborn, 0.0, dt, 0.0)
    }

    /// Takes those born by the time `until`, where a sub-step of length h [s] ends, into the system. The interval ends at
    /// `end`.
    pub fn insert_births(&mut self, unborn: &mut [Vec<Birth>], until: f64, h: f64, end: f64) -> Result<(), StepError> {
        for (s, unborn) in unborn.iter_mut().enumerate() {
            let births = due(unborn, until, end);
            if !births.is_empty() {
                let grown = self.advance_newborn(s, &births, (until, h, 0))?;
                self.insert_newborn(s, &births, grown, (until, end));
            }
        }
        Ok(())
    }

    /// Takes those born in an interval of sub-steps (t, h, count) into a system in which no mass feels another, all at its
    /// end.
    pub fn insert_births_of_interval(&mut self, unborn: Vec<Vec<Birth>>, (t, h, count): (f64, f64, u32)) -> Result<(), StepError> {
        let end = t + h * f64::from(count);
        for (s, births) in unborn.into_iter().enumerate() {
            let mut all: Option<Newborn> = None;
            let mut first = 0;
            for k in 1..=count {
                let until = t + f64::from(k) * h;
                let last = if k == count { births.len() } else { births.partition_point(|b| b.time <= until) };
                if last > first {
                    let grown = self.advance_newborn(s, &births[first..last], (until, h, count - k))?;
                    match &mut all {
                        None => all = Some(grown),
                        Some(all) => {
                            all.x.extend(grown.x);
                            all.v.extend(grown.v);
                            all.hits.extend(grown.hits.into_iter().map(|(i, hit)| (first + i, hit)));
                        }
                    }
                    first = last;
                }
            }
            if let Some(grown) = all {
                self.insert_newborn(s, &births, grown, (end, end));
            }
        }
        Ok(())
    }

    /// The newborn at the time `until`, where the sub-step that they are born in ends, and so many sub-steps later.
    fn advance_newborn(&self, s: usize, births: &[Birth], (until, h, more): (f64, f64, u32)) -> Result<Newborn, StepError> {
        let masses = weigh(&self.pool, s, births.iter().map(|b| b.id), !self.laws.masses.charge.is_empty());
        let object = self.objects.iter().position(|o| o.stream == Some(s));
        let row = |p: Vec3<f64>, w: Real| [p.x as Real, p.y as Real, p.z as Real, w];
        let mut x: Vec<Row> = births.iter().map(|b| row(b.x, (1.0 / self.pool.emitter(s).mass(b.id)) as Real)).collect();
        let mut v: Vec<Row> = births.iter().map(|b| row(b.v, 0.0)).collect();
        let (laws, colliders, resting) = (&self.laws, &self.laws.colliders[..], self.resting_speed(h));
        let every = 0..usize::MAX;
        let observed: &[Range<usize>] = if self.pool.heeds_hits(s) { std::slice::from_ref(&every) } else { &[] };
        let touch = |i: usize, (t, h, lead): (f64, f64, f64), before: (Row, Row), x: &mut Row, v: &mut Row, found: &mut Found| {
            let step = Contact { t, h, resting, lead, observed: false };
            let pass = Pass { colliders, step, penalty: false, observed, counted: &[] };
            !colliders.is_empty() && h > 0.0 && pass.mass(i, before, x, v, found)
        };
        let rate = self.stiffness_of(object, births, &masses);
        let scheme = if self.integrator.is_implicit() || self.integrator.is_adaptive() { Integrator::Midpoint } else { self.integrator };
        let one = |start: usize, births: &[Birth], x: &mut [Row], v: &mut [Row]| -> Result<Vec<(usize, Hit)>, StepError> {
            let mut found = Found::default();
            let mut motion = Local { laws, masses: &masses, start, newborn: object };
            let n = x.len();
            let (mut a, mut xm, mut vm) = (vec![ZERO; n], x.to_vec(), v.to_vec());
            let span = |i: usize| (until - births[i].time).max(0.0);
            let longest = (0..n).map(span).fold(0.0, f64::max);
            let pieces = (longest / h * (1.0 - 1e-9)).max(2.0 * longest * rate).ceil().clamp(1.0, PIECES);
            let tau = |i: usize| (span(i) / pieces) as Real;
            for k in 0..pieces as usize {
                // The time of the earliest birth; all end at the same.
                let time = until - longest * (1.0 - k as f64 / pieces);
                motion.rate(time, x, v, &mut a)?;
                for i in 0..n {
                    xm[i] = axpy(x[i], 0.5 * tau(i), v[i]);
                    vm[i] = axpy(v[i], 0.5 * tau(i), a[i]);
                }
                motion.rate(time + 0.5 * longest / pieces, &xm, &vm, &mut a)?;
                for i in 0..n {
                    let before = (x[i], v[i]);
                    x[i] = axpy(x[i], tau(i), vm[i]);
                    v[i] = axpy(v[i], tau(i), a[i]);
                    let begun = until - span(i) * (1.0 - k as f64 / pieces);
                    touch(start + i, (begun, f64::from(tau(i)), 0.0), before, &mut x[i], &mut v[i], &mut found);
                }
            }
            let mut memory = Memory::new(scheme, n);
            let (mut ready, mut scratch) = (false, Scratch::default());
            for k in 0..more {
                let before: Vec<(Row, Row)> = x.iter().copied().zip(v.iter().copied()).collect();
                let (t, equation, memory) = (until + f64::from(k) * h, &mut motion, &mut memory.slices());
                let (scratch, report) = (&mut scratch, &mut StepReport::default());
                integrators::step(scheme, Step { equation, t, h, x, v, memory, ready, scratch, report })?;
                ready = true;
                for i in 0..n {
                    ready &= !touch(start + i, (t, h, integrators::lead(scheme)), before[i], &mut x[i], &mut v[i], &mut found);
                }
            }
            Ok(found.hits)
        };
        let blocks = x.chunks_mut(BLOCK).zip(v.chunks_mut(BLOCK)).zip(births.chunks(BLOCK)).enumerate();
        let done: Vec<Result<Vec<_>, StepError>> = blocks.map_in_parallel(|(c, ((x, v), births))| one(c * BLOCK, births, x, v));
        let hits = done.into_iter().collect::<Result<Vec<_>, StepError>>()?.concat();
        Ok(Newborn { x, v, hits })
    }

    /// How fast the forces on single masses change the motion of the first of some newborn [1/s]: steps of half of its inverse are
    /// stable and accurate.
    fn stiffness_of(&self, object: Option<usize>, births: &[Birth], masses: &Masses) -> f64 {
        let (Some(object), Some(birth)) = (object, births.first()) else { return 0.0 };
        let one =
            One { mass: f64::from(masses.mass[0]), charge: masses.charge.first().map_or(0.0, |q| f64::from(*q)), x: birth.x, v: birth.v };
        let acting = self.laws.forces.iter().filter(|f| f.objects.contains(&object));
        let largest = |b: [Real; 6]| b.iter().map(|b| f64::from(b.abs())).fold(0.0, f64::max) / one.mass;
        acting.map(|f| f.law.matrix(birth.time, &one)).map(|(k, d)| largest(k).sqrt() + largest(d)).sum()
    }

    /// Gives the newborn of an emitter their rows at the time `now`; their ages will be right at the time `end`.
    fn insert_newborn(&mut self, s: usize, births: &[Birth], grown: Newborn, (now, end): (f64, f64)) {
        let v = |row: usize| self.state.v[row];
        let surplus = self.pool.surplus(s, births, (now, end), &self.state.x, &v);
        let start = self.pool.rows(s).start;
        self.count_energy(-1.0, surplus.iter().map(|k| start + *k as usize));
        self.pool.remove(s, &surplus, owned(&mut self.state.x, &mut self.state.v, &mut self.laws.masses, &mut self.memory));
        // If even the newborn are too many, the last of them live.
        let most = self.pool.emitter(s).most().unwrap_or(usize::MAX);
        let skip = births.len().saturating_sub(most);
        for (i, hit) in grown.hits {
            self.pool.note(s, births[i].id, end - births[i].time, hit);
        }
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
        self.count_energy(1.0, rows);
        self.count_rows();
    }

    /// At the time t, where an interval of length dt [s] ends: the dead leave, and children of the dead and of the living come.
    /// Parents stand before their children, so that newborn may have children, and die, here.
    pub fn remove_dead(&mut self, t: f64, dt: f64, h: f64) -> Result<(), StepError> {
        let n = self.pool.len();
        let mut born: Vec<Vec<Birth>> = vec![Vec::new(); n];
        for s in 0..n {
            let births = std::mem::take(&mut born[s]);
            if !births.is_empty() {
                let grown = self.advance_newborn(s, &births, (t, h, 0))?;
                self.insert_newborn(s, &births, grown, (t, t));
            }
            let colliders = &self.laws.colliders;
            let near = |p: Vec3<f64>, distance: f64| colliders.iter().any(|c| c.distance(p, t, distance).0 < distance);
            let dead = self.pool.dead(s, (t, dt), &self.state.x, &self.state.v, &near);
            for (child, births) in self.pool.descendants(s, &self.name, t, &dead, (&self.state.x, &self.state.v))? {
                born[child] = births;
            }
            let dead: Vec<u32> = dead.into_iter().map(|(k, _)| k).collect();
            if !dead.is_empty() {
                let start = self.pool.rows(s).start;
                self.count_energy(-1.0, dead.iter().map(|k| start + *k as usize));
                self.pool.remove(s, &dead, owned(&mut self.state.x, &mut self.state.v, &mut self.laws.masses, &mut self.memory));
                self.count_rows();
            }
        }
        self.pool.calm();
        Ok(())
    }

    /// The energy that masses bring with them, or take away.
    fn count_energy(&mut self, sign: f64, rows: impl Iterator<Item = usize>) {
        // Of gravity that changes, the largest is a scale, and no energy to count from.
        let course = &self.laws.gravity.course;
        let gravity = Vec3::from(self.laws.gravity.at(0.0));
        let (mut kinetic, mut potential) = (0.0, 0.0);
        for i in rows {
            let (mass, x, v) = (f64::from(self.laws.masses.mass[i]), xyz64(self.state.x[i]), xyz64(self.state.v[i]));
            kinetic += 0.5 * mass * v.norm_sq();
            potential -= if course.is_constant() { mass * gravity.dot(x) } else { -mass * self.laws.gravity.largest * x.norm() };
        }
        self.scale.count(sign, kinetic, potential);
    }

    /// Tells everything that counts rows how many there are now.
    fn count_rows(&mut self) {
        self.memory.ready = false;
        self.pool.place(&mut self.objects);
        for force in &mut self.laws.forces {
            for (range, object) in force.ranges.iter_mut().zip(&force.objects) {
                *range = self.objects[*object].points.clone();
            }
        }
        let rows = |objects: &Vec<usize>| objects.iter().map(|o| self.objects[*o].points.clone()).collect();
        for Between { batch, objects, others } in &self.between {
            self.laws.batches[*batch].renew(rows(objects), others.as_ref().map(rows), &self.laws.masses);
        }
    }

    /// After the pool was read back: room for its rows, and their masses.
    pub fn take_pool(&mut self) {
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

/// Masses of newborn.
fn weigh(pool: &Pool, s: usize, ids: impl Iterator<Item = u32>, charged: bool) -> Masses {
    let emitter = pool.emitter(s);
    let mass: Vec<f64> = ids.map(|id| emitter.mass(id)).collect();
    Masses {
        mass: mass.iter().map(|m| *m as Real).collect(),
        inverse_inertia: Vec::new(),
        charge: if charged { vec![emitter.words().charge as Real; mass.len()] } else { Vec::new() },
        frames: Frames::default(),
        ghosts: 0,
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
