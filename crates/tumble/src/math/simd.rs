//! Registers as lanes. A kernel is written once over [`Width`]; [`dispatch`] runs it on the widest registers
//! of the machine. Every width computes the same bits: each lane does the same correctly rounded operations.
//!
//! Rows of four numbers are loaded as whole registers and transposed, which beats gather instructions by 1.8x.
//! In kernels use `for` loops and `#[inline(always)]` functions only: closures and `array::map` become calls
//! compiled without the wide registers.

#[cfg(not(feature = "double"))]
use super::lane::{RSQRT, newton_rsqrt};
use super::{Lane, Real, Row};
use pulp::Simd;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Indices into rows 0..rows, checked at construction, so that kernels may load without checks.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Index {
    index: Vec<u32>,
    rows: usize,
}

impl Index {
    /// Wraps indices; `None` if one is not below `rows`.
    pub fn new(index: Vec<u32>, rows: usize) -> Option<Self> {
        index.iter().all(|i| (*i as usize) < rows).then_some(Self { index, rows })
    }

    /// The indices.
    pub fn get(&self) -> &[u32] {
        &self.index
    }

    /// How many rows they index at least.
    pub fn rows(&self) -> usize {
        self.rows
    }
}

/// A set of registers that hold N numbers each.
pub trait Width: Copy + Send + Sync {
    /// N numbers.
    type L: Lane;
    /// Count of numbers.
    const N: usize;
    /// The constant `c`.
    fn splat(self, c: Real) -> Self::L;
    /// Loads `from[..N]`.
    fn load(self, from: &[Real]) -> Self::L;
    /// Stores to `to[..N]`.
    fn store(self, v: Self::L, to: &mut [Real]);
    /// Loads the rows `index[..N]` and transposes them: four registers with x, y, z and w of N rows.
    ///
    /// # Safety
    /// Every index is below `rows.len()`.
    unsafe fn gather(self, rows: &[Row], index: &[u32]) -> [Self::L; 4];
    /// Loads `from[i]` and `from[i + 1]` for `index[..N]`.
    ///
    /// # Safety
    /// Every index is at least 0 and below `from.len() - 1`.
    unsafe fn pairs(self, from: &[Real], index: &[i32]) -> [Self::L; 2];
    /// Loads `from[i..i + 4]` for `index[..N]`.
    ///
    /// # Safety
    /// Every index is at least 0 and below `from.len() - 3`.
    unsafe fn quads(self, from: &[Real], index: &[i32]) -> [Self::L; 4];
    /// The largest whole number not above x.
    fn floor(self, x: Self::L) -> Self::L;
    /// Stores whole numbers below 2^31 to `to[..N]`.
    fn whole(self, x: Self::L, to: &mut [i32]);
    /// Stores N rows at `start`, `start + stride`, ...
    fn scatter(self, v: [Self::L; 4], rows: &mut [Row], start: usize, stride: usize);
    /// Loads N consecutive rows from `start` and transposes them.
    fn rows(self, rows: &[Row], start: usize) -> [Self::L; 4];
    /// Adds to N consecutive rows from `start`.
    fn add_to_rows(self, v: [Self::L; 4], rows: &mut [Row], start: usize);
    /// For N consecutive numbers of a column of rows, the first of them number `at`: the number of each one's row.
    fn spread(self, of_rows: &[Real], at: usize) -> Self::L;
    /// The number whose bits are `GUESS` less half the bits of x > 0: some 2/3 of 1/sqrt(x), to 3.5 %.
    fn guess(self, x: Self::L) -> Self::L;
    /// a b + c, rounded once where the machine can: not the same bits everywhere.
    fn fused(self, a: Self::L, b: Self::L, c: Self::L) -> Self::L;
    /// Whether there is `estimate`.
    const ESTIMATES: bool;
    /// 1/sqrt(x) to 2^-14 by an instruction whose bits differ between makers of machines.
    fn estimate(self, x: Self::L) -> Self::L;
}

/// What `guess` starts from.                                          (orbits.15)
#[cfg(not(feature = "double"))]
pub const GUESS: u32 = 0x5ef2_c6a6;
/// What `guess` starts from.                                          (orbits.15)
#[cfg(feature = "double")]
pub const GUESS: u64 = 0x5fde_58d4_c7b5_3800;

