//! Grains: spheres that touch each other, solids and rigid bodies, each contact a spring with friction that remembers how far it has slipped.
//!
//!   m v' = m g + sum of F,   I ω' = sum of r × F + M,   x' = v                                                         (grains.4)
//!
//! Velocity Verlet: half a kick, a drift, the forces of all contacts, half a kick. Places, velocities and sums are in double precision in both engines:
//! an overlap is a millionth of a place. The force of a pair is in the engine's scalar.

mod bed;
mod clumps;
mod hard;
mod kick;
mod law;
mod list;
mod positions;
mod pour;
mod press;
mod walls;

pub use clumps::{Clump, Clumps};
pub use law::{Material, longest_step};
pub use positions::settling_step;
pub use pour::Pour;

use crate::exchange::Turn;
use crate::forces::Gravity;
use crate::geometry::{Collider, Vector};
use crate::integrators::equal_steps;
use crate::math::Real;
use crate::system::{Archive, Part, System};
use bed::{Bed, Body};
use kick::Kick;
use law::{Dampings, Memory, Pair};
use list::{Kept, List, SKIN, WIDE_SKIN, point};
use std::ops::Range;
use std::sync::Arc;
use tumble_interface::engine::{BLOW_UP, Ledger, Share, Stability, StepReport, Worst};
use tumble_interface::error::Breakdown;
use tumble_interface::scene::{GrainScheme, NormalLaw};
use tumble_interface::{Column, StepError};
use walls::{WallContact, Walls};

/// Numbers of a row, of a contact of two grains, and of one with a wall, in a snapshot.
const ROW: usize = 9;
const CONTACT: usize = 8;
const WALL: usize = 11;
/// Overlap at the start, over the least radius, that is taken apart, and what is left of it.
const OVERLAP: f64 = 0.1;
const LEFT: f64 = 0.01;
/// Candidates of a grain, on average: those that do not overlap have some ten each, of any sizes.
const CROWD: usize = 100;
/// Passes that take overlaps apart, with the candidates of a sort, and sorts.
const PASSES: usize = 20;
const SORTS: usize = 50;

/// A grain at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grain {
    /// Its place [m].
    pub x: Vector,
    /// Its radius [m].
    pub radius: f64,
    /// Its mass [kg], or that of its clump.
    pub mass: f64,
    /// Its velocity [m/s].
    pub v: Vector,
    /// Its angular velocity [rad/s].
    pub w: Vector,
}

/// Grains of one material.
pub struct Object {
    /// Its name.
    pub name: String,
    /// Its grains, those that are still to be born at the end.
    pub grains: Range<usize>,
    /// How these are.
    pub pour: Option<Pour>,
}

impl Object {
    /// Those that have been born.
    fn living(&self) -> Range<usize> {
        self.living_with(self.pour.as_ref().map_or(0, |pour| pour.born))
    }

    /// The same if so many had been poured, as far as there are so many.
    fn living_with(&self, born: u32) -> Range<usize> {
        let unborn = self.pour.as_ref().map_or(0, |pour| pour.count().saturating_sub(born) as usize);
        self.grains.start..self.grains.end - unborn
    }
}

/// How the system goes on.
pub struct Settings {
    /// Its name.
    pub name: String,
    /// Sub-steps of an interval, if the scene says so.
    pub substeps: Option<u32>,
    /// The longest sub-step, if the scene says so [s].
    pub step: Option<f64>,
    /// The longest that resolves contacts [s].
    pub longest: f64,
    /// The largest speed of sound of a material [m/s].
    pub sound: f64,
    /// How contacts act.
    pub scheme: GrainScheme,
    /// The force of a contact.
    pub law: NormalLaw,
    /// Gravity.
    pub gravity: Gravity,
}

/// Grains.
pub struct Grains {
    settings: Settings,
    objects: Vec<Object>,
    /// Radius [m], 1/mass [1/kg] and kind of each grain, born or not.
    known: Vec<[f64; 3]>,
    bed: Bed,
    walls: Walls,
    /// The last sub-step [s].
    h: f64,
    /// The largest kinetic energy that was found healthy [J].
    scale: f64,
    tolerant: bool,
}

