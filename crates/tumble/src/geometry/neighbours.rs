//! Neighbour search: points sorted by cell, and sums over all pairs of points in adjacent cells.
//!
//! A cell is as wide as the reach of what is asked for, so that whoever is within reach lies in one of 27 cells. Points are sorted
//! by cell, z first and x last, and by index within a cell; three cells in a row along x are then one run of places, and 27 cells
//! are nine runs.                                                      (neighbours.1, neighbours.2)
//!
//! Cells are numbered from the origin of space and found by bisection among those that hold a point: nothing depends on where the
//! other points are, neither memory nor the order of sums. A point far away therefore changes no bit of anyone's sum.
//!
//! Source: sorting by cell is [green2010].

use crate::math::parallel::{CHUNK, Tasks, chunk_sum, chunks, fold};
use crate::math::simd::{Kernel, Level, Width, dispatch_at};
use crate::math::{Lane, Real, Row, ZERO};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

/// Sums of a point over its neighbours: from N numbers per point, the first three its position, to M sums.
pub trait Meet<const N: usize, const M: usize>: Sync {
    /// The sums of `here`, with what `there` adds to them. It is called for many points beyond the reach, too, and for the point
    /// itself; there it must add zeros.
    fn meet<L: Lane>(&self, here: [L; N], there: [L; N], sum: [L; M]) -> [L; M];
    /// A shorter reach [m] below which `meet_close` adds more, to sums of its own; 0 for none.
    fn close(&self) -> f64 {
        0.0
    }
    /// The same for points closer than that.
    #[inline(always)]
    fn meet_close<L: Lane>(&self, _here: [L; N], _there: [L; N], sum: [L; M]) -> [L; M] {
        sum
    }
}

/// Points sorted by cell.
#[derive(Debug, Default)]
pub struct Neighbours {
    reach: f64,
    /// Sides of a periodic box that starts at the origin [m].
    sides: Option<[f64; 3]>,
    /// The point at each place. Points that are not finite have none.
    order: Vec<u32>,
    /// The place of each point, or NOWHERE.
    place: Vec<AtomicU32>,
    /// Cells that hold points, in order, and the first place of each; one more for the end.
    cells: Vec<u128>,
    start: Vec<u32>,
    /// Places that are summed together, of cells in one line along x.
    tiles: Vec<Tile>,
    /// Runs of places with all neighbours of a tile, LINES or 2 LINES for each.
    runs: Vec<[u32; 2]>,
    /// Short numbers of cells with their points, before and after a pass of the sort. Atomic, because many threads write to places
    /// of their own, which no slices could tell apart.
    pairs: [Vec<AtomicU64>; 2],
}

/// Places of up to TILE points, and the cells of the first and the last of them.
#[derive(Debug, Clone, Copy)]
struct Tile {
    places: [u32; 2],
    cells: [u128; 2],
}

/// The place of a point that has none.
const NOWHERE: u32 = u32::MAX;
/// Points that are summed together: the widest register.
const TILE: usize = 16;
/// Lines of cells around a cell, itself included.
const LINES: usize = 9;
/// Tiles per task.
const TASK: usize = 64;
/// Empty cells in a line that end a tile.
const GAP: u128 = 8;
/// Bits that a pass of the sort looks at, at most.
const DIGIT: u32 = 8;
/// Bits of a cell's number along an axis.
const BITS: u32 = 42;
/// The cell at the origin; those at 0 and at twice this stay empty.
const MIDDLE: f64 = (1_u64 << (BITS - 1)) as f64;

fn axis(key: u128, a: u32) -> u64 {
    (key >> (BITS * a)) as u64 & ((1 << BITS) - 1)
}

fn key(cell: [u64; 3]) -> u128 {
    u128::from(cell[0]) | u128::from(cell[1]) << BITS | u128::from(cell[2]) << (2 * BITS)
}

