//! Measured fabrics.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A measured fabric.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum FabricWords {
    /// The name of a bundled fabric: `"denim"`, `"interlock"`, `"tablecloth"`.
    Name(String),
    /// A name or a path, with settings.
    Use(FabricUse),
}

/// A measured fabric with settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FabricUse {
    /// Name of a bundled fabric.
    #[serde(default)]
    pub name: Option<String>,
    /// Alternatively the file of its record, TOML or JSON, relative to the scene.
    #[serde(default)]
    pub path: Option<String>,
    /// Rotation of the warp in the surface, counter-clockwise seen from outside. At 0 the warp is the first axis of a sheet or panel; on a net it is
    /// the x axis projected into a triangle, or u in the plane of its pattern.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub angle: f64,
    /// Factor on density, stretching and bending: the number of layers.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub thicken: f64,
    /// Factor on bending alone. At 1 the record is moment over curvature; 0.25 reproduces ARCSim.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub bending: f64,
    /// Damping as a time: damping = time x stiffness. Records do not contain it.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub damping: f64,
    /// Hash of the file's content, as in the manifest of a run; other content is an error.
    #[serde(default)]
    pub hash: Option<String>,
}

/// A reference to a fabric in a scene.
pub struct FabricRef<'a> {
    /// Path within the scene.
    pub place: String,
    /// The value.
    pub words: &'a mut FabricWords,
}

impl FabricWords {
    /// The settings.
    pub fn settings(&self) -> FabricUse {
        match self {
            Self::Name(name) => {
                FabricUse { name: Some(name.clone()), path: None, angle: 0.0, thicken: 1.0, bending: 1.0, damping: 0.0, hash: None }
            }
            Self::Use(settings) => settings.clone(),
        }
    }

    /// The path or the name.
    pub fn key(&self) -> &str {
        match self {
            Self::Name(name) => name,
            Self::Use(settings) => settings.path.as_deref().or(settings.name.as_deref()).unwrap_or_default(),
        }
    }

    /// The path, or `None` for a name.
    pub fn choice(&self) -> Result<Option<&str>, String> {
        match self {
            Self::Name(_) => Ok(None),
            Self::Use(FabricUse { name: Some(_), path: None, .. }) => Ok(None),
            Self::Use(FabricUse { name: None, path: Some(path), .. }) => Ok(Some(path)),
            Self::Use(_) => Err("expected either the name of a shipped fabric or the path of a record".into()),
        }
    }

    /// Key of the name, relative to the fabric's path.
    pub fn name_key(&self) -> &'static str {
        if matches!(self, Self::Name(_)) { "" } else { ".name" }
    }

    /// The hash of the file.
    pub fn hash_mut(&mut self) -> Option<&mut Option<String>> {
        match self {
            Self::Name(_) => None,
            Self::Use(settings) => Some(&mut settings.hash),
        }
    }
}

fn one() -> f64 {
    1.0
}
