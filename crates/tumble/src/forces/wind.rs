//! Resistance of air that moves.

use super::push::derivatives;
use super::{Flow, Force, Group, Medium, One};
use crate::elements::Block;
use crate::math::{Row, ZERO, sub};

/// f = -(k_d + c |v - u|) (v - u), the drag of (particles.3) in air of velocity u(x, t).      (particles.4)
pub struct Wind {
    /// The resistance.
    pub drag: Medium,
    /// The air.
    pub air: Flow,
}

/// Masses at a time.
const BLOCK: usize = 128;

impl Force for Wind {
    fn add(&self, t: f64, group: Group<'_>, force: &mut [Row]) {
        let (mut relative, drag) = ([ZERO; BLOCK], self.drag.at(t));
        for (b, force) in force.chunks_mut(BLOCK).enumerate() {
            let here = group.part(b * BLOCK..b * BLOCK + force.len());
            let relative = &mut relative[..force.len()];
            self.air.velocities(t, here.x, relative);
            for (u, v) in relative.iter_mut().zip(here.v) {
                *u = sub(*v, *u);
            }
            drag.add(Group { v: relative, ..here }, force);
        }
    }

    /// How the air differs from place to place is left out.
    fn matrix(&self, t: f64, one: &One) -> (Block, Block) {
        derivatives(&self.drag.at(t), one.mass, &One { v: one.v - self.air.at(t, one.x), ..*one })
    }

    fn largest_matrix(&self, one: &One) -> (Block, Block) {
        derivatives(&self.drag.largest, one.mass, &One { v: one.v - self.air.at(0.0, one.x), ..*one })
    }
}
