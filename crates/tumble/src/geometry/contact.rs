//! Where masses touch solids. Candidates come from here for every method; each method resolves them its own way.

use super::{Shape, Vector};

/// A solid with a surface.
#[derive(Debug, Clone)]
pub struct Collider {
    /// Its shape.
    pub shape: Shape,
    /// Masses are kept this far from the surface [m].
    pub thickness: f64,
    /// Coulomb friction coefficient.
    pub friction: f64,
    /// Speed after a bounce over speed before.
    pub restitution: f64,
}

/// A mass within the thickness of a solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// How deep it is below the thickness [m], > 0.
    pub depth: f64,
    /// Unit normal out of the solid.
    pub normal: Vector,
}

impl Collider {
    /// The contact of a mass at p, if it is closer than the thickness.
    pub fn touch(&self, p: Vector) -> Option<Touch> {
        let (distance, normal) = self.shape.distance(p);
        let depth = self.thickness - distance;
        (depth > 0.0 && normal.norm_sq() > 0.0).then_some(Touch { depth, normal })
    }
}
