//! Grains by positions: hard contacts with friction, in small steps.
//!
//!   v* = v + h g + w P,   P <- max(P + (u - n·v*_12)/W, 0) n + friction,   v <- v + h g + w P,   x <- x + h v + d        (grains.11)
//!
//! P is the sum of the impulses of a grain's contacts. Each contact begins with what it had in the step before, and sees each of its grains as one of as
//! many parts as that has contacts [tonge2012]: then all may be solved at once, and what one grain gains the other loses. Overlaps are taken away by
//! shifts d that give no velocity [macklin2014].
//!
//! Sources: [macklin2014], [macklin2019], [tonge2012].

use super::bed::Bed;
use super::hard::{Step, Touch, shares};
use super::kick::{QUICK, narrow};
use super::law::{BALL, Memory, NUMBERS, Pair};
use super::list::{Four, Pairs, Part, point};
use super::press::{ALL, LANES, difference, put, sum, three, wide};
use super::walls::{HardTouched, Walls, add};
use crate::geometry::Vector;
use crate::math::parallel::{CHUNK, Tasks};
use crate::math::simd::{Kernel, Width, dispatch};
use crate::math::{Lane, Real, Row};

/// The longest step, unless the scene says so, over the time in which a grain falls by its radius.
const STEP: f64 = 0.009;
/// How near contacts are looked for, over the way after which candidates are sought anew under forces.
const NEAR: f64 = 0.9;
/// Passes over all contacts in a step.
pub const PASSES: u32 = 2;
/// Parts of a grain, over the number of its contacts: half or less would not converge where all contacts of a grain push it one way.
const SPLIT: Real = 0.7;
/// Marks contacts that nothing has pressed in the step before.
const FRESH: u32 = 1 << 31;

/// The longest step of grains with this radius at least [m] that are to settle [s].
pub fn settling_step(radius: f64) -> f64 {
    const G: f64 = 9.81;
    STEP * (2.0 * radius / G).sqrt()
}

/// What a pass reads.
struct Rows<'a> {
    x: &'a [Four],
    w: &'a [Four],
    quick: &'a [Row],
    pairs: &'a [Pair],
    kinds: usize,
    step: Step,
    /// How near contacts are looked for [m]: where candidates are all known, whenever they were sought.
    near: f64,
}

/// What it writes: sums of rows of a chunk that begins at `start`.
struct Sums<'a> {
    start: usize,
    force: &'a mut [Four],
    torque: &'a mut [Four],
    shift: &'a mut [Four],
}

impl Sums<'_> {
    /// Adds what the second of two rows has, and takes it from the first.
    #[inline(always)]
    fn take(&mut self, rows: [u32; 2], impulse: &Four, torques: [&Four; 2], shift: &Four) {
        let first = (rows[0] as usize).wrapping_sub(self.start);
        if first < self.force.len() {
            self.force[first] = difference(&self.force[first], impulse);
            self.torque[first] = sum(&self.torque[first], torques[0]);
            self.shift[first] = difference(&self.shift[first], shift);
        }
        let second = (rows[1] as usize).wrapping_sub(self.start);
        if second < self.force.len() {
            self.force[second] = sum(&self.force[second], impulse);
            self.torque[second] = sum(&self.torque[second], torques[1]);
            self.shift[second] = sum(&self.shift[second], shift);
        }
    }
}

impl Rows<'_> {
    /// From the first of two rows to the second [m], and between their surfaces.
    #[inline(always)]
    fn way(&self, [i, j]: [u32; 2]) -> (Vector, f64) {
        let (a, b) = (&self.x[i as usize], &self.x[j as usize]);
        let (way, reach) = (point(b) - point(a), a[3] + b[3]);
        let far = way.norm();
        // The difference of squares loses nothing where they nearly touch.
        (way, (way.norm_sq() - reach * reach) / (reach + far))
    }

    /// Looks for candidates that touch within the step, and counts those of each row; what no longer touches forgets.
    fn find(&self, list: &mut Pairs, start: usize, counts: &mut [u32]) {
        list.hits.clear();
        let velocity = |row: u32| self.quick[QUICK * row as usize];
        for k in 0..list.rows.len() {
            let [i, j] = list.rows[k];
            let (a, b) = (&self.x[i as usize], &self.x[j as usize]);
            let (u, v) = (velocity(i), velocity(j));
            let (mut far, mut closing) = (0.0, 0.0);
            for c in 0..3 {
                let way = b[c] - a[c];
                far += way * way;
                closing += way * f64::from(v[c] - u[c]);
            }
            let (reach, near) = (a[3] + b[3], a[3] + b[3] + self.near);
            let touches = far + 2.0 * self.step.h * closing.min(0.0) < reach * reach && far < near * near;
            if touches {
                let rested = list.slips[k][..3] != [0.0; 3];
                list.hits.push(k as u32 | if rested { 0 } else { FRESH });
                for row in [i, j] {
                    if let Some(count) = counts.get_mut((row as usize).wrapping_sub(start)) {
                        *count += 1;
                    }
                }
            } else if list.touching[k] {
                list.slips[k] = [0.0; 4];
                if let Some(turn) = list.turns.get_mut(k) {
                    *turn = [0.0; 4];
                }
            }
            list.touching[k] = touches;
        }
    }

    /// Sums what contacts remember, where grains are now.
    fn recall(&self, list: &Pairs, sums: &mut Sums<'_>) {
        for k in (0..list.rows.len()).filter(|k| list.touching[*k]) {
            let (way, gap) = self.way(list.rows[k]);
            let normal = if way.norm() > 0.0 { way.normalized() } else { Vector { x: 0.0, y: 0.0, z: 1.0 } };
            let Memory { slip, turn, .. } = list.memory(k);
            let turning = -normal.cross(slip);
            let [first, second] = list.rows[k].map(|row| turning * (self.x[row as usize][3] + 0.5 * gap));
            let four = |v: Vector| [v.x, v.y, v.z, 0.0];
            sums.take(list.rows[k], &four(slip), [&four(first - turn), &four(second + turn)], &[0.0; 4]);
        }
    }
}

