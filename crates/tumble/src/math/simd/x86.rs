//! The registers of AVX2 and AVX-512.

use super::registers::{Transpose, four_packs, width};
use super::{GUESS, Kernel, Mask, Pack, Real, Registers, Row, Width};
use pulp::x86::{V3, V4};
use pulp::{Simd, WithSimd, cast};

pub fn avx2() -> Option<V3> {
    static TOKEN: std::sync::OnceLock<Option<V3>> = std::sync::OnceLock::new();
    *TOKEN.get_or_init(V3::try_new)
}

pub fn avx512() -> Option<V4> {
    static TOKEN: std::sync::OnceLock<Option<V4>> = std::sync::OnceLock::new();
    *TOKEN.get_or_init(V4::try_new)
}

/// Enters the functions that pulp compiles for the instruction set; the token keeps its type.
macro_rules! entry {
    ($name:ident, $token:ident) => {
        pub struct $name<K> {
            pub kernel: K,
            pub simd: $token,
        }
        impl<K: Kernel> WithSimd for $name<K> {
            type Output = K::Output;
            #[inline(always)]
            fn with_simd<S: Simd>(self, _: S) -> K::Output {
                self.kernel.run(self.simd)
            }
        }
    };
}
entry!(InAvx2, V3);
entry!(InAvx512, V4);

impl Registers for V3 {
    #[inline(always)]
    fn any(self, mask: Mask<Self>) -> bool {
        self.avx._mm256_movemask_ps(cast(mask)) != 0
    }
}

impl Registers for V4 {
    #[inline(always)]
    fn any(self, mask: Mask<Self>) -> bool {
        mask.0 != 0
    }
}

#[cfg(not(feature = "double"))]
mod single {
    use super::*;
    use std::arch::x86_64::{__m256, __m512};

    /// GUESS - bits/2.
    #[inline(always)]
    fn guess<S: Registers>(s: S, x: S::f32s) -> S::f32s {
        s.half_bits(GUESS, x)
    }

    #[inline(always)]
    fn estimate(s: V4, x: <V4 as Simd>::f32s) -> <V4 as Simd>::f32s {
        cast(s.avx512f._mm512_rsqrt14_ps(cast(x)))
    }

    /// a b + c, rounded once.
    #[inline(always)]
    fn fused<S: Simd>(s: S, a: S::f32s, b: S::f32s, c: S::f32s) -> S::f32s {
        s.mul_add_f32s(a, b, c)
    }

    width!(V3, 8, splat_f32s, fused, guess, false, guess, |s: V3, x| s.avx._mm256_floor_ps(x), |s: V3, x| s.avx._mm256_cvttps_epi32(x));
    width!(V4, 16, splat_f32s, fused, guess, true, estimate, |s: V4, x| s.avx512f._mm512_roundscale_ps::<1>(x), |s: V4, x| s
        .avx512f
        ._mm512_cvttps_epi32(x));

    /// Transposes four by four inside each 128-bit part; its own inverse.
    macro_rules! four_by_four {
        ($s:expr, $lo:ident, $hi:ident, $shuffle:ident, [$a:expr, $b:expr, $c:expr, $d:expr]) => {{
            let (ab, cd) = ($s.$lo($a, $b), $s.$lo($c, $d));
            let (ef, gh) = ($s.$hi($a, $b), $s.$hi($c, $d));
            [$s.$shuffle::<0x44>(ab, cd), $s.$shuffle::<0xEE>(ab, cd), $s.$shuffle::<0x44>(ef, gh), $s.$shuffle::<0xEE>(ef, gh)]
        }};
    }

