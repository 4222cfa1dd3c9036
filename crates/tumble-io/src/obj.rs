//! Wavefront OBJ: `v x y z`, `vt u v` and `f i/j ...`, the rest of the format is skipped. What is wrong with texture coordinates only
//! leaves them out: few scenes want them.
//!
//! Read here and not with the crate `tobj`, which renumbers vertices by first use, starts a new vertex list at each
//! object, group and material (a closed mesh comes out open along their borders), does not tell the line of an error,
//! and overflows on texture indices out of range.

use crate::build::{DAMAGED, fan, texture_fan};
use tumble_interface::Mesh;

pub fn read(bytes: &[u8]) -> Result<Mesh, String> {
    if bytes.contains(&0) {
        return Err("this is a binary file, not an OBJ text; check the file extension".to_owned());
    }
    let text = String::from_utf8_lossy(bytes); // names and comments may be in any encoding
    let mut mesh = Mesh::default();
    let mut largest = (0, 0); // index in the file, counted from 1, and its line
    let mut polygon = Vec::new();
    let mut texture: Vec<[f64; 2]> = Vec::new();
    let mut corners: Vec<Option<usize>> = Vec::new(); // of all polygons, into it
    let mut sizes = Vec::new();
    let mut joined = String::new();
    for (number, line) in (1_usize..).zip(text.lines().chain([""])) {
        // A line that ends in a backslash goes on in the next.
        if let Some(start) = line.strip_suffix('\\') {
            joined.push_str(start);
            joined.push(' ');
            continue;
        }
        joined.push_str(line);
        let mut words = joined.split('#').next().unwrap_or_default().split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let mut x = [0.0; 3]; // a weight or a colour may follow
                for x in &mut x {
                    let word = words.next().ok_or_else(|| format!("line {number}: a vertex needs 3 coordinates; {DAMAGED}"))?;
                    *x = word.parse().map_err(|_| format!("line {number}: \"{word}\" is not a number; {DAMAGED}"))?;
                }
                mesh.vertices.push(x);
            }
            Some("vt") => {
                let mut next = || words.next().and_then(|word| word.parse().ok()).unwrap_or(f64::NAN);
                texture.push([next(), next()]);
            }
            Some("f") => {
                polygon.clear();
                for word in words {
                    let i = position(word, mesh.vertices.len()).ok_or_else(|| {
                        format!("line {number}: \"{word}\" is not a vertex index (the first is 1, the latest is -1); {DAMAGED}")
                    })?;
                    if i > largest.0 {
                        largest = (i, number);
                    }
                    polygon.push(i - 1);
                    corners.push(counted(word.split('/').nth(1), texture.len()).and_then(|i| usize::try_from(i - 1).ok()));
                }
                if polygon.len() < 3 {
                    return Err(format!("line {number}: a face needs 3 vertices, this one has {}; {DAMAGED}", polygon.len()));
                }
                fan(&mut mesh.triangles, &polygon);
                sizes.push(polygon.len());
            }
            _ => {}
        }
        joined.clear();
    }
    let n = mesh.vertices.len();
    if n == 0 && mesh.triangles.is_empty() {
        return Err("neither vertices (lines \"v x y z\") nor faces (\"f i j k\") found; is this an OBJ file?".to_owned());
    }
    if largest.0 as usize > n {
        let (i, number) = largest;
        return Err(format!("line {number}: the face uses vertex {i}, but the file has {n}; it is truncated or damaged, export it again"));
    }
    // Lines may be in any order.
    let mut corners = corners.into_iter().map(|i| texture.get(i?).copied());
    for n in sizes {
        texture_fan(&mut mesh.texture, &corners.by_ref().take(n).collect::<Vec<_>>());
    }
    Ok(mesh)
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
