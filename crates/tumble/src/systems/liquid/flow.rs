//! Where a liquid comes in and leaves.
//!
//! What comes in lies on a lattice that moves with the velocity of the inflow, so that as much of it crosses a face in a second as velocity and area
//! say; in the volume of the inflow particles keep to that velocity. Particles in a drain are taken away.

use super::particles::Particles;
use crate::fluids::Solids;
use crate::geometry::Collider;
use crate::math::{Real, Vec3, VectorSignal};
use crate::state::Grid;

/// A volume that is looked at for some time.
pub struct Region {
    shape: Collider,
    times: [f64; 2],
    /// Cells that it may reach into, x fastest; none while it is not looked at.
    cells: Vec<bool>,
}

impl Region {
    /// A volume, at rest, between two times [s].
    pub fn new(shape: Collider, times: [f64; 2], grid: &Grid) -> Self {
        let reach = 0.51 * (grid.dimension() as f64).sqrt() * grid.dx;
        let mut cells = Vec::with_capacity(grid.n.iter().product());
        for k in 0..grid.n[2] {
            for j in 0..grid.n[1] {
                for i in 0..grid.n[0] {
                    let middle = [i, j, k].map(|i| i as Real + 0.5);
                    cells.push(shape.distance(place(grid, &middle), 0.0, 2.0 * reach).0 <= reach);
                }
            }
        }
        Self { shape, times, cells }
    }

    /// Whether it holds places of a lattice of `sampling` points a cell that are in no solid.
    pub fn is_open(&self, grid: &Grid, sampling: u32, solids: &Solids) -> bool {
        points(grid, &self.cells, sampling, [0.0; 3]).any(|x| {
            let x = x.map(|x| x as Real);
            self.holds(grid, &x) && solids.near(&x).0 > 0.0
        })
    }

    /// Whether it counts at a time [s].
    fn counts(&self, t: f64) -> bool {
        self.times[0] <= t && t < self.times[1]
    }

    /// Whether it holds a point of the box [cells].
    fn holds(&self, grid: &Grid, x: &[Real; 3]) -> bool {
        if (0..3).any(|a| !(x[a] >= 0.0 && x[a] <= grid.n[a] as Real)) {
            return false;
        }
        let at = |a: usize| (x[a].max(0.0) as usize).min(grid.n[a] - 1);
        self.cells[at(0) + grid.n[0] * (at(1) + grid.n[1] * at(2))] && self.shape.distance(place(grid, x), 0.0, grid.dx).0 <= 0.0
    }
}

/// A point of the box [m], from its place in cells.
fn place(grid: &Grid, x: &[Real; 3]) -> Vec3<f64> {
    let at = |a: usize| grid.origin[a] + if grid.flat == Some(a) { 0.0 } else { grid.dx * f64::from(x[a]) };
    [at(0), at(1), at(2)].into()
}

/// Where a liquid comes in.
pub struct Inflow {
    region: Region,
    velocity: VectorSignal,
    /// How far the lattice has moved [cells].
    moved: [f64; 3],
    /// Whether it has been full.
    runs: bool,
}

impl Inflow {
    /// Of this velocity [m/s].
    pub fn new(region: Region, velocity: VectorSignal) -> Self {
        Self { region, velocity, moved: [0.0; 3], runs: false }
    }

    /// Its velocity at a time [m/s].
    fn velocity(&self, t: f64, grid: &Grid) -> [f64; 3] {
        let mut v: [f64; 3] = self.velocity.value(t).into();
        grid.flat.into_iter().for_each(|flat| v[flat] = 0.0);
        v
    }

    /// Particles that have come in after h seconds around a time, by the places of a lattice of `sampling` points a cell.
    fn enter(&mut self, t: f64, h: f64, sampling: u32, grid: &Grid, solids: Option<&Solids>) -> Vec<[Real; 3]> {
        let v = self.velocity(t, grid);
        let way = v.map(|v| v * h / grid.dx);
        (0..3).for_each(|a| self.moved[a] += way[a]);
        let comes = |x: &[f64; 3]| {
            let before: [f64; 3] = std::array::from_fn(|a| x[a] - way[a]);
            let [x, before] = [x, &before].map(|x| x.map(|x| x as Real));
            let comes = self.region.holds(grid, &x) && !(self.runs && self.region.holds(grid, &before));
            comes && solids.is_none_or(|solids| solids.near(&x).0 > 0.0)
        };
        let new = points(grid, &self.region.cells, sampling, self.moved).filter(comes).map(|x| x.map(|x| x as Real)).collect();
        self.runs = true;
        new
    }
}

