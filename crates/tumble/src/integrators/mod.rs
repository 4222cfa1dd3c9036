//! L3: schemes for y' = f(y, t). They know nothing of the physics they move: an [`Equation`] gives rates, a scheme says
//! when rates are evaluated and how the state moves.
//!
//! y is (x, v): rows of points and frames, and their velocities. An equation of first order has no v.
//! Orders, stability limits and invariants are verified in `tests/integrators_*.rs` and `tests/stability_estimate.rs`.

mod adaptive;
mod implicit;
pub mod newton;
mod runge_kutta;
mod split;
pub mod stability;

pub use adaptive::adaptive_step;
pub use runge_kutta::{DORMAND_PRINCE, Tableau, tableau};

use crate::math::{Real, Row, ZERO, axpy, rotation, rows, xyz};
use crate::state::Frames;
use tumble_interface::StepError;
use tumble_interface::engine::StepReport;
use tumble_interface::scene::Integrator;

/// How positions follow velocities.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kinematics {
    /// Which rows are frames; the others are points.
    pub frames: Frames,
    /// Whether there are velocities: x' = v and v' = rate; else x' = rate.
    pub second_order: bool,
}

impl Kinematics {
    /// Moves the rows from `start` on along v for the time h: points straight, frames turning at constant rate.
    pub fn drift(self, start: usize, x: &mut [Row], v: &[Row], h: Real) {
        let [before, frames, after] = self.frames.cut(start, x.len());
        for points in [before, after] {
            rows::axpy(&mut x[points.clone()], h, &v[points]);
        }
        for (x, v) in x[frames.clone()].iter_mut().zip(&v[frames]) {
            *x = rotation::turn(*x, xyz(*v) * h);
        }
    }

    /// One row of [`Kinematics::drift`].
    #[inline(always)]
    pub fn moved(self, i: usize, x: Row, v: Row, h: Real) -> Row {
        if self.frames.contains(i) { rotation::turn(x, xyz(v) * h) } else { axpy(x, h, v) }
    }

    /// x' of one row of an equation of second order.
    #[inline(always)]
    fn rate(self, i: usize, x: Row, v: Row) -> Row {
        if self.frames.contains(i) { rotation::rate(x, xyz(v)) } else { v }
    }

    /// Scales frames back to length 1.
    fn normalize(self, x: &mut [Row]) {
        let [_, frames, _] = self.frames.cut(0, x.len());
        for q in &mut x[frames] {
            *q = crate::math::Quat::from_row(*q).normalized().row();
        }
    }
}

/// y' = f(y, t).
pub trait Equation {
    /// Points, frames and order.
    fn kinematics(&self) -> Kinematics;

    /// v' [m/s², rad/s²] at (t, x, v), or x' [m/s] for an equation of first order. The fourth number of every row is 0.
    fn rate(&mut self, t: f64, x: &[Row], v: &[Row], out: &mut [Row]) -> Result<(), StepError>;

    /// Solves the implicit stage x = x* + gh v, v = v* + gh rate(t, x, v) (or x = x* + gh rate(t, x)). On entry x and v
    /// are the guess.
    fn solve(&mut self, stage: &Stage<'_>, x: &mut [Row], v: &mut [Row], report: &mut StepReport) -> Result<(), StepError>;
}

/// An implicit stage: every implicit scheme here solves stages of this form.
#[derive(Debug, Clone, Copy)]
pub struct Stage<'a> {
    /// Time at which rates are taken [s].
    pub t: f64,
    /// The step times the scheme's coefficient [s].
    pub gh: f64,
    /// x*.
    pub x: &'a [Row],
    /// v*.
    pub v: &'a [Row],
}

/// Memory of a scheme between steps: columns of rows, and whether they are up to date with (x, v).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Memory {
    /// Rows of earlier steps; how many columns and what they hold is the scheme's business.
    pub columns: Vec<Vec<Row>>,
    /// Whether the columns belong to the current state. Whoever changes x or v from outside sets this to false, and the
    /// scheme starts anew from (x, v).
    pub ready: bool,
    /// Next step that an adaptive scheme tries [s]; 0 at the start.
    pub next_step: f64,
    /// Error of its last accepted step, over the tolerance; 0 at the start.
    pub last_error: f64,
}

