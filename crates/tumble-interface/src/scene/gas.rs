//! Gases and liquids that fill a box: Stable Fluids.

use super::{Animated, AnimatedVector, Component, GridBox, OnFailure, Shape};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An incompressible fluid that fills a box of cells, and advects smoke and heat.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gas {
    /// Name in frames and pictures.
    pub name: String,
    /// System that moves it. Default: the first of method `gas`.
    #[serde(default)]
    pub system: Option<String>,
    /// The cells.
    #[serde(rename = "box")]
    pub cells: GridBox,
    /// Boundary conditions of the box.
    #[serde(default)]
    pub sides: GasSides,
    /// Density of the fluid without smoke, at its ambient temperature.
    #[serde(default = "air")]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub fluid_density: f64,
    /// Effect of density differences.
    #[serde(default)]
    pub densities: Densities,
    /// Dynamic viscosity. Default: none but the numerical one of advection.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "Pa s"))]
    pub viscosity: Option<f64>,
    /// Time integration of viscosity.
    #[serde(default)]
    pub viscous: Viscous,
    /// Initial velocity; may be a formula of x, y, z.
    #[serde(default = "still")]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: AnimatedVector,
    /// Acceleration of the fluid; may be a formula of t, x, y, z. Gravity acts only through density differences.
    #[serde(default = "still")]
    #[schemars(extend("x-unit" = "m/s²"))]
    pub acceleration: AnimatedVector,
    /// Smoke advected by the fluid, column `density`.
    #[serde(default)]
    pub smoke: Option<Smoke>,
    /// Heat advected by the fluid, column `temperature`.
    #[serde(default)]
    pub temperature: Option<Temperature>,
    /// Fuel advected by the fluid, which burns where it is hot, column `fuel`; needs `temperature`.
    #[serde(default)]
    pub fire: Option<Fire>,
    /// Sources of smoke, heat, fuel and velocity.
    #[serde(default)]
    pub source: Vec<GasSource>,
    /// Boundary condition at colliders, which block the part of the box that they cover.
    #[serde(default)]
    pub solids: Solid,
    /// Objects that the fluid moves, and that move it: [[body]], by force and torque of the pressure; [[particles]] in a system of dynamics, whose
    /// masses are balls of their radius (in 2D: disks, a metre thick).
    #[serde(default)]
    pub bodies: Vec<String>,
    /// Objects immersed in the fluid: cloth and other surfaces, in 2D curves.
    #[serde(default)]
    pub sheet: Vec<GasSheet>,
    /// Vorticity confinement: restores small eddies that advection dissipates.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub confinement: f64,
    /// Order of the parts of a step.
    #[serde(default)]
    pub order: Order,
    /// Advection of velocities and scalars.
    #[serde(default)]
    pub advection: Advections,
    /// Pressure solver.
    #[serde(default)]
    pub pressure: Pressure,
    /// Cells that the fastest fluid crosses in a sub-step, if the system has neither `substeps` nor `step`.
    #[serde(default = "five")]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub courant: f64,
}

fn air() -> f64 {
    1.2
}

fn five() -> f64 {
    5.0
}

fn still() -> AnimatedVector {
    [0.0; 3].into()
}

/// A permeable surface of masses with a flow resistance, or a thread, in three dimensions a rope or hair: the fluid drags it along and is slowed by it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GasSheet {
    /// The object, in a system of dynamics.
    pub object: String,
    /// Pressure loss across it, in units of half the density times the square of the speed through it. A net has 1, a dense fabric 100; values above
    /// 2 over the Courant number of a sub-step act like that limit. Of a thread, its drag coefficient, on its length times its diameter, twice the radius.
    /// Default: 10, of a thread 1.2.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub resistance: Option<f64>,
    /// Friction along it, both faces together, in units of half the density times the square of the speed.
    #[serde(default = "hundredth")]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub friction: f64,
}

fn hundredth() -> f64 {
    0.01
}

/// The lower and the upper side of each axis; both or none are periodic.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GasSides {
    /// At low x and at high x.
    pub x: [GasSide; 2],
    /// At low y and at high y.
    pub y: [GasSide; 2],
    /// At low z and at high z.
    pub z: [GasSide; 2],
}

/// Boundary condition of a side of a box of fluid.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum GasSide {
    /// A wall along which the fluid slips.
    #[default]
    FreeSlip,
    /// A wall to which the fluid sticks.
    NoSlip,
    /// Open: in- and outflow at zero pressure. Inflow has no smoke and the ambient temperature.
    Open,
    /// Connected to the opposite side, which must be periodic, too.
    Periodic,
    /// A no-slip wall that moves within its plane.
    Wall {
        /// Velocity of the wall; its normal component must be zero.
        #[schemars(extend("x-unit" = "m/s"))]
        velocity: AnimatedVector,
    },
    /// Inflow with a given velocity (or outflow, where it points out of the box).
    Inflow {
        /// Velocity of the fluid there.
        #[schemars(extend("x-unit" = "m/s"))]
        velocity: AnimatedVector,
        /// Smoke density of the inflow.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "kg/m³"))]
        density: f64,
        /// Fuel density of the inflow.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "kg/m³"))]
        fuel: f64,
        /// Temperature of the inflow. Default: the ambient one.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "K"))]
        temperature: Option<f64>,
    },
}

