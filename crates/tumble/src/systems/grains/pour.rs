//! Grains that are poured in: the k-th is due at start + k/rate, and born where and when there is room.                  (grains.12)
//!
//! They are born at the end of an interval, where one that left the source when it was due has fallen to. All that they are born with is a function of
//! seed, name, number and how often a place has been sought.

use super::bed::Bed;
use super::list::{Four, point};
use super::walls::Walls;
use super::{Grains, Object};
use crate::geometry::{Sampler, Vector};
use crate::math::Random;
use tumble_interface::scene::Emit;

/// Part of a grain by which a count may be off by rounding.
const ROUNDING: f64 = 1e-6;
/// Places that are tried for a grain in an interval.
const TRIES: u32 = 16;
/// Purposes of random numbers.
const AGE: u32 = 3;
const PLACE: u32 = 1 << 16;

/// How an object's grains are poured in.
pub struct Pour {
    words: Emit,
    place: Sampler,
    random: Random,
    /// How many have been born.
    pub born: u32,
    /// Intervals that have sought places.
    pub sought: u32,
}

/// A grain that seeks a place at the end of an interval.
struct Birth {
    x: Vector,
    v: Vector,
    radius: f64,
}

impl Pour {
    /// None born yet.
    pub fn new(words: Emit, place: Sampler, random: Random) -> Self {
        Self { words, place, random, born: 0, sought: 0 }
    }

    /// How many should have been born by the time t [s].
    pub fn due(&self, t: f64) -> u32 {
        let Emit { rate, count, start, end, .. } = self.words;
        let until = t.min(end.unwrap_or(f64::INFINITY));
        (rate * (until - start) + ROUNDING).clamp(0.0, f64::from(count)) as u32
    }

    /// How many are to be born.
    pub fn count(&self) -> u32 {
        self.words.count
    }

    /// Where the next grain would be at the time t, the end of an interval of dt [s], by one of its tries.
    fn try_at(&self, tried: u32, (t, dt): (f64, f64), radius: f64, gravity: Vector) -> Birth {
        let Emit { rate, start, velocity, .. } = self.words;
        let draw = |purpose: u32| self.random.uniform(u64::from(self.born), self.sought.wrapping_mul(TRIES) + tried, purpose);
        let age = t - (start + f64::from(self.born + 1) / rate);
        // One that has waited leaves the source at any time of the interval.
        let age = if age > dt { dt * draw(AGE)[0] } else { age.max(0.0) };
        let velocity = Vector::from(velocity);
        Birth {
            x: self.place.sample(&|k| draw(PLACE + k)).0 + velocity * age + gravity * (0.5 * age * age),
            v: velocity + gravity * age,
            radius,
        }
    }
}

impl Grains {
    /// Takes in those that are due by the time t, the end of an interval of dt [s], and find room.
    pub(super) fn pour(&mut self, t: f64, dt: f64) {
        let Self { settings, objects, bed, walls, known, .. } = self;
        let gravity = Vector::from(settings.gravity.at(t));
        for Object { grains, pour, .. } in objects {
            let Some(pour) = pour else { continue };
            let due = pour.due(t);
            if pour.born >= due {
                continue;
            }
            let first = grains.end - pour.count() as usize;
            while pour.born < due {
                let grain = first + pour.born as usize;
                let [radius, inverse, kind] = known[grain];
                let fits = |birth: &Birth| has_room(bed, walls, birth, t);
                let Some(Birth { x, v, .. }) = (0..TRIES).map(|k| pour.try_at(k, (t, dt), radius, gravity)).find(fits) else { break };
                bed.x.push([x.x, x.y, x.z, radius]);
                bed.v.push([v.x, v.y, v.z, inverse]);
                bed.w.push([0.0, 0.0, 0.0, kind]);
                bed.grain.push(grain as u32);
                pour.born += 1;
            }
            pour.sought = pour.sought.wrapping_add(1);
        }
    }
}

/// Whether no other grain and no solid is where one is to be born.
fn has_room(bed: &Bed, walls: &Walls, birth: &Birth, t: f64) -> bool {
    let Birth { x, radius, .. } = *birth;
    let apart = |other: &Four| (point(other) - x).norm_sq() >= (other[3] + radius) * (other[3] + radius);
    let mut free = bed.x.iter().all(apart);
    for surface in 0..walls.surfaces() {
        if free {
            walls.each_near(surface, x, t, (radius, true), |distance, _| free &= distance >= radius);
        }
    }
    free
}
