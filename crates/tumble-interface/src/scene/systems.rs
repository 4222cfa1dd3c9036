//! Numerical methods and their settings.

use super::crowd::Walking;
use super::grains::Granular;
use super::rigid::Rigid;
use super::vicsek::Vicsek;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A numerical method and its time stepping.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct System {
    /// Name; objects refer to it with `system = "..."`.
    #[serde(default = "main")]
    pub name: String,
    /// Method.
    #[serde(default)]
    pub method: Method,
    /// Integrator of y' = f(y, t).
    #[serde(default)]
    pub integrator: Integrator,
    /// Sub-steps per exchange. Without `substeps` and `step`, explicit integrators use 0.7 of their estimated usable step, implicit ones take one
    /// sub-step, and position_based ones sub-steps of at most 1 ms.
    #[serde(default)]
    #[schemars(range(min = 1, max = 10_000_000))]
    pub substeps: Option<u32>,
    /// Largest sub-step; the exchange interval is divided into equal sub-steps no longer than this.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0.0))]
    pub step: Option<f64>,
    /// Settings of `adaptive_euler` and `dormand_prince`.
    #[serde(default)]
    pub adaptive: Adaptive,
    /// Springs longer than this multiple of their rest length are shortened to it after each step (`modified_euler` and `verlet`), or in each
    /// iteration (`position_based`).
    #[serde(default)]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 1.0))]
    pub clamp: Option<f64>,
    /// Settings of the implicit integrators.
    #[serde(default)]
    pub solver: Solver,
    /// Settings of `position_based`.
    #[serde(default)]
    pub position_based: PositionBased,
    /// Contact of surfaces and curves with themselves and each other: in the sweeps of `position_based`, otherwise after each step.
    #[serde(default)]
    pub self_contact: Option<SelfContact>,
    /// Settings of the `rigid` method.
    #[serde(default)]
    pub rigid: Option<Rigid>,
    /// Settings of the `grains` method.
    #[serde(default)]
    pub grains: Option<Granular>,
    /// Settings of the `crowd` method.
    #[serde(default)]
    pub crowd: Option<Walking>,
    /// Parameters of the `vicsek` method, which requires them.
    #[serde(default)]
    pub vicsek: Option<Vicsek>,
}

impl Default for System {
    fn default() -> Self {
        Self {
            name: main(),
            method: Method::default(),
            integrator: Integrator::default(),
            substeps: None,
            step: None,
            adaptive: Adaptive::default(),
            clamp: None,
            solver: Solver::default(),
            position_based: PositionBased::default(),
            self_contact: None,
            rigid: None,
            grains: None,
            crowd: None,
            vicsek: None,
        }
    }
}

fn main() -> String {
    "main".into()
}

/// A numerical method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Masses under forces: x'' = f(x, v, t) / m.
    #[default]
    Dynamics,
    /// Synonym for `dynamics` with `integrator = "position_based"`.
    PositionBased,
    /// Massless particles advected by velocity fields: x' = u(x, t).
    Tracers,
    /// Vicsek's model: particles of constant speed that take the mean direction of all within a radius, plus noise. A map: each sub-step is one step
    /// of it (one per exchange without `substeps` and `step`), and there is no integrator.
    Vicsek,
    /// Heat in bodies on grids; each body has its own scheme, and there is no integrator.
    Heat,
    /// A gas whose pressure follows from its density, stepped explicitly by `symplectic_euler`: the speed of sound limits the step.
    Compressible,
    /// Rigid bodies with contact and friction, `[[body]]`. Sub-steps of at most 1/480 s unless given; there is no integrator.
    Rigid,
    /// Grains with contact and friction, `[[grains]]`, in steps that resolve each bounce, and by default are as long as that allows; there is no integrator.
    Grains,
    /// People who walk on the plan of a floor, `[[plan]]`, to its exits, `[[crowd]]`. Sub-steps of at most 0.05 s unless given; there is no integrator.
    Crowd,
    /// Stable Fluids: incompressible fluids that fill boxes of cells, `[[gas]]`. There is no integrator.
    Gas,
    /// Particles in cells: incompressible liquids with a free surface, `[[liquid]]`. There is no integrator.
    Liquid,
}

impl Method {
    /// The word in the scene.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dynamics => "dynamics",
            Self::PositionBased => "position_based",
            Self::Tracers => "tracers",
            Self::Vicsek => "vicsek",
            Self::Heat => "heat",
            Self::Compressible => "compressible",
            Self::Rigid => "rigid",
            Self::Grains => "grains",
            Self::Crowd => "crowd",
            Self::Gas => "gas",
            Self::Liquid => "liquid",
        }
    }
}

