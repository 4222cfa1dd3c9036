//! Cloth that is cut from flat panels and sewn.

use super::fabrics::FabricWords;
use super::structures::{Link, LinkSettings, Links, Pin};
use super::surfaces::{Membrane, Tear};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Cloth: flat panels, cut into triangles, hung where they are told to and sewn together. At rest it is as flat as the panels were.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cloth {
    /// Name in frames.
    pub name: String,
    /// System that moves it; without it, the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// The panels.
    #[serde(default)]
    pub panels: Vec<Panel>,
    /// Which sides of panels are sewn together.
    #[serde(default)]
    pub seams: Vec<Seam>,
    /// The panels and seams of a dress, instead.
    #[serde(default)]
    pub dress: Option<Dress>,
    /// Length of the edges of triangles.
    #[serde(default = "resolution")]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub resolution: f64,
    /// Mass per area. Without it, that of the fabric, or 0.2.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m²", "exclusiveMinimum" = 0.0))]
    pub density: Option<f64>,
    /// Spring families, modulus in N/m: `structural` along edges, `bend` across them. Without it, structural 500 with damping 0.5.
    #[serde(default)]
    pub links: Option<Links>,
    /// Dihedral bending stiffness between neighbouring triangles. Without it 1e-5, beside a fabric 0.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m"))]
    pub hinge: Option<f64>,
    /// The same beside it, quadratic in the positions and flat at rest, whatever the shape of the mesh: cheaper than a hinge, and equal to it where
    /// nothing is stretched.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m"))]
    pub isometric: f64,
    /// Resistance against stretch as of a woven membrane; links are then left out unless they are given.
    #[serde(default)]
    pub membrane: Option<Membrane>,
    /// Measured fabric, by the name of a shipped one or the path of its record: stretch, bending and, unless given, density. Links are then left
    /// out unless they are given.
    #[serde(default)]
    pub fabric: Option<FabricWords>,
    /// How it tears; without it, it does not.
    #[serde(default)]
    pub tear: Option<Tear>,
    /// Stiffness of each triangle against changes of its area: tension over relative change.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N/m"))]
    pub area: f64,
    /// Stiffness of seams, springs without length: force per length of a seam over the gap in it.
    #[serde(default = "thread")]
    #[schemars(extend("x-unit" = "N/m²", "exclusiveMinimum" = 0.0))]
    pub thread: f64,
    /// Masses that stay where they are, or follow a collider.
    #[serde(default)]
    pub pin: Vec<Pin>,
    /// Red, green and blue in pictures, 0 to 1, in linear light (a half is sRGB's 188 of 255).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// A flat piece of cloth, and where it hangs at the start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Panel {
    /// Name for seams.
    pub name: String,
    /// Its corners in its own plane, in order around it. Side 0 goes from corner 0 to corner 1.
    #[schemars(length(min = 3), extend("x-unit" = "m"))]
    pub outline: Vec<[f64; 2]>,
    /// Where its origin is.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub origin: [f64; 3],
    /// Direction of its first axis.
    #[serde(default = "right")]
    pub right: [f64; 3],
    /// Direction of its second axis, as far as that is across the first.
    #[serde(default = "up")]
    pub up: [f64; 3],
    /// Radius of the cylinder, along `up`, that it is laid around at the start: it touches it at the origin, from the side where
    /// `right` points to the right. Without it, the panel starts flat.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub around: Option<f64>,
}

/// Two sides of panels that are sewn together. They must be of one length, to a fiftieth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Seam {
    /// One side.
    pub from: Side,
    /// The other.
    pub to: Side,
    /// Begin with begin, instead of begin with end: for panels that are seen from different sides.
    #[serde(default)]
    pub flip: bool,
}

/// A side of a panel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Side {
    /// Name of the panel.
    pub panel: String,
    /// Which of its sides; side 0 goes from corner 0 to corner 1.
    pub side: u32,
}

/// A dress with a bodice on two straps and a skirt that is a full circle, hung around a body that stands upright at the start, its front
/// towards -y. It fits the mannequin of 1.7 m as it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Dress {
    /// Where the middle of the waist is.
    #[schemars(extend("x-unit" = "m"))]
    pub waist: [f64; 3],
    /// Girth at the waist.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub waist_girth: f64,
    /// Girth below the arms.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub bust_girth: f64,
    /// From the waist up to below the arms.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub bodice: f64,
    /// From below the arms up and over to the top of the shoulders, along the cloth.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub shoulder: f64,
    /// Distance of the middles of both straps.
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
    /// How steeply the skirt falls at the start, below the horizontal.
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

pub(super) fn links() -> Links {
    let structural = Some(Link::Settings(LinkSettings { modulus: 500.0, damping: 0.5, ..LinkSettings::default() }));
    Links { structural, ..Links::default() }
}
