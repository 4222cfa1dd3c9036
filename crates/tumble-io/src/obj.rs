//! Wavefront OBJ: `v x y z`, `vt u v` and `f i/j ...`, the rest of the format is skipped. What is wrong with texture coordinates only
//! leaves them out: few scenes want them.
//!
//! Read here and not with the crate `tobj`, which renumbers vertices by first use, starts a new vertex list at each
//! object, group and material (a closed mesh comes out open along their borders), does not tell the line of an error,
//! and overflows on texture indices out of range.

use crate::build::DAMAGED;
use crate::polygon::Polygons;
use crate::text::{comma, lines_of, number, unmarked};
use tumble_interface::Mesh;

pub fn read(bytes: &[u8]) -> Result<Mesh, String> {
    let bytes = unmarked(bytes);
    if bytes.contains(&0) {
        return Err("this is a binary file, not an OBJ text; check the file extension".to_owned());
    }
    let mut found = Found::default();
    let mut joined = String::new();
    for (n, line) in (1_usize..).zip(lines_of(&bytes).lines().chain([""])) {
        let (said, comment) = line.split_once('#').map_or((line, false), |(said, _)| (said, true));
        joined.push_str(said.trim_end());
        // What ends in a backslash goes on in the next line; but comments end with theirs, and so do names, which may end in one: D:\maps\.
        let key = joined.split([' ', '\t', '\\']).find(|word| !word.is_empty());
        if !comment && matches!(key, None | Some("v" | "vt" | "f")) && joined.ends_with('\\') {
            joined.pop();
            joined.push(' ');
            continue;
        }
        found.statement(&joined, n).map_err(|e| format!("line {n}: {e}"))?;
        joined.clear();
    }
    found.finish()
}

/// What the file says, in the order of its lines.
#[derive(Default)]
struct Found {
    mesh: Mesh,
    /// Of each face how many corners it has, and the line.
    faces: Vec<(usize, usize)>,
    /// Vertices of all corners of all faces.
    corners: Vec<u32>,
    texture: Vec<[f64; 2]>,
    /// Of all corners, into it.
    textured: Vec<Option<u32>>,
    /// Largest index in the file, counted from 1, and its line.
    largest: (u32, usize),
}

impl Found {
    fn statement(&mut self, said: &str, line: usize) -> Result<(), String> {
        let mut words = said.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let mut x = [0.0; 3]; // a weight or a colour may follow
                for x in &mut x {
                    *x = number(words.next().ok_or_else(|| format!("a vertex needs 3 coordinates; {DAMAGED}"))?)?;
                }
                self.mesh.vertices.push(x);
            }
            Some("vt") => {
                if let Some(word) = words.clone().find(|word| comma(word).is_some()) {
                    number(word)?;
                }
                let mut next = || words.next().and_then(|word| word.parse().ok()).unwrap_or(f64::NAN);
                self.texture.push([next(), next()]);
            }
            Some("f") => {
                let before = self.corners.len();
                for word in words {
                    let i = position(word, self.mesh.vertices.len())
                        .ok_or_else(|| format!("\"{word}\" is not a vertex index (the first is 1, the latest is -1); {DAMAGED}"))?;
                    if i > self.largest.0 {
                        self.largest = (i, line);
                    }
                    self.corners.push(i - 1);
                    self.textured.push(counted(word.split('/').nth(1), self.texture.len()).map(|i| i - 1));
                }
                let n = self.corners.len() - before;
                if n < 3 {
                    return Err(format!("a face needs 3 vertices, this one has {n}; {DAMAGED}"));
                }
                self.faces.push((n, line));
            }
            _ => {}
        }
        Ok(())
    }

    /// Triangles of the faces, which may come before their vertices.
    fn finish(self) -> Result<Mesh, String> {
        let Self { mut mesh, faces, corners, texture, textured, largest } = self;
        let n = mesh.vertices.len();
        if n == 0 && faces.is_empty() {
            return Err("neither vertices (lines \"v x y z\") nor faces (\"f i j k\") found; is this an OBJ file?".to_owned());
        }
        if largest.0 as usize > n {
            let (i, line) = largest;
            return Err(format!(
                "line {line}: the face uses vertex {i}, but the file has {n}; it is truncated or damaged, export it again"
            ));
        }
        let mut polygons = Polygons::default();
        let mut first = 0;
        for (n, line) in faces {
            let at = |k: usize| texture.get(textured[first + k]? as usize).copied();
            polygons.add(&mut mesh, &corners[first..first + n], at).map_err(|e| format!("line {line}: {e}"))?;
            first += n;
        }
        Ok(mesh)
    }
}

/// The text of an OBJ file of a mesh, with its texture coordinates; what [`mesh`](crate::mesh) reads from it is the same, bit by bit, if it has no
/// vertices that no triangle uses.
pub fn write(mesh: &Mesh) -> String {
    let mut text = String::new();
    for [x, y, z] in &mesh.vertices {
        text += &format!("v {x:?} {y:?} {z:?}\n");
    }
    let mut n = 0;
    for (t, corners) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|i| u64::from(i) + 1);
        match mesh.texture.get(t).copied().flatten() {
            Some(texture) => {
                text.extend(texture.map(|[u, v]| format!("vt {u:?} {v:?}\n")));
                text += &format!("f {a}/{} {b}/{} {c}/{}\n", n + 1, n + 2, n + 3);
                n += 3;
            }
            None => text += &format!("f {a} {b} {c}\n"),
        }
    }
    text
}

/// Vertex number, from 1, that a corner `v`, `v/vt`, `v//vn` or `v/vt/vn` names after `n` vertices.
fn position(corner: &str, n: usize) -> Option<u32> {
    counted(corner.split('/').next(), n)
}

/// A number, from 1, in a list of which `n` have been read; -1 is the latest.
fn counted(word: Option<&str>, n: usize) -> Option<u32> {
    let i: i64 = word?.parse().ok()?;
    let i = if i < 0 { i64::try_from(n).ok()? + 1 + i } else { i };
    u32::try_from(i).ok().filter(|i| *i > 0)
}
