//! Regions that give smoke, heat, fuel and velocity to a fluid.

use crate::geometry::Collider;
use crate::math::{Real, Signal, VectorSignal};
use crate::state::{Grid, Place};

/// A region that gives smoke, warmth and velocity to the fluid in it.
#[derive(Debug, Clone)]
pub struct Source {
    /// Smoke given off [kg/(m³ s)].
    pub smoke: Signal,
    /// Smoke held [kg/m³].
    pub density: Option<Signal>,
    /// Temperature held [K].
    pub temperature: Option<Signal>,
    /// Warming [K/s].
    pub heating: Signal,
    /// Fuel given off [kg/(m³ s)].
    pub fuel: Signal,
    /// Fuel held [kg/m³].
    pub fuel_density: Option<Signal>,
    /// Velocity given [m/s].
    pub velocity: Option<VectorSignal>,
    /// When it works [s].
    pub times: [f64; 2],
    /// Which points it covers, and how much of each: those of cells, then those of the faces of each axis.
    pub covers: Vec<Cover>,
}

/// Points of one place, and the share of each that is covered.
#[derive(Debug, Clone)]
pub struct Cover {
    place: Place,
    points: Vec<(usize, Real)>,
}

impl Source {
    /// The same where a region covers the points of a grid: wholly half a cell inside, not at all half a cell outside.
    pub fn covering(mut self, region: &Collider, grid: &Grid) -> Self {
        let places = std::iter::once(Place::Cell).chain(grid.axes().map(Place::Face));
        self.covers = places
            .map(|place| {
                let [x, y, z] = grid.points(place);
                let all = (0..z).flat_map(|k| (0..y).flat_map(move |j| (0..x).map(move |i| [i, j, k])));
                let share = |at: [usize; 3]| (0.5 - region.distance(grid.point(place, at).into(), 0.0, grid.dx).0 / grid.dx).min(1.0);
                let lattice = grid.lattice();
                let points = all.map(|at| (lattice.at(at[0], at[1], at[2]), share(at) as Real)).filter(|(_, share)| *share > 0.0);
                Cover { place, points: points.collect() }
            })
            .collect();
        self
    }

    /// Whether it covers no point.
    pub fn is_empty(&self) -> bool {
        self.covers.iter().all(|cover| cover.points.is_empty())
    }

    /// The points of a place that it covers.
    pub(super) fn cover(&self, place: Place) -> &[(usize, Real)] {
        self.covers.iter().find(|c| c.place == place).map_or(&[], |c| &c.points)
    }
}