/// How many numbers the registers of `w` hold; in the body of `packs!`, where `W` is the widest of two.
#[inline(always)]
pub fn count<W: Width>(_w: W) -> usize {
    W::N
}

/// Runs `$body` with `$w` and the first number `$e` of each pack of `$range`, then one by one.
macro_rules! packs {
    ($width:ident, $w:ident, $range:expr, |$e:ident| $body:expr) => {{
        let mut $e = $range.start;
        while $e + $width::N <= $range.end {
            $body;
            $e += $width::N;
        }
        let $w = $crate::math::simd::Scalar;
        while $e < $range.end {
            $body;
            $e += 1;
        }
    }};
}
pub(crate) use packs;

/// A kernel, generic over the register width.
pub trait Kernel {
    /// What it returns.
    type Output;
    /// Does the work.
    fn run<W: Width>(self, w: W) -> Self::Output;
}

/// One number at a time.
#[derive(Debug, Clone, Copy)]
pub struct Scalar;

impl Width for Scalar {
    type L = Real;
    const N: usize = 1;
    #[inline(always)]
    fn splat(self, c: Real) -> Real {
        c
    }
    #[inline(always)]
    fn load(self, from: &[Real]) -> Real {
        from[0]
    }
    #[inline(always)]
    fn store(self, v: Real, to: &mut [Real]) {
        to[0] = v;
    }
    #[inline(always)]
    unsafe fn gather(self, rows: &[Row], index: &[u32]) -> [Real; 4] {
        // SAFETY: the caller has checked the index.
        unsafe { *rows.get_unchecked(index[0] as usize) }
    }
    #[inline(always)]
    unsafe fn pairs(self, from: &[Real], index: &[i32]) -> [Real; 2] {
        let i = index[0] as usize;
        // SAFETY: the caller has checked the index.
        unsafe { [*from.get_unchecked(i), *from.get_unchecked(i + 1)] }
    }
    #[inline(always)]
    unsafe fn quads(self, from: &[Real], index: &[i32]) -> [Real; 4] {
        let i = index[0] as usize;
        // SAFETY: the caller has checked the index.
        unsafe { *from.get_unchecked(i..i + 4).as_ptr().cast::<[Real; 4]>() }
    }
    #[inline(always)]
    fn floor(self, x: Real) -> Real {
        x.floor()
    }
    #[inline(always)]
    fn whole(self, x: Real, to: &mut [i32]) {
        to[0] = x as i32;
    }
    #[inline(always)]
    fn scatter(self, v: [Real; 4], rows: &mut [Row], start: usize, _stride: usize) {
        rows[start] = v;
    }
    #[inline(always)]
    fn rows(self, rows: &[Row], start: usize) -> [Real; 4] {
        rows[start]
    }
    #[inline(always)]
    fn add_to_rows(self, v: [Real; 4], rows: &mut [Row], start: usize) {
        for i in 0..4 {
            rows[start][i] += v[i];
        }
    }
    #[inline(always)]
    fn spread(self, of_rows: &[Real], at: usize) -> Real {
        of_rows[at / 4]
    }
    #[inline(always)]
    fn guess(self, x: Real) -> Real {
        Real::from_bits(GUESS.wrapping_sub(x.to_bits() >> 1))
    }
    #[inline(always)]
    fn fused(self, a: Real, b: Real, c: Real) -> Real {
        a * b + c
    }
    const ESTIMATES: bool = false;
    #[inline(always)]
    fn estimate(self, x: Real) -> Real {
        self.guess(x)
    }
}

#[cfg(not(feature = "double"))]
type Register<S> = <S as Simd>::f32s;
#[cfg(feature = "double")]
type Register<S> = <S as Simd>::f64s;

/// A register with arithmetic operators.
#[derive(Clone, Copy)]
pub struct Pack<S: Simd> {
    simd: S,
    v: Register<S>,
}

