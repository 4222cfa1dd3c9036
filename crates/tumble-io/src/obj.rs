//! Wavefront OBJ: `v x y z`, `vt u v` and `f i/j ...`, or `l i j ...`, the rest of the format is skipped. What is wrong with texture coordinates only
//! leaves them out: few scenes want them.
//!
//! Read here and not with the crate `tobj`, which renumbers vertices by first use, starts a new vertex list at each
//! object, group and material (a closed mesh comes out open along their borders), does not tell the line of an error,
//! and overflows on texture indices out of range.

use crate::build::DAMAGED;
use crate::polygon::Polygons;
use crate::text::{comma, lines_of, number, unmarked};
use tumble_interface::{Curves, Mesh};

pub fn read(bytes: &[u8]) -> Result<Mesh, String> {
    let mut found = Found::default();
    statements(bytes, |said, n| found.statement(said, n))?;
    found.finish()
}

/// The polylines, `l i j ...`, of which those that go on from the last vertex of the one before are one: some programs write each piece
/// by itself.
pub fn curves(bytes: &[u8]) -> Result<Curves, String> {
    let mut found = Lines::default();
    statements(bytes, |said, n| found.statement(said, n))?;
    found.finish()
}

/// Whether a text has polylines.
pub fn has_curves(bytes: &[u8]) -> bool {
    unmarked(bytes).windows(3).any(|w| matches!(w, [b'\n' | b'\r', b'l', b' ' | b'\t']))
}

/// Tells each statement and the number of its line.
fn statements(bytes: &[u8], mut tell: impl FnMut(&str, usize) -> Result<(), String>) -> Result<(), String> {
    let bytes = unmarked(bytes);
    if bytes.contains(&0) {
        return Err("this is a binary file, not an OBJ text; check the file extension".to_owned());
    }
    let mut joined = String::new();
    for (n, line) in (1_usize..).zip(lines_of(&bytes).lines().chain([""])) {
        let (said, comment) = line.split_once('#').map_or((line, false), |(said, _)| (said, true));
        joined.push_str(said.trim_end());
        // What ends in a backslash goes on in the next line; but comments end with theirs, and so do names, which may end in one: D:\maps\.
        let key = joined.split([' ', '\t', '\\']).find(|word| !word.is_empty());
        if !comment && matches!(key, None | Some("v" | "vt" | "f" | "l")) && joined.ends_with('\\') {
            joined.pop();
            joined.push(' ');
            continue;
        }
        tell(&joined, n).map_err(|e| format!("line {n}: {e}"))?;
        joined.clear();
    }
    Ok(())
}

/// Three coordinates; a weight or a colour may follow.
fn point<'a>(words: &mut impl Iterator<Item = &'a str>) -> Result<[f64; 3], String> {
    let mut x = [0.0; 3];
    for x in &mut x {
        *x = number(words.next().ok_or_else(|| format!("a vertex needs 3 coordinates; {DAMAGED}"))?)?;
    }
    Ok(x)
}

/// Index of the vertex, counted from 1, that a corner names after `n` vertices.
fn vertex(word: &str, n: usize) -> Result<u32, String> {
    position(word, n).ok_or_else(|| format!("\"{word}\" is not a vertex index (the first is 1, the latest is -1); {DAMAGED}"))
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
    /// Number of polylines.
    lines: usize,
}

impl Found {
    fn statement(&mut self, said: &str, line: usize) -> Result<(), String> {
        let mut words = said.split_ascii_whitespace();
        match words.next() {
            Some("v") => self.mesh.vertices.push(point(&mut words)?),
            Some("l") => self.lines += 1,
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
                    let i = vertex(word, self.mesh.vertices.len())?;
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
        let Self { mut mesh, faces, corners, texture, textured, largest, lines } = self;
        let n = mesh.vertices.len();
        if faces.is_empty() && lines > 0 {
            return Err(format!("it has curves ({lines} lines \"l i j\") and no faces; hair takes curves as guides = {{ path = ... }}"));
        }
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

/// Polylines, in the order of their lines.
#[derive(Default)]
struct Lines {
    vertices: Vec<[f64; 3]>,
    /// Vertices of each, counted from 1, and the line.
    lines: Vec<(Vec<u32>, usize)>,
    faces: usize,
}

impl Lines {
    fn statement(&mut self, said: &str, line: usize) -> Result<(), String> {
        let mut words = said.split_ascii_whitespace();
        match words.next() {
            Some("v") => self.vertices.push(point(&mut words)?),
            Some("f") => self.faces += 1,
            Some("l") => {
                let own = words.map(|word| vertex(word, self.vertices.len())).collect::<Result<Vec<u32>, _>>()?;
                if own.len() < 2 {
                    return Err(format!("a curve needs 2 vertices, this one has {}; {DAMAGED}", own.len()));
                }
                match self.lines.last_mut() {
                    Some((before, _)) if before.last() == own.first() => before.extend(&own[1..]),
                    _ => self.lines.push((own, line)),
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Points of the curves, which may come before their vertices.
    fn finish(self) -> Result<Curves, String> {
        let Self { vertices, lines, faces } = self;
        if lines.is_empty() && faces > 0 {
            let message = "it has faces and no curves (lines \"l i j\"); export the strands as curves, or let hair grow on this mesh as mesh = { path = ... }";
            return Err(message.to_owned());
        }
        if lines.is_empty() {
            return Err("there are no curves (lines \"l i j\") in it; export the strands as polylines".to_owned());
        }
        let mut curves = Vec::with_capacity(lines.len());
        for (k, (corners, line)) in (1_usize..).zip(lines) {
            let mut own = Vec::with_capacity(corners.len());
            for i in corners {
                let x = vertices.get(i as usize - 1).ok_or_else(|| {
                    let n = vertices.len();
                    format!("line {line}: the curve uses vertex {i}, but the file has {n}; it is truncated or damaged, export it again")
                })?;
                if x.iter().any(|x| !x.is_finite()) {
                    return Err(format!("line {line}: curve {k} goes through {x:?}, which is not finite; export it again"));
                }
                own.push(*x);
            }
            if own.iter().all(|x| *x == own[0]) {
                return Err(format!("line {line}: curve {k} has no length, all its points are {:?}; leave it out", own[0]));
            }
            curves.push(own);
        }
        Ok(curves)
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
