//! Which grains may touch, and what their contacts remember.
//!
//! Grains lie in the order of their cells, so that neighbours are near in memory, and are cut into chunks. A chunk has each pair of which it holds
//! a grain: pairs across two chunks stand in both, and both compute the same bits. So no chunk writes what another reads, and each grain sums its
//! pairs in the order of their rows, wherever chunks begin.                                                         (grains.5)

use super::law::Memory;
use crate::geometry::{Neighbours, Vector};
use crate::math::parallel;
use crate::math::{Real, Row};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Rows of [`Bed`]: x, y, z and a number.
pub type Four = [f64; 4];

/// Distance beyond touch at which grains are candidates, over the least radius: of grains under forces, and of those that go farther in a step.
pub const SKIN: f64 = 0.4;
pub const WIDE_SKIN: f64 = 1.0;

/// Grains that may touch, pair by pair.
#[derive(Debug, Default, Clone)]
pub struct Pairs {
    /// The rows of each, the lower one first.
    pub rows: Vec<[u32; 2]>,
    /// Whether they touched in the last pass: then the contact may remember something.
    pub touching: Vec<bool>,
    pub slips: Vec<Row>,
    /// Empty where contacts resist no turns.
    pub turns: Vec<Row>,
    /// By positions: those that touch within the step.
    pub hits: Vec<u32>,
}

/// What a contact remembers: slip, with whether it slides, and turn.
pub type Kept = [Row; 2];

/// The pairs of a chunk.
#[derive(Debug, Default, Clone)]
pub struct Part {
    /// Those whose first grain lies in a chunk before, by the second.
    pub below: Pairs,
    /// Those whose first grain lies here.
    pub own: Pairs,
    /// The first of `own` of each row, and one more for the end.
    first: Vec<u32>,
}

/// All of them.
#[derive(Debug, Default)]
pub struct List {
    pub parts: Vec<Part>,
    /// Rows of a chunk.
    pub chunk: usize,
    grid: Neighbours,
    /// Candidates of each place of the grid.
    found: Vec<Vec<u32>>,
    /// Distance beyond touch at which grains are candidates [m].
    skin: f64,
    /// How far grains may go before candidates are sought anew [m].
    pub slack: f64,
}

/// The place of a row.
pub fn point(x: &Four) -> Vector {
    Vector { x: x[0], y: x[1], z: x[2] }
}

impl Pairs {
    fn push(&mut self, rows: [u32; 2], [slip, turn]: Kept, turns: bool) {
        self.rows.push(rows);
        self.touching.push([slip, turn] != Kept::default());
        self.slips.push(slip);
        if turns {
            self.turns.push(turn);
        }
    }

    /// What a contact remembers.
    fn kept(&self, k: usize) -> Kept {
        [self.slips[k], self.turns.get(k).copied().unwrap_or_default()]
    }

    /// The same in double precision.
    pub fn memory(&self, k: usize) -> Memory {
        let [slip, turn] = self.kept(k);
        let wide = |v: Row| point(&v.map(f64::from));
        Memory { slip: wide(slip), turn: wide(turn), slides: f64::from(slip[3]) }
    }
}

impl Part {
    /// What the contact of two rows remembers, the lower one first.
    fn kept(&self, start: usize, [a, b]: [u32; 2]) -> Option<Kept> {
        let row = a as usize - start;
        let (first, end) = (*self.first.get(row)? as usize, *self.first.get(row + 1)? as usize);
        Some(self.own.kept(first + self.own.rows[first..end].iter().position(|rows| rows[1] == b)?))
    }
}

impl List {
    /// For so many grains with radii between these [m], and this skin over the least.
    pub fn new(count: usize, [least, largest]: [f64; 2], skin: f64) -> Self {
        /// Chunks, and rows of the smallest: the fewer, the fewer pairs lie across two.
        const CHUNKS: usize = 8;
        const LEAST: usize = 2048;
        let skin = skin * least;
        Self {
            skin,
            grid: Neighbours::new(2.0 * largest + skin),
            // A tenth less than half: cells are found by rounded places.
            slack: 0.45 * skin,
            chunk: count.div_ceil(CHUNKS).max(LEAST),
            ..Self::default()
        }
    }

    /// Sorts rows by cell: the row that comes to each place.
    pub fn order(&mut self, x: &[Four]) -> Vec<u32> {
        self.place(x);
        self.grid.order().to_vec()
    }

    fn place(&mut self, x: &[Four]) {
        let rows: Vec<Row> = x.iter().map(|x| [x[0] as Real, x[1] as Real, x[2] as Real, 0.0]).collect();
        self.grid.rebuild(&rows);
    }

