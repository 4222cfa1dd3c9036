//! Numbers on a grid in, the bytes of an OpenVDB file (version 224) out.
//!
//! Trees are of the usual shape, 5-4-3: a root, nodes of 32³ and of 16³ children, leaves of 8³ voxels. Only active voxels
//! are stored: those that differ from the background by more than the tolerance. Leaves whose voxels are all active and
//! all equal become tiles. The file is seekable; its identifier is a hash of its content, so that the same numbers give
//! the same bytes. Format: `openvdb/io/Archive.cc`, `io/Compression.h` and `tree/` of OpenVDB 10.
//! Verified by `python/tests/test_vdb.py`, which reads the files with OpenVDB.

use half::f16;

/// Grid class, for programs that need it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Class {
    /// Nothing in particular.
    #[default]
    Unknown,
    /// A density of smoke.
    Fog,
    /// Distances from a surface, below zero inside.
    LevelSet,
    /// Vectors whose components lie on the lower faces of the voxels.
    Staggered,
}

impl Class {
    /// The class of that name: `unknown`, `fog volume`, `level set` or `staggered`.
    pub fn named(name: &str) -> Option<Self> {
        [Self::Unknown, Self::Fog, Self::LevelSet, Self::Staggered].into_iter().find(|c| c.name() == name)
    }

    /// Its name in the file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Fog => "fog volume",
            Self::LevelSet => "level set",
            Self::Staggered => "staggered",
        }
    }
}

/// A box of voxels, to be a grid of the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volume<'a> {
    /// Name of the grid.
    pub name: &'a str,
    /// Unit of the values, kept as metadata.
    pub unit: &'a str,
    /// Grid class.
    pub class: Class,
    /// The numbers, x fastest, those of a vector together.
    pub values: &'a [f32],
    /// Numbers a voxel: 1, or 3 for vectors.
    pub width: usize,
    /// Voxels along x, y and z.
    pub points: [usize; 3],
    /// Index of the first voxel.
    pub corner: [i32; 3],
    /// Distance of voxels [m].
    pub spacing: f64,
    /// Place of the middle of voxel 0, 0, 0 [m].
    pub origin: [f64; 3],
    /// Value of everything that is not stored, of each component.
    pub background: f32,
    /// Voxels that differ by no more from the background are not stored; without it, the whole box is.
    pub tolerance: Option<f32>,
    /// Store values in half precision.
    pub half: bool,
}

const FILE_VERSION: u32 = 224;
const LIBRARY_VERSION: [u32; 2] = [10, 0];
const ZIP: u32 = 1;
const ACTIVE_MASK: u32 = 2;

/// All values of a node that are not active are background.
const BACKGROUND_ELSEWHERE: u8 = 0;

/// Side of a leaf, of a node of leaves and of a node of those [voxel].
const LEAF: i64 = 8;
const LOWER: i64 = 16 * LEAF;
const UPPER: i64 = 32 * LOWER;

/// Effort of zip, 0 to 10.
const EFFORT: u8 = 6;

