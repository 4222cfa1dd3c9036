//! Couplings of many cells: a rigid body moved by the pressure around it.
//!
//!   A + sum over joints of weight j jᵀ                                                              (pressure.15)
//!
//! Each adds one eigenvalue that no preconditioner of A sees, and so about one iteration to conjugate gradients, however light the
//! thing is. Of a j whose sum over a floating component is not zero (a thing that leans on a wall) the mean is taken, as it is of
//! the right-hand side.

use super::Solver;
use super::faces::Weight;
use super::pockets::Pockets;
use super::report::{Fault, Params};
use crate::math::Real;

/// A row j and its weight.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Joint {
    pub(super) cells: Vec<(u32, Real)>,
    pub(super) weight: f64,
    /// Floating components and the mean of j over each that has one.
    means: Vec<(usize, f64)>,
}

impl Joint {
    /// Numbers of cells and their entries in j, where a cell may come more than once; the weight, 0 or more.
    pub fn new(cells: Vec<(u32, Real)>, weight: f64) -> Self {
        Self { cells, weight, means: Vec::new() }
    }

    fn sum(&self, q: impl Fn(usize) -> f64) -> f64 {
        self.cells.iter().map(|(at, j)| f64::from(*j) * q(*at as usize)).sum()
    }

    /// j . q, q of any mean.
    fn product(&self, pockets: &Pockets, q: impl Fn(usize) -> f64) -> f64 {
        let means = self.means.iter().map(|(component, mean)| mean * pockets.numbers(*component).map(&q).sum::<f64>());
        self.sum(&q) - means.sum::<f64>()
    }

    /// out += factor j
    fn add(&self, pockets: &Pockets, factor: f64, out: &mut [Real]) {
        self.cells.iter().for_each(|(at, j)| out[*at as usize] += factor as Real * j);
        for (component, mean) in &self.means {
            let less = (factor * mean) as Real;
            pockets.numbers(*component).for_each(|at| out[at] -= less);
        }
    }
}

impl<T: Weight> Solver<T> {
    /// Adds joints to the matrix, in place of those that it had. Only conjugate gradients take them.
    pub fn join(&mut self, joints: Vec<Joint>) {
        self.joints = joints;
        for joint in &mut self.joints {
            joint.means = self.pockets.means(&joint.cells);
        }
    }

    /// j . q of every joint.
    pub fn yielded(&self, q: &[Real]) -> Vec<f64> {
        self.joints.iter().map(|joint| joint.product(&self.pockets, |at| f64::from(q[at]))).collect()
    }

    pub(super) fn check_joints(&self, params: &Params) -> Result<(), Fault> {
        if params.method.is_gradients() || self.joints.iter().all(|joint| joint.weight == 0.0) {
            return Ok(());
        }
        Err(Fault::Method { method: params.method, because: "what yields to the pressure needs conjugate gradients".into() })
    }

    /// p . J p of all joints together; p has no mean over floating components.
    pub(super) fn joined_curvature(&self, p: &[Real]) -> f64 {
        let square = |joint: &Joint| {
            let product = joint.sum(|at| f64::from(p[at]));
            joint.weight * product * product
        };
        self.joints.iter().map(square).sum()
    }

    /// b -= a J p
    pub(super) fn joined_step(&mut self, a: Real, p: &[Real]) {
        for joint in self.joints.iter().filter(|joint| joint.weight > 0.0) {
            let product = joint.sum(|at| f64::from(p[at]));
            joint.add(&self.pockets, -f64::from(a) * joint.weight * product, &mut self.fine.b);
        }
    }

    /// out -= J q
    pub(super) fn joined_residual(&self, q: &[f64], out: &mut [Real]) {
        for joint in &self.joints {
            let product = joint.product(&self.pockets, |at| q[at]);
            joint.add(&self.pockets, -joint.weight * product, out);
        }
    }
}
