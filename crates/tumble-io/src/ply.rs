//! Stanford PLY, by the crate `ply-rs-bw`. What it would believe unseen is checked first: the declared counts.

use crate::build::{DAMAGED, Weld};
use crate::polygon::Polygons;
use crate::text::{comma, lines_of, unmarked};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType};
use tumble_interface::Mesh;

pub fn read(bytes: &[u8]) -> Result<Mesh, String> {
    let bytes = unmarked(bytes);
    if !bytes.starts_with(b"ply") {
        return Err("the file does not start with \"ply\"; check the file extension".to_owned());
    }
    let end = header_length(&bytes).ok_or("the header has no end (a line \"end_header\"); the file is truncated, export it again")?;
    let (header, payload) = bytes.split_at(end);
    // The parser wants UTF-8, line feeds and single blanks; comments may be in any encoding.
    let header: String = lines_of(header).lines().map(|line| line.split_ascii_whitespace().collect::<Vec<_>>().join(" ") + "\n").collect();
    let lines = header.lines().count();
    let plain;
    let payload = if header.lines().any(|line| line.starts_with("format ascii ")) {
        let text = lines_of(payload);
        let is_loose = text.starts_with('\n') || text.contains("\n\n");
        plain = if is_loose { text.lines().filter(|line| !line.is_empty()).flat_map(|line| [line, "\n"]).collect() } else { text };
        let word = |line: &str| line.split_ascii_whitespace().find_map(|word| Some(format!("\"{word}\" {}", comma(word)?)));
        if let Some((n, told)) = (1 + lines..).zip(plain.lines()).find_map(|(n, line)| Some((n, word(line)?))) {
            return Err(format!("line {n}: {told}"));
        }
        plain.as_bytes()
    } else {
        payload
    };
    let mut reader = Reader::new(std::io::Read::chain(header.as_bytes(), payload));
    let header = Parser::<Skipped>::new().read_header(&mut reader).map_err(|e| format!("header: {e}"))?;

    let least: u128 = header.elements.values().map(|e| e.count as u128 * least_bytes(e, header.encoding) as u128).sum();
    // The last line of an ASCII file may lack its line break.
    if least > payload.len() as u128 + 1 {
        let counts: Vec<_> = header.elements.values().map(|e| format!("{} {}", e.count, e.name)).collect();
        return Err(format!(
            "the header declares {} elements, at least {least} bytes, but {} follow; the file is truncated or damaged, export it again",
            counts.join(" + "),
            payload.len()
        ));
    }

    let mut mesh = Mesh::default();
    let mut polygons: Vec<Polygon> = Vec::new();
    let mut texture = Vec::new();
    let cut = |e: ParseError| {
        let text = e.to_string();
        // The parser counts rows of a binary file as lines.
        let text = match header.encoding {
            Encoding::Ascii => &text,
            _ => text.split_once(": ").map_or(text.as_str(), |(_, text)| text),
        };
        format!("{text}; {DAMAGED}")
    };
    for element in header.elements.values() {
        match element.name.as_str() {
            "vertex" => {
                if let Some(axis) = ["x", "y", "z"].iter().find(|axis| !element.properties.contains_key(**axis)) {
                    return Err(format!("the vertices have no property \"{axis}\"; export x, y and z"));
                }
                let vertices = Parser::<Vertex>::new().read_payload_for_element(&mut reader, element, &header).map_err(cut)?;
                if PAIRS.iter().any(|pair| pair.iter().all(|name| element.properties.contains_key(*name))) {
                    texture = vertices.iter().map(|v| v.texture).collect();
                }
                mesh.vertices = vertices.into_iter().map(|v| v.position).collect();
            }
            "face" => {
                polygons = Parser::<Polygon>::new().read_payload_for_element(&mut reader, element, &header).map_err(cut)?;
            }
            _ => {
                Parser::<Skipped>::new().read_payload_for_element(&mut reader, element, &header).map_err(cut)?;
            }
        }
    }
    let mut triangles = Polygons::default();
    for (f, polygon) in polygons.iter().enumerate() {
        match &polygon.corners {
            None => return Err(format!("face {f} has no list \"vertex_indices\" of numbers 0, 1, 2, ...; {DAMAGED}")),
            Some(corners) if corners.len() < 3 => {
                return Err(format!("face {f} has {} vertices, at least 3 are needed; {DAMAGED}", corners.len()));
            }
            Some(corners) => {
                let own = |k: usize| Some([*polygon.texture.get(2 * k)?, *polygon.texture.get(2 * k + 1)?]);
                let of_vertex = |i: u32| texture.get(i as usize).copied();
                let at = |k: usize| own(k).or_else(|| of_vertex(corners[k]));
                triangles.add(&mut mesh, corners, at).map_err(|e| format!("face {f}: {e}"))?;
            }
        }
    }
    if !texture.is_empty() {
        weld(&mut mesh)?;
    }
    if mesh.triangles.is_empty() && header.elements.contains_key("tristrips") {
        return Err("the file has triangle strips, which are not supported; export it with faces".to_owned());
    }
    Ok(mesh)
}

