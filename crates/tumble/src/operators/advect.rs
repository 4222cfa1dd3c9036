//! Semi-Lagrangian advection: the value at a point is the one that was where its fluid came from (grids.15 to 20).
//!
//! ```text
//!   advect        for each row:  trace the path back through u;  read the fields where it ends
//!     corrected   for each row:  trace forward;  read what was carried;  add half of what the way there and back changed
//! ```
//!
//! Stable at any step. Paths stay within walls and wrap where the grid is periodic. Positions are displacements from the row's own
//! points: a shift by whole cells changes no bit. Source: [stam1999], [selle2008]; tests: crates/tumble-f64/tests/advection.rs.

use super::sample::{COUNT, Interpolation, Lot, SEGMENT, Spots, Start, View, corners, locate, read, read_still};
use super::stencil::{each_row, each_row_with};
use crate::math::simd::{Kernel, Width, dispatch, packs};
use crate::math::{Lane, Real, Spare, functions};
use crate::state::{Field, Grid, GridError, Place, Vectors};

/// How a path is traced.                                                    (grids.16)
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Trace {
    /// One velocity, that at the start.
    Euler,
    /// The velocity in the middle.
    #[default]
    Rk2,
    /// Three velocities.
    Rk3,
}

/// How fields are carried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Advection {
    /// The path.
    pub trace: Trace,
    /// Pieces that the path is cut into, at least 1.
    pub substeps: usize,
    /// Values between points.
    pub interpolation: Interpolation,
    /// MacCormack's correction, limited; not of vectors that turn.                                     (grids.18, grids.19)
    pub corrected: bool,
    /// Vectors turn with the fluid.                                           (grids.20)
    pub turning: bool,
}

impl Default for Advection {
    fn default() -> Self {
        Self { trace: Trace::Rk2, substeps: 1, interpolation: Interpolation::Linear, corrected: false, turning: false }
    }
}

/// Displacements of a segment [cells].
type Ways = [Lot<Real>; 3];

/// The velocity, ready to be traced through.
struct Flow<'a> {
    grid: Grid,
    views: Vec<(usize, View<'a>)>,
    trace: Trace,
    substeps: usize,
    /// Cells per velocity in a sub-step.
    step: f64,
}

struct Move<'a> {
    to: &'a mut Ways,
    from: Option<&'a Ways>,
    k: [(&'a Ways, Real); 3],
    axes: [bool; 3],
    count: usize,
}

impl Kernel for Move<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        let Self { to, from, k, axes, count } = self;
        for a in 0..3 {
            if !axes[a] {
                continue;
            }
            let mut e = 0;
            while e < count {
                let mut sum = w.load(&k[0].0[a][e..]) * w.splat(k[0].1);
                if k[1].1 != 0.0 {
                    sum = sum + w.load(&k[1].0[a][e..]) * w.splat(k[1].1) + w.load(&k[2].0[a][e..]) * w.splat(k[2].1);
                }
                let new = match from {
                    Some(from) => w.load(&from[a][e..]) - sum,
                    None => w.load(&to[a][e..]) - sum,
                };
                w.store(new, &mut to[a][e..]);
                e += W::N;
            }
        }
    }
}

struct Hold<'a> {
    d: &'a mut Lot<Real>,
    /// The first point and, along x, the next ones, from the lower wall; the upper wall.
    first: Real,
    along: bool,
    wall: Real,
    count: usize,
}

impl Kernel for Hold<'_> {
    type Output = ();
    /// Moves to the walls what is beyond them.
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        let mut e = 0;
        while e < self.count {
            let mut x = w.splat(self.first);
            if self.along {
                x = x + w.load(&COUNT[e % 16..]) + w.splat((e / 16 * 16) as Real);
            }
            let (low, high, d) = (-x, w.splat(self.wall) - x, w.load(&self.d[e..]));
            let d = (d - low).positive(d, low);
            w.store((high - d).positive(d, high), &mut self.d[e..]);
            e += W::N;
        }
    }
}

