//! The plan of a floor: walls without thickness and gates across openings, with a list of the walls near every place.

use super::link::Passage;

pub use super::line::{Line, Point, crossing, inside, meets, middle, nearest, width};
pub(super) use super::line::{along, cross, dot, length, sub};

/// A line across an opening, where crossings are counted.
#[derive(Debug, Clone, PartialEq)]
pub struct Gate {
    /// Its name.
    pub name: String,
    /// From jamb to jamb.
    pub line: Line,
    /// Whether people leave there.
    pub exit: bool,
    /// When it opens and when it closes [s], if it does.
    pub hours: [Option<f64>; 2],
}

impl Gate {
    /// Its width [m].
    pub fn width(&self) -> f64 {
        width(self.line)
    }

    /// Whether it is closed at t [s]: before it opens, and from when it closes. One that closes before it opens is open at the start.
    pub fn is_closed(&self, t: f64) -> bool {
        match self.hours {
            [None, None] => false,
            [Some(opens), None] => t < opens,
            [None, Some(closes)] => t >= closes,
            [Some(opens), Some(closes)] if opens < closes => t < opens || t >= closes,
            [Some(opens), Some(closes)] => t >= closes && t < opens,
        }
    }
}

/// Stairs or a ramp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slope {
    /// Which way it rises, a unit vector.
    pub up: Point,
    /// Speed upward over that on the level, in plan.
    pub up_factor: f64,
    /// The same downward.
    pub down_factor: f64,
}

impl Slope {
    /// Speed in a direction over that on the level.
    pub fn factor(&self, e: Point) -> f64 {
        if dot(e, self.up) > 0.0 { self.up_factor } else { self.down_factor }
    }
}

/// Walls and gates.
#[derive(Debug, Clone, Default)]
pub struct Plan {
    /// Walls, then closed gates.
    pub walls: Vec<Line>,
    /// How many are walls.
    pub solid: usize,
    /// Doors and exits.
    pub gates: Vec<Gate>,
    /// Corners of slopes, and the slopes.
    pub slopes: Vec<(Vec<Point>, Slope)>,
    /// The lowest corner of all.
    pub low: Point,
    /// The highest.
    pub high: Point,
    /// Cells of 1 m along x and y, over the box and all around it as far as lists reach.
    cells: [usize; 2],
    origin: Point,
    /// Walls within reach of any place of a cell.
    near_walls: Lists,
    /// Gates within 1 m.
    near_gates: Lists,
    /// Ways through links between floors.
    passages: Vec<Passage>,
    /// Those within reach.
    near_passages: Lists,
    /// How far lists of walls reach [m].
    reach: f64,
}

/// A list for each cell.
#[derive(Debug, Clone, Default)]
struct Lists {
    /// Where it begins; one more for the end of the last.
    starts: Vec<u32>,
    all: Vec<u32>,
}

