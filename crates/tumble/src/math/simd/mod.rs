//! Registers as lanes. A kernel is written once over [`Width`]; [`dispatch`] runs it on the widest registers
//! of the machine. Every width computes the same bits: each lane does the same correctly rounded operations.
//!
//! Rows of four numbers are loaded as whole registers and transposed, which beats gather instructions by 1.8x.
//! In kernels use `for` loops and `#[inline(always)]` functions only: closures and `array::map` become calls
//! compiled without the wide registers.

#[cfg(any(target_arch = "x86_64", all(target_arch = "wasm32", target_feature = "simd128")))]
mod registers;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;
#[cfg(target_arch = "x86_64")]
mod x86;

#[cfg(not(feature = "double"))]
use super::lane::{RSQRT, newton_rsqrt};
use super::{Lane, Real, Row};
use pulp::Simd;
use std::ops::{Add, Div, Mul, Neg, Sub};
use std::sync::atomic::{AtomicU8, Ordering};

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

    /// Puts another row at a place, if it is one.
    pub fn set(&mut self, place: usize, row: u32) {
        if (row as usize) < self.rows {
            self.index[place] = row;
        }
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
    /// Loads `from[at..at + N]` and looks at no bound.
    ///
    /// # Safety
    /// `at + N <= from.len()`.
    unsafe fn load_at(self, from: &[Real], at: usize) -> Self::L;
    /// Stores to `to[..N]`.
    fn store(self, v: Self::L, to: &mut [Real]);
    /// Loads the rows `index[..N]` and transposes them: four registers with x, y, z and w of N rows.
    ///
    /// # Safety
    /// Every index is below `rows.len()`.
    #[inline(always)]
    unsafe fn gather(self, rows: &[Row], index: &[u32]) -> [Self::L; 4] {
        debug_assert!(index[..Self::N].iter().all(|i| (*i as usize) < rows.len()));
        // SAFETY: the caller has checked the indices.
        unsafe { self.gather_at(rows.as_ptr(), index) }
    }
    /// The same from a place in memory, whose other rows others may write.
    ///
    /// # Safety
    /// There are rows at every index, and nobody writes them.
    unsafe fn gather_at(self, rows: *const Row, index: &[u32]) -> [Self::L; 4];
    /// Stores N rows at `index[..N]`.
    ///
    /// # Safety
    /// There are rows at every index, all different, and nobody else reads or writes them.
    unsafe fn put(self, v: [Self::L; 4], rows: *mut Row, index: &[u32]);
    /// Numbers from the order in which they were loaded into that of `rows_at`, and back.
    fn in_run(self, v: Self::L) -> Self::L;
    /// The result of `gather_at` for the rows `start..start + N`, faster, and in an order of its own.
    ///
    /// # Safety
    /// There are such rows, and nobody writes them.
    unsafe fn rows_at(self, rows: *const Row, start: u32) -> [Self::L; 4];
    /// The effect of `put` on the rows `start..start + N`, from the order of `rows_at`.
    ///
    /// # Safety
    /// There are such rows, and nobody else reads or writes them.
    unsafe fn put_rows(self, v: [Self::L; 4], rows: *mut Row, start: u32);
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

/// Initial value of `guess`.                                          (orbits.15)
#[cfg(not(feature = "double"))]
pub const GUESS: u32 = 0x5ef2_c6a6;
/// Initial value of `guess`.                                          (orbits.15)
#[cfg(feature = "double")]
pub const GUESS: u64 = 0x5fde_58d4_c7b5_3800;

/// How many numbers the registers of `w` hold; in the body of `packs!`, where `W` is the widest of two.
#[inline(always)]
pub fn count<W: Width>(_w: W) -> usize {
    W::N
}

/// The sum of numbers in an order that does not depend on the width: every sixteenth of them, then the sixteen sums.
#[derive(Default)]
pub struct Sum([f64; 16]);

impl Sum {
    /// Adds a pack whose first number is number `at` of all.
    #[inline(always)]
    pub fn add<W: Width>(&mut self, w: W, lanes: W::L, at: usize) {
        let mut each = [0.0; 16];
        w.store(lanes, &mut each);
        let start = at % 16;
        for (sum, one) in self.0[start..start + W::N].iter_mut().zip(&each[..W::N]) {
            *sum += f64::from(*one);
        }
    }

    /// All of it.
    #[inline(always)]
    pub fn total(self) -> f64 {
        self.0.iter().sum()
    }
}

/// The largest of `most` and of all lanes; NaN is never the larger.
#[inline(always)]
pub fn largest<W: Width>(w: W, lanes: W::L, most: Real) -> Real {
    let mut each = [0.0; 16];
    w.store(lanes, &mut each);
    each[..W::N].iter().fold(most, |most, lane| most.max(*lane))
}

/// Runs `$body` with `$w` and the first number `$e` of each pack of `$range`, then one by one: in the same body, or, where that is long, by
/// the kernel of all numbers from `$e` on, whose code for single numbers is then compiled once, not in that for each width.
macro_rules! packs {
    ($width:ident, $w:ident, $range:expr, |$e:ident| $body:expr, else $kernel:expr) => {{
        let mut $e = $range.start;
        while $e + $width::N <= $range.end {
            $body;
            $e += $width::N;
        }
        if $e < $range.end {
            $crate::math::simd::one_by_one($kernel);
        }
    }};
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

/// Asks memory for numbers that are read soon; no result changes. The machine sees where a column goes on by itself, but not
/// from one short row to the next.
#[inline(always)]
pub fn ask(numbers: &[Real]) {
    #[cfg(target_arch = "x86_64")]
    for line in numbers.chunks(64 / size_of::<Real>()) {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: no address is wrong.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(line.as_ptr().cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = numbers;
}

/// Asks memory for `count` rows, `at` rows behind the end of these: long columns are worked through part by part, and the next part
/// lies behind this one. Memory is then read while registers are busy, not between the passes over a part.
#[inline(always)]
pub fn ask_behind(rows: &[Row], at: usize, count: usize) {
    #[cfg(target_arch = "x86_64")]
    for row in (0..count).step_by(64 / size_of::<Row>()) {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: no address is wrong.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(rows.as_ptr_range().end.wrapping_add(at + row).cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (rows, at, count);
}

/// A kernel, generic over the register width.
pub trait Kernel {
    /// Its result.
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
    unsafe fn load_at(self, from: &[Real], at: usize) -> Real {
        // SAFETY: the caller has checked the place.
        unsafe { *from.get_unchecked(at) }
    }
    #[inline(always)]
    fn store(self, v: Real, to: &mut [Real]) {
        to[0] = v;
    }
    #[inline(always)]
    unsafe fn gather_at(self, rows: *const Row, index: &[u32]) -> [Real; 4] {
        // SAFETY: the caller has checked the index.
        unsafe { *rows.add(index[0] as usize) }
    }
    #[inline(always)]
    unsafe fn put(self, v: [Real; 4], rows: *mut Row, index: &[u32]) {
        // SAFETY: the caller has checked the index.
        unsafe { *rows.add(index[0] as usize) = v };
    }
    #[inline(always)]
    fn in_run(self, v: Real) -> Real {
        v
    }
    #[inline(always)]
    unsafe fn rows_at(self, rows: *const Row, start: u32) -> [Real; 4] {
        // SAFETY: the caller has checked the place.
        unsafe { *rows.add(start as usize) }
    }
    #[inline(always)]
    unsafe fn put_rows(self, v: [Real; 4], rows: *mut Row, start: u32) {
        // SAFETY: the caller has checked the place.
        unsafe { *rows.add(start as usize) = v };
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

#[cfg(not(feature = "double"))]
type Mask<S> = <S as Simd>::m32s;
#[cfg(feature = "double")]
type Mask<S> = <S as Simd>::m64s;

/// Operations of an instruction set's registers beyond pulp.
pub trait Registers: Simd {
    /// Whether any lane of a mask is set.
    fn any(self, mask: Mask<Self>) -> bool;
    /// The larger of x and 0; 0 for NaN and -0, too.
    #[cfg(not(feature = "double"))]
    #[inline(always)]
    fn above_zero(self, x: Register<Self>) -> Register<Self> {
        // One instruction, which takes the second where the first is not larger.
        self.max_f32s(x, self.splat_f32s(0.0))
    }
    /// The larger of x and 0; 0 for NaN and -0, too.
    #[cfg(feature = "double")]
    #[inline(always)]
    fn above_zero(self, x: Register<Self>) -> Register<Self> {
        self.max_f64s(x, self.splat_f64s(0.0))
    }
    /// The number whose bits are `from` less half the bits of x.
    #[cfg(not(feature = "double"))]
    #[inline(always)]
    fn half_bits(self, from: u32, x: Register<Self>) -> Register<Self> {
        let half = self.wrapping_dyn_shr_u32s(self.transmute_u32s_f32s(x), self.splat_u32s(1));
        self.transmute_f32s_u32s(self.sub_u32s(self.splat_u32s(from), half))
    }
}

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
        impl<S: Registers> Lane for Pack<S> {
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
                newton_rsqrt(self, Self { simd: self.simd, v: self.simd.half_bits(RSQRT, self.v) })
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
            #[inline(always)]
            fn above_zero(self) -> Self {
                Self { simd: self.simd, v: self.simd.above_zero(self.v) }
            }
            #[inline(always)]
            fn any_positive(self) -> bool {
                self.simd.any(self.simd.$greater(self.v, self.simd.$splat(0.0)))
            }
        }
    };
}

#[cfg(not(feature = "double"))]
operations!(splat_f32s, add_f32s, sub_f32s, mul_f32s, div_f32s, neg_f32s, sqrt_f32s, greater_than_f32s, select_f32s);
#[cfg(feature = "double")]
operations!(splat_f64s, add_f64s, sub_f64s, mul_f64s, div_f64s, neg_f64s, sqrt_f64s, greater_than_f64s, select_f64s);

/// The instruction sets that a kernel can be run on, for tests that compare their bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// One number at a time.
    Scalar,
    /// Those of WebAssembly: 128-bit registers.
    Narrow,
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
        let wide = [(Self::Narrow, cfg!(all(target_arch = "wasm32", target_feature = "simd128")))];
        std::iter::once(Self::Scalar).chain(wide.into_iter().filter(|(_, has)| *has).map(|(level, _)| level)).collect()
    }
}

impl Level {
    /// Its name in manifests.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Narrow => "128 bits",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}

/// No kernel of this process uses wider registers than these.
static WIDEST: AtomicU8 = AtomicU8::new(Level::Avx512 as u8);

/// Holds all kernels of this process to registers no wider than `level`, to compare machines. The bits stay the same.
pub fn hold_to(level: Level) {
    WIDEST.store(level as u8, Ordering::Relaxed);
}

/// The widest registers that kernels use.
pub fn widest() -> Level {
    let most = WIDEST.load(Ordering::Relaxed);
    Level::available().into_iter().rfind(|level| *level as u8 <= most).unwrap_or(Level::Scalar)
}

/// Runs a kernel on one number at a time.
#[inline(never)]
pub fn one_by_one<K: Kernel>(kernel: K) -> K::Output {
    kernel.run(Scalar)
}

/// Runs a kernel on the widest registers of this machine.
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    dispatch_at(Level::Avx512, kernel)
}

/// The level that kernels are held to.
#[cfg(target_arch = "x86_64")]
fn held(most: u8) -> Level {
    [Level::Scalar, Level::Narrow, Level::Avx2][most.min(2) as usize]
}

/// Whether kernels are compiled for AVX2 and single numbers alone, which takes a third off the time of development builds.
#[cfg(target_arch = "x86_64")]
const QUICK: bool = cfg!(debug_assertions);

/// Runs a kernel on registers no wider than `level`.
#[inline]
pub fn dispatch_at<K: Kernel>(level: Level, kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        let most = WIDEST.load(Ordering::Relaxed);
        let level = if level as u8 <= most { level } else { held(most) };
        if !QUICK && let (Level::Avx512, Some(simd)) = (level, x86::avx512()) {
            return Simd::vectorize(simd, x86::InAvx512 { kernel, simd });
        }
        if let (Level::Avx2 | Level::Avx512, Some(simd)) = (level, x86::avx2()) {
            return Simd::vectorize(simd, x86::InAvx2 { kernel, simd });
        }
    }
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    if level != Level::Scalar {
        // SAFETY: the module is compiled for these registers.
        return kernel.run(unsafe { pulp::wasm::Simd128::new_unchecked() });
    }
    let _ = level;
    one_by_one(kernel)
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

    /// Moves rows to three places behind and adds numbers to their last one, as runs and one by one; sums these numbers.
    struct Shifts<'a> {
        from: &'a [Row],
        numbers: &'a [Real],
        index: &'a Index,
        to: [&'a mut [Row]; 2],
    }

    impl Kernel for Shifts<'_> {
        type Output = f64;
        #[inline(always)]
        fn run<W: Width>(self, w: W) -> f64 {
            let ([run, apart], mut sum) = (self.to, Sum::default());
            for start in (0..64).step_by(W::N) {
                let (numbers, index) = (w.load(&self.numbers[start..]), &self.index.get()[start..]);
                sum.add(w, numbers, start);
                let mut behind = [0; 16];
                for l in 0..W::N {
                    behind[l] = index[l] + 3;
                }
                // SAFETY: there are 67 rows, and all indices are below 64.
                unsafe {
                    let mut rows = w.rows_at(self.from.as_ptr(), start as u32);
                    rows[3] = rows[3] + w.in_run(numbers);
                    w.put_rows(rows, run.as_mut_ptr(), start as u32 + 3);
                    let mut rows = w.gather_at(self.from.as_ptr(), index);
                    rows[3] = rows[3] + numbers;
                    w.put(rows, apart.as_mut_ptr(), &behind);
                }
            }
            sum.total()
        }
    }

    #[test]
    fn every_width_moves_rows_that_lie_one_behind_the_other() {
        let from: Vec<Row> = (0..67).map(|i| [i as Real, 0.1 * i as Real, -(i as Real), 100.0 + i as Real]).collect();
        let numbers: Vec<Real> = (0..64).map(|i| 0.5 * (i * i % 11) as Real).collect();
        let index = Index::new((0..64).map(|i| i * 37 % 64).collect(), 64).unwrap();
        for level in Level::available() {
            let (mut run, mut apart) = (vec![[0.0; 4]; 67], vec![[0.0; 4]; 67]);
            let sum = dispatch_at(level, Shifts { from: &from, numbers: &numbers, index: &index, to: [&mut run, &mut apart] });
            // Halves: exact in any order.
            assert_eq!(sum, numbers.iter().map(|n| f64::from(*n)).sum::<f64>(), "{level:?}");
            for (i, number) in numbers.iter().enumerate() {
                let at = index.get()[i] as usize;
                let plus = |[x, y, z, w]: Row| [x, y, z, w + number];
                assert_eq!([run[i + 3], apart[at + 3]], [plus(from[i]), plus(from[at])], "{level:?}");
            }
        }
    }

    #[test]
    fn an_index_beyond_the_rows_is_refused() {
        assert!(Index::new(vec![0, 3], 3).is_none());
        assert!(Index::new(vec![0, 2], 3).is_some());
    }
}
