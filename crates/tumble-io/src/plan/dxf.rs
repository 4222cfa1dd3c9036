//! DXF, the text form: pairs of a group code and a value (AutoCAD's DXF Reference).
//!
//! Read here and not with the crate `dxf`, which knows a hundred kinds of objects and needs as many crates, images and zip among them;
//! a plan is made of nine. Blocks are exploded with their scale, rotation and rows; what is on layer 0 of a block is on the layer of its
//! insertion. Objects whose axis points down are mirrored, as the format has it. Paper space is left out.

use super::curves::{Place, arc, bulged};
use super::spline::spline;
use super::{Drawing, Point, Shape, Tag, distance};
use std::borrow::Cow;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// Blocks in blocks.
const DEEP: usize = 16;
/// Copies of a block by one insertion.
const COPIES: f64 = 10_000.0;
/// Insertions in all.
const INSERTED: usize = 200_000;

const EXPORT: &str = "export it again as DXF (text, release 2000 or later)";

/// Units of `$INSUNITS`: number, name, metres.
const UNITS: [(i64, &str, f64); 9] = [
    (1, "in", 0.0254),
    (2, "ft", 0.3048),
    (4, "mm", 0.001),
    (5, "cm", 0.01),
    (6, "m", 1.0),
    (7, "km", 1000.0),
    (10, "yd", 0.9144),
    (14, "dm", 0.1),
    (21, "US survey ft", 1200.0 / 3937.0),
];

/// What begins with group 0: its kind, its pairs, and the line of the file where it stands.
struct Record<'a> {
    kind: &'a str,
    pairs: Vec<(i32, &'a str)>,
    line: usize,
}

impl<'a> Record<'a> {
    fn text(&self, code: i32) -> Option<&'a str> {
        self.pairs.iter().find(|pair| pair.0 == code).map(|pair| pair.1)
    }

    fn number(&self, code: i32) -> Option<f64> {
        self.text(code)?.parse().ok()
    }

    fn numbers(&self, code: i32) -> Vec<f64> {
        self.pairs.iter().filter(|pair| pair.0 == code).filter_map(|pair| pair.1.parse().ok()).collect()
    }

    fn or(&self, code: i32, default: f64) -> f64 {
        self.number(code).unwrap_or(default)
    }

    fn flags(&self) -> i64 {
        self.text(70).and_then(|text| text.parse().ok()).unwrap_or(0)
    }

    fn point(&self, code: i32) -> Point {
        [self.or(code, 0.0), self.or(code + 10, 0.0)]
    }

    /// Points of repeated groups 10 and 20.
    fn points(&self) -> Vec<Point> {
        self.numbers(10).into_iter().zip(self.numbers(20)).map(|(x, y)| [x, y]).collect()
    }

    /// From the object's own coordinates to the world's: mirrored where its axis points down.
    fn own(&self) -> Place {
        let mut place = Place::HERE;
        if self.or(230, 1.0) < 0.0 {
            place.m[0] = -1.0;
        }
        place
    }
}

/// The text of a file: UTF-8, or of one byte a letter as before 2007, with \U+XXXX for others.
fn decoded(bytes: &[u8]) -> String {
    let bytes = crate::text::unmarked(bytes);
    let text: Cow<'_, str> = match std::str::from_utf8(&bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|byte| char::from(*byte)).collect()),
    };
    let mut found = String::with_capacity(text.len());
    let mut rest = text.as_ref();
    while let Some(at) = rest.find("\\U+") {
        let letter = rest.get(at + 3..at + 7).and_then(|hex| u32::from_str_radix(hex, 16).ok()).and_then(char::from_u32);
        found.push_str(&rest[..at]);
        match letter {
            Some(letter) => {
                found.push(letter);
                rest = &rest[at + 7..];
            }
            None => {
                found.push_str("\\U+");
                rest = &rest[at + 3..];
            }
        }
    }
    found.push_str(rest);
    found
}

