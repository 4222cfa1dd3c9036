//! Elements of one kind as columns, with everything about them that needs no scratch: energies, products of single
//! elements.

use super::{Element, Law, energy, gauss_newton, hessian, tangents};
use crate::math::parallel::{fold, worst};
use crate::math::simd::{Index, Kernel, Scalar, Sum, Width, dispatch, largest, packs};
use crate::math::{Lane, Quat, Real, Row, Vec3};
use std::marker::PhantomData;
use std::ops::Range;
use tumble_interface::scene::Hessian;

/// One element, as a recipe gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Members<const N: usize, const D: usize, const P: usize> {
    /// Rows of its nodes.
    pub nodes: [u32; N],
    /// Its rest numbers.
    pub rest: [f64; D],
    /// Parameters of its law.
    pub law: [f64; P],
    /// Its stiffness.
    pub stiffness: f64,
    /// Its internal damping.
    pub damping: f64,
}

/// How much of the stiffness matrix K and of the damping matrix D a product holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Factor of K.
    pub stiffness: Real,
    /// Factor of D [1/s].
    pub damping: Real,
    /// Which K.
    pub hessian: Hessian,
}

/// Elements E with the law Y over N nodes, with M measures, D rest numbers and P law parameters, as columns.
pub struct List<E, Y, const N: usize, const M: usize, const D: usize, const P: usize> {
    pub nodes: [Index; N],
    pub rest: [Vec<Real>; D],
    pub law: [Vec<Real>; P],
    pub stiffness: Vec<Real>,
    pub damping: Vec<Real>,
    pub damped: bool,
    pub weights: Weights,
    kind: PhantomData<(E, Y)>,
}

/// The numbers of one pack of elements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pack<L, const D: usize, const P: usize> {
    pub rest: [L; D],
    pub law: [L; P],
    pub stiffness: L,
    pub damping: L,
}

impl<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize> List<E, Y, N, M, D, P> {
    /// `None` if a node is not one of the rows 0..rows.
    pub fn new(rows: usize, members: &[Members<N, D, P>]) -> Option<Self> {
        let column = |f: &dyn Fn(&Members<N, D, P>) -> f64| -> Vec<Real> { members.iter().map(|m| f(m) as Real).collect() };
        let mut nodes: [Index; N] = std::array::from_fn(|_| Index::default());
        for (a, index) in nodes.iter_mut().enumerate() {
            *index = Index::new(members.iter().map(|m| m.nodes[a]).collect(), rows)?;
        }
        Some(Self {
            nodes,
            rest: std::array::from_fn(|d| column(&|m| m.rest[d])),
            law: std::array::from_fn(|p| column(&|m| m.law[p])),
            stiffness: column(&|m| m.stiffness),
            damping: column(&|m| m.damping),
            damped: members.iter().any(|m| m.damping != 0.0),
            weights: Weights { stiffness: 1.0, damping: 0.0, hessian: Hessian::Definite },
            kind: PhantomData,
        })
    }

    pub fn len(&self) -> usize {
        self.stiffness.len()
    }

    /// Panics unless every column of rows is long enough for the unchecked loads.
    pub fn check(&self, columns: &[&[Row]]) {
        for rows in columns {
            assert!(self.nodes.iter().all(|i| i.rows() <= rows.len()), "a column is shorter than the rows that elements use");
        }
    }

    #[inline(always)]
    pub fn pack<W: Width>(&self, w: W, e: usize) -> Pack<W::L, D, P> {
        let stiffness = w.load(&self.stiffness[e..]);
        let (mut rest, mut law) = ([stiffness; D], [stiffness; P]);
        for d in 0..D {
            rest[d] = w.load(&self.rest[d][e..]);
        }
        for p in 0..P {
            law[p] = w.load(&self.law[p][e..]);
        }
        Pack { rest, law, stiffness, damping: w.load(&self.damping[e..]) }
    }

