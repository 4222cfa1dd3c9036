//! The shortest way: geodesic distance to the nearest of some exits, around walls that are kept at a distance, and what follows from it.
//!
//!   |grad phi| = 1, phi = 0 at exits                                                                              (crowds.1)
//!
//! by fast sweeping, which visits cells in a fixed order. Source: [zhao2005].

use super::plan::{Gate, Line, MARGIN, Plan, Point, along, length, meets, nearest, sub};

/// A link between cells that a wall crosses.
const WALL: u32 = u32::MAX;
/// No gate.
pub const NONE: u32 = u32::MAX - 1;
/// Over how many cells around an exit distances are exact.
const EXACT: f64 = 3.0;
/// Rounds of four sweeps, at most: each turn of a way takes one.
const ROUNDS: usize = 1000;
/// How much farther a metre is where bodies do not fit.
const BAND: f64 = 3.0;

/// Cells over a plan, and what is between them.
pub struct Cells {
    origin: Point,
    /// Side of a cell [m].
    pub side: f64,
    n: [usize; 2],
    /// Whether the middle of a body may be there.
    open: Vec<bool>,
    /// What the link to the next cell along x and along y crosses: a gate, a wall, or `NONE`.
    links: [Vec<u32>; 2],
}

impl Cells {
    /// Cells of this side [m], for bodies of this radius [m].
    pub fn new(plan: &Plan, side: f64, radius: f64) -> Self {
        let origin = [plan.low[0] - MARGIN, plan.low[1] - MARGIN];
        let n = [0, 1].map(|a| ((plan.high[a] - plan.low[a] + 2.0 * MARGIN) / side).ceil() as usize + 1);
        let all = n[0] * n[1];
        let mut cells = Self { origin, side, n, open: vec![true; all], links: [vec![NONE; all], vec![NONE; all]] };
        for (g, gate) in plan.gates.iter().enumerate() {
            cells.cut(gate.line, g as u32);
        }
        for wall in &plan.walls {
            cells.cut(*wall, WALL);
            cells.around(*wall, radius, |cells, i, x| {
                if length(sub(x, nearest(*wall, x))) < radius - 0.5 * side {
                    cells.open[i] = false;
                }
            });
        }
        cells
    }

    /// The middle of a cell.
    pub fn middle(&self, i: usize) -> Point {
        along(self.origin, self.side, [(i % self.n[0]) as f64 + 0.5, (i / self.n[0]) as f64 + 0.5])
    }

    /// Calls `f` for each cell in the box around a line, and so far around.
    fn around(&mut self, line: Line, far: f64, mut f: impl FnMut(&mut Self, usize, Point)) {
        let range = |a: usize| {
            let (low, high) = (line[0][a].min(line[1][a]) - far, line[0][a].max(line[1][a]) + far);
            let at = |x: f64| ((x - self.origin[a]) / self.side).floor().clamp(0.0, (self.n[a] - 1) as f64) as usize;
            at(low - self.side)..=at(high + self.side)
        };
        let (xs, ys) = (range(0), range(1));
        for y in ys {
            for x in xs.clone() {
                let i = x + y * self.n[0];
                let middle = self.middle(i);
                f(self, i, middle);
            }
        }
    }

    /// Marks the links that a line crosses.
    fn cut(&mut self, line: Line, mark: u32) {
        self.around(line, 0.0, |cells, i, x| {
            for (a, step) in [[cells.side, 0.0], [0.0, cells.side]].into_iter().enumerate() {
                if meets(line, x, [x[0] + step[0], x[1] + step[1]]) {
                    cells.links[a][i] = mark;
                }
            }
        });
    }

    /// The neighbour of a cell along an axis, ahead or behind, and what is between them; none beyond a wall.
    fn neighbour(&self, i: usize, a: usize, ahead: bool) -> Option<(usize, u32)> {
        let at = if a == 0 { i % self.n[0] } else { i / self.n[0] };
        let stride = if a == 0 { 1 } else { self.n[0] };
        let (j, link) = match ahead {
            true if at + 1 < self.n[a] => (i + stride, self.links[a][i]),
            false if at > 0 => (i - stride, self.links[a][i - stride]),
            _ => return None,
        };
        (link != WALL).then_some((j, link))
    }

    /// All four of them.
    fn neighbours(&self, i: usize) -> impl Iterator<Item = (usize, u32)> {
        [(0, false), (0, true), (1, false), (1, true)].into_iter().filter_map(move |(a, ahead)| self.neighbour(i, a, ahead))
    }

    /// Floor [m²] within `far` of a gate and in sight of it, to its left and to its right.
    pub fn floor(&mut self, plan: &Plan, gate: &Gate, far: f64) -> [f64; 2] {
        let mut areas = [0.0; 2];
        self.around(gate.line, far, |cells, _, x| {
            if let Some(side) = in_sight(plan, gate, x, far) {
                areas[side] += cells.side * cells.side;
            }
        });
        areas
    }
}

