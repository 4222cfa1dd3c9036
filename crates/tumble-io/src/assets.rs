//! The files that a scene names, resolved for every front: what is read of each, the hash of its content, and all that is wrong with them.
//! Where bytes come from is the front's ([`Files`]). Verified by `tests/assets.rs`.

use crate::{Format, character, curves, fabric, has_curves, mesh, record_is_json, shipped};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use tumble_interface::scene::{Content, FabricRef};
use tumble_interface::{Assets, Character, Curves, Fabric, Issue, Mesh, Scene, SceneError};
use twox_hash::XxHash3_64;

/// Where a front finds the files of a scene.
pub trait Files {
    /// What to do about a file whose content has changed.
    const RESTORE: &'static str;
    /// Suffixes of meshes, beside those of [`Format`], that it converts ([`File::converted`]).
    const CONVERTED: &'static [&'static str] = &[];

    /// The file of a path, as it stands in the scene; or one line that says why there is none.
    fn open(&mut self, path: &str) -> Result<Arc<File>, String>;

    /// The same of a file whose curves are wanted.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    fn open_curves(&mut self, path: &str) -> Result<Arc<File>, String> {
        self.open(path)
    }

    /// The path as messages show it.
    fn shown(&self, path: &str) -> String {
        path.into()
    }
}

/// A file. What it holds is read when it is first asked for, and once.
#[derive(Debug)]
pub struct File {
    /// Empty once they have been read, unless they are `kept`.
    bytes: Mutex<Vec<u8>>,
    hash: String,
    /// Whether it may hold a figure.
    figure: bool,
    /// Whether it may be read in two ways: figures are meshes, too, and meshes may have curves beside them.
    kept: bool,
    format: Option<Format>,
    /// Name of the format that it was converted from.
    converted: Option<&'static str>,
    json: Option<bool>,
    mesh: OnceLock<Result<Mesh, String>>,
    character: OnceLock<Result<Character, String>>,
    fabric: OnceLock<Result<Fabric, String>>,
    curves: OnceLock<Result<Curves, String>>,
}

impl File {
    /// A file of this path and content.
    pub fn new(path: &str, bytes: Vec<u8>) -> Self {
        let figure = Format::from_path(path) == Some(Format::Glb) || path.to_lowercase().ends_with(".gltf");
        Self {
            kept: figure || Format::from_path(path) == Some(Format::Obj) && has_curves(&bytes),
            hash: format!("{:016x}", XxHash3_64::oneshot(&bytes)),
            bytes: Mutex::new(bytes),
            figure,
            format: Format::from_path(path),
            converted: None,
            json: record_is_json(path),
            mesh: OnceLock::new(),
            character: OnceLock::new(),
            fabric: OnceLock::new(),
            curves: OnceLock::new(),
        }
    }

    /// The same, where its mesh or its curves were written out as OBJ from a format of that name.
    pub fn converted(self, name: &'static str, obj: String) -> Self {
        Self { bytes: Mutex::new(obj.into_bytes()), format: Some(Format::Obj), converted: Some(name), ..self }
    }

    /// The same, where its figure was written out as GLB.
    pub fn figure(self, glb: Vec<u8>) -> Self {
        Self { bytes: Mutex::new(glb), figure: true, kept: true, format: Some(Format::Glb), ..self }
    }

    /// Hash of its content.
    pub fn hash(&self) -> &str {
        &self.hash
    }

    /// Reads its bytes, and lets go of them.
    fn read<T>(&self, read: impl FnOnce(&[u8]) -> T) -> T {
        let mut bytes = self.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        let value = read(&bytes);
        if !self.kept {
            *bytes = Vec::new();
        }
        value
    }

    /// Its mesh; or what is wrong, in one line.
    pub fn mesh(&self) -> Result<&Mesh, &str> {
        self.mesh.get_or_init(|| self.of_format(mesh)).as_ref().map_err(String::as_str)
    }

    /// Its curves; or what is wrong, in one line.
    pub fn curves(&self) -> Result<&Curves, &str> {
        self.curves.get_or_init(|| self.of_format(curves)).as_ref().map_err(String::as_str)
    }

    fn of_format<T>(&self, of: fn(&[u8], Format) -> Result<T, String>) -> Result<T, String> {
        let format = self.format.ok_or_else(|| format!("it has none of the suffixes {}", suffixes(&[])))?;
        self.read(|bytes| of(bytes, format))
            .map_err(|e| self.converted.map_or_else(|| e.clone(), |name| e.replacen(format.name(), name, 1)))
    }

    /// Its figure; or what is wrong, in one line.
    pub fn character(&self) -> Result<&Character, &str> {
        self.character.get_or_init(|| self.read(character)).as_ref().map_err(String::as_str)
    }

    /// Its record of a fabric; or what is wrong, in one line.
    pub fn fabric(&self) -> Result<&Fabric, &str> {
        let read = || {
            let json = self.json.ok_or_else(|| format!("it has none of the suffixes {RECORDS}"))?;
            self.read(|bytes| fabric(bytes, json))
        };
        self.fabric.get_or_init(read).as_ref().map_err(String::as_str)
    }

    /// Reads whatever its suffix promises; an error where it is nothing that a scene can name.
    pub fn check(&self, path: &str) -> Result<(), String> {
        let read = match (self.json, self.mesh()) {
            (Some(_), _) => self.fabric().map(drop),
            (None, Err(e)) if self.figure => self.character().map(drop).map_err(|_| e),
            (None, Err(_)) if self.kept => self.curves().map(drop),
            (None, mesh) => mesh.map(drop),
        };
        read.map_err(|e| format!("\"{path}\": {e}"))
    }
}

