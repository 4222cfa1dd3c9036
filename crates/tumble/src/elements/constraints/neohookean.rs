//! Stable Neo-Hookean tetrahedra, projected. Both laws are stressed at rest and balance each other, so both are solved as a pair: one
//! after the other they take gradients at different places, which do not cancel, and the solid does not keep its own rest state.
//!
//!   (a11 + alpha1) d1 + a12 d2 = -(c1 + alpha1 lambda1),   a12 d1 + (a22 + alpha2) d2 = -(c2 + alpha2 lambda2),
//!   a_ij = sum_n w_n g_in . g_jn,   c1 = |F|, c2 = det F - 1 - mu/lambda                      (solids.10)
//!
//! One sweep a sub-step: at rest the two gradients are parallel, and round-off grows with sweeps. Verified: an unloaded block stays at rest.

use super::{Columns, Constraints, Members, Projection, Shared, compliance};
use crate::elements::{Element, TetShear, TetVolume, energy, law::Linear, point};
use crate::geometry::Walls;
use crate::math::parallel::fold;
use crate::math::simd::{Kernel, Scalar, Sum, Width, dispatch, packs};
use crate::math::{Lane, Real, Row, Vec3};
use std::ops::Range;

/// Tetrahedra with both laws; the law's parameter is the compliance of the volume.
pub struct Neohookean {
    columns: Columns<4, 10, 1>,
    /// Two multipliers an element, side by side; empty for one sweep.
    lambda: Vec<Real>,
    energy_at_rest: f64,
}

impl Neohookean {
    /// The pairs of both laws over the same points, stiffnesses k1 = mu V and k2 = lambda V; `None` if a node is not a row.
    pub fn new(rows: usize, shears: &[Members<4, 9, 0>], volumes: &[Members<4, 10, 0>], energy_at_rest: f64) -> Option<Self> {
        let pair = |(shear, volume): (&Members<4, 9, 0>, &Members<4, 10, 0>)| Members {
            nodes: volume.nodes,
            rest: volume.rest,
            law: [f64::from(compliance(volume.stiffness))],
            stiffness: shear.stiffness,
            damping: 0.0,
        };
        let members: Vec<_> = shears.iter().zip(volumes).map(pair).collect();
        Some(Self { columns: Columns::new(rows, rows, &[], &members, &[])?, lambda: Vec::new(), energy_at_rest })
    }
}

#[inline(always)]
fn matrix<L: Lane>(rest: [L; 10]) -> [L; 9] {
    let mut b = [rest[0]; 9];
    for i in 0..9 {
        b[i] = rest[i];
    }
    b
}

/// c1 and its gradients, c2 and its gradients.
#[inline(always)]
fn measures<L: Lane>(rest: [L; 10], x: [[L; 4]; 4]) -> (L, [[L; 4]; 4], L, [[L; 4]; 4]) {
    let b = matrix(rest);
    let mut f = TetShear::residual(b, x);
    let mut sum = rest[0].zero();
    for i in 0..9 {
        sum = sum + f[i] * f[i];
    }
    let c1 = sum.sqrt();
    let inverse = c1.positive(c1.like(1.0) / c1, c1.zero());
    for i in 0..9 {
        f[i] = f[i] * inverse;
    }
    let [c2] = TetVolume::residual(rest, x);
    (c1, TetShear::pullback(b, x, f), c2, TetVolume::pullback(rest, x, [c1.like(1.0)]))
}

struct Project<'a> {
    columns: &'a Columns<4, 10, 1>,
    range: Range<usize>,
    lambda: [&'a mut [Real]; 2],
    h: Real,
    x: Shared,
    first: bool,
}

