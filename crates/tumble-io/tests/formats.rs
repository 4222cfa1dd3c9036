//! Results of each format, and messages of each error.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

mod files;

use files::*;
use tumble_interface::Mesh;
use tumble_interface::mesh::Defects;
use tumble_io::{Format, mesh};

fn text(text: &str, format: Format) -> Result<Mesh, String> {
    mesh(text.as_bytes(), format)
}

/// The file is rejected with one short line that contains all of `parts`.
#[track_caller]
fn rejects(bytes: &[u8], format: Format, parts: &[&str]) {
    let message = mesh(bytes, format).err().unwrap_or_default();
    assert!(message.starts_with(&format!("{}: ", format.name())), "{message}");
    assert!(!message.contains('\n') && message.chars().count() < 320, "{message}");
    for part in parts {
        assert!(message.contains(part), "no \"{part}\" in: {message}");
    }
}

#[test]
fn the_extension_names_the_format() {
    assert_eq!(Format::from_path("a/b.c/bunny.ply"), Some(Format::Ply));
    assert_eq!(Format::from_path("CUBE.STL"), Some(Format::Stl));
    assert_eq!(Format::from_path("x.Obj"), Some(Format::Obj));
    assert_eq!(Format::from_path("x.glb"), Some(Format::Glb));
    for path in ["", "obj", "x.gltf", "x.obj/y", "x.obj.gz", "x."] {
        assert_eq!(Format::from_path(path), None, "{path}");
    }
}

