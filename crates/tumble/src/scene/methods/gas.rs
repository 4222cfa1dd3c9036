//! Stable Fluids: from the words of a fluid to the fluid, and what it moves.

use super::movers::{Mover, too_small, unbounded};
use super::{MethodRules, is_in, on_grid};
use crate::fluids::{Beyond, Immersed, Sheet, Solids, hold};
use crate::forces::Gravity;
use crate::geometry::Collider;
use crate::linalg::poisson::{Excess, Method as Solve, Params, Target};
use crate::math::formula::{Formula, Of};
use crate::math::{Vec3, VectorSignal};
use crate::operators::{Advection, Interpolation, Trace};
use crate::recipes::region;
use crate::scene::Assets;
use crate::scene::build::Builder;
use crate::scene::grids::grid;
use crate::scene::laws::{Reader, flat, off_plane};
use crate::state::{Field, Grid, Place, Vectors};
use crate::system::System;
use crate::systems::gas::{Fire, Fluid, Gas, Settings, Source};
use std::sync::Arc;
use tumble_interface::check::{plain, suggestion};
use tumble_interface::looks::{Colors, Look};
use tumble_interface::scene::{
    Animated, Carriage, Component, Densities, ExcessFlow, Field as Flow, Gas as Words, GasSide, GridInterpolation, Method, Order,
    PathTrace, PressureMethod, Scene, Shape, Solid, System as Plan, Temperature, Viscous,
};
use tumble_interface::{Issue, Warning};

/// Largest |div u| dx over the fastest velocity.
#[cfg(not(feature = "double"))]
const TOLERANCE: f64 = 1e-5;
/// Largest |div u| dx over the fastest velocity.
#[cfg(feature = "double")]
const TOLERANCE: f64 = 1e-10;

pub struct Rules;

impl MethodRules for Rules {
    fn words(&self) -> &'static [Method] {
        &[Method::Gas]
    }

    fn kinds(&self) -> &'static [&'static str] {
        &["gas"]
    }

    /// What a fluid moves comes after it.
    fn leads(&self, scene: &Scene) -> bool {
        scene.gas.iter().any(|gas| !gas.bodies.is_empty() || !gas.sheet.is_empty())
    }

    fn massless(&self) -> Option<&'static str> {
        Some("cells of a fluid")
    }

    fn meets_colliders(&self) -> bool {
        true
    }

    fn is_on_grids(&self) -> bool {
        true
    }

    fn own_scheme(&self) -> Option<&'static str> {
        Some("Stable Fluids have no integrator")
    }

    fn noun(&self) -> &'static str {
        "cell"
    }

    fn theory(&self) -> &'static [(&'static str, &'static [&'static str])] {
        &[("gas", &["gas.1", "gas.3", "gas.4", "gas.5"]), ("pressure", &["pressure.1"])]
    }

    fn check(&self, scene: &Scene, issues: &mut Vec<Issue>) {
        for (i, field) in scene.field.iter().enumerate() {
            if let Flow::Gas { of } = field
                && !scene.gas.iter().any(|gas| gas.name == *of)
            {
                let hint = suggestion(of, scene.gas.iter().map(|gas| gas.name.as_str()));
                issues.push(Issue::new(format!("field[{i}].of"), format!("there is no gas \"{of}\"{hint}")));
            }
        }
    }

    fn hints(&self, scene: &Scene) -> Vec<Warning> {
        scene.gas.iter().filter_map(|gas| unbounded(scene, "gas", &gas.name, &gas.bodies)).collect()
    }

    fn looks(&self, scene: &Scene, plan: &Plan, colors: &mut Colors) -> Vec<Look> {
        let own = scene.gas.iter().filter(|thing| is_in(&thing.system, plan));
        own.map(|thing| on_grid(&thing.name, scene, thing.fluid_density, colors)).collect()
    }

    fn memory(&self, scene: &Scene, _assets: &Assets) -> f64 {
        scene.gas.iter().map(|thing| bytes(thing, flat(scene), !scene.collider.is_empty())).sum()
    }

    fn build(&self, builder: &mut Builder<'_>, index: usize) -> Option<Box<dyn System>> {
        let (scene, plan, gravity) = (builder.scene, builder.plan(index), builder.gravity.clone());
        let mut fluids = Vec::new();
        for words in scene.gas.iter().filter(|words| is_in(&words.system, plan)) {
            let (bodies, sheets) = moved(builder, words);
            let reader = Reader::new(scene, &mut builder.issues);
            let path = format!("gas \"{}\"", words.name);
            fluids
                .extend(Read { words, path, reader, flat: flat(scene), solids: &builder.colliders, bodies, sheets }.fluid(gravity.clone()));
        }
        Some(Box::new(Gas::new(plan.name.clone(), plan.substeps, plan.step, fluids)))
    }
}