/// All records. Pairs before the first are dropped.
fn records(text: &str) -> Result<Vec<Record<'_>>, String> {
    let mut lines = text.lines().enumerate();
    let mut found: Vec<Record<'_>> = Vec::new();
    while let Some((k, code)) = lines.next() {
        if code.trim().is_empty() && lines.clone().all(|(_, line)| line.trim().is_empty()) {
            break;
        }
        let Ok(code) = code.trim().parse::<i32>() else {
            return Err(format!("line {}: {:?} is no group code; {EXPORT}", k + 1, short(code)));
        };
        let Some((_, value)) = lines.next() else {
            return Err(format!("line {}: the file ends after a group code; it is cut off: {EXPORT}", k + 1));
        };
        match found.last_mut() {
            _ if code == 0 => found.push(Record { kind: value.trim(), pairs: Vec::new(), line: k + 1 }),
            Some(record) if code != 999 => record.pairs.push((code, value.trim())),
            _ => {}
        }
    }
    Ok(found)
}

fn short(text: &str) -> String {
    text.trim().chars().take(20).collect()
}

/// A block: where its origin is, and its records.
struct Block {
    base: Point,
    records: std::ops::Range<usize>,
}

struct Reader<'a> {
    records: &'a [Record<'a>],
    blocks: HashMap<&'a str, Block>,
    drawing: Drawing,
    fine: f64,
    inserted: usize,
}

/// What an object is in: where, on which layers, and in which insertion.
#[derive(Clone)]
struct Context {
    place: Place,
    /// Of the insertions around it and their blocks, from the inside outward.
    names: Vec<String>,
    block: usize,
    depth: usize,
}

pub fn read(bytes: &[u8], fine: impl Fn(&Option<(String, f64)>) -> f64) -> Result<Drawing, String> {
    if bytes.starts_with(b"AutoCAD Binary DXF") {
        return Err(format!("a binary DXF file; {EXPORT}"));
    }
    if bytes.starts_with(b"AC10") {
        return Err(format!("a DWG file; {EXPORT}"));
    }
    let text = decoded(bytes);
    let records = records(&text)?;
    if !records.iter().any(|record| record.kind == "EOF") {
        return Err(format!("no EOF at its end; the file is cut off, or is no DXF: {EXPORT}"));
    }
    let mut reader = Reader { records: &records, blocks: HashMap::new(), drawing: Drawing::default(), fine: 1.0, inserted: 0 };
    let mut objects = 0..0;
    let mut section = "";
    for (k, record) in records.iter().enumerate() {
        match record.kind {
            "SECTION" => {
                section = record.text(2).unwrap_or("");
                if section == "HEADER" {
                    reader.drawing.unit = unit(record);
                } else if section == "ENTITIES" {
                    objects = k + 1..k + 1 + count(&records[k + 1..], "ENDSEC");
                }
            }
            "BLOCK" if section == "BLOCKS" => {
                let block = Block { base: record.point(10), records: k + 1..k + 1 + count(&records[k + 1..], "ENDBLK") };
                reader.blocks.insert(record.text(2).unwrap_or(""), block);
            }
            "LAYER" if section == "TABLES" => {
                let name = record.text(2).unwrap_or("").to_owned();
                // Frozen, or switched off.
                if record.flags() & 1 != 0 || record.or(62, 7.0) < 0.0 {
                    reader.drawing.hidden.push(name.clone());
                }
                reader.drawing.tag(Tag { names: vec![name.clone()], layer: name });
            }
            _ => {}
        }
    }
    if objects.is_empty() {
        return Err(format!("no objects in its section ENTITIES; draw in model space, and {EXPORT}"));
    }
    reader.fine = fine(&reader.drawing.unit);
    reader.all(objects, &Context { place: Place::HERE, names: Vec::new(), block: 0, depth: 0 })?;
    Ok(reader.drawing)
}

