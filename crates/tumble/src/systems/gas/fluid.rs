//! A fluid in a box: its state, and the step that the lecture draws.

use super::densities::Densities;
use super::fire::Flame;
use super::settings::Settings;
use crate::exchange::{Exchange, Turn};
use crate::fluids::rows::{extreme, largest, sum, worse};
use crate::fluids::{Beyond, Failure, Immersed, PressureProjection, Sheet, Solids, Viscosity, hold, projection, spread};
use crate::geometry::Collider;
use crate::linalg::poisson::Solver;
use crate::math::{Real, Spare};
use crate::operators::{advect, advect_vectors, each_row, transport};
use crate::state::{Field, Grid, GridError, Place, Side, Vectors};
use std::sync::Arc;
use tumble_interface::StepError;
use tumble_interface::engine::StepReport;
use tumble_interface::scene::Order;

/// A fluid in a box.
pub struct Fluid {
    /// Name of the object.
    pub name: String,
    /// Constant settings.
    pub settings: Settings,
    /// Velocity on faces [m/s].
    pub u: Vectors,
    /// Density of smoke at cells [kg/m³].
    pub smoke: Option<Field>,
    /// Temperature at cells [K].
    pub temperature: Option<Field>,
    /// Fuel that burns.
    pub flame: Option<Flame>,
    /// Pressure of the last projection at cells [Pa].
    pub pressure: Field,
    /// Data for variable density.
    pub(super) densities: Option<Densities>,
    pub(super) solver: Solver<u8>,
    pub(super) solids: Option<Solids>,
    /// Immersed sheets.
    pub sheets: Vec<Sheet>,
}

/// A failure and the fluid that it happened to.
#[derive(Debug)]
pub struct Failed {
    failure: Failure,
    fluid: String,
    /// The non-finite value, if any.
    broken: Option<StepError>,
}

impl Failed {
    /// The error of a step of the system at time t [s].
    pub fn within(self, system: &str, t: f64) -> StepError {
        if let Some(StepError::NotFinite(mut breakdown)) = self.broken {
            breakdown.system = system.into();
            breakdown.time = t;
            return StepError::NotFinite(breakdown);
        }
        StepError::Capacity { system: system.into(), time: t, what: format!("gas \"{}\": {}", self.fluid, self.failure) }
    }
}

impl Fluid {
    /// A fluid with this velocity around these solids; `smoke`, `temperature` and `fuel` are carried if given. The velocity is projected.
    pub fn new(
        name: String,
        settings: Settings,
        solids: Option<Solids>,
        u: Vectors,
        [smoke, temperature, fuel]: [Option<Field>; 3],
    ) -> Result<Self, Failure> {
        let grid = u.on_faces("velocity of a fluid")?;
        let solver = solver(grid, &settings, solids.as_ref())?;
        let sides = &settings.sides;
        let smoke = smoke.map(|f| carried(f, sides, "density", 0.0));
        let temperature = temperature.map(|f| carried(f, sides, "temperature", settings.ambient));
        let flame = match (settings.fire, fuel) {
            (Some(fire), Some(fuel)) => {
                let fuel = carried(fuel, sides, "fuel", 0.0);
                Some(Flame::new(fire, fuel, grid, temperature.as_ref(), settings.ambient)?)
            }
            _ => None,
        };
        let mut pressure = Field::new(grid, Place::Cell, "Pa")?;
        for (axis, end) in (0..3).flat_map(|a| [(a, 0), (a, 1)]) {
            if matches!(sides[axis][end], Beyond::Open) {
                pressure.sides[axis][end] = Side::Value(0.0);
            }
        }
        let mut fluid = Self {
            name,
            u,
            smoke,
            temperature,
            flame,
            pressure,
            densities: if settings.variable { Some(Densities::new(grid)?) } else { None },
            solver,
            solids,
            sheets: Vec::new(),
            settings,
        };
        hold(&mut fluid.u, &fluid.settings.sides, 0.0);
        fluid.clear();
        fluid.projection(0.0, 1.0, &mut StepReport::default())?;
        fluid.pressure.data.fill(0.0);
        Ok(fluid)
    }

    /// Its cells.
    pub fn grid(&self) -> Grid {
        self.pressure.grid
    }

    /// Gravity is that of a time [s].
    pub fn set_gravity(&mut self, t: f64) {
        self.settings.gravity = self.settings.course.at(t);
    }

