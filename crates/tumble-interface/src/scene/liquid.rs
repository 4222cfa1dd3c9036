//! Liquids with a free surface on a grid.

use super::{AnimatedVector, GridBox, OnFailure, Shape, Solid};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An incompressible liquid with a free surface in a box of cells: particles carry it, a grid finds its pressure. The sides of the box are walls. Its
/// rows in frames are its particles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Liquid {
    /// Name in frames and pictures.
    pub name: String,
    /// System that moves it. Default: the first of method `liquid`.
    #[serde(default)]
    pub system: Option<String>,
    /// The cells.
    #[serde(rename = "box")]
    pub cells: GridBox,
    /// What it fills at the start. Where fills overlap, the first counts. Needed where there is no `inflow`.
    #[serde(default)]
    pub fill: Vec<LiquidFill>,
    /// Where it comes in: volumes that stay full, such as the mouth of a tap.
    #[serde(default)]
    pub inflow: Vec<LiquidInflow>,
    /// Where it leaves: volumes that stay empty.
    #[serde(default)]
    pub drain: Vec<LiquidDrain>,
    /// Density.
    #[serde(default = "water")]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub density: f64,
    /// Dynamic viscosity: 1e-3 for water, 0.1 for oil, 2 to 10 for honey; 0 for none.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "Pa s"))]
    pub viscosity: f64,
    /// Surface tension: 0.072 for water, 0 for none.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N/m"))]
    pub surface_tension: f64,
    /// What it does along colliders and the sides of its box; with `no_slip` it needs viscosity.
    #[serde(default)]
    pub solids: Solid,
    /// Objects that it moves, and that move it: [[body]], by force and torque of its pressure; [[particles]] in a system of dynamics, whose masses are
    /// balls of their radius (in 2D: disks, a metre thick).
    #[serde(default)]
    pub bodies: Vec<String>,
    /// Particles along each edge of a cell at the start: 2 are 8 in a cell, 4 in the plane.
    #[serde(default = "two")]
    #[schemars(range(min = 1, max = 4))]
    pub sampling: u32,
    /// How velocities go from particles to the grid and back.
    #[serde(default)]
    pub transfer: LiquidTransfer,
    /// Part of their own velocity that particles keep, with the change on the grid added (`flip` and `affine_flip` only): the rest is that of the grid, and 0
    /// would be `pic`, or `apic`. Default: 0.97.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub flip_ratio: Option<f64>,
    /// Whether a second solve moves particles from where they crowd to where they thin out, so that the liquid keeps its volume.
    #[serde(default = "yes")]
    pub keep_volume: bool,
    /// Pressure solver: conjugate gradients preconditioned by multigrid.
    #[serde(default)]
    pub pressure: LiquidPressure,
    /// Cells that the fastest particle crosses in a sub-step, if the system has neither `substeps` nor `step`.
    #[serde(default = "one")]
    #[schemars(range(max = 4.0), extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub courant: f64,
    /// Whether frames have its surface as well, an object `NAME.surface` with triangles of its own in each, which pictures and files show instead of
    /// particles. Default: true, false in the plane, where there is none.
    #[serde(default)]
    pub surface: Option<bool>,
    /// Spray, foam and bubbles, for pictures: particles without mass, objects `NAME.spray`, `NAME.foam` and `NAME.bubbles`; `{}` for what water does.
    /// Default: none.
    #[serde(default)]
    pub whitewater: Option<LiquidWhitewater>,
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB). Default: from dark to light with the speed.
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

fn water() -> f64 {
    1000.0
}

fn two() -> u32 {
    2
}

fn yes() -> bool {
    true
}

fn one() -> f64 {
    1.0
}

/// A volume that a liquid fills at the start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LiquidFill {
    /// Its shape; a mesh must be closed. What lies outside the box or in a collider stays empty.
    pub shape: Shape,
    /// Velocity at the start; may be a formula of x, y, z.
    #[serde(default = "still")]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: AnimatedVector,
}

fn still() -> AnimatedVector {
    [0.0; 3].into()
}

