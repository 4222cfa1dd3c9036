//! Binary glTF 2.0. The crate `gltf` splits the file and reads the JSON; the buffer is read here, because the crate's
//! own accessors believe counts and offsets and panic on wrong ones.

use crate::build::{DAMAGED, Weld, word};
use gltf::Semantic;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, Primitive};
use gltf::json::scene::Node;
use gltf::json::validation::Checked;
use gltf::json::{Root, accessor};
use std::borrow::Cow;
use std::collections::BTreeSet;
use tumble_interface::Mesh;

/// Bytes of the file header and the header of the first chunk.
const HEADERS: usize = 20;

/// Extensions that a file may require and that do not touch the geometry.
const HARMLESS: [&str; 5] = ["KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_xmp"];

/// Nodes may show one mesh, and primitives one accessor, many times over; so many values may be read from any file
/// (a second or two), and more from a file that has more bytes than that.
pub const VALUES: usize = 1 << 24;

pub fn read(bytes: &[u8]) -> Result<Mesh, String> {
    if bytes.trim_ascii_start().starts_with(b"{") {
        return Err("this is the text form of glTF (.gltf), not binary; export a single .glb file".to_owned());
    }
    let file = framed(bytes)?;
    let glb = gltf::Glb::from_slice(file).map_err(|e| format!("{e}; {DAMAGED}"))?;
    let root = parse(&glb.json)?;
    let buffers = [glb.bin];
    let mut scene = Scene { root: &root, buffers: &buffers, values: VALUES.max(bytes.len()), mesh: Mesh::default() };
    scene.walk()?;
    Ok(scene.mesh)
}

/// The bytes of the file as its header counts them.
fn framed(bytes: &[u8]) -> Result<&[u8], String> {
    if !bytes.starts_with(b"glTF") {
        return Err("the file does not start with \"glTF\"; check the file extension".to_owned());
    }
    let length = word(bytes, 8).map_or(0, u32::from_le_bytes) as usize;
    bytes.get(..length).filter(|file| file.len() >= HEADERS).ok_or_else(|| {
        format!("the header declares {length} bytes, but there are {}; the file is truncated or damaged, export it again", bytes.len())
    })
}

/// The file, and its buffers; those that are in other files are `None`.
pub type Open<'a> = (Root, Vec<Option<Cow<'a, [u8]>>>);

/// Opens a binary file, or the text form with its buffers inside.
pub fn open(bytes: &[u8]) -> Result<Open<'_>, String> {
    if bytes.trim_ascii_start().starts_with(b"{") {
        let root = parse(bytes)?;
        let inside = |uri: &String| {
            let (_, data) = uri.strip_prefix("data:")?.split_once(";base64,")?;
            base64(data).map(Cow::Owned)
        };
        let buffers = root.buffers.iter().map(|b| b.uri.as_ref().and_then(inside)).collect();
        return Ok((root, buffers));
    }
    let file = framed(bytes)?;
    let glb = gltf::Glb::from_slice(file).map_err(|e| format!("{e}; {DAMAGED}"))?;
    Ok((parse(&glb.json)?, vec![glb.bin]))
}

/// Bytes of base64 text; `None` if it is none.
fn base64(text: &str) -> Option<Vec<u8>> {
    let text = text.trim_end_matches('=').as_bytes();
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 3);
    for four in text.chunks(4) {
        let mut word = 0_u32;
        for c in four {
            let six = match c {
                b'A'..=b'Z' => c - b'A',
                b'a'..=b'z' => c - b'a' + 26,
                b'0'..=b'9' => c - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return None,
            };
            word = word << 6 | u32::from(six);
        }
        let n = four.len();
        word <<= 6 * (4 - n);
        bytes.extend(&word.to_be_bytes()[1..n]);
    }
    Some(bytes)
}

fn parse(json: &[u8]) -> Result<Root, String> {
    let root = Root::from_slice(json).map_err(|e| format!("JSON: {e}; {DAMAGED}"))?;
    if let Some(name) = root.extensions_required.iter().find(|name| !HARMLESS.iter().any(|start| name.starts_with(start))) {
        return Err(format!("the file requires the extension {name}, which is not supported; export without it (no compression)"));
    }
    Ok(root)
}