/// A number of places and nothing else, or what is wrong with it.
fn scalar(words: &Component) -> Result<Formula, String> {
    match words {
        Component::Value(value) => Ok(Formula::constant(*value)),
        Component::Formula(text) => Formula::new(text, 1, Of::Start),
    }
}

fn method(words: PressureMethod) -> Solve {
    match words {
        PressureMethod::Jacobi => Solve::Jacobi,
        PressureMethod::GaussSeidel => Solve::GaussSeidel,
        PressureMethod::Sor => Solve::Sor,
        PressureMethod::ConjugateGradients => Solve::ConjugateGradients,
        PressureMethod::IncompleteCholesky => Solve::IncompleteCholesky,
        PressureMethod::ModifiedIncompleteCholesky => Solve::ModifiedIncompleteCholesky,
        PressureMethod::Multigrid => Solve::Multigrid,
        PressureMethod::MultigridGradients => Solve::MultigridGradients,
        PressureMethod::Cosine => Solve::Cosine,
    }
}

fn carriage(words: &Carriage, corrected: bool) -> Advection {
    Advection {
        trace: match words.trace {
            PathTrace::Euler => Trace::Euler,
            PathTrace::Rk2 => Trace::Rk2,
            PathTrace::Rk3 => Trace::Rk3,
        },
        substeps: words.pieces.unwrap_or(1) as usize,
        interpolation: match words.interpolation {
            GridInterpolation::Linear => Interpolation::Linear,
            GridInterpolation::Cubic => Interpolation::Cubic,
            GridInterpolation::MonotoneCubic => Interpolation::MonotoneCubic,
        },
        corrected: words.corrected.unwrap_or(corrected),
        turning: words.turning,
    }
}

/// Whether velocities are corrected where the scene does not say it: reflection would waste what linear interpolation smears.
fn is_corrected(words: &Words) -> bool {
    words.order == Order::Reflection && !words.advection.velocity.turning
}

/// Reads the words of one fluid; everything wrong goes to the reader.
struct Read<'a, 'b> {
    words: &'a Words,
    path: String,
    reader: Reader<'b>,
    flat: Option<usize>,
    solids: &'a Arc<Vec<Collider>>,
    bodies: Vec<Immersed>,
    sheets: Vec<Sheet>,
}

impl Read<'_, '_> {
    fn wrong(&mut self, key: &str, message: impl Into<String>) {
        let issue = Issue::new(format!("{}{key}", self.path), message);
        if !self.reader.issues.contains(&issue) {
            self.reader.issues.push(issue);
        }
    }

    /// A vector that may depend on the place; one without place must lie in the plane.
    fn vector(&mut self, key: &str, words: &tumble_interface::scene::AnimatedVector, of: Of) -> VectorSignal {
        let path = format!("{}{key}", self.path);
        let signal = self.reader.vector(&path, words, of);
        if let Some(axis) = self.flat
            && signal.is_constant()
        {
            let across = <[f64; 3]>::from(signal.value(0.0))[axis];
            if across != 0.0 {
                self.wrong(key, off_plane(axis, across));
            }
        }
        signal
    }

