//! Binary glTF 2.0. The crate `gltf` splits the file and reads the JSON; the buffer is read here, because the crate's
//! own accessors believe counts and offsets and panic on wrong ones.

use crate::build::{DAMAGED, Weld, word};
use gltf::Semantic;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, Primitive};
use gltf::json::scene::Node;
use gltf::json::validation::Checked;
use gltf::json::{Root, accessor};
use std::collections::BTreeSet;
use tumble_interface::Mesh;

/// Bytes of the file header and the header of the first chunk.
const HEADERS: usize = 20;

/// Extensions that a file may require and that do not touch the geometry.
const HARMLESS: [&str; 5] = ["KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_xmp"];

/// Nodes may show one mesh, and primitives one accessor, many times over; so many values may be read from any file
/// (a second or two), and more from a file that has more bytes than that.
const VALUES: usize = 1 << 24;

pub fn read(bytes: &[u8]) -> Result<Mesh, String> {
    if bytes.trim_ascii_start().starts_with(b"{") {
        return Err("this is the text form of glTF (.gltf), not the binary one; export it as one .glb file".to_owned());
    }
    if !bytes.starts_with(b"glTF") {
        return Err("the file does not begin with \"glTF\"; check the file extension".to_owned());
    }
    let length = word(bytes, 8).map_or(0, u32::from_le_bytes) as usize;
    let file = bytes.get(..length).filter(|file| file.len() >= HEADERS).ok_or_else(|| {
        format!("the header declares {length} bytes, there are {}; the file is cut off or damaged, export it again", bytes.len())
    })?;
    let glb = gltf::Glb::from_slice(file).map_err(|e| format!("{e}; {DAMAGED}"))?;
    let root = Root::from_slice(&glb.json).map_err(|e| format!("JSON: {e}; {DAMAGED}"))?;
    if let Some(name) = root.extensions_required.iter().find(|name| !HARMLESS.iter().any(|start| name.starts_with(start))) {
        return Err(format!("the file requires the extension {name}, which is not read; export it without (no compression)"));
    }
    let buffer = glb.bin.as_deref().unwrap_or_default();
    let mut scene = Scene { root: &root, buffer, values: VALUES.max(bytes.len()), mesh: Mesh::default() };
    scene.walk()?;
    Ok(scene.mesh)
}

/// The file, and what of it has been read.
struct Scene<'a> {
    root: &'a Root,
    buffer: &'a [u8],
    /// Values that may still be read.
    values: usize,
    mesh: Mesh,
}

