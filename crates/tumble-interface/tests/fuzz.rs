//! No tree makes the checker panic or hang; whatever it refuses, it refuses with a place, in one line.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

mod cases;

use cases::{Outcome, cases, weighed};
use proptest::prelude::*;
use proptest::sample::Index;
use std::path::Path;
use std::sync::LazyLock;
use tumble_interface::tree::{Node, Value};
use tumble_interface::{Scene, SceneError};

/// The scenes that ship: their texts, and as trees.
static SHIPPED: LazyLock<Vec<(String, Node)>> = LazyLock::new(|| {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../python/tumble/scenes");
    let folders = std::fs::read_dir(root).unwrap().map(|f| f.unwrap().path()).filter(|f| f.is_dir());
    let files = folders.flat_map(|folder| std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()));
    let mut files: Vec<_> = files.filter(|f| f.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    let read = |file: &std::path::PathBuf| {
        let text = std::fs::read_to_string(file).unwrap();
        let tree = Node::from_toml(&text).unwrap();
        (text, tree)
    };
    files.iter().map(read).collect()
});

static SCHEMA: LazyLock<serde_json::Value> = LazyLock::new(Scene::schema);

/// Every key and every choice of the schema.
static WORDS: LazyLock<Vec<String>> = LazyLock::new(|| {
    fn collect(schema: &serde_json::Value, words: &mut Vec<String>) {
        match schema {
            serde_json::Value::Object(map) => {
                if let Some(properties) = map.get("properties").and_then(|p| p.as_object()) {
                    words.extend(properties.keys().cloned());
                }
                words.extend(map.get("const").and_then(|c| c.as_str()).map(str::to_string));
                words.extend(
                    map.get("enum").and_then(|e| e.as_array()).into_iter().flatten().filter_map(|e| e.as_str()).map(str::to_string),
                );
                map.values().for_each(|below| collect(below, words));
            }
            serde_json::Value::Array(list) => list.iter().for_each(|below| collect(below, words)),
            _ => {}
        }
    }
    let mut words = Vec::new();
    collect(&SCHEMA, &mut words);
    words.sort();
    words.dedup();
    words
});

/// Bytes that a tree takes.
fn size(tree: &Node) -> usize {
    size_of::<Node>()
        + match &tree.value {
            Value::Text(text) => text.len(),
            Value::List(items) => items.iter().map(size).sum(),
            Value::Table(entries) => entries.iter().map(|(key, below)| size_of::<String>() + key.len() + size(below)).sum(),
            _ => 0,
        }
}

/// That an error can be shown to people.
fn told(error: &SceneError, places: bool) {
    assert!(!error.issues.is_empty());
    for issue in &error.issues {
        let (path, message) = (&issue.path, &issue.message);
        assert!(!message.is_empty() && !message.chars().any(char::is_control), "{message:?}");
        assert!(!path.chars().any(char::is_control), "{path:?}");
        assert!(message.chars().count() < 3000, "{message}");
        let whole = ["not TOML: ", "not JSON: ", "nested too deeply to be a scene"].iter().any(|w| message.starts_with(w));
        assert!(!path.is_empty() || whole || !places, "no place: {message}");
    }
}

/// Reads a tree. What comes out is a scene again, in the words of the schema, and to the same numbers.
fn judge(tree: &Node) -> Outcome {
    static WARM: LazyLock<()> = LazyLock::new(|| drop(Scene::from_tree(&SHIPPED[0].1))); // The schema is made once.
    LazyLock::force(&WARM);
    let expected = (1 << 16) + 10 * size(tree);
    let (read, taken) = weighed(|| Scene::from_tree(tree));
    match &read {
        Ok(scene) => {
            let json = scene.to_json();
            let again = Scene::from_tree(&Node::from_value(&json)).unwrap_or_else(|e| panic!("what was resolved is refused: {e}"));
            assert_eq!(again.to_json(), json);
        }
        Err(error) => {
            // The place of a whole that is no table has no name.
            told(error, matches!(tree.value, Value::Table(_)));
            for issue in &error.issues {
                tree.line_of(&issue.path);
            }
        }
    }
    Outcome { read: read.is_ok(), taken, expected }
}

fn text() -> impl Strategy<Value = String> {
    prop_oneof![
        4 => any::<Index>().prop_map(|i| i.get(&WORDS).clone()),
        1 => "\\PC{0,12}",
        1 => prop::sample::select(vec!["", " ", "main", "0", "-1", "a\nb", "a\u{0}b", "\u{202e}", "\"", "]", "[0]", ".", "vertex 0", "corner 9 9", "1/0", "__proto__", "ﬀ"])
            .prop_map(str::to_string),
        1 => (1..3000_usize).prop_map(|n| "x".repeat(n)),
    ]
}