    impl Transpose for V3 {
        type Rows = [Row; 8];
        type Index = [i32; 8];
        #[inline(always)]
        unsafe fn pairs_at(self, from: *const f32, index: [i32; 8]) -> [Pack<Self>; 2] {
            let (s, from) = (self.avx, from.cast::<f64>());
            let [low, high]: [[i32; 4]; 2] = cast(index);
            let (mut a, mut b) = ([0.0_f64; 4], [0.0_f64; 4]);
            for l in 0..4 {
                // SAFETY: the caller has checked the indices.
                unsafe {
                    a[l] = from.byte_add(4 * low[l] as usize).read_unaligned();
                    b[l] = from.byte_add(4 * high[l] as usize).read_unaligned();
                }
            }
            // a0 b0 a1 b1 | a2 b2 a3 b3 and the same of b: the two halves side by side, then each number of a pair.
            let low = s._mm256_permute2f128_ps::<0x20>(cast(a), cast(b));
            let high = s._mm256_permute2f128_ps::<0x31>(cast(a), cast(b));
            let pack = |v: __m256| Pack { simd: self, v: cast(v) };
            [pack(s._mm256_shuffle_ps::<0x88>(low, high)), pack(s._mm256_shuffle_ps::<0xDD>(low, high))]
        }
        type OfRows = [f32; 2];
        #[inline(always)]
        fn each_four_times(self, [a, b]: [f32; 2]) -> Pack<Self> {
            Pack { simd: self, v: cast([a, a, a, a, b, b, b, b]) }
        }
        #[inline(always)]
        fn transpose(self, r: [Row; 8]) -> [Pack<Self>; 4] {
            let s = self.avx;
            let mut p = [s._mm256_castps128_ps256(cast(r[0])); 4];
            for i in 0..4 {
                p[i] = s._mm256_insertf128_ps::<1>(s._mm256_castps128_ps256(cast(r[i])), cast(r[4 + i]));
            }
            let [x, y, z, w] = four_by_four!(s, _mm256_unpacklo_ps, _mm256_unpackhi_ps, _mm256_shuffle_ps, [p[0], p[1], p[2], p[3]]);
            four_packs!(self, [x, y, z, w])
        }
        #[inline(always)]
        fn untranspose(self, [x, y, z, w]: [Pack<Self>; 4]) -> [Row; 8] {
            let s = self.avx;
            let (x, y, z, w) = (cast(x.v), cast(y.v), cast(z.v), cast(w.v));
            let p = four_by_four!(s, _mm256_unpacklo_ps, _mm256_unpackhi_ps, _mm256_shuffle_ps, [x, y, z, w]);
            let mut rows = [[0.0; 4]; 8];
            for i in 0..4 {
                rows[i] = cast(s._mm256_extractf128_ps::<0>(p[i]));
                rows[4 + i] = cast(s._mm256_extractf128_ps::<1>(p[i]));
            }
            rows
        }
        #[inline(always)]
        fn transpose_run(self, [a, b, c, d]: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
            let s = self.avx;
            let (a, b, c, d) = (cast(a.v), cast(b.v), cast(c.v), cast(d.v));
            let (low, high) = (s._mm256_permute2f128_ps::<0x20>(a, c), s._mm256_permute2f128_ps::<0x31>(a, c));
            let p = [low, high, s._mm256_permute2f128_ps::<0x20>(b, d), s._mm256_permute2f128_ps::<0x31>(b, d)];
            let [x, y, z, w] = four_by_four!(s, _mm256_unpacklo_ps, _mm256_unpackhi_ps, _mm256_shuffle_ps, [p[0], p[1], p[2], p[3]]);
            four_packs!(self, [x, y, z, w])
        }
        #[inline(always)]
        fn untranspose_run(self, [x, y, z, w]: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
            let s = self.avx;
            let (x, y, z, w) = (cast(x.v), cast(y.v), cast(z.v), cast(w.v));
            let p = four_by_four!(s, _mm256_unpacklo_ps, _mm256_unpackhi_ps, _mm256_shuffle_ps, [x, y, z, w]);
            let low = [s._mm256_permute2f128_ps::<0x20>(p[0], p[1]), s._mm256_permute2f128_ps::<0x20>(p[2], p[3])];
            let high = [s._mm256_permute2f128_ps::<0x31>(p[0], p[1]), s._mm256_permute2f128_ps::<0x31>(p[2], p[3])];
            four_packs!(self, [low[0], low[1], high[0], high[1]])
        }
    }

    /// Numbers of four registers of four rows each, transposed inside their 128-bit parts: where each row's is; its own inverse.
    const CROSSED: [i32; 16] = [0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15];

