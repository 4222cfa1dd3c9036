//! A wrong scene gives all its errors at once, each with line, path, value, unit and range.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

use tumble_interface::Scene;
use tumble_interface::scene::{Animated, AnimatedVector, Component, Force, Integrator, Interpolation, Shape};

fn errors(text: &str) -> Vec<String> {
    Scene::from_toml(text).unwrap_err().issues.iter().map(ToString::to_string).collect()
}

#[test]
fn a_small_scene_is_read_with_its_defaults() {
    let scene = Scene::from_toml(
        r#"
version = 1
[[system]]
name = "soft"
integrator = "implicit_euler"
[[sheet]]
name = "flag"
size = [1, 2.0]
resolution = [8, 16]
links = { structural = 500, shear = { modulus = 20.0, damping = 0.1 } }
pin = ["corner 0 0", { center = [0, 0, 0], radius = 0.1 }]
[[collider]]
name = "ball"
shape = { sphere = { radius = 0.3 } }
"#,
    )
    .unwrap();
    assert_eq!(scene.system[0].integrator, Integrator::ImplicitEuler);
    assert_eq!(scene.world.gravity, [0.0, 0.0, -9.8].into());
    assert_eq!(scene.sheet[0].links().shear.as_ref().unwrap().settings().damping, 0.1);
    assert!(scene.sheet[0].links().bend.is_none());
    assert!(matches!(scene.collider[0].shape, Shape::Sphere { radius: 0.3, .. }));
    let again: Scene = serde_json::from_value(scene.to_json()).unwrap();
    assert_eq!(again, scene);
}

#[test]
fn default_links_are_written_out_where_nothing_else_makes_a_thing_elastic() {
    let words = |extra: &str| {
        format!(
            "version = 1\n[[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 2\n\
             [[sheet]]\nname = \"s\"\nsize = [1, 1]\nresolution = [2, 2]\n{extra}\n[[net]]\nname = \"n\"\nmesh = {{ path = \"m.obj\" }}\n{extra}"
        )
    };
    let links = |extra: &str| {
        let json = Scene::from_toml(&words(extra)).unwrap().to_json();
        let again: Scene = serde_json::from_value(json.clone()).unwrap();
        assert_eq!(again.to_json(), json);
        ["rope", "sheet", "net"]
            .map(|kind| ["structural", "shear", "bend"].map(|family| json[kind][0]["links"][family]["modulus"].as_f64()))
    };
    let rope = [Some(1000.0), None, None];
    assert_eq!(links(""), [rope, [Some(500.0), Some(200.0), Some(10.0)], [Some(500.0), None, Some(10.0)]]);
    assert_eq!(links("membrane = { warp = 100 }"), [rope, [None; 3], [None; 3]]);
}

#[test]
fn a_key_where_none_is_known_has_its_place() {
    let text = "version = 1\n[[body]]\nname = \"a\"\nshape = { sphere = { radius = 1 } }\n[[joint]]\nname = \"j\"\nbetween = [\"a\"]\nkind = { ball = { axis = 1 } }\n";
    assert_eq!(errors(text), ["line 8: joint \"j\".kind.ball.axis: unknown key; no key is known here"]);
}

#[test]
fn every_error_is_reported_at_once() {
    let found = errors(
        r#"version = 1
colour = 1
[time]
fps = 0
[[system]]
name = "soft"
integrator = "implicit_eulr"
[[sheet]]
name = "flag"
size = [1.0, -2.0]
resolution = [8, 0]
density = nan
links = { structral = 1.0, shear = -1.0, bend = { modulus = -2 } }
[[collider]]
shape = { spere = { radius = 0.3 } }
name = 3
[[force]]
coefficient = 1.0
[[force]]
kind = "drgg"
[[force]]
kind = "attraction"
"#,
    );
    let expected = [
        "line 2: colour: unknown key; did you mean \"collider\"?",
        "line 4: time.fps: 0 1/s, expected > 0 1/s",
        "line 7: system \"soft\".integrator: \"implicit_eulr\", expected one of forward_euler, symplectic_euler, modified_euler, midpoint, heun, rk4, adaptive_euler, \
         dormand_prince, verlet, velocity_verlet, implicit_euler, implicit_midpoint, bdf2, position_based; did you mean \"implicit_euler\"?",
        "line 10: sheet \"flag\".size[1]: -2 m, expected > 0 m",
        "line 11: sheet \"flag\".resolution[1]: 0, expected >= 2 and <= 1e9",
        "line 12: sheet \"flag\".density: NaN, expected a finite number > 0 kg/m²",
        "line 13: sheet \"flag\".links.structral: unknown key; did you mean \"structural\"?",
        "line 13: sheet \"flag\".links.shear: -1 N, N/m or Pa, expected >= 0 N, N/m or Pa",
        "line 13: sheet \"flag\".links.bend.modulus: -2 N, N/m or Pa, expected >= 0 N, N/m or Pa",
        "line 15: collider[0].shape: expected one of the keys sphere, box, plane, floor, capsule, lathe, mesh, animated_mesh, character, mannequin; did you mean \"sphere\"?",
        "line 16: collider[0].name: 3, expected a string",
        "line 17: force[0].kind: missing, expected one of drag, wind, air, attraction, gravitation, lennard_jones, repulsion, cohesion, viscosity, flock, electrostatics, acceleration, magnetic, electric, vortex, turbulence, propulsion",
        "line 20: force[1].kind: \"drgg\", expected one of drag, wind, air, attraction, gravitation, lennard_jones, repulsion, cohesion, viscosity, flock, electrostatics, acceleration, magnetic, electric, vortex, turbulence, propulsion; did you mean \"drag\"?",
        "line 21: force[2].gm: missing, expected a number in m³/s² or a formula or keyframes",
    ];
    assert_eq!(found, expected);
}

