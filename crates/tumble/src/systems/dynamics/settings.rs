//! How a system of masses steps.

use crate::forces::Gravity;
use crate::geometry::Collider;
use std::sync::Arc;
use tumble_interface::scene::{Adaptive, Integrator, PositionBased, SelfContact, Solver};

/// How an exchange interval is divided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stepping {
    /// Into this many equal sub-steps.
    Substeps(u32),
    /// Into equal sub-steps no longer than this [s].
    Step(f64),
    /// Into as many as 0.7 of the stability limit asks for.
    Automatic,
}

/// Settings of a system.
pub struct Settings {
    /// Name in the scene.
    pub name: String,
    /// Length of an exchange interval [s].
    pub interval: f64,
    /// Scheme.
    pub integrator: Integrator,
    /// Division of the exchange interval.
    pub stepping: Stepping,
    /// Of the adaptive schemes.
    pub adaptive: Adaptive,
    /// Of the implicit schemes.
    pub solver: Solver,
    /// Of position-based dynamics.
    pub sweeps: PositionBased,
    /// Contact of surfaces with each other.
    pub self_contact: Option<SelfContact>,
    /// Whether intersections of surfaces are counted without it, too.
    pub counted: bool,
    /// Springs longer than this many times their rest length are shortened.
    pub clamp: Option<f64>,
    /// Gravity [m/s²].
    pub gravity: Gravity,
    /// Whether forces between all masses may use the fastest arithmetic of the machine.
    pub native: bool,
    /// Solids.
    pub colliders: Arc<Vec<Collider>>,
}