/// A scheme for y' = f(y, t).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Integrator {
    /// x += h v, v += h a. Order 1; gains energy.
    ForwardEuler,
    /// v += h a, then x += h v. Order 1; bounded energy below its limit.
    #[default]
    SymplecticEuler,
    /// x += h/2 (v + v + h a), v += h a. Order 1; gains energy half as fast as forward Euler.
    ModifiedEuler,
    /// Explicit midpoint. Order 2.
    Midpoint,
    /// Heun's method (explicit trapezoid). Order 2.
    Heun,
    /// The classical Runge-Kutta method. Order 4.
    Rk4,
    /// Forward Euler with step doubling: one step T against two of T/2.
    AdaptiveEuler,
    /// Dormand-Prince 5(4) with a PI step controller.
    DormandPrince,
    /// Stoermer: positions at t and t - h. Order 2, symplectic.
    Verlet,
    /// Velocity Verlet. Order 2, symplectic.
    VelocityVerlet,
    /// Implicit (backward) Euler. Order 1; damps, stable for every step.
    ImplicitEuler,
    /// Implicit midpoint. Order 2; conserves quadratic invariants.
    ImplicitMidpoint,
    /// Two-step backward differentiation. Order 2; damps high frequencies.
    Bdf2,
    /// Position-based dynamics: positions are predicted without the elements, then moved until each element is satisfied; velocities follow. Iterated
    /// to convergence it is implicit Euler; with one sweep per sub-step it needs sub-steps of a few ms. Order 1; damps.
    PositionBased,
}

impl Integrator {
    /// All integrators of general y' = f(y, t), simplest first: without `position_based`, which needs elements.
    pub const ALL: [Integrator; 13] = [
        Self::ForwardEuler,
        Self::SymplecticEuler,
        Self::ModifiedEuler,
        Self::Midpoint,
        Self::Heun,
        Self::Rk4,
        Self::AdaptiveEuler,
        Self::DormandPrince,
        Self::Verlet,
        Self::VelocityVerlet,
        Self::ImplicitEuler,
        Self::ImplicitMidpoint,
        Self::Bdf2,
    ];

    /// The word in the scene.
    pub fn name(self) -> &'static str {
        match self {
            Self::ForwardEuler => "forward_euler",
            Self::SymplecticEuler => "symplectic_euler",
            Self::ModifiedEuler => "modified_euler",
            Self::Midpoint => "midpoint",
            Self::Heun => "heun",
            Self::Rk4 => "rk4",
            Self::AdaptiveEuler => "adaptive_euler",
            Self::DormandPrince => "dormand_prince",
            Self::Verlet => "verlet",
            Self::VelocityVerlet => "velocity_verlet",
            Self::ImplicitEuler => "implicit_euler",
            Self::ImplicitMidpoint => "implicit_midpoint",
            Self::Bdf2 => "bdf2",
            Self::PositionBased => "position_based",
        }
    }

    /// Whether a step solves equations.
    pub fn is_implicit(self) -> bool {
        matches!(self, Self::ImplicitEuler | Self::ImplicitMidpoint | Self::Bdf2)
    }

    /// Whether it chooses its own steps.
    pub fn is_adaptive(self) -> bool {
        matches!(self, Self::AdaptiveEuler | Self::DormandPrince)
    }

    /// Whether it needs y split into positions and velocities.
    pub fn needs_velocities(self) -> bool {
        matches!(self, Self::SymplecticEuler | Self::ModifiedEuler | Self::Verlet | Self::VelocityVerlet | Self::PositionBased)
    }

    /// Order of convergence.
    pub fn order(self) -> u32 {
        match self {
            Self::ForwardEuler
            | Self::SymplecticEuler
            | Self::ModifiedEuler
            | Self::AdaptiveEuler
            | Self::ImplicitEuler
            | Self::PositionBased => 1,
            Self::Midpoint | Self::Heun | Self::Verlet | Self::VelocityVerlet | Self::ImplicitMidpoint | Self::Bdf2 => 2,
            Self::Rk4 => 4,
            Self::DormandPrince => 5,
        }
    }
}

