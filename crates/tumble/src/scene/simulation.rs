//! A scene in motion: what fronts hold in their hands.

use super::Assets;
use super::build::build;
use super::cures;
use super::methods::resolve;
use crate::world::World;
use tumble_interface::engine::{Account, Cure, Engine, Inside, Ledger, Stability, StepReport, UserForce, UserIntegrator};
use tumble_interface::measures::Bound;
use tumble_interface::scene::Integrator;
use tumble_interface::{Column, Frame, Issue, Scene, SceneError, StepError, Warning};

/// A world together with the scene that it was built from.
pub struct Simulation {
    scene: Scene,
    assets: Assets,
    world: World,
    warnings: Vec<Warning>,
    /// The failure of the last step: index and step of the system.
    failure: Option<(usize, f64)>,
}

impl Simulation {
    /// Builds a scene. Meshes that it names are in `assets`, by their path.
    pub fn new(scene: Scene, assets: Assets) -> Result<Self, SceneError> {
        let scene = resolve(scene);
        let built = build(&scene, &assets)?;
        idle_bounds(&scene, &built.world)?;
        Ok(Self { scene, assets, world: built.world, warnings: built.warnings, failure: None })
    }

    /// The scene that it was built from, resolved.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    fn system_error(&self, system: &str, message: &str) -> SceneError {
        let names = self.world.names();
        if names.contains(&system) {
            return SceneError::one(format!("system \"{system}\""), message);
        }
        let hint = tumble_interface::check::suggestion(system, names.iter().copied());
        SceneError::one(format!("system \"{system}\""), format!("there is no such system{hint} (systems: {})", names.join(", ")))
    }
}

/// Bounds on what nothing measures are errors: they would be kept whatever happens.
fn idle_bounds(scene: &Scene, world: &World) -> Result<(), SceneError> {
    let bounds: Vec<_> = Bound::asked(&scene.expect).filter(|bound| bound.of().is_some_and(|measure| measure.optional)).collect();
    if bounds.is_empty() {
        return Ok(());
    }
    let ledger = world.ledger();
    let issues: Vec<Issue> = bounds.iter().filter(|bound| !ledger.measures(bound.measure)).map(|bound| bound.idle()).collect();
    if issues.is_empty() { Ok(()) } else { Err(SceneError { issues }) }
}

impl Engine for Simulation {
    fn time(&self) -> f64 {
        self.world.time()
    }

    fn frame_index(&self) -> u64 {
        self.world.frame_index()
    }

    fn step(&mut self, go_on: &(dyn Fn() -> bool + Sync)) -> Result<Option<StepReport>, StepError> {
        self.failure = None;
        let result = self.world.step(go_on);
        for warning in self.world.disagreements() {
            if !self.warnings.contains(warning) {
                self.warnings.push(warning.clone());
            }
        }
        if let Err(error) = &result {
            let (name, step) = match error {
                StepError::NotFinite(b) | StepError::Exploded(b) => (b.system.as_str(), b.step),
                StepError::Solve { system, .. } | StepError::StepTooSmall { system, .. } => (system.as_str(), 0.0),
                StepError::Capacity { .. } | StepError::User(_) => ("", 0.0),
            };
            self.failure = self.world.names().iter().position(|n| *n == name).map(|i| (i, step));
        }
        result
    }

    fn frame(&self, columns: &[&str]) -> Frame {
        let time = self.world.time();
        Frame { time, index: self.world.frame_index(), columns: self.world.columns(time, columns) }
    }

    fn inside(&mut self, substeps: u64, columns: &[&str], go_on: &(dyn Fn() -> bool + Sync)) -> Result<Option<Inside>, StepError> {
        self.world.inside(substeps, go_on, |world, time, system, step| {
            let frame = Frame { time, index: world.frame_index(), columns: world.columns(time, columns) };
            Inside { frame, ledger: world.ledger_at(time), system: system.into(), step }
        })
    }

    fn topology(&self) -> Vec<Column> {
        self.world.topology()
    }

    fn ledger(&self) -> Ledger {
        self.world.ledger()
    }

    fn account(&self) -> Account {
        self.world.account()
    }

    fn hash(&self) -> u64 {
        self.world.hash()
    }

    fn save(&self, about: &[(&str, &str)]) -> Vec<u8> {
        self.world.save(about)
    }

    fn systems(&self) -> Vec<String> {
        self.world.names().into_iter().map(str::to_string).collect()
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), SceneError> {
        self.failure = None;
        self.world.restore(bytes)
    }

    fn reconsider(&mut self) {
        self.world.reconsider();
    }

    fn stop_on_explosion(&mut self, stop: bool) {
        self.world.stop_on_explosion(stop);
    }

    fn stability(&mut self, go_on: &(dyn Fn() -> bool + Sync)) -> Vec<Stability> {
        self.world.stability(go_on)
    }

    fn cures(&mut self, go_on: &(dyn Fn() -> bool + Sync)) -> Vec<Cure> {
        let Some((system, step)) = self.failure else { return Vec::new() };
        let plan = &self.scene.system[system];
        // The estimate is that of the start, where the trials begin.
        let Ok(mut start) = Self::new(self.scene.clone(), self.assets.clone()) else { return Vec::new() };
        let stability = start.stability(go_on).into_iter().find(|s| s.system == plan.name);
        let usable: Vec<(Integrator, f64)> = stability.iter().flat_map(|s| s.limits.iter().map(|l| (l.integrator, l.usable))).collect();
        let step = if step > 0.0 { step } else { stability.map_or(self.scene.frame_time(), |s| s.step) };
        let begin = |scene| Self::new(scene, self.assets.clone());
        cures::cures(&self.scene, &begin, self.world.frame_index() + 1, system, step, &usable, go_on)
    }

    fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    fn add_force(&mut self, system: &str, force: Box<dyn UserForce>) -> Result<(), SceneError> {
        match self.world.add_force(system, force) {
            Some(true) => Ok(()),
            _ => Err(self.system_error(system, "it moves particles without mass, which feel no force")),
        }
    }

    fn replace_integrator(&mut self, system: &str, integrator: Box<dyn UserIntegrator>) -> Result<(), SceneError> {
        match self.world.system(system).map(|s| s.replace_integrator(integrator)) {
            Some(true) => Ok(()),
            _ => Err(self.system_error(
                system,
                "it is no system of forces and velocities that another scheme could integrate; \
                 give it an integrator other than \"position_based\"",
            )),
        }
    }

    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Result<(), SceneError> {
        if let Some(i) = values.iter().position(|v| !v.is_finite()) {
            return Err(SceneError {
                issues: vec![Issue::new(format!("{object}.{column}"), format!("number {i} is {}, expected a finite one", values[i]))],
            });
        }
        match self.world.write(object, column, values) {
            Some(true) => Ok(()),
            Some(false) => Err(SceneError::one(format!("{object}.{column}"), "expected position or velocity, three numbers for each mass")),
            None => Err(SceneError::one(object, "there is no such object")),
        }
    }
}
