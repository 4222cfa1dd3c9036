//! Shared by all readers: welding and the final check.

use std::collections::HashMap;
use tumble_interface::Mesh;

/// Texture coordinates of the corners of a triangle, if all of them have some.
pub type Texture = Option<[[f64; 2]; 3]>;

/// Numbers positions so that equal ones get the same number. Equal means equal bits, but -0 equals 0.
#[derive(Default)]
pub struct Weld {
    index: HashMap<[u64; 3], u32>,
}

impl Weld {
    /// The number of `position`, which is `next` if it is new. Not-a-number equals itself here; [`finish`] rejects it.
    pub fn number(&mut self, position: [f64; 3], next: usize) -> Result<u32, String> {
        let key = position.map(|x| (x + 0.0).to_bits()); // -0 + 0 = 0
        if let Some(i) = self.index.get(&key) {
            return Ok(*i);
        }
        let i = u32::try_from(next).map_err(|_| too_many(next))?;
        self.index.insert(key, i);
        Ok(i)
    }
}

/// Checks that the mesh is one, and drops vertices that no triangle uses and texture coordinates that are no numbers.
pub fn finish(mesh: Mesh) -> Result<Mesh, String> {
    let Mesh { vertices, mut triangles, texture, mut renumbered, .. } = mesh;
    let n = vertices.len();
    if triangles.is_empty() {
        return Err(format!("no triangles in the file ({n} vertices); export a surface mesh, not points or curves"));
    }
    if u32::try_from(n).is_err() {
        return Err(too_many(n));
    }
    if let Some(i) = vertices.iter().position(|v| v.iter().any(|x| !x.is_finite())) {
        return Err(format!("vertex {i} (counted from 0) at {:?} is not finite; repair the mesh or export it again", vertices[i]));
    }
    let mut used = vec![false; n];
    for (t, triangle) in triangles.iter().enumerate() {
        for i in triangle {
            match used.get_mut(*i as usize) {
                Some(used) => *used = true,
                None => return Err(format!("triangle {t} uses vertex {i}, but there are {n} (counted from 0); {DAMAGED}")),
            }
        }
    }
    let mut texture: Vec<Texture> =
        texture.into_iter().map(|corners| corners.filter(|c| c.as_flattened().iter().all(|x| x.is_finite()))).collect();
    if texture.len() != triangles.len() || texture.iter().all(Option::is_none) {
        texture.clear();
    }
    if used.iter().all(|used| *used) {
        return Ok(Mesh { vertices, triangles, texture, unused: 0, renumbered });
    }
    let mut kept = 0;
    let mut new = vec![0; n];
    for (new, used) in new.iter_mut().zip(&used) {
        *new = kept;
        kept += u32::from(*used);
    }
    let moved = (0..n).find(|i| used[*i] && new[*i] as usize != *i).map(|i| [i as u32, new[i]]);
    renumbered = match (renumbered, moved) {
        // Numbers changed before, but not up to there.
        (Some([before, _]), Some(moved)) if moved[0] < before => Some(moved),
        (Some([before, after]), _) => Some([before, new[after as usize]]),
        (None, moved) => moved,
    };
    for i in triangles.as_flattened_mut() {
        *i = new[*i as usize];
    }
    let vertices: Vec<_> = vertices.into_iter().zip(used).filter_map(|(v, used)| used.then_some(v)).collect();
    let unused = n - vertices.len();
    Ok(Mesh { vertices, triangles, texture, unused, renumbered })
}

/// Cure for a file whose parts contradict each other.
pub const DAMAGED: &str = "the file is damaged, export it again";

fn too_many(n: usize) -> String {
    format!("{n} vertices exceed the index range ({}); decimate the mesh", u32::MAX)
}

/// The four bytes at `start`, if there are so many.
pub fn word(bytes: &[u8], start: usize) -> Option<[u8; 4]> {
    bytes.get(start..)?.first_chunk().copied()
}
