//! Particles that keep their distance: what lies in clumps and leaves voids is spread.
//!
//!   d_i = e/20 sum over j of (1 - r_ij²/e²) (x_i - x_j)/r_ij,   r_ij < e                                                  (pic.12)
//!
//! e is the distance of the particles at the start, at which nothing moves. Two move alike, so that their centre stays.
//!
//! Source: [ando2011].

use super::particles::Particles;
use crate::math::Real;
use crate::math::parallel::{CHUNK, Tasks};

/// Way of a particle that has one at its side, over their distance at the start.
const STRENGTH: Real = 0.05;

/// The way of each particle [cells]; sorted particles in a box of n cells, at the start `edge` cells apart.
pub fn spread(particles: &Particles, n: [usize; 3], edge: Real) -> Vec<[Real; 3]> {
    let (first, scale) = (&particles.x, 1.0 / (edge * edge));
    let mut ways = vec![[0.0; 3]; particles.count()];
    ways.chunks_mut(CHUNK).zip(first.chunks(CHUNK)).in_parallel(|(ways, x)| {
        for (way, x) in ways.iter_mut().zip(x) {
            let cells = |a: usize| {
                let at = |x: Real| (x.max(0.0) as usize).min(n[a] - 1);
                at(x[a] - edge)..at(x[a] + edge) + 1
            };
            let row = cells(0);
            for k in cells(2) {
                for j in cells(1) {
                    let number = |i: usize| i + n[0] * (j + n[1] * k);
                    for other in &first[particles.between(number(row.start), number(row.end))] {
                        let apart = [x[0] - other[0], x[1] - other[1], x[2] - other[2]];
                        let square = apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2];
                        if square > 0.0 && square * scale < 1.0 {
                            let push = STRENGTH * edge * (1.0 - square * scale) / square.sqrt();
                            (0..3).for_each(|a| way[a] += push * apart[a]);
                        }
                    }
                }
            }
        }
    });
    ways
}
