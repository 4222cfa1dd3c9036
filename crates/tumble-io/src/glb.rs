//! Binary glTF 2.0. The crate `gltf` splits the file and reads the JSON; the buffer is read here, because the crate's
//! own accessors believe counts and offsets and panic on wrong ones.

use crate::build::{DAMAGED, Weld, word};
use crate::text::unmarked;
use gltf::Semantic;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, Primitive};
use gltf::json::scene::Node;
use gltf::json::validation::Checked;
use gltf::json::{Root, accessor};
use std::borrow::Cow;
use std::collections::BTreeSet;
use tumble_interface::Mesh;
use tumble_interface::triples::dot;

/// Sets of four joints that a vertex may have; the four largest weights count.
const SETS: u32 = 4;

pub const INDICES: [ComponentType; 3] = [ComponentType::U8, ComponentType::U16, ComponentType::U32];
const WEIGHTS: [ComponentType; 3] = [ComponentType::F32, ComponentType::U8, ComponentType::U16];

/// The square of the length of a unit quaternion in single precision is that close to 1.
const ROUNDING: f64 = 1e-6;

/// Bytes of the file header and the header of the first chunk.
const HEADERS: usize = 20;

/// Extensions that a file may require and that do not touch the geometry.
const HARMLESS: [&str; 5] = ["KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_xmp"];

/// Extensions that change what is shown where, also where a file only uses them and does not require them.
const MOVING: [(&str, &str); 3] = [
    ("EXT_mesh_gpu_instancing", "copies of meshes would be missing; export it again with its instances made real"),
    ("KHR_node_visibility", "hidden objects would appear; export it again without them"),
    ("CESIUM_RTC", "the mesh would be elsewhere; export it again with plain coordinates"),
];

/// Nodes may show one mesh, and primitives one accessor, many times over; so many values may be read from any file
/// (a second or two), and more from a file that has more bytes than that.
pub const VALUES: usize = 1 << 24;

pub fn read(bytes: &[u8]) -> Result<Mesh, String> {
    if is_text(bytes) {
        return Err("this is the text form of glTF (.gltf), not binary; export a single .glb file".to_owned());
    }
    let file = framed(bytes)?;
    let glb = gltf::Glb::from_slice(file).map_err(|e| format!("{e}; {DAMAGED}"))?;
    let root = parse(&glb.json)?;
    let buffers = [glb.bin];
    let mut scene = Scene { root: &root, buffers: &buffers, values: VALUES.max(bytes.len()), mesh: Mesh::default() };
    scene.walk()?;
    // From y up to z up.
    let vertices = scene.mesh.vertices.iter().map(|[x, y, z]| [*x, 0.0 - z, *y]).collect();
    Ok(Mesh { vertices, ..scene.mesh })
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
    if is_text(bytes) {
        let root = parse(&unmarked(bytes))?;
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
    let root = Root::from_slice(json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json)).map_err(|e| format!("JSON: {e}; {DAMAGED}"))?;
    if let Some(name) = root.extensions_required.iter().find(|name| !HARMLESS.iter().any(|start| name.starts_with(start))) {
        return Err(format!("the file requires the extension {name}, which is not supported; export without it (no compression)"));
    }
    let told = root.extensions_used.iter().find_map(|name| MOVING.iter().find(|(known, _)| name == known));
    if let Some((name, cure)) = told {
        return Err(format!("the file uses the extension {name}, which is not supported: {cure}"));
    }
    Ok(root)
}