/// The bytes of a file with these grids; `zip` packs the values of all that are no fog.
///
/// # Errors
/// One line: which grid cannot be written, and why.
pub fn vdb(volumes: &[Volume<'_>], zip: bool) -> Result<Vec<u8>, String> {
    for (i, volume) in volumes.iter().enumerate() {
        check(volume).map_err(|text| format!("VDB: \"{}\": {text}", volume.name))?;
        if volumes[..i].iter().any(|v| v.name == volume.name) {
            return Err(format!("VDB: \"{}\": two grids of that name, expected one", volume.name));
        }
    }
    let mut file = File::default();
    file.bytes.extend(0x5644_4220_u64.to_le_bytes());
    file.u32(FILE_VERSION);
    LIBRARY_VERSION.iter().for_each(|v| file.u32(*v));
    file.bytes.push(1); // Grids can be found by their offsets.
    let identifier = file.bytes.len();
    file.bytes.extend([b'0'; 36]);
    file.u32(1);
    file.note("creator", "string", b"tumble");
    file.u32(volumes.len() as u32);
    for volume in volumes {
        file.grid(volume, &Tree::new(volume), zip);
    }
    let id = uuid(&file.bytes);
    file.bytes[identifier..identifier + 36].copy_from_slice(id.as_bytes());
    Ok(file.bytes)
}

fn check(volume: &Volume<'_>) -> Result<(), String> {
    let Volume { width, points, values, .. } = volume;
    if !matches!(width, 1 | 3) {
        return Err(format!("{width} numbers per voxel, expected 1 or 3"));
    }
    let wanted = points.iter().try_fold(*width, |n, m| n.checked_mul(*m));
    if wanted != Some(values.len()) {
        return Err(format!("{} numbers, expected {width} for each of {points:?} voxels", values.len()));
    }
    if !(volume.spacing > 0.0 && volume.spacing.is_finite() && volume.origin.iter().all(|x| x.is_finite())) {
        return Err(format!("spacing {} m and origin {:?} m, expected finite numbers, spacing > 0", volume.spacing, volume.origin));
    }
    let room = |(corner, n): (&i32, &usize)| i64::try_from(*n).is_ok_and(|n| i64::from(*corner) + n <= i64::from(i32::MAX) - UPPER);
    if !volume.corner.iter().zip(points).all(room) || volume.corner.iter().any(|c| i64::from(*c) < i64::from(i32::MIN) + UPPER) {
        return Err(format!("{points:?} voxels from {:?} on exceed the index range of the format", volume.corner));
    }
    if volume.half
        && let Some(large) = values.iter().find(|v| v.is_finite() && !f16::from_f32(**v).is_finite())
    {
        return Err(format!("{large} exceeds the range of half precision, 65504; write single precision"));
    }
    Ok(())
}

/// Active voxels of 8³.
struct Leaf {
    mask: [u64; 8],
    /// Offset of its values.
    start: usize,
    count: usize,
}

/// 16³ leaves or tiles, by place.
struct Lower {
    tiles: Vec<(usize, usize)>,
    leaves: Vec<(usize, Leaf)>,
}

/// 32³ nodes, by place.
struct Upper {
    corner: [i64; 3],
    children: Vec<(usize, Lower)>,
}

struct Tree {
    width: usize,
    background: f32,
    half: bool,
    /// Active values in the order of the file.
    values: Vec<f32>,
    nodes: Vec<Upper>,
    voxels: i64,
    /// Lowest and highest active voxel.
    extent: Option<[[i64; 3]; 2]>,
}

/// The blocks of side `side` that a box touches, x slowest, and what of the box is in each: lowest and beyond the highest.
fn blocks(low: [i64; 3], high: [i64; 3], side: i64) -> impl Iterator<Item = ([i64; 3], [i64; 3], [i64; 3])> {
    let along = move |a: usize| (low[a].div_euclid(side)..(high[a] + side - 1).div_euclid(side)).map(move |k| k * side);
    along(0).flat_map(move |x| along(1).flat_map(move |y| along(2).map(move |z| [x, y, z]))).map(move |corner| {
        let from = std::array::from_fn(|a| low[a].max(corner[a]));
        (corner, from, std::array::from_fn(|a| high[a].min(corner[a] + side)))
    })
}

/// Number of the block at `corner` among those of side `side` in a node of 2^bits of them a side.
fn place(corner: [i64; 3], side: i64, bits: u32) -> usize {
    let at = |a: usize| (corner[a].div_euclid(side) & ((1 << bits) - 1)) as usize;
    (at(0) << (2 * bits)) | (at(1) << bits) | at(2)
}

impl Tree {
    fn new(volume: &Volume<'_>) -> Self {
        let background = if volume.half { f16::from_f32(volume.background).to_f32() } else { volume.background };
        let mut tree =
            Self { width: volume.width, background, half: volume.half, values: Vec::new(), nodes: Vec::new(), voxels: 0, extent: None };
        let low = volume.corner.map(i64::from);
        let high = std::array::from_fn(|a| low[a] + volume.points[a] as i64);
        for (corner, from, to) in blocks(low, high, UPPER) {
            let mut children = Vec::new();
            for (middle, from, to) in blocks(from, to, LOWER) {
                let mut node = Lower { tiles: Vec::new(), leaves: Vec::new() };
                for (leaf, from, to) in blocks(from, to, LEAF) {
                    tree.leaf(volume, leaf, from, to, &mut node);
                }
                if !node.leaves.is_empty() || !node.tiles.is_empty() {
                    children.push((place(middle, LOWER, 5), node));
                }
            }
            if !children.is_empty() {
                tree.nodes.push(Upper { corner, children });
            }
        }
        tree
    }

    /// Adds what is active of the box in a leaf.
    fn leaf(&mut self, volume: &Volume<'_>, corner: [i64; 3], from: [i64; 3], to: [i64; 3], node: &mut Lower) {
        let w = self.width;
        let active = |v: f32| match volume.tolerance {
            None => true,
            Some(t) => v.to_bits() != volume.background.to_bits() && !(t > 0.0 && (v - volume.background).abs() <= t),
        };
        let (start, mut mask) = (self.values.len(), [0; 8]);
        let [mut low, mut high] = [to, from];
        for x in from[0]..to[0] {
            for y in from[1]..to[1] {
                for z in from[2]..to[2] {
                    let [i, j, k] = std::array::from_fn(|a| ([x, y, z][a] - i64::from(volume.corner[a])) as usize);
                    let first = w * (i + volume.points[0] * (j + volume.points[1] * k));
                    let value = &volume.values[first..first + w];
                    if value.iter().any(|v| active(*v)) {
                        mask[(x - corner[0]) as usize] |= 1 << (8 * (y - corner[1]) + z - corner[2]);
                        self.values.extend(value);
                        for (a, c) in [x, y, z].into_iter().enumerate() {
                            low[a] = low[a].min(c);
                            high[a] = high[a].max(c);
                        }
                    }
                }
            }
        }
        let count = (self.values.len() - start) / w;
        if count == 0 {
            return;
        }
        self.voxels += count as i64;
        let extent = self.extent.get_or_insert([low, high]);
        for a in 0..3 {
            extent[0][a] = extent[0][a].min(low[a]);
            extent[1][a] = extent[1][a].max(high[a]);
        }
        let at = place(corner, LEAF, 4);
        let own = &self.values[start..];
        if count == 512 && own[w..].iter().zip(own).all(|(a, b)| a.to_bits() == b.to_bits()) {
            self.values.truncate(start + w);
            node.tiles.push((at, start));
        } else {
            node.leaves.push((at, Leaf { mask, start, count }));
        }
    }
}

#[derive(Default)]
struct File {
    bytes: Vec<u8>,
}

impl File {
    fn u32(&mut self, n: u32) {
        self.bytes.extend(n.to_le_bytes());
    }

    fn i64(&mut self, n: i64) {
        self.bytes.extend(n.to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        self.u32(text.len() as u32);
        self.bytes.extend(text.as_bytes());
    }

    /// A piece of metadata.
    fn note(&mut self, name: &str, kind: &str, value: &[u8]) {
        self.text(name);
        self.text(kind);
        self.u32(value.len() as u32);
        self.bytes.extend(value);
    }

    fn grid(&mut self, volume: &Volume<'_>, tree: &Tree, zip: bool) {
        let zip = zip && volume.class != Class::Fog;
        self.text(volume.name);
        let kind = if tree.width == 3 { "vec3s" } else { "float" };
        self.text(&format!("Tree_{kind}_5_4_3{}", if tree.half { "_HalfFloat" } else { "" }));
        self.text(""); // Of which grid it is an instance.
        let offsets = self.bytes.len();
        (0..3).for_each(|_| self.i64(0));
        let begin = self.bytes.len();
        self.u32(ACTIVE_MASK | if zip { ZIP } else { 0 });
        self.metadata(volume, tree, zip);
        self.transform(volume);
        self.topology(tree, zip);
        let buffers = self.bytes.len();
        for (_, lower) in tree.nodes.iter().flat_map(|n| &n.children) {
            for (_, leaf) in &lower.leaves {
                leaf.mask.iter().for_each(|m| self.bytes.extend(m.to_le_bytes()));
                self.bytes.push(BACKGROUND_ELSEWHERE);
                self.numbers(&tree.values[leaf.start..leaf.start + tree.width * leaf.count], tree.half, zip);
            }
        }
        let ends = [begin, buffers, self.bytes.len()];
        for (k, end) in ends.into_iter().enumerate() {
            let at = offsets + 8 * k;
            self.bytes[at..at + 8].copy_from_slice(&(end as i64).to_le_bytes());
        }
    }

    fn metadata(&mut self, volume: &Volume<'_>, tree: &Tree, zip: bool) {
        let triple = |x: [i64; 3]| x.map(|c| (c as i32).to_le_bytes()).concat();
        let mut notes: Vec<(&str, &str, Vec<u8>)> = vec![("class", "string", volume.class.name().into())];
        if let Some([low, high]) = tree.extent {
            notes.push(("file_bbox_max", "vec3i", triple(high)));
            notes.push(("file_bbox_min", "vec3i", triple(low)));
        }
        let packing = if zip { "zip + active values" } else { "active values" };
        notes.push(("file_compression", "string", packing.into()));
        notes.push(("file_voxel_count", "int64", tree.voxels.to_le_bytes().into()));
        notes.push(("is_saved_as_half_float", "bool", vec![u8::from(tree.half)]));
        notes.push(("name", "string", volume.name.into()));
        notes.push(("unit", "string", volume.unit.into()));
        if tree.width == 3 {
            notes.push(("vector_type", "string", "contravariant relative".into()));
        }
        self.u32(notes.len() as u32);
        notes.iter().for_each(|(name, kind, value)| self.note(name, kind, value));
    }

    fn transform(&mut self, volume: &Volume<'_>) {
        self.text("UniformScaleTranslateMap");
        let s = volume.spacing;
        volume.origin.iter().for_each(|x| self.bytes.extend(x.to_le_bytes()));
        for x in [s, s, 1.0 / s, 1.0 / (s * s), 0.5 / s] {
            (0..3).for_each(|_| self.bytes.extend(x.to_le_bytes()));
        }
    }

    fn topology(&mut self, tree: &Tree, zip: bool) {
        self.u32(1);
        (0..tree.width).for_each(|_| self.bytes.extend(tree.background.to_le_bytes()));
        self.u32(0); // Tiles of the root.
        self.u32(tree.nodes.len() as u32);
        for node in &tree.nodes {
            node.corner.iter().for_each(|c| self.bytes.extend((*c as i32).to_le_bytes()));
            self.mask(1 << 15, node.children.iter().map(|(at, _)| *at));
            self.mask(1 << 15, std::iter::empty());
            self.bytes.push(BACKGROUND_ELSEWHERE);
            self.numbers(&[], tree.half, zip);
            for (_, lower) in &node.children {
                self.mask(1 << 12, lower.leaves.iter().map(|(at, _)| *at));
                self.mask(1 << 12, lower.tiles.iter().map(|(at, _)| *at));
                self.bytes.push(BACKGROUND_ELSEWHERE);
                let tiles: Vec<f32> =
                    lower.tiles.iter().flat_map(|(_, start)| &tree.values[*start..*start + tree.width]).copied().collect();
                self.numbers(&tiles, tree.half, zip);
                for (_, leaf) in &lower.leaves {
                    leaf.mask.iter().for_each(|m| self.bytes.extend(m.to_le_bytes()));
                }
            }
        }
    }

    fn mask(&mut self, bits: usize, on: impl Iterator<Item = usize>) {
        let start = self.bytes.len();
        self.bytes.resize(start + bits / 8, 0);
        on.for_each(|k| self.bytes[start + k / 8] |= 1 << (k % 8));
    }

    fn numbers(&mut self, values: &[f32], half: bool, zip: bool) {
        // OpenVDB leaves out the length of no halves, but not that of no floats.
        if !zip || half && values.is_empty() {
            self.raw(values, half);
            return;
        }
        let mut plain = Self::default();
        plain.raw(values, half);
        let packed = miniz_oxide::deflate::compress_to_vec_zlib(&plain.bytes, EFFORT);
        if packed.len() < plain.bytes.len() {
            self.i64(packed.len() as i64);
            self.bytes.extend(packed);
        } else {
            self.i64(-(plain.bytes.len() as i64));
            self.bytes.extend(plain.bytes);
        }
    }

    fn raw(&mut self, values: &[f32], half: bool) {
        if half {
            self.bytes.extend(values.iter().flat_map(|v| f16::from_f32(*v).to_le_bytes()));
        } else {
            self.bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        }
    }
}

/// An identifier of some bytes: FNV-1a from two starts, over words of eight, as a version 4 UUID.
fn uuid(bytes: &[u8]) -> String {
    let fnv = |start: u64| {
        bytes.chunks(8).fold(start, |h, chunk| {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            let h = (h ^ u64::from_le_bytes(word)).wrapping_mul(0x0100_0000_01b3);
            h ^ (h >> 29)
        })
    };
    let (a, b) = (fnv(0xcbf2_9ce4_8422_2325), fnv(0x8422_2325_cbf2_9ce4));
    let (a, b) = (a & !0xf000 | 0x4000, b & !(3 << 62) | 1 << 63);
    format!("{:08x}-{:04x}-{:04x}-{:04x}-{:012x}", a >> 32, a >> 16 & 0xffff, a & 0xffff, b >> 48, b & 0xffff_ffff_ffff)
}
