//! Every number of the ledger and of a step report, described once. Structs, merging, columns of `ledger.csv`, units of expectations, the
//! Python stub and the TypeScript types come from here; docs say how to add one (CONTRIBUTING, "Add a measure").
//!
//! What may be absent is an `Option`: zero is a value, `None` says that nothing in the world measures it. Types keep them apart wherever
//! numbers are merged; a NaN is a number that went wrong, and stays in every maximum. Fronts get `null` and `None`; `ledger.csv`, which holds
//! numbers alone, has `nan`. Sums over what there is (mass, energies, counts of steps) are never absent: over nothing they are 0.

use crate::columns::COLUMNS;
use crate::error::Issue;
use crate::kinds::KINDS;
use crate::looks;
use crate::scene::Expect;
use serde::ser::{Serialize, SerializeMap, Serializer};

/// How numbers of several intervals, or of several systems, become one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Merge {
    /// Their sum; of lists, one after the other.
    Sum,
    /// The largest; of ranges, the range that holds both.
    Max,
    /// The last one that was measured.
    Last,
}

/// What a number is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum About {
    /// All there is together.
    World,
    /// A single mass.
    Mass,
    /// A single link, piece of a rod or edge of a surface.
    Link,
    /// A single cell of a grid.
    Cell,
    /// A single sub-step.
    Step,
}

/// A number, or some that belong together.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Measure {
    /// As in the scene, the ledger and everywhere else.
    pub name: &'static str,
    /// SI unit, `1` for a pure number.
    pub unit: &'static str,
    /// What it is.
    pub doc: &'static str,
    /// What one value is about.
    pub about: About,
    /// Whether it may be less than zero.
    pub signed: bool,
    /// Its shape.
    pub shape: Shape,
    /// Whether there may be none.
    pub optional: bool,
    /// How those of one system in successive intervals merge.
    pub intervals: Merge,
    /// How those of several systems merge.
    pub systems: Merge,
    /// Names of its columns in `ledger.csv`; none where it is not there.
    pub columns: &'static [&'static str],
}

/// The numbers that a measure consists of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// A number.
    Real,
    /// A whole number.
    Whole,
    /// Three numbers, along x, y and z.
    Vector,
    /// The smallest and the largest.
    Range,
    /// Any count of numbers.
    Reals,
    /// Any count of steps that were tried; `ledger.csv` has the count.
    Trials,
}

/// A state of the world: over time, the last one counts.
const STATE: Measure = Measure {
    name: "",
    unit: "1",
    doc: "",
    about: About::World,
    signed: false,
    shape: Shape::Real,
    optional: false,
    intervals: Merge::Last,
    systems: Merge::Sum,
    columns: &[],
};

/// The worst in a state of the world.
const PEAK: Measure = Measure { systems: Merge::Max, ..STATE };

/// What a frame took: intervals and systems add up alike.
const EFFORT: Measure = Measure { intervals: Merge::Sum, ..STATE };

/// The worst of what a frame met.
const WORST: Measure = Measure { intervals: Merge::Max, ..PEAK };

/// A value that merges as its measure says.
trait Value: Clone {
    const SHAPE: Shape;
    const OPTIONAL: bool = false;
    fn merge(&mut self, other: &Self, how: Merge);
    fn is_measured(&self) -> bool {
        true
    }
}

impl Value for f64 {
    const SHAPE: Shape = Shape::Real;
    fn merge(&mut self, other: &Self, how: Merge) {
        *self = match how {
            Merge::Sum => *self + other,
            Merge::Max => larger(*self, *other),
            Merge::Last => *other,
        };
    }
}

impl Value for u64 {
    const SHAPE: Shape = Shape::Whole;
    fn merge(&mut self, other: &Self, how: Merge) {
        *self = match how {
            Merge::Sum => *self + other,
            Merge::Max => (*self).max(*other),
            Merge::Last => *other,
        };
    }
}

impl Value for [f64; 3] {
    const SHAPE: Shape = Shape::Vector;
    fn merge(&mut self, other: &Self, how: Merge) {
        self.iter_mut().zip(other).for_each(|(a, b)| a.merge(b, how));
    }
}