/// Records before the first of a kind.
fn count(records: &[Record<'_>], end: &str) -> usize {
    records.iter().take_while(|record| record.kind != end).count()
}

/// The unit of the header.
fn unit(header: &Record<'_>) -> Option<(String, f64)> {
    let at = header.pairs.iter().position(|pair| *pair == (9, "$INSUNITS"))?;
    let number = header.pairs.get(at + 1)?.1.parse::<i64>().ok()?;
    UNITS.iter().find(|unit| unit.0 == number).map(|(_, name, metres)| ((*name).to_owned(), *metres))
}

impl<'a> Reader<'a> {
    /// Adds what is drawn by a range of records.
    fn all(&mut self, range: std::ops::Range<usize>, around: &Context) -> Result<(), String> {
        let mut k = range.start;
        while k < range.end {
            let records = self.records;
            let record = &records[k];
            k += 1;
            if record.or(67, 0.0) != 0.0 {
                continue;
            }
            // Vertices of old polylines and texts of insertions are objects of their own.
            let parts = match record.kind {
                "POLYLINE" => count(&records[k..range.end], "SEQEND"),
                "INSERT" if record.or(66, 0.0) != 0.0 => count(&records[k..range.end], "SEQEND"),
                _ => 0,
            };
            let vertices = k..k + parts;
            k += parts;
            match record.kind {
                "INSERT" => self.insert(record, around)?,
                kind => self.object(kind, record, vertices, around)?,
            }
        }
        Ok(())
    }

    /// Names of an object: its layer, which is that of the insertion where it is 0, and those around it.
    fn tag(&self, record: &Record<'_>, around: &Context) -> Tag {
        let own = record.text(8).unwrap_or("0");
        let mut names = around.names.clone();
        if own != "0" || names.is_empty() {
            names.insert(0, own.to_owned());
        }
        Tag { layer: names[0].clone(), names }
    }

    /// Adds one object.
    fn object(&mut self, kind: &str, record: &Record<'_>, vertices: std::ops::Range<usize>, around: &Context) -> Result<(), String> {
        let place = around.place.of(&record.own());
        let fine = self.fine / around.place.stretch().max(1e-300);
        let degrees = |code: i32, default: f64| record.or(code, default).to_radians();
        let mut round = None;
        let (points, world) = match kind {
            "LINE" => (vec![record.point(10), record.point(11)], true),
            "LWPOLYLINE" => (polyline(&lightweight(record), record.flags() & 1 != 0, fine), false),
            // Meshes and surfaces of three dimensions are none.
            "POLYLINE" if record.flags() & (16 | 64) == 0 => {
                let corner = |v: &Record<'_>| (v.point(10), v.or(42, 0.0));
                let corners: Vec<(Point, f64)> = self.records[vertices].iter().filter(|v| v.kind == "VERTEX").map(corner).collect();
                (polyline(&corners, record.flags() & 1 != 0, fine), record.flags() & 8 != 0)
            }
            "ARC" => {
                let (centre, radius) = (record.point(10), record.or(40, 0.0));
                let (from, to) = (degrees(50, 0.0), degrees(51, 0.0));
                let points = arc(centre, [[radius, 0.0], [0.0, radius]], from, (to - from).rem_euclid(TAU), fine);
                round = points.first().zip(points.last()).map(|(a, b)| [centre, *a, *b]);
                (points, false)
            }
            "CIRCLE" => {
                let radius = record.or(40, 0.0);
                (arc(record.point(10), [[radius, 0.0], [0.0, radius]], 0.0, TAU, fine), false)
            }
            "ELLIPSE" => {
                let (major, ratio) = (record.point(11), record.or(40, 1.0));
                let minor = [-major[1] * ratio, major[0] * ratio].map(|x| if record.or(230, 1.0) < 0.0 { -x } else { x });
                let (from, to) = (record.or(41, 0.0), record.or(42, TAU));
                let turn = if (to - from - TAU).abs() < 1e-9 { TAU } else { (to - from).rem_euclid(TAU) };
                (arc(record.point(10), [major, minor], from, turn, fine), true)
            }
            "SPLINE" => {
                let degree = record.or(71, 3.0) as usize;
                let found = spline(degree, &record.numbers(40), &record.points(), &record.numbers(41), fine);
                let through = || record.numbers(11).into_iter().zip(record.numbers(21)).map(|(x, y)| [x, y]).collect();
                (found.unwrap_or_else(through), true)
            }
            _ => {
                if let Some(form) = form(kind) {
                    let tag = self.tag(record, around);
                    self.drawing.count(tag, form);
                }
                return Ok(());
            }
        };
        let place = if world { around.place } else { place };
        let tag = self.tag(record, around);
        let arc = round.filter(|_| place.is_even()).map(|ends| ends.map(|x| place.at(x)));
        let points = points.into_iter().map(|x| place.at(x)).collect();
        let tag = self.drawing.tag(tag);
        let place = format!("line {}: {kind} on layer {:?}", record.line, self.drawing.tags[tag].layer);
        self.drawing.add(Shape { points, arc, tag, block: around.block, place, ..Shape::default() })
    }

    /// Adds what a block draws, once for each row and column of its insertion.
    fn insert(&mut self, record: &Record<'a>, around: &Context) -> Result<(), String> {
        let name = record.text(2).unwrap_or("");
        let Some(block) = self.blocks.get(name) else {
            return Ok(());
        };
        let place = format!("line {}: INSERT of block {:?}", record.line, short(name));
        if around.depth >= DEEP {
            return Err(format!("{place}: {DEEP} blocks in blocks; explode some, and {EXPORT}"));
        }
        let (columns, rows) = (record.or(70, 1.0).max(1.0), record.or(71, 1.0).max(1.0));
        if columns * rows > COPIES {
            return Err(format!("{place}: {columns} by {rows} copies, expected at most {COPIES}; explode it, and {EXPORT}"));
        }
        let (base, range) = (block.base, block.records.clone());
        let (sx, sy) = (record.or(41, 1.0), record.or(42, 1.0));
        let turn = record.or(50, 0.0).to_radians();
        let (s, c) = (libm::sin(turn), libm::cos(turn));
        let mut names = self.tag(record, around).names;
        names.push(name.to_owned());
        for k in 0..(columns * rows) as usize {
            self.inserted += 1;
            if self.inserted > INSERTED {
                return Err(format!("{place}: more than {INSERTED} blocks; leave out what is no wall, door, exit or start, and {EXPORT}"));
            }
            let (column, row) = ((k % columns as usize) as f64, (k / columns as usize) as f64);
            let (x, y) = (column * record.or(44, 0.0), row * record.or(45, 0.0));
            let [e, f] = record.point(10);
            let turned = Place { m: [c * sx, s * sx, -s * sy, c * sy, e + c * x - s * y, f + s * x + c * y] };
            let moved = Place { m: [1.0, 0.0, 0.0, 1.0, -base[0], -base[1]] };
            let place = around.place.of(&record.own()).of(&turned).of(&moved);
            // Parts of a block in a block belong to the outer one.
            let block = if around.block > 0 { around.block } else { self.inserted };
            self.all(range.clone(), &Context { place, names: names.clone(), block, depth: around.depth + 1 })?;
        }
        Ok(())
    }
}

/// What objects that are no lines are called; `None` of what draws nothing.
fn form(kind: &str) -> Option<&'static str> {
    match kind {
        "TEXT" | "MTEXT" | "ATTRIB" | "ATTDEF" => Some("text"),
        "HATCH" | "SOLID" | "3DFACE" | "POLYLINE" | "MLINE" | "TRACE" | "REGION" | "3DSOLID" | "BODY" | "MESH" => Some("area or solid"),
        "DIMENSION" | "LEADER" | "MULTILEADER" => Some("dimension"),
        "POINT" => Some("point"),
        _ => None,
    }
}

