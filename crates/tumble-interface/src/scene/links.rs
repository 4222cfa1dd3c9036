//! Springs between neighbouring masses, and masses that are fixed or loaded: shared by ropes, sheets, blocks, nets and cloth.

use super::AnimatedVector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Families of links. A family that is not given does not exist.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Links {
    /// Between nearest neighbours.
    pub structural: Option<Link>,
    /// Along diagonals.
    pub shear: Option<Link>,
    /// Between next-nearest neighbours (skip one); a fiftieth of the structural modulus is a good start.
    pub bend: Option<Link>,
    /// One diagonal of each cell, or both.
    pub diagonals: Diagonals,
}

/// Diagonals of the shear family.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Diagonals {
    /// One per cell: stiffer in one direction than in the other.
    One,
    /// Both.
    #[default]
    Both,
}

/// A link family: its modulus alone, or all its settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Link {
    /// Modulus: N for a rope, N/m for a sheet, Pa for a block.
    Modulus(#[schemars(range(min = 0.0), extend("x-unit" = "N, N/m or Pa"))] f64),
    /// All settings.
    Settings(LinkSettings),
}

impl Link {
    /// All settings, defaults filled in.
    pub fn settings(&self) -> LinkSettings {
        match self {
            Self::Modulus(modulus) => LinkSettings { modulus: *modulus, ..LinkSettings::default() },
            Self::Settings(settings) => settings.clone(),
        }
    }
}

/// Settings of a link family.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinkSettings {
    /// Elastic modulus: N for a rope, N/m for a sheet, Pa for a block.
    #[schemars(range(min = 0.0), extend("x-unit" = "N, N/m or Pa"))]
    pub modulus: f64,
    /// Internal damping along the link: N s for a rope, N s/m for a sheet, Pa s for a block.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "modulus x s"))]
    pub damping: f64,
    /// Stiffening: force k_s r (1 + hardening (r / l0)²) at the extension r.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub hardening: f64,
    /// Pulls but does not push, like a thread.
    #[serde(default)]
    pub tension_only: bool,
    /// Breaks permanently when |r| / l0 exceeds this.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub break_strain: Option<f64>,
}

/// Fixed masses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Pin {
    /// By name: `"all"`, `"start"`, `"corner 0 1"`, `"vertex 3 4"`, `"edge x-"`, `"face z+"`.
    Words(String),
    /// All within a radius of a point, or by name; optionally following a collider, or for some time.
    Region(Region),
}

/// Collider that pinned masses follow, as if they were part of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Follow {
    /// Name of a collider.
    pub collider: String,
    /// Bone: one of a mannequin, or the name of a joint in the file of a character. Default: the nearest point of a deforming surface, otherwise the
    /// collider as a rigid body.
    #[serde(default)]
    pub bone: Option<String>,
}

/// All masses within a radius of a point at the start, or given by name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// The point.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub center: Option<[f64; 3]>,
    /// The radius.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: Option<f64>,
    /// A name instead of a point and a radius: `"edge y+"`.
    #[serde(default)]
    pub which: Option<String>,
    /// Collider that they follow. Default: they are fixed.
    #[serde(default)]
    pub follow: Option<Follow>,
    /// Time from which they are held, where they are then; to the nearest sub-step. Default: from the start.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub from: Option<f64>,
    /// Time at which they are let go, to the nearest sub-step. Default: never.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0.0))]
    pub until: Option<f64>,
    /// Clamps the edges of the rim between them: the surface keeps its slope there, too. For sheets, nets and cloth with `hinge`, `isometric` or
    /// `fabric`, for the whole run.
    #[serde(default)]
    pub clamp: bool,
}

/// Some masses of an object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Place {
    /// By name: `"all"`, `"start"`, `"corner 0 1"`, `"vertex 3 4"`, `"edge x-"`, `"face z+"`.
    Words(String),
    /// All within a radius of a point at the start.
    Within(Within),
}

/// All masses within a radius of a point at the start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Within {
    /// The point.
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// The radius.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
}

/// A force on some masses of an object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// The masses.
    pub at: Place,
    /// The whole force, shared in proportion to their masses: along the edge of a sheet, a uniform line load. May change in time.
    #[schemars(extend("x-unit" = "N"))]
    pub force: AnimatedVector,
}

/// An extra mass that some masses of an object carry.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PointMass {
    /// The masses.
    pub at: Place,
    /// The whole extra mass, shared in proportion to their own.
    #[schemars(extend("x-unit" = "kg", "exclusiveMinimum" = 0.0))]
    pub mass: f64,
}

/// The springs that are given; otherwise none if something else makes the object elastic, or the default ones.
pub(super) fn given_or(given: &Option<Links>, elastic: bool, default: fn() -> Links) -> Links {
    given.clone().unwrap_or_else(|| if elastic { Links::default() } else { default() })
}

pub(super) fn rope_links() -> Links {
    Links { structural: Some(Link::Settings(LinkSettings { modulus: 1000.0, ..LinkSettings::default() })), ..Links::default() }
}

pub(super) fn sheet_links() -> Links {
    let family = |modulus| Some(Link::Settings(LinkSettings { modulus, ..LinkSettings::default() }));
    Links { structural: family(500.0), shear: family(200.0), bend: family(10.0), diagonals: Diagonals::Both }
}

pub(super) fn net_links() -> Links {
    Links { shear: None, ..sheet_links() }
}

pub(super) fn cloth_links() -> Links {
    let structural = Some(Link::Settings(LinkSettings { modulus: 500.0, damping: 0.5, ..LinkSettings::default() }));
    Links { structural, ..Links::default() }
}