impl<'a> Flow<'a> {
    fn new(u: &'a Vectors, h: f64, how: &Advection) -> Result<Self, GridError> {
        let grid = u.on_faces("velocity of an advection")?;
        let views = grid.axes().zip(&u.parts).map(|(a, f)| (a, View::new(f, Interpolation::Linear))).collect();
        let substeps = how.substeps.max(1);
        Ok(Self { grid, views, trace: how.trace, substeps, step: h / substeps as f64 / grid.dx })
    }

    /// The velocity at displaced points; not displaced where there is no `d`.
    fn at(&self, start: Start, d: Option<&Ways>, count: usize, spots: &mut Spots, out: &mut Ways) {
        for (a, view) in &self.views {
            let Some(d) = d else {
                read_still(view, start, count, &mut out[*a]);
                continue;
            };
            locate(view, start, d, count, spots);
            read(view, spots, count, &mut out[*a]);
        }
    }

    /// Leaves in `work.d` the displacements to where the fluid at the points was; `sign` -1: to where it will be.
    fn trace(&self, start: Start, count: usize, sign: f64, work: &mut Work) {
        let axes: [bool; 3] = std::array::from_fn(|a| self.grid.flat != Some(a));
        let Work { d, p, k1, k2, k3, spots, .. } = work;
        let h = self.step * sign;
        let move_by = |to: &mut Ways, from: Option<&Ways>, k: &Ways, c: f64| {
            dispatch(Move { to, from, k: [(k, c as Real), (k, 0.0), (k, 0.0)], axes, count });
        };
        for piece in 0..self.substeps {
            if piece == 0 {
                *d = [[0.0; SEGMENT]; 3];
                self.at(start, None, count, spots, k1);
            } else {
                self.at(start, Some(d), count, spots, k1);
            }
            match self.trace {
                Trace::Euler => move_by(d, None, k1, h),
                Trace::Rk2 => {
                    move_by(p, Some(d), k1, 0.5 * h);
                    self.at(start, Some(p), count, spots, k2);
                    move_by(d, None, k2, h);
                }
                Trace::Rk3 => {
                    move_by(p, Some(d), k1, 0.5 * h);
                    self.at(start, Some(p), count, spots, k2);
                    move_by(p, Some(d), k2, 0.75 * h);
                    self.at(start, Some(p), count, spots, k3);
                    let [a, b, c] = [2.0, 3.0, 4.0].map(|c| (c / 9.0 * h) as Real);
                    dispatch(Move { to: d, from: None, k: [(k1, a), (k2, b), (k3, c)], axes, count });
                }
            }
            for a in (0..3).filter(|a| axes[*a] && !self.grid.periodic[*a]) {
                let first = (start.at[a] as f64 + start.offset[a]) as Real;
                dispatch(Hold { d: &mut d[a], first, along: a == 0, wall: self.grid.n[a] as Real, count });
            }
        }
    }
}

/// Workspace of a task.
struct Work {
    d: Ways,
    p: Ways,
    k1: Ways,
    k2: Ways,
    k3: Ways,
    spots: Spots,
    values: Lot<Real>,
    corners: [Lot<Real>; 2],
}

impl Work {
    fn new() -> Self {
        let none = [[0.0; SEGMENT]; 3];
        let (values, corners) = ([0.0; SEGMENT], [[0.0; SEGMENT]; 2]);
        Self { d: none, p: none, k1: none, k2: none, k3: none, spots: Spots::new(), values, corners }
    }
}

