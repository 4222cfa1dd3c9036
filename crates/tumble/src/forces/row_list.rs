//! Which rows of a system a law between masses has to do with.

use crate::math::Row;
use std::ops::Range;

/// Rows, numbered one after the other: a law's own count.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Rows(Vec<Part>);

#[derive(Debug, Clone, PartialEq)]
struct Part {
    range: Range<usize>,
    /// The number of its first row.
    first: usize,
    feels: bool,
    acts: bool,
}

impl Rows {
    /// The rows of `on` feel those of `from`; without it, each other.
    pub fn new(on: Vec<Range<usize>>, from: Option<Vec<Range<usize>>>) -> Self {
        let alone = from.is_none();
        let mut parts: Vec<Part> = on.into_iter().map(|range| Part { range, first: 0, feels: true, acts: alone }).collect();
        for range in from.into_iter().flatten() {
            match parts.iter_mut().find(|p| p.range == range) {
                Some(part) => part.acts = true,
                None => parts.push(Part { range, first: 0, feels: false, acts: true }),
            }
        }
        parts.sort_by_key(|p| p.range.start);
        let mut count = 0;
        for part in &mut parts {
            part.first = count;
            count += part.range.len();
        }
        Self(parts)
    }

    /// Count of rows.
    pub fn len(&self) -> usize {
        self.0.last().map_or(0, |p| p.first + p.range.len())
    }

    fn part(&self, i: usize) -> Option<&Part> {
        self.0.iter().rfind(|p| p.first <= i)
    }

    /// The row of a number.
    pub fn row(&self, i: usize) -> usize {
        self.part(i).map_or(0, |p| p.range.start + i - p.first)
    }

    /// Whether it feels others.
    pub fn feels(&self, i: usize) -> bool {
        self.part(i).is_some_and(|p| p.feels)
    }

    /// Whether others feel it.
    pub fn acts(&self, i: usize) -> bool {
        self.part(i).is_some_and(|p| p.acts)
    }

    /// Copies the rows out of a column.
    pub fn gather(&self, column: &[Row], out: &mut Vec<Row>) {
        out.clear();
        self.0.iter().for_each(|p| out.extend_from_slice(&column[p.range.clone()]));
    }

    /// The rows of a column: where they lie if they lie side by side, else copied to `out`.
    pub fn pick<'a>(&self, column: &'a [Row], out: &'a mut Vec<Row>) -> &'a [Row] {
        match &self.0[..] {
            [] => &[],
            [part] => &column[part.range.clone()],
            _ => {
                self.gather(column, out);
                out
            }
        }
    }

    /// Calls `f(number, its place in out)` for those among the rows from `start` on.
    pub fn among<T>(&self, start: usize, out: &mut [T], mut f: impl FnMut(usize, &mut T)) {
        for Part { range, first, .. } in &self.0 {
            let (a, b) = (range.start.max(start), range.end.min(start + out.len()));
            for row in a..b {
                f(first + row - range.start, &mut out[row - start]);
            }
        }
    }
}
