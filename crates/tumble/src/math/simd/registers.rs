//! Common to all registers: everything of [`Width`](super::Width) that does not depend on how rows are transposed.

use super::{Pack, Real};
use pulp::Simd;

/// Everything that does not depend on how rows are transposed.
macro_rules! width {
    ($token:ident, $n:expr, $splat:ident, $fused:expr, $guess:expr, $estimates:expr, $estimate:expr, $floor:expr, $whole:expr) => {
        impl Width for $token {
            type L = Pack<$token>;
            const N: usize = $n;
            #[inline(always)]
            fn splat(self, c: Real) -> Self::L {
                Pack { simd: self, v: self.$splat(c) }
            }
            #[inline(always)]
            fn load(self, from: &[Real]) -> Self::L {
                // Not pulp's partial load, which is a call.
                let mut numbers = [0.0; $n];
                numbers.copy_from_slice(&from[..$n]);
                Pack { simd: self, v: cast::<[Real; $n], _>(numbers) }
            }
            #[inline(always)]
            unsafe fn load_at(self, from: &[Real], at: usize) -> Self::L {
                debug_assert!(at + $n <= from.len());
                // SAFETY: the caller has checked the place; an array of numbers is aligned as one of them.
                Pack { simd: self, v: cast(unsafe { *from.as_ptr().add(at).cast::<[Real; $n]>() }) }
            }
            #[inline(always)]
            fn store(self, v: Self::L, to: &mut [Real]) {
                to[..$n].copy_from_slice(&cast::<_, [Real; $n]>(v.v));
            }
            #[inline(always)]
            unsafe fn gather_at(self, rows: *const Row, index: &[u32]) -> [Self::L; 4] {
                let index = &index[..$n];
                let mut picked = [[0.0; 4]; $n];
                for i in 0..$n {
                    // SAFETY: the caller has checked the indices.
                    picked[i] = unsafe { *rows.add(index[i] as usize) };
                }
                self.transpose(picked)
            }
            #[inline(always)]
            unsafe fn put(self, v: [Self::L; 4], rows: *mut Row, index: &[u32]) {
                let index = &index[..$n];
                let untransposed = self.untranspose(v);
                for i in 0..$n {
                    // SAFETY: the caller has checked the indices.
                    unsafe { *rows.add(index[i] as usize) = untransposed[i] };
                }
            }
            #[inline(always)]
            fn in_run(self, v: Self::L) -> Self::L {
                self.in_run_order(v)
            }
            #[inline(always)]
            unsafe fn rows_at(self, rows: *const Row, start: u32) -> [Self::L; 4] {
                // SAFETY: the caller has checked the place; arrays of numbers are aligned as one of them.
                let run = unsafe { *rows.add(start as usize).cast::<[[Real; $n]; 4]>() };
                self.transpose_run_in_order(four_packs!(self, [run[0], run[1], run[2], run[3]]))
            }
            #[inline(always)]
            unsafe fn put_rows(self, v: [Self::L; 4], rows: *mut Row, start: u32) {
                let [a, b, c, d] = self.untranspose_run_in_order(v);
                // SAFETY: as above.
                unsafe { *rows.add(start as usize).cast::<[[Real; $n]; 4]>() = [cast(a.v), cast(b.v), cast(c.v), cast(d.v)] };
            }
            #[inline(always)]
            unsafe fn pairs(self, from: &[Real], index: &[i32]) -> [Self::L; 2] {
                let mut at = [0; $n];
                at.copy_from_slice(&index[..$n]);
                debug_assert!(at.iter().all(|i| *i >= 0 && (*i as usize) + 1 < from.len()));
                // SAFETY: the caller has checked the indices.
                unsafe { self.pairs_at(from.as_ptr(), at) }
            }
            #[inline(always)]
            unsafe fn quads(self, from: &[Real], index: &[i32]) -> [Self::L; 4] {
                let index = &index[..$n];
                let mut picked = [[0.0; 4]; $n];
                for i in 0..$n {
                    debug_assert!(index[i] >= 0 && (index[i] as usize) + 3 < from.len());
                    // SAFETY: the caller has checked the indices; an array of numbers is aligned as one of them.
                    picked[i] = unsafe { *from.as_ptr().add(index[i] as usize).cast::<Row>() };
                }
                self.transpose(picked)
            }
            #[inline(always)]
            fn floor(self, x: Self::L) -> Self::L {
                Pack { simd: self, v: cast($floor(self, cast(x.v))) }
            }
            #[inline(always)]
            fn whole(self, x: Self::L, to: &mut [i32]) {
                to[..$n].copy_from_slice(&cast::<_, [i32; $n]>($whole(self, cast(x.v))));
            }
            #[inline(always)]
            fn scatter(self, v: [Self::L; 4], rows: &mut [Row], start: usize, stride: usize) {
                if stride == 1 {
                    let run = self.untranspose_run(v);
                    let to = rows[start..start + $n].as_flattened_mut();
                    for i in 0..4 {
                        self.store(run[i], &mut to[i * $n..]);
                    }
                    return;
                }
                let untransposed = self.untranspose(v);
                assert!(start + ($n - 1) * stride < rows.len());
                for i in 0..$n {
                    rows[start + i * stride] = untransposed[i];
                }
            }
            #[inline(always)]
            fn rows(self, rows: &[Row], start: usize) -> [Self::L; 4] {
                let from = rows[start..start + $n].as_flattened();
                let mut run = [self.splat(0.0); 4];
                for i in 0..4 {
                    run[i] = self.load(&from[i * $n..]);
                }
                self.transpose_run(run)
            }
            #[inline(always)]
            fn add_to_rows(self, v: [Self::L; 4], rows: &mut [Row], start: usize) {
                let run = self.untranspose_run(v);
                let to = rows[start..start + $n].as_flattened_mut();
                for i in 0..4 {
                    let here = &mut to[i * $n..];
                    self.store(self.load(here) + run[i], here);
                }
            }
            #[inline(always)]
            fn spread(self, of_rows: &[Real], at: usize) -> Self::L {
                let mut numbers = [0.0; usize::div_ceil($n, 4)];
                numbers.copy_from_slice(&of_rows[at / 4..at / 4 + usize::div_ceil($n, 4)]);
                self.each_four_times(numbers)
            }
            #[inline(always)]
            fn guess(self, x: Self::L) -> Self::L {
                Pack { simd: self, v: $guess(self, x.v) }
            }
            #[inline(always)]
            fn fused(self, a: Self::L, b: Self::L, c: Self::L) -> Self::L {
                Pack { simd: self, v: $fused(self, a.v, b.v, c.v) }
            }
            const ESTIMATES: bool = $estimates;
            #[inline(always)]
            fn estimate(self, x: Self::L) -> Self::L {
                Pack { simd: self, v: $estimate(self, x.v) }
            }
        }
    };
}

