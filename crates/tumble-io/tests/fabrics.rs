//! Records of fabrics: those that ship, those of other programs, and bad ones.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

use tumble_io::{fabric, record_is_json, shipped};

const JSON: &str = r#"{"density": 0.2, "author": "somebody",
  "stretching": [[1,0,2,3],[1,-5,2,3],[1,0,2,3],[1,0,2,3],[1,0,2,-3],[1,0,2.5,3]],
  "bending": [[1e-5,1e-5,1e-5,1e-5,1e-5],[2e-5,1,1,1,0],[3e-5,1,1,1,-1e-7]]}"#;

fn toml() -> String {
    let row = "[2.0, 0.5, 2.0, 1.0],\n";
    format!("density = 0.2\nstretching = [\n{}]\nbending = [\n{}]\n", row.repeat(6), "[1e-5, 1e-5, 1e-5, 1e-5, 1e-5],\n".repeat(3))
}

#[test]
fn what_ships_is_what_was_measured() {
    // shared/validation, 2.2: densities, and bending stiffness at no curvature [µN m].
    for (name, density, bending) in [
        ("denim", 0.324, [64.196, 73.385, 96.952]),
        ("interlock", 0.187, [23.192, 24.750, 14.268]),
        ("tablecloth", 0.128, [51.714, 40.659, 31.283]),
    ] {
        let f = shipped(name).unwrap();
        assert_eq!(f.density, density);
        for (row, b) in f.bending.iter().zip(bending) {
            assert!((1e6 * row[0] - b).abs() < 6e-4, "{name}: {row:?}");
        }
        assert!(f.source.contains("10.1145/2010324.1964966") && f.composition.contains('%'));
    }
    assert_eq!(shipped("denim").unwrap().stretching[5], [225.767487, 40.917892, 1051.55712, 71.810631]);
}

#[test]
fn records_of_other_programs_are_read() {
    let f = fabric(JSON.as_bytes(), true).unwrap();
    assert_eq!((f.density, f.stretching[5], f.bending[2][4]), (0.2, [1.0, 0.0, 2.5, 3.0], -1e-7));
    assert_eq!([record_is_json("a/b.JSON"), record_is_json("b.toml"), record_is_json("denim")], [Some(true), Some(false), None]);
    assert_eq!(fabric(toml().as_bytes(), false).unwrap().bending, [[1e-5; 5]; 3]);
}

#[test]
fn bad_records_are_told_with_place_and_cure() {
    let toml = toml();
    let swap = |from: &str, to: &str| toml.replacen(from, to, 1);
    for (text, parts) in [
        (swap("density = 0.2\n", ""), &["density is missing", "kg/m²"][..]),
        (swap("0.2", "-0.2"), &["line 1", "density: -0.2", "> 0"]),
        (swap("0.2", "\"light\""), &["line 1", "density: \"light\"", "expected a number"]),
        (swap("[2.0, 0.5, 2.0, 1.0],\n", ""), &["line 2", "5 rows, expected 6", "90°) is missing"]),
        (swap("2.0, 1.0]", "2.0]"), &["line 3", "stretching row 1 (small strain)", "3 numbers, expected 4"]),
        (swap("2.0, 1.0]", "nan, 1.0]"), &["line 3", "row 1", "number 3", "finite"]),
        (swap("[2.0, 0.5, 2.0, 1.0]", "[2.0, 2.5, 2.0, 1.0]"), &["row 1", "C12 = 2.5", "< sqrt(C11 C22) = 2.0000"]),
        (swap("[2.0, 0.5, 2.0, 1.0]", "[-2.0, 0.5, 2.0, 1.0]"), &["row 1", "C11 = -2", "> 0"]),
        (swap("[1e-5, 1e-5, 1e-5, 1e-5, 1e-5],\n", ""), &["2 rows, expected 3", "90°) is missing"]),
        (swap("[1e-5,", "[0,"), &["bending row 1 (0°)", "starts with 0", "> 0"]),
        (swap("bending = [\n", "bending = 3\nx = [\n"), &["unknown key \"x\""]),
        (swap("stretching", "streching"), &["unknown key \"streching\"", "did you mean \"stretching\"?"]),
        ("density = = 3".into(), &["line 1", "not TOML"]),
        (String::new(), &["density is missing"]),
    ] {
        let message = fabric(text.as_bytes(), false).unwrap_err();
        assert!(parts.iter().all(|part| message.contains(part)) && !message.contains('\n'), "{parts:?}: {message}");
    }
    for (text, part) in [
        ("[]", "a list of 0"),
        ("{\"density\": 1}", "stretching is missing"),
        ("{", "not JSON"),
        ("{\"density\": null}", "nothing, expected a number"),
    ] {
        let message = fabric(text.as_bytes(), true).unwrap_err();
        assert!(message.contains(part), "{part}: {message}");
    }
    assert!(fabric(&[0xff, 0xfd], true).unwrap_err().contains("UTF-8"));
    let unknown = shipped("denimm").unwrap_err();
    assert!(unknown.contains("did you mean \"denim\"?") && unknown.contains("interlock, tablecloth"), "{unknown}");
}