    impl Transpose for V4 {
        type Rows = [Row; 16];
        type Index = [i32; 16];
        #[inline(always)]
        unsafe fn pairs_at(self, from: *const f32, index: [i32; 16]) -> [Pack<Self>; 2] {
            let (s, from) = (self.avx512f, from.cast::<f64>());
            let [low, high]: [[i32; 8]; 2] = cast(index);
            // Loads of 64 bits beat gather instructions by 1.4x.
            let (mut a, mut b) = ([0.0_f64; 8], [0.0_f64; 8]);
            for l in 0..8 {
                // SAFETY: the caller has checked the indices.
                unsafe {
                    a[l] = from.byte_add(4 * low[l] as usize).read_unaligned();
                    b[l] = from.byte_add(4 * high[l] as usize).read_unaligned();
                }
            }
            let even = cast([0_i32, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30]);
            let odd = cast([1_i32, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31]);
            let pack = |v: __m512| Pack { simd: self, v: cast(v) };
            [pack(s._mm512_permutex2var_ps(cast(a), even, cast(b))), pack(s._mm512_permutex2var_ps(cast(a), odd, cast(b)))]
        }
        type OfRows = [f32; 4];
        #[inline(always)]
        fn each_four_times(self, numbers: [f32; 4]) -> Pack<Self> {
            let s = self.avx512f;
            let place = cast([0_i32, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3]);
            Pack { simd: self, v: cast(s._mm512_permutexvar_ps(place, s._mm512_castps128_ps512(cast(numbers)))) }
        }
        #[inline(always)]
        fn transpose(self, r: [Row; 16]) -> [Pack<Self>; 4] {
            let s = self.avx512f;
            let mut p = [s._mm512_castps128_ps512(cast(r[0])); 4];
            for i in 0..4 {
                let part = s._mm512_castps128_ps512(cast(r[i]));
                let part = s._mm512_insertf32x4::<1>(part, cast(r[4 + i]));
                let part = s._mm512_insertf32x4::<2>(part, cast(r[8 + i]));
                p[i] = s._mm512_insertf32x4::<3>(part, cast(r[12 + i]));
            }
            let [x, y, z, w] = four_by_four!(s, _mm512_unpacklo_ps, _mm512_unpackhi_ps, _mm512_shuffle_ps, [p[0], p[1], p[2], p[3]]);
            four_packs!(self, [x, y, z, w])
        }
        #[inline(always)]
        fn untranspose(self, [x, y, z, w]: [Pack<Self>; 4]) -> [Row; 16] {
            let s = self.avx512f;
            let (x, y, z, w) = (cast(x.v), cast(y.v), cast(z.v), cast(w.v));
            let p = four_by_four!(s, _mm512_unpacklo_ps, _mm512_unpackhi_ps, _mm512_shuffle_ps, [x, y, z, w]);
            let mut rows = [[0.0; 4]; 16];
            for i in 0..4 {
                // Hidden from the compiler, which would shuffle each row in a register of its own: three times as many instructions.
                let part = std::hint::black_box(p[i]);
                rows[i] = cast(s._mm512_extractf32x4_ps::<0>(part));
                rows[4 + i] = cast(s._mm512_extractf32x4_ps::<1>(part));
                rows[8 + i] = cast(s._mm512_extractf32x4_ps::<2>(part));
                rows[12 + i] = cast(s._mm512_extractf32x4_ps::<3>(part));
            }
            rows
        }
        #[inline(always)]
        fn transpose_run(self, run: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
            let [x, y, z, w] = self.transpose_run_in_order(run);
            [self.in_run_order(x), self.in_run_order(y), self.in_run_order(z), self.in_run_order(w)]
        }
        #[inline(always)]
        fn untranspose_run(self, v: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
            let [x, y, z, w] = v;
            self.untranspose_run_in_order([self.in_run_order(x), self.in_run_order(y), self.in_run_order(z), self.in_run_order(w)])
        }
        #[inline(always)]
        fn in_run_order(self, v: Pack<Self>) -> Pack<Self> {
            Pack { simd: self, v: cast(self.avx512f._mm512_permutexvar_ps(cast(CROSSED), cast(v.v))) }
        }
        #[inline(always)]
        fn transpose_run_in_order(self, [a, b, c, d]: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
            let s = self.avx512f;
            let (a, b, c, d) = (cast(a.v), cast(b.v), cast(c.v), cast(d.v));
            let [x, y, z, w] = four_by_four!(s, _mm512_unpacklo_ps, _mm512_unpackhi_ps, _mm512_shuffle_ps, [a, b, c, d]);
            four_packs!(self, [x, y, z, w])
        }
        #[inline(always)]
        fn untranspose_run_in_order(self, v: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
            // A block of four rows transposes itself.
            self.transpose_run_in_order(v)
        }
    }
}

