//! What is wrong with a plan, each with its places and a cure. Coordinates in metres.
//!
//! Which side of a line a point is on is decided exactly (`robust`). Ways are looked for on cells, with bodies a little smaller than they are:
//! what is refused here nobody can walk, and the engine looks more closely.

use super::{Point, bounds, cross, distance, foot, off, sub};
use robust::{Coord, orient2d};
use serde::{Deserialize, Serialize};
use std::collections::{HashMap, VecDeque};

/// Ends of walls nearer than this [m] to another wall are meant to meet it.
pub const TOUCH: f64 = 0.1;
/// What counts as one place [m].
pub const SAME: f64 = 1e-3;
/// A wall that ends so near to a jamb ends there [m]; `--widen` moves it.
pub const JAMB: f64 = 0.02;
/// Mean depth of an outline that is a sliver [m], and length of one that may be.
const SLIVER: [f64; 2] = [0.01, 0.05];
/// Part of an area that disks can cover: that of the densest packing.
const PACKED: f64 = 0.906_899_7;
/// Side of cells for ways [m], how much smaller bodies are taken there, and cells at most.
const CELL: f64 = 0.1;
const LEAN: f64 = 0.07;
const CELLS: f64 = 4e6;
/// Spans of plans [m].
const SPANS: [f64; 2] = [1.0, 2000.0];
/// Pieces of a wall that are sorted into squares, at most.
const PIECES: f64 = 4000.0;
/// Findings of a kind that are listed.
pub const LISTED: usize = 50;

/// A gate with its name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Opening {
    /// Its name.
    pub name: String,
    /// One jamb [m].
    pub from: Point,
    /// The other [m].
    pub to: Point,
}

impl Opening {
    pub(super) fn line(&self) -> [Point; 2] {
        [self.from, self.to]
    }

    fn middle(&self) -> Point {
        [0, 1].map(|a| 0.5 * (self.from[a] + self.to[a]))
    }
}

/// An area where people are at the start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Area {
    /// Its name.
    pub name: String,
    /// Corners [m].
    pub points: Vec<Point>,
    /// How many people; `None` if nobody knows yet.
    pub people: Option<f64>,
    /// Names of exits that they may take; none means all.
    #[serde(default)]
    pub exit: Vec<String>,
}

/// A floor to check: all lengths in metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Floor {
    /// Walls, each a line through points.
    pub walls: Vec<Vec<Point>>,
    /// Doors within.
    pub door: Vec<Opening>,
    /// Where people leave.
    pub exit: Vec<Opening>,
    /// Where they are at the start.
    pub start: Vec<Area>,
    /// Two lines each that are one place.
    #[serde(default)]
    pub link: Vec<[[Point; 2]; 2]>,
    /// Of the largest body.
    pub radius: f64,
}

/// What may help.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Cure {
    /// [`super::repair`] mends it.
    Repair,
    /// The drawing has to be changed.
    Drawing,
}

/// Something that is wrong.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Which kind of fault: one word.
    pub kind: &'static str,
    /// Whether nobody can walk on such a plan; others change what is measured.
    pub fatal: bool,
    /// Where [m].
    pub places: Vec<Point>,
    /// What is wrong.
    pub text: String,
    /// What to do.
    pub cure: String,
    /// Who can do it.
    pub by: Cure,
}

/// A side of a wall.
#[derive(Debug, Clone, Copy)]
pub(super) struct Side {
    pub line: [Point; 2],
    pub wall: usize,
    pub k: usize,
}

/// All sides of walls.
pub(super) fn sides(walls: &[Vec<Point>]) -> Vec<Side> {
    let of = |(wall, points): (usize, &Vec<Point>)| {
        points.windows(2).enumerate().map(move |(k, w)| Side { line: [w[0], w[1]], wall, k }).collect::<Vec<_>>()
    };
    walls.iter().enumerate().flat_map(of).collect()
}

/// Sides by the square metres that they are in or near.
pub(super) struct Near(HashMap<[i64; 2], Vec<usize>>);

