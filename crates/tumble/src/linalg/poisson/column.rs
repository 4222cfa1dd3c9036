//! Columns that start where a line of the caches does: a block of sixteen numbers is then one access and not two.

use super::level::{Block, LANES};
use crate::math::Real;
use std::ops::{Deref, DerefMut};

#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
struct Line(Block);

/// Numbers in blocks.
#[derive(Debug, Clone)]
pub(super) struct Column(Vec<Line>);

impl Column {
    /// None.
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    /// Zeros; as many as are asked for, up to a whole block.
    pub fn zeros(len: usize) -> Self {
        Self(vec![Line([0.0; LANES]); len.div_ceil(LANES)])
    }

    /// Makes sure of as many numbers; what they are is left open.
    pub fn reserve(&mut self, len: usize) {
        if self.0.len() < len.div_ceil(LANES) {
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

impl Default for Column {
    fn default() -> Self {
        Self::new()
    }
}
