//! What scenes mean to methods: systems by default, and all mistakes at once.

#![allow(clippy::unwrap_used)] // helpers of tests fail by panicking, too

use tumble::scene::{Simulation, resolve, set_text};
use tumble_interface::tree::Node;
use tumble_interface::{Assets, Scene};

fn scene(text: &str) -> Scene {
    Scene::from_toml(&format!("version = 1\n{text}")).unwrap()
}

/// Paths of all that is wrong, sorted.
fn faults(text: &str) -> Vec<String> {
    let issues = Simulation::new(scene(text), Assets::default()).err().unwrap().issues;
    let mut paths: Vec<String> = issues.into_iter().map(|issue| issue.path).collect();
    paths.sort();
    paths
}

const SHEET: &str = "[[sheet]]\nname = 's'\nsize = [1, 1]\nresolution = [4, 4]\n";
const GAS: &str = "[[gas]]\nname = 'g'\nbox = { size = [1, 1, 1], resolution = 8 }\n";
const HEAT: &str = "[[heat]]\nname = 'h'\nbox = { size = [1, 1, 1], resolution = 8 }\ndensity = 1000\nheat_capacity = 1000\nconductivity = 1\ntemperature = 300\n";
const SOUND: &str = "[[compressible]]\nname = 'c'\nbox = { size = [1, 1, 1], resolution = 8 }\nsound_speed = 340\ndensity = 1.2\n";
const TRACERS: &str = "[[particles]]\nname = 'p'\nsystem = 'dust'\nposition = [[0, 0, 0]]\n";

#[test]
fn mistakes_of_all_methods_are_told_at_once() {
    let wrong = [
        format!("{SHEET}pin = ['corner 9 9']\n"),
        format!("{GAS}source = [{{ shape = {{ sphere = {{ center = [9, 0, 0], radius = 0.1 }} }}, density = 1 }}]\nsmoke = {{}}\n"),
        format!("{HEAT}sides = {{ x_low = {{ coefficient = 5 }} }}\n"),
        format!("{SOUND}initial_density = -1\n"),
    ];
    let expected =
        ["compressible \"c\".initial_density", "gas \"g\".source[0].shape", "heat \"h\".sides.x_low.coefficient", "sheet \"s\".pin[0]"];
    assert_eq!(faults(&wrong.concat()), expected);
    // Also of what carries particles, once each.
    let systems = ["dynamics", "gas", "heat", "compressible", "tracers"];
    let names = ["main", "gas", "heat", "loud", "dust"];
    let system = |(name, method)| {
        format!("[[system]]\nname = '{name}'\nmethod = '{method}'\n{}", if method == "tracers" { "integrator = 'rk4'\n" } else { "" })
    };
    let systems: String = names.into_iter().zip(systems).map(system).collect();
    let all = format!("{systems}{}{TRACERS}mass = [2]\n[[field]]\nkind = 'formula'\nvelocity = '[x, y'\n", wrong.concat());
    let [compressible, gas, heat, sheet] = expected;
    assert_eq!(faults(&all), [compressible, "field[0].velocity", gas, heat, "particles \"p\".mass", sheet]);
    // Nothing is wrong without the mistakes.
    assert!(Simulation::new(scene(&[SHEET, GAS, HEAT, SOUND].concat()), Assets::default()).is_ok());
}

#[test]
fn resolved_scenes_list_their_systems() {
    let listed = |text: &str| {
        let resolved = resolve(scene(text));
        assert_eq!(resolve(resolved.clone()), resolved, "resolving twice changes the scene");
        let of: Vec<String> = resolved.objects().iter().map(|o| format!("{}: {}", o.name, o.system.unwrap_or("none"))).collect();
        (resolved.system.iter().map(|s| format!("{} {}", s.name, s.method.name())).collect::<Vec<_>>(), of)
    };
    let (systems, objects) = listed(&[SHEET, GAS, HEAT, SOUND].concat());
    assert_eq!(systems, ["main dynamics", "gas gas", "heat heat", "compressible compressible"]);
    assert_eq!(objects, ["s: main", "g: gas", "h: heat", "c: compressible"]);
    assert_eq!(listed(GAS).0, ["gas gas"]);
    // A fluid comes before what it moves.
    let ball = "bodies = ['p']\n[[particles]]\nname = 'p'\nposition = [[0, 0, 0]]\nradius = 0.3\n";
    assert_eq!(listed(&[GAS, ball].concat()).0, ["gas gas", "main dynamics"]);
    // Objects are in the first system that can move them, and what another word means is written out.
    let (systems, objects) = listed(
        "[[system]]\nname = 'a'\nmethod = 'tracers'\nintegrator = 'rk4'\n[[system]]\nname = 'b'\nmethod = 'position_based'\n\
         [[rope]]\nname = 'r'\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 2\n[[emitter]]\nname = 'e'\nfrom.point = {}\nrate = 1\n",
    );
    assert_eq!(systems, ["a tracers", "b dynamics"]);
    assert_eq!(objects, ["e: a", "r: b"]);
}

#[test]
fn resolving_keeps_the_bits() {
    let text = [SHEET, GAS, HEAT, SOUND].concat();
    let [mut written, mut resolved] = [scene(&text), resolve(scene(&text))].map(|s| Simulation::new(s, Assets::default()).unwrap());
    for world in [&mut written, &mut resolved] {
        tumble_interface::engine::Engine::step(world, &|| true).unwrap();
    }
    let hash = |world: &Simulation| tumble_interface::engine::Engine::hash(world);
    assert_eq!(hash(&written), hash(&resolved));
}

#[test]
fn overrides_reach_default_systems() {
    for path in ["system.0.substeps=7", "system.gas.substeps=7"] {
        let mut node = Node::from_toml(&format!("version = 1\n{GAS}")).unwrap();
        set_text(&mut node, path).unwrap();
        let scene = Scene::from_tree(&node).unwrap();
        assert_eq!(scene.system.len(), 1);
        assert_eq!((scene.system[0].method.name(), scene.system[0].substeps), ("gas", Some(7)), "{path}");
    }
    let mut node = Node::from_toml(&format!("version = 1\n{GAS}")).unwrap();
    assert!(set_text(&mut node, "system.main.substeps=7").unwrap_err().to_string().contains("gas"));
}
