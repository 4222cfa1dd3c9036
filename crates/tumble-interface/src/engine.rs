//! What a front sees of an engine, whatever its precision.

use crate::error::{SceneError, StepError};
use crate::frame::{Column, Frame};
pub use crate::measures::{Ledger, StepReport, Trial};
use crate::scene::Integrator;
use crate::warning::Warning;

/// Growth of the energy over its scale at which a run is stopped.
pub const BLOW_UP: f64 = 1000.0;

/// Who has how much of the ledger, and where their worst numbers are: whoever is to blame where a bound is broken.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct Account {
    /// The ledger of each system.
    pub systems: Vec<(String, Ledger)>,
    /// What objects have of them, where a system can tell them apart: mass, momenta, kinetic energy, speed, heat and volume.
    pub shares: Vec<Share>,
    /// The worst numbers of each system.
    pub worst: Vec<Worst>,
}

/// What one object has of the ledger.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Share {
    /// Its system.
    pub system: String,
    /// Its name.
    pub object: String,
    /// Its own ledger.
    pub ledger: Ledger,
}

/// The worst of something in the ledger.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Worst {
    /// Of what: the name of a number in the ledger.
    pub measure: &'static str,
    /// How much, in the unit of that.
    pub value: f64,
    /// The object.
    pub object: String,
    /// The other one, where two meet.
    pub other: Option<String>,
    /// Particles within the object.
    pub particles: Vec<usize>,
    /// Id of the particle, if an emitter has made it: its index says nothing.
    pub id: Option<u32>,
    /// Cell, on a grid.
    pub cell: Option<[usize; 3]>,
}

/// What is seen between two sub-steps of a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Inside {
    /// The state there. Systems go one after the other through an interval, so those whose turn has not come are still at its start.
    /// The index is that of the last whole frame.
    pub frame: Frame,
    /// The ledger there.
    pub ledger: Ledger,
    /// The system that took the last sub-step.
    pub system: String,
    /// Length of that sub-step [s].
    pub step: f64,
}

/// A force written by a user, on the masses of one system.
pub trait UserForce: Send + Sync {
    /// Forces [N] at time t [s] from positions [m], velocities [m/s] and masses [kg]; three numbers per mass, added to `force`.
    fn force(&mut self, t: f64, x: &[f64], v: &[f64], mass: &[f64], force: &mut [f64]) -> Result<(), String>;

    /// Of every mass the derivatives of its force by its own position [N/m] and velocity [N s/m], three rows of three numbers each; `None` if the
    /// force does not tell them. Implicit schemes converge faster with them; what they converge to is the same.
    fn jacobian(&mut self, t: f64, x: &[f64], v: &[f64], mass: &[f64]) -> Result<Option<Vec<[[f64; 9]; 2]>>, String> {
        let _ = (t, x, v, mass);
        Ok(None)
    }
}

/// Accelerations [m/s²] from time [s], positions [m] and velocities [m/s], three numbers per mass.
pub type Acceleration<'a> = dyn FnMut(f64, &[f64], &[f64]) -> Result<Vec<f64>, String> + Send + 'a;

/// An integrator written by a user, for one system.
pub trait UserIntegrator: Send + Sync {
    /// Takes x and v from t to t + h in place.
    fn step(&mut self, t: f64, h: f64, x: &mut [f64], v: &mut [f64], acceleration: &mut Acceleration<'_>) -> Result<(), String>;
}

/// The pre-flight estimate of one system.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Stability {
    /// System.
    pub system: String,
    /// Integrator in use.
    pub integrator: Integrator,
    /// Sub-step in use [s].
    pub step: f64,
    /// Highest angular frequency [rad/s].
    pub frequency: f64,
    /// Damping rate c of that mode in x'' + c x' + w² x = 0 [1/s].
    pub damping: f64,
    /// Highest damping rate of any mode [1/s].
    pub damping_max: f64,
    /// Object and particle that move most in the stiffest mode.
    pub culprit: Option<(String, usize)>,
    /// Limits of every integrator with a fixed step.
    pub limits: Vec<Limit>,
}