/// The side of a gate, 0 to the left, of a place within `far` and in sight of it.
pub fn in_sight(plan: &Plan, gate: &Gate, x: Point, far: f64) -> Option<usize> {
    let foot = nearest(gate.line, x);
    let d = sub(x, foot);
    if length(d) > far {
        return None;
    }
    // A jamb is no obstacle: the foot lies a little inside the opening.
    let middle = [0, 1].map(|a| 0.5 * (gate.line[0][a] + gate.line[1][a]));
    let foot = along(foot, 1e-3, sub(middle, foot));
    let left = super::plan::cross(sub(gate.line[1], gate.line[0]), sub(x, gate.line[0])) >= 0.0;
    plan.sees(plan.near(x), x, foot).then_some(usize::from(!left))
}

/// Distance, direction and next gate at every place.
pub struct Way {
    origin: Point,
    side: f64,
    n: [usize; 2],
    /// Distance to the exit [m]; infinite where there is no way.
    phi: Vec<f64>,
    /// Unit vector down the gradient.
    down: Vec<[f32; 2]>,
    /// The first gate on the way; `NONE` where there is none.
    next: Vec<u32>,
}

impl Way {
    /// The way to the nearest of these exits, for bodies of this radius [m].
    pub fn new(plan: &Plan, cells: &mut Cells, exits: &[usize], radius: f64) -> Self {
        let all = cells.open.len();
        let mut way = Self {
            origin: cells.origin,
            side: cells.side,
            n: cells.n,
            phi: vec![f64::INFINITY; all],
            down: vec![[0.0; 2]; all],
            next: vec![NONE; all],
        };
        let mut exact = vec![false; all];
        for &g in exits {
            let [a, b] = plan.gates[g].line;
            let inner = (radius / length(sub(b, a))).min(0.5);
            let line = [along(a, inner, sub(b, a)), along(b, inner, sub(a, b))];
            let far = EXACT * cells.side;
            cells.around(line, far, |cells, i, x| {
                let foot = nearest(line, x);
                let d = length(sub(x, foot));
                if cells.open[i] && d <= far && d < way.phi[i] && plan.sees(plan.near(x), x, foot) {
                    (way.phi[i], way.next[i], exact[i]) = (d, g as u32, true);
                }
            });
        }
        way.sweep(cells, &exact);
        way.widen(cells, radius);
        way.descend(cells);
        way.name_gates(cells, &exact);
        way
    }

    /// Solves (crowds.1) in open cells.
    fn sweep(&mut self, cells: &Cells, exact: &[bool]) {
        let [nx, ny] = self.n;
        for _ in 0..ROUNDS {
            let mut changed = false;
            for order in 0..4 {
                for y in 0..ny {
                    let y = if order & 2 == 0 { y } else { ny - 1 - y };
                    for x in 0..nx {
                        let i = if order & 1 == 0 { x } else { nx - 1 - x } + y * nx;
                        if exact[i] || !cells.open[i] {
                            continue;
                        }
                        let at = |a, ahead| cells.neighbour(i, a, ahead).map_or(f64::INFINITY, |(j, _)| self.phi[j]);
                        let [a, b] = [0, 1].map(|a| at(a, false).min(at(a, true)));
                        if a.min(b) == f64::INFINITY {
                            continue;
                        }
                        let h = self.side;
                        let phi = if (a - b).abs() >= h { a.min(b) + h } else { 0.5 * (a + b + (2.0 * h * h - (a - b) * (a - b)).sqrt()) };
                        if phi < self.phi[i] {
                            self.phi[i] = phi;
                            changed = true;
                        }
                    }
                }
            }
            if !changed {
                break;
            }
        }
    }

    /// Continues the distance to where bodies do not fit, so that whoever is smaller finds back.
    fn widen(&mut self, cells: &Cells, radius: f64) {
        for _ in 0..(radius / self.side).ceil() as usize + 1 {
            let before = self.phi.clone();
            for i in (0..before.len()).filter(|i| before[*i] == f64::INFINITY && !cells.open[*i]) {
                self.phi[i] = cells.neighbours(i).map(|(j, _)| before[j] + BAND * self.side).fold(f64::INFINITY, f64::min);
            }
        }
    }

    /// Directions down the gradient, by central differences, at walls by one-sided ones.
    fn descend(&mut self, cells: &Cells) {
        for i in (0..self.phi.len()).filter(|i| self.phi[*i] < f64::INFINITY) {
            let slope = |a: usize| {
                let at = |ahead| cells.neighbour(i, a, ahead).map(|(j, _)| self.phi[j]).filter(|phi| phi.is_finite());
                match (at(false), at(true)) {
                    (Some(low), Some(high)) => 0.5 * (high - low),
                    (None, Some(high)) => high - self.phi[i],
                    (Some(low), None) => self.phi[i] - low,
                    (None, None) => 0.0,
                }
            };
            let g = [slope(0), slope(1)];
            let size = length(g);
            if size > 0.0 {
                self.down[i] = [(-g[0] / size) as f32, (-g[1] / size) as f32];
            }
        }
    }

