//! The bad solver: a gas whose pressure follows from its density, all explicit.
//!
//! ```text
//!   p = c² (rho - rho0)                                                                      (compressible.1)
//!   u* = u + h (g + (mu lap u - grad p)/rho),   u' = u* - h (u* . grad) u*                     (compressible.2)
//!   rho' = rho - h div(rho u')                                                                (compressible.4)
//! ```
//!
//! Sound limits the step, c h sqrt(d)/dx <= 1 (compressible.6), and so do flow and friction: (compressible.5), (compressible.8).
//! Verified by crates/tumble-f64/tests/compressible.rs.

use crate::exchange::Turn;
use crate::forces::Gravity;
use crate::integrators::equal_steps;
use crate::math::functions::{cos, ln, sin};
use crate::math::{Real, bisect};
use crate::operators::{average, curl, divergence, gradient, upwind, vector_laplacian};
use crate::state::{Field, Grid, GridError, Place, Side, Vectors};
use crate::system::{Archive, System};
use tumble_interface::engine::{BLOW_UP, Ledger, Limit, Share, Stability, StepReport};
use tumble_interface::error::Breakdown;
use tumble_interface::scene::Integrator;
use tumble_interface::{Column, StepError};

/// Part of the longest stable step that is taken where the scene names none.
pub const SAFE: f64 = 0.7;

/// Properties of a gas.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fluid {
    /// Speed of sound [m/s].
    pub sound_speed: f64,
    /// Density without pressure [kg/m³].
    pub density: f64,
    /// Dynamic viscosity [Pa s].
    pub viscosity: f64,
    /// Acceleration [m/s²].
    pub gravity: [f64; 3],
}

/// Rates that limit the steps of a uniform flow of such a gas [1/s].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rates {
    /// c/dx.
    pub sound: f64,
    /// mu/(rho dx²).
    pub friction: f64,
    /// |u|/dx of each axis.
    pub flow: [f64; 3],
    /// Wave numbers that are looked at along each axis, 2 pi i/(waves dx); 1 where nothing changes.
    pub waves: [usize; 3],
}

impl Rates {
    /// The factor by which the wave with the phases q dx grows most in a step h [s].                    (compressible.8)
    fn growth(&self, h: f64, phases: [&Phase; 3]) -> f64 {
        let (mut real, mut imaginary, mut squares) = (1.0, 0.0, 0.0);
        for (phase, flow) in phases.iter().zip(&self.flow) {
            real -= h * flow * (1.0 - phase.cos);
            imaginary -= h * flow * phase.sin;
            squares += 0.5 * (1.0 - phase.cos);
        }
        let carried = (real * real + imaginary * imaginary).sqrt();
        let kept = 1.0 - 4.0 * h * self.friction * squares;
        // Roots of z² - 2 trace z + kept; velocities across the wave are multiplied by `kept` alone.
        let trace = 0.5 * (1.0 + kept) - 2.0 * h * h * self.sound * self.sound * squares;
        let under = trace * trace - kept;
        carried * if under > 0.0 { trace.abs() + under.sqrt() } else { kept.abs().sqrt() }.max(kept.abs())
    }

    /// The longest step at which no wave grows [s].                                                     (compressible.5)
    pub fn limit(&self) -> f64 {
        let d = self.waves.iter().filter(|n| **n > 1).count() as f64;
        let (sound, friction) = (self.sound * d.sqrt(), 2.0 * d * self.friction);
        let flow: f64 = self.flow.iter().sum();
        let carried = 1.0 / flow;
        // At rest: the positive root of (sound h)² + friction h = 1.
        let rest = 2.0 / (friction + (friction * friction + 4.0 * sound * sound).sqrt());
        if !(flow > 0.0 && rest < carried) {
            return if flow > 0.0 { carried } else { rest };
        }
        // The flow damps, and so allows longer steps.
        let [x, y, z] = self.waves.map(|n| (0..n).map(|i| Phase::new(i, n)).collect::<Vec<_>>());
        let grows = |h: f64, wave: [&Phase; 3]| self.growth(h, wave) > 1.0 + 1e-9;
        let fine = |h: f64| !x.iter().any(|x| y.iter().any(|y| z.iter().any(|z| grows(h, [x, y, z]))));
        let mut low = rest;
        while low < carried {
            let high = (1.02 * low).min(carried);
            if !fine(high) {
                return bisect((low, high), 10, fine).0;
            }
            low = high;
        }
        carried
    }
}