/// Fields at one location after advection by the flow u for h seconds, in columns of `spare`. They share their paths.
pub fn advect(fields: &[&Field], u: &Vectors, h: f64, how: &Advection, spare: &mut Spare) -> Result<Vec<Field>, GridError> {
    let flow = Flow::new(u, h, how)?;
    let Some(first) = fields.first() else { return Ok(Vec::new()) };
    fields.iter().try_for_each(|f| f.expect(&flow.grid, first.place, "advected field"))?;
    let offset = flow.grid.offset(first.place);
    let views: Vec<View> = fields.iter().map(|f| View::new(f, how.interpolation)).collect();
    let mut like = |f: &Field| Ok(Field { sides: f.sides, ..spare.field(f.grid, f.place, f.unit.clone())? });
    let mut carried: Vec<Field> = fields.iter().map(|f| like(f)).collect::<Result<_, GridError>>()?;
    if !how.corrected {
        let mut all: Vec<&mut Field> = carried.iter_mut().collect();
        each_row_with(&mut all, Work::new, |work, j, k, rows| carry(&flow, &views, Start { at: [0, j, k], offset }, rows, &mut [], work));
        return Ok(carried);
    }
    // The cells that paths come from: their corners are bounds. Fields that are read alike share them.
    let mut group = vec![0; fields.len()];
    for c in 1..fields.len() {
        group[c] = group[c - 1] + usize::from(!views[c].is_like(&views[c - 1]));
    }
    let mut cells: Vec<Field> = (0..=group[fields.len() - 1]).map(|_| like(first)).collect::<Result<_, GridError>>()?;
    let mut out: Vec<Field> = fields.iter().map(|f| like(f)).collect::<Result<_, GridError>>()?;
    let mut all: Vec<&mut Field> = carried.iter_mut().chain(&mut cells).collect();
    each_row_with(&mut all, Work::new, |work, j, k, rows| {
        let (carried, cells) = rows.split_at_mut(fields.len());
        carry(&flow, &views, Start { at: [0, j, k], offset }, carried, cells, work);
    });
    let back: Vec<View> = carried.iter().map(|f| View::new(f, how.interpolation)).collect();
    let mut all: Vec<&mut Field> = out.iter_mut().collect();
    each_row_with(&mut all, Work::new, |work, j, k, rows| {
        let n = rows.first().map_or(0, |row| row.len());
        let at = first.index([0, j, k]);
        for i in (0..n).step_by(SEGMENT) {
            let (start, len) = (Start { at: [i, j, k], offset }, SEGMENT.min(n - i));
            flow.trace(start, len, -1.0, work);
            for (c, row) in rows.iter_mut().enumerate() {
                if c == 0 || group[c] != group[c - 1] {
                    locate(&back[c], start, &work.d, len, &mut work.spots);
                }
                read(&back[c], &work.spots, len, &mut work.values);
                let from: &[i32] = bytemuck::cast_slice(&cells[group[c]].data[at..at + n]);
                corners(&views[c], &from[i..i + len], &mut work.corners);
                let of = |f: &'_ Field| -> std::ops::Range<usize> { f.index([i, j, k])..f.index([i, j, k]) + len };
                let (from, there) = (&fields[c].data[of(fields[c])], &carried[c].data[of(&carried[c])]);
                dispatch(Correct { out: &mut row[i..i + len], from, there, back: &work.values, bounds: &work.corners });
            }
        }
    });
    drop((views, back));
    carried.into_iter().chain(cells).for_each(|field| spare.keep(field));
    Ok(out)
}

struct Correct<'a> {
    out: &'a mut [Real],
    from: &'a [Real],
    there: &'a [Real],
    back: &'a [Real],
    bounds: &'a [Lot<Real>; 2],
}

impl Kernel for Correct<'_> {
    type Output = ();
    /// (grids.18, grids.19)
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        let Self { out, from, there, back, bounds } = self;
        packs!(W, w, (0..out.len()), |e| {
            let new = w.load(&there[e..]) + w.splat(0.5) * (w.load(&from[e..]) - w.load(&back[e..]));
            let (low, high) = (w.load(&bounds[0][e..]), w.load(&bounds[1][e..]));
            let new = (new - low).positive(new, low);
            w.store((high - new).positive(new, high), &mut out[e..]);
        });
    }
}

