//! A scene before it has a meaning: a tree of values that remember their line. TOML, JSON and a Python
//! dict all become this tree, so that one checker serves them.

use crate::error::{Issue, SceneError};
use std::borrow::Cow;

/// A value and the line it stands on.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// The value.
    pub value: Value,
    /// Line in the file, from 1; `None` for values that come from JSON, Python or the command line.
    pub line: Option<usize>,
}

/// A value.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// JSON null, Python None.
    Null,
    /// true or false
    Bool(bool),
    /// A whole number.
    Int(i64),
    /// Any other number, also `nan` and `inf`, which the checker refuses with their place.
    Float(f64),
    /// A string.
    Text(String),
    /// A list.
    List(Vec<Node>),
    /// Keys in the order of the file.
    Table(Vec<(String, Node)>),
}

/// Message for deeper trees.
pub(crate) const TOO_DEEP: &str = "nested too deeply to be a scene";

/// Deepest nesting that is read; a scene needs about eight levels.
const DEPTH: usize = 64;

impl From<Value> for Node {
    fn from(value: Value) -> Self {
        Self { value, line: None }
    }
}

impl Node {
    /// The value under `key`, if this is a table that has it.
    pub fn entry(&self, key: &str) -> Option<&Node> {
        match &self.value {
            Value::Table(entries) => entries.iter().find(|(k, _)| k == key).map(|(_, n)| n),
            _ => None,
        }
    }

    /// The string under `key`.
    pub fn text(&self, key: &str) -> Option<&str> {
        match self.entry(key) {
            Some(Node { value: Value::Text(s), .. }) => Some(s),
            _ => None,
        }
    }

    /// Reads TOML text.
    pub fn from_toml(text: &str) -> Result<Node, SceneError> {
        let text = plain(text);
        let lines = Lines::of(&text);
        let table = toml::de::DeTable::parse(&text).map_err(|e| match e.message() {
            "recursion limit" => SceneError::one("", TOO_DEEP),
            message => {
                let line = e.span().map(|s| lines.at(s.start));
                SceneError { issues: vec![Issue::on(line, "", format!("not TOML: {message}{}", decimal(&text, line)))] }
            }
        })?;
        Ok(Node { value: convert_table(table.get_ref(), &lines), line: Some(1) })
    }

    /// Reads JSON text.
    pub fn from_json(text: &str) -> Result<Node, SceneError> {
        let text = plain(text);
        let value: serde_json::Value = serde_json::from_str(&text).map_err(|e| {
            let hint = decimal(&text, Some(e.line()));
            SceneError { issues: vec![Issue::on(Some(e.line()), "", format!("not JSON: {e}{hint}"))] }
        })?;
        Ok(Self::from_value(&value))
    }

    /// A tree of JSON values, without lines.
    pub fn from_value(value: &serde_json::Value) -> Node {
        from_json_value(value)
    }

    /// Sets the value at a dotted path: `time.fps`, `system.0.step`, `sheet.flag.size` (by index or by name).
    pub fn set(&mut self, path: &str, value: Node) -> Result<(), SceneError> {
        let error = |message: String| SceneError::one(path, message);
        if path.split('.').count() > DEPTH {
            return Err(SceneError::one("", TOO_DEEP));
        }
        let mut node = self;
        let mut keys = path.split('.').peekable();
        while let Some(key) = keys.next() {
            node = match &mut node.value {
                Value::Table(entries) => {
                    let i = entries.iter().position(|(k, _)| k == key).unwrap_or_else(|| {
                        let table: Node = Value::Table(Vec::new()).into();
                        // `system.0.step` makes the first system of a scene that names none; so does its default name.
                        let is_list = matches!(keys.peek(), Some(&"0" | &"main"));
                        entries.push((key.to_string(), if is_list { Value::List(vec![table]).into() } else { table }));
                        entries.len() - 1
                    });
                    &mut entries[i].1
                }
                Value::List(items) => {
                    let names: Vec<String> = items.iter().filter_map(|n| n.text("name").map(str::to_string)).collect();
                    let i = items.iter().position(|n| n.text("name") == Some(key));
                    let i = i.or_else(|| key.parse().ok().filter(|i| *i < items.len()));
                    // An item without a name has the default one.
                    let i = i.or_else(|| items.iter().position(|n| key == "main" && n.entry("name").is_none()));
                    let i = i.ok_or_else(|| error(format!("no \"{key}\" among {} items: {}", items.len(), names.join(", "))))?;
                    &mut items[i]
                }
                _ => return Err(error(format!("\"{key}\" is below a value, not a table"))),
            };
        }
        *node = value;
        Ok(())
    }

    /// Applies an override `path=value`; the value is TOML, or else a plain word.
    pub fn set_text(&mut self, assignment: &str) -> Result<(), SceneError> {
        let Some((path, text)) = assignment.split_once('=') else {
            return Err(SceneError::one(assignment, "expected path.to.key=value"));
        };
        let parsed = Node::from_toml(&format!("value = {text}")).ok();
        let mut value = parsed.and_then(|n| n.entry("value").cloned()).unwrap_or_else(|| Value::Text(text.trim().to_string()).into());
        forget_lines(&mut value);
        self.set(path.trim(), value)
    }