/// What starts with the text form of glTF.
fn is_text(bytes: &[u8]) -> bool {
    unmarked(bytes).trim_ascii_start().starts_with(b"{")
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
        let all = nodes(self.root)?;
        let mut places: Vec<Affine> = Vec::with_capacity(all.len());
        let mut place_of = vec![None; self.root.nodes.len()];
        for (n, parent) in &all {
            let place = parent.map_or(Affine::IDENTITY, |p| places[p]).after(Affine::of(&self.root.nodes[*n]));
            places.push(place);
            place_of[*n] = Some(place);
        }
        for ((n, _), place) in all.iter().zip(places) {
            let node = &self.root.nodes[*n];
            let Some(mesh) = node.mesh else { continue };
            let bones = match node.skin {
                Some(skin) => Some(self.bones(skin.value(), &place_of)?),
                None => None,
            };
            self.add_mesh(mesh.value(), place, bones.as_deref())?;
        }
        Ok(())
    }

    /// What each joint of a skin, where its node stands, does to the vertices.
    fn bones(&mut self, s: usize, place_of: &[Option<Affine>]) -> Result<Vec<Affine>, String> {
        let bone = |(node, inverse): (usize, [[f64; 4]; 3])| {
            let place = place_of.get(node).copied().flatten().ok_or_else(|| not_in_scene(node))?;
            Ok(place.after(Affine { m: inverse.map(|[a, b, c, _]| [a, b, c]), t: inverse.map(|row| row[3]) }))
        };
        self.joints(s)?.into_iter().map(bone).collect()
    }

    /// The joints of a skin: their nodes, and the inverse bind matrices.
    pub fn joints(&mut self, s: usize) -> Result<Vec<(usize, [[f64; 4]; 3])>, String> {
        let skin = self.root.skins.get(s).ok_or_else(|| format!("skin {s} does not exist; {DAMAGED}"))?;
        self.spend(skin.joints.len())?;
        let inverses = match skin.inverse_bind_matrices {
            Some(column) => Some(self.column(column.value(), Type::Mat4, &[ComponentType::F32])?),
            None => None,
        };
        if let Some(inverses) = inverses.as_ref().filter(|c| c.count < skin.joints.len()) {
            return Err(format!("skin {s} has {} matrices for {} joints; {DAMAGED}", inverses.count, skin.joints.len()));
        }
        let joint = |(i, node): (usize, usize)| {
            let entry = |r: usize, c: usize| inverses.as_ref().map_or(f64::from(u8::from(r == c)), |m| m.number(i, 4 * c + r));
            let inverse = [0, 1, 2].map(|r| [0, 1, 2, 3].map(|c| entry(r, c)));
            if inverse.as_flattened().iter().any(|x| !x.is_finite()) {
                return Err(format!("matrix {i} of skin {s} is not finite; {DAMAGED}"));
            }
            if inverse.iter().all(|row| row[..3] == [0.0; 3]) {
                return Err(format!("matrix {i} of skin {s} is zero; {DAMAGED}"));
            }
            Ok((node, inverse))
        };
        skin.joints.iter().map(|joint| joint.value()).enumerate().map(joint).collect()
    }

    /// Joints and weights of the `n` vertices of a primitive that has a skin.
    pub fn weights(&mut self, primitive: &Primitive, n: usize) -> Result<Weights<'a>, String> {
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|a| a.value());
        let mut sets = Vec::new();
        for set in 0..SETS {
            let (Some(joints), Some(weights)) = (attribute(Semantic::Joints(set)), attribute(Semantic::Weights(set))) else { break };
            let joints = self.column(joints, Type::Vec4, &INDICES[..2])?;
            let weights = self.column(weights, Type::Vec4, &WEIGHTS)?;
            if joints.count != n || weights.count != n {
                return Err(format!("{n} positions, but {} joints and {} weights; {DAMAGED}", joints.count, weights.count));
            }
            sets.push((joints, weights));
        }
        if sets.is_empty() {
            return Err("a primitive of a skin without JOINTS_0 and WEIGHTS_0; export it with its weights".to_owned());
        }
        Ok(Weights(sets))
    }

    /// Appends a mesh as one node shows it, where it stands or where its bones do.
    fn add_mesh(&mut self, m: usize, place: Affine, bones: Option<&[Affine]>) -> Result<(), String> {
        let mesh = self.root.meshes.get(m).ok_or_else(|| format!("mesh {m} does not exist; {DAMAGED}"))?;
        let mut weld = Weld::default();
        for primitive in &mesh.primitives {
            self.add_primitive(primitive, place, bones, &mut weld).map_err(|e| format!("mesh {m}: {e}"))?;
        }
        Ok(())
    }

    fn add_primitive(&mut self, primitive: &Primitive, place: Affine, bones: Option<&[Affine]>, weld: &mut Weld) -> Result<(), String> {
        self.spend(1)?;
        let Checked::Valid(mode) = primitive.mode else { return Err(format!("unknown kind of primitive; {DAMAGED}")) };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(()); // points and lines
        }
        let Some(positions) = primitive.attributes.get(&Checked::Valid(Semantic::Positions)) else {
            return Err("a primitive without POSITION; export the mesh with its vertices".to_owned());
        };
        let positions = self.column(positions.value(), Type::Vec3, &[ComponentType::F32])?;
        let weights = match bones {
            Some(_) => Some(self.weights(primitive, positions.count)?),
            None => None,
        };
        // Invalid texture coordinates are ignored.
        let texture = primitive.attributes.get(&Checked::Valid(Semantic::TexCoords(0)));
        let texture = texture
            .and_then(|column| self.column(column.value(), Type::Vec2, &[ComponentType::F32, ComponentType::U8, ComponentType::U16]).ok());
        let indices = match primitive.indices {
            Some(column) => Some(self.column(column.value(), Type::Scalar, &INDICES)?),
            None => None,
        };

        let mut numbers = Vec::with_capacity(positions.count); // bounded by the buffer's length
        for i in 0..positions.count {
            let x = positions.vector(i);
            let number = weld.number(x, self.mesh.vertices.len())?;
            if number as usize == self.mesh.vertices.len() {
                let place = match (bones, &weights) {
                    (Some(bones), Some(weights)) => {
                        let four = weights.four(i, bones.len()).map_err(|e| format!("vertex {i}: {e}"))?;
                        Affine::mean(four.map(|(joint, weight)| (bones.get(joint).copied().unwrap_or(Affine::IDENTITY), weight)))
                    }
                    _ => place,
                };
                self.mesh.vertices.push(place.apply(x));
            }
            numbers.push(number);
        }
        // A mirrored mesh would be inside out: the order of its corners is reversed (glTF 2.0, 3.7.4).
        let mirrored = bones.and_then(|bones| bones.first()).unwrap_or(&place).determinant() < 0.0;
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
        if let Some(q) = node.rotation.filter(|q| node.matrix.is_none() && (q.0 == [0.0; 4] || q.0.iter().any(|x| !x.is_finite()))) {
            return Err(format!("node {n} has the rotation {:?}, which is none; {DAMAGED}", q.0));
        }
        all.push((n, parent));
        todo.extend(children(node).map(|child| (child, Some(all.len() - 1))));
    }
    Ok(all)
}