/// Overlaps at the start.
pub enum Overlaps {
    /// More grains meet than could be moved apart, so many on average [1].
    Crushed(usize),
    /// They have been moved apart as far as they could.
    Parted {
        /// How many there were.
        count: usize,
        /// The deepest [m].
        deepest: f64,
        /// What is left of it [m].
        left: f64,
        /// What may be left [m].
        most: f64,
    },
}

impl Grains {
    /// Objects with the materials of their grains; grains in the order of the objects, and the clumps that some of them make.
    pub fn new(settings: Settings, objects: Vec<(Object, Material)>, grains: &[Grain], clumps: Clumps) -> Self {
        let (objects, kinds): (Vec<Object>, Vec<Material>) = objects.into_iter().unzip();
        let mut dampings = Dampings::default();
        let mut pairs = Vec::new();
        for a in &kinds {
            pairs.extend(kinds.iter().map(|b| Pair::new(settings.law, a, b, &mut dampings)));
        }
        let radii =
            grains.iter().fold([f64::INFINITY, 0.0_f64], |[least, largest], grain| [least.min(grain.radius), largest.max(grain.radius)]);
        let skin = match settings.scheme {
            GrainScheme::Forces => SKIN,
            GrainScheme::Positions => WIDE_SKIN,
        };
        let row = |v: Vector, number: f64| [v.x, v.y, v.z, number];
        let kind = |i: usize| objects.iter().position(|object| object.grains.contains(&i)).unwrap_or_default() as f64;
        let known: Vec<[f64; 3]> = grains.iter().enumerate().map(|(i, grain)| [grain.radius, 1.0 / grain.mass, kind(i)]).collect();
        let born: Vec<usize> = objects.iter().flat_map(Object::living).collect();
        let mut bed = Bed {
            x: born.iter().map(|i| row(grains[*i].x, known[*i][0])).collect(),
            v: born.iter().map(|i| row(grains[*i].v, known[*i][1])).collect(),
            w: born.iter().map(|i| row(grains[*i].w, known[*i][2])).collect(),
            grain: born.iter().map(|i| *i as u32).collect(),
            pairs,
            kinds: kinds.len(),
            list: List::new(grains.len(), radii, skin),
            clumps,
            ..Bed::default()
        };
        bed.clumps.sort(&bed.grain);
        let walls = Walls::new(settings.law, kinds);
        Self { settings, objects, known, bed, walls, h: 0.0, scale: 0.0, tolerant: false }
    }

    /// Takes over solids that others have published.
    pub fn meet(&mut self, solids: &Arc<Vec<Collider>>) {
        self.walls.meet(solids);
    }

    /// Moves grains that overlap, each other or solids, apart, if any do by more than they may.
    pub fn part(&mut self) -> Option<Overlaps> {
        let least = self.bed.x.iter().map(|x| x[3]).fold(f64::INFINITY, f64::min);
        if self.bed.is_crushed(CROWD) {
            return Some(Overlaps::Crushed(CROWD));
        }
        self.bed.sort(&mut self.walls, 0.0);
        let given = self.bed.x.clone();
        let (count, deepest) = self.bed.part(&self.walls);
        if deepest <= OVERLAP * least {
            self.bed.x = given;
            return None;
        }
        let mut left = deepest;
        for _ in 0..SORTS {
            // Solids may leave no room.
            if self.bed.is_crushed(CROWD) {
                return Some(Overlaps::Crushed(CROWD));
            }
            self.bed.sort(&mut self.walls, 0.0);
            left = self.bed.part(&self.walls).1;
            if left <= LEFT * least {
                break;
            }
            (1..PASSES).for_each(|_| _ = self.bed.part(&self.walls));
        }
        Some(Overlaps::Parted { count, deepest, left, most: OVERLAP * least })
    }