/// Contacts in a register.
struct Batch {
    rows: [[u32; LANES]; 2],
    /// From the first to the second, and the gap.
    ways: [Row; LANES],
    slips: [Row; LANES],
    turns: [Row; LANES],
    laws: [[Real; LANES]; NUMBERS],
    /// Impulse on the second, torques on both, and the shift of the second.
    pushes: [[Row; LANES]; 4],
}

/// The contacts of one list of a chunk.
struct Pass<'a, 'b> {
    rows: &'a Rows<'a>,
    list: &'a mut Pairs,
    sums: &'a mut Sums<'b>,
}

impl Kernel for Pass<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(mut self, w: W) {
        // Lanes without a contact compute with what they had before, and nobody takes their results.
        let none = [[0.0; 4]; LANES];
        let mut batch = Batch {
            rows: [[0; LANES]; 2],
            ways: [[1.0; 4]; LANES],
            slips: none,
            turns: none,
            laws: [[1.0; LANES]; NUMBERS],
            pushes: [none; 4],
        };
        let numbers = self.rows.pairs[0].numbers();
        for c in 0..NUMBERS {
            batch.laws[c] = [numbers[c] as Real; LANES];
        }
        let mut at = 0;
        while at < self.list.hits.len() {
            self.solve(w, at, &mut batch);
            at += W::N;
        }
    }
}

impl Pass<'_, '_> {
    /// Reads the contacts from `at` on that fill a register.
    #[inline(always)]
    fn load(&self, at: usize, count: usize, batch: &mut Batch) {
        let Rows { w: kinds_of, pairs, kinds, .. } = *self.rows;
        for l in 0..count {
            let (k, fresh) = ((self.list.hits[at + l] & !FRESH) as usize, self.list.hits[at + l] & FRESH != 0);
            let [i, j] = self.list.rows[k];
            let (way, gap) = self.rows.way([i, j]);
            batch.rows[0][l] = i;
            batch.rows[1][l] = j;
            batch.ways[l] = [way.x as Real, way.y as Real, way.z as Real, gap as Real];
            batch.slips[l] = self.list.slips[k];
            if !self.list.turns.is_empty() {
                batch.turns[l] = self.list.turns[k];
            }
            batch.turns[l][3] = if fresh { 1.0 } else { 0.0 };
            if kinds > 1 {
                let numbers = pairs[kinds_of[i as usize][3] as usize * kinds + kinds_of[j as usize][3] as usize].numbers();
                for c in 0..NUMBERS {
                    batch.laws[c][l] = numbers[c] as Real;
                }
            }
        }
    }