impl Near {
    /// Of sides that are looked for from no further away than `reach` [m].
    pub fn new(sides: &[Side], reach: f64) -> Self {
        let mut squares: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
        for (i, side) in sides.iter().enumerate() {
            let [a, b] = side.line;
            // Piece by piece: the box around a long wall is mostly empty.
            let pieces = distance(a, b).ceil().clamp(1.0, PIECES);
            for k in 0..pieces as usize {
                let ends = [k as f64 / pieces, (k + 1) as f64 / pieces].map(|s| super::between(a, b, s));
                let [low, high] = bounds(&ends);
                let (low, high) = (square(low.map(|x| x - reach)), square(high.map(|x| x + reach)));
                for x in low[0]..=high[0].min(low[0] + 3) {
                    for y in low[1]..=high[1].min(low[1] + 3) {
                        let own = squares.entry([x, y]).or_default();
                        if own.last() != Some(&i) {
                            own.push(i);
                        }
                    }
                }
            }
        }
        Self(squares)
    }

    /// Numbers of sides that may be near a place.
    pub fn at(&self, x: Point) -> &[usize] {
        self.0.get(&square(x)).map_or(&[], Vec::as_slice)
    }
}

fn square(x: Point) -> [i64; 2] {
    x.map(|x| x.floor() as i64)
}

/// Calls `look` with all pairs of sides that are nearer than `reach` along both axes, the first of lower number.
pub(super) fn pairs(sides: &[Side], reach: f64, mut look: impl FnMut(usize, usize)) {
    let low = |k: usize, a: usize| sides[k].line[0][a].min(sides[k].line[1][a]);
    let high = |k: usize, a: usize| sides[k].line[0][a].max(sides[k].line[1][a]);
    let mut order: Vec<usize> = (0..sides.len()).collect();
    order.sort_by(|i, j| low(*i, 0).total_cmp(&low(*j, 0)).then(i.cmp(j)));
    let mut open: Vec<usize> = Vec::new();
    for j in order {
        open.retain(|i| high(*i, 0) + reach >= low(j, 0));
        for i in &open {
            if low(*i, 1) <= high(j, 1) + reach && low(j, 1) <= high(*i, 1) + reach {
                look((*i).min(j), (*i).max(j));
            }
        }
        open.push(j);
    }
}

/// On which side of a line a point is: its sign is exact.
pub(super) fn turn([a, b]: [Point; 2], x: Point) -> f64 {
    let coord = |[x, y]: Point| Coord { x, y };
    orient2d(coord(a), coord(b), coord(x))
}

/// Where two lines cross, their ends left out.
pub(super) fn crossing(v: [Point; 2], w: [Point; 2]) -> Option<Point> {
    let (c, d, a, b) = (turn(v, w[0]), turn(v, w[1]), turn(w, v[0]), turn(w, v[1]));
    (c * d < 0.0 && a * b < 0.0).then(|| super::between(v[0], v[1], a / (a - b)))
}

/// The part of a side that lies on another one, as places along the latter [m]; `None` where that is none, or they are further than `near` apart.
pub(super) fn overlap(on: [Point; 2], side: [Point; 2], near: f64) -> Option<[f64; 2]> {
    let length = distance(on[0], on[1]);
    if length <= SAME || distance(side[0], side[1]) <= SAME {
        return None;
    }
    let u = sub(on[1], on[0]).map(|x| x / length);
    let along = side.map(|x| super::dot(sub(x, on[0]), u));
    let across = side.map(|x| cross(u, sub(x, on[0])).abs());
    let (low, high) = (along[0].min(along[1]).max(0.0), along[0].max(along[1]).min(length));
    // Parallel: short walls that cross it at a small angle are as near.
    let is_parallel = (across[0] - across[1]).abs() <= 0.05 * (along[0] - along[1]).abs();
    (across[0].max(across[1]) <= near && is_parallel && high - low > SAME).then_some([low, high])
}