/// One way: fills a row of each field, and one of the cells that the paths of fields read alike come from if there are rows for them.
fn carry(flow: &Flow, views: &[View], start: Start, rows: &mut [&mut [Real]], cells: &mut [&mut [Real]], work: &mut Work) {
    let n = rows.first().map_or(0, |row| row.len());
    for i in (0..n).step_by(SEGMENT) {
        let (start, len) = (Start { at: [i, start.at[1], start.at[2]], ..start }, SEGMENT.min(n - i));
        flow.trace(start, len, 1.0, work);
        let mut group = 0;
        for (c, row) in rows.iter_mut().enumerate() {
            if c == 0 || !views[c].is_like(&views[c - 1]) {
                locate(&views[c], start, &work.d, len, &mut work.spots);
                if let Some(cells) = cells.get_mut(group) {
                    bytemuck::cast_slice_mut::<Real, i32>(cells)[i..i + len].copy_from_slice(&work.spots.index[..len]);
                }
                group += 1;
            }
            read(&views[c], &work.spots, len, &mut work.values);
            row[i..i + len].copy_from_slice(&work.values[..len]);
        }
    }
}

/// Vectors on faces after advection, component by component or, if `turning`, rotated with the fluid as a whole; then they are not corrected.
pub fn advect_vectors(vectors: &Vectors, u: &Vectors, h: f64, how: &Advection, spare: &mut Spare) -> Result<Vectors, GridError> {
    let grid = vectors.on_faces("advected vectors")?;
    if !how.turning {
        let parts = vectors.parts.iter().map(|f| advect(&[f], u, h, how, spare));
        return Ok(Vectors { parts: parts.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect() });
    }
    let flow = Flow::new(u, h, how)?;
    if flow.grid != grid {
        return Err(GridError::Grids { what: "advected vectors" });
    }
    let mut turn = Vectors::edges(grid, "1/s")?;
    super::curl(u, &mut turn)?;
    let spin: Vec<(usize, View)> = (0..3).filter_map(|a| turn.part(a).map(|f| (a, View::new(f, Interpolation::Linear)))).collect();
    let views: Vec<(usize, View)> = grid.axes().zip(&vectors.parts).map(|(a, f)| (a, View::new(f, how.interpolation))).collect();
    let mut parts = Vec::new();
    for (axis, f) in grid.axes().zip(&vectors.parts) {
        let mut part = Field { sides: f.sides, ..spare.field(grid, Place::Face(axis), f.unit.clone())? };
        let offset = grid.offset(part.place);
        each_row(&mut part, |j, k, row| {
            let mut work = Work::new();
            let (mut v, mut w) = ([[0.0; SEGMENT]; 3], [[0.0; SEGMENT]; 3]);
            for i in (0..row.len()).step_by(SEGMENT) {
                let (start, len) = (Start { at: [i, j, k], offset }, SEGMENT.min(row.len() - i));
                flow.trace(start, len, 1.0, &mut work);
                let Work { d, p: middle, spots, .. } = &mut work;
                for (middle, d) in middle.as_flattened_mut().iter_mut().zip(d.as_flattened()) {
                    *middle = 0.5 * *d;
                }
                for (a, view) in &views {
                    locate(view, start, d, len, spots);
                    read(view, spots, len, &mut v[*a]);
                }
                for (a, view) in &spin {
                    locate(view, start, middle, len, spots);
                    read(view, spots, len, &mut w[*a]);
                }
                for e in 0..len {
                    let at = |lots: &Ways| [0, 1, 2].map(|a| f64::from(lots[a][e]));
                    row[i + e] = turned(at(&v), at(&w).map(|w| 0.5 * h * w))[axis] as Real;
                }
            }
        });
        parts.push(part);
    }
    Ok(Vectors { parts })
}

