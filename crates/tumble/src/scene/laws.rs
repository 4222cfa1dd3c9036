//! From the words of forces and fields to laws: formulas are read, and what is wrong with them is told.

use crate::forces::{
    Acceleration, Air, Attraction, Current, Drag, Electric, Flow, Force, InPlane, Magnetic, Medium, OnGrid, Propulsion, Turbulence, Vortex,
    Wind,
};
use crate::geometry::Friction;
use crate::math::formula::Of;
use crate::math::{Signal, Vec3, VectorSignal};
use std::sync::Arc;
use tumble_interface::Issue;
use tumble_interface::check::plain;
use tumble_interface::scene::{Animated, AnimatedVector, Collider, Field, Force as Words, Plane, Scene};

/// Times at which a value that changes is tried, at most.
const TRIALS: u32 = 1000;

/// Times between two of them at which a largest value is looked for.
const FINER: u32 = 7;

/// Reads values that may change in time, and gathers what is wrong with them.
pub struct Reader<'a> {
    /// What is wrong.
    pub issues: &'a mut Vec<Issue>,
    /// Times of the run [s].
    times: Vec<f64>,
    flat: Option<usize>,
    /// Seed of the scene.
    pub seed: u32,
}

impl<'a> Reader<'a> {
    /// For a scene.
    pub fn new(scene: &Scene, issues: &'a mut Vec<Issue>) -> Self {
        let frames = scene.time.frames;
        let times = (0..=TRIALS.min(frames)).map(|i| f64::from(i) * f64::from(frames) / f64::from(TRIALS.min(frames)));
        Self { issues, times: times.map(|i| i * scene.frame_time()).collect(), flat: flat(scene), seed: scene.seed }
    }

    /// A number, which must be at least `least` and finite during the run.
    pub fn signal(&mut self, path: &str, words: &Animated, least: f64) -> Signal {
        self.signal_within(path, words, [least, f64::INFINITY])
    }

    /// The same, at most `most`.
    pub fn signal_within(&mut self, path: &str, words: &Animated, [least, most]: [f64; 2]) -> Signal {
        let expected = match (least.is_finite(), most.is_finite()) {
            (true, true) => format!("{least} to {most}"),
            (true, false) => format!(">= {least}"),
            _ => "a finite number".into(),
        };
        self.signal_that(path, words, &expected, |value| value >= least && value <= most)
    }

    /// The same, greater than 0.
    pub fn positive(&mut self, path: &str, words: &Animated) -> Signal {
        self.signal_that(path, words, "> 0", |value| value > 0.0)
    }

    /// A number of which something holds at every time, besides that it is finite.
    fn signal_that(&mut self, path: &str, words: &Animated, expected: &str, holds: impl Fn(f64) -> bool) -> Signal {
        let signal = match Signal::new(words) {
            Ok(signal) => signal,
            Err(message) => return self.wrong(path, message).into(),
        };
        let tried = if signal.is_constant() { &self.times[..1] } else { &self.times[..] };
        let tried = tried.iter().chain(signal.key_times());
        let bad = tried.map(|t| (*t, signal.value(*t))).find(|(_, value)| !value.is_finite() || !holds(*value));
        if let Some((t, value)) = bad {
            let at = if signal.is_constant() { String::new() } else { format!(" at t = {} s", plain(t)) };
            self.wrong(path, format!("{}{at}, expected {expected}", plain(value)));
        }
        signal
    }

    /// A vector; finite during the run where it is a function of time alone.
    pub fn vector(&mut self, path: &str, words: &AnimatedVector, of: Of) -> VectorSignal {
        let signal = match VectorSignal::new(words, of) {
            Ok(signal) => signal,
            Err(message) => {
                self.wrong(path, message);
                return [0.0; 3].into();
            }
        };
        if signal.is_uniform() {
            let bad = self.times.iter().map(|t| (*t, signal.value(*t))).find(|(_, v)| !v.norm_sq().is_finite());
            if let Some((t, v)) = bad {
                let finite = [v.x, v.y, v.z].iter().all(|c| c.is_finite());
                let expected = if finite { "a length below 1e154" } else { "finite numbers" };
                let at = if signal.is_constant() { String::new() } else { format!(" at t = {} s", plain(t)) };
                self.wrong(path, format!("[{}, {}, {}]{at}, expected {expected}", plain(v.x), plain(v.y), plain(v.z)));
            }
        }
        signal
    }

    /// A colour, 0 to 1.
    pub fn color(&mut self, path: &str, words: &AnimatedVector) -> VectorSignal {
        let signal = self.vector(path, words, Of::Time);
        let tried = self.times.iter().chain(signal.key_times());
        let bad = tried.map(|t| (*t, <[f64; 3]>::from(signal.value(*t)))).find(|(_, rgb)| rgb.iter().any(|c| !(0.0..=1.0).contains(c)));
        if let Some((t, [x, y, z])) = bad.filter(|(_, rgb)| rgb.iter().all(|c| c.is_finite())) {
            let at = if signal.is_constant() { String::new() } else { format!(" at t = {} s", plain(t)) };
            self.wrong(path, format!("[{}, {}, {}]{at}, expected numbers from 0 to 1", plain(x), plain(y), plain(z)));
        }
        signal
    }

