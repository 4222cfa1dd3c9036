//! L3: forces that act on each mass by itself or between masses, and velocity fields. One file per law.

mod acceleration;
mod air;
mod attraction;
mod cohesion;
mod direct_sum;
mod drag;
mod field;
mod flock;
mod gravity;
mod halos;
mod lennard_jones;
mod load;
mod magnetic;
mod near;
mod newtonian;
mod on_grid;
mod propulsion;
mod push;
mod repulsion;
mod row_list;
mod turbulence;
mod viscosity;
mod vortex;
mod wind;

pub use acceleration::Acceleration;
pub use air::{Air, Sails, Sheets, Threads};
pub use attraction::Attraction;
pub use cohesion::Cohesion;
pub use direct_sum::{Attractor, DirectSum};
pub use drag::{Drag, Medium};
pub use field::{Current, Flow};
pub use flock::{Flock, Goal, Habits};
pub use gravity::Gravity;
pub use halos::Halos;
pub use lennard_jones::LennardJones;
pub use load::Load;
pub use magnetic::{Electric, Magnetic};
pub use near::{Near, PairLaw};
pub use newtonian::Newtonian;
pub use on_grid::OnGrid;
pub use propulsion::Propulsion;
pub use repulsion::Repulsion;
use row_list::Rows;
pub use turbulence::Turbulence;
pub use viscosity::Viscosity;
pub use vortex::{Vortex, Whirl};
pub use wind::Wind;

use crate::elements::Block;
use crate::math::{Real, Row, Vec3, xyz64};
use crate::state::Masses;
use std::ops::Range;

/// Some masses, as columns of the same length.
#[derive(Clone, Copy)]
pub struct Group<'a> {
    /// Masses [kg].
    pub mass: &'a [Real],
    /// Charges [C]; empty where nothing is charged.
    pub charge: &'a [Real],
    /// Positions [m].
    pub x: &'a [Row],
    /// Velocities [m/s].
    pub v: &'a [Row],
}

impl<'a> Group<'a> {
    /// The rows from `start` on, of which x and v are given.
    pub fn new(masses: &'a Masses, start: usize, x: &'a [Row], v: &'a [Row]) -> Self {
        let rows = start..start + x.len();
        Self { mass: &masses.mass[rows.clone()], charge: masses.charge.get(rows).unwrap_or_default(), x, v }
    }

    /// Some of them.
    pub fn part(&self, range: Range<usize>) -> Self {
        Self {
            mass: &self.mass[range.clone()],
            charge: self.charge.get(range.clone()).unwrap_or_default(),
            x: &self.x[range.clone()],
            v: &self.v[range],
        }
    }

    /// One of them.
    pub fn one(&self, i: usize) -> One {
        One {
            mass: f64::from(self.mass[i]),
            charge: self.charge.get(i).map_or(0.0, |q| f64::from(*q)),
            x: xyz64(self.x[i]),
            v: xyz64(self.v[i]),
        }
    }
}

/// One mass, in double precision.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct One {
    /// Mass [kg].
    pub mass: f64,
    /// Charge [C].
    pub charge: f64,
    /// Position [m].
    pub x: Vec3<f64>,
    /// Velocity [m/s].
    pub v: Vec3<f64>,
}

/// A force on every mass by itself.
pub trait Force: Send + Sync {
    /// Adds the forces [N] at time t [s] on a group of masses.
    fn add(&self, t: f64, group: Group<'_>, force: &mut [Row]);

    /// Potential energy of one mass [J]; `None` for a force that has none, wherever the mass is.
    fn energy(&self, _t: f64, _one: &One) -> Option<f64> {
        None
    }

    /// Whether it brings energy that has no other books.
    fn drives(&self) -> bool {
        false
    }

    /// -df/dx [N/m] and -df/dv [N s/m] of one mass, for implicit schemes; a symmetric approximation will do.
    fn matrix(&self, t: f64, one: &One) -> (Block, Block);

    /// The same for estimates: of a force that changes in time, the largest.
    fn largest_matrix(&self, one: &One) -> (Block, Block) {
        self.matrix(0.0, one)
    }
}

/// A force in a scene of dimension 2: without what points out of the plane.
pub struct InPlane {
    /// The force.
    pub law: Box<dyn Force>,
    /// The axis across the plane.
    pub axis: usize,
}

impl Force for InPlane {
    fn add(&self, t: f64, group: Group<'_>, force: &mut [Row]) {
        self.law.add(t, group, force);
        force.iter_mut().for_each(|f| f[self.axis] = 0.0);
    }

    fn energy(&self, t: f64, one: &One) -> Option<f64> {
        self.law.energy(t, one)
    }

    fn drives(&self) -> bool {
        self.law.drives()
    }

    fn matrix(&self, t: f64, one: &One) -> (Block, Block) {
        self.law.matrix(t, one)
    }

    fn largest_matrix(&self, one: &One) -> (Block, Block) {
        self.law.largest_matrix(one)
    }
}
