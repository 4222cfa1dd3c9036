//! Spring neighbours of every row, laid out for wide registers.
//!
//! Sliced ELL: slices of sixteen rows; a slot holds one neighbour of each of them, sixteen entries side by side. On
//! regular structures the neighbours in a slot are consecutive rows (a run), which load as whole registers from columns of
//! x, y and z; other slots gather row by row. Springs share out by their offset from row to neighbour, so that a run stays
//! one where a few rows lack that neighbour.

use super::list::{Members, Pack};
use crate::math::parallel::{CHUNK, Tasks};
use crate::math::simd::{Index, Kernel, Width, dispatch, packs};
use crate::math::{Real, Row, Vec3};
use std::ops::Range;

/// Rows per slice; every register width divides it, and chunks of rows hold whole ones.
pub const SLICE: usize = 16;

/// Marks a slot that is no run.
const SCATTERED: u32 = u32::MAX;
/// Marks a slot of springs that are not alike.
const MIXED: u32 = u32::MAX;
/// Kinds at most, so that they stay in the first cache.
const KINDS: usize = 64;

/// Sixteen entries side by side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slot {
    /// Start of its run, counted from the first row.
    run: u32,
    /// Which of the kinds its sixteen springs are. They are then not read one by one: on a sheet three quarters of what a pass over the
    /// springs reads from memory.
    kind: u32,
}

/// The springs of every row, seen from that row.
pub struct Neighbours<const D: usize, const P: usize> {
    /// First row, a multiple of SLICE.
    pub first: usize,
    /// Count of rows.
    pub rows: usize,
    /// Start of each slice, in entries; one more than there are slices.
    pub start: Vec<u32>,
    slots: Vec<Slot>,
    /// Whether any slot is a run.
    has_runs: bool,
    kinds: Vec<Pack<Real, D, P>>,
    /// Of each entry: the row of the neighbour. An entry without a spring has no stiffness.
    pub neighbour: Index,
    /// Rest numbers.
    pub rest: [Vec<Real>; D],
    /// Parameters of the law.
    pub law: [Vec<Real>; P],
    /// Stiffness.
    pub stiffness: Vec<Real>,
    /// Internal damping.
    pub damping: Vec<Real>,
    /// The two entries of each spring.
    pub entries: Vec<[u32; 2]>,
}

impl<const D: usize, const P: usize> Neighbours<D, P> {
    /// `None` if an end of a spring is not one of the rows 0..rows.
    pub fn new(rows: usize, members: &[Members<2, D, P>]) -> Option<Self> {
        let ends = || members.iter().flat_map(|m| m.nodes);
        let (low, high) = ends().fold((u32::MAX, 0), |(a, b), i| (a.min(i), b.max(i)));
        let first = if low > high { 0 } else { low as usize / SLICE * SLICE };
        let count = if low > high { 0 } else { high as usize + 1 - first };
        // The ends at every row, as spring times 2 plus side, in order of springs.
        let mut from = vec![0_usize; count + 1];
        ends().for_each(|i| from[i as usize - first + 1] += 1);
        for i in 0..count {
            from[i + 1] += from[i];
        }
        let (mut next, mut end) = (from.clone(), vec![0_usize; from[count]]);
        for (k, i) in ends().enumerate() {
            end[next[i as usize - first]] = k;
            next[i as usize - first] += 1;
        }
        let other = |k: usize| members[k / 2].nodes[1 - k % 2] as usize;

        let mut lists = Self {
            first,
            rows: count,
            start: vec![0],
            slots: Vec::new(),
            has_runs: false,
            kinds: Vec::new(),
            neighbour: Index::default(),
            rest: std::array::from_fn(|_| Vec::new()),
            law: std::array::from_fn(|_| Vec::new()),
            stiffness: Vec::new(),
            damping: Vec::new(),
            entries: vec![[0; 2]; members.len()],
        };
        let mut neighbour: Vec<u32> = Vec::new();
        for slice in 0..count.div_ceil(SLICE) {
            let begin = slice * SLICE;
            let of_row = |lane: usize| if begin + lane < count { &end[from[begin + lane]..from[begin + lane + 1]] } else { &[][..] };
            // Offsets that at least half of the rows have, in order of first appearance.
            let mut offsets: Vec<(isize, usize)> = Vec::new();
            for lane in 0..SLICE {
                for k in of_row(lane) {
                    let offset = other(*k) as isize - (first + begin + lane) as isize;
                    match offsets.iter_mut().find(|o| o.0 == offset) {
                        Some(found) => found.1 += 1,
                        None => offsets.push((offset, 1)),
                    }
                }
            }
            let inside = |offset: isize| (0..=count as isize - 1).contains(&(begin as isize + offset));
            let runs: Vec<isize> = offsets.iter().filter(|(o, n)| 2 * n >= SLICE && inside(*o)).map(|o| o.0).collect();
            // Slot by slot, the end that each row has there.
            let mut slots: Vec<[Option<usize>; SLICE]> = vec![[None; SLICE]; runs.len()];
            for lane in 0..SLICE {
                let mut scattered = runs.len();
                for k in of_row(lane) {
                    let offset = other(*k) as isize - (first + begin + lane) as isize;
                    let run = runs.iter().position(|o| *o == offset).filter(|s| slots[*s][lane].is_none());
                    let slot = run.unwrap_or_else(|| {
                        scattered += 1;
                        scattered - 1
                    });
                    if slot == slots.len() {
                        slots.push([None; SLICE]);
                    }
                    slots[slot][lane] = Some(*k);
                }
            }
            for (s, slot) in slots.iter().enumerate() {
                let run = runs.get(s).map_or(SCATTERED, |offset| (begin as isize + offset) as u32);
                for k in slot {
                    if let Some(k) = k {
                        lists.entries[k / 2][k % 2] = neighbour.len() as u32;
                    }
                    neighbour.push(k.map_or(low, |k| other(k) as u32));
                    let spring = k.map_or(Pack { rest: [0.0; D], law: [0.0; P], stiffness: 0.0, damping: 0.0 }, |k| pack(&members[k / 2]));
                    lists.stiffness.push(spring.stiffness);
                    lists.damping.push(spring.damping);
                    for d in 0..D {
                        lists.rest[d].push(spring.rest[d]);
                    }
                    for p in 0..P {
                        lists.law[p].push(spring.law[p]);
                    }
                }
                let alike = slot
                    .iter()
                    .all(|k| matches!((k, slot[0]), (Some(k), Some(first)) if pack(&members[k / 2]) == pack(&members[first / 2])));
                let kind = if alike { slot[0].and_then(|k| lists.kind_of(pack(&members[k / 2]))) } else { None };
                lists.slots.push(Slot { run, kind: kind.unwrap_or(MIXED) });
            }
            lists.start.push(neighbour.len() as u32);
        }
        lists.has_runs = lists.slots.iter().any(|slot| slot.run != SCATTERED);
        lists.neighbour = Index::new(neighbour, rows)?;
        Some(lists)
    }

