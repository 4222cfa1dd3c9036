//! Cloth cut from flat panels and sewn.

use super::fabrics::FabricWords;
use super::links::{Links, Load, Pin, PointMass, cloth_links, given_or};
use super::surfaces::{Membrane, Tear};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Cloth: flat panels, triangulated, placed and sewn together. Its rest shape is flat, like the panels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cloth {
    /// Name in frames.
    pub name: String,
    /// System that moves it. Default: the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// The panels.
    #[serde(default)]
    pub panels: Vec<Panel>,
    /// Seams: pairs of panel sides.
    #[serde(default)]
    pub seams: Vec<Seam>,
    /// The panels and seams of a dress, instead of `panels` and `seams`.
    #[serde(default)]
    pub dress: Option<Dress>,
    /// Edge length of the triangles.
    #[serde(default = "resolution")]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub resolution: f64,
    /// Mass per area. Default: that of the fabric, or 0.2.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m²", "exclusiveMinimum" = 0.0))]
    pub density: Option<f64>,
    /// Spring families, modulus in N/m: `structural` along edges, `bend` across them. Default: structural 500 with damping 0.5.
    #[serde(default)]
    pub links: Option<Links>,
    /// Bending stiffness of a plate without Poisson's ratio, the same on triangles of any shape; at rest its panels are flat. Default: 1e-5, or 0 with a
    /// fabric.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m"))]
    pub hinge: Option<f64>,
    /// Additional bending stiffness, quadratic in the positions and flat at rest for any mesh: cheaper than `hinge`, and equal to it for inextensible
    /// surfaces of equilateral triangles.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m"))]
    pub isometric: f64,
    /// Stretch resistance of a woven membrane; it replaces the default links.
    #[serde(default)]
    pub membrane: Option<Membrane>,
    /// Measured fabric, the name of a bundled one or the path of its record: stretch, bending and, by default, density. It replaces the default
    /// links.
    #[serde(default)]
    pub fabric: Option<FabricWords>,
    /// Tearing. Default: none.
    #[serde(default)]
    pub tear: Option<Tear>,
    /// Area stiffness of each triangle: tension per relative change of area.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N/m"))]
    pub area: f64,
    /// Stiffness of seams, springs of zero length: force per seam length per gap.
    #[serde(default = "thread")]
    #[schemars(extend("x-unit" = "N/m²", "exclusiveMinimum" = 0.0))]
    pub thread: f64,
    /// Masses that are fixed, or follow a collider.
    #[serde(default)]
    pub pin: Vec<Pin>,
    /// Forces on some of its masses.
    #[serde(default)]
    pub load: Vec<Load>,
    /// Extra masses on some of its masses.
    #[serde(default)]
    pub point_mass: Vec<PointMass>,
    /// Initial velocity.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: [f64; 3],
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

impl Cloth {
    /// Its springs: those given, otherwise the default ones if nothing else makes it elastic.
    pub fn links(&self) -> Links {
        given_or(&self.links, self.membrane.is_some() || self.fabric.is_some(), cloth_links)
    }

    /// Its bending stiffness [N m].
    pub fn hinge(&self) -> f64 {
        self.hinge.unwrap_or(if self.fabric.is_some() { 0.0 } else { 1e-5 })
    }
}

/// A flat piece of cloth and its initial placement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Panel {
    /// Name, used by seams.
    pub name: String,
    /// Corners in the plane of the panel, in order. Side 0 runs from corner 0 to corner 1.
    #[schemars(length(min = 3), extend("x-unit" = "m"))]
    pub outline: Vec<[f64; 2]>,
    /// Position of its origin.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub origin: [f64; 3],
    /// Direction of its first axis.
    #[serde(default = "right")]
    pub right: [f64; 3],
    /// Direction of its second axis, orthogonalized against the first.
    #[serde(default = "up")]
    pub up: [f64; 3],
    /// Radius of a cylinder along `up` around which the panel is wrapped at the start; it touches the cylinder at its origin, on the side where
    /// `right` points to the right. Default: the panel starts flat.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub around: Option<f64>,
}

/// Two panel sides that are sewn together. Their lengths must agree to a fiftieth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Seam {
    /// One side.
    pub from: Side,
    /// The other.
    pub to: Side,
    /// Joins start to start instead of start to end: for panels seen from different sides.
    #[serde(default)]
    pub flip: bool,
}

/// A side of a panel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Side {
    /// Name of the panel.
    pub panel: String,
    /// Index of the side; side 0 runs from corner 0 to corner 1.
    pub side: u32,
}

/// A dress with a bodice on two straps and a full-circle skirt, placed around a body that stands upright and faces -y at the start. By default it
/// fits the mannequin of 1.7 m.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Dress {
    /// Centre of the waist.
    #[schemars(extend("x-unit" = "m"))]
    pub waist: [f64; 3],
    /// Girth at the waist.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub waist_girth: f64,
    /// Girth below the arms.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub bust_girth: f64,
    /// Height from the waist to below the arms.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub bodice: f64,
    /// Length from below the arms to the top of the shoulders, along the cloth.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub shoulder: f64,
    /// Distance between the centres of the straps.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub strap_distance: f64,
    /// Width of a strap.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub strap: f64,
    /// Length of the skirt.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub skirt: f64,
    /// Depth of the body over its width.
    #[schemars(range(min = 0.2, max = 1.0), extend("x-unit" = "1"))]
    pub depth: f64,
    /// Initial slope of the skirt below the horizontal.
    #[schemars(range(min = 0.0, max = 80.0), extend("x-unit" = "°"))]
    pub fall: f64,
}

impl Default for Dress {
    fn default() -> Self {
        Self {
            waist: [0.0, 0.0, 1.0],
            waist_girth: 0.8,
            bust_girth: 0.98,
            bodice: 0.24,
            shoulder: 0.25,
            strap_distance: 0.2,
            strap: 0.05,
            skirt: 0.55,
            depth: 0.82,
            fall: 50.0,
        }
    }
}

fn resolution() -> f64 {
    0.03
}

fn thread() -> f64 {
    1e5
}

fn right() -> [f64; 3] {
    [1.0, 0.0, 0.0]
}

fn up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}
