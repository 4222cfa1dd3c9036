//! What joins many cells at once: a rigid thing that yields to the pressure around it.
//!
//!   A + sum over joints of weight j jᵀ                                                              (pressure.20)
//!
//! Each adds one eigenvalue that no preconditioner of A sees, and so about one iteration to conjugate gradients, however light the
//! thing is.

use super::Solver;
use super::faces::Weight;
use super::report::{Fault, Params};
use crate::math::Real;

/// A row j and its weight.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Joint {
    /// Numbers of cells and their entries in j; a cell may come more than once.
    pub cells: Vec<(u32, Real)>,
    /// Its weight, 0 or more.
    pub weight: f64,
}

impl Joint {
    /// j . q
    pub fn product(&self, q: &[Real]) -> f64 {
        self.cells.iter().map(|(at, j)| f64::from(*j) * f64::from(q[*at as usize])).sum()
    }

    fn add(&self, factor: f64, out: &mut [Real]) {
        let factor = factor as Real;
        self.cells.iter().for_each(|(at, j)| out[*at as usize] += factor * j);
    }
}

impl<T: Weight> Solver<T> {
    /// Adds joints to the matrix, in place of those that it had. Only conjugate gradients take them.
    pub fn join(&mut self, joints: Vec<Joint>) {
        self.joints = joints;
        self.joints.retain(|joint| joint.weight > 0.0 && !joint.cells.is_empty());
    }

    pub(super) fn check_joints(&self, params: &Params) -> Result<(), Fault> {
        if self.joints.is_empty() || params.method.is_gradients() {
            return Ok(());
        }
        Err(Fault::Method { method: params.method, because: "what yields to the pressure needs conjugate gradients".into() })
    }

    /// p . J p of all joints together.
    pub(super) fn joined_curvature(&self, p: &[Real]) -> f64 {
        self.joints.iter().map(|joint| joint.weight * joint.product(p) * joint.product(p)).sum()
    }

    /// b -= a J p
    pub(super) fn joined_step(&mut self, a: Real, p: &[Real]) {
        let b = &mut self.fine.b;
        for joint in &self.joints {
            joint.add(-f64::from(a) * joint.weight * joint.product(p), b);
        }
    }

    /// out -= J q, in double precision.
    pub(super) fn joined_residual(&self, q: &[f64], out: &mut [Real]) {
        for joint in &self.joints {
            let product: f64 = joint.cells.iter().map(|(at, j)| f64::from(*j) * q[*at as usize]).sum();
            joint.add(-joint.weight * product, out);
        }
    }
}
