//! Transport in flux form: what leaves a cell through a face enters the next (grids.21, grids.22).
//!
//! ```text
//!   for each axis in turn:  the flux of a face is the volume that passes it times the mean of the cell's slope over it
//!                           volumes and contents of cells take their fluxes;  the value is content over volume
//! ```
//!
//! Sweeps along one axis squeeze cells, which the volume remembers: a constant stays one, and no new extrema arise as long as no cell
//! loses all that it has, for which the step is cut. Source: [easter1993], [roe1986]; tests: crates/tumble-f64/tests/transport.rs.

use super::stencil::{each_row, fetch, ghosted, reach};
use crate::math::parallel::{self, sum};
use crate::math::simd::{Kernel, Width, dispatch};
use crate::math::{Real, Spare};
use crate::state::{Field, Grid, GridError, Place, Side, Vectors};

/// The largest share of itself that a cell may lose in a step.
const MOST: f64 = 0.9;

/// What thins out to this is nothing: numbers with fewer digits would be slow.
const NOTHING: Real = 1e8 * Real::MIN_POSITIVE;

/// Pairs of sweeps at most: whoever needs more has other worries.
const MOST_PAIRS: f64 = 1e3;

/// A slope over a cell from those on both sides of it: the steepest that makes no new extremum.            (grids.22)
#[inline(always)]
fn superbee(a: Real, b: Real) -> Real {
    let (x, y) = (a.abs(), b.abs());
    let small = if 2.0 * x < y { 2.0 * x } else { y };
    let other = if x < 2.0 * y { x } else { 2.0 * y };
    let steep = if small > other { small } else { other };
    let steep = if a < 0.0 { -steep } else { steep };
    if a * b > 0.0 { steep } else { 0.0 }
}

/// What passes a face with the volume `u`, from values of the two cells on either side and the volumes of the nearer ones.     (grids.22)
#[inline(always)]
fn flux(u: Real, [far, low, high, beyond]: [Real; 4], [of_low, of_high]: [Real; 2]) -> Real {
    let up = low + 0.5 * (1.0 - u / of_low) * superbee(low - far, high - low);
    let down = high - 0.5 * (1.0 + u / of_high) * superbee(high - low, beyond - high);
    u * if u > 0.0 { up } else { down }
}

/// A row of cells and its neighbours along an axis.
struct Row<'a> {
    out: &'a mut [Real],
    f: [&'a [Real]; 5],
    volume: [&'a [Real]; 3],
    u: [&'a [Real]; 2],
    scale: Real,
}

#[inline(always)]
fn sweep(out: &mut [Real], f: [&[Real]; 5], volume: [&[Real]; 3], u: [&[Real]; 2], scale: Real) {
    let n = out.len();
    let (f, v, u) = (f.map(|f| &f[..n]), volume.map(|v| &v[..n]), u.map(|u| &u[..n]));
    for i in 0..n {
        let (low, high) = (scale * u[0][i], scale * u[1][i]);
        let enters = flux(low, [f[0][i], f[1][i], f[2][i], f[3][i]], [v[0][i], v[1][i]]);
        let leaves = flux(high, [f[1][i], f[2][i], f[3][i], f[4][i]], [v[1][i], v[2][i]]);
        let new = (v[1][i] * f[2][i] - (leaves - enters)) / (v[1][i] - (high - low));
        out[i] = if new.abs() < NOTHING { 0.0 } else { new };
    }
}

impl Kernel for Row<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, _: W) {
        sweep(self.out, self.f, self.volume, self.u, self.scale);
    }
}

/// Calls `work(row, faces below and above)` for each row of cells.
fn with_faces(out: &mut Field, part: &Field, axis: usize, work: impl Fn(usize, usize, &mut [Real], [&[Real]; 2]) + Sync) {
    each_row(out, |j, k, row| {
        let (j0, k0, n) = (j as isize, k as isize, row.len());
        let (mut below, mut above) = (Vec::new(), Vec::new());
        if axis != 0 {
            let next = if axis == 1 { (j0 + 1, k0) } else { (j0, k0 + 1) };
            let (low, high) = (fetch(part, j0, k0, &mut below), fetch(part, next.0, next.1, &mut above));
            return work(j, k, row, [low, high]);
        }
        let low = fetch(part, j0, k0, &mut below);
        above.extend_from_slice(&low[1..]);
        above.extend((low.len() == n).then(|| low[0]));
        work(j, k, row, [low, &above]);
    });
}

