//! Assets of a scene from files.

use crate::{Character, Fabric, Mesh};
use std::collections::HashMap;
use std::sync::Arc;

/// The meshes and characters that a scene names, by path, as they stand in their files, and records of fabrics by path or name.
#[derive(Debug, Clone, Default)]
pub struct Assets {
    meshes: Arc<HashMap<String, Mesh>>,
    characters: Arc<HashMap<String, Character>>,
    fabrics: Arc<HashMap<String, Fabric>>,
}

impl Assets {
    /// Meshes, and characters.
    pub fn new(meshes: HashMap<String, Mesh>, characters: HashMap<String, Character>) -> Self {
        Self { meshes: Arc::new(meshes), characters: Arc::new(characters), ..Self::default() }
    }

    /// The same with records of fabrics.
    pub fn with_fabrics(self, fabrics: HashMap<String, Fabric>) -> Self {
        Self { fabrics: Arc::new(fabrics), ..self }
    }

    /// The record of a path or a name.
    pub fn fabric(&self, key: &str) -> Option<&Fabric> {
        self.fabrics.get(key)
    }

    /// The mesh of a path.
    pub fn get(&self, path: &str) -> Option<&Mesh> {
        self.meshes.get(path)
    }

    /// The character of a path.
    pub fn character(&self, path: &str) -> Option<&Character> {
        self.characters.get(path)
    }
}

impl From<Arc<HashMap<String, Mesh>>> for Assets {
    fn from(meshes: Arc<HashMap<String, Mesh>>) -> Self {
        Self { meshes, ..Self::default() }
    }
}
