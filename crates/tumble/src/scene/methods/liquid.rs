//! Liquids with a free surface: words to particles in a box.

use super::movers::{Mover, too_small, unbounded};
use super::{MethodRules, is_in};
use crate::fluids::{Immersed, Solids};
use crate::forces::Gravity;
use crate::geometry::Collider;
use crate::math::formula::Of;
use crate::math::{Random, Real, Vec3, VectorSignal};
use crate::recipes::{placed, region, volume};
use crate::scene::Assets;
use crate::scene::build::Builder;
use crate::scene::grids::{cells, grid};
use crate::scene::laws::{Reader, flat, off_plane};
use crate::scene::plausible::odd_density;
use crate::state::Grid;
use crate::system::System;
use crate::systems::liquid::{
    Accuracy, Inflow, Kind, Liquid as Tanks, Openings, Particles, Region, Settings, Tank, Transfer, Whitewater, WhitewaterSettings, longest,
};
use std::sync::Arc;
use tumble_interface::check::short;
use tumble_interface::looks::{Colors, FEW, Form, Look};
use tumble_interface::scene::{
    AnimatedVector, Liquid, LiquidFill, LiquidTransfer, LiquidWhitewater, MeshFile, Method, Scene, Shape, Solid, System as Plan,
};
use tumble_interface::warning::Code;
use tumble_interface::{Issue, Mesh, Warning};

/// Largest |div u| dx over the fastest velocity.
#[cfg(not(feature = "double"))]
const TOLERANCE: f64 = 1e-4;
/// Largest |div u| dx over the fastest velocity.
#[cfg(feature = "double")]
const TOLERANCE: f64 = 1e-9;
/// Colour of the light that comes through a liquid.
const WATER: [f64; 3] = [0.55, 0.85, 0.95];
/// Part of its own velocity that a particle keeps.
const FLIP: f64 = 0.97;

/// Numbers for a cell: velocities three times with weights and ways, pressure, surface, density, and a solver that is made anew.
const CELL: f64 = 40.0;
/// Numbers for a cell of the matrix of viscosity and of its solver, and for the curvature of the surface.
const VISCOUS: f64 = 31.0;
const CURVED: f64 = 2.0;
/// Numbers for a particle: its rows twice, and a snapshot.
const PARTICLE: f64 = 63.0;
/// Numbers for one of spray, foam and bubbles: a row, one of the next step, and a snapshot.
const WHITE: f64 = 24.0;
/// Colour of spray, foam and bubbles.
const FOAM: [f64; 3] = [0.9, 0.93, 0.95];

pub struct Rules;