#[cfg(feature = "double")]
mod double {
    use super::*;
    use std::arch::x86_64::{__m256d, __m512d};

    /// GUESS - bits/2.
    #[inline(always)]
    fn guess3(s: V3, x: <V3 as Simd>::f64s) -> <V3 as Simd>::f64s {
        let half = s.avx2._mm256_srli_epi64::<1>(cast(x));
        cast(s.avx2._mm256_sub_epi64(cast(s.splat_u64s(GUESS)), half))
    }

    /// GUESS - bits/2.
    #[inline(always)]
    fn guess4(s: V4, x: <V4 as Simd>::f64s) -> <V4 as Simd>::f64s {
        let half = s.avx512f._mm512_srli_epi64::<1>(cast(x));
        cast(s.avx512f._mm512_sub_epi64(cast(s.splat_u64s(GUESS)), half))
    }

    #[inline(always)]
    fn estimate(s: V4, x: <V4 as Simd>::f64s) -> <V4 as Simd>::f64s {
        cast(s.avx512f._mm512_rsqrt14_pd(cast(x)))
    }

    /// a b + c, rounded once.
    #[inline(always)]
    fn fused<S: Simd>(s: S, a: S::f64s, b: S::f64s, c: S::f64s) -> S::f64s {
        s.mul_add_f64s(a, b, c)
    }

    width!(V3, 4, splat_f64s, fused, guess3, false, guess3, |s: V3, x| s.avx._mm256_floor_pd(x), |s: V3, x| s.avx._mm256_cvttpd_epi32(x));
    width!(V4, 8, splat_f64s, fused, guess4, true, estimate, |s: V4, x| s.avx512f._mm512_roundscale_pd::<1>(x), |s: V4, x| s
        .avx512f
        ._mm512_cvttpd_epi32(x));

    /// Transposes four by four; its own inverse.
    #[inline(always)]
    fn four_by_four(s: pulp::core_arch::x86::Avx, a: __m256d, b: __m256d, c: __m256d, d: __m256d) -> [__m256d; 4] {
        let (ab, cd) = (s._mm256_unpacklo_pd(a, b), s._mm256_unpacklo_pd(c, d));
        let (ef, gh) = (s._mm256_unpackhi_pd(a, b), s._mm256_unpackhi_pd(c, d));
        [
            s._mm256_permute2f128_pd::<0x20>(ab, cd),
            s._mm256_permute2f128_pd::<0x20>(ef, gh),
            s._mm256_permute2f128_pd::<0x31>(ab, cd),
            s._mm256_permute2f128_pd::<0x31>(ef, gh),
        ]
    }

