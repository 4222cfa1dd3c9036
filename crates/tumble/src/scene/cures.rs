//! After a failure: changes of step or integrator, each tried.

use super::methods::rules;
use crate::systems::dynamics::MOST_SUBSTEPS;
use tumble_interface::SceneError;
use tumble_interface::engine::{BLOW_UP, Cure, Engine};
use tumble_interface::scene::{Integrator, Scene};

/// A trial may take this many times the sub-steps of the run that failed, and this many more [steps].
const COST: (f64, f64) = (50.0, 20_000.0);

/// Tries changes of the system that failed from the start of the resolved scene to two frames beyond the failure.
///
/// `failed` is the frame that failed, counted from 1; `system` the index of the system, with the step it used and the
/// usable steps of other integrators, as estimated before the failure. `begin` starts a trial.
pub fn cures<E: Engine>(
    scene: &Scene,
    begin: &dyn Fn(Scene) -> Result<E, SceneError>,
    failed: u64,
    system: usize,
    step: f64,
    usable: &[(Integrator, f64)],
    go_on: &(dyn Fn() -> bool + Sync),
) -> Vec<Cure> {
    let dt = scene.interval();
    let plan = &scene.system[system];
    let (own, method) = (plan.integrator, rules(plan.method));
    let usable_step = |i: Integrator| usable.iter().find(|(integrator, _)| *integrator == i).map_or(0.0, |(_, step)| *step);
    let substeps = |limit: f64| (limit > 0.0).then(|| (dt / (0.7 * limit)).ceil().clamp(1.0, MOST_SUBSTEPS) as u32);
    let mut trials: Vec<(Integrator, u32)> = Vec::new();
    // Where even an automatic step was refused as too small, implicit schemes are tried with one.
    let now = (dt / step).round().max(1.0);
    let now = if now > MOST_SUBSTEPS { 1 } else { now as u32 };
    for integrator in [own, Integrator::SymplecticEuler, Integrator::Rk4, Integrator::ImplicitEuler] {
        let n = if integrator.is_implicit() { Some(now) } else { substeps(usable_step(integrator)).map(|n| n.max(now)) };
        // The same again, or what was tried already, helps nobody.
        if let Some(n) = n
            && (integrator, n) != (own, now)
            && !trials.contains(&(integrator, n))
            && method.refusal(integrator).is_none()
        {
            trials.push((integrator, n));
        }
    }
    let budget = COST.0 * f64::from(now) + COST.1;
    trials.retain(|(_, n)| f64::from(*n) <= budget);
    trials.into_iter().map(|(integrator, n)| attempt(scene, begin, failed, system, integrator, n, go_on)).collect()
}

fn attempt<E: Engine>(
    scene: &Scene,
    begin: &dyn Fn(Scene) -> Result<E, SceneError>,
    failed: u64,
    system: usize,
    integrator: Integrator,
    n: u32,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Cure {
    let mut changed = scene.clone();
    let plan = &mut changed.system[system];
    let mut set = Vec::new();
    if plan.integrator != integrator {
        set.push(format!("system.{system}.integrator={}", integrator.name()));
    }
    let dt = scene.interval();
    if plan.step.is_some() {
        plan.step = Some(dt / f64::from(n));
        set.push(format!("system.{system}.step={:e}", dt / f64::from(n)));
    } else {
        plan.substeps = Some(n);
        set.push(format!("system.{system}.substeps={n}"));
    }
    plan.integrator = integrator;
    if !matches!(integrator, Integrator::ModifiedEuler | Integrator::Verlet) {
        plan.clamp = None;
    }
    let mut cure = Cure { set: set.join(" "), survived: false, energy_ratio: f64::NAN };
    let Ok(mut trial) = begin(changed) else { return cure };
    let start = trial.ledger();
    let mut scale = start.kinetic.max(start.elastic);
    for _ in 0..failed + 2 {
        if !matches!(trial.step(go_on), Ok(Some(_))) {
            return cure;
        }
        let ledger = trial.ledger();
        scale = scale.max(ledger.kinetic).max(ledger.elastic).max((ledger.external - start.external).abs());
    }
    let growth = if scale > 0.0 { (trial.ledger().energy() - start.energy()) / scale } else { 0.0 };
    cure.energy_ratio = growth;
    cure.survived = growth < BLOW_UP;
    cure
}
