//! The layers of the engine: a module imports only modules of lower layers, and no module in `systems/` imports a sibling;
//! modules of one folder import each other in no circle (ARCHITECTURE.md).

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// The modules of the engine, the lowest first: each imports only those before it.
const LAYERS: [&str; 17] = [
    "math",
    "geometry",
    "linalg",
    "reference",
    "state",
    "operators",
    "elements",
    "forces",
    "integrators",
    "exchange",
    "fluids",
    "system",
    "pool",
    "systems",
    "world",
    "recipes",
    "scene",
];

/// The modules of lib.rs.
fn modules() -> Vec<String> {
    let text = fs::read_to_string(source().join("lib.rs")).unwrap();
    let names = text.lines().filter_map(|line| line.strip_prefix("pub mod ").or(line.strip_prefix("mod "))?.strip_suffix(';'));
    names.map(str::to_string).collect()
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut entries: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            found.extend(files(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found
}

/// The path of the module in a file below `source`: systems/dynamics/mod.rs -> [systems, dynamics].
fn module(source: &Path, file: &Path) -> Vec<String> {
    let relative = file.strip_prefix(source).unwrap().with_extension("");
    let mut path: Vec<String> = relative.iter().map(|p| p.to_str().unwrap().to_string()).collect();
    if path.last().is_some_and(|p| p == "mod" || p == "lib") {
        path.pop();
    }
    path
}

/// A module that is named in code, as a path from the root of the crate, with the number of its line.
type Import = (usize, Vec<String>);

/// All paths in a text that start at `crate` or climb with `super`, with groups in braces multiplied out.
fn imports(of: &[String], text: &str) -> Vec<Import> {
    let mut found = Vec::new();
    // How many modules deep each open brace is: `mod tests {` adds one.
    let mut inner: Vec<bool> = Vec::new();
    let code = without_comments_and_strings(text);
    let bytes = code.as_bytes();
    let mut i = 0;
    while i < bytes.len() {
        // Within a letter that is not of ASCII there is no path.
        let Some(rest) = code.get(i..) else {
            i += 1;
            continue;
        };
        let starts_word =
            i == 0 || !(bytes[i - 1].is_ascii_alphanumeric() || bytes[i - 1] == b'_' || bytes[i - 1] == b':' || bytes[i - 1] == b'$');
        if starts_word && (rest.starts_with("crate::") || rest.starts_with("super::")) {
            let line = code[..i].lines().count().max(1);
            let depth = inner.iter().filter(|m| **m).count();
            let mut base: Vec<String> = of.to_vec();
            base.extend((0..depth).map(|_| "inner".to_string()));
            let mut at = i;
            if rest.starts_with("crate::") {
                base.clear();
                at += "crate::".len();
            }
            while code[at..].starts_with("super::") {
                assert!(base.pop().is_some(), "super of the root in {of:?}, line {line}");
                at += "super::".len();
            }
            found.extend(leaves(&code[at..]).into_iter().map(|leaf| (line, base.iter().cloned().chain(leaf).collect())));
            i = at;
            continue;
        }
        match bytes[i] {
            b'{' => {
                let before = code[..i].trim_end();
                let words: Vec<&str> = before.rsplitn(3, char::is_whitespace).collect();
                inner.push(words.get(1) == Some(&"mod"));
            }
            b'}' => drop(inner.pop()),
            _ => {}
        }
        i += 1;
    }
    found
}

/// The first two names of every path in `a::b`, `a::{b, c::d}`, `{a, b::c}`.
fn leaves(text: &str) -> Vec<Vec<String>> {
    let text = text.trim_start();
    if let Some(group) = text.strip_prefix('{') {
        let (mut depth, mut start, mut out) = (0, 0, Vec::new());
        for (i, c) in group.char_indices() {
            match c {
                '{' => depth += 1,
                '}' if depth > 0 => depth -= 1,
                ',' | '}' if depth == 0 => {
                    out.extend(leaves(&group[start..i]));
                    start = i + 1;
                    if c == '}' {
                        break;
                    }
                }
                _ => {}
            }
        }
        return out;
    }
    let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(text.len());
    let name = text[..end].to_string();
    if name.is_empty() {
        return Vec::new();
    }
    match text[end..].strip_prefix("::") {
        Some(rest) => {
            let more = leaves(rest);
            if more.is_empty() { vec![vec![name]] } else { more.into_iter().map(|m| [vec![name.clone()], m].concat()).collect() }
        }
        None => vec![vec![name]],
    }
}

fn without_comments_and_strings(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for line in text.lines() {
        let mut in_string = false;
        let mut characters = line.chars().peekable();
        while let Some(c) = characters.next() {
            match c {
                '\\' if in_string => {
                    characters.next();
                }
                '"' => in_string = !in_string,
                '\'' if !in_string => {
                    // A character such as '{' or '"'; a lifetime has no closing quote two places on.
                    let rest: String = characters.clone().take(3).collect();
                    let length = if rest.starts_with('\\') { 2 } else { 1 };
                    if rest.chars().nth(length) == Some('\'') {
                        characters.nth(length);
                    }
                }
                '/' if !in_string && characters.peek() == Some(&'/') => break,
                _ if in_string => {}
                _ => out.push(c),
            }
        }
        out.push('\n');
    }
    out
}

/// Violations in the imports of a module.
fn faults(order: &[String], of: &[String], imports: &[Import]) -> Vec<String> {
    let place = |name: &String| order.iter().position(|m| m == name);
    let Some(own) = of.first().and_then(place) else { return Vec::new() };
    let mut faults = Vec::new();
    for (line, path) in imports {
        let Some(other) = path.first().and_then(place) else {
            faults.push(format!("{}:{line}: {} is no module of the engine", of.join("::"), path.join("::")));
            continue;
        };
        if other > own {
            faults.push(format!("{}:{line}: {} stands above it", of.join("::"), path.join("::")));
        }
        if of[0] == "systems" && path[0] == "systems" && of.len() > 1 && path.len() > 1 && path[1] != of[1] {
            faults.push(format!("{}:{line}: {} is a sibling", of.join("::"), path.join("::")));
        }
    }
    faults
}

#[test]
fn modules_import_only_lower_layers() {
    let order = LAYERS.map(String::from);
    let (mut known, mut there) = (order.to_vec(), modules());
    known.sort();
    there.sort();
    assert_eq!(known, there, "a module of lib.rs has no layer, or a layer no module");
    let (mut seen, mut wrong) = (0, Vec::new());
    for file in files(&source()) {
        let of = module(&source(), &file);
        let imports = imports(&of, &fs::read_to_string(&file).unwrap());
        seen += imports.iter().filter(|(_, path)| path.first() != of.first()).count();
        wrong.extend(faults(&order, &of, &imports));
        assert!(of.is_empty() || order.contains(&of[0]), "{} is in no layer", file.display());
    }
    println!("{} modules, {seen} imports of other layers", order.len());
    assert!(seen > 100, "the test sees no imports");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_test_sees_what_it_forbids() {
    let order: Vec<String> = ["math", "state", "systems", "world"].map(String::from).into();
    let check = |of: &[&str], text: &str| {
        let of: Vec<String> = of.iter().map(|s| s.to_string()).collect();
        faults(&order, &of, &imports(&of, text)).len()
    };
    assert_eq!(check(&["state"], "use crate::math::Vec3;\nuse super::math;\nfn f() { crate::math::max(1, 2) }"), 0);
    assert_eq!(check(&["state"], "use crate::world::World;"), 1);
    assert_eq!(check(&["state"], "use crate::{math::Vec3, systems::{dynamics, tracers}};"), 2);
    assert_eq!(check(&["state"], "fn f() -> crate::world::World { panic!(\"crate::world\") } // crate::world"), 1);
    assert_eq!(check(&["state"], "use super::world::World;"), 1);
    assert_eq!(check(&["systems", "dynamics"], "use super::tracers::Tracers;\nuse crate::systems::tracers;"), 2);
    assert_eq!(check(&["systems", "dynamics"], "mod tests { use super::*; use super::super::tracers; }"), 1);
    assert_eq!(
        check(&["systems", "dynamics", "ledger"], "use super::Dynamics; use super::super::dynamics::laws; use super::super::tracers;"),
        1
    );
    assert_eq!(check(&["systems"], "use crate::systems::dynamics::Parts;"), 0);
    assert_eq!(check(&["math"], "use crate::lost::Thing;"), 1);
}

/// Imports between siblings that close a circle: crate, folder, module, the sibling that it imports, and why.
const ACCEPTED: [(&str, &str, &str, &str, &str); 6] = [
    ("tumble", "scene", "build", "methods", "walks the table of methods, which build with its Builder"),
    ("tumble", "scene", "checks", "methods", "walks the table of methods, which use its checks"),
    ("tumble", "scene", "coupling", "methods", "asks the table for the system of an object; dynamics hangs its anchors"),
    ("tumble", "scene", "hints", "methods", "walks the table of methods; dynamics uses its hints"),
    ("tumble", "scene", "memory", "methods", "walks the table of methods; dynamics uses its estimate"),
    ("tumble", "systems/dynamics", "core", "feature", "names the span of a step; features are given the core"),
];

/// Folder -> module -> the siblings in that folder that it imports, itself or in modules inside it. A name that a folder
/// exports counts as the module that it comes from.
type Siblings = BTreeMap<String, BTreeMap<String, BTreeSet<String>>>;

fn siblings(texts: &[(Vec<String>, String)]) -> Siblings {
    let mut modules: BTreeSet<Vec<String>> = BTreeSet::new();
    let mut exported: BTreeMap<Vec<String>, String> = BTreeMap::new();
    for (of, text) in texts {
        modules.extend((1..=of.len()).map(|n| of[..n].to_vec()));
        for (at, _) in text.match_indices("\npub use ") {
            for leaf in leaves(&text[at + "\npub use ".len()..]).iter().filter(|leaf| leaf.len() > 1) {
                exported.insert([of.as_slice(), &leaf[leaf.len() - 1..]].concat(), leaf[0].clone());
            }
        }
    }
    let mut found = Siblings::new();
    for (of, text) in texts {
        // Unit tests may look at what stands above their module.
        let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
        for (_, path) in imports(of, text) {
            let common = of.iter().zip(&path).take_while(|(a, b)| a == b).count();
            let (Some(own), Some(other)) = (of.get(common), path.get(common)) else { continue };
            let other = exported.get(&path[..=common]).unwrap_or(other);
            if own != other && modules.contains(&[&of[..common], std::slice::from_ref(other)].concat()) {
                found.entry(of[..common].join("/")).or_default().entry(own.clone()).or_default().insert(other.clone());
            }
        }
    }
    found
}

/// What is left of a graph without modules that import none of the rest and those that none of the rest imports, again and
/// again: circles, and the ways between them.
fn circles(graph: &BTreeMap<String, BTreeSet<String>>) -> Vec<String> {
    let mut edges: Vec<(&String, &String)> = graph.iter().flat_map(|(a, others)| others.iter().map(move |b| (a, b))).collect();
    loop {
        let inner = |(a, b): &(&String, &String)| edges.iter().any(|e| e.0 == *b) && edges.iter().any(|e| e.1 == *a);
        let left: Vec<_> = edges.iter().filter(|e| inner(e)).copied().collect();
        if left.len() == edges.len() {
            return left.iter().map(|(a, b)| format!("{a} imports {b}")).collect();
        }
        edges = left;
    }
}

#[test]
fn modules_of_one_folder_import_each_other_in_no_circle() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let (mut seen, mut wrong) = (0, Vec::new());
    for name in ["tumble", "tumble-interface", "tumble-io", "tumble-python", "tumble-wasm"] {
        let source = crates.join(name).join("src");
        let texts: Vec<_> = files(&source).iter().map(|f| (module(&source, f), fs::read_to_string(f).unwrap())).collect();
        for (folder, mut graph) in siblings(&texts) {
            seen += graph.values().map(BTreeSet::len).sum::<usize>();
            for (_, _, module, other, _) in ACCEPTED.iter().filter(|a| (a.0, a.1) == (name, folder.as_str())) {
                if !graph.get_mut(*module).is_some_and(|others| others.remove(*other)) {
                    println!("{name}/src/{folder}: {module} does not import {other} any more; ACCEPTED can do without");
                }
            }
            wrong.extend(circles(&graph).iter().map(|text| format!("{name}/src/{folder}: {text}")));
        }
    }
    println!("{seen} imports between siblings");
    assert!(seen > 100, "the test sees no imports");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_test_sees_circles() {
    let check = |files: &[(&[&str], &str)]| {
        let texts: Vec<_> = files.iter().map(|(of, text)| (of.iter().map(|s| s.to_string()).collect(), format!("\n{text}"))).collect();
        siblings(&texts).values().flat_map(circles).collect::<Vec<_>>()
    };
    let there: (&[&str], &str) = (&["a", "b"], "use super::c::C;");
    assert!(check(&[there, (&["a", "c"], "use crate::d::D;"), (&["d"], "")]).is_empty());
    assert_eq!(check(&[there, (&["a", "c"], "fn f() { crate::a::b::f() }")]), ["b imports c", "c imports b"]);
    assert_eq!(check(&[there, (&["a", "c"], "use super::d::D;"), (&["a", "d", "e"], "use crate::a::b;")]).len(), 3);
    // What a folder exports counts as the module that it comes from.
    assert_eq!(check(&[there, (&["a"], "pub use b::{A, B};"), (&["a", "c"], "use super::{B, C};")]).len(), 2);
}

/// Places in which the name of a method may stand besides its system, its methods file, its schema, its scenes, its pages of theory and
/// lab, and tests: lines of each file, and why.
const COMPRESSIBLE: [(&str, usize, &str); 10] = [
    ("crates/tumble/src/systems/mod.rs", 1, "declares the module"),
    ("crates/tumble/src/scene/methods/mod.rs", 2, "declares the module; the table"),
    ("crates/tumble-interface/src/scene/mod.rs", 4, "declares the module; the table of a scene"),
    ("crates/tumble-interface/src/scene/objects.rs", 1, "its objects, for the list of all"),
    ("crates/tumble-interface/src/scene/systems.rs", 2, "the word of the method"),
    ("crates/tumble-interface/src/kinds.rs", 1, "the table of kinds"),
    ("crates/tumble-interface/src/columns.rs", 1, "the table of columns"),
    ("python/tumble/cli/lab.py", 5, "the command of its lab page"),
    ("python/tumble/cures.py", 3, "cures of its own"),
    ("web/src/engine/measures.ts", 2, "generated from the tables of kinds and of methods"),
];
const VICSEK: [(&str, usize, &str); 8] = [
    ("crates/tumble/src/systems/mod.rs", 1, "declares the module"),
    ("crates/tumble/src/scene/methods/mod.rs", 2, "declares the module; the table"),
    ("crates/tumble-interface/src/scene/mod.rs", 2, "declares the module"),
    ("crates/tumble-interface/src/scene/systems.rs", 7, "the word of the method; the table of its settings"),
    ("python/tumble/cli/sweep.py", 1, "an example"),
    ("web/src/engine/measures.ts", 1, "generated from the table of methods"),
    ("web/src/panel.ts", 1, "its most telling words"),
    ("web/src/texts.ts", 2, "its words, for people"),
];

/// The files that belong to a method.
fn own(method: &str) -> [String; 4] {
    [
        format!("crates/tumble/src/systems/{method}.rs"),
        format!("crates/tumble/src/scene/methods/{method}.rs"),
        format!("crates/tumble-interface/src/scene/{method}.rs"),
        format!("python/tumble/lab/{method}.py"),
    ]
}

/// Lines of code and comments in which a word stands, without citations of equations such as (compressible.3).
fn lines_with(word: &str, text: &str) -> usize {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let names = |line: &str| {
        let line = line.to_lowercase();
        line.match_indices(word).any(|(i, _)| {
            let (before, after) = (&line[..i], &line[i + word.len()..]);
            let cited = after.starts_with('.') && after[1..].starts_with(|c: char| c.is_ascii_digit());
            !before.ends_with(is_word) && !after.starts_with(is_word) && !cited
        })
    };
    text.lines().filter(|line| names(line)).count()
}

fn texts(folder: &Path, found: &mut Vec<PathBuf>) {
    for path in fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
        let name = path.file_name().unwrap().to_str().unwrap();
        if path.is_dir() && !["pkg", "scenes", "__pycache__", "node_modules"].contains(&name) {
            texts(&path, found);
        } else if ["rs", "py", "ts", "pyi"].iter().any(|e| path.extension().is_some_and(|found| found == *e)) {
            found.push(path);
        }
    }
}

#[test]
fn a_method_is_named_in_few_places() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let crates = fs::read_dir(root.join("crates")).unwrap().map(|e| e.unwrap().path().join("src"));
    let folders = crates.filter(|f| !f.is_symlink()).chain(["python/tumble", "web/src"].map(|f| root.join(f)));
    let mut found = Vec::new();
    folders.filter(|f| f.is_dir()).for_each(|folder| texts(&folder, &mut found));
    let mut wrong = Vec::new();
    for (method, places) in [("compressible", &COMPRESSIBLE[..]), ("vicsek", &VICSEK[..])] {
        let (own, mut total) = (own(method), 0);
        for path in &found {
            let name = path.strip_prefix(&root).unwrap().to_str().unwrap().replace('\\', "/");
            if own.contains(&name) {
                continue;
            }
            let n = lines_with(method, &fs::read_to_string(path).unwrap());
            let allowed = places.iter().find(|p| p.0 == name).map_or(0, |p| p.1);
            total += n;
            if n > allowed {
                wrong.push(format!("{name}: {n} lines with {method}, expected {allowed} at most"));
            }
        }
        println!("{method}: {total} places");
        assert!(total >= 9, "the test sees no places");
    }
    assert!(wrong.is_empty(), "a method is named outside its own files:\n{}", wrong.join("\n"));
    assert_eq!(lines_with("heat", "heat::Heat\nheated\n(heat.3) x\nHEAT, preheat\n// of heat."), 3);
}
