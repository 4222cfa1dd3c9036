//! Figures: mannequins, and characters from files, as colliders with bones.

use crate::geometry::Affine;
use crate::geometry::mannequin::{self, Dance, Moves};
use crate::geometry::motion::Pose;
use crate::geometry::skeleton::{Act, Clock};
use crate::geometry::{Facets, Rig};
use crate::math::rotation::from_degrees;
use std::sync::Arc;
use tumble_interface::Character;
use tumble_interface::check::suggestion;
use tumble_interface::scene::{Figure, Mannequin, Moves as Words};

/// A figure with the keyframes of its skin; or what is wrong with which key.
pub type Moving = Result<(Arc<Rig>, Facets), (String, String)>;

/// Vertices of a mannequin, about.
pub const MANNEQUIN: usize = 4000;
/// Keyframes of a figure at most [bytes].
const MOST: f64 = 4e9;

/// A mannequin whose movement is needed until `end` [s].
pub fn mannequin(words: &Mannequin, end: f64) -> Moving {
    let body = mannequin::body();
    let moves = match words.motion {
        Words::Bind => Moves::Bind,
        Words::Stand => Moves::Stand,
        Words::Walk => Moves::Walk,
        Words::Twirl => Moves::Twirl,
        Words::Dance => Moves::Dance,
    };
    let rig = Rig {
        names: mannequin::BONES.map(String::from).to_vec(),
        vertices: body.mesh.vertices.iter().map(|v| (*v).into()).collect(),
        triangles: body.mesh.triangles.clone(),
        skin: body.skin.clone(),
        binds: body.binds.clone(),
        act: Act::Mannequin(Dance { moves, travel: words.travel }),
        clock: Clock { start: words.start, settle: words.settle, pace: words.pace },
        scale: words.height / mannequin::HEIGHT,
        place: Pose { turn: from_degrees(words.rotate), shift: words.translate.into() },
    };
    baked(rig, words.rate, end, ".shape.mannequin")
}

/// A character from a file whose movement is needed until `end` [s].
pub fn character(words: &Figure, file: &Character, end: f64) -> Moving {
    let names: Vec<&str> = file.clips.iter().map(|c| c.name.as_str()).collect();
    let clip = match &words.clip {
        None => file.clips.first().cloned().unwrap_or_default(),
        Some(name) => match file.clips.iter().find(|c| c.name == *name) {
            Some(clip) => clip.clone(),
            None => {
                let hint = suggestion(name, names.iter().copied());
                let all = if names.is_empty() { "the file has none".into() } else { format!("clips: {}", names.join(", ")) };
                return Err((".shape.character.clip".into(), format!("there is no clip \"{name}\"{hint} ({all})")));
            }
        },
    };
    let period = Some(clip.duration()).filter(|d| words.repeat && *d > 0.0);
    let rig = Rig {
        names: file.joints.iter().map(|j| j.name.clone()).collect(),
        vertices: file.mesh.vertices.iter().map(|v| (*v).into()).collect(),
        triangles: file.mesh.triangles.clone(),
        skin: file.skin.clone(),
        binds: file.binds.iter().map(|b| (b.joint, Affine::from_rows(b.inverse))).collect(),
        act: Act::Clip { joints: file.joints.clone(), clip, period },
        clock: Clock { start: words.start, settle: words.settle, pace: 1.0 },
        scale: words.scale,
        place: Pose { turn: from_degrees(words.rotate), shift: words.translate.into() },
    };
    baked(rig, words.rate, end, ".shape.character")
}

fn baked(rig: Rig, rate: f64, end: f64, key: &str) -> Moving {
    if bytes(rig.vertices.len(), rig.needed(end), rate) > MOST {
        let message = format!("{rate} frames a second of the movement are more than memory; lower it, or the frames of the scene");
        return Err((format!("{key}.rate"), message));
    }
    match rig.facets(rate, end) {
        Some(facets) => Ok((Arc::new(rig), facets)),
        None => Err((key.into(), "the surface has no triangle with an area".into())),
    }
}

/// Memory for keyframes of so many vertices over a time [s]: 24 bytes each, and 24 for each of about as many boxes.
pub fn bytes(vertices: usize, duration: f64, rate: f64) -> f64 {
    vertices as f64 * 50.0 * (duration * rate + 2.0)
}