/// Boundary condition at the surface of a collider.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Solid {
    /// The fluid slips along the surface.
    #[default]
    FreeSlip,
    /// The fluid sticks to the surface.
    NoSlip,
}

/// Effect of density differences. Density is fluid_density/(1 + temperature.expansion (T - ambient)) + smoke.weight times smoke.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Densities {
    /// Weight without inertia: for small differences.
    #[default]
    Boussinesq,
    /// Weight and inertia; the pressure equation is rebuilt in every step.
    Variable,
}

/// Time integration of viscosity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Viscous {
    /// Implicit Euler: stable for every step.
    #[default]
    Implicit,
    /// Explicit Euler, in as many sub-steps as stability needs.
    Explicit,
}

/// Smoke advected by a fluid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Smoke {
    /// Initial density, a number or a formula of x, y, z.
    #[schemars(extend("x-unit" = "kg/m³"))]
    pub initial: Component,
    /// Rate of decay: density falls as exp(-rate t).
    #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
    pub dissipation: f64,
    /// Diffusion coefficient.
    #[schemars(range(min = 0.0), extend("x-unit" = "m²/s"))]
    pub diffusivity: f64,
    /// Fraction of its weight that acts on the fluid; 0 is neutrally buoyant smoke.
    #[schemars(extend("x-unit" = "1"))]
    pub weight: f64,
}

impl Default for Smoke {
    fn default() -> Self {
        Self { initial: Component::Value(0.0), dissipation: 0.0, diffusivity: 0.0, weight: 1.0 }
    }
}

/// Heat advected by a fluid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Temperature {
    /// Temperature of neutral buoyancy.
    #[schemars(extend("x-unit" = "K", "exclusiveMinimum" = 0.0))]
    pub ambient: f64,
    /// Initial temperature, a number or a formula of x, y, z. Default: the ambient one.
    #[schemars(extend("x-unit" = "K"))]
    pub initial: Option<Component>,
    /// Rate of cooling: the difference from the ambient temperature falls as exp(-rate t).
    #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
    pub cooling: f64,
    /// Rate of radiative cooling at 1000 K above the ambient temperature; proportional to the fourth power of the difference.
    #[schemars(range(min = 0.0), extend("x-unit" = "K/s"))]
    pub radiation: f64,
    /// Diffusion coefficient.
    #[schemars(range(min = 0.0), extend("x-unit" = "m²/s"))]
    pub diffusivity: f64,
    /// Heat capacity of the fluid.
    #[schemars(extend("x-unit" = "J/(kg K)", "exclusiveMinimum" = 0.0))]
    pub specific_heat: f64,
    /// Thermal expansion coefficient. Default: that of an ideal gas, 1/ambient.
    #[schemars(extend("x-unit" = "1/K"))]
    pub expansion: Option<f64>,
}

impl Default for Temperature {
    fn default() -> Self {
        Self { ambient: 293.15, initial: None, cooling: 0.0, radiation: 0.0, diffusivity: 0.0, specific_heat: 1005.0, expansion: None }
    }
}

/// Fuel advected by a fluid. Where it is hot enough it burns: the fraction exp(-t/burn_time) is left after a time t.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Fire {
    /// Initial density of the fuel, a number or a formula of x, y, z.
    #[schemars(extend("x-unit" = "kg/m³"))]
    pub initial: Component,
    /// Ignition temperature.
    #[schemars(range(min = 0.0), extend("x-unit" = "K"))]
    pub ignition: f64,
    /// Time in which it burns down to 1/e.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0.0))]
    pub burn_time: f64,
    /// Heat of combustion: the fluid warms by fuel heat/(fluid_density specific_heat).
    #[schemars(range(min = 0.0), extend("x-unit" = "J/kg"))]
    pub heat: f64,
    /// Fraction that becomes smoke; needs `smoke`.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub soot: f64,
    /// Volume added per mass of fuel burnt: div u = expansion fuel/burn_time. The box needs an open side, or pressure.excess = "remove".
    #[schemars(range(min = 0.0), extend("x-unit" = "m³/kg"))]
    pub expansion: f64,
}

impl Default for Fire {
    fn default() -> Self {
        Self { initial: Component::Value(0.0), ignition: 600.0, burn_time: 0.3, heat: 4.5e7, soot: 0.0, expansion: 0.0 }
    }
}

