//! A plan with the ways across it, and which of its gates are open when.

use super::plan::{Plan, Point, middle};
use super::way::{Cells, Grid, Target, Way};

/// How far from a gate people are near it [m].
pub const NEAR: f64 = 1.0;

/// A plan at a time, with the ways across it.
pub struct Floor {
    /// Walls and gates; closed ones are walls.
    pub plan: Plan,
    /// Floor [m²] on both sides of each gate.
    pub areas: Vec<[f64; 2]>,
    /// The plan with all gates open.
    open: Plan,
    /// Which gates are closed.
    closed: Vec<bool>,
    /// Cells in which bodies rest, in order.
    blocked: Vec<u32>,
    /// What each way leads to.
    targets: Vec<Vec<Target>>,
    ways: Vec<Way>,
    /// Distance of the middle of each gate to the end of each way [m].
    gates: Vec<Vec<f64>>,
    /// Side of a cell, and the largest radius of a body [m].
    sizes: [f64; 2],
}

impl Floor {
    /// The floor at t = 0 with ways to these targets, in cells of this side [m], for bodies of up to this radius [m].
    pub fn new(plan: Plan, targets: Vec<Vec<Target>>, side: f64, radius: f64) -> Self {
        let mut cells = Cells::new(&plan, side, radius);
        let areas = plan.gates.iter().map(|gate| cells.floor(&plan, gate, NEAR)).collect();
        let closed: Vec<bool> = plan.gates.iter().map(|gate| gate.is_closed(0.0)).collect();
        let (ways, gates) = (Vec::new(), Vec::new());
        let blocked = Vec::new();
        let mut floor = Self { plan: plan.clone(), areas, open: plan, closed, blocked, targets, ways, gates, sizes: [side, radius] };
        if floor.closed.contains(&true) {
            floor.replan();
        } else {
            floor.find_ways(cells);
        }
        floor
    }

    /// Opens and closes gates as they are at t [s]; whether one of them changed.
    pub fn keep_hours(&mut self, t: f64) -> bool {
        let same = self.open.gates.iter().zip(&self.closed).all(|(gate, closed)| gate.is_closed(t) == *closed);
        if !same {
            self.closed = self.open.gates.iter().map(|gate| gate.is_closed(t)).collect();
            self.replan();
        }
        !same
    }

    /// Closes these cells, in order, and opens all others; whether one of them changed.
    pub fn close(&mut self, cells: Vec<u32>) -> bool {
        let same = cells == self.blocked;
        if !same {
            self.blocked = cells;
            self.replan();
        }
        !same
    }

    /// Cells that are closed.
    pub fn blocked(&self) -> &[u32] {
        &self.blocked
    }

    /// The largest radius of a body [m].
    pub fn radius(&self) -> f64 {
        self.sizes[1]
    }

    /// Side of a cell [m].
    pub fn side(&self) -> f64 {
        self.sizes[0]
    }

    /// The middle of a cell.
    pub fn middle(&self, cell: u32) -> Point {
        Grid::of(&self.open, self.sizes[0]).middle(cell as usize)
    }

    /// Cells in the square around a place.
    pub fn cells_around(&self, x: Point, far: f64) -> impl Iterator<Item = u32> {
        Grid::of(&self.open, self.sizes[0]).around([x, x], far).map(|cell| cell as u32)
    }

    /// How many cells there are.
    pub fn cells(&self) -> usize {
        Grid::of(&self.open, self.sizes[0]).count()
    }

    /// Middles of lines of links that people get to from both sides, given where they start and areas to which they come.
    pub fn both_sides(&self, starts: &[Point], areas: &[&[Point]]) -> Vec<Point> {
        Cells::new(&self.open, self.sizes[0], self.sizes[1]).both_sides(&self.open, starts, areas)
    }

    /// A plan on which the closed gates are walls, and the ways across it.
    fn replan(&mut self) {
        self.plan = self.open.with_closed(&self.closed);
        let mut cells = Cells::new(&self.plan, self.sizes[0], self.sizes[1]);
        self.blocked.iter().for_each(|cell| cells.block(*cell as usize));
        self.find_ways(cells);
    }

    fn find_ways(&mut self, mut cells: Cells) {
        let (plan, radius) = (&self.plan, self.sizes[1]);
        self.ways = self.targets.iter().map(|targets| Way::new(plan, &mut cells, targets, radius)).collect();
        self.gates = self.ways.iter().map(|way| plan.gates.iter().map(|gate| way.distance(middle(gate.line))).collect()).collect();
    }

    /// How many ways there are.
    pub fn count(&self) -> usize {
        self.ways.len()
    }

    /// A way by its number.
    pub fn way(&self, way: u32) -> &Way {
        &self.ways[way as usize]
    }

    /// Distance of a gate to the end of a way [m].
    pub fn gate(&self, way: u32, gate: usize) -> f64 {
        self.gates[way as usize][gate]
    }
}
