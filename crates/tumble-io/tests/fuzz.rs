//! No bytes make a reader panic, hang or return a mesh that is none.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

#[path = "../../tumble-interface/tests/cases/mod.rs"]
mod cases;
mod files;

use cases::{Outcome, cases, weighed};
use files::*;
use proptest::prelude::*;
use proptest::sample::Index;
use tumble_io::{Format, character, curves, fabric, mesh, repair};

/// A file of every kind, with the formats that may read it.
fn valid() -> Vec<(Vec<u8>, Format)> {
    vec![
        (obj(), Format::Obj),
        (
            b"v 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nv 0 0 0\nf 1 2 3 4 5 6\nf -1 -2 -4 \\\n-3 -5 # a comment \\\n".to_vec(),
            Format::Obj,
        ),
        (ply("ascii"), Format::Ply),
        (ply("binary_little_endian"), Format::Ply),
        (ply("binary_big_endian"), Format::Ply),
        (stl_ascii(&tetrahedron()), Format::Stl),
        (stl_binary(&tetrahedron(), b"solid"), Format::Stl),
        (glb_tetrahedron(r#"{"children": [1]}, {"mesh": 0, "translation": [1, 2, 3]}"#, "0"), Format::Glb),
        (ply_textured(&skirt(), ["s", "t"]), Format::Ply),
        (ply_wedges(&skirt()), Format::Ply),
        (glb_textured(&skirt()), Format::Glb),
        (arm(), Format::Glb),
        (tumble_io::obj(&skirt()).into_bytes(), Format::Obj),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2 \\\n3\nl 3/1 1\nl -1 -2 # a comment\nf 1 2 3\n".to_vec(), Format::Obj),
    ]
}

/// Bytes that reading a file of a length may take: all of it is kept in a few forms.
fn expected(length: usize) -> usize {
    (1 << 12) + 30 * length
}

/// Reads; whatever comes out keeps the promises of [`mesh`].
fn read(bytes: &[u8], format: Format) -> Outcome {
    let (result, taken) = weighed(|| mesh(bytes, format));
    // The parser of PLY makes room for 65,536 numbers of a list at most before it sees that the file is shorter.
    let room = if format == Format::Ply { 1 << 19 } else { 0 };
    let outcome = Outcome { read: result.is_ok(), taken, expected: room + expected(bytes.len()) };
    match result {
        Ok(mesh) => {
            assert!(!mesh.triangles.is_empty());
            assert!(mesh.vertices.iter().flatten().all(|x| x.is_finite()));
            assert!(mesh.triangles.iter().flatten().all(|i| (*i as usize) < mesh.vertices.len()));
            assert!(mesh.texture.is_empty() || mesh.texture.len() == mesh.triangles.len());
            assert!(mesh.texture.iter().flatten().flatten().flatten().all(|x| x.is_finite()));
            mesh.defects();
            repair(&mesh);
        }
        Err(message) => assert!(!message.is_empty() && !message.contains('\n') && message.chars().count() < 320, "{message}"),
    }
    all([outcome, read_curves(bytes, format)])
}

/// Reads curves; whatever comes out keeps the promises of [`curves`].
fn read_curves(bytes: &[u8], format: Format) -> Outcome {
    let (result, taken) = weighed(|| curves(bytes, format));
    let outcome = Outcome { read: result.is_ok(), taken, expected: expected(bytes.len()) };
    match result {
        Ok(curves) => {
            assert!(!curves.is_empty() && curves.iter().flatten().flatten().all(|x| x.is_finite()));
            assert!(curves.iter().all(|curve| curve.len() > 1 && curve.iter().any(|x| *x != curve[0])));
        }
        Err(message) => assert!(!message.is_empty() && !message.contains('\n') && message.chars().count() < 320, "{message}"),
    }
    outcome
}

/// Reads a figure; whatever comes out keeps the promises of [`character`].
fn read_character(bytes: &[u8]) -> Outcome {
    let (result, taken) = weighed(|| character(bytes));
    let outcome = Outcome { read: result.is_ok(), taken, expected: expected(bytes.len()) };
    match result {
        Ok(c) => {
            let (joints, binds) = (c.joints.len(), c.binds.len());
            assert!(!c.mesh.triangles.is_empty() && c.skin.len() == c.mesh.vertices.len());
            assert!(c.mesh.triangles.iter().flatten().all(|i| (*i as usize) < c.mesh.vertices.len()));
            assert!(c.joints.iter().enumerate().all(|(i, j)| j.parent.is_none_or(|p| (p as usize) < i)));
            assert!(c.binds.iter().all(|b| (b.joint as usize) < joints && b.inverse.iter().flatten().all(|x| x.is_finite())));
            for four in &c.skin {
                assert!(four.iter().all(|f| (f.bind as usize) < binds && f.weight >= 0.0));
                assert!((four.iter().map(|f| f.weight).sum::<f64>() - 1.0).abs() < 1e-12);
            }
            for track in c.clips.iter().flat_map(|c| &c.tracks) {
                assert!((track.joint as usize) < joints && !track.times.is_empty());
                assert!(track.times.windows(2).all(|t| t[0] < t[1]) && track.values.iter().flatten().all(|x| x.is_finite()));
                let each = if track.between == tumble_interface::character::Between::Cubic { 3 } else { 1 };
                assert_eq!(track.values.len(), each * track.times.len());
            }
        }
        Err(message) => assert!(!message.is_empty() && !message.contains('\n') && message.chars().count() < 320, "{message}"),
    }
    outcome
}

/// Reads the record of a fabric; whatever comes out keeps the promises of [`fabric`].
fn read_fabric(bytes: &[u8], json: bool) -> Outcome {
    let (result, taken) = weighed(|| fabric(bytes, json));
    let outcome = Outcome { read: result.is_ok(), taken, expected: expected(bytes.len()) };
    match result {
        Ok(f) => {
            assert!(f.density > 0.0 && f.density.is_finite());
            assert!(f.stretching.iter().flatten().chain(f.bending.iter().flatten()).all(|x| x.is_finite()));
            assert!(f.stretching.iter().all(|[c11, c12, c22, _]| *c11 > 0.0 && *c22 > 0.0 && c12.max(0.0).powi(2) < c11 * c22));
        }
        Err(message) => assert!(!message.is_empty() && !message.contains('\n') && message.chars().count() < 320, "{message}"),
    }
    outcome
}

/// Outcome of a case of several readings.
fn all(outcomes: impl IntoIterator<Item = Outcome>) -> Outcome {
    let worse = |a: Outcome, b: Outcome| {
        let read = a.read || b.read;
        Outcome { read, ..if a.taken * b.expected > b.taken * a.expected { a } else { b } }
    };
    outcomes.into_iter().reduce(worse).unwrap()
}

/// One change of a file.
#[derive(Debug, Clone)]
enum Change {
    Byte(Index, u8),
    Word(Index, u32),
    Remove(Index, usize),
    Repeat(Index, usize),
    Insert(Index, &'static str),
}

/// Tokens that parsers tend to trust: signs, ends of number ranges, keywords.
const TOKENS: [&str; 16] =
    ["-", "0", "99999999999999999999", "1e999", "nan", "\n", "\r", " ", "/", "\\\n", "\"", "[", "}", "null", "list", "\u{e9}"];

fn change() -> impl Strategy<Value = Change> {
    let index = any::<Index>;
    prop_oneof![
        (index(), any::<u8>()).prop_map(|(at, byte)| Change::Byte(at, byte)),
        (index(), prop_oneof![Just(0), Just(1), Just(u32::MAX), Just(i32::MAX as u32), Just(1 << 31), any::<u32>()])
            .prop_map(|(at, word)| Change::Word(at, word)),
        (index(), 1..40_usize).prop_map(|(at, n)| Change::Remove(at, n)),
        (index(), 1..40_usize).prop_map(|(at, n)| Change::Repeat(at, n)),
        (index(), prop::sample::select(&TOKENS[..])).prop_map(|(at, token)| Change::Insert(at, token)),
    ]
}

fn apply(bytes: &mut Vec<u8>, change: &Change) {
    if bytes.is_empty() {
        return;
    }
    let n = bytes.len();
    match change {
        Change::Byte(at, byte) => bytes[at.index(n)] = *byte,
        Change::Word(at, word) => {
            let at = at.index(n);
            let end = (at + 4).min(n);
            bytes[at..end].copy_from_slice(&word.to_le_bytes()[..end - at]);
        }
        Change::Remove(at, length) => {
            let at = at.index(n);
            bytes.drain(at..(at + length).min(n));
        }
        Change::Repeat(at, length) => {
            let at = at.index(n);
            let again = bytes[at..(at + length).min(n)].to_vec();
            bytes.splice(at..at, again);
        }
        Change::Insert(at, token) => {
            let at = at.index(n);
            bytes.splice(at..at, token.bytes());
        }
    }
}

#[test]
fn every_truncation_is_survived() {
    for (bytes, format) in valid() {
        assert!(mesh(&bytes, format).is_ok(), "{format:?}");
        for end in 0..bytes.len() {
            read(&bytes[..end], format);
        }
    }
}

#[test]
fn every_single_byte_at_either_end_of_its_range_is_survived() {
    for (bytes, format) in valid() {
        for at in 0..bytes.len() {
            for byte in [0, 0x7f, 0x80, 0xff, b'-', b'9', bytes[at] ^ 1] {
                let mut changed = bytes.clone();
                changed[at] = byte;
                read(&changed, format);
            }
        }
    }
}

#[test]
fn every_truncation_and_byte_of_a_figure_is_survived() {
    let bytes = arm();
    assert!(character(&bytes).is_ok());
    for end in 0..bytes.len() {
        read_character(&bytes[..end]);
    }
    for at in 0..bytes.len() {
        for byte in [0, 0x7f, 0x80, 0xff, b'9', bytes[at] ^ 1] {
            let mut changed = bytes.clone();
            changed[at] = byte;
            read_character(&changed);
        }
    }
}

#[test]
fn random_bytes_are_survived() {
    cases("meshes, random bytes", 4000, prop::collection::vec(any::<u8>(), 0..600), |bytes| {
        all(Format::ALL.map(|format| read(&bytes, format)))
    });
}

/// Past the first check, so that what follows sees the noise.
#[test]
fn random_bytes_after_a_true_beginning_are_survived() {
    let (files, noise) = (valid(), prop::collection::vec(any::<u8>(), 0..300));
    cases("meshes, a true beginning", 4000, (0..files.len(), any::<Index>(), noise), |(which, cut, noise)| {
        let (mut bytes, format) = files[which].clone();
        bytes.truncate(cut.index(bytes.len()));
        bytes.extend(noise);
        read(&bytes, format)
    });
}

#[test]
fn changed_files_are_survived() {
    let files = valid();
    cases("meshes, changed", 4000, (0..files.len(), prop::collection::vec(change(), 1..4)), |(which, changes)| {
        let (mut bytes, format) = files[which].clone();
        for change in &changes {
            apply(&mut bytes, change);
        }
        read(&bytes, format)
    });
}

/// The JSON of a GLB, with the chunk lengths made right again, so that it is reached.
#[test]
fn changed_json_is_survived() {
    cases("glTF, changed", 4000, prop::collection::vec(change(), 1..4), |changes| {
        let mut json = glb_json(r#"{"children": [1]}, {"mesh": 0, "scale": [1, 2, 3]}"#, "0").into_bytes();
        for change in &changes {
            apply(&mut json, change);
        }
        read(&glb(&String::from_utf8_lossy(&json), &glb_buffer()), Format::Glb)
    });
}

#[test]
fn changed_figures_are_survived() {
    cases("figures, changed", 4000, prop::collection::vec(change(), 1..4), |changes| {
        let (mut json, mut bytes) = (arm_json("").into_bytes(), arm());
        for change in &changes {
            apply(&mut json, change);
            apply(&mut bytes, change);
        }
        let whole = glb(&String::from_utf8_lossy(&json), &arm_buffer());
        all([read_character(&bytes), read_character(&json), read_character(&whole)])
    });
}

/// Any number in the JSON replaced: still well-formed, so counts, offsets and indices are believed as far as they can be.
#[test]
fn changed_numbers_are_survived() {
    let number = prop_oneof![0..100_u64, Just(u64::MAX), Just(u64::from(u32::MAX)), any::<u64>()];
    let changed = |json: &str, which: &Index, number: u64| {
        let text = json.as_bytes();
        let is_first = |i: &usize| text[*i].is_ascii_digit() && matches!(text[i - 1], b' ' | b'[' | b':');
        let digits: Vec<usize> = (1..json.len()).filter(is_first).collect();
        let at = digits[which.index(digits.len())];
        let end = at + json[at..].bytes().take_while(u8::is_ascii_digit).count();
        format!("{}{number}{}", &json[..at], &json[end..])
    };
    cases("glTF, other numbers", 4000, (any::<Index>(), number), |(which, number)| {
        let json = glb_json(r#"{"children": [1]}, {"mesh": 0}"#, "0");
        let figure = glb(&changed(&arm_json(""), &which, number), &arm_buffer());
        all([read(&glb(&changed(&json, &which, number), &glb_buffer()), Format::Glb), read_character(&figure)])
    });
}

#[test]
fn changed_fabrics_are_survived() {
    let toml = include_bytes!("../../../python/tumble/fabrics/denim.toml").to_vec();
    let row = |numbers: &str, n: usize| vec![format!("[{numbers}]"); n].join(",");
    let (stretching, bending) = (row("2, 0.5, 2.5, 1", 6), row("1e-5, 1e-5, 0, -1e-7, 1", 3));
    let json = format!(r#"{{"density": 0.2, "author": "somebody", "stretching": [{stretching}], "bending": [{bending}]}}"#);
    let files = [(toml, false), (json.into_bytes(), true)];
    assert!(files.iter().all(|(bytes, json)| read_fabric(bytes, *json).read));
    cases("fabrics, changed", 4000, (0..2_usize, prop::collection::vec(change(), 1..4)), |(which, changes)| {
        let (mut bytes, json) = files[which].clone();
        for change in &changes {
            apply(&mut bytes, change);
        }
        read_fabric(&bytes, json)
    });
}