    /// The number of a kind, a new one if there is room.
    fn kind_of(&mut self, spring: Pack<Real, D, P>) -> Option<u32> {
        let found = self.kinds.iter().position(|k| *k == spring);
        if found.is_none() && self.kinds.len() < KINDS {
            self.kinds.push(spring);
            return Some(self.kinds.len() as u32 - 1);
        }
        found.map(|k| k as u32)
    }

    /// Changes one spring.
    pub fn set(&mut self, spring: usize, stiffness: Real, damping: Real) {
        for entry in self.entries[spring].map(|e| e as usize) {
            self.stiffness[entry] = stiffness;
            self.damping[entry] = damping;
            self.slots[entry / SLICE].kind = MIXED;
        }
    }

    /// The slots of a slice, each with its first entry.
    #[inline(always)]
    pub fn slots(&self, slice: usize) -> impl Iterator<Item = (usize, Slot)> {
        let entries = self.start[slice] as usize..self.start[slice + 1] as usize;
        let slots = &self.slots[entries.start / SLICE..entries.end / SLICE];
        entries.step_by(SLICE).zip(slots.iter().copied())
    }

    /// Content of a pack of entries of a slot.
    #[inline(always)]
    pub fn pack<W: Width>(&self, w: W, slot: Slot, entry: usize) -> Pack<W::L, D, P> {
        let zero = w.splat(0.0);
        let mut pack = Pack { rest: [zero; D], law: [zero; P], stiffness: zero, damping: zero };
        // A slot that is mixed has the number of no kind.
        if let Some(spring) = self.kinds.get(slot.kind as usize) {
            for d in 0..D {
                pack.rest[d] = w.splat(spring.rest[d]);
            }
            for p in 0..P {
                pack.law[p] = w.splat(spring.law[p]);
            }
            pack.stiffness = w.splat(spring.stiffness);
            pack.damping = w.splat(spring.damping);
        } else {
            for d in 0..D {
                pack.rest[d] = w.load(&self.rest[d][entry..]);
            }
            for p in 0..P {
                pack.law[p] = w.load(&self.law[p][entry..]);
            }
            pack.stiffness = w.load(&self.stiffness[entry..]);
            pack.damping = w.load(&self.damping[entry..]);
        }
        pack
    }

    /// Count of slices.
    pub fn slices(&self) -> usize {
        self.start.len() - 1
    }