/// The file, and what of it has been read.
pub struct Scene<'a> {
    pub root: &'a Root,
    pub buffers: &'a [Option<Cow<'a, [u8]>>],
    /// Values that may still be read.
    pub values: usize,
    pub mesh: Mesh,
}

impl<'a> Scene<'a> {
    /// Appends the meshes of all nodes of the default scene, or of the first one, or of all nodes if there is no scene.
    fn walk(&mut self) -> Result<(), String> {
        let mut places: Vec<Affine> = Vec::new();
        for (n, parent) in nodes(self.root)? {
            let node = &self.root.nodes[n];
            let transform = parent.map_or(Affine::IDENTITY, |p| places[p]).after(Affine::of(node));
            places.push(transform);
            if let Some(mesh) = node.mesh {
                self.add_mesh(mesh.value(), transform)?;
            }
        }
        Ok(())
    }

    /// Appends a mesh as one node shows it.
    fn add_mesh(&mut self, m: usize, transform: Affine) -> Result<(), String> {
        let mesh = self.root.meshes.get(m).ok_or_else(|| format!("mesh {m} does not exist; {DAMAGED}"))?;
        // A mirrored mesh would be inside out: the order of its corners is reversed (glTF 2.0, 3.7.4).
        let mirrored = transform.determinant() < 0.0;
        let mut weld = Weld::default();
        for primitive in &mesh.primitives {
            self.add_primitive(primitive, transform, mirrored, &mut weld).map_err(|e| format!("mesh {m}: {e}"))?;
        }
        Ok(())
    }

    fn add_primitive(&mut self, primitive: &Primitive, transform: Affine, mirrored: bool, weld: &mut Weld) -> Result<(), String> {
        self.spend(1)?;
        let Checked::Valid(mode) = primitive.mode else { return Err(format!("unknown kind of primitive; {DAMAGED}")) };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(()); // points and lines
        }
        let Some(positions) = primitive.attributes.get(&Checked::Valid(Semantic::Positions)) else {
            return Err("a primitive without POSITION; export the mesh with its vertices".to_owned());
        };
        let positions = self.column(positions.value(), Type::Vec3, &[ComponentType::F32])?;
        // Invalid texture coordinates are ignored.
        let texture = primitive.attributes.get(&Checked::Valid(Semantic::TexCoords(0)));
        let texture = texture
            .and_then(|column| self.column(column.value(), Type::Vec2, &[ComponentType::F32, ComponentType::U8, ComponentType::U16]).ok());
        let indices = [ComponentType::U8, ComponentType::U16, ComponentType::U32];
        let indices = match primitive.indices {
            Some(column) => Some(self.column(column.value(), Type::Scalar, &indices)?),
            None => None,
        };

