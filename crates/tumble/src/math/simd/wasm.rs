//! The 128-bit registers of WebAssembly. A module is compiled for them or not: nothing is asked for at run time.

use super::registers::{Transpose, four_packs, width};
use super::{GUESS, Mask, Pack, Real, Registers, Row, Width};
use pulp::wasm::Simd128;
use pulp::{Simd, cast};
use std::arch::wasm32::{self as arch, v128};

impl Registers for Simd128 {
    #[inline(always)]
    fn any(self, mask: Mask<Self>) -> bool {
        arch::v128_any_true(cast(mask))
    }
    #[cfg(not(feature = "double"))]
    #[inline(always)]
    fn above_zero(self, x: Self::f32s) -> Self::f32s {
        cast(arch::f32x4_pmax(arch::f32x4_splat(0.0), cast(x)))
    }
    #[cfg(feature = "double")]
    #[inline(always)]
    fn above_zero(self, x: Self::f64s) -> Self::f64s {
        cast(arch::f64x2_pmax(arch::f64x2_splat(0.0), cast(x)))
    }
    #[cfg(not(feature = "double"))]
    #[inline(always)]
    fn half_bits(self, from: u32, x: Self::f32s) -> Self::f32s {
        cast(arch::i32x4_sub(arch::u32x4_splat(from), arch::u32x4_shr(cast(x), 1)))
    }
}

#[cfg(not(feature = "double"))]
mod single {
    use super::*;
    type Four = <Simd128 as Simd>::f32s;

    /// GUESS - bits/2.
    #[inline(always)]
    fn guess(s: Simd128, x: Four) -> Four {
        s.half_bits(GUESS, x)
    }

    /// a b + c: nothing rounds once.
    #[inline(always)]
    fn apart(s: Simd128, a: Four, b: Four, c: Four) -> Four {
        s.add_f32s(s.mul_f32s(a, b), c)
    }

    width!(Simd128, 4, splat_f32s, apart, guess, false, guess, |_: Simd128, x: v128| arch::f32x4_floor(x), |_: Simd128, x: v128| {
        arch::i32x4_trunc_sat_f32x4(x)
    });

    impl Transpose for Simd128 {
        type Rows = [Row; 4];
        type Index = [i32; 4];
        #[inline(always)]
        unsafe fn pairs_at(self, from: *const f32, index: [i32; 4]) -> [Pack<Self>; 2] {
            let from = from.cast::<u64>();
            let mut p = [0_u64; 4];
            for l in 0..4 {
                // SAFETY: the caller has checked the indices.
                p[l] = unsafe { from.byte_add(4 * index[l] as usize).read_unaligned() };
            }
            let (low, high) = (arch::u64x2(p[0], p[1]), arch::u64x2(p[2], p[3]));
            let pack = |v: v128| Pack { simd: self, v: cast(v) };
            [pack(arch::i32x4_shuffle::<0, 2, 4, 6>(low, high)), pack(arch::i32x4_shuffle::<1, 3, 5, 7>(low, high))]
        }
        type OfRows = [f32; 1];
        #[inline(always)]
        fn each_four_times(self, [a]: [f32; 1]) -> Pack<Self> {
            Pack { simd: self, v: self.splat_f32s(a) }
        }
        #[inline(always)]
        fn transpose(self, r: [Row; 4]) -> [Pack<Self>; 4] {
            let [a, b, c, d]: [v128; 4] = [cast(r[0]), cast(r[1]), cast(r[2]), cast(r[3])];
            let (ab, cd) = (arch::i32x4_shuffle::<0, 4, 1, 5>(a, b), arch::i32x4_shuffle::<0, 4, 1, 5>(c, d));
            let (ef, gh) = (arch::i32x4_shuffle::<2, 6, 3, 7>(a, b), arch::i32x4_shuffle::<2, 6, 3, 7>(c, d));
            let (x, y) = (arch::i64x2_shuffle::<0, 2>(ab, cd), arch::i64x2_shuffle::<1, 3>(ab, cd));
            let (z, w) = (arch::i64x2_shuffle::<0, 2>(ef, gh), arch::i64x2_shuffle::<1, 3>(ef, gh));
            four_packs!(self, [x, y, z, w])
        }
        #[inline(always)]
        fn untranspose(self, v: [Pack<Self>; 4]) -> [Row; 4] {
            let rows = self.untranspose_run(v);
            [cast(rows[0].v), cast(rows[1].v), cast(rows[2].v), cast(rows[3].v)]
        }
        #[inline(always)]
        fn transpose_run(self, run: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
            self.transpose([cast(run[0].v), cast(run[1].v), cast(run[2].v), cast(run[3].v)])
        }
        #[inline(always)]
        fn untranspose_run(self, v: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
            // A row is a register: there and back is the same.
            self.transpose_run(v)
        }
    }
}

