//! When and where particles are born, with what they are born, and of what they die. Every number that a particle is born
//! with is a function of the scene's seed, the emitter's name and the particle's id, so that nothing of it needs storing.

use crate::exchange::{Event, Happening};
use crate::geometry::{Collider, Sampler, Vector, sampling};
use crate::math::parallel::fold;
use crate::math::{Random, Real, Row, Signal, VectorSignal, xyz64};
use tumble_interface::scene::{Between, Cause, Emitter as Words, Event as At, Source, WhenFull};

/// Purposes of random numbers: time of birth, mass, radius and colour; direction and speed; custom columns; position. The lifetime has a fast
/// generator of its own.
const MOMENT: u32 = 0;
const MOTION: u32 = 1;
const LIFETIME: u32 = 0;
const COLUMNS: u32 = 2;
const PLACE: u32 = 1 << 16;

/// Part of a particle by which a count may be off by rounding.
const ROUNDING: f64 = 1e-6;
/// The same for children, whose moments go by ages in the engine's scalar.
const BY_AGE: f64 = 1e-3;
/// Of an interval: what ages may have lost by rounding, at most.
const SLACK: f64 = 0.25;

/// Source of an emitter's particles.
pub enum Origin {
    /// A place in space.
    Place(Sampler),
    /// The particles of the emitter with this index.
    Particles(usize),
    /// The particles of an emitter of this name in another system.
    Elsewhere(String),
}

/// A rule by which particles die.
pub enum Kill {
    /// Inside a solid.
    Inside(Collider),
    /// Outside a solid.
    Outside(Collider),
    /// Nearer to a collider than this [m].
    NearCollider(f64),
    /// Slower than this [m/s].
    SlowerThan(f64),
    /// Faster than this [m/s].
    FasterThan(f64),
}

/// Whether a point is nearer to a collider than a distance [m].
pub type Near<'a> = dyn Fn(Vector, f64) -> bool + Sync + 'a;

/// Time-dependent settings of an emitter.
pub struct Course {
    /// Particles a second.
    pub rate: Signal,
    /// Velocity that all get [m/s].
    pub velocity: VectorSignal,
    /// Speed along the direction [m/s].
    pub speed: Signal,
    /// Half-angle of the cone of directions [°].
    pub cone: Signal,
    /// Way of the source [m].
    pub path: VectorSignal,
    /// Age at which those born at a time die [s]; never, if it is missing.
    pub lifetime: Option<Signal>,
    /// Radius in pictures of those born at a time [m].
    pub radius: Signal,
    /// Colour of those born at a time, another up to which it lies at random, and that at the end of life.
    pub colors: [Option<VectorSignal>; 3],
    /// When the scene ends [s].
    pub end: f64,
}

/// A source of particles.
pub struct Emitter {
    words: Words,
    course: Course,
    random: Random,
    /// Their source.
    pub from: Origin,
    kill: Vec<Kill>,
    /// Direction that counts as up.
    up: Vector,
    /// The axis that is missing in two dimensions.
    flat: Option<usize>,
}

/// A particle that has just been born.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Birth {
    /// When [s].
    pub time: f64,
    /// Position [m].
    pub x: Vector,
    /// How fast [m/s].
    pub v: Vector,
    /// Identity.
    pub id: u32,
}

/// A particle that others are born from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parent {
    /// Time at which the others hold [s].
    pub time: f64,
    /// Position [m].
    pub x: Vector,
    /// Velocity [m/s].
    pub v: Vector,
    /// Direction that counts as out of it: that of its velocity, or off what it bounces from.
    pub normal: Vector,
    /// Age [s].
    pub age: f64,
    /// Age when the exchange interval began [s]; negative for one born in it.
    pub before: f64,
}

impl Parent {
    /// The particle of an event.
    pub fn of(event: &Event) -> Self {
        let Event { time, position: x, velocity: v, normal, age, .. } = *event;
        Self { time, x, v, normal, age, before: 0.0 }
    }