/// All that is wrong with a floor, the worst first.
pub fn lint(floor: &Floor) -> Vec<Finding> {
    let mut found = Findings(Vec::new());
    let sides = sides(&floor.walls);
    size(floor, &mut found);
    gates(floor, &sides, &mut found);
    pieces(floor, &sides, &mut found);
    if !found.0.iter().any(|finding| finding.kind == "size") {
        ends(floor, &sides, &mut found);
        ways(floor, &sides, &mut found);
    }
    let mut found = found.0;
    found.sort_by_key(|finding| !finding.fatal);
    found
}

/// Findings, those of a kind that are alike in one.
struct Findings(Vec<Finding>);

impl Findings {
    fn add(&mut self, kind: &'static str, fatal: bool, places: Vec<Point>, text: String, cure: impl Into<String>, by: Cure) {
        self.0.push(Finding { kind, fatal, places, text, cure: cure.into(), by });
    }

    /// One for all places; none where there are none. `text` is told how many there are, and the first of them.
    fn all(&mut self, kind: &'static str, fatal: bool, mut places: Vec<Point>, text: &str, cure: &str) {
        let (n, Some(first)) = (places.len(), places.first().copied()) else { return };
        places.truncate(LISTED);
        let text = if n == 1 { format!("{text} at {}", at(first)) } else { format!("{text} at {} and {} other places", at(first), n - 1) };
        self.add(kind, fatal, places, text, cure, Cure::Repair);
    }
}

pub(super) fn at([x, y]: Point) -> String {
    format!("({}, {})", metres(x), metres(y))
}

