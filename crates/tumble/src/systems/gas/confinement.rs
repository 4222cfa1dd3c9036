//! Vorticity confinement: a force that turns every eddy the way that it turns.
//!
//!   f = epsilon dx N x w,   N = grad |w| / |grad |w||,   w = curl u                                          (gas.8)
//!
//! Source: [fedkiw2001], eq. 11.   Degenerate: grad |w| = 0 -> no force.

use crate::fluids::rows::{Face, runs};
use crate::math::Real;
use crate::operators::{average, curl, each_row};
use crate::state::{Field, GridError, Place, Vectors};

/// u += h f.
pub fn confine(u: &mut Vectors, epsilon: f64, h: f64) -> Result<(), GridError> {
    let Some(grid) = u.parts.first().map(|p| p.grid) else { return Ok(()) };
    let mut spin = Vectors::edges(grid, "1/s")?;
    curl(u, &mut spin)?;
    let mut w: [Option<Field>; 3] = [None, None, None];
    for axis in 0..3 {
        w[axis] = spin.part(axis).map(|part| average(part, Place::Cell)).transpose()?;
    }
    let mut size = Field::new(grid, Place::Cell, "1/s")?;
    each_row(&mut size, |j, k, row| {
        let at = w.iter().flatten().next().map_or(0, |f| f.index([0, j, k]));
        for (i, size) in row.iter_mut().enumerate() {
            let sum: Real = w.iter().flatten().map(|w| w.data[at + i] * w.data[at + i]).sum();
            *size = sum.sqrt();
        }
    });
    let lattice = grid.lattice();
    // The slope of |w| times 2 dx; beyond walls |w| is as at the cell beside them.
    let slope = |axis: usize, cell: [usize; 3]| -> Real {
        let (n, here) = (grid.n[axis], cell[axis]);
        let value = |i: usize| {
            let mut c = cell;
            c[axis] = i;
            size.data[lattice.at(c[0], c[1], c[2])]
        };
        let wrap = grid.periodic[axis];
        let high = if here + 1 < n {
            here + 1
        } else if wrap {
            0
        } else {
            here
        };
        let low = if here > 0 {
            here - 1
        } else if wrap {
            n - 1
        } else {
            here
        };
        value(high) - value(low)
    };
    let scale = (h * epsilon * grid.dx) as Real;
    for part in &mut u.parts {
        let Place::Face(axis) = part.place else { continue };
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut force = Field::new(grid, Place::Cell, "m/s")?;
        each_row(&mut force, |j, k, row| {
            for (i, force) in row.iter_mut().enumerate() {
                let cell = [i, j, k];
                let mut grad = [0.0; 3];
                grid.axes().for_each(|a| grad[a] = slope(a, cell));
                let length = (grad[0] * grad[0] + grad[1] * grad[1] + grad[2] * grad[2]).sqrt();
                if length > Real::MIN_POSITIVE {
                    let at = lattice.at(i, j, k);
                    let spin = |c: usize| w[c].as_ref().map_or(0.0, |w| w.data[at]);
                    *force = scale * (grad[a] * spin(b) - grad[b] * spin(a)) / length;
                }
            }
        });
        each_row(part, |j, k, row| {
            runs(&grid, axis, j, k, row, |run, face| {
                let n = run.len();
                // Nothing pushes through the sides of the box.
                if let Face::Between(low, high) = face {
                    let (low, high) = (&force.data[low..low + n], &force.data[high..high + n]);
                    for i in 0..n {
                        run[i] += 0.5 * (low[i] + high[i]);
                    }
                }
            });
        });
    }
    Ok(())
}
