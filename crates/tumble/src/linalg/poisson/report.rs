//! Parameters of a solve, its report, and its errors.

use std::fmt;

/// The ladder of methods, from the simplest to the fastest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Method {
    /// Every cell from its neighbours of before, with weight 6/7.
    Jacobi,
    /// Red cells, then black ones.
    GaussSeidel,
    /// The same, overshooting by the factor that is best for a box.
    Sor,
    /// Conjugate gradients.
    ConjugateGradients,
    /// With incomplete Cholesky factors, IC(0).
    IncompleteCholesky,
    /// With modified incomplete Cholesky factors, MIC(0).
    ModifiedIncompleteCholesky,
    /// V-cycles alone.
    Multigrid,
    /// Conjugate gradients with a V-cycle before each step.
    MultigridGradients,
    /// The cosine transform, for closed boxes without solids.
    Cosine,
}

impl Method {
    /// All of them, in order.
    pub const ALL: [Self; 9] = [
        Self::Jacobi,
        Self::GaussSeidel,
        Self::Sor,
        Self::ConjugateGradients,
        Self::IncompleteCholesky,
        Self::ModifiedIncompleteCholesky,
        Self::Multigrid,
        Self::MultigridGradients,
        Self::Cosine,
    ];

    /// Whether it goes along conjugate gradients.
    pub fn is_gradients(self) -> bool {
        matches!(self, Self::ConjugateGradients | Self::IncompleteCholesky | Self::ModifiedIncompleteCholesky | Self::MultigridGradients)
    }

    /// Its name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Jacobi => "Jacobi",
            Self::GaussSeidel => "Gauss-Seidel",
            Self::Sor => "SOR",
            Self::ConjugateGradients => "CG",
            Self::IncompleteCholesky => "CG with IC(0)",
            Self::ModifiedIncompleteCholesky => "CG with MIC(0)",
            Self::Multigrid => "multigrid",
            Self::MultigridGradients => "CG with multigrid",
            Self::Cosine => "cosine transform",
        }
    }
}

/// When a solve is good enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    /// |b - A x| over |b|, root mean squares.
    Relative(f64),
    /// The largest |b - A x| of a cell, in the unit of b. For b = -dx D u: tolerance times dx times the largest |u|.
    Largest(f64),
}

/// Treatment of a right-hand side that no pressure can balance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Excess {
    /// An error: more flows in than out.
    Refuse,
    /// The same if the mean is larger than this, which its rounding may be where nearly nothing else is left.
    RefuseAbove(f64),
    /// The mean is taken from each component.
    Remove,
}

/// Parameters of a solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// By which method.
    pub method: Method,
    /// How well.
    pub target: Target,
    /// Iterations at most.
    pub iterations: usize,
    /// Treatment of a mean.
    pub excess: Excess,
}

impl Default for Params {
    fn default() -> Self {
        Self { method: Method::MultigridGradients, target: Target::Relative(1e-5), iterations: 200, excess: Excess::Remove }
    }
}

/// How a solve ended.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Info {
    /// Iterations made, those of all refinements together.
    pub iterations: usize,
    /// |b - A x| over |b| after each iteration; before the first it is 1. By recursion, or, after each refinement, as evaluated.
    pub residuals: Vec<f64>,
    /// The largest |b - A x| of a cell, in the unit of b: before the first iteration, and after each.
    pub history: Vec<f64>,
    /// When that was [s], by the clock of [`super::Solver::with_clock`]; empty without one.
    pub times: Vec<f64>,
    /// The largest |b - A x| of a cell at the end, in the unit of b.
    pub largest: f64,
    /// Whether the target is met.
    pub converged: bool,
    /// Components of cells that no open face joins to the largest one.
    pub pockets: usize,
    /// How often what is left was evaluated anew and solved for.
    pub refinements: usize,
    pub(super) clock: Clock,
}

/// Clock [s], as the engine has none of its own. All clocks compare equal.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Clock(pub Option<fn() -> f64>);

impl PartialEq for Clock {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Info {
    /// Nothing done yet, by that clock.
    pub(super) fn by(clock: Clock) -> Self {
        Self { clock, ..Self::default() }
    }

    fn mark(&mut self, largest: f64) {
        self.largest = largest;
        self.history.push(largest);
        self.times.extend(self.clock.0.map(|now| now()));
    }

    /// Before the first iteration.
    pub(super) fn begin(&mut self, squared: f64, largest: f64, target: Target) {
        self.mark(largest);
        self.converged = squared == 0.0 || matches!(target, Target::Largest(most) if largest <= most);
    }

    /// After an iteration: the squared norm of what is left, that of the right-hand side.
    pub(super) fn add(&mut self, squared: f64, start: f64, largest: f64, target: Target) {
        self.iterations += 1;
        self.mark(largest);
        let residual = (squared / start).sqrt();
        self.residuals.push(residual);
        self.converged = match target {
            Target::Relative(most) => residual <= most,
            Target::Largest(most) => largest <= most && residual.is_finite(),
        };
    }

    /// |b - A x| over |b| at the end.
    pub fn residual(&self) -> f64 {
        self.residuals.last().copied().unwrap_or(if self.converged { 0.0 } else { 1.0 })
    }
}

/// Why there is no solution. Cells are (i, j, k), axes 0, 1, 2.
#[derive(Debug, Clone, PartialEq)]
pub enum Fault {
    /// No cells, or columns that do not have the layout's length.
    Shape {
        /// Numbers that were expected.
        expected: usize,
        /// Numbers that were given.
        given: usize,
    },
    /// One side of an axis is joined to the other, which is not joined.
    Sides {
        /// The axis.
        axis: usize,
    },
    /// A weight that is negative, not finite, or above that of an open face in bytes.
    Weight {
        /// The axis that the face crosses.
        axis: usize,
        /// The cell whose lower face it is.
        cell: [usize; 3],
    },
    /// A right-hand side that is not finite.
    NotFinite {
        /// The cell.
        cell: [usize; 3],
    },
    /// More flows into a closed component than out of it.
    Excess {
        /// A cell of the component.
        cell: [usize; 3],
        /// Cells of the component.
        cells: usize,
        /// The mean of b over it, which should be zero, in the unit of b.
        mean: f64,
    },
    /// The method cannot solve this system.
    Method {
        /// Which.
        method: Method,
        /// The obstacle.
        because: String,
    },
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Shape { expected, given } => write!(f, "{given} numbers where the layout of the grid has {expected}"),
            Self::Sides { axis } => write!(f, "only one side of axis {} is periodic: join both or none", ["x", "y", "z"][*axis]),
            Self::Weight { axis, cell } => {
                write!(f, "the lower face of cell {cell:?} across {} has a weight below closed or above open", ["x", "y", "z"][*axis])
            }
            Self::NotFinite { cell } => write!(f, "the divergence of cell {cell:?} is no finite number"),
            Self::Excess { cell, cells, mean } => write!(
                f,
                "the closed space of {cells} cells around cell {cell:?} takes in more than it lets out (mean {mean:.3e}): open a side, \
                 balance the inflow, or have the mean removed"
            ),
            Self::Method { method, because } => write!(f, "{} cannot solve this: {because}", method.name()),
        }
    }
}

impl std::error::Error for Fault {}
