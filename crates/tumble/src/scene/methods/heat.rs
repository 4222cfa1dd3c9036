//! Heat in bodies: words to materials, boundaries and sources.

use super::{MethodRules, is_in, on_grid};
use crate::geometry::{Shape, Vector};
use crate::math::parallel::fold;
use crate::math::{Real, Signal};
use crate::recipes::region;
use crate::scene::Assets;
use crate::scene::build::Builder;
use crate::scene::grids::{Map, cells, fill, grid, middle};
use crate::scene::laws::{Reader, flat};
use crate::scene::plausible::odd_density;
use crate::state::{Field, Place};
use crate::system::System;
use crate::systems::dynamics::MOST_SUBSTEPS;
use crate::systems::heat::{Boundary, Heat, HeatedBody, Material, Plan, SAFE, Settings, Source};
use tumble_interface::check::short;
use tumble_interface::looks::{Colors, Look};
use tumble_interface::scene::{
    Animated, Component, Heat as Words, HeatScheme, HeatSide, Method, Scene, Shape as Solid, System as Stepping,
};
use tumble_interface::{Issue, Warning};

/// Bytes for a cell in double precision: temperatures twice and in the snapshot; materials; multigrid of implicit schemes.
const CELL: [f64; 3] = [24.0, 48.0, 160.0];

pub struct Rules;

impl MethodRules for Rules {
    fn words(&self) -> &'static [Method] {
        &[Method::Heat]
    }

    fn kinds(&self) -> &'static [&'static str] {
        &["heat"]
    }

    fn massless(&self) -> Option<&'static str> {
        Some("bodies on grids")
    }

    fn is_on_grids(&self) -> bool {
        true
    }

    fn own_scheme(&self) -> Option<&'static str> {
        Some("each [[heat]] body has a scheme of its own, and the system no integrator")
    }

    fn noun(&self) -> &'static str {
        "cell"
    }

    fn theory(&self) -> &'static [(&'static str, &'static [&'static str])] {
        &[("heat", &["heat.1"])]
    }

    fn hints(&self, scene: &Scene) -> Vec<Warning> {
        scene.heat.iter().filter_map(|t| odd_density(format!("heat \"{}\".density", t.name), t.density, 0.0)).collect()
    }

    fn looks(&self, scene: &Scene, plan: &Stepping, colors: &mut Colors) -> Vec<Look> {
        let own = scene.heat.iter().filter(|thing| is_in(&thing.system, plan));
        own.map(|thing| on_grid(&thing.name, scene, 0.0, colors)).collect()
    }

    fn memory(&self, scene: &Scene, _assets: &Assets) -> f64 {
        let of = |thing: &Words| {
            let implicit = matches!(thing.scheme, HeatScheme::Implicit | HeatScheme::Trapezoid);
            let own = CELL[0] + if thing.region.is_empty() { 0.0 } else { CELL[1] } + if implicit { CELL[2] } else { 0.0 };
            cells(&thing.grid, flat(scene)) * (own + 16.0 * thing.source.len() as f64)
        };
        scene.heat.iter().map(of).sum()
    }

    fn build(&self, builder: &mut Builder<'_>, index: usize) -> Option<Box<dyn System>> {
        let (scene, plan) = (builder.scene, builder.plan(index));
        let mut bodies = Vec::new();
        for words in scene.heat.iter().filter(|words| is_in(&words.system, plan)) {
            let path = format!("heat \"{}\"", words.name);
            let (mut unread, mut faults) = (Vec::new(), Vec::new());
            let mut reader = Reader::new(scene, &mut unread);
            let mut signal = |key: &str, value: &Animated| reader.signal(&format!("{path}{key}"), value, f64::NEG_INFINITY);
            let made = body(words, flat(scene), &mut signal, &mut |key, message| faults.push((key.to_string(), message)));
            builder.issues.extend(unread);
            builder.issues.extend(faults.into_iter().map(|(key, message)| Issue::new(format!("{path}{key}"), message)));
            if let Some(made) = made {
                check_steps(words, plan, builder.interval, made.limit(), &mut builder.issues);
                bodies.push(made);
            }
        }
        let settings = Settings { name: plan.name.clone(), substeps: plan.substeps, step: plan.step };
        Some(Box::new(Heat::new(settings, bodies, builder.ids[index], &mut builder.exchange)))
    }
}