impl Kernel for Project<'_> {
    type Output = ();
    #[allow(clippy::assign_op_pattern)] // lanes have no +=
    #[inline(always)]
    fn run<W: Width>(self, w: W) {
        let (columns, start) = (self.columns, self.range.start);
        let [lambda1, lambda2] = self.lambda;
        let many = !lambda1.is_empty();
        let scale = 1.0 / (self.h * self.h);
        packs!(W, w, self.range, |e| {
            let (rest, [soft2]) = columns.pack(w, e);
            // SAFETY: `check` has been called; no element of a colour shares a node with another.
            let mut x = unsafe { columns.gather(w, 0, self.x.rows(), e) };
            let (alpha1, alpha2) = (w.load(&columns.compliance[e..]) * w.splat(scale), soft2 * w.splat(scale));
            let (mut l1, mut l2) = (w.splat(0.0), w.splat(0.0));
            if many && !self.first {
                l1 = w.load(&lambda1[e - start..]);
                l2 = w.load(&lambda2[e - start..]);
            }
            let (c1, g1, c2, g2) = measures(rest, x);
            let (mut a11, mut a12, mut a22) = (alpha1, w.splat(0.0), alpha2);
            for n in 0..4 {
                let (g1, g2, weight) = (point(g1[n]), point(g2[n]), x[n][3]);
                a11 = a11 + weight * g1.norm_sq();
                a12 = a12 + weight * g1.dot(g2);
                a22 = a22 + weight * g2.norm_sq();
            }
            let (b1, b2) = (-(c1 + alpha1 * l1), -(c2 + alpha2 * l2));
            let det = a11 * a22 - a12 * a12;
            let inverse = det.positive(w.splat(1.0) / det, w.splat(0.0));
            let (d1, d2) = ((b1 * a22 - b2 * a12) * inverse, (a11 * b2 - a12 * b1) * inverse);
            if many {
                w.store(l1 + d1, &mut lambda1[e - start..]);
                w.store(l2 + d2, &mut lambda2[e - start..]);
            }
            for n in 0..4 {
                let d: Vec3<_> = (point(g1[n]) * d1 + point(g2[n]) * d2) * x[n][3];
                x[n] = [x[n][0] + d.x, x[n][1] + d.y, x[n][2] + d.z, x[n][3]];
                // SAFETY: as above.
                unsafe { w.put(x[n], self.x.rows(), &columns.nodes[n].get()[e..]) };
            }
        });
    }
}

struct Energies<'a> {
    columns: &'a Columns<4, 10, 1>,
    range: Range<usize>,
    x: &'a [Row],
}

impl Kernel for Energies<'_> {
    type Output = f64;
    #[inline(always)]
    fn run<W: Width>(self, w: W) -> f64 {
        let (columns, mut sum, start) = (self.columns, Sum::default(), self.range.start);
        packs!(W, w, self.range, |e| {
            let (rest, [soft2]) = columns.pack(w, e);
            // SAFETY: `energy` has called `check`.
            let x = unsafe { columns.gather(w, 0, self.x.as_ptr(), e) };
            let (k1, k2) = (w.splat(1.0) / w.load(&columns.compliance[e..]), w.splat(1.0) / soft2);
            let shear = energy::<TetShear, Linear, _, 4, 9, 9, 0>(k1, [], matrix(rest), x);
            sum.add(w, shear + energy::<TetVolume, Linear, _, 4, 1, 10, 0>(k2, [], rest, x), e - start);
        });
        sum.total()
    }
}

impl Constraints for Neohookean {
    fn name(&self) -> &'static str {
        "tetrahedron"
    }

    fn len(&self) -> usize {
        self.columns.len()
    }

    fn connect(&self, join: &mut dyn FnMut(u32, u32)) {
        self.columns.connect(join);
    }

    fn energy(&self, x: &[Row], _: Walls<'_>) -> f64 {
        self.columns.check(x);
        let columns = &self.columns;
        fold(self.len(), |range| dispatch(Energies { columns, range, x })).into_iter().sum::<f64>() - self.energy_at_rest
    }

    fn project(&mut self, x: &mut [Row], step: &Projection<'_>) {
        let columns = &self.columns;
        columns.check(x);
        let (x, h, first) = (Shared(x.as_mut_ptr()), step.h as Real, step.iteration == 0);
        if step.iterations == 1 {
            columns.sweep(0, &mut [], |range, _| {
                dispatch(Project { columns, range, lambda: [&mut [], &mut []], h, x, first });
            });
        } else {
            // A task has the multipliers of its elements: first those of the shear, then those of the volume.
            self.lambda.resize(2 * columns.len(), 0.0);
            columns.sweep(2, &mut self.lambda, |range, own| {
                let (shear, volume) = own.split_at_mut(range.len());
                dispatch(Project { columns, range, lambda: [shear, volume], h, x, first });
            });
        }
    }

    fn add_grip(&self, x: &[Row], grip: &mut [Real]) {
        self.columns.check(x);
        for e in 0..self.len() {
            let (rest, [soft2]) = self.columns.pack(Scalar, e);
            // SAFETY: checked above.
            let x = unsafe { self.columns.gather(Scalar, 0, x.as_ptr(), e) };
            let (_, g1, _, g2) = measures(rest, x);
            for n in 0..4 {
                let size = point(g1[n]).norm_sq() / self.columns.compliance[e] + point(g2[n]).norm_sq() / soft2;
                grip[self.columns.nodes[n].get()[e] as usize] += size;
            }
        }
    }
}
