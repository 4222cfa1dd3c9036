//! Fire: fuel that the fluid carries burns where it is hot, which warms, makes soot and takes room; and heat that radiates away.
//!
//!   df/dt = -f/tau - f S,   dT/dt = w f/tau,   ds/dt = soot f/tau - s S,   div u = S = e f/tau        where T > ignition   (fire.1)
//!   d(T - T0)/dt = -r ((T - T0)/1000 K)^4                                                                      (fire.4)
//!
//! Both are solved exactly over a step, cell by cell. Sources: [feldman2003] (fuel, soot, divergence), [nguyen2002] (radiation).
//! Tests: crates/tumble-f64/tests/fire.rs. Limits: nothing asks for oxygen; without an open side there is no room to take.

use crate::fluids::Failure;
use crate::fluids::rows::sum;
use crate::math::{Real, functions};
use crate::operators::{each_row, each_row_of};
use crate::state::{Field, Grid, Place};

/// Difference from the ambient temperature at which the rate of radiation is given [K].
const HOT: f64 = 1000.0;

/// How fuel burns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fire {
    /// Temperature above which it does [K].
    pub ignition: f64,
    /// Time in which it burns down to 1/e [s].
    pub burn_time: f64,
    /// Warming of the fluid by a density of fuel [K m³/kg].
    pub warming: f64,
    /// Share that becomes smoke.
    pub soot: f64,
    /// Volume that the fluid grows by [m³/kg].
    pub expansion: f64,
}

/// Content of a cell: fuel, smoke [kg/m³].
#[derive(Debug, Clone, Copy, PartialEq)]
struct Burnt {
    fuel: f64,
    smoke: f64,
    /// Warming [K].
    warming: f64,
    /// Logarithm of the growth of its volume.
    growth: f64,
}

impl Fire {
    /// Burns for a time of which exp(-time/tau) is left.                                                  (fire.2)
    fn burn(&self, fuel: f64, smoke: f64, left: f64) -> Burnt {
        let soot = self.soot * fuel * (1.0 - left);
        if self.expansion == 0.0 {
            let after = fuel * left;
            return Burnt { fuel: after, smoke: smoke + soot, warming: self.warming * (fuel - after), growth: 0.0 };
        }
        let g = self.expansion * fuel;
        let part = g * left / (1.0 + g);
        let after = part / (1.0 - part);
        let volume = (1.0 + g) / (1.0 + after);
        // ln(1 + x) in a form that keeps its digits where x is small.
        let x = (g - after) / (1.0 + after);
        let growth = if x < 1e-5 { x * (1.0 - 0.5 * x * (1.0 - x * (2.0 / 3.0))) } else { functions::ln(volume) };
        Burnt { fuel: after / self.expansion, smoke: (smoke + soot) / volume, warming: self.warming * growth / self.expansion, growth }
    }
}

/// Fuel in a fluid, and what it did in the last step.
pub struct Flame {
    /// How it burns.
    pub fire: Fire,
    /// Fuel at cells [kg/m³].
    pub fuel: Field,
    /// Growth of volume S at cells [1/s].
    pub(super) swelling: Field,
    /// Sum of T - T0 over the cells at the start, and all that came in since [K].
    pub(super) heat: [f64; 2],
}

impl Flame {
    /// Of a fuel, in a fluid of this temperature.
    pub fn new(fire: Fire, fuel: Field, grid: Grid, temperature: Option<&Field>, ambient: f64) -> Result<Self, Failure> {
        let swelling = Field::new(grid, Place::Cell, "1/s")?;
        let start = temperature.map_or(0.0, |warmth| excess(warmth, ambient));
        Ok(Self { fire, fuel, swelling, heat: [start, 0.0] })
    }

    /// Burns for h seconds; `warmth` and `smoke` are those of the fluid.                                  (fire.1)
    pub(super) fn burn(&mut self, warmth: &mut Field, smoke: Option<&mut Field>, ambient: f64, h: f64) {
        let Self { fire, fuel, swelling, heat } = self;
        let left = functions::exp(-h / fire.burn_time);
        let ignition = fire.ignition as Real;
        let mut fields = vec![&mut *fuel, &mut *warmth, &mut *swelling];
        fields.extend(smoke);
        each_row_of(&mut fields, |_, _, rows| {
            let [fuel, warmth, swelling, smoke @ ..] = rows else { return };
            for i in 0..fuel.len() {
                swelling[i] = 0.0;
                if fuel[i] > 0.0 && warmth[i] > ignition {
                    let before = smoke.first().map_or(0.0, |smoke| f64::from(smoke[i]));
                    let burnt = fire.burn(f64::from(fuel[i]), before, left);
                    fuel[i] = burnt.fuel as Real;
                    warmth[i] += burnt.warming as Real;
                    swelling[i] = (burnt.growth / h) as Real;
                    smoke.iter_mut().for_each(|smoke| smoke[i] = burnt.smoke as Real);
                }
            }
        });
        if fire.expansion > 0.0 {
            // A volume that grows at a temperature holds more.
            let more = |at: usize, n: usize| {
                let one = |i: usize| f64::from(swelling.data[i]) * (f64::from(warmth.data[i]) - ambient);
                (at..at + n).map(one).sum()
            };
            heat[1] += h * sum(swelling, more);
        }
    }
}

/// The sum of T - ambient over the cells [K].
pub(super) fn excess(warmth: &Field, ambient: f64) -> f64 {
    sum(warmth, |at, n| warmth.data[at..at + n].iter().map(|t| f64::from(*t) - ambient).sum())
}

/// Radiates for h seconds at `rate` [K/s] where T - T0 is 1000 K; what is colder than T0 stays.                 (fire.5)
pub(super) fn radiate(warmth: &mut Field, ambient: f64, rate: f64, h: f64) {
    let (around, scale) = (ambient as Real, 3.0 * h * rate / HOT);
    each_row(warmth, |_, _, row| {
        for t in row.iter_mut().filter(|t| **t > around) {
            let above = f64::from(*t) - ambient;
            let part = above / HOT;
            *t = (ambient + above * functions::pow(1.0 + scale * part * part * part, -1.0 / 3.0)) as Real;
        }
    });
}