    /// A vector of time alone, which must lie in the plane of a scene of dimension 2.
    pub fn in_plane(&mut self, path: &str, words: &AnimatedVector) -> VectorSignal {
        let signal = self.vector(path, words, Of::Time);
        if let Some(axis) = self.flat {
            let bad = self.times.iter().map(|t| <[f64; 3]>::from(signal.value(*t))[axis]).find(|c| *c != 0.0);
            if let Some(c) = bad {
                self.wrong(path, off_plane(axis, c));
            }
        }
        signal
    }

    fn direction(&mut self, path: &str, axis: [f64; 3]) -> Vec3<f64> {
        if axis == [0.0; 3] {
            self.wrong(path, "[0, 0, 0], expected a direction".into());
            return [0.0, 0.0, 1.0].into();
        }
        Vec3::from(axis).tamed().normalized()
    }

    fn wrong(&mut self, path: &str, message: String) -> f64 {
        let issue = Issue::new(path, message);
        if !self.issues.contains(&issue) {
            self.issues.push(issue);
        }
        0.0
    }

    /// The law of a force on each mass by itself; `None` for a force between masses.
    pub fn law(&mut self, path: &str, words: &Words) -> Option<Box<dyn Force>> {
        let at = |key: &str| format!("{path}.{key}");
        const ANY: f64 = f64::NEG_INFINITY;
        let law: Box<dyn Force> = match words {
            Words::Gravitation { .. }
            | Words::Electrostatics { .. }
            | Words::LennardJones { .. }
            | Words::Repulsion { .. }
            | Words::Cohesion { .. }
            | Words::Viscosity { .. }
            | Words::Flock { .. }
            | Words::Air { .. } => return None,
            Words::Drag { coefficient, rate, quadratic, .. } => Box::new(self.medium(path, [coefficient, rate, quadratic])),
            Words::Wind { coefficient, rate, quadratic, air, .. } => {
                Box::new(Wind { drag: self.medium(path, [coefficient, rate, quadratic]), air: self.flow(&at("air"), air) })
            }
            Words::Attraction { center, gm, power, softening, radius, .. } => Box::new(Attraction {
                center: self.vector(&at("center"), center, Of::Time),
                gm: self.signal(&at("gm"), gm, ANY),
                power: *power,
                softening: *softening,
                radius: radius.unwrap_or(f64::INFINITY),
            }),
            Words::Acceleration { value, .. } => Box::new(Acceleration(self.vector(&at("value"), value, Of::Motion))),
            Words::Magnetic { field, .. } => Box::new(Magnetic(self.vector(&at("field"), field, Of::Place))),
            Words::Electric { field, .. } => Box::new(Electric(self.vector(&at("field"), field, Of::Place))),
            Words::Vortex { center, axis, core, swirl, inward, lift, .. } => {
                Box::new(self.vortex(path, center, *axis, *core, [swirl, inward, lift]))
            }
            Words::Turbulence { strength, scale, octaves, roughness, rate, seed, .. } => {
                Box::new(self.turbulence(path, strength, [*scale, *roughness, *rate], *octaves, *seed))
            }
            Words::Propulsion { thrust, speed, time, .. } => Box::new(Propulsion {
                thrust: self.signal(&at("thrust"), thrust, ANY),
                speed: speed.as_ref().map(|speed| self.signal(&at("speed"), speed, 0.0)),
                time: *time,
            }),
        };
        Some(match self.flat {
            Some(axis) => Box::new(InPlane { law, axis }),
            None => law,
        })
    }

    /// The law of a force on surfaces; `None` for any other.
    pub fn air(&mut self, path: &str, words: &Words) -> Option<Air> {
        let Words::Air { density, drag, lift, friction, wind, .. } = words else { return None };
        let flow = self.flow(&format!("{path}.wind"), wind);
        Some(Air { density: *density, drag: *drag, lift: *lift, friction: *friction, flow })
    }

    /// Times of the run at which what changes is tried [s].
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Friction of a collider, and its course in time if it has one.
    pub fn friction(&mut self, thing: &Collider) -> (Friction, Option<Arc<[Signal; 2]>>) {
        let path = |key: &str| format!("collider \"{}\".{key}", thing.name);
        let sliding = self.signal(&path("friction"), &thing.friction, 0.0);
        let still = thing.friction_static.as_ref().map(|words| self.signal(&path("friction_static"), words, 0.0));
        let resting = still.unwrap_or_else(|| sliding.clone());
        if let Some(t) = self.times.iter().copied().find(|t| resting.value(*t) < sliding.value(*t)) {
            let at = if sliding.is_constant() && resting.is_constant() { String::new() } else { format!(" at t = {} s", plain(t)) };
            let message = format!("{}{at}, expected >= {}, the friction of what slides", plain(resting.value(t)), plain(sliding.value(t)));
            self.wrong(&path("friction_static"), message);
        }
        let friction = Friction { sliding: sliding.value(0.0), resting: resting.value(0.0) };
        let changes = !(sliding.is_constant() && resting.is_constant());
        (friction, changes.then(|| Arc::new([sliding, resting])))
    }

