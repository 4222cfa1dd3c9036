//! Gases that sound runs through.

use super::grid;
use super::places::{Map, fill, middle};
use crate::math::formula::Of;
use crate::math::{Vec3, VectorSignal};
use crate::state::{Field, Place, Vectors};
use crate::systems::compressible::{Fluid, Gas};
use tumble_interface::scene::Compressible;

/// A gas, or what is wrong with it: `wrong(key, message)`; `flat` is the axis across the plane of a scene of two dimensions.
pub fn compressible(words: &Compressible, flat: Option<usize>, gravity: [f64; 3], wrong: &mut dyn FnMut(&str, String)) -> Option<Gas> {
    let grid = grid(&words.grid, flat, words.periodic).map_err(|e| wrong(".box", e.to_string())).ok()?;
    let mut density = Field::new(grid, Place::Cell, "kg/m³").ok()?;
    let start = words.initial_density.as_ref().map_or(Ok(Map::Value(words.density)), Map::new);
    let start = start.map_err(|message| wrong(".initial_density", message)).ok()?;
    fill(&grid, &mut density.data, |at| start.at(middle(&grid, at)));
    if let Some(at) = density.each().find(|at| !(density.value(*at).is_finite() && density.value(*at) > 0.0)) {
        wrong(".initial_density", format!("{} kg/m³ at {:?} m, expected > 0", density.value(at), middle(&grid, at)));
        return None;
    }
    let velocity = VectorSignal::new(&words.velocity, Of::Place).map_err(|message| wrong(".velocity", message)).ok()?;
    let velocity = Vectors::of(grid, "m/s", |mut x| {
        if let Some(flat) = flat {
            x[flat] = grid.origin[flat];
        }
        velocity.at(0.0, Vec3::from(x), Vec3::default()).into()
    });
    let velocity = velocity.map_err(|e| wrong(".box", e.to_string())).ok()?;
    if velocity.parts.iter().any(|part| part.each().any(|at| !part.value(at).is_finite())) {
        wrong(".velocity", "not a finite number everywhere in the box".into());
        return None;
    }
    let fluid = Fluid { sound_speed: words.sound_speed, density: words.density, viscosity: words.viscosity, gravity };
    Gas::new(words.name.clone(), fluid, density, velocity).map_err(|e| wrong(".box", e.to_string())).ok()
}
