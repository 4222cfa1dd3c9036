//! Sleep: bodies that hang together and have hardly moved for a while stand still, unsolved, until something new comes near, pushes them, or what
//! bears them changes.
//!
//!   |v| + |ω| R < 0.01 sqrt(g R) for half a second                                                                   (rigid.7)

use super::contact::{Bodies, Contact};
use crate::geometry::Vector;

/// Largest speed of what falls asleep, over sqrt(g R).
const SLOW: f64 = 0.01;
/// For how long it has been that slow [s].
const WHILE: f64 = 0.5;
/// Numbers of a solid that what lies on it depends on.
const SOLID: usize = 15;

/// Which bodies sleep.
#[derive(Default)]
pub struct Sleep {
    /// Whether each body may; empty if none may.
    may: Vec<bool>,
    /// For how long each has been slow [s]; of those that sleep infinity.
    still: Vec<f64>,
    /// Gravity, friction of bodies, and all solids, in the last sub-step.
    around: Vec<f64>,
}

impl Sleep {
    /// Of bodies of which some may.
    pub fn new(may: Vec<bool>) -> Self {
        let any = may.contains(&true);
        Self { still: if any { vec![0.0; may.len()] } else { Vec::new() }, may: if any { may } else { Vec::new() }, around: Vec::new() }
    }

    /// Whether a body sleeps.
    pub fn is_asleep(&self, i: usize) -> bool {
        self.still.get(i) == Some(&f64::INFINITY)
    }

    /// Whether any does.
    pub fn any(&self) -> bool {
        self.still.contains(&f64::INFINITY)
    }

    /// Whether nothing happens between two: both sleep, or one does on a solid.
    pub fn rests(&self, pair: [u32; 2]) -> bool {
        let [a, b] = pair.map(|i| i as usize);
        self.is_asleep(a) && (self.is_asleep(b) || b >= self.still.len())
    }

    /// Wakes a body.
    pub fn wake(&mut self, i: usize) {
        if let Some(still) = self.still.get_mut(i) {
            *still = 0.0;
        }
    }

    /// Wakes all.
    pub fn wake_all(&mut self) {
        self.still.fill(0.0);
    }

    /// Wakes what touches, in these contacts, bodies that are awake: which bodies these are.
    pub fn spread(&mut self, contacts: &[Contact]) -> Vec<usize> {
        let mut woken = Vec::new();
        if !self.any() {
            return woken;
        }
        loop {
            let before = woken.len();
            for [a, b] in contacts.iter().map(|c| c.pair.map(|i| i as usize)) {
                for (one, other) in [(a, b), (b, a)] {
                    if other < self.still.len() && self.is_asleep(one) && !self.is_asleep(other) {
                        self.wake(one);
                        woken.push(one);
                    }
                }
            }
            if woken.len() == before {
                return woken;
            }
        }
    }

    /// Wakes what lies, by these contacts, on solids that have changed since the last sub-step, and all where gravity or friction has.
    pub fn look(&mut self, bodies: &Bodies, contacts: &[Contact], gravity: Vector) {
        if self.may.is_empty() {
            return;
        }
        let moving = bodies.moving;
        let mut now = vec![gravity.x, gravity.y, gravity.z];
        let own = bodies.hull[..moving].iter().max().map_or(0, |last| *last as usize + 1);
        now.extend(bodies.hulls[..own].iter().flat_map(|hull| [hull.friction.resting, hull.friction.sliding]));
        let common = now.len();
        for (i, solid) in bodies.rows.iter().enumerate().skip(moving) {
            let (hull, [x, v, w]) = (bodies.hull(i), [solid.x, solid.v, solid.w].map(<[f64; 3]>::from));
            now.extend([x, v, w].concat());
            now.extend(solid.q.row());
            now.extend([hull.friction.resting, hull.friction.sliding]);
        }
        let before = std::mem::replace(&mut self.around, now);
        if before.len() != self.around.len() || before[..common] != self.around[..common] {
            return self.wake_all();
        }
        let changed: Vec<bool> =
            before[common..].chunks_exact(SOLID).zip(self.around[common..].chunks_exact(SOLID)).map(|(a, b)| a != b).collect();
        for [a, b] in contacts.iter().map(|c| c.pair.map(|i| i as usize)) {
            if b >= moving && changed[b - moving] {
                self.wake(a);
            }
        }
        self.spread(contacts);
    }

    /// After a sub-step of h [s]: what has been slow for long enough falls asleep, with all that it touches. What joints hold does not.
    pub fn rest(&mut self, bodies: &mut Bodies, contacts: &[Contact], held: impl Iterator<Item = u32>, gravity: Vector, h: f64) {
        if self.may.is_empty() {
            return;
        }
        let moving = bodies.moving;
        for i in 0..moving {
            let (body, reach) = (&bodies.rows[i], bodies.hull(i).reach);
            let slow = body.v.norm() + body.w.norm() * reach < SLOW * (gravity.norm() * reach).sqrt();
            self.still[i] = if self.may[i] && slow && bodies.is_there(i) { self.still[i] + h } else { 0.0 };
        }
        held.for_each(|i| self.wake(i as usize));
        let ready = |still: f64| (WHILE..f64::INFINITY).contains(&still);
        if !self.still.iter().any(|still| ready(*still)) {
            return;
        }
        // The first body of all that it hangs together with.
        let mut first: Vec<usize> = (0..moving).collect();
        fn root(first: &mut [usize], mut i: usize) -> usize {
            while first[i] != i {
                first[i] = first[first[i]];
                i = first[i];
            }
            i
        }
        let mut borne = vec![false; moving];
        for c in contacts {
            let [a, b] = c.pair.map(|i| i as usize);
            if b < moving {
                let [a, b] = [root(&mut first, a), root(&mut first, b)];
                first[a.max(b)] = a.min(b);
            } else {
                borne[a] |= c.press > 0.0;
            }
        }
        let roots: Vec<usize> = (0..moving).map(|i| root(&mut first, i)).collect();
        let (mut all, mut any) = (vec![true; moving], vec![false; moving]);
        for (i, root) in roots.iter().enumerate() {
            all[*root] &= self.still[i] >= WHILE;
            any[*root] |= borne[i];
        }
        for (i, root) in roots.into_iter().enumerate() {
            if all[root] && any[root] && ready(self.still[i]) {
                self.still[i] = f64::INFINITY;
                (bodies.rows[i].v, bodies.rows[i].w) = Default::default();
            }
        }
    }

    /// What a snapshot keeps.
    pub fn numbers(&self) -> [&[f64]; 2] {
        [&self.still, &self.around]
    }

    /// Takes over what a snapshot has kept.
    pub fn restore(&mut self, still: &[f64], around: &[f64]) -> Option<()> {
        if still.len() != self.still.len() {
            return None;
        }
        self.still.copy_from_slice(still);
        self.around = around.to_vec();
        Some(())
    }
}
