//! Files of scenes: each opened once, hashes noted, all faults told at their places.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

use std::collections::HashMap;
use std::sync::Arc;
use tumble_interface::{Scene, SceneError};
use tumble_io::assets::{File, Files, assets, mesh_of};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
const RECORD: &str = r#"{"density": 0.2, "stretching": [[1,0,2,3],[1,0,2,3],[1,0,2,3],[1,0,2,3],[1,0,2,3],[1,0,2,3]],
  "bending": [[1e-5,1e-5,1e-5,1e-5,1e-5],[1e-5,1e-5,1e-5,1e-5,1e-5],[1e-5,1e-5,1e-5,1e-5,1e-5]]}"#;

#[derive(Default)]
struct Shelf {
    files: HashMap<&'static str, &'static str>,
    opened: Vec<String>,
}

impl Files for Shelf {
    const RESTORE: &'static str = "put it back";
    const CONVERTED: &'static [&'static str] = &["usd"];

    fn open(&mut self, path: &str) -> Result<Arc<File>, String> {
        self.opened.push(path.into());
        let text = self.files.get(path).ok_or_else(|| format!("\"{path}\" is not on the shelf"))?;
        let file = File::new(path, text.as_bytes().to_vec());
        Ok(Arc::new(if path.ends_with(".usd") { file.converted("USD", text.replace("usd ", "")) } else { file }))
    }

    fn shown(&self, path: &str) -> String {
        format!("shelf/{path}")
    }
}

fn shelf(files: &[(&'static str, &'static str)]) -> Shelf {
    Shelf { files: files.iter().copied().collect(), opened: Vec::new() }
}

fn net(name: &str, path: &str, more: &str) -> String {
    format!("[[net]]\nname = \"{name}\"\nmesh = {{ path = \"{path}\" }}\n{more}\n")
}

fn scene(objects: &[String]) -> Scene {
    Scene::from_toml(&format!("version = 1\n{}", objects.concat())).unwrap()
}

fn told(error: &SceneError) -> Vec<String> {
    error.issues.iter().map(ToString::to_string).collect()
}

#[test]
fn each_file_is_opened_once_and_its_hash_noted() {
    let mut shelf = shelf(&[("a.obj", TRIANGLE), ("r.json", RECORD)]);
    let cloth = "fabric = { path = \"r.json\" }";
    let mut scene = scene(&[net("one", "a.obj", cloth), net("two", "a.obj", cloth), net("three", "a.obj", "fabric = \"denim\"")]);
    let found = assets(&mut scene, &mut shelf).unwrap();
    assert_eq!(shelf.opened, ["a.obj", "r.json"]);
    assert_eq!(found.get("a.obj").unwrap().triangles, [[0, 1, 2]]);
    assert_eq!((found.fabric("r.json").unwrap().density, found.fabric("denim").unwrap().density), (0.2, 0.324));
    let hash = File::new("a.obj", TRIANGLE.into()).hash().to_string();
    assert_eq!(scene.net.iter().map(|net| net.mesh.hash.as_deref()).collect::<Vec<_>>(), [Some(&*hash); 3]);
    // The same scene, resolved, with the same files; and with another.
    assert!(assets(&mut scene, &mut shelf).is_ok());
    shelf.files.insert("a.obj", "v 0 0 0\nv 2 0 0\nv 0 1 0\nf 1 2 3\n");
    let stale = told(&assets(&mut scene, &mut shelf).unwrap_err());
    assert_eq!(stale.len(), 3);
    assert_eq!(
        stale[0],
        "net \"one\".mesh.hash: the content of \"a.obj\" has changed since this scene was resolved; put it back, or leave out hash"
    );
}

#[test]
fn all_faults_are_told_at_once() {
    let mut shelf = shelf(&[("bad.obj", "v 0 0\n"), ("bad.usd", "usd v 0 0\n"), ("bad.json", "{}")]);
    let of = |path: &str| format!("fabric = {{ path = \"{path}\" }}");
    let mut scene = scene(&[
        net("a", "none.obj", &of("none.json")),
        net("b", "bad.obj", &of("bad.json")),
        net("c", "bad.usd", &of("bad.yaml")),
        net("d", "bad.abc", "fabric = \"denin\""),
    ]);
    let told = told(&assets(&mut scene, &mut shelf).unwrap_err());
    let starts = [
        "net \"a\".mesh.path: \"none.obj\" is not on the shelf",
        "net \"b\".mesh.path: \"shelf/bad.obj\": OBJ: ",
        "net \"c\".mesh.path: \"shelf/bad.usd\": USD: ",
        "net \"d\".mesh.path: \"shelf/bad.abc\" has none of the suffixes .obj, .ply, .stl, .glb, .usd",
        "net \"a\".fabric.path: \"none.json\" is not on the shelf",
        "net \"b\".fabric.path: \"shelf/bad.json\": density is missing",
        "net \"c\".fabric.path: \"shelf/bad.yaml\" has none of the suffixes .toml, .json",
        "net \"d\".fabric: there is no fabric \"denin\"",
    ];
    assert_eq!(told.len(), starts.len(), "{told:#?}");
    for (told, start) in told.iter().zip(starts) {
        assert!(told.starts_with(start), "{told} instead of {start}");
    }
    // What has the wrong suffix is not opened.
    assert_eq!(shelf.opened, ["none.obj", "bad.obj", "bad.usd", "none.json", "bad.json"]);
}