    /// The rows of the nodes; frames, the last ones, scaled to length 1.
    #[inline(always)]
    pub fn rows<W: Width>(&self, w: W, x: &[Row], e: usize) -> [[W::L; 4]; N] {
        let mut out = [[w.splat(0.0); 4]; N];
        for a in 0..N {
            // SAFETY: every public entry has called `check` on x.
            out[a] = unsafe { w.gather(x, &self.nodes[a].get()[e..]) };
            if a >= N - E::FRAMES {
                out[a] = Quat::from_row(out[a]).normalized().row();
            }
        }
        out
    }

    /// Vectors (velocities, directions) at the nodes.
    #[inline(always)]
    pub fn vectors<W: Width>(&self, w: W, v: &[Row], e: usize) -> [Vec3<W::L>; N] {
        let zero = w.splat(0.0);
        let mut out = [Vec3 { x: zero, y: zero, z: zero }; N];
        for a in 0..N {
            // SAFETY: every public entry has called `check` on v.
            let [x, y, z, _] = unsafe { w.gather(v, &self.nodes[a].get()[e..]) };
            out[a] = Vec3 { x, y, z };
        }
        out
    }

    /// The weighted matrix of one pack times u.
    #[inline(always)]
    pub fn product<L: Lane>(&self, p: &Pack<L, D, P>, x: [[L; 4]; N], u: [Vec3<L>; N]) -> [Vec3<L>; N] {
        let k = p.stiffness * p.stiffness.like(f64::from(self.weights.stiffness));
        let b = p.damping * p.damping.like(f64::from(self.weights.damping));
        if self.weights.hessian == Hessian::Exact {
            let mut out = hessian::<E, Y, L, N, M, D, P>(k, p.law, p.rest, x, u);
            if self.damped {
                let damping = gauss_newton::<E, L, N, M, D>([b; M], p.rest, x, u);
                for a in 0..N {
                    out[a] = out[a] + damping[a];
                }
            }
            return out;
        }
        let mut c = tangents::<E, Y, L, N, M, D, P>(k, p.law, p.rest, x);
        for i in 0..M {
            c[i] = c[i] + b;
        }
        let mut out = gauss_newton::<E, L, N, M, D>(c, p.rest, x, u);
        let mut y = E::residual(p.rest, x);
        for i in 0..M {
            y[i] = Y::stress(k, p.law, y[i]);
        }
        if let Some(tension) = E::tension(p.rest, x, y, u) {
            for a in 0..N {
                out[a] = out[a] + tension[a];
            }
        }
        out
    }

    /// The 3N x 3N matrix of one element, as (node, component, column).
    fn matrix(&self, x: &[Row], e: usize, mut take: impl FnMut(usize, usize, [Vec3<Real>; N])) {
        let p = self.pack(Scalar, e);
        let rows = self.rows(Scalar, x, e);
        for a in 0..N {
            for c in 0..3 {
                take(a, c, self.product(&p, rows, unit(Scalar, a, c)));
            }
        }
    }

    /// Every block of every element's matrix.
    pub fn entries(&self, x: &[Row], sink: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        self.check(&[x]);
        for e in 0..self.len() {
            let mut blocks = [[[[0.0; 3]; 3]; N]; N];
            self.matrix(x, e, |b, c, product| {
                for a in 0..N {
                    let column: [Real; 3] = product[a].into();
                    for r in 0..3 {
                        blocks[a][b][r][c] = f64::from(column[r]);
                    }
                }
            });
            for a in 0..N {
                for b in 0..N {
                    sink(self.nodes[a].get()[e] as usize, self.nodes[b].get()[e] as usize, blocks[a][b]);
                }
            }
        }
    }

    /// The energy of all elements [J].
    pub fn energy(&self, x: &[Row]) -> f64 {
        self.check(&[x]);
        fold(self.len(), |range| dispatch(Energies { list: self, range, x })).into_iter().sum()
    }