fn number() -> impl Strategy<Value = Value> {
    let odd = vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, f64::MIN_POSITIVE, 5e-324, f64::MAX, f64::MIN, 1e15, 1e16, 0.5, -1.0];
    let whole =
        vec![0, 1, -1, 2, 3, i64::MAX, i64::MIN, 1 << 31, 1 << 32, (1 << 32) - 1, 1 << 53, 1_000_000_000, 1_000_000_001, 255, 256, 65536];
    prop_oneof![
        prop::sample::select(odd).prop_map(Value::Float),
        prop::sample::select(whole).prop_map(Value::Int),
        any::<f64>().prop_map(Value::Float),
        (-10.0..10.0).prop_map(Value::Float),
        (-9..99_i64).prop_map(Value::Int),
        any::<i64>().prop_map(Value::Int),
    ]
}

fn value() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        1 => Just(Value::Null),
        1 => any::<bool>().prop_map(Value::Bool),
        6 => number(),
        4 => text().prop_map(Value::Text),
    ];
    leaf.prop_recursive(3, 12, 4, |below| {
        prop_oneof![
            prop::collection::vec(below.clone().prop_map(Node::from), 0..5).prop_map(Value::List),
            prop::collection::vec((text(), below.prop_map(Node::from)), 0..4).prop_map(Value::Table),
        ]
    })
}

/// One change of a tree, at one of its nodes.
#[derive(Debug, Clone)]
enum Change {
    Replace(Index, Value),
    Remove(Index, Index),
    Repeat(Index, Index, usize),
    Rename(Index, Index, String),
    Add(Index, String, Value),
    Graft(Index, Index, Index),
    Wrap(Index, usize),
}

fn change() -> impl Strategy<Value = Change> {
    let at = any::<Index>;
    prop_oneof![
        4 => (at(), value()).prop_map(|(at, value)| Change::Replace(at, value)),
        4 => (at(), number()).prop_map(|(at, value)| Change::Replace(at, value)),
        2 => (at(), at()).prop_map(|(at, which)| Change::Remove(at, which)),
        1 => (at(), at(), 1..40_usize).prop_map(|(at, which, times)| Change::Repeat(at, which, times)),
        1 => (at(), at(), text()).prop_map(|(at, which, key)| Change::Rename(at, which, key)),
        2 => (at(), text(), value()).prop_map(|(at, key, value)| Change::Add(at, key, value)),
        3 => (at(), at(), at()).prop_map(|(at, scene, from)| Change::Graft(at, scene, from)),
        1 => (at(), 1..100_usize).prop_map(|(at, levels)| Change::Wrap(at, levels)),
    ]
}

fn below(node: &Node) -> Vec<&Node> {
    match &node.value {
        Value::List(items) => items.iter().collect(),
        Value::Table(entries) => entries.iter().map(|(_, below)| below).collect(),
        _ => Vec::new(),
    }
}

fn nodes(node: &Node) -> usize {
    1 + below(node).into_iter().map(nodes).sum::<usize>()
}

/// The node of that number, counted from the root.
fn nth<'a>(node: &'a mut Node, n: &mut usize) -> Option<&'a mut Node> {
    if *n == 0 {
        return Some(node);
    }
    *n -= 1;
    match &mut node.value {
        Value::List(items) => items.iter_mut().find_map(|below| nth(below, n)),
        Value::Table(entries) => entries.iter_mut().find_map(|(_, below)| nth(below, n)),
        _ => None,
    }
}

fn pick<'a>(tree: &'a mut Node, at: &Index) -> &'a mut Node {
    let mut n = at.index(nodes(tree));
    nth(tree, &mut n).unwrap()
}

fn apply(tree: &mut Node, change: &Change) {
    match change {
        Change::Replace(at, value) => pick(tree, at).value = value.clone(),
        Change::Remove(at, which) => match &mut pick(tree, at).value {
            Value::List(items) if !items.is_empty() => drop(items.remove(which.index(items.len()))),
            Value::Table(entries) if !entries.is_empty() => drop(entries.remove(which.index(entries.len()))),
            _ => {}
        },
        Change::Repeat(at, which, times) => match &mut pick(tree, at).value {
            Value::List(items) if !items.is_empty() => {
                let again = items[which.index(items.len())].clone();
                items.extend(std::iter::repeat_n(again, *times));
            }
            Value::Table(entries) if !entries.is_empty() => {
                let again = entries[which.index(entries.len())].clone();
                entries.push(again);
            }
            _ => {}
        },
        Change::Rename(at, which, key) => {
            if let Value::Table(entries) = &mut pick(tree, at).value
                && !entries.is_empty()
            {
                let n = entries.len();
                entries[which.index(n)].0.clone_from(key);
            }
        }
        Change::Add(at, key, value) => {
            if let Value::Table(entries) = &mut pick(tree, at).value {
                entries.push((key.clone(), value.clone().into()));
            }
        }
        Change::Graft(at, scene, from) => {
            let mut other = scene.get(&SHIPPED).1.clone();
            let grafted = pick(&mut other, from).clone();
            *pick(tree, at) = grafted;
        }
        Change::Wrap(at, levels) => {
            let node = pick(tree, at);
            for _ in 0..*levels {
                *node = Value::List(vec![node.clone()]).into();
            }
        }
    }
}