impl<'a> Scene<'a> {
    /// Appends the meshes of all nodes of the default scene, or of the first one, or of all nodes if there is no scene.
    fn walk(&mut self) -> Result<(), String> {
        let root = self.root;
        let scene = root.scenes.get(root.scene.map_or(0, |s| s.value()));
        let tops: Vec<usize> = match scene {
            Some(scene) => scene.nodes.iter().map(|node| node.value()).collect(),
            None => {
                let children: BTreeSet<usize> = root.nodes.iter().flat_map(children).collect();
                (0..root.nodes.len()).filter(|node| !children.contains(node)).collect()
            }
        };
        // A stack and not a recursion: a chain of nodes may be as long as the file.
        let mut todo: Vec<(usize, Affine)> = tops.into_iter().rev().map(|node| (node, Affine::IDENTITY)).collect();
        let mut seen = vec![false; root.nodes.len()];
        while let Some((n, parent)) = todo.pop() {
            let node = root.nodes.get(n).ok_or_else(|| format!("node {n} does not exist; {DAMAGED}"))?;
            if std::mem::replace(&mut seen[n], true) {
                return Err(format!("node {n} has two parents or is its own ancestor; {DAMAGED}"));
            }
            let transform = parent.after(Affine::of(node));
            if let Some(mesh) = node.mesh {
                self.add_mesh(mesh.value(), transform)?;
            }
            todo.extend(children(node).map(|child| (child, transform)));
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
        let n = indices.as_ref().map_or(positions.count, |indices| indices.count);
        let corner = |k: usize| {
            let i = indices.as_ref().map_or(k, |indices| indices.integer(k));
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
        }
        Ok(())
    }

    /// The values of an accessor, which must be of this type and of one of these component types.
    fn column(&mut self, a: usize, type_: Type, components: &[ComponentType]) -> Result<Column<'a>, String> {
        let fault = |what: &str| format!("accessor {a} {what}");
        let damaged = |what: &str| format!("accessor {a} {what}; {DAMAGED}");
        let accessor = self.root.accessors.get(a).ok_or_else(|| damaged("does not exist"))?;
        let component = match accessor.component_type {
            Checked::Valid(accessor::GenericComponentType(component)) if components.contains(&component) => component,
            _ => return Err(fault("holds another type of numbers than expected; export the mesh without quantization")),
        };
        if accessor.type_ != Checked::Valid(type_) {
            return Err(damaged("holds another type of values than expected"));
        }
        if accessor.sparse.is_some() {
            return Err(fault("is sparse, which is not read; export the mesh without sparse accessors"));
        }
        let view = accessor.buffer_view.and_then(|view| self.root.buffer_views.get(view.value()));
        let view = view.ok_or_else(|| fault("has no data in the file; export the mesh without compression"))?;
        let buffer = self.root.buffers.get(view.buffer.value());
        if view.buffer.value() != 0 || buffer.is_none_or(|buffer| buffer.uri.is_some()) {
            return Err(fault("has its data in another file; export one .glb file with everything inside"));
        }
        let outside = || damaged("reaches beyond the end of its data");
        let offset = view.byte_offset.unwrap_or_default().0;
        let data = part(self.buffer, offset, view.byte_length.0).ok_or_else(outside)?;

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
    fn spend(&mut self, n: usize) -> Result<(), String> {
        let rest = self.values.checked_sub(n);
        self.values = rest.ok_or("the nodes show their meshes too often to unfold them all; export fewer instances, or one")?;
        Ok(())
    }
}

fn children(node: &Node) -> impl Iterator<Item = usize> {
    node.children.iter().flatten().map(|child| child.value())
}

fn part(data: &[u8], start: u64, length: u64) -> Option<&[u8]> {
    let start = usize::try_from(start).ok()?;
    data.get(start..start.checked_add(usize::try_from(length).ok()?)?)
}

/// Values in a buffer; every one of them lies inside `data`.
struct Column<'a> {
    data: &'a [u8],
    stride: usize,
    component: ComponentType,
    count: usize,
}

impl Column<'_> {
    fn vector(&self, i: usize) -> [f64; 3] {
        [0, 4, 8].map(|k| word(self.data, i * self.stride + k).map_or(f64::NAN, |b| f32::from_le_bytes(b).into()))
    }

    fn integer(&self, i: usize) -> usize {
        let start = i * self.stride;
        let bytes = self.data.get(start..start + self.component.size()).unwrap_or_default();
        bytes.iter().rev().fold(0, |value, byte| value << 8 | usize::from(*byte))
    }
}

/// x -> m x + t, m by rows.
#[derive(Clone, Copy)]
struct Affine {
    m: [[f64; 3]; 3],
    t: [f64; 3],
}

impl Affine {
    const IDENTITY: Self = Self { m: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], t: [0.0; 3] };

    /// A node's transform to its parent: its matrix, given by columns, or translation after rotation after scale.
    fn of(node: &Node) -> Self {
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
    fn after(self, inner: Self) -> Self {
        let column = |c: usize| inner.m.map(|row| row[c]);
        Self { m: self.m.map(|row| [0, 1, 2].map(|c| dot(row, column(c)))), t: self.apply(inner.t) }
    }

    fn apply(self, x: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|r| dot(self.m[r], x) + self.t[r])
    }

    fn determinant(self) -> f64 {
        let [a, b, c] = self.m;
        dot(a, [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]])
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
