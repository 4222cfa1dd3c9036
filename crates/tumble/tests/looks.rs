//! What the engine says of how the objects of a scene are drawn.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

use tumble::scene::{Simulation, looks};
use tumble_interface::looks::{Colors, FORMS, Form, GROUND, Look, PALETTE, RADIUS, SMOKE, SOLID};
use tumble_interface::{Assets, Engine, Scene};

const MANY: &str = r#"
version = 1
[[system]]
name = "flow"
method = "tracers"
integrator = "rk4"
[[system]]
name = "soft"
method = "dynamics"
[[emitter]]
name = "sparks"
from = { point = {} }
rate = 10
radius = 0.3
radius_spread = 0.5
trail = 0.5
[[emitter]]
name = "drops"
from = { point = {} }
rate = 10
radius = 0.2
[[particles]]
name = "dust"
system = "flow"
cloud = { count = 200, size = [1, 1, 1] }
[[particles]]
name = "masses"
system = "soft"
position = [[0, 0, 1], [1, 0, 1]]
radius = 0.05
trail = 0.25
[[emitter]]
name = "spray"
system = "soft"
from = { point = {} }
rate = 10
radius = 0.1
[[rope]]
name = "rope"
from = [0, 0, 2]
to = [1, 0, 2]
segments = 4
links = { structural = 100 }
[[sheet]]
name = "sheet"
size = [1, 1]
resolution = [3, 3]
center = [0, 0, 3]
color = [0.1, 0.2, 0.3]
links = { structural = 100 }
[[block]]
name = "block"
size = [1, 1, 1]
resolution = [2, 2, 2]
center = [0, 0, 5]
links = { structural = 100 }
[[collider]]
name = "floor"
shape = { floor = { height = -1 } }
[[collider]]
name = "slope"
shape = { plane = { point = [0, 0, -9], normal = [0, 0, 2] } }
color = [0.5, 0.4, 0.3]
[[collider]]
name = "ball"
shape = { sphere = { center = [9, 0, 0], radius = 1 } }
[[collider]]
name = "tank"
shape = { box = { size = [99, 99, 99] } }
inside = true
[[anchor]]
name = "slack"
between = ["masses 0", "rope 1"]
stiffness = 0
[[anchor]]
name = "pulling"
between = ["masses 1", "rope 4"]
stiffness = 10
[[anchor]]
name = "damping"
between = ["masses 0", "rope 2"]
stiffness = 0
damping = 2
"#;

fn scene(text: &str) -> Scene {
    Scene::from_toml(text).unwrap()
}

#[test]
fn looks_come_in_the_order_of_columns_and_say_what_the_scene_says() {
    let said = looks(&scene(MANY));
    let names: Vec<&str> = said.objects.iter().map(|look| look.object.as_str()).collect();
    assert_eq!(names, ["dust", "sparks", "drops", "masses", "spray", "rope", "sheet", "block", "floor", "slope", "ball", "tank"]);
    // What has constant columns has them in this order.
    let world = Simulation::new(scene(MANY), Assets::default()).unwrap();
    let mut columns: Vec<String> = world.topology().into_iter().map(|column| column.object).collect();
    columns.dedup();
    assert_eq!(columns, names.into_iter().filter(|name| *name != "sparks").collect::<Vec<_>>());
    let expected = [
        Look { few: false, ..Look::new("dust", Form::Points, PALETTE[0]) },
        // Each spark has a radius of its own.
        Look { trail: 0.5, ..Look::new("sparks", Form::Points, PALETTE[1]) },
        Look::new("drops", Form::Points, PALETTE[2]).with_radius(0.2),
        Look { trail: 0.25, few: true, ..Look::new("masses", Form::Points, PALETTE[3]).with_radius(0.05) },
        Look::new("spray", Form::Points, PALETTE[4]).with_radius(0.1),
        Look { few: true, ..Look::new("rope", Form::Curve, PALETTE[5]) },
        Look::new("sheet", Form::Surface, [0.1, 0.2, 0.3]),
        Look::new("block", Form::Body, PALETTE[0]),
        Look { plane: Some([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]), ..Look::new("floor", Form::Ground, GROUND) },
        Look { plane: Some([[0.0, 0.0, -9.0], [0.0, 0.0, 1.0]]), ..Look::new("slope", Form::Ground, [0.5, 0.4, 0.3]) },
        Look::new("ball", Form::Solid, SOLID),
        Look::new("tank", Form::Container, SOLID),
    ];
    assert_eq!(said.objects, expected);
    assert_eq!(expected[1].radius, RADIUS);
    // One without stiffness and damping does nothing.
    let end = |name: &str, row| (name.to_string(), row);
    assert_eq!(said.anchors, [[end("masses", 1), end("rope", 4)], [end("masses", 0), end("rope", 2)]]);
}

#[test]
fn what_lies_on_grids_is_smoke_dye_or_an_image() {
    let of = |words: &str, gas: &str| {
        let text = format!("version = 1\n{words}\n[[gas]]\nname = \"g\"\nbox = {{ size = [1, 1, 1], resolution = 8 }}\n{gas}\n");
        looks(&scene(&text)).objects.remove(0)
    };
    let smoke = "smoke = {}";
    assert_eq!(of("", smoke), Look::new("g", Form::Smoke, SMOKE));
    assert_eq!(of("", &format!("{smoke}\nfluid_density = 99.9")).color, SMOKE);
    assert_eq!(of("", &format!("{smoke}\nfluid_density = 100.0")), Look::new("g", Form::Smoke, PALETTE[0]));
    assert_eq!(of("dimension = 2", smoke), Look::new("g", Form::Image, PALETTE[0]));
}

#[test]
fn a_square_that_repeats_itself_is_told() {
    let text = "version = 1\ndimension = 2\n[[system]]\nname = \"s\"\nmethod = \"vicsek\"\n\
        vicsek = { side = 2.0, radius = 0.5, speed = 1.0, noise = 0.1 }\n[[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\n";
    assert_eq!(looks(&scene(text)).objects[0].leap, Some(1.0));
}

#[test]
fn colours_are_handed_out_in_turn_and_all_forms_described() {
    let mut colors = Colors::default();
    assert_eq!(colors.pick(Some([1.0; 3])), [1.0; 3]);
    let picked: Vec<_> = (0..PALETTE.len() + 1).map(|_| colors.pick(None)).collect();
    assert_eq!((&picked[..PALETTE.len()], picked[PALETTE.len()]), (PALETTE, PALETTE[0]));
    let all = [
        Form::Points,
        Form::Curve,
        Form::Strands,
        Form::Surface,
        Form::Body,
        Form::Instances,
        Form::Solid,
        Form::Container,
        Form::Liquid,
        Form::Ground,
        Form::Image,
        Form::Smoke,
    ];
    assert_eq!(FORMS.iter().map(|form| form.name).collect::<Vec<_>>(), all);
}
