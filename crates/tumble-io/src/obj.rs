//! Wavefront OBJ: `v x y z` and `f i j k ...`, the rest of the format is skipped.
//!
//! Read here and not with the crate `tobj`, which renumbers vertices by first use, starts a new vertex list at each
//! object, group and material (a closed mesh comes out open along their borders), does not tell the line of an error,
//! and overflows on texture indices out of range.

use crate::build::{DAMAGED, fan};
use tumble_interface::Mesh;

pub fn read(bytes: &[u8]) -> Result<Mesh, String> {
    if bytes.contains(&0) {
        return Err("this is a binary file, not an OBJ text; check the file extension".to_owned());
    }
    let text = String::from_utf8_lossy(bytes); // names and comments may be in any encoding
    let mut mesh = Mesh::default();
    let mut largest = (0, 0); // index in the file, counted from 1, and its line
    let mut polygon = Vec::new();
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
            Some("f") => {
                polygon.clear();
                for word in words {
                    let i = position(word, mesh.vertices.len()).ok_or_else(|| {
                        format!("line {number}: \"{word}\" names no vertex (the first is 1, the latest is -1); {DAMAGED}")
                    })?;
                    if i > largest.0 {
                        largest = (i, number);
                    }
                    polygon.push(i - 1);
                }
                if polygon.len() < 3 {
                    return Err(format!("line {number}: a face needs 3 vertices, this one has {}; {DAMAGED}", polygon.len()));
                }
                fan(&mut mesh.triangles, &polygon);
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
        return Err(format!("line {number}: the face uses vertex {i}, but the file has {n}; it is cut off or damaged, export it again"));
    }
    Ok(mesh)
}

/// Vertex number, from 1, that a corner `v`, `v/vt`, `v//vn` or `v/vt/vn` names after `n` vertices; -1 is the latest.
fn position(corner: &str, n: usize) -> Option<u32> {
    let i: i64 = corner.split('/').next()?.parse().ok()?;
    let i = if i < 0 { i64::try_from(n).ok()? + 1 + i } else { i };
    u32::try_from(i).ok().filter(|i| *i > 0)
}