impl Lists {
    fn of(&self, cell: usize) -> &[u32] {
        &self.all[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}

/// Free space around a plan [m].
pub const MARGIN: f64 = 1.0;

impl Plan {
    /// A plan whose lists have all walls within `reach` [m].
    pub fn new(walls: Vec<Line>, gates: Vec<Gate>, reach: f64) -> Self {
        let points: Vec<Point> = walls.iter().copied().chain(gates.iter().map(|g| g.line)).flatten().collect();
        let bound = |a: usize, f: fn(f64, f64) -> f64| points.iter().map(|p| p[a]).reduce(f).unwrap_or(0.0);
        let (low, high) = ([bound(0, f64::min), bound(1, f64::min)], [bound(0, f64::max), bound(1, f64::max)]);
        let origin = [low[0] - MARGIN, low[1] - MARGIN];
        let cells = [0, 1].map(|a| ((high[a] - low[a] + 2.0 * MARGIN).ceil() as usize).max(1));
        let mut plan = Self { solid: walls.len(), walls, gates, low, high, cells, origin, reach, ..Self::default() };
        plan.near_walls = plan.lists(&plan.walls, reach);
        plan.near_gates = plan.lists(&plan.gates.iter().map(|g| g.line).collect::<Vec<_>>(), 1.0);
        plan.near_passages = plan.lists(&[], reach);
        plan
    }

    /// For each cell the lines within reach of any place of it.
    fn lists(&self, lines: &[Line], reach: f64) -> Lists {
        let mut lists = Lists { starts: vec![0], all: Vec::new() };
        for c in 0..self.cells[0] * self.cells[1] {
            let middle = [self.origin[0] + (c % self.cells[0]) as f64 + 0.5, self.origin[1] + (c / self.cells[0]) as f64 + 0.5];
            // Half the diagonal of a cell more.
            let near = |line: &Line| length(sub(nearest(*line, middle), middle)) <= reach + 0.7072;
            lists.all.extend((0..lines.len() as u32).filter(|i| near(&lines[*i as usize])));
            lists.starts.push(lists.all.len() as u32);
        }
        lists
    }

    /// The same with links between floors, each two lines that are one place.
    pub fn with_links(mut self, links: &[[Line; 2]]) -> Self {
        self.passages = links.iter().flat_map(|link| Passage::both(*link)).collect();
        self.near_passages = self.lists(&self.passages.iter().map(|passage| passage.from).collect::<Vec<_>>(), self.reach);
        self
    }

    /// The same with slopes, each the corners of a polygon, and what it is.
    pub fn with_slopes(self, slopes: Vec<(Vec<Point>, Slope)>) -> Self {
        Self { slopes, ..self }
    }

    /// The same with gates that are always open.
    pub fn without_hours(mut self) -> Self {
        self.gates.iter_mut().for_each(|gate| gate.hours = [None; 2]);
        self
    }

    /// The same with walls across closed gates.
    pub fn with_closed(&self, closed: &[bool]) -> Self {
        let lines = self.gates.iter().zip(closed).filter(|(_, closed)| **closed).map(|(gate, _)| gate.line);
        let walls = self.walls[..self.solid].iter().copied().chain(lines).collect();
        let (slopes, passages, near_passages) = (self.slopes.clone(), self.passages.clone(), self.near_passages.clone());
        Self { solid: self.solid, slopes, passages, near_passages, ..Self::new(walls, self.gates.clone(), self.reach) }
    }

    /// The slope at a place.
    pub fn slope(&self, x: Point) -> Option<&Slope> {
        self.slopes.iter().find(|(polygon, _)| inside(polygon, x)).map(|(_, slope)| slope)
    }

    fn cell(&self, x: Point) -> usize {
        let at = |a: usize| (x[a] - self.origin[a]).clamp(0.0, (self.cells[a] - 1) as f64) as usize;
        at(0) + at(1) * self.cells[0]
    }

    /// Walls near a place.
    pub fn near(&self, x: Point) -> &[u32] {
        self.near_walls.of(self.cell(x))
    }

    /// All ways through links.
    pub fn passages(&self) -> &[Passage] {
        &self.passages
    }

    /// Ways through links that begin near a place.
    pub fn passages_near(&self, x: Point) -> impl Iterator<Item = &Passage> {
        self.near_passages.of(self.cell(x)).iter().map(|p| &self.passages[*p as usize])
    }

    /// The way through a link that leads from x to y, if one does.
    pub fn passage(&self, x: Point, y: Point) -> Option<&Passage> {
        self.passages_near(x).find(|passage| crossing(passage.from, x, y).is_some())
    }

    /// Gates within a metre of a place, and some more.
    pub fn gates_near(&self, x: Point) -> &[u32] {
        self.near_gates.of(self.cell(x))
    }

    /// Whether no wall of a list stands between two places.
    pub fn sees(&self, near: &[u32], x: Point, y: Point) -> bool {
        near.iter().all(|w| !meets(self.walls[*w as usize], x, y))
    }

    /// The same, if all gates were open.
    pub fn sees_past_gates(&self, near: &[u32], x: Point, y: Point) -> bool {
        near.iter().all(|w| *w as usize >= self.solid || !meets(self.walls[*w as usize], x, y))
    }

    /// Distance to the nearest wall of those near [m]. Closed gates are none.
    pub fn clearance(&self, x: Point) -> f64 {
        self.near(x)
            .iter()
            .filter(|w| (**w as usize) < self.solid)
            .map(|w| length(sub(x, nearest(self.walls[*w as usize], x))))
            .fold(f64::INFINITY, f64::min)
    }
}