/// Of a joint that the scene does not show.
pub fn not_in_scene(node: usize) -> String {
    format!("node {node} is used but not in the scene; {DAMAGED}")
}

/// Joints and weights of vertices, in sets of four.
pub struct Weights<'a>(Vec<(Column<'a>, Column<'a>)>);

impl Weights<'_> {
    /// The four largest weights of a vertex with their joints, of which there are `joints`, made to add up to 1.
    pub fn four(&self, i: usize, joints: usize) -> Result<[(usize, f64); 4], String> {
        let mut found: Vec<(usize, f64)> = Vec::new();
        for (joint, weight) in self.0.iter().flat_map(|(joints, weights)| (0..4).map(|k| (joints.index(i, k), weights.number(i, k)))) {
            if !(0.0..=1e6).contains(&weight) {
                return Err(format!("a weight of {weight}, expected 0 to 1; export the mesh again"));
            }
            if weight > 0.0 && joint >= joints {
                return Err(format!("joint {joint} of {joints} (counted from 0); {DAMAGED}"));
            }
            found.push((joint, weight));
        }
        found.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let sum: f64 = found.iter().take(4).map(|f| f.1).sum();
        if sum <= 0.0 {
            return Err("no weight above 0; bind every vertex to a bone and export it again".to_owned());
        }
        Ok(std::array::from_fn(|k| found.get(k).filter(|f| f.1 > 0.0).map_or((0, 0.0), |f| (f.0, f.1 / sum))))
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
        let q = node.rotation.unwrap_or_default().0.map(f64::from);
        let length_sq: f64 = q.iter().map(|x| x * x).sum();
        // Beyond what rounding leaves of 1.
        let [x, y, z, w] = if (length_sq - 1.0).abs() > ROUNDING { q.map(|x| x / length_sq.sqrt()) } else { q };
        let s = node.scale.map_or([1.0; 3], |s| s.map(f64::from));
        // Unit quaternion to matrix.
        let r = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        Self { m: r.map(|row| [row[0] * s[0], row[1] * s[1], row[2] * s[2]]), t: node.translation.map_or([0.0; 3], |t| t.map(f64::from)) }
    }

    /// The mean of four, by weights.
    fn mean(all: [(Self, f64); 4]) -> Self {
        let sum = |of: &dyn Fn(&Self) -> f64| all.iter().map(|(place, weight)| weight * of(place)).sum();
        Self { m: [0, 1, 2].map(|r| [0, 1, 2].map(|c| sum(&|p| p.m[r][c]))), t: [0, 1, 2].map(|r| sum(&|p| p.t[r])) }
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
