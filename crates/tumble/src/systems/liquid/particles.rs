//! The particles of a liquid, sorted by cell.

use crate::math::Real;
use crate::math::parallel::{CHUNK, Tasks, chunks};

/// Gradients of a velocity: how much each component grows along each axis over a cell [m/s].
pub type Gradient = [[Real; 3]; 3];

/// Particles, cell by cell, x fastest; within a cell in the order in which they came.
#[derive(Debug, Clone, Default)]
pub struct Particles {
    /// Places from the lowest corner of the box [cells]; 1/2 along the flat axis of a plane.
    pub x: Vec<[Real; 3]>,
    /// Velocities [m/s].
    pub v: Vec<[Real; 3]>,
    /// Gradients of the velocities around them; none where the transfer has none.
    pub gradient: Vec<Gradient>,
    affine: bool,
    /// Numbers, which they keep.
    pub id: Vec<u32>,
    /// The first particle of each cell, and one past the last.
    starts: Vec<u32>,
    cells: Vec<u32>,
    order: Vec<u32>,
    spare: (Vec<[Real; 3]>, Vec<Gradient>, Vec<u32>),
}

impl Particles {
    /// Particles at these places [cells] with these velocities [m/s].
    pub fn new(x: Vec<[Real; 3]>, v: Vec<[Real; 3]>, affine: bool) -> Self {
        let gradient = if affine { vec![Gradient::default(); x.len()] } else { Vec::new() };
        Self { id: (0..x.len() as u32).collect(), x, v, gradient, affine, ..Self::default() }
    }

    /// Whether they have gradients.
    pub fn is_affine(&self) -> bool {
        self.affine
    }

    /// Takes numbers, places, velocities and gradients anew.
    pub fn put(&mut self, id: Vec<u32>, x: Vec<[Real; 3]>, v: Vec<[Real; 3]>, gradient: Vec<Gradient>) {
        (self.id, self.x, self.v, self.gradient) = (id, x, v, gradient);
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.x.len()
    }

    /// The particles of cells `from` to `to`, counted x fastest.
    pub fn between(&self, from: usize, to: usize) -> std::ops::Range<usize> {
        self.starts[from] as usize..self.starts[to] as usize
    }

    /// Sorts them by the cells of a box.
    pub fn sort(&mut self, n: [usize; 3]) {
        let Self { x, v, gradient, id, starts, cells, order, spare, .. } = self;
        cells.resize(x.len(), 0);
        chunks(cells, |start, cells| {
            for (cell, x) in cells.iter_mut().zip(&x[start..]) {
                let at = |a: usize| (x[a] as usize).min(n[a] - 1);
                *cell = (at(0) + n[0] * (at(1) + n[1] * at(2))) as u32;
            }
        });
        let total: usize = n.iter().product();
        starts.clear();
        starts.resize(total + 1, 0);
        cells.iter().for_each(|cell| starts[*cell as usize + 1] += 1);
        for cell in 0..total {
            starts[cell + 1] += starts[cell];
        }
        order.resize(x.len(), 0);
        for (i, cell) in cells.iter().enumerate() {
            let next = &mut starts[*cell as usize];
            order[*next as usize] = i as u32;
            *next += 1;
        }
        // They are ends now: a cell begins where the one before ends.
        starts.rotate_right(1);
        starts[0] = 0;
        if order.iter().enumerate().any(|(i, from)| i as u32 != *from) {
            permute(x, &mut spare.0, order);
            permute(v, &mut spare.0, order);
            permute(gradient, &mut spare.1, order);
            permute(id, &mut spare.2, order);
        }
    }

    /// Adds one with this number, to be sorted.
    pub fn add(&mut self, x: [Real; 3], v: [Real; 3], id: u32) {
        self.x.push(x);
        self.v.push(v);
        if self.affine {
            self.gradient.push(Gradient::default());
        }
        self.id.push(id);
    }

    /// Keeps those at places [cells] that `keep` says, to be sorted.
    pub fn retain(&mut self, keep: impl Fn(&[Real; 3]) -> bool + Sync + Send) {
        let kept: Vec<bool> = self.x.chunks(CHUNK).map_in_parallel(|x| x.iter().map(&keep).collect::<Vec<_>>()).concat();
        fn sift<T>(column: &mut Vec<T>, kept: &[bool]) {
            let mut kept = kept.iter();
            column.retain(|_| kept.next().copied().unwrap_or(true));
        }
        sift(&mut self.x, &kept);
        sift(&mut self.v, &kept);
        sift(&mut self.gradient, &kept);
        sift(&mut self.id, &kept);
    }

    /// The rows of all particles, in the order of their numbers.
    pub fn rows(&self) -> Vec<u32> {
        let n = self.id.len();
        if self.id.iter().any(|id| *id as usize >= n) {
            let mut rows: Vec<u32> = (0..n as u32).collect();
            rows.sort_unstable_by_key(|row| self.id[*row as usize]);
            return rows;
        }
        let mut rows = vec![0; n];
        self.id.iter().enumerate().for_each(|(row, id)| rows[*id as usize] = row as u32);
        rows
    }
}

fn permute<T: Copy + Default + Send + Sync>(column: &mut Vec<T>, spare: &mut Vec<T>, order: &[u32]) {
    spare.resize(column.len(), T::default());
    chunks(spare, |start, into| into.iter_mut().zip(&order[start..]).for_each(|(into, from)| *into = column[*from as usize]));
    std::mem::swap(column, spare);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sorting_is_stable_and_knows_where_cells_begin() {
        let x = [[1.5, 0.5, 0.5], [0.1, 0.5, 0.5], [1.2, 0.5, 0.5], [0.3, 1.9, 0.5], [2.0, 9.0, -1.0]];
        let mut particles = Particles::new(x.to_vec(), vec![[0.0; 3]; 5], true);
        particles.sort([2, 2, 1]);
        // What lies on an upper side, or beyond, is in the last cell.
        assert_eq!(particles.id, [1, 0, 2, 3, 4]);
        assert_eq!((0..4).map(|c| particles.between(c, c + 1)).collect::<Vec<_>>(), [0..1, 1..3, 3..4, 4..5]);
        assert_eq!(particles.rows(), [1, 0, 2, 3, 4]);
    }
}