/// The phase of a wave between two cells.
struct Phase {
    sin: f64,
    cos: f64,
}

impl Phase {
    fn new(i: usize, n: usize) -> Self {
        let angle = 2.0 * std::f64::consts::PI * i as f64 / n as f64;
        Self { sin: sin(angle), cos: cos(angle) }
    }
}

/// A gas in a box with walls or joined sides.
#[derive(Debug, Clone)]
pub struct Gas {
    name: String,
    fluid: Fluid,
    /// Density [kg/m³] at cells.
    pub density: Field,
    /// Velocity [m/s] on faces.
    pub velocity: Vectors,
    pressure: Field,
    slope: Vectors,
    friction: Vectors,
    carried: Field,
    /// Energy against which growth is measured [J].
    scale: f64,
}

impl Gas {
    /// A gas; velocities across walls are set to zero.
    pub fn new(name: String, fluid: Fluid, density: Field, mut velocity: Vectors) -> Result<Self, GridError> {
        let grid = velocity.on_faces("velocity of a gas")?;
        density.expect(&grid, Place::Cell, "density of a gas")?;
        for (axis, part) in grid.axes().zip(&mut velocity.parts) {
            // Walls stop what goes through them and let slide what goes along them.
            part.sides[axis] = [Side::Value(0.0); 2];
        }
        let mut gas = Self {
            name,
            fluid,
            pressure: Field::new(grid, Place::Cell, "Pa")?,
            slope: Vectors::faces(grid, "Pa/m")?,
            friction: Vectors::faces(grid, "1/(m s)")?,
            carried: Field::new(grid, Place::Cell, "kg/(m³ s)")?,
            density,
            velocity,
            scale: 0.0,
        };
        gas.hold_walls();
        Ok(gas)
    }

    /// The grid.
    pub fn grid(&self) -> Grid {
        self.density.grid
    }

    /// Nothing goes through walls.
    fn hold_walls(&mut self) {
        let grid = self.grid();
        for (axis, part) in grid.axes().zip(&mut self.velocity.parts).filter(|(axis, _)| !grid.periodic[*axis]) {
            for at in part.each().filter(|at| at[axis] == 0 || at[axis] == grid.n[axis]) {
                let i = part.index(at);
                part.data[i] = 0.0;
            }
        }
    }

    fn find_pressure(&mut self) {
        let (c2, rho0) = ((self.fluid.sound_speed * self.fluid.sound_speed) as Real, self.fluid.density as Real);
        for (p, rho) in self.pressure.data.iter_mut().zip(&self.density.data) {
            *p = c2 * (*rho - rho0);
        }
    }

    /// One step h [s], of whatever length.
    pub fn step(&mut self, h: f64) -> Result<(), GridError> {
        let grid = self.grid();
        self.find_pressure();
        gradient(&self.pressure, &mut self.slope)?;
        if self.fluid.viscosity > 0.0 {
            vector_laplacian(&self.velocity, &mut self.friction)?;
        }
        let (mu, step) = (self.fluid.viscosity as Real, h as Real);
        for (c, axis) in grid.axes().enumerate() {
            let part = &mut self.velocity.parts[c];
            let rho = average(&self.density, part.place)?;
            let g = self.fluid.gravity[axis] as Real;
            for (i, u) in part.data.iter_mut().enumerate().filter(|(i, _)| rho.data[*i] > 0.0) {
                let force = mu * self.friction.parts[c].data[i] - self.slope.parts[c].data[i];
                *u += step * (g + force / rho.data[i]);
            }
        }
        self.hold_walls();
        // Advects the accelerated velocities, not the previous ones: advected sound would grow.
        let carried: Result<Vec<Field>, GridError> = self
            .velocity
            .parts
            .iter()
            .map(|part| {
                let mut carried = Field::new(grid, part.place, "m/s²")?;
                upwind(&self.velocity, part, &mut carried)?;
                Ok(carried)
            })
            .collect();
        for (part, carried) in self.velocity.parts.iter_mut().zip(carried?) {
            for (u, carried) in part.data.iter_mut().zip(&carried.data) {
                *u -= step * carried;
            }
        }
        self.hold_walls();
        // Mass per area and time, with the density of where it comes from.
        for (c, axis) in grid.axes().enumerate() {
            let (u, flow, rho) = (&self.velocity.parts[c], &mut self.slope.parts[c], &self.density);
            for at in u.each() {
                let i = u.index(at);
                let speed = u.data[i];
                let mut from = at;
                if speed > 0.0 {
                    from[axis] = if at[axis] > 0 { at[axis] - 1 } else { grid.n[axis] - 1 };
                } else if at[axis] == grid.n[axis] {
                    from[axis] = grid.n[axis] - 1;
                }
                flow.data[i] = if speed == 0.0 { 0.0 } else { speed * rho.value(from) };
            }
        }
        divergence(&self.slope, &mut self.carried)?;
        for at in self.carried.each() {
            let i = self.carried.index(at);
            self.density.data[i] -= step * self.carried.data[i];
        }
        Ok(())
    }