/// Suffixes of records of fabrics.
const RECORDS: &str = ".toml, .json";

/// Suffixes of meshes.
fn suffixes(more: &[&str]) -> String {
    let own = Format::ALL.map(|format| format.name().to_lowercase());
    let all: Vec<String> = own.iter().map(String::as_str).chain(more.iter().copied()).map(|suffix| format!(".{suffix}")).collect();
    all.join(", ")
}

/// The path as messages show it; an error where it has none of the suffixes of meshes.
fn known<F: Files>(files: &F, path: &str) -> Result<String, String> {
    let shown = files.shown(path);
    let suffix = path.rsplit_once('.').map_or("", |(_, suffix)| suffix);
    if Format::from_path(path).is_none() && !F::CONVERTED.iter().any(|known| known.eq_ignore_ascii_case(suffix)) {
        return Err(format!("\"{shown}\" has none of the suffixes {}", suffixes(F::CONVERTED)));
    }
    Ok(shown)
}

/// The mesh of a path, and the hash of the file.
///
/// # Errors
/// One line: what is wrong with the file, and what to do.
pub fn mesh_of<F: Files>(files: &mut F, path: &str) -> Result<(Mesh, String), String> {
    let shown = known(files, path)?;
    let file = files.open(path)?;
    let hash = file.hash().to_string();
    file.mesh().map_err(|e| format!("\"{shown}\": {e}"))?;
    // Nobody needs a second copy where the front keeps none.
    let mesh = match Arc::try_unwrap(file) {
        Ok(File { mesh, .. }) => mesh.into_inner().unwrap_or_else(|| Ok(Mesh::default())),
        Err(kept) => kept.mesh().cloned().map_err(str::to_string),
    };
    Ok((mesh?, hash))
}

/// The record of a path, and the file.
///
/// # Errors
/// One line: what is wrong with the file, and what to do.
pub fn fabric_of<F: Files>(files: &mut F, path: &str) -> Result<(Fabric, Arc<File>), String> {
    let shown = files.shown(path);
    if record_is_json(path).is_none() {
        return Err(format!("\"{shown}\" has none of the suffixes {RECORDS}"));
    }
    let file = files.open(path)?;
    let fabric = file.fabric().map_err(|e| format!("\"{shown}\": {e}"))?.clone();
    Ok((fabric, file))
}

/// All that a scene names, each file opened once for what it is; the hashes of their content are noted in the scene.
///
/// # Errors
/// All that is wrong with them, at their places in the scene.
pub fn assets<F: Files>(scene: &mut Scene, files: &mut F) -> Result<Assets, SceneError> {
    let mut issues = Vec::new();
    // Of what has been opened, and what for: its hash, or what is wrong with it.
    let mut opened: HashMap<(Content, String), Result<String, String>> = HashMap::new();
    let (mut meshes, mut characters, mut guides, mut fabrics) = (HashMap::new(), HashMap::new(), HashMap::new(), HashMap::new());
    for file in scene.mesh_files_mut() {
        let path = file.path;
        let open = || match file.content {
            Content::Character => {
                let read = files.open(path)?;
                let figure = read.character().map_err(|e| format!("\"{}\": {e}", files.shown(path)))?;
                characters.insert(path.to_string(), figure.clone());
                Ok(read.hash().to_string())
            }
            Content::Curves => {
                let shown = known(files, path)?;
                let read = files.open_curves(path)?;
                guides.insert(path.to_string(), read.curves().map_err(|e| format!("\"{shown}\": {e}"))?.clone());
                Ok(read.hash().to_string())
            }
            Content::Mesh => {
                let (mesh, hash) = mesh_of(files, path)?;
                meshes.insert(path.to_string(), mesh);
                Ok(hash)
            }
        };
        match opened.entry((file.content, path.to_string())).or_insert_with(open) {
            Ok(hash) => issues.extend(noted::<F>(&file.place, path, file.hash, Some(hash.clone()))),
            Err(message) => issues.push(Issue::new(format!("{}.path", file.place), message.clone())),
        }
    }
    let mut records: HashMap<String, Result<Option<String>, String>> = HashMap::new();
    for FabricRef { place, words } in scene.fabrics_mut() {
        let key = words.key().to_string();
        let choice = match words.choice() {
            Err(message) => {
                issues.push(Issue::new(place, message));
                continue;
            }
            Ok(choice) => choice,
        };
        let below = if choice.is_some() { ".path" } else { words.name_key() };
        let open = || {
            let (fabric, hash) = match choice {
                None => (shipped(&key)?, None),
                Some(path) => fabric_of(files, path).map(|(fabric, file)| (fabric, Some(file.hash().to_string())))?,
            };
            fabrics.insert(key.clone(), fabric);
            Ok(hash)
        };
        match records.entry(key.clone()).or_insert_with(open) {
            Ok(found) => issues.extend(words.hash_mut().and_then(|hash| noted::<F>(&place, &key, hash, found.clone()))),
            Err(message) => issues.push(Issue::new(format!("{place}{below}"), message.clone())),
        }
    }
    if issues.is_empty() {
        Ok(Assets::new(meshes, characters).with_fabrics(fabrics).with_curves(guides))
    } else {
        Err(SceneError { issues })
    }
}

/// Notes the hash that was found; an issue where another stands there.
fn noted<F: Files>(place: &str, path: &str, hash: &mut Option<String>, found: Option<String>) -> Option<Issue> {
    let message = || format!("the content of \"{path}\" has changed since this scene was resolved; {}, or leave out hash", F::RESTORE);
    let issue = (hash.is_some() && *hash != found).then(|| Issue::new(format!("{place}.hash"), message()));
    *hash = found;
    issue
}
