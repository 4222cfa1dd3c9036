//! Boundary conditions of a box for velocities, pressure and advected fields.

use crate::linalg::poisson;
use crate::math::{Real, Vec3, VectorSignal};
use crate::state::{Field, Place, Side, Vectors};

/// Boundary condition of a side.
#[derive(Debug, Clone, Default)]
pub enum Beyond {
    /// A wall along which the fluid slips.
    #[default]
    FreeSlip,
    /// A wall to which the fluid sticks, with its velocity [m/s] along itself.
    NoSlip(VectorSignal),
    /// Pressure zero.
    Open,
    /// The opposite side.
    Periodic,
    /// A given velocity [m/s], which may depend on the place.
    Inflow {
        /// The velocity.
        velocity: VectorSignal,
        /// What comes in with it, by the names and in the units of its columns.
        carried: Vec<(&'static str, f64)>,
    },
}

impl Beyond {
    /// Its condition for the pressure.
    pub fn pressure(&self) -> poisson::Side {
        match self {
            Self::Open => poisson::Side::Open,
            Self::Periodic => poisson::Side::Periodic,
            _ => poisson::Side::Closed,
        }
    }

    /// Which sides are open.
    pub fn open(sides: &[[Self; 2]; 3]) -> [[bool; 2]; 3] {
        sides.each_ref().map(|ends| ends.each_ref().map(|side| matches!(side, Self::Open)))
    }

    /// Whether the velocity across it is given.
    pub fn is_held(&self) -> bool {
        !matches!(self, Self::Open | Self::Periodic)
    }

    /// Its condition for an advected quantity, which is `ambient` outside.
    pub fn carried(&self, quantity: &str, ambient: f64) -> Side {
        match self {
            Self::Open => Side::Ghost(ambient),
            Self::Inflow { carried, .. } => {
                Side::Ghost(carried.iter().find(|(name, _)| *name == quantity).map_or(ambient, |(_, value)| *value))
            }
            _ => Side::Closed,
        }
    }

    /// Its condition for the velocity component along an axis, at the centre of the side.
    fn component(&self, t: f64, middle: Vec3<f64>, axis: usize) -> Side {
        let part = |v: &VectorSignal| <[f64; 3]>::from(v.at(t, middle, [0.0; 3].into()))[axis];
        match self {
            Self::FreeSlip | Self::Open | Self::Periodic => Side::Closed,
            Self::NoSlip(velocity) | Self::Inflow { velocity, .. } => Side::Value(part(velocity)),
        }
    }

    /// The velocity across the side at a place [m/s].
    fn across(&self, t: f64, x: [f64; 3], axis: usize) -> f64 {
        match self {
            Self::Inflow { velocity, .. } => <[f64; 3]>::from(velocity.at(t, x.into(), [0.0; 3].into()))[axis],
            _ => 0.0,
        }
    }
}

/// Sets the velocity on the sides of the box, and what lies beyond them, for time t [s].
pub fn hold(u: &mut Vectors, beyond: &[[Beyond; 2]; 3], t: f64) {
    for part in &mut u.parts {
        let Place::Face(own) = part.place else { continue };
        let grid = part.grid;
        for axis in grid.axes().filter(|a| !grid.periodic[*a]) {
            for end in 0..2 {
                let side = &beyond[axis][end];
                let middle = std::array::from_fn(|a| {
                    let way = if a == axis { end as f64 } else { 0.5 };
                    grid.origin[a] + if grid.flat == Some(a) { 0.0 } else { way * grid.n[a] as f64 * grid.dx }
                });
                part.sides[axis][end] = side.component(t, Vec3::from(middle), own);
                if axis == own && side.is_held() {
                    part.sides[axis][end] = Side::Value(side.across(t, middle, own));
                    set_wall(part, axis, end * grid.n[axis], |x| side.across(t, x, own));
                }
            }
        }
    }
}

/// Sets a plane of faces across their axis.
pub fn set_wall(part: &mut Field, axis: usize, index: usize, value: impl Fn([f64; 3]) -> f64) {
    let mut points = part.points();
    points[axis] = 1;
    for k in 0..points[2] {
        for j in 0..points[1] {
            for i in 0..points[0] {
                let mut at = [i, j, k];
                at[axis] = index;
                let n = part.index(at);
                part.data[n] = value(part.grid.point(part.place, at)) as Real;
            }
        }
    }
}
