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