    /// What has happened to it, under this id.
    pub fn event(&self, id: u32, what: Happening) -> Event {
        let Self { time, x, v, normal, age, .. } = *self;
        Event { what, id, time, position: x, velocity: v, normal, age }
    }
}

/// A number between c (1 - spread) and c (1 + spread), where u in [0, 1) says.
fn spread(c: f64, spread: f64, u: impl FnOnce() -> f64) -> f64 {
    if spread == 0.0 { c } else { c * (1.0 + spread * (2.0 * u() - 1.0)) }
}

impl Emitter {
    /// An emitter of a scene, with what its words stand for.
    pub fn new(words: Words, course: Course, seed: u32, from: Origin, kill: Vec<Kill>, up: Vector, flat: Option<usize>) -> Self {
        let words = Words { direction: words.direction.map(|d| Vector::from(d).tamed().into()), ..words };
        Self { random: Random::new(seed, &words.name), words, course, from, kill, up, flat }
    }

    /// Its settings in the scene.
    pub fn words(&self) -> &Words {
        &self.words
    }

    /// That it can bear no more, as an error's text.
    pub fn full(&self) -> String {
        let Words { name, most, .. } = &self.words;
        match most {
            Some(most) => format!("emitter \"{name}\" is full: {most} particles live; raise most, or set when_full = \"wait\""),
            None => format!("emitter \"{name}\" has given out all of its 4294967295 ids"),
        }
    }

    /// About how many will live at once.
    pub fn expected(&self) -> usize {
        let rate = if self.course.rate.is_constant() { self.course.rate.value(0.0) } else { 0.0 };
        // If the lifetime exceeds the scene, fewer particles exist than lifetime times rate.
        let lifetime = self.course.lifetime.as_ref().filter(|lifetime| lifetime.is_constant()).map_or(0.0, |lifetime| lifetime.value(0.0));
        let life = (lifetime * (1.0 + self.words.lifetime_spread)).min(self.course.end);
        let bursts: f64 = self.words.burst.iter().map(|b| f64::from(b.count)).sum();
        (1.05 * rate * life + bursts).min(4e9) as usize
    }

    /// Whether the oldest make room where it is full.
    pub fn replaces(&self) -> bool {
        self.words.when_full == WhenFull::ReplaceOldest
    }

    /// Whether the living bear children.
    pub fn has_rate(&self) -> bool {
        !self.course.rate.is_constant() || self.course.rate.value(0.0) > 0.0
    }

    /// Users' columns and their ranges.
    pub fn columns(&self) -> impl Iterator<Item = (&String, &Between)> {
        self.words.columns.iter()
    }

    /// Particles alive at most.
    pub fn most(&self) -> Option<usize> {
        self.words.most.map(|most| most as usize)
    }

    /// How many more may be born where `len` live; `None` if it is full and that is an error.
    pub fn room(&self, len: usize) -> Option<Room> {
        Some(match (self.most(), self.words.when_full) {
            (None, _) | (_, WhenFull::ReplaceOldest) => Room { most: self.most().unwrap_or(usize::MAX), error: false },
            (Some(most), full) => Room { most: most.saturating_sub(len), error: full == WhenFull::Error },
        })
    }

    /// Mass of a particle [kg].
    pub fn mass(&self, id: u32) -> f64 {
        spread(self.words.mass, self.words.mass_spread, || self.draw(id, MOMENT)[1])
    }

    /// Whether what particles have depends on when they were born.
    pub fn heeds_birth(&self) -> bool {
        let Course { lifetime, radius, colors, .. } = &self.course;
        !radius.is_constant() || lifetime.iter().any(|l| !l.is_constant()) || colors.iter().flatten().any(|c| !c.is_constant())
    }

    /// Radius in pictures of a particle that was born at a time [s] [m].
    pub fn radius(&self, id: u32, born: f64) -> f64 {
        spread(self.course.radius.value(born), self.words.radius_spread, || self.draw(id, MOMENT)[2])
    }

    /// Radius of the first, but for its spread [m].
    pub fn first_radius(&self) -> f64 {
        self.course.radius.value(self.words.start)
    }

