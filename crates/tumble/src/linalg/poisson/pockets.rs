//! Which cells are joined by open faces, and the means that no pressure can balance.
//!
//! A component that no open side holds has a constant that its equations do not see, and a right-hand side with a mean that they
//! cannot meet. Both are removed component by component: what a mean over all cells would leave in a pocket grows without end.
//!                                                                                                       (pressure.4)

use super::block::LANES;
use super::faces::Weight;
use super::level::{Grid, OpenFaces, Rows};
use super::report::{Excess, Fault};
use crate::math::Real;
use crate::math::parallel::Tasks;

/// Cells side by side in a row that open faces join.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Run {
    at: usize,
    cells: usize,
    component: usize,
}

impl Run {
    fn of<'a, N>(&self, column: &'a [N]) -> &'a [N] {
        &column[self.at..self.at + self.cells]
    }
}

/// Cells that are joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Component {
    cells: usize,
    /// Whether an open side, or what is added to the diagonal, fixes its constant.
    held: bool,
    /// The number of one of its cells.
    at: usize,
}

/// All components of a grid.
#[derive(Debug, Clone, Default)]
pub(super) struct Pockets {
    /// Row by row.
    runs: Vec<Run>,
    /// The first run of each row, and one more for the end.
    rows: Vec<usize>,
    components: Vec<Component>,
    /// The largest one.
    main: usize,
    /// Runs of all others.
    others: Vec<Run>,
}

/// Rows per task.
const TASK: usize = 256;

impl Pockets {
    pub fn new<T: Weight>(grid: &Grid<T>) -> Self {
        let (runs, rows, held) = find(grid);
        let mut parent: Vec<usize> = (0..runs.len()).collect();
        let n = grid.lattice.n;
        let row = |j: usize, k: usize| rows[j + n[1] * k]..rows[j + n[1] * k + 1];
        grid.each_row(|at, [j, k]| {
            let here = row(j, k);
            // Its lower neighbours along y and z, those of the first row across joined sides.
            for (axis, i) in [(1, j), (2, k)] {
                let lower = match i.checked_sub(1) {
                    Some(i) => i,
                    None if grid.periodic[axis] => n[axis] - 1,
                    None => continue,
                };
                let (lower, start) =
                    if axis == 1 { (row(lower, k), grid.lattice.at(0, lower, k)) } else { (row(j, lower), grid.lattice.at(0, j, lower)) };
                let (mut a, mut b) = (here.start, lower.start);
                while a < here.end && b < lower.end {
                    let ends = |r: &Run, start: usize| (r.at - start, r.at - start + r.cells);
                    let (one, two) = (ends(&runs[a], at), ends(&runs[b], start));
                    let (from, to) = (one.0.max(two.0), one.1.min(two.1));
                    if from < to && grid.w[axis][at + from..at + to].iter().any(|w| *w != T::CLOSED) {
                        join(&mut parent, a, b);
                    }
                    if one.1 < two.1 { a += 1 } else { b += 1 }
                }
            }
            if grid.periodic[0] && !here.is_empty() && grid.w[0][at] != T::CLOSED {
                join(&mut parent, here.start, here.end - 1);
            }
        });
        let mut out = Self { runs, rows, ..Self::default() };
        let mut name = vec![usize::MAX; parent.len()];
        for i in 0..parent.len() {
            let root = root(&mut parent, i);
            if name[root] == usize::MAX {
                name[root] = out.components.len();
                out.components.push(Component { cells: 0, held: false, at: out.runs[i].at });
            }
            out.runs[i].component = name[root];
            let component = &mut out.components[name[root]];
            component.cells += out.runs[i].cells;
            component.held |= held[i];
        }
        for (i, component) in out.components.iter().enumerate() {
            if component.cells > out.components[out.main].cells {
                out.main = i;
            }
        }
        out.others = out.runs.iter().filter(|r| r.component != out.main).copied().collect();
        out
    }

