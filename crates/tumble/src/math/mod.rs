//! L0: the scalar type, lanes, vectors, quaternions, derivatives, fixed-order parallel loops.

pub mod animated;
pub mod column;
pub mod dual;
pub mod eigen;
pub mod formula;
pub mod functions;
pub mod lane;
pub mod lattice;
pub mod parallel;
pub mod quat;
pub mod random;
pub mod roots;
pub mod rotation;
pub mod rows;
pub mod simd;
pub mod vec3;

pub use animated::{Signal, VectorSignal};
pub use column::{Column, Spare};
pub use dual::Dual;
pub use lane::Lane;
pub use lattice::Lattice;
pub use quat::Quat;
pub use random::Random;
pub use vec3::Vec3;

/// The engine's scalar: f32, or f64 in the twin crate.
#[cfg(not(feature = "double"))]
pub type Real = f32;
/// The engine's scalar: f32, or f64 in the twin crate.
#[cfg(feature = "double")]
pub type Real = f64;

/// A row of a state column: a point [x, y, z, 1/m] or a quaternion [x, y, z, w].
///
/// Four numbers, because a row is then loaded and stored as one register, and sixteen rows transpose into lanes.
pub type Row = [Real; 4];

/// A row of zeros.
pub const ZERO: Row = [0.0; 4];

/// The first three numbers of a row.
#[inline(always)]
pub fn xyz(row: Row) -> Vec3<Real> {
    Vec3 { x: row[0], y: row[1], z: row[2] }
}

/// The first three numbers of a row, in double precision.
pub fn xyz64(row: Row) -> Vec3<f64> {
    Vec3 { x: f64::from(row[0]), y: f64::from(row[1]), z: f64::from(row[2]) }
}

/// A row from a vector, with a fourth number.
#[inline(always)]
pub fn row(v: Vec3<Real>, w: Real) -> Row {
    [v.x, v.y, v.z, w]
}

/// a + c b, row by row of four.
#[inline(always)]
pub fn axpy(a: Row, c: Real, b: Row) -> Row {
    [a[0] + c * b[0], a[1] + c * b[1], a[2] + c * b[2], a[3] + c * b[3]]
}

/// c a.
#[inline(always)]
pub fn scale(a: Row, c: Real) -> Row {
    [c * a[0], c * a[1], c * a[2], c * a[3]]
}

/// a + b.
#[inline(always)]
pub fn add(a: Row, b: Row) -> Row {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

/// a - b.
#[inline(always)]
pub fn sub(a: Row, b: Row) -> Row {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]]
}

/// The product of two rows, summed over all four numbers, in double precision.
#[inline(always)]
pub fn dot(a: Row, b: Row) -> f64 {
    // Not `array::map`, which would be a call.
    let p = |i: usize| f64::from(a[i]) * f64::from(b[i]);
    (p(0) + p(1)) + (p(2) + p(3))
}

/// Halves an interval so many times, keeping the upper half where `is_above(middle)` says that what is sought lies there.
pub fn bisect((mut low, mut high): (f64, f64), times: u32, is_above: impl Fn(f64) -> bool) -> (f64, f64) {
    for _ in 0..times {
        let middle = 0.5 * (low + high);
        if is_above(middle) { low = middle } else { high = middle }
    }
    (low, high)
}

/// Whether all four numbers are finite.
#[inline(always)]
pub fn is_finite(a: Row) -> bool {
    ((a[0] + a[1]) + (a[2] + a[3])).is_finite() || a.iter().all(|x| x.is_finite())
}
