//! Densities that vary: differences of density have inertia, not only weight.
//!
//!   rho = rho_0/(1 + beta (T - T0)) + weight s,   u = u* - rho_0/rho_f grad q,   f = g (1 - rho_0/rho_f)         (gas.13)
//!
//! rho_f of a face is the mean of the two cells beside it, on a side of the box that of the cell beside it.
//! Tests: crates/tumble-f64/tests/densities.rs. Limits: the kinematic viscosity is the same everywhere.

use super::settings::Settings;
use crate::fluids::Failure;
use crate::fluids::rows::{Face, runs};
use crate::math::Real;
use crate::operators::each_row;
use crate::state::{Field, Grid, Place, Vectors};

/// Smallest and largest density over that of the fluid: what is outside is what rounding, or a temperature of nearly nothing, makes.
const RANGE: [Real; 2] = [1e-3, 1e3];

/// The densities of a fluid.
pub struct Densities {
    /// Density over rho_0 at cells.
    ratio: Field,
    /// rho_0 over the density at faces.
    pub light: Vectors,
}

impl Densities {
    /// Those of the fluid itself.
    pub fn new(grid: Grid) -> Result<Self, Failure> {
        let mut light = Vectors::faces(grid, "1")?;
        light.parts.iter_mut().for_each(|part| part.data.fill(1.0));
        Ok(Self { ratio: Field::new(grid, Place::Cell, "1")?, light })
    }

    /// Takes them from smoke and warmth.                                                                 (gas.13)
    pub fn measure(&mut self, settings: &Settings, smoke: Option<&Field>, warmth: Option<&Field>) {
        let (beta, ambient) = (settings.expansion as Real, settings.ambient as Real);
        let weight = (settings.weight / settings.density) as Real;
        each_row(&mut self.ratio, |j, k, row| {
            let at = |carried: Option<&Field>| carried.map(|c| c.index([0, j, k]));
            match (warmth, at(warmth)) {
                (Some(warmth), Some(at)) => {
                    let warmth = &warmth.data[at..];
                    for (ratio, t) in row.iter_mut().zip(warmth) {
                        // Beyond the range is beyond the range from either side.
                        *ratio = 1.0 / (1.0 + beta * (t - ambient)).max(RANGE[0]);
                    }
                }
                _ => row.fill(1.0),
            }
            if let (Some(smoke), Some(at)) = (smoke, at(smoke)) {
                row.iter_mut().zip(&smoke.data[at..]).for_each(|(ratio, s)| *ratio += weight * s);
            }
            row.iter_mut().for_each(|ratio| *ratio = ratio.clamp(RANGE[0], RANGE[1]));
        });
        let Self { ratio, light } = self;
        for part in &mut light.parts {
            let Place::Face(axis) = part.place else { continue };
            let grid = part.grid;
            each_row(part, |j, k, row| {
                runs(&grid, axis, j, k, row, |run, face| {
                    let n = run.len();
                    let (low, high) = match face {
                        Face::Between(low, high) => (low, high),
                        Face::Lower(cell) | Face::Upper(cell) => (cell, cell),
                    };
                    let (low, high) = (&ratio.data[low..low + n], &ratio.data[high..high + n]);
                    for i in 0..n {
                        run[i] = 2.0 / (low[i] + high[i]);
                    }
                });
            });
        }
    }

    /// u += h g (1 - rho_0/rho_f).                                                                        (gas.13)
    pub fn push(&self, u: &mut Vectors, gravity: [f64; 3], h: f64) {
        for (part, light) in u.parts.iter_mut().zip(&self.light.parts) {
            let Place::Face(axis) = part.place else { continue };
            let add = (h * gravity[axis]) as Real;
            if add != 0.0 {
                each_row(part, |j, k, row| {
                    let at = light.index([0, j, k]);
                    row.iter_mut().zip(&light.data[at..]).for_each(|(u, light)| *u += add * (1.0 - light));
                });
            }
        }
    }
}