/// f after a sweep along an axis in which the volume `scale u` passes faces.                             (grids.21)
fn swept(f: &Field, volume: &Field, part: &Field, axis: usize, scale: Real, out: &mut Field) {
    with_faces(out, part, axis, |j, k, row, u| {
        let (j, k, n) = (j as isize, k as isize, row.len());
        if axis == 0 {
            let padded = |f: &Field, by: isize| -> Vec<Real> { (-by..n as isize + by).map(|i| value(f, i, j, k)).collect() };
            let (f, v) = (padded(f, 2), padded(volume, 1));
            let (f, volume) = ([0, 1, 2, 3, 4].map(|m| &f[m..]), [0, 1, 2].map(|m| &v[m..]));
            return dispatch(Row { out: row, f, volume, u, scale });
        }
        let mut scratch: [Vec<Real>; 8] = Default::default();
        let [a, b, c, d, e, p, q, r] = &mut scratch;
        let at = |m: isize| if axis == 1 { (j + m, k) } else { (j, k + m) };
        let f = [(-2, a), (-1, b), (0, c), (1, d), (2, e)].map(|(m, s)| fetch(f, at(m).0, at(m).1, s));
        let volume = [(-1, p), (0, q), (1, r)].map(|(m, s)| fetch(volume, at(m).0, at(m).1, s));
        dispatch(Row { out: row, f, volume, u, scale });
    });
}

/// The value of cell (i, j, k), of which i alone may lie beyond a wall.
fn value(f: &Field, i: isize, j: isize, k: isize) -> Real {
    if (0..f.grid.n[0] as isize).contains(&i) { f.data[f.index([i as usize, j as usize, k as usize])] } else { ghosted(f, [i, j, k]) }
}

/// The largest share of a cell that flows out of it in h seconds.
fn outflow(u: &Vectors, grid: &Grid, h: f64) -> f64 {
    let [x, y, z] = grid.n;
    let plane = |k: usize| {
        let mut most = 0.0_f64;
        for (j, i) in (0..y).flat_map(|j| (0..x).map(move |i| (j, i))) {
            let mut out = 0.0;
            for (axis, part) in grid.axes().zip(&u.parts) {
                let mut next = [i, j, k];
                next[axis] = reach(part, axis, next[axis] as isize + 1).from;
                out += f64::from(part.value(next).max(0.0)) - f64::from(part.value([i, j, k]).min(0.0));
            }
            most = most.max(out);
        }
        most
    };
    h / grid.dx * parallel::map(z, plane).into_iter().fold(0.0, f64::max)
}

/// Fields at cells carried by the flow u for h seconds, in flux form; u times the open share of each face where solids are. Returns what
/// each has lost, as a sum over cells, to the divergence of u.                                          (grids.21)
pub fn transport(fields: &mut [&mut Field], u: &Vectors, h: f64, spare: &mut Spare) -> Result<Vec<f64>, GridError> {
    let grid = u.on_faces("velocity of a transport")?;
    fields.iter().try_for_each(|f| f.expect(&grid, Place::Cell, "transported field"))?;
    let pairs = (outflow(u, &grid, h) / (2.0 * MOST)).ceil().clamp(1.0, MOST_PAIRS);
    let scale = (0.5 * h / pairs / grid.dx) as Real;
    let mut like = || Ok::<_, GridError>(Field { sides: [[Side::Ghost(1.0); 2]; 3], ..spare.field(grid, Place::Cell, "1")? });
    let (mut volume, mut squeezed, mut out) = (like()?, like()?, like()?);
    let mut axes: Vec<usize> = grid.axes().collect();
    let mut lost = vec![0.0; fields.len()];
    for _ in 0..2 * pairs as usize {
        each_row(&mut volume, |_, _, row| row.fill(1.0));
        for axis in &axes {
            let Some(part) = u.part(*axis) else { continue };
            for field in fields.iter_mut() {
                swept(field, &volume, part, *axis, scale, &mut out);
                std::mem::swap(&mut field.data, &mut out.data);
            }
            with_faces(&mut squeezed, part, *axis, |j, k, row, u| {
                let at = volume.index([0, j, k]);
                let before = &volume.data[at..at + row.len()];
                for i in 0..row.len() {
                    row[i] = before[i] - (scale * u[1][i] - scale * u[0][i]);
                }
            });
            std::mem::swap(&mut volume.data, &mut squeezed.data);
        }
        for (field, lost) in fields.iter().zip(&mut lost) {
            let one = |i: usize| f64::from(field.data[i]) * (f64::from(volume.data[i]) - 1.0);
            *lost += sum(field.data.len(), |part| part.map(one).sum());
        }
        axes.reverse();
    }
    [volume, squeezed, out].into_iter().for_each(|field| spare.keep(field));
    Ok(lost)
}