impl Neighbours {
    /// No points yet. `reach` [m] is the largest distance at which points are neighbours; 0 and what is not finite find none but
    /// the points in the same place.
    pub fn new(reach: f64) -> Self {
        Self { reach: if reach.is_finite() { reach.max(0.0) } else { 0.0 }, ..Self::default() }
    }

    /// The same in a box of these sides [m] that repeats itself without end. Points may lie outside. `meet` has to take the nearest
    /// image of each pair (neighbours.4); a side should be at least twice the reach.
    pub fn periodic(reach: f64, sides: [f64; 3]) -> Self {
        Self { sides: Some(sides.map(|s| if s > 0.0 && s.is_finite() { s } else { 1.0 })), ..Self::new(reach) }
    }

    /// Width of a cell [m]: a little more than the reach, so that rounding hides no neighbour.
    fn width(&self) -> f64 {
        if self.reach > 0.0 { self.reach * (1.0 + 1.0 / 1048576.0) } else { f64::MIN_POSITIVE }
    }

    /// Cells of a periodic box along each axis.
    fn counts(&self) -> Option<[u64; 3]> {
        let width = self.width();
        self.sides.map(|sides| sides.map(|s| (s / width).floor().clamp(1.0, MIDDLE) as u64))
    }

    /// The cell of a point; `None` if it is not finite. `cells` is how many there are in a metre.
    #[inline(always)]
    fn cell(&self, x: &Row, cells: f64, counts: Option<[u64; 3]>) -> Option<[u64; 3]> {
        let mut cell = [0; 3];
        for a in 0..3 {
            let x = f64::from(x[a]);
            if !x.is_finite() {
                return None;
            }
            cell[a] = match (self.sides, counts) {
                (Some(sides), Some(counts)) => {
                    let turns = x / sides[a];
                    1 + (((turns - turns.floor()) * counts[a] as f64) as u64).min(counts[a] - 1)
                }
                _ => {
                    // Beyond two million million cells all is one. The floor by hand: `floor` is a call.
                    let at = (x * cells).clamp(2.0 - MIDDLE, MIDDLE - 2.0);
                    let whole = at as i64;
                    (MIDDLE as i64 + whole - i64::from(at < whole as f64)) as u64
                }
            };
        }
        Some(cell)
    }

    /// Sorts these points.
    pub fn rebuild(&mut self, x: &[Row]) {
        let counts = self.counts();
        self.place.clear();
        self.place.resize_with(x.len(), || AtomicU32::new(NOWHERE));
        self.order.clear();
        let bounds = self.bounds(x, counts);
        let bits: [u32; 3] = std::array::from_fn(|a| 64 - bounds[1][a].wrapping_sub(bounds[0][a]).leading_zeros());
        if bits.iter().sum::<u32>() <= 32 {
            self.sort_by_counting(x, counts, bounds[0], bits);
        } else {
            self.sort_by_comparing(x, counts);
        }
        self.lay_tiles();
        self.find_runs(counts);
    }

    /// The lowest and the highest number of a cell along each axis. Rounding keeps the order of points, and so do cells.
    fn bounds(&self, x: &[Row], counts: Option<[u64; 3]>) -> [[u64; 3]; 2] {
        if let Some(counts) = counts {
            return [[1; 3], counts];
        }
        let corners = fold(x.len(), |range| {
            let mut corners: Option<[Row; 2]> = None;
            for x in x[range].iter().filter(|x| x[..3].iter().all(|c| c.is_finite())) {
                let [low, high] = corners.get_or_insert([*x; 2]);
                for a in 0..4 {
                    low[a] = if x[a] < low[a] { x[a] } else { low[a] };
                    high[a] = if x[a] > high[a] { x[a] } else { high[a] };
                }
            }
            corners
        });
        let all = corners
            .into_iter()
            .flatten()
            .reduce(|[low, high], [l, h]| [std::array::from_fn(|a| low[a].min(l[a])), std::array::from_fn(|a| high[a].max(h[a]))]);
        all.unwrap_or([ZERO; 2]).map(|x| self.cell(&x, 1.0 / self.width(), None).unwrap_or_default())
    }