/// Rows of four numbers to four registers with x, y, z and w and back; consecutive rows fill four registers, too.
pub trait Transpose: Simd {
    type Rows;
    type OfRows;
    /// a a a a b b b b ...
    fn each_four_times(self, numbers: Self::OfRows) -> Pack<Self>;
    fn transpose(self, rows: Self::Rows) -> [Pack<Self>; 4];
    type Index;
    /// # Safety
    /// All indices and those after them are inside.
    unsafe fn pairs_at(self, from: *const Real, index: Self::Index) -> [Pack<Self>; 2];
    fn untranspose(self, v: [Pack<Self>; 4]) -> Self::Rows;
    fn transpose_run(self, run: [Pack<Self>; 4]) -> [Pack<Self>; 4];
    fn untranspose_run(self, v: [Pack<Self>; 4]) -> [Pack<Self>; 4];
    /// From the order of rows to the one that is cheapest for a run, and back.
    #[inline(always)]
    fn in_run_order(self, v: Pack<Self>) -> Pack<Self> {
        v
    }
    /// `transpose_run` into that order.
    #[inline(always)]
    fn transpose_run_in_order(self, run: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
        self.transpose_run(run)
    }
    /// `untranspose_run` from that order.
    #[inline(always)]
    fn untranspose_run_in_order(self, v: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
        self.untranspose_run(v)
    }
}

macro_rules! four_packs {
    ($simd:expr, [$x:expr, $y:expr, $z:expr, $w:expr]) => {
        [
            Pack { simd: $simd, v: cast($x) },
            Pack { simd: $simd, v: cast($y) },
            Pack { simd: $simd, v: cast($z) },
            Pack { simd: $simd, v: cast($w) },
        ]
    };
}

pub(super) use {four_packs, width};
