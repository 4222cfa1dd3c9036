//! Records of measured fabrics: TOML as shipped, JSON as found with simulators of cloth.

use tumble_interface::check::suggestion;
use tumble_interface::tree::{Node, Value};
use tumble_interface::{Fabric, SceneError};

/// The fabrics that ship, by name.
const SHIPPED: [(&str, &str); 3] = [
    ("denim", include_str!("../../../python/tumble/fabrics/denim.toml")),
    ("interlock", include_str!("../../../python/tumble/fabrics/interlock.toml")),
    ("tablecloth", include_str!("../../../python/tumble/fabrics/tablecloth.toml")),
];

/// Keys of our own file format.
const KEYS: [&str; 6] = ["name", "composition", "source", "density", "stretching", "bending"];
/// Meaning of each row of stretching.
const STRETCHED: [&str; 6] = ["small strain", "0°", "22.5°", "45°", "67.5°", "90°"];
/// Meaning of each row of bending.
const CREASED: [&str; 3] = ["0°", "45°", "90°"];

/// The record of a shipped fabric.
///
/// # Errors
/// One line: which there are.
pub fn shipped(name: &str) -> Result<Fabric, String> {
    let names = || SHIPPED.iter().map(|(name, _)| *name);
    let Some((_, text)) = SHIPPED.iter().find(|(known, _)| *known == name) else {
        let hint = suggestion(name, names());
        let list = names().collect::<Vec<_>>().join(", ");
        return Err(format!("there is no fabric \"{name}\"{hint} (bundled: {list}; others by {{ path = \"...\" }})"));
    };
    fabric(text.as_bytes(), false)
}

/// Whether the file extension of `path` is that of a record in JSON (or else in TOML).
pub fn record_is_json(path: &str) -> Option<bool> {
    let (_, extension) = path.rsplit_once('.')?;
    [("json", true), ("toml", false)].into_iter().find(|(name, _)| extension.eq_ignore_ascii_case(name)).map(|(_, json)| json)
}

/// Reads a record, in TOML or in JSON. All numbers are finite, the density is > 0, and every row of stretching is that of a material that
/// resists every stretch.
///
/// # Errors
/// One line: what is wrong with the record, where, and what to do.
pub fn fabric(bytes: &[u8], json: bool) -> Result<Fabric, String> {
    read(bytes, json).map_err(|message| crate::one_line(&message))
}

fn read(bytes: &[u8], json: bool) -> Result<Fabric, String> {
    let bytes = crate::text::unmarked(bytes);
    let text = std::str::from_utf8(&bytes).map_err(|_| "not UTF-8 text; a fabric is a TOML or JSON file".to_owned())?;
    let first = |e: SceneError| {
        e.issues.first().map_or_else(String::new, |i| i.line.map_or(String::new(), |line| format!("line {line}: ")) + &i.message)
    };
    let node = if json { Node::from_json(text) } else { Node::from_toml(text) }.map_err(first)?;
    let Value::Table(entries) = &node.value else {
        return Err(format!("{}, expected a table with density, stretching and bending", show(&node)));
    };
    // Records of other programs have words of their own.
    if let Some((key, below)) = entries.iter().find(|(key, _)| !json && !KEYS.contains(&key.as_str())) {
        let hint = suggestion(key, KEYS);
        return Err(format!("{}unknown key \"{key}\"{hint} (known: {})", line(below), KEYS.join(", ")));
    }
    let word = |key: &str| node.text(key).unwrap_or_default().to_owned();
    let density = number(entry(&node, "density", "mass per area in kg/m²")?, "density")?;
    if density <= 0.0 {
        return Err(format!("{}density: {density}, expected > 0 kg/m²", line(entry(&node, "density", "")?)));
    }
    let stretching: [[f64; 4]; 6] = rows(&node, "stretching", "C11, C12, C22, C33 in N/m", STRETCHED)?;
    let bending: [[f64; 5]; 3] = rows(&node, "bending", "bending stiffness in N m at the curvatures 0, 10, 20, 30, 40 1/m", CREASED)?;
    for (i, [c11, c12, c22, _]) in stretching.iter().enumerate() {
        let (place, c12) = (format!("stretching row {} ({})", i + 1, STRETCHED[i]), c12.max(0.0));
        if *c11 <= 0.0 || *c22 <= 0.0 {
            return Err(format!("{place}: C11 = {c11} and C22 = {c22}, expected both > 0 N/m; the threads would have no stiffness"));
        }
        if c12 * c12 >= c11 * c22 {
            let most = (c11 * c22).sqrt();
            return Err(format!(
                "{place}: C12 = {c12}, expected < sqrt(C11 C22) = {most:.4}; otherwise some stretch would have negative energy"
            ));
        }
    }
    if let Some(i) = bending.iter().position(|row| row[0] <= 0.0) {
        return Err(format!("bending row {} ({}): starts with {}, expected > 0 N m", i + 1, CREASED[i], bending[i][0]));
    }
    Ok(Fabric { name: word("name"), composition: word("composition"), source: word("source"), density, stretching, bending })
}

fn line(node: &Node) -> String {
    node.line.map_or(String::new(), |line| format!("line {line}: "))
}

fn entry<'a>(node: &'a Node, key: &str, what: &str) -> Result<&'a Node, String> {
    node.entry(key).ok_or_else(|| format!("{key} is missing, expected {what}"))
}

/// Rows of numbers, each with a name.
fn rows<const N: usize, const M: usize>(node: &Node, key: &str, what: &str, names: [&str; N]) -> Result<[[f64; M]; N], String> {
    let all = entry(node, key, &format!("{N} rows of {what}"))?;
    let list = items(all).ok_or_else(|| format!("{}{key}: {}, expected {N} rows of {what}", line(all), show(all)))?;
    if list.len() != N {
        let missing = names.get(list.len()).map_or(String::new(), |name| format!("; row {} ({name}) is missing", list.len() + 1));
        return Err(format!("{}{key}: {} rows, expected {N}: {}{missing}", line(all), list.len(), names.join(", ")));
    }
    let mut out = [[0.0; M]; N];
    for (i, (row, name)) in list.iter().zip(names).enumerate() {
        let place = format!("{key} row {} ({name})", i + 1);
        let numbers = items(row).ok_or_else(|| format!("{}{place}: {}, expected {M} numbers: {what}", line(row), show(row)))?;
        if numbers.len() != M {
            return Err(format!("{}{place}: {} numbers, expected {M}: {what}", line(row), numbers.len()));
        }
        for (j, one) in numbers.iter().enumerate() {
            out[i][j] = number(one, &format!("{place}, number {}", j + 1))?;
        }
    }
    Ok(out)
}

fn items(node: &Node) -> Option<&[Node]> {
    if let Value::List(list) = &node.value { Some(list) } else { None }
}

fn number(node: &Node, place: &str) -> Result<f64, String> {
    let number = match node.value {
        Value::Int(i) => i as f64,
        Value::Float(x) => x,
        _ => return Err(format!("{}{place}: {}, expected a number", line(node), show(node))),
    };
    if number.is_finite() { Ok(number) } else { Err(format!("{}{place}: {number}, expected a finite number", line(node))) }
}

fn show(node: &Node) -> String {
    match &node.value {
        Value::Null => "nothing".into(),
        Value::Bool(b) => b.to_string(),
        Value::Int(i) => i.to_string(),
        Value::Float(x) => x.to_string(),
        Value::Text(text) => format!("\"{text}\""),
        Value::List(list) => format!("a list of {}", list.len()),
        Value::Table(_) => "a table".into(),
    }
}