    /// One step of h seconds from t to `end` [s].
    pub fn step(&mut self, t: f64, h: f64, end: f64, report: &mut StepReport) -> Result<(), Box<Failed>> {
        report.passed(self.fastest() * h / self.grid().dx);
        let parts = match self.settings.order {
            Order::ProjectLast => self
                .advection(t, h)
                .and_then(|()| self.settle(end))
                .and_then(|()| self.forces(t, h))
                .and_then(|()| self.viscosity(t, h, report))
                .and_then(|()| self.projection(t + h, h, report)),
            Order::AdvectLast => self
                .forces(t, h)
                .and_then(|()| self.viscosity(t, h, report))
                .and_then(|()| self.projection(t + h, h, report))
                .and_then(|()| self.advection(t, h))
                .and_then(|()| self.settle(end)),
            Order::Reflection => self.reflected(t, h, end, report),
        };
        parts.map_err(|failure| self.failed(failure))
    }

    /// Work before a frame is taken.
    pub fn finish(&mut self, t: f64, report: &mut StepReport) -> Result<(), Box<Failed>> {
        if self.settings.order != Order::AdvectLast {
            return Ok(());
        }
        // The pressure of a frame is that of its last step, not what little this one adds.
        let pressure = self.pressure.data.clone();
        let done = self.projection(t, 1.0, report);
        self.pressure.data = pressure;
        done.map_err(|failure| self.failed(failure))
    }

    /// Moves the solids to where they are at time t, and takes what is carried out of them.
    pub(super) fn settle(&mut self, t: f64) -> Result<(), Failure> {
        let Some(solids) = &mut self.solids else { return Ok(()) };
        // Sums of steps may end an ulp beside the next one's start.
        if solids.moves() && (solids.time - t).abs() > 1e-12 * t.abs() {
            if self.settings.conservative {
                // Cells that come out of a solid begin with what is beside them.
                let fuel = self.flame.iter_mut().map(|flame| &mut flame.fuel);
                self.smoke.iter_mut().chain(&mut self.temperature).chain(fuel).for_each(|carried| solids.shade(carried));
            }
            let h = t - solids.time;
            solids.bodies.iter_mut().for_each(|body| body.advance(h));
            solids.place(t);
            self.renew()?;
        }
        self.clear();
        Ok(())
    }

    /// A new pressure solver, in the memory of the old one.
    fn renew(&mut self) -> Result<(), Failure> {
        let spare = std::mem::take(&mut self.solver.spare);
        self.solver = solver(self.grid(), &self.settings, self.solids.as_ref())?;
        self.solver.spare = spare;
        Ok(())
    }

    /// Puts the solids where they were at time t: the numbers of each body.
    pub(super) fn put(&mut self, t: f64, bodies: &[f64]) -> Option<()> {
        let solids = self.solids.as_mut()?;
        if bodies.len() != Immersed::NUMBERS * solids.bodies.len() {
            return None;
        }
        solids.bodies.iter_mut().zip(bodies.chunks_exact(Immersed::NUMBERS)).for_each(|(body, numbers)| body.put(numbers));
        solids.place(t);
        self.renew().ok()?;
        self.clear();
        Some(())
    }

    /// Takes what is carried out of the solids.
    pub(super) fn clear(&mut self) {
        let Some(solids) = &self.solids else { return };
        self.smoke.iter_mut().for_each(|smoke| solids.clear(&mut smoke.data, 0.0));
        self.temperature.iter_mut().for_each(|warmth| solids.clear(&mut warmth.data, self.settings.ambient));
        self.flame.iter_mut().for_each(|flame| solids.clear(&mut flame.fuel.data, 0.0));
    }

    /// Takes the densities from what is carried.
    pub(super) fn weigh(&mut self) {
        if let Some(densities) = &mut self.densities {
            densities.measure(&self.settings, self.smoke.as_ref(), self.temperature.as_ref());
        }
    }

    pub(super) fn failed(&self, failure: Failure) -> Box<Failed> {
        Box::new(Failed { broken: self.broken("", 0.0), failure, fluid: self.name.clone() })
    }

    /// Everything goes with the fluid for h seconds from t on.                                             (gas.5)
    pub fn advection(&mut self, t: f64, h: f64) -> Result<(), Failure> {
        self.advection_by(None, t, h)
    }

