//! Floor plans: bytes of a drawing in, a [`Plan`] out: walls, gates and areas where people start.
//!
//! A reader (`dxf`, `svg`, `geojson`, `wkt`) gives all lines of its format with the names of the layers that they are on, curves as chords;
//! `kinds` says what a layer holds by its name, `gates` makes lines from jamb to jamb of what draws doors. Coordinates stay in units of the
//! file, y up. Any bytes give a plan or a one-line message that names the cure, never a panic.
//! Verified by `tests/plans.rs`, and against ezdxf and shapely by `python/tests/test_plans.py`.

mod curves;
mod dxf;
mod gates;
mod geojson;
mod kinds;
mod lint;
mod repair;
mod spline;
mod svg;
mod wkt;

use serde::Serialize;
use std::collections::BTreeMap;

pub use kinds::Kind;
pub use lint::{Area, Cure, Finding, Floor, Opening, lint};
pub use repair::repair;

/// A place on a floor, x and y.
pub type Point = [f64; 2];

/// Distance of a chord from its curve [m], at most.
const FINENESS: f64 = 0.005;
/// Points of a drawing, at most: blocks in blocks may ask for any number.
const MOST: usize = 2_000_000;
/// Coordinates beyond this [m] are counted from a corner of the plan: engines in single precision walk there.
const FAR: f64 = 10_000.0;
/// Spans of plans [m], and widths of gates, that are plausible.
const SPANS: [f64; 2] = [1.0, 2000.0];
const WIDTHS: [f64; 2] = [0.3, 30.0];

/// Units of lengths: name, metres.
pub const UNITS: [(&str, f64); 6] = [("mm", 0.001), ("cm", 0.01), ("dm", 0.1), ("m", 1.0), ("in", 0.0254), ("ft", 0.3048)];

/// A file format of plans.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Format {
    /// AutoCAD's exchange format as text: LINE, LWPOLYLINE, POLYLINE, ARC, CIRCLE, ELLIPSE, SPLINE, and INSERT, exploded.
    Dxf,
    /// Scalable vector graphics: shapes, paths, groups, `use`, transforms. Names are Inkscape's labels, classes and ids.
    Svg,
    /// Features with a property `kind` or `layer`.
    GeoJson,
    /// A geometry in a line, after its kind, name, and `count=N` or `density=X`: of a polygon without a kind the rings are walls.
    Wkt,
}

impl Format {
    /// The formats that can be read.
    pub const ALL: [Self; 4] = [Self::Dxf, Self::Svg, Self::GeoJson, Self::Wkt];

    /// The format of files with a suffix (`dxf`, `.DXF`).
    pub fn named(suffix: &str) -> Option<Self> {
        let suffix = suffix.trim_start_matches('.').to_ascii_lowercase();
        Self::ALL.into_iter().find(|format| format.suffix() == suffix)
    }

    /// Its suffix, without a point.
    pub fn suffix(self) -> &'static str {
        match self {
            Self::Dxf => "dxf",
            Self::Svg => "svg",
            Self::GeoJson => "geojson",
            Self::Wkt => "wkt",
        }
    }
}

/// What a file does not say.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Metres in a unit of the file, whatever that says.
    pub scale: Option<f64>,
    /// Names of layers, in any case, of a kind each. No other layer is of a kind that is named here.
    pub layers: Vec<(Kind, String)>,
}

/// A line from one jamb of an opening to the other.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Gate {
    /// As the file has it.
    pub name: Option<String>,
    /// Both jambs, in units of the file.
    pub line: [Point; 2],
}

/// Two lines that are one place, on two floors that are drawn side by side.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Link {
    /// Theirs, or that of their layer.
    pub name: String,
    /// Both lines, in units of the file, their ends in the same order: of the two orders that which turns the floors less.
    pub lines: [[Point; 2]; 2],
}

/// An area where people are at the start.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Start {
    /// As the file has it.
    pub name: Option<String>,
    /// Corners, in units of the file; the first is not repeated.
    pub points: Vec<Point>,
    /// How many people.
    pub count: Option<f64>,
    /// How many on an area [1/m²].
    pub density: Option<f64>,
}

