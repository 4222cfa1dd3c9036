//! A liquid in its box: its state, and a step.

use super::extend::{self, Marks, empty, extend, mark};
use super::flow::Openings;
use super::level::{Level, cell, share};
use super::particles::{Gradient, Particles};
use super::paths::{SIDE, go, push_out};
use super::pressure::{Accuracy, Matrix};
use super::relax::spread;
use super::splat::{self, LEAST};
use super::stencil::Sampler;
use super::tension::{curvatures, longest};
use super::viscosity::Viscosity;
use super::whitewater::{Around, Whitewater};
use crate::exchange::{Exchange, Turn};
use crate::fluids::{Beyond, Failure, Immersed, Solids};
use crate::forces::Gravity;
use crate::geometry::Collider;
use crate::math::parallel::{CHUNK, Tasks, chunks, fold};
use crate::math::{Column, Real, Spare};
use crate::state::{Field, Grid, GridError, Place, Vectors};
use std::sync::Arc;
use tumble_interface::engine::StepReport;

/// Layers beyond the liquid that take its velocity, whatever particles there carry: those of its surface.
const SKIN: usize = 2;

/// Change of a velocity by the pressure of half a step, over it, from which it is a blow.
const BLOW: Real = 0.5;

/// How velocities go from particles to the grid and back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transfer {
    /// Part of what is their own that particles keep, with the velocity of the grid for the rest: 0 in PIC and APIC.
    pub ratio: f64,
    /// Whether they take the gradient of the grid's velocity, too: APIC, affine FLIP.
    pub affine: bool,
}

/// Constant settings of a liquid.
pub struct Settings {
    /// Density [kg/m³].
    pub density: f64,
    /// Dynamic viscosity [Pa s].
    pub viscosity: f64,
    /// Surface tension [N/m].
    pub tension: f64,
    /// Whether it sticks to solids and sides, or slips along them.
    pub stick: bool,
    /// Particles along each edge of a cell at the start.
    pub sampling: u32,
    /// Whether frames have its surface.
    pub surface: bool,
    /// Volume of a particle [cells].
    pub particle: f64,
    /// How velocities go from particles to the grid and back.
    pub transfer: Transfer,
    /// Whether particles are moved from where they crowd.
    pub keep_volume: bool,
    /// Speed at which particles are lightest in pictures [m/s]; `None` for one colour.
    pub shade: Option<f64>,
    /// Gravity.
    pub gravity: Gravity,
    /// How the pressure is found.
    pub accuracy: Accuracy,
    /// Cells that the fastest particle crosses in a sub-step.
    pub courant: f64,
}

/// A liquid in a box.
pub struct Tank {
    /// Name of the object.
    pub name: String,
    /// Constant settings.
    pub settings: Settings,
    /// Its particles.
    pub particles: Particles,
    /// Pressure of the last projection at cells [Pa], beside the liquid as it goes on.
    pub pressure: Field,
    /// The last step [s]; 0 at the start.
    pub last: f64,
    /// Where it comes in and leaves.
    pub openings: Openings,
    /// Its spray, foam and bubbles, where they are asked for.
    pub whitewater: Option<Whitewater>,
    pub(super) level: Level,
    pub(super) solids: Option<Solids>,
    grid: Grid,
    sides: [[Beyond; 2]; 3],
    /// Velocity on faces [m/s], and the weight of the particles around.
    u: Vectors,
    weights: Vec<Column>,
    /// Ways of particles in a step [cells].
    way: Vectors,
    /// Velocities before forces, and which faces have one.
    before: Vectors,
    reached: Marks,
    /// Number of particles at cells over that at rest.
    crowd: Field,
    /// The part of the space around a cell that solids leave to the liquid.
    room: Option<Vec<Real>>,
    /// Marks of faces in the empty box.
    marks: Marks,
    spare: Spare,
}

impl Tank {
    /// A liquid of these particles around these solids, which are where they are at t = 0.
    pub fn new(
        name: String,
        settings: Settings,
        grid: Grid,
        solids: Option<Solids>,
        particles: Particles,
        openings: Openings,
        whitewater: Option<Whitewater>,
    ) -> Result<Self, GridError> {
        let mut tank = Self {
            name,
            openings: Openings { next: particles.count() as u32, ..openings },
            whitewater,
            particles,
            pressure: Field::new(grid, Place::Cell, "Pa")?,
            last: 0.0,
            level: Level::new(grid)?,
            grid,
            sides: Default::default(),
            u: Vectors::faces(grid, "m/s")?,
            weights: grid.axes().map(|_| Column::zeros(grid.lattice().len())).collect(),
            way: Vectors::faces(grid, "1")?,
            before: Vectors::faces(grid, "m/s")?,
            reached: Marks::new(),
            crowd: Field::new(grid, Place::Cell, "1")?,
            room: None,
            marks: Marks::new(),
            spare: Spare::default(),
            solids,
            settings,
        };
        tank.settle();
        tank.prepare();
        Ok(tank)
    }

