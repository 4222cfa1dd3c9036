//! The scene's camera as a function of time.

use super::laws::flat;
use crate::math::formula::Of;
use crate::math::{Signal, Vec3, VectorSignal};
use serde::Serialize;
use tumble_interface::check::plain;
use tumble_interface::scene::{AnimatedVector, Camera as Words, Scene};
use tumble_interface::{Issue, SceneError};

/// Times at which a camera is checked beside those of its keys, at most; in a run of fewer frames these are the times of all its pictures.
const TRIALS: u32 = 10_000;

/// Angle of view [°] that none reaches.
const WIDEST: f64 = 170.0;

/// A distance from the target, in those of both points from the origin, that is none.
const NONE: f64 = 1e-12;

/// A camera at one time. What the scene leaves open, pictures choose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Sight {
    /// Position [m].
    pub position: Option<[f64; 3]>,
    /// Point that it looks at [m].
    pub target: Option<[f64; 3]>,
    /// Horizontal angle of view [°].
    pub view_angle: f64,
}

/// The words of a camera, read.
#[derive(Debug, Clone)]
pub struct Camera {
    position: Option<VectorSignal>,
    target: Option<VectorSignal>,
    view_angle: Signal,
}

impl Camera {
    /// From the words of a scene, or what is wrong with them.
    pub fn new(words: &Words) -> Result<Self, SceneError> {
        let point = |words: &Option<AnimatedVector>| words.as_ref().map(|words| VectorSignal::new(words, Of::Time)).transpose();
        match (point(&words.position), point(&words.target), Signal::new(&words.view_angle)) {
            (Ok(position), Ok(target), Ok(view_angle)) => Ok(Self { position, target, view_angle }),
            (position, target, view_angle) => {
                let all = [("position", position.err()), ("target", target.err()), ("view_angle", view_angle.err())];
                let issues = all.into_iter().filter_map(|(key, message)| Some(Issue::new(format!("camera.{key}"), message?)));
                Err(SceneError { issues: issues.collect() })
            }
        }
    }

    /// At a time [s].
    pub fn at(&self, t: f64) -> Sight {
        let point = |signal: &Option<VectorSignal>| signal.as_ref().map(|signal| signal.value(t).into());
        Sight { position: point(&self.position), target: point(&self.target), view_angle: self.view_angle.value(t) }
    }

    /// Whether it is the same at all times.
    pub fn stands(&self) -> bool {
        self.points().all(VectorSignal::is_constant) && self.view_angle.is_constant()
    }

    fn points(&self) -> impl Iterator<Item = &VectorSignal> {
        self.position.iter().chain(&self.target)
    }
}

/// All that is wrong with the camera of a scene, each with the first time at which it is.
pub fn check(scene: &Scene) -> Vec<Issue> {
    let camera = match Camera::new(&scene.camera) {
        Ok(camera) => camera,
        Err(error) => return error.issues,
    };
    let (frames, n) = (f64::from(scene.time.frames), scene.time.frames.clamp(1, TRIALS));
    let times = (0..=n).map(|i| f64::from(i) * frames / f64::from(n) * scene.frame_time());
    let keys = camera.points().flat_map(VectorSignal::key_times).chain(camera.view_angle.key_times()).copied();
    let mut times: Vec<f64> = if camera.stands() { vec![0.0] } else { times.chain(keys).collect() };
    times.sort_by(f64::total_cmp);
    let across = flat(scene);
    // A plane scene is fitted where a position that stands says no width.
    let moves = camera.position.as_ref().is_some_and(|position| !position.is_constant());
    type Fault<'a> = &'a dyn Fn(&Sight, &str) -> Option<String>;
    let faults: [(&str, Fault<'_>); 4] = [
        ("position", &|sight, at| infinite(sight.position?, at)),
        ("target", &|sight, at| infinite(sight.target?, at)),
        ("view_angle", &|sight, at| angle(sight.view_angle, at)),
        ("position", &|sight, at| match across {
            Some(axis) => within(sight, axis, at).filter(|_| moves),
            None => together(sight, at),
        }),
    ];
    let mut issues: Vec<Issue> = Vec::new();
    for (key, fault) in faults {
        let path = format!("camera.{key}");
        let at = |t: f64| if camera.stands() { String::new() } else { format!(" at t = {} s", plain(t)) };
        let found = times.iter().find_map(|t| fault(&camera.at(*t), &at(*t)));
        if let Some(message) = found.filter(|_| issues.iter().all(|issue| issue.path != path)) {
            issues.push(Issue::new(path, message));
        }
    }
    issues
}

fn infinite(point: [f64; 3], at: &str) -> Option<String> {
    (!Vec3::from(point).norm_sq().is_finite()).then(|| format!("{}{at}, expected finite numbers", shown(point)))
}

fn angle(degrees: f64, at: &str) -> Option<String> {
    let fits = degrees > 0.0 && degrees < WIDEST;
    (!fits).then(|| format!("{} °{at}, expected > 0 and < {WIDEST} °", plain(degrees)))
}

/// Of a plane scene: a camera at no distance from it, which says how much of it is seen.
fn within(sight: &Sight, axis: usize, at: &str) -> Option<String> {
    let (position, target) = (sight.position?, sight.target.unwrap_or_default());
    let name = ["x", "y", "z"][axis];
    let message = || format!("{}{at}, expected a {name} other than {}, that of what is seen", shown(position), plain(target[axis]));
    (position[axis] == target[axis]).then(message)
}

/// A camera at its target.
fn together(sight: &Sight, at: &str) -> Option<String> {
    let (position, target) = (sight.position?, sight.target?);
    let (a, b) = (Vec3::from(position), Vec3::from(target));
    let close = (b - a).norm() <= NONE * (a.norm() + b.norm());
    close.then(|| format!("{}{at}, which is the target, too; a camera looks from one point at another: keep them apart", shown(position)))
}

fn shown([x, y, z]: [f64; 3]) -> String {
    format!("[{}, {}, {}]", plain(x), plain(y), plain(z))
}
