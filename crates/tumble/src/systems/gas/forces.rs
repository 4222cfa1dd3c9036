//! Forces and sources of the fluid: buoyancy, given accelerations, confinement, sources, decay.

use super::confinement::confine;
use super::fire::{excess, radiate};
use super::fluid::Fluid;
use crate::fluids::Failure;
use crate::fluids::rows::{Face, runs};
use crate::math::{Real, Signal, functions};
use crate::operators::each_row;
use crate::state::{Field, Place};

/// Moves values towards one, by the share that is covered.
fn pull(data: &mut [Real], points: &[(usize, Real)], to: f64) {
    points.iter().for_each(|(at, share)| data[*at] += share * (to as Real - data[*at]));
}

fn feed(data: &mut [Real], points: &[(usize, Real)], amount: f64) {
    points.iter().for_each(|(at, share)| data[*at] += share * amount as Real);
}

/// f -> ambient + factor (f - ambient)
fn fade(carried: &mut Field, ambient: f64, factor: f64) {
    let (ambient, factor) = (ambient as Real, factor as Real);
    each_row(carried, |_, _, row| row.iter_mut().for_each(|f| *f = ambient + factor * (*f - ambient)));
}

/// u += scale (mean of the two cells beside each face - around)
fn push_by(part: &mut Field, axis: usize, cells: &Field, scale: f64, around: f64) {
    let (half, around) = ((0.5 * scale) as Real, around as Real);
    let grid = part.grid;
    each_row(part, |j, k, row| {
        runs(&grid, axis, j, k, row, |run, face| {
            let n = run.len();
            let (low, high) = match face {
                Face::Between(low, high) => (low, high),
                Face::Lower(cell) | Face::Upper(cell) => (cell, cell),
            };
            let (low, high) = (&cells.data[low..low + n], &cells.data[high..high + n]);
            for i in 0..n {
                run[i] += half * ((low[i] - around) + (high[i] - around));
            }
        });
    });
}

impl Fluid {
    /// Sources, fading, and everything that pushes, for h seconds from t on.                                  (gas.2)
    pub fn forces(&mut self, t: f64, h: f64) -> Result<(), Failure> {
        self.supply(t, h);
        self.accelerate(t, h)?;
        self.trade(h);
        Ok(())
    }

    /// Sources, fading and fire.
    pub(super) fn supply(&mut self, t: f64, h: f64) {
        let before = self.excess();
        self.feed(t, h);
        self.clear();
        self.burn(h);
        let gained = self.excess() - before;
        self.flame.iter_mut().for_each(|flame| flame.heat[1] += gained);
    }

    /// Accelerations of the fluid at time t and of what floats in it, for h seconds.
    pub(super) fn accelerate(&mut self, t: f64, h: f64) -> Result<(), Failure> {
        let grid = self.grid();
        if let Some(solids) = &mut self.solids {
            let settings = &self.settings;
            solids.bodies.iter_mut().for_each(|body| body.fall(h, settings.gravity, settings.density, &grid));
            solids.follow();
        }
        if let Some(solids) = self.solids.as_mut().filter(|_| self.settings.viscosity > 0.0) {
            solids.keep(&mut self.u);
        }
        self.push(t, h)
    }

    /// What sheets and the fluid give each other.
    pub(super) fn trade(&mut self, h: f64) {
        let grid = self.grid();
        let Self { sheets, u, settings, .. } = self;
        sheets.iter_mut().for_each(|sheet| sheet.trade(u, &grid, settings.density, h));
    }

    fn feed(&mut self, t: f64, h: f64) {
        let settings = &self.settings;
        if let Some(smoke) = &mut self.smoke
            && settings.dissipation > 0.0
        {
            fade(smoke, 0.0, functions::exp(-settings.dissipation * h));
        }
        if let Some(warmth) = &mut self.temperature
            && settings.cooling > 0.0
        {
            fade(warmth, settings.ambient, functions::exp(-settings.cooling * h));
        }
        if let Some(warmth) = &mut self.temperature
            && settings.radiation > 0.0
        {
            radiate(warmth, settings.ambient, settings.radiation, h);
        }
        for source in &settings.sources {
            let (from, to) = (t.max(source.times[0]), (t + h).min(source.times[1]));
            if from >= to {
                continue;
            }
            let cells = source.cover(Place::Cell);
            let give = |carried: Option<&mut Field>, rate: &Signal, held: &Option<Signal>| {
                let Some(carried) = carried else { return };
                feed(&mut carried.data, cells, rate.integral(from, to));
                held.iter().for_each(|held| pull(&mut carried.data, cells, held.value(to)));
            };
            give(self.smoke.as_mut(), &source.smoke, &source.density);
            give(self.temperature.as_mut(), &source.heating, &source.temperature);
            give(self.flame.as_mut().map(|flame| &mut flame.fuel), &source.fuel, &source.fuel_density);
            if let Some(velocity) = &source.velocity {
                let v = <[f64; 3]>::from(velocity.value(t + h));
                for part in &mut self.u.parts {
                    let Place::Face(axis) = part.place else { continue };
                    pull(&mut part.data, source.cover(part.place), v[axis]);
                }
            }
        }
    }

    /// The sum of T - T0, where there is a fire whose heat is counted [K].
    pub(super) fn excess(&self) -> f64 {
        let warmth = self.temperature.as_ref().filter(|_| self.flame.is_some());
        warmth.map_or(0.0, |warmth| excess(warmth, self.settings.ambient))
    }

    /// Burns fuel where it is hot enough. (fire.1)
    fn burn(&mut self, h: f64) {
        let ambient = self.settings.ambient;
        if let (Some(flame), Some(warmth)) = (&mut self.flame, &mut self.temperature) {
            flame.burn(warmth, self.smoke.as_mut(), ambient, h);
        }
    }

    /// Accelerations: given ones, and g (s weight/rho - beta (T - T0)).                                  (gas.2, gas.13)
    fn push(&mut self, t: f64, h: f64) -> Result<(), Failure> {
        self.weigh();
        let settings = &self.settings;
        if let Some(densities) = &self.densities {
            densities.push(&mut self.u, settings.gravity, h);
        }
        // Boussinesq's have none of their own.
        let light = self.densities.is_none();
        let constant = if settings.acceleration.is_uniform() { settings.acceleration.value(t) } else { [0.0; 3].into() };
        let constant = <[f64; 3]>::from(constant);
        for part in &mut self.u.parts {
            let Place::Face(axis) = part.place else { continue };
            let g = settings.gravity[axis];
            if let Some(smoke) = &self.smoke
                && light
                && g * settings.weight != 0.0
            {
                push_by(part, axis, smoke, h * g * settings.weight / settings.density, 0.0);
            }
            if let Some(warmth) = &self.temperature
                && light
                && g * settings.expansion != 0.0
            {
                push_by(part, axis, warmth, -h * g * settings.expansion, settings.ambient);
            }
            if constant[axis] != 0.0 {
                let add = (h * constant[axis]) as Real;
                each_row(part, |_, _, row| row.iter_mut().for_each(|u| *u += add));
            }
            if !settings.acceleration.is_uniform() {
                let (grid, place) = (part.grid, part.place);
                each_row(part, |j, k, row| {
                    let at = |i: usize| grid.point(place, [i, j, k]).map(|x| f64::from(x as Real));
                    let [_, y, z] = at(0);
                    settings.acceleration.along(axis, t, row.len(), |i| at(i)[0], [y, z], |i, a| row[i] += (h * a) as Real);
                });
            }
        }
        if settings.confinement > 0.0 {
            confine(&mut self.u, settings.confinement, h)?;
        }
        Ok(())
    }
}