    /// Its cells.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// The volume of a cell [m³]; in the plane, of one metre across it.
    pub fn cell_volume(&self) -> f64 {
        (0..self.grid.dimension()).fold(1.0, |v, _| v * self.grid.dx)
    }

    /// The mass of a particle [kg].
    pub fn particle_mass(&self) -> f64 {
        self.settings.density * self.settings.particle * self.cell_volume()
    }

    /// The volume of the liquid by its surface [m³].
    pub fn volume(&self) -> f64 {
        self.level.volume * self.cell_volume()
    }

    /// Takes the solids around it.
    pub fn take_surfaces(&mut self, colliders: &Arc<Vec<Collider>>) {
        if self.solids.as_mut().is_some_and(|solids| solids.take_surfaces(colliders)) {
            self.settle();
            self.prepare();
        }
    }

    /// Puts the solids where they are at time t [s].
    pub fn put(&mut self, t: f64) {
        if let Some(solids) = self.solids.as_mut().filter(|solids| solids.time != t) {
            solids.place(t);
            self.settle();
        }
    }

    /// Takes the state of what it moves.
    pub fn listen(&mut self, t: f64, exchange: &Exchange) {
        let (gravity, grid) = (self.settings.gravity.at(t), self.grid);
        // The weight of what it displaces is in its pressure.
        self.bodies().iter_mut().for_each(|body| body.listen(exchange, gravity, 0.0, &grid));
    }

    /// Gives what it moves what it has got.
    pub fn tell(&mut self, exchange: &mut Turn<'_>) {
        self.bodies().iter_mut().for_each(|body| body.tell(exchange));
    }

    /// Solids that it moves.
    pub(super) fn bodies(&mut self) -> &mut [Immersed] {
        self.solids.as_mut().map_or(&mut [], |solids| &mut solids.bodies)
    }

    /// What follows from where the solids are.
    fn settle(&mut self) {
        let open = self.solids.as_ref().map(|solids| &solids.open);
        self.marks = empty(&self.grid, open);
        self.room = self.solids.as_ref().map(|solids| room(&self.grid, solids));
    }

    /// Sorts its particles, finds its surface and how densely it lies; all are functions of where they are.
    pub fn prepare(&mut self) {
        let Self { particles, level, crowd, room, settings, solids, grid, .. } = self;
        particles.sort(grid.n);
        level.measure(particles, settings.particle, solids.as_ref());
        splat::to_cells(particles, crowd);
        let scale = settings.particle as Real;
        chunks(&mut crowd.data, |start, crowd| {
            for (i, crowd) in crowd.iter_mut().enumerate() {
                *crowd *= scale / room.as_ref().map_or(1.0, |room| room[start + i]);
            }
        });
    }

    /// The largest component of the velocity of a particle, and of solids across faces [m/s].
    pub fn fastest(&self) -> f64 {
        let most = |range: std::ops::Range<usize>| {
            let worse = |most: Real, v: &Real| if v.abs() > most || v.is_nan() { v.abs() } else { most };
            self.particles.v[range].iter().flatten().fold(0.0, worse)
        };
        let particles = fold(self.particles.count(), most).into_iter().fold(0.0, |a: Real, b| if a >= b || a.is_nan() { a } else { b });
        let solids = self.solids.as_ref().map_or(0.0, |solids| solids.fastest_cut().max(solids.fastest()));
        f64::from(particles).max(solids)
    }

    /// The largest step [s] of the Courant number at time t, within `left` [s]: gravity speeds it up on the way.
    pub fn courant_step(&self, t: f64, left: f64) -> f64 {
        let (way, speed) = (self.settings.courant * self.grid.dx, self.fastest());
        let g = self.settings.gravity.at(t).iter().map(|g| g * g).sum::<f64>().sqrt();
        // The second half h with all of its gravity: (v + 2 h g) h = way.
        let half = if speed > 0.0 || g > 0.0 { 2.0 * way / (speed + (speed * speed + 8.0 * g * way).sqrt()) } else { left };
        let bears = if self.settings.tension > 0.0 { longest(self.settings.density, self.settings.tension, self.grid.dx) } else { left };
        (2.0 * half).min(left).min(bears)
    }