/// Predicted limits of an integrator; zero: no step will do; infinite: every one will.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Limit {
    /// The integrator.
    pub integrator: Integrator,
    /// Largest step at which no mode grows [s].
    pub stable: f64,
    /// Largest step at which no mode grows to [`BLOW_UP`] times its energy within 100 of its periods [s].
    pub usable: f64,
}

impl Stability {
    /// The limits of an integrator; `None` for those that choose their steps.
    pub fn limit(&self, integrator: Integrator) -> Option<Limit> {
        self.limits.iter().find(|l| l.integrator == integrator).copied()
    }
}

/// A change that was tried after a failure.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Cure {
    /// The override that makes the change: `system.0.step=0.001`.
    pub set: String,
    /// Whether the run got past the failure with it.
    pub survived: bool,
    /// Energy at the end of the trial over the energy's scale before it.
    pub energy_ratio: f64,
}

/// A simulation that can be stepped and read.
pub trait Engine: Send {
    /// Simulated time [s].
    fn time(&self) -> f64;

    /// Frames simulated so far.
    fn frame_index(&self) -> u64;

    /// Simulates one frame. `go_on` is asked between sub-steps; when it says no, the state goes back to the last
    /// frame and `Ok(None)` is returned. After an error the state is that of the last good frame, too.
    fn step(&mut self, go_on: &(dyn Fn() -> bool + Sync)) -> Result<Option<StepReport>, StepError>;

    /// Looks at the state after so many sub-steps of the next frame, all systems in turn; the world stays where it is. `None` where the
    /// frame has no more of them, and when `go_on` says no. A sub-step that breaks the state is an error.
    fn inside(&mut self, substeps: u64, columns: &[&str], go_on: &(dyn Fn() -> bool + Sync)) -> Result<Option<Inside>, StepError>;

    /// The current state: the named columns of every object that has them.
    fn frame(&self, columns: &[&str]) -> Frame;

    /// What does not change: triangles, links, masses, rest positions, collider meshes.
    fn topology(&self) -> Vec<Column>;

    /// The ledger, now.
    fn ledger(&self) -> Ledger;

    /// Who has how much of them, and where the worst is.
    fn account(&self) -> Account;

    /// Hash of everything that the next step depends on.
    fn hash(&self) -> u64;

    /// Everything that the next step depends on, as bytes (safetensors), with texts about it.
    fn save(&self, about: &[(&str, &str)]) -> Vec<u8>;

    /// Names of the systems.
    fn systems(&self) -> Vec<String>;

    /// Goes to a saved state of the same scene.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), SceneError>;

    /// After a state of another scene was taken over: what was chosen from that scene, as how many sub-steps an interval gets and what
    /// energies are measured against, is chosen anew from the state as it is now.
    fn reconsider(&mut self);

    /// Whether a step whose energy has exploded is an error; a state that is not finite always is.
    fn stop_on_explosion(&mut self, stop: bool);

    /// The largest stable steps, from the stiffest mode of each system as it is now; none of those for which `go_on` says no.
    fn stability(&mut self, go_on: &(dyn Fn() -> bool + Sync)) -> Vec<Stability>;

    /// After a failed step: changes of step or integrator, each tried from the last good frame.
    fn cures(&mut self, go_on: &(dyn Fn() -> bool + Sync)) -> Vec<Cure>;

    /// Warnings from building the scene.
    fn warnings(&self) -> &[Warning];

    /// Adds a user's force to the system of that name.
    fn add_force(&mut self, system: &str, force: Box<dyn UserForce>) -> Result<(), SceneError>;

    /// Replaces the integrator of the system of that name.
    fn replace_integrator(&mut self, system: &str, integrator: Box<dyn UserIntegrator>) -> Result<(), SceneError>;

    /// Sets a column (`position` or `velocity`) of an object, three numbers per mass.
    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Result<(), SceneError>;
}
