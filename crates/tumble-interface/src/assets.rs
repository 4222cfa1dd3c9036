//! Assets of a scene from files.

use crate::{Character, Fabric, Mesh};
use std::collections::HashMap;
use std::sync::Arc;

/// Points of curves, each with two or more, finite, and of some length.
pub type Curves = Vec<Vec<[f64; 3]>>;

/// The meshes, characters and curves that a scene names, by path, as they stand in their files, and records of fabrics by path or name.
#[derive(Debug, Clone, Default)]
pub struct Assets {
    meshes: Arc<HashMap<String, Mesh>>,
    characters: Arc<HashMap<String, Character>>,
    fabrics: Arc<HashMap<String, Fabric>>,
    curves: Arc<HashMap<String, Curves>>,
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

    /// The same with curves.
    pub fn with_curves(self, curves: HashMap<String, Curves>) -> Self {
        Self { curves: Arc::new(curves), ..self }
    }

    /// The curves of a path.
    pub fn curves(&self, path: &str) -> Option<&Curves> {
        self.curves.get(path)
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