/// Bytes up to and with the line `end_header`. Where lines end in a carriage return alone, a line feed after the last is data.
fn header_length(bytes: &[u8]) -> Option<usize> {
    let end = b"end_header";
    let starts = |at: &usize| matches!(bytes[at - 1], b'\n' | b'\r') && bytes[*at..].starts_with(end);
    let line = (1..bytes.len()).find(starts)?;
    let length = line + bytes[line..].iter().position(|b| matches!(b, b'\n' | b'\r'))?;
    let first = bytes.iter().position(|b| matches!(b, b'\n' | b'\r'))?;
    let is_pair = |at: usize| bytes[at..].starts_with(b"\r\n");
    let alone = bytes[first] == b'\r' && !is_pair(first);
    Some(length + if is_pair(length) && !alone { 2 } else { 1 })
}

/// Fewest bytes one row of an element can take; at least one, so that a count is bounded by the length of the file.
fn least_bytes(element: &ElementDef, encoding: Encoding) -> usize {
    let binary = element.properties.values().map(|p| match &p.data_type {
        PropertyType::Scalar(scalar) | PropertyType::List(scalar, _) => size(scalar),
    });
    match encoding {
        Encoding::Ascii => 2 * element.properties.len(), // a digit and what parts it from the next
        Encoding::BinaryBigEndian | Encoding::BinaryLittleEndian => binary.sum(),
    }
    .max(1)
}

fn size(scalar: &ScalarType) -> usize {
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// Names of texture coordinates of vertices.
const PAIRS: [[&str; 2]; 4] = [["s", "t"], ["u", "v"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];

/// Vertices with texture coordinates are split at seams: equal positions become one.
fn weld(mesh: &mut Mesh) -> Result<(), String> {
    let mut weld = Weld::default();
    let mut kept = Vec::new();
    let mut numbers = Vec::with_capacity(mesh.vertices.len());
    for x in &mesh.vertices {
        let number = weld.number(*x, kept.len())?;
        if number as usize == kept.len() {
            kept.push(*x);
        }
        numbers.push(number);
    }
    let n = numbers.len();
    for i in mesh.triangles.as_flattened_mut() {
        let new = numbers.get(*i as usize).copied();
        *i = new.ok_or_else(|| format!("a face uses vertex {i}, but there are {n} (counted from 0); {DAMAGED}"))?;
    }
    mesh.vertices = kept;
    mesh.renumbered = (0..).zip(&numbers).find(|(i, number)| i != *number).map(|(i, number)| [i, *number]);
    Ok(())
}

/// A row of `vertex`.
struct Vertex {
    position: [f64; 3],
    texture: [f64; 2],
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self { position: [f64::NAN; 3], texture: [f64::NAN; 2] }
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let place = match name {
            "x" => &mut self.position[0],
            "y" => &mut self.position[1],
            "z" => &mut self.position[2],
            _ if PAIRS.iter().any(|pair| pair[0] == name) => &mut self.texture[0],
            _ if PAIRS.iter().any(|pair| pair[1] == name) => &mut self.texture[1],
            _ => return PropertyAccessResult::Ignored,
        };
        *place = match value {
            Property::Char(x) => x.into(),
            Property::UChar(x) => x.into(),
            Property::Short(x) => x.into(),
            Property::UShort(x) => x.into(),
            Property::Int(x) => x.into(),
            Property::UInt(x) => x.into(),
            Property::Float(x) => x.into(),
            Property::Double(x) => x,
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// A row of `face`.
struct Polygon {
    /// `None` if there is no such property, if it is no list of integers or if one is negative.
    corners: Option<Vec<u32>>,
    /// Texture coordinates of its corners, two by two, as far as it has some of its own.
    texture: Vec<f64>,
}

impl PropertyAccess for Polygon {
    fn new() -> Self {
        Self { corners: None, texture: Vec::new() }
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        match (name, value) {
            ("vertex_indices" | "vertex_index", value) => self.corners = value.to_u32_list(),
            ("texcoord" | "texcoords", Property::ListFloat(all)) => self.texture = all.into_iter().map(f64::from).collect(),
            ("texcoord" | "texcoords", Property::ListDouble(all)) => self.texture = all,
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// A row of any other element.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}
