//! Gases and liquids that fill a box: Stable Fluids.

use super::{AnimatedVector, Component, GridBox, OnFailure, Shape};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An incompressible fluid that fills a box of cells, with smoke and warmth that it carries.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gas {
    /// Name in frames and pictures.
    pub name: String,
    /// System that moves it; without it, the first of method `gas`.
    #[serde(default)]
    pub system: Option<String>,
    /// The cells.
    #[serde(rename = "box")]
    pub cells: GridBox,
    /// What is beyond the sides of the box.
    #[serde(default)]
    pub sides: GasSides,
    /// Density of the fluid without smoke, at its ambient temperature.
    #[serde(default = "air")]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub fluid_density: f64,
    /// What differences of density do.
    #[serde(default)]
    pub densities: Densities,
    /// Dynamic viscosity; without it, none but that of the advection.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "Pa s"))]
    pub viscosity: Option<f64>,
    /// How viscosity is stepped.
    #[serde(default)]
    pub viscous: Viscous,
    /// Velocity at the start; a formula may use x, y, z.
    #[serde(default = "still")]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: AnimatedVector,
    /// Acceleration of the fluid everywhere; a formula may use t, x, y, z. Gravity acts through differences of density alone.
    #[serde(default = "still")]
    #[schemars(extend("x-unit" = "m/s²"))]
    pub acceleration: AnimatedVector,
    /// Smoke that the fluid carries, column `density`.
    #[serde(default)]
    pub smoke: Option<Smoke>,
    /// Warmth that the fluid carries, column `temperature`.
    #[serde(default)]
    pub temperature: Option<Temperature>,
    /// Fuel that the fluid carries and that burns where it is hot, column `fuel`; needs `temperature`.
    #[serde(default)]
    pub fire: Option<Fire>,
    /// Where smoke, warmth, fuel and velocity come from.
    #[serde(default)]
    pub source: Vec<GasSource>,
    /// What the fluid does at colliders: each fills what it covers of the box.
    #[serde(default)]
    pub solids: Solid,
    /// Objects of [[particles]] in a system of dynamics whose masses are balls of their radius (in the plane: disks, a metre thick)
    /// that the fluid moves and that move it.
    #[serde(default)]
    pub bodies: Vec<String>,
    /// Objects that hang in the fluid: cloth and other surfaces, in the plane curves.
    #[serde(default)]
    pub sheet: Vec<GasSheet>,
    /// Vorticity confinement: gives small eddies back what advection takes from them.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub confinement: f64,
    /// Order of the four parts of a step.
    #[serde(default)]
    pub order: Order,
    /// How velocities and scalars are carried.
    #[serde(default)]
    pub advection: Advections,
    /// How the pressure is found.
    #[serde(default)]
    pub pressure: Pressure,
    /// Cells that the fastest fluid passes in a sub-step, where the system has neither `substeps` nor `step`.
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

/// A surface of masses that lets the fluid through, against a resistance: it is blown along, and the fluid is held back.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GasSheet {
    /// The object, in a system of dynamics.
    pub object: String,
    /// Loss of pressure across it, over half the density times the square of the speed through it. A net has 1, a dense fabric 100; what
    /// is above 2 over the Courant number of a sub-step acts like that.
    #[serde(default = "ten")]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub resistance: f64,
    /// Friction along it, both faces together, over half the density times the square of the speed.
    #[serde(default = "hundredth")]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub friction: f64,
}

fn ten() -> f64 {
    10.0
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

/// What is beyond a side of a box of fluid.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum GasSide {
    /// A wall along which the fluid slips.
    #[default]
    FreeSlip,
    /// A wall to which the fluid sticks.
    NoSlip,
    /// Nothing: the fluid comes and goes, at pressure zero. What comes in has no smoke and the ambient temperature.
    Open,
    /// The opposite side, which must say the same.
    Periodic,
    /// A wall to which the fluid sticks, and which moves along itself.
    Wall {
        /// Velocity of the wall; its part across the wall must be zero.
        #[schemars(extend("x-unit" = "m/s"))]
        velocity: AnimatedVector,
    },
    /// Fluid comes in with this velocity (or leaves, where it points out of the box).
    Inflow {
        /// Velocity of the fluid there.
        #[schemars(extend("x-unit" = "m/s"))]
        velocity: AnimatedVector,
        /// Density of the smoke that comes in.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "kg/m³"))]
        density: f64,
        /// Density of the fuel that comes in.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "kg/m³"))]
        fuel: f64,
        /// Temperature of what comes in; without it, the ambient one.
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("x-unit" = "K"))]
        temperature: Option<f64>,
    },
}

