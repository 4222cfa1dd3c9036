//! STL, ASCII or binary. Coordinates are read in double precision; equal positions are welded.
//!
//! Read here and not with the crate `stl_io`, which takes a binary file whose header says "solid" for ASCII, stops
//! silently at the end of the first of several solids, and wants the ASCII in lower case with a name after "solid".

use crate::build::{DAMAGED, Weld, word};
use crate::text::{lines_of, number, unmarked};
use tumble_interface::Mesh;

/// Bytes before the first triangle of a binary file: an 80-byte comment and the number of triangles.
const HEADER: usize = 84;
/// Bytes of a triangle: normal and three corners as floats, and two bytes of attributes.
const TRIANGLE: usize = 50;

pub fn read(bytes: &[u8]) -> Result<Mesh, String> {
    let unmarked = unmarked(bytes);
    let text = unmarked.trim_ascii_start();
    let says_solid = text.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let mut mesh = Mesh::default();
    let mut weld = Weld::default();
    let mut add = |corners: [[f64; 3]; 3]| -> Result<(), String> {
        let mut triangle = [0; 3];
        for (i, x) in triangle.iter_mut().zip(corners) {
            *i = weld.number(x, mesh.vertices.len())?;
            if *i as usize == mesh.vertices.len() {
                mesh.vertices.push(x);
            }
        }
        mesh.triangles.push(triangle);
        Ok(())
    };

    // A binary comment may begin with "solid" too, but a text has no zero bytes, and a count has one unless there
    // are more than 2^24 triangles; then the length decides.
    let declared = word(bytes, HEADER - 4).map(u32::from_le_bytes);
    let expected = declared.map(|n| HEADER as u64 + TRIANGLE as u64 * u64::from(n));
    if says_solid && !text.iter().take(HEADER).any(|b| *b == 0) && expected != Some(bytes.len() as u64) {
        ascii(&lines_of(text), &mut add)?;
        return Ok(mesh);
    }
    let (Some(n), Some(expected)) = (declared, expected) else {
        return Err("shorter than an STL header, and no \"solid\" at the start; is this a complete STL file?".to_owned());
    };
    if (bytes.len() as u64) < expected {
        return Err(format!(
            "the header declares {n} triangles, {expected} bytes, but there are {}; the file is truncated or not STL, export it again",
            bytes.len()
        ));
    }
    let float = |triangle: &[u8], k: usize| word(triangle, 4 * k).map_or(f64::NAN, |b| f32::from_le_bytes(b).into());
    for triangle in bytes[HEADER..].chunks_exact(TRIANGLE).take(n as usize) {
        add([3, 6, 9].map(|k| [k, k + 1, k + 2].map(|k| float(triangle, k))))?;
    }
    Ok(mesh)
}

/// One or more solids. The first word of a line says what it is; only corners and ends of loops matter.
fn ascii(text: &str, add: &mut impl FnMut([[f64; 3]; 3]) -> Result<(), String>) -> Result<(), String> {
    let mut corners = Vec::new();
    let mut open = false;
    for (n, line) in (1_usize..).zip(text.lines()) {
        let mut words = line.split_ascii_whitespace();
        match words.next().unwrap_or_default().to_ascii_lowercase().as_str() {
            "solid" => open = true,
            "endsolid" => open = false,
            "vertex" => {
                let mut x = [0.0; 3];
                for x in &mut x {
                    let word = words.next().ok_or_else(|| format!("line {n}: a vertex needs 3 coordinates; {DAMAGED}"))?;
                    *x = number(word).map_err(|e| format!("line {n}: {e}"))?;
                }
                corners.push(x);
            }
            "endloop" => {
                let found = corners.len();
                add(corners[..].try_into().map_err(|_| format!("line {n}: a facet with {found} vertices, not 3; {DAMAGED}"))?)?;
                corners.clear();
            }
            _ => {}
        }
    }
    if open || !corners.is_empty() {
        return Err("the text ends before \"endsolid\"; the file is truncated, export it again".to_owned());
    }
    Ok(())
}