/// Small numbers without a pattern, from a seed.
struct Dice(u64);

impl Dice {
    /// [steele2014]'s generator.
    fn roll(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.roll() % n.max(1) as u64) as usize
    }

    fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    /// A value that fits a schema, often at the end of its range.
    fn value(&mut self, schema: &serde_json::Value, depth: usize) -> Value {
        let mut schema = schema;
        while let Some(name) = schema["$ref"].as_str().and_then(|r| r.strip_prefix("#/$defs/")) {
            schema = &SCHEMA["$defs"][name];
        }
        if let Some(branches) = schema["oneOf"].as_array().or(schema["anyOf"].as_array()) {
            let which = self.below(branches.len());
            return self.value(&branches[which], depth);
        }
        if let Some(words) = schema["enum"].as_array() {
            let which = self.below(words.len());
            return Node::from_value(&words[which]).value;
        }
        if !schema["const"].is_null() {
            return Node::from_value(&schema["const"]).value;
        }
        let kind = match &schema["type"] {
            serde_json::Value::Array(kinds) => {
                let which = self.below(kinds.len());
                kinds[which].as_str().unwrap()
            }
            kind => kind.as_str().unwrap_or("null"),
        };
        let bound = |key: &str| schema[key].as_f64();
        match kind {
            "boolean" => Value::Bool(self.one_in(2)),
            "integer" | "number" => {
                let low = bound("minimum").or(bound("exclusiveMinimum")).unwrap_or(-10.0);
                let high = bound("maximum").or(bound("exclusiveMaximum")).unwrap_or(low + 20.0);
                let x = match self.below(40) {
                    0 => low,
                    1 => high,
                    2 => low + 1.0,
                    3 if bound("maximum").or(bound("exclusiveMaximum")).is_none() => {
                        [1e300, 1e9, 4294967295.0, 4294967296.0, 9e18][self.below(5)]
                    }
                    4 if bound("minimum").or(bound("exclusiveMinimum")).is_none() => -1e300,
                    _ if high - low < 1.5 && kind == "integer" => low,
                    _ => low + (high - low).min(20.0) * ((1 + self.below(999)) as f64 / 1000.0),
                };
                if kind == "integer" { Value::Int(x as i64) } else { Value::Float(x) }
            }
            "string" => Value::Text(match self.below(4) {
                0 => "a".into(),
                1 => format!("b{}", self.below(4)),
                _ => WORDS[self.below(WORDS.len())].clone(),
            }),
            "array" => {
                let low = schema["minItems"].as_u64().unwrap_or(0) as usize;
                let high = schema["maxItems"].as_u64().map_or(low + if depth > 6 { 0 } else { 2 }, |n| n as usize);
                let n = low + self.below(high.saturating_sub(low).min(3) + 1);
                let item = |i: usize| schema["prefixItems"].get(i).unwrap_or(&schema["items"]);
                Value::List((0..n).map(|i| self.value(item(i), depth + 1).into()).collect())
            }
            "object" => {
                let must: Vec<&str> = schema["required"].as_array().into_iter().flatten().filter_map(|r| r.as_str()).collect();
                let mut entries = Vec::new();
                for (key, below) in schema["properties"].as_object().into_iter().flatten() {
                    // At the top all lists of things, seldom; below more.
                    if must.contains(&key.as_str()) || (depth < 7 && self.one_in(if depth == 0 { 6 } else { 3 })) {
                        entries.push((key.clone(), self.value(below, depth + 1).into()));
                    }
                }
                Value::Table(entries)
            }
            _ => Value::Null,
        }
    }
}

#[test]
fn what_ships_is_read() {
    assert!(SHIPPED.len() > 40 && WORDS.len() > 300);
    for (_, tree) in SHIPPED.iter() {
        assert!(judge(tree).read);
    }
}

#[test]
fn changed_trees_are_read_or_refused_with_a_place() {
    cases("scene trees, changed", 4000, (any::<Index>(), prop::collection::vec(change(), 1..5)), |(which, changes)| {
        let mut tree = which.get(&SHIPPED).1.clone();
        changes.iter().for_each(|change| apply(&mut tree, change));
        judge(&tree)
    });
}