/// A volume in which a liquid comes in: it stays full, and what is in it has the velocity of the inflow.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LiquidInflow {
    /// Its shape; not a mesh.
    pub shape: Shape,
    /// Velocity; may change in time.
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: AnimatedVector,
    /// Start time.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s"))]
    pub start: f64,
    /// End time. Default: never.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s"))]
    pub end: Option<f64>,
}

/// A volume in which a liquid leaves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LiquidDrain {
    /// Its shape; not a mesh.
    pub shape: Shape,
    /// Start time.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s"))]
    pub start: f64,
    /// End time. Default: never.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s"))]
    pub end: Option<f64>,
}

/// How velocities go from particles to the grid and back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LiquidTransfer {
    /// Particle in cell: a particle takes the velocity of the grid. Smooth, and damps strongly.
    Pic,
    /// Fluid implicit particle: it adds what the grid has changed. Lively and noisy.
    Flip,
    /// Affine particle in cell: it takes the velocity of the grid and its gradient. Smooth, and keeps angular momentum.
    #[default]
    Apic,
    /// FLIP with the gradient of APIC: a particle adds what the grid has changed, and takes the gradient. Keeps more energy than either, and as much noise as FLIP.
    AffineFlip,
}

/// What a liquid looks like where it takes up air. Pairs are bounds from which, and up to which, more is born; those of water: below 1 m/s or so its
/// surface tension keeps air out. Smaller scenes with foam need smaller ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LiquidWhitewater {
    /// Particles that one of the liquid gives in a second, at most, where it runs together and traps air.
    #[schemars(range(min = 0.0, max = 1e6), extend("x-unit" = "1/s"))]
    pub trapped_rate: f64,
    /// Particles that one of the liquid gives in a second, at most, on crests that go forward.
    #[schemars(range(min = 0.0, max = 1e6), extend("x-unit" = "1/s"))]
    pub crest_rate: f64,
    /// Speed of the liquid.
    #[schemars(inner(range(min = 0.0)), extend("x-unit" = "m/s"))]
    pub speed: [f64; 2],
    /// How fast the liquid within a cell around runs together, mean.
    #[schemars(inner(range(min = 0.0)), extend("x-unit" = "m/s"))]
    pub trapped: [f64; 2],
    /// How sharp a crest is: 1 - cosine between normals within a cell, mean.
    #[schemars(inner(range(min = 0.0)), extend("x-unit" = "1"))]
    pub crest: [f64; 2],
    /// Time that a particle may be foam, at least and at most, equally likely in between; spray that lies on a solid is as short-lived.
    #[schemars(inner(range(min = 0.0)), extend("x-unit" = "s"))]
    pub life: [f64; 2],
    /// Speed at which bubbles rise in the liquid around: 0.25 for those of some millimetres in water.
    #[schemars(range(min = 0.0), extend("x-unit" = "m/s"))]
    pub rise: f64,
    /// How many particles there are at most; beyond, the oldest go.
    #[schemars(range(min = 1, max = 10_000_000), extend("x-unit" = "1"))]
    pub limit: u32,
}

impl Default for LiquidWhitewater {
    fn default() -> Self {
        Self {
            trapped_rate: 100.0,
            crest_rate: 300.0,
            speed: [1.0, 4.0],
            trapped: [0.3, 2.0],
            crest: [0.15, 0.6],
            life: [1.0, 3.0],
            rise: 0.25,
            limit: 200_000,
        }
    }
}

/// Pressure solver of a liquid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LiquidPressure {
    /// Largest residual divergence, times dx, relative to the fastest velocity before the projection. Default: 1e-4 (single), 1e-9 (double).
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub tolerance: Option<f64>,
    /// Maximum number of iterations.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub iterations: u32,
    /// Behaviour when the tolerance is not met.
    pub on_failure: OnFailure,
}

impl Default for LiquidPressure {
    fn default() -> Self {
        Self { tolerance: None, iterations: 200, on_failure: OnFailure::Warn }
    }
}