    fn sides(&mut self, ambient: f64) -> [[Beyond; 2]; 3] {
        let words = self.words;
        let mut sides: [[Beyond; 2]; 3] = Default::default();
        for (axis, (name, given)) in [("x", &words.sides.x), ("y", &words.sides.y), ("z", &words.sides.z)].into_iter().enumerate() {
            if self.flat == Some(axis) {
                if *given != <[GasSide; 2]>::default() {
                    self.wrong(&format!(".sides.{name}"), "given for the axis across the plane of the scene; leave it out");
                }
                continue;
            }
            if (given[0] == GasSide::Periodic) != (given[1] == GasSide::Periodic) {
                self.wrong(&format!(".sides.{name}"), "only one side is periodic; make both periodic, or none");
            }
            for end in 0..2 {
                let key = format!(".sides.{name}[{end}]");
                sides[axis][end] = match &given[end] {
                    GasSide::FreeSlip => Beyond::FreeSlip,
                    GasSide::NoSlip => Beyond::NoSlip([0.0; 3].into()),
                    GasSide::Open => Beyond::Open,
                    GasSide::Periodic => Beyond::Periodic,
                    GasSide::Wall { velocity } => {
                        let velocity = self.vector(&format!("{key}.wall.velocity"), velocity, Of::Time);
                        let across = <[f64; 3]>::from(velocity.value(0.0))[axis];
                        if across != 0.0 {
                            let message =
                                format!("{} m/s across the wall, expected 0: a wall of the box moves only along itself", plain(across));
                            self.wrong(&format!("{key}.wall.velocity"), message);
                        }
                        Beyond::NoSlip(velocity)
                    }
                    GasSide::Inflow { velocity, density, fuel, temperature } => Beyond::Inflow {
                        velocity: self.vector(&format!("{key}.inflow.velocity"), velocity, Of::Place),
                        carried: vec![("density", *density), ("fuel", *fuel), ("temperature", temperature.unwrap_or(ambient))],
                    },
                };
            }
        }
        sides
    }

    fn sources(&mut self, grid: &Grid) -> Vec<Source> {
        let mut sources = Vec::new();
        for (i, words) in self.words.source.iter().enumerate() {
            let key = |key: &str| format!(".source[{i}].{key}");
            if matches!(
                words.shape,
                Shape::Lathe { .. } | Shape::Mesh(_) | Shape::AnimatedMesh(_) | Shape::Character(_) | Shape::Mannequin(_)
            ) {
                self.wrong(&key("shape"), "a mesh or a solid of revolution, expected sphere, box, plane, floor or capsule");
                continue;
            }
            let region = match region(&words.shape) {
                Ok(region) => region,
                Err((at, message)) => {
                    self.wrong(&key(&format!("shape{at}")), message);
                    continue;
                }
            };
            let velocity = words.velocity.as_ref().map(|v| self.vector(&key("velocity"), v, Of::Time));
            let mut rate =
                |word: &str, words: &Animated, least: f64| self.reader.signal(&format!("{}{}", self.path, key(word)), words, least);
            let smoke = rate("smoke", &words.smoke, f64::NEG_INFINITY);
            let heating = rate("heating", &words.heating, f64::NEG_INFINITY);
            let fuel = rate("fuel", &words.fuel, 0.0);
            let mut held = |word: &str, words: &Option<Animated>| words.as_ref().map(|words| rate(word, words, 0.0));
            let density = held("density", &words.density);
            let temperature = held("temperature", &words.temperature);
            let fuel_density = held("fuel_density", &words.fuel_density);
            let none = |words: &Animated| words.constant() == Some(0.0);
            for (word, given, there) in [
                ("smoke", !none(&words.smoke) || words.density.is_some(), self.words.smoke.is_some()),
                ("fire", !none(&words.fuel) || words.fuel_density.is_some(), self.words.fire.is_some()),
                ("temperature", !none(&words.heating) || words.temperature.is_some(), self.words.temperature.is_some()),
            ] {
                if given && !there {
                    self.wrong(&format!(".{word}"), format!("missing, but source {i} gives it; add {word} = {{}}"));
                }
            }
            let source = Source {
                smoke,
                density,
                temperature,
                heating,
                fuel,
                fuel_density,
                velocity,
                times: [words.start, words.end.unwrap_or(f64::INFINITY)],
                covers: Vec::new(),
            }
            .covering(&region, grid);
            if source.is_empty() {
                self.wrong(&key("shape"), "it covers no cell; move it into the box, or make it as large as a cell");
            }
            sources.push(source);
        }
        sources
    }

    /// A field of cells from a formula of the place.
    fn cells(&mut self, key: &str, words: &Component, grid: &Grid, unit: &'static str, least: f64) -> Option<Field> {
        let formula = match scalar(words) {
            Ok(formula) => formula,
            Err(message) => {
                self.wrong(key, message);
                return None;
            }
        };
        let value = |x: [f64; 3]| formula.at(0.0, Vec3::from(x), [0.0; 3].into())[0];
        let field = Field::of(*grid, Place::Cell, unit, value).ok()?;
        let bad = field.each().find(|at| {
            let value = f64::from(field.value(*at));
            !(value.is_finite() && value >= least)
        });
        if let Some(at) = bad {
            let place = grid.point(Place::Cell, at);
            self.wrong(key, format!("{} {unit} at {place:?} m, expected a number >= {least}", plain(value(place))));
            return None;
        }
        Some(field)
    }