/// Settings of the adaptive integrators.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Adaptive {
    /// Largest error of one step: of any position for `adaptive_euler`; the absolute part of the weight of
    /// positions and velocities for `dormand_prince`.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub tolerance: f64,
    /// Relative part of the weight (`dormand_prince`).
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub relative: f64,
    /// First step tried. Default: a hundredth of the exchange interval.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0.0))]
    pub first_step: Option<f64>,
    /// Smallest step relative to the exchange interval; a smaller one ends the run with an error.
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub smallest: f64,
}

impl Default for Adaptive {
    fn default() -> Self {
        Self { tolerance: 1e-4, relative: 0.0, first_step: None, smallest: 1e-9 }
    }
}

/// Settings of the implicit integrators.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Solver {
    /// Solver of the linear systems of Newton's method.
    pub linear: Linear,
    /// Second derivatives in the matrix.
    pub hessian: Hessian,
    /// Residual at which Newton's method stops, relative to the initial one. Default: 1e-3 (single), 1e-10 (double).
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0))]
    pub newton_tolerance: Option<f64>,
    /// Maximum number of Newton iterations.
    #[schemars(range(min = 1, max = 1000))]
    pub newton_iterations: u32,
    /// Residual at which the linear solver stops, relative to the right-hand side. Default: 1e-2 (single), 1e-6 (double).
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0))]
    pub linear_tolerance: Option<f64>,
    /// Maximum number of iterations of the linear solver.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub linear_iterations: u32,
    /// Takes one linearized step (one Newton iteration, no line search).
    pub linearized: bool,
    /// Behaviour when Newton's method does not reach its tolerance.
    pub on_failure: OnFailure,
}

impl Default for Solver {
    fn default() -> Self {
        Self {
            linear: Linear::Pcg,
            hessian: Hessian::Definite,
            newton_tolerance: None,
            newton_iterations: 20,
            linear_tolerance: None,
            linear_iterations: 2000,
            linearized: false,
            on_failure: OnFailure::Warn,
        }
    }
}

/// Settings of position-based dynamics.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PositionBased {
    /// Sweeps over all elements per sub-step. More sub-steps help more than more iterations.
    #[schemars(range(min = 1, max = 100_000))]
    pub iterations: u32,
    /// Sweeps end early when none moves a point farther than this.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub tolerance: Option<f64>,
    /// Long-range attachments: points stay within this multiple of the shortest path to a pin along links, rods and edges of cloth. For large hanging
    /// objects, which few sweeps leave too long. Overrides the stiffness of the material if that would stretch farther. Not with objects that tear or
    /// break.
    #[schemars(range(min = 1.0), extend("x-unit" = "1"))]
    pub tethers: Option<f64>,
    /// Projection of an element in a sweep.
    pub projection: Projection,
    /// Fraction of an element's error removed by all iterations of a sub-step (`plain` only).
    #[schemars(range(max = 1.0), extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub stiffness: f64,
}

impl Default for PositionBased {
    fn default() -> Self {
        Self { iterations: 1, tolerance: None, tethers: None, projection: Projection::Compliant, stiffness: 1.0 }
    }
}

/// Contact of soft surfaces and curves with themselves and each other. Hair meets surfaces and ropes, but no hair: strands act on each other by
/// `collisions` of the hair.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SelfContact {
    /// Distance at which surfaces touch; half of the distance at rest for what is nearer than twice this along a surface. Time per frame
    /// grows with it, beyond an edge length with its square; motion within a surface that is fast for it may be held back.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub thickness: f64,
    /// Kinetic friction coefficient (Coulomb).
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub friction: f64,
    /// Static friction coefficient, at least `friction`. Default: equal to `friction`.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub friction_static: Option<f64>,
}

/// Projection of elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Projection {
    /// By its stiffness in SI units (XPBD): the converged motion is independent of iterations and, for short sub-steps, of their number.
    Compliant,
    /// Regardless of its stiffness (PBD): the apparent stiffness depends on iterations and sub-steps.
    Plain,
}

/// A linear solver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Linear {
    /// Conjugate gradients, matrix-free, preconditioned.
    Pcg,
    /// Sparse Cholesky factorization.
    Cholesky,
}

/// The matrix of Newton's method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Hessian {
    /// Exact second derivatives; may be indefinite under compression.
    Exact,
    /// Without the negative part of each element: always positive definite.
    Definite,
}

/// Behaviour when a solver stops early.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnFailure {
    /// Continue, and count it in the report.
    Warn,
    /// Stop the run.
    Error,
}