/// A layer of a drawing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Layer {
    /// Its name; empty where the file has none.
    pub name: String,
    /// What it was taken for.
    pub kind: Option<Kind>,
    /// Whether the file hides it: nothing is taken from it unless it is named in [`Options`].
    pub hidden: bool,
    /// What it holds: form ("line", "outline", "arc", ...) and number.
    pub holds: BTreeMap<&'static str, usize>,
}

/// A floor plan as a drawing has it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plan {
    /// The unit that the file says: its name, and metres in it.
    pub unit: Option<(String, f64)>,
    /// Metres in a unit: as it was given, as the file says, or else 1.
    pub scale: f64,
    /// What was taken from all coordinates, in units of the file: not 0 where they are far from it.
    pub origin: Point,
    /// Walls, each a line through points; an outline ends where it begins.
    pub walls: Vec<Vec<Point>>,
    /// Doors within the floor.
    pub doors: Vec<Gate>,
    /// Where people leave.
    pub exits: Vec<Gate>,
    /// Where they are at the start.
    pub starts: Vec<Start>,
    /// Where floors go on at each other.
    pub links: Vec<Link>,
    /// Lines of stairs, which do not say where these rise.
    pub stairs: usize,
    /// What the file holds, by name.
    pub layers: Vec<Layer>,
    /// Shapes that are not what their layer says, each a line with its place.
    pub faults: Vec<String>,
}

impl Plan {
    /// Width and height of the walls, in units of the file.
    pub fn span(&self) -> [f64; 2] {
        let [low, high] = bounds(self.walls.iter().flatten());
        [0, 1].map(|a| (high[a] - low[a]).max(0.0))
    }

    /// Whether it is the size of a building, `scale` metres in a unit.
    pub fn is_plausible(&self, scale: f64) -> bool {
        let mut widths: Vec<f64> = self.doors.iter().chain(&self.exits).map(|gate| distance(gate.line[0], gate.line[1])).collect();
        widths.sort_by(f64::total_cmp);
        let within = |x: f64, [low, high]: [f64; 2]| x * scale >= low && x * scale <= high;
        let span = self.span();
        within(span[0].max(span[1]), SPANS) && widths.get(widths.len() / 2).is_none_or(|width| within(*width, WIDTHS))
    }
}

/// A line of a drawing, before anybody knows what it is.
#[derive(Debug, Clone, Default)]
struct Shape {
    points: Vec<Point>,
    /// Centre and both ends, if it is one arc of a circle.
    arc: Option<[Point; 3]>,
    /// Its names, in the list of the drawing.
    tag: usize,
    /// The block that it is from, counted from 1, or 0.
    block: usize,
    /// Where it is in the file.
    place: String,
    name: Option<String>,
    count: Option<String>,
    density: Option<String>,
}

/// Names of a shape: its own, and those of what it is in.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Tag {
    /// From the shape outward.
    names: Vec<String>,
    /// That of the layer in lists, where no name tells the kind.
    layer: String,
}

/// All lines of a file.
#[derive(Debug, Default)]
struct Drawing {
    unit: Option<(String, f64)>,
    shapes: Vec<Shape>,
    tags: Vec<Tag>,
    numbers: BTreeMap<Tag, usize>,
    /// What is on a layer that has no line: form and number.
    others: BTreeMap<(usize, &'static str), usize>,
    /// Names of layers that the file hides.
    hidden: Vec<String>,
    /// Points so far.
    points: usize,
}

impl Drawing {
    /// The number of a tag.
    fn tag(&mut self, tag: Tag) -> usize {
        if let Some(k) = self.numbers.get(&tag) {
            return *k;
        }
        self.tags.push(tag.clone());
        self.numbers.insert(tag, self.tags.len() - 1);
        self.tags.len() - 1
    }

    /// Adds a shape, without points that repeat the one before.
    ///
    /// # Errors
    /// If there are too many points, or one is no number.
    fn add(&mut self, mut shape: Shape) -> Result<(), String> {
        shape.points.dedup();
        if !shape.points.iter().chain(shape.arc.iter().flatten()).flatten().all(|x| x.is_finite() && x.abs() < 1e15) {
            return Err(format!("{}: a coordinate is no finite number below 1e15; export the drawing again", shape.place));
        }
        self.points += shape.points.len() + 1;
        if self.points > MOST {
            return Err(format!("more than {MOST} points; leave out what is no wall, door, exit or start, and export it again"));
        }
        if shape.points.len() > 1 {
            self.shapes.push(shape);
        }
        Ok(())
    }