    impl Transpose for V3 {
        type Rows = [Row; 4];
        type Index = [i32; 4];
        #[inline(always)]
        unsafe fn pairs_at(self, from: *const f64, i: [i32; 4]) -> [Pack<Self>; 2] {
            let mut p = [[0.0; 2]; 4];
            for l in 0..4 {
                // SAFETY: the caller has checked the indices.
                p[l] = unsafe { *from.add(i[l] as usize).cast::<[f64; 2]>() };
            }
            let s = self.avx;
            let (a, b): (__m256d, __m256d) = (cast([p[0], p[2]]), cast([p[1], p[3]]));
            let pack = |v: __m256d| Pack { simd: self, v: cast(v) };
            [pack(s._mm256_unpacklo_pd(a, b)), pack(s._mm256_unpackhi_pd(a, b))]
        }
        type OfRows = [f64; 1];
        #[inline(always)]
        fn each_four_times(self, [a]: [f64; 1]) -> Pack<Self> {
            Pack { simd: self, v: self.splat_f64s(a) }
        }
        #[inline(always)]
        fn transpose(self, r: [Row; 4]) -> [Pack<Self>; 4] {
            let [x, y, z, w] = four_by_four(self.avx, cast(r[0]), cast(r[1]), cast(r[2]), cast(r[3]));
            four_packs!(self, [x, y, z, w])
        }
        #[inline(always)]
        fn untranspose(self, [x, y, z, w]: [Pack<Self>; 4]) -> [Row; 4] {
            let [a, b, c, d] = four_by_four(self.avx, cast(x.v), cast(y.v), cast(z.v), cast(w.v));
            [cast(a), cast(b), cast(c), cast(d)]
        }
        #[inline(always)]
        fn transpose_run(self, run: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
            self.transpose(cast([run[0].v, run[1].v, run[2].v, run[3].v]))
        }
        #[inline(always)]
        fn untranspose_run(self, v: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
            let [a, b, c, d]: [__m256d; 4] = cast(self.untranspose(v));
            four_packs!(self, [a, b, c, d])
        }
    }

    impl Transpose for V4 {
        type Rows = [Row; 8];
        type Index = [i32; 8];
        #[inline(always)]
        unsafe fn pairs_at(self, from: *const f64, i: [i32; 8]) -> [Pack<Self>; 2] {
            let mut p = [[0.0; 2]; 8];
            for l in 0..8 {
                // SAFETY: the caller has checked the indices.
                p[l] = unsafe { *from.add(i[l] as usize).cast::<[f64; 2]>() };
            }
            let s = self.avx512f;
            let (a, b) = (cast([p[0], p[2], p[4], p[6]]), cast([p[1], p[3], p[5], p[7]]));
            let pack = |v: __m512d| Pack { simd: self, v: cast(v) };
            [pack(s._mm512_unpacklo_pd(a, b)), pack(s._mm512_unpackhi_pd(a, b))]
        }
        type OfRows = [f64; 2];
        #[inline(always)]
        fn each_four_times(self, [a, b]: [f64; 2]) -> Pack<Self> {
            Pack { simd: self, v: cast([a, a, a, a, b, b, b, b]) }
        }
        #[inline(always)]
        fn transpose(self, r: [Row; 8]) -> [Pack<Self>; 4] {
            let s = self.avx512f;
            let low = four_by_four(self.avx, cast(r[0]), cast(r[1]), cast(r[2]), cast(r[3]));
            let high = four_by_four(self.avx, cast(r[4]), cast(r[5]), cast(r[6]), cast(r[7]));
            let mut p = [s._mm512_castpd256_pd512(low[0]); 4];
            for i in 0..4 {
                p[i] = s._mm512_insertf64x4::<1>(s._mm512_castpd256_pd512(low[i]), high[i]);
            }
            four_packs!(self, [p[0], p[1], p[2], p[3]])
        }
        #[inline(always)]
        fn untranspose(self, [x, y, z, w]: [Pack<Self>; 4]) -> [Row; 8] {
            let s = self.avx512f;
            let (x, y, z, w) = (cast(x.v), cast(y.v), cast(z.v), cast(w.v));
            let mut rows = [[0.0; 4]; 8];
            let low = |v| s._mm512_castpd512_pd256(v);
            let high = |v| s._mm512_extractf64x4_pd::<1>(v);
            let a = four_by_four(self.avx, low(x), low(y), low(z), low(w));
            let b = four_by_four(self.avx, high(x), high(y), high(z), high(w));
            for i in 0..4 {
                rows[i] = cast(a[i]);
                rows[4 + i] = cast(b[i]);
            }
            rows
        }
        #[inline(always)]
        fn transpose_run(self, run: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
            self.transpose(cast([run[0].v, run[1].v, run[2].v, run[3].v]))
        }
        #[inline(always)]
        fn untranspose_run(self, v: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
            let [a, b, c, d]: [__m512d; 4] = cast(self.untranspose(v));
            four_packs!(self, [a, b, c, d])
        }
    }
}