    /// Floating components and the means over each of the rows that have these entries, where they are not zero but for rounding.
    pub fn means<const N: usize>(&self, entries: &[(u32, [Real; N])]) -> Vec<(usize, [f64; N])> {
        let mut sums: Vec<(usize, [[f64; 2]; N])> = Vec::new();
        for (at, entries) in entries {
            let run = self.runs.partition_point(|run| run.at <= *at as usize);
            let Some(run) = run.checked_sub(1).map(|i| self.runs[i]).filter(|run| (*at as usize) < run.at + run.cells) else { continue };
            if self.components[run.component].held {
                continue;
            }
            let known = sums.iter().position(|(component, _)| *component == run.component).unwrap_or_else(|| {
                sums.push((run.component, [[0.0; 2]; N]));
                sums.len() - 1
            });
            for ([sum, size], entry) in sums[known].1.iter_mut().zip(entries.map(f64::from)) {
                (*sum, *size) = (*sum + entry, *size + entry.abs());
            }
        }
        let mean = |component: usize, [sum, size]: [f64; 2]| {
            if sum.abs() > 64.0 * f64::from(Real::EPSILON) * size { sum / self.components[component].cells as f64 } else { 0.0 }
        };
        let means = sums.into_iter().map(|(component, sums)| (component, sums.map(|sums| mean(component, sums))));
        means.filter(|(_, means)| means.iter().any(|mean| *mean != 0.0)).collect()
    }