/// Points of a lattice that has moved so far [cells], in some cells: `sampling` along each edge.
fn points(grid: &Grid, cells: &[bool], sampling: u32, moved: [f64; 3]) -> impl Iterator<Item = [f64; 3]> {
    let edge = 1.0 / f64::from(sampling);
    let (n, flat) = (grid.n, grid.flat);
    let along: [u32; 3] = std::array::from_fn(|a| if flat == Some(a) { 1 } else { sampling });
    let first: [f64; 3] = std::array::from_fn(|a| if flat == Some(a) { 0.5 } else { (0.5 * edge + moved[a]).rem_euclid(edge) });
    let near = cells.iter().enumerate().filter(|(_, near)| **near).map(|(number, _)| number);
    near.flat_map(move |number| {
        let cell = [number % n[0], number / n[0] % n[1], number / (n[0] * n[1])];
        (0..along[0] * along[1] * along[2]).map(move |m| {
            let step = [m % along[0], m / along[0] % along[1], m / (along[0] * along[1])];
            std::array::from_fn(|a| cell[a] as f64 + first[a] + edge * f64::from(step[a]))
        })
    })
}

/// All places where a liquid comes in and leaves.
#[derive(Default)]
pub struct Openings {
    /// Where it comes in.
    pub inflows: Vec<Inflow>,
    /// Where it leaves.
    pub drains: Vec<Region>,
    /// The number of the next particle.
    pub next: u32,
}

impl Openings {
    /// Whether the number of particles may change.
    pub fn any(&self) -> bool {
        !self.inflows.is_empty() || !self.drains.is_empty()
    }

    /// The velocity [m/s] that an inflow gives to what is at a place [cells] at a time [s].
    pub fn velocity(&self, t: f64, grid: &Grid) -> impl Fn(&[Real; 3]) -> Option<[Real; 3]> + Sync {
        let runs = self.inflows.iter().filter(|inflow| inflow.region.counts(t));
        let all: Vec<(&Region, [Real; 3])> = runs.map(|inflow| (&inflow.region, inflow.velocity(t, grid).map(|v| v as Real))).collect();
        let grid = *grid;
        move |x| all.iter().find(|(region, _)| region.holds(&grid, x)).map(|(_, v)| *v)
    }

    /// Takes away what has come into drains, and lets in what inflows give in h seconds around a time t [s].
    pub fn exchange(&mut self, particles: &mut Particles, (t, h): (f64, f64), sampling: u32, grid: &Grid, solids: Option<&Solids>) {
        let Self { inflows, drains, next } = self;
        let drains: Vec<&Region> = drains.iter().filter(|drain| drain.counts(t)).collect();
        let starts: Vec<&Region> =
            inflows.iter().filter(|inflow| inflow.region.counts(t) && !inflow.runs).map(|inflow| &inflow.region).collect();
        if !drains.is_empty() || !starts.is_empty() {
            particles.retain(|x| !drains.iter().chain(&starts).any(|region| region.holds(grid, x)));
        }
        for inflow in inflows {
            if !inflow.region.counts(t) {
                inflow.runs = false;
                continue;
            }
            let v = inflow.velocity(t, grid).map(|v| v as Real);
            for x in inflow.enter(t, h, sampling, grid, solids) {
                particles.add(x, v, *next);
                *next = next.saturating_add(1);
            }
        }
    }

    /// What a snapshot has of them.
    pub fn numbers(&self) -> Vec<f64> {
        let one = |inflow: &Inflow| [inflow.moved[0], inflow.moved[1], inflow.moved[2], f64::from(u8::from(inflow.runs))];
        std::iter::once(f64::from(self.next)).chain(self.inflows.iter().flat_map(one)).collect()
    }

    /// Takes it back; `None` if it is of others.
    pub fn put(&mut self, numbers: &[f64]) -> Option<()> {
        let (next, rest) = numbers.split_first()?;
        (rest.len() == 4 * self.inflows.len()).then_some(())?;
        self.next = *next as u32;
        for (inflow, numbers) in self.inflows.iter_mut().zip(rest.chunks_exact(4)) {
            inflow.moved.copy_from_slice(&numbers[..3]);
            inflow.runs = numbers[3] != 0.0;
        }
        Some(())
    }
}