#[test]
fn files_of_a_page_must_be_something() {
    let check = |path: &str, text: &str| File::new(path, text.into()).check(path);
    assert_eq!(check("a.obj", TRIANGLE).and(check("r.json", RECORD)), Ok(()));
    assert_eq!(check("a.txt", TRIANGLE), Err("\"a.txt\": it has none of the suffixes .obj, .ply, .stl, .glb".into()));
    for (path, start) in [("a.obj", "\"a.obj\": OBJ: "), ("a.glb", "\"a.glb\": GLB: "), ("r.toml", "\"r.toml\": density is missing")] {
        let told = check(path, "").unwrap_err();
        assert!(told.starts_with(start), "{told}");
    }
    let mesh = mesh_of(&mut shelf(&[("a.usd", "usd v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")]), "a.usd").unwrap().0;
    assert_eq!(mesh.vertices[1], [1.0, 0.0, 0.0]);
}

#[test]
fn a_figure_that_was_written_out_has_the_hash_of_its_file() {
    let file = File::new("a.usd/figure.glb", b"usd".to_vec()).figure(Vec::new());
    assert_eq!(file.hash(), File::new("a.usd", b"usd".to_vec()).hash());
    // It is read as a figure, and an empty one is none.
    assert!(file.character().is_err());
}

const CURVES: &str = "v 0 0 0\nv 0 0 1\nv 0 1 1\nv 5 0 0\nv 5 0 1 \nl 1 2\nl 2 3\nl -2 \\\n  -1\n";

fn groomed(path: &str) -> String {
    format!("[[hair]]\nname = \"h\"\nguides.path = \"{path}\"\n")
}

#[test]
fn curves_are_read_beside_meshes_of_the_same_file() {
    let both = Box::leak(format!("{CURVES}f 1 2 3\n").into_boxed_str());
    let mut shelf = shelf(&[("a.obj", both), ("c.usd", "usd v 0 0 0\nv 1 0 0\nl 1 2\n")]);
    let mut scene = scene(&[net("n", "a.obj", ""), groomed("a.obj"), groomed("c.usd").replace("\"h\"", "\"i\"")]);
    let found = assets(&mut scene, &mut shelf).unwrap();
    assert_eq!(found.get("a.obj").unwrap().triangles.len(), 1);
    // Pieces that go on from each other are one curve.
    let meant = vec![vec![[0.0; 3], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0]], vec![[5.0, 0.0, 0.0], [5.0, 0.0, 1.0]]];
    assert_eq!(found.curves("a.obj"), Some(&meant));
    assert_eq!(found.curves("c.usd").unwrap().len(), 1);
    let hash = File::new("a.obj", both.as_bytes().to_vec()).hash().to_string();
    assert_eq!(scene.hair[0].guides.as_ref().unwrap().hash.as_deref(), Some(&*hash));
    shelf.files.insert("a.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n");
    let stale = told(&assets(&mut scene, &mut shelf).unwrap_err());
    assert!(stale.iter().any(|line| line.starts_with("hair \"h\".guides.hash: the content of \"a.obj\" has changed")), "{stale:?}");
    // A file that a page keeps can be both.
    let file = File::new("a.obj", both.as_bytes().to_vec());
    assert!(file.mesh().is_ok() && file.curves().is_ok() && file.check("a.obj").is_ok());
    assert_eq!(File::new("a.obj", CURVES.into()).check("a.obj"), Ok(()));
}

#[test]
fn bad_curves_are_told_with_their_cure() {
    for (path, text, expected) in [
        (
            "a.obj",
            TRIANGLE,
            "OBJ: it has faces and no curves (lines \"l i j\"); export the strands as curves, or let hair grow on this mesh",
        ),
        ("a.obj", "v 0 0 0\n", "OBJ: there are no curves"),
        ("a.obj", "", "OBJ: the file is empty"),
        ("a.obj", "v 0 0 0\nl 1\n", "OBJ: line 2: a curve needs 2 vertices, this one has 1"),
        ("a.obj", "v 0 0 0\nl 1 2\n", "OBJ: line 2: the curve uses vertex 2, but the file has 1"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nl 1 2\nl 1 1 1\n", "OBJ: line 4: curve 2 has no length"),
        ("a.obj", "v 0 0 0\nv 0 nan 0\nl 1 2\n", "OBJ: line 3: curve 1 goes through [0.0, NaN, 0.0], which is not finite"),
        ("a.obj", "v 0 0 0\nl 0 1\n", "OBJ: line 2: \"0\" is not a vertex index"),
        ("a.obj", "v 0 0\nl 1 2\n", "OBJ: line 1: a vertex needs 3 coordinates"),
        ("a.usd", "usd v 0 0 0\nl 1\n", "USD: line 2: a curve needs 2 vertices"),
        ("a.ply", "ply\n", "PLY: it holds a mesh, not curves; hair takes it as mesh = { path = ... }"),
        ("a.abc", "", "\"shelf/a.abc\" has none of the suffixes .obj"),
    ] {
        let error = assets(&mut scene(&[groomed(path)]), &mut shelf(&[(path, text)])).unwrap_err();
        let told = told(&error).remove(0);
        assert!(told.starts_with("hair \"h\".guides.path: ") && told.contains(expected), "{text:?}: {told}");
    }
    let missing = told(&assets(&mut scene(&[groomed("none.obj")]), &mut shelf(&[])).unwrap_err());
    assert_eq!(missing, ["hair \"h\".guides.path: \"none.obj\" is not on the shelf"]);
    // Curves are no mesh.
    let wrong = told(&assets(&mut scene(&[net("n", "a.obj", "")]), &mut shelf(&[("a.obj", CURVES)])).unwrap_err());
    let expected = "OBJ: it has curves (3 lines \"l i j\") and no faces; hair takes curves as guides = { path = ... }";
    assert!(wrong.len() == 1 && wrong[0].contains(expected), "{wrong:?}");
}
