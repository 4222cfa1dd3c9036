//! Constant settings of a fluid.

use super::fire::Fire;
use super::sources::Source;
use crate::fluids::Beyond;
use crate::linalg::poisson::Params;
use crate::math::VectorSignal;
use crate::operators::Advection;
use tumble_interface::scene::{OnFailure, Order, Viscous};

/// Constant settings of a fluid.
pub struct Settings {
    /// Density [kg/m³].
    pub density: f64,
    /// Dynamic viscosity [Pa s].
    pub viscosity: f64,
    /// How it is stepped.
    pub viscous: Viscous,
    /// The lower and the upper side of each axis.
    pub sides: [[Beyond; 2]; 3],
    /// Gravity [m/s²], in the plane.
    pub gravity: [f64; 3],
    /// Acceleration [m/s²] by time and place.
    pub acceleration: VectorSignal,
    /// Diffusivity of smoke and of warmth [m²/s].
    pub diffusivity: [f64; 2],
    /// Rate at which smoke vanishes [1/s].
    pub dissipation: f64,
    /// Share of its weight that smoke has.
    pub weight: f64,
    /// Temperature without buoyancy [K].
    pub ambient: f64,
    /// Rate at which differences of temperature vanish [1/s].
    pub cooling: f64,
    /// Radiation where the fluid is 1000 K above ambient [K/s].
    pub radiation: f64,
    /// Heat capacity [J/(kg K)].
    pub specific_heat: f64,
    /// Growth of a volume with temperature [1/K].
    pub expansion: f64,
    /// Whether differences of density have inertia.
    pub variable: bool,
    /// How fuel burns.
    pub fire: Option<Fire>,
    /// Sources of smoke, heat and velocity.
    pub sources: Vec<Source>,
    /// Vorticity confinement [1].
    pub confinement: f64,
    /// Order of the parts of a step.
    pub order: Order,
    /// How the velocity is carried.
    pub velocity: Advection,
    /// How smoke and warmth are carried.
    pub scalars: Advection,
    /// Whether they are carried by fluxes through faces instead.
    pub conservative: bool,
    /// The pressure solver; its target is the tolerance.
    pub pressure: Params,
    /// Largest |div u| dx over the fastest velocity.
    pub tolerance: f64,
    /// Behaviour if it is not met.
    pub on_failure: OnFailure,
    /// Cells that the fastest fluid passes in a sub-step.
    pub courant: f64,
}
