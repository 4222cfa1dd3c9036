//! Velocities where there is no liquid: layer by layer, each face takes the mean of those beside it that have one.                 (pic.8)

use crate::math::Real;
use crate::math::parallel::{Tasks, chunks2};
use crate::state::{Field, Grid, Place, Vectors};

/// What is known of a face.
pub mod mark {
    /// It takes the mean of its neighbours.
    pub const FREE: u8 = 0;
    /// It has a velocity.
    pub const KNOWN: u8 = 1;
    /// It is closed, a side of the box, or no face.
    pub const SHUT: u8 = 2;
}

/// Marks of the faces of each axis, as components lie in a vector field.
pub type Marks = Vec<Vec<u8>>;

/// Marks of an empty box: sides and closed faces are shut.
pub fn empty(grid: &Grid, open: Option<&[Vec<u8>; 3]>) -> Marks {
    let lattice = grid.lattice();
    let one = |axis: usize| {
        let mut marks = vec![mark::SHUT; lattice.len()];
        let points = grid.points(Place::Face(axis));
        for k in 0..points[2] {
            for j in 0..points[1] {
                let at = lattice.at(0, j, k);
                for i in 0..points[0] {
                    let along = [i, j, k][axis];
                    let side = along == 0 || along == grid.n[axis];
                    let passes = open.is_none_or(|open| open[axis][at + i] > 0);
                    marks[at + i] = if side || !passes { mark::SHUT } else { mark::FREE };
                }
            }
        }
        marks
    };
    grid.axes().map(one).collect()
}

/// Takes velocities so many layers further.
pub fn extend(u: &mut Vectors, marks: &mut Marks, layers: usize) {
    for (part, marks) in u.parts.iter_mut().zip(marks) {
        for _ in 0..layers {
            let found: Vec<Vec<(usize, Real)>> = rows(part).map_in_parallel(|rows| layer(part, marks, rows));
            if found.iter().all(Vec::is_empty) {
                break;
            }
            for (at, value) in found.into_iter().flatten() {
                part.data[at] = value;
                marks[at] = mark::KNOWN;
            }
        }
    }
}

/// Rows (j, k) in tasks.
fn rows(part: &Field) -> impl Iterator<Item = Vec<[usize; 2]>> + use<> {
    /// Rows of a task.
    const ROWS: usize = 64;
    let [_, y, z] = part.points();
    (0..(y * z).div_ceil(ROWS)).map(move |task| (task * ROWS..((task + 1) * ROWS).min(y * z)).map(|row| [row % y, row / y]).collect())
}

fn layer(part: &Field, marks: &[u8], rows: Vec<[usize; 2]>) -> Vec<(usize, Real)> {
    let stride = part.grid.lattice().stride;
    let steps: Vec<usize> = part.grid.axes().map(|a| stride[a]).collect();
    let mut found = Vec::new();
    for [j, k] in rows {
        let start = part.index([0, j, k]);
        for at in start..start + part.points()[0] {
            if marks[at] != mark::FREE {
                continue;
            }
            let (mut sum, mut count) = (0.0, 0.0);
            for step in &steps {
                for other in [at - step, at + step] {
                    if marks[other] == mark::KNOWN {
                        sum += part.data[other];
                        count += 1.0;
                    }
                }
            }
            if count > 0.0 {
                found.push((at, sum / count));
            }
        }
    }
    found
}

/// Marks free faces where the weight of particles is above `least` as known.
pub fn know(marks: &mut [u8], weight: &mut [Real], least: Real) {
    chunks2(marks, weight, |_, marks, weight| {
        for (mark, weight) in marks.iter_mut().zip(weight) {
            if *mark == mark::FREE && *weight > least {
                *mark = mark::KNOWN;
            }
        }
    });
}