    /// The smallest and the largest |u| of each axis [m/s]; a NaN is the largest.
    fn speeds(&self) -> Vec<[f64; 2]> {
        let worse = |a: f64, b: f64| if a >= b || a.is_nan() { a } else { b };
        let both = |[least, most]: [f64; 2], u: f64| [least.min(u), worse(most, u)];
        let each = |part: &Field| part.each().map(|at| f64::from(part.value(at).abs())).fold([f64::INFINITY, 0.0], both);
        self.velocity.parts.iter().map(each).collect()
    }

    /// The longest step [s] that does not grow, now: that of the fastest flow or that of the slowest.
    pub fn limit(&self) -> f64 {
        let (grid, speeds) = (self.grid(), self.speeds());
        let least = self.density.each().map(|at| f64::from(self.density.value(at))).fold(self.fluid.density, f64::min);
        let of = |which: usize| {
            let mut rates = Rates {
                sound: self.fluid.sound_speed / grid.dx,
                friction: self.fluid.viscosity / least.max(f64::MIN_POSITIVE) / (grid.dx * grid.dx),
                flow: [0.0; 3],
                waves: [1; 3],
            };
            for (axis, speed) in grid.axes().zip(&speeds).filter(|(axis, _)| grid.n[*axis] > 1) {
                rates.flow[axis] = speed[which] / grid.dx;
                // A longer wave grows less, and 16 along an axis are close enough to each other.
                rates.waves[axis] = grid.n[axis].next_multiple_of(2).min(16);
            }
            rates.limit()
        };
        of(0).min(of(1))
    }

    /// Mass, momentum, kinetic energy, and that of pressure and of gravity [m/s²]; in a plane for a metre across it.
    fn ledger(&self, t: f64, gravity: [f64; 3]) -> Ledger {
        let grid = self.grid();
        let volume = grid.dx.powi(grid.dimension() as i32);
        let (c2, rho0) = (self.fluid.sound_speed * self.fluid.sound_speed, self.fluid.density);
        let mut ledger = Ledger { time: t, ..Ledger::default() };
        for at in self.density.each() {
            let rho = f64::from(self.density.value(at));
            ledger.mass += volume * rho;
            ledger.elastic += volume * c2 * (rho * ln(rho / rho0) - (rho - rho0));
            ledger.external -= volume * rho * (0..3).map(|a| gravity[a] * grid.point(Place::Cell, at)[a]).sum::<f64>();
        }
        for (axis, part) in grid.axes().zip(&self.velocity.parts) {
            for at in part.each() {
                // Faces on walls stand still; all others lie between two cells.
                let mut below = at;
                below[axis] = if at[axis] > 0 { at[axis] - 1 } else { grid.n[axis] - 1 };
                let mut above = at;
                above[axis] = at[axis].min(grid.n[axis] - 1);
                let u = f64::from(part.value(at));
                if u != 0.0 {
                    let mass = 0.5 * volume * f64::from(self.density.value(below) + self.density.value(above));
                    ledger.momentum[axis] += mass * u;
                    ledger.kinetic += 0.5 * mass * u * u;
                }
            }
        }
        ledger.speed = Some(self.speeds().iter().map(|s| s[1] * s[1]).sum::<f64>().sqrt());
        ledger
    }

    /// The failure: column, cell, and growth of the energy.
    fn fault(&self) -> Option<(&'static str, [usize; 3], Option<f64>)> {
        let points = self.density.points();
        let good = |rho: Real| rho.is_finite() && rho > 0.0;
        if let Some(at) = self.density.each().find(|at| !good(self.density.value(*at))) {
            return Some(("density", at, None));
        }
        for part in &self.velocity.parts {
            if let Some(at) = part.each().find(|at| !part.value(*at).is_finite()) {
                return Some(("velocity", std::array::from_fn(|a| at[a].min(points[a] - 1)), None));
            }
        }
        let ledger = self.ledger(0.0, self.fluid.gravity);
        let ratio = (ledger.kinetic + ledger.elastic) / self.scale;
        if self.scale > 0.0 && ratio > BLOW_UP {
            let (mut worst, mut most) = ([0; 3], 0.0);
            for at in self.density.each() {
                let off = (f64::from(self.density.value(at)) - self.fluid.density).abs();
                if off > most {
                    (worst, most) = (at, off);
                }
            }
            return Some(("density", worst, Some(ratio)));
        }
        None
    }
}