    /// Puts the points into the order of their cells where these lie close enough for short numbers, digit by digit, the least
    /// significant first. Each chunk of points counts and moves its own, and no two come to the same place.
    fn sort_by_counting(&mut self, x: &[Row], counts: Option<[u64; 3]>, low: [u64; 3], bits: [u32; 3]) {
        let cells = 1.0 / self.width();
        let mut pairs = std::mem::take(&mut self.pairs);
        let [from, to] = &mut pairs;
        from.resize_with(x.len(), Default::default);
        let found = chunk_sum(from, |start, from| {
            let mut found = 0;
            for (k, (pair, x)) in from.iter_mut().zip(&x[start..]).enumerate() {
                let short = |cell: [u64; 3]| (((cell[2] - low[2]) << bits[1] | (cell[1] - low[1])) << bits[0]) | (cell[0] - low[0]);
                let cell = self.cell(x, cells, counts);
                found += usize::from(cell.is_some());
                *pair.get_mut() = cell.map_or(u64::MAX, |cell| short(cell) << 32 | (start + k) as u64);
            }
            found as f64
        });
        if (found as usize) < from.len() {
            from.retain(|pair| pair.load(Relaxed) != u64::MAX);
        }
        to.resize_with(from.len(), Default::default);
        let total: u32 = bits.iter().sum();
        let digit = total.div_ceil(total.div_ceil(DIGIT).max(1));
        let mut shift = 32;
        while shift < 32 + total {
            let digit_of = |pair: u64| (pair >> shift) as usize & ((1 << digit) - 1);
            let mut next = fold(from.len(), |range| {
                let mut count = vec![0_u32; 1 << digit];
                from[range].iter().for_each(|pair| count[digit_of(pair.load(Relaxed))] += 1);
                count
            });
            let mut sum = 0;
            for d in 0..1 << digit {
                for count in &mut next {
                    (sum, count[d]) = (sum + count[d], sum);
                }
            }
            from.chunks(CHUNK).zip(&mut next).in_parallel(|(from, next)| {
                for pair in from {
                    let pair = pair.load(Relaxed);
                    let n = &mut next[digit_of(pair)];
                    to[*n as usize].store(pair, Relaxed);
                    *n += 1;
                }
            });
            std::mem::swap(from, to);
            shift += digit;
        }
        self.order.resize(from.len(), 0);
        let place = &self.place;
        chunks(&mut self.order, |start, order| {
            for (k, point) in order.iter_mut().enumerate() {
                *point = from[start + k].load(Relaxed) as u32;
                place[*point as usize].store((start + k) as u32, Relaxed);
            }
        });
        let from = &*from;
        self.find_cells(x, counts, |place| from[place].load(Relaxed) >> 32);
        self.pairs = pairs;
    }

    /// The same wherever they are.
    fn sort_by_comparing(&mut self, x: &[Row], counts: Option<[u64; 3]>) {
        let cells = 1.0 / self.width();
        let keys: Vec<u128> = x.iter().map(|x| self.cell(x, cells, counts).map_or(u128::MAX, key)).collect();
        self.order.extend((0..keys.len() as u32).filter(|i| keys[*i as usize] != u128::MAX));
        self.order.par_sort_unstable_by_key(|i| (keys[*i as usize], *i));
        for (place, i) in self.order.iter().enumerate() {
            *self.place[*i as usize].get_mut() = place as u32;
        }
        let order = self.order.clone();
        self.find_cells(x, counts, |place| keys[order[place] as usize]);
    }