#[test]
fn every_format_rejects_the_empty_the_foreign_and_the_cut_off() {
    let files = [
        (obj(), Format::Obj),
        (ply("ascii"), Format::Ply),
        (ply("binary_little_endian"), Format::Ply),
        (stl_ascii(&cube()), Format::Stl),
        (stl_binary(&cube(), b""), Format::Stl),
        (glb_tetrahedron(r#"{"mesh": 0}"#, "0"), Format::Glb),
    ];
    for (bytes, format) in &files {
        rejects(b"", *format, &["empty", "export"]);
        rejects(&[0x89, b'P', b'N', b'G', 0, 1, 2, 3], *format, &[]);
        rejects(b"<html><body>Not found</body></html>", *format, &[]);
        // An OBJ says nowhere how long it is; here the cut leaves half a face.
        let end = bytes.len() - if *format == Format::Obj { 5 } else { 20 };
        rejects(&bytes[..end], *format, &["export it again"]);
        for (other, foreign) in &files {
            if foreign != format {
                rejects(other, *format, &[]);
            }
        }
    }
}

// ---- Texture

#[test]
fn a_garment_is_the_same_from_every_format() {
    let skirt = skirt();
    // Seven columns of texture on six of vertices.
    assert_eq!((skirt.vertices.len(), split(&skirt).0.len()), (12, 14));
    let files = [
        (tumble_io::obj(&skirt).into_bytes(), Format::Obj),
        (ply_textured(&skirt, ["s", "t"]), Format::Ply),
        (ply_textured(&skirt, ["u", "v"]), Format::Ply),
        (ply_textured(&skirt, ["texture_u", "texture_v"]), Format::Ply),
        (ply_wedges(&skirt), Format::Ply),
        (glb_textured(&skirt), Format::Glb),
    ];
    for (i, (bytes, format)) in files.iter().enumerate() {
        let found = mesh(bytes, *format).unwrap();
        // Of the seam of seven columns on six the second vertex is the first.
        assert_eq!(found.renumbered, [None, Some([1, 0])][usize::from((1..4).contains(&i))], "{i}");
        assert_eq!(Mesh { renumbered: None, ..found }, skirt, "{i}");
    }
    // STL has no texture.
    assert!(mesh(&stl_ascii(&skirt), Format::Stl).unwrap().texture.is_empty());
    assert!(mesh(&obj(), Format::Obj).unwrap().texture.is_empty());
}

#[test]
fn a_mirrored_node_mirrors_its_triangles_with_their_texture() {
    let (whole, turned) = (skirt(), mesh(&glb_placed(&skirt(), r#""scale": [1, 1, -1], "#), Format::Glb).unwrap());
    for t in 0..whole.triangles.len() {
        let ([a, b, c], texture) = (whole.triangles[t], whole.texture[t].unwrap());
        assert_eq!((turned.triangles[t], turned.texture[t]), ([a, c, b], Some([texture[0], texture[2], texture[1]])));
    }
}

#[test]
fn what_is_wrong_with_texture_only_leaves_it_out() {
    let three = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0 0.5\nvt 1 0\nvt 0 1\nvt x 1\nvt 1\n";
    let texture = |faces: &str| text(&format!("{three}{faces}"), Format::Obj).unwrap().texture;
    let whole = Some([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
    assert_eq!(texture("f 1/1 2/2 3/3\n"), [whole]);
    assert_eq!(texture("f 1/-5 2/-4/9 3/-3/\nf 4 3 2\n"), [whole, None]);
    // Coordinates may come after the faces.
    assert_eq!(texture("f 1/6 2/7 3/8\nvt 0 0\nvt 1 0\nvt 0 1\n"), [whole]);
    // The fan of a polygon.
    assert_eq!(texture("f 1/1 2/2 4/3 3/2\n"), [whole, Some([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]])]);
    for odd in ["f 1/0 2/2 3/3\n", "f 1/1 2/2 3/99\n", "f 1/4 2/2 3/3\n", "f 1/5 2/2 3/3\n", "f 1/1 2/a 3/3\n", "f 1//1 2//2 3//3\n"] {
        assert_eq!(texture(odd), [], "{odd}");
    }
    // Of a polygon the triangles are left that have some.
    assert_eq!(texture("f 1/1 2/2 4/3 3\n"), [whole, None]);
}

// ---- OBJ

#[test]
fn obj_quads_become_fans_in_file_order() {
    assert_eq!(mesh(&obj(), Format::Obj).unwrap(), cube());
}

#[test]
fn obj_keeps_positions_whole_across_seams_groups_and_materials() {
    let file = "mtllib none.mtl\nv 0 0 0 1.0\nv 1 0 0 0.5 0.5 0.5\nv 0 2 0\nv 0 0 3\nvt 0 0\nvt 1 0\nvn 0 0 1\nvn 1 0 0\n\
                o a\nf 1/1/1 3/2/1 2/1/2\ng b\nusemtl red\nf -4//1 -3//2 -1//1 # negative counts back\n\
                s off\nf 2/1 3/2 \\\n4/99999999999\nl 1 2\np 3\nf 1 4 3\n";
    // One face has a texture at all of its corners.
    let whole = Mesh { texture: vec![Some([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]]), None, None, None], ..tetrahedron() };
    assert_eq!(text(file, Format::Obj).unwrap(), whole);
    let windows = file.replace('\n', "\r\n");
    assert_eq!(text(&windows, Format::Obj).unwrap(), whole);
}

#[test]
fn obj_reads_double_precision_and_latin_1_names() {
    let mut bytes = b"o caf\xe9\nv 0.1 1e-3 -.5\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_vec();
    assert_eq!(mesh(&bytes, Format::Obj).unwrap().vertices[0], [0.1, 0.001, -0.5]);
    bytes.truncate(bytes.len() - 1); // no line break at the end
    assert_eq!(mesh(&bytes, Format::Obj).unwrap().triangles, [[0, 1, 2]]);
}

#[test]
fn unused_vertices_go_and_the_others_keep_their_order() {
    let file = "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 8 8 8\nv 0 2 0\nf 5 2 3\n";
    let Mesh { vertices, triangles, renumbered, .. } = text(file, Format::Obj).unwrap();
    assert_eq!((vertices, renumbered), (vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]], Some([1, 0])));
    // What moves none of the others is no news; nor is what moves none that is used.
    let file = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 9 9 9\nv 8 8 8\nf 1 2 3\n";
    let found = text(file, Format::Obj).unwrap();
    assert_eq!((found.unused, found.renumbered), (2, None));
    let seam = "ply\nformat ascii 1.0\nelement vertex 7\nproperty float x\nproperty float y\nproperty float z\nproperty float s\n\
                property float t\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n";
    let rows = ["9 9 9 0 0", "0 0 0 0 0", "1 0 0 1 0", "0 1 0 0 1", "1 0 0 0 0", "0 1 0 1 0", "1 1 0 1 1"];
    let faces = "\n3 1 2 3\n3 4 6 5\n";
    assert_eq!(text(&format!("{seam}{}{faces}", rows.join("\n")), Format::Ply).unwrap().renumbered, Some([1, 0]));
    let first = format!("{seam}{}{}", [&rows[1..], &rows[..1]].concat().join("\n"), "\n3 0 1 2\n3 3 5 4\n");
    let found = text(&first, Format::Ply).unwrap();
    assert_eq!((found.renumbered, found.unused, found.triangles), (Some([3, 1]), 1, vec![[0, 1, 2], [1, 3, 2]]));
    assert_eq!(triangles, [[2, 0, 1]]);
}

#[test]
fn obj_faults_name_the_line() {
    let three = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let faults: [(&str, &[&str]); 11] = [
        ("f 1 2 4\n", &["line 4", "vertex 4", "has 3"]),
        ("f 1 2 0\n", &["line 4", "\"0\""]),
        ("f 1 2 -4\n", &["line 4", "\"-4\""]),
        ("f 1 2 99999999999999999999\n", &["line 4", "\"99999999999999999999\""]),
        ("f 1 2 -9223372036854775808\n", &["line 4"]),
        ("f 1 2 x\n", &["line 4", "\"x\""]),
        ("f 1 2\n", &["line 4", "needs 3 vertices", "has 2"]),
        ("v 1 2\n", &["line 4", "3 coordinates"]),
        ("v 1 2 z\n", &["line 4", "\"z\"", "not a number"]),
        ("v 1 nan 2\nf 1 2 3\n", &["vertex 3", "not finite"]),
        ("v 1 1e999 2\nf 1 2 3\n", &["vertex 3", "not finite"]),
    ];
    for (fault, parts) in faults {
        rejects(format!("{three}{fault}").as_bytes(), Format::Obj, parts);
    }
    rejects(three.as_bytes(), Format::Obj, &["no triangles", "3 vertices"]);
    rejects(b"hello\n", Format::Obj, &["is this an OBJ file?"]);
}

// ---- PLY

#[test]
fn ply_is_read_in_its_three_encodings() {
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        assert_eq!(mesh(&ply(format), Format::Ply).unwrap(), cube(), "{format}");
    }
    let windows = String::from_utf8(ply("ascii")).unwrap().replace('\n', "\r\n");
    assert_eq!(text(&windows, Format::Ply).unwrap(), cube());
}

#[test]
fn ply_skips_other_elements_and_properties() {
    let mut bytes = b"ply\nformat ascii 1.0\ncomment caf\xe9\nobj_info x\nelement camera 1\nproperty float fov\nelement vertex 3\n\
        property uchar red\nproperty double z\nproperty double y\nproperty short x\nelement face 1\nproperty list uint8 int32 other\n\
        property list uint8 uint32 vertex_index\nproperty float quality\nend_header\n"
        .to_vec();
    bytes.extend(b"90\n255 0.1 0 0\n0 0.1 0 1\n0 0.1 2 0\n2 7 7 3 0 1 2 0.5\n");
    let Mesh { vertices, triangles, .. } = mesh(&bytes, Format::Ply).unwrap();
    assert_eq!(vertices, [[0.0, 0.0, 0.1], [1.0, 0.0, 0.1], [0.0, 2.0, 0.1]]);
    assert_eq!(triangles, [[0, 1, 2]]);
}

#[test]
fn ply_faults_name_the_place() {
    let ascii = String::from_utf8(ply("ascii")).unwrap();
    let replaced = |from: &str, to: &str| {
        assert!(ascii.contains(from), "{from}");
        ascii.replacen(from, to, 1)
    };
    let faults: [(String, &[&str]); 12] = [
        (replaced("4 0 3 2 1\n", "4 0 3 2 8\n"), &["triangle 1", "vertex 8", "there are 8"]),
        (replaced("4 0 3 2 1\n", "4 0 3 2 -1\n"), &["face 0", "vertex_indices"]),
        (replaced("4 4 5 6 7\n", "2 4 5\n"), &["face 1", "2 vertices"]),
        (replaced("4 4 5 6 7\n", "4 4 5\n"), &["element line", "4 4 5"]),
        (replaced("1 0 0 255\n", "1 nan 0 255\n"), &["Line 13", "1 nan 0 255"]),
        (replaced("1 0 0 255\n", "1 1e99 0 255\n"), &["vertex 1", "not finite"]),
        (replaced("property float z\n", "property float w\n"), &["no property \"z\""]),
        (replaced("int vertex_indices", "int corners"), &["face 0", "vertex_indices"]),
        (replaced("int vertex_indices", "float vertex_indices"), &["face 0"]),
        (replaced("element face 6", "element face 0"), &["no triangles", "8 vertices"]),
        (replaced("end_header", "end"), &["end_header", "truncated"]),
        (replaced("format ascii", "format utf8"), &["header", "Line 2"]),
    ];
    for (file, parts) in &faults {
        rejects(file.as_bytes(), Format::Ply, parts);
    }
    let binary = ply("binary_little_endian");
    let mut fault = binary.clone();
    let at = binary.len() - 6 * 17 - 8 * 13; // x of vertex 0
    fault[at + 13 + 4..][..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    rejects(&fault, Format::Ply, &["vertex 1", "inf", "not finite"]);
    rejects(&binary[..binary.len() - 1], Format::Ply, &["PLY: Unexpected end", "'face' (expected 6, got 5)"]);
    let strips = ascii.replace("element face 6", "element tristrips 6");
    rejects(strips.as_bytes(), Format::Ply, &["strips"]);
}

#[test]
fn ply_counts_are_believed_no_further_than_the_file_is_long() {
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for count in ["1000000000000", "18446744073709551615"] {
            for element in ["vertex 8", "face 6"] {
                let mut bytes = ply(format);
                let name = element.split(' ').next().unwrap();
                let at = bytes.windows(element.len()).position(|w| w == element.as_bytes()).unwrap();
                bytes.splice(at..at + element.len(), format!("{name} {count}").into_bytes());
                rejects(&bytes, Format::Ply, &["declares", count, "truncated"]);
            }
            let empty = format!("ply\nformat {format} 1.0\nelement nothing {count}\nend_header\n");
            rejects(empty.as_bytes(), Format::Ply, &["declares", count]);
        }
        rejects(format!("ply\nformat {format} 1.0\nelement face 99999999999999999999\nend_header\n").as_bytes(), Format::Ply, &["header"]);
    }
    let list = "ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list uint int vertex_indices\nend_header\n";
    rejects(&[list.as_bytes(), &u32::MAX.to_le_bytes()].concat(), Format::Ply, &["nexpected end of file"]);
}

// ---- STL

#[test]
fn stl_vertices_are_welded() {
    // Numbered by first use.
    let first = Mesh {
        vertices: [0, 2, 1, 3].map(|i| tetrahedron().vertices[i]).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [2, 1, 3], [0, 3, 1]],
        ..Mesh::default()
    };
    for bytes in [stl_ascii(&tetrahedron()), stl_binary(&tetrahedron(), b"")] {
        let found = mesh(&bytes, Format::Stl).unwrap();
        assert_eq!(found, first);
        assert_eq!(found.defects(), Defects::default());
    }
    for bytes in [stl_ascii(&cube()), stl_binary(&cube(), b"")] {
        let found = mesh(&bytes, Format::Stl).unwrap();
        assert_eq!((found.vertices.len(), found.triangles.len(), found.defects()), (8, 12, Defects::default()));
        assert!((volume(&found) - 1.0).abs() < 1e-15);
    }
}

#[test]
fn stl_welds_minus_zero_with_zero_and_nothing_else() {
    let mut minus = tetrahedron();
    minus.vertices.push([-0.0, 0.0, -0.0]);
    minus.triangles[0][0] = 4;
    minus.triangles[3][0] = 4;
    for bytes in [stl_ascii(&minus), stl_binary(&minus, b"")] {
        let found = mesh(&bytes, Format::Stl).unwrap();
        assert_eq!((found.vertices.len(), found.defects()), (4, Defects::default()));
    }
    minus.vertices[4] = [1e-30, 0.0, 0.0];
    for bytes in [stl_ascii(&minus), stl_binary(&minus, b"")] {
        assert_eq!(mesh(&bytes, Format::Stl).unwrap().vertices.len(), 5);
    }
}

#[test]
fn stl_binary_may_say_solid_and_have_bytes_to_spare() {
    let plain = mesh(&stl_binary(&cube(), b""), Format::Stl).unwrap();
    for comment in [&b"solid made by CAD\n"[..], b"SOLID facet normal vertex"] {
        let mut bytes = stl_binary(&cube(), comment);
        assert_eq!(mesh(&bytes, Format::Stl).unwrap(), plain);
        bytes.extend(b"a trailer");
        assert_eq!(mesh(&bytes, Format::Stl).unwrap(), plain);
    }
}

#[test]
fn stl_ascii_may_have_several_solids_no_name_and_capitals() {
    let one = String::from_utf8(stl_ascii(&tetrahedron())).unwrap();
    let closed = text(&one, Format::Stl).unwrap();
    let bare = one.replace("solid thing", "solid").to_uppercase().replace('\n', "\r\n");
    assert_eq!(text(&bare, Format::Stl).unwrap(), closed);
    let other = one.replace("vertex 0 0 0", "vertex 0 0 -1").replace("solid thing", "solid vertex");
    let both = text(&format!("{one}\n{other}"), Format::Stl).unwrap();
    assert_eq!((both.vertices.len(), both.triangles.len()), (5, 8));
}

#[test]
fn stl_faults_name_the_place() {
    let ascii = String::from_utf8(stl_ascii(&tetrahedron())).unwrap();
    let faults: [(&str, &str, &[&str]); 5] = [
        ("vertex 1 0 0", "vertex 1 0", &["line 6", "3 coordinates"]),
        ("vertex 1 0 0", "vertex 1 0 zero", &["line 6", "\"zero\""]),
        ("vertex 1 0 0", "vertex 1 0 inf", &["vertex 2", "not finite"]),
        ("      vertex 1 0 0\n", "", &["line 6", "2 vertices"]),
        ("endsolid", "", &["endsolid", "truncated"]),
    ];
    for (from, to, parts) in faults {
        let file = ascii.replacen(from, to, 1);
        assert_ne!(file, ascii);
        rejects(file.as_bytes(), Format::Stl, parts);
    }
    rejects(b"solid nothing\nendsolid nothing\n", Format::Stl, &["no triangles"]);
    rejects(&stl_binary(&Mesh::default(), b""), Format::Stl, &["no triangles"]);

    let mut binary = stl_binary(&tetrahedron(), b"");
    binary[84 + 12 + 12..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    rejects(&binary, Format::Stl, &["vertex 1", "NaN", "not finite"]);
    binary[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    rejects(&binary, Format::Stl, &["declares 4294967295 triangles", "truncated"]);
    rejects(&[0; 50], Format::Stl, &["shorter than an STL header"]);
}

// ---- GLB

/// The mesh in the axes of the file, y up.
fn written(bytes: &[u8]) -> Mesh {
    let found = mesh(bytes, Format::Glb).unwrap();
    Mesh { vertices: found.vertices.iter().map(|[x, y, z]| [*x, *z, -y]).collect(), ..found }
}

#[test]
fn glb_stands_with_its_y_axis_up() {
    let found = mesh(&glb_tetrahedron(r#"{"mesh": 0}"#, "0"), Format::Glb).unwrap();
    let turned = tetrahedron().vertices.iter().map(|[x, y, z]| [*x, 0.0 - z, *y]).collect();
    assert_eq!(found, Mesh { vertices: turned, ..tetrahedron() });
    assert_eq!((volume(&found), found.bounds().unwrap().1[2]), (volume(&tetrahedron()), 2.0));
    assert!(found.vertices.iter().flatten().all(|x| *x != 0.0 || x.is_sign_positive()));
}

#[test]
fn glb_nodes_translate_scale_and_turn() {
    let at = |nodes: &str, scene: &str| written(&glb_tetrahedron(nodes, scene));
    let map = |f: fn([f64; 3]) -> [f64; 3]| tetrahedron().vertices.into_iter().map(f).collect::<Vec<_>>();

    let moved = at(r#"{"mesh": 0, "translation": [10, 20, 30], "scale": [2, 3, 4]}"#, "0");
    assert_eq!(moved.vertices, map(|[x, y, z]| [2.0 * x + 10.0, 3.0 * y + 20.0, 4.0 * z + 30.0]));
    assert_eq!(moved.triangles, tetrahedron().triangles);

    // The parent's transform comes after the child's.
    let nested = at(r#"{"children": [1], "scale": [2, 2, 2]}, {"mesh": 0, "translation": [10, 0, 0]}"#, "0");
    assert_eq!(nested.vertices, map(|[x, y, z]| [2.0 * (x + 10.0), 2.0 * y, 2.0 * z]));

    // A quarter turn about z takes x to y; 0.70710677 is sqrt(1/2) in single precision.
    let turned = at(r#"{"mesh": 0, "rotation": [0, 0, 0.70710677, 0.70710677], "scale": [2, 1, 1]}"#, "0");
    for (found, right) in turned.vertices.iter().flatten().zip(map(|[x, y, z]| [-y, 2.0 * x, z]).iter().flatten()) {
        assert!((found - right).abs() < 1e-6, "{found} {right}"); // measured 1e-7: single precision
    }
    let matrix = at(r#"{"mesh": 0, "matrix": [0, 2, 0, 0,  -1, 0, 0, 0,  0, 0, 1, 0,  5, 6, 7, 1]}"#, "0");
    assert_eq!(matrix.vertices, map(|[x, y, z]| [-y + 5.0, 2.0 * x + 6.0, z + 7.0]));
}

#[test]
fn glb_rotations_have_the_length_of_one_whatever_is_written() {
    let at = |rotation: &str| written(&glb_tetrahedron(&format!(r#"{{"mesh": 0, "rotation": {rotation}}}"#), "0"));
    // A quarter turn about x, at length 3, 0.01 and with four digits.
    for rotation in ["[2.1213203, 0, 0, 2.1213203]", "[-0.0070710677, 0, 0, -0.0070710677]", "[0.7071, 0, 0, 0.7071]"] {
        let found = at(rotation);
        for (found, right) in found.vertices.iter().flatten().zip(tetrahedron().vertices.iter().flat_map(|[x, y, z]| [*x, -z, *y])) {
            assert!((found - right).abs() < 1e-6, "{rotation}: {found} {right}"); // measured 2e-7: single precision
        }
        assert!((volume(&found) - 1.0).abs() < 1e-6);
    }
    rejects(&glb_tetrahedron(r#"{"mesh": 0, "rotation": [0, 0, 0, 0]}"#, "0"), Format::Glb, &["node 0", "rotation"]);
    let nested = r#"{"children": [1], "rotation": [0, 0, 0, 0]}, {"mesh": 0}"#;
    rejects(&glb_tetrahedron(nested, "0"), Format::Glb, &["node 0", "rotation"]);
}

#[test]
fn glb_extensions_that_move_what_is_shown_are_refused_where_they_are_used() {
    for name in ["EXT_mesh_gpu_instancing", "KHR_node_visibility", "CESIUM_RTC"] {
        for list in ["extensionsUsed", "extensionsRequired"] {
            let json = glb_json(r#"{"mesh": 0}"#, "0").replacen('{', &format!(r#"{{"{list}": ["KHR_materials_unlit", "{name}"], "#), 1);
            rejects(&glb(&json, &glb_buffer()), Format::Glb, &[name, "not supported", "export"]);
        }
    }
    let json = glb_json(r#"{"mesh": 0}"#, "0").replacen('{', r#"{"extensionsUsed": ["KHR_texture_transform"], "#, 1);
    assert_eq!(written(&glb(&json, &glb_buffer())), tetrahedron());
}

#[test]
fn glb_skins_stand_where_their_bones_do() {
    // The node of the mesh is moved by 9, and so would be its parent.
    let at = |json: String| written(&glb(&json, &arm_buffer()));
    let bound = at(arm_json(""));
    let right = tumble_io::character(&arm()).unwrap().mesh;
    assert_eq!(bound.vertices, right.vertices);
    assert_eq!(bound.triangles, right.triangles);
    let scaled = arm_json("").replace(r#""skin": 0, "translation": [9, 9, 9]"#, r#""skin": 0, "scale": [5, -5, 5]"#);
    assert_eq!(at(scaled), bound);
    // What moves the bones moves the skin: their parent, here mirrored and half as large, ...
    let small = at(arm_json("").replace(r#""name": "figure""#, r#""name": "figure", "scale": [-0.5, 0.5, 0.5], "translation": [1, 0, 0]"#));
    assert_eq!(small.vertices, bound.vertices.iter().map(|[x, y, z]| [1.0 - 0.5 * x, 0.5 * y, 0.5 * z]).collect::<Vec<_>>());
    assert!((volume(&small) - volume(&bound) / 8.0).abs() < 1e-9, "{}", volume(&small));
    // ... or the pose they were left in: the elbow one further out, its ring half of that.
    let posed = at(arm_json("").replace(r#""translation": [0, 0, 1]"#, r#""translation": [1, 0, 1]"#));
    for (i, (found, rest)) in posed.vertices.iter().zip(&bound.vertices).enumerate() {
        assert_eq!(*found, [rest[0] + [0.0, 0.5, 1.0][i / 3], rest[1], rest[2]]);
    }
    let damaged = [
        (r#""joints": [0, 1]"#, r#""joints": [0]"#, "joint 1 of 1"),
        (r#""joints": [0, 1]"#, r#""joints": [0, 7]"#, "node 7"),
        (r#", "WEIGHTS_0": 3"#, "", "WEIGHTS_0"),
        (r#""skin": 0"#, r#""skin": 3"#, "skin 3"),
    ];
    for (from, to, part) in damaged {
        rejects(&glb(&arm_json("").replacen(from, to, 1), &arm_buffer()), Format::Glb, &[part]);
    }
}

#[test]
fn glb_mirrored_meshes_stay_right_side_out() {
    let mirrored = mesh(&glb_tetrahedron(r#"{"mesh": 0, "scale": [1, 1, -2]}"#, "0"), Format::Glb).unwrap();
    assert!((volume(&mirrored) - 2.0).abs() < 1e-15, "{}", volume(&mirrored)); // 1 · 2 · 3 / 6, doubled
    assert_eq!(mirrored.defects(), Defects::default());
}

#[test]
fn glb_instances_are_merged_in_order_and_kept_apart() {
    let nodes = r#"{"mesh": 0}, {"mesh": 0, "translation": [0, 0, 9]}, {"mesh": 0, "translation": [0, 0, 99]}"#;
    let two = written(&glb_tetrahedron(nodes, "1, 0")); // node 2 is in no scene
    assert_eq!((two.vertices.len(), two.triangles.len()), (8, 8));
    assert_eq!((two.vertices[0], two.vertices[4]), ([0.0, 0.0, 9.0], [0.0; 3]));
    let same = mesh(&glb_tetrahedron(r#"{"mesh": 0}, {"mesh": 0}"#, "0, 1"), Format::Glb).unwrap();
    assert_eq!((same.vertices.len(), same.defects()), (8, Defects::default()));
    let without_scene = glb_json(nodes, "0").replace(r#""scene": 0, "scenes": [{"nodes": [0]}],"#, "");
    assert_eq!(mesh(&glb(&without_scene, &glb_buffer()), Format::Glb).unwrap().triangles.len(), 12);
}

#[test]
fn glb_seams_are_welded_within_a_mesh() {
    // The cube as exporters write it: four vertices for each face, here interleaved with a normal, in two primitives.
    let mut buffer = Vec::new();
    for x in CUBE_FACES.iter().flatten().map(|i| CUBE[*i as usize]) {
        buffer.extend(x.iter().chain(&[0.0, 0.0, 1.0]).flat_map(|x| (*x as f32).to_le_bytes()));
    }
    buffer.extend((0_u8..6).flat_map(|f| [0, 1, 2, 0, 2, 3].map(|k| 4 * f + k)));
    let json = r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "extensionsRequired": ["KHR_materials_unlit"],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2},
                                   {"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 3, "mode": 4},
                                   {"attributes": {"POSITION": 0}, "mode": 0}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 24, "type": "VEC3"},
                      {"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": 24, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5121, "count": 18, "type": "SCALAR"},
                      {"bufferView": 1, "byteOffset": 18, "componentType": 5121, "count": 18, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": 576, "byteStride": 24}, {"buffer": 0, "byteOffset": 576, "byteLength": 36}],
        "buffers": [{"byteLength": 612}]}"#;
    let found = mesh(&glb(json, &buffer), Format::Glb).unwrap();
    assert_eq!((found.vertices.len(), found.triangles.len(), found.defects()), (8, 12, Defects::default()));
    assert!((volume(&found) - 1.0).abs() < 1e-15);
}

#[test]
fn glb_strips_and_fans_are_triangles_too() {
    // A square, corners (0, 0), (1, 0), (0, 1), (1, 1) as a strip; 0 1 3 2 as a fan.
    let positions = |corners: [[f32; 2]; 4]| corners.iter().flat_map(|[x, y]| [*x, *y, 0.0]).flat_map(f32::to_le_bytes).collect::<Vec<_>>();
    let (a, b, c, d) = ([0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]);
    let json = |mode: u32| glb_json(r#"{"mesh": 0}"#, "0").replace(r#""indices": 1"#, &format!(r#""mode": {mode}"#));
    let read = |mode, corners| mesh(&glb(&json(mode), &positions(corners)), Format::Glb).unwrap();
    assert_eq!(read(5, [a, b, c, d]).triangles, [[0, 1, 2], [1, 3, 2]]);
    assert_eq!(read(6, [a, b, d, c]).triangles, [[0, 1, 2], [0, 2, 3]]);
    rejects(&glb(&json(3), &positions([a, b, c, d])), Format::Glb, &["no triangles"]);
}

#[test]
fn glb_faults_name_the_place() {
    let json = glb_json(r#"{"mesh": 0}"#, "0");
    let faults: [(&str, &str, &[&str]); 21] = [
        (r#""count": 4,"#, r#""count": 5,"#, &["accessor 0", "beyond the end"]),
        (r#""count": 4,"#, r#""count": 18446744073709551615,"#, &["accessor 0", "beyond the end"]),
        (r#""count": 4,"#, r#""count": 1000000000000,"#, &["accessor 0", "beyond the end"]),
        // 2^62 strides of 12 bytes: zero, if the product wraps around.
        (r#""count": 4,"#, r#""count": 4611686018427387905,"#, &["accessor 0", "beyond the end"]),
        (r#""count": 4,"#, r#""count": 3,"#, &["vertex 3", "there are 3"]),
        (r#""count": 4,"#, r#""count": 0,"#, &["there are 0"]),
        (r#""count": 12"#, r#""count": 0"#, &["no triangles"]),
        (r#""byteLength": 48"#, r#""byteLength": 18446744073709551615"#, &["beyond the end"]),
        (r#""byteOffset": 48"#, r#""byteOffset": 18446744073709551615"#, &["accessor 1", "beyond the end"]),
        (r#""byteLength": 48"#, r#""byteLength": 48, "byteStride": 4"#, &["accessor 0", "stride"]),
        (r#""byteLength": 48"#, r#""byteLength": 48, "byteStride": 18446744073709551615"#, &["accessor 0", "beyond the end"]),
        (r#""componentType": 5126"#, r#""componentType": 5123"#, &["accessor 0", "quantization"]),
        (r#""type": "VEC3""#, r#""type": "VEC2""#, &["accessor 0"]),
        (r#"{"bufferView": 0, "#, r#"{"#, &["accessor 0", "compression"]),
        (r#""indices": 1"#, r#""indices": 7"#, &["accessor 7", "does not exist"]),
        (r#"{"POSITION": 0}"#, r#"{"NORMAL": 0}"#, &["POSITION"]),
        (r#"{"mesh": 0}"#, r#"{"mesh": 3}"#, &["mesh 3"]),
        (r#""nodes": [0]"#, r#""nodes": [4]"#, &["node 4"]),
        (r#"{"mesh": 0}"#, r#"{}"#, &["no triangles"]),
        (r#""buffers": [{"#, r#""buffers": [{"uri": "mesh.bin", "#, &["another file", ".glb"]),
        (r#""scene": 0"#, r#""extensionsRequired": ["KHR_draco_mesh_compression"]"#, &["KHR_draco_mesh_compression", "compression"]),
    ];
    for (from, to, parts) in faults {
        assert!(json.contains(from), "{from}");
        rejects(&glb(&json.replacen(from, to, 1), &glb_buffer()), Format::Glb, parts);
    }
    let mut buffer = glb_buffer();
    buffer[16..20].copy_from_slice(&f32::NAN.to_le_bytes());
    rejects(&glb(&json, &buffer), Format::Glb, &["vertex 1", "NaN", "not finite"]);
    rejects(&glb("[]", &[]), Format::Glb, &["JSON"]);
    rejects(b"{\"asset\": {}}", Format::Glb, &[".gltf", ".glb"]);
    let mut short = glb_tetrahedron(r#"{"mesh": 0}"#, "0");
    short[8..12].copy_from_slice(&5_u32.to_le_bytes());
    rejects(&short, Format::Glb, &["5 bytes"]);
}

#[test]
fn glb_node_graphs_end() {
    let rejects = |nodes: &str, scene: &str, parts: &[&str]| rejects(&glb_tetrahedron(nodes, scene), Format::Glb, parts);
    rejects(r#"{"mesh": 0, "children": [0]}"#, "0", &["node 0", "ancestor"]);
    rejects(r#"{"children": [1]}, {"children": [0], "mesh": 0}"#, "0", &["node 0", "ancestor"]);
    rejects(r#"{"children": [2]}, {"children": [2]}, {"mesh": 0}"#, "0, 1", &["node 2", "two parents"]);

    // Deeper than any call stack.
    let n = 200_000;
    let chain: String = (1..n).map(|i| format!(r#"{{"translation": [1, 0, 0], "children": [{i}]}}, "#)).collect();
    let deep = written(&glb_tetrahedron(&(chain + r#"{"mesh": 0}"#), "0"));
    assert_eq!(deep.vertices[0], [f64::from(n - 1), 0.0, 0.0]);
    let nested = "[".repeat(200_000);
    self::rejects(
        &glb(&format!(r#"{{"asset": {{"version": "2.0"}}, "accessors": [{{"min": {nested}"#), &[]),
        Format::Glb,
        &["JSON", "recursion"],
    );
}

#[test]
fn glb_instances_cannot_outgrow_the_file_without_end() {
    // 2000 nodes, each with 10,000 primitives over the same vertices: 20 million primitives from 700 kB.
    let primitive = r#"{"attributes": {"POSITION": 0}, "indices": 1}"#;
    let nodes = vec![r#"{"mesh": 0}"#; 2000].join(", ");
    let scene = (0..2000).map(|i| i.to_string()).collect::<Vec<_>>().join(", ");
    let json = glb_json(&nodes, &scene).replacen(primitive, &vec![primitive; 10_000].join(", "), 1);
    rejects(&glb(&json, &glb_buffer()), Format::Glb, &["too often", "fewer instances"]);
    let points = json.replace(r#""indices": 1"#, r#""mode": 0"#);
    rejects(&glb(&points, &glb_buffer()), Format::Glb, &["too often"]);
}