    /// The same with a flow other than its own velocity.
    pub(super) fn advection_by(&mut self, mut flow: Option<&mut Vectors>, t: f64, h: f64) -> Result<(), Failure> {
        self.settle(t)?;
        hold(&mut self.u, &self.settings.sides, t);
        flow.iter_mut().for_each(|flow| hold(flow, &self.settings.sides, t + h));
        if let Some(solids) = &self.solids {
            solids.extend(&mut self.u);
            flow.iter_mut().for_each(|flow| solids.extend(flow));
            let fuel = self.flame.iter_mut().map(|flame| &mut flame.fuel);
            self.smoke.iter_mut().chain(&mut self.temperature).chain(fuel).for_each(|carried| solids.shade(carried));
        }
        let mut lost = Vec::new();
        let Self { u, smoke, temperature, flame, settings, solver, solids, .. } = self;
        let spare = &mut solver.spare;
        let fuel = flame.iter_mut().map(|flame| &mut flame.fuel);
        let mut carried: Vec<&mut Field> = smoke.iter_mut().chain(temperature.iter_mut()).chain(fuel).collect();
        let flow = flow.as_deref().unwrap_or(u);
        if settings.conservative {
            let mut through = copy(flow, spare)?;
            solids.iter().for_each(|solids| solids.narrow(&mut through));
            lost = transport(&mut carried, &through, h, spare)?;
            through.parts.into_iter().for_each(|part| spare.keep(part));
        } else {
            let from: Vec<&Field> = carried.iter().map(|field| &**field).collect();
            let new = advect(&from, flow, h, &settings.scalars, spare)?;
            carried.into_iter().zip(new).for_each(|(field, new)| spare.keep(std::mem::replace(field, new)));
        }
        let new = advect_vectors(u, flow, h, &settings.velocity, spare)?;
        std::mem::replace(u, new).parts.into_iter().for_each(|part| spare.keep(part));
        hold(u, &settings.sides, t + h);
        self.restore_contents(&lost);
        Ok(())
    }

    /// Gives back what the divergence that the pressure left has taken from what is carried, where it is mixed.            (gas.22)
    fn restore_contents(&mut self, lost: &[f64]) {
        let swells = self.flame.as_ref().is_some_and(|flame| flame.fire.expansion > 0.0);
        if lost.is_empty() || swells || self.solids.as_ref().is_some_and(Solids::moves) {
            return;
        }
        self.clear();
        let fuel = self.flame.iter_mut().map(|flame| &mut flame.fuel);
        let carried = self.smoke.iter_mut().chain(&mut self.temperature).chain(fuel);
        carried.zip(lost).for_each(|(field, lost)| give_back(field, *lost));
    }

    /// Viscosity of the velocity, and diffusion of smoke and warmth, for h seconds from t on.             (gas.3)
    pub fn viscosity(&mut self, t: f64, h: f64, report: &mut StepReport) -> Result<(), Failure> {
        self.diffusion(h)?;
        self.friction(t + h, h, report)
    }

    /// Smoke and warmth spread for h seconds.
    pub(super) fn diffusion(&mut self, h: f64) -> Result<(), Failure> {
        let spare = &mut self.solver.spare;
        for (carried, kappa) in [&mut self.smoke, &mut self.temperature].into_iter().zip(self.settings.diffusivity) {
            if let Some(carried) = carried
                && kappa > 0.0
            {
                if let Some(solids) = &self.solids {
                    solids.shade(carried);
                }
                spread(carried, kappa, h, spare)?;
            }
        }
        self.clear();
        Ok(())
    }

    /// Viscosity of the velocity for h seconds, with the sides as they are at time t.                    (gas.3)
    pub(super) fn friction(&mut self, t: f64, h: f64, report: &mut StepReport) -> Result<(), Failure> {
        let viscosity = Viscosity { nu: self.settings.viscosity / self.settings.density, method: self.settings.viscous };
        if viscosity.nu == 0.0 {
            return Ok(());
        }
        hold(&mut self.u, &self.settings.sides, t);
        viscosity.act(&mut self.u, self.solids.as_ref(), h, &mut self.solver.spare, report)
    }

    /// Makes the velocity at time t free of divergence, but for what fire swells; h [s] only scales the pressure that it takes.          (gas.4)
    pub fn projection(&mut self, t: f64, h: f64, report: &mut StepReport) -> Result<(), Failure> {
        self.weigh();
        let Self { u, pressure, solver, solids, settings, flame, densities, .. } = self;
        let projection = PressureProjection {
            u,
            pressure,
            solver,
            solids: solids.as_mut(),
            sides: &settings.sides,
            density: settings.density,
            light: densities.as_ref().map(|densities| &densities.light),
            swelling: flame.as_ref().filter(|flame| flame.fire.expansion > 0.0).map(|flame| &flame.swelling),
            params: settings.pressure,
            tolerance: settings.tolerance,
            on_failure: settings.on_failure,
        };
        projection.run(t, h, report)
    }

    /// Makes its bodies a part of the pressure's matrix.
    fn join(&mut self) {
        if let Some(solids) = &self.solids {
            self.solver.join(solids.joints(self.settings.density, |_| true));
        }
    }

