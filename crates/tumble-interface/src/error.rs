//! The errors that leave the engine. None of them is a panic; each names the place and the cure.

use std::fmt;

/// One thing wrong with a scene.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Issue {
    /// Path in the scene: `sheet "flag".links.bend`.
    pub path: String,
    /// Line of the scene file, counted from 1, where known.
    pub line: Option<usize>,
    /// The error and the expected value.
    pub message: String,
}

impl Issue {
    /// An issue at `path`, without a line. Both texts become one line each, without excess: they may quote names of any kind.
    pub fn new(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self { path: one_line(path.into(), LONGEST_PATH), line: None, message: one_line(message.into(), LONGEST_MESSAGE) }
    }

    /// An issue at `path`, on that line if there is one.
    pub fn on(line: Option<usize>, path: impl Into<String>, message: impl Into<String>) -> Self {
        Self { line, ..Self::new(path, message) }
    }
}

/// Longest path of an issue [characters].
const LONGEST_PATH: usize = 400;
/// Longest message of an issue [characters]; the longest of our own lists all keys of a force.
const LONGEST_MESSAGE: usize = 2000;

/// The text with control characters as escapes, cut off where it is longer than `most` characters.
fn one_line(text: String, most: usize) -> String {
    let mut text = if text.chars().any(char::is_control) {
        text.chars().map(|c| if c.is_control() { c.escape_default().to_string() } else { c.to_string() }).collect()
    } else {
        text
    };
    if let Some((cut, _)) = text.char_indices().nth(most) {
        text.truncate(cut);
        text.push_str("...");
    }
    text
}

impl fmt::Display for Issue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        if !self.path.is_empty() {
            write!(f, "{}: ", self.path)?;
        }
        f.write_str(&self.message)
    }
}

/// Everything that is wrong with a scene, all at once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneError {
    /// At least one issue, in the order of the file.
    pub issues: Vec<Issue>,
}

impl SceneError {
    /// An error with a single issue.
    pub fn one(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self { issues: vec![Issue::new(path, message)] }
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, issue) in self.issues.iter().enumerate() {
            if i > 0 {
                f.write_str("\n")?;
            }
            write!(f, "{issue}")?;
        }
        Ok(())
    }
}

impl std::error::Error for SceneError {}

/// Why a step could not be taken. The engine's state is that of the last good frame.
#[derive(Debug, Clone, PartialEq)]
pub enum StepError {
    /// A number stopped being finite.
    NotFinite(Box<Breakdown>),
    /// The energy grew beyond [`crate::engine::BLOW_UP`] times its scale.
    Exploded(Box<Breakdown>),
    /// An iterative solver did not reach its tolerance and the scene asked for an error.
    Solve {
        /// System that solved.
        system: String,
        /// Simulated time [s].
        time: f64,
        /// Iterations made.
        iterations: usize,
        /// Residual reached, relative to the first.
        residual: f64,
        /// Residual asked for.
        tolerance: f64,
    },
    /// The step that is needed is below the smallest useful one.
    StepTooSmall {
        /// System that stepped.
        system: String,
        /// Simulated time [s].
        time: f64,
        /// Step asked for [s].
        step: f64,
    },
    /// More would be needed than there may be.
    Capacity {
        /// System that needed it.
        system: String,
        /// Simulated time [s].
        time: f64,
        /// The exhausted resource, and the remedy.
        what: String,
    },
    /// A user's force or integrator failed.
    User(String),
}

impl StepError {
    /// The error with the name of the system that made it: schemes do not know whom they step.
    #[must_use]
    pub fn in_system(mut self, name: &str) -> Self {
        if let Self::Solve { system, .. } | Self::StepTooSmall { system, .. } = &mut self {
            *system = name.into();
        }
        self
    }
}

/// Place and time of a physical failure.
#[derive(Debug, Clone, PartialEq)]
pub struct Breakdown {
    /// System that broke.
    pub system: String,
    /// Object that holds the culprit.
    pub object: String,
    /// The column that failed first: `position` or `velocity`.
    pub column: String,
    /// Index of the particle within its object.
    pub index: usize,
    /// Id of the particle, if an emitter has made it: its index says nothing.
    pub id: Option<u32>,
    /// Cell and its middle [m], if it broke on a grid.
    pub cell: Option<([usize; 3], [f64; 3])>,
    /// Simulated time [s].
    pub time: f64,
    /// Integrator in use.
    pub integrator: String,
    /// Sub-step in use [s].
    pub step: f64,
    /// Largest stable sub-step by the pre-flight estimate [s]; zero if no step is stable, infinite if every step is.
    pub stable_step: f64,
    /// Energy over its scale, where it could be computed.
    pub energy_ratio: Option<f64>,
    /// The cause, if known: `force[0] gives no finite number at [0, 0, 1] m`.
    pub cause: Option<String>,
}

impl fmt::Display for Breakdown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { system, object, column, index, id, time, integrator, step, stable_step, .. } = self;
        if let Some((cell, place)) = self.cell {
            let place = place.map(short);
            write!(f, "system \"{system}\" at t = {} s: first bad {column} in \"{object}\", cell {cell:?} at {place:?} m", short(*time))?;
            if *stable_step > 0.0 && stable_step.is_finite() {
                write!(f, ", with steps of {step:.3e} s by {integrator}, whose largest stable step is {stable_step:.3e} s")?;
            }
            return write!(f, ". Use smaller sub-steps, or check sources and formulas there");
        }
        let step = if *step > 0.0 { format!(", step {step:.3e} s") } else { String::new() };
        write!(f, "system \"{system}\" ({integrator}{step}) at t = {} s: ", short(*time))?;
        match id {
            Some(id) => write!(f, "first bad {column} in emitter \"{object}\", the particle with id {id}. ")?,
            None => write!(f, "first bad {column} in \"{object}\", particle {index}. ")?,
        }
        if let Some(cause) = &self.cause {
            return write!(f, "{cause}");
        }
        if *stable_step == 0.0 {
            write!(f, "{integrator} has no stable step for this system")
        } else if stable_step.is_finite() {
            write!(f, "Largest stable step by estimate: {stable_step:.3e} s")
        } else {
            write!(f, "By the linear estimate every step is stable")
        }
    }
}

/// A number with six digits, and no more zeros than it needs.
fn short(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

impl fmt::Display for StepError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite(b) => write!(f, "not a finite number: {b}"),
            Self::Exploded(b) => {
                write!(f, "energy exploded")?;
                if let Some(ratio) = b.energy_ratio {
                    write!(f, " (x {ratio:.3e})")?;
                }
                write!(f, ": {b}")
            }
            Self::Solve { system, time, iterations, residual, tolerance } => write!(
                f,
                "system \"{system}\" at t = {} s: the solver stopped after {iterations} iterations at a relative residual of {residual:.2e}, asked for {tolerance:.2e}; \
                 raise solver.newton_iterations, take a smaller step, or set solver.on_failure = \"warn\"",
                short(*time)
            ),
            Self::StepTooSmall { system, time, step } => write!(
                f,
                "system \"{system}\" at t = {} s: a step of {step:.2e} s would be needed; loosen adaptive.tolerance, soften the \
                 stiffest spring, or use an implicit integrator",
                short(*time)
            ),
            Self::Capacity { system, time, what } => write!(f, "system \"{system}\" at t = {} s: {what}", short(*time)),
            Self::User(message) => f.write_str(message),
        }
    }
}

impl std::error::Error for StepError {}