impl Memory {
    /// Room for a scheme over n rows.
    pub fn new(scheme: Integrator, n: usize) -> Self {
        let count = match scheme {
            Integrator::Verlet | Integrator::Bdf2 | Integrator::DormandPrince => 2,
            Integrator::VelocityVerlet => 1,
            _ => 0,
        };
        Self { columns: vec![vec![ZERO; n]; count], ..Self::default() }
    }

    /// The columns.
    pub fn slices(&mut self) -> Vec<&mut [Row]> {
        self.columns.iter_mut().map(|c| &mut c[..]).collect()
    }
}

/// Rows for one step, kept between steps to save allocations.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    columns: Vec<Vec<Row>>,
}

impl Scratch {
    /// K columns of n rows; their contents are left over from earlier uses.
    fn take<const K: usize>(&mut self, n: usize) -> [&mut [Row]; K] {
        self.take_some(n, K)
    }

    /// K columns, of which the first `used` have n rows and the others none.
    fn take_some<const K: usize>(&mut self, n: usize, used: usize) -> [&mut [Row]; K] {
        if self.columns.len() < K {
            self.columns.resize_with(K, Vec::new);
        }
        for column in &mut self.columns[..used] {
            if column.len() != n {
                column.clear();
                column.resize(n, ZERO);
            }
        }
        let mut columns = self.columns.iter_mut();
        // There are at least K columns.
        std::array::from_fn(|_| columns.next().map_or(&mut [][..], |c| &mut c[..]))
    }
}

/// How many equal steps, none longer than `step` but for round-off, an interval dt [s] takes.
pub fn equal_steps(dt: f64, step: f64) -> f64 {
    (dt / step * (1.0 - 1e-9)).ceil().max(1.0)
}

/// By what part of a step the velocities of a scheme lag behind its positions: under a constant acceleration a it moves by
/// x_t+h = x_t + h (v_t + v_t+h)/2 + lead h² a, as if at the velocity v + lead h a.                (contact.14)
pub fn lead(scheme: Integrator) -> f64 {
    match scheme {
        Integrator::SymplecticEuler | Integrator::ImplicitEuler | Integrator::PositionBased => 0.5,
        Integrator::ForwardEuler => -0.5,
        Integrator::AdaptiveEuler => -0.25,
        _ => 0.0,
    }
}

/// A step of a scheme with a fixed step: x and v from t to t + h.
pub struct Step<'a, 'm> {
    /// The equation of motion.
    pub equation: &'a mut dyn Equation,
    /// Its start [s].
    pub t: f64,
    /// Its length [s].
    pub h: f64,
    /// Points and frames.
    pub x: &'a mut [Row],
    /// Their velocities.
    pub v: &'a mut [Row],
    /// The scheme's columns for these rows.
    pub memory: &'a mut [&'m mut [Row]],
    /// Whether they belong to (x, v); afterwards they do.
    pub ready: bool,
    /// Rows for one step.
    pub scratch: &'a mut Scratch,
    /// Its report.
    pub report: &'a mut StepReport,
}

/// Takes a step.
pub fn step(scheme: Integrator, mut step: Step<'_, '_>) -> Result<(), StepError> {
    match scheme {
        // Without elements, that is what position-based dynamics does.
        Integrator::SymplecticEuler | Integrator::PositionBased => split::symplectic_euler(step),
        Integrator::ModifiedEuler => split::modified_euler(step),
        Integrator::Verlet => split::verlet(step),
        Integrator::VelocityVerlet => split::velocity_verlet(step),
        Integrator::ImplicitEuler => implicit::euler(&mut step),
        Integrator::ImplicitMidpoint => implicit::midpoint(step),
        Integrator::Bdf2 => implicit::bdf2(step),
        explicit => runge_kutta::step(tableau(explicit), step),
    }
}