impl MethodRules for Rules {
    fn words(&self) -> &'static [Method] {
        &[Method::Liquid]
    }

    fn kinds(&self) -> &'static [&'static str] {
        &["liquid"]
    }

    /// What a liquid moves comes after it.
    fn leads(&self, scene: &Scene) -> bool {
        scene.liquid.iter().any(|liquid| !liquid.bodies.is_empty())
    }

    fn massless(&self) -> Option<&'static str> {
        Some("particles of a liquid on a grid")
    }

    fn meets_colliders(&self) -> bool {
        true
    }

    fn own_scheme(&self) -> Option<&'static str> {
        Some("liquids on a grid have a scheme of their own and no integrator")
    }

    fn noun(&self) -> &'static str {
        "particle"
    }

    fn theory(&self) -> &'static [(&'static str, &'static [&'static str])] {
        &[("pic", &["pic.0", "pic.1", "pic.3", "pic.6"]), ("pressure", &["pressure.1"])]
    }

    fn check(&self, scene: &Scene, issues: &mut Vec<Issue>) {
        for thing in &scene.liquid {
            if thing.flip_ratio.is_some() && !matches!(thing.transfer, LiquidTransfer::Flip | LiquidTransfer::AffineFlip) {
                let message = "given without transfer = \"flip\" or \"affine_flip\"; leave it out, or set one of them";
                issues.push(Issue::new(format!("liquid \"{}\".flip_ratio", thing.name), message));
            }
            if thing.surface == Some(true) && scene.dimension == 2 {
                let message = "true, but in the plane there are no triangles; leave it out";
                issues.push(Issue::new(format!("liquid \"{}\".surface", thing.name), message));
            }
            if thing.solids == Solid::NoSlip && thing.viscosity == 0.0 {
                let message = "no_slip without viscosity, which is what sticks; set viscosity, 1e-3 Pa s for water, or leave it out";
                issues.push(Issue::new(format!("liquid \"{}\".solids", thing.name), message));
            }
            issues.extend(upside_down(thing));
            let flows = !thing.inflow.is_empty() || !thing.drain.is_empty();
            if flows && scene.expect.max_volume_error.is_some() {
                let message = format!("\"{}\" comes in or leaves, so that its volume is meant to change; leave it out", thing.name);
                issues.push(Issue::new("expect.max_volume_error", message));
            }
            let plan = scene.system.iter().find(|plan| is_in(&thing.system, plan));
            issues.extend(plan.and_then(|plan| too_long(scene, plan, thing)));
        }
    }

    fn hints(&self, scene: &Scene) -> Vec<Warning> {
        let odd = |thing: &Liquid| odd_density(format!("liquid \"{}\".density", thing.name), thing.density, 0.0);
        let mut warnings: Vec<Warning> = scene.liquid.iter().filter_map(odd).collect();
        warnings.extend(scene.liquid.iter().filter_map(|thing| unbounded(scene, "liquid", &thing.name, &thing.bodies)));
        let moved = |name: &str| scene.liquid.iter().any(|thing| thing.bodies.iter().any(|body| body == name));
        let mut others = scene.objects().into_iter().filter(|o| !matches!(o.kind, "liquid" | "joint") && !moved(o.name));
        if let (Some(other), false) = (others.next(), scene.liquid.is_empty()) {
            let message = format!(
                "liquids on a grid meet colliders, and what their `bodies` name, but not what [[{}]] consists of, nor each other",
                other.kind
            );
            warnings.push(Warning::new(Code::Unfelt, format!("liquid \"{}\"", scene.liquid[0].name), message));
        }
        warnings
    }

    fn looks(&self, scene: &Scene, plan: &Plan, colors: &mut Colors) -> Vec<Look> {
        let own = scene.liquid.iter().filter(|thing| is_in(&thing.system, plan));
        let mut looks = Vec::new();
        for thing in own {
            if has_surface(thing, flat(scene)) {
                looks.push(Look::new(&format!("{}.surface", thing.name), Form::Liquid, thing.color.unwrap_or(WATER)));
            } else {
                let radius = 0.5 * spacing(thing, flat(scene));
                let few = fill_cells(thing, flat(scene)) * per_cell(thing, flat(scene)) < FEW;
                looks.push(Look { few, ..Look::new(&thing.name, Form::Points, colors.pick(thing.color)).with_radius(radius) });
            }
            if thing.whitewater.is_some() {
                let white = |(_, word)| Look::new(&format!("{}.{word}", thing.name), Form::Points, FOAM);
                looks.extend(Kind::ALL.map(white).map(|look| look.with_radius(Whitewater::radius(cell(thing, flat(scene))))));
            }
        }
        looks
    }

    fn memory(&self, scene: &Scene, _assets: &Assets) -> f64 {
        let flat = flat(scene);
        let of = |thing: &Liquid| {
            let viscous = if thing.viscosity > 0.0 { VISCOUS } else { 0.0 };
            let curved = if thing.surface_tension > 0.0 { CURVED } else { 0.0 };
            let white = thing.whitewater.as_ref().map_or(0.0, |words| WHITE * f64::from(words.limit));
            (CELL + viscous + curved) * cells(&thing.cells, flat) + PARTICLE * per_cell(thing, flat) * fill_cells(thing, flat) + white
        };
        scene.liquid.iter().map(of).sum::<f64>() * size_of::<Real>() as f64
    }

    fn build(&self, builder: &mut Builder<'_>, index: usize) -> Option<Box<dyn System>> {
        let (scene, plan, gravity) = (builder.scene, builder.plan(index), builder.gravity.clone());
        let mut tanks = Vec::new();
        for words in scene.liquid.iter().filter(|words| is_in(&words.system, plan)) {
            let path = format!("liquid \"{}\"", words.name);
            let bodies =
                Mover { kind: "liquid", name: &words.name, system: words.system.as_deref(), bodies: &words.bodies }.bodies(builder);
            let assets = builder.assets;
            let reader = Reader::new(scene, &mut builder.issues);
            let read = Read { words, path, reader, flat: flat(scene), solids: &builder.colliders, assets };
            tanks.extend(read.tank(gravity.clone(), bodies));
        }
        Some(Box::new(Tanks::new(plan.name.clone(), plan.substeps, plan.step, tanks)))
    }
}