        let mut numbers = Vec::with_capacity(positions.count); // bounded by the buffer's length
        for i in 0..positions.count {
            let x = positions.vector(i);
            let number = weld.number(x, self.mesh.vertices.len())?;
            if number as usize == self.mesh.vertices.len() {
                self.mesh.vertices.push(transform.apply(x));
            }
            numbers.push(number);
        }
        // In glTF v points down.
        let texture: Vec<_> = texture.iter().flat_map(|c| (0..c.count).map(|i| [c.number(i, 0), 1.0 - c.number(i, 1)])).collect();
        self.add_triangles(mode, indices.as_ref(), &numbers, &texture, mirrored)
    }

    /// Appends the triangles of a primitive; `numbers` are those of its vertices in the mesh, `texture` their texture coordinates.
    pub fn add_triangles(
        &mut self,
        mode: Mode,
        indices: Option<&Column<'_>>,
        numbers: &[u32],
        texture: &[[f64; 2]],
        mirrored: bool,
    ) -> Result<(), String> {
        let n = indices.map_or(numbers.len(), |indices| indices.count);
        let index = |k: usize| indices.map_or(k, |indices| indices.integer(k));
        let corner = |k: usize| {
            let i = index(k);
            numbers
                .get(i)
                .copied()
                .ok_or_else(|| format!("vertex {i} is used, but there are {} (counted from 0); {DAMAGED}", numbers.len()))
        };
        let triangles = match mode {
            Mode::Triangles => n / 3,
            _ => n.saturating_sub(2),
        };
        for t in 0..triangles {
            let [a, b, c] = match mode {
                Mode::Triangles => [3 * t, 3 * t + 1, 3 * t + 2],
                Mode::TriangleStrip => [t, t + 1 + t % 2, t + 2 - t % 2], // every second one runs backwards
                _ => [0, t + 1, t + 2],
            };
            let (b, c) = if mirrored { (c, b) } else { (b, c) };
            self.mesh.triangles.push([corner(a)?, corner(b)?, corner(c)?]);
            let at = |k: usize| texture.get(index(k)).copied();
            self.mesh.texture.push((|| Some([at(a)?, at(b)?, at(c)?]))());
        }
        Ok(())
    }

    /// The values of an accessor, which must be of this type and of one of these component types.
    pub fn column(&mut self, a: usize, type_: Type, components: &[ComponentType]) -> Result<Column<'a>, String> {
        let fault = |what: &str| format!("accessor {a} {what}");
        let damaged = |what: &str| format!("accessor {a} {what}; {DAMAGED}");
        let accessor = self.root.accessors.get(a).ok_or_else(|| damaged("does not exist"))?;
        let component = match accessor.component_type {
            Checked::Valid(accessor::GenericComponentType(component)) if components.contains(&component) => component,
            _ => return Err(fault("has an unexpected number type; export the mesh without quantization")),
        };
        if accessor.type_ != Checked::Valid(type_) {
            return Err(damaged("has an unexpected value type"));
        }
        if accessor.sparse.is_some() {
            return Err(fault("is sparse, which is not supported; export the mesh without sparse accessors"));
        }
        let view = accessor.buffer_view.and_then(|view| self.root.buffer_views.get(view.value()));
        let view = view.ok_or_else(|| fault("has no data in the file; export the mesh without compression"))?;
        let buffer = self.root.buffers.get(view.buffer.value()).zip(self.buffers.get(view.buffer.value()));
        // The chunk of a binary file is the buffer without an address.
        let inside = |uri: &Option<String>| uri.as_ref().is_none_or(|uri| uri.starts_with("data:"));
        let Some((_, Some(buffer))) = buffer.filter(|(words, _)| inside(&words.uri)) else {
            return Err(fault("has its data in another file; export a single .glb file with everything embedded"));
        };
        let outside = || damaged("reaches beyond the end of its data");
        let offset = view.byte_offset.unwrap_or_default().0;
        let data = part(buffer, offset, view.byte_length.0).ok_or_else(outside)?;

        // The last value may end before a whole stride does.
        let size = component.size() * type_.multiplicity();
        let stride = view.byte_stride.map_or(size, |stride| stride.0);
        let count = usize::try_from(accessor.count.0).map_err(|_| outside())?;
        if stride < size {
            return Err(damaged("has a stride shorter than its values"));
        }
        let length = match count.checked_sub(1) {
            Some(last) => last.checked_mul(stride).and_then(|start| start.checked_add(size)).ok_or_else(outside)?,
            None => 0,
        };
        let data = part(data, accessor.byte_offset.unwrap_or_default().0, length as u64).ok_or_else(outside)?;
        self.spend(count)?;
        Ok(Column { data, stride, component, count })
    }

    /// Counts `n` values as read.
    pub fn spend(&mut self, n: usize) -> Result<(), String> {
        let rest = self.values.checked_sub(n);
        self.values = rest.ok_or("the nodes instantiate their meshes too often to expand them all; export fewer instances")?;
        Ok(())
    }
}

/// Nodes of the default scene, or of the first one, or all if there is no scene: each with the place of its parent in this list,
/// parents before children.
pub fn nodes(root: &Root) -> Result<Vec<(usize, Option<usize>)>, String> {
    let scene = root.scenes.get(root.scene.map_or(0, |s| s.value()));
    let tops: Vec<usize> = match scene {
        Some(scene) => scene.nodes.iter().map(|node| node.value()).collect(),
        None => {
            let children: BTreeSet<usize> = root.nodes.iter().flat_map(children).collect();
            (0..root.nodes.len()).filter(|node| !children.contains(node)).collect()
        }
    };
    // A stack and not a recursion: a chain of nodes may be as long as the file.
    let mut todo: Vec<(usize, Option<usize>)> = tops.into_iter().rev().map(|node| (node, None)).collect();
    let mut seen = vec![false; root.nodes.len()];
    let mut all = Vec::new();
    while let Some((n, parent)) = todo.pop() {
        let node = root.nodes.get(n).ok_or_else(|| format!("node {n} does not exist; {DAMAGED}"))?;
        if std::mem::replace(&mut seen[n], true) {
            return Err(format!("node {n} has two parents or is its own ancestor; {DAMAGED}"));
        }
        all.push((n, parent));
        todo.extend(children(node).map(|child| (child, Some(all.len() - 1))));
    }
    Ok(all)
}

