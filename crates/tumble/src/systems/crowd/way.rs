//! The shortest way: geodesic distance to the nearest of some exits, around walls that are kept at a distance, and what follows from it.
//!
//!   |grad phi| = 1, phi = 0 at exits                                                                              (crowds.1)
//!
//! by fast sweeping, which visits cells in a fixed order. Source: [zhao2005]. On slopes a metre counts as much more as people are slower there.

use super::link::{Passage, is_left};
use super::plan::{Gate, Line, MARGIN, Plan, Point, Slope, along, dot, inside, length, meets, middle, nearest, sub};

/// What a way leads to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    /// A gate.
    Gate(usize),
    /// The floor within a radius [m] of a place.
    Place(Point, f64),
}

/// A link between cells that a wall crosses.
const WALL: u32 = u32::MAX;
/// No gate.
pub const NONE: u32 = u32::MAX - 1;
/// From here on links between cells that a passage crosses, by its number.
const PASSAGE: u32 = 1 << 31;
/// Over how many cells around an exit distances are exact.
const EXACT: f64 = 3.0;
/// Rounds of four sweeps, at most: each turn of a way takes one.
const ROUNDS: usize = 1000;
/// How much farther a metre is where bodies do not fit.
const BAND: f64 = 3.0;

/// Square cells over a plan.
#[derive(Debug, Clone, Copy)]
pub struct Grid {
    origin: Point,
    /// Side of a cell [m].
    side: f64,
    n: [usize; 2],
}

impl Grid {
    /// Cells of this side [m].
    pub fn of(plan: &Plan, side: f64) -> Self {
        let n = [0, 1].map(|a| ((plan.high[a] - plan.low[a] + 2.0 * MARGIN) / side).ceil() as usize + 1);
        Self { origin: [plan.low[0] - MARGIN, plan.low[1] - MARGIN], side, n }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.n[0] * self.n[1]
    }

    /// The middle of a cell.
    pub fn middle(&self, i: usize) -> Point {
        along(self.origin, self.side, [(i % self.n[0]) as f64 + 0.5, (i / self.n[0]) as f64 + 0.5])
    }

    /// Columns, rows and weights of the four cells around a place.
    fn weights(&self, x: Point) -> [([usize; 2], f64); 4] {
        let split = |a: usize| {
            let u = ((x[a] - self.origin[a]) / self.side - 0.5).clamp(0.0, (self.n[a] - 2) as f64);
            let whole = u as usize;
            (whole, u - whole as f64)
        };
        let ((i, s), (j, t)) = (split(0), split(1));
        [([i, j], (1.0 - s) * (1.0 - t)), ([i + 1, j], s * (1.0 - t)), ([i, j + 1], (1.0 - s) * t), ([i + 1, j + 1], s * t)]
    }

    /// Cells in the box around a line, and so far around.
    pub fn around(self, line: Line, far: f64) -> impl Iterator<Item = usize> {
        let range = |a: usize| {
            let (low, high) = (line[0][a].min(line[1][a]) - far, line[0][a].max(line[1][a]) + far);
            let at = |x: f64| ((x - self.origin[a]) / self.side).floor().clamp(0.0, (self.n[a] - 1) as f64) as usize;
            at(low - self.side)..=at(high + self.side)
        };
        let (xs, ys) = (range(0), range(1));
        ys.flat_map(move |y| xs.clone().map(move |x| x + y * self.n[0]))
    }
}

/// Cells over a plan, and what is between them.
pub struct Cells {
    grid: Grid,
    /// Whether the middle of a body may be there.
    open: Vec<bool>,
    /// What the link to the next cell along x and along y crosses: a gate, a passage, a wall, or `NONE`.
    links: [Vec<u32>; 2],
    /// The slope that each lies on; empty without slopes.
    slopes: Vec<Option<Slope>>,
    /// Ways through links between floors.
    passages: Vec<Passage>,
}