/// Whether frames have its surface.
fn has_surface(words: &Liquid, flat: Option<usize>) -> bool {
    words.surface.unwrap_or(flat.is_none())
}

/// Particles in a cell.
fn per_cell(words: &Liquid, flat: Option<usize>) -> f64 {
    f64::from(words.sampling).powi(if flat.is_some() { 2 } else { 3 })
}

/// Length of a cell [m].
fn cell(words: &Liquid, flat: Option<usize>) -> f64 {
    let long = (0..3).filter(|a| flat != Some(*a)).map(|a| words.cells.size[a]).fold(0.0, f64::max);
    long / f64::from(words.cells.resolution)
}

/// Distance of particles at the start [m].
fn spacing(words: &Liquid, flat: Option<usize>) -> f64 {
    cell(words, flat) / f64::from(words.sampling)
}

/// Cells that the fills take, at most.
fn fill_cells(words: &Liquid, flat: Option<usize>) -> f64 {
    let dx = cell(words, flat);
    let axes: Vec<usize> = (0..3).filter(|a| flat != Some(*a)).collect();
    let all = |size: &dyn Fn(usize) -> f64| axes.iter().map(|a| (size(*a).min(words.cells.size[*a]) / dx).ceil()).product::<f64>();
    let of = |fill: &LiquidFill| match &fill.shape {
        Shape::Box { size, .. } => all(&|a| size[a]),
        Shape::Sphere { radius, .. } => all(&|_| 2.0 * radius),
        _ => all(&|_| f64::INFINITY),
    };
    let most = all(&|_| f64::INFINITY);
    if words.inflow.is_empty() { words.fill.iter().map(of).sum::<f64>().min(most) } else { most }
}

/// Steps that are given, and longer than waves of surface tension bear.
fn too_long(scene: &Scene, plan: &Plan, words: &Liquid) -> Option<Issue> {
    let interval = 1.0 / (scene.time.fps * f64::from(scene.time.exchanges.unwrap_or(1)));
    let (key, step) = match (plan.substeps, plan.step) {
        (Some(n), _) => ("substeps", interval / f64::from(n)),
        (None, Some(step)) => ("step", step.min(interval)),
        (None, None) => return None,
    };
    let most = longest(words.density, words.surface_tension, cell(words, flat(scene)));
    let cure = if key == "step" { format!("{} s", short(most)) } else { format!("{}", (interval / most).ceil()) };
    let message = format!(
        "steps of {} s, but the surface tension of \"{}\" bears {} s at most; leave it out, or set {cure}",
        short(step),
        words.name,
        short(most)
    );
    (words.surface_tension > 0.0 && step > most).then(|| Issue::new(format!("system \"{}\".{key}", plan.name), message))
}

