//! The contact pass over pairs of grains: those that touch, side by side in registers.

use super::kick::QUICK;
use super::law::{Memory, NUMBERS, Overlap, Pair};
use super::list::{Four, Pairs, Part};
use crate::math::simd::{Kernel, Width, dispatch};
use crate::math::{Lane, Real, Row, Vec3};

/// What it reads.
pub struct Rows<'a> {
    pub x: &'a [Four],
    pub w: &'a [Four],
    /// `Bed::quick`.
    pub quick: &'a [Row],
    /// The pair of each kind with each.
    pub pairs: &'a [Pair],
    pub kinds: usize,
    /// Length of the step [s].
    pub h: f64,
}

/// Contacts at most in a register.
pub(super) const LANES: usize = 16;
/// Their numbers.
pub(super) const ALL: [u32; LANES] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
/// Candidates that are looked through before those that touch are computed.
const BLOCK: usize = 256;

/// Contacts among a block of candidates, and room for a last register.
struct Found {
    count: usize,
    candidates: [u32; BLOCK + LANES],
    /// From the first to the second, and what (R_1 + R_2)² has beyond the square of that.
    ways: [Row; BLOCK + LANES],
}

/// Contacts in a register.
struct Batch {
    /// Rows of both grains.
    pairs: [[u32; LANES]; 2],
    slips: [Row; LANES],
    turns: [Row; LANES],
    /// Numbers of the laws.
    laws: [[Real; LANES]; NUMBERS],
    /// Forces on the first, and torques on both.
    forces: [[Row; LANES]; 3],
}

/// The candidates of one list of a chunk.
struct Pass<'a> {
    rows: &'a Rows<'a>,
    list: &'a mut Pairs,
    /// Rows of the chunk: those whose forces are summed.
    start: usize,
    force: &'a mut [Four],
    torque: &'a mut [Four],
}

impl Rows<'_> {
    /// The forces of a chunk that begins at a row.
    pub fn press(&self, part: &mut Part, start: usize, force: &mut [Four], torque: &mut [Four]) {
        force.fill([0.0; 4]);
        torque.fill([0.0; 4]);
        for list in [&mut part.below, &mut part.own] {
            dispatch(Pass { rows: self, list, start, force: &mut *force, torque: &mut *torque });
        }
    }
}

impl Kernel for Pass<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(mut self, w: W) {
        // Lanes without a contact compute with what they had before, and nobody takes their results.
        let mut found = Found { count: 0, candidates: [0; BLOCK + LANES], ways: [[1.0; 4]; BLOCK + LANES] };
        let mut batch = Batch {
            pairs: [[0; LANES]; 2],
            slips: [[0.0; 4]; LANES],
            turns: [[0.0; 4]; LANES],
            laws: [[1.0; LANES]; NUMBERS],
            forces: [[[0.0; 4]; LANES]; 3],
        };
        let numbers = self.rows.pairs[0].numbers();
        for c in 0..NUMBERS {
            batch.laws[c] = [numbers[c] as Real; LANES];
        }
        let mut first = 0;
        while first < self.list.rows.len() {
            let end = (first + BLOCK).min(self.list.rows.len());
            self.find(first, end, &mut found);
            let mut at = 0;
            while at < found.count {
                self.answer(w, &found, at, &mut batch);
                at += W::N;
            }
            first = end;
        }
    }
}