macro_rules! operations {
    ($splat:ident, $add:ident, $sub:ident, $mul:ident, $div:ident, $neg:ident, $sqrt:ident, $greater:ident, $select:ident) => {
        impl<S: Simd> Add for Pack<S> {
            type Output = Self;
            #[inline(always)]
            fn add(self, b: Self) -> Self {
                Self { simd: self.simd, v: self.simd.$add(self.v, b.v) }
            }
        }
        impl<S: Simd> Sub for Pack<S> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, b: Self) -> Self {
                Self { simd: self.simd, v: self.simd.$sub(self.v, b.v) }
            }
        }
        impl<S: Simd> Mul for Pack<S> {
            type Output = Self;
            #[inline(always)]
            fn mul(self, b: Self) -> Self {
                Self { simd: self.simd, v: self.simd.$mul(self.v, b.v) }
            }
        }
        impl<S: Simd> Div for Pack<S> {
            type Output = Self;
            #[inline(always)]
            fn div(self, b: Self) -> Self {
                Self { simd: self.simd, v: self.simd.$div(self.v, b.v) }
            }
        }
        impl<S: Simd> Neg for Pack<S> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self { simd: self.simd, v: self.simd.$neg(self.v) }
            }
        }
        impl<S: Simd> Lane for Pack<S> {
            #[inline(always)]
            fn like(self, c: f64) -> Self {
                Self { simd: self.simd, v: self.simd.$splat(c as Real) }
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self { simd: self.simd, v: self.simd.$sqrt(self.v) }
            }
            #[cfg(not(feature = "double"))]
            #[inline(always)]
            fn rsqrt(self) -> Self {
                let s = self.simd;
                let half = s.wrapping_dyn_shr_u32s(s.transmute_u32s_f32s(self.v), s.splat_u32s(1));
                let guess = s.transmute_f32s_u32s(s.sub_u32s(s.splat_u32s(RSQRT), half));
                newton_rsqrt(self, Self { simd: s, v: guess })
            }
            #[cfg(feature = "double")]
            #[inline(always)]
            fn rsqrt(self) -> Self {
                self.like(1.0) / self.sqrt()
            }
            #[inline(always)]
            fn positive(self, then: Self, other: Self) -> Self {
                let mask = self.simd.$greater(self.v, self.simd.$splat(0.0));
                Self { simd: self.simd, v: self.simd.$select(mask, then.v, other.v) }
            }
        }
    };
}

#[cfg(not(feature = "double"))]
operations!(splat_f32s, add_f32s, sub_f32s, mul_f32s, div_f32s, neg_f32s, sqrt_f32s, greater_than_f32s, select_f32s);
#[cfg(feature = "double")]
operations!(splat_f64s, add_f64s, sub_f64s, mul_f64s, div_f64s, neg_f64s, sqrt_f64s, greater_than_f64s, select_f64s);

/// The instruction sets that a kernel can be run on, for tests that compare their bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// One number at a time.
    Scalar,
    /// AVX2: 256-bit registers.
    Avx2,
    /// AVX-512: 512-bit registers.
    Avx512,
}

impl Level {
    /// The levels that this machine has.
    pub fn available() -> Vec<Level> {
        #[cfg(target_arch = "x86_64")]
        let wide = [(Self::Avx2, x86::avx2().is_some()), (Self::Avx512, x86::avx512().is_some())];
        #[cfg(not(target_arch = "x86_64"))]
        let wide = [];
        std::iter::once(Self::Scalar).chain(wide.into_iter().filter(|(_, has)| *has).map(|(level, _)| level)).collect()
    }
}

impl Level {
    /// Its name in manifests.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}

/// Runs a kernel on the widest registers of this machine.
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    dispatch_at(Level::Avx512, kernel)
}

