//! The pressure in liquids of particles, and their forces on solids: means over the exchange interval so far.
//!
//!   p = sum of h p_h / sum of h,   F = sum of J / sum of h                                            (liquids.8, liquids.9)
//!
//! over its sub-steps, J being the impulses of the liquid behind walls, and of contact with solids. Verified in `tests/liquid_loads.rs`.

use super::core::Core;
use super::feature::{Feature, Span};
use crate::elements::Density;
use crate::geometry::Vector;
use crate::math::Real;
use crate::math::parallel::chunks;
use crate::system::{Archive, Part};
use std::ops::Range;
use tumble_interface::engine::StepReport;

/// Sums over the interval so far; empty without liquids.
#[derive(Default)]
pub struct LiquidLoads {
    /// Its length [s].
    time: f64,
    /// Impulses on every solid [N s].
    impulses: Vec<Vector>,
    /// Of each liquid, pressure times time of its particles [Pa s].
    pressures: Vec<Vec<Real>>,
}

impl LiquidLoads {
    /// The force on a solid [N].
    pub fn force(&self, solid: usize) -> Vector {
        let sum = self.impulses.get(solid).copied().unwrap_or_default();
        if self.time > 0.0 { sum * (1.0 / self.time) } else { Vector::default() }
    }

    /// Pressures of the particles in these rows, if they are a liquid [Pa].
    pub fn pressure(&self, core: &Core, rows: &Range<usize>) -> Option<Vec<Real>> {
        let (_, sums) = core.liquids().zip(&self.pressures).find(|(liquid, _)| liquid.rows() == *rows)?;
        let scale = if self.time > 0.0 { 1.0 / self.time } else { 0.0 };
        Some(sums.iter().map(|sum| (f64::from(*sum) * scale) as Real).collect())
    }

    /// Empties the sums of these liquids and solids.
    pub fn clear(&mut self, core: &Core) {
        if is_idle(core) {
            return;
        }
        self.time = 0.0;
        self.impulses = vec![Vector::default(); core.laws.colliders.len()];
        self.pressures = core.liquids().map(|liquid| vec![0.0; liquid.rows().len()]).collect();
    }
}

/// Whether there is nothing to sum.
fn is_idle(core: &Core) -> bool {
    core.liquids().next().is_none()
}

impl Feature for LiquidLoads {
    fn begin(&mut self, core: &mut Core, _t: f64) {
        self.clear(core);
    }

    fn after(&mut self, core: &mut Core, Span { h, .. }: Span, _report: &mut StepReport) {
        if is_idle(core) {
            return;
        }
        self.time += h;
        let pushes = core.liquids().map(Density::pushes).chain([&core.pushes[..]]);
        for pushes in pushes {
            self.impulses.iter_mut().zip(pushes).for_each(|(sum, push)| *sum = *sum + *push);
        }
        for (liquid, sums) in core.liquids().zip(&mut self.pressures) {
            chunks(sums, |start, sums| {
                sums.iter_mut().enumerate().for_each(|(i, sum)| *sum += (h * liquid.pressure(start + i, h)) as Real);
            });
        }
    }

    fn save(&self, core: &Core, archive: &mut Archive) {
        if !is_idle(core) {
            let numbers = [self.time].into_iter().chain(self.impulses.iter().flat_map(|j| <[f64; 3]>::from(*j)));
            archive.push("liquid loads", Part::Numbers(numbers.collect()));
            self.pressures.iter().for_each(|sums| archive.push_numbers("pressure", sums));
        }
    }

    fn restore(&mut self, core: &mut Core, archive: &mut Archive) -> Option<()> {
        if is_idle(core) {
            return Some(());
        }
        let numbers = archive.numbers("liquid loads")?;
        let (time, impulses) = numbers.split_first()?;
        self.clear(core);
        self.time = *time;
        self.impulses = impulses.chunks_exact(3).map(|j| Vector { x: j[0], y: j[1], z: j[2] }).collect();
        self.pressures.iter_mut().try_for_each(|sums| archive.column("pressure", sums))
    }
}