/// Settings of spray, foam and bubbles.
fn of_whitewater(words: &LiquidWhitewater) -> WhitewaterSettings {
    WhitewaterSettings {
        rates: [words.trapped_rate, words.crest_rate],
        speed: words.speed,
        trapped: words.trapped,
        crest: words.crest,
        life: words.life,
        rise: words.rise,
        limit: words.limit as usize,
    }
}

/// Pairs of whitewater whose second number is not above the first.
fn upside_down(thing: &Liquid) -> impl Iterator<Item = Issue> {
    let pairs = thing.whitewater.iter().flat_map(|words| {
        let thresholds = [("speed", words.speed), ("trapped", words.trapped), ("crest", words.crest)];
        let wrong = |(_, [low, high]): &(&str, [f64; 2])| low >= high;
        thresholds.into_iter().filter(wrong).chain([("life", words.life)].into_iter().filter(|(_, [low, high])| low > high))
    });
    pairs.map(|(key, [low, high])| {
        let message = format!("[{low}, {high}], expected a lower and an upper bound; swap or spread them");
        Issue::new(format!("liquid \"{}\".whitewater.{key}", thing.name), message)
    })
}

/// Reads the words of one liquid; everything wrong goes to the reader.
struct Read<'a, 'b> {
    words: &'a Liquid,
    path: String,
    reader: Reader<'b>,
    flat: Option<usize>,
    solids: &'a Arc<Vec<Collider>>,
    assets: &'a Assets,
}

impl Read<'_, '_> {
    fn wrong(&mut self, key: &str, message: impl Into<String>) {
        self.reader.issues.push(Issue::new(format!("{}{key}", self.path), message));
    }

    fn tank(mut self, gravity: Gravity, bodies: Vec<Immersed>) -> Option<Tank> {
        let (words, before) = (self.words, self.reader.issues.len());
        let grid = match grid(&words.cells, self.flat, [false; 3]) {
            Ok(grid) => grid,
            Err(error) => {
                self.wrong(".box", error.to_string());
                return None;
            }
        };
        if words.fill.is_empty() && words.inflow.is_empty() {
            let message = "empty, expected at least one volume, such as { shape = { box = { size = [1, 1, 1] } } }, or an inflow";
            self.wrong(".fill", message);
        }
        for message in too_small(&bodies, &grid) {
            self.wrong(".bodies", message);
        }
        let fills: Vec<Option<(Collider, VectorSignal)>> = words.fill.iter().enumerate().map(|(i, fill)| self.fill(i, fill)).collect();
        let mut solids = Solids::new(self.solids.clone(), bodies, words.solids == Solid::NoSlip, grid, &Default::default());
        solids.place(0.0);
        let openings = self.openings(&grid, &solids);
        if self.reader.issues.len() > before {
            return None;
        }
        let fills: Vec<(Collider, VectorSignal)> = fills.into_iter().flatten().collect();
        let solids = (solids.moves() || !solids.is_empty()).then_some(solids);
        let (x, v, counts) = particles(&grid, words.sampling, &fills, solids.as_ref());
        for (i, _) in counts.iter().enumerate().filter(|(_, count)| **count == 0) {
            let message = "it fills nothing; move it into the box and out of colliders and other fills, or make it as large as a cell";
            self.wrong(&format!(".fill[{i}].shape"), message);
        }
        if let Some(v) = v.iter().find(|v| v.iter().any(|v| !v.is_finite())) {
            self.wrong(".fill", format!("a velocity of {v:?} m/s, expected finite numbers in all of a fill"));
        }
        if self.reader.issues.len() > before {
            return None;
        }
        let (affine, own) = match words.transfer {
            LiquidTransfer::Pic => (false, false),
            LiquidTransfer::Flip => (false, true),
            LiquidTransfer::Apic => (true, false),
            LiquidTransfer::AffineFlip => (true, true),
        };
        let transfer = Transfer { ratio: if own { words.flip_ratio.unwrap_or(FLIP) } else { 0.0 }, affine };
        let settings = Settings {
            density: words.density,
            viscosity: words.viscosity,
            tension: words.surface_tension,
            stick: words.solids == Solid::NoSlip,
            sampling: words.sampling,
            surface: has_surface(words, self.flat),
            particle: 1.0 / per_cell(words, self.flat),
            transfer,
            keep_volume: words.keep_volume,
            // So fast is what falls from the top of the box.
            shade: words.color.is_none().then(|| (2.0 * gravity.largest * grid.n[2] as f64 * grid.dx).sqrt()),
            gravity,
            accuracy: Accuracy {
                tolerance: words.pressure.tolerance.unwrap_or(TOLERANCE),
                iterations: words.pressure.iterations as usize,
                on_failure: words.pressure.on_failure,
            },
            courant: words.courant,
        };
        let particles = Particles::new(x, v, affine);
        let whitewater =
            words.whitewater.as_ref().map(|white| Whitewater::new(of_whitewater(white), Random::new(self.reader.seed, &words.name)));
        match Tank::new(words.name.clone(), settings, grid, solids, particles, openings, whitewater) {
            Ok(tank) => Some(tank),
            Err(error) => {
                self.wrong(".box", error.to_string());
                None
            }
        }
    }