    /// Solves them at once, and adds what they give one after the other.
    #[inline(always)]
    fn solve<W: Width>(&mut self, w: W, at: usize, batch: &mut Batch) {
        let count = W::N.min(self.list.hits.len() - at);
        let turns = !self.list.turns.is_empty();
        self.load(at, count, batch);
        let mut laws = [w.splat(0.0); NUMBERS];
        for c in 0..NUMBERS {
            laws[c] = w.load(&batch.laws[c]);
        }
        // SAFETY: blocks have a row at every index.
        let [way, slip, turn] = unsafe { [w.gather(&batch.ways, &ALL), w.gather(&batch.slips, &ALL), w.gather(&batch.turns, &ALL)] };
        let [first, first_spin, first_gain] = self.velocities(w, &batch.rows[0]);
        let [second, second_spin, second_gain] = self.velocities(w, &batch.rows[1]);
        let (one, tiny) = (w.splat(1.0), w.splat(Real::MIN_POSITIVE));
        let (gap, radii) = (way[3], [first_spin[3], second_spin[3]]);
        let way = three(way);
        let distance = way.norm_sq().sqrt();
        // Two grains in one place part along z.
        let inverse = (distance - tiny).positive(one / distance, one.zero());
        let mut normal = way * inverse;
        normal.z = inverse.positive(normal.z, one);
        let half = gap * w.splat(0.5);
        let arms = [radii[0] + half, radii[1] + half];
        let spins = [three(first_spin), three(second_spin)];
        let moves = three(second) - three(first);
        let [along, turning] = shares(turns).map(|share| w.splat(share as Real));
        let across = first[3] + second[3];
        let touch = Touch {
            gap,
            normal,
            velocity: moves - (spins[0] * arms[0] + spins[1] * arms[1]).cross(normal),
            // What is pressed already does not bounce.
            before: (moves - three(second_gain) + three(first_gain)).dot(normal) * turn[3],
            turning: spins[1] - spins[0],
            radius: radii[0] * radii[1] / (radii[0] + radii[1]),
            yields: [across, across * along, (first[3] / (radii[0] * radii[0]) + second[3] / (radii[1] * radii[1])) * turning],
        };
        let mut memory = Memory { slip: three(slip), turn: three(turn), slides: slip[3] };
        let law = Pair::from_numbers(self.rows.pairs[0].law(), laws);
        let Step { h, slow } = self.rows.step;
        let push = law.project(&touch, [w.splat(h as Real), w.splat(slow as Real)], &mut memory, turns);
        let moment = push.impulse.cross(normal);
        put(w, push.impulse, memory.slides, &mut batch.pushes[0]);
        put(w, moment * arms[0] - push.couple, one.zero(), &mut batch.pushes[1]);
        put(w, moment * arms[1] + push.couple, one.zero(), &mut batch.pushes[2]);
        put(w, normal * push.shift, one.zero(), &mut batch.pushes[3]);
        put(w, memory.turn, one.zero(), &mut batch.turns);
        for l in 0..count {
            let k = (self.list.hits[at + l] & !FRESH) as usize;
            self.list.slips[k] = batch.pushes[0][l];
            if turns {
                self.list.turns[k] = batch.turns[l];
            }
            let [impulse, one, other, shift] = [0, 1, 2, 3].map(|c: usize| wide(&batch.pushes[c][l]));
            self.sums.take([batch.rows[0][l], batch.rows[1][l]], &impulse, [&one, &other], &shift);
        }
    }

    /// The velocities of grains, and what they have gained in the step.
    #[inline(always)]
    fn velocities<W: Width>(&self, w: W, rows: &[u32; LANES]) -> [[W::L; 4]; 3] {
        let mut index = [0; LANES];
        for l in 0..LANES {
            index[l] = QUICK as u32 * rows[l];
        }
        let quick = self.rows.quick;
        // SAFETY: there are so many rows for each grain, and the rows of pairs have been looked up.
        unsafe { [w.gather(quick, &index), w.gather(&quick[1..], &index), w.gather(&quick[2..], &index)] }
    }
}

impl Bed {
    /// Sums what contacts remember, at the start of an interval.
    pub fn recall(&mut self, walls: &Walls) {
        let mut parts = std::mem::take(&mut self.list.parts);
        self.each_part(&mut parts, Step { h: 0.0, slow: 0.0 }, |rows, part, sums| {
            rows.recall(&part.below, sums);
            rows.recall(&part.own, sums);
        });
        self.list.parts = parts;
        walls.recall(&self.x, self.list.chunk, &mut self.force, &mut self.torque);
    }

    /// Calls `f` for each chunk with its sums, from zero on.
    fn each_part(&mut self, parts: &mut [Part], step: Step, f: impl Fn(&Rows<'_>, &mut Part, &mut Sums<'_>) + Sync) {
        let Self { x, w, force, torque, shift, quick, pairs, kinds, list, .. } = self;
        let rows = Rows { x, w, quick, pairs, kinds: *kinds, step, near: NEAR * list.slack };
        let chunk = list.chunk;
        shift.resize(x.len(), [0.0; 4]);
        let sums = force.chunks_mut(chunk).zip(torque.chunks_mut(chunk)).zip(shift.chunks_mut(chunk));
        parts.iter_mut().zip(sums).enumerate().in_parallel(|(c, (part, ((force, torque), shift)))| {
            for sum in [&mut *force, &mut *torque, &mut *shift] {
                sum.fill([0.0; 4]);
            }
            f(&rows, part, &mut Sums { start: c * chunk, force, torque, shift });
        });
    }