impl Pass<'_> {
    /// The contacts among candidates, without a branch that depends on which they are; a contact that ends forgets.
    #[inline(always)]
    fn find(&mut self, first: usize, end: usize, found: &mut Found) {
        let x = self.rows.x;
        let mut count = 0;
        for k in first..end {
            let [i, j] = self.list.rows[k];
            let (a, b) = (&x[i as usize], &x[j as usize]);
            let way = [b[0] - a[0], b[1] - a[1], b[2] - a[2], a[3] + b[3]];
            let far = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
            let excess = way[3] * way[3] - far;
            found.ways[count] = [way[0] as Real, way[1] as Real, way[2] as Real, excess as Real];
            found.candidates[count] = k as u32;
            let touches = excess > 0.0;
            count += usize::from(touches);
            if touches != self.list.touching[k] {
                self.list.touching[k] = touches;
                self.list.slips[k] = [0.0; 4];
                if !self.list.turns.is_empty() {
                    self.list.turns[k] = [0.0; 4];
                }
            }
        }
        found.count = count;
    }

    /// The velocities of grains, and what they gain.
    #[inline(always)]
    fn velocities<W: Width>(&self, w: W, rows: &[u32; LANES]) -> [[W::L; 4]; QUICK] {
        let mut index = [0; LANES];
        for l in 0..LANES {
            index[l] = QUICK as u32 * rows[l];
        }
        let quick = self.rows.quick;
        // SAFETY: there are so many rows for each grain, and the rows of pairs have been looked up.
        unsafe { [w.gather(quick, &index), w.gather(&quick[1..], &index), w.gather(&quick[2..], &index), w.gather(&quick[3..], &index)] }
    }

    /// Computes the contacts from `at` on that fill a register, and adds their forces one after the other.
    #[inline(always)]
    fn answer<W: Width>(&mut self, w: W, found: &Found, at: usize, batch: &mut Batch) {
        let Rows { w: kinds_of, pairs, kinds, .. } = *self.rows;
        let count = W::N.min(found.count - at);
        let turns = !self.list.turns.is_empty();
        for l in 0..count {
            let k = found.candidates[at + l] as usize;
            let [i, j] = self.list.rows[k];
            batch.pairs[0][l] = i;
            batch.pairs[1][l] = j;
            batch.slips[l] = self.list.slips[k];
            if turns {
                batch.turns[l] = self.list.turns[k];
            }
            if kinds > 1 {
                let numbers = pairs[kinds_of[i as usize][3] as usize * kinds + kinds_of[j as usize][3] as usize].numbers();
                for c in 0..NUMBERS {
                    batch.laws[c][l] = numbers[c] as Real;
                }
            }
        }
        let mut laws = [w.splat(0.0); NUMBERS];
        for c in 0..NUMBERS {
            laws[c] = w.load(&batch.laws[c]);
        }
        // SAFETY: blocks have a row at every index.
        let [way, slip, turn] =
            unsafe { [w.gather(&found.ways[at..at + W::N], &ALL), w.gather(&batch.slips, &ALL), w.gather(&batch.turns, &ALL)] };
        let [first, first_spin, first_gain, first_turn] = self.velocities(w, &batch.pairs[0]);
        let [second, second_spin, second_gain, second_turn] = self.velocities(w, &batch.pairs[1]);
        let (one, half, tiny) = (w.splat(1.0), w.splat(0.5), w.splat(Real::MIN_POSITIVE));
        let (excess, radii) = (way[3], [first_spin[3], second_spin[3]]);
        let way = three(way);
        let far = way.norm_sq();
        let distance = far.sqrt();
        // Two grains in one place part along z.
        let along = (distance - tiny).positive(one / distance, one.zero());
        let mut normal = way * along;
        normal.z = along.positive(normal.z, one);
        // The difference of squares was taken in double precision.
        let reach = radii[0] + radii[1];
        let depth = excess / (reach + distance);
        let arms = [radii[0] - half * depth, radii[1] - half * depth];
        let spins = [three(first_spin), three(second_spin)];
        let inverse_mass = first[3] + second[3];
        let at_contact = Overlap {
            depth,
            normal,
            velocity: three(second) - three(first) - (spins[0] * arms[0] + spins[1] * arms[1]).cross(normal),
            gain: three(second_gain) - three(first_gain) - (three(first_turn) * arms[0] + three(second_turn) * arms[1]).cross(normal),
            spins,
            spin_gain: three(second_turn) - three(first_turn),
            radii,
            radius: radii[0] * radii[1] / reach,
            lever: arms[0] * arms[1] / (arms[0] + arms[1]),
            mass: one / inverse_mass,
            inverse_mass,
        };
        let mut memory = Memory { slip: three(slip), turn: three(turn), slides: slip[3] };
        let law = Pair::from_numbers(pairs[0].law(), laws);
        let answer = law.answer(&at_contact, w.splat(self.rows.h as Real), &mut memory, turns);
        let turning = normal.cross(answer.force);
        put(w, answer.force, one.zero(), &mut batch.forces[0]);
        put(w, turning * arms[0] + answer.moment, one.zero(), &mut batch.forces[1]);
        put(w, turning * arms[1] - answer.moment, one.zero(), &mut batch.forces[2]);
        put(w, memory.slip, memory.slides, &mut batch.slips);
        put(w, memory.turn, one.zero(), &mut batch.turns);
        for l in 0..count {
            let k = found.candidates[at + l] as usize;
            self.list.slips[k] = batch.slips[l];
            if turns {
                self.list.turns[k] = batch.turns[l];
            }
            let force = wide(&batch.forces[0][l]);
            // Of a row in another chunk, that takes its part.
            let row = (batch.pairs[0][l] as usize).wrapping_sub(self.start);
            if row < self.force.len() {
                self.force[row] = sum(&self.force[row], &force);
                self.torque[row] = sum(&self.torque[row], &wide(&batch.forces[1][l]));
            }
            let row = (batch.pairs[1][l] as usize).wrapping_sub(self.start);
            if row < self.force.len() {
                self.force[row] = difference(&self.force[row], &force);
                self.torque[row] = sum(&self.torque[row], &wide(&batch.forces[2][l]));
            }
        }
    }
}

/// The first three of four.
#[inline(always)]
pub(super) fn three<L: Lane>(rows: [L; 4]) -> Vec3<L> {
    Vec3 { x: rows[0], y: rows[1], z: rows[2] }
}

/// Vectors and a number as rows of a batch.
#[inline(always)]
pub(super) fn put<W: Width>(w: W, v: Vec3<W::L>, last: W::L, rows: &mut [Row; LANES]) {
    // SAFETY: there is a row for every lane.
    unsafe { w.put([v.x, v.y, v.z, last], rows.as_mut_ptr(), &ALL) };
}

/// A row in double precision.
#[inline(always)]
pub(super) fn wide(row: &Row) -> Four {
    [f64::from(row[0]), f64::from(row[1]), f64::from(row[2]), f64::from(row[3])]
}

#[inline(always)]
pub(super) fn sum(a: &Four, b: &Four) -> Four {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

#[inline(always)]
pub(super) fn difference(a: &Four, b: &Four) -> Four {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]]
}