    fn medium(&mut self, path: &str, words: [&Animated; 3]) -> Medium {
        let mut read = |key: &str, words| self.signal(&format!("{path}.{key}"), words, 0.0);
        let [coefficient, rate, quadratic] =
            [("coefficient", words[0]), ("rate", words[1]), ("quadratic", words[2])].map(|(key, words)| read(key, words));
        let [c, r, q] = [&coefficient, &rate, &quadratic].map(|signal| self.largest(|t| signal.value(t), signal.key_times()));
        let largest = Drag { coefficient: c, rate: r, quadratic: q };
        Medium { coefficient, rate, quadratic, largest }
    }

    /// The largest value of a function of time during the run, tried between frames, too, and at keys [s].
    pub fn largest(&self, value: impl Fn(f64) -> f64, keys: &[f64]) -> f64 {
        let between =
            |pair: &[f64]| (0..FINER).map(|k| pair[0] + (pair[1] - pair[0]) * f64::from(k) / f64::from(FINER)).collect::<Vec<_>>();
        let tried = self.times.windows(2).flat_map(between).chain(self.times.last().copied()).chain(keys.iter().copied());
        tried.map(value).fold(0.0, f64::max)
    }

    fn vortex(&mut self, path: &str, center: &AnimatedVector, axis: [f64; 3], core: f64, values: [&Animated; 3]) -> Vortex {
        let center = self.vector(&format!("{path}.center"), center, Of::Time);
        let axis = self.direction(&format!("{path}.axis"), axis);
        let mut read = |key: &str, words| self.signal(&format!("{path}.{key}"), words, f64::NEG_INFINITY);
        let [swirl, inward, lift] = [("swirl", values[0]), ("inward", values[1]), ("lift", values[2])].map(|(key, words)| read(key, words));
        Vortex { center, axis, core, swirl, inward, lift }
    }

    fn turbulence(&mut self, path: &str, strength: &Animated, numbers: [f64; 3], octaves: u32, seed: u32) -> Turbulence {
        let [scale, roughness, rate] = numbers;
        let strength = self.signal(&format!("{path}.strength"), strength, f64::NEG_INFINITY);
        let seed = seed.wrapping_mul(0x27D4_EB2F).wrapping_add(self.seed);
        Turbulence { strength, scale, octaves, roughness, rate, seed, flat: self.flat }
    }

    /// The sum of velocity fields; `path` is that of the list.
    pub fn flow(&mut self, path: &str, fields: &[Field]) -> Flow {
        let fields = fields.iter().enumerate().map(|(i, field)| self.field(&format!("{path}[{i}]"), field)).collect();
        Flow { fields, flat: self.flat }
    }

    fn field(&mut self, path: &str, field: &Field) -> Current {
        let at = |key: &str| format!("{path}.{key}");
        const ANY: f64 = f64::NEG_INFINITY;
        match field {
            Field::Uniform { velocity } => Current::Uniform(self.vector(&at("velocity"), velocity, Of::Time)),
            Field::Swirl { center, axis, rate } => Current::Swirl {
                center: (*center).into(),
                axis: self.direction(&at("axis"), *axis),
                rate: self.signal(&at("rate"), rate, ANY),
            },
            Field::Sink { center, rate } => Current::Sink { center: (*center).into(), rate: self.signal(&at("rate"), rate, ANY) },
            Field::Vortex { center, axis, core, swirl, inward, lift } => {
                Current::Vortex(self.vortex(path, center, *axis, *core, [swirl, inward, lift]))
            }
            Field::Turbulence { strength, scale, octaves, roughness, rate, seed } => {
                Current::Turbulence(self.turbulence(path, strength, [*scale, *roughness, *rate], *octaves, *seed))
            }
            Field::Gas { of } => {
                if !path.starts_with("field[") {
                    self.issues.push(Issue::new(path, "a gas, which carries tracers alone; take another kind of field"));
                }
                Current::OnGrid(OnGrid { fluid: of.clone(), states: Vec::new() })
            }
            Field::Formula { velocity } => Current::Formula(self.vector(&at("velocity"), velocity, Of::Place)),
        }
    }
}

/// What is wrong with a vector that has this component along the axis that is missing.
pub fn off_plane(axis: usize, component: f64) -> String {
    format!("{} = {}, expected 0 in a scene of dimension 2", ["x", "y", "z"][axis], plain(component))
}

/// The axis across the plane of a scene of dimension 2.
pub fn flat(scene: &Scene) -> Option<usize> {
    (scene.dimension == 2).then(|| if scene.plane == Plane::Xz { 1 } else { 2 })
}