/// How the system steps.
#[derive(Debug, Clone, Default)]
pub struct Settings {
    /// Name in the scene.
    pub name: String,
    /// Gravity.
    pub gravity: Gravity,
    /// Sub-steps of an interval.
    pub substeps: Option<u32>,
    /// Longest sub-step [s].
    pub step: Option<f64>,
}

/// Gases that sound runs through.
pub struct Compressible {
    settings: Settings,
    gases: Vec<Gas>,
    watched: bool,
    /// Whether an explosion is no breakdown.
    tolerant: bool,
}

impl Compressible {
    /// A system of gases.
    pub fn new(settings: Settings, mut gases: Vec<Gas>) -> Self {
        for gas in &mut gases {
            let ledger = gas.ledger(0.0, settings.gravity.at(0.0));
            // Gravity may set all of it going: as much as the fall of its mass through the box.
            let grid = gas.grid();
            let fall = match settings.gravity.course.is_constant() {
                true => ledger.mass * (0..3).map(|a| gas.fluid.gravity[a].abs() * grid.n[a] as f64 * grid.dx).sum::<f64>(),
                false => ledger.mass * settings.gravity.largest * grid.axes().map(|a| grid.n[a] as f64 * grid.dx).sum::<f64>(),
            };
            gas.scale = ledger.kinetic + ledger.elastic + fall;
        }
        Self { settings, gases, watched: false, tolerant: false }
    }

    fn limit(&self) -> f64 {
        self.gases.iter().map(Gas::limit).fold(f64::INFINITY, f64::min)
    }

    fn steps(&self, dt: f64) -> f64 {
        match (self.settings.substeps, self.settings.step) {
            (Some(n), _) => f64::from(n),
            (None, Some(step)) => equal_steps(dt, step),
            (None, None) => equal_steps(dt, SAFE * self.limit()),
        }
    }

    fn broken(&self, t: f64, h: f64) -> Option<StepError> {
        self.gases.iter().find_map(|gas| {
            let (column, cell, energy_ratio) = gas.fault().filter(|(.., ratio)| ratio.is_none() || !self.tolerant)?;
            let points = gas.density.points();
            let about = Box::new(Breakdown {
                system: self.settings.name.clone(),
                object: gas.name.clone(),
                column: column.into(),
                index: cell[0] + points[0] * (cell[1] + points[1] * cell[2]),
                id: None,
                cell: Some((cell, gas.grid().point(Place::Cell, cell))),
                time: t,
                integrator: Integrator::SymplecticEuler.name().into(),
                step: h,
                stable_step: gas.limit(),
                energy_ratio,
                cause: None,
            });
            Some(if energy_ratio.is_some() { StepError::Exploded(about) } else { StepError::NotFinite(about) })
        })
    }
}

impl System for Compressible {
    fn name(&self) -> &str {
        &self.settings.name
    }