    /// Whether each has a radius of its own.
    pub fn has_radii(&self) -> bool {
        self.words.radius_spread > 0.0 || !self.course.radius.is_constant()
    }

    /// Whether each has a colour of its own.
    pub fn has_colors(&self) -> bool {
        let [color, others @ ..] = &self.course.colors;
        color.as_ref().is_some_and(|color| !color.is_constant() || others.iter().any(Option::is_some))
    }

    /// Whether each has a mass of its own.
    pub fn has_masses(&self) -> bool {
        self.words.mass_spread > 0.0
    }

    /// Age at which a particle that was born at a time [s] dies [s].
    pub fn lifetime(&self, id: u32, born: f64) -> f64 {
        let Some(lifetime) = &self.course.lifetime else { return f64::INFINITY };
        spread(lifetime.value(born), self.words.lifetime_spread, || self.random.quick(id, LIFETIME))
    }

    /// Colour at an age [s] of a particle that was born at a time [s]; `None` if the emitter has none.
    pub fn color(&self, id: u32, born: f64, age: f64) -> Option<[f64; 3]> {
        let [color, to, end] = self.course.colors.each_ref().map(|color| color.as_ref().map(|color| <[f64; 3]>::from(color.value(born))));
        let mix = |a: [f64; 3], b: [f64; 3], t: f64| std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t);
        let color = color?;
        let own = to.map_or(color, |to| mix(color, to, self.draw(id, MOMENT)[3]));
        Some(end.map_or(own, |end| mix(own, end, (age / self.lifetime(id, born)).clamp(0.0, 1.0))))
    }

    /// A number of a user's column, 0 if there is no such column.
    pub fn number(&self, name: &str, id: u32) -> f64 {
        let Some((k, (_, between))) = self.columns().enumerate().find(|(_, (known, _))| *known == name) else { return 0.0 };
        let u = self.draw(id, COLUMNS + k as u32 / 4)[k % 4];
        between.from + (between.to.unwrap_or(between.from) - between.from) * u
    }

    /// Whether no one ever dies.
    pub fn is_immortal(&self) -> bool {
        self.words.lifetime.is_none() && self.kill.is_empty()
    }

    /// The age [s] below which no one dies, intervals being dt [s] long.
    pub fn safe_until(&self, dt: f64) -> f64 {
        if self.kill.is_empty() { self.youngest() - SLACK * dt } else { f64::NEG_INFINITY }
    }

    /// The age at which the first may die, if no rule kills them before.
    fn youngest(&self) -> f64 {
        let least = |lifetime: &Signal| if lifetime.is_constant() { lifetime.value(0.0) } else { 0.0 };
        self.course.lifetime.as_ref().map_or(f64::INFINITY, least) * (1.0 - self.words.lifetime_spread)
    }

    /// Whether what happens to a parent makes a burst.
    pub fn is_stirred_by(&self, what: Happening) -> bool {
        match (&self.words.from, what) {
            (Source::Particles { at: At::Death, cause, .. }, Happening::Death(death)) => cause.is_empty() || cause.contains(&death),
            (Source::Particles { at, .. }, Happening::Contact) => *at == At::Bounce,
            _ => false,
        }
    }

    /// Cause of death of a particle, with the time of its birth and its age [s], at time t, the end of an interval of length dt [s]; `None` if it
    /// survives.
    #[inline]
    pub fn dies(&self, (t, dt): (f64, f64), (id, born, age): (u32, f64, f64), (x, v): (Row, Row), near: &Near<'_>) -> Option<Cause> {
        // Possible rounding error of a sum of intervals.
        let age = age + (age * age * (f64::from(Real::EPSILON) / dt)).min(SLACK * dt);
        if age >= self.youngest() && age >= self.lifetime(id, born) {
            return Some(Cause::Lifetime);
        }
        self.kill.iter().find_map(|rule| {
            let (holds, cause) = match rule {
                Kill::Inside(solid) => (solid.distance(xyz64(x), t, 0.0).0 < 0.0, Cause::Inside),
                Kill::Outside(solid) => (solid.distance(xyz64(x), t, 0.0).0 > 0.0, Cause::Outside),
                Kill::NearCollider(distance) => (near(xyz64(x), *distance), Cause::NearCollider),
                Kill::SlowerThan(speed) => (xyz64(v).norm_sq() < speed * speed, Cause::SlowerThan),
                Kill::FasterThan(speed) => (xyz64(v).norm_sq() > speed * speed, Cause::FasterThan),
            };
            holds.then_some(cause)
        })
    }

    fn draw(&self, id: u32, purpose: u32) -> [f64; 4] {
        self.random.uniform(u64::from(id), 0, purpose)
    }

    /// Particles that the rate has made by the time t + dt [s], a real number, if it was `before` at t. A constant rate is
    /// taken from the start.
    pub fn flow(&self, before: f64, t: f64, dt: f64) -> f64 {
        let (start, end) = (self.words.start, self.words.end.unwrap_or(f64::INFINITY));
        let (a, b) = (t.clamp(start, end), (t + dt).clamp(start, end));
        let rate = &self.course.rate;
        if rate.is_constant() { rate.integral(start, b) } else { before + rate.integral(a, b).max(0.0) }
    }

    /// Those born in (t, t + dt] [s] while the flow goes from `before` to `after`, ids from `next` on.
    pub fn births(&self, (t, dt): (f64, f64), (before, after): (f64, f64), next: u64, room: Room) -> Option<Vec<Birth>> {
        let Origin::Place(place) = &self.from else { return Some(Vec::new()) };
        let first = (before + ROUNDING).floor();
        let count = (after + ROUNDING).floor() - first;
        if count.is_nan() || next as f64 + count > f64::from(u32::MAX) {
            return None;
        }
        let count = count as usize;
        let jitter = self.words.jitter;
        // Moments within the interval, from 0 to 1; where the rate begins or ends within it, the flow says when.
        let (begin, end) = (self.words.start.clamp(t, t + dt), self.words.end.unwrap_or(f64::INFINITY).clamp(t, t + dt));
        let mut moments: Vec<f64> = (0..room.take(count)?)
            .map(|k| {
                let even = ((first + k as f64 + 1.0 - before) / (after - before)).clamp(0.0, 1.0);
                let any = if jitter > 0.0 { self.draw((next + k as u64) as u32, MOMENT)[0] } else { even };
                begin + (end - begin) * (even + (any - even) * jitter)
            })
            .collect();
        // A moment belongs to the interval that it ends.
        let slack = 1e-9 * dt;
        for burst in self.words.burst.iter().filter(|b| b.time > t + slack && b.time <= t + dt + slack) {
            let left = Room { most: room.most - moments.len(), ..room };
            moments.resize(moments.len() + left.take(burst.count as usize)?, burst.time.min(t + dt));
        }
        moments.sort_by(f64::total_cmp);
        self.bear(next, moments.len(), |k, id| {
            let (x, normal) = place.sample(&|k| self.draw(id, PLACE + k));
            let (shift, motion) = self.source(moments[k]);
            Birth { time: moments[k], x: x + shift, v: self.velocity(moments[k], id, normal, motion), id }
        })
    }

    /// When and where one of n may be born before the end of the run [s], to look at beforehand.
    pub fn trial(&self, k: usize, n: usize, end: f64) -> Option<(f64, Vector)> {
        let Origin::Place(place) = &self.from else { return None };
        let (start, bursts) = (self.words.start, &self.words.burst);
        let by_rate = start + (self.words.end.unwrap_or(end).min(end) - start).max(0.0) * k as f64 / n as f64;
        let by_burst = bursts.get(k / 2 % bursts.len().max(1)).filter(|b| b.count > 0).map(|b| b.time);
        let t = if k % 2 == 1 && by_burst.is_some() || self.course.rate.value(by_rate) <= 0.0 { by_burst? } else { by_rate };
        let x = place.sample(&|c| self.draw(k as u32, PLACE + c)).0 + self.course.path.value(t);
        Some((t, self.flat.map_or(x, |axis| flattened(x, axis, false)))).filter(|_| t <= end)
    }

    /// Those born at once of parents that died or bounced.
    pub fn bursts(&self, of: &[Parent], next: u64, room: Room) -> Option<Vec<Birth>> {
        let each: usize = self.words.burst.iter().map(|b| b.count as usize).sum();
        self.bear(next, room.take(of.len() * each)?, |k, id| {
            let parent = of[k / each];
            Birth { time: parent.time, x: parent.x, v: self.velocity(parent.time, id, parent.normal, parent.v), id }
        })
    }

    /// Those born of the living in an exchange interval: child k of a parent at its age k/rate.
    pub fn children(&self, living: &[Parent], next: u64, room: Room) -> Option<Vec<Birth>> {
        let rate = self.course.rate.value(0.0);
        let within = |p: &Parent, k: f64| {
            let time = p.time - p.age + k / rate;
            time >= self.words.start && self.words.end.is_none_or(|end| time <= end)
        };
        let mut due = Vec::new();
        for (i, parent) in living.iter().enumerate() {
            let first = (parent.before.max(0.0) * rate + BY_AGE).floor() + 1.0;
            let last = (parent.age * rate + BY_AGE).floor();
            let count = (last - first + 1.0).max(0.0) as u64;
            due.extend((0..count).map(|k| (i, first + k as f64)).filter(|(_, k)| within(parent, *k)));
        }
        self.bear(next, room.take(due.len())?, |j, id| {
            let (i, k) = due[j];
            let parent = living[i];
            let ago = (parent.age - k / rate).max(0.0);
            let time = parent.time - ago;
            Birth { time, x: parent.x - parent.v * ago, v: self.velocity(time, id, parent.v, parent.v), id }
        })
    }

    fn bear(&self, next: u64, count: usize, birth: impl Fn(usize, u32) -> Birth + Sync) -> Option<Vec<Birth>> {
        if next + count as u64 > u64::from(u32::MAX) {
            return None;
        }
        let one = |k: usize| {
            let mut birth = birth(k, (next + k as u64) as u32);
            if let Some(axis) = self.flat {
                (birth.x, birth.v) = (flattened(birth.x, axis, false), flattened(birth.v, axis, true));
            }
            birth
        };
        Some(fold(count, |range| range.map(one).collect::<Vec<_>>()).concat())
    }

    /// Position and velocity of the source at a time.
    fn source(&self, t: f64) -> (Vector, Vector) {
        (self.course.path.value(t), self.course.path.velocity(t))
    }

    /// The velocity of one born at time t where the source has this normal and moves with this velocity.
    fn velocity(&self, t: f64, id: u32, normal: Vector, source: Vector) -> Vector {
        let words = &self.words;
        let base = self.course.velocity.value(t) + source * words.inherit;
        let speed = self.course.speed.value(t);
        if speed == 0.0 {
            return base;
        }
        let [u, v, w, _] = self.draw(id, MOTION);
        let axis = words.direction.map_or(normal, Vector::from);
        let axis = if axis.norm_sq() > 0.0 { axis } else { self.up };
        base + sampling::about(axis, u, v, self.course.cone.value(t).to_radians()) * spread(speed, words.speed_spread, || w)
    }
}

/// Without its component along an axis; a velocity keeps its length if it can.
fn flattened(v: Vector, axis: usize, keep: bool) -> Vector {
    let mut flat: [f64; 3] = v.into();
    flat[axis] = 0.0;
    let flat = Vector::from(flat);
    if keep { flat.normalized() * v.norm() } else { flat }
}

/// How many may be born.
#[derive(Debug, Clone, Copy)]
pub struct Room {
    most: usize,
    /// Whether more than that is an error.
    error: bool,
}

impl Room {
    fn take(self, wanted: usize) -> Option<usize> {
        if wanted <= self.most { Some(wanted) } else { (!self.error).then_some(self.most) }
    }
}