    /// Finds the cells that hold points, and the first place of each, by numbers that places in one cell share.
    fn find_cells<K: PartialEq>(&mut self, x: &[Row], counts: Option<[u64; 3]>, number: impl Fn(usize) -> K + Sync) {
        let cells = 1.0 / self.width();
        let order = &self.order;
        let found = fold(order.len(), |range| {
            let mut found = Vec::new();
            for place in range {
                if place == 0 || number(place) != number(place - 1) {
                    let cell = self.cell(&x[order[place] as usize], cells, counts);
                    found.push((cell.map_or(u128::MAX, key), place as u32));
                }
            }
            found
        });
        self.cells.clear();
        self.start.clear();
        for (key, first) in found.into_iter().flatten() {
            self.cells.push(key);
            self.start.push(first);
        }
        self.start.push(self.order.len() as u32);
    }

    /// Cuts the places into tiles, none of which leaves a line of cells along x.
    fn lay_tiles(&mut self) {
        self.tiles.clear();
        let mut open: Option<Tile> = None;
        for (c, cell) in self.cells.iter().enumerate() {
            let (mut first, end) = (self.start[c], self.start[c + 1]);
            while first < end {
                let joins = |t: &Tile| {
                    t.cells[1] >> BITS == cell >> BITS && cell - t.cells[1] <= GAP && ((t.places[1] - t.places[0]) as usize) < TILE
                };
                let mut tile = match open.take() {
                    Some(tile) if joins(&tile) => tile,
                    other => {
                        self.tiles.extend(other);
                        Tile { places: [first; 2], cells: [*cell; 2] }
                    }
                };
                tile.places[1] = end.min(tile.places[0] + TILE as u32);
                tile.cells[1] = *cell;
                first = tile.places[1];
                open = Some(tile);
            }
        }
        self.tiles.extend(open);
    }

    /// Finds the neighbours of every tile.
    fn find_runs(&mut self, counts: Option<[u64; 3]>) {
        let each = if counts.is_some() { 2 * LINES } else { LINES };
        let mut runs = std::mem::take(&mut self.runs);
        runs.clear();
        runs.resize(self.tiles.len() * each, [0; 2]);
        let grid = &*self;
        runs.chunks_mut(TASK * each).zip(self.tiles.chunks(TASK)).in_parallel(|(runs, tiles)| {
            // Tiles are in order, and so are their neighbours along each line.
            let mut at = [None; LINES];
            for (runs, tile) in runs.chunks_exact_mut(each).zip(tiles) {
                match counts {
                    Some(counts) => grid.runs_in_box(tile, counts, runs),
                    None => {
                        for (line, run) in runs.iter_mut().enumerate() {
                            // One line up or down, before or behind: keys are sums, and no cell lies at the rim of the numbers.
                            let turn =
                                |key: u128| (key + (((line / 3) as u128) << (2 * BITS)) + (((line % 3) as u128) << BITS)) - LINE_BACK;
                            let (low, high) = (turn(tile.cells[0]) - 1, turn(tile.cells[1]) + 1);
                            let mut first = at[line].unwrap_or_else(|| grid.cells.partition_point(|c| *c < low));
                            while first < grid.cells.len() && grid.cells[first] < low {
                                first += 1;
                            }
                            let mut end = first;
                            while end < grid.cells.len() && grid.cells[end] <= high {
                                end += 1;
                            }
                            at[line] = Some(first);
                            *run = [grid.start[first], grid.start[end]];
                        }
                    }
                }
            }
        });
        self.runs = runs;
    }

