//! Surfaces of bodies: solids whose motion others change by touching them. They are announced once and move with the published states of
//! their rows; those of scenery say where they are at every time.

use super::BodyRow;
use crate::geometry::Collider;
use std::sync::Arc;

/// The surface of some rows of a body, all alike.
#[derive(Debug, Clone)]
pub struct BodySurface {
    /// The rows.
    pub rows: Vec<BodyRow>,
    /// The surface in the axes of a row, about its centre of mass; it has no motion of its own.
    pub solid: Arc<Collider>,
    /// Greatest distance of the surface from the centre of mass [m].
    pub reach: f64,
    /// The volume within [m³].
    pub volume: f64,
}

impl PartialEq for BodySurface {
    fn eq(&self, other: &Self) -> bool {
        self.rows == other.rows && Arc::ptr_eq(&self.solid, &other.solid)
    }
}
