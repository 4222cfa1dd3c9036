//! Measured fabrics.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A measured fabric.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum FabricWords {
    /// The name of a shipped one: `"denim"`, `"interlock"`, `"tablecloth"`.
    Name(String),
    /// A name or a path, and how it is used.
    Use(FabricUse),
}

/// A measured fabric and how it is used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FabricUse {
    /// The name of a shipped one.
    #[serde(default)]
    pub name: Option<String>,
    /// The file of its record instead, TOML or JSON; relative to the scene.
    #[serde(default)]
    pub path: Option<String>,
    /// Turn of the warp in the surface, counter-clockwise seen from outside. At 0 it is the first axis of a sheet or of a panel, on a net the
    /// x axis as far as it lies in a triangle, or u in the plane of its pattern.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub angle: f64,
    /// Factor of density, stretching and bending: so many layers.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub thicken: f64,
    /// Factor of bending alone. At 1 the record is moment over curvature; 0.25 is what ARCSim makes of it.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub bending: f64,
    /// Damping as a time: damping = time x stiffness. No record tells it.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub damping: f64,
    /// Hash of the file's content, as the manifest of a run notes it; another content is refused.
    #[serde(default)]
    pub hash: Option<String>,
}

/// A place in a scene that names a fabric.
pub struct FabricRef<'a> {
    /// Path of the place.
    pub place: String,
    /// What stands there.
    pub words: &'a mut FabricWords,
}

impl FabricWords {
    /// How it is used.
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

    /// The path, if it is not a name that it says.
    ///
    /// # Errors
    /// Neither or both.
    pub fn choice(&self) -> Result<Option<&str>, String> {
        match self {
            Self::Name(_) => Ok(None),
            Self::Use(FabricUse { name: Some(_), path: None, .. }) => Ok(None),
            Self::Use(FabricUse { name: None, path: Some(path), .. }) => Ok(Some(path)),
            Self::Use(_) => Err("expected either the name of a shipped fabric or the path of a record".into()),
        }
    }

    /// Where below its place the name stands.
    pub fn name_key(&self) -> &'static str {
        if matches!(self, Self::Name(_)) { "" } else { ".name" }
    }

    /// Where the hash of its file stands.
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
