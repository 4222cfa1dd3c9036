//! Columns that start where a line of the caches does: a block of sixteen numbers is then one access and not two; and those that
//! whoever works next may use: what a part of a step needs for a moment costs its memory once.

use super::Real;
use std::ops::{Deref, DerefMut};

/// Numbers of a block.
const BLOCK: usize = 16;

#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
struct Line([Real; BLOCK]);

/// Numbers in blocks of sixteen.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Column(Vec<Line>);

impl Column {
    /// None.
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    /// Zeros; as many as are asked for, up to a whole block.
    pub fn zeros(len: usize) -> Self {
        Self(vec![Line([0.0; BLOCK]); len.div_ceil(BLOCK)])
    }

    /// Makes sure of as many numbers; what they are is left open.
    pub fn reserve(&mut self, len: usize) {
        if self.0.len() < len.div_ceil(BLOCK) {
            *self = Self::zeros(len);
        }
    }
}

impl Deref for Column {
    type Target = [Real];
    #[inline(always)]
    fn deref(&self) -> &[Real] {
        bytemuck::cast_slice(&self.0)
    }
}

impl DerefMut for Column {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [Real] {
        bytemuck::cast_slice_mut(&mut self.0)
    }
}

impl<'a> IntoIterator for &'a Column {
    type Item = &'a Real;
    type IntoIter = std::slice::Iter<'a, Real>;
    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

/// Columns that hold nothing. Their ghosts are zero, which solvers rely on; their other numbers are anything.
#[derive(Debug, Default)]
pub struct Spare {
    columns: Vec<Column>,
}

impl Spare {
    /// A column of so many numbers.
    pub fn column(&mut self, len: usize) -> Column {
        match self.columns.iter().position(|column| column.len() == len) {
            Some(found) => self.columns.swap_remove(found),
            None => Column::zeros(len),
        }
    }

    /// Takes a column whose ghosts are zero.
    pub fn give(&mut self, column: Column) {
        if !column.is_empty() {
            self.columns.push(column);
        }
    }
}