    /// More comes in than goes out, and no side lets it.
    fn check_flow(&mut self, sides: &[[Beyond; 2]; 3], u: &Vectors) {
        let closed = sides.iter().flatten().all(|side| !matches!(side, Beyond::Open));
        let inflow = sides.iter().flatten().any(|side| matches!(side, Beyond::Inflow { .. }));
        if !closed || !inflow || self.words.pressure.excess == ExcessFlow::Remove {
            return;
        }
        let (mut net, mut all) = (0.0, 0.0_f64);
        for (axis, part) in u.parts.iter().filter_map(|p| if let Place::Face(a) = p.place { Some((a, p)) } else { None }) {
            for at in part.each().filter(|at| !part.grid.periodic[axis] && (at[axis] == 0 || at[axis] == part.grid.n[axis])) {
                let into = f64::from(part.value(at)) * if at[axis] == 0 { 1.0 } else { -1.0 };
                net += into;
                all += into.abs();
            }
        }
        if net.abs() > 1e-6 * all {
            let message = format!(
                "{:.3} of the inflow has no way out; open a side, let as much flow out, or set pressure.excess = \"remove\"",
                net.abs() / all
            );
            self.wrong(".sides", message);
        }
    }

    /// The bodies that it moves; each must cover some cells.
    fn bodies(&mut self, grid: &Grid) -> Vec<Immersed> {
        let bodies = std::mem::take(&mut self.bodies);
        for message in too_small(&bodies, grid) {
            self.wrong(".bodies", message);
        }
        bodies
    }

    /// How fuel burns.
    fn fire(&mut self, warmth: &Temperature, sides: &[[Beyond; 2]; 3]) -> Option<Fire> {
        let words = self.words;
        let fire = words.fire.as_ref()?;
        if words.temperature.is_none() {
            self.wrong(".temperature", "missing, but fire needs it; add temperature = {}");
        }
        if fire.soot > 0.0 && words.smoke.is_none() {
            self.wrong(".smoke", "missing, but fire.soot becomes smoke; add smoke = {}");
        }
        let closed = sides.iter().flatten().all(|side| !matches!(side, Beyond::Open));
        if closed && fire.expansion > 0.0 && words.pressure.excess == ExcessFlow::Error {
            let message = format!(
                "{} m³/kg, but no side is open for what burns to expand through; open a side, set it to 0, or set pressure.excess = \"remove\"",
                plain(fire.expansion)
            );
            self.wrong(".fire.expansion", message);
        }
        Some(Fire {
            ignition: fire.ignition,
            burn_time: fire.burn_time,
            warming: fire.heat / (words.fluid_density * warmth.specific_heat),
            soot: fire.soot,
            expansion: fire.expansion,
        })
    }

