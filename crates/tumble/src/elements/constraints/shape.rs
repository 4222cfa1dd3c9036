//! Shape matching: masses are drawn to their places in the rest shape, moved and turned as fits them best.
//!
//!   E = kappa/2 sum_i m_i |x_i - g_i|²,   g_i = c + R q_i,   R = argmin E                         (shapes.1)
//!
//! c is the centre of mass and q_i the rest places from theirs. A sub-step of implicit Euler is solved exactly: c and R, which minimize E,
//! do not change on the way. Without kappa the shape is rigid, and goes around the masses that are held.
//! Source: [mueller2005]; the rotation is that of [horn1987], an eigenvector, which needs no start from the last one and so no state.
//! Verified in `tests/surfaces.rs`.

use super::{Constraints, Projection};
use crate::geometry::Walls;
use crate::math::parallel::{chunks, fold};
use crate::math::{Quat, Real, Row, Vec3, eigen, xyz64};
use std::ops::Range;

type Vector = Vec3<f64>;

/// Weight of a held mass of a rigid shape in the fit, over the mass of all: each sweep leaves one part in so many of how far it is off its
/// place. By its own mass a corner of a block would lead as little as it weighs.                               (shapes.4)
pub const HELD: f64 = 1e4;

/// The points of one body.
pub struct Shape {
    rows: Range<usize>,
    mass: Vec<f64>,
    total: f64,
    /// Rest places from the centre of mass [m].
    rest: Vec<Vector>,
    /// kappa [1/s²]; infinite if rigid.
    kappa: f64,
    /// Ways of the masses in this sub-step [m]; empty for one sweep.
    moved: Vec<Vector>,
}

impl Shape {
    /// The rows from `rows.start` on with these masses [kg] and places at rest [m], held by `kappa` [1/s²]; `None` if there is not one of each
    /// for every row, or no mass.
    pub fn new(rows: Range<usize>, mass: Vec<f64>, places: &[Vector], kappa: f64) -> Option<Self> {
        if mass.len() != rows.len() || places.len() != rows.len() {
            return None;
        }
        let total: f64 = mass.iter().sum();
        let center = mass.iter().zip(places).fold(Vector::default(), |sum, (m, x)| sum + *x * *m) * (1.0 / total);
        let rest = places.iter().map(|x| *x - center).collect();
        (total > 0.0).then_some(Self { rows, mass, total, rest, kappa, moved: Vec::new() })
    }