    fn steps(&self, dt: f64) -> u32 {
        self.settings.substeps.unwrap_or_else(|| equal_steps(dt, self.settings.step.unwrap_or(self.settings.longest)) as u32)
    }

    fn pours(&self) -> impl Iterator<Item = &Pour> {
        self.objects.iter().filter_map(|object| object.pour.as_ref())
    }

    /// Grains that wait for room at a time [s], if any are poured.
    fn waiting(&self, t: f64) -> Option<u64> {
        self.pours().map(|pour| u64::from(pour.due(t).saturating_sub(pour.born))).reduce(|a, b| a + b)
    }

    /// The row of each grain; of one that is not born none.
    fn rows(&self) -> Vec<u32> {
        let mut rows = vec![u32::MAX; self.known.len()];
        self.bed.grain.iter().enumerate().for_each(|(row, grain)| rows[*grain as usize] = row as u32);
        rows
    }

    /// What does not change of an object's grains.
    fn constants(&self, object: &Object, rows: &[u32], out: &mut Vec<Column>) {
        let of = |number: &dyn Fn(usize) -> f64| rows[object.living()].iter().map(|row| number(*row as usize) as Real).collect::<Vec<_>>();
        out.push(Column::new(&object.name, "radius", of(&|row| self.bed.x[row][3])));
        out.push(Column::new(&object.name, "mass", of(&|row| self.bed.mass(row))));
    }

    /// Object of a row, and the index of its grain there.
    fn owner(&self, row: usize) -> Option<(&Object, usize)> {
        let grain = *self.bed.grain.get(row)? as usize;
        self.objects.iter().find(|object| object.grains.contains(&grain)).map(|object| (object, grain - object.grains.start))
    }

    /// What is told of a row that broke.
    fn broken(&self, row: usize, column: &str, t: f64, energy_ratio: Option<f64>) -> Option<Box<Breakdown>> {
        let (object, index) = self.owner(row)?;
        Some(Box::new(Breakdown {
            system: self.settings.name.clone(),
            object: object.name.clone(),
            column: column.into(),
            index,
            id: None,
            cell: None,
            time: t,
            integrator: "grains".into(),
            step: self.h,
            stable_step: self.settings.longest,
            energy_ratio,
            cause: None,
        }))
    }

    fn kick(&mut self, t: f64, kick: Kick) {
        self.bed.kick(Vector::from(self.settings.gravity.at(t)), kick);
        self.walls.kick(kick);
    }

    /// Takes n steps of h from the time t on [s]; `false` if `go_on` ends it.
    fn go_by_forces(&mut self, (t, h, n): (f64, f64, u32), go_on: &(dyn Fn() -> bool + Sync), report: &mut StepReport) -> bool {
        self.bed.press(&mut self.walls, t, 0.0);
        self.kick(t, Kick { h: 0.5 * h, step: h, first: true });
        for k in 1..=n {
            if !go_on() {
                return false;
            }
            let time = t + f64::from(k) * h;
            self.walls.drift(h);
            self.bed.drift(&mut self.walls, time - h, h);
            self.bed.press(&mut self.walls, time, h);
            self.kick(time, Kick { h: if k < n { h } else { 0.5 * h }, step: h, first: false });
            report.stepped(h);
        }
        self.bed.settle();
        true
    }

    /// The same by positions.
    fn go_by_positions(&mut self, (t, h, n): (f64, f64, u32), go_on: &(dyn Fn() -> bool + Sync), report: &mut StepReport) -> bool {
        self.bed.recall(&self.walls);
        for k in 0..n {
            if !go_on() {
                return false;
            }
            let time = t + f64::from(k) * h;
            let gravity = self.settings.gravity.at(time).into();
            self.bed.step(&mut self.walls, time, h, gravity);
            report.stepped(h);
            report.sweeps += u64::from(positions::PASSES);
        }
        true
    }