#[cfg(feature = "double")]
mod double {
    use super::*;
    type Two = <Simd128 as Simd>::f64s;

    /// GUESS - bits/2.
    #[inline(always)]
    fn guess(_: Simd128, x: Two) -> Two {
        cast(arch::i64x2_sub(arch::u64x2_splat(GUESS), arch::u64x2_shr(cast(x), 1)))
    }

    /// a b + c: nothing rounds once.
    #[inline(always)]
    fn apart(s: Simd128, a: Two, b: Two, c: Two) -> Two {
        s.add_f64s(s.mul_f64s(a, b), c)
    }

    /// Two whole numbers; the upper half of the register holds zeros.
    #[inline(always)]
    fn whole(_: Simd128, x: v128) -> [i32; 2] {
        let [a, b, _, _]: [i32; 4] = cast(arch::i32x4_trunc_sat_f64x2_zero(x));
        [a, b]
    }

    width!(Simd128, 2, splat_f64s, apart, guess, false, guess, |_: Simd128, x: v128| arch::f64x2_floor(x), whole);

    /// Transposes two by two; its own inverse.
    #[inline(always)]
    fn two_by_two(a: v128, b: v128) -> [v128; 2] {
        [arch::i64x2_shuffle::<0, 2>(a, b), arch::i64x2_shuffle::<1, 3>(a, b)]
    }

    impl Transpose for Simd128 {
        type Rows = [Row; 2];
        type Index = [i32; 2];
        #[inline(always)]
        unsafe fn pairs_at(self, from: *const f64, i: [i32; 2]) -> [Pack<Self>; 2] {
            let mut p = [[0.0; 2]; 2];
            for l in 0..2 {
                // SAFETY: the caller has checked the indices.
                p[l] = unsafe { *from.add(i[l] as usize).cast::<[f64; 2]>() };
            }
            let [low, high] = two_by_two(cast(p[0]), cast(p[1]));
            [Pack { simd: self, v: cast(low) }, Pack { simd: self, v: cast(high) }]
        }
        type OfRows = [f64; 1];
        #[inline(always)]
        fn each_four_times(self, [a]: [f64; 1]) -> Pack<Self> {
            Pack { simd: self, v: self.splat_f64s(a) }
        }
        #[inline(always)]
        fn transpose(self, r: [Row; 2]) -> [Pack<Self>; 4] {
            let [a, b, c, d]: [v128; 4] = cast(r);
            let ([x, y], [z, w]) = (two_by_two(a, c), two_by_two(b, d));
            four_packs!(self, [x, y, z, w])
        }
        #[inline(always)]
        fn untranspose(self, [x, y, z, w]: [Pack<Self>; 4]) -> [Row; 2] {
            let ([a, c], [b, d]) = (two_by_two(cast(x.v), cast(y.v)), two_by_two(cast(z.v), cast(w.v)));
            cast([a, b, c, d])
        }
        #[inline(always)]
        fn transpose_run(self, run: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
            self.transpose(cast([run[0].v, run[1].v, run[2].v, run[3].v]))
        }
        #[inline(always)]
        fn untranspose_run(self, v: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
            let [a, b, c, d]: [v128; 4] = cast(self.untranspose(v));
            four_packs!(self, [a, b, c, d])
        }
    }
}