/// Explicit steps up to `limit` [s] do not grow.
fn check_steps(words: &Words, plan: &Stepping, interval: f64, limit: f64, issues: &mut Vec<Issue>) {
    let step = plan.substeps.map(|n| interval / f64::from(n)).or(plan.step.map(|step| step.min(interval)));
    if let Some(h) = step.filter(|h| *h > limit * (1.0 + 1e-9)) {
        let key = if plan.substeps.is_some() { "substeps" } else { "step" };
        let message = format!(
            "steps of {} s, but explicit diffusion in \"{}\" grows beyond {} s: leave out {key} to have as many as it needs, \
             or set scheme = \"implicit\"",
            short(h),
            words.name,
            short(limit)
        );
        issues.push(Issue::new(format!("system \"{}\".{key}", plan.name), message));
    }
    let needed = interval / (SAFE * limit);
    if step.is_none() && needed > MOST_SUBSTEPS {
        let message = format!("an interval would take {needed:.0e} explicit steps; set scheme = \"implicit\", or lower the resolution");
        issues.push(Issue::new(format!("heat \"{}\".scheme", words.name), message));
    }
}

/// A solid without a mesh.
fn shape(words: &Solid) -> Result<Shape, String> {
    if matches!(words, Solid::Lathe { .. } | Solid::Mesh(_) | Solid::AnimatedMesh(_) | Solid::Character(_) | Solid::Mannequin(_)) {
        return Err("a mesh or a solid of revolution, expected a sphere, box, plane, floor or capsule".into());
    }
    region(words).map(|solid| solid.shape).map_err(|(_, message)| message)
}

fn contains(shape: &Shape, x: [f64; 3]) -> bool {
    shape.near(Vector::from(x), 0.0, f64::INFINITY).0 < 0.0
}