    fn fluid(mut self, gravity: Gravity) -> Option<Fluid> {
        let words = self.words;
        let before = self.reader.issues.len();
        let periodic = [&words.sides.x, &words.sides.y, &words.sides.z].map(|s| s[0] == GasSide::Periodic);
        let grid = match grid(&words.cells, self.flat, periodic) {
            Ok(grid) => grid,
            Err(error) => {
                self.wrong(".box", error.to_string());
                return None;
            }
        };
        let warmth = words.temperature.clone().unwrap_or_default();
        let smoke = words.smoke.clone().unwrap_or_default();
        let sides = self.sides(warmth.ambient);
        let sources = self.sources(&grid);
        let velocity = self.vector(".velocity", &words.velocity, Of::Start);
        let acceleration = self.vector(".acceleration", &words.acceleration, Of::Place);
        let density = words.smoke.as_ref().and_then(|s| self.cells(".smoke.initial", &s.initial, &grid, "kg/m³", 0.0));
        let ambient = Component::Value(warmth.ambient);
        let initial = warmth.initial.as_ref().unwrap_or(&ambient);
        let temperature = words.temperature.as_ref().and_then(|_| self.cells(".temperature.initial", initial, &grid, "K", 0.0));
        let fuel = words.fire.as_ref().and_then(|fire| self.cells(".fire.initial", &fire.initial, &grid, "kg/m³", 0.0));
        let fire = self.fire(&warmth, &sides);
        let still = [0.0; 3].into();
        let mut u = Vectors::of(grid, "m/s", |x| velocity.at(0.0, Vec3::from(x), still).into()).ok()?;
        if u.parts.iter().any(|p| p.each().any(|at| !p.value(at).is_finite())) {
            self.wrong(".velocity", "not a finite number everywhere in the box");
        }
        hold(&mut u, &sides, 0.0);
        self.check_flow(&sides, &u);
        if words.advection.scalars.turning {
            self.wrong(".advection.scalars.turning", "true, expected false: numbers have no direction");
        }
        if words.advection.velocity.conservative {
            self.wrong(".advection.velocity.conservative", "true, expected false: for scalars only");
        }
        let scalars = &words.advection.scalars;
        if scalars.conservative && (Carriage { conservative: false, ..scalars.clone() }) != Carriage::default() {
            let message = "given with conservative, which follows no paths; leave out interpolation, corrected, trace and pieces";
            self.wrong(".advection.scalars", message);
        }
        if words.advection.velocity.turning && words.advection.velocity.corrected == Some(true) {
            self.wrong(".advection.velocity.corrected", "given with turning, which has no correction; leave out one of them");
        }
        let reflected = words.order == Order::Reflection;
        if reflected && words.densities == Densities::Variable {
            let message = "variable, expected boussinesq: order = \"reflection\" keeps the energy of one density alone";
            self.wrong(".densities", message);
        }
        if reflected && words.viscous == Viscous::Explicit {
            self.wrong(".viscous", "explicit, expected implicit: order = \"reflection\" takes both ends of a step alike; leave it out");
        }
        if self.reader.issues.len() > before {
            return None;
        }
        let stick = words.solids == Solid::NoSlip;
        let mut solids = Solids::new(self.solids.clone(), self.bodies(&grid), stick, grid, &sides);
        solids.place(0.0);
        if solids.fills() {
            self.wrong(".box", "colliders fill all of it; move them, or the box");
            return None;
        }
        let moves = solids.moves();
        // Those that are not here, and never come, cost nothing.
        let solids = (moves || !solids.is_empty()).then_some(solids);
        let cosine = words.pressure.method == PressureMethod::Cosine;
        if cosine && solids.is_some() {
            self.wrong(".pressure.method", "cosine, which knows no colliders; take multigrid_gradients");
            return None;
        }
        if !words.bodies.is_empty() && !method(words.pressure.method).is_gradients() {
            let message = format!(
                "{}, expected a method of gradients: bodies that move are solved for together with the pressure",
                method(words.pressure.method).name()
            );
            self.wrong(".pressure.method", message);
            return None;
        }
        if cosine && words.densities == Densities::Variable {
            self.wrong(".pressure.method", "cosine, which knows one density alone; take multigrid_gradients");
            return None;
        }
        if !words.sheet.is_empty() && words.densities == Densities::Variable {
            self.wrong(".densities", "variable, expected boussinesq: sheets know one density alone");
            return None;
        }
        let pressure = &words.pressure;
        let settings = Settings {
            density: words.fluid_density,
            viscosity: words.viscosity.unwrap_or(0.0),
            viscous: words.viscous,
            sides,
            gravity: gravity.at(0.0),
            course: gravity,
            acceleration,
            diffusivity: [smoke.diffusivity, warmth.diffusivity],
            dissipation: smoke.dissipation,
            weight: smoke.weight,
            ambient: warmth.ambient,
            cooling: warmth.cooling,
            radiation: warmth.radiation,
            specific_heat: warmth.specific_heat,
            expansion: warmth.expansion.unwrap_or(1.0 / warmth.ambient),
            variable: words.densities == Densities::Variable,
            fire,
            sources,
            confinement: words.confinement,
            order: words.order,
            velocity: carriage(&words.advection.velocity, is_corrected(words)),
            scalars: carriage(&words.advection.scalars, true),
            conservative: words.advection.scalars.conservative,
            pressure: Params {
                method: method(pressure.method),
                target: Target::Relative(0.0),
                iterations: pressure.iterations as usize,
                excess: if pressure.excess == ExcessFlow::Error { Excess::Refuse } else { Excess::Remove },
            },
            tolerance: pressure.tolerance.unwrap_or(TOLERANCE),
            on_failure: pressure.on_failure,
            courant: words.courant,
        };
        match Fluid::new(words.name.clone(), settings, solids, u, [density, temperature, fuel]) {
            Ok(mut fluid) => {
                fluid.sheets = self.sheets;
                Some(fluid)
            }
            Err(failure) => {
                self.wrong("", failure.to_string());
                None
            }
        }
    }
}

/// Drag of a cylinder across the flow, and resistance of a dense net.
const THREAD: f64 = 1.2;
const DENSE: f64 = 10.0;