/// A length [m] to the millimetre.
pub(super) fn metres(x: f64) -> String {
    let text = format!("{x:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// The size of the whole.
fn size(floor: &Floor, found: &mut Findings) {
    let [low, high] = bounds(floor.walls.iter().flatten());
    let span = (high[0] - low[0]).max(high[1] - low[1]);
    if span > SPANS[1] {
        let text = format!("its walls span {} m: millimetres read as metres?", metres(span));
        found.add("size", true, vec![low, high], text, "say the unit: --units mm, or scale = 0.001 in the scene", Cure::Drawing);
    } else if span.is_finite() && span < SPANS[0] {
        let text = format!("its walls span {} m: less than a room", metres(span));
        found.add("size", true, vec![low, high], text, "say the unit: --units m, or the metres in a unit, --scale X", Cure::Drawing);
    }
}

/// Gates that nobody can pass, that stand beside walls, or in two places.
fn gates(floor: &Floor, sides: &[Side], found: &mut Findings) {
    let [low, high] = bounds(floor.walls.iter().flatten());
    let all: Vec<(&Opening, &str)> = floor.door.iter().map(|g| (g, "door")).chain(floor.exit.iter().map(|g| (g, "exit"))).collect();
    for (k, (gate, kind)) in all.iter().enumerate() {
        let (line, middle, width) = (gate.line(), gate.middle(), distance(gate.from, gate.to));
        let named = format!("{kind} {:?} at {}", gate.name, at(middle));
        if (0..2).any(|a| middle[a] < low[a] - floor.radius || middle[a] > high[a] + floor.radius) {
            let cure = "move it to an opening of the walls, or draw the walls around it";
            found.add("outside", true, vec![middle], format!("{named} lies outside the walls"), cure, Cure::Drawing);
            continue;
        }
        if width < 2.0 * floor.radius {
            let text =
                format!("{named} is {} m wide, and the largest body {} m: nobody can pass", metres(width), metres(2.0 * floor.radius));
            found.add("narrow", true, vec![middle], text, "widen it, or lower the radius of the crowds", Cure::Drawing);
            continue;
        }
        if let Some((other, _)) = all[..k].iter().find(|(other, _)| same_line(other.line(), line)) {
            let text = format!("{named} lies where {:?} does: crossings are counted twice", other.name);
            found.add("double", false, vec![middle], text, "delete one of them", Cure::Drawing);
        }
        blocked(floor, sides, line, &named, found);
        for jamb in line {
            jambs(sides, jamb, &named, floor.radius, found);
        }
    }
    links(floor, sides, found);
}

/// Links that nobody can pass, or whose lines are not one place.
fn links(floor: &Floor, sides: &[Side], found: &mut Findings) {
    for [from, to] in &floor.link {
        let [width, other] = [from, to].map(|line| distance(line[0], line[1]));
        let middle = super::between(from[0], from[1], 0.5);
        let named = format!("link at {}", at(middle));
        if (width - other).abs() > 0.01 * width.max(other) {
            let text = format!("{named} is {} m wide on one floor and {} m on the other", metres(width), metres(other));
            found.add("link", true, vec![middle], text, "draw both lines equally wide", Cure::Drawing);
        } else if width < 2.0 * floor.radius {
            let text =
                format!("{named} is {} m wide, and the largest body {} m: nobody can pass", metres(width), metres(2.0 * floor.radius));
            found.add("narrow", true, vec![middle], text, "widen it, or lower the radius of the crowds", Cure::Drawing);
        }
        for line in [*from, *to] {
            let named = format!("link at {}", at(super::between(line[0], line[1], 0.5)));
            blocked(floor, sides, line, &named, found);
            for jamb in line {
                no_jamb(sides, jamb, &named, floor.radius, found);
            }
        }
    }
}

/// Whether two lines are one, in either direction.
pub(super) fn same_line(v: [Point; 2], w: [Point; 2]) -> bool {
    let near = |a: Point, b: Point| distance(a, b) <= TOUCH;
    (near(v[0], w[0]) && near(v[1], w[1])) || (near(v[0], w[1]) && near(v[1], w[0]))
}

/// A wall that stands in a gate.
fn blocked(floor: &Floor, sides: &[Side], line: [Point; 2], named: &str, found: &mut Findings) {
    let width = distance(line[0], line[1]);
    let within = |s: f64| s > floor.radius.min(0.25 * width) && s < width - floor.radius.min(0.25 * width);
    let along = sides.iter().find_map(|side| {
        let [low, high] = overlap(line, side.line, TOUCH)?;
        (high - low > TOUCH && within(0.5 * (low + high))).then(|| super::between(line[0], line[1], 0.5 * (low + high) / width))
    });
    if let Some(place) = along {
        let text = format!("a wall goes on through {named}: nobody can pass");
        return found.add("closed", true, vec![place], text, "end the wall at its jambs, or --repair, which does that", Cure::Repair);
    }
    let through = sides.iter().find_map(|side| crossing(line, side.line).filter(|x| within(distance(line[0], *x))));
    if let Some(place) = through {
        let text = format!("a wall crosses {named} at {}", at(place));
        found.add("crossed", true, vec![place], text, "end the wall before it, or move the gate", Cure::Drawing);
    }
}

/// A jamb without a wall; else how far away the next is [m].
fn no_jamb(sides: &[Side], jamb: Point, named: &str, radius: f64, found: &mut Findings) -> Option<f64> {
    let nearest = sides.iter().map(|side| off(side.line, jamb)).fold(f64::INFINITY, f64::min);
    if nearest <= 2.0 * radius {
        return Some(nearest);
    }
    let text = format!("{named} has no jamb at {}: the next wall is {} m away, and people walk past it", at(jamb), metres(nearest));
    found.add("jamb", false, vec![jamb], text, "let it end at walls", Cure::Drawing);
    None
}

/// A jamb without a wall, or where none ends.
fn jambs(sides: &[Side], jamb: Point, named: &str, radius: f64, found: &mut Findings) {
    let Some(nearest) = no_jamb(sides, jamb, named, radius, found) else { return };
    let corner = sides.iter().flat_map(|side| side.line).map(|x| distance(x, jamb)).fold(f64::INFINITY, f64::min);
    if corner > JAMB {
        let text = format!("{named}: no wall ends at its jamb {}, and --widen cannot move one", at(jamb));
        let by = if nearest <= TOUCH { Cure::Repair } else { Cure::Drawing };
        let cure = if by == Cure::Repair { "end a wall there, or --repair, which makes a corner of it" } else { "end a wall there" };
        found.add("jamb", false, vec![jamb], text, cure, by);
    }
}

/// Walls that are twice there, cross themselves, or are nothing.
fn pieces(floor: &Floor, sides: &[Side], found: &mut Findings) {
    let (mut crossed, mut double) = (Vec::new(), Vec::new());
    pairs(sides, SAME, |i, j| {
        let (v, w) = (&sides[i], &sides[j]);
        if v.wall == w.wall
            && let Some(x) = crossing(v.line, w.line)
        {
            crossed.push(x);
        }
        // Sides that follow each other may fold back.
        if let Some([low, high]) = overlap(v.line, w.line, SAME) {
            double.push(super::between(v.line[0], v.line[1], 0.5 * (low + high) / distance(v.line[0], v.line[1])));
        }
    });
    let order = |x: &Point, y: &Point| x[0].total_cmp(&y[0]).then(x[1].total_cmp(&y[1]));
    crossed.sort_by(order);
    double.sort_by(order);
    found.all("crossing", true, crossed, "a wall crosses itself", "mend the order of its points, or --repair, which parts it there");
    found.all("double", false, double, "walls lie on each other", "delete what is there twice, or --repair");
    let slivers = floor.walls.iter().filter(|wall| is_sliver(wall)).map(|wall| wall[0]).collect();
    found.all("sliver", false, slivers, "an outline without width, or a wall shorter than a millimetre", "delete it, or --repair");
}

/// Whether a wall is next to nothing.
pub(super) fn is_sliver(wall: &[Point]) -> bool {
    let length: f64 = wall.windows(2).map(|w| distance(w[0], w[1])).sum();
    let closed = wall.len() > 3 && wall.first() == wall.last();
    let area = 0.5 * wall.windows(2).map(|w| cross(sub(w[0], wall[0]), sub(w[1], wall[0]))).sum::<f64>().abs();
    length <= SAME || (closed && length < SLIVER[1]) || (closed && 2.0 * area / length < SLIVER[0] && length < 1.0)
}

/// Ends of open walls that nearly meet another wall.
fn ends(floor: &Floor, sides: &[Side], found: &mut Findings) {
    let (near, mut gaps) = (Near::new(sides, TOUCH), Vec::new());
    for (wall, end, x) in open_ends(&floor.walls) {
        let own: Vec<Side> = near.at(x).iter().map(|i| sides[*i]).collect();
        if gap(&own, wall, end, x, floor.walls[wall].len()).is_some() {
            gaps.push(x);
        }
    }
    let cure = "join them in the drawing, or --repair, which does that";
    found.all("gap", false, gaps, &format!("a wall ends less than {} m before another", metres(TOUCH)), cure);
}

/// Ends of walls that are no outlines: number of the wall, of the point, and its place.
pub(super) fn open_ends(walls: &[Vec<Point>]) -> Vec<(usize, usize, Point)> {
    let open = walls.iter().enumerate().filter(|(_, wall)| wall.len() > 1 && wall.first() != wall.last());
    open.flat_map(|(k, wall)| [(k, 0, wall[0]), (k, wall.len() - 1, wall[wall.len() - 1])]).collect()
}

/// Where the end of a wall is meant to be, if it is not there: at the nearest corner, or else on the nearest side, of other walls, or of its own but for the
/// sides next to it.
pub(super) fn gap(sides: &[Side], wall: usize, end: usize, x: Point, points: usize) -> Option<Point> {
    let own = |side: &Side| side.wall == wall && (points <= 3 || side.k == end || side.k + 1 == end);
    let others = || sides.iter().filter(|side| !own(side) && off(side.line, x) <= TOUCH);
    let nearest = others().map(|side| off(side.line, x)).fold(f64::INFINITY, f64::min);
    if nearest <= SAME || nearest > TOUCH {
        return None;
    }
    let corner = others().flat_map(|side| side.line).filter(|y| distance(*y, x) <= TOUCH);
    let corner = corner.min_by(|y, z| distance(*y, x).total_cmp(&distance(*z, x)));
    let side = || others().min_by(|v, w| off(v.line, x).total_cmp(&off(w.line, x)));
    corner.or_else(|| side().map(|side| super::between(side.line[0], side.line[1], foot(side.line, x))))
}

/// Areas that nobody can leave, or that are too small.
fn ways(floor: &Floor, sides: &[Side], found: &mut Findings) {
    let cells = Cells::new(floor, sides);
    let [low, high] = bounds(floor.walls.iter().flatten());
    let reached: Vec<Vec<bool>> = floor.exit.iter().map(|gate| cells.reached(gate, &floor.link)).collect();
    for area in &floor.start {
        let middle = centre(&area.points);
        let own = cells.inside(&area.points);
        let may = |k: usize| area.exit.is_empty() || area.exit.contains(&floor.exit[k].name);
        let within = |c: &usize| (0..2).all(|a| (low[a]..=high[a]).contains(&cells.middle(*c)[a]));
        if !own.iter().any(within) {
            let text = format!("start {:?} at {} lies outside, or in walls", area.name, at(middle));
            found.add("start", true, vec![middle], text, "move it onto the floor", Cure::Drawing);
        } else if !(0..reached.len()).any(|k| may(k) && own.iter().any(|c| reached[k][*c])) {
            let text = format!("start {:?} at {}: no way leads from there to an exit", area.name, at(middle));
            let cure = "open the wall that cuts it off, or draw a door or an exit there";
            found.add("locked", true, vec![middle], text, cure, Cure::Drawing);
        }
        let floor_area = 0.5 * ring(&area.points).abs();
        let most = PACKED * floor_area / (std::f64::consts::PI * floor.radius * floor.radius);
        if let Some(people) = area.people.filter(|people| *people > most + 1.0) {
            let text = format!(
                "start {:?} at {}: {people} people on {} m², and at most {} fit",
                area.name,
                at(middle),
                metres(floor_area),
                most as u64
            );
            found.add("full", true, vec![middle], text, "take fewer people, or a larger area", Cure::Drawing);
        }
    }
    for (gate, reached) in floor.exit.iter().zip(&reached) {
        if !floor.start.is_empty() && !floor.start.iter().any(|area| cells.inside(&area.points).iter().any(|c| reached[*c])) {
            let text = format!("exit {:?} at {}: nobody can get there", gate.name, at(gate.middle()));
            found.add("unused", false, vec![gate.middle()], text, "open the wall before it, or delete it", Cure::Drawing);
        }
    }
}

/// Twice the signed area of a polygon.
fn ring(points: &[Point]) -> f64 {
    (0..points.len()).map(|k| cross(sub(points[k], points[0]), sub(points[(k + 1) % points.len()], points[0]))).sum()
}

fn centre(points: &[Point]) -> Point {
    let n = points.len().max(1) as f64;
    [0, 1].map(|a| points.iter().map(|p| p[a]).sum::<f64>() / n)
}

/// Cells on which the middle of a body can be.
struct Cells {
    low: Point,
    side: f64,
    n: [usize; 2],
    free: Vec<bool>,
}

impl Cells {
    fn new(floor: &Floor, sides: &[Side]) -> Self {
        let [low, high] = bounds(floor.walls.iter().flatten().chain(floor.start.iter().flat_map(|area| &area.points)));
        let low = low.map(|x| if x.is_finite() { x - 1.0 } else { 0.0 });
        let span = [0, 1].map(|a| if high[a].is_finite() { high[a] + 1.0 - low[a] } else { 1.0 });
        let side = CELL.max((span[0] * span[1] / CELLS).sqrt());
        let n = span.map(|x| ((x / side).ceil() as usize).max(1));
        let mut cells = Self { low, side, n, free: vec![true; n[0] * n[1]] };
        let reach = (floor.radius - LEAN).max(0.05);
        for side in sides {
            let box_of = |a: usize, f: fn(f64, f64) -> f64, by: f64| f(side.line[0][a], side.line[1][a]) + by;
            let from = cells.of([box_of(0, f64::min, -reach), box_of(1, f64::min, -reach)]);
            let to = cells.of([box_of(0, f64::max, reach), box_of(1, f64::max, reach)]);
            for y in from[1]..=to[1] {
                for x in from[0]..=to[0] {
                    let k = x + cells.n[0] * y;
                    cells.free[k] = cells.free[k] && off(side.line, cells.middle(k)) >= reach;
                }
            }
        }
        cells
    }

    /// The cell of a place, or the nearest at the edge.
    fn of(&self, x: Point) -> [usize; 2] {
        [0, 1].map(|a| (((x[a] - self.low[a]) / self.side).max(0.0) as usize).min(self.n[a] - 1))
    }

    fn middle(&self, k: usize) -> Point {
        [self.low[0] + self.side * ((k % self.n[0]) as f64 + 0.5), self.low[1] + self.side * ((k / self.n[0]) as f64 + 0.5)]
    }

    /// Free cells within a polygon.
    fn inside(&self, points: &[Point]) -> Vec<usize> {
        let [low, high] = bounds(points);
        if points.len() < 3 {
            return Vec::new();
        }
        let (from, to) = (self.of(low), self.of(high));
        let within = |k: usize| {
            let x = self.middle(k);
            let crosses = |i: usize| {
                let (p, q) = (points[i], points[(i + 1) % points.len()]);
                (p[1] > x[1]) != (q[1] > x[1]) && x[0] < p[0] + (x[1] - p[1]) / (q[1] - p[1]) * (q[0] - p[0])
            };
            (0..points.len()).filter(|i| crosses(*i)).count() % 2 == 1
        };
        let all = (from[1]..=to[1]).flat_map(|y| (from[0]..=to[0]).map(move |x| (x, y)));
        all.map(|(x, y)| x + self.n[0] * y).filter(|k| self.free[*k] && within(*k)).collect()
    }

    /// Free cells at the middle of a line.
    fn at(&self, line: [Point; 2]) -> Vec<usize> {
        let reach = 0.3_f64.max(1.5 * self.side);
        let middle = super::between(line[0], line[1], 0.5);
        let (from, to) = (self.of(middle.map(|x| x - reach)), self.of(middle.map(|x| x + reach)));
        let all = (from[1]..=to[1]).flat_map(|y| (from[0]..=to[0]).map(move |x| (x, y)));
        let all = all.map(|(x, y)| x + self.n[0] * y);
        all.filter(|k| self.free[*k] && distance(self.middle(*k), middle) <= reach).collect()
    }

    /// Cells from which an exit can be reached, across links.
    fn reached(&self, gate: &Opening, links: &[[[Point; 2]; 2]]) -> Vec<bool> {
        let mut reached = vec![false; self.free.len()];
        self.spread(self.at(gate.line()), &mut reached);
        let ways: Vec<[Vec<usize>; 2]> = links.iter().flat_map(|[a, b]| [[self.at(*a), self.at(*b)], [self.at(*b), self.at(*a)]]).collect();
        let is = |cells: &[usize], reached: &[bool]| cells.iter().any(|k| reached[*k]);
        while let Some([_, beyond]) = ways.iter().find(|[here, beyond]| is(here, &reached) && !beyond.is_empty() && !is(beyond, &reached)) {
            self.spread(beyond.clone(), &mut reached);
        }
        reached
    }

    /// Cells that are reached from some.
    fn spread(&self, from: Vec<usize>, reached: &mut [bool]) {
        from.iter().for_each(|k| reached[*k] = true);
        let mut queue = VecDeque::from(from);
        let [nx, ny] = self.n;
        while let Some(k) = queue.pop_front() {
            let (x, y) = (k % nx, k / nx);
            for ny in y.saturating_sub(1)..=(y + 1).min(ny - 1) {
                for nx_ in x.saturating_sub(1)..=(x + 1).min(nx - 1) {
                    let next = nx_ + nx * ny;
                    if self.free[next] && !reached[next] {
                        reached[next] = true;
                        queue.push_back(next);
                    }
                }
            }
        }
    }
}