    /// A volume, and the velocity in it.
    fn fill(&mut self, index: usize, fill: &LiquidFill) -> Option<(Collider, VectorSignal)> {
        let key = |key: &str| format!(".fill[{index}].{key}");
        let meshes: Vec<Mesh> = match &fill.shape {
            Shape::Mesh(file) => self.assets.get(&file.path).map(|mesh| placed(mesh, file)).into_iter().collect(),
            _ => Vec::new(),
        };
        if let Shape::Mesh(MeshFile { shell: true, .. }) = &fill.shape {
            self.wrong(&key("shape.mesh.shell"), "true, but a shell has no inside that could be filled; leave it out");
            return None;
        }
        if let Some(message) = no_volume(&fill.shape, true) {
            self.wrong(&key("shape"), message);
            return None;
        }
        let velocity = self.reader.vector(&format!("{}{}", self.path, key("velocity")), &fill.velocity, Of::Start);
        if let Some(axis) = self.flat
            && velocity.is_constant()
        {
            let across = <[f64; 3]>::from(velocity.value(0.0))[axis];
            if across != 0.0 {
                self.wrong(&key("velocity"), off_plane(axis, across));
            }
        }
        match volume(&fill.shape, &meshes) {
            Ok(region) => Some((region, velocity)),
            Err((at, message)) => {
                self.wrong(&key(&format!("shape{at}")), message);
                None
            }
        }
    }

    /// Where it comes in and leaves.
    fn openings(&mut self, grid: &Grid, solids: &Solids) -> Openings {
        let words = self.words;
        let mut openings = Openings::default();
        for (i, inflow) in words.inflow.iter().enumerate() {
            let key = format!(".inflow[{i}]");
            let region = self.region(&key, &inflow.shape, (inflow.start, inflow.end), grid, solids);
            let velocity = self.inflow_velocity(&key, &inflow.velocity);
            openings.inflows.extend(region.zip(velocity).map(|(region, velocity)| Inflow::new(region, velocity)));
        }
        for (i, drain) in words.drain.iter().enumerate() {
            openings.drains.extend(self.region(&format!(".drain[{i}]"), &drain.shape, (drain.start, drain.end), grid, solids));
        }
        openings
    }