/// Corners and bulges of a LWPOLYLINE.
fn lightweight(record: &Record<'_>) -> Vec<(Point, f64)> {
    let mut corners: Vec<(Point, f64)> = Vec::new();
    for (code, value) in &record.pairs {
        let Ok(number) = value.parse::<f64>() else { continue };
        match (*code, corners.last_mut()) {
            (10, _) => corners.push(([number, 0.0], 0.0)),
            (20, Some(corner)) => corner.0[1] = number,
            (42, Some(corner)) => corner.1 = number,
            _ => {}
        }
    }
    corners
}

/// Points of a polyline whose sides may be arcs.
fn polyline(corners: &[(Point, f64)], closed: bool, fine: f64) -> Vec<Point> {
    let mut points: Vec<Point> = corners.first().map(|corner| corner.0).into_iter().collect();
    let n = corners.len();
    for k in 0..n.saturating_sub(usize::from(!closed)) {
        let ((a, bulge), (b, _)) = (corners[k], corners[(k + 1) % n]);
        if bulge.abs() > 1e-6 && a != b {
            let (centre, from, turn) = bulged(a, b, bulge);
            let radius = distance(centre, a);
            let chords = arc(centre, [[radius, 0.0], [0.0, radius]], from, turn, fine);
            points.extend(&chords[1..chords.len() - 1]);
        }
        points.push(b);
    }
    points
}