/// v turned by the rotation vector r: Rodrigues' formula.                          (grids.20)
fn turned(v: [f64; 3], r: [f64; 3]) -> [f64; 3] {
    let angle = (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]).sqrt();
    if !(angle.is_finite() && angle > 0.0) {
        return v;
    }
    let n = r.map(|r| r / angle);
    let (s, c) = (functions::sin(angle), functions::cos(angle));
    let along = (n[0] * v[0] + n[1] * v[1] + n[2] * v[2]) * (1.0 - c);
    let cross = |a: usize| n[(a + 1) % 3] * v[(a + 2) % 3] - n[(a + 2) % 3] * v[(a + 1) % 3];
    std::array::from_fn(|a| c * v[a] + s * cross(a) + along * n[a])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::Place;

    /// Numbers without a pattern.
    fn noisy(grid: Grid, place: Place, seed: u32) -> Field {
        let hash = |x: [f64; 3]| (x[0] * 12.9898 + x[1] * 78.233 + x[2] * 37.719 + f64::from(seed)).sin() * 43758.5453;
        Field::of(grid, place, "", |x| hash(x) - hash(x).floor() - 0.5).unwrap()
    }

    fn shifted(f: &Field, by: [isize; 3]) -> Field {
        let mut out = f.clone();
        for at in f.each() {
            let to = std::array::from_fn(|a| (at[a] as isize + by[a]).rem_euclid(f.grid.n[a] as isize) as usize);
            let i = out.index(to);
            out.data[i] = f.value(at);
        }
        out
    }

    #[test]
    fn a_period_more_or_less_changes_nothing() {
        // 41 in single and 49 in double precision are less than one when multiplied with their rounded inverses.
        let g = Grid::new([41, 49, 1], 0.25, [0.0; 3]).unwrap().flat(2).unwrap().periodic([true; 3]);
        let (f, h, how) = (noisy(g, Place::Cell, 1), 0.5, Advection::default());
        for (axis, periods) in [0, 1].into_iter().flat_map(|axis| [-2, -1, 0, 1, 2].map(|p| (axis, p))) {
            let cells = f64::from(periods) * g.n[axis] as f64 + 0.25;
            let u = Vectors::of(g, "m/s", |_| std::array::from_fn(|a| if a == axis { cells * g.dx / h } else { 0.0 })).unwrap();
            let out = advect(&[&f], &u, h, &how, &mut Spare::default()).unwrap().remove(0);
            for at in f.each() {
                let mut before = at;
                before[axis] = (at[axis] + g.n[axis] - 1) % g.n[axis];
                let (a, b) = (f.value(before), f.value(at));
                assert_eq!(out.value(at), a + 0.75 * (b - a), "{axis} {periods} {at:?}");
            }
        }
    }

    /// In the engine's own precision; more in crates/tumble-f64/tests/advection.rs.
    #[test]
    fn whole_cells_are_carried_and_noticed_exactly() {
        let g = Grid::new([37, 7, 6], 0.25, [0.0; 3]).unwrap().periodic([true; 3]);
        let (f, by, h) = (noisy(g, Place::Cell, 1), [-3, 2, 1], 0.5);
        let even = Vectors::of(g, "m/s", |_| by.map(|c: isize| c as f64 * g.dx / h)).unwrap();
        let uneven = Vectors { parts: (0..3).map(|a| noisy(g, Place::Face(a), 2 + a as u32)).collect() };
        let moved = Vectors { parts: uneven.parts.iter().map(|p| shifted(p, by)).collect() };
        for interpolation in [Interpolation::Linear, Interpolation::MonotoneCubic] {
            for corrected in [false, true] {
                let how = Advection { interpolation, corrected, ..Advection::default() };
                let go = |f: &Field, u: &Vectors| advect(&[f], u, h, &how, &mut Spare::default()).unwrap().remove(0);
                assert_eq!(go(&f, &even).values(), shifted(&f, by).values());
                let (here, there) = (go(&f, &uneven), go(&shifted(&f, by), &moved));
                assert_ne!(here.values(), f.values());
                assert_eq!(shifted(&here, by).values(), there.values());
            }
        }
    }
}
