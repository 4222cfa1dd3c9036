//! Who is near: people sorted into square cells, so that neighbours are a few runs of consecutive rows.

use super::plan::Point;

/// People in cells.
#[derive(Debug, Default)]
pub struct Near {
    side: f64,
    low: Point,
    n: [usize; 2],
    starts: Vec<u32>,
    /// People, cell by cell, in the order of their rows.
    pub order: Vec<u32>,
}

/// Cells along an axis, at most: who is beyond is in the last one.
const MOST: f64 = 4096.0;

impl Near {
    /// Sorts people into cells of this side [m].
    pub fn sort(&mut self, side: f64, places: impl Iterator<Item = Point> + Clone) {
        let first = places.clone().next().unwrap_or([0.0; 2]);
        let (mut low, mut high) = (first, first);
        for p in places.clone() {
            for a in 0..2 {
                low[a] = if p[a] < low[a] { p[a] } else { low[a] };
                high[a] = if p[a] > high[a] { p[a] } else { high[a] };
            }
        }
        (self.side, self.low) = (side, low);
        self.n = [0, 1].map(|a| ((high[a] - self.low[a]) / side).min(MOST) as usize + 1);
        self.starts.clear();
        self.starts.resize(self.n[0] * self.n[1] + 1, 0);
        let cell = |p: Point| self.at(0, p[0]) + self.at(1, p[1]) * self.n[0];
        let cells: Vec<usize> = places.map(cell).collect();
        cells.iter().for_each(|c| self.starts[c + 1] += 1);
        for c in 1..self.starts.len() {
            self.starts[c] += self.starts[c - 1];
        }
        let mut next = self.starts.clone();
        self.order.resize(cells.len(), 0);
        for (i, c) in cells.into_iter().enumerate() {
            self.order[next[c] as usize] = i as u32;
            next[c] += 1;
        }
    }

    fn at(&self, a: usize, x: f64) -> usize {
        ((x - self.low[a]) / self.side).clamp(0.0, (self.n[a] - 1) as f64) as usize
    }

    /// Ranges of `order` that hold everybody within `range` of a place.
    pub fn runs(&self, x: Point, range: f64) -> impl Iterator<Item = std::ops::Range<usize>> {
        let (x0, x1) = (self.at(0, x[0] - range), self.at(0, x[0] + range));
        let (y0, y1) = (self.at(1, x[1] - range), self.at(1, x[1] + range));
        (y0..=y1).map(move |y| self.starts[x0 + y * self.n[0]] as usize..self.starts[x1 + 1 + y * self.n[0]] as usize)
    }
}
