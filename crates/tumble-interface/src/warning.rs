//! Warnings about a scene that can be simulated nevertheless.

use crate::error::Issue;
use serde::Serialize;
use std::fmt;

macro_rules! codes {
    ($($(#[$doc:meta])* $variant:ident = $name:literal,)*) => {
        /// Subject of a warning; docs/warnings.md gives the remedy for each.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
        pub enum Code {
            $($(#[$doc])* #[serde(rename = $name)] $variant,)*
        }

        impl Code {
            /// Each of them.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// The word that people see.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                }
            }
        }
    };
}

codes! {
    /// Fields without tracers.
    IdleFields = "idle-fields",
    /// Tracers without a field.
    IdleTracers = "idle-tracers",
    /// Forces or colliders that no object feels.
    Unfelt = "unfelt",
    /// Air on what has no surface.
    NoSurface = "no-surface",
    /// Electric or magnetic forces on what has no charge.
    NoCharge = "no-charge",
    /// A rule about colliders where there are none.
    NoCollider = "no-collider",
    /// An emitter that never emits.
    NoBirths = "no-births",
    /// A region that fast particles may pass unseen.
    ThinRegion = "thin-region",
    /// A solid that masses may pass on both sides of.
    ThinCollider = "thin-collider",
    /// A picture of a frame beyond the last.
    NoSuchFrame = "no-such-frame",
    /// Tracers that are moved before the gas that carries them.
    LateCarrier = "late-carrier",
    /// Masses that start inside a collider.
    StartsInside = "starts-inside",
    /// Masses at one place that a force cannot part.
    Coincident = "coincident",
    /// Surfaces that start passing through each other.
    TangledStart = "tangled-start",
    /// An anchor too stiff for the rate at which systems exchange impulses.
    StiffAnchor = "stiff-anchor",
    /// Masses whose springs pull them into the rigid bodies that they bear.
    YieldingMasses = "yielding-masses",
    /// Steps too long for the contacts of grains.
    StiffContact = "stiff-contact",
    /// A joint far from the bodies that it holds.
    FarJoint = "far-joint",
    /// Convex parts that fill more than the mesh that they stand for.
    CoarseParts = "coarse-parts",
    /// Systems that do not come to agree about the impulses between them.
    Disagreement = "disagreement",
    /// A pattern of another area than its mesh.
    PatternScale = "pattern-scale",
    /// A pattern that lies over itself.
    FoldedPattern = "folded-pattern",
    /// A mesh of soft matter with flaws.
    UnsoundMesh = "unsound-mesh",
    /// Guides whose roots are off what they grow on.
    FarRoots = "far-roots",
    /// Guides with bends too fine for their pieces.
    CoarseGuides = "coarse-guides",
    /// Guides that were moved out of a collider.
    CombedGuides = "combed-guides",
    /// Tetrahedra that cannot bend at constant volume.
    Locking = "locking",
    /// Rods that shake under their tension in sub-steps that long.
    TautRods = "taut-rods",
    /// Steps so short, places so far or rods so stiff that single precision does not suffice.
    RoundOff = "round-off",
    /// A surface or line heavier or lighter than any real one.
    ImplausibleWeight = "implausible-weight",
    /// Matter denser or lighter than any real one.
    ImplausibleDensity = "implausible-density",
    /// Matter stiffer than diamond.
    ImplausibleStiffness = "implausible-stiffness",
    /// Gravity as on no planet.
    ImplausibleGravity = "implausible-gravity",
    /// Soft matter as large as a town, or too small to see.
    ImplausibleSize = "implausible-size",
}

/// Something doubtful about a scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// Subject.
    pub code: Code,
    /// Path in the scene; empty if it concerns the whole scene.
    pub path: String,
    /// The problem and its remedy.
    pub message: String,
}

impl Warning {
    /// A warning about `path`, both texts in one line each.
    pub fn new(code: Code, path: impl Into<String>, message: impl Into<String>) -> Self {
        let Issue { path, message, .. } = Issue::new(path, message);
        Self { code, path, message }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = if self.path.is_empty() { "" } else { ": " };
        write!(f, "{}{mark}{}", self.path, self.message)
    }
}