/// Runs a kernel on registers no wider than `level`.
#[inline]
pub fn dispatch_at<K: Kernel>(level: Level, kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        if let (Level::Avx512, Some(simd)) = (level, x86::avx512()) {
            return Simd::vectorize(simd, x86::InAvx512 { kernel, simd });
        }
        if let (Level::Avx2 | Level::Avx512, Some(simd)) = (level, x86::avx2()) {
            return Simd::vectorize(simd, x86::InAvx2 { kernel, simd });
        }
    }
    let _ = level;
    kernel.run(Scalar)
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{GUESS, Kernel, Pack, Real, Row, Width};
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

    /// Everything that does not depend on how rows are transposed.
    macro_rules! width {
        ($token:ident, $n:expr, $splat:ident, $fused:ident, $guess:expr, $estimates:expr, $estimate:expr, $floor:expr, $whole:expr) => {
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
                fn store(self, v: Self::L, to: &mut [Real]) {
                    to[..$n].copy_from_slice(&cast::<_, [Real; $n]>(v.v));
                }
                #[inline(always)]
                unsafe fn gather(self, rows: &[Row], index: &[u32]) -> [Self::L; 4] {
                    let index = &index[..$n];
                    let mut picked = [[0.0; 4]; $n];
                    for i in 0..$n {
                        debug_assert!((index[i] as usize) < rows.len());
                        // SAFETY: the caller has checked the indices.
                        picked[i] = unsafe { *rows.get_unchecked(index[i] as usize) };
                    }
                    self.transpose(picked)
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
                    let mut numbers = [0.0; $n / 4];
                    numbers.copy_from_slice(&of_rows[at / 4..at / 4 + $n / 4]);
                    self.each_four_times(numbers)
                }
                #[inline(always)]
                fn guess(self, x: Self::L) -> Self::L {
                    Pack { simd: self, v: $guess(self, x.v) }
                }
                #[inline(always)]
                fn fused(self, a: Self::L, b: Self::L, c: Self::L) -> Self::L {
                    Pack { simd: self, v: self.$fused(a.v, b.v, c.v) }
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
    trait Transpose: Simd {
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

    #[cfg(not(feature = "double"))]
    mod single {
        use super::*;
        use std::arch::x86_64::{__m256, __m512};

        /// GUESS - bits/2.
        #[inline(always)]
        fn guess<S: Simd>(s: S, x: S::f32s) -> S::f32s {
            let half = s.wrapping_dyn_shr_u32s(s.transmute_u32s_f32s(x), s.splat_u32s(1));
            s.transmute_f32s_u32s(s.sub_u32s(s.splat_u32s(GUESS), half))
        }

        #[inline(always)]
        fn estimate(s: V4, x: <V4 as Simd>::f32s) -> <V4 as Simd>::f32s {
            cast(s.avx512f._mm512_rsqrt14_ps(cast(x)))
        }

        width!(V3, 8, splat_f32s, mul_add_f32s, guess, false, guess, |s: V3, x| s.avx._mm256_floor_ps(x), |s: V3, x| s
            .avx
            ._mm256_cvttps_epi32(x));
        width!(V4, 16, splat_f32s, mul_add_f32s, guess, true, estimate, |s: V4, x| s.avx512f._mm512_roundscale_ps::<1>(x), |s: V4, x| s
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
                    rows[i] = cast(s._mm512_extractf32x4_ps::<0>(p[i]));
                    rows[4 + i] = cast(s._mm512_extractf32x4_ps::<1>(p[i]));
                    rows[8 + i] = cast(s._mm512_extractf32x4_ps::<2>(p[i]));
                    rows[12 + i] = cast(s._mm512_extractf32x4_ps::<3>(p[i]));
                }
                rows
            }
            #[inline(always)]
            fn transpose_run(self, [a, b, c, d]: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
                let s = self.avx512f;
                let (a, b, c, d) = (cast(a.v), cast(b.v), cast(c.v), cast(d.v));
                let mut p = four_by_four!(s, _mm512_unpacklo_ps, _mm512_unpackhi_ps, _mm512_shuffle_ps, [a, b, c, d]);
                for i in 0..4 {
                    p[i] = s._mm512_permutexvar_ps(cast(CROSSED), p[i]);
                }
                four_packs!(self, [p[0], p[1], p[2], p[3]])
            }
            #[inline(always)]
            fn untranspose_run(self, v: [Pack<Self>; 4]) -> [Pack<Self>; 4] {
                let s = self.avx512f;
                let mut p = [cast(v[0].v); 4];
                for i in 0..4 {
                    p[i] = s._mm512_permutexvar_ps(cast(CROSSED), cast(v[i].v));
                }
                let [a, b, c, d] = four_by_four!(s, _mm512_unpacklo_ps, _mm512_unpackhi_ps, _mm512_shuffle_ps, [p[0], p[1], p[2], p[3]]);
                four_packs!(self, [a, b, c, d])
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

        width!(V3, 4, splat_f64s, mul_add_f64s, guess3, false, guess3, |s: V3, x| s.avx._mm256_floor_pd(x), |s: V3, x| s
            .avx
            ._mm256_cvttpd_epi32(x));
        width!(V4, 8, splat_f64s, mul_add_f64s, guess4, true, estimate, |s: V4, x| s.avx512f._mm512_roundscale_pd::<1>(x), |s: V4, x| s
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
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Norms<'a> {
        rows: &'a [Row],
        index: &'a Index,
        out: &'a mut [Real],
        moved: &'a mut [Row],
    }

    impl Kernel for Norms<'_> {
        type Output = usize;
        #[inline(always)]
        fn run<W: Width>(self, w: W) -> usize {
            let full = self.index.get().len() / W::N * W::N;
            for start in (0..full).step_by(W::N) {
                // SAFETY: Index::new has checked it.
                let [x, y, z, q] = unsafe { w.gather(self.rows, &self.index.get()[start..]) };
                let n = (x * x + y * y + z * z).sqrt() / (q + q.like(2.0));
                w.store(x.positive(n, -n), &mut self.out[start..]);
                w.scatter([y, x, q, z], self.moved, 2 * start, 2);
            }
            W::N
        }
    }

    #[test]
    fn every_width_gathers_computes_and_scatters_the_same_bits() {
        let n = 64;
        let rows: Vec<Row> = (0..n).map(|i| [i as Real - 20.3, 0.1 * i as Real, (i * i % 7) as Real, 1.0 / (1.0 + i as Real)]).collect();
        let index = Index::new((0..n as u32).map(|i| i * 37 % 64).collect(), n).unwrap();
        let run = |level| {
            let (mut out, mut moved) = (vec![0.0; n], vec![[0.0; 4]; 2 * n]);
            let width = dispatch_at(level, Norms { rows: &rows, index: &index, out: &mut out, moved: &mut moved });
            (width, out, moved)
        };
        let (one, out, moved) = run(Level::Scalar);
        assert_eq!(one, 1);
        assert_eq!(
            moved[2 * 5],
            [
                rows[index.get()[5] as usize][1],
                rows[index.get()[5] as usize][0],
                rows[index.get()[5] as usize][3],
                rows[index.get()[5] as usize][2]
            ]
        );
        let mut widths = vec![one];
        for level in Level::available() {
            let (width, o, m) = run(level);
            widths.push(width);
            assert!(out.iter().zip(&o).all(|(a, b)| a.to_bits() == b.to_bits()), "{level:?}");
            assert_eq!(moved, m, "{level:?}");
        }
        assert!(widths.windows(2).all(|w| w[0] <= w[1]), "{widths:?}");
    }

    struct Picks<'a> {
        from: &'a [Real],
        index: &'a [i32],
        x: &'a [Real],
        out: &'a mut Vec<Real>,
    }

    impl Kernel for Picks<'_> {
        type Output = ();
        #[inline(always)]
        fn run<W: Width>(self, w: W) {
            let mut found = vec![[0.0; 16]; 8];
            for start in (0..64).step_by(W::N) {
                // SAFETY: the indices are below 61 of 64.
                let (two, four) = unsafe { (w.pairs(self.from, &self.index[start..]), w.quads(self.from, &self.index[start..])) };
                let floor = w.floor(w.load(&self.x[start..]));
                let mut whole = [0; 16];
                w.whole(floor, &mut whole);
                for (out, v) in found.iter_mut().zip([two[0], two[1], four[0], four[1], four[2], four[3], floor]) {
                    w.store(v, out);
                }
                for l in 0..W::N {
                    self.out.extend(found[..7].iter().map(|lanes| lanes[l]));
                    self.out.push(whole[l] as Real);
                }
            }
        }
    }

    #[test]
    fn every_width_picks_neighbours_and_whole_numbers() {
        let from: Vec<Real> = (0..64).map(|i| 0.37 * i as Real - 7.0).collect();
        let index: Vec<i32> = (0..64).map(|i| i * 29 % 61).collect();
        let x: Vec<Real> = (0..64).map(|i| (i as Real - 31.0) * 0.25).collect();
        for level in Level::available() {
            let mut out = Vec::new();
            dispatch_at(level, Picks { from: &from, index: &index, x: &x, out: &mut out });
            for i in 0..64 {
                let (at, floor) = (index[i] as usize, x[i].floor());
                let wanted = [from[at], from[at + 1], from[at], from[at + 1], from[at + 2], from[at + 3], floor, floor];
                assert_eq!(out[8 * i..8 * i + 8], wanted, "{level:?}");
            }
        }
    }

    #[test]
    fn an_index_beyond_the_rows_is_refused() {
        assert!(Index::new(vec![0, 3], 3).is_none());
        assert!(Index::new(vec![0, 2], 3).is_some());
    }
}
