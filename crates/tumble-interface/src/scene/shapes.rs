//! Solid shapes and meshes from files.

use super::items_above_zero;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A solid thing that masses cannot enter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Collider {
    /// Name in frames and pictures.
    pub name: String,
    /// Its shape.
    pub shape: Shape,
    /// Masses are kept this far from the surface.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
    pub thickness: f64,
    /// Coulomb friction coefficient, static and sliding.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub friction: f64,
    /// Speed after a bounce over speed before.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "1"))]
    pub restitution: f64,
    /// Red, green and blue in pictures, 0 to 1, in linear light (a half is sRGB's 188 of 255).
    #[serde(default)]
    pub color: Option<[f64; 3]>,
}

/// A solid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// A ball.
    Sphere {
        /// Its centre.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Its radius.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
        radius: f64,
    },
    /// A box with edges along the axes, turned if asked.
    Box {
        /// Its centre.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        center: [f64; 3],
        /// Its edges.
        #[schemars(transform = items_above_zero, extend("x-unit" = "m"))]
        size: [f64; 3],
        /// Turn about x, then y, then z.
        #[serde(default)]
        #[schemars(extend("x-unit" = "°"))]
        rotate: [f64; 3],
    },
    /// Everything below a plane.
    Plane {
        /// A point of the plane.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        point: [f64; 3],
        /// Direction out of the solid, of any length.
        normal: [f64; 3],
    },
    /// Everything below a height.
    Floor {
        /// Height of the floor.
        #[serde(default)]
        #[schemars(extend("x-unit" = "m"))]
        height: f64,
    },
    /// A triangle mesh from a file.
    Mesh(MeshFile),
}

/// A triangle mesh from an OBJ, PLY, STL or GLB file, placed in the world: scaled, turned, then moved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshFile {
    /// File, relative to the scene file.
    pub path: String,
    /// Hash of the file's content; without it, any content will do.
    #[serde(default)]
    pub hash: Option<String>,
    /// Factor on the size.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub scale: f64,
    /// Turn about x, then y, then z.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
    /// Movement after scaling and turning.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub translate: [f64; 3],
    /// Cells of the signed-distance grid along the longest side (colliders only).
    #[serde(default = "ninety_six")]
    #[schemars(range(min = 8, max = 512))]
    pub resolution: u32,
    /// Treat the mesh as a shell without an inside; for meshes that are not closed (colliders only; needs a thickness).
    #[serde(default)]
    pub shell: bool,
}

fn one() -> f64 {
    1.0
}

fn ninety_six() -> u32 {
    96
}