    /// One step of h seconds from t to `end` [s]: in the first half, without forces, the pressure acts twice.             (pic.7)
    pub fn step(&mut self, t: f64, h: f64, end: f64, report: &mut StepReport) -> Result<(), Failure> {
        self.last = h;
        let before = (!self.bodies().is_empty()).then(|| self.pressure.clone());
        self.half((t, t + 0.5 * h), h, false, report)?;
        let first = self.pressure.data.clone();
        if let (Some(solids), Some(before)) = (&mut self.solids, &before) {
            let cells = &self.level.cells;
            solids.lift(h, before, |at| cells[at as usize] == cell::LIQUID);
        }
        self.half((t + 0.5 * h, end), h, true, report)?;
        self.whiten(end, h);
        chunks(&mut self.pressure.data, |start, p| p.iter_mut().zip(&first[start..]).for_each(|(p, first)| *p += 2.0 * first));
        Ok(())
    }

    /// Moves its spray, foam and bubbles for h seconds until t [s].
    fn whiten(&mut self, t: f64, h: f64) {
        let Self { whitewater: Some(whitewater), particles, settings, level, u, solids, .. } = self else { return };
        let (distance, gravity) = (&level.distance, settings.gravity.at(t));
        whitewater.step(&Around { particles, sampling: settings.sampling, distance, u, solids: solids.as_ref(), gravity }, h);
    }

    /// Half of a step of h seconds between two times [s].
    fn half(&mut self, (from, to): (f64, f64), h: f64, second: bool, report: &mut StepReport) -> Result<(), Failure> {
        let half = 0.5 * h;
        report.passed(self.fastest() * half / self.grid.dx);
        let mut matrix = Matrix::new(&self.level, self.solids.as_ref(), &self.sides, std::mem::take(&mut self.spare))?;
        if self.settings.keep_volume {
            matrix.displace(&self.crowd, &self.level, self.room.as_deref(), self.solids.as_ref(), &mut self.way, report)?;
        }
        self.give_to_grid();
        let bodies: Vec<_> = self.bodies().iter().map(Immersed::before).collect();
        if second {
            self.accelerate(from, h, &matrix);
        }
        if let Some(solids) = &self.solids {
            matrix.join(&self.level, solids, self.settings.density);
        }
        self.project(&mut matrix, (to, h), report)?;
        if second && self.settings.viscosity > 0.0 {
            // What the pressure balances does not slip before viscosity holds it.
            let Settings { viscosity, density, stick, .. } = self.settings;
            let viscous = Viscosity::new(&self.level, self.solids.as_ref(), stick, viscosity / density, h);
            viscous.act(&mut self.u, report);
            let before = self.pressure.data.clone();
            self.project(&mut matrix, (to, h), report)?;
            chunks(&mut self.pressure.data, |start, p| p.iter_mut().zip(&before[start..]).for_each(|(p, before)| *p += before));
        }
        self.spare = matrix.into_spare();
        self.reach_out(half);
        let ways = (second && self.settings.keep_volume)
            .then(|| spread(&self.particles, self.grid.n, (1.0 / f64::from(self.settings.sampling)) as Real));
        self.give_to_particles(ways.as_deref(), second, 0.5 * (from + to), half);
        self.bodies().iter_mut().for_each(|body| body.advance(half));
        if !second {
            self.bodies().iter_mut().zip(&bodies).for_each(|(body, before)| body.reflect(before));
        }
        if self.solids.as_ref().is_some_and(Solids::moves) {
            self.put(to);
        }
        if self.openings.any() {
            let Self { openings, particles, settings, grid, solids, .. } = self;
            openings.exchange(particles, (0.5 * (from + to), half), settings.sampling, grid, solids.as_ref());
        }
        self.push_out();
        self.prepare();
        Ok(())
    }

    /// Makes the velocity at a time [s] free of divergence, with a pressure that acts for h seconds.
    fn project(&mut self, matrix: &mut Matrix, (t, h): (f64, f64), report: &mut StepReport) -> Result<(), Failure> {
        let Self { u, pressure, level, solids, sides, settings, .. } = self;
        matrix.project(u, pressure, level, (solids.as_mut(), sides), (t, h, settings.density), settings.accuracy, report)
    }