impl Value for (f64, f64) {
    const SHAPE: Shape = Shape::Range;
    fn merge(&mut self, other: &Self, how: Merge) {
        *self = if how == Merge::Last { *other } else { (self.0.min(other.0), self.1.max(other.1)) };
    }
}

impl<T: Value> Value for Option<T> {
    const SHAPE: Shape = T::SHAPE;
    const OPTIONAL: bool = true;
    fn merge(&mut self, other: &Self, how: Merge) {
        match (self, other) {
            (Some(a), Some(b)) => a.merge(b, how),
            (own @ None, Some(b)) => *own = Some(b.clone()),
            (_, None) => {}
        }
    }
    fn is_measured(&self) -> bool {
        self.is_some()
    }
}

impl Value for Vec<f64> {
    const SHAPE: Shape = Shape::Reals;
    fn merge(&mut self, other: &Self, how: Merge) {
        if how == Merge::Sum {
            self.extend(other);
        } else if !other.is_empty() {
            self.clone_from(other);
        }
    }
}

/// A step that an adaptive integrator tried.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Trial {
    /// Simulated time at its start [s].
    pub time: f64,
    /// Its length [s].
    pub step: f64,
    /// Its estimated error over the tolerance.
    pub error: f64,
    /// Whether it was kept.
    pub accepted: bool,
}

impl Value for Vec<Trial> {
    const SHAPE: Shape = Shape::Trials;
    fn merge(&mut self, other: &Self, _how: Merge) {
        let room = StepReport::MOST_TRIALS.saturating_sub(self.len());
        self.extend(other.iter().take(room));
    }
}