#[test]
fn wrong_types_say_what_was_expected() {
    let found = errors(
        "version = 2\ntime = 3\n[[sheet]]\nname = 'a'\nsize = 'big'\nresolution = [4.5, 4]\npin = [3]\n[[rope]]\nname = 'r'\nfrom = [0, 0]\nto = [0, 0, 1]\nsegments = 4\n",
    );
    let expected = [
        "line 1: version: 2, expected 1",
        "line 2: time: 3, expected a table",
        "line 5: sheet \"a\".size: \"big\", expected a list of 2, each a number > 0 m",
        "line 6: sheet \"a\".resolution[0]: 4.5, expected a whole number >= 2 and <= 1e9",
        "line 7: sheet \"a\".pin[0]: 3, expected a string or a table",
        "line 10: rope \"r\".from: a list of 2, expected a list of 3, each a number in m",
    ];
    assert_eq!(found, expected);
}

#[test]
fn whole_numbers_may_be_written_as_floats_where_they_are_whole() {
    assert!(Scene::from_toml("version = 1.0\n").is_ok());
}

#[test]
fn the_schema_gives_every_number_a_unit() {
    fn visit(schema: &serde_json::Value, path: &str, missing: &mut Vec<String>) {
        if let Some(properties) = schema["properties"].as_object() {
            for (key, value) in properties {
                let is_number =
                    |v: &serde_json::Value| v["type"] == "number" || v["type"].as_array().is_some_and(|t| t.iter().any(|t| t == "number"));
                let number = is_number(value) || is_number(&value["items"]) || is_number(&value["items"]["items"]);
                if number && value["x-unit"].is_null() {
                    missing.push(format!("{path}.{key}"));
                }
                if value["description"].is_null() {
                    missing.push(format!("{path}.{key} (description)"));
                }
            }
        }
        match schema {
            serde_json::Value::Object(map) => map.iter().for_each(|(k, v)| visit(v, &format!("{path}.{k}"), missing)),
            serde_json::Value::Array(list) => list.iter().for_each(|v| visit(v, path, missing)),
            _ => {}
        }
    }
    let mut missing = Vec::new();
    visit(&Scene::schema(), "", &mut missing);
    // Directions have no unit, colours, probes and users' columns neither: pure numbers, or the unit of what is probed.
    let known = [
        "normal",
        "axis",
        "direction",
        "Panel.right",
        "Panel.up",
        "color",
        "value",
        "tolerance",
        "Between",
        "kind",
        "Shape.oneOf",
        "Arrange.oneOf",
        "BirthRegion.oneOf",
        "Source.oneOf",
        "Kill.oneOf",
        "GasSide.oneOf",
        "JointKind.oneOf",
        "JointMotor.oneOf",
        "GrainClump.oneOf",
    ];
    missing.retain(|m| !known.iter().any(|w| m.contains(w)));
    assert!(missing.is_empty(), "{missing:#?}");
}

#[test]
fn animated_values_are_numbers_formulas_or_keyframes() {
    let scene = Scene::from_toml(
        r#"version = 1
[[force]]
kind = "attraction"
center = { keys = [[0, 1, 2, 3], [2, 4, 5, 6]], interpolation = "smooth" }
gm = "2*sin(t)"
[[force]]
kind = "acceleration"
value = [1, "x*y", 0.5]
[[force]]
kind = "vortex"
swirl = { keys = [[0, 1]] }
[[field]]
kind = "formula"
velocity = "[-y, x, 0]"
"#,
    )
    .unwrap();
    let Force::Attraction { center: AnimatedVector::Keys(keys), gm: Animated::Formula(gm), power, .. } = &scene.force[0] else {
        panic!("{:?}", scene.force[0])
    };
    assert_eq!((keys.keys[1], keys.interpolation, gm.as_str(), *power), ([2.0, 4.0, 5.0, 6.0], Interpolation::Smooth, "2*sin(t)", 2.0));
    let Force::Acceleration { value: AnimatedVector::Components(parts), .. } = &scene.force[1] else { panic!("{:?}", scene.force[1]) };
    assert_eq!((&parts[0], &parts[1]), (&Component::Value(1.0), &Component::Formula("x*y".into())));
    let again: Scene = serde_json::from_value(scene.to_json()).unwrap();
    assert_eq!(again, scene);
    let found = errors(
        r#"version = 1
[[force]]
kind = "attraction"
center = [1, 2]
gm = true
[[force]]
kind = "vortex"
swirl = { keys = [[0, 1, 2]], interpolation = "smoth" }
[[force]]
kind = "acceleration"
value = { kyes = [] }
"#,
    );
    let expected = [
        "line 4: force[0].center: a list of 2, expected a list of 3, each a number in m or a formula",
        "line 5: force[0].gm: true, expected a number in m³/s² or a formula or keyframes",
        "line 8: force[1].swirl.keys[0]: a list of 3, expected a list of 2, each a number in s, then the unit of the value",
        "line 8: force[1].swirl.interpolation: \"smoth\", expected one of linear, smooth, step; did you mean \"smooth\"?",
        "line 11: force[2].value.kyes: unknown key; did you mean \"keys\"?",
        "line 11: force[2].value.keys: missing, expected a list of at least 1, each a list of 4, each a number in s, then the unit of the value",
    ];
    assert_eq!(found, expected);
}