    /// The same in a periodic box: a run goes on at the other side, and no cell is met twice, however few there are.
    fn runs_in_box(&self, tile: &Tile, counts: [u64; 3], runs: &mut [[u32; 2]]) {
        let mut found = 0;
        let mut add = |line: [u64; 2], first: u64, last: u64| {
            let from = |x| key([x, line[0], line[1]]);
            let first = self.cells.partition_point(|c| *c < from(first));
            let end = self.cells.partition_point(|c| *c <= from(last));
            runs[found] = [self.start[first], self.start[end]];
            found += 1;
        };
        // The cells before, at and behind c of n, each once.
        let around =
            |c: u64, n: u64| [(c + n - 2) % n + 1, c, c % n + 1].into_iter().take(if n == 1 { 1 } else { 3 }).skip(usize::from(n == 2));
        let [x0, x1] = tile.cells.map(|key| axis(key, 0));
        for z in around(axis(tile.cells[0], 2), counts[2]) {
            for y in around(axis(tile.cells[0], 1), counts[1]) {
                if x1 - x0 + 3 >= counts[0] {
                    add([y, z], 1, counts[0]);
                    continue;
                }
                add([y, z], x0.max(2) - 1, (x1 + 1).min(counts[0]));
                if x0 == 1 {
                    add([y, z], counts[0], counts[0]);
                } else if x1 == counts[0] {
                    add([y, z], 1, 1);
                }
            }
        }
    }

    /// Count of places: of points that are finite.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Whether no point has a place.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// The point at each place.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The place of a point, if it has one.
    pub fn place(&self, point: usize) -> Option<usize> {
        self.place.get(point).map(|p| p.load(Relaxed)).filter(|p| *p != NOWHERE).map(|p| p as usize)
    }

    /// Numbers of each point, place by place.
    pub fn sorted<const N: usize>(&self, of: impl Fn(usize) -> [Real; N] + Sync, out: &mut Vec<[Real; N]>) {
        out.resize(self.len(), [0.0; N]);
        chunks(out, |start, out| {
            for (out, point) in out.iter_mut().zip(&self.order[start..]) {
                *out = of(*point as usize);
            }
        });
    }

    /// The sums of every point, place by place; `numbers` are sorted, too.
    pub fn gather<T: Meet<N, M>, const N: usize, const M: usize>(&self, law: &T, numbers: &[[Real; N]], out: &mut Vec<[Real; M]>) {
        self.gather_at(Level::Avx512, law, numbers, out);
    }

    fn gather_at<T: Meet<N, M>, const N: usize, const M: usize>(
        &self,
        level: Level,
        law: &T,
        numbers: &[[Real; N]],
        out: &mut Vec<[Real; M]>,
    ) {
        out.resize(self.len(), [0.0; M]);
        debug_assert_eq!(numbers.len(), self.len());
        // In a box that repeats itself the law finds the nearest images, and all are shown to it.
        let reach = if self.sides.is_some() { f64::INFINITY } else { self.width() };
        self.by_tasks(out, |tiles, runs, out| dispatch_at(level, Sum { law, reach, numbers, tiles, runs, out }));
    }

    /// `f(place, candidates, its part of out)` for every place, where the candidates are runs of places.
    pub fn each<T: Send>(&self, out: &mut [T], f: impl Fn(usize, &[[u32; 2]], &mut T) + Sync) {
        self.by_tasks(out, |tiles, runs, out| {
            let (each, base) = (runs.len() / tiles.len().max(1), tiles[0].places[0]);
            for (tile, runs) in tiles.iter().zip(runs.chunks_exact(each)) {
                for place in tile.places[0]..tile.places[1] {
                    f(place as usize, runs, &mut out[(place - base) as usize]);
                }
            }
        });
    }

    /// `f(tiles, their runs, their part of out)`, a fixed number of tiles at a time.
    fn by_tasks<T: Send>(&self, out: &mut [T], f: impl Fn(&[Tile], &[[u32; 2]], &mut [T]) + Sync) {
        let each = if self.sides.is_some() { 2 * LINES } else { LINES };
        let mut rest = out;
        let mut tasks = Vec::new();
        for (tiles, runs) in self.tiles.chunks(TASK).zip(self.runs.chunks(TASK * each)) {
            let count = tiles.iter().map(|t| (t.places[1] - t.places[0]) as usize).sum();
            let (out, other) = rest.split_at_mut(count);
            tasks.push((tiles, runs, out));
            rest = other;
        }
        if self.len() <= CHUNK / 16 {
            tasks.into_iter().for_each(|(tiles, runs, out)| f(tiles, runs, out));
        } else {
            tasks.into_iter().in_parallel(|(tiles, runs, out)| f(tiles, runs, out));
        }
    }
}

