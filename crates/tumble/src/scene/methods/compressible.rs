//! Gases that sound runs through.

use super::{MethodRules, is_in, on_grid};
use crate::math::formula::Of;
use crate::math::{Real, Vec3, VectorSignal};
use crate::scene::Assets;
use crate::scene::build::Builder;
use crate::scene::grids::{Map, cells, fill, grid, middle};
use crate::scene::laws::flat;
use crate::state::{Field, Place, Vectors};
use crate::system::System;
use crate::systems::compressible::{Compressible, Fluid, Gas, Settings};
use tumble_interface::Issue;
use tumble_interface::looks::{Colors, Look};
use tumble_interface::scene::{Compressible as Words, Method, Scene, System as Plan};

/// Bytes for a cell, density and three components of velocity in all that a step keeps of them: measured, 44 numbers in either precision.
const CELL: f64 = 46.0 * size_of::<Real>() as f64;

pub struct Rules;

impl MethodRules for Rules {
    fn words(&self) -> &'static [Method] {
        &[Method::Compressible]
    }

    fn kinds(&self) -> &'static [&'static str] {
        &["compressible"]
    }

    fn massless(&self) -> Option<&'static str> {
        Some("gases on grids")
    }

    fn is_on_grids(&self) -> bool {
        true
    }

    fn own_scheme(&self) -> Option<&'static str> {
        Some("a compressible gas is stepped by symplectic_euler")
    }

    fn noun(&self) -> &'static str {
        "cell"
    }

    fn theory(&self) -> &'static [(&'static str, &'static [&'static str])] {
        &[("compressible", &["compressible.1"])]
    }

    fn looks(&self, scene: &Scene, plan: &Plan, colors: &mut Colors) -> Vec<Look> {
        let own = scene.compressible.iter().filter(|thing| is_in(&thing.system, plan));
        own.map(|thing| on_grid(&thing.name, scene, 0.0, colors)).collect()
    }

    fn memory(&self, scene: &Scene, _assets: &Assets) -> f64 {
        scene.compressible.iter().map(|thing| cells(&thing.grid, flat(scene)) * CELL).sum()
    }

    fn build(&self, builder: &mut Builder<'_>, index: usize) -> Option<Box<dyn System>> {
        let (scene, plan, gravity) = (builder.scene, builder.plan(index), builder.gravity.clone());
        let mut gases = Vec::new();
        for words in scene.compressible.iter().filter(|words| is_in(&words.system, plan)) {
            let path = format!("compressible \"{}\"", words.name);
            let mut wrong = |key: &str, message: String| builder.issues.push(Issue::new(format!("{path}{key}"), message));
            gases.extend(gas(words, flat(scene), gravity.at(0.0), &mut wrong));
        }
        let settings = Settings { name: plan.name.clone(), gravity, substeps: plan.substeps, step: plan.step };
        Some(Box::new(Compressible::new(settings, gases)))
    }
}

/// A gas, or what is wrong with it: `wrong(key, message)`; `flat` is the axis across the plane of a scene of two dimensions.
fn gas(words: &Words, flat: Option<usize>, gravity: [f64; 3], wrong: &mut dyn FnMut(&str, String)) -> Option<Gas> {
    let grid = grid(&words.grid, flat, words.periodic).map_err(|e| wrong(".box", e.to_string())).ok()?;
    let mut density = Field::new(grid, Place::Cell, "kg/m³").ok()?;
    let start = words.initial_density.as_ref().map_or(Ok(Map::Value(words.density)), Map::new);
    let start = start.map_err(|message| wrong(".initial_density", message)).ok()?;
    fill(&grid, &mut density.data, |at| start.at(middle(&grid, at)));
    if let Some(at) = density.each().find(|at| !(density.value(*at).is_finite() && density.value(*at) > 0.0)) {
        wrong(".initial_density", format!("{} kg/m³ at {:?} m, expected > 0", density.value(at), middle(&grid, at)));
        return None;
    }
    let velocity = VectorSignal::new(&words.velocity, Of::Start).map_err(|message| wrong(".velocity", message)).ok()?;
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