    /// The numbers of the cells of a component.
    pub fn numbers(&self, component: usize) -> impl Iterator<Item = usize> + '_ {
        self.runs.iter().filter(move |run| run.component == component).flat_map(|run| run.at..run.at + run.cells)
    }

    /// How many there are beside the largest.
    pub fn count(&self) -> usize {
        self.components.len().saturating_sub(1)
    }

    /// Copies a right-hand side to the grid's b, or takes the one that is there, without the means; the sums of b and of its magnitude
    /// decide whether there are any.
    pub fn load<T: Weight>(&self, grid: &mut Grid<T>, given: Option<&[Real]>, excess: Excess) -> Result<(), Fault> {
        let from = given.unwrap_or(&grid.b);
        let parts: Vec<([f64; 2], Vec<(usize, [f64; 2])>)> =
            self.rows[..self.rows.len() - 1].chunks(TASK).enumerate().map_in_parallel(|(task, rows)| {
                let (mut main, mut others) = ([0.0; 2], Vec::new());
                let end = self.rows[task * TASK + rows.len()];
                for run in &self.runs[rows[0]..end] {
                    let [sum, size] = sums(run.of(from));
                    if run.component == self.main {
                        main = [main[0] + sum, main[1] + size];
                    } else {
                        others.push((run.component, [sum, size]));
                    }
                }
                (main, others)
            });
        let mut totals = vec![[0.0; 2]; self.components.len()];
        let mut total = |component: usize, part: [f64; 2]| {
            totals[component][0] += part[0];
            totals[component][1] += part[1];
        };
        for (main, others) in &parts {
            if !self.components.is_empty() {
                total(self.main, *main);
            }
            others.iter().for_each(|(component, part)| total(*component, *part));
        }
        if let Some(at) = (totals.iter().any(|t| !t[1].is_finite())).then(|| self.first_bad(from)).flatten() {
            return Err(Fault::NotFinite { cell: grid.cell(at) });
        }
        let allowed = match excess {
            Excess::Refuse => 0.0,
            Excess::RefuseAbove(least) => least,
            Excess::Remove => f64::INFINITY,
        };
        let mut means = vec![0.0; totals.len()];
        for ((mean, [sum, size]), component) in means.iter_mut().zip(&totals).zip(&self.components) {
            if component.held {
                continue;
            }
            *mean = sum / component.cells as f64;
            // Rounding of b alone leaves some eps of its size.
            if mean.abs() > allowed && sum.abs() > 64.0 * f64::from(Real::EPSILON) * size {
                return Err(Fault::Excess { cell: grid.cell(component.at), cells: component.cells, mean: *mean });
            }
        }
        if excess != Excess::Remove
            && let Some(at) = self.closed_excess(grid, from)
        {
            return Err(Fault::Excess { cell: grid.cell(at), cells: 1, mean: f64::from(from[at]) });
        }
        let b = Rows::of(&mut grid.b);
        self.runs.chunks(TASK).in_parallel(|runs| {
            for run in runs {
                // SAFETY: runs are disjoint.
                let out = unsafe { b.take(run.at, run.cells) };
                let mean = means[run.component] as Real;
                match given {
                    Some(from) => out.iter_mut().zip(run.of(from)).for_each(|(out, from)| *out = from - mean),
                    None => out.iter_mut().for_each(|b| *b -= mean),
                }
            }
        });
        let mut b = std::mem::take(&mut grid.b);
        self.clear(grid, &mut b);
        grid.b = b;
        Ok(())
    }

    fn first_bad(&self, b: &[Real]) -> Option<usize> {
        self.runs.iter().find_map(|run| Some(run.at + run.of(b).iter().position(|b| !b.is_finite())?))
    }

    /// The first cell without an open face that should take something in.
    fn closed_excess<T: Weight>(&self, grid: &Grid<T>, b: &[Real]) -> Option<usize> {
        let mut found = None;
        self.gaps(grid, |from, to| {
            let inside = to.min(grid.row_of(from) + grid.lattice.n[0]);
            if let (None, Some(i)) = (found, (from..inside).find(|i| b[*i] != 0.0)) {
                found = Some(i);
            }
        });
        found
    }

    /// Calls `f(from, to)` for the numbers of every row, pads included, that belong to no component.
    fn gaps<T: Weight>(&self, grid: &Grid<T>, mut f: impl FnMut(usize, usize)) {
        let mut row = 0;
        grid.each_row(|at, _| {
            let mut from = at;
            for run in &self.runs[self.rows[row]..self.rows[row + 1]] {
                if from < run.at {
                    f(from, run.at);
                }
                from = run.at + run.cells;
            }
            if from < at + grid.width {
                f(from, at + grid.width);
            }
            row += 1;
        });
    }

    /// Sets to zero what belongs to no component.
    pub fn clear<T: Weight>(&self, grid: &Grid<T>, column: &mut [Real]) {
        self.gaps(grid, |from, to| column[from..to].fill(0.0));
    }

    /// The product of r and z without their means over floating components, given the one with them, the sum of z and that of r
    /// over all cells; and the mean of z over the largest component. Other components are shifted so that each of them has lost its
    /// own mean when that of the largest is taken from all cells.
    ///
    /// Rounding gives r a mean, and nothing bounds that of z: their product would spoil the lengths of steps.
    pub fn centre(&self, z: &mut [Real], r: &[Real], [mut product, of_z, of_r]: [f64; 3]) -> [f64; 2] {
        let mut totals = vec![[0.0; 2]; self.components.len()];
        let Some(main) = totals.get_mut(self.main) else { return [product, 0.0] };
        *main = [of_z, of_r];
        for run in &self.others {
            let part = [sums(run.of(z))[0], sums(run.of(r))[0]];
            for i in 0..2 {
                totals[run.component][i] += part[i];
                totals[self.main][i] -= part[i];
            }
        }
        let mean = |[of_z, _]: [f64; 2], c: &Component| if c.held { 0.0 } else { of_z / c.cells as f64 };
        let means: Vec<f64> = totals.iter().zip(&self.components).map(|(total, c)| mean(*total, c)).collect();
        for (mean, [_, of_r]) in means.iter().zip(&totals) {
            product -= mean * of_r;
        }
        for run in &self.others {
            let shift = (means[self.main] - means[run.component]) as Real;
            z[run.at..run.at + run.cells].iter_mut().for_each(|z| *z += shift);
        }
        [product, means[self.main]]
    }
}

