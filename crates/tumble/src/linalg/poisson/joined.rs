//! Couplings of many cells: a rigid body moved by the pressure around it.
//!
//!   A + sum over joints of Jᵀ W J                                                                   (pressure.15)
//!
//! J has a row for each direction in which the body may move, W says how it yields to impulses along them. Each direction adds one eigenvalue
//! that no preconditioner of A sees, and so about one iteration to conjugate gradients, however light the body is. Of a row whose sum over a
//! floating component is not zero (a thing that leans on a wall) the mean is taken, as it is of the right-hand side.

use super::Solver;
use super::faces::Weight;
use super::pockets::Pockets;
use super::report::{Fault, Params};
use crate::math::Real;

/// Directions in which a body may move: along three axes, and about them.
pub const DIRECTIONS: usize = 6;

/// A number for each direction.
pub type Directions = [f64; DIRECTIONS];

/// Rows J, and the symmetric matrix W >= 0 between them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Joint {
    pub(super) cells: Vec<(u32, [Real; DIRECTIONS])>,
    pub(super) response: [Directions; DIRECTIONS],
    /// Floating components and the means of the rows over each where one has any.
    means: Vec<(usize, Directions)>,
}

/// A matrix times a vector.
pub fn times(matrix: &[Directions; DIRECTIONS], x: &Directions) -> Directions {
    matrix.map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum())
}

impl Joint {
    /// Numbers of cells and their entries in the rows of J, where a cell may come more than once; W.
    pub fn new(cells: Vec<(u32, [Real; DIRECTIONS])>, response: [Directions; DIRECTIONS]) -> Self {
        Self { cells, response, means: Vec::new() }
    }

    fn is_held(&self) -> bool {
        self.response.iter().flatten().all(|w| *w == 0.0)
    }

    fn sum(&self, q: impl Fn(usize) -> f64) -> Directions {
        let mut sums = [0.0; DIRECTIONS];
        for (at, entries) in &self.cells {
            let q = q(*at as usize);
            sums.iter_mut().zip(entries).for_each(|(sum, entry)| *sum += f64::from(*entry) * q);
        }
        sums
    }

    /// J q, q of any mean.
    fn product(&self, pockets: &Pockets, q: impl Fn(usize) -> f64) -> Directions {
        let mut sums = self.sum(&q);
        for (component, means) in &self.means {
            let all: f64 = pockets.numbers(*component).map(&q).sum();
            sums.iter_mut().zip(means).for_each(|(sum, mean)| *sum -= mean * all);
        }
        sums
    }

    /// out -= Jᵀ y
    fn take(&self, pockets: &Pockets, y: &Directions, out: &mut [Real]) {
        let along = |entries: &[Real; DIRECTIONS]| entries.iter().zip(y).map(|(entry, y)| f64::from(*entry) * y).sum::<f64>();
        self.cells.iter().for_each(|(at, entries)| out[*at as usize] -= along(entries) as Real);
        for (component, means) in &self.means {
            let more = means.iter().zip(y).map(|(mean, y)| mean * y).sum::<f64>() as Real;
            pockets.numbers(*component).for_each(|at| out[at] += more);
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

    /// J q of every joint.
    pub fn yielded(&self, q: &[Real]) -> Vec<Directions> {
        self.joints.iter().map(|joint| joint.product(&self.pockets, |at| f64::from(q[at]))).collect()
    }

    pub(super) fn check_joints(&self, params: &Params) -> Result<(), Fault> {
        if params.method.is_gradients() || self.joints.iter().all(Joint::is_held) {
            return Ok(());
        }
        Err(Fault::Method { method: params.method, because: "what yields to the pressure needs conjugate gradients".into() })
    }

    /// p . Jᵀ W J p of all joints together; p has no mean over floating components.
    pub(super) fn joined_curvature(&self, p: &[Real]) -> f64 {
        let square = |joint: &Joint| {
            let product = joint.sum(|at| f64::from(p[at]));
            times(&joint.response, &product).iter().zip(&product).map(|(a, b)| a * b).sum::<f64>()
        };
        self.joints.iter().map(square).sum()
    }

    /// b -= a Jᵀ W J p
    pub(super) fn joined_step(&mut self, a: Real, p: &[Real]) {
        for joint in self.joints.iter().filter(|joint| !joint.is_held()) {
            let product = joint.sum(|at| f64::from(p[at])).map(|product| f64::from(a) * product);
            joint.take(&self.pockets, &times(&joint.response, &product), &mut self.fine.b);
        }
    }

    /// out -= Jᵀ W J q
    pub(super) fn joined_residual(&self, q: &[f64], out: &mut [Real]) {
        for joint in &self.joints {
            let product = joint.product(&self.pockets, |at| q[at]);
            joint.take(&self.pockets, &times(&joint.response, &product), out);
        }
    }
}