/// A body, or what is wrong with it: `wrong(key, message)`. `signal` reads values that change in time, `flat` is the axis across
/// the plane of a scene of two dimensions.
fn body(
    words: &Words,
    flat: Option<usize>,
    signal: &mut dyn FnMut(&str, &Animated) -> Signal,
    wrong: &mut dyn FnMut(&str, String),
) -> Option<HeatedBody> {
    let mut fine = true;
    let mut fault = |key: &str, message: String| {
        fine = false;
        wrong(key, message);
    };
    let grid = grid(&words.grid, flat, words.periodic).map_err(|e| fault(".box", e.to_string())).ok()?;
    let mut boundaries = Vec::new();
    let mut boundary = |key: &str, name: &str, side: &HeatSide, fault: &mut dyn FnMut(&str, String)| -> Option<usize> {
        match (&side.temperature, side.coefficient, &side.flux) {
            (None, None, None) => return None,
            (None, Some(_), _) => {
                fault(&format!("{key}.coefficient"), "given without a temperature of what flows along it; add one".into())
            }
            (Some(_), None, Some(_)) => {
                fault(&format!("{key}.flux"), "given beside the temperature of the surface; leave out one, or add a coefficient".into());
            }
            _ => {}
        }
        let temperature = side.temperature.as_ref().map(|t| signal(&format!("{key}.temperature"), t));
        let flux = side.flux.as_ref().map(|q| signal(&format!("{key}.flux"), q));
        boundaries.push(Boundary { name: name.into(), temperature, coefficient: side.coefficient, flux });
        Some(boundaries.len() - 1)
    };
    let mut sides = [[None; 2]; 3];
    for (i, (name, side)) in words.sides.all().into_iter().enumerate() {
        let (Some(side), axis) = (side, i / 2) else { continue };
        let key = format!(".sides.{name}");
        if flat == Some(axis) {
            fault(&key, "a scene of dimension 2 has no such side; leave it out".into());
        } else if words.periodic[axis] {
            fault(&key, "the axis is periodic and has no sides; leave out one of both".into());
        } else {
            sides[axis][i % 2] = boundary(&key, name, side, &mut fault);
        }
    }
    let capacity = words.density * words.heat_capacity;
    let mut materials = vec![Material { conductivity: words.conductivity, capacity, hole: None }];
    let mut regions = Vec::new();
    let start = |key: &str, map: &Component, fault: &mut dyn FnMut(&str, String)| {
        Map::new(map).map_err(|message| fault(key, message)).unwrap_or(Map::Value(0.0))
    };
    let own = start(".temperature", &words.temperature, &mut fault);
    for (i, region) in words.region.iter().enumerate() {
        let key = format!(".region[{i}]");
        let hole = region.hole.as_ref().map(|side| boundary(&format!("{key}.hole"), &format!("region[{i}]"), side, &mut fault));
        // An insulated hole is one without a boundary.
        let hole = hole.map(|of| of.unwrap_or(usize::MAX));
        materials.push(Material {
            conductivity: region.conductivity.unwrap_or(words.conductivity),
            capacity: region.density.unwrap_or(words.density) * region.heat_capacity.unwrap_or(words.heat_capacity),
            hole,
        });
        let map = region.temperature.as_ref().map(|map| start(&format!("{key}.temperature"), map, &mut fault));
        match shape(&region.shape) {
            Ok(shape) => regions.push((shape, map)),
            Err(message) => fault(&format!("{key}.shape"), message),
        }
    }
    let mut sources = Vec::new();
    for (i, source) in words.source.iter().enumerate() {
        let key = format!(".source[{i}]");
        let power = signal(&format!("{key}.power"), &source.power);
        let profile = Map::new(&source.profile).map_err(|message| fault(&format!("{key}.profile"), message)).unwrap_or(Map::Value(0.0));
        let within = source.shape.as_ref().map(|words| shape(words).map_err(|message| fault(&format!("{key}.shape"), message)).ok());
        let plain = within.is_none() && matches!(profile, Map::Value(1.0));
        let profile = (!plain).then(|| {
            let mut column = vec![0.0; grid.lattice().len()];
            fill(&grid, &mut column, |at| {
                let x = middle(&grid, at);
                let inside = within.as_ref().is_none_or(|shape| shape.as_ref().is_some_and(|shape| contains(shape, x)));
                if inside { profile.at(x) } else { 0.0 }
            });
            column
        });
        if profile.iter().flatten().any(|p| !p.is_finite()) {
            fault(&format!("{key}.profile"), "not a finite number everywhere in the box".into());
        }
        sources.push(Source { power, profile });
    }
    if words.scheme == HeatScheme::Spectral {
        let insulated = sides.iter().flatten().all(Option::is_none) && !words.periodic.contains(&true);
        if !insulated || !words.region.is_empty() {
            fault(
                ".scheme",
                "\"spectral\" is for insulated boxes of one material; take \"trapezoid\", or leave out sides, periodic and region".into(),
            );
        }
        let product = |mut n: usize| {
            for p in [2, 3, 5] {
                while n.is_multiple_of(p) {
                    n /= p;
                }
            }
            n == 1
        };
        if let Some(a) = grid.axes().find(|a| !product(grid.n[*a])) {
            let message =
                format!("{} cells along {}, expected a product of 2, 3 and 5 for scheme \"spectral\"", grid.n[a], ["x", "y", "z"][a]);
            fault(".box.resolution", message);
        }
    }
    if !fine {
        return None;
    }
    let number = |x: [f64; 3]| regions.iter().rposition(|(shape, _)| contains(shape, x)).map_or(0, |i| i + 1);
    let mut material: Vec<u16> = Vec::new();
    if !regions.is_empty() {
        let all: Vec<[usize; 3]> = Field::new(grid, Place::Cell, "").map(|f| f.each().collect()).unwrap_or_default();
        material = fold(all.len(), |range| all[range].iter().map(|at| number(middle(&grid, *at)) as u16).collect::<Vec<_>>()).concat();
    }
    let reference = own.at(std::array::from_fn(|a| grid.origin[a] + 0.5 * grid.dx * if flat == Some(a) { 0.0 } else { grid.n[a] as f64 }));
    let reference = if reference.is_finite() { reference } else { 0.0 };
    let mut t = Field::new(grid, Place::Cell, "K").ok()?;
    if !(matches!(own, Map::Value(_)) && regions.iter().all(|(_, map)| map.is_none())) {
        fill(&grid, &mut t.data, |at| {
            let x = middle(&grid, at);
            let other = regions.iter().rev().find(|(shape, _)| contains(shape, x)).and_then(|(_, map)| map.as_ref());
            other.unwrap_or(&own).at(x) - reference
        });
        if let Some(at) = t.each().find(|at| !t.value(*at).is_finite()) {
            wrong(".temperature", format!("not a finite number at {:?} m", middle(&grid, at)));
            return None;
        }
    }
    let tolerance = words.tolerance.unwrap_or(if size_of::<Real>() == 4 { 1e-5 } else { 1e-11 });
    let plan = Plan { name: words.name.clone(), grid, scheme: words.scheme, materials, material, boundaries, sides, sources, tolerance };
    HeatedBody::new(plan, t, reference).map_err(|e| wrong(".box", e.to_string())).ok()
}
