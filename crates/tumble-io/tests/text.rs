//! Text of files as programs write it: marks, line ends, comments, commas.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

mod files;

use files::*;
use tumble_io::{Format, fabric, mesh, shipped};

/// Text of each format; in OBJ some vertices come after their faces.
fn texts() -> Vec<(String, Format)> {
    let obj = "v 0 0 0\nv 2 0 0\nv 0 3 0\nf 1 3 2\nf 4 5 6 7\nv 5 0 1\nv 6 0 1\nv 6 1 1\nv 5 1 1\n";
    vec![
        (obj.to_owned(), Format::Obj),
        (String::from_utf8(ply("ascii")).unwrap(), Format::Ply),
        (String::from_utf8(ply_wedges(&skirt())).unwrap(), Format::Ply),
        (String::from_utf8(stl_ascii(&tetrahedron())).unwrap(), Format::Stl),
    ]
}

#[test]
fn lines_may_end_in_any_way() {
    for (text, format) in texts() {
        let right = mesh(text.as_bytes(), format).unwrap();
        for end in ["\r", "\r\n"] {
            let other = text.replace('\n', end);
            assert_eq!(mesh(other.as_bytes(), format).unwrap(), right, "{format:?} {end:?}");
            assert_eq!(mesh(other.trim_end().as_bytes(), format).unwrap(), right, "{format:?} {end:?}, the last one without");
        }
        // Edited on two machines.
        let mixed = text.replacen('\n', "\r\n", 3);
        assert_eq!(mesh(mixed.as_bytes(), format).unwrap(), right, "{format:?}");
    }
}

#[test]
fn binary_data_begins_behind_a_header_with_any_line_ends() {
    // The first coordinate begins with the byte of a line feed or of a carriage return.
    let low = |byte: u8| f32::from_le_bytes([byte, 0, 0x80, 0x3f]);
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    for byte in [b'\n', b'\r'] {
        let mut data: Vec<u8> = [low(byte), 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        data.push(3);
        data.extend([0_i32, 1, 2].iter().flat_map(|i| i.to_le_bytes()));
        for end in ["\n", "\r", "\r\n"] {
            let file = [header.replace('\n', end).as_bytes(), &data].concat();
            assert_eq!(mesh(&file, Format::Ply).unwrap().vertices[0], [f64::from(low(byte)), 0.0, 0.0], "{byte} {end:?}");
        }
    }
}

#[test]
fn byte_order_marks_are_no_text() {
    for (text, format) in texts() {
        let right = mesh(text.as_bytes(), format).unwrap();
        let wide = |order: fn(u16) -> [u8; 2]| format!("\u{feff}{text}").encode_utf16().flat_map(order).collect::<Vec<_>>();
        for marked in [format!("\u{feff}{text}").into_bytes(), wide(u16::to_le_bytes), wide(u16::to_be_bytes)] {
            assert_eq!(mesh(&marked, format).unwrap(), right, "{format:?}");
        }
    }
    let denim = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../python/tumble/fabrics/denim.toml")).unwrap();
    let right = shipped("denim").unwrap();
    assert_eq!(fabric(format!("\u{feff}{denim}").as_bytes(), false).unwrap(), right);
    assert_eq!(fabric(denim.replace('\n', "\r").as_bytes(), false).unwrap(), right);
    let json = r#"{"density": 0.4, "stretching": [[9, 1, 9, 3], [9, 1, 9, 3], [9, 1, 9, 3], [9, 1, 9, 3], [9, 1, 9, 3], [9, 1, 9, 3]],
                   "bending": [[1, 1, 1, 1, 1], [1, 1, 1, 1, 1], [1, 1, 1, 1, 1]]}"#;
    assert_eq!(fabric(format!("\u{feff}{json}").as_bytes(), true).unwrap().density, 0.4);
}

#[test]
fn comments_and_names_in_obj_end_with_their_line() {
    let right = mesh(b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n", Format::Obj).unwrap();
    for before in ["# in C:\\shop\\", "#\\", "  # x \\ ", "mtllib D:\\maps\\", "o a\\", "g b\\", "usemtl c\\", "v 0 0 0 # corner \\"] {
        let first = if before.starts_with('v') { "" } else { "v 0 0 0\n" };
        let file = format!("{before}\n{first}v 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
        assert_eq!(mesh(file.as_bytes(), Format::Obj).unwrap(), right, "{before}");
    }
    // Statements go on, with whatever stands behind the backslash.
    let file = "v 0 \\\n0 0\nv\\\n1 0 0\r\nv 1 1 \\ \n 0 # done \\\nv 0 1 0\nf 1 2 \\\r\n3 \\\n\\\n4";
    assert_eq!(mesh(file.as_bytes(), Format::Obj).unwrap(), right);
}

#[test]
fn commas_are_told_as_what_they_are() {
    let told = |text: String, format| mesh(text.as_bytes(), format).unwrap_err();
    let texts = texts();
    let commas = [
        told(texts[0].0.replace("v 2 0 0", "v 2,5 0 0"), Format::Obj),
        told(texts[0].0.replace("v 2 0 0", "v -2,5e-3 0 0"), Format::Obj),
        told(format!("{}vt 0,25 0,5\n", texts[0].0), Format::Obj),
        told(texts[1].0.replace("1 0 0 255", "1,000 0,0 0 255"), Format::Ply),
        told(texts[3].0.replace("vertex 1 0 0", "vertex 1,0 0 0"), Format::Stl),
    ];
    for (message, line) in commas.iter().zip([2, 2, 10, 13, 6]) {
        assert!(
            message.contains(&format!("line {line}: \"")) && message.contains("decimal comma") && message.contains("locale"),
            "{message}"
        );
        assert!(!message.contains("damaged") && message.chars().count() < 300, "{message}");
    }
    let parted = [
        told(texts[0].0.replace("v 2 0 0", "v 2.5, 0, 0"), Format::Obj),
        told(texts[0].0.replace("v 2 0 0", "v 1,234.5 0 0"), Format::Obj),
        told(texts[1].0.replace("1 0 0 255", "1.0, 0.0, 0.0, 255"), Format::Ply),
        told(texts[3].0.replace("vertex 1 0 0", "vertex 1,0,0"), Format::Stl),
    ];
    for message in parted {
        assert!(message.contains("comma that parts numbers or thousands") && !message.contains("locale"), "{message}");
    }
    assert!(told(texts[0].0.replace("v 2 0 0", "v 2,x 0 0"), Format::Obj).contains("\"2,x\" is not a number"));
}

#[test]
fn ply_may_have_blanks_where_it_likes() {
    let right = mesh(&ply("ascii"), Format::Ply).unwrap();
    let text = String::from_utf8(ply("ascii")).unwrap();
    let loose = text.replace(' ', "  \t ").replace("end_header\n", "end_header \n");
    assert_eq!(mesh(loose.as_bytes(), Format::Ply).unwrap(), right);
    let tailed = text.replace('\n', " \n");
    assert_eq!(mesh(tailed.as_bytes(), Format::Ply).unwrap(), right);
    let (head, rows) = text.split_at(text.find("end_header\n").unwrap() + 11);
    let spaced = format!("{head}\n{}\n\n", rows.replace('\n', "\n\n"));
    assert_eq!(mesh(spaced.as_bytes(), Format::Ply).unwrap(), right);
}
