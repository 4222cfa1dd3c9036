//! Elastic surfaces, what they enclose, and bodies that keep their shape.

use super::structures::Links;
use super::{Cloth, Net, Rope, Sheet};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An orthotropic elastic membrane: woven cloth, or with its default numbers rubber. Strains are measured along two directions of the
/// rest shape, the warp and the weft across it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Membrane {
    /// Stiffness along the warp: force per width over strain, Young's modulus times thickness.
    #[schemars(extend("x-unit" = "N/m", "exclusiveMinimum" = 0.0))]
    pub warp: f64,
    /// The same along the weft; without it, that of the warp.
    #[serde(default)]
    #[schemars(extend("x-unit" = "N/m", "exclusiveMinimum" = 0.0))]
    pub weft: Option<f64>,
    /// Poisson's ratio: how much it narrows along the weft over how much it is stretched along the warp. Its square must be below
    /// warp/weft.
    #[serde(default = "third")]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub poisson: f64,
    /// Stiffness against shear; without it, sqrt(warp weft)/(2 (1 + poisson sqrt(weft/warp))), that of an isotropic sheet if both are alike.
    #[serde(default)]
    #[schemars(extend("x-unit" = "N/m", "exclusiveMinimum" = 0.0))]
    pub shear: Option<f64>,
    /// Damping as a time: damping = time x stiffness.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub damping: f64,
    /// Turn of the warp in the surface, counter-clockwise seen from outside. At 0 it is the first axis of a sheet or of a panel, on a net the
    /// x axis as far as it lies in a triangle, or u in the plane of its pattern.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub angle: f64,
}

impl Membrane {
    /// Stiffness along the weft [N/m].
    pub fn weft(&self) -> f64 {
        self.weft.unwrap_or(self.warp)
    }

    /// Stiffness against shear [N/m].
    pub fn shear(&self) -> f64 {
        let ratio = (self.weft() / self.warp).sqrt();
        self.shear.unwrap_or((self.warp * self.weft()).sqrt() / (2.0 * (1.0 + self.poisson * ratio)))
    }
}

/// How a surface tears: where an edge of a triangle is stretched too much, one of its ends comes apart, for good.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tear {
    /// Lengthening over rest length at which an edge gives way.
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub strain: f64,
    /// How much stronger or weaker single edges are, at most, over that strain.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.99), extend("x-unit" = "1"))]
    pub spread: f64,
    /// Where it is weaker: a seam that has worn out, a notch.
    #[serde(default)]
    pub weak: Vec<Weak>,
    /// How many times a vertex can come apart; so many masses are kept ready, at the end of its columns. Without it, half as many as there are
    /// triangles.
    #[serde(default)]
    #[schemars(range(max = 10_000_000))]
    pub spare: Option<u32>,
}

/// A ball in which a surface is weaker, as it lies at the start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Weak {
    /// Its middle.
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// Its radius.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// Strain at which edges give way there.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub strain: f64,
}

/// What a closed net holds in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Inflation {
    /// Volume at which nothing presses, over that of the mesh.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub volume: f64,
    /// Bulk modulus: pressure over the relative change of volume. Without it the volume is kept, whatever it takes.
    #[serde(default)]
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0.0))]
    pub stiffness: Option<f64>,
}

/// Keeps all masses of an object near the place that they have in the rest shape, moved and turned as fits them best.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShapeMatching {
    /// Frequency at which every deformation oscillates. Without it the shape is rigid.
    #[serde(default)]
    #[schemars(extend("x-unit" = "Hz", "exclusiveMinimum" = 0.0))]
    pub frequency: Option<f64>,
}

/// A liquid of particles that keeps its density.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fluid {
    /// Distance of particles at rest; each has the mass density x spacing³.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub spacing: f64,
    /// Density.
    #[serde(default = "water")]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub density: f64,
    /// Boxes that it fills at the start.
    #[schemars(length(min = 1))]
    pub fill: Vec<Fill>,
    /// Viscosity; an explicit force, so that steps must be shorter than about density x spacing²/(8 viscosity).
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "Pa s"))]
    pub viscosity: f64,
    /// Bulk modulus: pressure over relative compression. Without it the density is kept as well as the steps allow.
    #[serde(default)]
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0.0))]
    pub stiffness: Option<f64>,
}

/// A box that is filled with particles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fill {
    /// Its middle.
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// Lengths of its edges; as many particles as fit best.
    #[schemars(transform = super::items_above_zero, extend("x-unit" = "m"))]
    pub size: [f64; 3],
}

impl Rope {
    /// Its springs: those given, else stiff ones between neighbours. Not of a rod, which has none.
    pub fn links(&self) -> Links {
        links(&self.links, self.rod.is_some(), super::structures::rope_links)
    }
}

impl Sheet {
    /// Its springs: those given, else the default ones if nothing else makes it elastic.
    pub fn links(&self) -> Links {
        links(&self.links, self.membrane.is_some() || self.fabric.is_some(), super::structures::sheet_links)
    }
}

impl Net {
    /// Its springs: those given, else the default ones if nothing else makes it elastic.
    pub fn links(&self) -> Links {
        let elastic = self.membrane.is_some() || self.fabric.is_some() || self.shape_matching.is_some();
        links(&self.links, elastic, super::structures::net_links)
    }
}

impl Cloth {
    /// Its springs: those given, else the default ones if nothing else makes it elastic.
    pub fn links(&self) -> Links {
        links(&self.links, self.membrane.is_some() || self.fabric.is_some(), super::cloth::links)
    }

    /// Its dihedral bending stiffness [N m].
    pub fn hinge(&self) -> f64 {
        self.hinge.unwrap_or(if self.fabric.is_some() { 0.0 } else { 1e-5 })
    }
}

fn links(given: &Option<Links>, elastic: bool, default: fn() -> Links) -> Links {
    given.clone().unwrap_or_else(|| if elastic { Links::default() } else { default() })
}

fn water() -> f64 {
    1000.0
}

fn third() -> f64 {
    0.3
}

fn one() -> f64 {
    1.0
}