    /// The velocity of its particles at faces [m/s]; zero where there are none.
    pub fn face_velocities(&self) -> Vectors {
        let (mut u, mut weights) = (self.u.clone(), self.weights.clone());
        splat::to_faces(&self.particles, &mut u, &mut weights);
        u
    }

    /// Velocities of particles to faces.
    fn give_to_grid(&mut self) {
        splat::to_faces(&self.particles, &mut self.u, &mut self.weights);
        self.reached.clone_from(&self.marks);
        know(&mut self.reached, &mut self.weights);
        // The liquid may reach beyond the faces that its particles reach.
        extend(&mut self.u, &mut self.reached, 1 + SKIN);
        for (before, u) in self.before.parts.iter_mut().zip(&self.u.parts) {
            before.data.copy_from_slice(&u.data);
        }
    }

    /// Gravity, surface tension and what else moves bodies, for h seconds.
    fn accelerate(&mut self, t: f64, h: f64, matrix: &Matrix) {
        let (gravity, grid) = (self.settings.gravity.at(t), self.grid);
        self.bodies().iter_mut().for_each(|body| body.fall(h, gravity, 0.0, &grid));
        self.solids.iter_mut().for_each(Solids::follow);
        for ((part, marks), axis) in self.u.parts.iter_mut().zip(&self.reached).zip(self.grid.axes()) {
            let gain = (h * gravity[axis]) as Real;
            if gain != 0.0 {
                chunks(&mut part.data, |start, u| {
                    u.iter_mut().zip(&marks[start..]).filter(|(_, mark)| **mark == mark::KNOWN).for_each(|(u, _)| *u += gain);
                });
            }
        }
        let Settings { tension, density, .. } = self.settings;
        if tension > 0.0 {
            let scale = (h * tension / (density * grid.dx)) as Real;
            let q: Vec<Real> = curvatures(&self.level, matrix).into_iter().map(|kappa| scale * kappa).collect();
            matrix.pull(&mut self.u, &q);
        }
    }

    /// Velocities, and ways, of faces around the liquid.                                                        (pic.8)
    fn reach_out(&mut self, h: f64) {
        let mut liquid = self.marks.clone();
        self.know_liquid(&mut liquid);
        // The change goes on beyond the surface.
        let mut marks = liquid.clone();
        add(&mut self.u, -1.0, &self.before);
        extend(&mut self.u, &mut marks, SKIN);
        add(&mut self.u, 1.0, &self.before);
        for ((marks, liquid), reached) in marks.iter_mut().zip(&liquid).zip(&self.reached) {
            chunks(marks, |start, marks| {
                for ((mark, liquid), reached) in marks.iter_mut().zip(&liquid[start..]).zip(&reached[start..]) {
                    if *mark == mark::KNOWN && *liquid == mark::FREE {
                        *mark = *reached;
                    }
                }
            });
        }
        // Farther out particles fly by themselves.
        know(&mut marks, &mut self.weights);
        extend(&mut self.u, &mut marks, 2 + self.settings.courant as usize);
        if let Some(solids) = &self.solids {
            solids.extend(&mut self.u);
        }
        let (scale, displaced) = ((h / self.grid.dx) as Real, self.settings.keep_volume);
        if displaced {
            extend(&mut self.way, &mut liquid, SKIN);
        }
        for (way, u) in self.way.parts.iter_mut().zip(&self.u.parts) {
            chunks(&mut way.data, |start, way| {
                for (way, u) in way.iter_mut().zip(&u.data[start..]) {
                    *way = scale * u + if displaced { *way } else { 0.0 };
                }
            });
        }
    }

    /// Marks free faces beside the liquid as known.
    fn know_liquid(&self, marks: &mut Marks) {
        let stride = self.grid.lattice().stride;
        for (marks, axis) in marks.iter_mut().zip(self.grid.axes()) {
            let cells = &self.level.cells;
            chunks(marks, |start, marks| {
                for (i, mark) in marks.iter_mut().enumerate() {
                    let at = start + i;
                    if *mark == mark::FREE && (cells[at] == cell::LIQUID || cells[at - stride[axis]] == cell::LIQUID) {
                        *mark = mark::KNOWN;
                    }
                }
            });
        }
    }