/// One line back along y and along z.
const LINE_BACK: u128 = (1 << BITS) + (1 << (2 * BITS));

/// Sums over the neighbours of some tiles. The points of a tile lie side by side in a register, their neighbours come one by one:
/// each sum is added up in the order of places, whatever the width of the register and whoever shares it.    (neighbours.3)
/// Whoever no point of the tile reaches is passed over: less than half of all in the cells remain.
struct Sum<'a, T, const N: usize, const M: usize> {
    law: &'a T,
    reach: f64,
    numbers: &'a [[Real; N]],
    tiles: &'a [Tile],
    runs: &'a [[u32; 2]],
    out: &'a mut [[Real; M]],
}

/// Neighbours that are listed before they are met.
const LIST: usize = 256;

/// Places below `numbers.len()`.
struct List {
    places: [u32; LIST],
    count: usize,
}

impl List {
    #[inline(always)]
    fn new() -> Self {
        Self { places: [0; LIST], count: 0 }
    }

    /// Adds a place if it is `near`; there is room for it. Without a branch, which could not be foreseen.
    #[inline(always)]
    fn add(&mut self, place: u32, near: bool) {
        self.places[self.count % LIST] = place;
        self.count += usize::from(near);
    }

    /// Takes all.
    #[inline(always)]
    fn take(&mut self) -> &[u32] {
        let count = std::mem::take(&mut self.count);
        &self.places[..count]
    }
}

impl<T: Meet<N, M>, const N: usize, const M: usize> Kernel for Sum<'_, T, N, M> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        let Some(base) = self.tiles.first().map(|t| t.places[0] as usize) else { return };
        let each = self.runs.len() / self.tiles.len();
        // A little more, so that rounding hides no neighbour.
        let square = |reach: f64| w.splat(((1.0 + 1e-5) * reach * reach).min(f64::from(Real::MAX)) as Real);
        let (far, close) = (square(self.reach), square(self.law.close()));
        let (mut near, mut nearer) = (List::new(), List::new());
        for (tile, runs) in self.tiles.iter().zip(self.runs.chunks_exact(each)) {
            let (mut first, end) = (tile.places[0] as usize, tile.places[1] as usize);
            while first < end {
                let count = W::N.min(end - first);
                let mut columns = [[0.0; TILE]; N];
                for k in 0..W::N {
                    let numbers = &self.numbers[first + k.min(count - 1)];
                    for c in 0..N {
                        columns[c][k] = numbers[c];
                    }
                }
                let mut here = [w.splat(0.0); N];
                for c in 0..N {
                    here[c] = w.load(&columns[c]);
                }
                let mut sum = [w.splat(0.0); M];
                for (line, [a, b]) in runs.iter().enumerate() {
                    let (mut place, end) = (*a, *b);
                    loop {
                        let stop = end.min(place + (LIST - near.count) as u32);
                        for place in place..stop {
                            let there = &self.numbers[place as usize];
                            let (x, y, z) = (w.splat(there[0]) - here[0], w.splat(there[1]) - here[1], w.splat(there[2]) - here[2]);
                            let r_sq = x * x + y * y + z * z;
                            near.add(place, (far - r_sq).any_positive());
                            if self.law.close() > 0.0 {
                                nearer.add(place, (close - r_sq).any_positive());
                            }
                        }
                        place = stop;
                        if near.count == LIST || (place == end && line + 1 == runs.len()) {
                            for place in near.take() {
                                sum = self.law.meet(here, splat(w, &self.numbers[*place as usize]), sum);
                            }
                            for place in nearer.take() {
                                sum = self.law.meet_close(here, splat(w, &self.numbers[*place as usize]), sum);
                            }
                        }
                        if place == end {
                            break;
                        }
                    }
                }
                let mut sums = [[0.0; TILE]; M];
                for m in 0..M {
                    w.store(sum[m], &mut sums[m]);
                }
                for k in 0..count {
                    for m in 0..M {
                        self.out[first - base + k][m] = sums[m][k];
                    }
                }
                first += count;
            }
        }
    }
}