    fn inflow_velocity(&mut self, key: &str, words: &AnimatedVector) -> Option<VectorSignal> {
        let (key, before) = (format!("{key}.velocity"), self.reader.issues.len());
        let velocity = self.reader.vector(&format!("{}{key}", self.path), words, Of::Time);
        if velocity.is_constant() {
            let v: [f64; 3] = velocity.value(0.0).into();
            if v == [0.0; 3] {
                self.wrong(&key, "[0, 0, 0] m/s: nothing comes in; give a velocity");
            }
            if let Some(axis) = self.flat.filter(|axis| v[*axis] != 0.0) {
                self.wrong(&key, off_plane(axis, v[axis]));
            }
        }
        (self.reader.issues.len() == before).then_some(velocity)
    }

    /// A volume that lies, at least in part, in the box and out of solids.
    fn region(&mut self, key: &str, shape: &Shape, (start, end): (f64, Option<f64>), grid: &Grid, solids: &Solids) -> Option<Region> {
        if end.is_some_and(|end| end <= start) {
            self.wrong(&format!("{key}.end"), format!("{} s, expected > start = {} s", short(end.unwrap_or(0.0)), short(start)));
            return None;
        }
        if let Some(message) = no_volume(shape, false) {
            self.wrong(&format!("{key}.shape"), message);
            return None;
        }
        match region(shape) {
            Err((at, message)) => {
                self.wrong(&format!("{key}.shape{at}"), message);
                None
            }
            Ok(shape) => {
                let region = Region::new(shape, [start, end.unwrap_or(f64::INFINITY)], grid);
                if !region.is_open(grid, self.words.sampling, solids) {
                    let message = "it holds no place of a particle; move it into the box and out of colliders, or make it larger";
                    self.wrong(&format!("{key}.shape"), message);
                    return None;
                }
                Some(region)
            }
        }
    }
}

/// What is wrong with a shape that is to be a volume.
fn no_volume(shape: &Shape, meshes: bool) -> Option<&'static str> {
    match shape {
        Shape::Mesh(_) if meshes => None,
        Shape::Mesh(_) => Some("a mesh, expected sphere, box, plane, floor or capsule"),
        Shape::Lathe { .. } | Shape::AnimatedMesh(_) | Shape::Character(_) | Shape::Mannequin(_) => {
            Some("a solid of revolution, a figure or a mesh that moves, expected sphere, box, plane, floor, capsule or mesh")
        }
        _ => None,
    }
}

/// Places [cells] and velocities [m/s] of particles, and how many of them are in each fill: on a lattice, so many along the edge of a cell.
fn particles(
    grid: &Grid,
    sampling: u32,
    fills: &[(Collider, VectorSignal)],
    solids: Option<&Solids>,
) -> (Vec<[Real; 3]>, Vec<[Real; 3]>, Vec<usize>) {
    let (mut x, mut v, mut counts) = (Vec::new(), Vec::new(), vec![0; fills.len()]);
    let along = |a: usize| if grid.flat == Some(a) { 1 } else { grid.n[a] * sampling as usize };
    let edge = 1.0 / f64::from(sampling);
    for k in 0..along(2) {
        for j in 0..along(1) {
            for i in 0..along(0) {
                let lattice = [i, j, k];
                let at: [f64; 3] = std::array::from_fn(|a| if grid.flat == Some(a) { 0.5 } else { edge * (lattice[a] as f64 + 0.5) });
                let place = Vec3::from(std::array::from_fn(|a| grid.origin[a] + if grid.flat == Some(a) { 0.0 } else { grid.dx * at[a] }));
                let Some(fill) = fills.iter().position(|(shape, _)| shape.distance(place, 0.0, grid.dx).0 <= 0.0) else { continue };
                let at = at.map(|x| x as Real);
                if solids.is_some_and(|solids| solids.near(&at).0 <= 0.0) {
                    continue;
                }
                counts[fill] += 1;
                let mut velocity: [f64; 3] = fills[fill].1.at(0.0, place, [0.0; 3].into()).into();
                grid.flat.into_iter().for_each(|flat| velocity[flat] = 0.0);
                x.push(at);
                v.push(velocity.map(|v| v as Real));
            }
        }
    }
    (x, v, counts)
}