    /// A step from the time t on [s].
    pub fn step(&mut self, walls: &mut Walls, t: f64, h: f64, gravity: Vector) {
        // What rests gains no more than that by gravity until it is held.
        let step = Step { h, slow: 2.0 * gravity.norm() * h };
        walls.begin(h);
        for pass in 0..PASSES {
            self.predict(h, gravity);
            walls.predict(&self.x);
            if pass == 0 {
                self.find(walls, t, step);
            }
            self.split();
            let mut parts = std::mem::take(&mut self.list.parts);
            self.each_part(&mut parts, step, |rows, part, sums| {
                dispatch(Pass { rows, list: &mut part.below, sums });
                dispatch(Pass { rows, list: &mut part.own, sums });
            });
            self.list.parts = parts;
            let Self { x, w, quick, force, torque, shift, list, .. } = self;
            walls.project(HardTouched { x, w, quick, force, torque, shift, chunk: list.chunk }, t, step);
        }
        walls.end();
        self.go(walls, t, h, gravity);
    }

    /// Velocities at the end of the step, if contacts go on as they did.
    fn predict(&mut self, h: f64, gravity: Vector) {
        let Self { x, v, w, force, torque, quick, .. } = self;
        let (x, v, w, force, torque) = (&*x, &*v, &*w, &*force, &*torque);
        quick.resize(QUICK * x.len(), [0.0; 4]);
        quick.chunks_mut(QUICK * CHUNK).enumerate().in_parallel(|(c, quick)| {
            for (k, quick) in quick.chunks_exact_mut(QUICK).enumerate() {
                let i = c * CHUNK + k;
                let gain = gravity * h + point(&force[i]) * v[i][3];
                let spin = point(&w[i]) + point(&torque[i]) * (v[i][3] / (BALL * x[i][3] * x[i][3]));
                (quick[0], quick[1], quick[2]) = (narrow(point(&v[i]) + gain), narrow(spin), narrow(gain));
                (quick[0][3], quick[1][3]) = (v[i][3] as Real, x[i][3] as Real);
            }
        });
    }

    /// Looks for contacts, and takes each grain for as many parts as it has of them.
    fn find(&mut self, walls: &mut Walls, t: f64, step: Step) {
        let mut parts = std::mem::take(&mut self.list.parts);
        let Self { x, w, quick, counts, pairs, kinds, list, .. } = self;
        let chunk = list.chunk;
        counts.clear();
        counts.resize(x.len(), 0);
        let rows = Rows { x, w, quick, pairs, kinds: *kinds, step, near: NEAR * list.slack };
        parts.iter_mut().zip(counts.chunks_mut(chunk)).enumerate().in_parallel(|(c, (part, counts))| {
            rows.find(&mut part.below, c * chunk, counts);
            rows.find(&mut part.own, c * chunk, counts);
        });
        walls.find(x, quick, (t, step.h, NEAR * list.slack), counts, chunk);
        self.list.parts = parts;
    }

    /// Takes each grain for parts, as it has contacts.
    fn split(&mut self) {
        let Self { quick, counts, .. } = self;
        quick.chunks_mut(QUICK * CHUNK).zip(counts.chunks(CHUNK)).in_parallel(|(quick, counts)| {
            for (quick, count) in quick.chunks_exact_mut(QUICK).zip(counts) {
                quick[0][3] *= (SPLIT * *count as Real).max(1.0);
            }
        });
    }

    /// Grains and bodies move to the end of the step.
    fn go(&mut self, walls: &mut Walls, t: f64, h: f64, gravity: Vector) {
        let Self { x, v, w, force, torque, shift, .. } = self;
        let (force, torque, shift) = (&*force, &*torque, &*shift);
        let rows = x.chunks_mut(CHUNK).zip(v.chunks_mut(CHUNK)).zip(w.chunks_mut(CHUNK)).enumerate();
        let ways = rows.map_in_parallel(|(c, ((x, v), w))| {
            let mut most = [0.0_f64; 2];
            for (k, ((x, v), w)) in x.iter_mut().zip(v).zip(w).enumerate() {
                let i = c * CHUNK + k;
                add(v, gravity * h + point(&force[i]) * v[3]);
                add(w, point(&torque[i]) * (v[3] / (BALL * x[3] * x[3])));
                let way = point(v) * h + point(&shift[i]) * v[3];
                add(x, way);
                most = [most[0].max(way.norm_sq()), most[1].max(point(x).norm_sq())];
            }
            most
        });
        walls.drift(h);
        let [farthest, size] = [0, 1].map(|k: usize| ways.iter().map(|way| way[k]).fold(0.0, f64::max).sqrt());
        // Candidates that have been left out are still farther apart than contacts are looked for.
        self.went(walls, t + h, farthest.max(h * walls.fastest(t, h, size)), 0.5 * self.list.slack);
    }
}