#[inline(always)]
fn splat<W: Width, const N: usize>(w: W, numbers: &[Real; N]) -> [W::L; N] {
    let mut all = [w.splat(0.0); N];
    for c in 0..N {
        all[c] = w.splat(numbers[c]);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    /// Counts neighbours and adds up who they are.
    struct Count {
        reach: f64,
        sides: Option<[f64; 3]>,
    }

    impl Count {
        fn apart<L: Lane>(&self, mut d: L, a: usize) -> L {
            if let Some(sides) = self.sides {
                let (side, half) = (d.like(sides[a]), d.like(0.5 * sides[a]));
                d = (d - half).positive(d - side, d);
                d = (-d - half).positive(d + side, d);
            }
            d
        }
    }

    impl Meet<4, 2> for Count {
        #[inline(always)]
        fn meet<L: Lane>(&self, here: [L; 4], there: [L; 4], sum: [L; 2]) -> [L; 2] {
            let mut r_sq = here[0].zero();
            for a in 0..3 {
                let d = self.apart(there[a] - here[a], a);
                r_sq = r_sq + d * d;
            }
            let near = r_sq.like(self.reach * self.reach) - r_sq;
            [sum[0] + near.positive(r_sq.like(1.0), r_sq.zero()), sum[1] + near.positive(there[3], r_sq.zero())]
        }
    }

    fn sums(x: &[Row], grid: &mut Neighbours, level: Level) -> Vec<[Real; 2]> {
        let law = Count { reach: grid.reach, sides: grid.sides };
        grid.rebuild(x);
        let (mut numbers, mut out) = (Vec::new(), Vec::new());
        grid.sorted(|i| [x[i][0], x[i][1], x[i][2], (i % 61) as Real], &mut numbers);
        grid.gather_at(level, &law, &numbers, &mut out);
        (0..x.len()).map(|i| grid.place(i).map_or([0.0; 2], |p| out[p])).collect()
    }

    fn naive(x: &[Row], reach: f64, sides: Option<[f64; 3]>) -> Vec<[Real; 2]> {
        let law = Count { reach, sides };
        let numbers = |i: usize| [x[i][0], x[i][1], x[i][2], (i % 61) as Real];
        let finite = |i: usize| x[i][..3].iter().all(|c| c.is_finite());
        let one =
            |i: usize| (0..x.len()).filter(|j| finite(i) && finite(*j)).fold([0.0; 2], |sum, j| law.meet(numbers(i), numbers(j), sum));
        (0..x.len()).map(one).collect()
    }

    fn cloud(n: usize, size: [f64; 3], seed: u32) -> Vec<Row> {
        let random = Random::new(seed, "cloud");
        let at = |i: usize| random.uniform(i as u64, 0, 0);
        (0..n).map(|i| std::array::from_fn(|a| if a < 3 { ((at(i)[a] - 0.5) * size[a]) as Real } else { 0.0 })).collect()
    }

    /// Whole numbers up to 2^24 add up without rounding: the sums are equal if and only if the pairs are.
    #[test]
    fn pairs_are_those_of_all_with_all() {
        let mut clustered = cloud(400, [0.4, 0.4, 0.4], 2);
        clustered.extend(cloud(300, [30.0, 30.0, 30.0], 3));
        let mut broken = cloud(200, [3.0, 3.0, 3.0], 4);
        broken[17] = [Real::NAN, 0.0, 0.0, 0.0];
        broken[18] = [0.0, Real::INFINITY, 0.0, 0.0];
        broken[19] = [1e30, -1e30, 1e30, 0.0];
        broken[20] = [1e30, -1e30, 1e30, 0.0];
        let cases = [
            cloud(900, [5.0, 5.0, 5.0], 1),
            cloud(900, [9.0, 9.0, 0.0], 5),
            cloud(100, [4000.0, 0.0, 0.0], 6),
            clustered,
            broken,
            vec![[1.0, 2.0, 3.0, 0.0]; 300],
            vec![[-0.5, 0.0, 0.0, 0.0]],
            vec![],
        ];
        for (c, x) in cases.iter().enumerate() {
            for reach in [0.7, 1.3] {
                let right = naive(x, reach, None);
                for level in Level::available() {
                    assert_eq!(sums(x, &mut Neighbours::new(reach), level), right, "case {c}, {level:?}");
                }
            }
            assert!(x.len() < 2 || naive(x, 1.3, None).iter().any(|s| s[0] > 1.0), "case {c} has no pairs");
        }
    }

    #[test]
    fn pairs_in_a_periodic_box_are_those_of_nearest_images() {
        // Boxes of one to many cells along an axis.
        for sides in [[3.1, 3.1, 3.1], [8.0, 2.5, 3.0], [9.0, 9.0, 2.0], [2.0, 4.4, 40.0]] {
            let mut x = cloud(500, sides, 7);
            x.iter_mut().for_each(|x| (0..3).for_each(|a| x[a] += (0.5 * sides[a]) as Real));
            let right = naive(&x, 1.0, Some(sides));
            let mut open = Neighbours::new(1.0);
            assert_ne!(sums(&x, &mut open, Level::Scalar), right);
            for level in Level::available() {
                assert_eq!(sums(&x, &mut Neighbours::periodic(1.0, sides), level), right, "{sides:?}, {level:?}");
            }
        }
    }

    /// By cell, and by index within a cell, whatever the chunks and the threads; cells close together, far apart, and periodic.
    #[test]
    fn places_follow_cells_and_points_on_any_number_of_threads() {
        for (size, sides) in [(20.0, None), (5e4, None), (20.0, Some([20.0; 3]))] {
            let mut x = cloud(3 * CHUNK + 17, [size; 3], 9);
            x[5][1] = Real::NAN;
            x[2 * CHUNK][2] = Real::INFINITY;
            for threads in [1, 2, 8] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let mut grid = Neighbours { sides, ..Neighbours::new(1.0) };
                // Twice: nothing is left over from the first time.
                pool.install(|| grid.rebuild(&cloud(4 * CHUNK, [50.0; 3], 10)));
                pool.install(|| grid.rebuild(&x));
                let cell = |i: &u32| grid.cell(&x[*i as usize], 1.0 / grid.width(), grid.counts()).map(key);
                let mut right: Vec<u32> = (0..x.len() as u32).filter(|i| cell(i).is_some()).collect();
                right.sort_by_key(|i| (cell(i), *i));
                assert_eq!(grid.order, right, "{size}, {threads} threads");
                assert_eq!(grid.len(), x.len() - 2);
                assert!((0..x.len()).all(|i| grid.place(i).map(|p| right[p]) == cell(&(i as u32)).map(|_| i as u32)));
                assert!(grid.cells.len() > 1000 && grid.cells.windows(2).all(|w| w[0] < w[1]));
                assert!(
                    grid.cells
                        .iter()
                        .zip(grid.start.windows(2))
                        .all(|(c, w)| right[w[0] as usize..w[1] as usize].iter().all(|i| cell(i) == Some(*c)))
                );
            }
        }
    }

    #[test]
    fn a_reach_of_nothing_finds_nobody_and_does_not_panic() {
        for reach in [0.0, Real::NAN as f64, f64::INFINITY, -1.0] {
            let x = cloud(100, [1.0; 3], 8);
            let found = sums(&x, &mut Neighbours::new(reach), Level::Scalar);
            assert!(found.iter().all(|s| s[0] <= 1.0));
        }
    }
}