    /// Takes the solids around it.
    pub fn take_surfaces(&mut self, colliders: &Arc<Vec<Collider>>) -> Result<(), Failure> {
        let others = self.solids.as_mut().is_some_and(|solids| solids.take_surfaces(colliders));
        if others { self.renew() } else { Ok(()) }
    }

    /// Takes the state of what it moves.
    pub fn listen(&mut self, exchange: &Exchange) {
        let grid = self.grid();
        let (gravity, density) = (self.settings.gravity, self.settings.density);
        self.bodies().iter_mut().for_each(|body| body.listen(exchange, gravity, density, &grid));
        self.join();
        self.sheets.iter_mut().for_each(|sheet| sheet.listen(exchange));
    }

    /// Gives what it moves what it has got.
    pub fn tell(&mut self, exchange: &mut Turn<'_>) {
        self.bodies().iter_mut().for_each(|body| body.tell(exchange));
        self.sheets.iter_mut().for_each(|sheet| sheet.tell(exchange));
    }

    /// Solids that it moves.
    pub(super) fn bodies(&mut self) -> &mut [Immersed] {
        self.solids.as_mut().map_or(&mut [], |solids| &mut solids.bodies)
    }

    /// The largest component of the velocity on any face [m/s]; bodies count by their speed.
    pub fn fastest(&self) -> f64 {
        projection::fastest(&self.u, self.solids.as_ref())
    }

    /// The largest step [s] of the Courant number, within `left` [s]: forces speed the fluid up on the way.
    pub fn courant_step(&self, left: f64) -> f64 {
        let settings = &self.settings;
        let most = |f: &Option<Field>, around: f64| {
            f.as_ref().map_or(0.0, |f| {
                let far = |x: &Real| (f64::from(*x) - around).abs();
                largest(f, |at, n| f.data[at..at + n].iter().map(far).fold(0.0, worse))
            })
        };
        let g = settings.gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
        let buoyancy = most(&self.smoke, 0.0) * (settings.weight / settings.density).abs()
            + most(&self.temperature, settings.ambient) * settings.expansion.abs();
        let speed = self.fastest();
        // v h + a h² = way
        let (way, a) = (settings.courant * self.grid().dx, g * buoyancy);
        let h = if speed > 0.0 || a > 0.0 { 2.0 * way / (speed + (speed * speed + 4.0 * a * way).sqrt()) } else { left };
        h.min(left)
    }
}

/// The same vectors in columns of `spare`.
pub(super) fn copy(u: &Vectors, spare: &mut Spare) -> Result<Vectors, GridError> {
    let one = |part: &Field| {
        let mut same = Field { sides: part.sides, ..spare.field(part.grid, part.place, part.unit.clone())? };
        same.data.copy_from_slice(&part.data);
        Ok(same)
    };
    Ok(Vectors { parts: u.parts.iter().map(one).collect::<Result<_, GridError>>()? })
}

/// The pressure solver around solids.
fn solver(grid: Grid, settings: &Settings, solids: Option<&Solids>) -> Result<Solver<u8>, Failure> {
    let lattice = grid.lattice();
    let sides = settings.sides.each_ref().map(|ends| ends.each_ref().map(Beyond::pressure));
    let solver = match solids {
        Some(solids) => Solver::new(lattice, sides, solids.open.each_ref().map(Vec::as_slice), None).map(|mut solver| {
            solver.join(solids.joints(settings.density, |_| true));
            solver
        }),
        None => Solver::empty(lattice, sides),
    };
    solver.map_err(Failure::Pressure)
}

/// Adds to a sum over cells, between the least and the largest of all values.                           (gas.22)
fn give_back(field: &mut Field, sum_lost: f64) {
    let range = |sign: f64| -> f64 {
        let most = |at: usize, n: usize| field.data[at..at + n].iter().map(|f| sign * f64::from(*f)).fold(f64::NEG_INFINITY, f64::max);
        sign * extreme(field, most)
    };
    let (low, high) = (range(-1.0), range(1.0));
    let weight = |f: Real| (f64::from(f) - low) * (high - f64::from(f));
    let all = sum(field, |at, n| field.data[at..at + n].iter().map(|f| weight(*f)).sum());
    let share = sum_lost / all;
    // More than that would lead beyond the range: nothing mixes there, or nothing is finite.
    if (share * (high - low)).abs() < 1.0 {
        each_row(field, |_, _, row| row.iter_mut().for_each(|f| *f = (f64::from(*f) + share * weight(*f)) as Real));
    }
}

/// A field that is carried, with what comes in through the sides of its box.
fn carried(mut field: Field, sides: &[[Beyond; 2]; 3], quantity: &str, ambient: f64) -> Field {
    field.sides = sides.each_ref().map(|ends| ends.each_ref().map(|side| side.carried(quantity, ambient)));
    field
}