    /// Counts something that is no line.
    fn count(&mut self, tag: Tag, form: &'static str) {
        let tag = self.tag(tag);
        *self.others.entry((tag, form)).or_default() += 1;
    }
}

/// Reads a plan.
///
/// All coordinates are finite. Whether it makes sense is for [`lint`] to say, and whether its size does for [`Plan::is_plausible`].
///
/// # Errors
/// One line: what is wrong with the file, where, and what to do.
pub fn read(bytes: &[u8], format: Format, options: &Options) -> Result<Plan, String> {
    if bytes.is_empty() {
        return Err("the file is empty; export the drawing again".to_owned());
    }
    let fine = |unit: &Option<(String, f64)>| FINENESS / options.scale.or(unit.as_ref().map(|unit| unit.1)).unwrap_or(1.0);
    let read = match format {
        Format::Dxf => dxf::read(bytes, fine),
        Format::Svg => svg::read(bytes, fine),
        Format::GeoJson => geojson::read(bytes),
        Format::Wkt => wkt::read(bytes),
    };
    let drawing = read.map_err(|message| crate::one_line(&message))?;
    Ok(sorted(drawing, options))
}

/// Shapes to what their layers say they are.
fn sorted(drawing: Drawing, options: &Options) -> Plan {
    let hidden = |tag: &Tag| drawing.hidden.contains(&tag.layer);
    let kinds: Vec<(Option<Kind>, Option<usize>)> =
        drawing.tags.iter().map(|tag| kinds::of(&tag.names, hidden(tag), &options.layers)).collect();
    let layers = layers(&drawing, &kinds);
    let of = |kind: Kind| drawing.shapes.iter().filter(|shape| kinds[shape.tag].0 == Some(kind)).collect::<Vec<&Shape>>();
    let walls: Vec<Vec<Point>> = of(Kind::Wall).into_iter().map(|shape| shape.points.clone()).collect();
    let mut faults = Vec::new();
    let doors = gates::gates(&of(Kind::Door), Kind::Door, &walls, &mut faults);
    let exits = gates::gates(&of(Kind::Exit), Kind::Exit, &walls, &mut faults);
    let starts = of(Kind::Start).into_iter().filter_map(|shape| start(shape, &mut faults)).collect();
    let scale = options.scale.or(drawing.unit.as_ref().map(|unit| unit.1)).unwrap_or(1.0);
    let names = |shape: &Shape| shape.name.clone().unwrap_or_else(|| drawing.tags[shape.tag].layer.clone());
    let links = links(&of(Kind::Link), names, &mut faults);
    let stairs = of(Kind::Stair).len();
    let plan = Plan { unit: drawing.unit, scale, origin: [0.0; 2], walls, doors, exits, starts, links, stairs, layers, faults };
    near(plan)
}

/// Pairs of lines of one name.
fn links(shapes: &[&Shape], name: impl Fn(&Shape) -> String, faults: &mut Vec<String>) -> Vec<Link> {
    let mut pairs: BTreeMap<String, Vec<&Shape>> = BTreeMap::new();
    shapes.iter().for_each(|shape| pairs.entry(name(shape)).or_default().push(shape));
    let mut found = Vec::new();
    for (name, lines) in pairs {
        let ends = |shape: &Shape| shape.points.first().copied().zip(shape.points.last().copied());
        let [Some((a, b)), Some((c, d))] = lines.iter().copied().map(ends).collect::<Vec<_>>()[..] else {
            let n = lines.len();
            faults.push(format!(
                "{}: link {name:?} has {n} line{}, expected 2, one on each floor; give the two that are one place the same name, or a layer of their own",
                lines[0].place,
                if n == 1 { "" } else { "s" }
            ));
            continue;
        };
        let to = if dot(sub(b, a), sub(d, c)) < 0.0 { [d, c] } else { [c, d] };
        found.push(Link { name, lines: [[a, b], to] });
    }
    found
}

/// What the file holds, layer by layer.
fn layers(drawing: &Drawing, kinds: &[(Option<Kind>, Option<usize>)]) -> Vec<Layer> {
    let mut found: BTreeMap<(String, Option<Kind>), Layer> = BTreeMap::new();
    let mut put = |tag: usize, form: Option<&'static str>, n: usize| {
        let (kind, by) = kinds[tag];
        let own = &drawing.tags[tag];
        // A group may be of no kind, and lines in it of one each.
        let name = by.filter(|_| kind.is_some()).map_or(&own.layer, |k| &own.names[k]).clone();
        let hidden = drawing.hidden.contains(&own.layer);
        let layer = found.entry((name.clone(), kind)).or_insert_with(|| Layer { name, kind, hidden, holds: BTreeMap::new() });
        if let Some(form) = form {
            *layer.holds.entry(form).or_default() += n;
        }
    };
    (0..drawing.tags.len()).for_each(|tag| put(tag, None, 0));
    for shape in &drawing.shapes {
        let closed = shape.points.len() > 2 && shape.points.first() == shape.points.last();
        let form = match () {
            () if shape.arc.is_some() => "arc",
            () if closed => "outline",
            () if shape.points.len() == 2 => "line",
            () => "polyline",
        };
        put(shape.tag, Some(form), 1);
    }
    for ((tag, form), n) in &drawing.others {
        put(*tag, Some(form), *n);
    }
    found.into_values().collect()
}