    /// Velocities of faces to particles, which then go their way.                                               (pic.2, pic.3)
    fn give_to_particles(&mut self, ways: Option<&[[Real; 3]]>, second: bool, t: f64, half: f64) {
        let Self { particles, u, way, before, settings, solids, grid, openings, .. } = self;
        let comes_in = openings.velocity(t, grid);
        let (comes_in, pace, ratio) = (&comes_in, (half / grid.dx) as Real, settings.transfer.ratio as Real);
        let (velocity, before, way) = (Sampler::new(u), Sampler::new(before), Sampler::new(way));
        let Particles { x, v, gradient, .. } = particles;
        let gradients = gradient.chunks_mut(CHUNK).map(Some).chain(std::iter::repeat_with(|| None));
        let tops = grid.n.map(|n| n as Real - SIDE);
        // What the pressure has changed counts twice in the first half, but for blows, which it would give back.
        let more = |new: &[Real; 3], old: &[Real; 3]| {
            let square = |v: &dyn Fn(usize) -> Real| (0..3).map(|a| v(a) * v(a)).sum::<Real>();
            let blow = square(&|a| new[a] - old[a]) > BLOW * BLOW * square(&|a| old[a]);
            if second || blow { 0.0 } else { 1.0 }
        };
        let tasks = x.chunks_mut(CHUNK).zip(v.chunks_mut(CHUNK)).zip(gradients);
        tasks.enumerate().in_parallel(|(task, ((x, v), mut gradient)): (_, ((_, _), Option<&mut [Gradient]>))| {
            for (i, (x, v)) in x.iter_mut().zip(v).enumerate() {
                if let Some(given) = comes_in(x) {
                    (0..3).for_each(|a| x[a] = (x[a] + pace * given[a]).max(SIDE).min(tops[a]));
                    *v = given;
                    gradient.iter_mut().for_each(|gradient| gradient[i] = Gradient::default());
                    continue;
                }
                let (new, old) = if let Some(gradient) = &mut gradient {
                    let ((new, slope), (old, before)) = (velocity.with_gradient(x), before.with_gradient(x));
                    let more = more(&new, &old);
                    gradient[i] = std::array::from_fn(|a| std::array::from_fn(|b| slope[a][b] + more * (slope[a][b] - before[a][b])));
                    (new, old)
                } else {
                    (velocity.read(x), before.read(x))
                };
                let more = more(&new, &old);
                *v = std::array::from_fn(|a| new[a] + more * (new[a] - old[a]) + ratio * (v[a] - old[a]));
                // Straight on: what goes its way with its own velocity keeps its angular momentum.
                let mut all = way.read(x);
                ways.iter().for_each(|ways| (0..3).for_each(|a| all[a] += ways[task * CHUNK + i][a]));
                go(solids.as_ref(), grid, x, &all);
            }
        });
    }

    /// Moves particles out of solids.
    pub(super) fn push_out(&mut self) {
        let Some(solids) = &self.solids else { return };
        let grid = self.grid;
        chunks(&mut self.particles.x, |_, x| x.iter_mut().for_each(|x| push_out(solids, &grid, x)));
    }
}

/// Adds so many times other velocities.
fn add(u: &mut Vectors, factor: Real, others: &Vectors) {
    for (u, other) in u.parts.iter_mut().zip(&others.parts) {
        chunks(&mut u.data, |start, u| u.iter_mut().zip(&other.data[start..]).for_each(|(u, other)| *u += factor * other));
    }
}

/// Marks free faces with particles around as known.
fn know(marks: &mut Marks, weights: &mut [Column]) {
    marks.iter_mut().zip(weights).for_each(|(marks, weight)| extend::know(marks, weight, LEAST));
}

/// The part of the space around each cell that solids leave, by the weights of a particle, averaged over a cell.
fn room(grid: &Grid, solids: &Solids) -> Vec<Real> {
    let (lattice, scale) = (grid.lattice(), (1.0 / grid.dx) as Real);
    let mut room = vec![1.0; lattice.len()];
    let rows = |f: &mut dyn FnMut(usize)| {
        for k in 0..grid.n[2] {
            for j in 0..grid.n[1] {
                f(lattice.at(0, j, k));
            }
        }
    };
    rows(&mut |row| (row..row + grid.n[0]).for_each(|at| room[at] = share(scale * solids.middle(at))));
    for axis in grid.axes() {
        let (old, step) = (room.clone(), lattice.stride[axis]);
        rows(&mut |row| {
            for at in row..row + grid.n[0] {
                let along = lattice.place(at)[axis];
                let low = if along == 0 { at } else { at - step };
                let high = if along + 1 == grid.n[axis] { at } else { at + step };
                room[at] = 0.125 * (old[low] + old[high]) + 0.75 * old[at];
            }
        });
    }
    // Where solids leave next to nothing, a particle is no crowd.
    room.iter_mut().for_each(|room| *room = room.max(0.1));
    room
}
