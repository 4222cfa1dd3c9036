//! Well-known text: a geometry in a line (OGC 06-103r4), after the words that a plan needs:
//!
//! ```text
//! # kind, name, count=N or density=X, geometry; without a kind it is a wall
//! POLYGON ((0 0, 9 0, 9 4, 0 4, 0 0), (2 1, 3 1, 3 2, 2 1))
//! exit "main door" LINESTRING (9 1, 9 3)
//! start count=20 POLYGON ((0.5 0.5, 1.5 0.5, 1.5 3.5, 0.5 0.5))
//! ```
//!
//! Of a polygon the rings are lines, so that a walkable area has walls around it.

use super::{Drawing, Point, Shape, Tag};

const FORMS: [&str; 8] =
    ["POINT", "MULTIPOINT", "LINESTRING", "MULTILINESTRING", "LINEARRING", "POLYGON", "MULTIPOLYGON", "GEOMETRYCOLLECTION"];

pub fn read(bytes: &[u8]) -> Result<Drawing, String> {
    let bytes = crate::text::unmarked(bytes);
    let text = crate::text::lines_of(&bytes);
    let mut drawing = Drawing::default();
    // A geometry may go on over several lines.
    let mut entry = String::new();
    let (mut first, mut open) = (1, 0_i64);
    for (k, line) in text.lines().enumerate() {
        let line = line.trim();
        if entry.is_empty() {
            first = k + 1;
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
        }
        entry.push_str(line);
        entry.push(' ');
        open += line.chars().map(|c| i64::from(c == '(') - i64::from(c == ')')).sum::<i64>();
        if open <= 0 {
            geometry(&mut drawing, &entry, first)?;
            entry.clear();
            open = 0;
        }
    }
    if entry.is_empty() { Ok(drawing) } else { Err(format!("line {first}: a parenthesis is never closed; close it")) }
}

/// Adds an entry.
fn geometry(drawing: &mut Drawing, entry: &str, line: usize) -> Result<(), String> {
    let place = format!("line {line}");
    let end = entry.find('(').unwrap_or(entry.len());
    let words = words(&entry[..end]);
    let is_form = |word: &String| FORMS.iter().any(|form| word.rsplit(';').next().is_some_and(|last| last.eq_ignore_ascii_case(form)));
    let Some(at) = words.iter().position(is_form) else {
        return Err(format!("{place}: no geometry, expected POLYGON ((...)), LINESTRING (...) or several of them"));
    };
    let mut shape = Shape { place, ..Shape::default() };
    let mut layer = None;
    for word in &words[..at] {
        match word.split_once('=') {
            Some(("count", number)) => shape.count = Some(number.to_owned()),
            Some(("density", number)) => shape.density = Some(number.to_owned()),
            Some(("name", name)) => shape.name = Some(name.to_owned()),
            _ if layer.is_none() => layer = Some(word.trim_end_matches(':').to_owned()),
            _ => shape.name = Some(word.clone()),
        }
    }
    let layer = layer.unwrap_or_else(|| "wall".to_owned());
    let tag = Tag { names: vec![layer.clone()], layer };
    if words[at].to_ascii_uppercase().ends_with("POINT") {
        drawing.count(tag, "point");
        return Ok(());
    }
    shape.tag = drawing.tag(tag);
    // Innermost pairs of parentheses are lines, whatever they are nested in.
    for piece in entry[end..].split(['(', ')']) {
        let letters = piece.contains(|c: char| c.is_alphabetic() && c != 'e' && c != 'E');
        if piece.trim_matches([' ', ',']).is_empty() || letters {
            continue;
        }
        let points = piece.split(',').map(point).collect::<Option<Vec<Point>>>();
        let points = points.ok_or_else(|| {
            format!("{}: {:?} are no points x y, ...; mend them", shape.place, piece.chars().take(40).collect::<String>())
        })?;
        drawing.add(Shape { points, ..shape.clone() })?;
    }
    Ok(())
}

fn point(text: &str) -> Option<Point> {
    let mut numbers = text.split_whitespace().map(str::parse::<f64>);
    Some([numbers.next()?.ok()?, numbers.next()?.ok()?])
}

/// Words parted by blanks; those in quotes may have some.
fn words(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut word = String::new();
    let mut quoted = false;
    for c in text.chars().chain([' ']) {
        match c {
            '"' => quoted = !quoted,
            c if c.is_whitespace() && !quoted => {
                if !word.is_empty() {
                    found.push(std::mem::take(&mut word));
                }
            }
            c => word.push(c),
        }
    }
    found
}