/// An area of people.
fn start(shape: &Shape, faults: &mut Vec<String>) -> Option<Start> {
    let mut points = shape.points.clone();
    if points.first() == points.last() {
        points.pop();
    }
    let mut number = |what: &str, text: &Option<String>| {
        let text = text.as_deref()?;
        let number = text.trim().parse::<f64>().ok().filter(|x| x.is_finite() && *x > 0.0 && *x <= 1e6);
        if number.is_none() {
            faults.push(format!("{}: {what} {text:?} is no number above 0; mend it in the drawing", shape.place));
        }
        number
    };
    let (count, density) = (number("count", &shape.count), number("density", &shape.density));
    if points.len() < 3 {
        faults.push(format!(
            "{}: a start of {} points, expected an outline of 3 or more; draw it as one closed line",
            shape.place,
            points.len()
        ));
        return None;
    }
    Some(Start { name: shape.name.clone(), points, count, density })
}

/// The plan with coordinates counted from a corner of it, if they are far from 0.
fn near(mut plan: Plan) -> Plan {
    let [low, high] = bounds(plan.walls.iter().flatten());
    let far = low.into_iter().chain(high).fold(0.0, |far: f64, x| far.max(x.abs())) * plan.scale;
    if !(far > FAR && far.is_finite()) {
        return plan;
    }
    let origin = low.map(f64::floor);
    let shift = |p: &mut Point| *p = [p[0] - origin[0], p[1] - origin[1]];
    plan.walls.iter_mut().flatten().for_each(shift);
    plan.doors.iter_mut().chain(&mut plan.exits).flat_map(|gate| &mut gate.line).for_each(shift);
    plan.links.iter_mut().flat_map(|link| link.lines.as_flattened_mut()).for_each(shift);
    plan.starts.iter_mut().flat_map(|start| &mut start.points).for_each(shift);
    Plan { origin, ..plan }
}

/// Lowest and highest corner of the box around points; of none, infinities.
fn bounds<'a>(points: impl IntoIterator<Item = &'a Point>) -> [Point; 2] {
    let start = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    points.into_iter().fold(start, |[low, high], p| [[0, 1].map(|a| low[a].min(p[a])), [0, 1].map(|a| high[a].max(p[a]))])
}

fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn distance(a: Point, b: Point) -> f64 {
    dot(sub(a, b), sub(a, b)).sqrt()
}

/// The point a + s (b - a).
fn between(a: Point, b: Point, s: f64) -> Point {
    [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])]
}

/// Where on a segment, as a part of it, the point nearest to x is.
fn foot([a, b]: [Point; 2], x: Point) -> f64 {
    let d = sub(b, a);
    let length_sq = dot(d, d);
    if length_sq > 0.0 { (dot(sub(x, a), d) / length_sq).clamp(0.0, 1.0) } else { 0.0 }
}

/// Distance of a point from a segment.
fn off(line: [Point; 2], x: Point) -> f64 {
    distance(between(line[0], line[1], foot(line, x)), x)
}