/// What a fluid does at the surface of a collider.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Solid {
    /// It slips along the surface.
    #[default]
    FreeSlip,
    /// It sticks to the surface.
    NoSlip,
}

/// What differences of density do. Density is fluid_density/(1 + temperature.expansion (T - ambient)) + smoke.weight times smoke.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Densities {
    /// They push, but have no inertia: for small ones.
    #[default]
    Boussinesq,
    /// They push and have inertia; every step has a pressure equation of its own.
    Variable,
}

/// How viscosity is stepped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Viscous {
    /// Implicit Euler: stable for every step.
    #[default]
    Implicit,
    /// Explicit Euler, in as many parts as its limit asks for.
    Explicit,
}

/// Smoke that a fluid carries.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Smoke {
    /// Density at the start, a number or a formula of x, y, z.
    #[schemars(extend("x-unit" = "kg/m³"))]
    pub initial: Component,
    /// Share that vanishes in a second: density falls as exp(-rate t).
    #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
    pub dissipation: f64,
    /// How fast it spreads by itself.
    #[schemars(range(min = 0.0), extend("x-unit" = "m²/s"))]
    pub diffusivity: f64,
    /// Share of its own weight that pulls the fluid down; 0 is smoke as light as the fluid.
    #[schemars(extend("x-unit" = "1"))]
    pub weight: f64,
}

impl Default for Smoke {
    fn default() -> Self {
        Self { initial: Component::Value(0.0), dissipation: 0.0, diffusivity: 0.0, weight: 1.0 }
    }
}

/// Warmth that a fluid carries.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Temperature {
    /// Temperature at which the fluid neither rises nor sinks.
    #[schemars(extend("x-unit" = "K", "exclusiveMinimum" = 0.0))]
    pub ambient: f64,
    /// Temperature at the start, a number or a formula of x, y, z; without it, the ambient one.
    #[schemars(extend("x-unit" = "K"))]
    pub initial: Option<Component>,
    /// How fast it falls back to the ambient one: the difference falls as exp(-rate t).
    #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
    pub cooling: f64,
    /// How fast heat radiates away where the fluid is 1000 K above the ambient temperature; by the fourth power of the difference.
    #[schemars(range(min = 0.0), extend("x-unit" = "K/s"))]
    pub radiation: f64,
    /// How fast it spreads by itself.
    #[schemars(range(min = 0.0), extend("x-unit" = "m²/s"))]
    pub diffusivity: f64,
    /// Heat capacity of the fluid.
    #[schemars(extend("x-unit" = "J/(kg K)", "exclusiveMinimum" = 0.0))]
    pub specific_heat: f64,
    /// Share by which a volume grows per kelvin; without it, that of an ideal gas, 1/ambient.
    #[schemars(extend("x-unit" = "1/K"))]
    pub expansion: Option<f64>,
}

impl Default for Temperature {
    fn default() -> Self {
        Self { ambient: 293.15, initial: None, cooling: 0.0, radiation: 0.0, diffusivity: 0.0, specific_heat: 1005.0, expansion: None }
    }
}

/// Fuel that a fluid carries. Where it is hot enough it burns: a share exp(-t/burn_time) is left after a time t.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Fire {
    /// Density of the fuel at the start, a number or a formula of x, y, z.
    #[schemars(extend("x-unit" = "kg/m³"))]
    pub initial: Component,
    /// Temperature above which it burns.
    #[schemars(range(min = 0.0), extend("x-unit" = "K"))]
    pub ignition: f64,
    /// Time in which it burns down to 1/e of itself.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0.0))]
    pub burn_time: f64,
    /// Heat that it gives off: the fluid warms by fuel heat/(fluid_density specific_heat).
    #[schemars(range(min = 0.0), extend("x-unit" = "J/kg"))]
    pub heat: f64,
    /// Share of it that becomes smoke; needs `smoke`.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub soot: f64,
    /// Volume by which the fluid grows: div u = expansion fuel/burn_time. The box needs an open side, or
    /// pressure.excess = "remove".
    #[schemars(range(min = 0.0), extend("x-unit" = "m³/kg"))]
    pub expansion: f64,
}