/// The sum and that of magnitudes, sixteen side by side.
fn sums(a: &[Real]) -> [f64; 2] {
    let mut lanes = [[0.0 as Real; LANES]; 2];
    let (blocks, rest) = a.as_chunks::<LANES>();
    for block in blocks {
        for i in 0..LANES {
            lanes[0][i] += block[i];
            lanes[1][i] += block[i].abs();
        }
    }
    for (i, a) in rest.iter().enumerate() {
        lanes[0][i] += a;
        lanes[1][i] += a.abs();
    }
    lanes.map(|lanes| lanes.iter().map(|a| f64::from(*a)).sum())
}

fn root(parent: &mut [usize], mut i: usize) -> usize {
    while parent[i] != i {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    i
}

/// The smaller of two roots becomes that of both.
fn join(parent: &mut [usize], a: usize, b: usize) {
    let (a, b) = (root(parent, a), root(parent, b));
    parent[a.max(b)] = a.min(b);
}

/// The runs of all rows, the first of each row, and whether each run is held.
fn find<T: Weight>(grid: &Grid<T>) -> (Vec<Run>, Vec<usize>, Vec<bool>) {
    let (n, stride) = (grid.lattice.n, grid.lattice.stride);
    let (mut runs, mut rows, mut held) = (Vec::<Run>::new(), vec![0], Vec::new());
    let open = |axis: usize, at: usize| grid.w[axis][at] != T::CLOSED;
    let mut block = 0;
    grid.each_row(|at, [j, k]| {
        let first = runs.len();
        // Sides of the box that this row touches and that lead outside.
        let outside: Vec<(usize, usize)> = [(1, j), (2, k)]
            .into_iter()
            .filter(|(axis, _)| !grid.periodic[*axis])
            .flat_map(|(axis, i)| {
                let lower = (i == 0).then_some((axis, 0));
                let upper = (i + 1 == n[axis]).then_some((axis, stride[axis]));
                lower.into_iter().chain(upper)
            })
            .collect();
        let holds = |i: usize| {
            let side = !grid.periodic[0] && (i == 0 && open(0, at) || i + 1 == n[0] && open(0, at + n[0]));
            side || outside.iter().any(|(axis, up)| open(*axis, at + i + up)) || grid.extra.as_ref().is_some_and(|e| e[at + i] > 0.0)
        };
        let mut joined = false;
        let mut i = 0;
        while i < n[0] {
            let whole = i % LANES == 0 && grid.kinds[block + i / LANES] != OpenFaces::Mixed;
            let count = if whole { LANES } else { 1 };
            let alive = whole || (0..3).any(|a| open(a, at + i) || open(a, at + i + stride[a])) || holds(i);
            if alive {
                if joined && open(0, at + i) {
                    if let Some(run) = runs.last_mut() {
                        run.cells += count;
                    }
                } else {
                    runs.push(Run { at: at + i, cells: count, component: 0 });
                    held.push(false);
                }
                if let Some(held) = held.last_mut() {
                    *held |= (i..i + count).any(&holds);
                }
            }
            joined = alive;
            i += count;
        }
        debug_assert!(first <= runs.len());
        rows.push(runs.len());
        block += grid.width / LANES;
    });
    (runs, rows, held)
}

impl<T: Weight> Grid<T> {
    /// The first number of the row that holds number `at`.
    fn row_of(&self, at: usize) -> usize {
        let first = self.lattice.at(0, 0, 0);
        first + (at - first) / self.lattice.stride[1] * self.lattice.stride[1]
    }

    /// The cell of a number.
    pub(super) fn cell(&self, at: usize) -> [usize; 3] {
        let [_, row, plane] = self.lattice.stride;
        let at = at - self.lattice.at(0, 0, 0);
        [at % plane % row, at % plane / row, at / plane]
    }
}