    /// Whether there would be more candidates than so many.
    pub fn exceeds(&mut self, x: &[Four], most: usize) -> bool {
        self.place(x);
        let (order, skin, count) = (self.grid.order(), self.skin, AtomicUsize::new(0));
        self.grid.each(&mut vec![(); self.grid.len()], |place, runs, ()| {
            if count.load(Ordering::Relaxed) > most {
                return;
            }
            let here = &x[order[place] as usize];
            let near = |other: &&u32| {
                let there = &x[**other as usize];
                (point(there) - point(here)).norm_sq() < (here[3] + there[3] + skin).powi(2)
            };
            let found = runs.iter().flat_map(|[first, end]| &order[*first as usize..*end as usize]).filter(near).count();
            count.fetch_add(found, Ordering::Relaxed);
        });
        count.into_inner() > most
    }

    /// Seeks candidates anew; `before` are the rows that grains had in the last list. Without `turns` contacts remember slips alone. Those
    /// that are `joined` do not touch.
    pub fn rebuild(&mut self, x: &[Four], before: &[u32], turns: bool, joined: impl Fn(u32, u32) -> bool + Sync) {
        self.place(x);
        let mut found = std::mem::take(&mut self.found);
        found.resize_with(self.grid.len(), Vec::new);
        let (order, skin) = (self.grid.order(), self.skin);
        self.grid.each(&mut found, |place, runs, found| {
            found.clear();
            let row = order[place];
            let here = &x[row as usize];
            for other in runs.iter().flat_map(|[first, end]| &order[*first as usize..*end as usize]) {
                let there = &x[*other as usize];
                let far = here[3] + there[3] + skin;
                if *other != row && !joined(row, *other) && (point(there) - point(here)).norm_sq() < far * far {
                    found.push(*other);
                }
            }
            found.sort_unstable();
        });
        let mut of = vec![u32::MAX; x.len()];
        order.iter().enumerate().for_each(|(place, row)| of[*row as usize] = place as u32);
        let old = std::mem::take(&mut self.parts);
        let chunk = self.chunk;
        let kept = |pair: [u32; 2]| {
            let [a, b] = pair.map(|row| before[row as usize]);
            let lower = a.min(b) as usize / chunk;
            let kept = old.get(lower)?.kept(lower * chunk, [a.min(b), a.max(b)])?;
            Some(if a < b { kept } else { kept.map(|[x, y, z, slides]| [-x, -y, -z, slides]) })
        };
        let part = |c: usize| {
            let rows = c * chunk..((c + 1) * chunk).min(x.len());
            let mut part = Part::default();
            for row in rows.clone() {
                part.first.push(part.own.rows.len() as u32);
                for other in found.get(of[row] as usize).into_iter().flatten() {
                    if (*other as usize) < rows.start {
                        let pair = [*other, row as u32];
                        part.below.push(pair, kept(pair).unwrap_or_default(), turns);
                    } else if *other as usize > row {
                        let pair = [row as u32, *other];
                        part.own.push(pair, kept(pair).unwrap_or_default(), turns);
                    }
                }
            }
            part.first.push(part.own.rows.len() as u32);
            part
        };
        self.parts = parallel::map(x.len().div_ceil(chunk), part);
        self.found = found;
    }

    /// Contacts that remember something: their rows, and that.
    pub fn kept(&self) -> impl Iterator<Item = ([u32; 2], Kept)> {
        let of = |part: &'_ Part| {
            let all = (0..part.own.rows.len()).map(|k| (part.own.rows[k], part.own.kept(k)));
            all.filter(|(_, kept)| *kept != Kept::default()).collect::<Vec<_>>()
        };
        self.parts.iter().flat_map(of)
    }

    /// Takes over what contacts remember, in the order of `kept`, as a list to rebuild from.
    pub fn remember(&mut self, rows: usize, kept: &[([u32; 2], Kept)], turns: bool) {
        self.parts.clear();
        let mut rest = kept.iter().peekable();
        for start in (0..rows).step_by(self.chunk) {
            let mut part = Part::default();
            for row in start..(start + self.chunk).min(rows) {
                part.first.push(part.own.rows.len() as u32);
                while let Some((pair, kept)) = rest.next_if(|(pair, _)| pair[0] as usize == row) {
                    part.own.push(*pair, *kept, turns);
                }
            }
            part.first.push(part.own.rows.len() as u32);
            self.parts.push(part);
        }
    }
}
