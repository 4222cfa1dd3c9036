//! Elastic surfaces, what they enclose, and bodies that keep their shape.

use super::Animated;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An orthotropic elastic membrane: woven cloth, or rubber with the defaults. Strains are measured along two directions of the rest shape, warp and
/// weft.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Membrane {
    /// Stiffness along the warp: force per width per strain, Young's modulus times thickness.
    #[schemars(extend("x-unit" = "N/m", "exclusiveMinimum" = 0.0))]
    pub warp: f64,
    /// Stiffness along the weft. Default: that of the warp.
    #[serde(default)]
    #[schemars(extend("x-unit" = "N/m", "exclusiveMinimum" = 0.0))]
    pub weft: Option<f64>,
    /// Poisson's ratio: contraction along the weft per stretch along the warp. Its square must be below warp/weft.
    #[serde(default = "third")]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub poisson: f64,
    /// Shear stiffness. Default: sqrt(warp weft)/(2 (1 + poisson sqrt(weft/warp))), that of an isotropic sheet if warp and weft are equal.
    #[serde(default)]
    #[schemars(extend("x-unit" = "N/m", "exclusiveMinimum" = 0.0))]
    pub shear: Option<f64>,
    /// Damping as a time: damping = time x stiffness.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub damping: f64,
    /// Rotation of the warp in the surface, counter-clockwise seen from outside. At 0 the warp is the first axis of a sheet or panel; on a net it is
    /// the x axis projected into a triangle, or u in the plane of its pattern.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub angle: f64,
}

impl Membrane {
    /// Stiffness along the weft [N/m].
    pub fn weft(&self) -> f64 {
        self.weft.unwrap_or(self.warp)
    }

    /// Shear stiffness [N/m].
    pub fn shear(&self) -> f64 {
        let ratio = (self.weft() / self.warp).sqrt();
        self.shear.unwrap_or((self.warp * self.weft()).sqrt() / (2.0 * (1.0 + self.poisson * ratio)))
    }
}

/// Tearing of a surface: where a triangle edge is stretched too far, one of its ends splits permanently.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tear {
    /// Strain at which an edge tears.
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub strain: f64,
    /// Largest random variation of the strength of single edges, relative to that strain.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.99), extend("x-unit" = "1"))]
    pub spread: f64,
    /// Weak regions: a worn seam, a notch.
    #[serde(default)]
    pub weak: Vec<Weak>,
    /// Maximum number of vertex splits; that many spare masses are kept at the end of its columns. Default: half the number of triangles.
    #[serde(default)]
    #[schemars(range(max = 10_000_000))]
    pub spare: Option<u32>,
}

/// A ball in which a surface is weaker, in its initial position.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Weak {
    /// Centre.
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// Its radius.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// Strain at which edges tear there.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub strain: f64,
}

/// Pressure inside a closed net.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Inflation {
    /// Volume at zero pressure, relative to that of the mesh; above 0.
    #[serde(default = "whole")]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub volume: Animated,
    /// Bulk modulus: pressure per relative change of volume. Default: constant volume.
    #[serde(default)]
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0.0))]
    pub stiffness: Option<f64>,
}

/// Pulls all masses of an object towards their positions in the rest shape, which is translated and rotated to the best fit.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShapeMatching {
    /// Frequency at which every deformation oscillates. Default: a rigid shape.
    #[serde(default)]
    #[schemars(extend("x-unit" = "Hz", "exclusiveMinimum" = 0.0))]
    pub frequency: Option<f64>,
}

/// A liquid of particles with a density constraint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fluid {
    /// Particle spacing at rest; each particle has the mass density x spacing³.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub spacing: f64,
    /// Density.
    #[serde(default = "water")]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub density: f64,
    /// Boxes filled at the start.
    #[schemars(length(min = 1))]
    pub fill: Vec<Fill>,
    /// Viscosity; an explicit force, so steps must be shorter than about density x spacing²/(8 viscosity).
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "Pa s"))]
    pub viscosity: f64,
    /// Bulk modulus: pressure per relative compression. Default: incompressible, as far as the steps allow.
    #[serde(default)]
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0.0))]
    pub stiffness: Option<f64>,
}

impl Fluid {
    /// How many particles there are, about.
    pub fn count(&self) -> f64 {
        self.fill.iter().map(|b| b.size.iter().map(|s| (s / self.spacing).round().max(1.0)).product::<f64>()).sum()
    }
}

/// A box filled with particles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fill {
    /// Centre.
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// Edge lengths; the number of particles is the best fit.
    #[schemars(transform = super::items_above_zero, extend("x-unit" = "m"))]
    pub size: [f64; 3],
}

fn water() -> f64 {
    1000.0
}

fn third() -> f64 {
    0.3
}

fn whole() -> Animated {
    Animated::Value(1.0)
}