/// The bodies and sheets that a fluid moves.
fn moved(builder: &mut Builder<'_>, words: &Words) -> (Vec<Immersed>, Vec<Sheet>) {
    let mover = Mover { kind: "gas", name: &words.name, system: words.system.as_deref(), bodies: &words.bodies };
    let (bodies, mut sheets) = (mover.bodies(builder), Vec::new());
    let (scene, parts, ids) = (builder.scene, &builder.masses, &builder.ids);
    let (exchange, issues) = (&mut builder.exchange, &mut builder.issues);
    for (i, sheet) in words.sheet.iter().enumerate() {
        let name = &sheet.object;
        let mut wrong = |message: String| issues.push(Issue::new(format!("gas \"{}\".sheet[{i}].object", words.name), message));
        let Some(system) = mover.system_of(scene, name, &mut wrong) else { continue };
        let Some(object) = parts[system].named(name) else { continue };
        let longest = object.breaks.unwrap_or(f64::INFINITY);
        let (triangles, curve) = match (scene.dimension, object.triangles.is_empty()) {
            (2, _) => (Vec::new(), (object.pieces().collect(), None, longest)),
            (_, true) => (Vec::new(), (object.pieces().collect(), Some(2.0 * object.radius), longest)),
            _ => (object.triangles.clone(), (Vec::new(), None, longest)),
        };
        if triangles.is_empty() && curve.0.is_empty() {
            let what = if scene.dimension == 2 { "is no curve, which a sheet in the plane is" } else { "has no triangles and is no curve" };
            wrong(format!("\"{name}\" {what}"));
            continue;
        }
        let rows = exchange.open(ids[system], object.points.clone(), false);
        let resistance = sheet.resistance.unwrap_or(if curve.1.is_some() { THREAD } else { DENSE });
        sheets.push(Sheet::new(name.clone(), rows, triangles, curve, [resistance, sheet.friction]));
    }
    (bodies, sheets)
}

/// Bytes for a cell of a fluid: velocities, what is carried, and what steps and solvers need; a snapshot of the state.
fn bytes(words: &Words, flat: Option<usize>, solids: bool) -> f64 {
    let real = std::mem::size_of::<crate::math::Real>() as f64;
    let cells = grid(&words.cells, flat, [false; 3]).map_or_else(
        |_| {
            let long = (0..3).filter(|a| flat != Some(*a)).map(|a| words.cells.size[a]).fold(0.0, f64::max);
            let count =
                |a: usize| if flat == Some(a) { 1.0 } else { (words.cells.size[a] / long * f64::from(words.cells.resolution)).max(1.0) };
            (0..3).map(count).product()
        },
        |grid| grid.lattice().len() as f64,
    );
    let axes = if flat.is_some() { 2.0 } else { 3.0 };
    let carried = f64::from(u8::from(words.smoke.is_some()))
        + f64::from(u8::from(words.temperature.is_some()))
        + f64::from(u8::from(words.fire.is_some()));
    let scalars = &words.advection.scalars;
    let scratch = if scalars.conservative {
        3.0 + axes
    } else if scalars.corrected.unwrap_or(true) {
        3.0 * carried
    } else {
        0.0
    };
    let scratch = scratch.max(if words.advection.velocity.corrected.unwrap_or(is_corrected(words)) { 3.0 } else { 0.0 });
    let conjugates = if words.viscosity.unwrap_or(0.0) > 0.0 { 3.0 } else { 0.0 };
    let confined = if words.confinement > 0.0 { 8.0 } else { 0.0 };
    // Two of each state and one in the snapshot; pressure, its snapshot, right-hand side twice, unknown; five of the solver with its
    // weights and coarse grids.
    // Distances and open shares; what is listed is near surfaces, but for closed faces.
    let solid = if solids { 4.0 } else { 0.0 };
    // Densities at cells and faces; weights, and a solver with coarse grids that has numbers for them.
    let varied = if words.densities == Densities::Variable { 1.0 + axes + 3.0 + 14.0 } else { 0.0 };
    let swelling = f64::from(u8::from(words.fire.is_some()));
    // Velocities of the start, before the middle and before its viscosity, and the pressure.
    let reflected = if words.order == Order::Reflection { 3.0 * axes + 1.0 } else { 0.0 };
    let numbers = 3.0 * (axes + carried) + swelling + reflected + varied + 5.0 + 6.5 + scratch + conjugates + confined + solid;
    cells * numbers * real
}