impl Default for Fire {
    fn default() -> Self {
        Self { initial: Component::Value(0.0), ignition: 600.0, burn_time: 0.3, heat: 4.5e7, soot: 0.0, expansion: 0.0 }
    }
}

/// A region that gives smoke, warmth, fuel and velocity to the fluid in it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GasSource {
    /// Where; not a mesh.
    pub shape: Shape,
    /// Smoke that it gives off.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/(m³ s)"))]
    pub smoke: f64,
    /// Smoke density that it holds there.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "kg/m³"))]
    pub density: Option<f64>,
    /// Temperature that it holds there.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "K"))]
    pub temperature: Option<f64>,
    /// Warming of the fluid there.
    #[serde(default)]
    #[schemars(extend("x-unit" = "K/s"))]
    pub heating: f64,
    /// Fuel that it gives off.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "kg/(m³ s)"))]
    pub fuel: f64,
    /// Fuel density that it holds there.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "kg/m³"))]
    pub fuel_density: Option<f64>,
    /// Velocity that it gives the fluid there, before the projection.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: Option<AnimatedVector>,
    /// When it begins.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s"))]
    pub start: f64,
    /// When it ends; without it, never.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s"))]
    pub end: Option<f64>,
}

/// Order of the four parts of a step. Both go through the same circle; they differ in where a step begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// Advection, forces, viscosity, projection: what leaves is free of divergence.
    #[default]
    ProjectLast,
    /// Forces, viscosity, projection, advection; at the end of each exchange one more projection.
    AdvectLast,
}

/// How velocities and scalars are carried.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Advections {
    /// How the velocity carries itself.
    pub velocity: Carriage,
    /// How smoke and warmth are carried.
    pub scalars: Carriage,
}

/// How something is carried: semi-Lagrangian, the value is that from where the fluid came.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Carriage {
    /// Values between points.
    pub interpolation: GridInterpolation,
    /// MacCormack's correction, limited: second order. Without the word, smoke and warmth have it and velocities do not.
    pub corrected: Option<bool>,
    /// How the path back is traced.
    pub trace: PathTrace,
    /// Pieces that the path is cut into; without it, one.
    #[schemars(range(min = 1, max = 1000))]
    pub pieces: Option<u32>,
    /// Vectors turn with the fluid; for velocities alone.
    pub turning: bool,
}

/// Values between the points of a grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GridInterpolation {
    /// Bilinear or trilinear.
    #[default]
    Linear,
    /// Through four points along each axis.
    Cubic,
    /// The same without new extrema.
    MonotoneCubic,
}

/// How the path of the fluid is traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PathTrace {
    /// One velocity, that at the start.
    Euler,
    /// The velocity in the middle.
    #[default]
    Rk2,
    /// Three velocities.
    Rk3,
}

/// How the pressure is found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Pressure {
    /// The solver.
    pub method: PressureMethod,
    /// Largest divergence that may be left, times dx, over the fastest velocity before the projection. Default 1e-5 (single),
    /// 1e-10 (double).
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub tolerance: Option<f64>,
    /// Iterations at most.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub iterations: u32,
    /// What happens when more flows into a closed space than out of it.
    pub excess: ExcessFlow,
    /// What happens when the tolerance is not met.
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
    /// Every cell from its neighbours of before.
    Jacobi,
    /// Red cells, then black ones.
    GaussSeidel,
    /// Successive over-relaxation.
    Sor,
    /// Conjugate gradients.
    ConjugateGradients,
    /// With incomplete Cholesky factors.
    IncompleteCholesky,
    /// With modified incomplete Cholesky factors, MIC(0).
    ModifiedIncompleteCholesky,
    /// V-cycles alone.
    Multigrid,
    /// Conjugate gradients with a V-cycle before each step.
    #[default]
    MultigridGradients,
    /// The cosine transform, for closed boxes.
    Cosine,
}

/// What happens when more flows into a closed space than out of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExcessFlow {
    /// The run ends with an error.
    #[default]
    Error,
    /// The mean of the divergence is left in the flow.
    Remove,
}