#[test]
fn trees_from_the_schema_are_read_or_refused_with_a_place() {
    cases("scene trees, from the schema", 4000, any::<u64>(), |seed| judge(&Dice(seed).value(&SCHEMA, 0).into()));
}

#[test]
fn trees_of_anything_are_read_or_refused() {
    cases("scene trees, of anything", 2000, value(), |value| judge(&value.into()));
}

/// A change of a text: what tends to be believed, put in, out, or twice.
fn edit() -> impl Strategy<Value = (Index, usize, String)> {
    let token = prop::sample::select(vec![
        "",
        "[",
        "]",
        "[[",
        "]]",
        "{",
        "}",
        "\"",
        "'",
        "\"\"\"",
        "=",
        ".",
        ",",
        "\n",
        "\r",
        "\t",
        "\u{0}",
        "#",
        "\\",
        "\\u0000",
        "\\ud800",
        "1e999",
        "-",
        "nan",
        "inf",
        "0x7fffffffffffffff",
        "0b2",
        "9999999999999999999999",
        "1979-05-27T07:32:00Z",
        "true",
        "null",
        "é",
        "\u{feff}",
        "[[sheet]]\n",
        "[time]\n",
    ]);
    let token = prop_oneof![8 => token.prop_map(str::to_string), 1 => (1..400_usize, prop::sample::select(vec!["[", "{\"a\":", "{a=", "(", "x."])).prop_map(|(n, t)| t.repeat(n))];
    (any::<Index>(), 0..20_usize, token)
}

fn edited(text: &str, edits: &[(Index, usize, String)]) -> String {
    let mut letters: Vec<char> = text.chars().collect();
    for (at, out, token) in edits {
        let at = at.index(letters.len() + 1);
        let end = (at + out).min(letters.len());
        letters.splice(at..end, token.chars());
    }
    letters.into_iter().collect()
}

fn judge_text(text: &str, read: fn(&str) -> Result<Node, SceneError>) -> Outcome {
    // Memory of a parser besides the tree.
    let expected = (1 << 16) + 100 * text.len();
    let (tree, taken) = weighed(|| read(text));
    match tree {
        Ok(tree) => {
            let below = judge(&tree);
            Outcome { taken: below.taken.max(taken), expected: below.expected.max(expected), ..below }
        }
        Err(error) => {
            told(&error, true);
            assert!(error.issues[0].line.is_some() || error.issues[0].message.starts_with("nested"), "no line: {error}");
            Outcome { read: false, taken, expected }
        }
    }
}

#[test]
fn changed_texts_are_read_or_refused_with_a_line() {
    cases("scene files, TOML", 2000, (any::<Index>(), prop::collection::vec(edit(), 1..5)), |(which, edits)| {
        judge_text(&edited(&which.get(&SHIPPED).0, &edits), Node::from_toml)
    });
    let json: Vec<String> = SHIPPED.iter().map(|(_, tree)| tree.to_json().unwrap().to_string()).collect();
    cases("scene files, JSON", 2000, (any::<Index>(), prop::collection::vec(edit(), 1..5)), |(which, edits)| {
        judge_text(&edited(which.get::<String>(&json), &edits), Node::from_json)
    });
}

#[test]
fn any_override_is_made_or_refused() {
    let part = || prop_oneof![3 => text(), 1 => (0..3_usize).prop_map(|i| i.to_string()), 1 => Just(String::new())];
    let path = prop::collection::vec(part(), 0..70).prop_map(|parts| parts.join("."));
    let known = prop::sample::select(vec![
        "time.fps",
        "system.0.substeps",
        "system.main.step",
        "world.gravity",
        "world.gravity.2",
        "collider.0.shape.sphere.radius",
    ]);
    let path = prop_oneof![path, known.prop_map(str::to_string)];
    let plain = |n| {
        if let Value::Int(i) = n {
            i.to_string()
        } else if let Value::Float(x) = n {
            format!("{x:?}")
        } else {
            String::new()
        }
    };
    let word = prop_oneof![
        text(),
        number().prop_map(plain),
        number().prop_map(move |n| format!("[0, {}, 1.5]", plain(n))),
        "[\\[\\]{}=\", a0-9.e-]{0,30}"
    ];
    cases("overrides", 2000, (any::<Index>(), path, word), |(which, path, word)| {
        let mut tree = which.get(&SHIPPED).1.clone();
        if let Err(error) = tree.set_text(&format!("{path}={word}")) {
            told(&error, false);
            return Outcome { read: false, taken: 0, expected: 1 };
        }
        judge(&tree)
    });
}