    /// The error with the lines of its places, in their order.
    pub fn located(&self, mut error: SceneError) -> SceneError {
        for issue in &mut error.issues {
            issue.line = issue.line.or_else(|| self.line_of(&issue.path));
        }
        error.issues.sort_by_key(|issue| issue.line);
        error
    }

    /// Line of the place that an issue names, `sheet "flag".pin[0]`, or of the nearest one around it.
    pub fn line_of(&self, path: &str) -> Option<usize> {
        let mut node = self;
        let mut line = None;
        let mut rest = path;
        while !rest.is_empty() {
            let next = if let Some(index) = rest.strip_prefix('[').and_then(|r| r.split_once(']')) {
                rest = index.1;
                match &node.value {
                    Value::List(items) => index.0.parse::<usize>().ok().and_then(|i| items.get(i)),
                    _ => None,
                }
            } else if let Some((name, after)) = rest.strip_prefix(" \"").and_then(|r| r.split_once('"')) {
                rest = after;
                match &node.value {
                    Value::List(items) => items.iter().find(|n| n.text("name") == Some(name)),
                    _ => None,
                }
            } else {
                rest = rest.strip_prefix('.').unwrap_or(rest);
                let end = rest.find(['.', '[', ' ']).unwrap_or(rest.len());
                let (key, after) = rest.split_at(end);
                rest = after;
                node.entry(key)
            };
            let Some(next) = next else { break };
            node = next;
            line = node.line.or(line);
        }
        line
    }

    /// The tree as JSON; `None` if it holds a number that is not finite.
    pub fn to_json(&self) -> Option<serde_json::Value> {
        use serde_json::Value as J;
        Some(match &self.value {
            Value::Null => J::Null,
            Value::Bool(b) => J::Bool(*b),
            Value::Int(i) => J::from(*i),
            // A whole number written as 24.0 may stand where an integer is asked for.
            Value::Float(x) if x.fract() == 0.0 && x.abs() < 1e15 => J::from(*x as i64),
            Value::Float(x) => J::Number(serde_json::Number::from_f64(*x)?),
            Value::Text(s) => J::String(s.clone()),
            Value::List(items) => J::Array(items.iter().map(Node::to_json).collect::<Option<_>>()?),
            Value::Table(entries) => J::Object(entries.iter().map(|(k, n)| Some((k.clone(), n.to_json()?))).collect::<Option<_>>()?),
        })
    }

    /// Whether the tree is nested more deeply than a scene can be.
    pub fn too_deep(&self) -> bool {
        fn depth(node: &Node, left: usize) -> bool {
            match &node.value {
                _ if left == 0 => true,
                Value::List(items) => items.iter().any(|n| depth(n, left - 1)),
                Value::Table(entries) => entries.iter().any(|(_, n)| depth(n, left - 1)),
                _ => false,
            }
        }
        depth(self, DEPTH)
    }
}

fn forget_lines(node: &mut Node) {
    node.line = None;
    match &mut node.value {
        Value::List(items) => items.iter_mut().for_each(forget_lines),
        Value::Table(entries) => entries.iter_mut().for_each(|(_, n)| forget_lines(n)),
        _ => {}
    }
}

/// Text without a byte order mark, with lines that end in a line feed.
fn plain(text: &str) -> Cow<'_, str> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.contains('\r') { text.replace("\r\n", "\n").replace('\r', "\n").into() } else { text.into() }
}

/// A hint where a value of a line that cannot be read is a number with a decimal comma.
fn decimal(text: &str, line: Option<usize>) -> &'static str {
    let line = line.and_then(|line| text.lines().nth(line.checked_sub(1)?)).unwrap_or_default();
    let has_comma = |value: &str| {
        let number = value.trim_start().trim_start_matches(['-', '+']);
        let rest = number.trim_start_matches(|c: char| c.is_ascii_digit());
        rest.len() < number.len() && rest.strip_prefix(',').is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
    };
    if line.split(['=', ':']).skip(1).any(has_comma) { "; numbers have a decimal point, not a comma: 0.5" } else { "" }
}

/// Byte offsets at which lines start.
struct Lines(Vec<usize>);

impl Lines {
    fn of(text: &str) -> Self {
        Self(std::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect())
    }

    /// Line of a byte offset, from 1.
    fn at(&self, offset: usize) -> usize {
        self.0.partition_point(|start| *start <= offset)
    }
}

fn convert_table(table: &toml::de::DeTable<'_>, lines: &Lines) -> Value {
    let mut entries: Vec<(usize, String, Node)> =
        table.iter().map(|(key, value)| (key.span().start, key.get_ref().to_string(), convert(value, lines))).collect();
    entries.sort_by_key(|(start, _, _)| *start);
    Value::Table(entries.into_iter().map(|(_, k, n)| (k, n)).collect())
}

