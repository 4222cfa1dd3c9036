//! SVG: shapes and paths with their transforms, `use` and symbols; names are Inkscape's labels, classes and ids, from an element outward.
//!
//! With `roxmltree` and `svgtypes`, and not with `usvg`, which drops classes, labels and `data-name`. Style sheets are not read: of what hides
//! elements only `display="none"` counts, as attribute or in `style`. A unit is what `width` says of the `viewBox`; y is turned up.

use super::curves::{Place, arc, bezier};
use super::{Drawing, Point, Shape, Tag};
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::str::FromStr;
use svgtypes::{Length, LengthUnit, PointsParser, SimplePathSegment, SimplifyingPathParser, Transform};

/// Elements in elements.
const DEEP: usize = 200;
/// Elements, those that are used again counted again.
const ELEMENTS: usize = 1_000_000;

/// What draws nothing by itself.
const SILENT: [&str; 11] =
    ["defs", "symbol", "clipPath", "mask", "pattern", "marker", "metadata", "style", "script", "namedview", "linearGradient"];

struct Reader<'a> {
    by_id: HashMap<&'a str, Node<'a, 'a>>,
    drawing: Drawing,
    fine: f64,
    elements: usize,
}

/// What an element is in.
#[derive(Clone)]
struct Context {
    place: Place,
    names: Vec<String>,
    /// Name of the nearest group that has one.
    group: Option<String>,
    depth: usize,
}

pub fn read(bytes: &[u8], fine: impl Fn(&Option<(String, f64)>) -> f64) -> Result<Drawing, String> {
    if bytes.starts_with(&[0x1f, 0x8b]) {
        return Err("a compressed SVG; save it as plain SVG".to_owned());
    }
    let bytes = crate::text::unmarked(bytes);
    let text = std::str::from_utf8(&bytes).map_err(|error| format!("no UTF-8 text ({error}); save it as plain SVG again"))?;
    let options = ParsingOptions { allow_dtd: true, nodes_limit: ELEMENTS as u32, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| format!("no XML: {error}; save it as plain SVG again"))?;
    let root = document.root_element();
    if root.tag_name().name() != "svg" {
        return Err(format!("the first element is <{}>, expected <svg>; save it as plain SVG", root.tag_name().name()));
    }
    let by_id = root.descendants().filter_map(|node| Some((node.attribute("id")?, node))).collect();
    let mut reader = Reader { by_id, drawing: Drawing { unit: unit(&root), ..Drawing::default() }, fine: 1.0, elements: 0 };
    reader.fine = fine(&reader.drawing.unit);
    let up = Place { m: [1.0, 0.0, 0.0, -1.0, 0.0, 0.0] };
    reader.children(&root, &Context { place: up, names: Vec::new(), group: None, depth: 0 })?;
    Ok(reader.drawing)
}

/// Metres of a length; `None` of pixels and parts.
fn metres(length: Length) -> Option<(&'static str, f64)> {
    match length.unit {
        LengthUnit::Mm => Some(("mm", 0.001)),
        LengthUnit::Cm => Some(("cm", 0.01)),
        LengthUnit::In => Some(("in", 0.0254)),
        _ => None,
    }
}

/// The unit of the document.
fn unit(root: &Node<'_, '_>) -> Option<(String, f64)> {
    let width = Length::from_str(root.attribute("width")?).ok()?;
    let (name, each) = metres(width)?;
    let view: Vec<f64> = root.attribute("viewBox")?.split([' ', ',']).filter_map(|x| x.parse().ok()).collect();
    let across = view.get(2).copied().filter(|x| *x > 0.0 && width.number > 0.0)?;
    let scale = width.number * each / across;
    let same = (width.number / across - 1.0).abs() < 1e-9;
    Some((if same { name.to_owned() } else { format!("{scale:.4} m, by its width in {name}") }, scale))
}

fn is_hidden(node: &Node<'_, '_>) -> bool {
    let style = node.attribute("style").unwrap_or("").replace(' ', "");
    node.attribute("display") == Some("none") || style.contains("display:none")
}

impl<'a> Reader<'a> {
    fn children(&mut self, node: &Node<'a, 'a>, context: &Context) -> Result<(), String> {
        node.children().filter(Node::is_element).try_for_each(|child| self.element(&child, context))
    }

    /// Adds what an element and those in it draw.
    fn element(&mut self, node: &Node<'a, 'a>, around: &Context) -> Result<(), String> {
        let name = node.tag_name().name();
        self.elements += 1;
        if around.depth > DEEP || self.elements > ELEMENTS {
            return Err(format!("{}: elements used in each other without end; draw them out", place_of(node)));
        }
        if SILENT.contains(&name) {
            return Ok(());
        }
        let label = node.attributes().find(|a| a.name() == "label" && a.namespace().is_some()).map(|a| a.value());
        let class = node.attribute("class").unwrap_or("").split_whitespace();
        let own: Vec<String> = label.into_iter().chain(class).chain(node.attribute("id")).map(str::to_owned).collect();
        let is_group = matches!(name, "g" | "svg" | "a" | "switch" | "use");
        let group = if is_group { own.first().cloned().or_else(|| around.group.clone()) } else { around.group.clone() };
        if is_hidden(node) {
            match &group {
                Some(group) if is_group => self.drawing.hidden.push(group.clone()),
                _ => return Ok(()),
            }
        }
        let place = match node.attribute("transform") {
            Some(text) => {
                let t = Transform::from_str(text).map_err(|error| format!("{}: transform {text:?}: {error}; mend it", place_of(node)))?;
                around.place.of(&Place { m: [t.a, t.b, t.c, t.d, t.e, t.f] })
            }
            None => around.place,
        };
        let context = Context { place, names: [own, around.names.clone()].concat(), group, depth: around.depth + 1 };
        match name {
            "use" => self.used(node, &context),
            "g" | "svg" | "a" | "switch" => self.children(node, &context),
            "text" | "image" | "foreignObject" => {
                let tag = tag(&context);
                self.drawing.count(tag, if name == "text" { "text" } else { "picture" });
                Ok(())
            }
            _ => self.shape(node, &context),
        }
    }