impl Cells {
    /// Cells of this side [m], for bodies of this radius [m].
    pub fn new(plan: &Plan, side: f64, radius: f64) -> Self {
        let grid = Grid::of(plan, side);
        let all = grid.count();
        let mut cells = Self {
            grid,
            open: vec![true; all],
            links: [vec![NONE; all], vec![NONE; all]],
            slopes: Vec::new(),
            passages: plan.passages().to_vec(),
        };
        if !plan.slopes.is_empty() {
            cells.slopes = (0..all).map(|i| plan.slope(grid.middle(i)).copied()).collect();
        }
        for (g, gate) in plan.gates.iter().enumerate() {
            cells.cut(gate.line, g as u32);
        }
        for (p, passage) in plan.passages().iter().enumerate() {
            cells.cut(passage.from, PASSAGE + p as u32);
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

    /// Closes a cell.
    pub fn block(&mut self, cell: usize) {
        self.open[cell] = false;
    }

    /// Calls `f` for each cell in the box around a line, and so far around.
    fn around(&mut self, line: Line, far: f64, mut f: impl FnMut(&mut Self, usize, Point)) {
        let grid = self.grid;
        grid.around(line, far).for_each(|i| f(self, i, grid.middle(i)));
    }

    /// Marks the links that a line crosses.
    fn cut(&mut self, line: Line, mark: u32) {
        self.around(line, 0.0, |cells, i, x| {
            for (a, step) in [[cells.grid.side, 0.0], [0.0, cells.grid.side]].into_iter().enumerate() {
                if meets(line, x, [x[0] + step[0], x[1] + step[1]]) {
                    cells.links[a][i] = mark;
                }
            }
        });
    }

    /// The neighbour of a cell along an axis, ahead or behind, and what is between them; none beyond a wall.
    fn neighbour(&self, i: usize, a: usize, ahead: bool) -> Option<(usize, u32)> {
        let at = if a == 0 { i % self.grid.n[0] } else { i / self.grid.n[0] };
        let stride = if a == 0 { 1 } else { self.grid.n[0] };
        let (j, link) = match ahead {
            true if at + 1 < self.grid.n[a] => (i + stride, self.links[a][i]),
            false if at > 0 => (i - stride, self.links[a][i - stride]),
            _ => return None,
        };
        (link != WALL).then_some((j, link))
    }

    /// The passage that a link between cells crosses.
    fn passage(&self, link: u32) -> Option<&Passage> {
        self.passages.get(link.wrapping_sub(PASSAGE) as usize)
    }

    /// What cell j beyond a passage is, as seen from its neighbour i: cells on the side that one comes to, with their weights.
    fn beyond(&self, passage: &Passage, i: usize, j: usize) -> impl Iterator<Item = (usize, f64)> {
        let x = passage.place(self.grid.middle(j));
        let (grid, to, left) = (self.grid, passage.to, !is_left(passage.from, self.grid.middle(i)));
        let weights = grid.weights(x).map(|([i, j], w)| (i + j * grid.n[0], w));
        weights.into_iter().filter(move |(j, w)| *w > 0.0 && is_left(to, grid.middle(*j)) == left)
    }

    /// All four of them.
    fn neighbours(&self, i: usize) -> impl Iterator<Item = (usize, u32)> {
        [(0, false), (0, true), (1, false), (1, true)].into_iter().filter_map(move |(a, ahead)| self.neighbour(i, a, ahead))
    }

    /// Middles of lines of links that people get to from both sides, from where they start and areas to which they come, by doors and links, but not
    /// by exits.
    pub fn both_sides(&self, plan: &Plan, starts: &[Point], areas: &[&[Point]]) -> Vec<Point> {
        let cell = |x: Point| self.grid.weights(x).into_iter().fold(([0; 2], -1.0), |a, b| if b.1 > a.1 { b } else { a }).0;
        let number = |x: Point| cell(x)[0] + cell(x)[1] * self.grid.n[0];
        let mut reached = vec![false; self.open.len()];
        let within = |i: &usize| areas.iter().any(|area| inside(area, self.grid.middle(*i)));
        let mut next: Vec<usize> = starts.iter().map(|x| number(*x)).chain((0..self.open.len()).filter(within)).collect();
        while let Some(i) = next.pop() {
            if !self.open[i] || std::mem::replace(&mut reached[i], true) {
                continue;
            }
            for (j, link) in self.neighbours(i) {
                let is_exit = plan.gates.get(link as usize).is_some_and(|gate| gate.exit);
                match self.passage(link) {
                    Some(passage) => next.extend(self.beyond(passage, i, j).map(|(j, _)| j)),
                    None if !is_exit => next.push(j),
                    None => {}
                }
            }
        }
        let is_reached = |x: Point| reached[number(x)];
        let both = |passage: &&Passage| passage.sides(1.5 * self.grid.side).into_iter().all(is_reached);
        plan.passages().iter().filter(both).map(Passage::middle).collect()
    }

    /// Floor [m²] within `far` of a gate and in sight of it, to its left and to its right.
    pub fn floor(&mut self, plan: &Plan, gate: &Gate, far: f64) -> [f64; 2] {
        let mut areas = [0.0; 2];
        self.around(gate.line, far, |cells, _, x| {
            if let Some(side) = in_sight(plan, gate, x, far) {
                areas[side] += cells.grid.side * cells.grid.side;
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
    let middle = middle(gate.line);
    let foot = along(foot, 1e-3, sub(middle, foot));
    if plan.passages_near(x).any(|passage| meets(passage.from, x, foot)) {
        return None;
    }
    let left = super::plan::cross(sub(gate.line[1], gate.line[0]), sub(x, gate.line[0])) >= 0.0;
    plan.sees_past_gates(plan.near(x), x, foot).then_some(usize::from(!left))
}

/// What a way is at the middle of a cell.
#[derive(Debug, Clone, Copy)]
struct Site {
    /// Distance to the target [m]; infinite where there is no way.
    phi: f64,
    /// Unit vector down the gradient.
    down: [f32; 2],
    /// The first gate on the way; `NONE` where there is none.
    next: u32,
    /// Whether it is beside a line of a link.
    cut: bool,
}

/// Distance, direction and next gate at every place.
pub struct Way {
    grid: Grid,
    /// Lines of links: what is beyond in the drawing is not what is beyond on the way.
    cuts: Vec<Line>,
    /// In square tiles, so that neighbours along both axes are near in memory.
    sites: Vec<Site>,
}

/// Side of a tile, in cells.
const TILE: usize = 8;

/// Where a cell is among tiles, of which so many are along x.
fn in_tiles(x: usize, y: usize, tiles: usize) -> usize {
    (x / TILE + y / TILE * tiles) * TILE * TILE + x % TILE + y % TILE * TILE
}

impl Way {
    /// The way to the nearest of these targets, for bodies of this radius [m].
    pub fn new(plan: &Plan, cells: &mut Cells, targets: &[Target], radius: f64) -> Self {
        let all = cells.open.len();
        let mut way = Solution {
            side: cells.grid.side,
            n: cells.grid.n,
            phi: vec![f64::INFINITY; all],
            next: vec![NONE; all],
            exact: vec![false; all],
        };
        for target in targets {
            way.begin(plan, cells, *target, radius);
        }
        way.sweep(cells);
        way.widen(cells, radius);
        way.name_gates(cells);
        let tiles = cells.grid.n.map(|n| n.div_ceil(TILE));
        let mut sites = vec![Site { phi: f64::INFINITY, down: [0.0; 2], next: NONE, cut: false }; tiles[0] * tiles[1] * TILE * TILE];
        for i in 0..all {
            let cut = cells.neighbours(i).any(|(_, link)| cells.passage(link).is_some());
            let site = Site { phi: way.phi[i], down: way.down(cells, i), next: way.next[i], cut };
            sites[in_tiles(i % cells.grid.n[0], i / cells.grid.n[0], tiles[0])] = site;
        }
        Self { grid: cells.grid, cuts: plan.passages().iter().map(|passage| passage.from).collect(), sites }
    }

    /// The four cells around a place, with their weights.
    fn around(&self, x: Point) -> [(Site, f64); 4] {
        let tiles = self.grid.n[0].div_ceil(TILE);
        let weights = self.grid.weights(x);
        let around = weights.map(|([i, j], w)| (self.sites[in_tiles(i, j, tiles)], w));
        if around.iter().all(|(site, _)| !site.cut) {
            return around;
        }
        // Distances go on to the place itself, and cells beyond a cut weigh nothing.
        let beside = std::array::from_fn(|k| {
            let ([i, j], w) = weights[k];
            let middle = self.grid.middle(i + j * self.grid.n[0]);
            let (mut site, _) = around[k];
            site.phi -= dot(site.down.map(f64::from), sub(x, middle));
            (site, if self.cuts.iter().any(|cut| meets(*cut, x, middle)) { 0.0 } else { w })
        });
        // On the line itself all are.
        if beside.iter().all(|(_, w)| *w == 0.0) { around } else { beside }
    }

    /// Distance to the target [m]; infinite where there is no way.
    pub fn distance(&self, x: Point) -> f64 {
        let (mut sum, mut weight) = (0.0, 0.0);
        for (site, w) in self.around(x) {
            if site.phi < f64::INFINITY && w > 0.0 {
                (sum, weight) = (sum + w * site.phi, weight + w);
            }
        }
        if weight > 0.0 { sum / weight } else { f64::INFINITY }
    }

    /// Where to go, a unit vector; zero where there is no way. And the next gate on the way.
    pub fn direction(&self, x: Point) -> (Point, u32) {
        let around = self.around(x);
        let mut e = [0.0; 2];
        for (site, w) in around {
            e = along(e, w, site.down.map(f64::from));
        }
        let size = length(e);
        let nearest = around.into_iter().filter(|(site, _)| site.phi < f64::INFINITY).reduce(|a, b| if b.1 > a.1 { b } else { a });
        (if size > 1e-9 { e.map(|e| e / size) } else { [0.0; 2] }, nearest.map_or(NONE, |(site, _)| site.next))
    }
}

/// A way while it is solved for.
struct Solution {
    side: f64,
    n: [usize; 2],
    phi: Vec<f64>,
    next: Vec<u32>,
    /// Where distances are not to be solved for.
    exact: Vec<bool>,
}

impl Solution {
    /// Distances around a target.
    fn begin(&mut self, plan: &Plan, cells: &mut Cells, target: Target, radius: f64) {
        let far = EXACT * cells.grid.side;
        let (line, beyond, next) = match target {
            Target::Gate(g) => {
                let [a, b] = plan.gates[g].line;
                let inner = (radius / length(sub(b, a))).min(0.5);
                ([along(a, inner, sub(b, a)), along(b, inner, sub(a, b))], 0.0, g as u32)
            }
            Target::Place(at, radius) => ([at, at], radius, NONE),
        };
        cells.around(line, beyond + far, |cells, i, x| {
            let foot = nearest(line, x);
            let d = (length(sub(x, foot)) - beyond).max(0.0);
            if cells.open[i] && d <= far && d < self.phi[i] && plan.sees(plan.near(x), x, foot) {
                (self.phi[i], self.next[i], self.exact[i]) = (d, next, true);
            }
        });
    }

    /// Solves (crowds.1) in open cells.
    fn sweep(&mut self, cells: &Cells) {
        let [nx, ny] = self.n;
        for _ in 0..ROUNDS {
            let mut changed = false;
            for order in 0..4 {
                for y in 0..ny {
                    let y = if order & 2 == 0 { y } else { ny - 1 - y };
                    for x in 0..nx {
                        let i = if order & 1 == 0 { x } else { nx - 1 - x } + y * nx;
                        if self.exact[i] || !cells.open[i] {
                            continue;
                        }
                        let phi = self.solve(cells, i);
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

    /// The distance at a neighbour of cell i, which may lie beyond a passage.
    fn at(&self, cells: &Cells, i: usize, (j, link): (usize, u32)) -> f64 {
        let Some(passage) = cells.passage(link) else { return self.phi[j] };
        let (mut sum, mut weight) = (0.0, 0.0);
        for (j, w) in cells.beyond(passage, i, j).filter(|(j, _)| self.phi[*j] < f64::INFINITY) {
            (sum, weight) = (sum + w * self.phi[j], weight + w);
        }
        if weight > 0.0 { sum / weight } else { f64::INFINITY }
    }

    /// The distance of a cell from those of its neighbours.
    fn solve(&self, cells: &Cells, i: usize) -> f64 {
        let at = |a, ahead| cells.neighbour(i, a, ahead).map_or(f64::INFINITY, |to| self.at(cells, i, to));
        let sides = [0, 1].map(|a| [at(a, false), at(a, true)]);
        let [a, b] = sides.map(|[behind, ahead]| behind.min(ahead));
        if a.min(b) == f64::INFINITY {
            return f64::INFINITY;
        }
        let within = |h: f64| if (a - b).abs() >= h { a.min(b) + h } else { 0.5 * (a + b + (2.0 * h * h - (a - b) * (a - b)).sqrt()) };
        let Some(slope) = cells.slopes.get(i).copied().flatten() else {
            return within(self.side);
        };
        // Upward or downward, whichever of the two leads that way; the slower one where both or neither does.
        let [up, down] = [slope.up_factor, slope.down_factor].map(|factor| within(self.side / factor));
        let rises = |phi: f64| {
            let along = |axis: usize, least: f64| if sides[axis][1] < sides[axis][0] { 1.0 } else { -1.0 } * (phi - least).max(0.0);
            dot([along(0, a), along(1, b)], slope.up) > 0.0
        };
        match (rises(up), rises(down)) {
            (true, true) => up,
            (false, false) => down,
            _ => up.max(down),
        }
    }

    /// Continues the distance to where bodies do not fit, so that whoever is smaller finds back.
    fn widen(&mut self, cells: &Cells, radius: f64) {
        for _ in 0..(radius / self.side).ceil() as usize + 1 {
            let before = self.phi.clone();
            for i in (0..before.len()).filter(|i| before[*i] == f64::INFINITY && !cells.open[*i]) {
                let beside = cells.neighbours(i).filter(|(_, link)| cells.passage(*link).is_none());
                self.phi[i] = beside.map(|(j, _)| before[j] + BAND * self.side).fold(f64::INFINITY, f64::min);
            }
        }
    }

    /// The direction down the gradient, by central differences, at walls by one-sided ones.
    fn down(&self, cells: &Cells, i: usize) -> [f32; 2] {
        if self.phi[i] == f64::INFINITY {
            return [0.0; 2];
        }
        let slope = |a: usize| {
            let at = |ahead| cells.neighbour(i, a, ahead).map(|to| self.at(cells, i, to)).filter(|phi| phi.is_finite());
            match (at(false), at(true)) {
                (Some(low), Some(high)) => 0.5 * (high - low),
                (None, Some(high)) => high - self.phi[i],
                (Some(low), None) => self.phi[i] - low,
                (None, None) => 0.0,
            }
        };
        let g = [slope(0), slope(1)];
        let size = length(g);
        if size > 0.0 { [(-g[0] / size) as f32, (-g[1] / size) as f32] } else { [0.0; 2] }
    }

    /// Names the first gate on the way from each cell, from the exits outward.
    fn name_gates(&mut self, cells: &Cells) {
        let mut order: Vec<usize> = (0..self.phi.len()).filter(|i| self.phi[*i] < f64::INFINITY && !self.exact[*i]).collect();
        order.sort_by(|a, b| self.phi[*a].total_cmp(&self.phi[*b]).then(a.cmp(b)));
        for i in order {
            let lowest = |a: &(usize, u32), b: &(usize, u32)| self.at(cells, i, *a).total_cmp(&self.at(cells, i, *b));
            if let Some((j, link)) = cells.neighbours(i).min_by(lowest) {
                self.next[i] = match cells.passage(link) {
                    None if link == NONE => self.next[j],
                    None => link,
                    Some(passage) => {
                        let beyond = cells.beyond(passage, i, j);
                        let first = beyond.map(|(j, _)| j).min_by(|a, b| self.phi[*a].total_cmp(&self.phi[*b]));
                        first.map_or(NONE, |j| self.next[j])
                    }
                };
            }
        }
    }
}