    /// The centre of mass and the rotation that fits best; of a rigid shape that is held, the point that stands for the centre.
    fn fit(&self, x: &[Row]) -> (Vector, Quat<f64>) {
        let x = &x[self.rows.clone()];
        // Measured from one point, so that nothing is lost far from the origin.
        let origin = x.first().map_or(Vector::default(), |row| xyz64(*row));
        if self.kappa.is_infinite() && x.iter().any(|x| x[3] == 0.0) {
            return self.fit_held(x, origin);
        }
        let first = |range: Range<usize>| range.fold(Vector::default(), |sum, i| sum + (xyz64(x[i]) - origin) * self.mass[i]);
        let center = origin + fold(x.len(), first).into_iter().fold(Vector::default(), |a, b| a + b) * (1.0 / self.total);
        // S = sum m q (x - c)^T, as rows.
        let second = |range: Range<usize>| {
            range.fold([Vector::default(); 3], |s, i| {
                let (q, d) = (self.rest[i], (xyz64(x[i]) - center) * self.mass[i]);
                [s[0] + d * q.x, s[1] + d * q.y, s[2] + d * q.z]
            })
        };
        let add = |a: [Vector; 3], b: [Vector; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        let s = fold(x.len(), second).into_iter().fold([Vector::default(); 3], add);
        (center, rotation(s))
    }

    /// The same with held masses as heavy as can be: where the origin of the rest places goes to, and the rotation.
    fn fit_held(&self, x: &[Row], origin: Vector) -> (Vector, Quat<f64>) {
        let weight = |i: usize| if x[i][3] == 0.0 { HELD * self.total } else { self.mass[i] };
        let sums = |range: Range<usize>| {
            range.fold((0.0, Vector::default(), Vector::default()), |(m, q, d), i| {
                (m + weight(i), q + self.rest[i] * weight(i), d + (xyz64(x[i]) - origin) * weight(i))
            })
        };
        let zero = (0.0, Vector::default(), Vector::default());
        let (m, q, d) = fold(x.len(), sums).into_iter().fold(zero, |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2));
        let (rest, center) = (q * (1.0 / m), origin + d * (1.0 / m));
        let second = |range: Range<usize>| {
            range.fold([Vector::default(); 3], |s, i| {
                let (q, d) = (self.rest[i] - rest, (xyz64(x[i]) - center) * weight(i));
                [s[0] + d * q.x, s[1] + d * q.y, s[2] + d * q.z]
            })
        };
        let add = |a: [Vector; 3], b: [Vector; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        let turn = rotation(fold(x.len(), second).into_iter().fold([Vector::default(); 3], add));
        (center - turn.turn(rest), turn)
    }
}

/// The rotation R with the largest sum of m x . R q from S = sum m q x^T.
fn rotation(s: [Vector; 3]) -> Quat<f64> {
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = s.map(<[f64; 3]>::from);
    // [horn1987], order w, x, y, z.
    let matrix = [
        [xx + yy + zz, yz - zy, zx - xz, xy - yx],
        [yz - zy, xx - yy - zz, xy + yx, zx + xz],
        [zx - xz, xy + yx, yy - xx - zz, yz + zy],
        [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ];
    let [w, x, y, z] = largest_eigenvector(matrix);
    Quat { v: Vec3 { x, y, z }, w }
}

/// The eigenvector of the largest eigenvalue of a symmetric matrix.
fn largest_eigenvector(a: [[f64; 4]; 4]) -> [f64; 4] {
    let (values, v) = eigen::symmetric(a);
    let most = (1..4).fold(0, |best, i| if values[i] > values[best] { i } else { best });
    let norm = v.iter().map(|row| row[most] * row[most]).sum::<f64>().sqrt();
    v.map(|row| row[most] / norm)
}

impl Constraints for Shape {
    fn name(&self) -> &'static str {
        "shape"
    }

    fn len(&self) -> usize {
        1
    }

    fn connect(&self, join: &mut dyn FnMut(u32, u32)) {
        self.rows.clone().skip(1).for_each(|i| join(self.rows.start as u32, i as u32));
    }

    fn matched(&self, h: f64, plain: Option<f64>) -> Option<(Range<usize>, f64)> {
        let share = plain.unwrap_or_else(|| 1.0 / (1.0 + 1.0 / (self.kappa * h * h)));
        Some((self.rows.clone(), share))
    }

    fn energy(&self, x: &[Row], _: Walls<'_>) -> f64 {
        if self.kappa.is_infinite() {
            return 0.0;
        }
        let ((center, turn), rest) = (self.fit(x), &self.rest);
        let goal = |i: usize| center + turn.turn(rest[i]);
        let rows = &x[self.rows.clone()];
        let of = |i: usize| 0.5 * self.kappa * self.mass[i] * (xyz64(rows[i]) - goal(i)).norm_sq();
        fold(rows.len(), |range| range.map(of).sum::<f64>()).into_iter().sum()
    }

    fn project(&mut self, x: &mut [Row], step: &Projection<'_>) {
        let many = step.iterations > 1 && step.plain.is_none();
        let mut moved = std::mem::take(&mut self.moved);
        if many && (step.iteration == 0 || moved.len() != self.rows.len()) {
            moved.clear();
            moved.resize(self.rows.len(), Vector::default());
        }
        let ((center, turn), rest) = (self.fit(x), &self.rest);
        let goal = |i: usize| center + turn.turn(rest[i]);
        // alpha = m/(kappa h²), and so is what it multiplies.
        let soft = if step.plain.is_some() { 0.0 } else { 1.0 / (self.kappa * step.h * step.h) };
        let part = step.plain.map_or(1.0, f64::from) / (1.0 + soft);
        let way = |i: usize, row: &Row, moved: Vector| (goal(i) - xyz64(*row) - moved * soft) * part;
        let put = |row: &mut Row, d: Vector| {
            if row[3] > 0.0 {
                *row = [row[0] + d.x as Real, row[1] + d.y as Real, row[2] + d.z as Real, row[3]];
            }
        };
        let rows = &mut x[self.rows.clone()];
        if many {
            crate::math::parallel::chunks2(rows, &mut moved, |start, rows, moved| {
                for (k, (row, moved)) in rows.iter_mut().zip(moved).enumerate() {
                    let d = way(start + k, row, *moved);
                    *moved = *moved + d;
                    put(row, d);
                }
            });
        } else {
            chunks(rows, |start, rows| {
                for (k, row) in rows.iter_mut().enumerate() {
                    let d = way(start + k, row, Vector::default());
                    put(row, d);
                }
            });
        }
        self.moved = moved;
    }

    fn add_grip(&self, _: &[Row], grip: &mut [Real]) {
        if self.kappa.is_finite() {
            for (grip, m) in grip[self.rows.clone()].iter_mut().zip(&self.mass) {
                *grip += (self.kappa * m) as Real;
            }
        }
    }
}
