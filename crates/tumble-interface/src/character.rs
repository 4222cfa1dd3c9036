//! A skinned, animated figure as data; reading one from bytes is the work of `tumble-io`, moving it that of the engine.

use crate::Mesh;

/// A mesh that joints carry, and what the joints do.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Character {
    /// The surface as it was bound to the joints.
    pub mesh: Mesh,
    /// Parents before children.
    pub joints: Vec<Joint>,
    /// Ways in which joints carry vertices.
    pub binds: Vec<Bind>,
    /// Bones of each vertex, len = vertices; the weights of a vertex sum to 1.
    pub skin: Vec<[Influence; 4]>,
    /// Movements.
    pub clips: Vec<Clip>,
}

/// A joint of a skeleton; the bone is what it carries.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Its name, which may be empty.
    pub name: String,
    /// Index of the joint that carries it, less than its own.
    pub parent: Option<u32>,
    /// Transform in its parent without a clip.
    pub rest: Transform,
}

/// A place in a parent: scaled, turned, then moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    /// Movement [m].
    pub translation: [f64; 3],
    /// Unit quaternion x, y, z, w.
    pub rotation: [f64; 4],
    /// Factors along the axes.
    pub scale: [f64; 3],
}

impl Default for Transform {
    fn default() -> Self {
        Self { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0], scale: [1.0; 3] }
    }
}

/// Bind matrix: takes vertices into the frame of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bind {
    /// The joint.
    pub joint: u32,
    /// The inverse of the joint's place when the mesh was bound: x -> m x + t, rows of m with t behind.
    pub inverse: [[f64; 4]; 3],
}

/// A part in carrying a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Influence {
    /// Index of a bind.
    pub bind: u32,
    /// Its share, 0 to 1.
    pub weight: f64,
}

/// A movement.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Clip {
    /// Its name, which may be empty.
    pub name: String,
    /// Numbers of joints in time; what has none rests.
    pub tracks: Vec<Track>,
}

/// One number of a joint in time.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// The joint.
    pub joint: u32,
    /// Which of its numbers.
    pub part: Part,
    /// Keys [s], rising; before the first and after the last nothing changes.
    pub times: Vec<f64>,
    /// Values; of a cubic track three for each key: rate before, value, rate after. The fourth number counts for rotations alone.
    pub values: Vec<[f64; 4]>,
    /// Interpolation between keys.
    pub between: Between,
}

/// Animated property of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Its movement [m].
    Translation,
    /// Its turn, a quaternion.
    Rotation,
    /// Its scale.
    Scale,
}

/// Interpolation between keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Between {
    /// It stays until the next key.
    Step,
    /// At a constant rate; turns along the shorter way.
    Linear,
    /// A cubic with the given rates at the keys.
    Cubic,
}

impl Clip {
    /// Time of the last key of all tracks [s].
    pub fn duration(&self) -> f64 {
        self.tracks.iter().filter_map(|t| t.times.last()).fold(0.0, |a, b| a.max(*b))
    }
}