fn children(node: &Node) -> impl Iterator<Item = usize> {
    node.children.iter().flatten().map(|child| child.value())
}

fn part(data: &[u8], start: u64, length: u64) -> Option<&[u8]> {
    let start = usize::try_from(start).ok()?;
    data.get(start..start.checked_add(usize::try_from(length).ok()?)?)
}

/// Values in a buffer; every one of them lies inside `data`.
pub struct Column<'a> {
    data: &'a [u8],
    stride: usize,
    component: ComponentType,
    pub count: usize,
}

impl Column<'_> {
    /// Number k of value i; whole numbers as parts of the largest one.
    pub fn number(&self, i: usize, k: usize) -> f64 {
        let start = i * self.stride + k * self.component.size();
        let bytes = self.data.get(start..).unwrap_or_default();
        let two = || bytes.first_chunk().copied();
        let number = match self.component {
            ComponentType::F32 => bytes.first_chunk().map(|b| f32::from_le_bytes(*b).into()),
            ComponentType::U8 => bytes.first().map(|b| f64::from(*b) / 255.0),
            ComponentType::I8 => bytes.first().map(|b| (f64::from(*b as i8) / 127.0).max(-1.0)),
            ComponentType::U16 => two().map(|b| f64::from(u16::from_le_bytes(b)) / 65535.0),
            ComponentType::I16 => two().map(|b| (f64::from(i16::from_le_bytes(b)) / 32767.0).max(-1.0)),
            ComponentType::U32 => None,
        };
        number.unwrap_or(f64::NAN)
    }

    /// Whole number k of value i.
    pub fn index(&self, i: usize, k: usize) -> usize {
        let start = i * self.stride + k * self.component.size();
        let bytes = self.data.get(start..start + self.component.size()).unwrap_or_default();
        bytes.iter().rev().fold(0, |value, byte| value << 8 | usize::from(*byte))
    }

    pub fn vector(&self, i: usize) -> [f64; 3] {
        [0, 4, 8].map(|k| word(self.data, i * self.stride + k).map_or(f64::NAN, |b| f32::from_le_bytes(b).into()))
    }

    pub fn integer(&self, i: usize) -> usize {
        let start = i * self.stride;
        let bytes = self.data.get(start..start + self.component.size()).unwrap_or_default();
        bytes.iter().rev().fold(0, |value, byte| value << 8 | usize::from(*byte))
    }
}

/// x -> m x + t, m by rows.
#[derive(Clone, Copy)]
pub struct Affine {
    pub m: [[f64; 3]; 3],
    pub t: [f64; 3],
}

impl Affine {
    pub const IDENTITY: Self = Self { m: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], t: [0.0; 3] };

    /// A node's transform to its parent: its matrix, given by columns, or translation after rotation after scale.
    pub fn of(node: &Node) -> Self {
        if let Some(columns) = node.matrix {
            let entry = |row: usize, column: usize| f64::from(columns[4 * column + row]);
            return Self { m: [0, 1, 2].map(|r| [0, 1, 2].map(|c| entry(r, c))), t: [0, 1, 2].map(|r| entry(r, 3)) };
        }
        let [x, y, z, w] = node.rotation.unwrap_or_default().0.map(f64::from);
        let s = node.scale.map_or([1.0; 3], |s| s.map(f64::from));
        // Unit quaternion to matrix.
        let r = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        Self { m: r.map(|row| [row[0] * s[0], row[1] * s[1], row[2] * s[2]]), t: node.translation.map_or([0.0; 3], |t| t.map(f64::from)) }
    }

    /// `inner` first, then `self`.
    pub fn after(self, inner: Self) -> Self {
        let column = |c: usize| inner.m.map(|row| row[c]);
        Self { m: self.m.map(|row| [0, 1, 2].map(|c| dot(row, column(c)))), t: self.apply(inner.t) }
    }

    fn apply(self, x: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|r| dot(self.m[r], x) + self.t[r])
    }

    pub fn determinant(self) -> f64 {
        let [a, b, c] = self.m;
        dot(a, [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]])
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