    /// The state of rows of some grains.
    fn ledger_of(&self, rows: &[u32], t: f64) -> Ledger {
        let gravity = Vector::from(self.settings.gravity.at(t));
        let (mut momentum, mut spin, mut speed) = (Vector::default(), Vector::default(), 0.0_f64);
        let mut ledger = Ledger { time: t, ..Ledger::default() };
        for row in rows.iter().map(|row| *row as usize) {
            speed = speed.max(point(&self.bed.v[row]).norm());
            let Some(Body { mass, center, momenta: [linear, angular], kinetic }) = self.bed.body(row) else { continue };
            ledger.mass += mass;
            (momentum, spin) = (momentum + linear, spin + angular);
            ledger.kinetic += kinetic;
            ledger.external -= mass * gravity.dot(center);
        }
        Ledger { momentum: momentum.into(), angular_momentum: Some(spin.into()), speed: Some(speed), ..ledger }
    }
}

impl System for Grains {
    fn name(&self) -> &str {
        &self.settings.name
    }

    fn version(&self) -> u32 {
        3
    }

    /// Grains are no bodies that others push: they visit.
    fn absorb(&mut self, _exchange: &mut Turn<'_>) {}

    fn advance(&mut self, t: f64, dt: f64, exchange: &mut Turn<'_>, go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError> {
        self.meet(&exchange.surfaces().clone());
        self.walls.visit(exchange);
        let mut report = StepReport::default();
        let n = self.steps(dt);
        let h = dt / f64::from(n);
        self.h = h;
        self.bed.sort(&mut self.walls, t);
        let whole = match self.settings.scheme {
            GrainScheme::Forces => self.go_by_forces((t, h, n), go_on, &mut report),
            GrainScheme::Positions => self.go_by_positions((t, h, n), go_on, &mut report),
        };
        if !whole {
            return Ok(report);
        }
        self.walls.post(exchange);
        self.pour(t + dt, dt);
        Ok(report)
    }

    /// Looks at what it meets, so that its books are whole after a restore.
    fn publish(&mut self, _t: f64, exchange: &mut Turn<'_>) {
        self.meet(&exchange.surfaces().clone());
        self.walls.visit(exchange);
    }

    fn columns(&self, _t: f64, names: &[&str], out: &mut Vec<Column>) {
        let rows = self.rows();
        for object in &self.objects {
            for column in names {
                let of = match *column {
                    "position" => &self.bed.x,
                    "velocity" => &self.bed.v,
                    "angular_velocity" => &self.bed.w,
                    _ => continue,
                };
                let numbers = rows[object.living()].iter().flat_map(|row| of[*row as usize][..3].iter().map(|c| *c as Real));
                out.push(Column::new(&object.name, column, numbers.collect::<Vec<_>>()));
            }
            if object.pour.is_some() {
                self.constants(object, &rows, out);
            }
        }
    }

    /// Of objects whose grains are all there from the start.
    fn topology(&self, out: &mut Vec<Column>) {
        let rows = self.rows();
        self.objects.iter().filter(|object| object.pour.is_none()).for_each(|object| self.constants(object, &rows, out));
    }

    fn ledger(&self, t: f64) -> Ledger {
        let all: Vec<u32> = self.rows().into_iter().filter(|row| *row != u32::MAX).collect();
        let (energy, deepest, count) = self.bed.stored();
        let of = |contact: &WallContact| {
            let row = contact.row as usize;
            self.walls.energy(contact, self.bed.x[row][3], self.bed.w[row][3], t)
        };
        let elastic = match self.settings.scheme {
            GrainScheme::Forces => energy + self.walls.contacts().map(of).sum::<f64>(),
            GrainScheme::Positions => 0.0,
        };
        let depth = self.walls.contacts().map(|contact| contact.depth).fold(deepest.map_or(0.0, |(depth, _)| depth), f64::max);
        Ledger {
            elastic,
            penetration: Some(depth),
            contacts: Some(count + self.walls.contacts().count() as u64),
            waiting: self.waiting(t),
            ..self.ledger_of(&all, t)
        }
    }

    fn shares(&self, t: f64) -> Vec<Share> {
        let rows = self.rows();
        let share = |object: &Object| Share {
            system: self.settings.name.clone(),
            object: object.name.clone(),
            ledger: self.ledger_of(&rows[object.living()], t),
        };
        self.objects.iter().map(share).collect()
    }

    fn worst(&self, _t: f64) -> Vec<Worst> {
        let of = |measure, value, row: usize, other: Option<String>| {
            let (object, index) = self.owner(row)?;
            Some(Worst { measure, value, object: object.name.clone(), other, particles: vec![index], id: None, cell: None })
        };
        let speeds = self.bed.v.iter().map(|v| point(v).norm()).enumerate();
        let fastest = speeds.max_by(|a, b| a.1.total_cmp(&b.1)).and_then(|(row, speed)| of("speed", speed, row, None));
        let grains = self.bed.stored().1;
        let wall = self.walls.contacts().max_by(|a, b| a.depth.total_cmp(&b.depth));
        let deepest = match (grains, wall) {
            (Some((depth, [a, b])), wall) if wall.is_none_or(|wall| wall.depth <= depth) => {
                of("penetration", depth, a as usize, self.owner(b as usize).map(|(object, _)| object.name.clone()))
            }
            (_, Some(wall)) => of("penetration", wall.depth, wall.row as usize, self.walls.name(wall.surface).map(str::to_string)),
            _ => None,
        };
        fastest.into_iter().chain(deepest).collect()
    }

    fn breakdown(&mut self, t: f64) -> Option<StepError> {
        if let Some((row, column)) = self.bed.lost() {
            return Some(StepError::NotFinite(self.broken(row, column, t, None)?));
        }
        // Contacts make no grain faster than sound, unless steps are too long for them.
        let fastest = self.bed.v.iter().map(|v| point(v).norm_sq()).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        let kinetic = (0..self.bed.x.len()).filter_map(|row| self.bed.body(row)).map(|body| body.kinetic).sum::<f64>();
        let (row, square) = fastest?;
        let sudden = self.scale > 0.0 && kinetic > BLOW_UP * self.scale;
        if sudden && square > self.settings.sound * self.settings.sound && !self.tolerant {
            return Some(StepError::Exploded(self.broken(row, "velocity", t, Some(kinetic / self.scale))?));
        }
        self.scale = self.scale.max(kinetic);
        None
    }

    fn tolerate_explosions(&mut self, on: bool) {
        self.tolerant = on;
    }

    fn watch(&mut self, _on: bool) {}

    fn stability(&mut self, _dt: f64, _go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability> {
        None
    }

    fn save(&self, archive: &mut Archive) {
        let Bed { x, v, w, grain, list, .. } = &self.bed;
        archive.push_indices("grains", grain);
        let poured: Vec<u32> = self.pours().flat_map(|pour| [pour.born, pour.sought]).collect();
        archive.push_indices("poured", &poured);
        let rows = x.iter().zip(v).zip(w).flat_map(|((x, v), w)| [&x[..3], &v[..3], &w[..3]].concat());
        archive.push("rows", Part::Numbers(rows.collect()));
        let three = <[f64; 3]>::from;
        let (mut pairs, mut memories) = (Vec::new(), Vec::new());
        for (pair, memory) in list.kept() {
            pairs.extend(pair);
            memories.extend(memory.concat());
        }
        archive.push_indices("pairs", &pairs);
        archive.push("contacts", Part::Table(CONTACT, memories));
        let keys: Vec<u32> = self.walls.contacts().flat_map(|c| [c.row, c.surface]).collect();
        archive.push_indices("keys", &keys);
        let kept = self.walls.contacts().flat_map(|c| {
            let Memory { slip, turn, slides } = c.memory;
            [&three(c.normal)[..], &three(slip), &three(turn), &[c.depth, slides]].concat()
        });
        archive.push("walls", Part::Numbers(kept.collect()));
        archive.push("clumps", Part::Numbers(self.bed.clumps.save()));
    }

    fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        let (grain, poured, rows) = (archive.indices("grains")?, archive.indices("poured")?, archive.numbers("rows")?);
        let (pairs, memories) = (archive.indices("pairs")?, archive.table_of(CONTACT, "contacts")?);
        let (keys, kept, clumps) = (archive.indices("keys")?, archive.numbers("walls")?, archive.numbers("clumps")?);
        let mut sorted = grain.clone();
        sorted.sort_unstable();
        let count = sorted.len();
        let mut born = poured.iter().step_by(2).copied();
        let mut living = |object: &Object| object.living_with(object.pour.as_ref().and_then(|_| born.next()).unwrap_or(0));
        let living: Vec<usize> = self.objects.iter().flat_map(&mut living).collect();
        let whole = poured.len() == 2 * self.pours().count() && living.iter().copied().eq(sorted.iter().map(|grain| *grain as usize));
        let ordered =
            |keys: &[u32]| keys.chunks_exact(2).all(|key| (key[0] as usize) < count) && keys.chunks_exact(2).is_sorted_by_key(|key| key[0]);
        let fits = rows.len() == ROW * count && memories.len() * 2 == CONTACT * pairs.len() && kept.len() * 2 == WALL * keys.len();
        if !(whole && fits && ordered(&pairs) && ordered(&keys)) {
            return None;
        }
        self.bed.clumps.restore(&clumps)?;
        for (pour, s) in self.objects.iter_mut().filter_map(|object| object.pour.as_mut()).zip(poured.chunks_exact(2)) {
            (pour.born, pour.sought) = (s[0].min(pour.count()), s[1]);
        }
        // What does not change goes along with its grain.
        let (bed, known) = (&mut self.bed, &self.known);
        let row = |s: &[f64], number: f64| [s[0], s[1], s[2], number];
        let states = || rows.chunks_exact(ROW).zip(grain.iter().map(|grain| known[*grain as usize]));
        bed.x = states().map(|(s, [radius, ..])| row(s, radius)).collect();
        bed.v = states().map(|(s, [_, inverse, _])| row(&s[3..], inverse)).collect();
        bed.w = states().map(|(s, [.., kind])| row(&s[6..], kind)).collect();
        bed.grain = grain;
        let three = |s: &[f64]| Vector { x: s[0], y: s[1], z: s[2] };
        let contacts = pairs.chunks_exact(2).zip(memories.chunks_exact(CONTACT));
        let contacts: Vec<([u32; 2], Kept)> =
            contacts.map(|(pair, s)| ([pair[0], pair[1]], [[s[0], s[1], s[2], s[3]], [s[4], s[5], s[6], s[7]]])).collect();
        bed.remember(&contacts);
        let contact = |(key, s): (&[u32], &[f64])| WallContact {
            row: key[0],
            surface: key[1],
            normal: three(s),
            memory: Memory { slip: three(&s[3..]), turn: three(&s[6..]), slides: s[10] },
            depth: s[9],
            fresh: false,
        };
        self.walls.remember(keys.chunks_exact(2).zip(kept.chunks_exact(WALL)).map(contact).collect());
        Some(())
    }

    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool> {
        let grains = self.objects.iter().find(|o| o.name == object)?.living();
        let rows = self.rows();
        let into = match column {
            "position" => &mut self.bed.x,
            "velocity" => &mut self.bed.v,
            "angular_velocity" => &mut self.bed.w,
            _ => return Some(false),
        };
        // Spheres of a clump have no motion of their own.
        if values.len() != 3 * grains.len() || grains.clone().any(|grain| self.bed.clumps.at(rows[grain] as usize).is_some()) {
            return Some(false);
        }
        for (grain, value) in grains.zip(values.chunks_exact(3)) {
            into[rows[grain] as usize][..3].copy_from_slice(value);
        }
        Some(true)
    }
}