    /// Adds what `use` refers to.
    fn used(&mut self, node: &Node<'a, 'a>, context: &Context) -> Result<(), String> {
        let link = node.attributes().find(|a| a.name() == "href").map(|a| a.value().trim_start_matches('#'));
        let Some(target) = link.and_then(|id| self.by_id.get(id)).copied() else {
            return Ok(());
        };
        let shift = Place { m: [1.0, 0.0, 0.0, 1.0, length(node, "x")?, length(node, "y")?] };
        let context = Context { place: context.place.of(&shift), ..context.clone() };
        if target.tag_name().name() == "symbol" { self.children(&target, &context) } else { self.element(&target, &context) }
    }

    /// Adds the lines of a shape.
    fn shape(&mut self, node: &Node<'a, 'a>, context: &Context) -> Result<(), String> {
        let at = |name: &str| length(node, name);
        let fine = self.fine / context.place.stretch().max(1e-300);
        let lines = match node.tag_name().name() {
            "line" => vec![vec![[at("x1")?, at("y1")?], [at("x2")?, at("y2")?]]],
            "rect" => {
                let (x, y, w, h) = (at("x")?, at("y")?, at("width")?, at("height")?);
                vec![vec![[x, y], [x + w, y], [x + w, y + h], [x, y + h], [x, y]]]
            }
            "circle" | "ellipse" => {
                let radius = |own: &str| if node.has_attribute(own) { at(own) } else { at("r") };
                let (rx, ry) = (radius("rx")?, radius("ry")?);
                vec![arc([at("cx")?, at("cy")?], [[rx, 0.0], [0.0, ry]], 0.0, TAU, fine)]
            }
            name @ ("polyline" | "polygon") => {
                let mut points: Vec<Point> = PointsParser::from(node.attribute("points").unwrap_or("")).map(|(x, y)| [x, y]).collect();
                points.extend(points.first().copied().filter(|_| name == "polygon"));
                vec![points]
            }
            "path" => path(node.attribute("d").unwrap_or(""), fine).map_err(|error| format!("{}: {error}; mend it", place_of(node)))?,
            _ => return Ok(()),
        };
        let tag = self.drawing.tag(tag(context));
        let word = |name: &str| node.attribute(name).map(str::to_owned);
        let words = Shape {
            tag,
            place: place_of(node),
            name: word("data-name").filter(|name| !name.is_empty()),
            count: word("data-count"),
            density: word("data-density"),
            ..Shape::default()
        };
        lines.into_iter().try_for_each(|line| {
            let points = line.into_iter().map(|x| context.place.at(x)).collect();
            self.drawing.add(Shape { points, ..words.clone() })
        })
    }
}

fn tag(context: &Context) -> Tag {
    let layer = context.group.clone().or_else(|| context.names.first().cloned()).unwrap_or_default();
    Tag { names: context.names.clone(), layer }
}

/// An element and where it is.
fn place_of(node: &Node<'_, '_>) -> String {
    let id = node.attribute("data-name").or_else(|| node.attribute("id"));
    let line = node.document().text_pos_at(node.range().start).row;
    format!("line {line}: <{}>{}", node.tag_name().name(), id.map(|id| format!(" {id:?}")).unwrap_or_default())
}

/// A length in user units, 0 where there is none.
fn length(node: &Node<'_, '_>, name: &str) -> Result<f64, String> {
    let Some(text) = node.attribute(name) else { return Ok(0.0) };
    let wrong = || format!("{}: {name} = {text:?} is no length; mend it", place_of(node));
    let length = Length::from_str(text).map_err(|_| wrong())?;
    // Of CSS: 96 pixels an inch.
    let pixels = 96.0 / 0.0254;
    match length.unit {
        LengthUnit::None | LengthUnit::Px => Ok(length.number),
        LengthUnit::Pt => Ok(length.number * 4.0 / 3.0),
        LengthUnit::Pc => Ok(length.number * 16.0),
        _ => metres(length).map(|(_, each)| length.number * each * pixels).ok_or_else(wrong),
    }
}

/// Lines of a path, one for each of its parts.
fn path(data: &str, fine: f64) -> Result<Vec<Vec<Point>>, String> {
    let mut lines: Vec<Vec<Point>> = Vec::new();
    for segment in SimplifyingPathParser::from(data) {
        let segment = segment.map_err(|error| format!("its path: {error}"))?;
        if let SimplePathSegment::MoveTo { x, y } = segment {
            lines.push(vec![[x, y]]);
            continue;
        }
        let Some(line) = lines.last_mut() else { continue };
        let from = line[line.len() - 1];
        match segment {
            SimplePathSegment::MoveTo { .. } => {}
            SimplePathSegment::LineTo { x, y } => line.push([x, y]),
            SimplePathSegment::Quadratic { x1, y1, x, y } => bezier(line, &[from, [x1, y1], [x, y]], fine),
            SimplePathSegment::CurveTo { x1, y1, x2, y2, x, y } => bezier(line, &[from, [x1, y1], [x2, y2], [x, y]], fine),
            SimplePathSegment::ClosePath => line.push(line[0]),
        }
    }
    Ok(lines)
}