/// A table of measures: the struct that holds them, their descriptions in the same order, how two of them merge, and how they leave. Those
/// `via` a method follow from others; what is `beside` them is no measure and does not leave.
macro_rules! measures {
    ($(#[$about:meta])* $name:ident in $table:ident {
        $($(#[doc = $doc:literal])* $field:ident: $kind:ty = $how:expr;)*
    } via {
        $($(#[doc = $sum_doc:literal])* $sum:ident: $sum_kind:ty = $sum_how:expr;)*
    } and {
        $($(#[doc = $more_doc:literal])* $more:ident: $more_kind:ty = $more_how:expr;)*
    } beside {
        $($(#[doc = $extra:literal])* $beside:ident: $other:ty;)*
    }) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq, Default)]
        pub struct $name {
            $($(#[doc = $doc])* pub $field: $kind,)*
            $($(#[doc = $more_doc])* pub $more: $more_kind,)*
            $($(#[doc = $extra])* pub $beside: $other,)*
        }

        #[doc = concat!("What [`", stringify!($name), "`] holds, in the order in which it leaves.")]
        pub const $table: &[Measure] = &[
            $(described::<$kind>(stringify!($field), concat!($($doc),*), $how),)*
            $(described::<$sum_kind>(stringify!($sum), concat!($($sum_doc),*), $sum_how),)*
            $(described::<$more_kind>(stringify!($more), concat!($($more_doc),*), $more_how),)*
        ];

        impl $name {
            /// Adds what another system has, of the same time.
            pub fn add_system(&mut self, other: &Self) {
                $(self.$field.merge(&other.$field, const { $how }.systems);)*
                $(self.$more.merge(&other.$more, const { $more_how }.systems);)*
            }

            /// Whether anything measures the number of this name.
            pub fn measures(&self, name: &str) -> bool {
                match name {
                    $(stringify!($field) => self.$field.is_measured(),)*
                    $(stringify!($more) => self.$more.is_measured(),)*
                    $(stringify!($sum) => true,)*
                    _ => false,
                }
            }

            /// Adds what came later.
            pub fn add_interval(&mut self, other: &Self) {
                $(self.$field.merge(&other.$field, const { $how }.intervals);)*
                $(self.$more.merge(&other.$more, const { $more_how }.intervals);)*
            }
        }

        impl Serialize for $name {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                let mut map = serializer.serialize_map(Some($table.len()))?;
                $(map.serialize_entry(stringify!($field), &self.$field)?;)*
                $(map.serialize_entry(stringify!($sum), &self.$sum())?;)*
                $(map.serialize_entry(stringify!($more), &self.$more)?;)*
                map.end()
            }
        }
    };
}

const fn described<T: Value>(name: &'static str, doc: &'static str, how: Measure) -> Measure {
    Measure { name, doc: doc.trim_ascii(), shape: T::SHAPE, optional: T::OPTIONAL, ..how }
}

measures! {
    /// The ledger of the world at one time; `None`: nothing here measures it. [`LEDGER`] has units and rules.
    Ledger in LEDGER {
        /// Simulated time.
        time: f64 = Measure { unit: "s", systems: Merge::Last, columns: &["time"], ..STATE };
        /// Mass, pinned masses included.
        mass: f64 = Measure { unit: "kg", columns: &["mass"], ..STATE };
        /// Momentum.
        momentum: [f64; 3] = Measure { unit: "kg m/s", signed: true, columns: &["momentum_x", "momentum_y", "momentum_z"], ..STATE };
        /// Angular momentum about the origin.
        angular_momentum: Option<[f64; 3]> = Measure {
            unit: "kg m²/s",
            signed: true,
            columns: &["angular_momentum_x", "angular_momentum_y", "angular_momentum_z"],
            ..STATE
        };
        /// Kinetic energy.
        kinetic: f64 = Measure { unit: "J", columns: &["kinetic"], ..STATE };
        /// Potential energy of elements.
        elastic: f64 = Measure { unit: "J", signed: true, columns: &["elastic"], ..STATE };
        /// Potential energy of gravity and other forces that have one.
        external: f64 = Measure { unit: "J", signed: true, columns: &["external"], ..STATE };
    } via {
        /// Kinetic plus potential energy.
        energy: f64 = Measure { unit: "J", signed: true, columns: &["energy"], ..STATE };
    } and {
        /// Longest link, piece of a rod or edge of a membrane or fabric over its rest length.
        stretch: Option<f64> = Measure { about: About::Link, columns: &["stretch"], ..PEAK };
        /// Deepest mass inside a collider or its thickness, of those that are not held.
        penetration: Option<f64> = Measure { unit: "m", about: About::Mass, columns: &["penetration"], ..PEAK };
        /// Edges of soft surfaces that pass through triangles, those of solids with `edges` among them, where `self_contact` or
        /// `max_intersections` asks for their count.
        intersections: Option<u64> = Measure { columns: &["intersections"], ..STATE };
        /// Fastest mass, or fastest flow of a fluid.
        speed: Option<f64> = Measure { unit: "m/s", about: About::Mass, columns: &["speed"], ..PEAK };
        /// Masses that touch a collider.
        contacts: Option<u64> = Measure { columns: &["contacts"], ..STATE };
        /// Births that are due, and wait for room.
        waiting: Option<u64> = Measure { columns: &["waiting"], ..STATE };
        /// Links, joints and faces of glue between pieces that have broken so far.
        broken: Option<u64> = Measure { columns: &["broken"], ..STATE };
        /// Heat in bodies, above that at the start; in a plane for a metre across it.
        heat: Option<f64> = Measure { unit: "J", signed: true, columns: &["heat"], ..STATE };
        /// Heat that has come in through surfaces and from sources.
        heat_in: Option<f64> = Measure { unit: "J", signed: true, columns: &["heat_in"], ..STATE };
        /// Volume inside closed surfaces of soft objects, and of liquids on grids, in a plane for a metre across it.
        volume: Option<f64> = Measure { unit: "m³", signed: true, columns: &["volume"], ..STATE };
        /// People on the floor.
        people: Option<u64> = Measure { columns: &["people"], ..STATE };
        /// People who have left by exits so far.
        left: Option<u64> = Measure { columns: &["left"], ..STATE };
        /// People on the floor from whom no way leads to where they go.
        stranded: Option<u64> = Measure { columns: &["stranded"], ..STATE };
        /// People on the floor whom bodies have knocked down, and who will rise.
        fallen: Option<u64> = Measure { columns: &["fallen"], ..STATE };
        /// People on the floor whom bodies have injured so far.
        injured: Option<u64> = Measure { columns: &["injured"], ..STATE };
        /// Time that people have lost so far against walking freely, all together.
        lost: Option<f64> = Measure { unit: "s", signed: true, columns: &["lost"], ..STATE };
        /// Largest divergence of a gas's velocity in a cell.
        divergence: Option<f64> = Measure { unit: "1/s", about: About::Cell, columns: &["divergence"], ..PEAK };
    } beside {
    }
}

measures! {
    /// What one frame took; `None`: nothing of it was done. [`REPORT`] has units and rules.
    StepReport in REPORT {
        /// Sub-steps taken, all systems together.
        steps: u64 = Measure { columns: &["steps"], ..EFFORT };
        /// Sub-steps tried and rejected by adaptive integrators.
        rejected: u64 = Measure { columns: &["rejected"], ..EFFORT };
        /// Steps tried by adaptive integrators, in order: the first 65536; `steps` and `rejected` count all.
        trials: Vec<Trial> = Measure { columns: &["tried"], ..EFFORT };
        /// Newton iterations.
        newton: u64 = Measure { columns: &["newton"], ..EFFORT };
        /// Iterations of the linear solver.
        linear: u64 = Measure { columns: &["linear"], ..EFFORT };
        /// Largest final residual of a solver: of Newton's method relative to the first of its step, of a linear one to its start.
        residual: Option<f64> = Measure { about: About::Step, columns: &["residual"], ..WORST };
        /// Steps whose solver did not reach its tolerance.
        unconverged: u64 = Measure { columns: &["unconverged"], ..EFFORT };
        /// Energy taken out by the position clamp.
        clamped: f64 = Measure { unit: "J", signed: true, columns: &["clamped"], ..EFFORT };
        /// Cells that the fastest fluid on a grid passed in a sub-step, at most.
        courant: Option<f64> = Measure { about: About::Step, columns: &["courant"], ..WORST };
        /// Smallest and largest sub-step.
        step_range: Option<(f64, f64)> = Measure { unit: "s", about: About::Step, columns: &["smallest_step", "largest_step"], ..WORST };
        /// Sweeps over the elements of position-based systems.
        sweeps: u64 = Measure { columns: &["sweeps"], ..EFFORT };
        /// Passes through exchange intervals that `world.coupling` repeats.
        passes: u64 = Measure { columns: &["passes"], ..EFFORT };
        /// Change of the impulses on a system in the last pass through an interval, relative to them, at most.
        disagreement: Option<f64> = Measure { systems: Merge::Last, columns: &["disagreement"], ..WORST };
        /// Links that broke.
        broken: u64 = EFFORT;
        /// Residuals of the last pressure solve after each iteration, relative to its start.
        pressure: Vec<f64> = Measure { intervals: Merge::Last, systems: Merge::Last, ..STATE };
    } via {
    } and {
    } beside {
        /// Length of the last sub-step, and of all together [s]; for those who look inside a frame.
        way: (f64, f64);
    }
}

/// An expectation, and what it bounds.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Bound {
    /// Its key in `[expect]`.
    pub name: &'static str,
    /// The measure in the ledger.
    pub measure: &'static str,
    /// What of it.
    pub how: How,
}

/// What of a measure is bounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum How {
    /// The number at every frame.
    Value,
    /// How far it is from the one at the start, at every frame.
    Change,
    /// The same over the one at the start.
    Error,
    /// How far the energy is from the one at the start, over the largest kinetic or potential energy so far.
    Drift,
    /// By how much it has grown, over the same.
    Growth,
    /// What the bodies have gained less what came in, over the largest of both so far.
    Balance,
    /// The number at the last frame.
    Last,
    /// The number at the last frame, which must be the expected one.
    Exact,
}

/// All bounds of `[expect]` on measures.
pub const BOUNDS: &[Bound] = &[
    Bound { name: "max_stretch", measure: "stretch", how: How::Value },
    Bound { name: "max_penetration", measure: "penetration", how: How::Value },
    Bound { name: "max_intersections", measure: "intersections", how: How::Value },
    Bound { name: "max_speed", measure: "speed", how: How::Value },
    Bound { name: "max_energy_drift", measure: "energy", how: How::Drift },
    Bound { name: "max_energy_growth", measure: "energy", how: How::Growth },
    Bound { name: "max_final_kinetic", measure: "kinetic", how: How::Last },
    Bound { name: "max_mass_error", measure: "mass", how: How::Error },
    Bound { name: "max_momentum_change", measure: "momentum", how: How::Change },
    Bound { name: "max_angular_momentum_change", measure: "angular_momentum", how: How::Change },
    Bound { name: "max_volume_error", measure: "volume", how: How::Error },
    Bound { name: "max_divergence", measure: "divergence", how: How::Value },
    Bound { name: "max_heat_error", measure: "heat", how: How::Balance },
    Bound { name: "people", measure: "people", how: How::Exact },
    Bound { name: "broken_links", measure: "broken", how: How::Exact },
];

impl Bound {
    /// What it bounds.
    pub fn of(&self) -> Option<&'static Measure> {
        LEDGER.iter().find(|measure| measure.name == self.measure)
    }

    /// SI unit, `1` for a pure number.
    pub fn unit(&self) -> &'static str {
        match self.how {
            How::Value | How::Change | How::Last | How::Exact => self.of().map_or("1", |measure| measure.unit),
            How::Error | How::Drift | How::Growth | How::Balance => "1",
        }
    }

    /// The bounds that a scene asks for.
    pub fn asked(expect: &Expect) -> impl Iterator<Item = &'static Bound> {
        let tree = serde_json::to_value(expect).unwrap_or_default();
        BOUNDS.iter().filter(move |bound| tree.get(bound.name).is_some_and(|value| !value.is_null()))
    }

    /// What is wrong with a bound where the ledger has no such number.
    pub fn idle(&self) -> Issue {
        let message =
            format!("{} bounds nothing here: the scene has nothing of which {} is measured; leave it out", self.name, self.measure);
        Issue::new(format!("expect.{}", self.name), message)
    }
}

/// All tables as they leave: `ledger`, `report`, `bounds` with their units, `columns` and `kinds`, `forms` and `looks`.
pub fn tables() -> serde_json::Value {
    let bound = |bound: &Bound| serde_json::json!({ "name": bound.name, "measure": bound.measure, "how": bound.how, "unit": bound.unit() });
    let bounds: Vec<_> = BOUNDS.iter().map(bound).collect();
    let (forms, looks) = (looks::FORMS, looks::CONSTANTS);
    serde_json::json!({
        "ledger": LEDGER, "report": REPORT, "bounds": bounds, "columns": COLUMNS, "kinds": KINDS, "forms": forms, "looks": looks,
    })
}

impl Ledger {
    /// Kinetic plus potential energy [J].
    pub fn energy(&self) -> f64 {
        self.kinetic + self.elastic + self.external
    }
}

impl StepReport {
    /// A tolerance that is far too small may take any number of them.
    pub const MOST_TRIALS: usize = 1 << 16;

    /// Logs a step that was tried.
    pub fn tried(&mut self, trial: Trial) {
        if self.trials.len() < Self::MOST_TRIALS {
            self.trials.push(trial);
        }
    }

    /// Counts a sub-step of length h [s].
    pub fn stepped(&mut self, h: f64) {
        self.steps += 1;
        self.way = (h, self.way.1 + h);
        self.step_range = Some(self.step_range.map_or((h, h), |(a, b)| (a.min(h), b.max(h))));
    }

    /// Notes the final residual of a solver. NaN stays.
    pub fn left(&mut self, residual: f64) {
        worst(&mut self.residual, residual);
    }

    /// Notes how far systems are from agreeing. NaN stays.
    pub fn disagree(&mut self, gap: f64) {
        worst(&mut self.disagreement, gap);
    }

    /// Notes how many cells a fluid passed in a sub-step. NaN stays.
    pub fn passed(&mut self, cells: f64) {
        worst(&mut self.courant, cells);
    }
}

fn worst(most: &mut Option<f64>, value: f64) {
    *most = Some(most.map_or(value, |most| larger(most, value)));
}

/// The larger of two numbers; NaN is larger than any.
fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}