/// A region that is a source of smoke, heat, fuel and velocity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GasSource {
    /// Shape of the region; not a mesh.
    pub shape: Shape,
    /// Smoke emitted.
    #[serde(default = "nothing")]
    #[schemars(extend("x-unit" = "kg/(m³ s)"))]
    pub smoke: Animated,
    /// Fixed smoke density; at least 0.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m³"))]
    pub density: Option<Animated>,
    /// Fixed temperature; at least 0.
    #[serde(default)]
    #[schemars(extend("x-unit" = "K"))]
    pub temperature: Option<Animated>,
    /// Heating rate.
    #[serde(default = "nothing")]
    #[schemars(extend("x-unit" = "K/s"))]
    pub heating: Animated,
    /// Fuel emitted; at least 0.
    #[serde(default = "nothing")]
    #[schemars(extend("x-unit" = "kg/(m³ s)"))]
    pub fuel: Animated,
    /// Fixed fuel density; at least 0.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m³"))]
    pub fuel_density: Option<Animated>,
    /// Fixed velocity, before the projection.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: Option<AnimatedVector>,
    /// Start time.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s"))]
    pub start: f64,
    /// End time. Default: never.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s"))]
    pub end: Option<f64>,
}

fn nothing() -> Animated {
    Animated::Value(0.0)
}

/// Order of the parts of a step. The first two are the same cycle with different starting points, of first order in the step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// Advection, forces, viscosity, projection: the result is divergence-free.
    #[default]
    ProjectLast,
    /// Forces, viscosity, projection, advection; one more projection at the end of each exchange.
    AdvectLast,
    /// Advection for half a step, twice what pressure, viscosity and forces change in the middle, advection, projection: of second order in the
    /// step, and close to conserving energy, at the cost of two steps. Needs implicit viscosity.
    Reflection,
}

/// Advection of velocities and scalars.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Advections {
    /// Advection of the velocity.
    pub velocity: Carriage,
    /// Advection of smoke, fuel and temperature.
    pub scalars: Carriage,
}

/// Semi-Lagrangian advection, by default: the value is that at the departure point.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Carriage {
    /// Interpolation between points.
    pub interpolation: GridInterpolation,
    /// Limited MacCormack correction: second order. Default: on for scalars, and for velocities with order = "reflection".
    pub corrected: Option<bool>,
    /// Backtracing scheme.
    pub trace: PathTrace,
    /// Sub-steps of the path. Default: one.
    #[schemars(range(min = 1, max = 1000))]
    pub pieces: Option<u32>,
    /// Vectors rotate with the fluid; for velocities only.
    pub turning: bool,
    /// Finite volumes with sharp limited fluxes through the faces instead of paths: keeps the sum over all cells and jumps, makes no new extrema; for
    /// scalars only.
    pub conservative: bool,
}

/// Interpolation between the points of a grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GridInterpolation {
    /// Bilinear or trilinear.
    #[default]
    Linear,
    /// Cubic through four points along each axis.
    Cubic,
    /// The same without new extrema.
    MonotoneCubic,
}

/// Scheme that traces the path of the fluid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PathTrace {
    /// One velocity, at the start of the path.
    Euler,
    /// The midpoint velocity.
    #[default]
    Rk2,
    /// Three velocities.
    Rk3,
}

/// Pressure solver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Pressure {
    /// The solver.
    pub method: PressureMethod,
    /// Largest residual divergence, times dx, relative to the fastest velocity before the projection. Default: 1e-5 (single), 1e-10 (double).
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub tolerance: Option<f64>,
    /// Maximum number of iterations.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub iterations: u32,
    /// Behaviour when the net flow into a closed region is not zero.
    pub excess: ExcessFlow,
    /// Behaviour when the tolerance is not met.
    pub on_failure: OnFailure,
}

impl Default for Pressure {
    fn default() -> Self {
        Self {
            method: PressureMethod::default(),
            tolerance: None,
            iterations: 1000,
            excess: ExcessFlow::default(),
            on_failure: OnFailure::Warn,
        }
    }
}

/// Solvers of the pressure equation, from the simplest to the fastest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PressureMethod {
    /// Jacobi iteration.
    Jacobi,
    /// Red-black Gauss-Seidel.
    GaussSeidel,
    /// Successive over-relaxation.
    Sor,
    /// Conjugate gradients.
    ConjugateGradients,
    /// Conjugate gradients with incomplete Cholesky, IC(0).
    IncompleteCholesky,
    /// Conjugate gradients with modified incomplete Cholesky, MIC(0).
    ModifiedIncompleteCholesky,
    /// Multigrid V-cycles alone.
    Multigrid,
    /// Conjugate gradients preconditioned by a V-cycle.
    #[default]
    MultigridGradients,
    /// The cosine transform, for closed boxes.
    Cosine,
}

/// Behaviour when the net flow into a closed region is not zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExcessFlow {
    /// The run ends with an error.
    #[default]
    Error,
    /// The mean divergence remains in the flow.
    Remove,
}
