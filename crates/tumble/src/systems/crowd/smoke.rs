//! Smoke among people: whoever walks in it is slower, and sees less far.
//!
//!   K = σ ρ,   v = v_0 max(1 - 0.081 m K, 0.1),   S = 3/K                                                 (crowds.15)
//!
//! with the density ρ of the smoke of a gas where the eyes are. Sources: [frantzich2003], 0.706 m/s - 0.057 m²/s K, at least a tenth; [jin1978], for
//! what is seen by the light that it reflects.

use super::plan::Point;
use crate::exchange::Exchange;
use crate::operators::sample::{Interpolation, sample};
use crate::state::Vectors;
use std::sync::Arc;

/// Height of eyes in space [m].
const EYES: f64 = 1.6;
/// How much slower people are in an extinction of 1/m, and at most.
const SLOWER: f64 = 0.057 / 0.706;
const SLOWEST: f64 = 0.1;
/// How far they see, times the extinction.
const SIGHT: f64 = 3.0;

/// Speed in smoke over that in clear air.
pub fn slowed(extinction: f64) -> f64 {
    (1.0 - SLOWER * extinction).max(SLOWEST)
}

/// How far people see [m].
pub fn sight(extinction: f64) -> f64 {
    SIGHT / extinction.max(1e-12)
}

/// The smoke of a gas.
#[derive(Debug, Clone)]
pub struct Smoke {
    /// Name of the gas.
    pub gas: String,
    /// Extinction of light by smoke of unit density [m²/kg].
    pub extinction: f64,
    /// Whether the scene is flat.
    pub flat: bool,
    /// Its density, as it was published last.
    density: Option<Arc<Vectors>>,
}

impl Smoke {
    /// The smoke of a gas, before there is any.
    pub fn new(gas: String, extinction: f64, flat: bool) -> Self {
        Self { gas, extinction, flat, density: None }
    }

    /// Takes what is published.
    pub fn take(&mut self, exchange: &Exchange) {
        self.density = exchange.field(&self.gas, "smoke").last().map(|(_, density)| density.clone());
    }

    /// Extinction at places of people [1/m]: none beyond the box of the gas.
    pub fn extinctions(&self, places: impl Iterator<Item = Point>) -> Vec<f64> {
        let eyes: Vec<[f64; 3]> = places.map(|[x, y]| [x, y, if self.flat { 0.0 } else { EYES }]).collect();
        let Some(density) = self.density.as_ref().and_then(|density| density.parts.first()) else { return Vec::new() };
        let grid = density.grid;
        let within =
            |x: &[f64; 3]| (0..3).all(|a| grid.flat == Some(a) || (0.0..=grid.n[a] as f64 * grid.dx).contains(&(x[a] - grid.origin[a])));
        let values = sample(density, &eyes, Interpolation::Linear).unwrap_or_default();
        let of = |(x, value): (&[f64; 3], crate::math::Real)| if within(x) { self.extinction * f64::from(value).max(0.0) } else { 0.0 };
        eyes.iter().zip(values).map(of).collect()
    }
}
