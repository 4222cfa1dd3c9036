//! Skins and movements of glTF: what is in the file comes out, and what is wrong is named.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

mod files;

use files::*;
use tumble_interface::character::{Between, Influence, Part};
use tumble_interface::mesh::Defects;
use tumble_io::character;

#[test]
fn an_arm_comes_out_as_it_was_written() {
    let arm = character(&arm()).unwrap();
    assert_eq!(arm.mesh.vertices.len(), 9);
    assert_eq!(arm.mesh.defects(), Defects::default());
    assert!(volume(&arm.mesh) > 0.0);
    // A ring is a triangle of 0.3 x 0.4 / 2, the arm 2 long; the node of the mesh is ignored.
    assert!((volume(&arm.mesh) - 0.12).abs() < 1e-7);
    let names: Vec<&str> = arm.joints.iter().map(|j| j.name.as_str()).collect();
    let at = |name: &str| names.iter().position(|n| *n == name).unwrap() as u32;
    assert_eq!(names.len(), 4);
    assert!(arm.joints.iter().enumerate().all(|(i, j)| j.parent.is_none_or(|p| (p as usize) < i)));
    assert_eq!(arm.joints[at("lower") as usize].parent, Some(at("upper")));
    assert_eq!(arm.joints[at("upper") as usize].parent, Some(at("figure")));
    assert_eq!(arm.joints[at("lower") as usize].rest.translation, [0.0, 0.0, 1.0]);
    assert_eq!((arm.binds[0].joint, arm.binds[1].joint), (at("upper"), at("lower")));
    assert_eq!(arm.binds[1].inverse, [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]]);
    let influence = |bind, weight| Influence { bind, weight };
    assert_eq!(arm.skin[0][0], influence(0, 1.0));
    assert_eq!(arm.skin[4][..2], [influence(0, 0.5), influence(1, 0.5)]);
    assert_eq!(arm.skin[8][0], influence(1, 1.0));
    let clips: Vec<&str> = arm.clips.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(clips, ["bend", "jump", "animation 2"]);
    let tracks: Vec<_> = arm.clips.iter().map(|c| &c.tracks[0]).collect();
    assert_eq!(tracks.iter().map(|t| t.between).collect::<Vec<_>>(), [Between::Linear, Between::Step, Between::Cubic]);
    assert_eq!((tracks[0].joint, tracks[0].part, &tracks[0].times), (at("lower"), Part::Rotation, &vec![0.0, 2.0]));
    let half = f64::from(std::f32::consts::FRAC_1_SQRT_2);
    assert_eq!(tracks[0].values, [[0.0, 0.0, 0.0, 1.0], [half, 0.0, 0.0, half]]);
    assert_eq!(tracks[1].values[1], [1.0, 2.0, 3.0, 0.0]);
    assert_eq!((tracks[2].values.len(), tracks[2].values[2]), (6, [1.0, 0.0, 0.0, 0.0]));
    assert_eq!(arm.clips[0].duration(), 2.0);
}

#[test]
fn text_with_its_buffer_inside_is_the_same() {
    let uri = format!(r#""uri": "data:application/octet-stream;base64,{}","#, base64(&arm_buffer()));
    assert_eq!(character(arm_json(&uri).as_bytes()).unwrap(), character(&arm()).unwrap());
}

#[test]
fn a_rigid_mesh_hangs_on_its_node() {
    let json = arm_json("").replace(r#"{"name": "figure", "children": [2, 0]}"#, r#"{"name": "figure", "children": [2, 0], "mesh": 0}"#);
    let both = character(&glb(&json, &arm_buffer())).unwrap();
    assert_eq!((both.mesh.vertices.len(), both.binds.len()), (18, 3));
    assert_eq!(both.joints[both.binds[0].joint as usize].name, "figure");
    assert_eq!(both.skin[0][0], Influence { bind: 0, weight: 1.0 });
    assert_eq!(both.skin[9][0], Influence { bind: 1, weight: 1.0 });
}

#[test]
fn a_matrix_is_taken_apart() {
    // Twice as large, a quarter turn about z, moved.
    let matrix = r#"{"name": "lower", "matrix": [0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 5, 6, 7, 1]}"#;
    let json = arm_json("").replace(r#"{"name": "lower", "translation": [0, 0, 1]}"#, matrix);
    let arm = character(&glb(&json, &arm_buffer())).unwrap();
    let rest = arm.joints.iter().find(|j| j.name == "lower").unwrap().rest;
    assert_eq!((rest.translation, rest.scale), ([5.0, 6.0, 7.0], [2.0; 3]));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    assert!(rest.rotation.iter().zip([0.0, 0.0, half, half]).all(|(a, b)| (a - b).abs() < 1e-15), "{:?}", rest.rotation);
}

#[test]
fn faults_name_the_place_and_the_cure() {
    let json = arm_json("");
    for (from, to, parts) in [
        (r#""mesh": 0, "skin": 0,"#, r#""mesh": 0,"#, &["skin", "shape.mesh"][..]),
        (r#""joints": [0, 1]"#, r#""joints": [0]"#, &["vertex 3", "joint 1 of 1"]),
        (r#""joints": [0, 1]"#, r#""joints": [0, 7]"#, &["node 7"]),
        (r#""joints": [0, 1]"#, r#""joints": [0, 1, 2]"#, &["2 matrices for 3 joints"]),
        (r#""WEIGHTS_0": 3"#, r#""WEIGHTS_0": 4"#, &["accessor 4", "type"]),
        (r#", "WEIGHTS_0": 3"#, "", &["WEIGHTS_0", "export"]),
        (r#""output": 6"#, r#""output": 7"#, &["animation 0, channel 0", "accessor 7"]),
        (
            r#""output": 7, "interpolation": "STEP""#,
            r#""output": 7, "interpolation": "CUBICSPLINE""#,
            &["animation 1", "2 values", "expected 6"],
        ),
        (r#""count": 2, "type": "SCALAR""#, r#""count": 3, "type": "SCALAR""#, &["accessor 5", "beyond"]),
        (r#""byteOffset": 500, "byteLength": 8"#, r#""byteOffset": 504, "byteLength": 8"#, &["animation 0", "increase"]),
        (r#""buffers": [{"#, r#""buffers": [{"uri": "arm.bin", "#, &["another file", ".glb"]),
    ] {
        assert!(json.contains(from), "{from}");
        let message = character(&glb(&json.replacen(from, to, 1), &arm_buffer())).unwrap_err();
        assert!(parts.iter().all(|part| message.contains(part)), "{message} lacks one of {parts:?}");
    }
    let mut buffer = arm_buffer();
    buffer[228..232].copy_from_slice(&(-1.0_f32).to_le_bytes());
    assert!(character(&glb(&json, &buffer)).unwrap_err().contains("weight of -1"));
    assert!(character(&[]).unwrap_err().contains("empty"));
    assert!(character(b"OBJ").unwrap_err().contains("glTF"));
}