    fn absorb(&mut self, _exchange: &mut Turn<'_>) {}

    fn advance(&mut self, t: f64, dt: f64, _exchange: &mut Turn<'_>, go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError> {
        let mut report = StepReport::default();
        let n = self.steps(dt);
        if n.is_nan() || n > 1e7 {
            return Err(StepError::StepTooSmall { system: self.settings.name.clone(), time: t, step: dt / n });
        }
        let h = dt / n;
        for i in 0..n as u64 {
            if !go_on() {
                break;
            }
            for gas in &mut self.gases {
                gas.fluid.gravity = self.settings.gravity.at(t + (i as f64 + 0.5) * h);
                gas.step(h).map_err(|e| StepError::User(e.to_string()))?;
            }
            report.stepped(h);
            if self.watched
                && let Some(error) = self.broken(t + (i + 1) as f64 * h, h)
            {
                return Err(error);
            }
        }
        Ok(report)
    }

    fn publish(&mut self, _t: f64, _exchange: &mut Turn<'_>) {}

    fn columns(&self, _t: f64, names: &[&str], out: &mut Vec<Column>) {
        for gas in &self.gases {
            let grid = gas.grid();
            for name in names {
                let found: Result<Option<Vec<Field>>, GridError> = (|| {
                    Ok(Some(match *name {
                        "density" => vec![gas.density.clone()],
                        "pressure" => {
                            let mut gas = gas.clone();
                            gas.find_pressure();
                            vec![gas.pressure]
                        }
                        "velocity" => {
                            let parts = gas.velocity.parts.iter().map(|part| average(part, Place::Cell));
                            parts.collect::<Result<_, _>>()?
                        }
                        "velocity_x" | "velocity_y" | "velocity_z" => {
                            let axis = ["velocity_x", "velocity_y", "velocity_z"].iter().position(|n| n == name).unwrap_or(0);
                            let Some(part) = gas.velocity.part(axis) else { return Ok(None) };
                            vec![part.clone()]
                        }
                        "vorticity" => {
                            let mut turn = Vectors::edges(grid, "1/s")?;
                            curl(&gas.velocity, &mut turn)?;
                            turn.parts.iter().map(|part| average(part, Place::Cell)).collect::<Result<_, _>>()?
                        }
                        "divergence" => {
                            let mut sum = Field::new(grid, Place::Cell, "1/s")?;
                            divergence(&gas.velocity, &mut sum)?;
                            vec![sum]
                        }
                        _ => return Ok(None),
                    }))
                })();
                let Ok(Some(parts)) = found else { continue };
                let Some(first) = parts.first() else { continue };
                let points = first.points();
                let data: Vec<Real> = first.each().flat_map(|at| parts.iter().map(move |part| part.value(at))).collect();
                let points = grid.axes().map(|a| points[a]).collect();
                out.push(Column::on_grid(&gas.name, name, points, data));
            }
        }
    }

    fn topology(&self, out: &mut Vec<Column>) {
        for gas in &self.gases {
            out.extend(gas.grid().columns(&gas.name));
        }
    }

    fn ledger(&self, t: f64) -> Ledger {
        let mut total = Ledger { time: t, ..Ledger::default() };
        self.gases.iter().for_each(|gas| total.add_system(&gas.ledger(t, self.settings.gravity.at(t))));
        total
    }

    fn shares(&self, t: f64) -> Vec<Share> {
        let share = |gas: &Gas| Share {
            system: self.settings.name.clone(),
            object: gas.name.clone(),
            ledger: gas.ledger(t, self.settings.gravity.at(t)),
        };
        self.gases.iter().map(share).collect()
    }

    fn breakdown(&mut self, t: f64) -> Option<StepError> {
        self.broken(t, 0.0)
    }

    fn watch(&mut self, on: bool) {
        self.watched = on;
    }

    fn tolerate_explosions(&mut self, on: bool) {
        self.tolerant = on;
    }

    fn stability(&mut self, dt: f64, _go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability> {
        let stiffest = self.gases.iter().min_by(|a, b| a.limit().total_cmp(&b.limit()))?;
        let (grid, stable) = (stiffest.grid(), stiffest.limit());
        let d = grid.axes().filter(|a| grid.n[*a] > 1).count() as f64;
        let damping = 4.0 * d * stiffest.fluid.viscosity / stiffest.fluid.density / (grid.dx * grid.dx);
        Some(Stability {
            system: self.settings.name.clone(),
            integrator: Integrator::SymplecticEuler,
            step: dt / self.steps(dt),
            frequency: 2.0 * stiffest.fluid.sound_speed * d.sqrt() / grid.dx,
            damping,
            damping_max: damping,
            culprit: None,
            limits: vec![Limit { integrator: Integrator::SymplecticEuler, stable, usable: stable }],
        })
    }

    fn save(&self, archive: &mut Archive) {
        for gas in &self.gases {
            archive.push_field("density", &gas.density);
            gas.velocity.parts.iter().for_each(|part| archive.push_field("velocity", part));
        }
    }

    fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        for gas in &mut self.gases {
            archive.field("density", &mut gas.density)?;
            gas.velocity.parts.iter_mut().try_for_each(|part| archive.field("velocity", part))?;
        }
        Some(())
    }

    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool> {
        let gas = self.gases.iter_mut().find(|gas| gas.name == object)?;
        let values: Vec<Real> = values.iter().map(|v| *v as Real).collect();
        Some(column == "density" && gas.density.set(&values).is_ok())
    }
}