fn convert(item: &toml::Spanned<toml::de::DeValue<'_>>, lines: &Lines) -> Node {
    use toml::de::DeValue;
    let value = match item.get_ref() {
        DeValue::String(s) => Value::Text(s.to_string()),
        DeValue::Integer(i) => match i64::from_str_radix(i.as_str(), i.radix()) {
            Ok(i) => Value::Int(i),
            Err(_) => Value::Float(i.as_str().parse().unwrap_or(f64::INFINITY)),
        },
        DeValue::Float(x) => Value::Float(x.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(b) => Value::Bool(*b),
        DeValue::Datetime(d) => Value::Text(d.to_string()),
        DeValue::Array(items) => Value::List(items.iter().map(|n| convert(n, lines)).collect()),
        DeValue::Table(table) => convert_table(table, lines),
    };
    Node { value, line: Some(lines.at(item.span().start)) }
}

fn from_json_value(value: &serde_json::Value) -> Node {
    use serde_json::Value as J;
    match value {
        J::Null => Value::Null,
        J::Bool(b) => Value::Bool(*b),
        J::Number(n) => n.as_i64().map_or_else(|| Value::Float(n.as_f64().unwrap_or(f64::NAN)), Value::Int),
        J::String(s) => Value::Text(s.clone()),
        J::Array(items) => Value::List(items.iter().map(from_json_value).collect()),
        J::Object(map) => Value::Table(map.iter().map(|(k, v)| (k.clone(), from_json_value(v))).collect()),
    }
    .into()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "version = 1\n[time]\nfps = 24\n[[sheet]]\nname = 'a'\nsize = [1.0,\n 2]\n[[sheet]]\nname = 'b'\n";

    #[test]
    fn toml_values_remember_their_lines() {
        let node = Node::from_toml(TEXT).unwrap();
        assert_eq!(node.entry("time").unwrap().entry("fps").unwrap().line, Some(3));
        let Value::List(sheets) = &node.entry("sheet").unwrap().value else { panic!() };
        let Value::List(size) = &sheets[0].entry("size").unwrap().value else { panic!() };
        assert_eq!((size[0].line, size[1].line), (Some(6), Some(7)));
        assert_eq!(sheets[1].text("name"), Some("b"));
    }

    #[test]
    fn a_toml_error_has_its_line() {
        for text in ["version = 1\r\nmass = 0,5\r\n", "version = 1\rpoint = { mass = -0,5 }\r"] {
            let error = Node::from_toml(text).unwrap_err();
            assert_eq!(error.issues[0].line, Some(2));
            assert!(error.issues[0].message.contains("decimal point, not a comma"), "{error}");
        }
        let error = Node::from_json("{\"version\": 1,\n\"mass\": 0,5}").unwrap_err();
        assert!(error.issues[0].line == Some(2) && error.issues[0].message.contains("decimal point, not a comma"), "{error}");
        let error = Node::from_toml("version = 1\nx = [1,2] 3\n").unwrap_err();
        assert!(!error.issues[0].message.contains("comma:"), "{error}");
        for text in ["version = 1\nx = 2\n", "\u{feff}version = 1\rx = 2"] {
            assert_eq!(Node::from_toml(text).unwrap().entry("x").map(|x| (x.value.clone(), x.line)), Some((Value::Int(2), Some(2))));
        }
        assert!(Node::from_json("\u{feff}{\"version\": 1}").is_ok());
        let error = Node::from_toml("version = 1\nx = = 2\n").unwrap_err();
        assert_eq!(error.issues[0].line, Some(2));
    }

    #[test]
    fn overrides_reach_tables_and_named_items() {
        let mut node = Node::from_toml(TEXT).unwrap();
        node.set_text("time.fps=30").unwrap();
        node.set_text("sheet.b.size=[3, 4]").unwrap();
        node.set_text("sheet.0.name=c").unwrap();
        node.set_text("system.x=1").unwrap();
        assert_eq!(node.entry("time").unwrap().entry("fps").unwrap().value, Value::Int(30));
        let json = node.to_json().unwrap();
        assert_eq!(json["sheet"][1]["size"][1], 4);
        assert_eq!(json["sheet"][0]["name"], "c");
        assert!(node.set_text("sheet.z.size=1").unwrap_err().to_string().contains("no \"z\" among"));
        assert!(node.set_text("time.fps.x=1").is_err());
        assert!(node.set_text("nothing").is_err());
        let mut node = Node::from_toml("version = 1").unwrap();
        node.set_text("system.0.substeps=4").unwrap();
        assert!(matches!(&node.entry("system").unwrap().value, Value::List(l) if l.len() == 1 && l[0].entry("substeps").is_some()));
    }

    #[test]
    fn places_have_lines() {
        let node =
            Node::from_toml("version = 1\n[[sheet]]\nname = \"a\"\n[[sheet]]\nname = \"b\"\npin = [\n\"x\",\n\"y\"]\n[time]\nfps = 3\n")
                .unwrap();
        assert_eq!(node.line_of("sheet \"b\".pin[1]"), Some(8));
        assert_eq!(node.line_of("sheet \"b\".size"), node.line_of("sheet \"b\""));
        assert_eq!(node.line_of("time.fps"), Some(10));
        assert_eq!(node.line_of("nothing"), None);
    }
}