    /// The largest lengthening of elements that are not broken; negative infinity if there is none.
    pub fn largest_strain(&self, x: &[Row]) -> f64 {
        self.check(&[x]);
        let most = fold(self.len(), |range| dispatch(Strains { list: self, range, x }));
        most.into_iter().fold(f64::NEG_INFINITY, |m, s| m.max(f64::from(s)))
    }

    /// That lengthening, and the first two rows of the element that has it.
    pub fn most_strained(&self, x: &[Row]) -> Option<(f64, [u32; 2])> {
        self.check(&[x]);
        let strain = |e: usize| f64::from(dispatch(Strains { list: self, range: e..e + 1, x }));
        let (e, most) = worst(self.len(), strain)?;
        Some((most, [0, 1].map(|a| self.nodes[a.min(N - 1)].get()[e])))
    }
}

/// A vector of length 1 at node a along axis c, and none at the others.
#[inline(always)]
pub fn unit<W: Width, const N: usize>(w: W, a: usize, c: usize) -> [Vec3<W::L>; N] {
    let (zero, one) = (w.splat(0.0), w.splat(1.0));
    let mut out = [Vec3 { x: zero, y: zero, z: zero }; N];
    match c {
        0 => out[a].x = one,
        1 => out[a].y = one,
        _ => out[a].z = one,
    }
    out
}

struct Strains<'a, E, Y, const N: usize, const M: usize, const D: usize, const P: usize> {
    list: &'a List<E, Y, N, M, D, P>,
    range: Range<usize>,
    x: &'a [Row],
}

impl<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize> Kernel
    for Strains<'_, E, Y, N, M, D, P>
{
    type Output = Real;
    #[inline(always)]
    fn run<W: Width>(self, w: W) -> Real {
        let mut most = Real::NEG_INFINITY;
        packs!(W, w, self.range, |e| {
            let p = self.list.pack(w, e);
            let Some(strain) = E::lengthening(p.rest, self.list.rows(w, self.x, e)) else { return most };
            most = largest(w, p.stiffness.positive(strain, w.splat(Real::NEG_INFINITY)), most);
        });
        most
    }
}

struct Energies<'a, E, Y, const N: usize, const M: usize, const D: usize, const P: usize> {
    list: &'a List<E, Y, N, M, D, P>,
    range: Range<usize>,
    x: &'a [Row],
}

impl<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize> Kernel
    for Energies<'_, E, Y, N, M, D, P>
{
    type Output = f64;
    #[inline(always)]
    fn run<W: Width>(self, w: W) -> f64 {
        let (mut sum, start) = (Sum::default(), self.range.start);
        packs!(W, w, self.range, |e| {
            let p = self.list.pack(w, e);
            let rows = self.list.rows(w, self.x, e);
            sum.add(w, energy::<E, Y, _, N, M, D, P>(p.stiffness, p.law, p.rest, rows), e - start);
        });
        sum.total()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elements::{Distance, Linear};
    use crate::math::simd::{Level, dispatch_at};

    #[test]
    fn every_width_sums_the_same_energy() {
        // Energies over fourteen decades, so that the order of the sum shows.
        let n = 101_u32;
        let x: Vec<Row> = (0..=n).map(|i| [0.1 * i as Real, (i * i % 17) as Real, 0.0, 0.0]).collect();
        let spring =
            |i: u32| Members { nodes: [i, i + 1], rest: [0.3], law: [], stiffness: 10.0_f64.powi((i % 15) as i32 - 7), damping: 0.0 };
        let list = List::<Distance, Linear, 2, 1, 1, 0>::new(x.len(), &(0..n).map(spring).collect::<Vec<_>>()).unwrap();
        let sum = |level| dispatch_at(level, Energies { list: &list, range: 3..n as usize, x: &x });
        assert!(sum(Level::Scalar) > 1e6);
        for level in Level::available() {
            assert_eq!(sum(level).to_bits(), sum(Level::Scalar).to_bits(), "{level:?}");
        }
    }
}