    /// Names the first gate on the way from each cell, from the exits outward.
    fn name_gates(&mut self, cells: &Cells, exact: &[bool]) {
        let mut order: Vec<usize> = (0..self.phi.len()).filter(|i| self.phi[*i] < f64::INFINITY && !exact[*i]).collect();
        order.sort_by(|a, b| self.phi[*a].total_cmp(&self.phi[*b]).then(a.cmp(b)));
        for i in order {
            let lowest = cells.neighbours(i).min_by(|(a, _), (b, _)| self.phi[*a].total_cmp(&self.phi[*b]));
            if let Some((j, link)) = lowest {
                self.next[i] = if link == NONE { self.next[j] } else { link };
            }
        }
    }

    /// The four cells around a place, with their weights.
    fn around(&self, x: Point) -> [(usize, f64); 4] {
        let split = |a: usize| {
            let u = ((x[a] - self.origin[a]) / self.side - 0.5).clamp(0.0, (self.n[a] - 2) as f64);
            (u.floor() as usize, u - u.floor())
        };
        let ((i, s), (j, t)) = (split(0), split(1));
        let at = |p: usize, q: usize| i + p + (j + q) * self.n[0];
        [(at(0, 0), (1.0 - s) * (1.0 - t)), (at(1, 0), s * (1.0 - t)), (at(0, 1), (1.0 - s) * t), (at(1, 1), s * t)]
    }

    /// Distance to the exit [m]; infinite where there is no way.
    pub fn distance(&self, x: Point) -> f64 {
        let (mut sum, mut weight) = (0.0, 0.0);
        for (i, w) in self.around(x) {
            if self.phi[i] < f64::INFINITY && w > 0.0 {
                (sum, weight) = (sum + w * self.phi[i], weight + w);
            }
        }
        if weight > 0.0 { sum / weight } else { f64::INFINITY }
    }

    /// Where to go, a unit vector; zero where there is no way.
    pub fn direction(&self, x: Point) -> Point {
        let mut e = [0.0; 2];
        for (i, w) in self.around(x) {
            e = along(e, w, self.down[i].map(f64::from));
        }
        let size = length(e);
        if size > 1e-9 { e.map(|e| e / size) } else { [0.0; 2] }
    }

    /// The next gate on the way from x.
    pub fn gate(&self, x: Point) -> u32 {
        let nearest = self.around(x).into_iter().filter(|(i, _)| self.phi[*i] < f64::INFINITY).reduce(|a, b| if b.1 > a.1 { b } else { a });
        nearest.map_or(NONE, |(i, _)| self.next[i])
    }
}

/// A plan with the ways of all crowds.
pub struct Floor {
    /// Walls and gates.
    pub plan: Plan,
    /// Floor [m²] on both sides of each gate.
    pub areas: Vec<[f64; 2]>,
    ways: Vec<Way>,
    /// Which of the ways each crowd takes.
    of: Vec<usize>,
    /// Distance of the middle of each gate to the exit, for each way [m].
    gates: Vec<Vec<f64>>,
}

/// How far from a gate people are near it [m].
pub const NEAR: f64 = 1.0;

impl Floor {
    /// The floor for crowds that leave by these exits, each a sorted list of gates, with bodies of up to this radius [m].
    pub fn new(plan: Plan, exits: &[Vec<usize>], side: f64, radius: f64) -> Self {
        let mut cells = Cells::new(&plan, side, radius);
        let areas = plan.gates.iter().map(|gate| cells.floor(&plan, gate, NEAR)).collect();
        let (mut ways, mut known, mut of) = (Vec::new(), Vec::<&Vec<usize>>::new(), Vec::new());
        for exits in exits {
            let k = known.iter().position(|k| *k == exits).unwrap_or_else(|| {
                known.push(exits);
                ways.push(Way::new(&plan, &mut cells, exits, radius));
                ways.len() - 1
            });
            of.push(k);
        }
        let middle = |gate: &Gate| [0, 1].map(|a| 0.5 * (gate.line[0][a] + gate.line[1][a]));
        let gates = ways.iter().map(|way| plan.gates.iter().map(|gate| way.distance(middle(gate))).collect()).collect();
        Self { plan, areas, ways, of, gates }
    }

    /// The way of a crowd.
    pub fn way(&self, crowd: u32) -> &Way {
        &self.ways[self.of[crowd as usize]]
    }

    /// Distance of a gate to the exit of a crowd [m].
    pub fn gate(&self, crowd: u32, gate: usize) -> f64 {
        self.gates[self.of[crowd as usize]][gate]
    }
}
