//! GeoJSON (RFC 7946): lines and polygons of features whose property `kind` or `layer` says what they are.

use super::{Drawing, Point, Shape, Tag};
use serde_json::{Map, Value};

/// Properties that name a layer; programs that convert drawings write the last.
const LAYERS: [&str; 4] = ["kind", "layer", "Layer", "LAYER"];

pub fn read(bytes: &[u8]) -> Result<Drawing, String> {
    let tree: Value =
        serde_json::from_slice(&crate::text::unmarked(bytes)).map_err(|error| format!("no JSON: {error}; export the plan again"))?;
    let features = tree.get("features").and_then(Value::as_array);
    let features = features.ok_or("no list of features, expected a FeatureCollection")?;
    let mut drawing = Drawing::default();
    let none = Map::new();
    for (k, feature) in features.iter().enumerate() {
        let words = feature.get("properties").and_then(Value::as_object).unwrap_or(&none);
        let layer = LAYERS.iter().find_map(|key| words.get(*key)?.as_str()).unwrap_or("").to_owned();
        let tag = drawing.tag(Tag { names: vec![layer.clone()], layer });
        let text =
            |key: &str| words.get(key).filter(|value| !value.is_null()).map(|v| v.as_str().map_or_else(|| v.to_string(), str::to_owned));
        let shape = Shape {
            tag,
            place: format!("features[{k}]"),
            name: text("name").filter(|name| !name.is_empty()),
            count: text("count"),
            density: text("density"),
            ..Shape::default()
        };
        if let Some(geometry) = feature.get("geometry").filter(|geometry| !geometry.is_null()) {
            lines(&mut drawing, geometry, &shape, 0)?;
        }
    }
    Ok(drawing)
}

/// Adds the lines of a geometry, with the words of `shape`.
fn lines(drawing: &mut Drawing, geometry: &Value, shape: &Shape, depth: usize) -> Result<(), String> {
    let form = geometry.get("type").and_then(Value::as_str).unwrap_or("");
    let coordinates = geometry.get("coordinates").unwrap_or(&Value::Null);
    let wrong = || format!("{}: coordinates are no list of points; export the plan again", shape.place);
    let list = |value: &Value| value.as_array().cloned().ok_or_else(wrong);
    let mut add = |line: &Value| -> Result<(), String> {
        let points =
            line.as_array().ok_or_else(wrong)?.iter().map(|p| point(p).ok_or_else(wrong)).collect::<Result<Vec<Point>, String>>()?;
        drawing.add(Shape { points, ..shape.clone() })
    };
    match form {
        "LineString" => add(coordinates),
        "MultiLineString" | "Polygon" => list(coordinates)?.iter().try_for_each(add),
        "MultiPolygon" => list(coordinates)?.iter().try_for_each(|polygon| list(polygon)?.iter().try_for_each(&mut add)),
        "GeometryCollection" if depth < 8 => {
            let parts = geometry.get("geometries").and_then(Value::as_array).ok_or_else(wrong)?;
            parts.iter().try_for_each(|part| lines(drawing, part, shape, depth + 1))
        }
        "Point" | "MultiPoint" => {
            let tag = drawing.tags[shape.tag].clone();
            drawing.count(tag, "point");
            Ok(())
        }
        _ => Err(format!("{}: a geometry {form:?}, expected a LineString, a Polygon, or several of them", shape.place)),
    }
}

fn point(value: &Value) -> Option<Point> {
    let numbers = value.as_array()?;
    Some([numbers.first()?.as_f64()?, numbers.get(1)?.as_f64()?])
}
