//! Bytes of a mesh file in, a [`Mesh`] or a [`Character`] out; of a record, a [`Fabric`](tumble_interface::Fabric); and volumes in, bytes
//! of a VDB file out ([`vdb`]); of drawings floor plans ([`plan`]). [`assets`] does it for all that a scene names. Nothing here opens a file, so the browser uses it too.
//!
//! What is common to all formats of meshes: coordinates are taken as they stand in the file (no unit is converted, and an axis turned
//! in GLB only, which says where up is); a polygon becomes the fan of triangles around its first corner where that covers it, and others
//! that do where not; objects, groups and materials are merged; normals, colours and images are dropped, texture coordinates kept;
//! vertices that no triangle uses are dropped, the others keep their order. Text may begin with a byte order mark and end its lines in any
//! way. Any bytes give a mesh or a one-line message that names the cure, never a panic; work and memory grow with the length of the file,
//! not with the counts it declares (instances in a GLB have a limit).
//! Verified by `tests/formats.rs`, `tests/text.rs`, `tests/polygons.rs` and `tests/fuzz.rs`.

pub mod assets;
mod build;
mod fabric;
mod glb;
mod obj;
pub mod plan;
mod ply;
mod polygon;
mod skin;
mod stl;
mod text;
mod vdb;

use tumble_interface::{Character, Curves, Mesh};

pub use fabric::{fabric, record_is_json, shipped};
use obj::has_curves;
pub use obj::write as obj;
pub use tumble_interface::repair::{Repairs, repair};
pub use vdb::{Class, Volume, vdb};

/// A mesh file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Format {
    /// Wavefront OBJ. Vertices are the `v` lines: seams of normals or texture coordinates split nothing.
    Obj,
    /// Stanford PLY: ASCII, binary little-endian or binary big-endian. Texture coordinates are `s`, `t` or `u`, `v` of vertices, which are
    /// split at seams (equal positions are then welded), or lists `texcoord` of faces.
    Ply,
    /// STL, ASCII or binary. The format repeats each vertex in each triangle: equal positions are welded.
    Stl,
    /// Binary glTF 2.0 with its buffer inside, node transforms applied, turned from y up to z up: (x, y, z) becomes (x, -z, y).
    /// The format splits vertices at seams of normals and texture coordinates: within one mesh of one node, equal
    /// positions are welded. A skin stands where the nodes of its joints do, in the bind pose if they were left in it, whatever moves the node
    /// of the mesh. Morph targets and animations are ignored: [`character`] reads the latter.
    Glb,
}

impl Format {
    /// The formats that can be read.
    pub const ALL: [Self; 4] = [Self::Obj, Self::Ply, Self::Stl, Self::Glb];

    /// The format that the file extension of `path` stands for, upper or lower case.
    pub fn from_path(path: &str) -> Option<Self> {
        let (_, extension) = path.rsplit_once('.')?;
        Self::ALL.into_iter().find(|f| f.name().eq_ignore_ascii_case(extension))
    }

    /// Its name: the file extension, in capitals.
    pub fn name(self) -> &'static str {
        match self {
            Self::Obj => "OBJ",
            Self::Ply => "PLY",
            Self::Stl => "STL",
            Self::Glb => "GLB",
        }
    }
}

/// Reads the triangles of a file.
///
/// The mesh has at least one triangle, every index is in range and every coordinate is finite. Whether it is closed
/// is for [`Mesh::defects`] to say.
///
/// # Errors
/// One line: what is wrong with the file, where, and what to do.
pub fn mesh(bytes: &[u8], format: Format) -> Result<Mesh, String> {
    let read = match format {
        _ if bytes.is_empty() => Err("the file is empty; export the mesh again".to_owned()),
        Format::Obj => obj::read(bytes),
        Format::Ply => ply::read(bytes),
        Format::Stl => stl::read(bytes),
        Format::Glb => glb::read(bytes),
    };
    let mut found = read.and_then(build::finish).map_err(|message| format!("{}: {}", format.name(), one_line(&message)))?;
    if format == Format::Glb {
        // Parts of a GLB share their vertices with each other; their numbers mean nothing to anybody.
        (found.unused, found.renumbered) = (0, None);
    }
    Ok(found)
}

/// Reads the curves of a file.
///
/// There is at least one; each has two or more points, finite and not all alike.
///
/// # Errors
/// One line: what is wrong with the file, where, and what to do.
pub fn curves(bytes: &[u8], format: Format) -> Result<Curves, String> {
    let read = match format {
        _ if bytes.is_empty() => Err("the file is empty; export the curves again".to_owned()),
        Format::Obj => obj::curves(bytes),
        _ => Err("it holds a mesh, not curves; hair takes it as mesh = { path = ... }, and guides as OBJ with lines \"l i j\", or as USD"
            .to_owned()),
    };
    read.map_err(|message| format!("{}: {}", format.name(), one_line(&message)))
}

/// Reads a skinned figure with its movements from a GLB file, or from the text of a glTF file with its data inside.
///
/// The mesh is one as from [`mesh`]; every joint, bind and vertex that is named exists, parents come before children, the
/// weights of each vertex add up to 1, all numbers are finite, times rise, and each track has as many values as it needs.
///
/// # Errors
/// One line: what is wrong with the file, where, and what to do.
pub fn character(bytes: &[u8]) -> Result<Character, String> {
    skin::read(bytes).map_err(|message| format!("glTF: {}", one_line(&message)))
}

/// Longest message [characters]; the file may be quoted in it, and a line of a file may be of any length.
const LONGEST_MESSAGE: usize = 300;

/// Without line breaks, control characters and excess.
fn one_line(message: &str) -> String {
    let mut words = message.split(|c: char| c.is_whitespace() || c.is_control()).filter(|word| !word.is_empty());
    let mut line = String::new();
    while line.len() < 4 * LONGEST_MESSAGE
        && let Some(word) = words.next()
    {
        if !line.is_empty() {
            line.push(' ');
        }
        line.extend(word.chars().take(LONGEST_MESSAGE));
    }
    if let Some((cut, _)) = line.char_indices().nth(LONGEST_MESSAGE) {
        line.truncate(cut);
        line.push_str(" ...");
    }
    line
}
