//! Checks a tree against the JSON Schema of the scene and reports everything that is wrong at once,
//! with path, line, value, unit and range. (serde stops at the first error and knows no units.)

use crate::error::Issue;
use crate::tree::{Node, Value};
use serde_json::Value as Schema;
use std::sync::LazyLock;

/// All the places where `node` does not fit `schema`; the schema's definitions are looked up in `root`.
pub fn check(node: &Node, root: &Schema) -> Vec<Issue> {
    let mut checker = Checker { root, issues: Vec::new() };
    checker.visit(node, root, "", None);
    checker.issues
}

struct Checker<'a> {
    root: &'a Schema,
    issues: Vec<Issue>,
}

impl<'a> Checker<'a> {
    fn report(&mut self, node: &Node, path: &str, message: String) {
        self.issues.push(Issue::on(node.line, path, message));
    }

    /// Follows `$ref`s to the schema that says something.
    fn resolve(&self, mut schema: &'a Schema) -> &'a Schema {
        while let Some(name) = schema["$ref"].as_str().and_then(|r| r.strip_prefix("#/$defs/")) {
            schema = &self.root["$defs"][name];
        }
        schema
    }

    /// `unit` is that of the list or alternative around the node.
    fn visit(&mut self, node: &Node, schema: &'a Schema, path: &str, unit: Option<&'a str>) {
        let unit = schema["x-unit"].as_str().or(unit);
        let schema = self.resolve(schema);
        let unit = schema["x-unit"].as_str().or(unit);
        let branches = schema["oneOf"].as_array().or(schema["anyOf"].as_array());
        if let Some(branches) = branches {
            return self.visit_branches(node, branches, path, unit);
        }
        if !fits_type(node, schema) {
            let expected = self.describe(schema, unit);
            return self.report(node, path, format!("{}, expected {expected}{}", show(node, unit), rigid(node, schema)));
        }
        match &node.value {
            Value::Float(x) if !x.is_finite() => {
                let expected = self.describe(schema, unit).replacen("number", "finite number", 1);
                self.report(node, path, format!("{}, expected {expected}", show(node, None)))
            }
            Value::Int(_) | Value::Float(_) => {
                if !in_range(number(node), schema) {
                    self.report(node, path, format!("{}, expected {}", show(node, unit), range(schema, unit)));
                }
            }
            Value::Text(text) => self.visit_text(node, text, schema, path),
            Value::List(items) => {
                for (i, item) in items.iter().enumerate() {
                    let fixed = schema["prefixItems"].get(i);
                    let below = fixed.unwrap_or(&schema["items"]);
                    if below.is_object() {
                        self.visit(item, below, &item_path(path, i, item), unit);
                    }
                }
                let length = |key: &str| schema[key].as_u64().map(|n| n as usize);
                if length("minItems").is_some_and(|n| items.len() < n) || length("maxItems").is_some_and(|n| items.len() > n) {
                    let expected = self.describe(schema, unit);
                    self.report(node, path, format!("a list of {}, expected {expected}", items.len()));
                }
            }
            Value::Table(entries) => self.visit_table(node, entries, schema, path),
            Value::Null | Value::Bool(_) => {}
        }
    }

    fn visit_text(&mut self, node: &Node, text: &str, schema: &'a Schema, path: &str) {
        let words = words(schema);
        if !words.is_empty() && !words.contains(&text) {
            let hint = suggestion(text, words.iter().copied());
            self.report(node, path, format!("\"{text}\", expected one of {}{hint}", words.join(", ")));
        }
    }

    fn visit_table(&mut self, node: &Node, entries: &[(String, Node)], schema: &'a Schema, path: &str) {
        static NONE: LazyLock<serde_json::Map<String, Schema>> = LazyLock::new(serde_json::Map::new);
        let properties = match (schema["properties"].as_object(), &schema["additionalProperties"]) {
            (Some(properties), _) => properties,
            (None, Schema::Bool(false)) => &*NONE,
            (None, of) => {
                // Keys of the author's own, all alike.
                if of.is_object() {
                    entries.iter().for_each(|(key, value)| self.visit(value, of, &join(path, key), None));
                }
                return;
            }
        };
        for (key, value) in entries {
            let below = join(path, key);
            match properties.get(key) {
                Some(schema) => self.visit(value, schema, &below, None),
                None => {
                    let known = properties.keys().map(String::as_str).filter(|k| *k != "kind");
                    let hint = suggestion(key, known.clone());
                    let list = match &known.collect::<Vec<_>>()[..] {
                        _ if !hint.is_empty() => hint,
                        [] => "; no key is known here".into(),
                        known => format!("; known here: {}", known.join(", ")),
                    };
                    self.report(value, &below, format!("unknown key{list}"));
                }
            }
        }
        for key in required(schema) {
            if !entries.iter().any(|(k, _)| k == key) {
                let expected = self.describe(&properties[key], properties[key]["x-unit"].as_str());
                self.report(node, &join(path, key), format!("missing, expected {expected}"));
            }
        }
    }

    /// Picks the alternative that the author meant: by its `kind`, else by its single key, else by its type.
    fn visit_branches(&mut self, node: &Node, branches: &'a [Schema], path: &str, unit: Option<&'a str>) {
        let resolved: Vec<&'a Schema> = branches.iter().map(|b| self.resolve(b)).collect();
        let constants: Vec<&str> = resolved.iter().flat_map(|b| words(b)).collect();
        if let Value::Text(text) = &node.value {
            if constants.contains(&text.as_str()) || resolved.iter().any(|b| words(b).is_empty() && !is_choice(b) && fits_type(node, b)) {
                return;
            }
            if !constants.is_empty() {
                let hint = suggestion(text, constants.iter().copied());
                return self.report(node, path, format!("\"{text}\", expected one of {}{hint}", constants.join(", ")));
            }
        }
        let kinds: Vec<&str> = resolved.iter().filter_map(|b| b["properties"]["kind"]["const"].as_str()).collect();
        if !kinds.is_empty() && matches!(node.value, Value::Table(_)) {
            let Some(kind) = node.text("kind") else {
                return self.report(node, &join(path, "kind"), format!("missing, expected one of {}", kinds.join(", ")));
            };
            let chosen = resolved.iter().position(|b| b["properties"]["kind"]["const"].as_str() == Some(kind));
            return match chosen {
                Some(i) => self.visit(node, &branches[i], path, unit),
                None => {
                    let hint = suggestion(kind, kinds.iter().copied());
                    let place = node.entry("kind").unwrap_or(node);
                    self.report(place, &join(path, "kind"), format!("\"{kind}\", expected one of {}{hint}", kinds.join(", ")));
                }
            };
        }
        let fitting: Vec<usize> = (0..branches.len()).filter(|i| self.may_fit(node, resolved[*i])).collect();
        if let [only] = fitting[..] {
            return self.visit(node, &branches[only], path, unit);
        }
        if let (Value::Table(entries), false) = (&node.value, fitting.is_empty()) {
            let single = |b: &Schema| b["required"].as_array().filter(|r| r.len() == 1).and_then(|r| r[0].as_str().map(str::to_string));
            let keys: Vec<String> = resolved.iter().filter_map(|b| single(b)).collect();
            let alone = |b: &Schema| b["properties"].as_object().is_some_and(|all| all.len() == 1);
            let given: Vec<&str> = entries.iter().map(|(key, _)| key.as_str()).filter(|key| keys.iter().any(|k| k == key)).collect();
            if given.len() > 1 && resolved.iter().all(|b| alone(b) || single(b).is_none()) {
                return self.report(node, path, format!("{}: only one is allowed", given.join(" and ")));
            }
            let chosen = fitting.iter().find(|i| single(resolved[**i]).is_some_and(|k| entries.iter().any(|(key, _)| *key == k)));
            return match chosen {
                Some(i) => self.visit(node, &branches[*i], path, unit),
                None => {
                    let given = entries.first().map_or("", |(k, _)| k.as_str());
                    let hint = suggestion(given, keys.iter().map(String::as_str));
                    self.report(node, path, format!("expected one of the keys {}{hint}", keys.join(", ")));
                }
            };
        }
        if fitting.is_empty() {
            let expected = self.alternatives(branches, unit);
            return self.report(node, path, format!("{}, expected {expected}", show(node, unit)));
        }
        // Several lists: report the complaints of the alternative with the fewest.
        let attempts = fitting.iter().map(|i| {
            let mut attempt = Checker { root: self.root, issues: Vec::new() };
            attempt.visit(node, &branches[*i], path, unit);
            attempt.issues
        });
        self.issues.extend(attempts.min_by_key(Vec::len).unwrap_or_default());
    }

    /// Whether the type is right, or that of an alternative within.
    fn may_fit(&self, node: &Node, schema: &'a Schema) -> bool {
        let schema = self.resolve(schema);
        match schema["oneOf"].as_array().or(schema["anyOf"].as_array()) {
            Some(branches) => branches.iter().any(|branch| self.may_fit(node, branch)),
            None => fits_type(node, schema),
        }
    }

    /// The input that a schema accepts, as text: `a number > 0 N/m`.
    fn describe(&self, schema: &'a Schema, unit: Option<&str>) -> String {
        let schema = self.resolve(schema);
        if let Some(branches) = schema["oneOf"].as_array().or(schema["anyOf"].as_array()) {
            return self.alternatives(branches, unit);
        }
        let words = words(schema);
        if !words.is_empty() {
            return format!("one of {}", words.join(", "));
        }
        match types(schema).first().copied() {
            Some("integer") => format!("a whole number {}", range(schema, unit)).trim_end().to_string(),
            Some("number") => format!("a number {}", range(schema, unit)).trim_end().to_string(),
            Some("string") => schema["x-meaning"].as_str().unwrap_or("a string").to_string(),
            Some("boolean") => "true or false".to_string(),
            Some("array") => {
                let of = if schema["items"].is_object() {
                    self.describe(&schema["items"], unit.or(schema["items"]["x-unit"].as_str()))
                } else {
                    "values".to_string()
                };
                match (schema["minItems"].as_u64(), schema["maxItems"].as_u64()) {
                    (Some(a), Some(b)) if a == b => format!("a list of {a}, each {of}"),
                    (Some(a), _) => format!("a list of at least {a}, each {of}"),
                    _ => format!("a list, each {of}"),
                }
            }
            Some("object") => match (schema["x-meaning"].as_str(), &required(schema)[..]) {
                (Some(meaning), _) => meaning.to_string(),
                (None, []) => "a table".to_string(),
                (None, keys) => format!("a table {{ {} }}", keys.iter().map(|k| format!("{k} = ...")).collect::<Vec<_>>().join(", ")),
            },
            _ => "another value".to_string(),
        }
    }

    /// The input that any of several schemas accepts, as text; tables that differ only in their single key, or in their kind, are merged.
    fn alternatives(&self, branches: &'a [Schema], unit: Option<&str>) -> String {
        let (mut parts, mut keys, mut kinds) = (Vec::new(), Vec::new(), Vec::new());
        for branch in branches {
            let schema = self.resolve(branch);
            match (schema["properties"]["kind"]["const"].as_str(), &required(schema)[..]) {
                _ if schema["type"] == "null" => {}
                (Some(kind), _) => kinds.push(kind),
                (None, [key]) if schema["properties"].as_object().is_some_and(|p| p.len() == 1) => keys.push(*key),
                _ => parts.push(self.describe(branch, branch["x-unit"].as_str().or(unit))),
            }
        }
        match keys[..] {
            [] => {}
            [key] => parts.push(format!("a table {{ {key} = ... }}")),
            _ => parts.push(format!("a table with one of the keys {}", keys.join(", "))),
        }
        if !kinds.is_empty() {
            parts.push(format!("a table whose kind is one of {}", kinds.join(", ")));
        }
        parts.join(" or ")
    }
}

/// `a.b`, or `a` at the top; a key without letters is quoted.
fn join(path: &str, key: &str) -> String {
    let key = if key.is_empty() { "\"\"" } else { key };
    if path.is_empty() { key.to_string() } else { format!("{path}.{key}") }
}

/// `sheet "flag"` for a named item, `sheet[2]` for any other.
fn item_path(path: &str, i: usize, item: &Node) -> String {
    match item.text("name") {
        Some(name) => format!("{path} \"{name}\""),
        None => format!("{path}[{i}]"),
    }
}

/// The keys that a table must have.
fn required(schema: &Schema) -> Vec<&str> {
    schema["required"].as_array().into_iter().flatten().filter_map(Schema::as_str).collect()
}

fn types(schema: &Schema) -> Vec<&str> {
    match &schema["type"] {
        Schema::String(s) => vec![s],
        Schema::Array(list) => list.iter().filter_map(Schema::as_str).collect(),
        _ => Vec::new(),
    }
}

/// Whether a schema is one of alternatives.
fn is_choice(schema: &Schema) -> bool {
    schema["oneOf"].is_array() || schema["anyOf"].is_array()
}

fn fits_type(node: &Node, schema: &Schema) -> bool {
    let types = types(schema);
    let fits = |t: &str| match &node.value {
        Value::Null => t == "null",
        Value::Bool(_) => t == "boolean",
        Value::Int(_) => t == "integer" || t == "number",
        Value::Float(x) => t == "number" || (t == "integer" && x.fract() == 0.0 && x.abs() < 1e15),
        Value::Text(_) => t == "string",
        Value::List(_) => t == "array",
        Value::Table(_) => t == "object",
    };
    types.is_empty() || types.into_iter().any(fits)
}

fn number(node: &Node) -> f64 {
    match node.value {
        Value::Int(i) => i as f64,
        Value::Float(x) => x,
        _ => f64::NAN,
    }
}

fn bounds(schema: &Schema) -> [Option<f64>; 4] {
    let [low, high, above, below] = ["minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"].map(|k| schema[k].as_f64());
    // Without limits in the schema, integers have the range of the machine type.
    let most = match schema["format"].as_str() {
        Some("uint8") => Some(f64::from(u8::MAX)),
        Some("uint32") => Some(f64::from(u32::MAX)),
        Some("uint64") => Some(2.0_f64.powi(53)),
        _ => None,
    };
    [low, high.or(most.filter(|_| below.is_none())), above, below]
}

fn in_range(x: f64, schema: &Schema) -> bool {
    let [low, high, above, below] = bounds(schema);
    low.is_none_or(|b| x >= b) && high.is_none_or(|b| x <= b) && above.is_none_or(|b| x > b) && below.is_none_or(|b| x < b)
}

/// `>= 0 N/m`, `> 0 and <= 1`, or without bounds `in m`.
fn range(schema: &Schema, unit: Option<&str>) -> String {
    let [low, high, above, below] = bounds(schema);
    if let (Some(low), Some(high)) = (low, high)
        && low == high
    {
        return plain(low);
    }
    let parts: Vec<String> = [(">=", low), (">", above), ("<=", high), ("<", below)]
        .into_iter()
        .filter_map(|(sign, b)| b.map(|b| format!("{sign} {}", plain(b))))
        .collect();
    match (parts.is_empty(), unit.filter(|u| *u != "1")) {
        (true, unit) => unit.map(|u| format!("in {u}")).unwrap_or_default(),
        (false, unit) => format!("{} {}", parts.join(" and "), unit.unwrap_or_default()).trim_end().to_string(),
    }
}

/// A number for people: in scientific form where it has too many digits.
pub fn plain(x: f64) -> String {
    if x != 0.0 && (x.abs() >= 1e7 || x.abs() < 1e-4) { format!("{x:e}") } else { format!("{x}") }
}

/// A number for people, with three digits.
pub fn short(x: f64) -> String {
    plain(format!("{x:.2e}").parse().unwrap_or(x))
}

/// The value as the author wrote it, shortened.
fn show(node: &Node, unit: Option<&str>) -> String {
    match &node.value {
        Value::Null => "nothing".to_string(),
        Value::Bool(b) => b.to_string(),
        Value::Int(_) | Value::Float(_) => {
            let unit = unit.filter(|u| *u != "1").map(|u| format!(" {u}")).unwrap_or_default();
            match node.value {
                Value::Int(i) => format!("{i}{unit}"),
                _ => format!("{}{unit}", plain(number(node))),
            }
        }
        Value::Text(s) if s.chars().count() > 40 => format!("\"{}...\"", s.chars().take(40).collect::<String>()),
        Value::Text(s) => format!("\"{s}\""),
        Value::List(items) => format!("a list of {}", items.len()),
        Value::Table(_) => "a table".to_string(),
    }
}

/// Of keyframes or a formula where there are numbers for all times: that this is so.
fn rigid(node: &Node, schema: &Schema) -> &'static str {
    let is_number = |schema: &Schema| types(schema).iter().any(|t| ["number", "integer"].contains(t));
    let numbers = is_number(schema) || is_number(&schema["items"]);
    let animated = match &node.value {
        Value::Table(entries) => entries.iter().any(|(key, _)| key == "keys"),
        Value::Text(text) => text == "t" || (text.contains(['+', '-', '*', '/', '^', '(']) && text.parse::<f64>().is_err()),
        _ => false,
    };
    if numbers && animated { "; it does not change in time" } else { "" }
}

/// The strings that a schema admits, if it is a choice among strings.
fn words(schema: &Schema) -> Vec<&str> {
    match (&schema["enum"], &schema["const"]) {
        (Schema::Array(list), _) => list.iter().filter_map(Schema::as_str).collect(),
        (_, Schema::String(s)) => vec![s],
        _ => Vec::new(),
    }
}

/// `; did you mean "structural"?`, or nothing if no word is near.
pub fn suggestion<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let near = known.into_iter().map(|k| (strsim::jaro_winkler(&word.to_lowercase(), k), k)).max_by(|a, b| a.0.total_cmp(&b.0));
    match near {
        Some((score, k)) if score > 0.8 => format!("; did you mean \"{k}\"?"),
        _ => String::new(),
    }
}