    /// The slices among the rows from `start` on, and those of `out` that they cover.
    pub fn within<'a, T>(&self, start: usize, out: &'a mut [T]) -> (Range<usize>, &'a mut [T]) {
        let (first, rows) = (self.first, self.rows);
        let (a, b) = (start.max(first), (start + out.len()).min(first + rows).max(first));
        if a >= b {
            return (0..0, &mut []);
        }
        ((a - first) / SLICE..(b - first).div_ceil(SLICE), &mut out[a - start..b - start])
    }

    /// The vectors of the rows at the other ends of a pack of entries: those of a slot from the lane on.
    ///
    /// # Safety
    /// `rows` holds every row that the lists were made for, and `columns` were filled by these lists.
    #[inline(always)]
    pub unsafe fn load<W: Width>(&self, w: W, rows: &[Row], columns: &Columns, slot: Slot, entry: usize, lane: usize) -> Vec3<W::L> {
        if slot.run != SCATTERED {
            // SAFETY: a run starts at a row of the lists, and columns are longer by a slice.
            return unsafe { columns.load(w, slot.run as usize + lane) };
        }
        // SAFETY: promised by the caller.
        let [x, y, z, _] = unsafe { w.gather(rows, &self.neighbour.get()[entry..]) };
        Vec3 { x, y, z }
    }

    /// Whether columns have the length of those that these lists have filled.
    pub fn has_filled(&self, columns: &Columns) -> bool {
        !self.has_runs || columns.0.iter().all(|c| c.len() == self.rows + SLICE)
    }

    /// Fills columns from the rows of the lists, unless no slot is a run.
    pub fn fill(&self, columns: &mut Columns, rows: &[Row]) {
        if self.has_runs {
            columns.fill(&rows[self.first..self.first + self.rows]);
        }
    }
}

/// One spring in the engine's scalar.
fn pack<const D: usize, const P: usize>(m: &Members<2, D, P>) -> Pack<Real, D, P> {
    Pack { rest: m.rest.map(|r| r as Real), law: m.law.map(|l| l as Real), stiffness: m.stiffness as Real, damping: m.damping as Real }
}

/// The first three numbers of rows, as columns. Runs may reach beyond the last row, where nothing is stiff.
#[derive(Default)]
pub struct Columns([Vec<Real>; 3]);

impl Columns {
    /// # Safety
    /// `at` is inside, and so are as many rows after it as a register holds.
    #[inline(always)]
    unsafe fn load<W: Width>(&self, w: W, at: usize) -> Vec3<W::L> {
        let [x, y, z] = &self.0;
        // SAFETY: promised by the caller; all three have one length.
        unsafe { Vec3 { x: w.load_at(x, at), y: w.load_at(y, at), z: w.load_at(z, at) } }
    }

    fn fill(&mut self, rows: &[Row]) {
        let length = rows.len() + SLICE;
        let [x, y, z] = &mut self.0;
        for column in [&mut *x, &mut *y, &mut *z] {
            column.resize(length, 0.0);
        }
        let parts = x.chunks_mut(CHUNK).zip(y.chunks_mut(CHUNK)).zip(z.chunks_mut(CHUNK));
        parts.zip(rows.chunks(CHUNK)).in_parallel(|(((x, y), z), rows)| dispatch(Transpose { rows, to: [x, y, z] }));
    }
}

struct Transpose<'a> {
    rows: &'a [Row],
    to: [&'a mut [Real]; 3],
}

impl Kernel for Transpose<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        let [x, y, z] = self.to;
        packs!(W, w, (0..self.rows.len()), |i| {
            let row = w.rows(self.rows, i);
            w.store(row[0], &mut x[i..]);
            w.store(row[1], &mut y[i..]);
            w.store(row[2], &mut z[i..]);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn member(a: u32, b: u32) -> Members<2, 1, 0> {
        Members { nodes: [a, b], rest: [f64::from(a + b)], law: [], stiffness: f64::from(1 + a), damping: 0.0 }
    }

    #[test]
    fn every_spring_has_its_two_entries_and_no_other_entry_is_stiff() {
        // A chain with a hole, a spring across, a doubled spring.
        let chain = (20..75).filter(|i| *i != 40).map(|i| member(i, i + 1));
        let members: Vec<_> = chain.chain([member(21, 70), member(50, 51)]).collect();
        let lists = Neighbours::new(80, &members).unwrap();
        assert_eq!((lists.first, lists.rows), (16, 60));
        let mut found = 0;
        for (m, entries) in members.iter().zip(&lists.entries) {
            for side in 0..2 {
                let e = entries[side] as usize;
                let slice = lists.start.iter().filter(|s| **s as usize <= e).count() - 1;
                assert_eq!(lists.first + slice * SLICE + e % SLICE, m.nodes[side] as usize);
                assert_eq!(lists.neighbour.get()[e], m.nodes[1 - side]);
                assert_eq!((f64::from(lists.stiffness[e]), f64::from(lists.rest[0][e])), (m.stiffness, m.rest[0]));
                found += 1;
            }
        }
        assert_eq!(lists.stiffness.iter().filter(|k| **k != 0.0).count(), found);
        assert!(lists.slots.iter().filter(|s| s.run != SCATTERED).count() >= 6, "{:?}", lists.slots);
        assert!(Neighbours::new(75, &members).is_none());
    }
}
